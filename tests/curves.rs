//! Files of curves and points without a surface, as their user meets them.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;

use glam::DVec3;
use kernel::{UpAxis, WireShape};
use nurbray::formats::{Limits, open};

#[expect(dead_code, reason = "these tests use a part of it")]
mod program;

use program::Place;

/// One curve and nothing else.
const CURVE: &str =
    "v 0 0 0\nv 1 2 0\nv 2 0 0\ncstype bezier\ndeg 2\ncurv 0 1 1 2 3\nparm u 0 1\nend\n";

#[test]
fn who_renders_curves_alone_is_told_how() {
    let place = Place::new();
    fs::write(place.path("curve.obj"), CURVE).unwrap();
    let run = place.run("render curve.obj -o curve.png --size 8x8");
    assert_eq!(run.code, Some(2));
    let words =
        "curve.obj: there is no surface to render, only 1 curves and points; --curves draws";
    assert!(run.stderr.contains(words), "{}", run.stderr);
    let run = place.run("render curve.obj -o curve.png --size 8x8 --curves");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
}

#[test]
fn curves_alone_are_converted_where_they_can_be() {
    let place = Place::new();
    fs::write(place.path("curve.obj"), CURVE).unwrap();
    for out in ["out.obj", "out.x3d", "out.wrl", "out.igs"] {
        let run = place.run(&format!("convert curve.obj -o {out}"));
        assert_eq!(run.code, Some(0), "{out}: {}", run.stderr);
        let scene = open(place.path(out), &Limits::default()).unwrap().scene;
        assert_eq!(scene.wires().len(), 1, "{out}");
    }
    for out in ["out.ply", "out.stl"] {
        let run = place.run(&format!("convert curve.obj -o {out}"));
        assert_eq!(run.code, Some(2), "{out}");
        let words = "there is no surface to convert, only 1 curves and points";
        assert!(run.stderr.contains(words), "{}", run.stderr);
    }
}

#[test]
fn curves_become_lines_within_the_tolerance() {
    let place = Place::new();
    let shown = "cstype bezier\ndeg 1 1\nsurf 0 1 0 1 1 2 3 4\nparm u 0 1\nparm v 0 1\nend\n";
    let faced = format!("{CURVE}v 1 1 1\n{shown}p 1\n");
    for (text, count) in [(CURVE, 0), (&faced, 1)] {
        fs::write(place.path("curve.obj"), text).unwrap();
        for options in ["", "--quantize", "--meshopt"] {
            let run = place.run(&format!(
                "convert curve.obj -o c.glb --tolerance 0.001 --json {options}"
            ));
            assert_eq!(run.code, Some(0), "{}", run.stderr);
            let told: serde_json::Value = serde_json::from_str(run.stdout.trim()).unwrap();
            assert_eq!(told["left_out"].as_array().unwrap().len(), 0, "{told}");
            let lines = told["lines"].as_u64().unwrap();
            assert!((24..80).contains(&lines), "{lines}");
        }
        let run = place.run("convert curve.obj -o c.glb --tolerance 0.001");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let bytes = fs::read(place.path("c.glb")).unwrap();
        let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(&bytes).unwrap();
        let primitives = document.meshes().flat_map(|mesh| mesh.primitives());
        let (lines, others): (Vec<_>, Vec<_>) =
            primitives.partition(|own| own.mode() == gltf::mesh::Mode::Lines);
        assert_eq!((lines.len(), others.len()), (1, 2 * count));
        let reader = lines[0].reader(|_| blob.as_deref());
        let points: Vec<_> = reader.read_positions().unwrap().collect();
        assert!(points.len() % 2 == 0 && points.first() != points.last());
        for pair in points.chunks_exact(2) {
            for [x, y, z] in [pair[0], pair[1]] {
                // The curve is y = 2 x - x^2.
                assert!((y - x * (2.0 - x)).abs() < 1e-6 && z.abs() < 1e-9);
            }
            let [x, y] = [0, 1].map(|k| f32::midpoint(pair[0][k], pair[1][k]));
            assert!((y - x * (2.0 - x)).abs() < 2e-3, "{x} {y}");
        }
        let run = place.run("convert curve.obj -o c.obj --triangles --tolerance 0.001");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let scene = open(place.path("c.obj"), &Limits::default()).unwrap().scene;
        assert_eq!(scene.wires().len(), 1 + count);
    }
}

#[test]
#[expect(clippy::cast_possible_truncation, reason = "places of a small scene")]
fn curves_and_points_keep_their_places_and_colours_in_iges() {
    let place = Place::new();
    let text = "#X3D V3.3 utf8\nGroup { children [
        DEF Arc Shape {
          geometry DEF Bow NurbsCurve {
            order 3
            controlPoint Coordinate { point [0 0 0, 1 2 0, 2 0 1] }
            weight [1 0.5 1]
          }
          appearance Appearance { material Material { diffuseColor 0 0 0 emissiveColor 1 0.5 0 } }
        }
        Transform { translation 1 2 3 scale 1 2 1 children USE Arc }
        Transform { rotation 0 0 1 0.5 children Shape {
          geometry PointSet { coord Coordinate { point [0 0 0, 1 1 1] } } } }
        Transform { scale 2 2 2 children Transform { children [USE Arc, Shape { geometry Sphere {} }] } }
      ] }";
    fs::write(place.path("bow.x3dv"), text).unwrap();
    let run = place.run("convert bow.x3dv -o bow.igs");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    // Of every curve the ends and a place between them, of points they themselves; with their colours.
    let told = |file: &str| {
        let scene = open(place.path(file), &Limits::default()).unwrap().scene;
        let up = scene.up;
        let mut told: Vec<_> = scene
            .wire_placements()
            .iter()
            .flat_map(|placed| {
                let wire = scene.wire(placed.wire);
                let points = match &wire.shape {
                    WireShape::Curve(curve) => {
                        let domain = curve.knots().domain();
                        let at = |share: f64| domain.start + (domain.end - domain.start) * share;
                        [0.0, 0.3, 1.0]
                            .map(|share| curve.evaluate(at(share)))
                            .to_vec()
                    }
                    WireShape::Points(points) => points.clone(),
                };
                let material = wire.material.map(|id| scene.material(id));
                let color = material.map_or(DVec3::ZERO, |m| m.diffuse + m.emissive);
                points.into_iter().map(move |point| {
                    let [x, y, z] = placed.world_from_object.transform_point3(point).to_array();
                    let place = if up == UpAxis::Y {
                        [x, -z, y]
                    } else {
                        [x, y, z]
                    };
                    [place, color.to_array()].concat()
                })
            })
            .map(|numbers| {
                let rounded = numbers.iter().map(|x| (x * 1e6).round() as i64);
                rounded.collect::<Vec<_>>()
            })
            .collect();
        told.sort();
        told
    };
    let wanted = told("bow.x3dv");
    assert_eq!((wanted.len(), told("bow.igs")), (11, wanted));
}
