//! Records and cards: entities with their parameters, cut into lines of 80 columns.

use std::fmt::Write as _;

use glam::DVec3;

use crate::Problem;
use crate::write::push_number;

/// The parameters of a record, one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Record {
    /// What may not be cut, each with the delimiter that follows it.
    tokens: Vec<Vec<u8>>,
}

impl Record {
    /// A record of an entity type.
    pub(super) fn new(kind: usize) -> Self {
        let mut record = Self::default();
        record.integer(kind);
        record
    }

    /// Adds a count, flag or pointer.
    pub(super) fn integer(&mut self, value: usize) {
        self.tokens.push(value.to_string().into_bytes());
    }

    /// Adds counts, flags or pointers.
    pub(super) fn integers(&mut self, values: impl IntoIterator<Item = usize>) {
        values.into_iter().for_each(|value| self.integer(value));
    }

    /// Adds a list of pointers after their count.
    pub(super) fn pointers(&mut self, values: &[usize]) {
        self.integer(values.len());
        self.integers(values.iter().copied());
    }

    /// Adds a number, with as many digits as it takes to read the same one again.
    pub(super) fn real(&mut self, value: f64) {
        let mut text = String::new();
        push_number(&mut text, value);
        let (digits, exponent) = text.split_once('e').unwrap_or((&text, ""));
        let point = if digits.contains('.') { "" } else { "." };
        let mark = if exponent.is_empty() { "" } else { "D" };
        self.tokens
            .push(format!("{digits}{point}{mark}{exponent}").into_bytes());
    }

    /// Adds numbers.
    pub(super) fn reals(&mut self, values: impl IntoIterator<Item = f64>) {
        values.into_iter().for_each(|value| self.real(value));
    }

    /// Adds the coordinates of a point.
    pub(super) fn point(&mut self, point: DVec3) {
        self.reals(point.to_array());
    }

    /// Adds a counted string; control characters become blanks.
    pub(super) fn text(&mut self, text: &str) {
        if text.is_empty() {
            return self.tokens.push(Vec::new());
        }
        let clean = |c: char| if c.is_control() { ' ' } else { c };
        let clean: String = text.chars().map(clean).collect();
        self.tokens
            .push(format!("{}H{clean}", clean.len()).into_bytes());
    }

    /// The record in lines of at most `width` bytes, cut at delimiters and within strings.
    pub(super) fn lines(&self, width: usize) -> Vec<Vec<u8>> {
        let mut lines = vec![Vec::new()];
        for (index, token) in self.tokens.iter().enumerate() {
            let delimiter = if index + 1 < self.tokens.len() {
                b','
            } else {
                b';'
            };
            // Strings may be cut after their count, and fill the line then.
            let mut whole = token.iter().position(|&b| b == b'H').unwrap_or(width);
            let mut rest = [token.as_slice(), &[delimiter]].concat();
            while let Some(line) = lines.last_mut() {
                let room = width - line.len();
                if rest.len() <= room {
                    line.append(&mut rest);
                    break;
                }
                if whole < room {
                    line.extend(rest.drain(..room));
                    whole = 0;
                }
                lines.push(Vec::new());
            }
        }
        lines
    }
}

/// An entity: its entry in the directory, and its parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Entity {
    /// Type number.
    pub kind: usize,
    /// Form number.
    pub form: usize,
    /// Pointer to a transformation, or zero.
    pub transform: usize,
    /// Pointer to a colour, or zero.
    pub color: usize,
    /// The number that stands for the colour where pointers to colours are not followed.
    pub color_number: usize,
    /// How it is used.
    pub status: Status,
    /// Its parameters.
    pub record: Record,
}

/// The four numbers of a status field: blanked, subordinate, use, hierarchy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Status {
    /// Shown for its own sake.
    #[default]
    Independent,
    /// Exists for another entity only.
    Dependent,
    /// Member of a group or definition, and shown.
    Member,
    /// Part of a definition.
    Definition,
    /// Curve of a parameter domain.
    Parametric,
}

impl Status {
    fn field(self) -> &'static str {
        match self {
            Self::Independent => "00000000",
            Self::Dependent => "00010000",
            Self::Member => "00020000",
            Self::Definition => "00000200",
            Self::Parametric => "00010500",
        }
    }
}

/// The directory and parameter sections of a file that is being written.
#[derive(Clone, Debug, Default)]
pub(super) struct Deck {
    entities: Vec<Entity>,
}

/// Greatest number of a card.
const MOST_CARDS: usize = 9_999_999;

impl Deck {
    pub(super) fn is_empty(&self) -> bool {
        self.entities.is_empty()
    }

    /// Adds an entity; the result is the pointer to it.
    pub(super) fn add(&mut self, entity: Entity) -> usize {
        self.entities.push(entity);
        2 * self.entities.len() - 1
    }

    /// The entity at a pointer that [`Deck::add`] gave.
    pub(super) fn entity(&mut self, pointer: usize) -> &mut Entity {
        &mut self.entities[pointer / 2]
    }

    /// The file, from its start and global records.
    ///
    /// # Errors
    /// If there are more cards than seven digits can count.
    pub(super) fn into_bytes(self, start: &str, global: &Record) -> Result<Vec<u8>, Problem> {
        let mut file = Vec::new();
        let globals = global.lines(72);
        card(&mut file, start.as_bytes(), b'S', 1);
        for (line, number) in globals.iter().zip(1..) {
            card(&mut file, line, b'G', number);
        }
        let mut data = Vec::new();
        let mut cards = 0;
        for (index, entity) in self.entities.iter().enumerate() {
            let (first, pointer) = (cards + 1, 2 * index + 1);
            for line in entity.record.lines(64) {
                cards += 1;
                let mut text = line;
                text.resize(64, b' ');
                text.extend(format!("{pointer:>8}").bytes());
                card(&mut data, &text, b'P', cards);
            }
            directory(&mut file, entity, pointer, first..cards + 1);
        }
        let entries = 2 * self.entities.len();
        if cards.max(entries) > MOST_CARDS {
            let text = format!("{cards} cards; card numbers have seven digits");
            return Err(Problem::TooLarge(text));
        }
        file.append(&mut data);
        let end = format!("S{:>7}G{:>7}D{entries:>7}P{cards:>7}", 1, globals.len());
        card(&mut file, end.as_bytes(), b'T', 1);
        Ok(file)
    }
}

/// One line: data, section letter, number.
fn card(file: &mut Vec<u8>, data: &[u8], letter: u8, number: usize) {
    let start = file.len();
    file.extend_from_slice(data);
    file.resize(start + 72, b' ');
    file.push(letter);
    file.extend(format!("{number:>7}\n").bytes());
}

/// The two lines of a directory entry.
fn directory(file: &mut Vec<u8>, entity: &Entity, pointer: usize, cards: std::ops::Range<usize>) {
    let Entity {
        kind,
        form,
        transform,
        ..
    } = *entity;
    let (first, count, status) = (cards.start, cards.len(), entity.status.field());
    let color = if entity.color == 0 {
        entity.color_number.to_string()
    } else {
        format!("-{}", entity.color)
    };
    let mut line = String::new();
    // Writing into a string cannot fail.
    let _ = write!(
        line,
        "{kind:>8}{first:>8}{0:>8}{0:>8}{0:>8}{0:>8}{transform:>8}{0:>8}{status}",
        0
    );
    card(file, line.as_bytes(), b'D', pointer);
    line.clear();
    let _ = write!(
        line,
        "{kind:>8}{0:>8}{color:>8}{count:>8}{form:>8}{1:>24}{0:>8}",
        0, ""
    );
    card(file, line.as_bytes(), b'D', pointer + 1);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_bits_and_have_points() {
        let mut record = Record::new(126);
        record.reals([1.0, -0.5, 1e-7, 1.5e300, 1e16, -0.0]);
        let text = record.lines(64).concat();
        assert_eq!(text, b"126,1.,-0.5,1.D-7,1.5D300,1.D16,-0.;");
    }

    #[test]
    fn lines_are_cut_at_delimiters_and_within_strings() {
        let mut record = Record::new(406);
        record.integer(12345);
        record.text("a long name, indeed");
        record.real(0.25);
        let lines: Vec<_> = record
            .lines(16)
            .into_iter()
            .map(String::from_utf8)
            .collect();
        let lines: Result<Vec<_>, _> = lines.into_iter().collect();
        assert_eq!(
            lines.unwrap(),
            ["406,12345,19Ha l", "ong name, indeed", ",0.25;"]
        );
        let mut record = Record::new(1);
        record.integers([123_456, 789]);
        assert_eq!(
            record.lines(8),
            [b"1,".to_vec(), b"123456,".to_vec(), b"789;".to_vec()]
        );
    }

    #[test]
    fn cards_have_eighty_columns() {
        let mut deck = Deck::default();
        let entity = Entity {
            kind: 406,
            form: 15,
            record: Record::new(406),
            ..Entity::default()
        };
        assert_eq!([deck.add(entity.clone()), deck.add(entity)], [1, 3]);
        let file = deck.into_bytes("start", &Record::new(0)).unwrap();
        let text = String::from_utf8(file).unwrap();
        assert!(text.lines().all(|line| line.len() == 80), "{text}");
        assert_eq!(text.lines().count(), 1 + 1 + 4 + 2 + 1);
    }
}
