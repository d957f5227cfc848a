//! A flat section that moves along a curve in space, always across it.

use std::ops::Range;

use glam::{DQuat, DVec2, DVec3, DVec4};

use super::banded::inverse;
use crate::{Curve, Error, KnotVector, Surface, check_points};

/// A swept surface, and how far it may be from what it stands for.
#[derive(Clone, Debug, PartialEq)]
pub struct Swept {
    /// One surface for each part of the trajectory along which the section moves smoothly: u is
    /// the parameter of the section, v that of the trajectory. Where the section turns at one
    /// place, a flat surface between two parts connects its two outlines; v goes from 0 to 1.
    pub surfaces: Vec<Surface>,
    /// The largest distance found from the definition, in scene units; zero where the surface
    /// is exact up to rounding.
    pub accuracy: f64,
}

/// Degree of what is fitted along the trajectory.
const DEGREE: usize = 5;

/// How often a part of the trajectory between knots is halved at most.
const HALVINGS: u32 = 10;

/// Places in a part where the fit is compared with the definition.
const CHECKS: usize = 13;

/// Curvature below this share of what speed and acceleration allow is none.
const STRAIGHT: f64 = 1e-9;

/// Points of a trajectory that are this near to a line or a circle, as a share of its size,
/// lie on it.
const ON_CURVE: f64 = 1e-14;

/// A turn of the direction at a knot by more than this angle, in radians, is a corner; a turn of
/// the section there is one, too.
const CORNER: f64 = 1e-6;

/// The surface `S(u, v) = T(v) + x(v) section.x(u) + z(v) section.y(u)` over the trajectory
/// `T`, where `y` is the direction of `T`, `z` its binormal, without its jumps to the other
/// side, and `x = y × z`.
///
/// This is what the extrusion of VRML becomes for ever shorter segments of its spine. Where
/// the trajectory is straight, `z` is turned with `y` out of the coordinate axes. The surface
/// is exact along straight lines and circular arcs, in any parametrisation; else `T`, `x` and
/// `z` are interpolated by pieces of degree 5 until the surface is within `tolerance` of its
/// definition, in scene units, at points between.
///
/// # Errors
/// If the trajectory does not leave its first point, or the fit is beyond the range of numbers.
pub fn swept(
    section: &Curve<DVec2>,
    trajectory: &Curve<DVec3>,
    tolerance: f64,
) -> Result<Swept, Error> {
    if let Some(surface) = straight(section, trajectory)?.or_else(|| round(section, trajectory)) {
        return Ok(Swept {
            surfaces: vec![surface],
            accuracy: 0.0,
        });
    }
    let reach = section.points().map(DVec2::length).fold(0.0, f64::max);
    let breaks = trajectory.knots().breaks();
    let mut fit = Followed {
        trajectory,
        reach,
        tolerance,
        z: first_binormal(trajectory),
        breaks: Vec::new(),
        columns: Vec::new(),
        accuracy: 0.0,
        from_values: from_values(),
    };
    let mut surfaces = Vec::new();
    for (index, range) in breaks.windows(2).enumerate() {
        if let Some([before, after]) = fit.turn(&(range[0]..range[1])) {
            surfaces.push(fit.take_surface(section)?);
            let knots = KnotVector::bezier(1, 0.0..1.0)?;
            surfaces.push(across(section, knots, &[before, after])?);
        }
        fit.add(range[0]..range[1], HALVINGS);
        let is_last = index + 2 == breaks.len();
        if is_last || is_corner(trajectory, range[1]) {
            surfaces.push(fit.take_surface(section)?);
        }
    }
    Ok(Swept {
        surfaces,
        accuracy: fit.accuracy,
    })
}

/// The sum of section and trajectory, if that is straight.
fn straight(section: &Curve<DVec2>, trajectory: &Curve<DVec3>) -> Result<Option<Surface>, Error> {
    let start = trajectory.start();
    let far = |a: DVec3, b: DVec3| {
        if b.distance(start) > a.distance(start) {
            b
        } else {
            a
        }
    };
    let Some(along) = (trajectory.points().fold(start, far) - start).try_normalize() else {
        return Err(Error::NoDirection);
    };
    let along = if (trajectory.end() - start).dot(along) < 0.0 {
        -along
    } else {
        along
    };
    let size = trajectory
        .points()
        .fold(start.length(), |s, p| s.max(p.length()));
    let is_on = |p: DVec3| (p - start).reject_from_normalized(along).length() <= ON_CURVE * size;
    if !trajectory.points().all(is_on) {
        return Ok(None);
    }
    let turn = DQuat::from_rotation_arc(DVec3::Y, along);
    let (x, z) = (turn * DVec3::X, turn * DVec3::Z);
    Ok(Some(product(section, trajectory, |c, t| {
        t + x * c.x + z * c.y
    })))
}

/// The part of a surface of revolution, if the trajectory lies on a circle.
fn round(section: &Curve<DVec2>, trajectory: &Curve<DVec3>) -> Option<Surface> {
    let Range { start, end } = trajectory.domain();
    let samples: Vec<DVec3> = (0..=CHECKS * 4)
        .map(|i| trajectory.evaluate(start + (end - start) * i as f64 / (CHECKS * 4) as f64))
        .collect();
    // The circle through three of its points.
    let [a, b, c] = [0, CHECKS, 2 * CHECKS].map(|i| samples[i]);
    let to_center = super::to_center([a, b, c]);
    let axis = (b - a).cross(c - a).try_normalize()?;
    let (center, radius) = (a + to_center, to_center.length());
    let size = radius + center.length();
    let is_on = |p: &DVec3| {
        let r = *p - center;
        r.dot(axis).abs() <= ON_CURVE * 8.0 * size
            && (r.length() - radius).abs() <= ON_CURVE * 8.0 * size
    };
    if !samples.iter().all(is_on) {
        return None;
    }
    // Against the radius: y cross z, with y along axis cross radius and z along the axis.
    let scaled = |c: DVec2, t: DVec3| center + (t - center) * (1.0 + c.x / radius) + axis * c.y;
    Some(product(section, trajectory, scaled))
}

/// The surface of which each control point comes from one of the section and one of the
/// trajectory, for maps that are affine in both.
fn product(
    section: &Curve<DVec2>,
    trajectory: &Curve<DVec3>,
    map: impl Fn(DVec2, DVec3) -> DVec3,
) -> Surface {
    let pairs = section.points().zip(section.weights());
    let pairs = pairs.flat_map(|c| {
        trajectory
            .points()
            .zip(trajectory.weights())
            .map(move |t| (c, t))
    });
    let net = pairs.map(|((c, cw), (t, tw))| {
        let weight = cw * tw;
        (map(c, t) * weight).extend(weight)
    });
    let net = net.collect();
    Surface::trusted(section.knots().clone(), trajectory.knots().clone(), net)
}

/// Whether the direction jumps at a knot.
fn is_corner(trajectory: &Curve<DVec3>, knot: f64) -> bool {
    if trajectory.knots().multiplicity(knot) < trajectory.degree() {
        return false;
    }
    let Ok([before, after]) = trajectory.split(knot) else {
        return false;
    };
    direction(&before, knot).angle_between(direction(&after, knot)) > CORNER
}

/// The direction of a curve; where it stands still, that of the points beside.
fn direction(curve: &Curve<DVec3>, t: f64) -> DVec3 {
    let Range { start, end } = curve.domain();
    let step = (end - start) * 1e-6;
    let beside = || {
        let (a, b) = ((t - step).max(start), (t + step).min(end));
        (curve.evaluate(b) - curve.evaluate(a)).normalize_or(DVec3::Y)
    };
    let first = curve.derivatives(t).first;
    first.try_normalize().unwrap_or_else(beside)
}

/// The binormal of a curve where it has one.
fn binormal(curve: &Curve<DVec3>, t: f64) -> Option<DVec3> {
    let d = curve.derivatives(t);
    let across = d.first.cross(d.second);
    let is_curved = across.length() > STRAIGHT * d.first.length() * d.second.length();
    across.try_normalize().filter(|_| is_curved)
}

/// The first binormal along the curve, or any direction across it.
fn first_binormal(curve: &Curve<DVec3>) -> DVec3 {
    let breaks = curve.knots().breaks();
    let places = breaks
        .windows(2)
        .flat_map(|r| (0..CHECKS).map(move |i| part(r[0], r[1], i, CHECKS)));
    let mut found = places.filter_map(|t| binormal(curve, t));
    found.next().unwrap_or(DVec3::Z)
}

/// The place `i` of `n` steps from `a` to `b`.
fn part(a: f64, b: f64, i: usize, n: usize) -> f64 {
    a + (b - a) * (i as f64 / n as f64)
}

/// The place of a section and its two axes.
type Frame = [DVec3; 3];

/// A spline of degree 5 that follows the frames of a trajectory.
struct Followed<'a> {
    trajectory: &'a Curve<DVec3>,
    /// The largest distance of the section from its origin.
    reach: f64,
    tolerance: f64,
    /// The axis z at the end of what is fitted.
    z: DVec3,
    breaks: Vec<f64>,
    columns: Vec<Frame>,
    accuracy: f64,
    from_values: [[f64; DEGREE + 1]; DEGREE + 1],
}

impl Followed<'_> {
    /// The frame at `t`, with z on the side of `near`. Curves are taken from the inside of
    /// `range`, so that derivatives at its ends are those of this part.
    fn frame(&self, t: f64, range: &Range<f64>, near: DVec3) -> Frame {
        let inside = range.end.next_down();
        let y = direction(self.trajectory, t.min(inside));
        let z = binormal(self.trajectory, t.min(inside)).unwrap_or(near);
        let z = if z.dot(near) < 0.0 { -z } else { z };
        let z = z
            .reject_from_normalized(y)
            .normalize_or(y.any_orthonormal_vector());
        [self.trajectory.evaluate(t), y.cross(z), z]
    }

    /// The frames before and after the start of the part over `range`, if what is fitted ends
    /// there and the section turns: where the curvature jumps.
    fn turn(&self, range: &Range<f64>) -> Option<[Frame; 2]> {
        let before = *self.columns.last()?;
        let after = self.frame(range.start, range, self.z);
        (before[2].angle_between(after[2]) > CORNER).then_some([before, after])
    }

    /// Fits the part over `range`, in halves if need be.
    fn add(&mut self, range: Range<f64>, halvings: u32) {
        let at = |s: f64| range.start + (range.end - range.start) * s;
        let values: [Frame; DEGREE + 1] =
            std::array::from_fn(|k| self.frame(at(node(k)), &range, self.z));
        let columns: [Frame; DEGREE + 1] = std::array::from_fn(|i| {
            let mut sum = [DVec3::ZERO; 3];
            for (value, factor) in values.iter().zip(self.from_values[i]) {
                for (sum, value) in sum.iter_mut().zip(value) {
                    *sum += *value * factor;
                }
            }
            sum
        });
        let mut error: f64 = 0.0;
        for i in 0..CHECKS {
            let s = (i as f64 + 0.5) / CHECKS as f64;
            let wanted = self.frame(at(s), &range, self.z);
            let mut off = [DVec3::ZERO; 3];
            for (column, factor) in columns.iter().zip(bernstein(s)) {
                for (off, value) in off.iter_mut().zip(column) {
                    *off += *value * factor;
                }
            }
            let [t, x, z]: [f64; 3] = std::array::from_fn(|k| off[k].distance(wanted[k]));
            error = error.max(t + self.reach * x.hypot(z));
        }
        if error > self.tolerance && halvings > 0 {
            let middle = at(0.5);
            self.add(range.start..middle, halvings - 1);
            self.add(middle..range.end, halvings - 1);
            return;
        }
        self.accuracy = self.accuracy.max(error);
        if self.breaks.is_empty() {
            self.breaks.push(range.start);
            self.columns.push(columns[0]);
        }
        self.breaks.push(range.end);
        self.columns.extend_from_slice(&columns[1..]);
        self.z = values[DEGREE][2];
    }

    /// The surface of what has been fitted; the next part begins anew.
    fn take_surface(&mut self, section: &Curve<DVec2>) -> Result<Surface, Error> {
        let breaks = std::mem::take(&mut self.breaks);
        let columns = std::mem::take(&mut self.columns);
        let mut knots: Vec<f64> = breaks.iter().flat_map(|&b| [b; DEGREE]).collect();
        knots.extend(breaks.last());
        knots.insert(0, breaks[0]);
        across(section, KnotVector::new(DEGREE, knots)?, &columns)
    }
}

/// The surface of a section that is carried by a spline of frames.
fn across(
    section: &Curve<DVec2>,
    knots_v: KnotVector,
    columns: &[Frame],
) -> Result<Surface, Error> {
    let net: Vec<DVec4> = section
        .homogeneous()
        .iter()
        .flat_map(|h| {
            let point = |[t, x, z]: &Frame| (*t * h.z + *x * h.x + *z * h.y).extend(h.z);
            columns.iter().map(point)
        })
        .collect();
    check_points(net.iter().map(|h| h.truncate()))?;
    Ok(Surface::trusted(section.knots().clone(), knots_v, net))
}

/// The places from 0 to 1 where the fit agrees with the definition: Chebyshev's, with ends.
fn node(k: usize) -> f64 {
    0.5 - 0.5 * (std::f64::consts::PI * k as f64 / DEGREE as f64).cos()
}

/// The Bernstein polynomials of degree 5.
fn bernstein(s: f64) -> [f64; DEGREE + 1] {
    const BINOMIAL: [f64; DEGREE + 1] = [1.0, 5.0, 10.0, 10.0, 5.0, 1.0];
    let power = |x: f64, n: usize| std::iter::repeat_n(x, n).product::<f64>();
    std::array::from_fn(|i| BINOMIAL[i] * power(s, i) * power(1.0 - s, DEGREE - i))
}

/// The matrix from values at the nodes to control points: the inverse of that of the
/// polynomials there.
fn from_values() -> [[f64; DEGREE + 1]; DEGREE + 1] {
    let rows = (0..=DEGREE).map(|k| bernstein(node(k)).to_vec()).collect();
    let inverse = inverse(rows).expect("the nodes differ");
    std::array::from_fn(|i| std::array::from_fn(|j| inverse[i][j]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modelling::{Frame as Axes, circle};

    fn curve(points: &[[f64; 3]], degree: usize) -> Curve<DVec3> {
        let points: Vec<_> = points.iter().map(|&p| DVec3::from_array(p)).collect();
        let knots = KnotVector::clamped_uniform(degree, points.len(), 0.0..1.0).unwrap();
        Curve::new(knots, &points, None).unwrap()
    }

    fn section() -> Curve<DVec2> {
        let points = [[0.3, -0.2], [0.5, 0.4], [-0.2, 0.3]].map(DVec2::from_array);
        let knots = KnotVector::bezier(2, 0.0..1.0).unwrap();
        Curve::new(knots, &points, Some(&[1.0, 0.5, 2.0])).unwrap()
    }

    /// The largest distance from `definition(T, v)`, which gives the place and both axes.
    fn distance(
        surfaces: &[Surface],
        section: &Curve<DVec2>,
        definition: impl Fn(f64) -> Frame,
    ) -> f64 {
        let mut largest: f64 = 0.0;
        for surface in surfaces {
            let Range { start, end } = surface.knots_v().domain();
            for (i, j) in (0..=20).flat_map(|i| (0..=300).map(move |j| (i, j))) {
                let (u, v) = (part(0.0, 1.0, i, 20), part(start, end, j, 300));
                let ([t, x, z], c) = (definition(v), section.evaluate(u));
                let wanted = t + x * c.x + z * c.y;
                largest = largest.max(surface.evaluate(DVec2::new(u, v)).distance(wanted));
            }
        }
        largest
    }

    #[test]
    fn a_straight_trajectory_gives_the_sum_of_the_curves() {
        let trajectory = curve(
            &[
                [1.0, 1.0, 1.0],
                [1.0, 4.0, 1.0],
                [1.0, 2.0, 1.0],
                [1.0, 9.0, 1.0],
            ],
            3,
        );
        let swept = swept(&section(), &trajectory, 1e-9).unwrap();
        let exact = |v: f64| [trajectory.evaluate(v), DVec3::X, DVec3::Z];
        assert!(distance(&swept.surfaces, &section(), exact) < 1e-14);
        assert_eq!((swept.surfaces.len(), swept.accuracy.to_bits()), (1, 0));
    }

    #[test]
    fn a_circle_gives_a_torus() {
        let axes = Axes::new(
            DVec3::new(1.0, 2.0, 3.0),
            DVec3::new(1.0, 1.0, 0.0),
            DVec3::Z,
        )
        .unwrap();
        let trajectory = circle(&axes, 2.0).unwrap();
        let swept = swept(&section(), &trajectory, 1e-9).unwrap();
        assert_eq!(swept.accuracy.to_bits(), 0);
        let exact = |v: f64| {
            let t = trajectory.evaluate(v);
            [t, (t - axes.origin()).normalize(), axes.z()]
        };
        assert!(distance(&swept.surfaces, &section(), exact) < 1e-14);
    }

    #[test]
    fn a_twisted_curve_is_followed_within_the_tolerance() {
        // (t, t^2, t^3), with its derivatives by hand.
        let trajectory = curve(
            &[
                [0.0; 3],
                [1.0 / 3.0, 0.0, 0.0],
                [2.0 / 3.0, 1.0 / 3.0, 0.0],
                [1.0; 3],
            ],
            3,
        );
        let exact = |v: f64| {
            let first = DVec3::new(1.0, 2.0 * v, 3.0 * v * v);
            let second = DVec3::new(0.0, 2.0, 6.0 * v);
            let (y, z) = (first.normalize(), first.cross(second).normalize());
            [DVec3::new(v, v * v, v * v * v), y.cross(z), z]
        };
        for tolerance in [1e-4, 1e-9, 1e-12] {
            let swept = swept(&section(), &trajectory, tolerance).unwrap();
            let found = distance(&swept.surfaces, &section(), exact);
            assert!(found <= 1.1 * tolerance + 1e-15, "{found} for {tolerance}");
            assert!(swept.accuracy <= tolerance);
        }
    }

    #[test]
    fn an_inflection_does_not_turn_the_section_over() {
        let trajectory = curve(
            &[[0.0; 3], [1.0, 1.0, 0.0], [2.0, -1.0, 0.0], [3.0, 0.0, 0.0]],
            3,
        );
        let swept = swept(&section(), &trajectory, 1e-9).unwrap();
        let exact = |v: f64| {
            let y = trajectory.derivatives(v).first.normalize();
            [trajectory.evaluate(v), y.cross(DVec3::NEG_Z), DVec3::NEG_Z]
        };
        assert!(distance(&swept.surfaces, &section(), exact) < 2e-9);
    }

    #[test]
    fn a_jump_of_the_curvature_turns_the_section_at_one_place() {
        // Two parabolas: the first in the plane z = 0, the second across it.
        let points = [[0.0; 3], [0.0, 1.0, 0.0], [2.0, 1.0, 0.0], [2.0, 0.5, 1.0]];
        let knots = KnotVector::new(2, vec![0.0, 0.0, 0.0, 1.0, 2.0, 2.0, 2.0]).unwrap();
        let trajectory = Curve::new(knots, &points.map(DVec3::from_array), None).unwrap();
        let swept = swept(&section(), &trajectory, 1e-9).unwrap();
        let [first, turn, second] = swept.surfaces.as_slice() else {
            panic!("{} surfaces", swept.surfaces.len());
        };
        let exact = |z: DVec3| {
            let trajectory = &trajectory;
            move |v: f64| {
                let y = trajectory.derivatives(v).first.normalize();
                [trajectory.evaluate(v), y.cross(z), z]
            }
        };
        let across = DVec3::new(0.0, -1.0, -0.5).normalize();
        let parts = [(first, DVec3::NEG_Z), (second, across)];
        for (surface, z) in parts {
            let surface = std::slice::from_ref(surface);
            assert!(distance(surface, &section(), exact(z)) < 2e-9);
        }
        // The turn lies across the trajectory, between the outlines of both.
        for i in 0..=20 {
            let u = part(0.0, 1.0, i, 20);
            let [a, b] = [0.0, 1.0].map(|v| turn.evaluate(DVec2::new(u, v)));
            assert!(a.distance(first.evaluate(DVec2::new(u, 1.0))) < 1e-12);
            assert!(b.distance(second.evaluate(DVec2::new(u, 1.0))) < 1e-12);
            assert!((a.x - 1.0).abs() < 1e-12 && (b.x - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn corners_part_the_surface() {
        let trajectory = curve(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.5]], 1);
        let swept = swept(&section(), &trajectory, 1e-9).unwrap();
        assert_eq!(swept.surfaces.len(), 2);
        let still = curve(&[[1.0; 3]; 3], 2);
        assert_eq!(
            super::swept(&section(), &still, 1e-9),
            Err(Error::NoDirection)
        );
    }
}
