//! The leaf solver for sixteen rays and one cell: exclusion, the test for uniqueness and
//! Newton's iteration, in single precision.

use super::approach::{Approach, View, approach};
use super::beam::Beam;
use super::expansion::ORDER;
use super::model::Model;
use crate::simd::{LANES, Simd};

/// Uniqueness is proven below one; less bounds the number of steps.
const SURE: f32 = 0.9;

/// Larger errors than this part of a cell are not for single precision.
const BLURRED: f32 = 0.01;

/// A cell that bulges less than this beside its length is flat.
const FLAT: f32 = 1e-3;

/// After a step of Newton's shorter than this one more without new derivatives is the last.
const CLOSE: f32 = 1e-2;

/// Cells are entered this much beyond their borders, so that what single precision leaves
/// open at a border is found from both sides.
const MARGIN: f32 = 1e-4;

/// Steps in single precision.
const STEPS: usize = 5;

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

impl Verdict {
    const NONE: Self = Self {
        met: 0,
        x: [0.0; LANES],
        y: [0.0; LANES],
        open: 0,
        blurred: 0,
    };

    /// Takes the roots of some rays.
    #[inline(always)]
    fn take<S: Simd>(&mut self, s: S, new: u32, [x, y]: [S::F; 2]) {
        let (mut xs, mut ys) = ([0.0; LANES], [0.0; LANES]);
        s.store(x, &mut xs);
        s.store(y, &mut ys);
        for lane in Bits(u64::from(new)) {
            self.x[lane] = xs[lane];
            self.y[lane] = ys[lane];
        }
        self.met |= new;
    }
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

/// As [`jet`], the value alone.
#[inline(always)]
fn at<S: Simd, const M: usize, const N: usize>(
    s: S,
    model: &Model,
    r: usize,
    x: S::F,
    y: S::F,
) -> S::F {
    let mut value = s.splat(0.0);
    for i in (0..M).rev() {
        let terms = &model.terms[i * ORDER..(i + 1) * ORDER];
        let mut line = s.splat(terms[N - 1][r]);
        for j in (0..N - 1).rev() {
            line = s.fma(line, y, s.splat(terms[j][r]));
        }
        value = if i == M - 1 {
            line
        } else {
            s.fma(value, x, line)
        };
    }
    value
}

/// The distances of a cell's point from a ray along both its axes, and their derivatives.
struct Distance<F> {
    value: [F; 2],
    by_x: [F; 2],
    by_y: [F; 2],
}

#[inline(always)]
fn distance<S: Simd, const M: usize, const N: usize, const RATIONAL: bool>(
    s: S,
    model: &Model,
    [x0, y0]: [S::F; 2],
    [g1, g2]: [S::F; 2],
    [x, y]: [S::F; 2],
) -> Distance<S::F> {
    let a = jet::<S, M, N>(s, model, 0, x, y);
    let b = jet::<S, M, N>(s, model, 1, x, y);
    let c = jet::<S, M, N>(s, model, 2, x, y);
    let mut value = [s.fnma(g1, c.value, a.value), s.fnma(g2, c.value, b.value)];
    let mut by_x = [s.fnma(g1, c.by_x, a.by_x), s.fnma(g2, c.by_x, b.by_x)];
    let mut by_y = [s.fnma(g1, c.by_y, a.by_y), s.fnma(g2, c.by_y, b.by_y)];
    if RATIONAL {
        let w = jet::<S, M, N>(s, model, 3, x, y);
        value = [s.fnma(x0, w.value, value[0]), s.fnma(y0, w.value, value[1])];
        by_x = [s.fnma(x0, w.by_x, by_x[0]), s.fnma(y0, w.by_x, by_x[1])];
        by_y = [s.fnma(x0, w.by_y, by_y[0]), s.fnma(y0, w.by_y, by_y[1])];
    } else {
        value = [s.sub(value[0], x0), s.sub(value[1], y0)];
    }
    Distance { value, by_x, by_y }
}

/// As [`distance`], without derivatives.
#[inline(always)]
fn value<S: Simd, const M: usize, const N: usize, const RATIONAL: bool>(
    s: S,
    model: &Model,
    [x0, y0]: [S::F; 2],
    [g1, g2]: [S::F; 2],
    [x, y]: [S::F; 2],
) -> [S::F; 2] {
    let c = at::<S, M, N>(s, model, 2, x, y);
    let f1 = s.fnma(g1, c, at::<S, M, N>(s, model, 0, x, y));
    let f2 = s.fnma(g2, c, at::<S, M, N>(s, model, 1, x, y));
    if RATIONAL {
        let w = at::<S, M, N>(s, model, 3, x, y);
        [s.fnma(x0, w, f1), s.fnma(y0, w, f2)]
    } else {
        [s.sub(f1, x0), s.sub(f2, y0)]
    }
}

/// A 2 x 2 matrix for each ray, row by row.
#[derive(Clone, Copy)]
struct Matrix<F>([F; 4]);

impl<F: Copy> Matrix<F> {
    /// The inverse of the derivatives.
    #[inline(always)]
    fn inverse<S: Simd<F = F>>(s: S, Distance { by_x, by_y, .. }: &Distance<F>) -> Self {
        let determinant = s.fnma(by_y[0], by_x[1], s.mul(by_x[0], by_y[1]));
        let scale = s.div(s.splat(1.0), determinant);
        let minus = s.sub(s.splat(0.0), scale);
        Self([
            s.mul(by_y[1], scale),
            s.mul(by_y[0], minus),
            s.mul(by_x[1], minus),
            s.mul(by_x[0], scale),
        ])
    }

    #[inline(always)]
    fn times<S: Simd<F = F>>(&self, s: S, [x, y]: [F; 2]) -> [F; 2] {
        let [a, b, c, d] = self.0;
        [s.fma(a, x, s.mul(b, y)), s.fma(c, x, s.mul(d, y))]
    }

    /// The sizes of the entries.
    #[inline(always)]
    fn abs<S: Simd<F = F>>(&self, s: S) -> Self {
        let [a, b, c, d] = self.0;
        Self([s.abs(a), s.abs(b), s.abs(c), s.abs(d)])
    }
}

/// By how much the derivatives by x and by y of coordinate `r` change at most, `half` of a
/// window away from its middle.
#[inline(always)]
fn change<S: Simd>(s: S, model: &Model, r: usize, half: [S::F; 2]) -> [S::F; 2] {
    let [xx, xy, yy] = &model.second;
    let (xx, xy, yy) = (s.splat(xx[r]), s.splat(xy[r]), s.splat(yy[r]));
    [
        s.fma(xx, half[0], s.mul(xy, half[1])),
        s.fma(xy, half[0], s.mul(yy, half[1])),
    ]
}

/// Whether there is one root at most in a window, a bit for each ray, and by how much a step
/// with the inverse derivatives in its middle may miss it, in lengths of the step.
///
/// From the middle the derivatives change by `E - g c`, with `c` the change of those of what
/// stands across the cell and `g` the tilt: only a product of two vectors grows with the tilt.
/// Multiplied by the inverse in the middle, with rows of `E` below `k`, one plus the change can
/// be inverted where `|g c| + k / (1 - k) |g| |c| < 1`, for all of the window at once.
#[inline(always)]
fn contraction<S: Simd, const RATIONAL: bool>(
    s: S,
    model: &Model,
    place: [S::F; 2],
    tilt: [S::F; 2],
    half: [S::F; 2],
    inverse: &Matrix<S::F>,
) -> (u32, S::F) {
    let one = s.splat(1.0);
    let [ax, ay] = change(s, model, 0, half);
    let [bx, by] = change(s, model, 1, half);
    let [cx, cy] = change(s, model, 2, half);
    let mut rows = [s.add(ax, ay), s.add(bx, by)];
    if RATIONAL {
        let [wx, wy] = change(s, model, 3, half);
        let weight = s.add(wx, wy);
        rows = [
            s.fma(s.abs(place[0]), weight, rows[0]),
            s.fma(s.abs(place[1]), weight, rows[1]),
        ];
    }
    let [k1, k2] = inverse.abs(s).times(s, rows);
    let along = s.max(k1, k2);
    let [g1, g2] = inverse.times(s, tilt);
    let (g1, g2) = (s.abs(g1), s.abs(g2));
    let across = s.mul(s.max(g1, g2), s.add(cx, cy));
    let growth = s.div(one, s.sub(one, along));
    let share = s.mul(along, growth);
    let product = s.fma(g1, cx, s.fma(g2, cy, s.mul(across, share)));
    let sure = s.splat(SURE);
    let unique = s.bits(s.lt(along, sure)) & s.bits(s.lt(product, sure));
    let rest = s.div(s.mul(growth, growth), s.sub(one, product));
    (unique, s.fma(across, rest, share))
}

/// The part of a cell in which the roots of a ray are.
struct Window<F> {
    low: [F; 2],
    high: [F; 2],
    middle: [F; 2],
    half: [F; 2],
}

impl<F: Copy> Window<F> {
    #[inline(always)]
    fn around<S: Simd<F = F>>(s: S, place: [F; 2], radius: [F; 2], border: F) -> Self {
        let minus = s.sub(s.splat(0.0), border);
        let mut window = Self {
            low: place,
            high: place,
            middle: place,
            half: place,
        };
        for k in 0..2 {
            let low = s.max(s.sub(place[k], radius[k]), minus);
            let high = s.min(s.add(place[k], radius[k]), border);
            window.middle[k] = s.mul(s.splat(0.5), s.add(low, high));
            window.half[k] = s.mul(s.splat(0.5), s.sub(high, low));
            (window.low[k], window.high[k]) = (low, high);
        }
        window
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
        place,
        tilt,
        radius,
        error,
    } = approach::<S, RATIONAL>(s, view, beam, group);
    let lanes = lanes & !beside;
    let mut verdict = Verdict::NONE;
    if lanes == 0 {
        return verdict;
    }
    let border = s.splat(1.0 + MARGIN);
    let Window {
        low,
        high,
        middle,
        half,
    } = Window::around(s, place, radius, border);
    let first = distance::<S, M, N, RATIONAL>(s, model, place, tilt, middle);
    let inverse = Matrix::inverse(s, &first);
    let (unique, contraction) = contraction::<S, RATIONAL>(s, model, place, tilt, half, &inverse);
    let [a, b, c, d] = inverse.abs(s).0;
    let growth = s.mul(
        s.max(s.add(a, b), s.add(c, d)),
        s.add(s.splat(1.0), contraction),
    );
    let amplified = s.mul(error, growth);
    let known = s.bits(s.lt(amplified, s.splat(BLURRED)));
    let mut active = lanes & unique & known;
    // Of a flat cell seen from its edge the parts are seen no better.
    let sharp = s.bits(s.lt(error, s.splat(BLURRED)));
    verdict.blurred = lanes & unique & !known;
    if view.bulge[2] < FLAT {
        verdict.blurred |= lanes & !sharp;
    }
    verdict.open = lanes & !active & !verdict.blurred;
    let mut x = middle;
    let mut now = first;
    for step in 0..STEPS {
        if active == 0 {
            break;
        }
        // A root is as far from where the step of the middle leads as that one may miss it.
        let sure = inverse.times(s, now.value);
        let length = s.max(s.abs(sure[0]), s.abs(sure[1]));
        let miss = s.fma(contraction, length, amplified);
        for k in 0..2 {
            let way = s.abs(s.sub(s.sub(x[k], sure[k]), middle[k]));
            active &= !s.bits(s.lt(s.add(half[k], miss), way));
        }
        if active == 0 {
            break;
        }
        let (newest, leap) = if step == 0 {
            (inverse, sure)
        } else {
            let newest = Matrix::inverse(s, &now);
            (newest, newest.times(s, now.value))
        };
        for k in 0..2 {
            x[k] = s.max(s.min(s.sub(x[k], leap[k]), high[k]), low[k]);
        }
        let close = s.le(s.max(s.abs(leap[0]), s.abs(leap[1])), s.splat(CLOSE));
        let arrived = active & s.bits(close);
        if arrived != 0 {
            let rest = newest.times(s, value::<S, M, N, RATIONAL>(s, model, place, tilt, x));
            let last = [s.sub(x[0], rest[0]), s.sub(x[1], rest[1])];
            let limit = s.add(border, amplified);
            let inside = s.bits(s.le(s.max(s.abs(last[0]), s.abs(last[1])), limit));
            let near = s.le(s.max(s.abs(rest[0]), s.abs(rest[1])), s.splat(CLOSE));
            let new = arrived & inside & s.bits(near);
            verdict.take(s, new, last);
            active &= !new;
            if active == 0 {
                break;
            }
        }
        now = distance::<S, M, N, RATIONAL>(s, model, place, tilt, x);
    }
    verdict.open |= active;
    verdict
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
