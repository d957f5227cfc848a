//! Rays that do not run side by side, each at a cell of its own.

use super::approach::{Approach, Shape, Sight, height, load, reach};
use super::beam::RAYS;
use super::cells::Cell;
use super::distance::Cells;
use super::expansion::TERMS;
use super::leaving::Starts;
use super::model::Model;
use super::tree::Course;
use super::windows::{Batch, Company};
use crate::simd::{LANES, Singles};

/// Groups of rays.
const GROUPS: usize = RAYS / LANES;

/// Rounding errors of ray parameters in single precision, several wide.
const ROUNDING: f32 = 16.0 / (1 << 24) as f32;

/// Sixteen cells side by side.
type Sixteen = Cells<[f32; LANES]>;

/// Up to 64 cells, each with the ray that may meet it.
#[derive(Debug)]
pub(super) struct Meetings {
    pub(super) count: usize,
    /// Ray, instance and cell of each, and the part of the piece: see [`Model`].
    pub(super) lane: [u8; RAYS],
    pub(super) instance: [u32; RAYS],
    pub(super) cell: [Cell; RAYS],
    pub(super) part: [([f64; 2], [f64; 2]); RAYS],
    /// A bit for each that has no frame.
    pub(super) frameless: u64,
    /// Whether one of the pieces is rational, and whether one ever was.
    pub(super) is_rational: bool,
    is_weighted: bool,
    /// Where the ray is nearest to the middle of the cell, from there, and its direction.
    place: [[f32; RAYS]; 3],
    direction: [[f32; RAYS]; 3],
    /// What is still of interest of the ray, from that place.
    near: [f32; RAYS],
    far: [f32; RAYS],
    /// See [`Model`].
    rows: [[[f32; RAYS]; 3]; 3],
    bulge: [[f32; RAYS]; 3],
    weight_stray: [f32; RAYS],
    dropped: [f32; RAYS],
    height: [f32; RAYS],
    pub(super) starts: Starts,
    groups: [Sixteen; GROUPS],
    /// Those of a batch.
    batch: Sixteen,
}

impl Sixteen {
    /// Weights of one.
    const NONE: Self = {
        let mut none = Self {
            terms: [[[0.0; LANES]; 4]; TERMS],
            second: [[[0.0; LANES]; 4]; 3],
            reach: [[f32::INFINITY; LANES]; 2],
            higher: [0.0; LANES],
            flat: 0,
        };
        none.terms[0][3] = [1.0; LANES];
        none
    };

    /// Puts `K` coordinates of one cell into slot `k`: without the fourth, its weight stays.
    #[inline(always)]
    fn put<const K: usize>(&mut self, k: usize, cell: &Cells<f32>) {
        for (to, from) in self.terms.iter_mut().zip(&cell.terms) {
            for r in 0..K {
                to[r][k] = from[r];
            }
        }
        for (to, from) in self.second.iter_mut().zip(&cell.second) {
            for r in 0..K {
                to[r][k] = from[r];
            }
        }
        let [inside, beside] = cell.reach;
        (self.reach[0][k], self.reach[1][k]) = (inside, beside);
        self.higher[k] = cell.higher;
        self.flat = self.flat & !(1 << k) | (cell.flat & 1) << k;
    }
}

impl Meetings {
    pub(super) const NONE: Self = Self {
        count: 0,
        lane: [0; RAYS],
        instance: [0; RAYS],
        cell: [Cell::NONE; RAYS],
        part: [([0.0; 2], [0.0; 2]); RAYS],
        frameless: 0,
        is_rational: false,
        is_weighted: false,
        place: [[0.0; RAYS]; 3],
        direction: [[0.0; RAYS]; 3],
        near: [0.0; RAYS],
        far: [0.0; RAYS],
        rows: [[[0.0; RAYS]; 3]; 3],
        bulge: [[0.0; RAYS]; 3],
        weight_stray: [0.0; RAYS],
        dropped: [0.0; RAYS],
        height: [0.0; RAYS],
        starts: Starts::NONE,
        groups: [const { Sixteen::NONE }; GROUPS],
        batch: Sixteen::NONE,
    };

    /// Begins anew.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        (self.count, self.frameless, self.is_rational) = (0, 0, false);
        self.starts.clear();
    }

    /// Adds a ray, by its number `lane`, between two lengths from its origin that are still of
    /// interest, and a cell of an instance.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a lane is below 64; differences are formed before, and bounds are widened"
    )]
    pub(super) fn put(
        &mut self,
        (lane, course, [near, far]): (usize, &Course, [f64; 2]),
        (instance, cell, is_rational): (u32, &Cell, bool),
        model: &Model,
    ) {
        let k = self.count;
        self.count += 1;
        self.lane[k] = lane as u8;
        self.instance[k] = instance;
        self.cell[k] = *cell;
        self.is_rational |= is_rational;
        self.is_weighted |= is_rational;
        self.part[k] = (model.middle, model.half);
        let towards = model.center - course.origin;
        let way = towards.dot(course.direction);
        let place = course.direction * way - towards;
        for axis in 0..3 {
            self.place[axis][k] = place[axis] as f32;
            self.direction[axis][k] = course.direction[axis] as f32;
            for row in 0..3 {
                self.rows[row][axis][k] = model.rows[row][axis];
            }
            self.bulge[axis][k] = model.bulge[axis];
        }
        let (near, far) = ((near - way) as f32, (far - way) as f32);
        self.near[k] = near - near.abs() * ROUNDING;
        self.far[k] = far + far.abs() * ROUNDING;
        self.weight_stray[k] = model.weight_stray;
        self.dropped[k] = model.dropped;
        self.height[k] = height(model.bulge[2], model.weight_stray);
        self.frameless |= u64::from(!model.bulge[0].is_finite()) << k;
        let group = &mut self.groups[k / LANES];
        if self.is_weighted {
            group.put::<4>(k % LANES, &model.cell);
        } else {
            group.put::<3>(k % LANES, &model.cell);
        }
    }
}

/// As [`load`], of three coordinates.
#[inline(always)]
fn three<S: Singles>(s: S, values: &[[f32; RAYS]; 3], group: usize) -> [S::F; 3] {
    let [x, y, z] = values;
    [load(s, x, group), load(s, y, group), load(s, z, group)]
}

#[inline(always)]
fn dot<S: Singles>(s: S, a: [S::F; 3], b: [S::F; 3]) -> S::F {
    s.fma(a[0], b[0], s.fma(a[1], b[1], s.mul(a[2], b[2])))
}

/// The sum of the sizes of three coordinates.
#[inline(always)]
fn size<S: Singles>(s: S, [x, y, z]: [S::F; 3]) -> S::F {
    s.add(s.abs(x), s.add(s.abs(y), s.abs(z)))
}

impl Company for Meetings {
    type Number = [f32; LANES];

    #[inline(always)]
    fn approach<S: Singles, const RATIONAL: bool>(
        &self,
        s: S,
        (group, _): (usize, u32),
    ) -> Approach<S::F> {
        let (y, d) = (
            three(s, &self.place, group),
            three(s, &self.direction, group),
        );
        let (mut p, mut m, mut sizes) = (y, d, y);
        for r in 0..3 {
            let row = three(s, &self.rows[r], group);
            p[r] = dot(s, row, y);
            m[r] = dot(s, row, d);
            sizes[r] = size(s, row);
        }
        let ([p1, p2, p3], [d1, d2, d3]) = (p, m);
        let inverse = s.div(s.splat(1.0), d3);
        let (g1, g2) = (s.mul(d1, inverse), s.mul(d2, inverse));
        let sight = Sight {
            is_exact: false,
            distance: size(s, y),
            inverse,
            tilt: [g1, g2],
            place: [s.fnma(g1, p3, p1), s.fnma(g2, p3, p2)],
            time: s.fnma(p3, inverse, s.splat(0.0)),
            near: load(s, &self.near, group),
            far: load(s, &self.far, group),
        };
        let shape = Shape {
            bulge: three(s, &self.bulge, group),
            weight_stray: load(s, &self.weight_stray, group),
            dropped: load(s, &self.dropped, group),
            height: load(s, &self.height, group),
            direction_size: s.max(sizes[0], s.max(sizes[1], sizes[2])),
            sizes,
        };
        reach::<S, RATIONAL>(s, &sight, &shape)
    }

    #[inline(always)]
    fn starts(&self) -> &Starts {
        &self.starts
    }

    #[inline(always)]
    fn cells(&self, group: usize) -> &Sixteen {
        &self.groups[group]
    }

    #[inline(always)]
    fn cells_of(&mut self, batch: &Batch) -> &Sixteen {
        let to = &mut self.batch;
        let coordinates = if self.is_rational { 4 } else { 3 };
        to.flat = 0;
        for (slot, &lane) in batch.lane[..batch.count].iter().enumerate() {
            let (group, k) = (
                usize::from(lane) / LANES % GROUPS,
                usize::from(lane) % LANES,
            );
            let from = &self.groups[group];
            to.flat |= (from.flat >> k & 1) << slot;
            for t in 0..TERMS {
                for r in 0..coordinates {
                    to.terms[t][r][slot] = from.terms[t][r][k];
                }
            }
            for t in 0..3 {
                for r in 0..coordinates {
                    to.second[t][r][slot] = from.second[t][r][k];
                }
            }
        }
        to
    }
}
