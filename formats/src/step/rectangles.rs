//! Parts of surfaces that are trimmed by parameters only.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};
use kernel::{Curve, Surface, modelling};

use super::arcs::{Basis, Conic, End, between};
use super::curves::NESTING;
use super::nets::{of_surface, spline};
use super::surfaces::{Elementary, Sheet, elementary, is_reversed};
use super::translator::Translator;
use super::values::Record;
use crate::Problem;

/// What of a surface is left: from one parameter to another along u and along v, and whether each is run through as
/// it is along the surface.
#[derive(Clone, Copy)]
struct Part {
    u: [f64; 2],
    v: [f64; 2],
    senses: [bool; 2],
}

impl Translator<'_> {
    /// A part of a surface that is trimmed by parameters only, as a surface of its own.
    pub(super) fn rectangle(&mut self, id: u64) -> Result<Sheet, Problem> {
        let made = self.rectangle_of(id);
        made.map_err(|problem| self.geometry().within(id, problem))
    }

    fn rectangle_of(&mut self, id: u64) -> Result<Sheet, Problem> {
        let record = self.exchange.get(id)?;
        let at = record.attributes();
        let range = |first: usize| -> Result<[f64; 2], Problem> {
            Ok([at.number(first)?, at.number(first + 1)?])
        };
        let part = Part {
            u: range(2)?,
            v: range(4)?,
            senses: [at.is_true(6, true), at.is_true(7, true)],
        };
        let sheet = self.part(id, at.reference(1)?, part, 0)?;
        Ok(sheet.turned(is_reversed(at)))
    }

    /// A part of a surface with a number, in the name of `id`: what is offset or moved is that part of what is below.
    fn part(&mut self, id: u64, surface: u64, part: Part, depth: usize) -> Result<Sheet, Problem> {
        if depth > NESTING {
            let text = format!("surfaces are nested more than {NESTING} deep");
            return Err(Problem::Unsupported(text));
        }
        let record = self.geometry().get(surface)?;
        let at = record.attributes();
        let name = self.exchange.get(id)?.attributes().text(0);
        match record.name() {
            // Its parameters are those of what it is a part of.
            "RECTANGULAR_TRIMMED_SURFACE" => {
                self.count(surface);
                let sheet = self.part(id, at.reference(1)?, part, depth + 1)?;
                Ok(sheet.turned(is_reversed(at)))
            }
            "SURFACE_REPLICA" => {
                self.count(surface);
                let map = self.geometry().map(at.reference(2)?)?;
                let parent = at.reference(1)?;
                self.moved(&map, id, |own| own.part(id, parent, part, depth + 1))
            }
            "OFFSET_SURFACE" => {
                let (base, distance) = self.offset_base(&record)?;
                let moved = std::mem::take(&mut self.transform);
                let base = self.part(id, base, part, depth + 1);
                self.transform = moved;
                let base = base?;
                let pointer = self.add_named(0, &base.offset(distance), id, name);
                Ok(Sheet { pointer, ..base })
            }
            _ => {
                let fields = of_surface(&self.rectangular(&record, part)?);
                Ok(Sheet::from(self.add_named(0, &fields, id, name)))
            }
        }
    }

    fn rectangular(&self, basis: &Record<'_>, part: Part) -> Result<Surface, Problem> {
        let geometry = self.geometry();
        let of = basis.attributes();
        let Part {
            mut u,
            mut v,
            senses,
        } = part;
        if let Some(fields) = spline(geometry, basis)? {
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
