//! The research methods: what the rays of a camera meet first, found as the literature finds it.
//!
//! The production method finds all roots of a ray in a cell; most methods of the literature
//! work on the whole picture. A preliminary map says which surface is seen in each pixel and
//! about where, or boxes say where to begin; a local iteration goes on from there. So each is
//! one file here with a type that implements `Tracer`, and a row in
//! [`METHODS`](crate::METHODS) that holds its `Picture`.
//!
//! The set-up is the same for all: the scene's Bézier pieces in the world (`world`), one
//! evaluator, double precision, the same tolerance of a hundredth of a pixel. Only where they
//! start and how they go on differ. Equation numbers are those of A. Sisojevs, *Methods and
//! algorithms of free-form surface visualisation by ray tracing* (summary of the thesis, Riga
//! 2011); docs/methods.md tells what was corrected.

mod boxes;
mod choice;
mod clip;
mod descent_map;
mod efremov;
mod flatten;
mod gradient_map;
mod gradient_mc;
mod judge;
mod map;
mod martin;
mod minimise;
mod newton_map;
mod nishita;
mod raster;
mod start;
mod stopwatch;
#[cfg(test)]
mod tests;
mod wang;
mod world;

use std::ops::AddAssign;
use std::time::Duration;

use glam::DVec2;
use kernel::{Camera, Ray};
use rayon::prelude::*;

pub use choice::{Choice, Refusal};
pub use judge::{Judgement, Truth, Verdict};
pub use raster::Raster;
pub use stopwatch::Stopwatch;
use world::{View, World};

pub(crate) use descent_map::PICTURE as DESCENT_MAP;
pub(crate) use efremov::PICTURE as EFREMOV;
pub(crate) use gradient_map::PICTURE as GRADIENT_MAP;
pub(crate) use gradient_mc::PICTURE as GRADIENT_MC;
pub(crate) use martin::PICTURE as MARTIN;
pub(crate) use newton_map::PICTURE as NEWTON_MAP;
pub(crate) use nishita::PICTURE as NISHITA;
pub(crate) use wang::PICTURE as WANG;

/// How near to its ray a point must be, in widths of a pixel there.
const ACCURACY: f64 = 0.01;

/// The residual of the seeds, a squared length whatever the unit of the scene.
const LITERAL_RESIDUAL: f64 = 0.001;

/// What a ray met: the ray's parameter, those of the surface, and the number of the patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// The ray parameter, in lengths of the ray's direction.
    pub t: f64,
    /// Parameters of the point, in the patch's own domain.
    pub uv: DVec2,
    /// Number of the patch as in [`crate::Hit::shape`].
    pub shape: u32,
}

/// A departure from a method's defaults.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// Rays one by one instead of in packets.
    Single,
    /// The preliminary map in eight bits per colour.
    Map8,
    /// Starts from our boxes instead of the map or the method's own boxes.
    Tree,
    /// The other equations of the same roots, without division.
    Homogeneous,
    /// As printed, where the print is ambiguous or wrong.
    SeedLiteral,
}

/// Names of the variants on the command line, and a sentence for each.
pub const VARIANTS: &[(Variant, &str, &str)] = &[
    (Variant::Single, "single", "rays one by one, not in packets"),
    (
        Variant::Map8,
        "map8",
        "the preliminary map of the originals: 8 bits per colour, one surface per pixel",
    ),
    (
        Variant::Tree,
        "tree",
        "starts from boxes over flattened surfaces, built by surface area",
    ),
    (
        Variant::Homogeneous,
        "homogeneous",
        "x - x_R w = 0, y - y_R w = 0 instead of equation 10",
    ),
    (
        Variant::SeedLiteral,
        "seed-literal",
        "steps and residual as printed: 0.001 whatever the unit of length",
    ),
];

/// Which weights a method is defined for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weights {
    All,
    /// Polynomial surfaces only.
    One,
}

/// A method that works on the whole picture.
#[derive(Clone, Copy)]
pub(crate) struct Picture {
    pub(crate) weights: Weights,
    /// Whether it starts from a preliminary map.
    pub(crate) map: bool,
    pub(crate) trace: fn(&Job<'_>) -> Trace,
}

/// What a method is to do.
#[derive(Debug)]
pub(crate) struct Job<'a> {
    world: &'a World,
    view: &'a View,
    variants: &'a [Variant],
}

impl Job<'_> {
    fn has(&self, variant: Variant) -> bool {
        self.variants.contains(&variant)
    }
}

/// What it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Evaluations of a surface without derivatives.
    pub values: u64,
    /// Evaluations with both first derivatives.
    pub derivatives: u64,
    /// Steps of iterations.
    pub iterations: u64,
    /// Times that a net was cut, by clipping or in two.
    pub cuts: u64,
    /// Iterations begun, or pieces clipped.
    pub starts: u64,
    /// Iterations that ended with a root.
    pub converged: u64,
    /// Iterations that took too many steps.
    pub capped: u64,
    /// Iterations that came to a stop or left the surface.
    pub stalled: u64,
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.values += other.values;
        self.derivatives += other.derivatives;
        self.iterations += other.iterations;
        self.cuts += other.cuts;
        self.starts += other.starts;
        self.converged += other.converged;
        self.capped += other.capped;
        self.stalled += other.stalled;
    }
}

/// How long it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Times {
    /// Pieces and boxes.
    pub build: Duration,
    /// What depends on the camera: the preliminary map, the projected nets.
    pub map: Duration,
    /// The rays.
    pub trace: Duration,
}

/// What a method found in a picture, top row first.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// What the ray through the middle of each pixel met.
    pub found: Vec<Option<Found>>,
    /// Steps and cuts of each pixel.
    pub effort: Vec<u32>,
    /// Sums over all pixels.
    pub counts: Counts,
    /// How long it took.
    pub times: Times,
}

/// A pixel and the ray through its middle.
#[derive(Clone, Copy, Debug)]
struct Shot {
    x: u32,
    y: u32,
    ray: Ray,
}

/// A method that is ready for the rays of a view.
trait Tracer<'a>: Sized + Sync {
    /// What is kept from pixel to pixel of a row.
    type Row: Default;

    /// Gets ready; what is spent on this very view is added to `map`.
    fn prepare(job: &Job<'a>, map: &mut Duration) -> Self;

    /// What the ray of a pixel meets first; pixels come from left to right.
    fn ray(&self, shot: &Shot, row: &mut Self::Row, counts: &mut Counts) -> Option<Found>;
}

/// Prepares a method and traces all pixels with it, rows on all threads of the current pool.
fn run<'a, T: Tracer<'a>>(job: &Job<'a>) -> Trace {
    let started = Stopwatch::start();
    let mut map = Duration::ZERO;
    let tracer = T::prepare(job, &mut map);
    let build = started.elapsed().saturating_sub(map);
    let started = Stopwatch::start();
    let view = job.view;
    let rows: Vec<_> = (0..view.height)
        .into_par_iter()
        .map(|y| {
            let (mut row, mut sum) = (T::Row::default(), Counts::default());
            let mut pixels = Vec::new();
            for x in 0..view.width {
                let mut counts = Counts::default();
                let shot = Shot {
                    x,
                    y,
                    ray: view.ray(x, y),
                };
                let found = tracer.ray(&shot, &mut row, &mut counts);
                let effort = counts.iterations + counts.cuts;
                pixels.push((found, u32::try_from(effort).unwrap_or(u32::MAX)));
                sum += counts;
            }
            (pixels, sum)
        })
        .collect();
    let trace = started.elapsed();
    let mut counts = Counts::default();
    for (_, sum) in &rows {
        counts += *sum;
    }
    let (found, effort) = rows.into_iter().flat_map(|(pixels, _)| pixels).unzip();
    Trace {
        found,
        effort,
        counts,
        times: Times { build, map, trace },
    }
}

/// The preliminary map of a scene as the originals draw it: red tells the surface, green and
/// blue the parameters.
///
/// # Errors
/// If the scene shows more surfaces than eight bits tell apart.
pub fn map_picture(
    scene: &kernel::Scene,
    camera: &Camera,
    size: (u32, u32),
) -> Result<Raster, Refusal> {
    let world = World::of(scene);
    choice::check_map8(&world)?;
    let map = map::ByteMap::draw(&world, &View::new(camera, size));
    Ok(Raster {
        width: size.0,
        height: size.1,
        pixels: map.pixels,
    })
}
