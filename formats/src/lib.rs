//! How scenes are *stored*: one folder and one row of [`FORMATS`] per file format.
//!
//! A reader turns bytes into a [`Scene`] and a list of [`Warning`]s. It opens no file,
//! prints nothing and does not panic; it fails only when nothing useful is left.
//!
//! ```
//! let obj = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\ncstype bezier\ndeg 1 1\n\
//!     surf 0 1 0 1 1 2 3 4\nparm u 0 1\nparm v 0 1\nend\n";
//! let options = nurbray_formats::ReadOptions {
//!     limits: &Default::default(),
//!     resolver: &nurbray_formats::NoFiles,
//! };
//! let import = nurbray_formats::read(obj, Some("obj"), &options)?;
//! assert_eq!(import.scene.patches().len(), 1);
//! # Ok::<(), nurbray_formats::Error>(())
//! ```
#![forbid(unsafe_code)]

use std::borrow::Cow;
use std::io::{self, Read as _};
use std::ops::Range;
use std::path::{Component, Path, PathBuf};
use std::{fmt, fs};

use kernel::Scene;

mod error;
mod iges;
mod least;
mod lifted;
mod limits;
mod loops;
mod nodes;
mod obj;
mod pictures;
mod points;
mod step;
pub mod triangulate;
mod uneven;
mod vrml;
mod write;
mod x3d;

pub use error::{Error, Place, Problem, Warning, Warnings};
pub use glam;
pub use limits::{Limits, NoFiles, ReadOptions, Resolver};
pub use nodes::{Animation, decoded};
pub use points::{
    Layer, POINT_FORMATS, PointBody, PointFormat, PointSet, open_points, read_points,
};
pub use write::{Export, WRITERS, Write, Writer};

/// A file format: one row per folder of this crate.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    /// Name in messages.
    pub name: &'static str,
    /// File name endings, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// Whether these first bytes look like the format.
    pub sniff: fn(&[u8]) -> bool,
    /// Bytes to scene.
    pub read: Reader,
}

/// Bytes to scene, within the limits; the resolver fetches files named inside.
pub type Reader = fn(&[u8], &ReadOptions<'_>) -> Result<Import, Error>;

/// What a reader gives: a scene, and everything it could not use or had to repair.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Import {
    /// Name of the format, as in [`FORMATS`].
    pub format: &'static str,
    /// The scene.
    pub scene: Scene,
    /// What was not used or was repaired.
    pub warnings: Warnings,
    /// What became of the entities of the file, by type; empty for formats without entities.
    pub ledger: Vec<Tally>,
    /// The levels, or layers, of what is shown; empty where nothing is said.
    pub levels: Vec<Level>,
    /// The same scene at other times, if anything in it moves by itself.
    pub animation: Option<Animation>,
}

/// What became of the entities of one type, by their numbers in the file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// The type, as the format names and numbers it.
    pub kind: String,
    /// What stands before the numbers of its entities.
    pub mark: &'static str,
    /// How many there are.
    pub count: usize,
    /// Those that the scene is made of.
    pub used: Vec<usize>,
    /// Those of them that had to be repaired.
    pub repaired: Vec<usize>,
    /// Those that were wanted and could not be used. What is in neither list was not needed.
    pub refused: Vec<usize>,
}

/// A level, or layer: a number by which entities are shown and hidden together.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Level {
    /// Its number.
    pub number: i64,
    /// Its name, or empty.
    pub name: String,
    /// How many faces, surfaces, curves and points are on it.
    pub count: usize,
}

/// All formats, those with the surest signs first.
pub const FORMATS: &[Format] = &[
    x3d::FORMAT,
    vrml::FORMAT,
    step::FORMAT,
    iges::FORMAT,
    obj::FORMAT,
];

/// Why a file could not be opened.
#[derive(Debug)]
#[non_exhaustive]
pub enum OpenError {
    /// The file system says no.
    Io(io::Error),
    /// The content is not usable.
    Format(Error),
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io(error) => write!(f, "{error}"),
            Self::Format(error) => write!(f, "{error}"),
        }
    }
}

impl std::error::Error for OpenError {}

impl From<io::Error> for OpenError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl From<Error> for OpenError {
    fn from(error: Error) -> Self {
        Self::Format(error)
    }
}

/// Reads the file at `path`. Files that it names must lie in its folder or below.
///
/// # Errors
/// If the file cannot be read, is larger than the limit, or holds nothing usable.
pub fn open(path: impl AsRef<Path>, limits: &Limits) -> Result<Import, OpenError> {
    let folder = path.as_ref().parent().unwrap_or(Path::new(""));
    open_within(&path, folder, limits)
}

/// Reads the file at `path`. Files that it names are looked for from its folder on, and must
/// lie in `root` or below.
///
/// # Errors
/// If the file cannot be read, is larger than the limit, or holds nothing usable.
pub fn open_within(
    path: impl AsRef<Path>,
    root: impl AsRef<Path>,
    limits: &Limits,
) -> Result<Import, OpenError> {
    let path = path.as_ref();
    let bytes = read_within(fs::File::open(path)?, limits.bytes)?;
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let folder = path.parent().unwrap_or(Path::new(""));
    let resolver = Folder::new(folder, root.as_ref(), limits);
    let options = ReadOptions {
        limits,
        resolver: &resolver,
    };
    Ok(read(&bytes, extension.as_deref(), &options)?)
}

/// Reads a file's content; `extension` helps where the content does not tell the format.
/// Gzip compression is undone.
///
/// # Errors
/// If no format fits, a limit is passed, or the content holds nothing usable.
pub fn read(
    bytes: &[u8],
    extension: Option<&str>,
    options: &ReadOptions<'_>,
) -> Result<Import, Error> {
    let plain = plain(bytes, options.limits.bytes).map_err(unknown)?;
    read_plain(&plain, extension, options)
}

/// Compressed data may grow by this factor, and by this many bytes before that counts. Text
/// full of numbers grows by ten.
const GROWTH: usize = 100;
const GROWTH_FREE: usize = 16 << 20;

/// How files begin that stand for others, and what gets those.
const STANDING_FOR: [(&[u8], &str); 2] = [
    (
        b"version https://git-lfs.github.com/spec/",
        "it only points to a file in Git LFS; \"git lfs pull\" fetches that",
    ),
    (
        b"PK\x03\x04",
        "it is a ZIP archive; unpack it, and read the files in it",
    ),
];

/// The content of a file, of no more than so many bytes, with gzip compression undone, if there
/// is one.
fn plain(bytes: &[u8], limit: usize) -> Result<Cow<'_, [u8]>, Problem> {
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return if bytes.len() <= limit {
            Ok(Cow::Borrowed(bytes))
        } else {
            Err(Problem::TooLarge(format!("more than {limit} bytes")))
        };
    }
    let mut decoder = flate2::read::MultiGzDecoder::new(bytes);
    let (mut plain, mut block) = (Vec::new(), vec![0; 1 << 16]);
    loop {
        let count = decoder.read(&mut block);
        let count = count.map_err(|e| Problem::Invalid(format!("damaged gzip data: {e}")))?;
        if count == 0 {
            return Ok(Cow::Owned(plain));
        }
        plain.extend_from_slice(&block[..count]);
        let used = bytes.len() - decoder.get_ref().len();
        let allowed = used.saturating_mul(GROWTH).saturating_add(GROWTH_FREE);
        if plain.len() > allowed.min(limit) {
            let text = format!("gzip data that grows beyond {} bytes", allowed.min(limit));
            return Err(Problem::TooLarge(text));
        }
    }
}

fn read_plain(
    bytes: &[u8],
    extension: Option<&str>,
    options: &ReadOptions<'_>,
) -> Result<Import, Error> {
    if bytes.is_empty() {
        return Err(unknown(Problem::Invalid("it is empty".to_owned())));
    }
    let other = STANDING_FOR
        .iter()
        .find(|(head, _)| bytes.starts_with(head));
    if let Some((_, text)) = other {
        return Err(unknown(Problem::Invalid((*text).to_owned())));
    }
    let by_content = FORMATS.iter().find(|format| (format.sniff)(bytes));
    let by_name = || {
        FORMATS
            .iter()
            .find(|f| extension.is_some_and(|e| f.extensions.contains(&e)))
    };
    let Some(format) = by_content.or_else(by_name) else {
        return Err(unknown(Problem::Unsupported(format!(
            "{}; nurbray reads {}",
            describe(bytes),
            FORMATS
                .iter()
                .map(|f| f.name)
                .collect::<Vec<_>>()
                .join(", ")
        ))));
    };
    let mut import = Import {
        format: format.name,
        ..(format.read)(bytes, options)?
    };
    uneven::tell(&import.scene, &mut import.warnings);
    let (scene, limit) = (&import.scene, options.limits.placements);
    let placed = scene.placement_count();
    let placed = placed.saturating_add(scene.wire_placement_count());
    if placed > limit {
        let text = format!("{placed} shapes after instancing; the limit is {limit}");
        return Err(Error {
            format: format.name,
            ..unknown(Problem::TooLarge(text))
        });
    }
    Ok(import)
}

/// An error about a file of which the format is not known.
fn unknown(problem: Problem) -> Error {
    Error {
        format: "",
        place: Place::default(),
        problem,
    }
}

/// What the first bytes show, for people.
fn describe(bytes: &[u8]) -> String {
    let head = bytes
        .iter()
        .take(40)
        .take_while(|b| !matches!(b, b'\n' | b'\r'));
    let head: String = head
        .map(|&b| if b.is_ascii_graphic() { b as char } else { ' ' })
        .collect();
    match head.trim() {
        "" if bytes.is_empty() => "the file is empty".to_owned(),
        "" => "the format is not known".to_owned(),
        head => format!("the format is not known: it begins with \"{head}\""),
    }
}

/// All bytes of `source`, or an error if there are more than `limit`.
///
/// # Errors
/// If the source cannot be read or holds more.
pub fn read_within(source: impl io::Read, limit: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    source.take(limit as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > limit {
        let text = format!("larger than the limit of {limit} bytes");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, text));
    }
    Ok(bytes)
}

/// What two ranges have in common; may be empty.
fn common(a: &Range<f64>, b: &Range<f64>) -> Range<f64> {
    a.start.max(b.start)..a.end.min(b.end)
}

/// Resolves names in one folder to files in another one and below.
#[derive(Clone, Debug)]
pub struct Folder<'a> {
    base: &'a Path,
    root: &'a Path,
    limits: &'a Limits,
}

impl<'a> Folder<'a> {
    /// Names are looked for from `base` on; the files must lie in `root` or below.
    pub fn new(base: &'a Path, root: &'a Path, limits: &'a Limits) -> Self {
        Self { base, root, limits }
    }
}

impl Resolver for Folder<'_> {
    fn resolve(&self, name: &str) -> io::Result<Vec<u8>> {
        let denied = |why| io::Error::new(io::ErrorKind::PermissionDenied, why);
        let name = PathBuf::from(name.replace('\\', "/"));
        let [base, root] = [self.base, self.root].map(|folder| match folder.as_os_str() {
            name if name.is_empty() => Path::new("."),
            _ => folder,
        });
        // Without a look at the disk: that a file elsewhere exists is nobody's business.
        if self.base == self.root && !stays_inside(&name, root) {
            return Err(denied("the name leads out of the folder"));
        }
        // A link inside the folder may still lead out of it.
        let path = base.join(name).canonicalize()?;
        if !path.starts_with(root.canonicalize()?) {
            return Err(denied("the name leads out of the folder"));
        }
        // A pipe or a device might wait for ever.
        if !path.is_file() {
            return Err(denied("not a regular file"));
        }
        read_within(fs::File::open(path)?, self.limits.bytes)
    }
}

/// Whether a name leads nowhere but into a folder and below, as it is written.
fn stays_inside(name: &Path, folder: &Path) -> bool {
    let inside = |c| matches!(c, Component::Normal(_) | Component::CurDir);
    if name.is_relative() {
        return name.components().all(inside);
    }
    let folders = [std::path::absolute(folder), folder.canonicalize()];
    let mut below = folders.iter().flatten().map(|f| name.strip_prefix(f));
    below.any(|rest| rest.is_ok_and(|rest| rest.components().all(inside)))
}
