//! Parabolic blending of contours, after A. Sisojevs: between two points the curve is a mixture
//! of the two straight lines that fit three points each in the sense of least squares.
//!
//! It smooths: curves and surfaces do not pass through the points, and the bodies are smaller
//! than their contours. [`super::loft`] passes through them. Each piece is an exact Bézier curve
//! of degree 2, or patch of degree 2 x 2.

use glam::DVec3;

use super::layers::{Ring, matched, rings};
use crate::{Curve, Error, KnotVector, Surface};

/// Points of a contour at least.
const LEAST: usize = 4;

/// The closed curve that blends the points of a contour over its parameters, at the last of which
/// the first point comes again. Quadratic and continuous.
fn blended_contour(points: &[DVec3], parameters: &[f64]) -> Result<Curve<DVec3>, Error> {
    let count = points.len();
    // The middle of three points is the same for each of them.
    if count < LEAST {
        return Err(Error::PointCount {
            found: count,
            expected: LEAST,
        });
    }
    // Line `k` fits the points before, at and after point `k`.
    let line = |k: usize| {
        let before = (k + count - 1) % count;
        let turn = if k == 0 { 1.0 } else { 0.0 };
        let offsets = [
            parameters[before] - turn - parameters[k],
            0.0,
            parameters[k + 1] - parameters[k],
        ];
        let near = [before, k, (k + 1) % count].map(|k| points[k]);
        Line::fitted(offsets, near)
    };
    let lines: Vec<Line> = (0..count).map(line).collect();
    let (mut knots, mut net) = (vec![0.0; 3], vec![lines[0].at(0.0)]);
    for k in 0..count {
        let (first, second) = (&lines[k], &lines[(k + 1) % count]);
        let step = parameters[k + 1] - parameters[k];
        net.push(first.at(step).midpoint(second.at(-step)));
        net.push(second.at(0.0));
        knots.extend([parameters[k + 1]; 2]);
    }
    knots.push(1.0);
    Curve::new(KnotVector::new(2, knots)?, &net, None)
}

/// A straight line over a parameter that counts from the middle of its three points.
struct Line {
    start: DVec3,
    slope: DVec3,
}

impl Line {
    /// The line of least squares through three points.
    fn fitted(offsets: [f64; 3], points: [DVec3; 3]) -> Self {
        let mean = offsets.iter().sum::<f64>() / 3.0;
        let center = points.iter().sum::<DVec3>() / 3.0;
        let square: f64 = offsets.iter().map(|t| (t - mean).powi(2)).sum();
        let pairs = offsets.iter().zip(points);
        let slope = pairs.map(|(t, p)| p * (t - mean)).sum::<DVec3>() / square;
        let start = center - slope * mean;
        Self { start, slope }
    }

    fn at(&self, offset: f64) -> DVec3 {
        self.start + self.slope * offset
    }
}

/// The surfaces that blend contours in layers, one between each two neighbours: u goes around
/// from 0 to 1, v from 0 at the lower layer to 1 at the upper one.
///
/// Contours may have any numbers of points, and start and run as they like: they are brought to
/// run the same way, and to start side by side. Normals point outwards. Before the first layer
/// and after the last one another is thought, so that the surface ends on the curves of these.
/// Biquadratic and continuous across all borders.
///
/// # Errors
/// If there are fewer than two contours, one has fewer than four points, a point is not finite,
/// two neighbours coincide or two layers lie at the same height.
pub fn blend(contours: &[Vec<DVec3>]) -> Result<Vec<Surface>, Error> {
    let rings = rings(contours, blended_contour)?;
    (0..rings.len() - 1).map(|k| strip(&rings, k)).collect()
}

/// The surface between rings `k` and `k + 1`.
fn strip(rings: &[Ring], k: usize) -> Result<Surface, Error> {
    let first = k.saturating_sub(1);
    let near = &rings[first..(k + 3).min(rings.len())];
    let curves: Vec<_> = near.iter().map(|ring| &ring.curve).collect();
    let matched = matched(&curves)?;
    let at = |ring: usize| &matched.points[ring - first];
    let count = matched.knots.count();
    let mut net = Vec::new();
    for i in 0..count {
        let (lower, upper) = (at(k)[i], at(k + 1)[i]);
        let before = if k == 0 {
            lower * 2.0 - upper
        } else {
            at(k - 1)[i]
        };
        let is_last = k + 2 == rings.len();
        let after = if is_last {
            upper * 2.0 - lower
        } else {
            at(k + 2)[i]
        };
        net.extend([
            (before + lower + upper) / 3.0,
            ((lower + upper) * 7.0 - before - after) / 12.0,
            (lower + upper + after) / 3.0,
        ]);
    }
    let knots_v = KnotVector::bezier(2, 0.0..1.0)?;
    Surface::new(matched.knots, knots_v, &net, None)
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::modelling::testing::{contour, stack};

    /// The value at `x` of the line of least squares through `(t, p)`, by its normal equations.
    fn fitted(points: [(f64, DVec3); 3], x: f64) -> DVec3 {
        let t1: f64 = points.iter().map(|p| p.0).sum();
        let t2: f64 = points.iter().map(|p| p.0 * p.0).sum();
        let y: DVec3 = points.iter().map(|p| p.1).sum();
        let ty: DVec3 = points.iter().map(|p| p.1 * p.0).sum();
        let determinant = 3.0 * t2 - t1 * t1;
        let (slope, start) = ((ty * 3.0 - y * t1), (y * t2 - ty * t1));
        (slope * x + start) / determinant
    }

    /// The definition, equations (32) to (35): between the middle two of four points.
    fn definition(points: [(f64, DVec3); 4], x: f64) -> DVec3 {
        let [p0, p1, p2, p3] = points;
        let first = fitted([p0, p1, p2], x);
        let second = fitted([p1, p2, p3], x);
        first * ((x - p2.0) / (p1.0 - p2.0)) + second * ((x - p1.0) / (p2.0 - p1.0))
    }

    /// A contour at `u` as the definition has it; parameters are chord lengths from its start.
    fn around(points: &[DVec3], u: f64) -> DVec3 {
        let count = points.len();
        let lengths: Vec<f64> = (0..count)
            .map(|k| points[k].distance(points[(k + 1) % count]))
            .collect();
        let total: f64 = lengths.iter().sum();
        let place = |k: usize| lengths[..k].iter().sum::<f64>() / total;
        let k = (0..count).rev().find(|&k| place(k) <= u).unwrap();
        // Counted from one turn before.
        let near = [count - 1, count, count + 1, count + 2].map(|step| {
            let index = k + step;
            let turns = (index / count) as f64 - 1.0;
            (place(index % count) + turns, points[index % count])
        });
        definition(near, u)
    }

    #[test]
    fn three_points_have_nothing_to_blend() {
        let refused = Error::PointCount {
            found: 3,
            expected: 4,
        };
        assert_eq!(blend(&stack(&[5, 3, 5])), Err(refused));
        assert!(blend(&stack(&[5, 4, 5])).is_ok());
    }

    #[test]
    fn contours_are_as_defined() {
        for count in [4, 7, 40] {
            let points = contour(count, 1.0, 0.0);
            let chord = |k: usize| points[k].distance(points[(k + 1) % count]);
            let total: f64 = (0..count).map(chord).sum();
            let mut parameters = vec![0.0];
            for k in 0..count {
                parameters.push(parameters[k] + chord(k) / total);
            }
            parameters[count] = 1.0;
            let curve = blended_contour(&points, &parameters).unwrap();
            for k in 0..1000 {
                let u = f64::from(k) * 1e-3;
                let off = curve.evaluate(u).distance(around(&points, u));
                assert!(off < 1e-12, "{count} {u}: {off:e}");
            }
        }
    }

    #[test]
    fn surfaces_are_as_defined() {
        let contours = stack(&[7, 12, 30, 9, 5]);
        let strips = blend(&contours).unwrap();
        assert_eq!(strips.len(), 4);
        // The same starts as there: each contour begins at a point, by its construction.
        let mirrored = |a: DVec3, b: DVec3| a * 2.0 - b;
        for (k, strip) in strips.iter().enumerate() {
            for sample in 0..400 {
                let uv = DVec2::new(f64::from(sample) / 400.0, f64::from(sample % 17) / 16.0);
                let at = |layer: usize| around(&contours[layer], uv.x);
                let (lower, upper) = (at(k), at(k + 1));
                let before = if k == 0 {
                    mirrored(lower, upper)
                } else {
                    at(k - 1)
                };
                let after = if k == 3 {
                    mirrored(upper, lower)
                } else {
                    at(k + 2)
                };
                let layers = [(-1.0, before), (0.0, lower), (1.0, upper), (2.0, after)];
                let off = strip.evaluate(uv).distance(definition(layers, uv.y));
                assert!(off < 1e-12, "{k} {uv}: {off:e}");
            }
        }
    }

    #[test]
    fn strips_meet() {
        let strips = blend(&stack(&[8, 11, 25, 25, 14])).unwrap();
        for pair in strips.windows(2) {
            for k in 0..=500 {
                let u = f64::from(k) / 500.0;
                let [lower, upper] = [(&pair[0], 1.0), (&pair[1], 0.0)]
                    .map(|(strip, v)| strip.evaluate(DVec2::new(u, v)));
                assert!(lower.distance(upper) < 1e-13);
            }
        }
    }
}
