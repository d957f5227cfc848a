//! Statements to nodes. What nests in the file is kept on a list instead of the stack, so
//! that files cannot nest too deep for us before the limit on nesting sees them.

use crate::Error;
use crate::nodes::{Builder, Lines, decode};

use super::tokens::{Token, blank, list_content, number, quoted, run, token};

/// Where in the grammar we are.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Level<'a> {
    /// Statements of a file.
    File,
    /// Statements in the body of a prototype.
    Body,
    /// Fields of a node.
    Node,
    /// Nodes in the list of this field.
    Nodes(&'a str),
    /// Declarations of fields, with defaults or without.
    Interface { defaults: bool },
    /// A declaration whose value is complete.
    Declared,
    /// What comes after the interface of a prototype.
    Rest { defaults: bool },
}

/// So many words that do not belong where they stand, and the file is given up.
const STRAYS: usize = 1000;

struct Reader<'a, 'b, 'c> {
    text: &'a str,
    rest: &'a str,
    lines: Lines<'a>,
    levels: Vec<Level<'a>>,
    strays: usize,
    builder: &'b mut Builder<'c>,
}

/// Reads VRML 97 or the classic encoding of X3D. Comes back with the error at which it had
/// to stop, which is a warning already.
///
/// # Errors
/// If a limit is passed.
pub(crate) fn read_classic(
    bytes: &[u8],
    builder: &mut Builder<'_>,
) -> Result<Option<Error>, Error> {
    let file = builder.file().clone();
    let text = decode(bytes, &file, &mut builder.warnings);
    // "#X3D V3.3 utf8" and "#VRML V2.0 utf8"
    let header = text.lines().next().filter(|line| line.starts_with('#'));
    match header.unwrap_or_default().split_once(" V") {
        Some((_, version)) => {
            builder.set_version(version.split_whitespace().next().unwrap_or_default());
        }
        None => {
            let text = "the first line must be #VRML V2.0 utf8 or #X3D V3.3 utf8";
            builder.warnings.invalid(file.place(1, ""), text);
        }
    }
    builder.begin("Scene", 1)?;
    let mut reader = Reader {
        text: &text,
        rest: &text,
        lines: Lines::new(&text),
        levels: vec![Level::File],
        strays: 0,
        builder,
    };
    while reader.strays < STRAYS && reader.step()? {}
    let broken = reader.unfinished();
    if broken.is_none() {
        builder.end()?;
    }
    Ok(broken)
}

impl<'a> Reader<'a, '_, '_> {
    /// Reads one statement, field or bracket; `false` at the end of the file.
    fn step(&mut self) -> Result<bool, Error> {
        if self.levels.last() == Some(&Level::Declared) {
            self.levels.pop();
            self.builder.end()?;
            return Ok(true);
        }
        let Some(next) = self.next() else {
            return Ok(false);
        };
        match (self.levels.last().copied(), next) {
            (Some(Level::Node), Token::Close) => {
                self.levels.pop();
                self.builder.end()?;
            }
            (Some(Level::Body), Token::Close) => {
                self.levels.pop();
                self.builder.end()?;
                self.builder.end()?;
            }
            (Some(Level::Nodes(_) | Level::Interface { .. }), Token::ListClose) => {
                if let Some(Level::Interface { defaults }) = self.levels.pop() {
                    self.levels.push(Level::Rest { defaults });
                }
            }
            (Some(Level::Rest { defaults: true }), Token::Open) => {
                self.levels.pop();
                let line = self.line();
                self.builder.begin("ProtoBody", line)?;
                self.levels.push(Level::Body);
            }
            (Some(Level::Rest { defaults: false }), Token::ListOpen | Token::Text(_)) => {
                self.levels.pop();
                self.value("url", next)?;
                self.builder.end()?;
            }
            (Some(Level::Interface { defaults }), Token::Word(access)) => {
                self.declaration(access, defaults)?;
            }
            (Some(Level::Rest { .. }), Token::Word(word)) => {
                // What belongs to the declaration is missing: this is the next statement.
                self.unexpected(next);
                self.levels.pop();
                self.builder.end()?;
                self.rest = &self.text[self.text.len() - self.rest.len() - word.len()..];
            }
            // No node in a list of nodes.
            (Some(Level::Nodes(_)), Token::Word("NULL")) => {}
            (Some(Level::Node), Token::Word(word)) => self.field(word)?,
            (Some(Level::Nodes(slot)), Token::Word(word)) => self.node(word, Some(slot))?,
            (Some(Level::File | Level::Body), Token::Word(word)) => self.statement(word)?,
            (_, token) => self.unexpected(token),
        }
        Ok(true)
    }

    /// The next word.
    fn next(&mut self) -> Option<Token<'a>> {
        let (rest, token) = token(self.rest).ok()?;
        self.rest = rest;
        Some(token)
    }

    /// The next word, which stays where it is.
    fn peek(&self) -> Option<Token<'a>> {
        token(self.rest).ok().map(|(_, token)| token)
    }

    /// The next word, if it is a name.
    fn name(&mut self) -> Option<&'a str> {
        let Some(Token::Word(word)) = self.peek() else {
            return None;
        };
        self.next();
        Some(word)
    }

    /// The line of what has been read last.
    fn line(&mut self) -> usize {
        self.lines.at(self.text.len() - self.rest.len())
    }

    fn unexpected(&mut self, token: Token<'_>) {
        let found: String = match token {
            Token::Open => "{".to_owned(),
            Token::Close => "}".to_owned(),
            Token::ListOpen => "[".to_owned(),
            Token::ListClose => "]".to_owned(),
            Token::Text(_) => "a string".to_owned(),
            Token::Word(word) => word.chars().take(20).collect(),
        };
        self.strays += 1;
        let line = self.line();
        let inside = self.builder.innermost().map(|node| node.kind.to_string());
        let place = self.builder.file().place(line, &inside.unwrap_or_default());
        let text = format!("{found} does not belong here; it is passed over");
        self.builder.warnings.invalid(place, text);
    }

    /// What is wrong if the file ends before all that is open.
    fn unfinished(&mut self) -> Option<Error> {
        let left = blank(self.rest).map_or(self.rest, |(rest, ())| rest);
        if left.is_empty() && self.levels == [Level::File] {
            return None;
        }
        if self.strays >= STRAYS {
            let line = self.line();
            let text = format!("{STRAYS} words that do not belong here; nothing more is read");
            return Some(self.builder.broken(line, text));
        }
        let line = self.lines.at(self.text.len());
        let node = self.builder.innermost();
        let (kind, start) = node.map_or((String::new(), 1), |n| (n.kind.to_string(), n.line));
        let what = if left.is_empty() {
            "the file"
        } else {
            "a string"
        };
        let text = format!("{what} ends inside {kind} of line {start}");
        Some(self.builder.broken(line, text))
    }

    /// A statement: a node, or a keyword.
    fn statement(&mut self, word: &'a str) -> Result<(), Error> {
        match word {
            "PROTO" | "EXTERNPROTO" => self.prototype(word == "PROTO"),
            "ROUTE" => self.route(),
            "PROFILE" => {
                self.next();
                Ok(())
            }
            "COMPONENT" => {
                // A name, a colon and a number, with space between them or without.
                self.next();
                while let Some(Token::Word(word)) = self.peek()
                    && word.starts_with(|c: char| c == ':' || c.is_ascii_digit())
                {
                    self.next();
                }
                Ok(())
            }
            "META" => {
                self.next();
                self.next();
                Ok(())
            }
            "UNIT" => self.unit(),
            "IMPORT" | "EXPORT" => self.passage(word),
            _ => self.node(word, None),
        }
    }

    /// A node that begins with this word.
    fn node(&mut self, word: &'a str, slot: Option<&str>) -> Result<(), Error> {
        if matches!(word, "PROTO" | "EXTERNPROTO" | "ROUTE") && slot.is_some() {
            return self.statement(word);
        }
        let line = self.line();
        let (mut kind, mut name) = (word, None);
        if word == "DEF" {
            name = self.name();
            kind = self.name().unwrap_or_default();
        }
        if word == "USE" {
            kind = "";
            name = self.name();
        } else if self.peek() != Some(Token::Open) {
            self.unexpected(Token::Word(kind));
            return Ok(());
        }
        self.builder.begin(kind, line)?;
        if let Some(slot) = slot {
            self.builder.set_slot(slot);
        }
        if word == "USE" {
            self.builder.use_of(name.unwrap_or_default());
            return self.builder.end();
        }
        self.next();
        if let Some(name) = name {
            self.builder.define(name);
        }
        self.levels.push(Level::Node);
        Ok(())
    }

    /// A field of a node, or what else may stand there.
    fn field(&mut self, word: &'a str) -> Result<(), Error> {
        match word {
            "ROUTE" | "PROTO" | "EXTERNPROTO" => return self.statement(word),
            _ if is_access(word) && self.is_declaration() => return self.declaration(word, true),
            _ => {}
        }
        match self.next() {
            Some(Token::Word("IS")) => {
                let outer = self.name().unwrap_or_default();
                self.builder.connect(word, outer);
                Ok(())
            }
            Some(token) => self.value(word, token),
            None => Ok(()),
        }
    }

    /// Whether a type and a name follow, as in the interface of a script.
    fn is_declaration(&self) -> bool {
        matches!(self.peek(), Some(Token::Word(w)) if w.starts_with("SF") || w.starts_with("MF"))
    }

    /// The value of a field of the innermost node, which begins with `first`. Nodes are only
    /// begun.
    fn value(&mut self, field: &'a str, first: Token<'a>) -> Result<(), Error> {
        let start = self.text.len() - self.rest.len();
        match first {
            Token::ListOpen => {
                if self.begins_node() {
                    self.levels.push(Level::Nodes(field));
                    return Ok(());
                }
                let (rest, content) = list_content(self.rest).unwrap_or((self.rest, ""));
                self.rest = rest;
                match content.contains('#') {
                    true => self.builder.field(field, &without_comments(content)),
                    false => self.builder.field(field, content.trim()),
                }
                if self.peek() == Some(Token::ListClose) {
                    self.next();
                }
            }
            Token::Word("NULL") => {}
            Token::Word(word @ ("TRUE" | "FALSE")) => self.builder.field(field, word),
            Token::Word("DEF" | "USE") => self.slot_node(first, field)?,
            Token::Word(_) if self.peek() == Some(Token::Open) => self.slot_node(first, field)?,
            Token::Word(word) if number(word).is_ok() => {
                let rest = run(number, self.rest).map_or(self.rest, |(rest, _)| rest);
                self.rest = rest;
                let run = &self.text[start - word.len()..self.text.len() - rest.len()];
                self.builder.field(field, &without_comments(run));
            }
            Token::Text(text) => {
                let rest = run(quoted, self.rest).map_or(self.rest, |(rest, _)| rest);
                self.rest = rest;
                let run = &self.text[start - text.len()..self.text.len() - rest.len()];
                self.builder.field(field, &without_comments(run));
            }
            Token::Word(_) => {
                // Perhaps the name of the next field: the value of this one is missing.
                self.unexpected(Token::Word(field));
                self.rest = &self.text[start..];
                let Token::Word(word) = first else {
                    return Ok(());
                };
                self.rest = &self.text[start - word.len()..];
            }
            Token::Close | Token::ListClose => {
                // The end of the node: the value is missing.
                self.unexpected(Token::Word(field));
                self.rest = &self.text[start - 1..];
            }
            Token::Open => self.unexpected(first),
        }
        Ok(())
    }

    fn slot_node(&mut self, first: Token<'a>, slot: &str) -> Result<(), Error> {
        match first {
            Token::Word(word) => self.node(word, Some(slot)),
            _ => Ok(()),
        }
    }

    /// Whether what follows is a node, perhaps after places without one.
    fn begins_node(&self) -> bool {
        let mut next = token(self.rest);
        while let Ok((rest, Token::Word("NULL"))) = next {
            next = token(rest);
        }
        let Ok((rest, Token::Word(word))) = next else {
            return false;
        };
        let is_name = number(word).is_err() && !matches!(word, "TRUE" | "FALSE");
        matches!(word, "DEF" | "USE" | "PROTO" | "EXTERNPROTO" | "ROUTE")
            || is_name && matches!(token(rest), Ok((_, Token::Open)))
    }

    /// `PROTO name [ ... ] { ... }` or `EXTERNPROTO name [ ... ] address`, up to the bracket.
    fn prototype(&mut self, defaults: bool) -> Result<(), Error> {
        let line = self.line();
        let kinds = ["ExternProtoDeclare", "ProtoDeclare"];
        self.builder.begin(kinds[usize::from(defaults)], line)?;
        let name = self.name().unwrap_or_default();
        self.builder.field("name", name);
        if self.peek() == Some(Token::ListOpen) {
            self.next();
            self.levels.push(Level::Interface { defaults });
        } else {
            self.levels.push(Level::Rest { defaults });
        }
        Ok(())
    }

    /// `access type name value`, or `access type name IS name` in a script.
    fn declaration(&mut self, access: &str, defaults: bool) -> Result<(), Error> {
        if !is_access(access) {
            self.unexpected(Token::Word(access));
            return Ok(());
        }
        let line = self.line();
        self.name();
        let Some(name) = self.name() else {
            return Ok(());
        };
        self.builder.begin("field", line)?;
        self.builder.field("name", name);
        self.levels.push(Level::Declared);
        if self.peek() == Some(Token::Word("IS")) {
            self.next();
            self.next();
            return Ok(());
        }
        let has_value = matches!(
            access,
            "field" | "exposedField" | "initializeOnly" | "inputOutput"
        );
        match has_value && defaults {
            true => match self.next() {
                Some(first) => self.value("value", first),
                None => Ok(()),
            },
            false => Ok(()),
        }
    }

    fn route(&mut self) -> Result<(), Error> {
        let line = self.line();
        self.builder.begin("ROUTE", line)?;
        let from = self.name().unwrap_or_default();
        self.next();
        let to = self.name().unwrap_or_default();
        for (end, names) in [
            (from, ["fromNode", "fromField"]),
            (to, ["toNode", "toField"]),
        ] {
            let (node, field) = end.split_once('.').unwrap_or((end, ""));
            self.builder.field(names[0], node);
            self.builder.field(names[1], field);
        }
        self.builder.end()
    }

    /// `IMPORT inline.name AS name` or `EXPORT name AS name`; what begins with `AS` may be missing.
    fn passage(&mut self, keyword: &str) -> Result<(), Error> {
        let line = self.line();
        self.builder.begin(keyword, line)?;
        let from = self.name().unwrap_or_default();
        match (keyword, from.split_once('.')) {
            ("IMPORT", Some((inline, name))) => {
                self.builder.field("inlineDEF", inline);
                self.builder.field("importedDEF", name);
            }
            ("IMPORT", None) => self.builder.field("inlineDEF", from),
            _ => self.builder.field("localDEF", from),
        }
        if self.peek() == Some(Token::Word("AS")) {
            self.next();
            let name = self.name().unwrap_or_default();
            self.builder.field("AS", name);
        }
        self.builder.end()
    }

    /// `UNIT category name factor`
    fn unit(&mut self) -> Result<(), Error> {
        let line = self.line();
        self.builder.begin("unit", line)?;
        for field in ["category", "name", "conversionFactor"] {
            let word = self.name().unwrap_or_default();
            self.builder.field(field, word);
        }
        self.builder.end()
    }
}

fn is_access(word: &str) -> bool {
    const ACCESS: &[&str] = &[
        "field",
        "exposedField",
        "eventIn",
        "eventOut",
        "initializeOnly",
        "inputOutput",
        "inputOnly",
        "outputOnly",
    ];
    ACCESS.contains(&word)
}

/// A value with its comments left out.
fn without_comments(text: &str) -> String {
    let mut kept = String::new();
    let mut rest = text;
    while let Ok((after, Token::Word(word) | Token::Text(word))) = token(rest) {
        if !kept.is_empty() {
            kept.push(' ');
        }
        kept.push_str(word);
        rest = after;
    }
    kept
}
