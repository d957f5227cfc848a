//! Answers held against the truth: proven where it can be proven.

use kernel::{Camera, Scene};
use rayon::prelude::*;

use super::world::{Planes, View, World};
use super::{Counts, Found, Trace};
use crate::certify::{Certificate, Certifier};

/// Answers nearer to the truth than this many widths of a pixel, along the ray, are right.
const NEAR: f64 = 1.0;

/// What an answer is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is the truth.
    Right,
    /// Another place than the one that is seen.
    Wrong,
    /// Nothing, where something is seen.
    Lost,
    /// Something, where nothing is.
    Invented,
    /// The truth is not proven there.
    Open,
}

/// The truth about the rays through the middles of all pixels.
#[derive(Debug)]
pub struct Truth {
    certificates: Vec<Certificate>,
    world: World,
    view: View,
}

/// How the answers of a method compare with the truth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Judgement {
    /// One for each pixel, top row first.
    pub verdicts: Vec<Verdict>,
    /// Pixels of each kind: right, wrong, lost, invented, open.
    pub counts: [u64; 5],
    /// Pixels in which something is seen.
    pub seen: u64,
    /// Mean and greatest distance of right answers from their ray, in widths of a pixel.
    pub error: [f64; 2],
}

impl Truth {
    /// Proves what each pixel of a picture shows, on all threads of the current pool.
    pub fn prove(scene: &Scene, camera: &Camera, size: (u32, u32)) -> Self {
        let view = View::new(camera, size);
        let certifier = Certifier::build(scene);
        let certificates = (0..size.1)
            .into_par_iter()
            .flat_map_iter(|y| {
                let (view, certifier) = (&view, &certifier);
                (0..size.0).map(move |x| certifier.certify(&view.ray(x, y)))
            })
            .collect();
        Self {
            certificates,
            world: World::of(scene),
            view,
        }
    }

    /// Judges the answers of a method to the same picture.
    pub fn judge(&self, trace: &Trace) -> Judgement {
        let mut judgement = Judgement::default();
        let (mut sum, mut greatest) = (0.0, 0.0_f64);
        let pixels = (0..self.view.height).flat_map(|y| (0..self.view.width).map(move |x| (x, y)));
        for ((certificate, found), pixel) in self.certificates.iter().zip(&trace.found).zip(pixels)
        {
            let verdict = self.verdict(certificate, found.as_ref());
            judgement.counts[verdict as usize] += 1;
            judgement.seen += u64::from(matches!(certificate, Certificate::Hit { .. }));
            judgement.verdicts.push(verdict);
            if let (Verdict::Right, Some(found)) = (verdict, found) {
                let error = self.error(found, pixel);
                sum += error;
                greatest = greatest.max(error);
            }
        }
        judgement.error = [sum / judgement.counts[0].max(1) as f64, greatest];
        judgement
    }

    fn verdict(&self, certificate: &Certificate, found: Option<&Found>) -> Verdict {
        match (certificate, found) {
            (Certificate::Hit { t, .. }, Some(found)) => {
                // Rays of a camera count `t` in depths.
                let near = NEAR * self.view.footprint(found.t);
                if t.widened(near).contains(found.t) {
                    Verdict::Right
                } else {
                    Verdict::Wrong
                }
            }
            (Certificate::Hit { .. }, None) => Verdict::Lost,
            (Certificate::Miss, None) => Verdict::Right,
            (Certificate::Miss, Some(_)) => Verdict::Invented,
            (Certificate::Ambiguous { free, .. }, Some(found))
                if found.t < free - NEAR * self.view.footprint(found.t) =>
            {
                Verdict::Wrong
            }
            (Certificate::Ambiguous { .. }, _) => Verdict::Open,
        }
    }

    /// How far a point is from its ray, in widths of a pixel.
    fn error(&self, found: &Found, (x, y): (u32, u32)) -> f64 {
        let Some(sheet) = self.world.sheets.get(found.shape as usize) else {
            return 0.0;
        };
        let h = self.world.value(sheet, found.uv, &mut Counts::default());
        let distance = Planes::of(&self.view.ray(x, y)).distances(&h).length();
        distance / self.view.footprint(found.t)
    }
}
