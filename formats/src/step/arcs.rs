//! Parts of curves between their ends.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::{DAffine3, DVec2, DVec3};
use kernel::modelling::{self, Frame};
use kernel::{Curve, KnotVector};

use crate::{Problem, least};

/// A point no farther from the end of a curve than this share of its size is that.
const MEETS: f64 = 1e-7;

/// A curve with ends so many times farther apart is closed if a part of it ends where it begins.
const ALMOST: f64 = 1e4;

/// Angles and parameters that differ by less than this share of a turn or domain are the same.
const SAME: f64 = 1e-9;

/// A curve without its ends.
#[derive(Clone, Debug)]
pub(super) enum Basis {
    /// A line, with the vector that its parameter counts.
    Line { origin: DVec3, along: DVec3 },
    /// A circle, ellipse, parabola or hyperbola, in the plane of its frame.
    Conic { frame: Frame, shape: Conic },
    /// Any other curve, which has ends.
    Free(Curve<DVec3>),
}

/// What conic a curve is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Conic {
    /// With the half axes.
    Ellipse(DVec2),
    /// With the focal distance.
    Parabola(f64),
    /// With the half axes.
    Hyperbola(DVec2),
}

/// Where a part of a curve begins or ends.
#[derive(Clone, Copy, Debug)]
pub(super) enum End {
    /// At the point nearest to this.
    Point(DVec3),
    /// At a parameter.
    At(f64),
}

/// Curves in the other direction, each turned.
pub(super) fn reversed(curves: &[Curve<DVec3>]) -> Vec<Curve<DVec3>> {
    curves.iter().rev().map(Curve::reversed).collect()
}

/// The part of a curve between its ends, in the direction of its parameter; the whole curve, if it is
/// closed, without ends. It is in pieces where it goes on over the seam of a closed one, and has
/// none where it has no length.
pub(super) fn between(basis: &Basis, ends: Option<[End; 2]>) -> Result<Vec<Curve<DVec3>>, Problem> {
    match basis {
        Basis::Line { origin, along } => {
            let Some(ends) = ends else {
                return Err(Problem::Unsupported("a line has no ends".to_owned()));
            };
            let [a, b] = ends.map(|end| match end {
                End::Point(point) => point,
                End::At(t) => *origin + *along * t,
            });
            if a == b {
                return Ok(Vec::new());
            }
            let line = Curve::line(a, b, 0.0..a.distance(b));
            line.map(|line| vec![line]).map_err(Problem::Geometry)
        }
        Basis::Conic { frame, shape } => {
            let curve = arc(frame, *shape, ends)?;
            Ok(vec![curve])
        }
        Basis::Free(curve) => match ends {
            None => Ok(vec![curve.clone()]),
            Some(ends) => cut(curve, ends).map_err(Problem::Geometry),
        },
    }
}

impl Basis {
    /// The curve that a map makes of it, which keeps angles.
    ///
    /// # Errors
    /// If the map takes away its axes.
    pub(super) fn transformed(&self, map: &DAffine3) -> Result<Self, Problem> {
        Ok(match self {
            Self::Line { origin, along } => Self::Line {
                origin: map.transform_point3(*origin),
                along: map.transform_vector3(*along),
            },
            Self::Conic { frame, shape } => {
                let [x, y] = [frame.x(), frame.y()].map(|axis| map.transform_vector3(axis));
                let origin = map.transform_point3(frame.origin());
                let frame = Frame::new(origin, x.cross(y), x).map_err(Problem::Geometry)?;
                let scale = x.length();
                let shape = match *shape {
                    Conic::Ellipse(axes) => Conic::Ellipse(axes * scale),
                    Conic::Parabola(focus) => Conic::Parabola(focus * scale),
                    Conic::Hyperbola(axes) => Conic::Hyperbola(axes * scale),
                };
                Self::Conic { frame, shape }
            }
            Self::Free(curve) => Self::Free(curve.transformed(map)),
        })
    }
}

impl Conic {
    /// The parameter of a point in the axes of the frame.
    pub(super) fn parameter(self, local: DVec2) -> f64 {
        match self {
            Self::Ellipse(axes) => f64::atan2(local.y / axes.y, local.x / axes.x),
            Self::Parabola(focus) => local.y / (2.0 * focus),
            Self::Hyperbola(axes) => (local.y / axes.y).asinh(),
        }
    }
}

/// The arc of a conic between its ends.
fn arc(frame: &Frame, shape: Conic, ends: Option<[End; 2]>) -> Result<Curve<DVec3>, Problem> {
    let parameter = |end: End| match end {
        End::At(t) => t,
        End::Point(point) => {
            let off = point - frame.origin();
            shape.parameter(DVec2::new(off.dot(frame.x()), off.dot(frame.y())))
        }
    };
    let range = ends.map(|ends| parameter(ends[0])..parameter(ends[1]));
    let has_length = |range: &Range<f64>| range.start < range.end;
    let bounded = || {
        let text = "a parabola or hyperbola ends where it begins, or before";
        let range = range.clone().filter(has_length);
        range.ok_or_else(|| Problem::Invalid(text.to_owned()))
    };
    let (range, control) = match shape {
        Conic::Ellipse(axes) => {
            let Range { start, mut end } = range.unwrap_or(0.0..TAU);
            end -= ((end - start) / TAU).floor() * TAU;
            if end - start <= SAME * TAU {
                end = start + TAU;
            }
            let [x, y] = [frame.x() * axes.x, frame.y() * axes.y];
            let end = end.min(start + TAU);
            let curve = modelling::arc(frame.origin(), x, y, start..end);
            return curve.map_err(Problem::Geometry);
        }
        Conic::Parabola(focus) => {
            let range = bounded()?;
            let at = |a: f64, b: f64| (focus * DVec2::new(a * b, a + b), 1.0);
            let Range { start: a, end: b } = range;
            (range, [at(a, a), at(a, b), at(b, b)])
        }
        Conic::Hyperbola(axes) => {
            let range = bounded()?;
            let at = |t: f64| axes * DVec2::new(t.cosh(), t.sinh());
            let Range { start, end } = range;
            let weight = ((end - start) / 2.0).cosh();
            let middle = at(f64::midpoint(start, end)) / weight;
            (range, [(at(start), 1.0), (middle, weight), (at(end), 1.0)])
        }
    };
    let points = control.map(|(p, _)| frame.origin() + frame.x() * p.x + frame.y() * p.y);
    let weights = control.map(|(_, weight)| weight);
    let knots = KnotVector::bezier(2, range).map_err(Problem::Geometry)?;
    Curve::new(knots, &points, Some(&weights)).map_err(Problem::Geometry)
}

/// The part of a curve with ends of its own between others.
fn cut(curve: &Curve<DVec3>, ends: [End; 2]) -> Result<Vec<Curve<DVec3>>, kernel::Error> {
    let domain = curve.domain();
    let near = curve.hull_bounds().diagonal() * MEETS;
    let own = [curve.start(), curve.end()];
    let is_closed = own[0].distance(own[1]) <= near;
    let parameter = |end: End, prefers_end: bool| match end {
        End::At(t) => t.clamp(domain.start, domain.end),
        End::Point(point) => {
            let [at_start, at_end] = own.map(|own| own.distance(point) <= near);
            match (at_start, at_end, prefers_end) {
                (true, true, true) | (false, true, _) => domain.end,
                (true, ..) => domain.start,
                _ => {
                    least::least(&curve.knots().breaks(), |t| {
                        curve.evaluate(t).distance(point)
                    })
                    .0
                }
            }
        }
    };
    let length = domain.end - domain.start;
    let range = parameter(ends[0], false)..parameter(ends[1], true);
    let range = curve.knots().snapped(range, SAME);
    let Range { start, end } = range;
    let part = |range: Range<f64>| match range.end - range.start {
        some if some <= SAME * length => Ok(None),
        some if some >= (1.0 - SAME) * length => Ok(Some(curve.clone())),
        _ => curve.restricted(range).map(Some),
    };
    let parts = if start < end && end - start > SAME * length {
        vec![part(start..end)?]
    } else if is_closed {
        vec![part(start..domain.end)?, part(domain.start..end)?]
    } else if start - end > SAME * length {
        vec![part(end..start)?.map(|curve| curve.reversed())]
    } else if own[0].distance(own[1]) <= near * ALMOST {
        vec![Some(curve.clone())]
    } else {
        Vec::new()
    };
    Ok(parts.into_iter().flatten().collect())
}
