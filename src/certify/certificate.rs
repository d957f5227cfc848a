//! What can be said about a ray.

use kernel::Interval;

use crate::intersect::Hit;

/// What is known about a ray, from its origin on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Certificate {
    /// Proven: the first thing that the ray meets is this.
    Hit {
        /// Number of the shape, as in [`Hit::shape`].
        shape: u32,
        /// Where along the ray.
        t: Interval,
    },
    /// Proven: the ray meets nothing.
    Miss,
    /// Not proven.
    Ambiguous {
        /// Why.
        reason: Ambiguity,
        /// Proven: up to here the ray meets nothing.
        free: f64,
    },
}

/// Why a ray has no certain first hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ambiguity {
    /// It comes too close to touching a surface, or to a singular point.
    Tangent,
    /// It passes the border of a patch, of one of its pieces or of a triangle too closely, or
    /// through a gap between two faces, or starts on a surface.
    Edge,
    /// Two shapes are met at places that cannot be told apart.
    Overlap,
}

impl Certificate {
    /// A number for pictures: 0 miss, 1 hit, 2 tangent, 3 edge, 4 overlap.
    pub fn code(&self) -> u8 {
        match self {
            Self::Miss => 0,
            Self::Hit { .. } => 1,
            Self::Ambiguous { reason, .. } => match reason {
                Ambiguity::Tangent => 2,
                Ambiguity::Edge => 3,
                Ambiguity::Overlap => 4,
            },
        }
    }

    /// The name of the status.
    pub fn name(&self) -> &'static str {
        ["miss", "hit", "tangent", "edge", "overlap"][usize::from(self.code())]
    }

    /// What can be said if the answer to the ray stands for a gap between two faces: the proof
    /// knows the faces only.
    #[must_use]
    pub fn beside(self, answer: Option<&Hit>) -> Self {
        match answer {
            Some(hit) if hit.filled => Self::Ambiguous {
                reason: Ambiguity::Edge,
                free: hit.t.next_down(),
            },
            _ => self,
        }
    }

    /// Whether an answer to the same ray cannot be right, even if its `t` is wrong by
    /// `accuracy`.
    pub fn contradicts(&self, answer: Option<&Hit>, accuracy: f64) -> bool {
        self.excludes(answer.map(|hit| (hit.shape, hit.t)), accuracy)
    }

    /// The same for the number of a shape and a place along the ray.
    pub(super) fn excludes(&self, answer: Option<(u32, f64)>, accuracy: f64) -> bool {
        match (self, answer) {
            (Self::Hit { shape, t }, Some((found, at))) => {
                found != *shape || !t.widened(accuracy).contains(at)
            }
            (Self::Hit { .. }, None) | (Self::Miss, Some(_)) => true,
            (Self::Miss | Self::Ambiguous { .. }, None) => false,
            (Self::Ambiguous { free, .. }, Some((_, at))) => at < free - accuracy,
        }
    }
}
