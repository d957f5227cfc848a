//! Files that do what few programs do, and what none should.

use glam::DVec3;
use kernel::{Integrals, Scene, WireShape};

use super::testing::{Made, formed, made, part, read, square};

const NONE: [&str; 0] = [];

/// The area of all patches.
fn area(scene: &Scene) -> f64 {
    let of = |patch| Integrals::of(patch, DVec3::ZERO).area();
    scene.patches().iter().map(of).sum()
}

/// The ends of the curves of a scene.
fn ends(scene: &Scene) -> Vec<[DVec3; 2]> {
    let ends = |shape: &WireShape| match shape {
        WireShape::Curve(curve) => [curve.start(), curve.end()],
        WireShape::Points(points) => [points[0], points[points.len() - 1]],
    };
    scene.wires().iter().map(|wire| ends(&wire.shape)).collect()
}

#[test]
fn a_curve_on_a_surface_shows_itself_and_leaves_the_surface() {
    let flat = || part(110, 0, "0.25,0.5,0.,0.75,0.5,0.");
    let space = part(110, 0, "0.,0.5,0.,1.,0.5,0.");
    let (scene, warnings) = read(&[square(0.0), flat(), space, made(142, "1,1,3,5,1")]);
    assert_eq!(warnings, NONE);
    assert_eq!(scene.placement_count(), 1);
    assert!((area(&scene) - 1.0).abs() < 1e-12);
    let middle = |x: f64| DVec3::new(x, 0.5, 0.0);
    assert_eq!(ends(&scene), [[middle(0.0), middle(1.0)]]);
    // A surface that is there for the sake of the curve only is not shown.
    let space = part(110, 0, "0.,0.5,0.,1.,0.5,0.");
    let (scene, warnings) = read(&[
        part(128, 0, &square(0.0).parameters),
        flat(),
        space,
        made(142, "1,1,3,5,1"),
    ]);
    assert_eq!((scene.placement_count(), scene.wires().len()), (0, 1));
    let text = "line 3, surface D1 (type 128): surface is not shown, but a curve on it";
    assert_eq!(warnings[0], text);
    // Without a curve of space, that of the parameters is shown on the surface.
    let (scene, warnings) = read(&[square(2.0), flat(), made(142, "1,1,3,0,1")]);
    assert_eq!(warnings, NONE);
    assert_eq!(scene.placement_count(), 1);
    assert_eq!(ends(&scene), [[middle(2.25), middle(2.75)]]);
}

#[test]
fn planes_that_clip_a_view_are_told_with_it() {
    let plane = part(108, 0, "1.,0.,0.,-3.,0,0.,0.,0.,0.");
    let (scene, warnings) = read(&[square(0.0), plane, made(410, "1,1.,3,0,0,0,0,0")]);
    assert_eq!(scene.placement_count(), 1);
    let text =
        "line 7, view D5 (type 410): annotation, properties and views are not shown: 1 of type 410";
    assert_eq!(warnings, [text]);
    // What is no endless plane clips nothing, and is shown.
    let (scene, _) = read(&[square(0.0), made(410, "1,1.,1,0,0,0,0,0")]);
    assert_eq!(scene.placement_count(), 1);
}

#[test]
fn composite_curves_begin_at_zero() {
    // An arc from 90 to 180 degrees and a line from there, as generatrix; the file trims the line.
    let quarter = std::f64::consts::FRAC_PI_2;
    let [low, high] = [quarter + 0.25, quarter + 0.75];
    let corners = [[low, 1.0], [high, 1.0], [high, 2.0], [low, 2.0], [low, 1.0]];
    let corners = corners.map(|[u, v]| format!(",{u},{v}"));
    let turned = part(124, 0, "1.,0.,0.,3.,0.,0.,-1.,0.,0.,1.,0.,0.");
    let mut arc = part(100, 0, "0.,0.,0.,0.,1.,-1.,0.");
    arc.transform = 1;
    let border = format!("1,5,0.{}", corners.concat());
    let (scene, warnings) = read(&[
        turned,
        arc,
        part(110, 0, "2.,0.,0.,2.,0.,-4."),
        part(102, 0, "2,3,5"),
        part(110, 0, "0.,0.,0.,0.,0.,1."),
        part(120, 0, "9,7,0.,3."),
        part(106, 63, &border),
        part(142, 0, "0,11,13,0,1"),
        made(144, "11,1,0,15"),
    ]);
    assert_eq!(warnings, NONE);
    // Half of the line, 2 from the axis.
    assert!((area(&scene) - 4.0).abs() < 1e-6, "{}", area(&scene));
}

#[test]
fn offsets_of_quadrics_keep_to_the_side_and_place_of_the_file() {
    let mut cylinder = part(192, 1, "1,3,3.,5");
    let shift = part(124, 0, "1.,0.,0.,10.,0.,1.,0.,0.,0.,0.,1.,0.");
    cylinder.transform = 7;
    let circle = |height: f64| part(100, 0, &format!("{height},10.,0.,12.,0.,12.,0."));
    // Half a turn from the reference direction, x looks inwards.
    let (scene, warnings) = read(&[
        part(116, 0, "0.,0.,0."),
        part(123, 0, "0.,0.,1."),
        part(123, 0, "1.,0.,0."),
        shift,
        cylinder,
        part(140, 0, "1.,0.,0.,1.,9"),
        circle(0.0),
        circle(2.0),
        part(142, 0, "1,11,0,13,2"),
        part(142, 0, "1,11,0,15,2"),
        made(144, "11,1,1,17,19"),
    ]);
    assert_eq!(warnings, NONE);
    let band = 8.0 * std::f64::consts::PI;
    assert!((area(&scene) - band).abs() < 1e-6, "{}", area(&scene));
}

#[test]
fn offsets_of_offsets_add_up() {
    let (scene, warnings) = read(&[
        Made {
            status: "00010000",
            ..square(0.0)
        },
        part(140, 0, "0.,0.,1.,2.,1"),
        made(140, "0.,0.,-1.,0.5,3"),
    ]);
    // The square is flat: its offsets are exact, and it is not missed itself.
    assert_eq!(warnings, NONE);
    assert_eq!(scene.placement_count(), 1);
    let corner = scene.patches()[0].surface.corners()[0][0];
    assert!(corner.distance(DVec3::Z * 1.5) < 1e-12, "{corner}");
    // One that is its own base ends.
    let (scene, warnings) = read(&[square(0.0), made(140, "0.,0.,1.,2.,3")]);
    assert_eq!(scene.placement_count(), 1);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
}

#[test]
fn spline_surfaces_may_lack_the_blocks_that_say_nothing() {
    // (s, t, 0) over two rows of two blocks.
    let block = |x: usize, y: usize| {
        let axis = |start: usize, power: usize| {
            let coefficient = |k: usize| match k {
                0 => format!(",{start}."),
                k if k == power => ",1.".to_owned(),
                _ => ",0.".to_owned(),
            };
            (0..16).map(coefficient).collect::<String>()
        };
        axis(x, 1) + &axis(y, 4) + &",0.".repeat(16)
    };
    let end = ",0.".repeat(48);
    let name = part(406, 15, "1,4Hflat");
    for (after_first, after_second, after_all) in [(1, 1, 3), (1, 0, 0), (0, 0, 0)] {
        let mut text = "3,1,2,2,0.,1.,2.,0.,1.,2.".to_owned();
        for (x, ends) in [(0, after_first), (1, after_second)] {
            text += &(block(x, 0) + &block(x, 1) + &end.repeat(ends));
        }
        text += &end.repeat(after_all);
        if after_first == after_second {
            text += ",0,1,3";
        }
        let surface = made(114, &text);
        let name = part(name.kind, name.form, &name.parameters);
        let (scene, warnings) = read(&[surface, name]);
        assert_eq!(warnings, NONE);
        assert!((area(&scene) - 4.0).abs() < 1e-12);
        if after_first == after_second {
            assert_eq!(scene.patches()[0].name, "flat");
        }
    }
}

#[test]
fn curves_and_points_have_the_names_of_their_properties() {
    let named = |kind: i64, form: i64, parameters: &str| Made {
        form,
        label: "LABEL",
        ..made(kind, &format!("{parameters},0,1,1"))
    };
    let spline = "1,1,1,0,1,0,0.,0.,1.,1.,1.,1.,0.,0.,0.,1.,1.,0.,0.,1.,0.,0.,1.";
    let cubic = "3,0,2,1,0.,1.,0.,1.,0.,0.,0.,1.,0.,0.,0.,0.,0.,0.,1.,1.,0.,0.,1.,1.,0.,0.,\
                 0.,0.,0.,0.";
    let (scene, _) = read(&[
        part(406, 15, "1,5Hnamed"),
        named(100, 0, "0.,0.,0.,1.,0.,0.,1."),
        named(102, 0, "1,25"),
        named(104, 1, "0.25,0.,1.,0.,0.,-1.,5.,2.,0.,-2.,0."),
        named(106, 11, "1,2,0.,0.,0.,1.,1."),
        named(106, 2, "2,1,0.,0.,0."),
        named(106, 13, "3,2,0.,0.,0.,0.,0.,1.,1.,0.,0.,0.,0.,1."),
        named(110, 0, "0.,0.,0.,1.,0.,0."),
        named(112, 0, cubic),
        named(116, 0, "1.,2.,3.,0"),
        named(126, 0, spline),
        named(130, 0, "25,1,0,0,0,0.5,0.,0.,0.,0.,0.,1.,0.,1."),
        part(110, 0, "1.,2.,3.,0.,0.,0."),
        named(142, 0, "0,0,0,25,2"),
    ]);
    let names: Vec<_> = scene.wires().iter().map(|w| w.name.as_str()).collect();
    assert_eq!(names, ["named"; 12]);
}

#[test]
fn members_of_composite_curves_that_run_backwards_are_turned() {
    for ends in ["1.,1.,0.,1.,0.,0.", "1.,0.,0.,1.,1.,0."] {
        let (scene, warnings) = read(&[
            part(110, 0, "0.,0.,0.,1.,0.,0."),
            part(110, 0, ends),
            part(102, 0, "2,1,3"),
            made(122, "5,0.,0.,5."),
        ]);
        assert!((area(&scene) - 10.0).abs() < 1e-9, "{}", area(&scene));
        assert_eq!(warnings.len(), usize::from(ends.starts_with("1.,1.")));
    }
}

#[test]
fn the_centre_of_a_sphere_is_where_its_transformation_places_it() {
    let mut centre = part(116, 0, "1.,0.,0.");
    centre.transform = 3;
    let shift = part(124, 0, "1.,0.,0.,7.,0.,1.,0.,0.,0.,0.,1.,0.");
    let (scene, warnings) = read(&[centre, shift, made(196, "1,2.")]);
    assert_eq!(warnings, NONE);
    let bounds = scene.patches()[0].surface.hull_bounds();
    assert!((bounds.center().x - 8.0).abs() < 1e-12, "{bounds:?}");
}

#[test]
fn what_is_marked_as_no_geometry_is_told_as_such() {
    let other = Made {
        status: "00000500",
        ..square(2.0)
    };
    let (scene, warnings) = read(&[square(0.0), other]);
    assert_eq!(scene.placement_count(), 1);
    let text = "line 5, surface D3 (type 128): surface is not shown, because it is marked as no \
                geometry";
    assert_eq!(warnings, [text]);
}

#[test]
fn planes_have_their_holes() {
    let plane = |form: i64, curve: i64| Made {
        form,
        ..made(108, &format!("0.,0.,1.,0.,{curve},0.,0.,0.,0."))
    };
    let parts = || {
        [
            part(100, 0, "0.,0.,0.,2.,0.,2.,0."),
            part(100, 0, "0.,0.,0.,1.,0.,1.,0."),
            plane(1, 1),
            plane(-1, 3),
        ]
    };
    let pair = Made {
        form: 9,
        ..made(402, "1,1,5,7")
    };
    let (scene, warnings) = read(&parts().into_iter().chain([pair]).collect::<Vec<_>>());
    assert_eq!(warnings, NONE);
    let ring = 3.0 * std::f64::consts::PI;
    assert_eq!(scene.placement_count(), 1);
    assert!((area(&scene) - ring).abs() < 1e-6, "{}", area(&scene));
    // On its own, a hole is nothing.
    let (scene, warnings) = read(&parts());
    assert_eq!(scene.placement_count(), 1);
    let text = "line 9, plane D7 (type 108): a hole without the plane that it belongs to is not \
                shown";
    assert_eq!(warnings, [text]);
}

#[test]
fn records_are_read_to_their_names() {
    let name = |text: &str| part(406, 15, &format!("1,{}H{text}", text.len()));
    let line = |z: f64| part(110, 0, &format!("0.,0.,{z:?},1.,0.,{z:?}"));
    let (scene, warnings) = read(&[
        line(0.0),
        line(1.0),
        formed(118, 1, "1,3,0,0,0,1,7"),
        name("ruled"),
        part(116, 0, "5.,0.,0."),
        made(196, "9,1.,0,1,13"),
        name("sphere"),
        made(412, "5,1.,0.,0.,0.,2,1,4.,0.,0.,0,0,0,1,17"),
        name("array"),
        made(320, "0,3Hnet,1,5,0,2HU1,0,1,9,0,1,21"),
        name("network"),
        made(420, "19,0.,0.,9.,1.,1.,1.,0,2HU2,0,1,9,0,1,25"),
        name("instance"),
    ]);
    let mut names: Vec<_> = scene.patches().iter().map(|p| p.name.as_str()).collect();
    names.extend(scene.nodes().iter().map(|node| node.name.as_str()));
    for name in ["ruled", "sphere", "array", "network", "instance"] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    assert_eq!(warnings, NONE);
}

#[test]
fn directrices_end_where_the_file_says() {
    // The second half of a line, or a little more than there is of it.
    let knots = "1,1,0,0,1,0,0.,0.,1.,1.,1.,1.,0.,0.,0.,10.,0.,0.";
    for (end, found) in [(1.0, 10.0), (1.000_000_01, 10.0), (0.75, 7.5)] {
        let line = part(126, 0, &format!("{knots},0.5,{end:?}"));
        let (scene, warnings) = read(&[line, made(122, "1,5.,0.,1.")]);
        let bounds = scene.patches()[0].bounds();
        assert!((bounds.min.x - 5.0).abs() < 1e-9, "{bounds:?}");
        assert!((bounds.max.x - found).abs() < 1e-9, "{bounds:?}");
        assert_eq!(warnings, NONE);
    }
    let beyond = part(126, 0, &format!("{knots},0.5,1.5"));
    let (_, warnings) = read(&[beyond, made(122, "1,5.,0.,1.")]);
    assert!(warnings[0].contains("the wanted range of t from 0.5 to 1.5"));
    // Torn in the middle, with a part of either side.
    let torn = "3,1,0,0,1,0,0.,0.,1.,1.,2.,2.,1.,1.,1.,1.,0.,0.,0.,1.,0.,0.,2.,0.,0.,3.,0.,0.";
    let (scene, _) = read(&[made(126, &format!("{torn},0.5,1.25"))]);
    let at = |x: f64| DVec3::X * x;
    assert_eq!(ends(&scene), [[at(0.5), at(1.0)], [at(2.0), at(2.25)]]);
    let (scene, _) = read(&[made(126, &format!("{torn},1.,1.25"))]);
    assert_eq!(ends(&scene), [[at(2.0), at(2.25)]]);
}

#[test]
fn turns_that_are_none_or_too_many_are_told() {
    let turned = |angles: &str| {
        let axis = part(110, 0, "0.,0.,0.,0.,0.,1.");
        let line = part(110, 0, "1.,0.,0.,1.,0.,1.");
        let (scene, warnings) = read(&[axis, line, made(120, &format!("1,3,{angles}"))]);
        (area(&scene), warnings)
    };
    let whole = std::f64::consts::TAU;
    for (angles, text) in [
        ("0.,6.2831853072", ""),
        ("0.,0.", "whole turns are added"),
        ("0.,7.", "one turn is shown"),
    ] {
        let (area, warnings) = turned(angles);
        assert!((area - whole).abs() < 1e-9, "{area}");
        let is_told = warnings.len() == 1 && warnings[0].ends_with(text);
        assert!(
            is_told || text.is_empty() && warnings.is_empty(),
            "{warnings:?}"
        );
    }
}

#[test]
fn offsets_of_cones_pass_their_apex() {
    // The normal looks away from the axis at the side where angles begin, the offset inside.
    let (scene, warnings) = read(&[
        part(116, 0, "0.,0.,0."),
        part(123, 0, "0.,0.,1."),
        part(123, 0, "1.,0.,0."),
        part(194, 1, "1,3,0.,45.,5"),
        part(140, 0, "1.,0.,0.,0.2,7"),
        part(100, 0, "4.28284271247,0.,0.,4.,0.,4.,0."),
        part(142, 0, "0,9,0,11,2"),
        part(100, 0, "2.,0.,0.,1.71715728753,0.,1.71715728753,0."),
        part(142, 0, "0,9,0,15,2"),
        made(144, "9,1,1,13,17"),
    ]);
    assert_eq!(warnings, NONE);
    let bounds = scene.patches()[0].bounds();
    let apex = 0.2 * 2.0_f64.sqrt();
    assert!((bounds.min.z - 2.0).abs() < 1e-6, "{bounds:?}");
    let rim = bounds.max.distance(DVec3::new(4.0, 4.0, 4.0 + apex));
    assert!(rim < 1e-6, "{bounds:?}");
}

#[test]
fn what_is_moved_beyond_all_numbers_is_refused() {
    let far = square(0.0)
        .parameters
        .replace("1.0,1.,0.,0.,1.,0.,1.", "1e250,1.,0.,0.,1.,0.,1.");
    let moved = |kind, parameters: &str| Made {
        transform: 1,
        ..made(kind, parameters)
    };
    let (scene, warnings) = read(&[
        part(124, 0, "1.E100,0.,0.,0.,0.,1.E100,0.,0.,0.,0.,1.E100,0."),
        moved(128, &far),
        moved(110, "0.,0.,0.,1.E250,0.,0."),
        square(0.0),
    ]);
    assert_eq!((scene.patches().len(), scene.wires().len()), (1, 0));
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(
        warnings.iter().all(|text| text.contains(" is not finite")),
        "{warnings:?}"
    );
}
