//! `nurbray info`.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use glam::DVec3;
use nurbray::formats::{Import, Level, Tally, Warning};
use nurbray::kernel::{Child, Item, Node, NodeId, Patch, Scene, Shape, Wire, WireShape};
use nurbray::measure;
use serde_json::{Value, json};

use super::input::{self, ReadArgs};
use super::say::{named, say, visible, visible_lines};
use super::shot::names;
use super::sizes;

/// Lines of the tree that are printed; `--json` has all.
const TREE_LINES: usize = 60;

/// Coordinates below this share of the size of a box are printed as zero; `--json` has them as they are.
const ROUNDING: f64 = 1e-12;

/// Numbers of repaired and refused entities that are printed; `--json` has all.
const NUMBERS: usize = 8;

/// Shows what is in files, and what could not be used
///
/// The tree of names, patches by degree, size and kind, free curves and points, materials,
/// box, unit, cameras, what became of the entities of each type, and every warning with its
/// places.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Files to look at, and folders to look for files in; - reads standard input
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// One line of JSON per file
    #[arg(long)]
    json: bool,
    /// Also measure the exact box, the area, and the volume of closed bodies, each with its error
    #[arg(long)]
    measure: bool,
    #[command(flatten)]
    read: ReadArgs,
}

/// Describes every file; the result is how many failed.
pub(super) fn run(args: &Args) -> anyhow::Result<usize> {
    let mut failed = 0;
    let mut out = std::io::stdout().lock();
    for file in &input::files(&args.files)? {
        match args.read.load(file) {
            Ok(loaded) => {
                let import = &loaded.import;
                let measure = args.measure.then(|| measure(&import.scene));
                if args.json {
                    let mut line = to_json(file, import);
                    if let Some(measure) = &measure {
                        line["measure"] = sizes::to_json(measure);
                    }
                    writeln!(out, "{line}")?;
                } else {
                    let sizes = measure.map(|m| sizes::to_text(&m, import.scene.unit.as_ref()));
                    let sizes = sizes.unwrap_or_default();
                    let text = visible_lines(&to_text(file, import));
                    write!(out, "{text}{}", visible_lines(&sizes))?;
                }
            }
            Err(error) => {
                failed += 1;
                say!("nurbray: {error:#}");
                if args.json {
                    let name = input::display(file);
                    writeln!(
                        out,
                        "{}",
                        json!({ "file": name, "error": format!("{error:#}") })
                    )?;
                }
            }
        }
    }
    Ok(failed)
}

/// What patches have in common when they are counted together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Kind {
    degree_u: usize,
    degree_v: usize,
    rational: bool,
    trimmed: bool,
}

impl Kind {
    fn of(patch: &Patch) -> Self {
        Self {
            degree_u: patch.surface.knots_u().degree(),
            degree_v: patch.surface.knots_v().degree(),
            rational: patch.surface.is_rational(),
            trimmed: !patch.loops.is_empty(),
        }
    }
}

/// Number of patches, and least and greatest number of control points, of each kind.
fn kinds(scene: &Scene) -> BTreeMap<Kind, (usize, usize, usize)> {
    let mut kinds = BTreeMap::new();
    for patch in scene.patches() {
        let size = patch.surface.homogeneous().len();
        let entry = kinds.entry(Kind::of(patch)).or_insert((0, size, size));
        *entry = (entry.0 + 1, entry.1.min(size), entry.2.max(size));
    }
    kinds
}

/// Shapes shown, after instancing: patches and meshes.
fn shown(scene: &Scene) -> (u64, u64) {
    let mut counts: Vec<(u64, u64)> = Vec::new();
    for node in scene.nodes() {
        let sum = node
            .children
            .iter()
            .fold((0, 0), |(p, m): (u64, u64), child| match child {
                Child::Item(Item {
                    shape: Shape::Patch(_),
                    ..
                }) => (p + 1, m),
                Child::Item(Item {
                    shape: Shape::Mesh(_),
                    ..
                }) => (p, m + 1),
                Child::Node(id) => {
                    let (a, b) = counts[id.index()];
                    (p.saturating_add(a), m.saturating_add(b))
                }
            });
        counts.push(sum);
    }
    scene.root().map_or((0, 0), |root| counts[root.index()])
}

/// How many curves and points stand for themselves.
fn wires(scene: &Scene) -> [usize; 2] {
    scene
        .wires()
        .iter()
        .fold([0, 0], |[curves, points], wire| match &wire.shape {
            WireShape::Curve(_) => [curves + 1, points],
            WireShape::Points(list) => [curves, points + list.len()],
        })
}

fn to_text(file: &Path, import: &Import) -> String {
    let mut text = format!("{}: {}\n", visible(&input::display(file)), import.format);
    // Writing into a string cannot fail.
    let _ = describe(&mut text, import);
    text
}

fn describe(text: &mut String, import: &Import) -> std::fmt::Result {
    let scene = &import.scene;
    let (patches, meshes) = shown(scene);
    writeln!(
        text,
        "  patches    {} stored, {patches} shown",
        scene.patches().len()
    )?;
    for (kind, (count, least, most)) in kinds(scene) {
        let rational = if kind.rational {
            "rational"
        } else {
            "polynomial"
        };
        let trimmed = if kind.trimmed { ", trimmed" } else { "" };
        let points = if least == most {
            format!("{least}")
        } else {
            format!("{least} to {most}")
        };
        let Kind {
            degree_u, degree_v, ..
        } = kind;
        writeln!(
            text,
            "    {count} of degree {degree_u} x {degree_v}, {rational}{trimmed}, {points} points"
        )?;
    }
    if !scene.meshes().is_empty() {
        let triangles: usize = scene.meshes().iter().map(|m| m.triangles().len()).sum();
        let stored = scene.meshes().len();
        writeln!(
            text,
            "  meshes     {stored} stored, {meshes} shown, {triangles} triangles"
        )?;
    }
    let [curves, points] = wires(scene);
    if curves + points > 0 {
        writeln!(text, "  wires      {curves} curves, {points} points")?;
    }
    let bounds = scene.hull_bounds();
    if !bounds.is_empty() {
        let grain = bounds.diagonal() * ROUNDING;
        let [min, max] = [bounds.min, bounds.max].map(|corner| {
            let tidy = |x: f64| if x.abs() < grain { 0.0 } else { x };
            DVec3::from(corner.to_array().map(tidy))
        });
        writeln!(text, "  box        {min} to {max} (control points)")?;
    }
    match &scene.unit {
        Some(unit) => writeln!(text, "  unit       {} = {} m", unit.name, unit.metres)?,
        None => writeln!(text, "  unit       not stated")?,
    }
    writeln!(text, "  up         {:?}", scene.up)?;
    for material in scene.materials() {
        writeln!(text, "  material   {}", named(&material.name))?;
    }
    for image in scene.images() {
        let (name, width, height) = (named(image.name()), image.width(), image.height());
        writeln!(text, "  picture    {name}, {width} x {height}")?;
    }
    for camera in &scene.cameras {
        writeln!(text, "  camera     {}", named(&names(camera)))?;
    }
    if !scene.lights.is_empty() {
        writeln!(text, "  lights     {}", scene.lights.len())?;
    }
    if let Some(root) = scene.root() {
        writeln!(text, "  tree")?;
        tree(text, scene, root)?;
    }
    levels(text, &import.levels)?;
    ledger(text, &import.ledger)?;
    warnings(text, import.warnings.as_slice())
}

/// A line for each level: its number, its name, and how much is on it.
fn levels(text: &mut String, levels: &[Level]) -> std::fmt::Result {
    for Level {
        number,
        name,
        count,
    } in levels
    {
        let name = if name.is_empty() {
            String::new()
        } else {
            format!(" {name}")
        };
        writeln!(text, "  level      {number}{name}: {count} shapes")?;
    }
    Ok(())
}

/// A line for each type of entity: how many there are, and what became of them.
fn ledger(text: &mut String, ledger: &[Tally]) -> std::fmt::Result {
    if !ledger.is_empty() {
        writeln!(text, "  entities")?;
    }
    for tally in ledger {
        let Tally {
            kind,
            mark,
            count,
            used,
            ..
        } = tally;
        write!(text, "    {kind}: {count} read, {} used", used.len())?;
        for (what, list) in [("repaired", &tally.repaired), ("refused", &tally.refused)] {
            if !list.is_empty() {
                let shown: Vec<_> = list
                    .iter()
                    .take(NUMBERS)
                    .map(|n| format!("{mark}{n}"))
                    .collect();
                let more = if list.len() > NUMBERS { ", ..." } else { "" };
                write!(text, ", {} {what} ({}{more})", list.len(), shown.join(", "))?;
            }
        }
        writeln!(text)?;
    }
    Ok(())
}

/// Every warning with its count and its places.
fn warnings(text: &mut String, warnings: &[Warning]) -> std::fmt::Result {
    if !warnings.is_empty() {
        writeln!(
            text,
            "  warnings   {}",
            warnings.iter().map(|w| w.count).sum::<usize>()
        )?;
    }
    for warning in warnings {
        writeln!(
            text,
            "    {} x {}: {}",
            warning.count,
            warning.problem.kind(),
            warning.problem
        )?;
        let places: Vec<_> = warning.places.iter().map(ToString::to_string).collect();
        let more = if warning.count > places.len() {
            "; ..."
        } else {
            ""
        };
        writeln!(text, "      at {}{more}", places.join("; "))?;
    }
    Ok(())
}

/// The nodes below `root`, a line each, with the number of shapes directly in them.
fn tree(text: &mut String, scene: &Scene, root: NodeId) -> std::fmt::Result {
    let mut stack = vec![(root, 0)];
    let mut lines = 0;
    while let Some((id, depth)) = stack.pop() {
        let node = scene.node(id);
        lines += 1;
        if lines > TREE_LINES {
            return writeln!(text, "    ... more nodes; --json lists all");
        }
        let count = contents(node);
        let indent = "  ".repeat(depth.min(20));
        writeln!(text, "    {indent}{}{count}", named(&node.name))?;
        stack.extend(node.children.iter().rev().filter_map(|child| match child {
            Child::Node(id) => Some((*id, depth + 1)),
            Child::Item(_) => None,
        }));
    }
    Ok(())
}

/// What a node shows itself, with triangles marked as such.
fn contents(node: &Node) -> String {
    let (mut shapes, mut meshes) = (0, 0);
    for child in &node.children {
        if let Child::Item(item) = child {
            shapes += 1;
            meshes += usize::from(matches!(item.shape, Shape::Mesh(_)));
        }
    }
    let mut parts = Vec::new();
    match (shapes, meshes) {
        (0, _) => {}
        (_, 0) => parts.push(format!("{shapes} shapes")),
        _ => parts.push(format!("{shapes} shapes, {meshes} of triangles")),
    }
    if !node.wires.is_empty() {
        parts.push(format!("{} wires", node.wires.len()));
    }
    match parts.is_empty() {
        true => String::new(),
        false => format!(" ({})", parts.join(", ")),
    }
}

fn to_json(file: &Path, import: &Import) -> Value {
    let scene = &import.scene;
    let (patches, meshes) = shown(scene);
    let by_kind: Vec<_> = kinds(scene)
        .into_iter()
        .map(|(kind, (count, least, most))| {
            json!({
                "degree_u": kind.degree_u, "degree_v": kind.degree_v,
                "rational": kind.rational, "trimmed": kind.trimmed,
                "count": count, "points_min": least, "points_max": most,
            })
        })
        .collect();
    let bounds = scene.hull_bounds();
    let bounds = (!bounds.is_empty())
        .then(|| json!({ "min": bounds.min.to_array(), "max": bounds.max.to_array() }));
    json!({
        "file": input::display(file),
        "format": import.format,
        "patches": {
            "stored": scene.patches().len(), "shown": patches, "kinds": by_kind,
            "list": scene.patches().iter().map(patch_json).collect::<Vec<_>>(),
        },
        "meshes": {
            "stored": scene.meshes().len(), "shown": meshes,
            "triangles": scene.meshes().iter().map(|m| m.triangles().len()).sum::<usize>(),
        },
        "materials": scene.materials().iter().map(|m| &m.name).collect::<Vec<_>>(),
        "pictures": scene.images().iter().map(|image| json!({
            "name": image.name(),
            "width": image.width(),
            "height": image.height(),
        })).collect::<Vec<_>>(),
        "wires": scene.wires().iter().map(wire_json).collect::<Vec<_>>(),
        "levels": import.levels.iter().map(level_json).collect::<Vec<_>>(),
        "entities": import.ledger.iter().map(tally_json).collect::<Vec<_>>(),
        "cameras": scene.cameras.iter().map(|c| &c.name).collect::<Vec<_>>(),
        "lights": scene.lights.len(),
        "box": bounds,
        "unit": scene.unit.as_ref().map(sizes::unit),
        "up": format!("{:?}", scene.up),
        "root": scene.root().map(NodeId::index),
        "nodes": scene.node_ids().map(|id| node_json(scene, id)).collect::<Vec<_>>(),
        "warnings": input::warnings_json(&import.warnings),
    })
}

fn patch_json(patch: &Patch) -> Value {
    let (u, v) = (patch.surface.knots_u(), patch.surface.knots_v());
    json!({
        "name": patch.name, "source": patch.source,
        "degree_u": u.degree(), "degree_v": v.degree(),
        "count_u": u.count(), "count_v": v.count(),
        "domain_u": [u.domain().start, u.domain().end],
        "domain_v": [v.domain().start, v.domain().end],
        "rational": patch.surface.is_rational(), "loops": patch.loops.len(),
    })
}

fn wire_json(wire: &Wire) -> Value {
    match &wire.shape {
        WireShape::Curve(curve) => json!({
            "name": wire.name, "source": wire.source, "degree": curve.degree(),
            "domain": [curve.domain().start, curve.domain().end],
            "start": curve.start().to_array(), "end": curve.end().to_array(),
        }),
        WireShape::Points(points) => json!({
            "name": wire.name, "source": wire.source,
            "points": points.iter().map(|p| p.to_array()).collect::<Vec<_>>(),
        }),
    }
}

fn level_json(level: &Level) -> Value {
    json!({ "number": level.number, "name": level.name, "count": level.count })
}

fn tally_json(tally: &Tally) -> Value {
    json!({
        "kind": tally.kind, "count": tally.count, "used": tally.used,
        "repaired": tally.repaired, "refused": tally.refused,
    })
}

fn node_json(scene: &Scene, id: NodeId) -> Value {
    let node = scene.node(id);
    let child = |child: &Child| match child {
        Child::Node(id) => json!({ "node": id.index() }),
        Child::Item(Item {
            shape: Shape::Patch(id),
            ..
        }) => json!({ "patch": id.index() }),
        Child::Item(Item {
            shape: Shape::Mesh(id),
            ..
        }) => json!({ "mesh": id.index() }),
    };
    json!({
        "name": node.name,
        "parent_from_node": node.parent_from_node.to_cols_array(),
        "children": node.children.iter().map(child).collect::<Vec<_>>(),
        "wires": node.wires.iter().map(|id| id.index()).collect::<Vec<_>>(),
    })
}
