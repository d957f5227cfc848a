//! A method with its variants: from a name on the command line to what it finds.

use std::fmt;
use std::ops::Range;
use std::time::Duration;

use glam::DVec3;
use kernel::{Camera, Scene};

use super::world::{View, World};
use super::{
    Counts, Found, Job, Picture, Stopwatch, Times, Trace, VARIANTS, Variant, Weights, map,
};
use crate::accelerator::{Accelerator, Workspace};
use crate::film::{Film, blocks};
use crate::integrator::LEAVE;
use crate::intersect::{Hit, METHODS, Method};
use crate::render::{RenderOptions, RenderStats, render, render_found};

/// Side of a block of pixels whose rays the production method traces together.
const BLOCK: u32 = 8;

/// Placed surfaces that the research methods take, at most: each has a net of its own.
const MOST_SURFACES: u64 = 1 << 20;

/// A method and its variants, as in `newton-map+map8`.
#[derive(Clone, Debug)]
pub struct Choice {
    /// The method.
    pub method: &'static Method,
    /// Departures from its defaults.
    pub variants: Vec<Variant>,
}

/// Why a method cannot trace a scene, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal(String);

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Refusal {}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.method.name)?;
        for variant in &self.variants {
            let (_, name, _) = VARIANTS[*variant as usize];
            write!(f, "+{name}")?;
        }
        Ok(())
    }
}

impl Choice {
    /// Finds a method by its name, followed by `+` and the name of each variant.
    ///
    /// # Errors
    /// If there is no such method, or it has no such variant.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut parts = text.split('+');
        let name = parts.next().unwrap_or_default();
        let method = METHODS.iter().find(|m| m.name == name).ok_or_else(|| {
            let known: Vec<_> = METHODS.iter().map(|m| m.name).collect();
            format!("no method '{name}'; there are: {}", known.join(", "))
        })?;
        let variant = |name: &str| {
            let known = method.variants.iter().map(|&v| VARIANTS[v as usize]);
            let found = known.clone().find(|(_, known, _)| *known == name);
            found.map(|(variant, ..)| variant).ok_or_else(|| {
                let names: Vec<_> = known.map(|(_, name, _)| name).collect();
                let names = match names.as_slice() {
                    [] => "none".to_owned(),
                    names => names.join(", "),
                };
                format!("{} has no variant '{name}'; it has: {names}", method.name)
            })
        };
        let variants = parts.map(variant).collect::<Result<_, _>>()?;
        Ok(Self { method, variants })
    }

    /// Whether the method works on the whole picture rather than ray by ray.
    pub fn is_research(&self) -> bool {
        self.method.picture.is_some()
    }

    /// Whether pictures have one ray through the middle of each pixel, whatever is asked for.
    pub fn has_one_ray_per_pixel(&self) -> bool {
        self.is_research() || self.has(Variant::Single)
    }

    fn has(&self, variant: Variant) -> bool {
        self.variants.contains(&variant)
    }

    /// Why the method cannot trace a scene by its own definition, if it cannot.
    ///
    /// # Errors
    /// That is the error.
    pub fn check(&self, scene: &Scene) -> Result<(), Refusal> {
        let Some(picture) = &self.method.picture else {
            return Ok(());
        };
        if scene.placement_count() > MOST_SURFACES {
            let count = scene.placement_count();
            return Err(Refusal(format!(
                "{self} keeps every surface at every place, {MOST_SURFACES} at most; \
                 there are {count}"
            )));
        }
        let world = World::of(scene);
        let is_rational = |sheet: &&super::world::Sheet| sheet.surface.is_rational();
        let rational = world.sheets.iter().filter(is_rational).count();
        if picture.weights == Weights::One && rational > 0 {
            return Err(Refusal(format!(
                "{self} is defined for polynomial surfaces; {rational} of {} are rational",
                world.sheets.len()
            )));
        }
        if picture.map && self.has(Variant::Map8) && !self.has(Variant::Tree) {
            check_map8(&world)?;
        }
        Ok(())
    }

    /// What else the method does not do, in words.
    pub fn remarks(&self, scene: &Scene) -> Vec<String> {
        let mut remarks = Vec::new();
        let Some(picture) = &self.method.picture else {
            if self.has(Variant::Single) {
                remarks.push(format!(
                    "{self}: one ray in the middle of each pixel; shadows and what is seen through \
                     surfaces are traced in packets"
                ));
            }
            return remarks;
        };
        let production = METHODS[0].name;
        let start = if picture.map && !self.has(Variant::Tree) {
            "its map knows the rays of the camera only"
        } else {
            "it is made for the rays of the camera"
        };
        remarks.push(format!(
            "{self}: {start}, one in the middle of each pixel; shadows and what is seen through \
             surfaces are left to {production}"
        ));
        let meshes = scene.placements().iter().filter(|p| is_mesh(p)).count();
        if meshes > 0 {
            remarks.push(format!(
                "{self}: {meshes} meshes are not seen, it knows surfaces only"
            ));
        }
        remarks
    }

    /// What the rays through the middles of all pixels meet first. The accelerator is that of
    /// the same scene; the production method uses it as it is, others do not.
    ///
    /// # Errors
    /// If the method cannot trace the scene by its own definition.
    pub fn trace(
        &self,
        accelerator: &Accelerator<'_>,
        camera: &Camera,
        size: (u32, u32),
    ) -> Result<Trace, Refusal> {
        self.check(accelerator.scene())?;
        let view = View::new(camera, size);
        Ok(match &self.method.picture {
            None if self.has(Variant::Single) => one_by_one(accelerator, &view),
            None => in_packets(accelerator, &view),
            Some(picture) => self.on_picture(picture, accelerator.scene(), &view),
        })
    }

    /// Traces a picture and shades it, with one ray for each pixel.
    ///
    /// # Errors
    /// If the method cannot trace the scene by its own definition.
    pub fn render(
        &self,
        accelerator: &Accelerator<'_>,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<(Film, RenderStats), Refusal> {
        let options = RenderOptions {
            samples: 1,
            ..*options
        };
        if !self.has_one_ray_per_pixel() {
            return Ok(render(accelerator, camera, &options, &|_| {}));
        }
        let size = (options.width, options.height);
        let (hits, cells, took) = if self.is_research() {
            let trace = self.trace(accelerator, camera, size)?;
            (
                hits(accelerator, camera, size, &trace),
                0,
                trace.times.trace,
            )
        } else {
            let started = Stopwatch::start();
            let (view, mut workspace) = (View::new(camera, size), Workspace::default());
            let singly = singly(accelerator, &view, &mut workspace);
            let hits = singly.map(|(hit, _)| hit).collect();
            (hits, workspace.cells_examined(), started.elapsed())
        };
        let (film, mut stats) = render_found(accelerator, camera, &options, &hits);
        stats.trace = took;
        stats.cells_examined += cells;
        Ok((film, stats))
    }

    fn on_picture(&self, picture: &Picture, scene: &Scene, view: &View) -> Trace {
        let started = Stopwatch::start();
        let world = World::of(scene);
        let gathered = started.elapsed();
        let mut trace = (picture.trace)(&Job {
            world: &world,
            view,
            variants: &self.variants,
        });
        trace.times.build += gathered;
        trace
    }
}

fn is_mesh(placement: &kernel::Placement) -> bool {
    matches!(placement.shape, kernel::Shape::Mesh(_))
}

/// Refuses more surfaces than the map of the originals tells apart.
pub(super) fn check_map8(world: &World) -> Result<(), Refusal> {
    let (count, most) = (world.sheets.len(), map::MOST_SURFACES);
    if count > most {
        return Err(Refusal(format!(
            "the 8-bit map tells {most} surfaces apart; there are {count}"
        )));
    }
    Ok(())
}

/// What a research method found, as the integrator wants it.
pub(super) fn hits(
    accelerator: &Accelerator<'_>,
    camera: &Camera,
    size: (u32, u32),
    trace: &Trace,
) -> Vec<Option<Hit>> {
    let (world, view) = (World::of(accelerator.scene()), View::new(camera, size));
    let places = accelerator.places();
    let hit = |found: &Found| {
        let sheet = world.sheet(found.shape);
        let point = sheet.surface.evaluate(found.uv);
        Hit {
            t: found.t,
            uv: found.uv,
            point,
            normal: sheet.surface.normal(found.uv).unwrap_or(DVec3::ZERO),
            shape: found.shape,
            tangential: false,
            filled: false,
            // Shadows start off the surface by twice what a method may be wrong.
            error: 2.0 * view.accuracy(found.t) / LEAVE,
            place: places[found.shape as usize],
            triangle: 0,
        }
    };
    trace.found.iter().map(|f| f.as_ref().map(hit)).collect()
}

fn found(hit: &Hit) -> Found {
    Found {
        t: hit.t,
        uv: hit.uv,
        shape: hit.shape,
    }
}

/// The production method as it renders: in packets of neighbouring pixels.
fn in_packets(accelerator: &Accelerator<'_>, view: &View) -> Trace {
    let started = Stopwatch::start();
    let count = view.width as usize * view.height as usize;
    let mut answers = vec![None; count];
    let (mut workspace, mut hits) = (Workspace::default(), Vec::new());
    let everywhere: Vec<Range<f64>> = vec![0.0..f64::INFINITY; (BLOCK * BLOCK) as usize];
    let (mut pixels, mut rays) = (Vec::new(), Vec::new());
    for (y, x) in blocks(&(0..view.height), &(0..view.width), BLOCK) {
        pixels.clear();
        for (y, x) in blocks(&y, &x, BLOCK / 2) {
            for y in y {
                pixels.extend(x.clone().map(|x| (x, y)));
            }
        }
        rays.clear();
        rays.extend(pixels.iter().map(|&(x, y)| view.ray(x, y)));
        accelerator.nearest_many(&rays, &everywhere[..rays.len()], &mut workspace, &mut hits);
        for (&(x, y), hit) in pixels.iter().zip(&hits) {
            answers[(y * view.width + x) as usize] = hit.as_ref().map(found);
        }
    }
    Trace {
        found: answers,
        effort: vec![0; count],
        counts: Counts {
            iterations: workspace.cells_examined(),
            ..Counts::default()
        },
        times: traced(started.elapsed()),
    }
}

/// What the production method finds ray by ray, and how many cells it examined for that.
fn singly(
    accelerator: &Accelerator<'_>,
    view: &View,
    workspace: &mut Workspace,
) -> impl Iterator<Item = (Option<Hit>, u64)> {
    let pixels = (0..view.height).flat_map(|y| (0..view.width).map(move |x| (x, y)));
    pixels.map(move |(x, y)| {
        let before = workspace.cells_examined();
        let hit = accelerator.nearest(&view.ray(x, y), 0.0..f64::INFINITY, workspace);
        (hit, workspace.cells_examined() - before)
    })
}

/// The production method ray by ray; the effort is the number of cells examined.
fn one_by_one(accelerator: &Accelerator<'_>, view: &View) -> Trace {
    let started = Stopwatch::start();
    let mut workspace = Workspace::default();
    let answer = |(hit, cells): (Option<Hit>, u64)| {
        let effort = u32::try_from(cells).unwrap_or(u32::MAX);
        (hit.as_ref().map(found), effort)
    };
    let (found, effort) = singly(accelerator, view, &mut workspace)
        .map(answer)
        .unzip();
    Trace {
        found,
        effort,
        counts: Counts {
            iterations: workspace.cells_examined(),
            ..Counts::default()
        },
        times: traced(started.elapsed()),
    }
}

fn traced(trace: Duration) -> Times {
    Times {
        trace,
        ..Times::default()
    }
}
