//! Circular and elliptical arcs.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

use glam::{DVec2, DVec3};

use super::{Frame, check_point, check_positive};
use crate::{Curve, Error, KnotVector};

/// A range of angles this close to one turn is one turn, and an angle this close to a pole is
/// the pole, in radians: angles in files may have been rounded to single precision.
pub(super) const ANGLE_ROUNDING: f64 = 2e-7;

/// The arc `center + x cos a + y sin a` for the angles `a` from `angles.start` to
/// `angles.end`, in radians.
///
/// With perpendicular `x` and `y` of one length the arc is circular, else elliptical. The
/// degree is 2 and the knots are angles, one for each piece of at most 90 degrees
/// \[Piegl 97, A7.1\]. An arc of one turn ends where it starts to the last bit.
///
/// # Errors
/// If a number is not finite, the range is empty or longer than one turn, or `x` or `y` has
/// no length.
pub fn arc(center: DVec3, x: DVec3, y: DVec3, angles: Range<f64>) -> Result<Curve<DVec3>, Error> {
    for point in [center, x, y] {
        check_point(point)?;
    }
    if x == DVec3::ZERO || y == DVec3::ZERO {
        return Err(Error::NoDirection);
    }
    let unit = UnitArc::new(angles)?;
    let points: Vec<_> = unit
        .points
        .iter()
        .map(|p| center + x * p.x + y * p.y)
        .collect();
    Curve::new(unit.knots, &points, Some(&unit.weights))
}

/// The full circle around the z axis of `frame`, over the angles 0 to 2 pi.
///
/// # Errors
/// If the radius is not positive and finite.
pub fn circle(frame: &Frame, radius: f64) -> Result<Curve<DVec3>, Error> {
    check_positive(radius)?;
    arc(frame.origin, frame.x * radius, frame.y * radius, 0.0..TAU)
}

/// The parameter at which an arc with these knots, or a surface with them along an angle,
/// has reached `angle`, in radians; both agree at the knots.
///
/// In a piece with half the angle `h`, `s` from 0 to 1 and the angle `a` from its middle are
/// related by `2 s - 1 = tan(a / 2) / tan(h / 2)`. Angles outside the domain are clamped.
pub fn arc_parameter(knots: &KnotVector, angle: f64) -> f64 {
    let Range { start, end } = knots.domain();
    let angle = angle.max(start).min(end);
    let span = knots.span(angle);
    let (left, right) = (knots.as_slice()[span], knots.as_slice()[span + 1]);
    let (middle, half) = (f64::midpoint(left, right), (right - left) * 0.5);
    let share = ((angle - middle) * 0.5).tan() / (half * 0.5).tan();
    (middle + share * half).max(left).min(right)
}

/// The angle that an arc with these knots, or a surface with them along an angle, has reached
/// at a parameter, in radians: the inverse of [`arc_parameter`]. Parameters outside the domain
/// are clamped.
pub fn arc_angle(knots: &KnotVector, parameter: f64) -> f64 {
    let Range { start, end } = knots.domain();
    let parameter = parameter.max(start).min(end);
    let span = knots.span(parameter);
    let (left, right) = (knots.as_slice()[span], knots.as_slice()[span + 1]);
    let (middle, half) = (f64::midpoint(left, right), (right - left) * 0.5);
    let share = (parameter - middle) / half;
    let angle = middle + 2.0 * (share * (half * 0.5).tan()).atan();
    angle.max(left).min(right)
}

/// The control points of an arc of the unit circle.
pub(super) struct UnitArc {
    /// Degree 2, double knots inside.
    pub(super) knots: KnotVector,
    /// Cartesian points; those between the pieces lie on the circle.
    pub(super) points: Vec<DVec2>,
    /// Weights, 1 between the pieces.
    pub(super) weights: Vec<f64>,
}

impl UnitArc {
    pub(super) fn new(angles: Range<f64>) -> Result<Self, Error> {
        let Range { start, end } = angles;
        let sweep = end - start;
        if !(sweep > 0.0 && sweep.is_finite()) {
            return Err(Error::EmptyDomain { start, end });
        }
        if sweep > TAU + ANGLE_ROUNDING {
            let full = start + TAU;
            return Err(Error::Parameter {
                found: end,
                start,
                end: full,
            });
        }
        let closed = (sweep - TAU).abs() <= ANGLE_ROUNDING;
        let turned = if closed { TAU } else { sweep };
        let pieces = (1..4)
            .find(|&n| sweep <= FRAC_PI_2 * f64::from(n) + ANGLE_ROUNDING)
            .unwrap_or(4);
        let step = turned / f64::from(pieces);
        let first = unit_vector(start);
        let (mut knots, mut points, mut weights) = (vec![start; 3], vec![first], vec![1.0]);
        let mut before = first;
        for i in 1..=pieces {
            let last = i == pieces;
            let knot = start + sweep / f64::from(pieces) * f64::from(i);
            let after = match (last, closed) {
                (true, true) => first,
                (true, false) => unit_vector(end),
                _ => unit_vector(start + step * f64::from(i)),
            };
            // The tangents at both ends meet here.
            points.push((before + after) / (1.0 + step.cos()));
            points.push(after);
            weights.extend([(step * 0.5).cos(), 1.0]);
            knots.extend([if last { end } else { knot }; 2]);
            before = after;
        }
        knots.push(end);
        let knots = KnotVector::new(2, knots)?;
        Ok(Self {
            knots,
            points,
            weights,
        })
    }
}

/// The way from the first of three points to the centre of the circle through them; not finite where
/// they lie on a line.
pub fn to_center([a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac);
    let sum = normal.cross(ab) * ac.length_squared() + ac.cross(normal) * ab.length_squared();
    sum / (2.0 * normal.length_squared())
}

/// `(cos a, sin a)`, exact at multiples of 90 degrees.
fn unit_vector(angle: f64) -> DVec2 {
    let quarters = (angle / FRAC_PI_2).round();
    if (angle - quarters * FRAC_PI_2).abs() <= 2.0 * f64::EPSILON * angle.abs() {
        return match quarters.rem_euclid(4.0) {
            q if q < 0.5 => DVec2::X,
            q if q < 1.5 => DVec2::Y,
            q if q < 2.5 => DVec2::NEG_X,
            _ => DVec2::NEG_Y,
        };
    }
    DVec2::from_angle(angle)
}
