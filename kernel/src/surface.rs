//! Rational B-spline surfaces.

use std::ops::Range;

use glam::{DAffine3, DVec2, DVec3, DVec4};

use crate::curve::{are_rational, check_range, lift_all, transform_all};
use crate::spline::{self, Spline};
use crate::{Aabb, BezierSurface, Curve, Error, KnotVector, normal};

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

    /// A box around the control points, and so around the surface.
    pub fn hull_bounds(&self) -> Aabb {
        Aabb::around(self.points())
    }

    /// The point at `(u, v)`. Outside the domain the border pieces are prolonged.
    pub fn evaluate(&self, uv: DVec2) -> DVec3 {
        let [[x, ..], ..] = self.homogeneous_derivatives(uv);
        x.truncate() / x.w
    }

    /// Point, first and second derivatives at `(u, v)` \[Piegl 97, eq. 4.20\].
    ///
    /// On an inner knot the derivatives are those of the span to the right.
    pub fn derivatives(&self, uv: DVec2) -> SurfaceDerivatives {
        let [[x, xv, xvv], [xu, xuv, _], [xuu, ..]] = self.homogeneous_derivatives(uv);
        let scale = 1.0 / x.w;
        let point = x.truncate() * scale;
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
        let d = self.derivatives(uv);
        normal::regular(d.du, d.dv).or_else(|| normal::limit(self, uv))
    }

    /// `result[a][b]` is the derivative of `(w S, w)`, `a` times along u, `b` times along v.
    fn homogeneous_derivatives(&self, uv: DVec2) -> [[DVec4; 3]; 3] {
        let (span_u, span_v) = (self.knots_u.span(uv.x), self.knots_v.span(uv.y));
        let rows_u = self.knots_u.basis(span_u, uv.x);
        let rows_v = self.knots_v.basis(span_v, uv.y);
        let (p, q) = (self.knots_u.degree(), self.knots_v.degree());
        let mut sums = [[DVec4::ZERO; 3]; 3];
        for i in 0..=p {
            let start = (span_u - p + i) * self.knots_v.count() + span_v - q;
            let mut row = [DVec4::ZERO; 3];
            for (j, &point) in self.points[start..=start + q].iter().enumerate() {
                for b in 0..3 {
                    row[b] += point * rows_v[b][j];
                }
            }
            for a in 0..3 {
                for b in 0..3 {
                    sums[a][b] += row[b] * rows_u[a][i];
                }
            }
        }
        sums
    }

    /// The same surface with `knot` standing `multiplicity` times along u.
    ///
    /// # Errors
    /// If the knot lies outside the open domain.
    pub fn with_knot_u(&self, knot: f64, multiplicity: usize) -> Result<Self, Error> {
        let Range { start, end } = self.knots_u.domain();
        if !(start < knot && knot < end) {
            return Err(Error::Parameter {
                found: knot,
                start,
                end,
            });
        }
        Ok(self.along_u(|knots, column| spline::insert(knots, column, knot, multiplicity)))
    }

    /// The two parts before and after `u`, each clamped along u.
    ///
    /// # Errors
    /// If `u` is not inside the domain.
    pub fn split_u(&self, u: f64) -> Result<[Self; 2], Error> {
        let Range { start, end } = self.knots_u.domain();
        Ok([self.restricted_u(start..u)?, self.restricted_u(u..end)?])
    }

    /// The part over `range` along u, clamped along u.
    ///
    /// # Errors
    /// If `range` is empty or leaves the domain.
    pub fn restricted_u(&self, range: Range<f64>) -> Result<Self, Error> {
        check_range(&range, &self.knots_u.domain())?;
        Ok(self.along_u(|knots, column| spline::restrict(knots, column, &range)))
    }

    /// The part over `range` along v, clamped along v.
    ///
    /// # Errors
    /// As [`Surface::restricted_u`].
    pub fn restricted_v(&self, range: Range<f64>) -> Result<Self, Error> {
        Ok(self.transposed().restricted_u(range)?.transposed())
    }

    /// The same surface with its degree along u raised to `degree`, clamped along u.
    ///
    /// # Errors
    /// If `degree` is below the present degree or above [`crate::MAX_DEGREE`].
    pub fn elevated_u(&self, degree: usize) -> Result<Self, Error> {
        if degree < self.knots_u.degree() || degree > crate::MAX_DEGREE {
            return Err(Error::Degree { found: degree });
        }
        let mut surface = self.clone();
        for _ in self.knots_u.degree()..degree {
            surface = surface.along_u(spline::elevate_once);
        }
        Ok(surface)
    }

    /// The same surface run through backwards along u; its normal turns around.
    #[must_use]
    pub fn reversed_u(&self) -> Self {
        let rows = self.points.chunks_exact(self.knots_v.count()).rev();
        let points = rows.flatten().copied().collect();
        Self {
            knots_u: self.knots_u.reversed(),
            knots_v: self.knots_v.clone(),
            points,
        }
    }

    /// The same surface with u and v exchanged; its normal turns around.
    ///
    /// Every operation along v is the one along u between two of these.
    #[must_use]
    pub fn transposed(&self) -> Self {
        Self {
            knots_u: self.knots_v.clone(),
            knots_v: self.knots_u.clone(),
            points: transposed(&self.points, self.knots_v.count()),
        }
    }

    /// The image of the surface under an affine map; parameters stay as they are.
    #[must_use]
    pub fn transformed(&self, target_from_source: &DAffine3) -> Self {
        let points = transform_all(&self.points, target_from_source);
        Self {
            knots_u: self.knots_u.clone(),
            knots_v: self.knots_v.clone(),
            points,
        }
    }

    /// The same surface over affinely moved domains.
    ///
    /// # Errors
    /// If a domain is empty or not finite.
    pub fn remapped(&self, domain_u: Range<f64>, domain_v: Range<f64>) -> Result<Self, Error> {
        let knots_u = self.knots_u.remapped(domain_u)?;
        let knots_v = self.knots_v.remapped(domain_v)?;
        Ok(Self {
            knots_u,
            knots_v,
            points: self.points.clone(),
        })
    }

    /// The curve `u = constant`, over the domain of v.
    pub fn iso_curve_u(&self, u: f64) -> Curve<DVec3> {
        let count_v = self.knots_v.count();
        let column = |j| {
            self.points
                .iter()
                .skip(j)
                .step_by(count_v)
                .copied()
                .collect::<Vec<_>>()
        };
        let point = |j| spline::derivatives(&self.knots_u, &column(j), u)[0];
        Curve::from((self.knots_v.clone(), (0..count_v).map(point).collect()))
    }

    /// The Bézier pieces, one for each pair of spans with a length; v runs fastest.
    ///
    /// Neighbouring pieces share their border control points to the last bit.
    pub fn bezier_pieces(&self) -> Vec<BezierSurface> {
        let strips = self.bezier_strips_u();
        let pieces = strips.iter().flat_map(|strip| {
            let turned = strip.transposed();
            let domain_u = strip.knots_u.domain();
            turned.bezier_strips_u().into_iter().map(move |piece| {
                let domain_v = piece.knots_u.domain();
                let piece = piece.transposed();
                let degrees = [piece.knots_u.degree(), piece.knots_v.degree()];
                BezierSurface::trusted(degrees, piece.points, domain_u.clone(), domain_v)
            })
        });
        pieces.collect()
    }

    /// Strips that are Bézier along u and unchanged along v.
    fn bezier_strips_u(&self) -> Vec<Self> {
        let (p, count_v) = (self.knots_u.degree(), self.knots_v.count());
        let columns: Vec<_> = self
            .columns()
            .map(|column| spline::bezier_pieces(&self.knots_u, &column))
            .collect();
        let strip = |s: usize| {
            let range = &columns[0][s].0;
            let knots = [vec![range.start; p + 1], vec![range.end; p + 1]].concat();
            let points = (0..=p)
                .flat_map(|i| columns.iter().map(move |c| c[s].1[i]))
                .collect();
            debug_assert_eq!(columns.len(), count_v);
            Self::trusted(KnotVector::trusted(p, knots), self.knots_v.clone(), points)
        };
        (0..columns[0].len()).map(strip).collect()
    }

    /// The lists of control points along u, one for each `j`.
    fn columns(&self) -> impl Iterator<Item = Vec<DVec4>> + '_ {
        let count_v = self.knots_v.count();
        (0..count_v).map(move |j| {
            self.points
                .iter()
                .skip(j)
                .step_by(count_v)
                .copied()
                .collect()
        })
    }

    /// Applies a one-dimensional operation to every column.
    fn along_u(&self, operation: impl Fn(&KnotVector, &[DVec4]) -> Spline<DVec4>) -> Self {
        let columns: Vec<_> = self
            .columns()
            .map(|column| operation(&self.knots_u, &column))
            .collect();
        let knots_u = columns[0].0.clone();
        let points = (0..knots_u.count())
            .flat_map(|i| columns.iter().map(move |c| c.1[i]))
            .collect();
        Self {
            knots_u,
            knots_v: self.knots_v.clone(),
            points,
        }
    }
}

/// The transposed net; `row` is the length of the given rows.
fn transposed(points: &[DVec4], row: usize) -> Vec<DVec4> {
    (0..row)
        .flat_map(|j| points.iter().skip(j).step_by(row).copied())
        .collect()
}
