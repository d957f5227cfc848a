//! The names of the entity types, and what becomes of those that are not read.

/// What an entity type is to a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    /// Used where other entities point to it.
    Helper,
    /// Read and shown.
    Shown,
    /// Has an area, and is not read yet.
    Missing,
    /// Annotation, properties, views.
    Annotation,
}

use Class::{Annotation, Helper, Missing, Shown};

/// The type of meshes in drafts; the directory of a file has no room for so large a number.
pub(super) const MESH: i64 = 1_000_000_000;

/// Type number, name, class; in the order of the numbers.
const TYPES: &[(i64, &str, Class)] = &[
    (0, "null entity", Helper),
    (100, "circular arc", Shown),
    (102, "composite curve", Shown),
    (104, "conic arc", Shown),
    (106, "copious data", Shown),
    (108, "plane", Shown),
    (110, "line", Shown),
    (112, "parametric spline curve", Shown),
    (114, "parametric spline surface", Shown),
    (116, "point", Shown),
    (118, "ruled surface", Shown),
    (120, "surface of revolution", Shown),
    (122, "tabulated cylinder", Shown),
    (123, "direction", Helper),
    (124, "transformation", Helper),
    (125, "flash", Missing),
    (126, "curve", Shown),
    (128, "surface", Shown),
    (130, "offset curve", Shown),
    (132, "connect point", Annotation),
    (134, "finite element node", Annotation),
    (136, "finite element", Missing),
    (138, "nodal displacement", Annotation),
    (140, "offset surface", Shown),
    (141, "boundary", Helper),
    (142, "curve on a surface", Shown),
    (143, "bounded surface", Shown),
    (144, "trimmed surface", Shown),
    (146, "nodal results", Annotation),
    (148, "element results", Annotation),
    (150, "block", Shown),
    (152, "wedge", Shown),
    (154, "cylinder", Shown),
    (156, "cone frustum", Shown),
    (158, "sphere", Shown),
    (160, "torus", Shown),
    (162, "solid of revolution", Shown),
    (164, "solid of extrusion", Shown),
    (168, "ellipsoid", Shown),
    (180, "boolean tree", Shown),
    (182, "selected component", Missing),
    (184, "solid assembly", Shown),
    (186, "solid", Shown),
    (190, "plane surface", Shown),
    (192, "cylindrical surface", Shown),
    (194, "conical surface", Shown),
    (196, "spherical surface", Shown),
    (198, "toroidal surface", Shown),
    (202, "angular dimension", Annotation),
    (206, "diameter dimension", Annotation),
    (210, "general label", Annotation),
    (212, "note", Annotation),
    (214, "leader", Annotation),
    (216, "linear dimension", Annotation),
    (218, "ordinate dimension", Annotation),
    (220, "point dimension", Annotation),
    (222, "radius dimension", Annotation),
    (228, "symbol", Annotation),
    (230, "sectioned area", Annotation),
    (304, "line font", Annotation),
    (308, "subfigure definition", Helper),
    (314, "colour", Helper),
    (320, "network subfigure definition", Helper),
    (402, "group", Shown),
    (404, "drawing", Annotation),
    (406, "property", Annotation),
    (408, "subfigure instance", Shown),
    (410, "view", Annotation),
    (412, "rectangular array", Shown),
    (414, "circular array", Shown),
    (416, "external reference", Missing),
    (420, "network subfigure instance", Shown),
    (430, "solid instance", Shown),
    (502, "vertex list", Helper),
    (504, "edge list", Helper),
    (508, "loop", Helper),
    (510, "face", Shown),
    (514, "shell", Shown),
    (MESH, "mesh", Shown),
];

/// The row of a type number.
fn row(kind: i64) -> Option<&'static (i64, &'static str, Class)> {
    let index = TYPES.binary_search_by_key(&kind, |row| row.0).ok()?;
    TYPES.get(index)
}

/// The name of a type.
pub(super) fn noun(kind: i64) -> &'static str {
    row(kind).map_or("entity", |row| row.1)
}

/// What a type is to a picture. Numbers without a row are annotation where the standard has
/// only annotation; of others nothing is known.
pub(super) fn class(kind: i64) -> Class {
    match (row(kind), kind) {
        (Some(row), _) => row.2,
        (None, 200..=499) => Annotation,
        (None, _) => Missing,
    }
}

/// Whether it is a curve that may stand for itself; copious data also draws annotation.
pub(super) fn is_curve(kind: i64, form: i64) -> bool {
    match kind {
        106 => matches!(form, 11..=13 | 63),
        110 => form == 0,
        kind => matches!(kind, 100 | 102 | 104 | 112 | 126 | 130 | 142),
    }
}

/// Whether it is a curve or are points that may stand for themselves.
pub(super) fn is_free_form(kind: i64, form: i64) -> bool {
    kind == 116 || kind == 106 && matches!(form, 1..=3) || is_curve(kind, form)
}

/// Whether it is a curve or point, which need not be shown for the sake of others.
pub(super) fn is_wire(kind: i64) -> bool {
    matches!(kind, 100..=106 | 110 | 112 | 116 | 126 | 130 | 142)
}

/// Whether this form of a group is a plain list of members.
pub(super) fn is_group(kind: i64, form: i64) -> bool {
    kind == 402 && matches!(form, 1 | 7 | 14 | 15)
}

/// Whether it shows only what its members are.
pub(super) fn is_composed(kind: i64) -> bool {
    matches!(
        kind,
        180 | 184 | 186 | 308 | 320 | 402 | 408 | 412 | 414 | 420 | 430 | 514
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_in_order() {
        assert!(TYPES.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert_eq!(noun(128), "surface");
        assert_eq!((noun(9999), class(9999)), ("entity", Missing));
        assert_eq!(class(212), Annotation);
    }
}
