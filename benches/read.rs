//! How fast files are read, up to the scene, on one core.
//!
//! The largest files of each kind in `../shared/corpus`, or else in `samples`; criterion prints
//! bytes per second.

use std::fs;
use std::hint::black_box;
use std::path::{Path, PathBuf};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nurbray::formats::{Limits, NoFiles, ReadOptions, read};

/// The largest file of a folder with one of these endings.
fn largest(folder: &Path, endings: &[&str]) -> Option<PathBuf> {
    let files = folder.read_dir().ok()?.filter_map(Result::ok);
    let paths = files.map(|entry| entry.path());
    let is_wanted = |path: &PathBuf| {
        let ending = path.extension().and_then(|e| e.to_str());
        ending.is_some_and(|ending| endings.contains(&ending))
    };
    let size = |path: &PathBuf| path.metadata().map_or(0, |data| data.len());
    paths.filter(is_wanted).max_by_key(size)
}

fn reading(criterion: &mut Criterion) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut group = criterion.benchmark_group("read");
    group.sample_size(10);
    for (kind, endings) in [
        ("iges", ["igs", "iges"]),
        ("obj", ["obj", "obj"]),
        ("x3d", ["x3d", "x3dv"]),
        ("vrml", ["wrl", "wrl"]),
    ] {
        let corpus = root.join("../shared/corpus").join(kind);
        let path = largest(&corpus, &endings).or_else(|| largest(&root.join("samples"), &endings));
        let Some((path, bytes)) = path.and_then(|path| fs::read(&path).ok().map(|b| (path, b)))
        else {
            continue;
        };
        let limits = Limits::default();
        let options = ReadOptions {
            limits: &limits,
            resolver: &NoFiles,
        };
        let ending = path.extension().and_then(|e| e.to_str());
        group.throughput(Throughput::Bytes(bytes.len() as u64));
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        group.bench_function(name, |bench| {
            bench.iter(|| black_box(read(&bytes, ending, &options).is_ok()));
        });
    }
    group.finish();
}

criterion_group!(benches, reading);
criterion_main!(benches);
