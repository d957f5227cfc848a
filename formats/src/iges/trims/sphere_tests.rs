//! Faces of a sphere, of which curves of space alone do not tell which side is meant.

use std::f64::consts::PI;

use glam::DVec3;
use kernel::Integrals;

use crate::iges::testing::{Made, made, part, read};

pub(super) const X: DVec3 = DVec3::X;
const Y: DVec3 = DVec3::Y;
pub(super) const NORTH: DVec3 = DVec3::Z;
pub(super) const SOUTH: DVec3 = DVec3::NEG_Z;

/// The border of the domain without the octant between X, Y, and the north pole.
const FLAT: &str = "1,7,0.,0.,-1.,4.,-1.,4.,1.,1.,1.,1.,0.,0.,0.,0.,-1.";

/// The same in space: up the whole seam, and down half of it.
const WITHOUT_OCTANT: [[DVec3; 2]; 5] = [[SOUTH, X], [X, NORTH], [NORTH, Y], [Y, X], [X, SOUTH]];

pub(super) fn list(numbers: impl IntoIterator<Item = f64>) -> String {
    let numbers: Vec<_> = numbers.into_iter().map(|x| format!("{x:?}")).collect();
    numbers.join(",")
}

/// The sphere of radius 2: from X around by quarters in u, and up from the south pole in v.
pub(super) fn sphere() -> Made {
    let w = 0.5_f64.sqrt();
    let corner = [1.0, 1.0, 0.0, -1.0, -1.0, -1.0, 0.0, 1.0, 1.0];
    let circle: Vec<_> = (0..9).map(|k| (corner[k], corner[(k + 6) % 8])).collect();
    let half = [(0.0, -1.0), (1.0, -1.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    let weight = |k: usize| if k % 2 == 1 { w } else { 1.0 };
    let nodes = || (0..5).flat_map(|j| (0..9).map(move |i| (i, j)));
    let weights = list(nodes().map(|(i, j)| weight(i) * weight(j)));
    let points = list(nodes().flat_map(|(i, j)| {
        let ((x, y), (radius, z)) = (circle[i], half[j]);
        [2.0 * radius * x, 2.0 * radius * y, 2.0 * z]
    }));
    let knots = "0.,0.,0.,1.,1.,2.,2.,3.,3.,4.,4.,4.,-1.,-1.,-1.,0.,0.,1.,1.,1.";
    let text = format!("8,4,2,2,1,0,0,0,0,{knots},{weights},{points},0.,4.,-1.,1.");
    part(128, 0, &text)
}

/// A part of a great circle of that sphere, less than half.
pub(super) fn arc([from, to]: [DVec3; 2]) -> Made {
    // The middle control point is where the tangents meet.
    let cosine = from.dot(to);
    let points = [from, (from + to) / (1.0 + cosine), to].map(|p| p * 2.0);
    let points = list(points.iter().flat_map(DVec3::to_array));
    let w = ((1.0 + cosine) / 2.0).sqrt();
    let text = format!("2,2,0,0,0,0,0.,0.,0.,1.,1.,1.,1.,{w:?},1.,{points},0.,1.,0.,0.,1.");
    part(126, 0, &text)
}

/// The circle of latitude 30 degrees north, from where it meets the seam eastwards.
fn circle() -> Made {
    part(
        100,
        0,
        "1.,0.,0.,1.7320508075688772,0.,1.7320508075688772,0.",
    )
}

/// The part of the meridian of X from there to the north pole, or to the south pole.
fn meridian(pole: DVec3) -> Made {
    arc([DVec3::new(0.75_f64.sqrt(), 0.0, 0.5), pole])
}

/// The area of the face between curves, with a curve of the parameter domain if there is one, by what
/// the file prefers.
fn area(curves: Vec<Made>, flat: Option<&str>, preference: u8) -> f64 {
    let mut entities = vec![sphere()];
    let pointers: String = (0..curves.len())
        .map(|k| format!(",{}", 2 * k + 3))
        .collect();
    let count = curves.len();
    entities.extend(curves);
    entities.push(part(102, 0, &format!("{count}{pointers}")));
    let space = 2 * entities.len() - 1;
    let mut domain = 0;
    if let Some(flat) = flat {
        let mut flat = part(106, 11, flat);
        flat.status = "00010500";
        entities.push(flat);
        domain = space + 2;
    }
    entities.push(part(142, 0, &format!("0,1,{domain},{space},{preference}")));
    let bound = 2 * entities.len() - 1;
    entities.push(made(144, &format!("1,1,0,{bound}")));
    let (scene, warnings) = read(&entities);
    assert_eq!(warnings, [""; 0]);
    let [patch] = scene.patches() else {
        panic!("{} patches", scene.patches().len())
    };
    Integrals::of(patch, DVec3::ZERO).area()
}

/// Curves the other way round.
fn backwards(curves: &[[DVec3; 2]]) -> Vec<Made> {
    curves.iter().rev().map(|[a, b]| arc([*b, *a])).collect()
}

fn quarters(curves: &[[DVec3; 2]]) -> Vec<Made> {
    curves.iter().copied().map(arc).collect()
}

fn assert_area(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-5, "{found}, not {expected}");
}

#[test]
fn curves_of_the_domain_tell_the_side_whatever_the_file_prefers() {
    // Without the curves of the domain this would be the octant.
    let octant = [[NORTH, Y], [Y, X], [X, NORTH]];
    let around = "1,10,0.,0.,-1.,4.,-1.,4.,0.,4.,1.,1.,1.,1.,0.,0.,0.,0.,1.,0.,0.,0.,-1.";
    for (curves, flat) in [
        (&WITHOUT_OCTANT[..], FLAT),
        (&octant, FLAT),
        (&octant, around),
    ] {
        for preference in 0..4 {
            let found = area(quarters(curves), Some(flat), preference);
            assert_area(found, 14.0 * PI);
        }
    }
}

#[test]
fn curves_of_the_domain_that_run_elsewhere_do_not_count_where_those_of_space_are_preferred() {
    let octant = [[NORTH, Y], [Y, X], [X, NORTH]];
    // With an edge that strays by a hundredth of a quarter.
    let bent = FLAT
        .replace("1,7,", "1,8,")
        .replace("1.,0.,0.,0.", "1.,0.,0.5,0.01,0.,0.");
    assert_area(area(quarters(&octant), Some(&bent), 2), 2.0 * PI);
}

#[test]
fn a_seam_that_is_run_along_both_ways_has_the_face_on_both_sides() {
    for preference in [0, 2] {
        for curves in [quarters(&WITHOUT_OCTANT), backwards(&WITHOUT_OCTANT)] {
            assert_area(area(curves, None, preference), 14.0 * PI);
        }
        for (pole, expected) in [(NORTH, 4.0 * PI), (SOUTH, 12.0 * PI)] {
            let cap = vec![circle(), meridian(pole), meridian(pole)];
            assert_area(area(cap, None, preference), expected);
        }
    }
}

#[test]
fn an_octant_is_small_whichever_way_its_curves_run() {
    let octant = [[NORTH, Y], [Y, X], [X, NORTH]];
    for curves in [quarters(&octant), backwards(&octant)] {
        assert_area(area(curves, None, 2), 2.0 * PI);
    }
}

#[test]
fn meridians_end_at_poles_with_their_own_parameter() {
    let [a, b] = [1.0_f64, 5.4428].map(|angle| DVec3::new(angle.cos(), angle.sin(), 0.0));
    let middle = (a + b).normalize();
    let curves = [[a, NORTH], [NORTH, b], [b, middle], [middle, a]];
    let mut entities = vec![
        part(116, 0, "0.,0.,0.,0"),
        part(123, 0, "0.,0.,1."),
        part(123, 0, "1.,0.,0."),
        part(196, 1, "1,2.,3,5"),
    ];
    entities.extend(curves.map(arc));
    entities.push(part(102, 0, "4,9,11,13,15"));
    entities.push(part(142, 0, "0,7,0,17,2"));
    entities.push(made(144, "7,1,0,19"));
    let (scene, warnings) = read(&entities);
    assert_eq!(warnings, [""; 0]);
    let [patch] = scene.patches() else {
        panic!("{} patches", scene.patches().len())
    };
    let mut segments = patch.loops.iter().flat_map(|l| l.segments());
    assert!(
        segments.all(|curve| curve.degree() == 1),
        "{:?}",
        patch.loops
    );
}
