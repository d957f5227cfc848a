//! Once its memory has grown, no search for rays allocates.

#![expect(clippy::unwrap_used, reason = "a test may fail")]

use glam::{DAffine3, DVec3};
use nurbray::kernel::modelling::{self, Frame};
use nurbray::kernel::{Child, Item, Node, Patch, Ray, Scene, Shape};
use nurbray::{Accelerator, METHODS, Workspace};
use std::f64::consts::TAU;

/// Two tori, one of them shown twice.
fn scene() -> Scene {
    let mut scene = Scene::default();
    let mut children = Vec::new();
    for (k, axis) in [DVec3::X, DVec3::Z].into_iter().enumerate() {
        let frame = Frame::about(DVec3::Y * 0.3 * k as f64, axis).unwrap();
        let torus = modelling::torus(&frame, 1.0, 0.3, 0.0..TAU, 0.0..TAU).unwrap();
        let patch = scene.add_patch(Patch::from(torus)).unwrap();
        let item = Child::Item(Item {
            shape: Shape::Patch(patch),
            material: None,
        });
        let node = scene.add_node(Node {
            children: vec![item],
            ..Node::default()
        });
        children.push(Child::Node(node.unwrap()));
    }
    let again = Node {
        parent_from_node: DAffine3::from_translation(DVec3::X * 0.5),
        children: vec![children[0]],
        ..Node::default()
    };
    children.push(Child::Node(scene.add_node(again).unwrap()));
    let root = scene.add_node(Node {
        children,
        ..Node::default()
    });
    scene.set_root(root.unwrap()).unwrap();
    scene
}

#[test]
fn the_ray_loop_does_not_allocate() {
    let scene = scene();
    let accelerator = Accelerator::build(&scene, &METHODS[0]);
    let rays: Vec<Ray> = (0..64 * 64)
        .map(|k| {
            let (packet, lane) = (k / 64, k % 64);
            let place = |packet: usize, lane: usize| (packet * 8 + lane) as f64 / 16.0 - 2.0;
            let (x, y) = (place(packet % 8, lane % 8), place(packet / 8, lane / 8));
            Ray {
                origin: DVec3::new(x, 4.0, y),
                direction: DVec3::new(0.01 * y, -1.0, -0.02 * x),
            }
        })
        .collect();
    // One half in packets that run side by side, the other in all directions.
    let turned = rays.iter().enumerate().map(|(k, ray)| {
        let angle = k as f64;
        let direction = DVec3::new(angle.sin(), angle.cos(), (2.0 * angle).sin());
        Ray {
            origin: -2.0 * direction + 0.2 * ray.origin,
            direction,
        }
    });
    let rays: Vec<Ray> = rays.iter().copied().chain(turned).collect();
    let ranges = vec![0.0..f64::INFINITY; rays.len()];
    let mut workspace = Workspace::default();
    let (mut hits, mut blocked, mut all) = (Vec::new(), Vec::new(), Vec::new());
    let mut search = || {
        accelerator.nearest_many(&rays, &ranges, &mut workspace, &mut hits);
        accelerator.any_many(&rays, &ranges, &mut workspace, &mut blocked);
        for (ray, range) in rays.iter().zip(&ranges) {
            let _ = accelerator.nearest(ray, range.clone(), &mut workspace);
            let _ = accelerator.any(ray, range.clone(), &mut workspace);
            accelerator.all(ray, range.clone(), &mut workspace, &mut all);
        }
    };
    search();
    let counted = allocation_counter::measure(search);
    assert!(
        hits.iter().flatten().count() > 1500,
        "rays must meet something"
    );
    assert_eq!(counted.count_total, 0, "{counted:?}");
}
