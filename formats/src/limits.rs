//! How much a file may ask for, and which other files it may name.

use std::fmt;
use std::io;

/// Upper bounds on what one file may make us do. Numbers in files are checked against
/// these, and against the data that is really there, before anything is allocated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of one file, also after decompression.
    pub bytes: usize,
    /// Entities, elements or statements of one file.
    pub entities: usize,
    /// How deep groups, references and elements may nest.
    pub nesting: usize,
    /// Control points and vertices of one file together.
    pub points: usize,
    /// Surfaces, meshes and curves shown, counting every place of an instance: a picture takes some
    /// 300 bytes for each, triangles more.
    pub placements: u64,
    /// Work that laying trim curves onto their surfaces may take, for each line of parameters of an
    /// IGES file and five thousand more: control points that are mixed for points of surfaces. No
    /// file that is known needs a hundredth of it; a hundred million take about a second.
    pub laying: usize,
    /// Texels of all pictures of one file together.
    pub texels: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            bytes: 2 << 30,
            entities: 50_000_000,
            nesting: 200,
            points: 100_000_000,
            placements: 3_000_000,
            laying: 10_000,
            texels: 100_000_000,
        }
    }
}

/// Fetches files that are named inside a file. Readers never open files themselves.
pub trait Resolver {
    /// The bytes of the file `name`, as it is spelled in the file.
    ///
    /// # Errors
    /// If there is no such file or it may not be read.
    fn resolve(&self, name: &str) -> io::Result<Vec<u8>>;
}

/// Resolves nothing: for data that did not come from a folder.
#[derive(Clone, Copy, Debug)]
pub struct NoFiles;

impl Resolver for NoFiles {
    fn resolve(&self, _: &str) -> io::Result<Vec<u8>> {
        Err(io::Error::new(
            io::ErrorKind::PermissionDenied,
            "files named inside are not opened",
        ))
    }
}

/// How to read.
#[derive(Clone, Copy)]
pub struct ReadOptions<'a> {
    /// Upper bounds.
    pub limits: &'a Limits,
    /// Where files named inside come from.
    pub resolver: &'a dyn Resolver,
}

impl fmt::Debug for ReadOptions<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ReadOptions")
            .field("limits", self.limits)
            .finish_non_exhaustive()
    }
}
