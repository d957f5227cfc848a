//! All readers: no file makes one panic, run for long or fill the memory.
//!
//! The first byte picks the file name ending that helps where the content does not tell the
//! format, so that one corpus serves all. `make fuzz` starts it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use nurbray_formats::{FORMATS, Limits, NoFiles, ReadOptions};

fuzz_target!(|data: &[u8]| {
    let Some((first, bytes)) = data.split_first() else {
        return;
    };
    let format = &FORMATS[usize::from(*first) % FORMATS.len()];
    // Small enough that a file which asks for more than it holds is told from one that is slow.
    let limits = Limits {
        points: 1_000_000,
        placements: 1_000_000,
        entities: 1_000_000,
        ..Limits::default()
    };
    let options = ReadOptions {
        limits: &limits,
        resolver: &NoFiles,
    };
    let _ = nurbray_formats::read(bytes, format.extensions.first().copied(), &options);
});
