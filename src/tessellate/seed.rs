//! Points inside a face, as far apart as its curvature allows.
//!
//! Rows of points, every other one shifted by half a step, make nearly equilateral triangles
//! in the measure of the error, which needs a quarter fewer of them than squares do. Where
//! the curvature varies the face is divided first.

use glam::{DVec2, DVec3};

use super::Limits;
use super::pieces::Rect;
use super::rim::Face;

/// A point to be, and the steps to its neighbours.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seed {
    pub(super) uv: DVec2,
    pub(super) step: DVec2,
}

/// Steps that differ by more than this within a block divide it.
const UNEVEN: f64 = 1.5;

/// Levels of division.
const LEVELS: u32 = 24;

/// The part of a face that gets its own rows; `hard` sides have points of their own.
#[derive(Clone, Copy)]
struct Block {
    rect: Rect,
    hard: [[bool; 2]; 2],
}

/// The seeds of a face within `bounds`, block by block between its creases.
pub(super) fn seeds(face: &Face<'_>, bounds: &Rect, limits: &Limits) -> Vec<Seed> {
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
                hard: [[true; 2]; 2],
            };
            divide(face, block, limits, LEVELS, &mut seeds);
        }
    }
    seeds
}

fn divide(face: &Face<'_>, block: Block, limits: &Limits, levels: u32, out: &mut Vec<Seed>) {
    let Rect { min, max } = block.rect;
    let size = block.rect.size();
    let mut least = DVec2::INFINITY;
    let mut most = DVec2::ZERO;
    for i in 0..5 {
        for j in 0..5 {
            let share = DVec2::new(f64::from(i), f64::from(j)) * 0.2 + 0.1;
            let step = steps(face, min + size * share, limits, size);
            least = least.min(step);
            most = most.max(step);
        }
    }
    let counts = size / least;
    let waste = [0, 1].map(|k| if counts[k] > 2.0 { most[k] / least[k] } else { 1.0 });
    // Blocks that need no points, or the same everywhere, are not divided.
    if levels == 0 || waste[0].max(waste[1]) <= UNEVEN || counts.max_element() <= 3.0 {
        fill(&block, least.max(most * 0.6), out);
        return;
    }
    let axis = usize::from(counts.y > counts.x);
    let mut parts = [block; 2];
    let middle = 0.5 * (min[axis] + max[axis]);
    parts[0].rect.max[axis] = middle;
    parts[0].hard[axis][1] = false;
    parts[1].rect.min[axis] = middle;
    parts[1].hard[axis][0] = false;
    for part in parts {
        divide(face, part, limits, levels - 1, out);
    }
}

/// The steps along u and v that the limits allow at a point, at most twice `size`.
fn steps(face: &Face<'_>, uv: DVec2, limits: &Limits, size: DVec2) -> DVec2 {
    let d = face.pieces.surface.derivatives(uv);
    let normal = d.du.cross(d.dv).normalize_or_zero();
    let (length_u, length_v) = (d.du.length(), d.dv.length());
    let bends = DVec3::new(d.duu.length(), d.duv.length(), d.dvv.length());
    // Rows of triangles with all three sides at 6 times the tolerance.
    let room = 6.0 * 0.95 * face.tolerance;
    let mut step = DVec2::new((room / bends.x).sqrt(), (0.75 * room / bends.z).sqrt());
    let cap = |step: DVec2| step.min(size * 2.0);
    step = cap(step);
    let twist = 1.0 + bends.y * step.x * step.y / room;
    step /= twist.sqrt();
    // How fast the normal turns.
    let turn = |along: [f64; 2]| {
        let part = |bend: f64, length: f64| if length > 0.0 { bend / length } else { 0.0 };
        part(along[0], length_u).hypot(part(along[1], length_v))
    };
    let (l, m, n) = (d.duu.dot(normal), d.duv.dot(normal), d.dvv.dot(normal));
    let angle = 0.9 * limits.angle;
    let limit = DVec2::new(
        (angle / turn([l, m])).max(face.tolerance / length_u).min(limits.max_edge / length_u),
        (angle / turn([m, n])).max(face.tolerance / length_v).min(0.86 * limits.max_edge / length_v),
    );
    cap(step.min(limit))
}

/// Appends rows of points.
fn fill(block: &Block, step: DVec2, out: &mut Vec<Seed>) {
    let Rect { min, .. } = block.rect;
    let size = block.rect.size();
    for (row, v) in places(size.y, step.y, block.hard[1], false).into_iter().enumerate() {
        for u in places(size.x, step.x, block.hard[0], row % 2 == 0) {
            let uv = min + DVec2::new(u, v);
            out.push(Seed { uv, step });
        }
    }
}

/// Evenly spaced places along a length, half a step from soft ends; `shifted` moves them by
/// half a step where both ends are alike.
fn places(length: f64, step: f64, hard: [bool; 2], shifted: bool) -> Vec<f64> {
    let count = length / step;
    let spread = |offset: f64, steps: f64| {
        let unit = length / steps;
        let most = (steps - offset - 1e-6).floor().max(-1.0);
        let mut k = 0.0;
        let mut places = Vec::new();
        while k <= most {
            places.push((k + offset) * unit);
            k += 1.0;
        }
        places
    };
    match hard {
        [true, true] if shifted && count > 1.0 => spread(0.5, count.ceil()),
        [true, true] => spread(1.0, count.ceil().max(1.0)),
        [false, false] if count < 0.5 => Vec::new(),
        [false, false] if shifted => spread(0.25, count.ceil()),
        [false, false] => spread(0.75, count.ceil()),
        ends => {
            let steps = (count - 0.5).ceil().max(0.0) + 0.5;
            let offset = if ends[0] { 1.0 } else { 0.5 };
            if steps < 1.0 { Vec::new() } else { spread(offset, steps) }
        }
    }
}
