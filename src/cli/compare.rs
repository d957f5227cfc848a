//! `nurbray compare`.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, bail};
use nurbray::compare::{self, Candidate, Made, Report, Subject, View, read};
use nurbray::formats::Limits;
use nurbray::gltf::{self, Container, Packing, Source};
use nurbray::kernel::{Scene, linear_from_srgb};
use nurbray::{TessellateOptions, Tolerance, output, tessellate};

use super::input::{self, ReadArgs};
use super::mesh::{self, Distance};
use super::parse;
use super::say::{say, visible};
use super::shot::BACKGROUND;
use super::stop::Stop;
use super::{DIFFERENT, Failures};

/// Compares exact surfaces with meshes, in numbers and pictures
///
/// Without a mesh, our own glTF at one or several tolerances is written, read back and compared.
/// With --align a mesh is fitted onto the surfaces first; else unit and upward axis of both
/// files say where it stands. The report is a folder: index.html shows everything and needs no
/// network, report.json and summary.md have the numbers, PNG and EXR files the pictures.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// File with exact surfaces; - reads standard input
    cad: PathBuf,
    /// Meshes: .glb, .gltf, .stl, .ply, .obj or another format with polygons
    meshes: Vec<PathBuf>,
    /// Folder for the report; it is made if it is not there
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Tolerances of our own meshes, separated by commas: lengths with a unit (m, cm, mm, um, in,
    /// ft) or in units of the file, or shares of the diagonal of the scene in percent
    #[arg(
        long,
        value_name = "LENGTH|%,...",
        default_value = "0.2%,0.05%,0.01%",
        value_delimiter = ',',
        value_parser = mesh::distance,
        conflicts_with = "meshes"
    )]
    tolerance: Vec<Distance>,
    /// Fit meshes onto the surfaces by turning and moving them; the residual is told
    #[arg(long)]
    align: bool,
    /// End with exit code 1 unless surface and mesh are proven to be no farther apart than this
    /// length, as for --tolerance
    #[arg(long, value_name = "LENGTH|%", value_parser = mesh::distance)]
    fail_above: Option<Distance>,
    /// Size of the pictures in pixels
    #[arg(long, value_name = "WxH", default_value = "960x720", value_parser = parse::size)]
    size: (u32, u32),
    /// N x N samples per pixel
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = parse::count(1..=64))]
    samples: u32,
    /// Threads; 0 uses every core
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse::threads)]
    threads: usize,
    #[command(flatten, next_help_heading = "Reading")]
    read: ReadArgs,
}

const EXAMPLES: &str = "\
Examples:
  nurbray compare samples/teapot.obj -o report
  nurbray compare wing.igs -o report --tolerance 1mm,0.1mm,0.01mm
  nurbray compare wing.igs wing.stl -o report --align --fail-above 0.05mm

Exit codes: 0 done, 1 a mesh is farther away than --fail-above allows, or not proven to be nearer, 2
something went wrong.";

/// Triangles of the exact side are finer by this factor than what they are to measure.
const FINER: f64 = 0.25;

/// Their tolerance for meshes that are not ours, as a share of the size.
const FOREIGN: f64 = 1e-4;

/// Compares, and tells whether a limit is passed.
pub(super) fn run(args: &Args) -> anyhow::Result<Failures> {
    Stop::listen(None)?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads)
        .build()?;
    pool.install(|| run_here(args))
}

fn run_here(args: &Args) -> anyhow::Result<Failures> {
    let started = Instant::now();
    let bytes = args.read.bytes(&args.cad)?;
    let source = mesh::source(&args.cad, input::sha256(&bytes));
    let mut loaded = args.read.understand(&args.cad, &bytes)?;
    drop(bytes);
    // Triangles tell no groups: lights of one shine everywhere in all pictures.
    let lights = loaded.import.scene.lights.iter_mut();
    lights.for_each(|light| light.scope.clear());
    let import = &loaded.import;
    input::report_warnings(&args.cad, import.format, &import.warnings);
    let scene = &import.scene;
    let placed = scene.placement_count();
    let nothing = || {
        format!(
            "{}: there is no surface to compare with",
            input::display(&args.cad)
        )
    };
    if scene.patches().is_empty() || placed == 0 {
        bail!(nothing());
    }
    output::make_folder(&args.output).with_context(|| args.output.display().to_string())?;
    let limit = args
        .fail_above
        .map(|limit| limit.length(scene))
        .transpose()?;
    compare::remove_earlier(&args.output, &args.meshes)
        .with_context(|| args.output.display().to_string())?;
    let mut candidates = if args.meshes.is_empty() {
        own(args, scene, &source)?
    } else {
        let open = |path: &PathBuf| foreign(path, scene, &args.read.limits());
        args.meshes
            .iter()
            .map(open)
            .collect::<anyhow::Result<_>>()?
    };
    let Some(subject) = subject(args, scene, &mut candidates, limit)? else {
        bail!(
            "{}: all of it is lines or points within the tolerance",
            nothing()
        );
    };
    let view = View {
        camera: scene.cameras.first().cloned(),
        width: args.size.0,
        height: args.size.1,
        samples: args.samples,
        background: linear_from_srgb(BACKGROUND),
    };
    let name = args.cad.file_name().map_or_else(
        || input::display(&args.cad),
        |name| name.to_string_lossy().into_owned(),
    );
    let report = compare::compare(&subject, &name, candidates, &view, &args.output)
        .with_context(|| args.output.display().to_string())?;
    for (path, mesh) in args.meshes.iter().zip(&report.meshes) {
        input::report_warnings(path, "mesh", &mesh.warnings);
    }
    tell(args, &report, started)?;
    Ok(Failures {
        count: 0,
        code: limit.map_or(0, |limit| verdict(&report, limit)),
    })
}

/// The exact side, as fine as the meshes and the limit need it, with the meshes fitted to it if that
/// is asked for; nothing if it has no triangles.
fn subject<'a>(
    args: &Args,
    scene: &'a Scene,
    candidates: &mut [Candidate],
    limit: Option<f64>,
) -> anyhow::Result<Option<Subject<'a>>> {
    let exact = |tolerance: f64| {
        let tolerance = Tolerance::Length(tolerance);
        let options = TessellateOptions {
            tolerance,
            ..TessellateOptions::default()
        };
        tessellate(scene, &options)
    };
    let tolerance = of_exact(scene, candidates);
    let triangles = exact(tolerance)?;
    let mut faces = triangles.faces.iter().flatten();
    if faces.all(|face| face.mesh.triangles().is_empty()) {
        return Ok(None);
    }
    let mut subject = Subject::new(scene, triangles);
    for candidate in &mut *candidates {
        candidate.limit = limit;
        if args.align
            && let Some(fit) = subject.fit(&candidate.scene, &candidate.scene_from_mesh)
        {
            candidate.scene_from_mesh = fit.scene_from_mesh * candidate.scene_from_mesh;
            candidate.fit = Some(fit);
        }
    }
    if let Some(limit) = limit
        && FINER * limit < tolerance
        && !candidates
            .iter()
            .all(|c| subject.is_exceeded(&c.scene, &c.scene_from_mesh, limit))
    {
        match exact(FINER * limit) {
            Ok(triangles) => subject = Subject::new(scene, triangles),
            Err(error) => say!("nurbray: --fail-above: it may not be proven: {error}"),
        }
    }
    Ok(Some(subject))
}

/// The tolerance of the exact side: finer than the meshes.
fn of_exact(scene: &Scene, candidates: &[Candidate]) -> f64 {
    let foreign = Tolerance::Relative(FOREIGN).length(scene.extent().diagonal());
    let made = candidates.iter().filter_map(|c| Some(c.made?.tolerance));
    let finer = made.reduce(f64::min).map(|made| FINER * made);
    // Without an extent there is no share of it.
    finer.unwrap_or(foreign).max(f64::MIN_POSITIVE)
}

/// Our own glTF at every tolerance, read back from the file.
fn own(args: &Args, scene: &Scene, source: &Source) -> anyhow::Result<Vec<Candidate>> {
    let mut candidates = Vec::new();
    for (distance, number) in args.tolerance.iter().zip(1..) {
        let started = Instant::now();
        let options = TessellateOptions {
            tolerance: distance.tolerance(scene)?,
            ..TessellateOptions::default()
        };
        let triangles = tessellate(scene, &options)?;
        let export = gltf::write(
            scene,
            &triangles,
            source,
            (Container::Binary, Packing::default()),
            "mesh",
        )?;
        let name = format!("mesh{number}.glb");
        let path = args.output.join(&name);
        output::replace_file(&path, |file| file.write_all(&export.bytes))
            .with_context(|| path.display().to_string())?;
        let took = started.elapsed();
        let file =
            read::open(&path, &args.read.limits()).with_context(|| path.display().to_string())?;
        candidates.push(Candidate {
            scene_from_mesh: compare::from_metadata(scene, &file.frame),
            made: Some(Made::new(scene, &triangles, &file, took)),
            scene: file.scene,
            bytes: file.bytes,
            file: name,
            warnings: file.warnings,
            ..Candidate::default()
        });
    }
    Ok(candidates)
}

/// A mesh of another tool.
fn foreign(path: &Path, scene: &Scene, limits: &Limits) -> anyhow::Result<Candidate> {
    let file = read::open(path, limits).with_context(|| path.display().to_string())?;
    if file.scene.meshes().is_empty() && !file.scene.patches().is_empty() {
        let shown = path.display();
        bail!("{shown}: it holds surfaces and no triangles; convert makes triangles of it");
    }
    let name = path.file_name().unwrap_or_default();
    Ok(Candidate {
        name: name.to_string_lossy().into_owned(),
        scene_from_mesh: compare::from_metadata(scene, &file.frame),
        scene: file.scene,
        bytes: file.bytes,
        warnings: file.warnings,
        ..Candidate::default()
    })
}

/// The exit code, after telling which meshes are, or may be, farther away than `limit`.
fn verdict(report: &Report, limit: f64) -> u8 {
    let (unit, mut code) = (behind(&report.unit), 0);
    for mesh in report.failures(limit) {
        code = DIFFERENT;
        let (name, found) = (visible(&mesh.name), mesh.deviation.found());
        if mesh.triangles == 0 {
            say!("nurbray: {name}: --fail-above: it is empty");
        } else if found > limit {
            say!("nurbray: {name}: {found:.4e}{unit} apart; --fail-above is {limit:.4e}{unit}");
        } else {
            say!(
                "nurbray: {name}: {found:.4e}{unit} apart as far as is found, but not proven to be \
                within --fail-above, which is {limit:.4e}{unit}"
            );
        }
    }
    code
}

/// A unit as it stands behind a number; nothing if there is none.
fn behind(unit: &str) -> String {
    let space = if unit.is_empty() { "" } else { " " };
    format!("{space}{}", visible(unit))
}

/// A line for each mesh and fault, and where the report is.
fn tell(args: &Args, report: &Report, started: Instant) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    if report.unmeasured > 0 {
        say!(
            "nurbray: {}: {} meshes of the file are shown, but not compared",
            input::display(&args.cad),
            report.unmeasured
        );
    }
    for mesh in &report.meshes {
        writeln!(
            out,
            "{}: {} triangles, {:.4e} to {:.4e}{} apart, {} silhouette pixels, FLIP {:.4}",
            visible(&mesh.name),
            mesh.triangles,
            mesh.deviation.found(),
            mesh.bound(),
            behind(&report.unit),
            mesh.image.silhouette_pixels,
            mesh.image.flip
        )?;
        if mesh.unmeasured > 0 {
            writeln!(
                out,
                "  {} of them are meshes of the exact file, which are not measured",
                mesh.unmeasured
            )?;
        }
        for fault in &mesh.faults {
            writeln!(out, "  {}: {}", fault.kind.name(), visible(&fault.text))?;
        }
    }
    let page = Path::new(&args.output).join("index.html");
    writeln!(
        out,
        "{} in {:.1} s",
        visible(&page.display().to_string()),
        started.elapsed().as_secs_f64()
    )?;
    Ok(())
}
