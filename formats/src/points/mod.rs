//! Points as they were measured: grids, and contours in layers, of one or several bodies.
//!
//! One row of [`POINT_FORMATS`] per kind of file, found by content first and ending second, as
//! [`crate::FORMATS`]. What is a grid, and what may be wrong with a contour, is for those to say
//! who make surfaces of them; every point and layer keeps its place in the file.

use std::borrow::Cow;
use std::fs;
use std::path::Path;

use glam::DVec3;
use kernel::Unit;

use crate::{
    Error, Export, Limits, OpenError, Place, Problem, Warnings, describe, plain, read_within,
};

mod dicom;
mod json;
mod polylines;
mod table;

/// Points of one file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointSet {
    /// Name of the format, as in [`POINT_FORMATS`].
    pub format: &'static str,
    /// The bodies, in the order of the file.
    pub bodies: Vec<PointBody>,
    /// The unit of length, if the file names one.
    pub unit: Option<Unit>,
    /// What was not used.
    pub warnings: Warnings,
}

/// Points of one body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointBody {
    /// The name in the file, or empty.
    pub name: String,
    /// Linear colour, if the file names one.
    pub color: Option<DVec3>,
    /// Share of the light that passes; no file names one.
    pub transparency: f64,
    /// Rows of a grid, or contours, in the order of the file.
    pub layers: Vec<Layer>,
}

/// A row of a grid, or a contour.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layer {
    /// Where it begins.
    pub place: Place,
    /// The points in order. The first one is not repeated at the end where `is_closed` is given.
    pub points: Vec<DVec3>,
    /// The line of each point, or nothing where lines have no meaning.
    pub lines: Vec<usize>,
    /// Whether the last point is followed by the first one, if the file says so.
    pub is_closed: Option<bool>,
}

impl Layer {
    /// Where a point stands.
    pub fn point_place(&self, index: usize) -> Place {
        let line = self.lines.get(index).copied();
        Place {
            line: line.unwrap_or(self.place.line),
            what: self.place.what.clone(),
        }
    }
}

/// A kind of file that holds points: one row each.
#[derive(Clone, Copy, Debug)]
pub struct PointFormat {
    /// Name in messages.
    pub name: &'static str,
    /// File name endings, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// Whether these bytes look like the format.
    pub sniff: fn(&[u8]) -> bool,
    /// Bytes to points.
    pub read: fn(&[u8], &Limits) -> Result<PointSet, Error>,
    /// Points to bytes, if they are written, too.
    pub write: Option<fn(&PointSet) -> Export>,
}

/// All kinds, those with the surest signs first.
pub const POINT_FORMATS: &[PointFormat] = &[
    dicom::FORMAT,
    json::FORMAT,
    polylines::FORMAT,
    table::FORMAT,
];

/// Reads the points of the file at `path`.
///
/// # Errors
/// If the file cannot be read, is larger than the limit, or breaks the rules of its format.
pub fn open_points(path: impl AsRef<Path>, limits: &Limits) -> Result<PointSet, OpenError> {
    let path = path.as_ref();
    let bytes = read_within(fs::File::open(path)?, limits.bytes)?;
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    Ok(read_points(&bytes, extension.as_deref(), limits)?)
}

/// Reads points; `extension` helps where the content does not tell the format. Gzip compression
/// is undone.
///
/// # Errors
/// As [`open_points`].
pub fn read_points(
    bytes: &[u8],
    extension: Option<&str>,
    limits: &Limits,
) -> Result<PointSet, Error> {
    let unknown = |problem| Error {
        format: "",
        place: Place::default(),
        problem,
    };
    let bytes: Cow<'_, [u8]> = plain(bytes, limits.bytes).map_err(unknown)?;
    let by_content = POINT_FORMATS.iter().find(|format| (format.sniff)(&bytes));
    let is_named =
        |format: &&PointFormat| extension.is_some_and(|e| format.extensions.contains(&e));
    let Some(format) = by_content.or_else(|| POINT_FORMATS.iter().find(is_named)) else {
        let names: Vec<_> = POINT_FORMATS.iter().map(|format| format.name).collect();
        let text = format!(
            "{}; points are read from {}",
            describe(&bytes),
            names.join(", ")
        );
        return Err(unknown(Problem::Unsupported(text)));
    };
    let set = (format.read)(&bytes, limits)?;
    if set.bodies.iter().all(|body| body.layers.is_empty()) {
        let text = "there are no points in the file".to_owned();
        return Err(format.error(Place::default(), Problem::Invalid(text)));
    }
    Ok(PointSet {
        format: format.name,
        ..set
    })
}

impl PointSet {
    /// What is written of the set, with a warning if the bodies are transparent: no format of
    /// points holds that.
    fn export(&self, bytes: Vec<u8>) -> Export {
        let mut export = Export {
            bytes,
            ..Export::default()
        };
        if self.bodies.iter().any(|body| body.transparency > 0.0) {
            let text = "files of points hold no opacity; it is left out";
            export.warnings.unsupported(Place::default(), text);
        }
        export
    }
}

impl PointFormat {
    fn error(&self, place: Place, problem: Problem) -> Error {
        Error {
            format: self.name,
            place,
            problem,
        }
    }

    fn invalid(&self, place: Place, text: impl Into<String>) -> Error {
        self.error(place, Problem::Invalid(text.into()))
    }

    /// The row for a file name, if the format is written.
    pub fn of_output(path: &Path) -> Option<&'static Self> {
        let extension = path.extension()?.to_str()?.to_lowercase();
        let mut written = POINT_FORMATS.iter().filter(|format| format.write.is_some());
        written.find(|format| format.extensions[0] == extension)
    }
}

/// Counts points against the limit.
struct Budget<'a> {
    limits: &'a Limits,
    used: usize,
}

impl<'a> Budget<'a> {
    fn new(limits: &'a Limits) -> Self {
        Self { limits, used: 0 }
    }

    fn take(&mut self, points: usize) -> Result<(), Problem> {
        self.used = self.used.saturating_add(points);
        if self.used <= self.limits.points {
            return Ok(());
        }
        let limit = self.limits.points;
        Err(Problem::TooLarge(format!("more than {limit} points")))
    }
}

#[cfg(test)]
mod tests;
