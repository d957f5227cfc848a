//! Evaluation against values that were computed in exact arithmetic and rounded once.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec2, DVec3};
use nurbray_kernel::{KnotVector, Surface};
use serde_json::Value;

/// Largest error, relative to the value or, where that is small, to the largest of its kind
/// on the surface.
const ACCURACY: f64 = 1e-12;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

fn vector(value: &Value) -> DVec3 {
    let [x, y, z] = numbers(value)[..] else {
        panic!("three numbers expected")
    };
    DVec3::new(x, y, z)
}

fn knots(surface: &Value, name: &str) -> KnotVector {
    let degree = surface[format!("degree_{name}")].as_u64().unwrap();
    let knots = numbers(&surface[format!("knots_{name}")]);
    KnotVector::new(usize::try_from(degree).unwrap(), knots).unwrap()
}

/// What a sample says, and what we say, by name.
fn compare(surface: &Surface, sample: &Value) -> [(&'static str, DVec3, DVec3); 7] {
    let uv = DVec2::new(number(&sample["u"]), number(&sample["v"]));
    let d = surface.derivatives(uv);
    let expected = |name: &str| vector(&sample[name]);
    [
        ("point", expected("point"), d.point),
        ("du", expected("du"), d.du),
        ("dv", expected("dv"), d.dv),
        ("duu", expected("duu"), d.duu),
        ("duv", expected("duv"), d.duv),
        ("dvv", expected("dvv"), d.dvv),
        ("normal", expected("normal"), surface.normal(uv).unwrap()),
    ]
}

#[test]
fn evaluation_agrees_with_exact_arithmetic() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/reference/eval.json");
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("skipped: {} is not there", path.display());
        return;
    };
    let reference: Value = serde_json::from_str(&text).unwrap();
    let mut worst: BTreeMap<&str, (f64, u64)> = BTreeMap::new();
    for entry in reference["surfaces"].as_array().unwrap() {
        let points = entry["points"].as_array().unwrap();
        let points: Vec<_> = points.iter().map(vector).collect();
        let weights = numbers(&entry["weights"]);
        let (knots_u, knots_v) = (knots(entry, "u"), knots(entry, "v"));
        let surface = Surface::new(knots_u, knots_v, &points, Some(&weights)).unwrap();
        let samples = entry["samples"].as_array().unwrap();
        let samples: Vec<_> = samples.iter().map(|s| compare(&surface, s)).collect();
        let mut sizes: BTreeMap<&str, f64> = BTreeMap::new();
        for (name, expected, _) in samples.iter().flatten() {
            let size = sizes.entry(name).or_default();
            *size = size.max(expected.length());
        }
        for (name, expected, found) in samples.iter().flatten() {
            let error = expected.distance(*found) / sizes[name];
            let id = entry["id"].as_u64().unwrap();
            let worst = worst.entry(name).or_default();
            if error > worst.0 || error.is_nan() {
                *worst = (error, id);
            }
        }
    }
    for (name, (error, id)) in &worst {
        println!("{name:7} worst relative error {error:.1e}, surface {id}");
    }
    assert_eq!(worst.len(), 7);
    assert!(worst.values().all(|(error, _)| *error < ACCURACY));
}
