use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DVec2, DVec3};
use kernel::{Child, Item, Node, Patch, Shape, Surface, modelling};

mod closing;
mod round;
mod sewing;
mod uneven;

use super::trail::Trail;
use super::*;

/// A scene that shows patches as they are.
pub(super) fn scene(patches: Vec<Patch>) -> Scene {
    let count = patches.len();
    shown(patches, &[(DVec3::ZERO, count)])
}

/// A scene that shows the first patches of a list at every place, each time as many as stand there.
fn shown(patches: Vec<Patch>, places: &[(DVec3, usize)]) -> Scene {
    let mut scene = Scene::default();
    let add = |patch| scene.add_patch(patch).unwrap();
    let ids: Vec<_> = patches.into_iter().map(add).collect();
    let mut root = Node::default();
    for &(place, count) in places {
        let item = |&id| {
            Child::Item(Item {
                shape: Shape::Patch(id),
                material: None,
            })
        };
        let node = Node {
            parent_from_node: DAffine3::from_translation(place),
            children: ids[..count].iter().map(item).collect(),
            ..Node::default()
        };
        root.children
            .push(Child::Node(scene.add_node(node).unwrap()));
    }
    let root = scene.add_node(root).unwrap();
    scene.set_root(root).unwrap();
    scene
}

fn with_tolerance(surface: Surface, length: f64) -> Tessellation {
    with_tolerance_of(vec![surface.into()], length)
}

fn with_tolerance_of(patches: Vec<Patch>, length: f64) -> Tessellation {
    let options = TessellateOptions {
        tolerance: Tolerance::Length(length),
        angle: PI,
        ..TessellateOptions::default()
    };
    tessellate(&scene(patches), &options).unwrap()
}

/// A unit cube from six planes, each in directions of its own.
fn cube() -> Vec<Patch> {
    let plane = |origin: DVec3, u: DVec3, v: DVec3| -> Patch {
        modelling::plane(origin, u, v, 0.0..1.0, 0.0..3.0)
            .unwrap()
            .into()
    };
    let (x, y, z, far) = (DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE);
    vec![
        plane(DVec3::ZERO, x, y),
        plane(DVec3::ZERO, y, z),
        plane(DVec3::ZERO, x, z),
        plane(far, -x, -y),
        plane(far, -y, -z),
        plane(far, -z, -x),
    ]
}

#[test]
fn known_bodies_use_most_of_the_tolerance_and_never_more() {
    for body in bodies() {
        for tolerance in [0.1, 0.01, 0.001, 0.0001] {
            let result = with_tolerance(body.surface.clone(), tolerance);
            let face = result.faces[0].as_ref().unwrap();
            assert!(
                face.proven <= tolerance && face.unproven == 0,
                "{}",
                body.name
            );
            assert!(face.sampled <= face.proven, "{}", body.name);
            assert!(
                face.sampled >= 0.3 * tolerance,
                "{}: {}",
                body.name,
                face.sampled
            );
        }
    }
}

#[test]
fn closed_surfaces_are_closed_meshes() {
    for body in bodies() {
        let shell = &with_tolerance(body.surface.clone(), 0.01).shells[0];
        assert_eq!(shell.is_closed(), body.volume.is_some());
        assert_eq!(shell.euler, body.euler, "{}", body.name);
        assert_eq!((shell.crowded, shell.twisted), (0, 0));
    }
}

#[test]
fn area_and_volume_converge_as_fast_as_the_tolerance() {
    for body in bodies() {
        let errors = [0.01, 0.001].map(|tolerance| {
            let shell = with_tolerance(body.surface.clone(), tolerance)
                .shells
                .remove(0);
            let volume = body
                .volume
                .map_or(0.0, |exact| (exact - shell.volume).abs());
            // No more than a layer as thick as the tolerance.
            assert!(volume <= body.area * tolerance, "{}: {volume}", body.name);
            [(body.area - shell.area).abs(), volume]
        });
        for (coarse, fine) in errors[0].iter().zip(errors[1]).filter(|e| *e.0 > 0.0) {
            let ratio = coarse / fine;
            assert!((5.0..20.0).contains(&ratio), "{}: {ratio}", body.name);
        }
    }
}

#[test]
fn a_cylinder_has_no_more_sides_than_its_sagitta_asks_for() {
    let tolerance = 0.001;
    let cylinder = bodies().remove(1).surface;
    let result = with_tolerance(cylinder, tolerance);
    // A chord over the angle a has the sagitta 1 - cos(a / 2).
    let least = (TAU / (2.0 * (1.0 - tolerance).acos())).ceil();
    let triangles = result.faces[0].as_ref().unwrap().mesh.triangles().len() as f64;
    assert!(
        (2.0 * least..2.3 * least).contains(&triangles),
        "{triangles} for {least}"
    );
}

#[test]
fn normals_turn_by_no_more_than_the_angle_over_more_than_the_tolerance() {
    for body in bodies() {
        for tolerance in [0.3, 0.03] {
            let options = TessellateOptions {
                tolerance: Tolerance::Length(tolerance),
                ..TessellateOptions::default()
            };
            let result = tessellate(&scene(vec![body.surface.clone().into()]), &options).unwrap();
            let face = result.faces[0].as_ref().unwrap();
            assert_eq!(face.unproven, 0, "{}", body.name);
            let (points, normals) = (face.mesh.positions(), face.mesh.normals());
            for &[a, b, c] in face.mesh.triangles() {
                for [p, q] in [[a, b], [b, c], [c, a]].map(|ends| ends.map(|k| k as usize)) {
                    // Normals of poles are limits from one side.
                    let is_pole = |k: usize| {
                        let uv = face.parameters[k];
                        body.surface.point_and_regular_normal(uv).1.is_none()
                    };
                    if is_pole(p) || is_pole(q) {
                        continue;
                    }
                    let angle = normals[p].angle_between(normals[q]);
                    let turned = normals[q] - normals[p];
                    let across = (points[q] - points[p]).dot(turned.normalize_or_zero());
                    let fits = angle <= 1.03 * options.angle || across.abs() <= tolerance;
                    assert!(fits, "{}: {angle} over {across}", body.name);
                }
            }
        }
    }
}

#[test]
fn seams_keep_to_the_angle_from_their_poles_on() {
    let ball = bodies().swap_remove(0);
    let options = TessellateOptions {
        tolerance: Tolerance::Length(0.05),
        angle: 5.0_f64.to_radians(),
        ..TessellateOptions::default()
    };
    let result = tessellate(&scene(vec![ball.surface.into()]), &options).unwrap();
    let mesh = &result.faces[0].as_ref().unwrap().mesh;
    let points = mesh.positions();
    let sides = mesh
        .triangles()
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let angles = sides.map(|ends| {
        let [p, q] = ends.map(|k| points[k as usize]);
        p.angle_between(q)
    });
    let most = angles.fold(0.0, f64::max);
    assert!(most <= 1.03 * options.angle, "{}", most.to_degrees());
}

#[test]
fn a_long_thin_cylinder_is_divided_across_only() {
    for radius in [10.0, 1.0, 0.1] {
        let frame = &modelling::Frame::WORLD;
        let wire = modelling::cylinder(frame, radius, 0.0..TAU, 0.0..1000.0).unwrap();
        let result = tessellate(&scene(vec![wire.into()]), &TessellateOptions::default()).unwrap();
        let count = result.faces[0].as_ref().unwrap().mesh.triangles().len();
        assert!(count <= 60, "{count} triangles of a radius of {radius}");
    }
}

/// A circle around a place of the first axis of the parameters.
fn round(center: f64, radius: f64) -> kernel::TrimLoop {
    let frame = modelling::Frame::about(DVec3::X * center, DVec3::Z).unwrap();
    let circle = modelling::circle(&frame, radius).unwrap();
    let points: Vec<DVec2> = circle.points().map(DVec3::truncate).collect();
    let weights: Vec<f64> = circle.weights().collect();
    let flat = kernel::Curve::new(circle.knots().clone(), &points, Some(&weights)).unwrap();
    kernel::TrimLoop::new(vec![flat], 1e-12).unwrap()
}

#[test]
fn a_loop_may_touch_the_border_of_its_domain() {
    // A disc in the square around it, which touches the sides in their middles.
    let square = modelling::plane(
        DVec3::new(-1.0, -1.0, 0.0),
        DVec3::X * 2.0,
        DVec3::Y * 2.0,
        -1.0..1.0,
        -1.0..1.0,
    );
    let mut face: Patch = square.unwrap().into();
    for turned in [round(0.0, 1.0), round(0.0, 1.0).reversed()] {
        face.loops = vec![turned];
        let result = tessellate(&scene(vec![face.clone()]), &TessellateOptions::default()).unwrap();
        let shell = &result.shells[0];
        assert!((PI - 0.02..PI).contains(&shell.area), "{}", shell.area);
    }
}

#[test]
fn loops_may_have_numbers_that_are_next_to_nothing() {
    let square = modelling::plane(DVec3::ZERO, DVec3::X, DVec3::Y, -1.0..1.0, -1.0..1.0);
    let mut face: Patch = square.unwrap().into();
    for tiny in [1e-30, 1e-45, 1e-60, 1e-200] {
        let corners = [
            [-0.5, 0.0],
            [0.0, tiny],
            [0.5, -tiny],
            [tiny, 0.5],
            [-0.5, 0.0],
        ];
        let line = |w: &[[f64; 2]]| kernel::Curve::line(w[0].into(), w[1].into(), 0.0..1.0);
        let sides = corners.windows(2).map(|w| line(w).unwrap()).collect();
        face.loops = vec![kernel::TrimLoop::new(sides, 0.0).unwrap()];
        let result = tessellate(&scene(vec![face.clone()]), &TessellateOptions::default()).unwrap();
        let shell = &result.shells[0];
        assert!((shell.area - 0.0625).abs() < 1e-9, "{tiny}: {}", shell.area);
        assert_eq!(shell.naked, 4, "{tiny}");
    }
}

/// A square of parameters.
fn around(low: f64, high: f64) -> kernel::TrimLoop {
    let corners = [
        [low, low],
        [high, low],
        [high, high],
        [low, high],
        [low, low],
    ];
    let outline = kernel::Curve::polyline(&corners.map(DVec2::from_array)).unwrap();
    kernel::TrimLoop::new(vec![outline], 1e-12).unwrap()
}

#[test]
fn boundaries_that_cross_meet_in_points() {
    let side = 2.0 * DVec3::ONE;
    let square = modelling::plane(
        -0.5 * side,
        side * DVec3::X,
        side * DVec3::Y,
        -1.0..1.0,
        -1.0..1.0,
    );
    let mut face: Patch = square.unwrap().into();
    // Two squares that overlap in a corner, and two that touch in one; two discs.
    let squares = |low: f64| vec![around(-0.8, 0.8), around(0.2, 0.5), around(low, 0.7)];
    let lens = 0.5 * 0.5_f64.acos() - 0.25 * 0.75_f64.sqrt();
    let cases = [
        (squares(0.4), 2.56 - 0.09 - 0.09 + 0.02, 1e-12),
        (squares(0.5), 2.56 - 0.09 - 0.04, 1e-12),
        (
            vec![round(-0.25, 0.5), round(0.25, 0.5)],
            0.5 * PI - 2.0 * lens,
            2e-3,
        ),
    ];
    for (loops, area, error) in cases {
        face.loops = loops;
        let result = with_tolerance_of(vec![face.clone()], 1e-3);
        let made = result.faces[0].as_ref().unwrap();
        assert_eq!((result.crossings, made.undrawn, made.unproven), (0, 0, 0));
        let found = result.shells[0].area;
        assert!((found - area).abs() < error, "{found} instead of {area}");
    }
}

#[test]
fn boundaries_that_cross_too_often_are_told() {
    // To and fro, then up and down: ten thousand crossings.
    let count = 100;
    let lines = |at: fn(f64, f64) -> DVec2| {
        (0..count).flat_map(move |k| {
            let (along, odd) = (0.1 + 0.8 * f64::from(k) / f64::from(count), k % 2 == 1);
            let [from, to] = if odd { [0.95, 0.05] } else { [0.05, 0.95] };
            [at(from, along), at(to, along)]
        })
    };
    let mut corners: Vec<DVec2> = lines(DVec2::new).collect();
    corners.extend(lines(|a, b| DVec2::new(b + 1e-3, a - 1e-3)));
    corners.push(corners[0]);
    let outline = kernel::Curve::polyline(&corners).unwrap();
    let square = modelling::plane(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0..1.0, 0.0..1.0);
    let mut face: Patch = square.unwrap().into();
    face.loops = vec![kernel::TrimLoop::new(vec![outline], 1e-12).unwrap()];
    let result = with_tolerance_of(vec![face], 1e-3);
    let made = result.faces[0].as_ref().unwrap();
    assert!(result.crossings > 0 && made.undrawn == result.crossings);
    assert!(made.proven.is_infinite());
    assert_eq!(made.unproven, made.mesh.triangles().len());
}

#[test]
fn neighbours_share_the_points_where_boundaries_cross() {
    // A bow tie, and a wall on one of the two sides that cross.
    let corners = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0]];
    let outline = kernel::Curve::polyline(&corners.map(DVec2::from_array)).unwrap();
    let square = modelling::plane(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0..1.0, 0.0..1.0);
    let mut tie: Patch = square.unwrap().into();
    tie.loops = vec![kernel::TrimLoop::new(vec![outline], 1e-12).unwrap()];
    let along = DVec3::new(1.0, 1.0, 0.0);
    let wall = modelling::plane(DVec3::ZERO, along, DVec3::Z, 0.0..1.0, 0.0..1.0).unwrap();
    let result = with_tolerance_of(vec![tie, wall.into()], 1e-3);
    assert_eq!(result.crossings, 0);
    let shell = &result.shells[0];
    assert!(
        (shell.area - 0.5 - 2.0_f64.sqrt()).abs() < 1e-12,
        "{}",
        shell.area
    );
    // Of the 6 sides of two triangles and the 5 of the wall two are shared.
    assert_eq!((result.shells.len(), shell.naked), (1, 7));
}

#[test]
fn a_loop_may_be_one_curve_around_its_domain() {
    let square = modelling::plane(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0..1.0, 0.0..1.0);
    let mut face: Patch = square.unwrap().into();
    // With a hole; and nearly on the border, where rounding decides what runs along it.
    for (low, high) in [(0.0, 1.0), (1e-8, 1.0 - 1e-8), (3e-7, 1.0 - 3e-7)] {
        face.loops = vec![around(low, high), around(0.4, 0.6)];
        let result = tessellate(&scene(vec![face.clone()]), &TessellateOptions::default()).unwrap();
        let shell = &result.shells[0];
        assert!((shell.area - 0.96).abs() < 1e-5, "{low}: {}", shell.area);
        assert_eq!((result.crossings, shell.crowded), (0, 0));
        // Every side of both outlines is one step.
        assert_eq!((shell.naked, shell.triangles), (8, 8), "{low}");
    }
}

#[test]
fn rounding_at_an_apex_does_not_turn_normals() {
    let count = |height: f64| {
        let ends = [DVec3::new(1.0, 0.0, height - 1.0), DVec3::Z * height];
        let line = kernel::Curve::line(ends[0], ends[1], 0.0..1.0).unwrap();
        let cone = modelling::revolve(&line, DVec3::ZERO, DVec3::Z, 0.0..TAU).unwrap();
        let options = TessellateOptions {
            angle: 0.2,
            tolerance: Tolerance::Length(1e-3),
            ..TessellateOptions::default()
        };
        let result = tessellate(&scene(vec![cone.into()]), &options).unwrap();
        result.faces[0].as_ref().unwrap().mesh.triangles().len()
    };
    let (at_origin, away) = (count(0.0), count(10.0));
    assert!(away <= at_origin + at_origin / 5, "{away}, {at_origin}");
}

#[test]
fn what_lies_beside_a_crease_is_within_the_tolerance() {
    // Across u the surface is bent in the middle, along v both halves wave, each in its own way.
    let knots_u = vec![0.0, 0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.0];
    let knots_u = kernel::KnotVector::new(2, knots_u).unwrap();
    let knots_v = kernel::KnotVector::clamped_uniform(3, 9, 0.0..1.0).unwrap();
    let point = |k: u32| {
        let (i, j) = (f64::from(k / 9), f64::from(k % 9));
        let fold = (i - 2.0).abs();
        DVec3::new(i, j, fold + (1.3 * j + 0.7 * fold).sin() * (1.0 + 0.3 * i))
    };
    let points: Vec<_> = (0..45).map(point).collect();
    let folded = Surface::new(knots_u, knots_v, &points, None).unwrap();
    for surface in [folded.transposed(), folded] {
        for tolerance in [1e-1, 1e-2, 1e-3] {
            let result = with_tolerance(surface.clone(), tolerance);
            let made = result.faces[0].as_ref().unwrap();
            assert_eq!((made.unproven, result.crossings), (0, 0), "{tolerance}");
            assert!(made.proven <= tolerance && made.sampled <= made.proven);
        }
    }
}

#[test]
fn an_edge_has_as_few_and_as_equal_steps_as_the_limits_allow() {
    let frame = &modelling::Frame::WORLD;
    let cylinder = modelling::cylinder(frame, 1.0, 0.0..TAU, 0.0..1.0).unwrap();
    for (degrees, count) in [(16.0_f64, 23), (7.0, 52)] {
        let options = TessellateOptions {
            tolerance: Tolerance::Length(0.05),
            angle: degrees.to_radians(),
            ..TessellateOptions::default()
        };
        let made = tessellate(&scene(vec![cylinder.clone().into()]), &options).unwrap();
        let points = made.faces[0].as_ref().unwrap().mesh.positions();
        let rim = points.iter().filter(|point| point.z <= 0.0);
        let mut turns: Vec<f64> = rim.map(|p| p.y.atan2(p.x).rem_euclid(TAU)).collect();
        turns.sort_by(f64::total_cmp);
        turns.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        let steps = turns.windows(2).map(|w| w[1] - w[0]);
        let (least, most) = steps.fold((TAU, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
        assert!(most < 1.1 * least, "{degrees}: {least} {most}");
        assert!(
            (count..=count + 1).contains(&turns.len()),
            "{degrees}: {}",
            turns.len()
        );
    }
}

#[test]
fn a_curve_that_comes_back_is_followed_in_order() {
    let patch = cube().remove(0);
    let face = Face::new(&patch, 1e-3);
    let there = [[0.0, 0.0], [0.8, 0.0], [0.0, 0.0]].map(DVec2::from);
    let curve = kernel::Curve::polyline(&there).unwrap();
    let trail = Trail::of(&face, &curve);
    let whole = curve.domain().end - curve.domain().start;
    for share in [0.1, 0.3, 0.45, 0.55, 0.7, 0.9] {
        let t = curve.domain().start + whole * share;
        assert!((trail.share(t) - share).abs() < 1e-9);
        let target = face.point(curve.evaluate(t));
        // What is expected may be a little off.
        for off in [-0.02, 0.02] {
            let place = (&face, &curve);
            let from = (&trail, t + whole * off, false);
            let (found, distance) = trail.project_beside(place, target, from);
            assert!((found - t).abs() < 1e-9 && distance < 1e-12, "{found} {t}");
        }
    }
}

#[test]
fn threads_do_not_change_the_triangles() {
    let torus = bodies().remove(2).surface;
    let with_threads = |count| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .build()
            .unwrap();
        pool.install(|| with_tolerance(torus.clone(), 0.01))
    };
    assert_eq!(with_threads(1), with_threads(4));
}

/// A body of which all is known.
struct Body {
    name: &'static str,
    surface: Surface,
    euler: i64,
    area: f64,
    /// `None` if it is open.
    volume: Option<f64>,
}

/// Unit sphere, cylinder without ends, and torus.
fn bodies() -> Vec<Body> {
    let frame = &modelling::Frame::WORLD;
    let half = -0.5 * PI..0.5 * PI;
    vec![
        Body {
            name: "sphere",
            surface: modelling::sphere(frame, 1.0, 0.0..TAU, half).unwrap(),
            euler: 2,
            area: 4.0 * PI,
            volume: Some(4.0 / 3.0 * PI),
        },
        Body {
            name: "cylinder",
            surface: modelling::cylinder(frame, 1.0, 0.0..TAU, 0.0..2.0).unwrap(),
            euler: 0,
            area: 4.0 * PI,
            volume: None,
        },
        Body {
            name: "torus",
            surface: modelling::torus(frame, 2.0, 0.5, 0.0..TAU, 0.0..TAU).unwrap(),
            euler: 0,
            area: 4.0 * PI * PI,
            volume: Some(PI * PI),
        },
    ]
}

#[test]
fn rings_narrower_than_their_chords_bulge_are_whole() {
    let (x, y) = (DVec3::X * 2.0, DVec3::Y * 2.0);
    let square = modelling::plane(DVec3::ZERO, x, y, -1.0..1.0, -1.0..1.0);
    let mut ring: Patch = square.unwrap().into();
    ring.loops = [0.9, 0.895].map(|radius| round(0.0, radius)).into();
    for tolerance in [0.04, 0.018, 0.0108, 0.006, 0.002] {
        let made = with_tolerance_of(vec![ring.clone()], tolerance);
        let shell = &made.shells[0];
        assert_eq!((shell.euler, shell.crowded), (0, 0), "{tolerance}");
        let exact = PI * (0.9 * 0.9 - 0.895 * 0.895);
        let share = shell.area / exact;
        // Chords cut off some of it, and both circles begin at one vertex where that is within the
        // tolerance.
        let chords = made.faces[0].as_ref().unwrap().mesh.triangles().len() as f64 / 2.0;
        let chord = TAU / chords;
        let least = chord.sin() / chord * (1.0 - 1.0 / chords);
        assert!(
            (least..1.05).contains(&share),
            "{tolerance}: {share} {least}"
        );
    }
}

#[test]
fn more_points_than_there_is_room_for_are_an_error() {
    let frame = modelling::Frame::WORLD;
    let sphere = modelling::sphere(&frame, 1.0, 0.0..TAU, -0.5 * PI..0.5 * PI).unwrap();
    let options = |length: f64, most_points: usize| TessellateOptions {
        tolerance: Tolerance::Length(length),
        most_points,
        ..TessellateOptions::default()
    };
    let scene = scene(vec![sphere.into()]);
    let count = |result: &Tessellation| {
        let faces = result.faces.iter().flatten();
        faces.map(|face| face.mesh.positions().len()).sum::<usize>()
    };
    let enough = tessellate(&scene, &options(1e-2, 5000)).unwrap();
    assert!((100..5000).contains(&count(&enough)), "{}", count(&enough));
    for (length, most) in [(1e-2, 50), (1e-4, 1000), (1e-9, 2000), (1e-300, 2000)] {
        let found = tessellate(&scene, &options(length, most));
        assert_eq!(found.err(), Some(TessellateError::TooManyPoints { most }));
    }
}

#[test]
fn a_twisted_strip_is_proven_where_each_division_asks_for_the_next() {
    // Lines between two half circles, one of them turned.
    let half = |z: f64, from: f64| {
        let [x, y] = [DVec3::X, DVec3::Y].map(|axis| axis * 2.4);
        modelling::arc(DVec3::Z * z, x, y, from..from + PI).unwrap()
    };
    let strip = modelling::ruled(&half(0.0, 0.0), &half(16.0, 0.2)).unwrap();
    let result = with_tolerance(strip, 3e-5);
    assert_eq!(result.faces[0].as_ref().unwrap().unproven, 0);
}

#[test]
fn weights_that_differ_much_take_few_triangles() {
    // At two of the corners much of the surface is in a hundred-thousandth of the domain.
    let ij = |k: usize| (k / 6, k % 6);
    let point = |k: usize| {
        let height = (7 * k % 5) as f64 - 2.0;
        DVec3::new(ij(k).0 as f64, ij(k).1 as f64, 0.4 * height)
    };
    let weight = |k: usize| [1.0, 1e-5][(ij(k).0 + ij(k).1) % 2];
    let points: Vec<DVec3> = (0..36).map(point).collect();
    let weights: Vec<f64> = (0..36).map(weight).collect();
    let knots = || kernel::KnotVector::clamped_uniform(3, 6, 0.0..1.0).unwrap();
    let surface = Surface::new(knots(), knots(), &points, Some(&weights)).unwrap();
    let result = with_tolerance(surface, 0.04);
    let face = result.faces[0].as_ref().unwrap();
    assert_eq!(face.unproven, 0);
    let count = face.mesh.triangles().len();
    assert!((1000..10_000).contains(&count), "{count}");
}
