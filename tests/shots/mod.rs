//! Rays at surfaces: across, along, and past their silhouettes.

use std::f64::consts::TAU;
use std::ops::Range;

use fastrand::Rng;
use glam::{DVec2, DVec3};
use kernel::{Patch, Ray, Scene, Shape, Surface, SurfaceDerivatives, TrimRegion};

fn direction(dice: &mut Rng) -> DVec3 {
    let mut step = || dice.f64() * 2.0 - 1.0;
    DVec3::new(step(), step(), step()).normalize_or(DVec3::X)
}

/// A random direction along a surface.
fn tangent(d: &SurfaceDerivatives, dice: &mut Rng) -> Option<DVec3> {
    let turned = TAU * dice.f64();
    let along = d.du.normalize_or_zero() * turned.cos() + d.dv.normalize_or_zero() * turned.sin();
    along.try_normalize()
}

/// The faces of a scene in the world, and what belongs to them.
pub(crate) struct Targets {
    faces: Vec<(Surface, Option<TrimRegion>)>,
    size: f64,
}

impl Targets {
    pub(crate) fn of(scene: &Scene, size: f64) -> Self {
        let regions: Vec<_> = scene.patches().iter().map(Patch::region).collect();
        let faces = scene.placements().into_iter().filter_map(|place| {
            let Shape::Patch(id) = place.shape else {
                return None;
            };
            let surface = &scene.patch(id).surface;
            let region = regions[id.index()].clone();
            Some((surface.transformed(&place.world_from_object), region))
        });
        Self {
            faces: faces.collect(),
            size,
        }
    }

    /// A random face, and what belongs to it.
    fn face(&self, dice: &mut Rng) -> Option<&(Surface, Option<TrimRegion>)> {
        let choice = dice.f64() * self.faces.len() as f64;
        let (_, face) = (1_u32..)
            .zip(&self.faces)
            .find(|(k, _)| choice < f64::from(*k))?;
        Some(face)
    }

    /// A ray past a random point of a face: across, tangential, or tangential with a small
    /// offset.
    pub(crate) fn ray(&self, dice: &mut Rng) -> Option<Ray> {
        let (surface, region) = self.face(dice)?;
        let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
        let place = |_| {
            DVec2::new(
                u.start + (u.end - u.start) * dice.f64(),
                v.start + (v.end - v.start) * dice.f64(),
            )
        };
        let belongs = |uv: &DVec2| region.as_ref().is_none_or(|region| region.contains(*uv));
        let uv = (0..100).map(place).find(belongs)?;
        let d = surface.derivatives(uv);
        let normal = surface.normal(uv)?;
        let along = tangent(&d, dice)?;
        let kind = dice.f64();
        let (direction, offset) = if kind < 0.3 {
            (direction(dice), 0.0)
        } else {
            let tilt = if kind < 0.6 {
                0.0
            } else {
                10.0_f64.powf(-8.0 * dice.f64())
            };
            let offset = 10.0_f64.powf(-1.0 - 10.0 * dice.f64());
            let side = if dice.f64() < 0.5 { -1.0 } else { 1.0 };
            ((along + normal * tilt).normalize(), offset * side)
        };
        let point = d.point + normal * (offset * self.size);
        Some(Ray {
            origin: point - direction * (self.size * (0.2 + 2.0 * dice.f64())),
            direction: direction * (0.5 + dice.f64()),
        })
    }

    /// A ray along an axis, or exactly along a face in the middle, at a border or in a corner of it.
    fn straight(&self, dice: &mut Rng) -> Option<Ray> {
        let (surface, _) = self.face(dice)?;
        let place = |domain: Range<f64>, dice: &mut Rng| {
            let share = [0.0, 0.25, 0.5, 1.0, dice.f64(), dice.f64()][dice.usize(0..6)];
            domain.start + (domain.end - domain.start) * share
        };
        let u = place(surface.knots_u().domain(), dice);
        let v = place(surface.knots_v().domain(), dice);
        let d = surface.derivatives(DVec2::new(u, v));
        let axis = DVec3::AXES[dice.usize(0..3)];
        let along = [axis, axis, d.du, d.dv][dice.usize(0..4)].try_normalize()?;
        let direction = if dice.bool() { along } else { -along };
        let origin = d.point - direction * (self.size * (0.2 + 2.0 * dice.f64()));
        Some(Ray { origin, direction })
    }

    /// Rays that leave a face side by side in one direction, nearly along it, as towards a light.
    fn leaving(&self, dice: &mut Rng, count: u32) -> Option<Vec<Ray>> {
        let (surface, _) = self.face(dice)?;
        let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
        let (start, size) = (
            DVec2::new(u.start, v.start),
            DVec2::new(u.end - u.start, v.end - v.start),
        );
        let corner = DVec2::new(dice.f64(), dice.f64());
        let apart = 10.0_f64.powf(-2.0 - 3.0 * dice.f64());
        let places: Vec<_> = (0..count)
            .map(|k| {
                let step = DVec2::new(f64::from(k % 8), f64::from(k / 8)) * apart;
                start + size * (corner + step).min(DVec2::splat(0.999))
            })
            .collect();
        let first = *places.first()?;
        let (d, normal) = (surface.derivatives(first), surface.normal(first)?);
        let along = tangent(&d, dice)?;
        let tilt = 10.0_f64.powf(-4.0 * dice.f64());
        let direction = (along + normal * tilt).normalize();
        let offset = self.size * 10.0_f64.powf(-12.0 + 4.0 * dice.f64());
        let ray = |&uv: &DVec2| {
            let normal = surface.normal(uv)?;
            let side = normal.dot(direction).signum();
            Some(Ray {
                origin: surface.derivatives(uv).point + normal * side * offset,
                direction,
            })
        };
        places.iter().map(ray).collect()
    }

    /// Rays side by side that leave a face, as [`Self::leaving`], or the first of which is
    /// [`Self::ray`]: from its origin or along it, as far apart as pixels, or much nearer.
    #[allow(dead_code, reason = "each test uses a part of this file")]
    pub(crate) fn bundle(&self, dice: &mut Rng, count: u32) -> Vec<Ray> {
        if dice.f64() < 0.25 {
            return self.leaving(dice, count).unwrap_or_default();
        }
        let ray = self.ray(dice);
        ray.map_or_else(Vec::new, |ray| self.beside(&ray, dice, count))
    }

    /// As [`Self::bundle`] about [`Self::straight`], as from a camera that looks straight ahead.
    #[allow(dead_code, reason = "each test uses a part of this file")]
    pub(crate) fn ahead(&self, dice: &mut Rng, count: u32) -> Vec<Ray> {
        let ray = self.straight(dice);
        ray.map_or_else(Vec::new, |ray| self.beside(&ray, dice, count))
    }

    fn beside(&self, ray: &Ray, dice: &mut Rng, count: u32) -> Vec<Ray> {
        let (right, up) = ray.direction.normalize().any_orthonormal_pair();
        let apart = 10.0_f64.powf(-2.0 - 4.0 * dice.f64()) * ray.direction.length();
        let parallel = dice.f64() < 0.3;
        let beside = |k: u32| {
            let shift = (right * f64::from(k % 8) + up * f64::from(k / 8)) * apart;
            if parallel {
                let origin = ray.origin + shift * self.size / ray.direction.length();
                Ray { origin, ..*ray }
            } else {
                let direction = ray.direction + shift;
                Ray { direction, ..*ray }
            }
        };
        (0..count).map(beside).collect()
    }
}
