//! `nurbray volume`.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::ValueEnum;
use nurbray::kernel::{Scene, VolumeRule};
use nurbray::{Body, Measure, SliceRule, VolumeMethod, measure};
use serde_json::{Value, json};

use super::input::{self, ReadArgs};
use super::parse;
use super::say::{named, say, visible, visible_lines};
use super::sizes;

/// Measures the bodies in files: volume, area, centre of mass and inertia
///
/// Bodies are found by their borders and by rays. Volumes are exact up to the error that is
/// given: Gauss's rule takes polynomial pieces exactly and halves all others until two answers
/// agree, and trimmed faces are integrated along their trim curves. The other methods are those
/// of the literature on measured bodies, for comparison; they go along the upward axis.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Files to measure, and folders to look for files in; - reads standard input
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// How volumes are found
    #[arg(long, value_enum, default_value_t = Method::Gauss)]
    method: Method,
    /// Nodes along each parameter of a piece, for printed and midpoint [default: 10]
    #[arg(long, value_name = "N", value_parser = parse::count(2..=1000))]
    nodes: Option<u32>,
    /// Slabs of a body, for trapezoid and cavalieri [default: 20]
    #[arg(long, value_name = "N", value_parser = parse::count(1..=10_000))]
    slices: Option<u32>,
    /// One line of JSON per file
    #[arg(long)]
    json: bool,
    #[command(flatten, next_help_heading = "Reading")]
    read: ReadArgs,
}

const EXAMPLES: &str = "\
Examples:
  nurbray volume samples/sphere_torus.x3d
  nurbray volume head.x3d --json
  nurbray volume head.x3d --method midpoint --nodes 100";

/// Nodes along each parameter, unless the user wants others.
const NODES: u32 = 10;

/// Slabs of a body, unless the user wants others.
const SLICES: u32 = 20;

/// How volumes are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Method {
    /// Exact for polynomials, else adaptive; also for trimmed faces
    Gauss,
    /// The closed formula for polynomial Bezier pieces
    Formula,
    /// Nodes from border to border with equal weights: of the first order
    Printed,
    /// Nodes in the middles of equal steps: of the second order
    Midpoint,
    /// Sections and the trapezoid rule
    Trapezoid,
    /// Sections in the middle of slabs
    Cavalieri,
}

impl Args {
    /// Says which options the method does not ask for.
    fn warn_unused(&self) {
        let method = self.method();
        let nodes = matches!(
            method,
            Some(VolumeMethod::Pieces(
                VolumeRule::Printed(_) | VolumeRule::Midpoint(_)
            ))
        );
        let slices = matches!(method, Some(VolumeMethod::Slices(..)));
        for (name, idle) in [
            ("--nodes", self.nodes.is_some() && !nodes),
            ("--slices", self.slices.is_some() && !slices),
        ] {
            if idle {
                let method = format!("{:?}", self.method).to_lowercase();
                say!("nurbray: warning: {name} is not used by --method {method}");
            }
        }
    }

    fn method(&self) -> Option<VolumeMethod> {
        let nodes = self.nodes.unwrap_or(NODES) as usize;
        let slices = self.slices.unwrap_or(SLICES) as usize;
        Some(match self.method {
            Method::Gauss => return None,
            Method::Formula => VolumeMethod::Pieces(VolumeRule::Formula),
            Method::Printed => VolumeMethod::Pieces(VolumeRule::Printed(nodes)),
            Method::Midpoint => VolumeMethod::Pieces(VolumeRule::Midpoint(nodes)),
            Method::Trapezoid => VolumeMethod::Slices(SliceRule::Trapezoid, slices),
            Method::Cavalieri => VolumeMethod::Slices(SliceRule::Cavalieri, slices),
        })
    }
}

/// Measures every file; the result is how many failed.
pub(super) fn run(args: &Args) -> anyhow::Result<usize> {
    args.warn_unused();
    let mut failed = 0;
    let mut out = std::io::stdout().lock();
    for file in &input::files(&args.files)? {
        match volumes(file, args) {
            Ok(text) => write!(out, "{text}")?,
            Err(error) => {
                failed += 1;
                say!("nurbray: {error:#}");
                if args.json {
                    let name = input::display(file);
                    let line = json!({ "file": name, "error": format!("{error:#}") });
                    writeln!(out, "{line}")?;
                }
            }
        }
    }
    Ok(failed)
}

/// What there is to say about a file.
fn volumes(file: &Path, args: &Args) -> anyhow::Result<String> {
    let import = args.read.load(file)?.import;
    input::report_warnings(file, import.format, &import.warnings);
    let scene = &import.scene;
    let measure = measure(scene);
    let others = others(scene, &measure, args).with_context(|| input::display(file))?;
    if args.json {
        let mut line = sizes::to_json(&measure);
        line["file"] = input::display(file).into();
        line["unit"] = scene.unit.as_ref().map_or(Value::Null, sizes::unit);
        line["total"] = measure.total().as_ref().map_or(Value::Null, sizes::body);
        if let Some(others) = others {
            line["method"] = format!("{:?}", args.method).to_lowercase().into();
            line["volumes"] = others.into();
        }
        return Ok(format!("{line}\n"));
    }
    let unit = scene.unit.as_ref().map_or("", |unit| unit.name.as_str());
    let mut text = format!("{}:", visible(&input::display(file)));
    if !unit.is_empty() {
        let _ = write!(text, " in {unit}");
    }
    text.push('\n');
    for (k, body) in measure.bodies.iter().enumerate() {
        describe(&mut text, &named(&body.name), body);
        if let Some(other) = others.as_ref().map(|others| others[k]) {
            let method = format!("{:?}", args.method).to_lowercase();
            let off = (other / body.volume - 1.0) * 100.0;
            let _ = writeln!(text, "    {method:<9} {other:.12} ({off:+.2e} %)");
        }
    }
    match measure.total() {
        Some(total) if measure.bodies.len() > 1 => describe(&mut text, "in all", &total),
        Some(_) => {}
        None => text.push_str("  there is no closed body\n"),
    }
    if measure.open_faces > 0 {
        let faces = measure.open_faces;
        let _ = writeln!(text, "  open: {faces} faces belong to no closed body");
    }
    if measure.meshes > 0 {
        let _ = writeln!(text, "  meshes: {} are not measured", measure.meshes);
    }
    Ok(visible_lines(&text))
}

/// The volumes of all bodies by the method that is asked for, if it is another one.
fn others(scene: &Scene, measure: &Measure, args: &Args) -> anyhow::Result<Option<Vec<f64>>> {
    let Some(method) = args.method() else {
        return Ok(None);
    };
    Ok(Some(nurbray::volumes(scene, &measure.bodies, method)?))
}

fn describe(text: &mut String, name: &str, body: &Body) {
    let turned = match body.turned {
        0 => String::new(),
        turned => format!(" ({turned} of {} faces with `du x dv` inwards)", body.faces),
    };
    let [x, y, z] = [
        body.inertia.x_axis,
        body.inertia.y_axis,
        body.inertia.z_axis,
    ];
    // Writing into a string cannot fail.
    let _ = write!(
        text,
        "  {name}{turned}{}\n    volume    {:.12} (to {:.1e})\n    area      {:.12} (to {:.1e})\n    \
         centroid  {:.12} {:.12} {:.12}\n    \
         inertia   xx {:.9e} yy {:.9e} zz {:.9e} xy {:.9e} yz {:.9e} zx {:.9e}\n",
        sizes::voids(body),
        body.volume,
        body.volume_error,
        body.area,
        body.area_error,
        body.centroid.x,
        body.centroid.y,
        body.centroid.z,
        x.x,
        y.y,
        z.z,
        x.y,
        y.z,
        z.x
    );
}
