//! `nurbray convert` as its user meets it.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;

use nurbray::convert::Target;
use nurbray::formats::{Limits, open};
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
            let line = format!("convert samples -o {{stem}}.{extension} --out-dir {folder}");
            place.run(&line);
        }
        for stem in ["teapot", "goblet", "sphere_torus", "two_surfaces"] {
            let name = format!("{stem}.{extension}");
            let [a, b] = ["a", "b"].map(|f| fs::read(place.path(f).join(&name)).unwrap());
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
    let run = place.run("convert samples/teapot.obj -o ok.igs");
    assert_eq!(run.code, Some(0));
    let import = open(place.path("ok.igs"), &Limits::default()).unwrap();
    assert_eq!(import.scene.placement_count(), 32);
}
