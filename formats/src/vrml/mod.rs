//! VRML 97 in its utf8 encoding; the classic encoding of X3D has the same grammar.
//!
//! What the nodes mean is said in `nodes`.

mod grammar;
mod tokens;

#[cfg(test)]
mod tests;

use crate::nodes::{self, without_mark};
use crate::{Error, Format, Import, Place, Problem, ReadOptions, x3d};

pub(crate) use grammar::read_classic;

/// The row of this format.
pub(crate) const FORMAT: Format = Format {
    name: "VRML",
    extensions: &["wrl", "wrz"],
    sniff,
    read,
};

fn sniff(bytes: &[u8]) -> bool {
    let bytes = without_mark(bytes);
    bytes.starts_with(b"#VRML V") || elder(bytes).is_some()
}

/// What to say about the formats that VRML 97 has replaced.
fn elder(bytes: &[u8]) -> Option<&'static str> {
    let bytes = without_mark(bytes);
    if bytes.starts_with(b"#VRML V1.") {
        Some(
            "this is VRML 1.0; save it as VRML 97, or convert it with a program such as vrml1tovrml2",
        )
    } else if bytes.starts_with(b"#Inventor V") {
        Some("this is Open Inventor; export it as VRML 97, which Inventor's ivvrml does")
    } else {
        None
    }
}

fn read(bytes: &[u8], options: &ReadOptions<'_>) -> Result<Import, Error> {
    if let Some(text) = elder(bytes) {
        return Err(Error {
            format: FORMAT.name,
            place: Place::line(1),
            problem: Problem::Unsupported(text.to_owned()),
        });
    }
    nodes::read(FORMAT.name, x3d::spelled, bytes, options)
}
