//! The words of VRML 97 and of the classic encoding of X3D.

use nom::branch::alt;
use nom::bytes::complete::{is_a, is_not, tag, take_while, take_while1};
use nom::character::complete::{anychar, char, none_of};
use nom::combinator::{map, opt, recognize, value, verify};
use nom::multi::many0_count;
use nom::sequence::{delimited, pair, preceded};
use nom::{IResult, Parser};

/// A word of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Token<'a> {
    /// `{`
    Open,
    /// `}`
    Close,
    /// `[`
    ListOpen,
    /// `]`
    ListClose,
    /// A string with its quotes.
    Text(&'a str),
    /// Names, keywords and numbers. Names in files break the rules, so all is one that is
    /// nothing else.
    Word(&'a str),
}

/// White space, commas and comments.
pub(super) fn blank(input: &str) -> IResult<&str, ()> {
    let comment = pair(char('#'), opt(is_not("\r\n")));
    let part = alt((value((), is_a(" \t\r\n\x0c,")), value((), comment)));
    value((), many0_count(part)).parse(input)
}

/// A string; a backslash keeps the character after it.
fn string(input: &str) -> IResult<&str, &str> {
    let escaped = preceded(char('\\'), anychar);
    let part = alt((value((), is_not("\\\"")), value((), escaped)));
    recognize(delimited(char('"'), many0_count(part), char('"'))).parse(input)
}

fn is_of_word(c: char) -> bool {
    !matches!(
        c,
        ' ' | '\t' | '\r' | '\n' | '\x0c' | ',' | '{' | '}' | '[' | ']' | '"' | '#'
    )
}

/// The rest of `1.#QNAN` and the like, as some programs write what is no number: it begins with
/// the sign of a comment.
fn no_number(input: &str) -> IResult<&str, &str> {
    let kind = alt((tag("#IND"), tag("#INF"), tag("#QNAN"), tag("#SNAN")));
    recognize(pair(kind, take_while(is_of_word))).parse(input)
}

/// What `of` finds, with what follows if that is the rest of what is no number.
fn with_rest<'a>(
    mut of: impl Parser<&'a str, Output = &'a str, Error = nom::error::Error<&'a str>>,
    input: &'a str,
) -> IResult<&'a str, &'a str> {
    let (rest, found) = of.parse(input)?;
    match no_number(rest) {
        Ok((rest, more)) if found.ends_with('.') => Ok((rest, &input[..found.len() + more.len()])),
        _ => Ok((rest, found)),
    }
}

/// The next word, after white space.
pub(super) fn token(input: &str) -> IResult<&str, Token<'_>> {
    let sign = map(none_of("\"#"), |c| match c {
        '{' => Token::Open,
        '}' => Token::Close,
        '[' => Token::ListOpen,
        _ => Token::ListClose,
    });
    preceded(
        blank,
        alt((
            map(
                |input| with_rest(take_while1(is_of_word), input),
                Token::Word,
            ),
            map(string, Token::Text),
            sign,
        )),
    )
    .parse(input)
}

/// What stands in a list of numbers or strings, up to its bracket.
pub(super) fn list_content(input: &str) -> IResult<&str, &str> {
    let comment = recognize(pair(char('#'), opt(is_not("\r\n"))));
    let words = |input| with_rest(is_not("[]{}\"#"), input);
    recognize(many0_count(alt((words, string, comment)))).parse(input)
}

/// A number, as far as the grammar goes: what it is worth is seen when it is used.
pub(super) fn number(input: &str) -> IResult<&str, Token<'_>> {
    let is_number = |token: &Token<'_>| match token {
        Token::Word(word) => {
            word.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.'))
                || word.parse::<f64>().is_ok()
        }
        _ => false,
    };
    verify(token, is_number).parse(input)
}

/// One string.
pub(super) fn quoted(input: &str) -> IResult<&str, Token<'_>> {
    verify(token, |token| matches!(token, Token::Text(_))).parse(input)
}

/// A value that is a run of these.
pub(super) fn run<'a>(
    of: fn(&'a str) -> IResult<&'a str, Token<'a>>,
    input: &'a str,
) -> IResult<&'a str, &'a str> {
    recognize(pair(of, many0_count(of))).parse(input)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_and_comments_are_white_space() {
        let mut rest = ",a{b # c { \n\t\"d # \\\" }\"[-1,.5]}#end";
        let mut found = Vec::new();
        while let Ok((after, token)) = token(rest) {
            found.push(token);
            rest = after;
        }
        let expected = [
            Token::Word("a"),
            Token::Open,
            Token::Word("b"),
            Token::Text("\"d # \\\" }\""),
            Token::ListOpen,
            Token::Word("-1"),
            Token::Word(".5"),
            Token::ListClose,
            Token::Close,
        ];
        assert_eq!(found, expected);
        assert_eq!(blank(rest), Ok(("", ())));
    }

    #[test]
    fn what_is_no_number_is_no_comment() {
        assert_eq!(token("-1.#IND00, 2"), Ok((", 2", Token::Word("-1.#IND00"))));
        assert_eq!(token("1#INF"), Ok(("#INF", Token::Word("1"))));
        assert_eq!(token("1.#a"), Ok(("#a", Token::Word("1."))));
        assert_eq!(
            list_content("0 1.#QNAN 2 3.# ]\n4] 5"),
            Ok(("] 5", "0 1.#QNAN 2 3.# ]\n4"))
        );
    }

    #[test]
    fn a_string_without_end_is_no_word() {
        assert!(token("\"abc").is_err());
        assert_eq!(run(number, "1 -2,3 x"), Ok((" x", "1 -2,3")));
        assert_eq!(
            list_content("1 # ]\n \"]\" 2] 3"),
            Ok(("] 3", "1 # ]\n \"]\" 2"))
        );
    }
}
