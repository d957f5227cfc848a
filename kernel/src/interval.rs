//! Intervals with outward rounding: numbers that are proven to lie between two others.
//!
//! Every operation computes its ends to nearest and then moves each by one unit in the last
//! place, unless the result is known to be exact. Switching the rounding mode of the
//! processor would be tighter by half a unit, but is neither portable nor seen by the
//! compiler.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// All real numbers from `low` to `high`; the ends may be infinite but are never NaN.
///
/// The result of an operation contains every result of the operation on members of the
/// operands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    low: f64,
    high: f64,
}

impl Interval {
    /// Zero alone.
    pub const ZERO: Self = Self::point(0.0);

    /// Every real number.
    pub const ENTIRE: Self = Self {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };

    /// The numbers from `low` to `high`; all of them if the ends are not in order or not
    /// numbers.
    #[inline]
    pub fn new(low: f64, high: f64) -> Self {
        if low <= high {
            Self { low, high }
        } else {
            Self::ENTIRE
        }
    }

    /// One number, which must not be NaN.
    #[inline]
    pub const fn point(x: f64) -> Self {
        Self { low: x, high: x }
    }

    /// What may have been rounded to `x`, in one operation.
    #[inline]
    pub fn rounded(x: f64) -> Self {
        Self::new(x.next_down(), x.next_up())
    }

    /// The lower end.
    #[inline]
    pub const fn low(self) -> f64 {
        self.low
    }

    /// The upper end.
    #[inline]
    pub const fn high(self) -> f64 {
        self.high
    }

    /// A number in the middle, up to rounding; no number if the interval has neither end.
    #[inline]
    pub fn middle(self) -> f64 {
        f64::midpoint(self.low, self.high)
    }

    /// An upper bound of the distance between the ends.
    #[inline]
    pub fn width(self) -> f64 {
        (self.high - self.low).next_up()
    }

    /// The largest absolute value.
    #[inline]
    pub fn magnitude(self) -> f64 {
        self.high.max(-self.low)
    }

    /// Whether `x` is a member.
    #[inline]
    pub fn contains(self, x: f64) -> bool {
        self.low <= x && x <= self.high
    }

    /// Whether every member of `other` is a member.
    #[inline]
    pub fn encloses(self, other: Self) -> bool {
        self.low <= other.low && other.high <= self.high
    }

    /// Whether both share a member.
    #[inline]
    pub fn overlaps(self, other: Self) -> bool {
        self.low <= other.high && other.low <= self.high
    }

    /// The least interval around both.
    #[inline]
    #[must_use]
    pub fn hull(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// The common members, if there are any.
    #[inline]
    pub fn intersection(self, other: Self) -> Option<Self> {
        self.overlaps(other).then(|| Self {
            low: self.low.max(other.low),
            high: self.high.min(other.high),
        })
    }

    /// The middles between members of both.
    #[inline]
    #[must_use]
    pub fn midpoint(self, other: Self) -> Self {
        let sum = self + other;
        Self::new(half(sum.low, f64::next_down), half(sum.high, f64::next_up))
    }

    /// The products with one number, which must be finite.
    #[inline]
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        let (a, b) = (self.low, self.high);
        let (a, b) = if factor < 0.0 { (b, a) } else { (a, b) };
        Self::new(
            product(a, factor, f64::next_down),
            product(b, factor, f64::next_up),
        )
    }

    /// All numbers within `radius` of a member; the radius is not negative.
    #[inline]
    #[must_use]
    pub fn widened(self, radius: f64) -> Self {
        self + Self::new(-radius, radius)
    }
}

/// A sum that vanishes is exact; any other is moved.
#[inline]
fn sum(a: f64, b: f64, outwards: fn(f64) -> f64) -> f64 {
    let sum = a + b;
    if sum == 0.0 { sum } else { outwards(sum) }
}

/// A product with zero is zero, also that of an infinite end; any other is moved.
#[inline]
fn product(a: f64, b: f64, outwards: fn(f64) -> f64) -> f64 {
    if a == 0.0 || b == 0.0 {
        0.0
    } else {
        outwards(a * b)
    }
}

/// Halving is exact unless digits fall off the lower end of the number range.
#[inline]
fn half(x: f64, outwards: fn(f64) -> f64) -> f64 {
    if x == 0.0 || x.abs() >= 2.0 * f64::MIN_POSITIVE {
        x * 0.5
    } else {
        outwards(x * 0.5)
    }
}

impl Add for Interval {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self::new(
            sum(self.low, other.low, f64::next_down),
            sum(self.high, other.high, f64::next_up),
        )
    }
}

impl Neg for Interval {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self {
            low: -self.high,
            high: -self.low,
        }
    }
}

impl Sub for Interval {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Interval {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        let extreme = |pick: fn(f64, f64) -> f64, outwards: fn(f64) -> f64| {
            let [a, b, c, d] = [
                (self.low, other.low),
                (self.low, other.high),
                (self.high, other.low),
                (self.high, other.high),
            ]
            .map(|(a, b)| product(a, b, outwards));
            pick(pick(a, b), pick(c, d))
        };
        Self::new(
            extreme(f64::min, f64::next_down),
            extreme(f64::max, f64::next_up),
        )
    }
}

impl Div for Interval {
    type Output = Self;

    /// All numbers if the divisor contains zero.
    #[inline]
    fn div(self, other: Self) -> Self {
        if !(other.low > 0.0 || other.high < 0.0) {
            return Self::ENTIRE;
        }
        let [a, b, c, d] = [
            self.low / other.low,
            self.low / other.high,
            self.high / other.low,
            self.high / other.high,
        ];
        if self == Self::ZERO {
            return self;
        }
        if [a, b, c, d].iter().any(|x| x.is_nan()) {
            return Self::ENTIRE;
        }
        let (low, high) = (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)));
        Self::new(low.next_down(), high.next_up())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Numbers of all signs and of many sizes, whole numbers among them.
    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![
            (-8_i32..=8).prop_map(f64::from),
            (-1.0..1.0, -40_i32..40).prop_map(|(x, e)| x * 2.0_f64.powi(e)),
        ]
    }

    /// An interval with two of its members.
    fn interval() -> impl Strategy<Value = (Interval, [f64; 2])> {
        (number(), number()).prop_map(|(a, b)| (Interval::new(a.min(b), a.max(b)), [a, b]))
    }

    /// Whether `x + error` is a member, exactly: `error` is below a unit of `x`.
    fn holds(interval: Interval, x: f64, error: f64) -> bool {
        let above = x > interval.low || (x >= interval.low && error >= 0.0);
        let below = x < interval.high || (x <= interval.high && error <= 0.0);
        above && below
    }

    /// The rounding error of a sum, exactly.
    fn sum_error(a: f64, b: f64) -> f64 {
        let sum = a + b;
        let share = sum - a;
        (a - (sum - share)) + (b - share)
    }

    proptest! {
        #[test]
        fn results_of_members_are_members((x, xs) in interval(), (y, ys) in interval()) {
            for a in xs {
                for b in ys {
                    prop_assert!(holds(x + y, a + b, sum_error(a, b)));
                    prop_assert!(holds(x - y, a - b, sum_error(a, -b)));
                    prop_assert!(holds(x * y, a * b, a.mul_add(b, -(a * b))));
                    prop_assert!(holds(x.scaled(b), a * b, a.mul_add(b, -(a * b))));
                    let middle = x.midpoint(y);
                    let twice = Interval::new(middle.low * 2.0, middle.high * 2.0);
                    prop_assert!(holds(twice, a + b, sum_error(a, b)));
                    if b != 0.0 {
                        let quotient = a / b;
                        let error = (-quotient).mul_add(b, a) / b;
                        prop_assert!(holds(x / y, quotient, error));
                    }
                }
            }
        }

        #[test]
        fn sets((x, xs) in interval(), (y, ys) in interval()) {
            for a in xs.into_iter().chain(ys) {
                prop_assert!(x.hull(y).contains(a));
                let common = x.intersection(y).is_some_and(|c| c.contains(a));
                prop_assert_eq!(common, x.contains(a) && y.contains(a));
            }
            prop_assert_eq!(x.overlaps(y), x.intersection(y).is_some());
            prop_assert!(x.width() >= (xs[0] - xs[1]).abs());
            prop_assert!(x.contains(x.middle()));
        }
    }

    #[test]
    fn rationals_are_enclosed_tightly() {
        // p/q + r/s = (ps + rq) / qs, where all products are exact.
        for (p, q, r, s) in [(1, 3, 2, 7), (-5, 11, 13, 17), (355, 113, -22, 7)] {
            let [p, q, r, s] = [p, q, r, s].map(f64::from);
            let [a, b, c, d] = [p, q, r, s].map(Interval::point);
            let found = a / b + c / d;
            let wanted = Interval::point(p * s + r * q) / Interval::point(q * s);
            assert!(found.overlaps(wanted) && found.width() < 1e-14);
            let product = (a / b) * (c / d);
            assert!(product.overlaps(Interval::point(p * r) / Interval::point(q * s)));
        }
    }

    #[test]
    fn what_cannot_be_known_is_everything() {
        let around_zero = Interval::new(-1.0, 1.0);
        assert_eq!(Interval::point(1.0) / around_zero, Interval::ENTIRE);
        assert_eq!(Interval::new(f64::NAN, 1.0), Interval::ENTIRE);
        assert_eq!(Interval::ENTIRE + Interval::ENTIRE, Interval::ENTIRE);
        assert_eq!(Interval::ENTIRE * Interval::ENTIRE, Interval::ENTIRE);
        assert_eq!(Interval::ENTIRE * Interval::ZERO, Interval::ZERO);
        let huge = Interval::point(f64::MAX) + Interval::point(f64::MAX);
        assert!(huge.contains(f64::MAX) && huge.high() == f64::INFINITY);
        let tiny = Interval::point(f64::MIN_POSITIVE) * Interval::point(f64::MIN_POSITIVE);
        assert!(tiny.low() <= 0.0 && tiny.high() > 0.0);
    }
}
