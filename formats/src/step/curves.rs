//! Points, placements and curves.

use glam::{DAffine3, DMat3, DVec2, DVec3};
use kernel::Curve;
use kernel::modelling::Frame;

use super::arcs::{Basis, Conic, End, between, reversed};
use super::part21::Exchange;
use super::values::{Attributes, Record, Value, numbers, references};
use crate::Problem;
use crate::iges::Net;

/// How deep curves and surfaces may be made of others.
pub(super) const NESTING: usize = 16;

/// Directions that differ by less are the same.
const SAME: f64 = 1e-9;

/// Reads geometry that is not bound to anything else.
#[derive(Clone, Copy, Debug)]
pub(super) struct Geometry<'a> {
    pub exchange: &'a Exchange<'a>,
    /// Radians in the unit of angles that the file uses.
    pub angle: f64,
    /// How many control points one curve or surface may have.
    pub limit: usize,
}

impl<'a> Geometry<'a> {
    pub(super) fn get(&self, id: u64) -> Result<Record<'a>, Problem> {
        self.exchange.get(id)
    }

    /// The instance in a problem with it.
    pub(super) fn within(&self, id: u64, problem: Problem) -> Problem {
        let source = self.exchange.source(id);
        match problem {
            // What it refers to has said who it is.
            Problem::Invalid(text) if !text.starts_with('#') => {
                Problem::Invalid(format!("{source}: {text}"))
            }
            Problem::Unsupported(text) if !text.starts_with('#') => {
                Problem::Unsupported(format!("{source}: {text}"))
            }
            other => other,
        }
    }

    /// A point, also that of a vertex.
    pub(super) fn point(&self, id: u64) -> Result<DVec3, Problem> {
        let record = self.get(id)?;
        match record.name() {
            "CARTESIAN_POINT" => record.coordinates(1).map_err(|p| self.within(id, p)),
            "VERTEX_POINT" => {
                let point = record.attributes().reference(1)?;
                let record = self.get(point)?;
                if record.name() != "CARTESIAN_POINT" {
                    return Err(self.unread(point, "point"));
                }
                record.coordinates(1).map_err(|p| self.within(point, p))
            }
            _ => Err(self.unread(id, "point")),
        }
    }

    /// What to say of an instance that is not of a type that is read where it stands.
    pub(super) fn unread(&self, id: u64, what: &str) -> Problem {
        let source = self.exchange.source(id);
        Problem::Unsupported(format!("{source} is no {what} that is read"))
    }

    pub(super) fn points(&self, ids: &[u64]) -> Result<Vec<DVec3>, Problem> {
        if ids.len() > self.limit {
            let text = format!("{} points; the limit is {}", ids.len(), self.limit);
            return Err(Problem::TooLarge(text));
        }
        ids.iter().map(|&id| self.point(id)).collect()
    }

    /// A direction, of any length.
    fn direction(&self, id: u64) -> Result<DVec3, Problem> {
        self.get(id)?.coordinates(1)
    }

    /// The direction at a place of a record, if there is one.
    fn direction_at(&self, at: Attributes<'_, '_>, place: usize) -> Result<Option<DVec3>, Problem> {
        match at.get(place) {
            None | Some(Value::Nothing) => Ok(None),
            _ => self.direction(at.reference(place)?).map(Some),
        }
    }

    /// A vector: a direction with a length.
    pub(super) fn vector(&self, id: u64) -> Result<DVec3, Problem> {
        let record = self.get(id)?;
        let at = record.attributes();
        if record.name() == "DIRECTION" {
            return record.coordinates(1);
        }
        let direction = self.direction(at.reference(1)?)?;
        let unit = direction.try_normalize();
        let unit = unit.ok_or(Problem::Geometry(kernel::Error::NoDirection))?;
        Ok(unit * at.number(2)?)
    }

    /// A placement of two axes; those that are left out, or do not tell, are the usual ones.
    pub(super) fn frame(&self, id: u64) -> Result<Frame, Problem> {
        let record = self.get(id)?;
        let at = record.attributes();
        let origin = self.point(at.reference(1)?)?;
        let axis = self.direction_at(at, 2)?.unwrap_or(DVec3::Z);
        let reference = self.direction_at(at, 3)?;
        let usual = if axis.y.abs() + axis.z.abs() <= SAME * axis.x.abs() {
            DVec3::Y
        } else {
            DVec3::X
        };
        let made = reference.map(|reference| Frame::new(origin, axis, reference));
        let frame = match made {
            Some(Ok(frame)) => Ok(frame),
            _ => Frame::new(origin, axis, usual),
        };
        frame.map_err(Problem::Geometry)
    }

    /// A placement of one axis: a point and a direction.
    pub(super) fn axis(&self, id: u64) -> Result<[DVec3; 2], Problem> {
        let record = self.get(id)?;
        let at = record.attributes();
        let origin = self.point(at.reference(1)?)?;
        Ok([origin, self.direction_at(at, 2)?.unwrap_or(DVec3::Z)])
    }

    /// The map that a placement or a transformation operator stands for.
    pub(super) fn map(&self, id: u64) -> Result<DAffine3, Problem> {
        let record = self.get(id)?;
        if record.name() == "AXIS2_PLACEMENT_3D" {
            let frame = self.frame(id)?;
            let axes = DMat3::from_cols(frame.x(), frame.y(), frame.z());
            return Ok(DAffine3::from_mat3_translation(axes, frame.origin()));
        }
        let name = "CARTESIAN_TRANSFORMATION_OPERATOR_3D";
        if record.name() != name {
            return Err(self.unread(id, "placement"));
        }
        // How many names and descriptions come first depends on the writer.
        let at = record.attributes();
        let first = at.0.len().saturating_sub(5);
        let [x, y] = [0, 1].map(|k| self.direction_at(at, first + k));
        let (x, y, z) = (x?, y?, self.direction_at(at, first + 4)?);
        let origin = self.point(at.reference(first + 2)?)?;
        let scale = match at.get(first + 3) {
            None | Some(Value::Nothing) => 1.0,
            _ => at.number(first + 3)?,
        };
        // Left out it is the usual one, unless the others are not across that.
        let is_flat = |v: DVec3| v.z.abs() <= SAME * v.length();
        let across = x.zip(y).filter(|&(x, y)| !(is_flat(x) && is_flat(y)));
        let across = across.map(|(x, y)| x.cross(y));
        let axis = z.or(across).unwrap_or(DVec3::Z);
        let usual = axis.any_orthogonal_vector();
        let reference = x.unwrap_or_else(|| match axis.cross(DVec3::X) {
            parallel if parallel.length() < SAME => usual,
            _ => DVec3::X,
        });
        let frame = Frame::new(origin, axis, reference).map_err(Problem::Geometry)?;
        let is_mirrored = y.is_some_and(|y| y.dot(frame.y()) < 0.0);
        let second = if is_mirrored { -frame.y() } else { frame.y() };
        let axes = DMat3::from_cols(frame.x(), second, frame.z()) * scale;
        Ok(DAffine3::from_mat3_translation(axes, frame.origin()))
    }

    /// A curve without its ends.
    pub(super) fn basis(&self, id: u64, depth: usize) -> Result<Basis, Problem> {
        let id = self.in_space(id)?;
        let record = self.get(id)?;
        let at = record.attributes();
        match record.name() {
            "LINE" => Ok(Basis::Line {
                origin: self.point(at.reference(1)?)?,
                along: self.vector(at.reference(2)?)?,
            }),
            "CIRCLE" | "ELLIPSE" | "PARABOLA" | "HYPERBOLA" => self
                .conic(&record)
                .map_err(|problem| self.within(id, problem)),
            "CURVE_REPLICA" if depth < NESTING => {
                let map = self.map(at.reference(2)?)?;
                self.basis(at.reference(1)?, depth + 1)?.transformed(&map)
            }
            _ => {
                let pieces = self.pieces(id, depth)?;
                let (first, others) = pieces.split_first().ok_or_else(|| {
                    Problem::Invalid(format!("{} has no parts", self.exchange.source(id)))
                })?;
                let joined = first.joined(others).map_err(Problem::Geometry)?;
                Ok(Basis::Free(joined))
            }
        }
    }

    /// The curve whose parameter counts along another one that is trimmed, and its type.
    pub(super) fn untrimmed(&self, id: u64) -> Result<(u64, String), Problem> {
        let mut id = self.in_space(id)?;
        for _ in 0..NESTING {
            let record = self.get(id)?;
            let at = record.attributes();
            if record.name() != "TRIMMED_CURVE" || !at.is_true(4, true) {
                return Ok((id, record.name().to_owned()));
            }
            id = self.in_space(at.reference(1)?)?;
        }
        Ok((id, String::new()))
    }

    /// The curve of space of one on a surface.
    pub(super) fn in_space(&self, id: u64) -> Result<u64, Problem> {
        let record = self.get(id)?;
        let names = ["SURFACE_CURVE", "SEAM_CURVE", "INTERSECTION_CURVE"];
        if names.contains(&record.name()) {
            return record.attributes().reference(1);
        }
        // Bounded ones are complex.
        match names.iter().find_map(|name| record.part(name)) {
            Some(at) if record.parts.len() > 1 => at.reference(0),
            _ => Ok(id),
        }
    }

    fn conic(&self, record: &Record<'_>) -> Result<Basis, Problem> {
        let at = record.attributes();
        let frame = self.frame(at.reference(1)?)?;
        let length = |place: usize| match at.number(place)? {
            length if length > 0.0 => Ok(length),
            found => Err(Problem::Geometry(kernel::Error::NotPositive { found })),
        };
        let shape = match record.name() {
            "CIRCLE" => Conic::Ellipse(DVec2::splat(length(2)?)),
            "ELLIPSE" => Conic::Ellipse(DVec2::new(length(2)?, length(3)?)),
            "PARABOLA" => Conic::Parabola(length(2)?),
            _ => Conic::Hyperbola(DVec2::new(length(2)?, length(3)?)),
        };
        Ok(Basis::Conic { frame, shape })
    }

    /// A whole curve that has ends, or is closed, in its pieces.
    pub(super) fn pieces(&self, id: u64, depth: usize) -> Result<Vec<Curve<DVec3>>, Problem> {
        if depth > NESTING {
            let text = format!("curves are nested more than {NESTING} deep");
            return Err(Problem::Unsupported(text));
        }
        let id = self.in_space(id)?;
        let record = self.get(id)?;
        self.named_pieces(id, &record, depth)
            .map_err(|problem| self.within(id, problem))
    }

    fn named_pieces(
        &self,
        id: u64,
        record: &Record<'_>,
        depth: usize,
    ) -> Result<Vec<Curve<DVec3>>, Problem> {
        let at = record.attributes();
        match record.name() {
            "CIRCLE" | "ELLIPSE" => between(&self.conic(record)?, None),
            "LINE" | "PARABOLA" | "HYPERBOLA" => {
                let text = "it has no ends";
                Err(Problem::Unsupported(text.to_owned()))
            }
            "POLYLINE" => {
                let points = self.points(&at.references(1)?)?;
                let curve = Curve::polyline(&points).map_err(Problem::Geometry)?;
                Ok(vec![curve])
            }
            "TRIMMED_CURVE" => self.trimmed(at, depth),
            "COMPOSITE_CURVE"
            | "BOUNDARY_CURVE"
            | "OUTER_BOUNDARY_CURVE"
            | "COMPOSITE_CURVE_ON_SURFACE" => {
                let mut pieces = Vec::new();
                for segment in at.references(1)? {
                    let record = self.get(segment)?;
                    let at = record.attributes();
                    let mut parts = self.pieces(at.reference(2)?, depth + 1)?;
                    if !at.is_true(1, true) {
                        parts = reversed(&parts);
                    }
                    pieces.extend(parts);
                }
                Ok(pieces)
            }
            "CURVE_REPLICA" => {
                let map = self.map(at.reference(2)?)?;
                let pieces = self.pieces(at.reference(1)?, depth + 1)?;
                Ok(pieces.iter().map(|curve| curve.transformed(&map)).collect())
            }
            _ => match self.spline(record)? {
                Some(curve) => Ok(vec![curve]),
                None => Err(self.unread(id, "curve")),
            },
        }
    }

    /// A part of a curve that the file trims.
    fn trimmed(&self, at: Attributes<'_, '_>, depth: usize) -> Result<Vec<Curve<DVec3>>, Problem> {
        let basis = self.basis(at.reference(1)?, depth + 1)?;
        let is_along = at.is_true(4, true);
        let prefers_parameters = matches!(at.get(5), Some(Value::Word(b"PARAMETER")));
        let unit = match basis {
            Basis::Conic {
                shape: Conic::Ellipse(_),
                ..
            } => self.angle,
            _ => 1.0,
        };
        let end = |place: usize| -> Result<End, Problem> {
            let list = at.list(place)?;
            let parameter = list.iter().find_map(Value::number);
            let parameter = parameter.map(|t| End::At(t * unit));
            let point = list.iter().find_map(Value::reference);
            let point = match point {
                Some(id) => Some(End::Point(self.point(id)?)),
                None => None,
            };
            let best = if prefers_parameters {
                parameter.or(point)
            } else {
                point.or(parameter)
            };
            best.ok_or_else(|| Problem::Invalid("its end is not given".to_owned()))
        };
        let ends = [end(2)?, end(3)?];
        if is_along {
            between(&basis, Some(ends))
        } else {
            let pieces = between(&basis, Some([ends[1], ends[0]]))?;
            Ok(reversed(&pieces))
        }
    }

    /// A B-spline or Bézier curve; `None` if the record is none.
    fn spline(&self, record: &Record<'_>) -> Result<Option<Curve<DVec3>>, Problem> {
        let named = |name: &str| record.part(name).filter(|_| record.parts.len() > 1);
        let (at, first) = match named("B_SPLINE_CURVE") {
            Some(at) => (at, 0),
            None => (record.attributes(), 1),
        };
        let names = [
            "B_SPLINE_CURVE_WITH_KNOTS",
            "QUASI_UNIFORM_CURVE",
            "UNIFORM_CURVE",
            "BEZIER_CURVE",
        ];
        let Some(name) = names.iter().find(|name| record.part(name).is_some()) else {
            return Ok(None);
        };
        let degree = at.count(first)?;
        let points = self.points(&at.references(first + 1)?)?;
        let weights = match named("RATIONAL_B_SPLINE_CURVE") {
            Some(at) => at.numbers(0)?,
            None => vec![1.0; points.len()],
        };
        if weights.len() != points.len() {
            let text = "there are not as many weights as points";
            return Err(Problem::Invalid(text.to_owned()));
        }
        let knots = if *name == names[0] {
            let (at, first) = match named(name) {
                Some(at) => (at, 0),
                None => (record.attributes(), 6),
            };
            expanded(at, [first, first + 1], degree, points.len())?
        } else {
            implied(name, degree, points.len())?
        };
        let curve = Net::curve_of(degree, knots, points, weights);
        curve.map(Some).map_err(Problem::Geometry)
    }
}

/// The knots of multiplicities and values at two places.
pub(super) fn expanded(
    at: Attributes<'_, '_>,
    [multiplicities, values]: [usize; 2],
    degree: usize,
    count: usize,
) -> Result<Vec<f64>, Problem> {
    check_count(degree, count)?;
    let values = at.numbers(values)?;
    let list = at.list(multiplicities)?;
    let times: Result<Vec<_>, _> = (0..list.len()).map(|k| Attributes(list).count(k)).collect();
    let times = times?;
    let total = times.iter().fold(0_usize, |sum, n| sum.saturating_add(*n));
    let wanted = count.saturating_add(degree).saturating_add(1);
    if times.len() != values.len() {
        let text = format!("{} knots have {} multiplicities", values.len(), times.len());
        return Err(Problem::Invalid(text));
    }
    if total != wanted {
        let text = format!(
            "the multiplicities of the knots add up to {total}; {count} points of degree {degree} need {wanted}"
        );
        return Err(Problem::Invalid(text));
    }
    let runs = values.iter().zip(times);
    let knots = runs.flat_map(|(&value, n)| std::iter::repeat_n(value, n));
    Ok(knots.collect())
}

/// Refuses fewer points than a degree needs.
fn check_count(degree: usize, count: usize) -> Result<(), Problem> {
    if degree == 0 || count <= degree {
        let text = format!("{count} points are too few for degree {degree}");
        return Err(Problem::Invalid(text));
    }
    Ok(())
}

/// The knots that a type stands for.
pub(super) fn implied(name: &str, degree: usize, count: usize) -> Result<Vec<f64>, Problem> {
    let inner = if name.starts_with("BEZIER") {
        degree
    } else {
        1
    };
    let is_clamped = !name.starts_with("UNIFORM");
    check_count(degree, count)?;
    if !is_clamped {
        let knots = (0..=count + degree).map(|k| k as f64 - degree as f64);
        return Ok(knots.collect());
    }
    if !(count - degree - 1).is_multiple_of(inner) {
        let text = format!("{count} points are no Bézier pieces of degree {degree}");
        return Err(Problem::Invalid(text));
    }
    let pieces = (count - degree - 1) / inner + 1;
    let mut knots = vec![0.0; degree + 1];
    for k in 1..pieces {
        knots.extend(std::iter::repeat_n(k as f64, inner));
    }
    knots.extend(std::iter::repeat_n(pieces as f64, degree + 1));
    Ok(knots)
}

/// Rows of a list of lists, each as something, and of one length.
pub(super) fn rows<T>(
    list: &[Value<'_>],
    read: impl Fn(&[Value<'_>]) -> Result<Vec<T>, Problem>,
) -> Result<Vec<Vec<T>>, Problem> {
    let row = |value: &Value<'_>| read(value.list().unwrap_or_default());
    let rows: Vec<Vec<T>> = list.iter().map(row).collect::<Result<_, _>>()?;
    let width = rows.first().map_or(0, Vec::len);
    if width == 0 || rows.iter().any(|row| row.len() != width) {
        let text = "its control points are no grid: rows are empty or of different lengths";
        return Err(Problem::Invalid(text.to_owned()));
    }
    Ok(rows)
}

/// The rows of instances, and of numbers.
pub(super) fn reference_rows(list: &[Value<'_>]) -> Result<Vec<Vec<u64>>, Problem> {
    rows(list, references)
}

pub(super) fn number_rows(list: &[Value<'_>]) -> Result<Vec<Vec<f64>>, Problem> {
    rows(list, numbers)
}
