//! Offset surfaces (type 140).

use glam::{DMat3, DVec2, DVec3};
use kernel::{Surface, modelling};

use super::sheets::{Sheet, SheetShape};
use crate::Problem;

/// How far a fitted offset surface may stray, relative to its size.
pub(super) const ACCURACY: f64 = 1e-6;

/// A fitted surface that strays no more than this share of its size is exact.
const EXACT: f64 = 1e-12;

/// How far axes may be from being at right angles and equally long.
const SKEW: f64 = 1e-9;

/// The surface at `distance` from a base, on the side that `side` tells at the middle of its
/// parameters, and whether it is exact: planes, cylinders, cones, spheres and tori give exact ones,
/// others are fitted. Those of the former stand where their base does.
pub(super) fn surface(
    base: &Sheet,
    side: DVec3,
    distance: f64,
) -> Result<(SheetShape, bool), Problem> {
    match &base.shape {
        SheetShape::Quadric(quadric) => {
            let map = base.place.matrix3;
            let Some(scale) = even_scale(map) else {
                let text = "offsets of planes and quadrics that are sheared are not read";
                return Err(Problem::Unsupported(text.to_owned()));
            };
            let side = map.transpose() * side;
            let is_behind = quadric.normal().is_some_and(|n| n.dot(side) < 0.0);
            let distance = if is_behind { -distance } else { distance };
            Ok((SheetShape::Quadric(quadric.offset(distance / scale)?), true))
        }
        SheetShape::Splines(pieces, warps) => {
            let mut is_exact = true;
            let mut made = Vec::new();
            for piece in pieces {
                let (surface, exact) = fitted(piece, side, distance)?;
                made.push(surface);
                is_exact &= exact;
            }
            Ok((SheetShape::Splines(made, warps.clone()), is_exact))
        }
    }
}

/// How much a map makes all lengths longer; `None` if it does not treat them alike.
fn even_scale(map: DMat3) -> Option<f64> {
    let scale = map.x_axis.length();
    let off = map.transpose() * map - DMat3::from_diagonal(DVec3::splat(scale * scale));
    let is_even = off
        .to_cols_array()
        .iter()
        .all(|x| x.abs() <= SKEW * scale * scale);
    is_even.then_some(scale)
}

/// The offset of one surface, and whether it is exact.
fn fitted(surface: &Surface, side: DVec3, distance: f64) -> Result<(Surface, bool), Problem> {
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
    let fit = modelling::fit_surface(at, &breaks, size * ACCURACY).map_err(Problem::Geometry)?;
    Ok((fit.surface, fit.deviation <= size * EXACT))
}
