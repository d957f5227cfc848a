//! `nurbray probe`.

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use glam::{DVec2, DVec3};
use nurbray::kernel::{Placement, Ray, Scene, Shape};
use nurbray::{Accelerator, Certificate, Certifier, Hit, METHODS, Workspace};
use rayon::prelude::*;
use serde_json::json;

use super::input::{self, ReadArgs};
use super::parse;

/// Rows that are read, answered in parallel and written before the next are read.
const CHUNK: usize = 1 << 14;

/// Hits this little behind the origin count as starting on the surface, relative to the
/// scene's size.
const ON_SURFACE: f64 = 1e-12;

/// Largest coordinates of directions that are used as they are: their squares, and those of their
/// squares, are numbers.
const SAFE: RangeInclusive<f64> = 1e-70..=1e70;

/// Largest coordinates of directions that are possible.
const POSSIBLE: RangeInclusive<f64> = 1e-300..=1e300;

/// Shoots rays at a file, or evaluates its surfaces, and prints numbers
///
/// Rays are rows ox,oy,oz,dx,dy,dz; the direction is not normalised and t counts in its
/// lengths. Hits are rows ray,t,x,y,z,u,v,patch,name,nx,ny,nz, nearest first, with 17
/// significant digits; a ray without a hit has no row. Patches are numbered from 0 in the
/// order of the file after instancing, meshes after them; u and v are the file's own.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
#[group(required = true, multiple = false, id = "question", args = ["rays", "uv"])]
pub(super) struct Args {
    /// File to probe; - for standard input
    file: PathBuf,
    /// Rays to shoot, CSV; - reads standard input
    #[arg(long, value_name = "CSV")]
    rays: Option<PathBuf>,
    /// Parameters to evaluate, CSV rows patch,u,v; - reads standard input
    #[arg(long, value_name = "CSV")]
    uv: Option<PathBuf>,
    /// Every hit of a ray, not just the nearest
    #[arg(long, conflicts_with = "uv")]
    all: bool,
    /// Prove what each ray meets first: one row per ray with its status (hit, miss, tangent,
    /// edge or overlap) and bounds of t; without a proof, how far the ray is free
    #[arg(long, conflicts_with_all = ["uv", "all"])]
    certify: bool,
    /// One line of JSON per row instead of CSV
    #[arg(long)]
    json: bool,
    /// Threads; 0 uses every core
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse::threads)]
    threads: usize,
    #[command(flatten)]
    read: ReadArgs,
}

const EXAMPLES: &str = "\
Examples:
  echo 0,5,0,0,-1,0 | nurbray probe samples/teapot.obj --rays - --all
  echo 0,0.5,0.5 | nurbray probe samples/teapot.obj --uv - --json";

/// Answers every row.
pub(super) fn run(args: &Args) -> anyhow::Result<usize> {
    let question = args.rays.as_ref().or(args.uv.as_ref());
    if input::is_stdin(&args.file) && question == Some(&args.file) {
        bail!("standard input holds the file or the rows, not both; name one of them");
    }
    let loaded = args.read.load(&args.file)?;
    input::report_warnings(&args.file, loaded.import.format, &loaded.import.warnings);
    let scene = &loaded.import.scene;
    let shapes = scene.numbered_placements();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads)
        .build()?;
    let mut out = BufWriter::new(std::io::stdout());
    let heading = |names| (!args.json).then_some(names);
    pool.install(|| match (&args.rays, &args.uv) {
        (Some(rays), _) if args.certify => {
            let certifier = Certifier::build(scene);
            let out = (&mut out, heading("ray,status,t_low,t_high,patch"));
            stream(rays, out, |(): &mut (), row, fields| {
                let (ray, scale) = ray(fields)?;
                let certificate = certifier.certify(&ray);
                Ok(certificate_row(row, &certificate, scale, args.json))
            })
        }
        (Some(rays), _) => {
            let accelerator = Accelerator::build(scene, &METHODS[0]);
            let prober = Prober {
                accelerator: &accelerator,
                shapes: &shapes,
                args,
            };
            let out = (&mut out, heading(Prober::HEADER));
            stream(rays, out, |workspace: &mut Workspace, row, fields| {
                let (ray, scale) = ray(fields)?;
                Ok(prober.shoot(&ray, scale, row, workspace))
            })
        }
        (None, Some(uv)) => {
            let evaluator = Evaluator {
                scene,
                shapes: &shapes,
                json: args.json,
            };
            let out = (&mut out, heading(Evaluator::HEADER));
            stream(uv, out, |(): &mut (), _, fields| evaluator.evaluate(fields))
        }
        (None, None) => bail!("give --rays or --uv"),
    })?;
    out.flush()?;
    Ok(0)
}

/// A ray, and the factor from its `t` to that of the row. A direction of which the square is out
/// of range is replaced by one of about the length 1; the factor is a power of two.
fn ray([ox, oy, oz, dx, dy, dz]: [f64; 6]) -> anyhow::Result<(Ray, f64)> {
    let (origin, mut direction) = (DVec3::new(ox, oy, oz), DVec3::new(dx, dy, dz));
    if direction == DVec3::ZERO {
        bail!("the direction 0,0,0 has no length");
    }
    let largest = direction.abs().max_element();
    let mut scale = 1.0;
    if !SAFE.contains(&largest) {
        if !POSSIBLE.contains(&largest) {
            bail!("the direction is not between 1e-300 and 1e300 long");
        }
        scale = largest.log2().floor().exp2().recip();
        direction *= scale;
    }
    Ok((Ray { origin, direction }, scale))
}

/// What is proven about a ray; fields that do not apply are empty, or null.
fn certificate_row(row: u64, certificate: &Certificate, scale: f64, as_json: bool) -> String {
    let (low, high, patch) = match *certificate {
        Certificate::Hit { shape, t } => (Some(t.low()), Some(t.high()), Some(shape)),
        Certificate::Miss => (None, None, None),
        Certificate::Ambiguous { free, .. } => (Some(free), None, None),
    };
    let [low, high] = [low, high].map(|t| t.map(|t| t * scale));
    let status = certificate.name();
    if as_json {
        let row = json!({
            "ray": row, "status": status, "t_low": low, "t_high": high, "patch": patch,
        });
        return format!("{row}\n");
    }
    let [low, high] = [low, high].map(|t| t.map_or_else(String::new, |t| csv(&[t])));
    let patch = patch.map_or_else(String::new, |patch| patch.to_string());
    format!("{row},{status},{low},{high},{patch}\n")
}

/// Reads rows of `N` numbers, answers them in parallel, and writes a heading and the answers in
/// order.
///
/// Empty lines, lines that begin with `#`, a byte order mark, and a heading of words on the first
/// line are passed over.
fn stream<const N: usize, S: Default + Send>(
    path: &Path,
    (out, heading): (&mut impl Write, Option<&str>),
    answer: impl Fn(&mut S, u64, [f64; N]) -> anyhow::Result<String> + Sync,
) -> anyhow::Result<()> {
    let name = input::display(path);
    let source: Box<dyn BufRead> = if input::is_stdin(path) {
        Box::new(std::io::stdin().lock())
    } else {
        Box::new(BufReader::new(
            File::open(path).with_context(|| name.clone())?,
        ))
    };
    if let Some(heading) = heading {
        writeln!(out, "{heading}")?;
    }
    let mut lines = source.lines().enumerate();
    let mut row = 0;
    loop {
        let mut chunk: Vec<(u64, usize, String)> = Vec::new();
        for (number, line) in lines.by_ref() {
            let mut line = line.with_context(|| format!("{name}: line {}", number + 1))?;
            if let (0, Some(rest)) = (number, line.strip_prefix('\u{feff}')) {
                line = rest.to_owned();
            }
            let text = line.trim();
            let is_heading = number == 0 && is_heading(text);
            if text.is_empty() || text.starts_with('#') || is_heading {
                continue;
            }
            chunk.push((row, number + 1, line));
            row += 1;
            if chunk.len() == CHUNK {
                break;
            }
        }
        if chunk.is_empty() {
            return Ok(());
        }
        let answers: Vec<_> = chunk
            .par_iter()
            .map_init(S::default, |state, (row, number, line)| {
                fields(line)
                    .and_then(|fields| answer(state, *row, fields))
                    .with_context(|| format!("{name}: line {number}"))
            })
            .collect();
        for answer in answers {
            out.write_all(answer?.as_bytes())?;
        }
    }
}

/// Whether a row names its columns: its first field is a word, and no number.
fn is_heading(row: &str) -> bool {
    let first = row.split(',').next().unwrap_or_default().trim();
    first.starts_with(|c: char| c.is_ascii_alphabetic()) && first.parse::<f64>().is_err()
}

fn fields<const N: usize>(line: &str) -> anyhow::Result<[f64; N]> {
    let mut fields = [0.0; N];
    let is_between = |c: char| matches!(c, ',' | ';') || c.is_whitespace();
    let mut parts = line.split(is_between).filter(|part| !part.is_empty());
    for (k, field) in fields.iter_mut().enumerate() {
        let part = parts
            .next()
            .with_context(|| format!("{k} numbers; {N} are needed"))?;
        let number = part.parse().ok().filter(|x: &f64| x.is_finite());
        *field = number.with_context(|| format!("'{part}' is not a finite number"))?;
    }
    if parts.next().is_some() {
        bail!("more than {N} numbers");
    }
    Ok(fields)
}

struct Prober<'a> {
    accelerator: &'a Accelerator<'a>,
    /// What stands at the number of a shape.
    shapes: &'a [Placement],
    args: &'a Args,
}

impl Prober<'_> {
    const HEADER: &'static str = "ray,t,x,y,z,u,v,patch,name,nx,ny,nz";

    fn shoot(&self, ray: &Ray, scale: f64, row: u64, workspace: &mut Workspace) -> String {
        let size = self.accelerator.bounds().diagonal();
        let range = -ON_SURFACE * size / ray.direction.length()..f64::INFINITY;
        let mut hits = Vec::new();
        if self.args.all {
            self.accelerator.all(ray, range, workspace, &mut hits);
        } else {
            hits.extend(self.accelerator.nearest(ray, range, workspace));
        }
        hits.iter()
            .map(|hit| self.format(row, hit, scale))
            .collect()
    }

    fn format(&self, row: u64, hit: &Hit, scale: f64) -> String {
        let at = &self.shapes[hit.shape as usize];
        let name = self.accelerator.scene().name_at(at);
        let (t, p, n, uv) = (hit.t.max(0.0) * scale, hit.point, hit.normal, hit.uv);
        if self.args.json {
            let hit = json!({
                "ray": row, "t": t, "x": p.x, "y": p.y, "z": p.z, "u": uv.x, "v": uv.y,
                "patch": hit.shape, "name": name, "nx": n.x, "ny": n.y, "nz": n.z,
                "tangential": hit.tangential,
            });
            return format!("{hit}\n");
        }
        let before = csv(&[t, p.x, p.y, p.z, uv.x, uv.y]);
        let normal = csv(&[n.x, n.y, n.z]);
        format!("{row},{before},{},{},{normal}\n", hit.shape, quoted(name))
    }
}

struct Evaluator<'a> {
    scene: &'a Scene,
    /// What stands at the number of a shape.
    shapes: &'a [Placement],
    json: bool,
}

impl Evaluator<'_> {
    const HEADER: &'static str = "patch,u,v,x,y,z,dux,duy,duz,dvx,dvy,dvz,\
        duux,duuy,duuz,duvx,duvy,duvz,dvvx,dvvy,dvvz,nx,ny,nz";

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked above"
    )]
    fn evaluate(&self, [number, u, v]: [f64; 3]) -> anyhow::Result<String> {
        let is_patch = |at: &Placement| matches!(at.shape, Shape::Patch(_));
        let count = self.shapes.partition_point(is_patch);
        let number = if number >= 0.0 && number.fract() == 0.0 {
            number as usize
        } else {
            count
        };
        let Some((at, Shape::Patch(id))) = self.shapes.get(number).map(|at| (at, at.shape)) else {
            match count.checked_sub(1) {
                Some(last) => bail!("no such patch; they are numbered from 0 to {last}"),
                None => bail!("no such patch; the file has none"),
            }
        };
        let (surface, world) = (&self.scene.patch(id).surface, at.world_from_object);
        for (name, x, domain) in [
            ("u", u, surface.knots_u().domain()),
            ("v", v, surface.knots_v().domain()),
        ] {
            if !(domain.start <= x && x <= domain.end) {
                bail!(
                    "{name} = {x} lies outside {} to {}",
                    domain.start,
                    domain.end
                );
            }
        }
        let uv = DVec2::new(u, v);
        let d = surface.derivatives(uv);
        let point = world.transform_point3(d.point);
        let [du, dv, duu, duv, dvv] =
            [d.du, d.dv, d.duu, d.duv, d.dvv].map(|x| world.transform_vector3(x));
        let normal = surface
            .normal(uv)
            .and_then(|normal| kernel::moved_normal(normal, &world))
            .unwrap_or(DVec3::ZERO);
        if self.json {
            let row = json!({
                "patch": number, "u": u, "v": v, "name": self.scene.name_at(at),
                "point": point.to_array(), "du": du.to_array(), "dv": dv.to_array(),
                "duu": duu.to_array(), "duv": duv.to_array(), "dvv": dvv.to_array(),
                "normal": normal.to_array(),
            });
            return Ok(format!("{row}\n"));
        }
        let vectors = [point, du, dv, duu, duv, dvv, normal].map(|x| x.to_array());
        Ok(format!(
            "{number},{},{}\n",
            csv(&[u, v]),
            csv(vectors.as_flattened())
        ))
    }
}

/// Numbers with 17 significant digits.
fn csv(numbers: &[f64]) -> String {
    numbers
        .iter()
        .map(|x| format!("{x:.16e}"))
        .collect::<Vec<_>>()
        .join(",")
}

/// A name as a CSV field.
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}
