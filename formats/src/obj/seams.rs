//! Where surfaces meet: `con` names curves, `mg` groups of surfaces whose borders do.

use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::{Aabb, Curve, Surface};

use super::specials::{clamped, is_on};
use super::statements::{Statement, reference};
use super::trims::Piece;
use super::{Reader, invalid};
use crate::{Place, Problem};

/// How far apart the sides of a `con` may be, relative to their size.
const WIDEST: f64 = 0.01;

/// How many parts a side is cut into to find how far it is from the other.
const PARTS: usize = 128;

/// How many borders, and how many pairs of them, all merging groups of a file may have.
const PAIRS: usize = 20_000;

/// Where two surfaces meet: their positions in the list, each with its curve.
#[derive(Clone, Debug)]
pub(super) struct SeamPart {
    pub(super) sides: [(usize, Curve<DVec2>); 2],
    pub(super) gap: f64,
}

/// The merging group of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Merging {
    /// Its number; 0 for none.
    pub(super) group: u32,
    /// How far apart borders may be that are one.
    pub(super) reach: f64,
}

impl Reader<'_> {
    /// Takes a `con`: two surfaces, each with a part of a trim curve.
    pub(super) fn connect(&mut self, statement: &Statement<'_>) -> Result<(), Problem> {
        let words: Vec<_> = statement.arguments().collect();
        if words.len() != 8 {
            let found = words.len();
            return Err(invalid(format!(
                "{found} words; a connection has 8: surface, start, end and curve of either side"
            )));
        }
        let sides = [self.side(&words[..4])?, self.side(&words[4..])?];
        let groups = sides
            .each_ref()
            .map(|side| self.surfaces[side.0].merging.group);
        if groups[0] != groups[1] {
            return Err(invalid("surfaces of different merging groups"));
        }
        let [a, b] = sides
            .each_ref()
            .map(|(part, curve)| trail(&self.surfaces[*part].surface, curve));
        let gap = strays(&a, &b);
        let size = Aabb::around(a.into_iter().chain(b)).diagonal();
        if gap > WIDEST * size {
            return Err(invalid(format!(
                "the curves are {gap:.6} apart, which is more than {WIDEST} of their size"
            )));
        }
        self.seams.push(SeamPart { sides, gap });
        Ok(())
    }

    /// One side of a `con`: the surface that its curve is on, and the curve.
    fn side(&self, words: &[&str]) -> Result<(usize, Curve<DVec2>), Problem> {
        let number = reference(words[0], self.surface_parts.len(), "surfaces");
        let number = number.map_err(invalid)?;
        let piece = Piece::parse(&words[1..], self.trim_curves.len()).map_err(invalid)?;
        let curve = piece.cut(&self.trim_curves)?;
        let middle = curve.evaluate(f64::midpoint(curve.domain().start, curve.domain().end));
        let mut parts = self.surface_parts[number].clone();
        let found = parts.find(|&part| is_on(&self.surfaces[part].surface, middle));
        let message = || invalid(format!("the curve is not on surface {}", number + 1));
        Ok((found.ok_or_else(message)?, curve))
    }

    /// Finds the borders of surfaces of one merging group that run along each other within
    /// what the group allows.
    pub(super) fn merge(&mut self) {
        let too_large = |what: &str| {
            let text = format!("more than {PAIRS} {what} in merging groups");
            (Place::item(0, "mg"), Problem::TooLarge(text))
        };
        let mut borders = Vec::new();
        let merging = self.surfaces.iter().enumerate();
        for (part, found) in merging.filter(|(_, found)| found.merging.group > 0) {
            for curve in self.borders(part) {
                if borders.len() >= PAIRS {
                    let (place, problem) = too_large("borders");
                    self.warnings.add(place, problem);
                    return;
                }
                let trail = trail(&found.surface, &curve);
                let bounds = Aabb::around(trail.iter().copied());
                borders.push((part, curve, trail, bounds));
            }
        }
        borders.sort_by(|a, b| a.3.min.x.total_cmp(&b.3.min.x));
        let mut pairs = 0;
        for (k, (part, curve, points, bounds)) in borders.iter().enumerate() {
            let merging = self.surfaces[*part].merging;
            for (other, other_curve, other_points, other_bounds) in &borders[k + 1..] {
                let reach = merging.reach.min(self.surfaces[*other].merging.reach);
                if other_bounds.min.x > bounds.max.x + merging.reach {
                    break;
                }
                let is_same = merging.group == self.surfaces[*other].merging.group;
                let apart = bounds.min - reach - other_bounds.max;
                let apart = apart.max(other_bounds.min - reach - bounds.max);
                if part == other || !is_same || apart.max_element() > 0.0 {
                    continue;
                }
                pairs += 1;
                if pairs > PAIRS {
                    let (place, problem) = too_large("pairs of borders");
                    self.warnings.add(place, problem);
                    return;
                }
                let gap = strays(points, other_points);
                if gap <= reach {
                    self.seams.push(SeamPart {
                        sides: [(*part, curve.clone()), (*other, other_curve.clone())],
                        gap,
                    });
                }
            }
        }
    }

    /// The curves around a surface: its loops, cut where these have corners, or its four sides.
    fn borders(&self, part: usize) -> Vec<Curve<DVec2>> {
        let found = &self.surfaces[part];
        if !found.loops.is_empty() {
            let segments = found.loops.iter().flat_map(kernel::TrimLoop::segments);
            let straight = |curve: &Curve<DVec2>| match curve.degree() {
                1 => curve.bezier_pieces(),
                _ => vec![curve.clone()],
            };
            return segments.flat_map(straight).collect();
        }
        let [u, v] = [found.surface.knots_u(), found.surface.knots_v()].map(|k| k.domain());
        let line = |a: [f64; 2], b: [f64; 2]| Curve::line(a.into(), b.into(), 0.0..1.0).ok();
        let sides = [
            line([u.start, v.start], [u.end, v.start]),
            line([u.end, v.start], [u.end, v.end]),
            line([u.end, v.end], [u.start, v.end]),
            line([u.start, v.end], [u.start, v.start]),
        ];
        sides.into_iter().flatten().collect()
    }
}

/// Points along a curve on a surface.
fn trail(surface: &Surface, curve: &Curve<DVec2>) -> Vec<DVec3> {
    let Range { start, end } = curve.domain();
    let at = |k: usize| start + (end - start) * k as f64 / PARTS as f64;
    let point = |k| surface.evaluate(clamped(surface, curve.evaluate(at(k))));
    (0..=PARTS).map(point).collect()
}

/// How far two polylines stray from each other at most.
fn strays(a: &[DVec3], b: &[DVec3]) -> f64 {
    let one = |points: &[DVec3], line: &[DVec3]| {
        let from = |p: &DVec3| {
            let near = |w: &[DVec3]| {
                let way = w[1] - w[0];
                let share = (*p - w[0]).dot(way) / way.length_squared();
                let share = if share.is_finite() { share } else { 0.0 };
                (w[0] + way * share.clamp(0.0, 1.0)).distance(*p)
            };
            line.windows(2).map(near).fold(f64::INFINITY, f64::min)
        };
        points.iter().map(from).fold(0.0, f64::max)
    };
    one(a, b).max(one(b, a))
}
