//! Gaps of known widths.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::modelling::loft;
use kernel::{
    Camera, Child, Curve, Item, KnotVector, Light, LightKind, Node, Patch, Projection, Ray, Scene,
    Shape, Surface, TrimLoop,
};

use super::joints::border_key;
use crate::intersect::METHODS;
use crate::{Accelerator, Hit, Instructions, RenderOptions, Workspace, render};

const WHOLE: Range<f64> = 0.0..f64::INFINITY;

/// A flat face between corners; its parameters are x and y.
fn flat(min: DVec2, max: DVec2) -> Patch {
    let knots = |from: f64, to: f64| KnotVector::bezier(1, from..to).unwrap();
    let corners = [min, DVec2::new(min.x, max.y), DVec2::new(max.x, min.y), max];
    let points = corners.map(|p| p.extend(0.0));
    let (u, v) = (knots(min.x, max.x), knots(min.y, max.y));
    Patch::from(Surface::new(u, v, &points, None).unwrap())
}

fn circle(radius: f64) -> TrimLoop {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let point = |k: usize| {
        let long = if k % 2 == 1 { radius / half } else { radius };
        DVec2::from_angle(TAU * (k % 8) as f64 / 8.0) * long
    };
    let points: Vec<_> = (0..9).map(point).collect();
    let weights: Vec<_> = (0..9)
        .map(|k| if k % 2 == 1 { half } else { 1.0 })
        .collect();
    let knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4].map(f64::from).to_vec();
    let knots = KnotVector::new(2, knots).unwrap();
    let curve = Curve::new(knots, &points, Some(&weights)).unwrap();
    TrimLoop::new(vec![curve], 1e-12).unwrap()
}

fn scene(patches: Vec<Patch>) -> Scene {
    let mut scene = Scene::default();
    let mut children = Vec::new();
    for patch in patches {
        let shape = Shape::Patch(scene.add_patch(patch).unwrap());
        let material = None;
        children.push(Child::Item(Item { shape, material }));
    }
    let node = Node {
        children,
        ..Node::default()
    };
    let root = scene.add_node(node).unwrap();
    scene.set_root(root).unwrap();
    scene
}

/// Rays from all sides through points of the plane.
fn rays(places: impl Iterator<Item = DVec2>) -> Vec<Ray> {
    let direction = |k: usize| DVec3::new((k as f64).sin(), (k as f64 * 0.7).cos(), -1.5);
    let ray = |(k, place): (usize, DVec2)| Ray {
        origin: place.extend(0.0) - direction(k) * 2.0,
        direction: direction(k),
    };
    places.enumerate().map(ray).collect()
}

/// Whether each ray meets a face (true), a gap (false) or nothing, asked in every way.
fn answers(accelerator: Accelerator<'_>, rays: &[Ray]) -> Vec<Option<bool>> {
    let mut workspace = Workspace::default();
    let kind = |hit: &Option<Hit>| hit.map(|hit| !hit.filled);
    let near = |ray: &Ray| accelerator.nearest(ray, WHOLE, &mut Workspace::default());
    let alone: Vec<_> = rays.iter().map(near).collect();
    for (ray, hit) in rays.iter().zip(&alone) {
        let mut all = Vec::new();
        accelerator.all(ray, WHOLE, &mut workspace, &mut all);
        assert_eq!(all.len(), usize::from(hit.is_some()), "{ray:?} {all:?}");
        assert_eq!(accelerator.any(ray, WHOLE, &mut workspace), hit.is_some());
        if let Some(hit) = hit {
            assert!(
                (hit.t - 2.0).abs() < 1e-9 && hit.normal == DVec3::Z,
                "{hit:?}"
            );
        }
    }
    let expected: Vec<_> = alone.iter().map(kind).collect();
    let ranges = vec![WHOLE; rays.len()];
    let mut accelerator = accelerator;
    for instructions in Instructions::ALL {
        accelerator = accelerator.with_instructions(instructions);
        let (mut hits, mut blocked) = (Vec::new(), Vec::new());
        accelerator.nearest_many(rays, &ranges, &mut workspace, &mut hits);
        assert_eq!(hits.iter().map(kind).collect::<Vec<_>>(), expected);
        accelerator.any_many(rays, &ranges, &mut workspace, &mut blocked);
        assert!(
            blocked
                .iter()
                .zip(&expected)
                .all(|(b, e)| *b == e.is_some())
        );
    }
    expected
}

/// What hangs together says what is a gap, not what else is in the scene.
#[test]
fn small_faces_close_gaps_of_their_size_to_what_is_beside_them_in_a_large_scene() {
    let (gap, wide) = (1e-3, 0.5);
    let mut faces = Vec::new();
    for k in 0..100 {
        let shift = if k / 10 < 5 { 0.0 } else { wide };
        let min = DVec2::new(f64::from(k / 10) * 2.0 + shift, f64::from(k % 10) * 2.0);
        faces.push(flat(min, min + 2.0));
    }
    faces.push(flat(DVec2::new(0.0, -10.0), DVec2::new(2.0, -gap)));
    faces.push(flat(DVec2::splat(8000.0), DVec2::splat(9000.0)));
    let scene = scene(faces);
    let sealed = Accelerator::build(&scene, &METHODS[0]).sealed(None);
    assert_eq!(sealed.clusters.len(), 2);
    let at = |k: usize| (k as f64 + 0.5) / 64.0;
    let beside = (0..64).map(|k| DVec2::new(2.0 * at(k), -gap * at(k * 7 % 64)));
    let between = (0..64).map(|k| DVec2::new(10.0 + wide * at(k), 20.0 * at(k * 7 % 64)));
    let answers = answers(sealed, &rays(beside.chain(between)));
    assert!(answers[..64].iter().all(|&a| a == Some(false)));
    assert!(answers[64..].iter().all(Option::is_none));
}

#[test]
fn a_gap_between_borders_is_closed_and_a_free_border_is_not_moved() {
    let gap = 1e-5;
    let left = flat(DVec2::new(-1.0, 0.0), DVec2::new(0.0, 1.0));
    let right = flat(DVec2::new(gap, 0.0), DVec2::new(1.0, 1.0));
    let scene = scene(vec![left, right]);
    let build = || Accelerator::build(&scene, &METHODS[0]);
    let at = |k: usize| (k as f64 + 0.5) / 64.0;
    let through = rays((0..64).map(|k| DVec2::new(gap * at(k * 7 % 64), at(k))));
    assert!(answers(build(), &through).iter().all(Option::is_none));
    let sealed = || build().sealed(Some(2.0 * gap));
    assert_eq!(sealed().strip_count(), 1);
    assert!(
        answers(sealed(), &through)
            .iter()
            .all(|&a| a == Some(false))
    );
    assert!(
        answers(build().sealed(Some(0.5 * gap)), &through)
            .iter()
            .all(Option::is_none)
    );
    // Beside the gap the faces, beyond the free borders nothing.
    let on = rays((0..64).map(|k| DVec2::new(if k % 2 == 0 { -1e-9 } else { gap + 1e-9 }, at(k))));
    assert!(answers(sealed(), &on).iter().all(|&a| a == Some(true)));
    let free = rays((0..64).map(|k| match k % 3 {
        0 => DVec2::new(-1.0 - 1e-9, at(k)),
        1 => DVec2::new(1.0 + 1e-9, at(k)),
        _ => DVec2::new(at(k), 1.0 + 1e-9),
    }));
    assert!(answers(sealed(), &free).iter().all(Option::is_none));
}

#[test]
fn a_gap_as_wide_as_was_asked_for_is_closed() {
    let gap = 0.1;
    let left = flat(DVec2::new(-1.0, 0.0), DVec2::new(0.0, 1.0));
    let right = flat(DVec2::new(gap, 0.0), DVec2::new(1.0, 1.0));
    let scene = scene(vec![left, right]);
    let at = |k: usize| (k as f64 + 0.5) / 64.0;
    let through = rays((0..64).map(|k| DVec2::new(gap * at(k), at(k))));
    let sealed = |tolerance: Option<f64>| {
        answers(
            Accelerator::build(&scene, &METHODS[0]).sealed(tolerance),
            &through,
        )
    };
    assert!(sealed(Some(1.5 * gap)).iter().all(|&a| a == Some(false)));
    assert!(sealed(None).iter().all(Option::is_none));
}

#[test]
fn a_gap_is_in_the_shadow_that_its_faces_are_in() {
    let gap = 8e-3;
    let left = flat(DVec2::new(-1.0, 0.0), DVec2::new(0.0, 1.0));
    let right = flat(DVec2::new(gap, 0.0), DVec2::new(1.0, 1.0));
    let knots = KnotVector::bezier(1, 0.0..1.0).unwrap();
    let corners = [(-2.0, -2.0), (-2.0, 2.0), (2.0, -2.0), (2.0, 2.0)];
    let roof = corners.map(|(x, y)| DVec3::new(x, y, 0.3));
    let roof = Patch::from(Surface::new(knots.clone(), knots, &roof, None).unwrap());
    let mut scene = scene(vec![left, right, roof]);
    scene.headlight = false;
    let direction = DVec3::NEG_Z;
    scene.lights.push(Light {
        kind: LightKind::Directional { direction },
        color: DVec3::ONE,
        ambient: DVec3::ZERO,
        scope: Vec::new(),
    });
    let accelerator = Accelerator::build(&scene, &METHODS[0]).sealed(Some(2.0 * gap));
    // From under the roof.
    let projection = Projection::Orthographic { extent: 4.0 * gap };
    let target = DVec3::new(0.5 * gap, 0.5, 0.0);
    let camera = Camera::look_at(target + 0.2 * DVec3::Z, target, DVec3::Y, projection).unwrap();
    let options = RenderOptions {
        width: 32,
        height: 32,
        samples: 1,
        ..RenderOptions::default()
    };
    let (film, stats) = render(&accelerator, &camera, &options, &|_| {});
    assert!(stats.filled > 100, "{}", stats.filled);
    let first = film.colors()[0];
    assert!(
        film.colors()
            .iter()
            .all(|color| color.map(f32::to_bits) == first.map(f32::to_bits))
    );
}

/// An upright face below a line along y, from the plane down.
fn wall(x: f64) -> Patch {
    let knots = KnotVector::bezier(1, 0.0..1.0).unwrap();
    let points = [(0.0, -1.0), (0.0, 0.0), (1.0, -1.0), (1.0, 0.0)];
    let points = points.map(|(y, z)| DVec3::new(x, y, z));
    Patch::from(Surface::new(knots.clone(), knots, &points, None).unwrap())
}

#[test]
fn the_inside_of_a_face_beside_a_gap_is_not_seen_through_it() {
    let gap = 1e-5;
    let left = || flat(DVec2::new(-1.0, 0.0), DVec2::new(0.0, 1.0));
    let seen = |x: f64| {
        let scene = scene(vec![left(), wall(x)]);
        let accelerator = Accelerator::build(&scene, &METHODS[0]).sealed(Some(2.0 * gap));
        let hits = (0..64).map(|k| {
            let target = DVec3::new(0.5 * x, (f64::from(k) + 0.5) / 64.0, 0.0);
            let direction = DVec3::new(0.6, 0.1, -1.0);
            let ray = Ray {
                origin: target - direction * 2.0,
                direction,
            };
            let hit = accelerator.nearest(&ray, WHOLE, &mut Workspace::default());
            hit.map(|hit| (hit.filled, hit.shape))
        });
        hits.collect::<Vec<_>>()
    };
    // The wall is met less than the width of the gap behind it.
    assert!(seen(gap).iter().all(|hit| matches!(hit, Some((true, _)))));
    // Where the faces overlap there is no gap to be filled: the upper one is met.
    assert!(seen(-gap).iter().all(|hit| *hit == Some((false, 0))));
}

#[test]
fn a_ring_between_loops_is_closed() {
    let corner = DVec2::splat(1.0);
    let (inner, gap) = (0.5, 1e-6);
    let disk = Patch {
        loops: vec![circle(inner)],
        ..flat(-corner, corner)
    };
    let border = TrimLoop::border(&(-1.0..1.0), &(-1.0..1.0)).unwrap();
    let plate = Patch {
        loops: vec![border, circle(inner + gap)],
        ..flat(-corner, corner)
    };
    let scene = scene(vec![disk, plate]);
    let build = || Accelerator::build(&scene, &METHODS[0]);
    let places = |share: f64| {
        rays(
            (0..128).map(move |k| DVec2::from_angle(0.0491 * f64::from(k)) * (inner + gap * share)),
        )
    };
    assert!(answers(build(), &places(0.5)).iter().all(Option::is_none));
    for share in [0.001, 0.3, 0.999] {
        let found = answers(build().sealed(None), &places(share));
        assert!(found.iter().all(|&a| a == Some(false)), "{share} {found:?}");
    }
    for share in [-0.01, 1.01] {
        let found = answers(build().sealed(None), &places(share));
        assert!(found.iter().all(|&a| a == Some(true)), "{share} {found:?}");
    }
}

#[test]
fn boundaries_of_several_pieces_are_joined_piece_by_piece() {
    let gap = 1e-5;
    let left = flat(DVec2::new(-1.0, 0.0), DVec2::new(0.0, 1.0));
    // The other boundary is smooth but for its third derivatives at two places.
    let widths = [1.0, 1.3, 0.8, 1.2, 0.9, 1.1];
    // With these heights the parameter is the height.
    let heights = [0.0, 0.1, 0.3, 1.9 / 3.0, 2.6 / 3.0, 1.0];
    let row = |x: [f64; 6]| (0..6).map(move |k| DVec3::new(x[k], heights[k], 0.0));
    let points: Vec<_> = row(widths.map(|width| width * gap))
        .chain(row([1.0; 6]))
        .collect();
    let along = [0.0, 0.0, 0.0, 0.0, 0.3, 0.6, 1.0, 1.0, 1.0, 1.0];
    let along = KnotVector::new(3, along.to_vec()).unwrap();
    let across = KnotVector::bezier(1, 0.0..1.0).unwrap();
    let right = Surface::new(across, along, &points, None).unwrap();
    let scene = scene(vec![left, Patch::from(right)]);
    let sealed = || Accelerator::build(&scene, &METHODS[0]).sealed(Some(2.0 * gap));
    assert_eq!(sealed().strip_count(), 3);
    let at = |k: usize| (k as f64 + 0.5) / 64.0;
    let through = rays((0..64).map(|k| DVec2::new(0.8 * gap * at(k * 7 % 64), at(k))));
    let found = answers(sealed(), &through);
    assert!(found.iter().all(|&a| a == Some(false)), "{found:?}");
}

#[test]
fn what_two_faces_share_to_the_last_bit_is_not_sewn() {
    let left = flat(DVec2::new(-1.0, 0.0), DVec2::new(0.0, 1.0));
    let right = flat(DVec2::ZERO, DVec2::ONE);
    let key = |patch: &Patch, x: f64| {
        let curve = Curve::line(DVec2::new(x, 0.0), DVec2::new(x, 1.0), 0.0..1.0).unwrap();
        border_key(&patch.surface, &curve)
    };
    assert_eq!(key(&left, 0.0), key(&right, 0.0));
    assert!(key(&left, -1.0) != key(&right, 1.0) && key(&left, -0.5).is_none());
}

#[test]
fn two_walls_of_a_thin_shell_are_not_joined() {
    // Thinner than what the chords of its rims stray from them.
    let ring = |size: f64, z: f64| -> Vec<DVec3> {
        let turns = (0..72).map(|k| DVec2::from_angle(TAU * f64::from(k) / 72.0));
        turns
            .map(|turn| (DVec2::from_angle(2.65 * turn.x) * (size - 0.05 * turn.y)).extend(z))
            .collect()
    };
    let rings = [(1.0, 0.0), (0.97, 0.1), (0.9, 0.2), (0.8, 0.3)].map(|(size, z)| ring(size, z));
    let tubes = loft(&rings).unwrap();
    let scene = scene(tubes.into_iter().map(Patch::from).collect());
    let accelerator = Accelerator::build(&scene, &METHODS[0]).sealed(None);
    assert_eq!(accelerator.strip_count(), 0);
}
