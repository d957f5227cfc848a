//! Roots as the minima of the squared distance from the ray (equations 2 to 4).

use glam::DVec2;

use super::world::{Planes, Sheet, View, World};
use super::{Counts, Job, LITERAL_RESIDUAL, Variant};

/// The step is shortened by this much where the distance grows (equation 13 of the paper on
/// B-splines): the golden section.
const GOLDEN: f64 = 0.618;

/// Steps of an iteration, at most.
const MOST_STEPS: u32 = 200;

/// Steps shorter than this share of the domain end an iteration.
const SHORTEST: f64 = 1e-9;

/// Points further outside than this share of the domain end an iteration; others are brought
/// back to its border.
const OUTSIDE: f64 = 0.05;

/// The first step as printed: the seeds name none for the gradient, this is ours.
const LITERAL_STEP: f64 = 0.1;

/// How directions are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Descent {
    /// The gradient in every point (equation 4).
    Gradient,
    /// The same direction as long as the distance falls.
    Reused,
}

/// A way down to a root.
#[derive(Clone, Copy, Debug)]
pub(super) struct Minimiser<'a> {
    pub(super) world: &'a World,
    pub(super) view: &'a View,
    descent: Descent,
    is_literal: bool,
}

/// A point on the way, as a share of the domain.
#[derive(Clone, Copy, Debug)]
struct Point {
    at: DVec2,
    square: f64,
    t: f64,
}

impl<'a> Minimiser<'a> {
    pub(super) fn new(job: &Job<'a>, descent: Descent) -> Self {
        Self {
            world: job.world,
            view: job.view,
            descent,
            is_literal: job.has(Variant::SeedLiteral),
        }
    }

    /// A root and its ray parameter, from `start` on.
    pub(super) fn root(
        &self,
        sheet: &Sheet,
        start: DVec2,
        planes: &Planes,
        counts: &mut Counts,
    ) -> Option<(DVec2, f64)> {
        counts.starts += 1;
        let at = (start - sheet.start) / sheet.size;
        let found = if self.is_literal && self.descent == Descent::Reused {
            self.as_printed(sheet, at, planes, counts)
        } else {
            self.descend(sheet, at, planes, counts)
        };
        found.map(|point| (sheet.at(point.at), point.t))
    }

    /// Steps down until the distance is small enough.
    fn descend(
        &self,
        sheet: &Sheet,
        at: DVec2,
        planes: &Planes,
        counts: &mut Counts,
    ) -> Option<Point> {
        let (mut here, mut gradient, trace) = self.with_gradient(sheet, at, planes, counts);
        // Below the inverse of the largest eigenvalue of the Gauss-Newton matrix.
        let mut step = if self.is_literal {
            LITERAL_STEP
        } else {
            0.5 / trace
        };
        for _ in 0..MOST_STEPS {
            if here.square <= self.residual(here.t) {
                counts.converged += 1;
                return Some(here);
            }
            counts.iterations += 1;
            let Some(next) = inside(here.at - gradient * step) else {
                counts.stalled += 1;
                return None;
            };
            let (there, steeper) = match self.descent {
                Descent::Gradient => {
                    let (there, gradient, _) = self.with_gradient(sheet, next, planes, counts);
                    (there, Some(gradient))
                }
                Descent::Reused => (self.point(sheet, next, planes, counts), None),
            };
            if there.square < here.square {
                here = there;
                gradient = steeper.unwrap_or(gradient);
                continue;
            }
            step *= GOLDEN;
            if self.descent == Descent::Reused {
                (_, gradient, _) = self.with_gradient(sheet, here.at, planes, counts);
            }
            // As a comparison that is false for what is not a number.
            let moves = step * gradient.abs().max_element() >= SHORTEST;
            if !moves {
                counts.stalled += 1;
                return None;
            }
        }
        counts.capped += 1;
        None
    }

    /// The pseudocode of the paper on B-splines without a factor for the step.
    fn as_printed(
        &self,
        sheet: &Sheet,
        at: DVec2,
        planes: &Planes,
        counts: &mut Counts,
    ) -> Option<Point> {
        let (mut here, mut gradient, _) = self.with_gradient(sheet, at, planes, counts);
        let mut before = here.square;
        for _ in 0..MOST_STEPS {
            counts.iterations += 1;
            let Some(next) = inside(here.at - gradient) else {
                counts.stalled += 1;
                return None;
            };
            let there = self.point(sheet, next, planes, counts);
            if there.square <= LITERAL_RESIDUAL {
                counts.converged += 1;
                return Some(there);
            }
            if there.square >= before {
                (_, gradient, _) = self.with_gradient(sheet, here.at, planes, counts);
            } else {
                here = there;
            }
            before = there.square;
        }
        counts.capped += 1;
        None
    }

    /// The squared distance from which on a point is a root.
    fn residual(&self, t: f64) -> f64 {
        if self.is_literal {
            LITERAL_RESIDUAL
        } else {
            self.view.accuracy(t).powi(2)
        }
    }

    /// The squared distance of a point (equation 2).
    pub(super) fn square(
        &self,
        sheet: &Sheet,
        at: DVec2,
        planes: &Planes,
        counts: &mut Counts,
    ) -> f64 {
        self.point(sheet, at, planes, counts).square
    }

    fn point(&self, sheet: &Sheet, at: DVec2, planes: &Planes, counts: &mut Counts) -> Point {
        let h = self.world.value(sheet, sheet.at(at), counts);
        Point {
            at,
            square: planes.distances(&h).length_squared(),
            t: planes.time(&h),
        }
    }

    /// A point with its gradient by shares of the domain, and the sum of the squares of the
    /// projected tangents.
    fn with_gradient(
        &self,
        sheet: &Sheet,
        at: DVec2,
        planes: &Planes,
        counts: &mut Counts,
    ) -> (Point, DVec2, f64) {
        let d = planes.with_derivatives(&self.world.derivatives(sheet, sheet.at(at), counts));
        let point = Point {
            at,
            square: d.f.length_squared(),
            t: d.t,
        };
        let (fu, fv) = (d.fu * sheet.size.x, d.fv * sheet.size.y);
        let gradient = DVec2::new(d.f.dot(fu), d.f.dot(fv)) * 2.0;
        (point, gradient, fu.length_squared() + fv.length_squared())
    }
}

/// A point brought back to the domain, unless it is too far outside.
pub(super) fn inside(at: DVec2) -> Option<DVec2> {
    let near =
        at.cmpge(DVec2::splat(-OUTSIDE)).all() && at.cmple(DVec2::splat(1.0 + OUTSIDE)).all();
    near.then(|| at.clamp(DVec2::ZERO, DVec2::ONE))
}
