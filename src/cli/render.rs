//! `nurbray render`.

use std::fs::File;
use std::io::{BufWriter, IsTerminal as _, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use clap::ValueEnum;
use glam::DVec3;
use indicatif::{ProgressBar, ProgressStyle};
use nurbray::kernel::{Camera, Projection, Scene, linear_from_srgb};
use nurbray::output::{self, Aov, OutputOptions, PngDepth};
use nurbray::{
    Accelerator, CertifyStats, METHODS, Method, RenderOptions, RenderStats, Shading, certify_film,
    over_sky, render,
};
use serde_json::{Value, json};

use super::input::{self, Loaded, ReadArgs};
use super::parse::{self, Background};

/// The colour behind the scene where neither file nor user names one, as sRGB.
const DEFAULT_BACKGROUND: DVec3 = DVec3::new(0.93, 0.94, 0.95);

/// Renders files to PNG or EXR pictures
///
/// Every pixel is the exact surface. Without a camera in the file or on the command line
/// the whole scene is framed from three-quarters above.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Files to render; - reads standard input
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Picture to write, .png or .exr; {stem} stands for the input's name without its ending,
    /// {frame} for the number of the frame in four digits
    #[arg(short, long, value_name = "OUT")]
    output: String,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "960x720", value_parser = parse::size)]
    size: (u32, u32),
    /// N x N samples per pixel; one passes exactly through the middle
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=64))]
    samples: u32,
    /// Camera of the file, by name
    #[arg(long, value_name = "NAME", conflicts_with = "eye")]
    camera: Option<String>,
    /// Where the camera stands; needs --target or looks at the middle of the scene
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = parse::vector)]
    eye: Option<DVec3>,
    /// What the camera looks at
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = parse::vector, requires = "eye")]
    target: Option<DVec3>,
    /// Upward direction in the picture; default: the upward axis of the file
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = parse::vector, requires = "eye")]
    up: Option<DVec3>,
    /// Vertical opening angle in degrees
    #[arg(long, value_name = "DEG", default_value_t = 35.0, value_parser = degrees, requires = "eye")]
    fov: f64,
    /// Parallel rays instead of perspective
    #[arg(long)]
    ortho: bool,
    /// Colour behind the scene: none, #rrggbb, or r,g,b from 0 to 1
    #[arg(long, value_name = "COLOR", value_parser = parse::background)]
    background: Option<Background>,
    /// Moment of an animated scene, in seconds from its start
    #[arg(
        long,
        value_name = "SECONDS",
        allow_hyphen_values = true,
        conflicts_with = "frames"
    )]
    time: Option<f64>,
    /// Frames A to B of an animated scene, B with them; put {frame} into -o
    #[arg(long, value_name = "A..B", value_parser = parse::frames)]
    frames: Option<Range<u32>>,
    /// Frames per second
    #[arg(long, value_name = "N", default_value_t = 24.0, value_parser = rate, requires = "frames")]
    fps: f64,
    /// How surfaces are shaded; none writes the geometry channels only (EXR)
    #[arg(long, value_enum, default_value_t = ShadingArg::Phong)]
    shading: ShadingArg,
    /// Data layers of EXR files: all, none, or a list of depth, normal, position, uv, patch
    #[arg(
        long,
        value_name = "LAYERS",
        default_value = "all",
        value_delimiter = ','
    )]
    aov: Vec<String>,
    /// Bits per channel of PNG files
    #[arg(long, value_name = "8|16", default_value = "8", value_parser = ["8", "16"])]
    bits: String,
    /// Prove what the ray through the middle of every pixel meets first; EXR files get the layer
    /// exact.status: 0 miss, 1 hit, 2 tangent, 3 edge, 4 overlap
    #[arg(long)]
    certify: bool,
    /// Largest gap between neighbouring faces that is closed, in units of the file; 0 closes none.
    /// Default: what the file states, but at least a ten thousandth of the size
    #[arg(long, value_name = "LENGTH", value_parser = parse::length)]
    edge_tolerance: Option<f64>,
    /// How rays are intersected with surfaces
    #[arg(long, value_name = "NAME", default_value = METHODS[0].name, value_parser = method)]
    method: &'static Method,
    /// Threads; 0 uses every core
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Write times and counts as JSON, one line per picture, to a file or - for standard output
    #[arg(long, value_name = "FILE|-")]
    stats: Option<PathBuf>,
    #[command(flatten)]
    read: ReadArgs,
}

const EXAMPLES: &str = "\
Examples:
  nurbray render samples/teapot.obj -o teapot.png
  nurbray render wing.igs -o wing.exr --eye 3,-4,2 --target 0,0,0 --up 0,0,1 --fov 30
  nurbray render parts/*.igs -o 'out/{stem}.png' --stats stats.jsonl
  nurbray render robot.x3dv -o 'out/{frame}.png' --frames 0..47";

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ShadingArg {
    Phong,
    Blinn,
    None,
}

impl From<ShadingArg> for Shading {
    fn from(arg: ShadingArg) -> Self {
        match arg {
            ShadingArg::Phong => Self::Phong,
            ShadingArg::Blinn => Self::Blinn,
            ShadingArg::None => Self::None,
        }
    }
}

fn method(name: &str) -> Result<&'static Method, String> {
    METHODS.iter().find(|m| m.name == name).ok_or_else(|| {
        let known: Vec<_> = METHODS
            .iter()
            .map(|m| format!("{} ({})", m.name, m.summary))
            .collect();
        format!("no such method; there are: {}", known.join(", "))
    })
}

fn degrees(text: &str) -> Result<f64, String> {
    let angle = text.parse().ok().filter(|a: &f64| *a > 0.0 && *a < 180.0);
    angle.ok_or_else(|| format!("'{text}' is not an angle between 0 and 180 degrees"))
}

fn rate(text: &str) -> Result<f64, String> {
    let rate = text
        .parse()
        .ok()
        .filter(|n: &f64| *n > 0.0 && n.is_finite());
    rate.ok_or_else(|| format!("'{text}' is not a positive number"))
}

/// Renders every file; the result is how many failed.
pub(super) fn run(args: &Args) -> anyhow::Result<usize> {
    let targets = targets(args)?;
    let output = output_options(args, &targets)?;
    let mut stats = Stats::new(args.stats.as_deref());
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads)
        .build()?;
    let mut failed = 0;
    for (file, target) in args.files.iter().zip(&targets) {
        let done = pool.install(|| render_file(args, file, target, &output, &mut stats));
        if let Err(error) = done {
            failed += 1;
            eprintln!("nurbray: {error:#}");
            stats.add(&json!({ "file": input::display(file), "error": format!("{error:#}") }))?;
        }
    }
    stats.finish()?;
    Ok(failed)
}

/// The picture of each file; no two may be the same.
fn targets(args: &Args) -> anyhow::Result<Vec<PathBuf>> {
    let target = |file: &PathBuf| PathBuf::from(args.output.replace("{stem}", &input::stem(file)));
    let targets: Vec<_> = args.files.iter().map(target).collect();
    let pairs = args.files.iter().map(PathBuf::as_path);
    input::check_distinct(pairs.zip(targets.iter().map(PathBuf::as_path)))?;
    for target in &targets {
        if output::picture_format(target).is_none() {
            bail!(
                "{}: the ending tells the format; use .png or .exr",
                target.display()
            );
        }
    }
    if args.frames.is_some() != args.output.contains("{frame}") {
        bail!("--frames A..B and {{frame}} in -o need each other");
    }
    Ok(targets)
}

fn output_options(args: &Args, targets: &[PathBuf]) -> anyhow::Result<OutputOptions> {
    let mut aovs: Vec<Aov> = match args.aov.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["all"] => output::AOVS.to_vec(),
        ["none"] => Vec::new(),
        ref names => names
            .iter()
            .map(|&name| {
                let known = || {
                    output::AOVS
                        .iter()
                        .map(|a| a.name)
                        .collect::<Vec<_>>()
                        .join(", ")
                };
                let aov = output::AOVS.iter().find(|aov| aov.name == name);
                aov.copied()
                    .with_context(|| format!("no layer '{name}'; there are: {}", known()))
            })
            .collect::<Result<_, _>>()?,
    };
    if args.certify {
        aovs.push(output::STATUS);
    }
    let beauty = !matches!(args.shading, ShadingArg::None);
    let holds_data =
        |target: &PathBuf| output::picture_format(target).is_some_and(|f| f.holds_data);
    if !beauty && (aovs.is_empty() || !targets.iter().all(holds_data)) {
        bail!("--shading none leaves the data layers only; write them to an .exr file");
    }
    let png_depth = if args.bits == "16" {
        PngDepth::Sixteen
    } else {
        PngDepth::Eight
    };
    Ok(OutputOptions {
        png_depth,
        beauty,
        aovs,
    })
}

/// Renders a file, or each frame of it.
fn render_file(
    args: &Args,
    file: &Path,
    target: &Path,
    output: &OutputOptions,
    stats: &mut Stats<'_>,
) -> anyhow::Result<()> {
    let mut loaded = args.read.load(file)?;
    input::report_warnings(file, loaded.import.format, &loaded.import.warnings);
    let frames = args
        .frames
        .clone()
        .map_or(vec![None], |range| range.map(Some).collect());
    for frame in frames {
        let seconds = frame.map(|frame| f64::from(frame) / args.fps).or(args.time);
        if let (Some(seconds), Some(animation)) = (seconds, &loaded.import.animation) {
            let scene = animation.scene_at(seconds);
            loaded.import.scene = scene.with_context(|| input::display(file))?;
        }
        let name = frame.map_or_else(String::new, |frame| format!("{frame:04}"));
        let target = target.to_string_lossy().replace("{frame}", &name);
        let mut report = render_scene(args, &loaded, file, target.as_ref(), output)?;
        if let Some(seconds) = seconds {
            report["time"] = seconds.into();
        }
        stats.add(&report)?;
    }
    Ok(())
}

/// Renders the scene of a file as it is now.
fn render_scene(
    args: &Args,
    loaded: &Loaded,
    file: &Path,
    target: &Path,
    output: &OutputOptions,
) -> anyhow::Result<Value> {
    let scene = &loaded.import.scene;
    if scene.placement_count() == 0 {
        let import = &loaded.import;
        let place = import.warnings.as_slice().first().map_or_else(
            || "the file: nothing that can be shown".to_owned(),
            ToString::to_string,
        );
        bail!(
            "{}: there is no surface to render; {} {place}",
            input::display(file),
            import.format
        );
    }
    let started = Instant::now();
    let accelerator = Accelerator::build(scene, args.method).sealed(args.edge_tolerance);
    let build = started.elapsed();
    let camera = camera(args, scene, &accelerator).with_context(|| input::display(file))?;
    let holds_data = output::picture_format(target).is_some_and(|f| f.holds_data);
    let options = RenderOptions {
        width: args.size.0,
        height: args.size.1,
        samples: args.samples,
        shading: args.shading.into(),
        data: holds_data && !output.aovs.is_empty(),
    };
    let started = Instant::now();
    let bar = progress_bar(&options, file);
    let (mut film, stats) = render(&accelerator, &camera, &options, &|pixels| bar.inc(pixels));
    bar.finish_and_clear();
    let render_time = started.elapsed();
    let certified = args
        .certify
        .then(|| certify_film(&mut film, &accelerator, &camera));
    let film = match (args.background, &scene.sky, scene.background) {
        (Some(Background::None), ..) => film,
        (Some(Background::Color(color)), ..) | (None, None, Some(color)) => film.over(color),
        (None, Some(sky), _) => over_sky(film, &camera, sky),
        (None, None, None) => film.over(linear_from_srgb(DEFAULT_BACKGROUND)),
    };
    let started = Instant::now();
    if let Some(folder) = target.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    output::write(&film, target, output).with_context(|| target.display().to_string())?;
    let report = Report {
        loaded,
        accelerator: &accelerator,
        stats,
        build,
        render_time,
        certified,
    };
    eprintln!("{}", report.sentence(file, target));
    Ok(report.json(file, target, started.elapsed()))
}

/// The camera of the command line, or of the file, or one that shows everything.
fn camera(args: &Args, scene: &Scene, accelerator: &Accelerator<'_>) -> anyhow::Result<Camera> {
    let bounds = accelerator.bounds();
    let camera = if let Some(eye) = args.eye {
        let target = args.target.unwrap_or_else(|| bounds.center());
        let up = args.up.unwrap_or_else(|| scene.up.direction());
        let projection = Projection::Perspective {
            vertical_fov: args.fov.to_radians(),
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
                let known = || {
                    let names: Vec<_> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
                    if names.is_empty() {
                        "none".to_owned()
                    } else {
                        names.join(", ")
                    }
                };
                let found = scene.cameras.iter().find(|camera| camera.name == *name);
                found
                    .with_context(|| format!("no camera '{name}'; there is: {}", known()))?
                    .clone()
            }
            None => match scene.cameras.first() {
                Some(camera) => camera.clone(),
                None => {
                    let aspect = f64::from(args.size.0) / f64::from(args.size.1);
                    Camera::framing(&accelerator.outline(), scene.up.direction(), aspect)
                }
            },
        };
        let distance = camera.eye().distance(bounds.center());
        if args.ortho {
            camera.into_orthographic(distance)
        } else {
            camera
        }
    };
    Ok(camera)
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
    bar.set_message(input::display(file));
    bar
}

/// What there is to say about a finished picture.
struct Report<'a> {
    loaded: &'a Loaded,
    accelerator: &'a Accelerator<'a>,
    stats: RenderStats,
    build: Duration,
    render_time: Duration,
    certified: Option<CertifyStats>,
}

impl Report<'_> {
    fn sentence(&self, file: &Path, target: &Path) -> String {
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
            "{} -> {}: {patches} patches{polygonal}, {:.2} s{certified}{filled}{warned}",
            input::display(file),
            target.display(),
            (self.loaded.took + self.build + self.render_time).as_secs_f64(),
        )
    }

    fn json(&self, file: &Path, target: &Path, write: Duration) -> Value {
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

/// Where `--stats` goes: collected and written at the end, so that no half-written file is
/// left.
struct Stats<'a> {
    target: Option<&'a Path>,
    lines: String,
}

impl<'a> Stats<'a> {
    fn new(target: Option<&'a Path>) -> Self {
        Self {
            target,
            lines: String::new(),
        }
    }

    fn add(&mut self, report: &Value) -> anyhow::Result<()> {
        match self.target {
            Some(target) if target == Path::new("-") => {
                writeln!(std::io::stdout().lock(), "{report}")?;
            }
            Some(_) => self.lines += &format!("{report}\n"),
            None => {}
        }
        Ok(())
    }

    fn finish(self) -> anyhow::Result<()> {
        match self.target {
            Some(target) if target != Path::new("-") => {
                let fill = |file: &mut BufWriter<File>| file.write_all(self.lines.as_bytes());
                output::replace_file(target, fill).with_context(|| target.display().to_string())
            }
            _ => Ok(()),
        }
    }
}
