//! PLY, text and binary: vertices and the polygons between them.

use formats::{Error, Limits, Place, Problem, Warnings, triangulate};
use glam::DVec3;
use kernel::Mesh;

use super::{MeshFile, error, of_one};

const NAME: &str = "PLY";

/// Names of the list of corners of a face.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Reads a file.
pub(super) fn read(bytes: &[u8], limits: &Limits) -> Result<MeshFile, Error> {
    let (elements, mut body) = header(bytes)?;
    let mut warnings = Warnings::default();
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    // Corners of all polygons, and where each ends among them.
    let (mut corners, mut ends) = (Vec::new(), Vec::new());
    for element in &elements {
        let columns = |names: [&str; 3]| {
            let at = names.map(|name| element.properties.iter().position(|p| p.name == name));
            Some([at[0]?, at[1]?, at[2]?])
        };
        let is_vertex = element.name == "vertex";
        let position = is_vertex.then(|| columns(["x", "y", "z"])).flatten();
        let normal = is_vertex.then(|| columns(["nx", "ny", "nz"])).flatten();
        if is_vertex && position.is_none() {
            let text = "an element vertex without x, y and z".to_owned();
            return Err(error(NAME, "the header", Problem::Invalid(text)));
        }
        let list = element.properties.iter().position(|p| {
            element.name == "face" && p.length.is_some() && CORNERS.contains(&p.name.as_str())
        });
        if !is_vertex && list.is_none() && element.count > 0 {
            let text = format!("{} of {} are not read", element.count, element.name);
            warnings.unsupported(Place::item(0, element.name.clone()), text);
        }
        // Rows of nothing take no bytes, however many they are.
        let rows = if element.properties.is_empty() {
            0
        } else {
            element.count
        };
        for row in 0..rows {
            let place = || format!("{} {row}", element.name);
            let [numbers, polygon] = body.row(&element.properties, list).ok_or_else(|| {
                let text = format!(
                    "{} are announced; it is not there, or no numbers",
                    element.count
                );
                error(NAME, place(), Problem::Invalid(text))
            })?;
            if let Some([x, y, z]) = position {
                positions.push(DVec3::new(numbers[x], numbers[y], numbers[z]));
            }
            if let Some([x, y, z]) = normal {
                normals.push(DVec3::new(numbers[x], numbers[y], numbers[z]));
            }
            if list.is_some() {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "what is no vertex is refused below"
                )]
                let corner = |k: &f64| if *k >= 0.0 { *k as u32 } else { u32::MAX };
                corners.extend(polygon.iter().map(corner));
                ends.push(corners.len());
            }
            let most = positions.len().max(corners.len() / 6).max(ends.len() / 6);
            if most > limits.points {
                let text = format!("more than {} vertices", limits.points);
                return Err(error(NAME, place(), Problem::TooLarge(text)));
            }
        }
    }
    // Files with a place for normals may leave it empty.
    if normals.contains(&DVec3::ZERO) {
        normals.clear();
    }
    let triangles = cut((&corners, &ends), &positions, &mut warnings)?;
    let mesh = Mesh::new(positions, normals, Vec::new(), triangles);
    of_one(NAME, mesh, bytes, warnings)
}

/// The polygons, of which each ends at a place among all corners, as triangles.
fn cut(
    (corners, ends): (&[u32], &[usize]),
    positions: &[DVec3],
    warnings: &mut Warnings,
) -> Result<Vec<[u32; 3]>, Error> {
    let mut triangles = Vec::new();
    let mut tests = triangulate::TESTS;
    let mut start = 0;
    for (row, &end) in ends.iter().enumerate() {
        let polygon = &corners[start..end];
        start = end;
        let place = || format!("face {row}");
        let point = |k: &u32| positions.get(*k as usize).copied();
        let points: Option<Vec<DVec3>> = polygon.iter().map(point).collect();
        let points = points.ok_or_else(|| {
            let text = format!("a corner is none of the {} vertices", positions.len());
            error(NAME, place(), Problem::Invalid(text))
        })?;
        let parts = match points.len() {
            0..3 => None,
            3 => Some(vec![[0, 1, 2]]),
            _ => triangulate::triangles(&points, &mut tests),
        };
        let Some(parts) = parts else {
            let text = "faces that are no polygons are left out";
            warnings.invalid(Place::item(0, place()), text);
            continue;
        };
        triangles.extend(parts.into_iter().map(|part| part.map(|k| polygon[k])));
    }
    Ok(triangles)
}

/// What rows of one kind hold.
struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

struct Property {
    name: String,
    /// The type of the number of its numbers, if it is a list.
    length: Option<Kind>,
    kind: Kind,
}

/// Types of numbers.
#[derive(Clone, Copy)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }
}

#[derive(Clone, Copy)]
enum Form {
    Text,
    Little,
    Big,
}

/// What is left of the rows.
struct Body<'b> {
    form: Form,
    rest: &'b [u8],
}

impl Body<'_> {
    /// The numbers of a row, of a list its length; and the numbers of this list.
    fn row(&mut self, properties: &[Property], list: Option<usize>) -> Option<[Vec<f64>; 2]> {
        let (mut numbers, mut kept) = (Vec::new(), Vec::new());
        for (column, property) in properties.iter().enumerate() {
            let Some(length) = property.length else {
                numbers.push(self.number(property.kind)?);
                continue;
            };
            let length = self.number(length)?;
            numbers.push(length);
            let mut k = 0.0;
            while k < length {
                let number = self.number(property.kind)?;
                if list == Some(column) {
                    kept.push(number);
                }
                k += 1.0;
            }
        }
        Some([numbers, kept])
    }

    fn number(&mut self, kind: Kind) -> Option<f64> {
        if matches!(self.form, Form::Text) {
            let start = self.rest.trim_ascii_start();
            let end = start.iter().position(u8::is_ascii_whitespace);
            let (word, rest) = start.split_at(end.unwrap_or(start.len()));
            self.rest = rest;
            return std::str::from_utf8(word).ok()?.parse().ok();
        }
        Some(match kind {
            Kind::I8 => i8::from_le_bytes(self.bytes()?).into(),
            Kind::U8 => u8::from_le_bytes(self.bytes()?).into(),
            Kind::I16 => i16::from_le_bytes(self.bytes()?).into(),
            Kind::U16 => u16::from_le_bytes(self.bytes()?).into(),
            Kind::I32 => i32::from_le_bytes(self.bytes()?).into(),
            Kind::U32 => u32::from_le_bytes(self.bytes()?).into(),
            Kind::F32 => f32::from_le_bytes(self.bytes()?).into(),
            Kind::F64 => f64::from_le_bytes(self.bytes()?),
        })
    }

    /// The next bytes, the least significant first.
    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.rest.split_first_chunk::<N>()?;
        self.rest = rest;
        let mut bytes = *bytes;
        if matches!(self.form, Form::Big) {
            bytes.reverse();
        }
        Some(bytes)
    }
}

/// What the rows hold, and the rows.
fn header(bytes: &[u8]) -> Result<(Vec<Element>, Body<'_>), Error> {
    let mut rest = bytes;
    let mut form = None;
    let mut elements: Vec<Element> = Vec::new();
    for number in 1.. {
        let end = rest.iter().position(|&b| b == b'\n');
        let (line, after) = rest.split_at(end.map_or(rest.len(), |end| end + 1));
        rest = after;
        let line = String::from_utf8_lossy(line);
        let wrong = |text: String| Error {
            format: NAME,
            place: Place::line(number),
            problem: Problem::Invalid(text),
        };
        let mut words = line.split_whitespace();
        let words: [&str; 5] = std::array::from_fn(|_| words.next().unwrap_or_default());
        match words {
            ["ply", ..] if number == 1 => {}
            _ if number == 1 => return Err(wrong("PLY files begin with the word ply".to_owned())),
            ["format", "ascii", ..] => form = Some(Form::Text),
            ["format", "binary_little_endian", ..] => form = Some(Form::Little),
            ["format", "binary_big_endian", ..] => form = Some(Form::Big),
            ["comment" | "obj_info", ..] => {}
            ["element", name, count, ..] => {
                let count = count.parse().map_err(|_| {
                    wrong(format!(
                        "'{count}' is no number of rows of the element {name}"
                    ))
                })?;
                elements.push(Element {
                    name: name.to_owned(),
                    count,
                    properties: Vec::new(),
                });
            }
            ["property", ..] => {
                let (length, kind, name) = match words {
                    [_, "list", length, kind, name] => (Some(Kind::named(length)), kind, name),
                    [_, kind, name, ..] => (None, kind, name),
                };
                let made = || {
                    Some(Property {
                        name: name.to_owned(),
                        length: match length {
                            Some(kind) => Some(kind?),
                            None => None,
                        },
                        kind: Kind::named(kind)?,
                    })
                };
                let property =
                    made().ok_or_else(|| wrong(format!("'{}' is no property", line.trim())))?;
                let element = elements.last_mut();
                let element =
                    element.ok_or_else(|| wrong("a property before any element".to_owned()))?;
                element.properties.push(property);
            }
            ["end_header", ..] => break,
            _ if end.is_none() => return Err(wrong("the header has no end_header".to_owned())),
            _ => return Err(wrong(format!("'{}' is not known", line.trim()))),
        }
    }
    let none = || {
        let text =
            "no format; ascii, binary_little_endian and binary_big_endian are read".to_owned();
        error(NAME, "the header", Problem::Invalid(text))
    };
    let form = form.ok_or_else(none)?;
    Ok((elements, Body { form, rest }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(bytes: &[u8]) -> Result<MeshFile, String> {
        read(bytes, &Limits::default()).map_err(|e| e.to_string())
    }

    /// A square and a triangle, in text.
    const TEXT: &str = "ply\r\nformat ascii 1.0\ncomment x\nelement vertex 5\nproperty double x\n\
        property float y\nproperty float z\nproperty uchar red\nelement face 2\n\
        property list uchar int vertex_indices\nelement edge 1\nproperty int vertex1\nend_header\n\
        0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n0 0 1e0 9\n4 0 1 2 3\n3 0 1 4\n7\n";

    #[test]
    fn text_and_both_orders_of_bytes_are_read() {
        let file = parsed(TEXT.as_bytes()).unwrap();
        let mesh = &file.scene.meshes()[0];
        assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 2, 3], [0, 1, 4]]);
        assert_eq!(mesh.positions()[4], DVec3::Z);
        let told = file.warnings.as_slice();
        assert!(
            told.iter()
                .any(|w| w.problem.to_string().contains("1 of edge are not read"))
        );
        for (order, big) in [("little", false), ("big", true)] {
            let mut bytes = format!(
                "ply\nformat binary_{order}_endian 1.0\nelement vertex 3\nproperty float x\n\
                 property float y\nproperty double z\nelement face 1\n\
                 property list uchar ushort vertex_index\nend_header\n"
            )
            .into_bytes();
            let mut put = |b: &[u8]| {
                let turned: Vec<u8> = b.iter().rev().copied().collect();
                bytes.extend(if big { &turned } else { b });
            };
            for (x, y, z) in [
                (0.0_f32, 0.0_f32, 0.5_f64),
                (1.0, 0.0, 0.5),
                (0.0, 1.0, 0.5),
            ] {
                put(&x.to_le_bytes());
                put(&y.to_le_bytes());
                put(&z.to_le_bytes());
            }
            put(&[3]);
            for k in [0_u16, 1, 2] {
                put(&k.to_le_bytes());
            }
            let file = parsed(&bytes).unwrap();
            let mesh = &file.scene.meshes()[0];
            assert_eq!(mesh.triangles(), [[0, 1, 2]]);
            assert_eq!(mesh.positions()[1], DVec3::new(1.0, 0.0, 0.5));
            bytes.pop();
            let found = parsed(&bytes).unwrap_err();
            assert!(found.contains("face 0"), "{found}");
        }
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        let wrong = |old: &str, new: &str, text: &str| {
            let found = parsed(TEXT.replace(old, new).as_bytes()).unwrap_err();
            assert!(found.contains(text), "{old} -> {new}: {found}");
        };
        wrong("ply\r", "pl\r", "line 1");
        wrong("element vertex 5", "element vertex -5", "line 4");
        wrong("element vertex 5", "element vertex 99999999999", "vertex 7");
        wrong("property float z", "property half z", "line 7");
        wrong(
            "property double x",
            "property double w",
            "without x, y and z",
        );
        wrong("format ascii", "format other", "line 2");
        wrong("end_header\n", "", "is not known");
        wrong(
            "element edge 1",
            "element nothing 99999999999\nelement edge 2",
            "edge 1",
        );
        wrong("4 0 1 2 3", "4 0 1 2 5", "none of the 5 vertices");
        wrong("4 0 1 2 3", "4 0 1 2 -1", "none of the 5 vertices");
        wrong("4 0 1 2 3", "4294967295 0 1 2 3", "face 0");
        assert!(
            parsed(b"ply\nformat ascii 1.0\n")
                .unwrap_err()
                .contains("end_header")
        );
    }
}
