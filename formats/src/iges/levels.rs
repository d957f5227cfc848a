//! Levels: what programs call layers, by number and sometimes with a name.

use std::collections::BTreeMap;

use super::directory::{File, SHORT, WHOLE};
use crate::{Level, Problem};

/// The levels of `shown` entities; none if all are on level 0, which is none.
pub(super) fn read(file: &File<'_>, shown: impl Iterator<Item = usize>) -> Vec<Level> {
    let mut counts: BTreeMap<i64, usize> = BTreeMap::new();
    for index in shown {
        let level = file.entries[index].level;
        let list = if level < 0 {
            listed(file, level).unwrap_or_default()
        } else {
            vec![level]
        };
        for level in list {
            *counts.entry(level).or_default() += 1;
        }
    }
    if counts.keys().all(|&level| level == 0) {
        return Vec::new();
    }
    let names = names(file);
    let level = |(number, count)| Level {
        number,
        name: names.get(&number).cloned().unwrap_or_default(),
        count,
    };
    counts.into_iter().map(level).collect()
}

/// The levels of a list (type 406, form 1), by the negative pointer to it.
fn listed(file: &File<'_>, pointer: i64) -> Result<Vec<i64>, Problem> {
    let index = file.follow(pointer.saturating_neg(), "a list of levels")?;
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
    parameters.pointers("levels")
}

/// The names of levels: properties (type 406, form 3) on the level that they name.
fn names(file: &File<'_>) -> BTreeMap<i64, String> {
    let mut names = BTreeMap::new();
    for (index, entry) in file.entries.iter().enumerate() {
        if (entry.kind, entry.form) != (406, 3) {
            continue;
        }
        let mut buffer = Vec::new();
        let Ok(mut parameters) = file.parameters(index, SHORT, &mut buffer) else {
            continue;
        };
        // How many follow, and the number of the use the level has.
        parameters.text();
        parameters.text();
        let name = parameters.text();
        if !name.is_empty() {
            names.entry(entry.level).or_insert(name);
        }
    }
    names
}
