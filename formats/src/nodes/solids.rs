//! Boxes, spheres, cones, cylinders and flat figures as exact surfaces.
//!
//! Seams are at the back, where textures of these nodes begin, and normals point outwards.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec2, DVec3};
use kernel::modelling::{Frame, plane, revolve, ruled, sphere};
use kernel::{Curve, Error as GeometryError, Patch, Surface};

use super::Node;
use super::scene::Converter;

impl Converter<'_> {
    /// The faces of a solid or a flat figure.
    pub(super) fn solid(&mut self, node: &Node) -> Result<Vec<Patch>, GeometryError> {
        let mut number = |field, default| {
            let found = node.number(field, default, &mut self.warnings);
            self.positive(node, field, [found])[0]
        };
        let surfaces = match &*node.kind {
            "ArcClose2D" => self.closed_arc(node).map(|s| vec![s]),
            "Box" => {
                let size = node.vector("size", DVec3::splat(2.0), &mut self.warnings);
                cuboid(self.positive(node, "size", size.to_array()).into())
            }
            "Sphere" => {
                let frame = Frame::new(DVec3::ZERO, DVec3::Y, DVec3::NEG_Z)?;
                let radius = number("radius", 1.0);
                sphere(&frame, radius, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2).map(|s| vec![s])
            }
            "Cone" => {
                let (radius, half) = (number("bottomRadius", 1.0), number("height", 2.0) * 0.5);
                let [apex, rim, center] =
                    [(0.0, half), (radius, -half), (0.0, -half)].map(DVec2::from);
                let faces = [("side", apex, rim), ("bottom", rim, center)];
                self.turned(node, &faces)
            }
            "Cylinder" => {
                let (radius, half) = (number("radius", 1.0), number("height", 2.0) * 0.5);
                let [top, bottom] = [half, -half].map(|y| DVec2::new(radius, y));
                let faces = [
                    ("side", top, bottom),
                    ("top", DVec2::Y * half, top),
                    ("bottom", bottom, DVec2::Y * -half),
                ];
                self.turned(node, &faces)
            }
            "Disk2D" => {
                let [inner, outer] = [("innerRadius", 0.0), ("outerRadius", 1.0)]
                    .map(|(field, default)| number(field, default));
                if inner > outer {
                    let text = "innerRadius is larger than outerRadius; they are taken the other way round";
                    self.warnings.invalid(node.place(), text);
                }
                let [from, to] = [inner.min(outer), inner.max(outer)].map(|x| DVec3::X * x);
                let ring = Curve::line(from, to, 0.0..1.0)?;
                revolve(&ring, DVec3::ZERO, DVec3::Z, 0.0..TAU).map(|s| vec![s])
            }
            _ => {
                let size = node.tuple("size", &mut self.warnings);
                let [x, y] = self.positive(node, "size", size.unwrap_or([2.0, 2.0]));
                let corner = DVec3::new(-x, -y, 0.0) * 0.5;
                plane(corner, DVec3::X * x, DVec3::Y * y, 0.0..1.0, 0.0..1.0).map(|s| vec![s])
            }
        };
        let mut patches: Vec<_> = surfaces?.into_iter().map(Patch::from).collect();
        if self.is_pictured {
            for patch in &mut patches {
                self.cover(&node.kind, patch)?;
            }
        }
        Ok(patches)
    }

    /// Lengths in a field without their signs, which they should not have.
    fn positive<const N: usize>(&mut self, node: &Node, field: &str, found: [f64; N]) -> [f64; N] {
        if let Some(negative) = found.iter().find(|length| **length < 0.0) {
            let text = format!("{negative}; it must not be negative, and counts without its sign");
            self.warnings.invalid(node.field_place(field), text);
        }
        found.map(f64::abs)
    }

    /// What lies between an arc and its centre, or its chord.
    fn closed_arc(&mut self, node: &Node) -> Result<Surface, GeometryError> {
        let arc = self.arc(node)?;
        let ends = [arc.start(), arc.end()];
        let radius = ends[0].length();
        let has_chord = match &*node.string("closureType") {
            "" | "PIE" => false,
            "CHORD" => true,
            other => {
                let text = format!("closureType '{other}' is neither PIE nor CHORD; taken for PIE");
                self.warnings.invalid(node.place(), text);
                false
            }
        };
        // A whole turn has neither.
        let is_whole = ends[0].distance(ends[1]) <= 1e-9 * radius && arc.points().count() > 3;
        let [from, to] = if has_chord && !is_whole {
            ends
        } else {
            [DVec3::ZERO; 2]
        };
        ruled(&arc, &Curve::line(from, to, 0.0..1.0)?)
    }

    /// What lines between points (distance from the y axis, height) make in turning around
    /// that axis, for each field that is not false.
    fn turned(
        &mut self,
        node: &Node,
        faces: &[(&str, DVec2, DVec2)],
    ) -> Result<Vec<Surface>, GeometryError> {
        let mut surfaces = Vec::new();
        for &(field, from, to) in faces {
            if node.flag(field, true, &mut self.warnings) {
                let [from, to] = [from, to].map(|p: DVec2| DVec3::new(0.0, p.y, -p.x));
                let line = Curve::line(from, to, 0.0..1.0)?;
                surfaces.push(revolve(&line, DVec3::ZERO, DVec3::Y, 0.0..TAU)?);
            }
        }
        Ok(surfaces)
    }
}

/// The six faces of a box around the origin.
fn cuboid(size: DVec3) -> Result<Vec<Surface>, GeometryError> {
    let (x, y, z) = (DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z);
    let low = size * -0.5;
    let faces = [
        (low + z, x, y),
        (low + x, -x, y),
        (low, z, y),
        (low + x + z, -z, y),
        (low + y + z, x, -z),
        (low, x, z),
    ];
    let face = |&(corner, u, v): &(DVec3, DVec3, DVec3)| plane(corner, u, v, 0.0..1.0, 0.0..1.0);
    faces.iter().map(face).collect()
}

/// The rectangle around points of the plane, and the points in its own coordinates from 0
/// to 1; `None` if it has no area.
pub(super) fn in_frame(points: &[DVec2]) -> Option<(DVec2, DVec2, Vec<DVec2>)> {
    let low = points.iter().copied().reduce(DVec2::min)?;
    let size = points.iter().copied().reduce(DVec2::max)? - low;
    (size.cmpgt(DVec2::ZERO).all()).then(|| {
        (
            low,
            size,
            points.iter().map(|&p| (p - low) / size).collect(),
        )
    })
}
