//! The JSON encoding: objects to nodes.
//!
//! A key that begins with `@` is a field, one with `-` a field that holds nodes, one with
//! `#` a remark; any other is an element, as in XML. Values stay the text that they are, and
//! what nests is kept on a list instead of the stack.

use nom::branch::alt;
use nom::bytes::complete::{is_not, take_while1};
use nom::character::complete::{anychar, char, multispace0, one_of};
use nom::combinator::{map, recognize, value};
use nom::multi::many0_count;
use nom::sequence::{delimited, preceded};
use nom::{IResult, Parser};

use crate::Error;
use crate::nodes::{Builder, Lines, decode};

/// A word of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Token<'a> {
    /// One of `{}[]:,`
    Sign(char),
    /// A string without its quotes, its escapes still in it.
    Text(&'a str),
    /// A number, `true`, `false` or `null`.
    Word(&'a str),
}

fn token(input: &str) -> IResult<&str, Token<'_>> {
    let escaped = preceded(char('\\'), anychar);
    let part = alt((value((), is_not("\\\"")), value((), escaped)));
    let text = delimited(char('"'), recognize(many0_count(part)), char('"'));
    let word = take_while1(|c: char| c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.'));
    preceded(
        multispace0,
        alt((
            map(one_of("{}[]:,"), Token::Sign),
            map(text, Token::Text),
            map(word, Token::Word),
        )),
    )
    .parse(input)
}

/// What is open, from the outside in.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Level<'a> {
    /// An object whose keys are elements, inside this field.
    Holder(Option<&'a str>),
    /// A list of such objects.
    Holders(Option<&'a str>),
    /// An element, which is a node.
    Element,
    /// A list of elements of this kind, inside this field.
    Elements(&'a str, Option<&'a str>),
    /// Something to be passed over.
    Remark,
}

struct Reader<'a, 'b, 'c> {
    text: &'a str,
    rest: &'a str,
    lines: Lines<'a>,
    levels: Vec<Level<'a>>,
    builder: &'b mut Builder<'c>,
}

/// Reads a file up to the place where the JSON is broken, if it is. That is a warning and
/// also what comes back.
///
/// # Errors
/// If a limit is passed.
pub(super) fn read_json(bytes: &[u8], builder: &mut Builder<'_>) -> Result<Option<Error>, Error> {
    let file = builder.file().clone();
    let text = decode(bytes, &file, &mut builder.warnings);
    let mut reader = Reader {
        text: &text,
        rest: &text,
        lines: Lines::new(&text),
        levels: Vec::new(),
        builder,
    };
    let broken = match reader.take() {
        Some(Token::Sign('{')) => reader.run()?,
        _ => Some("an object"),
    };
    let Some(wanted) = broken else {
        return Ok(None);
    };
    let line = reader.line();
    let text = format!("broken JSON: {wanted} is wanted here; nothing is read from here on");
    Ok(Some(builder.broken(line, text)))
}

impl<'a> Reader<'a, '_, '_> {
    fn take(&mut self) -> Option<Token<'a>> {
        let (rest, token) = token(self.rest).ok()?;
        self.rest = rest;
        Some(token)
    }

    fn line(&mut self) -> usize {
        self.lines.at(self.text.len() - self.rest.len())
    }

    /// Reads to the end of the outermost object; gives what is missing where it cannot.
    fn run(&mut self) -> Result<Option<&'static str>, Error> {
        self.levels.push(Level::Holder(None));
        while let Some(&level) = self.levels.last() {
            // A node takes three levels: itself, a list and what holds it there.
            if self.levels.len() > self.builder.nesting().saturating_mul(4) {
                let line = self.line();
                let text = "brackets nest too deep for the limit on nodes".to_owned();
                return Err(self.builder.too_large(line, text));
            }
            let wanted = match level {
                Level::Holders(_) | Level::Elements(..) => self.entry(level)?,
                Level::Remark => self.remark(),
                Level::Holder(_) | Level::Element => self.member(level)?,
            };
            if wanted.is_some() {
                return Ok(wanted);
            }
        }
        Ok(None)
    }

    /// An entry of a list of nodes, or its end.
    fn entry(&mut self, level: Level<'a>) -> Result<Option<&'static str>, Error> {
        match self.take() {
            Some(Token::Sign(',')) => {}
            Some(Token::Sign(']')) => drop(self.levels.pop()),
            Some(Token::Sign('{')) => match level {
                Level::Elements(kind, slot) => self.begin(kind, slot)?,
                Level::Holders(slot) => self.levels.push(Level::Holder(slot)),
                _ => {}
            },
            Some(Token::Sign('[')) => self.levels.push(level),
            Some(Token::Text(_) | Token::Word(_)) => {}
            _ => return Ok(Some("a node or ']'")),
        }
        Ok(None)
    }

    /// Something inside a remark, or its end.
    fn remark(&mut self) -> Option<&'static str> {
        match self.take() {
            Some(Token::Sign('{' | '[')) => self.levels.push(Level::Remark),
            Some(Token::Sign('}' | ']')) => drop(self.levels.pop()),
            Some(_) => {}
            None => return Some("'}'"),
        }
        None
    }

    /// A key of an object with its value, or the end of the object.
    fn member(&mut self, level: Level<'a>) -> Result<Option<&'static str>, Error> {
        let key = match self.take() {
            Some(Token::Sign(',')) => return Ok(None),
            Some(Token::Sign('}')) => {
                self.levels.pop();
                if level == Level::Element {
                    self.builder.end()?;
                }
                return Ok(None);
            }
            Some(Token::Text(key)) => key,
            _ => return Ok(Some("a key or '}'")),
        };
        if self.take() != Some(Token::Sign(':')) {
            return Ok(Some("':'"));
        }
        let inside = match level {
            Level::Holder(slot) => slot,
            _ => None,
        };
        if let (Some(field), Level::Element) = (key.strip_prefix('-'), level) {
            // A list of nodes as children needs no name of a field, as in XML.
            let slot = Some(field).filter(|&field| field != "children");
            return self.begin_value(Level::Holder(slot), Level::Holders(slot), None);
        }
        if key.starts_with('#') {
            return self.begin_value(Level::Remark, Level::Remark, None);
        }
        let field = key.strip_prefix('@').unwrap_or(key);
        if let Some(Token::Sign('{' | '[')) = token(self.rest).ok().map(|(_, token)| token)
            && field == key
        {
            let list = Level::Elements(key, inside);
            return self.begin_value(Level::Element, list, Some((key, inside)));
        }
        match self.plain_value() {
            Some(value) => {
                if level == Level::Element {
                    self.builder.attribute(field, &value);
                }
                Ok(None)
            }
            None => Ok(Some("a value")),
        }
    }

    /// Enters the object or list that is the value of a key; plain values are passed over.
    fn begin_value(
        &mut self,
        object: Level<'a>,
        list: Level<'a>,
        element: Option<(&'a str, Option<&'a str>)>,
    ) -> Result<Option<&'static str>, Error> {
        match (self.take(), element) {
            (Some(Token::Sign('{')), Some((kind, slot))) => self.begin(kind, slot)?,
            (Some(Token::Sign('{')), None) => self.levels.push(object),
            (Some(Token::Sign('[')), _) => self.levels.push(list),
            (Some(Token::Text(_) | Token::Word(_)), _) => {}
            _ => return Ok(Some("a value")),
        }
        Ok(None)
    }

    fn begin(&mut self, kind: &str, slot: Option<&str>) -> Result<(), Error> {
        let line = self.line();
        self.builder.begin(kind, line)?;
        if let Some(slot) = slot {
            self.builder.set_slot(slot);
        }
        self.levels.push(Level::Element);
        Ok(())
    }

    /// A string, a number, a truth value or a list of them, as XML would write it.
    fn plain_value(&mut self) -> Option<String> {
        match self.take()? {
            Token::Text(text) => Some(unescaped(text)),
            Token::Word("null") => Some(String::new()),
            Token::Word(word) => Some(word.to_owned()),
            Token::Sign('[') => self.plain_list(),
            Token::Sign(_) => None,
        }
    }

    fn plain_list(&mut self) -> Option<String> {
        let (mut depth, mut list) = (1, String::new());
        while depth > 0 {
            match self.take()? {
                Token::Sign('[') => depth += 1,
                Token::Sign(']') => depth -= 1,
                Token::Sign(',') => list.push(' '),
                Token::Sign(_) => return None,
                Token::Word(word) => list.push_str(word),
                Token::Text(text) => {
                    list.push('"');
                    for c in unescaped(text).chars() {
                        if matches!(c, '"' | '\\') {
                            list.push('\\');
                        }
                        list.push(c);
                    }
                    list.push('"');
                }
            }
        }
        Some(list)
    }
}

/// A string with its escapes undone; those that mean nothing stay out.
fn unescaped(text: &str) -> String {
    let mut units = Vec::new();
    let mut chars = text.chars();
    while let Some(c) = chars.next() {
        let c = match c {
            '\\' => match chars.next() {
                Some('n') => '\n',
                Some('t') => '\t',
                Some('r') => '\r',
                Some('b' | 'f') => ' ',
                Some('u') => {
                    let digits: String = chars.by_ref().take(4).collect();
                    units.extend(u16::from_str_radix(&digits, 16));
                    continue;
                }
                Some(c) => c,
                None => break,
            },
            c => c,
        };
        units.extend_from_slice(c.encode_utf16(&mut [0; 2]));
    }
    String::from_utf16_lossy(&units)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_are_undone() {
        assert_eq!(
            unescaped(r#"a\"b\\c\/d\n\u00e9\ud83e\udd86"#),
            "a\"b\\c/d\né🦆"
        );
    }
}
