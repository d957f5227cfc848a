//! The least box around a face: its extreme points, inside and along its boundary.

use glam::{DVec2, DVec3};

use crate::trim::{aside, shifts};
use crate::{Aabb, BezierSurface, Cover, Curve, Patch, Surface, TrimRegion};

/// How far the box may be too small, as a share of the size of the control net.
pub(super) const ACCURACY: f64 = 1e-8;

/// Parts of each piece of a trim curve that are searched for an extreme point.
const PARTS: usize = 16;

/// Halvings of such a part.
const STEPS: usize = 50;

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
    let closed = surface.closed();
    let is_alone = patch.loops.len() == 1;
    for trim in &patch.loops {
        for shift in shifts(trim, corners, closed) {
            for curve in trim.segments().iter().flat_map(Curve::bezier_pieces) {
                let on = |t: f64| on_surface(surface, &curve, shift, corners, t);
                let domain = curve.domain();
                let step = (domain.end - domain.start) / PARTS as f64;
                for k in 0..PARTS {
                    let from = domain.start + step * k as f64;
                    let divides = |share: &f64| {
                        let (point, left) = aside(&curve, from + step * share, size);
                        let point = point + shift;
                        region.contains(point + left) != region.contains(point - left)
                    };
                    if is_alone || [0.01, 0.5, 0.99].iter().any(divides) {
                        along(&on, [from, from + step], bounds);
                    }
                }
            }
        }
    }
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
            let is_settled = is_monotonous(&net, row, self.axis)
                && (level >= RATIONAL_HALVINGS || !is_rational(&part));
            // The border has been looked at where there are loops.
            if level >= HALVINGS || (is_settled && self.region.is_some()) {
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
}

fn is_rational(part: &BezierSurface) -> bool {
    let net = part.homogeneous();
    net.iter().any(|h| (h.w - net[0].w).abs() > 0.0)
}

/// Whether a coordinate only grows or only falls along one of the directions of a net: there
/// is no extreme point inside then.
fn is_monotonous(net: &[DVec3], row: usize, axis: usize) -> bool {
    let one_way = |differences: &mut dyn Iterator<Item = f64>| {
        let (mut up, mut down) = (false, false);
        for difference in differences {
            up |= difference > 0.0;
            down |= difference < 0.0;
        }
        !(up && down)
    };
    let across = &mut net.iter().zip(&net[row..]).map(|(a, b)| b[axis] - a[axis]);
    let rows = net.chunks_exact(row);
    let along = &mut rows.flat_map(|row| row.windows(2).map(|pair| pair[1][axis] - pair[0][axis]));
    one_way(across) || one_way(along)
}
