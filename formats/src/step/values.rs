//! What instances say: attributes by their places, and text.

use glam::DVec3;

use crate::Problem;

/// What stands for an attribute.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value<'a> {
    /// A number; integers are exact up to 2^53.
    Number(f64),
    /// A string, as it is encoded.
    Text(&'a [u8]),
    /// An enumeration or a logical value, without its dots, or binary data.
    Word(&'a [u8]),
    /// Another instance.
    Reference(u64),
    /// A list, an array or a set.
    List(Vec<Self>),
    /// A value with its type.
    Typed(&'a [u8], Vec<Self>),
    /// Not given, or derived from others.
    Nothing,
}

/// One instance: its types with their attributes, several where it is a complex one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Record<'a> {
    /// Its number.
    pub id: u64,
    /// Names of types, in upper case, and attributes.
    pub parts: Vec<(String, Vec<Value<'a>>)>,
}

/// What is expected of an attribute, in words.
fn wrong(expected: &str, found: Option<&Value<'_>>) -> Problem {
    let found = match found {
        None => "is missing".to_owned(),
        Some(Value::Number(number)) => format!("is {number}"),
        Some(Value::Text(text)) => format!("is '{}'", decoded(text)),
        Some(Value::Word(word)) => format!("is .{}.", String::from_utf8_lossy(word)),
        Some(Value::Reference(id)) => format!("is #{id}"),
        Some(Value::List(values)) => format!("is a list of {}", values.len()),
        Some(Value::Typed(name, _)) => format!("is {}", String::from_utf8_lossy(name)),
        Some(Value::Nothing) => "is not given".to_owned(),
    };
    Problem::Invalid(format!("{expected} is expected, but {found}"))
}

impl<'a> Value<'a> {
    /// The number that it is, also with its type.
    pub(super) fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Typed(_, values) => match values.as_slice() {
                [Self::Number(number)] => Some(*number),
                _ => None,
            },
            _ => None,
        }
    }

    /// The instance that it is.
    pub(super) fn reference(&self) -> Option<u64> {
        match self {
            Self::Reference(id) => Some(*id),
            _ => None,
        }
    }

    /// The list that it is.
    pub(super) fn list(&self) -> Option<&[Self]> {
        match self {
            Self::List(values) => Some(values),
            _ => None,
        }
    }
}

/// Attributes of one type of an instance, by their places.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attributes<'r, 'a>(pub &'r [Value<'a>]);

impl<'r, 'a> Attributes<'r, 'a> {
    /// What stands at a place; nothing if it is left out.
    pub(super) fn get(self, at: usize) -> Option<&'r Value<'a>> {
        self.0.get(at)
    }

    /// The number at a place.
    pub(super) fn number(self, at: usize) -> Result<f64, Problem> {
        let value = self.get(at);
        let number = value.and_then(Value::number);
        number.ok_or_else(|| wrong("a number", value))
    }

    /// The count at a place.
    pub(super) fn count(self, at: usize) -> Result<usize, Problem> {
        let value = self.get(at);
        let number = value.and_then(Value::number);
        let count = number.and_then(whole);
        count.ok_or_else(|| wrong("a whole number from zero on", value))
    }

    /// The instance at a place.
    pub(super) fn reference(self, at: usize) -> Result<u64, Problem> {
        let value = self.get(at);
        let id = value.and_then(Value::reference);
        id.ok_or_else(|| wrong("an instance", value))
    }

    /// The list at a place.
    pub(super) fn list(self, at: usize) -> Result<&'r [Value<'a>], Problem> {
        let value = self.get(at);
        let list = value.and_then(Value::list);
        list.ok_or_else(|| wrong("a list", value))
    }

    /// The numbers of the list at a place.
    pub(super) fn numbers(self, at: usize) -> Result<Vec<f64>, Problem> {
        numbers(self.list(at)?)
    }

    /// The instances of the list at a place.
    pub(super) fn references(self, at: usize) -> Result<Vec<u64>, Problem> {
        references(self.list(at)?)
    }

    /// Whether the logical value at a place is true; the default if it is unknown or left out.
    pub(super) fn is_true(self, at: usize, default: bool) -> bool {
        match self.get(at) {
            Some(Value::Word(word)) if word.eq_ignore_ascii_case(b"T") => true,
            Some(Value::Word(word)) if word.eq_ignore_ascii_case(b"F") => false,
            _ => default,
        }
    }

    /// The text at a place, or nothing.
    pub(super) fn text(self, at: usize) -> String {
        match self.get(at) {
            Some(Value::Text(text)) => decoded(text),
            _ => String::new(),
        }
    }
}

/// The numbers of a list.
pub(super) fn numbers(list: &[Value<'_>]) -> Result<Vec<f64>, Problem> {
    let number = |value: &Value<'_>| value.number().ok_or_else(|| wrong("a number", Some(value)));
    list.iter().map(number).collect()
}

/// The instances of a list.
pub(super) fn references(list: &[Value<'_>]) -> Result<Vec<u64>, Problem> {
    let id = |value: &Value<'_>| {
        let id = value.reference();
        id.ok_or_else(|| wrong("an instance", Some(value)))
    };
    list.iter().map(id).collect()
}

/// A number as a count, if it is one.
fn whole(number: f64) -> Option<usize> {
    let is_whole = (0.0..1e15).contains(&number) && number.fract().abs() < f64::MIN_POSITIVE;
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "it is a small whole number"
    )]
    is_whole.then_some(number as usize)
}

impl<'a> Record<'a> {
    /// The type of a simple instance, of a complex one that of the first part.
    pub(super) fn name(&self) -> &str {
        self.parts.first().map_or("", |part| part.0.as_str())
    }

    /// The attributes of the type with a name, if the instance is of that.
    pub(super) fn part(&self, name: &str) -> Option<Attributes<'_, 'a>> {
        let part = self.parts.iter().find(|part| part.0 == name)?;
        Some(Attributes(&part.1))
    }

    /// The attributes of a simple instance, of a complex one those of the first part.
    pub(super) fn attributes(&self) -> Attributes<'_, 'a> {
        Attributes(self.parts.first().map_or(&[], |part| &part.1))
    }

    /// The coordinates in the list at a place; those left out are zero.
    pub(super) fn coordinates(&self, at: usize) -> Result<DVec3, Problem> {
        let mut point = DVec3::ZERO;
        let list = self.attributes().numbers(at)?;
        for (axis, value) in list.into_iter().take(3).enumerate() {
            point[axis] = value;
        }
        Ok(point)
    }
}

/// A string as text: its escapes are undone. Bytes that are no UTF-8 count as Latin-1.
pub(super) fn decoded(text: &[u8]) -> String {
    let plain: Vec<u8> = text.iter().copied().filter(|b| *b >= b' ').collect();
    let plain = match String::from_utf8(plain) {
        Ok(text) => text,
        Err(error) => error.into_bytes().into_iter().map(char::from).collect(),
    };
    let mut out = String::new();
    let mut rest = plain.as_str();
    while let Some(at) = rest.find(['\\', '\'']) {
        out.push_str(&rest[..at]);
        rest = &rest[at..];
        if let Some(next) = rest.strip_prefix("''") {
            out.push('\'');
            rest = next;
            continue;
        }
        let (sign, next) = escape(rest);
        out.push_str(&sign);
        rest = next;
    }
    out.push_str(rest);
    out
}

/// What an escape at the beginning stands for, and what follows it.
fn escape(text: &str) -> (String, &str) {
    let hex = |digits: &str| {
        let code = u32::from_str_radix(digits, 16).ok();
        code.and_then(char::from_u32).map(String::from)
    };
    if let Some(rest) = text.strip_prefix("\\\\") {
        return ("\\".to_owned(), rest);
    }
    for (start, width) in [("\\X2\\", 4), ("\\X4\\", 8)] {
        let Some(rest) = text.strip_prefix(start) else {
            continue;
        };
        let (digits, after) = rest.split_once("\\X0\\").unwrap_or((rest, ""));
        let codes = digits.as_bytes().chunks(width);
        let codes: Vec<u32> = codes
            .filter_map(|code| u32::from_str_radix(std::str::from_utf8(code).ok()?, 16).ok())
            .collect();
        let signs = if width == 4 {
            let units = codes.iter().filter_map(|&code| u16::try_from(code).ok());
            char::decode_utf16(units).filter_map(Result::ok).collect()
        } else {
            codes.into_iter().filter_map(char::from_u32).collect()
        };
        return (signs, after);
    }
    let escaped = [("\\X\\", 2, 16), ("\\S\\", 1, 0)];
    for (start, width, radix) in escaped {
        let rest = text.strip_prefix(start);
        let Some((code, after)) = rest.and_then(|rest| rest.split_at_checked(width)) else {
            continue;
        };
        let sign = if radix == 16 {
            hex(code)
        } else {
            let high = code.bytes().next().map(|byte| byte | 0x80);
            high.map(|byte| char::from(byte).to_string())
        };
        if let Some(sign) = sign {
            return (sign, after);
        }
    }
    // The page of characters that follow: all are taken for the first.
    if let Some(rest) = text.strip_prefix("\\P")
        && let Some(after) = rest.get(1..).and_then(|rest| rest.strip_prefix('\\'))
    {
        return (String::new(), after);
    }
    let mut signs = text.chars();
    let first = signs.next().map(String::from).unwrap_or_default();
    (first, signs.as_str())
}
