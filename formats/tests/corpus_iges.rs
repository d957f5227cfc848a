//! Real IGES files, if they are there: all are read, and every surface of theirs is found.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use glam::DVec2;
use kernel::{Aabb, Patch, Scene, Shape, TrimRegion};
use nurbray_formats::{FORMATS, Limits, NoFiles, ReadOptions, read};

/// Files that show fewer surfaces than their directory has, or none: how many, and why.
const FEWER: [(&str, usize, &str); 6] = [
    ("git_lfs_pointer_not_iges.igs", 0, "no IGES"),
    ("igesio_first_line_without_80_cols.iges", 0, "no directory"),
    ("igesio_up_to_line_7_of_DE_section.iges", 0, "cut; blanked"),
    ("made_truncated_in_P_section.igs", 28, "cut: 17 are missing"),
    ("splinelib_read.iges", 0, "blanked"),
    ("splinelib_read2.iges", 0, "blanked"),
];

fn corpus() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/corpus/iges");
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut files: Vec<_> = entries
        .map(|entry| entry.expect("a folder that can be listed").path())
        .filter(|path| path.extension().is_some_and(|e| e == "igs" || e == "iges"))
        .collect();
    files.sort();
    files
}

/// The number of surfaces in the directory, counted without the reader: first lines of
/// entries of type 128.
fn surfaces(content: &[u8]) -> usize {
    let lines = content.split(|&b| b == b'\n');
    let first = lines.filter(|line| {
        let odd = line.get(79).is_some_and(|b| b % 2 == 1);
        odd && line.get(72) == Some(&b'D') && line[..8].trim_ascii() == b"128"
    });
    first.count()
}

/// A box around points of all surfaces as they are placed, in millimetres.
fn sampled_bounds(scene: &Scene) -> Aabb {
    let millimetres = scene.unit.as_ref().map_or(1.0, |unit| unit.metres * 1e3);
    let mut bounds = Aabb::EMPTY;
    for placement in scene.placements() {
        let Shape::Patch(id) = placement.shape else {
            continue;
        };
        let surface = &scene.patch(id).surface;
        let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
        for (i, j) in (0..=24).flat_map(|i| (0..=24).map(move |j| (i, j))) {
            let share = DVec2::new(f64::from(i), f64::from(j)) / 24.0;
            let uv =
                DVec2::new(u.start, v.start) + share * DVec2::new(u.end - u.start, v.end - v.start);
            let point = surface.evaluate(uv);
            let world = placement.world_from_object.transform_point3(point);
            bounds = bounds.including(world * millimetres);
        }
    }
    bounds
}

#[test]
fn real_files_are_read() {
    let limits = Limits::default();
    let options = ReadOptions {
        limits: &limits,
        resolver: &NoFiles,
    };
    let (mut bytes, mut patches, mut time) = (0, 0, Duration::ZERO);
    for path in corpus() {
        let content = std::fs::read(&path).unwrap();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let start = Instant::now();
        let result = read(&content, Some("igs"), &options);
        let elapsed = start.elapsed();
        assert!(elapsed < Duration::from_secs(20), "{name}: {elapsed:?}");
        bytes += content.len();
        time += elapsed;
        let found = match result {
            Ok(import) => {
                let found = import.scene.patches().len();
                let bounds = sampled_bounds(&import.scene);
                let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
                println!("{name}: {found} patches, {elapsed:?}, {min:?} {max:?}");
                for warning in import.warnings.as_slice() {
                    println!("    {}: {warning}", warning.problem.kind());
                }
                found
            }
            Err(error) => {
                println!("{name}: {error}");
                0
            }
        };
        patches += found;
        let fewer = FEWER.iter().find(|(file, ..)| *file == name);
        let expected = fewer.map_or_else(|| surfaces(&content), |(_, count, _)| *count);
        assert_eq!(found, expected, "{name}");
    }
    println!("{bytes} bytes, {patches} patches, {time:?}");
}

/// Files of which all faces are read, with the area of the trimmed faces in square
/// millimetres as another program finds it.
const AREAS: [(&str, f64); 5] = [
    ("occt_hammer.iges", 3.977_959_539e8),
    ("occt_bearing.iges", 0.013_406_997),
    ("models_Front_screen_v01.igs", 1_924_391.48),
    ("models_rear_screen_v01.igs", 733_715.92),
    ("pythonoccc_sunglasses_lens.igs", 1_885.703_861),
];

/// The area of a trimmed patch, by sums over a grid.
fn area(patch: &Patch) -> f64 {
    let surface = &patch.surface;
    let region = TrimRegion::of(patch);
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let size = DVec2::new(u.end - u.start, v.end - v.start);
    let cells = (0..60).flat_map(|i| (0..60).map(move |j| DVec2::new(f64::from(i), f64::from(j))));
    let points = cells.map(|cell| DVec2::new(u.start, v.start) + size * (cell + 0.5) / 60.0);
    let parts = points.filter(|&uv| region.contains(uv)).map(|uv| {
        let d = surface.derivatives(uv);
        d.du.cross(d.dv).length()
    });
    parts.sum::<f64>() * size.x * size.y / 3600.0
}

#[test]
fn trim_loops_bound_the_right_area() {
    let limits = Limits::default();
    for path in corpus() {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let Some((_, expected)) = AREAS.iter().find(|(file, _)| *file == name) else {
            continue;
        };
        let scene = nurbray_formats::open(&path, &limits).unwrap().scene;
        let millimetres = scene.unit.as_ref().unwrap().metres * 1e3;
        let found: f64 = scene.patches().iter().map(area).sum();
        let ratio = found * millimetres * millimetres / expected;
        assert!((ratio - 1.0).abs() < 5e-3, "{name}: {ratio}");
    }
}

#[test]
fn real_files_are_known_by_their_content() {
    for path in corpus() {
        let bytes = std::fs::read(&path).unwrap();
        let known = FORMATS.iter().any(|format| (format.sniff)(&bytes));
        let is_iges = !path.ends_with("git_lfs_pointer_not_iges.igs");
        assert_eq!(known, is_iges, "{}", path.display());
    }
}
