//! The research methods as their user meets them, on the scenes of `samples/methods`.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;
use std::path::{Path, PathBuf};

use nurbray::formats::{Limits, open};
use nurbray::kernel::Camera;
use nurbray::methods::{Choice, Truth};
use nurbray::{Accelerator, METHODS};
use serde_json::Value;

#[expect(dead_code, reason = "other tests use more of it")]
mod program;

use program::Place;

fn scenes() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/methods");
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let mut scenes: Vec<_> = entries
        .filter(|p| p.extension().unwrap() != "mtl")
        .collect();
    scenes.sort();
    scenes
}

/// Every method on every scene that it can trace: the production method and the repaired
/// clipping miss nothing of what is proven, the others little, and who cannot trace a scene
/// says that weights are the reason.
#[test]
fn every_method_traces_every_scene_that_it_can() {
    let scenes = scenes();
    assert_eq!(scenes.len(), 8);
    let mut refused = 0;
    for path in scenes {
        let scene = open(&path, &Limits::default()).unwrap().scene;
        let accelerator = Accelerator::build(&scene, &METHODS[0]);
        let size = (32, 32);
        let camera = Camera::framing(&accelerator.outline(), scene.up.direction(), 1.0);
        let truth = Truth::prove(&scene, &camera, size);
        for method in METHODS {
            let choice = Choice::parse(method.name).unwrap();
            let trace = match choice.trace(&accelerator, &camera, size) {
                Ok(trace) => trace,
                Err(refusal) => {
                    assert!(refusal.to_string().contains("polynomial"), "{refusal}");
                    refused += 1;
                    continue;
                }
            };
            let [right, wrong, lost, invented, _] = truth.judge(&trace).counts;
            let failed = wrong + lost + invented;
            let counts = (right, wrong, lost, invented);
            match method.name {
                "newton" => assert_eq!(failed, 0, "{} {}: {counts:?}", path.display(), choice),
                // The step of a descent never grows again: it loses much where surfaces bend.
                "gradient-map" | "descent-map" | "gradient-mc" => {
                    assert!(right > 500, "{counts:?}");
                }
                _ => assert!(failed < 100, "{} {}: {counts:?}", path.display(), choice),
            }
        }
    }
    // The three polynomial methods on the two scenes with rational surfaces.
    assert_eq!(refused, 6);
}

#[test]
fn pictures_of_research_methods_and_what_they_leave_out() {
    let place = Place::new();
    for method in METHODS {
        let name = method.name;
        let run = place.run(&format!(
            "render samples/teapot.obj -o {name}.png --size 64x48 --samples 1 --method {name}"
        ));
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let is_told = run
            .stderr
            .contains("shadows and what is seen through surfaces");
        assert_eq!(is_told, name != "newton", "{name}: {}", run.stderr);
    }
    let pixels = |name: &str| {
        let picture = image::open(place.path(&format!("{name}.png"))).unwrap();
        picture.to_rgb8().into_raw()
    };
    let expected = pixels("newton");
    for method in METHODS {
        let pairs = pixels(method.name)
            .into_iter()
            .zip(&expected)
            .collect::<Vec<_>>();
        let apart = pairs.iter().filter(|(a, b)| a.abs_diff(**b) > 12).count();
        assert!(apart < expected.len() / 10, "{}: {apart}", method.name);
    }
    let run = place.run(
        "render samples/teapot.obj -o single.png --size 64x48 --method newton+single --stats -",
    );
    assert!(run.stderr.contains("newton+single: one ray in the middle"));
    let stats: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(stats["primary_rays"], 64 * 48);
    assert!(stats["cells_examined"].as_u64().unwrap() > 64);
    let pairs = pixels("single").into_iter().zip(&expected);
    assert!(pairs.filter(|(a, b)| a.abs_diff(**b) > 1).count() < 9);
    // Proofs are held against what the picture shows.
    for (method, right) in [("newton", true), ("nishita", true), ("gradient-mc", false)] {
        let line = "render samples/teapot.obj -o proof.png --size 64x48 --certify --stats -";
        let run = place.run(&format!("{line} --method {method}"));
        let stats: Value = serde_json::from_str(&run.stdout).unwrap();
        assert_eq!(stats["contradictions"] == 0, right, "{method}: {stats}");
    }
    let run = place.run("render samples/sphere_torus.x3d -o no.png --method gradient-map");
    assert_eq!(run.code, Some(2));
    assert!(
        run.stderr
            .contains("gradient-map is defined for polynomial surfaces; 3 of 3 are rational"),
        "{}",
        run.stderr
    );
    let line = "render samples/teapot.obj -o t.png --size 64x48 --write-map map.png";
    assert_eq!(place.run(line).code, Some(0));
    let map = image::open(place.path("map.png")).unwrap().to_rgb8();
    let reds: std::collections::HashSet<_> = map.pixels().map(|p| p.0[0]).collect();
    assert!(reds.contains(&0) && reds.len() > 10 && reds.iter().all(|&r| r <= 32));
}

#[test]
fn the_bench_reports_in_four_forms() {
    let place = Place::new();
    let line = "bench methods samples/teapot.obj samples/sphere_torus.x3d -o out --size 40x30 \
                --runs 1 --methods newton,newton+single,gradient-map,martin,wang";
    let run = place.run(line);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stdout.contains("x trace") && run.stdout.contains("newton+single"));
    let report = fs::read_to_string(place.path("out/results.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    let rows = report["rows"].as_array().unwrap();
    assert_eq!((rows.len(), &report["threads"]), (10, &Value::from(1)));
    for row in rows
        .iter()
        .filter(|r| r["method"].as_str().unwrap().starts_with("newton"))
    {
        let failed = ["wrong", "lost", "invented"].map(|k| row[k].as_f64());
        assert_eq!(failed, [Some(0.0); 3]);
    }
    let cannot: Vec<_> = rows.iter().filter(|r| !r["cannot"].is_null()).collect();
    assert_eq!(cannot.len(), 1);
    assert_eq!(cannot[0]["method"], "gradient-map");
    let csv = fs::read_to_string(place.path("out/results.csv")).unwrap();
    assert_eq!(csv.lines().count(), 11);
    let columns = csv.lines().next().unwrap().split(',').count();
    let first = csv.lines().nth(1).unwrap();
    assert_eq!(first.split(',').count(), columns);
    let page = fs::read_to_string(place.path("out/index.html")).unwrap();
    for (at, _) in page.match_indices("<img src=\"") {
        let name = page[at + 10..].split('"').next().unwrap();
        let name = name.replace("%2B", "+");
        assert!(place.path(&format!("out/{name}")).is_file(), "{name}");
    }
    assert_eq!(page.matches("<img").count(), 9 * 3);
}

#[test]
fn files_of_one_name_have_rows_and_pictures_of_their_own() {
    let place = Place::new();
    for (folder, sample) in [("one", "teapot.obj"), ("two", "two_surfaces.igs")] {
        fs::create_dir_all(place.path(folder)).unwrap();
        let from = place.path("samples").join(sample);
        fs::copy(from, place.path(folder).join("a,b.x")).unwrap();
    }
    let line = "bench methods one/a,b.x two/a,b.x -o out --size 8x6 --runs 1 --methods newton";
    let run = place.run(line);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let csv = fs::read_to_string(place.path("out/results.csv")).unwrap();
    let starts: Vec<_> = csv.lines().skip(1).collect();
    assert!(starts[0].starts_with("\"a,b\",newton,") && starts[1].starts_with("\"a,b-2\",newton,"));
    for name in ["a,b_newton.png", "a,b-2_newton_effort.png"] {
        assert!(place.path("out").join(name).is_file(), "{name}");
    }
}

#[cfg(unix)]
#[test]
fn strange_names_lead_to_pictures_and_steer_no_terminal() {
    let place = Place::new();
    let name = "a%20#?\u{1b}[7m";
    fs::copy(
        place.path("samples/teapot.obj"),
        place.path(&format!("{name}.obj")),
    )
    .unwrap();
    let line =
        format!("bench methods {name}.obj -o out --size 8x6 --runs 1 --methods martin,martin");
    let run = place.run(&line);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stdout.contains("a%20#?\\u{1b}[7m\n"), "{}", run.stdout);
    assert_eq!(run.stdout.matches("martin").count(), 1, "{}", run.stdout);
    assert!(place.path(&format!("out/{name}_martin.png")).is_file());
    let page = fs::read_to_string(place.path("out/index.html")).unwrap();
    let address = "<img src=\"a%2520%23%3F%1B%5B7m_martin.png\"";
    assert_eq!(page.matches(address).count(), 1, "{page}");
}
