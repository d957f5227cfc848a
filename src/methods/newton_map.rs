//! `newton-map`: nets projected to the film, Newton's iteration there by determinants.

use std::time::Duration;

use glam::{DVec2, DVec3};

use super::boxes::Stack;
use super::minimise::inside;
use super::start::Starts;
use super::world::{Planes, Sheet, World};
use super::{
    ACCURACY, Counts, Found, Job, Picture, Shot, Stopwatch, Tracer, Variant, Weights, run,
};
use crate::intersect::net::evaluate_points;

/// Steps, at most. The seeds name no number; ours is the one of the sheet.
const MOST_STEPS: u32 = 8;

/// A determinant this much smaller than its terms is zero.
const SINGULAR: f64 = 1e-12;

/// A start with a singular determinant is moved by this share of the domain, once.
const PERTURBATION: f64 = 1e-3;

/// The row's part in [`crate::METHODS`].
pub(crate) const PICTURE: Picture = Picture {
    weights: Weights::All,
    map: true,
    trace: |job| run::<Projected<'_>>(job),
};

/// See the module.
#[derive(Debug)]
struct Projected<'a> {
    world: &'a World,
    starts: Starts,
    /// The nets of all pieces on the film, `(x w, y w, w)` in pixels.
    nets: Vec<Vec<[f64; 3]>>,
    is_homogeneous: bool,
}

impl<'a> Tracer<'a> for Projected<'a> {
    type Row = Stack;

    fn prepare(job: &Job<'a>, map: &mut Duration) -> Self {
        let (world, view) = (job.world, job.view);
        let starts = Starts::of_map(job, map);
        let started = Stopwatch::start();
        let project = |piece| world.net(piece).iter().map(|h| view.project(h)).collect();
        let nets = world.pieces.iter().map(project).collect();
        *map += started.elapsed();
        Self {
            world,
            starts,
            nets,
            is_homogeneous: job.has(Variant::Homogeneous),
        }
    }

    fn ray(&self, shot: &Shot, stack: &mut Stack, counts: &mut Counts) -> Option<Found> {
        let film = DVec2::new(f64::from(shot.x), f64::from(shot.y)) + 0.5;
        let planes = Planes::of(&shot.ray);
        self.starts
            .nearest(self.world, shot, stack, |sheet, start| {
                let uv = self.root(sheet, start, film, counts)?;
                let t = planes.time(&self.world.value(sheet, uv, counts));
                Some((uv, t))
            })
    }
}

impl Projected<'_> {
    /// A point of a sheet that is seen at a place of the film (equation 10).
    fn root(&self, sheet: &Sheet, start: DVec2, film: DVec2, counts: &mut Counts) -> Option<DVec2> {
        counts.starts += 1;
        let mut uv = start;
        let mut is_moved = false;
        for _ in 0..=MOST_STEPS {
            let point = self.derivatives(sheet, uv, counts);
            let [x, ..] = point;
            // In front of the camera, and near enough.
            let apart = (DVec2::new(x.x, x.y) / x.z - film).abs().max_element();
            if x.z > 0.0 && apart <= ACCURACY {
                counts.converged += 1;
                return Some(uv);
            }
            counts.iterations += 1;
            let step = if self.is_homogeneous {
                homogeneous_step(&point, film)
            } else {
                cramer_step(&point, film)
            };
            let next = match step {
                Some(step) => uv + step,
                None if !is_moved => {
                    is_moved = true;
                    let middle = sheet.at(DVec2::splat(0.5));
                    uv + (middle - uv) * PERTURBATION
                }
                None => break,
            };
            let Some(at) = inside((next - sheet.start) / sheet.size) else {
                break;
            };
            uv = sheet.at(at);
        }
        counts.stalled += 1;
        None
    }

    /// The projected point and its derivatives by the parameters of the sheet.
    fn derivatives(&self, sheet: &Sheet, uv: DVec2, counts: &mut Counts) -> [DVec3; 3] {
        counts.derivatives += 1;
        let (number, piece, local) = self.world.locate(sheet, uv);
        let net = &self.nets[number];
        let [x, xu, xv] = evaluate_points(net, piece.degrees, local.x, local.y);
        let DVec2 { x: wide, y: high } = piece.size;
        [
            DVec3::from_array(x),
            DVec3::from_array(xu) / wide,
            DVec3::from_array(xv) / high,
        ]
    }
}

/// The step of equations 11 to 13: `w / M (MU, MV)` with
/// `M = det [X Xu Xv]`, `MU = det [X R Xv]`, `MV = det [X Xu R]` and `R = (x, y, 1)`.
pub(super) fn cramer_step([x, xu, xv]: &[DVec3; 3], film: DVec2) -> Option<DVec2> {
    let across = xu.cross(*xv);
    let m = x.dot(across);
    let sizes = x.length() * across.length();
    // False for what is not a number.
    let is_regular = m.abs() > SINGULAR * sizes;
    let side = x.cross(film.extend(1.0));
    is_regular.then(|| DVec2::new(side.dot(*xv), -side.dot(*xu)) * (x.z / m))
}

/// Newton's step for `x - x_R w = 0`, `y - y_R w = 0`.
pub(super) fn homogeneous_step([x, xu, xv]: &[DVec3; 3], film: DVec2) -> Option<DVec2> {
    let distance = |h: &DVec3| DVec2::new(h.x, h.y) - film * h.z;
    solve(distance(x), distance(xu), distance(xv))
}

/// The step with which `f + fu du + fv dv` vanishes.
pub(super) fn solve(f: DVec2, fu: DVec2, fv: DVec2) -> Option<DVec2> {
    let determinant = fu.perp_dot(fv);
    let is_regular = determinant.abs() > SINGULAR * fu.length() * fv.length();
    is_regular.then(|| DVec2::new(-f.perp_dot(fv), f.perp_dot(fu)) / determinant)
}
