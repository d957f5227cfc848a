//! Faces that share edges, and what they become together.

use super::*;

#[test]
fn faces_without_topology_share_their_edges() {
    let result = tessellate(&scene(cube()), &TessellateOptions::default()).unwrap();
    assert_eq!(result.shells.len(), 1);
    let shell = &result.shells[0];
    assert!(
        shell.is_closed() && shell.triangles == 12 && shell.euler == 2,
        "{shell:?}"
    );
    assert!((shell.volume - 1.0).abs() < 1e-12 && (shell.area - 6.0).abs() < 1e-12);
}

#[test]
fn faces_that_are_shown_several_times_together_share_their_edges() {
    let count = |places: &[(DVec3, usize)]| {
        let result = tessellate(&shown(cube(), places), &TessellateOptions::default()).unwrap();
        let closed = result.shells.iter().filter(|shell| shell.is_closed());
        (result.shells.len(), closed.count())
    };
    assert_eq!(count(&[(DVec3::ZERO, 6), (DVec3::X * 5.0, 6)]), (1, 1));
    // Three faces are missing in the second place: there they have a border.
    assert_eq!(count(&[(DVec3::ZERO, 6), (DVec3::X * 5.0, 3)]), (2, 0));
}

#[test]
fn corners_that_do_not_quite_meet_become_points() {
    // One side lacks a corner: the hole is closed where it is too small to see.
    for (cut, closed) in [(1e-5, true), (2e-4, true), (2e-3, false)] {
        let mut faces = cube();
        let corners = [
            [cut, 0.0],
            [1.0, 0.0],
            [1.0, 3.0],
            [0.0, 3.0],
            [0.0, 3.0 * cut],
        ];
        let side = |k: usize| {
            let ends = [corners[k], corners[(k + 1) % corners.len()]];
            kernel::Curve::line(ends[0].into(), ends[1].into(), 0.0..1.0).unwrap()
        };
        let sides = (0..corners.len()).map(side).collect();
        faces[0].loops = vec![kernel::TrimLoop::new(sides, 1e-9).unwrap()];
        let options = TessellateOptions {
            tolerance: Tolerance::Length(1e-3),
            ..TessellateOptions::default()
        };
        let result = tessellate(&scene(faces), &options).unwrap();
        assert_eq!(result.shells.len(), 1);
        let shell = &result.shells[0];
        assert_eq!(shell.is_closed(), closed, "{cut}: {shell:?}");
        assert_eq!((shell.crowded, shell.twisted), (0, 0));
        assert!((shell.volume - 1.0).abs() < 1e-3);
    }
}

#[test]
fn a_border_in_steps_far_below_the_tolerance_is_one_edge() {
    // Two rectangles side by side. Between them the loop of one runs beside the straight side of the other, farther
    // away than it comes on with each of many steps.
    let count = 300_u32;
    let step = |k: u32| {
        let y = f64::from(k) / f64::from(count);
        let x = 1.0 + 0.012 * (PI * y).sin() + 0.0005 * f64::from(k % 3);
        DVec2::new(if k == 0 || k == count { 1.0 } else { x }, y)
    };
    let outline = |corners: Vec<DVec2>| {
        let sides = corners
            .windows(2)
            .map(|w| kernel::Curve::line(w[0], w[1], 0.0..1.0).unwrap());
        kernel::TrimLoop::new(sides.collect(), 1e-12).unwrap()
    };
    let corners = |xs: [f64; 2]| {
        let [a, b] = xs;
        [[a, 0.0], [b, 0.0], [b, 1.0], [a, 1.0], [a, 0.0]]
            .map(DVec2::from_array)
            .to_vec()
    };
    let mut stepped = vec![DVec2::ZERO];
    stepped.extend((0..=count).map(step));
    stepped.extend([DVec2::Y, DVec2::ZERO]);
    let face = |outline: kernel::TrimLoop| {
        let corner = DVec3::new(-1.0, -1.0, 0.0);
        let (x, y) = (4.0 * DVec3::X, 3.0 * DVec3::Y);
        let plane = modelling::plane(corner, x, y, -1.0..3.0, -1.0..2.0);
        let mut face: Patch = plane.unwrap().into();
        face.loops = vec![outline];
        face
    };
    let faces = vec![face(outline(stepped)), face(outline(corners([1.0, 2.0])))];
    let options = TessellateOptions {
        tolerance: Tolerance::Length(0.05),
        ..TessellateOptions::default()
    };
    let result = tessellate(&scene(faces), &options).unwrap();
    assert_eq!((result.shells.len(), result.crossings), (1, 0));
    let shell = &result.shells[0];
    assert_eq!(
        (shell.naked, shell.crowded, shell.twisted),
        (6, 0, 0),
        "{shell:?}"
    );
    assert!((shell.area - 2.0).abs() < 0.02, "{}", shell.area);
}

#[test]
fn creases_of_neighbours_that_meet_are_one_corner() {
    // Two strips on both sides of a zigzag line, with parameters that only rounding relates.
    let zigzag: Vec<DVec3> = (0..40)
        .map(|k| {
            let k = f64::from(k);
            DVec3::new(k * 0.7, k.sin(), (k * 1.3).cos())
        })
        .collect();
    let line = kernel::Curve::polyline(&zigzag).unwrap();
    let other = line.reversed().remapped(0.1..0.7).unwrap();
    let strips = [(line, DVec3::Y * 3.0), (other, DVec3::Z * 3.0)];
    let strips = strips.map(|(line, way)| modelling::extrude(&line, way).unwrap().into());
    let result = tessellate(&scene(strips.to_vec()), &TessellateOptions::default()).unwrap();
    assert_eq!((result.crossings, result.shells.len()), (0, 1));
    let shell = &result.shells[0];
    // Both long borders and four short ones are open, and nothing else.
    assert_eq!((shell.naked, shell.crowded), (2 * 39 + 4, 0));
    assert_eq!((shell.triangles, shell.euler), (4 * 39, 1));
}

#[test]
fn creases_of_neighbours_that_nearly_meet_leave_no_gap() {
    // Folds of two strips that meet in a line up to a gap, a little beside each other.
    let folded = |off: f64, gap: f64, height: f64| {
        let point = |k: u32, height: f64| {
            let fold = f64::from(k % 2) * height;
            let at = f64::from(k);
            let shift = if k.is_multiple_of(16) { 0.0 } else { off };
            DVec3::new(at + shift, height, fold.abs() + gap * at)
        };
        let row = |height: f64| (0..=16).map(move |k| point(k, height)).collect::<Vec<_>>();
        let knots = kernel::KnotVector::clamped_uniform(1, 17, 0.0..16.0).unwrap();
        let across = kernel::KnotVector::clamped_uniform(1, 2, 0.0..1.0).unwrap();
        let points = [row(0.0), row(height)].concat();
        Patch::from(Surface::from_u_fastest(knots, across, &points, None).unwrap())
    };
    for gap in [1e-5, 1e-4, 3e-4] {
        for off in [0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4] {
            let strips = vec![folded(0.0, 0.0, 2.0), folded(off, gap, -2.0)];
            let result = with_tolerance_of(strips, 0.01);
            let shell = &result.shells[0];
            assert_eq!((result.crossings, result.shells.len()), (0, 1));
            // The long borders and the short ones are open, and nothing else.
            let open = (shell.naked, shell.crowded);
            assert_eq!(open, (2 * 16 + 4, 0), "{gap} {off}");
        }
    }
}

#[test]
fn faces_meet_where_a_border_is_farthest_out() {
    let frame = &modelling::Frame::WORLD;
    let part = |angles: std::ops::Range<f64>, heights| {
        Patch::from(modelling::cylinder(frame, 1.0, angles, heights).unwrap())
    };
    // Halves begin on a ring where it comes nearest to a side of its box, and not at its own start.
    for turn in [0.2, 0.9, 2.0] {
        let scene = scene(vec![
            part(turn..turn + TAU, 0.0..1.0),
            part(0.0..PI, 1.0..2.0),
            part(PI..TAU, 1.0..2.0),
        ]);
        let found = tessellate(&scene, &TessellateOptions::default()).unwrap();
        assert_eq!(found.shells.len(), 1, "at {turn}");
        assert_eq!(found.shells[0].euler, 0);
    }
}

#[test]
fn seams_that_do_not_quite_meet_are_closed_as_far_as_the_tolerance_allows() {
    let frame = &modelling::Frame::WORLD;
    let torus = modelling::torus(frame, 2.0, 0.5, 0.0..TAU, 0.0..TAU).unwrap();
    let (u, v) = (torus.knots_u(), torus.knots_v());
    let weights: Vec<f64> = torus.weights().collect();
    let gap = 0.01;
    // Both seams are apart, and three corners are elsewhere than the first.
    let moved = torus.points().enumerate().map(|(k, point)| {
        let (row, column) = (k / v.count(), k % v.count());
        let last = |at: usize, count: usize| f64::from(u8::from(at + 1 == count));
        let (along_u, along_v) = (last(row, u.count()), last(column, v.count()));
        point + DVec3::X * (gap * along_u + 0.3 * gap * along_v)
    });
    let points: Vec<DVec3> = moved.collect();
    let surface = Surface::new(u.clone(), v.clone(), &points, Some(&weights)).unwrap();
    for (tolerance, closed) in [(0.1, true), (0.015, true), (0.008, false)] {
        let result = with_tolerance(surface.clone(), tolerance);
        let (face, shell) = (result.faces[0].as_ref().unwrap(), &result.shells[0]);
        assert_eq!(shell.is_closed(), closed, "at {tolerance}: {shell:?}");
        assert!(face.unproven == 0 && face.proven <= tolerance);
        assert!(!closed || shell.euler == 0);
    }
}

#[test]
fn slits_are_closed_as_far_as_the_tolerance_allows() {
    // Two halves of a square with a slit between them, one edge a little longer.
    let half = |x: [f64; 2], top: f64| -> Patch {
        let knots = || kernel::KnotVector::bezier(1, 0.0..1.0).unwrap();
        let corners = [
            DVec3::new(x[0], 0.0, 0.0),
            DVec3::new(x[0], top, 0.0),
            DVec3::new(x[1], 0.0, 0.0),
            DVec3::new(x[1], 1.0, 0.0),
        ];
        Surface::new(knots(), knots(), &corners, None)
            .unwrap()
            .into()
    };
    let side = |u: f64, patch: kernel::PatchId| kernel::SeamSide {
        patch,
        curve: kernel::Curve::line([u, 0.0].into(), [u, 1.0].into(), 0.0..1.0).unwrap(),
    };
    for (named, tolerance, closed) in [
        (false, 0.02, true),
        (false, 0.011, false),
        (true, 0.015, true),
        (true, 0.001, false),
    ] {
        let options = TessellateOptions {
            tolerance: Tolerance::Length(tolerance),
            ..TessellateOptions::default()
        };
        let mut scene = scene(vec![half([0.0, 1.0], 1.0), half([1.01, 2.0], 1.01)]);
        let [a, b] = [0, 1].map(|k| match scene.placements()[k].shape {
            Shape::Patch(id) => id,
            Shape::Mesh(_) => panic!("a patch"),
        });
        let gap = 0.01_f64.hypot(0.01);
        if named {
            let sides = [side(1.0, a), side(0.0, b)];
            scene.add_seam(kernel::Seam { sides, gap }).unwrap();
        }
        let found = tessellate(&scene, &options).unwrap();
        assert_eq!(found.shells.len(), if closed { 1 } else { 2 });
        for face in found.faces.iter().flatten() {
            assert_eq!(face.gap > 0.001, closed, "{}", face.gap);
            assert!(face.gap <= 0.51 * gap && face.proven >= face.gap);
            assert!(face.proven <= tolerance);
        }
    }
}

#[test]
fn bodies_that_touch_are_shells_of_their_own() {
    let mut faces = cube();
    let beside = DAffine3::from_translation(DVec3::X);
    let moved = |face: &Patch| Patch::from(face.surface.transformed(&beside));
    let other: Vec<_> = faces.iter().map(moved).collect();
    faces.extend(other);
    let shells = with_tolerance_of(faces, 0.01).shells;
    assert_eq!(shells.len(), 2);
    for shell in shells {
        assert!(shell.is_closed(), "{shell:?}");
        assert_eq!((shell.euler, shell.patches.len()), (2, 6));
        assert!((shell.volume - 1.0).abs() < 1e-12, "{shell:?}");
    }
}

#[test]
fn a_sheet_that_ends_on_an_edge_of_a_body_leaves_it_closed() {
    let mut faces = cube();
    let sheet = modelling::plane(DVec3::Z, DVec3::X, DVec3::Z, 0.0..1.0, 0.0..1.0).unwrap();
    faces.push(sheet.into());
    let result = tessellate(&scene(faces), &TessellateOptions::default()).unwrap();
    let found: Vec<_> = result
        .shells
        .iter()
        .map(|s| (s.patches.len(), s.naked, s.crowded))
        .collect();
    assert_eq!(found, [(6, 0, 0), (1, 4, 0)]);
    assert!((result.shells[0].volume - 1.0).abs() < 1e-12);
}

#[test]
fn a_sheet_around_a_body_does_not_divide_it() {
    // A can of two bands, and a sheet that ends where they meet: a collar, or a wall inside.
    let turned = |from: [f64; 2], to: [f64; 2]| -> Patch {
        let point = |[r, z]: [f64; 2]| DVec3::new(r, 0.0, z);
        let line = kernel::Curve::line(point(from), point(to), 0.0..1.0).unwrap();
        modelling::revolve(&line, DVec3::ZERO, DVec3::Z, 0.0..TAU)
            .unwrap()
            .into()
    };
    let can = || {
        vec![
            turned([0.0, 0.0], [1.0, 0.0]),
            turned([1.0, 0.0], [1.0, 1.0]),
            turned([1.0, 1.0], [1.0, 2.0]),
            turned([1.0, 2.0], [0.0, 2.0]),
        ]
    };
    let check = |scene: &Scene, sheet: usize| {
        let result = tessellate(scene, &TessellateOptions::default()).unwrap();
        assert_eq!(result.shells.len(), 2);
        for shell in &result.shells {
            let is_sheet = shell.patches.len() == 1;
            assert_eq!(is_sheet, shell.patches[0].index() == sheet);
            assert_eq!(is_sheet, !shell.is_closed());
            assert!(is_sheet || (6.1..2.0 * PI).contains(&shell.volume));
        }
    };
    // In front of the body's faces, among them, and behind them.
    for place in [0, 2, 4] {
        let mut faces = can();
        faces.insert(place, turned([1.0, 1.0], [2.0, 1.0]));
        check(&scene(faces), place);
    }
    // What divides it inside as well stands in another node.
    let apart = bodies(vec![can(), vec![turned([1.0, 1.0], [0.0, 1.5])]]);
    check(&apart, 4);
}

#[test]
fn faces_of_one_body_find_each_other_first() {
    // The lid of a cube does not quite meet its walls; on it lies a sheet that is the same.
    let mut faces = cube();
    let origin = DVec3::Z * (1.0 + 1e-4);
    let lid: Patch = modelling::plane(origin, DVec3::X, DVec3::Y, 0.0..1.0, 0.0..1.0)
        .unwrap()
        .into();
    // Of the three planes at the far corner it is the first.
    faces[3] = lid.clone();
    let scene = bodies(vec![faces, vec![lid]]);
    let options = TessellateOptions {
        tolerance: Tolerance::Length(3e-4),
        ..TessellateOptions::default()
    };
    let result = tessellate(&scene, &options).unwrap();
    let found: Vec<_> = result
        .shells
        .iter()
        .map(|s| (s.patches.len(), s.naked))
        .collect();
    assert_eq!(found, [(6, 0), (1, 4)]);
}

/// A scene with a node for the patches of each list.
fn bodies(lists: Vec<Vec<Patch>>) -> Scene {
    let mut scene = Scene::default();
    let mut root = Node::default();
    for patches in lists {
        let mut node = Node::default();
        for patch in patches {
            let shape = Shape::Patch(scene.add_patch(patch).unwrap());
            node.children.push(Child::Item(Item {
                shape,
                material: None,
            }));
        }
        let node = scene.add_node(node).unwrap();
        root.children.push(Child::Node(node));
    }
    let root = scene.add_node(root).unwrap();
    scene.set_root(root).unwrap();
    scene
}

#[test]
fn a_ring_with_a_speck_of_a_side_is_one_with_the_ring_beside_it() {
    // The rim of the disc goes the first of its ways, shorter than can be seen, to where the pipe's rim begins,
    // and starts too far beside that to divide it.
    let seam: f64 = 9e-5;
    let ring = |angle: f64| DVec2::from_angle(angle);
    let (start, beside) = (ring(0.0) * (1.0 + 4e-5), ring(seam));
    let axis = modelling::Frame::new(DVec3::ZERO, DVec3::Z, beside.extend(0.0));
    let pipe = modelling::cylinder(&axis.unwrap(), 1.0, 0.0..TAU, 0.0..1.0).unwrap();
    let corner = DVec3::new(-2.0, -2.0, 0.0);
    let (x, y) = (DVec3::X * 4.0, DVec3::Y * 4.0);
    let plane = modelling::plane(corner, x, y, -2.0..2.0, -2.0..2.0);
    let mut disc: Patch = plane.unwrap().into();
    let count = 2000;
    let inner = (1..count).map(|k| ring(TAU * f64::from(k) / f64::from(count)));
    let rest: Vec<DVec2> = [beside].into_iter().chain(inner).chain([start]).collect();
    let sides = [&[start, beside][..], &rest].map(|side| kernel::Curve::polyline(side).unwrap());
    disc.loops = vec![kernel::TrimLoop::new(sides.into(), 1e-12).unwrap()];
    let result = with_tolerance_of(vec![pipe.into(), disc], 1e-2);
    assert_eq!(result.shells.len(), 1);
}
