//! `nurbray convert`.

use std::fs;
use std::io::{BufWriter, Write as _};
use std::path::{Component, Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, bail};
use clap::ValueEnum;
use nurbray::convert::Target;
use nurbray::formats::{Export, FORMATS};
use nurbray::gltf::{Packing, Source};
use nurbray::kernel::Scene;
use nurbray::{output, tessellate};
use serde_json::{Value, json};

use super::batch;
use super::input::{self, ReadArgs};
use super::mesh::{self, MeshArgs, Shard};
use super::{FAILED, Failures, PARTLY};

/// Turns files of one format into another
///
/// Surfaces stay what they are where the other format has them, with their trims, names, colours
/// and instances; for glTF, STL and PLY they become triangles that are proven to be within a
/// tolerance. What the other format cannot hold is named. A file appears under its name when it
/// is complete, and the same input gives the same bytes.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Files to convert, and folders to look for files in; - reads standard input
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// File to write; its ending chooses the format, and {stem} stands for the input's name
    /// without its ending
    #[arg(short, long, value_name = "OUT")]
    output: String,
    /// Write into this folder, in the same folders below it as the inputs are in
    #[arg(long, value_name = "DIR")]
    out_dir: Option<PathBuf>,
    /// What is said about every file: sentences, or one line of JSON on standard output
    #[arg(long, value_enum, default_value_t = Log::Text)]
    log: Log,
    /// The same as --log json
    #[arg(long)]
    json: bool,
    /// Write triangles also where the format could hold surfaces (.obj)
    #[arg(long)]
    triangles: bool,
    #[command(flatten)]
    mesh: MeshArgs,
    #[command(flatten, next_help_heading = "Batches")]
    batch: BatchArgs,
    #[command(flatten, next_help_heading = "Reading")]
    read: ReadArgs,
}

/// How many files are converted.
#[derive(Clone, Copy, Debug, clap::Args)]
struct BatchArgs {
    /// Files converted at the same time; 0 is one for each core
    #[arg(long, value_name = "N", default_value_t = 1)]
    jobs: usize,
    /// Skip files that an earlier run with --resume finished from the same source with the same
    /// options, as a .done file beside each output tells
    #[arg(long)]
    resume: bool,
    /// Convert only part I of N, counted from 0, or with slurm the part of this task of a job
    /// array
    #[arg(long, value_name = "I/N|slurm", value_parser = mesh::shard)]
    shard: Option<Shard>,
}

const EXAMPLES: &str = "\
Examples:
  nurbray convert samples/goblet.x3d -o goblet.igs
  nurbray convert parts -o '{stem}.igs' --out-dir converted --log json
  nurbray convert wing.igs -o wing.glb --tolerance 0.1mm
  nurbray convert parts -o '{stem}.glb' --out-dir meshes --jobs 8 --resume

Exit codes: 0 all files were converted, 2 none was, 3 some were.";

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Log {
    Text,
    Json,
}

/// One file to be converted.
#[derive(Debug)]
struct Job {
    source: PathBuf,
    path: PathBuf,
    target: Target,
}

/// Converts every file.
pub(super) fn run(args: &Args) -> anyhow::Result<Failures> {
    let mut jobs = jobs(args)?;
    if let Some(Shard { index, count }) = args.batch.shard {
        let numbered = jobs.into_iter().enumerate();
        let own = numbered.filter(|(number, _)| number % count == index);
        jobs = own.map(|(_, job)| job).collect();
    }
    let json = args.json || args.log == Log::Json;
    let work = |job: &Job| {
        let report = convert(job, args);
        if let Err(error) = &report {
            eprintln!("nurbray: {error:#}");
        }
        let failed = report.is_err();
        if json {
            let line = report.unwrap_or_else(|error| {
                let file = input::display(&job.source);
                json!({ "file": file, "status": "failed", "error": format!("{error:#}") })
            });
            writeln!(std::io::stdout().lock(), "{line}")?;
        }
        Ok(failed)
    };
    let result = batch::run(&jobs, args.batch.jobs, work)?;
    if result.left > 0 {
        eprintln!("nurbray: stopped; {} files are left", result.left);
    }
    let count = result.failed + result.left;
    let code = if count < jobs.len() { PARTLY } else { FAILED };
    Ok(Failures { count, code })
}

/// Every file with its target; no two may be the same.
fn jobs(args: &Args) -> anyhow::Result<Vec<Job>> {
    let mut jobs = Vec::new();
    for given in &args.files {
        let sources = if given.is_dir() {
            let mut found = Vec::new();
            find(given, &mut found).with_context(|| given.display().to_string())?;
            if found.is_empty() {
                bail!("{}: there is no file to convert in it", given.display());
            }
            found
        } else {
            vec![given.clone()]
        };
        for source in sources {
            let path = path(args, given, &source);
            let target = if args.triangles {
                Target::of_triangles
            } else {
                Target::of
            };
            let Some(target) = target(&path) else {
                bail!(
                    "{}: the ending tells the format; use one of {}",
                    path.display(),
                    endings()
                );
            };
            if path
                .canonicalize()
                .ok()
                .is_some_and(|path| Some(path) == source.canonicalize().ok())
            {
                bail!("{}: the file would be written over itself", path.display());
            }
            jobs.push(Job {
                source,
                path,
                target,
            });
        }
    }
    input::check_distinct(
        jobs.iter()
            .map(|job| (job.source.as_path(), job.path.as_path())),
    )?;
    Ok(jobs)
}

/// Where a file goes; `given` is what led to it, itself or a folder.
fn path(args: &Args, given: &Path, source: &Path) -> PathBuf {
    let name = args.output.replace("{stem}", &input::stem(source));
    let Some(folder) = &args.out_dir else {
        return name.into();
    };
    // Inside a folder that was given, or as the name of the file says.
    let inside = source
        .strip_prefix(given)
        .ok()
        .filter(|path| path.file_name().is_some());
    let parent = inside
        .unwrap_or(source)
        .parent()
        .filter(|path| path.is_relative());
    let below = parent.into_iter().flat_map(Path::components);
    let below: PathBuf = below
        .filter(|c| matches!(c, Component::Normal(_)))
        .collect();
    folder.join(below).join(name)
}

/// Collects the files below a folder that some format may read, in the order of their names.
fn find(folder: &Path, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    let mut entries: Vec<_> = fs::read_dir(folder)?.collect::<Result<_, _>>()?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let path = entry.path();
        // Links to folders are not followed: they may lead back.
        if entry.file_type()?.is_dir() {
            find(&path, found)?;
        } else if path.is_file() && is_known(&path) {
            found.push(path);
        }
    }
    Ok(())
}

/// Whether some format has the ending of this name, or the one before `.gz`.
fn is_known(path: &Path) -> bool {
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    let extension = Path::new(name).extension().and_then(|e| e.to_str());
    let has = |e: &str| FORMATS.iter().any(|format| format.extensions.contains(&e));
    extension.is_some_and(has)
}

/// Converts a file; the result is what there is to say about it.
fn convert(job: &Job, args: &Args) -> anyhow::Result<Value> {
    let Job {
        source,
        path,
        target,
    } = job;
    let origin = mesh::source(source)?;
    let record = args.batch.resume.then(|| {
        let options = format!("{:?} {:?} {:?}", args.mesh, args.read, target.name());
        batch::Record::new(path, &origin.sha256, &options)
    });
    if let Some(record) = &record {
        batch::remove_leftovers(path)?;
        if record.is_done() {
            let file = input::display(source);
            eprintln!("{file}: done before");
            return Ok(json!({
                "file": file,
                "status": "skipped",
                "output": path.display().to_string(),
            }));
        }
        record.remove()?;
    }
    let loaded = args.read.load(source)?;
    let import = &loaded.import;
    input::report_warnings(source, import.format, &import.warnings);
    let scene = &import.scene;
    if scene.placement_count() == 0 {
        bail!("{}: there is nothing to convert", input::display(source));
    }
    let started = Instant::now();
    let (export, mut report) = export(scene, *target, path, &args.mesh, &origin)
        .map_err(|error| error.context(input::display(source)))?;
    input::report_warnings(path, target.name(), &export.warnings);
    store(path, &export)?;
    if let Some(record) = &record {
        record.write()?;
    }
    let took = started.elapsed();
    let bytes = export.bytes.len() + export.beside.iter().map(|(_, b)| b.len()).sum::<usize>();
    let patches = scene.patches().len();
    eprintln!(
        "{} -> {}: {patches} patches, {bytes} bytes, {:.2} s",
        input::display(source),
        path.display(),
        (loaded.took + took).as_secs_f64()
    );
    let common = json!({
        "file": input::display(source),
        "status": "ok",
        "output": path.display().to_string(),
        "from": import.format,
        "to": target.name(),
        "read_s": loaded.took.as_secs_f64(),
        "write_s": took.as_secs_f64(),
        "patches": patches,
        "meshes": scene.meshes().len(),
        "bytes": bytes,
        "warnings": input::warnings_json(&import.warnings),
        "left_out": input::warnings_json(&export.warnings),
    });
    if let (Some(report), Value::Object(common)) = (report.as_object_mut(), common) {
        report.extend(common);
    }
    Ok(report)
}

/// The content of a file, and what there is to say about its triangles.
pub(super) fn export(
    scene: &Scene,
    target: Target,
    path: &Path,
    mesh: &MeshArgs,
    origin: &Source,
) -> anyhow::Result<(Export, Value)> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let written = || path.display().to_string();
    match target {
        Target::Surfaces(writer) => {
            let export = (writer.write)(scene, &stem).with_context(written)?;
            Ok((export, json!({})))
        }
        Target::Triangles(writer) => {
            let packing = mesh.packing();
            if !writer.packs && packing != Packing::default() {
                bail!(
                    "{}: --quantize and --meshopt are for glTF; {} has nothing like it",
                    written(),
                    writer.name
                );
            }
            let started = Instant::now();
            let triangles = tessellate(scene, &mesh.options(scene)?).with_context(written)?;
            let mut report = mesh::report(&triangles, mesh.rounding(scene));
            report["tessellate_s"] = started.elapsed().as_secs_f64().into();
            let mut export =
                (writer.write)(scene, &triangles, origin, packing, &stem).with_context(written)?;
            mesh::note_flaws(scene, &triangles, &mut export.warnings);
            Ok((export, report))
        }
    }
}

/// The endings of all formats that are written.
pub(super) fn endings() -> String {
    let known = Target::all().flat_map(Target::extensions);
    let known: Vec<_> = known.map(|e| format!(".{e}")).collect();
    known.join(", ")
}

/// Writes a file and those beside it, the file itself last.
pub(super) fn store(path: &Path, export: &Export) -> anyhow::Result<()> {
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
        fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    let beside = export
        .beside
        .iter()
        .map(|(name, bytes)| (path.with_file_name(name), bytes));
    for (path, bytes) in beside.chain([(path.to_owned(), &export.bytes)]) {
        let fill = |file: &mut BufWriter<fs::File>| file.write_all(bytes);
        output::replace_file(&path, fill).with_context(|| path.display().to_string())?;
    }
    Ok(())
}
