//! From scene to IGES 5.3, in its fixed form.
//!
//! Faces become trimmed surfaces (144, or 128 where nothing is cut away) with the curves of
//! the parameter domain as their master, nodes become groups (402) and subfigures (308, 408).
//! The standard lets instances turn, mirror, scale and move; what nodes do besides is done to
//! control points. Every number is written with the digits that give it back.

mod cards;
mod geometry;
mod tree;

use glam::DMat3;
use kernel::{Scene, UpAxis};

use self::cards::Record;
use self::tree::Tree;
use super::{error, global};
use crate::write::{Export, Writer};
use crate::{Error, Place};

/// The row of this format.
pub(crate) const WRITER: Writer = Writer {
    name: "IGES",
    extensions: &["igs", "iges"],
    write,
};

/// Smallest distance that counts, as a share of the size, before it is rounded down to a power
/// of ten.
const RESOLUTION: f64 = 1e-8;

/// A moment that is always the same, so that the bytes are, too.
const DATE: &str = "19700101.000000";

fn write(scene: &Scene, stem: &str) -> Result<Export, Error> {
    let mut tree = Tree::new(scene);
    let what = [
        (scene.cameras.len(), "cameras"),
        (scene.lights.len(), "lights"),
        (usize::from(scene.background.is_some()), "the background"),
    ];
    for (count, what) in what {
        if count > 0 {
            let text = "IGES files hold no cameras, lights and backgrounds; they are left out";
            tree.warnings.unsupported(Place::item(0, what), text);
        }
    }
    let unit = scene.unit.as_ref();
    let known = unit.and_then(|unit| global::flag(unit.metres));
    let (flag, name) = known.unwrap_or(if unit.is_some() { (6, "m") } else { (2, "mm") });
    let scale = match unit {
        Some(unit) if known.is_none() => unit.metres,
        Some(_) => 1.0,
        None => {
            let text = "IGES files need a unit of length and the scene has none; \
                millimetres are written";
            tree.warnings.unsupported(Place::item(0, "the unit"), text);
            1.0
        }
    };
    let turned = match scene.up {
        UpAxis::Y => DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0]),
        UpAxis::Z => DMat3::IDENTITY,
    };
    let refuse = |problem| error(Place::default(), problem);
    tree.add_all(turned * scale).map_err(refuse)?;
    let bounds = scene.hull_bounds();
    let size = bounds.diagonal() * scale;
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element() * scale;
    let global = global_record(stem, (flag, name), size, largest);
    let start = format!("Written by nurbray {}", env!("CARGO_PKG_VERSION"));
    let bytes = tree.deck.into_bytes(&start, &global).map_err(refuse)?;
    Ok(Export {
        bytes,
        warnings: tree.warnings,
        ..Export::default()
    })
}

/// The global section.
fn global_record(stem: &str, (flag, unit): (i64, &str), size: f64, largest: f64) -> Record {
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
    record.integers(usize::try_from(flag));
    record.text(&unit.to_uppercase());
    record.integer(1);
    record.real(0.1);
    record.text(DATE);
    record.real(resolution(size));
    record.real(if largest.is_finite() { largest } else { 0.0 });
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
