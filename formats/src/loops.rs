//! What files get wrong about trim loops: one is there twice, a hole is the border of its surface, or
//! a loop leaves its surface.
//!
//! By the rule of odd and even two equal loops undo each other, which no file means.

use std::cell::OnceCell;
use std::ops::Range;

use glam::DVec2;
use kernel::{Error, Surface, TrimLoop};

use crate::least;

/// Loops no farther apart than this share of their domain are the same.
const SAME: f64 = 1e-9;

/// A loop no farther than this share of the domain from its border runs along that: curves laid onto
/// surfaces are no more accurate.
const ALONG: f64 = 1e-6;

/// A loop that goes farther than this share of the domain beyond it leaves the surface: curves that
/// programs fit to borders stray by less.
const BEYOND: f64 = 1e-3;

/// What is said of a loop that leaves its surface.
pub(crate) const LEAVES: &str = "the loop leaves the surface; what lies outside is cut off";

/// Loops are compared if the boxes around their control points are no farther apart than this share
/// of their size.
const BESIDE: f64 = 0.5;

/// The same for what is inside of them, as a share of the box: areas are less accurate than loops.
const ALIKE: f64 = 0.05;

/// Points looked at on each span of a curve.
const POINTS: usize = 8;

/// The least domain that holds those of all parts of a surface; `None` without parts.
pub(crate) fn domain<'a>(parts: impl IntoIterator<Item = &'a Surface>) -> Option<[Range<f64>; 2]> {
    let domains = parts
        .into_iter()
        .map(|s| [s.knots_u().domain(), s.knots_v().domain()]);
    let hull = |a: &Range<f64>, b: &Range<f64>| a.start.min(b.start)..a.end.max(b.end);
    domains.reduce(|a, b| [hull(&a[0], &b[0]), hull(&a[1], &b[1])])
}

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

/// Puts the border of the domain around holes; whether one of them was that border, and so counts as
/// no hole.
pub(crate) fn surrounded(
    holes: &mut Vec<TrimLoop>,
    domain: &[Range<f64>; 2],
) -> Result<bool, Error> {
    let before = holes.len();
    holes.retain(|hole| !is_border(hole, domain));
    let was_border = holes.len() < before;
    holes.push(TrimLoop::border(&domain[0], &domain[1])?);
    Ok(was_border)
}

/// Whether a loop goes beyond the domain of its surface, but for a seam of a `closed` one, where it
/// comes in again on the other side.
pub(crate) fn leaves(one: &TrimLoop, domain: &[Range<f64>; 2], closed: [bool; 2]) -> bool {
    let start = DVec2::from(domain.each_ref().map(|d| d.start));
    let size = DVec2::from(domain.each_ref().map(|d| d.end - d.start));
    let is_beyond = |share: DVec2| {
        (0..2).any(|axis| !closed[axis] && !(-BEYOND..=1.0 + BEYOND).contains(&share[axis]))
    };
    let outline = Outline::of(one, size);
    let corners = outline.corners.map(|corner| corner - start / size);
    // The loop is between the corners.
    corners.into_iter().any(is_beyond)
        && outline
            .points()
            .any(|point| is_beyond(point - start / size))
}

/// Whether a loop is the border of the domain.
fn is_border(one: &TrimLoop, domain: &[Range<f64>; 2]) -> bool {
    let start = DVec2::from(domain.each_ref().map(|d| d.start));
    let size = DVec2::from(domain.each_ref().map(|d| d.end - d.start));
    let is_along = |point: DVec2| {
        let share = point - start / size;
        let off = share.abs().min((DVec2::ONE - share).abs());
        let beyond = (share - share.clamp(DVec2::ZERO, DVec2::ONE)).abs();
        off.min_element() <= ALONG && beyond.max_element() <= ALONG
    };
    let outline = Outline::of(one, size);
    // What runs along it and back has no area.
    outline.points().all(is_along) && outline.area() > 0.5
}

/// A loop, and the corners of the box around its control points, as shares of the domain.
struct Outline<'a> {
    whole: &'a TrimLoop,
    size: DVec2,
    corners: [DVec2; 2],
    /// What it bounds, as a share of the domain, once it has been asked for.
    area: OnceCell<f64>,
    /// Whether it is a polygon: its box is no larger than itself.
    is_polygon: bool,
}

impl<'a> Outline<'a> {
    fn of(whole: &'a TrimLoop, size: DVec2) -> Self {
        let (low, high) = whole.hull();
        Self {
            whole,
            size,
            corners: [low / size, high / size],
            area: OnceCell::new(),
            is_polygon: whole.segments().iter().all(|c| c.knots().degree() == 1),
        }
    }

    fn area(&self) -> f64 {
        let area = || self.whole.signed_area().abs() / self.size.element_product();
        *self.area.get_or_init(area)
    }

    fn is_same(&self, other: &Self) -> bool {
        let size = self.corners[1] - self.corners[0];
        let near = if self.is_polygon && other.is_polygon {
            4.0 * SAME
        } else {
            BESIDE * size.length()
        };
        let mut corners = self.corners.iter().zip(&other.corners);
        let is_on = |a: &Self, b: &Self| a.points().all(|p| b.passes(p));
        corners.all(|(a, b)| a.distance(*b) <= near)
            && (self.area() - other.area()).abs() <= ALIKE * size.element_product()
            && is_on(other, self)
            && is_on(self, other)
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
    use kernel::Curve;

    use super::*;

    fn polygon(corners: &[[f64; 2]]) -> TrimLoop {
        let corners: Vec<DVec2> = corners.iter().map(|&c| c.into()).collect();
        let side = |pair: &[DVec2]| Curve::line(pair[0], pair[1], 0.0..1.0).unwrap();
        TrimLoop::new(corners.windows(2).map(side).collect(), 0.0).unwrap()
    }

    #[test]
    fn a_hole_that_is_the_border_counts_as_that() {
        let domain = [-1.0..1.0, 2.0..6.0];
        let [a, b, c, d] = [[-1.0, 2.0], [1.0, 2.0], [1.0, 6.0], [-1.0, 6.0]];
        let hole = polygon(&[[-0.5, 3.0], [0.5, 3.0], [0.5, 4.0], [-0.5, 3.0]]);
        let border = TrimLoop::border(&domain[0], &domain[1]).unwrap();
        for outline in [
            polygon(&[a, b, c, d, a]),
            polygon(&[c, b, a, d, c]),
            polygon(&[b, c, [0.3, 6.0], d, [-1.000_000_1, 5.0], a, b]),
        ] {
            let mut loops = vec![outline, hole.clone()];
            assert_eq!(surrounded(&mut loops, &domain), Ok(true));
            assert_eq!(loops, [hole.clone(), border.clone()]);
        }
        // Half of the border is a hole, and so is what runs along it and back.
        for other in [polygon(&[a, b, c, a]), polygon(&[a, b, c, b, a])] {
            assert_eq!(surrounded(&mut vec![other], &domain), Ok(false));
        }
    }

    #[test]
    fn a_loop_leaves_its_surface_but_not_through_a_seam() {
        let domain = [-1.0..1.0, 2.0..6.0];
        let inside = polygon(&[[-1.0, 2.0], [1.001, 2.0], [0.0, 6.0], [-1.0, 2.0]]);
        assert!(!leaves(&inside, &domain, [false; 2]));
        let across = polygon(&[[0.5, 3.0], [1.5, 3.0], [1.5, 5.0], [0.5, 3.0]]);
        assert!(leaves(&across, &domain, [false, true]));
        assert!(!leaves(&across, &domain, [true, false]));
        // Its control point is outside, but the curve is not.
        let bend = [[0.9, 3.0], [1.1, 4.0], [0.9, 5.0]].map(DVec2::from);
        let knots = kernel::KnotVector::new(2, vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0]).unwrap();
        let bend = Curve::new(knots, &bend, None).unwrap();
        let back = Curve::line(bend.end(), bend.start(), 0.0..1.0).unwrap();
        let bent = TrimLoop::new(vec![bend, back], 0.0).unwrap();
        assert!(!leaves(&bent, &domain, [false; 2]));
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
