//! X3D in its XML encoding: elements and attributes to nodes.
//!
//! No document type is read and no entity of a document is expanded, so that a small file
//! cannot grow. What the nodes mean is said in `nodes`.

use std::borrow::Cow;

use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::{BytesStart, Event};

use crate::nodes::{Builder, Field, Head, convert};
use crate::{Error, Format, Import, Place, Problem, ReadOptions, Warnings};

/// The row of this format.
pub(crate) const FORMAT: Format = Format {
    name: "X3D",
    extensions: &["x3d", "x3dz"],
    sniff,
    read,
};

/// How far into a file its X3D element is looked for: comments may stand before it.
const HEAD: usize = 1 << 16;

/// How many attributes of an element are read. No node has as many, and each one is
/// compared with all before it.
const ATTRIBUTES: usize = 256;

fn sniff(bytes: &[u8]) -> bool {
    let bytes = without_mark(bytes);
    classic(bytes).is_some() || {
        let start = bytes.trim_ascii_start();
        let head = &start[..start.len().min(HEAD)];
        let is_x3d =
            |w: &[u8]| w.starts_with(b"<X3D") && w[4].is_ascii_whitespace() || w == b"<X3D>";
        start.starts_with(b"<") && head.windows(5).any(is_x3d)
    }
}

/// Without the mark of UTF-8 that some programs write.
fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// What the first line says if the file is no XML but a classic spelling.
fn classic(bytes: &[u8]) -> Option<&'static str> {
    const HEADERS: &[(&[u8], &str)] = &[
        (
            b"#X3D V",
            "ClassicVRML encoding is not read yet; write it as X3D XML",
        ),
        (b"#VRML V2.0", "VRML97 is not read yet; write it as X3D XML"),
        (b"#VRML V1.0", "VRML 1.0 is not read; write it as X3D XML"),
    ];
    let found = HEADERS.iter().find(|(header, _)| bytes.starts_with(header));
    found.map(|(_, text)| *text)
}

fn read(bytes: &[u8], options: &ReadOptions<'_>) -> Result<Import, Error> {
    if let Some(text) = classic(without_mark(bytes)) {
        return Err(error(1, Problem::Unsupported(text.to_owned())));
    }
    let mut warnings = Warnings::default();
    let text = decode(bytes, &mut warnings);
    let mut builder = Builder::new(FORMAT.name, options.limits);
    let broken = read_elements(&text, &mut builder, &mut warnings)?;
    let tree = builder.finish()?;
    if tree.root.is_none() && broken.is_none() {
        let text = "there is no Scene element; this is no X3D file";
        return Err(error(0, Problem::Invalid(text.to_owned())));
    }
    let import = convert(&tree, warnings, options)?;
    match broken {
        Some(broken) if import.scene.root().is_none() => Err(broken),
        _ => Ok(import),
    }
}

fn error(line: usize, problem: Problem) -> Error {
    Error {
        format: FORMAT.name,
        place: Place::line(line),
        problem,
    }
}

/// The text of a file; bytes that are no UTF-8 are taken for Latin-1.
fn decode<'a>(bytes: &'a [u8], warnings: &mut Warnings) -> Cow<'a, str> {
    let wide = |read: fn([u8; 2]) -> u16| {
        let (units, _) = bytes[2..].as_chunks();
        let units = units.iter().map(|&unit| read(unit));
        let chars = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
        Cow::Owned(chars.collect())
    };
    match bytes {
        [0xff, 0xfe, ..] => return wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => return wide(u16::from_be_bytes),
        _ => {}
    }
    let bytes = without_mark(bytes);
    match str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(problem) => {
            let before = &bytes[..problem.valid_up_to()];
            let text = "not UTF-8 from here on; read as Latin-1";
            warnings.invalid(Place::line(1 + newlines(before)), text);
            Cow::Owned(bytes.iter().map(|&b| char::from(b)).collect())
        }
    }
}

fn newlines(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&b| b == b'\n').count()
}

/// The line of a place in a text, for places that only go forward.
struct Lines<'a> {
    text: &'a str,
    position: usize,
    line: usize,
}

impl Lines<'_> {
    fn at(&mut self, position: u64) -> usize {
        let position = usize::try_from(position).unwrap_or(usize::MAX);
        let position = position.clamp(self.position, self.text.len());
        self.line += newlines(&self.text.as_bytes()[self.position..position]);
        self.position = position;
        self.line
    }
}

/// Gives all elements to the builder, up to the place where the XML is broken, if it is.
/// That is a warning and also what comes back.
fn read_elements(
    text: &str,
    builder: &mut Builder<'_>,
    warnings: &mut Warnings,
) -> Result<Option<Error>, Error> {
    let mut reader = Reader::from_str(text);
    let mut lines = Lines {
        text,
        position: 0,
        line: 1,
    };
    let broken = loop {
        let line = lines.at(reader.buffer_position());
        match reader.read_event() {
            Ok(Event::Start(element)) => begin(&element, line, builder, warnings)?,
            Ok(Event::Empty(element)) => {
                begin(&element, line, builder, warnings)?;
                builder.end()?;
            }
            Ok(Event::End(_)) => builder.end()?,
            Ok(Event::Eof) => match builder.innermost() {
                None => return Ok(None),
                Some(node) => {
                    let text = format!("the file ends inside {} of line {}", node.kind, node.line);
                    break error(line, Problem::Invalid(text));
                }
            },
            Ok(_) => {}
            Err(problem) => {
                let line = lines.at(reader.error_position());
                let text = format!("broken XML: {problem}; nothing is read from here on");
                break error(line, Problem::Invalid(text));
            }
        }
    };
    warnings.add(broken.place.clone(), broken.problem.clone());
    Ok(Some(broken))
}

/// Begins the node of an element, or takes what an element around the scene says.
fn begin(
    element: &BytesStart<'_>,
    line: usize,
    builder: &mut Builder<'_>,
    warnings: &mut Warnings,
) -> Result<(), Error> {
    let mut head = Head {
        kind: element.local_name().into_inner().to_owned(),
        line,
        ..Head::default()
    };
    for (index, attribute) in element.attributes().enumerate() {
        let place = || Place::item(line, head.kind.clone());
        if index >= ATTRIBUTES {
            let text = format!("more than {ATTRIBUTES} attributes; the others are not used");
            warnings.invalid(place(), text);
            break;
        }
        let attribute = match attribute {
            Ok(attribute) => attribute,
            Err(problem) => {
                warnings.invalid(place(), format!("unreadable attribute: {problem}"));
                continue;
            }
        };
        let name = attribute.key.into_inner();
        if name.contains(':') {
            continue;
        }
        let value = match unescape(&attribute.value) {
            Ok(value) => value.into_owned(),
            Err(problem) => {
                let text = format!("the value of {name} is not used: {problem}");
                warnings.invalid(place(), text);
                continue;
            }
        };
        match name {
            "DEF" => head.def = Some(value),
            "USE" => head.use_of = Some(value),
            "containerField" => head.field = Some(value),
            _ => head.fields.push(Field {
                name: name.to_owned(),
                value,
            }),
        }
    }
    builder.begin(head, warnings)?;
    if let Some(node) = builder.innermost() {
        match node.kind.as_str() {
            "X3D" => {
                let version = node.text("version").unwrap_or_default().to_owned();
                builder.set_version(&version);
            }
            "unit" => set_unit(builder, warnings),
            _ => {}
        }
    }
    Ok(())
}

/// Takes over a `unit` element: the size of a unit in metres or radians.
fn set_unit(builder: &mut Builder<'_>, warnings: &mut Warnings) {
    let Some(node) = builder.innermost() else {
        return;
    };
    let factor = node.number("conversionFactor", 1.0, warnings);
    if factor <= 0.0 {
        let text = "a unit must have a positive conversionFactor; it is not used";
        warnings.invalid(node.place(), text);
        return;
    }
    match node.text("category") {
        Some("length") => {
            let name = node.text("name").unwrap_or_default().to_owned();
            builder.set_length(kernel::Unit {
                name,
                metres: factor,
            });
        }
        Some("angle") => builder.set_angle(factor),
        _ => {}
    }
}

#[cfg(test)]
mod tests;
