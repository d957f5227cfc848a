use glam::{DVec2, DVec3};
use kernel::{Aabb, WireShape};

use super::super::testing::{Made, file, made, part, read, read_within, square};
use crate::Limits;

/// Two sides of a square, as a polyline, and its offset inwards.
fn corner() -> [Made; 2] {
    [
        part(106, 12, "2,3,0.,0.,0.,1.,0.,0.,1.,1.,0."),
        made(130, "1,1,0,0,0,0.25,0.,0.,0.,0.,0.,1.,0.,2."),
    ]
}

#[test]
fn offsets_of_curves_are_cut_at_corners() {
    let (scene, warnings) = read(&corner());
    let ends = scene.wires().iter().map(|wire| match &wire.shape {
        WireShape::Curve(curve) => {
            let bounds = curve.hull_bounds();
            assert!((bounds.diagonal() - 1.0).abs() < 1e-12, "{bounds:?}");
            [curve.start(), curve.end()]
        }
        WireShape::Points(_) => panic!("points"),
    });
    let expected = [[[0.0, 0.25], [1.0, 0.25]], [[0.75, 0.0], [0.75, 1.0]]];
    let expected = expected.map(|ends| ends.map(|[x, y]| DVec3::new(x, y, 0.0)));
    for (ends, expected) in ends.zip(expected) {
        for (end, expected) in ends.into_iter().zip(expected) {
            assert!(end.distance(expected) < 1e-12, "{end}");
        }
    }
    assert_eq!(scene.wires().len(), 2);
    let text =
        "line 5, offset curve D3 (type 130): the offset of a curve with corners is in pieces";
    assert_eq!(warnings[0], text);
}

#[test]
fn distances_may_follow_a_coordinate_of_a_curve() {
    // Up from 1 to 3 along the first half of a line, and down to 2; by the parameter, and by the length.
    let law = "2,1,1,0,1,0,0.,0.,0.5,1.,1.,1.,1.,1.,0.,1.,0.,1.,3.,0.,2.,2.,0.,0.,1.,0.,0.,1.";
    let line = |end: f64| part(110, 0, &format!("0.,0.,0.,{end:?},0.,0."));
    for (by, end) in [(2, 5.0), (1, 1.0)] {
        let offset = format!("1,3,3,2,{by},0.,0.,0.,0.,0.,0.,1.,0.,1.");
        let (scene, warnings) = read(&[line(end), part(126, 0, law), made(130, &offset)]);
        let alone = "the file: there is no surface to show, only curves and points";
        assert_eq!(warnings, [alone]);
        let [wire] = scene.wires() else {
            panic!("{} wires", scene.wires().len());
        };
        let WireShape::Curve(curve) = &wire.shape else {
            panic!("points");
        };
        for k in 0..=16 {
            let share = f64::from(k) / 16.0;
            let height = if share < 0.5 {
                1.0 + 4.0 * share
            } else {
                4.0 - 2.0 * share
            };
            let off = curve
                .evaluate(share)
                .distance(DVec3::new(share * end, height, 0.0));
            assert!(off < 1e-12, "{off} at {share}");
        }
    }
    // A coordinate that there is not, and a law that is the offset itself.
    for (bad, why) in [
        ("1,3,3,4,2", "a law that is not read"),
        ("1,3,5,1,2", "nested"),
    ] {
        let offset = format!("{bad},0.,0.,0.,0.,0.,0.,1.,0.,1.");
        let made = [line(1.0), part(126, 0, law), made(130, &offset)];
        let problem = read_within(&file(&made), &Limits::default()).unwrap_err();
        assert!(problem.to_string().contains(why), "{problem}");
    }
}

#[test]
fn what_is_made_of_pieces_that_do_not_meet_is_told() {
    let [base, mut offset] = corner();
    offset.status = "00010000";
    let (scene, warnings) = read(&[base, offset, made(122, "3,0.,0.25,1.")]);
    let bounds = scene.patches()[0].bounds();
    let expected = Aabb {
        min: DVec3::new(0.0, 0.25, 0.0),
        max: DVec3::ONE,
    };
    let off = bounds.min.distance(expected.min) + bounds.max.distance(expected.max);
    assert!(off < 1e-9, "{bounds:?}");
    let is_told = |text: &String| text.contains("do not meet; each begins where the one before");
    assert!(warnings.iter().any(is_told), "{warnings:?}");
}

#[test]
fn offsets_of_surfaces_are_cut_at_creases() {
    // A roof: two squares that meet at a right angle.
    let points = "0.,0.,0.,1.,0.,1.,2.,0.,0.,0.,1.,0.,1.,1.,1.,2.,1.,0.";
    let roof = format!(
        "2,1,1,1,0,0,1,0,0,0.,0.,1.,2.,2.,0.,0.,1.,1.,1.,1.,1.,1.,1.,1.,{points},0.,2.,0.,1."
    );
    let (scene, warnings) = read(&[part(128, 0, &roof), made(140, "0.,0.,1.,0.5,1")]);
    let patches = scene.patches();
    assert_eq!(patches.len(), 2);
    let up = 0.5 * 0.5_f64.sqrt();
    for (patch, x) in patches.iter().zip([-up, up]) {
        let surface = &patch.surface;
        for k in 0..=10 {
            let share = f64::from(k) * 0.1;
            let (u, v) = (surface.knots_u().domain().start + share, share);
            let base = DVec3::new(u, v, 1.0 - (u - 1.0).abs());
            let off = surface.evaluate(DVec2::new(u, v)) - base;
            assert!(off.distance(DVec3::new(x, 0.0, up)) < 1e-12, "{off}");
        }
    }
    let text =
        "line 5, offset surface D3 (type 140): the offset of a surface with creases is in pieces";
    assert_eq!(warnings, [text]);
}

#[test]
fn offsets_are_where_their_curves_of_space_are() {
    let face = |height: f64, prefers: i64| {
        let space = format!("1,5,{height:?},0.1,0.1,0.9,0.1,0.9,0.9,0.1,0.9,0.1,0.1");
        let flat = "1,5,0.,0.1,0.1,0.9,0.1,0.9,0.9,0.1,0.9,0.1,0.1";
        let mut base = square(0.0);
        base.status = "00010000";
        let entities = [
            base,
            part(140, 0, "0.,0.,1.,0.25,1"),
            part(106, 11, flat),
            part(106, 11, &space),
            part(142, 0, &format!("0,3,5,7,{prefers}")),
            made(144, "3,1,0,9"),
        ];
        let (scene, warnings) = read(&entities);
        let bounds = scene.patches()[0].bounds();
        (bounds.min.z, bounds.max.z, warnings)
    };
    for prefers in [1, 2] {
        for height in [0.25, -0.25, 0.1] {
            let expected = if height < 0.0 { -0.25 } else { 0.25 };
            let (low, high, warnings) = face(height, prefers);
            assert!((low - expected).abs() + (high - expected).abs() < 1e-9);
            let is_told = warnings.iter().any(|w| w.contains("on the other side"));
            assert_eq!(is_told, height < 0.0, "{height} {warnings:?}");
        }
    }
}
