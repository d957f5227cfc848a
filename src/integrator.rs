//! From a hit to a colour: classic local models, shadows and transparency.

use std::ops::Range;

use glam::DVec3;
use kernel::{Camera, Light, LightKind, Material, Ray, Scene};

use crate::accelerator::{Accelerator, Workspace};
use crate::intersect::Hit;
use crate::look::Look;

/// How surfaces are shaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shading {
    /// Phong's mirror direction \[Phong 75\].
    #[default]
    Phong,
    /// Blinn's half vector \[Blinn 77\].
    Blinn,
    /// No colours: data channels only.
    None,
}

/// Surfaces seen through one another, at most.
const LAYERS: usize = 16;

/// What remains visible below this share is not followed.
const LEAST_SHARE: f64 = 1.0 / 512.0;

/// Light that is everywhere, as a share of white.
const AMBIENT: f64 = 0.12;

/// Phong's exponent for the same size of highlight, per exponent of Blinn's half vector.
const PHONG_EXPONENT: f64 = 0.25;

/// Everything that shading needs besides the hit.
#[derive(Debug)]
pub(crate) struct Integrator<'a> {
    accelerator: &'a Accelerator<'a>,
    lights: Vec<ActiveLight>,
    ambient: DVec3,
    shading: Shading,
    /// Whether some material lets light through.
    transparent: bool,
    fallback: Material,
    size: f64,
}

#[derive(Debug)]
struct ActiveLight {
    light: Light,
    /// Light from the camera itself throws no shadow that it could see.
    shadows: bool,
}

/// What a light adds to the colour of a hit, and where it stands.
struct Lit {
    color: DVec3,
    direction: DVec3,
    reach: f64,
}

/// A colour with its coverage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Radiance {
    pub(crate) color: DVec3,
    pub(crate) coverage: f64,
}

impl<'a> Integrator<'a> {
    pub(crate) fn new(accelerator: &'a Accelerator<'a>, camera: &Camera, shading: Shading) -> Self {
        let scene = accelerator.scene();
        let lights = lights(scene, camera);
        let ambient = lights.iter().map(|l| l.light.ambient).sum::<DVec3>() + AMBIENT;
        Self {
            accelerator,
            lights,
            ambient,
            shading,
            transparent: is_transparent(scene),
            fallback: Material::default(),
            size: accelerator.bounds().diagonal(),
        }
    }

    /// The light that comes back along each of many rays, which should run side by side.
    /// Counts the rays it sends in `count`.
    pub(crate) fn radiances(
        &self,
        rays: &[Ray],
        hits: &[Option<Hit>],
        workspace: &mut Workspace,
        count: &mut u64,
    ) -> Vec<Radiance> {
        if self.transparent {
            let shots = rays.iter().zip(hits);
            return shots
                .map(|(ray, hit)| match hit {
                    Some(hit) => self.radiance(ray, hit, workspace, count),
                    None => Radiance::default(),
                })
                .collect();
        }
        let looks: Vec<Option<Look>> = rays
            .iter()
            .zip(hits)
            .map(|(ray, hit)| hit.as_ref().map(|hit| self.look(ray, hit)))
            .collect();
        let mut light: Vec<_> = looks
            .iter()
            .map(|look| match look {
                Some(look) => Radiance {
                    color: self.unlit(look),
                    coverage: 1.0,
                },
                None => Radiance::default(),
            })
            .collect();
        let (mut shadows, mut ranges, mut pending) = (Vec::new(), Vec::new(), Vec::new());
        let mut blocked = Vec::new();
        for active in &self.lights {
            shadows.clear();
            ranges.clear();
            pending.clear();
            for (number, (ray, (hit, look))) in rays.iter().zip(hits.iter().zip(&looks)).enumerate()
            {
                let (Some(hit), Some(look)) = (hit, look) else {
                    continue;
                };
                let Some(lit) = self.lit(ray, hit, look, &active.light) else {
                    continue;
                };
                if !active.shadows {
                    light[number].color += lit.color;
                    continue;
                }
                let (shadow, range) = self.towards(ray, hit, &lit);
                shadows.push(shadow);
                ranges.push(range);
                pending.push((number, lit.color));
            }
            *count += shadows.len() as u64;
            self.accelerator
                .any_many(&shadows, &ranges, workspace, &mut blocked);
            for (&(number, color), _) in pending.iter().zip(&blocked).filter(|(_, b)| !**b) {
                light[number].color += color;
            }
        }
        light
    }

    /// The material at a hit, of the side that the ray meets.
    fn look(&self, ray: &Ray, hit: &Hit) -> Look {
        let mut material = self.accelerator.material(hit).unwrap_or(&self.fallback);
        if let Some(back) = &material.back
            && hit.normal.dot(ray.direction) > 0.0
        {
            material = back;
        }
        let mut look = Look::from(material);
        if !material.maps.is_empty()
            && let Some(st) = self.accelerator.texture_coordinates(hit)
        {
            look = Look::textured(material, st);
        }
        match self.accelerator.vertex_color(hit) {
            Some(color) => look.tinted(material, color),
            None => look,
        }
    }

    /// The light that comes back along `ray` from its first hit and, where that is
    /// transparent, from what lies behind. Counts the rays it sends in `rays`.
    fn radiance(
        &self,
        ray: &Ray,
        first: &Hit,
        workspace: &mut Workspace,
        rays: &mut u64,
    ) -> Radiance {
        let mut hit = *first;
        let (mut sum, mut share) = (Radiance::default(), 1.0);
        for _ in 0..LAYERS {
            let look = self.look(ray, &hit);
            if look.opacity > 0.0 {
                let local = self.local(ray, &hit, &look, workspace, rays);
                sum.color += local * (share * look.opacity);
            }
            share *= 1.0 - look.opacity;
            if share < LEAST_SHARE {
                break;
            }
            let (behind, range) = self.leave(ray, &hit, ray.direction);
            *rays += 1;
            match self.accelerator.nearest(&behind, range, workspace) {
                Some(next) => hit = next,
                None => break,
            }
        }
        sum.coverage = 1.0 - share;
        sum
    }

    /// The local model at one hit.
    fn local(
        &self,
        ray: &Ray,
        hit: &Hit,
        look: &Look,
        workspace: &mut Workspace,
        rays: &mut u64,
    ) -> DVec3 {
        let mut color = self.unlit(look);
        for ActiveLight { light, shadows } in &self.lights {
            let Some(lit) = self.lit(ray, hit, look, light) else {
                continue;
            };
            let visible = if *shadows {
                self.visibility(ray, hit, &lit, workspace, rays)
            } else {
                1.0
            };
            color += lit.color * visible;
        }
        color
    }

    /// What needs no light in particular.
    fn unlit(&self, look: &Look) -> DVec3 {
        look.emissive + look.ambient * self.ambient
    }

    /// What one light adds where nothing is in its way; `None` where it does not shine.
    fn lit(&self, ray: &Ray, hit: &Hit, look: &Look, light: &Light) -> Option<Lit> {
        let view = -ray.direction.normalize();
        // Both sides of a surface are lit; without a normal it faces the viewer.
        let normal = match hit.normal.dot(view) {
            0.0 if hit.normal == DVec3::ZERO => view,
            cosine if cosine < 0.0 => -hit.normal,
            _ => hit.normal,
        };
        let (direction, reach, strength) = arrival(light, hit.point)?;
        let cosine = normal.dot(direction);
        if cosine <= 0.0 || strength <= 0.0 {
            return None;
        }
        let highlight = match self.shading {
            Shading::Blinn => {
                let half = (direction + view).normalize_or_zero();
                half.dot(normal).max(0.0).powf(look.shininess)
            }
            _ => {
                let mirrored = normal * (2.0 * cosine) - direction;
                mirrored
                    .dot(view)
                    .max(0.0)
                    .powf(look.shininess * PHONG_EXPONENT)
            }
        };
        let reflected = look.diffuse * cosine + look.specular * highlight;
        Some(Lit {
            color: reflected * light.color * strength,
            direction,
            reach,
        })
    }

    /// The ray from a hit towards a light.
    fn towards(&self, ray: &Ray, hit: &Hit, lit: &Lit) -> (Ray, Range<f64>) {
        let (shadow, mut range) = self.leave(ray, hit, lit.direction);
        range.end = lit.reach - (shadow.origin - hit.point).dot(lit.direction);
        (shadow, range)
    }

    /// The share of a light that arrives through what may be transparent.
    fn visibility(
        &self,
        ray: &Ray,
        hit: &Hit,
        lit: &Lit,
        workspace: &mut Workspace,
        rays: &mut u64,
    ) -> f64 {
        let (mut shadow, mut range) = self.towards(ray, hit, lit);
        *rays += 1;
        let mut share = 1.0;
        for _ in 0..LAYERS {
            let Some(blocker) = self.accelerator.nearest(&shadow, range.clone(), workspace) else {
                return share;
            };
            share *= 1.0 - self.look(&shadow, &blocker).opacity;
            if share < LEAST_SHARE {
                return 0.0;
            }
            let (next, _) = self.leave(&shadow, &blocker, lit.direction);
            range.end -= blocker.t;
            shadow = next;
            *rays += 1;
        }
        share
    }

    /// A ray that leaves the surface at `hit` along `direction`, without meeting that very
    /// point again: it starts off the surface by the error of the point, on the side to
    /// which it goes.
    fn leave(&self, ray: &Ray, hit: &Hit, direction: DVec3) -> (Ray, Range<f64>) {
        let normal = if hit.normal == DVec3::ZERO {
            -ray.direction.normalize()
        } else {
            hit.normal
        };
        let side = if normal.dot(direction) < 0.0 {
            -normal
        } else {
            normal
        };
        // Far above the error of the point, far below the accuracy that is promised.
        let offset = side * (hit.error * 100.0).max(self.size * 1e-12);
        (
            Ray {
                origin: hit.point + offset,
                direction,
            },
            0.0..f64::INFINITY,
        )
    }
}

/// Whether something lets light through.
fn is_transparent(scene: &Scene) -> bool {
    let backs = scene.materials().iter().filter_map(|m| m.back.as_deref());
    let mut materials = scene.materials().iter().chain(backs);
    let mut colors = scene.meshes().iter().flat_map(|mesh| mesh.colors());
    materials.any(|m| m.opacity < 1.0 || m.maps.opacity.is_some()) || colors.any(|c| c.w < 1.0)
}

/// Direction to a light, distance, and the share of its colour that reaches `point`.
fn arrival(light: &Light, point: DVec3) -> Option<(DVec3, f64, f64)> {
    match light.kind {
        LightKind::Directional { direction } => {
            Some((-direction.try_normalize()?, f64::INFINITY, 1.0))
        }
        LightKind::Point { position, falloff } => {
            let reach = position.distance(point);
            Some((
                (position - point).try_normalize()?,
                reach,
                falloff.at(reach),
            ))
        }
        LightKind::Spot {
            position,
            direction,
            inner,
            outer,
            falloff,
        } => {
            let reach = position.distance(point);
            let towards = (position - point).try_normalize()?;
            let angle = direction
                .try_normalize()?
                .dot(-towards)
                .clamp(-1.0, 1.0)
                .acos();
            let cone = if angle <= inner {
                1.0
            } else if angle >= outer {
                0.0
            } else {
                (outer - angle) / (outer - inner)
            };
            Some((towards, reach, cone * falloff.at(reach)))
        }
    }
}

/// The scene's lights, or three good ones placed relative to the camera; and the headlight.
fn lights(scene: &Scene, camera: &Camera) -> Vec<ActiveLight> {
    let (right, up, forward) = (camera.right(), camera.up(), camera.forward());
    let parallel = |direction: DVec3, brightness: f64, shadows| ActiveLight {
        light: Light {
            kind: LightKind::Directional { direction },
            color: DVec3::splat(brightness),
            ambient: DVec3::ZERO,
        },
        shadows,
    };
    if scene.lights.is_empty() {
        return vec![
            parallel(right * 0.7 - up * 0.9 + forward * 0.8, 0.80, true),
            parallel(-right * 0.9 - up * 0.3 + forward * 0.6, 0.22, true),
            parallel(-right * 0.3 - up * 0.7 - forward * 0.8, 0.25, true),
            parallel(forward, 0.18, false),
        ];
    }
    let mut lights: Vec<_> = scene
        .lights
        .iter()
        .map(|&light| ActiveLight {
            light,
            shadows: true,
        })
        .collect();
    if scene.headlight {
        lights.push(parallel(forward, 1.0, false));
    }
    lights
}
