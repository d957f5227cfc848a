//! `wang`: the first hit of a row by clipping, the following by Newton's iteration from their
//! neighbour (S.-W. Wang, Z.-C. Shih, R.-C. Chang, *An efficient and stable ray tracing
//! algorithm for parametric surfaces*, Journal of Information Science and Engineering 18, 2001).

use std::time::Duration;

use glam::DVec2;

use super::clip::{Clipper, Room, Rules};
use super::newton_map::solve;
use super::world::Planes;
use super::{Counts, Found, Job, Picture, Shot, Tracer, Weights, run};
use crate::intersect::net::evaluate_points;

/// Steps from a neighbour, at most.
const MOST_STEPS: u32 = 5;

/// The row's part in [`crate::METHODS`].
pub(crate) const PICTURE: Picture = Picture {
    weights: Weights::All,
    map: false,
    trace: |job| run::<Coherent<'_>>(job),
};

/// See the module.
#[derive(Debug)]
struct Coherent<'a>(Clipper<'a>);

/// What the neighbour to the left met: a piece, and where on it in local parameters.
#[derive(Debug, Default)]
struct Row {
    room: Room,
    neighbour: Option<(u32, DVec2)>,
}

impl<'a> Tracer<'a> for Coherent<'a> {
    type Row = Row;

    fn prepare(job: &Job<'a>, _: &mut Duration) -> Self {
        Self(Clipper::new(job.world, job.view, Rules::NISHITA))
    }

    fn ray(&self, shot: &Shot, row: &mut Row, counts: &mut Counts) -> Option<Found> {
        let Self(clipper) = self;
        let continued = row
            .neighbour
            .and_then(|(piece, local)| self.newton(shot, piece, local, counts));
        let found = match continued {
            // What else lies nearer would hide it; the piece itself is taken to be seen.
            Some((found, piece)) => {
                let (end, same) = (found.t, |other| other == piece);
                let nearer = clipper.nearest(shot, end, same, &mut row.room, counts);
                nearer.or(Some((found, piece)))
            }
            None => clipper.nearest(shot, f64::INFINITY, |_| false, &mut row.room, counts),
        };
        row.neighbour = found.map(|(found, number)| {
            let piece = &clipper.world.pieces[number as usize];
            (number, (found.uv - piece.start) / piece.size)
        });
        found.map(|(found, _)| found)
    }
}

impl Coherent<'_> {
    /// A root of a piece, from `local` on; its iteration must stay on the piece.
    fn newton(
        &self,
        shot: &Shot,
        number: u32,
        mut local: DVec2,
        counts: &mut Counts,
    ) -> Option<(Found, u32)> {
        let Self(clipper) = self;
        let world = clipper.world;
        let planes = Planes::of(&shot.ray);
        let piece = &world.pieces[number as usize];
        let net = world.net(piece);
        counts.starts += 1;
        for _ in 0..=MOST_STEPS {
            counts.derivatives += 1;
            let point = evaluate_points(net, piece.degrees, local.x, local.y);
            let d = planes.with_derivatives(&point);
            if d.f.length() <= clipper.view.accuracy(d.t) {
                counts.converged += 1;
                let (uv, sheet) = (piece.global(local), world.sheet(piece.sheet));
                let (t, shape) = (d.t, sheet.number);
                let is_seen = t >= 0.0 && world.keeps(sheet, uv);
                return is_seen.then_some((Found { t, uv, shape }, number));
            }
            counts.iterations += 1;
            local += solve(d.f, d.fu, d.fv)?;
            let inside = local.clamp(DVec2::ZERO, DVec2::ONE) == local;
            if !inside {
                break;
            }
        }
        counts.stalled += 1;
        None
    }
}
