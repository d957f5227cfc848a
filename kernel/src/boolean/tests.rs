//! Solids against formulas for their volumes.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DAffine3, DQuat, DVec2, DVec3};

use super::Operation;
use crate::modelling::{Frame, circle, cone, cylinder, plane, revolve, sphere, torus};
use crate::{Error, Integrals, Patch, TrimLoop};

const OPERATIONS: [Operation; 3] = [
    Operation::Union,
    Operation::Intersection,
    Operation::Difference,
];

fn combine(first: &[Patch], second: &[Patch], operation: Operation) -> Result<Vec<Patch>, Error> {
    super::combine(first, second, operation, &mut 1_000_000)
}

fn block(min: DVec3, max: DVec3) -> Vec<Patch> {
    let size = max - min;
    let [x, y, z] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    let side = |origin, u, v| Patch::from(plane(origin, u, v, 0.0..1.0, 0.0..2.0).unwrap());
    vec![
        side(min, y, x),
        side(min, z, y),
        side(min, x, z),
        side(min + z, x, y),
        side(min + x, y, z),
        side(min + y, z, x),
    ]
}

/// A disc around the origin of a frame: a square with a loop.
fn disc(frame: &Frame, radius: f64) -> Patch {
    let corner = frame.origin() - (frame.x() + frame.y()) * 2.0 * radius;
    let domain = -2.0 * radius..2.0 * radius;
    let edges = [frame.x(), frame.y()].map(|edge| edge * 4.0 * radius);
    let surface = plane(corner, edges[0], edges[1], domain.clone(), domain).unwrap();
    let flat = circle(&Frame::about(DVec3::ZERO, DVec3::Z).unwrap(), radius).unwrap();
    let flat = flat.flattened();
    let mut patch = Patch::from(surface);
    patch.loops = vec![TrimLoop::new(vec![flat], 0.0).unwrap()];
    patch
}

/// A solid cylinder from a point along an axis.
fn rod(start: DVec3, axis: DVec3, radius: f64) -> Vec<Patch> {
    let frame = Frame::about(start, axis).unwrap();
    let top = Frame::new(start + axis, axis, frame.x()).unwrap();
    let side = cylinder(&frame, radius, 0.0..TAU, 0.0..axis.length()).unwrap();
    vec![Patch::from(side), disc(&frame, radius), disc(&top, radius)]
}

fn ball(center: DVec3, radius: f64) -> Vec<Patch> {
    let frame = Frame::about(center, DVec3::Z).unwrap();
    vec![Patch::from(
        sphere(&frame, radius, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2).unwrap(),
    )]
}

fn moved(solid: &[Patch], by: &DAffine3) -> Vec<Patch> {
    solid.iter().map(|patch| patch.transformed(by)).collect()
}

/// The volume of a solid whose normals look outwards.
fn volume(solid: &[Patch]) -> f64 {
    let origin = solid
        .first()
        .map_or(DVec3::ZERO, |patch| patch.hull_bounds().center());
    solid
        .iter()
        .map(|patch| Integrals::of(patch, origin).volume())
        .sum()
}

#[track_caller]
fn assert_near(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= 1e-7 * expected.abs().max(1.0),
        "{found} for {expected}"
    );
}

/// The volumes of the union, the intersection and the difference of solids that have volumes.
#[track_caller]
fn assert_volumes(first: &[Patch], second: &[Patch], volumes: [f64; 2], both: f64) {
    let expected = [volumes[0] + volumes[1] - both, both, volumes[0] - both];
    for (operation, expected) in OPERATIONS.into_iter().zip(expected) {
        let found = combine(first, second, operation);
        let found = found.unwrap_or_else(|error| panic!("{operation:?}: {error}"));
        let volume = volume(&found);
        let is_near = (volume - expected).abs() <= 1e-7 * expected.abs().max(1.0);
        assert!(is_near, "{operation:?}: {volume} for {expected}");
    }
}

const UNIT: [DVec3; 2] = [DVec3::ZERO, DVec3::ONE];

fn cube() -> Vec<Patch> {
    block(UNIT[0], UNIT[1])
}

#[test]
fn blocks_that_overlap() {
    let other = block(DVec3::new(0.5, 0.25, 0.75), DVec3::new(1.5, 2.0, 1.25));
    assert_volumes(&cube(), &other, [1.0, 0.875], 0.5 * 0.75 * 0.25);
}

#[test]
fn blocks_that_do_not_meet_and_one_in_the_other() {
    let far = block(DVec3::splat(2.0), DVec3::splat(3.0));
    assert_volumes(&cube(), &far, [1.0, 1.0], 0.0);
    let within = block(DVec3::splat(0.25), DVec3::splat(0.5));
    assert_volumes(&cube(), &within, [1.0, 1.0 / 64.0], 1.0 / 64.0);
    assert_volumes(&within, &cube(), [1.0 / 64.0, 1.0], 1.0 / 64.0);
}

#[test]
fn blocks_with_sides_in_one_plane() {
    let beside = block(DVec3::X, DVec3::new(2.0, 1.0, 1.0));
    assert_volumes(&cube(), &beside, [1.0, 1.0], 0.0);
    let shifted = block(DVec3::new(1.0, 0.5, 0.25), DVec3::new(2.0, 1.5, 0.75));
    assert_volumes(&cube(), &shifted, [1.0, 0.5], 0.0);
    let pocket = block(DVec3::new(0.25, 0.25, 0.5), DVec3::new(0.75, 0.5, 1.0));
    assert_volumes(&cube(), &pocket, [1.0, 0.0625], 0.0625);
    assert_volumes(&cube(), &cube(), [1.0, 1.0], 1.0);
    let slab = block(DVec3::new(0.25, 0.0, 0.0), DVec3::new(0.5, 1.0, 1.0));
    assert_volumes(&cube(), &slab, [1.0, 0.25], 0.25);
}

#[test]
fn what_is_united_has_no_faces_inside() {
    let beside = block(DVec3::X, DVec3::new(2.0, 1.0, 1.0));
    let bar = combine(&cube(), &beside, Operation::Union).unwrap();
    assert_eq!(bar.len(), 10);
    assert_eq!(
        combine(&cube(), &cube(), Operation::Union).unwrap().len(),
        6
    );
    assert_eq!(
        combine(&cube(), &cube(), Operation::Difference)
            .unwrap()
            .len(),
        0
    );
}

#[test]
fn a_block_turned_any_way() {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, 1.1);
    let by = DAffine3::from_rotation_translation(turn, DVec3::new(0.4, 0.1, -0.2));
    let other = moved(&cube(), &by);
    let both = volume(&combine(&cube(), &other, Operation::Intersection).unwrap());
    assert!(both > 0.1 && both < 0.9, "{both}");
    assert_volumes(&cube(), &other, [1.0, 1.0], both);
}

#[test]
fn a_hole_is_drilled() {
    let drill = rod(DVec3::new(0.5, 0.5, -1.0), DVec3::Z * 3.0, 0.25);
    let hole = PI / 16.0;
    assert_volumes(&cube(), &drill, [1.0, 3.0 * hole], hole);
    // To half the depth, and with both ends in the sides.
    let blind = rod(DVec3::new(0.5, 0.5, 0.5), DVec3::Z, 0.25);
    assert_volumes(&cube(), &blind, [1.0, hole], 0.5 * hole);
    let flush = rod(DVec3::new(0.5, 0.5, 0.0), DVec3::Z, 0.25);
    assert_volumes(&cube(), &flush, [1.0, hole], hole);
}

#[test]
fn a_ball_at_a_corner_of_a_block() {
    let ball_volume = 4.0 / 3.0 * PI / 8.0;
    assert_volumes(
        &cube(),
        &ball(DVec3::ZERO, 0.5),
        [1.0, ball_volume],
        ball_volume / 8.0,
    );
    assert_volumes(
        &cube(),
        &ball(DVec3::new(0.0, 0.5, 0.5), 0.5),
        [1.0, ball_volume],
        ball_volume / 2.0,
    );
    let small = 4.0 / 3.0 * PI / 64.0;
    assert_volumes(&cube(), &ball(DVec3::splat(0.5), 0.25), [1.0, small], small);
    // The part of a ball above a plane.
    let cap = PI * 0.04 * (3.0 * 0.5 - 0.2) / 3.0;
    let low = ball(DVec3::new(0.5, 0.5, -0.3), 0.5);
    assert_volumes(&cube(), &low, [1.0, ball_volume], cap);
}

#[test]
fn cylinders_as_wide_as_each_other_cross() {
    let first = rod(DVec3::new(0.0, 0.0, -2.0), DVec3::Z * 4.0, 1.0);
    let second = rod(DVec3::new(-2.0, 0.0, 0.0), DVec3::X * 4.0, 1.0);
    assert_volumes(&first, &second, [4.0 * PI, 4.0 * PI], 16.0 / 3.0);
    // Turned about its axis: where they touch is inside the pieces.
    let turn = DAffine3::from_rotation_z(0.3);
    assert_volumes(
        &moved(&first, &turn),
        &second,
        [4.0 * PI, 4.0 * PI],
        16.0 / 3.0,
    );
}

#[test]
fn a_block_and_cylinders_that_touch_its_sides() {
    let bar = block(DVec3::new(-2.0, -1.0, 0.0), DVec3::new(2.0, 1.0, 1.0));
    let ends = [-2.0, 2.0].map(|x| rod(DVec3::new(x, 0.0, 0.0), DVec3::Z, 1.0));
    assert_volumes(&bar, &ends[0], [8.0, PI], PI / 2.0);
    let one = combine(&bar, &ends[0], Operation::Union).unwrap();
    assert_volumes(&one, &ends[1], [8.0 + PI / 2.0, PI], PI / 2.0);
    // Within it, from one side to the other.
    let wide = rod(DVec3::new(0.0, 0.0, -1.0), DVec3::Z * 3.0, 1.0);
    assert_volumes(&bar, &wide, [8.0, 3.0 * PI], PI);
}

#[test]
fn cylinders_on_the_same_axis() {
    let first = rod(DVec3::ZERO, DVec3::Z * 2.0, 1.0);
    let higher = rod(DVec3::Z, DVec3::Z * 2.0, 1.0);
    assert_volumes(&first, &higher, [2.0 * PI, 2.0 * PI], PI);
    let thin = rod(DVec3::Z, DVec3::Z * 2.0, 0.5);
    assert_volumes(&first, &thin, [2.0 * PI, 0.5 * PI], 0.25 * PI);
    let on_top = rod(DVec3::Z * 2.0, DVec3::Z, 0.5);
    assert_volumes(&first, &on_top, [2.0 * PI, 0.25 * PI], 0.0);
    let turned = moved(&higher, &DAffine3::from_rotation_z(0.4));
    assert_volumes(&first, &turned, [2.0 * PI, 2.0 * PI], PI);
}

#[test]
fn half_of_a_ring() {
    let frame = Frame::about(DVec3::ZERO, DVec3::Z).unwrap();
    let ring = vec![Patch::from(
        torus(&frame, 2.0, 0.5, 0.0..TAU, 0.0..TAU).unwrap(),
    )];
    let volume = 2.0 * PI * PI * 2.0 * 0.25;
    let half = block(DVec3::new(-3.0, 0.0, -1.0), DVec3::new(3.0, 3.0, 1.0));
    assert_volumes(&ring, &half, [volume, 36.0], volume / 2.0);
    let low = block(DVec3::new(-3.0, -3.0, -1.0), DVec3::new(3.0, 3.0, 0.0));
    assert_volumes(&ring, &low, [volume, 36.0], volume / 2.0);
}

#[test]
fn a_cone_and_its_tip() {
    let frame = Frame::about(DVec3::ZERO, DVec3::Z).unwrap();
    let side = cone(&frame, 1.0, -(PI / 4.0), 0.0..TAU, 0.0..1.0).unwrap();
    let solid = vec![Patch::from(side), disc(&frame, 1.0)];
    let volume = PI / 3.0;
    let top = block(DVec3::new(-2.0, -2.0, 0.5), DVec3::new(2.0, 2.0, 2.0));
    assert_volumes(&solid, &top, [volume, 24.0], volume / 8.0);
    let half = block(DVec3::new(0.0, -2.0, -1.0), DVec3::new(2.0, 2.0, 2.0));
    assert_volumes(&solid, &half, [volume, 24.0], volume / 2.0);
}

#[test]
fn balls_that_overlap() {
    // The lens of two balls of one radius at a distance of one.
    let lens = PI * 2.5 / 6.0;
    let first = ball(DVec3::ZERO, 1.0);
    let expected = PI / 12.0 * (4.0 + 1.0) * (2.0 - 1.0_f64).powi(2);
    assert_near(lens, expected);
    for way in [DVec3::X, DVec3::Z, DVec3::new(0.6, 0.0, 0.8)] {
        let second = ball(way, 1.0);
        assert_volumes(&first, &second, [4.0 / 3.0 * PI; 2], expected);
    }
}

#[test]
fn operations_follow_each_other() {
    let mut plate = block(DVec3::ZERO, DVec3::new(8.0, 2.0, 1.0));
    let mut expected = 16.0;
    for x in [1.0, 3.0, 5.0, 7.0] {
        let drill = rod(DVec3::new(x, 1.0, -1.0), DVec3::Z * 3.0, 0.5);
        plate = combine(&plate, &drill, Operation::Difference).unwrap();
        expected -= PI / 4.0;
    }
    assert_near(volume(&plate), expected);
    assert_eq!(plate.len(), 10);
    // Through the middle of all holes.
    let half = block(DVec3::new(-1.0, 1.0, -1.0), DVec3::new(9.0, 3.0, 2.0));
    let cut = combine(&plate, &half, Operation::Difference).unwrap();
    assert_near(volume(&cut), expected / 2.0);
}

#[test]
fn a_face_keeps_its_name_material_and_parameters() {
    let mut solid = cube();
    for (index, face) in solid.iter_mut().enumerate() {
        face.name = format!("side {index}");
    }
    let drill = rod(DVec3::new(0.5, 0.5, -1.0), DVec3::Z * 3.0, 0.25);
    let found = combine(&solid, &drill, Operation::Difference).unwrap();
    let names: Vec<_> = found.iter().map(|face| face.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "side 0", "side 1", "side 2", "side 3", "side 4", "side 5", ""
        ]
    );
    assert_eq!(found[0].surface, solid[0].surface);
    assert_eq!(found[0].loops.len(), 2);
    let middle = found[3].surface.evaluate(DVec2::new(0.5, 1.0));
    assert!(middle.distance(DVec3::new(0.5, 0.5, 1.0)) < 1e-15);
    assert!(!found[3].region().unwrap().contains(DVec2::new(0.5, 1.0)));
}

#[test]
fn what_is_not_closed_is_told() {
    let open = &cube()[..5];
    let other = block(DVec3::splat(0.5), DVec3::splat(1.5));
    assert!(combine(open, &other, Operation::Difference).is_err());
}

#[test]
fn work_is_counted_and_bounded() {
    let other = block(DVec3::splat(0.5), DVec3::splat(1.5));
    let mut work = 10_000;
    super::combine(&cube(), &other, Operation::Union, &mut work).unwrap();
    assert!((1..10_000).contains(&work), "{work}");
    let taken = 10_000 - work;
    let short = super::combine(&cube(), &other, Operation::Union, &mut (taken - 1));
    assert!(matches!(short, Err(Error::Boolean(_))), "{short:?}");
}

#[test]
fn a_cylinder_around_an_edge_of_a_face_that_goes_on() {
    // Its axis is in a side of the block, its foot in the plane of another.
    let bar = block(DVec3::new(0.0, -1.75, -1.75), DVec3::new(5.5, -1.125, 1.75));
    let short = block(
        DVec3::new(4.875, -3.5, -1.75),
        DVec3::new(5.5, -1.125, 1.75),
    );
    let angle = combine(&bar, &short, Operation::Union).unwrap();
    let expected = 5.5 * 0.625 * 3.5 + 0.625 * 1.75 * 3.5;
    assert_near(volume(&angle), expected);
    let pin = rod(DVec3::new(0.0, -1.75, 0.0), DVec3::Y * 1.75, 0.625);
    let disc = PI * 0.625 * 0.625;
    assert_volumes(&bar, &pin, [5.5 * 0.625 * 3.5, disc * 1.75], disc * 0.3125);
    assert_volumes(&angle, &pin, [expected, disc * 1.75], disc * 0.3125);
}

#[test]
fn an_edge_through_the_pole_of_a_flat_face() {
    // The foot of the pin is a disc that is turned about its middle, which is on an edge of the block.
    let turned = |height: f64| {
        let rays = [DVec3::ZERO, DVec3::X * 0.5].map(|p| p + DVec3::Z * height);
        let line = crate::Curve::polyline(&rays).unwrap();
        Patch::from(revolve(&line, DVec3::ZERO, DVec3::Z, 0.0..TAU).unwrap())
    };
    let mut pin = rod(DVec3::ZERO, DVec3::Z * 2.0, 0.5);
    pin.truncate(1);
    pin.extend([turned(0.0), turned(2.0)]);
    let block = block(DVec3::new(0.0, -1.0, 0.0), DVec3::new(3.0, 1.0, 1.0));
    assert_volumes(&block, &pin, [6.0, PI / 2.0], PI / 8.0);
}

#[test]
fn faces_a_hair_apart() {
    // Ends of one cylinder are next to those of the other, as numbers of single precision are.
    let first = rod(DVec3::ZERO, DVec3::Z * 2.0, 0.5);
    let gap = 2.4e-7;
    let second = rod(DVec3::Z * (2.0 - gap), DVec3::Z, 0.5);
    let disc = PI / 4.0;
    assert_volumes(&first, &second, [2.0 * disc, disc], gap * disc);
}
