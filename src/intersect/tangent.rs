//! Where the ray all but touches the surface.
//!
//! Rounding hides the roots of a tangential ray in a stretch as long as the root of the
//! rounding error. Across that stretch the distance from the ray is a parabola, and its
//! vertex is known to full accuracy: it tells whether there are two roots, or none. What even
//! the vertex leaves open is asked again, of the surface and the ray themselves, with
//! distances of twice the precision.

use glam::{DAffine3, DVec2, DVec3};
use kernel::{Ray, Surface};

use super::net::evaluate_at;
use super::twofold::{self, Twofold};
use super::{Line, PieceNet, Root};

/// Steps towards the vertex; each gains several digits.
const STEPS: usize = 6;

/// Newton's steps to a root from where the parabola has it.
const ROOT_STEPS: usize = 3;

/// Steps of the difference that measures the curvature, in parameters of the piece.
const DIFFERENCE: f64 = 1e-3;

/// The vertex lies no further from an unresolved cell than this.
const NEARBY: f64 = 1e-3;

/// Below this curvature the distance is no parabola.
pub(super) const STRAIGHT: f64 = 1e-5;

/// Distances of twice the precision, relative to the size of the piece, are known to this.
const TWOFOLD_SLACK: f64 = 1e-28;

/// What was found near an unresolved cell.
pub(crate) enum Contact {
    /// The ray passes the surface by.
    None,
    /// It meets the surface in two points, or touches it in one.
    Roots([Option<Root>; 2]),
    /// It does not behave like a simple contact.
    Unclear,
}

/// Distances from two planes through a line, and their derivatives by u and by v.
#[derive(Clone, Copy, Debug)]
pub(super) struct Distances {
    value: DVec2,
    by_u: DVec2,
    by_v: DVec2,
}

/// A piece of a face at its place, and a ray that seems to touch it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch<'a> {
    pub(crate) surface: &'a Surface,
    pub(crate) world_from_surface: DAffine3,
    pub(crate) ray: &'a Ray,
    /// The piece's part of the domain: start and length along u and v.
    pub(crate) domain: [(f64, f64); 2],
    /// The size of the piece.
    pub(crate) size: f64,
    /// Bound on the rounding errors of distances relative to that size.
    pub(crate) slack: f64,
}

impl Touch<'_> {
    /// What becomes of a root that is blurred, or could not be proven to be a simple crossing.
    pub(crate) fn settled(&self, root: Root) -> [Option<Root>; 2] {
        let near = DVec2::new(root.u, root.v);
        if !root.tangential {
            let sharp = inside(refined(&|at| self.distances(at), near));
            let tangential = false;
            return [sharp.map(|root| Root { tangential, ..root }), None];
        }
        let slacks = [TWOFOLD_SLACK, self.slack];
        match contact(&|at| self.distances(at), near, slacks) {
            Contact::None => [None; 2],
            Contact::Roots(roots) => roots,
            Contact::Unclear => [Some(self.improved(root)), None],
        }
    }

    /// A root that is no simple contact, where Newton's steps lead to if they lead to a root.
    fn improved(&self, root: Root) -> Root {
        let at = refined(&|at| self.distances(at), DVec2::new(root.u, root.v));
        let off = self.distances(at).value.abs().max_element();
        let better = if off <= self.slack { inside(at) } else { None };
        better.unwrap_or(root)
    }

    /// As [`distances`], with values of twice the precision: only the parameters are rounded.
    fn distances(&self, at: DVec2) -> Distances {
        let [(u, length_u), (v, length_v)] = self.domain;
        let uv = DVec2::new(u + length_u * at.x, v + length_v * at.y);
        let Ray { origin, direction } = self.ray;
        let main = direction.abs().max_position();
        let across = [(main + 1) % 3, (main + 2) % 3];
        let scale = 1.0 / (direction[main] * self.size);
        let map = self.world_from_surface;
        let own = twofold::point(self.surface, uv);
        let place: [Twofold; 3] = std::array::from_fn(|axis| {
            let start = Twofold::from(map.translation[axis]) - Twofold::from(origin[axis]);
            (0..3).fold(start, |sum, k| sum + own[k] * map.matrix3.col(k)[axis])
        });
        let value = across.map(|axis| {
            let twofold = place[axis] * direction[main] - place[main] * direction[axis];
            twofold.rounded() * scale
        });
        let d = self.surface.derivatives(uv);
        let along = |d: DVec3, length: f64| {
            let d = map.transform_vector3(d) * length;
            DVec2::from_array(
                across.map(|axis| (d[axis] * direction[main] - d[main] * direction[axis]) * scale),
            )
        };
        Distances {
            value: value.into(),
            by_u: along(d.du, length_u),
            by_v: along(d.dv, length_v),
        }
    }
}

/// Distances in the units of a piece.
pub(super) fn distances(piece: &PieceNet<'_>, line: &Line, at: DVec2) -> Distances {
    let [value, by_u, by_v] = evaluate_at(piece, at.x, at.y).map(|h| {
        let x = h.truncate();
        DVec2::new(
            line.e1.dot(x) - line.c1 * h.w,
            line.e2.dot(x) - line.c2 * h.w,
        )
    });
    Distances { value, by_u, by_v }
}

/// Looks for the contact next to the parameters `near`; the slacks bound the errors of the
/// height of a vertex and of the distances of a root.
pub(super) fn contact(
    distances: &impl Fn(DVec2) -> Distances,
    near: DVec2,
    [slack, root_slack]: [f64; 2],
) -> Contact {
    let mut at = near;
    let mut vertex = None;
    for _ in 0..STEPS {
        let d = distances(at);
        // The direction in which the distances change most, and the one across.
        let along = if d.by_u.length_squared() >= d.by_v.length_squared() {
            d.by_u
        } else {
            d.by_v
        };
        let Some(m) = along.try_normalize() else {
            return Contact::Unclear;
        };
        let n = m.perp();
        let gradient = DVec2::new(m.dot(d.by_u), m.dot(d.by_v));
        let Some(r) = gradient.try_normalize() else {
            return Contact::Unclear;
        };
        let w = r.perp();
        // Curvature of the distance across, along the level line of the other: the level line
        // bends, which the change of the other distance tells.
        let [before, behind] = [-DIFFERENCE, DIFFERENCE].map(|s| distances(at + w * s).value);
        let bend = (before + behind - d.value * 2.0) / (DIFFERENCE * DIFFERENCE);
        let slope_r = n.dot(d.by_u * r.x + d.by_v * r.y) / gradient.length();
        let curvature = n.dot(bend) - slope_r * m.dot(bend);
        if curvature.abs() < STRAIGHT {
            return Contact::Unclear;
        }
        let slope_w =
            n.dot(d.by_u * w.x + d.by_v * w.y) - slope_r * m.dot(d.by_u * w.x + d.by_v * w.y);
        let across = -slope_w / curvature;
        let step = r * (-m.dot(d.value) / gradient.length()) + w * across;
        if !step.is_finite() || step.length() > NEARBY || at.distance(near) > NEARBY {
            return Contact::Unclear;
        }
        let height = n.dot(d.value) - slope_r * m.dot(d.value) + 0.5 * slope_w * across;
        at += step;
        vertex = Some((w, height, curvature));
        if step.length() < 1e-12 {
            break;
        }
    }
    let Some((w, height, curvature)) = vertex else {
        return Contact::Unclear;
    };
    let square = -2.0 * height / curvature;
    if height.abs() <= slack {
        return Contact::Roots([inside(at), None]);
    }
    if square < 0.0 {
        return Contact::None;
    }
    let reach = square.sqrt();
    let ends = [-reach, reach].map(|s| refined(distances, at + w * s));
    // A parabola that does not lead to roots was none.
    let off = |at: DVec2| distances(at).value.abs().max_element();
    if reach > NEARBY || !ends.iter().all(|&end| off(end) <= 4.0 * root_slack) {
        return Contact::Unclear;
    }
    Contact::Roots(ends.map(inside))
}

/// Newton's steps from a place next to a root.
fn refined(distances: &impl Fn(DVec2) -> Distances, mut at: DVec2) -> DVec2 {
    for _ in 0..ROOT_STEPS {
        let d = distances(at);
        let determinant = d.by_u.perp_dot(d.by_v);
        let step = DVec2::new(d.value.perp_dot(d.by_v), d.by_u.perp_dot(d.value)) / determinant;
        let is_small = step.length() < NEARBY;
        if !is_small {
            break;
        }
        at -= step;
    }
    at
}

fn inside(at: DVec2) -> Option<Root> {
    let within = |x: f64| (-1e-12..=1.0 + 1e-12).contains(&x);
    (within(at.x) && within(at.y)).then(|| Root {
        u: at.x.clamp(0.0, 1.0),
        v: at.y.clamp(0.0, 1.0),
        tangential: true,
        blurred: false,
        flat: false,
    })
}
