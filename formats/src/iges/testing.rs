//! Makes IGES files for tests.

use std::fmt::Write as _;

use glam::{DVec2, DVec3};
use kernel::{Patch, Placement, Scene, Shape};

use crate::{Error, Import, Limits, NoFiles, ReadOptions};

/// An entity of a file to be made: type and form, further directory fields, parameters.
#[derive(Clone)]
pub(super) struct Made {
    /// Type number.
    pub kind: i64,
    /// Form number.
    pub form: i64,
    /// Level, or pointer to a list of levels.
    pub level: i64,
    /// Transformation pointer.
    pub transform: i64,
    /// Status number.
    pub status: &'static str,
    /// Colour number or pointer.
    pub color: i64,
    /// Label.
    pub label: &'static str,
    /// Parameters after the type number, without the record delimiter.
    pub parameters: String,
}

/// The scene and the warnings of a file of entities, known by its content.
pub(super) fn read(entities: &[Made]) -> (Scene, Vec<String>) {
    let import = read_within(&file(entities), &Limits::default()).unwrap();
    let warnings = import.warnings.as_slice().iter().map(ToString::to_string);
    (import.scene, warnings.collect())
}

/// What a file, known by its content, becomes within some limits.
pub(super) fn read_within(text: &str, limits: &Limits) -> Result<Import, Error> {
    let options = ReadOptions {
        limits,
        resolver: &NoFiles,
    };
    crate::read(text.as_bytes(), None, &options)
}

/// An entity of a type with parameters, all else being zero.
pub(super) fn made(kind: i64, parameters: &str) -> Made {
    Made {
        kind,
        form: 0,
        level: 0,
        transform: 0,
        status: "00000000",
        color: 0,
        label: "",
        parameters: parameters.to_owned(),
    }
}

/// A part of another entity.
pub(super) fn part(kind: i64, form: i64, parameters: &str) -> Made {
    let status = "00010000";
    Made {
        form,
        status,
        ..made(kind, parameters)
    }
}

/// An entity of a form.
pub(super) fn formed(kind: i64, form: i64, parameters: &str) -> Made {
    Made {
        form,
        ..made(kind, parameters)
    }
}

/// A flat square of degree 1 with its lower corner at (x, 0, 0).
pub(super) fn square(x: f64) -> Made {
    let end = x + 1.0;
    made(
        128,
        &format!(
            "1,1,1,1,0,0,1,0,0,0.,0.,1.,1.,0.,0.,1.,1.,1.,1.,1.,1.,\
             {x:?},0.,0.,{end:?},0.,0.,{x:?},1.,0.,{end:?},1.,0.,0.,1.,0.,1."
        ),
    )
}

/// Where the lower corner of a placed square lands.
fn corner(scene: &Scene, placement: &Placement) -> DVec3 {
    let Shape::Patch(id) = placement.shape else {
        panic!("a mesh")
    };
    let point = scene.patch(id).surface.evaluate(DVec2::ZERO);
    placement.world_from_object.transform_point3(point)
}

/// Where those of all placed squares land.
pub(super) fn corners(scene: &Scene) -> Vec<DVec3> {
    let placements = scene.placements();
    placements.iter().map(|p| corner(scene, p)).collect()
}

/// A file with these entities; the n-th one stands at D `2 n + 1`.
pub(super) fn file(entities: &[Made]) -> String {
    file_with("1H,,1H;,,,,,,,,,,,1.,2,2HMM;", entities)
}

/// As [`file`], with a global section.
pub(super) fn file_with(global: &str, entities: &[Made]) -> String {
    let mut text = format!("{:<72}S{:>7}\n{global:<72}G{:>7}\n", "test", 1, 1);
    let (mut directory, mut data) = (String::new(), String::new());
    let (mut d, mut p) = (0, 0);
    for entity in entities {
        let Made {
            kind,
            form,
            level,
            transform,
            status,
            color,
            label,
            ..
        } = entity;
        let record = format!("{kind},{};", entity.parameters);
        let owner = d + 1;
        let start = p + 1;
        for part in record.as_bytes().chunks(64) {
            let part = String::from_utf8_lossy(part);
            p += 1;
            let _ = writeln!(data, "{part:<64}{owner:>8}P{p:>7}");
        }
        let count = p + 1 - start;
        let zero = 0;
        let _ = writeln!(
            directory,
            "{kind:>8}{start:>8}{zero:>8}{zero:>8}{level:>8}{zero:>8}{transform:>8}{zero:>8}\
             {status}D{:>7}",
            d + 1
        );
        let _ = writeln!(
            directory,
            "{kind:>8}{zero:>8}{color:>8}{count:>8}{form:>8}{:>16}{label:>8}{:>8}D{:>7}",
            "",
            "",
            d + 2
        );
        d += 2;
    }
    text += &directory;
    text += &data;
    let end = format!("S{:>7}G{:>7}D{d:>7}P{p:>7}", 1, 1);
    let _ = writeln!(text, "{end:<72}T{:>7}", 1);
    text
}

/// Whether the point of the patch nearest to a point is that point and belongs to the face.
pub(super) fn shows(patch: &Patch, point: DVec3) -> bool {
    let closed = kernel::nearest::closed(&patch.surface);
    let nearby = kernel::nearest::Nearby::new(&patch.surface, closed);
    let found = nearby.nearest(point, None);
    let (u, v) = (
        patch.surface.knots_u().domain(),
        patch.surface.knots_v().domain(),
    );
    let wrap =
        |x: f64, d: std::ops::Range<f64>| d.start + (x - d.start).rem_euclid(d.end - d.start);
    let mut uv = found.uv;
    if closed[0] {
        uv.x = wrap(uv.x, u);
    }
    if closed[1] {
        uv.y = wrap(uv.y, v);
    }
    found.distance < 1e-6 && patch.region().is_none_or(|region| region.contains(uv))
}
