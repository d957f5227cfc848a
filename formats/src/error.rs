//! What can be wrong with a file, for the four people who can fix it, and where.

use std::collections::HashMap;
use std::fmt;

/// A place in a file, in the format's own words.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// Line in the file, from 1 on; 0 where lines have no meaning.
    pub line: usize,
    /// What stands there, such as `surface D57 (type 128)`; may be empty.
    pub what: String,
}

impl Place {
    /// A line of the file.
    pub fn line(line: usize) -> Self {
        Self {
            line,
            what: String::new(),
        }
    }

    /// Something at a line of the file.
    pub fn item(line: usize, what: impl Into<String>) -> Self {
        Self {
            line,
            what: what.into(),
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.line, self.what.as_str()) {
            (0, "") => write!(f, "the file"),
            (0, what) => write!(f, "{what}"),
            (line, "") => write!(f, "line {line}"),
            (line, what) => write!(f, "line {line}, {what}"),
        }
    }
}

/// What is wrong, by who can fix it.
#[derive(Clone, Debug, PartialEq)]
pub enum Problem {
    /// The file breaks its own rules: its author.
    Invalid(String),
    /// The file is right, we are not done: us.
    Unsupported(String),
    /// Well formed, but no such geometry exists: the modeller.
    Geometry(kernel::Error),
    /// Beyond [`crate::Limits`], which the user may raise, or more work than any file needs.
    TooLarge(String),
}

impl Problem {
    /// One word for the kind, as `info` shows it.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Invalid(_) => "invalid",
            Self::Unsupported(_) => "unsupported",
            Self::Geometry(_) => "geometry",
            Self::TooLarge(_) => "too large",
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Invalid(text) | Self::Unsupported(text) | Self::TooLarge(text) => {
                write!(f, "{text}")
            }
            Self::Geometry(error) => write!(f, "{error}"),
        }
    }
}

impl From<kernel::Error> for Problem {
    fn from(error: kernel::Error) -> Self {
        Self::Geometry(error)
    }
}

/// Why nothing useful could be read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Error {
    /// Name of the format, as in [`crate::FORMATS`]; empty before it is known.
    pub format: &'static str,
    /// Where.
    pub place: Place,
    /// What.
    pub problem: Problem,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let space = if self.format.is_empty() { "" } else { " " };
        let (place, problem) = (self.place.to_string(), self.problem.to_string());
        let [place, problem] = [place, problem].map(shortened);
        write!(f, "{}{space}{place}: {problem}", self.format)
    }
}

impl std::error::Error for Error {}

/// The most bytes of a message or of the name of a place, which files write into them.
const TEXT_KEPT: usize = 1200;

/// The text, without its middle if it is too long.
fn shortened(text: String) -> String {
    if text.len() <= TEXT_KEPT {
        return text;
    }
    let boundary = |from: usize| (from..).find(|&at| text.is_char_boundary(at));
    let start = boundary(TEXT_KEPT * 3 / 4).unwrap_or_default();
    let end = boundary(text.len() - TEXT_KEPT / 4).unwrap_or(text.len());
    let (start, end) = (&text[..start], &text[end..]);
    format!("{start} [...] {end}")
}

/// How many places a warning remembers; all of them are counted.
const PLACES_KEPT: usize = 8;

/// Something a reader could not use or had to repair, with all the places where it did.
#[derive(Clone, Debug, PartialEq)]
pub struct Warning {
    /// What.
    pub problem: Problem,
    /// How often.
    pub count: usize,
    /// Where: the first few places.
    pub places: Vec<Place>,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let first = self.places.first().cloned().unwrap_or_default();
        write!(f, "{first}: {}", self.problem)?;
        match self.count {
            0 | 1 => Ok(()),
            count => write!(f, " (and {} more)", count - 1),
        }
    }
}

/// The warnings of one file; problems that read the same are one warning with a count.
#[derive(Clone, Debug, Default)]
pub struct Warnings {
    list: Vec<Warning>,
    /// Where in the list a problem stands, by its kind and text.
    index: HashMap<(&'static str, String), usize>,
}

impl PartialEq for Warnings {
    fn eq(&self, other: &Self) -> bool {
        self.list == other.list
    }
}

/// How many different warnings are kept apart; further ones are summed up in the last.
const WARNINGS_KEPT: usize = 1000;

impl Warnings {
    /// Notes a problem at a place.
    pub fn add(&mut self, place: Place, problem: impl Into<Problem>) {
        let place = Place {
            what: shortened(place.what),
            ..place
        };
        let mut problem = match problem.into() {
            Problem::Invalid(text) => Problem::Invalid(shortened(text)),
            Problem::Unsupported(text) => Problem::Unsupported(shortened(text)),
            other => other,
        };
        let key = |problem: &Problem| (problem.kind(), problem.to_string());
        let mut name = key(&problem);
        if self.list.len() >= WARNINGS_KEPT && !self.index.contains_key(&name) {
            problem = Problem::Invalid("further problems of other kinds".to_owned());
            name = key(&problem);
        }
        let next = self.list.len();
        let at = *self.index.entry(name).or_insert(next);
        match self.list.get_mut(at) {
            Some(warning) => {
                warning.count += 1;
                if warning.places.len() < PLACES_KEPT {
                    warning.places.push(place);
                }
            }
            None => self.list.push(Warning {
                problem,
                count: 1,
                places: vec![place],
            }),
        }
    }

    /// Notes what the file breaks.
    pub fn invalid(&mut self, place: Place, text: impl Into<String>) {
        self.add(place, Problem::Invalid(text.into()));
    }

    /// Notes what we cannot read yet.
    pub fn unsupported(&mut self, place: Place, text: impl Into<String>) {
        self.add(place, Problem::Unsupported(text.into()));
    }

    /// The warnings in the order of their first places.
    pub fn as_slice(&self) -> &[Warning] {
        &self.list
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_words_of_files_are_shortened() {
        let word = "é".repeat(1_000_000);
        let mut warnings = Warnings::default();
        warnings.invalid(Place::item(1, word.clone()), format!("{word} is not known"));
        let told = warnings.as_slice()[0].to_string();
        assert!(
            told.len() < 3000 && told.ends_with(" is not known"),
            "{told}"
        );
        let error = Error {
            format: "X",
            place: Place::item(1, word.clone()),
            problem: Problem::Invalid(word),
        };
        assert!(error.to_string().len() < 3000);
    }

    #[test]
    fn equal_problems_are_counted_where_they_first_stood() {
        let mut warnings = Warnings::default();
        for line in 1..=20 {
            warnings.invalid(
                Place::line(line),
                if line % 2 == 0 { "even" } else { "odd" },
            );
        }
        // The same words of another kind are another problem.
        warnings.unsupported(Place::line(21), "odd");
        let found: Vec<_> = warnings
            .as_slice()
            .iter()
            .map(ToString::to_string)
            .collect();
        let expected = [
            "line 1: odd (and 9 more)",
            "line 2: even (and 9 more)",
            "line 21: odd",
        ];
        assert_eq!(found, expected);
        assert_eq!(warnings.as_slice()[0].places.len(), PLACES_KEPT);
    }

    #[test]
    fn too_many_kinds_are_summed_up_in_the_last() {
        let mut warnings = Warnings::default();
        for line in 1..=2 * WARNINGS_KEPT {
            warnings.invalid(Place::line(line), format!("problem {line}"));
        }
        warnings.invalid(Place::line(1), "problem 1");
        let list = warnings.as_slice();
        assert_eq!(list.len(), WARNINGS_KEPT + 1);
        assert_eq!(list[WARNINGS_KEPT].count, WARNINGS_KEPT);
        assert_eq!(list[0].count, 2);
    }
}
