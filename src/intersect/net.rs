//! Bernstein arithmetic on the small nets of the leaf solver.
//!
//! A net is a flat slice: the coefficient of column `i` along u and `j` along v is at
//! `i * (q + 1) + j`. Nothing here allocates.

use kernel::MAX_DEGREE;

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

/// Value and both first derivatives of a net, from the Bernstein rows of u and v.
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

/// De Casteljau's algorithm along u. Before, both nets hold the same coefficients; after,
/// `left` belongs to the part before `t` and `right` to the part behind it.
pub(crate) fn split_u(left: &mut [f64], right: &mut [f64], degrees: Degrees, t: f64) {
    let row = degrees.q + 1;
    for level in 1..=degrees.p {
        for k in 0..(degrees.p + 1 - level) * row {
            right[k] += (right[k + row] - right[k]) * t;
        }
        left[level * row..(level + 1) * row].copy_from_slice(&right[..row]);
    }
}

/// As [`split_u`], along v.
pub(crate) fn split_v(left: &mut [f64], right: &mut [f64], degrees: Degrees, t: f64) {
    let row = degrees.q + 1;
    for (left, right) in left.chunks_exact_mut(row).zip(right.chunks_exact_mut(row)) {
        for (level, coefficient) in left.iter_mut().enumerate().skip(1) {
            for k in 0..=degrees.q - level {
                right[k] += (right[k + 1] - right[k]) * t;
            }
            *coefficient = right[0];
        }
    }
}

/// Replaces a net by its part over `u.0..u.1` and `v.0..v.1` in local parameters.
///
/// `spare` has the length of the net; what it holds is overwritten.
pub(crate) fn restrict(
    net: &mut [f64],
    spare: &mut [f64],
    degrees: Degrees,
    u: (f64, f64),
    v: (f64, f64),
) {
    type Split = fn(&mut [f64], &mut [f64], Degrees, f64);
    for (split, (start, end)) in [(split_u as Split, u), (split_v as Split, v)] {
        if end < 1.0 {
            spare.copy_from_slice(net);
            split(net, spare, degrees, end);
        }
        if start > 0.0 {
            spare.copy_from_slice(net);
            split(spare, net, degrees, start / end);
        }
    }
}

/// Least and greatest coefficient.
pub(crate) fn range(net: &[f64]) -> (f64, f64) {
    let start = (f64::INFINITY, f64::NEG_INFINITY);
    net.iter()
        .fold(start, |(min, max), &c| (min.min(c), max.max(c)))
}

/// The largest steps between neighbouring coefficients, along u and along v.
pub(crate) fn variation(net: &[f64], degrees: Degrees) -> (f64, f64) {
    let row = degrees.q + 1;
    let along_u = net
        .iter()
        .zip(&net[row..])
        .fold(0.0, |max: f64, (a, b)| max.max((b - a).abs()));
    let along_v = net
        .chunks_exact(row)
        .flat_map(|line| line.windows(2))
        .fold(0.0, |max: f64, pair| max.max((pair[1] - pair[0]).abs()));
    (along_u, along_v)
}

/// How far the derivatives of a net stray from given constants, along u and along v.
pub(crate) fn deviation(net: &[f64], degrees: Degrees, du: f64, dv: f64) -> f64 {
    let row = degrees.q + 1;
    let (p, q) = (degrees.p as f64, degrees.q as f64);
    let along_u = net
        .iter()
        .zip(&net[row..])
        .fold(0.0, |max: f64, (a, b)| max.max((p * (b - a) - du).abs()));
    let along_v = net
        .chunks_exact(row)
        .flat_map(|line| line.windows(2))
        .fold(0.0, |max: f64, pair| {
            max.max((q * (pair[1] - pair[0]) - dv).abs())
        });
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
