//! The film: linear light and data channels, one entry per pixel, top row first; and pictures in sRGB.

use std::ops::Range;

use glam::{DVec3, Vec3};
use kernel::{linear_from_srgb, srgb_from_linear};
use rayon::prelude::*;

/// What the ray through the middle of a pixel met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelData {
    /// Distance along the camera's axis, in scene units; [`PixelData::FAR`] for a miss.
    pub depth: f32,
    /// Unit normal in the world, along `du x dv`.
    pub normal: [f32; 3],
    /// The point in the world.
    pub position: [f32; 3],
    /// Parameters of the point in the patch's own domain.
    pub uv: [f32; 2],
    /// Number of the patch or mesh; -1 for a miss.
    pub shape: f32,
    /// What was proven about the pixel, by [`crate::Certificate::code`]; -1 if nothing was
    /// tried.
    pub status: f32,
}

impl PixelData {
    /// Depth of a pixel without a hit.
    pub const FAR: f32 = 1e10;

    /// A pixel without a hit.
    pub const MISS: Self = Self {
        depth: Self::FAR,
        normal: [0.0; 3],
        position: [0.0; 3],
        uv: [0.0; 2],
        shape: -1.0,
        status: -1.0,
    };
}

/// A rendered picture before it is encoded.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    /// Linear colour times coverage, and coverage.
    colors: Vec<[f32; 4]>,
    /// Empty without data channels.
    data: Vec<PixelData>,
}

impl Film {
    /// A film of transparent black pixels, without data channels.
    pub fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            colors: vec![[0.0; 4]; width as usize * height as usize],
            data: Vec::new(),
        }
    }

    /// A film of transparent black pixels that meet nothing.
    pub fn with_data(width: u32, height: u32) -> Self {
        let film = Self::new(width, height);
        let data = rayon::iter::repeat_n(PixelData::MISS, film.colors.len()).collect();
        Self { data, ..film }
    }

    /// Pixels per row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Number of rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The film cut into squares of some pixels a side, row by row, to be filled side by side.
    pub(crate) fn tiles_mut(&mut self, side: u32) -> Vec<FilmTile<'_>> {
        let (row, step) = (self.width as usize, side as usize);
        if row == 0 || step == 0 {
            return Vec::new();
        }
        let squares = blocks(&(0..self.height), &(0..self.width), side);
        let mut tiles: Vec<_> = squares.map(|(y, x)| FilmTile::empty(x, y)).collect();
        for (tile, part) in parts(&mut self.colors, row, step) {
            tiles[tile].colors.push(part);
        }
        for (tile, part) in parts(&mut self.data, row, step) {
            tiles[tile].data.push(part);
        }
        tiles
    }

    /// Sets one pixel; `x` counts from the left, `y` from the top.
    pub(crate) fn set(&mut self, x: u32, y: u32, color: [f32; 4], data: PixelData) {
        let index = y as usize * self.width as usize + x as usize;
        self.colors[index] = color;
        if let Some(place) = self.data.get_mut(index) {
            *place = data;
        }
    }

    /// Gives one pixel a colour, linear and times its coverage, and no data; `x` counts from the
    /// left, `y` from the top. Pixels outside of the film are passed over.
    pub fn paint(&mut self, x: u32, y: u32, color: [f32; 4]) {
        if x < self.width && y < self.height {
            self.set(x, y, color, PixelData::MISS);
        }
    }

    /// Linear red, green and blue times coverage, and coverage.
    pub fn colors(&self) -> &[[f32; 4]] {
        &self.colors
    }

    /// The colours, to be drawn over.
    pub(crate) fn colors_mut(&mut self) -> &mut [[f32; 4]] {
        &mut self.colors
    }

    /// The data channels: one entry for each pixel, or none at all.
    pub fn data(&self) -> &[PixelData] {
        &self.data
    }

    /// The data channels, to be completed.
    pub(crate) fn data_mut(&mut self) -> &mut [PixelData] {
        &mut self.data
    }

    /// Puts an opaque linear colour behind everything.
    #[must_use]
    pub fn over(self, background: DVec3) -> Self {
        self.over_each(|_, _| background)
    }

    /// Puts an opaque linear colour behind each pixel, by its `x` and `y`.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "film is single precision")]
    pub(crate) fn over_each(mut self, background: impl Fn(u32, u32) -> DVec3) -> Self {
        let places = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        for (color, (x, y)) in self.colors.iter_mut().zip(places) {
            let through = 1.0 - color[3];
            for (c, b) in color.iter_mut().zip(background(x, y).to_array()) {
                *c += through * b as f32;
            }
            color[3] = 1.0;
        }
        self
    }
}

/// An opaque picture in sRGB, from 0 to 1, the top row first.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
}

impl Picture {
    /// A picture of these pixels; `None` unless there are `width` times `height` of them.
    pub fn new(width: usize, height: usize, pixels: Vec<[f32; 3]>) -> Option<Self> {
        let fits = width > 0 && width.checked_mul(height) == Some(pixels.len()) && height > 0;
        fits.then_some(Self {
            width,
            height,
            pixels,
        })
    }

    /// The colours of a film; what is behind it is black where nothing was put there.
    pub fn of(film: &Film) -> Self {
        let encode = |&[r, g, b, _]: &[f32; 4]| encoded(Vec3::new(r, g, b)).to_array();
        Self {
            width: film.width() as usize,
            height: film.height() as usize,
            pixels: film.colors().iter().map(encode).collect(),
        }
    }

    /// Pixels per row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels.
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// The pixels, to be drawn on.
    pub(crate) fn pixels_mut(&mut self) -> &mut [[f32; 3]] {
        &mut self.pixels
    }

    /// The pixels in linear light.
    pub(crate) fn linear(&self) -> Vec<[f32; 3]> {
        let decode = |p: &[f32; 3]| {
            let srgb = Vec3::from(*p).as_dvec3();
            linear_from_srgb(srgb).as_vec3().to_array()
        };
        self.pixels.iter().map(decode).collect()
    }
}

/// Light as a picture has it: in sRGB, cut to what that can show.
pub(crate) fn encoded(linear: Vec3) -> Vec3 {
    let shown = linear.as_dvec3().clamp(DVec3::ZERO, DVec3::ONE);
    srgb_from_linear(shown).as_vec3()
}

/// The rows of pixels cut at each `step`, and the number of the square that each part lies in.
fn parts<T>(pixels: &mut [T], row: usize, step: usize) -> impl Iterator<Item = (usize, &mut [T])> {
    let across = row.div_ceil(step);
    let rows = pixels.chunks_mut(row).enumerate();
    rows.flat_map(move |(y, row)| {
        let parts = row.chunks_mut(step).enumerate();
        parts.map(move |(x, part)| (y / step * across + x, part))
    })
}

/// A rectangle of a film.
pub(crate) struct FilmTile<'a> {
    pub(crate) x: Range<u32>,
    pub(crate) y: Range<u32>,
    /// Those of each row.
    colors: Vec<&'a mut [[f32; 4]]>,
    data: Vec<&'a mut [PixelData]>,
}

impl FilmTile<'_> {
    fn empty(x: Range<u32>, y: Range<u32>) -> Self {
        let (colors, data) = (Vec::new(), Vec::new());
        Self { x, y, colors, data }
    }

    /// As [`Film::set`], for a pixel of the tile.
    pub(crate) fn set(&mut self, x: u32, y: u32, color: [f32; 4], data: PixelData) {
        let (row, place) = ((y - self.y.start) as usize, (x - self.x.start) as usize);
        self.colors[row][place] = color;
        if let Some(row) = self.data.get_mut(row) {
            row[place] = data;
        }
    }
}

/// A rectangle cut into squares, row by row.
pub(crate) fn blocks(
    y: &Range<u32>,
    x: &Range<u32>,
    side: u32,
) -> impl Iterator<Item = (Range<u32>, Range<u32>)> + use<> {
    let steps = move |range: &Range<u32>| {
        let end = range.end;
        range
            .clone()
            .step_by(side as usize)
            .map(move |a| a..end.min(a + side))
    };
    let across = steps(x);
    steps(y).flat_map(move |y| across.clone().map(move |x| (y.clone(), x)))
}
