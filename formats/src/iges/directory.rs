//! The directory, and the way from its entries to their parameters.

use std::cell::{Cell, OnceCell, RefCell};
use std::collections::HashMap;

use glam::DVec3;
use kernel::Curve;

use super::draft::Drafted;
use super::global::Global;
use super::parameters::{self, Parameters};
use super::records::Card;
use super::types;
use crate::{Place, Problem};

/// What a status number says about the use of an entity.
pub(super) mod entity_use {
    /// Part of a definition.
    pub(in super::super) const DEFINITION: u8 = 2;
    /// Geometry of a parameter domain.
    pub(in super::super) const PARAMETRIC: u8 = 5;
}

/// One entry of the directory.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Entry {
    /// Number of its first line, as pointers have it.
    pub number: usize,
    /// Line in the file.
    pub line: usize,
    /// Entity type number.
    pub kind: i64,
    /// Form number.
    pub form: i64,
    /// Number of the first parameter card.
    pub data: i64,
    /// Level, or a negative pointer to a list of levels.
    pub level: i64,
    /// Pointer to a transformation, or zero.
    pub transform: i64,
    /// Colour number, or a negative pointer.
    pub color: i64,
    /// Whether it is not to be shown.
    pub blanked: bool,
    /// Whether it exists for another entity only.
    pub dependent: bool,
    /// What it is used for.
    pub entity_use: u8,
    /// How its attributes count for its members.
    pub hierarchy: u8,
    /// Label and subscript.
    pub label: String,
}

/// Pairs the cards of the directory; `broken` hears of cards without their partner.
pub(super) fn entries(cards: &[Card<'_>], mut broken: impl FnMut(Place)) -> Vec<Entry> {
    let mut entries = Vec::new();
    let mut rest = cards;
    while let [first, tail @ ..] = rest {
        rest = tail;
        let second = tail.first().filter(|c| c.number == first.number + 1);
        let is_first = first.number % 2 == 1;
        match second.filter(|_| is_first) {
            Some(second) => {
                rest = &tail[1..];
                entries.push(entry(first, second));
            }
            None => broken(Place::item(first.line, format!("D{}", first.number))),
        }
    }
    entries
}

/// The entry of two cards.
fn entry(first: &Card<'_>, second: &Card<'_>) -> Entry {
    let field = |k: usize| match k {
        1..=9 => first.field(8 * (k - 1)),
        _ => second.field(8 * (k - 11)),
    };
    // Its blanks count as zeros.
    let status = first.data.get(64..first.data.len().min(72));
    Entry::of_fields(first.number, first.line, status.unwrap_or_default(), field)
}

impl Entry {
    /// The entry at a line, of the status field and the others, which have the numbers that the
    /// standard gives them, from 1 to 20.
    pub(super) fn of_fields<'a>(
        number: usize,
        line: usize,
        status: &[u8],
        field: impl Fn(usize) -> &'a [u8],
    ) -> Self {
        let integer = |k: usize| parameters::integer(field(k)).unwrap_or_default();
        let status = statuses(status);
        let mut label = String::from_utf8_lossy(field(18)).into_owned();
        let subscript = integer(19);
        if !label.is_empty() && subscript != 0 {
            label += &subscript.to_string();
        }
        Self {
            number,
            line,
            kind: integer(1),
            form: integer(15),
            data: integer(2),
            level: integer(5),
            transform: integer(7),
            color: integer(13),
            blanked: status[0] == 1,
            dependent: matches!(status[1], 1 | 3),
            entity_use: status[2],
            hierarchy: status[3],
            label,
        }
    }
}

/// The four two-digit numbers of a status field; blanks count as zeros.
fn statuses(field: &[u8]) -> [u8; 4] {
    let mut padded = [b'0'; 8];
    let free = 8 - field.len().min(8);
    for (target, &source) in padded[free..].iter_mut().zip(field) {
        *target = if source.is_ascii_digit() {
            source
        } else {
            b'0'
        };
    }
    std::array::from_fn(|i| (padded[2 * i] - b'0') * 10 + padded[2 * i + 1] - b'0')
}

/// How often the bytes of a file may be read over again, as a factor; only files in which
/// many entries share one record come near.
const REREADS: usize = 20;

/// An IGES file, ready to be looked up.
#[derive(Debug)]
pub(super) struct File<'a> {
    /// The global section.
    pub global: Global,
    /// The directory.
    pub entries: Vec<Entry>,
    cards: Vec<Card<'a>>,
    /// Positions among the cards where records begin, in order.
    starts: Vec<usize>,
    /// Pairs of owner and first card, in order; made when a pointer is wrong.
    owners: OnceCell<Vec<(usize, usize)>>,
    budget: Cell<usize>,
    /// Entries of which the parameters have been asked for.
    asked: RefCell<Vec<bool>>,
    /// What stands in the place of curves of edges, by their entities.
    pub mended: OnceCell<HashMap<usize, Curve<DVec3>>>,
    /// More about entities that are not from an IGES file.
    pub drafted: Drafted,
}

/// Cards of a record that is known to be short: a matrix, a colour, a name.
pub(super) const SHORT: usize = 64;

/// All cards of a record.
pub(super) const WHOLE: usize = usize::MAX;

impl<'a> File<'a> {
    /// A file of its parts.
    pub(super) fn new(global: Global, entries: Vec<Entry>, cards: Vec<Card<'a>>) -> Self {
        let mut starts: Vec<_> = entries
            .iter()
            .filter_map(|entry| position(&cards, entry.data))
            .collect();
        starts.sort_unstable();
        starts.dedup();
        let budget = Cell::new((cards.len() * REREADS).saturating_add(1_000_000));
        let owners = OnceCell::new();
        let asked = RefCell::new(vec![false; entries.len()]);
        Self {
            global,
            entries,
            cards,
            starts,
            owners,
            budget,
            asked,
            mended: OnceCell::new(),
            drafted: Drafted::default(),
        }
    }

    /// How many cards of parameters there are.
    pub(super) fn card_count(&self) -> usize {
        self.cards.len()
    }

    /// The entry a pointer leads to; pointers to its second line are meant for the first.
    pub(super) fn find(&self, pointer: i64) -> Option<usize> {
        let number = usize::try_from(pointer).ok().filter(|n| *n > 0)?;
        let number = number - (number + 1) % 2;
        let is_there = |index: &usize| self.entries.get(*index).map(|e| e.number) == Some(number);
        Some((number - 1) / 2).filter(is_there).or_else(|| {
            self.entries
                .binary_search_by_key(&number, |entry| entry.number)
                .ok()
        })
    }

    /// As [`File::find`], or what is wrong.
    pub(super) fn follow(&self, pointer: i64, to: &str) -> Result<usize, Problem> {
        self.find(pointer).ok_or_else(|| {
            let count = self.entries.len();
            Problem::Invalid(format!(
                "the pointer to {to} is {pointer}; the directory has {count} entries"
            ))
        })
    }

    /// Where an entry stands, in words.
    pub(super) fn place(&self, index: usize) -> Place {
        let entry = &self.entries[index];
        Place::item(entry.line, self.source(index))
    }

    /// What an entry is, in words.
    pub(super) fn source(&self, index: usize) -> String {
        if let Some(source) = self.drafted.sources.get(index) {
            return source.clone();
        }
        let Entry { kind, number, .. } = self.entries[index];
        format!("{} D{number} (type {kind})", types::noun(kind))
    }

    /// The parameters of an entry, after the type number. `buffer` receives the record, up to
    /// `most` cards of it.
    ///
    /// The record is known by its first parameter, the type number. If the pointer leads
    /// elsewhere, the record is looked for by its owner.
    pub(super) fn parameters<'b>(
        &self,
        index: usize,
        most: usize,
        buffer: &'b mut Vec<u8>,
    ) -> Result<Parameters<'b>, Problem> {
        let entry = &self.entries[index];
        self.asked.borrow_mut()[index] = true;
        let pointed = position(&self.cards, entry.data);
        let is_ours = |start: &usize| self.kind_at(*start) == Some(entry.kind);
        let start = pointed
            .filter(is_ours)
            .or_else(|| self.owned(entry.number).filter(is_ours));
        let Some(start) = start else {
            let text = match pointed.map(|start| self.kind_at(start)) {
                None => "its parameters are missing".to_owned(),
                Some(None) => format!("the parameters at card {} are not readable", entry.data),
                Some(Some(kind)) => format!(
                    "the parameters at card {} are of type {kind}, not {}",
                    entry.data, entry.kind
                ),
            };
            return Err(Problem::Invalid(text));
        };
        let next = self.starts.partition_point(|&s| s <= start);
        let end = self.starts.get(next).copied().unwrap_or(self.cards.len());
        let end = end.min(start.saturating_add(most));
        let Some(left) = self.budget.get().checked_sub(end - start) else {
            let text = "too many entities share the same parameters";
            return Err(Problem::Unsupported(text.to_owned()));
        };
        self.budget.set(left);
        buffer.clear();
        // What is on the cards is there already.
        buffer.reserve(64 * (end - start));
        for card in &self.cards[start..end] {
            buffer.extend_from_slice(card.data);
            // Counted strings may run over the end of a card.
            let missing = 64_usize.saturating_sub(card.data.len());
            buffer.extend(std::iter::repeat_n(b' ', missing));
        }
        let mut parameters = Parameters::new(buffer, self.global.delimiters, 0);
        parameters.integer()?;
        Ok(parameters)
    }

    /// The entries of which the parameters have been asked for since this was called last.
    pub(super) fn take_asked(&self) -> Vec<bool> {
        self.asked.replace(vec![false; self.entries.len()])
    }

    /// The type number at the start of a record.
    fn kind_at(&self, start: usize) -> Option<i64> {
        let data = self.cards.get(start)?.data;
        Parameters::new(data, self.global.delimiters, 0)
            .integer()
            .ok()
    }

    /// The first card that names this owner.
    fn owned(&self, number: usize) -> Option<usize> {
        let owners = self.owners.get_or_init(|| {
            let owner = |(index, card): (usize, &Card<'_>)| {
                let owner = parameters::integer(card.owner.trim_ascii())?;
                Some((usize::try_from(owner).ok()?, index))
            };
            let mut owners: Vec<_> = self.cards.iter().enumerate().filter_map(owner).collect();
            owners.sort_unstable();
            owners
        });
        let found = owners.partition_point(|&(owner, _)| owner < number);
        let (owner, index) = *owners.get(found)?;
        (owner == number).then_some(index)
    }
}

/// The position of the parameter card with this number.
fn position(cards: &[Card<'_>], number: i64) -> Option<usize> {
    let number = usize::try_from(number).ok()?;
    let is_there = |index: &usize| cards.get(*index).map(|card| card.number) == Some(number);
    number
        .checked_sub(1)
        .filter(is_there)
        .or_else(|| cards.binary_search_by_key(&number, |card| card.number).ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn status_fields_are_four_numbers() {
        assert_eq!(statuses(b"01020304"), [1, 2, 3, 4]);
        assert_eq!(statuses(b" 1 0 0 1"), [1, 0, 0, 1]);
        assert_eq!(statuses(b"10500"), [0, 1, 5, 0]);
        assert_eq!(statuses(b""), [0; 4]);
    }

    #[test]
    fn cards_without_partner_are_named() {
        let card = |number| Card {
            line: number + 10,
            number,
            data: b"     128       1",
            owner: b"",
        };
        let cards = [1, 2, 3, 6, 7, 8].map(card);
        let mut broken = Vec::new();
        let entries = entries(&cards, |place| broken.push(place.to_string()));
        let numbers: Vec<_> = entries.iter().map(|e| e.number).collect();
        assert_eq!(numbers, [1, 7]);
        assert_eq!(broken, ["line 13, D3", "line 16, D6"]);
    }
}
