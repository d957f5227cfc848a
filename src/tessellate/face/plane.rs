//! The plane in which a face is triangulated: its parameters, stretched so that sides that use as much of the limits
//! are equally long in all directions.

use glam::DVec2;

use super::super::Limits;
use super::super::pieces::{Rect, UNEVEN};
use super::super::rim::Face;
use super::seed::{bends, steps, turns};

/// Steps along a side without curvature, squared.
const PLAIN: f64 = 16.0;

/// Parts along which lines around an axis are stretched alike.
const PARTS: usize = 64;

/// Parts of a span become shorter by half towards its ends, so often at most.
const HALVES: i32 = 20;

/// Lines across at which a part is looked at, at most.
const ACROSS: usize = 24;

/// Steps are not shorter than this share of a face.
const LEAST: f64 = 1e-9;

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
    /// Where a surface that turns about an axis has lines of very different length around it, or steps are of very
    /// different length along an axis, as weights are.
    stretches: [Option<Stretch>; 2],
}

/// What an axis of parameters is stretched by from one part of it to the next.
struct Stretch {
    /// Where parts start, from the start of the first, and where the last one ends.
    ends: Vec<f64>,
    factors: Vec<f64>,
    /// Stretched lengths up to each of the ends.
    sums: Vec<f64>,
}

impl Plane {
    /// That of a face whose parameters lie in a rectangle.
    pub(super) fn new(face: &Face<'_>, bounds: &Rect, limits: &Limits<'_>) -> Self {
        let mut plane = Self {
            min: bounds.min,
            scale: scale(face, bounds, limits),
            upright: Vec::new(),
            stretches: [None, None],
        };
        let size = bounds.size();
        if size.min_element() > 0.0 {
            if let Some(round) = &face.pieces.round {
                let axis = 1 - round.around();
                plane.stretches[axis] = Some(Stretch::around(face, axis, bounds, limits));
            } else {
                let unevenness = [0, 1].map(|axis| face.pieces.unevenness(axis));
                if unevenness.iter().flatten().any(|&factor| factor > UNEVEN) {
                    plane.stretches = uneven(face, bounds, limits, &unevenness).map(Some);
                }
            }
            if plane.stretches.iter().any(Option::is_some) {
                plane.scale = DVec2::ONE;
                let extent = plane.unleaned(bounds.max);
                plane.scale = DVec2::splat(extent.max_element().recip());
            }
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
        for (axis, stretch) in self.stretches.iter().enumerate() {
            if let Some(stretch) = stretch {
                p[axis] = stretch.place(p[axis]);
            }
        }
        p * self.scale
    }

    /// How many parts of an axis between two parameters have lengths of their own in it.
    pub(super) fn parts(&self, axis: usize, from: f64, to: f64) -> usize {
        let part = |stretch: &Stretch, end: f64| stretch.part(end - self.min[axis]);
        let stretch = self.stretches[axis].as_ref();
        stretch.map_or(0, |stretch| part(stretch, to) - part(stretch, from) + 1)
    }

    /// The parameters between two places: in the middle of the plane where weights stretch it.
    pub(super) fn middle(&self, a: DVec2, b: DVec2) -> DVec2 {
        let mut middle = a.midpoint(b);
        if let [Some(u), Some(v)] = &self.stretches {
            for (axis, stretch) in [u, v].into_iter().enumerate() {
                let ends = [a[axis] - self.min[axis], b[axis] - self.min[axis]];
                // What both have stays the same to the last digit.
                if (ends[0] - ends[1]).abs() > 0.0 {
                    let [a, b] = ends.map(|end| stretch.place(end));
                    middle[axis] = self.min[axis] + stretch.back(a.midpoint(b));
                }
            }
        }
        middle
    }

    /// What steps from a place of the parameters on are multiplied with.
    pub(super) fn factors(&self, uv: DVec2) -> DVec2 {
        let mut factors = self.scale;
        for (axis, stretch) in self.stretches.iter().enumerate() {
            if let Some(stretch) = stretch {
                factors[axis] *= stretch.factors[stretch.part(uv[axis] - self.min[axis])];
            }
        }
        factors
    }

    /// The parameters at a share of a rectangle as it lies in the plane, and how many of them there are to a unit
    /// of the share.
    pub(super) fn within(&self, rect: &Rect, share: DVec2) -> (DVec2, DVec2) {
        let mut unit = rect.size();
        let mut uv = rect.min + unit * share;
        for (axis, stretch) in self.stretches.iter().enumerate() {
            if let Some(stretch) = stretch {
                let start = self.min[axis];
                let ends = [rect.min[axis], rect.max[axis]].map(|end| stretch.place(end - start));
                let length = ends[1] - ends[0];
                let from_start = stretch.back(ends[0] + length * share[axis]);
                uv[axis] = start + from_start;
                unit[axis] = length / stretch.factors[stretch.part(from_start)];
            }
        }
        (uv, unit)
    }
}

impl Stretch {
    fn new(ends: Vec<f64>, factors: Vec<f64>) -> Self {
        let mut length = 0.0;
        let parts = ends.windows(2).zip(&factors);
        let lengths = parts.map(|(ends, factor)| {
            length += factor * (ends[1] - ends[0]);
            length
        });
        Self {
            sums: [0.0].into_iter().chain(lengths).collect(),
            ends,
            factors,
        }
    }

    /// That of the parameter along the axis of a surface that turns about one.
    fn around(face: &Face<'_>, axis: usize, bounds: &Rect, limits: &Limits<'_>) -> Self {
        let around = 1 - axis;
        let size = bounds.size();
        let mut uv = bounds.min.midpoint(bounds.max);
        let ends: Vec<f64> = (0..=PARTS)
            .map(|part| size[axis] * part as f64 / PARTS as f64)
            .collect();
        let factors = ends.windows(2).map(|ends| {
            uv[axis] = bounds.min[axis] + ends[0].midpoint(ends[1]);
            let step = steps(face, uv, limits, size);
            ROWS * step[around].min(size[around] / AROUND) / step[axis]
        });
        let factors = factors.collect();
        Self::new(ends, factors)
    }

    fn part(&self, from_start: f64) -> usize {
        let inner = &self.ends[1..self.factors.len()];
        inner.partition_point(|&end| end <= from_start)
    }

    fn place(&self, from_start: f64) -> f64 {
        let part = self.part(from_start);
        self.sums[part] + self.factors[part] * (from_start - self.ends[part])
    }

    /// What has this place.
    fn back(&self, place: f64) -> f64 {
        let inner = &self.sums[1..self.factors.len()];
        let part = inner.partition_point(|&sum| sum <= place);
        self.ends[part] + (place - self.sums[part]) / self.factors[part]
    }
}

/// Stretches along both axes that make steps about as long everywhere, where weights make them long in one place
/// and short in another.
fn uneven(
    face: &Face<'_>,
    bounds: &Rect,
    limits: &Limits<'_>,
    unevenness: &[Vec<f64>; 2],
) -> [Stretch; 2] {
    let size = bounds.size();
    let ends = [0, 1].map(|axis| graded(face, axis, bounds, &unevenness[axis]));
    let middles = [0, 1].map(|axis| {
        let pairs = ends[axis].windows(2);
        pairs.map(|ends| ends[0].midpoint(ends[1])).collect()
    });
    let density = |axis: usize, along: f64| {
        let others: &Vec<f64> = &middles[1 - axis];
        let stride = others.len().div_ceil(ACROSS);
        let most = others.iter().step_by(stride).map(|&across| {
            let mut place = DVec2::splat(along);
            place[1 - axis] = across;
            let step = steps(face, bounds.min + place, limits, size)[axis] / size[axis];
            step.max(LEAST).recip()
        });
        most.fold(0.0, f64::max)
    };
    [0, 1].map(|axis| {
        let rows = if axis == 0 { 1.0 } else { ROWS };
        let factors = middles[axis]
            .iter()
            .map(|&along| rows * density(axis, along) / size[axis]);
        Stretch::new(ends[axis].clone(), factors.collect())
    })
}

/// Ends of parts along an axis, from the start of a rectangle, that become shorter towards the ends of spans where
/// steps do.
fn graded(face: &Face<'_>, axis: usize, bounds: &Rect, unevenness: &[f64]) -> Vec<f64> {
    let (from, to) = (bounds.min[axis], bounds.max[axis]);
    let mut ends = vec![0.0];
    for (span, factor) in face.pieces.breaks[axis].windows(2).zip(unevenness) {
        let [start, end] = [span[0], span[1]].map(|stop| stop.clamp(from, to));
        if start < end {
            let halves = (1..HALVES).find(|&k| 0.5_f64.powi(k) * factor <= 1.0);
            let halves = halves.unwrap_or(HALVES);
            let before = (1..=halves).rev().map(|k| 0.5_f64.powi(k));
            let after = (2..=halves).map(|k| 1.0 - 0.5_f64.powi(k));
            let shares = before.chain(after).chain([1.0]);
            ends.extend(shares.map(|share| start - from + (end - start) * share));
        }
    }
    ends
}

/// Factors that make steps that use as much of the limits equally long in both directions, over a
/// rectangle; directions without curvature count by their length.
fn scale(face: &Face<'_>, bounds: &Rect, limits: &Limits<'_>) -> DVec2 {
    let (mut bend, mut turn, mut length) = (DVec2::ZERO, DVec2::ZERO, DVec2::ZERO);
    for i in 0..3 {
        for j in 0..3 {
            // Not where knots are likely to be.
            let share = DVec2::new(f64::from(i), f64::from(j)) * 0.37 + 0.11;
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
