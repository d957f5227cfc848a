//! How far triangles are from the surface, measured.

use glam::{DVec2, DVec3};
use kernel::Surface;

/// Points on a triangle, as shares of its corners: 12 spread over it and its sides, and the middle.
const SHARES: usize = 4;

/// The largest distance, at sample points that are no corners, between a triangle and the surface
/// at the same parameters.
pub(super) fn triangle(surface: &Surface, uvs: [DVec2; 3], corners: [DVec3; 3]) -> f64 {
    let mut most: f64 = 0.0;
    let mut look = |[a, b, c]: [f64; 3]| {
        let uv = uvs[0] * a + uvs[1] * b + uvs[2] * c;
        let flat = corners[0] * a + corners[1] * b + corners[2] * c;
        most = most.max(surface.evaluate(uv).distance(flat));
    };
    let share = |k: usize| k as f64 / SHARES as f64;
    for i in 0..=SHARES {
        for j in 0..=SHARES - i {
            if [i, j, SHARES - i - j].contains(&SHARES) {
                continue;
            }
            look([share(i), share(j), share(SHARES - i - j)]);
        }
    }
    look([1.0 / 3.0; 3]);
    most
}
