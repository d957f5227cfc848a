//! Types of nodes, by what becomes of them.

use super::wires::is_wire;

/// Nodes that show their children, or some of them.
pub(super) fn is_group(kind: &str) -> bool {
    GROUPS.contains(&kind) || TRANSFORMS.contains(&kind)
}

/// What may stand in a scene and shows something.
pub(crate) fn stands_in_scene(kind: &str) -> bool {
    kind == "Shape" || is_group(kind) && kind != "Scene"
}

/// Nodes that show their children where they are, or some of them.
const GROUPS: &[&str] = &[
    "Anchor",
    "Billboard",
    "CADAssembly",
    "CADFace",
    "CADLayer",
    "Collision",
    "CoordinateDeformer",
    "Group",
    "HAnimHumanoid",
    "HAnimSegment",
    "LOD",
    "Layer",
    "LayerSet",
    "NurbsGroup",
    "PickableGroup",
    "Scene",
    "StaticGroup",
    "Switch",
    "ViewpointGroup",
];

/// Nodes that show their children somewhere else.
pub(super) const TRANSFORMS: &[&str] = &[
    "CADPart",
    "EspduTransform",
    "HAnimJoint",
    "HAnimSite",
    "Transform",
];

/// What is read as exact surfaces.
const SURFACES: &[&str] = &[
    "ArcClose2D",
    "Box",
    "Cone",
    "Cylinder",
    "Disk2D",
    "Extrusion",
    "NurbsPatchSurface",
    "NurbsSurface",
    "NurbsSweptSurface",
    "NurbsSwungSurface",
    "NurbsTrimmedSurface",
    "Rectangle2D",
    "Sphere",
    "TrimmedSurface",
];

/// The polygons that are read.
pub(super) const MESHES: &[&str] = &[
    "ElevationGrid",
    "IndexedFaceSet",
    "IndexedQuadSet",
    "IndexedTriangleFanSet",
    "IndexedTriangleSet",
    "IndexedTriangleStripSet",
    "QuadSet",
    "TriangleFanSet",
    "TriangleSet",
    "TriangleSet2D",
    "TriangleStripSet",
];

pub(super) fn is_material(kind: &str) -> bool {
    matches!(
        kind,
        "Material" | "PhysicalMaterial" | "TwoSidedMaterial" | "UnlitMaterial"
    )
}

pub(super) fn is_geometry(kind: &str) -> bool {
    SURFACES.contains(&kind) || MESHES.contains(&kind)
}

/// Whether what shows something stands in a node that has no place for it.
pub(super) fn is_misplaced(inner: &str, outer: &str) -> bool {
    match outer {
        "Shape" => stands_in_scene(inner),
        "Appearance" => stands_in_scene(inner) || is_geometry(inner) || is_wire(inner),
        outer if is_geometry(outer) || is_wire(outer) => {
            stands_in_scene(inner) || is_geometry(inner) && outer != "TrimmedSurface"
        }
        _ => false,
    }
}

/// Nodes that show nothing by themselves.
pub(super) const SILENT: &[&str] = &[
    "Color",
    "ColorRGBA",
    "Contour2D",
    "Coordinate",
    "CoordinateDouble",
    // One of which the file could not be read, as has been said.
    "Inline",
    "InlineLoadControl",
    // These three are told about where they are used.
    "MultiTextureCoordinate",
    "MultiTextureTransform",
    "TextureCoordinateGenerator",
    "Normal",
    "NurbsTextureCoordinate",
    "NurbsTextureSurface",
    "TextureCoordinate",
    "TextureProperties",
    "TextureTransform",
    "WorldInfo",
];

/// Parts of surfaces.
const PARTS: &[&str] = &["NurbsCurve", "NurbsCurve2D", "NurbsSet", "Polyline2D"];

/// Nodes that have an area, and need no prototype: programs declare for them what other
/// viewers may lack.
fn all_known() -> impl Iterator<Item = &'static str> {
    let lists = [GROUPS, TRANSFORMS, SURFACES, MESHES, SILENT, PARTS];
    lists.into_iter().flatten().copied()
}

/// Whether a node of this name needs no prototype.
pub(super) fn is_known(kind: &str) -> bool {
    all_known().any(|known| known == kind)
}

/// The known node of a name in capitals or small letters.
pub(super) fn known(name: &str) -> Option<&'static str> {
    all_known().find(|known| known.eq_ignore_ascii_case(name))
}
