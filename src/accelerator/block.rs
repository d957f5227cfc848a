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
    ///
    /// The rest of a cell changes its coordinates by at most `stray`, so a root cannot lie
    /// further than that from where the ray meets the tangent plane.
    #[inline(always)]
    pub(crate) fn meet(
        &self,
        ray: &LocalRay,
        range: &Range<f32>,
        found: &mut [Encounter; WIDTH],
    ) -> usize {
        let mut start = [[0.0_f32; WIDTH]; 2];
        let mut stray = [0.0_f32; WIDTH];
        let mut time = [0.0_f32; WIDTH];
        let mut hit = [false; WIDTH];
        for k in 0..WIDTH {
            let offset = [0, 1, 2].map(|axis| ray.origin[axis] - self.center[axis][k]);
            let [p, d, size] = [0, 1, 2].map(|what| {
                [0, 1, 2].map(|row| {
                    let rows = &self.rows[row];
                    match what {
                        0 => {
                            rows[0][k] * offset[0] + rows[1][k] * offset[1] + rows[2][k] * offset[2]
                        }
                        1 => {
                            rows[0][k] * ray.direction[0]
                                + rows[1][k] * ray.direction[1]
                                + rows[2][k] * ray.direction[2]
                        }
                        _ => {
                            (rows[0][k].abs() + rows[1][k].abs() + rows[2][k].abs())
                                * POSITION_ERROR
                        }
                    }
                })
            });
            let inverse = d[2].recip();
            let (g1, g2) = (d[0] * inverse, d[1] * inverse);
            let (s, t) = (p[0] - g1 * p[2], p[1] - g2 * p[2]);
            let q1 = self.stray[0][k] + g1.abs() * self.stray[2][k];
            let q2 = self.stray[1][k] + g2.abs() * self.stray[2][k];
            let margin1 = size[0] + g1.abs() * size[2];
            let margin2 = size[1] + g2.abs() * size[2];
            // Where the plane and the rest of the cell are met along the ray.
            let at = -p[2] * inverse;
            let spread = (self.stray[2][k] + size[2]) * inverse.abs() * GROWTH;
            // All of the cell lies in a box along its frame.
            let half = [
                1.0 + self.stray[0][k] + size[0],
                1.0 + self.stray[1][k] + size[1],
                self.stray[2][k] + size[2],
            ];
            let (mut near, mut far) = (f32::NEG_INFINITY, f32::INFINITY);
            for axis in 0..3 {
                let inverse = d[axis].recip();
                let (a, b) = (
                    (-half[axis] * GROWTH - p[axis]) * inverse,
                    (half[axis] * GROWTH - p[axis]) * inverse,
                );
                let (low, high) = if a < b { (a, b) } else { (b, a) };
                near = if low > near { low } else { near };
                far = if high < far { high } else { far };
            }
            // Written so that what is not a number passes.
            let beside = s.abs() > (1.0 + q1 + margin1) * GROWTH
                || t.abs() > (1.0 + q2 + margin2) * GROWTH
                || near > far + (near.abs() + far.abs()) * (GROWTH - 1.0)
                || at - spread > range.end
                || at + spread < range.start;
            hit[k] = !beside;
            start[0][k] = s;
            start[1][k] = t;
            stray[k] = (q1 + margin1).max(q2 + margin2);
            time[k] = at;
        }
        let mut count = 0;
        for k in 0..self.count as usize {
            if !hit[k] {
                continue;
            }
            let encounter = Encounter {
                slot: k,
                start: [start[0][k], start[1][k]],
                // A comparison with what is not a number must fail.
                stray: if stray[k].is_nan() {
                    f32::INFINITY
                } else {
                    stray[k]
                },
            };
            let mut place = count;
            while place > 0 && time[found[place - 1].slot] > time[k] {
                found[place] = found[place - 1];
                place -= 1;
            }
            found[place] = encounter;
            count += 1;
        }
        count
    }
}

impl Encounter {
    /// An entry of a list that is not filled yet.
    pub(crate) const NONE: Self = Self {
        slot: 0,
        start: [0.0; 2],
        stray: 0.0,
    };
}
