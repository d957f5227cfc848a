//! B-spline curves and surfaces that pass through given points.
//!
//! Along each direction the control points solve one banded system, cyclic where the surface is
//! closed: the cost is linear in the number of points. A closed direction of odd degree has its
//! knots at the parameters of the points, one of even degree between them; the other choice is
//! singular for every even number of points.

use glam::DVec3;

use super::banded::{System, Value};
use crate::spline::Point;
use crate::{Curve, Error, KnotVector, Surface, check_points};

/// Steps between parameters shorter than this share of their mean are none.
const COINCIDENT: f64 = 1e-12;

/// How points get their parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Spacing {
    /// One from each to the next.
    Uniform,
    /// Steps proportional to distances.
    #[default]
    ChordLength,
    /// Steps proportional to the square roots of distances.
    Centripetal,
}

/// How points are joined along one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Along {
    /// The degree.
    pub degree: usize,
    /// Whether the last point is followed by the first one.
    pub is_closed: bool,
    /// How the points get their parameters.
    pub spacing: Spacing,
}

/// A surface through points.
#[derive(Clone, Debug, PartialEq)]
pub struct Interpolation {
    /// The surface.
    pub surface: Surface,
    /// The parameters of the points along u and v.
    pub parameters: [Vec<f64>; 2],
}

/// The surface through `points[i * count_v + j]`, which pass at the i-th parameter along u and
/// the j-th along v.
///
/// Parameters are averaged over all rows and columns and go from 0 to the number of steps. Open
/// directions have clamped knots by averaging \[Piegl 97, eq. 9.8\], closed ones are periodic:
/// all derivatives that the surface has inside it also has across the seam.
///
/// # Errors
/// If there are too few points for the degree (`degree + 1`; if closed, at least 3, and one less
/// for odd degrees), a point is not finite, or neighbouring rows or columns coincide.
pub fn interpolate(
    points: &[DVec3],
    count_u: usize,
    along: [Along; 2],
) -> Result<Interpolation, Error> {
    let count_v = points.len().checked_div(count_u).unwrap_or(0);
    if count_u * count_v != points.len() || points.is_empty() {
        let (found, expected) = (points.len(), count_u * count_v.max(1));
        return Err(Error::PointCount { found, expected });
    }
    check_points(points.iter().copied())?;
    let rows: Vec<Vec<DVec3>> = points.chunks_exact(count_v).map(<[_]>::to_vec).collect();
    let columns = transposed(&rows);
    let [u, v] = [
        Basis::new(&columns, along[0])?,
        Basis::new(&rows, along[1])?,
    ];
    let net: Vec<_> = rows.iter().map(|row| v.control_points(row)).collect();
    let net: Vec<_> = transposed(&net)
        .iter()
        .map(|column| u.control_points(column))
        .collect();
    let net = transposed(&net).concat();
    let surface = Surface::new(u.knots, v.knots, &net, None)?;
    let parameters = [u.parameters, v.parameters];
    Ok(Interpolation {
        surface,
        parameters,
    })
}

/// The curve through points, and their parameters.
///
/// # Errors
/// As [`interpolate`].
pub fn interpolate_curve<P: Point>(
    points: &[P],
    along: Along,
) -> Result<(Curve<P>, Vec<f64>), Error> {
    check_points(points.iter().copied())?;
    let basis = Basis::new(&[points], along)?;
    let points = basis.control_points(points);
    Ok((Curve::new(basis.knots, &points, None)?, basis.parameters))
}

/// The periodic curve through points at the given parameters, at the last of which the first
/// point comes again. An odd degree takes at least as many points.
pub(super) fn through_parameters(
    points: &[DVec3],
    parameters: &[f64],
    degree: usize,
) -> Result<Curve<DVec3>, Error> {
    let basis = Basis::at(parameters.to_vec(), points.len(), degree, true)?;
    let curve = Curve::new(basis.knots.clone(), &basis.control_points(points), None)?;
    curve.restricted(curve.domain())
}

/// The lines that run across the given ones.
fn transposed<P: Copy>(lines: &[Vec<P>]) -> Vec<Vec<P>> {
    let count = lines.first().map_or(0, Vec::len);
    (0..count)
        .map(|k| lines.iter().map(|line| line[k]).collect())
        .collect()
}

/// A direction of interpolation: its knots, and what makes control points of points.
struct Basis {
    knots: KnotVector,
    parameters: Vec<f64>,
    system: System,
    is_closed: bool,
}

impl Basis {
    /// The basis for points of all `lines`.
    fn new<P: Point>(lines: &[impl AsRef<[P]>], along: Along) -> Result<Self, Error> {
        let Along {
            degree, is_closed, ..
        } = along;
        if degree == 0 || degree > crate::MAX_DEGREE {
            return Err(Error::Degree { found: degree });
        }
        let count = lines.first().map_or(0, |line| line.as_ref().len());
        let expected = if is_closed {
            (degree / 2 * 2 + 1).max(3)
        } else {
            degree + 1
        };
        if count < expected {
            return Err(Error::PointCount {
                found: count,
                expected,
            });
        }
        Self::at(parameters(lines, along)?, count, degree, is_closed)
    }

    /// The basis for points at given parameters, after which that of the first point may follow
    /// once more.
    fn at(
        mut parameters: Vec<f64>,
        count: usize,
        degree: usize,
        is_closed: bool,
    ) -> Result<Self, Error> {
        let knots = if is_closed {
            periodic(&parameters, degree)?
        } else {
            averaged(&parameters, degree)?
        };
        parameters.truncate(count);
        let half = if is_closed { degree / 2 } else { degree };
        let rows: Vec<_> = parameters
            .iter()
            .enumerate()
            .map(|(i, &t)| {
                let (first, values) = knots.basis_functions(t);
                let mut row = vec![0.0; 2 * half + 1];
                // Periodic control points are counted from the one that belongs to the first point.
                let start = if is_closed { half } else { i };
                for (k, value) in (first + half..).zip(values) {
                    let place = k.checked_sub(if is_closed { start + i } else { start });
                    if let Some(entry) = place.and_then(|place| row.get_mut(place)) {
                        *entry = value;
                    }
                }
                row
            })
            .collect();
        let system = System::new(&rows, half, is_closed).ok_or(Error::Singular)?;
        Ok(Self {
            knots,
            parameters,
            system,
            is_closed,
        })
    }

    /// The control points of the spline through `points`.
    fn control_points<T: Value>(&self, points: &[T]) -> Vec<T> {
        let mut solved = points.to_vec();
        self.system.solve(&mut solved);
        if !self.is_closed {
            return solved;
        }
        let (count, half) = (solved.len(), self.knots.degree() / 2);
        let place = |k: usize| solved[(k + count - half) % count];
        (0..self.knots.count()).map(place).collect()
    }
}

/// The parameters of points, from 0 to the number of steps; of closed lines also that of the
/// first point when it comes again.
///
/// Steps are averages over all lines of their shares; lines without a length do not count.
fn parameters<P: Point>(lines: &[impl AsRef<[P]>], along: Along) -> Result<Vec<f64>, Error> {
    let count = lines.first().map_or(0, |line| line.as_ref().len());
    let steps = if along.is_closed { count } else { count - 1 };
    let measure = |length: f64| match along.spacing {
        Spacing::Uniform => 1.0,
        Spacing::ChordLength => length,
        Spacing::Centripetal => length.sqrt(),
    };
    let mut sums = vec![0.0; steps];
    for line in lines {
        let line = line.as_ref();
        let step = |k: usize| measure((line[(k + 1) % count] - line[k]).length());
        let shares: Vec<f64> = (0..steps).map(step).collect();
        let total: f64 = shares.iter().sum();
        if total > 0.0 {
            sums.iter_mut()
                .zip(&shares)
                .for_each(|(sum, share)| *sum += share / total);
        }
    }
    let total: f64 = sums.iter().sum();
    let scale = steps as f64 / total;
    let is_step = |sum: &f64| *sum * scale > COINCIDENT;
    if let Some(index) = sums.iter().position(|sum| !is_step(sum)) {
        return Err(Error::Coincide { index });
    }
    let mut parameters = vec![0.0];
    let mut sum = 0.0;
    for (k, step) in (1..).zip(&sums) {
        sum += step;
        // Equal steps have whole numbers as parameters.
        let value = match along.spacing {
            Spacing::Uniform => f64::from(k),
            _ => sum * scale,
        };
        parameters.push(value);
    }
    Ok(parameters)
}

/// Clamped knots that are averages of `degree` parameters \[Piegl 97, eq. 9.8\].
fn averaged(parameters: &[f64], degree: usize) -> Result<KnotVector, Error> {
    let [first, .., last] = parameters else {
        return Err(Error::PointCount {
            found: parameters.len(),
            expected: 2,
        });
    };
    let mut knots = vec![*first; degree + 1];
    let inner = parameters[1..].windows(degree);
    let inner = inner.take(parameters.len() - degree - 1);
    knots.extend(inner.map(|w| w.iter().sum::<f64>() / degree as f64));
    knots.extend(vec![*last; degree + 1]);
    KnotVector::new(degree, knots)
}

/// Periodic knots at parameters, or between them if the degree is even; the last parameter is
/// one period after the first.
fn periodic(parameters: &[f64], degree: usize) -> Result<KnotVector, Error> {
    let [first, .., last] = parameters else {
        return Err(Error::PointCount {
            found: parameters.len(),
            expected: 2,
        });
    };
    let turn = &parameters[..parameters.len() - 1];
    let knots = (0..turn.len() + 2 * degree + 1).map(|k| {
        // Whole turns back, so that the places count from the first knot of the domain.
        let turns = degree.div_ceil(turn.len()) + 1;
        let place = k + turns * turn.len() - degree;
        let parameter = |place: usize| {
            let turns = (place / turn.len()) as f64 - turns as f64;
            turn[place % turn.len()] + (last - first) * turns
        };
        if degree % 2 == 1 {
            parameter(place)
        } else {
            f64::midpoint(parameter(place - 1), parameter(place))
        }
    });
    KnotVector::new(degree, knots.collect())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use glam::DVec2;

    use super::*;

    /// A tube with bulges and a bend: `count_u` rings of `count_v` points.
    fn tube(count_u: usize, count_v: usize) -> Vec<DVec3> {
        let place = |k: usize| (k / count_v, k % count_v);
        let point = |k: usize| {
            let (i, j) = place(k);
            let (height, angle) = (i as f64 / 5.0, TAU * j as f64 / count_v as f64);
            let radius = 1.0 + 0.2 * (3.0 * angle + height).sin();
            let bent = DVec2::from_angle(angle + 0.1 * (2.0 * angle).sin()) * radius;
            DVec3::new(bent.x + 0.3 * height * height, bent.y, height)
        };
        (0..count_u * count_v).map(point).collect()
    }

    fn along(degree: usize, is_closed: bool, spacing: Spacing) -> Along {
        Along {
            degree,
            is_closed,
            spacing,
        }
    }

    const SPACINGS: [Spacing; 3] = [Spacing::Uniform, Spacing::ChordLength, Spacing::Centripetal];

    #[test]
    fn surfaces_pass_through_their_points() {
        let mut worst = 0.0_f64;
        for degree in 1..=7 {
            for (count, spacing) in [8, 9, 12, 31]
                .into_iter()
                .flat_map(|c| SPACINGS.map(|s| (c, s)))
            {
                let points = tube(11, count);
                let directions = [
                    along(8 - degree, false, spacing),
                    along(degree, true, spacing),
                ];
                let found = interpolate(&points, 11, directions).unwrap();
                for (k, point) in points.iter().enumerate() {
                    let [u, v] = &found.parameters;
                    let uv = DVec2::new(u[k / count], v[k % count]);
                    worst = worst.max(found.surface.evaluate(uv).distance(*point));
                }
            }
        }
        assert!(worst < 1e-12, "{worst:e}");
    }

    /// The largest difference of a derivative up to `degree - 1` between both ends along v, as a
    /// share of the largest one of its kind.
    fn seam(surface: &Surface) -> f64 {
        let degree = surface.knots_v().degree();
        let breaks = surface.knots_v().breaks();
        let pieces = surface.bezier_pieces();
        let strips = breaks.len() - 1;
        let mut worst = 0.0_f64;
        for column in pieces.chunks_exact(strips) {
            let derivatives = |strip: usize, at_end: bool| -> Vec<Vec<DVec3>> {
                let length = breaks[strip + 1] - breaks[strip];
                let net: Vec<DVec3> = column[strip].points().collect();
                let mut lines: Vec<Vec<DVec3>> =
                    net.chunks_exact(degree + 1).map(<[_]>::to_vec).collect();
                let mut found = Vec::new();
                for order in 0..degree {
                    let end = |line: &Vec<DVec3>| {
                        if at_end {
                            line[line.len() - 1]
                        } else {
                            line[0]
                        }
                    };
                    found.push(lines.iter().map(end).collect());
                    let factor = (degree - order) as f64 / length;
                    for line in &mut lines {
                        *line = line.windows(2).map(|w| (w[1] - w[0]) * factor).collect();
                    }
                }
                found
            };
            let (start, end) = (derivatives(0, false), derivatives(strips - 1, true));
            for (start, end) in start.iter().zip(&end) {
                let size = start.iter().map(|d| d.length()).fold(0.0, f64::max);
                let off = start.iter().zip(end).map(|(a, b)| a.distance(*b));
                worst = worst.max(off.fold(0.0, f64::max) / size);
            }
        }
        worst
    }

    #[test]
    fn seams_are_as_smooth_as_the_inside() {
        for degree in 2..=7 {
            for spacing in SPACINGS {
                for count in [12, 13] {
                    let directions = [along(3, false, spacing), along(degree, true, spacing)];
                    let found = interpolate(&tube(6, count), 6, directions).unwrap();
                    let worst = seam(&found.surface);
                    assert!(worst < 1e-10, "{degree} {spacing:?} {count}: {worst:e}");
                    assert_eq!(found.surface.closed(), [false, true]);
                }
            }
        }
    }

    #[test]
    fn both_directions_may_be_closed() {
        let points: Vec<DVec3> = (0..12 * 20)
            .map(|k| {
                let around = DVec2::from_angle(TAU * f64::from(k / 20) / 12.0);
                let tube = DVec2::from_angle(TAU * f64::from(k % 20) / 20.0) * 0.4;
                (around * (1.0 + tube.x)).extend(tube.y)
            })
            .collect();
        let directions = [
            along(4, true, Spacing::Uniform),
            along(5, true, Spacing::Uniform),
        ];
        let found = interpolate(&points, 12, directions).unwrap();
        assert_eq!(found.surface.closed(), [true, true]);
        let at = found.surface.evaluate(DVec2::new(3.0, 7.0));
        assert!(at.distance(points[67]) < 1e-13);
        // A circle of 12 points is met to the fourth power of the step by degree 4.
        let between = found.surface.evaluate(DVec2::new(3.5, 5.0));
        assert!((between.truncate().length() - 1.0).abs() < 1e-3);
    }

    #[test]
    fn many_points_take_linear_time() {
        let started = std::time::Instant::now();
        let points = tube(500, 500);
        let directions = [
            along(3, false, Spacing::ChordLength),
            along(3, true, Spacing::ChordLength),
        ];
        let found = interpolate(&points, 500, directions).unwrap();
        let took = started.elapsed().as_secs_f64();
        println!("500 x 500 points: {took:.3} s");
        assert!(took < 2.0, "{took} s");
        let [u, v] = &found.parameters;
        for k in (0..points.len()).step_by(97) {
            let uv = DVec2::new(u[k / 500], v[k % 500]);
            let off = found.surface.evaluate(uv).distance(points[k]);
            // The tube is bent to coordinates of 3000.
            assert!(off < 1e-12 * 3000.0, "{off:e}");
        }
    }

    #[test]
    fn what_cannot_be_interpolated_is_told() {
        let closed = along(3, true, Spacing::ChordLength);
        let open = along(3, false, Spacing::ChordLength);
        let mut points = tube(5, 8);
        let few = interpolate(&points[..24], 3, [open, closed]);
        let expected = Error::PointCount {
            found: 3,
            expected: 4,
        };
        let ring = [DVec3::X, DVec3::Y, -DVec3::ONE];
        let (curve, at) = interpolate_curve(&ring, closed).unwrap();
        assert!((0..3).all(|k| curve.evaluate(at[k]).distance(ring[k]) < 1e-15));
        assert_eq!(few, Err(expected));
        for ring in points.chunks_exact_mut(8) {
            ring[5] = ring[4];
        }
        let twice = interpolate(&points, 5, [open, closed]);
        assert_eq!(twice, Err(Error::Coincide { index: 4 }));
        points[9] = DVec3::NAN;
        let infinite = interpolate(&points, 5, [open, closed]);
        assert_eq!(infinite, Err(Error::NotFinite { index: 9 }));
    }
}
