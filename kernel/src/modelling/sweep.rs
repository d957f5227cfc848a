//! Surfaces that a curve sweeps over, and the surface between two curves.

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4};

use super::arc::UnitArc;
use super::{check_point, direction};
use crate::bernstein::product;
use crate::curve::check_homogeneous;
use crate::knots::runs;
use crate::{Curve, Error, KnotVector, Surface};

/// Control points closer to the axis of revolution than this share of their distance from
/// its origin lie on it.
const ON_AXIS: f64 = 8.0 * f64::EPSILON;

/// Knots of two curves that differ by at most this share of the domain are one knot.
const SAME_KNOT: f64 = 1e-14;

/// Weights that differ by at most this share are one.
const SAME_WEIGHT: f64 = 1e-14;

/// The surface that `curve` passes over in turning around an axis, right-handed: u is the
/// parameter of the curve, v the angle in radians.
///
/// Control points on the axis stay there, and give rows of coinciding points
/// \[Piegl 97, A8.1\].
///
/// # Errors
/// If a number is not finite, the axis has no direction, or the angles are empty or longer
/// than one turn.
pub fn revolve(
    curve: &Curve<DVec3>,
    axis_point: DVec3,
    axis: DVec3,
    angles: Range<f64>,
) -> Result<Surface, Error> {
    check_point(axis_point)?;
    let axis = direction(axis)?;
    let unit = UnitArc::new(angles)?;
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for (point, weight) in curve.points().zip(curve.weights()) {
        let offset = point - axis_point;
        let across = offset - axis * offset.dot(axis);
        let size = offset.length().max(axis_point.length());
        let x = if across.length() <= ON_AXIS * size {
            DVec3::ZERO
        } else {
            across
        };
        let y = axis.cross(x);
        // From the point itself, so that it stays where it is at the angle zero.
        points.extend(
            unit.points
                .iter()
                .map(|p| point + x * (p.x - 1.0) + y * p.y),
        );
        weights.extend(unit.weights.iter().map(|w| w * weight));
    }
    Surface::new(curve.knots().clone(), unit.knots, &points, Some(&weights))
}

/// The surface that `curve` passes over in moving along `vector`: u is the parameter of the
/// curve, v goes from 0 to 1.
///
/// # Errors
/// If the vector is not finite or has no length.
pub fn extrude(curve: &Curve<DVec3>, vector: DVec3) -> Result<Surface, Error> {
    direction(vector)?;
    let points: Vec<_> = curve.points().flat_map(|p| [p, p + vector]).collect();
    let weights: Vec<_> = curve.weights().flat_map(|w| [w, w]).collect();
    let knots_v = KnotVector::bezier(1, 0.0..1.0)?;
    Surface::new(curve.knots().clone(), knots_v, &points, Some(&weights))
}

/// The surface of the straight segments between points of `a` and `b` with equal
/// parameters: u is the parameter of `a`, and that of `b` moved to the same domain; v goes
/// from 0 on `a` to 1 on `b`.
///
/// Segments are mixed in homogeneous form. Where the two curves have the weights `wa` and
/// `wb`, the share of `b` in the point at `v` is `v wb / ((1 - v) wa + v wb)`: the segments
/// are exact, and `v` is the share itself where the weights agree.
///
/// # Errors
/// If the knots of `b` cannot be told apart in the domain of `a`.
pub fn ruled(a: &Curve<DVec3>, b: &Curve<DVec3>) -> Result<Surface, Error> {
    let degree = a.degree().max(b.degree());
    let clamped = |curve: &Curve<DVec3>| curve.restricted(curve.domain());
    let a = clamped(a)?.elevated(degree)?;
    let b = snapped(clamped(b)?.remapped(a.domain())?, a.knots()).elevated(degree)?;
    let both_a = a.refined(&missing(a.knots(), b.knots()))?;
    let both_b = b.refined(&missing(b.knots(), a.knots()))?;
    let pairs = both_a.homogeneous().iter().zip(both_b.homogeneous());
    let net = pairs.flat_map(|(&a, &b)| [a, b]).collect();
    let knots_v = KnotVector::bezier(1, 0.0..1.0)?;
    Ok(Surface::trusted(both_a.knots().clone(), knots_v, net))
}

/// Two curves over the domain of the first with equal weights everywhere, so that [`ruled`] mixes their
/// points themselves: where their weights differ each is multiplied by those of the other, which adds up
/// their degrees.
///
/// # Errors
/// If the sum of their degrees is too large, the knots of `b` cannot be told apart in the domain of `a`,
/// or a product is too large or too small to be computed with.
pub fn with_equal_weights(a: &Curve<DVec3>, b: &Curve<DVec3>) -> Result<[Curve<DVec3>; 2], Error> {
    let clamped = |curve: &Curve<DVec3>| curve.restricted(curve.domain());
    let a = clamped(a)?;
    let b = snapped(clamped(b)?.remapped(a.domain())?, a.knots());
    let [breaks_a, breaks_b] = [&a, &b].map(|curve| curve.knots().breaks());
    let lacking = |curve: &Curve<DVec3>, own: &[f64], other: &[f64]| {
        let lacks = other.iter().copied().filter(|knot| !own.contains(knot));
        curve.refined(&lacks.collect::<Vec<_>>())
    };
    let both = [
        lacking(&a, &breaks_a, &breaks_b)?,
        lacking(&b, &breaks_b, &breaks_a)?,
    ];
    let pieces = both.each_ref().map(Curve::bezier_pieces);
    let pairs = pieces[0].iter().zip(&pieces[1]);
    let same = |x: f64, y: f64| (x - y).abs() <= SAME_WEIGHT * x.abs().max(y.abs());
    let even = |w: Vec<f64>| w.iter().all(|&x| same(x, w[0])).then_some(w[0]);
    let weights = |curve: &Curve<DVec3>| curve.weights().collect::<Vec<_>>();
    let ratio = |(a, b): (&Curve<DVec3>, &Curve<DVec3>)| {
        let degree = a.degree().max(b.degree());
        let [a, b] = [a.elevated(degree).ok()?, b.elevated(degree).ok()?].map(|c| weights(&c));
        even(a.iter().zip(&b).map(|(a, b)| a / b).collect())
    };
    let ratios: Option<Vec<f64>> = pairs.clone().map(ratio).collect();
    if let Some(ratio) = ratios.and_then(even) {
        let scaled = b.homogeneous().iter().map(|&h| h * ratio).collect();
        let b = Curve::trusted((b.knots().clone(), scaled));
        return Ok([a, b]);
    }
    let degree = a.degree() + b.degree();
    let knots = piecewise(degree, &both[0].knots().breaks())?;
    let mut products = [Vec::new(), Vec::new()];
    for (a, b) in pairs {
        for (points, [own, other]) in products.iter_mut().zip([[a, b], [b, a]]) {
            // Neighbours share their ends.
            points.pop();
            points.extend(product(own.homogeneous(), &weights(other)));
        }
    }
    for points in &products {
        check_homogeneous(points)?;
    }
    Ok(products.map(|points| Curve::trusted((knots.clone(), points))))
}

/// The knots of Bézier pieces between some places.
fn piecewise(degree: usize, breaks: &[f64]) -> Result<KnotVector, Error> {
    let last = breaks.len() - 1;
    let times = |k: usize| degree + usize::from(k == 0 || k == last);
    let knots = breaks.iter().enumerate();
    KnotVector::new(
        degree,
        knots.flat_map(|(k, &at)| vec![at; times(k)]).collect(),
    )
}

/// The surface that swings a profile around the y axis along a trajectory:
/// `S(u, v) = (profile.x * trajectory.x, profile.y, profile.x * trajectory.y)`, where the
/// trajectory lies in the plane of x and z.
///
/// Exact: the control points are products of those of the curves, and so are the weights
/// (Piegl and Tiller, chapter 8, swung surfaces).
///
/// # Errors
/// If a product is too large or too small to be computed with.
pub fn swung(profile: &Curve<DVec2>, trajectory: &Curve<DVec2>) -> Result<Surface, Error> {
    let product = |p: &DVec3, t: &DVec3| DVec4::new(p.x * t.x, p.y * t.z, p.x * t.y, p.z * t.z);
    let net: Vec<_> = profile
        .homogeneous()
        .iter()
        .flat_map(|p| trajectory.homogeneous().iter().map(move |t| product(p, t)))
        .collect();
    check_homogeneous(&net)?;
    let [knots_u, knots_v] = [profile, trajectory].map(|curve| curve.knots().clone());
    Ok(Surface::trusted(knots_u, knots_v, net))
}

/// The curve with those of its inner knots that rounding has moved away from knots of
/// `target` put back on them; the domains agree.
fn snapped(curve: Curve<DVec3>, target: &KnotVector) -> Curve<DVec3> {
    let Range { start, end } = curve.domain();
    let tolerance = SAME_KNOT * (end - start).max(start.abs()).max(end.abs());
    let mut breaks = target.breaks().into_iter().peekable();
    let mut knots = Vec::new();
    for run in runs(curve.knots().as_slice()) {
        while breaks.next_if(|&k| k < run[0] - tolerance).is_some() {}
        // Each target is taken once, so that different knots stay different.
        let knot = breaks
            .next_if(|&k| k <= run[0] + tolerance)
            .unwrap_or(run[0]);
        knots.extend(run.iter().map(|_| knot));
    }
    // Knots closer together than the tolerance may have changed places: they stay then.
    match KnotVector::new(curve.degree(), knots) {
        Ok(knots) => Curve::trusted((knots, curve.homogeneous().to_vec())),
        Err(_) => curve,
    }
}

/// The inner knots that `knots` lacks to contain those of `other`.
fn missing(knots: &KnotVector, other: &KnotVector) -> Vec<f64> {
    let Range { start, end } = knots.domain();
    runs(other.as_slice())
        .filter(|run| start < run[0] && run[0] < end)
        .flat_map(|run| vec![run[0]; run.len().saturating_sub(knots.multiplicity(run[0]))])
        .collect()
}
