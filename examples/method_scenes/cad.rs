//! Parts as machines make them: planes, cylinders, cones, spheres and tori, all exact.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use glam::{DVec2, DVec3};
use nurbray::kernel::modelling::{Frame, arc, cone, cylinder, plane, sphere, torus};
use nurbray::kernel::{Curve, KnotVector, Patch, Surface, TrimLoop, UpAxis};

use super::Outcome;
use super::parts::{Parts, short};

/// A rectangle from `origin` along two edges, its parameters in lengths.
fn rectangle(origin: DVec3, a: DVec3, b: DVec3) -> Outcome<Surface> {
    Ok(plane(origin, a, b, 0.0..a.length(), 0.0..b.length())?)
}

/// The six faces, twelve edges and eight corners of a box with rounded edges.
fn rounded_box(parts: &mut Parts, low: DVec3, high: DVec3, radius: f64) -> Outcome<()> {
    let (a, b) = (low + radius, high - radius);
    let pick = |bits: usize| {
        DVec3::new(
            if bits & 1 == 0 { a.x } else { b.x },
            if bits & 2 == 0 { a.y } else { b.y },
            if bits & 4 == 0 { a.z } else { b.z },
        )
    };
    let size = b - a;
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let edge = |k: usize| DVec3::AXES[k] * size[k];
        let out = DVec3::AXES[axis] * radius;
        parts.face("side", rectangle(a + edge(axis) + out, edge(u), edge(v))?)?;
        parts.face("side", rectangle(a - out, edge(v), edge(u))?)?;
        for quarter in 0..4_usize {
            // The corners of the other two axes, counter-clockwise.
            let bits = [3, 2, 0, 1][quarter];
            let corner = (bits & 1) << u | (bits >> 1) << v;
            let frame = Frame::new(pick(corner), DVec3::AXES[axis], DVec3::AXES[u])?;
            let start = FRAC_PI_2 * quarter as f64;
            let round = cylinder(&frame, radius, start..start + FRAC_PI_2, 0.0..size[axis])?;
            parts.face("edge", round)?;
        }
    }
    for quarter in 0..4_usize {
        let bits = [3, 2, 0, 1][quarter];
        let start = FRAC_PI_2 * quarter as f64;
        for top in [0, 1] {
            let frame = Frame::new(pick(bits | top << 2), DVec3::Z, DVec3::X)?;
            let latitudes = if top == 1 {
                0.0..FRAC_PI_2
            } else {
                -FRAC_PI_2..0.0
            };
            let corner = sphere(&frame, radius, start..start + FRAC_PI_2, latitudes)?;
            parts.face("corner", corner)?;
        }
    }
    Ok(())
}

/// A biquadratic pillow over a rectangle of the plane z = `z`.
fn pillow(center: DVec2, half: DVec2, z: f64, rise: f64) -> Outcome<Surface> {
    let knots = KnotVector::bezier(2, 0.0..1.0)?;
    let points: Vec<_> = [-1.0, 0.0, 1.0]
        .iter()
        .flat_map(|&x: &f64| {
            [-1.0, 0.0, 1.0].map(|y: f64| {
                let up = rise * (1.0 - x.abs()) * (1.0 - y.abs()) * 4.0;
                let at = center + half * DVec2::new(x, y);
                short(at.extend(z + up))
            })
        })
        .collect();
    Ok(Surface::new(knots.clone(), knots, &points, None)?)
}

/// A telephone: a rounded body with a screen in a frame, fifteen keys and an aerial; 54 faces.
pub(crate) fn phone() -> Outcome<Parts> {
    let mut parts = Parts::upwards(UpAxis::Z);
    parts.material("case", [0.24, 0.28, 0.36], 0.5);
    rounded_box(
        &mut parts,
        DVec3::new(-25.0, -55.0, 0.0),
        DVec3::new(25.0, 55.0, 18.0),
        5.0,
    )?;
    parts.material("frame", [0.75, 0.77, 0.80], 0.6);
    let (half, middle) = (DVec2::new(15.0, 16.0), DVec2::new(0.0, 27.0));
    for (k, (sx, sy)) in [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
        .into_iter()
        .enumerate()
    {
        let corner = (middle + half * DVec2::new(sx, sy)).extend(18.0);
        let along = [DVec3::NEG_X, DVec3::NEG_Y, DVec3::X, DVec3::Y][k];
        let length = [2.0 * half.x, 2.0 * half.y][k % 2];
        let rod = Frame::new(corner, along, along.cross(DVec3::Z))?;
        let rod = cylinder(&rod, 1.5, 0.0..PI, 0.0..length)?;
        parts.face("frame", rod)?;
        let ball = Frame::new(corner, DVec3::Z, DVec3::X)?;
        let start = FRAC_PI_2 * k as f64;
        let ball = sphere(&ball, 1.5, start..start + FRAC_PI_2, 0.0..FRAC_PI_2)?;
        parts.face("frame", ball)?;
    }
    parts.material("screen", [0.45, 0.62, 0.45], 0.8);
    parts.face("screen", pillow(middle, half, 18.1, 0.3)?)?;
    parts.material("keys", [0.90, 0.90, 0.86], 0.4);
    for k in 0..15_u32 {
        let [column, row] = [k % 3, k / 3].map(f64::from);
        let center = DVec2::new(14.0 * (column - 1.0), -44.0 + 11.5 * row);
        let half = DVec2::new(5.4, 3.9);
        parts.face("key", pillow(center, half, 17.9, 1.6)?)?;
    }
    parts.material("aerial", [0.10, 0.10, 0.12], 0.4);
    let foot = Frame::new(DVec3::new(17.0, 50.0, 9.0), DVec3::Y, DVec3::X)?;
    parts.face("aerial foot", cone(&foot, 4.5, -0.15, 0.0..TAU, 0.0..10.0)?)?;
    parts.face("aerial", cylinder(&foot, 2.6, 0.0..TAU, 10.0..26.0)?)?;
    let tip = Frame::new(DVec3::new(17.0, 76.0, 9.0), DVec3::Y, DVec3::X)?;
    parts.face("aerial tip", sphere(&tip, 2.6, 0.0..TAU, 0.0..FRAC_PI_2)?)?;
    let ear = Frame::new(DVec3::new(0.0, 48.0, 18.0), DVec3::Z, DVec3::X)?;
    parts.face("earpiece", torus(&ear, 4.0, 0.8, 0.0..TAU, 0.0..PI)?)?;
    Ok(parts)
}

/// A full circle in the plane of the parameters.
fn circle(center: DVec2, radius: f64) -> Outcome<TrimLoop> {
    let (x, y) = (DVec3::X * radius, DVec3::Y * radius);
    let curve = arc(center.extend(0.0), x, y, 0.0..TAU)?;
    Ok(TrimLoop::new(vec![curve.flattened()], 1e-9)?)
}

/// A rectangle with round corners in the plane of the parameters.
fn rounded(size: DVec2, radius: f64) -> Outcome<TrimLoop> {
    let mut curves: Vec<Curve<DVec2>> = Vec::new();
    let corners = [
        (size.x - radius, size.y - radius),
        (radius, size.y - radius),
        (radius, radius),
        (size.x - radius, radius),
    ];
    for (k, (x, y)) in corners.into_iter().enumerate() {
        let start = FRAC_PI_2 * k as f64;
        let (a, b) = (DVec3::X * radius, DVec3::Y * radius);
        let round = arc(DVec3::new(x, y, 0.0), a, b, start..start + FRAC_PI_2)?.flattened();
        if let Some(last) = curves.last().map(Curve::end) {
            curves.push(Curve::line(last, round.start(), 0.0..1.0)?);
        }
        curves.push(round);
    }
    let (last, first) = (curves[curves.len() - 1].end(), curves[0].start());
    curves.push(Curve::line(last, first, 0.0..1.0)?);
    Ok(TrimLoop::new(curves, 1e-9)?)
}

/// A bearing block: a plate with round corners and four holes, on it a bored boss with fillets,
/// a countersink and an oil cup; planes are trimmed.
pub(crate) fn machine() -> Outcome<Parts> {
    let mut parts = Parts::upwards(UpAxis::Z);
    parts.material("steel", [0.62, 0.66, 0.72], 0.6);
    let (size, thick, corner) = (DVec2::new(120.0, 84.0), 14.0, 12.0);
    let holes = [(16.0, 16.0), (104.0, 16.0), (104.0, 68.0), (16.0, 68.0)].map(DVec2::from);
    let middle = size * 0.5;
    let plate = |z: f64, inner: f64| -> Outcome<Patch> {
        let edges = [DVec3::X * size.x, DVec3::Y * size.y];
        let surface = rectangle(DVec3::Z * z, edges[0], edges[1])?;
        let mut loops = vec![rounded(size, corner)?, circle(middle, inner)?];
        for hole in holes {
            loops.push(circle(hole, 6.0)?);
        }
        let mut patch = Patch::from(surface);
        patch.loops = loops;
        Ok(patch)
    };
    parts.face("bottom", plate(0.0, BORE)?)?;
    parts.face("top", plate(thick, BOSS + FILLET)?)?;
    for (k, (x, y)) in [
        (size.x - corner, size.y - corner),
        (corner, size.y - corner),
        (corner, corner),
        (size.x - corner, corner),
    ]
    .into_iter()
    .enumerate()
    {
        let frame = Frame::new(DVec3::new(x, y, 0.0), DVec3::Z, DVec3::X)?;
        let start = FRAC_PI_2 * k as f64;
        let round = cylinder(&frame, corner, start..start + FRAC_PI_2, 0.0..thick)?;
        parts.face("corner", round)?;
        let along = [DVec3::NEG_X, DVec3::NEG_Y, DVec3::X, DVec3::Y][k];
        let out = [DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y, DVec3::X][k];
        let length = [size.x, size.y][k % 2] - 2.0 * corner;
        let origin = DVec3::new(x, y, 0.0) + out * corner;
        parts.face("side", rectangle(origin, along * length, DVec3::Z * thick)?)?;
    }
    for hole in holes {
        let frame = Frame::new(hole.extend(0.0), DVec3::Z, DVec3::X)?;
        parts.face("bolt hole", cylinder(&frame, 6.0, 0.0..TAU, 0.0..thick)?)?;
    }
    boss_on(&mut parts, middle, thick)?;
    parts.material("brass", [0.85, 0.68, 0.30], 0.6);
    let out = Frame::new(
        DVec3::new(middle.x, middle.y - BOSS + 1.0, 40.0),
        DVec3::NEG_Y,
        DVec3::X,
    )?;
    parts.face("oil pipe", cylinder(&out, 3.0, 0.0..TAU, 0.0..8.0)?)?;
    let cup = Frame::new(out.origin() + DVec3::NEG_Y * 11.0, DVec3::Z, DVec3::X)?;
    parts.face(
        "oil cup",
        sphere(&cup, 5.0, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2)?,
    )?;
    Ok(parts)
}

/// Radii of the machine's boss, of the fillet around its foot, and of its bore.
const BOSS: f64 = 26.0;
const FILLET: f64 = 7.0;
const BORE: f64 = 13.0;

/// A bored boss with fillets and a countersink.
fn boss_on(parts: &mut Parts, middle: DVec2, thick: f64) -> Outcome<()> {
    let axis = |z: f64| Frame::new(middle.extend(z), DVec3::Z, DVec3::X);
    let (top, round) = (58.0, 4.0);
    let foot = torus(
        &axis(thick + FILLET)?,
        BOSS + FILLET,
        FILLET,
        0.0..TAU,
        PI..1.5 * PI,
    )?;
    parts.face("foot fillet", foot)?;
    let heights = thick + FILLET..top - round;
    parts.face("boss", cylinder(&axis(0.0)?, BOSS, 0.0..TAU, heights)?)?;
    let rim = torus(
        &axis(top - round)?,
        BOSS - round,
        round,
        0.0..TAU,
        0.0..FRAC_PI_2,
    )?;
    parts.face("rim fillet", rim)?;
    let side = 2.0 * BOSS;
    let low = (middle - 0.5 * side).extend(top);
    let mut lid = Patch::from(rectangle(low, DVec3::X * side, DVec3::Y * side)?);
    let sink = 3.0;
    let center = DVec2::splat(0.5 * side);
    lid.loops = vec![circle(center, BOSS - round)?, circle(center, BORE + sink)?];
    parts.face("lid", lid)?;
    let chamfer = cone(&axis(top - sink)?, BORE, FRAC_PI_4, 0.0..TAU, 0.0..sink)?;
    parts.face("countersink", chamfer)?;
    parts.face(
        "bore",
        cylinder(&axis(0.0)?, BORE, 0.0..TAU, 0.0..top - sink)?,
    )?;
    Ok(())
}
