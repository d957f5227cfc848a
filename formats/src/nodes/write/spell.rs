//! Nodes to be written, in XML and in classic spelling.

use std::fmt::Write as _;

use crate::write::push_number;

/// A node to be written.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Out {
    /// Its type.
    pub(super) kind: &'static str,
    /// The name given to it, or empty.
    pub(super) def: String,
    /// Whether it stands for the node with that name.
    used: bool,
    fields: Vec<(&'static str, Value)>,
    /// Nodes inside, by the field they belong to.
    children: Vec<(&'static str, Self)>,
}

/// What a field holds that holds no nodes.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// True or false.
    Flag(bool),
    /// One number or tuple, as text.
    One(String),
    /// A list of numbers or tuples, as text.
    Many(String),
    /// A string.
    Text(String),
    /// A list of strings.
    Texts(Vec<String>),
}

impl Value {
    /// One number.
    pub(super) fn number(value: f64) -> Self {
        Self::tuple(&[value])
    }

    /// One tuple.
    pub(super) fn tuple(values: &[f64]) -> Self {
        Self::One(numbers(values, values.len()))
    }

    /// A list of tuples with `width` numbers each.
    pub(super) fn list(values: &[f64], width: usize) -> Self {
        Self::Many(numbers(values, width))
    }

    /// A list of whole numbers.
    pub(super) fn indices(values: impl IntoIterator<Item = i64>) -> Self {
        let mut text = String::new();
        for value in values {
            let space = if text.is_empty() { "" } else { " " };
            // Writing into a string cannot fail.
            let _ = write!(text, "{space}{value}");
        }
        Self::Many(text)
    }
}

/// Numbers with commas between tuples.
fn numbers(values: &[f64], width: usize) -> String {
    let mut text = String::new();
    for (index, &value) in values.iter().enumerate() {
        match index {
            0 => {}
            _ if width > 1 && index % width == 0 => text += ", ",
            _ => text.push(' '),
        }
        push_number(&mut text, value);
    }
    text
}

/// Fields that hold one node; all others hold lists of nodes.
const SINGLE: &[&str] = &[
    "appearance",
    "backMaterial",
    "color",
    "controlPoint",
    "coord",
    "emissiveTexture",
    "geometry",
    "material",
    "metadata",
    "metallicRoughnessTexture",
    "normal",
    "specularTexture",
    "surface",
    "texCoord",
    "texture",
    "textureProperties",
    "textureTransform",
];

/// The field that a node is taken to belong to in XML if it does not say so, where that is not
/// `children`.
fn usual_field(kind: &str) -> &'static str {
    match kind {
        "Appearance" => "appearance",
        "Color" | "ColorRGBA" => "color",
        "ImageTexture" | "PixelTexture" => "texture",
        "NurbsTextureCoordinate" | "NurbsTextureSurface" => "texCoord",
        "TextureProperties" => "textureProperties",
        "TextureTransform" => "textureTransform",
        "UnlitMaterial" => "material",
        "Contour2D" => "trimmingContour",
        "CoordinateDouble" | "Coordinate" => "coord",
        "IndexedTriangleSet"
        | "NurbsCurve"
        | "NurbsPatchSurface"
        | "NurbsTrimmedSurface"
        | "PointSet" => "geometry",
        "Material" | "PhysicalMaterial" => "material",
        "Normal" => "normal",
        "TextureCoordinate" => "texCoord",
        _ => "children",
    }
}

impl Out {
    /// A node of a type.
    pub(super) fn new(kind: &'static str) -> Self {
        Self {
            kind,
            ..Self::default()
        }
    }

    /// What stands for a node with this name.
    pub(super) fn reference(kind: &'static str, def: &str) -> Self {
        Self {
            kind,
            def: def.to_owned(),
            used: true,
            ..Self::default()
        }
    }

    /// Adds a field.
    pub(super) fn field(&mut self, name: &'static str, value: Value) {
        self.fields.push((name, value));
    }

    /// Adds a node inside; fields of the same name follow each other.
    pub(super) fn child(&mut self, field: &'static str, node: Self) {
        self.children.push((field, node));
    }

    /// Appends the node as an element; `field` is where it belongs, empty outside of scenes.
    pub(super) fn xml(&self, text: &mut String, field: &str, depth: usize) {
        let indent = "  ".repeat(depth.min(40));
        *text += &format!("{indent}<{}", self.kind);
        if !self.def.is_empty() {
            let name = if self.used { "USE" } else { "DEF" };
            *text += &format!(" {name}=\"{}\"", self.def);
        }
        if !field.is_empty() && field != usual_field(self.kind) {
            *text += &format!(" containerField=\"{field}\"");
        }
        for (name, value) in &self.fields {
            *text += &format!(" {name}=\"");
            match value {
                Value::Flag(flag) => *text += &flag.to_string(),
                Value::One(value) | Value::Many(value) => *text += value,
                Value::Text(value) => *text += &escaped(value),
                Value::Texts(values) => {
                    let values: Vec<_> = values.iter().map(|v| escaped(&quoted(v))).collect();
                    *text += &values.join(" ");
                }
            }
            text.push('"');
        }
        if self.children.is_empty() {
            *text += "/>\n";
            return;
        }
        *text += ">\n";
        for (field, child) in &self.children {
            child.xml(text, field, depth + 1);
        }
        *text += &format!("{indent}</{}>\n", self.kind);
    }

    /// Appends the node in classic spelling.
    pub(super) fn classic(&self, text: &mut String, depth: usize) {
        *text += &"  ".repeat(depth.min(40));
        self.classic_inline(text, depth);
    }

    fn classic_inline(&self, text: &mut String, depth: usize) {
        if self.used {
            *text += &format!("USE {}\n", self.def);
            return;
        }
        if !self.def.is_empty() {
            *text += &format!("DEF {} ", self.def);
        }
        *text += &format!("{} {{\n", self.kind);
        let indent = "  ".repeat((depth + 1).min(40));
        for (name, value) in &self.fields {
            *text += &format!("{indent}{name} ");
            match value {
                Value::Flag(flag) => *text += if *flag { "TRUE" } else { "FALSE" },
                Value::One(value) => *text += value,
                Value::Many(value) => *text += &format!("[ {value} ]"),
                Value::Text(value) => *text += &quoted(value),
                Value::Texts(values) => {
                    let values: Vec<_> = values.iter().map(|v| quoted(v)).collect();
                    *text += &format!("[ {} ]", values.join(", "));
                }
            }
            text.push('\n');
        }
        for group in self.children.chunk_by(|a, b| a.0 == b.0) {
            let [(field, first), ..] = group else {
                continue;
            };
            *text += &format!("{indent}{field} ");
            if SINGLE.contains(field) {
                first.classic_inline(text, depth + 1);
                continue;
            }
            *text += "[\n";
            for (_, child) in group {
                child.classic(text, depth + 2);
            }
            *text += &format!("{indent}]\n");
        }
        *text += &format!("{}}}\n", "  ".repeat(depth.min(40)));
    }
}

/// Words of the grammars, which are no names.
const RESERVED: [&str; 25] = [
    "AS",
    "COMPONENT",
    "DEF",
    "EXPORT",
    "EXTERNPROTO",
    "FALSE",
    "IMPORT",
    "IS",
    "META",
    "NULL",
    "PROFILE",
    "PROTO",
    "ROUTE",
    "TO",
    "TRUE",
    "UNIT",
    "USE",
    "eventIn",
    "eventOut",
    "exposedField",
    "field",
    "initializeOnly",
    "inputOnly",
    "inputOutput",
    "outputOnly",
];

/// A name that every spelling takes: letters of any script, digits, `_` and `-`, neither digit nor `-`
/// first, and no word of the grammar.
pub(super) fn identifier(name: &str) -> String {
    let is_letter = |c: char| c.is_ascii_alphabetic() || c >= '\u{c0}' && c.is_alphabetic();
    let is_legal = |c: &char| is_letter(*c) || c.is_ascii_digit() || matches!(c, '_' | '-');
    let legal = |c: char| Some(c).filter(is_legal).unwrap_or('_');
    let mut text: String = name.chars().map(legal).collect();
    let is_reserved = RESERVED.contains(&&*text);
    if is_reserved || !text.starts_with(|c: char| is_letter(c) || c == '_') {
        text.insert(0, '_');
    }
    text
}

/// A string in quotation marks.
pub(super) fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// Text for an attribute of XML. What XML cannot hold becomes a blank.
fn escaped(text: &str) -> String {
    let mut result = String::new();
    for c in text.chars() {
        match c {
            '&' => result += "&amp;",
            '<' => result += "&lt;",
            '>' => result += "&gt;",
            '"' => result += "&quot;",
            '\t' | '\n' | '\r' => result += &format!("&#{};", u32::from(c)),
            c if c < ' ' || matches!(c, '\u{fffe}' | '\u{ffff}') => result.push(' '),
            c => result.push(c),
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape() -> Out {
        let mut points = Out::new("CoordinateDouble");
        points.field("point", Value::list(&[0.0, 1e-7, 2.5, -1.0, 0.0, 3.0], 3));
        let mut surface = Out::new("NurbsPatchSurface");
        surface.def = "S".to_owned();
        surface.field("solid", Value::Flag(false));
        surface.child("controlPoint", points);
        let mut shape = Out::new("Shape");
        shape.child("geometry", surface);
        shape
    }

    #[test]
    fn elements_name_their_field_where_it_is_not_the_usual_one() {
        let mut text = String::new();
        shape().xml(&mut text, "children", 0);
        let expected = "<Shape>\n  <NurbsPatchSurface DEF=\"S\" solid=\"false\">\n    \
            <CoordinateDouble containerField=\"controlPoint\" point=\"0 1e-7 2.5, -1 0 3\"/>\n  \
            </NurbsPatchSurface>\n</Shape>\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn classic_fields_hold_one_node_or_a_list() {
        let mut group = Out::new("Group");
        group.child("children", shape());
        group.child("children", Out::reference("Shape", "S"));
        let mut text = String::new();
        group.classic(&mut text, 0);
        let expected = "Group {\n  children [\n    Shape {\n      geometry DEF S \
            NurbsPatchSurface {\n        solid FALSE\n        controlPoint CoordinateDouble {\n          \
            point [ 0 1e-7 2.5, -1 0 3 ]\n        }\n      }\n    }\n    USE S\n  ]\n}\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn names_and_strings_are_legal() {
        assert_eq!(identifier("4 wheels"), "_4_wheels");
        assert_eq!(identifier(""), "_");
        assert_eq!(identifier("surface-1"), "surface-1");
        assert_eq!(identifier("-にわとり 1."), "_-にわとり_1_");
        assert_eq!(quoted("a \"b\" \\"), r#""a \"b\" \\""#);
        assert_eq!(escaped("<a & \"b\">"), "&lt;a &amp; &quot;b&quot;&gt;");
    }
}
