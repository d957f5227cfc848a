//! What the reader keeps besides surfaces and polygons, on small texts.

use glam::{DVec2, DVec3};
use kernel::{Child, WireShape};

use super::tests::{SADDLE, SQUARE, messages, parse};
use crate::Import;

/// The curve or points of a wire, by its source.
fn wire<'a>(import: &'a Import, source: &str) -> &'a WireShape {
    let mut wires = import.scene.wires().iter();
    let found = wires.find(|wire| wire.source.ends_with(source));
    &found.unwrap_or_else(|| panic!("no {source}")).shape
}

#[test]
fn special_curves_and_points_lie_on_their_surface() {
    let text = format!(
        "{SQUARE}vp 0.25 0.25\nvp 0.75 0.25\nvp 0.5 0.75\nvp 1.5\ncstype bezier\ndeg 1\n\
         curv2 1 2 3 1\nparm u 0 1 2 3\nsp 4\nend\n{SADDLE}trim 0 3 1\nscrv 2 0 1\nsp 3\nend\n"
    );
    let import = parse(&text).unwrap();
    assert_eq!(messages(&import), [""; 0]);
    let WireShape::Curve(curve) = wire(&import, ", scrv") else {
        panic!("a curve");
    };
    assert_eq!(curve.start(), DVec3::new(0.5, 0.75, 0.375));
    for (t, u, v) in [(0.5, 0.625, 0.5), (1.5, 0.5, 0.25)] {
        let expected = DVec3::new(u, v, u * v);
        assert!(curve.evaluate(t).distance(expected) < 1e-9);
    }
    let points = import.scene.wires().iter().filter_map(|w| match &w.shape {
        WireShape::Points(points) => Some(points.clone()),
        WireShape::Curve(_) => None,
    });
    let points: Vec<_> = points.flatten().collect();
    assert_eq!(
        points,
        [DVec3::new(0.625, 0.5, 0.3125), DVec3::new(0.5, 0.75, 0.375)]
    );
}

#[test]
fn connections_and_merging_groups_say_where_surfaces_meet() {
    // Two squares with a slit of 0.01 between them.
    let squares = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 1.01 0 0\nv 2 0 0\nv 1.01 1 0\nv 2 1 0\n\
                   vp 0 0\nvp 1 0\nvp 1 1\nvp 0 1\ncstype bezier\ndeg 1\n\
                   curv2 1 2 3 4 1\nparm u 0 1 2 3 4\nend\ndeg 1 1\n";
    let surface =
        |points: &str| format!("surf 0 1 0 1 {points}\nparm u 0 1\nparm v 0 1\ntrim 0 4 1\nend\n");
    let two = surface("1 2 3 4") + &surface("5 6 7 8");
    let connected = parse(&format!("{squares}{two}con 1 1 2 1 -1 4 3 -1\n")).unwrap();
    let merged = parse(&format!("{squares}mg 1 0.02\n{two}")).unwrap();
    for import in [&connected, &merged] {
        assert_eq!(messages(import), [""; 0]);
        let [seam] = import.scene.seams() else {
            panic!("{:?}", import.scene.seams());
        };
        assert!((seam.gap - 0.01).abs() < 1e-12, "{}", seam.gap);
        let scene = &import.scene;
        for side in &seam.sides {
            let surface = &scene.patch(side.patch).surface;
            let x = surface
                .evaluate(side.curve.evaluate(side.curve.domain().start))
                .x;
            assert!((1.0..=1.01).contains(&x), "{x}");
        }
    }
    for (text, message) in [
        (format!("mg 1 0.001\n{two}"), ""),
        (format!("{two}con 1 0 1 1 2 4 3 1\n"), "the curves are 1.01"),
        (
            format!("{two}con 1 1 2 1 3 4 3 1\n"),
            "reference 3 to surfaces, of which there are 2",
        ),
        (
            format!("{two}con 1 1 2 1 2 4 3\n"),
            "7 words; a connection has 8",
        ),
        (
            format!(
                "mg 1 0.001\n{}mg off\n{}con 1 1 2 1 2 4 3 1\n",
                surface("1 2 3 4"),
                surface("5 6 7 8")
            ),
            "surfaces of different merging groups",
        ),
    ] {
        let import = parse(&format!("{squares}{text}")).unwrap();
        assert!(import.scene.seams().is_empty());
        let found = messages(&import).join("\n");
        assert!(
            found.contains(message) && found.is_empty() == message.is_empty(),
            "{found}"
        );
    }
}

#[test]
fn smoothing_groups_give_mean_normals() {
    // Two squares along an edge, upright to each other.
    let corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 -1\nv 1 1 -1\n";
    let faces = "f 1 2 3 4\nf 2 5 6 3\n";
    let flat = parse(&format!("{corners}s off\n{faces}")).unwrap();
    assert!(flat.scene.meshes()[0].normals().is_empty());
    let smooth = parse(&format!("{corners}s 3\n{faces}s 4\nf 4 3 6\n")).unwrap();
    let mesh = &smooth.scene.meshes()[0];
    assert_eq!((mesh.positions().len(), mesh.triangles().len()), (9, 5));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let expected = [DVec3::Z, DVec3::new(half, 0.0, half)];
    for (found, expected) in mesh.normals().iter().zip(expected) {
        assert!(found.distance(expected) < 1e-15, "{found}");
    }
    // The other group does not blend with the first.
    let own = mesh.normals()[mesh.triangles()[4][0] as usize];
    assert!(own.distance(DVec3::Y) < 1e-15, "{own}");
}

#[test]
fn texture_vertices_lie_on_surfaces_by_the_same_functions() {
    let texture = "vt 0 0\nvt 2 0\nvt 0 3\nvt 2 4 1\n";
    let saddle = SADDLE.replace("1 2 3 4", "1/1 2/2 3/3 4/4");
    let saddle = saddle.replace("surf 0 1 0 1", "surf 0.5 1 0 1");
    // Weights do not count for texture coordinates.
    let square = SQUARE.replace("v 1 1 1", "v 1 1 1 5");
    let import = parse(&format!(
        "{square}{texture}{}end\n",
        saddle.replace("bezier", "rat bezier")
    ));
    let import = import.unwrap();
    assert_eq!(messages(&import), [""; 0]);
    let patch = &import.scene.patches()[0];
    for (u, v) in [(0.5, 0.0), (0.75, 0.5), (1.0, 1.0)] {
        let found = patch.texture_coordinates(DVec2::new(u, v));
        assert!(
            found.distance(DVec2::new(2.0 * u, 3.0 * v + u * v)) < 1e-14,
            "{found}"
        );
    }
    let some = parse(&format!(
        "{SQUARE}{texture}{}end\n",
        SADDLE.replace("1 2 3 4", "1/1 2 3 4//1")
    ));
    let some = some.unwrap();
    assert!(some.scene.patches()[0].texture.is_none());
    assert_eq!(
        messages(&some),
        [
            "line 11, surf: normals of surfaces are not used; theirs are exact",
            "line 11, surf: some points have texture vertices, others not; none is used"
        ]
    );
}

#[test]
fn vertices_have_colours_of_either_kind() {
    let dark = kernel::linear_from_srgb(DVec3::splat(1.0 / 255.0));
    for (one, ones, expected) in [("1", "1.01 1 1", DVec3::ONE), ("255", "1 1 1", dark)] {
        let text = format!(
            "v 0 0 0 {one} 0 0\nv 1 0 0 0 {one} 0\nv 0 1 0 0 0 {one}\nv 1 1 0\nf 1 2 3\n\
             v 9 9 9 {ones}\nf 4 3 5\n"
        );
        let import = parse(&text).unwrap();
        let mesh = &import.scene.meshes()[0];
        let colors: Vec<_> = mesh.colors().iter().map(|c| c.truncate()).collect();
        assert_eq!(colors, [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE, expected]);
        let white = import.scene.material(mesh.material.unwrap());
        assert_eq!(white.diffuse, DVec3::ONE);
        assert_eq!(messages(&import), [""; 0]);
    }
}

#[test]
fn borders_of_one_surface_meet_the_limit_of_merging_groups() {
    let count = 20_001;
    let mut text = format!("{SQUARE}cstype bezier\ndeg 1 1\n");
    for k in 0..count {
        let angle = std::f64::consts::TAU * f64::from(k) / f64::from(count);
        text += &format!(
            "vp {} {}\n",
            0.5 + 0.4 * angle.cos(),
            0.5 + 0.4 * angle.sin()
        );
    }
    let list = |from: i32| -> String { (from..=count).map(|k| format!(" {k}")).collect() };
    text += &format!("curv2{} 1\nparm u{}\nend\nmg 1 0.1\n", list(1), list(0));
    text += &format!("{SADDLE}trim 0 {count} 1\nend\n");
    let import = parse(&text).unwrap();
    assert_eq!(
        messages(&import),
        ["mg: more than 20000 borders in merging groups"]
    );
}

#[test]
fn statements_about_the_picture_are_checked() {
    let good = "s 1\ns off\nmg 2 0.1\nmg off\nlod 10\nbevel off\nc_interp off\nd_interp off\n\
                ctech cparm 2\nctech cspace 0.1\nctech curv 0.1 5\nstech cparma 1 2\nstech cparmb 3\n\
                stech cspace 1\nstech curv 0.1 10\nres 4 4\nusemap off\nshadow_obj off\n";
    let import = parse(&format!("{good}v 1 2 3\np 1\n")).unwrap();
    assert_eq!(import.warnings.as_slice().len(), 1);
    for (text, message) in [
        ("s two", "\"two\" is not a whole number"),
        ("mg 1", "0 numbers; 1 are needed"),
        ("mg 1 -2", "-2 where a positive number is needed"),
        ("lod 101", "level 101; levels go from 0 to 100"),
        ("bevel", "\"\" where on or off is needed"),
        ("bevel on", "edges are shown without bevels"),
        ("d_interp on", "materials are not blended between vertices"),
        (
            "ctech cparma 1 2",
            "\"cparma\" is none of cparm, cspace, curv",
        ),
        ("stech curv 1", "1 numbers; 2 are needed"),
        ("shadow_obj a.obj", "shadows are those of the object itself"),
        ("trace_obj", "the name of a file is missing"),
        (
            "maplib a.map",
            "texture libraries are not used; maps of materials are",
        ),
    ] {
        let import = parse(&format!("v 1 2 3\np 1\n{text}\n")).unwrap();
        let keyword = text.split(' ').next().unwrap();
        let expected = format!("line 3, {keyword}: {message}");
        assert_eq!(messages(&import)[0], expected);
    }
}

#[test]
fn curves_and_points_alone_are_a_scene_without_surface() {
    let text = format!(
        "{SQUARE}g axis\ncstype bezier\ndeg 1\ncurv 0.5 1 1 4\nparm u 0 1\nsp 1 2\nend\n\
         p 1 2\np -1\nl 1 2/1 3\ng\ncdc 1 2 4 3 1\n"
    );
    let import = parse(&format!("vp 0.75\nvp 0.25\n{text}")).unwrap();
    let WireShape::Curve(curve) = wire(&import, "curv 1") else {
        panic!("a curve");
    };
    assert_eq!(
        (curve.domain(), curve.start()),
        (0.5..1.0, DVec3::splat(0.5))
    );
    let points = |source| match wire(&import, source) {
        WireShape::Points(points) => points.clone(),
        WireShape::Curve(_) => panic!("points"),
    };
    assert_eq!(points(", sp"), [DVec3::splat(0.75)]);
    assert_eq!(points(", p"), [DVec3::ZERO, DVec3::X, DVec3::ONE]);
    let WireShape::Curve(line) = wire(&import, ", l") else {
        panic!("a line");
    };
    assert_eq!((line.degree(), line.end()), (1, DVec3::Y));
    let WireShape::Curve(cardinal) = wire(&import, ", cdc") else {
        panic!("a curve");
    };
    assert_eq!((cardinal.start(), cardinal.end()), (DVec3::X, DVec3::Y));
    let scene = &import.scene;
    let root = scene.node(scene.root().unwrap());
    assert_eq!(root.wires.len(), 1);
    assert!(matches!(root.children[..], [Child::Node(id)] if scene.node(id).wires.len() == 4));
    let found = messages(&import);
    let outside = "line 12, sp: a special point is not on its curve or surface";
    let nothing = "the file: there is no surface to show, only curves and points";
    assert_eq!(found, [outside, nothing]);

    let import = parse("v 1 2 3\n").unwrap();
    assert!(import.scene.root().is_none());
    assert_eq!(import.warnings.as_slice().len(), 1);
}
