//! What scenes can be written as, and which of these a file name asks for.

use std::path::Path;

/// A kind of file that scenes are written to.
#[derive(Clone, Copy, Debug)]
pub enum Target {
    /// With surfaces as they are.
    Surfaces(&'static formats::Writer),
}

impl Target {
    /// All kinds; of those with the same file name ending the first one is meant.
    pub fn all() -> impl Iterator<Item = Self> {
        formats::WRITERS.iter().map(Self::Surfaces)
    }

    /// The kind that the ending of a file name asks for.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_lowercase();
        Self::all().find(|target| target.extensions().contains(&extension.as_str()))
    }

    /// Name in messages and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Surfaces(writer) => writer.name,
        }
    }

    /// File name endings, lower case, without the dot.
    pub fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Surfaces(writer) => writer.extensions,
        }
    }
}
