//! Parameters in free format: numbers, pointers and counted strings between delimiters.
//!
//! Tokens are slices of the record; nothing is copied but the digits of one number.

use glam::DVec3;

use crate::Problem;

/// The two characters that separate parameters and end a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Delimiters {
    /// Between parameters.
    pub parameter: u8,
    /// After the last parameter.
    pub record: u8,
}

impl Default for Delimiters {
    fn default() -> Self {
        Self {
            parameter: b',',
            record: b';',
        }
    }
}

/// One parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Token<'a> {
    /// The record is over.
    End,
    /// Digits or nothing, without blanks around.
    Plain(&'a [u8]),
    /// The content of a counted string.
    Text(&'a [u8]),
}

/// The most parameters of entities that have no lists: a transformation has them.
const FIXED: usize = 12;

/// Longest number that is read.
const NUMBER: usize = 128;

/// So many digits are exact in double precision.
const DIGITS: usize = 15;

/// The powers of ten that are.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// Reads the parameters of one record in order.
#[derive(Clone, Debug)]
pub(super) struct Parameters<'a> {
    rest: &'a [u8],
    delimiters: Delimiters,
    index: usize,
    ended: bool,
    /// Whether it has ended as records do, and is not cut short.
    is_closed: bool,
}

impl<'a> Parameters<'a> {
    /// The parameters of `record`; the first one has the number `index`.
    pub(super) fn new(record: &'a [u8], delimiters: Delimiters, index: usize) -> Self {
        Self {
            rest: record,
            delimiters,
            index,
            ended: false,
            is_closed: false,
        }
    }

    /// An upper bound on the parameters still to come.
    pub(super) fn at_most(&self) -> usize {
        if self.ended { 0 } else { self.rest.len() + 1 }
    }

    /// How many parameters are still to come.
    pub(super) fn left(&self) -> usize {
        let mut rest = self.clone();
        std::iter::from_fn(|| Some(rest.token()).filter(|token| *token != Token::End)).count()
    }

    /// Passes over parameters, as far as there are any.
    pub(super) fn skip(&mut self, count: u64) {
        let mut left = count;
        while left > 0 && self.token() != Token::End {
            left -= 1;
        }
    }

    /// Fails unless `count` more parameters can be there.
    pub(super) fn expect(&self, count: u64, what: &str) -> Result<usize, Problem> {
        match usize::try_from(count) {
            Ok(count) if count <= self.at_most() => Ok(count),
            _ => Err(Problem::Invalid(format!(
                "{count} {what} are announced; the record is too short for them"
            ))),
        }
    }

    /// A real number; an empty parameter is zero. So are those of entities without lists that a
    /// record leaves out at its end.
    pub(super) fn real(&mut self) -> Result<f64, Problem> {
        if let Some(value) = self.short() {
            return Ok(value);
        }
        match self.token() {
            Token::End if self.is_closed && self.index <= FIXED => {
                self.index += 1;
                Ok(0.0)
            }
            Token::End => Err(self.missing("a number")),
            Token::Plain(b"") => Ok(0.0),
            Token::Plain(text) => real(text).ok_or_else(|| self.wrong(text, "a number")),
            Token::Text(text) => Err(self.wrong(text, "a number")),
        }
    }

    /// A real number; `default` where the parameter is empty or the record is over.
    pub(super) fn real_or(&mut self, default: f64) -> Result<f64, Problem> {
        match self.token() {
            Token::End | Token::Plain(b"") => Ok(default),
            Token::Plain(text) => real(text).ok_or_else(|| self.wrong(text, "a number")),
            Token::Text(text) => Err(self.wrong(text, "a number")),
        }
    }

    /// A point or direction, the default where coordinates are left out.
    pub(super) fn point_or(&mut self, default: DVec3) -> Result<DVec3, Problem> {
        let [x, y, z] = default.to_array();
        Ok(DVec3::new(
            self.real_or(x)?,
            self.real_or(y)?,
            self.real_or(z)?,
        ))
    }

    /// `count` real numbers.
    pub(super) fn reals(&mut self, count: usize, what: &str) -> Result<Vec<f64>, Problem> {
        let count = self.expect(count as u64, what)?;
        self.list(count, Self::real)
    }

    /// As many of something as the record can hold. The first problem ends it; until then what has been read
    /// has its room at once.
    pub(super) fn list<T: Default>(
        &mut self,
        count: usize,
        mut read: impl FnMut(&mut Self) -> Result<T, Problem>,
    ) -> Result<Vec<T>, Problem> {
        let mut problem = None;
        let list = (0..count).map(|_| match &problem {
            None => read(self).unwrap_or_else(|found| {
                problem = Some(found);
                T::default()
            }),
            Some(_) => T::default(),
        });
        let list = list.collect();
        problem.map_or(Ok(list), Err)
    }

    /// Takes a number off the record, if a plain one of few digits comes next: those are read in one pass, and as
    /// a quotient or product of two that are exact they are rounded as they should be.
    fn short(&mut self) -> Option<f64> {
        let Delimiters { parameter, record } = self.delimiters;
        let is_end = |b: u8| b == parameter || b == record;
        let text = self.rest.trim_ascii_start();
        let mut rest = text.iter().copied().peekable();
        let is_negative = rest.next_if_eq(&b'-').is_some();
        let (mut mantissa, mut digits, mut scale, mut point) = (0_u64, 0, 0_i32, 0);
        while let Some(b) = rest.next_if(|&b| !is_end(b) && (b.is_ascii_digit() || b == b'.')) {
            if b == b'.' {
                point += 1;
            } else {
                mantissa = mantissa * 10 + u64::from(b - b'0');
                digits += 1;
                scale -= point;
            }
            if digits > DIGITS || point > 1 {
                return None;
            }
        }
        if rest
            .next_if(|&b| !is_end(b) && matches!(b, b'E' | b'e' | b'D' | b'd'))
            .is_some()
        {
            let sign = rest.next_if(|&b| !is_end(b) && matches!(b, b'+' | b'-'));
            let (mut exponent, mut count) = (0, 0);
            while let Some(b) = rest.next_if(|&b| !is_end(b) && b.is_ascii_digit()) {
                exponent = exponent * 10 + i32::from(b - b'0');
                count += 1;
                if count > 3 {
                    return None;
                }
            }
            if count == 0 {
                return None;
            }
            scale += if sign == Some(b'-') {
                -exponent
            } else {
                exponent
            };
        }
        let end = rest.next().filter(|&b| is_end(b))?;
        let power = POWERS.get(scale.unsigned_abs() as usize)?;
        if digits == 0 || self.ended {
            return None;
        }
        self.index += 1;
        self.ended = end == record && end != parameter;
        self.is_closed = self.ended;
        self.rest = &text[text.len() - rest.len()..];
        #[expect(clippy::cast_precision_loss, reason = "so few digits are exact")]
        let value = mantissa as f64;
        let value = if scale < 0 {
            value / power
        } else {
            value * power
        };
        Some(if is_negative { -value } else { value })
    }

    /// An integer; an empty parameter is zero.
    pub(super) fn integer(&mut self) -> Result<i64, Problem> {
        match self.token() {
            Token::End => Err(self.missing("an integer")),
            Token::Plain(b"") => Ok(0),
            Token::Plain(text) => integer(text).ok_or_else(|| self.wrong(text, "an integer")),
            Token::Text(text) => Err(self.wrong(text, "an integer")),
        }
    }

    /// An integer; `default` where the parameter is empty or the record is over.
    pub(super) fn integer_or(&mut self, default: i64) -> Result<i64, Problem> {
        match self.token() {
            Token::End | Token::Plain(b"") => Ok(default),
            Token::Plain(text) => integer(text).ok_or_else(|| self.wrong(text, "an integer")),
            Token::Text(text) => Err(self.wrong(text, "an integer")),
        }
    }

    /// A count that is not negative.
    pub(super) fn count(&mut self) -> Result<u64, Problem> {
        let count = self.integer()?;
        u64::try_from(count).map_err(|_| {
            let index = self.index - 1;
            Problem::Invalid(format!(
                "parameter {index} is {count}; counts are not negative"
            ))
        })
    }

    /// A count, and then as many pointers.
    pub(super) fn pointers(&mut self, what: &str) -> Result<Vec<i64>, Problem> {
        let count = self.count()?;
        let count = self.expect(count, what)?;
        (0..count).map(|_| self.integer()).collect()
    }

    /// A string; empty where there is none.
    pub(super) fn text(&mut self) -> String {
        match self.token() {
            Token::Text(text) | Token::Plain(text) => {
                let text = String::from_utf8_lossy(text).replace(char::is_control, " ");
                text.trim().to_owned()
            }
            Token::End => String::new(),
        }
    }

    fn missing(&self, needed: &str) -> Problem {
        Problem::Invalid(format!(
            "the record ends before parameter {}; {needed} is needed",
            self.index
        ))
    }

    fn wrong(&self, text: &[u8], needed: &str) -> Problem {
        let shown = String::from_utf8_lossy(&text[..text.len().min(24)]).into_owned();
        let index = self.index.saturating_sub(1);
        Problem::Invalid(format!(
            "parameter {index} is \"{shown}\"; {needed} is needed"
        ))
    }

    fn token(&mut self) -> Token<'a> {
        self.rest = self.rest.trim_ascii_start();
        if self.ended || self.rest.is_empty() {
            self.ended = true;
            return Token::End;
        }
        self.index += 1;
        let text = self.counted();
        let Delimiters { parameter, record } = self.delimiters;
        // After a string of a wrong length, this goes on to the next delimiter.
        let end = self
            .rest
            .iter()
            .position(|&b| b == parameter || b == record);
        let (plain, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.is_closed = rest.first().is_some_and(|&b| b == record && b != parameter);
        self.ended = rest.is_empty() || self.is_closed;
        self.rest = rest.get(1..).unwrap_or_default();
        match text {
            Some(text) => Token::Text(text),
            None => Token::Plain(plain.trim_ascii_end()),
        }
    }

    /// Takes a counted string off the record, if one begins here and fits.
    fn counted(&mut self) -> Option<&'a [u8]> {
        let digits = self.rest.iter().take_while(|b| b.is_ascii_digit()).count();
        let marked = matches!(self.rest.get(digits), Some(b'H' | b'h'));
        if !(marked && (1..=9).contains(&digits)) {
            return None;
        }
        let length = usize::try_from(integer(&self.rest[..digits])?).ok()?;
        let (text, after) = self.rest[digits + 1..].split_at_checked(length)?;
        let Delimiters { parameter, record } = self.delimiters;
        let is_end = |b: &u8| *b == parameter || *b == record;
        let follows = after.trim_ascii_start().first();
        // A count that leads into the middle of another parameter is too large; one in
        // characters, of a text that is not ASCII, is too small.
        if follows.is_some_and(|b| !is_end(b))
            && text.is_ascii()
            && let Some(end) = text.iter().position(is_end)
        {
            self.rest = &self.rest[digits + 1 + end..];
            return Some(&text[..end]);
        }
        self.rest = after;
        Some(text)
    }
}

/// An integer, also when written as a real number.
pub(super) fn integer(text: &[u8]) -> Option<i64> {
    let digits = text.strip_prefix(b"-").or(text.strip_prefix(b"+"));
    let negative = text.first() == Some(&b'-');
    let value = digits
        .unwrap_or(text)
        .iter()
        .try_fold(0_i64, |value, &b| {
            let digit = b.is_ascii_digit().then(|| i64::from(b - b'0'))?;
            value.checked_mul(10)?.checked_add(digit)
        })
        .filter(|_| digits.unwrap_or(text) != b"");
    if let Some(value) = value {
        return Some(if negative { -value } else { value });
    }
    let value = real(text)?;
    let exact = value.fract() == 0.0 && value.abs() < 9e15;
    #[expect(
        clippy::cast_possible_truncation,
        reason = "an integer of less than 53 bits"
    )]
    exact.then_some(value as i64)
}

/// A finite real number with the exponent letter E or D; blanks inside are ignored.
pub(super) fn real(text: &[u8]) -> Option<f64> {
    let value = |text: &[u8]| -> Option<f64> { std::str::from_utf8(text).ok()?.parse().ok() };
    let is_plain = |b: &u8| matches!(b, b'0'..=b'9' | b'+' | b'-' | b'.' | b'E' | b'e');
    if text.iter().all(is_plain) {
        return value(text).filter(|value| value.is_finite());
    }
    let mut buffer = [0_u8; NUMBER];
    let mut length = 0;
    for &b in text {
        let clean = match b {
            b'0'..=b'9' | b'+' | b'-' | b'.' => b,
            b'E' | b'e' | b'D' | b'd' => b'e',
            b' ' => continue,
            _ => return None,
        };
        *buffer.get_mut(length)? = clean;
        length += 1;
    }
    value(&buffer[..length]).filter(|value| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters(record: &str) -> Parameters<'_> {
        Parameters::new(record.as_bytes(), Delimiters::default(), 0)
    }

    #[test]
    fn numbers_come_in_all_spellings() {
        let spellings = ["1.D0", ".5", "-3.E-04", "1D2", "+7", "1 2.5", "1.5d+1"];
        let values = spellings.map(|s| real(s.as_bytes()));
        assert_eq!(values, [1.0, 0.5, -3e-4, 100.0, 7.0, 12.5, 15.0].map(Some));
        for bad in ["", "nan", "inf", "1e999", "1..2", "-", "0x10"] {
            assert_eq!(real(bad.as_bytes()), None, "{bad}");
        }
        assert_eq!(integer(b"-12"), Some(-12));
        assert_eq!(integer(b"3."), Some(3));
        assert_eq!(integer(b"3.5"), None);
        assert_eq!(integer(b"99999999999999999999"), None);
        assert_eq!(integer(b"-"), None);
    }

    #[test]
    fn short_numbers_are_the_nearest_ones() {
        let mut state = 5_u64;
        let mut random = |most: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) % (most + 1)
        };
        let mut count = 0;
        for _ in 0..20_000 {
            let digits = 1 + random(14);
            let mantissa: String = (0..digits).map(|_| random(9).to_string()).collect();
            let (whole, rest) = mantissa.split_at(usize::try_from(random(digits)).unwrap());
            let sign = ["", "-"][usize::from(random(1) == 1)];
            let exponent = i64::try_from(random(40)).unwrap() - 20;
            let text = match random(3) {
                0 => format!("{sign}{whole}{rest}"),
                1 => format!("{sign}{whole}.{rest}"),
                2 => format!("{sign}{whole}.{rest}E{exponent:+04}"),
                _ => format!("{sign}{whole}.{rest}d{exponent}"),
            };
            let record = format!(" {text},7;");
            let mut p = parameters(&record);
            if let Some(short) = p.short() {
                let expected = real(text.as_bytes()).unwrap();
                assert_eq!(short.to_bits(), expected.to_bits(), "{text}");
                assert_eq!((p.index, p.integer()), (1, Ok(7)));
                count += 1;
            }
        }
        assert!(count > 15_000, "{count}");
        for other in [
            "",
            "1..2",
            "1E",
            "1e+",
            "-",
            "1 2",
            "0123456789012345",
            "3Habc",
            "1E23",
        ] {
            assert_eq!(parameters(&format!("{other},7;")).short(), None, "{other}");
        }
        assert_eq!(parameters("5").short(), None);
    }

    #[test]
    fn strings_may_hold_delimiters() {
        let mut p = parameters("  4H;,;x, 3habc ,9H;7;junk");
        assert_eq!(p.token(), Token::Text(b";,;x"));
        assert_eq!(p.token(), Token::Text(b"abc"));
        // Longer than the record: no string.
        assert_eq!(p.token(), Token::Plain(b"9H"));
        assert_eq!(p.token(), Token::End);
    }

    #[test]
    fn wrong_string_lengths_are_survived() {
        let mut p = parameters("2Habc,5;");
        assert_eq!(p.token(), Token::Text(b"ab"));
        assert_eq!(p.integer(), Ok(5));
        let mut p = parameters("9Ha.igs,    3Habc,7;");
        assert_eq!(p.token(), Token::Text(b"a.igs"));
        assert_eq!(p.token(), Token::Text(b"abc"));
        assert_eq!(p.integer(), Ok(7));
        let mut p = parameters("4H\u{e9},\u{e9}\u{e9},7;");
        assert_eq!(
            p.token(),
            Token::Text("\u{e9},\u{e9}".as_bytes().get(..4).unwrap())
        );
        assert_eq!(p.integer(), Ok(7));
    }

    #[test]
    fn defaults_and_ends() {
        let mut p = parameters(",, 2;3");
        assert_eq!(p.real(), Ok(0.0));
        assert_eq!(p.real_or(9.0), Ok(9.0));
        assert_eq!(p.integer(), Ok(2));
        assert_eq!(p.integer_or(-1), Ok(-1));
        let text = p.integer().unwrap_err().to_string();
        assert_eq!(
            text,
            "the record ends before parameter 3; an integer is needed"
        );
        // Numbers may be left out at the end of a record, but not of one that is cut short.
        for (record, numbers) in [("1.5;", vec![Ok(1.5), Ok(0.0)]), ("1.5", vec![Ok(1.5)])] {
            let mut p = parameters(record);
            assert!(numbers.into_iter().all(|number| p.real() == number));
            assert_eq!(p.real().is_ok(), record.ends_with(';'), "{record}");
        }
        let text = parameters("1,x2;").reals(2, "numbers").unwrap_err();
        assert_eq!(
            text.to_string(),
            "parameter 1 is \"x2\"; a number is needed"
        );
    }

    #[test]
    fn counts_are_held_against_the_record() {
        let text = parameters("1000000000,1,2;").pointers("members");
        assert_eq!(
            text.unwrap_err().to_string(),
            "1000000000 members are announced; the record is too short for them"
        );
        assert!(parameters("-1,1;").pointers("members").is_err());
        assert_eq!(parameters("2,1,3;").pointers("members"), Ok(vec![1, 3]));
    }
}
