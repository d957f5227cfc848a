//! Curves of a loop put in order: each begins where the one before ends.

use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::Curve;

use crate::least;

/// Curves in the parameter domain.
pub(super) type Chain = Vec<Curve<DVec2>>;

/// A curve is looked at for crossings of the first seam and this many more.
const TURNS: u8 = 4;

/// Crossings of a seam are this near to it, as a share of the period.
const NEAR: f64 = 1e-9;

/// Curves of a loop on a surface, whose points are given by parameters; what is no farther apart
/// than `accuracy` meets.
pub(super) struct Order<F> {
    pub(super) point: F,
    /// The domains of parameters along which the surface is closed.
    pub(super) periods: [Option<Range<f64>>; 2],
    /// Curves are not turned round for less.
    pub(super) near: f64,
    pub(super) accuracy: f64,
}

impl<F: Fn(DVec2) -> DVec3> Order<F> {
    /// Lets closed curves begin where others of the loop end, and turns curves round where that lets
    /// them meet, in space.
    pub(super) fn aligned(&self, curves: Chain) -> Chain {
        if curves.len() < 2 {
            return curves;
        }
        self.turned(self.opened(curves))
    }

    fn ends(&self, curves: &Chain) -> Vec<[DVec3; 2]> {
        let ends = |c: &Curve<DVec2>| [(self.point)(c.start()), (self.point)(c.end())];
        curves.iter().map(ends).collect()
    }

    /// Divides closed curves that begin elsewhere than at their neighbours but pass by there.
    fn opened(&self, curves: Chain) -> Chain {
        let ends = self.ends(&curves);
        let count = curves.len();
        let opened = |(k, curve): (usize, Curve<DVec2>)| {
            let stops = [(k + count - 1) % count, (k + 1) % count].map(|beside| ends[beside]);
            let [start, end] = ends[k];
            let meets = |p: &DVec3| p.distance(start) <= self.accuracy;
            if !meets(&end) || stops.as_flattened().iter().any(meets) {
                return vec![curve];
            }
            let nearest = |places: Vec<(f64, f64)>| {
                let nearest = places.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
                nearest.filter(|(_, distance)| *distance <= self.accuracy)
            };
            let stops = stops.as_flattened();
            // On the seam, where there is one, so that no sliver beside it is left.
            let crossed = nearest(self.crossed(&curve, stops));
            let place = crossed
                .or_else(|| nearest(stops.iter().map(|&p| self.passed(&curve, p)).collect()));
            match place.map(|(t, _)| curve.split(t)) {
                Some(Ok([before, after])) => vec![after, before],
                _ => vec![curve],
            }
        };
        curves.into_iter().enumerate().flat_map(opened).collect()
    }

    /// Where a curve crosses the seam of the surface, and how far the nearest of some points is from
    /// there.
    fn crossed(&self, curve: &Curve<DVec2>, stops: &[DVec3]) -> Vec<(f64, f64)> {
        let mut places = Vec::new();
        for (axis, domain) in self.periods.iter().enumerate() {
            let Some(Range { start, end }) = domain else {
                continue;
            };
            let period = end - start;
            let along = || curve.points().map(|p| (p[axis] - start) / period);
            let least = along().fold(f64::INFINITY, f64::min).ceil();
            let most = along().fold(f64::NEG_INFINITY, f64::max).floor();
            let seams = (0..=TURNS).map(|k| least + f64::from(k));
            for turns in seams.take_while(|turns| *turns <= most) {
                let seam = start + turns * period;
                for t in curve.crossings(axis, seam, NEAR * period) {
                    let point = (self.point)(curve.evaluate(t));
                    let off = stops.iter().map(|p| p.distance(point));
                    places.push((t, off.fold(f64::INFINITY, f64::min)));
                }
            }
        }
        places
    }

    /// Where a curve passes nearest to a point, and how far from it.
    fn passed(&self, curve: &Curve<DVec2>, target: DVec3) -> (f64, f64) {
        let off = |t: f64| (self.point)(curve.evaluate(t)).distance(target);
        least::least(&curve.knots().breaks(), off)
    }

    /// Turns curves round, each only where that is clearly better.
    fn turned(&self, mut curves: Chain) -> Chain {
        let mut ends = self.ends(&curves);
        let better = |turned: f64, straight: f64| straight > self.near && turned < 0.5 * straight;
        let to_next = |p: DVec3| p.distance(ends[1][0]).min(p.distance(ends[1][1]));
        if better(to_next(ends[0][0]), to_next(ends[0][1])) {
            curves[0] = curves[0].reversed();
            ends[0].reverse();
        }
        for k in 1..curves.len() {
            let before = ends[k - 1][1];
            if better(before.distance(ends[k][1]), before.distance(ends[k][0])) {
                curves[k] = curves[k].reversed();
                ends[k].reverse();
            }
        }
        curves
    }
}
