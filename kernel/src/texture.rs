//! Pictures on surfaces: texels in memory, and how a material looks them up.
//!
//! Picture coordinates `(s, t)` run from 0 to 1, from the lower left corner of a picture to its
//! upper right one. Alpha is straight: colours are not multiplied by it.

use std::fmt;
use std::sync::{Arc, LazyLock};

use glam::{DAffine2, DVec2, DVec3, DVec4};

use crate::{Error, linear_from_srgb, srgb_from_linear};

/// A picture in memory. Materials share it through [`Arc`].
#[derive(Clone, PartialEq)]
pub struct Image {
    name: String,
    width: usize,
    height: usize,
    texels: Texels,
}

/// The texels of an [`Image`], row by row from the top: red, green, blue and alpha each.
#[derive(Clone, Debug, PartialEq)]
pub enum Texels {
    /// Shares of 255; colours are encoded as sRGB, alpha is not.
    Bytes(Vec<[u8; 4]>),
    /// Linear light, and alpha from 0 to 1.
    Floats(Vec<[f32; 4]>),
}

impl Image {
    /// A picture; `name` is that of its file as the scene's file has it, empty where the
    /// picture stands in that file itself.
    ///
    /// # Errors
    /// If the number of texels is not `width` times `height`, that is zero, or a number is not
    /// finite.
    pub fn new(name: String, width: usize, height: usize, texels: Texels) -> Result<Self, Error> {
        let (found, expected) = (texels.len(), width.saturating_mul(height));
        if found != expected || found == 0 {
            return Err(Error::PointCount {
                found,
                expected: expected.max(1),
            });
        }
        if let Texels::Floats(texels) = &texels
            && let Some(index) = texels.iter().flatten().position(|x| !x.is_finite())
        {
            return Err(Error::NotFinite { index: index / 4 });
        }
        Ok(Self {
            name,
            width,
            height,
            texels,
        })
    }

    /// The name of its file, or empty.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Texels of a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All texels, row by row from the top.
    pub fn texels(&self) -> &Texels {
        &self.texels
    }

    /// Whether a texel is not opaque.
    pub fn has_alpha(&self) -> bool {
        match &self.texels {
            Texels::Bytes(texels) => texels.iter().any(|t| t[3] < u8::MAX),
            Texels::Floats(texels) => texels.iter().any(|t| t[3] < 1.0),
        }
    }

    /// Linear colour and alpha of the texel `index`.
    fn light(&self, index: usize) -> DVec4 {
        match &self.texels {
            Texels::Bytes(texels) => {
                let [r, g, b, a] = texels[index];
                let color = [r, g, b].map(|byte| LINEAR[usize::from(byte)]);
                DVec3::from(color).extend(f64::from(a) / 255.0)
            }
            Texels::Floats(texels) => DVec4::from(texels[index].map(f64::from)),
        }
    }

    /// The numbers of the texel `index` as they are stored, as shares of one.
    fn numbers(&self, index: usize) -> DVec4 {
        match &self.texels {
            Texels::Bytes(texels) => DVec4::from(texels[index].map(|byte| f64::from(byte) / 255.0)),
            Texels::Floats(texels) => DVec4::from(texels[index].map(f64::from)),
        }
    }
}

impl fmt::Debug for Image {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "Image({:?}, {} x {}, ",
            self.name, self.width, self.height
        )?;
        // A sum tells pictures apart; their texels would fill pages.
        let sum = |sum: f64, index| sum + self.numbers(index).dot(DVec4::new(1.0, 2.0, 3.0, 4.0));
        write!(f, "{})", (0..self.texels.len()).fold(0.0, sum))
    }
}

impl Texels {
    fn len(&self) -> usize {
        match self {
            Self::Bytes(texels) => texels.len(),
            Self::Floats(texels) => texels.len(),
        }
    }
}

/// Linear light of each byte of sRGB.
static LINEAR: LazyLock<[f64; 256]> = LazyLock::new(|| {
    std::array::from_fn(|byte| linear_from_srgb(DVec3::splat(byte as f64 / 255.0)).x)
});

/// The texel of a linear colour with alpha; what is beyond 0 to 1 is clamped.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to a byte"
)]
pub fn bytes_from_linear(color: DVec4) -> [u8; 4] {
    let srgb = srgb_from_linear(color.truncate().clamp(DVec3::ZERO, DVec3::ONE));
    let byte = |x: f64| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
    srgb.extend(color.w).to_array().map(byte)
}

/// How a picture continues outside of itself along one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// It stands there again.
    #[default]
    Repeat,
    /// It stands there again, every other time mirrored.
    Mirror,
    /// Its border goes on.
    Clamp,
}

/// What is seen between the middles of texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// A mixture of the four around.
    #[default]
    Linear,
    /// The nearest one.
    Nearest,
}

/// A picture as a material uses it.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// The picture.
    pub image: Arc<Image>,
    /// How it continues along `s` and along `t`.
    pub wrap: [Wrap; 2],
    /// What is seen between texels.
    pub filter: Filter,
    /// Picture coordinates from texture coordinates of the shape.
    pub picture_from_shape: DAffine2,
}

/// The number of a texel that stands for a share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Red, as it is stored.
    Red,
    /// Green, as it is stored.
    Green,
    /// Blue, as it is stored.
    Blue,
    /// Alpha.
    Alpha,
    /// The mean of red, green and blue, as they are stored.
    Mean,
}

/// A picture of shares, such as opacities.
#[derive(Clone, Debug, PartialEq)]
pub struct ShareTexture {
    /// The picture.
    pub texture: Texture,
    /// What of it counts.
    pub channel: Channel,
}

/// The pictures of a material. Each multiplies what the material says; what has no picture is
/// the same everywhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Maps {
    /// Ambient and diffuse reflection and base colour. Its alpha does not count.
    pub color: Option<Texture>,
    /// Specular reflection.
    pub specular: Option<Texture>,
    /// Emitted light.
    pub emissive: Option<Texture>,
    /// Opacity.
    pub opacity: Option<ShareTexture>,
    /// Metalness, of materials with [`crate::MetallicRoughness`].
    pub metallic: Option<ShareTexture>,
    /// Roughness, of materials with [`crate::MetallicRoughness`].
    pub roughness: Option<ShareTexture>,
}

impl Maps {
    /// Whether there is no picture.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// All pictures with what is said about their use, those of the colours first.
    pub fn textures(&self) -> impl Iterator<Item = &Texture> {
        let colors = [&self.color, &self.specular, &self.emissive];
        let shares = [&self.opacity, &self.metallic, &self.roughness];
        let shares = shares.into_iter().flatten().map(|share| &share.texture);
        colors.into_iter().flatten().chain(shares)
    }

    /// The same, to be changed.
    pub fn textures_mut(&mut self) -> impl Iterator<Item = &mut Texture> {
        let colors = [&mut self.color, &mut self.specular, &mut self.emissive];
        let shares = [&mut self.opacity, &mut self.metallic, &mut self.roughness];
        let shares = shares.into_iter().flatten().map(|share| &mut share.texture);
        colors.into_iter().flatten().chain(shares)
    }
}

impl From<Arc<Image>> for Texture {
    /// The picture once over the unit square, repeated outside.
    fn from(image: Arc<Image>) -> Self {
        Self {
            image,
            wrap: [Wrap::default(); 2],
            filter: Filter::default(),
            picture_from_shape: DAffine2::IDENTITY,
        }
    }
}

impl Texture {
    /// Linear colour and alpha at the texture coordinates `st` of a shape.
    pub fn color(&self, st: DVec2) -> DVec4 {
        self.sample(st, |index| self.image.light(index))
    }

    fn sample(&self, st: DVec2, texel: impl Fn(usize) -> DVec4) -> DVec4 {
        let place = self.picture_from_shape.transform_point2(st);
        let (width, height) = (self.image.width, self.image.height);
        let [s, t] =
            [(place.x, self.wrap[0]), (place.y, self.wrap[1])].map(|(x, wrap)| match wrap {
                Wrap::Repeat => x - x.floor(),
                Wrap::Mirror => 1.0 - ((x * 0.5).fract().abs() * 2.0 - 1.0).abs(),
                Wrap::Clamp => x.clamp(0.0, 1.0),
            });
        let (x, y) = (s * width as f64, (1.0 - t) * height as f64);
        let at = |x: f64, y: f64| {
            let column = wrapped(x, width, self.wrap[0]);
            texel(wrapped(y, height, self.wrap[1]) * width + column)
        };
        if self.filter == Filter::Nearest {
            return at(x.min(width as f64 - 0.5), y.min(height as f64 - 0.5));
        }
        let (x, y) = (x - 0.5, y - 0.5);
        let (right, down) = (x - x.floor(), y - y.floor());
        let row = |y: f64| at(x, y).lerp(at(x + 1.0, y), right);
        row(y).lerp(row(y + 1.0), down)
    }
}

impl ShareTexture {
    /// The share at the texture coordinates `st` of a shape.
    pub fn share(&self, st: DVec2) -> f64 {
        let image = &self.texture.image;
        let found = self.texture.sample(st, |index| image.numbers(index));
        match self.channel {
            Channel::Red => found.x,
            Channel::Green => found.y,
            Channel::Blue => found.z,
            Channel::Alpha => found.w,
            Channel::Mean => found.truncate().element_sum() / 3.0,
        }
    }
}

/// The texel of a place that is at most one texel outside; what is no number is in the first.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the place is inside, or nearly"
)]
fn wrapped(place: f64, count: usize, wrap: Wrap) -> usize {
    let place = place.floor() as i64;
    match (usize::try_from(place), wrap) {
        (Ok(inside), _) if inside < count => inside,
        (Ok(_), Wrap::Repeat) | (Err(_), Wrap::Mirror | Wrap::Clamp) => 0,
        (Err(_), Wrap::Repeat) | (Ok(_), Wrap::Mirror | Wrap::Clamp) => count - 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two by two: black and red above, green and half transparent white below.
    fn picture() -> Texture {
        let texels = vec![
            [0, 0, 0, 255],
            [255, 0, 0, 255],
            [0, 255, 0, 255],
            [255, 255, 255, 127],
        ];
        let image = Image::new("four.png".into(), 2, 2, Texels::Bytes(texels)).unwrap();
        assert!(image.has_alpha());
        Texture::from(Arc::new(image))
    }

    #[test]
    fn the_middle_of_a_texel_is_that_texel_and_the_middle_of_four_their_mean() {
        let texture = picture();
        assert_eq!(
            texture.color(DVec2::new(0.25, 0.25)),
            DVec4::new(0.0, 1.0, 0.0, 1.0)
        );
        assert_eq!(
            texture.color(DVec2::new(0.75, 0.75)),
            DVec4::new(1.0, 0.0, 0.0, 1.0)
        );
        let middle = DVec4::new(0.5, 0.5, 0.25, (3.0 + 127.0 / 255.0) / 4.0);
        assert!(texture.color(DVec2::splat(0.5)).abs_diff_eq(middle, 1e-15));
        // Halfway between two texels of a row.
        let row = DVec4::new(0.5, 1.0, 0.5, (1.0 + 127.0 / 255.0) / 2.0);
        assert!(texture.color(DVec2::new(0.5, 0.25)).abs_diff_eq(row, 1e-15));
    }

    #[test]
    fn pictures_go_on_outside_as_they_are_told() {
        let mut texture = picture();
        let (st, shift) = (DVec2::new(0.1, 0.3), DVec2::new(3.0, -2.0));
        assert!(
            texture
                .color(st)
                .abs_diff_eq(texture.color(st + shift), 1e-12)
        );
        // The border of a repeated picture is mixed from both sides.
        assert!((texture.color(DVec2::new(0.0, 0.75)).x - 0.5).abs() < 1e-15);
        texture.wrap = [Wrap::Clamp; 2];
        assert!((texture.color(DVec2::new(-7.0, 0.75)).x - 0.0).abs() < 1e-15);
        assert!((texture.color(DVec2::new(9.0, 0.75)).x - 1.0).abs() < 1e-15);
        texture.wrap = [Wrap::Mirror; 2];
        assert!(
            texture
                .color(st)
                .abs_diff_eq(texture.color(DVec2::new(1.9, -0.3)), 1e-12)
        );
        texture.filter = Filter::Nearest;
        for place in [DVec2::ZERO, DVec2::ONE, DVec2::splat(1e300), DVec2::NAN] {
            assert!(texture.color(place).is_finite());
        }
        assert!((texture.color(DVec2::new(0.99, 0.99)).x - 1.0).abs() < 1e-15);
    }

    #[test]
    fn shares_are_the_stored_numbers_and_pictures_are_checked() {
        let texture = picture();
        let channel = Channel::Alpha;
        let found = ShareTexture { texture, channel }.share(DVec2::new(0.75, 0.25));
        assert!((found - 127.0 / 255.0).abs() < 1e-15);
        let wrong = |width, texels| Image::new(String::new(), width, 1, texels).is_err();
        assert!(wrong(2, Texels::Bytes(vec![[0; 4]])));
        assert!(wrong(0, Texels::Bytes(Vec::new())));
        assert!(wrong(1, Texels::Floats(vec![[0.0, f32::NAN, 0.0, 1.0]])));
    }
}
