//! How long something takes.

use std::time::{Duration, Instant};

/// A clock that runs since it was made.
///
/// With one thread in the current pool it counts the time that the processor spent on this very
/// thread, where the system tells it (Linux does), so that what else the machine does changes
/// little; otherwise it counts what a clock on the wall does.
#[derive(Debug)]
pub struct Stopwatch {
    wall: Instant,
    processor: Option<Duration>,
}

impl Stopwatch {
    /// Starts.
    pub fn start() -> Self {
        Self {
            processor: processor_time(),
            wall: Instant::now(),
        }
    }

    /// Time since the start.
    pub fn elapsed(&self) -> Duration {
        let wall = self.wall.elapsed();
        match (self.processor, processor_time()) {
            (Some(start), Some(now)) => now.saturating_sub(start),
            _ => wall,
        }
    }
}

/// Time that the processor spent on this thread, if it works alone.
fn processor_time() -> Option<Duration> {
    if rayon::current_num_threads() > 1 {
        return None;
    }
    // Linux brings its account up to date when a thread offers its place.
    std::thread::yield_now();
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds = text.split_whitespace().next()?.parse().ok()?;
    Some(Duration::from_nanos(nanoseconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waiting_takes_no_time_of_the_processor() {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .unwrap();
        let (asleep, awake) = pool.install(|| {
            let watch = Stopwatch::start();
            std::thread::sleep(Duration::from_millis(50));
            let asleep = watch.elapsed();
            let mut sum = 0_u64;
            for k in 0..20_000_000_u64 {
                sum = std::hint::black_box(sum.wrapping_add(k));
            }
            (asleep, watch.elapsed() - asleep)
        });
        assert!(awake > Duration::from_millis(1));
        if cfg!(target_os = "linux") {
            assert!(asleep < Duration::from_millis(25), "{asleep:?}");
        }
    }
}
