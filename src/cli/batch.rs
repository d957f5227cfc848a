//! Many files: several at a time, stopped in good order, taken up again.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;
use std::{fs, io, process, thread};

use anyhow::Context as _;
use nurbray::formats::{Export, Resolver as _};
use nurbray::output;
use rayon::prelude::*;
use serde_json::json;
use signal_hook::consts::{SIGINT, SIGTERM};

use super::input::{Beside, Named, sha256};
use super::say::say;

/// How often is looked whether a signal has come.
const PAUSE: Duration = Duration::from_millis(20);

/// What became of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fate {
    /// It is converted, or was before.
    Done,
    /// It could not be converted.
    Failed,
    /// It was not begun because the program was told to stop.
    Left,
}

impl Fate {
    /// Its name for machines.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Done => "ok",
            Self::Failed => "failed",
            Self::Left => "left",
        }
    }
}

/// Whether the program was told to stop.
#[derive(Clone, Debug)]
pub(super) struct Stop {
    asked: Arc<AtomicBool>,
}

impl Stop {
    /// Listens to SIGINT and SIGTERM. The first one asks to stop; the second one ends the program
    /// at once, without the unfinished files that it has in `folders`.
    pub(super) fn listen(folders: Vec<PathBuf>) -> anyhow::Result<Self> {
        let signal = Arc::new(AtomicUsize::new(0));
        for known in [SIGINT, SIGTERM] {
            let number = usize::try_from(known)?;
            signal_hook::flag::register_usize(known, Arc::clone(&signal), number)?;
        }
        let asked = Arc::new(AtomicBool::new(false));
        let stop = Self {
            asked: Arc::clone(&asked),
        };
        thread::spawn(move || {
            loop {
                thread::sleep(PAUSE);
                let got = signal.swap(0, Ordering::Relaxed);
                if got == 0 {
                    continue;
                }
                if asked.swap(true, Ordering::Relaxed) {
                    for folder in &folders {
                        // The program ends in any case.
                        let _ = remove_parts(folder, |_, by| by == process::id());
                    }
                    process::exit(128 + i32::try_from(got).unwrap_or_default());
                }
                say!(
                    "nurbray: stopping when the files that are being converted are done; \
                     a second signal stops at once"
                );
            }
        });
        Ok(stop)
    }

    pub(super) fn is_asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// What comes of waiting for input, unless the program is told to stop before.
    pub(super) fn or_wait<T: Send + 'static>(
        &self,
        wait: impl FnOnce() -> T + Send + 'static,
    ) -> Option<T> {
        let (sender, receiver) = mpsc::channel();
        // Nobody listens any more after a stop.
        thread::spawn(move || drop(sender.send(wait())));
        while !self.is_asked() {
            match receiver.recv_timeout(PAUSE) {
                Err(mpsc::RecvTimeoutError::Timeout) => {}
                result => return result.ok(),
            }
        }
        None
    }
}

/// How a batch ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Ending {
    /// Files that could not be converted.
    pub(super) failed: usize,
    /// Files that were not begun.
    pub(super) left: usize,
}

/// Works on all jobs, `threads` at the same time.
pub(super) fn run<J: Sync>(
    jobs: &[J],
    threads: usize,
    work: impl Fn(&J) -> anyhow::Result<Fate> + Sync,
) -> anyhow::Result<Ending> {
    let (failed, left) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let one = |job: &J| -> anyhow::Result<()> {
        match work(job)? {
            Fate::Done => {}
            Fate::Failed => drop(failed.fetch_add(1, Ordering::Relaxed)),
            Fate::Left => drop(left.fetch_add(1, Ordering::Relaxed)),
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

/// Stands for the hash of a file that is not there.
const NO_FILE: &str = "-";

/// What tells a later run that an output is complete and of what it was made: a small file
/// beside it.
#[derive(Debug)]
pub(super) struct Record {
    output: PathBuf,
    path: PathBuf,
    head: String,
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
            head: format!("nurbray {version}\nsource {sha256}\noptions {options}\n"),
        }
    }

    /// Whether the outputs are as they were written, and were made from the same with the same
    /// options; `beside` fetches what the source names.
    pub(super) fn is_done(&self, beside: &Beside<'_>) -> bool {
        let known = fs::read_to_string(&self.path).unwrap_or_default();
        let Some(files) = known.strip_prefix(&self.head) else {
            return false;
        };
        let is_output = |line: &str| line.starts_with("output ");
        files.lines().any(is_output) && files.lines().all(|line| self.holds(line, beside))
    }

    /// Whether a file still has the hash that a line of the record gives it.
    fn holds(&self, line: &str, beside: &Beside<'_>) -> bool {
        let mut parts = line.splitn(3, ' ');
        let (Some(what), Some(hash), Some(name)) = (parts.next(), parts.next(), parts.next())
        else {
            return false;
        };
        let Ok(name) = serde_json::from_str::<String>(name) else {
            return false;
        };
        let bytes = match what {
            "beside" => beside.resolve(&name).ok(),
            _ => fs::read(self.output.with_file_name(&name)).ok(),
        };
        bytes.as_deref().map_or(NO_FILE.to_owned(), sha256) == hash
    }

    /// Writes it for outputs that are complete; `beside` are the files that the source names.
    pub(super) fn write(&self, beside: &Named, export: &Export) -> anyhow::Result<()> {
        let mut text = self.head.clone();
        for (name, hash) in beside {
            let hash = hash.as_deref().unwrap_or(NO_FILE);
            text += &format!("beside {hash} {}\n", json!(name));
        }
        let name = self.output.file_name().unwrap_or_default();
        let main = (name.to_string_lossy().into_owned(), &export.bytes);
        let others = export.beside.iter().map(|(name, b)| (name.clone(), b));
        for (name, bytes) in others.chain([main]) {
            text += &format!("output {} {}\n", sha256(bytes), json!(name));
        }
        let fill = |file: &mut io::BufWriter<fs::File>| file.write_all(text.as_bytes());
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
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    let is_left = |name: &str, by: u32| {
        let end = name.strip_prefix(&*stem);
        by != process::id() && end.is_some_and(|end| end.starts_with('.'))
    };
    remove_parts(output::folder(output), is_left)
}

/// Removes the unfinished files in a folder of which name and process fit.
fn remove_parts(folder: &Path, fits: impl Fn(&str, u32) -> bool) -> anyhow::Result<()> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Ok(());
    };
    for entry in entries {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        // NAME.PROCESS.part
        let part = name
            .strip_suffix(".part")
            .and_then(|rest| rest.rsplit_once('.'));
        let is_ours = part.is_some_and(|(name, by)| by.parse().is_ok_and(|by| fits(name, by)));
        if is_ours {
            fs::remove_file(entry.path()).with_context(|| entry.path().display().to_string())?;
        }
    }
    Ok(())
}
