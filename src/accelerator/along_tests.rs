//! Rays that run along a curved surface, or all but do.

use glam::DVec3;
use kernel::{KnotVector, Patch, Ray, Surface};

use super::Accelerator;
use super::tests::{all_hits, scene_of};
use crate::intersect::METHODS;

/// The part of `z = x^2 - y^2` over two ranges.
fn saddle(x: [f64; 2], y: [f64; 2]) -> Patch {
    let line = |[a, b]: [f64; 2]| [a, f64::midpoint(a, b), b];
    let square = |[a, b]: [f64; 2]| [a * a, a * b, b * b];
    let points: Vec<_> = (0..9)
        .map(|k| {
            let (i, j) = (k / 3, k % 3);
            DVec3::new(line(x)[i], line(y)[j], square(x)[i] - square(y)[j])
        })
        .collect();
    let knots = || KnotVector::bezier(2, 0.0..1.0).unwrap();
    Patch::from(Surface::new(knots(), knots(), &points, None).unwrap())
}

/// Where a ray meets a part of the saddle.
fn hits(ranges: [[f64; 2]; 2], origin: [f64; 3], direction: [f64; 3]) -> Vec<f64> {
    let scene = scene_of(vec![saddle(ranges[0], ranges[1])]);
    let accelerator = Accelerator::build(&scene, &METHODS[0]);
    let ray = Ray {
        origin: origin.into(),
        direction: direction.into(),
    };
    let hits = all_hits(&accelerator, &ray);
    for hit in &hits {
        assert!(hit.point.distance(ray.at(hit.t)) < 4e-9);
    }
    hits.iter().map(|hit| hit.t).collect()
}

const WHOLE: [[f64; 2]; 2] = [[-1.0, 1.0]; 2];

/// Its diagonal is none of the surface's.
const PART: [[f64; 2]; 2] = [[-1.0, 0.7], [-0.83, 0.91]];

#[test]
fn a_ray_in_the_surface_runs_along_one_stretch() {
    for (ranges, start, end) in [(WHOLE, 1.0, 3.0), (PART, 1.17, 2.7)] {
        let found = hits(ranges, [-2.0, -2.0, 0.0], [1.0, 1.0, 0.0]);
        let (Some(first), Some(last)) = (found.first(), found.last()) else {
            panic!("nothing is found")
        };
        assert!(
            (first - start).abs() < 1e-8 && (last - end).abs() < 1e-8,
            "{found:?}"
        );
        assert!(found.len() < 40, "{}", found.len());
    }
    // The same line, on a ray that is slanted.
    let origin = [-1.876_953_125, -1.678_955_078_125, 0.704_062_879_085_540_8];
    let found = hits(WHOLE, origin, [1.0, 1.0, -0.395_996_093_75]);
    assert!((1..40).contains(&found.len()), "{}", found.len());
}

#[test]
fn a_ray_beside_the_surface_meets_nothing() {
    for ranges in [WHOLE, PART] {
        for beside in [1e-11, 1e-10, 1e-9, -1e-10] {
            let found = hits(ranges, [-2.0, -2.0, beside], [1.0, 1.0, 0.0]);
            assert!(found.is_empty(), "{beside}: {}", found.len());
        }
    }
}

#[test]
fn a_ray_that_all_but_runs_along_has_its_own_roots() {
    // Along it the surface is `2e-9 (t - 2)^2` away.
    let direction = [1.0, 1.000_000_001, 0.0];
    for ranges in [WHOLE, PART] {
        let found = hits(ranges, [-2.0, -2.000_000_002, 0.0], direction);
        assert!(!found.is_empty() && found.len() < 10, "{found:?}");
        assert!(found.iter().all(|t| (t - 2.0).abs() < 0.01), "{found:?}");
        let found = hits(ranges, [-2.0, -2.000_000_002, -1e-10], direction);
        let [a, b] = found[..] else {
            panic!("{found:?}")
        };
        let reach = 0.05_f64.sqrt();
        assert!(
            (a - 2.0 + reach).abs() < 1e-4 && (b - 2.0 - reach).abs() < 1e-4,
            "{found:?}"
        );
    }
}
