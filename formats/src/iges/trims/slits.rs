//! Loops of curves of space that run along a seam both ways, or along another line across the surface.
//!
//! In the parameter domain a loop does not run over itself. Where it does in space, along the seam,
//! the face is on both sides of it. That alone tells which part of a surface without a border such
//! loops bound, whichever way they run, and in whatever order: what is left without these parts of
//! the seam bounds the face or all but the face.

use std::collections::VecDeque;
use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::{ClosedLoops, Curve, Orientation, TrimLoop, TrimRegion, nearest};

use super::{ACCURACY, Trimmer};
use crate::iges::order::Chain;

/// Curves that run along a seam both ways do so over more than this share of it.
const SHARED: f64 = 1e-3;

/// Ends of curves no farther apart than this share of a seam are one place on it.
const SAME: f64 = 1e-6;

/// A place this share of the domain beside the seam is on one side of it.
const ASIDE: f64 = 1e-6;

/// Loops with more curves stay as they are.
const MANY: usize = 1000;

/// A curve runs along a seam so many times at most.
const TILES: u8 = 8;

/// The sides of a domain, counter-clockwise: the axis across, how many turns along that, and the
/// shares where it begins and ends.
const SIDES: [(usize, f64, f64, f64); 4] = [
    (1, 0.0, 0.0, 1.0),
    (0, 1.0, 0.0, 1.0),
    (1, 1.0, 1.0, 0.0),
    (0, 0.0, 1.0, 0.0),
];

impl Trimmer<'_> {
    /// The loops of chains of which some, laid onto the surface, run along its seams both ways; `None`
    /// if none do, or if that does not tell the face. The flags are for those laid onto it.
    pub(super) fn unslit(&self, chains: &[(Chain, bool)], accuracy: f64) -> Option<ClosedLoops> {
        let (rest, seam) = self.slit(chains)?;
        if rest.is_empty() {
            return self.is_boundless().then(ClosedLoops::default);
        }
        let orientation = Orientation::Unknown;
        let made = kernel::close_loops(self.surface, self.closed, rest, accuracy, orientation);
        let mut made = made.ok()?;
        let is_inside = self.holds(&made.loops, &seam)?;
        made.loops = self.cleared(&made.loops, is_inside)?;
        Some(made)
    }

    /// The same of chains that say which side of them the face is on, and have made `loops`, if the seam that
    /// they run along both ways has nothing of the face beside it: then they run the wrong way round.
    pub(super) fn turned(
        &self,
        chains: &[(Chain, bool)],
        loops: &[TrimLoop],
        accuracy: f64,
    ) -> Option<ClosedLoops> {
        let (rest, seam) = self.slit(chains)?;
        let is_lost = !rest.is_empty() && self.holds(loops, &seam) == Some(false);
        is_lost.then(|| self.unslit(chains, accuracy)).flatten()
    }

    /// What is left of chains without what runs along seams both ways, and the longest part of that.
    fn slit(&self, chains: &[(Chain, bool)]) -> Option<(Vec<Chain>, Stretch)> {
        if self.closed == [false; 2] || self.closed != [true; 2] && self.poles.is_empty() {
            return None;
        }
        let (mut rest, mut sewn) = (Vec::new(), Vec::new());
        for (chain, is_laid) in chains {
            let before = sewn.len();
            let left = if *is_laid && chain.len() <= MANY {
                self.sewn(chain, &mut sewn)
            } else {
                Chain::new()
            };
            if sewn.len() == before {
                rest.push(chain.clone());
            } else {
                rest.extend(walked(left, |uv| self.point(uv), self.accuracy)?);
            }
        }
        let longest = |a: &Stretch, b: &Stretch| a.length().total_cmp(&b.length());
        let seam = sewn.into_iter().max_by(longest)?;
        (seam.length() >= SHARED).then_some((rest, seam))
    }

    /// Whether what lies beside a part of a seam, on both sides of it, is inside of loops, or outside.
    fn holds(&self, loops: &[TrimLoop], seam: &Stretch) -> Option<bool> {
        let [u, v] = &self.domain;
        let region = TrimRegion::new(loops, u.clone(), v.clone());
        let middle = seam.from.midpoint(seam.to);
        let beside = |turns: f64| self.place(seam.axis, turns.rem_euclid(1.0), middle);
        match [ASIDE, -ASIDE].map(|aside| region.contains(beside(seam.at + aside))) {
            [true, true] => Some(true),
            [false, false] => Some(false),
            _ => None,
        }
    }

    /// The face to the left of its loops, which bound what is inside of some, or outside, and run along
    /// no part of the border of the domain twice.
    fn cleared(&self, loops: &[TrimLoop], is_inside: bool) -> Option<Vec<TrimLoop>> {
        let mut along = [const { Vec::new() }; 4];
        let mut rest = Chain::new();
        for curve in kernel::oriented(loops, DVec2::ZERO)
            .iter()
            .flat_map(TrimLoop::segments)
        {
            match self.along_side(curve) {
                Some((side, stretch)) => along[side].push(stretch),
                None if is_inside => rest.push(curve.clone()),
                None => rest.push(curve.reversed()),
            }
        }
        for ((axis, side, from, to), along) in SIDES.into_iter().zip(along) {
            let ends: Vec<_> = along.iter().flat_map(|s| [s.from, s.to]).collect();
            let at = side;
            for part in cut(&[Stretch { axis, at, from, to }], &ends) {
                let middle = part.from.midpoint(part.to);
                let is_over = |s: &&Stretch| (s.from - middle) * (s.to - middle) < 0.0;
                let is_odd = along.iter().filter(is_over).count() % 2 == 1;
                if is_odd == is_inside {
                    rest.push(self.line(&part)?);
                }
            }
        }
        let share = |uv: DVec2| {
            let [x, y] = [0, 1].map(|axis| self.turns(axis, uv));
            DVec3::new(x, y, 0.0)
        };
        let loops = walked(rest, share, 2.0 * SAME)?.into_iter();
        loops
            .map(|path| TrimLoop::new(path, f64::INFINITY).ok())
            .collect()
    }

    /// The side of the domain a curve runs along, if any, and what it runs through there.
    fn along_side(&self, curve: &Curve<DVec2>) -> Option<(usize, Stretch)> {
        let is_on = |(axis, side, ..): &(usize, f64, f64, f64)| {
            let mut turns = curve.points().map(|uv| self.turns(*axis, uv));
            turns.all(|turns| (turns - side).abs() <= ACCURACY)
        };
        let side = SIDES.iter().position(is_on)?;
        let (axis, at, ..) = SIDES[side];
        let [from, to] = [curve.start(), curve.end()].map(|uv| self.turns(1 - axis, uv));
        Some((side, Stretch { axis, at, from, to }))
    }

    /// How many turns a place is from where the domain begins.
    fn turns(&self, axis: usize, uv: DVec2) -> f64 {
        let Range { start, end } = self.domain[axis];
        (uv[axis] - start) / (end - start)
    }

    /// What is left of a chain without what runs along seams both ways, which goes to `sewn`.
    fn sewn(&self, chain: &Chain, sewn: &mut Vec<Stretch>) -> Chain {
        let mut left = chain.clone();
        for axis in (0..2).filter(|axis| self.closed[*axis]) {
            let along: Vec<_> = left.iter().map(|c| self.along_seam(axis, c)).collect();
            let stretches = along.iter().flatten();
            let ends: Vec<_> = stretches.flat_map(|s| [s.from, s.to]).collect();
            let mut parts: Vec<_> = along.iter().map(|a| cut(a, &ends)).collect();
            let mut lost = vec![false; parts.len()];
            for (k, j) in (0..parts.len()).flat_map(|k| (0..k).map(move |j| (k, j))) {
                let (before, after) = parts.split_at_mut(k);
                let count = after[0].len();
                after[0].retain(|part| {
                    let other = before[j].iter().position(|other| part.is_against(other));
                    if let Some(other) = other {
                        before[j].swap_remove(other);
                        sewn.push(*part);
                    }
                    other.is_none()
                });
                if after[0].len() < count {
                    lost[k] = true;
                    lost[j] = true;
                }
            }
            let mut kept = Chain::new();
            for ((curve, parts), is_lost) in left.into_iter().zip(parts).zip(lost) {
                if is_lost {
                    kept.extend(parts.iter().filter_map(|part| self.line(part)));
                } else {
                    kept.push(curve);
                }
            }
            left = kept;
        }
        left
    }

    /// What a curve on the seam across an axis runs through, or on a line beside it, in the domain; nothing if it
    /// is on none.
    fn along_seam(&self, axis: usize, curve: &Curve<DVec2>) -> Vec<Stretch> {
        let across = self.turns(axis, curve.start());
        if curve
            .points()
            .any(|uv| (self.turns(axis, uv) - across).abs() > ACCURACY)
        {
            return Vec::new();
        }
        let at = across - across.floor();
        let [from, to] = [curve.start(), curve.end()].map(|uv| self.turns(1 - axis, uv));
        if !self.closed[1 - axis] {
            return vec![Stretch { axis, at, from, to }];
        }
        // In parts where it passes the other seam.
        let (low, high) = (from.min(to), from.max(to));
        let first = (low + SAME).floor();
        let tiles = (0..TILES).map(|k| first + f64::from(k));
        let tiles = tiles.take_while(|tile| *tile < high - SAME);
        let part = |tile: f64| {
            let [from, to] = [from, to].map(|t| (t - tile).clamp(0.0, 1.0));
            Stretch { axis, at, from, to }
        };
        tiles.map(part).collect()
    }

    /// A place on a seam by its share of that, or so many turns beside it.
    fn place(&self, axis: usize, turns: f64, share: f64) -> DVec2 {
        let mut at = DVec2::ZERO;
        for (axis, share) in [(axis, turns), (1 - axis, share)] {
            let Range { start, end } = self.domain[axis];
            at[axis] = start + (end - start) * share;
        }
        at
    }

    /// A part of a line in the parameters of the surface.
    fn line(&self, part: &Stretch) -> Option<Curve<DVec2>> {
        let ends = [part.from, part.to];
        let [from, to] = ends.map(|share| self.place(part.axis, part.at, share));
        Curve::line(from, to, 0.0..1.0).ok()
    }

    /// Whether the surface has no border, up to poles.
    fn is_boundless(&self) -> bool {
        let is_pole = |axis: usize, side: usize| {
            nearest::pole(self.surface, axis, side, self.size * ACCURACY).is_some()
        };
        (0..2).all(|axis| self.closed[axis] || is_pole(axis, 0) && is_pole(axis, 1))
    }
}

/// Curves in any order as loops that close where their ends are, up to some distance.
fn walked(curves: Chain, at: impl Fn(DVec2) -> DVec3, near: f64) -> Option<Vec<Chain>> {
    let ends = |curve: Curve<DVec2>| {
        let ends = [curve.start(), curve.end()].map(&at);
        (curve, ends)
    };
    let mut open: VecDeque<_> = curves.into_iter().map(ends).collect();
    let mut loops = Vec::new();
    while let Some((first, [start, mut end])) = open.pop_front() {
        let mut path = vec![first];
        while start.distance(end) > near {
            let follows = |(_, [next, _]): &(_, [DVec3; 2])| next.distance(end) <= near;
            let next = open.iter().position(follows)?;
            let (curve, ends) = open.remove(next)?;
            end = ends[1];
            path.push(curve);
        }
        loops.push(path);
    }
    Some(loops)
}

/// A part of a line across an axis, as shares of it.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    axis: usize,
    /// Where the line is along the axis, in turns: not at the seam if a slit is elsewhere.
    at: f64,
    from: f64,
    to: f64,
}

impl Stretch {
    fn length(&self) -> f64 {
        (self.to - self.from).abs()
    }

    /// Whether another one is the same the other way.
    fn is_against(&self, other: &Self) -> bool {
        let across = self.at - other.at;
        (across - across.round()).abs() <= ACCURACY
            && (self.from - other.to).abs() <= SAME
            && (self.to - other.from).abs() <= SAME
    }
}

/// Stretches in parts that end at some places, too.
fn cut(stretches: &[Stretch], ends: &[f64]) -> Vec<Stretch> {
    let mut parts = Vec::new();
    for &Stretch { axis, at, from, to } in stretches {
        let is_inside = |t: &f64| from.min(to) + SAME < *t && *t < from.max(to) - SAME;
        let mut cuts: Vec<_> = ends.iter().copied().filter(is_inside).collect();
        cuts.sort_by(|a, b| {
            if from < to {
                a.total_cmp(b)
            } else {
                b.total_cmp(a)
            }
        });
        cuts.dedup_by(|b, a| (*b - *a).abs() <= SAME);
        cuts.insert(0, from);
        cuts.push(to);
        let part = |ends: &[f64]| Stretch {
            axis,
            at,
            from: ends[0],
            to: ends[1],
        };
        parts.extend(cuts.windows(2).map(part));
    }
    parts
}
