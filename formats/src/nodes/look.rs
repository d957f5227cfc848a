//! What a scene is seen with: materials, viewpoints, background.

use std::f64::consts::{FRAC_PI_4, PI};

use glam::{DAffine3, DVec2, DVec3};
use kernel::{
    Camera, Channel, Material, MaterialId, MetallicRoughness, Projection, Sky, linear_from_srgb,
};

use super::Node;
use super::scene::{Converter, Made, rotation};
use super::texture::is_texture;

/// Factor from the field `shininess` to the exponent of the Phong model.
pub(super) const SHININESS: f64 = 128.0;

/// The fields of a material: ambient, diffuse, specular, shininess, emission, transparency.
const FRONT: [&str; 6] = [
    "ambientIntensity",
    "diffuseColor",
    "specularColor",
    "shininess",
    "emissiveColor",
    "transparency",
];

/// As [`FRONT`], of the other side of a `TwoSidedMaterial`.
const BACK: [&str; 6] = [
    "backAmbientIntensity",
    "backDiffuseColor",
    "backSpecularColor",
    "backShininess",
    "backEmissiveColor",
    "backTransparency",
];

impl Converter<'_> {
    /// A `Material`, or both sides of a `TwoSidedMaterial`.
    pub(super) fn material(&mut self, node: &Node) -> Made {
        let mut material = self.phong(node, FRONT);
        if node.flag("separateBackColor", false, &mut self.warnings) {
            material.back = Some(Box::new(self.phong(node, BACK)));
        }
        self.pictured(node, material)
    }

    /// One side of a material.
    fn phong(&mut self, node: &Node, fields: [&str; 6]) -> Material {
        let [
            ambient,
            diffuse,
            specular,
            shininess,
            emissive,
            transparency,
        ] = fields;
        let ambient = self.share(node, ambient, 0.2);
        let diffuse = self.color(node, diffuse, DVec3::splat(0.8));
        Material {
            name: self.label(node),
            ambient: diffuse * ambient,
            diffuse,
            specular: self.color(node, specular, DVec3::ZERO),
            shininess: self.share(node, shininess, 0.2) * SHININESS,
            emissive: self.color(node, emissive, DVec3::ZERO),
            opacity: 1.0 - self.share(node, transparency, 0.0),
            ..Material::default()
        }
    }

    pub(super) fn unlit_material(&mut self, node: &Node) -> Made {
        let material = self.plain_material(node, DVec3::ONE);
        let made = self.pictured(node, material);
        if let Made::Material(id) = made {
            self.unlit.insert(id);
        }
        made
    }

    pub(super) fn physical_material(&mut self, node: &Node) -> Made {
        let model = MetallicRoughness {
            base_color: self.color(node, "baseColor", DVec3::ONE),
            metallic: self.share(node, "metallic", 1.0),
            roughness: self.share(node, "roughness", 1.0),
        };
        let plain = self.plain_material(node, DVec3::ZERO);
        let material = Material {
            name: plain.name,
            emissive: plain.emissive,
            opacity: plain.opacity,
            ..Material::physical(model)
        };
        self.pictured(node, material)
    }

    /// A material that takes its diffuse colour from the vertices of a mesh; without one there
    /// is no other light.
    pub(super) fn whitened(&mut self, material: Option<MaterialId>) -> MaterialId {
        if let Some(known) = self.whitened.get(&material) {
            return *known;
        }
        let is_unlit = material.is_none_or(|id| self.unlit.contains(&id));
        let own = material.map_or_else(
            || Material::unlit(DVec3::ZERO),
            |id| self.scene.material(id).clone(),
        );
        let white = if is_unlit {
            Material {
                emissive: DVec3::ONE,
                ..own
            }
        } else {
            Material {
                ambient: DVec3::splat(share_of(own.ambient, own.diffuse)),
                diffuse: DVec3::ONE,
                metallic_roughness: own.metallic_roughness.map(|model| MetallicRoughness {
                    base_color: DVec3::ONE,
                    ..model
                }),
                ..own
            }
        };
        let white = self.scene.add_material(white);
        self.whitened.insert(material, white);
        white
    }

    /// Stores a material with the textures that X3D 4 has inside of it.
    fn pictured(&mut self, node: &Node, mut material: Material) -> Made {
        let is_unlit = &*node.kind == "UnlitMaterial";
        for link in &node.children {
            let inside = &self.tree.nodes[link.node];
            let made = self.made.get(link.node).copied();
            let read = match made {
                Some(Made::Texture(index)) => self.textures[index].clone(),
                _ if inside.is_metadata() || is_texture(&inside.kind) => continue,
                _ => {
                    let text = format!("{} in a material is not read", inside.kind);
                    self.warnings.unsupported(inside.place(), text);
                    continue;
                }
            };
            match link.field.as_deref() {
                Some("emissiveTexture") | None if is_unlit => read.cover(&mut material, true),
                None | Some("baseTexture" | "diffuseTexture") => read.cover(&mut material, false),
                Some("emissiveTexture") => material.maps.emissive = Some(read.texture),
                Some("specularTexture") => material.maps.specular = Some(read.texture),
                Some("metallicRoughnessTexture") => {
                    material.maps.roughness = Some(read.share(Channel::Green));
                    material.maps.metallic = Some(read.share(Channel::Blue));
                }
                Some(field) => {
                    let text = format!("a {field} is not shown");
                    self.warnings.unsupported(inside.place(), text);
                }
            }
        }
        Made::Material(self.scene.add_material(material))
    }

    /// The material of an appearance as its `alphaMode` wants it. Opacity that is cut off at a value
    /// is not known here.
    pub(super) fn blended(&mut self, node: &Node, id: MaterialId) -> MaterialId {
        match &*node.string("alphaMode") {
            "" | "AUTO" | "BLEND" => return id,
            "OPAQUE" => {}
            mode => {
                let text = format!("alphaMode {mode} is read as BLEND");
                self.warnings.unsupported(node.place(), text);
                return id;
            }
        }
        let mut material = self.scene.material(id).clone();
        let mut side = Some(&mut material);
        while let Some(opaque) = side {
            (opaque.opacity, opaque.maps.opacity) = (1.0, None);
            side = opaque.back.as_deref_mut();
        }
        let made = self.scene.add_material(material);
        if self.unlit.contains(&id) {
            self.unlit.insert(made);
        }
        made
    }

    /// Name, emission and opacity, which all materials have; no reflection.
    fn plain_material(&mut self, node: &Node, emissive: DVec3) -> Material {
        Material {
            name: self.label(node),
            opacity: 1.0 - self.share(node, "transparency", 0.0),
            ..Material::unlit(self.color(node, "emissiveColor", emissive))
        }
    }

    /// A linear colour.
    pub(super) fn color(&mut self, node: &Node, field: &str, default: DVec3) -> DVec3 {
        let color = node.vector(field, default, &mut self.warnings);
        if color.cmplt(DVec3::ZERO).any() || color.cmpgt(DVec3::ONE).any() {
            let text = "colours go from 0 to 1; the colour is clamped";
            self.warnings.invalid(node.field_place(field), text);
        }
        linear_from_srgb(color.clamp(DVec3::ZERO, DVec3::ONE))
    }

    /// A number from 0 to 1.
    fn share(&mut self, node: &Node, field: &str, default: f64) -> f64 {
        let found = node.number(field, default, &mut self.warnings);
        if !(0.0..=1.0).contains(&found) {
            let text = "must lie between 0 and 1; the value is clamped";
            self.warnings.invalid(node.field_place(field), text);
        }
        found.clamp(0.0, 1.0)
    }

    /// An angle in radians.
    pub(super) fn angle(&mut self, node: &Node, field: &str, default: f64) -> f64 {
        let found = node.tuple(field, &mut self.warnings);
        found.map_or(default, |[angle]| angle * node.file.angle)
    }

    pub(super) fn viewpoint(&mut self, index: usize, node: &Node) -> Made {
        let world = self.world_from_parent(index);
        let rotation = rotation(node, "orientation", &mut self.warnings);
        let [right, up, back] = DVec3::AXES.map(|axis| world.transform_vector3(rotation * axis));
        let position = DVec3::new(0.0, 0.0, 10.0);
        let position = node.vector("position", position, &mut self.warnings);
        let mut eye = world.transform_point3(position);
        let projection = if &*node.kind == "OrthoViewpoint" {
            let usual = [-1.0, -1.0, 1.0, 1.0];
            let window = node.tuple("fieldOfView", &mut self.warnings);
            let [mut left, mut bottom, mut r, mut t] = window.unwrap_or(usual);
            if !(left < r && bottom < t) {
                let text = "a window ends where it begins, or before; the default is used";
                self.warnings.invalid(node.field_place("fieldOfView"), text);
                [left, bottom, r, t] = usual;
            }
            eye += right * ((left + r) * 0.5) + up * ((bottom + t) * 0.5);
            let size = DVec2::new(r - left, t - bottom) * scale(&world);
            if (size.x - size.y).abs() > 0.0 {
                Projection::OrthographicWindow { size }
            } else {
                Projection::Orthographic { extent: size.x }
            }
        } else {
            let mut fov = self.angle(node, "fieldOfView", FRAC_PI_4);
            if !(fov > 0.0 && fov < PI) {
                let text = "must lie between 0 and pi; the default is used";
                self.warnings.invalid(node.field_place("fieldOfView"), text);
                fov = FRAC_PI_4;
            }
            Projection::PerspectiveShorter { fov }
        };
        match Camera::look_at(eye, eye - back.normalize_or_zero(), up, projection) {
            Some(mut camera) => {
                // Viewers show the description.
                camera.name = node.string("description");
                let label = self.label(node);
                if camera.name.is_empty() {
                    camera.name = label;
                } else {
                    camera.alias = label;
                }
                self.scene.cameras.push(camera);
            }
            None => {
                let text = "a viewpoint without a direction or an extent; it is left out";
                self.warnings.invalid(node.place(), text);
            }
        }
        Made::Nothing
    }

    /// The first background: one colour, or a sky and a ground of several.
    pub(super) fn background(&mut self, index: usize, node: &Node) -> Made {
        if std::mem::replace(&mut self.bound.background, true) {
            return Made::Nothing;
        }
        let mut textures = node.children.iter().map(|link| &self.tree.nodes[link.node]);
        let has_texture = textures.any(|n| !n.is_metadata());
        if has_texture || node.fields.iter().any(|f| f.name.ends_with("Url")) {
            let text = "the pictures of a background are not read";
            self.warnings.unsupported(node.place(), text);
        }
        let sky = self.stops(node, "skyColor", "skyAngle");
        let ground = self.stops(node, "groundColor", "groundAngle");
        self.scene.background = Some(sky.first().map_or(DVec3::ZERO, |&(_, color)| color));
        let up = self.world_from_parent(index).transform_vector3(DVec3::Y);
        if sky.len() > 1 || !ground.is_empty() {
            self.scene.sky = Some(Sky::new(up.normalize_or(DVec3::Y), sky, ground));
        }
        Made::Nothing
    }

    /// Linear colours at angles, the first of which is zero.
    fn stops(&mut self, node: &Node, colors: &str, angles: &str) -> Vec<(f64, DVec3)> {
        let found = node.points_3d(colors, &mut self.warnings).into_iter();
        let found = found.map(|c| linear_from_srgb(c.clamp(DVec3::ZERO, DVec3::ONE)));
        let given = node.numbers(angles, &mut self.warnings).into_iter();
        let places = std::iter::once(0.0).chain(given.map(|a| a * node.file.angle));
        let stops: Vec<_> = places.zip(found.clone()).collect();
        if stops.len() < found.count() {
            let text = "colours without an angle are not used";
            self.warnings.invalid(node.field_place(colors), text);
        }
        stops
    }

    pub(super) fn navigation(&mut self, node: &Node) -> Made {
        if !std::mem::replace(&mut self.bound.navigation, true) {
            self.scene.headlight = node.flag("headlight", true, &mut self.warnings);
        }
        Made::Nothing
    }
}

/// The mean scale of a map.
pub(super) fn scale(map: &DAffine3) -> f64 {
    map.matrix3.determinant().abs().cbrt()
}

/// The share that takes one colour to another, by their brightest parts; a fifth where there is
/// no light, as the default of materials has it.
fn share_of(part: DVec3, whole: DVec3) -> f64 {
    let (part, whole) = (part.max_element(), whole.max_element());
    if whole > 0.0 {
        (part / whole).clamp(0.0, 1.0)
    } else {
        0.2
    }
}
