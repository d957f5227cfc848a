//! Curves of a parameter domain that are cut, moved, or moved a little at their control points.

use std::ops::Range;

use glam::{DAffine2, DVec2};

use super::monotone::roots;
use crate::{Curve, Error};

/// A curve moved in the parameter domain.
pub(super) fn moved(curve: &Curve<DVec2>, shift: DVec2) -> Curve<DVec2> {
    if shift == DVec2::ZERO {
        return curve.clone();
    }
    curve.transformed(&DAffine2::from_translation(shift))
}

/// A curve with those control points that are next to the border of a range, by the share `near`
/// of it, moved into it.
pub(super) fn snapped(
    curve: &Curve<DVec2>,
    axis: usize,
    range: &Range<f64>,
    near: f64,
) -> Result<Curve<DVec2>, Error> {
    let near = near * (range.end - range.start);
    let mut points: Vec<_> = curve.points().collect();
    for point in &mut points {
        let inside = point[axis].clamp(range.start, range.end);
        if (inside - point[axis]).abs() <= near {
            point[axis] = inside;
        }
    }
    with_points(curve, &points)
}

/// A curve that ends elsewhere, with its last control point there; `None` if it does not end in
/// that point, to the last bit.
pub(super) fn ended(curve: &Curve<DVec2>, end: DVec2) -> Result<Option<Curve<DVec2>>, Error> {
    let mut points: Vec<_> = curve.points().collect();
    if let Some(last) = points.last_mut() {
        *last = end;
    }
    Ok(Some(with_points(curve, &points)?).filter(|ended| ended.end() == end))
}

/// A curve with other control points.
fn with_points(curve: &Curve<DVec2>, points: &[DVec2]) -> Result<Curve<DVec2>, Error> {
    let weights: Vec<_> = curve.weights().collect();
    let weights = curve.is_rational().then_some(weights.as_slice());
    Curve::new(curve.knots().clone(), points, weights)
}

/// A curve cut where one coordinate has one of the values.
pub(super) fn cut(
    curve: &Curve<DVec2>,
    axis: usize,
    values: &[f64],
) -> Result<Vec<Curve<DVec2>>, Error> {
    let mut cuts = Vec::new();
    for piece in curve.bezier_pieces() {
        let domain = piece.domain();
        for &value in values {
            let offsets = piece.homogeneous().iter().map(|h| h[axis] - value * h.z);
            let mut found = Vec::new();
            roots(offsets.collect(), &mut found);
            let at = |t: f64| domain.start + (domain.end - domain.start) * t;
            cuts.extend(found.into_iter().filter(|t| *t <= 1.0).map(at));
            cuts.push(domain.end);
        }
    }
    cuts.sort_by(f64::total_cmp);
    let mut pieces = Vec::new();
    let mut rest = curve.clone();
    for t in cuts {
        let Range { start, end } = rest.domain();
        let least = 1e-12 * (end - start);
        if t - start > least && end - t > least {
            let [before, after] = rest.split(t)?;
            pieces.push(before);
            rest = after;
        }
    }
    pieces.push(rest);
    Ok(pieces)
}
