//! Contact sheets: small pictures side by side, each above its name.

use anyhow::bail;
use font8x8::{BASIC_FONTS, UnicodeFonts as _};
use nurbray::Film;
use nurbray::kernel::linear_from_srgb;

/// Pixels of each picture, unless the user wants others.
pub(super) const SIZE: (u32, u32) = (240, 180);

/// Pixels around pictures.
const GAP: u32 = 6;

/// Height of a line of text, and width of a letter.
const LETTER: u32 = 8;

/// Most pixels of a sheet.
const MOST: u64 = 1 << 28;

/// Width by height that sheets are near to.
const SHAPE: f64 = 1.4;

/// Colours as sRGB: of the sheet, of text, and of places without a picture.
const COLORS: [f64; 3] = [1.0, 0.1, 0.85];

/// A sheet that is being filled, row by row.
pub(super) struct Sheet {
    film: Film,
    size: (u32, u32),
    columns: u32,
    count: u32,
}

/// A grey.
fn grey(index: usize) -> [f32; 4] {
    let linear = linear_from_srgb(glam::DVec3::splat(COLORS[index])).as_vec3();
    [linear.x, linear.y, linear.z, 1.0]
}

impl Sheet {
    /// An empty sheet for `count` pictures of a size.
    pub(super) fn new(count: usize, size: (u32, u32)) -> anyhow::Result<Self> {
        let cell = [
            u64::from(size.0 + GAP),
            u64::from(size.1 + 2 * GAP + LETTER),
        ];
        let count = count.max(1) as u64;
        let per_row = (count as f64 * SHAPE * cell[1] as f64 / cell[0] as f64).sqrt();
        let columns = (1..=count).find(|&n| n as f64 >= per_row).unwrap_or(count);
        let rows = count.div_ceil(columns);
        let gap = u64::from(GAP);
        let [width, height] = [columns * cell[0] + gap, rows * cell[1] + gap];
        let (Ok(width), Ok(height), Ok(columns), true) = (
            u32::try_from(width),
            u32::try_from(height),
            u32::try_from(columns),
            width.saturating_mul(height) <= MOST,
        ) else {
            bail!("a sheet of {width} x {height} pixels; the limit is {MOST} pixels");
        };
        let mut film = Film::new(width, height);
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            film.paint(x, y, grey(0));
        }
        Ok(Self {
            film,
            size,
            columns,
            count: 0,
        })
    }

    /// Adds a picture, or a place with the reason why there is none, and its name; what is too
    /// long of that is cut off at its beginning.
    pub(super) fn add(&mut self, picture: Result<&Film, &str>, name: &str) {
        let (width, height) = self.size;
        let left = GAP + (self.count % self.columns) * (width + GAP);
        let top = GAP + (self.count / self.columns) * (height + 2 * GAP + LETTER);
        self.count += 1;
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let index = y as usize * width as usize + x as usize;
            let color = picture.ok().and_then(|film| film.colors().get(index));
            let color = color.copied().unwrap_or(grey(2));
            self.film.paint(left + x, top + y, color);
        }
        if let (Err(reason), true) = (picture, height >= LETTER) {
            self.write(left, top + (height - LETTER) / 2, reason);
        }
        self.write(left, top + height + GAP / 2, name);
    }

    /// Writes a line from a place on, no wider than a picture.
    fn write(&mut self, left: u32, top: u32, text: &str) {
        let most = (self.size.0 / LETTER) as usize;
        let length = text.chars().count();
        let letters = text.chars().skip(length.saturating_sub(most));
        for (letter, at) in letters.zip((left..).step_by(LETTER as usize)) {
            let rows = BASIC_FONTS.get(letter).or(BASIC_FONTS.get('?'));
            for (row, y) in rows.unwrap_or_default().into_iter().zip(top..) {
                for x in (0..LETTER).filter(|x| row >> x & 1 == 1) {
                    self.film.paint(at + x, y, grey(1));
                }
            }
        }
    }

    /// The sheet.
    pub(super) fn into_film(self) -> Film {
        self.film
    }
}
