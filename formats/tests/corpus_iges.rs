//! Real IGES files, if they are there: all are read, in time. What is in them, others check.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use nurbray_formats::{FORMATS, Limits, NoFiles, ReadOptions, read};

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
                println!("{name}: {found} patches, {elapsed:?}");
                for warning in import.warnings.as_slice() {
                    println!("    {}: {warning}", warning.problem.kind());
                }
                patches += found;
            }
            Err(error) => println!("{name}: {error}"),
        }
    }
    println!("{bytes} bytes, {patches} patches, {time:?}");
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
