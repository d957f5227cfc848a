//! Curves on surfaces, from their parameters to space.

use glam::{DVec2, DVec3};
use kernel::{Curve, Surface, modelling};

use crate::Problem;

/// How far such a curve may stray from its surface, relative to the size of the surface.
pub(crate) const ACCURACY: f64 = 1e-9;

/// A curve of parameters as a curve of space, within [`ACCURACY`]; `point` is the point of the
/// surface at parameters, also at those beside its domain.
pub(crate) fn onto(
    surface: &Surface,
    curve: &Curve<DVec2>,
    point: impl Fn(DVec2) -> DVec3,
) -> Result<modelling::Fit<DVec3>, Problem> {
    let mut breaks = curve.knots().breaks();
    for (axis, knots) in [surface.knots_u(), surface.knots_v()].iter().enumerate() {
        let near = ACCURACY * (knots.domain().end - knots.domain().start);
        let inside = curve
            .points()
            .fold(f64::INFINITY..f64::NEG_INFINITY, |r, p| {
                r.start.min(p[axis])..r.end.max(p[axis])
            });
        // Where the surface is not smooth, the curve need not be.
        for knot in knots.breaks().into_iter().filter(|k| inside.contains(k)) {
            breaks.extend(curve.crossings(axis, knot, near));
        }
    }
    let range = curve.domain();
    let near = 1e-12 * (range.end - range.start);
    breaks.sort_by(f64::total_cmp);
    breaks.dedup_by(|b, a| *b - *a <= near);
    if let Some(last) = breaks.last_mut() {
        *last = range.end;
    }
    let tolerance = ACCURACY * surface.hull_bounds().diagonal();
    let at = |t: f64| point(curve.evaluate(t));
    Ok(modelling::fit(at, &breaks, tolerance, DVec3::distance)?)
}
