//! Where two Bézier pieces meet: they are halved until it is plain that they do not, that they cross in
//! one line, or that they are parts of one surface.

use glam::{DVec2, DVec3, DVec4};

use super::Work;
use super::face::Piece;
use super::pair::{Pair, foot};
use super::trace::Trace;
use crate::{Aabb, BezierSurface, Error};

/// Halves smaller than this share of a piece are not halved: what meets there only, touches.
const SMALLEST: f64 = 1.0 / 2048.0;

/// Halves larger than this share of a piece are halved if they are not flat.
const LARGEST: f64 = 1.0 / 64.0;

/// Surfaces that cross by a lesser sine touch.
const TOUCHING: f64 = 1e-4;

/// Pairs of halves looked at, at most.
const MOST: usize = 400_000;

/// Surfaces are one if they are nearer than this share of the size of the solids.
const SAME: f64 = 1e-9;

/// How two pieces meet.
pub(super) enum Meeting {
    /// Along curves, if at all.
    Along(Vec<Trace>),
    /// They are parts of one surface.
    Same,
}

/// Directions in which normals look: all are within an angle from one.
struct Cone {
    axis: DVec3,
    angle: f64,
}

/// How two pieces of solids of a size meet.
pub(super) fn meeting(
    first: &Piece,
    second: &Piece,
    size: f64,
    work: &Work,
) -> Result<Meeting, Error> {
    let pair = Pair {
        first: &first.surface,
        second: &second.surface,
        size,
    };
    let mut traces: Vec<Trace> = Vec::new();
    let mut todo = vec![[first.net.clone(), second.net.clone()]];
    let mut looked = 0;
    while let Some([a, b]) = todo.pop() {
        work.take(1)?;
        looked += 1;
        if looked > MOST {
            return Err(Error::Boolean(
                "two faces touch each other in too many places",
            ));
        }
        if !may_meet(&a, &b, size) {
            continue;
        }
        let cones = [cone(&a, pair.first), cone(&b, pair.second)];
        let widths = [width(&a, first), width(&b, second)];
        let width = widths[0].max(widths[1]);
        match crossing(&cones) {
            Some(flatness) if flatness < 0.25 || width <= LARGEST => {
                let found = pair.settled(center(&a, &b), None);
                let found = found.filter(|&at| is_in(at, &a, &b));
                let found = found.filter(|&at| pair.course(at).is_some_and(|c| c.sine > TOUCHING));
                if let Some(at) = found {
                    if !traces.iter().any(|trace| trace.has(at)) {
                        traces.extend(Trace::new(&pair, at));
                    }
                    continue;
                }
            }
            Some(_) => {}
            None if width > LARGEST && are_same(&a, &pair) => return Ok(Meeting::Same),
            None => {}
        }
        if width > SMALLEST {
            todo.extend(halved(&a, &b, widths));
        }
    }
    Ok(Meeting::Along(traces))
}

/// Whether boxes of parts of solids of a size meet or nearly do.
pub(super) fn nearly_meet(first: &Aabb, second: &Aabb, size: f64) -> bool {
    let near = DVec3::splat(SAME * size);
    let (min, max) = (first.min - near, first.max + near);
    Aabb { min, max }.meets(second)
}

/// Whether the hulls of two pieces meet, as far as boxes and the ways across them tell.
fn may_meet(a: &BezierSurface, b: &BezierSurface, size: f64) -> bool {
    let near = SAME * size;
    if !nearly_meet(&a.hull_bounds(), &b.hull_bounds(), size) {
        return false;
    }
    let apart = |across: DVec3| {
        let range = |net: &BezierSurface| {
            net.points()
                .map(|p| p.dot(across))
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                    [low.min(x), high.max(x)]
                })
        };
        let ([low, high], [least, most]) = (range(a), range(b));
        low > most + near || least > high + near
    };
    ![a, b].into_iter().filter_map(across).any(apart)
}

/// The direction across a net by its corners.
fn across(net: &BezierSurface) -> Option<DVec3> {
    let points = net.homogeneous();
    let row = net.degree_v() + 1;
    let corner = |i: usize| points[i].truncate() / points[i].w;
    let last = points.len() - 1;
    let [a, b, c, d] = [0, row - 1, last + 1 - row, last].map(corner);
    (d - a).cross(c - b).try_normalize()
}

/// The directions of the normals of a part of a surface, by nine of them.
fn cone(part: &BezierSurface, surface: &crate::Surface) -> Option<Cone> {
    let (u, v) = (part.u(), part.v());
    // Not at the very borders, where surfaces may be drawn together in a point.
    let shares = [0.02, 0.5, 0.98];
    let mut normals = [DVec3::ZERO; 9];
    for (i, normal) in normals.iter_mut().enumerate() {
        let at = DVec2::new(
            u.start + (u.end - u.start) * shares[i % 3],
            v.start + (v.end - v.start) * shares[i / 3],
        );
        let (_, [du, dv]) = surface.tangents(at);
        *normal = du.cross(dv).try_normalize()?;
    }
    let axis = normals.iter().sum::<DVec3>().try_normalize()?;
    let angle = |n: &DVec3| n.cross(axis).length().atan2(n.dot(axis));
    let angle = normals.iter().map(angle).fold(0.0, f64::max);
    Some(Cone { axis, angle })
}

/// If no normals of two parts have a direction in common: by how much the parts bend, as a share of the angle
/// between them.
fn crossing([a, b]: &[Option<Cone>; 2]) -> Option<f64> {
    let (a, b) = (a.as_ref()?, b.as_ref()?);
    let sine = a.axis.cross(b.axis).length();
    let between = sine.atan2(a.axis.dot(b.axis).abs());
    let bend = a.angle + b.angle;
    (between > 1.2 * bend + TOUCHING).then_some(bend / between)
}

/// Whether a part of the first surface lies on the second one.
fn are_same(part: &BezierSurface, pair: &Pair<'_>) -> bool {
    let (u, v) = (part.u(), part.v());
    let mut guess = DVec2::splat(0.5);
    for (x, y) in [(0.5, 0.5), (0.1, 0.2), (0.8, 0.1), (0.9, 0.7), (0.3, 0.9)] {
        let at = DVec2::new(
            u.start + (u.end - u.start) * x,
            v.start + (v.end - v.start) * y,
        );
        let point = pair.first.evaluate(at);
        let Some(found) = foot(pair.second, point, guess, pair.size) else {
            return false;
        };
        if pair.second.evaluate(found).distance(point) > SAME * pair.size {
            return false;
        }
        guess = found;
    }
    true
}

/// The larger of two parts in halves, across its longer side, of those that are not smallest.
fn halved(a: &BezierSurface, b: &BezierSurface, widths: [f64; 2]) -> [[BezierSurface; 2]; 2] {
    let longest = |part: &BezierSurface| sides(part).into_iter().fold(0.0, f64::max);
    let is_first = widths[1] <= SMALLEST || (widths[0] > SMALLEST && longest(a) >= longest(b));
    let part = if is_first { a } else { b };
    let [along_u, along_v] = sides(part);
    let halves = if along_u >= along_v {
        part.split_u(0.5)
    } else {
        part.split_v(0.5)
    };
    halves.map(|half| {
        if is_first {
            [half, b.clone()]
        } else {
            [a.clone(), half]
        }
    })
}

/// How long a net is along u and along v, about.
fn sides(net: &BezierSurface) -> [f64; 2] {
    let points: Vec<_> = net.points().collect();
    let row = net.degree_v() + 1;
    let rows = points.chunks(row);
    let along_v = rows.map(|row| row.windows(2).map(|p| p[0].distance(p[1])).sum());
    let along_u = (0..row).map(|j| {
        let column: Vec<_> = points.iter().skip(j).step_by(row).collect();
        column.windows(2).map(|p| p[0].distance(*p[1])).sum()
    });
    [along_u.fold(0.0, f64::max), along_v.fold(0.0, f64::max)]
}

/// The longer side of a part of a piece as a share of the size of that.
fn width(part: &BezierSurface, piece: &Piece) -> f64 {
    let [along_u, along_v] = sides(part);
    along_u.max(along_v) / piece.bounds.diagonal()
}

fn center(a: &BezierSurface, b: &BezierSurface) -> DVec4 {
    let middle = |range: std::ops::Range<f64>| range.start.midpoint(range.end);
    DVec4::new(middle(a.u()), middle(a.v()), middle(b.u()), middle(b.v()))
}

/// Whether parameters are those of two parts, up to rounding.
fn is_in(at: DVec4, a: &BezierSurface, b: &BezierSurface) -> bool {
    let ranges = [a.u(), a.v(), b.u(), b.v()];
    let near = super::trace::SLACK;
    at.to_array()
        .iter()
        .zip(ranges)
        .all(|(x, range)| range.start - near <= *x && *x <= range.end + near)
}
