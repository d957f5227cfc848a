//! From scene to bytes: one row of [`WRITERS`] per format that stores surfaces as they are.

use kernel::Scene;

use crate::{Error, Warnings, iges};

/// A format that scenes are written in with their surfaces as they are: one row each.
#[derive(Clone, Copy, Debug)]
pub struct Writer {
    /// Name in messages and on the command line; that of the row of [`crate::FORMATS`] that
    /// reads it again, or longer.
    pub name: &'static str,
    /// File name endings, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// Scene to bytes.
    pub write: Write,
}

/// Scene to bytes; `stem` is the name of the file without its ending, for titles and for
/// files beside it.
///
/// The bytes depend on the scene and the stem alone.
pub type Write = fn(scene: &Scene, stem: &str) -> Result<Export, Error>;

/// What a writer gives: the content of files, and everything that they cannot hold.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Export {
    /// The content of the file.
    pub bytes: Vec<u8>,
    /// Files that it names, to be put beside it: name and content.
    pub beside: Vec<(String, Vec<u8>)>,
    /// What the format cannot hold.
    pub warnings: Warnings,
}

/// All formats that surfaces are written in as they are.
pub const WRITERS: &[Writer] = &[iges::WRITER];
