//! How large surfaces are that end with the curves around them.

use glam::DVec3;
use kernel::Surface;

use crate::Problem;
use crate::iges::boundary::Loop;
use crate::iges::curves::Reader;
use crate::iges::sheets::{Sheet, SheetShape};
use crate::iges::transform::check_finite;

/// The surfaces of a sheet, as large as the curves of space around it need; none if it has no end.
pub(super) fn surfaces(
    reader: &mut Reader<'_, '_>,
    loops: &[Loop],
    sheet: &mut Sheet,
) -> Result<Vec<Surface>, Problem> {
    let quadric = match &sheet.shape {
        SheetShape::Splines(pieces, _) => return Ok(pieces.clone()),
        SheetShape::Quadric(quadric) => quadric.clone(),
    };
    let hull = hull(reader, loops, sheet)?;
    let quadric = quadric.near(&hull)?;
    let surface = quadric.surface(&hull)?;
    sheet.shape = SheetShape::Quadric(quadric);
    let placed = surface.map(|surface| surface.transformed(&sheet.place));
    check_finite(placed.iter().flat_map(Surface::points))?;
    Ok(placed.into_iter().collect())
}

/// The control points of the curves of space around a face, in the coordinates of its sheet
/// before that is placed.
fn hull(reader: &mut Reader<'_, '_>, loops: &[Loop], sheet: &Sheet) -> Result<Vec<DVec3>, Problem> {
    let mut hull = Vec::new();
    let back = sheet.place.inverse();
    for stretch in loops.iter().flat_map(|l| &l.uses).filter(|u| u.space != 0) {
        for rail in reader.glimpse_along(stretch)? {
            hull.extend(rail.curve.points().map(|p| back.transform_point3(p)));
        }
    }
    Ok(hull)
}
