//! Meshes of which the distances from exact surfaces are known in closed form.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DAffine3, DMat3, DVec3};
use nurbray::kernel::modelling::{self, Frame};
use nurbray::kernel::{Child, Item, KnotVector, Mesh, Node, Patch, Scene, Shape, Surface};

use nurbray::compare::{Deviation, Reach, Subject};
use nurbray::{TessellateOptions, Tolerance, tessellate};

/// A scene that shows these surfaces.
fn scene_of(surfaces: Vec<Surface>) -> Scene {
    let mut scene = Scene::default();
    let mut root = Node::default();
    for surface in surfaces {
        let id = scene.add_patch(Patch::from(surface)).unwrap();
        let (shape, material) = (Shape::Patch(id), None);
        root.children.push(Child::Item(Item { shape, material }));
    }
    let root = scene.add_node(root).unwrap();
    scene.set_root(root).unwrap();
    scene
}

/// A scene that shows these triangles.
fn mesh_of(points: &[DVec3], triangles: &[[u32; 3]]) -> Scene {
    let mut scene = Scene::default();
    let mesh = Mesh::new(points.to_vec(), Vec::new(), Vec::new(), triangles.to_vec());
    let id = scene.add_mesh(mesh.unwrap()).unwrap();
    let (shape, material) = (Shape::Mesh(id), None);
    let children = vec![Child::Item(Item { shape, material })];
    let root = scene.add_node(Node {
        children,
        ..Node::default()
    });
    scene.set_root(root.unwrap()).unwrap();
    scene
}

fn measured(surfaces: Vec<Surface>, mesh: &Scene, map: &DAffine3) -> Deviation {
    let scene = scene_of(surfaces);
    let options = TessellateOptions {
        tolerance: Tolerance::Relative(1e-3),
        ..TessellateOptions::default()
    };
    let subject = Subject::new(&scene, tessellate(&scene, &options).expect("few points"));
    subject.measure(mesh, map)
}

/// Between what is found and what is proven lies the truth, and they are one in a thousand apart.
#[track_caller]
fn assert_truth(reach: &Reach, truth: f64) {
    let (found, bound) = (reach.found, reach.bound);
    assert!(found <= truth * (1.0 + 1e-9), "{found} found of {truth}");
    assert!(bound >= truth, "{bound} proven of {truth}");
    assert!(bound <= truth * 1.001, "{bound} proven of {truth}");
    assert!(found >= truth * 0.999, "{found} found of {truth}");
    let worst = reach.worst[0];
    assert!((worst.distance - found).abs() <= 1e-3 * truth);
    assert!((worst.from.distance(worst.to) - worst.distance).abs() <= 1e-9 * truth);
}

#[test]
fn a_prism_in_a_cylinder_is_a_sagitta_away() {
    let (radius, height) = (10.0, 8.0);
    let cylinder = modelling::cylinder(&Frame::WORLD, radius, 0.0..TAU, 0.0..height).unwrap();
    for (count, turn) in [(6_u32, 0.0), (12, 0.3), (96, 0.0)] {
        let points: Vec<DVec3> = (0..2 * count)
            .map(|k| {
                let angle = f64::from(k / 2) * TAU / f64::from(count) + turn;
                DVec3::new(
                    angle.cos() * radius,
                    angle.sin() * radius,
                    f64::from(k % 2) * height,
                )
            })
            .collect();
        let side = |k: u32| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|j| (2 * k + j) % (2 * count));
            [[a, c, b], [b, c, d]]
        };
        let triangles: Vec<_> = (0..count).flat_map(side).collect();
        let mesh = mesh_of(&points, &triangles);
        let found = measured(vec![cylinder.clone()], &mesh, &DAffine3::IDENTITY);
        let sagitta = radius * (1.0 - (PI / f64::from(count)).cos());
        assert_truth(&found.surface_to_mesh, sagitta);
        assert_truth(&found.mesh_to_surface, sagitta);
        let worst = found.surface_to_mesh.worst[0];
        let share = (worst.from.y.atan2(worst.from.x) - turn) / TAU * f64::from(count);
        assert!((share.rem_euclid(1.0) - 0.5).abs() < 0.05, "{worst:?}");
        // The normals of a facet are right in its middle and wrong by half its angle at its ends.
        let most = 180.0 / f64::from(count);
        let normals = found.flat_normals.unwrap();
        assert!(normals.max <= most * 1.0001 && normals.max > 0.9 * most);
        assert!((normals.mean - 0.5 * most).abs() < 0.05 * most);
    }
}

#[test]
fn an_icosahedron_in_a_sphere_is_farthest_in_the_middle_of_its_faces() {
    let radius = 3.0;
    let sphere = modelling::sphere(&Frame::WORLD, radius, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2).unwrap();
    let long = 0.5 * (1.0 + 5.0_f64.sqrt());
    let corners: Vec<DVec3> = (0..12)
        .map(|k| {
            let sign = |bit: i32| if k & bit == 0 { 1.0 } else { -1.0 };
            let (one, other) = (sign(1), long * sign(2));
            let p = match k / 4 {
                0 => DVec3::new(0.0, one, other),
                1 => DVec3::new(one, other, 0.0),
                _ => DVec3::new(other, 0.0, one),
            };
            p.normalize() * radius
        })
        .collect();
    let side = corners[0].distance(corners[1]);
    let near = |a: usize, b: usize| corners[a].distance(corners[b]) < 1.01 * side;
    let mut triangles = Vec::new();
    for a in 0..12_usize {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    triangles.push([a, b, c].map(|k| u32::try_from(k).unwrap()));
                }
            }
        }
    }
    assert_eq!(triangles.len(), 20);
    let mesh = mesh_of(&corners, &triangles);
    // The ratio of the spheres inside and around an icosahedron.
    let inside = ((5.0 + 2.0 * 5.0_f64.sqrt()) / 15.0).sqrt();
    for turn in [0.0, 1.0] {
        let map = DAffine3::from_mat3(DMat3::from_rotation_x(turn) * DMat3::from_rotation_y(turn));
        let found = measured(vec![sphere.clone()], &mesh, &map);
        assert_truth(&found.surface_to_mesh, radius * (1.0 - inside));
        assert_truth(&found.mesh_to_surface, radius * (1.0 - inside));
    }
}

#[test]
fn triangles_that_bridge_a_crease_are_as_far_away_as_they_are() {
    let knots = |count| KnotVector::clamped_uniform(1, count, 0.0..1.0).unwrap();
    let place = |i: u32, y: f64| DVec3::new(f64::from(i), y, f64::from(i % 2));
    let corners: Vec<DVec3> = (0..6).map(|k| place(k / 2, f64::from(k % 2))).collect();
    let roof = Surface::new(knots(3), knots(2), &corners, None).unwrap();
    // A ceiling from eave to eave; and slopes in many triangles, all of them a little too high, so that
    // only the proof, not a look at the worst of them, comes to the ceiling.
    let (count, raised) = (40_u32, 1e-4);
    let along = |i: u32| (0..=count).map(move |j| place(i, f64::from(j) / f64::from(count)));
    let slopes = (0..3).flat_map(along).map(|p| p + DVec3::Z * raised);
    let points: Vec<DVec3> = corners.iter().copied().chain(slopes).collect();
    let quad = |i: u32, j: u32| {
        let a = 6 + i * (count + 1) + j;
        let b = a + count + 1;
        [[a, b, b + 1], [a, b + 1, a + 1]]
    };
    let mut triangles = vec![[0, 4, 5], [0, 5, 1]];
    triangles.extend((0..2).flat_map(|i| (0..count).flat_map(move |j| quad(i, j))));
    let found = measured(
        vec![roof],
        &mesh_of(&points, &triangles),
        &DAffine3::IDENTITY,
    );
    assert_truth(&found.mesh_to_surface, 0.5_f64.sqrt());
    assert!(found.surface_to_mesh.bound < 1.1 * raised, "{found:?}");
}

#[test]
fn without_a_surface_a_mesh_is_infinitely_far_away() {
    let knots = || KnotVector::clamped_uniform(1, 2, 0.0..1.0).unwrap();
    let ends = [DVec3::ZERO, DVec3::X];
    let line = Surface::new(knots(), knots(), &[ends, ends].concat(), None).unwrap();
    let mesh = mesh_of(&[DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
    let found = measured(vec![line], &mesh, &DAffine3::IDENTITY);
    assert!(found.found().is_infinite() && found.bound().is_infinite());
}

/// The faces of a box from the origin to `size`, and its triangles.
fn block(size: DVec3) -> (Vec<Surface>, Scene) {
    let mut surfaces = Vec::new();
    for axis in 0..3 {
        let (mut u, mut v, mut far) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        u[(axis + 1) % 3] = size[(axis + 1) % 3];
        v[(axis + 2) % 3] = size[(axis + 2) % 3];
        far[axis] = size[axis];
        surfaces.push(modelling::plane(DVec3::ZERO, v, u, 0.0..1.0, 0.0..1.0).unwrap());
        surfaces.push(modelling::plane(far, u, v, 0.0..1.0, 0.0..1.0).unwrap());
    }
    let points: Vec<DVec3> = (0..8)
        .map(|k| size * DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)))
        .collect();
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles: Vec<[u32; 3]> = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    (surfaces, mesh_of(&points, &triangles))
}

#[test]
fn a_box_that_was_moved_is_that_far_away_and_a_fit_brings_it_back() {
    let (surfaces, mesh) = block(DVec3::new(4.0, 3.0, 2.0));
    let way = DVec3::new(0.03, -0.02, 0.05);
    let map = DAffine3::from_translation(way);
    let found = measured(surfaces.clone(), &mesh, &map);
    // A corner is nearest to a corner.
    assert_truth(&found.surface_to_mesh, way.length());
    assert_truth(&found.mesh_to_surface, way.length());
    let same = measured(surfaces.clone(), &mesh, &DAffine3::IDENTITY);
    assert!(same.found() < 1e-12 && same.bound() < 1e-4, "{same:?}");
    let scene = scene_of(surfaces);
    let subject = Subject::new(
        &scene,
        tessellate(&scene, &TessellateOptions::default()).expect("few points"),
    );
    let turned = map * DAffine3::from_rotation_z(0.1) * DAffine3::from_rotation_x(FRAC_PI_2);
    let fit = subject.fit(&mesh, &turned).unwrap();
    assert!(fit.before > 0.1 && fit.residual < 1e-9, "{fit:?}");
    let back = subject.measure(&mesh, &(fit.scene_from_mesh * turned));
    assert!(back.found() < 1e-8 && back.bound() < 1e-3, "{back:?}");
    let inches = DAffine3::from_scale(DVec3::splat(1.0 / 25.4));
    assert!(subject.fit(&mesh, &inches).is_none());
}

#[test]
fn a_fit_finds_any_turn() {
    // Of a plate most points are near before the others are.
    for size in [DVec3::new(4.0, 3.0, 2.0), DVec3::new(4.0, 3.0, 0.04)] {
        let (surfaces, mesh) = block(size);
        let scene = scene_of(surfaces);
        let subject = Subject::new(
            &scene,
            tessellate(&scene, &TessellateOptions::default()).expect("few points"),
        );
        for k in 0..60 {
            let (a, b) = (0.7 * f64::from(k), 1.9 * f64::from(k));
            let axis = DVec3::new(a.cos() * b.cos(), a.sin() * b.cos(), b.sin());
            let turned = DAffine3::from_translation(DVec3::splat(a))
                * DAffine3::from_axis_angle(axis, 0.1 * f64::from(k));
            let fit = subject.fit(&mesh, &turned).unwrap();
            assert!(fit.residual < 1e-9, "{size} {k}: {fit:?}");
        }
    }
}

#[test]
fn a_vertex_that_was_moved_is_found() {
    let (count, step, height) = (10_u32, 0.5, 0.04);
    let size = DVec3::X * step * f64::from(count);
    let plane = modelling::plane(DVec3::ZERO, size, DVec3::Y * size.x, 0.0..1.0, 0.0..1.0).unwrap();
    let number = |i: u32, j: u32| i * (count + 1) + j;
    let mut points: Vec<DVec3> = (0..=count)
        .flat_map(|i| (0..=count).map(move |j| DVec3::new(f64::from(i), f64::from(j), 0.0) * step))
        .collect();
    let moved = number(7, 3);
    points[moved as usize].z = height;
    let squares = (0..count).flat_map(|i| (0..count).map(move |j| (i, j)));
    let triangles: Vec<_> = squares
        .flat_map(|(i, j)| {
            let (a, b, c, d) = (
                number(i, j),
                number(i + 1, j),
                number(i + 1, j + 1),
                number(i, j + 1),
            );
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let mesh = mesh_of(&points, &triangles);
    let found = measured(vec![plane], &mesh, &DAffine3::IDENTITY);
    assert_truth(&found.mesh_to_surface, height);
    let worst = found.mesh_to_surface.worst[0];
    assert!(worst.from.distance(points[moved as usize]) < 1e-12);
    assert!(triangles[worst.triangle as usize].contains(&moved));
    assert!((worst.uv - glam::DVec2::new(0.7, 0.3)).length() < 1e-9);
    // From the plane the nearest are the sides of the pyramid that are steepest.
    let half = step * 0.5_f64.sqrt();
    assert_truth(&found.surface_to_mesh, height * half / height.hypot(half));
}

#[test]
fn nearest_points_of_flat_bodies_are_the_nearest() {
    let thin = 0.5;
    let sphere = modelling::sphere(&Frame::WORLD, 500.0, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2).unwrap();
    let lens = sphere.transformed(&DAffine3::from_scale(DVec3::new(thin / 500.0, 1.0, 1.0)));
    let scene = scene_of(vec![lens.clone()]);
    let options = TessellateOptions {
        tolerance: Tolerance::Length(0.05),
        ..TessellateOptions::default()
    };
    let triangles = tessellate(&scene, &options).unwrap();
    let face = triangles.faces[0].as_ref().unwrap();
    let mesh = mesh_of(face.mesh.positions(), face.mesh.triangles());
    let found = measured(vec![lens], &mesh, &DAffine3::IDENTITY);
    let (found, proven) = (found.found(), face.proven);
    assert!(found <= proven && found > 0.5 * proven, "{found} {proven}");
}
