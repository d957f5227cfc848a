//! Input files of every command: reading, limits, and what to say about warnings.

use std::collections::HashMap;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use nurbray::formats::{self, Import, Limits, NoFiles, ReadOptions, Warnings};
use serde_json::{Value, json};

/// Warnings that are printed one by one; `info` shows all.
const WARNINGS_SHOWN: usize = 8;

/// Options that concern reading.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ReadArgs {
    /// Multiply the limits on file size, points, nesting, instances and pictures by this factor
    #[arg(long, value_name = "FACTOR", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    relax_limits: u32,
    /// Let files name others in this folder and below, not only beside themselves
    #[arg(long, value_name = "FOLDER")]
    within: Option<PathBuf>,
}

/// A file that has been read.
#[derive(Debug)]
pub(super) struct Loaded {
    pub(super) import: Import,
    pub(super) took: Duration,
}

impl ReadArgs {
    pub(super) fn limits(&self) -> Limits {
        let factor = self.relax_limits as usize;
        let limits = Limits::default();
        Limits {
            bytes: limits.bytes.saturating_mul(factor),
            entities: limits.entities.saturating_mul(factor),
            nesting: limits.nesting.saturating_mul(factor),
            points: limits.points.saturating_mul(factor),
            placements: limits
                .placements
                .saturating_mul(u64::from(self.relax_limits)),
            texels: limits.texels.saturating_mul(factor),
        }
    }

    /// Reads a file, or standard input for `-`.
    pub(super) fn load(&self, path: &Path) -> anyhow::Result<Loaded> {
        let started = Instant::now();
        let limits = self.limits();
        let import = if is_stdin(path) {
            let mut bytes = Vec::new();
            std::io::stdin()
                .lock()
                .take(limits.bytes as u64)
                .read_to_end(&mut bytes)?;
            let options = ReadOptions {
                limits: &limits,
                resolver: &NoFiles,
            };
            formats::read(&bytes, None, &options).context(display(path))?
        } else {
            match &self.within {
                Some(root) => formats::open_within(path, root, &limits),
                None => formats::open(path, &limits),
            }
            .with_context(|| display(path))?
        };
        Ok(Loaded {
            import,
            took: started.elapsed(),
        })
    }
}

fn is_stdin(path: &Path) -> bool {
    path == Path::new("-")
}

/// The name of a file in messages.
pub(super) fn display(path: &Path) -> String {
    if is_stdin(path) {
        "standard input".to_owned()
    } else {
        path.display().to_string()
    }
}

/// The part of a file's name that `{stem}` stands for.
pub(super) fn stem(path: &Path) -> String {
    match path.file_stem() {
        Some(stem) if !is_stdin(path) => stem.to_string_lossy().into_owned(),
        _ => "stdin".to_owned(),
    }
}

/// Refuses to write two files to one place; each pair is an input and where it goes.
pub(super) fn check_distinct<'a>(
    pairs: impl IntoIterator<Item = (&'a Path, &'a Path)>,
) -> anyhow::Result<()> {
    let mut taken: HashMap<&Path, &Path> = HashMap::new();
    for (file, target) in pairs {
        if let Some(other) = taken.insert(target, file) {
            bail!(
                "{} and {} would both be written to {}; put {{stem}} into -o or rename one",
                display(other),
                display(file),
                target.display()
            );
        }
    }
    Ok(())
}

/// Prints the first warnings about a file, and how many more there are; `format` is what it
/// was read or written as.
pub(super) fn report_warnings(path: &Path, format: &str, warnings: &Warnings) {
    let warnings = warnings.as_slice();
    for warning in warnings.iter().take(WARNINGS_SHOWN) {
        eprintln!("nurbray: {}: warning: {format} {warning}", display(path));
    }
    if let Some(more) = warnings
        .len()
        .checked_sub(WARNINGS_SHOWN)
        .filter(|&more| more > 0)
    {
        eprintln!(
            "nurbray: {}: {more} more kinds of warnings; 'nurbray info' shows them",
            display(path)
        );
    }
}

/// Warnings for machines.
pub(super) fn warnings_json(warnings: &Warnings) -> Value {
    let place = |place: &formats::Place| json!({ "line": place.line, "what": place.what });
    let warning = |warning: &formats::Warning| {
        json!({
            "kind": warning.problem.kind(),
            "text": warning.problem.to_string(),
            "count": warning.count,
            "places": warning.places.iter().map(place).collect::<Vec<_>>(),
        })
    };
    warnings.as_slice().iter().map(warning).collect()
}
