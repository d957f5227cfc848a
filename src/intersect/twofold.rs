//! Numbers of twice the precision, for the few questions that rounding hides.

use std::ops::{Add, Div, Mul, Sub};

use glam::DVec2;
use kernel::{KnotVector, MAX_DEGREE, Surface};

/// A sum of two numbers of which the second is below the rounding of the first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Twofold {
    high: f64,
    low: f64,
}

impl Twofold {
    /// The nearest number of simple precision.
    pub(super) fn rounded(self) -> f64 {
        self.high
    }

    /// A sum whose second part is the smaller one.
    fn of(high: f64, low: f64) -> Self {
        let sum = high + low;
        Self {
            high: sum,
            low: low - (sum - high),
        }
    }
}

/// What the rounded product of two numbers lacks \[Dekker 71\]. Without an instruction for it a fused
/// multiplication takes many times as long.
fn rest_of_product(a: f64, b: f64, product: f64) -> f64 {
    // Halves of the digits, whose products are exact.
    let halves = |x: f64| {
        let scaled = x * f64::from((1_u32 << 27) + 1);
        let high = scaled - (scaled - x);
        [high, x - high]
    };
    let ([a, c], [b, d]) = (halves(a), halves(b));
    c * d - (((product - a * b) - c * b) - a * d)
}

impl From<f64> for Twofold {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Add for Twofold {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let sum = self.high + other.high;
        let back = sum - self.high;
        let error = (self.high - (sum - back)) + (other.high - back);
        Self::of(sum, error + (self.low + other.low))
    }
}

impl Sub for Twofold {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        let Self { high, low } = other;
        self + Self {
            high: -high,
            low: -low,
        }
    }
}

impl Mul for Twofold {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let product = self.high * other.high;
        let error = rest_of_product(self.high, other.high, product);
        Self::of(
            product,
            error + (self.high * other.low + self.low * other.high),
        )
    }
}

impl Mul<f64> for Twofold {
    type Output = Self;

    fn mul(self, other: f64) -> Self {
        self * Self::from(other)
    }
}

impl Div for Twofold {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * first;
        let second = rest.high / other.high;
        let rest = rest - other * second;
        Self::of(first, second) + Self::from(rest.high / other.high)
    }
}

/// The point of a surface.
pub(super) fn point(surface: &Surface, uv: DVec2) -> [Twofold; 3] {
    let (u, v) = (surface.knots_u(), surface.knots_v());
    let (span_u, span_v) = (u.span(uv.x), v.span(uv.y));
    let (p, q) = (u.degree(), v.degree());
    let mut row = [[Twofold::default(); 4]; MAX_DEGREE + 1];
    let lines = surface.homogeneous().chunks_exact(v.count());
    for (to, line) in row.iter_mut().zip(lines.skip(span_u - p).take(p + 1)) {
        let mut along_v = [[Twofold::default(); 4]; MAX_DEGREE + 1];
        for (to, h) in along_v.iter_mut().zip(&line[span_v - q..=span_v]) {
            *to = h.to_array().map(Twofold::from);
        }
        *to = de_boor(v, span_v, uv.y, &mut along_v);
    }
    let [x, y, z, w] = de_boor(u, span_u, uv.x, &mut row);
    [x, y, z].map(|c| c / w)
}

/// The value of a spline from its control points of a span \[Ramshaw 89\].
fn de_boor(knots: &KnotVector, span: usize, t: f64, d: &mut [[Twofold; 4]]) -> [Twofold; 4] {
    let (p, knots) = (knots.degree(), knots.as_slice());
    for level in 1..=p {
        for k in (level..=p).rev() {
            let j = span - p + k;
            let [start, end] = [knots[j], knots[j + p + 1 - level]].map(Twofold::from);
            let share = (Twofold::from(t) - start) / (end - start);
            d[k] = std::array::from_fn(|c| d[k - 1][c] + (d[k][c] - d[k - 1][c]) * share);
        }
    }
    d[p]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn products_and_quotients_keep_their_digits() {
        let third = Twofold::from(1.0) / Twofold::from(3.0);
        let off = third * 3.0 - Twofold::from(1.0);
        assert!(off.rounded().abs() < 1e-31);
        let square = Twofold::from(1.0 + f64::EPSILON) * (1.0 + f64::EPSILON);
        let rest = square - Twofold::from(1.0 + 2.0 * f64::EPSILON);
        assert_eq!(rest, Twofold::from(f64::EPSILON * f64::EPSILON));
    }

    #[test]
    fn points_of_a_sphere_lie_on_it() {
        let half = std::f64::consts::FRAC_PI_2;
        let frame = kernel::modelling::Frame::about(DVec3::ZERO, DVec3::Z).unwrap();
        let sphere = kernel::modelling::sphere(&frame, 1.0, 0.0..4.0 * half, -half..half).unwrap();
        for k in 0..40 {
            let uv = DVec2::new(0.15 * f64::from(k), 0.07 * f64::from(k - 20));
            let exact = point(&sphere, uv).map(Twofold::rounded);
            assert!(sphere.evaluate(uv).distance(exact.into()) < 1e-15);
        }
        // A parabola with numbers that are exact: t^2 at a third.
        let knots = KnotVector::bezier(2, 0.0..1.0).unwrap();
        let other = KnotVector::bezier(1, 0.0..1.0).unwrap();
        let points = [0.0, 0.0, 1.0].map(|z| [DVec3::Z * z, DVec3::new(0.0, 1.0, z)]);
        let sheet = Surface::new(knots, other, &points.concat(), None).unwrap();
        let t = 1.0 / 3.0;
        let [_, _, z] = point(&sheet, DVec2::new(t, 0.5));
        let rest = z - Twofold::from(t) * t;
        assert!(rest.rounded().abs() < 1e-31);
    }
}
