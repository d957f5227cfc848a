//! The physical file: lines, sections and cards.
//!
//! The section letter of each card is trusted, the sequence number only where the numbers of
//! a section rise from 1 on; otherwise the position counts. A line that lost its column is
//! read from its right end, where letter and number stand. A delimiter that spills over the
//! data columns of a parameter card, into the blank one before the owner, is read with them.

use std::ops::Range;

use super::compressed::Line;

/// Columns that hold data.
const DATA: usize = 72;

/// Columns of a parameter card that hold data; the owner follows.
const PARAMETERS: usize = 64;

/// Length of a card.
const CARD: usize = 80;

/// One card of the directory or the parameter section.
#[derive(Clone, Copy, Debug)]
pub(super) struct Card<'a> {
    /// Line in the file, from 1 on.
    pub line: usize,
    /// The sequence number, or else the position from 1 on.
    pub number: usize,
    /// The data columns; trailing blanks may be missing.
    pub data: &'a [u8],
    /// The columns that name the owner of a parameter card.
    pub owner: &'a [u8],
}

impl<'a> Card<'a> {
    /// The data of columns `from..from + 8`, without blanks around.
    pub(super) fn field(&self, from: usize) -> &'a [u8] {
        let end = self.data.len().min(from + 8);
        self.data.get(from..end).unwrap_or_default().trim_ascii()
    }
}

/// The sections of a file.
#[derive(Debug, Default)]
pub(super) struct Sections<'a> {
    /// The global section, each card filled up with blanks.
    pub global: Vec<u8>,
    /// The directory.
    pub directory: Vec<Card<'a>>,
    /// The parameters.
    pub parameters: Vec<Card<'a>>,
    /// The lines that hold both, in the compressed form.
    pub data: Vec<Line<'a>>,
    /// The first line that belongs to no section, and how many there are.
    pub stray: Option<(usize, usize)>,
    /// Whether the terminating card is there.
    pub terminated: bool,
}

/// Splits a file in fixed or compressed form into its sections.
pub(super) fn sections(bytes: &[u8]) -> Sections<'_> {
    let mut sections = Sections::default();
    let is_compressed = is_compressed(bytes);
    for (index, text) in lines(bytes).enumerate() {
        let line = index + 1;
        if text.first() == Some(&0x1a) {
            break;
        }
        if is_compressed && !text.get(DATA).is_some_and(|b| b"CSGT".contains(b)) {
            if !text.trim_ascii().is_empty() {
                sections.data.push((line, text.trim_ascii_end()));
            }
            continue;
        }
        let Some(split) = split(text) else {
            if !text.trim_ascii().is_empty() {
                let (first, count) = sections.stray.unwrap_or((line, 0));
                sections.stray = Some((first, count + 1));
            }
            continue;
        };
        let (data, owner) = (&text[split.data], &text[split.owner]);
        let card = Card {
            line,
            number: split.number,
            data,
            owner,
        };
        match split.letter {
            b'G' => {
                sections.global.extend_from_slice(data);
                let missing = DATA - data.len();
                sections.global.extend(std::iter::repeat_n(b' ', missing));
            }
            b'D' => sections.directory.push(card),
            b'P' => sections.parameters.push(card),
            b'T' if !(sections.directory.is_empty() && sections.data.is_empty()) => {
                sections.terminated = true;
                break;
            }
            _ => {}
        }
    }
    renumber(&mut sections.directory);
    renumber(&mut sections.parameters);
    sections
}

/// Whether the first lines look like the start of a file in fixed or compressed form.
pub(super) fn looks_like_iges(bytes: &[u8]) -> bool {
    let first = |letter| {
        move |split: &Split| {
            split.letter == letter && split.number == 1 && split.data.end >= PARAMETERS
        }
    };
    let [one, two] = first_cards(bytes);
    is_binary(bytes)
        || one.filter(first(b'S')).is_some()
        || is_compressed(bytes) && two.filter(first(b'S')).is_some()
}

/// Whether the first card is the flag of the compressed form; it need not have a number.
pub(super) fn is_compressed(bytes: &[u8]) -> bool {
    let [flag, _] = first_cards(bytes);
    flag.is_some_and(|split| split.letter == b'C' && split.data.end == DATA)
}

/// Whether the file begins with the flag section of the binary form: a letter, and how many
/// bytes follow.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    matches!(bytes, [b'B', 0, 0, 0, 75, ..] | [b'B', 75, 0, 0, 0, ..])
}

/// How many bytes are looked at to know a file.
const HEAD: usize = 4096;

/// The first two lines that are not blank, if they are cards.
fn first_cards(bytes: &[u8]) -> [Option<Split>; 2] {
    let head = &bytes[..bytes.len().min(HEAD)];
    let mut lines = lines(head).filter(|line| !line.trim_ascii().is_empty());
    [lines.next(), lines.next()].map(|line| line.and_then(split))
}

/// Replaces numbers that do not rise from 1 on by positions.
fn renumber(cards: &mut [Card<'_>]) {
    let rising = cards.windows(2).all(|pair| pair[0].number < pair[1].number);
    if rising && cards.first().is_none_or(|card| card.number == 1) {
        return;
    }
    for (index, card) in cards.iter_mut().enumerate() {
        card.number = index + 1;
    }
}

/// The parts of one line.
#[derive(Debug, PartialEq)]
struct Split {
    letter: u8,
    number: usize,
    data: Range<usize>,
    owner: Range<usize>,
}

/// Finds section letter and number: in their columns, else at the right end of the line.
fn split(line: &[u8]) -> Option<Split> {
    let in_columns = || {
        let number = line.get(DATA + 1..line.len().min(CARD))?.trim_ascii();
        Some((DATA, digits(number)?))
    };
    let at_the_end = || {
        let text = line.trim_ascii_end();
        let count = text.iter().rev().take_while(|b| b.is_ascii_digit()).count();
        let before = text[..text.len() - count].trim_ascii_end();
        let column = before.len().checked_sub(1)?;
        let fits = (1..=8).contains(&count) && text.len() - column <= CARD - DATA + 1;
        Some((column, digits(&text[text.len() - count..])?)).filter(|_| fits)
    };
    let is_letter = |column: usize| line.get(column).is_some_and(|b| b"SGDPTC".contains(b));
    let (column, number) = in_columns()
        .filter(|&(column, _)| is_letter(column))
        .or_else(at_the_end)
        .filter(|&(column, _)| is_letter(column))?;
    let letter = line[column];
    let end = column.min(DATA);
    let owner = end.saturating_sub(DATA - PARAMETERS);
    let spills = |column: usize| line.get(column).is_some_and(|b| b",;".contains(b));
    let middle = match letter {
        b'P' if spills(owner) => owner + 1,
        b'P' => owner,
        _ => end,
    };
    Some(Split {
        letter,
        number,
        data: 0..middle,
        owner: middle..end,
    })
}

/// A number of digits only; zero if there are none.
fn digits(text: &[u8]) -> Option<usize> {
    text.iter().try_fold(0_usize, |value, &b| {
        let digit = b.is_ascii_digit().then(|| usize::from(b - b'0'))?;
        value.checked_mul(10)?.checked_add(digit)
    })
}

/// The lines of a file with any line ends, or with none and 80 columns each.
fn lines(bytes: &[u8]) -> Lines<'_> {
    let rest = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let letter = |column| rest.get(column).is_some_and(|b| b"SGC".contains(b));
    let head = &rest[..rest.len().min(2 * CARD)];
    let endless = !head.iter().any(|b| matches!(b, b'\n' | b'\r'));
    Lines {
        rest,
        endless: endless && letter(DATA) && letter(CARD + DATA),
    }
}

/// Iterator of [`lines`].
struct Lines<'a> {
    rest: &'a [u8],
    endless: bool,
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        if self.endless {
            let (line, rest) = self.rest.split_at(self.rest.len().min(CARD));
            self.rest = rest;
            return Some(line);
        }
        let end = memchr::memchr2(b'\n', b'\r', self.rest);
        let (line, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.rest = rest
            .strip_prefix(b"\r\n")
            .unwrap_or(rest.get(1..).unwrap_or_default());
        Some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn card(data: &str, letter: char, number: usize) -> String {
        format!("{data:<72}{letter}{number:>7}")
    }

    fn file() -> Vec<String> {
        vec![
            card("start", 'S', 1),
            card("1H,,1H;;", 'G', 1),
            card("     128       1", 'D', 1),
            card("     128       0", 'D', 2),
            card(&format!("{:<64}{:>8}", "128;", 1), 'P', 1),
            card("S      1G      1D      2P      1", 'T', 1),
            "junk after the end".to_owned(),
        ]
    }

    #[test]
    fn all_line_ends_give_the_same_sections() {
        for (end, mark) in [("\n", ""), ("\r\n", "\u{feff}"), ("\r", "")] {
            let text = format!("{mark}{}", file().join(end));
            let sections = sections(text.as_bytes());
            assert!(sections.terminated);
            assert_eq!(sections.global.len(), 72);
            assert_eq!(sections.directory.len(), 2, "{end:?}");
            assert_eq!(sections.parameters[0].line, 5);
            assert_eq!(sections.parameters[0].data.trim_ascii_end(), b"128;");
            assert_eq!(sections.parameters[0].owner.trim_ascii(), b"1");
            assert_eq!(sections.stray, None);
            assert!(looks_like_iges(text.as_bytes()));
        }
        let endless = file()[..6].concat();
        let sections = sections(endless.as_bytes());
        assert_eq!(sections.directory.len(), 2);
        assert!(sections.terminated && looks_like_iges(endless.as_bytes()));
    }

    #[test]
    fn short_long_and_shifted_lines_are_read() {
        let shifted = split(b"text      S      1").unwrap();
        assert_eq!((shifted.letter, shifted.data), (b'S', 0..10));
        let long = card("abc", 'G', 3) + "   more";
        assert_eq!(split(long.as_bytes()).unwrap().number, 3);
        let zeros = format!("{:<71}S0000003", "text");
        assert_eq!(split(zeros.as_bytes()).unwrap().number, 3);
        let unnumbered = split(&card("abc", 'D', 0).as_bytes()[..73]).unwrap();
        assert_eq!((unnumbered.letter, unnumbered.number), (b'D', 0));
        assert_eq!(split(b"no letter here 5"), None);
        assert_eq!(split(b""), None);
        assert!(!looks_like_iges(b"S 1"));
        assert!(!looks_like_iges(b"v 0 0 0\n"));
    }

    #[test]
    fn a_delimiter_in_the_blank_column_is_data() {
        let text = card(&format!("{:>64},{:>7}", 128, 1), 'P', 1);
        let line = split(text.as_bytes()).unwrap();
        assert_eq!((line.data, line.owner), (0..65, 65..72));
        let text = card(&format!("{:>64}{:>8}", 128, 12_345_678), 'P', 1);
        let line = split(text.as_bytes()).unwrap();
        assert_eq!((line.data, line.owner), (0..64, 64..72));
    }

    #[test]
    fn numbers_are_kept_where_a_card_is_missing_only() {
        let text = [1, 2, 4].map(|n| card("", 'D', n)).join("\n");
        let numbers = |text: &str| -> Vec<usize> {
            let sections = sections(text.as_bytes());
            sections.directory.iter().map(|c| c.number).collect()
        };
        assert_eq!(numbers(&text), [1, 2, 4]);
        let text = [1, 2, 2].map(|n| card("", 'D', n)).join("\n");
        assert_eq!(numbers(&text), [1, 2, 3]);
    }
}
