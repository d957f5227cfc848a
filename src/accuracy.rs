//! How far what is in a file of triangles is from the surfaces.

use crate::tessellate::{FaceMesh, Tessellation};

/// The largest share by which a number changes in single precision.
pub(crate) const SINGLE: f64 = 0.5 * f32::EPSILON as f64;

/// How far triangles are from the surfaces, and lines from curves, where they are shown, in units of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// At most.
    pub proven: f64,
    /// Found at sample points.
    pub sampled: f64,
    /// Of points that a face shares with a neighbour.
    pub gap: f64,
}

impl Accuracy {
    /// Of triangles whose points are moved by up to `rounding` when they are written.
    pub fn of(triangles: &Tessellation, rounding: f64) -> Self {
        let most = |get: fn(&FaceMesh) -> f64| {
            let faces = triangles.faces.iter().flatten();
            faces.map(|face| get(face) * face.scale).fold(0.0, f64::max)
        };
        let strips = triangles.strips.iter().flatten();
        let lines = strips
            .map(|strip| strip.proven * strip.scale)
            .fold(0.0, f64::max);
        Self {
            proven: most(|face| face.proven).max(lines) + rounding,
            sampled: most(|face| face.sampled) + rounding,
            gap: most(|face| face.gap),
        }
    }
}
