//! Planes, cylinders, cones, spheres and tori.

use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use glam::{DVec2, DVec3};

use super::arc::{ANGLE_ROUNDING, UnitArc};
use super::{Frame, check_point, check_positive};
use crate::{Error, KnotVector, Surface};

/// A radius this much smaller than the numbers it is the difference of is zero.
const RADIUS_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// The parallelogram `origin + s edge_u + t edge_v`, with `s` and `t` from 0 to 1 over the
/// two domains. Its normal is along `edge_u x edge_v`.
///
/// # Errors
/// If a number is not finite, a domain is empty or the edges are parallel.
pub fn plane(
    origin: DVec3,
    edge_u: DVec3,
    edge_v: DVec3,
    domain_u: Range<f64>,
    domain_v: Range<f64>,
) -> Result<Surface, Error> {
    for point in [origin, edge_u, edge_v] {
        check_point(point)?;
    }
    let (u, v) = (super::direction(edge_u)?, super::direction(edge_v)?);
    if u.cross(v).length() < 1e-12 {
        return Err(Error::NoDirection);
    }
    let corners = [
        origin,
        origin + edge_v,
        origin + edge_u,
        origin + edge_u + edge_v,
    ];
    let knots_u = KnotVector::bezier(1, domain_u)?;
    Surface::new(knots_u, KnotVector::bezier(1, domain_v)?, &corners, None)
}

/// The cylinder around the z axis of `frame`: u is the angle, v the height along the axis.
/// Its normal points away from the axis.
///
/// # Errors
/// If the radius is not positive and finite, or a range is empty, not finite or, for
/// angles, longer than one turn.
pub fn cylinder(
    frame: &Frame,
    radius: f64,
    angles: Range<f64>,
    heights: Range<f64>,
) -> Result<Surface, Error> {
    check_positive(radius)?;
    let profile = Profile {
        points: [heights.start, heights.end]
            .map(|h| DVec2::new(radius, h))
            .into(),
        knots: KnotVector::bezier(1, heights)?,
        weights: vec![1.0; 2],
    };
    profile.turned(frame, angles)
}

/// The cone around the z axis of `frame` with the radius `radius + h tan(half_angle)` at the
/// height `h`: u is the angle, v the height along the axis. Its normal points away from the
/// axis.
///
/// `half_angle` is in radians between -90 and 90 degrees. A range of heights may begin or
/// end at the apex; the points there coincide, on the axis.
///
/// # Errors
/// If a number is not finite or a range empty, if the angles are longer than one turn, or if
/// the heights go beyond the apex.
pub fn cone(
    frame: &Frame,
    radius: f64,
    half_angle: f64,
    angles: Range<f64>,
    heights: Range<f64>,
) -> Result<Surface, Error> {
    if !(radius >= 0.0 && radius.is_finite()) {
        return Err(Error::NotPositive { found: radius });
    }
    if half_angle.is_nan() || half_angle.abs() >= FRAC_PI_2 {
        let (start, end) = (-FRAC_PI_2, FRAC_PI_2);
        return Err(Error::Parameter {
            found: half_angle,
            start,
            end,
        });
    }
    let mut points = Vec::new();
    for height in [heights.start, heights.end] {
        let growth = height * half_angle.tan();
        let sum = radius + growth;
        let apex = sum.abs() <= RADIUS_ROUNDING * radius.max(growth.abs());
        points.push(DVec2::new(if apex { 0.0 } else { sum }, height));
    }
    let (least, largest) = (points[0].x.min(points[1].x), points[0].x.max(points[1].x));
    if least < 0.0 {
        return Err(Error::NotPositive { found: least });
    }
    check_positive(largest)?;
    let profile = Profile {
        points,
        knots: KnotVector::bezier(1, heights)?,
        weights: vec![1.0; 2],
    };
    profile.turned(frame, angles)
}

/// The sphere around the origin of `frame`: u is the longitude from the x axis on, v the
/// latitude, from -90 degrees at the negative to 90 at the positive z axis, in radians.
/// Its normal points outwards.
///
/// # Errors
/// If the radius is not positive and finite, a range is empty, the longitudes are longer
/// than one turn or the latitudes go beyond a pole.
pub fn sphere(
    frame: &Frame,
    radius: f64,
    longitudes: Range<f64>,
    latitudes: Range<f64>,
) -> Result<Surface, Error> {
    check_positive(radius)?;
    let (start, end) = (-FRAC_PI_2, FRAC_PI_2);
    for found in [latitudes.start, latitudes.end] {
        if found.is_nan() || found.abs() > end + ANGLE_ROUNDING {
            return Err(Error::Parameter { found, start, end });
        }
    }
    let at_pole = |a: f64| end - a.abs() <= ANGLE_ROUNDING;
    let [south, north] =
        [latitudes.start, latitudes.end].map(|a| if at_pole(a) { end.copysign(a) } else { a });
    Profile::arc(0.0, radius, south..north)?.turned(frame, longitudes)
}

/// The torus around the z axis of `frame`: u is the angle around the axis, v the angle
/// around the tube, from the outside on towards the positive z axis, in radians. Its normal
/// points out of the tube.
///
/// `major` is the distance of the tube's middle from the axis, `minor` the tube's radius. If
/// it is larger, the surface meets itself.
///
/// # Errors
/// If a radius is not positive and finite, or a range is empty or longer than one turn.
pub fn torus(
    frame: &Frame,
    major: f64,
    minor: f64,
    angles: Range<f64>,
    tube: Range<f64>,
) -> Result<Surface, Error> {
    check_positive(major)?;
    check_positive(minor)?;
    Profile::arc(major, minor, tube)?.turned(frame, angles)
}

/// A curve of points (distance from the axis, height).
struct Profile {
    knots: KnotVector,
    points: Vec<DVec2>,
    weights: Vec<f64>,
}

impl Profile {
    /// The arc of `radius` around a middle at `distance` from the axis.
    fn arc(distance: f64, radius: f64, angles: Range<f64>) -> Result<Self, Error> {
        let unit = UnitArc::new(angles)?;
        let point = |p: &DVec2| DVec2::new(distance + radius * p.x, radius * p.y);
        Ok(Self {
            knots: unit.knots,
            points: unit.points.iter().map(point).collect(),
            weights: unit.weights,
        })
    }

    /// The surface that the profile passes over in turning around the z axis.
    fn turned(&self, frame: &Frame, angles: Range<f64>) -> Result<Surface, Error> {
        let unit = UnitArc::new(angles)?;
        let (mut points, mut weights) = (Vec::new(), Vec::new());
        for (around, weight) in unit.points.iter().zip(&unit.weights) {
            let outwards = frame.x * around.x + frame.y * around.y;
            let on_axis = |p: &DVec2| frame.origin + frame.z * p.y + outwards * p.x;
            points.extend(self.points.iter().map(on_axis));
            weights.extend(self.weights.iter().map(|w| w * weight));
        }
        Surface::new(unit.knots, self.knots.clone(), &points, Some(&weights))
    }
}
