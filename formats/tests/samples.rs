//! All samples: read, and cut short at every hundredth byte without panic.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use nurbray_formats::{FORMATS, Limits, NoFiles, ReadOptions, read};

/// Endings that this test knows how to read from memory alone.
const EXTENSIONS: [&str; 2] = ["igs", "iges"];

fn samples(folder: &str) -> Vec<(PathBuf, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../samples")
        .join(folder);
    let entries = std::fs::read_dir(folder).expect("a folder of samples");
    let mut files: Vec<_> = entries
        .map(|entry| entry.expect("a folder that can be listed").path())
        .filter_map(|path| {
            let extension = path.extension()?.to_str()?.to_owned();
            let known = EXTENSIONS.contains(&extension.as_str());
            known.then_some((path, extension))
        })
        .collect();
    files.sort();
    assert!(!files.is_empty());
    files
}

#[test]
fn samples_are_read_without_warnings() {
    for (path, _) in samples("") {
        let import = nurbray_formats::open(&path, &Limits::default()).unwrap();
        assert!(!import.scene.patches().is_empty(), "{}", path.display());
        assert_eq!(import.warnings.as_slice(), [], "{}", path.display());
    }
}

#[test]
fn samples_are_known_by_their_content() {
    for (path, extension) in samples("") {
        let bytes = std::fs::read(&path).unwrap();
        let format = FORMATS
            .iter()
            .find(|format| (format.sniff)(&bytes))
            .unwrap();
        let extensions = format.extensions;
        assert!(
            extensions.contains(&extension.as_str()),
            "{}",
            path.display()
        );
    }
}

#[test]
fn cut_samples_do_not_panic() {
    let limits = Limits::default();
    let options = ReadOptions {
        limits: &limits,
        resolver: &NoFiles,
    };
    for (path, extension) in [samples(""), samples("broken")].concat() {
        let bytes = std::fs::read(&path).unwrap();
        let start = Instant::now();
        for end in (0..bytes.len()).step_by(100) {
            let _ = read(&bytes[..end], Some(&extension), &options);
        }
        let elapsed = start.elapsed();
        assert!(elapsed < Duration::from_secs(10), "{}", path.display());
    }
}

#[test]
fn damaged_samples_do_not_panic() {
    let limits = Limits::default();
    let options = ReadOptions {
        limits: &limits,
        resolver: &NoFiles,
    };
    let mut state = 1_u64;
    let mut random = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(state >> 33).expect("31 bits") % below
    };
    for (path, extension) in [samples(""), samples("broken")].concat() {
        let bytes = std::fs::read(&path).unwrap();
        for _ in 0..1000 {
            let mut damaged = bytes.clone();
            for _ in 0..=random(8) {
                let at = random(damaged.len());
                match random(3) {
                    0 => damaged[at] = b"0123456789,;.-+DH \n"[random(18)],
                    1 => damaged[at] ^= 1 << random(8),
                    _ => drop(damaged.remove(at)),
                }
            }
            let _ = read(&damaged, Some(&extension), &options);
        }
    }
}
