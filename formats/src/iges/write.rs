//! From scene to IGES 5.3, in its fixed form.
//!
//! Faces become trimmed surfaces (144, or 128 where nothing is cut away) with the curves of
//! the parameter domain as their master, nodes become groups (402) and subfigures (308, 408);
//! curves and points (126, 116) stand for themselves.
//! The standard lets instances turn, mirror, scale and move; what nodes do besides is done to
//! control points. Every number is written with the digits that give it back.

mod cards;
mod cubic;
mod geometry;
mod model;
mod pace;
mod pieces;
mod sew;
mod tree;

use kernel::{Scene, UpAxis};

use self::cards::Record;
use self::tree::Tree;
use super::{error, global};
use crate::write::{Export, Writer, tell_seams, turn};
use crate::{Error, Place, Problem};

/// The row of this format.
pub(crate) const WRITER: Writer = Writer {
    name: "IGES",
    extensions: &["igs", "iges"],
    write,
};

/// Smallest distance that counts, as a share of the size, before it is rounded down to a power
/// of ten.
const RESOLUTION: f64 = 1e-7;

/// A moment that is always the same, so that the bytes are, too.
const DATE: &str = "19700101.000000";

fn write(scene: &Scene, stem: &str) -> Result<Export, Error> {
    let mut tree = Tree::new(scene);
    tell_seams(scene, &mut tree.warnings);
    let what = [
        (scene.cameras.len(), "cameras"),
        (scene.lights.len(), "lights"),
        (usize::from(scene.background.is_some()), "the background"),
    ];
    for (_, what) in what.into_iter().filter(|(count, _)| *count > 0) {
        let text = "IGES files hold no cameras, lights and backgrounds; they are left out";
        tree.warnings.unsupported(Place::item(0, what), text);
    }
    let (flag, name, scale) = match &scene.unit {
        Some(unit) => match global::flag(unit.metres) {
            Some((flag, name)) => (flag, name, 1.0),
            None => (6, "m", unit.metres),
        },
        None => {
            let text = "IGES files need a unit of length and the scene has none; \
                millimetres are written";
            tree.warnings.unsupported(Place::item(0, "the unit"), text);
            (2, "mm", 1.0)
        }
    };
    let turned = turn(scene.up, UpAxis::Z);
    let refuse = |problem| error(Place::default(), problem);
    tree.add_all(turned * scale).map_err(refuse)?;
    if tree.deck.is_empty() && !scene.meshes().is_empty() {
        let text = "there are only triangles to write, which IGES files do not hold";
        return Err(refuse(Problem::Unsupported(text.to_owned())));
    }
    let bounds = scene.hull_bounds();
    let largest = bounds.corners().map(|corner| corner.abs().max_element());
    let largest = largest.into_iter().filter(|x| x.is_finite());
    let stated = scene.resolution.map(|length| length * scale);
    let lengths = [
        stated.unwrap_or_else(|| resolution(bounds.diagonal() * scale)),
        largest.fold(0.0, f64::max) * scale,
    ];
    let global = global_record(stem, flag, name, lengths);
    let start = format!("Written by nurbray {}", env!("CARGO_PKG_VERSION"));
    let bytes = tree.deck.into_bytes(&start, &global).map_err(refuse)?;
    Ok(Export {
        bytes,
        warnings: tree.warnings,
        ..Export::default()
    })
}

/// The global section; `lengths` are the smallest that counts and the largest coordinate.
fn global_record(stem: &str, flag: usize, unit: &str, lengths: [f64; 2]) -> Record {
    let mut record = Record::default();
    for text in [
        ",",
        ";",
        stem,
        &format!("{stem}.igs"),
        "nurbray",
        env!("CARGO_PKG_VERSION"),
    ] {
        record.text(text);
    }
    record.integers([32, 38, 6, 308, 15]);
    record.text(stem);
    record.real(1.0);
    record.integer(flag);
    record.text(&unit.to_uppercase());
    record.integer(1);
    record.real(0.1);
    record.text(DATE);
    record.reals(lengths);
    record.text("");
    record.text("");
    record.integers([11, 0]);
    record.text(DATE);
    record.text("");
    record
}

/// The resolution of a file with things of this size.
fn resolution(size: f64) -> f64 {
    let wanted = size * RESOLUTION;
    if !wanted.is_normal() {
        return RESOLUTION;
    }
    // The exponent in print is that of the power of ten below.
    let text = format!("{wanted:e}");
    let exponent = text.split_once('e').map_or("-8", |(_, exponent)| exponent);
    format!("1e{exponent}").parse().unwrap_or(RESOLUTION)
}
