//! X3D.

use crate::{Error, Format, Import, ReadOptions};

/// The row of this format.
pub(crate) const FORMAT: Format = Format {
    name: "X3D",
    extensions: &["x3d"],
    sniff,
    read,
};

fn sniff(_: &[u8]) -> bool {
    false
}

fn read(_: &[u8], _: &ReadOptions<'_>) -> Result<Import, Error> {
    Ok(Import::default())
}
