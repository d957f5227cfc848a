//! Exchange structures (ISO 10303-21): where the instances of a file stand, and what they say.
//!
//! A file is gone through once for the places of its instances; each is read when it is wanted,
//! because hardly any is wanted often, and files are large.

use std::cell::Cell;

use super::values::{Record, Value};
use crate::{Place, Problem};

/// How deep lists may nest.
const NESTING: usize = 16;

/// How the types of rational splines begin.
const RATIONAL: &[u8] = b"RATIONAL_B_SPLINE_";

/// Types whose complex instances say what simple ones do, and the parts that have their attributes.
const AS_SIMPLE: [(&str, &[&str]); 4] = [
    (
        "COMPOSITE_CURVE",
        &["REPRESENTATION_ITEM", "COMPOSITE_CURVE"],
    ),
    ("FACE_BOUND", &["REPRESENTATION_ITEM", "FACE_BOUND"]),
    ("NEXT_ASSEMBLY_USAGE_OCCURRENCE", &USAGE),
    ("PROMISSORY_USAGE_OCCURRENCE", &USAGE),
];
const USAGE: [&str; 3] = [
    "PRODUCT_DEFINITION_RELATIONSHIP",
    "PRODUCT_DEFINITION_USAGE",
    "ASSEMBLY_COMPONENT_USAGE",
];

/// The type of shapes of triangles that are moved, which are of two types.
pub(super) const REPOSITIONED: &str = "REPOSITIONED_TESSELLATED_ITEM";

/// How scopes of old files begin and end.
const SCOPE: &[u8] = b"&SCOPE";
const ENDSCOPE: &[u8] = b"ENDSCOPE";

/// How many values one instance may have.
const VALUES: usize = 20_000_000;

/// How often the bytes of a file may be read over again, as a factor, and how many may be anyway.
const REREADS: usize = 20;
const REREADS_FREE: usize = 1 << 24;

/// The parts of an instance: names of types, in upper case, and attributes.
type Parts<'a> = Vec<(String, Vec<Value<'a>>)>;

/// Where an instance stands.
#[derive(Clone, Copy, Debug)]
struct Entry {
    id: u64,
    line: usize,
    start: usize,
    end: usize,
}

/// A file, ready to be looked up.
#[derive(Debug)]
pub(super) struct Exchange<'a> {
    pub bytes: &'a [u8],
    /// By number.
    entries: Vec<Entry>,
    /// How many more bytes may be read.
    budget: Cell<usize>,
    /// Whether the file says that it ends.
    pub is_ended: bool,
    /// The first statement of the data that is no instance, and how many there are.
    pub stray: Option<(usize, usize)>,
    /// The first instance of which the number was there before, and how many there are.
    pub doubled: Option<(usize, usize)>,
    /// The first instance without a semicolon at its end, and how many there are.
    pub unended: Option<(usize, usize)>,
}

impl<'a> Exchange<'a> {
    /// Finds the instances of a file.
    ///
    /// # Errors
    /// If there are more than `limit`.
    pub(super) fn new(bytes: &'a [u8], limit: usize) -> Result<Self, Problem> {
        let mut exchange = Self {
            bytes,
            entries: Vec::new(),
            budget: Cell::new(
                bytes
                    .len()
                    .saturating_mul(REREADS)
                    .saturating_add(REREADS_FREE),
            ),
            is_ended: false,
            stray: None,
            doubled: None,
            unended: None,
        };
        let mut statements = Statements {
            bytes,
            at: 0,
            line: 1,
            unended: None,
        };
        let (mut in_data, mut scopes) = (false, Vec::new());
        while let Some((line, start, end)) = statements.next() {
            let word = bytes[start..end].trim_ascii();
            let is = |name: &[u8]| word.eq_ignore_ascii_case(name);
            let begins = |name: &[u8]| {
                let start = word.get(..name.len());
                start.is_some_and(|start| start.eq_ignore_ascii_case(name))
            };
            if is(b"END-ISO-10303-21") {
                exchange.is_ended = true;
                break;
            } else if is(b"ENDSEC") {
                in_data = false;
            } else if is(b"DATA") || begins(b"DATA(") || begins(b"DATA (") {
                in_data = true;
            } else if exchange.take((line, start, end), &mut scopes) {
                if exchange.entries.len() > limit {
                    let text = format!("more than {limit} instances, which is the limit");
                    return Err(Problem::TooLarge(text));
                }
            } else if in_data && !word.is_empty() {
                let (_, count) = exchange.stray.get_or_insert((line, 0));
                *count += 1;
            }
        }
        exchange.unended = statements.unended;
        // The first of those with one number counts.
        exchange.entries.sort_by_key(|entry| entry.id);
        let mut doubled: Option<(usize, usize)> = None;
        exchange.entries.dedup_by(|next, first| {
            let is_again = next.id == first.id;
            if is_again {
                let (line, count) = doubled.get_or_insert((next.line, 0));
                (*line, *count) = ((*line).min(next.line), *count + 1);
            }
            is_again
        });
        exchange.doubled = doubled;
        Ok(exchange)
    }

    /// Takes a statement for an instance; whether it is one. `scopes` are the numbers and lines of those
    /// of which the scope is open, which stands before what they are.
    fn take(
        &mut self,
        (line, start, end): (usize, usize, usize),
        scopes: &mut Vec<(u64, usize)>,
    ) -> bool {
        let bytes = self.bytes;
        let text = &bytes[start..end];
        if text.starts_with(ENDSCOPE) {
            // A list of what the scope exports may come first.
            let rest = &text[ENDSCOPE.len()..];
            let blanks = rest.len() - rest.trim_ascii_start().len();
            let list = rest[blanks..].strip_prefix(b"/");
            let list = list.and_then(|rest| rest.iter().position(|&b| b == b'/'));
            let skipped = list.map_or(0, |at| blanks + at + 2);
            self.entries.extend(scopes.pop().map(|(id, line)| Entry {
                id,
                line,
                start: start + ENDSCOPE.len() + skipped,
                end,
            }));
            return true;
        }
        let Some((id, skipped)) = number_of(text) else {
            return false;
        };
        let mut entry = Entry {
            id,
            line,
            start: start + skipped,
            end,
        };
        // The first instance of a scope stands behind its beginning.
        while let Some(inner) = scope(&bytes[entry.start..end]) {
            scopes.push((entry.id, line));
            entry.start += inner;
            let Some((id, skipped)) = number_of(&bytes[entry.start..end]) else {
                return true;
            };
            (entry.id, entry.start) = (id, entry.start + skipped);
        }
        self.entries.push(entry);
        true
    }

    /// How many bytes the file has.
    pub(super) fn size(&self) -> usize {
        self.bytes.len()
    }

    /// The numbers of all instances, rising.
    pub(super) fn ids(&self) -> impl Iterator<Item = u64> + '_ {
        self.entries.iter().map(|entry| entry.id)
    }

    fn entry(&self, id: u64) -> Option<Entry> {
        let at = self.entries.binary_search_by_key(&id, |entry| entry.id);
        at.ok().map(|at| self.entries[at])
    }

    /// The type of an instance, or of the first of its parts by the alphabet, as it is written; nothing if there is
    /// no such instance.
    pub(super) fn keyword(&self, id: u64) -> &'a [u8] {
        let Some(entry) = self.entry(id) else {
            return b"";
        };
        let text = &self.bytes[entry.start..entry.end];
        let mut cursor = Cursor::new(text);
        if cursor.take(b'(').is_some() {
            // Of the names of complex ones this says most, and stands behind others.
            let rational = text.windows(RATIONAL.len()).position(|w| w == RATIONAL);
            let names = AS_SIMPLE.iter().map(|(name, _)| *name);
            let mut names = names.chain([REPOSITIONED]);
            let telling = names.find_map(|name| word(text, name.as_bytes()));
            let telling = rational.or(telling);
            let Some(telling) = telling else {
                return least_name(text);
            };
            cursor.at = telling;
        }
        cursor.name()
    }

    /// An instance in words: its number and type.
    pub(super) fn source(&self, id: u64) -> String {
        let keyword = String::from_utf8_lossy(self.keyword(id)).to_uppercase();
        if keyword.is_empty() {
            return format!("#{id}");
        }
        format!("#{id} {keyword}")
    }

    /// Where an instance stands.
    pub(super) fn place(&self, id: u64) -> Place {
        let line = self.entry(id).map_or(0, |entry| entry.line);
        Place::item(line, self.source(id))
    }

    /// Reads an instance.
    ///
    /// # Errors
    /// If it is not there, or not readable.
    pub(super) fn get(&self, id: u64) -> Result<Record<'a>, Problem> {
        let Some(entry) = self.entry(id) else {
            return Err(Problem::Invalid(format!("#{id} is wanted, but not there")));
        };
        let text = &self.bytes[entry.start..entry.end];
        let Some(left) = self.budget.get().checked_sub(text.len()) else {
            let text = "too many instances refer to the same large ones";
            return Err(Problem::Unsupported(text.to_owned()));
        };
        self.budget.set(left);
        let mut cursor = Cursor::new(text);
        let mut parts = cursor.parts().ok_or_else(|| {
            let rest = String::from_utf8_lossy(&text[cursor.at.min(text.len())..]);
            let rest: String = rest.chars().take(20).collect();
            let whole = self.source(id);
            if cursor.left == 0 {
                return Problem::Unsupported(format!("{whole} has more than {VALUES} values"));
            }
            Problem::Invalid(match rest.trim() {
                "" => format!("{whole} ends early; a list or string is not closed"),
                rest => format!("{whole} is not readable from \"{rest}\" on"),
            })
        })?;
        // As the standard orders them; not all programs do.
        parts.sort_by(|a, b| a.0.cmp(&b.0));
        Ok(Record {
            id,
            parts: simplified(parts),
        })
    }
}

/// Complex instances of some types as simple ones.
fn simplified(mut parts: Parts<'_>) -> Parts<'_> {
    let of = |parts: &Parts<'_>, name: &str| parts.iter().position(|part| part.0 == name);
    let known = AS_SIMPLE
        .iter()
        .find(|(name, _)| of(&parts, name).is_some());
    let Some((name, order)) = known.filter(|_| parts.len() > 1) else {
        return parts;
    };
    let mut attributes = Vec::new();
    for part in *order {
        let at = of(&parts, part);
        attributes.extend(at.into_iter().flat_map(|at| parts[at].1.split_off(0)));
    }
    vec![((*name).to_owned(), attributes)]
}

/// Whether a byte may be in the name of a type.
fn is_name(b: u8) -> bool {
    b.is_ascii_alphanumeric() || b == b'_'
}

/// The first name by the alphabet of the parts of a complex instance.
fn least_name(text: &[u8]) -> &[u8] {
    let (mut depth, mut is_quoted, mut least): (usize, _, &[u8]) = (0, false, b"");
    for (at, &b) in text.iter().enumerate() {
        match b {
            b'\'' => is_quoted = !is_quoted,
            _ if is_quoted => {}
            b'(' => {
                if depth == 1 {
                    let before = text[..at].trim_ascii_end();
                    let others = before.iter().rposition(|b| !is_name(*b));
                    let name = &before[others.map_or(0, |at| at + 1)..];
                    least = if least.is_empty() {
                        name
                    } else {
                        least.min(name)
                    };
                }
                depth += 1;
            }
            b')' => depth = depth.saturating_sub(1),
            _ => {}
        }
    }
    least
}

/// Where a word stands by itself in a text.
fn word(text: &[u8], word: &[u8]) -> Option<usize> {
    let is_whole = |at: usize| {
        let beside = [at.checked_sub(1), Some(at + word.len())].map(|at| text.get(at?).copied());
        !beside.into_iter().flatten().any(is_name)
    };
    let mut windows = text.windows(word.len()).enumerate();
    let found = windows.find(|(at, w)| *w == word && is_whole(*at));
    found.map(|(at, _)| at)
}

/// The number of an instance, and where what it is begins.
fn number_of(text: &[u8]) -> Option<(u64, usize)> {
    let mut cursor = Cursor::new(text);
    cursor.skip();
    let id = cursor.reference()?;
    cursor.skip();
    (cursor.peek()? == b'=').then_some((id, cursor.at + 1))
}

/// How long the beginning of a scope is, if there is one.
fn scope(text: &[u8]) -> Option<usize> {
    let blanks = text.len() - text.trim_ascii_start().len();
    let is_one = text[blanks..].starts_with(SCOPE);
    is_one.then_some(blanks + SCOPE.len())
}

/// Finds the ends of statements.
struct Statements<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
    /// See [`Exchange`].
    unended: Option<(usize, usize)>,
}

impl Statements<'_> {
    /// The line at which the next statement begins, and what it spans, without its semicolon.
    fn next(&mut self) -> Option<(usize, usize, usize)> {
        let bytes = self.bytes;
        let (mut start, mut line) = (None, self.line);
        let (mut in_text, mut in_comment) = (false, false);
        while let Some(&byte) = bytes.get(self.at) {
            let next = bytes.get(self.at + 1);
            match byte {
                b'\n' => self.line += 1,
                b'*' if in_comment && next == Some(&b'/') => {
                    in_comment = false;
                    self.at += 1;
                }
                _ if in_comment => {}
                b'\'' => in_text = !in_text,
                _ if in_text => {}
                b'/' if next == Some(&b'*') => {
                    in_comment = true;
                    self.at += 1;
                }
                b';' => {
                    let end = self.at;
                    self.at += 1;
                    return Some((line, start.unwrap_or(end), end));
                }
                b'=' if let Some((begin, end)) =
                    start.and_then(|at| Some((at, self.begun(at)?))) =>
                {
                    let (_, count) = self.unended.get_or_insert((line, 0));
                    *count += 1;
                    self.at = end;
                    return Some((line, begin, end));
                }
                _ if start.is_none() && !is_blank(byte) => {
                    (start, line) = (Some(self.at), self.line);
                }
                _ => {}
            }
            self.at += 1;
        }
        None
    }

    /// Where the instance begins whose number stands before the equals sign here, if the statement that
    /// starts at `start` is another one, and complete: its semicolon is missing.
    fn begun(&self, start: usize) -> Option<usize> {
        let text = &self.bytes[start..self.at];
        let text = text.trim_ascii_end();
        let digits = text.iter().rev().take_while(|b| b.is_ascii_digit()).count();
        let before = text[..text.len() - digits].strip_suffix(b"#")?;
        let is_complete = digits > 0 && before.trim_ascii_end().ends_with(b")");
        is_complete.then_some(start + before.len())
    }
}

/// Blanks, ends of lines, and the zeros that some programs leave.
fn is_blank(byte: u8) -> bool {
    byte.is_ascii_whitespace() || byte == 0
}

/// Reads one instance.
struct Cursor<'a> {
    text: &'a [u8],
    at: usize,
    /// How many more values there may be.
    left: usize,
}

impl<'a> Cursor<'a> {
    fn new(text: &'a [u8]) -> Self {
        Self {
            text,
            at: 0,
            left: VALUES,
        }
    }

    fn peek(&self) -> Option<u8> {
        self.text.get(self.at).copied()
    }

    /// Goes over blanks, comments and print controls.
    fn skip(&mut self) {
        loop {
            let rest = &self.text[self.at..];
            let blanks = rest.iter().take_while(|&&byte| is_blank(byte)).count();
            self.at += blanks;
            let rest = &rest[blanks..];
            if rest.starts_with(b"/*") {
                let end = rest.windows(2).position(|pair| pair == b"*/");
                self.at += end.map_or(rest.len(), |end| end + 2);
            } else if rest.starts_with(b"\\N\\") || rest.starts_with(b"\\F\\") {
                self.at += 3;
            } else {
                return;
            }
        }
    }

    /// The byte, if it comes next.
    fn take(&mut self, byte: u8) -> Option<()> {
        self.skip();
        (self.peek()? == byte).then(|| self.at += 1)
    }

    /// As long as bytes fit.
    fn while_is(&mut self, fits: impl Fn(u8) -> bool) -> &'a [u8] {
        let rest = &self.text[self.at..];
        let count = rest.iter().take_while(|&&byte| fits(byte)).count();
        self.at += count;
        &rest[..count]
    }

    fn name(&mut self) -> &'a [u8] {
        self.skip();
        self.while_is(|b| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'!' | b'-'))
    }

    fn reference(&mut self) -> Option<u64> {
        self.take(b'#')?;
        let digits = self.while_is(|b| b.is_ascii_digit());
        std::str::from_utf8(digits).ok()?.parse().ok()
    }

    /// The types of an instance with their attributes.
    fn parts(&mut self) -> Option<Parts<'a>> {
        self.skip();
        let part = |cursor: &mut Self| {
            let name = String::from_utf8_lossy(cursor.name()).to_uppercase();
            Some((name, cursor.list(0)?))
        };
        let mut parts = Vec::new();
        if self.take(b'(').is_some() {
            while self.take(b')').is_none() {
                parts.push(part(self)?);
            }
        } else {
            parts.push(part(self)?);
        }
        self.skip();
        self.peek().is_none().then_some(parts)
    }

    /// A list, with its brackets.
    fn list(&mut self, depth: usize) -> Option<Vec<Value<'a>>> {
        self.take(b'(')?;
        let mut values = Vec::new();
        if self.take(b')').is_some() {
            return Some(values);
        }
        loop {
            values.push(self.value(depth)?);
            let goes_on = self.take(b',').is_some();
            // Some end lists with a comma.
            if self.take(b')').is_some() {
                return Some(values);
            }
            if !goes_on {
                return None;
            }
        }
    }

    fn value(&mut self, depth: usize) -> Option<Value<'a>> {
        self.left = self.left.checked_sub(1)?;
        self.skip();
        Some(match self.peek()? {
            b'$' | b'*' => {
                self.at += 1;
                Value::Nothing
            }
            b'#' => Value::Reference(self.reference()?),
            b'\'' => self.string()?,
            b'(' if depth < NESTING => Value::List(self.list(depth + 1)?),
            b'.' if self
                .text
                .get(self.at + 1)
                .is_some_and(u8::is_ascii_alphabetic) =>
            {
                self.at += 1;
                let word = self.while_is(|b| b.is_ascii_alphanumeric() || b == b'_');
                self.take(b'.')?;
                Value::Word(word)
            }
            b'"' => {
                self.at += 1;
                let word = self.while_is(|b| b != b'"');
                self.take(b'"')?;
                Value::Word(word)
            }
            b'0'..=b'9' | b'+' | b'-' | b'.' => {
                let digits = self.while_is(|b| {
                    matches!(
                        b,
                        b'0'..=b'9' | b'+' | b'-' | b'.' | b'E' | b'e' | b'D' | b'd'
                    )
                });
                Value::Number(number(digits)?)
            }
            b if (b.is_ascii_alphabetic() || b == b'!') && depth < NESTING => {
                let name = self.name();
                Value::Typed(name, self.list(depth + 1)?)
            }
            _ => return None,
        })
    }

    /// A string; two apostrophes in it are one.
    fn string(&mut self) -> Option<Value<'a>> {
        let start = self.at + 1;
        let mut end = start;
        loop {
            end += self.text.get(end..)?.iter().position(|&b| b == b'\'')?;
            if self.text.get(end + 1) != Some(&b'\'') {
                break;
            }
            end += 2;
        }
        self.at = end + 1;
        Some(Value::Text(&self.text[start..end]))
    }
}

/// A finite number.
fn number(digits: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(digits).ok()?;
    let value: Option<f64> = text.parse().ok();
    let value = value.or_else(|| text.to_uppercase().replace('D', "E").parse().ok());
    value.filter(|value| value.is_finite())
}
