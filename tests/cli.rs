//! The program as its user meets it: help, errors, exit codes and what it prints.
//!
//! Texts that are part of the product lie in `tests/snapshots`; `make bless` writes them
//! anew.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fmt::Write as _;
use std::fs;

use glam::{DVec2, DVec3};
use serde_json::Value;

mod program;

use program::{Place, assert_snapshot};

#[test]
fn help() {
    let place = Place::new();
    for (line, name) in [
        ("--help", "help.txt"),
        ("render --help", "help_render.txt"),
        ("info --help", "help_info.txt"),
        ("probe --help", "help_probe.txt"),
        ("model --help", "help_model.txt"),
        ("volume --help", "help_volume.txt"),
    ] {
        let run = place.run(line);
        assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
        assert_snapshot(name, &run.stdout);
    }
    assert_eq!(place.run("--version").code, Some(0));
}

/// Command lines that cannot work: each says why, gives 2 and writes no file.
const MISTAKES: &[&str] = &[
    "",
    "rnder samples/teapot.obj",
    "render samples/teapot.obj",
    "render samples/teapot.obj -o teapot.tiff",
    "render samples/teapot.obj samples/goblet.x3d -o one.png",
    "render samples/teapot.obj -o t.png --camera TABLE",
    "render samples/goblet.x3d -o g.png --camera KITCHEN",
    "render samples/teapot.obj -o t.png --size 640",
    "render samples/teapot.obj -o t.png --size 99999x99999",
    "render samples/teapot.obj -o t.png --eye 1,2",
    "render samples/teapot.obj -o t.png --eye 1,2,3 --target 1,2,3",
    "render samples/teapot.obj -o t.png --background pink",
    "render samples/goblet.x3d -o t.png --camera RIM --fov 20",
    "render samples/goblet.x3d -o t.png --camera RIM --up 1,0,0",
    "render samples/goblet.x3d -o t.png --time nan",
    "render samples/goblet.x3d -o t.png --threads 100000",
    "render samples/goblet.x3d -o t.png --method newton-map --write-map m.jpg",
    "render samples/goblet.x3d -o t.png --write-map {stem}.png",
    "render samples/goblet.x3d -o t.png --stats {stem}.jsonl",
    "render samples/goblet.x3d -o t.png --samples 1.5",
    "render samples/goblet.x3d -o t.png --relax-limits 0.5",
    "render samples/goblet.x3d --sheet {stem}.png",
    "render samples/goblet.x3d --sheet s.png --bits 16",
    "render samples/goblet.x3d --sheet s.png --shading none",
    "render samples/goblet.x3d --sheet s.png --write-map m.png",
    "render samples/goblet.x3d samples/teapot.obj -o {stem}.png --write-map m.png",
    "render samples/goblet.x3d -o t.png --write-map ./t.png",
    "render samples/teapot.obj -o t.png --method magic",
    "render samples/teapot.obj -o t.png --shading none",
    "render samples/teapot.obj -o t.exr --aov colour",
    "render samples/broken/obj_wrong_control_count.obj -o t.png",
    "convert samples/teapot.obj",
    "convert samples/teapot.obj -o teapot.doc",
    "convert samples/teapot.obj samples/goblet.x3d -o one.igs",
    "convert samples/two_surfaces.igs -o samples/two_surfaces.igs",
    "convert samples/two_surfaces.igs -o t.x3d --jobs 100000",
    "convert samples/broken/obj_wrong_control_count.obj -o t.igs",
    "info samples/teapot.mtl",
    "probe samples/teapot.obj",
    "probe samples/teapot.obj --rays - --uv -",
    "probe - --rays -",
    "probe samples/teapot.obj --rays nothing.csv",
    "model",
    "model samples/phantom.dcm -o phantom.doc",
    "model samples/phantom.dcm -o {stem}.x3d",
    "model --synthetic sphere -o s.x3d --seed 1.5",
    "model samples/phantom.dcm -o phantom.x3d --opacity Nobody=0.5",
    "model samples/phantom.dcm -o phantom.x3d --opacity 2",
    "model samples/phantom.dcm -o phantom.x3d --caps rounded --cap-height nan",
    "model samples/phantom.dcm -o phantom.x3d --method interpolate",
    "model samples/teapot.mtl -o teapot.x3d",
    "volume",
];

#[test]
fn mistakes_are_explained() {
    let place = Place::new();
    let mut found = String::new();
    for line in MISTAKES {
        let run = place.run(line);
        assert_eq!(run.code, Some(2), "{line}: {}", run.stderr);
        assert_eq!(run.stdout, "", "{line}");
        assert_eq!(place.files(), [""; 0], "{line}");
        writeln!(found, "$ nurbray {line}\n{}", run.stderr).unwrap();
    }
    assert_snapshot("mistakes.txt", &found);
}

#[test]
fn a_missing_file_is_named() {
    let place = Place::new();
    for command in ["render nothing.obj -o t.png", "info nothing.obj"] {
        let run = place.run(command);
        assert_eq!(run.code, Some(2));
        assert!(run.stderr.contains("nothing.obj"), "{}", run.stderr);
        assert_eq!(place.files(), [""; 0]);
    }
}

#[test]
fn cameras_are_found_by_what_viewers_show_and_by_their_other_name() {
    let place = Place::new();
    let views = "#X3D V3.3 utf8\nDEF VP Viewpoint { description \"front\" } Viewpoint { } \
                 Viewpoint { } Shape { geometry Sphere { } }";
    fs::write(place.path("a.x3dv"), views).unwrap();
    fs::write(
        place.path("b.x3dv"),
        "#X3D V3.3 utf8\nViewpoint { }\nShape { geometry Box { } }",
    )
    .unwrap();
    for name in ["front", "VP"] {
        let run = place.run(&format!(
            "render a.x3dv -o {name}.png --size 8x8 --camera {name}"
        ));
        assert_eq!(run.code, Some(0), "{}", run.stderr);
    }
    for (file, known) in [
        ("a.x3dv", "front (VP), 2 cameras without names"),
        ("b.x3dv", "1 camera without a name"),
    ] {
        let run = place.run(&format!("render {file} -o t.png --camera nope"));
        let expected = format!("no camera 'nope'; there is: {known}\n");
        assert!(run.stderr.ends_with(&expected), "{}", run.stderr);
    }
}

#[test]
fn one_bad_file_does_not_stop_the_rest() {
    let place = Place::new();
    let files = "nothing.igs samples/broken/iges_billion_counts.igs samples/broken/obj_zero_index.obj \
        samples/teapot.obj samples/two_surfaces.igs";
    let run = place.run(&format!(
        "render {files} -o pictures/{{stem}}.png --size 24x16 --stats stats.jsonl"
    ));
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    assert!(
        run.stderr.ends_with("nurbray: 3 files failed\n"),
        "{}",
        run.stderr
    );
    assert_eq!(place.files(), ["pictures", "stats.jsonl"]);
    assert_eq!(fs::read_dir(place.path("pictures")).unwrap().count(), 2);
    for stem in ["teapot", "two_surfaces"] {
        assert!(
            place
                .path("pictures")
                .join(stem)
                .with_extension("png")
                .is_file()
        );
    }
    let stats = fs::read_to_string(place.path("stats.jsonl")).unwrap();
    assert_eq!(stats.lines().count(), 5);
    let run = place.run(&format!("info --json {files}"));
    assert_eq!(run.code, Some(2));
    assert_eq!(run.stdout.lines().count(), 5);
    for line in run.stdout.lines() {
        let _: Value = serde_json::from_str(line).unwrap();
    }
}

#[test]
fn pictures_are_written_over_no_input() {
    let place = Place::new();
    let inputs = [
        "samples/mixed.obj",
        "samples/mixed.mtl",
        "samples/weave.png",
    ];
    let content = || inputs.map(|name| fs::read(place.path(name)).unwrap());
    let before = content();
    for line in [
        "-o t.png --stats samples/mixed.obj",
        "-o t.png --stats samples/mixed.mtl",
        "-o samples/../samples/weave.png",
        "--sheet samples/weave.png",
        "-o t.png --write-map samples/weave.png",
    ] {
        let run = place.run(&format!("render samples/mixed.obj --size 8x6 {line}"));
        assert_eq!(run.code, Some(2), "{line}");
        let why = "an input would be written over";
        assert!(run.stderr.contains(why), "{line}: {}", run.stderr);
        assert_eq!(place.files(), [""; 0], "{line}");
        assert!(content() == before, "{line}");
    }
}

#[test]
fn folders_are_made_before_the_work() {
    let place = Place::new();
    let run = place.run("render samples/teapot.obj --sheet a/s.png --size 8x6");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let line =
        "render samples/teapot.obj -o b/t.png --stats c/s.json --write-map d/m.png --size 8x6";
    let run = place.run(line);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    for name in ["a/s.png", "b/t.png", "c/s.json", "d/m.png"] {
        assert!(place.path(name).is_file(), "{name}");
    }
}

#[test]
fn nothing_is_left_behind_when_writing_fails() {
    let place = Place::new();
    // A folder stands where the file should go.
    for name in ["t.png", "t.exr", "stats.json"] {
        fs::create_dir(place.path(name)).unwrap();
        fs::write(place.path(name).join("occupied"), "").unwrap();
    }
    let before = place.files();
    for line in [
        "render samples/teapot.obj -o t.png --size 8x6",
        "render samples/teapot.obj -o t.exr --size 8x6",
    ] {
        assert_eq!(place.run(line).code, Some(2), "{line}");
        assert_eq!(place.files(), before, "{line}");
    }
    let run = place.run("render samples/teapot.obj -o ok.png --size 8x6 --stats stats.json");
    assert_eq!(run.code, Some(2));
    assert_eq!(place.files(), ["ok.png", "stats.json", "t.exr", "t.png"]);
}

#[test]
fn stats_tell_times_and_counts() {
    let place = Place::new();
    let run = place.run("render samples/teapot.obj -o t.png --size 64x48 --stats - --threads 2");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let stats: Value = serde_json::from_str(&run.stdout).unwrap();
    for key in ["read_s", "build_s", "trace_s", "shade_s", "write_s"] {
        let seconds = stats[key].as_f64().unwrap();
        assert!((0.0..600.0).contains(&seconds), "{key}: {seconds}");
    }
    let count = |key: &str| stats[key].as_u64().unwrap();
    assert_eq!(count("patches"), 32);
    assert!(count("cells") >= 32);
    assert!(count("accelerator_bytes") > 32 * 16 * 32);
    // Four samples per pixel, without the rays towards lights.
    assert_eq!(count("primary_rays"), 64 * 48 * 4);
    assert!(count("rays") > count("primary_rays"));
    assert!((1..count("primary_rays")).contains(&count("hits")));
    assert_eq!(count("threads"), 2);
}

#[test]
fn info_describes_the_file() {
    let place = Place::new();
    let run = place.run("info --json samples/sphere_torus.x3d");
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    let info: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(info["format"], "X3D");
    assert_eq!(info["patches"]["stored"], 2);
    assert_eq!(info["patches"]["shown"], 3);
    assert_eq!(info["patches"]["kinds"][0]["rational"], true);
    assert_eq!(info["cameras"][0], "From the front, a little from above");
    assert_eq!(info["warnings"].as_array().unwrap().len(), 0);
    let text = place.run("info samples/teapot.obj samples/broken/x3d_nan.x3d");
    assert_eq!(text.code, Some(0));
    assert_snapshot("info.txt", &text.stdout);
}

#[test]
fn info_marks_what_is_triangles() {
    let run = Place::new().run("info samples/mixed.obj");
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    for line in [
        "  meshes     3 stored, 3 shown, 22 triangles\n",
        "      floor (1 shapes, 1 of triangles)\n",
        "      sails (2 shapes)\n",
        "      wires (3 wires)\n",
    ] {
        assert!(run.stdout.contains(line), "{line}{}", run.stdout);
    }
}

#[test]
fn files_come_from_standard_input() {
    let place = Place::new();
    let teapot = fs::read(place.path("samples/teapot.obj")).unwrap();
    let run = place.run_with("info - --json", &teapot);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let info: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(info["patches"]["shown"], 32);
    let run = place.run_with("render - -o {stem}.png --size 24x16", &teapot);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_eq!(place.files(), ["stdin.png"]);
}

/// The middle of the sphere of `sphere_torus.x3d`, which has the radius 1.
const MIDDLE: DVec3 = DVec3::new(-2.3, 0.0, 0.0);

/// The rows of a CSV answer, without the heading.
fn rows(text: &str) -> Vec<Vec<&str>> {
    let rows = text.lines().skip(1);
    rows.map(|line| line.split(',').collect()).collect()
}

fn numbers<const N: usize>(fields: &[&str]) -> [f64; N] {
    let numbers: Vec<f64> = fields.iter().map(|f| f.parse().unwrap()).collect();
    numbers.try_into().expect("as many numbers as asked for")
}

#[test]
fn probe_finds_the_hits_of_a_sphere() {
    let place = Place::new();
    let mut input = String::from("ox,oy,oz,dx,dy,dz\n# a comment, then rays\n\n");
    let offsets: Vec<_> = (0..8)
        .map(|k| DVec2::from_angle(f64::from(k) + 0.4) * (0.1 + 0.1 * f64::from(k)))
        .collect();
    for offset in &offsets {
        let origin = MIDDLE + offset.extend(5.0);
        writeln!(input, "{:?},{:?},{:?},0,0,-2", origin.x, origin.y, origin.z).unwrap();
    }
    let run = place.run_with(
        "probe samples/sphere_torus.x3d --rays - --all",
        input.as_bytes(),
    );
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    let header = run.stdout.lines().next();
    assert_eq!(header, Some("ray,t,x,y,z,u,v,patch,name,nx,ny,nz"));
    let rows = rows(&run.stdout);
    assert_eq!(rows.len(), 2 * offsets.len());
    let mut side = None;
    for (row, k) in rows.iter().zip(0..) {
        let offset = offsets[k / 2];
        let z = (1.0 - offset.length_squared()).sqrt() * if k % 2 == 0 { 1.0 } else { -1.0 };
        let radius = offset.extend(z);
        assert_eq!(row[0], (k / 2).to_string());
        assert_eq!((row[7], row[8]), ("0", "SPHERE"));
        let [t] = numbers(&row[1..2]);
        assert!((t - (5.0 - z) / 2.0).abs() < 1e-12, "{row:?}");
        let point = DVec3::from(numbers::<3>(&row[2..5]));
        assert!(point.distance(MIDDLE + radius) < 1e-12, "{row:?}");
        let normal = DVec3::from(numbers::<3>(&row[9..12]));
        // All normals point to the same side: outwards or inwards.
        let sign = *side.get_or_insert(normal.dot(radius).signum());
        assert!(normal.distance(radius * sign) < 1e-12, "{row:?}");
    }
    // The nearest hits alone.
    let run = place.run_with("probe samples/sphere_torus.x3d --rays -", input.as_bytes());
    let nearest: Vec<_> = self::rows(&run.stdout).concat();
    let every_other: Vec<_> = rows.into_iter().step_by(2).collect();
    assert_eq!(nearest, every_other.concat());
}

#[test]
fn probe_takes_directions_of_any_length() {
    let place = Place::new();
    let mut input = String::from("\u{feff}ox,oy,oz,dx,dy,dz\n");
    let expected = 5.0 - 0.9_f64.sqrt();
    let lengths = [1.0, 1e-290, 1e-161, 1e-80, 1e80, 1e161, 1e290];
    for length in lengths {
        writeln!(input, "-2.2,0.3,5,0,0,{:e}", -length).unwrap();
    }
    let line = "probe samples/sphere_torus.x3d --rays -";
    let run = place.run_with(line, input.as_bytes());
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    let rows = rows(&run.stdout);
    assert_eq!(rows.len(), lengths.len());
    for (row, length) in rows.iter().zip(lengths) {
        let [t] = numbers(&row[1..2]);
        assert!((t * length - expected).abs() < 1e-12, "{row:?}");
    }
    // A byte order mark before numbers.
    let run = place.run_with(line, "\u{feff}-2.2,0.3,5,0,0,-1\n".as_bytes());
    assert_eq!(run.stdout.lines().count(), 2, "{}", run.stderr);
    let run = place.run_with(&format!("{line} --certify"), input.as_bytes());
    for (row, length) in self::rows(&run.stdout).iter().zip(lengths) {
        let [low, high] = numbers(&row[2..4]);
        assert_eq!(row[1], "hit");
        assert!(low * length <= expected + 1e-12 && high * length >= expected - 1e-12);
    }
}

#[test]
fn probe_evaluates_surfaces() {
    let place = Place::new();
    let input = "0,0.1,0.3\n0,0.6,0.8\n2,0.2,0.7\n";
    let run = place.run_with("probe samples/sphere_torus.x3d --uv -", input.as_bytes());
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    let rows = rows(&run.stdout);
    assert_eq!(rows.len(), 3);
    for row in &rows[..2] {
        let [_, _, _, numbers @ ..] = numbers::<24>(row);
        let vector = |k: usize| DVec3::from_slice(&numbers[3 * k..]);
        let [point, du, dv, duu, duv, dvv, normal] = [0, 1, 2, 3, 4, 5, 6].map(vector);
        let radius = point - MIDDLE;
        assert!((radius.length() - 1.0).abs() < 1e-12);
        assert!((normal.dot(radius).abs() - 1.0).abs() < 1e-12);
        // The derivatives of |r|^2 = 1.
        assert!(radius.dot(du).abs() < 1e-11 && radius.dot(dv).abs() < 1e-11);
        let scale = duu.length() + dvv.length() + duv.length();
        assert!((du.dot(du) + radius.dot(duu)).abs() < 1e-12 * scale);
        assert!((du.dot(dv) + radius.dot(duv)).abs() < 1e-12 * scale);
        assert!((dv.dot(dv) + radius.dot(dvv)).abs() < 1e-12 * scale);
    }
    let run = place.run_with(
        "probe samples/sphere_torus.x3d --uv - --json",
        input.as_bytes(),
    );
    let row: Value = serde_json::from_str(run.stdout.lines().next().unwrap()).unwrap();
    assert_eq!(row["name"], "SPHERE");
    let x = row["point"][0].as_f64();
    assert_eq!(x, Some(numbers::<1>(&rows[0][3..4])[0]));
}

#[test]
fn bad_rows_are_named() {
    let place = Place::new();
    let mut found = String::new();
    for (line, input) in [
        (
            "probe samples/teapot.obj --rays -",
            "0,5,0,0,-1,0\n\n1,2,3\n",
        ),
        ("probe samples/teapot.obj --rays -", "0,5,0,0,-1,zero\n"),
        ("probe samples/teapot.obj --rays -", "0,5,0,0,-1,inf\n"),
        ("probe samples/teapot.obj --rays -", "0,5,0,0,-1,0,7\n"),
        ("probe samples/teapot.obj --rays -", "0,5,0,0,0,0\n"),
        ("probe samples/teapot.obj --rays -", "nan,5,0,0,-1,0\n"),
        ("probe samples/teapot.obj --rays -", "0,5,0,0,-1e305,0\n"),
        (
            "probe samples/teapot.obj --uv -",
            "# a comment\n32,0.5,0.5\n",
        ),
        ("probe samples/teapot.obj --uv -", "0.5,0.5,0.5\n"),
        ("probe samples/teapot.obj --uv -", "0,0.5,1.5\n"),
    ] {
        let run = place.run_with(line, input.as_bytes());
        assert_eq!(run.code, Some(2), "{input}");
        writeln!(found, "$ printf {input:?} | nurbray {line}\n{}", run.stderr).unwrap();
    }
    assert_snapshot("rows.txt", &found);
}
