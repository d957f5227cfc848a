//! Local interpolation of a grid of points by bicubic pieces (Coons, Ferguson).

use glam::DVec3;

use crate::{Error, KnotVector, Surface};

/// The mixed derivatives at the points of a grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Twist {
    /// Differences of the derivatives along one direction, along the other.
    #[default]
    Catmull,
    /// None.
    Zero,
    /// The cross product of the two derivatives, for points scaled so that steps have the mean
    /// length one.
    Cross,
    /// The cross product of the two derivatives as they are: the shape then depends on the unit
    /// of length. As A. Sisojevs prints it; for comparison only.
    SeedLiteral,
}

/// The surface of bicubic Bézier pieces between neighbours of the grid
/// `points[i * count_v + j]`, which pass at the parameters `(i, j)`.
///
/// Derivatives at the points are half the differences of their neighbours, one-sided at open
/// ends (parabolas through three points). Pieces share them, so that the surface is C1. A closed
/// direction goes on from the last point to the first one.
///
/// # Errors
/// If a direction has fewer than 2 points, or 3 if it is closed, the number of points is not a
/// multiple of `count_u`, or a point is not finite.
pub fn coons(
    points: &[DVec3],
    count_u: usize,
    is_closed: [bool; 2],
    twist: Twist,
) -> Result<Surface, Error> {
    let count_v = points.len().checked_div(count_u).unwrap_or(0);
    for (found, is_closed) in [(count_u, is_closed[0]), (count_v, is_closed[1])] {
        let expected = if is_closed { 3 } else { 2 };
        if found < expected {
            return Err(Error::PointCount { found, expected });
        }
    }
    if count_u * count_v != points.len() {
        return Err(Error::PointCount {
            found: points.len(),
            expected: count_u * count_v,
        });
    }
    let [along_u, along_v] = [
        Differences::new(count_u, count_v, is_closed[0]),
        Differences::new(count_v, 1, is_closed[1]),
    ];
    let du: Vec<_> = (0..points.len()).map(|k| along_u.at(points, k)).collect();
    let dv: Vec<_> = (0..points.len()).map(|k| along_v.at(points, k)).collect();
    let step = du.iter().chain(&dv).map(|d| d.length()).sum::<f64>() / (du.len() + dv.len()) as f64;
    let duv = |k: usize| match twist {
        Twist::Catmull => along_u.at(&dv, k),
        Twist::Zero => DVec3::ZERO,
        Twist::Cross => du[k].cross(dv[k]) / step,
        Twist::SeedLiteral => du[k].cross(dv[k]),
    };
    // Three control points for each point: before, at and after it.
    let (rows, row) = (along_u.controls(), along_v.controls());
    let mut net = vec![DVec3::ZERO; rows * row];
    for i in 0..rows {
        for j in 0..row {
            let ((i0, a), (j0, b)) = (along_u.nearest(i), along_v.nearest(j));
            let k = i0 * count_v + j0;
            net[i * row + j] = points[k] + (du[k] * a + dv[k] * b + duv(k) * (a * b / 3.0)) / 3.0;
        }
    }
    let knots = |rows: usize| {
        let last = (rows - 1) / 3;
        let inner = (1..last).flat_map(|k| [k as f64; 3]);
        let ends = [0.0, last as f64].map(|k| [k; 4]);
        KnotVector::new(3, ends[0].into_iter().chain(inner).chain(ends[1]).collect())
    };
    Surface::new(knots(rows)?, knots(row)?, &net, None)
}

/// The places along one direction of a grid.
struct Differences {
    count: usize,
    stride: usize,
    is_closed: bool,
}

impl Differences {
    fn new(count: usize, stride: usize, is_closed: bool) -> Self {
        Self {
            count,
            stride,
            is_closed,
        }
    }

    /// How many control points there are.
    fn controls(&self) -> usize {
        let steps = if self.is_closed {
            self.count
        } else {
            self.count - 1
        };
        3 * steps + 1
    }

    /// The point that a control point is nearest to, and on which side of it: -1, 0 or 1.
    fn nearest(&self, control: usize) -> (usize, f64) {
        let side = [0.0, 1.0, -1.0][control % 3];
        ((control + 1) / 3 % self.count, side)
    }

    /// The derivative of a grid at its `k`-th point.
    fn at(&self, points: &[DVec3], k: usize) -> DVec3 {
        let (count, stride) = (self.count, self.stride);
        let place = k / stride % count;
        let first = k - place * stride;
        let point = |place: usize| points[first + place % count * stride];
        let is_end = !self.is_closed && (place == 0 || place == count - 1);
        if !is_end {
            return (point(place + 1) - point(place + count - 1)) * 0.5;
        }
        if count == 2 {
            return point(1) - point(0);
        }
        if place == 0 {
            (point(1) * 4.0 - point(0) * 3.0 - point(2)) * 0.5
        } else {
            (point(place) * 3.0 - point(place - 1) * 4.0 + point(place - 2)) * 0.5
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    /// Eight by eight points of a sphere, from 0.5 from one pole to 0.5 from the other, over 1.6
    /// radians of longitude.
    fn sphere(radius: f64) -> Vec<DVec3> {
        let step = |k: u32, from: f64, to: f64| from + (to - from) * f64::from(k) / 7.0;
        let point = |k: u32| {
            let polar = step(k / 8, 0.5, std::f64::consts::PI - 0.5);
            let around = DVec2::from_angle(step(k % 8, 0.0, 1.6));
            (around * polar.sin()).extend(polar.cos()) * radius
        };
        (0..64).map(point).collect()
    }

    /// The largest error of the radius on a piece in the middle, relative.
    fn error(radius: f64, twist: Twist) -> f64 {
        let surface = coons(&sphere(radius), 8, [false; 2], twist).unwrap();
        let mut worst = 0.0_f64;
        for k in 0..441_u32 {
            let share = DVec2::new(f64::from(k / 21), f64::from(k % 21)) / 20.0;
            let found = surface.evaluate(DVec2::splat(2.0) + share);
            worst = worst.max((found.length() / radius - 1.0).abs());
        }
        worst
    }

    #[test]
    fn spheres_are_met_as_known() {
        let is_near = |found: f64, known: f64| (found / known - 1.0).abs() < 5e-3;
        for radius in [1.0, 10.0, 100.0] {
            assert!(is_near(error(radius, Twist::Catmull), 2.62e-4));
            assert!(is_near(error(radius, Twist::Zero), 3.37e-4));
            let scaled = error(radius, Twist::Cross) / error(1.0, Twist::Cross);
            assert!((scaled - 1.0).abs() < 1e-9);
        }
        for (radius, known) in [(1.0, 7.81e-4), (10.0, 6.58e-3), (100.0, 6.48e-2)] {
            let found = error(radius, Twist::SeedLiteral);
            assert!(is_near(found, known), "{radius}: {found:e}");
        }
    }

    #[test]
    fn pieces_meet_with_one_tangent_plane_and_derivative() {
        let wave = |k: usize| {
            let (i, j) = ((k / 9) as f64, (k % 9) as f64);
            let around = DVec2::from_angle(std::f64::consts::TAU * j / 9.0);
            (around * (2.0 + (i * 1.3 + j).sin())).extend(i * 1.7)
        };
        let points: Vec<DVec3> = (0..6 * 9).map(wave).collect();
        let twists = [
            Twist::Catmull,
            Twist::Zero,
            Twist::Cross,
            Twist::SeedLiteral,
        ];
        for twist in twists {
            let surface = coons(&points, 6, [false, true], twist).unwrap();
            assert_eq!(surface.closed(), [false, true]);
            let mut worst = 0.0_f64;
            for k in 0..=100 {
                let along = f64::from(k) * 0.05;
                for knot in 0..9 {
                    // The pieces before and after, each prolonged from its own side.
                    let (start, end) =
                        (f64::from(knot), f64::from(if knot == 0 { 9 } else { knot }));
                    let before = surface.restricted_v(end - 1.0..end).unwrap();
                    let after = surface.restricted_v(start..start + 1.0).unwrap();
                    let before = before.derivatives(DVec2::new(along, end));
                    let after = after.derivatives(DVec2::new(along, start));
                    worst = worst.max(before.point.distance(after.point));
                    worst = worst
                        .max(before.dv.distance(after.dv))
                        .max(before.du.distance(after.du));
                }
            }
            for knot in 1..5 {
                let at = f64::from(knot);
                let before = surface.restricted_u(at - 1.0..at).unwrap();
                let after = surface.restricted_u(at..at + 1.0).unwrap();
                for k in 0..=90 {
                    let uv = DVec2::new(at, f64::from(k) * 0.1);
                    worst = worst.max(before.derivatives(uv).du.distance(after.derivatives(uv).du));
                }
            }
            assert!(worst < 1e-12, "{twist:?}: {worst:e}");
            for (k, point) in points.iter().enumerate() {
                let uv = DVec2::new((k / 9) as f64, (k % 9) as f64);
                assert_eq!(surface.evaluate(uv), *point);
            }
        }
    }

    #[test]
    fn too_few_points_are_told() {
        let points = sphere(1.0);
        assert!(coons(&points, 1, [false; 2], Twist::Zero).is_err());
        assert!(coons(&points, 7, [false; 2], Twist::Zero).is_err());
        assert!(coons(&points[..16], 2, [true, false], Twist::Zero).is_err());
    }
}
