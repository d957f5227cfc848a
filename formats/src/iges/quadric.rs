//! Planes, cylinders, cones, spheres and tori (types 108, 190 to 198): they have no borders
//! of their own, so that their surfaces are made as large as the trim curves need.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::modelling::{self, Frame};
use kernel::{KnotVector, Surface};

use super::curves::Reader;
use super::directory::{Entry, File, SHORT};
use super::parameters::Parameters;
use crate::Problem;

/// Points this near to an axis, relative to the size, have no angle around it.
const ON_AXIS: f64 = 1e-6;

/// How much larger than its trim curves a surface is made, as a share of their size.
const MARGIN: f64 = 1e-3;

/// What bounds a plane, and is narrower than this share of its length, bounds nothing.
const NARROW: f64 = 1e-10;

/// Apexes farther away than this many times the size of a cone are left out.
const FAR: f64 = 100.0;

/// A surface by its shape.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Quadric {
    pub frame: Frame,
    pub shape: Shape,
    /// Whether the file says where its angles begin.
    pub has_angles: bool,
}

/// The shapes, with lengths, and angles in radians. Parameters are those of the functions of
/// [`modelling`] with the same names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shape {
    Plane,
    Cylinder { radius: f64 },
    Cone { radius: f64, half_angle: f64 },
    Sphere { radius: f64 },
    Torus { major: f64, minor: f64 },
}

/// What programs mean by the parameters of quadrics.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    /// Whether angles are in degrees.
    in_degrees: bool,
    /// Whether the second parameter of a cone is measured along its lines, not along its axis.
    is_slanted: bool,
}

/// All of that, the usual first.
pub(super) const READINGS: [Reading; 4] = [
    Reading {
        in_degrees: true,
        is_slanted: false,
    },
    Reading {
        in_degrees: true,
        is_slanted: true,
    },
    Reading {
        in_degrees: false,
        is_slanted: false,
    },
    Reading {
        in_degrees: false,
        is_slanted: true,
    },
];

/// Reads a surface of the types 190 to 198.
pub(super) fn read(
    reader: &mut Reader<'_, '_>,
    entry: &Entry,
    p: &mut Parameters<'_>,
) -> Result<Quadric, Problem> {
    let file = reader.file;
    let location = location(reader, p.integer()?)?;
    let axis = match entry.kind {
        196 => None,
        _ => Some(vector(file, p.integer()?, 123)?),
    };
    let shape = match entry.kind {
        190 => Shape::Plane,
        192 => Shape::Cylinder { radius: p.real()? },
        194 => Shape::Cone {
            radius: p.real()?,
            half_angle: p.real()?.to_radians(),
        },
        196 => Shape::Sphere { radius: p.real()? },
        _ => Shape::Torus {
            major: p.real()?,
            minor: p.real()?,
        },
    };
    let has_angles = entry.form == 1;
    let mut direction = || match has_angles.then(|| p.integer_or(0)) {
        Some(Ok(pointer)) if pointer != 0 => vector(file, pointer, 123).map(Some),
        _ => Ok(None),
    };
    let axis = match axis {
        Some(axis) => axis,
        None => direction()?.unwrap_or(DVec3::Z),
    };
    let frame = match direction()? {
        Some(reference) => {
            Frame::new(location, axis, reference).or_else(|_| Frame::about(location, axis))
        }
        None => Frame::about(location, axis),
    };
    let frame = frame.map_err(Problem::Geometry)?;
    let quadric = Quadric {
        frame,
        shape,
        has_angles,
    };
    // The shape is checked where its surface is made, here only what finds points on it.
    match shape {
        Shape::Cone { half_angle, .. } if half_angle.abs() >= FRAC_PI_2 => {
            let text = format!("the half angle of the cone is {}", half_angle.to_degrees());
            Err(Problem::Invalid(text))
        }
        _ => Ok(quadric),
    }
}

/// A plane by its equation `A x + B y + C z = D` (type 108).
pub(super) fn plane(parameters: &mut Parameters<'_>) -> Result<Quadric, Problem> {
    let mut real = || parameters.real();
    let normal = DVec3::new(real()?, real()?, real()?);
    let distance = real()?;
    let square = normal.length_squared();
    let origin = normal * (distance / square);
    let frame = Frame::about(origin, normal).map_err(Problem::Geometry)?;
    // The usual axes, where the plane has them.
    let flat = Frame::new(origin, normal, DVec3::X).unwrap_or(frame);
    Ok(Quadric {
        frame: flat,
        shape: Shape::Plane,
        has_angles: false,
    })
}

/// A point (type 116), where its transformation places it.
fn location(reader: &mut Reader<'_, '_>, pointer: i64) -> Result<DVec3, Problem> {
    let file = reader.file;
    let point = vector(file, pointer, 116)?;
    let index = file.follow(pointer, "a point")?;
    let place = reader
        .transforms
        .follow(file, file.entries[index].transform)?;
    Ok(place.transform_point3(point))
}

/// The coordinates of a point (type 116) or direction (type 123).
fn vector(file: &File<'_>, pointer: i64, kind: i64) -> Result<DVec3, Problem> {
    let index = file.follow(pointer, "a point or direction")?;
    if file.entries[index].kind != kind {
        let text = format!("{} is not of type {kind}", file.source(index));
        return Err(Problem::Invalid(text));
    }
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, SHORT, &mut buffer)?;
    let (x, y) = (parameters.real()?, parameters.real()?);
    Ok(DVec3::new(x, y, parameters.real_or(0.0)?))
}

impl Quadric {
    /// Whether it has no border of its own, and no end.
    pub(super) fn is_boundless(&self) -> bool {
        !matches!(self.shape, Shape::Sphere { .. } | Shape::Torus { .. })
    }

    /// A point in the axes of the frame.
    fn local(&self, point: DVec3) -> DVec3 {
        let offset = point - self.frame.origin();
        DVec3::new(
            offset.dot(self.frame.x()),
            offset.dot(self.frame.y()),
            offset.dot(self.frame.z()),
        )
    }

    /// The same surface, told from where some points of it are: a cone goes on beyond its apex.
    pub(super) fn near(self, points: &[DVec3]) -> Result<Self, Problem> {
        let Shape::Cone { radius, half_angle } = self.shape else {
            return Ok(self);
        };
        let heights: f64 = points.iter().map(|&p| self.local(p).z).sum();
        let height = heights / points.len().max(1) as f64;
        let there = radius + height * half_angle.tan();
        if there >= 0.0 {
            return Ok(self);
        }
        let frame = &self.frame;
        let origin = frame.origin() + frame.z() * height;
        let frame = Frame::new(origin, frame.z(), frame.x()).map_err(Problem::Geometry)?;
        let shape = Shape::Cone {
            radius: -there,
            half_angle: -half_angle,
        };
        Ok(Self {
            frame,
            shape,
            ..self
        })
    }

    /// How far a point is from it, wherever it ends.
    pub(super) fn off(&self, point: DVec3) -> f64 {
        let p = self.local(point);
        let across = p.x.hypot(p.y);
        let off = match self.shape {
            Shape::Plane => p.z,
            Shape::Cylinder { radius } => across - radius,
            Shape::Cone { radius, half_angle } => {
                let at_height = (radius + p.z * half_angle.tan()).abs();
                (across - at_height) * half_angle.cos()
            }
            Shape::Sphere { radius } => p.length() - radius,
            Shape::Torus { major, minor } => (across - major).hypot(p.z) - minor.abs(),
        };
        off.abs()
    }

    /// The parameters of a point on the surface, angles in radians. Angles are taken next to
    /// those of `guess`, and from there where a point has none.
    pub(super) fn locate(&self, point: DVec3, guess: Option<DVec2>) -> DVec2 {
        let p = self.local(point);
        let out = p.truncate().length();
        let guessed = guess.unwrap_or_default();
        let near = |angle: f64, guess: f64| angle + ((guess - angle) / TAU).round() * TAU;
        let angle = |y: f64, x: f64, axis: usize| match guess {
            Some(guess) => near(f64::atan2(y, x), guess[axis]),
            None => f64::atan2(y, x).rem_euclid(TAU),
        };
        let scale = match self.shape {
            Shape::Plane => return p.truncate(),
            Shape::Cylinder { radius } | Shape::Sphere { radius } => radius,
            Shape::Cone { radius, .. } => radius.max(p.z.abs()),
            Shape::Torus { major, .. } => major,
        };
        let around = if out <= ON_AXIS * scale {
            guessed.x
        } else {
            angle(p.y, p.x, 0)
        };
        match self.shape {
            Shape::Plane => p.truncate(),
            Shape::Cylinder { .. } | Shape::Cone { .. } => DVec2::new(around, p.z),
            Shape::Sphere { .. } => DVec2::new(around, f64::atan2(p.z, out)),
            Shape::Torus { major, minor } => {
                let off = |out: f64| (DVec2::new(out - major, p.z).length() - minor).abs();
                // Where the tube reaches over the axis, the point belongs to the other side.
                if minor > major && off(-out) < off(out) {
                    let other = angle(-p.y, -p.x, 0);
                    return DVec2::new(other, angle(p.z, -out - major, 1));
                }
                DVec2::new(around, angle(p.z, out - major, 1))
            }
        }
    }

    /// The point at parameters of a file.
    pub(super) fn point(&self, uv: DVec2, reading: Reading) -> DVec3 {
        let angle = |x: f64| {
            if reading.in_degrees {
                x.to_radians()
            } else {
                x
            }
        };
        let (frame, u, v) = (&self.frame, angle(uv.x), angle(uv.y));
        let [across, along] = match self.shape {
            Shape::Plane => return frame.origin() + frame.x() * uv.x + frame.y() * uv.y,
            Shape::Cylinder { radius } => [radius, uv.y],
            Shape::Cone { radius, half_angle } if reading.is_slanted => {
                [radius + uv.y * half_angle.sin(), uv.y * half_angle.cos()]
            }
            Shape::Cone { radius, half_angle } => [radius + uv.y * half_angle.tan(), uv.y],
            Shape::Sphere { radius } => [radius * v.cos(), radius * v.sin()],
            Shape::Torus { major, minor } => [major + minor * v.cos(), minor * v.sin()],
        };
        let out = frame.x() * u.cos() + frame.y() * u.sin();
        frame.origin() + out * across + frame.z() * along
    }

    /// The surface as large as the hull of some points needs; `None` if it has no border of
    /// its own and there are no points.
    pub(super) fn surface(&self, hull: &[DVec3]) -> Result<Option<Surface>, Problem> {
        let span = |axis: usize| -> Option<Range<f64>> {
            let values = || hull.iter().map(|&p| self.local(p)[axis]);
            let start = values().fold(f64::INFINITY, f64::min);
            let end = values().fold(f64::NEG_INFINITY, f64::max);
            let margin = match hull.len() {
                0 => return None,
                _ => (end - start) * MARGIN,
            };
            Some(start - margin..end + margin)
        };
        let frame = &self.frame;
        let made = match self.shape {
            Shape::Plane => match (span(0), span(1)) {
                (Some(u), Some(v)) => {
                    let [a, b] = [&u, &v].map(|range| range.end - range.start);
                    if a.min(b) <= a.max(b) * NARROW {
                        return Err(Problem::Geometry(kernel::Error::NothingInside));
                    }
                    let origin = frame.origin() + frame.x() * u.start + frame.y() * v.start;
                    let edges = [frame.x() * (u.end - u.start), frame.y() * (v.end - v.start)];
                    modelling::plane(origin, edges[0], edges[1], u, v)
                }
                _ => return Ok(None),
            },
            Shape::Cylinder { radius } => match span(2) {
                Some(heights) if heights.is_empty() => {
                    return Err(Problem::Geometry(kernel::Error::NothingInside));
                }
                Some(heights) => modelling::cylinder(frame, radius, 0.0..TAU, heights),
                None => return Ok(None),
            },
            Shape::Cone { radius, half_angle } => match span(2) {
                Some(heights) => {
                    let heights = self.with_apex(radius, half_angle, &heights);
                    modelling::cone(frame, radius, half_angle, 0.0..TAU, heights)
                }
                None => return Ok(None),
            },
            Shape::Sphere { radius } => {
                modelling::sphere(frame, radius, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2)
            }
            Shape::Torus { major, minor } => {
                modelling::torus(frame, major, minor, 0.0..TAU, 0.0..TAU)
            }
        };
        made.map(Some).map_err(Problem::Geometry)
    }

    /// Heights of a cone up to its apex, unless that is far away: a single curve around the
    /// cone bounds its tip.
    fn with_apex(&self, radius: f64, half_angle: f64, heights: &Range<f64>) -> Range<f64> {
        let apex = -radius / half_angle.tan();
        let Range { start, end } = *heights;
        let grows = half_angle > 0.0;
        let [near, far] = if grows { [start, end] } else { [end, start] };
        let size = (end - start) + (radius + far * half_angle.tan()).abs();
        let tip = if (near - apex).abs() <= FAR * size {
            apex
        } else {
            near
        };
        // What lies beyond the apex is another cone.
        if grows {
            tip.max(apex)..end
        } else {
            start..tip.min(apex)
        }
    }

    /// Which parameters are angles.
    pub(super) fn angles(&self) -> [bool; 2] {
        match self.shape {
            Shape::Plane => [false, false],
            Shape::Cylinder { .. } | Shape::Cone { .. } => [true, false],
            Shape::Sphere { .. } | Shape::Torus { .. } => [true, true],
        }
    }

    /// The normal at the middle of the parameters of the file, half a turn from where angles begin;
    /// `None` where the file does not say where that is.
    pub(super) fn normal(&self) -> Option<DVec3> {
        let frame = &self.frame;
        let normal = match self.shape {
            Shape::Plane => return Some(frame.z()),
            Shape::Cylinder { .. } | Shape::Sphere { .. } => -frame.x(),
            Shape::Cone { half_angle, .. } => {
                -frame.x() * half_angle.cos() - frame.z() * half_angle.sin()
            }
            // On the inside of the ring.
            Shape::Torus { .. } => frame.x(),
        };
        Some(normal).filter(|_| self.has_angles)
    }

    /// The surface at a distance along its normal; of a cone it begins at the apex where the radius
    /// would be negative.
    pub(super) fn offset(&self, distance: f64) -> Result<Self, Problem> {
        let mut moved = self.clone();
        let check = |length: f64| match length {
            length if length > 0.0 => Ok(length),
            found => Err(Problem::Geometry(kernel::Error::NotPositive { found })),
        };
        match &mut moved.shape {
            Shape::Plane => {
                let frame = &self.frame;
                let origin = frame.origin() + frame.z() * distance;
                moved.frame =
                    Frame::new(origin, frame.z(), frame.x()).map_err(Problem::Geometry)?;
            }
            Shape::Cylinder { radius } | Shape::Sphere { radius } => {
                *radius = check(*radius + distance)?;
            }
            Shape::Cone { radius, half_angle } => {
                *radius += distance / half_angle.cos();
                if *radius < 0.0 {
                    let frame = &self.frame;
                    let apex = frame.origin() - frame.z() * (*radius / half_angle.tan());
                    moved.frame =
                        Frame::new(apex, frame.z(), frame.x()).map_err(Problem::Geometry)?;
                    *radius = 0.0;
                }
            }
            Shape::Torus { minor, .. } => *minor = check(*minor + distance)?,
        }
        Ok(moved)
    }
}

/// The knot parameter for an angle of the file, beyond the domain too.
pub(super) fn wound(knots: &KnotVector, angle: f64) -> f64 {
    let Range { start, end } = knots.domain();
    let turns = ((angle - start) / (end - start)).floor();
    let turns = if (end - start - TAU).abs() < 1e-6 && !(start..=end).contains(&angle) {
        turns
    } else {
        0.0
    };
    let shift = turns * (end - start);
    modelling::arc_parameter(knots, angle - shift) + shift
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_every_shape_are_located() {
        let frame = Frame::new(DVec3::new(1.0, 2.0, 3.0), DVec3::ONE, DVec3::X).unwrap();
        for shape in [
            Shape::Plane,
            Shape::Cylinder { radius: 2.0 },
            Shape::Cone {
                radius: 1.0,
                half_angle: 0.3,
            },
            Shape::Cone {
                radius: 1.0,
                half_angle: -0.3,
            },
            Shape::Sphere { radius: 2.0 },
            Shape::Torus {
                major: 3.0,
                minor: 1.0,
            },
            Shape::Torus {
                major: 1.0,
                minor: 3.0,
            },
        ] {
            let quadric = Quadric {
                frame,
                shape,
                has_angles: false,
            };
            let hull = [DVec3::new(5.0, 4.0, 3.0), DVec3::new(0.0, 1.0, 4.0)];
            let uv = DVec2::new(0.7, 0.3);
            let found = quadric.locate(quadric.point(uv, READINGS[2]), Some(uv));
            assert!(found.distance(uv) < 1e-12, "{shape:?}: {found}");
            let surface = quadric.surface(&hull).unwrap().unwrap();
            let knots = [surface.knots_u(), surface.knots_v()];
            for k in 0..50 {
                let share = DVec2::new(f64::from(k % 7) / 7.0, f64::from(k) / 50.0);
                let uv = [0, 1].map(|axis: usize| {
                    let Range { start, end } = knots[axis].domain();
                    start + (end - start) * share[axis]
                });
                let point = surface.evaluate(uv.into());
                let mut found = quadric.locate(point, None);
                for axis in 0..2 {
                    if quadric.angles()[axis] {
                        found[axis] = wound(knots[axis], found[axis]);
                    }
                }
                let again = surface.evaluate(found);
                assert!(again.distance(point) < 1e-12, "{shape:?}: {uv:?} {found}");
            }
        }
    }
}
