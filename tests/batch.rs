//! Batches: many files, stopping, taking up again, names that clash.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;
use std::process::{Command, Stdio};

use serde_json::Value;

#[expect(dead_code, reason = "other tests use more of it")]
mod program;

use program::{Place, finish};

/// The values of a key in the lines of an answer.
fn values(text: &str, key: &str) -> Vec<String> {
    let rows = text.lines().map(|line| {
        let row: Value = serde_json::from_str(line).unwrap();
        row[key].as_str().unwrap_or_default().to_owned()
    });
    rows.collect()
}

#[cfg(unix)]
mod signals {
    use std::process::Child;
    use std::thread::sleep;
    use std::time::{Duration, Instant};

    use super::{Command, Place, Stdio, fs, values};

    /// Starts the program with an open standard input.
    fn start(place: &Place, line: &str) -> Child {
        Command::new(env!("CARGO_BIN_EXE_nurbray"))
            .args(line.split_whitespace())
            .current_dir(place.path(""))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    fn send(child: &Child, signal: &str) {
        let id = child.id().to_string();
        let sent = Command::new("kill").args(["-s", signal, &id]).status();
        assert!(sent.unwrap().success());
    }

    /// Waits until SIGTERM no longer ends a program by itself; Linux tells which signals are caught.
    fn wait_until_it_listens(child: &Child) {
        let status = format!("/proc/{}/status", child.id());
        let is_deaf = |text: String| {
            let caught = text.lines().find_map(|line| line.strip_prefix("SigCgt:"));
            let caught = u64::from_str_radix(caught.unwrap_or_default().trim(), 16);
            caught.is_ok_and(|caught| caught >> 14 & 1 == 0)
        };
        let started = Instant::now();
        while fs::read_to_string(&status).map_or(started.elapsed().as_secs() < 1, is_deaf) {
            assert!(started.elapsed() < Duration::from_secs(60));
            sleep(Duration::from_millis(5));
        }
    }

    /// Waits until a file is there.
    fn wait_for(place: &Place, name: &str) {
        let started = Instant::now();
        while !place.path(name).exists() {
            assert!(started.elapsed() < Duration::from_secs(60), "{name}");
            sleep(Duration::from_millis(5));
        }
    }

    #[test]
    fn a_signal_ends_waiting_and_counts_what_is_left() {
        let place = Place::new();
        for signal in ["INT", "TERM"] {
            let line = "convert samples/teapot.obj - samples/goblet.x3d -o {stem}.igs --json";
            let mut child = start(&place, line);
            let input = child.stdin.take();
            wait_for(&place, "teapot.igs");
            sleep(Duration::from_millis(100));
            send(&child, signal);
            let output = child.wait_with_output().unwrap();
            drop(input);
            let stdout = String::from_utf8(output.stdout).unwrap();
            let stderr = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(3), "{stderr}");
            assert_eq!(values(&stdout, "status"), ["ok", "left", "left"]);
            assert!(stderr.contains("a second signal stops at once"), "{stderr}");
            assert!(stderr.ends_with("stopped; 2 files are left\n"), "{stderr}");
            fs::remove_file(place.path("teapot.igs")).unwrap();
            assert_eq!(place.files(), [""; 0]);
        }
    }

    #[test]
    fn a_second_signal_ends_at_once() {
        let place = Place::new();
        let line = "convert samples/teapot.obj -o t.glb --tolerance 0.00001%";
        let child = start(&place, line);
        wait_until_it_listens(&child);
        let started = Instant::now();
        send(&child, "TERM");
        sleep(Duration::from_millis(200));
        send(&child, "TERM");
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(128 + 15));
        assert!(started.elapsed() < Duration::from_secs(5));
        assert_eq!(place.files(), [""; 0]);
    }

    /// The names of unfinished files.
    fn parts(place: &Place) -> Vec<String> {
        let is_part = |name: &String| name.ends_with(".part");
        place.files().into_iter().filter(is_part).collect()
    }

    #[test]
    fn the_end_leaves_no_unfinished_picture() {
        let place = Place::new();
        for (files, signals) in [("", 1), ("samples/can.igs ", 2)] {
            let line = format!(
                "render samples/goblet.x3d {files}-o {{stem}}.exr --size 3000x2000 --samples 1"
            );
            let child = start(&place, &line);
            let started = Instant::now();
            while parts(&place).is_empty() {
                assert!(started.elapsed() < Duration::from_secs(120), "{line}");
                sleep(Duration::from_millis(2));
            }
            for _ in 0..signals {
                send(&child, "TERM");
                sleep(Duration::from_millis(50));
            }
            let output = child.wait_with_output().unwrap();
            assert_eq!(output.status.code(), Some(128 + 15), "{line}");
            assert_eq!(place.files(), [""; 0], "{line}");
        }
    }

    #[test]
    fn pictures_and_measures_that_are_left_are_told() {
        let place = Place::new();
        for (line, first, code) in [
            (
                "render samples/teapot.obj - samples/goblet.x3d -o {stem}.png --size 8x6 --stats -",
                "teapot.png",
                3,
            ),
            (
                "bench methods samples/teapot.obj - samples/goblet.x3d -o . --methods newton \
                 --size 8x6 --runs 1",
                "index.html",
                3,
            ),
            (
                "render samples/door.x3dv - -o {stem}{frame}.png --size 8x6 --frames 0..9999 --stats -",
                "door0000.png",
                2,
            ),
        ] {
            let mut child = start(&place, line);
            let input = child.stdin.take();
            wait_for(&place, first);
            sleep(Duration::from_millis(100));
            send(&child, "TERM");
            let output = child.wait_with_output().unwrap();
            drop(input);
            let stderr = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(code), "{line}: {stderr}");
            let end = "stopped; 2 files are left\n";
            assert!(stderr.ends_with(end), "{line}: {stderr}");
            assert_eq!(parts(&place), [""; 0], "{line}");
            if line.ends_with("--stats -") {
                let stdout = String::from_utf8(output.stdout).unwrap();
                let status = values(&stdout, "status");
                assert_eq!(status[0], "ok");
                assert_eq!(status[status.len() - 2..], ["left", "left"]);
            }
        }
        let report = fs::read_to_string(place.path("results.json")).unwrap();
        assert!(report.contains("teapot"), "{report}");
    }

    #[test]
    fn commands_with_one_result_end_at_once() {
        let place = Place::new();
        for line in [
            "model - -o m.x3d",
            "compare - -o report",
            "render - -o t.png",
            "render samples/can.igs - --sheet s.png",
        ] {
            let mut child = start(&place, line);
            let input = child.stdin.take();
            wait_until_it_listens(&child);
            send(&child, "INT");
            let output = child.wait_with_output().unwrap();
            drop(input);
            assert_eq!(output.status.code(), Some(128 + 2), "{line}");
            let stderr = String::from_utf8(output.stderr).unwrap();
            assert!(stderr.ends_with("nurbray: stopped\n"), "{line}: {stderr}");
            assert_eq!(place.files(), [""; 0], "{line}");
        }
    }

    #[test]
    fn files_above_a_limit_of_the_system_are_errors() {
        let place = Place::new();
        for line in [
            "render samples/teapot.obj -o t.png",
            "render samples/teapot.obj -o t.exr",
            "convert samples/teapot.obj -o t.glb",
        ] {
            let program = env!("CARGO_BIN_EXE_nurbray");
            let output = Command::new("sh")
                .args(["-c", &format!("ulimit -f 1; exec {program} {line}")])
                .current_dir(place.path(""))
                .output()
                .unwrap();
            let stderr = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(2), "{line}: {stderr}");
            assert_eq!(
                stderr.matches("File too large").count(),
                1,
                "{line}: {stderr}"
            );
            assert_eq!(place.files(), [""; 0], "{line}");
        }
    }
}

#[test]
fn outputs_are_made_again_when_anything_has_changed() {
    let place = Place::new();
    let line = "convert samples/teapot.obj -o out/t.gltf --tolerance 1% --resume --json";
    let run = |expected: &str, why: &str| {
        let run = place.run(line);
        assert_eq!(values(&run.stdout, "status"), [expected], "{why}");
    };
    run("ok", "the first time");
    run("skipped", "nothing has changed");
    let mtl = place.path("samples/teapot.mtl");
    let text = fs::read_to_string(&mtl).unwrap();
    fs::write(&mtl, format!("{text}# another line\n")).unwrap();
    run("ok", "a file that the source names has changed");
    run("skipped", "nothing has changed");
    fs::remove_file(&mtl).unwrap();
    run("ok", "a file that the source names is gone");
    run("skipped", "nothing has changed");
    for name in ["out/t.gltf", "out/t.bin"] {
        let bytes = fs::read(place.path(name)).unwrap();
        fs::write(place.path(name), &bytes[..bytes.len() / 2]).unwrap();
        run("ok", name);
        assert_eq!(fs::read(place.path(name)).unwrap(), bytes);
    }
    // Standard input is known by its content.
    let from_input = |name: &str| {
        let bytes = fs::read(place.path(name)).unwrap();
        let run = place.run_with("convert - -o out/i.igs --resume --json", &bytes);
        values(&run.stdout, "status").concat()
    };
    assert_eq!(from_input("samples/goblet.x3d"), "ok");
    assert_eq!(from_input("samples/goblet.x3d"), "skipped");
    assert_eq!(from_input("samples/teapot.obj"), "ok");
}

/// A closed pipe or a full disk takes no messages.
#[cfg(target_os = "linux")]
#[test]
fn files_are_made_where_messages_cannot_be_written() {
    let place = Place::new();
    let full = fs::OpenOptions::new().write(true).open("/dev/full");
    let run = Command::new(env!("CARGO_BIN_EXE_nurbray"))
        .args(["convert", "samples/can.igs", "-o", "can.stl"])
        .current_dir(place.path(""))
        .stderr(full.unwrap())
        .status();
    assert_eq!(run.unwrap().code(), Some(0));
    assert_eq!(place.files(), ["can.stl"]);
}

#[test]
fn no_input_is_written_over() {
    let place = Place::new();
    let text = fs::read_to_string(place.path("samples/teapot.obj")).unwrap();
    let text = text.replace("teapot.mtl", "z.mtl");
    fs::write(place.path("x.obj"), text).unwrap();
    fs::copy(place.path("samples/teapot.mtl"), place.path("z.mtl")).unwrap();
    fs::copy(place.path("samples/phantom.dcm"), place.path("h.dcm")).unwrap();
    place.run("model --synthetic sphere -o ball.csv");
    let before = ["x.obj", "z.mtl", "h.dcm", "ball.csv"].map(|n| fs::read(place.path(n)).unwrap());
    for line in [
        "convert x.obj -o z.obj",
        "convert x.obj -o ./x.obj",
        "convert x.obj -o new/../x.obj",
        "convert samples/goblet.x3d x.obj -o x.obj",
        "model h.dcm -o h.dcm",
        "model ball.csv -o samples/../ball.csv",
    ] {
        let run = place.run(line);
        assert_eq!(run.code, Some(2), "{line}: {}", run.stderr);
        let why = "an input would be written over";
        assert!(run.stderr.contains(why), "{line}: {}", run.stderr);
        assert_eq!(place.files(), ["ball.csv", "h.dcm", "x.obj", "z.mtl"]);
    }
    let after = ["x.obj", "z.mtl", "h.dcm", "ball.csv"].map(|n| fs::read(place.path(n)).unwrap());
    assert!(before == after);
}

#[test]
fn files_beside_an_output_replace_no_input_of_the_batch() {
    let place = Place::new();
    let text = fs::read_to_string(place.path("samples/teapot.obj")).unwrap();
    let mtl = fs::read_to_string(place.path("samples/teapot.mtl")).unwrap();
    // Of the first file comes x-obj.mtl, which the second one names, and which is the third one.
    fs::write(place.path("x.obj"), text.replace("teapot.mtl", "a.mtl")).unwrap();
    fs::write(place.path("y.obj"), text.replace("teapot.mtl", "x-obj.mtl")).unwrap();
    for name in ["a.mtl", "x-obj.mtl"] {
        fs::write(place.path(name), &mtl).unwrap();
    }
    for (others, why) in [
        (
            "y.obj",
            "x-obj.mtl: an input would be written over, which y.obj names",
        ),
        (
            "samples/goblet.x3d x-obj.mtl",
            "x-obj.mtl: an input would be written over",
        ),
    ] {
        for jobs in [1, 2] {
            let line =
                format!("convert x.obj {others} -o {{stem}}-{{ext}}.obj --json --jobs {jobs}");
            let run = place.run(&line);
            assert_eq!(run.code, Some(3), "{}", run.stderr);
            assert!(run.stderr.contains(why), "{}", run.stderr);
            let ok = values(&run.stdout, "status")
                .iter()
                .filter(|s| *s == "ok")
                .count();
            assert_eq!(ok, 1, "{}", run.stdout);
            assert_eq!(fs::read_to_string(place.path("x-obj.mtl")).unwrap(), mtl);
            assert!(!place.path("x-obj.obj").exists());
        }
    }
    // What is written again is no input.
    for _ in 0..2 {
        let run = place.run("convert x.obj samples/goblet.x3d -o {stem}-{ext}.obj --out-dir out");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn files_beside_two_outputs_of_one_name_clash() {
    let place = Place::new();
    for name in ["samples/a.obj", "samples/a.OBJ"] {
        fs::copy(place.path("samples/teapot.obj"), place.path(name)).unwrap();
    }
    let run = place.run("convert samples/a.obj samples/a.OBJ -o new/{stem}.{ext} --json");
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    assert_eq!(values(&run.stdout, "status"), ["ok", "failed"]);
    let message = "samples/a.OBJ: what samples/a.obj becomes would be written to new/a.mtl, too; \
                   rename one or write them to different folders\n";
    assert!(run.stderr.contains(message), "{}", run.stderr);
    assert!(!place.path("new/a.OBJ").exists());
}

#[test]
fn names_that_clash_do_not_stop_the_others() {
    let place = Place::new();
    for folder in ["a", "b"] {
        fs::create_dir_all(place.path(folder)).unwrap();
        let name = format!("{folder}/goblet.x3d");
        fs::copy(place.path("samples/goblet.x3d"), place.path(&name)).unwrap();
    }
    fs::copy(place.path("samples/teapot.obj"), place.path("a/teapot.obj")).unwrap();
    fs::copy(place.path("samples/goblet.x3d"), place.path("a/teapot.x3d")).unwrap();
    let run = place.run("convert a -o {stem}.igs --out-dir out --json");
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    assert_eq!(values(&run.stdout, "status"), ["ok", "failed", "failed"]);
    let message = "a/teapot.obj: a/teapot.x3d would be written to out/teapot.igs, too; \
                   put {stem}-{ext} into -o\n";
    assert!(run.stderr.contains(message), "{}", run.stderr);
    let run = place.run("convert a -o {stem}-{ext}.igs --out-dir out2");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(place.path("out2/teapot-x3d.igs").is_file());
    let run = place.run("convert a b -o {stem}-{ext}.igs --out-dir out3 --json");
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    let expected = ["failed", "ok", "ok", "failed"];
    assert_eq!(values(&run.stdout, "status"), expected);
    let message = "b/goblet.x3d: a/goblet.x3d would be written to out3/goblet-x3d.igs, too; \
                   rename one or write them to different folders\n";
    assert!(run.stderr.contains(message), "{}", run.stderr);
}

#[test]
fn pictures_that_clash_do_not_stop_the_others() {
    let place = Place::new();
    fs::create_dir_all(place.path("a")).unwrap();
    for name in ["a/goblet.x3d", "a/lamp.x3d", "a/lamp.wrl"] {
        fs::copy(place.path("samples/goblet.x3d"), place.path(name)).unwrap();
    }
    // A file that is given twice has one picture.
    let run = place.run("render a a/goblet.x3d -o out/{stem}.png --size 8x6 --stats -");
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    assert_eq!(run.stdout.lines().count(), 3, "{}", run.stdout);
    let message = "a/lamp.wrl: a/lamp.x3d would be written to out/lamp.png, too; \
                   put {stem}-{ext} into -o\n";
    assert!(run.stderr.contains(message), "{}", run.stderr);
    assert!(place.path("out/goblet.png").is_file());
    assert!(!place.path("out/lamp.png").exists());
}

#[test]
fn failed_files_have_their_warnings() {
    let place = Place::new();
    let text = "#VRML V2.0 utf8\nInline { url \"missing.wrl\" }\n";
    fs::write(place.path("empty.wrl"), text).unwrap();
    let run = place.run("convert empty.wrl -o empty.igs --json");
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    let row: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(row["status"], "failed");
    let warning = row["warnings"][0]["text"].as_str().unwrap();
    assert!(warning.contains("missing.wrl"), "{row}");
}

#[test]
fn files_are_written_although_nobody_reads_about_them() {
    let place = Place::new();
    for line in [
        "render samples/can.igs samples/two_surfaces.igs -o {stem}.png --size 16x16 --stats -",
        "convert samples/can.igs samples/two_surfaces.igs -o {stem}.glb --log json",
    ] {
        let mut child = place.start(line);
        drop(child.stdout.take());
        let run = finish(child, b"");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
    }
    assert_eq!(
        place.files(),
        ["can.glb", "can.png", "two_surfaces.glb", "two_surfaces.png"]
    );
}

#[test]
fn unfinished_files_of_others_are_left_alone() {
    let place = Place::new();
    fs::copy(place.path("samples/teapot.obj"), place.path("a.obj")).unwrap();
    let own = ["a.gltf.1.part", "a.bin.1.part", "a.gltf.done.1.part"];
    let others = ["a.b.gltf.1.part", "a.b.bin.1.part"];
    for name in own.iter().chain(&others) {
        fs::write(place.path(name), "half").unwrap();
    }
    let run = place.run("convert a.obj -o {stem}.gltf --tolerance 1% --resume");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let expected = [
        "a.b.bin.1.part",
        "a.b.gltf.1.part",
        "a.bin",
        "a.gltf",
        "a.gltf.done",
        "a.obj",
    ];
    assert_eq!(place.files(), expected);
}

#[test]
fn a_file_given_twice_is_converted_once() {
    let place = Place::new();
    fs::create_dir_all(place.path("a")).unwrap();
    fs::copy(place.path("samples/goblet.x3d"), place.path("a/goblet.x3d")).unwrap();
    for files in ["a/goblet.x3d a", "a/goblet.x3d a/../a/goblet.x3d"] {
        let run = place.run(&format!("convert {files} -o {{stem}}.igs --json"));
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert_eq!(values(&run.stdout, "status"), ["ok"]);
    }
}

#[test]
fn folders_stand_for_the_files_in_them() {
    let place = Place::new();
    fs::create_dir_all(place.path("parts/more/none")).unwrap();
    for (from, to) in [
        ("can.igs", "parts/can.igs"),
        ("teapot.obj", "parts/more/pot.obj"),
        ("teapot.mtl", "parts/more/teapot.mtl"),
        ("can.igs", "parts/._hidden.igs"),
    ] {
        fs::copy(place.path("samples").join(from), place.path(to)).unwrap();
    }
    let run = place.run("render parts -o {stem}.png --size 16x16");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_eq!(place.files(), ["can.png", "parts", "pot.png"]);
    for command in ["info parts --json", "volume parts --json"] {
        let run = place.run(command);
        let named = |name: &str| run.stdout.matches(name).count() > 0;
        assert!(
            named("can.igs") && named("pot.obj"),
            "{command}: {}",
            run.stdout
        );
    }
    // What cannot be read is told.
    fs::write(place.path("parts/more/packed.x3db"), [0xe0, 0, 0, 1]).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("nowhere", place.path("parts/gone.igs")).unwrap();
    let run = place.run("info parts --json");
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    assert!(run.stderr.contains("binary encoding"), "{}", run.stderr);
    assert!(
        !cfg!(unix) || run.stderr.contains("gone.igs"),
        "{}",
        run.stderr
    );
    let run = place.run("info parts/more/none");
    assert!(run.stderr.contains("no file in it"), "{}", run.stderr);
    let run = place.run("probe parts --rays -");
    assert!(
        run.stderr.contains("parts: this is a folder"),
        "{}",
        run.stderr
    );
}

/// Other systems refuse such names.
#[cfg(target_os = "linux")]
#[test]
fn outputs_have_the_bytes_of_their_inputs_names() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt as _;
    let place = Place::new();
    fs::create_dir(place.path("parts")).unwrap();
    for name in [b"a\xfe.igs", b"a\xff.igs"] {
        let to = place.path("parts").join(OsStr::from_bytes(name));
        fs::copy(place.path("samples/can.igs"), to).unwrap();
    }
    for status in ["ok", "skipped"] {
        let run = place.run("convert parts -o {stem}-{ext}.x3d --out-dir out --resume --json");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert_eq!(values(&run.stdout, "status"), [status; 2], "{}", run.stderr);
    }
    let run = place.run("render parts -o out/{stem}.png --size 8x6");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    for name in [
        &b"a\xfe-igs.x3d"[..],
        b"a\xff-igs.x3d",
        b"a\xfe.png",
        b"a\xff.png",
    ] {
        let path = place.path("out").join(OsStr::from_bytes(name));
        assert!(path.is_file(), "{}", path.display());
    }
}
