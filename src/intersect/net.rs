//! Bernstein arithmetic on the small nets of the leaf solver.
//!
//! A net is a flat slice: the coefficient of column `i` along u and `j` along v is at
//! `i * (q + 1) + j`. Nothing here allocates.

use std::sync::LazyLock;

use glam::DVec4;
use kernel::MAX_DEGREE;

use super::PieceNet;

/// Bernstein values of one degree, the first `degree + 1` of them in use.
pub(crate) type Row = [f64; MAX_DEGREE + 1];

/// Degrees of a net along u and v.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Degrees {
    pub(crate) p: usize,
    pub(crate) q: usize,
}

impl Degrees {
    /// Number of coefficients.
    pub(crate) fn len(self) -> usize {
        (self.p + 1) * (self.q + 1)
    }
}

/// Bernstein polynomials and their derivatives at `t`.
#[inline(always)]
pub(crate) fn bernstein(degree: usize, t: f64) -> [Row; 2] {
    let (mut value, mut derivative) = ([0.0; MAX_DEGREE + 1], [0.0; MAX_DEGREE + 1]);
    value[0] = 1.0;
    for d in 1..=degree {
        if d == degree {
            let scale = degree as f64;
            derivative[0] = -scale * value[0];
            for k in 1..degree {
                derivative[k] = scale * (value[k - 1] - value[k]);
            }
            derivative[degree] = scale * value[degree - 1];
        }
        let mut carried = 0.0;
        for slot in &mut value[..d] {
            let old = *slot;
            *slot = carried + (1.0 - t) * old;
            carried = t * old;
        }
        value[d] = carried;
    }
    [value, derivative]
}

/// [`bernstein`] of every degree at one half.
pub(crate) static HALF: LazyLock<Vec<[Row; 2]>> = LazyLock::new(|| {
    (0..=MAX_DEGREE)
        .map(|degree| bernstein(degree, 0.5))
        .collect()
});

/// Value and both first derivatives of a net, from the Bernstein rows of u and v.
#[inline(always)]
pub(crate) fn evaluate(net: &[f64], degrees: Degrees, u: &[Row; 2], v: &[Row; 2]) -> [f64; 3] {
    let row = degrees.q + 1;
    let mut sums = [0.0; 3];
    for (i, coefficients) in net.chunks_exact(row).enumerate() {
        let (mut value, mut along_v) = (0.0, 0.0);
        for ((&c, &b), &db) in coefficients.iter().zip(&v[0]).zip(&v[1]) {
            value += c * b;
            along_v += c * db;
        }
        sums[0] += value * u[0][i];
        sums[1] += value * u[1][i];
        sums[2] += along_v * u[0][i];
    }
    sums
}

/// A coefficient: a number, or the coordinates of a point.
pub(crate) trait Coefficient: Copy {
    /// The point between `self` and `other` at `t`.
    #[must_use]
    fn towards(self, other: Self, t: f64) -> Self;
}

impl Coefficient for f64 {
    #[inline(always)]
    fn towards(self, other: Self, t: f64) -> Self {
        self + (other - self) * t
    }
}

impl<const K: usize> Coefficient for [f64; K] {
    #[inline(always)]
    fn towards(self, other: Self, t: f64) -> Self {
        std::array::from_fn(|k| self[k] + (other[k] - self[k]) * t)
    }
}

/// Point and first derivatives of a net of points, from the Bernstein rows of u and v.
#[inline(always)]
fn evaluate_rows<const K: usize>(
    net: &[[f64; K]],
    degrees: Degrees,
    u: &[Row; 2],
    v: &[Row; 2],
) -> [[f64; K]; 3] {
    let mut sums = [[0.0; K]; 3];
    for (i, line) in net.chunks_exact(degrees.q + 1).enumerate() {
        let (mut value, mut along_v) = ([0.0; K], [0.0; K]);
        for (j, point) in line.iter().enumerate() {
            for k in 0..K {
                value[k] += point[k] * v[0][j];
                along_v[k] += point[k] * v[1][j];
            }
        }
        for k in 0..K {
            sums[0][k] += value[k] * u[0][i];
            sums[1][k] += value[k] * u[1][i];
            sums[2][k] += along_v[k] * u[0][i];
        }
    }
    sums
}

/// Homogeneous point and first derivatives of a piece in its local parameters.
#[inline(always)]
pub(crate) fn evaluate_at(piece: &PieceNet<'_>, u: f64, v: f64) -> [DVec4; 3] {
    evaluate_points(piece.points, piece.degrees, u, v).map(DVec4::from_array)
}

/// Point and first derivatives of a net of points; the derivatives cost nothing where they are
/// not used.
#[inline(always)]
pub(crate) fn evaluate_points<const K: usize>(
    net: &[[f64; K]],
    degrees: Degrees,
    u: f64,
    v: f64,
) -> [[f64; K]; 3] {
    macro_rules! by_degree {
        ($($p:literal, $q:literal;)*) => {
            match (degrees.p, degrees.q) {
                $(($p, $q) => evaluate_fixed::<{ $p + 1 }, { $q + 1 }, K>(net, u, v),)*
                (p, q) => evaluate_rows(net, degrees, &bernstein(p, u), &bernstein(q, v)),
            }
        };
    }
    by_degree! { 1, 1; 1, 2; 1, 3; 2, 1; 2, 2; 2, 3; 3, 1; 3, 2; 3, 3; }
}

/// As [`evaluate_rows`], for orders known at compile time.
#[inline(always)]
fn evaluate_fixed<const M: usize, const N: usize, const K: usize>(
    net: &[[f64; K]],
    u: f64,
    v: f64,
) -> [[f64; K]; 3] {
    let (bu, du) = bernstein_fixed::<M>(u);
    let (bv, dv) = bernstein_fixed::<N>(v);
    let mut sums = [[0.0; K]; 3];
    for i in 0..M {
        let (mut value, mut along_v) = ([0.0; K], [0.0; K]);
        for j in 0..N {
            let point = &net[i * N + j];
            for k in 0..K {
                value[k] += point[k] * bv[j];
                along_v[k] += point[k] * dv[j];
            }
        }
        for k in 0..K {
            sums[0][k] += value[k] * bu[i];
            sums[1][k] += value[k] * du[i];
            sums[2][k] += along_v[k] * bu[i];
        }
    }
    sums
}

/// Bernstein polynomials and derivatives of order `N` at `t`.
#[inline(always)]
fn bernstein_fixed<const N: usize>(t: f64) -> ([f64; N], [f64; N]) {
    let (mut value, mut derivative) = ([0.0; N], [0.0; N]);
    value[0] = 1.0;
    let s = 1.0 - t;
    for d in 1..N {
        if d == N - 1 {
            let scale = d as f64;
            derivative[0] = -scale * value[0];
            for k in 1..d {
                derivative[k] = scale * (value[k - 1] - value[k]);
            }
            derivative[d] = scale * value[d - 1];
        }
        value[d] = t * value[d - 1];
        for k in (1..d).rev() {
            value[k] = s * value[k] + t * value[k - 1];
        }
        value[0] *= s;
    }
    (value, derivative)
}

/// De Casteljau's algorithm along u. Before, both nets hold the same coefficients; after,
/// `left` belongs to the part before `t` and `right` to the part behind it.
#[inline(always)]
pub(crate) fn split_u<C: Coefficient>(left: &mut [C], right: &mut [C], degrees: Degrees, t: f64) {
    let row = degrees.q + 1;
    for level in 1..=degrees.p {
        for k in 0..(degrees.p + 1 - level) * row {
            right[k] = right[k].towards(right[k + row], t);
        }
        left[level * row..(level + 1) * row].copy_from_slice(&right[..row]);
    }
}

/// As [`split_u`], along v.
#[inline(always)]
pub(crate) fn split_v<C: Coefficient>(left: &mut [C], right: &mut [C], degrees: Degrees, t: f64) {
    let row = degrees.q + 1;
    for (left, right) in left.chunks_exact_mut(row).zip(right.chunks_exact_mut(row)) {
        for (level, coefficient) in left.iter_mut().enumerate().skip(1) {
            for k in 0..=degrees.q - level {
                right[k] = right[k].towards(right[k + 1], t);
            }
            *coefficient = right[0];
        }
    }
}

/// Replaces a net by its part over `u.0..u.1` and `v.0..v.1` in local parameters.
///
/// `spare` has the length of the net; what it holds is overwritten.
#[inline(always)]
pub(crate) fn restrict<C: Coefficient>(
    net: &mut [C],
    spare: &mut [C],
    degrees: Degrees,
    u: (f64, f64),
    v: (f64, f64),
) {
    if u.1 < 1.0 {
        spare.copy_from_slice(net);
        split_u(net, spare, degrees, u.1);
    }
    if u.0 > 0.0 {
        spare.copy_from_slice(net);
        split_u(spare, net, degrees, u.0 / u.1);
    }
    if v.1 < 1.0 {
        spare.copy_from_slice(net);
        split_v(net, spare, degrees, v.1);
    }
    if v.0 > 0.0 {
        spare.copy_from_slice(net);
        split_v(spare, net, degrees, v.0 / v.1);
    }
}

/// Comparisons side by side, so that none waits for the one before.
const CHAINS: usize = 4;

/// The lesser; `a` where `b` is not a number.
#[inline(always)]
fn lesser(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}

/// The greater; `a` where `b` is not a number.
#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// The greatest of values; zero if there is none above.
#[inline(always)]
fn greatest(values: impl Iterator<Item = f64>) -> f64 {
    let mut most = [0.0; CHAINS];
    for (k, value) in values.enumerate() {
        most[k % CHAINS] = greater(most[k % CHAINS], value);
    }
    greater(greater(most[0], most[1]), greater(most[2], most[3]))
}

/// Least and greatest coefficient.
#[inline(always)]
pub(crate) fn range(net: &[f64]) -> (f64, f64) {
    let (mut low, mut high) = ([f64::INFINITY; CHAINS], [f64::NEG_INFINITY; CHAINS]);
    let (many, rest) = net.as_chunks::<CHAINS>();
    for four in many {
        for k in 0..CHAINS {
            (low[k], high[k]) = (lesser(low[k], four[k]), greater(high[k], four[k]));
        }
    }
    for &c in rest {
        (low[0], high[0]) = (lesser(low[0], c), greater(high[0], c));
    }
    let ([a, b, c, d], [e, f, g, h]) = (low, high);
    (
        lesser(lesser(a, b), lesser(c, d)),
        greater(greater(e, f), greater(g, h)),
    )
}

/// The largest steps between neighbouring coefficients, along u and along v.
#[inline(always)]
pub(crate) fn variation(net: &[f64], degrees: Degrees) -> (f64, f64) {
    let row = degrees.q + 1;
    let along_u = greatest(net.iter().zip(&net[row..]).map(|(a, b)| (b - a).abs()));
    let steps = |line: &[f64]| greatest(line.iter().zip(&line[1..]).map(|(a, b)| (b - a).abs()));
    let along_v = greatest(net.chunks_exact(row).map(steps));
    (along_u, along_v)
}

/// Bounds of the derivative of a net along u, or along v.
pub(crate) fn slopes(net: &[f64], degrees: Degrees, along_u: bool) -> (f64, f64) {
    let row = degrees.q + 1;
    let bounds = (f64::INFINITY, f64::NEG_INFINITY);
    let wider = |(low, high): (f64, f64), slope: f64| (low.min(slope), high.max(slope));
    if along_u {
        let slopes = net.iter().zip(&net[row..]);
        let slopes = slopes.map(|(a, b)| degrees.p as f64 * (b - a));
        return slopes.fold(bounds, wider);
    }
    let lines = net.chunks_exact(row);
    let slopes = lines.flat_map(|line| line.iter().zip(&line[1..]));
    let slopes = slopes.map(|(a, b)| degrees.q as f64 * (b - a));
    slopes.fold(bounds, wider)
}

/// How far the derivatives of a net stray from given constants, along u and along v.
#[inline(always)]
pub(crate) fn deviation(net: &[f64], degrees: Degrees, du: f64, dv: f64) -> f64 {
    let row = degrees.q + 1;
    let (p, q) = (degrees.p as f64, degrees.q as f64);
    let stray_u = |(a, b): (&f64, &f64)| (p * (b - a) - du).abs();
    let along_u = greatest(net.iter().zip(&net[row..]).map(stray_u));
    let stray_v = |(a, b): (&f64, &f64)| (q * (b - a) - dv).abs();
    let strays = |line: &[f64]| greatest(line.iter().zip(&line[1..]).map(stray_v));
    let along_v = greatest(net.chunks_exact(row).map(strays));
    along_u + along_v
}

#[cfg(test)]
mod tests {
    use super::*;

    const BIQUADRATIC: Degrees = Degrees { p: 2, q: 2 };

    fn value(net: &[f64], u: f64, v: f64) -> [f64; 3] {
        evaluate(net, BIQUADRATIC, &bernstein(2, u), &bernstein(2, v))
    }

    #[test]
    fn derivatives_are_those_of_the_polynomial() {
        // u^2 v as Bernstein coefficients.
        let net = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 1.0];
        let [f, fu, fv] = value(&net, 0.5, 0.25);
        assert!((f - 0.0625).abs() < 1e-16);
        assert!((fu - 0.25).abs() < 1e-16);
        assert!((fv - 0.25).abs() < 1e-16);
    }

    #[test]
    fn restriction_keeps_the_values() {
        let whole: Vec<f64> = (0..9).map(|k| f64::from(k * k % 7) - 2.0).collect();
        let (mut part, mut spare) = (whole.clone(), whole.clone());
        restrict(
            &mut part,
            &mut spare,
            BIQUADRATIC,
            (0.25, 0.75),
            (0.5, 0.625),
        );
        for (s, t) in [(0.0, 0.0), (0.3, 0.9), (1.0, 1.0)] {
            let expected = value(&whole, 0.25 + 0.5 * s, 0.5 + 0.125 * t)[0];
            assert!((value(&part, s, t)[0] - expected).abs() < 1e-14);
        }
    }
}
