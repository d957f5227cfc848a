//! `gradient-mc`: random points of each piece, the best of them improved along the gradient.

use std::time::Duration;

use glam::DVec2;
use kernel::Aabb;

use super::boxes::{Boxes, Rule, Stack};
use super::minimise::{Descent, Minimiser};
use super::world::Planes;
use super::{Counts, Found, Job, Picture, Shot, Tracer, Weights, run};
use crate::random;

/// Random points of a piece. The seeds name no number.
const POINTS: u64 = 256;

/// Points are improved if their distance from the ray is that of the best and this part of the
/// piece's size. The seeds name no number.
const SLACK: f64 = 1.0 / 16.0;

/// Roots nearer to each other in the parameters, as a share of the domain, are one.
const SAME: f64 = 1e-4;

/// The row's part in [`crate::METHODS`].
pub(crate) const PICTURE: Picture = Picture {
    weights: Weights::One,
    map: false,
    trace: |job| run::<Random<'_>>(job),
};

/// See the module.
#[derive(Debug)]
struct Random<'a> {
    minimiser: Minimiser<'a>,
    boxes: Boxes,
}

/// What is kept from pixel to pixel: memory only.
#[derive(Debug, Default)]
struct Room {
    stack: Stack,
    points: Vec<(f64, DVec2)>,
    roots: Vec<DVec2>,
}

impl<'a> Tracer<'a> for Random<'a> {
    type Row = Room;

    fn prepare(job: &Job<'a>, _: &mut Duration) -> Self {
        let boxes: Vec<Aabb> = job.world.pieces.iter().map(|piece| piece.bounds).collect();
        Self {
            minimiser: Minimiser::new(job, Descent::Gradient),
            boxes: Boxes::build(&boxes, Rule::Area),
        }
    }

    fn ray(&self, shot: &Shot, room: &mut Room, counts: &mut Counts) -> Option<Found> {
        let Self { minimiser, boxes } = self;
        let world = minimiser.world;
        let planes = Planes::of(&shot.ray);
        let Room {
            stack,
            points,
            roots,
        } = room;
        let (mut range, mut best) = (0.0..f64::INFINITY, None);
        boxes.visit(&shot.ray, &mut range, stack, |number, range| {
            let piece = &world.pieces[number as usize];
            let sheet = world.sheet(piece.sheet);
            let share = |local: DVec2| (piece.global(local) - sheet.start) / sheet.size;
            // Numbers depend on pixel and piece alone.
            let seed = u64::from(shot.x) | u64::from(shot.y) << 20 | u64::from(number) << 40;
            let mut random = random::Random(seed);
            points.clear();
            points.extend((0..POINTS).map(|_| {
                let at = share(DVec2::new(random.unit(), random.unit()));
                (minimiser.square(sheet, at, &planes, counts), at)
            }));
            let least = points.iter().fold(f64::INFINITY, |least, p| least.min(p.0));
            let slack = (piece.bounds.diagonal() * SLACK).powi(2);
            roots.clear();
            for &(_, at) in points.iter().filter(|p| p.0 - least <= slack) {
                let Some((uv, t)) = minimiser.root(sheet, sheet.at(at), &planes, counts) else {
                    continue;
                };
                let is_known =
                    |root: &DVec2| ((*root - uv) / sheet.size).abs().max_element() < SAME;
                if roots.iter().any(is_known) {
                    continue;
                }
                roots.push(uv);
                if range.contains(&t) && world.keeps(sheet, uv) {
                    range.end = t;
                    let shape = sheet.number;
                    best = Some(Found { t, uv, shape });
                }
            }
        });
        best
    }
}
