//! Closed contours in layers, made ready to be joined.
//!
//! All run the same way round the direction in which the layers follow each other, and each
//! starts where it is nearest to the one before. Neighbours are given the same knots, and are
//! then joined control point by control point.

use glam::DVec3;

use crate::knots::runs;
use crate::{Curve, Error, KnotVector, check_points};

/// Points of a contour that are held against those of the layer before.
const SAMPLES: usize = 96;

/// A contour starts at one of its points that is this near to the best place, as a share of the
/// way to the next point: knots of neighbouring layers then fall on each other more often.
const AT_POINT: f64 = 0.1;

/// Knots of neighbouring layers that are this close, as a share of a turn, are one knot.
const SAME_KNOT: f64 = 1e-13;

/// What a point of a contour needs to be told from the next one, as a share of the length.
const COINCIDENT: f64 = 1e-12;

/// A layer: its curve around, from 0 to 1, and where it lies.
#[derive(Clone, Debug)]
pub(super) struct Ring {
    pub(super) curve: Curve<DVec3>,
    /// How far the next layer is above this one; 0 for the last one.
    pub(super) step: f64,
}

/// Makes rings of contours; `close` makes a curve, from 0 to 1, of points with their parameters
/// (chord lengths; the last parameter is 1, at the first point again).
///
/// # Errors
/// If there are fewer than two contours, one has fewer than three points, one is not finite, two
/// neighbours coincide, or two layers lie at the same height.
pub(super) fn rings(
    contours: &[Vec<DVec3>],
    close: impl Fn(&[DVec3], &[f64]) -> Result<Curve<DVec3>, Error>,
) -> Result<Vec<Ring>, Error> {
    if contours.len() < 2 {
        return Err(Error::PointCount {
            found: contours.len(),
            expected: 2,
        });
    }
    for points in contours {
        check(points)?;
    }
    let middles: Vec<DVec3> = contours.iter().map(|points| middle(points)).collect();
    let areas: Vec<DVec3> = contours.iter().map(|points| area(points)).collect();
    let upwards: Vec<DVec3> = upwards(&middles);
    let mut rings: Vec<Ring> = Vec::new();
    for (k, points) in contours.iter().enumerate() {
        let mut points = points.clone();
        if areas[k].dot(upwards[k]) < 0.0 {
            points[1..].reverse();
        }
        let parameters = parameters(&points);
        let mut curve = close(&points, &parameters)?;
        if let Some(below) = rings.last() {
            curve = turned(&curve, start(&curve, &parameters, &below.curve))?;
        }
        let step = middles.get(k + 1).map_or(0.0, |next| {
            let normal = |k: usize| areas[k] * areas[k].dot(upwards[k]).signum();
            let normal = (normal(k) + normal(k + 1)).normalize_or_zero();
            (next - middles[k]).dot(normal).abs()
        });
        let size = areas[k].length().sqrt();
        if k + 1 < contours.len() && (step.is_nan() || step <= COINCIDENT * size) {
            return Err(Error::Coincide { index: k });
        }
        rings.push(Ring { curve, step });
    }
    Ok(rings)
}

/// Refuses points that make no closed contour.
fn check(points: &[DVec3]) -> Result<(), Error> {
    if points.len() < 3 {
        return Err(Error::PointCount {
            found: points.len(),
            expected: 3,
        });
    }
    check_points(points.iter().copied())?;
    let step = |k: usize| points[k].distance(points[(k + 1) % points.len()]);
    let length: f64 = (0..points.len()).map(step).sum();
    match (0..points.len()).find(|&k| step(k) <= COINCIDENT * length) {
        Some(index) => Err(Error::Coincide { index }),
        None => Ok(()),
    }
}

/// The middle of a contour: of its sides by their lengths.
fn middle(points: &[DVec3]) -> DVec3 {
    let (mut sum, mut total) = (DVec3::ZERO, 0.0);
    for (k, point) in points.iter().enumerate() {
        let next = points[(k + 1) % points.len()];
        let length = point.distance(next);
        sum += point.midpoint(next) * length;
        total += length;
    }
    sum / total
}

/// The area inside a contour, along the normal around which it runs counter-clockwise.
pub(super) fn area(points: &[DVec3]) -> DVec3 {
    let Some(&first) = points.first() else {
        return DVec3::ZERO;
    };
    let triangle = |w: &[DVec3]| (w[0] - first).cross(w[1] - first) * 0.5;
    points.windows(2).map(triangle).sum()
}

/// The direction in which the layers go on, at each of them.
fn upwards(middles: &[DVec3]) -> Vec<DVec3> {
    let last = middles.len() - 1;
    (0..=last)
        .map(|k| middles[(k + 1).min(last)] - middles[k.saturating_sub(1)])
        .collect()
}

/// Chord lengths from 0 to 1, the first point again at the end.
fn parameters(points: &[DVec3]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut parameters = vec![0.0];
    for (k, point) in points.iter().enumerate() {
        sum += point.distance(points[(k + 1) % points.len()]);
        parameters.push(sum);
    }
    parameters.iter().map(|length| length / sum).collect()
}

/// Where a closed curve should start so as to run beside the one below.
fn start(curve: &Curve<DVec3>, parameters: &[f64], below: &Curve<DVec3>) -> f64 {
    let sampled = |curve: &Curve<DVec3>| -> Vec<DVec3> {
        let at = |k: usize| curve.evaluate(k as f64 / SAMPLES as f64);
        let points: Vec<DVec3> = (0..SAMPLES).map(at).collect();
        // What counts is the shape, not where it lies.
        let middle = points.iter().sum::<DVec3>() / SAMPLES as f64;
        points.iter().map(|point| point - middle).collect()
    };
    let (points, wanted) = (sampled(curve), sampled(below));
    let cost = |shift: usize| -> f64 {
        let pairs = wanted.iter().zip(points.iter().cycle().skip(shift));
        pairs.map(|(a, b)| a.distance_squared(*b)).sum()
    };
    let costs: Vec<f64> = (0..SAMPLES).map(cost).collect();
    let best = (0..SAMPLES).min_by(|&a, &b| costs[a].total_cmp(&costs[b]));
    let best = best.unwrap_or(0);
    // The lowest point of the parabola through the best cost and its neighbours.
    let [before, at, after] = [SAMPLES - 1, 0, 1].map(|k| costs[(best + k) % SAMPLES]);
    let bend = before - 2.0 * at + after;
    let off = if bend > 0.0 {
        0.5 * (before - after) / bend
    } else {
        0.0
    };
    let place = ((best as f64 + off) / SAMPLES as f64).rem_euclid(1.0);
    for pair in parameters.windows(2) {
        let share = (place - pair[0]) / (pair[1] - pair[0]);
        if share.abs() <= AT_POINT {
            return pair[0];
        }
        if (share - 1.0).abs() <= AT_POINT {
            return pair[1];
        }
    }
    place
}

/// A closed curve from 0 to 1 that starts at `place` of the given one.
fn turned(curve: &Curve<DVec3>, place: f64) -> Result<Curve<DVec3>, Error> {
    if place <= 0.0 || place >= 1.0 {
        return Ok(curve.clone());
    }
    let [before, after] = curve.split(place)?;
    let degree = curve.degree();
    let inner = |curve: &Curve<DVec3>, offset: f64| -> Vec<f64> {
        let knots = curve.knots().as_slice();
        let inner = &knots[degree + 1..knots.len() - degree - 1];
        inner.iter().map(|knot| knot + offset).collect()
    };
    let knots = [
        vec![0.0; degree + 1],
        inner(&after, -place),
        vec![1.0 - place; degree],
        inner(&before, 1.0 - place),
        vec![1.0; degree + 1],
    ];
    let points: Vec<DVec3> = after.points().chain(before.points().skip(1)).collect();
    Curve::new(KnotVector::new(degree, knots.concat())?, &points, None)
}

/// The control points of curves from 0 to 1 over the knots of all of them.
pub(super) struct Matched {
    pub(super) knots: KnotVector,
    pub(super) points: Vec<Vec<DVec3>>,
}

/// Brings clamped curves of one degree to the same knots.
pub(super) fn matched(curves: &[&Curve<DVec3>]) -> Result<Matched, Error> {
    let mut all: Vec<(f64, usize)> = Vec::new();
    for curve in curves {
        let runs = runs(curve.knots().as_slice());
        all.extend(runs.map(|run| (run[0], run.len())));
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    // One for all that are close, as often as any of them stands there.
    let mut merged: Vec<(f64, usize)> = Vec::new();
    for (knot, times) in all {
        match merged.last_mut() {
            Some(last) if knot - last.0 <= SAME_KNOT => last.1 = last.1.max(times),
            _ => merged.push((knot, times)),
        }
    }
    let nearest = |knot: f64| {
        let after = merged.partition_point(|known| known.0 <= knot);
        merged[after.max(1) - 1]
    };
    let mut points = Vec::new();
    let mut knots = None;
    for curve in curves {
        let (mut moved, mut missing) = (Vec::new(), merged.clone());
        for run in runs(curve.knots().as_slice()) {
            let (knot, _) = nearest(run[0]);
            moved.extend(run.iter().map(|_| knot));
            if let Ok(at) = missing.binary_search_by(|known| known.0.total_cmp(&knot)) {
                missing[at].1 = missing[at].1.saturating_sub(run.len());
            }
        }
        let own: Vec<DVec3> = curve.points().collect();
        let curve = Curve::new(KnotVector::new(curve.degree(), moved)?, &own, None)?;
        let extra = missing.iter().flat_map(|&(knot, times)| vec![knot; times]);
        let curve = curve.refined(&extra.collect::<Vec<f64>>())?;
        points.push(curve.points().collect());
        knots = Some(curve.knots().clone());
    }
    let knots = knots.ok_or(Error::EmptyLoop)?;
    Ok(Matched { knots, points })
}
