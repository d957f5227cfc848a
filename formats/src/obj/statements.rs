//! From bytes to statements: text encodings, lines, continuation, numbers and references.
//!
//! Everything is cut out of the text as it stands; only lines joined by `\` are copied.

use std::borrow::Cow;
use std::ops::Range;

/// The text of a file: UTF-16, with a byte order mark or told by the zeros of its first two
/// characters, or UTF-8; damaged characters are replaced.
pub(crate) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    let wide = |rest: &[u8], unit: fn([u8; 2]) -> u16| -> Cow<'_, str> {
        let units = rest.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
        let text = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
        Cow::Owned(text.collect())
    };
    match bytes {
        [0xff, 0xfe, rest @ ..] => wide(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => wide(rest, u16::from_be_bytes),
        [1..=255, 0, 1..=255, 0, ..] => wide(bytes, u16::from_le_bytes),
        [0, 1..=255, 0, 1..=255, ..] => wide(bytes, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => String::from_utf8_lossy(rest),
        // Faster than the other where nothing is damaged.
        _ => std::str::from_utf8(bytes)
            .map_or_else(|_| String::from_utf8_lossy(bytes), Cow::Borrowed),
    }
}

/// One statement: a keyword and its arguments, on one line or on several joined ones.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Statement<'a> {
    /// The line it begins on, from 1 on.
    pub(crate) line: usize,
    /// Whether a `\` stood in the middle of a line.
    pub(super) misprinted: bool,
    text: Cow<'a, str>,
    /// Where the keyword ends.
    split: usize,
    /// Where its line stands in the whole text, with the line feed; empty if it has none.
    place: Range<usize>,
}

impl<'a> Statement<'a> {
    fn new(line: usize, text: Cow<'a, str>) -> Self {
        let split = text.bytes().position(|b| b.is_ascii_whitespace());
        Self {
            line,
            misprinted: false,
            split: split.unwrap_or(text.len()),
            text,
            place: 0..0,
        }
    }

    /// The first word.
    pub(crate) fn keyword(&self) -> &str {
        &self.text[..self.split]
    }

    /// The words after the keyword, up to a comment.
    pub(crate) fn arguments(&self) -> impl Iterator<Item = &str> + Clone {
        let words = self.text[self.split..].split_ascii_whitespace();
        words.take_while(|word| !word.starts_with('#'))
    }

    /// The first `N` words as numbers, without a list; also how many words there are, up to
    /// `N + 1`.
    pub(super) fn some_numbers<const N: usize>(&self) -> Result<([f64; N], usize), String> {
        if let Some(found) = self.short_numbers() {
            return Ok(found);
        }
        let (mut found, mut count) = ([0.0; N], 0);
        for word in self.arguments().take(N + 1) {
            if count < N {
                found[count] = number(word)?;
            }
            count += 1;
        }
        Ok((found, count))
    }

    /// The same in one go, if there are short numbers and nothing else.
    fn short_numbers<const N: usize>(&self) -> Option<([f64; N], usize)> {
        let (mut found, mut count) = ([0.0; N], 0);
        let mut rest = self.text.as_bytes()[self.split..].trim_ascii_start();
        while !rest.is_empty() {
            let (number, length) = short_number(rest)?;
            *found.get_mut(count)? = number;
            count += 1;
            rest = rest[length..].trim_ascii_start();
        }
        Some((found, count))
    }

    /// Where its line stands in the text, if there is nothing else in it.
    pub(super) fn plain(&self) -> Option<Range<usize>> {
        let is_own = matches!(self.text, Cow::Owned(_));
        if is_own || self.place.is_empty() || memchr::memchr(b'#', self.text.as_bytes()).is_some() {
            return None;
        }
        Some(self.place.clone())
    }

    /// All that follows the keyword, for names with blanks.
    pub(crate) fn rest(&self) -> &str {
        self.text[self.split..].trim()
    }
}

/// Statements whose argument is a name, in which `\` is an ordinary character.
const NAMING: [&str; 8] = [
    "o", "g", "usemtl", "mtllib", "call", "csh", "usemap", "maplib",
];

/// Cuts a text into statements; blank lines and comments are left out.
#[derive(Clone, Debug)]
pub(crate) struct Statements<'a> {
    rest: &'a str,
    /// How long the text is.
    length: usize,
    line: usize,
    /// What ends a line; old files use a lone carriage return.
    end: u8,
    /// Whether any line may go on.
    continued: bool,
}

impl<'a> Statements<'a> {
    /// The statements of `text`.
    pub(crate) fn new(text: &'a str) -> Self {
        let end = if text.contains('\n') { b'\n' } else { b'\r' };
        Self {
            rest: text,
            length: text.len(),
            line: 0,
            end,
            continued: text.contains('\\'),
        }
    }

    /// The next line without blanks around it.
    fn next_line(&mut self) -> Option<&'a str> {
        if self.rest.is_empty() {
            return None;
        }
        let end = memchr::memchr(self.end, self.rest.as_bytes());
        let (line, rest) = end.map_or((self.rest, ""), |end| {
            (&self.rest[..end], &self.rest[end + 1..])
        });
        self.rest = rest;
        self.line += 1;
        Some(line.trim())
    }

    /// Joins `first` with the lines that continue it.
    fn joined(&mut self, first: &'a str) -> Statement<'a> {
        let line = self.line;
        let (mut text, mut part) = (String::new(), first);
        while let Some(open) = part.strip_suffix('\\') {
            text.push_str(open);
            text.push(' ');
            part = self.next_line().unwrap_or("");
        }
        text.push_str(part);
        let named = text
            .split_whitespace()
            .next()
            .is_some_and(|word| NAMING.contains(&word));
        let misprinted = !named && text.split_whitespace().any(|word| word == "\\");
        if misprinted {
            text = text.replace('\\', " ");
            self.join_numbers(&mut text);
        }
        // The first line may hold nothing but the sign that it goes on.
        let text = text.trim().to_owned();
        Statement {
            misprinted,
            ..Statement::new(line, Cow::Owned(text))
        }
    }

    /// Appends the lines that begin with a number, as after a `\` that lost its place.
    fn join_numbers(&mut self, text: &mut String) {
        loop {
            let before = (self.rest, self.line);
            let next = self.next_line().unwrap_or("");
            let word = next.split_whitespace().next().unwrap_or("");
            if word.is_empty() || number(word).is_err() {
                (self.rest, self.line) = before;
                return;
            }
            text.push(' ');
            text.push_str(next.trim_end_matches('\\'));
        }
    }
}

impl<'a> Iterator for Statements<'a> {
    type Item = Statement<'a>;

    fn next(&mut self) -> Option<Statement<'a>> {
        loop {
            let start = self.length - self.rest.len();
            let text = self.next_line()?;
            if text.is_empty() || text.starts_with('#') {
                continue;
            }
            if self.continued && text.contains('\\') {
                return Some(self.joined(text));
            }
            let mut statement = Statement::new(self.line, Cow::Borrowed(text));
            if self.end == b'\n' && !self.rest.is_empty() {
                statement.place = start..self.length - self.rest.len();
            }
            return Some(statement);
        }
    }
}

/// A word of the file for a message, shortened.
pub(super) fn shown(word: &str) -> String {
    let mut text: String = word.chars().take(40).collect();
    if text.len() < word.len() {
        text.push_str("...");
    }
    text
}

/// A finite number.
pub(crate) fn number(word: &str) -> Result<f64, String> {
    if let Some((x, length)) = short_number(word.as_bytes())
        && length == word.len()
    {
        return Ok(x);
    }
    match word.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("\"{}\" is not a finite number", shown(word))),
    }
}

/// A number at the start of a text, and the length of its word, if it has no exponent and is one
/// correctly rounded quotient: digits below 2^53 over a power of ten.
fn short_number(text: &[u8]) -> Option<(f64, usize)> {
    const POWERS: [f64; 16] = [
        1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
    ];
    let digits = text.strip_prefix(b"-").unwrap_or(text);
    let (mut number, mut point, mut length) = (0_u64, None, 0);
    for byte in digits {
        match byte {
            // More digits than there are powers are no short number, however they come out.
            b'0'..=b'9' => number = number.wrapping_mul(10).wrapping_add(u64::from(byte - b'0')),
            b'.' if point.is_none() => point = Some(length),
            _ if byte.is_ascii_whitespace() => break,
            _ => return None,
        }
        length += 1;
    }
    if length > POWERS.len() {
        return None;
    }
    let decimals = point.map_or(0, |place| length - 1 - place);
    if length == usize::from(point.is_some()) || number >= 1 << 53 {
        return None;
    }
    let size = number as f64 / POWERS[decimals];
    let sign = text.len() - digits.len();
    Some((if sign > 0 { -size } else { size }, length + sign))
}

/// All words as numbers.
pub(super) fn numbers<'a>(words: impl Iterator<Item = &'a str>) -> Result<Vec<f64>, String> {
    words.map(number).collect()
}

/// The position in a list of `count` entries that a reference means: 1 is the first entry,
/// -1 the latest one. `list` names the entries in messages.
pub(crate) fn reference(word: &str, count: usize, list: &str) -> Result<usize, String> {
    let number: i64 = word
        .parse()
        .map_err(|_| format!("\"{}\" is not a reference to {list}", shown(word)))?;
    let index = match usize::try_from(number.unsigned_abs()) {
        Ok(0) => return Err(format!("reference 0 to {list}; the first one is 1")),
        Ok(n) if n <= count && number > 0 => Some(n - 1),
        Ok(n) if n <= count => Some(count - n),
        _ => None,
    };
    index.ok_or_else(|| {
        format!("reference {number} to {list}, of which there are {count} at this line")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &str) -> Vec<(usize, String)> {
        let statements = Statements::new(text);
        statements
            .map(|s| {
                let words: Vec<_> = s.arguments().collect();
                (s.line, format!("{}:{}", s.keyword(), words.join(",")))
            })
            .collect()
    }

    #[test]
    fn lines_are_joined_and_numbered() {
        let text = "# head\r\n\r\nv 1 2\\ \r\n3\t4 # tail\r\nend";
        assert_eq!(all(text), [(3, "v:1,2,3,4".into()), (5, "end:".into())]);
        assert_eq!(all("v 1\rv 2\r"), [(1, "v:1".into()), (2, "v:2".into())]);
        assert_eq!(all("v 1 \\"), [(1, "v:1".into())]);
        // Blanks beyond ASCII, at the ends of lines.
        assert_eq!(
            all("\u{a0}v 1\u{b}\nend\u{a0}"),
            [(1, "v:1".into()), (2, "end:".into())]
        );
    }

    #[test]
    fn a_backslash_within_a_line_continues_it_with_numbers_only() {
        let text = "surf 0 1 \\ 15 16\n8 1\nparm u 0 1\no a \\ b";
        let statements: Vec<_> = Statements::new(text).collect();
        let words: Vec<_> = statements[0].arguments().collect();
        assert_eq!(words, ["0", "1", "15", "16", "8", "1"]);
        assert!(statements[0].misprinted && !statements[1].misprinted);
        assert_eq!((statements[1].line, statements[1].keyword()), (3, "parm"));
        assert_eq!(statements[2].rest(), "a \\ b");
    }

    #[test]
    fn text_encodings_are_undone() {
        assert_eq!(decode(b"\xef\xbb\xbfv 1"), "v 1");
        assert_eq!(decode(b"\xff\xfev\0 \x001\0\x30"), "v 1");
        assert_eq!(decode(b"\xfe\xff\0v\0 \x001"), "v 1");
        assert_eq!(decode(b"v\0 \x001\0"), "v 1");
        assert_eq!(decode(b"\0v\0 \x001"), "v 1");
        assert_eq!(decode(b"o \xe4"), "o \u{fffd}");
    }

    #[test]
    fn references_count_from_both_ends() {
        assert_eq!(reference("1", 3, "x"), Ok(0));
        assert_eq!(reference("3", 3, "x"), Ok(2));
        assert_eq!(reference("-1", 3, "x"), Ok(2));
        assert_eq!(reference("-3", 3, "x"), Ok(0));
        for bad in [
            "0",
            "4",
            "-4",
            "1.5",
            "9223372036854775808",
            "",
            "-9223372036854775808",
        ] {
            assert!(reference(bad, 3, "x").is_err(), "{bad}");
        }
        let error = reference("12", 8, "vertices").unwrap_err();
        assert_eq!(
            error,
            "reference 12 to vertices, of which there are 8 at this line"
        );
    }

    #[test]
    fn short_numbers_are_those_of_the_standard_library() {
        let mut dice = 1_u64;
        for length in (1..=17).cycle().take(20_000) {
            let mut next = |end: u64| {
                dice = dice.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (dice >> 33) % end
            };
            let point = next(20);
            let mut word = String::from(if next(2) == 0 { "-" } else { "" });
            for place in 0..length {
                if place == point {
                    word.push('.');
                }
                word.push(char::from(b'0' + u8::try_from(next(10)).unwrap()));
            }
            let expected: f64 = word.parse().unwrap();
            assert_eq!(
                number(&word).unwrap().to_bits(),
                expected.to_bits(),
                "{word}"
            );
        }
        for word in ["", "-", ".", "-.", "1.2.3", "--1"] {
            assert!(number(word).is_err(), "{word}");
        }
        assert_eq!((number("5."), number("-.5")), (Ok(5.0), Ok(-0.5)));
    }

    #[test]
    fn numbers_are_finite() {
        assert_eq!(number("-1.5e3"), Ok(-1500.0));
        for bad in ["nan", "inf", "1e999", "1,5", ""] {
            assert!(number(bad).is_err(), "{bad}");
        }
        let statement = Statement::new(1, "v 1 2 3 4 5".into());
        let (three, count) = statement.some_numbers::<3>().unwrap();
        assert_eq!((three, count), ([1.0, 2.0, 3.0], 4));
    }
}
