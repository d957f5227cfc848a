//! Real IGES files, if they are there, against what another program finds in them: faces,
//! boxes and areas.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "helpers of tests are tests, too"
)]

use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec2, DVec3};
use kernel::{Aabb, Child, Curve, Patch, Scene, Shape, TrimRegion, WireShape};
use nurbray_formats::Limits;
use serde_json::Value;

/// Cells of the grid over a face, along each parameter.
const CELLS: u32 = 60;

/// A face as it is placed: its area, and a box around points of it.
struct Measured {
    source: String,
    area: f64,
    bounds: Aabb,
}

/// Points and weights of Gauss's rule with 8 points over 0..1.
const GAUSS: [(f64, f64); 8] = [
    (0.019_855_071_751_231_9, 0.050_614_268_145_188_1),
    (0.101_666_761_293_186_6, 0.111_190_517_226_687_2),
    (0.237_233_795_041_835_5, 0.156_853_322_938_943_6),
    (0.408_282_678_752_175_1, 0.181_341_891_689_181),
    (0.591_717_321_247_825, 0.181_341_891_689_181),
    (0.762_766_204_958_164_5, 0.156_853_322_938_943_6),
    (0.898_333_238_706_813_4, 0.111_190_517_226_687_2),
    (0.980_144_928_248_768_1, 0.050_614_268_145_188_1),
];

/// The integral of `f` over `start..end`, in `parts` equal parts.
fn integral(f: impl Fn(f64) -> f64, start: f64, end: f64, parts: u32) -> f64 {
    let parts = parts
        * std::env::var("PARTS")
            .ok()
            .and_then(|c| c.parse().ok())
            .unwrap_or(1);
    let size = (end - start) / f64::from(parts);
    let part = |k: u32| -> f64 {
        let from = start + size * f64::from(k);
        GAUSS.iter().map(|(x, w)| f(from + size * x) * w).sum()
    };
    (0..parts).map(part).sum::<f64>() * size
}

/// A patch as it is placed, in millimetres.
struct Placed<'a> {
    patch: &'a Patch,
    map: DAffine3,
    breaks: Vec<f64>,
}

impl Placed<'_> {
    /// The area over the strip of parameters with this `v` from the first `u` on, by length.
    fn strip(&self, u: f64, v: f64) -> f64 {
        let density = |u: f64| {
            let d = self.patch.surface.derivatives(DVec2::new(u, v));
            let [du, dv] = [d.du, d.dv].map(|d| self.map.transform_vector3(d));
            du.cross(dv).length()
        };
        let spans = self.breaks.windows(2).take_while(|w| w[0] < u);
        spans.map(|w| integral(density, w[0], w[1].min(u), 2)).sum()
    }

    /// Whether the face lies to the left of a piece at `t`, or to its right, or neither.
    fn side(&self, piece: &Curve<DVec2>, region: &TrimRegion, t: f64) -> Option<bool> {
        let surface = &self.patch.surface;
        let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
        let at = piece.derivatives(t);
        let size = DVec2::new(u.end - u.start, v.end - v.start);
        let aside = (at.first / size).perp().normalize_or_zero() * size;
        let contains = |uv: DVec2| {
            let is_inside = u.contains(&uv.x) && v.contains(&uv.y);
            is_inside && region.contains(uv)
        };
        // Farther aside where a loop runs a little outside of the domain.
        let sides = [1e-7, 1e-5, 1e-3]
            .map(|share| [1.0, -1.0].map(|sign| contains(at.point + aside * (sign * share))));
        let clear = sides.into_iter().find(|[left, right]| left != right);
        clear.map(|[left, _]| left)
    }

    /// What a piece of a loop adds to the area; other loops may run along it.
    fn beside(&self, piece: &Curve<DVec2>, region: &TrimRegion) -> f64 {
        let Range { start, end } = piece.domain();
        let part = |t: f64| {
            let d = piece.derivatives(t);
            if d.first.y == 0.0 {
                0.0
            } else {
                self.strip(d.point.x, d.point.y) * d.first.y
            }
        };
        let side = |t: f64| self.side(piece, region, t);
        let steps = if piece.degree() == 1 { 32 } else { 2 };
        let at = |k: u32| start + (end - start) * (f64::from(k) + 0.5) / f64::from(steps);
        let (mut sum, mut from, mut now) = (0.0, start, side(at(0)));
        let sign = |side: Option<bool>| side.map_or(0.0, |left| if left { 1.0 } else { -1.0 });
        for k in 1..steps {
            let next = side(at(k));
            if next != now {
                let (mut low, mut high) = (at(k - 1), at(k));
                for _ in 0..40 {
                    let middle = f64::midpoint(low, high);
                    *(if side(middle) == now {
                        &mut low
                    } else {
                        &mut high
                    }) = middle;
                }
                sum += sign(now) * integral(part, from, low, 4);
                (from, now) = (low, next);
            }
        }
        sum + sign(now) * integral(part, from, end, 4)
    }

    /// The area of the face, by Green's theorem.
    fn area(&self) -> f64 {
        let surface = &self.patch.surface;
        let Some(region) = self.patch.region() else {
            let end = surface.knots_u().domain().end;
            let breaks = surface.knots_v().breaks();
            let rows = breaks.windows(2);
            return rows
                .map(|w| integral(|v| self.strip(end, v), w[0], w[1], 2))
                .sum();
        };
        let segments = self.patch.loops.iter().flat_map(|l| l.segments());
        let pieces = segments.flat_map(Curve::bezier_pieces);
        pieces.map(|piece| self.beside(&piece, &region)).sum()
    }
}

/// Measures a face.
fn measure(patch: &Patch, millimetres: f64, world: DAffine3, cells: u32) -> Measured {
    let surface = &patch.surface;
    let map = DAffine3::from_scale(DVec3::splat(millimetres)) * world;
    let placed = Placed {
        patch,
        map,
        breaks: surface.knots_u().breaks(),
    };
    let area = placed.area();
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
    let mut bounds = Aabb::EMPTY;
    let place = |point: DVec3| map.transform_point3(point);
    for (i, j) in (0..=cells).flat_map(|i| (0..=cells).map(move |j| (i, j))) {
        let uv = min + (max - min) * DVec2::new(f64::from(i), f64::from(j)) / f64::from(cells);
        if contains(uv) {
            bounds = bounds.including(place(surface.evaluate(uv)));
        }
    }
    let mut include = |uv: DVec2| {
        let inside = uv.max(min).min(max);
        bounds = bounds.including(place(surface.evaluate(inside)));
    };
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
        .map(|root| (root, DAffine3::IDENTITY))
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

/// Why there is nothing to compare with.
const CONSTRUCTED: &str = "solids by construction are not imported there";

/// Files of which we show other numbers of faces, and why.
const OTHERS: [(&str, usize, &str); 12] = [
    (
        "cmp_analytic_cone_surface.igs",
        0,
        "has no end; theirs has no area",
    ),
    (
        "cmp_analytic_cylinder_surface.igs",
        0,
        "has no end; theirs has no area",
    ),
    ("cmp_colored_explicit_vertex_loop.igs", 1, "a whole sphere"),
    ("cmp_explicit_vertex_loop.igs", 1, "a whole sphere"),
    (
        "cmp_explicit_tetrahedron_solid_with_boolean.igs",
        14,
        CONSTRUCTED,
    ),
    ("brlcad_woodie.igs", 21, CONSTRUCTED),
    ("cmp_primitive_solids.igs", 27, CONSTRUCTED),
    ("cmp_procedural_and_boolean_solids.igs", 9, CONSTRUCTED),
    ("cmp_solid_assembly.igs", 2, CONSTRUCTED),
    ("cmp_solid_instance.igs", 1, CONSTRUCTED),
    (
        "made_odd_number_of_D_lines.igs",
        1,
        "its boundary is lost, its surface not",
    ),
    ("made_truncated_in_P_section.igs", 28, "cut short"),
];

/// How far areas may be off, as a share: the integrals of this test, and the rounding of
/// numbers in files.
const AREA: f64 = 1e-3;

/// Files of which the areas are not compared, and why.
const UNEVEN: [(&str, &str); 3] = [
    (
        "bench_128-004.igs",
        "sharp folds, on which all integrals disagree",
    ),
    (
        "bench_nentity.igs",
        "holds the surface of bench_128-004.igs",
    ),
    ("bench_144-000-example-1.igs", "faces are degenerate"),
];

/// The corpus, or the folder that the variable names, and what the oracle tells of it;
/// nothing where it is not at hand.
fn oracle() -> Vec<(String, PathBuf, Value)> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/corpus");
    let corpus = std::env::var("CORPUS").map_or(own, PathBuf::from);
    let Ok(text) = std::fs::read_to_string(corpus.join("oracle.json")) else {
        return Vec::new();
    };
    let oracle: serde_json::Map<String, Value> = serde_json::from_str(&text).unwrap();
    let files = oracle.into_iter().filter_map(|(path, entry)| {
        let name = path.strip_prefix("iges/")?.to_owned();
        Some((name, corpus.join(path), entry))
    });
    files.collect()
}

#[test]
fn real_files_have_the_faces_of_the_oracle() {
    for (name, path, entry) in oracle() {
        let other = OTHERS.iter().find(|(other, ..)| *other == name);
        let theirs = entry["n_faces"].as_u64().unwrap_or(0);
        let expected = other.map_or(theirs, |(_, count, _)| *count as u64);
        let found = match nurbray_formats::open(path, &Limits::default()) {
            Ok(import) => import.scene.placement_count(),
            Err(_) => 0,
        };
        assert_eq!(found, expected, "{name}");
    }
}

#[test]
#[ignore = "takes half a minute; prints a table of all files"]
fn real_files_agree_with_the_oracle() {
    // One file, and more points in each face, by these variables.
    let wanted = std::env::var("FILES").unwrap_or_default();
    let cells = std::env::var("CELLS")
        .ok()
        .and_then(|c| c.parse().ok())
        .unwrap_or(CELLS);
    let mut bad = Vec::new();
    for (name, path, entry) in oracle()
        .into_iter()
        .filter(|(name, ..)| name.contains(&wanted))
    {
        let started = std::time::Instant::now();
        let import = match nurbray_formats::open(path, &Limits::default()) {
            Ok(import) => import,
            Err(error) => {
                println!("{name}: {error}");
                continue;
            }
        };
        let took = started.elapsed();
        let found = faces(&import.scene, cells);
        let area: f64 = found.iter().map(|f| f.area).sum();
        // Two rules of integration; the second one bounds its error.
        let theirs = ["area", "area_adaptive"].map(|key| entry[key].as_f64());
        let off = theirs
            .into_iter()
            .flatten()
            .map(|theirs| (area / theirs - 1.0).abs());
        let off = off.fold(f64::INFINITY, f64::min);
        let bounds = found
            .iter()
            .fold(wires(&import.scene), |b, f| b.union(f.bounds));
        let wires = import.scene.wires().len();
        let warnings: usize = import.warnings.as_slice().iter().map(|w| w.count).sum();
        println!(
            "{name}: {} faces, area {area:e} off {off:.1e}, box off {:.1e}, {wires} wires, \
             {warnings} warnings, {took:?}",
            found.len(),
            box_off(&bounds, &entry["bbox"]),
        );
        for warning in import.warnings.as_slice() {
            println!("      {}: {warning}", warning.problem.kind());
        }
        compare(&found, &entry["faces"]);
        let is_uneven = UNEVEN.iter().any(|(uneven, _)| *uneven == name);
        if theirs[0].is_some() && !found.is_empty() && off > AREA && !is_uneven {
            bad.push(format!("{name}: {off:e}"));
        }
    }
    assert!(bad.is_empty(), "{bad:#?}");
}

/// How far two boxes are apart, relative to their size.
fn box_off(found: &Aabb, expected: &Value) -> f64 {
    let list = expected.as_array().into_iter().flatten();
    let numbers: Vec<f64> = list.filter_map(Value::as_f64).collect();
    let [a, b, c, d, e, f] = numbers[..] else {
        return 0.0;
    };
    let wanted = [DVec3::new(a, b, c), DVec3::new(d, e, f)];
    let off = (found.min - wanted[0])
        .abs()
        .max((found.max - wanted[1]).abs());
    off.max_element() / wanted[0].distance(wanted[1])
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
        let near = |x: &Option<f64>| x.is_some_and(|x| (x / face.area - 1.0).abs() < 1e-5);
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
