//! Bounds of derivatives where weights are products of one along u and one along v: on planes,
//! cylinders, cones, spheres and tori, and on all that is extruded or turned about an axis.
//!
//! There `S` is the sum of `R_i(u) T_j(v) P_ij` with rational bases. Its derivatives along u lie
//! between those of rows of points, which are rational curves with the same weights: all that
//! products have to be made of are weights along one axis.
//!
//! With `a_i` the weights times binomial coefficients and `w` their polynomial, the derivative of a
//! curve is `M / w^2`, where `M` has the coefficients `(k - i) a_i a_k (P_k - P_i)`, and the second
//! one is `(M' w - 2 M w') / w^3`. Coefficients have their binomial coefficients as factors.

use std::ops::Range;

use glam::DVec4;
use kernel::BezierSurface;

use super::net::{cut, share};
use super::pieces::{Ball, Spread};
use crate::simd::{Simd, Task};

/// Points along an axis, at most.
const MOST: usize = 4;

/// Coefficients of the square of a polynomial with as many, and of its third power.
const SQUARE: usize = 2 * MOST - 1;
const CUBE: usize = 3 * MOST - 2;

/// Weights that differ from products by less than this share are products.
const ROUNDING: f64 = 1e-14;

/// The reciprocals of the binomial coefficients of each degree.
const INVERSE: [[f64; CUBE]; CUBE] = {
    let mut table = [[0.0; CUBE]; CUBE];
    let mut degree = 0;
    while degree < CUBE {
        let (mut value, mut k) = (1.0, 0);
        while k <= degree {
            table[degree][k] = 1.0 / value;
            value = value * (degree - k) as f64 / (k + 1) as f64;
            k += 1;
        }
        degree += 1;
    }
    table
};

/// Whether bounds of a piece can be had here: weights are products, and degrees not too high.
pub(super) fn is_separable(piece: &BezierSurface) -> bool {
    let (p, q) = (piece.degree_u(), piece.degree_v());
    let first = &piece.homogeneous()[..=q];
    let is_product = |row: &[DVec4]| {
        row.iter().zip(first).all(|(own, below)| {
            let (have, want) = (own.w * first[0].w, row[0].w * below.w);
            (have - want).abs() <= ROUNDING * want
        })
    };
    p.max(q) < MOST && piece.homogeneous().chunks_exact(q + 1).all(is_product)
}

/// The task to bound derivatives over a part of a [separable](is_separable) piece.
pub(super) struct Separable<'a> {
    pub(super) piece: &'a BezierSurface,
    pub(super) part: [Range<f64>; 2],
}

impl Task for Separable<'_> {
    type Output = Spread;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Spread {
        // Loops of known length are several times faster.
        match (self.piece.degree_u(), self.piece.degree_v()) {
            (1, 1) => self.spread::<2, 2>(),
            (1, 2) => self.spread::<2, 3>(),
            (1, 3) => self.spread::<2, 4>(),
            (2, 1) => self.spread::<3, 2>(),
            (2, 2) => self.spread::<3, 3>(),
            (2, 3) => self.spread::<3, 4>(),
            (3, 1) => self.spread::<4, 2>(),
            (3, 2) => self.spread::<4, 3>(),
            _ => self.spread::<4, 4>(),
        }
    }
}

impl Separable<'_> {
    #[inline(always)]
    fn spread<const U: usize, const V: usize>(self) -> Spread {
        let [u, v] = &self.part;
        let (whole_u, whole_v) = (self.piece.u(), self.piece.v());
        let (from_u, to_u) = (share(u.start, &whole_u), share(u.end, &whole_u));
        let (from_v, to_v) = (share(v.start, &whole_v), share(v.end, &whole_v));
        let mut net = [[DVec4::ZERO; V]; U];
        let points = net.as_flattened_mut();
        points.copy_from_slice(self.piece.homogeneous());
        for j in 0..V {
            cut(&mut points[j..], U - 1, V, from_u, to_u);
        }
        for row in points.chunks_exact_mut(V) {
            cut(row, V - 1, 1, from_v, to_v);
        }
        // A part without width is one row of points, and tells about its own direction only.
        let (is_line_u, is_line_v) = (u.start < u.end, v.start < v.end);
        let steps = [(u.end - u.start).recip(), (v.end - v.start).recip()];
        match (is_line_u, is_line_v) {
            (true, true) => bounds(&net, steps),
            (true, false) => {
                let mut column = [[DVec4::ZERO; 1]; U];
                for i in 0..U {
                    column[i][0] = net[i][0];
                }
                bounds(&column, steps)
            }
            (false, true) => bounds(&[net[0]], steps),
            (false, false) => Spread::default(),
        }
    }
}

/// A polynomial of weights along an axis, and its powers.
struct Weights<const N: usize> {
    own: [f64; N],
    square: [f64; SQUARE],
    cube: [f64; CUBE],
    /// The share of each point in the middle.
    middle: [f64; N],
}

impl<const N: usize> Weights<N> {
    #[inline(always)]
    fn new(mut own: [f64; N]) -> Self {
        let (mut square, mut cube) = ([0.0; SQUARE], [0.0; CUBE]);
        let mut sum = 0.0;
        for k in 0..N {
            own[k] /= INVERSE[N - 1][k];
            sum += own[k];
        }
        for i in 0..N {
            for k in 0..N {
                square[i + k] += own[i] * own[k];
            }
        }
        for i in 0..2 * N - 1 {
            for k in 0..N {
                cube[i + k] += square[i] * own[k];
            }
        }
        let mut middle = own;
        for share in &mut middle {
            *share /= sum;
        }
        Self {
            own,
            square,
            cube,
            middle,
        }
    }
}

/// Points of all rows, or of all columns.
type Row<const L: usize> = [DVec4; L];

/// Bounds with a net of homogeneous points; `steps` is what to multiply derivatives along u and v with.
#[inline(always)]
fn bounds<const U: usize, const V: usize>(net: &[Row<V>; U], [du, dv]: [f64; 2]) -> Spread {
    let (mut points, mut turned) = ([[DVec4::ZERO; V]; U], [[DVec4::ZERO; U]; V]);
    let (mut a, mut b) = ([0.0; U], [0.0; V]);
    for i in 0..U {
        a[i] = net[i][0].w;
        for j in 0..V {
            b[j] = net[0][j].w;
            points[i][j] = net[i][j] / net[i][j].w;
            turned[j][i] = points[i][j];
        }
    }
    let (a, b) = (Weights::new(a), Weights::new(b));
    let mut spread = Spread::default();
    if U > 1 {
        let mut first = [[DVec4::ZERO; V]; SQUARE];
        differentiate(&points, &a.own, &mut first);
        if V > 1 {
            spread.duv = mixed(&first, &a, &b).scaled(du * dv);
        }
        let [once, twice] = along(first, &a, &b.middle);
        spread.du = once.scaled(du);
        spread.duu = twice.scaled(du * du);
    }
    if V > 1 {
        let mut first = [[DVec4::ZERO; U]; SQUARE];
        differentiate(&turned, &b.own, &mut first);
        let [once, twice] = along(first, &b, &a.middle);
        spread.dv = once.scaled(dv);
        spread.dvv = twice.scaled(dv * dv);
    }
    spread
}

/// The first derivatives of curves, times the square of their weight: `2 N - 3` coefficients.
#[inline(always)]
fn differentiate<const N: usize, const L: usize>(
    points: &[Row<L>; N],
    own: &[f64; N],
    sum: &mut [Row<L>; SQUARE],
) {
    for k in 1..N {
        for i in 0..k {
            let factor = (k - i) as f64 * own[i] * own[k];
            for l in 0..L {
                sum[i + k - 1][l] += (points[k][l] - points[i][l]) * factor;
            }
        }
    }
}

/// Where the first and second derivatives of what lies between curves are, from those of the curves; in
/// the middle these have some shares in it.
#[inline(always)]
fn along<const N: usize, const L: usize>(
    mut first: [Row<L>; SQUARE],
    weights: &Weights<N>,
    shares: &[f64; L],
) -> [Ball; 2] {
    let mut second = [[DVec4::ZERO; L]; CUBE];
    for r in 0..2 * N - 3 {
        for i in 0..N {
            let lower = (r as f64 - 2.0 * i as f64) * weights.own[i];
            let upper = lower + 2.0 * weights.own[i];
            for l in 0..L {
                if r + i > 0 {
                    second[r + i - 1][l] += first[r][l] * lower;
                }
                if r + i < 3 * N - 5 {
                    second[r + i][l] += first[r][l] * upper;
                }
            }
        }
    }
    raise(&mut first, 2 * N - 3, 2);
    raise(&mut second, 3 * N - 5, 3);
    [
        quotient(&first, &weights.square, 2 * (N - 1), shares),
        quotient(&second, &weights.cube, 3 * (N - 1), shares),
    ]
}

/// Raises the degree, with so many coefficients, by some: `1 + t` is what multiplies them.
#[inline(always)]
fn raise<const L: usize>(net: &mut [Row<L>], count: usize, by: usize) {
    for raised in 0..by {
        for k in (1..=count + raised).rev() {
            let [.., below, own] = &mut net[..=k] else {
                continue;
            };
            for (own, below) in own.iter_mut().zip(below) {
                *own += *below;
            }
        }
    }
}

/// Where what lies between the quotients of some rows and a power of weights of a degree is.
#[inline(always)]
fn quotient<const L: usize>(
    rows: &[Row<L>],
    power: &[f64],
    degree: usize,
    shares: &[f64; L],
) -> Ball {
    let (mut top, mut bottom, mut least) = (DVec4::ZERO, 0.0, f64::INFINITY);
    for k in 0..=degree {
        for (point, share) in rows[k].iter().zip(shares) {
            top += *point * *share;
        }
        bottom += power[k];
        least = least.min(power[k] * INVERSE[degree][k]);
    }
    let center = top / bottom;
    let mut most = 0.0_f64;
    for k in 0..=degree {
        let near = center * power[k];
        let factor = INVERSE[degree][k] * INVERSE[degree][k];
        for point in &rows[k] {
            most = most.max((*point - near).length_squared() * factor);
        }
    }
    Ball {
        center: center.truncate(),
        radius: most.sqrt() / least,
    }
}

/// Where mixed derivatives are, from the first ones along u.
#[inline(always)]
fn mixed<const U: usize, const V: usize>(
    along_u: &[Row<V>; SQUARE],
    a: &Weights<U>,
    b: &Weights<V>,
) -> Ball {
    let mut net = [[DVec4::ZERO; SQUARE]; SQUARE];
    for r in 0..2 * U - 3 {
        for k in 1..V {
            for i in 0..k {
                let factor = (k - i) as f64 * b.own[i] * b.own[k];
                net[r][i + k - 1] += (along_u[r][k] - along_u[r][i]) * factor;
            }
        }
        for raised in 2 * V - 3..2 * V - 1 {
            for k in (1..=raised).rev() {
                let below = net[r][k - 1];
                net[r][k] += below;
            }
        }
    }
    raise(&mut net, 2 * U - 3, 2);
    let (mut top, mut sums) = (DVec4::ZERO, [0.0; 2]);
    let mut least = [f64::INFINITY; 2];
    for k in 0..2 * U - 1 {
        sums[0] += a.square[k];
        least[0] = least[0].min(a.square[k] * INVERSE[2 * U - 2][k]);
        for point in &net[k][..2 * V - 1] {
            top += *point;
        }
    }
    for (power, inverse) in b.square[..2 * V - 1].iter().zip(&INVERSE[2 * V - 2]) {
        sums[1] += power;
        least[1] = least[1].min(power * inverse);
    }
    let center = top / (sums[0] * sums[1]);
    let mut most = 0.0_f64;
    for k in 0..2 * U - 1 {
        for l in 0..2 * V - 1 {
            let off = net[k][l] - center * (a.square[k] * b.square[l]);
            let factor = INVERSE[2 * U - 2][k] * INVERSE[2 * V - 2][l];
            most = most.max(off.length_squared() * (factor * factor));
        }
    }
    Ball {
        center: center.truncate(),
        radius: most.sqrt() / (least[0] * least[1]),
    }
}
