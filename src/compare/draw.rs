//! What is drawn onto pictures: colours for values, a legend, lines.

use glam::DVec3;

use crate::film::{Picture, PixelData};
use crate::render::Eye;

/// Colours from the least value to the largest, sRGB: dark blue over green to yellow, in steps
/// of equal lightness \[viridis\].
const COLORS: [[f32; 3]; 9] = [
    [0.267, 0.005, 0.329],
    [0.278, 0.176, 0.482],
    [0.231, 0.3179, 0.545],
    [0.172, 0.443, 0.557],
    [0.129, 0.565, 0.552],
    [0.153, 0.678, 0.506],
    [0.361, 0.784, 0.388],
    [0.667, 0.863, 0.196],
    [0.993, 0.906, 0.144],
];

/// The colour of a share from 0 to 1.
pub(crate) fn color(share: f32) -> [f32; 3] {
    let place = share.clamp(0.0, 1.0) * (COLORS.len() - 1) as f32;
    let below = COLORS.len() - 2;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and the number of colours"
    )]
    let first = (place as usize).min(below);
    let part = place - first as f32;
    let mix = |k: usize| COLORS[first][k] * (1.0 - part) + COLORS[first + 1][k] * part;
    [mix(0), mix(1), mix(2)]
}

/// Characters of numbers, five rows of three pixels, a digit each.
const GLYPHS: &[(char, u16)] = &[
    ('0', 0o75557),
    ('1', 0o26227),
    ('2', 0o71747),
    ('3', 0o71717),
    ('4', 0o55711),
    ('5', 0o74717),
    ('6', 0o74757),
    ('7', 0o71222),
    ('8', 0o75757),
    ('9', 0o75717),
    ('.', 0o00002),
    ('-', 0o00700),
    ('e', 0o07747),
];

/// Pixels of a character's pixel.
const BIG: usize = 2;

/// Draws the colours with the values that they stand for into the lower left corner.
pub(crate) fn legend(picture: &mut Picture, largest: f64) {
    let (width, height) = (picture.width(), picture.height());
    let (length, thick, margin) = (width / 3, height / 40 + 4, height / 40 + 2);
    let top = height.saturating_sub(margin + thick);
    let text_top = top.saturating_sub(5 * BIG + 4);
    for x in 0..length {
        let shade = color(x as f32 / length as f32);
        for y in top..top + thick {
            put(picture, margin + x, y, shade);
        }
    }
    for (part, share) in [0.0, 0.5, 1.0].into_iter().enumerate() {
        let text = number(largest * share);
        let along = text.chars().count() * 4 * BIG;
        let at = margin + length * part / 2;
        let left = match part {
            0 => at,
            1 => at.saturating_sub(along / 2),
            _ => at.saturating_sub(along),
        };
        for (k, letter) in text.chars().enumerate() {
            glyph(picture, left + 4 * BIG * k, text_top, letter);
        }
    }
}

/// A value with three digits.
fn number(value: f64) -> String {
    if value == 0.0 || (1e-3..1e4).contains(&value) {
        let digits = if value >= 100.0 {
            0
        } else if value >= 1.0 {
            2
        } else {
            5
        };
        format!("{value:.digits$}")
    } else {
        format!("{value:.2e}")
    }
}

fn glyph(picture: &mut Picture, left: usize, top: usize, letter: char) {
    let Some((_, bits)) = GLYPHS.iter().find(|(own, _)| *own == letter) else {
        return;
    };
    for k in 0..15 {
        if bits >> (14 - k) & 1 == 0 {
            continue;
        }
        for (dx, dy) in (0..BIG * BIG).map(|j| (j % BIG, j / BIG)) {
            put(
                picture,
                left + k % 3 * BIG + dx,
                top + k / 3 * BIG + dy,
                [0.1; 3],
            );
        }
    }
}

fn put(picture: &mut Picture, x: usize, y: usize, color: [f32; 3]) {
    let (width, height) = (picture.width(), picture.height());
    if x < width && y < height {
        picture.pixels_mut()[y * width + x] = color;
    }
}

/// Lines are drawn in front of what is nearer by less than this share of its depth.
const IN_FRONT: f64 = 2e-3;

/// The largest depth in a pixel and beside it, where that is one: on a slope the depth of a line
/// is not quite that in the middle of its pixel.
fn deepest(depths: &[f32], width: usize) -> Vec<f32> {
    let around = |k: usize| {
        let beside = [
            (!k.is_multiple_of(width)).then(|| k - 1),
            (k % width + 1 < width).then(|| k + 1),
            k.checked_sub(width),
            Some(k + width).filter(|&other| other < depths.len()),
        ];
        let beside = beside.into_iter().flatten().map(|other| depths[other]);
        beside
            .filter(|d| *d < PixelData::FAR)
            .fold(depths[k], f32::max)
    };
    (0..depths.len()).map(around).collect()
}

/// Draws the segments that are not hidden, with the depth of every pixel at hand; the colour
/// is mixed with what is there.
pub(crate) fn lines(
    picture: &mut Picture,
    eye: &Eye<'_>,
    depths: &[f32],
    segments: &[[DVec3; 2]],
    color: [f32; 3],
) {
    let (width, height) = (picture.width() as f64, picture.height() as f64);
    let deepest = deepest(depths, picture.width());
    let mut drawn = vec![false; depths.len()];
    for ends in segments {
        let [(a, near), (b, far)] = ends.map(|p| eye.project(p));
        if near <= 0.0 || far <= 0.0 {
            continue;
        }
        let steps = (b - a)
            .abs()
            .max_element()
            .ceil()
            .clamp(1.0, 4.0 * (width + height));
        let mut k = 0.0;
        while k <= steps {
            let share = k / steps;
            let p = a.lerp(b, share);
            // In perspective it is one over the depth that runs evenly along the picture.
            let depth = if eye.is_parallel() {
                near + (far - near) * share
            } else {
                1.0 / ((1.0 - share) / near + share / far)
            };
            k += 1.0;
            if p.x < 0.0 || p.y < 0.0 || p.x >= width || p.y >= height {
                continue;
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "inside the picture"
            )]
            let index = p.y as usize * picture.width() + p.x as usize;
            if depth <= f64::from(deepest[index]) * (1.0 + IN_FRONT) && !drawn[index] {
                drawn[index] = true;
                let pixel = &mut picture.pixels_mut()[index];
                *pixel = [0, 1, 2].map(|c| 0.35 * pixel[c] + 0.65 * color[c]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_run_from_the_first_to_the_last() {
        assert_eq!((color(-1.0), color(2.0)), (COLORS[0], COLORS[8]));
        assert_eq!(number(0.25), "0.25000");
        let mut picture = Picture::new(200, 150, vec![[1.0; 3]; 30_000]).unwrap();
        legend(&mut picture, 0.25);
        assert!(picture.pixels().contains(&[0.1; 3]));
    }
}
