//! What is said to people: no name in a file may steer a terminal.

use std::io::{self, ErrorKind, Write as _};

use serde_json::Value;

/// A text with control characters as escapes.
pub(super) fn visible(text: &str) -> String {
    let mut shown = String::new();
    for letter in text.chars() {
        if letter.is_control() {
            shown.extend(letter.escape_debug());
        } else {
            shown.push(letter);
        }
    }
    shown
}

/// The same of a text of several lines.
pub(super) fn visible_lines(text: &str) -> String {
    let lines: Vec<_> = text.split('\n').map(visible).collect();
    lines.join("\n")
}

/// A name, or that there is none.
pub(super) fn named(name: &str) -> String {
    if name.is_empty() {
        "(no name)".to_owned()
    } else {
        visible(name)
    }
}

/// A number of things.
pub(super) fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// Prints what is told of one file of many. The others are made also where nobody reads about them any
/// more.
///
/// # Errors
/// If it cannot be written, but not because its reader is gone.
pub(super) fn report(line: &Value) -> io::Result<()> {
    match writeln!(io::stdout().lock(), "{line}") {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

/// Prints a line to standard error; work goes on where nobody can read it.
macro_rules! say {
    ($($part:tt)*) => {
        $crate::cli::say::tell(&format!($($part)*))
    };
}

/// See [`say`].
pub(super) fn tell(text: &str) {
    let _ = writeln!(io::stderr(), "{}", visible(text));
}

pub(super) use say;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown() {
        assert_eq!(visible("Körper\n"), "Körper\\n");
        assert_eq!(visible_lines("a\tb\nc\n"), "a\\tb\nc\n");
        assert_eq!(visible("\u{1b}[31m\t\u{9b}"), "\\u{1b}[31m\\t\\u{9b}");
    }
}
