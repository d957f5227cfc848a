//! The least box around a face: its extreme points, inside and along its boundary.

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4};

use super::cuts;
use crate::trim::{aside, shifts};
use crate::{Aabb, BezierSurface, Cover, Curve, KnotVector, Patch, Surface, TrimLoop, TrimRegion};

/// How far the box may be too small, as a share of the size of the control net.
pub(super) const ACCURACY: f64 = 1e-8;

/// Parts of each piece of a trim curve within one piece of the surface that are searched for an extreme point.
const PARTS: usize = 16;

/// What ends this share of a domain beside a curve ends on it.
const NEAR: f64 = 1e-6;

/// A loop is thin with less area than this share of the square of its length.
const THIN: f64 = 1e-8;

/// How much nearer than elsewhere what is beside a curve is looked at: tips of faces may be thin.
const NEARER: f64 = 1e-5;

/// Parameters that differ by this share of themselves are told apart.
const TOLD: f64 = 8.0 * f64::EPSILON;

/// Halvings of such a part: of its extreme point its place has half of the digits that its height has.
const STEPS: usize = 30;

/// Halvings of a piece of the surface.
const HALVINGS: u32 = 60;

/// Parts of rational pieces with fewer halvings may turn round where their net does not.
const RATIONAL_HALVINGS: u32 = 4;

/// The least box around a face, too small by [`ACCURACY`] at most.
pub(super) fn bounds(patch: &Patch) -> Aabb {
    let surface = &patch.surface;
    let hull = surface.hull_bounds();
    let slack = hull.diagonal() * ACCURACY;
    let region = patch.region();
    let mut bounds = Aabb::EMPTY;
    match &region {
        None => {
            for [start, end] in surface.corners() {
                bounds = bounds.including(start).including(end);
            }
        }
        Some(region) => along_loops(patch, region, &mut bounds),
    }
    let pieces = surface.bezier_pieces();
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let mut search = Search {
                axis,
                sign,
                slack,
                region: region.as_ref(),
                best: bounds,
            };
            for piece in &pieces {
                search.examine(piece);
            }
            bounds = search.best;
        }
    }
    bounds
}

/// Adds the extreme points of the loops, but for sides that two of them share: both sides of these are
/// outside, or inside.
fn along_loops(patch: &Patch, region: &TrimRegion, bounds: &mut Aabb) {
    let surface = &patch.surface;
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let corners = [DVec2::new(u.start, v.start), DVec2::new(u.end, v.end)];
    let size = corners[1] - corners[0];
    let breaks = [surface.knots_u().breaks(), surface.knots_v().breaks()];
    let ends = ends(&patch.loops, corners, surface.closed());
    // Beyond a seam nothing is looked at: the face ends there, too.
    let holds = |uv: DVec2| uv.clamp(corners[0], corners[1]) == uv && region.contains(uv);
    for trim in &patch.loops {
        // Such a loop cannot be told from a line run to and fro by what is beside it.
        let (low, high) = trim.hull();
        let length = ((high - low) / size).max_element();
        let is_thin = trim.signed_area().abs() < THIN * length * length * size.element_product();
        for shift in shifts(trim, corners, surface.closed()) {
            for curve in trim.segments().iter().flat_map(Curve::bezier_pieces) {
                let on = |t: f64| on_surface(surface, &curve, shift, corners, t);
                let divides = |t: f64| {
                    let (point, left) = aside(&curve, t, size);
                    let point = point + shift;
                    // Far from the origin of the parameters nearer is the same place.
                    let told = TOLD * point.abs().max_element() / left.abs().max_element();
                    let left = left * told.max(NEARER);
                    holds(point + left) != holds(point - left)
                };
                let near = size.length() * NEAR;
                for (from, step) in parts(&breaks, &curve, shift, (&ends, near)) {
                    let mut reached = *bounds;
                    along(&on, [from, from + step], &mut reached);
                    // What is beside a part is asked only where it would count.
                    let mut looks = [0.01, 0.5, 0.99].iter().map(|share| from + step * share);
                    if reached != *bounds && (is_thin || looks.any(divides)) {
                        *bounds = reached;
                    }
                }
            }
        }
    }
}

/// Where pieces of loops begin and end, by u.
fn ends(loops: &[TrimLoop], corners: [DVec2; 2], closed: [bool; 2]) -> Vec<DVec2> {
    let mut ends = Vec::new();
    for trim in loops {
        for shift in shifts(trim, corners, closed) {
            let pieces = trim.segments().iter().flat_map(Curve::bezier_pieces);
            ends.extend(pieces.map(|piece| piece.start() + shift));
        }
    }
    ends.sort_by(|a, b| a.x.total_cmp(&b.x));
    ends
}

/// Parts of a Bézier piece of a trim curve, none over a knot of the surface or over an end of another
/// piece that is `near` it: starts and lengths.
fn parts(
    breaks: &[Vec<f64>; 2],
    curve: &Curve<DVec2>,
    shift: DVec2,
    (ends, near): (&[DVec2], f64),
) -> Vec<(f64, f64)> {
    let mut cuts = cuts(breaks, curve, shift);
    let points = || curve.points().map(|p| p + shift);
    let low = points().fold(DVec2::INFINITY, DVec2::min) - near;
    let high = points().fold(DVec2::NEG_INFINITY, DVec2::max) + near;
    // Along the longer side a place is told by its coordinate.
    let axis = usize::from(high.y - low.y > high.x - low.x);
    let first = ends.partition_point(|end| end.x < low.x);
    for end in ends[first..].iter().take_while(|end| end.x <= high.x) {
        if end.y < low.y || end.y > high.y {
            continue;
        }
        let place = *end - shift;
        let there = curve.crossings(axis, place[axis], near);
        cuts.extend(
            there
                .into_iter()
                .filter(|t| curve.evaluate(*t).distance(place) <= near),
        );
    }
    cuts.sort_by(f64::total_cmp);
    let divided = cuts.windows(2).flat_map(|pair| {
        let (from, step) = (pair[0], (pair[1] - pair[0]) / PARTS as f64);
        (0..PARTS).map(move |k| (from + step * k as f64, step))
    });
    divided.collect()
}

/// Point and derivative at a parameter of a trim curve, on the border where it leaves the
/// surface.
fn on_surface(
    surface: &Surface,
    curve: &Curve<DVec2>,
    shift: DVec2,
    [min, max]: [DVec2; 2],
    t: f64,
) -> (DVec3, DVec3) {
    let flat = curve.derivatives(t);
    let uv = (flat.point + shift).max(min).min(max);
    let d = surface.derivatives(uv);
    (d.point, d.du * flat.first.x + d.dv * flat.first.y)
}

/// Adds the ends of a part of a curve, and the points between where a coordinate turns round.
fn along(on: &impl Fn(f64) -> (DVec3, DVec3), part: [f64; 2], bounds: &mut Aabb) {
    let [first, last] = part.map(on);
    *bounds = bounds.including(first.0).including(last.0);
    for axis in 0..3 {
        if first.1[axis] * last.1[axis] >= 0.0 {
            continue;
        }
        let [mut from, mut to] = part;
        for _ in 0..STEPS {
            let middle = from.midpoint(to);
            if on(middle).1[axis] * first.1[axis] > 0.0 {
                from = middle;
            } else {
                to = middle;
            }
        }
        *bounds = bounds.including(on(from).0);
    }
}

/// The search for the point of a face that is farthest along one axis.
struct Search<'a> {
    axis: usize,
    sign: f64,
    slack: f64,
    region: Option<&'a TrimRegion>,
    best: Aabb,
}

impl Search<'_> {
    /// How far the box reaches.
    fn reach(&self, bounds: &Aabb) -> f64 {
        if self.sign > 0.0 {
            bounds.max[self.axis]
        } else {
            -bounds.min[self.axis]
        }
    }

    /// Looks at all parts of a piece that may reach farther than what is known.
    fn examine(&mut self, piece: &BezierSurface) {
        let mut waiting = vec![(piece.clone(), 0)];
        while let Some((part, level)) = waiting.pop() {
            if self.reach(&part.hull_bounds()) <= self.reach(&self.best) + self.slack {
                continue;
            }
            let (u, v) = (part.u(), part.v());
            let cover = match self.region {
                None => Cover::Inside,
                Some(region) => region.classify(u.clone(), v.clone()),
            };
            if cover == Cover::Outside {
                continue;
            }
            let net: Vec<DVec3> = part.points().collect();
            let row = part.degree_v() + 1;
            // Corners of the net are points of the surface.
            let middle = DVec2::new(u.start.midpoint(u.end), v.start.midpoint(v.end));
            let corners = [
                (DVec2::new(u.start, v.start), 0),
                (DVec2::new(u.start, v.end), row - 1),
                (DVec2::new(u.end, v.start), net.len() - row),
                (DVec2::new(u.end, v.end), net.len() - 1),
            ];
            for (corner, index) in corners {
                let shown = |region: &TrimRegion| {
                    // A little inside, so that corners on a border belong to the part.
                    region.contains(corner.lerp(middle, 1e-9))
                };
                if self.region.is_none_or(shown) {
                    self.best = self.best.including(net[index]);
                }
            }
            if self.reach(&part.hull_bounds()) <= self.reach(&self.best) + self.slack {
                continue;
            }
            // Inside there is nothing then. The loops have been looked at; the sides that it leads to may be a
            // ridge between two parts.
            if let Some(region) = self.region
                && (level >= RATIONAL_HALVINGS || !is_rational(&part))
                && let Some(way) = one_way(&net, row, self.axis)
            {
                self.examine_sides(&part, way, region);
                continue;
            }
            if level >= HALVINGS {
                continue;
            }
            let halves = if level % 2 == 0 {
                part.split_u(0.5)
            } else {
                part.split_v(0.5)
            };
            waiting.extend(halves.map(|half| (half, level + 1)));
        }
    }

    /// Looks at the sides at both ends of a direction.
    fn examine_sides(&mut self, part: &BezierSurface, way: usize, region: &TrimRegion) {
        for (at, side) in sides(part, way) {
            let mut waiting = vec![(side, 0)];
            while let Some((side, level)) = waiting.pop() {
                if self.reach(&side.hull_bounds()) <= self.reach(&self.best) + self.slack {
                    continue;
                }
                let Range { start, end } = side.domain();
                let cover = match way {
                    0 => region.classify(at..at, start..end),
                    _ => region.classify(start..end, at..at),
                };
                if cover == Cover::Outside {
                    continue;
                }
                let place = |t: f64| {
                    let mut uv = DVec2::splat(t);
                    uv[way] = at;
                    uv
                };
                for (t, point) in [(start, side.start()), (end, side.end())] {
                    if region.contains(place(t)) {
                        self.best = self.best.including(point);
                    }
                }
                let points: Vec<DVec3> = side.points().collect();
                let steps = points.windows(2).map(|pair| pair[1] - pair[0]);
                if level < HALVINGS
                    && !is_monotonous(steps.map(|step| step[self.axis]))
                    && let Ok(halves) = side.split(start.midpoint(end))
                {
                    waiting.extend(halves.map(|half| (half, level + 1)));
                }
            }
        }
    }
}

/// The sides of a part at both ends of a direction, as curves over the other one.
fn sides(part: &BezierSurface, way: usize) -> [(f64, Curve<DVec3>); 2] {
    let (net, row) = (part.homogeneous(), part.degree_v() + 1);
    let (ends, over, degree) = if way == 0 {
        (part.u(), part.v(), part.degree_v())
    } else {
        (part.v(), part.u(), part.degree_u())
    };
    let last = net.len() - row;
    let knots = [over.start, over.end].map(|end| vec![end; degree + 1]);
    let knots = KnotVector::trusted(degree, knots.concat());
    let side = |is_end: bool| -> Vec<DVec4> {
        match (way, is_end) {
            (0, false) => net[..row].to_vec(),
            (0, true) => net[last..].to_vec(),
            (_, false) => net.iter().step_by(row).copied().collect(),
            (_, true) => net[row - 1..].iter().step_by(row).copied().collect(),
        }
    };
    [(ends.start, false), (ends.end, true)]
        .map(|(at, is_end)| (at, Curve::trusted((knots.clone(), side(is_end)))))
}

fn is_rational(part: &BezierSurface) -> bool {
    let net = part.homogeneous();
    net.iter().any(|h| (h.w - net[0].w).abs() > 0.0)
}

/// The direction of a net along which a coordinate only grows or only falls, if there is one: no point inside is
/// extreme then.
fn one_way(net: &[DVec3], row: usize, axis: usize) -> Option<usize> {
    let across = net.iter().zip(&net[row..]).map(|(a, b)| b[axis] - a[axis]);
    if is_monotonous(across) {
        return Some(0);
    }
    let rows = net.chunks_exact(row);
    let along = rows.flat_map(|row| row.windows(2).map(|pair| pair[1][axis] - pair[0][axis]));
    is_monotonous(along).then_some(1)
}

/// Whether differences never change their sign.
fn is_monotonous(differences: impl Iterator<Item = f64>) -> bool {
    let (mut up, mut down) = (false, false);
    for difference in differences {
        up |= difference > 0.0;
        down |= difference < 0.0;
    }
    !(up && down)
}
