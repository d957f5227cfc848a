//! Which part of a surface belongs to a face: loops in the parameter domain, and the
//! question whether a point lies inside.
//!
//! A [`TrimLoop`] is what files hold, a [`TrimRegion`] is what rays ask.

mod clip;
mod close;
mod monotone;
mod nesting;
mod parts;
mod region;
mod rings;
mod rows;
#[cfg(test)]
mod tests;

use std::ops::Range;

use glam::DVec2;

pub use close::{ClosedLoops, Orientation, close};
pub(crate) use monotone::crossings;
pub(crate) use nesting::aside;
pub use nesting::{Nest, nesting, oriented};
pub(crate) use region::shifts;
pub use region::{Cover, TrimRegion};
pub(crate) use rows::Rows;

use crate::{Curve, Error};

/// Points on each piece of a curve that is not straight for the area of a loop.
const SAMPLES: usize = 8;

/// Areas of loops below this share of that of their domain are none.
const NO_AREA: f64 = 1e-12;

/// What begins farther from the border of a domain than this share of it is inside.
const ASIDE: f64 = 1e-6;

/// Places along each side of a domain where loops without area are looked into: one may cross itself.
const LOOKS: usize = 64;

/// A closed curve in the parameter domain of a surface.
///
/// The end of each segment is the start of the next to the last bit, and the end of
/// the last is the start of the first.
#[derive(Clone, Debug, PartialEq)]
pub struct TrimLoop {
    segments: Vec<Curve<DVec2>>,
}

impl TrimLoop {
    /// Joins curves end to end into a loop.
    ///
    /// Gaps up to `tolerance`, in parameter units, are bridged by straight segments.
    ///
    /// # Errors
    /// If there are no curves, or a gap is larger, or the tolerance is not a number.
    pub fn new(curves: Vec<Curve<DVec2>>, tolerance: f64) -> Result<Self, Error> {
        let starts: Vec<_> = curves.iter().map(Curve::start).collect();
        let Some(&first) = starts.first() else {
            return Err(Error::EmptyLoop);
        };
        let mut segments = Vec::new();
        for (index, curve) in curves.into_iter().enumerate() {
            let end = curve.end();
            let next = starts.get(index + 1).copied().unwrap_or(first);
            segments.push(curve);
            let gap = end.distance(next);
            // No gap passes a tolerance that is not a number.
            let bridged = gap <= tolerance;
            if !bridged {
                return Err(Error::LoopGap {
                    index,
                    gap,
                    allowed: tolerance,
                });
            }
            if end != next {
                segments.push(Curve::line(end, next, 0.0..1.0)?);
            }
        }
        Ok(Self { segments })
    }

    /// The border of a domain, counter-clockwise: what surrounds holes that nothing else does.
    ///
    /// # Errors
    /// If a number is not finite.
    pub fn border(u: &Range<f64>, v: &Range<f64>) -> Result<Self, Error> {
        let corners = [
            DVec2::new(u.start, v.start),
            DVec2::new(u.end, v.start),
            DVec2::new(u.end, v.end),
            DVec2::new(u.start, v.end),
            DVec2::new(u.start, v.start),
        ];
        Self::new(vec![Curve::polyline(&corners)?], 0.0)
    }

    /// The same loop run through backwards.
    #[must_use]
    pub fn reversed(&self) -> Self {
        let segments = self.segments.iter().rev().map(Curve::reversed).collect();
        Self { segments }
    }

    /// The area inside, about, by points on every curved piece; positive if the loop runs
    /// counter-clockwise.
    pub fn signed_area(&self) -> f64 {
        self.area(|_| SAMPLES)
    }

    /// The same by so many points on each piece of a curve of a number of pieces.
    fn area(&self, samples: impl Fn(usize) -> usize) -> f64 {
        let mut points: Vec<DVec2> = Vec::new();
        for curve in &self.segments {
            let breaks = curve.knots().breaks();
            let count = if is_straight(curve) {
                1
            } else {
                samples(breaks.len() - 1)
            };
            for piece in breaks.windows(2) {
                let step = (piece[1] - piece[0]) / count as f64;
                points.extend((0..count).map(|i| curve.evaluate(piece[0] + step * i as f64)));
            }
        }
        let Some(&first) = points.first() else {
            return 0.0;
        };
        let corners = points.windows(2);
        0.5 * corners
            .map(|w| (w[0] - first).perp_dot(w[1] - first))
            .sum::<f64>()
    }

    /// Makes sure that the loops of a face bound some part of its domain: a seam that is run along
    /// and back does not, nor does what lies outside. Where the surface is `closed`, loops come in
    /// again on the other side.
    ///
    /// # Errors
    /// If there are loops, and nothing of the domain is inside them.
    pub fn check_inside(
        loops: &[Self],
        u: &Range<f64>,
        v: &Range<f64>,
        closed: [bool; 2],
    ) -> Result<(), Error> {
        let (min, max) = (DVec2::new(u.start, v.start), DVec2::new(u.end, v.end));
        let size = max - min;
        let is_flat = |l: &Self| l.signed_area().abs() <= NO_AREA * size.x * size.y;
        let begins_inside = |curve: &Curve<DVec2>| {
            let share = (curve.start() - min) / size;
            share.min_element() > ASIDE && share.max_element() < 1.0 - ASIDE
        };
        let reaches_in = |l: &Self| l.segments.iter().any(begins_inside) && !is_flat(l);
        // One that runs around twice has nothing inside.
        let is_within = |l: &Self| {
            let (low, high) = l.hull();
            let near = size * ASIDE;
            let most = (high - low + near).element_product();
            let is_inside = low.cmpge(min - near).all() && high.cmple(max + near).all();
            // Of many pieces fewer points tell as much.
            let area = || l.area(|pieces| if pieces < SAMPLES { SAMPLES } else { 2 });
            is_inside && (NO_AREA * size.x * size.y..=most).contains(&area().abs())
        };
        let is_alone_within = matches!(loops, [one] if is_within(one));
        if loops.is_empty() || is_alone_within || loops.iter().any(reaches_in) {
            return Ok(());
        }
        let of = |loops: &[Self]| TrimRegion::periodic(loops, [u.clone(), v.clone()], closed);
        let region = of(loops);
        if region.is_empty() {
            let is_outside = |l: &Self| {
                let (low, high) = l.hull();
                let is_beside = low.cmpge(max).any() || high.cmple(min).any();
                is_beside && !is_flat(l) && of(std::slice::from_ref(l)).is_empty()
            };
            if !loops.iter().all(is_outside) {
                return Err(Error::NothingInside);
            }
            let nothing = (DVec2::INFINITY, DVec2::NEG_INFINITY);
            let hulls = loops.iter().map(Self::hull);
            let (low, high) = hulls.fold(nothing, |(a, b), (c, d)| (a.min(c), b.max(d)));
            return Err(Error::LoopsOutside {
                found: [low, high].map(Into::into),
                domain: [min, max].map(Into::into),
            });
        }
        if !loops.iter().all(is_flat) {
            return Ok(());
        }
        let place = |k: usize| {
            let share = DVec2::new((k % LOOKS) as f64, (k / LOOKS) as f64) + 0.5;
            min + size * share / LOOKS as f64
        };
        let is_inside = |k: usize| region.contains(place(k));
        if (0..LOOKS * LOOKS).any(is_inside) {
            return Ok(());
        }
        Err(Error::NothingInside)
    }

    /// Whether something lies inside: not where its curves only run there and back.
    pub fn has_inside(&self) -> bool {
        let (min, max) = self.hull();
        let size = max - min;
        if self.signed_area().abs() > NO_AREA * size.x * size.y {
            return true;
        }
        // Parts that are run around in opposite directions may weigh each other out.
        if size.cmple(DVec2::ZERO).any() {
            return false;
        }
        let region = TrimRegion::new(std::slice::from_ref(self), min.x..max.x, min.y..max.y);
        self.segments.iter().any(|curve| {
            curve.knots().breaks().windows(2).any(|span| {
                let (point, left) = aside(curve, span[0].midpoint(span[1]), size);
                region.contains(point + left) != region.contains(point - left)
            })
        })
    }

    /// The parts of the loop over a range of u (`axis` 0) or v (1), each closed along the border of
    /// the range. What lies in the range stays as it is.
    ///
    /// # Errors
    /// If a number is not finite.
    pub fn clipped(&self, axis: usize, range: Range<f64>) -> Result<Vec<Self>, Error> {
        clip::clipped(self.clone(), axis, range)
    }

    /// The corners of a box around the control points, and so around the loop.
    pub fn hull(&self) -> (DVec2, DVec2) {
        close::hull(&self.segments)
    }

    /// The curves of the loop in order.
    pub fn segments(&self) -> &[Curve<DVec2>] {
        &self.segments
    }
}

/// Whether the pieces of a curve plainly are straight lines, perhaps run along to and fro.
fn is_straight(curve: &Curve<DVec2>) -> bool {
    let first = curve.start();
    let is_along = |axis: usize| curve.points().all(|p| (p[axis] - first[axis]).abs() <= 0.0);
    curve.degree() == 1 || is_along(0) || is_along(1)
}
