//! `nurbray convert`.

use std::collections::HashSet;
use std::fs;
use std::io::{BufWriter, Write as _};
use std::path::{Component, Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, bail};
use clap::ValueEnum;
use nurbray::convert::Target;
use nurbray::formats::Export;
use nurbray::gltf::{Packing, Source};
use nurbray::kernel::Scene;
use nurbray::{output, tessellate};
use serde_json::{Map, Value, json};

use super::Failures;
use super::batch::{self, Fate, Shard};
use super::claims::Claims;
use super::input::{self, Loaded, ReadArgs};
use super::mesh::{self, MeshArgs};
use super::parse;
use super::say::{self, say};
use super::stop::{self, Stop};

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
    /// File to write; its ending chooses the format, {stem} stands for the input's name without
    /// its ending, and {ext} for that ending
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
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = parse::threads)]
    jobs: usize,
    /// Skip files that an earlier run with --resume finished with the same options, if source,
    /// files that it names and outputs are as they were, as a .done file beside each output tells
    #[arg(long)]
    resume: bool,
    /// Convert only part I of N, counted from 0, or with slurm the part of this task of a job
    /// array
    #[arg(long, value_name = "I/N|slurm", value_parser = batch::shard)]
    shard: Option<Shard>,
}

const EXAMPLES: &str = "\
Examples:
  nurbray convert samples/goblet.x3d -o goblet.igs
  nurbray convert parts -o '{stem}.igs' --out-dir converted --log json
  nurbray convert wing.igs -o wing.glb --tolerance 0.1mm
  nurbray convert parts -o '{stem}.glb' --out-dir meshes --jobs 8 --resume

Exit codes: 0 all files were converted, 2 none was, 3 some were.
SIGINT or SIGTERM (Ctrl-C) begins no more files; a second one ends the program at once.";

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Log {
    Text,
    Json,
}

/// One file to be converted.
#[derive(Debug)]
struct Job {
    /// Its position among all that were given.
    number: usize,
    source: PathBuf,
    path: PathBuf,
    target: Target,
    /// Why it cannot be, if that is known without a look at the file.
    refused: Option<String>,
}

/// What there is to say about a file, for machines.
type Row = Map<String, Value>;

/// Converts every file.
pub(super) fn run(args: &Args) -> anyhow::Result<Failures> {
    let (mut jobs, claims) = jobs(args)?;
    if let Some(Shard { index, count }) = args.batch.shard {
        jobs.retain(|job| job.number % count == index);
    }
    if jobs.iter().all(|job| !job.target.has_triangles()) {
        args.mesh.warn_unused(&args.output);
    }
    let json = args.json || args.log == Log::Json;
    let stop = Stop::listen(Some("the files that are being converted are"))?;
    let work = |job: &Job| {
        let mut row = Row::new();
        let fate = if stop.is_asked() {
            Fate::Left
        } else {
            convert(job, args, (&stop, &claims), &mut row).unwrap_or_else(|error| {
                say!("nurbray: {error:#}");
                row.insert("error".to_owned(), format!("{error:#}").into());
                Fate::Failed
            })
        };
        if json {
            let status = row.entry("status");
            status.or_insert_with(|| fate.name().into());
            row.insert("file".to_owned(), input::display(&job.source).into());
            say::report(&Value::Object(row))?;
        }
        Ok(fate)
    };
    let result = batch::run(&jobs, args.batch.jobs, work)?;
    Ok(stop::ending(jobs.len(), result.failed, result.left))
}

/// Every file with its target, and their places; those that would be written to one place, or over
/// an input, are refused.
fn jobs(args: &Args) -> anyhow::Result<(Vec<Job>, Claims)> {
    input::check_pattern("-o", &args.output, &["stem", "ext"])?;
    let (mut jobs, mut known) = (Vec::new(), HashSet::new());
    for given in &args.files {
        for source in input::files_at(given)? {
            let path = path(args, given, &source);
            let target = if args.triangles {
                Target::of_triangles
            } else {
                Target::of
            };
            let Some(target) = target(&path) else {
                let what = match Target::of(&path) {
                    Some(other) => format!("{} holds no triangles", other.name()),
                    None => format!("the ending tells the format; use one of {}", endings()),
                };
                bail!("{}: {what}", path.display());
            };
            // A file that is given several times is converted once.
            let real = source.canonicalize();
            if real.is_ok_and(|real| !known.insert((real, path.clone()))) {
                continue;
            }
            jobs.push(Job {
                number: jobs.len(),
                source,
                path,
                target,
                refused: None,
            });
        }
    }
    let pair = |job: &Job| (job.source.clone(), job.path.clone());
    let pairs: Vec<_> = jobs.iter().map(pair).collect();
    let pairs: Vec<_> = pairs.iter().map(|(a, b)| (&**a, &**b)).collect();
    let claims = Claims::new(&pairs, &args.read);
    for (job, clash) in jobs.iter_mut().zip(input::clashes(&pairs)) {
        let is_input = claims.is_input(&job.path);
        job.refused = is_input.then(|| input::over_input(&job.path)).or(clash);
    }
    Ok((jobs, claims))
}

/// Where a file goes; `given` is what led to it, itself or a folder.
fn path(args: &Args, given: &Path, source: &Path) -> PathBuf {
    let name = input::named(&args.output, source, "");
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

/// Converts a file; what there is to say about it goes into `row`.
fn convert(
    job: &Job,
    args: &Args,
    (stop, claims): (&Stop, &Claims),
    row: &mut Row,
) -> anyhow::Result<Fate> {
    let Job { source, path, .. } = job;
    if let Some(why) = &job.refused {
        bail!("{why}");
    }
    let Some(bytes) = stop.or_bytes(&args.read, source) else {
        return Ok(Fate::Left);
    };
    let bytes = bytes?;
    let sha256 = input::sha256(&bytes);
    let record = args.batch.resume.then(|| {
        let options = format!("{:?} {:?} {:?}", args.mesh, args.read, job.target.name());
        batch::Record::new(path, &sha256, &options)
    });
    if let Some(record) = &record {
        batch::remove_leftovers(path)?;
        if record.is_done(&args.read.beside(source, &args.read.limits())) {
            say!("{}: done before", input::display(source));
            row.insert("status".to_owned(), "skipped".into());
            row.insert("output".to_owned(), path.display().to_string().into());
            return Ok(Fate::Done);
        }
        record.remove()?;
    }
    let loaded = args.read.understand(source, &bytes)?;
    drop(bytes);
    let origin = mesh::source(source, sha256);
    let export = write(job, args, (&loaded, claims), &origin, row)?;
    if let Some(record) = &record {
        record.write(&loaded.beside, &export)?;
    }
    Ok(Fate::Done)
}

/// Writes a file that has been read; what there is to say about it goes into `row`.
fn write(
    job: &Job,
    args: &Args,
    (loaded, claims): (&Loaded, &Claims),
    origin: &Source,
    row: &mut Row,
) -> anyhow::Result<Export> {
    let Job {
        source,
        path,
        target,
        ..
    } = job;
    let Loaded {
        import, took: read, ..
    } = loaded;
    input::report_warnings(source, import.format, &import.warnings);
    row.insert("from".to_owned(), import.format.into());
    row.insert(
        "warnings".to_owned(),
        input::warnings_json(&import.warnings),
    );
    let scene = &import.scene;
    if scene.placement_count() == 0 {
        match scene.wire_placement_count() {
            0 => bail!("{}: there is nothing to convert", input::display(source)),
            wires if !target.has_lines() => bail!(
                "{}: there is no surface to convert, only {wires} curves and points, which {} does not \
                 hold; glTF and OBJ do",
                input::display(source),
                target.name()
            ),
            _ => {}
        }
    }
    let started = Instant::now();
    let (mut export, report) = export(scene, *target, path, &args.mesh, origin)
        .map_err(|error| error.context(input::display(source)))?;
    import.tell_unwritten(&mut export.warnings);
    input::report_warnings(path, import.format, &export.warnings);
    let outputs = outputs(path, &export);
    loaded.check_beside(source, &outputs)?;
    claims.claim(job.number, &outputs)?;
    store(path, &export)?;
    let took = started.elapsed();
    let bytes = export.bytes.len() + export.beside.iter().map(|(_, b)| b.len()).sum::<usize>();
    let patches = scene.patches().len();
    say!(
        "{} -> {}: {patches} patches, {}{bytes} bytes, {:.2} s",
        input::display(source),
        path.display(),
        in_short(&report),
        (*read + took).as_secs_f64()
    );
    let common = json!({
        "output": path.display().to_string(),
        "to": target.name(),
        "read_s": read.as_secs_f64(),
        "write_s": took.as_secs_f64(),
        "patches": patches,
        "meshes": scene.meshes().len(),
        "bytes": bytes,
        "left_out": input::warnings_json(&export.warnings),
    });
    for part in [report, common] {
        if let Value::Object(part) = part {
            row.extend(part);
        }
    }
    Ok(export)
}

/// What the line about a file says of its triangles.
fn in_short(report: &Value) -> String {
    let count = |key: &str| report[key].as_u64().unwrap_or_default();
    let (triangles, shells) = (count("triangles"), count("shells"));
    match (triangles, shells) {
        (0, _) => String::new(),
        (_, 0) => format!("{triangles} triangles, "),
        _ => {
            let closed = count("closed_shells");
            format!("{triangles} triangles, {closed} of {shells} shells closed, ")
        }
    }
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
            let rounding = writer.rounding(scene, packing);
            let options = mesh.options(scene, writer.name, rounding)?;
            let triangles = tessellate(scene, &options).with_context(written)?;
            let took = started.elapsed();
            let count = mesh::count(scene, &triangles, writer, options.most_points);
            let mut report = mesh::report(&triangles, count.with_context(written)?, rounding);
            report["tessellate_s"] = took.as_secs_f64().into();
            let mut export = writer
                .write(scene, &triangles, origin, packing, &stem)
                .with_context(written)?;
            mesh::note_flaws(scene, &triangles, &mut export.warnings);
            Ok((export, report))
        }
    }
}

/// The endings of all formats that are written.
pub(super) fn endings() -> String {
    let mut known: Vec<String> = Vec::new();
    for extension in Target::all().flat_map(Target::extensions) {
        let ending = format!(".{extension}");
        if !known.contains(&ending) {
            known.push(ending);
        }
    }
    known.join(", ")
}

/// The places of a file and of those beside it, the file itself last.
pub(super) fn outputs(path: &Path, export: &Export) -> Vec<PathBuf> {
    let beside = export.beside.iter();
    let mut paths: Vec<_> = beside.map(|(name, _)| path.with_file_name(name)).collect();
    paths.push(path.to_owned());
    paths
}

/// Writes a file and those beside it, the file itself last.
pub(super) fn store(path: &Path, export: &Export) -> anyhow::Result<()> {
    let folder = output::folder(path);
    output::make_folder(folder).with_context(|| folder.display().to_string())?;
    let beside = export.beside.iter().map(|(_, bytes)| bytes);
    let paths = outputs(path, export);
    let is_new: Vec<bool> = paths.iter().map(|path| !path.exists()).collect();
    for (k, bytes) in beside.chain([&export.bytes]).enumerate() {
        let path = &paths[k];
        let fill = |file: &mut BufWriter<fs::File>| file.write_all(bytes);
        if let Err(error) = output::replace_file(path, fill) {
            // What is beside a file that is not there is of no use.
            for (path, _) in paths.iter().zip(&is_new).take(k).filter(|(_, new)| **new) {
                let _ = fs::remove_file(path);
            }
            return Err(error).with_context(|| path.display().to_string());
        }
    }
    Ok(())
}
