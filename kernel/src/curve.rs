//! Rational B-spline curves of the plane and of space.

use std::ops::Range;

use glam::{DAffine2, DAffine3, DVec2, DVec3, DVec4};

use crate::spline::{self, Linear as _, Point, Spline};
use crate::{Aabb, Error, KnotVector};

/// A NURBS curve: knots and control points with positive weights.
///
/// `P` is `DVec2` for curves in a parameter domain and `DVec3` for curves in space.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve<P: Point> {
    knots: KnotVector,
    points: Vec<P::Homogeneous>,
}

/// Point and derivatives of a curve at one parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveDerivatives<P> {
    /// The point.
    pub point: P,
    /// First derivative.
    pub first: P,
    /// Second derivative.
    pub second: P,
}

impl<P: Point> Curve<P> {
    /// Makes a curve from Cartesian control points; no weights means all are one.
    ///
    /// # Errors
    /// If the counts do not fit, a coordinate is not finite or a weight not positive.
    pub fn new(knots: KnotVector, points: &[P], weights: Option<&[f64]>) -> Result<Self, Error> {
        let points = lift_all(points, weights, knots.count())?;
        Ok(Self { knots, points })
    }

    /// A curve from a valid spline.
    pub(crate) fn trusted((knots, points): Spline<P::Homogeneous>) -> Self {
        Self { knots, points }
    }

    /// The straight segment from `start` to `end` over `domain`.
    ///
    /// # Errors
    /// If a coordinate is not finite or the domain is empty.
    pub fn line(start: P, end: P, domain: Range<f64>) -> Result<Self, Error> {
        Self::new(KnotVector::bezier(1, domain)?, &[start, end], None)
    }

    /// The polyline through `points`, with knots 0, 1, 2, ...
    ///
    /// # Errors
    /// If there are fewer than two points or one is not finite.
    pub fn polyline(points: &[P]) -> Result<Self, Error> {
        let spans = points.len().saturating_sub(1) as f64;
        Self::new(
            KnotVector::clamped_uniform(1, points.len(), 0.0..spans)?,
            points,
            None,
        )
    }

    /// The knots.
    pub fn knots(&self) -> &KnotVector {
        &self.knots
    }

    /// Polynomial degree.
    pub fn degree(&self) -> usize {
        self.knots.degree()
    }

    /// The parameters for which the curve is defined.
    pub fn domain(&self) -> Range<f64> {
        self.knots.domain()
    }

    /// The control points `(w P, w)`.
    pub fn homogeneous(&self) -> &[P::Homogeneous] {
        &self.points
    }

    /// The Cartesian control points.
    pub fn points(&self) -> impl Iterator<Item = P> + '_ {
        self.points.iter().map(|&h| P::project(h))
    }

    /// The weights of the control points.
    pub fn weights(&self) -> impl Iterator<Item = f64> + '_ {
        self.points.iter().map(|h| h.weight())
    }

    /// Whether the weights differ.
    pub fn is_rational(&self) -> bool {
        are_rational(&self.points)
    }

    /// The first point of the domain.
    pub fn start(&self) -> P {
        self.evaluate(self.domain().start)
    }

    /// The last point of the domain.
    pub fn end(&self) -> P {
        self.evaluate(self.domain().end)
    }

    /// The point at `t`. Outside the domain the end pieces are prolonged.
    pub fn evaluate(&self, t: f64) -> P {
        let [point] = spline::derivatives(&self.knots, &self.points, t);
        P::project(point)
    }

    /// Point and first derivative at `t`: less work than all [derivatives](Self::derivatives).
    pub fn tangent(&self, t: f64) -> (P, P) {
        let [a, a1] = spline::derivatives(&self.knots, &self.points, t);
        let point = P::project(a);
        let first = (P::numerator(a1) - point * a1.weight()) * (1.0 / a.weight());
        (point, first)
    }

    /// Point, first and second derivative at `t` \[Piegl 97, eq. 4.8\].
    ///
    /// On an inner knot the derivatives are those of the span to the right.
    pub fn derivatives(&self, t: f64) -> CurveDerivatives<P> {
        let [a, a1, a2] = spline::derivatives(&self.knots, &self.points, t);
        let scale = 1.0 / a.weight();
        let point = P::project(a);
        let first = (P::numerator(a1) - point * a1.weight()) * scale;
        let second = (P::numerator(a2) - first * (2.0 * a1.weight()) - point * a2.weight()) * scale;
        CurveDerivatives {
            point,
            first,
            second,
        }
    }

    /// The same curve with `knot` standing `multiplicity` times (at most `degree`).
    ///
    /// # Errors
    /// If the knot lies outside the open domain.
    pub fn with_knot(&self, knot: f64, multiplicity: usize) -> Result<Self, Error> {
        check_inside(knot, &self.domain())?;
        Ok(Self::trusted(spline::insert(
            &self.knots,
            &self.points,
            knot,
            multiplicity,
        )))
    }

    /// The same curve with every knot of `extra` inserted once for each time it stands
    /// there, in any order.
    ///
    /// # Errors
    /// If a knot lies outside the open domain, or would stand there more than `degree` times.
    pub fn refined(&self, extra: &[f64]) -> Result<Self, Error> {
        let extra = spline::check_refinement(&self.knots, extra)?;
        Ok(Self::trusted(spline::refine(
            &self.knots,
            &self.points,
            &extra,
        )))
    }

    /// The two parts before and after `t`, each clamped. They share their common point to
    /// the last bit.
    ///
    /// # Errors
    /// If `t` is not inside the domain.
    pub fn split(&self, t: f64) -> Result<[Self; 2], Error> {
        check_inside(t, &self.domain())?;
        Ok(spline::split(&self.knots, &self.points, t).map(Self::trusted))
    }

    /// The part over `range`, clamped.
    ///
    /// # Errors
    /// If `range` is empty or leaves the domain.
    pub fn restricted(&self, range: Range<f64>) -> Result<Self, Error> {
        check_range(&range, &self.domain())?;
        Ok(Self::trusted(spline::restrict(
            &self.knots,
            &self.points,
            &range,
        )))
    }

    /// The parts between those knots of which `is_end` says so, given the Bézier pieces before
    /// and after.
    pub fn parts(self, is_end: impl Fn(&Self, &Self) -> bool) -> Vec<Self> {
        if self.knots.is_bezier() {
            return vec![self];
        }
        let pieces = self.bezier_pieces();
        let ends = pieces.windows(2).filter(|pair| is_end(&pair[0], &pair[1]));
        let Range { start, end } = self.domain();
        let mut stops = vec![start];
        stops.extend(ends.map(|pair| pair[1].domain().start));
        if stops.len() == 1 {
            return vec![self];
        }
        stops.push(end);
        let ranges = stops.windows(2).map(|range| range[0]..range[1]);
        ranges
            .map(|range| Self::trusted(spline::restrict(&self.knots, &self.points, &range)))
            .collect()
    }

    /// This curve and others in one: each begins where the one before ends, and parameters go on.
    ///
    /// # Errors
    /// If parameters become so large that domains are lost in them.
    pub fn joined(&self, others: &[Self]) -> Result<Self, Error> {
        let degrees = others.iter().map(Self::degree);
        let degree = degrees.fold(self.degree(), usize::max);
        let clamped = |curve: &Self| curve.restricted(curve.domain())?.elevated(degree);
        let first = clamped(self)?;
        let mut knots = first.knots.as_slice().to_vec();
        let mut points: Vec<P> = first.points().collect();
        let mut weights: Vec<f64> = first.weights().collect();
        for other in others {
            let curve = clamped(other)?;
            let shift = knots[knots.len() - 1] - curve.domain().start;
            // Weights count relative to each other only.
            let ends = weights.last().zip(curve.weights().next());
            let scale = ends.map_or(1.0, |(own, next)| own / next);
            knots.pop();
            let rest = &curve.knots.as_slice()[degree + 1..];
            knots.extend(rest.iter().map(|k| k + shift));
            points.extend(curve.points().skip(1));
            weights.extend(curve.weights().skip(1).map(|w| w * scale));
        }
        Self::new(KnotVector::new(degree, knots)?, &points, Some(&weights))
    }

    /// The same curve with its degree raised to `degree`, clamped if anything is raised.
    ///
    /// # Errors
    /// If `degree` is below the present degree or above [`crate::MAX_DEGREE`].
    pub fn elevated(&self, degree: usize) -> Result<Self, Error> {
        check_raised(degree, self.degree())?;
        let mut curve = self.clone();
        for _ in self.degree()..degree {
            curve = Self::trusted(spline::elevate_once(&curve.knots, &curve.points));
        }
        Ok(curve)
    }

    /// The same curve run through from its end, over the same domain.
    #[must_use]
    pub fn reversed(&self) -> Self {
        let points = self.points.iter().rev().copied().collect();
        Self {
            knots: self.knots.reversed(),
            points,
        }
    }

    /// The same curve over the affinely moved domain.
    ///
    /// # Errors
    /// If `domain` is empty or not finite.
    pub fn remapped(&self, domain: Range<f64>) -> Result<Self, Error> {
        Ok(Self {
            knots: self.knots.remapped(domain)?,
            points: self.points.clone(),
        })
    }

    /// The Bézier pieces in order, each a curve over its part of the domain.
    pub fn bezier_pieces(&self) -> Vec<Self> {
        let mut pieces = Vec::new();
        self.each_bezier(|range, points| {
            pieces.push(Self {
                knots: KnotVector::trusted_bezier(self.degree(), &range),
                points: points.to_vec(),
            });
        });
        pieces
    }

    /// Calls for each of the [Bézier pieces](Self::bezier_pieces) in order: its part of the domain, and
    /// its homogeneous control points.
    pub fn each_bezier(&self, each: impl FnMut(Range<f64>, &[P::Homogeneous])) {
        spline::each_bezier(&self.knots, &self.points, each);
    }
}

impl Curve<DVec2> {
    /// The parameters inside the domain at which the curve passes the line on which
    /// coordinate `axis` (0 or 1) has this value, ascending.
    ///
    /// Touching contacts may be missing; the curve at each is within `near` of the line.
    ///
    /// # Panics
    /// If `axis` is neither 0 nor 1.
    pub fn crossings(&self, axis: usize, value: f64, near: f64) -> Vec<f64> {
        assert!(axis < 2, "the plane has axes 0 and 1, not {axis}");
        let Range { start, end } = self.domain();
        let mut found: Vec<f64> = Vec::new();
        for piece in self.bezier_pieces() {
            let Range { start, end } = piece.domain();
            let roots = crate::trim::crossings(piece.homogeneous(), axis, value);
            found.extend(roots.iter().map(|t| start + (end - start) * t));
            // Between pieces the sign may change without a change inside of one.
            found.push(end);
        }
        found.retain(|&t| start < t && t < end && (self.evaluate(t)[axis] - value).abs() <= near);
        found.sort_by(f64::total_cmp);
        found.dedup();
        found
    }

    /// The image of the curve under a finite affine map; parameters stay as they are.
    ///
    /// Where numbers are so large that their products are not finite, the caller checks the points.
    #[must_use]
    pub fn transformed(&self, target_from_source: &DAffine2) -> Self {
        let image = |h: &DVec3| {
            let moved = target_from_source.transform_vector2(h.truncate());
            (moved + target_from_source.translation * h.z).extend(h.z)
        };
        Self {
            knots: self.knots.clone(),
            points: self.points.iter().map(image).collect(),
        }
    }
}

impl Curve<DVec3> {
    /// The image of the curve under a finite affine map; parameters stay as they are.
    ///
    /// Where numbers are so large that their products are not finite, the caller checks the points.
    #[must_use]
    pub fn transformed(&self, target_from_source: &DAffine3) -> Self {
        let points = transform_all(&self.points, target_from_source);
        Self {
            knots: self.knots.clone(),
            points,
        }
    }

    /// A box around the control points, and so around the curve, up to rounding.
    pub fn hull_bounds(&self) -> Aabb {
        Aabb::around(self.points())
    }

    /// The curve's shadow in the plane of its first two coordinates.
    pub fn flattened(&self) -> Curve<DVec2> {
        let points = self
            .points
            .iter()
            .map(|h| DVec3::new(h.x, h.y, h.w))
            .collect();
        Curve {
            knots: self.knots.clone(),
            points,
        }
    }
}

/// Points are no farther than this from the origin, also when their weights are factors of them: lengths, areas
/// and volumes are then finite numbers.
pub const FARTHEST: f64 = 1e100;

/// Refuses points that are not finite or beyond [`FARTHEST`].
///
/// # Errors
/// At the first one.
pub fn check_points<P: Point>(mut points: impl Iterator<Item = P>) -> Result<(), Error> {
    let is_far = |p: P| p.length().is_nan() || p.length() > FARTHEST;
    match points.position(is_far) {
        Some(index) => Err(Error::NotFinite { index }),
        None => Ok(()),
    }
}

/// Homogeneous control points from Cartesian ones, checked.
pub(crate) fn lift_all<P: Point>(
    points: &[P],
    weights: Option<&[f64]>,
    expected: usize,
) -> Result<Vec<P::Homogeneous>, Error> {
    if points.len() != expected {
        return Err(Error::PointCount {
            found: points.len(),
            expected,
        });
    }
    check_points(points.iter().copied())?;
    let ones = vec![1.0; if weights.is_none() { expected } else { 0 }];
    let weights = weights.unwrap_or(&ones);
    if weights.len() != expected {
        return Err(Error::WeightCount {
            found: weights.len(),
            expected,
        });
    }
    if let Some(index) = weights.iter().position(|w| !(*w > 0.0 && w.is_finite())) {
        return Err(Error::Weight {
            index,
            found: weights[index],
        });
    }
    let lifted: Vec<_> = points
        .iter()
        .zip(weights)
        .map(|(p, &w)| p.lift(w))
        .collect();
    check_points(lifted.iter().map(|&h| P::numerator(h)))?;
    Ok(lifted)
}

/// The images of homogeneous points under an affine map; weights stay as they are.
pub(crate) fn transform_all(points: &[DVec4], target_from_source: &DAffine3) -> Vec<DVec4> {
    let image = |h: &DVec4| {
        let moved = target_from_source.transform_vector3(h.truncate());
        (moved + target_from_source.translation * h.w).extend(h.w)
    };
    points.iter().map(image).collect()
}

/// Whether homogeneous points have different weights.
#[expect(
    clippy::float_cmp,
    reason = "equal weights cancel exactly, nearly equal ones do not"
)]
pub(crate) fn are_rational<H: spline::Linear>(points: &[H]) -> bool {
    points
        .windows(2)
        .any(|pair| pair[0].weight() != pair[1].weight())
}

/// Refuses numbers that make no point, also where they come from products of valid ones.
pub(crate) fn check_homogeneous(points: &[DVec4]) -> Result<(), Error> {
    let mut weights = points.iter().map(|h| h.w);
    if let Some(index) = weights.position(|w| !(w > 0.0 && w.is_finite())) {
        let found = points[index].w;
        return Err(Error::Weight { index, found });
    }
    check_points(points.iter().map(|&h| DVec3::project(h)))?;
    check_points(points.iter().map(|h| h.truncate()))
}

/// Refuses a degree to which nothing of degree `present` can be raised.
pub(crate) fn check_raised(degree: usize, present: usize) -> Result<(), Error> {
    match degree {
        found if found < present => Err(Error::DegreeBelow { found, present }),
        found if found > crate::MAX_DEGREE => Err(Error::Degree { found }),
        _ => Ok(()),
    }
}

/// Refuses what is not inside the domain; its ends are not.
pub(crate) fn check_inside(found: f64, domain: &Range<f64>) -> Result<(), Error> {
    let Range { start, end } = *domain;
    if start < found && found < end {
        Ok(())
    } else {
        Err(Error::NotInside { found, start, end })
    }
}

/// Refuses a range that is empty or leaves the domain.
pub(crate) fn check_range(range: &Range<f64>, domain: &Range<f64>) -> Result<(), Error> {
    let Range { start, end } = *domain;
    for found in [range.start, range.end] {
        if !(start <= found && found <= end) {
            return Err(Error::Parameter { found, start, end });
        }
    }
    if range.start < range.end {
        Ok(())
    } else {
        Err(Error::EmptyDomain {
            start: range.start,
            end: range.end,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Surface;

    #[test]
    fn what_cannot_be_split_or_raised_is_told_why() {
        let line = Curve::line(DVec3::ZERO, DVec3::X, 0.0..1.0).unwrap();
        let cubic = line.elevated(3).unwrap();
        let knots = cubic.knots().clone();
        let points: Vec<_> = (0..16).map(|k| DVec3::X * f64::from(k)).collect();
        let surface = Surface::new(knots.clone(), knots, &points, None).unwrap();
        for t in [0.0, 1.0, 2.0, f64::NAN] {
            let message = format!("parameter {t} is not inside the domain from 0 to 1");
            assert_eq!(cubic.split(t).unwrap_err().to_string(), message);
            assert_eq!(cubic.with_knot(t, 1).unwrap_err().to_string(), message);
            assert_eq!(cubic.refined(&[t]).unwrap_err().to_string(), message);
            assert_eq!(surface.split_u(t).unwrap_err().to_string(), message);
            assert_eq!(surface.split_v(t).unwrap_err().to_string(), message);
        }
        let message = "degree 2 is below the present degree 3";
        assert_eq!(cubic.elevated(2).unwrap_err().to_string(), message);
        assert_eq!(surface.elevated_u(2).unwrap_err().to_string(), message);
        assert_eq!(surface.elevated_v(2).unwrap_err().to_string(), message);
        let found = crate::MAX_DEGREE + 1;
        assert_eq!(cubic.elevated(found), Err(Error::Degree { found }));
    }

    #[test]
    #[should_panic(expected = "axes 0 and 1, not 2")]
    fn the_plane_has_two_axes() {
        let line = Curve::line(DVec2::ZERO, DVec2::X, 0.0..1.0).unwrap();
        line.crossings(2, 0.5, 1e-3);
    }
}
