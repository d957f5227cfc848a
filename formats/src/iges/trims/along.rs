//! Whether curves of the parameter domain run along curves of space.

use std::cell::OnceCell;
use std::ops::Range;

use glam::{DVec2, DVec3};

use super::flat::elsewhere;
use super::laid::POINT;
use super::{ACCURACY, Trimmer};
use crate::Problem;
use crate::iges::curves::Rail;
use crate::iges::order::Chain;

/// Shares of a curve where it is held against others.
const PLACES: [f64; 3] = [0.0, 0.3, 0.7];

/// As a curve of the parameter domain is in so many of its spans at most.
const SPANS: usize = 32;

/// Each span of a path is looked at in so many parts.
const PARTS: u8 = 8;

/// A point is looked for on so many parts, the nearest first.
const TRIES: usize = 4;

/// So many parts are looked at in the time in which a control point is mixed.
const LOOKED_AT: usize = 16;

/// Steps towards it on each.
const STEPS: usize = 8;

/// A tangent is taken between points so far apart, as a share of a part.
const DIFFERENCE: f64 = 1e-4;

impl Trimmer<'_> {
    /// Makes sure that curves run where those of space do, but for parts along seams and poles, which
    /// those need not have.
    pub(super) fn check_along(&self, curves: &Chain, rails: &[Rail]) -> Result<(), Problem> {
        let flat = Path::new(
            curves.iter().map(|c| c.knots().breaks()),
            |k: usize, t: f64| self.point(curves[k].evaluate(t)),
        );
        let space = Path::new(
            rails.iter().map(|r| r.curve.knots().breaks()),
            |k: usize, t: f64| rails[k].curve.evaluate(t),
        );
        let of_space = |rail: &Rail| {
            let mut points = places(rail.curve.domain()).map(|t| rail.curve.evaluate(t));
            points.all(|point| self.meets(&flat, point, self.accuracy))
        };
        let of_domain = |curve: &kernel::Curve<DVec2>| {
            let mut points = places(curve.domain()).map(|t| curve.evaluate(t));
            points
                .all(|uv| self.is_on_seam(uv) || self.meets(&space, self.point(uv), self.accuracy))
        };
        if rails.iter().all(of_space) && curves.iter().all(of_domain) {
            Ok(())
        } else {
            Err(elsewhere())
        }
    }

    /// Whether a curve runs between its ends farther than that beside a curve of space.
    pub(super) fn is_beside(&self, curve: &kernel::Curve<DVec2>, rail: &Rail, most: f64) -> bool {
        let breaks = curve.knots().breaks();
        let spans = breaks.windows(2).step_by(breaks.len().div_ceil(SPANS));
        let mut places = spans.flat_map(|span| places(span[0]..span[1]).skip(1));
        let (own, other) = (curve.domain(), rail.curve.domain());
        let path = OnceCell::new();
        let path = || {
            let breaks = || [rail.curve.knots().breaks()].into_iter();
            path.get_or_init(|| Path::new(breaks(), |_, t| rail.curve.evaluate(t)))
        };
        places.any(|t| {
            let uv = curve.evaluate(t);
            if self.is_on_seam(uv) {
                return false;
            }
            self.spend(POINT);
            let point = self.point(uv);
            // Most are at the same share of both curves, or of one of them turned.
            let share = (t - own.start) / (own.end - own.start);
            let mut shares = [share, 1.0 - share].into_iter();
            let is_near = |share: f64| {
                let t = other.start + (other.end - other.start) * share;
                rail.curve.evaluate(t).distance(point) <= most
            };
            !shares.any(is_near) && !self.meets(path(), point, most) && self.left.get() > 0
        })
    }

    /// Whether a path comes so near to a point, as long as there is work left to find out.
    fn meets<F: Fn(usize, f64) -> DVec3>(
        &self,
        path: &Path<F>,
        point: DVec3,
        accuracy: f64,
    ) -> bool {
        self.spend(POINT + path.parts.len() / LOOKED_AT);
        self.left.get() > 0 && path.passes(point, accuracy)
    }

    /// Whether a place is on a seam of the surface or at a pole.
    fn is_on_seam(&self, uv: DVec2) -> bool {
        let at_seam = |axis: usize| {
            let Range { start, end } = self.domain[axis];
            let turns = (uv[axis] - start) / (end - start);
            self.closed[axis] && (turns - turns.round()).abs() <= ACCURACY
        };
        let at_pole = |pole: &DVec3| pole.distance(self.point(uv)) <= self.accuracy;
        at_seam(0) || at_seam(1) || self.poles.iter().any(at_pole)
    }
}

/// Parameters along a curve.
fn places(domain: Range<f64>) -> impl Iterator<Item = f64> {
    let Range { start, end } = domain;
    PLACES
        .into_iter()
        .map(move |share| start + (end - start) * share)
}

/// Curves one after the other, in parts.
struct Path<F> {
    at: F,
    parts: Vec<Part>,
}

struct Part {
    curve: usize,
    /// What of the domain of the curve is looked at.
    around: [f64; 2],
    middle: DVec3,
    /// How far that is about from the middle.
    reach: f64,
}

impl<F: Fn(usize, f64) -> DVec3> Path<F> {
    /// Curves by their breaks, and by where each is at a parameter.
    fn new(curves: impl Iterator<Item = Vec<f64>>, at: F) -> Self {
        let mut parts = Vec::new();
        for (curve, breaks) in curves.enumerate() {
            for span in breaks.windows(2) {
                let step = (span[1] - span[0]) / f64::from(PARTS);
                parts.extend((0..PARTS).map(|k| {
                    let middle = span[0] + step * (f64::from(k) + 0.5);
                    let around = [middle - step, middle + step];
                    let around = around.map(|t| t.clamp(span[0], span[1]));
                    let (middle, ends) = (at(curve, middle), around.map(|t| at(curve, t)));
                    let reach = ends.map(|end| end.distance(middle));
                    Part {
                        curve,
                        around,
                        middle,
                        reach: reach[0].max(reach[1]),
                    }
                }));
            }
        }
        Self { at, parts }
    }

    /// Whether it comes so near to a point.
    fn passes(&self, point: DVec3, accuracy: f64) -> bool {
        // Spans may be of very different lengths.
        let off = |part: &Part| part.middle.distance(point) - part.reach;
        let mut nearest: Vec<_> = self.parts.iter().map(|part| (off(part), part)).collect();
        let tries = TRIES.min(nearest.len());
        if tries < nearest.len() {
            nearest.select_nth_unstable_by(tries, |a, b| a.0.total_cmp(&b.0));
            nearest.truncate(tries);
        }
        nearest.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut nearest = nearest.into_iter();
        nearest.any(|(_, part)| self.part_passes(part, point, accuracy))
    }

    /// Whether a part of it does, by Gauss's and Newton's iteration from its middle.
    fn part_passes(&self, part: &Part, point: DVec3, accuracy: f64) -> bool {
        let [first, last] = part.around;
        let step = (last - first) * DIFFERENCE;
        let mut t = f64::midpoint(first, last);
        for _ in 0..STEPS {
            let at = (self.at)(part.curve, t);
            if at.distance(point) <= accuracy {
                return true;
            }
            // Towards the middle, where there is room.
            let step = if t > f64::midpoint(first, last) {
                -step
            } else {
                step
            };
            let along = ((self.at)(part.curve, t + step) - at) / step;
            let next = t + (point - at).dot(along) / along.length_squared();
            if !next.is_finite() {
                return false;
            }
            t = next.clamp(first, last);
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_found_in_a_long_span_beside_many_short_ones() {
        let breaks: Vec<f64> = (0..40).map(|k| f64::from(k) * 1e-3).chain([1.0]).collect();
        let path = Path::new([breaks].into_iter(), |_, t| DVec3::new(t, t * t, 0.0));
        for t in [0.0, 0.0385, 0.04, 0.05, 0.9] {
            assert!(path.passes(DVec3::new(t, t * t, 1e-4), 1.1e-4), "{t}");
        }
        assert!(!path.passes(DVec3::new(0.05, 0.0125, 0.0), 1e-4));
    }
}
