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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::KnotVector;

    fn line(from: [f64; 2], to: [f64; 2]) -> Curve<DVec2> {
        Curve::line(from.into(), to.into(), 2.0..5.0).unwrap()
    }

    fn assert_closed(trim: &TrimLoop) {
        let segments = trim.segments();
        let next = segments.iter().cycle().skip(1);
        for (segment, next) in segments.iter().zip(next) {
            assert_eq!(segment.end(), next.start());
        }
    }

    #[test]
    fn curves_that_meet_stay_as_they_are() {
        let corners = [[0.1, 0.2], [0.7, 0.3], [0.3, 0.9]];
        let sides = [0, 1, 2].map(|i| line(corners[i], corners[(i + 1) % 3]));
        let trim = TrimLoop::new(sides.to_vec(), 0.0).unwrap();
        assert_eq!(trim.segments(), sides);
        assert_closed(&trim);
    }

    #[test]
    fn small_gaps_are_bridged_to_the_last_bit() {
        let sides = vec![
            line([0.0, 0.0], [1.0, 1e-9]),
            line([1.0, 0.0], [0.3, 0.7]),
            line([0.3, 0.7 + 1e-9], [1e-10, 1e-10]),
        ];
        let trim = TrimLoop::new(sides, 1e-8).unwrap();
        assert_eq!(trim.segments().len(), 6);
        assert_closed(&trim);
    }

    #[test]
    fn one_closed_curve_is_a_loop() {
        let knots = KnotVector::clamped_uniform(2, 5, 0.0..1.0).unwrap();
        let points = [[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9], [0.1, 0.1]];
        let weights = [0.3, 1.0, 2.0, 1.0, 0.7];
        let closed = Curve::new(knots, &points.map(DVec2::from), Some(&weights)).unwrap();
        let trim = TrimLoop::new(vec![closed], 1e-12).unwrap();
        assert_closed(&trim);
    }

    #[test]
    fn large_gaps_are_refused() {
        let sides = vec![line([0.0, 0.0], [1.0, 0.0]), line([1.0, 0.5], [0.0, 0.0])];
        let refused = Error::LoopGap {
            index: 0,
            gap: 0.5,
            allowed: 0.1,
        };
        assert_eq!(TrimLoop::new(sides.clone(), 0.1), Err(refused));
        for tolerance in [f64::NAN, -1.0] {
            let refused = TrimLoop::new(sides.clone(), tolerance);
            assert!(matches!(refused, Err(Error::LoopGap { index: 0, .. })));
        }
        assert_eq!(TrimLoop::new(Vec::new(), 1.0), Err(Error::EmptyLoop));
        let nowhere = Curve::line(DVec2::NAN, DVec2::ONE, 0.0..1.0);
        assert_eq!(nowhere, Err(Error::NotFinite { index: 0 }));
    }
}
