//! Eight cells side by side: one ray is tested against all of their frames at once.

use std::ops::Range;

use glam::DVec3;

use super::cells::{Cell, NewCell};
use super::tree::{LocalRay, Tree, WIDTH};

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
    stray: [[f32; WIDTH]; 3],
    pub(crate) cells: [Cell; WIDTH],
    count: u32,
}

/// What a ray may do in one of the cells of a block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Encounter {
    pub(crate) slot: usize,
    /// Where the ray meets the tangent plane, in the cell's coordinates from -1 to 1.
    pub(crate) start: [f32; 2],
    /// Bound on how far the cell strays from its frame as seen along the ray: below one there
    /// is at most one root.
    pub(crate) stray: f32,
}

impl Block {
    /// Puts the cells of a leaf side by side.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "tests allow for the rounding"
    )]
    pub(crate) fn new(cells: &[NewCell], tree: &Tree) -> Self {
        let mut block = Self {
            center: [[0.0; WIDTH]; 3],
            rows: [[[0.0; WIDTH]; 3]; 3],
            stray: [[f32::INFINITY; WIDTH]; 3],
            cells: [Cell::default(); WIDTH],
            count: u32::try_from(cells.len()).expect("a leaf has at most eight cells"),
        };
        for (slot, new) in cells.iter().enumerate() {
            let center = tree.to_local(new.frame.center);
            for axis in 0..3 {
                block.center[axis][slot] = center[axis] as f32;
                block.stray[axis][slot] = new.frame.stray[axis] as f32 * GROWTH + FRAME_ERROR;
                for row in 0..3 {
                    let value = new.frame.rows[row][axis] / tree.scale();
                    block.rows[row][axis][slot] = value as f32;
                }
            }
            block.cells[slot] = new.cell;
        }
        block
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
    pub(crate) fn meet(
        &self,
        ray: &LocalRay,
        range: &Range<f32>,
        found: &mut [Encounter; WIDTH],
    ) -> usize {
        let lanes: [Lane; WIDTH] = std::array::from_fn(|k| self.lane(k, ray, range));
        let mut count = 0;
        for (slot, lane) in lanes[..self.count as usize].iter().enumerate() {
            if lane.beside {
                continue;
            }
            let mut place = count;
            while place > 0 && lanes[found[place - 1].slot].time > lane.time {
                found[place] = found[place - 1];
                place -= 1;
            }
            found[place] = Encounter {
                slot,
                start: lane.start,
                // A comparison with what is not a number must fail.
                stray: if lane.stray.is_nan() {
                    f32::INFINITY
                } else {
                    lane.stray
                },
            };
            count += 1;
        }
        count
    }

    /// The test of one cell. The rest of a cell changes its coordinates by at most `stray`, so
    /// a root cannot lie further than that from where the ray meets the tangent plane.
    #[inline(always)]
    fn lane(&self, k: usize, ray: &LocalRay, range: &Range<f32>) -> Lane {
        let offset = [0, 1, 2].map(|axis| ray.origin[axis] - self.center[axis][k]);
        let row = |row: usize| [0, 1, 2].map(|axis| self.rows[row][axis][k]);
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let p = [0, 1, 2].map(|r| dot(row(r), offset));
        let d = [0, 1, 2].map(|r| dot(row(r), ray.direction));
        let error = [0, 1, 2].map(|r| dot(row(r).map(f32::abs), [POSITION_ERROR; 3]));
        let inverse = d.map(f32::recip);
        let (g1, g2) = (d[0] * inverse[2], d[1] * inverse[2]);
        let (s, t) = (p[0] - g1 * p[2], p[1] - g2 * p[2]);
        let q1 = self.stray[0][k] + g1.abs() * self.stray[2][k] + error[0] + g1.abs() * error[2];
        let q2 = self.stray[1][k] + g2.abs() * self.stray[2][k] + error[1] + g2.abs() * error[2];
        // Where the plane and the rest of the cell are met along the ray.
        let time = -p[2] * inverse[2];
        let spread = (self.stray[2][k] + error[2]) * inverse[2].abs() * GROWTH;
        // All of the cell lies in a box along its frame.
        let (mut near, mut far) = (f32::NEG_INFINITY, f32::INFINITY);
        for axis in 0..3 {
            let base = if axis < 2 { 1.0 } else { 0.0 };
            let half = (base + self.stray[axis][k] + error[axis]) * GROWTH;
            let (a, b) = (
                (-half - p[axis]) * inverse[axis],
                (half - p[axis]) * inverse[axis],
            );
            let (low, high) = if a < b { (a, b) } else { (b, a) };
            near = if low > near { low } else { near };
            far = if high < far { high } else { far };
        }
        // Written so that what is not a number passes.
        let beside = s.abs() > (1.0 + q1) * GROWTH
            || t.abs() > (1.0 + q2) * GROWTH
            || near > far + (near.abs() + far.abs()) * (GROWTH - 1.0)
            || time - spread > range.end
            || time + spread < range.start;
        Lane {
            beside,
            start: [s, t],
            stray: q1.max(q2),
            time,
        }
    }
}

/// What one cell says of a ray.
#[derive(Clone, Copy)]
struct Lane {
    /// Whether the ray certainly misses the cell within the range.
    beside: bool,
    start: [f32; 2],
    stray: f32,
    time: f32,
}

impl Encounter {
    /// An entry of a list that is not filled yet.
    pub(crate) const NONE: Self = Self {
        slot: 0,
        start: [0.0; 2],
        stray: 0.0,
    };
}
