//! Faces all around a sphere or torus, whose curves of space run along the seams both ways.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec2, DVec3};
use kernel::{Integrals, Patch};

use super::sphere_tests::{NORTH, SOUTH, X, arc, list, sphere};
use crate::iges::testing::{Made, made, part, read};

/// The only face of a file, whose surface comes last of some entities, within loops of curves, the
/// outer one first.
fn face(mut entities: Vec<Made>, loops: &[Vec<Made>]) -> Patch {
    let surface = 2 * entities.len() - 1;
    let mut bounds = String::new();
    for curves in loops {
        let first = 2 * entities.len() + 1;
        let pointers: String = (0..curves.len())
            .map(|k| format!(",{}", first + 2 * k))
            .collect();
        let count = curves.len();
        entities.extend(curves.iter().cloned());
        entities.push(part(102, 0, &format!("{count}{pointers}")));
        let space = 2 * entities.len() - 1;
        entities.push(part(142, 0, &format!("0,{surface},0,{space},2")));
        bounds += &format!(",{}", space + 2);
    }
    let holes = loops.len() - 1;
    entities.push(made(144, &format!("{surface},1,{holes}{bounds}")));
    let (scene, warnings) = read(&entities);
    assert_eq!(warnings, [""; 0]);
    let [patch] = scene.patches() else {
        panic!("{} patches", scene.patches().len())
    };
    patch.clone()
}

fn area(entities: Vec<Made>, loops: &[Vec<Made>]) -> f64 {
    Integrals::of(&face(entities, loops), DVec3::ZERO).area()
}

fn assert_area(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-5, "{found}, not {expected}");
}

/// The torus of radii 3 and 1 around z.
fn torus() -> Vec<Made> {
    vec![
        part(116, 0, "0.,0.,0.,0"),
        part(123, 0, "0.,0.,1."),
        part(123, 0, "1.,0.,0."),
        part(198, 1, "1,3,3.,1.,5"),
    ]
}

/// A quarter of a circle around a centre, from `a` beside it to `b`.
fn quarter(center: DVec3, a: DVec3, b: DVec3) -> Made {
    let points = [a, a + b, b].map(|p| center + p);
    let points = list(points.iter().flat_map(DVec3::to_array));
    let w = 0.5_f64.sqrt();
    let text = format!("2,2,0,0,0,0,0.,0.,0.,1.,1.,1.,1.,{w:?},1.,{points},0.,1.,0.,0.,1.");
    part(126, 0, &text)
}

/// Quarters of a circle in a plane, from the first one on.
fn quarters(center: DVec3, x: DVec3, y: DVec3, count: usize) -> Vec<Made> {
    let corners = [x, y, -x, -y, x];
    let pairs = corners.windows(2).take(count);
    pairs
        .map(|ends| quarter(center, ends[0], ends[1]))
        .collect()
}

/// All of the seam along the outer equator of the torus, and back.
fn equator() -> Vec<Made> {
    let (x, y) = (DVec3::X * 4.0, DVec3::Y * 4.0);
    let mut curves = quarters(DVec3::ZERO, x, y, 4);
    curves.extend(quarters(DVec3::ZERO, x, -y, 4));
    curves
}

/// All of the seam along its tube, and back.
fn tube() -> Vec<Made> {
    let mut curves = quarters(DVec3::X * 3.0, DVec3::X, DVec3::Z, 4);
    curves.extend(quarters(DVec3::X * 3.0, DVec3::X, -DVec3::Z, 4));
    curves
}

/// A quarter of the way around the torus from some direction on, and from the top of the tube to the
/// inner equator.
fn hole(x: DVec3, y: DVec3) -> Vec<Made> {
    vec![
        quarter(DVec3::Z, x * 3.0, y * 3.0),
        quarter(y * 3.0, DVec3::Z, -y),
        quarter(DVec3::ZERO, y * 2.0, x * 2.0),
        quarter(x * 3.0, -x, DVec3::Z),
    ]
}

/// Where meridians of the sphere pass the equator: its seam, and another one.
const WAYS: [DVec3; 2] = [X, DVec3::new(0.8, 0.6, 0.0)];

/// All of a meridian, and back.
fn slit(way: DVec3) -> Vec<Made> {
    [[SOUTH, way], [way, NORTH], [NORTH, way], [way, SOUTH]]
        .map(arc)
        .into()
}

const HOLE: f64 = FRAC_PI_2 * (3.0 * FRAC_PI_2 - 1.0);

#[test]
fn seams_that_are_run_along_both_ways_alone_bound_all() {
    let mut seams = equator();
    seams.extend(tube());
    assert_area(area(torus(), &[seams]), 12.0 * PI * PI);
    for way in WAYS {
        assert_area(area(vec![sphere()], &[slit(way)]), 16.0 * PI);
    }
}

#[test]
fn a_hole_beside_a_seam_that_is_run_along_both_ways_is_a_hole() {
    let [a, b, c] = [(-1.0, 1.0, 1.0), (-1.0, -1.0, 1.0), (-1.0, 0.0, -1.0)]
        .map(|p| DVec3::from(p).normalize());
    let cosines = 1.0 + a.dot(b) + b.dot(c) + c.dot(a);
    let triangle = 8.0 * (a.dot(b.cross(c)).abs() / cosines).atan();
    for hole in [[[a, b], [b, c], [c, a]], [[a, c], [c, b], [b, a]]] {
        let hole = || Vec::from(hole.map(arc));
        for way in WAYS {
            for loops in [[slit(way), hole()], [hole(), slit(way)]] {
                assert_area(area(vec![sphere()], &loops), 16.0 * PI - triangle);
            }
        }
    }
    let mut seams = equator();
    seams.extend(tube());
    let hole = hole(DVec3::NEG_X, DVec3::NEG_Y);
    assert_area(area(torus(), &[seams, hole]), 12.0 * PI * PI - HOLE);
}

#[test]
fn a_hole_between_seams_that_are_run_along_both_ways_is_a_hole() {
    let (x, y) = (DVec3::X, DVec3::Y);
    let hole = hole(x, y);
    // Three quarters of the tube, from the inner equator to the top and back.
    let up = quarters(x * 3.0, -x, -DVec3::Z, 3);
    let down = quarters(x * 3.0, DVec3::Z, x, 3);
    let mut curves = hole[..3].to_vec();
    curves.extend_from_slice(&up[..2]);
    curves.extend(equator());
    curves.push(up[2].clone());
    curves.extend(down);
    curves.push(hole[3].clone());
    let face = face(torus(), &[curves]);
    let area = Integrals::of(&face, DVec3::ZERO).area();
    assert_area(area, 12.0 * PI * PI - HOLE);
    // The border but for a quarter of a side, and three sides of the hole: none is run along twice.
    let [u, v] = [face.surface.knots_u(), face.surface.knots_v()].map(|k| k.domain());
    let size = DVec2::new(u.end - u.start, v.end - v.start);
    let sides = face.loops.iter().flat_map(|l| l.segments());
    let length = sides.map(|c| ((c.end() - c.start()) / size).length());
    assert_area(length.sum(), 4.5);
}
