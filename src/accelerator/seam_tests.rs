//! Rays along the lines between the pieces of a surface that lies far from the origin.

use std::f64::consts::TAU;

use glam::DVec3;
use kernel::modelling::{self, Frame};
use kernel::{Patch, Ray};

use super::tests::{all_hits, scene_of};
use super::{Accelerator, Workspace};
use crate::intersect::METHODS;
use crate::random::Random;

/// Radii of a torus.
const RADII: [f64; 2] = [1.0, 0.3];

/// Rays that all but touch one of the circles in the plane of symmetry are left out.
const TOUCHING: f64 = 1e-3;

/// How often a line at a distance from the middle meets both circles of the torus in its plane of symmetry.
fn crossings(distance: f64) -> Option<usize> {
    let circles = [RADII[0] - RADII[1], RADII[0] + RADII[1]];
    let is_clear = circles.iter().all(|r| (r - distance).abs() > TOUCHING);
    is_clear.then(|| 2 * circles.iter().filter(|r| distance < **r).count())
}

#[test]
fn rays_in_a_plane_of_symmetry_meet_what_is_far_from_the_origin() {
    let mut random = Random(31);
    let mut met = 0;
    for far in [1.0, 1e3, 1e5, 4e5, 7e5, 1e6, 1e7, 1e8] {
        let center = (random.vector() * far).round();
        let frame = Frame::about(center, DVec3::Z).unwrap();
        let torus = modelling::torus(&frame, RADII[0], RADII[1], 0.0..TAU, 0.0..TAU).unwrap();
        let scene = scene_of(vec![Patch::from(torus)]);
        let accelerator = Accelerator::build(&scene, &METHODS[0]);
        let (mut rays, mut expected) = (Vec::new(), Vec::new());
        while rays.len() < 64 {
            let way = random.vector().truncate().normalize();
            let beside = 1.2 * random.vector().x;
            // Directions that all but lie along an axis keep their places exactly.
            let origin = (way.perp() * beside - way * 3.0).extend(0.0);
            let Some(count) = crossings(beside.abs()) else {
                continue;
            };
            rays.push(Ray {
                origin: center + origin,
                direction: way.extend(0.0),
            });
            expected.push(count);
        }
        let ranges = vec![0.0..f64::INFINITY; rays.len()];
        let (mut workspace, mut hits) = (Workspace::default(), Vec::new());
        accelerator.nearest_many(&rays, &ranges, &mut workspace, &mut hits);
        for ((ray, hit), count) in rays.iter().zip(&hits).zip(expected) {
            let found = all_hits(&accelerator, ray).len();
            assert_eq!(found, count, "{far} {ray:?}");
            assert_eq!(hit.is_some(), count > 0, "{far} {ray:?}");
            met += count;
        }
    }
    assert!(met > 500, "{met}");
}
