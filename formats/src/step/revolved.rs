//! Conics that are turned around an axis which they cross.
//!
//! The whole of them would be the same surface twice, or two sheets of which a face is on one.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DQuat, DVec2, DVec3};
use kernel::Curve;
use kernel::modelling::Frame;

use super::arcs::{Basis, Conic, End, between};
use super::surfaces::{MARGIN, PARALLEL, Sheet, endless, first, wide};
use super::topology::Edge;
use super::translator::Translator;
use crate::Problem;

impl Translator<'_> {
    /// The surface of a circle whose plane has the axis in it and which crosses that, but not in its
    /// middle; `None` for any other conic.
    pub(super) fn crossing(
        &mut self,
        id: u64,
        (frame, shape): (&Frame, Conic),
        [origin, axis]: [DVec3; 2],
        around: &[DVec3],
    ) -> Result<Option<Sheet>, Problem> {
        let Conic::Ellipse(axes) = shape else {
            return Ok(None);
        };
        let off = frame.origin() - origin;
        let out = off - axis * off.dot(axis);
        let (radius, major) = (axes.x, out.length());
        let is_flat = frame.z().dot(axis).abs() <= PARALLEL
            && frame.z().dot(out).abs() <= PARALLEL * radius
            && (axes.x - axes.y).abs() <= PARALLEL * radius;
        if !is_flat || major <= PARALLEL * radius || major >= radius {
            return Ok(None);
        }
        let torus = Frame::new(frame.origin() - out, axis, out).map_err(Problem::Geometry)?;
        let sheet = self.spindle(id, &torus, [major, radius], None, around)?;
        Ok(Some(Sheet {
            is_turned: frame.z().dot(out.cross(axis)) < 0.0,
            ..sheet
        }))
    }

    /// The curve that is turned around an axis, long enough for some points.
    pub(super) fn profile(
        &self,
        id: u64,
        basis: &Basis,
        [origin, axis]: [DVec3; 2],
        around: &[DVec3],
    ) -> Result<Curve<DVec3>, Problem> {
        if let Basis::Conic { frame, shape } = basis
            && let Some(half) = self.half(id, (frame, *shape), [origin, axis], around)?
        {
            return Ok(half);
        }
        wide(basis, |frame| {
            // Turned into the half plane of the curve, on either side of the axis.
            let out = (frame.origin() - origin) + frame.x();
            let out = (out - axis * out.dot(axis)).normalize_or_zero();
            let turned = |&p: &DVec3| {
                let up = (p - origin).dot(axis);
                let radius = (p - origin - axis * up).length();
                [radius, -radius].map(|radius| {
                    let off = origin + axis * up + out * radius - frame.origin();
                    DVec2::new(off.dot(frame.x()), off.dot(frame.y()))
                })
            };
            around.iter().flat_map(turned).collect()
        })
    }

    /// The half, on one side of the axis, of a conic that is the same on both; `None` for any other.
    fn half(
        &self,
        id: u64,
        (frame, shape): (&Frame, Conic),
        [origin, axis]: [DVec3; 2],
        around: &[DVec3],
    ) -> Result<Option<Curve<DVec3>>, Problem> {
        let off = frame.origin() - origin;
        let is_along = |way: DVec3| way.cross(axis).length() <= PARALLEL;
        let size = match shape {
            Conic::Ellipse(axes) | Conic::Hyperbola(axes) => axes.max_element(),
            Conic::Parabola(focus) => focus,
        };
        if off.cross(axis).length() > PARALLEL * size.max(off.length()) {
            return Ok(None);
        }
        let arc = |middle: f64| {
            let is_other = self.is_on_other_half(id, (frame, shape), [origin, axis], middle);
            let middle = if is_other { middle + PI } else { middle };
            [middle - FRAC_PI_2, middle + FRAC_PI_2]
        };
        let range = match shape {
            Conic::Ellipse(_) if is_along(frame.x()) => arc(FRAC_PI_2),
            Conic::Ellipse(_) if is_along(frame.y()) => arc(0.0),
            Conic::Parabola(_) | Conic::Hyperbola(_) if is_along(frame.x()) => {
                let reach = around.iter().map(|&p| {
                    let off = p - frame.origin();
                    let along = off.dot(frame.x());
                    let radius = (off - frame.x() * along).length();
                    shape.parameter(DVec2::new(along, radius))
                });
                let farthest = reach.reduce(f64::max).ok_or_else(endless)?;
                [0.0, farthest * (1.0 + MARGIN)]
            }
            _ => return Ok(None),
        };
        let basis = Basis::Conic {
            frame: *frame,
            shape,
        };
        first(between(&basis, Some(range.map(End::At)))?).map(Some)
    }

    /// Whether the face is beyond a half of an ellipse, around the parameter `middle`, that is turned around an axis
    /// and is the same on both sides of that: what the curves of the parameter domain tell. The normals of the two
    /// halves are opposite.
    pub(super) fn is_on_other_half(
        &self,
        id: u64,
        conic: (&Frame, Conic),
        axis: [DVec3; 2],
        middle: f64,
    ) -> bool {
        let edges = self.edges_around.iter();
        let places =
            edges.flat_map(|edge| self.places_along(id, edge, conic, axis).unwrap_or_default());
        places.map(|v| (v - middle).cos()).sum::<f64>() < 0.0
    }

    /// Where an edge is along a conic that is turned around an axis, as far as its curves of the parameter domain
    /// tell.
    fn places_along(
        &self,
        id: u64,
        edge: &Edge,
        conic: (&Frame, Conic),
        axis: [DVec3; 2],
    ) -> Result<Vec<f64>, Problem> {
        let geometry = self.geometry();
        let mut places = Vec::new();
        let Some(middle) = edge.middle() else {
            return Ok(places);
        };
        for flat in geometry.get(edge.curve)?.attributes().references(2)? {
            let record = geometry.get(flat)?;
            if record.name() == "PCURVE" && record.attributes().reference(1)? == id {
                let domain = geometry.get(record.attributes().reference(2)?)?;
                for curve in domain.attributes().references(1)? {
                    places.extend(self.place_along(curve, middle, conic, axis)?);
                }
            }
        }
        Ok(places)
    }

    /// The same of one curve of the parameter domain: a spline, or a line that runs along that domain. In space it
    /// passes through a point.
    fn place_along(
        &self,
        curve: u64,
        point: DVec3,
        (frame, shape): (&Frame, Conic),
        [origin, axis]: [DVec3; 2],
    ) -> Result<Option<f64>, Problem> {
        let geometry = self.geometry();
        let record = geometry.get(curve)?;
        let (at, unit) = (record.attributes(), self.units.radians);
        if record.name().starts_with("B_SPLINE_CURVE") {
            let points = geometry.points(&at.references(2)?)?;
            let sum: f64 = points.iter().map(|p| p.y * unit).sum();
            return Ok(Some(sum / points.len() as f64));
        }
        if record.name() != "LINE" {
            return Ok(None);
        }
        let start = geometry.point(at.reference(1)?)? * unit;
        let along = geometry.vector(at.reference(2)?)?;
        let least = along.length() * PARALLEL;
        if along.y.abs() <= least {
            return Ok(Some(start.y));
        }
        let back = DQuat::from_axis_angle(axis, -start.x) * (point - origin);
        let off = back + origin - frame.origin();
        let local = DVec2::new(off.dot(frame.x()), off.dot(frame.y()));
        Ok((along.x.abs() <= least).then(|| shape.parameter(local)))
    }
}
