//! Materials, lights, viewpoints, background.

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use kernel::{
    Camera, Falloff, Light, LightKind, Material, MetallicRoughness, NodeId, Projection,
    srgb_from_linear,
};

use super::Dialect;
use super::spell::{Out, Value};
use super::tree::{Tree, rotation};
use crate::Place;
use crate::nodes::lights::placed;
use crate::nodes::look::SHININESS;
use crate::write::outermost;

/// The material of X3D 4 that reflects nothing.
pub(super) const UNLIT: &str = "UnlitMaterial";

/// A reach that stands for one without an end.
const FAR: f64 = 1e30;

impl Tree<'_> {
    /// Viewpoints, lights and what there is one of, in the coordinates of the scene.
    pub(super) fn look(&mut self) -> Vec<Out> {
        let scene = self.scene;
        let mut out = Vec::new();
        if !scene.headlight || !scene.lights.is_empty() {
            let mut navigation = Out::new("NavigationInfo");
            navigation.field("headlight", Value::Flag(scene.headlight));
            out.push(navigation);
        }
        out.extend(self.background());
        out.extend(scene.cameras.iter().filter_map(|c| self.viewpoint(c)));
        out.extend(self.lights());
        out
    }

    /// The lights that shine on all there is; those of groups wait for these.
    fn lights(&mut self) -> Vec<Out> {
        let scene = self.scene;
        let whole = outermost(scene, DMat3::IDENTITY, |_| false).map(|(_, id, _)| id);
        let mut out = Vec::new();
        for light in &scene.lights {
            // All hangs below a node that is not inside of the whole.
            let group = (light.scope.split_last())
                .filter(|(_, around)| whole.is_some_and(|id| around.contains(&id)));
            if let Some((group, _)) = group {
                if let Some(own) = self.in_its_group(light) {
                    let own = self.light(&own);
                    self.lamps.entry(*group).or_default().push(own);
                    continue;
                }
                let text = "that it shines in one group only is not written: the group stands in \
                            several places or is flattened, or the format knows only parallel \
                            light of groups";
                (self.warnings).unsupported(Place::item(0, "light".to_owned()), text);
            }
            let everywhere = Light {
                scope: Vec::new(),
                ..light.clone()
            };
            out.push(self.light(&everywhere));
        }
        out
    }

    /// A light in the coordinates of the group in which it shines, if that is written once and has such.
    fn in_its_group(&self, light: &Light) -> Option<Light> {
        let is_parallel = matches!(light.kind, LightKind::Directional { .. });
        let is_one = |id: &NodeId| self.uses.nodes.get(id).is_none_or(|&uses| uses < 2);
        if self.dialect == Dialect::Vrml97 && !is_parallel || !light.scope.iter().all(is_one) {
            return None;
        }
        let maps = light.scope.iter();
        let maps = maps.map(|id| &self.scene.node(*id).parent_from_node);
        let group_from_world = maps.product::<DAffine3>().inverse();
        let own = placed(light, &group_from_world);
        own.filter(|_| group_from_world.is_finite())
    }

    /// The background: one colour, or those of the sky and the ground.
    fn background(&self) -> Option<Out> {
        let mut out = Out::new("Background");
        let Some(sky) = &self.scene.sky else {
            let color = srgb(self.scene.background?);
            out.field("skyColor", Value::list(&color, 3));
            return Some(out);
        };
        for (colors, angles, stops) in [
            ("skyColor", "skyAngle", sky.sky()),
            ("groundColor", "groundAngle", sky.ground()),
        ] {
            // The first colour has no angle in a file.
            let above = stops.first().filter(|stop| stop.0 > 0.0);
            let stops = above.into_iter().chain(stops);
            let list: Vec<_> = stops.clone().flat_map(|stop| srgb(stop.1)).collect();
            let ends: Vec<_> = stops.map(|stop| stop.0).skip(1).collect();
            for (field, list, width) in [(colors, list, 3), (angles, ends, 1)] {
                if !list.is_empty() {
                    out.field(field, Value::list(&list, width));
                }
            }
        }
        let Some(turn) = rotation(DQuat::from_rotation_arc(DVec3::Y, sky.up())) else {
            return Some(out);
        };
        let mut around = Out::new("Transform");
        around.field("rotation", turn);
        around.child("children", out);
        Some(around)
    }

    fn viewpoint(&mut self, camera: &Camera) -> Option<Out> {
        let kind = match camera.projection() {
            Projection::Orthographic { .. } | Projection::OrthographicWindow { .. } => {
                "OrthoViewpoint"
            }
            _ => "Viewpoint",
        };
        let place = || Place::item(0, format!("camera \"{}\"", camera.name));
        if kind == "OrthoViewpoint" && self.dialect == Dialect::Vrml97 {
            let text = "VRML 97 has no parallel views; it is left out";
            self.warnings.unsupported(place(), text);
            return None;
        }
        let mut out = Out::new(kind);
        if !camera.name.is_empty() {
            out.field("description", Value::Text(camera.name.clone()));
        }
        if !camera.alias.is_empty() {
            self.define(&mut out, &camera.alias, None);
        }
        out.field("position", Value::tuple(&camera.eye().to_array()));
        let axes = DMat3::from_cols(camera.right(), camera.up(), -camera.forward());
        if let Some(turn) = rotation(DQuat::from_mat3(&axes).normalize()) {
            out.field("orientation", turn);
        }
        let mut window = |size: DVec2| {
            let half = size * 0.5;
            let corners = [-half.x, -half.y, half.x, half.y];
            out.field("fieldOfView", Value::list(&corners, 1));
        };
        match camera.projection() {
            Projection::Orthographic { extent } => window(DVec2::splat(extent)),
            Projection::OrthographicWindow { size } => window(size),
            Projection::PerspectiveShorter { fov } => {
                out.field("fieldOfView", Value::number(fov));
            }
            Projection::Perspective { vertical_fov } => {
                let text = "the angle of a view holds for the shorter side of a picture, \
                    not for its height";
                self.warnings.unsupported(place(), text);
                out.field("fieldOfView", Value::number(vertical_fov));
            }
        }
        Some(out)
    }

    fn light(&self, light: &Light) -> Out {
        let (kind, position, direction, falloff) = match light.kind {
            LightKind::Directional { direction } => {
                ("DirectionalLight", None, Some(direction), None)
            }
            LightKind::Point { position, falloff } => {
                ("PointLight", Some(position), None, Some(falloff))
            }
            LightKind::Spot {
                position,
                direction,
                falloff,
                ..
            } => ("SpotLight", Some(position), Some(direction), Some(falloff)),
        };
        let mut out = Out::new(kind);
        let intensity = light.color.max_element().max(1.0);
        out.field("color", Value::tuple(&srgb(light.color / intensity)));
        out.field("intensity", Value::number(intensity));
        let brightest = light.color.max_element();
        let ambient = light.ambient.max_element() * intensity / brightest;
        if ambient > 0.0 && ambient.is_finite() {
            out.field("ambientIntensity", Value::number(ambient));
        }
        if self.dialect != Dialect::Vrml97 {
            out.field("global", Value::Flag(light.scope.is_empty()));
        }
        if let Some(position) = position {
            out.field("location", Value::tuple(&position.to_array()));
        }
        if let Some(direction) = direction {
            out.field("direction", Value::tuple(&direction.to_array()));
        }
        if let LightKind::Spot { inner, outer, .. } = light.kind {
            out.field("beamWidth", Value::number(inner));
            out.field("cutOffAngle", Value::number(outer));
        }
        if let Some(Falloff {
            attenuation,
            radius,
        }) = falloff
        {
            out.field("attenuation", Value::tuple(&attenuation.to_array()));
            out.field("radius", Value::number(radius.min(FAR)));
        }
        out
    }

    /// The physically based reading, if it is the one to be written: not where the file gives
    /// colours and highlights of another look beside it.
    fn physical(&self, material: &Material) -> Option<MetallicRoughness> {
        let model = material.metallic_roughness?;
        if self.dialect == Dialect::Vrml97 {
            return None;
        }
        let maps = &material.maps;
        let usual = Material::physical(model);
        let colors = |m: &Material| [m.ambient, m.diffuse, m.specular];
        let pairs = colors(material).into_iter().zip(colors(&usual));
        let is_usual = pairs.into_iter().all(|(a, b)| a.distance(b) < 1e-9)
            && (material.shininess - usual.shininess).abs() < 1e-6;
        (is_usual || maps.metallic.is_some() || maps.roughness.is_some()).then_some(model)
    }

    /// The colour that those of vertices are multiplied by. In files they take its place.
    pub(super) fn tint(&self, material: &Material) -> DVec3 {
        match self.physical(material) {
            _ if material.is_unlit() => material.emissive,
            Some(model) => model.base_color,
            None => material.diffuse,
        }
    }

    /// Notes what VRML 97 cannot hold of a material that reflects nothing.
    fn tell_unlit(&mut self, material: &Material) {
        if material.opacity < 1.0 {
            self.lost(material, "the opacity of what reflects nothing");
        }
        if !material.maps.is_empty() && material.emissive != DVec3::ONE {
            self.lost(material, "a colour that a picture is multiplied by");
        }
    }

    /// A material, and its type; meshes may have colours of their own.
    pub(super) fn material(
        &mut self,
        material: &Material,
        has_colors: bool,
    ) -> (&'static str, Out) {
        let physical = self.physical(material);
        let is_told = self.dialect == Dialect::Vrml97 || physical.is_some();
        if material.metallic_roughness.is_some() && !is_told {
            let place = Place::item(0, format!("material \"{}\"", material.name));
            let text = "metalness and roughness beside colours and highlights of another look; \
                an X3D material has one of them";
            self.warnings.unsupported(place, text);
        }
        // The colours of vertices and pictures of other materials are lit.
        let is_unlit = material.is_unlit() && (has_colors || !material.maps.is_empty());
        let mut out;
        if is_unlit {
            self.is_physical = true;
            out = Out::new(UNLIT);
            if self.dialect == Dialect::Vrml97 {
                self.tell_unlit(material);
            }
        } else if let Some(model) = physical {
            self.is_physical = true;
            out = Out::new("PhysicalMaterial");
            out.field("baseColor", Value::tuple(&srgb(model.base_color)));
            out.field("metallic", Value::number(model.metallic));
            out.field("roughness", Value::number(model.roughness));
        } else {
            out = Out::new("Material");
            let brightest = material.diffuse.max_element();
            let ambient = if brightest > 0.0 {
                (material.ambient.max_element() / brightest).clamp(0.0, 1.0)
            } else {
                0.0
            };
            out.field("ambientIntensity", Value::number(ambient));
            out.field("diffuseColor", Value::tuple(&srgb(material.diffuse)));
            out.field("specularColor", Value::tuple(&srgb(material.specular)));
            let shininess = (material.shininess / SHININESS).clamp(0.0, 1.0);
            out.field("shininess", Value::number(shininess));
            let lost = material.ambient.distance(material.diffuse * ambient) > 1e-6
                || material.shininess > SHININESS;
            if lost {
                let place = Place::item(0, format!("material \"{}\"", material.name));
                let text = "ambient light of another colour than the diffuse one, or a highlight \
                    narrower than the exponent 128, is brought to the nearest that there is";
                self.warnings.unsupported(place, text);
            }
        }
        if material.emissive != DVec3::ZERO || is_unlit {
            out.field("emissiveColor", Value::tuple(&srgb(material.emissive)));
        }
        if material.opacity < 1.0 {
            out.field("transparency", Value::number(1.0 - material.opacity));
        }
        (out.kind, out)
    }
}

/// A linear colour as files have it.
pub(super) fn srgb(color: DVec3) -> [f64; 3] {
    srgb_from_linear(color.clamp(DVec3::ZERO, DVec3::ONE)).to_array()
}
