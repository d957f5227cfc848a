//! Pictures of materials: made into what the format has, each stored once.

use std::io::{self, Cursor};

use glam::{DAffine2, DVec2, DVec3, DVec4};
use gltf::json::image::MimeType;
use gltf::json::texture::{Info, MagFilter, Sampler, WrappingMode};
use gltf::json::validation::Checked::Valid;
use gltf::json::{Image, Index, Root, Texture};
use image::{ImageFormat, RgbaImage};
use kernel::{Filter, Maps, ShareTexture, Texels, Wrap, bytes_from_linear};

use super::buffer::{Data, number};

/// Pictures that have been written, by what they are made of.
#[derive(Debug, Default)]
pub(super) struct Pictures {
    known: Vec<(Maps, Index<Texture>)>,
}

/// The pictures of a material as the format has them.
#[derive(Debug, Default)]
pub(super) struct Made {
    /// Base colour, with opacity as its alpha.
    pub(super) color: Option<Info>,
    /// Emitted light.
    pub(super) emissive: Option<Info>,
    /// Roughness in green and metalness in blue.
    pub(super) surface: Option<Info>,
}

/// The map from texture coordinates of shapes to those of the pictures of a material, which all
/// have the same in the file.
pub(super) fn placement(maps: &Maps) -> DAffine2 {
    let first = maps.textures().next();
    first.map_or(DAffine2::IDENTITY, |first| first.picture_from_shape)
}

impl Pictures {
    /// Writes the pictures of a material.
    ///
    /// # Errors
    /// If a picture cannot be encoded.
    pub(super) fn add(
        &mut self,
        maps: &Maps,
        data: &mut Data,
        root: &mut Root,
    ) -> io::Result<Made> {
        let color = Maps {
            color: maps.color.clone(),
            opacity: maps.opacity.clone(),
            ..Maps::default()
        };
        let emissive = Maps {
            emissive: maps.emissive.clone(),
            ..Maps::default()
        };
        let surface = Maps {
            metallic: maps.metallic.clone(),
            roughness: maps.roughness.clone(),
            ..Maps::default()
        };
        let mut one = |part: Maps, texel: Texel<'_>| {
            let found = part.textures().next().is_some();
            found.then(|| self.one(part, texel, data, root)).transpose()
        };
        let light = |map: &Option<kernel::Texture>, st| {
            map.as_ref()
                .map_or(DVec3::ONE, |map| map.color(st).truncate())
        };
        let share = |map: &Option<ShareTexture>, st| map.as_ref().map_or(1.0, |map| map.share(st));
        Ok(Made {
            color: one(color, &|maps, st| {
                let alpha = share(&maps.opacity, st);
                bytes_from_linear(light(&maps.color, st).extend(alpha))
            })?,
            emissive: one(emissive, &|maps, st| {
                bytes_from_linear(light(&maps.emissive, st).extend(1.0))
            })?,
            surface: one(surface, &|maps, st| {
                // Numbers, not colours: encoded as alpha is.
                let number = |x: f64| bytes_from_linear(DVec4::new(0.0, 0.0, 0.0, x))[3];
                let [rough, metal] =
                    [&maps.roughness, &maps.metallic].map(|map| number(share(map, st)));
                [u8::MAX, rough, metal, u8::MAX]
            })?,
        })
    }

    fn one(
        &mut self,
        maps: Maps,
        texel: Texel<'_>,
        data: &mut Data,
        root: &mut Root,
    ) -> io::Result<Info> {
        let known = self.known.iter().find(|(known, _)| *known == maps);
        let index = match known {
            Some((_, index)) => *index,
            None => {
                let index = write(&maps, texel, data, root)?;
                self.known.push((maps, index));
                index
            }
        };
        Ok(Info {
            index,
            tex_coord: 0,
            extensions: None,
            extras: None,
        })
    }
}

/// The texel of maps at a place.
type Texel<'a> = &'a dyn Fn(&Maps, DVec2) -> [u8; 4];

/// Writes one picture as large as the first of those that it is made of.
fn write(
    maps: &Maps,
    texel: Texel<'_>,
    data: &mut Data,
    root: &mut Root,
) -> io::Result<Index<Texture>> {
    let first = maps
        .textures()
        .next()
        .expect("asked for only with a picture");
    let (image, sampler) = (&first.image, sampler(first));
    let shape_from_picture = first.picture_from_shape.inverse();
    let (width, height) = (image.width(), image.height());
    let bytes: Vec<u8> = match image.texels() {
        // What is stored as it is read loses nothing.
        Texels::Bytes(texels)
            if maps.color.is_some() != maps.emissive.is_some() && maps.opacity.is_none() =>
        {
            texels
                .iter()
                .flat_map(|t| [t[0], t[1], t[2], u8::MAX])
                .collect()
        }
        _ => {
            let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
            let place = |(x, y): (usize, usize)| {
                let s = (x as f64 + 0.5) / width as f64;
                let t = 1.0 - (y as f64 + 0.5) / height as f64;
                shape_from_picture.transform_point2(DVec2::new(s, t))
            };
            places.flat_map(|at| texel(maps, place(at))).collect()
        }
    };
    let encoded = encoded(width, height, bytes)?;
    data.add_picture(encoded);
    root.images.push(Image {
        buffer_view: None,
        mime_type: Some(MimeType("image/png".to_owned())),
        name: (!image.name().is_empty()).then(|| image.name().to_owned()),
        uri: None,
        extensions: None,
        extras: None,
    });
    root.samplers.push(sampler);
    root.textures.push(Texture {
        name: None,
        sampler: Some(Index::new(number(root.samplers.len() - 1))),
        source: Index::new(number(root.images.len() - 1)),
        extensions: None,
        extras: None,
    });
    Ok(Index::new(number(root.textures.len() - 1)))
}

/// A PNG, without alpha where all is opaque.
fn encoded(width: usize, height: usize, texels: Vec<u8>) -> io::Result<Vec<u8>> {
    let opaque = texels
        .iter()
        .skip(3)
        .step_by(4)
        .all(|&alpha| alpha == u8::MAX);
    let image = RgbaImage::from_raw(number(width), number(height), texels);
    let image = image::DynamicImage::from(image.expect("four bytes for each texel"));
    let image = if opaque {
        image.into_rgb8().into()
    } else {
        image
    };
    let mut bytes = Cursor::new(Vec::new());
    let written = image.write_to(&mut bytes, ImageFormat::Png);
    written.map_err(io::Error::other)?;
    Ok(bytes.into_inner())
}

fn sampler(texture: &kernel::Texture) -> Sampler {
    let [wrap_s, wrap_t] = texture.wrap.map(|wrap| {
        Valid(match wrap {
            Wrap::Repeat => WrappingMode::Repeat,
            Wrap::Mirror => WrappingMode::MirroredRepeat,
            Wrap::Clamp => WrappingMode::ClampToEdge,
        })
    });
    let filter = match texture.filter {
        Filter::Linear => MagFilter::Linear,
        Filter::Nearest => MagFilter::Nearest,
    };
    Sampler {
        mag_filter: Some(Valid(filter)),
        wrap_s,
        wrap_t,
        ..Sampler::default()
    }
}
