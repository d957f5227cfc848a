//! Rational B-spline surfaces.

mod edit;

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4};

use crate::curve::{are_rational, lift_all};
use crate::knots::{MOST_ROOM, USUAL_ROOM, WIDE_ROOM};
use crate::{Aabb, Curve, Error, KnotVector, normal, spline};

/// Points so near to each other, as a share of the size of a surface, are the same.
const SAME: f64 = 1e-9;

/// A NURBS surface: two knot vectors and a net of control points with positive weights.
///
/// The net is stored row by row: the point of column `i` along u and `j` along v is at
/// `i * count_v + j`.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    knots_u: KnotVector,
    knots_v: KnotVector,
    points: Vec<DVec4>,
}

/// Point and partial derivatives of a surface at one parameter pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceDerivatives {
    /// The point.
    pub point: DVec3,
    /// First derivative along u.
    pub du: DVec3,
    /// First derivative along v.
    pub dv: DVec3,
    /// Second derivative along u.
    pub duu: DVec3,
    /// Mixed second derivative.
    pub duv: DVec3,
    /// Second derivative along v.
    pub dvv: DVec3,
}

impl Surface {
    /// Makes a surface from Cartesian control points, `points[i * count_v + j]`; no weights
    /// means all are one.
    ///
    /// # Errors
    /// If the counts do not fit, a coordinate is not finite or a weight not positive.
    pub fn new(
        knots_u: KnotVector,
        knots_v: KnotVector,
        points: &[DVec3],
        weights: Option<&[f64]>,
    ) -> Result<Self, Error> {
        let points = lift_all(points, weights, knots_u.count() * knots_v.count())?;
        Ok(Self {
            knots_u,
            knots_v,
            points,
        })
    }

    /// As [`Surface::new`] for lists in which u runs fastest, as files have them:
    /// `points[i + j * count_u]`.
    ///
    /// # Errors
    /// As [`Surface::new`].
    pub fn from_u_fastest(
        knots_u: KnotVector,
        knots_v: KnotVector,
        points: &[DVec3],
        weights: Option<&[f64]>,
    ) -> Result<Self, Error> {
        let (count_u, count_v) = (knots_u.count(), knots_v.count());
        let points = lift_all(points, weights, count_u * count_v)?;
        let points = transposed(&points, count_u);
        Ok(Self {
            knots_u,
            knots_v,
            points,
        })
    }

    /// A surface from a valid homogeneous net.
    pub(crate) fn trusted(knots_u: KnotVector, knots_v: KnotVector, points: Vec<DVec4>) -> Self {
        Self {
            knots_u,
            knots_v,
            points,
        }
    }

    /// The knots along u.
    pub fn knots_u(&self) -> &KnotVector {
        &self.knots_u
    }

    /// The knots along v.
    pub fn knots_v(&self) -> &KnotVector {
        &self.knots_v
    }

    /// The control points `(w P, w)`, `[i * count_v + j]`.
    pub fn homogeneous(&self) -> &[DVec4] {
        &self.points
    }

    /// The Cartesian control points, `[i * count_v + j]`.
    pub fn points(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.points.iter().map(|h| h.truncate() / h.w)
    }

    /// The weights, `[i * count_v + j]`.
    pub fn weights(&self) -> impl Iterator<Item = f64> + '_ {
        self.points.iter().map(|h| h.w)
    }

    /// Whether the weights differ.
    pub fn is_rational(&self) -> bool {
        are_rational(&self.points)
    }

    /// The lengths of the domain along which the surface comes back to its start; zero where it does
    /// not.
    pub fn periods(&self) -> DVec2 {
        let length = |closed: bool, knots: &KnotVector| {
            let Range { start, end } = knots.domain();
            if closed { end - start } else { 0.0 }
        };
        let [u, v] = self.closed();
        DVec2::new(length(u, &self.knots_u), length(v, &self.knots_v))
    }

    /// Whether the surface comes back to its start along u, and along v, up to rounding.
    pub fn closed(&self) -> [bool; 2] {
        let near = SAME * self.hull_bounds().diagonal();
        let is_near =
            |a: DVec4, b: DVec4| (a.truncate() / a.w).distance(b.truncate() / b.w) <= near;
        if self.knots_u.is_clamped() && self.knots_v.is_clamped() {
            // Control points are those of the borders.
            let (points, row) = (&self.points, self.knots_v.count());
            let (first, last) = (&points[..row], &points[points.len() - row..]);
            let rows = || points.chunks_exact(row);
            return [
                first.iter().zip(last).all(|(a, b)| is_near(*a, *b)),
                rows().all(|points| is_near(points[0], points[row - 1])),
            ];
        }
        let meet = |a: Curve<DVec3>, b: Curve<DVec3>| {
            let mut pairs = a.homogeneous().iter().zip(b.homogeneous());
            pairs.all(|(a, b)| is_near(*a, *b))
        };
        let (u, v) = (self.knots_u.domain(), self.knots_v.domain());
        [
            meet(self.iso_curve_u(u.start), self.iso_curve_u(u.end)),
            meet(self.iso_curve_v(v.start), self.iso_curve_v(v.end)),
        ]
    }

    /// A box around the control points, and so around the surface, up to rounding.
    pub fn hull_bounds(&self) -> Aabb {
        Aabb::around(self.points())
    }

    /// The point at `(u, v)`. Outside the domain the border pieces are prolonged.
    pub fn evaluate(&self, uv: DVec2) -> DVec3 {
        let [[x]] = self.homogeneous_derivatives(uv);
        x.truncate() / x.w
    }

    /// Point, first and second derivatives at `(u, v)` \[Piegl 97, eq. 4.20\].
    ///
    /// On an inner knot the derivatives are those of the span to the right.
    pub fn derivatives(&self, uv: DVec2) -> SurfaceDerivatives {
        let [[x, xv, xvv], [xu, xuv, _], [xuu, ..]] = self.homogeneous_derivatives(uv);
        let scale = 1.0 / x.w;
        let point = x.truncate() / x.w;
        let du = (xu.truncate() - point * xu.w) * scale;
        let dv = (xv.truncate() - point * xv.w) * scale;
        let duu = (xuu.truncate() - du * (2.0 * xu.w) - point * xuu.w) * scale;
        let dvv = (xvv.truncate() - dv * (2.0 * xv.w) - point * xvv.w) * scale;
        let duv = (xuv.truncate() - dv * xu.w - du * xv.w - point * xuv.w) * scale;
        SurfaceDerivatives {
            point,
            du,
            dv,
            duu,
            duv,
            dvv,
        }
    }

    /// The unit normal along `du x dv`, or its limit from inside the domain where that
    /// product vanishes (poles, collapsed edges, cusps).
    ///
    /// `None` where the surface has no area in any direction from the point.
    pub fn normal(&self, uv: DVec2) -> Option<DVec3> {
        self.point_and_normal(uv).1
    }

    /// The point at `(u, v)` with its [normal](Self::normal).
    pub fn point_and_normal(&self, uv: DVec2) -> (DVec3, Option<DVec3>) {
        let (point, regular) = self.point_and_regular_normal(uv);
        (point, regular.or_else(|| normal::limit(self, uv)))
    }

    /// The same, without normals that are limits.
    pub fn point_and_regular_normal(&self, uv: DVec2) -> (DVec3, Option<DVec3>) {
        let (point, tangents) = self.tangents(uv);
        (point, normal::regular(tangents, self.derivative_sizes(uv)))
    }

    /// Point and first derivatives along u and v: less work than all [derivatives](Self::derivatives).
    pub fn tangents(&self, uv: DVec2) -> (DVec3, [DVec3; 2]) {
        let [[x, xv], [xu, _]] = self.homogeneous_derivatives(uv);
        let (scale, point) = (1.0 / x.w, x.truncate() / x.w);
        let tangent = |d: DVec4| (d.truncate() - point * d.w) * scale;
        (point, [tangent(xu), tangent(xv)])
    }

    /// Bounds of the terms that the first derivatives along u and v are the sums of.
    fn derivative_sizes(&self, uv: DVec2) -> [f64; 2] {
        let (span_u, span_v) = (self.knots_u.span(uv.x), self.knots_v.span(uv.y));
        let (p, q) = (self.knots_u.degree(), self.knots_v.degree());
        let (mut size, mut weight) = (0.0_f64, f64::INFINITY);
        for i in span_u - p..=span_u {
            let first = i * self.knots_v.count() + span_v - q;
            for h in &self.points[first..][..=q] {
                size = size.max(h.truncate().length());
                weight = weight.min(h.w);
            }
        }
        [(&self.knots_u, span_u), (&self.knots_v, span_v)].map(|(knots, span)| {
            let length = knots.as_slice()[span + 1] - knots.as_slice()[span];
            knots.degree() as f64 * size / (weight * length)
        })
    }

    /// `result[a][b]` is the derivative of `(w S, w)`, `a` times along u, `b` times along v, both
    /// below `N`.
    fn homogeneous_derivatives<const N: usize>(&self, uv: DVec2) -> [[DVec4; N]; N] {
        let (p, q) = (self.knots_u.degree(), self.knots_v.degree());
        // Loops of known length are faster.
        match (p.max(q), q) {
            (WIDE_ROOM.., _) => self.derivatives_in::<N, MOST_ROOM>(uv, q),
            (USUAL_ROOM.., _) => self.derivatives_in::<N, WIDE_ROOM>(uv, q),
            (_, 1) => self.derivatives_in::<N, USUAL_ROOM>(uv, 1),
            (_, 2) => self.derivatives_in::<N, USUAL_ROOM>(uv, 2),
            (_, _) => self.derivatives_in::<N, USUAL_ROOM>(uv, 3),
        }
    }

    /// The same with the degree along v.
    #[inline(always)]
    fn derivatives_in<const N: usize, const ROOM: usize>(
        &self,
        uv: DVec2,
        q: usize,
    ) -> [[DVec4; N]; N] {
        let p = self.knots_u.degree();
        let (span_u, span_v) = (self.knots_u.span(uv.x), self.knots_v.span(uv.y));
        let rows_u = self.knots_u.basis::<N, ROOM>(span_u, uv.x);
        let rows_v = self.knots_v.basis::<N, ROOM>(span_v, uv.y);
        let mut sums = [[DVec4::ZERO; N]; N];
        let count = self.knots_v.count();
        for i in 0..=p {
            let first = (span_u - p + i) * count + span_v - q;
            let mut row = [DVec4::ZERO; N];
            for (j, &point) in self.points[first..][..=q].iter().enumerate() {
                for b in 0..N {
                    row[b] += point * rows_v[b][j];
                }
            }
            for (sums, basis) in sums.iter_mut().zip(&rows_u) {
                for (sum, value) in sums.iter_mut().zip(row) {
                    *sum += value * basis[i];
                }
            }
        }
        sums
    }

    /// The curve `u = constant`, over the domain of v; `u` is clamped to its domain.
    pub fn iso_curve_u(&self, u: f64) -> Curve<DVec3> {
        self.transposed().iso_curve_v(u)
    }

    /// The curve `v = constant`, over the domain of u; `v` is clamped to its domain.
    pub fn iso_curve_v(&self, v: f64) -> Curve<DVec3> {
        let Range { start, end } = self.knots_v.domain();
        let v = v.max(start).min(end);
        let point = |row: &[DVec4]| {
            let [point] = spline::derivatives(&self.knots_v, row, v);
            point
        };
        let rows = self.points.chunks_exact(self.knots_v.count());
        Curve::trusted((self.knots_u.clone(), rows.map(point).collect()))
    }

    /// The points at the four corners of the domain, `[u][v]`: the first index says whether
    /// u is at its start or end, the second the same of v.
    pub fn corners(&self) -> [[DVec3; 2]; 2] {
        let (u, v) = (self.knots_u.domain(), self.knots_v.domain());
        [u.start, u.end].map(|u| [v.start, v.end].map(|v| self.evaluate(DVec2::new(u, v))))
    }

    /// The lists of control points along u, one for each `j`.
    fn columns(&self) -> impl Iterator<Item = Vec<DVec4>> + '_ {
        let (row, points) = (self.knots_v.count(), &self.points);
        (0..row).map(move |j| points.iter().skip(j).step_by(row).copied().collect())
    }
}

/// The transposed net; `row` is the length of the given rows.
fn transposed(points: &[DVec4], row: usize) -> Vec<DVec4> {
    (0..row)
        .flat_map(|j| points.iter().skip(j).step_by(row).copied())
        .collect()
}
