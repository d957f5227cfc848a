//! `martin`: flattened surfaces in boxes, Newton's iteration from the middle of each
//! (W. Martin, E. Cohen, R. Fish, P. Shirley, *Practical ray tracing of trimmed NURBS surfaces*,
//! Journal of Graphics Tools 5, 2000).

use std::time::Duration;

use glam::{DVec2, DVec3};
use kernel::Ray;

use super::boxes::{Rule, Stack};
use super::flatten::Leaves;
use super::newton_map::solve;
use super::start::Starts;
use super::world::{Planes, Sheet, View, World};
use super::{Counts, Found, Job, Picture, Shot, Tracer, Variant, Weights, run};

/// Steps, at most: "more than about 7" is a miss.
const MOST_STEPS: u32 = 7;

/// The row's part in [`crate::METHODS`].
pub(crate) const PICTURE: Picture = Picture {
    weights: Weights::All,
    map: false,
    trace: |job| run::<Martin<'_>>(job),
};

/// See the module.
#[derive(Debug)]
struct Martin<'a> {
    world: &'a World,
    view: &'a View,
    starts: Starts,
}

impl<'a> Tracer<'a> for Martin<'a> {
    type Row = Stack;

    fn prepare(job: &Job<'a>, _: &mut Duration) -> Self {
        let rule = if job.has(Variant::Tree) {
            Rule::Area
        } else {
            Rule::Median
        };
        Self {
            world: job.world,
            view: job.view,
            starts: Starts::Leaves(Leaves::build(job.world, rule)),
        }
    }

    fn ray(&self, shot: &Shot, stack: &mut Stack, counts: &mut Counts) -> Option<Found> {
        let planes = planes(&shot.ray);
        self.starts
            .nearest(self.world, shot, stack, |sheet, start| {
                newton(self.world, self.view, sheet, start, &planes, counts)
            })
    }
}

/// The two planes of the paper.
pub(super) fn planes(ray: &Ray) -> Planes {
    let d = ray.direction.normalize();
    let first = if d.x.abs() > d.y.abs() && d.x.abs() > d.z.abs() {
        DVec3::new(d.y, -d.x, 0.0)
    } else {
        DVec3::new(0.0, d.z, -d.y)
    };
    let first = first.normalize();
    Planes::with_normals(ray, [first, first.cross(d)])
}

/// Newton's iteration as in the paper: a miss where the distance grows, where the parameters
/// leave the domain, or where it takes too long.
pub(super) fn newton(
    world: &World,
    view: &View,
    sheet: &Sheet,
    start: DVec2,
    planes: &Planes,
    counts: &mut Counts,
) -> Option<(DVec2, f64)> {
    counts.starts += 1;
    let (mut uv, mut before) = (start, f64::INFINITY);
    for _ in 0..=MOST_STEPS {
        let d = planes.with_derivatives(&world.derivatives(sheet, uv, counts));
        let distance = d.f.length();
        if distance <= view.accuracy(d.t) {
            counts.converged += 1;
            return Some((uv, d.t));
        }
        if distance > before {
            counts.stalled += 1;
            return None;
        }
        before = distance;
        counts.iterations += 1;
        uv = match solve(d.f, d.fu, d.fv) {
            Some(step) => uv + step,
            // The paper's random step, with a number that depends on the place alone.
            None => uv + (start - uv + sheet.size * 1e-3) * 0.1,
        };
        let share = (uv - sheet.start) / sheet.size;
        if !(share.cmpge(DVec2::ZERO).all() && share.cmple(DVec2::ONE).all()) {
            counts.stalled += 1;
            return None;
        }
    }
    counts.capped += 1;
    None
}
