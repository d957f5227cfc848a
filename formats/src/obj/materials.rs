//! `.mtl` files, with the physically based extension that many programs write.
//!
//! A statement that cannot be read costs only itself.

use std::collections::{HashMap, HashSet};

use glam::{DMat3, DVec3};
use kernel::{Maps, Material, MetallicRoughness, linear_from_srgb};

use super::invalid;
use super::maps::Map;
use super::statements::{Statement, Statements, decode, number, numbers};
use crate::pictures::Pictures;
use crate::{Place, Problem, ReadOptions, Warnings};

/// How many material files one file may name.
const FILES: usize = 1000;

/// Where material files and their pictures come from, and what has come so far.
pub(super) struct Source<'a> {
    options: &'a ReadOptions<'a>,
    pictures: Pictures,
    /// The names of files, each of which is looked for once.
    names: HashSet<String>,
}

impl<'a> Source<'a> {
    pub(super) fn new(options: &'a ReadOptions<'a>) -> Self {
        Self {
            options,
            pictures: Pictures::default(),
            names: HashSet::new(),
        }
    }
}

/// Reads the files that an `mtllib` statement names. The whole rest of the line is tried as
/// one name first, since names with blanks occur.
pub(super) fn load(
    names: &str,
    line: usize,
    source: &mut Source<'_>,
    warnings: &mut Warnings,
    materials: &mut HashMap<String, Material>,
) {
    if source.names.contains(names) {
        return;
    }
    let place = Place::item(line, "mtllib");
    if source.names.len() >= FILES {
        let text = format!("more than {FILES} material files are named");
        return warnings.add(place, Problem::TooLarge(text));
    }
    source.names.insert(names.to_owned());
    let resolver = source.options.resolver;
    // Some programs write where the file was on their machine.
    let last = names.rsplit(['/', '\\']).next().unwrap_or(names);
    let bytes = resolver
        .resolve(names)
        .or_else(|error| resolver.resolve(last).map_err(|_| error));
    match bytes {
        Ok(bytes) => {
            let file = File {
                name: names,
                line,
                source,
            };
            file.read(&decode(&bytes), warnings, materials);
        }
        Err(_) if names.contains(" #") => {
            // A comment behind them.
            let bare = names.split(" #").next().unwrap_or_default();
            load(bare.trim_end(), line, source, warnings, materials);
        }
        Err(_) if names.contains(char::is_whitespace) => {
            for name in names.split_whitespace() {
                load(name, line, source, warnings, materials);
            }
        }
        Err(error) => {
            let text = format!("material file \"{names}\" is not there: {error}");
            warnings.invalid(place, text);
        }
    }
}

/// A material file that is being read.
struct File<'f, 'a> {
    name: &'f str,
    /// The line that names it.
    line: usize,
    source: &'f mut Source<'a>,
}

impl File<'_, '_> {
    /// Reads all materials; the first one of a name counts.
    fn read(
        mut self,
        text: &str,
        warnings: &mut Warnings,
        materials: &mut HashMap<String, Material>,
    ) {
        let mut draft: Option<Draft> = None;
        let (name, named_at) = (self.name, self.line);
        let place = |line: usize, keyword: &str| {
            Place::item(named_at, format!("{name} line {line}, {keyword}"))
        };
        let mut finish = |draft: Option<Draft>, warnings: &mut Warnings| {
            if let Some(draft) = draft {
                if let Some(line) = draft.other_ambient() {
                    let text = "pictures of ambient light are not used";
                    warnings.unsupported(place(line, "map_Ka"), text);
                }
                if let Some(line) = draft.refracts() {
                    let text = "refraction is not followed";
                    warnings.unsupported(place(line, "Ni"), text);
                }
                let entry = materials.entry(draft.name.clone());
                entry.or_insert_with(|| draft.finish());
            }
        };
        for statement in Statements::new(text) {
            let result = match (statement.keyword(), statement.rest(), &mut draft) {
                ("newmtl", "", _) => {
                    finish(draft.take(), warnings);
                    Err(invalid("a material without name"))
                }
                ("newmtl", name, _) => {
                    finish(draft.replace(Draft::new(name)), warnings);
                    Ok(())
                }
                (_, _, Some(draft)) => self.take(&statement, draft),
                (_, _, None) => Err(invalid("no material with a name before it")),
            };
            if let Err(problem) = result {
                warnings.add(place(statement.line, statement.keyword()), problem);
            }
        }
        finish(draft, warnings);
    }

    /// Takes a statement of a material.
    fn take(&mut self, statement: &Statement<'_>, draft: &mut Draft) -> Result<(), Problem> {
        let keyword = statement.keyword();
        match keyword {
            "map_Kd" | "map_Ks" | "map_Ke" | "map_d" | "map_Pr" | "map_Pm" => {}
            "map_Ka" => {
                draft.ambient_map = Some((statement.line, statement.rest().to_owned()));
                return Ok(());
            }
            "map_aat" => return Ok(()),
            "bump" | "map_bump" | "map_Bump" | "norm" | "disp" | "map_disp" | "decal" => {
                Map::parse(statement.rest())?;
                return unsupported("pictures of relief and decals are not used");
            }
            "refl" | "map_refl" => return unsupported("pictures of the surroundings are not used"),
            "map_Ns" | "map_Ps" => {
                Map::parse(statement.rest())?;
                return unsupported("pictures of highlights and sheen are not used");
            }
            _ => return draft.take(statement),
        }
        let map = Map::parse(statement.rest())?;
        let folder = self
            .name
            .rfind(['/', '\\'])
            .map_or("", |at| &self.name[..=at]);
        let (pictures, options) = (&mut self.source.pictures, self.source.options);
        let maps = &mut draft.maps;
        match keyword {
            "map_Kd" => {
                maps.color = Some(map.texture(folder, pictures, options)?);
                statement.rest().clone_into(&mut draft.color_text);
            }
            "map_Ks" => maps.specular = Some(map.texture(folder, pictures, options)?),
            "map_Ke" => maps.emissive = Some(map.texture(folder, pictures, options)?),
            "map_d" => maps.opacity = Some(map.share(true, folder, pictures, options)?),
            "map_Pr" => maps.roughness = Some(map.share(false, folder, pictures, options)?),
            _ => maps.metallic = Some(map.share(false, folder, pictures, options)?),
        }
        map.ignored.map_or(Ok(()), unsupported)
    }
}

/// A material while its statements are read.
#[derive(Clone, Debug, Default)]
struct Draft {
    name: String,
    /// Linear colours.
    ambient: Option<DVec3>,
    diffuse: Option<DVec3>,
    specular: Option<DVec3>,
    emissive: Option<DVec3>,
    shininess: Option<f64>,
    dissolve: Option<f64>,
    transparency: Option<f64>,
    /// The illumination model, 0 to 10.
    model: Option<u8>,
    /// The index of refraction, and in which line.
    index: Option<(usize, f64)>,
    roughness: Option<f64>,
    metallic: Option<f64>,
    maps: Maps,
    /// What its `map_Kd` says.
    color_text: String,
    /// What its `map_Ka` says, and in which line.
    ambient_map: Option<(usize, String)>,
}

impl Draft {
    fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            ..Self::default()
        }
    }

    /// Takes a statement.
    fn take(&mut self, statement: &Statement<'_>) -> Result<(), Problem> {
        let keyword = statement.keyword();
        match keyword {
            "Ka" => self.ambient = Some(color(statement, 1.0)?),
            "Kd" => self.diffuse = Some(color(statement, 1.0)?),
            "Ks" => self.specular = Some(color(statement, 1.0)?),
            "Ke" => self.emissive = Some(color(statement, 1e3)?),
            "Ns" => self.shininess = Some(value(statement)?.clamp(0.0, 1e4)),
            "d" if statement.arguments().next() == Some("-halo") => {
                return unsupported("opacity that depends on the angle is not used");
            }
            "d" => self.dissolve = Some(value(statement)?.clamp(0.0, 1.0)),
            "Tr" => self.transparency = Some(value(statement)?.clamp(0.0, 1.0)),
            "Pr" => self.roughness = Some(value(statement)?.clamp(0.0, 1.0)),
            "Pm" => self.metallic = Some(value(statement)?.clamp(0.0, 1.0)),
            "illum" => {
                let word = statement.arguments().next().unwrap_or("");
                let model = word.parse().ok().filter(|model| *model <= 10);
                let message = || invalid("the illumination model is a number from 0 to 10");
                self.model = Some(model.ok_or_else(message)?);
            }
            // Programs write a grey filter and an index of refraction for all they have.
            "Tf" => {
                let filter = color(statement, f64::INFINITY)?;
                if filter.min_element() < filter.max_element() {
                    return unsupported("light that shines through is not coloured");
                }
            }
            "Ni" => self.index = Some((statement.line, value(statement)?)),
            "sharpness" => {
                value(statement)?;
            }
            "Ps" | "Pc" | "Pcr" | "aniso" | "anisor" => {
                if value(statement)? > 0.0 {
                    return unsupported("sheen, clear coat and anisotropy are not used");
                }
            }
            _ => return unsupported("statements of this kind are not known"),
        }
        Ok(())
    }

    /// The line of a picture of ambient light that is not that of the colour again, as it mostly is.
    fn other_ambient(&self) -> Option<usize> {
        let (line, text) = self.ambient_map.as_ref()?;
        (*text != self.color_text).then_some(*line)
    }

    /// The line of an index of refraction that its illumination model asks for.
    fn refracts(&self) -> Option<usize> {
        let (line, index) = self.index?;
        let asks = matches!(self.model, Some(6 | 7));
        (asks && index > 1.0).then_some(line)
    }

    /// Our material. What has a picture and no number of its own is all of that picture, and so
    /// is what is black: programs write that where they mean the picture.
    fn finish(self) -> Material {
        let default = Material::default();
        let maps = self.maps;
        let whole = |own: Option<DVec3>, has_map: bool, usual: DVec3| match own {
            Some(color) if color != DVec3::ZERO || !has_map => color,
            _ if has_map => DVec3::ONE,
            _ => usual,
        };
        let diffuse = whole(self.diffuse, maps.color.is_some(), default.diffuse);
        // Models 0 and 1 have no highlights.
        let is_shiny = self.model.is_none_or(|model| model > 1);
        let gloss = maps.specular.as_ref().map(|_| DVec3::ONE);
        let share = |own: Option<f64>, has_map: bool| own.or(has_map.then_some(1.0));
        let roughness = share(self.roughness, maps.roughness.is_some());
        let metallic = share(self.metallic, maps.metallic.is_some());
        let is_physical = roughness.is_some() || metallic.is_some();
        let model = is_physical.then(|| MetallicRoughness {
            base_color: diffuse,
            metallic: metallic.unwrap_or(0.0),
            roughness: roughness.unwrap_or(0.5),
        });
        let usual = model.map(Material::physical);
        let gloss = gloss.or(usual.as_ref().map(|usual| usual.specular));
        let specular = self.specular.or(gloss).filter(|_| is_shiny);
        let shininess = usual.map_or(default.shininess, |usual| usual.shininess);
        let mut material = Material {
            name: self.name,
            ambient: self.ambient.unwrap_or(diffuse),
            // Metals reflect their colour as highlights only.
            diffuse: diffuse * (1.0 - model.map_or(0.0, |model| model.metallic)),
            specular: specular.unwrap_or(DVec3::ZERO),
            shininess: self.shininess.unwrap_or(shininess),
            emissive: whole(self.emissive, maps.emissive.is_some(), DVec3::ZERO),
            opacity: self
                .dissolve
                .unwrap_or(1.0 - self.transparency.unwrap_or(0.0)),
            metallic_roughness: model,
            maps,
            back: None,
        };
        if self.model == Some(0) {
            // A colour that no light changes.
            material.emissive = diffuse;
            material.maps.emissive = material.maps.color.take();
            (material.ambient, material.diffuse) = (DVec3::ZERO, DVec3::ZERO);
            material.metallic_roughness = None;
        }
        material
    }
}

fn unsupported(text: &str) -> Result<(), Problem> {
    Err(Problem::Unsupported(text.to_owned()))
}

/// The first number of a statement.
fn value(statement: &Statement<'_>) -> Result<f64, Problem> {
    number(statement.arguments().next().unwrap_or("")).map_err(invalid)
}

/// The linear colour of a statement: sRGB values up to `most`, or CIE XYZ; one number stands
/// for all three.
fn color(statement: &Statement<'_>, most: f64) -> Result<DVec3, Problem> {
    let mut words = statement.arguments().peekable();
    if words.peek() == Some(&"spectral") {
        let text = "colours by their spectrum are not used".to_owned();
        return Err(Problem::Unsupported(text));
    }
    let is_xyz = words.next_if_eq(&"xyz").is_some();
    let found = numbers(words).map_err(invalid)?;
    let color = match found[..] {
        [r] => DVec3::splat(r),
        [r, g, b, ..] => DVec3::new(r, g, b),
        _ => {
            let found = found.len();
            return Err(invalid(format!("{found} numbers; a colour has 1 or 3")));
        }
    };
    Ok(match is_xyz {
        true => (RGB_FROM_XYZ * color).clamp(DVec3::ZERO, DVec3::splat(most)),
        false => linear_from_srgb(color.clamp(DVec3::ZERO, DVec3::splat(most))),
    })
}

/// Linear light with the primaries of sRGB from CIE XYZ (IEC 61966-2-1).
const RGB_FROM_XYZ: DMat3 = DMat3::from_cols_array(&[
    3.2406, -0.9689, 0.0557, -1.5372, 1.8758, -0.2040, -0.4986, 0.0415, 1.0570,
]);

/// The material of a name. What follows a `#` may belong to the name, and is a comment if there is no
/// other way.
pub(super) fn named<'m>(known: &'m HashMap<String, Material>, name: &str) -> Option<&'m Material> {
    let bare = |name: &'_ str| {
        name.split(" #")
            .next()
            .unwrap_or_default()
            .trim_end()
            .to_owned()
    };
    let wanted = bare(name);
    let commented = || {
        let mut same = known.iter().filter(|(own, _)| bare(own) == wanted);
        same.next()
            .filter(|_| same.next().is_none())
            .map(|(_, material)| material)
    };
    let found = known.get(name).or_else(|| known.get(&wanted));
    found.or_else(commented)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use glam::{DVec2, DVec4};
    use kernel::{Channel, Wrap};

    use super::*;
    use crate::pictures::tests::{Files, encoded, red_green};
    use crate::{Limits, NoFiles, Resolver};

    fn parse(text: &str) -> (HashMap<String, Material>, Warnings) {
        parse_with(text, &NoFiles)
    }

    fn parse_with(text: &str, resolver: &dyn Resolver) -> (HashMap<String, Material>, Warnings) {
        let (mut materials, mut warnings) = (HashMap::new(), Warnings::default());
        let limits = Limits::default();
        let options = ReadOptions {
            limits: &limits,
            resolver,
        };
        let mut source = Source::new(&options);
        let file = File {
            name: "sub/a.mtl",
            line: 7,
            source: &mut source,
        };
        file.read(text, &mut warnings, &mut materials);
        (materials, warnings)
    }

    #[test]
    fn maps_are_pictures_of_the_folder_with_their_options() {
        let files = Files(vec![(
            "sub/two.png",
            encoded(&red_green(), image::ImageFormat::Png),
        )]);
        let text = "newmtl a\nKd 0 0 0\nmap_Kd -s 2 2 1 -o 0.5 0 0 two.png\n\
                    map_Ka -s 2 2 1 -o 0.5 0 0 two.png\nmap_d C:\\work\\two.png\n\
                    map_Pr -imfchan g two.png\nmap_Ke -clamp on two.png\nbump -bm 2 two.png\n\
                    map_Ks none.png\nmap_Ns two.png\nmap_aat on\n\
                    newmtl b\nillum 0\nmap_Kd two.png\n";
        let (materials, warnings) = parse_with(text, &files);
        let a = &materials["a"];
        // Black would hide the picture.
        assert_eq!((a.diffuse, a.emissive), (DVec3::ONE, DVec3::ONE));
        let color = a.maps.color.as_ref().unwrap();
        assert_eq!(color.image.name(), "sub/two.png");
        // s = 2 * 0.375 + 0.5 is a quarter into the repeated picture.
        let red = color.color(DVec2::new(0.375, 0.5));
        assert!(
            red.abs_diff_eq(DVec4::new(1.0, 0.0, 0.0, 1.0), 1e-12),
            "{red}"
        );
        let opacity = a.maps.opacity.as_ref().unwrap();
        assert_eq!(opacity.channel, Channel::Alpha);
        assert!((opacity.share(DVec2::new(0.75, 0.5)) - 128.0 / 255.0).abs() < 1e-12);
        let roughness = a.maps.roughness.as_ref().unwrap();
        assert!((roughness.share(DVec2::new(0.75, 0.5)) - 1.0).abs() < 1e-12);
        let model = a.metallic_roughness.unwrap();
        assert_eq!((model.roughness, model.metallic), (1.0, 0.0));
        assert_eq!(a.maps.emissive.as_ref().unwrap().wrap, [Wrap::Clamp; 2]);
        let b = &materials["b"];
        assert!(b.is_unlit() && b.maps.emissive.is_some() && b.maps.color.is_none());
        let found: Vec<_> = warnings
            .as_slice()
            .iter()
            .map(ToString::to_string)
            .collect();
        assert_eq!(found.len(), 3, "{found:?}");
        assert!(found[0].ends_with("bump: pictures of relief and decals are not used"));
        assert!(found[1].contains("map_Ks: picture \"none.png\""));
        assert!(found[2].ends_with("map_Ns: pictures of highlights and sheen are not used"));
    }

    #[test]
    fn ambient_light_may_have_the_picture_of_the_colour_before_or_after_it() {
        let files = Files(vec![(
            "sub/two.png",
            encoded(&red_green(), image::ImageFormat::Png),
        )]);
        let text = "newmtl a\nmap_Ka two.png\nmap_Kd two.png\nnewmtl b\nmap_Kd two.png\n\
                    map_Ka two.png\nnewmtl c\nmap_Ka three.png\nmap_Kd two.png\n";
        let (_, warnings) = parse_with(text, &files);
        let list = warnings.as_slice().iter();
        let told: Vec<_> = list.map(ToString::to_string).collect();
        let expected = "line 7, sub/a.mtl line 8, map_Ka: pictures of ambient light are not used";
        assert_eq!(told, [expected]);
    }

    /// Counts how often it is asked for a file.
    struct Asked(Cell<usize>);

    impl Resolver for Asked {
        fn resolve(&self, name: &str) -> std::io::Result<Vec<u8>> {
            self.0.set(self.0.get() + 1);
            match name {
                "a.mtl" => Ok(b"newmtl a\n".to_vec()),
                _ => Err(std::io::ErrorKind::NotFound.into()),
            }
        }
    }

    #[test]
    fn a_file_is_read_once_however_often_it_is_named() {
        let asked = Asked(Cell::new(0));
        let options = ReadOptions {
            limits: &Limits::default(),
            resolver: &asked,
        };
        let mut source = Source::new(&options);
        let (mut materials, mut warnings) = (HashMap::new(), Warnings::default());
        let many: String = (0..2 * FILES).map(|k| format!(" {k}.mtl")).collect();
        for names in [&"a.mtl ".repeat(500), "a.mtl", "a.mtl a.mtl"] {
            load(names, 1, &mut source, &mut warnings, &mut materials);
        }
        assert!(materials.contains_key("a"));
        // Each whole line is tried twice.
        assert_eq!(asked.0.get(), 2 + 1 + 2);
        assert_eq!(warnings.as_slice(), []);
        load(&many, 2, &mut source, &mut warnings, &mut materials);
        let last = warnings.as_slice().last().map(ToString::to_string);
        let expected = "line 2, mtllib: more than 1000 material files are named (and 1003 more)";
        assert_eq!(last.as_deref(), Some(expected));
    }

    #[test]
    fn colours_become_linear_and_extensions_are_read() {
        let text = "newmtl my red\nKd 1 0 0\nKs 0.5\nNs 60\nTr 0.25\nPr 0.3\nillum 2\n";
        let (materials, warnings) = parse(text);
        assert!(warnings.as_slice().is_empty());
        let red = &materials["my red"];
        assert_eq!(red.diffuse, DVec3::X);
        assert_eq!(red.ambient, DVec3::X);
        assert_eq!(red.specular, linear_from_srgb(DVec3::splat(0.5)));
        assert_eq!((red.shininess, red.opacity), (60.0, 0.75));
        let physical = red.metallic_roughness.unwrap();
        assert_eq!((physical.roughness, physical.metallic), (0.3, 0.0));
    }

    #[test]
    fn metals_reflect_their_colour_as_highlights_only() {
        let (materials, _) = parse("newmtl a\nKd 1 0 0\nPm 0.75\nPr 0.5\nKa 0.5 0 0\n");
        let a = &materials["a"];
        let usual = Material::physical(a.metallic_roughness.unwrap());
        assert_eq!((a.diffuse, a.specular), (DVec3::X * 0.25, usual.specular));
        assert_eq!(a.shininess.to_bits(), usual.shininess.to_bits());
        assert_eq!(a.metallic_roughness.unwrap().base_color, DVec3::X);
    }

    #[test]
    fn hostile_statements_cost_only_themselves() {
        let text = "Ka\nnewmtl\nnewmtl a\nKd 1 x 0\nKd\nKs 1 2\nillum two\nNs nan\nd\n\
                    map_Kd\nbump\nKa spectral f.rfl\nd -halo 0.5\nKe 0 0 1 # blue\nf 1 2 3\n";
        let (materials, warnings) = parse(text);
        assert_eq!(materials["a"].emissive, DVec3::Z);
        assert!(materials["a"].opacity >= 1.0);
        let count: usize = warnings.as_slice().iter().map(|w| w.count).sum();
        assert_eq!(count, 13);
        let first = warnings.as_slice()[0].to_string();
        assert_eq!(
            first,
            "line 7, sub/a.mtl line 1, Ka: no material with a name before it"
        );
    }

    #[test]
    fn what_light_does_inside_of_bodies_is_told_where_it_would_be_seen() {
        let (_, warnings) = parse("newmtl a\nNi 1.45\nTf 1 1 1\nillum 2\nsharpness 60\n");
        assert_eq!(warnings.as_slice(), []);
        let (_, warnings) = parse("newmtl a\nNi 1.45\nTf 1 0 0\nillum 7\nnewmtl b\n");
        let told: Vec<_> = warnings
            .as_slice()
            .iter()
            .map(ToString::to_string)
            .collect();
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(
            told[0].ends_with("Tf: light that shines through is not coloured"),
            "{told:?}"
        );
        assert!(
            told[1].ends_with("line 2, Ni: refraction is not followed"),
            "{told:?}"
        );
    }

    #[test]
    fn models_without_highlights_have_none() {
        let (materials, _) = parse("newmtl a\nKs 1 1 1\nillum 1\nnewmtl a\nKd 0 0 0\n");
        assert_eq!(materials["a"].specular, DVec3::ZERO);
        assert_eq!(materials["a"].diffuse, Material::default().diffuse);
    }

    #[test]
    fn colours_without_light_and_by_their_stimulus_are_understood() {
        let text = "newmtl a\nKd 0 1 0\nillum 0\nnewmtl b\nKd xyz 0.9505 1 1.089\nPs 0\naniso 0\n";
        let (materials, warnings) = parse(text);
        assert!(warnings.as_slice().is_empty());
        let flat = &materials["a"];
        assert_eq!(
            (flat.emissive, flat.diffuse, flat.ambient),
            (DVec3::Y, DVec3::ZERO, DVec3::ZERO)
        );
        assert!(materials["b"].diffuse.distance(DVec3::ONE) < 1e-3);
    }
}
