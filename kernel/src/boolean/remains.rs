//! What remains of a face: all curves across it are cut where they meet, and those parts between what is
//! kept and what is not are joined to loops.

use glam::DVec2;

use super::Work;
use super::cut::{cuts, is_same, nearest};
use super::join::loops;
use crate::{Curve, Error, TrimLoop};

/// Points of the unit square nearer to each other than this are one.
const NEAR: f64 = 1e-9;

/// Curves are one if they are nearer than this.
const SAME: f64 = 1e-8;

/// Ends of parts nearer to each other than this meet: where curves touch they end within the root of rounding.
const GAP: f64 = 1e-6;

/// Parts of curves shorter than this bound nothing.
const SHORT: f64 = GAP;

/// Curves are straight if they are off a line by no more than this.
const STRAIGHT: f64 = 1e-11;

/// How far from a curve its sides are looked at, and at most as a share of its length.
const ASIDE: [f64; 2] = [1e-5, 1e-4];
const SHARE: f64 = 0.1;

/// The same as a share of the distance to the next curve.
const ROOM: f64 = 0.3;

/// Where along a curve it is looked.
const PLACES: [f64; 5] = [0.5, 0.37, 0.71, 0.13, 0.9];

/// The loops of what remains of a face that has borders when other curves cut it, none if nothing does.
/// `is_kept` tells of points of the unit square whether they remain, if that can be told;
/// asked so, not of points on both solids.
pub(super) fn remains(
    borders: &[Curve<DVec2>],
    others: &[Curve<DVec2>],
    is_kept: impl Fn(DVec2, bool) -> Option<bool>,
    work: &Work,
) -> Result<Vec<TrimLoop>, Error> {
    let all = different(borders.iter().chain(others).map(simple), SAME);
    let mut parts = Vec::new();
    for (curve, cuts) in all.iter().zip(cuts(&all, NEAR, work)?) {
        let domain = curve.domain();
        let ends: Vec<_> = [domain.start]
            .into_iter()
            .chain(cuts)
            .chain([domain.end])
            .collect();
        for range in ends.windows(2) {
            parts.push(curve.restricted(range[0]..range[1])?);
        }
    }
    let parts = parts.into_iter().filter(|part| length(part) > SHORT);
    let parts = different(parts, SAME);
    let mut kept = Vec::new();
    for (index, part) in parts.iter().enumerate() {
        work.take(1)?;
        let others = || parts.iter().enumerate().filter(|other| other.0 != index);
        let room = |point: DVec2| {
            let distances = others().map(|(_, other)| distance(other, point));
            distances.fold(f64::INFINITY, f64::min)
        };
        let [left, right] = sides(part, room, &is_kept).ok_or(Error::Boolean(
            "what is inside cannot be told where faces nearly touch",
        ))?;
        if left != right {
            kept.push(if left { part.clone() } else { part.reversed() });
        }
    }
    loops(kept, GAP).ok_or(Error::Boolean(
        "what bounds a face of the result does not close",
    ))
}

/// Whether what is on the left of a curve is kept, and what is on its right, if both can be told: at first by
/// points that are not on both solids, for those next to where surfaces touch seem to be. `room` is how far a
/// point is from what may be beside the curve.
fn sides(
    part: &Curve<DVec2>,
    room: impl Fn(DVec2) -> f64,
    is_kept: impl Fn(DVec2, bool) -> Option<bool>,
) -> Option<[bool; 2]> {
    let domain = part.domain();
    let length = length(part);
    let look = |is_apart: bool, aside: f64, place: f64| {
        let at = part.derivatives(domain.start + (domain.end - domain.start) * place);
        let left =
            at.first.perp().try_normalize()? * aside.min(length * SHARE).min(room(at.point) * ROOM);
        let told = |uv: DVec2| is_kept(uv, is_apart);
        Some([told(at.point + left)?, told(at.point - left)?])
    };
    [true, false].into_iter().find_map(|is_apart| {
        let mut looks = ASIDE
            .iter()
            .flat_map(|aside| PLACES.map(|place| (*aside, place)));
        looks.find_map(|(aside, place)| look(is_apart, aside, place))
    })
}

/// Curves without those that are the same line as one before.
fn different(curves: impl Iterator<Item = Curve<DVec2>>, near: f64) -> Vec<Curve<DVec2>> {
    let mut all: Vec<Curve<DVec2>> = Vec::new();
    for curve in curves {
        let ends = [curve.start(), curve.end()];
        let is_near = |other: &Curve<DVec2>| {
            let [start, end] = [other.start(), other.end()];
            let apart = |a: DVec2, b: DVec2| a.distance(ends[0]).max(b.distance(ends[1]));
            apart(start, end).min(apart(end, start)) <= 2.0 * near
        };
        if !all
            .iter()
            .any(|other| is_near(other) && is_same(other, &curve, near))
        {
            all.push(curve);
        }
    }
    all
}

/// The same curve, as a line if it is one.
fn simple(curve: &Curve<DVec2>) -> Curve<DVec2> {
    let (start, end) = (curve.start(), curve.end());
    let along = (end - start) / end.distance_squared(start);
    let mut last = 0.0;
    let is_straight = curve.points().all(|point| {
        let share = (point - start).dot(along);
        let is_next = share >= last;
        last = share;
        is_next && point.distance(start.lerp(end, share)) <= STRAIGHT
    });
    let line = is_straight
        .then(|| Curve::line(start, end, 0.0..1.0).ok())
        .flatten();
    line.unwrap_or_else(|| curve.clone())
}

/// The length of a curve, about.
fn length(curve: &Curve<DVec2>) -> f64 {
    let domain = curve.domain();
    let points = [0.0, 0.25, 0.5, 0.75, 1.0]
        .map(|share| curve.evaluate(domain.start + (domain.end - domain.start) * share));
    points.windows(2).map(|p| p[0].distance(p[1])).sum()
}

/// How far a point is from a curve, if it is near: no nearer than told, and not farther if that is less than [`ASIDE`].
fn distance(curve: &Curve<DVec2>, point: DVec2) -> f64 {
    let (min, max) = curve
        .points()
        .fold((DVec2::MAX, DVec2::MIN), |(min, max), p| {
            (min.min(p), max.max(p))
        });
    let apart = point.clamp(min, max).distance(point);
    if apart > ASIDE[1] / ROOM {
        apart
    } else {
        nearest(curve, point).1
    }
}
