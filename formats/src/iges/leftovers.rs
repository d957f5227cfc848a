//! What a file holds, and what of it the picture does not: told, and counted by type.

use std::collections::{BTreeMap, BTreeSet};

use super::directory::{Entry, File, entity_use};
use super::types::{self, Class};
use crate::{Tally, Warnings};

/// Counts what is not in the picture. `tried` are the entities of which all has been told.
pub(super) fn tell(
    file: &File<'_>,
    owners: &[Option<usize>],
    tried: &[bool],
    warnings: &mut Warnings,
) {
    let mut annotation: BTreeMap<i64, usize> = BTreeMap::new();
    let mut first = None;
    for (index, entry) in file.entries.iter().enumerate() {
        let Entry { kind, form, .. } = *entry;
        let noun = types::noun(kind);
        let is_free = match owners[index] {
            None => !entry.dependent && is_geometry(entry),
            Some(owner) => matches!(file.entries[owner].kind, 308 | 402),
        };
        // What clips a view is told with that.
        let clips = owners[index].is_some_and(|owner| file.entries[owner].kind == 410);
        if clips || types::is_wire(kind) && (tried[index] || !is_free) {
            continue;
        }
        let is_annotation = kind == 106 && !types::is_free_form(kind, form);
        let text = match types::class(kind) {
            Class::Shown
                if !is_annotation
                    && (kind != 402 || types::is_group(kind, form) || tried[index]) =>
            {
                match (tried[index], entry.blanked) {
                    (true, _) => continue,
                    (_, true) => "blanked entities are not shown".to_owned(),
                    _ if kind == 110 => "lines without ends are not shown".to_owned(),
                    _ => match owners[index].map(|owner| file.entries[owner].kind) {
                        None => format!("{noun} is not shown, because it is marked as no geometry"),
                        Some(142) => format!("{noun} is not shown, but a curve on it"),
                        Some(_) => format!("{noun} is not shown, because its owner is not"),
                    },
                }
            }
            Class::Missing => format!("{noun} (type {kind}) is not read yet"),
            Class::Shown | Class::Annotation if !is_used_property(kind, form) => {
                *annotation.entry(kind).or_default() += 1;
                first.get_or_insert(index);
                continue;
            }
            _ => continue,
        };
        warnings.unsupported(file.place(index), text);
    }
    if let Some(first) = first {
        let counts: Vec<_> = annotation
            .iter()
            .map(|(kind, count)| format!("{count} of type {kind}"))
            .collect();
        let text = format!(
            "annotation, properties and views are not shown: {}",
            counts.join(", ")
        );
        warnings.unsupported(file.place(first), text);
    }
}

/// Whether it is a property that is read: levels and names.
fn is_used_property(kind: i64, form: i64) -> bool {
    kind == 406 && matches!(form, 1 | 3 | 15)
}

/// Whether an entity is neither a definition nor of a parameter domain; assemblies of solids are
/// always marked as definitions.
pub(super) fn is_geometry(entry: &Entry) -> bool {
    entry.kind == 184
        || !matches!(
            entry.entity_use,
            entity_use::DEFINITION | entity_use::PARAMETRIC
        )
}

/// What became of the entities, by type.
pub(super) fn ledger(
    file: &File<'_>,
    refused: &BTreeSet<usize>,
    repaired: &BTreeSet<usize>,
) -> Vec<Tally> {
    let asked = file.take_asked();
    let mut rows: BTreeMap<i64, Tally> = BTreeMap::new();
    for (index, entry) in file.entries.iter().enumerate() {
        let row = rows.entry(entry.kind).or_insert_with(|| Tally {
            kind: format!("{} {}", entry.kind, types::noun(entry.kind)),
            mark: "D",
            ..Tally::default()
        });
        row.count += 1;
        let is_refused = refused.contains(&index);
        let is_used = asked[index] && !is_refused;
        for (list, is_in) in [
            (&mut row.used, is_used),
            (&mut row.repaired, is_used && repaired.contains(&index)),
            (&mut row.refused, is_refused),
        ] {
            list.extend(is_in.then_some(entry.number));
        }
    }
    rows.into_values().collect()
}
