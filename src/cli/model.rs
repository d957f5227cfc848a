//! `nurbray model`.

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use nurbray::convert::Target;
use nurbray::formats::{Limits, POINT_FORMATS, PointBody, PointFormat, PointSet, read_points};
use nurbray::gltf::Source;
use nurbray::kernel::modelling::{Along, Spacing, Twist};
use nurbray::kernel::{MAX_DEGREE, Unit};
use nurbray::{Caps, ModelMethod, ModelOptions, Synthetic, model, synthetic};

use super::convert;
use super::input;
use super::mesh::{self, MeshArgs};
use super::parse;
use super::say::{counted, say};
use super::stop::Stop;

/// Makes bodies of measured points: grids, and contours in layers
///
/// DATA is a DICOM RT Structure Set, a table (CSV, TSV, XYZ), JSON, or an OBJ file with polylines.
/// Every body, such as a region of interest, becomes a node with its surfaces and caps. Points
/// that make no body are refused with their line or layer, and nothing is written.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// File with points; - reads standard input
    #[arg(required_unless_present = "synthetic", conflicts_with = "synthetic")]
    data: Option<PathBuf>,
    /// File to write; its ending chooses the format: one of those of convert, or .csv, .json or
    /// .dcm for the points themselves
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// How surfaces are made of points
    #[arg(long, value_enum, default_value_t = Method::Loft)]
    method: Method,
    /// What closes the ends of bodies
    #[arg(long, value_enum, default_value_t = End::Flat)]
    caps: End,
    /// Height of rounded caps; otherwise half the distance of the last two layers
    #[arg(long, value_name = "LENGTH", value_parser = parse::length)]
    cap_height: Option<f64>,
    /// Bodies of which layers have several contours
    #[arg(long, value_enum, default_value_t = Branches::Refuse)]
    branches: Branches,
    /// Leave out points that repeat, put layers in order and close open contours, each with a
    /// warning, instead of refusing them
    #[arg(long)]
    repair: bool,
    /// Make only the body of this name; may be repeated
    #[arg(long, value_name = "NAME")]
    body: Vec<String>,
    /// Opacity from 0 to 1, of all bodies or as NAME=SHARE of one; may be repeated
    #[arg(long, value_name = "SHARE", value_parser = opacity)]
    opacity: Vec<Opacity>,
    /// Unit of length, if the file names none
    #[arg(long, value_parser = unit())]
    unit: Option<Unit>,
    #[command(flatten, next_help_heading = "Grids")]
    grid: GridArgs,
    #[command(flatten, next_help_heading = "Synthetic bodies")]
    synthetic: SyntheticArgs,
    /// Write triangles also where the format could hold surfaces (.obj)
    #[arg(long)]
    triangles: bool,
    #[command(flatten)]
    mesh: MeshArgs,
}

/// Options of --method coons and interpolate.
#[derive(Debug, clap::Args)]
struct GridArgs {
    /// What goes on from its end to its beginning [default: rows]
    #[arg(long, value_enum)]
    closed: Option<Closed>,
    /// Mixed derivatives of coons [default: catmull]
    #[arg(long, value_enum)]
    twist: Option<TwistKind>,
    /// Degrees of interpolate along rows and from row to row [default: 3,3]
    #[arg(long, value_name = "P,Q", value_parser = degrees)]
    degree: Option<[usize; 2]>,
    /// How points of interpolate get their parameters [default: chord]
    #[arg(long, value_enum)]
    parameters: Option<Parameters>,
}

/// Options of --synthetic.
#[derive(Debug, clap::Args)]
struct SyntheticArgs {
    /// Make these bodies of known volume, in millimetres, instead of reading any
    #[arg(long, value_enum, value_delimiter = ',', value_name = "KINDS")]
    synthetic: Vec<Kind>,
    /// Number that chooses their bumps [default: 1]
    #[arg(long, value_name = "N", value_parser = parse::whole)]
    seed: Option<u64>,
    /// Their layers [default: 24]
    #[arg(long, value_name = "N", value_parser = parse::count(2..=10_000))]
    layers: Option<u32>,
    /// Points of each layer [default: 72]
    #[arg(long, value_name = "N", value_parser = parse::count(3..=10_000))]
    points: Option<u32>,
}

const EXAMPLES: &str = "\
Examples:
  nurbray model scan.dcm -o scan.x3d --opacity Skull=0.3
  nurbray model contours.csv -o body.glb --method contours --caps rounded
  nurbray model grid.csv -o grid.igs --method interpolate --degree 4,3 --unit mm
  nurbray model --synthetic skull,pathology -o head.dcm";

/// Degrees along rows and from row to row, unless the user wants others.
const DEGREES: [usize; 2] = [3, 3];

/// The number that chooses bumps, layers, and points of each, unless the user wants others.
const SEED: u64 = 1;
const LAYERS: u32 = 24;
const POINTS: u32 = 72;

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Method {
    /// Bicubic pieces between neighbours of a grid
    Coons,
    /// One B-spline surface through a grid
    Interpolate,
    /// Contours blended by parabolas: smooth, and smaller than the contours
    Contours,
    /// Surfaces through contours
    Loft,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum End {
    /// Open ends
    None,
    /// Planes
    Flat,
    /// Domes
    Rounded,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Branches {
    /// Are refused
    Refuse,
    /// Become bodies that end where they branch
    Split,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Closed {
    /// The last point of each row by its first one
    Rows,
    /// The last row by the first one
    Columns,
    /// Both
    Both,
    /// Nothing
    None,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum TwistKind {
    /// Differences of derivatives
    Catmull,
    /// None
    Zero,
    /// Cross products, of points scaled to steps of length one
    Cross,
    /// Cross products of points as they are, as in the paper that proposes them
    SeedLiteral,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Parameters {
    /// Equal steps
    Uniform,
    /// By distances
    Chord,
    /// By square roots of distances
    Centripetal,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// A ball without its poles
    Sphere,
    /// A shell with an opening
    Skull,
    /// A star-shaped zone inside of it
    Pathology,
}

/// An opacity, of one body or of all.
#[derive(Clone, Debug, PartialEq)]
struct Opacity {
    name: Option<String>,
    share: f64,
}

fn opacity(text: &str) -> Result<Opacity, String> {
    let (name, share) = match text.rsplit_once('=') {
        Some((name, share)) => (Some(name.to_owned()), share),
        None => (None, text),
    };
    let share = share.parse().ok().filter(|x| (0.0..=1.0).contains(x));
    let share =
        share.ok_or_else(|| format!("'{text}' is not a share from 0 to 1, or NAME=SHARE"))?;
    Ok(Opacity { name, share })
}

fn degrees(text: &str) -> Result<[usize; 2], String> {
    let found = text.split_once(',').and_then(|(p, q)| {
        let [p, q] = [p, q].map(|degree| degree.trim().parse().ok());
        Some([p?, q?])
    });
    let is_valid = |degree: &usize| (1..=MAX_DEGREE).contains(degree);
    let found = found.filter(|degrees: &[usize; 2]| degrees.iter().all(is_valid));
    found.ok_or_else(|| format!("'{text}' is not two degrees from 1 to {MAX_DEGREE}, such as 3,3"))
}

impl Args {
    /// Says which options the output, the method, the ends or the source of the points do not ask
    /// for.
    fn warn_unused(&self, is_of_points: bool) {
        let (grid, made) = (&self.grid, &self.synthetic);
        let interpolates = self.method == Method::Interpolate;
        let is_grid = interpolates || self.method == Method::Coons;
        let is_read = made.synthetic.is_empty();
        for (name, idle, wanted) in [
            (
                "--cap-height",
                self.cap_height.is_some() && self.caps != End::Rounded,
                "--caps rounded",
            ),
            (
                "--branches",
                self.branches == Branches::Split && is_grid,
                "--method contours and loft",
            ),
            (
                "--repair",
                self.repair && is_grid,
                "--method contours and loft",
            ),
            (
                "--closed",
                grid.closed.is_some() && !is_grid,
                "--method coons and interpolate",
            ),
            (
                "--caps rounded",
                self.caps == End::Rounded
                    && is_grid
                    && !matches!(grid.closed, None | Some(Closed::Rows)),
                "--closed rows",
            ),
            (
                "--twist",
                grid.twist.is_some() && self.method != Method::Coons,
                "--method coons",
            ),
            (
                "--degree",
                grid.degree.is_some() && !interpolates,
                "--method interpolate",
            ),
            (
                "--parameters",
                grid.parameters.is_some() && !interpolates,
                "--method interpolate",
            ),
            (
                "--method",
                is_of_points && self.method != Method::Loft,
                "outputs of surfaces and triangles",
            ),
            (
                "--caps",
                is_of_points && self.caps != End::Flat,
                "outputs of surfaces and triangles",
            ),
            ("--seed", made.seed.is_some() && is_read, "--synthetic"),
            ("--layers", made.layers.is_some() && is_read, "--synthetic"),
            ("--points", made.points.is_some() && is_read, "--synthetic"),
        ] {
            if idle {
                say!("nurbray: warning: {name} is for {wanted}");
            }
        }
    }

    fn options(&self) -> ModelOptions {
        let is_closed = match self.grid.closed.unwrap_or(Closed::Rows) {
            Closed::Rows => [true, false],
            Closed::Columns => [false, true],
            Closed::Both => [true, true],
            Closed::None => [false, false],
        };
        let spacing = match self.grid.parameters.unwrap_or(Parameters::Chord) {
            Parameters::Uniform => Spacing::Uniform,
            Parameters::Chord => Spacing::ChordLength,
            Parameters::Centripetal => Spacing::Centripetal,
        };
        let along = |axis: usize| Along {
            degree: self.grid.degree.unwrap_or(DEGREES)[axis],
            is_closed: is_closed[axis],
            spacing,
        };
        let twist = match self.grid.twist.unwrap_or(TwistKind::Catmull) {
            TwistKind::Catmull => Twist::Catmull,
            TwistKind::Zero => Twist::Zero,
            TwistKind::Cross => Twist::Cross,
            TwistKind::SeedLiteral => Twist::SeedLiteral,
        };
        ModelOptions {
            method: match self.method {
                Method::Coons => ModelMethod::Coons(twist),
                Method::Interpolate => ModelMethod::Interpolate([along(0), along(1)]),
                Method::Contours => ModelMethod::Contours,
                Method::Loft => ModelMethod::Loft,
            },
            closed: is_closed,
            caps: match self.caps {
                End::None => Caps::None,
                End::Flat => Caps::Flat,
                End::Rounded => Caps::Rounded(self.cap_height),
            },
            split: self.branches == Branches::Split,
            repair: self.repair,
        }
    }

    /// The points, what they are from, and a name for messages.
    fn points(&self) -> anyhow::Result<(PointSet, Source, PathBuf)> {
        if let Some(data) = &self.data {
            let limits = Limits::default();
            let bytes =
                input::read_bytes(data, limits.bytes).with_context(|| input::display(data))?;
            let set = read_points(&bytes, input::ending(data).as_deref(), &limits)
                .with_context(|| input::display(data))?;
            let origin = mesh::source(data, input::sha256(&bytes));
            return Ok((set, origin, data.clone()));
        }
        let mut set = PointSet {
            unit: Unit::named("mm"),
            ..PointSet::default()
        };
        for kind in &self.synthetic.synthetic {
            let kind = match kind {
                Kind::Sphere => Synthetic::Sphere,
                Kind::Skull => Synthetic::Skull,
                Kind::Pathology => Synthetic::Pathology,
            };
            let seed = self.synthetic.seed.unwrap_or(SEED);
            let layers = self.synthetic.layers.unwrap_or(LAYERS) as usize;
            let points = self.synthetic.points.unwrap_or(POINTS) as usize;
            let (body, volume) = synthetic(kind, seed, layers, points);
            say!("{}: the volume is {volume:.6} mm^3", body.name);
            set.bodies.push(body);
        }
        Ok((set, Source::default(), PathBuf::from("synthetic")))
    }
}

fn unit() -> impl TypedValueParser<Value = Unit> {
    let known = |name: String| Unit::named(&name).ok_or("not a known unit");
    PossibleValuesParser::new(Unit::KNOWN.map(|(name, _)| name)).try_map(known)
}

/// Makes the bodies of a file.
pub(super) fn run(args: &Args) -> anyhow::Result<usize> {
    Stop::listen(None)?;
    let path = args.output.as_path();
    input::check_pattern("-o", &path.to_string_lossy(), &[])?;
    let target = if args.triangles {
        Target::of_triangles(path)
    } else {
        Target::of(path)
    };
    let points_as = PointFormat::of_output(path);
    if target.is_none() && points_as.is_none() {
        bail!(
            "{}: the ending tells the format; use one of {}, or {} for points",
            path.display(),
            convert::endings(),
            point_endings()
        );
    }
    if target.is_none_or(|target| !target.has_triangles()) {
        args.mesh.warn_unused(&path.display().to_string());
    }
    args.warn_unused(target.is_none());
    let (mut set, origin, source) = args.points()?;
    let inputs = args.data.as_slice();
    input::report_warnings(&source, set.format, &set.warnings);
    select(&mut set, args).with_context(|| input::display(&source))?;
    if let (None, Some(format)) = (target, points_as)
        && let Some(write) = format.write
    {
        let export = write(&set);
        input::report_warnings(path, set.format, &export.warnings);
        input::check_apart(&convert::outputs(path, &export), inputs)?;
        convert::store(path, &export)?;
        say!("{} -> {}", input::display(&source), path.display());
        return Ok(0);
    }
    let Some(target) = target else {
        return Ok(0);
    };
    let modelled = model(&set, &args.options()).with_context(|| input::display(&source))?;
    input::report_warnings(&source, set.format, &modelled.warnings);
    let scene = &modelled.scene;
    let (export, _) = convert::export(scene, target, path, &args.mesh, &origin)?;
    input::report_warnings(path, set.format, &export.warnings);
    input::check_apart(&convert::outputs(path, &export), inputs)?;
    convert::store(path, &export)?;
    say!(
        "{} -> {}: {}, {}",
        input::display(&source),
        path.display(),
        counted(scene.materials().len(), "body", "bodies"),
        counted(scene.patches().len(), "patch", "patches")
    );
    Ok(0)
}

/// The endings of all formats that points are written in.
fn point_endings() -> String {
    let written = POINT_FORMATS.iter().filter(|format| format.write.is_some());
    let endings = written.map(|format| format!(".{}", format.extensions[0]));
    endings.collect::<Vec<_>>().join(", ")
}

/// Keeps the bodies that are asked for, makes them transparent, and names the unit.
fn select(set: &mut PointSet, args: &Args) -> anyhow::Result<()> {
    let names: Vec<String> = set.bodies.iter().map(|body| body.name.clone()).collect();
    for wanted in &args.body {
        if !names.contains(wanted) {
            bail!("no body '{wanted}'; there is: {}", names.join(", "));
        }
    }
    if !args.body.is_empty() {
        set.bodies.retain(|body| args.body.contains(&body.name));
    }
    for Opacity { name, share } in &args.opacity {
        let is_meant = |body: &PointBody| name.as_ref().is_none_or(|name| *name == body.name);
        if let (Some(name), false) = (name, set.bodies.iter().any(is_meant)) {
            bail!(
                "--opacity: no body '{name}'; there is: {}",
                names.join(", ")
            );
        }
        for body in set.bodies.iter_mut().filter(|body| is_meant(body)) {
            body.transparency = 1.0 - share;
        }
    }
    if let (Some(unit), Some(_)) = (&set.unit, &args.unit) {
        let name = &unit.name;
        say!("nurbray: warning: --unit is for points without a unit; these are in {name}");
    } else {
        set.unit = args.unit.clone().or(set.unit.take());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opacities_and_degrees() {
        let one = opacity("Skull=0.25").unwrap();
        assert_eq!((one.name.as_deref(), one.share), (Some("Skull"), 0.25));
        assert_eq!(opacity("1").unwrap().name, None);
        assert!(opacity("2").is_err() && opacity("a=").is_err() && opacity("nan").is_err());
        assert_eq!(degrees("4, 2"), Ok([4, 2]));
        assert!(degrees("3").is_err() && degrees("0,3").is_err() && degrees("3,31").is_err());
    }
}
