//! A surface with its trim loops: what a file calls a face.

use crate::{MaterialId, Surface, TrimLoop, TrimRegion};

/// A face: a surface, the loops that trim it, and a material.
///
/// A point of the surface belongs to the face if it lies inside an odd number of loops;
/// without loops the whole surface does.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// The name in the file, or empty.
    pub name: String,
    /// Where it stands in the file, in the format's own words.
    pub source: String,
    /// The whole surface.
    pub surface: Surface,
    /// Boundaries in the parameter domain.
    pub loops: Vec<TrimLoop>,
    /// The material, unless the scene node that shows the patch names another.
    pub material: Option<MaterialId>,
}

impl Patch {
    /// The part of the domain that belongs to the face; `None` means all of it.
    pub fn region(&self) -> Option<TrimRegion> {
        let trimmed = !self.loops.is_empty();
        trimmed
            .then(|| TrimRegion::of(self))
            .filter(|region| !region.is_whole())
    }
}

impl From<Surface> for Patch {
    fn from(surface: Surface) -> Self {
        let (name, source) = (String::new(), String::new());
        Self {
            name,
            source,
            surface,
            loops: Vec::new(),
            material: None,
        }
    }
}
