//! `nurbray render`.

use std::collections::HashSet;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, bail};
use clap::ValueEnum;
use glam::DVec3;
use nurbray::kernel::Scene;
use nurbray::methods::Choice;
use nurbray::output::{self, Aov, OutputOptions, PngDepth};
use nurbray::{Film, METHODS, Shading};
use serde_json::{Value, json};

use super::Failures;
use super::batch::Fate;
use super::input::{self, Loaded, ReadArgs};
use super::parse::{self, Background};
use super::say::{self, say};
use super::sheet::{self, Sheet};
use super::shot::shot;
use super::stop::{self, Stop};

/// Pixels of a picture, unless the user wants others.
const SIZE: (u32, u32) = (960, 720);

/// What to do about a name without an ending that is known.
const ENDINGS: &str = "the ending tells the format; use .png or .exr";

/// Renders files to PNG or EXR pictures
///
/// Every pixel is the exact surface. Without a camera in the file or on the command line
/// the whole scene is framed from three-quarters above.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Files to render, and folders to look for files in; - reads standard input
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Picture to write, .png or .exr; {stem} stands for the input's name without its ending,
    /// {ext} for that ending, {frame} for the number of the frame in four digits
    #[arg(short, long, value_name = "OUT", required_unless_present = "sheet")]
    output: Option<String>,
    /// One picture of all files instead: small ones side by side, with their names
    #[arg(long, value_name = "OUT", conflicts_with_all = ["output", "frames", "certify", "stats", "aov", "bits"])]
    sheet: Option<PathBuf>,
    /// Size of the picture in pixels [default: 960x720, with --sheet 240x180]
    #[arg(long, value_name = "WxH", value_parser = parse::size)]
    size: Option<(u32, u32)>,
    /// N x N samples per pixel; data channels come from one more ray through the middle
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = parse::count(1..=64))]
    pub(super) samples: u32,
    /// Camera of the file, by name; of X3D and VRML by its description or DEF name
    #[arg(long, value_name = "NAME", conflicts_with_all = ["eye", "target", "up", "fov"])]
    pub(super) camera: Option<String>,
    /// Where the camera stands; it looks at --target, or else at the middle of the scene
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = parse::vector)]
    pub(super) eye: Option<DVec3>,
    /// What the camera looks at; needs --eye
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = parse::vector, requires = "eye")]
    pub(super) target: Option<DVec3>,
    /// Upward direction in the picture; needs --eye; default: the upward axis of the file
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = parse::vector, requires = "eye")]
    pub(super) up: Option<DVec3>,
    /// Vertical opening angle in degrees; needs --eye [default: 35]
    #[arg(long, value_name = "DEG", value_parser = degrees, requires = "eye")]
    pub(super) fov: Option<f64>,
    /// Parallel rays instead of perspective
    #[arg(long)]
    pub(super) ortho: bool,
    /// Colour behind the scene: none, #rrggbb, or r,g,b from 0 to 1
    #[arg(long, value_name = "COLOR", value_parser = parse::background)]
    pub(super) background: Option<Background>,
    /// Moment of an animated scene, in seconds from its start
    #[arg(
        long,
        value_name = "SECONDS",
        allow_hyphen_values = true,
        value_parser = parse::seconds,
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
    pub(super) shading: ShadingArg,
    /// Data layers of EXR files: all, none, or a list of depth, normal, position, uv, patch
    /// [default: all]
    #[arg(long, value_name = "LAYERS", value_delimiter = ',')]
    aov: Option<Vec<String>>,
    /// Bits per channel of PNG files [default: 8]
    #[arg(long, value_name = "8|16", value_parser = ["8", "16"])]
    bits: Option<String>,
    /// Draw curves and points, too, as tubes and balls a few pixels wide
    #[arg(long)]
    pub(super) curves: bool,
    /// Prove what the ray through the middle of every pixel meets first; EXR files get the layer
    /// exact.status: 0 miss, 1 hit, 2 tangent, 3 edge, 4 overlap
    #[arg(long)]
    pub(super) certify: bool,
    /// Largest gap between neighbouring faces that is closed, in units of the file; 0 closes none.
    /// Default: what the file states, but from a ten thousandth to a thousandth of the size
    #[arg(long, value_name = "LENGTH", value_parser = parse::length)]
    pub(super) edge_tolerance: Option<f64>,
    /// How rays are intersected with surfaces; NAME+VARIANT departs from the method's defaults
    #[arg(
        long,
        value_name = "NAME",
        default_value = METHODS[0].name,
        value_parser = Choice::parse,
        long_help = parse::methods()
    )]
    pub(super) method: Choice,
    /// Write the preliminary map of the methods that start from one: red tells the surface, green
    /// and blue its parameters
    #[arg(long, value_name = "PNG", conflicts_with_all = ["sheet", "frames"])]
    pub(super) write_map: Option<PathBuf>,
    /// Threads; 0 uses every core
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse::threads)]
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
  nurbray render parts -o 'out/{stem}.png' --stats stats.jsonl
  nurbray render robot.x3dv -o 'out/{frame}.png' --frames 0..47
  nurbray render parts --sheet parts.png

SIGINT or SIGTERM (Ctrl-C) begins no more pictures; the exit code is then 3, or 2 if there is none.
A second one, or the first where there is one picture only, ends the program at once.";

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum ShadingArg {
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

fn degrees(text: &str) -> Result<f64, String> {
    let angle: Option<f64> = text.parse().ok();
    let angle = angle.filter(|a| a.to_radians() > 0.0 && *a < 180.0);
    angle.ok_or_else(|| format!("'{text}' is not an angle between 0 and 180 degrees"))
}

fn rate(text: &str) -> Result<f64, String> {
    let rate = text
        .parse()
        .ok()
        .filter(|n: &f64| *n > 0.0 && n.is_finite());
    rate.ok_or_else(|| format!("'{text}' is not a positive number"))
}

/// Renders every file.
pub(super) fn run(args: &Args) -> anyhow::Result<Failures> {
    let files = input::files(&args.files)?;
    let args = &Args {
        files,
        ..args.clone()
    };
    let is_png = |path: &PathBuf| {
        let ending = path.extension().unwrap_or_default();
        ending.eq_ignore_ascii_case("png")
    };
    if let Some(map) = args.write_map.as_ref().filter(|map| !is_png(map)) {
        bail!("{}: maps are written as .png", map.display());
    }
    if args.write_map.is_some() && args.files.len() > 1 {
        bail!("--write-map is for one file; each would write the same map");
    }
    if let Some(target) = &args.sheet {
        return Ok(run_sheet(args, target)?.into());
    }
    let jobs = jobs(args)?;
    let targets: Vec<_> = jobs.iter().map(|job| job.target.clone()).collect();
    let output = output_options(args, &targets)?;
    let once = prepare(args, &targets)?;
    let mut stats = Stats::new(args.stats.as_deref());
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads)
        .build()?;
    let is_one = jobs.len() == 1 && args.frames.is_none();
    let stop = Stop::listen((!is_one).then_some("the picture that is being made is"))?;
    let (mut failed, mut left) = (0, 0);
    for job in &jobs {
        let file = &job.file;
        let done = if stop.is_asked() {
            Ok(Fate::Left)
        } else if let Some(why) = &job.refused {
            Err(anyhow::Error::msg(why.clone()))
        } else if let Some(loaded) = stop.or_load(&args.read, file) {
            let render = |loaded| {
                pool.install(|| render_file(args, loaded, file, &output, (&mut stats, &stop)))
            };
            checked(args, file, loaded, &once)?.and_then(render)
        } else {
            Ok(Fate::Left)
        };
        match done {
            Ok(Fate::Left) => {
                left += 1;
                stats.add(&json!({ "file": input::display(file), "status": Fate::Left.name() }))?;
            }
            Ok(_) => {}
            Err(error) => {
                failed += 1;
                say!("nurbray: {error:#}");
                let (file, error) = (input::display(file), format!("{error:#}"));
                let status = Fate::Failed.name();
                stats.add(&json!({ "file": file, "status": status, "error": error }))?;
            }
        }
    }
    stats.finish()?;
    Ok(match left {
        0 => failed.into(),
        left => stop::ending(jobs.len(), failed, left),
    })
}

/// Renders every file onto one sheet; the result is how many failed.
fn run_sheet(args: &Args, target: &Path) -> anyhow::Result<usize> {
    if output::picture_format(target).is_none() {
        bail!("{}: {ENDINGS}", target.display());
    }
    if matches!(args.shading, ShadingArg::None) {
        bail!("--shading none leaves nothing to be seen on a sheet");
    }
    let once = prepare(args, &[])?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads)
        .build()?;
    // Half a sheet is none.
    Stop::listen(None)?;
    let size = args.size.unwrap_or(sheet::SIZE);
    let mut sheet = Sheet::new(args.files.len(), size)?;
    let mut failed = 0;
    for file in &args.files {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let label = match name.as_ref() {
            "-" => "stdin",
            name => name,
        };
        let picture = checked(args, file, args.read.load(file), &once)?
            .and_then(|loaded| pool.install(|| thumbnail(args, loaded, file, size)));
        match picture {
            Ok(Some(film)) => sheet.add(Ok(&film), label),
            Ok(None) => sheet.add(Err("no surface"), label),
            Err(error) => {
                failed += 1;
                say!("nurbray: {error:#}");
                sheet.add(Err("failed"), label);
            }
        }
    }
    let options = OutputOptions {
        aovs: Vec::new(),
        ..OutputOptions::default()
    };
    let film = sheet.into_film();
    output::write(&film, target, &options).with_context(|| target.display().to_string())?;
    let files = say::counted(args.files.len(), "file", "files");
    let (width, height) = (film.width(), film.height());
    say!("{files} -> {}: {width}x{height}", target.display());
    Ok(failed)
}

/// The picture of a file; nothing if there is no surface in it.
fn thumbnail(
    args: &Args,
    mut loaded: Loaded,
    file: &Path,
    size: (u32, u32),
) -> anyhow::Result<Option<Film>> {
    move_to(&mut loaded, file, args.time)?;
    if shown_count(args, &loaded.import.scene) == 0 {
        return Ok(None);
    }
    Ok(Some(shot(args, &loaded, file, size, false)?.film))
}

/// A file and its picture.
struct Job {
    file: PathBuf,
    target: PathBuf,
    /// Why nothing is written there, where another picture or an input is.
    refused: Option<String>,
}

/// The picture of each file; a file that is given several times has one.
fn jobs(args: &Args) -> anyhow::Result<Vec<Job>> {
    let output = args.output.as_deref().unwrap_or_default();
    input::check_pattern("-o", output, &["stem", "ext", "frame"])?;
    let (mut jobs, mut known) = (Vec::new(), HashSet::new());
    for file in &args.files {
        let target = PathBuf::from(input::named(output, file, "{frame}"));
        if output::picture_format(&target).is_none() {
            bail!("{}: {ENDINGS}", target.display());
        }
        if known.insert(file.canonicalize().unwrap_or_else(|_| file.clone())) {
            jobs.push(Job {
                file: file.clone(),
                target,
                refused: None,
            });
        }
    }
    if args.frames.is_some() != output.contains("{frame}") {
        bail!("--frames A..B and {{frame}} in -o need each other");
    }
    let pairs: Vec<_> = jobs.iter().map(|job| (&*job.file, &*job.target)).collect();
    let clashes = input::clashes(&pairs);
    for (job, clash) in jobs.iter_mut().zip(clashes) {
        let place = job.target.canonicalize();
        let is_input = place.is_ok_and(|place| known.contains(&place));
        job.refused = is_input.then(|| input::over_input(&job.target)).or(clash);
    }
    Ok(jobs)
}

/// The files that are written once, beside the pictures of all files; their folders are made.
///
/// # Errors
/// If something would be written over an input, or twice to one place.
fn prepare(args: &Args, targets: &[PathBuf]) -> anyhow::Result<Vec<PathBuf>> {
    let once = [&args.sheet, &args.write_map, &args.stats];
    let once = once.into_iter().flatten();
    let once: Vec<_> = once.filter(|p| !input::is_stdin(p)).cloned().collect();
    for (name, path) in [
        ("--sheet", &args.sheet),
        ("--write-map", &args.write_map),
        ("--stats", &args.stats),
    ] {
        let path = path.as_deref().unwrap_or(Path::new(""));
        input::check_pattern(name, &path.to_string_lossy(), &[])?;
    }
    input::check_apart(&once, &args.files)?;
    let place =
        |path: &PathBuf| std::path::absolute(path).with_context(|| path.display().to_string());
    let mut places = targets
        .iter()
        .map(place)
        .collect::<Result<HashSet<_>, _>>()?;
    for path in &once {
        if !places.insert(place(path)?) {
            bail!("{}: two outputs would be written there", path.display());
        }
    }
    for path in &once {
        let folder = output::folder(path);
        output::make_folder(folder).with_context(|| folder.display().to_string())?;
    }
    Ok(once)
}

fn output_options(args: &Args, targets: &[PathBuf]) -> anyhow::Result<OutputOptions> {
    let mut names: Vec<&str> = Vec::new();
    for name in args.aov.iter().flatten() {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    let mut aovs: Vec<Aov> = match names[..] {
        [] | ["all"] => output::AOVS.to_vec(),
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
                aov.copied().with_context(|| {
                    format!("no layer '{name}'; there are: all, none, {}", known())
                })
            })
            .collect::<Result<_, _>>()?,
    };
    if args.certify {
        aovs.push(output::STATUS);
    }
    let beauty = !matches!(args.shading, ShadingArg::None);
    let holds_data =
        |target: &PathBuf| output::picture_format(target).is_some_and(|f| f.holds_data);
    for (name, given, idle, wanted) in [
        (
            "--aov",
            args.aov.is_some(),
            !targets.iter().any(holds_data),
            ".exr",
        ),
        (
            "--bits",
            args.bits.is_some(),
            targets.iter().all(holds_data),
            ".png",
        ),
    ] {
        if given && idle {
            say!("nurbray: warning: {name} is for {wanted} files; none is written");
        }
    }
    if !beauty && (aovs.is_empty() || !targets.iter().all(holds_data)) {
        bail!(
            "--shading none leaves the data layers only; choose some with --aov, and write them to an .exr file"
        );
    }
    let png_depth = if args.bits.as_deref() == Some("16") {
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

/// How much of a scene can be seen.
fn shown_count(args: &Args, scene: &Scene) -> u64 {
    let wires = if args.curves {
        scene.wire_placement_count()
    } else {
        0
    };
    scene.placement_count() + wires
}

/// Tells what is wrong with a file that has been read.
///
/// # Errors
/// The inner one is that of the file. The outer one ends everything: what is written once would be
/// written over a file that this one names.
fn checked(
    args: &Args,
    file: &Path,
    loaded: anyhow::Result<Loaded>,
    once: &[PathBuf],
) -> anyhow::Result<anyhow::Result<Loaded>> {
    if let Ok(loaded) = &loaded {
        loaded.check_beside(file, once)?;
        input::report_warnings(file, loaded.import.format, &loaded.import.warnings);
        for (name, given) in [
            ("--time", args.time.is_some()),
            ("--frames", args.frames.is_some()),
        ] {
            if given && loaded.import.animation.is_none() {
                let file = input::display(file);
                say!(
                    "nurbray: {file}: warning: {name} is for what moves; nothing in the file does"
                );
            }
        }
    }
    Ok(loaded)
}

/// Shows an animated scene at a moment.
fn move_to(loaded: &mut Loaded, file: &Path, seconds: Option<f64>) -> anyhow::Result<()> {
    if let (Some(seconds), Some(animation)) = (seconds, &loaded.import.animation) {
        let scene = animation.scene_at(seconds);
        loaded.import.scene = scene.with_context(|| input::display(file))?;
    }
    Ok(())
}

/// Renders a file, or each frame of it until the program is told to stop.
fn render_file(
    args: &Args,
    mut loaded: Loaded,
    file: &Path,
    output: &OutputOptions,
    (stats, stop): (&mut Stats<'_>, &Stop),
) -> anyhow::Result<Fate> {
    let frames = args
        .frames
        .clone()
        .map_or(vec![None], |range| range.map(Some).collect());
    for frame in frames {
        if stop.is_asked() {
            return Ok(Fate::Left);
        }
        let seconds = frame.map(|frame| f64::from(frame) / args.fps).or(args.time);
        move_to(&mut loaded, file, seconds)?;
        let name = frame.map_or_else(String::new, |frame| format!("{frame:04}"));
        let pattern = args.output.as_deref().unwrap_or_default();
        let target = PathBuf::from(input::named(pattern, file, &name));
        loaded.check_beside(file, std::slice::from_ref(&target))?;
        let mut report = render_scene(args, &loaded, file, &target, output)?;
        report["status"] = Fate::Done.name().into();
        if let Some(seconds) = seconds {
            report["time"] = seconds.into();
        }
        stats.add(&report)?;
    }
    Ok(Fate::Done)
}

/// Renders the scene of a file as it is now.
fn render_scene(
    args: &Args,
    loaded: &Loaded,
    file: &Path,
    target: &Path,
    output: &OutputOptions,
) -> anyhow::Result<Value> {
    if shown_count(args, &loaded.import.scene) == 0 {
        let import = &loaded.import;
        let wires = import.scene.wire_placement_count();
        if wires > 0 {
            bail!(
                "{}: there is no surface to render, only {wires} curves and points; --curves draws them",
                input::display(file)
            );
        }
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
    let holds_data = output::picture_format(target).is_some_and(|f| f.holds_data);
    let data = holds_data && !output.aovs.is_empty();
    let folder = output::folder(target);
    output::make_folder(folder).with_context(|| folder.display().to_string())?;
    let shot = shot(args, loaded, file, args.size.unwrap_or(SIZE), data)?;
    let started = Instant::now();
    output::write(&shot.film, target, output).with_context(|| target.display().to_string())?;
    say!("{}", shot.sentence(file, target));
    Ok(shot.json(file, target, started.elapsed()))
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
            Some(target) if input::is_stdin(target) => say::report(report)?,
            Some(_) => self.lines += &format!("{report}\n"),
            None => {}
        }
        Ok(())
    }

    fn finish(self) -> anyhow::Result<()> {
        match self.target {
            Some(target) if !input::is_stdin(target) => {
                let fill = |file: &mut BufWriter<File>| file.write_all(self.lines.as_bytes());
                output::replace_file(target, fill).with_context(|| target.display().to_string())
            }
            _ => Ok(()),
        }
    }
}
