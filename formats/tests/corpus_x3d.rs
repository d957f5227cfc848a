//! X3D and VRML files of other programs, where a folder with them lies beside the repository, and
//! our own samples cut short.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "helpers of tests are tests, too"
)]

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use nurbray_formats::{Import, Limits, NoFiles, ReadOptions, open, read};

fn folder(name: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    let entries = fs::read_dir(folder).into_iter().flatten();
    let mut paths: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths
}

fn is_x3d(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "x3d")
}

fn text(path: &Path) -> String {
    let bytes = fs::read(path).unwrap();
    let mut text = String::new();
    if flate2::read::GzDecoder::new(&bytes[..])
        .read_to_string(&mut text)
        .is_err()
    {
        text = String::from_utf8_lossy(&bytes).into_owned();
    }
    text
}

/// The nodes that are one surface each.
const SURFACES: [&str; 5] = [
    "NurbsPatchSurface",
    "NurbsTrimmedSurface",
    "NurbsSweptSurface",
    "NurbsSwungSurface",
    "NurbsSurface",
];

/// How many NURBS surfaces the text holds that are no USE of another, in any spelling.
fn surfaces_in(text: &str) -> usize {
    let count = |kind: &str| {
        let parts = text.split(kind).zip(text.split(kind).skip(1));
        let is_node = |(before, after): &(&str, &str)| {
            let is_element = before.ends_with('<')
                && after
                    .split('>')
                    .next()
                    .is_some_and(|tag| !tag.contains("USE="));
            let is_whole = !after.starts_with(char::is_alphanumeric);
            is_element && is_whole
                || before.ends_with(char::is_whitespace) && after.trim_start().starts_with('{')
        };
        parts.filter(is_node).count()
    };
    SURFACES.map(count).iter().sum()
}

/// How many of those are read.
fn surfaces_of(import: &Import) -> usize {
    let patches = import.scene.patches().iter();
    let kinds = [SURFACES.as_slice(), &["TrimmedSurface"]].concat();
    let is_nurbs = |p: &&kernel::Patch| kinds.iter().any(|kind| p.source.contains(kind));
    patches.filter(is_nurbs).count()
}

fn print(path: &Path, found: usize, import: &Import) {
    let scene = &import.scene;
    let loops: usize = scene.patches().iter().map(|p| p.loops.len()).sum();
    println!(
        "{:42} {found:4} {:7} {loops:5} {:6} {:7} {:6}",
        path.file_name().unwrap().to_string_lossy(),
        scene.patches().len(),
        scene.placement_count(),
        scene.cameras.len(),
        scene.lights.len(),
    );
    for warning in import.warnings.as_slice() {
        println!("    {} x {warning}", warning.count);
    }
}

#[test]
fn every_surface_of_the_corpus_is_read() {
    println!("file {:37} text patches loops places cameras lights", "");
    for path in ["x3d", "vrml"]
        .iter()
        .flat_map(|name| folder(&format!("../../shared/corpus/{name}")))
    {
        let text = text(&path);
        let import = match open(&path, &Limits::default()) {
            Ok(import) => import,
            Err(error) => {
                println!("{}: {error}", path.display());
                assert!(text.starts_with("#VRML V1.0"), "{}", path.display());
                continue;
            }
        };
        let found = surfaces_in(&text);
        print(&path, found, &import);
        // Those that cannot be read are told about, and the last one of a file that was cut.
        let told = import.warnings.as_slice().iter();
        let told = told.filter(|w| {
            let ends = w.problem.to_string();
            w.problem.kind() == "geometry" || ends.contains("left out")
        });
        let named = |w: &nurbray_formats::Warning| {
            let places = w.places.iter();
            let is_surface = |what: &str| SURFACES.iter().any(|kind| what.contains(kind));
            let named = places.filter(|place| is_surface(&place.what)).count();
            // Of many places only the first are kept.
            if named == w.places.len() {
                w.count
            } else {
                named
            }
        };
        let told: usize = told.map(named).sum();
        assert_eq!(surfaces_of(&import) + told, found, "{}", path.display());
    }
}

#[test]
fn samples_are_read_without_a_warning() {
    for path in folder("../samples").iter().filter(|path| is_x3d(path)) {
        let import = open(path, &Limits::default()).unwrap();
        assert_eq!(surfaces_of(&import), surfaces_in(&text(path)));
        assert_eq!(import.warnings.as_slice(), [], "{}", path.display());
    }
}

#[test]
fn broken_samples_say_what_is_wrong() {
    for path in folder("../samples/broken")
        .iter()
        .filter(|path| is_x3d(path))
    {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let import = open(path, &Limits::default()).unwrap();
        print(path, surfaces_in(&text(path)), &import);
        let shown = match &*name {
            "x3d_point_count" => 0,
            "x3d_unclosed_element" => 2,
            _ => 1,
        };
        assert_eq!(import.scene.placement_count(), shown, "{name}");
        assert!(!import.warnings.as_slice().is_empty(), "{name}");
    }
}

#[test]
fn samples_cut_short_do_no_harm() {
    let (limits, resolver) = (&Limits::default(), &NoFiles);
    let samples = [folder("../samples"), folder("../samples/broken")].concat();
    for path in samples.iter().filter(|path| is_x3d(path)) {
        let bytes = fs::read(path).unwrap();
        for end in (0..bytes.len()).step_by(100) {
            let result = read(
                &bytes[..end],
                Some("x3d"),
                &ReadOptions { limits, resolver },
            );
            if let Ok(import) = result {
                assert!(!import.warnings.as_slice().is_empty(), "cut at {end}");
            }
        }
    }
}

/// Nodes of the corpus by its oracle, which scans the text, and how many of them are read as
/// surfaces and curves. Files that were damaged on purpose are left out.
#[test]
fn nurbs_nodes_are_those_of_the_oracle() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/corpus");
    let Ok(oracle) = fs::read_to_string(corpus.join("oracle.json")) else {
        return;
    };
    let oracle: serde_json::Value = serde_json::from_str(&oracle).unwrap();
    let (mut total, mut others) = ([0, 0], Vec::new());
    for (name, expected) in oracle.as_object().unwrap() {
        let is_ours = name.starts_with("x3d/") || name.starts_with("vrml/");
        if !is_ours || name.contains("/made_") {
            continue;
        }
        let header = expected["text_scan"]["header"].as_str().unwrap_or("");
        if header.starts_with("#VRML V1.0") {
            assert!(
                open(corpus.join(name), &Limits::default()).is_err(),
                "{name}"
            );
            continue;
        }
        let nodes = &expected["text_scan"]["nodes"];
        let count = |kind: &str| nodes[kind].as_u64().unwrap_or(0);
        let import = open(corpus.join(name), &Limits::default()).unwrap();
        let surfaces: u64 = SURFACES.iter().map(|kind| count(kind)).sum();
        // What another node shows twice is stored once, and what nothing shows is not stored.
        let mut sources: Vec<_> = import.scene.patches().iter().map(|p| &p.source).collect();
        sources.dedup();
        let is_nurbs = |source: &&&String| {
            let kinds = [SURFACES.as_slice(), &["TrimmedSurface"]].concat();
            kinds.iter().any(|kind| source.contains(kind))
        };
        let found = sources.iter().filter(is_nurbs).count() as u64;
        println!(
            "{name}: {found} of {surfaces} surfaces, {} wires",
            import.scene.wires().len()
        );
        total = [total[0] + found, total[1] + surfaces];
        // One file lists nodes that nothing shows.
        let shows_nothing =
            import.scene.placement_count() == 0 && !import.warnings.as_slice().is_empty();
        if found != surfaces && !shows_nothing {
            others.push(format!("{name}: {found} of {surfaces}"));
        }
    }
    println!("{} of {} surfaces", total[0], total[1]);
    assert_eq!(others, Vec::<String>::new());
}

/// The largest and the least value of `measure` over a grid of points of a file's surfaces.
fn spread(name: &str, measure: impl Fn(glam::DVec3) -> f64) -> Option<(f64, f64)> {
    let path = folder("../../shared/corpus/x3d");
    let path = path.into_iter().find(|path| path.ends_with(name))?;
    let import = open(&path, &Limits::default()).unwrap();
    let mut range = (f64::INFINITY, f64::NEG_INFINITY);
    for surface in import.scene.patches().iter().map(|patch| &patch.surface) {
        let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
        for (i, j) in (0..=64).flat_map(|i| (0..=64).map(move |j| (f64::from(i), f64::from(j)))) {
            let uv = [(&u, i), (&v, j)].map(|(r, k)| r.start + (r.end - r.start) * k / 64.0);
            let found = measure(surface.evaluate(uv.into()));
            range = (range.0.min(found), range.1.max(found));
        }
    }
    Some(range)
}

#[test]
fn spheres_and_cones_of_others_are_exact() {
    if let Some((least, most)) = spread("NurbsSphere.x3d", glam::DVec3::length) {
        println!("{least} {most}");
        assert!(most - least < 1e-12 * most, "{least} {most}");
    }
    let ratio = |p: glam::DVec3| p.x.hypot(p.z) + p.y * 0.5;
    if let Some((least, most)) = spread("NurbsCone.x3d", ratio) {
        println!("{least} {most}");
        assert!(most - least < 1e-12 * most, "{least} {most}");
    }
    let circle = folder("../../shared/corpus/x3d");
    let Some(path) = circle
        .iter()
        .find(|path| path.ends_with("NurbsCircle2D.x3d"))
    else {
        return;
    };
    let import = open(path, &Limits::default()).unwrap();
    let [wire] = import.scene.wires() else {
        panic!("one curve");
    };
    let kernel::WireShape::Curve(curve) = &wire.shape else {
        panic!("a curve");
    };
    // Its weights are 0.7071, so that it is a circle at its knots and a little less between.
    let w = 7071.0 / 10_000.0;
    let least = 2_f64.sqrt() * (1.0 + 2.0 * w) / (2.0 + 2.0 * w);
    for i in 0..8 {
        let radius = curve.evaluate(f64::from(i) / 8.0).length();
        let expected = if i % 2 == 0 { 1.0 } else { least };
        assert!((radius - expected).abs() < 1e-12, "{radius} {expected}");
    }
    assert!((least - 1.0).abs() < 1e-5);
}
