//! Trim loops: boundaries (types 141, 142) and the curves of the parameter domain they name.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

use glam::{DAffine2, DMat2, DVec2};
use kernel::{Curve, KnotVector, TrimLoop};

use super::directory::{File, WHOLE};
use super::parameters::Parameters;
use super::transform::Transforms;
use crate::Problem;

/// Gap between two curves of a loop that is taken for rounding, relative to the diagonal of
/// the domain.
const GAP: f64 = 1e-3;

/// Largest gap that is bridged, in the same measure.
const WIDE_GAP: f64 = 1e-2;

/// The boundaries of a face.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Boundary {
    /// The whole domain.
    Natural,
    /// Loops only.
    Loops(Vec<i64>),
    /// The border of the domain, with holes.
    Holes(Vec<i64>),
    /// Edges of a solid, in space.
    Edges,
}

/// The trim loops of a face, as far as they lie in the parameter domain. What had to be
/// repaired goes to `repairs`.
pub(super) fn loops(
    file: &File<'_>,
    transforms: &mut Transforms,
    boundary: &Boundary,
    [u, v]: [Range<f64>; 2],
    repairs: &mut Vec<Problem>,
) -> Result<Vec<TrimLoop>, Problem> {
    let diagonal = DVec2::new(u.end - u.start, v.end - v.start).length();
    let mut loops = Vec::new();
    let pointers = match boundary {
        Boundary::Natural => return Ok(loops),
        Boundary::Edges => return Err(unsupported("edges of solids are not read yet")),
        Boundary::Loops(pointers) => pointers,
        Boundary::Holes(pointers) => {
            loops.push(TrimLoop::border(&u, &v).map_err(Problem::Geometry)?);
            pointers
        }
    };
    for &pointer in pointers {
        let mut reader = Reader {
            file,
            transforms,
            curves: Vec::new(),
        };
        for curve in boundary_curves(file, pointer)? {
            reader.add(curve, 0)?;
        }
        loops.push(joined(reader.curves, diagonal, repairs)?);
    }
    Ok(loops)
}

fn unsupported(text: &str) -> Problem {
    Problem::Unsupported(text.to_owned())
}

/// The loop of some curves; wide gaps are bridged and told.
fn joined(
    curves: Vec<Curve<DVec2>>,
    diagonal: f64,
    repairs: &mut Vec<Problem>,
) -> Result<TrimLoop, Problem> {
    let tolerance = diagonal * GAP;
    let tight = TrimLoop::new(aligned(curves.clone(), tolerance), tolerance);
    if let Err(kernel::Error::LoopGap { .. }) = tight {
        let tolerance = diagonal * WIDE_GAP;
        let wide = TrimLoop::new(aligned(curves, tolerance), tolerance);
        if wide.is_ok() {
            let text = "the curves of a trim loop do not quite meet; the gaps are bridged";
            repairs.push(Problem::Invalid(text.to_owned()));
        }
        return wide.map_err(Problem::Geometry);
    }
    tight.map_err(Problem::Geometry)
}

/// The pointers to the parameter-space curves of a boundary, in order.
fn boundary_curves(file: &File<'_>, pointer: i64) -> Result<Vec<i64>, Problem> {
    let index = file.follow(pointer, "a boundary")?;
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
    let mut curves = Vec::new();
    match file.entries[index].kind {
        142 => {
            parameters.integer()?;
            parameters.integer()?;
            curves.push(parameters.integer()?);
        }
        141 => {
            for _ in 0..3 {
                parameters.integer()?;
            }
            let count = parameters.count()?;
            for _ in 0..parameters.expect(count, "boundary curves")? {
                parameters.integer()?;
                parameters.integer()?;
                let own = parameters.pointers("curves of the parameter domain")?;
                curves.push(if own.is_empty() { 0 } else { own[0] });
                curves.extend(own.iter().skip(1));
            }
        }
        _ => {
            let text = format!("{} is no boundary", file.source(index));
            return Err(Problem::Invalid(text));
        }
    }
    if curves.contains(&0) {
        return Err(unsupported("a boundary is given by curves of space only"));
    }
    Ok(curves)
}

/// Collects the curves of one loop.
struct Reader<'a, 'b> {
    file: &'a File<'b>,
    transforms: &'a mut Transforms,
    curves: Vec<Curve<DVec2>>,
}

/// How deep composite curves may nest; the standard allows none.
const NESTING: usize = 8;

impl Reader<'_, '_> {
    /// Adds the curve or curves a pointer leads to.
    fn add(&mut self, pointer: i64, depth: usize) -> Result<(), Problem> {
        let file = self.file;
        let index = file.follow(pointer, "a trim curve")?;
        let entry = &file.entries[index];
        let mut buffer = Vec::new();
        let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
        let curve = match entry.kind {
            102 if depth < NESTING => {
                for member in parameters.pointers("curves")? {
                    self.add(member, depth + 1)?;
                }
                return Ok(());
            }
            100 => arc(&mut parameters)?,
            106 => polyline(&mut parameters)?,
            110 => {
                let [start, end] = [point(&mut parameters)?, point(&mut parameters)?];
                Curve::line(start, end, 0.0..1.0).map_err(Problem::Geometry)?
            }
            116 | 132 if depth > 0 => return Ok(()),
            126 => spline(&mut parameters)?,
            _ => {
                let source = file.source(index);
                return Err(Problem::Unsupported(format!(
                    "{source} is not read yet as a trim curve"
                )));
            }
        };
        let map = self.transforms.follow(file, entry.transform)?;
        let [x, y] = [map.matrix3.x_axis, map.matrix3.y_axis].map(|axis| axis.truncate());
        let flat =
            DAffine2::from_mat2_translation(DMat2::from_cols(x, y), map.translation.truncate());
        self.curves.push(curve.transformed(&flat));
        Ok(())
    }
}

/// Turns curves round where that lets them meet.
fn aligned(mut curves: Vec<Curve<DVec2>>, tolerance: f64) -> Vec<Curve<DVec2>> {
    let meets = |a: DVec2, b: DVec2| a.distance(b) <= tolerance;
    if let [first, second, ..] = curves.as_slice() {
        let ends = [second.start(), second.end()];
        let reaches = |p| ends.iter().any(|&end| meets(p, end));
        if !reaches(first.end()) && reaches(first.start()) {
            curves[0] = curves[0].reversed();
        }
    }
    for k in 1..curves.len() {
        let before = curves[k - 1].end();
        if !meets(before, curves[k].start()) && meets(before, curves[k].end()) {
            curves[k] = curves[k].reversed();
        }
    }
    curves
}

/// A point of three coordinates, without the last.
fn point(parameters: &mut Parameters<'_>) -> Result<DVec2, Problem> {
    let point = DVec2::new(parameters.real()?, parameters.real()?);
    parameters.real_or(0.0)?;
    Ok(point)
}

/// A rational B-spline curve (type 126).
fn spline(parameters: &mut Parameters<'_>) -> Result<Curve<DVec2>, Problem> {
    let (upper, degree) = (parameters.count()?, parameters.count()?);
    for _ in 0..4 {
        parameters.integer()?;
    }
    let count = upper.saturating_add(1);
    let knots = count.saturating_add(degree).saturating_add(1);
    let values = count.saturating_mul(4).saturating_add(knots);
    parameters.expect(values, "knots, weights and coordinates")?;
    let count = parameters.expect(count, "control points")?;
    let degree = parameters.expect(degree, "knots")?;
    let knots = parameters.reals(count + degree + 1, "knots")?;
    let weights = parameters.reals(count, "weights")?;
    let points: Result<Vec<_>, _> = (0..count).map(|_| point(parameters)).collect();
    let knots = KnotVector::new(degree, knots).map_err(Problem::Geometry)?;
    let domain = knots.domain();
    let curve = Curve::new(knots, &points?, Some(&weights)).map_err(Problem::Geometry)?;
    let range = parameters.real_or(domain.start)?..parameters.real_or(domain.end)?;
    let is_part = domain.start <= range.start && range.start < range.end && range.end <= domain.end;
    if is_part && range != domain {
        return curve.restricted(range).map_err(Problem::Geometry);
    }
    Ok(curve)
}

/// A circular arc (type 100), counter-clockwise, over its angles.
fn arc(parameters: &mut Parameters<'_>) -> Result<Curve<DVec2>, Problem> {
    parameters.real()?;
    let mut point = || Ok::<_, Problem>(DVec2::new(parameters.real()?, parameters.real()?));
    let [center, start, end] = [point()?, point()?, point()?];
    let radius = start.distance(center);
    let from = (start - center).to_angle().rem_euclid(TAU);
    let to = (end - center).to_angle().rem_euclid(TAU);
    let sweep = match (to - from).rem_euclid(TAU) {
        sweep if start != end && sweep > 0.0 => sweep,
        _ => TAU,
    };
    let pieces = match sweep / FRAC_PI_2 {
        quarters if quarters <= 1.0 => 1,
        quarters if quarters <= 2.0 => 2,
        quarters if quarters <= 3.0 => 3,
        _ => 4,
    };
    let half = sweep / f64::from(pieces) / 2.0;
    // Corners lie between two points of the circle, as far out as the tangents meet.
    let mut knots = vec![from];
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for k in 0..=2 * pieces {
        let angle = from + half * f64::from(k);
        let weight = if k % 2 == 1 { half.cos() } else { 1.0 };
        points.push(center + DVec2::from_angle(angle) * (radius / weight));
        weights.push(weight);
        if k % 2 == 0 {
            knots.extend([angle, angle]);
        }
    }
    knots.push(from + half * f64::from(2 * pieces));
    points[0] = start;
    if let Some(last) = points.last_mut() {
        *last = end;
    }
    let knots = KnotVector::new(2, knots).map_err(Problem::Geometry)?;
    Curve::new(knots, &points, Some(&weights)).map_err(Problem::Geometry)
}

/// Copious data (type 106) as straight segments.
fn polyline(parameters: &mut Parameters<'_>) -> Result<Curve<DVec2>, Problem> {
    let (width, count) = (parameters.integer()?, parameters.count()?);
    let skipped = match width {
        1 => 0,
        2 => 1,
        3 => 4,
        _ => {
            let text = format!("points of kind {width}; there are kinds 1, 2 and 3");
            return Err(Problem::Invalid(text));
        }
    };
    if width == 1 {
        parameters.real()?;
    }
    let count = parameters.expect(count, "points")?;
    let mut points = Vec::new();
    for _ in 0..count {
        points.push(DVec2::new(parameters.real()?, parameters.real()?));
        for _ in 0..skipped {
            parameters.real()?;
        }
    }
    points.dedup();
    Curve::polyline(&points).map_err(Problem::Geometry)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::iges::parameters::Delimiters;

    fn parameters(record: &str) -> Parameters<'_> {
        Parameters::new(record.as_bytes(), Delimiters::default(), 1)
    }

    #[test]
    fn arcs_stay_on_their_circle() {
        for (record, middle) in [
            ("0.,1.,1.,3.,1.,1.,3.;", 45.0_f64),
            ("0.,1.,1.,1.,3.,3.,1.;", 225.0),
            ("0.,1.,1.,3.,1.,3.,1.;", 180.0),
        ] {
            let arc = arc(&mut parameters(record)).unwrap();
            let domain = arc.domain();
            for k in 0..=20 {
                let t = domain.start + (domain.end - domain.start) * f64::from(k) / 20.0;
                let distance = arc.evaluate(t).distance(DVec2::ONE);
                assert!((distance - 2.0).abs() < 1e-14, "{record} {t}");
            }
            let expected = DVec2::ONE + DVec2::from_angle(middle.to_radians()) * 2.0;
            let found = arc.evaluate(f64::midpoint(domain.start, domain.end));
            assert!(found.distance(expected) < 1e-14, "{record} {found}");
        }
    }

    #[test]
    fn splines_are_restricted_to_their_range() {
        let record = "1,1,1,0,1,0,0.,0.,1.,1.,1.,1.,2.,0.,9.,4.,0.,9.,0.5,1.,0.,0.,1.;";
        let curve = spline(&mut parameters(record)).unwrap();
        assert_eq!(curve.start(), DVec2::new(3.0, 0.0));
        assert_eq!(curve.end(), DVec2::new(4.0, 0.0));
        assert!(spline(&mut parameters("1000000000,1,0,0,0,0,1.;")).is_err());
    }

    #[test]
    fn polylines_skip_what_is_not_of_the_plane() {
        let flat = polyline(&mut parameters("1,3,7.,0.,0.,1.,0.,1.,1.;")).unwrap();
        let deep = polyline(&mut parameters("2,3,0.,0.,7.,1.,0.,7.,1.,1.,7.;")).unwrap();
        assert_eq!(flat, deep);
        assert_eq!(flat.end(), DVec2::ONE);
    }

    #[test]
    fn reversed_curves_are_turned_round() {
        let line = |a: [f64; 2], b: [f64; 2]| {
            Curve::line(DVec2::from(a), DVec2::from(b), 0.0..1.0).unwrap()
        };
        let [a, b, c] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let curves = aligned(vec![line(b, a), line(c, b), line(c, a)], 1e-6);
        let square = TrimLoop::new(curves, 1e-6).unwrap();
        assert_eq!(square.segments().len(), 3);
    }
}
