//! On which side of its base an offset lies, as the curves around it tell.
//!
//! A file tells the side by a normal at the middle of the base, which some programs take for another
//! part of it than they write. That shows where the curves of space lie on the other side.

use glam::DVec3;
use kernel::Aabb;
use kernel::nearest::{self, Nearby};

use super::{MEETS, loops};
use crate::Problem;
use crate::iges::boundary::{Boundary, Edges, Loop};
use crate::iges::curves::Reader;
use crate::iges::sheets::{self, Sheet, SheetShape};

/// How many curves of space are looked at, and how many pieces of each.
const CURVES: usize = 16;

/// The curves tell the other side if they lie so many times nearer to it.
const NEARER: f64 = 10.0;

/// The surface of a face. An offset is on the other side of its base than the file tells where its
/// curves of space are there.
pub(in crate::iges) fn sheet(
    reader: &mut Reader<'_, '_>,
    lists: &mut Edges,
    [face, base]: [usize; 2],
    boundary: &Boundary,
) -> Result<Sheet, Problem> {
    let is_bounded = matches!(boundary, Boundary::Loops(_));
    let before = reader.repairs.len();
    let sheet = sheets::read(reader, base, is_bounded)?;
    if reader.file.entries[base].kind != 140 {
        return Ok(sheet);
    }
    let told = reader.repairs.split_off(before);
    let loops = loops(reader, lists, face, boundary, sheet.border.as_ref());
    reader.repairs.truncate(before);
    let points = points(reader, &loops.ok().flatten().unwrap_or_default());
    if let Some(strays) = strays(&sheet, &points).filter(|strays| *strays > MEETS)
        && let Ok(other) = reader.tried(|reader| sheets::other_side(reader, base, is_bounded))
    {
        if self::strays(&other, &points).is_some_and(|s| s * NEARER < strays) {
            let text = "its curves of space lie on the other side of its base than it is told to; \
                        they count";
            reader.repaired(base, text);
            return Ok(other);
        }
        reader.repairs.truncate(before);
    }
    reader.repairs.extend(told);
    Ok(sheet)
}

/// Points of the curves of space of a face.
fn points(reader: &mut Reader<'_, '_>, loops: &[Loop]) -> Vec<DVec3> {
    let uses = loops.iter().flat_map(|l| &l.uses);
    let mut points = Vec::new();
    for stretch in uses.filter(|u| u.space != 0).take(CURVES) {
        let rails = reader.glimpse_along(stretch);
        for rail in rails.unwrap_or_default().iter().take(CURVES) {
            let domain = rail.curve.domain();
            let middle = f64::midpoint(domain.start, domain.end);
            points.extend([domain.start, middle].map(|t| rail.curve.evaluate(t)));
        }
    }
    points
}

/// How far the farthest of some points is from a surface, as a share of its size, or of theirs if it has
/// no end.
fn strays(sheet: &Sheet, points: &[DVec3]) -> Option<f64> {
    let pieces = match &sheet.shape {
        SheetShape::Splines(pieces, _) => pieces,
        SheetShape::Quadric(quadric) => {
            let back = sheet.place.inverse();
            let points: Vec<_> = points.iter().map(|&p| back.transform_point3(p)).collect();
            let size = Aabb::around(points.iter().copied()).diagonal();
            let off = points.iter().map(|&p| quadric.off(p) / size);
            return off.reduce(f64::max);
        }
    };
    let mut nearest = vec![f64::INFINITY; points.len()];
    for surface in pieces {
        let size = surface.hull_bounds().diagonal();
        let nearby = Nearby::new(surface, nearest::closed(surface));
        for (point, nearest) in points.iter().zip(&mut nearest) {
            *nearest = nearest.min(nearby.nearest(*point, None).distance / size);
        }
    }
    nearest.into_iter().reduce(f64::max)
}
