//! STEP (ISO 10303-21 with the application protocols 203, 214 and 242): bodies by their boundaries.
//!
//! `part21` finds the instances and `values` what they say, `curves` (with `arcs`) and `surfaces`
//! (with `nets` and `rectangles`) read geometry, `topology` edges, faces, shells and solids, `solids` those by
//! construction, `tessellated` those of triangles; `structure` tells products and representations, `products` assembles them, with their
//! `units`, and `external` finds those in other files; `styles` has the colours, and `overrides` those
//! that hold in some places only. Bodies of STEP have the make of those of IGES, so that `translator`
//! writes them down as its entities (types 186, 514, 510 and 508), and its reader makes the scene of
//! these: trim curves are laid onto surfaces, and repaired, in one way for both.

use std::collections::{BTreeMap, BTreeSet};

use kernel::Unit;

use crate::{Error, Format, Import, Place, Problem, ReadOptions, Tally};

mod arcs;
#[cfg(test)]
mod boolean_tests;
mod curves;
mod external;
#[cfg(test)]
mod external_tests;
mod nets;
#[cfg(test)]
mod odd_tests;
mod orientation;
mod overrides;
#[cfg(test)]
mod overrides_tests;
mod part21;
#[cfg(test)]
mod part21_tests;
mod products;
#[cfg(test)]
mod products_tests;
mod rectangles;
#[cfg(test)]
mod rectangles_tests;
mod revolved;
mod solids;
mod structure;
mod styles;
mod surfaces;
mod tessellated;
#[cfg(test)]
mod tessellated_tests;
#[cfg(test)]
mod tests;
mod topology;
mod translator;
mod units;
mod values;

use external::Files;
use part21::Exchange;
use translator::Translator;

/// The row of this format.
pub(crate) const FORMAT: Format = Format {
    name: "STEP",
    extensions: &["stp", "step", "p21"],
    sniff,
    read,
};

/// How files begin.
const START: &[u8] = b"ISO-10303-21";

/// How many bytes may stand before that.
const BEFORE: usize = 4096;

fn sniff(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(BEFORE)];
    let at = head
        .windows(START.len())
        .position(|w| w.eq_ignore_ascii_case(START));
    // Before it there may be blanks, a mark of UTF-8, and comments.
    at.is_some_and(|at| {
        let before = head[..at]
            .strip_prefix(b"\xef\xbb\xbf")
            .unwrap_or(&head[..at]);
        let before = before.trim_ascii();
        before.is_empty() || before.starts_with(b"/*")
    })
}

/// An error of this format.
fn error(place: Place, problem: Problem) -> Error {
    Error {
        format: FORMAT.name,
        place,
        problem,
    }
}

fn read(bytes: &[u8], options: &ReadOptions<'_>) -> Result<Import, Error> {
    let limits = options.limits;
    let exchange = Exchange::new(bytes, limits.entities);
    let exchange = exchange.map_err(|problem| error(Place::default(), problem))?;
    if exchange.ids().next().is_none() && !sniff(bytes) {
        let text = if bytes.trim_ascii_start().starts_with(b"<") {
            "it is XML; of STEP only the clear text of Part 21 is read, so write it as that"
        } else {
            "it has neither ISO-10303-21 at its start nor instances; this is no STEP file"
        };
        return Err(error(Place::default(), Problem::Invalid(text.to_owned())));
    }
    let files = Files::new(options);
    let mut translator = Translator::new(&exchange, limits, &files);
    let (_, units) = translator.whole(0);
    let Translator {
        draft,
        warnings,
        refused,
        failure,
        fatal,
        ..
    } = translator;
    if let Some(fatal) = fatal {
        return Err(fatal);
    }
    let unit = units.map(|units| Unit::of_length(units.metres));
    let resolution = units.map_or(0.0, |units| units.uncertainty);
    let origins = draft.origins().to_vec();
    let import = draft.into_import(unit, resolution, limits, warnings);
    let mut import = import.map_err(|found| error(found.place, found.problem))?;
    if import.scene.patches().is_empty()
        && import.scene.meshes().is_empty()
        && import.scene.wires().is_empty()
        && let Some(failure) = failure
    {
        return Err(failure);
    }
    import.ledger = ledger(&exchange, &import.ledger, &origins, &refused);
    Ok(import)
}

/// What became of the instances, by type: those of which entities were made, or should have been.
fn ledger(
    exchange: &Exchange<'_>,
    entities: &[Tally],
    origins: &[u64],
    refused: &BTreeSet<u64>,
) -> Vec<Tally> {
    let of = |numbers: &[usize]| -> Vec<u64> {
        let origin = |number: &usize| origins.get(number / 2).copied();
        numbers.iter().filter_map(origin).collect()
    };
    let mut lists: [BTreeSet<u64>; 3] = Default::default();
    for row in entities {
        lists[0].extend(of(&row.used));
        lists[1].extend(of(&row.repaired));
        lists[2].extend(of(&row.refused));
    }
    let [used, repaired, mut lost] = lists;
    lost.extend(refused);
    let kind = |id: u64| String::from_utf8_lossy(exchange.keyword(id)).to_uppercase();
    let mut rows: BTreeMap<String, Tally> = BTreeMap::new();
    for &id in origins.iter().chain(&lost).filter(|id| **id != 0) {
        rows.entry(kind(id)).or_default();
    }
    let number = |id: u64| usize::try_from(id).unwrap_or(usize::MAX);
    for id in exchange.ids() {
        let Some(row) = rows.get_mut(&kind(id)) else {
            continue;
        };
        row.count += 1;
        let is_used = used.contains(&id) && !lost.contains(&id);
        row.used.extend(is_used.then(|| number(id)));
        let is_repaired = is_used && repaired.contains(&id);
        row.repaired.extend(is_repaired.then(|| number(id)));
        row.refused.extend(lost.contains(&id).then(|| number(id)));
    }
    rows.retain(|kind, row| is_shape(kind) || !row.refused.is_empty());
    let named = |(kind, row): (String, Tally)| Tally {
        kind,
        mark: "#",
        ..row
    };
    rows.into_iter().map(named).collect()
}

/// Whether instances of a type have a shape, and do not only say where or how it is shown.
fn is_shape(kind: &str) -> bool {
    let others = [
        "PRODUCT",
        "COLOUR",
        "DRAUGHTING",
        "MAPPED_ITEM",
        "REPRESENTATION",
        "OCCURRENCE",
        "RELATIONSHIP",
    ];
    !others
        .iter()
        .any(|word| kind.starts_with(word) || kind.ends_with(word))
}
