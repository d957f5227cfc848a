//! Points along the curves on surfaces that bound faces.

use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::{Aabb, Curve};

use super::rim::Face;
use crate::segment;

/// Steps towards the nearest point of a curve, at most.
const STEPS: usize = 20;

/// A curve strays from a chord of its trail by at most about this share of the chord.
const BULGE: f64 = 0.1;

/// Points of two curves are one if their distance is this share of a chord.
const EQUAL: f64 = 1e-9;

/// Steps towards the nearest point that are shorter than this share of the range are not worth a
/// look.
const CLOSE: f64 = 1e-11;

/// Of places nearly as near the one is meant that is where it is expected: what it is away from
/// there, along the curve, counts as this share of a distance.
const ASTRAY: f64 = 0.1;

/// A chord of a trail, and the place on it that is nearest to a point.
struct Chord {
    number: usize,
    t: f64,
    /// What counts as distance there, and the least it can be.
    off: f64,
    least: f64,
}

/// Points along a curve on a surface.
#[derive(Clone, Debug)]
pub(crate) struct Trail {
    /// Parameters on the curve, and the points.
    pub(super) points: Vec<(f64, DVec3)>,
    /// How long it is up to each of them.
    lengths: Vec<f64>,
    /// A box around the curve.
    pub(super) bounds: Aabb,
}

impl Trail {
    /// Points so close that the curve between two of them is nearly straight.
    pub(crate) fn of(face: &Face<'_>, curve: &Curve<DVec2>) -> Self {
        let mut breaks = curve.knots().breaks();
        breaks.extend(face.kinks(curve));
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        let is_straight = face.pieces.are_straight() && curve.degree() == 1 && !curve.is_rational();
        let per_piece = (16 / (breaks.len() - 1)).clamp(2, 8);
        let sample = |t: f64| (t, face.point(curve.evaluate(t)));
        let mut points = vec![sample(breaks[0])];
        let share = |k: usize| k as f64 / per_piece as f64;
        for pair in breaks.windows(2) {
            let (start, end) = (points[points.len() - 1], sample(pair[1]));
            let at = |k: usize| pair[0] + (pair[1] - pair[0]) * share(k);
            if is_straight {
                let between = |k: usize| (at(k), start.1.lerp(end.1, share(k)));
                points.extend((1..per_piece).map(between));
                points.push(end);
                continue;
            }
            for k in 1..=per_piece {
                let next = if k < per_piece { sample(at(k)) } else { end };
                let last = points[points.len() - 1];
                refine(&sample, last, next, 5, &mut points);
            }
        }
        Self::new(points)
    }

    fn new(points: Vec<(f64, DVec3)>) -> Self {
        let mut lengths = vec![0.0];
        let mut length = 0.0;
        let mut bounds = Aabb::EMPTY;
        for pair in points.windows(2) {
            let (a, b) = (pair[0].1, pair[1].1);
            let chord = a.distance(b);
            length += chord;
            lengths.push(length);
            // Between its points the curve goes farther.
            let room = BULGE * chord;
            bounds = bounds.union(Aabb {
                min: a.min(b) - room,
                max: a.max(b) + room,
            });
        }
        Self {
            points,
            lengths,
            bounds,
        }
    }

    pub(super) fn length(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }

    /// The parameter of the point of the curve nearest to `target`, and its distance.
    pub(crate) fn project(
        &self,
        face: &Face<'_>,
        curve: &Curve<DVec2>,
        target: DVec3,
    ) -> (f64, f64) {
        self.search((face, curve), target, 0.0..f64::INFINITY, None)
    }

    /// The same if it is no farther than `reach`.
    pub(crate) fn project_within(
        &self,
        place: (&Face<'_>, &Curve<DVec2>),
        target: DVec3,
        reach: f64,
    ) -> Option<(f64, f64)> {
        let found = self.search(place, target, 0.0..reach, None);
        (found.1 <= reach).then_some(found)
    }

    /// The same on a curve that may come back to where it was; the place is expected as far along
    /// as parameter `t` is on another trail, from the opposite end if they are `turned`.
    pub(crate) fn project_beside(
        &self,
        place: (&Face<'_>, &Curve<DVec2>),
        target: DVec3,
        (other, t, turned): (&Self, f64, bool),
    ) -> (f64, f64) {
        let share = other.share(t);
        let share = if turned { 1.0 - share } else { share };
        let expected = Some(share * self.length());
        self.search(place, target, 0.0..f64::INFINITY, expected)
    }

    /// Whether a point of the curve is no farther from `target` than `reach`.
    pub(super) fn is_near(
        &self,
        place: (&Face<'_>, &Curve<DVec2>),
        target: DVec3,
        reach: f64,
    ) -> bool {
        self.search(place, target, reach..reach, None).1 <= reach
    }

    /// The same of a point of another trail, by its number: it is looked for first where both are equally
    /// far along, from the same ends or from opposite ones.
    pub(super) fn is_near_point(
        &self,
        place: (&Face<'_>, &Curve<DVec2>),
        (other, number): (&Self, usize),
        reach: f64,
    ) -> bool {
        let target = other.points[number].1;
        let share = other.lengths[number] / other.length();
        let start = other.points[0].1;
        let ends = [self.points[0].1, self.points[self.points.len() - 1].1];
        let is_turned = start.distance_squared(ends[1]) < start.distance_squared(ends[0]);
        let share = if is_turned { 1.0 - share } else { share };
        let (chord, t) = self.at(share * self.length());
        let is_there = |k: usize| self.points[k].1.distance_squared(target) <= reach * reach;
        if is_there(chord) || is_there(chord + 1) {
            return true;
        }
        let found = approach(place, target, t, self.around(chord), reach);
        found.1 <= reach || self.is_near(place, target, reach)
    }

    /// The parameters around a chord and its neighbours.
    fn around(&self, chord: usize) -> Range<f64> {
        let last = self.points.len() - 1;
        self.points[chord.saturating_sub(1)].0..self.points[(chord + 2).min(last)].0
    }

    /// Whether both ends and the middle are near another curve, which has a trail of its own.
    pub(super) fn runs_beside(
        &self,
        other: &Self,
        place: (&Face<'_>, &Curve<DVec2>),
        reach: f64,
    ) -> bool {
        let points = &self.points;
        let places = [0, points.len() - 1, points.len() / 2];
        let near = |k: usize| other.is_near(place, points[k].1, reach);
        places.into_iter().all(near)
    }

    /// The share of its length at which a parameter is.
    pub(super) fn share(&self, t: f64) -> f64 {
        let share = self.along(t) / self.length();
        if share.is_finite() { share } else { 0.0 }
    }

    /// How long it is up to a parameter.
    pub(super) fn along(&self, t: f64) -> f64 {
        let (points, lengths) = (&self.points, &self.lengths);
        let k = points
            .partition_point(|p| p.0 <= t)
            .clamp(1, points.len() - 1);
        let part = (t - points[k - 1].0) / (points[k].0 - points[k - 1].0);
        lengths[k - 1] + (lengths[k] - lengths[k - 1]) * part
    }

    /// The chord on which a length ends, and the parameter there.
    pub(super) fn at(&self, length: f64) -> (usize, f64) {
        let (points, lengths) = (&self.points, &self.lengths);
        let k = lengths.partition_point(|l| *l <= length);
        let k = k.clamp(1, points.len() - 1);
        let part = (length - lengths[k - 1]) / (lengths[k] - lengths[k - 1]);
        let part = if part.is_finite() {
            part.clamp(0.0, 1.0)
        } else {
            0.0
        };
        let (from, to) = (points[k - 1].0, points[k].0);
        (k - 1, from + (to - from) * part)
    }

    /// The parameter of the point of the curve at which the distance from `target` is least, together with
    /// what it is away from the length at which it is `expected`. Any distance up to the start of
    /// `wanted` is good enough, and none beyond its end is of interest.
    fn search(
        &self,
        (face, curve): (&Face<'_>, &Curve<DVec2>),
        target: DVec3,
        wanted: Range<f64>,
        expected: Option<f64>,
    ) -> (f64, f64) {
        let more = |along: f64| expected.map_or(0.0, |at| ASTRAY * (along - at).abs());
        let equal = |k: usize| EQUAL * self.points[k].1.distance(self.points[k + 1].1);
        let look = |k: usize, t: f64| {
            let enough = wanted.start.max(equal(k));
            let found = approach((face, curve), target, t, self.around(k), enough);
            (found, found.1 + more(self.along(found.0)))
        };
        let (mut best, mut least) = ((curve.domain().start, f64::INFINITY), f64::INFINITY);
        let mut seen = None;
        if let Some(length) = expected {
            let (k, t) = self.at(length);
            (best, least) = look(k, t);
            if least <= equal(k) {
                return best;
            }
            seen = Some(k);
        }
        // What is expected that much farther on can only be worse.
        let is_far = |k: usize| {
            let (from, to) = (self.lengths[k], self.lengths[k + 1]);
            let beside = |at: f64| (from - at).max(at - to);
            expected.is_some_and(|at| ASTRAY * (beside(at) - (to - from)) >= least)
        };
        let chord = |(k, w): (usize, &[(f64, DVec3)])| {
            let way = w[1].1 - w[0].1;
            let share = segment::share(target, w[0].1, w[1].1);
            let off = (w[0].1 + way * share).distance(target);
            let along = self.lengths[k] + (self.lengths[k + 1] - self.lengths[k]) * share;
            let more = more(along);
            // The curve may be nearer than its chord.
            let slack = (BULGE * way.length(), ASTRAY * way.length());
            let least = (off - slack.0).max(0.0) + (more - slack.1).max(0.0);
            Chord {
                number: k,
                t: w[0].0 + (w[1].0 - w[0].0) * share,
                off: off + more,
                least,
            }
        };
        let windows = self.points.windows(2).enumerate();
        let near = windows.filter(|(k, _)| !is_far(*k)).map(chord);
        let most = wanted.end;
        let mut chords: Vec<_> = near
            .filter(|chord| chord.least <= most && chord.least < least)
            .collect();
        loop {
            // The neighbours of what was looked at have been, too.
            let is_seen = |chord: &Chord| seen.is_some_and(|k| chord.number.abs_diff(k) <= 1);
            chords.retain(|chord| chord.least < least && !is_seen(chord));
            let nearest = chords.iter().min_by(|a, b| a.off.total_cmp(&b.off));
            let Some(&Chord { number: k, t, .. }) = nearest else {
                return best;
            };
            let (found, off) = look(k, t);
            if off < least {
                (best, least) = (found, off);
            }
            if least <= wanted.start.max(equal(k)) {
                return best;
            }
            seen = Some(k);
        }
    }

    /// The parts before and after a parameter, which both get the point there.
    pub(super) fn split(&self, at: (f64, DVec3)) -> [Self; 2] {
        let k = self.points.partition_point(|p| p.0 < at.0);
        let mut before = self.points[..k].to_vec();
        before.push(at);
        let mut after = vec![at];
        after.extend(self.points[k..].iter().filter(|p| p.0 > at.0));
        [Self::new(before), Self::new(after)]
    }
}

/// The point of a curve nearest to `target` in a range, or one that is near `enough`, by Newton's steps
/// from `t` on: its parameter and distance.
fn approach(
    (face, curve): (&Face<'_>, &Curve<DVec2>),
    target: DVec3,
    mut t: f64,
    range: Range<f64>,
    enough: f64,
) -> (f64, f64) {
    let look = |t: f64| {
        let (uv, way) = curve.tangent(t);
        face.look(uv, way)
    };
    let (mut point, mut slope, _) = look(t);
    let mut best = (t, point.distance(target));
    for _ in 0..STEPS {
        if best.1 <= enough {
            break;
        }
        let step = (target - point).dot(slope) / slope.length_squared();
        let next = (t + step).clamp(range.start, range.end);
        if !next.is_finite() || (next - t).abs() <= CLOSE * (range.end - range.start) {
            break;
        }
        (point, slope, _) = look(next);
        let distance = point.distance(target);
        if distance < best.1 {
            best = (next, distance);
        }
        t = next;
    }
    best
}

/// Appends points up to `to` so that halves are nearly as straight as the whole.
fn refine(
    sample: &impl Fn(f64) -> (f64, DVec3),
    from: (f64, DVec3),
    to: (f64, DVec3),
    depth: u32,
    out: &mut Vec<(f64, DVec3)>,
) {
    let middle = sample(0.5 * (from.0 + to.0));
    let off = middle.1.distance(from.1.midpoint(to.1));
    if depth > 0 && off > BULGE * from.1.distance(to.1) {
        refine(sample, from, middle, depth - 1, out);
        refine(sample, middle, to, depth - 1, out);
    } else {
        out.push(to);
    }
}
