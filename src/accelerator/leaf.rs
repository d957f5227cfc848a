//! The leaf solver for sixteen rays and one cell: exclusion, the test for uniqueness and
//! Newton's iteration, in single precision.

use super::beam::{Beam, RAYS};
use super::expansion::{ORDER, WIDE};
use super::model::Model;
use crate::simd::{LANES, Simd};

/// Below this stray the iteration is trusted to single precision.
const SURE: f32 = 0.75;

/// Rounding errors of positions and values in single precision, several wide.
const ROUNDING: f32 = 8.0 / (1 << 24) as f32;

/// Larger errors than this part of a cell are not for single precision.
const BLURRED: f32 = 0.01;

/// Residual from which one more step leads close enough for double precision.
const CLOSE: f32 = 2e-3;

/// Cells are entered this much beyond their borders, so that what single precision leaves
/// open at a border is found from both sides.
const MARGIN: f32 = 1e-4;

/// [`WIDE`] in single precision.
#[expect(clippy::cast_possible_truncation, reason = "it has few digits")]
const WIDE_LIMIT: f32 = WIDE as f32;

/// Steps in single precision.
const STEPS: usize = 5;

/// A cell as the rays of a beam see it: axes in the order of the beam, signs along its way.
pub(super) struct View {
    stray: [f32; 4],
    dropped: f32,
    /// Middle of the cell along the beam, and the beam's middle there relative to it.
    zeta: f32,
    way: f32,
    place: [f32; 2],
    slope: [f32; 2],
    /// Rows over the two axes across and the main one.
    rows: [[f32; 3]; 3],
    /// Rounding errors of the three directions, and the size of the rows across.
    direction_size: f32,
    sizes: [f32; 3],
}

impl View {
    #[inline(always)]
    pub(super) fn of_model(model: &Model, beam: &Beam) -> Self {
        Self::new(
            model.center.to_array(),
            model.rows,
            model.stray,
            model.dropped,
            beam,
        )
    }

    /// As seen by a beam: the frame of a cell.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "differences are formed before; errors are allowed for"
    )]
    pub(super) fn new(
        center: [f64; 3],
        rows: [[f32; 3]; 3],
        stray: [f32; 4],
        dropped: f32,
        beam: &Beam,
    ) -> Self {
        let [i, j] = beam.across;
        let zeta = center[beam.main] * beam.sign;
        let way = zeta - beam.start;
        let (mut place, mut slope) = ([0.0; 2], [0.0; 2]);
        for (axis, side) in [(0, i), (1, j)] {
            let at = beam.middle_origin[axis] + beam.middle_slope[axis] * way;
            place[axis] = (at - center[side]) as f32;
            slope[axis] = beam.middle_slope[axis] as f32;
        }
        let sign = beam.sign as f32;
        let (mut own, mut sizes, mut direction_size) = ([[0.0; 3]; 3], [0.0; 3], 0.0_f32);
        for r in 0..3 {
            own[r] = [rows[r][i], rows[r][j], rows[r][beam.main] * sign];
            sizes[r] = own[r][0].abs() + own[r][1].abs();
            direction_size = direction_size.max(4.0 * sizes[r] + own[r][2].abs());
        }
        Self {
            stray,
            dropped,
            zeta: zeta as f32,
            way: way as f32,
            place,
            slope,
            rows: own,
            direction_size,
            sizes,
        }
    }
}

/// What sixteen rays found in a cell, a bit for each.
pub(super) struct Verdict {
    /// They met it here, in its coordinates from -1 to 1.
    pub(super) met: u32,
    pub(super) x: [f32; LANES],
    pub(super) y: [f32; LANES],
    /// It is to be cut for these.
    pub(super) open: u32,
    /// Single precision says too little for these, and would say less of its parts.
    pub(super) blurred: u32,
}

/// What a polynomial of a cell is at a point, and its derivatives.
struct Jet<F> {
    value: F,
    by_x: F,
    by_y: F,
}

/// Coordinate `r` of the cell at `x`, `y`: Horner's rule for value and derivatives.
#[inline(always)]
fn jet<S: Simd, const M: usize, const N: usize>(
    s: S,
    model: &Model,
    r: usize,
    x: S::F,
    y: S::F,
) -> Jet<S::F> {
    let (mut value, mut by_y) = line::<S, N>(s, model, r, M - 1, y);
    let mut by_x = s.splat(0.0);
    for i in (0..M - 1).rev() {
        let (next, next_by_y) = line::<S, N>(s, model, r, i, y);
        by_x = if i == M - 2 {
            value
        } else {
            s.fma(by_x, x, value)
        };
        value = s.fma(value, x, next);
        by_y = s.fma(by_y, x, next_by_y);
    }
    Jet { value, by_x, by_y }
}

/// What stands beside `x^i` at `y`, and its derivative.
#[inline(always)]
fn line<S: Simd, const N: usize>(s: S, model: &Model, r: usize, i: usize, y: S::F) -> (S::F, S::F) {
    let terms = &model.terms[i * ORDER..(i + 1) * ORDER];
    let (mut value, mut by_y) = (s.splat(terms[N - 1][r]), s.splat(0.0));
    for j in (0..N - 1).rev() {
        by_y = if j == N - 2 {
            value
        } else {
            s.fma(by_y, y, value)
        };
        value = s.fma(value, y, s.splat(terms[j][r]));
    }
    (value, by_y)
}

/// The product of a row over the axes across with positions.
#[inline(always)]
fn across<S: Simd>(s: S, row: [f32; 3], y: [S::F; 2]) -> S::F {
    s.fma(s.splat(row[0]), y[0], s.mul(s.splat(row[1]), y[1]))
}

/// The product of a row with directions, which advance by one along the main axis.
#[inline(always)]
fn along<S: Simd>(s: S, row: [f32; 3], m: [S::F; 2]) -> S::F {
    let rest = s.fma(s.splat(row[1]), m[1], s.splat(row[2]));
    s.fma(s.splat(row[0]), m[0], rest)
}

/// The lanes of a group of what a beam has for each ray.
#[inline(always)]
fn load<S: Simd>(s: S, values: &[f32; RAYS], group: usize) -> S::F {
    s.load(&values.as_chunks::<LANES>().0[group])
}

#[inline(always)]
fn clamp<S: Simd>(s: S, x: S::F, limit: S::F) -> S::F {
    s.max(s.min(x, limit), s.sub(s.splat(0.0), limit))
}

/// How sixteen rays come to a cell.
struct Approach<F> {
    /// A bit for each that certainly misses it.
    beside: u32,
    /// Where the tangent plane is met, in the cell's coordinates, and the tilt against it.
    place: [F; 2],
    tilt: [F; 2],
    /// How far the cell strays from its frame as seen along the ray, and what is uncertain.
    stray: F,
    error: F,
}

/// Whether one of the rays `16 group ..` of the beam may meet a cell: a bit for each.
#[inline(always)]
pub(super) fn pass<S: Simd>(s: S, view: &View, beam: &Beam, group: usize, rational: bool) -> u32 {
    if rational {
        !approach::<S, true>(s, view, beam, group).beside
    } else {
        !approach::<S, false>(s, view, beam, group).beside
    }
}

/// Sixteen rays in the frame of a cell.
struct Sight<F> {
    /// Where they pass the middle along the main axis, across it.
    offset: [F; 2],
    /// The third coordinate there, and the way of one unit of it along the ray.
    depth: F,
    inverse: F,
    /// Advance of the first two coordinates with the third.
    tilt: [F; 2],
    /// The first two where the third is zero.
    place: [F; 2],
}

#[inline(always)]
fn sight<S: Simd>(s: S, view: &View, beam: &Beam, group: usize) -> Sight<S::F> {
    let [row1, row2, row3] = view.rows;
    let way = s.splat(view.way);
    let turn = [load(s, &beam.turn[0], group), load(s, &beam.turn[1], group)];
    let offset1 = s.fma(turn[0], way, load(s, &beam.offset[0], group));
    let offset2 = s.fma(turn[1], way, load(s, &beam.offset[1], group));
    let y = [
        s.add(offset1, s.splat(view.place[0])),
        s.add(offset2, s.splat(view.place[1])),
    ];
    let m = [
        s.add(turn[0], s.splat(view.slope[0])),
        s.add(turn[1], s.splat(view.slope[1])),
    ];
    let (p1, p2, p3) = (across(s, row1, y), across(s, row2, y), across(s, row3, y));
    let inverse = s.div(s.splat(1.0), along(s, row3, m));
    let g1 = s.mul(along(s, row1, m), inverse);
    let g2 = s.mul(along(s, row2, m), inverse);
    Sight {
        offset: y,
        depth: p3,
        inverse,
        tilt: [g1, g2],
        place: [s.fnma(g1, p3, p1), s.fnma(g2, p3, p2)],
    }
}

#[inline(always)]
fn approach<S: Simd, const RATIONAL: bool>(
    s: S,
    view: &View,
    beam: &Beam,
    group: usize,
) -> Approach<S::F> {
    let Sight {
        offset: y,
        depth: p3,
        inverse,
        tilt: [g1, g2],
        place: [x0, y0],
    } = sight(s, view, beam, group);
    // How well it is known where the tangent plane is met.
    let (size1, size2) = (s.abs(g1), s.abs(g2));
    let distance = s.max(s.abs(y[0]), s.abs(y[1]));
    let blur = s.fma(s.splat(view.direction_size), s.abs(inverse), s.splat(1.0));
    let depth = s.fma(distance, s.splat(view.sizes[2]), s.splat(1.0));
    let width = s.fma(
        distance,
        s.splat(view.sizes[0] + view.sizes[1]),
        s.splat(1.0),
    );
    let [k1, k2, k3, k4] = view.stray;
    let (k1, k2, k3, k4) = (s.splat(k1), s.splat(k2), s.splat(k3), s.splat(k4));
    let tilt = s.max(size1, size2);
    let rounding = s.mul(
        s.splat(ROUNDING),
        s.fma(s.mul(s.add(s.splat(1.0), tilt), depth), blur, width),
    );
    let dropped = s.mul(s.splat(view.dropped), s.add(s.splat(1.0), tilt));
    let error = if RATIONAL {
        s.fma(
            dropped,
            s.max(s.abs(x0), s.abs(y0)),
            s.add(dropped, rounding),
        )
    } else {
        s.add(dropped, rounding)
    };
    let mut stray1 = s.fma(size1, k3, k1);
    let mut stray2 = s.fma(size2, k3, k2);
    let half = s.splat(0.5);
    let reach = s.add(s.splat(1.0), error);
    let mut reach1 = s.fma(half, stray1, reach);
    let mut reach2 = s.fma(half, stray2, reach);
    if RATIONAL {
        reach1 = s.fma(s.abs(x0), k4, reach1);
        reach2 = s.fma(s.abs(y0), k4, reach2);
        stray1 = s.fma(s.abs(x0), k4, stray1);
        stray2 = s.fma(s.abs(y0), k4, stray2);
    }
    let stray = s.max(stray1, stray2);
    // Where the cell is met along the beam, at the least and at the most.
    let height = if RATIONAL {
        let room = 1.0 - view.stray[3];
        let room = if room > 0.0 {
            room.recip()
        } else {
            f32::INFINITY
        };
        0.5 * view.stray[2] * room
    } else {
        0.5 * view.stray[2]
    };
    let time = s.fnma(p3, inverse, s.splat(view.zeta));
    let spread = s.fma(
        s.fma(depth, s.splat(2.0 * ROUNDING), s.splat(height * 1.001)),
        s.mul(s.abs(inverse), blur_of(s, blur)),
        s.splat(4.0 * ROUNDING),
    );
    // What is not a number passes.
    let beside = s.bits(s.lt(reach1, s.abs(x0)))
        | s.bits(s.lt(reach2, s.abs(y0)))
        | s.bits(s.lt(load(s, &beam.far, group), s.sub(time, spread)))
        | s.bits(s.lt(s.add(time, spread), load(s, &beam.near, group)));
    Approach {
        beside,
        place: [x0, y0],
        tilt: [g1, g2],
        stray,
        error,
    }
}

/// Tests rays `16 group ..` of the beam whose bits are set in `lanes` against a cell.
#[inline(always)]
pub(super) fn meet<S: Simd, const M: usize, const N: usize, const RATIONAL: bool>(
    s: S,
    model: &Model,
    view: &View,
    beam: &Beam,
    group: usize,
    lanes: u32,
) -> Verdict {
    let Approach {
        beside,
        place: [x0, y0],
        tilt: [g1, g2],
        stray,
        error,
    } = approach::<S, RATIONAL>(s, view, beam, group);
    let lanes = lanes & !beside;
    let sharp = s.bits(s.lt(error, s.splat(BLURRED)));
    let sure = s.bits(s.lt(stray, s.splat(SURE))) & sharp;
    let mut verdict = Verdict {
        met: 0,
        x: [0.0; LANES],
        y: [0.0; LANES],
        open: lanes & !sure & sharp,
        blurred: lanes & !sharp,
    };
    let mut active = lanes & sure;
    if active == 0 {
        return verdict;
    }
    let factor = s.div(s.splat(1.0), s.sub(s.splat(1.0), stray));
    let contraction = s.mul(stray, factor);
    let limit = s.fma(error, factor, s.splat(1.0 + MARGIN));
    let wide = s.splat(WIDE_LIMIT);
    let close = s.fma(error, s.splat(2.0), s.splat(CLOSE));
    let (mut x, mut y) = (clamp(s, x0, wide), clamp(s, y0, wide));
    for _ in 0..STEPS {
        let a = jet::<S, M, N>(s, model, 0, x, y);
        let b = jet::<S, M, N>(s, model, 1, x, y);
        let c = jet::<S, M, N>(s, model, 2, x, y);
        let mut f1 = s.fnma(g1, c.value, a.value);
        let mut f2 = s.fnma(g2, c.value, b.value);
        let mut f1x = s.fnma(g1, c.by_x, a.by_x);
        let mut f1y = s.fnma(g1, c.by_y, a.by_y);
        let mut f2x = s.fnma(g2, c.by_x, b.by_x);
        let mut f2y = s.fnma(g2, c.by_y, b.by_y);
        if RATIONAL {
            let w = jet::<S, M, N>(s, model, 3, x, y);
            f1 = s.fnma(x0, w.value, f1);
            f2 = s.fnma(y0, w.value, f2);
            f1x = s.fnma(x0, w.by_x, f1x);
            f1y = s.fnma(x0, w.by_y, f1y);
            f2x = s.fnma(y0, w.by_x, f2x);
            f2y = s.fnma(y0, w.by_y, f2y);
        } else {
            f1 = s.sub(f1, x0);
            f2 = s.sub(f2, y0);
        }
        let residual = s.max(s.abs(f1), s.abs(f2));
        // The root lies within the contraction of the sure step.
        let outside = s.max(s.abs(s.sub(x, f1)), s.abs(s.sub(y, f2)));
        active &= !s.bits(s.lt(s.fma(contraction, residual, limit), outside));
        let determinant = s.fnma(f1y, f2x, s.mul(f1x, f2y));
        let scale = s.div(s.splat(1.0), determinant);
        let nx = s.fnma(s.fnma(f1y, f2, s.mul(f2y, f1)), scale, x);
        let ny = s.fnma(s.fnma(f2x, f1, s.mul(f1x, f2)), scale, y);
        let done = s.le(residual, close);
        let inside = s.bits(s.le(s.max(s.abs(nx), s.abs(ny)), limit));
        let arrived = active & s.bits(done);
        // Once a lane has arrived it stays where it is.
        if arrived != 0 {
            let new = arrived & inside;
            let (mut nxs, mut nys) = ([0.0; LANES], [0.0; LANES]);
            s.store(nx, &mut nxs);
            s.store(ny, &mut nys);
            for lane in Bits(u64::from(new)) {
                verdict.x[lane] = nxs[lane];
                verdict.y[lane] = nys[lane];
            }
            verdict.met |= new;
            active &= !arrived;
        }
        if active == 0 {
            break;
        }
        (x, y) = (clamp(s, nx, wide), clamp(s, ny, wide));
    }
    verdict.open |= active;
    verdict
}

/// A growth for times from the blur of directions, at most a half more.
#[inline(always)]
fn blur_of<S: Simd>(s: S, blur: S::F) -> S::F {
    s.fma(blur, s.splat(ROUNDING), s.splat(1.0))
}

/// The numbers of the bits that are set.
pub(super) struct Bits(pub(super) u64);

impl Iterator for Bits {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let lane = self.0.trailing_zeros() as usize;
        self.0 &= self.0 - 1;
        Some(lane)
    }
}
