//! Volumes of bodies by other rules than the exact one, for comparison.

use std::fmt;

use glam::DVec3;
use kernel::{Patch, Placement, Scene, Shape, VolumeRule};

use crate::tessellate::Tessellation;
use crate::{Body, TessellateOptions, Tolerance, tessellate};

/// A face is level if its points differ in height by this share of its size at most.
const LEVEL: f64 = 1e-9;

/// How far outermost sections are inside of a body, as a share of its height.
const INSIDE: f64 = 1e-9;

/// A way to find a volume other than by adaptive quadrature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VolumeMethod {
    /// Over the Bézier pieces of faces.
    Pieces(VolumeRule),
    /// Sections between this many slabs, by the trapezoid rule.
    Trapezoid(usize),
    /// Sections in the middle of this many slabs, times their thickness.
    Cavalieri(usize),
}

/// Why a method does not suit a face.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unsuitable {
    /// It is trimmed, and not level.
    Trimmed(String),
    /// It is rational.
    Rational(String),
}

impl fmt::Display for Unsuitable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, what) = match self {
            Self::Trimmed(name) => (name, "trimmed"),
            Self::Rational(name) => (name, "rational"),
        };
        write!(f, "the face '{name}' is {what}; --method gauss measures it")
    }
}

impl std::error::Error for Unsuitable {}

/// The volume of a body by `method`.
///
/// Rules over pieces take the volume between faces and the z axis; level faces have none, and
/// may be trimmed. Sections lie at right angles to the z axis, and are those of the triangles of
/// [`sections`].
///
/// # Errors
/// If a face does not suit the method.
pub fn body_volume(
    scene: &Scene,
    body: &Body,
    method: VolumeMethod,
    triangles: &Tessellation,
) -> Result<f64, Unsuitable> {
    let placements = scene.placements();
    let faces = body.sides.iter().filter_map(|side| {
        let placement = &placements[side.placement];
        match placement.shape {
            Shape::Patch(id) => Some((placement, id, side.sign)),
            Shape::Mesh(_) => None,
        }
    });
    match method {
        VolumeMethod::Pieces(rule) => {
            let mut sum = 0.0;
            for (placement, id, sign) in faces {
                sum += sign * face_volume(placement, scene.patch(id), rule)?;
            }
            Ok(sum)
        }
        VolumeMethod::Trapezoid(count) | VolumeMethod::Cavalieri(count) => {
            let mut solid = Solid::default();
            for (placement, id, sign) in faces {
                let Some(face) = &triangles.faces[id.index()] else {
                    continue;
                };
                let sign = if face.flipped { -sign } else { sign };
                let place = |k: u32| {
                    let point = face.mesh.positions()[k as usize];
                    placement.world_from_object.transform_point3(point)
                };
                let corners = face.mesh.triangles().iter().map(|t| (t.map(place), sign));
                solid.triangles.extend(corners);
            }
            Ok(match method {
                VolumeMethod::Trapezoid(_) => solid.trapezoid(count),
                _ => solid.cavalieri(count),
            })
        }
    }
}

/// Triangles for sections: finer than what sections are used for.
pub fn sections(scene: &Scene) -> Tessellation {
    let options = TessellateOptions {
        tolerance: Tolerance::Relative(2e-5),
        ..TessellateOptions::default()
    };
    tessellate(scene, &options)
}

/// The volume between a face and the z axis.
fn face_volume(placement: &Placement, patch: &Patch, rule: VolumeRule) -> Result<f64, Unsuitable> {
    let surface = patch.surface.transformed(&placement.world_from_object);
    let bounds = surface.hull_bounds();
    if bounds.max.z - bounds.min.z <= LEVEL * bounds.diagonal() {
        return Ok(0.0);
    }
    if patch.region().is_some() {
        return Err(Unsuitable::Trimmed(patch.name.clone()));
    }
    let pieces = surface.bezier_pieces();
    let volumes = pieces.iter().map(|piece| piece.volume(rule));
    let sum: Option<f64> = volumes.sum();
    sum.ok_or_else(|| Unsuitable::Rational(patch.name.clone()))
}

/// Triangles around a body, and 1 or -1 as they look out of it or into it.
#[derive(Default)]
struct Solid {
    triangles: Vec<([DVec3; 3], f64)>,
}

impl Solid {
    fn heights(&self) -> [f64; 2] {
        let heights = || self.triangles.iter().flat_map(|(t, _)| t.map(|p| p.z));
        [
            heights().fold(f64::INFINITY, f64::min),
            heights().fold(f64::NEG_INFINITY, f64::max),
        ]
    }

    /// The area of the section at a height, by Gauss's formula over the sides that triangles
    /// leave in it.
    fn area(&self, z: f64) -> f64 {
        let mut sum = 0.0;
        for (corners, sign) in &self.triangles {
            let mut cuts = Vec::new();
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                if (a.z < z) != (b.z < z) {
                    let cut = a.lerp(b, (z - a.z) / (b.z - a.z)).truncate();
                    // Downwards first: outwards is then to the right.
                    cuts.push((a.z < z, cut));
                }
            }
            if let [(is_up, a), (_, b)] = cuts[..] {
                let turn = if is_up { b.perp_dot(a) } else { a.perp_dot(b) };
                sum += turn * sign;
            }
        }
        0.5 * sum.abs()
    }

    fn trapezoid(&self, slabs: usize) -> f64 {
        let [low, high] = self.heights();
        let (height, inside) = (high - low, (high - low) * INSIDE);
        let area = |k: usize| {
            let z = low + height * k as f64 / slabs as f64;
            let weight = if k == 0 || k == slabs { 0.5 } else { 1.0 };
            weight * self.area(z.clamp(low + inside, high - inside))
        };
        (0..=slabs).map(area).sum::<f64>() * height / slabs as f64
    }

    fn cavalieri(&self, slabs: usize) -> f64 {
        let [low, high] = self.heights();
        let height = high - low;
        let area = |k: usize| self.area(low + height * (k as f64 + 0.5) / slabs as f64);
        (0..slabs).map(area).sum::<f64>() * height / slabs as f64
    }
}
