//! A surface with its trim loops: what a file calls a face.

use std::ops::Range;
use std::sync::Arc;

use glam::{DAffine2, DVec2};

use crate::trim::shifts;
use crate::{Aabb, Curve, MaterialId, Surface, TrimLoop, TrimRegion};

/// A face: a surface, the loops that trim it, and a material.
///
/// A point of the surface belongs to the face if it lies inside an odd number of loops;
/// without loops the whole surface does.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// The name in the file, or empty.
    pub name: String,
    /// Where it stands in the file, in the format's own words.
    pub source: String,
    /// The whole surface.
    pub surface: Surface,
    /// Boundaries in the parameter domain.
    pub loops: Vec<TrimLoop>,
    /// The material, unless the scene node that shows the patch names another.
    pub material: Option<MaterialId>,
    /// Texture coordinates: x and y of a surface over the same parameters. Without one they
    /// run from 0 to 1 over the domain, along u and along v. Patches alike share them.
    pub texture: Option<Arc<Surface>>,
}

impl Patch {
    /// The part of the domain that belongs to the face; `None` means all of it.
    pub fn region(&self) -> Option<TrimRegion> {
        let trimmed = !self.loops.is_empty();
        trimmed
            .then(|| TrimRegion::of(self))
            .filter(|region| !region.is_whole())
    }

    /// A box around the face: around the control points of that part of the surface where its
    /// loops are, which may be a small one.
    pub fn hull_bounds(&self) -> Aabb {
        let [u, v] = [self.surface.knots_u(), self.surface.knots_v()].map(|k| k.domain());
        let curves = self.trim_curves();
        let (mut min, mut max) = (DVec2::MAX, DVec2::MIN);
        for point in curves.iter().flat_map(Curve::points) {
            (min, max) = (min.min(point), max.max(point));
        }
        let part = self
            .surface
            .restricted_u(min.x.max(u.start)..max.x.min(u.end))
            .and_then(|part| part.restricted_v(min.y.max(v.start)..max.y.min(v.end)));
        part.as_ref().unwrap_or(&self.surface).hull_bounds()
    }

    /// Texture coordinates at parameters of the domain.
    pub fn texture_coordinates(&self, uv: DVec2) -> DVec2 {
        let domain = |s: &Surface| [s.knots_u().domain(), s.knots_v().domain()];
        match &self.texture {
            Some(texture) => {
                let [u, v] = domain(texture);
                let inside = uv.clamp(DVec2::new(u.start, v.start), DVec2::new(u.end, v.end));
                texture.evaluate(inside).truncate()
            }
            None => {
                let [u, v] = domain(&self.surface);
                let share =
                    |x: f64, along: Range<f64>| (x - along.start) / (along.end - along.start);
                DVec2::new(share(uv.x, u), share(uv.y, v))
            }
        }
    }

    /// The curves of all loops as [`Patch::region`] sees them: on a closed surface a loop
    /// stands once for each shift by whole periods that brings it into the domain. They may
    /// leave the domain.
    pub fn trim_curves(&self) -> Vec<Curve<DVec2>> {
        let [u, v] = [&self.surface.knots_u(), &self.surface.knots_v()].map(|k| k.domain());
        let domain = [DVec2::new(u.start, v.start), DVec2::new(u.end, v.end)];
        let closed = self.surface.closed();
        let mut curves = Vec::new();
        for trim in &self.loops {
            for shift in shifts(trim, domain, closed) {
                let map = DAffine2::from_translation(shift);
                curves.extend(trim.segments().iter().map(|curve| curve.transformed(&map)));
            }
        }
        curves
    }
}

impl From<Surface> for Patch {
    fn from(surface: Surface) -> Self {
        let (name, source) = (String::new(), String::new());
        Self {
            name,
            source,
            surface,
            loops: Vec::new(),
            material: None,
            texture: None,
        }
    }
}
