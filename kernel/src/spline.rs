//! The one-dimensional algorithms that curves and both directions of surfaces share.
//!
//! They work on homogeneous control points, for which every operation is linear.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Range, Sub};

use glam::{DVec2, DVec3, DVec4};

use crate::curve::check_inside;
use crate::knots::{MOST_ROOM, USUAL_ROOM, WIDE_ROOM, runs};
use crate::{Error, KnotVector};

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
    + Div<f64, Output = Self>
{
    /// The point with its weight, `(w P, w)`.
    type Homogeneous: Linear;
    /// The homogeneous form of the point with weight `weight`.
    fn lift(self, weight: f64) -> Self::Homogeneous;
    /// The coordinates before the weight, not divided by it.
    fn numerator(homogeneous: Self::Homogeneous) -> Self;
    /// Euclidean length of the vector from the origin.
    fn length(self) -> f64;

    /// The point that a homogeneous form stands for.
    fn project(homogeneous: Self::Homogeneous) -> Self {
        Self::numerator(homogeneous) / homogeneous.weight()
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
}

/// A knot vector with one homogeneous control point per basis function.
pub(crate) type Spline<H> = (KnotVector, Vec<H>);

/// The point between `a` and `b`; the same bits as both where they are equal.
pub(crate) fn mix<H: Linear>(a: H, b: H, t: f64) -> H {
    if t < 0.5 {
        a + (b - a) * t
    } else {
        b - (b - a) * (1.0 - t)
    }
}

/// Inserts the ascending knots `extra`, leaving the curve as it is \[Piegl 97, A5.4\].
///
/// They lie in the half-open domain, and no knot stands there more than `degree` times
/// afterwards. Linear in the number of knots; only convex combinations are taken.
pub(crate) fn refine<H: Linear>(knots: &KnotVector, points: &[H], extra: &[f64]) -> Spline<H> {
    let (p, u, added) = (knots.degree(), knots.as_slice(), extra.len());
    let (Some(&first), Some(&last)) = (extra.first(), extra.last()) else {
        return (knots.clone(), points.to_vec());
    };
    // What lies to the left and to the right of all new knots stays.
    let (a, b) = (knots.span(first), knots.span(last) + 1);
    let mut fine_knots = [u, extra].concat();
    let mut fine = vec![H::default(); points.len() + added];
    fine[..=a - p].copy_from_slice(&points[..=a - p]);
    fine[b - 1 + added..].copy_from_slice(&points[b - 1..]);
    fine_knots[b + p + added..].copy_from_slice(&u[b + p..]);
    // From right to left: `i` walks through the old knots, `k` through all.
    let (mut i, mut k) = (b + p - 1, b + p + added - 1);
    for &t in extra.iter().rev() {
        while t <= u[i] && i > a {
            fine[k - p - 1] = points[i - p - 1];
            fine_knots[k] = u[i];
            (i, k) = (i - 1, k - 1);
        }
        fine[k - p - 1] = fine[k - p];
        for l in 1..=p {
            let (at, right) = (k - p + l, fine_knots[k + l]);
            let share = (right - t) / (right - u[i - p + l]);
            fine[at - 1] = if right > t {
                mix(fine[at], fine[at - 1], share)
            } else {
                fine[at]
            };
        }
        fine_knots[k] = t;
        k -= 1;
    }
    (KnotVector::trusted(p, fine_knots), fine)
}

/// The knots `extra` in order, if they may be inserted into `knots`.
pub(crate) fn check_refinement(knots: &KnotVector, extra: &[f64]) -> Result<Vec<f64>, Error> {
    for &knot in extra {
        check_inside(knot, &knots.domain())?;
    }
    let mut extra = extra.to_vec();
    extra.sort_by(f64::total_cmp);
    for run in runs(&extra) {
        let (found, allowed) = (knots.multiplicity(run[0]) + run.len(), knots.degree());
        if found > allowed {
            let knot = run[0];
            return Err(Error::KnotMultiplicity {
                knot,
                found,
                allowed,
            });
        }
    }
    Ok(extra)
}

/// Inserts `t` until it stands `multiplicity` times (at most `degree`).
pub(crate) fn insert<H: Linear>(
    knots: &KnotVector,
    points: &[H],
    t: f64,
    multiplicity: usize,
) -> Spline<H> {
    let wanted = multiplicity.min(knots.degree());
    let missing = wanted.saturating_sub(knots.multiplicity(t));
    refine(knots, points, &vec![t; missing])
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

/// The parts of the curve before and after `t`, clamped, which share their point at `t` to
/// the last bit.
pub(crate) fn split<H: Linear>(knots: &KnotVector, points: &[H], t: f64) -> [Spline<H>; 2] {
    let (knots, points) = insert(knots, points, t, knots.degree());
    let Range { start, end } = knots.domain();
    [start..t, t..end].map(|range| restrict(&knots, &points, &range))
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
pub(crate) fn bezier_pieces<H: Linear>(
    knots: &KnotVector,
    points: &[H],
) -> Vec<(Range<f64>, Vec<H>)> {
    let mut pieces = Vec::new();
    each_bezier(knots, points, |range, piece| {
        pieces.push((range, piece.to_vec()));
    });
    pieces
}

/// Calls for each Bézier piece of the curve, one per span with a length, in order.
///
/// Neighbouring pieces share their common point to the last bit. Linear in the
/// number of pieces \[Piegl 97, A5.6\].
pub(crate) fn each_bezier<H: Linear>(
    knots: &KnotVector,
    points: &[H],
    mut each: impl FnMut(Range<f64>, &[H]),
) {
    if knots.is_bezier() {
        return each(knots.domain(), points);
    }
    let clamped = (!knots.is_clamped()).then(|| restrict(knots, points, &knots.domain()));
    let (knots, points) = match &clamped {
        Some((knots, points)) => (knots, &points[..]),
        None => (knots, points),
    };
    let (p, u) = (knots.degree(), knots.as_slice());
    let mut piece = points[..=p].to_vec();
    let mut next = piece.clone();
    let mut start = p;
    while start + 1 < u.len() {
        // The run of equal knots that ends this piece.
        let first = start + 1;
        let multiplicity = u[first..].partition_point(|&k| k <= u[first]);
        let end = first + multiplicity - 1;
        let range = u[start]..u[end];
        if end + 1 == u.len() {
            return each(range, &piece);
        }
        // Insert the knot until it stands `degree` times. Each insertion yields one more
        // leading point of the next piece.
        next.copy_from_slice(&points[end - p..=end]);
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
        each(range, &piece);
        std::mem::swap(&mut piece, &mut next);
        start = end;
    }
}

/// The same curve one degree higher, clamped at its ends.
///
/// The mean of `degree + 1` curves over refined knots: the j-th one lacks every
/// `degree + 1`-st knot of the raised vector, counted from the j-th \[Prautzsch 84\]. All
/// its steps are convex combinations, so that no digits are lost.
pub(crate) fn elevate_once<H: Linear>(knots: &KnotVector, points: &[H]) -> Spline<H> {
    let (knots, points) = restrict(knots, points, &knots.domain());
    let n = knots.degree() + 1;
    let mut raised = Vec::new();
    for run in runs(knots.as_slice()) {
        raised.extend_from_slice(run);
        raised.push(run[0]);
    }
    let refined = |j: usize| {
        let mut extra = Vec::new();
        let mut start = 0;
        for run in runs(&raised) {
            let lacking = (start..start + run.len()).any(|k| k % n == j);
            extra.extend((!lacking).then_some(run[0]));
            start += run.len();
        }
        refine(&knots, &points, &extra).1
    };
    // The first vector lacks two of the knots at the start, the others one.
    let place = |i: usize, j: usize| {
        let lacking = if i < j { 0 } else { (i - j) / n + 1 };
        i + usize::from(j == 0) - lacking
    };
    let count = raised.len() - n - 1;
    let first = refined(0);
    let first: Vec<H> = (0..count).map(|i| first[place(i, 0)]).collect();
    // One summand at a time: all of them would be much larger than what they make.
    let mut sums = vec![H::default(); count];
    for j in 1..n {
        let summand = refined(j);
        for (i, (sum, first)) in sums.iter_mut().zip(&first).enumerate() {
            *sum = *sum + (summand[place(i, j)] - *first);
        }
    }
    let mean = |(&first, &sum): (&H, &H)| first + sum * (1.0 / n as f64);
    let elevated = first.iter().zip(&sums).map(mean).collect();
    (KnotVector::trusted(n, raised), elevated)
}

/// The derivatives of a homogeneous curve of the orders below `ORDERS`, at most 3, at `t`; the
/// first one is the point.
pub(crate) fn derivatives<H: Linear, const ORDERS: usize>(
    knots: &KnotVector,
    points: &[H],
    t: f64,
) -> [H; ORDERS] {
    match knots.degree() {
        WIDE_ROOM.. => derivatives_in::<H, ORDERS, MOST_ROOM>(knots, points, t),
        USUAL_ROOM.. => derivatives_in::<H, ORDERS, WIDE_ROOM>(knots, points, t),
        _ => derivatives_in::<H, ORDERS, USUAL_ROOM>(knots, points, t),
    }
}

#[inline]
fn derivatives_in<H: Linear, const ORDERS: usize, const ROOM: usize>(
    knots: &KnotVector,
    points: &[H],
    t: f64,
) -> [H; ORDERS] {
    let span = knots.span(t);
    let local = &points[span - knots.degree()..=span];
    knots.basis::<ORDERS, ROOM>(span, t).map(|row| {
        local
            .iter()
            .zip(row)
            .fold(H::default(), |sum, (&point, value)| sum + point * value)
    })
}
