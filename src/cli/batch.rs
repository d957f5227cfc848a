//! Many files: several at a time, stopped in good order, taken up again.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::{fs, io};

use anyhow::Context as _;
use nurbray::output;
use rayon::prelude::*;
use signal_hook::consts::{SIGINT, SIGTERM};

/// How a batch ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Ending {
    /// Files that could not be converted.
    pub(super) failed: usize,
    /// Files that were not begun because the program was told to stop.
    pub(super) left: usize,
}

/// Works on all jobs, `threads` at the same time; `work` tells whether a job failed.
///
/// After SIGINT or SIGTERM what is being worked on is finished, and nothing new begun.
pub(super) fn run<J: Sync>(
    jobs: &[J],
    threads: usize,
    work: impl Fn(&J) -> anyhow::Result<bool> + Sync,
) -> anyhow::Result<Ending> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    let (failed, left) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let one = |job: &J| -> anyhow::Result<()> {
        if stop.load(Ordering::Relaxed) {
            left.fetch_add(1, Ordering::Relaxed);
        } else if work(job)? {
            failed.fetch_add(1, Ordering::Relaxed);
        }
        Ok(())
    };
    if threads == 1 {
        // One file after the other, each with all cores.
        jobs.iter().try_for_each(one)?;
    } else {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()?;
        // Single jobs: the next file is begun when one is finished.
        pool.install(|| jobs.par_iter().with_max_len(1).try_for_each(one))?;
    }
    Ok(Ending {
        failed: failed.into_inner(),
        left: left.into_inner(),
    })
}

/// What tells a later run that an output is complete: a small file beside it.
#[derive(Debug)]
pub(super) struct Record {
    output: PathBuf,
    path: PathBuf,
    content: String,
}

impl Record {
    /// The record of an output made from a source with this hash and these options.
    pub(super) fn new(output: &Path, sha256: &str, options: &str) -> Self {
        let mut name = output.file_name().unwrap_or_default().to_owned();
        name.push(".done");
        let version = env!("CARGO_PKG_VERSION");
        Self {
            output: output.to_owned(),
            path: output.with_file_name(name),
            content: format!("nurbray {version}\nsource {sha256}\noptions {options}\n"),
        }
    }

    /// Whether the output is there and was made from the same with the same options.
    pub(super) fn is_done(&self) -> bool {
        let known = fs::read_to_string(&self.path);
        self.output.is_file() && known.is_ok_and(|known| known == self.content)
    }

    pub(super) fn write(&self) -> anyhow::Result<()> {
        let fill = |file: &mut io::BufWriter<fs::File>| file.write_all(self.content.as_bytes());
        output::replace_file(&self.path, fill).with_context(|| self.path.display().to_string())
    }

    /// Removes what an earlier run said: it is true no longer.
    pub(super) fn remove(&self) -> anyhow::Result<()> {
        match fs::remove_file(&self.path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(error).with_context(|| self.path.display().to_string())
            }
            _ => Ok(()),
        }
    }
}

/// Removes unfinished files that a killed run left beside an output.
pub(super) fn remove_leftovers(output: &Path) -> anyhow::Result<()> {
    let folder = output.parent().filter(|f| !f.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let Ok(entries) = fs::read_dir(folder) else {
        return Ok(());
    };
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    for entry in entries {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        // NAME.PROCESS.part
        let number = name
            .strip_suffix(".part")
            .and_then(|rest| rest.rsplit_once('.'));
        let is_ours = number.is_some_and(|(begin, process)| {
            let own = begin
                .strip_prefix(&*stem)
                .is_some_and(|end| end.starts_with('.'));
            own && process.parse() != Ok(std::process::id()) && process.parse::<u32>().is_ok()
        });
        if is_ours {
            fs::remove_file(entry.path()).with_context(|| entry.path().display().to_string())?;
        }
    }
    Ok(())
}
