//! The high-precision ray references: surfaces as scenes of one patch.
#![expect(clippy::print_stdout, reason = "a test says why it was skipped")]

use glam::DVec3;
use kernel::{Child, Item, KnotVector, Node, Patch, Scene, Shape, Surface};
use serde_json::Value;

/// The references, or `None` with a word on the console where they are not at hand.
pub(crate) fn load() -> Option<Value> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/reference/rays.json");
    match std::fs::read_to_string(path) {
        Ok(text) => Some(serde_json::from_str(&text).unwrap()),
        Err(_) => {
            println!("skipped: the ray references are not there");
            None
        }
    }
}

/// A list of numbers.
fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .expect("a list")
        .iter()
        .map(|x| x.as_f64().expect("a number"))
        .collect()
}

/// Three numbers.
pub(crate) fn vector(value: &Value) -> DVec3 {
    DVec3::from_slice(&numbers(value))
}

/// The scenes of all surfaces, by index.
pub(crate) fn scenes(reference: &Value) -> Vec<Scene> {
    let surfaces = reference["surfaces"].as_array().unwrap();
    surfaces.iter().map(scene).collect()
}

/// A scene that shows one reference surface.
fn scene(value: &Value) -> Scene {
    let knots = |degree: &str, knots: &str| {
        let degree = usize::try_from(value[degree].as_u64().unwrap()).unwrap();
        KnotVector::new(degree, numbers(&value[knots])).unwrap()
    };
    let points: Vec<_> = value["points"]
        .as_array()
        .unwrap()
        .iter()
        .map(vector)
        .collect();
    let weights = numbers(&value["weights"]);
    let surface = Surface::new(
        knots("degree_u", "knots_u"),
        knots("degree_v", "knots_v"),
        &points,
        Some(&weights),
    )
    .unwrap();
    scene_of(surface)
}

/// A scene that shows one surface.
pub(crate) fn scene_of(surface: Surface) -> Scene {
    let mut scene = Scene::default();
    let patch = scene.add_patch(Patch::from(surface)).unwrap();
    let child = Child::Item(Item {
        shape: Shape::Patch(patch),
        material: None,
    });
    let root = scene
        .add_node(Node {
            children: vec![child],
            ..Node::default()
        })
        .unwrap();
    scene.set_root(root).unwrap();
    scene
}
