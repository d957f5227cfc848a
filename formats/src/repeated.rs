//! Trim loops that a file has twice: a hole that is the outline again, or is there again.
//!
//! By the rule of odd and even two equal loops undo each other, which no file means.

use std::ops::Range;

use glam::DVec2;
use kernel::{Curve, TrimLoop};

use crate::least;

/// Loops no farther apart than this share of their domain are the same.
const SAME: f64 = 1e-9;

/// Loops are compared if the boxes around their control points are no farther apart than this share
/// of their size.
const BESIDE: f64 = 0.5;

/// Points looked at on each span of a curve.
const POINTS: usize = 8;

/// Leaves each loop once; whether any was there again.
pub(crate) fn removed(loops: &mut Vec<TrimLoop>, domain: &[Range<f64>; 2]) -> bool {
    if loops.len() < 2 {
        return false;
    }
    let size = DVec2::from(domain.each_ref().map(|d| d.end - d.start));
    let outlines: Vec<_> = loops.iter().map(|one| Outline::of(one, size)).collect();
    let is_again = |k: usize| outlines[..k].iter().any(|o| o.is_same(&outlines[k]));
    let again: Vec<bool> = (0..loops.len()).map(is_again).collect();
    let mut each = again.iter();
    loops.retain(|_| each.next() == Some(&false));
    again.contains(&true)
}

/// A loop, and the corners of the box around its control points, as shares of the domain.
struct Outline<'a> {
    whole: &'a TrimLoop,
    size: DVec2,
    corners: [DVec2; 2],
}

impl<'a> Outline<'a> {
    fn of(whole: &'a TrimLoop, size: DVec2) -> Self {
        let points = || whole.segments().iter().flat_map(Curve::points);
        let low = points().fold(DVec2::INFINITY, DVec2::min);
        let high = points().fold(DVec2::NEG_INFINITY, DVec2::max);
        Self {
            whole,
            size,
            corners: [low / size, high / size],
        }
    }

    fn is_same(&self, other: &Self) -> bool {
        let near = BESIDE * self.corners[0].distance(self.corners[1]);
        let mut corners = self.corners.iter().zip(&other.corners);
        let is_on = |a: &Self, b: &Self| a.points().all(|p| b.passes(p));
        corners.all(|(a, b)| a.distance(*b) <= near) && is_on(other, self) && is_on(self, other)
    }

    /// Points on the loop.
    fn points(&self) -> impl Iterator<Item = DVec2> {
        self.whole.segments().iter().flat_map(move |curve| {
            let breaks = curve.knots().breaks();
            let spans: Vec<_> = breaks.windows(2).map(|w| (w[0], w[1] - w[0])).collect();
            let share = |k: usize| k as f64 / POINTS as f64;
            spans.into_iter().flat_map(move |(start, length)| {
                let point = move |k| curve.evaluate(start + length * share(k)) / self.size;
                (0..POINTS).map(point)
            })
        })
    }

    /// Whether the loop passes through a point.
    fn passes(&self, point: DVec2) -> bool {
        self.whole.segments().iter().any(|curve| {
            let off = |t: f64| (curve.evaluate(t) / self.size).distance(point);
            least::least(&curve.knots().breaks(), off).1 <= SAME
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(corners: &[[f64; 2]]) -> TrimLoop {
        let corners: Vec<DVec2> = corners.iter().map(|&c| c.into()).collect();
        let side = |pair: &[DVec2]| Curve::line(pair[0], pair[1], 0.0..1.0).unwrap();
        TrimLoop::new(corners.windows(2).map(side).collect(), 0.0).unwrap()
    }

    #[test]
    fn loops_are_the_same_wherever_they_begin_and_whichever_way_they_run() {
        let domain = [0.0..1.0, 0.0..4.0];
        let [a, b, c, d] = [[0.1, 0.1], [0.9, 0.1], [0.9, 3.0], [0.1, 3.0]];
        let inside = polygon(&[[0.2, 0.2], [0.8, 0.2], [0.8, 2.9], [0.2, 0.2]]);
        let outline = || polygon(&[a, b, c, d, a]);
        let middle = [0.9, 1.5];
        for again in [
            outline(),
            outline().reversed(),
            polygon(&[c, d, a, b, middle, c]),
        ] {
            let mut loops = vec![outline(), inside.clone(), again];
            assert!(removed(&mut loops, &domain));
            assert_eq!(loops, [outline(), inside.clone()]);
        }
        let near = polygon(&[a, b, [0.9, 3.0001], d, a]);
        let mut loops = vec![outline(), near, inside];
        assert!(!removed(&mut loops, &domain));
        assert_eq!(loops.len(), 3);
    }
}
