//! Offset curves (type 130) and surfaces (type 140).
//!
//! Where a base has a corner or a crease, its normal jumps, and so does its offset: that is cut
//! there, and each part is fitted for itself.

use std::ops::Range;

use glam::{DAffine3, DMat3, DVec2, DVec3};
use kernel::{Curve, Surface, modelling};

use super::curves::{Rail, Reader, fitted};
use super::directory::WHOLE;
use super::net::TEARING;
use super::sheets::{Sheet, SheetShape, Warp};
use crate::{Problem, common};

/// How far a fitted offset curve may stray, relative to its size.
const CURVE_ACCURACY: f64 = 1e-7;

/// How far a fitted offset surface may stray, relative to its size.
pub(super) const ACCURACY: f64 = 1e-6;

/// What strays no more than this share of its size is exact.
pub(super) const EXACT: f64 = 1e-12;

/// Where the direction of a curve or the normal of a surface turns by more, in radians, there is a
/// corner or crease.
const CORNER: f64 = 1e-6;

/// How far axes may be from being at right angles and equally long.
const SKEW: f64 = 1e-9;

/// The offset of a curve (type 130), in pieces where that has corners.
pub(super) fn curves(
    reader: &mut Reader<'_, '_>,
    index: usize,
    depth: usize,
) -> Result<Vec<Rail>, Problem> {
    let file = reader.file;
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
    let base = file.follow(parameters.integer()?, "the base of an offset curve")?;
    let kind = parameters.integer_or(1)?;
    let law = [parameters.integer_or(0)?, parameters.integer_or(0)?];
    let by_length = parameters.integer_or(0)? == 1;
    let mut real = || parameters.real_or(0.0);
    let [(near, from), (far, to)] = [(real()?, real()?), (real()?, real()?)];
    let normal = DVec3::new(real()?, real()?, real()?);
    let wanted = real()?..real()?;
    let mut whole = |curve: usize| {
        let mut rails = Vec::new();
        reader.collect(curve, depth + 1, &mut rails)?;
        reader.whole(curve, rails)
    };
    let base = whole(base)?;
    let domain = base.curve.domain();
    let slope = (far - near) / (to - from);
    let (start, scale) = if by_length {
        let length = length(&base.curve) / (domain.end - domain.start);
        (domain.start, length)
    } else {
        (0.0, 1.0)
    };
    let is_even = !by_length || base.is_even();
    let (law, from) = match (kind, law) {
        (1, _) => (Law::Linear(near, 0.0), start),
        (2, _) if slope.is_finite() && is_even => (Law::Linear(near, slope), start + from / scale),
        (3, [law, axis @ 1..=3]) if is_even => {
            let law = file.follow(law, "the law of an offset curve")?;
            let axis = usize::try_from(axis - 1).unwrap_or_default();
            (Law::Coordinate(whole(law)?.curve, axis), start)
        }
        _ => {
            let text = "the distance of the offset curve follows a law that is not read";
            return Err(Problem::Unsupported(text.to_owned()));
        }
    };
    let warp = Warp::new(&base);
    let distance = Distance {
        law,
        from,
        scale,
        warp: (warp, domain.clone()),
    };
    let normal = normal.try_normalize();
    let normal = normal.ok_or(Problem::Geometry(kernel::Error::NoDirection))?;
    let is_part = domain.start <= wanted.start && wanted.end <= domain.end;
    let range = if is_part && wanted.start < wanted.end {
        let [start, end] = [wanted.start, wanted.end].map(|t| distance.of_file(t));
        start..end
    } else {
        domain
    };
    let size = base.curve.hull_bounds().diagonal() + distance.most();
    let parts = base.curve.restricted(range).map_err(Problem::Geometry)?;
    let parts = parts.parts(is_corner);
    if parts.len() > 1 {
        reader.unsupported(index, "the offset of a curve with corners is in pieces");
    }
    let (mut made, mut strays) = (Vec::new(), 0.0_f64);
    for part in parts {
        let (rail, off) = one(&part, &base.arcs, &distance, (normal, size))?;
        strays = strays.max(off);
        made.push(rail);
    }
    if strays > CURVE_ACCURACY {
        reader.unsupported(index, fitted("it", strays, CURVE_ACCURACY));
    }
    Ok(made)
}

/// The offset of a part of the base without corners, over the parameter of the file, and how far it strays,
/// as a share of the size.
fn one(
    part: &Curve<DVec3>,
    arcs: &[Range<f64>],
    distance: &Distance,
    (normal, size): (DVec3, f64),
) -> Result<(Rail, f64), Problem> {
    let at = |t: f64| {
        let (point, along) = part.tangent(t);
        let out = normal.cross(along).try_normalize().unwrap_or_default();
        point + out * distance.at(t)
    };
    let Range { start, end } = part.domain();
    let is_arc = arcs
        .iter()
        .any(|arc| common(arc, &part.domain()) == part.domain());
    if let Some(offset) = of_arc(part, at, size * EXACT) {
        if !is_arc {
            return Ok((Rail::from(offset), 0.0));
        }
        let angles = distance.in_file(start)..distance.in_file(end);
        if let Some(arc) = over_angles(&offset, angles, size * EXACT) {
            return Ok((Rail::arc(arc), 0.0));
        }
    }
    let mut breaks = part.knots().breaks();
    breaks.iter_mut().for_each(|at| *at = distance.in_file(*at));
    breaks.extend(distance.breaks(&part.domain()));
    breaks.sort_by(f64::total_cmp);
    breaks.dedup();
    let at = |s: f64| at(distance.of_file(s).clamp(start, end));
    let fit = modelling::fit(at, &breaks, size * CURVE_ACCURACY, DVec3::distance);
    let fit = fit.map_err(Problem::Geometry)?;
    Ok((Rail::from(fit.curve), fit.deviation / size))
}

/// The arc of a circle through the points of a curve, over these angles; `None` if its ends are farther
/// than `near` from those of the curve.
fn over_angles(curve: &Curve<DVec3>, angles: Range<f64>, near: f64) -> Option<Curve<DVec3>> {
    let Range { start, end } = curve.domain();
    let [a, b, c] = [0.0, 0.3, 0.6].map(|share| curve.evaluate(start + (end - start) * share));
    let center = a + modelling::to_center([a, b, c]);
    let out = a - center;
    let along = (b - a).cross(c - b).try_normalize()?.cross(out);
    let (sin, cos) = angles.start.sin_cos();
    let [x, y] = [out * cos - along * sin, out * sin + along * cos];
    let arc = modelling::arc(center, x, y, angles).ok()?;
    let is_there = [(arc.start(), curve.start()), (arc.end(), curve.end())];
    let is_there = is_there
        .into_iter()
        .all(|(own, other)| own.distance(other) <= near);
    is_there.then_some(arc)
}

/// How far an offset curve is from its base, by the parameter of that.
struct Distance {
    law: Law,
    /// The parameter, or else the length up to it, counts from here on, and times this.
    from: f64,
    scale: f64,
    /// What that parameter is to the one of the curve, with the domain of both.
    warp: (Warp, Range<f64>),
}

/// What a distance is a function of.
enum Law {
    /// What it is at first, and how fast it grows.
    Linear(f64, f64),
    /// A curve, of which one coordinate counts.
    Coordinate(Curve<DVec3>, usize),
}

impl Distance {
    /// The parameter of the curve for one of the file.
    fn of_file(&self, t: f64) -> f64 {
        let (warp, domain) = &self.warp;
        warp.apply(t, domain)
    }

    /// The parameter of the file for one of the curve.
    fn in_file(&self, t: f64) -> f64 {
        let (warp, domain) = &self.warp;
        warp.undone(t, domain)
    }

    fn at(&self, t: f64) -> f64 {
        let s = self.scale * (self.in_file(t) - self.from);
        match &self.law {
            Law::Linear(first, slope) => first + slope * s,
            Law::Coordinate(curve, axis) => {
                let Range { start, end } = curve.domain();
                curve.evaluate(s.clamp(start, end))[*axis]
            }
        }
    }

    /// About the largest.
    fn most(&self) -> f64 {
        match &self.law {
            Law::Linear(first, _) => first.abs(),
            Law::Coordinate(curve, axis) => {
                let sizes = curve.points().map(|p| p[*axis].abs());
                sizes.fold(0.0, f64::max)
            }
        }
    }

    /// The parameters of the file where the curve of the law has breaks, for those of the curve inside a
    /// range.
    fn breaks(&self, inside: &Range<f64>) -> Vec<f64> {
        let Law::Coordinate(curve, _) = &self.law else {
            return Vec::new();
        };
        let breaks = curve.knots().breaks().into_iter();
        let breaks = breaks.map(|s| self.from + s / self.scale);
        breaks
            .filter(|s| inside.contains(&self.of_file(*s)))
            .collect()
    }
}

/// The offset of an arc of a circle: as large a part of the circle beside it; `None` if what is `at` the
/// parameters of the base is farther than `near` from one.
fn of_arc(base: &Curve<DVec3>, at: impl Fn(f64) -> DVec3, near: f64) -> Option<Curve<DVec3>> {
    let Range { start, end } = base.domain();
    let place = |share: f64| start + (end - start) * share;
    let [a, b, c] = [0.0, 0.3, 0.6].map(|share| base.evaluate(place(share)));
    let way = modelling::to_center([a, b, c]);
    let center = a + way;
    let scale = (at(start) - center).dot(-way) / way.length_squared();
    let grown = DAffine3::from_translation(center)
        * DAffine3::from_scale(DVec3::splat(scale))
        * DAffine3::from_translation(-center);
    let offset = base.transformed(&grown);
    let is_there = |k: u32| {
        let t = place(f64::from(k) / 32.0);
        offset.evaluate(t).distance(at(t)) <= near
    };
    (0..=32).all(is_there).then_some(offset)
}

/// Whether the direction jumps from a piece of a curve to the next one.
fn is_corner(before: &Curve<DVec3>, after: &Curve<DVec3>) -> bool {
    let (_, before) = before.tangent(before.domain().end);
    let (_, after) = after.tangent(after.domain().start);
    before.angle_between(after) > CORNER
}

/// The length of a line or arc.
fn length(curve: &Curve<DVec3>) -> f64 {
    let Range { start, end } = curve.domain();
    let points: Vec<_> = (0..=256)
        .map(|k| curve.evaluate(start + (end - start) * f64::from(k) / 256.0))
        .collect();
    points.windows(2).map(|w| w[0].distance(w[1])).sum()
}

/// The offset of a surface.
#[derive(Debug)]
pub(super) struct Offset {
    pub(super) shape: SheetShape,
    /// Whether it is in pieces, because the surface has creases.
    pub(super) is_cut: bool,
    /// How far it strays from what it stands for, as a share of its size.
    pub(super) deviation: f64,
}

/// The surface at `distance` from a base, on the side that `side` tells at the middle of its
/// parameters: planes, cylinders, cones, spheres and tori give exact ones, others are fitted. Those
/// of the former stand where their base does.
pub(super) fn surface(base: &Sheet, side: DVec3, distance: f64) -> Result<Offset, Problem> {
    let mut offset = Offset {
        shape: base.shape.clone(),
        is_cut: false,
        deviation: 0.0,
    };
    match &mut offset.shape {
        SheetShape::Quadric(quadric) => {
            let map = base.place.matrix3;
            let Some(scale) = even_scale(map) else {
                let text = "offsets of planes and quadrics that are sheared are not read";
                return Err(Problem::Unsupported(text.to_owned()));
            };
            let side = map.transpose() * side;
            let is_behind = quadric.normal().is_some_and(|n| n.dot(side) < 0.0);
            let distance = if is_behind { -distance } else { distance };
            *quadric = quadric.offset(distance / scale)?;
        }
        SheetShape::Splines(pieces, _) => {
            let mut made = Vec::new();
            for piece in &*pieces {
                let is_behind = middle_normal(piece).dot(side) < 0.0;
                let distance = if is_behind { -distance } else { distance };
                let size = piece.hull_bounds().diagonal() + distance.abs();
                for part in smooth_parts(piece)? {
                    let fit = moved(&part, distance, size * ACCURACY)?;
                    offset.deviation = offset.deviation.max(fit.deviation / size);
                    made.push(fit.surface);
                }
            }
            offset.is_cut = made.len() > pieces.len();
            *pieces = made;
        }
    }
    Ok(offset)
}

/// The normal at the middle of the parameters; nothing if there is none.
fn middle_normal(surface: &Surface) -> DVec3 {
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let middle = DVec2::new(f64::midpoint(u.start, u.end), f64::midpoint(v.start, v.end));
    surface.normal(middle).unwrap_or_default()
}

/// A surface in parts without creases.
fn smooth_parts(surface: &Surface) -> Result<Vec<Surface>, Problem> {
    let [u, v] = [0, 1].map(|axis| creases(surface, axis));
    let count = (u.len() - 1) * (v.len() - 1);
    if count == 1 {
        return Ok(vec![surface.clone()]);
    }
    if count.saturating_mul(surface.homogeneous().len()) > TEARING {
        let text = format!("the offset of a surface in {count} parts between creases is not read");
        return Err(Problem::Unsupported(text));
    }
    let mut parts = Vec::new();
    for u in u.windows(2) {
        let strip = surface.restricted_u(u[0]..u[1]);
        let strip = strip.map_err(Problem::Geometry)?;
        for v in v.windows(2) {
            let part = strip.restricted_v(v[0]..v[1]);
            parts.push(part.map_err(Problem::Geometry)?);
        }
    }
    Ok(parts)
}

/// The parameters along an axis at which a surface has creases across, and both ends.
fn creases(surface: &Surface, axis: usize) -> Vec<f64> {
    let mut knots = [surface.knots_u(), surface.knots_v()];
    knots.rotate_left(axis);
    let [along, across] = knots;
    let normal = |at: f64, beside: f64| {
        let mut uv = [at, beside];
        uv.rotate_right(axis);
        surface.normal(uv.into())
    };
    let beside = across.breaks();
    let beside = beside.windows(2).map(|w| f64::midpoint(w[0], w[1]));
    let beside: Vec<f64> = beside.collect();
    let turns = |knot: f64| {
        let normals = |&beside| normal(knot.next_down(), beside).zip(normal(knot, beside));
        let mut pairs = beside.iter().filter_map(normals);
        pairs.any(|(before, after)| before.angle_between(after) > CORNER)
    };
    let Range { start, end } = along.domain();
    let is_crease = |&knot: &f64| {
        let is_inside = start < knot && knot < end;
        !is_inside || along.multiplicity(knot) >= along.degree() && turns(knot)
    };
    along.breaks().into_iter().filter(is_crease).collect()
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

/// The offset of a surface without creases.
fn moved(
    surface: &Surface,
    distance: f64,
    tolerance: f64,
) -> Result<modelling::FitSurface, Problem> {
    let at = |u: f64, v: f64| {
        let (point, normal) = surface.point_and_normal(DVec2::new(u, v));
        point + normal.unwrap_or_default() * distance
    };
    let breaks = [surface.knots_u().breaks(), surface.knots_v().breaks()];
    modelling::fit_surface(at, &breaks, tolerance).map_err(Problem::Geometry)
}

#[cfg(test)]
mod tests;
