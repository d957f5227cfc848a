//! The trim loops of real files, if they are there, against the slow reference.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "helpers of tests are tests, too"
)]

#[path = "../../kernel/tests/slow_trims/mod.rs"]
mod slow_trims;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use glam::DVec2;
use kernel::{Cover, Curve, Patch, TrimRegion};
use nurbray_formats::Limits;
use slow_trims::Random;

/// Points so near to a curve, relative to the domain, may be on either side.
const NEAR: f64 = 1e-9;

/// The trimmed faces of all files of the corpus, with the names of their files.
fn faces() -> Vec<(String, Patch)> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/corpus");
    let list = |folder: PathBuf| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).into_iter().flatten();
        let mut paths: Vec<_> = entries.map(|e| e.unwrap().path()).collect();
        paths.sort();
        paths
    };
    let mut faces = Vec::new();
    for path in ["iges", "x3d", "vrml", "obj"]
        .map(|f| list(corpus.join(f)))
        .concat()
    {
        let Ok(import) = nurbray_formats::open(&path, &Limits::default()) else {
            continue;
        };
        let name = path.file_name().unwrap().to_string_lossy();
        let trimmed = import
            .scene
            .patches()
            .iter()
            .filter(|p| !p.loops.is_empty());
        faces.extend(trimmed.map(|patch| (name.to_string(), patch.clone())));
    }
    faces
}

/// Asks for `count` points, evenly over all faces.
fn compare(count: usize) {
    let faces = faces();
    let mut random = Random(1);
    let (mut asked, mut near, mut decided) = (0, 0, 0);
    let (mut building, mut asking, mut bytes) = (Duration::ZERO, Duration::ZERO, 0);
    for (name, patch) in &faces {
        let (u, v) = (
            patch.surface.knots_u().domain(),
            patch.surface.knots_v().domain(),
        );
        let (start, size) = (
            DVec2::new(u.start, v.start),
            DVec2::new(u.end - u.start, v.end - v.start),
        );
        let clock = Instant::now();
        let region = TrimRegion::of(patch);
        building += clock.elapsed();
        bytes += region.bytes();
        let pieces = slow_trims::pieces(&patch.trim_curves());
        // Every third point lies next to a curve.
        let place = |k: usize| {
            if !k.is_multiple_of(3) {
                return start + size * random.point();
            }
            let pick = random.number() * pieces.len() as f64;
            let piece = (1_u32..).zip(&pieces).find(|(k, _)| pick < f64::from(*k));
            let net = piece.map_or(&pieces[0], |(_, net)| net);
            let near = slow_trims::point(net, random.number());
            let offset = 10.0_f64.powf(-1.0 - 8.0 * random.number());
            let off = size * (random.point() - 0.5) * offset;
            (near + off).clamp(start, start + size)
        };
        let points: Vec<_> = (0..count / faces.len() + 1).map(place).collect();
        let clock = Instant::now();
        let answers: Vec<bool> = points.iter().map(|p| region.contains(*p)).collect();
        asking += clock.elapsed();
        asked += points.len();
        for (p, found) in points.into_iter().zip(answers) {
            // What is said of a box around the point holds for it, too.
            let [low, high] = [0, 1].map(|_| size * random.point() * 0.02);
            let [min, max] = [(p - low).max(start), (p + high).min(start + size)];
            let cover = region.classify(min.x..max.x, min.y..max.y);
            decided += usize::from(cover != Cover::Mixed);
            let agrees = match cover {
                Cover::Mixed => true,
                Cover::Inside => found,
                Cover::Outside => !found,
            };
            assert!(
                agrees,
                "{name}, {}: {p} in a box that is {cover:?}",
                patch.source
            );
            if found != slow_trims::contains(&pieces, p) {
                let distance = slow_trims::distance(&pieces, p);
                let source = &patch.source;
                assert!(
                    distance <= NEAR * size.length(),
                    "{name}, {source}: {p}, {distance:e}"
                );
                near += 1;
            }
        }
    }
    println!(
        "{} faces, {bytes} bytes, built in {building:?}; {asked} points in {asking:?}, {decided} \
         of them decided by a box around; {near} on a curve differ",
        faces.len()
    );
}

#[test]
fn real_loops_agree_with_the_reference() {
    compare(20_000);
}

#[test]
#[ignore = "takes a minute"]
fn a_million_points_agree_with_the_reference() {
    compare(1_000_000);
}
