//! Materials, cameras and lights.

use std::collections::BTreeMap;
use std::io;

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use gltf::json::camera::{Orthographic, Perspective, Type};
use gltf::json::extensions::scene::khr_lights_punctual as punctual;
use gltf::json::material::{
    AlphaMode, EmissiveFactor, PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor,
};
use gltf::json::validation::Checked::Valid;
use gltf::json::{Index, Material, Node};
use kernel::{Camera, Light, LightKind, Maps, MaterialId, Projection, Scene};
use serde_json::{Map, json};

use super::buffer::{Data, number};
use super::pictures::Pictures;
use super::place::Place;

/// The extension for materials that no light changes: an empty object.
pub(super) const UNLIT: &str = "KHR_materials_unlit";

/// Materials that have been used so far, each once for every way of showing it.
#[derive(Debug, Default)]
pub(super) struct Materials {
    known: BTreeMap<(Option<usize>, Sides), Index<Material>>,
    /// Of lines and points.
    thin: BTreeMap<Option<usize>, Index<Material>>,
    pictures: Pictures,
}

/// How a material is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Sides {
    pub(super) double: bool,
    /// Whether there are texture coordinates for its pictures.
    pub(super) textured: bool,
    /// Whether colours of vertices let something through.
    pub(super) clear: bool,
}

impl Materials {
    /// The number of a material in the file.
    ///
    /// # Errors
    /// If a picture cannot be encoded.
    pub(super) fn add(
        &mut self,
        scene: &Scene,
        id: Option<MaterialId>,
        sides: Sides,
        data: &mut Data,
        root: &mut gltf::json::Root,
    ) -> io::Result<Index<Material>> {
        let key = (id.map(MaterialId::index), sides);
        if let Some(known) = self.known.get(&key) {
            return Ok(*known);
        }
        let default = kernel::Material::default();
        let source = id.map_or(&default, |id| scene.material(id));
        let mut made = material(source, sides.double);
        if sides.textured {
            let maps = if source.is_unlit() {
                &as_base(&source.maps)
            } else {
                &source.maps
            };
            let pictures = self.pictures.add(maps, data, root)?;
            made.pbr_metallic_roughness.base_color_texture = pictures.color;
            made.pbr_metallic_roughness.metallic_roughness_texture = pictures.surface;
            made.emissive_texture = pictures.emissive;
            if source.maps.opacity.is_some() {
                made.alpha_mode = Valid(AlphaMode::Blend);
            }
        }
        if sides.clear {
            made.alpha_mode = Valid(AlphaMode::Blend);
        }
        let index = push(root, made);
        self.known.insert(key, index);
        Ok(index)
    }

    /// The same for lines and points, which have one colour and no shades.
    pub(super) fn add_thin(
        &mut self,
        scene: &Scene,
        id: Option<MaterialId>,
        root: &mut gltf::json::Root,
    ) -> Index<Material> {
        let source = id.map(|id| scene.material(id));
        let flat = kernel::Material {
            name: source.map(|own| own.name.clone()).unwrap_or_default(),
            opacity: source.map_or(1.0, |own| own.opacity),
            ..kernel::Material::unlit(source.map_or(kernel::Material::THIN, kernel::Material::flat))
        };
        let add = || push(root, material(&flat, false));
        *self
            .thin
            .entry(id.map(MaterialId::index))
            .or_insert_with(add)
    }
}

/// Pictures of emitted light as those of the base colour, which is what no light changes.
fn as_base(maps: &Maps) -> Maps {
    Maps {
        color: maps.emissive.clone(),
        opacity: maps.opacity.clone(),
        ..Maps::default()
    }
}

/// Adds a material to a file.
fn push(root: &mut gltf::json::Root, material: Material) -> Index<Material> {
    let used = &mut root.extensions_used;
    if material.extensions.is_some() && !used.iter().any(|name| name == UNLIT) {
        used.push(UNLIT.to_owned());
    }
    root.materials.push(material);
    Index::new(number(root.materials.len() - 1))
}

/// A Phong material becomes a dielectric whose lobe is as wide: Blinn's exponent `n` is that
/// of the roughness `(2 / (n + 2)) ^ (1/4)` \[Walter 07, after Beckmann\]; without specular
/// reflection it is fully rough. What reflects nothing has its emission for a base colour, which
/// colours of vertices multiply, and no light changes it.
#[expect(
    clippy::cast_possible_truncation,
    reason = "files hold single precision"
)]
fn material(source: &kernel::Material, double_sided: bool) -> Material {
    let is_unlit = source.is_unlit();
    let (base, metallic, roughness) = match source.metallic_roughness {
        _ if is_unlit => (source.emissive, 0.0, 1.0),
        Some(given) => (given.base_color, given.metallic, given.roughness),
        None if source.specular.max_element() <= 0.0 => (source.diffuse, 0.0, 1.0),
        None => {
            let exponent = source.shininess.max(0.0);
            (source.diffuse, 0.0, (2.0 / (exponent + 2.0)).powf(0.25))
        }
    };
    let unit = |x: f64| x.clamp(0.0, 1.0) as f32;
    let opaque = source.opacity >= 1.0;
    let emissive = if is_unlit {
        DVec3::ZERO
    } else {
        source.emissive
    };
    let extensions = is_unlit.then(|| gltf::json::extensions::material::Material {
        others: Map::from_iter([(UNLIT.to_owned(), json!({}))]),
    });
    Material {
        extensions,
        name: (!source.name.is_empty()).then(|| source.name.clone()),
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor(
                [base.x, base.y, base.z, source.opacity].map(unit),
            ),
            metallic_factor: StrengthFactor(unit(metallic)),
            roughness_factor: StrengthFactor(unit(roughness)),
            ..PbrMetallicRoughness::default()
        },
        emissive_factor: EmissiveFactor(emissive.to_array().map(unit)),
        alpha_mode: Valid(if opaque {
            AlphaMode::Opaque
        } else {
            AlphaMode::Blend
        }),
        double_sided,
        ..Material::default()
    }
}

/// The camera's own axes, with its view along -z, at its place.
fn placed(eye: DVec3, forward: DVec3, up: DVec3, world: &DAffine3) -> Node {
    let forward = world.transform_vector3(forward).normalize_or(DVec3::NEG_Z);
    let up = world.transform_vector3(up);
    let right = forward
        .cross(up)
        .normalize_or(forward.any_orthonormal_vector());
    let axes = DMat3::from_cols(right, right.cross(forward), -forward);
    let mut node = Node::default();
    let place = Place {
        translation: world.transform_point3(eye),
        rotation: DQuat::from_mat3(&axes),
        scale: DVec3::ONE,
    };
    place.apply_to(&mut node);
    node
}

/// Cameras as nodes of their own, since they may not be scaled; `world` leads to metres.
#[expect(
    clippy::cast_possible_truncation,
    reason = "files hold single precision"
)]
pub(super) fn add_camera(
    camera: &Camera,
    world: &DAffine3,
    metres: f64,
    diagonal: f64,
    root: &mut gltf::json::Root,
) -> Node {
    let far = camera.eye().length().max(1.0) * 10.0 + diagonal * 10.0;
    let mut made = gltf::json::Camera {
        name: None,
        orthographic: None,
        perspective: None,
        type_: Valid(Type::Perspective),
        extensions: None,
        extras: None,
    };
    let mut window = None;
    match camera.projection() {
        // Files know the height only; of pictures that are wider than high it is the shorter.
        Projection::Perspective { vertical_fov: fov } | Projection::PerspectiveShorter { fov } => {
            made.perspective = Some(Perspective {
                aspect_ratio: None,
                yfov: fov as f32,
                zfar: None,
                znear: (1e-3 * diagonal * metres).max(1e-6) as f32,
                extensions: None,
                extras: None,
            });
        }
        Projection::Orthographic { extent } => window = Some(DVec2::splat(extent)),
        Projection::OrthographicWindow { size } => window = Some(size),
    }
    if let Some(size) = window {
        let half = size * (0.5 * metres);
        made.type_ = Valid(Type::Orthographic);
        made.orthographic = Some(Orthographic {
            xmag: half.x as f32,
            ymag: half.y as f32,
            zfar: (far * metres) as f32,
            znear: 0.0,
            extensions: None,
            extras: None,
        });
    }
    let mut node = placed(camera.eye(), camera.forward(), camera.up(), world);
    node.name = (!camera.name.is_empty()).then(|| camera.name.clone());
    node.camera = Some(Index::new(number(root.cameras.len())));
    root.cameras.push(made);
    node
}

/// A light and the node that holds it; brightness is taken over as it is.
#[expect(
    clippy::cast_possible_truncation,
    reason = "files hold single precision"
)]
pub(super) fn add_light(
    light: &Light,
    world: &DAffine3,
    metres: f64,
    lights: &mut Vec<punctual::Light>,
) -> Node {
    let (kind, position, direction, falloff, cone) = match light.kind {
        LightKind::Directional { direction } => (
            punctual::Type::Directional,
            DVec3::ZERO,
            direction,
            None,
            None,
        ),
        LightKind::Point { position, falloff } => (
            punctual::Type::Point,
            position,
            DVec3::NEG_Z,
            Some(falloff),
            None,
        ),
        LightKind::Spot {
            position,
            direction,
            inner,
            outer,
            falloff,
        } => {
            let cone = Some((inner, outer));
            (
                punctual::Type::Spot,
                position,
                direction,
                Some(falloff),
                cone,
            )
        }
    };
    let intensity = light.color.max_element();
    let color = if intensity > 0.0 {
        light.color / intensity
    } else {
        DVec3::ONE
    };
    let range = falloff
        .map(|f| f.radius * metres)
        .filter(|r| r.is_finite() && *r > 0.0);
    let spot = cone.map(|(inner, outer)| {
        let outer = outer.clamp(1e-3, std::f64::consts::FRAC_PI_2);
        punctual::Spot {
            inner_cone_angle: inner.clamp(0.0, 0.999 * outer) as f32,
            // A right angle is rounded up.
            outer_cone_angle: (outer as f32).min(std::f32::consts::FRAC_PI_2.next_down()),
        }
    });
    lights.push(punctual::Light {
        color: color.to_array().map(|x| x.clamp(0.0, 1.0) as f32),
        extensions: None,
        extras: None,
        intensity: intensity.max(0.0) as f32,
        name: None,
        range: range.map(|r| r as f32),
        spot,
        type_: Valid(kind),
    });
    let mut node = placed(
        position,
        direction,
        direction.any_orthogonal_vector(),
        world,
    );
    let place = punctual::KhrLightsPunctual {
        light: Index::new(number(lights.len() - 1)),
    };
    node.extensions = Some(gltf::json::extensions::scene::Node {
        khr_lights_punctual: Some(place),
        ..Default::default()
    });
    node
}
