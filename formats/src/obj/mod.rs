//! OBJ.

use crate::{Error, Format, Import, ReadOptions};

/// The row of this format.
pub(crate) const FORMAT: Format = Format {
    name: "OBJ",
    extensions: &["obj"],
    sniff,
    read,
};

fn sniff(_: &[u8]) -> bool {
    false
}

fn read(_: &[u8], _: &ReadOptions<'_>) -> Result<Import, Error> {
    Ok(Import::default())
}
