//! Pictures of materials, and where they lie on surfaces and meshes.

use glam::{DAffine2, DVec2, DVec3};
use kernel::{
    Channel, Filter, Image, Maps, Material, ShareTexture, Surface, Texels, Texture, Wrap,
};

use super::Dialect;
use super::spell::{Out, Value};
use super::tree::Tree;
use crate::Place;
use crate::nodes::address::encoded;
use crate::write::has_weights;

impl Tree<'_> {
    /// Adds the pictures of a material to its appearance, and those that only X3D 4 has to the
    /// material itself.
    pub(super) fn pictures(&mut self, material: &Material, inside: &mut Out, around: &mut Out) {
        let maps = &material.maps;
        let main = if material.is_unlit() {
            &maps.emissive
        } else {
            &maps.color
        };
        if let Some(texture) = main {
            self.main_picture(material, texture, around);
        }
        let mut others = Vec::new();
        if !material.is_unlit() {
            others.extend(maps.emissive.iter().map(|t| ("emissiveTexture", t)));
        }
        others.extend(maps.specular.iter().map(|t| ("specularTexture", t)));
        if let Some(both) = metallic_roughness(maps) {
            others.push(("metallicRoughnessTexture", both));
        } else if maps.metallic.is_some() || maps.roughness.is_some() {
            self.lost(
                material,
                "pictures of roughness and metalness that are not one",
            );
        }
        let is_alpha = |share: &ShareTexture| {
            let main = main.as_ref();
            share.channel == Channel::Alpha && main.is_some_and(|main| *main == share.texture)
        };
        if maps.opacity.as_ref().is_some_and(|share| !is_alpha(share)) {
            self.lost(
                material,
                "a picture of opacity that is not the alpha of another",
            );
        }
        if self.dialect == Dialect::Vrml97 {
            self.moved(material, main.as_ref(), around);
        } else {
            let first = main
                .as_ref()
                .or_else(|| others.first().map(|(_, texture)| *texture));
            self.moved(material, first, around);
            let place = |texture: &Texture| texture.picture_from_shape;
            let is_apart = |(_, other): &(_, &Texture)| first.map(place) != Some(place(other));
            if others.iter().any(is_apart) {
                self.lost(material, "pictures that are moved otherwise than the first");
            }
        }
        for (field, texture) in others {
            if self.dialect == Dialect::Vrml97 {
                self.lost(material, "pictures of other things than colour");
            } else {
                self.is_physical = true;
                inside.child(field, self.texture(texture, true));
            }
        }
    }

    /// The picture of colours. Before X3D 4 its colours take the place of those of the material,
    /// and its alpha that of the opacity.
    fn main_picture(&mut self, material: &Material, texture: &Texture, around: &mut Out) {
        let is_unlit = material.is_unlit();
        let is_white = is_unlit || material.diffuse == DVec3::ONE;
        let (image, is_opaque) = (&texture.image, material.opacity >= 1.0);
        let has_alpha = material.maps.opacity.is_some();
        // The alpha of a file counts unless it is said that it does not.
        let is_ignored = image.has_alpha() && !image.name().is_empty() && !has_alpha;
        if self.dialect == Dialect::Vrml97 {
            if !is_white {
                self.lost(material, "a colour that a picture is multiplied by");
            }
            if !is_opaque && !is_unlit && image.has_alpha() {
                self.lost(material, "an opacity beside the alpha of a picture");
            }
        } else {
            self.is_physical |= !is_white || !is_opaque || is_ignored;
        }
        if is_ignored && is_opaque && self.dialect != Dialect::Vrml97 {
            around.field("alphaMode", Value::Text("OPAQUE".to_owned()));
        } else if is_ignored {
            self.lost(material, "a picture whose alpha does not count");
        }
        around.child("texture", self.texture(texture, has_alpha));
    }

    /// Notes what the format cannot hold of a material.
    pub(super) fn lost(&mut self, material: &Material, what: &str) {
        let place = Place::item(0, format!("material \"{}\"", material.name));
        let text = format!("{what}: there is no such thing in the format; left out");
        self.warnings.unsupported(place, text);
    }

    /// A picture: by the name of its file, or as pixels where it has none, with its alpha if
    /// that counts.
    fn texture(&mut self, texture: &Texture, has_alpha: bool) -> Out {
        let image = &texture.image;
        let mut out;
        if image.name().is_empty() {
            out = Out::new("PixelTexture");
            out.field("image", Value::One(pixels(image, has_alpha)));
        } else {
            out = Out::new("ImageTexture");
            out.field("url", Value::Texts(vec![encoded(image.name())]));
            let place = Place::item(0, format!("picture \"{}\"", image.name()));
            let text = "pictures are named and not copied; put the file beside what is written";
            self.warnings.unsupported(place, text);
        }
        for (field, wrap) in ["repeatS", "repeatT"].into_iter().zip(texture.wrap) {
            if wrap != Wrap::Repeat {
                out.field(field, Value::Flag(false));
            }
        }
        let is_special = texture.wrap.contains(&Wrap::Mirror) || texture.filter == Filter::Nearest;
        if is_special && self.dialect != Dialect::Vrml97 {
            let mut properties = Out::new("TextureProperties");
            let fields = ["boundaryModeS", "boundaryModeT"];
            for (field, wrap) in fields.into_iter().zip(texture.wrap) {
                let mode = match wrap {
                    Wrap::Repeat => "REPEAT",
                    Wrap::Mirror => "MIRRORED_REPEAT",
                    Wrap::Clamp => "CLAMP_TO_EDGE",
                };
                properties.field(field, Value::Text(mode.to_owned()));
            }
            if texture.filter == Filter::Nearest {
                let nearest = Value::Text("NEAREST_PIXEL".to_owned());
                properties.field("magnificationFilter", nearest);
            }
            out.child("textureProperties", properties);
        }
        out
    }

    /// Adds what moves the pictures of a material.
    fn moved(&mut self, material: &Material, texture: Option<&Texture>, around: &mut Out) {
        let out = texture.and_then(|texture| self.texture_transform(material, texture));
        if let Some(out) = out {
            around.child("textureTransform", out);
        }
    }

    /// The map of a texture as `S R T`, if it does anything.
    fn texture_transform(&mut self, material: &Material, texture: &Texture) -> Option<Out> {
        let map = texture.picture_from_shape;
        if map == DAffine2::IDENTITY {
            return None;
        }
        let rows = map.matrix2.transpose();
        let (s, t) = (rows.x_axis, rows.y_axis);
        let (size, cross) = (s.length(), s.perp_dot(t));
        if s.dot(t).abs() > 1e-9 * size * t.length() || cross == 0.0 {
            self.lost(material, "a picture that is moved askew");
            return None;
        }
        let mut out = Out::new("TextureTransform");
        out.field("scale", Value::tuple(&[size, cross / size]));
        out.field("rotation", Value::number((-s.y).atan2(s.x)));
        let moved = map.matrix2.inverse() * map.translation;
        out.field("translation", Value::tuple(&moved.to_array()));
        Some(out)
    }

    /// The texture coordinates of a surface.
    pub(super) fn texture_surface(&self, surface: &Surface) -> Out {
        let mut out = Out::new(match self.dialect {
            Dialect::Vrml97 => "NurbsTextureSurface",
            Dialect::Xml | Dialect::Classic => "NurbsTextureCoordinate",
        });
        let order = super::shapes::knots(&mut out, surface);
        if has_weights(surface.weights()) {
            let weights: Vec<_> = order.iter().map(|h| h.w).collect();
            out.field("weight", Value::list(&weights, 1));
        }
        let points: Vec<_> = order.iter().flat_map(|h| [h.x, h.y]).collect();
        out.field("controlPoint", Value::list(&points, 2));
        out
    }
}

/// The picture that has roughness in green and metalness in blue.
fn metallic_roughness(maps: &Maps) -> Option<&Texture> {
    let (metallic, roughness) = (maps.metallic.as_ref()?, maps.roughness.as_ref()?);
    let fits = metallic.channel == Channel::Blue
        && roughness.channel == Channel::Green
        && metallic.texture == roughness.texture;
    fits.then_some(&metallic.texture)
}

/// The content of a `PixelTexture`: the lowest row first.
fn pixels(image: &Image, has_alpha: bool) -> String {
    let bytes: Vec<[u8; 4]> = match image.texels() {
        Texels::Bytes(texels) => texels.clone(),
        Texels::Floats(_) => {
            let (width, height) = (image.width(), image.height());
            let texture = Texture {
                filter: Filter::Nearest,
                ..Texture::from(std::sync::Arc::new(image.clone()))
            };
            let middle = |i: usize| {
                let s = ((i % width) as f64 + 0.5) / width as f64;
                DVec2::new(s, 1.0 - ((i / width) as f64 + 0.5) / height as f64)
            };
            let all = 0..width * height;
            all.map(|i| kernel::bytes_from_linear(texture.color(middle(i))))
                .collect()
        }
    };
    let components = if has_alpha && image.has_alpha() { 4 } else { 3 };
    let mut text = format!("{} {} {components}", image.width(), image.height());
    for row in bytes.chunks(image.width()).rev() {
        for [r, g, b, a] in row {
            text += &match components {
                3 => format!(" 0x{r:02X}{g:02X}{b:02X}"),
                _ => format!(" 0x{r:02X}{g:02X}{b:02X}{a:02X}"),
            };
        }
    }
    text
}
