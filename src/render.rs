//! The loop over tiles, pixels and samples.

use std::time::{Duration, Instant};

use glam::{DVec2, DVec3};
use kernel::{Camera, Lens, Ray, Sky};
use rayon::prelude::*;

use crate::accelerator::{Accelerator, Workspace};
use crate::film::{Film, FilmTile, PixelData, blocks};
use crate::integrator::{Integrator, Radiance, Shading};
use crate::intersect::Hit;

/// Side of a tile, about, in samples: what is known of them fits in the caches.
const TILE: u32 = 32;

/// Side of a tile at the least, in pixels.
const LEAST_TILE: u32 = 4;

/// How to render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// Pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// `samples x samples` rays per pixel, and one more through the middle for the data channels, unless there is
    /// only that one.
    pub samples: u32,
    /// How surfaces are shaded.
    pub shading: Shading,
    /// Whether the film gets data channels.
    pub data: bool,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            width: 960,
            height: 720,
            samples: 2,
            shading: Shading::Phong,
            data: true,
        }
    }
}

impl RenderOptions {
    /// The film before anything is on it.
    pub fn film(&self) -> Film {
        if self.data {
            Film::with_data(self.width, self.height)
        } else {
            Film::new(self.width, self.height)
        }
    }
}

/// What rendering took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RenderStats {
    /// Rays from the camera.
    pub primary_rays: u64,
    /// Rays towards lights and through transparent surfaces.
    pub secondary_rays: u64,
    /// Rays from the camera that met something.
    pub hits: u64,
    /// Those of them that stand for a gap between two faces.
    pub filled: u64,
    /// Cells that the leaf solver examined.
    pub cells_examined: u64,
    /// Time for rays from the camera, summed over threads.
    pub trace: Duration,
    /// Time for shading, the secondary rays among it, summed over threads.
    pub shade: Duration,
}

/// Renders what `camera` sees, in tiles and on all threads of the current pool.
///
/// Every pixel depends on its place alone, so that the film does not depend on the number
/// of threads. `progress` is told each time another number of pixels is done.
///
/// What is behind the shapes, and wires, are not on the film. [`draw_curves`](crate::draw_curves) draws
/// wires; then [`Film::over`] puts the background of the scene behind all, or [`over_sky`] its sky.
pub fn render(
    accelerator: &Accelerator<'_>,
    camera: &Camera,
    options: &RenderOptions,
    progress: &(dyn Fn(u64) + Sync),
) -> (Film, RenderStats) {
    paint_all(accelerator, camera, options, None, progress)
}

/// Shades hits that have been found before, one for each pixel, top row first; `options` must
/// ask for one sample.
pub(crate) fn render_found(
    accelerator: &Accelerator<'_>,
    camera: &Camera,
    options: &RenderOptions,
    found: &[Option<Hit>],
) -> (Film, RenderStats) {
    paint_all(accelerator, camera, options, Some(found), &|_| {})
}

fn paint_all(
    accelerator: &Accelerator<'_>,
    camera: &Camera,
    options: &RenderOptions,
    found: Option<&[Option<Hit>]>,
    progress: &(dyn Fn(u64) + Sync),
) -> (Film, RenderStats) {
    let integrator = Integrator::new(accelerator, camera, options.shading);
    let painter = Painter {
        accelerator,
        integrator,
        camera,
        rays: FilmRays::new(
            camera,
            DVec2::new(options.width.into(), options.height.into()),
        ),
        places: places(options),
        options,
        found,
    };
    let side = (TILE / samples(options)).max(LEAST_TILE);
    let mut film = options.film();
    let stats = film
        .tiles_mut(1 << side.ilog2())
        .into_iter()
        // Each goes to the next thread that is free.
        .par_bridge()
        .map_init(Workspace::default, |workspace, mut tile| {
            let stats = painter.paint(&mut tile, workspace);
            progress(u64::from(tile.x.end - tile.x.start) * u64::from(tile.y.end - tile.y.start));
            stats
        })
        .reduce(RenderStats::default, RenderStats::plus);
    (film, stats)
}

impl RenderStats {
    fn plus(self, other: Self) -> Self {
        Self {
            primary_rays: self.primary_rays + other.primary_rays,
            secondary_rays: self.secondary_rays + other.secondary_rays,
            hits: self.hits + other.hits,
            filled: self.filled + other.filled,
            cells_examined: self.cells_examined + other.cells_examined,
            trace: self.trace + other.trace,
            shade: self.shade + other.shade,
        }
    }
}

/// The pixels of a tile, square by square, so that those of a packet of rays lie close together.
fn pixels(tile: &FilmTile<'_>) -> impl Iterator<Item = (u32, u32)> + use<> {
    let squares = blocks(&tile.y, &tile.x, 8);
    let parts = squares.flat_map(|(y, x)| blocks(&y, &x, 4));
    parts.flat_map(|(y, x)| y.flat_map(move |y| x.clone().map(move |x| (x, y))))
}

/// Colour samples along one side of a pixel.
fn samples(options: &RenderOptions) -> u32 {
    match options.shading {
        Shading::None => 1,
        _ => options.samples.max(1),
    }
}

/// Where the rays of a pixel pass, in pixels from its upper left corner: on a grid that is turned so far that no two
/// lie above or beside one another. So borders that are nearly upright or level have as many steps as a pixel has
/// samples. The last is the middle, from which data channels come.
fn places(options: &RenderOptions) -> Vec<DVec2> {
    let n = samples(options);
    let mut places: Vec<_> = (0..n * n)
        .map(|k| {
            let (column, row) = (k % n, k / n);
            let cell = DVec2::new(f64::from(column), f64::from(row));
            let within = DVec2::new(f64::from(n - 1 - row), f64::from(column)) + 0.5;
            (cell + within / f64::from(n)) / f64::from(n)
        })
        .collect();
    if options.data && n > 1 {
        places.push(DVec2::splat(0.5));
    }
    places
}

type Pixel = ([f32; 4], PixelData);

struct Painter<'a> {
    accelerator: &'a Accelerator<'a>,
    integrator: Integrator<'a>,
    camera: &'a Camera,
    rays: FilmRays,
    /// Of each pixel's rays, from its corner.
    places: Vec<DVec2>,
    options: &'a RenderOptions,
    /// What the rays through the middles of all pixels meet, if that is known.
    found: Option<&'a [Option<Hit>]>,
}

impl Painter<'_> {
    /// Traces, then shades, all samples of a tile.
    fn paint(&self, tile: &mut FilmTile<'_>, workspace: &mut Workspace) -> RenderStats {
        let mut stats = RenderStats::default();
        let cells_before = workspace.cells_examined();
        let started = Instant::now();
        let per_pixel = self.places.len();
        let mut rays = Vec::new();
        let (width, height) = (tile.x.end - tile.x.start, tile.y.end - tile.y.start);
        rays.reserve((width * height) as usize * per_pixel);
        // Nested iterators are slow to step through from outside.
        pixels(tile).for_each(|(x, y)| {
            let corner = DVec2::new(f64::from(x), f64::from(y));
            rays.extend(
                self.places
                    .iter()
                    .map(|&place| self.rays.through(corner + place)),
            );
        });
        let mut hits = Vec::new();
        if let Some(found) = self.found {
            let row = self.options.width as usize;
            pixels(tile).for_each(|(x, y)| hits.push(found[y as usize * row + x as usize]));
        } else {
            let ranges = vec![0.0..f64::INFINITY; rays.len()];
            self.accelerator
                .nearest_many(&rays, &ranges, workspace, &mut hits);
        }
        stats.trace = started.elapsed();
        stats.primary_rays = rays.len() as u64;
        stats.hits = hits.iter().flatten().count() as u64;
        stats.filled = hits.iter().flatten().filter(|hit| hit.filled).count() as u64;
        let started = Instant::now();
        let mut light = Vec::new();
        if self.options.shading != Shading::None {
            light = self
                .integrator
                .radiances(&rays, &hits, workspace, &mut stats.secondary_rays);
        }
        pixels(tile).enumerate().for_each(|(k, (x, y))| {
            let part = k * per_pixel..(k + 1) * per_pixel;
            let (color, data) =
                self.develop(&hits[part.clone()], light.get(part).unwrap_or_default());
            tile.set(x, y, color, data);
        });
        stats.shade = started.elapsed();
        stats.cells_examined = workspace.cells_examined() - cells_before;
        stats
    }

    /// Colour and data of a pixel from the hits of its rays and the light along them.
    fn develop(&self, hits: &[Option<Hit>], light: &[Radiance]) -> Pixel {
        let mut sum = Radiance::default();
        let samples = samples(self.options).pow(2);
        for radiance in light.iter().take(samples as usize) {
            sum.color += radiance.color;
            sum.coverage += radiance.coverage;
        }
        let mean = f64::from(samples).recip();
        let color = (sum.color * mean)
            .extend(sum.coverage * mean)
            .as_vec4()
            .to_array();
        let data = match hits.last() {
            Some(Some(hit)) if self.options.data => pixel_data(self.camera, hit),
            _ => PixelData::MISS,
        };
        (color, data)
    }
}

#[expect(clippy::cast_possible_truncation, reason = "film is single precision")]
#[expect(
    clippy::cast_precision_loss,
    reason = "ids above 2^24 are beyond a film's channel"
)]
fn pixel_data(camera: &Camera, hit: &Hit) -> PixelData {
    let single = |v: DVec3| v.as_vec3().to_array();
    PixelData {
        depth: (hit.point - camera.eye()).dot(camera.forward()) as f32,
        normal: single(hit.normal),
        position: single(hit.point),
        uv: hit.uv.as_vec2().to_array(),
        shape: hit.shape as f32,
        ..PixelData::MISS
    }
}

/// Puts the colours of a sky behind everything, as the camera sees them in the middle of each
/// pixel.
#[must_use]
pub fn over_sky(film: Film, camera: &Camera, sky: &Sky) -> Film {
    let size = DVec2::new(f64::from(film.width()), f64::from(film.height()));
    let rays = FilmRays::new(camera, size);
    film.over_each(|x, y| {
        let place = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
        sky.color(rays.through(place).direction)
    })
}

/// Rays through places on a film.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilmRays {
    pub(crate) lens: Lens,
    size: DVec2,
}

impl FilmRays {
    /// Through a film of the given size in pixels.
    pub(crate) fn new(camera: &Camera, size: DVec2) -> Self {
        let lens = camera.lens(size.x / size.y);
        Self { lens, size }
    }

    /// The ray through a place in pixels from the upper left.
    #[inline]
    pub(crate) fn through(&self, place: DVec2) -> Ray {
        let film = place / self.size * 2.0 - 1.0;
        self.lens.ray(DVec2::new(film.x, -film.y))
    }
}

/// Where points of the world are on a film, in pixels, and how far along the view.
pub(crate) struct Eye<'a> {
    camera: &'a Camera,
    size: DVec2,
    lens: Lens,
}

impl<'a> Eye<'a> {
    pub(crate) fn new(camera: &'a Camera, width: usize, height: usize) -> Self {
        let size = DVec2::new(width as f64, height as f64);
        Self {
            camera,
            size,
            lens: camera.lens(size.x / size.y),
        }
    }

    /// Whether all rays have one direction.
    pub(crate) fn is_parallel(&self) -> bool {
        self.lens.is_parallel
    }

    /// How large a pixel is in the world at a depth.
    pub(crate) fn pixel(&self, depth: f64) -> f64 {
        let scale = if self.lens.is_parallel { 1.0 } else { depth };
        2.0 * self.lens.half.y * scale / self.size.y
    }

    /// The place on the film and the depth; without meaning if that is not positive.
    pub(crate) fn project(&self, point: DVec3) -> (DVec2, f64) {
        let way = point - self.camera.eye();
        let depth = way.dot(self.camera.forward());
        let across = DVec2::new(way.dot(self.camera.right()), -way.dot(self.camera.up()));
        let scale = if self.lens.is_parallel { 1.0 } else { depth };
        (
            (across / (self.lens.half * scale) + 1.0) * 0.5 * self.size,
            depth,
        )
    }
}

#[cfg(test)]
mod tests {
    use kernel::Projection;

    use super::*;

    #[test]
    fn points_are_drawn_where_rays_pass() {
        let view = Projection::Perspective { vertical_fov: 0.8 };
        let parallel = Projection::Orthographic { extent: 3.0 };
        for projection in [view, parallel] {
            let eye = DVec3::new(3.0, 2.0, 5.0);
            let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, projection).unwrap();
            let (width, height) = (64, 48);
            let seen = Eye::new(&camera, width, height);
            for place in [DVec2::new(0.3, -0.7), DVec2::new(-0.9, 0.2)] {
                let ray = camera.ray(place, width as f64 / height as f64);
                let (pixel, depth) = seen.project(ray.at(2.5));
                let expected = (DVec2::new(place.x, -place.y) + 1.0) * DVec2::new(32.0, 24.0);
                assert!((pixel - expected).length() < 1e-9 && (depth - 2.5).abs() < 1e-12);
            }
        }
    }
}
