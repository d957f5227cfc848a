//! Segments of trim loops along which both parameters go one way only.

use glam::{DVec2, DVec3};

use crate::bernstein::{binomials, product};

/// Derivatives below this part of the size of a piece are rounding errors.
const NOISE: f64 = 1e-14;

/// How often an interval with several roots is halved. Between roots still closer a curve
/// goes back by less than its rounding errors.
const DEPTH: u32 = 24;

/// Halvings that tell on which side of a curved segment a point lies.
const STEPS: usize = 60;

/// A box in the parameter domain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) min: DVec2,
    pub(super) max: DVec2,
}

/// A part of a loop along which neither u nor v turns round. Its box has the ends as corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    /// The end with the smaller v.
    pub(super) low: DVec2,
    /// The end with the larger v.
    pub(super) high: DVec2,
    /// Parameters of both ends in the Bézier piece.
    t: [f64; 2],
    /// The coefficients of the Bézier piece: the first, and how many; none for lines.
    first: u32,
    count: u32,
}

/// All segments of the loops of a face, and the coefficients of their Bézier pieces.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Segments {
    pub(super) list: Vec<Segment>,
    /// Homogeneous control points times binomial coefficients.
    coefficients: Vec<DVec3>,
}

impl Rect {
    pub(super) fn meets(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    pub(super) fn center(&self) -> DVec2 {
        (self.min + self.max) * 0.5
    }

    pub(super) fn grown(&self, margin: DVec2) -> Self {
        Self {
            min: self.min - margin,
            max: self.max + margin,
        }
    }

    pub(super) fn clipped(&self, other: &Self) -> Self {
        Self {
            min: self.min.max(other.min),
            max: self.max.min(other.max),
        }
    }
}

impl Segment {
    pub(super) fn bounds(&self) -> Rect {
        Rect {
            min: self.low.min(self.high),
            max: self.low.max(self.high),
        }
    }

    /// Whether its loop runs from its lower to its upper end.
    pub(super) fn rises(&self) -> bool {
        self.t[0] < self.t[1]
    }

    /// The u of the segment at a height between its ends.
    pub(super) fn place(&self, coefficients: &[DVec3], v: f64) -> f64 {
        let (low, high) = (self.low, self.high);
        if self.count == 0 {
            return low.lerp(high, (v - low.y) / (high.y - low.y)).x;
        }
        // Secants, of which the end that stays is weighed less (the Illinois method).
        let [mut below, mut above] = self.t;
        let [mut under, mut over] = [low.y - v, high.y - v];
        let (mut at, mut u, mut was_under) = (f64::NAN, low.x, None);
        for _ in 0..STEPS {
            let t = (below * over - above * under) / (over - under);
            let is_there = (t - at).abs() <= f64::EPSILON * t.abs();
            let point = self.point(coefficients, t);
            (at, u) = (t, point.x);
            let off = point.y - v;
            if is_there || off.abs() <= 0.0 || !t.is_finite() {
                break;
            }
            let is_under = off < 0.0;
            let stays = was_under == Some(is_under);
            if is_under {
                (below, under) = (t, off);
                over *= if stays { 0.5 } else { 1.0 };
            } else {
                (above, over) = (t, off);
                under *= if stays { 0.5 } else { 1.0 };
            }
            was_under = Some(is_under);
        }
        u.clamp(low.x.min(high.x), low.x.max(high.x))
    }

    /// Whether a ray from `p` towards larger u crosses the segment. The upper end does not
    /// belong to it, so that a ray through a common end counts one of two neighbours.
    #[inline]
    pub(super) fn is_crossed(&self, coefficients: &[DVec3], p: DVec2) -> bool {
        self.low.y <= p.y && p.y < self.high.y && self.is_right_of(coefficients, p)
    }

    /// Whether the segment has a larger u than `p` at the height of `p`, or at its end next
    /// to that height.
    fn is_right_of(&self, coefficients: &[DVec3], p: DVec2) -> bool {
        let (low, high) = (self.low, self.high);
        if p.x < low.x.min(high.x) {
            return true;
        }
        if p.x >= low.x.max(high.x) {
            return false;
        }
        if self.count == 0 {
            return (high - low).perp_dot(p - low) > 0.0;
        }
        let rises = low.x <= high.x;
        let [mut below, mut above] = self.t;
        for _ in 0..STEPS {
            let t = 0.5 * (below + above);
            let middle = self.point(coefficients, t);
            let (is_higher, is_left) = (p.y >= middle.y, p.x < middle.x);
            // Two of the four quadrants around the middle hold nothing of the curve.
            if is_left == (is_higher == rises) {
                return is_left;
            }
            if is_higher {
                below = t;
            } else {
                above = t;
            }
        }
        p.x < self.point(coefficients, 0.5 * (below + above)).x
    }

    /// Whether the segment may meet a box, borders included.
    pub(super) fn touches(&self, coefficients: &[DVec3], rect: &Rect) -> bool {
        let own = self.bounds();
        if !own.meets(rect) {
            return false;
        }
        if own.min.x >= own.max.x || own.min.y >= own.max.y {
            return true;
        }
        // The corners of the box that are farthest to both sides of the curve.
        let [far, near] = if self.low.x <= self.high.x {
            [(rect.max.x, rect.min.y), (rect.min.x, rect.max.y)]
        } else {
            [rect.max.into(), rect.min.into()]
        };
        !self.is_right_of(coefficients, far.into()) && !self.is_left_of(coefficients, near.into())
    }

    /// Whether the segment has a smaller u than `p` there.
    fn is_left_of(&self, coefficients: &[DVec3], p: DVec2) -> bool {
        p.x > self.low.x.min(self.high.x) && !self.is_right_of(coefficients, p)
    }

    fn point(&self, coefficients: &[DVec3], t: f64) -> DVec2 {
        let first = self.first as usize;
        evaluate(&coefficients[first..first + self.count as usize], t)
    }
}

impl Segments {
    pub(super) fn coefficients(&self) -> &[DVec3] {
        &self.coefficients
    }

    /// Cuts a Bézier piece from `start` to `end` where it turns round, and takes the parts.
    /// The ends replace those of the piece, which are nearly the same; `snap` moves the
    /// other points that are kept.
    pub(super) fn add(
        &mut self,
        piece: &[DVec3],
        [start, end]: [DVec2; 2],
        snap: impl Fn(DVec2) -> DVec2,
    ) {
        let degree = piece.len() - 1;
        let Ok(first) = u32::try_from(self.coefficients.len()) else {
            return;
        };
        if degree < 2 {
            self.push(start, end, [0.0, 1.0], first, 0);
            return;
        }
        let scaled = piece.iter().zip(binomials(degree)).map(|(h, b)| *h * b);
        self.coefficients.extend(scaled);
        let mut cuts = Vec::new();
        for axis in 0..2 {
            turns(piece, axis, &mut cuts);
        }
        cuts.retain(|t| 0.0 < *t && *t < 1.0);
        cuts.sort_by(f64::total_cmp);
        cuts.dedup();
        let count = u32::try_from(piece.len()).unwrap_or(u32::MAX);
        let (mut from, mut before) = (start, 0.0);
        for t in cuts {
            let to = snap(evaluate(&self.coefficients[first as usize..], t));
            self.push(from, to, [before, t], first, count);
            (from, before) = (to, t);
        }
        self.push(from, end, [before, 1.0], first, count);
    }

    fn push(&mut self, from: DVec2, to: DVec2, [a, b]: [f64; 2], first: u32, count: u32) {
        let (low, high, t) = if from.y <= to.y {
            (from, to, [a, b])
        } else {
            (to, from, [b, a])
        };
        if low != high {
            self.list.push(Segment {
                low,
                high,
                t,
                first,
                count,
            });
        }
    }
}

/// The point at `t` from control points times binomial coefficients, by Horner's scheme.
#[inline]
fn evaluate(scaled: &[DVec3], t: f64) -> DVec2 {
    let s = 1.0 - t;
    let mut power = 1.0;
    let mut sum = DVec3::ZERO;
    for h in scaled {
        sum = sum * s + *h * power;
        power *= t;
    }
    sum.truncate() / sum.z
}

/// Appends the parameters at which a coordinate of a Bézier piece turns round, and some
/// more where that is uncertain.
fn turns(piece: &[DVec3], axis: usize, cuts: &mut Vec<f64>) {
    let degree = piece.len() - 1;
    let (first, last) = (piece[0], piece[degree]);
    let goes = |by: fn(&f64, &f64) -> bool| {
        let mut pairs = piece.windows(2);
        pairs.all(|w| by(&(w[0][axis] * w[1].z), &(w[1][axis] * w[0].z)))
    };
    // A curve turns round no more often than its control points do.
    if goes(f64::le) || goes(f64::ge) {
        return;
    }
    let middle = 0.5 * (first[axis] / first.z + last[axis] / last.z);
    let own: Vec<f64> = piece.iter().map(|h| h[axis] - middle * h.z).collect();
    let weights: Vec<f64> = piece.iter().map(|h| h.z).collect();
    let slope = |c: &[f64]| -> Vec<f64> { c.windows(2).map(|w| w[1] - w[0]).collect() };
    let largest = |c: &[f64]| c.iter().fold(0.0, |max: f64, x| max.max(x.abs()));
    // The numerator of the derivative: X' W - X W'.
    let mut numerator = product(&slope(&own), &weights);
    let other = product(&own, &slope(&weights));
    for (a, b) in numerator.iter_mut().zip(other) {
        *a -= b;
    }
    let heaviest = largest(&weights);
    let size = (largest(&own) + middle.abs() * heaviest) * heaviest;
    for c in &mut numerator {
        if c.abs() <= NOISE * size {
            *c = 0.0;
        }
    }
    roots(numerator, cuts);
}

/// The parameters in `0..1` at which a coordinate of a Bézier piece passes a value, and perhaps
/// some at which it only comes near.
pub(crate) fn crossings(piece: &[DVec3], axis: usize, value: f64) -> Vec<f64> {
    let mut cuts = Vec::new();
    roots(
        piece.iter().map(|h| h[axis] - value * h.z).collect(),
        &mut cuts,
    );
    cuts
}

/// Appends every root in `0..1` at which a polynomial in Bernstein form changes its sign,
/// and the middles of intervals that had to be halved.
pub(super) fn roots(polynomial: Vec<f64>, cuts: &mut Vec<f64>) {
    let mut stack = vec![(polynomial, 0.0, 1.0, 0)];
    while let Some((mut left, start, end, depth)) = stack.pop() {
        let signs = left.iter().filter(|c| **c != 0.0).map(|c| *c > 0.0);
        let signs: Vec<bool> = signs.collect();
        let changes = signs.windows(2).filter(|w| w[0] != w[1]).count();
        if changes == 0 || depth == DEPTH && changes > 1 {
            continue;
        }
        if changes == 1 {
            cuts.push(isolated(&left, signs[0], start, end));
            continue;
        }
        let middle = 0.5 * (start + end);
        cuts.push(middle);
        let mut right = left.clone();
        halve(&mut left, &mut right);
        stack.push((left, start, middle, depth + 1));
        stack.push((right, middle, end, depth + 1));
    }
}

/// De Casteljau's algorithm in the middle; both hold the same before.
fn halve(left: &mut [f64], right: &mut [f64]) {
    let degree = left.len() - 1;
    for (level, end) in left.iter_mut().enumerate().skip(1) {
        for k in 0..=degree - level {
            right[k] = 0.5 * (right[k] + right[k + 1]);
        }
        *end = right[0];
    }
}

/// The only root of a polynomial over `start..end`, by Newton's steps, or by halving where these lead
/// away from it; `positive` before it.
fn isolated(polynomial: &[f64], positive: bool, start: f64, end: f64) -> f64 {
    let scaled: Vec<f64> = polynomial
        .iter()
        .zip(binomials(polynomial.len() - 1))
        .map(|(c, b)| c * b)
        .collect();
    let (mut low, mut high, mut t) = (0.0, 1.0, 0.5);
    for _ in 0..STEPS {
        // The sums of `c s^(n - k) t^k` and of their derivatives.
        let s = 1.0 - t;
        let [mut value, mut slope, mut power, mut rise] = [0.0, 0.0, 1.0, 0.0];
        for c in &scaled {
            slope = slope * s - value + c * rise;
            value = value * s + c * power;
            (power, rise) = (power * t, rise * t + power);
        }
        if (value > 0.0) == positive {
            low = t;
        } else {
            high = t;
        }
        let next = t - value / slope;
        let next = if low < next && next < high {
            next
        } else {
            0.5 * (low + high)
        };
        if (next - t).abs() <= f64::EPSILON * t {
            break;
        }
        t = next;
    }
    start + (end - start) * t
}
