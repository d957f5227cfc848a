//! `Extrusion`: a cross-section along a spine, as one exact surface of degree one, with caps
//! that are flat faces cut along the section.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec2, DVec3, Vec2Swizzles as _};
use kernel::modelling::plane;
use kernel::{Curve, Error as GeometryError, KnotVector, Patch, Surface, TrimLoop};

use super::Node;
use super::scene::{Converter, turn};
use super::solids::in_frame;
use crate::Error;

impl Converter<'_> {
    /// The side of an extrusion, and its caps.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn extrusion(
        &mut self,
        node: &Node,
    ) -> Result<Result<Vec<Patch>, GeometryError>, Error> {
        let mut section = node.points_2d("crossSection", &mut self.warnings);
        if section.is_empty() {
            section = [(1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1)]
                .map(|(x, z)| DVec2::new(f64::from(x), f64::from(z)))
                .into();
        }
        let mut spine = node.points_3d("spine", &mut self.warnings);
        if spine.is_empty() {
            spine = vec![DVec3::ZERO, DVec3::Y];
        }
        self.count_product([section.len(), spine.len()], node)?;
        let mut scales = node.points_2d("scale", &mut self.warnings);
        if scales.is_empty() {
            scales.push(DVec2::ONE);
        }
        let turns = self.orientations(node);
        let frames = frames(&spine);
        let map = |i: usize| {
            let turn = turns.get(i).or(turns.last()).copied().unwrap_or_default();
            let scale = scales
                .get(i)
                .or(scales.last())
                .copied()
                .unwrap_or(DVec2::ONE);
            (frames[i] * DMat3::from_quat(turn), scale)
        };
        let mut points = Vec::new();
        for (i, &place) in spine.iter().enumerate() {
            let (axes, scale) = map(i);
            points.extend(section.iter().map(|p| {
                let p = *p * scale;
                place + axes * DVec3::new(p.x, 0.0, p.y)
            }));
        }
        let turned = !node.flag("ccw", true, &mut self.warnings);
        let side = || {
            let (u, v) = (polyline_knots(section.len())?, polyline_knots(spine.len())?);
            let side = Patch::from(Surface::from_u_fastest(u, v, &points, None)?);
            if turned {
                self.reversed(side)
            } else {
                Ok(side)
            }
        };
        let mut patches = match side() {
            Ok(side) => vec![side],
            Err(problem) => return Ok(Err(problem)),
        };
        for (field, i) in [("beginCap", 0), ("endCap", spine.len() - 1)] {
            if node.flag(field, true, &mut self.warnings) {
                let (axes, scale) = map(i);
                let section: Vec<_> = section.iter().map(|p| *p * scale).collect();
                match cap(&section, spine[i], axes, (i == 0) == turned) {
                    Ok(Some((mut cap, size))) => {
                        // The larger side of the section is that of the picture.
                        let size = size / size.max_element();
                        if self.is_pictured {
                            let [u, v] = if (i == 0) == turned {
                                [DVec3::Y * size.y, DVec3::X * size.x]
                            } else {
                                [DVec3::X * size.x, DVec3::Y * size.y]
                            };
                            let texture = plane(DVec3::ZERO, u, v, 0.0..1.0, 0.0..1.0);
                            cap.texture = texture.ok().map(Arc::new);
                        }
                        patches.push(cap);
                    }
                    Ok(None) => {}
                    Err(problem) => return Ok(Err(problem)),
                }
            }
        }
        Ok(Ok(patches))
    }

    /// The rotations of the sections.
    fn orientations(&mut self, node: &Node) -> Vec<DQuat> {
        let numbers = node.numbers("orientation", &mut self.warnings);
        let (turns, _) = numbers.as_chunks();
        turns.iter().map(|&t| turn(t, node)).collect()
    }
}

fn polyline_knots(count: usize) -> Result<KnotVector, GeometryError> {
    KnotVector::clamped_uniform(1, count, 0.0..count.saturating_sub(1) as f64)
}

/// The flat face inside a section, and how large that is; nothing if it has no area.
fn cap(
    section: &[DVec2],
    place: DVec3,
    axes: DMat3,
    upwards: bool,
) -> Result<Option<(Patch, DVec2)>, GeometryError> {
    let Some((low, size, mut border)) = in_frame(section) else {
        return Ok(None);
    };
    let corner = place + axes * DVec3::new(low.x, 0.0, low.y);
    let (mut u, mut v) = (axes.x_axis * size.x, axes.z_axis * size.y);
    if upwards {
        (u, v) = (v, u);
        border = border.iter().map(|p| p.yx()).collect();
    }
    if let Some(&first) = border.first().filter(|&first| Some(first) != border.last()) {
        border.push(first);
    }
    let patch = Patch::from(plane(corner, u, v, 0.0..1.0, 0.0..1.0)?);
    let loops = vec![TrimLoop::new(vec![Curve::polyline(&border)?], 0.0)?];
    Ok(Some((Patch { loops, ..patch }, size)))
}

/// For each point of a spine the axes of the plane that the section lies in: x, along the
/// spine, z (ISO/IEC 14772-1, 6.18).
pub(super) fn frames(spine: &[DVec3]) -> Vec<DMat3> {
    let n = spine.len();
    let closed = n > 2 && spine[0] == spine[n - 1];
    // The points before and after each one; ends of open spines have only one neighbour.
    let around = |i: usize| match (i, closed) {
        (0, true) => (spine[n - 2], spine[1]),
        (i, true) if i == n - 1 => (spine[n - 2], spine[1]),
        _ => (spine[i.saturating_sub(1)], spine[(i + 1).min(n - 1)]),
    };
    let along: Vec<_> = (0..n)
        .map(|i| (around(i).1 - around(i).0).try_normalize())
        .collect();
    let along = filled(&along).unwrap_or_else(|| vec![DVec3::Y; n]);
    let across: Vec<_> = (0..n)
        .map(|i| {
            let (before, after) = around(i);
            let [a, b] = [after, before].map(|p| (p - spine[i]).normalize_or_zero());
            Some(a.cross(b)).filter(|z| z.length() > STRAIGHT)
        })
        .map(|z| z.and_then(DVec3::try_normalize))
        .collect();
    // A straight spine: what turns its direction out of the y axis turns z, too.
    let mut across = filled(&across)
        .unwrap_or_else(|| vec![DQuat::from_rotation_arc(DVec3::Y, along[0]) * DVec3::Z; n]);
    for i in 1..n {
        if across[i].dot(across[i - 1]) < 0.0 {
            across[i] = -across[i];
        }
    }
    along
        .iter()
        .zip(&across)
        .map(|(&y, &z)| {
            let x = y.cross(z).normalize_or(y.any_orthonormal_vector());
            DMat3::from_cols(x, y, x.cross(y))
        })
        .collect()
}

/// Segments that meet in less than this angle, in radians, are one straight line.
const STRAIGHT: f64 = 1e-7;

/// The list with its gaps filled from the last entry before them, or the first one after.
fn filled(list: &[Option<DVec3>]) -> Option<Vec<DVec3>> {
    let mut last = list.iter().copied().flatten().next()?;
    let fill = |entry: &Option<DVec3>| {
        last = entry.unwrap_or(last);
        last
    };
    Some(list.iter().map(fill).collect())
}
