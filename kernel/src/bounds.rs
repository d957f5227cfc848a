//! Axis-aligned boxes.

use glam::{DAffine3, DVec3};

/// An axis-aligned box; it may be empty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Corner with the least coordinates.
    pub min: DVec3,
    /// Corner with the greatest coordinates.
    pub max: DVec3,
}

impl Aabb {
    /// The box without a point.
    pub const EMPTY: Self = Self {
        min: DVec3::splat(f64::INFINITY),
        max: DVec3::splat(f64::NEG_INFINITY),
    };

    /// The least box around `points`.
    pub fn around(points: impl IntoIterator<Item = DVec3>) -> Self {
        points
            .into_iter()
            .fold(Self::EMPTY, |bounds, p| bounds.including(p))
    }

    /// The least box around this one and `point`.
    #[must_use]
    pub fn including(self, point: DVec3) -> Self {
        Self {
            min: self.min.min(point),
            max: self.max.max(point),
        }
    }

    /// The least box around this one and `other`.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// Whether there is no point in the box.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Whether the boxes have a point in common.
    pub fn meets(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// The middle of a box that is not empty.
    pub fn center(&self) -> DVec3 {
        self.min.midpoint(self.max)
    }

    /// Edge lengths; zero for the empty box.
    pub fn size(&self) -> DVec3 {
        (self.max - self.min).max(DVec3::ZERO)
    }

    /// Length of the diagonal.
    pub fn diagonal(&self) -> f64 {
        self.size().length()
    }

    /// The eight corners.
    pub fn corners(&self) -> [DVec3; 8] {
        let pick = |bit: bool, min: f64, max: f64| if bit { max } else { min };
        std::array::from_fn(|i| {
            DVec3::new(
                pick(i & 1 != 0, self.min.x, self.max.x),
                pick(i & 2 != 0, self.min.y, self.max.y),
                pick(i & 4 != 0, self.min.z, self.max.z),
            )
        })
    }

    /// The least box around the image of this one.
    #[must_use]
    pub fn transformed(&self, world_from_object: &DAffine3) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        Self::around(
            self.corners()
                .map(|corner| world_from_object.transform_point3(corner)),
        )
    }
}
