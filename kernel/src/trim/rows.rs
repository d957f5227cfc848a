//! Where loops pass rows of equal v, for loops that cross each other or themselves.

use glam::DVec2;

use super::TrimLoop;
use super::monotone::{Rect, Segment, Segments};
use super::region::segments;

/// Rows that are looked at: so many at equal steps, and no more between ends of segments.
const EVEN: usize = 32;
const BETWEEN: usize = 64;

/// Lengths of rows that differ by less than this share of the width of the domain are equal.
const EQUAL: f64 = 1e-7;

/// The segments of loops, with the way they run.
#[derive(Clone, Debug)]
pub(crate) struct Rows {
    segments: Segments,
    domain: Rect,
    /// Heights of the ends of segments inside the domain, and those of knots, in order.
    heights: Vec<f64>,
}

impl Rows {
    /// The rows of loops in a domain from its lower to its upper corner, on a surface that may be
    /// closed and has these knots along v.
    pub(crate) fn new(
        loops: &[TrimLoop],
        [min, max]: [DVec2; 2],
        closed: [bool; 2],
        knots: &[f64],
    ) -> Self {
        let domain = Rect { min, max };
        let segments = segments(loops, &domain, closed);
        let ends = segments.list.iter().flat_map(|s| [s.low.y, s.high.y]);
        let inside = ends.filter(|y| min.y < *y && *y < max.y);
        let mut heights: Vec<f64> = inside.chain(knots.iter().copied()).collect();
        heights.sort_by(f64::total_cmp);
        heights.dedup();
        Self {
            segments,
            domain,
            heights,
        }
    }

    /// Whether loops, outer ones to the left and holes to the right, have to their left what is
    /// inside an odd number of them, as far as some rows show: those that cross each other do not.
    pub(crate) fn are_apart(&self) -> bool {
        let [low, high] = [self.domain.min.y, self.domain.max.y];
        let even = (0..EVEN).map(|k| low + (high - low) * (k as f64 + 0.5) / EVEN as f64);
        let step = self.heights.len().div_ceil(BETWEEN);
        let pairs = self.heights.windows(2).step_by(step);
        let mut rows = even.chain(pairs.map(|pair| pair[0].midpoint(pair[1])));
        let all: Vec<u32> = (0_u32..).zip(&self.segments.list).map(|(k, _)| k).collect();
        let near = EQUAL * (self.domain.max.x - self.domain.min.x);
        rows.all(|v| {
            let passes = self.passes(&all, v);
            let to_the_left = passes.iter().map(|(u, rises)| if *rises { *u } else { -u });
            let (pairs, _) = passes.as_chunks();
            let odd = pairs.iter().map(|[(from, _), (to, _)]| to - from);
            (to_the_left.sum::<f64>() - odd.sum::<f64>()).abs() <= near
        })
    }

    /// The ranges of heights in which no segment ends, from below, with the segments that reach into
    /// them.
    pub(crate) fn ranges(&self) -> impl Iterator<Item = ([f64; 2], Vec<u32>)> {
        let list = &self.segments.list;
        let mut coming: Vec<u32> = (0_u32..).zip(list).map(|(k, _)| k).collect();
        coming.sort_by(|a, b| list[*b as usize].low.y.total_cmp(&list[*a as usize].low.y));
        let mut met: Vec<u32> = Vec::new();
        self.heights.windows(2).map(move |pair| {
            while let Some(k) = coming.pop_if(|k| list[*k as usize].low.y < pair[1]) {
                met.push(k);
            }
            met.retain(|&k| list[k as usize].high.y > pair[0]);
            ([pair[0], pair[1]], met.clone())
        })
    }

    /// What of a row is inside an odd number of loops, by segments that reach its height.
    pub(crate) fn inside(&self, segments: &[u32], v: f64) -> Vec<[f64; 2]> {
        let passes = self.passes(segments, v);
        let (pairs, _) = passes.as_chunks();
        pairs
            .iter()
            .map(|[(from, _), (to, _)]| [*from, *to])
            .collect()
    }

    /// Where segments pass a row in the domain, in order, and whether their loops rise there.
    fn passes(&self, segments: &[u32], v: f64) -> Vec<(f64, bool)> {
        let coefficients = self.segments.coefficients();
        let [left, right] = [self.domain.min.x, self.domain.max.x];
        let met = segments.iter().map(|&k| &self.segments.list[k as usize]);
        let met = met.filter(|s| s.low.y <= v && v < s.high.y);
        let place = |s: &Segment| (s.place(coefficients, v).clamp(left, right), s.rises());
        let mut passes: Vec<(f64, bool)> = met.map(place).collect();
        passes.sort_by(|a, b| a.0.total_cmp(&b.0));
        passes
    }
}
