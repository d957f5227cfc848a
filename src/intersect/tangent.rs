//! Where the ray all but touches the surface.
//!
//! Rounding hides the roots of a tangential ray in a stretch as long as the root of the
//! rounding error. Across that stretch the distance from the ray is a parabola, and its
//! vertex is known to full accuracy: it tells whether there are two roots, or none.

use glam::DVec2;

use super::net::evaluate_at;
use super::{Line, PieceNet, Root};

/// Steps towards the vertex; each gains several digits.
const STEPS: usize = 6;

/// Steps of the difference that measures the curvature, in parameters of the piece.
const DIFFERENCE: f64 = 1e-3;

/// The vertex lies no further from an unresolved cell than this.
const NEARBY: f64 = 1e-3;

/// Below this curvature the distance is no parabola.
const STRAIGHT: f64 = 1e-5;

/// What was found near an unresolved cell.
pub(crate) enum Contact {
    /// The ray passes the surface by.
    None,
    /// It meets the surface in two points, or touches it in one.
    Roots([Option<Root>; 2]),
    /// It does not behave like a simple contact.
    Unclear,
}

/// Distances from the two planes of a line, and their derivatives by u and by v.
struct Distances {
    value: DVec2,
    by_u: DVec2,
    by_v: DVec2,
}

fn distances(piece: &PieceNet<'_>, line: &Line, at: DVec2) -> Distances {
    let [value, by_u, by_v] = evaluate_at(piece, at.x, at.y).map(|h| {
        let x = h.truncate();
        DVec2::new(
            line.e1.dot(x) - line.c1 * h.w,
            line.e2.dot(x) - line.c2 * h.w,
        )
    });
    Distances { value, by_u, by_v }
}

/// Looks for the contact next to the parameters `near`.
pub(crate) fn contact(piece: &PieceNet<'_>, line: &Line, near: DVec2) -> Contact {
    let mut at = near;
    let mut vertex = None;
    for _ in 0..STEPS {
        let d = distances(piece, line, at);
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
        let [before, behind] =
            [-DIFFERENCE, DIFFERENCE].map(|s| distances(piece, line, at + w * s).value);
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
    if height.abs() <= line.slack {
        return Contact::Roots([inside(at), None]);
    }
    if square < 0.0 {
        return Contact::None;
    }
    let reach = square.sqrt();
    let ends = [-reach, reach].map(|s| refined(piece, line, at + w * s));
    // A parabola that does not lead to roots was none.
    let off = |at: DVec2| distances(piece, line, at).value.abs().max_element();
    if reach > NEARBY || !ends.iter().all(|&end| off(end) <= 4.0 * line.slack) {
        return Contact::Unclear;
    }
    Contact::Roots(ends.map(inside))
}

/// One Newton step from a place next to a root.
fn refined(piece: &PieceNet<'_>, line: &Line, at: DVec2) -> DVec2 {
    let d = distances(piece, line, at);
    let determinant = d.by_u.perp_dot(d.by_v);
    let step = DVec2::new(d.value.perp_dot(d.by_v), d.by_u.perp_dot(d.value)) / determinant;
    if step.length() < NEARBY {
        at - step
    } else {
        at
    }
}

fn inside(at: DVec2) -> Option<Root> {
    let within = |x: f64| (-1e-12..=1.0 + 1e-12).contains(&x);
    (within(at.x) && within(at.y)).then(|| Root {
        u: at.x.clamp(0.0, 1.0),
        v: at.y.clamp(0.0, 1.0),
        tangential: true,
    })
}
