//! Where curves of a parameter plane meet.

use glam::DVec2;

use super::Work;
use crate::{Curve, Error};

/// Steps of Newton's method, and points of a curve from which it is begun.
const STEPS: usize = 20;
const STARTS: u32 = 16;

/// A step after which a crossing is found.
const EXACT: f64 = 1e-15;

/// Curves are lines if they are off one by no more than this share of their length; lines that cross by a
/// larger sine than the other cross once.
const BENT: f64 = 0.02;
const CLEAR: f64 = 0.2;

/// Parts shorter than this share of their curve are not halved.
const SHORT: f64 = 1e-9;

/// Pairs of parts looked at for two curves, at most.
const MOST: usize = 3000;

/// Where it is looked whether a stretch is in common.
const CHECKS: [f64; 3] = [0.25, 0.5, 0.7];

/// Where it is looked whether curves are one.
const SAMPLES: [f64; 5] = [0.13, 0.29, 0.5, 0.77, 0.93];

/// The parameters at which each curve is to be cut so that all meet at their ends only, within `near`.
pub(super) fn cuts(
    curves: &[Curve<DVec2>],
    near: f64,
    work: &Work,
) -> Result<Vec<Vec<f64>>, Error> {
    let mut all = vec![Vec::new(); curves.len()];
    for (i, a) in curves.iter().enumerate() {
        for (j, b) in curves.iter().enumerate().take(i) {
            for (t, s) in meetings(a, b, near, work)? {
                all[i].push(t);
                all[j].push(s);
            }
        }
    }
    for (curve, cuts) in curves.iter().zip(&mut all) {
        cuts.sort_by(f64::total_cmp);
        let mut last = curve.start();
        let end = curve.end();
        cuts.retain(|&t| {
            let point = curve.evaluate(t);
            let is_kept = point.distance(last) > near && point.distance(end) > near;
            if is_kept {
                last = point;
            }
            is_kept
        });
    }
    Ok(all)
}

/// Whether a curve lies on another one, by some of its points.
pub(super) fn is_same(a: &Curve<DVec2>, b: &Curve<DVec2>, near: f64) -> bool {
    let domain = a.domain();
    let at = |share: f64| a.evaluate(domain.start + (domain.end - domain.start) * share);
    SAMPLES.iter().all(|&share| nearest(b, at(share)).1 <= near)
}

/// The parameters of two curves at which they meet, as far as they cross, end on each other, or have the end
/// of a stretch in common.
pub(super) fn meetings(
    a: &Curve<DVec2>,
    b: &Curve<DVec2>,
    near: f64,
    work: &Work,
) -> Result<Vec<(f64, f64)>, Error> {
    let mut found = Vec::new();
    if are_apart(a, b, near) {
        return Ok(found);
    }
    let others = b.bezier_pieces();
    for own in a.bezier_pieces() {
        for other in &others {
            work.take(1)?;
            meet(&own, other, near, work, &mut found)?;
        }
    }
    Ok(found)
}

/// The nearest parameter of a curve to a point, and the distance there.
pub(super) fn nearest(curve: &Curve<DVec2>, point: DVec2) -> (f64, f64) {
    let domain = curve.domain();
    let distance = |t: f64| (t, curve.evaluate(t).distance(point));
    let start =
        |i: u32| domain.start + (domain.end - domain.start) * f64::from(i) / f64::from(STARTS);
    let starts = (0..=STARTS).map(|i| distance(start(i)));
    let best = starts
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((domain.start, f64::INFINITY));
    let mut t = best.0;
    for _ in 0..STEPS {
        let at = curve.derivatives(t);
        let apart = at.point - point;
        let first = at.first.length_squared();
        let second = first + apart.dot(at.second);
        let slope = if second > 0.0 { second } else { first };
        let next = (t - apart.dot(at.first) / slope).clamp(domain.start, domain.end);
        let is_found = (next - t).abs() < EXACT;
        t = next;
        if is_found {
            break;
        }
    }
    let found = distance(t);
    if found.1 < best.1 { found } else { best }
}

/// Whether boxes around the control points of two curves show that they do not meet, or lines along them.
fn are_apart(a: &Curve<DVec2>, b: &Curve<DVec2>, near: f64) -> bool {
    let across = [a, b].map(|curve| (curve.end() - curve.start()).perp().normalize_or_zero());
    [DVec2::X, DVec2::Y].into_iter().chain(across).any(|way| {
        let range = |curve: &Curve<DVec2>| {
            let places = curve.points().map(|point| point.dot(way));
            places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            })
        };
        let ((low, high), (least, most)) = (range(a), range(b));
        low > most + near || least > high + near
    })
}

/// Meetings of two Bézier curves.
fn meet(
    a: &Curve<DVec2>,
    b: &Curve<DVec2>,
    near: f64,
    work: &Work,
    found: &mut Vec<(f64, f64)>,
) -> Result<(), Error> {
    if are_apart(a, b, near) {
        return Ok(());
    }
    let ends = |curve: &Curve<DVec2>| [curve.domain().start, curve.domain().end];
    let on = |curve: &Curve<DVec2>, point: DVec2| {
        let (t, distance) = nearest(curve, point);
        (distance <= near).then_some(t)
    };
    let own = ends(a)
        .into_iter()
        .filter_map(|t| Some((t, on(b, a.evaluate(t))?)));
    let others = ends(b)
        .into_iter()
        .filter_map(|s| Some((on(a, b.evaluate(s))?, s)));
    let touches: Vec<_> = own.chain(others).collect();
    found.extend(&touches);
    let low = touches
        .iter()
        .map(|touch| touch.0)
        .fold(f64::INFINITY, f64::min);
    let high = touches
        .iter()
        .map(|touch| touch.0)
        .fold(f64::NEG_INFINITY, f64::max);
    let is_long = high > low && a.evaluate(low).distance(a.evaluate(high)) > 10.0 * near;
    let is_common = |share: &f64| on(b, a.evaluate(low + (high - low) * share)).is_some();
    if is_long && CHECKS.iter().all(is_common) {
        return Ok(());
    }
    let mut todo = vec![(a.clone(), b.clone())];
    let mut looked = 0;
    while let Some((p, q)) = todo.pop() {
        work.take(1)?;
        looked += 1;
        if looked > MOST {
            return Ok(());
        }
        if are_apart(&p, &q, 0.0) {
            continue;
        }
        let crossing = crossing([a, b], [&p, &q]);
        if let Some((t, s)) = crossing {
            let point = a.evaluate(t);
            if found
                .iter()
                .all(|other| a.evaluate(other.0).distance(point) > near)
            {
                found.push((t, s));
            }
            if is_line(&p) && is_line(&q) && angle(&p, &q) > CLEAR {
                continue;
            }
        }
        todo.extend(halved(&p, &q, [a, b]));
    }
    Ok(())
}

/// All pairs of halves of two parts, unless both are too short.
fn halved(
    p: &Curve<DVec2>,
    q: &Curve<DVec2>,
    wholes: [&Curve<DVec2>; 2],
) -> Vec<(Curve<DVec2>, Curve<DVec2>)> {
    let length = |curve: &Curve<DVec2>| curve.domain().end - curve.domain().start;
    if length(p) < SHORT * length(wholes[0]) && length(q) < SHORT * length(wholes[1]) {
        return Vec::new();
    }
    let halves =
        |curve: &Curve<DVec2>| curve.split(curve.domain().start.midpoint(curve.domain().end));
    let (Ok(own), Ok(others)) = (halves(p), halves(q)) else {
        return Vec::new();
    };
    let pairs = own
        .iter()
        .flat_map(|x| others.iter().map(move |y| (x.clone(), y.clone())));
    pairs.collect()
}

/// The crossing of two curves that Newton's method finds from the middles of parts of them, if it is on those.
fn crossing(curves: [&Curve<DVec2>; 2], parts: [&Curve<DVec2>; 2]) -> Option<(f64, f64)> {
    let [own, other] = parts.map(Curve::domain);
    let (mut t, mut s) = (own.start.midpoint(own.end), other.start.midpoint(other.end));
    for _ in 0..STEPS {
        let (x, y) = (curves[0].derivatives(t), curves[1].derivatives(s));
        let apart = y.point - x.point;
        let area = x.first.perp_dot(y.first);
        let steps = [
            apart.perp_dot(y.first) / area,
            apart.perp_dot(x.first) / area,
        ];
        let is_told = steps[0].is_finite() && steps[1].is_finite();
        if !is_told || steps[0].abs() > 1.0 || steps[1].abs() > 1.0 {
            return None;
        }
        t += steps[0];
        s += steps[1];
        if steps[0].abs().max(steps[1].abs()) <= EXACT {
            break;
        }
    }
    let is_in = own.start <= t && t <= own.end && other.start <= s && s <= other.end;
    let is_one = || curves[0].evaluate(t).distance(curves[1].evaluate(s)) <= 1e-13;
    (is_in && is_one()).then_some((t, s))
}

/// Whether a curve nearly is a line.
fn is_line(curve: &Curve<DVec2>) -> bool {
    let along = curve.end() - curve.start();
    let across = along.perp().normalize_or_zero();
    curve
        .points()
        .all(|point| (point - curve.start()).dot(across).abs() < BENT * along.length())
}

/// The sine of the angle between the ways from start to end.
fn angle(a: &Curve<DVec2>, b: &Curve<DVec2>) -> f64 {
    let way = |curve: &Curve<DVec2>| (curve.end() - curve.start()).normalize_or_zero();
    way(a).perp_dot(way(b)).abs()
}
