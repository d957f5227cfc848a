//! Materials and lights. Colours are linear light with the primaries of sRGB.

use glam::DVec3;

use crate::{Maps, NodeId};

/// A linear colour from the sRGB values that files and people write, 0 to 1 each.
pub fn linear_from_srgb(color: DVec3) -> DVec3 {
    let decode = |c: f64| {
        if c <= 0.04045 {
            c / 12.92
        } else {
            ((c + 0.055) / 1.055).powf(2.4)
        }
    };
    DVec3::new(decode(color.x), decode(color.y), decode(color.z))
}

/// The sRGB values, as files and people write them, of a linear colour with parts from 0 to 1:
/// the inverse of [`linear_from_srgb`].
pub fn srgb_from_linear(color: DVec3) -> DVec3 {
    let encode = |c: f64| {
        if c <= 0.04045 / 12.92 {
            c * 12.92
        } else {
            // One is one.
            1.0 - 1.055 * (1.0 - c.powf(1.0 / 2.4))
        }
    };
    DVec3::new(encode(color.x), encode(color.y), encode(color.z))
}

/// How a surface reflects light: the Phong model, and the metallic-roughness model of glTF
/// where the file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in the file, or empty.
    pub name: String,
    /// Share of the ambient light that is reflected.
    pub ambient: DVec3,
    /// Diffuse reflection.
    pub diffuse: DVec3,
    /// Specular reflection.
    pub specular: DVec3,
    /// Exponent of the specular lobe about the half vector (Blinn), as OBJ and X3D define it;
    /// about the mirrored direction (Phong) a quarter of it gives the same highlight.
    pub shininess: f64,
    /// Light sent out by the surface itself.
    pub emissive: DVec3,
    /// 1 is opaque, 0 is invisible.
    pub opacity: f64,
    /// The physically based reading, if the file gives one.
    pub metallic_roughness: Option<MetallicRoughness>,
    /// What differs from place to place.
    pub maps: Maps,
    /// The look from behind, where `du x dv` points away from the viewer, if it is another.
    pub back: Option<Box<Self>>,
}

/// The metallic-roughness model of glTF 2.0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetallicRoughness {
    /// Base colour.
    pub base_color: DVec3,
    /// 0 for dielectrics, 1 for metals.
    pub metallic: f64,
    /// Perceptual roughness, 0 to 1.
    pub roughness: f64,
}

impl Default for Material {
    /// A light, slightly warm grey with a soft highlight.
    fn default() -> Self {
        Self {
            name: String::new(),
            ambient: DVec3::new(0.60, 0.59, 0.56),
            diffuse: DVec3::new(0.60, 0.59, 0.56),
            specular: DVec3::splat(0.2),
            shininess: 128.0,
            emissive: DVec3::ZERO,
            opacity: 1.0,
            metallic_roughness: None,
            maps: Maps::default(),
            back: None,
        }
    }
}

/// Share of the base colour that a physical material reflects of the ambient light.
const AMBIENT: f64 = 0.2;

/// Reflectance of dielectrics seen straight on, as glTF has it.
const DIELECTRIC: f64 = 0.04;

/// The narrowest highlight of a physical material, as an exponent.
const NARROWEST: f64 = 1024.0;

impl Material {
    /// The colour of lines and points without a material.
    pub const THIN: DVec3 = DVec3::new(0.02, 0.04, 0.10);

    /// The one colour of lines and points, which no light shades.
    pub fn flat(&self) -> DVec3 {
        (self.emissive + self.diffuse).clamp(DVec3::ZERO, DVec3::ONE)
    }

    /// A physically based material, also read as a Phong material of about the same look: the
    /// width of the highlight is that of the distribution of normals
    /// (Walter et al. 2007, section 5.2), `roughness^2` of glTF being that width.
    pub fn physical(model: MetallicRoughness) -> Self {
        let width = model.roughness.max(0.05).powi(4);
        Self {
            ambient: model.base_color * AMBIENT,
            diffuse: model.base_color * (1.0 - model.metallic),
            specular: DVec3::splat(DIELECTRIC).lerp(model.base_color, model.metallic),
            shininess: (2.0 / width - 2.0).clamp(1.0, NARROWEST),
            metallic_roughness: Some(model),
            ..Self::default()
        }
    }

    /// A material that reflects nothing and sends out light of this colour.
    pub fn unlit(emissive: DVec3) -> Self {
        Self {
            ambient: DVec3::ZERO,
            diffuse: DVec3::ZERO,
            specular: DVec3::ZERO,
            shininess: 1.0,
            emissive,
            ..Self::default()
        }
    }

    /// Whether it reflects nothing: its colour is its emission.
    pub fn is_unlit(&self) -> bool {
        let reflected = [self.ambient, self.diffuse, self.specular];
        reflected.iter().all(|&color| color == DVec3::ZERO) && self.metallic_roughness.is_none()
    }
}

/// A source of light in world coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Kind and place.
    pub kind: LightKind,
    /// Colour times intensity.
    pub color: DVec3,
    /// What the light adds to the ambient light, as a colour.
    pub ambient: DVec3,
    /// The nodes from the root down to the one in which alone it shines; none if it shines everywhere.
    pub scope: Vec<NodeId>,
}

/// Kind and place of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Parallel light.
    Directional {
        /// The way the light goes.
        direction: DVec3,
    },
    /// Light from a point in all directions.
    Point {
        /// Where it stands.
        position: DVec3,
        /// How it weakens.
        falloff: Falloff,
    },
    /// Light from a point within a cone.
    Spot {
        /// Where it stands.
        position: DVec3,
        /// The axis of the cone, away from the light.
        direction: DVec3,
        /// Half angle of full light, in radians.
        inner: f64,
        /// Half angle beyond which there is no light, in radians.
        outer: f64,
        /// How it weakens.
        falloff: Falloff,
    },
}

/// How the light of a point weakens with the distance `r`:
/// `1 / max(c0 + c1 r + c2 r^2, 1)` up to `radius`, nothing beyond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Falloff {
    /// The coefficients `c0`, `c1`, `c2`.
    pub attenuation: DVec3,
    /// Reach of the light.
    pub radius: f64,
}

impl Falloff {
    /// The same light at every distance.
    pub const NONE: Self = Self {
        attenuation: DVec3::new(1.0, 0.0, 0.0),
        radius: f64::INFINITY,
    };

    /// The share of the light that arrives at distance `r`.
    pub fn at(&self, r: f64) -> f64 {
        if r > self.radius {
            return 0.0;
        }
        1.0 / self.attenuation.dot(DVec3::new(1.0, r, r * r)).max(1.0)
    }
}
