//! Volumes of bodies by other rules than the exact one, for comparison.

use std::fmt;

use glam::{DAffine3, DMat3, DVec3};
use kernel::{Patch, Scene, Shape, UpAxis, VolumeRule};

use crate::{Body, TessellateError, TessellateOptions, Tolerance, tessellate};

/// How far triangles are from the surfaces for sections, as a share of the size of the scene.
const TOLERANCE: f64 = 2e-5;

/// A face is level if its points differ in height by this share of its size at most.
const LEVEL: f64 = 1e-9;

/// How far outermost sections are inside of a body, as a share of its height.
const INSIDE: f64 = 1e-9;

/// A way to find a volume other than by adaptive quadrature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VolumeMethod {
    /// Over the Bézier pieces of faces.
    Pieces(VolumeRule),
    /// By sections of as many slabs.
    Slices(SliceRule, usize),
}

/// How sections make a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SliceRule {
    /// Sections between slabs, by the trapezoid rule.
    Trapezoid,
    /// Sections in the middles of slabs, times their thickness.
    Cavalieri,
}

/// Why a method does not suit a face.
#[derive(Clone, Debug, PartialEq)]
pub enum Unsuitable {
    /// It is trimmed, and not level.
    Trimmed(String),
    /// It is rational.
    Rational(String),
    /// Triangles for sections have too many points.
    Large(TessellateError),
}

impl fmt::Display for Unsuitable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, what) = match self {
            Self::Trimmed(name) => (name, "trimmed"),
            Self::Rational(name) => (name, "rational"),
            Self::Large(error) => return error.fmt(f),
        };
        write!(f, "the face {name} is {what}; --method gauss measures it")
    }
}

impl std::error::Error for Unsuitable {}

/// The volumes of bodies by `method`.
///
/// Rules over pieces take the volume between faces and an upright axis; level faces have none,
/// and may be trimmed. Sections are level, and those of triangles within 2e-5 of the size of the
/// scene.
///
/// # Errors
/// If a face does not suit the method, or the scene is too large for it.
pub fn volumes(
    scene: &Scene,
    bodies: &[Body],
    method: VolumeMethod,
) -> Result<Vec<f64>, Unsuitable> {
    let placements = scene.placements();
    // All with z upwards.
    let upright = DAffine3::from_mat3(match scene.up {
        UpAxis::Y => DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
        UpAxis::Z => DMat3::IDENTITY,
    });
    let faces = |body: &Body| {
        let sides = body
            .sides
            .iter()
            .map(|side| (&placements[side.placement], side.sign));
        let faces = sides.filter_map(|(placement, sign)| match placement.shape {
            Shape::Patch(id) => Some((upright * placement.world_from_object, id, sign)),
            Shape::Mesh(_) => None,
        });
        faces.collect::<Vec<_>>()
    };
    let (rule, slabs) = match method {
        VolumeMethod::Slices(rule, slabs) => (rule, slabs),
        VolumeMethod::Pieces(rule) => {
            let volume = |body: &Body| -> Result<f64, Unsuitable> {
                let mut sum = 0.0;
                for (place, id, sign) in faces(body) {
                    sum += sign * face_volume(&place, scene.patch(id), rule)?;
                }
                Ok(sum)
            };
            return bodies.iter().map(volume).collect();
        }
    };
    let options = TessellateOptions {
        tolerance: Tolerance::Relative(TOLERANCE),
        ..TessellateOptions::default()
    };
    let triangles = tessellate(scene, &options).map_err(Unsuitable::Large)?;
    let volume = |body: &Body| {
        let mut solid = Solid::default();
        for (place, id, sign) in faces(body) {
            let Some(face) = &triangles.faces[id.index()] else {
                continue;
            };
            let sign = if face.flipped { -sign } else { sign };
            let corner = |k: u32| place.transform_point3(face.mesh.positions()[k as usize]);
            let corners = face.mesh.triangles().iter().map(|t| (t.map(corner), sign));
            solid.triangles.extend(corners);
        }
        match rule {
            SliceRule::Trapezoid => solid.trapezoid(slabs),
            SliceRule::Cavalieri => solid.cavalieri(slabs),
        }
    };
    Ok(bodies.iter().map(volume).collect())
}

/// The volume between a face and the z axis.
fn face_volume(place: &DAffine3, patch: &Patch, rule: VolumeRule) -> Result<f64, Unsuitable> {
    let surface = patch.surface.transformed(place);
    let bounds = surface.hull_bounds();
    if bounds.max.z - bounds.min.z <= LEVEL * bounds.diagonal() {
        return Ok(0.0);
    }
    if patch.region().is_some() {
        return Err(Unsuitable::Trimmed(shown(patch)));
    }
    let pieces = surface.bezier_pieces();
    let volumes = pieces.iter().map(|piece| piece.volume(rule));
    let sum: Option<f64> = volumes.sum();
    sum.ok_or_else(|| Unsuitable::Rational(shown(patch)))
}

/// The name of a face, and where it is in the file.
fn shown(patch: &Patch) -> String {
    format!("'{}' ({})", patch.name, patch.source)
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
