//! Eight cells side by side: one ray is tested against all of their frames at once, and so is a
//! beam of them.

mod crossing;

use std::ops::Range;

use glam::DVec3;

use super::cells::{Cell, CellFrame};
use super::leaf::Bits;
use super::octet::Frames;
use super::room::part_of;
use super::tree::{LocalRay, Tree, WIDTH};
use crate::intersect::Rect;
use crate::simd::{Part, Simd};

/// Rounding errors of positions in a tree of size one.
const POSITION_ERROR: f32 = 16.0 / (1 << 24) as f32;

/// Change of a frame by its rounding to single precision.
const FRAME_ERROR: f32 = 16.0 / (1 << 24) as f32;

/// Growth of bounds that covers the roundings of the test itself.
const GROWTH: f32 = 1.0 + 1e-4;

/// The cells of a leaf. Frames are in the coordinates of the hierarchy; see
/// [`super::cells::CellFrame`].
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(crate) struct Block {
    center: [[f32; WIDTH]; 3],
    rows: [[[f32; WIDTH]; 3]; 3],
    bulge: [[f32; WIDTH]; 3],
    stray: [[f32; WIDTH]; 4],
    pub(crate) cells: [Cell; WIDTH],
    count: u32,
}

/// What a ray may do in one of the cells of a block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Encounter {
    pub(crate) slot: usize,
    /// Where the ray meets the tangent plane, in the cell's coordinates from -1 to 1.
    pub(crate) start: [f32; 2],
    /// Roots are no further from there.
    pub(crate) side: [f32; 2],
    /// Bound on how far the cell strays from its frame as seen along the ray: below one there
    /// is at most one root.
    pub(crate) stray: f32,
    /// Nothing of the cell is met before this.
    pub(crate) near: f32,
}

impl Block {
    /// Without cells.
    pub(crate) const EMPTY: Self = Self {
        center: [[0.0; WIDTH]; 3],
        rows: [[[0.0; WIDTH]; 3]; 3],
        bulge: [[f32::INFINITY; WIDTH]; 3],
        stray: [[f32::INFINITY; WIDTH]; 4],
        cells: [Cell::NONE; WIDTH],
        count: 0,
    };

    /// Puts the cells of a leaf side by side.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "tests allow for the rounding"
    )]
    pub(crate) fn new(cells: impl Iterator<Item = (Cell, CellFrame)>, tree: &Tree) -> Self {
        let mut block = Self::EMPTY;
        let unit = tree.scale().recip();
        for (slot, (cell, frame)) in cells.enumerate() {
            block.count += 1;
            let center = tree.to_local(frame.center);
            for axis in 0..3 {
                block.center[axis][slot] = center[axis] as f32;
                for row in 0..3 {
                    let value = frame.rows[row][axis] * unit;
                    block.rows[row][axis][slot] = value as f32;
                }
            }
            for (bulge, value) in block.bulge.iter_mut().zip(frame.half) {
                bulge[slot] = value as f32 * GROWTH + FRAME_ERROR;
            }
            for (stray, value) in block.stray.iter_mut().zip(frame.stray) {
                stray[slot] = value as f32 * GROWTH + FRAME_ERROR;
            }
            block.cells[slot] = cell;
        }
        block
    }

    /// Takes the parts of a coarse cell instead of its own.
    #[inline(always)]
    pub(super) fn take<S: Simd>(&mut self, s: S, cell: &Cell, frames: &Frames<S::D>) {
        let bound = |x: S::D| {
            s.fma_d(
                x,
                s.splat_d(f64::from(GROWTH)),
                s.splat_d(f64::from(FRAME_ERROR)),
            )
        };
        for axis in 0..3 {
            s.store_rounded(frames.center[axis], &mut self.center[axis]);
            for row in 0..3 {
                s.store_rounded(frames.rows[row][axis], &mut self.rows[row][axis]);
            }
            s.store_rounded(bound(frames.half[axis]), &mut self.bulge[axis]);
        }
        for (to, from) in self.stray.iter_mut().zip(frames.stray) {
            s.store_rounded(bound(from), to);
        }
        self.count = 0;
        for (to, part) in self.cells.iter_mut().zip(cell.parts()) {
            *to = part;
            self.count += 1;
        }
    }

    /// The bounds of a cell: see [`CellFrame`].
    #[inline(always)]
    pub(super) fn bounds(&self, slot: usize) -> ([f32; 3], [f32; 4]) {
        (
            self.bulge.map(|bulge| bulge[slot]),
            self.stray.map(|stray| stray[slot]),
        )
    }

    /// The inverse frame of a cell in coordinates of which `unit` make one of the hierarchy's.
    #[inline(always)]
    pub(crate) fn rows(&self, slot: usize, unit: f64) -> [DVec3; 3] {
        [0, 1, 2].map(|row| {
            let [x, y, z] = [0, 1, 2].map(|axis| f64::from(self.rows[row][axis][slot]));
            DVec3::new(x, y, z) * unit
        })
    }

    /// The cells that the ray's line may meet within `range`, nearest tangent plane first.
    #[inline(always)]
    pub(crate) fn meet<S: Simd>(
        &self,
        s: S,
        ray: &LocalRay,
        range: &Range<f32>,
        found: &mut [Encounter; WIDTH],
    ) -> usize {
        let (met, lanes) = s.apart(OfRay(self, ray, range));
        let mut count = 0;
        for slot in Bits(u64::from(met)) {
            let mut place = count;
            while place > 0 && lanes.time[found[place - 1].slot] > lanes.time[slot] {
                found[place] = found[place - 1];
                place -= 1;
            }
            found[place] = Encounter {
                slot,
                start: [lanes.s[slot], lanes.t[slot]],
                side: [lanes.side1[slot], lanes.side2[slot]],
                stray: lanes.stray[slot],
                near: lanes.near[slot],
            };
            count += 1;
        }
        count
    }

    /// The test of one cell. The rest of a cell changes its coordinates by at most `stray`, so
    /// a root cannot lie further than that from where the ray meets the tangent plane.
    #[inline(always)]
    fn lane(&self, k: usize, ray: &LocalRay, range: &Range<f32>, lanes: &mut Lanes) {
        let [x, y, z] = &self.center;
        let offset = [
            ray.origin[0] - x[k],
            ray.origin[1] - y[k],
            ray.origin[2] - z[k],
        ];
        let dot = |row: &[[f32; WIDTH]; 3], v: [f32; 3]| {
            row[0][k] * v[0] + row[1][k] * v[1] + row[2][k] * v[2]
        };
        let error = |row: &[[f32; WIDTH]; 3]| {
            (row[0][k].abs() + row[1][k].abs() + row[2][k].abs()) * POSITION_ERROR
        };
        let [row1, row2, row3] = &self.rows;
        let (p1, p2, p3) = (dot(row1, offset), dot(row2, offset), dot(row3, offset));
        let direction = ray.direction;
        let (d1, d2, d3) = (
            dot(row1, direction),
            dot(row2, direction),
            dot(row3, direction),
        );
        let (e1, e2, e3) = (error(row1), error(row2), error(row3));
        let inverse = d3.recip();
        let (g1, g2) = (d1 * inverse, d2 * inverse);
        let (s, t) = (p1 - g1 * p3, p2 - g2 * p3);
        let [k1, k2, k3, k4] = &self.stray;
        let (k1, k2, k3, k4) = (k1[k], k2[k], k3[k], k4[k]);
        let [h1, h2, h3] = &self.bulge;
        let (h1, h2, h3) = (h1[k], h2[k], h3[k]);
        let (size1, size2) = (g1.abs(), g2.abs());
        let side1 = h1 + size1 * h3 + s.abs() * k4 + e1 + size1 * e3;
        let side2 = h2 + size2 * h3 + t.abs() * k4 + e2 + size2 * e3;
        let q1 = k1 + size1 * k3 + s.abs() * k4 + e1 + size1 * e3;
        let q2 = k2 + size2 * k3 + t.abs() * k4 + e2 + size2 * e3;
        // Where the plane and the rest of the cell are met along the ray.
        let time = -p3 * inverse;
        let room = (1.0 - k4).recip();
        let room = if k4 < 1.0 { room } else { f32::INFINITY };
        let height = h3 * room + e3;
        let spread = height * inverse.abs() * GROWTH;
        // All of the cell lies in a box along its frame. What is not a number passes.
        let (near, far) = slab(f32::NEG_INFINITY, f32::INFINITY, p3, inverse, height);
        let (near, far) = slab(near, far, p1, d1.recip(), (1.0 + h1) * room + e1);
        let (near, far) = slab(near, far, p2, d2.recip(), (1.0 + h2) * room + e2);
        let beside = (s.abs() > (1.0 + side1) * GROWTH)
            | (t.abs() > (1.0 + side2) * GROWTH)
            | (near > far + (near.abs() + far.abs()) * (GROWTH - 1.0))
            | (time - spread > range.end)
            | (time + spread < range.start);
        lanes.beside[k] = u32::from(beside);
        (lanes.s[k], lanes.t[k]) = (s, t);
        (lanes.side1[k], lanes.side2[k]) = (side1 * GROWTH, side2 * GROWTH);
        let stray = if q1 > q2 { q1 } else { q2 };
        // A comparison with what is not a number must fail.
        let known = (q1 < f32::INFINITY) & (q2 < f32::INFINITY);
        lanes.stray[k] = if known { stray } else { f32::INFINITY };
        // Of a cell seen from its edge nothing is known of where along the ray it begins.
        let near = time - spread;
        lanes.time[k] = time;
        lanes.near[k] = if near.is_nan() {
            f32::NEG_INFINITY
        } else {
            near
        };
    }
}

/// The part of a ray in which a coordinate is at most `half` from zero, from `p` on and with
/// the way `inverse` of one unit.
#[inline(always)]
fn slab(near: f32, far: f32, p: f32, inverse: f32, half: f32) -> (f32, f32) {
    let half = half * GROWTH;
    let (a, b) = ((-half - p) * inverse, (half - p) * inverse);
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    (
        if low > near { low } else { near },
        if high < far { high } else { far },
    )
}

impl Block {
    /// A bit for each of the cells that is not `beside`.
    #[inline(always)]
    fn those_not(&self, beside: &[u32; WIDTH]) -> u32 {
        let all = (1 << self.count) - 1;
        (0..WIDTH).fold(0, |bits, k| bits | (1 - beside[k]) << k) & all
    }
}

/// Asks the cells of a block about a ray.
struct OfRay<'a>(&'a Block, &'a LocalRay, &'a Range<f32>);

impl<S: Simd> Part<S> for OfRay<'_> {
    /// A bit for each cell that it may meet, and what they say.
    type Output = (u32, Lanes);

    #[inline(always)]
    fn run(self, _: S) -> Self::Output {
        let mut lanes = Lanes::NONE;
        // Without branches, for eight cells at once.
        for k in 0..WIDTH {
            self.0.lane(k, self.1, self.2, &mut lanes);
        }
        (self.0.those_not(&lanes.beside), lanes)
    }
}

/// What eight cells say of a ray.
#[repr(align(32))]
struct Lanes {
    /// One where the ray certainly misses the cell within the range.
    beside: [u32; WIDTH],
    s: [f32; WIDTH],
    t: [f32; WIDTH],
    side1: [f32; WIDTH],
    side2: [f32; WIDTH],
    stray: [f32; WIDTH],
    time: [f32; WIDTH],
    near: [f32; WIDTH],
}

impl Lanes {
    const NONE: Self = Self {
        beside: [0; WIDTH],
        s: [0.0; WIDTH],
        t: [0.0; WIDTH],
        side1: [0.0; WIDTH],
        side2: [0.0; WIDTH],
        stray: [0.0; WIDTH],
        time: [0.0; WIDTH],
        near: [0.0; WIDTH],
    };
}

impl Encounter {
    /// The part of the cell `rect` in which roots may be.
    pub(super) fn part(&self, rect: &Rect) -> Rect {
        let ([s, t], [side1, side2]) = (self.start, self.side);
        part_of(rect, [s - side1, t - side2], [s + side1, t + side2])
    }

    /// An entry of a list that is not filled yet.
    pub(crate) const NONE: Self = Self {
        slot: 0,
        start: [0.0; 2],
        side: [0.0; 2],
        stray: 0.0,
        near: 0.0,
    };
}
