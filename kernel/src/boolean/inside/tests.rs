use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::Range;

use super::*;
use crate::modelling::{self, Frame};
use crate::{Curve, KnotVector, TrimLoop};

/// Points all over a box.
fn points(min: DVec3, max: DVec3, count: u32) -> impl Iterator<Item = DVec3> {
    // The generalised golden ratio in three dimensions.
    let steps = DVec3::new(
        0.819_172_513_396_164_4,
        0.671_043_606_703_789_3,
        0.549_700_477_901_970_2,
    );
    let share = move |k: u32| (steps * f64::from(k) + 0.5).fract();
    (1..=count).map(move |k| min + (max - min) * share(k))
}

/// A body answers as a distance does that is negative inside; points next to the boundary are left away.
fn check(name: &str, faces: &[Patch], reach: f64, distance: impl Fn(DVec3) -> f64) {
    let body = Body::new(faces);
    let all = points(DVec3::splat(-reach), DVec3::splat(reach), 10_000);
    let mut inside = 0;
    for point in all.filter(|p| distance(*p).abs() > 1e-6) {
        let expected = distance(point) < 0.0;
        inside += usize::from(expected);
        assert_eq!(body.contains(point), Some(expected), "{name}: {point}");
    }
    assert!(inside > 100, "{name}: {inside}");
}

/// Points on a surface are on the boundary, and those beside it are not.
fn check_beside(name: &str, body: &Body, on: DVec3, outwards: DVec3) {
    for share in [-0.5, 0.0, 0.5] {
        let near = on + outwards * (share * body.near);
        assert_eq!(body.contains(near), None, "{name}: {on} {share}");
    }
    for share in [-2.0, 2.0] {
        let near = on + outwards * (share * body.near);
        assert_eq!(
            body.contains(near),
            Some(share < 0.0),
            "{name}: {on} {share}"
        );
    }
    for (step, expected) in [(1e-7, false), (-1e-7, true), (1e-3, false), (-1e-3, true)] {
        let beside = on + outwards * step;
        assert_eq!(body.contains(beside), Some(expected), "{name}: {on} {step}");
    }
}

fn plane(origin: DVec3, u: DVec3, v: DVec3) -> Patch {
    modelling::plane(origin, u, v, 0.0..1.0, 0.0..1.0)
        .unwrap()
        .into()
}

/// The six faces of a box.
fn block(min: DVec3, max: DVec3) -> Vec<Patch> {
    let size = max - min;
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * size);
    let pairs = (0..3).map(|k| [axes[(k + 1) % 3], axes[(k + 2) % 3]]);
    pairs
        .flat_map(|[u, v]| [plane(min, u, v), plane(max, -u, -v)])
        .collect()
}

fn block_distance(p: DVec3, min: DVec3, max: DVec3) -> f64 {
    (min - p).max(p - max).max_element()
}

fn sphere(radius: f64) -> Surface {
    modelling::sphere(&Frame::WORLD, radius, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2).unwrap()
}

fn torus() -> Surface {
    modelling::torus(&Frame::WORLD, 2.0, 0.7, 0.0..TAU, 0.0..TAU).unwrap()
}

fn tube(radius: f64, angles: Range<f64>, heights: Range<f64>) -> Patch {
    modelling::cylinder(&Frame::WORLD, radius, angles, heights)
        .unwrap()
        .into()
}

/// A loop around the middle of a plane on which parameters are coordinates.
fn ring(radius: f64) -> TrimLoop {
    let circle = modelling::circle(&Frame::WORLD, radius).unwrap();
    TrimLoop::new(vec![circle.flattened()], 1e-9).unwrap()
}

/// A square around the z axis at a height, with loops.
fn square(height: f64, half: f64, loops: Vec<TrimLoop>) -> Patch {
    let (size, range) = (2.0 * half, -half..half);
    let corner = DVec3::new(-half, -half, height);
    let plane = modelling::plane(
        corner,
        DVec3::X * size,
        DVec3::Y * size,
        range.clone(),
        range,
    );
    Patch {
        loops,
        ..Patch::from(plane.unwrap())
    }
}

/// A cylinder with caps that are trimmed squares.
fn can() -> Vec<Patch> {
    vec![
        tube(1.0, 0.0..TAU, -1.0..1.5),
        square(-1.0, 5.0, vec![ring(1.0)]),
        square(1.5, 5.0, vec![ring(1.0).reversed()]),
    ]
}

fn can_distance(p: DVec3) -> f64 {
    let around = p.truncate().length() - 1.0;
    around.max(-1.0 - p.z).max(p.z - 1.5)
}

/// A box with a hole through it.
fn drilled() -> Vec<Patch> {
    let mut faces = block(DVec3::splat(-1.0), DVec3::splat(1.0));
    faces.truncate(4);
    let border = || TrimLoop::border(&(-1.0..1.0), &(-1.0..1.0)).unwrap();
    faces.push(square(-1.0, 1.0, vec![border(), ring(0.5)]));
    faces.push(square(1.0, 1.0, vec![ring(0.5), border()]));
    faces.push(tube(0.5, 0.0..TAU, -1.0..1.0));
    faces
}

fn drilled_distance(p: DVec3) -> f64 {
    let block = block_distance(p, DVec3::splat(-1.0), DVec3::splat(1.0));
    block.max(0.5 - p.truncate().length())
}

#[test]
fn points_are_inside_as_formulas_say() {
    let (min, max) = (DVec3::new(-1.0, -0.5, -0.2), DVec3::new(0.7, 0.9, 1.0));
    check("box", &block(min, max), 1.3, |p| {
        block_distance(p, min, max)
    });
    check("sphere", &[sphere(1.2).into()], 1.3, |p| p.length() - 1.2);
    check("torus", &[torus().into()], 2.8, |p| {
        (p.truncate().length() - 2.0).hypot(p.z) - 0.7
    });
    check("can", &can(), 1.7, can_distance);
    check("drilled", &drilled(), 1.2, drilled_distance);
}

#[test]
fn parts_of_a_turn_are_one_cylinder() {
    let mut faces = can();
    faces.remove(0);
    faces.push(tube(1.0, 0.0..PI, -1.0..1.5));
    faces.push(tube(1.0, PI..TAU, -1.0..1.5));
    check("halves", &faces, 1.7, can_distance);
    // Loops that cross the seam, and one of both turns.
    faces.truncate(2);
    for angles in [2.0..5.0, 5.0..2.0 + TAU] {
        let mut part = tube(1.0, 0.0..TAU, -2.0..2.0);
        let border = TrimLoop::border(&angles, &(-1.0..1.5)).unwrap();
        part.loops = vec![border];
        faces.push(part);
    }
    check("crossing the seam", &faces, 1.7, can_distance);
    faces.truncate(2);
    let mut turn = tube(1.0, 0.0..TAU, -2.0..2.0);
    turn.loops = vec![TrimLoop::border(&(1.0..1.0 + TAU), &(-1.0..1.5)).unwrap()];
    faces.push(turn);
    check("a turn from elsewhere", &faces, 1.7, can_distance);
}

#[test]
fn a_cone_has_a_tip() {
    let cone = modelling::cone(&Frame::WORLD, 0.0, PI / 6.0, 0.0..TAU, 0.0..1.0).unwrap();
    let radius = (PI / 6.0).tan();
    let faces = [cone.into(), square(1.0, 1.0, vec![ring(radius)])];
    let distance = |p: DVec3| (p.truncate().length() - p.z * radius).max(p.z - 1.0);
    check("cone", &faces, 1.1, distance);
    let body = Body::new(&faces);
    for step in [1e-2, 1e-4] {
        assert_eq!(body.contains(DVec3::Z * step), Some(true), "{step}");
        assert_eq!(body.contains(DVec3::Z * -step), Some(false), "{step}");
        assert_eq!(body.contains(DVec3::X * step), Some(false), "{step}");
    }
    assert_eq!(body.contains(DVec3::ZERO), None);
}

/// Bernstein polynomials times given heights.
fn height(heights: &[f64], degree: usize, x: f64, y: f64) -> f64 {
    let mut all = heights.to_vec();
    let row = degree + 1;
    for level in 1..=degree {
        for i in 0..=degree {
            for j in 0..=degree - level {
                all[i * row + j] += (all[i * row + j + 1] - all[i * row + j]) * y;
            }
        }
    }
    for level in 1..=degree {
        for i in 0..=degree - level {
            all[i * row] += (all[(i + 1) * row] - all[i * row]) * x;
        }
    }
    all[0]
}

#[test]
fn what_is_below_a_wavy_face_is_inside() {
    for degree in [3_usize, 6] {
        let count = (degree + 1) * (degree + 1);
        let heights: Vec<f64> = (0..count).map(|k| (k as f64 * 2.3).sin()).collect();
        let share = |k: usize| k as f64 / degree as f64;
        let net: Vec<DVec3> = (0..count)
            .map(|k| DVec3::new(share(k / (degree + 1)), share(k % (degree + 1)), heights[k]))
            .collect();
        let knots = || KnotVector::bezier(degree, 0.0..1.0).unwrap();
        let top = Surface::new(knots(), knots(), &net, None).unwrap();
        let borders = [
            top.iso_curve_u(0.0),
            top.iso_curve_u(1.0),
            top.iso_curve_v(0.0),
            top.iso_curve_v(1.0),
        ];
        let down = |p: DVec3| DVec3::new(p.x, p.y, -2.0);
        let mut faces: Vec<Patch> = borders
            .iter()
            .map(|border| {
                let line = Curve::line(down(border.start()), down(border.end()), 0.0..1.0);
                modelling::ruled(border, &line.unwrap()).unwrap().into()
            })
            .collect();
        faces.push(top.into());
        faces.push(plane(DVec3::Z * -2.0, DVec3::X, DVec3::Y));
        check("waves", &faces, 1.0, |p| {
            let walls = (-p.x).max(p.x - 1.0).max((-p.y).max(p.y - 1.0));
            walls.max(p.z - height(&heights, degree, p.x, p.y))
        });
    }
}

#[test]
fn gaps_between_faces_do_not_leak() {
    let (min, max) = (DVec3::splat(-1.0), DVec3::splat(1.0));
    let mut faces = block(min, max);
    for (k, face) in (0..).zip(&mut faces) {
        let move_by = DVec3::new(1.0, f64::from(k % 3) - 1.0, f64::from(k % 2)) * 1.5e-7;
        face.surface = face
            .surface
            .transformed(&glam::DAffine3::from_translation(move_by));
    }
    check("gaps", &faces, 1.2, |p| block_distance(p, min, max));
    let body = Body::new(&faces);
    // Rays that pass through the gaps, or nearly so, tell nothing.
    let mut unclear = 0;
    for way in &body.ways {
        for edge in [DVec3::new(1.0, 1.0, 0.3), DVec3::new(-1.0, 0.2, 1.0)] {
            let aside = way.direction.any_orthonormal_vector();
            for k in -100..=100 {
                let point = edge - way.direction * 0.9 + aside * (1e-8 * f64::from(k));
                let expected = block_distance(point, min, max) < 0.0;
                let counted = body.counted(point, way);
                assert!(counted.is_none_or(|odd| odd == expected), "{k}: {edge}");
                unclear += u32::from(counted.is_none());
            }
        }
    }
    assert!(unclear > 1000, "{unclear}");
}

#[test]
fn rays_through_edges_and_vertices_are_not_believed() {
    let (min, max) = (DVec3::splat(-1.0), DVec3::splat(1.0));
    let body = Body::new(&block(min, max));
    let edges = [0.0, 0.25, 0.7].map(|x| DVec3::new(x, 1.0, -1.0));
    let corners = Aabb { min, max }.corners();
    for through in edges.into_iter().chain(corners) {
        for way in &body.ways {
            for step in [1e-4, 0.3, 1.1, 2.5] {
                let point = through - way.direction * step;
                let distance = block_distance(point, min, max);
                let expected = Some(distance < 0.0);
                assert_eq!(body.contains(point), expected, "{through} {step}");
            }
        }
        assert_eq!(body.contains(through), None, "{through}");
        for step in [1e-7, 1e-6, 1e-4] {
            let (near, far) = (through * (1.0 - step), through * (1.0 + step));
            assert_eq!(body.contains(near), Some(true), "{through} {step}");
            assert_eq!(body.contains(far), Some(false), "{through} {step}");
        }
    }
    // In line with edges and in the plane of faces, but outside.
    for point in [DVec3::new(1.0, 1.0, 2.0), DVec3::new(1.0, 0.2, 1.000_01)] {
        assert_eq!(body.contains(point), Some(false), "{point}");
    }
}

#[test]
fn seams_and_poles_are_passed() {
    let ball = Body::new(&[sphere(1.0).into()]);
    let through = [
        DVec3::X,
        DVec3::Y,
        DVec3::Z,
        -DVec3::Z,
        DVec3::new(0.6, 0.0, 0.8),
        DVec3::new(0.5_f64.sqrt(), 0.0, 0.5_f64.sqrt()),
    ];
    for point in through {
        for way in &ball.ways {
            for step in [1e-3, 0.3, 2.3] {
                let from = point - way.direction * step;
                let expected = from.length() < 1.0;
                assert_eq!(ball.contains(from), Some(expected), "{point} {step}");
                for k in -30..=30 {
                    let aside = way.direction.any_orthonormal_vector() * (1e-17 * 2_f64.powi(k));
                    let counted = ball.counted(from + aside, way);
                    assert!(counted.is_none_or(|odd| odd == expected), "{point} {step}");
                }
            }
        }
        check_beside("ball", &ball, point, point);
    }
}

#[test]
fn points_on_faces_are_on_the_boundary() {
    let ball = Body::new(&[sphere(1.0).into()]);
    for p in points(DVec3::splat(-1.0), DVec3::splat(1.0), 500) {
        check_beside("ball", &ball, p.normalize(), p.normalize());
    }
    let ring = Body::new(&[torus().into()]);
    for p in points(DVec3::ZERO, DVec3::splat(TAU), 500) {
        let around = DVec2::from_angle(p.x);
        let tube = DVec2::from_angle(p.y);
        let outwards = (around * tube.x).extend(tube.y);
        let on = (around * 2.0).extend(0.0) + outwards * 0.7;
        check_beside("torus", &ring, on, outwards);
    }
    let hole = Body::new(&drilled());
    for p in points(DVec3::ZERO, DVec3::splat(1.0), 300) {
        let around = DVec2::from_angle(TAU * p.x);
        let on = (around * 0.5).extend(p.z * 1.99 - 0.995);
        check_beside("hole", &hole, on, -around.extend(0.0));
        let top = (around * (0.51 + 0.48 * p.y)).extend(1.0);
        check_beside("top", &hole, top, DVec3::Z);
        let missing = (around * (0.49 * p.y)).extend(1.0);
        assert_eq!(hole.contains(missing), Some(false), "{missing}");
        let edge = (around * 0.5).extend(1.0);
        assert_eq!(hole.contains(edge), None, "{edge}");
    }
}

#[test]
fn a_knife_is_told_from_what_is_beside_its_edge() {
    // No ray from there is clear: all leave next to the edge.
    let (length, slope) = (1.0, 0.02);
    let line = |x: f64, z: f64| {
        let ends = [-1.0, 1.0].map(|y| DVec3::new(x, y, z));
        Curve::line(ends[0], ends[1], 0.0..1.0).unwrap()
    };
    let (edge, upper) = (line(0.0, 0.0), line(length, slope));
    let lower = line(length, -slope);
    let mut faces: Vec<Patch> = [(&edge, &upper), (&edge, &lower), (&upper, &lower)]
        .map(|(a, b)| modelling::ruled(a, b).unwrap().into())
        .into();
    for y in [-1.0, 1.0] {
        let corners = [(0.0, 0.0), (length, slope), (length, -slope), (0.0, 0.0)];
        let corners = corners.map(|(x, z)| DVec2::new(x, z));
        let loops = vec![TrimLoop::new(vec![Curve::polyline(&corners).unwrap()], 0.0).unwrap()];
        let origin = DVec3::new(-1e6, y, -1e6);
        let surface =
            modelling::plane(origin, DVec3::X * 2e6, DVec3::Z * 2e6, -1e6..1e6, -1e6..1e6);
        let surface = surface.unwrap();
        faces.push(Patch {
            loops,
            ..Patch::from(surface)
        });
    }
    let distance = |p: DVec3| {
        let sides = (p.z.abs() - slope * p.x).max(p.x - length);
        sides.max(p.y.abs() - 1.0)
    };
    let body = Body::new(&faces);
    for p in points(DVec3::new(0.0, -0.99, -1.0), DVec3::ONE, 3000) {
        for size in [1.0, 1e-2, 1e-4, 1e-5, 1e-6] {
            let at = DVec3::new(p.x * size, p.y, p.z * size * slope * 2.0);
            if distance(at).abs() > 4e-9 {
                let expected = Some(distance(at) < 0.0);
                assert_eq!(body.contains(at), expected, "{at}");
            }
        }
    }
    // In the planes of faces, but beside these.
    for at in [DVec3::new(-1e-6, 0.0, 0.0), DVec3::new(0.5, 1.0, 0.0101)] {
        assert_eq!(body.contains(at), Some(false), "{at}");
    }
}

#[test]
fn sizes_and_places_do_not_matter() {
    for (scale, place) in [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e3), (1e-3, 1e3)] {
        let place = DVec3::new(place, -place, 0.3 * place);
        let map = glam::DAffine3::from_scale_rotation_translation(
            DVec3::splat(scale),
            glam::DQuat::IDENTITY,
            place,
        );
        let moved = |patch: &Patch| patch.transformed(&map);
        let faces: Vec<Patch> = drilled().iter().map(moved).collect();
        let body = Body::new(&faces);
        for p in points(DVec3::splat(-1.2), DVec3::splat(1.2), 2000) {
            let expected = Some(drilled_distance(p) < 0.0);
            assert_eq!(body.contains(place + p * scale), expected, "{scale}: {p}");
        }
    }
}

#[test]
#[ignore = "prints times"]
fn times() {
    let (min, max) = (DVec3::splat(-1.0), DVec3::splat(1.0));
    let places = || points(DVec3::splat(-3.0), DVec3::splat(3.0), 33);
    let many = places().flat_map(|p| block(p, p + 0.4)).collect();
    let bodies = [
        ("box", block(min, max)),
        ("ball", vec![sphere(1.0).into()]),
        ("torus", vec![torus().into()]),
        ("can", can()),
        ("drilled", drilled()),
        ("many", many),
    ];
    for (name, faces) in bodies {
        let start = std::time::Instant::now();
        let body = Body::new(&faces);
        let made = start.elapsed();
        let Aabb { min, max } = body.bounds;
        let count = 50_000;
        let start = std::time::Instant::now();
        let inside = points(min, max, count).filter(|p| body.contains(*p) == Some(true));
        let inside = inside.count();
        let each = start.elapsed() / count;
        let cells = body.cells.len();
        println!("{name}: {cells} cells in {made:?}, {each:?} each, {inside} of {count} inside");
        let mut retried = 0;
        for p in points(min, max, count).filter(|p| !body.is_boundary(*p)) {
            retried += u32::from(body.counted(p, &body.ways[body.first(p)]).is_none());
        }
        println!("  {retried} asked again");
    }
}
