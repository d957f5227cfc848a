//! Knot vectors: validity, spans and basis functions.

use std::ops::Range;

use crate::Error;

/// Largest polynomial degree of a curve or surface direction.
pub const MAX_DEGREE: usize = 30;

/// Room for the basis values of one span that most curves and surfaces need; clearing and copying
/// more costs time.
pub(crate) const USUAL_ROOM: usize = 4;

/// Room that is enough for nearly all.
pub(crate) const WIDE_ROOM: usize = 10;

/// Room for those of any degree.
pub(crate) const MOST_ROOM: usize = MAX_DEGREE + 1;

/// So few knots are compared all at once.
const FEW: usize = 16;

/// A degree and a non-decreasing list of knots that together carry a spline.
///
/// The domain runs from `knots[degree]` to `knots[count]`, where `count` is the
/// number of control points; it has a positive length. Knots inside the domain
/// repeat at most `degree` times, knots at its ends at most `degree + 1` times, so
/// that every curve over it is continuous.
#[derive(Clone, Debug, PartialEq)]
pub struct KnotVector {
    degree: usize,
    knots: Vec<f64>,
}

impl KnotVector {
    /// Checks `knots` and takes them over.
    ///
    /// # Errors
    /// Says which rule above is broken, and where.
    pub fn new(degree: usize, knots: Vec<f64>) -> Result<Self, Error> {
        if degree == 0 || degree > MAX_DEGREE {
            return Err(Error::Degree { found: degree });
        }
        if knots.len() < 2 * (degree + 1) {
            return Err(Error::KnotCount {
                found: knots.len(),
                expected: 2 * (degree + 1),
            });
        }
        if let Some(index) = knots.iter().position(|k| !k.is_finite()) {
            return Err(Error::KnotNotFinite { index });
        }
        if let Some(i) = knots.windows(2).position(|w| w[1] < w[0]) {
            let (before, found) = (knots[i], knots[i + 1]);
            return Err(Error::KnotsDecrease {
                index: i + 1,
                before,
                found,
            });
        }
        let vector = Self { degree, knots };
        let Range { start, end } = vector.domain();
        if !(end > start && (end - start).is_finite()) {
            return Err(Error::EmptyDomain { start, end });
        }
        for run in runs(&vector.knots) {
            let inside = start < run[0] && run[0] < end;
            let allowed = if inside { degree } else { degree + 1 };
            if run.len() > allowed {
                return Err(Error::KnotMultiplicity {
                    knot: run[0],
                    found: run.len(),
                    allowed,
                });
            }
        }
        Ok(vector)
    }

    /// The knots of one Bézier piece over `start..end`.
    ///
    /// # Errors
    /// If the degree is out of range or the domain is empty.
    pub fn bezier(degree: usize, domain: Range<f64>) -> Result<Self, Error> {
        if degree == 0 || degree > MAX_DEGREE {
            return Err(Error::Degree { found: degree });
        }
        let ends = [domain.start, domain.end];
        Self::new(
            degree,
            ends.iter().flat_map(|&k| vec![k; degree + 1]).collect(),
        )
    }

    /// Clamped knots with equal steps over `domain` for `count` control points.
    ///
    /// # Errors
    /// If there are fewer than `degree + 1` points or more than memory holds, or as for
    /// [`KnotVector::new`].
    pub fn clamped_uniform(degree: usize, count: usize, domain: Range<f64>) -> Result<Self, Error> {
        if degree == 0 || degree > MAX_DEGREE {
            return Err(Error::Degree { found: degree });
        }
        if count <= degree {
            return Err(Error::PointCount {
                found: count,
                expected: degree + 1,
            });
        }
        let spans = count - degree;
        let mut knots = Vec::new();
        let total = count.checked_add(degree + 1);
        if total.is_none_or(|total| knots.try_reserve_exact(total).is_err()) {
            return Err(Error::TooManyPoints { found: count });
        }
        knots.resize(degree + 1, domain.start);
        let step = (domain.end - domain.start) / spans as f64;
        knots.extend((1..spans).map(|i| domain.start + step * i as f64));
        knots.resize(knots.len() + degree + 1, domain.end);
        Self::new(degree, knots)
    }

    /// Polynomial degree.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// The knots, in order.
    pub fn as_slice(&self) -> &[f64] {
        &self.knots
    }

    /// Number of control points that belong to these knots.
    pub fn count(&self) -> usize {
        self.knots.len() - self.degree - 1
    }

    /// Whether there is one span and all knots are at its ends, as for a Bézier curve.
    pub fn is_bezier(&self) -> bool {
        self.count() == self.degree + 1 && self.is_clamped()
    }

    /// Whether each end of the domain stands `degree + 1` times, so that curves begin and end in
    /// control points.
    pub(crate) fn is_clamped(&self) -> bool {
        self.knots[0] >= self.knots[self.degree]
            && self.knots[self.knots.len() - 1] <= self.knots[self.count()]
    }

    /// The parameters for which a curve is defined; both ends belong to it.
    pub fn domain(&self) -> Range<f64> {
        self.knots[self.degree]..self.knots[self.count()]
    }

    /// The different knots of the domain, both ends among them.
    pub fn breaks(&self) -> Vec<f64> {
        let mut breaks = self.knots[self.degree..=self.count()].to_vec();
        breaks.dedup();
        breaks
    }

    /// `range` with the ends moved that are beside a break, no farther than `share` of the domain.
    ///
    /// Of a span cut to almost nothing no derivative would have a meaning: written numbers are
    /// rounded, and what begins beside a knot is meant to begin there.
    #[must_use]
    pub fn snapped(&self, range: Range<f64>, share: f64) -> Range<f64> {
        let domain = self.domain();
        let slack = share * (domain.end - domain.start);
        let breaks = self.breaks();
        let moved = |end: f64| {
            let near = breaks.iter().find(|knot| (*knot - end).abs() <= slack);
            near.copied().unwrap_or(end)
        };
        moved(range.start)..moved(range.end)
    }

    /// Index `k` of the span with `knots[k] <= t < knots[k + 1]`.
    ///
    /// The end of the domain belongs to the last span that has a length, and
    /// parameters outside the domain to the first or last span.
    pub fn span(&self, t: f64) -> usize {
        let count = self.count();
        if count == self.degree + 1 {
            return self.degree;
        }
        let end = self.knots[count];
        if t >= end {
            return self.knots[..count].partition_point(|&k| k < end) - 1;
        }
        let inner = &self.knots[self.degree + 1..count];
        let above = if inner.len() <= FEW {
            inner.iter().map(|&k| usize::from(k <= t)).sum()
        } else {
            inner.partition_point(|&k| k <= t)
        };
        let mut span = self.degree + above;
        while self.knots[span + 1] <= self.knots[span] {
            span += 1;
        }
        span
    }

    /// How often `t` stands among the knots.
    pub fn multiplicity(&self, t: f64) -> usize {
        self.knots.partition_point(|&k| k <= t) - self.knots.partition_point(|&k| k < t)
    }

    /// The same knots moved affinely to `domain`; different knots stay different.
    ///
    /// # Errors
    /// If `domain` is empty, not finite or too short to tell the knots apart.
    pub fn remapped(&self, domain: Range<f64>) -> Result<Self, Error> {
        let (old, Range { start, end }) = (self.domain(), domain);
        let scale = (end - start) / (old.end - old.start);
        if !(start < end && scale.is_finite()) {
            return Err(Error::EmptyDomain { start, end });
        }
        let image = |&k: &f64| {
            if k >= old.end {
                end + (k - old.end) * scale
            } else {
                start + (k - old.start) * scale
            }
        };
        let moved = self.knots.iter().map(image).collect();
        Self::new(self.degree, kept_apart(&self.knots, moved, self.count()))
    }

    /// The knots seen from the other end, over the same domain; different knots stay
    /// different.
    #[must_use]
    pub fn reversed(&self) -> Self {
        let Range { start, end } = self.domain();
        let mirror = |&k: &f64| {
            if k <= start {
                end + (start - k)
            } else {
                start + (end - k)
            }
        };
        let turned: Vec<_> = self.knots.iter().rev().copied().collect();
        let moved = turned.iter().map(mirror).collect();
        Self {
            degree: self.degree,
            knots: kept_apart(&turned, moved, self.count()),
        }
    }

    /// Knots that are known to be valid because they come from valid ones.
    pub(crate) fn trusted(degree: usize, knots: Vec<f64>) -> Self {
        Self { degree, knots }
    }

    /// Those of one Bézier piece, which are known to be valid.
    pub(crate) fn trusted_bezier(degree: usize, domain: &Range<f64>) -> Self {
        let mut knots = vec![domain.start; 2 * (degree + 1)];
        knots[degree + 1..].fill(domain.end);
        Self { degree, knots }
    }

    /// The basis functions that are not zero at `t`: the index of the first one, and the values
    /// of all `degree + 1`. Outside the domain those of the end pieces are prolonged.
    pub fn basis_functions(&self, t: f64) -> (usize, Vec<f64>) {
        let span = self.span(t);
        let [values] = self.basis::<1, MOST_ROOM>(span, t);
        (span - self.degree, values[..=self.degree].to_vec())
    }

    /// The `degree + 1` basis functions that are not zero on `span`, and their derivatives of
    /// the orders below `ORDERS`, at most 3, at `t`; there must be `ROOM` for them.
    ///
    /// Cox-de Boor recurrence; derivatives as differences of the functions one degree
    /// lower \[Piegl 97, eq. 2.5 and 2.7\].
    #[inline]
    pub(crate) fn basis<const ORDERS: usize, const ROOM: usize>(
        &self,
        span: usize,
        t: f64,
    ) -> [[f64; ROOM]; ORDERS] {
        let p = self.degree;
        // The knots that count, half of them at the span's start and before.
        let knots = &self.knots[span + 1 - p..=span + p];
        // Loops of known length take less than half of the time.
        match p {
            1 => basis(1, knots, t),
            2 => basis(2, knots, t),
            3 => basis(3, knots, t),
            _ => basis(p, knots, t),
        }
    }
}

/// As [`KnotVector::basis`], of degree `p` between the middle two of its `2 p` knots.
#[inline(always)]
fn basis<const ORDERS: usize, const ROOM: usize>(
    p: usize,
    knots: &[f64],
    t: f64,
) -> [[f64; ROOM]; ORDERS] {
    // Two quotients, so that the ends of a clamped curve are its points exactly.
    let shares =
        |left: f64, right: f64| ((right - t) / (right - left), (t - left) / (right - left));
    let (start, end) = (knots[p - 1], knots[p]);
    if knots[0] >= start && knots[2 * p - 1] <= end {
        // A Bézier piece: all lengths are one.
        let share = shares(start, end);
        rows(p, |_, _| share, |_, _| end - start)
    } else {
        let ends = |d: usize, r: usize| (knots[p + r - d], knots[p + r]);
        let share = |d, r| {
            let (left, right) = ends(d, r);
            shares(left, right)
        };
        let length = |d, r| {
            let (left, right) = ends(d, r);
            right - left
        };
        rows(p, share, length)
    }
}

/// Basis functions and their derivatives. Where function `r` of degree `d - 1` is not zero it falls
/// and rises by a `share`, over a `length`.
#[inline(always)]
fn rows<const ORDERS: usize, const ROOM: usize>(
    p: usize,
    share: impl Fn(usize, usize) -> (f64, f64),
    length: impl Fn(usize, usize) -> f64,
) -> [[f64; ROOM]; ORDERS] {
    let mut rows = [[0.0; ROOM]; ORDERS];
    rows[0][0] = 1.0;
    for d in 1..=p {
        // The derivative of this order begins with the values of degree `p - order`.
        let order = p + 1 - d;
        if order < ORDERS {
            rows[order] = rows[0];
        }
        // Values of degree `d - 1` become those of degree `d`.
        let mut saved = 0.0;
        for (r, value) in rows[0][..d].iter_mut().enumerate() {
            let (falling, rising) = share(d, r);
            (*value, saved) = (saved + *value * falling, *value * rising);
        }
        rows[0][d] = saved;
    }
    for (order, row) in rows.iter_mut().enumerate().take(p + 1) {
        for d in p + 1 - order..=p {
            // Values or derivatives of degree `d - 1` become derivatives, one order higher, of
            // degree `d`.
            let mut saved = 0.0;
            for (r, value) in row[..d].iter_mut().enumerate() {
                let part = d as f64 * *value / length(d, r);
                (*value, saved) = (saved - part, part);
            }
            row[d] = saved;
        }
    }
    rows
}

/// The runs of equal knots.
pub(crate) fn runs(knots: &[f64]) -> impl Iterator<Item = &[f64]> {
    #[expect(clippy::float_cmp, reason = "only equal knots are one knot")]
    knots.chunk_by(|a, b| a == b)
}

/// The knots `moved` from `old`, both ascending, with equal knots made equal again and
/// different ones that rounding has merged or exchanged put one bit apart.
///
/// The knot at `fixed` stays where it is; not finite ones stay that way.
#[expect(clippy::float_cmp, reason = "only equal knots are one knot")]
fn kept_apart(old: &[f64], mut moved: Vec<f64>, fixed: usize) -> Vec<f64> {
    for i in (0..fixed).rev() {
        let next = moved[i + 1];
        moved[i] = if old[i] == old[i + 1] {
            next
        } else {
            moved[i].min(next.next_down())
        };
    }
    for i in fixed + 1..moved.len() {
        let previous = moved[i - 1];
        moved[i] = if old[i] == old[i - 1] {
            previous
        } else {
            moved[i].max(previous.next_up())
        };
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_are_half_open_and_skip_repeated_knots() {
        let knots = KnotVector::new(2, vec![0., 0., 0., 1., 1., 2., 2., 2.]).unwrap();
        assert_eq!(knots.span(0.0), 2);
        assert_eq!(knots.span(0.5), 2);
        assert_eq!(knots.span(1.0), 4);
        assert_eq!(knots.span(2.0), 4);
        assert_eq!(knots.breaks(), [0.0, 1.0, 2.0]);
    }

    #[test]
    fn unclamped_domain_lies_inside_the_knots() {
        let knots = KnotVector::new(3, (0..8).map(f64::from).collect()).unwrap();
        assert_eq!(knots.domain(), 3.0..4.0);
        assert_eq!(knots.span(4.0), 3);
        assert_eq!(knots.reversed().as_slice(), knots.as_slice());
    }

    #[test]
    fn broken_vectors_are_named() {
        let err = |degree, knots: &[f64]| KnotVector::new(degree, knots.to_vec()).unwrap_err();
        assert_eq!(err(31, &[]), Error::Degree { found: 31 });
        assert_eq!(
            err(1, &[0., 1.]),
            Error::KnotCount {
                found: 2,
                expected: 4
            }
        );
        assert_eq!(
            err(1, &[0., 0., f64::NAN, 1.]),
            Error::KnotNotFinite { index: 2 }
        );
        let decrease = Error::KnotsDecrease {
            index: 3,
            before: 1.0,
            found: 0.5,
        };
        assert_eq!(err(1, &[0., 0., 1., 0.5]), decrease);
        assert_eq!(
            err(1, &[0., 0., 0., 0.]),
            Error::EmptyDomain {
                start: 0.0,
                end: 0.0
            }
        );
        let torn = Error::KnotMultiplicity {
            knot: 1.0,
            found: 2,
            allowed: 1,
        };
        assert_eq!(err(1, &[0., 0., 1., 1., 2., 2.]), torn);
    }

    #[test]
    fn more_points_than_memory_holds_are_an_error() {
        for found in [usize::MAX, usize::MAX / 2, isize::MAX.unsigned_abs() / 8] {
            let knots = KnotVector::clamped_uniform(3, found, 0.0..1.0);
            assert_eq!(knots, Err(Error::TooManyPoints { found }));
        }
        let knots = KnotVector::clamped_uniform(1, 3, 0.0..1.0).unwrap();
        assert_eq!(knots.as_slice(), [0.0, 0.0, 0.5, 1.0, 1.0]);
    }

    #[test]
    fn neighbouring_knots_survive_reversal() {
        let near = vec![0., 0., 0., 1e-17, 1e-17, 2e-17, 1., 1., 1.];
        let turned = KnotVector::new(2, near).unwrap().reversed();
        let again = KnotVector::new(2, turned.as_slice().to_vec()).unwrap();
        assert_eq!(again.domain(), 0.0..1.0);
        assert_eq!(again.breaks().len(), 4);
        let shifted = again.remapped(1e6..1e6 + 1.0).unwrap();
        assert_eq!(shifted.breaks().len(), 4);
        assert!(again.remapped(1e300..1e300).is_err());
        assert!(again.remapped(f64::NAN..1.0).is_err());
        assert!(again.remapped(0.0..f64::INFINITY).is_err());
    }

    #[test]
    fn derivative_rows_sum_to_zero() {
        let knots = KnotVector::new(3, vec![0., 0., 0., 0., 1., 3., 4., 4., 4., 4.]).unwrap();
        for t in [0.0, 0.25, 1.0, 2.9, 4.0] {
            let [value, first, second] = knots.basis::<3, USUAL_ROOM>(knots.span(t), t);
            assert!((value.iter().sum::<f64>() - 1.0).abs() < 1e-15);
            assert!(first.iter().sum::<f64>().abs() < 1e-14);
            assert!(second.iter().sum::<f64>().abs() < 1e-13);
        }
    }
}
