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

/// Loops of more curves are taken in the order of the file.
const SORTED: usize = 500;

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
    /// Lets closed curves begin where others of the loop end, turns curves round where that lets
    /// them meet, in space, and puts them in the order in which they meet without a jump; whether
    /// they do not even meet in space in the order of the file.
    pub(super) fn aligned(&self, curves: Chain) -> (Chain, bool) {
        if curves.len() < 2 {
            return (curves, false);
        }
        let (curves, ends) = self.turned(self.opened(curves));
        match self.sorted(&curves, &ends) {
            Some(order) => {
                let next = ends.iter().cycle().skip(1);
                let mut pairs = ends.iter().zip(next);
                let is_torn = pairs.any(|(own, next)| own[1].distance(next[0]) > self.accuracy);
                let curves = order.into_iter().map(|k| curves[k].clone());
                (curves.collect(), is_torn)
            }
            None => (curves, false),
        }
    }

    /// The order in which each curve begins where the one before ends, in parameters as they are, if
    /// it is another one than that of the file, and the only one.
    ///
    /// Where two seams of a surface cross, loops pass one point of space several times, and in space
    /// any curve from there can follow any that comes there.
    fn sorted(&self, curves: &[Curve<DVec2>], ends: &[[DVec3; 2]]) -> Option<Vec<usize>> {
        let count = curves.len();
        if count > SORTED {
            return None;
        }
        let follows = |k: usize, next: usize| {
            let jump = (curves[next].start() - curves[k].end()).abs();
            let jumps = |axis: usize| {
                let period = self.periods[axis].as_ref().map(|p| p.end - p.start);
                period.is_some_and(|period| jump[axis] > 0.5 * period)
            };
            ends[k][1].distance(ends[next][0]) <= self.accuracy && !jumps(0) && !jumps(1)
        };
        if (0..count).all(|k| follows(k, (k + 1) % count)) {
            return None;
        }
        let mut order = vec![0];
        while order.len() <= count {
            let last = order[order.len() - 1];
            let mut next = (0..count).filter(|&next| follows(last, next));
            match (next.next(), next.next()) {
                (Some(0), None) if order.len() == count => return Some(order),
                (Some(next), None) if next != 0 => order.push(next),
                _ => break,
            }
        }
        None
    }

    fn ends(&self, curves: &[Curve<DVec2>]) -> Vec<[DVec3; 2]> {
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

    /// Turns curves round, each only where that is clearly better; the curves and their ends.
    fn turned(&self, mut curves: Chain) -> (Chain, Vec<[DVec3; 2]>) {
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
        (curves, ends)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// The border of a torus without a bite at one of its seams, which files may begin anywhere and
    /// continue with any of the curves at the corner.
    #[test]
    fn seams_that_cross_are_taken_in_the_order_of_parameters() {
        let corners = [
            [0.0, 0.0],
            [3.0, 0.0],
            [4.0, 0.5],
            [4.5, 0.0],
            [TAU, 0.0],
            [TAU, TAU],
            [4.5, TAU],
            [3.0, TAU],
            [0.0, TAU],
        ];
        let line = |k: usize| {
            let corner = |k: usize| DVec2::from_array(corners[k % corners.len()]);
            Curve::line(corner(k), corner(k + 1), 0.0..1.0).unwrap()
        };
        let order = Order {
            point: |uv: DVec2| {
                let across = 3.0 + uv.x.cos();
                DVec3::new(across * uv.y.cos(), across * uv.y.sin(), uv.x.sin())
            },
            periods: [Some(0.0..TAU), Some(0.0..TAU)],
            near: 1e-9,
            accuracy: 1e-6,
        };
        let right = [7, 8, 0, 1, 2, 3, 4, 5, 6].map(line).to_vec();
        // At the corner, one point of space, the left side is followed by the right part of the top.
        let file = [7, 8, 5, 6, 1, 2, 3, 4, 0].map(line).to_vec();
        assert_eq!(order.aligned(file), (right.clone(), false));
        let torn = [8, 0, 1, 3, 2, 4, 5, 6, 7].map(line).to_vec();
        let sorted = [8, 0, 1, 2, 3, 4, 5, 6, 7].map(line).to_vec();
        assert_eq!(order.aligned(torn), (sorted, true));
        assert_eq!(order.aligned(right.clone()), (right, false));
    }
}
