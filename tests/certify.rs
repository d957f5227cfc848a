//! Certificates against the high-precision references and against the production path.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod reference;
mod shots;

use fastrand::Rng;
use glam::{DAffine3, DVec3};
use kernel::{Child, Item, KnotVector, Mesh, Node, Patch, Ray, Scene, Shape, Surface};
use nurbray::{Accelerator, Certificate, Certifier, METHODS, Workspace, formats};
use reference::{scenes, vector};
use serde_json::Value;
use shots::Targets;

/// Accuracy that the production path promises, relative to the scene's size.
const ACCURACY: f64 = 1e-9;

/// What is wrong with a certificate, by the reference.
fn wrong(certificate: &Certificate, case: &Value) -> Option<&'static str> {
    let hits = case["hits"].as_array().unwrap();
    let overlaps = case["overlap"].as_array();
    let along = |key: &str, list: &[Value]| -> Vec<f64> {
        list.iter().map(|x| x[key].as_f64().unwrap()).collect()
    };
    let mut known = along("t", hits);
    known.extend(overlaps.into_iter().flat_map(|list| along("t0", list)));
    known.sort_by(f64::total_cmp);
    let first = known.first().copied();
    match (certificate, first) {
        (Certificate::Hit { .. }, None) => Some("invented"),
        (Certificate::Hit { t, .. }, Some(first)) => {
            // The reference is rounded once.
            let contained = t.low() <= first.next_up() && first.next_down() <= t.high();
            (!contained).then_some("elsewhere")
        }
        (Certificate::Miss, Some(_)) => Some("lost"),
        (Certificate::Ambiguous { free, .. }, Some(first)) => {
            (first.next_up() < *free).then_some("not free")
        }
        (Certificate::Miss | Certificate::Ambiguous { .. }, None) => None,
    }
}

#[test]
fn references_are_never_contradicted() {
    let Some(reference) = reference::load() else {
        return;
    };
    let scenes = scenes(&reference);
    let (mut failures, mut open) = (Vec::new(), Vec::new());
    let mut counts = [[0_u32; 5]; 2];
    let mut widest = 0.0_f64;
    for case in reference["cases"].as_array().unwrap() {
        let scene = &scenes[usize::try_from(case["surface"].as_u64().unwrap()).unwrap()];
        let certifier = Certifier::build(scene);
        let ray = Ray {
            origin: vector(&case["origin"]),
            direction: vector(&case["dir"]),
        };
        let certificate = certifier.certify(&ray);
        let robust = case["robust"] == Value::Bool(true);
        counts[usize::from(robust)][usize::from(certificate.code())] += 1;
        let describe = || format!("{} {}: {certificate:?}", case["id"], case["category"]);
        if let Some(wrong) = wrong(&certificate, case) {
            let first = &case["hits"][0]["t"];
            failures.push(format!("{wrong} {} reference {first}", describe()));
        }
        match certificate {
            Certificate::Hit { t, .. } if robust => {
                let size = scene.hull_bounds().diagonal() / ray.direction.length();
                widest = widest.max(t.width() / size);
            }
            // On the line between two pieces a root may belong to both or to neither.
            Certificate::Ambiguous { .. } if robust && case["category"] != "knot_line_exact" => {
                open.push(describe());
            }
            _ => {}
        }
    }
    println!("[miss, hit, tangent, edge, overlap]: not robust, robust {counts:?}");
    println!("widest t {widest:e} of the size\nopen: {}", open.join("\n"));
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(open.is_empty(), "robust but not certified");
}

/// Shoots rays at the samples; all contradictions, and how many rays have which status.
fn compare(rays: usize, seed: u64) -> (Vec<String>, [usize; 5]) {
    let (mut found, mut counts) = (Vec::new(), [0; 5]);
    let mut dice = Rng::with_seed(seed);
    for name in ["teapot.obj", "goblet.x3d", "sphere_torus.x3d"] {
        let path = format!("{}/samples/{name}", env!("CARGO_MANIFEST_DIR"));
        let scene = formats::open(&path, &formats::Limits::default())
            .unwrap()
            .scene;
        let accelerator = Accelerator::build(&scene, &METHODS[0]);
        let certifier = Certifier::build(&scene);
        let mut workspace = Workspace::default();
        let size = accelerator.bounds().diagonal();
        let targets = Targets::of(&scene, size);
        for _ in 0..rays / 3 {
            let Some(ray) = targets.ray(&mut dice) else {
                continue;
            };
            let certificate = certifier.certify(&ray);
            counts[usize::from(certificate.code())] += 1;
            let answer = accelerator.nearest(&ray, 0.0..f64::INFINITY, &mut workspace);
            let accuracy = ACCURACY * size / ray.direction.length();
            if certificate.contradicts(answer.as_ref(), accuracy) {
                let answer = answer.map(|h| (h.shape, h.t, h.uv, h.tangential));
                found.push(format!("{name} {ray:?}\n  {certificate:?}\n  {answer:?}"));
            }
        }
    }
    (found, counts)
}

#[test]
fn the_production_path_is_never_contradicted() {
    let (found, counts) = compare(10_000, 1);
    assert!(
        found.is_empty(),
        "{}\n{} contradictions",
        found.join("\n"),
        found.len()
    );
    assert!(counts[0] > 100 && counts[1] > 1000, "{counts:?}");
}

#[test]
#[ignore = "soak: a million rays"]
fn a_million_rays_contradict_nothing() {
    let (found, _) = compare(1_000_000, 2);
    assert!(
        found.is_empty(),
        "{}\n{} contradictions",
        found.join("\n"),
        found.len()
    );
}

/// A unit square in the plane z = 0, and what shows shapes under a map.
fn square() -> Surface {
    let knots = KnotVector::bezier(1, 0.0..1.0).unwrap();
    let corners = [DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::new(1.0, 1.0, 0.0)];
    Surface::new(knots.clone(), knots, &corners, None).unwrap()
}

fn shown(scene: &mut Scene, shapes: &[Shape], maps: &[DAffine3]) {
    let children = shapes.iter().map(|&shape| {
        let material = None;
        Child::Item(Item { shape, material })
    });
    let group = Node {
        children: children.collect(),
        ..Node::default()
    };
    let group = scene.add_node(group).unwrap();
    let placed = maps.iter().map(|&parent_from_node| {
        let node = Node {
            parent_from_node,
            children: vec![Child::Node(group)],
            ..Node::default()
        };
        Child::Node(scene.add_node(node).unwrap())
    });
    let children = placed.collect();
    let root = Node {
        children,
        ..Node::default()
    };
    let root = scene.add_node(root).unwrap();
    scene.set_root(root).unwrap();
}

fn down(x: f64, y: f64) -> Ray {
    Ray {
        origin: DVec3::new(x, y, 4.0),
        direction: DVec3::NEG_Z * 2.0,
    }
}

#[test]
fn placed_patches_and_triangles() {
    let mut scene = Scene::default();
    let patch = scene.add_patch(Patch::from(square())).unwrap();
    let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    let mesh = Mesh::new(corners, Vec::new(), Vec::new(), vec![[0, 1, 2]]).unwrap();
    let mesh = scene.add_mesh(mesh).unwrap();
    let turned = DAffine3::from_rotation_z(0.3) * DAffine3::from_scale(DVec3::splat(0.5));
    let maps = [
        DAffine3::from_translation(DVec3::new(10.0, 0.0, 1.0)) * turned,
        DAffine3::from_translation(DVec3::new(20.0, 0.0, 2.0)) * turned,
    ];
    shown(&mut scene, &[Shape::Patch(patch), Shape::Mesh(mesh)], &maps);
    let certifier = Certifier::build(&scene);
    // Patch and triangle lie in one plane: the half without the triangle is certain.
    let at = |map: usize, x, y| {
        let p = maps[map].transform_point3(DVec3::new(x, y, 0.0));
        certifier.certify(&down(p.x, p.y))
    };
    for (map, t) in [(0, 1.5), (1, 1.0)] {
        match at(map, 0.7, 0.6) {
            Certificate::Hit { shape, t: found } => {
                assert_eq!(shape as usize, map);
                assert!(found.contains(t) && found.width() < 1e-12);
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(at(map, 0.3, 0.3).name(), "overlap");
        assert_eq!(at(map, 1.1, 0.3), Certificate::Miss);
        assert_eq!(at(map, 1.0, 0.6).name(), "edge");
    }
}

#[test]
fn triangles_alone() {
    let mut scene = Scene::default();
    let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    let mesh = Mesh::new(corners, Vec::new(), Vec::new(), vec![[0, 1, 2]]).unwrap();
    let mesh = scene.add_mesh(mesh).unwrap();
    shown(&mut scene, &[Shape::Mesh(mesh)], &[DAffine3::IDENTITY]);
    let certifier = Certifier::build(&scene);
    let status = |ray: &Ray| certifier.certify(ray).name();
    assert_eq!(status(&down(0.3, 0.3)), "hit");
    assert_eq!(status(&down(0.7, 0.6)), "miss");
    assert_eq!(status(&down(0.5, 0.0)), "edge");
    let origin = DVec3::new(-1.0, 0.2, 0.0);
    let within = |x: f64, y: f64, z: f64| {
        let direction = DVec3::new(x, y, z);
        status(&Ray { origin, direction })
    };
    assert_eq!(within(1.0, 0.0, 0.0), "edge");
    assert_eq!(within(0.0, 1.0, 0.0), "miss");
    assert_eq!(within(-1.0, 0.0, 0.0), "miss");
}

#[test]
fn rays_along_and_on_a_surface() {
    let mut scene = Scene::default();
    let patch = scene.add_patch(Patch::from(square())).unwrap();
    shown(&mut scene, &[Shape::Patch(patch)], &[DAffine3::IDENTITY]);
    let certifier = Certifier::build(&scene);
    let status = |origin: [f64; 3], direction: [f64; 3]| {
        let (origin, direction) = (origin.into(), direction.into());
        certifier.certify(&Ray { origin, direction }).name()
    };
    assert_eq!(status([-1.0, 0.3, 0.0], [1.0, 0.1, 0.0]), "tangent");
    assert_eq!(status([-1.0, 0.3, 1e-9], [1.0, 0.1, 0.0]), "miss");
    assert_eq!(status([0.3, 0.3, 0.0], [0.1, 0.0, 1.0]), "edge");
    assert_eq!(status([0.3, 0.3, 1e-9], [0.1, 0.0, 1.0]), "miss");
    assert_eq!(status([0.3, 0.3, 1.0], [0.0, 0.0, 0.0]), "miss");
}
