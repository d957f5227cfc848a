//! Maps of materials: pictures, with the options that stand before their names.

use std::sync::Arc;

use glam::{DAffine2, DMat2, DVec2};
use kernel::{Channel, Filter, Image, ShareTexture, Texels, Texture, Wrap};

use super::invalid;
use super::statements::{number, shown};
use crate::pictures::{Picture, Pictures};
use crate::{Problem, ReadOptions};

/// What a statement says about a picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map<'a> {
    /// The name of its file.
    name: &'a str,
    /// Picture coordinates are texture coordinates times `-s` plus `-o`.
    scale: DVec2,
    offset: DVec2,
    wrap: Wrap,
    filter: Filter,
    /// `-mm`: what is added to every number, and what it is multiplied by before.
    base: f64,
    gain: f64,
    /// The number of a texel that counts, if that is said.
    channel: Option<Channel>,
    /// An option that says something and is not followed.
    pub(super) ignored: Option<&'static str>,
}

impl<'a> Map<'a> {
    /// Reads what follows the keyword.
    pub(super) fn parse(text: &'a str) -> Result<Self, Problem> {
        let mut map = Self {
            name: "",
            scale: DVec2::ONE,
            offset: DVec2::ZERO,
            wrap: Wrap::Repeat,
            filter: Filter::Linear,
            base: 0.0,
            gain: 1.0,
            channel: None,
            ignored: None,
        };
        let mut rest = text;
        while rest.starts_with('-') {
            let word = take_word(&mut rest);
            if rest.is_empty() {
                // A name that looks like an option.
                rest = word;
                break;
            }
            map.option(word, &mut rest)?;
        }
        map.name = rest.trim_matches('"');
        if map.name.is_empty() {
            return Err(invalid("the name of the picture is missing"));
        }
        Ok(map)
    }

    fn option(&mut self, word: &str, rest: &mut &'a str) -> Result<(), Problem> {
        match word {
            "-s" => {
                let found = take_numbers(rest, 1, 3)?;
                self.scale = DVec2::new(found[0], found.get(1).copied().unwrap_or(1.0));
            }
            "-o" => {
                let found = take_numbers(rest, 1, 3)?;
                self.offset = DVec2::new(found[0], found.get(1).copied().unwrap_or(0.0));
            }
            "-mm" => {
                let found = take_numbers(rest, 1, 2)?;
                (self.base, self.gain) = (found[0], found.get(1).copied().unwrap_or(1.0));
            }
            "-t" => {
                if take_numbers(rest, 1, 3)?.iter().any(|x| x.abs() > 0.0) {
                    self.ignored = Some("turbulence is not used");
                }
            }
            "-clamp" => {
                self.wrap = match take_switch(rest)? {
                    true => Wrap::Clamp,
                    false => Wrap::Repeat,
                };
            }
            "-blendu" | "-blendv" => {
                if !take_switch(rest)? {
                    self.filter = Filter::Nearest;
                }
            }
            "-cc" => {
                if take_switch(rest)? {
                    self.ignored = Some("colour correction is not used");
                }
            }
            // Pictures are looked up in full detail; relief is not shown.
            "-boost" | "-texres" | "-bm" => {
                take_numbers(rest, 1, 1)?;
            }
            "-type" => {
                take_word(rest);
            }
            "-imfchan" => {
                self.channel = Some(match take_word(rest) {
                    "r" => Channel::Red,
                    "g" => Channel::Green,
                    "b" => Channel::Blue,
                    "m" => Channel::Alpha,
                    "l" => Channel::Mean,
                    "z" => {
                        let text = "depths of pictures are not used".to_owned();
                        return Err(Problem::Unsupported(text));
                    }
                    word => {
                        let word = shown(word);
                        return Err(invalid(format!("\"{word}\" is none of r, g, b, m, l, z")));
                    }
                });
            }
            _ => {
                let word = shown(word);
                return Err(invalid(format!("\"{word}\" is not an option of maps")));
            }
        }
        Ok(())
    }

    /// The picture, looked for from the folder of the material file on; names that lead
    /// elsewhere, as programs write them, are looked for by their last part.
    fn picture(
        &self,
        folder: &str,
        pictures: &mut Pictures,
        options: &ReadOptions<'_>,
    ) -> Result<Picture, Problem> {
        let plain = self.name.replace('\\', "/");
        let last = plain.rsplit('/').next().unwrap_or("");
        let mut problem = None;
        for (folder, name) in [(folder, plain.as_str()), (folder, last), ("", last)] {
            match pictures.load(&format!("{folder}{name}"), options) {
                Ok(picture) => return Ok(picture),
                Err(text) => problem = problem.or(Some(text)),
            }
        }
        let name = shown(&plain);
        Err(invalid(format!(
            "picture \"{name}\": {}",
            problem.unwrap_or_default()
        )))
    }

    /// The picture as it is used.
    pub(super) fn texture(
        &self,
        folder: &str,
        pictures: &mut Pictures,
        options: &ReadOptions<'_>,
    ) -> Result<Texture, Problem> {
        let image = self.picture(folder, pictures, options)?.image;
        let is_changed = self.base.abs() > 0.0 || (self.gain - 1.0).abs() > 0.0;
        let image = match is_changed {
            true => Arc::new(remapped(&image, self.base, self.gain)?),
            false => image,
        };
        Ok(Texture {
            image,
            wrap: [self.wrap; 2],
            filter: self.filter,
            picture_from_shape: DAffine2::from_mat2_translation(
                DMat2::from_diagonal(self.scale),
                self.offset,
            ),
        })
    }

    /// The picture as shares of one: of its alpha, if that is what the map is about and it has
    /// any, else of its brightness, unless the statement names a channel.
    pub(super) fn share(
        &self,
        is_opacity: bool,
        folder: &str,
        pictures: &mut Pictures,
        options: &ReadOptions<'_>,
    ) -> Result<ShareTexture, Problem> {
        let texture = self.texture(folder, pictures, options)?;
        let usual = match is_opacity && texture.image.has_alpha() {
            true => Channel::Alpha,
            false => Channel::Mean,
        };
        let channel = self.channel.unwrap_or(usual);
        Ok(ShareTexture { texture, channel })
    }
}

/// A picture with all numbers but alpha times `gain` plus `base`. It is in no file any more,
/// and so has no name.
fn remapped(image: &Image, base: f64, gain: f64) -> Result<Image, Problem> {
    let share = |x: f64| (base + gain * x).clamp(0.0, 1.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "shares of 255"
    )]
    let byte = |x: u8| (share(f64::from(x) / 255.0) * 255.0).round() as u8;
    #[expect(clippy::cast_possible_truncation, reason = "pictures have few digits")]
    let float = |x: f32| (base + gain * f64::from(x)).max(0.0) as f32;
    let texels = match image.texels() {
        Texels::Bytes(texels) => Texels::Bytes(
            texels
                .iter()
                .map(|&[r, g, b, a]| [byte(r), byte(g), byte(b), a])
                .collect(),
        ),
        Texels::Floats(texels) => Texels::Floats(
            texels
                .iter()
                .map(|&[r, g, b, a]| [float(r), float(g), float(b), a])
                .collect(),
        ),
    };
    Ok(Image::new(
        String::new(),
        image.width(),
        image.height(),
        texels,
    )?)
}

/// Takes the first word off a text without blanks around it.
fn take_word<'a>(rest: &mut &'a str) -> &'a str {
    let (word, after) = rest
        .split_once(|c: char| c.is_ascii_whitespace())
        .unwrap_or((rest, ""));
    *rest = after.trim_start();
    word
}

/// Takes `on` or `off`.
fn take_switch(rest: &mut &str) -> Result<bool, Problem> {
    match take_word(rest) {
        "on" => Ok(true),
        "off" => Ok(false),
        word => {
            let word = shown(word);
            Err(invalid(format!("\"{word}\" where on or off is needed")))
        }
    }
}

/// Takes numbers, as many as there are up to `most`.
fn take_numbers(rest: &mut &str, least: usize, most: usize) -> Result<Vec<f64>, Problem> {
    let mut found = Vec::new();
    while found.len() < most {
        let mut after = *rest;
        match number(take_word(&mut after)) {
            Ok(value) => found.push(value),
            Err(text) if found.len() < least => return Err(invalid(text)),
            Err(_) => break,
        }
        *rest = after;
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_come_before_a_name_with_blanks() {
        let text = "-s 2 3 1 -o 0.5 -clamp on -mm 0.1 0.8 -imfchan g -blendu off -bm 2 -cc on \
                    -t 0 my wood.png";
        let map = Map::parse(text).unwrap();
        assert_eq!(map.name, "my wood.png");
        assert_eq!(
            (map.scale, map.offset),
            (DVec2::new(2.0, 3.0), DVec2::new(0.5, 0.0))
        );
        assert_eq!((map.wrap, map.filter), (Wrap::Clamp, Filter::Nearest));
        assert_eq!((map.base, map.gain), (0.1, 0.8));
        assert_eq!(map.channel, Some(Channel::Green));
        assert!(map.ignored.is_some_and(|text| text.contains("correction")));
        for (text, name) in [
            ("-s -1 -1 a.png", "a.png"),
            ("\"quoted name.png\"", "quoted name.png"),
            ("-odd.png", "-odd.png"),
            ("-o 1 2 3 4.png", "4.png"),
        ] {
            assert_eq!(Map::parse(text).unwrap().name, name);
        }
        for (text, message) in [
            ("", "the name of the picture is missing"),
            ("-s wood.png a", "\"wood.png\" is not a finite number"),
            ("-clamp maybe a.png", "\"maybe\" where on or off is needed"),
            ("-imfchan x a.png", "\"x\" is none of r, g, b, m, l, z"),
            ("-shiny 3 a.png", "\"-shiny\" is not an option of maps"),
        ] {
            assert_eq!(Map::parse(text).unwrap_err().to_string(), message);
        }
    }

    #[test]
    fn numbers_of_pictures_are_remapped() {
        let texels = Texels::Bytes(vec![[0, 255, 51, 7]]);
        let image = Image::new("a.png".into(), 1, 1, texels).unwrap();
        let changed = remapped(&image, 0.2, 0.5).unwrap();
        assert_eq!(changed.texels(), &Texels::Bytes(vec![[51, 179, 77, 7]]));
        assert_eq!(changed.name(), "");
    }
}
