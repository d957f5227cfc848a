//! Rays along the lines between the pieces of a surface that lies far from the origin.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec2, DVec3};
use kernel::modelling::{self, Frame};
use kernel::{Patch, Ray};

use super::tests::{all_hits, scene_of};
use super::{Accelerator, Workspace};
use crate::intersect::METHODS;
use crate::random::Random;

/// Rays that all but touch a circle are left out.
const TOUCHING: f64 = 1e-3;

/// A circle: its middle and radius.
type Circle = (DVec2, f64);

/// How often a line meets circles.
fn crossings(circles: &[Circle], origin: DVec2, way: DVec2) -> Option<usize> {
    let off = |(middle, radius): &Circle| (middle - origin).perp_dot(way).abs() - radius;
    let is_clear = circles.iter().all(|circle| off(circle).abs() > TOUCHING);
    is_clear.then(|| 2 * circles.iter().filter(|circle| off(circle) < 0.0).count())
}

/// Sends rays in a plane through the middle of a patch, of which that shows these circles; the result says how
/// many hits there are.
fn check(
    (patch, center): (&Patch, DVec3),
    (axes, circles): ([DVec3; 2], &[Circle]),
    random: &mut Random,
) -> usize {
    let scene = scene_of(vec![patch.clone()]);
    let accelerator = Accelerator::build(&scene, &METHODS[0]);
    let (mut rays, mut expected) = (Vec::new(), Vec::new());
    while rays.len() < 64 {
        let way = random.vector().truncate().normalize();
        let origin = way.perp() * (1.4 * random.signed()) - way * 3.0;
        let Some(count) = crossings(circles, origin, way) else {
            continue;
        };
        let in_space = |p: DVec2| axes[0] * p.x + axes[1] * p.y;
        rays.push(Ray {
            origin: center + in_space(origin),
            direction: in_space(way),
        });
        expected.push(count);
    }
    let ranges = vec![0.0..f64::INFINITY; rays.len()];
    let (mut workspace, mut hits) = (Workspace::default(), Vec::new());
    accelerator.nearest_many(&rays, &ranges, &mut workspace, &mut hits);
    for ((ray, hit), &count) in rays.iter().zip(&hits).zip(&expected) {
        let found = all_hits(&accelerator, ray).len();
        assert_eq!(found, count, "{center} {ray:?}");
        assert_eq!(hit.is_some(), count > 0, "{center} {ray:?}");
    }
    expected.iter().sum()
}

#[test]
fn rays_in_planes_of_symmetry_meet_what_is_far_from_the_origin() {
    let mut random = Random(31);
    let mut met = 0;
    for far in [1.0, 1e3, 1e5, 4e5, 7e5, 1e6, 1e7, 1e8] {
        let center = (random.vector() * far).round();
        let frame = Frame::about(center, DVec3::Z).unwrap();
        let torus = modelling::torus(&frame, 1.0, 0.3, 0.0..TAU, 0.0..TAU).unwrap();
        let sphere = modelling::sphere(&frame, 1.0, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2).unwrap();
        let [torus, sphere] = [torus, sphere].map(Patch::from);
        let rings = [(DVec2::ZERO, 0.7), (DVec2::ZERO, 1.3)];
        let tubes = [(DVec2::X, 0.3), (DVec2::NEG_X, 0.3)];
        let globe = [(DVec2::ZERO, 1.0)];
        for (patch, axes, circles) in [
            (&torus, [DVec3::X, DVec3::Y], &rings[..]),
            (&torus, [DVec3::X, DVec3::Z], &tubes),
            (&torus, [DVec3::Y, DVec3::Z], &tubes),
            (&sphere, [DVec3::X, DVec3::Y], &globe),
            (&sphere, [DVec3::X, DVec3::Z], &globe),
        ] {
            met += check((patch, center), (axes, circles), &mut random);
        }
    }
    assert!(met > 3000, "{met}");
}
