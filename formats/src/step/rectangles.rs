//! Parts of surfaces that are trimmed by parameters only.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};
use kernel::{Curve, Surface, modelling};

use super::arcs::{Basis, Conic, End, between};
use super::nets::{of_surface, spline};
use super::surfaces::{Elementary, elementary};
use super::translator::Translator;
use crate::Problem;

impl Translator<'_> {
    /// A part of a surface that is trimmed by parameters only, as a surface of its own.
    pub(super) fn rectangle(&mut self, id: u64) -> Result<i64, Problem> {
        let made = self.rectangular(id);
        let surface = made.map_err(|problem| self.geometry().within(id, problem))?;
        let fields = of_surface(&surface);
        let name = self.exchange.get(id)?.attributes().text(0);
        Ok(self.add_named(0, &fields, id, name))
    }

    fn rectangular(&self, id: u64) -> Result<Surface, Problem> {
        let geometry = self.geometry();
        let record = geometry.get(id)?;
        let at = record.attributes();
        let basis = geometry.get(at.reference(1)?)?;
        let of = basis.attributes();
        let range = |first: usize| -> Result<[f64; 2], Problem> {
            Ok([at.number(first)?, at.number(first + 1)?])
        };
        let ([mut u, mut v], senses) = (
            [range(2)?, range(4)?],
            [at.is_true(6, true), at.is_true(7, true)],
        );
        if let Some(fields) = spline(geometry, &basis)? {
            let surface = crate::iges::surface(&fields)?;
            let [u, v] = [u, v].map(|[a, b]| a.min(b)..a.max(b));
            let part = surface
                .restricted_u(u)
                .and_then(|part| part.restricted_v(v));
            return part.map_err(Problem::Geometry);
        }
        let radians = self.units.radians;
        match basis.name() {
            "SURFACE_OF_LINEAR_EXTRUSION" => {
                let rail = self.rail(of.reference(1)?, u, senses[0])?;
                let [start, end] = ordered(v);
                let along = geometry.vector(of.reference(2)?)?;
                let rail = rail.transformed(&DAffine3::from_translation(along * start));
                let made = modelling::extrude(&rail, along * (end - start));
                return made.map_err(Problem::Geometry);
            }
            "SURFACE_OF_REVOLUTION" => {
                let rail = self.rail(of.reference(1)?, v, senses[1])?;
                let [origin, axis] = geometry.axis(of.reference(2)?)?;
                let [start, end] = turn(u, senses[0], radians);
                let made = modelling::revolve(&rail, origin, axis, start..end);
                // The angle comes first in the file, and the curve here.
                let made = made.map(|surface| surface.transposed());
                return made.map_err(Problem::Geometry);
            }
            _ => {}
        }
        let shape = elementary(basis.name(), of, radians)?;
        let frame = geometry.frame(of.reference(1)?)?;
        let angles = match shape {
            Elementary::Plane => [false; 2],
            Elementary::Cylinder(_) | Elementary::Cone(..) => [true, false],
            Elementary::Sphere(_) | Elementary::Torus(..) => [true; 2],
        };
        for ((range, is_angle), is_along) in [&mut u, &mut v].into_iter().zip(angles).zip(senses) {
            *range = if is_angle {
                turn(*range, is_along, radians)
            } else {
                ordered(*range)
            };
        }
        let (u, v) = (u[0]..u[1], v[0]..v[1]);
        let made = match shape {
            Elementary::Plane => {
                let corner = frame.origin() + frame.x() * u.start + frame.y() * v.start;
                let edges = [frame.x() * (u.end - u.start), frame.y() * (v.end - v.start)];
                modelling::plane(corner, edges[0], edges[1], u, v)
            }
            Elementary::Cylinder(radius) => modelling::cylinder(&frame, radius, u, v),
            Elementary::Cone(radius, angle) => modelling::cone(&frame, radius, angle, u, v),
            Elementary::Sphere(radius) => modelling::sphere(&frame, radius, u, v),
            Elementary::Torus(major, minor) => modelling::torus(&frame, major, minor, u, v),
        };
        made.map_err(Problem::Geometry)
    }

    /// The part of a curve that is swept, from one of its parameters to another one.
    fn rail(&self, id: u64, range: [f64; 2], is_along: bool) -> Result<Curve<DVec3>, Problem> {
        let geometry = self.geometry();
        let (id, record) = geometry.untrimmed(id)?;
        let basis = geometry.basis(id, 0)?;
        let counts_others = ["COMPOSITE_CURVE", "TRIMMED_CURVE", "CURVE_REPLICA"];
        if counts_others.iter().any(|name| record.starts_with(name)) {
            let text = format!("its parameters count along a {record}; that is not read");
            return Err(Problem::Unsupported(text));
        }
        let range = match &basis {
            Basis::Conic {
                shape: Conic::Ellipse(_),
                ..
            } => turn(range, is_along, self.units.radians),
            _ => ordered(range),
        };
        let pieces = between(&basis, Some(range.map(End::At)))?;
        let [piece] = &pieces[..] else {
            let text = "it has no width, or goes on over the seam of its curve".to_owned();
            return Err(Problem::Unsupported(text));
        };
        Ok(piece.clone())
    }
}

/// From the smaller to the larger one.
fn ordered([a, b]: [f64; 2]) -> [f64; 2] {
    [a.min(b), a.max(b)]
}

/// Angles in radians, the second one after the first.
fn turn([a, b]: [f64; 2], is_along: bool, radians: f64) -> [f64; 2] {
    let [start, end] = if is_along { [a, b] } else { [b, a] }.map(|angle| angle * radians);
    if end <= start {
        [start, end + TAU]
    } else {
        [start, end]
    }
}
