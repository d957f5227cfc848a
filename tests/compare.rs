//! `nurbray compare`: the report, what fails, and what is wrong with meshes, in words.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fmt::Write as _;
use std::fs;

use serde_json::Value;

#[expect(dead_code, reason = "other tests use more of it")]
mod program;

use program::{Place, assert_snapshot};

/// Runs a comparison and reads its report.
fn report(place: &Place, line: &str) -> Value {
    let run = place.run(&format!("compare {line} -o report --size 160x120"));
    assert!(matches!(run.code, Some(0 | 1)), "{line}: {}", run.stderr);
    serde_json::from_slice(&fs::read(place.path("report/report.json")).unwrap()).unwrap()
}

#[test]
fn the_report_holds_all_that_it_promises() {
    let place = Place::new();
    assert_snapshot("help_compare.txt", &place.run("compare --help").stdout);
    let found = report(&place, "samples/goblet.x3d --tolerance 2%,0.5%");
    let meshes = found["meshes"].as_array().unwrap();
    assert_eq!(meshes.len(), 2);
    let number = |mesh: &Value, key: &str| mesh[key].as_f64().unwrap();
    for mesh in meshes {
        let (found, proven) = (
            number(mesh, "hausdorff_found"),
            number(mesh, "hausdorff_proven"),
        );
        assert!(0.0 < found && found <= proven && proven <= number(mesh, "tolerance"));
        assert!(number(mesh, "chord_rms") <= number(mesh, "chord_sampled"));
        assert!(number(mesh, "chord_sampled") <= number(mesh, "chord_proven"));
        assert!(number(&mesh["distance"], "rms") <= found);
        assert_eq!(mesh["faults"], Value::Array(Vec::new()), "{mesh}");
        let worst = &mesh["surface_to_mesh"]["worst"][0];
        assert!(number(worst, "distance") <= found * (1.0 + 1e-9));
    }
    for key in [
        "hausdorff_found",
        "flip",
        "silhouette_pixels_16_samples",
        "depth_p99",
    ] {
        assert!(number(&meshes[1], key) < number(&meshes[0], key), "{key}");
    }
    assert!(number(&meshes[1], "ssim") > number(&meshes[0], "ssim"));
    let pictures = [
        "smooth",
        "flat",
        "wire",
        "difference",
        "flip",
        "heat",
        "silhouette",
    ];
    let names = pictures
        .iter()
        .flat_map(|n| [format!("mesh1-{n}.png"), format!("mesh2-{n}.png")]);
    let others = [
        "exact.png",
        "exact.exr",
        "mesh1.glb",
        "mesh1-smooth.exr",
        "mesh2-deviation.exr",
    ];
    let others = others.into_iter().map(str::to_owned);
    for name in names.chain(others) {
        let size = fs::metadata(place.path("report").join(&name))
            .unwrap()
            .len();
        assert!(size > 100, "{name}");
    }
    let summary = fs::read_to_string(place.path("report/summary.md")).unwrap();
    assert!(summary.contains("| Hausdorff, proven") && summary.contains("The exact picture took"));
    let page = fs::read_to_string(place.path("report/index.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("data:image/png;base64,"));
    for outside in ["http:", "https:", "src=\"", "href=\""] {
        assert!(!page.contains(outside), "{outside}");
    }
}

#[test]
fn curves_that_are_points_do_not_hide_the_border() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../shared/corpus/iges/made_brep186_screw.igs"
    );
    if !std::path::Path::new(path).exists() {
        return;
    }
    let place = Place::new();
    let mesh = &report(&place, &format!("{path} --samples 1 --tolerance 0.05%"))["meshes"][0];
    let number = |key: &str| mesh[key].as_f64().unwrap();
    let (found, tolerance) = (number("hausdorff_found"), number("tolerance"));
    assert!((0.3..1.0).contains(&(found / tolerance)), "{found}");
}

#[test]
fn a_limit_sets_the_exit_code() {
    let place = Place::new();
    for (limit, code) in [("0.5%", 0), ("0.001%", 1), ("1e-11%", 1)] {
        let line = "compare samples/can.igs --tolerance 0.4% -o report --size 80x60";
        let run = place.run(&format!("{line} --fail-above {limit}"));
        assert_eq!(run.code, Some(code), "{limit}: {}", run.stderr);
        assert_eq!(run.stderr.contains("--fail-above is"), code == 1);
    }
}

#[test]
fn a_limit_that_holds_is_proven_of_meshes_of_others() {
    let place = Place::new();
    let made = "convert samples/goblet.x3d -o goblet.glb --tolerance 1%";
    assert_eq!(place.run(made).code, Some(0));
    let line = "compare samples/goblet.x3d goblet.glb -o report --size 32x24 --samples 1";
    let run = place.run(&format!("{line} --fail-above 1%"));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
}

#[test]
fn surfaces_are_not_taken_for_an_empty_mesh() {
    let place = Place::new();
    let run = place.run("compare samples/sphere_torus.x3d samples/goblet.x3d -o report");
    assert_eq!(run.code, Some(2));
    let text = "goblet.x3d: it holds surfaces and no triangles";
    assert!(run.stderr.contains(text), "{}", run.stderr);
}

/// The triangles of a text of OBJ polygons as a text of STL, moved by `map`; `keep` chooses
/// triangles by their numbers.
fn stl(obj: &str, map: impl Fn([f64; 3]) -> [f64; 3], keep: impl Fn(usize) -> bool) -> String {
    let numbers = |line: &str| -> Vec<f64> {
        line.split_whitespace()
            .skip(1)
            .map(|w| w.parse().unwrap())
            .collect()
    };
    let points: Vec<[f64; 3]> = obj
        .lines()
        .filter(|line| line.starts_with("v "))
        .map(|line| map(numbers(line)[..3].try_into().unwrap()))
        .collect();
    let mut text = String::from("solid mesh\n");
    let faces = obj.lines().filter(|line| line.starts_with("f "));
    for face in faces
        .enumerate()
        .filter(|(k, _)| keep(*k))
        .map(|(_, face)| face)
    {
        for corner in face.split_whitespace().skip(1) {
            let number: usize = corner.split('/').next().unwrap().parse().unwrap();
            let [x, y, z] = points[number - 1];
            writeln!(text, "vertex {x:?} {y:?} {z:?}").unwrap();
        }
    }
    text
}

#[test]
fn what_is_wrong_with_a_mesh_is_named() {
    let place = Place::new();
    let made = "convert samples/can.igs -o can.obj --triangles --tolerance 0.1%";
    assert_eq!(place.run(made).code, Some(0));
    let obj = fs::read_to_string(place.path("can.obj")).unwrap();
    let all = |_| true;
    let same = |p: [f64; 3]| p;
    // Triangles come face by face; the first of them belong to the first.
    let count = obj.lines().filter(|line| line.starts_with("f ")).count();
    let first = obj.split("\ng ").nth(1).unwrap();
    let first = first.lines().filter(|line| line.starts_with("f ")).count();
    let mut stray = stl(&obj, same, all);
    for p in ["900 900 900", "930 900 900", "900 930 900"] {
        writeln!(stray, "vertex {p}").unwrap();
    }
    let turned = stl(&obj, |[x, y, z]| [x, -z, y], all);
    let cases = [
        ("good", stl(&obj, same, all), ""),
        ("missing", stl(&obj, same, |k| k >= first), "missing patch"),
        ("extra", stray, "extra geometry"),
        (
            "mirrored",
            stl(&obj, |[x, y, z]| [-x, y, z], all),
            "mirrored",
        ),
        (
            "elsewhere",
            stl(&obj, |[x, y, z]| [x - 5000.0, y, z], all),
            "moved",
        ),
        (
            "units",
            stl(&obj, |p| p.map(|c| c * 0.001), all),
            "wrong units",
        ),
        ("turned", turned, "wrong upward axis"),
        ("empty", stl(&obj, same, |k| k >= count), "empty mesh"),
    ];
    let mut line = String::from("samples/can.igs");
    for (name, text, _) in &cases {
        fs::write(place.path(&format!("{name}.stl")), text).unwrap();
        write!(line, " {name}.stl").unwrap();
    }
    let found = report(&place, &line);
    for (k, (name, _, kind)) in cases.into_iter().enumerate() {
        let faults = found["meshes"][k]["faults"].as_array().unwrap();
        let kinds: Vec<&str> = faults.iter().map(|f| f["kind"].as_str().unwrap()).collect();
        if kind.is_empty() {
            assert!(kinds.is_empty(), "{name}: {faults:?}");
        } else {
            assert!(kinds.contains(&kind), "{name}: {faults:?}");
        }
    }
}

/// A file with a square whose sides are ten.
fn square() -> String {
    let row = |y: f64| [[0.0, y, 0.0], [10.0, y, 0.0]];
    format!(
        "#X3D V3.3 utf8\nPROFILE Full\n{}",
        surface(&[row(0.0), row(10.0)])
    )
}

#[test]
fn what_cannot_be_measured_is_null() {
    let place = Place::new();
    fs::write(place.path("square.x3dv"), square()).unwrap();
    let empty = r#"{ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{}] }"#;
    fs::write(place.path("empty.gltf"), empty).unwrap();
    let beside = "v 90 0 0\nv 91 0 0\nv 90 1 0\nf 1 2 3\n";
    fs::write(place.path("beside.obj"), beside).unwrap();
    let found = report(&place, "square.x3dv empty.gltf beside.obj");
    let [empty, beside] = [0, 1].map(|k| &found["meshes"][k]);
    assert_eq!(kinds(empty), ["empty mesh"]);
    for key in ["distance", "flat_normals_deg", "smooth_normals_deg"] {
        for value in ["mean", "rms", "p95", "max"] {
            assert!(empty[key][value].is_null(), "{empty}");
            assert!(beside[key][value].is_number(), "{beside}");
        }
    }
    assert!(empty["mesh_to_surface"]["found"].is_null(), "{empty}");
    for key in ["depth_max", "depth_p99", "position_max", "position_p99"] {
        assert!(empty[key].is_null() && beside[key].is_null(), "{key}");
    }
    let summary = fs::read_to_string(place.path("report/summary.md")).unwrap();
    for words in ["nothing to measure", "no pixel shows both"] {
        assert!(summary.contains(words), "{summary}");
    }
}

#[test]
fn a_small_part_elsewhere_does_not_hide_other_faults() {
    let place = Place::new();
    fs::write(place.path("square.x3dv"), square()).unwrap();
    let points = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\n";
    let small = "v 0 0 5\nv 1 0 5\nv 0 1 5\nf 5 6 7\n";
    let extra = format!("{points}{small}f 1 2 3 4\n");
    let halved = format!("{points}{small}f 1 2 3\n");
    let corner = points.replace("v 0 10 0", "v 0 10 1") + "f 1 2 3\nf 1 3 4\n";
    let above = "v 0 0 3\nv 10 0 4\nv 10 10 3\nv 0 10 4\nf 1 2 3\nf 1 3 4\n".to_owned();
    let mut line = String::from("square.x3dv");
    for (name, text) in [
        ("extra", extra),
        ("halved", halved),
        ("corner", corner),
        ("above", above),
    ] {
        fs::write(place.path(&format!("{name}.obj")), text).unwrap();
        write!(line, " {name}.obj").unwrap();
    }
    let found = report(&place, &line);
    assert_eq!(kinds(&found["meshes"][0]), ["extra geometry"]);
    assert_eq!(
        kinds(&found["meshes"][1]),
        ["missing patch", "extra geometry"]
    );
    assert!(kinds(&found["meshes"][2]).is_empty(), "{found}");
    assert_eq!(kinds(&found["meshes"][3]), ["elsewhere"]);
}

#[test]
fn triangles_that_look_inwards_are_counted_beside_others() {
    let place = Place::new();
    let sphere = "#X3D V3.3 utf8\nPROFILE Full\nShape { geometry Sphere {} }\n";
    fs::write(place.path("sphere.x3dv"), sphere).unwrap();
    let made = "convert sphere.x3dv -o sphere.obj --triangles --tolerance 0.5%";
    assert_eq!(place.run(made).code, Some(0));
    let obj = fs::read_to_string(place.path("sphere.obj")).unwrap();
    // Every third one is turned over.
    let mut number = 0;
    let turned = obj.lines().map(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["f", a, b, c] => {
                number += 1;
                let [b, c] = if number % 3 == 0 { [c, b] } else { [b, c] };
                format!("f {a} {b} {c}\n")
            }
            _ => format!("{line}\n"),
        }
    });
    fs::write(place.path("turned.obj"), turned.collect::<String>()).unwrap();
    let found = report(&place, "sphere.x3dv turned.obj");
    let fault = &found["meshes"][0]["faults"][0];
    assert_eq!(fault["kind"], "inside out");
    let text = fault["text"].as_str().unwrap();
    let told = ["32 %", "33 %", "34 %"]
        .iter()
        .any(|share| text.contains(share));
    assert!(told, "{text}");
}

/// A surface in a text of X3D, with rows of two control points.
fn surface(rows: &[[[f64; 3]; 2]]) -> String {
    let order = rows.len();
    let knots = ["0 ".repeat(order), "1 ".repeat(order)].concat();
    let mut text = format!(
        "Shape {{ geometry NurbsPatchSurface {{ uDimension 2 vDimension {order} uOrder 2 vOrder \
         {order} uKnot [ 0 0 1 1 ] vKnot [ {knots}] solid FALSE\ncontrolPoint Coordinate {{ point ["
    );
    for [x, y, z] in rows.iter().flatten() {
        write!(text, " {x:?} {y:?} {z:?},").unwrap();
    }
    text + " ] } } }\n"
}

/// A file with a cube whose sides are one, and what else is in it.
fn cube(rest: &str) -> String {
    let mut text = String::from("#X3D V3.3 utf8\nPROFILE Full\nDEF cube Group { children [\n");
    for axis in 0..3 {
        for side in [0.0, 1.0] {
            let turned = |p: [f64; 3]| [0, 1, 2].map(|k: usize| p[(k + 3 - axis) % 3]);
            let row = |v: f64| [0.0, 1.0].map(|u| turned([side, u, v]));
            text += &surface(&[row(0.0), row(1.0)]);
        }
    }
    format!("{text}] }}\n{rest}")
}

/// The kinds of the faults of a mesh in a report.
fn kinds(mesh: &Value) -> Vec<&str> {
    let faults = mesh["faults"].as_array().unwrap().iter();
    faults.map(|f| f["kind"].as_str().unwrap()).collect()
}

#[test]
fn bodies_that_touch_look_outwards() {
    let place = Place::new();
    let beside = cube("Transform { translation 1 0 0 children USE cube }\n");
    fs::write(place.path("cubes.x3dv"), beside).unwrap();
    for line in ["-o good.glb", "-o good.obj --triangles"] {
        assert_eq!(
            place.run(&format!("convert cubes.x3dv {line}")).code,
            Some(0)
        );
    }
    let obj = fs::read_to_string(place.path("good.obj")).unwrap();
    let mirrored = stl(&obj, |[x, y, z]| [2.0 - x, y, z], |_| true);
    fs::write(place.path("mirrored.stl"), mirrored).unwrap();
    let found = report(&place, "cubes.x3dv good.glb mirrored.stl");
    assert!(kinds(&found["meshes"][0]).is_empty(), "{found}");
    assert_eq!(kinds(&found["meshes"][1]), ["inside out"], "{found}");
}

#[test]
fn strips_narrower_than_the_tolerance_miss_nothing() {
    let place = Place::new();
    // A strip along a parabola, and chords that stray by most of its width.
    let (width, height) = (0.01, 0.064);
    let row = |x: f64, y: f64| [[x, y, 2.0], [x, y + width, 2.0]];
    let strip = [row(0.0, 0.0), row(0.5, height), row(1.0, 0.0)];
    fs::write(place.path("strip.x3dv"), cube(&surface(&strip))).unwrap();
    fs::write(place.path("cube.x3dv"), cube("")).unwrap();
    let line = "convert cube.x3dv -o cube.obj --triangles";
    assert_eq!(place.run(line).code, Some(0));
    let obj = fs::read_to_string(place.path("cube.obj")).unwrap();
    let bare = stl(&obj, |p| p, |_| true);
    let mut whole = bare.clone();
    let top = row(0.5, 0.5 * height);
    for [[a, b], [c, d]] in [[strip[0], top], [top, strip[2]]] {
        for [x, y, z] in [a, b, c, c, b, d] {
            writeln!(whole, "vertex {x:?} {y:?} {z:?}").unwrap();
        }
    }
    for (name, text) in [("whole", &whole), ("bare", &bare)] {
        fs::write(place.path(&format!("{name}.stl")), text).unwrap();
    }
    let found = report(&place, "strip.x3dv whole.stl bare.stl");
    assert!(kinds(&found["meshes"][0]).is_empty(), "{found}");
    assert_eq!(kinds(&found["meshes"][1]), ["missing patch"], "{found}");
}

#[test]
fn meshes_of_the_exact_file_are_not_measured() {
    let place = Place::new();
    let polygons = "Transform { translation 0 0 9 children Shape { geometry IndexedFaceSet { \
                    coord Coordinate { point [ 0 0 0, 1 0 0, 1 1 0, 0 1 0 ] } coordIndex [ 0 1 2 \
                    3 -1 ] } } }\n";
    fs::write(place.path("both.x3dv"), cube(polygons)).unwrap();
    assert_eq!(place.run("convert both.x3dv -o both.glb").code, Some(0));
    fs::write(place.path("cube.x3dv"), cube("")).unwrap();
    let line = "convert cube.x3dv -o cube.obj --triangles";
    assert_eq!(place.run(line).code, Some(0));
    let obj = fs::read_to_string(place.path("cube.obj")).unwrap();
    let surfaces = stl(&obj, |p| p, |_| true);
    // The same square in other triangles, and what is in no file.
    let other = "v 0 0 9\nv 1 0 9\nv 1 1 9\nv 0 1 9\nf 1 2 4\nf 2 3 4\n";
    let other = surfaces.clone() + &stl(other, |p| p, |_| true);
    let stray = surfaces.clone() + &stl("v 0 0 8\nv 1 0 8\nv 1 1 8\nf 1 2 3\n", |p| p, |_| true);
    for (name, text) in [("other", other), ("stray", stray), ("surfaces", surfaces)] {
        fs::write(place.path(&format!("{name}.stl")), text).unwrap();
    }
    let found = report(
        &place,
        "both.x3dv both.glb other.stl stray.stl surfaces.stl",
    );
    let expected = [(2, true), (2, true), (0, false), (0, true)];
    for (mesh, (unmeasured, right)) in found["meshes"].as_array().unwrap().iter().zip(expected) {
        assert_eq!(mesh["triangles_not_measured"], unmeasured, "{mesh}");
        assert_eq!(kinds(mesh).is_empty(), right, "{mesh}");
        let distance = mesh["hausdorff_found"].as_f64().unwrap();
        assert_eq!(distance < 1e-6, right, "{mesh}");
    }
}

#[test]
fn a_report_replaces_an_earlier_one() {
    let place = Place::new();
    let line = "compare samples/goblet.x3d -o report --size 32x24 --samples 1 --tolerance";
    place.run(&format!("{line} 2%,1%"));
    assert!(place.path("report/mesh2.glb").is_file());
    assert!(place.path("report/mesh2-flip.png").is_file());
    fs::write(place.path("report/mesh2-notes.txt"), "mine").unwrap();
    let run = place.run(&format!("{line} 2%"));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let names = fs::read_dir(place.path("report")).unwrap();
    let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let second: Vec<_> = names.filter(|name| name.starts_with("mesh2")).collect();
    assert_eq!(second, ["mesh2-notes.txt"]);
}

#[test]
fn a_report_leaves_files_of_others_alone() {
    let place = Place::new();
    let options = "--size 32x24 --samples 1";
    let made = "convert samples/goblet.x3d -o mesh1.glb --tolerance 1%";
    assert_eq!(place.run(made).code, Some(0));
    fs::copy(place.path("mesh1.glb"), place.path("goblet.glb")).unwrap();
    fs::write(place.path("mesh1-flip.png"), "mine").unwrap();
    fs::write(place.path("report.json"), r#"{"files": ["mesh1.glb"]}"#).unwrap();
    let line = format!("compare samples/goblet.x3d goblet.glb -o other {options}");
    assert_eq!(place.run(&line).code, Some(0));
    let line = format!("compare samples/goblet.x3d samples/broken/nothing.stl -o . {options}");
    assert_eq!(place.run(&line).code, Some(2));
    for name in ["mesh1.glb", "mesh1-flip.png", "report.json"] {
        assert!(place.path(name).is_file(), "{name}");
    }
    // What is compared stays, though an earlier report has made it.
    let own = format!("compare samples/goblet.x3d -o report --tolerance 2% {options}");
    let again = format!("compare samples/goblet.x3d report/mesh1.glb -o report {options}");
    for line in [own, again] {
        assert_eq!(place.run(&line).code, Some(0), "{line}");
        assert!(place.path("report/mesh1.glb").is_file());
    }
}

#[test]
fn warnings_are_those_of_the_mesh_that_they_name() {
    let place = Place::new();
    // A binary file with one triangle, and one with a byte too many.
    let mut bytes = vec![0; 84 + 50];
    bytes[80] = 1;
    bytes[84 + 24 + 3] = 64;
    bytes[84 + 36 + 7] = 64;
    for folder in ["ma", "mb"] {
        fs::create_dir_all(place.path(folder)).unwrap();
        fs::write(place.path(folder).join("part.stl"), &bytes).unwrap();
        bytes.push(0);
    }
    let line = "compare samples/goblet.x3d ma/part.stl mb/part.stl -o report --size 32x24";
    let run = place.run(line);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stderr.contains("mb/part.stl") && !run.stderr.contains("ma/part.stl"));
}

#[test]
fn a_file_without_area_is_nothing_to_compare_with() {
    let place = Place::new();
    fs::write(
        place.path("line.x3dv"),
        "#X3D V3.3 utf8\nPROFILE Full\nShape { geometry NurbsPatchSurface { uDimension 2 \
         vDimension 2 uOrder 2 vOrder 2 uKnot [ 0 0 1 1 ] vKnot [ 0 0 1 1 ] \
         controlPoint Coordinate { point [ 0 0 0, 1 0 0, 0 0 0, 1 0 0 ] } } }\n",
    )
    .unwrap();
    fs::write(
        place.path("mesh.stl"),
        stl("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", |p| p, |_| true),
    )
    .unwrap();
    let run = place.run("compare line.x3dv mesh.stl -o report --fail-above 1mm");
    assert_eq!(run.code, Some(2));
    assert!(
        run.stderr.contains("no surface to compare with"),
        "{}",
        run.stderr
    );
}
