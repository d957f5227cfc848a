//! Loops without area that no seam explains.

use glam::DVec3;
use kernel::Curve;

use super::Trimmer;
use crate::iges::boundary::{Loop, Use};
use crate::iges::curves::Reader;

/// Curves are compared at so many places.
const PLACES: usize = 16;

impl Trimmer<'_> {
    /// Whether no loop has an area, nor runs around the surface.
    pub(super) fn are_hairlines(&self, reader: &mut Reader<'_, '_>, loops: &[Loop]) -> bool {
        loops
            .iter()
            .all(|one| is_hairline(reader, one, self.accuracy))
    }
}

/// Whether a loop runs along one curve of space and back along another that is no farther from it
/// than `near`: its face has no area. One that comes back along the same curve has a seam there, and one with other
/// curves may have a side.
fn is_hairline(reader: &mut Reader<'_, '_>, one: &Loop, near: f64) -> bool {
    let [there, back] = &one.uses[..] else {
        return false;
    };
    let is_same = (there.space, there.edge) == (back.space, back.edge);
    if is_same || there.space == 0 || back.space == 0 {
        return false;
    }
    let (Some(there), Some(back)) = (curve(reader, there), curve(reader, back)) else {
        return false;
    };
    let back = back.reversed();
    let point = |curve: &Curve<DVec3>, k: usize| {
        let domain = curve.domain();
        let share = k as f64 / PLACES as f64;
        curve.evaluate(domain.start + share * (domain.end - domain.start))
    };
    (0..=PLACES).all(|k| point(&there, k).distance(point(&back, k)) <= near)
}

/// The curve of space of a stretch, as that is run through, if it is one.
fn curve(reader: &mut Reader<'_, '_>, stretch: &Use) -> Option<Curve<DVec3>> {
    let rails = reader.glimpse_along(stretch).ok()?;
    let [rail] = &rails[..] else { return None };
    Some(if stretch.reversed {
        rail.curve.reversed()
    } else {
        rail.curve.clone()
    })
}
