//! Certificates for the rays through the middles of pixels.

use std::time::{Duration, Instant};

use glam::DVec2;
use kernel::Camera;
use rayon::prelude::*;

use super::Certifier;
use crate::accelerator::{Accelerator, Workspace};
use crate::film::{Film, PixelData};
use crate::render::{Eye, FilmRays};

/// Accuracy that is promised of a hit, relative to the scene's size.
const ACCURACY: f64 = 1e-9;

/// How many pixels have which status, and what it took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CertifyStats {
    /// Pixels by status: miss, hit, tangent, edge, overlap.
    pub counts: [u64; 5],
    /// Pixels that show something else than what was proven.
    pub contradictions: u64,
    /// Time on all threads together, from start to end.
    pub certify: Duration,
}

/// Certifies the ray through the middle of every pixel of `film`, writes the status into its
/// data, and compares with what the data show; a film without data has nothing to compare with.
///
/// What is shown may be `widths` widths of a pixel off along the ray, besides the rounding of the
/// data: none where every hit is finished in double precision.
pub fn certify_film(
    film: &mut Film,
    accelerator: &Accelerator<'_>,
    camera: &Camera,
    widths: f64,
) -> CertifyStats {
    let started = Instant::now();
    let certifier = Certifier::build(accelerator.scene());
    let accuracy = ACCURACY * accelerator.bounds().diagonal();
    let (width, height) = (film.width(), film.height());
    let rays = FilmRays::new(camera, DVec2::new(f64::from(width), f64::from(height)));
    let eye = Eye::new(camera, width as usize, height as usize);
    let shown: Vec<_> = film.data().iter().map(shown).collect();
    let rows: Vec<Vec<_>> = (0..height)
        .into_par_iter()
        .map_init(Workspace::default, |workspace, y| {
            let certify = |x| {
                let place = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
                let ray = rays.through(place);
                let answer = accelerator.nearest(&ray, 0.0..f64::INFINITY, workspace);
                let certificate = certifier.certify(&ray).beside(answer.as_ref());
                let index = y as usize * width as usize + x as usize;
                let wrong = shown.get(index).is_some_and(|&shown| {
                    let depth = shown.map_or(0.0, |(_, depth)| depth.abs());
                    let rounding = f64::from(f32::EPSILON) * depth;
                    let off = accuracy / ray.direction.length() + rounding;
                    certificate.excludes(shown, off + widths * eye.pixel(depth))
                });
                (certificate, wrong)
            };
            (0..width).map(certify).collect()
        })
        .collect();
    let mut stats = CertifyStats::default();
    for (index, (certificate, wrong)) in rows.iter().flatten().enumerate() {
        if let Some(data) = film.data_mut().get_mut(index) {
            data.status = f32::from(certificate.code());
        }
        stats.counts[usize::from(certificate.code())] += 1;
        stats.contradictions += u64::from(*wrong);
    }
    stats.certify = started.elapsed();
    stats
}

/// The number of the shape that a pixel shows, and how far it is along its ray: rays of a camera
/// count in depths.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of shapes are whole and not negative"
)]
fn shown(data: &PixelData) -> Option<(u32, f64)> {
    (data.shape >= 0.0).then(|| (data.shape as u32, f64::from(data.depth)))
}
