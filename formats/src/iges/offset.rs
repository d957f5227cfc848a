//! Offset surfaces (type 140).

use glam::{DVec2, DVec3};
use kernel::{Surface, modelling};

use super::sheets::{Sheet, SheetShape};
use crate::Problem;

/// How far a fitted offset surface may stray, relative to its size.
pub(super) const ACCURACY: f64 = 1e-6;

/// The surface at `distance` from a base, on the side that `side` tells at the middle of its
/// parameters. Planes, cylinders, cones, spheres and tori give exact ones, others are fitted.
pub(super) fn surface(base: &Sheet, side: DVec3, distance: f64) -> Result<SheetShape, Problem> {
    match &base.shape {
        SheetShape::Quadric(quadric) if base.place == glam::DAffine3::IDENTITY => {
            let hint = quadric.frame.z().dot(side);
            let inwards = matches!(quadric.shape, super::quadric::Shape::Plane) && hint < 0.0;
            let distance = if inwards { -distance } else { distance };
            Ok(SheetShape::Quadric(quadric.offset(distance)?))
        }
        SheetShape::Quadric(_) => {
            let text = "offsets of transformed planes and quadrics are not read";
            Err(Problem::Unsupported(text.to_owned()))
        }
        SheetShape::Splines(pieces, warps) => {
            let made = pieces.iter().map(|piece| fitted(piece, side, distance));
            let pieces = made.collect::<Result<_, _>>()?;
            Ok(SheetShape::Splines(pieces, warps.clone()))
        }
    }
}

/// The offset of one surface.
fn fitted(surface: &Surface, side: DVec3, distance: f64) -> Result<Surface, Problem> {
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let middle = DVec2::new(f64::midpoint(u.start, u.end), f64::midpoint(v.start, v.end));
    let normal = surface.normal(middle).unwrap_or_default();
    let distance = if normal.dot(side) < 0.0 {
        -distance
    } else {
        distance
    };
    let at = |u: f64, v: f64| {
        let (point, normal) = surface.point_and_normal(DVec2::new(u, v));
        point + normal.unwrap_or_default() * distance
    };
    let size = surface.hull_bounds().diagonal() + distance.abs();
    let breaks = [surface.knots_u().breaks(), surface.knots_v().breaks()];
    modelling::fit_surface(at, &breaks, size * ACCURACY)
        .map(|fit| fit.surface)
        .map_err(Problem::Geometry)
}
