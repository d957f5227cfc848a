//! From a hit to a colour: classic local models, shadows and transparency.

use std::ops::Range;

use glam::DVec3;
use kernel::{Camera, Child, Light, Material, Ray, Scene};

use crate::accelerator::{Accelerator, Start, Workspace};
use crate::intersect::Hit;
use crate::lights::{self, ActiveLight, arrival};
use crate::look::Look;
use crate::memory::reserve;

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

/// Surfaces seen through one another, at most; what is behind them is not seen, and no light comes from there.
const LAYERS: usize = 4096;

/// Surfaces that are no more than so many errors of their points apart are at one place.
const COINCIDENT: f64 = 8.0;

/// What remains visible below this share is not followed.
const LEAST_SHARE: f64 = 1.0 / 512.0;

/// Rays leave a surface from a point this many times its error beside it.
pub(crate) const LEAVE: f64 = 1e4;

/// Rays leave a gap from this many times its width beside it.
const LEAVE_GAP: f64 = 2.0;

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
    /// Whether shapes have different materials.
    mixed: bool,
    fallback: Material,
    size: f64,
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

/// How a surface stands to a ray.
struct Facing {
    /// Back along the ray, of length one.
    view: DVec3,
    /// Towards the side that the ray sees; without a normal the surface faces the viewer.
    normal: DVec3,
}

impl Facing {
    fn new(ray: &Ray, hit: &Hit) -> Self {
        let view = -ray.direction.normalize();
        let normal = match hit.normal.dot(view) {
            0.0 if hit.normal == DVec3::ZERO => view,
            cosine if cosine < 0.0 => -hit.normal,
            _ => hit.normal,
        };
        Self { view, normal }
    }
}

/// A surface that a ray sees, and how much of it.
struct Layer {
    /// The number of the ray.
    ray: usize,
    hit: Hit,
    share: f64,
    /// What touches it from behind, the last first, once that has been looked for.
    touching: Option<Vec<Hit>>,
}

impl Layer {
    /// Whether something is left that touches it from behind.
    fn is_touched(&self) -> bool {
        self.touching
            .as_ref()
            .is_some_and(|found| !found.is_empty())
    }
}

/// Puts together what lies at one depth, apart from the rest by more than the bundle of rays is wide where it
/// first meets something: rays that leave from there run side by side.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "any order is right"
)]
fn sort_by_depth(rays: &[Ray], layers: &mut [Layer]) {
    let ([first, .., last], [_, ..]) = (rays, &*layers) else {
        return;
    };
    let nearest = layers
        .iter()
        .fold(f64::INFINITY, |t, layer| t.min(layer.hit.t));
    let width = first.at(nearest).distance(last.at(nearest)) / first.direction.length();
    // A bit for each step in depth where there is something.
    let bit = |layer: &Layer| 1_u64 << (((layer.hit.t - nearest) / width) as u32).min(63);
    let taken = layers.iter().fold(0, |taken, layer| taken | bit(layer));
    let begins = taken & !(taken << 1);
    if begins.count_ones() > 1 {
        let up_to = |bit: u64| begins & (bit | (bit - 1));
        layers.sort_by_key(|layer| up_to(bit(layer)).count_ones());
    }
}

impl<'a> Integrator<'a> {
    pub(crate) fn new(accelerator: &'a Accelerator<'a>, camera: &Camera, shading: Shading) -> Self {
        let scene = accelerator.scene();
        let lights = lights::active(scene, camera);
        let everywhere = lights.iter().filter(|active| active.scope.is_none());
        let ambient = everywhere.map(|l| l.light.ambient).sum::<DVec3>() + AMBIENT;
        Self {
            accelerator,
            lights,
            ambient,
            shading,
            transparent: is_transparent(scene),
            mixed: is_mixed(scene),
            fallback: Material::default(),
            size: accelerator.bounds().diagonal(),
        }
    }

    /// The light that comes back along each of many rays, which should run side by side, from
    /// their first hits and, where these are transparent, from what lies behind.
    /// Counts the rays it sends in `count`.
    pub(crate) fn radiances(
        &self,
        rays: &[Ray],
        hits: &[Option<Hit>],
        workspace: &mut Workspace,
        count: &mut u64,
    ) -> Vec<Radiance> {
        let mut light = vec![Radiance::default(); rays.len()];
        let first = |(ray, hit): (usize, &Option<Hit>)| {
            Some(Layer {
                ray,
                hit: (*hit)?,
                share: 1.0,
                touching: None,
            })
        };
        let mut layers = Vec::new();
        reserve(&mut layers, hits.iter().flatten().count());
        layers.extend(hits.iter().enumerate().filter_map(first));
        sort_by_depth(rays, &mut layers);
        let (mut behind, mut ranges, mut starts) = (Vec::new(), Vec::new(), Vec::new());
        let mut found = Vec::new();
        for _ in 0..LAYERS {
            if layers.is_empty() {
                break;
            }
            let looks: Vec<_> = layers
                .iter_mut()
                .map(|layer| self.look_behind(&rays[layer.ray], layer, workspace))
                .collect();
            let colors = self.colors(rays, &layers, &looks, workspace, count);
            for ((layer, look), color) in layers.iter_mut().zip(&looks).zip(colors) {
                let sum = &mut light[layer.ray];
                let opacity = self.opacity(look);
                if opacity > 0.0 {
                    sum.color += color * (layer.share * opacity);
                }
                layer.share *= 1.0 - opacity;
                sum.coverage = 1.0 - layer.share;
            }
            layers.retain(|layer| layer.share >= LEAST_SHARE);
            behind.clear();
            ranges.clear();
            starts.clear();
            for layer in layers.iter().filter(|layer| !layer.is_touched()) {
                let ray = &rays[layer.ray];
                let (next, range) = self.leave(ray, &layer.hit, ray.direction);
                starts.push(Start::of(&layer.hit, &next));
                behind.push(next);
                ranges.push(range);
            }
            *count += behind.len() as u64;
            self.accelerator
                .nearest_leaving(&behind, &ranges, &starts, workspace, &mut found);
            let mut found = found.iter();
            layers.retain_mut(|layer| {
                let touching = layer.touching.as_mut().and_then(Vec::pop);
                let next = touching.or_else(|| {
                    layer.touching = None;
                    found.next().copied().flatten()
                });
                layer.hit = next.unwrap_or(layer.hit);
                next.is_some()
            });
        }
        light
    }

    /// The material of a layer. Finds what touches one that lets light through; what is opaque at its very place
    /// stands for it.
    fn look_behind(&self, ray: &Ray, layer: &mut Layer, workspace: &mut Workspace) -> Look {
        let look = self.look(ray, &layer.hit);
        if layer.touching.is_some() || self.opacity(&look) >= 1.0 {
            return look;
        }
        let mut touching = self.touching(ray, &layer.hit, workspace);
        let is_hidden = |other: &Hit| {
            let room = COINCIDENT * layer.hit.error.max(other.error);
            other.t <= room && self.look(ray, other).opacity >= 1.0
        };
        if let Some(&opaque) = touching.iter().find(|other| is_hidden(other)) {
            layer.hit = opaque;
            return self.look(ray, &opaque);
        }
        touching.reverse();
        layer.touching = Some(touching);
        look
    }

    /// What lies between a hit and where a ray goes on behind it, as it is nearer than rays leave a surface:
    /// other surfaces of other materials, from the ray's side on. Faces that meet at an edge are one layer there.
    fn touching(&self, ray: &Ray, hit: &Hit, workspace: &mut Workspace) -> Vec<Hit> {
        let mut found = Vec::new();
        if !self.mixed {
            return found;
        }
        let (next, _) = self.leave(ray, hit, ray.direction);
        let way = next.origin - hit.point;
        let length = way.length();
        let across = Ray {
            origin: hit.point,
            direction: way / length,
        };
        let range = -COINCIDENT * hit.error..length;
        self.accelerator
            .others(hit, (&across, range), workspace, &mut found);
        let material = |hit: &Hit| self.accelerator.material(hit);
        found.retain(|other| material(other) != material(hit));
        found
    }

    /// The local model at each layer.
    fn colors(
        &self,
        rays: &[Ray],
        layers: &[Layer],
        looks: &[Look],
        workspace: &mut Workspace,
        count: &mut u64,
    ) -> Vec<DVec3> {
        let mut colors: Vec<_> = looks.iter().map(|look| self.unlit(look)).collect();
        let facing = |layer: &Layer| Facing::new(&rays[layer.ray], &layer.hit);
        let facings: Vec<_> = layers.iter().map(facing).collect();
        let (mut shadows, mut ranges, mut starts) = (Vec::new(), Vec::new(), Vec::new());
        let mut pending = Vec::new();
        shadows.reserve(layers.len());
        ranges.reserve(layers.len());
        starts.reserve(layers.len());
        pending.reserve(layers.len());
        for active in &self.lights {
            shadows.clear();
            ranges.clear();
            starts.clear();
            pending.clear();
            for (number, (layer, look)) in layers.iter().zip(looks).enumerate() {
                let (ray, hit) = (&rays[layer.ray], &layer.hit);
                if self.opacity(look) <= 0.0 || !active.shines_on(hit.shape) {
                    continue;
                }
                if active.scope.is_some() {
                    colors[number] += look.ambient * active.light.ambient;
                }
                let Some(lit) = self.lit(&facings[number], hit, look, &active.light) else {
                    continue;
                };
                if !active.shadows {
                    colors[number] += lit.color;
                    continue;
                }
                let (shadow, range) = self.towards(ray, hit, &lit);
                starts.push(Start::of(hit, &shadow));
                shadows.push(shadow);
                ranges.push(range);

                pending.push((number, lit.color));
            }
            let rays = (&mut shadows, &mut ranges, &mut starts);
            let shares = self.shares(rays, workspace, count);
            for (&(number, color), &share) in pending.iter().zip(&shares) {
                if share > 0.0 {
                    colors[number] += color * share;
                }
            }
        }
        colors
    }

    /// The share of light that arrives along each ray to a light; the rays go on through what
    /// is transparent.
    fn shares(
        &self,
        (shadows, ranges, starts): (&mut Vec<Ray>, &mut Vec<Range<f64>>, &mut Vec<Start>),
        workspace: &mut Workspace,
        count: &mut u64,
    ) -> Vec<f64> {
        *count += shadows.len() as u64;
        if !self.transparent {
            let mut blocked = Vec::new();
            self.accelerator
                .any_leaving(shadows, ranges, starts, workspace, &mut blocked);
            return blocked
                .iter()
                .map(|&blocked| if blocked { 0.0 } else { 1.0 })
                .collect();
        }
        let mut shares = vec![1.0; shadows.len()];
        let mut open: Vec<_> = (0..shadows.len()).collect();
        let mut found = Vec::new();
        for _ in 0..LAYERS {
            self.accelerator
                .nearest_leaving(shadows, ranges, starts, workspace, &mut found);
            let mut kept = 0;
            for (k, blocker) in found.iter().enumerate() {
                let Some(blocker) = blocker else { continue };
                let (shadow, share) = (&shadows[k], &mut shares[open[k]]);
                *share *= 1.0 - self.look(shadow, blocker).opacity;
                if *share >= LEAST_SHARE {
                    for other in self.touching(shadow, blocker, workspace) {
                        *share *= 1.0 - self.look(shadow, &other).opacity;
                    }
                }
                if *share < LEAST_SHARE {
                    *share = 0.0;
                    continue;
                }
                let (next, _) = self.leave(shadow, blocker, shadow.direction);
                ranges[kept] = ranges[k].start..ranges[k].end - blocker.t;
                starts[kept] = Start::of(blocker, &next);
                (shadows[kept], open[kept]) = (next, open[k]);
                kept += 1;
            }
            shadows.truncate(kept);
            ranges.truncate(kept);
            starts.truncate(kept);
            open.truncate(kept);
            *count += kept as u64;
            if kept == 0 {
                break;
            }
        }
        for &k in &open {
            shares[k] = 0.0;
        }
        shares
    }

    /// How much of a surface hides what is behind it.
    fn opacity(&self, look: &Look) -> f64 {
        if self.transparent { look.opacity } else { 1.0 }
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

    /// What needs no light in particular.
    fn unlit(&self, look: &Look) -> DVec3 {
        look.emissive + look.ambient * self.ambient
    }

    /// What one light adds where nothing is in its way; `None` where it does not shine.
    fn lit(&self, facing: &Facing, hit: &Hit, look: &Look, light: &Light) -> Option<Lit> {
        let &Facing { view, normal } = facing;
        let (direction, reach, strength) = arrival(light, hit.point)?;
        let cosine = normal.dot(direction);
        if cosine <= 0.0 || strength <= 0.0 {
            return None;
        }
        let highlight = match self.shading {
            Shading::Blinn => {
                let half = (direction + view).normalize_or_zero();
                power(half.dot(normal), look.shininess)
            }
            _ => {
                let mirrored = normal * (2.0 * cosine) - direction;
                power(mirrored.dot(view), look.shininess * PHONG_EXPONENT)
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
        // Far above the error of the point, and of the last step by which it was found; below the
        // accuracy that is promised.
        let times = if hit.filled { LEAVE_GAP } else { LEAVE };
        let offset = side * (hit.error * times).max(self.size * 1e-12);
        (
            Ray {
                origin: hit.point + offset,
                direction,
            },
            0.0..f64::INFINITY,
        )
    }
}

/// The power of a cosine, of what is in front; as precise as the film.
#[expect(clippy::cast_possible_truncation, reason = "film is single precision")]
fn power(cosine: f64, exponent: f64) -> f64 {
    if cosine <= 0.0 && exponent > 0.0 {
        return 0.0;
    }
    f64::from((cosine.max(0.0) as f32).powf(exponent as f32))
}

/// Whether something lets light through.
fn is_transparent(scene: &Scene) -> bool {
    let backs = scene.materials().iter().filter_map(|m| m.back.as_deref());
    let mut materials = scene.materials().iter().chain(backs);
    let mut colors = scene.meshes().iter().flat_map(|mesh| mesh.colors());
    materials.any(|m| m.opacity < 1.0 || m.maps.opacity.is_some()) || colors.any(|c| c.w < 1.0)
}

/// Whether shapes have different materials.
fn is_mixed(scene: &Scene) -> bool {
    let children = scene.nodes().iter().flat_map(|node| &node.children);
    let mut materials = children.filter_map(|child| match child {
        Child::Item(item) => Some(scene.item_material(item)),
        Child::Node(_) => None,
    });
    let first = materials.next();
    materials.any(|material| Some(material) != first)
}
