//! The text of files and of field values.

use std::borrow::Cow;
use std::sync::Arc;

use super::File;
use crate::Warnings;

/// Without the mark of UTF-8 that some programs write.
pub(crate) fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// The text of a file; bytes that are no UTF-8 are taken for Latin-1.
pub(crate) fn decode<'a>(
    bytes: &'a [u8],
    file: &Arc<File>,
    warnings: &mut Warnings,
) -> Cow<'a, str> {
    let wide = |read: fn([u8; 2]) -> u16| {
        let (units, _) = bytes[2..].as_chunks();
        let units = units.iter().map(|&unit| read(unit));
        let chars = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
        Cow::Owned(chars.collect())
    };
    match bytes {
        [0xff, 0xfe, ..] => return wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => return wide(u16::from_be_bytes),
        _ => {}
    }
    let bytes = without_mark(bytes);
    match str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(problem) => {
            let before = &bytes[..problem.valid_up_to()];
            let text = "not UTF-8 from here on; read as Latin-1";
            warnings.invalid(file.place(1 + newlines(before), ""), text);
            Cow::Owned(bytes.iter().map(|&b| char::from(b)).collect())
        }
    }
}

fn newlines(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&b| b == b'\n').count()
}

/// The line of a place in a text, for places that only go forward.
#[derive(Debug)]
pub(crate) struct Lines<'a> {
    text: &'a str,
    position: usize,
    line: usize,
}

impl<'a> Lines<'a> {
    pub(crate) fn new(text: &'a str) -> Self {
        Self {
            text,
            position: 0,
            line: 1,
        }
    }

    /// The line at a position in bytes.
    pub(crate) fn at(&mut self, position: usize) -> usize {
        let position = position.clamp(self.position, self.text.len());
        self.line += newlines(&self.text.as_bytes()[self.position..position]);
        self.position = position;
        self.line
    }
}

/// The words of a value; commas are white space.
pub(super) fn words(text: &str) -> impl Iterator<Item = &str> {
    let words = text.split(|c: char| c == ',' || c.is_ascii_whitespace());
    words.filter(|word| !word.is_empty())
}

/// A whole number. VRML 97 allows hexadecimal ones, and some programs write a point behind.
pub(super) fn whole(text: &str) -> Option<i64> {
    let word = text.trim_matches(|c: char| c == ',' || c.is_ascii_whitespace());
    let (sign, bare) = word.strip_prefix('-').map_or((1, word), |bare| (-1, bare));
    if let Some(digits) = bare.strip_prefix("0x").or_else(|| bare.strip_prefix("0X")) {
        return Some(sign * i64::from(u32::from_str_radix(digits, 16).ok()?));
    }
    let (whole, fraction) = word.split_once('.').unwrap_or((word, ""));
    let is_whole = fraction.bytes().all(|b| b == b'0');
    whole.parse().ok().filter(|_| is_whole)
}

/// The strings of a value: what stands in quotes, or all of it if nothing does. A backslash
/// keeps the character after it as it is.
pub(super) fn strings(text: &str) -> Vec<String> {
    let bare = text.trim();
    if !bare
        .trim_start_matches([',', ' ', '\t', '\r', '\n'])
        .starts_with('"')
    {
        return Vec::from_iter((!bare.is_empty()).then(|| bare.to_owned()));
    }
    let (mut strings, mut open): (Vec<String>, Option<String>) = (Vec::new(), None);
    let mut chars = text.chars();
    while let Some(c) = chars.next() {
        match (&mut open, c) {
            (None, '"') => open = Some(String::new()),
            (None, _) => {}
            (Some(_), '"') => strings.extend(open.take()),
            (Some(string), '\\') => string.extend(chars.next()),
            (Some(string), c) => string.push(c),
        }
    }
    strings.extend(open);
    strings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_are_what_stands_in_quotes() {
        let cases: [(&str, &[&str]); 7] = [
            ("", &[]),
            ("a b.wrl", &["a b.wrl"]),
            ("\"a\" \"b c\"", &["a", "b c"]),
            ("\"a\",\"\",", &["a", ""]),
            (" ,\n\"a\" , \"b\"", &["a", "b"]),
            (r#""a \"b\" \\""#, &[r#"a "b" \"#]),
            ("\"cut", &["cut"]),
        ];
        for (text, expected) in cases {
            assert_eq!(strings(text), expected, "{text}");
        }
    }
}
