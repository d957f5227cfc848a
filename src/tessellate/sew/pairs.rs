//! Which strands run together.

use std::iter;

use kernel::Aabb;
use rayon::prelude::*;

use super::{LONG, OF_A_THREAD, REACHES, Sewer, Strand};
use kernel::BoxTree;

/// Among no more strands with the same ends it is looked which fit best: each look takes as long as their number squared.
const MANY: usize = 32;

/// Reach of the last pass, for what is long.
const WIDE: f64 = 0.9;

impl Sewer<'_, '_> {
    /// Makes edges of strands that stay together.
    pub(super) fn match_strands(&mut self, reach: f64, seams: bool) {
        let open = self.strands.iter().enumerate();
        let open = open.filter(|(_, strand)| Self::is_open(strand));
        let by_ends = |(s, strand): (usize, &Strand)| {
            let [a, b] = self.roots(strand);
            ([a.min(b), a.max(b)], s)
        };
        let mut open: Vec<_> = open.map(by_ends).collect();
        open.sort_unstable();
        let groups = open.chunk_by(|a, b| a.0 == b.0);
        let groups: Vec<_> = groups.filter(|group| group.len() > 1).collect();
        let groups = groups.par_iter().with_min_len(OF_A_THREAD);
        let pairs = groups.flat_map_iter(|group| self.pairs(group, reach, seams));
        for (first, other) in pairs.collect::<Vec<_>>() {
            self.join(first, other);
        }
    }

    /// Which strands of the same ends stay together: the first of an edge, and another one. Those that fit best
    /// find each other first; what else fits one of them as well is of the same edge.
    fn pairs(&self, group: &[([usize; 2], usize)], reach: f64, seams: bool) -> Vec<(usize, usize)> {
        let least = match group.len() {
            3..=MANY => REACHES[0] * self.tolerance,
            _ => reach,
        };
        let closer = iter::successors(Some(least), |closer| Some(2.0 * closer));
        let mut left: Vec<usize> = group.iter().map(|&(_, s)| s).collect();
        let mut pairs = Vec::new();
        for reach in closer.take_while(|closer| *closer < reach).chain([reach]) {
            let fits = |a: usize, b: usize| {
                let faces = [a, b].map(|k| self.strands[k].face);
                self.is_seen(faces[0], faces[1])
                    && (seams || self.may_meet(a, b, reach))
                    && self.stay_together(a, b, reach)
            };
            let mut alone = Vec::new();
            while !left.is_empty() {
                let mut edge = vec![left.remove(0)];
                let mut next = 0;
                while next < edge.len() {
                    let own = edge[next];
                    let (found, rest) = left.iter().partition(|&&other| fits(own, other));
                    left = rest;
                    edge.extend::<Vec<usize>>(found);
                    next += 1;
                }
                alone.extend(self.left_over(&mut edge));
                match edge[..] {
                    [s] => alone.push(s),
                    _ => pairs.extend(edge[1..].iter().map(|&other| (edge[0], other))),
                }
            }
            left = alone;
        }
        pairs
    }

    /// Takes out one of an odd number of strands of one face: where a loop strays across a seam, all but
    /// one of them are sides of a sliver there, and the others come in pairs, there and back.
    fn left_over(&self, edge: &mut Vec<usize>) -> Option<usize> {
        let face = self.strands[edge[0]].face;
        if edge.len() < 3
            || edge.len().is_multiple_of(2)
            || edge.iter().any(|&s| self.strands[s].face != face)
        {
            return None;
        }
        let first = self.roots(&self.strands[edge[0]]);
        let runs_along = |&s: &usize| self.roots(&self.strands[s]) == first;
        let most = 2 * edge.iter().filter(|s| runs_along(s)).count() > edge.len();
        let place = edge.iter().rposition(|s| runs_along(s) == most)?;
        Some(edge.remove(place))
    }

    /// Whether strands that run together may be one edge: of two faces, or of one that goes a long way
    /// from one to the other.
    fn may_meet(&self, a: usize, b: usize, reach: f64) -> bool {
        let (a, b) = (&self.strands[a], &self.strands[b]);
        if a.face != b.face {
            return true;
        }
        let face = &self.faces[a.face];
        let (t, point) = a.trail.points[a.trail.points.len() / 2];
        let from = a.curve.evaluate(t);
        let to = b.curve.evaluate(b.trail.project(face, &b.curve, point).0);
        let place = |k: u32| face.point(face.clamped(from.lerp(to, f64::from(k) / 8.0)));
        let way = (0..8).map(|k| place(k).distance(place(k + 1)));
        way.sum::<f64>() > LONG * reach
    }

    /// Whether every point of one strand is near the other; they have the same ends.
    fn stay_together(&self, a: usize, b: usize, reach: f64) -> bool {
        let (long, short) = (&self.strands[a], &self.strands[b]);
        let lengths = [long.trail.length(), short.trail.length()];
        if (lengths[0] - lengths[1]).abs() > 0.1 * lengths[0] + 4.0 * reach {
            return false;
        }
        let place = (&self.faces[short.face], &short.curve);
        let count = long.trail.points.len();
        let inner = (1..count - 1).step_by((count / 24).max(1));
        let is_near = |k: usize| short.trail.is_near_point(place, (&long.trail, k), reach);
        inner.len() > 0 && inner.into_iter().all(is_near)
    }

    /// Sews what is long and nearly within the tolerance.
    pub(super) fn match_long(&mut self) {
        let reach = WIDE * self.tolerance;
        let mut long = Vec::new();
        for (s, strand) in self.strands.iter_mut().enumerate() {
            if Self::is_open(strand) && strand.trail.length() > LONG * reach {
                long.push(s);
            }
            strand.awake = false;
        }
        let bounds = |&s: &usize| self.strands[s].trail.bounds;
        let tree = BoxTree::new(&long.iter().map(bounds).collect::<Vec<_>>());
        let runs_beside = |a: usize, b: usize| {
            let strand = &self.strands[b];
            let place = (&self.faces[strand.face], &strand.curve);
            let trail = &self.strands[a].trail;
            trail.runs_beside(&strand.trail, place, reach) && self.may_meet(a, b, reach)
        };
        // No end is moved unless something may come of it.
        let partners = |(k, &a): (usize, &usize)| {
            let mut found = Vec::new();
            let own = self.strands[a].trail.bounds;
            let room = Aabb {
                min: own.min - reach,
                max: own.max + reach,
            };
            tree.near(&room, |number| {
                let other = number as usize;
                let b = long[other];
                let is_near = other > k && self.strands[b].trail.bounds.meets(&room);
                if is_near && (runs_beside(a, b) || runs_beside(b, a)) {
                    found.extend([a, b]);
                }
            });
            found
        };
        let all = long.par_iter().enumerate().with_min_len(OF_A_THREAD);
        for s in all.flat_map_iter(partners).collect::<Vec<_>>() {
            self.strands[s].awake = true;
        }
        self.match_awake(reach);
    }
}
