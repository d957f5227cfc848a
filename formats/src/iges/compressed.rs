//! The compressed form: directory and parameters of an entity stand together.
//!
//! Each entity begins with a record such as `D7@1_126@15_0@18_RAIL;`: its number in the
//! directory, and those directory fields, by their numbers, that differ from the entity before.
//! Such records go on in lines that begin with `@`. The lines of the parameters follow, without
//! card numbers, up to the next record; how many they are (field 14) need not be known.

use super::directory::Entry;
use super::parameters;
use super::records::Card;
use crate::{Place, Problem};

/// A line with its number.
pub(super) type Line<'a> = (usize, &'a [u8]);

/// The entities in the lines of the data section, and the cards of their parameters. `broken`
/// hears of records that are not readable as a whole.
///
/// # Errors
/// If there are more than `limit` entities.
pub(super) fn entities<'a>(
    lines: &[Line<'a>],
    end_of_record: u8,
    limit: usize,
    mut broken: impl FnMut(Place),
) -> Result<(Vec<Entry>, Vec<Card<'a>>), Problem> {
    let (mut entries, mut cards) = (Vec::new(), Vec::new());
    let mut fields: [&[u8]; 21] = [b""; 21];
    let mut rest = lines;
    while let [(line, text), tail @ ..] = rest {
        rest = tail;
        let mut data = *text;
        if let Some((number, mut record)) = record(text, end_of_record) {
            if entries.len() == limit {
                let text = format!("more than {limit} entities, which is the limit");
                return Err(Problem::TooLarge(text));
            }
            data = loop {
                let end = record.iter().position(|&b| b == end_of_record);
                let (specs, after) = record.split_at(end.unwrap_or(record.len()));
                if !fill(&mut fields, specs) {
                    broken(Place::item(*line, format!("D{number}")));
                }
                match rest {
                    [(_, next), tail @ ..] if end.is_none() && next.starts_with(b"@") => {
                        (record, rest) = (next, tail);
                    }
                    _ => break after.get(1..).unwrap_or_default(),
                }
            };
            entries.push(Entry {
                data: i64::try_from(cards.len() + 1).unwrap_or(i64::MAX),
                ..Entry::of_fields(number, *line, fields[9], |k| fields[k])
            });
            if data.trim_ascii().is_empty() {
                continue;
            }
        }
        cards.push(Card {
            line: *line,
            number: cards.len() + 1,
            data,
            owner: b"",
        });
    }
    let rising = entries.windows(2).all(|e| e[0].number < e[1].number);
    if !rising || entries.iter().any(|entry| entry.number % 2 == 0) {
        for (index, entry) in entries.iter_mut().enumerate() {
            entry.number = 2 * index + 1;
        }
    }
    Ok((entries, cards))
}

/// Number and fields of a record of the directory, if the line is the first one of such.
fn record(text: &[u8], end_of_record: u8) -> Option<(usize, &[u8])> {
    let text = text.strip_prefix(b"D")?.trim_ascii_start();
    let digits = text.iter().take_while(|b| b.is_ascii_digit()).count();
    let (number, fields) = text.split_at(digits);
    let fields = fields.trim_ascii_start();
    let number = usize::try_from(parameters::integer(number)?).ok()?;
    let is_record = fields
        .first()
        .is_none_or(|&b| b == b'@' || b == end_of_record);
    is_record.then_some((number, fields))
}

/// Takes fields such as `@1_126@15_0` over; whether all are readable.
fn fill<'a>(fields: &mut [&'a [u8]; 21], specs: &'a [u8]) -> bool {
    let specs = specs.trim_ascii();
    let mut readable = specs.is_empty() || specs.starts_with(b"@");
    for spec in specs.split(|&b| b == b'@').skip(1) {
        let field = spec.iter().position(|&b| b == b'_').and_then(|at| {
            let number = usize::try_from(parameters::integer(spec[..at].trim_ascii())?).ok()?;
            let field = fields.get_mut(number).filter(|_| number > 0)?;
            *field = spec[at + 1..].trim_ascii();
            Some(())
        });
        readable &= field.is_some();
    }
    readable
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIRST: &[u8] = b"@1_110@3_0@4_0@5_7@6_0@7_0@8_0@9_00010500@12_0@13_3";

    fn read(lines: &[&'static [u8]]) -> (Vec<Entry>, Vec<Card<'static>>, usize) {
        let lines: Vec<Line<'_>> = (10..).zip(lines.iter().copied()).collect();
        let mut broken = 0;
        let (entries, cards) = entities(&lines, b';', 100, |_| broken += 1).unwrap();
        (entries, cards, broken)
    }

    #[test]
    fn fields_are_those_of_the_entity_before_unless_given() {
        let first = [b"D1", FIRST].concat().leak();
        let (entries, cards, broken) = read(&[
            first,
            b"@14_1@15_0@16_@17_@18_LINE@19_4;",
            b"110,0.,0.,0.,",
            b"1.,0.,0.;",
            b"D3@1_116@9_00000000@18_;116,1.,2.,3.;",
            b"D5 @13_-1 @7_3;",
            b"116,4.,5.,6.;",
        ]);
        assert_eq!(broken, 0);
        let [line, one, two] = &entries[..] else {
            panic!("{entries:?}")
        };
        assert_eq!(
            (line.number, line.line, line.kind, line.data),
            (1, 10, 110, 1)
        );
        assert_eq!(
            (line.label.as_str(), line.level, line.color),
            ("LINE4", 7, 3)
        );
        assert!(line.dependent && line.entity_use == 5);
        assert_eq!((one.number, one.kind, one.data, one.color), (3, 116, 3, 3));
        assert!(!one.dependent && one.entity_use == 0 && one.label.is_empty());
        assert_eq!(
            (two.kind, two.data, two.color, two.transform),
            (116, 4, -1, 3)
        );
        let data: Vec<_> = cards.iter().map(|card| card.data).collect();
        assert_eq!(data[2], b"116,1.,2.,3.;");
        assert_eq!((data.len(), cards[3].line, cards[3].number), (4, 16, 4));
    }

    #[test]
    fn odd_records_are_told_and_odd_numbers_replaced() {
        let (entries, cards, broken) = read(&[b"D2@1_116@x_3@99_1@7;", b"116;", b"D2;", b"D9x"]);
        assert_eq!(broken, 1);
        let numbers: Vec<_> = entries.iter().map(|e| (e.number, e.kind)).collect();
        assert_eq!(numbers, [(1, 116), (3, 116)]);
        assert_eq!(cards.len(), 2);
        assert!(entities(&[(1, b"D1;"), (2, b"D3;")], b';', 1, |_| ()).is_err());
    }
}
