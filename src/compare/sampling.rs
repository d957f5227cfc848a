//! Distances and normals at many points of the surfaces: means instead of extremes.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::DVec3;
use rayon::prelude::*;

use super::exact::Exact;
use super::soup::Soup;

/// About how many points are looked at.
const POINTS: f64 = 60_000.0;

/// Points on one triangle, at most.
const MOST: f64 = 4096.0;

/// A line this far beyond a side of a triangle still meets it, as a share of its area.
const ON_SIDE: f64 = 1e-9;

/// A point of the surface and what of the mesh is there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    pub(crate) face: u32,
    pub(crate) point: DVec3,
    pub(crate) distance: f64,
    /// The area that it stands for.
    pub(crate) area: f64,
    /// The angle between the normal of the surface and that of the triangle, either way round,
    /// in radians.
    pub(crate) flat: f64,
    /// The same with the normal that a renderer would use.
    pub(crate) smooth: f64,
    /// Whether a triangle there looks out of the body; `None` if there is no body.
    pub(crate) outwards: Option<bool>,
}

/// Means over an area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// The mean.
    pub mean: f64,
    /// The root of the mean square.
    pub rms: f64,
    /// What 95 % of the area do not exceed.
    pub p95: f64,
    /// The largest value among the samples.
    pub max: f64,
}

/// Looks at points spread evenly over all faces, whose triangles are about as near as `strays`.
pub(crate) fn sample(exact: &Exact<'_>, soup: &Soup, strays: f64) -> Vec<Sample> {
    let area = |number: usize| {
        let [a, b, c] = exact.corners(number);
        0.5 * (b - a).cross(c - a).length()
    };
    let areas: Vec<f64> = (0..exact.triangles.len()).map(area).collect();
    let total: f64 = areas.iter().sum();
    // Where there are many triangles, only each `stride`-th has a point.
    let stride = (areas.len() as f64 / POINTS).ceil().max(1.0);
    let numbers = 0..areas.len();
    let samples = numbers.into_par_iter().flat_map_iter(|number| {
        let wanted = (areas[number] / total * POINTS).min(MOST);
        let skipped = wanted < 1.0 && (number as f64) % stride >= 1.0;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and 4096"
        )]
        let count = if skipped {
            0
        } else {
            wanted.ceil().max(1.0) as u32
        };
        let own = areas[number] / f64::from(count.max(1));
        let own = if wanted < 1.0 { own * stride } else { own };
        let one = move |k| sample_one((exact, soup, strays), number, shares(k, count), own);
        (0..count).filter_map(one)
    });
    samples.collect()
}

/// Weights of the corners in point `k` of `count`, the middle if there is only one: a sequence
/// that fills the triangle evenly \[Roberts 18\].
pub(super) fn shares(k: u32, count: u32) -> [f64; 3] {
    if count == 1 {
        return [1.0 / 3.0; 3];
    }
    let part = |step: f64| (0.5 + step * f64::from(k + 1)).fract();
    let (mut s, mut t) = (part(0.754_877_666_246_692_7), part(0.569_840_290_998_053_3));
    if s + t > 1.0 {
        (s, t) = (1.0 - s, 1.0 - t);
    }
    [1.0 - s - t, s, t]
}

fn sample_one(
    (exact, soup, strays): (&Exact<'_>, &Soup, f64),
    number: usize,
    shares: [f64; 3],
    area: f64,
) -> Option<Sample> {
    let corners = exact.triangles[number].map(|k| exact.vertices[k as usize]);
    let uv = corners[0].uv * shares[0] + corners[1].uv * shares[1] + corners[2].uv * shares[2];
    let face = corners[0].face;
    let own = &exact.faces[face as usize];
    let point = own.patch.surface.evaluate(uv);
    let normal = own.patch.surface.normal(uv)?;
    let found = soup.tree.nearest(point)?;
    let triangle = found.triangle as usize;
    let flat = soup.flat_normal(triangle);
    let smooth = soup.smooth_normal(triangle, found.closest.shares);
    let angle = |other: DVec3| normal.dot(other).abs().min(1.0).acos();
    let outwards = |inwards: bool| {
        let out = if inwards { -normal } else { normal };
        // Where bodies touch, the triangles of both are there, back to back; those beside it are
        // not enough.
        let mut any = out.dot(flat) > 0.0;
        if !any {
            soup.tree.within(point, strays, |other| {
                let number = other.triangle as usize;
                let faces = out.dot(soup.flat_normal(number)) > FRAC_1_SQRT_2;
                any |= faces && is_met(soup.corners(number), point, out);
            });
        }
        any
    };
    Some(Sample {
        face,
        point,
        distance: found.distance,
        area,
        flat: angle(flat),
        smooth: angle(smooth),
        outwards: own.inwards.map(outwards),
    })
}

/// Whether the line through `point` along `way` meets a triangle that looks that way.
fn is_met(corners: [DVec3; 3], point: DVec3, way: DVec3) -> bool {
    let [a, b, c] = corners.map(|corner| corner - point);
    // Volumes beside the line, which have the sign of their sum inside.
    let parts = [a.cross(b), b.cross(c), c.cross(a)].map(|side| side.dot(way));
    let sum: f64 = parts.iter().sum();
    parts.iter().all(|part| *part >= -ON_SIDE * sum)
}

/// The means of a value over the areas of samples; `None` without an area.
pub(crate) fn statistics(samples: &[Sample], value: impl Fn(&Sample) -> f64) -> Option<Statistics> {
    let total: f64 = samples.iter().map(|s| s.area).sum();
    if total <= 0.0 {
        return None;
    }
    let mean = |power: i32| {
        let sum: f64 = samples.iter().map(|s| value(s).powi(power) * s.area).sum();
        sum / total
    };
    let mut order: Vec<(f64, f64)> = samples.iter().map(|s| (value(s), s.area)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut below = 0.0;
    let reached = order.iter().find(|(_, area)| {
        below += area;
        below >= 0.95 * total
    });
    let max = order.last().map_or(0.0, |last| last.0);
    Some(Statistics {
        mean: mean(1),
        rms: mean(2).sqrt(),
        p95: reached.map_or(max, |r| r.0),
        max,
    })
}
