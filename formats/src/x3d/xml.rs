//! The XML encoding: elements and attributes to nodes.
//!
//! No document type is read and no entity of a document is expanded, so that a small file
//! cannot grow.

use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::{BytesStart, Event};

use crate::Error;
use crate::nodes::{Builder, Lines, decode, stands_in_scene};

/// How many attributes of an element are read. No node has as many, and each one is
/// compared with all before it.
const ATTRIBUTES: usize = 256;

/// Reads all elements, up to the place where the XML is broken, if it is. That is a warning
/// and also what comes back.
///
/// # Errors
/// If a limit is passed.
pub(super) fn read_xml(bytes: &[u8], builder: &mut Builder<'_>) -> Result<Option<Error>, Error> {
    let file = builder.file().clone();
    let text = decode(bytes, &file, &mut builder.warnings);
    let mut reader = Reader::from_str(&text);
    let mut lines = Lines::new(&text);
    let mut line_at = |position| lines.at(usize::try_from(position).unwrap_or(usize::MAX));
    // Whether the scene is ours, and ends with the file.
    let mut has_scene = false;
    loop {
        let line = line_at(reader.buffer_position());
        match reader.read_event() {
            Ok(Event::Start(element)) => {
                has_scene |= begin_scene(&element, line, builder)?;
                begin(&element, line, builder)?;
            }
            Ok(Event::Empty(element)) => {
                has_scene |= begin_scene(&element, line, builder)?;
                begin(&element, line, builder)?;
                builder.end()?;
            }
            Ok(Event::End(_)) => builder.end()?,
            Ok(Event::Eof) => match builder.innermost() {
                None => return Ok(None),
                Some(node) if has_scene && &*node.kind == "Scene" => {
                    builder.end()?;
                    return Ok(None);
                }
                Some(node) => {
                    let text = format!("the file ends inside {} of line {}", node.kind, node.line);
                    return Ok(Some(builder.broken(line, text)));
                }
            },
            Ok(_) => {}
            Err(problem) => {
                let line = line_at(reader.error_position());
                let text = format!("broken XML: {problem}; nothing is read from here on");
                return Ok(Some(builder.broken(line, text)));
            }
        }
    }
}

/// Puts a scene around an outermost element that is part of one. Says whether it did.
fn begin_scene(
    element: &BytesStart<'_>,
    line: usize,
    builder: &mut Builder<'_>,
) -> Result<bool, Error> {
    let kind = element.local_name().into_inner();
    let is_scene = kind == "Scene";
    if builder.innermost().is_some() || !(is_scene || stands_in_scene(kind)) {
        return Ok(false);
    }
    let place = builder.file().place(line, kind);
    let text = "there is no X3D element around it; it is taken for the scene";
    builder.warnings.invalid(place, text);
    if is_scene {
        return Ok(false);
    }
    builder.begin("Scene", line)?;
    Ok(true)
}

/// Begins the node of an element.
fn begin(element: &BytesStart<'_>, line: usize, builder: &mut Builder<'_>) -> Result<(), Error> {
    let kind = element.local_name().into_inner();
    builder.begin(kind, line)?;
    for (index, attribute) in element.attributes().enumerate() {
        let place = builder.file().place(line, kind);
        if index >= ATTRIBUTES {
            let text = format!("more than {ATTRIBUTES} attributes; the others are not used");
            builder.warnings.invalid(place, text);
            break;
        }
        let attribute = match attribute {
            Ok(attribute) => attribute,
            Err(problem) => {
                let text = format!("unreadable attribute: {problem}");
                builder.warnings.invalid(place, text);
                continue;
            }
        };
        let name = attribute.key.into_inner();
        if name.contains(':') {
            continue;
        }
        match unescape(&attribute.value) {
            Ok(value) => builder.attribute(name, &value),
            Err(problem) => {
                let text = format!("the value of {name} is not used: {problem}");
                builder.warnings.invalid(place, text);
            }
        }
    }
    Ok(())
}
