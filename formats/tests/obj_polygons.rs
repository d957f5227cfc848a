//! Polygons are those that `tobj` reads where it understands a file on its own, and right where it
//! does not.

use std::fmt::Write as _;

use glam::{DVec2, DVec3, DVec4};
use kernel::WireShape;
use nurbray_formats::{Limits, NoFiles, ReadOptions, read};

/// A bent strip of quads and triangles in three groups, by references from both ends.
fn strip(texcoords: bool, normals: bool) -> String {
    let mut text = String::new();
    // Writing into a string cannot fail.
    for k in 0..60 {
        let (x, y) = (f64::from(k / 2), f64::from(k % 2));
        let z = (x * 0.3).sin();
        let _ = writeln!(text, "v {x} {y} {z:?}\nvt {:?} {y}\nvn 0 {y} 1", x / 30.0);
    }
    for k in 0..29 {
        if k % 10 == 0 {
            let _ = writeln!(text, "g part {}", k / 10);
        }
        let corner = |i: i32| {
            let i = if k % 3 == 0 { i - 61 } else { i };
            match (texcoords, normals) {
                (false, false) => format!("{i}"),
                (true, false) => format!("{i}/{i}"),
                (false, true) => format!("{i}//{i}"),
                (true, true) => format!("{i}/{i}/{i}"),
            }
        };
        let first = 2 * k + 1;
        let mut corners = vec![first, first + 2, first + 3];
        corners.extend((k % 4 > 0).then_some(first + 1));
        let corners: Vec<_> = corners.into_iter().map(corner).collect();
        let _ = writeln!(text, "f {}", corners.join(" "));
    }
    text
}

fn triples(list: &[f64]) -> Vec<DVec3> {
    let chunks = list.chunks_exact(3);
    chunks.map(|c| DVec3::new(c[0], c[1], c[2])).collect()
}

#[test]
fn polygons_are_those_that_tobj_reads() {
    for (texcoords, normals) in [(false, false), (true, false), (false, true), (true, true)] {
        let text = strip(texcoords, normals);
        let limits = Limits::default();
        let options = ReadOptions {
            limits: &limits,
            resolver: &NoFiles,
        };
        let import = read(text.as_bytes(), Some("obj"), &options).unwrap();
        assert!(import.warnings.as_slice().is_empty());
        let options = tobj::LoadOptions {
            single_index: true,
            triangulate: true,
            ..tobj::LoadOptions::default()
        };
        let nothing = |_: &std::path::Path| Err(tobj::LoadError::GenericFailure);
        let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, nothing).unwrap();
        assert_eq!(import.scene.meshes().len(), 3);
        for (ours, model) in import.scene.meshes().iter().zip(&models) {
            let theirs = &model.mesh;
            assert_eq!(ours.name, model.name);
            assert_eq!(ours.positions(), triples(&theirs.positions));
            assert_eq!(ours.normals(), triples(&theirs.normals));
            let uvs = theirs.texcoords.chunks_exact(2);
            let uvs: Vec<_> = uvs.map(|c| DVec2::new(c[0], c[1])).collect();
            assert_eq!(ours.uvs(), uvs);
            let triangles = theirs.indices.chunks_exact(3);
            let triangles: Vec<_> = triangles.map(|c| [c[0], c[1], c[2]]).collect();
            assert_eq!(ours.triangles(), triangles);
        }
    }
}

#[test]
fn what_tobj_would_take_for_something_else_is_right() {
    // A comment, a weight, a colour at one vertex, short and long entries, and wild references.
    let text = "v 0 0 0 # first\nv 1 0 0 2\nv 1 1 0 255 0 0\nv 0 1 0\nvt 0.5\nvn 0 0 1 9\n\
                f 1 2 3 4 # all\nf -4//1 2//1 3//1\nf 4 3 99999999999999999999\n\
                f 1/4611686018427387905 2 3\nl 1 2 3\nl 3/7 -1\nf\\\n 1/1 \\\n 2/1 4/1\n";
    for text in [text.to_owned(), text.replace('\n', "\r")] {
        let limits = Limits::default();
        let options = ReadOptions {
            limits: &limits,
            resolver: &NoFiles,
        };
        let import = read(text.as_bytes(), Some("obj"), &options).unwrap();
        let warnings: Vec<_> = import.warnings.as_slice().iter().collect();
        assert_eq!(warnings.len(), 2, "{warnings:?}");
        let [flat, with_normals, with_texcoords] = import.scene.meshes() else {
            panic!("{} meshes", import.scene.meshes().len());
        };
        let corners = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        assert_eq!(flat.positions(), corners);
        assert_eq!(flat.triangles(), [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
        let red = DVec4::new(1.0, 0.0, 0.0, 1.0);
        assert_eq!(flat.colors(), [DVec4::ONE, DVec4::ONE, red, DVec4::ONE]);
        assert_eq!(with_normals.normals(), [DVec3::Z; 3]);
        assert_eq!(with_texcoords.uvs(), [DVec2::new(0.5, 0.0); 3]);
        assert!(with_texcoords.colors().is_empty());
        let lines = import.scene.wires().iter().map(|wire| match &wire.shape {
            WireShape::Curve(curve) => curve.points().collect(),
            WireShape::Points(points) => points.clone(),
        });
        let lines: Vec<Vec<DVec3>> = lines.collect();
        assert_eq!(lines, [corners[..3].to_vec(), corners[2..].to_vec()]);
    }
}
