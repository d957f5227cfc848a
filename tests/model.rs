//! Bodies of measured points, from files to surfaces and volumes.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;

use serde_json::Value;

mod program;

use program::{Place, assert_snapshot};

fn json(place: &Place, line: &str) -> Value {
    let run = place.run(line);
    assert_eq!(run.code, Some(0), "{line}: {}", run.stderr);
    serde_json::from_str(&run.stdout).unwrap()
}

/// Names and volumes of the bodies in an answer.
fn volumes(answer: &Value) -> Vec<(String, f64)> {
    let bodies = answer["bodies"].as_array().unwrap().iter();
    bodies
        .map(|body| {
            let name = body["name"].as_str().unwrap().to_owned();
            (name, body["volume"].as_f64().unwrap())
        })
        .collect()
}

/// The volumes that the generator tells.
fn told(stderr: &str) -> Vec<(String, f64)> {
    stderr
        .lines()
        .filter_map(|line| {
            let (name, rest) = line.split_once(": the volume is ")?;
            Some((
                name.to_owned(),
                rest.strip_suffix(" mm^3")?.parse().unwrap(),
            ))
        })
        .collect()
}

#[test]
fn structure_sets_become_bodies_of_known_volume() {
    let place = Place::new();
    let run = place.run("model --synthetic skull,pathology --layers 17 --points 64 -o head.dcm");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let known = told(&run.stderr);
    assert_eq!(known.len(), 2);
    for ending in ["x3d", "igs"] {
        let line = format!("model head.dcm -o head.{ending} --opacity skull=0.3");
        let run = place.run(&line);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let answer = json(&place, &format!("volume head.{ending} --json"));
        assert_eq!(answer["open_faces"], 0);
        let found = volumes(&answer);
        assert_eq!(found.len(), 2, "{answer}");
        for ((name, found), (known_name, known)) in found.iter().zip(&known) {
            assert_eq!(name, known_name);
            assert!(
                (found / known - 1.0).abs() < 1e-3,
                "{name}: {found} {known}"
            );
        }
        let total = answer["total"]["volume"].as_f64().unwrap();
        assert!((total / (found[0].1 + found[1].1) - 1.0).abs() < 1e-14);
        assert_eq!(answer["unit"]["name"], "mm");
    }
    let run = place.run("model head.dcm -o head.glb --body pathology --tolerance 1%");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
}

#[test]
fn a_structure_set_of_another_program_is_read() {
    let place = Place::new();
    let run = place.run("model samples/phantom.dcm -o phantom.x3d --caps rounded");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    // Points of interest are told, not used.
    assert!(
        run.stderr
            .contains("ROI 3 \"Isocentre\": points that are no contours"),
        "{}",
        run.stderr
    );
    let found = volumes(&json(&place, "volume phantom.x3d --json"));
    let names: Vec<_> = found.iter().map(|body| body.0.as_str()).collect();
    assert_eq!(names, ["Körper", "Tube"]);
}

#[test]
fn grids_are_interpolated() {
    let place = Place::new();
    let run = place.run("model --synthetic sphere --layers 21 --points 48 -o ball.csv");
    let known = told(&run.stderr)[0].1;
    for method in [
        "coons",
        "coons --twist zero",
        "interpolate",
        "interpolate --degree 4,3 --parameters uniform",
        "loft",
        "contours",
    ] {
        for caps in ["flat", "rounded"] {
            let line =
                format!("model ball.csv -o ball.x3d --method {method} --caps {caps} --unit mm");
            let run = place.run(&line);
            assert_eq!(run.code, Some(0), "{line}: {}", run.stderr);
            let found = volumes(&json(&place, "volume ball.x3d --json"));
            assert_eq!(found.len(), 1, "{line}");
            let most = match (method, caps) {
                ("contours", _) => 0.04,
                (_, "flat") => 5e-3,
                _ => 0.01,
            };
            assert!(
                (found[0].1 / known - 1.0).abs() < most,
                "{line}: {found:?} {known}"
            );
        }
    }
    let line = "model ball.csv -o open.x3d --caps none";
    assert_eq!(place.run(line).code, Some(0));
    let answer = json(&place, "volume open.x3d --json");
    assert_eq!(
        (
            answer["bodies"].as_array().unwrap().len(),
            answer["open_faces"].as_u64()
        ),
        (0, Some(20))
    );
}

#[test]
fn methods_of_volumes_agree_as_they_should() {
    let place = Place::new();
    place.run("model --synthetic pathology --layers 9 --points 24 -o zone.csv");
    place.run("model zone.csv -o zone.x3d --method interpolate");
    for (method, most) in [
        ("formula", 1e-12),
        ("midpoint", 2e-4),
        ("midpoint --nodes 40", 1e-5),
        ("printed --nodes 40", 0.1),
    ] {
        let answer = json(&place, &format!("volume zone.x3d --json --method {method}"));
        let exact = volumes(&answer)[0].1;
        let found = answer["volumes"][0].as_f64().unwrap();
        assert!(
            (found / exact - 1.0).abs() < most,
            "{method}: {found} {exact}"
        );
    }
    // Sections of a prism are all the same.
    for (sides, method) in [(6, "trapezoid"), (8, "cavalieri")] {
        let ring = |z: usize| {
            (0..sides).map(move |k| {
                let (y, x) = (TAU * f64::from(k) / f64::from(sides)).sin_cos();
                format!("{z},{x},{y},{z}\n")
            })
        };
        let rows: String = (0..3).flat_map(ring).collect();
        fs::write(place.path("prism.csv"), format!("layer,x,y,z\n{rows}")).unwrap();
        assert_eq!(place.run("model prism.csv -o prism.x3d").code, Some(0));
        let line = format!("volume prism.x3d --json --slices 5 --method {method}");
        let answer = json(&place, &line);
        let (exact, found) = (
            volumes(&answer)[0].1,
            answer["volumes"][0].as_f64().unwrap(),
        );
        assert!(
            (found / exact - 1.0).abs() < 1e-4,
            "{method}: {found} {exact}"
        );
    }
    let run = place.run("volume samples/sphere_torus.x3d --method formula");
    assert_eq!(run.code, Some(2));
    assert!(
        run.stderr
            .contains("is rational; --method gauss measures it"),
        "{}",
        run.stderr
    );
}

#[test]
fn voids_are_told_and_subtracted() {
    let place = Place::new();
    let answer = json(
        &place,
        "volume samples/hollow.igs --json --slices 4 --method cavalieri",
    );
    assert_eq!(answer["bodies"][0]["voids"], 1);
    for found in [&answer["total"]["volume"], &answer["volumes"][0]] {
        let found = found.as_f64().unwrap();
        assert!((found - 22.0).abs() < 1e-6, "{answer}");
    }
    for line in [
        "volume samples/hollow.igs",
        "info samples/hollow.igs --measure",
    ] {
        let run = place.run(line);
        assert!(run.stdout.contains(", 1 void"), "{}", run.stdout);
    }
}

/// Contours of a slanted prism, one for each height.
fn prism(heights: &[f64]) -> String {
    let mut text = String::from("layer,x,y,z\n");
    for (number, z) in (1..).zip(heights) {
        for (x, y) in [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)] {
            writeln!(text, "{number},{},{y},{z}", x + z).unwrap();
        }
    }
    text
}

#[test]
fn branches_are_split_where_they_are_asked_to() {
    let place = Place::new();
    let square = |layer: &str, x: f64, size: f64, z: f64| {
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let rows = corners.map(|(a, b)| format!("{layer},{},{},{z}\n", x + a * size, b * size));
        rows.concat()
    };
    let mut text = String::from("layer,x,y,z\n");
    for z in 0..3 {
        text += &square(&format!("t{z}"), 0.0, 9.0, f64::from(z));
    }
    for z in 3..6 {
        text += &square(&format!("a{z}"), 0.5, 3.0, f64::from(z));
        text += &square(&format!("b{z}"), 5.5, 3.0, f64::from(z));
    }
    fs::write(place.path("y.csv"), text).unwrap();
    let run = place.run("model y.csv -o y.x3d");
    assert_eq!(run.code, Some(2));
    assert!(
        run.stderr
            .contains("2 contours at height 3: the body branches"),
        "{}",
        run.stderr
    );
    assert_eq!(place.files(), ["y.csv"]);
    let run = place.run("model y.csv -o y.x3d --branches split");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let answer = json(&place, "volume y.x3d --json");
    assert_eq!(volumes(&answer).len(), 3, "{answer}");
}

/// Points that make no body: what is said, and nothing is written.
#[test]
fn bad_points_are_explained() {
    let good = prism(&[0.0, 1.0, 2.0]);
    let replaced = |from: &str, to: &str| good.replacen(from, to, 1);
    let arc: String = (0..40)
        .map(|k| f64::from(k) * 0.05)
        .map(|a| format!("{},{},0\n", a.cos(), a.sin()))
        .collect();
    let cases = [
        ("open contour", format!("{arc}\n{arc}"), "loft"),
        (
            "crossing contour",
            replaced("2,5,0,1\n2,5,3,1", "2,5,3,1\n2,5,0,1"),
            "loft",
        ),
        ("one-point layer", format!("{good}4,0,0,3\n"), "loft"),
        (
            "unequal rows",
            format!("{good}4,0,0,3\n4,1,0,3\n4,1,1,3\n"),
            "coons",
        ),
        ("not a number", replaced("3,6,0,2", "3,NaN,0,2"), "loft"),
        ("not finite", replaced("3,6,0,2", "3,6,0,inf"), "loft"),
        ("no number", replaced("3,6,0,2", "3,6,zero,2"), "loft"),
        (
            "duplicate points",
            replaced("2,5,0,1", "2,5,0,1\n2,5,0,1"),
            "loft",
        ),
        (
            "duplicate points of a grid",
            replaced("2,5,0,1", "2,1,0,1"),
            "interpolate",
        ),
        ("layers out of order", prism(&[0.0, 2.0, 1.0, 3.0]), "loft"),
        ("a layer twice", prism(&[0.0, 1.0, 1.0, 3.0]), "loft"),
        ("one layer", prism(&[0.0]), "contours"),
        (
            "a line",
            "0,0,0\n1,0,0\n2,0,0\n\n0,0,1\n1,0,1\n2,0,1\n".to_owned(),
            "loft",
        ),
        ("too few rows", prism(&[0.0, 1.0]), "interpolate"),
        ("missing column", "x,y\n0,0\n".to_owned(), "loft"),
        ("nothing", "# only this\n".to_owned(), "loft"),
    ];
    let place = Place::new();
    let mut found = String::new();
    for (name, text, method) in cases {
        fs::write(place.path("data.csv"), text).unwrap();
        let run = place.run(&format!("model data.csv -o body.x3d --method {method}"));
        assert_eq!(run.code, Some(2), "{name}: {}", run.stderr);
        assert_eq!(place.files(), ["data.csv"], "{name}");
        writeln!(found, "{name}, --method {method}\n{}", run.stderr).unwrap();
    }
    let open = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nl 1 2 3\nl 4 5 6 4\n";
    fs::write(place.path("data.obj"), open).unwrap();
    let run = place.run("model data.obj -o body.x3d");
    assert_eq!(run.code, Some(2));
    writeln!(found, "open polyline\n{}", run.stderr).unwrap();
    assert_snapshot("bad_points.txt", &found);
}

#[test]
fn repairs_are_told() {
    let place = Place::new();
    let text = prism(&[0.0, 2.0, 1.0, 3.0]).replacen("1,4,0,0\n", "1,4,0,0\n1,4,0,0\n", 1);
    fs::write(place.path("data.csv"), text).unwrap();
    let run = place.run("model data.csv -o body.x3d --repair --method contours");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(
        run.stderr.contains("layer 3: layers are put in order"),
        "{}",
        run.stderr
    );
    assert!(
        run.stderr.contains("a point that repeats is left out"),
        "{}",
        run.stderr
    );
}
