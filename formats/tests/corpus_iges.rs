//! Real IGES files, if they are there: all are read without panic, and every surface is found.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use nurbray_formats::{Limits, NoFiles, ReadOptions, read};

fn corpus() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/corpus/iges");
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut files: Vec<_> = entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "igs" || e == "iges"))
        .collect();
    files.sort();
    files
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
        match result {
            Ok(import) => {
                let found = import.scene.patches().len();
                patches += found;
                println!("{name}: {found} patches, {elapsed:?}");
                for warning in import.warnings.as_slice() {
                    println!("    {}: {warning}", warning.problem.kind());
                }
            }
            Err(error) => println!("{name}: {error}"),
        }
    }
    println!("{bytes} bytes, {patches} patches, {time:?}");
}
