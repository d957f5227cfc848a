//! Integrals over rectangles of one Bézier piece, and from its left border to a curve.

use std::cell::{Cell, OnceCell};
use std::ops::Range;
use std::sync::LazyLock;

use glam::{DVec2, DVec3, DVec4};

use super::sums::Sums;
use crate::bernstein::basis;
use crate::curve::are_rational;
use crate::{BezierSurface, Curve, MAX_DEGREE};

/// How often an interval or rectangle is halved at most, where weights are the same.
const HALVINGS: u32 = 14;

/// Intervals to which the rule is applied in one piece, before no more is halved: what then still differs is
/// told as the error.
const INTERVALS: u32 = 1 << 20;

/// Fewest and most nodes along one direction.
const NODES: Range<usize> = 6..17;

/// Fewest nodes of a piece that is curved or rational, so that hardly any intervals are halved.
const CURVED: usize = 10;

/// What halving changes in rows of a plain piece is no more than this share of the tolerance.
const PLAIN: f64 = 0.01;

/// Points of a row of degree three or less, and of any.
const FEW: usize = 4;
pub(super) const ALL: usize = MAX_DEGREE + 1;

/// Nodes and weights of Gauss and Legendre over 0..1: exact for polynomials of degree
/// `2 n - 1` \[Davis 84, section 2.7\].
#[derive(Clone, Debug)]
pub(super) struct Rule {
    pub(super) nodes: Vec<(f64, f64)>,
}

impl Rule {
    /// The rule with `count` nodes, by Newton's method on the Legendre polynomial.
    pub(super) fn new(count: usize) -> Self {
        let n = count as f64;
        let node = |k: usize| {
            let mut x = (std::f64::consts::PI * (k as f64 + 0.75) / (n + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..8 {
                let (mut before, mut value) = (1.0, x);
                for j in 2..=count {
                    let j = j as f64;
                    (before, value) = (
                        value,
                        ((2.0 * j - 1.0) * x * value - (j - 1.0) * before) / j,
                    );
                }
                slope = n * (x * value - before) / (x * x - 1.0);
                x -= value / slope;
            }
            (0.5 - 0.5 * x, 1.0 / ((1.0 - x * x) * slope * slope))
        };
        Self {
            nodes: (0..count).map(node).collect(),
        }
    }
}

/// The rules of pieces, from the one with the fewest nodes on.
static RULES: LazyLock<Vec<Rule>> = LazyLock::new(|| NODES.map(Rule::new).collect());

/// A Bézier piece, ready to be integrated over its local parameters 0..1.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    degrees: [usize; 2],
    /// Homogeneous control points about the origin of the moments.
    points: Vec<DVec4>,
    rules: [&'static Rule; 2],
    /// Errors that are small enough for one rectangle.
    tolerance: Sums,
    /// How often an interval or rectangle is halved at most: what weights make narrow is seen then, too.
    halvings: u32,
    /// How many more intervals there may be.
    left: Cell<u32>,
    /// Whether the rule is good for rows as a whole, so that parts of rows need no second answer.
    is_plain: OnceCell<bool>,
}

/// A column of control points: the piece at one `t`, and its derivative along `t`.
pub(super) struct Row<const N: usize> {
    points: [DVec4; N],
    slopes: [DVec4; N],
}

impl Piece {
    /// A piece with its control points about `origin`.
    pub(super) fn new(piece: &BezierSurface, origin: DVec3, tolerance: Sums) -> Self {
        let degrees = [piece.degree_u(), piece.degree_v()];
        let moved = |h: &DVec4| (h.truncate() - origin * h.w).extend(h.w);
        let is_flat = degrees == [1, 1] && !are_rational(piece.homogeneous());
        let fewest = if is_flat { NODES.start } else { CURVED };
        // Volumes of polynomial pieces have the degree 3 p - 1.
        let count = |p: usize| ((3 * p).div_ceil(2) + 1).clamp(fewest, NODES.end - 1);
        Self {
            degrees,
            points: piece.homogeneous().iter().map(moved).collect(),
            rules: degrees.map(|p| &RULES[count(p) - NODES.start]),
            tolerance,
            halvings: HALVINGS + unevenness(piece.homogeneous()),
            left: Cell::new(INTERVALS),
            is_plain: OnceCell::new(),
        }
    }

    /// The piece at `t`.
    pub(super) fn row<const N: usize>(&self, t: f64) -> Row<N> {
        let [p, q] = self.degrees;
        let mut row = Row {
            points: [DVec4::ZERO; N],
            slopes: [DVec4::ZERO; N],
        };
        let (values, slopes) = basis::<N>(q, t);
        for (i, points) in self.points.chunks_exact(q + 1).enumerate().take(p + 1) {
            row.points[i] = sum(points, &values);
            row.slopes[i] = sum(points, &slopes);
        }
        row
    }

    /// The point at `s` of a row, about the origin, and the normal there, as long as its area.
    pub(super) fn at<const N: usize>(&self, row: &Row<N>, s: f64) -> (DVec3, DVec3) {
        let p = self.degrees[0];
        let (values, slopes) = basis::<N>(p, s);
        let h = sum(&row.points[..=p], &values);
        let hs = sum(&row.points[..=p], &slopes);
        let ht = sum(&row.slopes[..=p], &values);
        let point = h.truncate() / h.w;
        let along_s = (hs.truncate() - point * hs.w) / h.w;
        let along_t = (ht.truncate() - point * ht.w) / h.w;
        (point, along_s.cross(along_t))
    }

    /// What is integrated, at `s` of a row.
    fn density<const N: usize>(&self, row: &Row<N>, s: f64) -> Sums {
        let (point, normal) = self.at(row, s);
        Sums::density(point, normal)
    }

    /// One application of the rules to a rectangle.
    fn rectangle<const N: usize>(&self, s: [f64; 2], t: [f64; 2]) -> Sums {
        let mut sums = Sums::default();
        for &(y, weight) in &self.rules[1].nodes {
            let row = self.row::<N>(t[0] + (t[1] - t[0]) * y);
            sums += self.line(&row, s) * (weight * (t[1] - t[0]));
        }
        sums
    }

    /// One application of the rule to an interval of a row.
    fn line<const N: usize>(&self, row: &Row<N>, s: [f64; 2]) -> Sums {
        self.spend(1);
        let mut sums = Sums::default();
        for &(x, weight) in &self.rules[0].nodes {
            sums += self.density(row, s[0] + (s[1] - s[0]) * x) * weight;
        }
        sums * (s[1] - s[0])
    }

    /// Takes note of what has been looked at, as many intervals or what takes as long.
    pub(super) fn spend(&self, intervals: usize) {
        let spent = u32::try_from(intervals).unwrap_or(u32::MAX);
        self.left.set(self.left.get().saturating_sub(spent));
    }

    /// Whether halving makes an integral better; what is not a number stays so.
    fn is_halved(&self, level: u32, error: &Sums) -> bool {
        let has_room = level < self.halvings && self.left.get() > 0;
        has_room && error.is_finite() && !error.is_within(&self.tolerance)
    }

    /// Whether rows of few points hold the piece.
    fn is_small(&self) -> bool {
        self.degrees.iter().all(|degree| *degree < FEW)
    }

    /// The integral over a rectangle, and its error.
    pub(super) fn over(&self, s: [f64; 2], t: [f64; 2]) -> (Sums, Sums) {
        if self.is_small() {
            self.over_rows::<FEW>(s, t)
        } else {
            self.over_rows::<ALL>(s, t)
        }
    }

    fn over_rows<const N: usize>(&self, s: [f64; 2], t: [f64; 2]) -> (Sums, Sums) {
        let mut total = (Sums::default(), Sums::default());
        let mut waiting = vec![(s, t, self.rectangle::<N>(s, t), 0)];
        while let Some((s, t, whole, level)) = waiting.pop() {
            let (ms, mt) = (s[0].midpoint(s[1]), t[0].midpoint(t[1]));
            // Halved one way, and the other.
            let ways = [
                [([s[0], ms], t), ([ms, s[1]], t)],
                [(s, [t[0], mt]), (s, [mt, t[1]])],
            ];
            let ways = ways
                .map(|halves| halves.map(|(s, t)| (s, t, self.rectangle::<N>(s, t), level + 1)));
            let gains = ways.map(|[a, b]| a.2 + b.2 - whole);
            let [across, along] = gains.map(Sums::abs);
            let error = across + along;
            if self.is_halved(level / 2, &error) {
                let along_t = along.share_of(&self.tolerance) > across.share_of(&self.tolerance);
                waiting.extend(ways[usize::from(along_t)]);
            } else {
                total.0 += whole + gains[0] + gains[1];
                total.1 += error;
            }
        }
        total
    }

    /// Whether the rule is as good as its halves for some rows, over all of them.
    fn is_plain<const N: usize>(&self) -> bool {
        let tolerance = self.tolerance * PLAIN;
        let is_good = |t: f64| {
            let row = self.row::<N>(t);
            let [first, second] = self.halves(&row, [0.0, 1.0]).map(|half| half.1);
            let error = (first + second - self.line(&row, [0.0, 1.0])).abs();
            error.is_within(&tolerance)
        };
        let nodes = self.rules[1].nodes.iter().map(|node| node.0);
        *self
            .is_plain
            .get_or_init(|| [0.0, 1.0].into_iter().chain(nodes).all(is_good))
    }

    /// Both halves of an interval of a row.
    fn halves<const N: usize>(&self, row: &Row<N>, s: [f64; 2]) -> [([f64; 2], Sums); 2] {
        let middle = s[0].midpoint(s[1]);
        [[s[0], middle], [middle, s[1]]].map(|s| (s, self.line(row, s)))
    }

    /// The integral over an interval of a row.
    fn along<const N: usize>(&self, row: &Row<N>, s: [f64; 2]) -> Sums {
        let whole = self.line(row, s);
        if self.is_plain::<N>() {
            return whole;
        }
        let mut total = Sums::default();
        let mut waiting = vec![(s, whole, 0)];
        while let Some((s, whole, level)) = waiting.pop() {
            let parts = self.halves(row, s).map(|(s, half)| (s, half, level + 1));
            let sum = parts[0].1 + parts[1].1;
            if self.is_halved(level, &(sum - whole).abs()) {
                waiting.extend(parts);
            } else {
                total += sum;
            }
        }
        total
    }

    /// The integral between the left border `s = 0` and a curve in local parameters, counted
    /// negative where the curve goes to smaller `t`; and its error.
    pub(super) fn left_of(&self, curve: &Curve<DVec2>, range: [f64; 2]) -> (Sums, Sums) {
        if self.is_small() {
            self.left_of_rows::<FEW>(curve, range)
        } else {
            self.left_of_rows::<ALL>(curve, range)
        }
    }

    fn left_of_rows<const N: usize>(&self, curve: &Curve<DVec2>, range: [f64; 2]) -> (Sums, Sums) {
        self.halved(range, |x| {
            let at = curve.derivatives(x);
            let [s, t] = at.point.to_array().map(|x| x.clamp(0.0, 1.0));
            let row = self.row::<N>(t);
            self.along(&row, [0.0, s]) * at.first.y
        })
    }

    /// The integral over intervals of the rows in a range of local parameters, and its error.
    pub(super) fn inside(
        &self,
        intervals: impl Fn(f64) -> Vec<[f64; 2]>,
        range: [f64; 2],
    ) -> (Sums, Sums) {
        self.halved(range, |t| {
            let row = self.row::<ALL>(t);
            let parts = intervals(t).into_iter().map(|s| self.along(&row, s));
            parts.fold(Sums::default(), |sum, part| sum + part)
        })
    }

    /// The integral of a function over a range that is halved until two answers agree, and its
    /// error.
    fn halved(&self, range: [f64; 2], function: impl Fn(f64) -> Sums) -> (Sums, Sums) {
        let apply = |range: [f64; 2]| {
            let mut sums = Sums::default();
            let span = range[1] - range[0];
            // Ranges are short: a few nodes do.
            for &(x, weight) in &RULES[0].nodes {
                sums += function(range[0] + span * x) * (weight * span);
            }
            sums
        };
        let mut total = (Sums::default(), Sums::default());
        let mut waiting = vec![(range, apply(range), 0)];
        while let Some((range, whole, level)) = waiting.pop() {
            let middle = range[0].midpoint(range[1]);
            let halves = [[range[0], middle], [middle, range[1]]];
            let parts = halves.map(|range| (range, apply(range), level + 1));
            let sum = parts[0].1 + parts[1].1;
            let error = (sum - whole).abs();
            if self.is_halved(level, &error) {
                waiting.extend(parts);
            } else {
                total.0 += sum;
                total.1 += error;
            }
        }
        total
    }
}

/// How often the largest weight of points can be halved before it is less than the least one.
fn unevenness(points: &[DVec4]) -> u32 {
    let least = points.iter().map(|h| h.w).fold(f64::INFINITY, f64::min);
    let mut most = points.iter().map(|h| h.w).fold(0.0, f64::max);
    let mut count = 0;
    while most > least && count < f64::MANTISSA_DIGITS {
        most *= 0.5;
        count += 1;
    }
    count
}

/// Points with a factor for each.
fn sum(points: &[DVec4], factors: &[f64]) -> DVec4 {
    let pairs = points.iter().zip(factors);
    pairs.fold(DVec4::ZERO, |sum, (point, factor)| sum + *point * *factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_are_exact_up_to_their_degree() {
        for count in 1..17 {
            let rule = Rule::new(count);
            for degree in 0..2 * count {
                let power = |&(x, w): &(f64, f64)| w * x.powi(i32::try_from(degree).unwrap());
                let found: f64 = rule.nodes.iter().map(power).sum();
                assert!(
                    (found - 1.0 / (degree as f64 + 1.0)).abs() < 1e-14,
                    "{count} {degree}"
                );
            }
        }
    }
}
