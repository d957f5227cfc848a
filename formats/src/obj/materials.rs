//! `.mtl` files: checked line by line here, read by `tobj`, turned into our materials.
//!
//! `tobj` stops at the first statement it cannot read, and panics at colours of one number,
//! which are allowed. So each statement is checked before, and colours are written out.

use std::collections::HashMap;
use std::fmt::Write as _;

use glam::DVec3;
use kernel::{Maps, Material, MetallicRoughness, linear_from_srgb};

use super::statements::{Statement, Statements, decode, number, numbers};
use crate::{Place, ReadOptions, Warnings};

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
    let mut clean = String::new();
    for statement in Statements::new(text) {
        let what = || format!("{name} line {}, {}", statement.line, statement.keyword());
        match cleaned(&statement) {
            Ok(Line::Text(line)) => {
                clean.push_str(&line);
                clean.push('\n');
            }
            Ok(Line::Nothing) => {}
            Ok(Line::Unsupported(text)) => warnings.unsupported(Place::item(line, what()), text),
            Err(text) => warnings.invalid(Place::item(line, what()), text),
        }
    }
    match tobj::load_mtl_buf(&mut clean.as_bytes()) {
        Ok((list, _)) => {
            for material in list {
                let entry = materials.entry(material.name.clone());
                entry.or_insert_with(|| converted(&material));
            }
        }
        Err(error) => warnings.invalid(Place::item(line, name), error.to_string()),
    }
}

/// What becomes of a statement.
enum Line {
    /// It goes to `tobj` like this.
    Text(String),
    /// It does not matter to us.
    Nothing,
    /// It would matter.
    Unsupported(&'static str),
}

/// Checks a statement of a material file.
fn cleaned(statement: &Statement<'_>) -> Result<Line, String> {
    let keyword = statement.keyword();
    let words: Vec<&str> = statement.arguments().collect();
    Ok(match keyword {
        "newmtl" if statement.rest().is_empty() => return Err("a material without name".into()),
        "newmtl" => Line::Text(format!("newmtl {}", statement.rest())),
        "Ka" | "Kd" | "Ks" | "Ke" => {
            if matches!(words.first(), Some(&("spectral" | "xyz"))) {
                return Ok(Line::Unsupported("spectral and xyz colours are not used"));
            }
            let color = numbers(words.iter().copied())?;
            let [r, g, b] = match color[..] {
                [r] => [r, r, r],
                [r, g, b, ..] => [r, g, b],
                _ => return Err(format!("{} numbers; a colour has 1 or 3", color.len())),
            };
            let mut line = keyword.to_owned();
            for c in [r, g, b] {
                // Writing to a string cannot fail.
                let _ = write!(line, " {c:e}");
            }
            Line::Text(line)
        }
        "Ns" | "d" | "Tr" | "Pr" | "Pm" => {
            if words.first() == Some(&"-halo") {
                return Ok(Line::Unsupported(
                    "opacity that depends on the angle is not used",
                ));
            }
            let value = number(words.first().unwrap_or(&""))?;
            Line::Text(format!("{keyword} {value:e}"))
        }
        "illum" => match words.first().and_then(|word| word.parse::<u8>().ok()) {
            Some(model) => Line::Text(format!("illum {model}")),
            None => return Err("the illumination model is a number from 0 to 10".into()),
        },
        "Tf" | "Ni" | "sharpness" => Line::Nothing,
        "bump" | "disp" | "decal" | "refl" | "norm" => Line::Unsupported(TEXTURES),
        map if map.starts_with("map_") => Line::Unsupported(TEXTURES),
        "Ps" | "Pc" | "Pcr" | "aniso" | "anisor" => {
            Line::Unsupported("sheen, clear coat and anisotropy are not used")
        }
        _ => Line::Unsupported("statements of this kind are not known"),
    })
}

const TEXTURES: &str = "textures are not used";

/// Our material for one of `tobj`, all of whose numbers are finite.
fn converted(found: &tobj::Material) -> Material {
    let default = Material::default();
    let color = |c: [f64; 3], most: f64| {
        linear_from_srgb(DVec3::from(c).clamp(DVec3::ZERO, DVec3::splat(most)))
    };
    let extra = |key: &str| found.unknown_param.get(key)?.parse::<f64>().ok();
    let diffuse = found.diffuse.map_or(default.diffuse, |c| color(c, 1.0));
    // Models 0 and 1 have no highlights.
    let shiny = found.illumination_model.is_none_or(|model| model > 1);
    let specular = found.specular.filter(|_| shiny).unwrap_or([0.0; 3]);
    let transparency = extra("Tr").unwrap_or(0.0);
    let opacity = found.dissolve.unwrap_or(1.0 - transparency);
    let (roughness, metallic) = (extra("Pr"), extra("Pm"));
    let physical = roughness.is_some() || metallic.is_some();
    Material {
        name: found.name.clone(),
        ambient: found.ambient.map_or(diffuse, |c| color(c, 1.0)),
        diffuse,
        specular: color(specular, 1.0),
        shininess: found.shininess.unwrap_or(default.shininess).clamp(0.0, 1e4),
        emissive: found.emissive.map_or(DVec3::ZERO, |c| color(c, 1e3)),
        opacity: opacity.clamp(0.0, 1.0),
        metallic_roughness: physical.then(|| MetallicRoughness {
            base_color: diffuse,
            metallic: metallic.unwrap_or(0.0).clamp(0.0, 1.0),
            roughness: roughness.unwrap_or(0.5).clamp(0.0, 1.0),
        }),
        maps: Maps::default(),
        back: None,
    }
}

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
        let expected = "line 7, a.mtl line 1, Ka: 0 numbers; a colour has 1 or 3 (and 1 more)";
        assert_eq!(first, expected);
    }

    #[test]
    fn models_without_highlights_have_none() {
        let (materials, _) = parse("newmtl a\nKs 1 1 1\nillum 1\nnewmtl a\nKd 0 0 0\n");
        assert_eq!(materials["a"].specular, DVec3::ZERO);
        assert_eq!(materials["a"].diffuse, Material::default().diffuse);
    }
}
