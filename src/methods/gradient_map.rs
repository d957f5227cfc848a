//! `gradient-map`: starts from the preliminary map, goes on along the gradient.

use std::time::Duration;

use super::boxes::Stack;
use super::minimise::{Descent, Minimiser};
use super::start::Starts;
use super::world::Planes;
use super::{Counts, Found, Job, Picture, Shot, Tracer, Weights, run};

/// The row's part in [`crate::METHODS`].
pub(crate) const PICTURE: Picture = Picture {
    weights: Weights::One,
    map: true,
    trace: |job| run::<FromMap<'_, GRADIENT>>(job),
};

const GRADIENT: bool = true;

/// A minimiser with its starts; `GRADIENT` tells whether every point has a gradient of its own.
#[derive(Debug)]
pub(super) struct FromMap<'a, const GRADIENT: bool> {
    minimiser: Minimiser<'a>,
    starts: Starts,
}

impl<'a, const GRADIENT: bool> Tracer<'a> for FromMap<'a, GRADIENT> {
    type Row = Stack;

    fn prepare(job: &Job<'a>, map: &mut Duration) -> Self {
        let descent = if GRADIENT {
            Descent::Gradient
        } else {
            Descent::Reused
        };
        Self {
            minimiser: Minimiser::new(job, descent),
            starts: Starts::of_map(job, map),
        }
    }

    fn ray(&self, shot: &Shot, stack: &mut Stack, counts: &mut Counts) -> Option<Found> {
        let planes = Planes::of(&shot.ray);
        let minimiser = &self.minimiser;
        self.starts
            .nearest(minimiser.world, shot, stack, |sheet, start| {
                minimiser.root(sheet, start, &planes, counts)
            })
    }
}
