//! Files that are cut, corrupted or hostile: each is read or refused within a second and 200 MB,
//! and no reader panics.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use fastrand::Rng;
use nurbray::formats::{Limits, NoFiles, ReadOptions, read};

/// Longest time for one file, and most bytes at a time.
const PATIENCE: Duration = Duration::from_secs(1);
const MEMORY: u64 = 200_000_000;

/// Larger files are passed over.
const MOST: u64 = 700_000;

/// Numbers that no file means.
const WILD: [&str; 8] = [
    "999999999",
    "-1",
    "0",
    "1e308",
    "nan",
    "4294967297",
    "",
    "1000000000000000000000",
];

/// Where numbers stand in a text.
fn numbers(bytes: &[u8]) -> Vec<(usize, usize)> {
    let is_digit = |at: usize| bytes.get(at).is_some_and(u8::is_ascii_digit);
    let starts = (0..bytes.len()).filter(|&at| is_digit(at) && (at == 0 || !is_digit(at - 1)));
    let end = |start: usize| (start..).find(|&at| !is_digit(at)).unwrap();
    starts.map(|start| (start, end(start))).collect()
}

/// A file made worse in one of several ways.
fn worse(bytes: &[u8], numbers: &[(usize, usize)], dice: &mut Rng) -> Vec<u8> {
    let mut worse = bytes.to_vec();
    let at = dice.usize(..bytes.len());
    let from = dice.usize(..bytes.len());
    let count = dice.usize(..400).min(bytes.len() - from.max(at));
    match dice.usize(..6) {
        0 => worse.truncate(at),
        1 => worse[at] = u8::try_from(dice.usize(..256)).unwrap(),
        2 => drop(worse.drain(at..at + count)),
        3 => worse.copy_within(from..from + count, at),
        4 => {
            let copy = bytes[from..from + count].to_vec();
            drop(worse.splice(at..at, copy));
        }
        // In columns, the others keep their places.
        _ if !numbers.is_empty() => {
            let (start, end) = numbers[dice.usize(..numbers.len())];
            let wild = WILD[dice.usize(..WILD.len())];
            let width = end - start;
            let number = if dice.usize(..2) == 0 {
                format!("{wild:>width$}")
            } else {
                "9".repeat(width)
            };
            drop(worse.splice(start..end, number.into_bytes()));
        }
        _ => {}
    }
    worse
}

/// Reads a file within its bounds, or tells which one it broke.
fn bounded(bytes: &[u8], ending: &str) -> Result<(), String> {
    let limits = Limits::default();
    let options = ReadOptions {
        limits: &limits,
        resolver: &NoFiles,
    };
    let mut took = Duration::MAX;
    // Others may keep the processor busy: the best of three counts.
    for _ in 0..3 {
        let started = Instant::now();
        let used = allocation_counter::measure(|| drop(read(bytes, Some(ending), &options)));
        took = took.min(started.elapsed());
        if used.bytes_max > MEMORY {
            return Err(format!("{} bytes at a time", used.bytes_max));
        }
        if took <= PATIENCE {
            return Ok(());
        }
    }
    Err(format!("took {took:?}"))
}

/// All files below folders beside this one.
fn files(folders: &[&str]) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let entries = folders.iter().filter_map(|f| root.join(f).read_dir().ok());
    let mut paths: Vec<_> = entries
        .flatten()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.retain(|path| path.is_file() && path.metadata().unwrap().len() <= MOST);
    paths.sort();
    paths
}

/// Tries `count` variants of each file; those that break a bound are kept beside the build.
fn try_all(folders: &[&str], count: usize) {
    let mut bad = Vec::new();
    for path in files(folders) {
        let bytes = fs::read(&path).unwrap();
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        let numbers = numbers(&bytes);
        let mut dice = Rng::with_seed(0x5eed);
        for k in 0..count {
            let variant = match k {
                0 => bytes.clone(),
                _ if bytes.is_empty() => continue,
                _ => worse(&bytes, &numbers, &mut dice),
            };
            if let Err(broken) = bounded(&variant, &ending) {
                let name = path.file_name().unwrap().to_string_lossy();
                let kept = std::env::temp_dir().join(format!("hostile_{k}_{name}"));
                fs::write(&kept, &variant).unwrap();
                bad.push(format!("{} variant {k}: {broken}", kept.display()));
            }
        }
    }
    assert_eq!(bad, [""; 0]);
}

#[test]
fn what_stands_for_other_files_is_told() {
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a21\nsize 12345\n";
    let archive = "PK\x03\x04\x14\0\0\0\x08\0part.step";
    let options = ReadOptions {
        limits: &Limits::default(),
        resolver: &NoFiles,
    };
    for ending in ["igs", "obj", "wrl", "x3d", "stpz"] {
        for (head, told) in [(pointer, "git lfs pull"), (archive, "unpack it")] {
            let error = read(head.as_bytes(), Some(ending), &options).unwrap_err();
            assert!(error.to_string().contains(told), "{error}");
        }
    }
}

#[test]
fn solids_with_pictures_are_read_at_once_however_many() {
    let mut text = "#X3D V3.3 utf8\nPROFILE Immersive\nShape { geometry Box { } appearance \
        DEF A Appearance { texture PixelTexture { image 1 1 1 0x80 } } }\n"
        .to_owned();
    for k in 1..=1000 {
        for solid in ["Sphere { radius", "Cone { height", "Cylinder { height"] {
            text += &format!("Shape {{ appearance USE A geometry {solid} {k} }} }}\n");
        }
    }
    assert_eq!(bounded(text.as_bytes(), "x3dv"), Ok(()));
}

#[test]
#[ignore = "takes a minute"]
fn worse_samples_are_read_or_refused_at_once() {
    try_all(&["samples", "samples/broken"], 60);
}

#[test]
#[ignore = "takes minutes"]
fn worse_files_of_others_are_read_or_refused_at_once() {
    let corpus =
        ["iges", "obj", "step", "x3d", "vrml"].map(|kind| format!("../shared/corpus/{kind}"));
    try_all(&corpus.each_ref().map(String::as_str), 100);
}
