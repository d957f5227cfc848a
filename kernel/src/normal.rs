//! Normals, also where the first derivatives vanish.
//!
//! A limit is read off the control points instead of stepping aside by a small distance: a
//! step that suits every scale and every kind of degeneracy does not exist.

use std::ops::Range;

use glam::{DAffine3, DMat3, DVec2, DVec3, DVec4, Vec4Swizzles as _};

use crate::bernstein::binomials;
use crate::{KnotVector, Surface};

/// Below this sine of the first derivatives, or this ratio of their lengths, the direction
/// of their product has lost about half of its digits, and the limit is taken instead.
const SINGULAR: f64 = 1e-8;

/// Below this multiple of what its terms can be, a first derivative is mostly rounding.
const ROUNDING: f64 = 1e4 * f64::EPSILON;

/// Above this square of the sine, and of the ratio of lengths, nothing is singular.
const PLAIN: f64 = 1e-8;

/// How many times its error bound a coefficient of the normal must exceed: six digits, and
/// where nothing has them, two.
const CERTAINTY: [f64; 2] = [1e6, 1e2];

/// The unit normal of a regular point, `None` where the first derivatives are parallel or
/// one of them vanishes.
///
/// `sizes` are bounds of the terms that the derivatives are the sums of.
#[inline]
pub fn regular([du, dv]: [DVec3; 2], sizes: [f64; 2]) -> Option<DVec3> {
    let (square_u, square_v) = (du.length_squared(), dv.length_squared());
    let normal = du.cross(dv);
    let square = normal.length_squared();
    let above = |square: f64, size: f64| square > (ROUNDING * size) * (ROUNDING * size);
    // Far from all that is singular one root is enough.
    if square > PLAIN * square_u * square_v
        && square_u.min(square_v) > PLAIN * square_u.max(square_v)
        && square.is_normal()
        && above(square_u, sizes[0])
        && above(square_v, sizes[1])
    {
        return Some(normal / square.sqrt());
    }
    irregular([du, dv], sizes)
}

/// The unit normal along `du x dv` of a surface after `map`, from that before; `None` where the map
/// leaves no area.
pub fn moved(normal: DVec3, map: &DAffine3) -> Option<DVec3> {
    let axes = map.matrix3.to_cols_array_2d().map(DVec3::from_array);
    let longest = axes
        .iter()
        .fold(0.0, |max: f64, a| max.max(a.abs().max_element()));
    let [x, y, z] = axes.map(|axis| axis / longest);
    DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y))
        .mul_vec3(normal)
        .try_normalize()
}

/// [`regular`] for derivatives that are nearly singular, very long or very short.
#[cold]
fn irregular([du, dv]: [DVec3; 2], sizes: [f64; 2]) -> Option<DVec3> {
    let (length_u, length_v) = (du.length(), dv.length());
    if length_u <= ROUNDING * sizes[0] || length_v <= ROUNDING * sizes[1] {
        return None;
    }
    if length_u.min(length_v) <= SINGULAR * length_u.max(length_v) {
        return None;
    }
    let normal = (du / length_u).cross(dv / length_v);
    (normal.length() > SINGULAR).then(|| normal.normalize())
}

/// The limit of the normal along a straight way into the domain: along v, else along u,
/// else diagonally.
///
/// Along such a way `w^3 du x dv` is a polynomial; its first Bernstein coefficient that
/// does not vanish is the direction of the limit \[Farouki 88\]. The four spans that meet at
/// `uv` are tried, those towards larger parameters first.
pub(crate) fn limit(surface: &Surface, uv: DVec2) -> Option<DVec3> {
    let ways_v = ways(surface.knots_v(), uv.y);
    ways(surface.knots_u(), uv.x)
        .into_iter()
        .flat_map(|way_u| ways_v.clone().map(|way_v| (way_u.clone(), way_v)))
        .find_map(|(way_u, way_v)| corner_limit(surface, &way_u?, &way_v?))
}

/// The spans after and before `t` as far as they belong to the domain.
fn ways(knots: &KnotVector, t: f64) -> [Option<Range<f64>>; 2] {
    let Range { start, end } = knots.domain();
    let t = t.max(start).min(end);
    let breaks = knots.breaks();
    let next = breaks.iter().find(|&&k| k > t);
    let previous = breaks.iter().rev().find(|&&k| k < t);
    [next.map(|&k| t..k), previous.map(|&k| t..k)]
}

/// The limit of the normal at the corner of the piece over two ways, each of which starts
/// at the corner.
fn corner_limit(surface: &Surface, way_u: &Range<f64>, way_v: &Range<f64>) -> Option<DVec3> {
    let ascending = |way: &Range<f64>| way.start.min(way.end)..way.start.max(way.end);
    let mut piece = surface
        .restricted_u(ascending(way_u))
        .and_then(|strip| strip.restricted_v(ascending(way_v)))
        .ok()?;
    let mut sign = 1.0;
    if way_u.end < way_u.start {
        (piece, sign) = (piece.reversed_u(), -sign);
    }
    if way_v.end < way_v.start {
        (piece, sign) = (piece.reversed_v(), -sign);
    }
    let net = Net::centered(&piece);
    let (du, dv) = (net.differences_u(), net.differences_v());
    [Net::along_v, Net::along_u, Net::diagonal]
        .into_iter()
        .find_map(|way| leading_normal(&way(&net), &way(&du), &way(&dv)))
        .map(|normal| normal * sign)
}

/// The direction of the first coefficient of the normal that is certain not to vanish.
///
/// The arguments are the Bernstein coefficients of the homogeneous curve and of its two
/// derivatives; with `X` before the weight `w`, the normal is that of
/// `w Xu x Xv + wv X x Xu + wu Xv x X`.
fn leading_normal(x: &[Estimate], du: &[Estimate], dv: &[Estimate]) -> Option<DVec3> {
    let [binomial_x, binomial_u, binomial_v] =
        [x, du, dv].map(|c| binomials(c.len() - 1).collect::<Vec<_>>());
    let degree = x.len() + du.len() + dv.len() - 3;
    let mut coefficients = vec![(DVec3::ZERO, 0.0); degree + 1];
    for (i, x) in x.iter().enumerate() {
        for (j, u) in du.iter().enumerate() {
            let share = binomial_x[i] * binomial_u[j];
            for (k, v) in dv.iter().enumerate() {
                let share = share * binomial_v[k];
                let (value, error) = &mut coefficients[i + j + k];
                *value += (u.cross(*v) * x.value.w + x.cross(*u) * v.value.w
                    - x.cross(*v) * u.value.w)
                    * share;
                *error += share
                    * (product_error(x.weight(), u.length(), v.length())
                        + product_error(v.weight(), x.length(), u.length())
                        + product_error(u.weight(), v.length(), x.length()));
            }
        }
    }
    CERTAINTY.into_iter().find_map(|certainty| {
        coefficients
            .iter()
            .find(|(value, error)| value.length() > certainty * error)
            .and_then(|(value, _)| value.try_normalize())
    })
}

/// A homogeneous vector, with bounds of the errors of its first three coordinates (as a
/// length) and of its weight.
#[derive(Clone, Copy, Default)]
struct Estimate {
    value: DVec4,
    error: DVec2,
}

impl Estimate {
    /// `self + other * share` for a share that is not negative.
    fn plus(self, other: Self, share: f64) -> Self {
        Self {
            value: self.value + other.value * share,
            error: self.error + other.error * share,
        }
    }

    /// `(self - other) * factor`.
    fn difference(self, other: Self, factor: f64) -> Self {
        Self {
            value: (self.value - other.value) * factor,
            error: (self.error + other.error) * factor,
        }
    }

    fn cross(self, other: Self) -> DVec3 {
        self.value.xyz().cross(other.value.xyz())
    }

    /// Length and its error.
    fn length(self) -> [f64; 2] {
        [self.value.xyz().length(), self.error.x]
    }

    /// Absolute weight and its error.
    fn weight(self) -> [f64; 2] {
        [self.value.w.abs(), self.error.y]
    }
}

/// The error of a product of three numbers, each given with its own.
fn product_error([a, da]: [f64; 2], [b, db]: [f64; 2], [c, dc]: [f64; 2]) -> f64 {
    da * (b + db) * (c + dc) + a * db * (c + dc) + a * b * dc
}

/// A net of Bernstein coefficients in u and v.
struct Net {
    degree_u: usize,
    degree_v: usize,
    points: Vec<Estimate>,
}

impl Net {
    /// The net of a Bézier piece, moved so that its first point is the origin: the products
    /// lose no digits to a large offset then.
    fn centered(piece: &Surface) -> Self {
        let net = piece.homogeneous();
        let center = net[0].xyz() / net[0].w;
        let point = |h: &DVec4| {
            let length = h.xyz().length() + center.length() * h.w;
            Estimate {
                value: (h.xyz() - center * h.w).extend(h.w),
                error: DVec2::new(length, h.w) * f64::EPSILON,
            }
        };
        Self {
            degree_u: piece.knots_u().degree(),
            degree_v: piece.knots_v().degree(),
            points: net.iter().map(point).collect(),
        }
    }

    fn at(&self, i: usize, j: usize) -> Estimate {
        self.points[i * (self.degree_v + 1) + j]
    }

    /// The derivative along u.
    fn differences_u(&self) -> Self {
        let (p, q) = (self.degree_u, self.degree_v);
        let difference = |i, j| self.at(i + 1, j).difference(self.at(i, j), p as f64);
        Self {
            degree_u: p - 1,
            degree_v: q,
            points: (0..p)
                .flat_map(|i| (0..=q).map(move |j| difference(i, j)))
                .collect(),
        }
    }

    /// The derivative along v.
    fn differences_v(&self) -> Self {
        let (p, q) = (self.degree_u, self.degree_v);
        let difference = |i, j| self.at(i, j + 1).difference(self.at(i, j), q as f64);
        Self {
            degree_u: p,
            degree_v: q - 1,
            points: (0..=p)
                .flat_map(|i| (0..q).map(move |j| difference(i, j)))
                .collect(),
        }
    }

    /// The curve `u = 0`.
    fn along_v(&self) -> Vec<Estimate> {
        (0..=self.degree_v).map(|j| self.at(0, j)).collect()
    }

    /// The curve `v = 0`.
    fn along_u(&self) -> Vec<Estimate> {
        (0..=self.degree_u).map(|i| self.at(i, 0)).collect()
    }

    /// The curve `u = v`.
    fn diagonal(&self) -> Vec<Estimate> {
        let (p, q) = (self.degree_u, self.degree_v);
        let [row, column, both] = [p, q, p + q].map(|n| binomials(n).collect::<Vec<_>>());
        let mut curve = vec![Estimate::default(); p + q + 1];
        for i in 0..=p {
            for j in 0..=q {
                let share = row[i] * column[j] / both[i + j];
                curve[i + j] = curve[i + j].plus(self.at(i, j), share);
            }
        }
        curve
    }
}

#[cfg(test)]
mod tests;
