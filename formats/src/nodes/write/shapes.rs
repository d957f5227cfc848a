//! Surfaces with their trims, and meshes.

use glam::{DVec2, DVec3, DVec4};
use kernel::{Curve, Mesh, Patch, Surface, WireShape, oriented};

use super::Dialect;
use super::look::srgb;
use super::spell::{Out, Value};
use super::tree::Tree;
use crate::write::has_weights;

impl Tree<'_> {
    /// A surface, and its type.
    pub(super) fn patch(&self, patch: &Patch) -> (&'static str, Out) {
        let is_trimmed = !patch.loops.is_empty();
        let kind = match (self.dialect, is_trimmed) {
            (Dialect::Vrml97, false) => "NurbsSurface",
            (Dialect::Vrml97, true) => "TrimmedSurface",
            (_, false) => "NurbsPatchSurface",
            (_, true) => "NurbsTrimmedSurface",
        };
        let mut out = Out::new(kind);
        if kind == "TrimmedSurface" {
            let mut surface = Out::new("NurbsSurface");
            self.net(&mut surface, patch);
            out.child("surface", surface);
        } else {
            self.net(&mut out, patch);
        }
        for trim in oriented(&patch.loops, patch.surface.periods()) {
            let mut contour = Out::new("Contour2D");
            for segment in trim.segments() {
                contour.child("children", curve(segment));
            }
            out.child("trimmingContour", contour);
        }
        (kind, out)
    }

    /// Adds the fields of a surface.
    fn net(&self, out: &mut Out, patch: &Patch) {
        let surface = &patch.surface;
        out.field("solid", Value::Flag(false));
        let order = knots(out, surface);
        if has_weights(surface.weights()) {
            let weights: Vec<_> = order.iter().map(|h| h.w).collect();
            out.field("weight", Value::list(&weights, 1));
        }
        let points: Vec<_> = order.iter().flat_map(|h| h.truncate().to_array()).collect();
        let points = Value::list(&points, 3);
        match self.dialect {
            Dialect::Vrml97 => out.field("controlPoint", points),
            Dialect::Xml | Dialect::Classic => {
                let mut coordinates = Out::new("CoordinateDouble");
                coordinates.field("point", points);
                out.child("controlPoint", coordinates);
            }
        }
        if let Some(texture) = &patch.texture {
            out.child("texCoord", self.texture_surface(texture));
        }
    }

    /// A curve or points that stand for themselves.
    pub(super) fn wire(&self, wire: &WireShape) -> Out {
        let points = |numbers: &[f64], kind| {
            let mut out = Out::new(kind);
            out.field("point", Value::list(numbers, 3));
            out
        };
        match wire {
            WireShape::Points(list) => {
                let numbers: Vec<_> = list.iter().flat_map(|p| p.to_array()).collect();
                let mut out = Out::new("PointSet");
                out.child("coord", points(&numbers, "Coordinate"));
                out
            }
            WireShape::Curve(curve) => {
                let mut out = Out::new("NurbsCurve");
                let knots = curve.knots();
                out.field("order", Value::number(knots.degree() as f64 + 1.0));
                out.field("knot", Value::list(knots.as_slice(), 1));
                if has_weights(curve.weights()) {
                    let weights: Vec<_> = curve.weights().collect();
                    out.field("weight", Value::list(&weights, 1));
                }
                let net = curve.homogeneous().iter();
                let numbers: Vec<_> = net.flat_map(|h| h.truncate().to_array()).collect();
                match self.dialect {
                    Dialect::Vrml97 => out.field("controlPoint", Value::list(&numbers, 3)),
                    _ => out.child("controlPoint", points(&numbers, "CoordinateDouble")),
                }
                out
            }
        }
    }

    /// Triangles, and the type of their node; colours of vertices are multiplied by `tint`.
    pub(super) fn mesh(&self, mesh: &Mesh, tint: DVec3) -> (&'static str, Out) {
        let (kind, indices) = match self.dialect {
            Dialect::Vrml97 => ("IndexedFaceSet", "coordIndex"),
            Dialect::Xml | Dialect::Classic => ("IndexedTriangleSet", "index"),
        };
        let mut out = Out::new(kind);
        out.field("solid", Value::Flag(false));
        if mesh.normals().is_empty() && self.dialect != Dialect::Vrml97 {
            // Without it triangles that share points are smooth.
            out.field("normalPerVertex", Value::Flag(false));
        }
        let end = match self.dialect {
            Dialect::Vrml97 => Some(-1),
            Dialect::Xml | Dialect::Classic => None,
        };
        let corners = |t: &[u32; 3]| t.map(i64::from).into_iter().chain(end);
        let triangles = mesh.triangles().iter();
        out.field(indices, Value::indices(triangles.flat_map(corners)));
        let lists = [
            ("coord", "Coordinate", "point", mesh.positions()),
            ("normal", "Normal", "vector", mesh.normals()),
        ];
        for (field, kind, name, list) in lists.into_iter().filter(|(.., list)| !list.is_empty()) {
            let numbers: Vec<_> = list.iter().flat_map(|p| p.to_array()).collect();
            let mut inside = Out::new(kind);
            inside.field(name, Value::list(&numbers, 3));
            out.child(field, inside);
        }
        if !mesh.uvs().is_empty() {
            let numbers: Vec<_> = mesh.uvs().iter().flat_map(|uv| uv.to_array()).collect();
            let mut inside = Out::new("TextureCoordinate");
            inside.field("point", Value::list(&numbers, 2));
            out.child("texCoord", inside);
        }
        if !mesh.colors().is_empty() {
            let opaque = mesh.colors().iter().all(|c| c.w >= 1.0);
            let width = if opaque || self.dialect == Dialect::Vrml97 {
                3
            } else {
                4
            };
            let color = |c: &DVec4| {
                let [r, g, b] = srgb(c.truncate() * tint);
                [r, g, b, c.w].into_iter().take(width)
            };
            let numbers: Vec<_> = mesh.colors().iter().flat_map(color).collect();
            let mut inside = Out::new(if width == 3 { "Color" } else { "ColorRGBA" });
            inside.field("color", Value::list(&numbers, width));
            out.child("color", inside);
        }
        (kind, out)
    }
}

/// Adds the dimensions, orders and knots of a surface; the result is its homogeneous control
/// points in the order of files, which have u running fastest.
pub(super) fn knots(out: &mut Out, surface: &Surface) -> Vec<DVec4> {
    let (u, v) = (surface.knots_u(), surface.knots_v());
    for (names, knots) in [
        (["uDimension", "uOrder", "uKnot"], u),
        (["vDimension", "vOrder", "vKnot"], v),
    ] {
        out.field(names[0], Value::number(knots.count() as f64));
        out.field(names[1], Value::number(knots.degree() as f64 + 1.0));
        out.field(names[2], Value::list(knots.as_slice(), 1));
    }
    let net = surface.homogeneous();
    let order = (0..v.count()).flat_map(|j| net.iter().skip(j).step_by(v.count()));
    order.copied().collect()
}

/// A curve of the parameter domain.
fn curve(segment: &Curve<DVec2>) -> Out {
    let mut out = Out::new("NurbsCurve2D");
    let knots = segment.knots();
    out.field("order", Value::number(knots.degree() as f64 + 1.0));
    out.field("knot", Value::list(knots.as_slice(), 1));
    let points: Vec<_> = segment
        .homogeneous()
        .iter()
        .flat_map(|h| [h.x, h.y])
        .collect();
    out.field("controlPoint", Value::list(&points, 2));
    if has_weights(segment.weights()) {
        let weights: Vec<_> = segment.weights().collect();
        out.field("weight", Value::list(&weights, 1));
    }
    out
}
