//! `nishita`: Bézier clipping (T. Nishita, T. Sederberg, M. Kakimoto, *Ray tracing trimmed
//! rational surface patches*, SIGGRAPH 1990).

use std::time::Duration;

use super::clip::{Clipper, Room, Rules};
use super::{Counts, Found, Job, Picture, Shot, Tracer, Weights, run};

/// The row's part in [`crate::METHODS`].
pub(crate) const PICTURE: Picture = Picture {
    weights: Weights::All,
    map: false,
    trace: |job| run::<Clipping<'_, false>>(job),
};

/// The clipping of all pieces that a ray passes; `REPAIRED` is that of 2005.
#[derive(Debug)]
pub(super) struct Clipping<'a, const REPAIRED: bool>(Clipper<'a>);

impl<'a, const REPAIRED: bool> Tracer<'a> for Clipping<'a, REPAIRED> {
    type Row = Room;

    fn prepare(job: &Job<'a>, _: &mut Duration) -> Self {
        let rules = if REPAIRED {
            Rules::EFREMOV
        } else {
            Rules::NISHITA
        };
        Self(Clipper::new(job.world, job.view, rules))
    }

    fn ray(&self, shot: &Shot, room: &mut Room, counts: &mut Counts) -> Option<Found> {
        let found = self.0.nearest(shot, f64::INFINITY, |_| false, room, counts);
        found.map(|(found, _)| found)
    }
}
