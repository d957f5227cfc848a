//! Curves and surfaces through the points of a function, to a stated tolerance.

use glam::DVec3;

use crate::spline::Point;
use crate::{Curve, Error, KnotVector, Surface};

/// How often an interval of a fit is halved at most.
const DEPTH: u32 = 10;

/// Where a fitted piece is compared with its function: between the thirds, where it meets it.
const BETWEEN: [f64; 3] = [1.0 / 6.0, 0.5, 5.0 / 6.0];

/// How many points a fitted curve, and pieces a fitted surface, may have.
const PIECES: usize = 10_000;

/// A curve that was fitted, and how far it strays.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit<P: Point> {
    /// The curve, of degree 3.
    pub curve: Curve<P>,
    /// The largest distance that was found between the points that the fit meets.
    pub deviation: f64,
}

/// A cubic curve through points of a continuous function over the intervals between `breaks`.
///
/// Each interval is halved until the curve that meets the function at both ends and at both
/// thirds strays at most `tolerance` between them, as `distance(found, wanted)` tells; after
/// ten halvings, or with ten thousand points, it is left as it is, and [`Fit::deviation`] tells
/// how far it strays.
///
/// # Errors
/// If there are fewer than two breaks, they do not rise, or a point is not finite.
pub fn fit<P: Point>(
    mut function: impl FnMut(f64) -> P,
    breaks: &[f64],
    tolerance: f64,
    distance: impl Fn(P, P) -> f64,
) -> Result<Fit<P>, Error> {
    let (mut points, mut knots, mut deviation) = (Vec::new(), Vec::new(), 0.0_f64);
    let mut stack: Vec<(f64, f64, u32)> = breaks.windows(2).map(|w| (w[0], w[1], 0)).collect();
    stack.reverse();
    while let Some((start, end, depth)) = stack.pop() {
        let at = |share: f64| start + (end - start) * share;
        let met = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(|share| function(at(share)));
        let piece = through(met);
        let strays = BETWEEN.map(|share| distance(bezier(piece, share), function(at(share))));
        let strays = largest(strays);
        let middle = at(0.5);
        let has_room = points.len() < PIECES + 3 * breaks.len();
        if strays > tolerance && depth < DEPTH && has_room && start < middle && middle < end {
            stack.push((middle, end, depth + 1));
            stack.push((start, middle, depth + 1));
            continue;
        }
        deviation = deviation.max(strays);
        if points.is_empty() {
            points.push(piece[0]);
            knots.extend([start; 4]);
        }
        points.extend(&piece[1..]);
        knots.extend([end; 3]);
    }
    knots.extend(knots.last().copied());
    let curve = Curve::new(KnotVector::new(3, knots)?, &points, None)?;
    Ok(Fit { curve, deviation })
}

/// A surface that was fitted, and how far it strays.
#[derive(Clone, Debug, PartialEq)]
pub struct FitSurface {
    /// The surface, of degree 3 along both parameters.
    pub surface: Surface,
    /// The largest distance that was found between the points that the fit meets.
    pub deviation: f64,
}

/// A bicubic surface through points of a continuous function over the rectangles between the
/// breaks of both parameters.
///
/// Rectangles are halved along the parameter that needs it, in whole rows, until the surface
/// strays at most `tolerance`; after ten halvings, or with ten thousand rectangles, they are left
/// as they are, and [`FitSurface::deviation`] tells how far the surface strays.
///
/// # Errors
/// As [`fit`].
pub fn fit_surface(
    function: impl Fn(f64, f64) -> DVec3,
    breaks: &[Vec<f64>; 2],
    tolerance: f64,
) -> Result<FitSurface, Error> {
    if let Some(few) = breaks.iter().find(|breaks| breaks.len() < 2) {
        let (found, expected) = (few.len(), 2);
        return Err(Error::KnotCount { found, expected });
    }
    let mut breaks = breaks.clone();
    let mut halvings = 0;
    loop {
        let [strays_u, strays_v] = strays(&function, &breaks);
        let halved = [(&breaks[0], &strays_u), (&breaks[1], &strays_v)].map(|(breaks, strays)| {
            let mut halved = vec![breaks[0]];
            for (pair, strays) in breaks.windows(2).zip(strays) {
                let middle = f64::midpoint(pair[0], pair[1]);
                let is_divided = *strays > tolerance && pair[0] < middle && middle < pair[1];
                halved.extend(is_divided.then_some(middle));
                halved.push(pair[1]);
            }
            halved
        });
        let pieces = (halved[0].len() - 1).saturating_mul(halved[1].len() - 1);
        if halved == breaks || pieces > PIECES || halvings == DEPTH {
            let deviation = largest(strays_u.into_iter().chain(strays_v));
            let surface = bicubic(&function, &breaks)?;
            return Ok(FitSurface { surface, deviation });
        }
        breaks = halved;
        halvings += 1;
    }
}

/// The largest of some distances; what is no number is farther than any.
fn largest(distances: impl IntoIterator<Item = f64>) -> f64 {
    let far = |x: f64| if x.is_nan() { f64::INFINITY } else { x };
    distances.into_iter().map(far).fold(0.0, f64::max)
}

/// How far cubics along u, and along v, stray from a function between neighbouring breaks.
fn strays(function: &impl Fn(f64, f64) -> DVec3, breaks: &[Vec<f64>; 2]) -> [Vec<f64>; 2] {
    [0, 1].map(|axis: usize| {
        let mut across = vec![breaks[1 - axis][0]];
        for w in breaks[1 - axis].windows(2) {
            across.extend([f64::midpoint(w[0], w[1]), w[1]]);
        }
        let worst = |pair: &[f64]| {
            let at = |share: f64, other: f64| {
                let along = pair[0] + (pair[1] - pair[0]) * share;
                if axis == 0 {
                    function(along, other)
                } else {
                    function(other, along)
                }
            };
            let one = |&other: &f64| {
                let piece = through([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(|s| at(s, other)));
                largest(BETWEEN.map(|s| bezier(piece, s).distance(at(s, other))))
            };
            largest(across.iter().map(one))
        };
        breaks[axis].windows(2).map(worst).collect()
    })
}

/// The bicubic surface that meets a function at the thirds of all rectangles.
fn bicubic(
    function: &impl Fn(f64, f64) -> DVec3,
    breaks: &[Vec<f64>; 2],
) -> Result<Surface, Error> {
    let thirds = |breaks: &[f64]| -> Vec<f64> {
        let inner = breaks.windows(2).flat_map(|w| {
            let third = (w[1] - w[0]) / 3.0;
            [w[0], w[0] + third, w[1] - third]
        });
        inner.chain(breaks.last().copied()).collect()
    };
    let [along_u, along_v] = [thirds(&breaks[0]), thirds(&breaks[1])];
    let row = along_v.len();
    let mut points: Vec<DVec3> = along_u
        .iter()
        .flat_map(|&u| along_v.iter().map(move |&v| function(u, v)))
        .collect();
    // Points that are met become control points, first along v, then along u.
    let mut convert = |start: usize, stride: usize| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| points[start + k * stride]);
        let bezier = through([a, b, c, d]);
        points[start + stride] = bezier[1];
        points[start + 2 * stride] = bezier[2];
    };
    for i in 0..along_u.len() {
        (0..row - 1)
            .step_by(3)
            .for_each(|j| convert(i * row + j, 1));
    }
    for j in 0..row {
        (0..along_u.len() - 1)
            .step_by(3)
            .for_each(|i| convert(i * row + j, row));
    }
    let knots = |breaks: &[f64]| {
        let mut knots = vec![breaks[0]];
        knots.extend(breaks.iter().flat_map(|&t| [t; 3]));
        knots.extend(breaks.last());
        KnotVector::new(3, knots)
    };
    Surface::new(knots(&breaks[0])?, knots(&breaks[1])?, &points, None)
}

/// The cubic Bézier points of the curve with these points at 0, 1/3, 2/3 and 1.
pub(super) fn through<P: Point>([a, b, c, d]: [P; 4]) -> [P; 4] {
    let inner = |a: P, b: P, c: P, d: P| (b * 18.0 - c * 9.0 - a * 5.0 + d * 2.0) / 6.0;
    [a, inner(a, b, c, d), inner(d, c, b, a), d]
}

/// The point at `t` of a cubic Bézier curve.
fn bezier<P: Point>([a, b, c, d]: [P; 4], t: f64) -> P {
    let s = 1.0 - t;
    a * (s * s * s) + b * (3.0 * s * s * t) + c * (3.0 * s * t * t) + d * (t * t * t)
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    #[test]
    fn circles_are_met_to_the_tolerance() {
        for tolerance in [1e-3, 1e-6, 1e-9] {
            let breaks = [0.0, 1.0, 5.0];
            let found = fit(DVec2::from_angle, &breaks, tolerance, DVec2::distance).unwrap();
            assert!(found.deviation <= tolerance);
            for k in 0..=1000 {
                let angle = f64::from(k) * 5e-3;
                let strays = found
                    .curve
                    .evaluate(angle)
                    .distance(DVec2::from_angle(angle));
                assert!(strays <= 1.2 * tolerance, "{tolerance}: {strays:e}");
            }
        }
    }

    #[test]
    fn surfaces_are_met_to_the_tolerance() {
        let function = |u: f64, v: f64| DVec3::new(u.cos() * (2.0 + v.sin()), u.sin(), v.exp());
        let breaks = [vec![0.0, 1.0, 3.0], vec![0.0, 2.0]];
        let found = fit_surface(function, &breaks, 1e-7).unwrap();
        assert!(found.deviation <= 1e-7);
        for k in 0..400 {
            let (u, v) = (f64::from(k % 20) * 0.15, f64::from(k) * 0.005);
            let off = found
                .surface
                .evaluate(DVec2::new(u, v))
                .distance(function(u, v));
            assert!(off <= 3e-7, "{u} {v}: {off:e}");
        }
    }

    #[test]
    fn cubics_are_one_piece_and_jumps_are_told() {
        let cubic = |t: f64| DVec2::new(t, t * t * t - 2.0 * t);
        let found = fit(cubic, &[0.0, 2.0], 1e-12, DVec2::distance).unwrap();
        assert_eq!(found.curve.points().count(), 4);
        let jump = |t: f64| DVec2::new(t, if t < 0.3 { 0.0 } else { 1.0 });
        let found = fit(jump, &[0.0, 1.0], 1e-3, DVec2::distance).unwrap();
        assert!(found.deviation > 0.1);
        assert!(fit(jump, &[0.0], 1e-3, DVec2::distance).is_err());
    }

    #[test]
    fn surfaces_that_cannot_be_met_end_and_tell() {
        let breaks = [vec![0.0, 1.0], vec![0.0, 1.0]];
        let jump = |u: f64, v: f64| DVec3::new(u, v, if u < 0.3 { 0.0 } else { 1.0 });
        let found = fit_surface(jump, &breaks, 1e-6).unwrap();
        assert!(found.deviation > 0.1 && found.deviation <= 1.0);
        assert!(found.surface.knots_u().breaks().len() < 20);
        let lost = |u: f64, v: f64| DVec3::new(u, v, if v > 0.7 { f64::NAN } else { 0.0 });
        assert!(fit_surface(lost, &breaks, 1e-6).is_err());
        for few in [vec![], vec![0.0]] {
            assert!(fit_surface(jump, &[few, vec![0.0, 1.0]], 1e-6).is_err());
        }
    }
}
