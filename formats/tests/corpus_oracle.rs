//! Real IGES files, if they are there, against what another program finds in them: faces,
//! boxes and areas.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "helpers of tests are tests, too"
)]

use std::path::Path;

use glam::{DVec2, DVec3};
use kernel::{Aabb, Child, Curve, Patch, Scene, Shape, WireShape};
use serde_json::Value;

/// Cells of the grid over a face, along each parameter.
const CELLS: u32 = 60;

/// A face as it is placed: its area, and a box around points of it.
struct Measured {
    source: String,
    area: f64,
    bounds: Aabb,
}

/// Sums over a grid in the box of the loops.
fn measure(patch: &Patch, millimetres: f64, world: glam::DAffine3, cells: u32) -> Measured {
    let surface = &patch.surface;
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let (mut min, mut max) = (DVec2::new(u.start, v.start), DVec2::new(u.end, v.end));
    if !patch.loops.is_empty() {
        let points = || {
            let curves = patch.loops.iter().flat_map(|l| l.segments());
            curves.flat_map(Curve::points)
        };
        min = min.max(points().fold(DVec2::INFINITY, DVec2::min));
        max = max.min(points().fold(DVec2::NEG_INFINITY, DVec2::max));
    }
    let region = patch.region();
    let contains = |uv: DVec2| region.as_ref().is_none_or(|region| region.contains(uv));
    let size = (max - min) / f64::from(cells);
    let (mut area, mut bounds) = (0.0, Aabb::EMPTY);
    let place = |point: DVec3| world.transform_point3(point) * millimetres;
    for j in 0..cells {
        let v = min.y + size.y * (f64::from(j) + 0.5);
        let at = |u: f64| DVec2::new(u, v);
        let mut before = contains(at(min.x + size.x * 1e-9));
        for i in 0..cells {
            let (mut start, mut end) = (min.x + size.x * f64::from(i), 0.0);
            end += start + size.x;
            let after = contains(at(end - size.x * 1e-9));
            if before != after {
                // Where the row crosses a loop.
                let (mut low, mut high) = (start, end);
                for _ in 0..40 {
                    let middle = f64::midpoint(low, high);
                    let same = contains(at(middle)) == before;
                    *(if same { &mut low } else { &mut high }) = middle;
                }
                *(if before { &mut end } else { &mut start }) = low;
            }
            if before || after {
                for share in [0.5 - 0.5 / 3.0_f64.sqrt(), 0.5 + 0.5 / 3.0_f64.sqrt()] {
                    let d = surface.derivatives(at(start + (end - start) * share));
                    let [du, dv] = [d.du, d.dv].map(|d| world.transform_vector3(d) * millimetres);
                    area += 0.5 * du.cross(dv).length() * (end - start) * size.y;
                    bounds = bounds.including(place(d.point));
                }
            }
            before = after;
        }
    }
    let mut include = |uv: DVec2| {
        let inside = uv.max(min).min(max);
        bounds = bounds.including(place(surface.evaluate(inside)));
    };
    if patch.loops.is_empty() {
        for k in 0..=cells {
            let at = min + (max - min) * (f64::from(k) / f64::from(cells));
            for uv in [[at.x, min.y], [at.x, max.y], [min.x, at.y], [max.x, at.y]] {
                include(uv.into());
            }
        }
    }
    for curve in patch.loops.iter().flat_map(|l| l.segments()) {
        let domain = curve.domain();
        for k in 0..=32 {
            let t = domain.start + (domain.end - domain.start) * f64::from(k) / 32.0;
            include(curve.evaluate(t));
        }
    }
    Measured {
        source: patch.source.clone(),
        area,
        bounds,
    }
}

fn faces(scene: &Scene, cells: u32) -> Vec<Measured> {
    let millimetres = scene.unit.as_ref().map_or(1.0, |unit| unit.metres * 1e3);
    let placed = scene
        .placements()
        .into_iter()
        .filter_map(|p| match p.shape {
            Shape::Patch(id) => Some((id, p.world_from_object)),
            Shape::Mesh(_) => None,
        });
    placed
        .map(|(id, world)| measure(scene.patch(id), millimetres, world, cells))
        .collect()
}

/// A box around points of all curves and points, as they are placed.
fn wires(scene: &Scene) -> Aabb {
    let millimetres = scene.unit.as_ref().map_or(1.0, |unit| unit.metres * 1e3);
    let mut bounds = Aabb::EMPTY;
    let mut stack: Vec<_> = scene
        .root()
        .map(|root| (root, glam::DAffine3::IDENTITY))
        .into_iter()
        .collect();
    while let Some((id, world)) = stack.pop() {
        let node = scene.node(id);
        let world = world * node.parent_from_node;
        for &wire in &node.wires {
            let points = match &scene.wire(wire).shape {
                WireShape::Points(points) => points.clone(),
                WireShape::Curve(curve) => {
                    let domain = curve.domain();
                    let at =
                        |k: u32| domain.start + (domain.end - domain.start) * f64::from(k) / 512.0;
                    (0..=512).map(|k| curve.evaluate(at(k))).collect()
                }
            };
            let points = points
                .into_iter()
                .map(|p| world.transform_point3(p) * millimetres);
            bounds = bounds.union(Aabb::around(points));
        }
        stack.extend(node.children.iter().filter_map(|child| match child {
            Child::Node(id) => Some((*id, world)),
            Child::Item(_) => None,
        }));
    }
    bounds
}

#[test]
#[ignore = "takes minutes"]
fn real_files_agree_with_the_oracle() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/corpus");
    let Ok(text) = std::fs::read_to_string(corpus.join("oracle.json")) else {
        return;
    };
    let oracle: serde_json::Map<String, Value> = serde_json::from_str(&text).unwrap();
    let wanted = std::env::var("FILES").unwrap_or_default();
    let cells = std::env::var("CELLS")
        .ok()
        .and_then(|c| c.parse().ok())
        .unwrap_or(CELLS);
    for (name, entry) in oracle.iter().filter(|(name, _)| name.starts_with("iges/")) {
        if !name.contains(&wanted) {
            continue;
        }
        let started = std::time::Instant::now();
        let result = nurbray_formats::open(corpus.join(name), &Default::default());
        let took = started.elapsed();
        let count = entry["n_faces"].as_u64();
        let import = match result {
            Ok(import) => import,
            Err(error) => {
                println!("{name}: {error}; expected faces {count:?}");
                continue;
            }
        };
        let found = faces(&import.scene, cells);
        let area: f64 = found.iter().map(|f| f.area).sum();
        let expected = entry["area"].as_f64().unwrap_or(0.0);
        let wires = wires(&import.scene);
        let bounds = found.iter().fold(wires, |b, f| b.union(f.bounds));
        let numbers: Vec<f64> = entry["bbox"].as_array().map_or_else(Vec::new, |list| {
            list.iter().filter_map(Value::as_f64).collect()
        });
        let off = match numbers.as_slice() {
            [a, b, c, d, e, f] if !bounds.is_empty() => {
                let wanted = [DVec3::new(*a, *b, *c), DVec3::new(*d, *e, *f)];
                let off = (bounds.min - wanted[0])
                    .abs()
                    .max((bounds.max - wanted[1]).abs());
                off.max_element() / wanted[0].distance(wanted[1])
            }
            _ => 0.0,
        };
        let wires = import.scene.wires().len();
        let warnings: usize = import.warnings.as_slice().iter().map(|w| w.count).sum();
        let mark = |bad: bool| if bad { "  <<<" } else { "" };
        let count = count.unwrap_or(0) as usize;
        println!(
            "{name}: {} faces of {count}{}, area {:+.1e}{}, box {off:.1e}{}, {wires} wires, \
             {warnings} warnings, {took:?}",
            found.len(),
            mark(found.len() != count),
            area / expected - 1.0,
            mark(expected > 0.0 && (area / expected - 1.0).abs() > 2e-3),
            mark(off > 2e-3),
        );
        for warning in import.warnings.as_slice() {
            println!("      {}: {warning}", warning.problem.kind());
        }
        compare(&found, &entry["faces"]);
    }
}

/// Prints faces whose areas have no partner.
fn compare(found: &[Measured], expected: &Value) {
    let Some(list) = expected.as_array() else {
        return;
    };
    let area = |face: &Value| face[2].as_f64();
    let mut left: Vec<Option<f64>> = list.iter().map(area).collect();
    let mut printed = 0;
    for (index, face) in found.iter().enumerate() {
        let near = |x: &Option<f64>| x.is_some_and(|x| (x / face.area - 1.0).abs() < 0.004);
        let same = left.get(index).filter(|x| near(x)).map(|_| index);
        match same.or_else(|| left.iter().position(near)) {
            Some(k) => left[k] = None,
            None if printed < 12 => {
                printed += 1;
                let there = list.get(index);
                println!(
                    "      {}: area {:.6e}, theirs {there:?}",
                    face.source, face.area
                );
            }
            None => printed += 1,
        }
    }
    if printed > 0 {
        println!("      {printed} faces without a partner");
    }
}
