//! Faces trimmed by curves of the parameter domain.

use glam::{DVec2, DVec3};

use crate::iges::testing::{Made, corners, file, made, read, read_within, square};
use crate::{Import, Limits, Problem};

/// The border of the unit square as lines, at D `1`, and its composite curve at D 9.
fn border() -> Vec<Made> {
    let ends = [
        "0.,0.,0.,1.,0.",
        "1.,0.,0.,1.,1.",
        "1.,1.,0.,0.,1.",
        "0.,1.,0.,0.,0.",
    ];
    let mut border: Vec<_> = ends.map(|e| made(110, &format!("{e},0."))).into();
    border.push(made(102, "4,1,3,5,7"));
    for curve in &mut border {
        curve.status = "00010500";
    }
    border
}

/// A square trimmed by its border, of which the first line is another.
fn trimmed(first: &str) -> Vec<Made> {
    let mut entities = border();
    first.clone_into(&mut entities[0].parameters);
    let mut base = square(3.0);
    base.status = "00010000";
    entities.push(base);
    entities.push(made(142, "1,11,9,0,1"));
    entities.push(made(144, "11,1,0,13"));
    entities
}

#[test]
fn trimmed_surfaces_have_loops_and_show_once() {
    let mut entities = border();
    let mut base = square(3.0);
    // Invisible and dependent, as many programs write it.
    base.status = "01010000";
    entities.push(base);
    entities.push(made(142, "1,11,9,0,1"));
    entities.push(made(144, "11,1,0,13"));
    let mut half = square(4.0);
    half.status = "00010000";
    entities.push(half);
    let mut hole = made(106, "1,4,0.,0.2,0.2,0.8,0.2,0.5,0.8,0.2,0.2");
    (hole.form, hole.status) = (11, "00010500");
    entities.push(hole);
    entities.push(made(142, "1,17,19,0,1"));
    entities.push(made(144, "17,0,1,0,21"));
    let (scene, warnings) = read(&entities);
    assert_eq!(corners(&scene), [DVec3::X * 3.0, DVec3::X * 4.0]);
    let loops: Vec<_> = scene.patches().iter().map(|p| p.loops.len()).collect();
    assert_eq!(loops, [1, 2]);
    assert_eq!(scene.patches()[0].loops[0].segments().len(), 4);
    assert!(warnings.is_empty(), "{warnings:?}");
}

#[test]
fn equal_loops_count_once() {
    let mut entities = trimmed("0.,0.,0.,1.,0.,0.");
    entities.pop();
    entities.push(made(142, "1,11,9,0,1"));
    entities.push(made(144, "11,1,1,13,15"));
    let (scene, warnings) = read(&entities);
    assert_eq!(scene.patches()[0].loops.len(), 1);
    let text =
        "line 19, trimmed surface D17 (type 144): two trim loops are the same; they count once";
    assert_eq!(warnings, [text]);
}

#[test]
fn loops_without_curves_do_not_count() {
    let place = "line 21, trimmed surface D19 (type 144):";
    for bounds in ["13,15,17", "15,13,17", "17,15,13"] {
        let mut entities = trimmed("0.,0.,0.,1.,0.,0.");
        entities.pop();
        entities.push(made(142, "0,11,0,0,2"));
        entities.push(made(142, "0,11,0,0,0"));
        entities.push(made(144, &format!("11,1,2,{bounds}")));
        let (scene, warnings) = read(&entities);
        assert_eq!(scene.patches()[0].loops.len(), 1);
        let text = format!("{place} a trim loop has no curves; it does not count (and 1 more)");
        assert_eq!(warnings, [text]);
    }
    let mut entities = trimmed("0.,0.,0.,1.,0.,0.");
    entities[6].parameters = "0,11,0,0,2".to_owned();
    let (scene, warnings) = read(&entities);
    assert!(scene.patches()[0].loops.is_empty());
    assert!(warnings[0].ends_with("shown untrimmed: a trim loop without curves"));
}

#[test]
fn bounded_surfaces_have_loops() {
    let mut entities = border();
    let mut base = square(3.0);
    base.status = "00010000";
    entities.push(base);
    entities.push(made(141, "1,2,11,1,0,1,1,9"));
    entities.push(made(143, "1,11,1,13"));
    let (scene, warnings) = read(&entities);
    assert_eq!(scene.patches()[0].loops.len(), 1);
    assert!(warnings.is_empty(), "{warnings:?}");
}

#[test]
fn loops_that_cannot_be_read_are_told() {
    let (scene, warnings) = read(&trimmed("0.,0.,0.,0.5,0.,0."));
    assert!(scene.patches()[0].loops.is_empty());
    assert!(warnings[0].ends_with("shown untrimmed: a trim loop does not close"));
}

#[test]
fn loops_that_lie_outside_cut_nothing_off() {
    let mut entities = trimmed("0.,0.,0.,1.,0.,0.");
    for line in &mut entities[..4] {
        line.parameters = line.parameters.replace("1.", "3.").replace("0.,", "2.,");
    }
    let (scene, warnings) = read(&entities);
    assert!(scene.patches()[0].loops.is_empty());
    let text = "line 17, trimmed surface D15 (type 144): trimmed surface is shown untrimmed: its trim \
                loops, from (2, 2) to (3, 3), lie outside its domain, which goes from (0, 0) to (1, 1)";
    assert_eq!(warnings, [text]);
}

#[test]
fn of_a_torn_surface_the_part_outside_the_loops_is_cut_off() {
    // Two squares with a gap between them, and a loop on one of them.
    let torn = "3,1,1,1,0,0,1,0,0,0.,0.,1.,1.,2.,2.,0.,0.,1.,1.,1.,1.,1.,1.,1.,1.,1.,1.,\
                0.,0.,0.,1.,0.,0.,2.,0.,0.,3.,0.,0.,0.,1.,0.,1.,1.,0.,2.,1.,0.,3.,1.,0.,0.,2.,0.,1.";
    for (ends, expected, told) in [
        (["1.25", "1.75"], [false, true], 1),
        (["3.25", "3.75"], [true, true], 2),
        // A part of it on neither.
        (["1.25", "2.25"], [false, true], 2),
    ] {
        let [a, b] = ends;
        let mut corners = made(106, &format!("1,4,0.,{a},0.25,{b},0.25,{b},0.75,{a},0.25"));
        corners.form = 11;
        let mut entities = vec![corners, made(128, torn)];
        for part in &mut entities {
            part.status = "00010000";
        }
        entities.push(made(142, "1,3,1,0,1"));
        entities.push(made(144, "3,1,0,5"));
        let (scene, warnings) = read(&entities);
        let whole = scene.patches().iter().map(|patch| {
            let [u, v] = [patch.surface.knots_u(), patch.surface.knots_v()].map(|k| k.domain());
            let near = DVec2::new(0.7 * u.end + 0.3 * u.start, 0.4 * v.end + 0.6 * v.start);
            patch.region().is_none_or(|region| region.contains(near))
        });
        assert_eq!(whole.collect::<Vec<_>>(), expected);
        assert_eq!(warnings.len(), told, "{warnings:?}");
    }
}

#[test]
fn curves_of_the_domain_stand_where_curves_of_space_do_not() {
    // The curves of space do not close.
    let lines = [
        "3.,0.,0.,3.5,0.,0.",
        "4.,0.,0.,4.,1.,0.",
        "4.,1.,0.,3.,1.,0.",
        "3.,1.,0.,3.,0.,0.",
    ];
    let (patch, warnings) = bounded(border(), lines.map(str::to_owned), "9,21,1");
    let [border] = &patch.loops[..] else {
        panic!("{warnings:?}");
    };
    assert_eq!(border.segments().len(), 4);
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(DVec2::from);
    assert!(
        border
            .segments()
            .iter()
            .all(|c| corners.contains(&c.start()))
    );
    // What was tried before is not told.
    let text = "line 27, trimmed surface D25 (type 144): a trim loop is made of curves of the \
                parameter domain that are not where its curves of space are, because those bound \
                no face";
    assert_eq!(warnings, [text]);
}

#[test]
fn curves_of_the_domain_are_held_against_curves_of_space_between_their_ends() {
    let text = "line 27, trimmed surface D25 (type 144): a curve of the parameter domain is not where \
                its curve of space is; the curve of space is used";
    // The first side bulges in the domain, by half of that, and is straight in space.
    let whole = |bulge: &str| {
        let points = format!("0.,0.,0.,.5,{bulge},0.,1.,0.,0.");
        format!("2,2,1,0,1,0,0.,0.,0.,1.,1.,1.,1.,1.,1.,{points},0.,1.,0.,0.,1.")
    };
    // Only the last of two spans does.
    let knots = "0.,0.,0.,.9,.9,1.,1.,1.,1.,1.,1.,1.,1.";
    let points = "0.,0.,0.,.45,0.,0.,.9,0.,0.,.95,.2,0.,1.,0.,0.";
    let end = format!("4,2,1,0,1,0,{knots},{points},0.,1.,0.,0.,1.");
    for (curve, expected, told) in [
        (whole("0.002"), 1.0 - 0.001 * 2.0 / 3.0, vec![]),
        (whole("0.2"), 1.0, vec![text.to_owned()]),
        (end, 1.0, vec![text.to_owned()]),
    ] {
        let mut entities = border();
        entities[0] = made(126, &curve);
        entities[0].status = "00010500";
        let lines = rectangle("4.", "0.");
        let (patch, warnings) = bounded(entities, lines, "9,21,1");
        let area = patch.loops[0].signed_area().abs();
        assert!((area - expected).abs() < 2e-5, "{curve}: {area}");
        assert_eq!(warnings, told);
    }
}

/// The lines around a rectangle from the left side of [`bounded`]'s square to `right`, at some height.
fn rectangle(right: &str, height: &str) -> [String; 4] {
    let corners = [("3.", "0."), (right, "0."), (right, "1."), ("3.", "1.")];
    let corner = |k: usize| format!("{},{},{height}", corners[k % 4].0, corners[k % 4].1);
    [0, 1, 2, 3].map(|k| format!("{},{}", corner(k), corner(k + 1)))
}

/// A square with a loop of these lines in space, at D 21, and of a border in the parameter domain, at
/// D 9; `curves` tells which of both the loop has, and prefers.
fn bounded(
    mut border: Vec<Made>,
    lines: [String; 4],
    curves: &str,
) -> (kernel::Patch, Vec<String>) {
    let mut parts = vec![square(3.0)];
    parts.extend(lines.map(|ends| made(110, &ends)));
    parts.push(made(102, "4,13,15,17,19"));
    for mut part in parts {
        part.status = "00010000";
        border.push(part);
    }
    border.push(made(142, &format!("1,11,{curves}")));
    border.push(made(144, "11,1,0,23"));
    let (scene, warnings) = read(&border);
    (scene.patches()[0].clone(), warnings)
}

/// A square with a loop along half of it, at some height, and along its border in the parameter domain
/// if that is said.
fn above(height: &str, is_flat: bool) -> (kernel::Patch, Vec<String>) {
    let curves = if is_flat { "9,21,3" } else { "0,21,3" };
    bounded(border(), rectangle("3.5", height), curves)
}

#[test]
fn curves_of_the_domain_stand_where_curves_of_space_are_off_the_surface() {
    let place = "line 27, trimmed surface D25 (type 144):";
    for (height, expected, text) in [
        (
            "0.3",
            1.0,
            "a curve of space is off its surface; that of the parameter domain is used",
        ),
        (
            "0.001",
            0.5,
            "a curve of the parameter domain is not where its curve of space is; the curve of space \
             is used",
        ),
    ] {
        let (patch, warnings) = above(height, true);
        let area = patch.loops[0].signed_area().abs();
        assert!((area - expected).abs() < 1e-12, "{height}: {area}");
        assert_eq!(warnings, [format!("{place} {text}")]);
    }
}

#[test]
fn curves_of_space_that_are_off_the_surface_are_told() {
    let (patch, warnings) = above("0.1", false);
    assert!((patch.loops[0].signed_area().abs() - 0.5).abs() < 1e-12);
    let text = "line 27, trimmed surface D25 (type 144): a trim curve is off its surface by up to 1e-1 of \
                the size of that; it is laid onto it";
    assert_eq!(warnings, [text]);
    assert_eq!(above("0.001", false).1, [""; 0]);
}

#[test]
fn a_curve_that_ends_at_a_pole_stays_on_its_surface() {
    // A triangle, faster and faster towards a corner that is a side of its domain, and half of it.
    let mut parts = vec![made(
        128,
        "1,2,1,2,0,0,1,0,0,0,0,1,1,0,0,0,1,1,1,1,1,1,1,1,1,0,0,0,1,0,0,0,.1,0,.9,.1,0,0,1,0,0,1,0,\
         0,1,0,1",
    )];
    let corners = ["0.5,0,0", "1,0,0", "0,1,0"];
    for k in 0..3 {
        let ends = format!("{},{}", corners[k], corners[(k + 1) % 3]);
        parts.push(made(110, &ends));
    }
    parts.push(made(102, "3,3,5,7"));
    parts.push(made(142, "1,1,0,9,2"));
    for part in &mut parts {
        part.status = "00010000";
    }
    parts.push(made(144, "1,1,0,11"));
    let (scene, warnings) = read(&parts);
    assert_eq!(warnings, [""; 0]);
    let area = scene.patches()[0].loops[0].signed_area();
    assert!((area.abs() - 0.5).abs() < 1e-6, "{area}");
}

#[test]
fn repairs_of_curves_that_are_only_compared_are_not_told() {
    // A curve of space with a negative set of weights, which the curves of the domain are beside.
    let mut entities = border();
    let mut parts = vec![square(3.0)];
    parts.push(made(
        126,
        "4,1,0,1,1,0,0.,0.,1.,2.,3.,4.,4.,-1.,-1.,-1.,-1.,-1.,3.,0.,0.,4.,0.,0.,4.,1.,0.,\
         3.,1.,0.,3.,0.,0.,0.,4.,0.,0.,1.",
    ));
    for mut part in parts {
        part.status = "00010000";
        entities.push(part);
    }
    entities.push(made(142, "1,11,9,13,1"));
    entities.push(made(144, "11,1,0,15"));
    let (scene, warnings) = read(&entities);
    assert_eq!(scene.patches()[0].loops.len(), 1);
    assert_eq!(warnings, [""; 0]);
}

/// A face of the unit square whose border is that of its domain, with the loop of some curves as a
/// hole.
fn with_hole(corners: &str) -> (kernel::Patch, Vec<String>) {
    let mut entities = vec![made(106, &format!("1,5,0.,{corners}"))];
    entities[0].form = 11;
    entities.push(square(3.0));
    for part in &mut entities {
        part.status = "00010000";
    }
    entities.push(made(142, "1,3,1,0,1"));
    entities.push(made(144, "3,0,1,0,5"));
    let (scene, warnings) = read(&entities);
    (scene.patches()[0].clone(), warnings)
}

#[test]
fn a_hole_that_is_the_border_counts_as_that() {
    let place = "line 9, trimmed surface D7 (type 144):";
    let (patch, warnings) = with_hole("1.,0.,1.,1.,0.,1.,0.,0.,1.,0.");
    assert!(patch.region().is_none_or(|region| region.is_whole()));
    let text = "a hole is the border of its surface; it counts as that";
    assert_eq!(warnings, [format!("{place} {text}")]);
    // Other holes stay.
    let (patch, warnings) = with_hole("0.5,0.,0.5,1.,0.,1.,0.,0.,0.5,0.");
    assert_eq!(warnings, [""; 0]);
    let region = patch.region().unwrap();
    let inside = [0.4, 0.6].map(|u| region.contains(DVec2::new(u, 0.5)));
    assert_eq!(inside, [false, true]);
    // A hole that leaves nothing cannot be meant.
    let (patch, warnings) = with_hole("2.,-1.,2.,2.,-1.,2.,-1.,-1.,2.,-1.");
    assert!(patch.loops.is_empty());
    let text = "trimmed surface is shown untrimmed: nothing is inside its trim loops";
    assert_eq!(warnings, [format!("{place} {text}")]);
}

#[test]
fn wide_gaps_in_narrow_loops_are_bridged_before_the_loops_are_given_up() {
    // As far apart as six hundredths of the width, and six ten thousandths of the length; ten times that.
    for (end, share) in [("0.06", "thousandth"), ("0.6", "hundredth")] {
        let mut entities = trimmed(&format!("0.,0.,0.,1.,{end},0."));
        let narrow = entities[5]
            .parameters
            .replace(",1.,0.,4.0,1.,0.,0.,1.", ",0.01,0.,4.0,0.01,0.,0.,1.");
        entities[5].parameters = narrow;
        let (scene, warnings) = read(&entities);
        assert_eq!(scene.patches()[0].loops.len(), 1);
        let text = format!(
            "the curves of a trim loop meet within a {share} of its surface only; the gaps are bridged"
        );
        assert!(warnings[0].ends_with(&text), "{warnings:?}");
    }
}

#[test]
fn curves_of_a_loop_may_be_listed_in_any_order() {
    let ends = [
        "0.25,0.25,0.,0.75,0.25,0.",
        "0.75,0.25,0.,0.75,0.75,0.",
        "0.75,0.75,0.,0.25,0.75,0.",
        "0.25,0.75,0.,0.25,0.25,0.",
    ];
    let area = |bounds: &[(i64, &str)]| {
        let mut entities = vec![square(0.0)];
        entities.extend([0, 3, 1, 2].map(|k| made(110, ends[k])));
        entities.push(made(102, "4,3,5,7,9"));
        for entity in &mut entities {
            entity.status = "00010000";
        }
        entities.extend(bounds.iter().map(|(kind, text)| made(*kind, text)));
        let (scene, warnings) = read(&entities);
        let text = "the curves of a trim loop are listed out of order; they are taken in the order \
                    in which they meet";
        assert!(
            warnings.len() == 1 && warnings[0].ends_with(text),
            "{warnings:?}"
        );
        kernel::Integrals::of(&scene.patches()[0], DVec3::ZERO).area()
    };
    let trimmed = (144, "1,1,0,13");
    let bounds = [
        [(142, "1,1,0,11,2"), trimmed],
        [(142, "1,1,11,0,1"), trimmed],
        [(141, "0,1,1,4,3,1,0,5,1,0,7,1,0,9,1,0"), (143, "0,1,1,13")],
        [(141, "1,2,1,1,0,1,4,3,5,7,9"), (143, "1,1,1,13")],
    ];
    for bounds in bounds {
        assert!((area(&bounds) - 0.25).abs() < 1e-9, "{bounds:?}");
    }
}

#[test]
fn small_gaps_in_loops_are_bridged() {
    let (scene, warnings) = read(&trimmed("0.,0.,0.,0.995,0.,0."));
    assert_eq!(scene.patches()[0].loops[0].segments().len(), 5);
    assert_eq!(
        warnings[0],
        "line 17, trimmed surface D15 (type 144): the curves of a trim loop do not quite meet; \
         the gaps are bridged"
    );
}

/// So many faces of one rough surface, each with the same curve of space, which goes up and down
/// around it; a loop in the parameter domain, too, if `is_flat`.
fn rough(count: usize, is_flat: bool) -> String {
    let list = |numbers: &[f64]| -> String { numbers.iter().map(|x| format!("{x:?},")).collect() };
    let knots: Vec<_> = (-3..=12).map(|k| f64::from(k.clamp(0, 9))).collect();
    let points: Vec<f64> = (0..144)
        .flat_map(|k| {
            let (i, j) = (k % 12, k / 12);
            let height = f64::from((i * 7 + j * 5) % 3) / 2.0;
            [f64::from(i) / 11.0, f64::from(j) / 11.0, height]
        })
        .collect();
    let corners: Vec<f64> = (0..=6)
        .flat_map(|k| {
            let angle = DVec2::from_angle(std::f64::consts::TAU / 6.0 * f64::from(k % 6));
            let height = 0.3 + 0.4 * f64::from(k % 2);
            [0.5 + 0.4 * angle.x, 0.5 + 0.4 * angle.y, height]
        })
        .collect();
    let (knots, ones) = (list(&knots), "1.,".repeat(144));
    let surface = format!(
        "11,11,3,3,0,0,1,0,0,{knots}{knots}{ones}{}0.,9.,0.,9.",
        list(&points)
    );
    let mut entities = vec![
        made(128, &surface),
        made(
            106,
            &format!("2,7,{}", list(&corners).trim_end_matches(',')),
        ),
        made(106, "1,5,0.,2.,2.,7.,2.,7.,7.,2.,7.,2.,2."),
    ];
    entities[1].form = 12;
    entities[2].form = 11;
    for part in &mut entities {
        part.status = "00010000";
    }
    let flat = if is_flat { 5 } else { 0 };
    for k in 0..count {
        let mut curve = made(142, &format!("1,1,{flat},3,2"));
        curve.status = "00010000";
        entities.push(curve);
        entities.push(made(144, &format!("1,1,0,{}", 4 * k + 7)));
    }
    file(&entities)
}

/// What is read where so much work is allowed for each card.
fn laid(text: &str, laying: usize) -> Import {
    let limits = Limits {
        laying,
        ..Limits::default()
    };
    read_within(text, &limits).unwrap()
}

#[test]
fn thousands_of_curves_off_their_faces_are_laid_until_the_work_is_spent() {
    const WHY: &str = "laying curves of space onto surfaces takes more work than a file of this size \
                       may ask for";
    let few = laid(&rough(1, false), 10_000);
    let loops = &few.scene.patches()[0].loops;
    assert_eq!(loops.len(), 1);
    for (is_flat, text) in [
        (false, "trimmed surface is shown untrimmed"),
        (true, "a trim loop is made of other curves of the file"),
    ] {
        let text = format!("{text}: {WHY}");
        let import = laid(&rough(3000, is_flat), 1000);
        let patches = import.scene.patches();
        assert_eq!(patches.len(), 3000);
        let count = patches.iter().filter(|p| &p.loops == loops).count();
        assert!((1..100).contains(&count), "{count} faces are laid");
        let others = patches[count..].iter();
        assert!(
            others
                .clone()
                .all(|p| p.loops.len() == usize::from(is_flat))
        );
        let told = import.warnings.as_slice().iter();
        let mut told = told.filter(|told| told.problem == Problem::Unsupported(text.clone()));
        let told = told.next().unwrap();
        assert_eq!(told.count, 3000 - count);
        let first = format!("trimmed surface D{} (type 144)", 4 * count + 9);
        assert_eq!(told.places[0].what, first);
    }
}
