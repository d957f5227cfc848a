//! Textures: pictures from files and from the file itself, and what they do to a material.

use std::sync::Arc;

use glam::{DAffine2, DVec2, DVec3};
use kernel::{Channel, Filter, Image, Material, MaterialId, ShareTexture, Texels, Texture, Wrap};

use super::Node;
use super::scene::{Converter, Made};
use crate::Error;
use crate::pictures::{Picture, REMOTE};

/// A texture node.
#[derive(Clone, Debug)]
pub(super) struct Read {
    pub(super) texture: Texture,
    /// Numbers of a texel in the file.
    components: u8,
}

/// Nodes that are pictures, or hold some.
pub(super) fn is_texture(kind: &str) -> bool {
    matches!(
        kind,
        "ImageTexture" | "MovieTexture" | "MultiTexture" | "PixelTexture"
    )
}

impl Converter<'_> {
    /// The first picture of an `ImageTexture` that can be read.
    pub(super) fn image_texture(&mut self, node: &Node) -> Made {
        let mut reasons = Vec::new();
        for address in node.strings("url").iter().filter(|a| !a.is_empty()) {
            let mut reason = REMOTE.to_owned();
            let address = node.file.address(address);
            for name in &address.names {
                match self.pictures.load(name, self.options) {
                    Ok(picture) => return self.picture(node, picture),
                    Err(found) => reason = found,
                }
            }
            reasons.push(format!("{}: {reason}", address.shown));
        }
        if !reasons.is_empty() {
            let text = format!("a picture could not be read: {}", reasons.join("; "));
            self.warnings.unsupported(node.place(), text);
        }
        Made::Nothing
    }

    /// The picture in a `PixelTexture`.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn pixel_texture(&mut self, node: &Node) -> Result<Made, Error> {
        let words = super::text::words(node.text("image").unwrap_or_default());
        let number = |word| u32::try_from(super::text::whole(word)?).ok();
        let numbers: Option<Vec<u32>> = words.map(number).collect();
        let numbers = numbers.unwrap_or_default();
        self.count_points(numbers.len(), node)?;
        let (size, texels) = numbers.split_at_checked(3).unwrap_or_default();
        let &[width, height, components] = size else {
            return Ok(Made::Nothing);
        };
        let (width, height) = (width as usize, height as usize);
        if width.saturating_mul(height) == 0 {
            return Ok(Made::Nothing);
        }
        let image = match (width.saturating_mul(height) == texels.len(), components) {
            (true, 1..=4) => {
                // The file has the lowest row first.
                let rows = texels.chunks(width).rev().flatten();
                let texels = rows.map(|&number| texel(number, components)).collect();
                Image::new(String::new(), width, height, Texels::Bytes(texels)).ok()
            }
            _ => None,
        };
        let Some(image) = image else {
            let found = texels.len();
            let text = format!("{found} texels of {components} numbers for {width} x {height}");
            self.warnings.invalid(node.field_place("image"), text);
            return Ok(Made::Nothing);
        };
        let picture = Picture {
            image: Arc::new(image),
            components: u8::try_from(components).unwrap_or(u8::MAX),
        };
        Ok(self.picture(node, picture))
    }

    /// The first of the textures of a `MultiTexture`.
    pub(super) fn multi_texture(&mut self, node: &Node) -> Made {
        let made = self.made_inside(node).into_iter();
        let mut textures = made.filter(|made| matches!(made, Made::Texture(_)));
        let first = textures.next().unwrap_or(Made::Nothing);
        if textures.next().is_some() {
            let text = "only the first of several textures is shown";
            self.warnings.unsupported(node.place(), text);
        }
        first
    }

    /// A picture as the node uses it.
    fn picture(&mut self, node: &Node, picture: Picture) -> Made {
        let mut texture = Texture::from(picture.image);
        for (axis, field) in ["repeatS", "repeatT"].into_iter().enumerate() {
            if !node.flag(field, true, &mut self.warnings) {
                texture.wrap[axis] = Wrap::Clamp;
            }
        }
        let mut inside = node.children.iter().map(|link| &self.tree.nodes[link.node]);
        if let Some(properties) = inside.find(|n| &*n.kind == "TextureProperties") {
            for (axis, field) in ["boundaryModeS", "boundaryModeT"].into_iter().enumerate() {
                texture.wrap[axis] = match &*properties.string(field) {
                    "" | "REPEAT" => Wrap::Repeat,
                    "MIRRORED_REPEAT" => Wrap::Mirror,
                    _ => Wrap::Clamp,
                };
            }
            if matches!(
                &*properties.string("magnificationFilter"),
                "NEAREST_PIXEL" | "FASTEST"
            ) {
                texture.filter = Filter::Nearest;
            }
        }
        self.textures.push(Read {
            texture,
            components: picture.components,
        });
        Made::Texture(self.textures.len() - 1)
    }

    /// The texture of an appearance. Files in XML need not name the field.
    fn texture_of(&self, node: &Node) -> Option<Read> {
        let mut links = node.children.iter();
        links.find_map(|link| match self.made.get(link.node) {
            Some(Made::Texture(index)) => self.textures.get(*index).cloned(),
            _ => None,
        })
    }

    /// A material with the texture of its appearance, and all its pictures moved as that says.
    ///
    /// Up to X3D 3 the colours of a texture take the place of those of the material, and so
    /// does its alpha; grey ones, and all since X3D 4, multiply them. Without a material there
    /// is no light but that of the texture.
    pub(super) fn dressed(&mut self, node: &Node, found: Option<MaterialId>) -> Option<MaterialId> {
        let own = self.texture_of(node);
        let placed = self.texture_transform(node);
        let is_unlit = found.is_none_or(|id| self.unlit.contains(&id));
        let mut material = match found {
            Some(id) => self.scene.material(id).clone(),
            None => Material {
                name: self.label(node),
                ..Material::unlit(DVec3::ONE)
            },
        };
        let mode = node.string("alphaMode");
        let is_opaque = mode == "OPAQUE" && found.is_some();
        let is_moved = !material.maps.is_empty() && placed != DAffine2::IDENTITY;
        if own.is_none() && !is_opaque && !is_moved {
            return found;
        }
        // Pictures of the material itself come before that of the appearance.
        let has_own = match is_unlit {
            true => material.maps.emissive.is_some(),
            false => material.maps.color.is_some(),
        };
        if let Some(own) = own.filter(|_| !has_own) {
            let replaces = !node.file.version.starts_with('4');
            if replaces && own.components > 2 && !is_unlit {
                (material.diffuse, material.ambient) = (DVec3::ONE, self.ambient_share(node));
            }
            if replaces && own.has_alpha() {
                material.opacity = 1.0;
            }
            own.cover(&mut material, is_unlit);
        }
        if mode == "OPAQUE" {
            material.opacity = 1.0;
            material.maps.opacity = None;
        }
        for texture in material.maps.textures_mut() {
            texture.picture_from_shape = placed;
        }
        let id = self.scene.add_material(material);
        if is_unlit {
            self.unlit.insert(id);
        }
        Some(id)
    }

    /// Share of the diffuse colour that the material of an appearance reflects of the ambient
    /// light.
    fn ambient_share(&self, node: &Node) -> DVec3 {
        let mut warnings = crate::Warnings::default();
        let material = self.tree.inside(node).find(|n| &*n.kind == "Material");
        let share = material.map_or(0.2, |m| m.number("ambientIntensity", 0.2, &mut warnings));
        DVec3::splat(share.clamp(0.0, 1.0))
    }

    /// The map of a `TextureTransform`: `C^-1 S R C T` (ISO/IEC 19775-1, 18.4.8).
    fn texture_transform(&mut self, node: &Node) -> DAffine2 {
        let tree = self.tree;
        let transform = |node| {
            tree.inside(node)
                .find(|n| n.kind.contains("TextureTransform"))
        };
        let Some(mut found) = transform(node) else {
            return DAffine2::IDENTITY;
        };
        if &*found.kind == "MultiTextureTransform" {
            found = transform(found).unwrap_or(found);
        }
        if &*found.kind != "TextureTransform" {
            let text = format!("{} is not read", found.kind);
            self.warnings.unsupported(found.place(), text);
            return DAffine2::IDENTITY;
        }
        let mut pair = |field, default| {
            let pair = found.tuple(field, &mut self.warnings);
            pair.map_or(default, DVec2::from_array)
        };
        let (center, scale) = (pair("center", DVec2::ZERO), pair("scale", DVec2::ONE));
        let translation = pair("translation", DVec2::ZERO);
        let angle = self.angle(found, "rotation", 0.0);
        DAffine2::from_translation(-center)
            * DAffine2::from_scale(scale)
            * DAffine2::from_angle(angle)
            * DAffine2::from_translation(center + translation)
    }
}

impl Read {
    /// Whether texels have an alpha of their own.
    fn has_alpha(&self) -> bool {
        matches!(self.components, 2 | 4)
    }

    /// The picture of the share in one of its channels.
    pub(super) fn share(&self, channel: Channel) -> ShareTexture {
        ShareTexture {
            texture: self.texture.clone(),
            channel,
        }
    }

    /// Gives a material its colours, or its emission if it reflects nothing, and its opacity.
    pub(super) fn cover(self, material: &mut Material, is_unlit: bool) {
        if self.has_alpha() && self.texture.image.has_alpha() {
            material.maps.opacity = Some(self.share(Channel::Alpha));
        }
        if is_unlit {
            material.maps.emissive = Some(self.texture);
        } else {
            material.maps.color = Some(self.texture);
        }
    }
}

/// The texel of a number with so many components, the last one in its lowest byte.
fn texel(number: u32, components: u32) -> [u8; 4] {
    let [a, b, c, d] = number.to_be_bytes();
    match components {
        1 => [d, d, d, u8::MAX],
        2 => [c, c, c, d],
        3 => [b, c, d, u8::MAX],
        _ => [a, b, c, d],
    }
}
