//! How unevenly the parameters of a surface run over it.

use glam::DVec4;
use kernel::BezierSurface;

use super::{Piece, Pieces};

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

    /// Tells of a break along an axis whether steps after it are much longer or shorter than before: as points are
    /// farther apart there, or as a span that is much narrower bends that much more.
    pub(super) fn parted(&self, axis: usize) -> impl Fn(usize) -> bool + use<> {
        let (speeds, breaks) = (self.speeds(axis), &self.breaks[axis]);
        let widths = breaks.windows(2).map(|span| span[1] - span[0]);
        let mut spans: Vec<(f64, f64)> = widths.map(|width| (width, 0.0)).collect();
        for (span, piece) in self.spanned(axis) {
            let bend = [piece.spread.duu, piece.spread.dvv][axis].reach();
            spans[span].1 = spans[span].1.max(bend);
        }
        let is_bent = |narrow: (f64, f64), wide: (f64, f64)| {
            UNEVEN * narrow.0 < wide.0 && UNEVEN * UNEVEN * wide.1 < narrow.1
        };
        move |at: usize| {
            let (before, after) = (at - 1, at);
            let speed = factor(&speeds[before..=after]);
            UNEVEN < speed && speed * NOTHING < 1.0
                || is_bent(spans[before], spans[after])
                || is_bent(spans[after], spans[before])
        }
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
        let pieces = self.spanned(axis);
        pieces.flat_map(move |(span, piece)| lines(&piece.net, axis).map(move |line| (span, line)))
    }

    /// All pieces, each with the number of its span along an axis.
    fn spanned(&self, axis: usize) -> impl Iterator<Item = (usize, &Piece)> {
        let columns = self.columns();
        let pieces = self.list.iter().enumerate();
        pieces.map(move |(number, piece)| ([number / columns, number % columns][axis], piece))
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
