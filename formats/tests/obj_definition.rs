//! Free-form elements against their definitions: every basis is evaluated here as the format
//! defines it, from the numbers of the file alone, and compared with what was read.

use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::DVec2;
use kernel::{Scene, WireShape};
use nurbray_formats::{Limits, NoFiles, ReadOptions, read};

mod definition;

use definition::{Element, elements};

/// How far points may be off, relative to the largest coordinate.
const ACCURACY: f64 = 1e-12;

fn scene(text: &str) -> Scene {
    let limits = Limits::default();
    let options = ReadOptions {
        limits: &limits,
        resolver: &NoFiles,
    };
    read(text.as_bytes(), Some("obj"), &options)
        .expect("a scene")
        .scene
}

/// The pieces of a loop or special curve: points by their definition.
fn pieces(words: &[f64], curves: &[&Element], parts: u32) -> Vec<DVec2> {
    let mut points = Vec::new();
    for piece in words.chunks(3) {
        let number = piece[2];
        let index = (0..curves.len()).find(|&i| {
            let from_end = i as f64 - curves.len() as f64;
            number.total_cmp(&(i as f64 + 1.0)).is_eq() || number.total_cmp(&from_end).is_eq()
        });
        let curve = curves[index.expect("a trim curve")];
        let at = |k: u32| piece[0] + (piece[1] - piece[0]) * f64::from(k) / f64::from(parts);
        points.extend((0..=parts).map(|k| curve.curve(at(k)).truncate()));
    }
    points
}

/// Whether a point lies inside a polygon, and whether it is so near to it that this means
/// nothing.
fn inside(polygon: &[DVec2], p: DVec2) -> (bool, bool) {
    let (mut is_inside, mut is_near) = (false, false);
    for (k, &a) in polygon.iter().enumerate() {
        let b = polygon[(k + 1) % polygon.len()];
        let way = b - a;
        let share = ((p - a).dot(way) / way.length_squared().max(1e-300)).clamp(0.0, 1.0);
        is_near |= (a + way * share).distance(p) < 2e-3;
        if (a.y > p.y) != (b.y > p.y) {
            is_inside ^= p.x < a.x + (p.y - a.y) / (b.y - a.y) * way.x;
        }
    }
    (is_inside, is_near)
}

/// Compares all elements of a text; the result counts surfaces, curves, and points of domains.
fn compare(text: &str, what: &str) -> [usize; 3] {
    let scene = scene(text);
    let elements = elements(text);
    let mut counts = [0; 3];
    let line = |source: &str| source.contains("surf");
    let mut patches = scene
        .patches()
        .iter()
        .filter(|p| line(&p.source))
        .peekable();
    let mut wires = scene.wires().iter();
    for (place, element) in elements.iter().enumerate() {
        let near = ACCURACY * element.size();
        if element.keyword == "curv" {
            let samples = element.samples(0);
            let mut met = 0;
            for wire in wires.by_ref() {
                let WireShape::Curve(curve) = &wire.shape else {
                    continue;
                };
                let domain = curve.domain();
                for &t in samples
                    .iter()
                    .filter(|t| domain.start <= **t && **t <= domain.end)
                {
                    // Where segments do not meet, an end belongs to the next one.
                    if t < domain.end || domain.end >= samples[24] {
                        let off = curve.evaluate(t).distance(element.curve(t));
                        assert!(off <= near, "{what}: curve at {t}: {off}");
                        met += 1;
                    }
                }
                counts[1] += 1;
                if domain.end >= samples[24] - 1e-12 {
                    break;
                }
            }
            assert_eq!(met, 25, "{what}");
        }
        if element.keyword == "surf" {
            let (us, vs) = (element.samples(0), element.samples(1));
            let source = &patches.peek().expect("a patch").source.clone();
            let mut met = vec![0; us.len() * vs.len()];
            while let Some(patch) = patches.next_if(|patch| &patch.source == source) {
                let surface = &patch.surface;
                let (du, dv) = (surface.knots_u().domain(), surface.knots_v().domain());
                let covers = |d: &Range<f64>, t: f64, all: &[f64]| {
                    d.start <= t && (t < d.end || (t <= d.end && t >= all[24]))
                };
                for (i, &u) in us.iter().enumerate() {
                    for (j, &v) in vs.iter().enumerate() {
                        if covers(&du, u, &us) && covers(&dv, v, &vs) {
                            let uv = DVec2::new(u, v);
                            let off = surface.evaluate(uv).distance(element.surface(uv));
                            assert!(off <= near, "{what}: surface at {uv}: {off}");
                            met[i * vs.len() + j] += 1;
                        }
                    }
                }
                counts[0] += 1;
                counts[2] += compare_trims(patch, element, &elements[..place], what);
            }
            assert!(met.iter().all(|&n| n == 1), "{what}");
            compare_special(&scene, element, &elements[..place], what);
        }
    }
    counts
}

/// The region of a face against the polygons of its loops, point by point.
fn compare_trims(
    patch: &kernel::Patch,
    element: &Element,
    before: &[Element],
    what: &str,
) -> usize {
    let curves: Vec<_> = before.iter().filter(|e| e.keyword == "curv2").collect();
    let loops = element.uses.iter().filter(|u| u.0 != "scrv");
    let loops: Vec<_> = loops
        .map(|u| (u.0.clone(), pieces(&u.1, &curves, 96)))
        .collect();
    if loops.is_empty() {
        assert!(patch.loops.is_empty(), "{what}");
        return 0;
    }
    let region = patch.region();
    let (us, vs) = (element.samples(0), element.samples(1));
    let mut count = 0;
    for k in 0..1600 {
        let share = DVec2::new(f64::from(k % 40) + 0.37, f64::from(k / 40) + 0.61) / 40.0;
        let uv = DVec2::new(
            us[0] + (us[24] - us[0]) * share.x,
            vs[0] + (vs[24] - vs[0]) * share.y,
        );
        // A trim opens a region, from which the holes that follow it are taken.
        let (mut is_in, mut open, mut is_near) = (false, loops[0].0 == "hole", false);
        for (keyword, polygon) in &loops {
            let (inside, near) = inside(polygon, uv);
            is_near |= near;
            if keyword == "trim" {
                is_in |= open;
                open = inside;
            } else {
                open &= !inside;
            }
        }
        is_in |= open;
        if !is_near {
            let found = region.as_ref().is_none_or(|region| region.contains(uv));
            assert_eq!(found, is_in, "{what}: {uv}");
            count += 1;
        }
    }
    count
}

/// Special curves lie where their points on the surface do.
fn compare_special(scene: &Scene, element: &Element, before: &[Element], what: &str) {
    let curves: Vec<_> = before.iter().filter(|e| e.keyword == "curv2").collect();
    let special = element.uses.iter().filter(|u| u.0 == "scrv");
    let wires = scene.wires().iter().filter(|w| w.source.contains("scrv"));
    for (words, wire) in special.zip(wires) {
        let WireShape::Curve(curve) = &wire.shape else {
            panic!("{what}")
        };
        let domain = curve.domain();
        for (k, uv) in pieces(&words.1, &curves, 24).into_iter().enumerate() {
            let t = domain.start + (domain.end - domain.start) * k as f64 / 24.0;
            let off = curve.evaluate(t).distance(element.surface(uv));
            assert!(
                off <= 2e-9 * element.size(),
                "{what}: special curve at {t}: {off}"
            );
        }
    }
}

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/corpus/obj")
}

#[test]
fn examples_of_the_specification_are_what_they_define() {
    // [surfaces, curves, whether it is trimmed]
    let examples = [
        ("spec_b1_bezier_patch", [1, 0, 0]),
        ("spec_b1_cardinal_curve", [0, 1, 0]),
        ("spec_b1_connectivity", [2, 0, 1]),
        ("spec_b1_ex1_taylor_curve", [0, 1, 0]),
        ("spec_b1_ex2_bezier_curve", [0, 1, 0]),
        ("spec_b1_ex4_cardinal_surface", [1, 0, 0]),
        ("spec_b1_ex5_rational_bspline_surface", [1, 0, 0]),
        ("spec_b1_ex7_two_regions_with_holes", [1, 0, 1]),
        ("spec_b1_ex8_special_curve", [1, 0, 1]),
        ("spec_b1_ex9_special_points", [1, 1, 1]),
        ("spec_b1_merging_group", [2, 0, 0]),
        ("spec_b1_stech_surface_as_printed", [1, 0, 0]),
        ("iga_pipe_section", [216, 0, 1]),
        ("k3d_nurbs", [1, 0, 0]),
        ("oxideav_bmatrix_bump", [1, 0, 0]),
        ("oxideav_rat_bezier_two_patches", [1, 0, 0]),
    ];
    for (name, [surfaces, curves, trimmed]) in examples {
        let Ok(text) = std::fs::read_to_string(corpus().join(name).with_extension("obj")) else {
            println!("{name} is not here");
            continue;
        };
        if name.starts_with("oxideav_bmatrix") {
            continue;
        }
        let found = compare(&text, name);
        assert_eq!(found[..2], [surfaces, curves], "{name}");
        assert_eq!(found[2] > 0, trimmed > 0, "{name}");
    }
    // The surface with the misprinted keyword, put right.
    let name = "spec_b1_ex3_bspline_surface_as_printed.obj";
    if let Ok(text) = std::fs::read_to_string(corpus().join(name)) {
        assert_eq!(compare(&text.replace("8surf", "surf"), name), [1, 0, 0]);
    }
}

/// Points that no symmetry flatters.
fn vertices(keyword: &str, count: u32, dimensions: usize) -> String {
    let number = |i: u32, k: u32| f64::from((i * 37 + k * 53 + i * i * 11) % 101) / 13.0 - 3.0;
    let mut text = String::new();
    for i in 0..count {
        text += keyword;
        for k in 0..u32::try_from(dimensions).expect("small") {
            text += &format!(" {:?}", number(i, k + 1));
        }
        text += &format!(" {:?}\n", 0.5 + f64::from((i * 7) % 5) / 4.0);
    }
    text
}

/// An element over all points so far, counted back from the end.
fn references(count: u32) -> String {
    (1..=count).rev().map(|k| format!(" -{k}")).collect()
}

#[test]
fn every_basis_is_what_it_is_defined_to_be() {
    const HERMITE: &str = "1 0 -3 2 0 0 3 -2 0 1 -2 1 0 0 -1 1";
    const UNIFORM: &str = "0.16666666666666666 -0.5 0.5 -0.16666666666666666 \
         0.6666666666666666 0 -1 0.5 0.16666666666666666 0.5 0.5 -0.5 0 0 0 0.16666666666666666";
    let surfaces = [
        (
            "bezier",
            "deg 3 2\n",
            "0 1 3 4",
            "-1 0.5",
            10,
            3,
            "0.5 3.5 -1 0.5",
        ),
        (
            "bspline",
            "deg 3 2\n",
            "0 1 2 3.5 4 5 7 8",
            "0 0 0 1 1.5 1.5 2 2 2",
            4,
            6,
            "3.5 4 0 2",
        ),
        (
            "cardinal",
            "deg 3 3\n",
            "0 1 3",
            "2 3 5 9",
            5,
            6,
            "0.25 3 2 9",
        ),
        ("cardinal", "", "0 1 3", "2 3", 5, 4, "0 3 2 3"),
        ("taylor", "deg 2 3\n", "0 1 4", "1 3", 6, 4, "0 4 1 3"),
        (
            "bmatrix",
            &format!("deg 3 1\nstep 2 1\nbmat u {HERMITE}\nbmat v 1 -1 0 1\n"),
            "0 1 2.5",
            "0 2 3",
            6,
            3,
            "0 2.5 0 3",
        ),
        (
            "bmatrix",
            &format!("deg 3 3\nstep 1 3\nbmat u {UNIFORM}\nbmat v {UNIFORM}\n"),
            "0 1 2",
            "0 1 2",
            5,
            7,
            "0 2 0 2",
        ),
    ];
    for (basis, setting, u, v, count_u, count_v, range) in surfaces {
        for rational in ["", "rat "] {
            // Powers of weights that begin with a small one may become negative.
            if !rational.is_empty() && matches!(basis, "taylor" | "bmatrix") {
                continue;
            }
            let count = count_u * count_v;
            let text = format!(
                "{}cstype {rational}{basis}\n{setting}surf {range}{}\nparm u {u}\nparm v {v}\nend\n",
                vertices("v", count, 3),
                references(count)
            );
            let found = compare(&text, &text);
            assert!(found[0] >= 1, "{text}");
        }
    }
}

#[test]
fn every_basis_makes_curves_and_trim_curves() {
    let kinds = [
        ("rat bezier", "deg 3\n", "0 1 2", 7, "0.25 1.75"),
        ("rat bspline", "deg 3\n", "0 0 0 0 1 2 3 3 3 3", 6, "0.5 3"),
        ("bspline", "deg 2\n", "-3 -2 -1 0 1 2 3 4", 5, "-1 2"),
        ("cardinal", "", "0 1 2 5", 6, "0 4.5"),
        ("rat cardinal", "", "0 1 2", 5, "0 2"),
        ("taylor", "deg 2\n", "0 2", 3, "0.5 1.6"),
        ("taylor", "deg 2\n", "0 2 3", 6, "0.5 3"),
        (
            "bmatrix",
            "deg 2\nstep 2\nbmat u 1 -2 1 0 2 -2 0 0 1\n",
            "0 1 3",
            5,
            "0 3",
        ),
        (
            "bmatrix",
            "deg 2\nstep 1\nbmat u 0.5 -1 0.5 0.5 1 -1 0 0 0.5\n",
            "0 1 3",
            4,
            "0 3",
        ),
    ];
    for (basis, setting, parm, count, range) in kinds {
        let text = format!(
            "{}cstype {basis}\n{setting}curv {range}{}\nparm u {parm}\nend\n",
            vertices("v", count, 3),
            references(count)
        );
        assert!(compare(&text, &text)[1] >= 1, "{text}");
    }
}

#[test]
fn regions_with_holes_of_every_direction_are_cut_out() {
    // Two regions, each with a hole in which lies another region; some loops run backwards,
    // are made of parts of one long curve, and of curves of other kinds.
    let square = |x: f64, y: f64, r: f64| {
        let corners = [(-r, -r), (r, -r), (r, r), (-r, r), (-r, -r)];
        corners
            .map(|(a, b)| format!("vp {} {}\n", x + a, y + b))
            .concat()
    };
    let mut text = String::from("cstype bezier\ndeg 1\n");
    for (x, y, r) in [
        (2.0, 2.0, 1.5),
        (2.0, 2.0, 1.0),
        (2.0, 2.0, 0.5),
        (6.0, 6.0, 1.8),
    ] {
        text += &square(x, y, r);
        text += "curv2 -5 -4 -3 -2 -1\nparm u 0 1 2 3 4\nend\n";
    }
    // A circle of four rational arcs about (6, 6).
    let w = std::f64::consts::FRAC_1_SQRT_2;
    for (x, y, weight) in [
        (7.0, 6.0, 1.0),
        (7.0, 7.0, w),
        (6.0, 7.0, 1.0),
        (5.0, 7.0, w),
        (5.0, 6.0, 1.0),
        (5.0, 5.0, w),
        (6.0, 5.0, 1.0),
        (7.0, 5.0, w),
        (7.0, 6.0, 1.0),
    ] {
        text += &format!("vp {x} {y} {weight:?}\n");
    }
    text += "cstype rat bspline\ndeg 2\ncurv2 -9 -8 -7 -6 -5 -4 -3 -2 -1\n\
             parm u 0 0 0 1 1 2 2 3 3 4 4 4\nend\n";
    text += "v 0 0 0\nv 8 0 1\nv 0 8 1\nv 8 8 0\ncstype bezier\ndeg 1 1\nsurf 0 8 0 8 1 2 3 4\n\
             parm u 0 8\nparm v 0 8\n";
    for loops in [
        "trim 0 4 1\nhole 4 0 2\ntrim 0 2 3 2 4 3\ntrim 4 0 4\nhole 0 4 -1\n",
        "hole 0 4 2\nhole 3 4 5 0 3 5\n",
        "trim 4 2 5 2 0 5\ntrim 0 4 -5\nhole 0 4 -3\n",
    ] {
        let text = format!("{text}{loops}end\n");
        let found = compare(&text, &text);
        assert!(found[2] > 1000, "{found:?}");
    }
}
