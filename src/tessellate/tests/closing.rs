//! Bodies that are closed, and stay so.

use kernel::{Curve, TrimLoop};

use super::*;

/// A loop of straight lines between corners of the parameters.
fn outline(corners: &[[f64; 2]]) -> TrimLoop {
    let sides = (0..corners.len()).map(|k| {
        let ends = [corners[k], corners[(k + 1) % corners.len()]].map(DVec2::from_array);
        Curve::line(ends[0], ends[1], 0.0..1.0).unwrap()
    });
    TrimLoop::new(sides.collect(), 1e-12).unwrap()
}

/// A scene of one solid.
fn solid(patches: Vec<Patch>) -> Scene {
    let mut scene = Scene::default();
    let item = |patch| {
        let shape = Shape::Patch(scene.add_patch(patch).unwrap());
        Child::Item(Item {
            shape,
            material: None,
        })
    };
    let root = Node {
        children: patches.into_iter().map(item).collect(),
        voids: Some(0),
        ..Node::default()
    };
    let root = scene.add_node(root).unwrap();
    scene.set_root(root).unwrap();
    scene
}

fn within(length: f64) -> TessellateOptions {
    TessellateOptions {
        tolerance: Tolerance::Length(length),
        ..TessellateOptions::default()
    }
}

#[test]
fn a_crease_that_a_border_passes_where_its_pieces_meet_is_one_corner() {
    // The loop of a folded strip has a corner beside the fold, as far away as rounding moves it.
    let folded = |off: f64| -> Patch {
        let line = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]].map(DVec3::from_array);
        let line = Curve::polyline(&line).unwrap();
        let mut strip: Patch = modelling::extrude(&line, DVec3::Z).unwrap().into();
        let domain = strip.surface.knots_u().domain();
        let fold = strip.surface.knots_u().breaks()[1];
        let corners = [
            [domain.start, 0.0],
            [fold - off, 0.0],
            [domain.end, 0.0],
            [domain.end, 1.0],
            [domain.start, 1.0],
        ];
        let corners = corners.map(DVec2::from_array);
        let closed: Vec<DVec2> = corners.iter().copied().chain([corners[0]]).collect();
        let around = Curve::polyline(&closed).unwrap();
        strip.loops = vec![TrimLoop::new(vec![around], 1e-12).unwrap()];
        strip
    };
    let floor = || -> Patch {
        let plane = modelling::plane(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0..1.0, 0.0..1.0);
        plane.unwrap().into()
    };
    for off in [0.0, 1e-13, -1e-13, 1e-12] {
        let result = tessellate(&scene(vec![folded(off), floor()]), &within(1e-3)).unwrap();
        let shell = &result.shells[0];
        assert_eq!(
            (result.shells.len(), shell.naked),
            (1, 6),
            "{off}: {shell:?}"
        );
        assert_eq!((shell.triangles, shell.euler), (6, 1), "{off}: {shell:?}");
    }
}

/// A part of the plane z = 0 between corners, with the domain from -1 to 2.
fn part(corners: &[[f64; 2]]) -> Patch {
    let corner = DVec3::new(-1.0, -1.0, 0.0);
    let (x, y) = (3.0 * DVec3::X, 3.0 * DVec3::Y);
    let plane = modelling::plane(corner, x, y, -1.0..2.0, -1.0..2.0);
    let mut face: Patch = plane.unwrap().into();
    face.loops = vec![outline(corners)];
    face
}

#[test]
fn a_loop_that_strays_from_the_border_by_nothing_that_counts_is_the_border() {
    // The loop of a square comes near to one side of its domain, and leaves it in the middle by a little, as curves do
    // that were fitted. What bounds the face there is one thing, not two.
    for scale in [0.0, 0.2, 0.5, 0.9, 1.0, 1.03, 1.1, 2.0, 100.0, -1.0] {
        let heights = [4e-7, -2.9e-7, -2e-8].map(|y| y * scale);
        let [start, middle, end] = heights;
        let corners = [
            DVec2::new(0.0, start),
            DVec2::new(1.0, start),
            DVec2::ONE,
            DVec2::Y,
        ];
        let line = |a: DVec2, b: DVec2| Curve::line(a, b, 0.0..1.0).unwrap();
        let bow = |xs: [f64; 3], ys: [f64; 3]| {
            let points = [0, 1, 2].map(|k| DVec2::new(xs[k], ys[k]));
            let knots = kernel::KnotVector::clamped_uniform(2, 3, 0.0..1.0).unwrap();
            Curve::new(knots, &points, None).unwrap()
        };
        let sides = vec![
            bow([0.0, 0.25, 0.5], heights),
            bow([0.5, 0.75, 1.0], [end, middle, start]),
            line(corners[1], corners[2]),
            line(corners[2], corners[3]),
            line(corners[3], corners[0]),
        ];
        let plane = modelling::plane(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0..1.0, 0.0..1.0);
        let mut square: Patch = plane.unwrap().into();
        square.loops = vec![TrimLoop::new(sides, 1e-9).unwrap()];
        let rims = Face::new(&square, 1e-3).rims(&square);
        let length = |rim: &Curve<DVec2>| {
            let is_below = rim.start().y.max(rim.end().y) < 0.5;
            let way = (rim.end().x - rim.start().x).abs();
            if is_below { way } else { 0.0 }
        };
        let below: f64 = rims.iter().map(length).sum();
        assert!((below - 1.0).abs() < 1e-9, "{scale}: {below}");
    }
}

#[test]
fn a_strip_narrower_than_the_tolerance_has_two_neighbours() {
    // Between two halves of a square lies a strip that is closed at both ends.
    let ends = [[0.0, 0.5], [1.0, 0.5]];
    let middle = |off: f64| [0.5, 0.5 + off];
    let faces = vec![
        part(&[ends[0], middle(-4e-5), ends[1], middle(4e-5)]),
        part(&[[0.0, 0.0], [1.0, 0.0], ends[1], middle(-6e-5), ends[0]]),
        part(&[[0.0, 1.0], ends[0], middle(6e-5), ends[1], [1.0, 1.0]]),
    ];
    let result = tessellate(&scene(faces), &within(1e-3)).unwrap();
    assert_eq!(result.shells.len(), 1);
    let shell = &result.shells[0];
    assert_eq!(
        (shell.naked, shell.crowded, shell.twisted),
        (6, 0, 0),
        "{shell:?}"
    );
}

/// The faces of the body that planes at distance one from the origin bound, each with its normal.
fn bounded(normals: &[DVec3]) -> Vec<Patch> {
    let mut corners: Vec<Vec<DVec3>> = vec![Vec::new(); normals.len()];
    for (i, a) in normals.iter().enumerate() {
        for (j, b) in normals.iter().enumerate().skip(i + 1) {
            for (k, c) in normals.iter().enumerate().skip(j + 1) {
                let point = (b.cross(*c) + c.cross(*a) + a.cross(*b)) / a.dot(b.cross(*c));
                if normals.iter().all(|n| n.dot(point) <= 1.0 + 1e-12) {
                    for face in [i, j, k] {
                        corners[face].push(point);
                    }
                }
            }
        }
    }
    let face = |(normal, corners): (&DVec3, Vec<DVec3>)| {
        let x = normal.any_orthonormal_vector();
        let y = normal.cross(x);
        let plane = |p: DVec3| DVec2::new(p.dot(x), p.dot(y));
        let mut corners: Vec<DVec2> = corners.into_iter().map(plane).collect();
        let middle = corners.iter().sum::<DVec2>() / corners.len() as f64;
        let angle = |p: &DVec2| (*p - middle).to_angle();
        corners.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
        let corners: Vec<[f64; 2]> = corners.iter().map(DVec2::to_array).collect();
        let origin = *normal - 4.0 * (x + y);
        let plane = modelling::plane(origin, 8.0 * x, 8.0 * y, -4.0..4.0, -4.0..4.0);
        let mut face: Patch = plane.unwrap().into();
        face.loops = vec![outline(&corners)];
        face
    };
    normals
        .iter()
        .zip(corners)
        .filter(|(_, corners)| corners.len() > 2)
        .map(face)
        .collect()
}

#[test]
fn solids_with_details_smaller_than_the_tolerance_are_closed_at_a_smaller_one() {
    // Of these two are not at that tolerance itself.
    for (seed, tolerance) in (0..12).flat_map(|seed| [(seed, 0.016), (seed, 0.128)]) {
        let mut random = crate::random::Random(seed);
        let normals: Vec<DVec3> = (0..60).map(|_| random.vector().normalize()).collect();
        let result = tessellate(&solid(bounded(&normals)), &within(tolerance)).unwrap();
        let is_closed = result.shells.iter().all(Shell::is_closed);
        assert!(is_closed, "{seed} {tolerance}: {:?}", result.shells);
    }
}

#[test]
fn a_sliver_along_the_border_of_its_own_face_leaves_that_to_the_neighbour() {
    // The neighbour is farther away than the sliver, and nearer than counts.
    let faces = vec![
        part(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]),
        part(&[[1.0 + 5e-6, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0 + 5e-6, 1.0]]),
    ];
    let [mut face, neighbour] = <[Patch; 2]>::try_from(faces).unwrap();
    let sliver = [1.0 + 2e-9, 1.0 + 4e-9].map(|x| [[x, 0.0], [x, 1.0]]);
    let [[a, b], [d, c]] = sliver;
    face.loops.push(outline(&[a, d, c, b]));
    let result = tessellate(&scene(vec![face, neighbour]), &within(1e-3)).unwrap();
    assert_eq!(result.shells.len(), 1);
    assert_eq!(result.shells[0].naked, 6, "{:?}", result.shells);
}

#[test]
fn solids_whose_faces_are_farther_apart_than_the_tolerance_are_closed() {
    let normals = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| [axis, -axis]);
    let (tolerance, gap) = (1e-3, 3e-3);
    let mut faces = bounded(normals.as_flattened());
    let lifted = DAffine3::from_translation(DVec3::X * gap);
    faces[0].surface = faces[0].surface.transformed(&lifted);
    let result = tessellate(&solid(faces.clone()), &within(tolerance)).unwrap();
    assert!(
        result.shells.iter().all(Shell::is_closed),
        "{:?}",
        result.shells
    );
    // Faces of which nobody says that they are of a solid stay where they are.
    let apart = tessellate(&scene(faces), &within(tolerance)).unwrap();
    assert!(!apart.shells.iter().all(Shell::is_closed));
    // What closing them costs is told.
    let faces: Vec<&FaceMesh> = result.faces.iter().flatten().collect();
    assert!(faces.iter().all(|face| face.gap <= face.proven));
    let most = faces.iter().fold(0.0_f64, |most, face| most.max(face.gap));
    assert!((tolerance..gap).contains(&most), "{most}");
}

#[test]
fn rings_narrower_than_their_chords_are_filled() {
    let turned = |profile: [[f64; 2]; 2]| -> Patch {
        let [from, to] = profile.map(|[r, z]| DVec3::new(r, 0.0, z));
        let line = Curve::line(from, to, 0.0..1.0).unwrap();
        let surface = modelling::revolve(&line, DVec3::ZERO, DVec3::Z, 0.0..TAU);
        surface.unwrap().into()
    };
    let circle = |radius: f64| {
        let frame = modelling::Frame::about(DVec3::ZERO, DVec3::Z).unwrap();
        let circle = modelling::circle(&frame, radius).unwrap().flattened();
        TrimLoop::new(vec![circle], 1e-12).unwrap()
    };
    for width in [1e-3, 8.6e-4, 1e-4] {
        let [inner, outer] = [3.4, 3.4 + width];
        let (corner, side) = (DVec3::new(-4.0, -4.0, 0.0), 8.0);
        let (x, y) = (side * DVec3::X, side * DVec3::Y);
        let plane = modelling::plane(corner, x, y, -4.0..4.0, -4.0..4.0);
        let mut ring: Patch = plane.unwrap().into();
        ring.loops = [inner, outer].map(circle).into();
        let faces = vec![
            turned([[inner, 0.8], [inner, 0.0]]),
            ring,
            turned([[outer, 0.0], [3.5, -0.37]]),
        ];
        let result = tessellate(&scene(faces), &within(0.0166)).unwrap();
        let shell = &result.shells[0];
        assert_eq!(result.shells.len(), 1, "{width}");
        assert_eq!((shell.euler, shell.crowded), (0, 0), "{width}: {shell:?}");
    }
}
