//! `nurbray convert` as its user meets it.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;

use nurbray::convert::Target;
use nurbray::formats::{Limits, open};
use nurbray::gltf::{Packing, rounding};
use serde_json::Value;

mod program;

use program::{Place, assert_snapshot};

/// The lines of an answer, read as JSON.
fn lines(text: &str) -> Vec<Value> {
    let lines = text.lines();
    lines
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

#[test]
fn help() {
    let run = Place::new().run("convert --help");
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    assert_snapshot("help_convert.txt", &run.stdout);
}

#[test]
fn one_bad_file_does_not_stop_the_batch() {
    let place = Place::new();
    let run = place.run(
        "convert nothing.obj samples/broken/obj_zero_index.obj samples/teapot.obj \
         samples/goblet.x3d -o out/{stem}.igs --log json",
    );
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    assert!(
        run.stderr.ends_with("nurbray: 2 files failed\n"),
        "{}",
        run.stderr
    );
    let lines = lines(&run.stdout);
    let status: Vec<_> = lines
        .iter()
        .map(|line| line["status"].as_str().unwrap())
        .collect();
    assert_eq!(status, ["failed", "failed", "ok", "ok"]);
    assert!(lines[0]["error"].as_str().unwrap().contains("nothing.obj"));
    assert_eq!(lines[2]["output"], "out/teapot.igs");
    let (from, to) = (&lines[2]["from"], &lines[2]["to"]);
    assert_eq!((from.as_str(), to.as_str()), (Some("OBJ"), Some("IGES")));
    assert_eq!(lines[2]["patches"], 32);
    let bytes = fs::metadata(place.path("out/teapot.igs")).unwrap().len();
    assert_eq!(lines[2]["bytes"].as_u64(), Some(bytes));
    assert_eq!(fs::read_dir(place.path("out")).unwrap().count(), 2);
    // Without a good file among them it is an error like others.
    let run = place.run("convert nothing.obj -o nothing.igs --json");
    assert_eq!(run.code, Some(2));
    assert_eq!(run.stdout.lines().count(), 1);
}

#[test]
fn faces_without_triangles_are_named() {
    let place = Place::new();
    let text = "#VRML V2.0 utf8\n\
        Shape { geometry Box { size 1000 1000 1000 } }\n\
        Shape { geometry DEF SPECK Sphere { radius 1e-6 } }\n";
    fs::write(place.path("speck.wrl"), text).unwrap();
    let run = place.run("convert speck.wrl -o speck.glb --json");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let report = &lines(&run.stdout)[0];
    let left_out = &report["left_out"][0];
    assert!(
        left_out["text"].as_str().unwrap().contains("no triangle"),
        "{left_out}"
    );
    assert_eq!(left_out["count"], 1);
    assert!(
        left_out["places"][0]["what"]
            .as_str()
            .unwrap()
            .contains("SPECK")
    );
    assert_eq!(
        (report["shells"].as_u64(), report["closed_shells"].as_u64()),
        (Some(2), Some(1))
    );
    let told = "speck.glb: warning: VRML SPECK line 3, ";
    assert!(run.stderr.contains(told), "{}", run.stderr);
    let told = "7 patches, 12 triangles, 1 of 2 shells closed, ";
    assert!(run.stderr.contains(told), "{}", run.stderr);
    // A file without any triangle has no buffer: it would be empty.
    let text = "#VRML V2.0 utf8\nShape { geometry Sphere { radius 1e-6 } }\n";
    fs::write(place.path("alone.wrl"), text).unwrap();
    let run = place.run("convert alone.wrl -o none.glb --tolerance 1");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let bytes = fs::read(place.path("none.glb")).unwrap();
    let text = String::from_utf8_lossy(&bytes);
    assert!(!text.contains("BIN") && !text.contains("buffers"), "{text}");
}

#[test]
fn faces_with_boundaries_that_cross_are_proven() {
    let place = Place::new();
    let hole = |low: f64, high: f64| {
        format!(
            "Contour2D {{ children ContourPolyline2D {{ controlPoint \
             [ {low} {low}, {low} {high}, {high} {high}, {high} {low}, {low} {low} ] }} }}"
        )
    };
    let text = format!(
        "#X3D V3.3 utf8\nPROFILE Full\nShape {{ geometry DEF PLATE NurbsTrimmedSurface {{ \
         uDimension 2 vDimension 2 uOrder 2 vOrder 2 uKnot [ 0 0 1 1 ] vKnot [ 0 0 1 1 ] \
         controlPoint Coordinate {{ point [ 0 0 0, 1 0 0, 0 1 0, 1 1 0 ] }} trimmingContour [ \
         Contour2D {{ children ContourPolyline2D {{ \
         controlPoint [ 0 0, 1 0, 1 1, 0 1, 0 0 ] }} }} {} {} ] }} }}\n",
        hole(0.2, 0.5),
        hole(0.4, 0.8)
    );
    fs::write(place.path("plate.x3dv"), text).unwrap();
    let run = place.run("convert plate.x3dv -o plate.glb --json");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let report = &lines(&run.stdout)[0];
    assert_eq!(report["left_out"].as_array().unwrap().len(), 0, "{report}");
    let number = |key: &str| report[key].as_f64().unwrap();
    assert!(
        number("proven_deviation") <= number("tolerance"),
        "{report}"
    );
    let count = |key: &str| report[key].as_u64();
    assert_eq!(count("unproven_triangles"), Some(0));
    assert_eq!(count("crossings"), Some(0));
    // Two sides of each hole are divided by the other one.
    assert_eq!(count("naked_sides"), Some(4 + 6 + 6));
}

#[test]
fn folders_are_mirrored() {
    let place = Place::new();
    let folder = place.path("parts/wheels");
    fs::create_dir_all(&folder).unwrap();
    fs::copy(place.path("samples/teapot.obj"), folder.join("front.obj")).unwrap();
    fs::copy(
        place.path("samples/goblet.x3d"),
        place.path("parts/axle.x3d"),
    )
    .unwrap();
    fs::write(folder.join("notes.txt"), "no surface").unwrap();
    let run = place.run("convert parts samples/teapot.obj -o {stem}.igs --out-dir out");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    for name in ["axle.igs", "wheels/front.igs", "samples/teapot.igs"] {
        assert!(place.path("out").join(name).is_file(), "{name}");
    }
}

#[test]
fn the_same_file_gives_the_same_bytes() {
    let place = Place::new();
    for extension in Target::all().flat_map(Target::extensions) {
        for folder in ["a", "b"] {
            let files = "samples/teapot.obj samples/goblet.x3d samples/sphere_torus.x3d \
                         samples/two_surfaces.igs";
            let line = format!(
                "convert {files} -o {{stem}}.{extension} --out-dir {folder} --tolerance 1%"
            );
            place.run(&line);
        }
        for stem in ["teapot", "goblet", "sphere_torus", "two_surfaces"] {
            let name = format!("{stem}.{extension}");
            let [a, b] =
                ["a", "b"].map(|f| fs::read(place.path(f).join("samples").join(&name)).unwrap());
            assert_eq!(a, b, "{name}");
        }
    }
}

#[test]
fn nothing_is_left_behind_when_writing_fails() {
    let place = Place::new();
    // A folder stands where the file should go.
    fs::create_dir_all(place.path("t.igs/occupied")).unwrap();
    let run = place.run("convert samples/teapot.obj -o t.igs");
    assert_eq!(run.code, Some(2));
    assert_eq!(place.files(), ["t.igs"]);
    // Nor is what would stand beside it.
    fs::create_dir_all(place.path("t.obj/occupied")).unwrap();
    let run = place.run("convert samples/teapot.obj -o t.obj");
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    assert_eq!(place.files(), ["t.igs", "t.obj"]);
    let run = place.run("convert samples/teapot.obj -o ok.igs");
    assert_eq!(run.code, Some(0));
    let import = open(place.path("ok.igs"), &Limits::default()).unwrap();
    assert_eq!(import.scene.placement_count(), 32);
}

/// Every file below a folder with its content, temporary ones among them.
fn contents(folder: &std::path::Path) -> std::collections::BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    let files = entries.map(|e| {
        (
            e.file_name().into_string().unwrap(),
            fs::read(e.path()).unwrap(),
        )
    });
    files.collect()
}

#[test]
fn triangles_in_glb_are_aligned_measured_and_the_same_every_time() {
    let place = Place::new();
    for name in ["a", "b"] {
        let run = place.run(&format!(
            "convert samples/two_surfaces.igs -o {name}/part.glb --tolerance 0.5mm --json"
        ));
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let line = &lines(&run.stdout)[0];
        let number = |key: &str| line[key].as_f64().unwrap();
        assert!(number("proven_deviation") <= 0.5);
        assert_eq!(line["tolerance"], 0.5);
        assert!(number("sampled_deviation") <= number("proven_deviation"));
    }
    assert_eq!(contents(&place.path("a")), contents(&place.path("b")));
    let bytes = fs::read(place.path("a/part.glb")).unwrap();
    let size = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(
        (&bytes[..4], size(4), size(8)),
        (&b"glTF"[..], 2, bytes.len())
    );
    assert!(size(12).is_multiple_of(4) && size(20 + size(12)).is_multiple_of(4));
    let json: Value = serde_json::from_slice(&bytes[20..20 + size(12)]).unwrap();
    // Millimetres with Z upwards become metres with Y upwards in one node.
    let turned = &json["nodes"][0];
    assert_eq!(
        turned["scale"][0].as_f64().map(|x| (x * 1e6).round()),
        Some(1000.0)
    );
    assert!(turned["rotation"][0].as_f64().unwrap() < -0.7);
    let extras = &json["asset"]["extras"];
    assert_eq!(extras["source"], "two_surfaces.igs");
    assert!(extras["proven_deviation_m"].as_f64().unwrap() <= 0.5e-3);
    assert_eq!(json["materials"].as_array().unwrap().len(), 2);
}

/// Header and first buffer of a `.glb`.
fn parts(bytes: &[u8]) -> (Value, &[u8]) {
    let length = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let text = &bytes[20..20 + length(12)];
    (
        serde_json::from_slice(text).unwrap(),
        &bytes[28 + text.len()..],
    )
}

/// The largest distance of the points of the first mesh on a grid from those in single precision.
fn moved(coarse: (&Value, &[u8]), fine: (&Value, &[u8])) -> f64 {
    let number = |value: &Value| usize::try_from(value.as_u64().unwrap_or(0)).unwrap();
    let positions = |json: &Value| {
        let at = &json["meshes"][0]["primitives"][0]["attributes"]["POSITION"];
        let accessor = &json["accessors"][number(at)];
        let view = &json["bufferViews"][number(&accessor["bufferView"])];
        (number(&view["byteOffset"]), number(&accessor["count"]))
    };
    let ((coarse_at, count), (fine_at, same)) = (positions(coarse.0), positions(fine.0));
    assert_eq!(count, same);
    let nodes = coarse.0["nodes"].as_array().unwrap();
    let node = nodes.iter().find(|node| node["mesh"] == 0).unwrap();
    let of = |key: &str, k: usize| node[key][k].as_f64().unwrap();
    let distance = |vertex: usize| {
        let square = |k: usize| {
            let at = coarse_at + 8 * vertex + 2 * k;
            let step = u16::from_le_bytes(coarse.1[at..at + 2].try_into().unwrap());
            let there = of("translation", k) + of("scale", k) * f64::from(step);
            let at = fine_at + 12 * vertex + 4 * k;
            let here = f32::from_le_bytes(fine.1[at..at + 4].try_into().unwrap());
            (there - f64::from(here)).powi(2)
        };
        (0..3).map(square).sum::<f64>().sqrt()
    };
    (0..count).map(distance).fold(0.0, f64::max)
}

#[test]
fn many_places_of_a_shape_are_one_node() {
    let place = Place::new();
    let at = |k: usize, name: &str, shape: &str| {
        format!("{name} Transform {{ translation {k} 0 0 children {shape} }}\n")
    };
    let mut text = "#VRML V2.0 utf8\n".to_owned();
    text += &at(0, "", "DEF BALL Shape { geometry Sphere { radius 0.4 } }");
    text.extend((1..80).map(|k| at(k, "", "USE BALL")));
    // What has a name of its own keeps it.
    text += &at(80, "DEF LAST", "USE BALL");
    fs::write(place.path("row.wrl"), text).unwrap();
    let run = place.run("convert row.wrl -o row.glb");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let bytes = fs::read(place.path("row.glb")).unwrap();
    let (json, _) = parts(&bytes);
    let nodes = json["nodes"].as_array().unwrap();
    assert!(nodes.len() < 8, "{nodes:?}");
    let many = |node: &&Value| node["extensions"]["EXT_mesh_gpu_instancing"].is_object();
    assert_eq!(nodes.iter().filter(many).count(), 1);
    assert!(nodes.iter().any(|node| node["name"] == "LAST"));
}

#[test]
fn small_files_keep_the_tolerance() {
    let place = Place::new();
    let run = |options: &str, out: &str| {
        let run = place.run(&format!(
            "convert samples/can.igs -o {out} --json {options}"
        ));
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let deviation = lines(&run.stdout)[0]["proven_deviation"].as_f64().unwrap();
        (deviation, fs::read(place.path(out)).unwrap())
    };
    let (deviation, small) = run("--quantize --tolerance 0.05", "small.glb");
    assert!(deviation <= 0.05, "{deviation}");
    let (coarse, coarse_bytes) = parts(&small);
    let extras = &coarse["asset"]["extras"];
    assert!(extras["proven_deviation_m"].as_f64().unwrap() <= 0.05e-3);
    let asked = extras["tolerance_m"].as_f64().unwrap();
    assert!((asked - 0.05e-3).abs() < 1e-12, "{asked}");
    // The same triangles in single precision: of the tolerance that the grid leaves, and what
    // single precision takes of that.
    let scene = open("samples/can.igs", &Limits::default()).unwrap().scene;
    let roundings = [true, false].map(|quantize| {
        let meshopt = false;
        rounding(&scene, Packing { quantize, meshopt })
    });
    let [left, taken] = [0.05 - roundings[0], roundings[1]];
    assert!(
        taken > 0.0 && taken < 0.01 * left,
        "{taken}, {left} are left"
    );
    let (_, large) = run(&format!("--tolerance {}", left + taken), "large.glb");
    let (fine, fine_bytes) = parts(&large);
    let most = moved((&coarse, coarse_bytes), (&fine, fine_bytes));
    assert!(most > 0.0 && most <= 0.05 - left, "{most}, {left} are left");
    let (_, packed) = run("--quantize --meshopt --tolerance 0.05", "packed.glb");
    let required = parts(&packed).0["extensionsRequired"].to_string();
    for extension in ["KHR_mesh_quantization", "EXT_meshopt_compression"] {
        assert!(required.contains(extension), "{required}");
    }
    assert!(small.len() < large.len() && packed.len() < small.len());
    let refused = place.run("convert samples/can.igs -o can.stl --quantize");
    assert!(refused.stderr.contains("for glTF"), "{}", refused.stderr);
    let refused = place.run("convert samples/can.igs -o can.glb --quantize --tolerance 0.0001%");
    assert!(refused.stderr.contains("too much"), "{}", refused.stderr);
}

/// A bent patch ten units long, far away along x.
fn far_away(place: &Place) {
    let points = (0..6).map(|k| {
        let (along, across) = (f64::from(k % 3), f64::from(k / 3));
        let x = 5_000_000.3 + 5.0 * along;
        let y = if k % 3 == 1 { 5.0 } else { 0.0 };
        format!("v {x} {y} {}\n", 10.0 * across)
    });
    let text = format!(
        "cstype bezier\ndeg 2 1\n{}surf 0 1 0 1 1 2 3 4 5 6\nparm u 0 1\nparm v 0 1\nend\n",
        points.collect::<String>()
    );
    fs::write(place.path("far.obj"), text).unwrap();
}

#[test]
fn rounding_counts_in_the_tolerance() {
    let place = Place::new();
    far_away(&place);
    for format in ["STL", "PLY"] {
        let out = format!("far.{}", format.to_lowercase());
        let run = place.run(&format!("convert far.obj -o {out} --tolerance 0.005"));
        assert_eq!(run.code, Some(2), "{}", run.stderr);
        let why = format!("the 32-bit precision of {format} moves points by up to 2.980e-1");
        assert!(run.stderr.contains(&why), "{}", run.stderr);
        let run = place.run(&format!("convert far.obj -o {out} --tolerance 1 --json"));
        let line = &lines(&run.stdout)[0];
        let proven = line["proven_deviation"].as_f64().unwrap();
        assert!((0.298..=1.0).contains(&proven), "{line}");
        assert_eq!(line["tolerance"], 1.0);
    }
    // All digits, and digits near a point that single precision holds.
    for out in ["far_out.obj --triangles", "far.glb"] {
        let run = place.run(&format!(
            "convert far.obj -o {out} --tolerance 0.005 --json"
        ));
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let proven = lines(&run.stdout)[0]["proven_deviation"].as_f64().unwrap();
        assert!(proven <= 0.005, "{proven}");
    }
    let bytes = fs::read(place.path("far.glb")).unwrap();
    let (json, _) = parts(&bytes);
    let nodes = json["nodes"].as_array().unwrap();
    let node = nodes.iter().find(|node| node["mesh"] == 0).unwrap();
    let at = &json["meshes"][0]["primitives"][0]["attributes"]["POSITION"];
    let least = &json["accessors"][usize::try_from(at.as_u64().unwrap()).unwrap()]["min"][0];
    let x = node["translation"][0].as_f64().unwrap() + least.as_f64().unwrap();
    assert!((x - 5_000_000.3).abs() < 1e-6, "{x}");
    // A place of the file is what it is.
    let text = "#VRML V2.0 utf8\nTransform { translation 5000000.3 0 0 \
                children Shape { geometry Sphere { radius 5 } } }\n";
    fs::write(place.path("far.wrl"), text).unwrap();
    let run = place.run("convert far.wrl -o far.glb --tolerance 0.005");
    assert!(
        run.stderr.contains("32-bit precision of glTF"),
        "{}",
        run.stderr
    );
}

#[test]
fn a_grid_counts_as_it_is_stretched() {
    let place = Place::new();
    let text = "#VRML V2.0 utf8\nTransform { scale 0.001 1 1 \
                children Shape { geometry Box { size 1000 1 1 } } }\n";
    fs::write(place.path("flat.wrl"), text).unwrap();
    let line = "convert flat.wrl -o flat.glb --quantize --json --tolerance";
    let run = place.run(&format!("{line} 0.01"));
    assert!(run.stderr.contains("too much"), "{}", run.stderr);
    let run = place.run(&format!("{line} 0.1"));
    let proven = lines(&run.stdout)[0]["proven_deviation"].as_f64().unwrap();
    let half = 0.5 * 1000.0 / 65535.0;
    assert!((half..0.1).contains(&proven), "{proven}");
    let bytes = fs::read(place.path("flat.glb")).unwrap();
    let said = &parts(&bytes).0["asset"]["extras"]["proven_deviation_m"];
    assert_eq!(said.as_f64(), Some(proven));
}

#[test]
fn places_are_counted_before_they_are_written() {
    let place = Place::new();
    let mut text =
        "#VRML V2.0 utf8\nDEF BALL Shape { geometry Sphere { radius 0.4 } }\n".to_owned();
    text.extend(
        (1..100).map(|k| format!("Transform {{ translation {k} 0 0 children USE BALL }}\n")),
    );
    fs::write(place.path("row.wrl"), text).unwrap();
    let triangles = |line: &str| {
        let run = place.run(&format!(
            "convert row.wrl --tolerance 0.01 --json -o {line}"
        ));
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        lines(&run.stdout)[0]["triangles"].as_u64().unwrap()
    };
    let one = triangles("row.glb --most-points 2000");
    assert_eq!(triangles("row.stl"), 100 * one);
    let bytes = fs::read(place.path("row.stl")).unwrap();
    let counted = u32::from_le_bytes(bytes[80..84].try_into().unwrap());
    assert_eq!(u64::from(counted), 100 * one);
    assert_eq!(bytes.len(), 84 + 50 * counted as usize);
    assert_eq!(triangles("row.ply"), 100 * one);
    let bytes = fs::read(place.path("row.ply")).unwrap();
    let header = String::from_utf8_lossy(&bytes[..400]).into_owned();
    assert!(
        header.contains(&format!("element face {}\n", 100 * one)),
        "{header}"
    );
    for out in ["few.stl", "few.ply", "few.obj --triangles"] {
        let run = place.run(&format!(
            "convert row.wrl --tolerance 0.01 --most-points 2000 -o {out}"
        ));
        assert_eq!(run.code, Some(2), "{}", run.stderr);
        let why = "has every part again at each place";
        assert!(run.stderr.contains(why), "{}", run.stderr);
    }
}

#[test]
fn what_triangles_leave_out_is_named() {
    let place = Place::new();
    far_away(&place);
    let left_out = |line: &str| -> Vec<(String, u64)> {
        let run = place.run(&format!("convert {line} --tolerance 1% --json"));
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let lines = lines(&run.stdout);
        let list = lines[0]["left_out"].as_array().unwrap().iter();
        list.map(|left| {
            let text = left["text"].as_str().unwrap();
            let what = text.strip_suffix(" are not written").unwrap();
            (what.to_owned(), left["count"].as_u64().unwrap())
        })
        .collect()
    };
    let names =
        |line: &str| -> Vec<String> { left_out(line).into_iter().map(|(what, _)| what).collect() };
    let wires = "curves and points without a surface";
    assert_eq!(names("samples/mixed.obj -o m.glb"), [""; 0]);
    let plain = [wires, "materials", "pictures on surfaces", "names"];
    assert_eq!(names("samples/mixed.obj -o m.stl"), plain);
    assert_eq!(names("samples/mixed.obj -o m.ply"), plain);
    let groups = names("samples/mixed.obj -o m.obj --triangles");
    assert_eq!(
        groups,
        ["materials", "pictures on surfaces", "names of nodes"]
    );
    // What a file does not have is not missed.
    let near = fs::read_to_string(place.path("far.obj")).unwrap();
    fs::write(place.path("near.obj"), near.replace("5000", "")).unwrap();
    assert_eq!(left_out("near.obj -o near.stl"), []);
    let goblet = left_out("samples/goblet.x3d -o g.stl");
    let count = |what: &str| {
        goblet
            .iter()
            .find(|(name, _)| name == what)
            .map(|found| found.1)
    };
    assert_eq!(count("cameras"), Some(2), "{goblet:?}");
    assert_eq!(count(wires), None);
}

#[test]
fn a_batch_is_taken_up_again_and_divided() {
    let place = Place::new();
    let files = "convert samples/teapot.obj samples/two_surfaces.igs samples/goblet.x3d";
    let options = "--tolerance 1% --resume --jobs 2 --json";
    let run = place.run(&format!("{files} -o whole/{{stem}}.stl {options}"));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    for shard in 0..3 {
        let run = place.run(&format!(
            "{files} -o parts/{{stem}}.stl {options} --shard {shard}/3"
        ));
        assert_eq!((run.code, run.stdout.lines().count()), (Some(0), 1));
    }
    let whole = contents(&place.path("whole"));
    assert_eq!((whole.len(), &whole), (6, &contents(&place.path("parts"))));
    // As after a kill: one output unfinished, one without its record.
    fs::write(place.path("whole/goblet.stl.1.part"), "half").unwrap();
    fs::remove_file(place.path("whole/teapot.stl.done")).unwrap();
    let run = place.run(&format!("{files} -o whole/{{stem}}.stl {options}"));
    let mut status: Vec<_> = lines(&run.stdout)
        .iter()
        .map(|l| l["status"].clone())
        .collect();
    status.sort_by_key(ToString::to_string);
    assert_eq!(status, ["ok", "skipped", "skipped"]);
    assert_eq!(contents(&place.path("whole")), whole);
    // Other options are another output.
    let run = place.run(&format!(
        "{files} -o whole/{{stem}}.stl --tolerance 2% --resume --json"
    ));
    assert!(lines(&run.stdout).iter().all(|l| l["status"] == "ok"));
}

#[test]
fn written_files_give_the_same_picture() {
    let place = Place::new();
    let picture = |file: &str| {
        let run = place.run(&format!("render {file} -o {file}.png --size 96x72"));
        assert_eq!(run.code, Some(0), "{file}: {}", run.stderr);
        fs::read(place.path(&format!("{file}.png"))).unwrap()
    };
    // Pictures are named and not copied; IGES has neither pictures nor polygons.
    fs::copy(place.path("samples/weave.png"), place.path("weave.png")).unwrap();
    let ways: [(&str, &[&str]); 2] = [
        ("teapot", &["obj", "igs", "obj", "x3d", "obj"]),
        ("mixed", &["x3d", "obj", "obj"]),
    ];
    for (stem, way) in ways {
        let mut file = format!("samples/{stem}.obj");
        let mut first = picture(&file);
        for (step, extension) in way.iter().enumerate() {
            let next = format!("{stem}_{step}.{extension}");
            let run = place.run(&format!("convert {file} -o {next}"));
            assert_eq!(run.code, Some(0), "{next}: {}", run.stderr);
            file = next;
            if *extension == "igs" {
                // One colour of a material is left: no highlights.
                first = picture(&file);
            } else if *extension == "obj" {
                assert!(picture(&file) == first, "{file}");
            }
        }
    }
}
