//! How far the points of a cell are from rays, and Newton's step, sixteen rays at a time.

use super::expansion::{ORDER, TERMS};
use crate::simd::{PerLane, Singles};

/// The cells that sixteen rays are in: one and the same for all, or one for each.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Cells<C> {
    /// See [`super::expansion::Expansion::terms`].
    pub(super) terms: [[C; 4]; TERMS],
    /// See [`super::expansion::Expansion::second`].
    pub(super) second: [[C; 4]; 3],
    /// See [`super::leaving`]: how steep rays must be to leave it, and what terms that are not kept add.
    pub(super) reach: [C; 2],
    pub(super) higher: C,
    /// A bit for each that is flat: seen from the edge, its parts are seen no better.
    pub(super) flat: u32,
}

/// What a polynomial of a cell is at a point, and its derivatives.
pub(super) struct Jet<F> {
    pub(super) value: F,
    pub(super) by_x: F,
    pub(super) by_y: F,
}

/// Coordinate `r` of the cell at `x`, `y`: Horner's rule for value and derivatives.
#[inline(always)]
pub(super) fn jet<S: Singles, C: PerLane<S, Lanes = S::F>>(
    s: S,
    cells: &Cells<C>,
    r: usize,
    x: S::F,
    y: S::F,
) -> Jet<S::F> {
    let (mut value, mut by_y) = line(s, cells, r, ORDER - 1, y);
    let mut by_x = s.splat(0.0);
    for i in (0..ORDER - 1).rev() {
        let (next, next_by_y) = line(s, cells, r, i, y);
        by_x = if i == ORDER - 2 {
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
fn line<S: Singles, C: PerLane<S, Lanes = S::F>>(
    s: S,
    cells: &Cells<C>,
    r: usize,
    i: usize,
    y: S::F,
) -> (S::F, S::F) {
    let term = |j: usize| cells.terms[i * ORDER + j][r].lanes(s);
    let (mut value, mut by_y) = (term(ORDER - 1), s.splat(0.0));
    for j in (0..ORDER - 1).rev() {
        by_y = if j == ORDER - 2 {
            value
        } else {
            s.fma(by_y, y, value)
        };
        value = s.fma(value, y, term(j));
    }
    (value, by_y)
}

/// As [`jet`], the value alone.
#[inline(always)]
fn at<S: Singles, C: PerLane<S, Lanes = S::F>>(
    s: S,
    cells: &Cells<C>,
    r: usize,
    x: S::F,
    y: S::F,
) -> S::F {
    let mut value = s.splat(0.0);
    for i in (0..ORDER).rev() {
        let term = |j: usize| cells.terms[i * ORDER + j][r].lanes(s);
        let mut line = term(ORDER - 1);
        for j in (0..ORDER - 1).rev() {
            line = s.fma(line, y, term(j));
        }
        value = if i == ORDER - 1 {
            line
        } else {
            s.fma(value, x, line)
        };
    }
    value
}

/// The second derivatives of coordinate `r`: by `x` twice, by both, by `y` twice.
#[inline(always)]
pub(super) fn hessian<S: Singles, C: PerLane<S, Lanes = S::F>>(
    s: S,
    cells: &Cells<C>,
    r: usize,
    [x, y]: [S::F; 2],
) -> [S::F; 3] {
    let mut sums = [s.splat(0.0); 3];
    for i in (0..ORDER).rev() {
        let term = |j: usize| cells.terms[i * ORDER + j][r].lanes(s);
        let (c, d) = (term(2), term(3));
        let (value, by_y) = line(s, cells, r, i, y);
        let second = s.fma(s.mul(s.splat(6.0), d), y, s.add(c, c));
        let [xx, xy, yy] = &mut sums;
        if i > 1 {
            let count = s.splat((i * (i - 1)) as f32);
            *xx = s.fma(*xx, x, s.mul(count, value));
        }
        if i > 0 {
            *xy = s.fma(*xy, x, s.mul(s.splat(i as f32), by_y));
        }
        *yy = s.fma(*yy, x, second);
    }
    sums
}

/// The distances of a cell's point from a ray along both its axes, and their derivatives.
#[derive(Clone, Copy)]
pub(super) struct Distance<F> {
    pub(super) value: [F; 2],
    pub(super) by_x: [F; 2],
    pub(super) by_y: [F; 2],
}

#[inline(always)]
pub(super) fn distance<S: Singles, C: PerLane<S, Lanes = S::F>, const RATIONAL: bool>(
    s: S,
    cells: &Cells<C>,
    [x0, y0]: [S::F; 2],
    [g1, g2]: [S::F; 2],
    [x, y]: [S::F; 2],
) -> Distance<S::F> {
    let a = jet(s, cells, 0, x, y);
    let b = jet(s, cells, 1, x, y);
    let c = jet(s, cells, 2, x, y);
    let mut value = [s.fnma(g1, c.value, a.value), s.fnma(g2, c.value, b.value)];
    let mut by_x = [s.fnma(g1, c.by_x, a.by_x), s.fnma(g2, c.by_x, b.by_x)];
    let mut by_y = [s.fnma(g1, c.by_y, a.by_y), s.fnma(g2, c.by_y, b.by_y)];
    if RATIONAL {
        let w = jet(s, cells, 3, x, y);
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
pub(super) fn value<S: Singles, C: PerLane<S, Lanes = S::F>, const RATIONAL: bool>(
    s: S,
    cells: &Cells<C>,
    [x0, y0]: [S::F; 2],
    [g1, g2]: [S::F; 2],
    [x, y]: [S::F; 2],
) -> [S::F; 2] {
    let c = at(s, cells, 2, x, y);
    let f1 = s.fnma(g1, c, at(s, cells, 0, x, y));
    let f2 = s.fnma(g2, c, at(s, cells, 1, x, y));
    if RATIONAL {
        let w = at(s, cells, 3, x, y);
        [s.fnma(x0, w, f1), s.fnma(y0, w, f2)]
    } else {
        [s.sub(f1, x0), s.sub(f2, y0)]
    }
}

/// A 2 x 2 matrix for each ray, row by row.
#[derive(Clone, Copy)]
pub(super) struct Matrix<F>(pub(super) [F; 4]);

impl<F: Copy> Matrix<F> {
    /// The inverse of the derivatives.
    #[inline(always)]
    pub(super) fn inverse<S: Singles<F = F>>(
        s: S,
        Distance { by_x, by_y, .. }: &Distance<F>,
    ) -> Self {
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
    pub(super) fn times<S: Singles<F = F>>(&self, s: S, [x, y]: [F; 2]) -> [F; 2] {
        let [a, b, c, d] = self.0;
        [s.fma(a, x, s.mul(b, y)), s.fma(c, x, s.mul(d, y))]
    }

    /// The sizes of the entries.
    #[inline(always)]
    pub(super) fn abs<S: Singles<F = F>>(&self, s: S) -> Self {
        let [a, b, c, d] = self.0;
        Self([s.abs(a), s.abs(b), s.abs(c), s.abs(d)])
    }
}
