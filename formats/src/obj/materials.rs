//! `.mtl` files, with the physically based extension that many programs write.
//!
//! A statement that cannot be read costs only itself.

use std::collections::HashMap;

use glam::{DMat3, DVec3};
use kernel::{Material, MetallicRoughness, linear_from_srgb};

use super::invalid;
use super::statements::{Statement, Statements, decode, number, numbers};
use crate::{Place, Problem, ReadOptions, Warnings};

/// Reads the files that an `mtllib` statement names. The whole rest of the line is tried as
/// one name first, since names with blanks occur.
pub(super) fn load(
    names: &str,
    line: usize,
    options: &ReadOptions<'_>,
    warnings: &mut Warnings,
    materials: &mut HashMap<String, Material>,
) {
    let whole = options.resolver.resolve(names);
    let mut fetched = vec![(names, whole)];
    if fetched[0].1.is_err() && names.contains(char::is_whitespace) {
        let each = names.split_whitespace();
        fetched = each.map(|n| (n, options.resolver.resolve(n))).collect();
    }
    for (name, bytes) in fetched {
        match bytes {
            Ok(bytes) => read(name, line, &decode(&bytes), warnings, materials),
            Err(error) => {
                let text = format!("material file \"{name}\" is not there: {error}");
                warnings.invalid(Place::item(line, "mtllib"), text);
            }
        }
    }
}

/// Reads one material file; the first material of a name counts.
fn read(
    name: &str,
    line: usize,
    text: &str,
    warnings: &mut Warnings,
    materials: &mut HashMap<String, Material>,
) {
    let mut draft: Option<Draft> = None;
    let mut finish = |draft: Option<Draft>| {
        if let Some(draft) = draft {
            let entry = materials.entry(draft.name.clone());
            entry.or_insert_with(|| draft.finish());
        }
    };
    for statement in Statements::new(text) {
        let result = match (statement.keyword(), statement.rest(), &mut draft) {
            ("newmtl", "", _) => {
                finish(draft.take());
                Err(invalid("a material without name"))
            }
            ("newmtl", name, _) => {
                finish(draft.replace(Draft::new(name)));
                Ok(())
            }
            (_, _, Some(draft)) => draft.take(&statement),
            (_, _, None) => Err(invalid("no material with a name before it")),
        };
        if let Err(problem) = result {
            let what = format!("{name} line {}, {}", statement.line, statement.keyword());
            warnings.add(Place::item(line, what), problem);
        }
    }
    finish(draft);
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
    roughness: Option<f64>,
    metallic: Option<f64>,
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
            // What light does behind and between surfaces is not followed.
            "Tf" => drop(color(statement, f64::INFINITY)?),
            "Ni" | "sharpness" => drop(value(statement)?),
            "Ps" | "Pc" | "Pcr" | "aniso" | "anisor" => {
                if value(statement)? > 0.0 {
                    return unsupported("sheen, clear coat and anisotropy are not used");
                }
            }
            "bump" | "disp" | "decal" | "refl" | "norm" => return unsupported(TEXTURES),
            map if map.starts_with("map_") => return unsupported(TEXTURES),
            _ => return unsupported("statements of this kind are not known"),
        }
        Ok(())
    }

    /// Our material.
    fn finish(self) -> Material {
        let default = Material::default();
        let diffuse = self.diffuse.unwrap_or(default.diffuse);
        // Models 0 and 1 have no highlights.
        let is_shiny = self.model.is_none_or(|model| model > 1);
        let (roughness, metallic) = (self.roughness, self.metallic);
        let is_physical = roughness.is_some() || metallic.is_some();
        let opacity = self.dissolve;
        let mut material = Material {
            name: self.name,
            ambient: self.ambient.unwrap_or(diffuse),
            diffuse,
            specular: self.specular.filter(|_| is_shiny).unwrap_or(DVec3::ZERO),
            shininess: self.shininess.unwrap_or(default.shininess),
            emissive: self.emissive.unwrap_or(DVec3::ZERO),
            opacity: opacity.unwrap_or(1.0 - self.transparency.unwrap_or(0.0)),
            metallic_roughness: is_physical.then(|| MetallicRoughness {
                base_color: diffuse,
                metallic: metallic.unwrap_or(0.0),
                roughness: roughness.unwrap_or(0.5),
            }),
        };
        if self.model == Some(0) {
            // A colour that no light changes.
            material.emissive += diffuse;
            material.ambient = DVec3::ZERO;
            material.diffuse = DVec3::ZERO;
            material.metallic_roughness = None;
        }
        material
    }
}

const TEXTURES: &str = "textures are not used";

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

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> (HashMap<String, Material>, Warnings) {
        let (mut materials, mut warnings) = (HashMap::new(), Warnings::default());
        read("a.mtl", 7, text, &mut warnings, &mut materials);
        (materials, warnings)
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
            "line 7, a.mtl line 1, Ka: no material with a name before it"
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
