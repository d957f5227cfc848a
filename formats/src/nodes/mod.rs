//! The scene graph that X3D and VRML share: nodes with fields, DEF and USE, and the one
//! conversion to a [`kernel::Scene`].
//!
//! The spellings (XML, classic, JSON) only fill a [`Tree`] through its [`Builder`]. Field
//! values stay text until the conversion asks for them, because only the meaning of a field
//! tells its type.
//!
//! Nodes are stored children first, so a USE can only point to a node that is complete.
//! Cycles cannot be built, and the conversion needs no recursion.

mod build;
mod look;
mod mesh;
mod nurbs;
mod scene;
mod trim;
mod write;

use glam::{DVec2, DVec3};

use crate::{Place, Warnings};

pub(crate) use build::{Builder, Head};
pub(crate) use scene::convert;
pub(crate) use write::{CLASSIC, VRML97, X3D};

/// A field and its value as it stands in the file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Field {
    /// The name.
    pub name: String,
    /// The value, not yet read.
    pub value: String,
}

/// A node within another one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Link {
    /// Index of the node in the tree.
    pub node: usize,
    /// The field of the outer node it belongs to, if the file says so.
    pub field: Option<String>,
    /// Whether the node is defined here; otherwise this is a USE of it.
    pub defined_here: bool,
}

/// A node of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Node {
    /// Its type, such as `Transform`.
    pub kind: String,
    /// Its DEF name, or empty.
    pub def: String,
    /// The line where it begins.
    pub line: usize,
    /// The fields that are not nodes.
    pub fields: Vec<Field>,
    /// The nodes inside, in the order of the file.
    pub children: Vec<Link>,
    /// The node around the place where it is defined.
    pub parent: Option<usize>,
    /// Whether the file has its end.
    pub complete: bool,
}

/// All nodes of a file, children before parents.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tree {
    /// Name of the format, for errors.
    pub format: &'static str,
    /// Version of X3D, such as `3.3`; empty if the file does not say.
    pub version: String,
    /// The unit of length.
    pub length: kernel::Unit,
    /// Radians of one unit of angle.
    pub angle: f64,
    /// The nodes.
    pub nodes: Vec<Node>,
    /// The node that holds the whole scene.
    pub root: Option<usize>,
}

impl Node {
    /// Where it stands, in the words of the file.
    pub(crate) fn place(&self) -> Place {
        Place::item(self.line, self.title())
    }

    /// Where one of its fields stands.
    fn field_place(&self, field: &str) -> Place {
        Place::item(self.line, format!("{}, {field}", self.title()))
    }

    fn title(&self) -> String {
        match self.def.as_str() {
            "" => self.kind.clone(),
            def => format!("{} DEF {def}", self.kind),
        }
    }

    /// Whether it only describes other nodes.
    fn is_metadata(&self) -> bool {
        self.kind.starts_with("Metadata")
    }

    /// The text of a field.
    pub(crate) fn text(&self, field: &str) -> Option<&str> {
        let found = self.fields.iter().find(|f| f.name == field);
        found.map(|f| f.value.as_str())
    }

    /// The numbers of a field; empty if it is not there or one of them is malformed.
    pub(crate) fn numbers(&self, field: &str, warnings: &mut Warnings) -> Vec<f64> {
        let Some(text) = self.text(field) else {
            return Vec::new();
        };
        let mut numbers = Vec::new();
        for word in words(text) {
            match word.parse() {
                Ok(number) if f64::is_finite(number) => numbers.push(number),
                _ => {
                    let word: String = word.chars().take(20).collect();
                    warnings.invalid(
                        self.field_place(&format!("{field} entry {}", numbers.len())),
                        format!("{word:?} is not a number; the field is not used"),
                    );
                    return Vec::new();
                }
            }
        }
        numbers
    }

    /// Exactly `N` numbers of a field; `None` if it is not there or is something else.
    pub(crate) fn tuple<const N: usize>(
        &self,
        field: &str,
        warnings: &mut Warnings,
    ) -> Option<[f64; N]> {
        let numbers = self.numbers(field, warnings);
        if numbers.is_empty() {
            return None;
        }
        let tuple = numbers.as_slice().try_into();
        if tuple.is_err() {
            let text = format!("{} numbers; {N} are needed", numbers.len());
            warnings.invalid(self.field_place(field), text);
        }
        tuple.ok()
    }

    /// A number, or its default.
    pub(crate) fn number(&self, field: &str, default: f64, warnings: &mut Warnings) -> f64 {
        self.tuple(field, warnings).map_or(default, |[x]| x)
    }

    /// A number that may not be negative, or its default.
    pub(crate) fn size(&self, field: &str, default: f64, warnings: &mut Warnings) -> f64 {
        let found = self.number(field, default, warnings);
        if found >= 0.0 {
            return found;
        }
        let text = format!("{found}; it must not be negative");
        warnings.invalid(self.field_place(field), text);
        default
    }

    /// A vector, or its default.
    pub(crate) fn vector(&self, field: &str, default: DVec3, warnings: &mut Warnings) -> DVec3 {
        self.tuple(field, warnings).map_or(default, DVec3::from)
    }

    /// A whole number, or its default; for counts and orders.
    pub(crate) fn count(&self, field: &str, default: usize, warnings: &mut Warnings) -> usize {
        let Some(text) = self.text(field) else {
            return default;
        };
        match text.trim().parse() {
            Ok(count) => count,
            Err(_) => {
                let word: String = text.trim().chars().take(20).collect();
                let text = format!("{word:?} is not a count; {default} is used");
                warnings.invalid(self.field_place(field), text);
                default
            }
        }
    }

    /// A truth value, or its default.
    pub(crate) fn flag(&self, field: &str, default: bool, warnings: &mut Warnings) -> bool {
        let Some(text) = self.text(field) else {
            return default;
        };
        let text = text.trim();
        if text.eq_ignore_ascii_case("true") {
            return true;
        }
        if !text.eq_ignore_ascii_case("false") {
            let word: String = text.chars().take(20).collect();
            let text = format!("{word:?} is neither true nor false");
            warnings.invalid(self.field_place(field), text);
            return default;
        }
        false
    }

    /// Points of the plane; a rest that is no whole point is warned about.
    pub(crate) fn points_2d(&self, field: &str, warnings: &mut Warnings) -> Vec<DVec2> {
        let numbers = self.numbers(field, warnings);
        let (points, rest) = numbers.as_chunks();
        self.check_rest(field, rest, warnings);
        points.iter().copied().map(DVec2::from_array).collect()
    }

    /// Points of space; a rest that is no whole point is warned about.
    pub(crate) fn points_3d(&self, field: &str, warnings: &mut Warnings) -> Vec<DVec3> {
        let numbers = self.numbers(field, warnings);
        let (points, rest) = numbers.as_chunks();
        self.check_rest(field, rest, warnings);
        points.iter().copied().map(DVec3::from_array).collect()
    }

    fn check_rest(&self, field: &str, rest: &[f64], warnings: &mut Warnings) {
        if !rest.is_empty() {
            let text = "numbers are left over after the last whole point";
            warnings.invalid(self.field_place(field), text);
        }
    }
}

/// The words of a value; commas are white space.
fn words(text: &str) -> impl Iterator<Item = &str> {
    let words = text.split(|c: char| c == ',' || c.is_ascii_whitespace());
    words.filter(|word| !word.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(value: &str) -> Node {
        let (name, value) = ("a".to_owned(), value.to_owned());
        Node {
            kind: "Test".to_owned(),
            line: 7,
            fields: vec![Field { name, value }],
            ..Node::default()
        }
    }

    #[test]
    fn commas_are_white_space() {
        let mut warnings = Warnings::default();
        let numbers = node(" 1,2 ,\t-3.5e-1,,\n+4 ").numbers("a", &mut warnings);
        assert_eq!(numbers, [1.0, 2.0, -0.35, 4.0]);
        assert_eq!(node("").numbers("a", &mut warnings), []);
        assert_eq!(node("1").numbers("b", &mut warnings), []);
        assert!(warnings.as_slice().is_empty());
    }

    #[test]
    fn what_is_no_number_is_told_with_its_place() {
        for bad in ["nan", "inf", "1e999", "1.0.0", "0x10"] {
            let mut warnings = Warnings::default();
            assert_eq!(node(&format!("1 {bad}")).numbers("a", &mut warnings), []);
            assert_eq!(
                warnings.as_slice()[0].to_string(),
                format!(
                    "line 7, Test, a entry 1: \"{bad}\" is not a number; the field is not used"
                )
            );
        }
    }

    #[test]
    fn flags_are_read_in_every_spelling() {
        let mut warnings = Warnings::default();
        assert!(node("TRUE").flag("a", false, &mut warnings));
        assert!(!node(" false ").flag("a", true, &mut warnings));
        assert!(node("yes").flag("a", true, &mut warnings));
        assert_eq!(warnings.as_slice().len(), 1);
    }
}
