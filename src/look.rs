//! What a material is at one point: its own numbers, times those of its pictures and of the
//! colours of vertices.

use glam::{DVec2, DVec3, DVec4};
use kernel::{Material, MetallicRoughness};

/// The local model of Phong and Blinn at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Look {
    pub(crate) ambient: DVec3,
    pub(crate) diffuse: DVec3,
    pub(crate) specular: DVec3,
    pub(crate) shininess: f64,
    pub(crate) emissive: DVec3,
    pub(crate) opacity: f64,
}

impl From<&Material> for Look {
    /// Where there are neither pictures nor colours.
    fn from(material: &Material) -> Self {
        Self {
            ambient: material.ambient,
            diffuse: material.diffuse,
            specular: material.specular,
            shininess: material.shininess,
            emissive: material.emissive,
            opacity: material.opacity.clamp(0.0, 1.0),
        }
    }
}

impl Look {
    /// A material where the texture coordinates are `st`.
    pub(crate) fn textured(material: &Material, st: DVec2) -> Self {
        let maps = &material.maps;
        let share = |map: &Option<kernel::ShareTexture>| map.as_ref().map(|map| map.share(st));
        let color = |map: &Option<kernel::Texture>| {
            let found = map.as_ref().map(|map| map.color(st).truncate());
            found.unwrap_or(DVec3::ONE)
        };
        let mut look = Self::from(material);
        let (metallic, roughness) = (share(&maps.metallic), share(&maps.roughness));
        let mut metal = 0.0;
        if let Some(model) = material.metallic_roughness {
            metal = model.metallic * metallic.unwrap_or(1.0);
            if metallic.is_some() || roughness.is_some() {
                let here = Material::physical(MetallicRoughness {
                    metallic: metal,
                    roughness: model.roughness * roughness.unwrap_or(1.0),
                    ..model
                });
                look = Self {
                    emissive: look.emissive,
                    opacity: look.opacity,
                    ..Self::from(&here)
                };
            }
        }
        let base = color(&maps.color);
        look.ambient *= base;
        look.diffuse *= base;
        // Metals are coloured where they are shiny.
        look.specular *= color(&maps.specular) * DVec3::ONE.lerp(base, metal);
        look.emissive *= color(&maps.emissive);
        look.opacity *= share(&maps.opacity).unwrap_or(1.0).clamp(0.0, 1.0);
        look
    }

    /// The same with the colour of a vertex.
    pub(crate) fn tinted(mut self, material: &Material, color: DVec4) -> Self {
        let (color, alpha) = (color.truncate(), color.w.clamp(0.0, 1.0));
        if material.is_unlit() {
            self.emissive *= color;
        } else {
            self.ambient *= color;
            self.diffuse *= color;
        }
        self.opacity *= alpha;
        self
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use kernel::{Channel, Image, Maps, ShareTexture, Texels, Texture};

    use super::*;

    fn one(texel: [f32; 4]) -> Texture {
        let image = Image::new(String::new(), 1, 1, Texels::Floats(vec![texel]));
        Texture::from(Arc::new(image.unwrap()))
    }

    #[test]
    fn pictures_multiply_what_the_material_says() {
        let material = Material {
            ambient: DVec3::splat(0.5),
            diffuse: DVec3::new(0.5, 1.0, 1.0),
            specular: DVec3::splat(0.25),
            emissive: DVec3::ONE,
            opacity: 0.5,
            maps: Maps {
                color: Some(one([0.5, 0.25, 1.0, 0.1])),
                emissive: Some(one([0.0, 1.0, 2.0, 1.0])),
                opacity: Some(ShareTexture {
                    texture: one([0.0, 0.0, 0.0, 0.5]),
                    channel: Channel::Alpha,
                }),
                ..Maps::default()
            },
            ..Material::default()
        };
        let look = Look::textured(&material, DVec2::ZERO);
        assert_eq!(look.diffuse, DVec3::new(0.25, 0.25, 1.0));
        assert_eq!(look.ambient, DVec3::new(0.25, 0.125, 0.5));
        assert_eq!(look.specular, material.specular);
        assert_eq!(look.emissive, DVec3::new(0.0, 1.0, 2.0));
        assert_eq!(look.opacity.to_bits(), 0.25_f64.to_bits());
        let tinted = look.tinted(&material, DVec4::new(0.0, 1.0, 1.0, 0.5));
        assert_eq!(tinted.diffuse, DVec3::new(0.0, 0.25, 1.0));
        assert_eq!(tinted.opacity.to_bits(), 0.125_f64.to_bits());
    }

    #[test]
    fn metalness_and_roughness_of_pictures_are_those_of_a_material() {
        let model = MetallicRoughness {
            base_color: DVec3::new(0.5, 0.25, 1.0),
            metallic: 1.0,
            roughness: 1.0,
        };
        let share = |channel| {
            let texture = one([0.0, 0.5, 0.25, 1.0]);
            Some(ShareTexture { texture, channel })
        };
        let material = Material {
            maps: Maps {
                roughness: share(Channel::Green),
                metallic: share(Channel::Blue),
                ..Maps::default()
            },
            ..Material::physical(model)
        };
        let plain = Material::physical(MetallicRoughness {
            metallic: 0.25,
            roughness: 0.5,
            ..model
        });
        assert_eq!(Look::textured(&material, DVec2::ZERO), Look::from(&plain));
    }
}
