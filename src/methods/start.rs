//! Where iterations begin: at what a preliminary map tells of the pixel, or in the middles of
//! the boxes that the ray passes.

use std::time::Duration;

use glam::DVec2;

use super::boxes::{Rule, Stack};
use super::flatten::Leaves;
use super::map::{ByteMap, WideMap};
use super::world::{Sheet, World};
use super::{Found, Job, Shot, Stopwatch, Variant};

/// The starts of all pixels.
#[derive(Debug)]
pub(super) enum Starts {
    Byte(ByteMap),
    Wide(WideMap),
    Leaves(Leaves),
}

impl Starts {
    /// The map that the variants of a job ask for, or boxes.
    pub(super) fn of_map(job: &Job<'_>, map: &mut Duration) -> Self {
        if job.has(Variant::Tree) {
            return Self::Leaves(Leaves::build(job.world, Rule::Area));
        }
        let started = Stopwatch::start();
        let starts = if job.has(Variant::Map8) {
            Self::Byte(ByteMap::draw(job.world, job.view))
        } else {
            Self::Wide(WideMap::draw(job.world, job.view))
        };
        *map += started.elapsed();
        starts
    }

    /// Goes on from every start that may lead to the first root of a ray. `solve` gives the
    /// parameters and the ray parameter of a root.
    pub(super) fn nearest(
        &self,
        world: &World,
        shot: &Shot,
        stack: &mut Stack,
        mut solve: impl FnMut(&Sheet, DVec2) -> Option<(DVec2, f64)>,
    ) -> Option<Found> {
        let mut best: Option<Found> = None;
        let mut attempt = |sheet: &Sheet, start, end: f64| {
            let found = solve(sheet, start)
                .filter(|&(uv, t)| t >= 0.0 && t < end && world.keeps(sheet, uv));
            if let Some((uv, t)) = found {
                let shape = sheet.number;
                best = Some(Found { t, uv, shape });
            }
            found.map_or(end, |(_, t)| t)
        };
        match self {
            Self::Byte(map) => {
                if let Some((sheet, share)) = map.start(shot.x, shot.y) {
                    let sheet = world.sheet(sheet);
                    attempt(sheet, sheet.at(share), f64::INFINITY);
                }
            }
            Self::Wide(map) => {
                let mut end = f64::INFINITY;
                for start in map.starts(shot.x, shot.y) {
                    if f64::from(start.near) > end {
                        break;
                    }
                    let sheet = world.sheet(start.sheet);
                    end = attempt(sheet, sheet.at(start.share.as_dvec2()), end);
                }
            }
            Self::Leaves(leaves) => {
                let mut range = 0.0..f64::INFINITY;
                leaves
                    .boxes
                    .visit(&shot.ray, &mut range, stack, |part, range| {
                        let part = &leaves.parts[part as usize];
                        range.end = attempt(world.sheet(part.sheet), part.middle, range.end);
                    });
            }
        }
        best
    }
}
