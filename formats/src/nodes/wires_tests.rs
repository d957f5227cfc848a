//! Lines and points, and their colours.

use glam::DVec3;
use kernel::Material;

use super::tests::read_scene;
use crate::{Limits, NoFiles, ReadOptions, WRITERS, read};

#[test]
fn lines_and_points_are_wires() {
    let import = read_scene(
        "Transform { children Shape { geometry NurbsCurve { order 3 knot [ 0 0 0 1 1 1 ] \
         weight [ 1 0.5 1 ] controlPoint Coordinate { point [ 1 0 0, 0.5 0.5 0, 0 1 0 ] } } } }\n\
         Shape { appearance Appearance { material Material { emissiveColor 1 0 0 } } geometry \
         IndexedLineSet { coord Coordinate { point [ 0 0 0, 1 0 0, 2 0 0 ] } \
         coordIndex [ 0 1 -1 1 2 0 ] } }\n\
         Shape { geometry LineSet { vertexCount [ 2 ] coord Coordinate { point [ 0 0 0, 1 0 0 ] } } }\n\
         Shape { geometry Arc2D { radius 2 startAngle 1 endAngle 1 } }\n\
         Shape { geometry Disk2D { innerRadius 0.5 outerRadius 0.5 } }\n\
         Shape { geometry PointSet { coord Coordinate { point [ 1 2 3 ] } } }",
    );
    assert_eq!(import.warnings.as_slice(), []);
    let wires = import.scene.wires();
    let count = |shape: &kernel::WireShape| match shape {
        kernel::WireShape::Curve(curve) => curve.points().count(),
        kernel::WireShape::Points(points) => 10 * points.len(),
    };
    let counts: Vec<_> = wires.iter().map(|w| count(&w.shape)).collect();
    assert_eq!(counts, [3, 2, 3, 2, 9, 9, 10]);
    assert!(wires[1].material.is_some() && wires[0].material.is_none());
    let kernel::WireShape::Curve(curve) = &wires[0].shape else {
        panic!("a curve");
    };
    // Weights are in the points: the middle one is (1, 1), but no circle with this weight.
    assert_eq!(curve.points().nth(1), Some(DVec3::new(1.0, 1.0, 0.0)));
    assert_eq!(import.scene.placement_count(), 0);
}

#[test]
fn lines_end_where_a_point_is_missing() {
    let coord = "coord Coordinate { point [ 0 0 0, 1 0 0, 1 1 0 ] }";
    let short = "lines of less than two points, or that end where one is not among the 3 there are";
    for (text, lines, warning) in [
        ("LineSet { vertexCount [ 5 ]", vec![3], short),
        ("LineSet { vertexCount [ 2 -3 ]", vec![2], short),
        (
            "IndexedLineSet { coordIndex [ 0 1 2 -1 0 1 -7 2 -1 7 0 ]",
            vec![3, 2],
            short,
        ),
        (
            "LineSet { vertexCount [ 3 ] color Color { color [ 1 0 0, 1 0 0, 1 0 0 ] }",
            vec![3],
            "colours of lines and points are not used",
        ),
    ] {
        let import = read_scene(&format!("Shape {{ geometry {text} {coord} }} }}"));
        let wires = import.scene.wires().iter();
        let counts: Vec<_> = wires
            .map(|wire| match &wire.shape {
                kernel::WireShape::Curve(curve) => curve.points().count(),
                kernel::WireShape::Points(_) => 0,
            })
            .collect();
        assert_eq!(counts, lines, "{text}");
        let problems = import.warnings.as_slice().iter();
        let problems: Vec<_> = problems.map(|w| w.problem.to_string()).collect();
        let nothing = "there is no surface to show, only curves and points";
        assert!(problems.contains(&warning.to_owned()), "{problems:?}");
        assert!(
            problems.iter().all(|p| p == warning || p == nothing),
            "{problems:?}"
        );
    }
}

#[test]
fn lines_and_points_have_the_colour_that_is_sent_out() {
    let read_material = |material: &str| {
        let import = read_scene(&format!(
            "Shape {{ appearance Appearance {{ material {material} }} \
             geometry PointSet {{ coord Coordinate {{ point [ 1 2 3 ] }} }} }}"
        ));
        let wire = &import.scene.wires()[0];
        let material = import.scene.material(wire.material.unwrap()).clone();
        (import.scene, material)
    };
    // No light falls on them.
    let (scene, found) = read_material("Material { emissiveColor 0 0 1 diffuseColor 1 0 0 }");
    assert_eq!(found, Material::unlit(DVec3::Z));
    // What only has a colour of surfaces is shown in that; other programs show it black.
    let (lit, found) = read_material("DEF only Material { diffuseColor 1 0 0 }");
    assert_eq!(found.flat(), DVec3::X);
    // They are written so that others show the same.
    let (limits, resolver) = (&Limits::default(), &NoFiles);
    for writer in ["X3D", "X3D ClassicVRML", "VRML 97"] {
        let writer = WRITERS.iter().find(|w| w.name == writer).unwrap();
        for (scene, color, name) in [(&scene, DVec3::Z, ""), (&lit, DVec3::X, "only")] {
            let export = (writer.write)(scene, "a").unwrap();
            assert_eq!(export.warnings.as_slice(), [], "{}", writer.name);
            let text = String::from_utf8_lossy(&export.bytes);
            assert!(text.contains("emissiveColor"), "{text}");
            let again = read(&export.bytes, None, &ReadOptions { limits, resolver }).unwrap();
            let wire = &again.scene.wires()[0];
            let found = again.scene.material(wire.material.unwrap());
            let named = Material {
                name: name.to_owned(),
                ..Material::unlit(color)
            };
            assert_eq!((found.flat(), &found.name), (named.emissive, &named.name));
            assert!(found.is_unlit(), "{text}");
        }
    }
}

#[test]
fn surfaces_and_lines_may_share_a_material() {
    let import = read_scene(
        "Shape { appearance DEF A Appearance { material Material { emissiveColor 0 0 1 diffuseColor 1 0 0 } } \
         geometry PointSet { coord Coordinate { point [ 1 2 3 ] } } }\n\
         Shape { appearance USE A geometry Sphere { } }",
    );
    let placement = &import.scene.placements()[0];
    let material = import.scene.material(placement.material.unwrap());
    assert_eq!((material.diffuse, material.emissive), (DVec3::X, DVec3::Z));
}
