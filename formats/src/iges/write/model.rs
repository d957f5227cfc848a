//! Trim curves in space: what a curve of the parameter domain is on its surface.
//!
//! They are there for readers that do not look at the curves of the parameter domain, which
//! stay the masters. Single lines of constant u or v are exact; others are cubic pieces within
//! a tolerance, which end where they pass knots of the surface. What leaves the domain runs along
//! the border of the surface.

use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::{Curve, Error, KnotVector, Surface};

use super::cubic::{self, End};

/// How far curves may be from their surface, as a share of its size.
const TOLERANCE: f64 = 1e-7;

/// How many times around a closed surface knots are looked for at most.
const TURNS: f64 = 4.0;

/// How often a piece is halved at most.
const HALVINGS: u32 = 10;

/// Derivatives that differ by less, as a share of their length, are the same.
const SMOOTH: f64 = 1e-8;

/// Largest distance from a knot, as a share of all, that is rounding.
const ROUNDING: f64 = 1e-12;

/// Directions at the ends of a part are taken by this share of it inside, on its own side of a knot.
const ASIDE: f64 = 1e-10;

/// Where between two ends a piece is compared with the surface.
const LOOKS: [f64; 5] = [0.5, 0.25, 0.75, 0.1, 0.9];

/// A surface that trim curves lie on.
#[derive(Clone, Debug)]
pub(super) struct Carrier<'a> {
    surface: &'a Surface,
    domain: [Range<f64>; 2],
    /// The knots along u and v, each once.
    breaks: [Vec<f64>; 2],
    /// Whether it comes back to its start along u, and along v.
    closed: [bool; 2],
    tolerance: f64,
}

impl<'a> Carrier<'a> {
    /// A surface, and whether it comes back to its start along u and v.
    pub(super) fn new(surface: &'a Surface, closed: [bool; 2]) -> Self {
        let domain = [surface.knots_u().domain(), surface.knots_v().domain()];
        Self {
            surface,
            domain,
            breaks: [surface.knots_u().breaks(), surface.knots_v().breaks()],
            closed,
            tolerance: surface.hull_bounds().diagonal() * TOLERANCE,
        }
    }

    /// The curve in space over the same parameters.
    ///
    /// # Errors
    /// If its numbers are not finite.
    pub(super) fn lift(&self, curve: &Curve<DVec2>) -> Result<Curve<DVec3>, Error> {
        match self.iso_curve(curve) {
            Some(exact) => exact,
            None => self.approximate(curve),
        }
    }

    /// The curve of a straight segment along which u or v stays the same.
    fn iso_curve(&self, curve: &Curve<DVec2>) -> Option<Result<Curve<DVec3>, Error>> {
        let (start, end) = (curve.start(), curve.end());
        let axis = axis_along(curve)?;
        // What is outside by rounding is on the border.
        let inside = |place: DVec2| {
            let at = |axis: usize| self.inside(axis, place[axis]);
            Some(DVec2::new(at(0)?, at(1)?))
        };
        let (start, end) = (inside(start)?, inside(end)?);
        let (from, to) = (start[axis], end[axis]);
        let range = from.min(to)..from.max(to);
        let whole = match axis {
            0 => self.surface.iso_curve_v(start.y),
            _ => self.surface.iso_curve_u(start.x),
        };
        // What ends beside a knot ends at it: of less nobody could tell the direction.
        let snapped = whole.knots().snapped(range.clone(), ROUNDING);
        let part = whole.restricted(if snapped.is_empty() { range } else { snapped });
        let turned = part.map(|part| if from < to { part } else { part.reversed() });
        Some(turned.and_then(|part| part.remapped(curve.domain())))
    }

    /// The curve as cubic pieces that have its points and tangents at their ends.
    fn approximate(&self, curve: &Curve<DVec2>) -> Result<Curve<DVec3>, Error> {
        let mut knots = Vec::new();
        let mut points: Vec<DVec3> = Vec::new();
        let mut before: Option<End<DVec3>> = None;
        for (piece, range) in curve.bezier_pieces().iter().flat_map(|p| self.parts(p)) {
            let ends = self.ends(piece, range);
            if let (Some(before), Some(first)) = (before, ends.first()) {
                let size = before.tangent.length().max(first.tangent.length());
                let is_smooth = before.tangent.distance(first.tangent) <= size * SMOOTH;
                knots.extend(vec![first.t; if is_smooth { 2 } else { 3 }]);
                if !is_smooth {
                    points.push(first.point);
                }
            } else {
                points.extend(ends.first().map(|end| end.point));
            }
            for (index, pair) in ends.windows(2).enumerate() {
                if index > 0 {
                    knots.extend([pair[0].t; 2]);
                }
                points.extend(cubic::inner(pair[0], pair[1]));
            }
            before = ends.last().copied();
        }
        points.extend(before.map(|end| end.point));
        let Range { start, end } = curve.domain();
        let knots = [vec![start; 4], knots, vec![end; 4]].concat();
        Curve::new(KnotVector::new(3, knots)?, &points, None)
    }

    /// A Bézier piece and the parts of its domain over which the surface is smooth: they end where
    /// it passes a knot, or the border.
    fn parts<'p>(&self, piece: &'p Curve<DVec2>) -> Vec<(&'p Curve<DVec2>, Range<f64>)> {
        let Range { start, end } = piece.domain();
        let mut ends = vec![start, end];
        for axis in 0..2 {
            let places = || piece.points().map(move |point| point[axis]);
            let low = places().fold(f64::INFINITY, f64::min);
            let high = places().fold(f64::NEG_INFINITY, f64::max);
            let domain = &self.domain[axis];
            let period = domain.end - domain.start;
            let near = period * ROUNDING;
            // A closed surface goes on beyond its borders.
            let turns = if self.closed[axis] && low.is_finite() && high.is_finite() {
                let [first, last] = [low, high].map(|x| ((x - domain.start) / period).floor());
                [first.max(-TURNS), last.min(TURNS)]
            } else {
                [0.0; 2]
            };
            let mut turn = turns[0];
            while turn <= turns[1] {
                for knot in &self.breaks[axis] {
                    let knot = knot + period * turn;
                    if low + near < knot && knot < high - near {
                        ends.extend(piece.crossings(axis, knot, near));
                    }
                }
                turn += 1.0;
            }
        }
        ends.sort_by(f64::total_cmp);
        let least = (end - start) * ASIDE;
        ends.dedup_by(|next, kept| *next - *kept <= least);
        if let Some(last) = ends.last_mut() {
            *last = end;
        }
        let parts = ends.windows(2).map(|pair| (piece, pair[0]..pair[1]));
        parts.collect()
    }

    /// The ends of the cubic pieces along a part of a Bézier piece.
    fn ends(&self, piece: &Curve<DVec2>, Range { start, end }: Range<f64>) -> Vec<End<DVec3>> {
        let aside = (end - start) * ASIDE;
        let at = |t: f64, beside: f64| End {
            tangent: self.end(piece, beside).tangent,
            ..self.end(piece, t)
        };
        cubic::ends(
            at(start, start + aside),
            std::iter::once(at(end, end - aside)),
            HALVINGS,
            |t| self.end(piece, t),
            |first, last| self.fits(piece, first, last),
        )
    }

    /// Whether the cubic between two ends stays by the surface.
    fn fits(&self, piece: &Curve<DVec2>, first: End<DVec3>, last: End<DVec3>) -> bool {
        let span = last.t - first.t;
        LOOKS.iter().all(|&share| {
            let cubic = cubic::between(first, last, share);
            let exact = self.end(piece, first.t + span * share).point;
            cubic.distance(exact) <= self.tolerance
        })
    }

    /// A parameter that is inside of the domain but for rounding.
    fn inside(&self, axis: usize, x: f64) -> Option<f64> {
        let Range { start, end } = self.domain[axis];
        let near = (end - start) * ROUNDING;
        (start - near <= x && x <= end + near).then(|| x.clamp(start, end))
    }

    /// Point and tangent at a parameter of a curve.
    fn end(&self, curve: &Curve<DVec2>, t: f64) -> End<DVec3> {
        let flat = curve.derivatives(t);
        let (mut uv, mut along) = (flat.point, flat.first);
        for axis in 0..2 {
            let Range { start, end } = self.domain[axis];
            if let Some(inside) = self.inside(axis, uv[axis]) {
                uv[axis] = inside;
            } else if self.closed[axis] {
                uv[axis] = start + (uv[axis] - start).rem_euclid(end - start);
            } else {
                uv[axis] = uv[axis].clamp(start, end);
                along[axis] = 0.0;
            }
        }
        let d = self.surface.derivatives(uv);
        End {
            t,
            point: d.point,
            tangent: d.du * along.x + d.dv * along.y,
        }
    }
}

/// The axis of the domain along which a straight curve runs, if it does.
pub(super) fn axis_along(curve: &Curve<DVec2>) -> Option<usize> {
    if curve.degree() != 1 || curve.knots().count() != 2 || curve.is_rational() {
        return None;
    }
    match (curve.end() - curve.start()).to_array() {
        [0.0, along] if along != 0.0 => Some(1),
        [along, 0.0] if along != 0.0 => Some(0),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter of a cylinder of radius 2 along z.
    fn quarter() -> Surface {
        let arc = KnotVector::bezier(2, 0.0..1.0).unwrap();
        let line = KnotVector::bezier(1, 0.0..3.0).unwrap();
        let corners = [[2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let points = corners.map(|[x, y]| [DVec3::new(x, y, 0.0), DVec3::new(x, y, 3.0)]);
        let weights = [1.0, 1.0, 0.5_f64.sqrt(), 0.5_f64.sqrt(), 1.0, 1.0];
        Surface::new(arc, line, points.as_flattened(), Some(&weights)).unwrap()
    }

    fn assert_by(surface: &Surface, flat: &Curve<DVec2>, tolerance: f64) -> Curve<DVec3> {
        let carrier = Carrier::new(surface, [false; 2]);
        let lifted = carrier.lift(flat).unwrap();
        let Range { start, end } = flat.domain();
        assert_eq!(lifted.domain(), start..end);
        for k in 0..=1000 {
            let t = start + (end - start) * f64::from(k) / 1000.0;
            let exact = surface.evaluate(flat.evaluate(t));
            let found = lifted.evaluate(t).distance(exact);
            assert!(found <= tolerance, "{t}: {found}");
        }
        lifted
    }

    #[test]
    fn lines_of_constant_parameters_are_exact() {
        let surface = quarter();
        let ends = [[0.1, 2.0], [0.7, 2.0], [0.7, 0.5]].map(DVec2::from);
        for [a, b] in [[0, 1], [1, 0], [1, 2]] {
            let line = Curve::line(ends[a], ends[b], 5.0..7.0).unwrap();
            let lifted = assert_by(&surface, &line, 1e-14);
            assert_eq!(lifted.degree(), if b == 2 { 1 } else { 2 });
        }
    }

    #[test]
    fn other_curves_keep_to_the_tolerance() {
        let surface = quarter();
        let corners = [[0.0, 0.0], [0.4, 2.0], [1.0, 0.3]].map(DVec2::from);
        let polyline = Curve::polyline(&corners).unwrap();
        let lifted = assert_by(&surface, &polyline, 6e-7);
        // The corner of the polyline is a corner in space.
        let knots = lifted.knots().as_slice();
        assert_eq!(
            knots.iter().filter(|t| (**t - 1.0).abs() < 1e-15).count(),
            3
        );
        let knots = KnotVector::clamped_uniform(2, 4, 0.0..1.0).unwrap();
        let bent = [[0.0, 0.0], [0.4, 2.0], [1.0, 0.3], [1.0, 3.0]].map(DVec2::from);
        let bent = Curve::new(knots, &bent, None).unwrap();
        assert_by(&surface, &bent, 6e-7);
    }

    #[test]
    fn what_lies_between_knots_of_the_surface_is_followed() {
        // A plate of ten pieces along u with a ridge over one of them, and a bend along v.
        let u = KnotVector::clamped_uniform(1, 11, 0.0..10.0).unwrap();
        let v = KnotVector::clamped_uniform(1, 3, 0.0..4.0).unwrap();
        let height = |i: u32, j: u32| f64::from(u8::from(i == 2)) + 0.5 * f64::from(j % 2);
        let points: Vec<_> = (0..11)
            .flat_map(|i| (0..3).map(move |j| (i, j)))
            .map(|(i, j)| DVec3::new(f64::from(i), 2.0 * f64::from(j), height(i, j)))
            .collect();
        let surface = Surface::new(u, v, &points, None).unwrap();
        let around = [[0.0, 0.0], [10.0, 0.0], [10.0, 3.0], [0.0, 3.0], [0.0, 0.0]];
        let slanted = [[0.3, 0.2], [9.7, 3.9], [2.0, 0.0], [2.0, 4.0]];
        for corners in [&around[..], &slanted[..]] {
            let corners: Vec<_> = corners.iter().copied().map(DVec2::from).collect();
            let polyline = Curve::polyline(&corners).unwrap();
            assert_by(&surface, &polyline, 2e-6);
        }
    }

    #[test]
    fn what_leaves_the_domain_by_rounding_is_on_its_border() {
        let surface = quarter();
        let beyond = 1.0_f64.next_up();
        for ends in [[[0.1, 2.0], [beyond, 2.0]], [[beyond, 0.0], [beyond, 3.0]]] {
            let [a, b] = ends.map(DVec2::from);
            let line = Curve::line(a, b, 0.0..1.0).unwrap();
            assert_by(&surface, &line, 1e-14);
            let polyline = Curve::polyline(&[a, a.midpoint(b) + DVec2::Y * 0.01, b]).unwrap();
            assert_by(&surface, &polyline, 6e-7);
        }
    }
}
