//! The plane in which a face is triangulated: its parameters, stretched so that sides that use as much of the limits
//! are equally long in all directions.

use glam::DVec2;

use super::super::Limits;
use super::super::pieces::Rect;
use super::super::rim::Face;
use super::super::seed::{bends, steps, turns};

/// Steps along a side without curvature, squared.
const PLAIN: f64 = 16.0;

/// Parts along which lines around an axis are stretched alike.
const PARTS: usize = 64;

/// At least so many steps lead around an axis, however near it is.
const AROUND: f64 = 3.0;

/// Rows of triangles with equal sides are as far apart as this part of a side.
const ROWS: f64 = 0.866;

/// How far lines across the plane lean: four corners of a rectangle have no circle then, and no one need find out
/// with hundreds of digits on which side of it they are.
const LEAN: f64 = 1e-6;

/// The plane of a face.
pub(super) struct Plane {
    min: DVec2,
    /// Factors for parameters.
    scale: DVec2,
    /// Where lines across it are that do not lean: borders and creases of the surface.
    upright: Vec<f64>,
    /// Where a surface that turns about an axis has lines of very different length around it.
    stretch: Option<Stretch>,
}

/// What an axis of parameters is stretched by from one part of it to the next.
struct Stretch {
    axis: usize,
    /// How many parts there are in a unit of the parameter.
    density: f64,
    factors: [f64; PARTS],
    /// Stretched lengths up to the start of each part.
    sums: [f64; PARTS],
}

impl Plane {
    /// That of a face whose parameters lie in a rectangle.
    pub(super) fn new(face: &Face<'_>, bounds: &Rect, limits: &Limits<'_>) -> Self {
        let mut plane = Self {
            min: bounds.min,
            scale: scale(face, bounds, limits),
            upright: Vec::new(),
            stretch: None,
        };
        let size = bounds.size();
        if let Some(round) = &face.pieces.round
            && size.min_element() > 0.0
        {
            let (stretch, length) = Stretch::new(face, round.around(), bounds, limits);
            let mut extent = size;
            extent[stretch.axis] = length;
            plane.scale = DVec2::splat(extent.max_element().recip());
            plane.stretch = Some(stretch);
        }
        let inside = bounds.min.x..bounds.max.x;
        let creases = face.pieces.creases[0].iter();
        let creases = creases.copied().filter(|u| inside.contains(u));
        let lines = [bounds.min.x].into_iter().chain(creases);
        plane.upright = lines
            .chain([bounds.max.x])
            .map(|u| plane.unleaned(DVec2::new(u, bounds.min.y)).x)
            .collect();
        plane
    }

    /// Where parameters are in it.
    pub(super) fn place(&self, uv: DVec2) -> DVec2 {
        let mut p = self.unleaned(uv);
        let next = self.upright.partition_point(|&line| line <= p.x);
        if 0 < next && next < self.upright.len() {
            // Nothing on a line that has to stay as straight as it is.
            let beside = [p.x - self.upright[next - 1], self.upright[next] - p.x];
            p.x += LEAN * p.y * (beside[0] * beside[1]);
        }
        p
    }

    /// The same before lines lean: straight lines of parameters are straight here, unless it is stretched.
    pub(super) fn unleaned(&self, uv: DVec2) -> DVec2 {
        let mut p = uv - self.min;
        if let Some(stretch) = &self.stretch {
            p[stretch.axis] = stretch.place(p[stretch.axis]);
        }
        p * self.scale
    }

    /// What steps from a place of the parameters on are multiplied with.
    pub(super) fn factors(&self, uv: DVec2) -> DVec2 {
        let mut factors = self.scale;
        if let Some(stretch) = &self.stretch {
            let part = stretch.part(uv[stretch.axis] - self.min[stretch.axis]);
            factors[stretch.axis] *= stretch.factors[part];
        }
        factors
    }
}

impl Stretch {
    /// That of the parameter along the axis of a surface, and the stretched length of all of it.
    fn new(face: &Face<'_>, around: usize, bounds: &Rect, limits: &Limits<'_>) -> (Self, f64) {
        let axis = 1 - around;
        let size = bounds.size();
        let mut uv = bounds.min.midpoint(bounds.max);
        let factors = std::array::from_fn(|part| {
            uv[axis] = bounds.min[axis] + size[axis] * (part as f64 + 0.5) / PARTS as f64;
            let step = steps(face, uv, limits, size);
            ROWS * step[around].min(size[around] / AROUND) / step[axis]
        });
        let width = size[axis] / PARTS as f64;
        let mut length = 0.0;
        let sums = factors.map(|factor: f64| {
            let start = length;
            length += factor * width;
            start
        });
        let density = width.recip();
        let stretch = Self {
            axis,
            density,
            factors,
            sums,
        };
        (stretch, length)
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "what is below zero is the first part"
    )]
    fn part(&self, from_start: f64) -> usize {
        ((from_start * self.density) as usize).min(PARTS - 1)
    }

    fn place(&self, from_start: f64) -> f64 {
        let part = self.part(from_start);
        let rest = from_start - part as f64 / self.density;
        self.sums[part] + self.factors[part] * rest
    }
}

/// Factors that make steps that use as much of the limits equally long in both directions, over a
/// rectangle; directions without curvature count by their length.
fn scale(face: &Face<'_>, bounds: &Rect, limits: &Limits<'_>) -> DVec2 {
    let (mut bend, mut turn, mut length) = (DVec2::ZERO, DVec2::ZERO, DVec2::ZERO);
    for i in 0..3 {
        for j in 0..3 {
            let share = DVec2::new(f64::from(i), f64::from(j)) * 0.4 + 0.1;
            let uv = bounds.min + bounds.size() * share;
            let d = face.pieces.surface.derivatives(uv);
            let turns = turns(&d) / limits.angle;
            let bends = bends(face, &d);
            bend += DVec2::new(bends.x, bends.z);
            // Steps shorter than the tolerance may turn by any angle.
            let most = DVec2::new(d.du.length(), d.dv.length()) / face.tolerance;
            let turns = turns.min(most);
            turn += turns * turns;
            length += DVec2::new(d.du.length_squared(), d.dv.length_squared());
        }
    }
    let size = bounds.size();
    let extent = (length / 9.0 * size * size).max_element();
    // The squares of steps per unit, by what asks for most of them.
    let steps = (bend / (8.0 * face.tolerance)).max(turn);
    let mean = (steps / 9.0 + length / 9.0 * (PLAIN / extent)).sqrt();
    // The larger side becomes one, the smaller one not too short to compute with.
    let sides = mean * size / (mean * size).max_element();
    let sides = if sides.is_finite() { sides } else { DVec2::ONE };
    sides.max(DVec2::splat(1e-6)) / size.max(DVec2::splat(1e-12 * size.max_element()))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use kernel::Patch;
    use kernel::modelling::{self, Frame};

    use super::super::super::room::Room;
    use super::*;
    use crate::random::Random;

    #[test]
    fn lines_lean_but_for_the_first_and_the_last_and_none_bends_that_runs_across() {
        let frame = &Frame::WORLD;
        let cylinder = modelling::cylinder(frame, 1.0, 0.0..TAU, 0.0..3.0).unwrap();
        let sphere = modelling::sphere(frame, 1.0, 0.0..TAU, -1.0..1.0).unwrap();
        let limits = Limits {
            angle: 0.2,
            max_edge: f64::INFINITY,
            room: &Room::new(1000),
        };
        let mut random = Random(9);
        for patch in [cylinder, sphere].map(Patch::from) {
            let face = Face::new(&patch, 1e-3);
            let bounds = face.pieces.domain();
            let plane = Plane::new(&face, &bounds, &limits);
            let at = |share: DVec2| plane.place(bounds.min + bounds.size() * share);
            for _ in 0..100 {
                let [a, b] = [random.vector(), random.vector()].map(|r| r.truncate().abs());
                // Exactly, so that what lies on a line is known to lie on it.
                let across = at(DVec2::new(b.x, a.y));
                assert!((at(a).y - across.y).abs() <= 0.0);
                for end in [0.0, 1.0] {
                    let [one, other] = [a, b].map(|share| at(DVec2::new(end, share.y)));
                    assert!((one.x - other.x).abs() <= 0.0);
                }
                let corners = [a, DVec2::new(b.x, a.y), b, DVec2::new(a.x, b.y)].map(at);
                // Diagonals of a rectangle are equally long.
                let [p, q, r, s] = corners;
                let (one, other) = (p.distance(r), q.distance(s));
                assert!((one - other).abs() < 1e-6 * one);
                let size = (p - q).abs().max((q - r).abs());
                if size.min_element() > 0.01 {
                    assert!((one - other).abs() > 1e-12 * one, "{corners:?}");
                }
            }
        }
    }
}
