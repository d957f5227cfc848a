//! Surfaces of all types, and faces on them, made for the purpose.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec2, DVec3};
use kernel::Patch;

use super::testing::{Made, formed, made, part, read, shows};

/// The only patch.
fn patch(entities: &[Made]) -> Patch {
    let (scene, warnings) = read(entities);
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(scene.patches().len(), 1);
    scene.patches()[0].clone()
}

#[test]
fn a_plane_between_edges() {
    let patch = patch(&[
        part(116, 0, "1.,1.,5."),
        part(123, 0, "0.,0.,1."),
        part(190, 0, "1,3"),
        part(110, 0, "0.,0.,5.,4.,0.,5."),
        part(110, 0, "0.,3.,5.,4.,0.,5."),
        part(110, 0, "0.,3.,5.,0.,0.,5."),
        part(502, 1, "3,0.,0.,5.,4.,0.,5.,0.,3.,5."),
        part(504, 1, "3,7,13,1,13,2,9,13,3,13,2,11,13,3,13,1"),
        part(508, 1, "3,0,15,1,1,0,0,15,2,0,0,0,15,3,1,0"),
        part(510, 1, "5,1,1,17"),
        formed(514, 2, "1,19,1"),
    ]);
    for (x, y, is_in) in [
        (0.1, 0.1, true),
        (1.9, 1.4, true),
        (2.1, 1.6, false),
        (3.9, 0.01, true),
    ] {
        assert_eq!(shows(&patch, DVec3::new(x, y, 5.0)), is_in, "{x} {y}");
    }
    assert_eq!(patch.loops[0].segments().len(), 3);
}

#[test]
fn a_closed_edge_that_begins_elsewhere_than_at_its_vertex() {
    // The tip of a pyramid above an edge around it, with an edge from there to the apex and back.
    let patch = patch(&[
        part(
            128,
            0,
            "1,4,1,1,0,1,1,0,0,0.,0.,1.,1.,0.,0.,1.,2.,3.,4.,4.,1.,1.,1.,1.,1.,1.,1.,1.,1.,1.,\
             2.,0.,0.,0.,0.,2.,0.,2.,0.,0.,0.,2.,-2.,0.,0.,0.,0.,2.,0.,-2.,0.,0.,0.,2.,\
             2.,0.,0.,0.,0.,2.,0.,1.,0.,4.",
        ),
        part(
            126,
            0,
            "4,1,0,1,1,0,0.,0.,1.,2.,3.,4.,4.,1.,1.,1.,1.,1.,-1.,0.,1.,0.,1.,1.,1.,0.,1.,\
             0.,-1.,1.,-1.,0.,1.,0.,4.,0.,0.,1.",
        ),
        part(110, 0, "1.,0.,1.,0.,0.,2."),
        part(502, 1, "2,1.,0.,1.,0.,0.,2."),
        part(504, 1, "2,3,7,1,7,1,5,7,1,7,2"),
        part(508, 1, "3,0,9,1,1,0,0,9,2,1,0,0,9,2,0,0"),
        part(510, 1, "1,1,1,11"),
        formed(514, 2, "1,13,1"),
    ]);
    for (x, y, z, is_in) in [
        (0.25, 0.25, 1.5, true),
        (-0.4, 0.3, 1.3, true),
        (0.3, -0.6, 1.1, true),
        (0.75, 0.75, 0.5, false),
        (-0.6, -0.5, 0.9, false),
    ] {
        assert_eq!(shows(&patch, DVec3::new(x, y, z)), is_in, "{x} {y} {z}");
    }
}

#[test]
fn a_loop_over_the_seam_of_a_surface_of_which_less_is_wanted() {
    // The sides of a pyramid, of which half a side is not wanted, and a loop on the side beyond and the one before.
    let pyramid = "1,4,1,1,0,1,1,0,0,0.,0.,1.,1.,0.,0.,1.,2.,3.,4.,4.,1.,1.,1.,1.,1.,1.,1.,1.,1.,1.,\
                   2.,0.,0.,0.,0.,2.,0.,2.,0.,0.,0.,2.,-2.,0.,0.,0.,0.,2.,0.,-2.,0.,0.,0.,2.,\
                   2.,0.,0.,0.,0.,2.,0.,1.,0.5,4.";
    let around = "4,1,0,1,1,0,0.,0.,1.,2.,3.,4.,4.,1.,1.,1.,1.,1.,0.2,3.4,0.,0.8,3.4,0.,0.8,4.6,0.,\
                  0.2,4.6,0.,0.2,3.4,0.,0.,4.,0.,0.,1.";
    let patch = patch(&[
        part(128, 0, pyramid),
        part(126, 0, around),
        part(142, 0, "1,1,3,0,1"),
        made(144, "1,1,0,5"),
    ]);
    for (x, y, z, is_in) in [
        (0.9, -0.1, 1.0, true),
        (0.9, 0.1, 1.0, true),
        (0.5, 0.5, 1.0, true),
        (0.3, 0.7, 1.0, false),
        (-0.5, 0.5, 1.0, false),
        (0.1, 0.1, 1.8, false),
    ] {
        assert_eq!(shows(&patch, DVec3::new(x, y, z)), is_in, "{x} {y} {z}");
    }
}

/// A face on a surface of the entities before, between circles of radius 2 around the z axis
/// at heights, each run through forwards or backwards.
fn between_circles(surface: &[Made], circles: &[(f64, bool)]) -> Patch {
    let mut entities: Vec<Made> = Vec::new();
    for made in surface {
        entities.push(Made {
            parameters: made.parameters.clone(),
            ..part(made.kind, made.form, "")
        });
    }
    let next = |entities: &[Made]| 2 * entities.len() + 1;
    let base = next(&entities) - 2;
    let first = next(&entities);
    for (height, _) in circles {
        entities.push(part(100, 0, &format!("{height:?},0.,0.,2.,0.,2.,0.")));
    }
    let vertices = next(&entities);
    entities.push(part(502, 1, "1,2.,0.,0."));
    let edges = next(&entities);
    let uses = (0..circles.len()).map(|k| format!(",{},{vertices},1,{vertices},1", first + 2 * k));
    entities.push(part(
        504,
        1,
        &format!("{}{}", circles.len(), uses.collect::<String>()),
    ));
    let loops = next(&entities);
    for (k, (_, forwards)) in circles.iter().enumerate() {
        let sense = i32::from(*forwards);
        entities.push(part(508, 1, &format!("1,0,{edges},{},{sense},0", k + 1)));
    }
    let pointers = (0..circles.len()).map(|k| format!(",{}", loops + 2 * k));
    let pointers: String = pointers.collect();
    entities.push(formed(
        510,
        1,
        &format!("{base},{},1{pointers}", circles.len()),
    ));
    patch(&entities)
}

fn at(radius: f64, angle: f64, height: f64) -> DVec3 {
    (DVec2::from_angle(angle) * radius).extend(height)
}

#[test]
fn bands_of_cylinders_and_cones() {
    let axis = || vec![part(116, 0, "0.,0.,0."), part(123, 0, "0.,0.,2.")];
    let cylinder = [axis(), vec![part(192, 0, "1,3,2.")]].concat_made();
    let band = between_circles(&cylinder, &[(1.0, true), (3.0, false)]);
    let cone = [axis(), vec![part(194, 0, "1,3,3.,45.")]].concat_made();
    // At the height -1 the radius is 2; at -5 it is 2 again, beyond the apex at -3.
    let tip = between_circles(&cone, &[(-1.0, false)]);
    let mirrored = between_circles(&cone, &[(-5.0, true)]);
    for k in 0..12 {
        let angle = f64::from(k) * 0.5 + 0.1;
        assert!(shows(&band, at(2.0, angle, 2.0)));
        assert!(!shows(&band, at(2.0, angle, 0.999)) && !shows(&band, at(2.0, angle, 3.001)));
        assert!(shows(&tip, at(1.9, angle, -1.1)) && !shows(&tip, at(2.0005, angle, -0.9995)));
        assert!(shows(&mirrored, at(1.9, angle, -4.9)), "{angle}");
    }
}

/// Lists of made entities in one.
trait ConcatMade {
    fn concat_made(self) -> Vec<Made>;
}

impl ConcatMade for [Vec<Made>; 2] {
    fn concat_made(self) -> Vec<Made> {
        self.into_iter().flatten().collect()
    }
}

#[test]
fn caps_of_spheres_are_to_the_left_of_their_circles() {
    let sphere = [
        part(116, 0, "0.,0.,1."),
        part(196, 0, "1,2.8284271247461903"),
    ];
    let north = between_circles(&sphere, &[(3.0, true)]);
    let south = between_circles(&sphere, &[(3.0, false)]);
    let top = DVec3::new(0.0, 0.0, 1.0 + 8.0_f64.sqrt());
    assert!(shows(&north, top) && !shows(&south, top));
    let bottom = DVec3::new(0.0, 0.0, 1.0 - 8.0_f64.sqrt());
    assert!(shows(&south, bottom) && !shows(&north, bottom));
}

#[test]
fn tubes_of_tori_between_two_circles() {
    let torus = [
        part(116, 0, "0.,0.,0."),
        part(123, 0, "0.,0.,1."),
        part(198, 0, "1,3,2.,1."),
    ];
    // The circles at the top and bottom of the tube bound its outer and its inner half.
    let outer = between_circles(&torus, &[(-1.0, true), (1.0, false)]);
    let inner = between_circles(&torus, &[(-1.0, false), (1.0, true)]);
    assert!(shows(&outer, at(3.0, 1.0, 0.0)) && !shows(&outer, at(1.0, 1.0, 0.0)));
    assert!(shows(&inner, at(1.0, 1.0, 0.0)) && !shows(&inner, at(3.0, 1.0, 0.0)));
}

#[test]
fn a_vertex_loop_keeps_the_whole_sphere() {
    let patch = patch(&[
        part(116, 0, "0.,0.,0."),
        part(196, 0, "1,2."),
        part(502, 1, "1,0.,0.,2."),
        part(508, 1, "1,1,5,1,0,0"),
        formed(510, 1, "3,1,1,7"),
    ]);
    assert!(patch.loops.is_empty());
    assert!(shows(&patch, DVec3::X * 2.0));
}

#[test]
fn angles_of_revolutions_are_those_of_the_file() {
    // A quarter of a tube turned around the z axis, trimmed at 1 radian of both angles; the
    // angle along the tube is given a turn too far.
    let lines = [
        [0.0, 0.0, 1.0, 0.0],
        [1.0, 0.0, 1.0, 1.0],
        [1.0, 1.0, 0.0, 1.0],
        [0.0, 1.0, 0.0, 0.0],
    ];
    let mut entities = vec![
        part(110, 0, "0.,0.,0.,0.,0.,1."),
        Made {
            transform: 5,
            ..part(100, 0, "0.,3.,0.,4.,0.,3.,1.")
        },
        part(124, 0, "1.,0.,0.,0.,0.,0.,-1.,0.,0.,1.,0.,0."),
        part(120, 0, "1,3,0.,3."),
    ];
    for [a, b, c, d] in lines {
        let (a, c) = (a + 2.0 * PI, c + 2.0 * PI);
        entities.push(Made {
            status: "00010500",
            ..made(110, &format!("{a:?},{b:?},0.,{c:?},{d:?},0."))
        });
    }
    entities.push(Made {
        status: "00010500",
        ..made(102, "4,9,11,13,15")
    });
    entities.push(part(142, 0, "0,7,17,0,1"));
    entities.push(made(144, "7,1,0,19"));
    let patch = patch(&entities);
    let on = |tube: f64, turn: f64| at(3.0 + tube.cos(), turn, tube.sin());
    for (tube, turn, is_in) in [
        (0.999, 0.5, true),
        (1.001, 0.5, false),
        (0.5, 0.999, true),
        (0.5, 1.001, false),
        (0.001, 0.001, true),
    ] {
        assert_eq!(shows(&patch, on(tube, turn)), is_in, "{tube} {turn}");
    }
    assert!(patch.loops[0].segments().iter().all(|c| c.degree() == 1));
}

#[test]
fn curves_over_a_pole_bound_half_a_cap() {
    // A sphere turned around the z axis; an arc over its pole, in one part or in two that meet
    // there, and half a circle of latitude.
    let upright = |parameters: &str| Made {
        transform: 5,
        ..part(100, 0, parameters)
    };
    let [right, left] = ["1.7320508075688772", "-1.7320508075688772"];
    for (first, second, composite) in [
        (format!("{right},1.,{left},1."), "0.,2.,0.,2.", "2,9,13"),
        (
            format!("{right},1.,0.,2."),
            "0.,2.,-1.7320508075688772,1.",
            "3,9,11,13",
        ),
    ] {
        let patch = patch(&[
            part(110, 0, "0.,0.,0.,0.,0.,1."),
            upright("0.,0.,0.,0.,-2.,0.,2."),
            part(124, 0, "1.,0.,0.,0.,0.,0.,-1.,0.,0.,1.,0.,0."),
            part(120, 0, "1,3,0.,6.283185307179586"),
            upright(&format!("0.,0.,0.,{first}")),
            upright(&format!("0.,0.,0.,{second}")),
            part(100, 0, &format!("1.,0.,0.,{left},0.,{right},0.")),
            part(102, 0, composite),
            part(142, 0, "0,7,0,15,2"),
            made(144, "7,1,0,17"),
        ]);
        for (x, y, z, is_in) in [
            (0.0, -1.2, 1.6, true),
            (1.2, -0.1, 1.59, true),
            (-1.2, -0.1, 1.59, true),
            (0.0, 1.2, 1.6, false),
            (0.0, -1.9, 0.5, false),
        ] {
            let point = DVec3::new(x, y, z).normalize() * 2.0;
            assert_eq!(shows(&patch, point), is_in, "{point} {composite}");
        }
        let segments = patch.loops[0].segments();
        assert!(segments.iter().all(|c| c.degree() == 1), "{composite}");
    }
}

#[test]
fn bounded_planes_end_at_their_curve() {
    let patch = patch(&[
        part(100, 0, "2.,0.,0.,3.,0.,3.,0."),
        formed(108, 1, "0.,0.,2.,4.,1,0.,0.,0.,0."),
    ]);
    assert!(shows(&patch, DVec3::new(2.0, 2.2, 2.0)));
    assert!(!shows(&patch, DVec3::new(2.2, 2.2, 2.0)));
    let (scene, warnings) = read(&[made(108, "0.,0.,2.,4.,0,0.,0.,0.,0.")]);
    assert!(scene.patches().is_empty());
    assert!(warnings[0].contains("no end"), "{warnings:?}");
}

#[test]
fn planes_without_anything_inside_their_loops_are_not_shown() {
    for line in ["0.,0.,2.,4.,3.,2.", "1.,1.,2.,4.,1.,2."] {
        let (scene, warnings) = read(&[
            part(110, 0, line),
            part(106, 12, "2,2,0.,0.,2.,0.,0.,2."),
            part(102, 0, "2,1,1"),
            formed(108, 1, "0.,0.,1.,2.,5,0.,0.,0.,0."),
        ]);
        assert!(scene.patches().is_empty());
        let text = "line 9, plane D7 (type 108): nothing is inside its trim loops, and it has no \
                    border of its own; it is not shown";
        assert_eq!(warnings[0], text);
    }
}

#[test]
fn holes_of_what_has_no_end_are_its_border() {
    let corners = "0.,0.,4.,0.,4.,3.,0.,3.,0.,0.";
    let (scene, warnings) = read(&[
        part(106, 11, &format!("1,5,2.,{corners}")),
        part(108, 0, "0.,0.,1.,2.,0,0.,0.,0.,0."),
        part(142, 0, "0,3,0,1,2"),
        made(144, "3,0,1,0,5"),
    ]);
    assert!(shows(&scene.patches()[0], DVec3::new(1.0, 2.0, 2.0)));
    let text = "line 9, trimmed surface D7 (type 144): its surface has no end; its outermost hole \
                counts as its border";
    assert_eq!(warnings, [text]);
}

#[test]
fn trims_of_space_are_laid_onto_free_surfaces() {
    // z = x y over the unit square, cut by a circle above it; and curves in the parameter
    // domain that are somewhere else.
    let saddle = "1,1,1,1,0,0,1,0,0,0.,0.,1.,1.,0.,0.,1.,1.,1.,1.,1.,1.,\
                  0.,0.,0.,1.,0.,0.,0.,1.,0.,1.,1.,1.,0.,1.,0.,1.";
    for (pcurve, told) in [("0", 1), ("5", 2)] {
        let (scene, warnings) = read(&[
            part(128, 0, saddle),
            part(100, 0, "0.25,0.5,0.5,0.8,0.5,0.8,0.5"),
            Made {
                status: "00010500",
                ..made(106, "1,4,0.,9.,9.,8.,9.,8.,8.,9.,9.")
            },
            part(142, 0, &format!("0,1,{pcurve},3,1")),
            made(144, "1,1,0,7"),
        ]);
        assert_eq!(warnings.len(), told, "{warnings:?}");
        assert!(warnings[told - 1].contains("a trim curve is off its surface by up to 2e-1"));
        let patch = &scene.patches()[0];
        assert!(shows(patch, DVec3::new(0.5, 0.5, 0.25)));
        assert!(shows(patch, DVec3::new(0.7, 0.5, 0.35)));
        assert!(!shows(patch, DVec3::new(0.9, 0.5, 0.45)));
    }
}

#[test]
fn curves_are_laid_onto_the_right_side_of_a_surface_that_meets_itself() {
    // A sheet over a line that comes back down through its first stretch, from either end, cut by a square around
    // where it does.
    let line = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0], [2.0, -2.0]];
    for is_reversed in [false, true] {
        let mut corners = line;
        if is_reversed {
            corners.reverse();
        }
        let row = |y: f64| corners.map(|[x, z]| format!("{x},{y}.,{z},")).concat();
        let ones = "1.,".repeat(10);
        let sheet = format!(
            "4,1,1,1,0,0,1,0,0,0.,0.,1.,2.,3.,4.,4.,0.,0.,1.,1.,{ones}{}{}0.,4.,0.,1.",
            row(0.0),
            row(1.0)
        );
        let side = |a: [f64; 2], b: [f64; 2]| {
            part(
                110,
                0,
                &format!("{},{},0.,{},{},0.", a[0], a[1], b[0], b[1]),
            )
        };
        let square = [[1.0, 0.25], [3.0, 0.25], [3.0, 0.75], [1.0, 0.75]];
        let (scene, warnings) = read(&[
            part(128, 0, &sheet),
            side(square[0], square[1]),
            side(square[1], square[2]),
            side(square[2], square[3]),
            side(square[3], square[0]),
            part(102, 0, "4,3,5,7,9"),
            part(142, 0, "0,1,0,11,2"),
            made(144, "1,1,0,13"),
        ]);
        assert_eq!(warnings, [""; 0]);
        let patch = &scene.patches()[0];
        assert!(shows(patch, DVec3::new(2.5, 0.5, 0.0)));
        assert!(!shows(patch, DVec3::new(3.5, 0.5, 0.0)));
        assert!(!shows(patch, DVec3::new(2.0, 0.5, 1.0)));
    }
}

#[test]
fn a_loop_of_a_seam_alone_cuts_nothing_off() {
    let (scene, warnings) = read(&[
        part(116, 0, "0.,0.,0."),
        part(123, 0, "0.,0.,1."),
        part(192, 0, "1,3,1."),
        part(110, 0, "1.,0.,0.,1.,0.,1."),
        part(502, 1, "2,1.,0.,0.,1.,0.,1."),
        part(504, 1, "1,7,9,1,9,2"),
        part(508, 1, "2,0,11,1,1,0,0,11,1,0,0"),
        made(510, "5,1,1,13"),
    ]);
    assert!(warnings[0].contains("nothing is inside"), "{warnings:?}");
    let patch = &scene.patches()[0];
    assert!(shows(patch, DVec3::new(-1.0, 0.0, 0.5)));
}

#[test]
fn swept_and_spline_surfaces_have_their_points() {
    let line = || part(110, 0, "0.,0.,0.,2.,0.,0.");
    let cylinder = patch(&[line(), made(122, "1,0.,3.,1.")]);
    let point = cylinder.surface.evaluate(DVec2::new(0.5, 0.5));
    assert!(point.distance(DVec3::new(1.0, 1.5, 0.5)) < 1e-15);
    // The second rail is reversed and has another height.
    let ruled = patch(&[
        line(),
        part(110, 0, "4.,1.,1.,0.,1.,1."),
        formed(118, 1, "1,3,1,0"),
    ]);
    let point = ruled.surface.evaluate(DVec2::new(0.25, 0.5));
    assert!(
        point.distance(DVec3::new(0.75, 0.5, 0.5)) < 1e-15,
        "{point}"
    );
    // Beside an arc, equal shares of its angle and of the line are joined.
    let (beside, warnings) = read(&[
        part(100, 0, "0.,0.,0.,1.,0.,0.,1."),
        part(110, 0, "3.,0.,1.,0.,3.,1."),
        made(118, "1,3,0,0"),
    ]);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    for u in [0.0, 0.1, 0.3, 0.5, 0.8, 1.0] {
        let surface = &beside.patches()[0].surface;
        let [arc, line] = [0.0, 1.0].map(|v| surface.evaluate(DVec2::new(u, v)));
        let share = arc.y.atan2(arc.x) / FRAC_PI_2;
        assert!((line.y / 3.0 - share).abs() < 1e-8, "{u}: {share} {line}");
    }
    // x = s, y = t, z = s t^2 over 0..2 and 1..2, in one piece, with a dummy block.
    let mut coefficients = vec![0.0; 48];
    coefficients[1] = 1.0;
    coefficients[16 + 4] = 1.0;
    coefficients[32 + 9] = 1.0;
    coefficients.extend([7.0; 48]);
    let list: Vec<_> = coefficients.iter().map(|c| format!("{c:?}")).collect();
    let cubic = patch(&[made(
        114,
        &format!("3,1,1,1,0.,2.,1.,2.,{}", list.join(",")),
    )]);
    let point = cubic.surface.evaluate(DVec2::new(1.5, 1.5));
    assert!(
        point.distance(DVec3::new(1.5, 0.5, 1.5 * 0.25)) < 1e-14,
        "{point}"
    );
}

#[test]
fn offset_surfaces_are_as_far_as_the_file_says() {
    let sphere = [
        part(116, 0, "0.,0.,0."),
        part(196, 0, "1,2."),
        made(140, "0.,0.,1.,0.5,3"),
    ];
    let (scene, _) = read(&sphere);
    let point = scene.patches()[0].surface.evaluate(DVec2::new(1.0, 0.5));
    assert!((point.length() - 2.5).abs() < 1e-14);
    let saddle = "1,1,1,1,0,0,1,0,0,0.,0.,1.,1.,0.,0.,1.,1.,1.,1.,1.,1.,\
                  0.,0.,0.,1.,0.,0.,0.,1.,0.,1.,1.,1.,0.,1.,0.,1.";
    let (scene, warnings) = read(&[part(128, 0, saddle), made(140, "0.,0.,-1.,0.5,1")]);
    assert!(warnings[0].contains("fitted"), "{warnings:?}");
    let surface = &scene.patches()[0].surface;
    for (u, v) in [(0.13, 0.77), (0.5, 0.21), (0.9, 0.95)] {
        let normal = DVec3::new(-v, -u, 1.0).normalize();
        let expected = DVec3::new(u, v, u * v) - normal * 0.5;
        let off = surface.evaluate(DVec2::new(u, v)).distance(expected);
        assert!(off < 1e-5, "{u} {v}: {off:e}");
    }
}

#[test]
fn free_curves_and_points_are_kept() {
    let (scene, warnings) = read(&[
        made(100, "1.,0.,0.,1.,0.,0.,1."),
        made(116, "1.,2.,3."),
        formed(106, 2, "2,2,0.,0.,0.,1.,1.,1."),
        made(102, "2,9,11"),
        part(110, 0, "0.,0.,0.,1.,0.,0."),
        part(110, 0, "1.,0.,0.,1.,1.,0."),
        made(130, "1,1,0,0,0,0.5,0.,0.,0.,0.,0.,1.,0.,0."),
    ]);
    assert_eq!(scene.wires().len(), 5);
    assert_eq!(
        warnings,
        ["the file: there is no surface to show, only curves and points"]
    );
    // The arc that is offset belongs to the offset curve; inwards is to its left.
    let kernel::WireShape::Curve(offset) = &scene.wires()[4].shape else {
        panic!("a curve");
    };
    let middle = offset.evaluate(f64::midpoint(offset.domain().start, offset.domain().end));
    let expected = at(0.5, FRAC_PI_2 / 2.0, 1.0);
    assert!(middle.distance(expected) < 1e-15, "{middle}");
}
