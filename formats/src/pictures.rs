//! Pictures that files name: fetched through the [`crate::Resolver`], decoded by `image`, each
//! once.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use image::{ColorType, DynamicImage, ImageFormat, ImageReader};
use kernel::{Image, Texels, linear_from_srgb};

use glam::DVec3;

use crate::ReadOptions;

/// Why a file that is named is not read.
pub(crate) const REMOTE: &str = "only local files are read";

/// A picture, and what its file says about its numbers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Picture {
    pub(crate) image: Arc<Image>,
    /// Numbers of a texel: 1 grey, 2 grey with alpha, 3 colours, 4 colours with alpha.
    pub(crate) components: u8,
}

/// The pictures of one file and of those inside it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Pictures {
    /// By name; for those that could not be read, why.
    known: HashMap<String, Result<Picture, String>>,
    /// Texels of all together.
    texels: usize,
}

/// Bytes that decoders may take for each texel that a picture may have.
const ROOM: u64 = 32;

impl Pictures {
    /// The picture in a file, or why it cannot be used.
    pub(crate) fn load(
        &mut self,
        name: &str,
        options: &ReadOptions<'_>,
    ) -> Result<Picture, String> {
        if let Some(known) = self.known.get(name) {
            return known.clone();
        }
        let picture = self.fetch(name, options);
        self.known.insert(name.to_owned(), picture.clone());
        picture
    }

    fn fetch(&mut self, name: &str, options: &ReadOptions<'_>) -> Result<Picture, String> {
        if name.contains("://") {
            return Err(REMOTE.to_owned());
        }
        let bytes = options.resolver.resolve(name);
        let bytes = bytes.map_err(|problem| problem.to_string())?;
        let left = options.limits.texels - self.texels.min(options.limits.texels);
        let picture = decode(name, &bytes, left)?;
        self.texels += picture.image.width() * picture.image.height();
        Ok(picture)
    }
}

/// Decodes a picture of at most `limit` texels; its name tells the format where its content
/// does not.
fn decode(name: &str, bytes: &[u8], limit: usize) -> Result<Picture, String> {
    let told = image::guess_format(bytes).or_else(|_| ImageFormat::from_path(Path::new(name)));
    let format = told.map_err(|_| "no picture that can be read".to_owned())?;
    let reader = || ImageReader::with_format(Cursor::new(bytes), format);
    let size = reader().into_dimensions();
    let (width, height) = size.map_err(|problem| problem.to_string())?;
    let (width, height) = (width as usize, height as usize);
    if width.saturating_mul(height) > limit {
        return Err(format!(
            "{width} x {height} texels; {limit} are left of what all pictures may have"
        ));
    }
    let mut reader = reader();
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(limit as u64 * ROOM);
    reader.limits(limits);
    let decoded = reader.decode().map_err(|problem| problem.to_string())?;
    let components = decoded.color().channel_count();
    let image = Image::new(name.to_owned(), width, height, texels(decoded));
    let image = Arc::new(image.map_err(|problem| problem.to_string())?);
    Ok(Picture { image, components })
}

/// What is deeper than eight bits becomes linear light; floating point is that already.
fn texels(decoded: DynamicImage) -> Texels {
    match decoded.color() {
        ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8 => {
            let pixels = decoded.into_rgba8();
            Texels::Bytes(pixels.pixels().map(|p| p.0).collect())
        }
        ColorType::Rgb32F | ColorType::Rgba32F => {
            let pixels = decoded.into_rgba32f();
            Texels::Floats(pixels.pixels().map(|p| p.0).collect())
        }
        _ => {
            let pixels = decoded.into_rgba32f();
            Texels::Floats(pixels.pixels().map(|p| linear(p.0)).collect())
        }
    }
}

fn linear([r, g, b, a]: [f32; 4]) -> [f32; 4] {
    let color = linear_from_srgb(DVec3::new(f64::from(r), f64::from(g), f64::from(b)));
    let [r, g, b] = color.as_vec3().to_array();
    [r, g, b, a]
}

#[cfg(test)]
pub(crate) mod tests {
    use std::io;

    use super::*;
    use crate::{Limits, Resolver};

    /// Files in memory.
    pub(crate) struct Files(pub(crate) Vec<(&'static str, Vec<u8>)>);

    impl Resolver for Files {
        fn resolve(&self, name: &str) -> io::Result<Vec<u8>> {
            let found = self.0.iter().find(|file| file.0 == name);
            found
                .map(|file| file.1.clone())
                .ok_or_else(|| io::ErrorKind::NotFound.into())
        }
    }

    /// A picture file.
    pub(crate) fn encoded(picture: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    /// Red and half transparent green.
    pub(crate) fn red_green() -> DynamicImage {
        let texels = vec![255, 0, 0, 255, 0, 255, 0, 128];
        image::RgbaImage::from_raw(2, 1, texels).unwrap().into()
    }

    fn load(files: &Files, limits: &Limits, name: &str) -> Result<Picture, String> {
        let options = ReadOptions {
            limits,
            resolver: files,
        };
        Pictures::default().load(name, &options)
    }

    #[test]
    fn pictures_of_several_formats_are_the_same() {
        let formats = [
            ("a.png", ImageFormat::Png),
            ("a.tga", ImageFormat::Tga),
            ("a.bmp", ImageFormat::Bmp),
            ("a.gif", ImageFormat::Gif),
        ];
        let files = formats.map(|(name, format)| (name, encoded(&red_green(), format)));
        let files = Files(files.to_vec());
        let first = Texels::Bytes(vec![[255, 0, 0, 255], [0, 255, 0, 128]]);
        for (name, _) in formats {
            let found = load(&files, &Limits::default(), name).unwrap();
            assert_eq!((found.image.width(), found.image.height()), (2, 1));
            assert_eq!(found.image.name(), name);
            if name != "a.gif" {
                assert_eq!(
                    (found.image.texels(), found.components),
                    (&first, 4),
                    "{name}"
                );
            }
        }
    }

    #[test]
    fn deep_pictures_are_linear_light() {
        let deep = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(1, 1, vec![0x8080]).unwrap();
        let bright = image::Rgb32FImage::from_raw(1, 1, vec![4.0, 0.5, 0.0]).unwrap();
        let files = Files(vec![
            ("deep.png", encoded(&deep.into(), ImageFormat::Png)),
            ("bright.exr", encoded(&bright.into(), ImageFormat::OpenExr)),
        ]);
        let deep = load(&files, &Limits::default(), "deep.png").unwrap();
        let Texels::Floats(texels) = deep.image.texels() else {
            panic!("16 bits are more than 8");
        };
        let expected = linear_from_srgb(DVec3::splat(f64::from(0x80) / 255.0)).x;
        assert!((f64::from(texels[0][0]) - expected).abs() < 1e-6);
        assert_eq!(deep.components, 1);
        let bright = load(&files, &Limits::default(), "bright.exr").unwrap();
        let expected = Texels::Floats(vec![[4.0, 0.5, 0.0, 1.0]]);
        assert_eq!(bright.image.texels(), &expected);
    }

    #[test]
    fn what_is_no_picture_or_too_large_is_told() {
        let mut huge = encoded(&red_green(), ImageFormat::Bmp);
        huge[18..26].copy_from_slice(&[0xff, 0xff, 0, 0, 0xff, 0xff, 0, 0]);
        let mut cut = encoded(&red_green(), ImageFormat::Png);
        cut.truncate(50);
        let files = Files(vec![
            ("huge.bmp", huge),
            ("cut.png", cut),
            ("text.png", b"hello".to_vec()),
            ("good.png", encoded(&red_green(), ImageFormat::Png)),
        ]);
        let limits = Limits {
            texels: 1,
            ..Limits::default()
        };
        let found = load(&files, &limits, "good.png").unwrap_err();
        let expected = "2 x 1 texels; 1 are left of what all pictures may have";
        assert_eq!(found, expected);
        for name in [
            "huge.bmp",
            "cut.png",
            "text.png",
            "none.png",
            "http://a/b.png",
        ] {
            assert!(load(&files, &Limits::default(), name).is_err(), "{name}");
        }
    }
}
