//! The preliminary map: every surface drawn as facets, with its number and parameters for
//! colours.
//!
//! The map of the originals has eight bits per colour, red for the surface and green and blue
//! for the parameters (equations 6 to 8, table 1), and shows what is nearest in the middle of
//! each pixel. The wide map keeps all facets that come within a pixel, with full numbers and
//! parameters in single precision.

use glam::{DVec2, Vec2};

use super::Counts;
use super::world::{Sheet, View, World, index};

/// Facets along each side of a surface, at least, and of each of its spans.
const FACETS: usize = 16;
const FACETS_OF_A_SPAN: usize = 4;

/// How far outside of a facet a pixel's middle may be, in pixels.
const REACH: f64 = 1.0;

/// Surfaces that red tells apart; 0 is the background.
pub(super) const MOST_SURFACES: usize = 255;

/// A corner of a facet on the film, in pixels, with its inverse depth.
#[derive(Clone, Copy, Debug)]
struct Corner {
    place: DVec2,
    inverse: f64,
    depth: f64,
    share: DVec2,
}

/// What a facet tells of a pixel.
#[derive(Clone, Copy, Debug)]
struct Fragment {
    x: u32,
    y: u32,
    /// Parameters as a share of the domain.
    share: DVec2,
    depth: f64,
    /// The least depth that the surface may have there.
    near: f64,
    /// How far outside of the facet, in pixels.
    outside: f64,
}

/// Offers all fragments of a sheet.
fn draw(world: &World, sheet: &Sheet, view: &View, reach: f64, mut offer: impl FnMut(Fragment)) {
    let [u, v] = sheet.breaks.clone().map(|breaks| subdivided(&breaks));
    let mut counts = Counts::default();
    let corners: Vec<Option<Corner>> = u
        .iter()
        .flat_map(|&u| v.iter().map(move |&v| DVec2::new(u, v)))
        .map(|uv| {
            let h = world.value(sheet, uv, &mut counts);
            let [x, y, w] = view.project(&h);
            (w > 0.0).then(|| Corner {
                place: DVec2::new(x, y) / w,
                inverse: h[3] / w,
                depth: view.depth(&h),
                share: (uv - sheet.start) / sheet.size,
            })
        })
        .collect();
    for i in 0..u.len() - 1 {
        for j in 0..v.len() - 1 {
            let corner = |i: usize, j: usize| corners[i * v.len() + j];
            let quad = [
                corner(i, j),
                corner(i + 1, j),
                corner(i + 1, j + 1),
                corner(i, j + 1),
            ];
            // Facets that reach behind the camera are left out.
            let [Some(a), Some(b), Some(c), Some(d)] = quad else {
                continue;
            };
            fill(view, [a, b, c], reach, &mut offer);
            fill(view, [a, c, d], reach, &mut offer);
        }
    }
}

/// Each span cut evenly.
fn subdivided(breaks: &[f64]) -> Vec<f64> {
    let spans = breaks.len() - 1;
    let parts = FACETS.div_ceil(spans).max(FACETS_OF_A_SPAN);
    let mut all = vec![breaks[0]];
    for span in breaks.windows(2) {
        let step = (span[1] - span[0]) / parts as f64;
        all.extend((1..parts).map(|k| span[0] + step * k as f64));
        all.push(span[1]);
    }
    all
}

/// Offers the pixels of a facet, and those around it whose middles are within `reach`.
fn fill(view: &View, [a, b, c]: [Corner; 3], reach: f64, offer: &mut impl FnMut(Fragment)) {
    let area = (b.place - a.place).perp_dot(c.place - a.place);
    if area.abs() < 1e-9 || !area.is_finite() {
        return;
    }
    let low = a.place.min(b.place).min(c.place) - 0.5 - reach;
    let high = a.place.max(b.place).max(c.place) - 0.5 + reach;
    let (Some(columns), Some(rows)) = (
        pixels(low.x, high.x, view.width),
        pixels(low.y, high.y, view.height),
    ) else {
        return;
    };
    let least = a.depth.min(b.depth).min(c.depth);
    let most = a.depth.max(b.depth).max(c.depth);
    let middle = (least + most) * 0.5;
    let edge = a.place.distance(b.place).max(a.place.distance(c.place)) * view.footprint(middle);
    let near = least - (most - least) - 0.25 * edge;
    for y in rows {
        for x in columns.clone() {
            let place = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
            let weights = [(b, c), (c, a), (a, b)]
                .map(|(p, q)| (p.place - place).perp_dot(q.place - place) / area);
            // The point of the facet next to the pixel's middle, about.
            let clamped = weights.map(|w| w.max(0.0));
            let sum: f64 = clamped.iter().sum();
            let [wa, wb, wc] = clamped.map(|w| w / sum);
            let closest = a.place * wa + b.place * wb + c.place * wc;
            let outside = if weights.iter().all(|&w| w >= 0.0) {
                0.0
            } else {
                closest.distance(place)
            };
            if outside > reach {
                continue;
            }
            // Perspective: shares over depths are linear on the film.
            let [wa, wb, wc] = [wa * a.inverse, wb * b.inverse, wc * c.inverse];
            let scale = (wa + wb + wc).recip();
            let mix = [wa, wb, wc].map(|w| w * scale);
            offer(Fragment {
                x,
                y,
                share: a.share * mix[0] + b.share * mix[1] + c.share * mix[2],
                depth: a.depth * mix[0] + b.depth * mix[1] + c.depth * mix[2],
                near,
                outside,
            });
        }
    }
}

/// Whole numbers between two, within a side of the picture.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the picture"
)]
fn pixels(low: f64, high: f64, count: u32) -> Option<std::ops::Range<u32>> {
    let most = f64::from(count);
    let (low, high) = (
        low.ceil().clamp(0.0, most),
        (high.floor() + 1.0).clamp(0.0, most),
    );
    (low < high).then_some(low as u32..high as u32)
}

/// The map of the originals.
#[derive(Debug)]
pub(super) struct ByteMap {
    width: u32,
    pub(super) pixels: Vec<[u8; 3]>,
}

impl ByteMap {
    /// Draws at most [`MOST_SURFACES`] sheets.
    pub(super) fn draw(world: &World, view: &View) -> Self {
        let count = view.width as usize * view.height as usize;
        let (mut pixels, mut depths) = (vec![[0; 3]; count], vec![f64::INFINITY; count]);
        for (number, sheet) in world.sheets.iter().take(MOST_SURFACES).enumerate() {
            let red = u8::try_from(number + 1).unwrap_or(u8::MAX);
            let trimmed = world.is_trimmed(sheet);
            draw(world, sheet, view, 0.0, |fragment| {
                let k = (fragment.y * view.width + fragment.x) as usize;
                let shown = !trimmed || world.keeps(sheet, sheet.at(fragment.share));
                if fragment.depth < depths[k] && shown {
                    depths[k] = fragment.depth;
                    pixels[k] = [red, byte(fragment.share.x), byte(fragment.share.y)];
                }
            });
        }
        Self {
            width: view.width,
            pixels,
        }
    }

    /// The sheet in the middle of a pixel, and about where on it as a share of its domain.
    pub(super) fn start(&self, x: u32, y: u32) -> Option<(u32, DVec2)> {
        let [red, green, blue] = self.pixels[(y * self.width + x) as usize];
        let share = DVec2::new(f64::from(green), f64::from(blue)) / 255.0;
        Some((u32::from(red).checked_sub(1)?, share))
    }
}

/// Equations 7 and 8, for the whole range of a byte.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "from 0 to 255"
)]
fn byte(share: f64) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// A place to begin.
#[derive(Clone, Copy, Debug)]
pub(super) struct WideStart {
    pub(super) sheet: u32,
    pub(super) share: Vec2,
    /// The least depth of the surface there.
    pub(super) near: f32,
    outside: f32,
}

/// The map without the limits of the original: all facets next to each pixel.
#[derive(Debug)]
pub(super) struct WideMap {
    width: u32,
    /// Where the starts of each pixel begin, and the end of all.
    offsets: Vec<u32>,
    /// From near to far.
    starts: Vec<WideStart>,
}

impl WideMap {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the map is single precision"
    )]
    pub(super) fn draw(world: &World, view: &View) -> Self {
        let count = view.width as usize * view.height as usize;
        // Lists linked by position; zero ends a list.
        let (mut heads, mut links) = (vec![0_u32; count], vec![(placeholder(), 0_u32)]);
        for (number, sheet) in world.sheets.iter().enumerate() {
            let number = index(number);
            let wide = sheet.breaks.clone().map(|b| subdivided(&b).len() - 1);
            let facet = Vec2::new(wide[0] as f32, wide[1] as f32).recip() * 1.5;
            draw(world, sheet, view, REACH, |fragment| {
                let start = WideStart {
                    sheet: number,
                    share: fragment.share.as_vec2(),
                    near: fragment.near as f32,
                    outside: fragment.outside as f32,
                };
                let head = &mut heads[(fragment.y * view.width + fragment.x) as usize];
                // Neighbouring facets tell the same; the one next to the middle stays.
                let mut link = *head;
                while link != 0 && links[link as usize].0.sheet == number {
                    let (known, next) = &mut links[link as usize];
                    if (known.share - start.share).abs().cmple(facet).all() {
                        let near = known.near.min(start.near);
                        if start.outside < known.outside {
                            *known = start;
                        }
                        known.near = near;
                        return;
                    }
                    link = *next;
                }
                links.push((start, *head));
                *head = index(links.len() - 1);
            });
        }
        let mut map = Self {
            width: view.width,
            offsets: vec![0],
            starts: Vec::new(),
        };
        for head in heads {
            let first = map.starts.len();
            let mut link = head;
            while link != 0 {
                let (start, next) = links[link as usize];
                map.starts.push(start);
                link = next;
            }
            map.starts[first..].sort_by(|a, b| a.near.total_cmp(&b.near));
            map.offsets.push(index(map.starts.len()));
        }
        map
    }

    /// Where to begin in a pixel, from near to far.
    pub(super) fn starts(&self, x: u32, y: u32) -> &[WideStart] {
        let k = (y * self.width + x) as usize;
        &self.starts[self.offsets[k] as usize..self.offsets[k + 1] as usize]
    }
}

fn placeholder() -> WideStart {
    WideStart {
        sheet: u32::MAX,
        share: Vec2::ZERO,
        near: 0.0,
        outside: 0.0,
    }
}
