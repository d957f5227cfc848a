//! Pictures of what is not light: maps, efforts, verdicts.

use std::io;
use std::path::Path;

use png::{BitDepth, ColorType};

use super::{Judgement, Trace, Verdict};
use crate::output::{pack_png, replace_file};

/// Bytes of red, green and blue, top row first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Raster {
    /// Pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// All pixels.
    pub pixels: Vec<[u8; 3]>,
}

/// Colours from no effort to much: black, blue, cyan, green, yellow, red, white.
const HEAT: [[f64; 3]; 7] = [
    [0.0, 0.0, 0.0],
    [30.0, 50.0, 170.0],
    [20.0, 170.0, 200.0],
    [40.0, 170.0, 60.0],
    [240.0, 220.0, 40.0],
    [220.0, 40.0, 30.0],
    [255.0, 255.0, 255.0],
];

impl Raster {
    /// Efforts in false colours, by their logarithm: each of the six steps from black over
    /// blue, cyan, green, yellow and red to white is four times the effort, from 0 to 4095.
    pub fn of_effort(trace: &Trace, (width, height): (u32, u32)) -> Self {
        Self {
            width,
            height,
            pixels: trace.effort.iter().map(|&effort| heat(effort)).collect(),
        }
    }

    /// Verdicts: right light grey, wrong magenta, lost red, invented blue, not proven yellow.
    pub fn of_verdicts(judgement: &Judgement, (width, height): (u32, u32)) -> Self {
        let color = |verdict: &Verdict| match verdict {
            Verdict::Right => [225, 225, 225],
            Verdict::Wrong => [200, 0, 200],
            Verdict::Lost => [220, 0, 0],
            Verdict::Invented => [0, 60, 220],
            Verdict::Open => [240, 200, 0],
        };
        Self {
            width,
            height,
            pixels: judgement.verdicts.iter().map(color).collect(),
        }
    }

    /// Writes it as PNG; the file appears under its name when it is complete.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        let (bytes, size) = (self.pixels.as_flattened(), [self.width, self.height]);
        replace_file(path, |file| {
            pack_png(file, size, bytes, (ColorType::Rgb, BitDepth::Eight))
        })
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between colours"
)]
fn heat(effort: u32) -> [u8; 3] {
    let place = (f64::from(effort) + 1.0)
        .log(4.0)
        .min(HEAT.len() as f64 - 1.001);
    let k = place as usize;
    let share = place - k as f64;
    std::array::from_fn(|c| (HEAT[k][c] * (1.0 - share) + HEAT[k + 1][c] * share).round() as u8)
}
