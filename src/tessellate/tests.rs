use std::f64::consts::{PI, TAU};

use kernel::{Child, Item, Node, Patch, Shape, Surface, modelling};

use super::*;

/// A scene that shows patches as they are.
fn scene(patches: Vec<Patch>) -> Scene {
    let mut scene = Scene::default();
    let mut node = Node::default();
    for patch in patches {
        let id = scene.add_patch(patch).unwrap();
        node.children.push(Child::Item(Item {
            shape: Shape::Patch(id),
            material: None,
        }));
    }
    let root = scene.add_node(node).unwrap();
    scene.set_root(root).unwrap();
    scene
}

fn with_tolerance(surface: Surface, length: f64) -> Tessellation {
    let options = TessellateOptions {
        tolerance: Tolerance::Length(length),
        angle: PI,
        ..TessellateOptions::default()
    };
    tessellate(&scene(vec![surface.into()]), &options)
}

#[test]
fn known_bodies_use_most_of_the_tolerance_and_never_more() {
    let bodies = bodies();
    for (name, surface, euler, [area, volume]) in &bodies {
        for exponent in 1..=4 {
            let tolerance = 10.0_f64.powi(-exponent) * 0.5;
            let start = std::time::Instant::now();
            let result = with_tolerance(surface.clone(), tolerance);
            let face = result.faces[0].as_ref().unwrap();
            let shell = &result.shells[0];
            println!(
                "{name} {tolerance}: {} triangles, sampled {:.3}, proven {:.3}, {shell:?} {:.3} s",
                face.mesh.triangles().len(),
                face.sampled / tolerance,
                face.proven / tolerance,
                start.elapsed().as_secs_f64()
            );
            assert!(face.proven <= tolerance && face.unproven == 0);
            assert!(face.sampled <= face.proven && face.sampled >= 0.3 * tolerance);
            assert_eq!(shell.euler, *euler);
            let _ = (area, volume);
        }
    }
}

/// Unit sphere, cylinder without ends, and torus, with Euler characteristic, area and volume.
fn bodies() -> Vec<(&'static str, Surface, i64, [f64; 2])> {
    let frame = &modelling::Frame::WORLD;
    let half = -0.5 * PI..0.5 * PI;
    vec![
        (
            "sphere",
            modelling::sphere(frame, 1.0, 0.0..TAU, half).unwrap(),
            2,
            [4.0 * PI, 4.0 / 3.0 * PI],
        ),
        (
            "cylinder",
            modelling::cylinder(frame, 1.0, 0.0..TAU, 0.0..2.0).unwrap(),
            0,
            [4.0 * PI, 2.0 * PI],
        ),
        (
            "torus",
            modelling::torus(frame, 2.0, 0.5, 0.0..TAU, 0.0..TAU).unwrap(),
            0,
            [4.0 * PI * PI, PI * PI],
        ),
    ]
}
