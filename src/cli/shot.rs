//! One picture: from a scene that was read to what is written and said of it.

use std::io::IsTerminal as _;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use glam::DVec3;
use indicatif::{ProgressBar, ProgressStyle};
use nurbray::kernel::{Aabb, Camera, Projection, Scene, linear_from_srgb};
use nurbray::methods::map_picture;
use nurbray::{
    Accelerator, CertifyStats, Film, RenderOptions, RenderStats, certify_film, draw_curves,
    over_sky, render,
};
use serde_json::{Value, json};

use super::input::{self, Loaded};
use super::parse::Background;
use super::render::Args;
use super::say::{say, visible};

/// The colour behind the scene where neither file nor user names one, as sRGB.
pub(super) const BACKGROUND: DVec3 = DVec3::new(0.93, 0.94, 0.95);

/// The opening angle of a camera of the command line in degrees, unless the user wants another.
const FOV: f64 = 35.0;

/// A picture, and how it was made.
pub(super) struct Shot<'a> {
    pub(super) film: Film,
    loaded: &'a Loaded,
    /// Whether curves and points are drawn, too.
    curves: bool,
    accelerator: Accelerator<'a>,
    stats: RenderStats,
    build: Duration,
    render_time: Duration,
    certified: Option<CertifyStats>,
}

/// Renders the scene of a file that shows something, with data channels or without.
pub(super) fn shot<'a>(
    args: &Args,
    loaded: &'a Loaded,
    file: &Path,
    size: (u32, u32),
    data: bool,
) -> anyhow::Result<Shot<'a>> {
    let scene = &loaded.import.scene;
    let started = Instant::now();
    let accelerator = Accelerator::build(scene, args.method.method).sealed(args.edge_tolerance);
    let build = started.elapsed();
    let aspect = f64::from(size.0) / f64::from(size.1);
    let camera = camera(args, scene, &accelerator, aspect);
    let camera = camera.with_context(|| input::display(file))?;
    let options = RenderOptions {
        width: size.0,
        height: size.1,
        samples: args.samples,
        shading: args.shading.into(),
        // Surfaces hide curves by their depths, and these are held against proofs.
        data: data || args.curves || args.certify,
    };
    let started = Instant::now();
    let has_area = scene.placement_count() > 0;
    let (mut film, stats) = if !has_area {
        (options.film(), RenderStats::default())
    } else if args.method.has_one_ray_per_pixel() {
        for remark in args.method.remarks(scene) {
            say!("nurbray: {}: {remark}", input::display(file));
        }
        let rendered = args.method.render(&accelerator, &camera, &options);
        rendered.with_context(|| input::display(file))?
    } else {
        let bar = progress_bar(&options, file);
        let done = render(&accelerator, &camera, &options, &|pixels| bar.inc(pixels));
        bar.finish_and_clear();
        done
    };
    if let Some(path) = &args.write_map {
        let map = map_picture(scene, &camera, size).with_context(|| input::display(file))?;
        map.write(path)
            .with_context(|| path.display().to_string())?;
    }
    let render_time = started.elapsed();
    if has_area && stats.hits == 0 {
        say!(
            "nurbray: {}: no surface is in the picture",
            input::display(file)
        );
    }
    // Methods that find a place to a share of a pixel are held to a pixel.
    let widths = if args.method.is_research() { 1.0 } else { 0.0 };
    let certified =
        (args.certify && has_area).then(|| certify_film(&mut film, &accelerator, &camera, widths));
    if args.curves {
        film = draw_curves(film, scene, &camera);
    }
    let film = match (args.background, &scene.sky, scene.background) {
        (Some(Background::None), ..) => film,
        (Some(Background::Color(color)), ..) | (None, None, Some(color)) => film.over(color),
        (None, Some(sky), _) => over_sky(film, &camera, sky),
        (None, None, None) => film.over(linear_from_srgb(BACKGROUND)),
    };
    Ok(Shot {
        film,
        loaded,
        curves: args.curves,
        accelerator,
        stats,
        build,
        render_time,
        certified,
    })
}

/// The camera of the command line, or of the file, or one that shows everything.
fn camera(
    args: &Args,
    scene: &Scene,
    accelerator: &Accelerator<'_>,
    aspect: f64,
) -> anyhow::Result<Camera> {
    let wires: Vec<_> = wire_boxes(scene).filter(|_| args.curves).collect();
    let bounds = wires
        .iter()
        .copied()
        .fold(accelerator.bounds(), Aabb::union);
    let camera = if let Some(eye) = args.eye {
        let target = args.target.unwrap_or_else(|| bounds.center());
        let up = args.up.unwrap_or_else(|| scene.up.direction());
        let projection = Projection::Perspective {
            vertical_fov: args.fov.unwrap_or(FOV).to_radians(),
        };
        let camera = Camera::look_at(eye, target, up, projection)
            .context("--eye and --target are the same point, or --up has no length")?;
        if args.ortho {
            camera.into_orthographic(eye.distance(target))
        } else {
            camera
        }
    } else {
        let camera = match &args.camera {
            Some(name) => {
                let by = |of: fn(&Camera) -> &str| scene.cameras.iter().find(|c| of(c) == *name);
                let found = by(|camera| &camera.name).or_else(|| by(|camera| &camera.alias));
                found
                    .with_context(|| format!("no camera '{name}'; there is: {}", cameras(scene)))?
                    .clone()
            }
            None => match scene.cameras.first() {
                Some(camera) => camera.clone(),
                None => {
                    let boxes = [accelerator.outline(), wires].concat();
                    Camera::framing(&boxes, scene.up.direction(), aspect)
                }
            },
        };
        if args.ortho {
            let distance = camera.eye().distance(bounds.center());
            camera.into_orthographic(distance)
        } else {
            camera
        }
    };
    Ok(camera)
}

/// The names of the cameras of a file, and how many there are without.
fn cameras(scene: &Scene) -> String {
    let named = scene
        .cameras
        .iter()
        .filter(|camera| !camera.name.is_empty());
    let mut list: Vec<_> = named.map(names).collect();
    match scene.cameras.len() - list.len() {
        0 if list.is_empty() => list.push("none".to_owned()),
        0 => {}
        1 => list.push("1 camera without a name".to_owned()),
        count => list.push(format!("{count} cameras without names")),
    }
    list.join(", ")
}

/// The name of a camera, and the second one that it may have.
pub(super) fn names(camera: &Camera) -> String {
    match &*camera.alias {
        "" => camera.name.clone(),
        alias => format!("{} ({alias})", camera.name),
    }
}

/// Boxes around all curves and points.
fn wire_boxes(scene: &Scene) -> impl Iterator<Item = Aabb> + '_ {
    let placements = scene.wire_placements().into_iter();
    placements.map(|placement| {
        let bounds = scene.wire(placement.wire).hull_bounds();
        bounds.transformed(&placement.world_from_object)
    })
}

/// A bar on a terminal, nothing elsewhere.
fn progress_bar(options: &RenderOptions, file: &Path) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(u64::from(options.width) * u64::from(options.height));
    if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:40}] {percent}% {eta}") {
        bar.set_style(style);
    }
    bar.set_message(visible(&input::display(file)));
    bar
}

impl Shot<'_> {
    pub(super) fn sentence(&self, file: &Path, target: &Path) -> String {
        let warnings = self.loaded.import.warnings.as_slice().len();
        let warned = match warnings {
            0 => String::new(),
            1 => ", 1 kind of warning".to_owned(),
            n => format!(", {n} kinds of warnings"),
        };
        let patches = self.accelerator.patch_count();
        let meshes = self.accelerator.shape_count() - patches;
        let polygonal = if meshes > 0 {
            format!(" and {meshes} meshes")
        } else {
            String::new()
        };
        let wires = match self.loaded.import.scene.wires().len() {
            0 => String::new(),
            count if self.curves => format!(", {count} free curves and points"),
            count => format!(", {count} free curves and points not shown"),
        };
        let certified = self.certified.map_or_else(String::new, |stats| {
            let certain = stats.counts[0] + stats.counts[1];
            format!(
                ", {certain} of {} pixels certified, {} contradicted",
                stats.counts.iter().sum::<u64>(),
                stats.contradictions
            )
        });
        let filled = match self.stats.filled {
            0 => String::new(),
            n => format!(", {n} rays met a gap"),
        };
        format!(
            "{} -> {}: {patches} patches{polygonal}, {:.2} s{wires}{certified}{filled}{warned}",
            input::display(file),
            target.display(),
            (self.loaded.took + self.build + self.render_time).as_secs_f64(),
        )
    }

    pub(super) fn json(&self, file: &Path, target: &Path, write: Duration) -> Value {
        let RenderStats {
            primary_rays,
            secondary_rays,
            hits,
            filled,
            cells_examined,
            trace,
            shade,
        } = self.stats;
        let mut report = json!({
            "file": input::display(file),
            "output": target.display().to_string(),
            "read_s": self.loaded.took.as_secs_f64(),
            "build_s": self.build.as_secs_f64(),
            "trace_s": trace.as_secs_f64(),
            "shade_s": shade.as_secs_f64(),
            "render_s": self.render_time.as_secs_f64(),
            "write_s": write.as_secs_f64(),
            "patches": self.accelerator.patch_count(),
            "meshes": self.accelerator.shape_count() - self.accelerator.patch_count(),
            "cells": self.accelerator.cell_count(),
            "accelerator_bytes": self.accelerator.bytes(),
            "rays": primary_rays + secondary_rays,
            "primary_rays": primary_rays,
            "hits": hits,
            "filled": filled,
            "strips": self.accelerator.strip_count(),
            "cells_examined": cells_examined,
            "instructions": self.accelerator.instructions().name(),
            "threads": rayon::current_num_threads(),
            "warnings": input::warnings_json(&self.loaded.import.warnings),
        });
        if let Some(stats) = self.certified {
            let [misses, hits, tangent, edge, overlap] = stats.counts;
            report["certified_misses"] = misses.into();
            report["certified_hits"] = hits.into();
            report["ambiguous_tangent"] = tangent.into();
            report["ambiguous_edge"] = edge.into();
            report["ambiguous_overlap"] = overlap.into();
            report["contradictions"] = stats.contradictions.into();
            report["certify_s"] = stats.certify.as_secs_f64().into();
        }
        report
    }
}
