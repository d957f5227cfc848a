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

/// A coordinate has a value where it is off by less than this share of what it is at most.
const OFF: f64 = 1e-9;

/// A curve cut where one coordinate has one of the values.
pub(super) fn cut(
    curve: &Curve<DVec2>,
    axis: usize,
    values: &[f64],
) -> Result<Vec<Curve<DVec2>>, Error> {
    let beziers = curve.bezier_pieces();
    let mut cuts = Vec::new();
    for &value in values {
        let off = |p: DVec2| (p[axis] - value).abs();
        let near = OFF * curve.points().map(off).fold(0.0, f64::max);
        let is_there = |t: &f64| off(curve.evaluate(*t)) <= near;
        for piece in &beziers {
            let Range { start, end } = piece.domain();
            let offsets = piece.homogeneous().iter().map(|h| h[axis] - value * h.z);
            let mut found = Vec::new();
            roots(offsets.collect(), &mut found);
            let found = found.into_iter().filter(|t| *t <= 1.0);
            let found = found.map(|t| start + (end - start) * t);
            // Between pieces the sign may change without a change inside of one.
            cuts.extend(found.chain([end]).filter(is_there));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::KnotVector;

    #[test]
    fn curves_are_cut_where_they_pass_a_value_and_nowhere_else() {
        // Up and down by one from piece to piece, the last one a little beyond.
        let zigzag = [0.0, 1.0, 0.0, 1.0, 0.0, 1.0 + 1e-6, 0.5];
        let points: Vec<_> = (0..)
            .zip(zigzag)
            .map(|(k, y)| DVec2::new(f64::from(k), y))
            .collect();
        let line = Curve::polyline(&points).unwrap();
        let at = |value: f64| cut(&line, 1, &[value]).unwrap();
        assert_eq!(at(2.0), std::slice::from_ref(&line));
        // It turns at three of its corners, and passes the line twice beside the fourth.
        let ends: Vec<_> = at(1.0).iter().map(|piece| piece.end().x).collect();
        assert_eq!(ends.len(), 5, "{ends:?}");
        for (end, wanted) in ends.into_iter().zip([1.0, 3.0, 5.0, 5.0, 6.0]) {
            assert!((end - wanted).abs() < 1e-5, "{end} for {wanted}");
        }
        assert_eq!(at(0.5).len(), 6);
        // A bend of a smooth curve across a line: where it comes, and where it goes.
        let knots = KnotVector::clamped_uniform(2, 9, 0.0..1.0).unwrap();
        let bent = (0..9).map(|k| DVec2::new(f64::from(k), if k == 4 { 1.0 } else { 0.0 }));
        let bent = Curve::new(knots, &bent.collect::<Vec<_>>(), None).unwrap();
        let pieces = cut(&bent, 1, &[0.3]).unwrap();
        assert_eq!(pieces.len(), 3);
        for piece in &pieces[1..] {
            assert!((piece.start().y - 0.3).abs() < 1e-9);
        }
    }
}
