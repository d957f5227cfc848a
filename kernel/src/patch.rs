//! A surface with its trim loops: what a file calls a face.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use glam::{DAffine2, DAffine3, DVec2};

use crate::trim::{Rows, oriented, shifts};
use crate::{Aabb, Curve, KnotVector, MaterialId, Surface, TrimLoop, TrimRegion};

/// A surface with a weight that is so many times another one is halved before its points tell where it is.
const UNEVEN: f64 = 8.0;

/// How often it is halved, at most.
const HALVINGS: usize = 4;

/// Surfaces with more points are not halved.
const MANY: usize = 10_000;

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
    /// The same face in other coordinates.
    #[must_use]
    pub fn transformed(&self, target_from_source: &DAffine3) -> Self {
        Self {
            name: self.name.clone(),
            source: self.source.clone(),
            surface: self.surface.transformed(target_from_source),
            loops: self.loops.clone(),
            material: self.material,
            texture: self.texture.clone(),
        }
    }

    /// The part of the domain that belongs to the face; `None` means all of it.
    pub fn region(&self) -> Option<TrimRegion> {
        let trimmed = !self.loops.is_empty();
        trimmed
            .then(|| TrimRegion::of(self))
            .filter(|region| !region.is_whole())
    }

    /// Whether loops cross each other or themselves, as far as some lines across the domain show: then
    /// what is inside an odd number of them is not what outer ones and holes leave.
    pub fn has_crossing_loops(&self) -> bool {
        let loops = oriented(&self.loops, self.surface.periods());
        let knots = self.surface.knots_v().breaks();
        !Rows::new(&loops, self.domain(), self.surface.closed(), &knots).are_apart()
    }

    /// A box around the face: around the control points of that part of the surface where its
    /// loops are, which may be a small one.
    pub fn hull_bounds(&self) -> Aabb {
        self.where_loops_are().hull_bounds()
    }

    /// That part of the surface, in halves where weights are far apart: its points may be far from it then.
    pub(crate) fn where_loops_are(&self) -> Cow<'_, Surface> {
        let mut part = self.cut_to_loops();
        for _ in 0..HALVINGS {
            if !is_uneven(&part) {
                break;
            }
            let middles = |knots: &KnotVector| -> Vec<f64> {
                let breaks = knots.breaks();
                breaks
                    .windows(2)
                    .map(|span| span[0].midpoint(span[1]))
                    .collect()
            };
            let halves = part.refined_u(&middles(part.knots_u()));
            let Ok(halves) = halves.and_then(|half| half.refined_v(&middles(part.knots_v())))
            else {
                break;
            };
            part = Cow::Owned(halves);
        }
        part
    }

    fn cut_to_loops(&self) -> Cow<'_, Surface> {
        let (mut min, mut max) = (DVec2::MAX, DVec2::MIN);
        for [least, most] in self.hulls() {
            (min, max) = (min.min(least), max.max(most));
        }
        // What is clamped and all of it there is no smaller for being cut.
        let part = |knots: &KnotVector, from: f64, to: f64| {
            let whole = knots.domain();
            let range = from.max(whole.start)..to.min(whole.end);
            (range != whole || !knots.is_clamped()).then_some(range)
        };
        let own = &self.surface;
        let along_u = part(own.knots_u(), min.x, max.x);
        let part = match (along_u, part(own.knots_v(), min.y, max.y)) {
            (None, None) => return Cow::Borrowed(own),
            (Some(u), None) => own.restricted_u(u),
            (None, Some(v)) => own.restricted_v(v),
            (Some(u), Some(v)) => own.restricted_u(u).and_then(|part| part.restricted_v(v)),
        };
        part.map_or(Cow::Borrowed(own), Cow::Owned)
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
        let mut curves = Vec::new();
        for (shift, trim) in self.shifted() {
            let map = DAffine2::from_translation(shift);
            curves.extend(trim.segments().iter().map(|curve| curve.transformed(&map)));
        }
        curves
    }

    /// The boxes in which the loops are, as far as they are in the domain: the least and the greatest
    /// parameters for each loop and each shift by whole periods that brings it there.
    pub fn loop_boxes(&self) -> Vec<[DVec2; 2]> {
        let [least, most] = self.domain();
        let inside = |hull: [DVec2; 2]| hull.map(|corner| corner.clamp(least, most));
        self.hulls().map(inside).collect()
    }

    /// Boxes around the loops, where their shifts bring them.
    fn hulls(&self) -> impl Iterator<Item = [DVec2; 2]> {
        self.shifted().into_iter().map(|(shift, trim)| {
            let (min, max) = trim.hull();
            [min + shift, max + shift]
        })
    }

    /// The least and the greatest parameters.
    fn domain(&self) -> [DVec2; 2] {
        let [u, v] = [self.surface.knots_u(), self.surface.knots_v()].map(KnotVector::domain);
        [DVec2::new(u.start, v.start), DVec2::new(u.end, v.end)]
    }

    /// The loops, each with the shifts that bring it into the domain.
    pub(crate) fn shifted(&self) -> Vec<(DVec2, &TrimLoop)> {
        if self.loops.is_empty() {
            return Vec::new();
        }
        let domain = self.domain();
        let closed = self.surface.closed();
        let of = |trim| {
            shifts(trim, domain, closed)
                .into_iter()
                .map(move |s| (s, trim))
        };
        self.loops.iter().flat_map(of).collect()
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

/// Whether weights of a surface that is not large are far apart.
fn is_uneven(surface: &Surface) -> bool {
    let weights = || surface.homogeneous().iter().map(|h| h.w);
    let least = weights().fold(f64::INFINITY, f64::min);
    let most = weights().fold(0.0, f64::max);
    most > UNEVEN * least && surface.homogeneous().len() <= MANY
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::modelling;

    #[test]
    fn a_box_does_not_reach_for_points_far_from_an_arc() {
        for short in [0.1_f64, 1e-3, 1e-6] {
            // As one piece, whose middle point is about `1 / short` away.
            let knots = KnotVector::bezier(2, 0.0..1.0).unwrap();
            let [sine, cosine] = [short.cos(), short.sin()];
            let ends = [-1.0, 1.0].map(|side| DVec3::new(side * sine, cosine, 0.0));
            let points = [ends[0], DVec3::Y / cosine, ends[1]];
            let arc = Curve::new(knots, &points, Some(&[1.0, cosine, 1.0])).unwrap();
            let patch = Patch::from(modelling::extrude(&arc, DVec3::Z).unwrap());
            let bounds = patch.hull_bounds();
            assert!(bounds.min.y >= 0.0 && bounds.max.y >= 1.0, "{bounds:?}");
            assert!(bounds.max.y < 1.5, "{short}: {bounds:?}");
        }
    }
}
