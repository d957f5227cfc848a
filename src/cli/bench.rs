//! `nurbray bench`.

mod report;

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context as _, bail};
use nurbray::kernel::{Camera, Scene};
use nurbray::methods::{Choice, Counts, Judgement, Raster, Stopwatch, Times, Trace, Truth};
use nurbray::output::{self, OutputOptions};
use nurbray::{Accelerator, RenderOptions};

use super::Failures;
use super::input::{self, ReadArgs};
use super::parse;
use super::say::say;
use super::stop::{self, Stop};

/// Where the scenes are that are measured if none is named.
const SCENES: &str = "samples/methods";

/// The methods that are measured if none is named.
const METHODS: &str = "newton,newton+single,gradient-mc,gradient-map,descent-map,descent-map+tree,\
                       newton-map,newton-map+map8,newton-map+tree,martin,martin+tree,nishita,\
                       efremov,wang";

/// Measures side by side
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    Methods(Box<MethodArgs>),
}

/// Traces pictures with several methods, and tells times, effort and errors of each
///
/// One thread, times of the processor, one ray through the middle of each pixel. What each pixel shows is proven first;
/// answers are wrong if they are off by more than a pixel's width along the ray. Writes
/// results.json, results.csv, and index.html with pictures.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
struct MethodArgs {
    /// Scenes; those of samples/methods if none is named
    files: Vec<PathBuf>,
    /// Folder for results and pictures
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Methods, each with its variants as NAME+VARIANT; the first is what others are compared
    /// with
    #[arg(
        long,
        value_name = "NAMES",
        default_value = METHODS,
        value_delimiter = ',',
        value_parser = Choice::parse,
        long_help = parse::methods()
    )]
    methods: Vec<Choice>,
    /// Size of the pictures in pixels
    #[arg(long, value_name = "WxH", default_value = "512x512", value_parser = parse::size)]
    size: (u32, u32),
    /// How often each method runs; times are medians
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = parse::count(1..=u32::MAX))]
    runs: u32,
    #[command(flatten)]
    read: ReadArgs,
}

const EXAMPLES: &str = "\
Examples:
  nurbray bench methods -o out
  nurbray bench methods samples/teapot.obj --methods newton,martin,nishita --size 256x256 -o out

SIGINT or SIGTERM (Ctrl-C) stops after the picture that is being traced; the reports have the files
that were done before. A second one ends the program at once.";

impl MethodArgs {
    /// With each method once.
    fn without_doubles(&self) -> Self {
        let mut known = HashSet::new();
        let mut args = self.clone();
        args.methods
            .retain(|choice| known.insert(choice.to_string()));
        args
    }
}

/// What a method did with a scene.
struct Row {
    scene: String,
    method: String,
    /// What was measured, or why nothing was.
    outcome: Result<Measured, String>,
}

struct Measured {
    /// Medians.
    times: Times,
    counts: Counts,
    judgement: Judgement,
}

/// Runs the command; what was measured is written after each file.
pub(super) fn run(args: &Args) -> anyhow::Result<Failures> {
    let What::Methods(args) = &args.what;
    let args = &args.without_doubles();
    let files = files(args)?;
    output::make_folder(&args.output).with_context(|| args.output.display().to_string())?;
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let stop = Stop::listen(Some("the picture that is being traced is"))?;
    let (mut rows, mut failed, mut left) = (Vec::new(), 0, 0);
    for (file, scene) in files.iter().zip(names(&files)) {
        match measure_file(args, (file, &scene), &single, &stop) {
            Ok(Some(measured)) => {
                rows.extend(measured);
                report::write(args, &rows)?;
            }
            Ok(None) => left += 1,
            Err(error) => {
                failed += 1;
                say!("nurbray: {error:#}");
            }
        }
    }
    if !rows.is_empty() {
        report::print(args, &rows)?;
    }
    Ok(match left {
        0 => failed.into(),
        left => stop::ending(files.len(), failed, left),
    })
}

/// The files of the command line, or all scenes in [`SCENES`].
fn files(args: &MethodArgs) -> anyhow::Result<Vec<PathBuf>> {
    if !args.files.is_empty() {
        return input::files(&args.files);
    }
    let entries = std::fs::read_dir(SCENES).with_context(|| {
        format!("{SCENES}: run this where nurbray's samples are, or name files")
    })?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending != "mtl") {
            files.push(path);
        }
    }
    if files.is_empty() {
        bail!("{SCENES}: there is no scene");
    }
    files.sort();
    Ok(files)
}

/// A name for each file, by which its rows and pictures are called: its stem, and from the second of
/// the same on a number.
fn names(files: &[PathBuf]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for file in files {
        let stem = input::stem(file).to_string_lossy().into_owned();
        let numbered = (2..).map(|number| format!("{stem}-{number}"));
        let mut choice = std::iter::once(stem.clone()).chain(numbered);
        names.extend(choice.find(|name| !names.contains(name)));
    }
    names
}

/// What was measured of a file, unless the program is told to stop before.
fn measure_file(
    args: &MethodArgs,
    (file, name): (&Path, &str),
    single: &rayon::ThreadPool,
    stop: &Stop,
) -> anyhow::Result<Option<Vec<Row>>> {
    let Some(loaded) = stop.or_load(&args.read, file) else {
        return Ok(None);
    };
    let loaded = loaded?;
    input::report_warnings(file, loaded.import.format, &loaded.import.warnings);
    let scene = &loaded.import.scene;
    if scene.placement_count() == 0 {
        bail!("{}: there is no surface to trace", input::display(file));
    }
    let production = args.methods.iter().find(|choice| !choice.is_research());
    let method = production.unwrap_or(&args.methods[0]).method;
    let accelerator = Accelerator::build(scene, method);
    let camera = camera(scene, &accelerator, args.size);
    let truth = Truth::prove(scene, &camera, args.size);
    let mut rows = Vec::new();
    let mut running = Vec::new();
    for choice in &args.methods {
        match choice.check(scene) {
            Ok(()) => running.push((choice, Vec::new(), None)),
            Err(refusal) => {
                say!("nurbray: {}: {refusal}", input::display(file));
                rows.push(Row {
                    scene: name.to_owned(),
                    method: choice.to_string(),
                    outcome: Err(refusal.to_string()),
                });
            }
        }
    }
    // All methods by turns, so that what else the machine does meets all alike.
    for _ in 0..args.runs {
        for (choice, times, last) in &mut running {
            if stop.is_asked() {
                return Ok(None);
            }
            let trace = single.install(|| once(choice, &accelerator, &camera, args.size))?;
            times.push(trace.times);
            *last = Some(trace);
        }
    }
    for (choice, times, last) in running {
        let Some(trace) = last else { continue };
        let judgement = truth.judge(&trace);
        let picture = format!("{name}_{choice}");
        pictures(args, &accelerator, &camera, choice, &picture)?;
        let effort = Raster::of_effort(&trace, args.size);
        let verdicts = Raster::of_verdicts(&judgement, args.size);
        for (raster, kind) in [(effort, "effort"), (verdicts, "verdict")] {
            let path = args.output.join(format!("{picture}_{kind}.png"));
            raster
                .write(&path)
                .with_context(|| path.display().to_string())?;
        }
        rows.push(Row {
            scene: name.to_owned(),
            method: choice.to_string(),
            outcome: Ok(Measured {
                times: median(&times),
                counts: trace.counts,
                judgement,
            }),
        });
    }
    Ok(Some(rows))
}

/// Traces once; the production method builds its accelerator anew.
fn once(
    choice: &Choice,
    accelerator: &Accelerator<'_>,
    camera: &Camera,
    size: (u32, u32),
) -> anyhow::Result<Trace> {
    if choice.is_research() {
        return Ok(choice.trace(accelerator, camera, size)?);
    }
    let started = Stopwatch::start();
    let accelerator = Accelerator::build(accelerator.scene(), choice.method);
    let build = started.elapsed();
    let mut trace = choice.trace(&accelerator, camera, size)?;
    trace.times.build = build;
    Ok(trace)
}

/// The picture of a method, shaded.
fn pictures(
    args: &MethodArgs,
    accelerator: &Accelerator<'_>,
    camera: &Camera,
    choice: &Choice,
    name: &str,
) -> anyhow::Result<()> {
    let options = RenderOptions {
        width: args.size.0,
        height: args.size.1,
        data: false,
        ..RenderOptions::default()
    };
    let (film, _) = choice.render(accelerator, camera, &options)?;
    let path = args.output.join(format!("{name}.png"));
    let film = film.over(glam::DVec3::splat(0.85));
    output::write(&film, &path, &OutputOptions::default())
        .with_context(|| path.display().to_string())
}

fn camera(scene: &Scene, accelerator: &Accelerator<'_>, size: (u32, u32)) -> Camera {
    let aspect = f64::from(size.0) / f64::from(size.1);
    let framing = || Camera::framing(&accelerator.outline(), scene.up.direction(), aspect);
    scene.cameras.first().cloned().unwrap_or_else(framing)
}

fn median(times: &[Times]) -> Times {
    let middle = |part: fn(&Times) -> Duration| {
        let mut all: Vec<_> = times.iter().map(part).collect();
        all.sort_unstable();
        all[all.len() / 2]
    };
    Times {
        build: middle(|t| t.build),
        map: middle(|t| t.map),
        trace: middle(|t| t.trace),
    }
}
