//! Rays.

use glam::{DAffine3, DVec3};

/// A half line `origin + t direction`, `t >= 0`.
///
/// The direction need not have length one; `t` counts in its lengths. These have to be between 1e-150 and 1e150, so that
/// their squares are numbers: other rays meet nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where `t` is zero.
    pub origin: DVec3,
    /// The way for one unit of `t`.
    pub direction: DVec3,
}

impl Ray {
    /// The point at parameter `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }

    /// The same ray in other coordinates; `t` keeps its meaning.
    #[must_use]
    pub fn transformed(&self, target_from_source: &DAffine3) -> Self {
        Self {
            origin: target_from_source.transform_point3(self.origin),
            direction: target_from_source.transform_vector3(self.direction),
        }
    }
}
