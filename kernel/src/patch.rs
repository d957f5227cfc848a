//! A surface with its trim loops: what a file calls a face.

use glam::DVec2;

use crate::{Curve, Error, MaterialId, Surface};

/// A closed curve in the parameter domain of a surface.
///
/// The end of each segment is the start of the next to the last bit, and the end of
/// the last is the start of the first.
#[derive(Clone, Debug, PartialEq)]
pub struct TrimLoop {
    segments: Vec<Curve<DVec2>>,
}

impl TrimLoop {
    /// Joins curves end to end into a loop.
    ///
    /// Gaps up to `tolerance`, in parameter units, are bridged by straight segments.
    ///
    /// # Errors
    /// If there are no curves, or a gap is larger, or the tolerance is not a number.
    pub fn new(curves: Vec<Curve<DVec2>>, tolerance: f64) -> Result<Self, Error> {
        let starts: Vec<_> = curves.iter().map(Curve::start).collect();
        let Some(&first) = starts.first() else {
            return Err(Error::EmptyLoop);
        };
        let mut segments = Vec::new();
        for (index, curve) in curves.into_iter().enumerate() {
            let end = curve.end();
            let next = starts.get(index + 1).copied().unwrap_or(first);
            segments.push(curve);
            let gap = end.distance(next);
            // No gap passes a tolerance that is not a number.
            let bridged = gap <= tolerance;
            if !bridged {
                return Err(Error::LoopGap {
                    index,
                    gap,
                    allowed: tolerance,
                });
            }
            if end != next {
                segments.push(Curve::line(end, next, 0.0..1.0)?);
            }
        }
        Ok(Self { segments })
    }

    /// The curves of the loop in order.
    pub fn segments(&self) -> &[Curve<DVec2>] {
        &self.segments
    }
}

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
