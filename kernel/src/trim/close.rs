//! Loops from chains of curves as files have them: gaps closed, and loops that run around a
//! closed surface completed along its border.

use std::ops::Range;

use glam::{BVec2, DVec2};

use super::clip::clipped;
use super::parts::{ended, moved};
use super::{NO_AREA, TrimLoop};
use crate::{Curve, Error, Surface, nearest};

/// Gaps up to this share of the domain's diagonal are rounding.
const GAP: f64 = 1e-3;

/// Gaps up to this share of the domain's diagonal are closed, and counted.
const WIDE_GAP: f64 = 1e-2;

/// Where curves that follow each other overlap, they do so over less than this share of either.
const OVERLAP: f64 = 0.1;

/// Steps towards where a curve passes the end of another one.
const STEPS: usize = 4;

/// Ends of curves no farther apart than this share of a domain are one place: files have no more
/// digits.
const ROUNDING: f64 = 1e-8;

/// What lies this share of a period beyond the border of a domain lies in it.
pub(super) const NEAR: f64 = 1e-9;

/// What lies this share of a domain beside a pole is the pole.
const POLE: f64 = 1e-6;

/// A loop may lie on this many periods of a closed surface.
pub(super) const TILES: u8 = 8;

/// Loops farther away than this many periods are refused: their digits tell no place in a period.
const FAR: f64 = 1e6;

/// A part of a loop beyond a seam with less than this share of the area of the largest is rounding, if it
/// is as good as none of the domain.
const NO_PART: f64 = 1e-6;

/// What a loop on a surface without border leaves of the domain is nothing up to this share.
const NO_OUTSIDE: f64 = 1e-6;

/// Half a period is a tie between both ways round up to this share of a period: numbers in files
/// have that many digits at least.
const TIE: f64 = 1e-5;

/// How a file orients its loops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Orientation {
    /// The face is to the left of its loops, seen against the normal.
    Left,
    /// It is not reliable.
    Unknown,
    /// It is not reliable, but parameters are those of the file: a path that arrives at a pole with some
    /// and leaves it with others goes straight from these to those.
    Literal,
}

/// The loops of a face.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClosedLoops {
    /// They lie in the domain along each parameter for which the surface is closed.
    pub loops: Vec<TrimLoop>,
    /// How many gaps were too wide to be rounding.
    pub wide_gaps: usize,
}

/// Joins each chain of curves to a loop of `surface`; the curves of a chain are in order and
/// run in one direction.
///
/// Where the surface is `closed`, curves may lie any number of periods off: each continues
/// the one before, loops that cross the seam are cut there, and a loop that runs around
/// the surface bounds the part between it and the next one, or the pole or border. Ends that
/// differ by rounding are moved together; other gaps are closed by straight segments if they are
/// below a thousandth of the domain, if their ends are one point of space up to `accuracy` (as at
/// poles), or, counted, up to a hundredth of the domain.
///
/// # Errors
/// If a chain is empty, a gap is wider, loops run around along both parameters, or one is more than a
/// million periods away or lies on more than eight.
pub fn close(
    surface: &Surface,
    closed: [bool; 2],
    chains: Vec<Vec<Curve<DVec2>>>,
    accuracy: f64,
    orientation: Orientation,
) -> Result<ClosedLoops, Error> {
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let closer = Closer {
        surface,
        closed,
        start: DVec2::new(u.start, v.start),
        size: DVec2::new(u.end - u.start, v.end - v.start),
        accuracy,
        orientation,
    };
    let mut result = ClosedLoops::default();
    let (mut simple, mut open) = (Vec::new(), [Vec::new(), Vec::new()]);
    for chain in chains {
        let (path, turns) = closer.unrolled(chain, &mut result.wide_gaps)?;
        match (turns.x.abs() > 0.5, turns.y.abs() > 0.5) {
            (false, false) => simple.push(path),
            (true, false) => open[0].push(path),
            (false, true) => open[1].push(path),
            (true, true) => return Err(Error::LoopsWind),
        }
    }
    if open.iter().all(|around| !around.is_empty()) {
        return Err(Error::LoopsWind);
    }
    let has_rings = open.iter().any(|around| !around.is_empty());
    for (axis, rings) in open.iter().enumerate() {
        closer.add_bands(rings, axis, &mut simple)?;
    }
    let loops: Result<Vec<_>, _> = simple
        .into_iter()
        .map(|path| TrimLoop::new(path, f64::INFINITY))
        .collect();
    let loops = loops?;
    if orientation == Orientation::Left && !has_rings && closer.is_boundless() {
        let areas = loops.iter().map(TrimLoop::signed_area);
        let largest = areas.max_by(|a, b| a.abs().total_cmp(&b.abs()));
        // Beside one around the whole domain nothing is left.
        let most = closer.size.element_product() * (1.0 - NO_OUTSIDE);
        if largest.is_some_and(|a| a < 0.0 && -a < most) {
            result.loops.push(TrimLoop::border(&u, &v)?);
        }
    }
    for trim in loops {
        closer.tile(trim, &mut result.loops)?;
    }
    Ok(result)
}

/// A surface and what there is to know about its domain.
pub(super) struct Closer<'a> {
    surface: &'a Surface,
    pub(super) closed: [bool; 2],
    pub(super) start: DVec2,
    pub(super) size: DVec2,
    accuracy: f64,
    orientation: Orientation,
}

impl Closer<'_> {
    /// A chain moved by whole periods so that each curve continues the one before, without
    /// gaps, and how many periods its end is away from its start.
    fn unrolled(
        &self,
        chain: Vec<Curve<DVec2>>,
        wide_gaps: &mut usize,
    ) -> Result<(Vec<Curve<DVec2>>, DVec2), Error> {
        let opening = chain.first().ok_or(Error::EmptyLoop)?.clone();
        let first = opening.start();
        let (least, most) = hull(&chain);
        let is_short = ((most - least) / self.size).cmple(DVec2::splat(1.0 + NEAR));
        let mut path: Vec<Curve<DVec2>> = Vec::new();
        let (mut end, mut last) = (first, DVec2::ZERO);
        for (index, curve) in chain.into_iter().enumerate() {
            let mut shift = self.shift(end, curve.start(), (is_short, last));
            last = shift;
            if let Some(before) = path.last() {
                shift += self.around_pole(before, &curve, shift);
            }
            let mut curve = moved(&curve, shift);
            if let Some(before) = path.last_mut() {
                self.part(before, &mut curve)?;
            }
            self.bridge(&mut path, index, curve.start(), wide_gaps)?;
            end = curve.end();
            path.push(curve);
        }
        let mut turn = self.shift(end, first, (is_short, last));
        if let Some(before) = path.last() {
            turn += self.around_pole(before, &opening, turn);
        }
        if let [opening, .., last] = path.as_mut_slice() {
            let whole = moved(opening, turn);
            let mut next = whole.clone();
            self.part(last, &mut next)?;
            if next != whole {
                *opening = moved(&next, -turn);
            }
        }
        let index = path.len();
        let next = path[0].start() + turn;
        self.bridge(&mut path, index, next, wide_gaps)?;
        Ok((path, turn / self.size))
    }

    /// Cuts off what the second of two curves that nearly meet runs over once more, or the first
    /// beyond where the second begins: a segment between their ends would run back.
    fn part(&self, before: &mut Curve<DVec2>, after: &mut Curve<DVec2>) -> Result<(), Error> {
        let (end, start) = (before.end(), after.start());
        if self.is_rounding(end, start) || end.distance(start) > self.size.length() * GAP {
            return Ok(());
        }
        if let Some(t) = self.passing(after, after.domain().start, end) {
            let [_, rest] = after.split(t)?;
            *after = rest;
        } else if let Some(t) = self.passing(before, before.domain().end, start) {
            let [rest, _] = before.split(t)?;
            *before = rest;
        }
        Ok(())
    }

    /// Where a curve passes a place near the end at the parameter `from`, if it does.
    fn passing(&self, curve: &Curve<DVec2>, from: f64, place: DVec2) -> Option<f64> {
        let mut t = from;
        for _ in 0..STEPS {
            let (at, along) = curve.tangent(t);
            let (off, along) = ((place - at) / self.size, along / self.size);
            t += off.dot(along) / along.length_squared();
        }
        let Range { start, end } = curve.domain();
        let is_inside = start < t && t < end && (t - from).abs() < OVERLAP * (end - start);
        let off = |t: f64| ((place - curve.evaluate(t)) / self.size).length();
        (is_inside && off(t) < OVERLAP * off(from)).then_some(t)
    }

    /// One period more, or none, for a path that arrives at a pole with one curve and leaves it
    /// with the next one, moved by `shift`: with the face to the left, it goes around the pole
    /// the other way than around its middle, and all the way round if it leaves where it
    /// arrived.
    fn around_pole(&self, before: &Curve<DVec2>, after: &Curve<DVec2>, shift: DVec2) -> DVec2 {
        let (end, next) = (before.end(), after.start() + shift);
        let mut turn = DVec2::ZERO;
        if self.orientation != Orientation::Left {
            return turn;
        }
        for axis in 0..2 {
            let other = 1 - axis;
            if !self.closed[axis] || self.closed[other] {
                continue;
            }
            let Some(side) = self.pole(end, other) else {
                continue;
            };
            // The file may have curves along the pole of its own.
            if [before.start(), after.end()]
                .map(|uv| self.pole(uv, other))
                .contains(&Some(side))
            {
                continue;
            }
            // Along the lower border of v the path goes towards larger u, and so on.
            let forward = (side == 0) == (axis == 0);
            let way = next[axis] - end[axis];
            let near = self.size[axis] * NEAR;
            if forward && way < near {
                turn[axis] = self.size[axis];
            } else if !forward && way > -near {
                turn[axis] = -self.size[axis];
            }
        }
        turn
    }

    /// The border across an axis that is a pole and holds a place: zero where parameters begin.
    fn pole(&self, uv: DVec2, axis: usize) -> Option<usize> {
        let share = (uv[axis] - self.start[axis]) / self.size[axis];
        let side = usize::from(share >= 0.5);
        let is_there = (share - side as f64).abs() <= POLE;
        (is_there && self.is_point(axis, side)).then_some(side)
    }

    /// By how much what begins at `next` is moved to continue a path that arrives at `end`, of which the curve
    /// before was moved by `last`; along which axes all curves lie within a period tells `is_short`.
    fn shift(&self, end: DVec2, next: DVec2, (is_short, last): (BVec2, DVec2)) -> DVec2 {
        let mut shift = self.periods(end - next);
        if self.orientation != Orientation::Literal {
            return shift;
        }
        for axis in 0..2 {
            let is_inside = |uv: DVec2| {
                let share = (uv[axis] - self.start[axis]) / self.size[axis];
                (-NEAR..=1.0 + NEAR).contains(&share)
            };
            let literal = if is_short.test(axis) { last[axis] } else { 0.0 };
            let is_literal = is_short.test(axis) || is_inside(end) && is_inside(next);
            if (shift[axis] - literal).abs() > 0.0 && is_literal {
                let [from, to] = [end, next].map(|uv| self.pole(uv, 1 - axis));
                if from.is_some() && from == to {
                    shift[axis] = literal;
                }
            }
        }
        shift
    }

    /// The whole periods nearest to a difference, in parameters.
    pub(super) fn periods(&self, difference: DVec2) -> DVec2 {
        let along = |axis: usize| {
            let share = difference[axis] / self.size[axis];
            if self.closed[axis] {
                // Towards zero between two ways that are as long.
                let nearly = (share.abs() - TIE).max(0.0).copysign(share);
                nearly.round() * self.size[axis]
            } else {
                0.0
            }
        };
        DVec2::new(along(0), along(1))
    }

    /// Continues a path to `next` by a straight segment.
    fn bridge(
        &self,
        path: &mut Vec<Curve<DVec2>>,
        index: usize,
        next: DVec2,
        wide_gaps: &mut usize,
    ) -> Result<(), Error> {
        let Some(end) = path.last().map(Curve::end) else {
            return Ok(());
        };
        if end == next {
            return Ok(());
        }
        // No segment between the curves could be of use.
        if self.is_rounding(end, next)
            && let Some(last) = path.last_mut()
            && let Some(ended) = ended(last, next)?
        {
            *last = ended;
            return Ok(());
        }
        let (gap, diagonal) = (end.distance(next), self.size.length());
        let meets = || self.point(end).distance(self.point(next)) <= self.accuracy;
        if gap > diagonal * GAP && !meets() {
            let allowed = diagonal * WIDE_GAP;
            if gap > allowed {
                let index = index.saturating_sub(1);
                return Err(Error::LoopGap {
                    index,
                    gap,
                    allowed,
                });
            }
            *wide_gaps += 1;
        }
        // Along both sides that are one point, not through the face.
        let corner = self.corner(end, next);
        let stops = [end].into_iter().chain(corner).chain([next]);
        let stops: Vec<DVec2> = stops.collect();
        for ends in stops.windows(2) {
            path.push(Curve::line(ends[0], ends[1], 0.0..1.0)?);
        }
        Ok(())
    }

    /// The corner between two places on sides of the domain that meet there and are one point.
    fn corner(&self, end: DVec2, next: DVec2) -> Option<DVec2> {
        let sides = |uv: DVec2| [0, 1].map(|axis| self.pole(uv, axis));
        let (from, to) = (sides(end), sides(next));
        if (0..2).any(|axis| from[axis].is_some() && from[axis] == to[axis]) {
            return None;
        }
        let at = |axis: usize, side: usize| self.start[axis] + self.size[axis] * side as f64;
        match (from, to) {
            ([Some(u), None], [None, Some(v)]) | ([None, Some(v)], [Some(u), None]) => {
                Some(DVec2::new(at(0, u), at(1, v)))
            }
            _ => None,
        }
    }

    /// Whether two places are one up to rounding.
    fn is_rounding(&self, a: DVec2, b: DVec2) -> bool {
        ((a - b) / self.size).abs().max_element() <= ROUNDING
    }

    /// The point of the surface, with parameters beyond its seams brought back.
    fn point(&self, uv: DVec2) -> glam::DVec3 {
        let inside = (uv - self.start).rem_euclid(self.size) + self.start;
        let pick = |axis: usize| {
            if self.closed[axis] {
                inside[axis]
            } else {
                uv[axis]
            }
        };
        let end = self.start + self.size;
        let uv = DVec2::new(pick(0), pick(1)).clamp(self.start, end);
        self.surface.evaluate(uv)
    }

    /// Whether the surface has no border, up to poles.
    fn is_boundless(&self) -> bool {
        let ends =
            |axis: usize| self.closed[axis] || self.is_point(axis, 0) && self.is_point(axis, 1);
        self.closed != [false; 2] && ends(0) && ends(1)
    }

    /// Whether the side of the domain at the start (0) or end (1) of `axis` is a single point.
    fn is_point(&self, axis: usize, side: usize) -> bool {
        nearest::pole(self.surface, axis, side, self.accuracy).is_some()
    }

    /// Adds the parts of a loop on each period, moved into the domain.
    fn tile(&self, trim: TrimLoop, loops: &mut Vec<TrimLoop>) -> Result<(), Error> {
        let mut parts = vec![trim];
        for axis in 0..2 {
            if !self.closed[axis] {
                continue;
            }
            let (start, size) = (self.start[axis], self.size[axis]);
            let mut tiled = Vec::new();
            for trim in parts {
                let (min, max) = trim.hull();
                let near = NEAR * size;
                let first = ((min[axis] + near - start) / size).floor();
                let last = ((max[axis] - near - start) / size).floor();
                let is_near = first.abs() <= FAR && last < first + f64::from(TILES);
                if !is_near {
                    let (found, end) = (max[axis], start + size);
                    return Err(Error::Parameter { found, start, end });
                }
                let tiles = (0..TILES).map(|k| first + f64::from(k));
                for tile in tiles.take_while(|tile| *tile <= last) {
                    let mut shift = DVec2::ZERO;
                    shift[axis] = -tile * size;
                    let there = TrimLoop {
                        segments: trim.segments.iter().map(|c| moved(c, shift)).collect(),
                    };
                    tiled.extend(clipped(there, axis, start..start + size)?);
                }
            }
            parts = tiled;
        }
        // Where the loop touches a seam, what is beyond by rounding is no part of it.
        if parts.len() > 1 {
            let areas = || parts.iter().map(|part| part.signed_area().abs());
            let least = areas().fold(0.0, f64::max) * NO_PART;
            let least = least.min(self.size.element_product() * NO_AREA);
            parts.retain(|part| part.signed_area().abs() > least);
        }
        loops.extend(parts);
        Ok(())
    }
}

/// The corners of a box around the control points of curves.
pub(super) fn hull(curves: &[Curve<DVec2>]) -> (DVec2, DVec2) {
    let points = || curves.iter().flat_map(Curve::points);
    (
        points().fold(DVec2::INFINITY, DVec2::min),
        points().fold(DVec2::NEG_INFINITY, DVec2::max),
    )
}
