//! What is said about options that do nothing, and about what is strange in names and files.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;

#[expect(dead_code, reason = "other tests use more of it")]
mod program;

use program::Place;

#[test]
fn options_without_effect_are_named() {
    let place = Place::new();
    for (line, words) in [
        (
            "render samples/teapot.obj -o t.png --size 8x6 --aov depth",
            "--aov is for .exr files",
        ),
        (
            "render samples/teapot.obj -o t.exr --size 8x6 --bits 16",
            "--bits is for .png files",
        ),
        (
            "convert samples/teapot.obj -o t.igs --tolerance 1% --quantize",
            "--tolerance is for triangles; t.igs holds none\n\
             nurbray: warning: --quantize is for triangles",
        ),
        (
            "convert samples/teapot.obj -o t.igs --most-points 7",
            "--most-points is for triangles",
        ),
        (
            "model samples/phantom.dcm -o p.x3d --angle 3",
            "--angle is for triangles",
        ),
        (
            "model samples/phantom.dcm -o p.x3d --cap-height 1 --closed both --twist zero --degree 3,2 \
             --parameters uniform --seed 1 --layers 9 --points 9",
            "--cap-height is for --caps rounded\n\
             nurbray: warning: --closed is for --method coons and interpolate\n\
             nurbray: warning: --twist is for --method coons\n\
             nurbray: warning: --degree is for --method interpolate\n\
             nurbray: warning: --parameters is for --method interpolate\n\
             nurbray: warning: --seed is for --synthetic\n\
             nurbray: warning: --layers is for --synthetic\n\
             nurbray: warning: --points is for --synthetic\n",
        ),
        (
            "model --synthetic sphere -o c.x3d --method coons --closed columns --caps rounded",
            "--caps rounded is for --closed rows",
        ),
        (
            "render samples/teapot.obj -o t.png --size 8x6 --time 1",
            "samples/teapot.obj: warning: --time is for what moves",
        ),
        (
            "render samples/teapot.obj -o {frame}.png --size 8x6 --frames 0..1",
            "samples/teapot.obj: warning: --frames is for what moves",
        ),
        (
            "volume samples/sphere_torus.x3d --slices 5",
            "--slices is not used by --method gauss",
        ),
        (
            "volume samples/sphere_torus.x3d --method cavalieri --nodes 5",
            "--nodes is not used by --method cavalieri",
        ),
    ] {
        let run = place.run(line);
        assert_eq!(run.code, Some(0), "{line}: {}", run.stderr);
        assert!(run.stderr.contains(words), "{line}: {}", run.stderr);
    }
    for line in [
        "render samples/teapot.obj -o t.png --size 8x6 --bits 16",
        "convert samples/two_surfaces.igs -o t.glb --tolerance 1%",
        "volume samples/sphere_torus.x3d --method cavalieri --slices 5",
        "model --synthetic sphere -o p.x3d --seed 2 --layers 9 --points 9 --caps rounded --cap-height 1",
    ] {
        let run = place.run(line);
        assert!(!run.stderr.contains("warning: --"), "{}", run.stderr);
    }
}

#[test]
fn a_picture_of_nothing_is_named() {
    let place = Place::new();
    let line = "render samples/teapot.obj -o t.png --size 8x6 --eye 0,0,50 --target 0,0,90";
    let run = place.run(line);
    assert_eq!(run.code, Some(0));
    let words = "nurbray: samples/teapot.obj: no surface is in the picture\n";
    assert!(run.stderr.contains(words), "{}", run.stderr);
    let run = place.run("render samples/teapot.obj -o t.png --size 8x6");
    assert!(!run.stderr.contains("no surface"), "{}", run.stderr);
}

#[test]
fn names_in_files_do_not_steer_the_terminal() {
    let place = Place::new();
    let text = "#VRML V2.0 utf8\nDEF \u{1b}[31mred Transform { children Shape {\n\
        appearance Appearance { material Material {} texture ImageTexture { \
        url \"\u{1b}]0;title\u{7}.png\" } }\n\
        geometry Box {} } }\n";
    fs::write(place.path("a.wrl"), text).unwrap();
    for line in [
        "info a.wrl",
        "volume a.wrl",
        "convert a.wrl -o a.igs",
        "render a.wrl -o a.png --size 8x6",
    ] {
        let run = place.run(line);
        let said = run.stdout + &run.stderr;
        assert!(!said.contains(['\u{1b}', '\u{7}']), "{line}: {said:?}");
        assert!(said.contains("\\u{1b}"), "{line}: {said:?}");
    }
}

#[test]
fn long_names_are_written() {
    let place = Place::new();
    let name = format!("{}.igs", "n".repeat(251));
    let run = place.run(&format!("convert samples/goblet.x3d -o {name}"));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_eq!(place.files(), [name]);
}

#[test]
fn words_in_braces_that_stand_for_nothing_are_refused() {
    let place = Place::new();
    for (line, told) in [
        (
            "convert samples/teapot.obj -o {name}.glb",
            "-o {name}.glb: {name} stands for nothing; what does is {stem}, {ext}",
        ),
        (
            "convert samples/teapot.obj -o {stem}{frame}.glb",
            "{frame} stands for nothing",
        ),
        (
            "render samples/teapot.obj -o {Stem}.png",
            "{Stem} stands for nothing; what does is {stem}, {ext}, {frame}",
        ),
    ] {
        let run = place.run(line);
        assert_eq!(run.code, Some(2), "{}", run.stderr);
        assert!(run.stderr.contains(told), "{}", run.stderr);
        assert_eq!(place.files(), [""; 0]);
    }
    // Not a word.
    let run = place.run("convert samples/teapot.obj -o {1}{}{stem}.x3d");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_eq!(place.files(), ["{1}{}teapot.x3d"]);
}

#[test]
fn points_come_from_standard_input() {
    let place = Place::new();
    let bytes = fs::read(place.path("samples/phantom.dcm")).unwrap();
    let run = place.run_with("model - -o p.x3d", &bytes);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(
        run.stderr.contains("standard input -> p.x3d"),
        "{}",
        run.stderr
    );
}

#[test]
fn sheets_say_what_is_not_there() {
    let place = Place::new();
    fs::write(place.path("none.wrl"), "#VRML V2.0 utf8\nGroup {}\n").unwrap();
    let sheet = |file: &str, out: &str| {
        let run = place.run(&format!("render {file} --sheet {out} --size 96x72"));
        (run.code, fs::read(place.path(out)).unwrap())
    };
    let (code, empty) = sheet("none.wrl", "a.png");
    assert_eq!(code, Some(0));
    fs::rename(place.path("none.wrl"), place.path("none.obj")).unwrap();
    // The ending is a part of what stands below.
    let (_, other) = sheet("none.obj", "b.png");
    assert!(empty != other);
    fs::write(place.path("none.wrl"), "#VRML V1.0 ascii\nCube {}\n").unwrap();
    let (code, failed) = sheet("none.wrl", "c.png");
    assert_eq!(code, Some(2));
    assert!(empty != failed);
}

#[cfg(unix)]
mod special {
    use std::io::Read as _;
    use std::process::Command;
    use std::thread;

    use super::{Place, fs};

    fn make_pipe(place: &Place, name: &str) {
        let made = Command::new("mkfifo").arg(place.path(name)).status();
        assert!(made.unwrap().success());
    }

    #[test]
    fn pipes_are_written_into_and_read_from() {
        let place = Place::new();
        make_pipe(&place, "pipe");
        let path = place.path("pipe");
        let reader = thread::spawn(move || {
            let mut text = String::new();
            fs::File::open(path)
                .unwrap()
                .read_to_string(&mut text)
                .unwrap();
            text
        });
        let run = place.run("render samples/teapot.obj -o t.png --size 8x6 --stats pipe");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert!(reader.join().unwrap().contains("\"hits\":"));
        assert_eq!(place.files(), ["pipe", "t.png"]);
        // The main file may be a pipe.
        let bytes = fs::read(place.path("samples/teapot.obj")).unwrap();
        let path = place.path("pipe");
        let writer = thread::spawn(move || fs::write(path, bytes).unwrap());
        let run = place.run("convert pipe -o t.glb --tolerance 1%");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        writer.join().unwrap();
    }

    #[test]
    fn a_named_pipe_is_no_file_beside() {
        let place = Place::new();
        fs::remove_file(place.path("samples/teapot.mtl")).unwrap();
        make_pipe(&place, "samples/teapot.mtl");
        let run = place.run("info samples/teapot.obj");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert!(run.stdout.contains("not a regular file"), "{}", run.stdout);
    }
}

#[cfg(unix)]
#[test]
fn a_message_is_one_line_whatever_is_in_names() {
    let place = Place::new();
    fs::create_dir(place.path("parts")).unwrap();
    fs::write(place.path("parts/a\nnurbray: b.igs"), "nothing").unwrap();
    fs::copy(place.path("samples/can.igs"), place.path("parts/c\nd.igs")).unwrap();
    for line in [
        "info parts",
        "volume parts",
        "render parts -o {stem}.png --size 8x6",
    ] {
        let run = place.run(line);
        assert!(
            run.stderr.contains("parts/a\\nnurbray: b.igs"),
            "{}",
            run.stderr
        );
        assert!(!run.stderr.contains("\nnurbray: b"), "{}", run.stderr);
        assert!(!run.stdout.contains("\nd.igs"), "{}", run.stdout);
    }
}

#[test]
fn results_are_named_and_counted() {
    let place = Place::new();
    for (line, words) in [
        (
            "render samples/can.igs samples/goblet.x3d --sheet s.png --size 16x16",
            "2 files -> s.png: ",
        ),
        (
            "model --synthetic sphere -o s.x3d",
            "synthetic -> s.x3d: 1 body, 25 patches\n",
        ),
    ] {
        let run = place.run(line);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert!(run.stderr.contains(words), "{}", run.stderr);
    }
}
