//! The one-dimensional algorithms that curves and both directions of surfaces share.
//!
//! They work on homogeneous control points, for which every operation is linear.

use std::fmt::Debug;
use std::ops::{Add, Mul, Range, Sub};

use glam::{DVec2, DVec3, DVec4};

use crate::KnotVector;

/// Homogeneous control points: what a spline can mix.
pub trait Linear:
    Copy
    + Debug
    + Default
    + PartialEq
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<f64, Output = Self>
{
    /// The last coordinate, the weight.
    fn weight(self) -> f64;
}

impl Linear for DVec3 {
    fn weight(self) -> f64 {
        self.z
    }
}

impl Linear for DVec4 {
    fn weight(self) -> f64 {
        self.w
    }
}

/// Points of the plane (`DVec2`) or of space (`DVec3`).
pub trait Point:
    Copy
    + Debug
    + Default
    + PartialEq
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<f64, Output = Self>
{
    /// The point with its weight, `(w P, w)`.
    type Homogeneous: Linear;
    /// The homogeneous form of the point with weight `weight`.
    fn lift(self, weight: f64) -> Self::Homogeneous;
    /// The coordinates before the weight, not divided by it.
    fn numerator(homogeneous: Self::Homogeneous) -> Self;
    /// Euclidean length of the vector from the origin.
    fn length(self) -> f64;
    /// Whether every coordinate is finite.
    fn is_finite(self) -> bool;

    /// The point that a homogeneous form stands for.
    fn project(homogeneous: Self::Homogeneous) -> Self {
        Self::numerator(homogeneous) * (1.0 / homogeneous.weight())
    }
}

impl Point for DVec2 {
    type Homogeneous = DVec3;
    fn lift(self, weight: f64) -> DVec3 {
        (self * weight).extend(weight)
    }
    fn numerator(homogeneous: DVec3) -> Self {
        homogeneous.truncate()
    }
    fn length(self) -> f64 {
        self.length()
    }
    fn is_finite(self) -> bool {
        self.is_finite()
    }
}

impl Point for DVec3 {
    type Homogeneous = DVec4;
    fn lift(self, weight: f64) -> DVec4 {
        (self * weight).extend(weight)
    }
    fn numerator(homogeneous: DVec4) -> Self {
        homogeneous.truncate()
    }
    fn length(self) -> f64 {
        self.length()
    }
    fn is_finite(self) -> bool {
        self.is_finite()
    }
}

/// A knot vector with one homogeneous control point per basis function.
pub(crate) type Spline<H> = (KnotVector, Vec<H>);

fn mix<H: Linear>(a: H, b: H, t: f64) -> H {
    a * (1.0 - t) + b * t
}

/// Inserts the knot `t` once, leaving the curve as it is.
///
/// `t` lies in the half-open domain and stands there less than `degree` times
/// (Boehm's algorithm, \[Piegl 97, A5.1\]).
fn insert_once<H: Linear>(knots: &KnotVector, points: &[H], t: f64) -> Spline<H> {
    let (p, u) = (knots.degree(), knots.as_slice());
    let span = knots.span(t);
    let repeated = u[..=span].iter().rev().take_while(|&&k| k >= t).count();
    let mut refined = points[..=span - p].to_vec();
    for i in span - p + 1..=span - repeated {
        refined.push(mix(
            points[i - 1],
            points[i],
            (t - u[i]) / (u[i + p] - u[i]),
        ));
    }
    refined.extend_from_slice(&points[span - repeated..]);
    let mut with_t = u[..=span].to_vec();
    with_t.push(t);
    with_t.extend_from_slice(&u[span + 1..]);
    (KnotVector::trusted(p, with_t), refined)
}

/// Inserts `t` until it stands `multiplicity` times (at most `degree`).
pub(crate) fn insert<H: Linear>(
    knots: &KnotVector,
    points: &[H],
    t: f64,
    multiplicity: usize,
) -> Spline<H> {
    let mut spline = (knots.clone(), points.to_vec());
    for _ in knots.multiplicity(t)..multiplicity.min(knots.degree()) {
        spline = insert_once(&spline.0, &spline.1, t);
    }
    spline
}

/// The part of the curve from `t` on, clamped at `t`.
pub(crate) fn after<H: Linear>(knots: &KnotVector, points: &[H], t: f64) -> Spline<H> {
    let p = knots.degree();
    let (knots, points) = insert(knots, points, t, p);
    let span = knots.span(t);
    let mut clamped = vec![t; p + 1];
    clamped.extend_from_slice(&knots.as_slice()[span + 1..]);
    (KnotVector::trusted(p, clamped), points[span - p..].to_vec())
}

/// The part of the curve up to `t`, clamped at `t`.
pub(crate) fn before<H: Linear>(knots: &KnotVector, points: &[H], t: f64) -> Spline<H> {
    let (knots, points) = negated(knots, points);
    let (knots, points) = after(&knots, &points, -t);
    negated(&knots, &points)
}

/// The part of the curve over `range`, clamped at both ends.
pub(crate) fn restrict<H: Linear>(
    knots: &KnotVector,
    points: &[H],
    range: &Range<f64>,
) -> Spline<H> {
    let (knots, points) = after(knots, points, range.start);
    before(&knots, &points, range.end)
}

/// The same curve over the negated knots, last point first: exact, unlike a shift.
fn negated<H: Linear>(knots: &KnotVector, points: &[H]) -> Spline<H> {
    let turned = knots.as_slice().iter().rev().map(|k| -k).collect();
    (
        KnotVector::trusted(knots.degree(), turned),
        points.iter().rev().copied().collect(),
    )
}

/// The Bézier pieces of the curve, one per span with a length, in order.
///
/// Neighbouring pieces share their common point to the last bit. Linear in the
/// number of pieces \[Piegl 97, A5.6\].
pub(crate) fn bezier_pieces<H: Linear>(
    knots: &KnotVector,
    points: &[H],
) -> Vec<(Range<f64>, Vec<H>)> {
    let (knots, points) = restrict(knots, points, &knots.domain());
    let (p, u) = (knots.degree(), knots.as_slice());
    let mut pieces = Vec::new();
    let mut piece = points[..=p].to_vec();
    let mut start = p;
    while start + 1 < u.len() {
        // The run of equal knots that ends this piece.
        let first = start + 1;
        let multiplicity = u[first..].partition_point(|&k| k <= u[first]);
        let end = first + multiplicity - 1;
        let range = u[start]..u[end];
        if end + 1 == u.len() {
            pieces.push((range, piece));
            break;
        }
        // Insert the knot until it stands `degree` times. Each insertion yields one more
        // leading point of the next piece.
        let mut next = points[end - p..=end].to_vec();
        for inserted in 1..=p.saturating_sub(multiplicity) {
            let fixed = multiplicity + inserted;
            for k in (fixed..=p).rev() {
                let right = u[start + multiplicity + 1 + k - fixed];
                piece[k] = mix(
                    piece[k - 1],
                    piece[k],
                    (u[end] - u[start]) / (right - u[start]),
                );
            }
            next[p - fixed] = piece[p];
        }
        pieces.push((range, std::mem::replace(&mut piece, next)));
        start = end;
    }
    pieces
}

/// The same curve one degree higher, clamped at its ends.
///
/// Each new control point is the blossom of the raised curve at its knots: the mean
/// of the old blossom with one knot left out in turn \[Goldman 02, chapter 6\].
pub(crate) fn elevate_once<H: Linear>(knots: &KnotVector, points: &[H]) -> Spline<H> {
    let (knots, points) = restrict(knots, points, &knots.domain());
    let p = knots.degree();
    let mut raised = Vec::new();
    for run in knots.as_slice().chunk_by(|a, b| a == b) {
        raised.extend_from_slice(run);
        raised.push(run[0]);
    }
    let raised = KnotVector::trusted(p + 1, raised);
    let u = raised.as_slice();
    let mut elevated = Vec::new();
    for i in 0..raised.count() {
        // A span with a length among the knots that this point depends on.
        let middle = f64::midpoint(u[i], u[i + p + 2]);
        let span = knots.span(middle);
        let arguments = &u[i + 1..i + p + 2];
        let mut sum = H::default();
        for skipped in 0..=p {
            let kept = arguments
                .iter()
                .enumerate()
                .filter(|(k, _)| *k != skipped)
                .map(|(_, &t)| t);
            sum = sum + blossom(&knots, &points, span, kept);
        }
        elevated.push(sum * (1.0 / (p + 1) as f64));
    }
    (raised, elevated)
}

/// The blossom of the polynomial piece over `span`: the symmetric function of
/// `degree` arguments, affine in each, that is the curve when all are equal.
fn blossom<H: Linear>(
    knots: &KnotVector,
    points: &[H],
    span: usize,
    arguments: impl Iterator<Item = f64>,
) -> H {
    let (p, u) = (knots.degree(), knots.as_slice());
    let mut window = points[span - p..=span].to_vec();
    for (level, t) in arguments.enumerate() {
        for k in 0..p - level {
            let (left, right) = (u[span - p + level + 1 + k], u[span + 1 + k]);
            window[k] = mix(window[k], window[k + 1], (t - left) / (right - left));
        }
    }
    window[0]
}

/// The point, first and second derivative of a homogeneous curve at `t`.
pub(crate) fn derivatives<H: Linear>(knots: &KnotVector, points: &[H], t: f64) -> [H; 3] {
    let span = knots.span(t);
    let local = &points[span - knots.degree()..=span];
    knots.basis(span, t).map(|row| {
        local
            .iter()
            .zip(row)
            .fold(H::default(), |sum, (&point, value)| sum + point * value)
    })
}
