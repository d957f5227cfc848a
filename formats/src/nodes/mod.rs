//! The scene graph that X3D and VRML share: nodes with fields, DEF and USE, and the one
//! conversion to a [`kernel::Scene`].
//!
//! The spellings (XML, classic, JSON) only fill a [`Tree`] through its [`Builder`]. Field
//! values stay text until the conversion asks for them, because only the meaning of a field
//! tells its type. Prototypes and files named inside are put in place while the tree grows,
//! so the conversion sees plain nodes only.
//!
//! Nodes are stored children first, so a USE can only point to a node that is complete.
//! Cycles cannot be built, and the conversion needs no recursion.

mod address;
mod animate;
#[cfg(test)]
mod animate_tests;
mod build;
mod covering;
mod curve;
mod deform;
mod extrusion;
mod fields;
mod files;
mod kinds;
mod knots;
mod lights;
mod look;
mod mesh;
mod nurbs;
mod proto;
mod scene;
mod solids;
mod spline;
mod text;
mod texture;
mod trim;
mod wires;
mod write;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod texture_tests;
#[cfg(test)]
mod wires_tests;

use std::sync::Arc;

use glam::{DVec2, DVec3};

use crate::pictures::Pictures;
use crate::{Error, Import, Place, Problem, ReadOptions, Warnings};

pub use address::decoded;
pub use animate::Animation;
pub(crate) use build::Builder;
pub(crate) use kinds::stands_in_scene;
pub(crate) use text::{Lines, decode, without_mark};
pub(crate) use write::{CLASSIC, VRML97, X3D};

/// Reads bytes in one spelling into a builder. Gives the error at which it had to stop, which
/// is a warning already, if it did not come to the end.
///
/// # Errors
/// If a limit is passed.
pub(crate) type Spelling = fn(&[u8], &mut Builder<'_>) -> Result<Option<Error>, Error>;

/// A field and its value as it stands in the file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Field {
    /// The name.
    pub name: Arc<str>,
    /// The value, not yet read, without brackets around lists.
    pub value: Arc<str>,
}

/// A node within another one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Link {
    /// Index of the node in the tree.
    pub node: usize,
    /// The field of the outer node it belongs to, if the file says so.
    pub field: Option<Arc<str>>,
    /// Whether the node is defined here; otherwise this is a USE of it.
    pub defined_here: bool,
}

/// What a file says about itself. Files inside others have their own.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct File {
    /// Its name, for files that are named inside others; empty for the first one.
    pub name: String,
    /// Version of X3D or VRML, such as `3.3`; empty if the file does not say.
    pub version: String,
    /// The unit of length.
    pub length: kernel::Unit,
    /// Radians of one unit of angle.
    pub angle: f64,
}

impl Default for File {
    fn default() -> Self {
        let name = "m".to_owned();
        Self {
            name: String::new(),
            version: String::new(),
            length: kernel::Unit { name, metres: 1.0 },
            angle: 1.0,
        }
    }
}

/// A node of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Node {
    /// Its type, such as `Transform`.
    pub kind: Arc<str>,
    /// Its DEF name, or empty.
    pub def: Arc<str>,
    /// The file it stands in.
    pub file: Arc<File>,
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
    /// Fields that the prototype around it fills: the name here, the name there.
    pub connections: Vec<(Arc<str>, Arc<str>)>,
}

/// All nodes of a file, children before parents.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tree {
    /// Name of the format, for errors.
    pub format: &'static str,
    /// The nodes.
    pub nodes: Vec<Node>,
    /// What moves what.
    pub routes: Vec<animate::Route>,
    /// The node that holds the whole scene.
    pub root: Option<usize>,
}

/// Reads a file in whatever spelling it has, and makes a scene of it.
///
/// # Errors
/// If a limit is passed, the file holds no scene, or it is broken before anything is shown.
pub(crate) fn read(
    format: &'static str,
    spelling: Spelling,
    bytes: &[u8],
    options: &ReadOptions<'_>,
) -> Result<Import, Error> {
    let mut builder = Builder::new(format, spelling, options);
    let broken = builder.read(bytes)?;
    let (tree, mut warnings) = builder.finish()?;
    fields::check(&tree, &mut warnings);
    if tree.root.is_none() && broken.is_none() {
        let text = format!("there is no scene in it; this is no {format} file");
        return Err(Error {
            format,
            place: Place::default(),
            problem: Problem::Invalid(text),
        });
    }
    let mut pictures = Pictures::default();
    let mut import = scene::convert(&tree, warnings, &mut pictures, options)?;
    import.warnings = animate::checked(&tree, import.warnings, options);
    import.animation = Animation::of(&tree, pictures, options.limits);
    match broken {
        Some(broken) if import.scene.root().is_none() => Err(broken),
        _ => Ok(import),
    }
}

impl Tree {
    /// The nodes directly inside a node.
    fn inside<'t>(&'t self, node: &Node) -> impl Iterator<Item = &'t Node> {
        node.children.iter().map(|link| &self.nodes[link.node])
    }
}

impl File {
    /// A place in it.
    pub(crate) fn place(&self, line: usize, what: &str) -> Place {
        match (self.name.as_str(), what) {
            ("", what) => Place::item(line, what),
            (name, "") => Place::item(line, format!("of {name}")),
            (name, what) => Place::item(line, format!("{what} of {name}")),
        }
    }
}

impl Node {
    /// Where it stands, in the words of the file.
    pub(crate) fn place(&self) -> Place {
        self.file.place(self.line, &self.title())
    }

    /// Where one of its fields stands.
    fn field_place(&self, field: &str) -> Place {
        self.file
            .place(self.line, &format!("{}, {field}", self.title()))
    }

    fn title(&self) -> String {
        match &*self.def {
            "" => self.kind.to_string(),
            def => format!("{} DEF {def}", self.kind),
        }
    }

    /// Whether it only describes other nodes.
    fn is_metadata(&self) -> bool {
        self.kind.starts_with("Metadata")
    }

    /// The text of a field, as it stands there last.
    pub(crate) fn text(&self, field: &str) -> Option<&str> {
        let found = self.fields.iter().rev().find(|f| &*f.name == field);
        found.map(|f| &*f.value)
    }

    /// The strings of a field: what stands in quotes, or all of it if nothing does.
    pub(crate) fn strings(&self, field: &str) -> Vec<String> {
        self.text(field).map_or_else(Vec::new, text::strings)
    }

    /// The first string of a field, or nothing.
    pub(crate) fn string(&self, field: &str) -> String {
        self.strings(field).into_iter().next().unwrap_or_default()
    }

    /// A field that is the name of a node, as it stands there.
    fn name_in(&self, field: &str) -> Arc<str> {
        self.text(field).unwrap_or_default().trim().into()
    }

    /// The numbers of a field; empty if it is not there or one of them is malformed.
    pub(crate) fn numbers(&self, field: &str, warnings: &mut Warnings) -> Vec<f64> {
        let Some(text) = self.text(field) else {
            return Vec::new();
        };
        let mut numbers = Vec::new();
        let mut has_suffix = false;
        let finite = |text: &str| text.parse().ok().filter(|x: &f64| x.is_finite());
        for word in text::words(text) {
            // Some programs write numbers as C does: 0.5f.
            let stem = word.strip_suffix(['f', 'F']);
            has_suffix |= stem.is_some();
            if let Some(number) = finite(stem.unwrap_or(word)) {
                numbers.push(number);
                continue;
            }
            let word: String = word.chars().take(20).collect();
            warnings.invalid(
                self.field_place(&format!("{field} entry {}", numbers.len())),
                format!("{word:?} is not a number; the field is not used"),
            );
            return Vec::new();
        }
        if has_suffix {
            let text = "numbers end with the letter f; they are read without it";
            warnings.invalid(self.field_place(field), text);
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

    /// A whole number that is not negative, or its default; for counts and orders.
    pub(crate) fn count(&self, field: &str, default: usize, warnings: &mut Warnings) -> usize {
        self.whole(field, ("a count", default), warnings)
    }

    /// A whole number, or its default, with the word for what is wanted.
    pub(crate) fn whole<T: TryFrom<i64> + Copy + std::fmt::Display>(
        &self,
        field: &str,
        (what, default): (&str, T),
        warnings: &mut Warnings,
    ) -> T {
        let Some(text) = self.text(field) else {
            return default;
        };
        let found = text::whole(text).and_then(|found| found.try_into().ok());
        found.unwrap_or_else(|| {
            let word: String = text.trim().chars().take(20).collect();
            let text = format!("{word:?} is not {what}; {default} is used");
            warnings.invalid(self.field_place(field), text);
            default
        })
    }

    /// A truth value, or its default.
    pub(crate) fn flag(&self, field: &str, default: bool, warnings: &mut Warnings) -> bool {
        let Some(text) = self.text(field) else {
            return default;
        };
        self.truth(field, text, warnings).unwrap_or(default)
    }

    /// A list of truth values; those that are none are true.
    pub(crate) fn flags(&self, field: &str, warnings: &mut Warnings) -> Vec<bool> {
        let words = text::words(self.text(field).unwrap_or_default());
        words
            .map(|word| self.truth(field, word, warnings).unwrap_or(true))
            .collect()
    }

    fn truth(&self, field: &str, text: &str, warnings: &mut Warnings) -> Option<bool> {
        let text = text.trim();
        let found = [("true", true), ("false", false)]
            .into_iter()
            .find(|(word, _)| text.eq_ignore_ascii_case(word));
        if found.is_none() {
            let word: String = text.chars().take(20).collect();
            let text = format!("{word:?} is neither true nor false");
            warnings.invalid(self.field_place(field), text);
        }
        found.map(|(_, value)| value)
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

#[cfg(test)]
mod field_tests {
    use super::*;

    fn node(value: &str) -> Node {
        let (name, value) = ("a".into(), value.into());
        Node {
            kind: "Test".into(),
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
        assert_eq!(node("").numbers("a", &mut warnings), [0.0_f64; 0]);
        assert_eq!(node("1").numbers("b", &mut warnings), [0.0_f64; 0]);
        assert!(warnings.as_slice().is_empty());
    }

    #[test]
    fn what_is_no_number_is_told_with_its_place() {
        for bad in ["nan", "inf", "1e999", "1.0.0", "0x10"] {
            let mut warnings = Warnings::default();
            assert_eq!(
                node(&format!("1 {bad}")).numbers("a", &mut warnings),
                [0.0_f64; 0]
            );
            assert_eq!(
                warnings.as_slice()[0].to_string(),
                format!(
                    "line 7, Test, a entry 1: \"{bad}\" is not a number; the field is not used"
                )
            );
        }
    }

    #[test]
    fn numbers_as_c_writes_them_are_read_and_told() {
        let mut warnings = Warnings::default();
        let numbers = node("-1.5f 2 .25F").numbers("a", &mut warnings);
        assert_eq!(numbers, [-1.5, 2.0, 0.25]);
        let told = warnings.as_slice()[0].to_string();
        assert!(told.starts_with("line 7, Test, a: numbers end"), "{told}");
    }

    #[test]
    fn counts_are_read_in_every_spelling() {
        let mut warnings = Warnings::default();
        for text in ["12", " +12, ", "12.0", "12.", "0xC"] {
            assert_eq!(node(text).count("a", 3, &mut warnings), 12, "{text}");
        }
        assert_eq!(text::whole("-0X1f"), Some(-31));
        assert!(warnings.as_slice().is_empty());
        for text in ["-12", "12.5", "1e1", "1 2", "0x", ""] {
            let mut warnings = Warnings::default();
            assert_eq!(node(text).count("a", 3, &mut warnings), 3, "{text}");
            assert_eq!(warnings.as_slice().len(), 1, "{text}");
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
