//! Statements that change no surface: checked, and reported where they would change the picture.

use super::invalid;
use super::seams::Merging;
use super::statements::{Statement, number, shown};
use crate::Problem;

/// Approximation techniques of `ctech` and `stech`, with how many numbers each has.
type Techniques = &'static [(&'static str, usize)];

const CURVES: Techniques = &[("cparm", 1), ("cspace", 1), ("curv", 2)];
const SURFACES: Techniques = &[("cparma", 2), ("cparmb", 1), ("cspace", 1), ("curv", 2)];

/// Checks a statement that says nothing about a shape. Surfaces are shown as they are, so
/// that techniques of approximation (`ctech`, `stech`, `res`) and levels of detail are passed
/// over when they are right.
pub(super) fn check(statement: &Statement<'_>) -> Result<(), Problem> {
    let keyword = statement.keyword();
    let mut words = statement.arguments();
    let unsupported = |text: &str| Err(Problem::Unsupported(text.to_owned()));
    match keyword {
        "ctech" => technique(statement, CURVES),
        "stech" => technique(statement, SURFACES),
        "res" => positive(words, 2),
        "lod" => match whole(statement)? {
            0..=100 => Ok(()),
            level => Err(invalid(format!("level {level}; levels go from 0 to 100"))),
        },
        "bevel" | "c_interp" | "d_interp" => match (keyword, words.next()) {
            (_, Some("off")) => Ok(()),
            ("bevel", Some("on")) => unsupported("edges are shown without bevels"),
            (_, Some("on")) => unsupported("materials are not blended between vertices"),
            (_, word) => Err(invalid(format!(
                "\"{}\" where on or off is needed",
                shown(word.unwrap_or(""))
            ))),
        },
        _ if statement.rest().is_empty() => Err(invalid("the name of a file is missing")),
        _ if statement.rest() == "off" => Ok(()),
        "shadow_obj" => unsupported("shadows are those of the object itself"),
        _ => unsupported("reflections are those of the object itself"),
    }
}

/// The group of an `s` statement; 0 for none.
pub(super) fn smoothing(statement: &Statement<'_>) -> Result<u32, Problem> {
    match statement.arguments().next() {
        Some("off") => Ok(0),
        Some("on") => Ok(1),
        _ => whole(statement),
    }
}

/// The group of an `mg` statement.
pub(super) fn merging(statement: &Statement<'_>) -> Result<Merging, Problem> {
    let mut words = statement.arguments();
    if words.next() == Some("off") {
        return Ok(Merging::default());
    }
    let group = whole(statement)?;
    if group == 0 {
        return Ok(Merging::default());
    }
    positive(words.clone(), 1)?;
    let reach = number(words.next().unwrap_or("")).map_err(invalid)?;
    Ok(Merging { group, reach })
}

/// The whole number that a statement begins with.
fn whole(statement: &Statement<'_>) -> Result<u32, Problem> {
    let word = statement.arguments().next().unwrap_or("");
    let message = || invalid(format!("\"{}\" is not a whole number", shown(word)));
    word.parse().map_err(|_| message())
}

/// Refuses anything but so many positive numbers.
fn positive<'a>(words: impl Iterator<Item = &'a str>, count: usize) -> Result<(), Problem> {
    let mut found = 0;
    for word in words {
        let value = number(word).map_err(invalid)?;
        if value < 0.0 {
            return Err(invalid(format!(
                "{value} where a positive number is needed"
            )));
        }
        found += 1;
    }
    if found == count {
        return Ok(());
    }
    Err(invalid(format!("{found} numbers; {count} are needed")))
}

fn technique(statement: &Statement<'_>, known: Techniques) -> Result<(), Problem> {
    let word = statement.arguments().next().unwrap_or("");
    let Some((_, count)) = known.iter().find(|(name, _)| *name == word) else {
        let names: Vec<_> = known.iter().map(|(name, _)| *name).collect();
        let names = names.join(", ");
        return Err(invalid(format!("\"{}\" is none of {names}", shown(word))));
    };
    positive(statement.arguments().skip(1), *count)
}
