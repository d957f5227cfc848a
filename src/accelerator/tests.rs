//! Laws of the search: every method, every scale.

use glam::{DAffine3, DVec2, DVec3};
use kernel::modelling::{self, Frame};
use kernel::{
    Child, Curve, Item, KnotVector, Mesh, Node, NodeId, Patch, Ray, Scene, Shape, Surface, TrimLoop,
};
use std::f64::consts::{FRAC_PI_2, TAU};

use super::{Accelerator, Workspace};
use crate::Instructions;
use crate::intersect::{Hit, METHODS};
use crate::random::Random;

fn leaf_node(scene: &mut Scene, patches: Vec<Patch>, parent_from_node: DAffine3) -> NodeId {
    let children = patches
        .into_iter()
        .map(|patch| {
            let shape = Shape::Patch(scene.add_patch(patch).unwrap());
            Child::Item(Item {
                shape,
                material: None,
            })
        })
        .collect();
    let node = Node {
        parent_from_node,
        children,
        ..Node::default()
    };
    scene.add_node(node).unwrap()
}

pub(super) fn ball(scale: f64, center: DVec3) -> Patch {
    let frame = Frame::about(center * scale, DVec3::Z).unwrap();
    let sphere = modelling::sphere(&frame, scale, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2).unwrap();
    Patch::from(sphere)
}

pub(super) fn scene_of(patches: Vec<Patch>) -> Scene {
    let mut scene = Scene::default();
    let root = leaf_node(&mut scene, patches, DAffine3::IDENTITY);
    scene.set_root(root).unwrap();
    scene
}

pub(super) fn all_hits(accelerator: &Accelerator<'_>, ray: &Ray) -> Vec<Hit> {
    let mut hits = Vec::new();
    accelerator.all(
        ray,
        0.0..f64::INFINITY,
        &mut Workspace::default(),
        &mut hits,
    );
    hits
}

/// The ray crosses the surface at a hundred thousandth of a degree next to where it would touch it;
/// where it does was found with fifty digits.
#[test]
fn a_crossing_at_almost_no_angle_is_found_exactly() {
    let heights = |row: usize, k: usize| {
        if (1..3).contains(&row) && (1..3).contains(&k) {
            2.0
        } else {
            0.0
        }
    };
    let net = (0..16).map(|n| {
        let (row, k) = (n / 4, n % 4);
        DVec3::new(row as f64 - 1.5, k as f64 - 1.5, heights(row, k))
    });
    let knots = || KnotVector::new(2, vec![0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0]).unwrap();
    let surface = Surface::new(knots(), knots(), &net.collect::<Vec<_>>(), None).unwrap();
    let scene = scene_of(vec![Patch::from(surface)]);
    let ray = Ray {
        origin: DVec3::new(
            -1.5284628731387968,
            -1.503763687814236,
            -0.053752515462347786,
        ),
        direction: DVec3::new(1.1379056939845225, 0.0455220606914768, 0.1275275804322196),
    };
    let accelerator = Accelerator::build(&scene, &METHODS[0]);
    let hits = all_hits(&accelerator, &ray);
    assert!(
        hits.iter()
            .any(|hit| (hit.t - 1.0216484436688526).abs() < 1e-10),
        "{hits:?}"
    );
}

/// In single precision the ray runs along the square, while it crosses it: others that run the other
/// way must not matter.
#[test]
fn a_face_seen_from_its_edge_is_found_by_rays_that_go_their_own_ways() {
    let knots = || KnotVector::new(1, vec![0.0, 0.0, 1.0, 1.0]).unwrap();
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)];
    let corners = corners.map(|(x, y)| DVec3::new(x, -x, y));
    let surface = Surface::new(knots(), knots(), &corners, None).unwrap();
    let scene = scene_of(vec![Patch::from(surface)]);
    let target = DVec3::new(0.3, -0.3, -0.2);
    for angle in [1e-6, 1e-8, 1e-10] {
        let direction = DVec3::new(0.6, angle - 0.6, 0.8);
        let ray = Ray {
            origin: target - direction * 3.0,
            direction,
        };
        let back = Ray {
            origin: DVec3::new(9.0, 9.0, 9.0),
            direction: -direction,
        };
        let ranges = [0.0..f64::INFINITY, 0.0..f64::INFINITY];
        let mut hits = Vec::new();
        for instructions in Instructions::ALL {
            let accelerator = Accelerator::build(&scene, &METHODS[0]);
            let accelerator = accelerator.with_instructions(instructions);
            let room = &mut Workspace::default();
            accelerator.nearest_many(&[ray, back], &ranges, room, &mut hits);
            let t = hits[0].map(|hit| hit.t);
            assert!(t.is_some_and(|t| (t - 3.0).abs() < 1e-3), "{angle}: {t:?}");
        }
    }
}

/// A plane with the frame `turned` about z, of which a triangle with these corners belongs to the face.
fn triangle(turned: f64, from: DVec2, corners: [DVec2; 3]) -> Patch {
    let knots = || KnotVector::new(1, vec![0.0, 0.0, 1.0, 1.0]).unwrap();
    let (along, across) = (
        DVec2::from_angle(turned) * 9.0,
        DVec2::from_angle(turned).perp() * 7.0,
    );
    let net = [DVec2::ZERO, across, along, along + across].map(|way| (from + way).extend(0.0));
    let mut face = Patch::from(Surface::new(knots(), knots(), &net, None).unwrap());
    let place = |p: DVec2| {
        let way = p - from;
        DVec2::new(way.dot(along) / 81.0, way.dot(across) / 49.0)
    };
    let [a, b, c] = corners.map(place);
    let outline = KnotVector::clamped_uniform(1, 4, 0.0..1.0).unwrap();
    let outline = Curve::new(outline, &[a, b, c, a], None).unwrap();
    face.loops = vec![TrimLoop::new(vec![outline], 1e-12).unwrap()];
    face
}

#[test]
fn rays_through_a_common_border_of_trimmed_faces_meet_one_of_them() {
    let (from, to) = (DVec2::new(1.0, 1.3), DVec2::new(2.1, 3.4));
    let left = triangle(0.3, DVec2::new(2.0, -4.0), [from, to, DVec2::new(0.2, 3.0)]);
    let right = triangle(
        -0.4,
        DVec2::new(-2.0, -1.0),
        [from, to, DVec2::new(3.0, 1.5)],
    );
    let scene = scene_of(vec![left, right]);
    let rays: Vec<_> = (1..1024)
        .map(|k| {
            let direction = DVec3::new(0.01 * f64::from(k % 7), 0.02 * f64::from(k % 5), 1.0);
            let target = from.lerp(to, f64::from(k) / 1024.0).extend(0.0);
            Ray {
                origin: target - direction * 5.0,
                direction,
            }
        })
        .collect();
    let ranges = vec![0.0..f64::INFINITY; rays.len()];
    for instructions in Instructions::ALL {
        let accelerator = Accelerator::build(&scene, &METHODS[0]).with_instructions(instructions);
        let room = &mut Workspace::default();
        let mut hits = Vec::new();
        accelerator.nearest_many(&rays, &ranges, room, &mut hits);
        assert!(hits.iter().all(Option::is_some), "{instructions:?}");
        let alone = |ray: &Ray| accelerator.nearest(ray, 0.0..f64::INFINITY, room).is_some();
        assert!(rays.iter().all(alone), "{instructions:?}");
    }
}

#[test]
fn every_method_agrees_with_the_sphere_at_every_scale() {
    for method in METHODS.iter().filter(|m| m.picture.is_none()) {
        for scale in [1e-6, 1.0, 1e6] {
            let scene = scene_of(vec![ball(scale, DVec3::ZERO)]);
            let accelerator = Accelerator::build(&scene, method);
            let mut numbers = Random(7);
            let mut met = 0;
            for _ in 0..500 {
                let origin = numbers.vector().normalize() * 4.0;
                let direction = numbers.vector() * 1.2 - origin;
                let (b, c) = (origin.dot(direction), origin.length_squared() - 1.0);
                let square = b * b - direction.length_squared() * c;
                let ray = Ray {
                    origin: origin * scale,
                    direction: direction * scale,
                };
                let hits = all_hits(&accelerator, &ray);
                if square.abs() < 1e-9 {
                    continue;
                }
                assert_eq!(
                    hits.len(),
                    if square > 0.0 { 2 } else { 0 },
                    "{ray:?} {hits:?}"
                );
                met += hits.len();
                for (hit, sign) in hits.iter().zip([-1.0, 1.0]) {
                    let t = (-b + sign * square.sqrt()) / direction.length_squared();
                    assert!(
                        (hit.t - t).abs() < 1e-12 / square.sqrt().min(1.0),
                        "{} {t}",
                        hit.t
                    );
                    assert!(hit.normal.distance(hit.point / scale) < 1e-12);
                }
            }
            assert!(met > 400);
        }
    }
}

#[test]
fn nothing_leaks_where_pieces_and_cells_meet() {
    let scene = scene_of(vec![ball(1.0, DVec3::ZERO)]);
    let accelerator = Accelerator::build(&scene, &METHODS[0]);
    let mut workspace = Workspace::default();
    let mut numbers = Random(3);
    for k in 0..2000 {
        // On the borders of the quarters and eighths of the pieces, and at the poles.
        let longitude = f64::from(k % 64) / 64.0 * TAU;
        let latitude = numbers.signed() * FRAC_PI_2 * if k % 5 == 0 { 0.0 } else { 1.0 };
        let target = DVec3::new(
            longitude.cos() * latitude.cos(),
            longitude.sin() * latitude.cos(),
            latitude.sin(),
        );
        let target = if k % 50 == 0 { DVec3::Z } else { target };
        let direction = -target + numbers.vector() * 0.3;
        let ray = Ray {
            origin: target * 3.0,
            direction: target * -2.0,
        };
        assert!(
            accelerator
                .nearest(&ray, 0.0..f64::INFINITY, &mut workspace)
                .is_some(),
            "{ray:?}"
        );
        assert!(
            accelerator.any(&ray, 0.0..f64::INFINITY, &mut workspace),
            "{ray:?}"
        );
        // From inside every ray must get out.
        let inside = Ray {
            origin: numbers.vector() * 0.5,
            direction,
        };
        assert!(
            accelerator
                .nearest(&inside, 0.0..f64::INFINITY, &mut workspace)
                .is_some()
        );
    }
}

#[test]
fn instances_are_met_where_copies_would_be() {
    let places = [
        DAffine3::from_translation(DVec3::new(3.0, 0.0, 0.0)),
        DAffine3::from_scale(DVec3::new(1.0, 2.0, 0.5)),
        DAffine3::from_translation(DVec3::Y * 4.0)
            * DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)),
    ];
    let shapes = || vec![ball(1.0, DVec3::ZERO), ball(0.5, DVec3::Z * 2.0)];
    // Shared: one definition below three places; and a shape of the root between them.
    let mut shared = Scene::default();
    let definition = leaf_node(&mut shared, shapes(), DAffine3::IDENTITY);
    let mut children = Vec::new();
    for (k, place) in places.into_iter().enumerate() {
        let node = Node {
            parent_from_node: place,
            children: vec![Child::Node(definition)],
            ..Node::default()
        };
        children.push(Child::Node(shared.add_node(node).unwrap()));
        if k == 0 {
            let lone = leaf_node(
                &mut shared,
                vec![ball(0.4, DVec3::X * -9.0)],
                DAffine3::IDENTITY,
            );
            children.push(Child::Node(lone));
        }
    }
    let root = shared
        .add_node(Node {
            children,
            ..Node::default()
        })
        .unwrap();
    shared.set_root(root).unwrap();
    // The same as separate patches.
    let mut copies = Vec::new();
    for (k, place) in places.iter().enumerate() {
        copies.extend(
            shapes()
                .into_iter()
                .map(|p| Patch::from(p.surface.transformed(place))),
        );
        if k == 0 {
            copies.push(ball(0.4, DVec3::X * -9.0));
        }
    }
    let copies = scene_of(copies);
    let (a, b) = (
        Accelerator::build(&shared, &METHODS[0]),
        Accelerator::build(&copies, &METHODS[0]),
    );
    assert!(a.cell_count() < b.cell_count());
    assert_eq!((a.patch_count(), b.patch_count()), (7, 7));
    let mut numbers = Random(5);
    let mut met = 0;
    for _ in 0..2000 {
        let origin = numbers.vector() * 12.0;
        let ray = Ray {
            origin,
            direction: numbers.vector() * 3.0 - origin,
        };
        let (first, second) = (all_hits(&a, &ray), all_hits(&b, &ray));
        assert_eq!(first.len(), second.len(), "{ray:?}");
        met += first.len();
        for (x, y) in first.iter().zip(&second) {
            assert_eq!(x.shape, y.shape);
            assert!((x.t - y.t).abs() < 1e-9 && x.normal.distance(y.normal) < 1e-6);
        }
    }
    assert!(met > 500, "{met}");
}

#[test]
fn rays_that_are_none_meet_nothing() {
    let scene = scene_of(vec![ball(1.0, DVec3::ZERO)]);
    let accelerator = Accelerator::build(&scene, &METHODS[0]);
    let mut workspace = Workspace::default();
    for (origin, direction) in [
        (DVec3::Z * 3.0, DVec3::ZERO),
        (DVec3::NAN, DVec3::X),
        (DVec3::Z * 3.0, DVec3::new(f64::NAN, 0.0, -1.0)),
        (DVec3::Z * 3.0, DVec3::NEG_Z * f64::INFINITY),
    ] {
        let ray = Ray { origin, direction };
        assert_eq!(
            accelerator.nearest(&ray, 0.0..f64::INFINITY, &mut workspace),
            None
        );
    }
    let empty = Scene::default();
    let accelerator = Accelerator::build(&empty, &METHODS[0]);
    let ray = Ray {
        origin: DVec3::Z,
        direction: DVec3::NEG_Z,
    };
    assert!(!accelerator.any(&ray, 0.0..f64::INFINITY, &mut workspace));
    let mut hits = vec![];
    accelerator.nearest_many(&[ray], &[0.0..f64::INFINITY], &mut workspace, &mut hits);
    assert_eq!(hits, [None]);
}

/// A scene of all that packets treat in ways of their own: cubic, quadratic and rational
/// pieces, higher degrees, a trimmed face, triangles, and one shape shown twice.
pub(super) fn medley() -> Scene {
    let points = |n: usize, bend: f64| -> Vec<DVec3> {
        let at = |k: usize| k as f64 / (n - 1) as f64 * 2.0 - 1.0;
        let place = |k: usize| {
            let (x, y) = (at(k / n), at(k % n));
            DVec3::new(
                x,
                y,
                bend * (x * x * x - y * y + ((k * 7) % 5) as f64 * 0.2),
            )
        };
        (0..n * n).map(place).collect()
    };
    let sheet = |degree: usize, n: usize, bend: f64| {
        let knots = || KnotVector::clamped_uniform(degree, n, 0.0..1.0).unwrap();
        Surface::new(knots(), knots(), &points(n, bend), None).unwrap()
    };
    let mut scene = Scene::default();
    let corners = [(0.2, 0.1), (0.9, 0.3), (0.5, 0.9), (0.2, 0.1)].map(DVec2::from);
    let outline = Curve::new(
        KnotVector::clamped_uniform(1, 4, 0.0..1.0).unwrap(),
        &corners,
        None,
    );
    let mut trimmed = Patch::from(sheet(3, 7, 0.8));
    trimmed.loops = vec![TrimLoop::new(vec![outline.unwrap()], 1e-12).unwrap()];
    let sheets = vec![
        trimmed,
        Patch::from(sheet(2, 5, 0.5).transformed(&DAffine3::from_translation(DVec3::Z * 0.7))),
        Patch::from(sheet(5, 8, 0.6).transformed(&DAffine3::from_translation(DVec3::Z * -0.8))),
        ball(0.6, DVec3::new(0.3, 0.2, 0.1)),
    ];
    let shared = leaf_node(
        &mut scene,
        sheets,
        DAffine3::from_scale(DVec3::new(0.5, 0.7, 0.6)),
    );
    let mesh = Mesh::new(
        points(4, 0.4),
        Vec::new(),
        Vec::new(),
        vec![[0, 1, 5], [0, 5, 4], [5, 6, 10], [5, 10, 9]],
    )
    .unwrap();
    let shape = Shape::Mesh(scene.add_mesh(mesh).unwrap());
    let mut children = vec![Child::Item(Item {
        shape,
        material: None,
    })];
    for (x, turn) in [(-0.9, 0.3), (0.9, 1.8)] {
        let turned =
            DAffine3::from_rotation_y(turn) * DAffine3::from_scale(DVec3::new(1.0, x, 1.0));
        let place = DAffine3::from_translation(DVec3::X * x) * turned;
        let node = Node {
            parent_from_node: place,
            children: vec![Child::Node(shared)],
            ..Node::default()
        };
        children.push(Child::Node(scene.add_node(node).unwrap()));
    }
    let root = scene.add_node(Node {
        children,
        ..Node::default()
    });
    scene.set_root(root.unwrap()).unwrap();
    scene
}

/// Packets of rays: through the pixels of squares, side by side, and in all directions.
pub(super) fn packets() -> Vec<Vec<Ray>> {
    let mut numbers = Random(11);
    let mut packets = Vec::new();
    for k in 0..120 {
        let eye = numbers.vector().normalize() * 4.0;
        let aim = (numbers.vector() - eye).normalize();
        let (right, up) = aim.any_orthonormal_pair();
        let size = [0.002, 0.05, 0.4][k % 3];
        let rays = (0..64 - k % 5).map(|lane| {
            let (x, y) = ((lane % 8) as f64 - 3.5, (lane / 8) as f64 - 3.5);
            let shift = (right * x + up * y) * size / 8.0;
            match k % 4 {
                0 | 1 => Ray {
                    origin: eye,
                    direction: aim + shift,
                },
                2 => Ray {
                    origin: eye + shift * 3.0,
                    direction: aim,
                },
                _ => Ray {
                    origin: numbers.vector(),
                    direction: numbers.vector(),
                },
            }
        });
        packets.push(rays.collect());
    }
    packets
}

#[test]
fn packets_meet_what_single_rays_meet_with_all_instructions() {
    packets_meet_what_single_rays_meet(&medley());
}

#[test]
fn packets_meet_what_single_rays_meet_in_cells_divided_late() {
    let mut scene = medley();
    let whole = Accelerator::build(&scene, &METHODS[0]).cell_count();
    // What is not shown counts, too.
    for _ in 0..2048 {
        scene.add_patch(ball(1.0, DVec3::ZERO)).unwrap();
    }
    let late = Accelerator::build(&scene, &METHODS[0]).cell_count();
    assert!(late * 4 < whole, "{late} {whole}");
    packets_meet_what_single_rays_meet(&scene);
}

fn packets_meet_what_single_rays_meet(scene: &Scene) {
    for instructions in Instructions::ALL {
        let accelerator = Accelerator::build(scene, &METHODS[0]).with_instructions(instructions);
        let mut workspace = Workspace::default();
        let (mut hits, mut blocked) = (Vec::new(), Vec::new());
        let mut met = 0;
        for rays in packets() {
            let ranges = vec![0.25..6.0; rays.len()];
            accelerator.nearest_many(&rays, &ranges, &mut workspace, &mut hits);
            accelerator.any_many(&rays, &ranges, &mut workspace, &mut blocked);
            for (k, ray) in rays.iter().enumerate() {
                let alone = accelerator.nearest(ray, ranges[k].clone(), &mut workspace);
                let context = format!("{instructions:?} {ray:?}: {:?}, {alone:?}", hits[k]);
                assert_eq!(blocked[k], alone.is_some(), "{context}");
                match (&hits[k], &alone) {
                    (None, None) => {}
                    (Some(a), Some(b)) => {
                        met += 1;
                        assert!((a.t - b.t).abs() < 1e-12 * 8.0, "{context}");
                        let off = ray.at(a.t).distance(a.point);
                        assert!(off < 1e-9 * accelerator.bounds().diagonal(), "{context}");
                        if a.shape == b.shape {
                            assert!(a.normal.distance(b.normal) < 1e-5, "{context}");
                        }
                    }
                    _ => panic!("{context}"),
                }
            }
        }
        assert!(met > 2000, "only {met} hits say nothing");
    }
}

#[test]
fn packets_take_any_number_of_rays() {
    let scene = scene_of(vec![ball(1.0, DVec3::ZERO)]);
    let accelerator = Accelerator::build(&scene, &METHODS[0]);
    let (mut workspace, mut hits) = (Workspace::default(), vec![None; 3]);
    accelerator.nearest_many(&[], &[], &mut workspace, &mut hits);
    assert!(hits.is_empty());
    let ray = Ray {
        origin: DVec3::new(0.1, 0.2, 3.0),
        direction: -DVec3::Z,
    };
    let broken = Ray {
        direction: DVec3::NAN,
        ..ray
    };
    let rays = [&[broken][..], &[ray; 100], &[broken; 2]].concat();
    let ranges = vec![0.0..f64::INFINITY; rays.len()];
    accelerator.nearest_many(&rays, &ranges, &mut workspace, &mut hits);
    let met: Vec<_> = hits.iter().map(Option::is_some).collect();
    let expected: Vec<_> = (0..103).map(|k| (1..101).contains(&k)).collect();
    assert_eq!(met, expected);
}

#[test]
fn a_workspace_may_serve_one_scene_after_another() {
    let scenes = [1.0, 0.5].map(|size| scene_of(vec![ball(size, DVec3::ZERO)]));
    let accelerators = scenes
        .each_ref()
        .map(|s| Accelerator::build(s, &METHODS[0]));
    let (mut workspace, mut hits) = (Workspace::default(), Vec::new());
    let ray = |k: usize| Ray {
        origin: DVec3::new(0.01 * k as f64, 0.02, 3.0),
        direction: -DVec3::Z,
    };
    let rays: Vec<_> = (0..20).map(ray).collect();
    let ranges = vec![0.0..f64::INFINITY; rays.len()];
    for _ in 0..2 {
        for (accelerator, size) in accelerators.iter().zip([1.0, 0.5]) {
            accelerator.nearest_many(&rays, &ranges, &mut workspace, &mut hits);
            for (ray, hit) in rays.iter().zip(&hits) {
                let z = (size * size - ray.origin.truncate().length_squared()).sqrt();
                assert!((hit.unwrap().t - (3.0 - z)).abs() < 1e-12, "{hit:?}");
            }
        }
    }
}

#[test]
fn points_of_packets_lie_on_surfaces_that_turn_much_within_a_piece() {
    // A trough of one piece that goes most of the way around.
    let points: Vec<_> = (0..26)
        .map(|k| {
            let angle = TAU * f64::from(k / 2) / 12.5;
            DVec3::new(angle.cos(), angle.sin(), f64::from(k % 2))
        })
        .collect();
    let knots = |degree| KnotVector::bezier(degree, 0.0..1.0).unwrap();
    let surface = Surface::new(knots(12), knots(1), &points, None).unwrap();
    let scene = scene_of(vec![Patch::from(surface.clone())]);
    let accelerator = Accelerator::build(&scene, &METHODS[0]);
    let (mut workspace, mut hits) = (Workspace::default(), Vec::new());
    for row in 0..64 {
        let angle = TAU * f64::from(row) / 64.0;
        let rays: Vec<_> = (0..64)
            .map(|k| Ray {
                origin: DVec3::new(0.01, 0.02, 0.5),
                direction: DVec3::new(
                    (angle + f64::from(k) * 1e-3).cos(),
                    (angle + f64::from(k) * 1e-3).sin(),
                    0.2,
                ),
            })
            .collect();
        let ranges = vec![0.0..f64::INFINITY; rays.len()];
        accelerator.nearest_many(&rays, &ranges, &mut workspace, &mut hits);
        for hit in hits.iter().flatten() {
            let off = hit.point.distance(surface.evaluate(hit.uv));
            assert!(off < 0.3 * crate::integrator::LEAVE * hit.error, "{off}");
        }
    }
}
