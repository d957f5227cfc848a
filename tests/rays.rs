//! Every hit of the high-precision ray references is found, and no other.
//!
//! The references lie beside the project; without them the test is skipped.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod reference;

use glam::DVec3;
use kernel::{KnotVector, Ray, Surface};
use nurbray::{Accelerator, Hit, METHODS, Workspace};
use reference::{scene_of, scenes, vector};
use serde_json::Value;

#[test]
fn no_hit_is_lost_and_none_invented() {
    let Some(reference) = reference::load() else {
        return;
    };
    let scenes = scenes(&reference);
    let mut workspace = Workspace::default();
    let (mut robust, mut failures, mut worst) = (0, Vec::new(), 0.0_f64);
    for case in reference["cases"].as_array().unwrap() {
        let scene = &scenes[usize::try_from(case["surface"].as_u64().unwrap()).unwrap()];
        let accelerator = Accelerator::build(scene, &METHODS[0]);
        let size = accelerator.bounds().diagonal();
        let ray = Ray {
            origin: vector(&case["origin"]),
            direction: vector(&case["dir"]),
        };
        let length = ray.direction.length();
        let mut hits = Vec::new();
        let near = -1e-12 * size / length;
        accelerator.all(&ray, near..f64::INFINITY, &mut workspace, &mut hits);
        for hit in &hits {
            let residual = hit.point.distance(ray.at(hit.t)) / size;
            if residual > 1e-9 {
                failures.push(format!(
                    "residual {residual:e} of {}",
                    describe(case, &[*hit])
                ));
            }
        }
        let expected = case["hits"].as_array().unwrap();
        if case["robust"] == Value::Bool(true) {
            robust += 1;
            if hits.len() == expected.len() {
                for (hit, wanted) in hits.iter().zip(expected) {
                    let error = (hit.t - wanted["t"].as_f64().unwrap()).abs() * length / size;
                    worst = worst.max(error);
                }
            } else {
                failures.push(describe(case, &hits));
            }
        } else if let Some(lost) = lost(expected, &hits, length, size) {
            println!("not robust: {} of {}", lost, describe(case, &hits));
        }
    }
    println!("{robust} robust rays, worst error of t {worst:e} of the scene size");
    assert!(robust > 500);
    assert!(worst <= 1e-9, "{worst:e}");
    assert!(
        failures.is_empty(),
        "{}\n{} failures",
        failures.join("\n"),
        failures.len()
    );
}

/// A hit of multiplicity one that is not near any of ours.
fn lost(expected: &[Value], hits: &[Hit], length: f64, size: f64) -> Option<Value> {
    let crossing = expected.iter().filter(|wanted| wanted["multiplicity"] == 1);
    let near = |wanted: &Value, hit: &Hit| {
        (hit.t - wanted["t"].as_f64().unwrap()).abs() * length <= 1e-6 * size
    };
    crossing
        .into_iter()
        .find(|wanted| !hits.iter().any(|hit| near(wanted, hit)))
        .cloned()
}

fn describe(case: &Value, hits: &[Hit]) -> String {
    let expected: Vec<_> = case["hits"]
        .as_array()
        .unwrap()
        .iter()
        .map(|h| h["t"].clone())
        .collect();
    let found: Vec<_> = hits
        .iter()
        .map(|h| (h.t, h.uv.x, h.uv.y, h.tangential))
        .collect();
    format!(
        "{} {}: expected {expected:?}, found {found:?}",
        case["id"], case["category"]
    )
}

/// Where a patch is only a curve there is nothing to meet, on whatever ray, and it takes no time to
/// find that out.
#[test]
fn no_ray_meets_a_patch_without_area() {
    // The parabola (s, s^2, 0) at s = u + v.
    let place = |i: usize, j: usize| {
        let (u, v) = (i as f64 / 2.0, j as f64 / 2.0);
        let square = |k: usize| if k == 2 { 1.0 } else { 0.0 };
        DVec3::new(u + v, square(i) + 2.0 * u * v + square(j), 0.0)
    };
    let points = (0..9).map(|k| place(k / 3, k % 3));
    let knots = || KnotVector::bezier(2, 0.0..1.0).unwrap();
    let surface = Surface::new(knots(), knots(), &points.collect::<Vec<_>>(), None).unwrap();
    let scene = scene_of(surface);
    let accelerator = Accelerator::build(&scene, &METHODS[0]);
    let (mut workspace, mut hits) = (Workspace::default(), Vec::new());
    for s in [0.0, 0.3, 1.0, 1.1, 2.0] {
        for direction in [DVec3::Z, DVec3::new(0.1, 0.2, 1.0), DVec3::X] {
            let origin = DVec3::new(s, s * s, 0.0) - direction;
            let ray = Ray { origin, direction };
            accelerator.all(&ray, 0.0..f64::INFINITY, &mut workspace, &mut hits);
            assert_eq!(hits.len(), 0, "{s} {direction}");
        }
    }
}
