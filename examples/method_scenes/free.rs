//! Free forms: polynomial B-splines.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use glam::DVec3;
use nurbray::formats::{Limits, open};
use nurbray::kernel::modelling::plane;
use nurbray::kernel::{KnotVector, Surface};

use super::Outcome;
use super::parts::{Numbers, Parts, ring, sheet, tube};

/// The teapot of `samples/teapot.obj` on a square.
pub(crate) fn teapot_plane() -> Outcome<Parts> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/teapot.obj");
    let teapot = open(path, &Limits::default())?.scene;
    let mut parts = Parts::upwards(teapot.up);
    parts.material("porcelain", [0.64, 0.75, 0.87], 0.4);
    for patch in teapot.patches() {
        parts.face(&patch.name, patch.surface.clone())?;
    }
    let floor = teapot.hull_bounds().min.y;
    parts.material("table", [0.82, 0.76, 0.66], 0.05);
    let origin = DVec3::new(-5.0, floor, 5.0);
    let square = plane(
        origin,
        DVec3::X * 10.0,
        DVec3::Z * -10.0,
        0.0..1.0,
        0.0..1.0,
    )?;
    parts.face("table", square)?;
    Ok(parts)
}

/// Rings along x: where, height of the middle, half width, half height.
fn along_x(stations: &[[f64; 4]], around: usize) -> Outcome<Surface> {
    let rings: Vec<_> = stations
        .iter()
        .map(|&[x, y, wide, high]| {
            let center = DVec3::new(x, y, 0.0);
            ring(center, DVec3::Z * wide, DVec3::Y * high, around)
        })
        .collect();
    tube(&rings)
}

/// The same surface elsewhere, mirrored in z where `side` is negative.
fn moved(surface: &Surface, place: DVec3, side: f64) -> Outcome<Surface> {
    let point = |p: DVec3| DVec3::new(p.x, p.y, p.z * side) + place;
    let points: Vec<_> = surface
        .points()
        .map(|p| super::parts::short(point(p)))
        .collect();
    let (u, v) = (surface.knots_u().clone(), surface.knots_v().clone());
    Ok(Surface::new(u, v, &points, None)?)
}

fn add_duck(parts: &mut Parts) -> Outcome<()> {
    parts.material("yellow", [0.96, 0.80, 0.18], 0.25);
    let body = along_x(
        &[
            [-2.05, 0.75, 0.0, 0.0],
            [-2.05, 0.75, 0.35, 0.2],
            [-1.5, 0.35, 1.0, 0.75],
            [-0.5, 0.0, 1.45, 1.15],
            [0.7, 0.05, 1.4, 1.2],
            [1.6, 0.25, 0.85, 0.85],
            [1.75, 0.3, 0.45, 0.5],
            [1.75, 0.3, 0.0, 0.0],
        ],
        10,
    )?;
    parts.face("body", body)?;
    let head = |x: f64| DVec3::new(1.15 + x, 1.75, 0.0);
    let balls = |r: f64, high: f64| {
        let rings: Vec<_> = [
            [-1.0, 0.0],
            [-1.0, 0.55],
            [0.0, 1.1],
            [1.0, 0.55],
            [1.0, 0.0],
        ]
        .map(|[y, wide]| {
            let center = DVec3::Y * (y * high);
            ring(center, DVec3::Z * (wide * r), DVec3::X * (wide * r), 8)
        })
        .to_vec();
        tube(&rings)
    };
    parts.face("head", moved(&balls(0.85, 0.85)?, head(0.0), 1.0)?)?;
    let wing = along_x(
        &[
            [-1.55, 0.75, 0.0, 0.0],
            [-1.5, 0.7, 0.1, 0.12],
            [-0.9, 0.45, 0.3, 0.5],
            [0.2, 0.25, 0.32, 0.62],
            [0.8, 0.2, 0.12, 0.3],
            [0.85, 0.2, 0.0, 0.0],
        ],
        8,
    )?;
    for side in [1.0, -1.0] {
        parts.face("wing", moved(&wing, DVec3::Z * (1.1 * side), side)?)?;
    }
    let tail = along_x(
        &[
            [-2.7, 1.25, 0.0, 0.0],
            [-2.65, 1.2, 0.3, 0.06],
            [-2.2, 0.95, 0.45, 0.22],
            [-1.6, 0.6, 0.5, 0.4],
            [-1.3, 0.4, 0.0, 0.0],
        ],
        8,
    )?;
    parts.face("tail", tail)?;
    parts.material("orange", [0.93, 0.45, 0.12], 0.3);
    for (name, y, high) in [("upper bill", 1.68, 0.15), ("lower bill", 1.5, 0.1)] {
        let bill = along_x(
            &[
                [1.7, y, 0.0, 0.0],
                [1.7, y, 0.38, high],
                [2.2, y - 0.05, 0.36, high],
                [2.6, y, 0.42, 0.6 * high],
                [2.68, y + 0.02, 0.0, 0.0],
            ],
            8,
        )?;
        parts.face(name, bill)?;
    }
    parts.material("black", [0.08, 0.08, 0.1], 0.6);
    let eye = balls(0.13, 0.13)?;
    for side in [1.0, -1.0] {
        let place = head(0.5) + DVec3::new(0.0, 0.22, 0.5 * side);
        parts.face("eye", moved(&eye, place, 1.0)?)?;
    }
    Ok(())
}

/// A bath duck of nine surfaces.
pub(crate) fn duck() -> Outcome<Parts> {
    let mut parts = Parts::default();
    add_duck(&mut parts)?;
    Ok(parts)
}

/// Three times three times three ducks: 243 surfaces, which eight bits just tell apart.
pub(crate) fn ducks27() -> Outcome<Parts> {
    let mut parts = Parts::default();
    add_duck(&mut parts)?;
    let place = |k: usize| k as f64 - 1.0;
    let places: Vec<_> = (0..27)
        .map(|k| {
            let [x, y, z] = [k % 3, k / 3 % 3, k / 9].map(place);
            DVec3::new(6.0 * x, 4.2 * y, 4.2 * z)
        })
        .collect();
    parts.repeat("duck", &places)?;
    Ok(parts)
}

/// A column with twenty flutes, on a base of rings and under a square slab.
pub(crate) fn column() -> Outcome<Parts> {
    const FLUTES: usize = 20;
    let mut parts = Parts::default();
    parts.material("marble", [0.88, 0.87, 0.83], 0.15);
    // Four control points to a flute: two on the ridge, two in the hollow.
    let profile = |radius: f64, depth: f64, y: f64| -> Vec<DVec3> {
        (0..4 * FLUTES)
            .map(|k| {
                let r = radius * if k % 4 < 2 { 1.0 } else { 1.0 - depth };
                let angle = TAU * k as f64 / (4 * FLUTES) as f64;
                DVec3::new(r * angle.cos(), y, r * angle.sin())
            })
            .collect()
    };
    let shaft: Vec<_> = [
        (1.0, 0.0, 0.0),
        (0.98, 0.13, 0.15),
        (0.98, 0.13, 2.5),
        (0.96, 0.13, 5.0),
        (0.88, 0.13, 7.5),
        (0.84, 0.13, 9.4),
        (0.84, 0.0, 9.6),
    ]
    .map(|(r, depth, y)| profile(r, depth, y))
    .to_vec();
    parts.face("shaft", tube(&shaft)?)?;
    // Rings by their profile: radius and height.
    let turned = |profile: &[[f64; 2]]| {
        let rings: Vec<_> = profile
            .iter()
            .map(|&[r, y]| ring(DVec3::Y * y, DVec3::X * r, DVec3::NEG_Z * r, 12))
            .collect();
        tube(&rings)
    };
    let bulge = |r: f64, y: f64, high: f64| {
        let bulged = [
            [r, y],
            [r + 0.3, y],
            [r + 0.42, y + 0.5 * high],
            [r + 0.3, y + high],
            [r, y + high],
        ];
        turned(&bulged)
    };
    for (y, r) in [(-0.35, 0.95), (-0.85, 1.1)] {
        parts.face("base ring", bulge(r, y, 0.4)?)?;
    }
    parts.face(
        "capital",
        turned(&[[0.84, 9.5], [0.9, 9.8], [1.35, 9.95], [1.35, 10.1]])?,
    )?;
    for (y, half, high) in [(10.1, 1.5, 0.4), (-1.35, 1.7, 0.5)] {
        slab(
            &mut parts,
            DVec3::new(-half, y, -half),
            DVec3::new(half, y + high, half),
        )?;
    }
    Ok(parts)
}

/// A box of six bilinear faces.
fn slab(parts: &mut Parts, low: DVec3, high: DVec3) -> Outcome<()> {
    let size = high - low;
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let edge = |k: usize| DVec3::AXES[k] * size[k];
        for corner in [low, low + edge(axis)] {
            let face = plane(corner, edge(u), edge(v), 0.0..1.0, 0.0..1.0)?;
            parts.face("slab", face)?;
        }
    }
    Ok(())
}

/// A flower of two rings of petals on a round leaf.
pub(crate) fn water_lily() -> Outcome<Parts> {
    let mut parts = Parts::default();
    parts.material("leaf", [0.25, 0.50, 0.24], 0.3);
    let mut numbers = Numbers(7);
    let rings: Vec<_> = [0.0, 0.3, 1.6, 3.0, 3.9, 4.2]
        .map(|r: f64| {
            let wave = |k: usize| if r > 1.0 { 0.06 * (k % 3) as f64 } else { 0.0 };
            let flat = ring(DVec3::Y * -0.1, DVec3::X * r, DVec3::NEG_Z * r, 16);
            let bent = flat.into_iter().enumerate();
            bent.map(|(k, p)| p + DVec3::Y * (wave(k) + 0.01 * r * r))
                .collect::<Vec<_>>()
        })
        .to_vec();
    parts.face("leaf", tube(&rings)?)?;
    for (count, length, rise, wide, color) in [
        (9, 2.9, 1.0, 1.0, [0.97, 0.72, 0.80]),
        (7, 2.2, 1.75, 0.85, [0.98, 0.83, 0.88]),
    ] {
        parts.material("petal", color, 0.2);
        for k in 0..count {
            let angle =
                TAU * (f64::from(k) + 0.04 * numbers.next() + 0.3 * rise) / f64::from(count);
            let out = DVec3::new(angle.cos(), 0.0, angle.sin());
            let side = out.cross(DVec3::Y);
            let row = |s: f64| -> Vec<DVec3> {
                let half = wide * (PI * (0.12 + 0.88 * s)).sin().max(0.02) * 0.9;
                let middle = out * (0.25 + length * s) + DVec3::Y * (rise * s * (0.5 + s));
                [-1.0, -0.6, 0.0, 0.6, 1.0]
                    .map(|x: f64| middle + side * (x * half) + DVec3::Y * (0.45 * half * x * x))
                    .to_vec()
            };
            let rows: Vec<_> = (0..7).map(|k| row(f64::from(k) / 6.0)).collect();
            parts.face("petal", sheet(&rows)?)?;
        }
    }
    parts.material("stamens", [0.95, 0.75, 0.2], 0.2);
    for k in 0..5 {
        let angle = TAU * f64::from(k) / 5.0;
        let (a, b) = (DVec3::X * 0.09, DVec3::Z * 0.09);
        let out = DVec3::new(angle.cos(), 0.0, angle.sin()) * 0.3;
        let rings: Vec<_> = [(0.0, 1.0), (0.5, 0.9), (0.9, 1.8), (1.1, 1.2), (1.12, 0.0)]
            .map(|(y, r)| ring(out * (1.0 + 0.5 * y) + DVec3::Y * y, b * r, a * r, 6))
            .to_vec();
        parts.face("stamen", tube(&rings)?)?;
    }
    Ok(parts)
}

/// Part of a vault of bone between two shells, and a growth under it: layers of a perturbed
/// ellipsoid with an opening, and of a small star-shaped body.
pub(crate) fn skull() -> Outcome<Parts> {
    const LAYERS: usize = 12;
    const AROUND: usize = 24;
    let mut numbers = Numbers(2011);
    let waves: Vec<[f64; 4]> = (0..6)
        .map(|_| [0, 1, 2, 3].map(|_| numbers.next()))
        .collect();
    let bump = |angle: f64, height: f64| -> f64 {
        let wave = |(k, w): (usize, &[f64; 4])| {
            let order = (k + 2) as f64;
            0.012 * w[0] * (order * angle + 3.0 * w[1]).sin() * (3.0 * w[2] * height + w[3]).cos()
        };
        waves.iter().enumerate().map(wave).sum()
    };
    // Layers from an opening at the top to one at the bottom.
    let shell = |thickness: f64| -> Vec<Vec<DVec3>> {
        (0..LAYERS)
            .map(|layer| {
                let latitude = 1.2 - 1.5 * layer as f64 / (LAYERS - 1) as f64;
                let point = |k: usize| {
                    let angle = TAU * k as f64 / AROUND as f64;
                    let r = latitude.cos() * (1.0 + bump(angle, latitude)) * thickness;
                    DVec3::new(
                        90.0 * r * angle.cos(),
                        75.0 * latitude.sin() * thickness * (1.0 + 0.3 * bump(2.0, angle)),
                        72.0 * r * angle.sin(),
                    )
                };
                (0..AROUND).map(point).collect()
            })
            .collect()
    };
    let (outer, inner) = (shell(1.0), shell(0.92));
    let mut parts = Parts::default();
    parts.material("bone", [0.90, 0.86, 0.74], 0.15);
    for rim in [0, LAYERS - 1] {
        let knots = KnotVector::clamped_uniform(1, 2, 0.0..1.0)?;
        let (out, inn) = (tube_row(&outer, rim)?, tube_row(&inner, rim)?);
        let points: Vec<_> = out.1.iter().chain(&inn.1).copied().collect();
        parts.face("rim", Surface::new(knots, out.0, &points, None)?)?;
    }
    parts.face("outer shell", tube(&outer)?)?;
    parts.face("inner shell", tube(&inner)?)?;
    parts.material("pathology", [0.72, 0.18, 0.16], 0.3);
    let growth: Vec<_> = (0..7)
        .map(|layer| {
            let latitude = PI * (f64::from(layer) / 6.0 - 0.5);
            let star = |k: usize| {
                let angle = TAU * k as f64 / 16.0;
                let r =
                    22.0 * latitude.cos() * (1.0 + 0.14 * (5.0 * angle).cos() + bump(angle, 9.0));
                DVec3::new(
                    20.0 + r * angle.cos(),
                    48.0 + 17.0 * latitude.sin(),
                    10.0 + r * angle.sin(),
                )
            };
            (0..16).map(star).collect::<Vec<_>>()
        })
        .collect();
    parts.face("pathology", tube(&growth)?)?;
    Ok(parts)
}

/// The knots and control points of the closed curve at one end of a tube.
fn tube_row(rings: &[Vec<DVec3>], row: usize) -> Outcome<(KnotVector, Vec<DVec3>)> {
    let surface = tube(rings)?;
    let count = surface.knots_v().count();
    let points = surface.points().skip(row * count).take(count).collect();
    Ok((surface.knots_v().clone(), points))
}
