//! Surfaces, each as an entity of the draft.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DAffine3, DVec2, DVec3};
use kernel::Curve;
use kernel::modelling::{self, Frame};

use super::arcs::{Basis, Conic, End, between};
use super::curves::NESTING;
use super::nets::spline;
use super::translator::Translator;
use super::values::{Attributes, Record};
use crate::Problem;
use crate::iges::Fields;

/// How much larger a surface is made than its trim curves need, as a share of their size.
pub(super) const MARGIN: f64 = 1e-2;

/// Directions are parallel, and a curve meets an axis, up to this.
pub(super) const PARALLEL: f64 = 1e-9;

/// A half angle of a cone of a quarter turn or more is in degrees, whatever the file says.
const FLAT: f64 = FRAC_PI_2;

/// A surface in the draft.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sheet {
    pub pointer: i64,
    /// Whether its normal is opposite to that of the file.
    pub is_turned: bool,
}

impl From<i64> for Sheet {
    fn from(pointer: i64) -> Self {
        Self {
            pointer,
            is_turned: false,
        }
    }
}

impl Sheet {
    /// The same, turned round or not.
    pub(super) fn turned(self, is_turned: bool) -> Self {
        Self {
            is_turned: self.is_turned != is_turned,
            ..self
        }
    }

    /// The surface at a distance from it, on the side of the normal of the file.
    pub(super) fn offset(self, distance: f64) -> Fields {
        let side = if self.is_turned { -1.0 } else { 1.0 };
        let fields = Fields::new(140).reals([0.0, 0.0, 0.0, side * distance]);
        fields.integers([self.pointer])
    }
}

/// Whether what is trimmed by parameters has its normal against that of what it is a part of.
pub(super) fn is_reversed(at: Attributes<'_, '_>) -> bool {
    at.is_true(6, true) != at.is_true(7, true)
}

impl Translator<'_> {
    /// A surface. Where it has no end, it is large enough for what is around its face.
    pub(super) fn surface(
        &mut self,
        id: u64,
        around: &[DVec3],
        depth: usize,
    ) -> Result<Sheet, Problem> {
        let known = self.surfaces.get(&id).filter(|_| self.transform == 0);
        if let Some(known) = known {
            return known.clone();
        }
        if depth > NESTING {
            let text = format!("surfaces are nested more than {NESTING} deep");
            return Err(Problem::Unsupported(text));
        }
        let record = self.geometry().get(id)?;
        let is_swept = matches!(
            record.name(),
            "SURFACE_OF_LINEAR_EXTRUSION"
                | "SURFACE_OF_REVOLUTION"
                | "OFFSET_SURFACE"
                | "SURFACE_REPLICA"
                | "RECTANGULAR_TRIMMED_SURFACE"
                | "TOROIDAL_SURFACE"
        );
        let made = self.named_surface(id, &record, around, depth);
        let made = made.map_err(|problem| self.geometry().within(id, problem));
        if !is_swept && self.transform == 0 {
            self.surfaces.insert(id, made.clone());
        }
        made
    }

    fn named_surface(
        &mut self,
        id: u64,
        record: &Record<'_>,
        around: &[DVec3],
        depth: usize,
    ) -> Result<Sheet, Problem> {
        let at = record.attributes();
        match record.name() {
            "PLANE"
            | "CYLINDRICAL_SURFACE"
            | "CONICAL_SURFACE"
            | "SPHERICAL_SURFACE"
            | "TOROIDAL_SURFACE"
            | "DEGENERATE_TOROIDAL_SURFACE" => {
                let frame = self.geometry().frame(at.reference(1)?)?;
                let shape = elementary(record.name(), at, self.units.radians)?;
                if let Elementary::Torus(major, minor) = shape
                    && major < minor
                {
                    let wanted = record.name().starts_with('D').then(|| at.is_true(4, true));
                    return self.spindle(id, &frame, [major, minor], wanted, around);
                }
                Ok(Sheet::from(self.quadric(id, &frame, shape)))
            }
            "SURFACE_OF_LINEAR_EXTRUSION" => self.extrusion(id, at, around).map(Sheet::from),
            "SURFACE_OF_REVOLUTION" => self.revolution(id, at, around),
            "OFFSET_SURFACE" => {
                let (base, distance) = self.offset_base(record)?;
                let moved = std::mem::take(&mut self.transform);
                let base = self.surface(base, around, depth + 1);
                self.transform = moved;
                let base = base?;
                Ok(Sheet {
                    pointer: self.add_surface(0, &base.offset(distance), id),
                    ..base
                })
            }
            // Without edges its own ends are what bounds it.
            "RECTANGULAR_TRIMMED_SURFACE" if around.is_empty() => {
                self.count(id);
                self.rectangle(id)
            }
            "RECTANGULAR_TRIMMED_SURFACE" => {
                self.count(id);
                let sheet = self.surface(at.reference(1)?, around, depth + 1)?;
                Ok(sheet.turned(is_reversed(at)))
            }
            "SURFACE_REPLICA" => {
                let map = self.geometry().map(at.reference(2)?)?;
                let back = map.inverse();
                let there: Vec<_> = around.iter().map(|&p| back.transform_point3(p)).collect();
                let parent = at.reference(1)?;
                self.moved(&map, id, |own| own.surface(parent, &there, depth + 1))
            }
            _ => {
                let fields = spline(self.geometry(), record)?;
                let fields = fields.ok_or_else(|| self.geometry().unread(id, "surface"))?;
                Ok(Sheet::from(self.add_surface(0, &fields, id)))
            }
        }
    }

    /// What a surface is offset from, and how far: the sum of those that are offset from each other.
    pub(super) fn offset_base(&mut self, record: &Record<'_>) -> Result<(u64, f64), Problem> {
        let (mut base, mut distance) = (
            record.attributes().reference(1)?,
            record.attributes().number(2)?,
        );
        for _ in 0..NESTING {
            let below = self.geometry().get(base)?;
            if below.name() != "OFFSET_SURFACE" {
                break;
            }
            self.count(base);
            distance += below.attributes().number(2)?;
            base = below.attributes().reference(1)?;
        }
        Ok((base, distance))
    }

    /// Adds a plane, cylinder, cone, sphere or torus.
    pub(super) fn quadric(&mut self, id: u64, frame: &Frame, shape: Elementary) -> i64 {
        let location = self.vector(116, frame.origin(), id);
        let axis = self.vector(123, frame.z(), id);
        let reference = self.vector(123, frame.x(), id);
        let fields = |kind: i64| Fields::new(kind).integers([location]);
        let fields = match shape {
            Elementary::Plane => fields(190).integers([axis, reference]),
            Elementary::Cylinder(radius) => {
                let fields = fields(192).integers([axis]).reals([radius]);
                fields.integers([reference])
            }
            Elementary::Cone(radius, angle) => {
                let fields = fields(194).integers([axis]);
                let fields = fields.reals([radius, angle.to_degrees()]);
                fields.integers([reference])
            }
            Elementary::Sphere(radius) => {
                let fields = fields(196).reals([radius]);
                fields.integers([axis, reference])
            }
            Elementary::Torus(major, minor) => {
                let fields = fields(198).integers([axis]).reals([major, minor]);
                fields.integers([reference])
            }
        };
        self.add_surface(1, &fields, id)
    }

    /// A torus that crosses itself: its outer or its inner sheet, as is wanted or as what is around
    /// its face tells.
    pub(super) fn spindle(
        &mut self,
        id: u64,
        frame: &Frame,
        [major, minor]: [f64; 2],
        wanted: Option<bool>,
        around: &[DVec3],
    ) -> Result<Sheet, Problem> {
        let off = |p: &DVec3, side: f64| {
            let off = *p - frame.origin();
            let height = off.dot(frame.z());
            let out = (off - frame.z() * height).length();
            ((out - side * major).hypot(height) - minor).abs()
        };
        let votes = around.iter().filter(|p| off(p, 1.0) <= off(p, -1.0));
        let is_outer = wanted.unwrap_or(2 * votes.count() >= around.len());
        // Where the tube meets the axis.
        let turn = (-major / minor).acos();
        let angles = if is_outer {
            -turn..turn
        } else {
            turn..TAU - turn
        };
        let center = frame.origin() + frame.x() * major;
        let [out, up] = [frame.x() * minor, frame.z() * minor];
        let tube = modelling::arc(center, out, up, angles).map_err(Problem::Geometry)?;
        self.turned(id, &tube, [frame.origin(), frame.z()])
    }

    /// A curve moved along a vector.
    fn extrusion(
        &mut self,
        id: u64,
        at: Attributes<'_, '_>,
        around: &[DVec3],
    ) -> Result<i64, Problem> {
        let geometry = self.geometry();
        let vector = geometry.vector(at.reference(2)?)?;
        let along = vector.try_normalize();
        let along = along.ok_or(Problem::Geometry(kernel::Error::NoDirection))?;
        let basis = geometry.basis(at.reference(1)?, 0)?;
        if let Basis::Line {
            origin,
            along: line,
        } = basis
        {
            let frame = Frame::new(origin, line.cross(along), line).map_err(Problem::Geometry)?;
            return Ok(self.quadric(id, &frame, Elementary::Plane));
        }
        let curve = wide(&basis, |frame| {
            let across = frame.z().dot(along);
            let flat = |&p: &DVec3| {
                let off = p - frame.origin();
                let level = off - along * (off.dot(frame.z()) / across);
                DVec2::new(level.dot(frame.x()), level.dot(frame.y()))
            };
            around.iter().map(flat).collect()
        })?;
        let span = |points: &mut dyn Iterator<Item = DVec3>| {
            points.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], p| {
                let height = p.dot(along);
                [low.min(height), high.max(height)]
            })
        };
        let own = span(&mut curve.points());
        let other = span(&mut around.iter().copied());
        let [start, end] = if around.is_empty() {
            [0.0, vector.length()]
        } else {
            [other[0] - own[1], other[1] - own[0]]
        };
        let margin = (end - start) * MARGIN;
        let map = DAffine3::from_translation(along * (start - margin));
        let curve = curve.transformed(&map);
        let target = curve.start() + along * (end - start + 2.0 * margin);
        let rail = self.curve(&curve, id);
        let fields = Fields::new(122).integers([rail]).reals(target.to_array());
        Ok(self.add_surface(0, &fields, id))
    }

    /// A curve turned around an axis.
    fn revolution(
        &mut self,
        id: u64,
        at: Attributes<'_, '_>,
        around: &[DVec3],
    ) -> Result<Sheet, Problem> {
        let geometry = self.geometry();
        let [origin, axis] = geometry.axis(at.reference(2)?)?;
        let axis = axis.try_normalize();
        let axis = axis.ok_or(Problem::Geometry(kernel::Error::NoDirection))?;
        let basis = geometry.basis(at.reference(1)?, 0)?;
        if let Basis::Conic { frame, shape } = &basis {
            let conic = (frame, *shape);
            if let Some(sheet) = self.crossing(id, conic, [origin, axis], around)? {
                return Ok(sheet);
            }
        }
        let height = |p: DVec3| (p - origin).dot(axis);
        let curve = match &basis {
            Basis::Line {
                origin: start,
                along,
            } => {
                if let Some((frame, shape)) = straight(*start, *along, origin, axis)? {
                    return Ok(Sheet {
                        pointer: self.quadric(id, &frame, shape),
                        is_turned: !matches!(shape, Elementary::Plane) && along.dot(axis) < 0.0,
                    });
                }
                // A hyperboloid: between the heights of what is around it.
                let rise = along.dot(axis);
                let heights = around.iter().map(|&p| (height(p) - height(*start)) / rise);
                let range = widened(heights).ok_or_else(endless)?;
                first(between(
                    &basis,
                    Some([End::At(range[0]), End::At(range[1])]),
                )?)?
            }
            Basis::Conic {
                frame,
                shape: Conic::Ellipse(axes),
            } if is_sphere(frame, *axes, origin, axis) => {
                let is_turned = frame.y().dot(axis) < 0.0;
                // In the middle of the half on which the normal is that one.
                let [x, y] = [frame.x().dot(axis), frame.y().dot(axis)];
                let middle = if is_turned {
                    f64::atan2(x, -y)
                } else {
                    f64::atan2(-x, y)
                };
                let conic = (frame, Conic::Ellipse(*axes));
                let is_turned =
                    is_turned != self.is_on_other_half(id, conic, [origin, axis], middle);
                let frame = Frame::about(frame.origin(), axis).map_err(Problem::Geometry)?;
                return Ok(Sheet {
                    pointer: self.quadric(id, &frame, Elementary::Sphere(axes.x)),
                    is_turned,
                });
            }
            _ => self.profile(id, &basis, [origin, axis], around)?,
        };
        self.turned(id, &curve, [origin, axis])
    }

    /// A curve turned around an axis (type 120).
    fn turned(
        &mut self,
        id: u64,
        curve: &Curve<DVec3>,
        [origin, axis]: [DVec3; 2],
    ) -> Result<Sheet, Problem> {
        let rail = self.curve(curve, id);
        // The angle is the first parameter here and the second there: turned the other way round the
        // normal stays.
        let line = Curve::line(origin, origin - axis, 0.0..1.0).map_err(Problem::Geometry)?;
        let line = self.curve(&line, id);
        let fields = Fields::new(120).integers([line, rail]).reals([0.0, TAU]);
        Ok(Sheet::from(self.add_surface(0, &fields, id)))
    }
}

/// The shapes that a frame places, with lengths and half angles in radians.
#[derive(Clone, Copy, Debug)]
pub(super) enum Elementary {
    Plane,
    Cylinder(f64),
    Cone(f64, f64),
    Sphere(f64),
    Torus(f64, f64),
}

/// The shape of a record; `unit` are the radians in the unit of angles.
pub(super) fn elementary(
    name: &str,
    at: Attributes<'_, '_>,
    unit: f64,
) -> Result<Elementary, Problem> {
    Ok(match name {
        "PLANE" => Elementary::Plane,
        "CYLINDRICAL_SURFACE" => Elementary::Cylinder(at.number(2)?),
        "CONICAL_SURFACE" => {
            let (radius, angle) = (at.number(2)?, at.number(3)?);
            let radians = match angle * unit {
                angle if angle.abs() < FLAT => angle,
                _ => angle.to_radians(),
            };
            if radians.abs() < PARALLEL {
                Elementary::Cylinder(radius)
            } else {
                Elementary::Cone(radius, radians)
            }
        }
        "SPHERICAL_SURFACE" => Elementary::Sphere(at.number(2)?),
        "TOROIDAL_SURFACE" | "DEGENERATE_TOROIDAL_SURFACE" => {
            Elementary::Torus(at.number(2)?.abs(), at.number(3)?.abs())
        }
        _ => {
            let text = format!("{name} is no surface that is read");
            return Err(Problem::Unsupported(text));
        }
    })
}

/// What a straight line becomes around an axis, but for a hyperboloid.
fn straight(
    start: DVec3,
    along: DVec3,
    origin: DVec3,
    axis: DVec3,
) -> Result<Option<(Frame, Elementary)>, Problem> {
    let along = along.try_normalize();
    let along = along.ok_or(Problem::Geometry(kernel::Error::NoDirection))?;
    let off = start - origin;
    let out = off - axis * off.dot(axis);
    let size = off.length().max(f64::MIN_POSITIVE);
    let rise = along.dot(axis);
    let frame = |origin: DVec3, axis: DVec3, reference: DVec3| {
        Frame::new(origin, axis, reference).or_else(|_| Frame::about(origin, axis))
    };
    let made = if along.cross(axis).length() <= PARALLEL {
        let frame = frame(origin, axis * rise.signum(), out);
        Some((frame, Elementary::Cylinder(out.length())))
    } else if rise.abs() <= PARALLEL && out.cross(along).length() <= PARALLEL * size {
        // A line that runs outwards turns to its left.
        let side = if along.dot(out) < 0.0 { axis } else { -axis };
        let foot = origin + axis * off.dot(axis);
        Some((frame(foot, side, along), Elementary::Plane))
    } else if off.dot(along.cross(axis)).abs() <= PARALLEL * size {
        let level = along - axis * rise;
        let slope = level.length() / rise.abs();
        let is_out = level.dot(out) >= 0.0;
        // Along the axis as the line runs.
        let up = axis * rise.signum();
        let radius = out.length();
        let (radius, angle) = if is_out {
            (radius, slope.atan())
        } else {
            (radius, -slope.atan())
        };
        let foot = origin + axis * off.dot(axis);
        let reference = if radius > 0.0 { out } else { level };
        Some((frame(foot, up, reference), Elementary::Cone(radius, angle)))
    } else {
        None
    };
    let Some((frame, shape)) = made else {
        return Ok(None);
    };
    Ok(Some((frame.map_err(Problem::Geometry)?, shape)))
}

/// Whether a circle becomes a sphere around an axis: its middle is on that, and it lies along it.
fn is_sphere(frame: &Frame, axes: DVec2, origin: DVec3, axis: DVec3) -> bool {
    let off = frame.origin() - origin;
    let radius = axes.x;
    (axes.x - axes.y).abs() <= PARALLEL * radius
        && off.cross(axis).length() <= PARALLEL * radius.max(off.length())
        && frame.z().dot(axis).abs() <= PARALLEL
}

/// Why a surface cannot be made.
pub(super) fn endless() -> Problem {
    Problem::Unsupported("it has no end, because no curves of space bound it".to_owned())
}

/// The only piece of a curve.
pub(super) fn first(pieces: Vec<Curve<DVec3>>) -> Result<Curve<DVec3>, Problem> {
    pieces.into_iter().next().ok_or_else(endless)
}

/// The ends of a range of numbers, with some room; `None` without numbers.
fn widened(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let mut range: Option<[f64; 2]> = None;
    for value in values {
        let [low, high] = range.unwrap_or([value; 2]);
        range = Some([low.min(value), high.max(value)]);
    }
    let [low, high] = range?;
    let room = MARGIN * (high - low).max(MARGIN * low.abs().max(high.abs()));
    Some([low - room, high + room])
}

/// A curve that is long enough for some points, which are given in the axes of a conic that has no
/// end.
pub(super) fn wide(
    basis: &Basis,
    points: impl FnOnce(&Frame) -> Vec<DVec2>,
) -> Result<Curve<DVec3>, Problem> {
    let ends = match basis {
        Basis::Conic { frame, shape } => match shape {
            Conic::Ellipse(_) => None,
            shape => {
                let points = points(frame);
                let range = widened(points.into_iter().map(|p| shape.parameter(p)));
                Some(range.ok_or_else(endless)?.map(End::At))
            }
        },
        _ => None,
    };
    first(between(basis, ends)?)
}
