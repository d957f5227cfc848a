//! Strips between boundaries that run together.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::{Range, RangeInclusive};

use glam::{DAffine3, DVec2, DVec3};
use kernel::{Aabb, Curve, Patch, Surface};
use rayon::prelude::*;

use super::super::strip::{NODES, ORDER, Strip, bernstein, interpolated};
use super::super::{Cluster, ItemShape};
use super::{EXACT, NOISE};
use crate::tessellate::{Edge, Face, Sewn, Use, sew};

/// How often the stretch for a strip is halved to be accurate.
const DEPTH: u32 = 8;

/// Stretches that are shorter than this share of a boundary are parts of their neighbours.
const SHORTEST: f64 = 1e-7;

/// A strip leads back along a face from this cosine on.
const BACK: f64 = 0.5;

/// The strips between the faces of a cluster.
pub(super) fn strips(cluster: &Cluster<'_>, tolerance: f64, exact: f64) -> Vec<Strip> {
    let face = |&number: &u32| {
        let item = cluster.item(number);
        match item.shape {
            ItemShape::Patch(patch) => Some((number, placed(patch, cluster.map_of(item)))),
            ItemShape::Mesh(_) => None,
        }
    };
    let (mut items, mut patches): (Vec<_>, Vec<_>) = cluster.own().iter().filter_map(face).unzip();
    let own = items.len();
    let beside = cluster.seams.iter().flat_map(|seams| &seams.beside);
    for (number, patch) in beside.filter_map(face) {
        items.push(number);
        patches.push(patch);
    }
    // Boundaries are sewn within half of the tolerance.
    let faces: Vec<Face<'_>> = patches
        .par_iter()
        .map(|patch| Face::of_edges(patch, 2.0 * tolerance))
        .collect();
    let all: Vec<_> = faces
        .par_iter()
        .zip(&patches)
        .enumerate()
        .flat_map_iter(|(k, (face, patch))| {
            let rims = face.rims(patch).into_iter();
            rims.map(move |curve| (k, curve, border_net(patch, face)))
        })
        .map(|(k, curve, net)| {
            let key = net.and_then(|surface| border_key(surface, &curve));
            (k, curve, key)
        })
        .collect();
    let mut count: HashMap<&[u64], u32> = HashMap::new();
    for (_, _, key) in &all {
        if let Some(key) = key {
            *count.entry(key).or_default() += 1;
        }
    }
    // What two faces share to the last bit has no gap.
    let is_open = |key: &Option<Vec<u64>>| key.as_ref().is_none_or(|key| count[&key[..]] < 2);
    let open = all.iter().filter(|(_, _, key)| is_open(key));
    let rims = open.map(|(k, curve, _)| (*k, curve.clone())).collect();
    let sewn = sew(&faces, rims, &[], &[], 1.0);
    let spreads = spreads(&sewn, &faces);
    let noise = NOISE / EXACT * exact;
    let strips = sewn.edges.par_iter().flat_map_iter(|edge| {
        let seams = Seams {
            faces: &faces,
            items: &items,
            own,
            edge,
            exact,
            widths: noise..=tolerance,
        };
        seams.strips(edge.ends.map(|end| spreads[end]))
    });
    strips.collect()
}

/// A patch in the coordinates of its cluster.
fn placed<'a>(patch: &'a Patch, map: &DAffine3) -> Cow<'a, Patch> {
    if *map == DAffine3::IDENTITY {
        return Cow::Borrowed(patch);
    }
    Cow::Owned(patch.transformed(map))
}

/// The surface of a face that ends at the borders of its domain.
fn border_net<'a>(patch: &'a Patch, face: &Face<'_>) -> Option<&'a Surface> {
    let clamped = [patch.surface.knots_u(), patch.surface.knots_v()]
        .iter()
        .all(|knots| {
            let (t, p) = (knots.as_slice(), knots.degree());
            let ends = [&t[..=p], &t[t.len() - p - 1..]];
            ends.iter().all(|end| end.windows(2).all(|w| w[0] >= w[1]))
        });
    (clamped && face.is_whole()).then_some(&patch.surface)
}

/// The control points along a border of a domain, whichever way it runs, as bits; `None` for
/// another curve, and for a border that is a point.
pub(super) fn border_key(surface: &Surface, curve: &Curve<DVec2>) -> Option<Vec<u64>> {
    let (u, v) = (surface.knots_u(), surface.knots_v());
    let (rows, columns) = (u.count(), v.count());
    let (start, end) = (curve.start(), curve.end());
    let is_long = |axis: usize, domain: Range<f64>| {
        let span = start[axis].min(end[axis])..start[axis].max(end[axis]);
        span == domain
    };
    let is_at =
        |axis: usize, x: f64| [start[axis], end[axis]].map(f64::to_bits) == [x.to_bits(); 2];
    let border = |axis: usize, domain: &Range<f64>, count: usize| {
        let sides = [(domain.start, 0), (domain.end, count - 1)];
        sides
            .into_iter()
            .find(|(at, _)| is_at(axis, *at))
            .map(|(_, k)| k)
    };
    let places: Vec<usize> = if let Some(row) = border(0, &u.domain(), rows)
        && is_long(1, v.domain())
    {
        (0..columns).map(|j| row * columns + j).collect()
    } else if let Some(column) = border(1, &v.domain(), columns)
        && is_long(0, u.domain())
    {
        (0..rows).map(|i| i * columns + column).collect()
    } else {
        return None;
    };
    let bits = |k: &usize| {
        surface.homogeneous()[*k]
            .to_array()
            .map(|x| (x + 0.0).to_bits())
    };
    let forwards: Vec<u64> = places.iter().flat_map(bits).collect();
    let backwards: Vec<u64> = places.iter().rev().flat_map(bits).collect();
    Some(forwards.min(backwards))
}

/// How far the ends of curves of three and more faces that meet at a vertex are apart; zero where
/// there are fewer faces.
fn spreads(sewn: &Sewn, faces: &[Face<'_>]) -> Vec<f64> {
    let mut boxes = vec![Aabb::EMPTY; sewn.vertices.len()];
    let mut owners: Vec<Vec<usize>> = vec![Vec::new(); sewn.vertices.len()];
    for edge in &sewn.edges {
        for used in &edge.uses {
            let mut points =
                [used.curve.start(), used.curve.end()].map(|uv| faces[used.face].point(uv));
            if used.reversed {
                points.reverse();
            }
            for (&end, point) in edge.ends.iter().zip(points) {
                boxes[end] = boxes[end].union(Aabb::around([point]));
                if !owners[end].contains(&used.face) {
                    owners[end].push(used.face);
                }
            }
        }
    }
    let spread = |(bounds, owners): (&Aabb, &Vec<usize>)| {
        if owners.len() > 2 {
            bounds.diagonal()
        } else {
            0.0
        }
    };
    boxes.iter().zip(&owners).map(spread).collect()
}

/// The strips of one edge.
struct Seams<'a, 's> {
    faces: &'a [Face<'s>],
    items: &'a [u32],
    /// How many of the faces are the cluster's own.
    own: usize,
    edge: &'a Edge,
    exact: f64,
    /// How wide strips may be: less matters to no ray, more is no gap.
    widths: RangeInclusive<f64>,
}

/// The two boundaries of a strip.
struct Pair<'a, 's> {
    faces: [&'a Face<'s>; 2],
    /// The first is run through forwards.
    uses: [&'a Use; 2],
}

impl Seams<'_, '_> {
    /// Strips from the first of the boundaries to each other one; `spreads` says how far apart
    /// all ends are.
    fn strips(&self, spreads: [f64; 2]) -> Vec<Strip> {
        let mut strips = Vec::new();
        let Some((first, others)) = self.edge.uses.split_first() else {
            return strips;
        };
        for other in others {
            let uses = [first, other];
            let pair = Pair {
                faces: uses.map(|used| &self.faces[used.face]),
                uses,
            };
            if first.face.min(other.face) >= self.own {
                continue;
            }
            let item = self.items[first.face];
            for part in pair.breaks(*self.widths.end()).windows(2) {
                self.divide(&pair, part[0]..part[1], DEPTH, &mut |sides, uv, apart| {
                    strips.push(Strip {
                        sides,
                        uv,
                        item,
                        apart,
                    });
                });
            }
            let whole = first.curve.domain();
            for (at, spread) in [whole.start, whole.end].into_iter().zip(spreads) {
                if spread > *self.widths.start() {
                    strips.extend(pair.cap(at, 2.0 * spread, item));
                }
            }
        }
        strips
    }

    /// Makes strips of a stretch, halving it until their sides are accurate.
    fn divide(
        &self,
        pair: &Pair<'_, '_>,
        range: Range<f64>,
        depth: u32,
        make: &mut impl FnMut([[DVec3; ORDER]; 2], [DVec2; ORDER], bool),
    ) {
        let at = |share: f64| range.start + (range.end - range.start) * share;
        let parameters: [f64; ORDER] = NODES.map(at);
        let partners = parameters.map(|t| pair.partner(t));
        let uv = parameters.map(|t| pair.uv(t));
        let first = uv.map(|uv| pair.faces[0].point(uv));
        let second = partners.map(|t| pair.other(t));
        let widths = (0..ORDER).map(|k| first[k].distance(second[k]));
        let mut widest = widths.fold(0.0, f64::max);
        let sides = [interpolated(&first), interpolated(&second)];
        let along = interpolated(&partners);
        let mut off: f64 = 0.0;
        for ends in NODES.windows(2) {
            let share = 0.5 * (ends[0] + ends[1]);
            let [a, b] = sides.each_ref().map(|side| bernstein(side, share));
            let first = pair.faces[0].point(pair.uv(at(share)));
            let second = pair.other(bernstein(&along, share));
            off = off.max(first.distance(a)).max(second.distance(b));
            widest = widest.max(first.distance(second));
        }
        if widest < *self.widths.start() {
            return;
        }
        if off > self.exact && depth > 0 {
            let middle = at(0.5);
            self.divide(pair, range.start..middle, depth - 1, make);
            self.divide(pair, middle..range.end, depth - 1, make);
        } else if self.widths.contains(&widest) {
            let apart = (1..ORDER - 1).all(|k| pair.are_apart(parameters[k], partners[k]));
            make(sides, interpolated(&uv), apart);
        }
    }
}

impl Pair<'_, '_> {
    /// The ends of the first boundary, and the parameters between them where one of both need not
    /// be smooth, of what is no farther apart than `reach`.
    fn breaks(&self, reach: f64) -> Vec<f64> {
        let ([home, beside], [first, second]) = (self.faces, self.uses);
        let mut inner = home.breaks(&first.curve);
        for t in beside.breaks(&second.curve) {
            let place = (home, &first.curve);
            let found = first.trail.project_within(place, self.other(t), reach);
            inner.extend(found.map(|(t, _)| t));
        }
        inner.sort_by(f64::total_cmp);
        let Range { start, end } = first.curve.domain();
        let least = SHORTEST * (end - start);
        let mut breaks = vec![start];
        for t in inner {
            if t - breaks[breaks.len() - 1] > least && end - t > least {
                breaks.push(t);
            }
        }
        breaks.push(end);
        breaks
    }

    /// Parameters of the first face on its boundary.
    fn uv(&self, t: f64) -> DVec2 {
        self.faces[0].clamped(self.uses[0].curve.evaluate(t))
    }

    /// A point of the second boundary.
    fn other(&self, t: f64) -> DVec3 {
        self.faces[1].point(self.uses[1].curve.evaluate(t))
    }

    /// Whether a strip there leads away from both faces, rather than back along one of them.
    fn are_apart(&self, t: f64, partner: f64) -> bool {
        let across = self.other(partner) - self.faces[0].point(self.uv(t));
        [(0, t, across), (1, partner, -across)]
            .into_iter()
            .all(|(k, t, way)| {
                let inwards = self.faces[k].inwards(&self.uses[k].curve, t);
                let inwards = inwards.unwrap_or_default();
                way.dot(inwards) < BACK * way.length() * inwards.length()
            })
    }

    /// Where the second boundary is next to the first.
    fn partner(&self, t: f64) -> f64 {
        let [first, second] = self.uses;
        let (whole, other) = (first.curve.domain(), second.curve.domain());
        if t <= whole.start || t >= whole.end {
            let is_start = (t <= whole.start) != second.reversed;
            return if is_start { other.start } else { other.end };
        }
        let target = self.faces[0].point(self.uv(t));
        // Where a boundary comes back beside itself, the one is meant that is as far along.
        let place = (self.faces[1], &second.curve);
        let from = (&first.trail, t, second.reversed);
        second.trail.project_beside(place, target, from).0
    }

    /// A strip that prolongs those before by `length` beyond an end, where more than two
    /// faces may leave a gap.
    fn cap(&self, at: f64, length: f64, item: u32) -> Option<Strip> {
        let whole = self.uses[0].curve.domain();
        let inwards = if at <= whole.start { 1e-3 } else { -1e-3 };
        let point = |t: f64| self.faces[0].point(self.uv(t));
        let end = point(at);
        let way = end - point(at + (whole.end - whole.start) * inwards);
        let step = way.try_normalize()? * length;
        let from = [end, self.other(self.partner(at))];
        let line =
            |start: DVec3| std::array::from_fn(|k| start + step * (k as f64 / (ORDER - 1) as f64));
        Some(Strip {
            sides: from.map(line),
            uv: [self.uv(at); ORDER],
            item,
            apart: false,
        })
    }
}
