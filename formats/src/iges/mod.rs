//! IGES, in its fixed form of 80-column cards and in its compressed form.
//!
//! `records` finds the cards, `directory` the entities (`compressed` those of the compressed
//! form), `parameters` their numbers. `curves`
//! (with `conic`) and `sheets` (with `net`, `quadric` and `offset`) make curves and surfaces of
//! them, `boundary` finds what bounds a face and `trims` makes trim loops of it. `blanks` says
//! what is hidden, `tree` makes the scene, `levels` its layers, and `leftovers` tells what is not
//! in it. `astray` mends edges that are off their surfaces. `draft` lets other formats make entities, and meshes,
//! which IGES does not have. Entities are found by the positions of their cards, not by the counts that go with
//! them, because programs write the former right and the latter not always.

use crate::{Error, Format, Import, Place, Problem, ReadOptions, Warnings};

mod astray;
#[cfg(test)]
mod blank_tests;
mod blanks;
#[cfg(test)]
mod boolean_tests;
mod boundary;
mod compressed;
mod conic;
mod copies;
mod curves;
mod directory;
mod draft;
mod entities;
#[cfg(test)]
mod face_tests;
mod global;
#[cfg(test)]
mod hostile_tests;
mod leftovers;
mod levels;
mod links;
mod net;
#[cfg(test)]
mod odd_tests;
mod offset;
mod order;
mod parameters;
#[cfg(test)]
mod placed_tests;
mod primitives;
mod quadric;
mod records;
mod ruled;
mod sheets;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod transform;
mod tree;
mod trims;
mod types;
mod write;

pub(crate) use draft::{Draft, Fields, Look, surface};
pub(crate) use net::Net;
pub(crate) use write::WRITER;

/// The row of this format.
pub(crate) const FORMAT: Format = Format {
    name: "IGES",
    extensions: &["igs", "iges"],
    sniff: records::looks_like_iges,
    read,
};

/// An error of this format.
fn error(place: Place, problem: Problem) -> Error {
    Error {
        format: FORMAT.name,
        place,
        problem,
    }
}

fn read(bytes: &[u8], options: &ReadOptions<'_>) -> Result<Import, Error> {
    if records::is_binary(bytes) {
        let text = "the binary form of IGES is not read; save the file in fixed form";
        let problem = Problem::Unsupported(text.to_owned());
        return Err(error(Place::line(1), problem));
    }
    let sections = records::sections(bytes);
    if sections.directory.is_empty() && sections.data.is_empty() {
        let text = "no entities: IGES files have a directory of them, with a D in column 73";
        return Err(error(Place::default(), Problem::Invalid(text.to_owned())));
    }
    let (cards, limit) = (sections.directory.len(), options.limits.entities);
    if cards / 2 > limit {
        let text = format!("{} entities; the limit is {limit}", cards / 2);
        return Err(error(Place::default(), Problem::TooLarge(text)));
    }
    let mut warnings = Warnings::default();
    if let Some((line, count)) = sections.stray {
        let text = match count {
            1 => "a line without a section letter is skipped".to_owned(),
            _ => format!("{count} lines without a section letter are skipped"),
        };
        warnings.invalid(Place::line(line), text);
    }
    if !sections.terminated {
        let text = "the terminating line is missing; the file may be cut short";
        warnings.invalid(Place::default(), text);
    }
    let mut problems = Vec::new();
    let global = global::read(&sections.global, &mut problems);
    for problem in problems {
        warnings.add(Place::item(0, "the global section"), problem);
    }
    let (entries, parameters) = if sections.data.is_empty() {
        let entries = directory::entries(&sections.directory, |place| {
            let text = "one of the two lines of a directory entry is missing; it is skipped";
            warnings.invalid(place, text);
        });
        (entries, sections.parameters)
    } else {
        let end = global.delimiters.record;
        let entities = compressed::entities(&sections.data, end, limit, |place| {
            let text = "a directory field is not written as in @1_128; it is skipped";
            warnings.invalid(place, text);
        });
        entities.map_err(|problem| error(Place::default(), problem))?
    };
    let mut file = directory::File::new(global, entries, parameters);
    if let Some(first) = blanks::settle(&mut file) {
        let text = "all that could be shown is blanked; it is shown";
        warnings.invalid(file.place(first), text);
    }
    tree::read(&file, options.limits, warnings)
}
