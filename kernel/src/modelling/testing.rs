//! Contours for tests.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

/// A round, uneven contour of `count` points at a height.
pub(super) fn contour(count: usize, radius: f64, height: f64) -> Vec<DVec3> {
    let point = |k: usize| {
        let angle = TAU * (k as f64 + 0.3 * (2.0 * k as f64).sin()) / count as f64;
        let radius = radius * (1.0 + 0.15 * (2.0 * angle).cos() + 0.05 * (3.0 * angle).sin());
        (DVec2::from_angle(angle) * radius).extend(height)
    };
    (0..count).map(point).collect()
}

/// A stack of such contours, all of which start near the same place.
pub(super) fn stack(counts: &[usize]) -> Vec<Vec<DVec3>> {
    let layer = |(k, &count): (usize, &usize)| {
        let height = k as f64 + 0.2 * (k as f64).sin();
        contour(count, 1.0 + 0.3 * (k as f64).sin(), height)
    };
    counts.iter().enumerate().map(layer).collect()
}
