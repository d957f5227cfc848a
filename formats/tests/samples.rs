//! All samples: read without warnings, known by their content, and without a panic when
//! they are cut short or damaged. Broken ones say what `samples/broken/expected.txt` holds;
//! `make bless` writes that file anew.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use nurbray_formats::{FORMATS, Limits, NoFiles, ReadOptions, open, read};

/// Longest time for all the cuts of one sample.
const PATIENCE: Duration = Duration::from_secs(30);

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../samples")
        .join(name)
}

/// The files of a folder that some format reads, with their endings.
fn samples(name: &str) -> Vec<(PathBuf, String)> {
    let entries = fs::read_dir(folder(name)).expect("a folder of samples");
    let mut files: Vec<_> = entries
        .map(|entry| entry.expect("a folder that can be listed").path())
        .filter_map(|path| {
            let extension = path.extension()?.to_str()?.to_owned();
            let known = FORMATS
                .iter()
                .any(|format| format.extensions.contains(&extension.as_str()));
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
        let import = open(&path, &Limits::default()).unwrap();
        assert!(!import.scene.patches().is_empty(), "{}", path.display());
        let told = import.warnings.as_slice().iter();
        let told: Vec<_> = told.map(|w| w.problem.to_string()).collect();
        if path.ends_with("can.igs") {
            // The ring is beside its saddle.
            let text = "a trim curve is off its surface by up to 5e-2 of the size of that; it is laid \
                        onto it";
            assert_eq!(told, [text]);
        } else {
            assert_eq!(told, [""; 0], "{}", path.display());
        }
    }
}

#[test]
fn samples_are_known_by_their_content() {
    for (path, extension) in samples("") {
        let bytes = fs::read(&path).unwrap();
        let format = FORMATS.iter().find(|format| (format.sniff)(&bytes));
        let extensions = format.map(|format| format.extensions).unwrap_or_default();
        let known = extensions.contains(&extension.as_str());
        assert!(known, "{}: {extensions:?}", path.display());
    }
}

#[test]
fn broken_samples_say_what_is_wrong() {
    let mut found = String::new();
    for (path, _) in samples("broken") {
        let name = path.file_name().unwrap_or_default().display();
        writeln!(found, "{name}").unwrap();
        match open(&path, &Limits::default()) {
            Ok(import) => {
                let warnings = import.warnings.as_slice();
                assert!(!warnings.is_empty(), "{name} is not broken");
                for warning in warnings {
                    let kind = warning.problem.kind();
                    writeln!(found, "  {kind}: {} {warning}", import.format).unwrap();
                }
                writeln!(found, "  {} patches", import.scene.patches().len()).unwrap();
            }
            Err(error) => writeln!(found, "  error: {error}").unwrap(),
        }
    }
    let snapshot = folder("broken").join("expected.txt");
    if std::env::var_os("BLESS").is_some() {
        fs::write(&snapshot, &found).unwrap();
    }
    let expected = fs::read_to_string(&snapshot).unwrap_or_default();
    assert!(
        found == expected,
        "{} differs; see whether this is right, then run `make bless`\n{}",
        snapshot.display(),
        difference(&expected, &found)
    );
}

/// The lines that only one of the texts has.
fn difference(expected: &str, found: &str) -> String {
    let only = |sign: char, a: &str, b: &str| -> String {
        let missing = a.lines().filter(|line| !b.lines().any(|l| l == *line));
        missing.map(|line| format!("{sign} {line}\n")).collect()
    };
    only('-', expected, found) + &only('+', found, expected)
}

#[test]
fn cut_samples_do_not_panic() {
    let limits = Limits::default();
    let options = ReadOptions {
        limits: &limits,
        resolver: &NoFiles,
    };
    for (path, extension) in [samples(""), samples("broken")].concat() {
        let bytes = fs::read(&path).unwrap();
        let start = Instant::now();
        for end in (0..bytes.len()).step_by(100) {
            let _ = read(&bytes[..end], Some(&extension), &options);
        }
        assert!(start.elapsed() < PATIENCE, "{}", path.display());
    }
}

#[test]
fn damaged_samples_do_not_panic() {
    damage(50);
}

#[test]
#[ignore = "takes two to three minutes in release; `make soak` runs it"]
fn heavily_damaged_samples_do_not_panic() {
    damage(20_000);
}

/// Reads every sample `rounds` times, each time with a few random bytes changed or lost.
fn damage(rounds: usize) {
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
        let bytes = fs::read(&path).expect("a sample that can be read");
        for _ in 0..rounds {
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
