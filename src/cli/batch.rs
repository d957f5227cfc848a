//! Many files: several at a time, taken up again.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::{fs, io, panic, process, thread};

use anyhow::{Context as _, bail};
use nurbray::formats::{Export, Resolver as _};
use nurbray::output;
use serde_json::json;

use super::input::{Beside, Named, sha256};

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

/// How a batch ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Ending {
    /// Files that could not be converted.
    pub(super) failed: usize,
    /// Files that were not begun.
    pub(super) left: usize,
}

/// Works on all jobs, `threads` at the same time, each of which shares the cores with the others.
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
    let next = AtomicUsize::new(0);
    // The next file is begun when one is finished.
    let some = || -> anyhow::Result<()> {
        while let Some(job) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
            one(job)?;
        }
        Ok(())
    };
    let threads = match threads {
        0 => rayon::current_num_threads(),
        threads => threads.min(jobs.len()),
    };
    // Threads of their own: one of the pool that waits for a part of its file would begin another.
    thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(some)).collect();
        let join = |other: thread::ScopedJoinHandle<'_, _>| {
            other
                .join()
                .unwrap_or_else(|panic| panic::resume_unwind(panic))
        };
        let own = some();
        others.into_iter().map(join).fold(own, Result::and)
    })?;
    Ok(Ending {
        failed: failed.into_inner(),
        left: left.into_inner(),
    })
}

/// The ending of records.
const DONE: &str = "done";

/// The endings of what formats have beside a file.
const BESIDE: [&str; 2] = ["bin", "mtl"];

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
        name.push(".");
        name.push(DONE);
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
        let own = self.output.file_name().unwrap_or_default();
        let bytes = match what {
            "beside" => beside.resolve(&name).ok(),
            // Its own name may be one that no text can hold.
            _ if own.to_string_lossy() == name => fs::read(&self.output).ok(),
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
    let name = output.file_name().unwrap_or_default().to_string_lossy();
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    let beside = BESIDE.map(|ending| format!("{stem}.{ending}"));
    let record = format!("{name}.{DONE}");
    let is_own =
        |found: &str| found == name || found == record || beside.iter().any(|b| b == found);
    let is_left = |found: &str, by: u32| by != process::id() && is_own(found);
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

/// A part of a batch: every `count`-th file from number `index` on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shard {
    pub(super) index: usize,
    pub(super) count: usize,
}

/// `I/N`, or `slurm` for the variables that Slurm sets in a job array.
pub(super) fn shard(text: &str) -> Result<Shard, String> {
    let found = if text == "slurm" {
        slurm().map_err(|error| format!("{error:#}"))?
    } else {
        let wrong = || format!("'{text}' is not I/N with I from 0 to N - 1, nor slurm");
        let (index, count) = text.split_once('/').ok_or_else(wrong)?;
        let (index, count) = (index.parse(), count.parse());
        let (Ok(index), Ok(count)) = (index, count) else {
            return Err(wrong());
        };
        Shard { index, count }
    };
    if found.index < found.count {
        Ok(found)
    } else {
        Err(format!(
            "there is no part {} of {}",
            found.index, found.count
        ))
    }
}

fn slurm() -> anyhow::Result<Shard> {
    let number = |name: &str| -> anyhow::Result<usize> {
        let value = std::env::var(name).with_context(|| format!("{name} is not set"))?;
        value
            .parse()
            .with_context(|| format!("{name} is '{value}'"))
    };
    let (id, least) = (
        number("SLURM_ARRAY_TASK_ID")?,
        number("SLURM_ARRAY_TASK_MIN")?,
    );
    let Some(index) = id.checked_sub(least) else {
        bail!("SLURM_ARRAY_TASK_ID is {id}, less than SLURM_ARRAY_TASK_MIN");
    };
    Ok(Shard {
        index,
        count: number("SLURM_ARRAY_TASK_COUNT")?,
    })
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use rayon::prelude::*;

    use super::*;

    #[test]
    fn no_more_files_are_begun_than_asked_for() {
        let (begun, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let work = |_: &()| {
            let now = begun.fetch_add(1, Ordering::Relaxed) + 1;
            most.fetch_max(now, Ordering::Relaxed);
            let pause = |_| thread::sleep(Duration::from_millis(1));
            (0..16).into_par_iter().for_each(pause);
            begun.fetch_sub(1, Ordering::Relaxed);
            Ok(Fate::Done)
        };
        let ending = run(&[(); 12], 3, work).unwrap();
        assert_eq!((ending.failed, ending.left), (0, 0));
        assert!(most.into_inner() <= 3);
    }

    #[test]
    fn shards() {
        assert_eq!(shard("1/3"), Ok(Shard { index: 1, count: 3 }));
        for wrong in ["3/3", "1", "a/b", "-1/2", "0/0"] {
            assert!(shard(wrong).is_err(), "{wrong}");
        }
    }
}
