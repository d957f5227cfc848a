//! A face over the unit square, with what bounds it there and the Bézier pieces it lies on.

use std::ops::Range;

use glam::{DAffine2, DVec2};

use crate::{
    Aabb, BezierSurface, Cover, Curve, Error, KnotVector, Patch, Surface, TrimLoop, TrimRegion,
};

/// A point nearer than this to a curve of the unit square may be on either side of it.
const BESIDE: f64 = 1e-8;

/// A Bézier piece of a face.
pub(super) struct Piece {
    /// Its net, over the unit square.
    pub(super) net: BezierSurface,
    /// The same as a surface.
    pub(super) surface: Surface,
    /// Where it is in the unit square of the face.
    pub(super) place: [Range<f64>; 2],
    /// A box around it.
    pub(super) bounds: Aabb,
}

impl Piece {
    /// The face's parameters for those of the piece.
    pub(super) fn face_from_piece(&self) -> DAffine2 {
        onto(&self.place)
    }
}

/// A part of a border, and the numbers of the pieces it is on.
type OnPieces = (Curve<DVec2>, Vec<usize>);

/// A face that is about to be cut.
pub(super) struct Face {
    /// The face over the unit square.
    pub(super) patch: Patch,
    /// What belongs to it; all of it if none.
    region: Option<TrimRegion>,
    /// What bounds it: its loops as far as they are in the unit square, or that.
    pub(super) borders: Vec<Curve<DVec2>>,
    /// Those pieces of its surface that it has a part of.
    pub(super) pieces: Vec<Piece>,
    /// A box around it.
    pub(super) bounds: Aabb,
}

impl Face {
    /// The face of a patch.
    pub(super) fn new(patch: &Patch) -> Result<Self, Error> {
        let to_unit = onto(&domain(&patch.surface)).inverse();
        let mut patch = patch.clone();
        patch.surface = patch.surface.remapped(0.0..1.0, 0.0..1.0)?;
        patch.loops = patch
            .loops
            .iter()
            .map(|trim| mapped(trim, &to_unit))
            .collect::<Result<_, _>>()?;
        let region = patch.region();
        let mut pieces: Vec<_> = patch.surface.bezier_pieces().iter().map(piece).collect();
        if let Some(region) = &region {
            pieces.retain(|piece| {
                let [u, v] = piece.place.clone();
                region.classify(u, v) != Cover::Outside
            });
        }
        let bounds = pieces
            .iter()
            .fold(Aabb::EMPTY, |all, piece| all.union(piece.bounds));
        let borders = borders(&patch, region.is_some())?;
        Ok(Self {
            patch,
            region,
            borders,
            pieces,
            bounds,
        })
    }

    /// What bounds it, cut where its pieces meet: each with the numbers of the pieces it is on.
    pub(super) fn borders_over_pieces(&self) -> Result<Vec<OnPieces>, Error> {
        let knots = [self.patch.surface.knots_u(), self.patch.surface.knots_v()];
        let breaks = knots.map(KnotVector::breaks);
        let mut all = Vec::new();
        for border in &self.borders {
            let domain = border.domain();
            let mut cuts = vec![domain.start, domain.end];
            for (axis, breaks) in breaks.iter().enumerate() {
                for &value in &breaks[1..breaks.len() - 1] {
                    cuts.extend(border.crossings(axis, value, BESIDE));
                }
            }
            cuts.sort_by(f64::total_cmp);
            cuts.dedup_by(|a, b| *a - *b <= BESIDE * (domain.end - domain.start));
            for range in cuts.windows(2) {
                let part = border.restricted(range[0]..range[1])?;
                let middle = part.evaluate(range[0].midpoint(range[1]));
                let is_on = |piece: &Piece| {
                    let holds = |range: &Range<f64>, x: f64| {
                        range.start - BESIDE <= x && x <= range.end + BESIDE
                    };
                    holds(&piece.place[0], middle.x) && holds(&piece.place[1], middle.y)
                };
                let on = (0..self.pieces.len()).filter(|&index| is_on(&self.pieces[index]));
                all.push((part, on.collect()));
            }
        }
        Ok(all)
    }

    /// Whether a point of the plane of parameters belongs to the face.
    pub(super) fn contains(&self, uv: DVec2) -> bool {
        let is_inside = uv.min_element() >= 0.0 && uv.max_element() <= 1.0;
        is_inside
            && self
                .region
                .as_ref()
                .is_none_or(|region| region.contains(uv))
    }

    /// Whether it belongs to the face or is next to it.
    pub(super) fn reaches(&self, uv: DVec2) -> bool {
        let ways = [DVec2::ZERO, DVec2::X, DVec2::Y, -DVec2::X, -DVec2::Y];
        ways.iter().any(|way| self.contains(uv + *way * BESIDE))
    }
}

/// A patch over its own domain with other loops, given over the unit square.
pub(super) fn with_loops(own: &Patch, loops: &[TrimLoop]) -> Result<Patch, Error> {
    let mut patch = own.clone();
    let from_unit = onto(&domain(&patch.surface));
    patch.loops = loops
        .iter()
        .map(|trim| mapped(trim, &from_unit))
        .collect::<Result<_, _>>()?;
    Ok(patch)
}

/// A patch whose normals look to the other side.
pub(super) fn turned(mut patch: Patch) -> Result<Patch, Error> {
    let [u, _] = domain(&patch.surface);
    patch.surface = patch.surface.reversed_u();
    let mirror = DAffine2::from_cols(-DVec2::X, DVec2::Y, DVec2::new(u.start + u.end, 0.0));
    patch.loops = patch
        .loops
        .iter()
        .map(|trim| Ok(mapped(trim, &mirror)?.reversed()))
        .collect::<Result<_, Error>>()?;
    let texture = patch.texture.as_deref().map(Surface::reversed_u);
    patch.texture = texture.map(std::sync::Arc::new);
    Ok(patch)
}

/// A loop in other parameters.
fn mapped(trim: &TrimLoop, map: &DAffine2) -> Result<TrimLoop, Error> {
    let curves = trim.segments().iter();
    // Rounding may leave gaps of a last bit.
    TrimLoop::new(
        curves.map(|curve| curve.transformed(map)).collect(),
        f64::INFINITY,
    )
}

fn domain(surface: &Surface) -> [Range<f64>; 2] {
    [surface.knots_u().domain(), surface.knots_v().domain()]
}

/// The map of the unit square onto a rectangle.
fn onto([u, v]: &[Range<f64>; 2]) -> DAffine2 {
    let start = DVec2::new(u.start, v.start);
    let size = DVec2::new(u.end - u.start, v.end - v.start);
    DAffine2::from_scale_angle_translation(size, 0.0, start)
}

fn piece(net: &BezierSurface) -> Piece {
    let degrees = [net.degree_u(), net.degree_v()];
    let place = [net.u(), net.v()];
    let net = BezierSurface::trusted(degrees, net.homogeneous().to_vec(), 0.0..1.0, 0.0..1.0);
    let [u, v] = degrees.map(|degree| KnotVector::trusted_bezier(degree, &(0.0..1.0)));
    let surface = Surface::trusted(u, v, net.homogeneous().to_vec());
    let bounds = net.hull_bounds();
    Piece {
        net,
        surface,
        place,
        bounds,
    }
}

/// The loops of a patch over the unit square as far as they are in it, piece by piece.
fn borders(patch: &Patch, is_trimmed: bool) -> Result<Vec<Curve<DVec2>>, Error> {
    if !is_trimmed {
        let corners = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y, DVec2::ZERO];
        let sides = corners.windows(2);
        return sides
            .map(|side| Curve::line(side[0], side[1], 0.0..1.0))
            .collect();
    }
    let mut all = Vec::new();
    for (shift, trim) in patch.shifted() {
        let moved = mapped(trim, &DAffine2::from_translation(shift))?;
        for part in moved.clipped(0, 0.0..1.0)? {
            for part in part.clipped(1, 0.0..1.0)? {
                all.extend(part.segments().iter().flat_map(Curve::bezier_pieces));
            }
        }
    }
    Ok(all)
}
