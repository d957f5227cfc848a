//! Curves of the parameter domain at the pace of their edge.
//!
//! An edge has one curve in space, and other programs take points of equal parameters on it and on the
//! curves in the domains of both faces for the same. In a plane the edge itself is such a curve, exactly;
//! elsewhere the old curve is run through anew, by cubic pieces that a straight one keeps straight.

use glam::{DVec2, DVec3};
use kernel::{Curve, Error, KnotVector, Surface};

use super::cubic::{self, End};
use super::pieces::Pieces;
use crate::iges::sheets;

/// How often a piece is halved at most.
const HALVINGS: u32 = 8;

/// Where between two ends a piece is compared with the curve.
const LOOKS: [f64; 3] = [0.5, 0.25, 0.75];

/// Curves are compared at the ends of so many parts.
const PLACES: u8 = 16;

/// Whether points of equal shares of two curves are no farther apart than that.
pub(super) fn is_same(one: &Curve<DVec3>, other: &Curve<DVec3>, near: f64) -> bool {
    let (p, q) = (one.domain(), other.domain());
    (0..=PLACES).all(|k| {
        let share = f64::from(k) / f64::from(PLACES);
        let at = |from: f64, to: f64| from + (to - from) * share;
        let [a, b] = [
            one.evaluate(at(p.start, p.end)),
            other.evaluate(at(q.start, q.end)),
        ];
        a.distance(b) <= near
    })
}

/// Whether a surface is a plane in which curves of space have exact images.
pub(super) fn is_plane(surface: &Surface) -> bool {
    sheets::parallelogram(surface).is_some()
}

/// The image of a curve of space in a plane, between these ends; `None` if it is none.
pub(super) fn in_plane(
    surface: &Surface,
    edge: &Curve<DVec3>,
    ends: [DVec2; 2],
) -> Option<Curve<DVec2>> {
    let image = sheets::in_parallelogram(surface, sheets::parallelogram(surface)?, edge)?;
    // Clamped, it begins and ends in control points.
    let image = image.restricted(image.domain()).ok()?;
    let mut points: Vec<_> = image.points().collect();
    let last = points.len() - 1;
    (points[0], points[last]) = (ends[0], ends[1]);
    let weights: Vec<_> = image.weights().collect();
    Curve::new(image.knots().clone(), &points, Some(&weights)).ok()
}

/// A curve of the parameter domain run through at the pace of an edge; `own` is what it is in space.
///
/// # Errors
/// If its numbers are not finite.
pub(super) fn paced(
    flat: &Curve<DVec2>,
    own: &Curve<DVec3>,
    edge: &Curve<DVec3>,
    near: f64,
) -> Result<Curve<DVec2>, Error> {
    let pacer = Pacer {
        flat,
        own,
        pieces: Pieces::of(own),
        edge,
        near,
    };
    let breaks = edge.knots().breaks();
    let ends = cubic::ends(
        pacer.end(breaks[0]),
        breaks[1..].iter().map(|&t| pacer.end(t)),
        HALVINGS,
        |t| pacer.end(t),
        |first, last| pacer.fits(first, last),
    );
    let (mut knots, mut points) = (vec![ends[0].t; 4], vec![ends[0].point]);
    for (k, pair) in ends.windows(2).enumerate() {
        if k > 0 {
            knots.extend([pair[0].t; 2]);
        }
        points.extend(cubic::inner(pair[0], pair[1]));
    }
    points.push(flat.end());
    knots.extend([breaks[breaks.len() - 1]; 4]);
    Curve::new(KnotVector::new(3, knots)?, &points, None)
}

/// A curve and the edge that it follows.
struct Pacer<'a> {
    flat: &'a Curve<DVec2>,
    own: &'a Curve<DVec3>,
    pieces: Pieces,
    edge: &'a Curve<DVec3>,
    near: f64,
}

impl Pacer<'_> {
    /// The parameter of the curve where it is nearest to a point of the edge.
    fn parameter(&self, t: f64) -> f64 {
        let (own, edge) = (self.own.domain(), self.edge.domain());
        if t <= edge.start {
            return own.start;
        }
        if t >= edge.end {
            return own.end;
        }
        let point = self.edge.evaluate(t);
        let near = self.pieces.nearest(point, self.near);
        let nearest = near.or_else(|| self.pieces.nearest(point, f64::INFINITY));
        let mut s = nearest.map_or(own.start, |(s, _)| s);
        // Distances tell half of the digits; where they do not change any more tells the others.
        for _ in 0..2 {
            let at = self.own.derivatives(s);
            let step = (point - at.point).dot(at.first) / at.first.length_squared();
            if step.is_finite() {
                s = (s + step).clamp(own.start, own.end);
            }
        }
        s
    }

    fn end(&self, t: f64) -> End<DVec2> {
        let s = self.parameter(t);
        let (flat, own) = (self.flat.derivatives(s), self.own.derivatives(s));
        let pace = self.edge.derivatives(t).first.dot(own.first) / own.first.length_squared();
        let pace = if pace.is_finite() { pace } else { 0.0 };
        End {
            t,
            point: flat.point,
            tangent: flat.first * pace,
        }
    }

    /// Whether the cubic between two ends keeps the pace.
    fn fits(&self, first: End<DVec2>, last: End<DVec2>) -> bool {
        let span = last.t - first.t;
        LOOKS.iter().all(|&share| {
            let cubic = cubic::between(first, last, share);
            let s = self.parameter(first.t + span * share);
            let (flat, own) = (self.flat.derivatives(s), self.own.derivatives(s));
            let scale = own.first.length() / flat.first.length();
            cubic.distance(flat.point) * scale <= self.near
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter of a circle; the larger the number, the later it is in its middle.
    fn quarter(late: f64) -> Curve<DVec3> {
        let corners = [[2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let corners = corners.map(|[x, y]| DVec3::new(x, y, 1.0));
        let weights = [1.0, late * 0.5_f64.sqrt(), late * late];
        let knots = KnotVector::bezier(2, 0.0..1.0).unwrap();
        Curve::new(knots, &corners, Some(&weights)).unwrap()
    }

    #[test]
    fn a_line_at_the_pace_of_an_edge_stays_a_line() {
        let (own, edge) = (quarter(1.0), quarter(0.5));
        assert!(!is_same(&own, &edge, 0.1));
        let flat = Curve::line([0.0, 3.0].into(), [1.0, 3.0].into(), 0.0..1.0).unwrap();
        let paced = paced(&flat, &own, &edge, 1e-6).unwrap();
        for k in 0..=100 {
            let t = f64::from(k) / 100.0;
            let uv = paced.evaluate(t);
            let off = own.evaluate(uv.x).distance(edge.evaluate(t));
            assert!(off < 2e-6 && (uv.y - 3.0).abs() < 1e-14, "{t}: {off}");
        }
        assert_eq!([paced.start(), paced.end()], [flat.start(), flat.end()]);
    }

    #[test]
    fn in_a_plane_an_edge_is_its_own_image() {
        let knots = || KnotVector::bezier(1, 0.0..4.0).unwrap();
        let corners = [[0.0, 0.0], [0.0, 4.0], [4.0, 0.0], [4.0, 4.0]];
        let corners = corners.map(|[x, y]| DVec3::new(x, y, 1.0));
        let plane = Surface::new(knots(), knots(), &corners, None).unwrap();
        assert!(is_plane(&plane));
        let edge = quarter(0.5);
        let ends = [[2.0, 0.0], [0.0, 2.0]].map(DVec2::from);
        let image = in_plane(&plane, &edge, ends).unwrap();
        for t in [0.0, 0.3, 0.5, 1.0] {
            let point = image.evaluate(t).extend(1.0);
            assert!(point.distance(edge.evaluate(t)) < 1e-14, "{t}");
        }
    }
}
