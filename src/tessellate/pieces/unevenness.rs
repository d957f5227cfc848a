//! How unevenly the parameters of a surface run over it.

use glam::DVec4;
use kernel::BezierSurface;

use super::Pieces;

/// Steps whose lengths differ by more than this factor are uneven.
pub(in super::super) const UNEVEN: f64 = 4.0;

/// Spans along which points are no farther apart than this share of those beside them are as good as none.
const NOTHING: f64 = 1e-6;

impl Pieces<'_> {
    /// By what factor steps that are as good as each other differ in length, in each of the spans along an axis and
    /// next to it: by that of weights, and of how far points are apart for a unit of the parameter.
    pub(in super::super) fn unevenness(&self, axis: usize) -> Vec<f64> {
        let speeds = self.speeds(axis);
        let beside = |span: usize| &speeds[span.saturating_sub(1)..(span + 2).min(speeds.len())];
        let mut factors: Vec<f64> = (0..speeds.len()).map(|k| factor(beside(k))).collect();
        for (span, line) in self.lines(axis) {
            let weights: Vec<f64> = line.map(|h| h.w).collect();
            factors[span] = factors[span].max(factor(&weights));
        }
        factors
    }

    /// Whether steps after a break along an axis are much longer or shorter than those before it: as points are farther
    /// apart there, or as a span that is much narrower bends that much more.
    pub(super) fn parts_steps(&self, axis: usize, speeds: &[f64], at: usize) -> bool {
        let speed = factor(&speeds[at - 1..=at]);
        if UNEVEN < speed && speed * NOTHING < 1.0 {
            return true;
        }
        let [before, after] = [at - 1, at].map(|span| {
            let width = self.breaks[axis][span + 1] - self.breaks[axis][span];
            let row = self.list.iter().enumerate().filter(|(number, _)| {
                [number / self.columns(), number % self.columns()][axis] == span
            });
            let bends = row.map(|(_, piece)| [piece.spread.duu, piece.spread.dvv][axis].reach());
            (width, bends.fold(0.0, f64::max))
        });
        let is_bent = |narrow: (f64, f64), wide: (f64, f64)| {
            UNEVEN * narrow.0 < wide.0 && UNEVEN * UNEVEN * wide.1 < narrow.1
        };
        is_bent(before, after) || is_bent(after, before)
    }

    /// How far points are apart for a unit of the parameter, at most, in each of the spans along an axis.
    pub(super) fn speeds(&self, axis: usize) -> Vec<f64> {
        let breaks = &self.breaks[axis];
        let mut speeds = vec![0.0_f64; breaks.len() - 1];
        for (span, line) in self.lines(axis) {
            let places = line.map(|h| h.truncate() / h.w);
            let pairs = places.clone().zip(places.skip(1));
            let length: f64 = pairs.map(|(a, b)| a.distance(b)).sum();
            speeds[span] = speeds[span].max(length / (breaks[span + 1] - breaks[span]));
        }
        speeds
    }

    /// The control points of all pieces, line by line along an axis, each with the number of its span.
    fn lines(
        &self,
        axis: usize,
    ) -> impl Iterator<Item = (usize, impl Iterator<Item = &DVec4> + Clone)> {
        self.list
            .iter()
            .enumerate()
            .flat_map(move |(number, piece)| {
                let span = [number / self.columns(), number % self.columns()][axis];
                lines(&piece.net, axis).map(move |line| (span, line))
            })
    }
}

/// The control points of a piece, line by line along an axis.
fn lines(
    net: &BezierSurface,
    axis: usize,
) -> impl Iterator<Item = impl Iterator<Item = &DVec4> + Clone> {
    let row = net.degree_v() + 1;
    let (count, between, step) = if axis == 0 {
        (row, 1, row)
    } else {
        (net.degree_u() + 1, row, 1)
    };
    let points = net.homogeneous();
    let length = points.len() / count;
    (0..count).map(move |line| points[line * between..].iter().step_by(step).take(length))
}

/// How many times the least of some numbers is the largest.
fn factor(values: &[f64]) -> f64 {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    values.iter().copied().fold(0.0, f64::max) / least
}
