//! What stands where its own transformation or that of what it belongs to puts it, and parameters that
//! are told by another curve or surface.

use std::f64::consts::PI;

use glam::DVec3;
use kernel::{Aabb, Integrals, Scene, WireShape};

use super::testing::{Made, corners, formed, made, part, read, square};

const NONE: [&str; 0] = [];

/// A move by (1, 0, 10).
const MOVE: &str = "1.,0.,0.,1.,0.,1.,0.,0.,0.,0.,1.,10.";

fn bounds(scene: &Scene) -> Aabb {
    scene.patches()[0].bounds()
}

fn area(scene: &Scene) -> f64 {
    Integrals::of(&scene.patches()[0], DVec3::ZERO).area()
}

fn colored(kind: i64, parameters: &str, color: i64) -> Made {
    Made {
        color,
        ..made(kind, parameters)
    }
}

#[test]
fn groups_are_shown_wherever_their_definitions_are() {
    let member = || Made {
        status: "00010000",
        ..square(0.0)
    };
    let grouped = formed(402, 7, "1,1");
    let definition = |of: i64| Made {
        status: "00000200",
        ..made(308, &format!("0,4Hpart,1,{of}"))
    };
    // In two places with colours of their own.
    let (scene, warnings) = read(&[
        member(),
        grouped.clone(),
        definition(3),
        colored(408, "5,0.,0.,0.", 2),
        colored(408, "5,10.,0.,0.", 3),
    ]);
    assert_eq!(warnings, NONE);
    assert_eq!(corners(&scene), [DVec3::ZERO, DVec3::X * 10.0]);
    // As a base of two arrays.
    let array = |x: f64| format!("3,1.,{x:?},0.,0.,1,1,1.,1.,0.,0,0");
    let (scene, _) = read(&[
        member(),
        grouped.clone(),
        colored(412, &array(1.0), 2),
        colored(412, &array(2.0), 3),
    ]);
    assert_eq!(corners(&scene), [DVec3::X, DVec3::X * 2.0]);
    // In groups of two definitions.
    let (scene, warnings) = read(&[
        member(),
        grouped.clone(),
        definition(3),
        grouped,
        definition(7),
        made(408, "5,0.,0.,0."),
        made(408, "9,10.,0.,0."),
    ]);
    assert_eq!(warnings, NONE);
    assert_eq!(corners(&scene), [DVec3::ZERO, DVec3::X * 10.0]);
}

#[test]
fn curves_go_where_the_transformation_of_their_boundary_puts_them() {
    let border = "1,5,0.,0.,0.,2.,0.,2.,1.,0.,1.,0.,0.";
    let moved = |made: Made| Made {
        transform: 1,
        ..made
    };
    // A plane with its border.
    let (scene, warnings) = read(&[
        made(124, MOVE),
        part(106, 11, border),
        moved(formed(108, 1, "0.,0.,1.,0.,3,0.,0.,0.,0.")),
    ]);
    assert_eq!(warnings, NONE);
    let found = bounds(&scene);
    let expected = [DVec3::new(1.0, 0.0, 10.0), DVec3::new(3.0, 1.0, 10.0)];
    assert!(found.min.distance(expected[0]) < 1e-6 && found.max.distance(expected[1]) < 1e-6);
    // A curve on a surface.
    let large = "1,1,1,1,0,0,1,0,0,0.,0.,1.,1.,0.,0.,1.,1.,1.,1.,1.,1.,\
        0.,0.,0.,9.,0.,0.,0.,9.,0.,9.,9.,0.,0.,1.,0.,1.";
    let (scene, warnings) = read(&[
        made(124, "1.,0.,0.,1.,0.,1.,0.,0.,0.,0.,1.,0."),
        part(128, 0, large),
        part(106, 11, border),
        moved(part(142, 0, "0,3,0,5,2")),
        made(144, "3,1,0,7"),
    ]);
    assert_eq!(warnings, NONE);
    let found = bounds(&scene);
    assert!(
        (found.min.x - 1.0).abs() + (found.max.x - 3.0).abs() < 1e-6,
        "{found:?}"
    );
}

/// A surface, which comes before, with a rectangle in its parameters as its border.
fn windowed(mut before: Vec<Made>, u: [f64; 2], v: [f64; 2]) -> (Scene, Vec<String>) {
    let surface = 2 * before.len() - 1;
    let [[a, b], [c, d]] = [u, v];
    let window = format!("1,5,0.,{a:?},{c:?},{b:?},{c:?},{b:?},{d:?},{a:?},{d:?},{a:?},{c:?}");
    before.extend([
        part(106, 11, &window),
        part(142, 0, &format!("0,{surface},{},0,1", surface + 2)),
        made(144, &format!("{surface},1,0,{}", surface + 4)),
    ]);
    read(&before)
}

#[test]
fn angles_of_ellipses_count_from_the_axis_next_to_x() {
    for (a, b) in [(3.0, 2.0), (2.0, 3.0), (2.5, 2.5)] {
        // The right half of an ellipse in the plane of x and z, turned about z by one radian.
        let conic = format!(
            "{:?},0.,{:?},0.,0.,-1.,0.,0.,{:?},0.,{b:?}",
            1.0 / (a * a),
            1.0 / (b * b),
            -b
        );
        let upright = "1.,0.,0.,0.,0.,0.,-1.,0.,0.,1.,0.,0.";
        let arc = Made {
            transform: 1,
            ..part(104, 1, &conic)
        };
        let axis = part(110, 0, "0.,0.,0.,0.,0.,1.");
        let made = vec![made(124, upright), arc, axis, part(120, 0, "5,3,0.,1.")];
        let (scene, warnings) = windowed(made, [1.5 * PI + 0.3, 1.5 * PI + 0.9], [0.0, 1.0]);
        assert_eq!(warnings, NONE);
        let found = bounds(&scene);
        let heights = [0.3, 0.9].map(|t: f64| b * (1.5 * PI + t).sin());
        assert!(
            (found.min.z - heights[0]).abs() + (found.max.z - heights[1]).abs() < 1e-6,
            "{found:?}"
        );
    }
}

#[test]
fn lines_of_ruled_surfaces_are_run_through_evenly() {
    // A quarter of a circle, with weights, and a line of two above it.
    let arc = "2,2,0,0,0,0,0.,0.,0.,1.,1.,1.,1.,0.70710678118654752,1.,\
        1.,0.,0.,1.,1.,0.,0.,1.,0.,0.,1.,0.,0.,1.";
    let line = "1,1,1,0,1,0,0.,0.,1.,1.,1.,1.,1.,0.,4.,0.,1.,4.,0.,1.,0.,0.,1.";
    let made = vec![
        part(126, 0, arc),
        part(126, 0, line),
        part(118, 1, "1,3,0,0"),
    ];
    let (scene, warnings) = windowed(made, [0.0, 1.0], [0.0, 0.5]);
    assert_eq!(warnings, NONE);
    let found = bounds(&scene);
    assert!((found.max.z - 2.0).abs() < 1e-6, "{found:?}");
    assert!((found.min.z).abs() < 1e-12, "{found:?}");
}

#[test]
fn lines_from_arcs_of_ellipses_are_not_of_equal_length() {
    let ellipse = part(104, 1, "1.,0.,16.,0.,0.,-16.,0.,4.,0.,0.,1.");
    let line = part(110, 0, "4.,0.,2.,0.,1.,2.");
    let (_, warnings) = read(&[ellipse, line, made(118, "1,3,0,0")]);
    let is_told = |w: &String| w.contains("points of equal arc length");
    assert!(warnings.iter().any(is_told), "{warnings:?}");
}

#[test]
fn offsets_of_arcs_are_told_by_their_angles() {
    let arc = || part(100, 0, "0.,0.,0.,1.,0.,0.,1.");
    let ends = |offset: &str| {
        let (scene, _) = read(&[arc(), made(130, offset)]);
        let [wire] = scene.wires() else {
            panic!("{} wires", scene.wires().len());
        };
        let WireShape::Curve(curve) = &wire.shape else {
            panic!("points");
        };
        [curve.start(), curve.end()]
    };
    let near = |found: [DVec3; 2], angles: [f64; 2], radii: [f64; 2]| {
        for ((found, angle), radius) in found.into_iter().zip(angles).zip(radii) {
            let expected = DVec3::new(angle.cos(), angle.sin(), 0.0) * radius;
            assert!(found.distance(expected) < 1e-6, "{found} {expected}");
        }
    };
    near(
        ends("1,1,0,0,0,0.5,0.,0.,0.,0.,0.,-1.,0.3,1."),
        [0.3, 1.0],
        [1.5, 1.5],
    );
    // From half to nothing over the quarter, and a quarter of it.
    let linear = format!(
        "1,2,0,0,2,0.5,0.,0.,{:?},0.,0.,-1.,0.,{:?}",
        PI / 2.0,
        PI / 8.0
    );
    near(ends(&linear), [0.0, PI / 8.0], [1.5, 1.375]);
}

#[test]
fn offsets_of_quadrics_are_where_their_curves_of_space_are() {
    // A plane, and a border on the other side than the file tells.
    let (scene, warnings) = read(&[
        part(116, 0, "0.,0.,0.,0"),
        part(123, 0, "0.,0.,1."),
        part(190, 0, "1,3"),
        part(140, 0, "0.,0.,1.,2.,5"),
        part(
            106,
            12,
            "2,5,0.,0.,-2.,3.,0.,-2.,3.,1.,-2.,0.,1.,-2.,0.,0.,-2.",
        ),
        part(142, 0, "0,7,0,9,2"),
        made(144, "7,1,0,11"),
    ]);
    let found = bounds(&scene);
    assert!(
        (found.min.z + 2.0).abs() + (found.max.z + 2.0).abs() < 1e-9,
        "{found:?}"
    );
    assert!((area(&scene) - 3.0).abs() < 1e-9);
    assert!(warnings[0].contains("on the other side"), "{warnings:?}");
}

#[test]
fn pieces_of_splines_that_do_not_meet_are_told() {
    let segment = |x: f64| format!("{x:?},1.,0.,0.,0.,0.,0.,0.,0.,0.,0.,0.");
    for (gap, is_told) in [(0.0, false), (0.5, true)] {
        let curve = format!("3,1,3,2,0.,1.,2.,{},{}", segment(0.0), segment(1.0 + gap));
        let (_, warnings) = read(&[made(112, &curve)]);
        let found = warnings.iter().any(|w| w.contains("do not meet"));
        assert_eq!(found, is_told, "{warnings:?}");
    }
}
