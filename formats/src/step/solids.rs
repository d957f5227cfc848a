//! Solids by construction: primitives, swept areas and faces, and what is combined of them.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};
use kernel::Curve;
use kernel::modelling::Frame;

use super::surfaces::Elementary;
use super::topology::bounded;
use super::translator::Translator;
use super::values::{Attributes, Record, Value};
use crate::Problem;
use crate::iges::Fields;

/// A curve no farther from an axis than this share of its size lies on it.
const ON_AXIS: f64 = 1e-9;

/// A turn that lacks no more than this share is whole.
const WHOLE: f64 = 1e-9;

/// The operation of a boolean tree (type 180) that unites.
const UNION: i64 = 1;

fn unsupported(text: &str) -> Problem {
    Problem::Unsupported(text.to_owned())
}

impl Translator<'_> {
    /// What a solid by construction becomes; `None` if that was told already.
    pub(super) fn constructed(
        &mut self,
        id: u64,
        record: &Record<'_>,
        depth: usize,
    ) -> Result<Option<i64>, Problem> {
        let at = record.attributes();
        let geometry = self.geometry();
        let fields = match record.name() {
            "CSG_SOLID" => {
                let made = self.item(at.reference(1)?, depth + 1);
                let held = made.filter(|_| self.styles.has_look(id));
                return Ok(held.map_or(made, |made| self.group(vec![made], id, at.text(0))));
            }
            "BOOLEAN_RESULT" | "BOOLEAN_CLIPPING_RESULT" => {
                return self.combination(id, at, depth);
            }
            "HALF_SPACE_SOLID" | "BOXED_HALF_SPACE" => {
                let text = "half spaces are not read: nothing bounds them";
                return Err(unsupported(text));
            }
            "RECTANGULAR_PYRAMID" => {
                let frame = geometry.frame(at.reference(1)?)?;
                let lengths = [at.number(2)?, at.number(3)?, at.number(4)?];
                let faces = self.pyramid(id, &frame, lengths)?;
                return Ok(self.closed(faces, id, at.text(0)));
            }
            "BLOCK" | "RIGHT_ANGULAR_WEDGE" => {
                let frame = geometry.frame(at.reference(1)?)?;
                let lengths = [at.number(2)?, at.number(3)?, at.number(4)?];
                let axes = [frame.origin(), frame.x(), frame.z()];
                let fields = if record.name() == "BLOCK" {
                    Fields::new(150).reals(lengths)
                } else {
                    Fields::new(152).reals(lengths).reals([at.number(5)?])
                };
                points(fields, axes)
            }
            "ELLIPSOID" => {
                let frame = geometry.frame(at.reference(1)?)?;
                let lengths = [at.number(2)?, at.number(3)?, at.number(4)?];
                let axes = [frame.origin(), frame.x(), frame.z()];
                points(Fields::new(168).reals(lengths), axes)
            }
            "RIGHT_CIRCULAR_CYLINDER" => {
                let axis = geometry.axis(at.reference(1)?)?;
                let fields = Fields::new(154).reals([at.number(2)?, at.number(3)?]);
                points(fields, axis)
            }
            "RIGHT_CIRCULAR_CONE" => {
                let [mut origin, mut axis] = geometry.axis(at.reference(1)?)?;
                let [height, mut radius, angle] = [at.number(2)?, at.number(3)?, at.number(4)?];
                let mut other = radius + height * (angle * self.units.radians).tan();
                // Of a pointed one the apex is at the other end.
                if radius.abs() <= 0.0 {
                    (origin, axis) = (origin + axis * height, -axis);
                    std::mem::swap(&mut radius, &mut other);
                }
                let fields = Fields::new(156).reals([height, radius, other]);
                points(fields, [origin, axis])
            }
            "SPHERE" => {
                let center = geometry.point(at.reference(2)?)?;
                points(Fields::new(158).reals([at.number(1)?]), [center])
            }
            "TORUS" => {
                let axis = geometry.axis(at.reference(1)?)?;
                let fields = Fields::new(160).reals([at.number(2)?, at.number(3)?]);
                points(fields, axis)
            }
            "EXTRUDED_AREA_SOLID" | "EXTRUDED_FACE_SOLID" => {
                let along = geometry.vector(at.reference(2)?)?.try_normalize();
                let along = along.ok_or(Problem::Geometry(kernel::Error::NoDirection))?;
                let sweep = Sweep::Along(along * at.number(3)?);
                let members = self.swept(id, at.reference(1)?, sweep)?;
                return Ok(self.closed(members, id, at.text(0)));
            }
            "REVOLVED_AREA_SOLID" | "REVOLVED_FACE_SOLID" => {
                let axis = geometry.axis(at.reference(2)?)?;
                let sweep = Sweep::Around(axis, at.number(3)? * self.units.radians);
                let members = self.swept(id, at.reference(1)?, sweep)?;
                return Ok(self.closed(members, id, at.text(0)));
            }
            _ => return Err(unsupported("it is of a type that is not read")),
        };
        Ok(Some(self.add_named(0, &fields, id, at.text(0))))
    }

    /// The solid that an operation makes of two others.
    fn combination(
        &mut self,
        id: u64,
        at: Attributes<'_, '_>,
        depth: usize,
    ) -> Result<Option<i64>, Problem> {
        let operation = match at.get(1) {
            Some(Value::Word(b"UNION")) => UNION,
            Some(Value::Word(b"INTERSECTION")) => 2,
            Some(Value::Word(b"DIFFERENCE")) => 3,
            _ => {
                let text = "an operation that is neither .UNION., .INTERSECTION. nor .DIFFERENCE.";
                return Err(Problem::Invalid(text.to_owned()));
            }
        };
        let solids = [at.reference(2)?, at.reference(3)?];
        match solids.map(|solid| self.item(solid, depth + 1)) {
            [Some(first), Some(second)] => {
                let fields = Fields::new(180).integers([3, -first, -second, operation]);
                Ok(Some(self.add_named(0, &fields, id, at.text(0))))
            }
            [Some(only), None] | [None, Some(only)] if operation == UNION => {
                self.tell(
                    id,
                    "one of its two solids is not read; the other one is shown",
                );
                Ok(Some(only))
            }
            solids => {
                // In what is shown nowhere, the other one does not stand for itself.
                self.definition(solids.into_iter().flatten().collect(), id, String::new());
                Err(unsupported("one of its two solids is not read"))
            }
        }
    }

    /// A solid (type 186) of its faces; `None` without any.
    fn closed(&mut self, faces: Vec<i64>, id: u64, name: String) -> Option<i64> {
        if faces.is_empty() {
            return None;
        }
        let fields = Fields::new(514).count(faces.len());
        let fields = fields.integers(faces.into_iter().flat_map(|face| [face, 1]));
        let shell = self.add(1, &fields, id);
        let fields = Fields::new(186).integers([shell, 1, 0]);
        Some(self.add_named(0, &fields, id, name))
    }

    /// The faces of a pyramid: a corner of its base is at the origin, the sides there are along x and y, and
    /// the apex is above the middle.
    fn pyramid(
        &mut self,
        id: u64,
        frame: &Frame,
        [x, y, height]: [f64; 3],
    ) -> Result<Vec<i64>, Problem> {
        for found in [x, y, height] {
            if found <= 0.0 {
                return Err(Problem::Geometry(kernel::Error::NotPositive { found }));
            }
        }
        let at = |a: f64, b: f64, c: f64| {
            frame.origin() + frame.x() * (x * a) + frame.y() * (y * b) + frame.z() * (height * c)
        };
        let base = [
            at(0.0, 0.0, 0.0),
            at(0.0, 1.0, 0.0),
            at(1.0, 1.0, 0.0),
            at(1.0, 0.0, 0.0),
        ];
        let apex = at(0.5, 0.5, 1.0);
        let mut faces = vec![self.polygonal(id, &base)?];
        for (k, &corner) in base.iter().enumerate() {
            faces.push(self.polygonal(id, &[base[(k + 1) % 4], corner, apex])?);
        }
        Ok(faces)
    }

    /// The flat face inside corners, which run around its normal.
    fn polygonal(&mut self, id: u64, corners: &[DVec3]) -> Result<i64, Problem> {
        let along = corners[1] - corners[0];
        let normal = along.cross(corners[2] - corners[1]);
        let frame = Frame::new(corners[0], normal, along).map_err(Problem::Geometry)?;
        let surface = self.quadric(id, &frame, Elementary::Plane);
        let ends = corners.iter().zip(corners.iter().cycle().skip(1));
        let edges = ends.map(|(start, end)| Curve::line(*start, *end, 0.0..1.0));
        let edges: Result<Vec<_>, _> = edges.collect();
        let outline = self.wire(&edges.map_err(Problem::Geometry)?, id)?;
        let boundary = outline.map(|outline| self.boundary(surface, outline, id));
        let fields = bounded(surface, boundary.into_iter().collect());
        Ok(self.add(0, &fields, id))
    }

    /// The faces of what an area or a face sweeps: one for each of its edges, and itself at both ends.
    fn swept(&mut self, id: u64, area: u64, sweep: Sweep) -> Result<Vec<i64>, Problem> {
        let record = self.geometry().get(area)?;
        let at = record.attributes();
        // It is not shown for its own sake.
        self.known.items.insert(area, None);
        let mut outlines: Vec<Vec<Curve<DVec3>>> = Vec::new();
        let base = if record.name() == "CURVE_BOUNDED_SURFACE" {
            for boundary in at.references(2)? {
                outlines.push(self.geometry().pieces(boundary, 0)?);
            }
            at.reference(1)?
        } else {
            for stretches in self.loops(&at.references(1)?)? {
                let pieces = stretches.iter().flat_map(|(edge, _)| edge.pieces.clone());
                outlines.push(pieces.collect());
            }
            at.reference(2)?
        };
        let mut members = Vec::new();
        for curve in outlines.iter().flatten() {
            let count = curve.homogeneous().len();
            self.spend(count)?;
            members.extend(self.side(id, curve, &sweep)?);
        }
        let ends = match sweep.end() {
            None => Vec::new(),
            Some(end) => vec![DAffine3::IDENTITY, end],
        };
        let hull: Vec<DVec3> = outlines.iter().flatten().flat_map(Curve::points).collect();
        for map in ends {
            let surface = self.moved(&map, id, |own| own.surface(base, &hull, 0))?;
            let mut boundaries = Vec::new();
            for outline in &outlines {
                let moved: Vec<_> = outline.iter().map(|c| c.transformed(&map)).collect();
                let curve = self.wire(&moved, id)?;
                boundaries.extend(curve.map(|curve| self.boundary(surface.pointer, curve, id)));
            }
            let fields = bounded(surface.pointer, boundaries);
            members.push(self.add(0, &fields, id));
        }
        Ok(members)
    }

    /// What a curve passes over; nothing if it stays where it is.
    fn side(
        &mut self,
        id: u64,
        curve: &Curve<DVec3>,
        sweep: &Sweep,
    ) -> Result<Option<i64>, Problem> {
        let fields = match sweep {
            Sweep::Along(vector) => {
                let rail = self.curve(curve, id);
                let fields = Fields::new(122).integers([rail]);
                points(fields, [curve.start() + *vector])
            }
            Sweep::Around([origin, axis], angle) => {
                let near = curve.hull_bounds().diagonal() * ON_AXIS;
                let off = |p: DVec3| (p - *origin).reject_from(*axis).length();
                if curve.points().all(|p| off(p) <= near) {
                    return Ok(None);
                }
                let line = Curve::line(*origin, *origin + *axis, 0.0..1.0);
                let line = line.map_err(Problem::Geometry)?;
                let pointers = [self.curve(&line, id), self.curve(curve, id)];
                let fields = Fields::new(120).integers(pointers);
                fields.reals([0.0, angle.min(TAU)])
            }
        };
        Ok(Some(self.add(0, &fields, id)))
    }
}

/// How an area is swept.
#[derive(Clone, Copy, Debug)]
enum Sweep {
    /// Along a vector.
    Along(DVec3),
    /// Around an axis, a point and a direction, by an angle.
    Around([DVec3; 2], f64),
}

impl Sweep {
    /// Where it ends; `None` if that is where it begins.
    fn end(&self) -> Option<DAffine3> {
        match self {
            Self::Along(vector) => Some(DAffine3::from_translation(*vector)),
            Self::Around(_, angle) if *angle >= TAU * (1.0 - WHOLE) => None,
            Self::Around([origin, axis], angle) => {
                let turn = DAffine3::from_axis_angle(axis.normalize_or_zero(), *angle);
                let to = DAffine3::from_translation(*origin);
                Some(to * turn * to.inverse())
            }
        }
    }
}

/// With the coordinates of points.
fn points(fields: Fields, points: impl IntoIterator<Item = DVec3>) -> Fields {
    fields.reals(points.into_iter().flat_map(|point| point.to_array()))
}
