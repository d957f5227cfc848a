//! Points inside a face, as far apart as its curvature allows.
//!
//! Rows of points, every other one shifted by half a step, make nearly equilateral triangles
//! in the measure of the error, which needs a quarter fewer of them than squares do. Rows
//! and the points along each lie as dense as the largest error there asks for; where rows
//! would be far denser than most of their length needs, the face is divided first.

use glam::{DVec2, DVec3};
use kernel::SurfaceDerivatives;

use super::super::Limits;
use super::super::pieces::Rect;
use super::super::rim::Face;
use super::super::round::Round;
use super::plane::Plane;

/// A point to be, and the steps to its neighbours.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seed {
    pub(super) uv: DVec2,
    pub(super) step: DVec2,
}

/// Rows that are denser than needed by this factor on average are divided.
const UNEVEN: f64 = 1.6;

/// Places along an axis of a block that are looked at, at most.
const MOST: usize = 48;

/// Chords around a torus bend aside in it by no more than this share of what rows are apart: else triangles crumple.
const ASIDE: f64 = 0.25;

/// Levels of division.
const LEVELS: u32 = 8;

/// The part of a face that gets its own rows; hard sides have points of their own.
#[derive(Clone, Copy)]
struct Block {
    rect: Rect,
    /// Whether the sides where u starts and ends are hard.
    hard: [bool; 2],
}

/// The seeds of a face within `bounds`, block by block between its creases; not all of them if there is
/// no room for them.
pub(super) fn seeds(
    face: &Face<'_>,
    plane: &Plane,
    bounds: &Rect,
    limits: &Limits<'_>,
) -> Vec<Seed> {
    // Rows along straight lines towards a point are of no use.
    let is_plain = face.pieces.are_straight() || face.pieces.cone.is_some();
    if is_plain && limits.max_edge.is_infinite() {
        return Vec::new();
    }
    let cuts = [0, 1].map(|axis| {
        let mut cuts = vec![bounds.min[axis]];
        let inner = face.pieces.creases[axis].iter();
        cuts.extend(inner.filter(|&&k| bounds.min[axis] < k && k < bounds.max[axis]));
        cuts.push(bounds.max[axis]);
        cuts
    });
    let mut seeds = Vec::new();
    for u in cuts[0].windows(2) {
        for v in cuts[1].windows(2) {
            let rect = Rect {
                min: DVec2::new(u[0], v[0]),
                max: DVec2::new(u[1], v[1]),
            };
            let block = Block {
                rect,
                hard: [true; 2],
            };
            fill((face, plane), block, limits, LEVELS, &mut seeds);
        }
    }
    seeds
}

/// Appends the rows of a block, or of its halves.
fn fill(
    (face, plane): (&Face<'_>, &Plane),
    block: Block,
    limits: &Limits<'_>,
    levels: u32,
    out: &mut Vec<Seed>,
) {
    let Rect { min, max } = block.rect;
    let size = block.rect.size();
    let [across, along] = [0, 1].map(|axis| {
        let (from, to) = (min[axis], max[axis]);
        samples((4 * face.pieces.count(axis, from, to)).max(plane.parts(axis, from, to)))
    });
    let place = |u: f64, v: f64| plane.within(&block.rect, DVec2::new(u, v));
    // Shares of the block as it lies in the plane.
    let step = |u: f64, v: f64| {
        let (uv, unit) = place(u, v);
        steps(face, uv, limits, size) / unit
    };
    let look = |&v: &f64| across.iter().map(|&u| step(u, v)).collect();
    let grid: Vec<Vec<DVec2>> = along.iter().map(look).collect();
    // Rows as dense as the place that needs it most.
    let (mut densities, mut mean) = (Vec::new(), 0.0);
    for steps in &grid {
        let own = steps.iter().map(|step| step.y.recip());
        densities.push(own.clone().fold(0.0, f64::max));
        mean += own.sum::<f64>() / across.len() as f64;
    }
    let rows = Density::new(&densities);
    let waste = densities.iter().sum::<f64>() / mean;
    let middle = between(&grid, 0.5).map(f64::recip);
    let columns = middle.sum::<f64>() / across.len() as f64;
    if levels > 0 && waste > UNEVEN && rows.total() > 3.0 && columns > 4.0 {
        let mut parts = [block; 2];
        let middle = place(0.5, 0.5).0.x;
        parts[0].rect.max.x = middle;
        parts[0].hard[1] = false;
        parts[1].rect.min.x = middle;
        parts[1].hard[0] = false;
        for part in parts {
            fill((face, plane), part, limits, levels - 1, out);
        }
        return;
    }
    // No list becomes longer than there is room for.
    if !limits.room.take(rows.total()) {
        return;
    }
    for (number, v) in rows.places([true; 2], false).into_iter().enumerate() {
        let densities: Vec<f64> = between(&grid, v).map(f64::recip).collect();
        let row = Density::new(&densities);
        if !limits.room.take(row.total()) {
            return;
        }
        for u in row.places(block.hard, number % 2 == 0) {
            let (uv, unit) = place(u, v);
            let step = unit / DVec2::new(row.at(u), rows.at(v));
            out.push(Seed { uv, step });
        }
    }
}

/// The steps along u at a share of v, from those of the rows of a grid.
fn between(grid: &[Vec<DVec2>], v: f64) -> impl Iterator<Item = f64> {
    let place = (v * grid.len() as f64 - 0.5).clamp(0.0, (grid.len() - 1) as f64);
    let after = (0..grid.len()).find(|&k| place <= k as f64);
    let after = after.unwrap_or(grid.len() - 1);
    let before = after.saturating_sub(1);
    let share = place - before as f64;
    let pairs = grid[before].iter().zip(&grid[after]);
    pairs.map(move |(a, b)| a.x + (b.x - a.x) * share)
}

/// Where along an axis a block is looked at, as shares.
fn samples(count: usize) -> Vec<f64> {
    let count = count.clamp(8, MOST);
    (0..count)
        .map(|k| (k as f64 + 0.5) / count as f64)
        .collect()
}

/// How many steps there are per unit along a length of one, constant between places.
struct Density {
    values: Vec<f64>,
    /// Steps up to the end of each stretch.
    sums: Vec<f64>,
}

impl Density {
    fn new(values: &[f64]) -> Self {
        // A place in a very narrow piece says nothing about the stretch around it.
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let most = 10.0 * sorted[sorted.len() / 2].min(1e6);
        let values: Vec<f64> = values.iter().map(|v| v.min(most)).collect();
        let width = 1.0 / values.len() as f64;
        let add = |sum: &mut f64, value: &f64| {
            *sum += value * width;
            Some(*sum)
        };
        Self {
            sums: values.iter().scan(0.0, add).collect(),
            values,
        }
    }

    fn total(&self) -> f64 {
        self.sums[self.sums.len() - 1]
    }

    fn at(&self, place: f64) -> f64 {
        let count = self.values.len();
        let k = (0..count).find(|&k| place * count as f64 <= k as f64 + 1.0);
        self.values[k.unwrap_or(count - 1)]
    }

    /// The place up to which there are `steps`.
    fn place(&self, steps: f64) -> f64 {
        let count = self.values.len();
        let k = self.sums.partition_point(|&s| s < steps).min(count - 1);
        let before = if k == 0 { 0.0 } else { self.sums[k - 1] };
        let share = (steps - before) / (self.sums[k] - before);
        (k as f64 + share.clamp(0.0, 1.0)) / count as f64
    }

    /// Evenly many steps apart, a whole one from hard ends and half a step from soft ones;
    /// `shifted` moves them by half a step where both ends are alike.
    fn places(&self, hard: [bool; 2], shifted: bool) -> Vec<f64> {
        let count = self.total();
        let (offset, steps) = match hard {
            [true, true] if shifted && count > 1.0 => (0.5, count.ceil()),
            [true, true] => (1.0, count.ceil()),
            [false, false] if shifted => (0.25, count.ceil()),
            [false, false] => (0.75, count.ceil()),
            [first, _] => (if first { 1.0 } else { 0.5 }, (count - 0.5).ceil() + 0.5),
        };
        let mut places = Vec::new();
        let mut next = offset;
        while next < steps - 1e-6 && count > 0.4 {
            places.push(self.place(next * count / steps));
            next += 1.0;
        }
        places
    }
}

/// The steps along u and v that the limits allow at a point, at most twice `size`.
pub(super) fn steps(face: &Face<'_>, uv: DVec2, limits: &Limits<'_>, size: DVec2) -> DVec2 {
    let d = face.pieces.surface.derivatives(uv);
    let (length_u, length_v) = (d.du.length(), d.dv.length());
    let bends = bends(face, &d);
    // Rows of triangles with all three sides at 6 times the tolerance; where rows have different numbers of
    // points, sides between them are longer.
    let is_sphere = face.pieces.round.as_ref().is_some_and(Round::is_sphere);
    let share = if is_sphere { 0.8 } else { 0.95 };
    let room = 6.0 * share * face.tolerance;
    let mut step = DVec2::new((room / bends.x).sqrt(), (0.75 * room / bends.z).sqrt());
    let cap = |step: DVec2| step.min(size * 2.0);
    step = cap(step);
    if face.pieces.cone.is_none() {
        let twist = 1.0 + bends.y * step.x * step.y / room;
        step /= twist.sqrt();
    }
    let turns = turns(&d);
    let angle = 0.9 * limits.angle;
    let limit = DVec2::new(
        (angle / turns.x)
            .max(face.tolerance / length_u)
            .min(limits.max_edge / length_u),
        (angle / turns.y)
            .max(face.tolerance / length_v)
            .min(0.86 * limits.max_edge / length_v),
    );
    let mut step = cap(step.min(limit));
    if let Some(round) = face.pieces.round.as_ref().filter(|_| !is_sphere) {
        let around = round.around();
        let along = [d.dv, d.du][around];
        let aside = [d.duu, d.dvv][around].dot(along.normalize_or_zero()).abs();
        let rows = step[1 - around] * along.length();
        step[around] = step[around].min((8.0 * ASIDE * rows / aside).sqrt());
    }
    step
}

/// How much second derivatives keep a flat triangle from the surface: of nearest points counts what is across it.
pub(super) fn bends(face: &Face<'_>, d: &SurfaceDerivatives) -> DVec3 {
    let bends = [d.duu, d.duv, d.dvv];
    if face.pieces.round.is_none() {
        return DVec3::from_array(bends.map(DVec3::length));
    }
    let normal = d.du.cross(d.dv).normalize_or_zero();
    DVec3::from_array(bends.map(|bend| bend.dot(normal).abs()))
}

/// How fast the normal turns along u and along v, in radians.
pub(super) fn turns(d: &SurfaceDerivatives) -> DVec2 {
    let normal = d.du.cross(d.dv).normalize_or_zero();
    let (length_u, length_v) = (d.du.length(), d.dv.length());
    let turn = |along_u: f64, along_v: f64| {
        let part = |bend: f64, length: f64| if length > 0.0 { bend / length } else { 0.0 };
        DVec2::new(part(along_u, length_u), part(along_v, length_v)).length()
    };
    let (l, m, n) = (d.duu.dot(normal), d.duv.dot(normal), d.dvv.dot(normal));
    DVec2::new(turn(l, m), turn(m, n))
}
