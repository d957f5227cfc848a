//! X3D in its XML, classic and JSON encodings. What the nodes mean is said in `nodes`.

mod json;
mod xml;

#[cfg(test)]
mod broken_tests;
#[cfg(test)]
mod tests;

use crate::nodes::{self, Builder, without_mark};
use crate::{Error, Format, Import, Place, Problem, ReadOptions, vrml};

/// The row of this format.
pub(crate) const FORMAT: Format = Format {
    name: "X3D",
    extensions: &["x3d", "x3dz", "x3dv", "x3dvz", "x3dj", "json", "x3db"],
    sniff,
    read,
};

/// How files in the binary encoding begin.
const INFOSET: &[u8] = &[0xe0, 0, 0, 1];

/// How far into a file its X3D element is looked for: comments may stand before it.
const HEAD: usize = 1 << 16;

fn sniff(bytes: &[u8]) -> bool {
    let bytes = without_mark(bytes);
    if bytes.starts_with(b"#X3D V") || bytes.starts_with(INFOSET) {
        return true;
    }
    let start = bytes.trim_ascii_start();
    let head = &start[..start.len().min(HEAD)];
    match start.first() {
        Some(b'<') => head
            .windows(5)
            .any(|w| w == b"<X3D>" || w.starts_with(b"<X3D") && w[4].is_ascii_whitespace()),
        Some(b'{') => head.windows(5).any(|w| w == b"\"X3D\""),
        _ => false,
    }
}

fn read(bytes: &[u8], options: &ReadOptions<'_>) -> Result<Import, Error> {
    if bytes.starts_with(INFOSET) {
        let text =
            "the file is in the binary encoding (Fast Infoset); write it as XML or classic text";
        return Err(Error {
            format: FORMAT.name,
            place: Place::default(),
            problem: Problem::Unsupported(text.to_owned()),
        });
    }
    nodes::read(FORMAT.name, spelled, bytes, options)
}

/// Reads a file in the spelling that its first character shows.
///
/// # Errors
/// If a limit is passed.
pub(crate) fn spelled(bytes: &[u8], builder: &mut Builder<'_>) -> Result<Option<Error>, Error> {
    match without_mark(bytes).trim_ascii_start().first() {
        Some(b'<' | 0xfe | 0xff) => xml::read_xml(bytes, builder),
        Some(b'{') => json::read_json(bytes, builder),
        _ => vrml::read_classic(bytes, builder),
    }
}
