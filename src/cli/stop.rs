//! Stopping in good order when a signal asks for it.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::{Duration, Instant};

use nurbray::output;
use signal_hook::consts::{SIGINT, SIGTERM};

use super::input::{Loaded, ReadArgs};
use super::say::say;
use super::{FAILED, Failures, PARTLY};

/// How often is looked whether a signal has come.
const PAUSE: Duration = Duration::from_millis(20);

/// Whether the program was told to stop.
#[derive(Clone, Debug)]
pub(super) struct Stop {
    asked: Arc<AtomicBool>,
}

impl Stop {
    /// Listens to SIGINT and SIGTERM. The first one asks to stop when `current`, such as `the picture
    /// that is being made is`, is done; the second one ends the program at once, without its
    /// unfinished files. So does the first one if there is nothing to wait for.
    pub(super) fn listen(current: Option<&'static str>) -> anyhow::Result<Self> {
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
                match current {
                    Some(current) if !asked.swap(true, Ordering::Relaxed) => {
                        say!(
                            "nurbray: stopping when {current} done; a second signal stops at once"
                        );
                        continue;
                    }
                    Some(_) => {}
                    None => say!("nurbray: stopped"),
                }
                output::end(128 + i32::try_from(got).unwrap_or_default());
            }
        });
        Ok(stop)
    }

    pub(super) fn is_asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// The content of a file or of standard input, unless the program is told to stop before it has
    /// come.
    pub(super) fn or_bytes(&self, read: &ReadArgs, path: &Path) -> Option<anyhow::Result<Vec<u8>>> {
        let (sender, receiver) = mpsc::channel();
        let (read, path) = (read.clone(), path.to_owned());
        // Nobody listens any more after a stop.
        thread::spawn(move || drop(sender.send(read.bytes(&path))));
        while !self.is_asked() {
            match receiver.recv_timeout(PAUSE) {
                Err(mpsc::RecvTimeoutError::Timeout) => {}
                result => return result.ok(),
            }
        }
        None
    }

    /// A file that is read, unless the program is told to stop before its content has come.
    pub(super) fn or_load(&self, read: &ReadArgs, path: &Path) -> Option<anyhow::Result<Loaded>> {
        let started = Instant::now();
        let loaded = self.or_bytes(read, path)?.and_then(|bytes| {
            let mut loaded = read.understand(path, &bytes)?;
            loaded.took = started.elapsed();
            Ok(loaded)
        });
        Some(loaded)
    }
}

/// Makes a file that grows beyond the limit of the system an error, not the end of the program.
#[cfg(unix)]
pub(super) fn outlive_large_files() -> std::io::Result<()> {
    // The signal ends the program only where nobody listens to it.
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default()).map(drop)
}

/// Says how many files of a batch are left, and gives its exit code: that of a batch of which some
/// or all could not be done.
pub(super) fn ending(all: usize, failed: usize, left: usize) -> Failures {
    match left {
        0 => {}
        1 => say!("nurbray: stopped; 1 file is left"),
        left => say!("nurbray: stopped; {left} files are left"),
    }
    let code = match failed + left {
        0 => 0,
        without if without < all => PARTLY,
        _ => FAILED,
    };
    Failures {
        count: failed,
        code,
    }
}
