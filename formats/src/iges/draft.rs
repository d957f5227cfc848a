//! Entities that are written down in memory instead of a file, for formats whose bodies have the
//! same make: they become a scene in the same way.

use std::cell::RefCell;
use std::collections::HashMap;
use std::fmt::Write as _;

use glam::DVec3;
use kernel::{Curve, Mesh, Surface, Unit};

use super::blanks;
use super::directory::{Entry, File};
use super::global::Global;
use super::net;
use super::parameters::{Delimiters, Parameters};
use super::records::Card;
use super::tree;
use super::types;
use crate::{Error, Import, Limits, Place, Problem, Warnings};

/// How many bytes of parameters a card has.
const CARD: usize = 64;

/// What an entity is called, and how it looks.
#[derive(Clone, Debug, Default)]
pub(crate) struct Look {
    /// Where it stands in the file that it comes from.
    pub place: Place,
    /// The number there of what it is made of.
    pub origin: u64,
    /// Its name, or nothing.
    pub name: String,
    /// Pointer to its colour, or zero.
    pub color: i64,
    /// Pointer to its transformation, or zero.
    pub transform: i64,
    /// Whether it is hidden.
    pub blanked: bool,
}

/// The parameters of an entity.
#[derive(Debug)]
pub(crate) struct Fields {
    text: String,
}

impl Fields {
    /// Those of a type, none yet.
    pub(crate) fn new(kind: i64) -> Self {
        Self {
            text: kind.to_string(),
        }
    }

    /// With integers or pointers.
    pub(crate) fn integers(mut self, values: impl IntoIterator<Item = i64>) -> Self {
        for value in values {
            let _ = write!(self.text, ",{value}");
        }
        self
    }

    /// With nothing in one place.
    pub(crate) fn blank(mut self) -> Self {
        self.text.push(',');
        self
    }

    /// With a count.
    pub(crate) fn count(self, count: usize) -> Self {
        self.integers([i64::try_from(count).unwrap_or(i64::MAX)])
    }

    /// With real numbers.
    pub(crate) fn reals(mut self, values: impl IntoIterator<Item = f64>) -> Self {
        for value in values {
            let _ = write!(self.text, ",{value:?}");
        }
        self
    }
}

/// Entities that are being written down.
#[derive(Debug, Default)]
pub(crate) struct Draft {
    entries: Vec<Entry>,
    text: Vec<u8>,
    /// Where the parameters of each end.
    ends: Vec<usize>,
    drafted: Drafted,
    origins: Vec<u64>,
}

/// What the directory of a file has no field for.
#[derive(Debug, Default)]
pub(super) struct Drafted {
    /// What entities are called in messages.
    pub sources: Vec<String>,
    /// The opacity of colours that have one, by entity.
    pub opacities: HashMap<usize, f64>,
    /// Meshes, by entity, until the scene has them.
    pub meshes: RefCell<HashMap<usize, Mesh>>,
    /// Pointers to the exact shapes that meshes stand for, by entity.
    pub exact: HashMap<usize, Vec<i64>>,
}

impl Draft {
    /// Adds an entity; the pointer to it.
    pub(crate) fn add(&mut self, form: i64, fields: &Fields, look: &Look) -> i64 {
        let number = 2 * self.entries.len() + 1;
        let kind = fields.text.split(',').next();
        let kind = kind.and_then(|kind| kind.parse().ok()).unwrap_or_default();
        self.text.extend(fields.text.bytes());
        self.text.push(b';');
        self.ends.push(self.text.len());
        self.drafted.sources.push(look.place.what.clone());
        self.origins.push(look.origin);
        self.entries.push(Entry {
            number,
            line: look.place.line,
            kind,
            form,
            data: 0,
            level: 0,
            transform: look.transform,
            color: -look.color,
            blanked: look.blanked,
            dependent: false,
            entity_use: 0,
            hierarchy: 0,
            label: look.name.clone(),
        });
        i64::try_from(number).unwrap_or(i64::MAX)
    }

    /// Adds a colour, red, green and blue from 0 to 1, and its opacity.
    pub(crate) fn add_color(&mut self, srgb: [f64; 3], opacity: f64, look: &Look) -> i64 {
        let percent = srgb.map(|value| value.clamp(0.0, 1.0) * 100.0);
        let index = self.entries.len();
        self.drafted.opacities.insert(index, opacity);
        self.add(0, &Fields::new(314).reals(percent), look)
    }

    /// Adds a mesh.
    pub(crate) fn add_mesh(&mut self, mesh: Mesh, look: &Look) -> i64 {
        self.drafted
            .meshes
            .get_mut()
            .insert(self.entries.len(), mesh);
        self.add(0, &Fields::new(types::MESH), look)
    }

    /// Shows a mesh only if the exact shape that it stands for cannot be shown. It may have become several
    /// entities.
    pub(crate) fn stands_for(&mut self, mesh: i64, exact: i64) {
        let index = usize::try_from(mesh / 2).unwrap_or(usize::MAX);
        self.drafted.exact.entry(index).or_default().push(exact);
    }

    /// Adds a curve (type 126).
    pub(crate) fn add_curve(&mut self, curve: &Curve<DVec3>, look: &Look) -> i64 {
        let domain = curve.domain();
        let fields = Fields::new(126)
            .count(curve.homogeneous().len() - 1)
            .count(curve.degree())
            .integers([0; 4])
            .reals(curve.knots().as_slice().iter().copied())
            .reals(curve.weights())
            .reals(curve.points().flat_map(|point| point.to_array()))
            .reals([domain.start, domain.end]);
        self.add(0, &fields, look)
    }

    /// How many bytes all parameters have.
    pub(crate) fn size(&self) -> usize {
        self.text.len()
    }

    /// The numbers of what all entities are made of.
    pub(crate) fn origins(&self) -> &[u64] {
        &self.origins
    }

    /// Makes a scene of all.
    ///
    /// # Errors
    /// If a limit is passed, or nothing can be shown.
    pub(crate) fn into_import(
        mut self,
        unit: Option<Unit>,
        resolution: f64,
        limits: &Limits,
        mut warnings: Warnings,
    ) -> Result<Import, Error> {
        let mut cards = Vec::new();
        let mut start = 0;
        for (entry, &end) in self.entries.iter_mut().zip(&self.ends) {
            entry.data = i64::try_from(cards.len() + 1).unwrap_or(i64::MAX);
            for data in self.text[start..end].chunks(CARD) {
                cards.push(Card {
                    line: entry.line,
                    number: cards.len() + 1,
                    data,
                    owner: b"",
                });
            }
            start = end;
        }
        let global = Global {
            delimiters: Delimiters::default(),
            scale: 1.0,
            unit,
            resolution,
        };
        let mut file = File::new(global, self.entries, cards);
        file.drafted = self.drafted;
        if let Some(first) = blanks::settle(&mut file) {
            let text = "all that could be shown is hidden; it is shown";
            warnings.invalid(file.place(first), text);
        }
        tree::read(&file, limits, warnings)
    }
}

/// The surface of an entity (type 128), if it is one without tears.
///
/// # Errors
/// If there is no such surface.
pub(crate) fn surface(fields: &Fields) -> Result<Surface, Problem> {
    let text = format!("{};", fields.text);
    let mut parameters = Parameters::new(text.as_bytes(), Delimiters::default(), 0);
    parameters.integer()?;
    let pieces = net::read(&mut parameters, usize::MAX, false, &mut Vec::new())?;
    match <[Surface; 1]>::try_from(pieces) {
        Ok([surface]) => Ok(surface),
        Err(_) => {
            let text = "a surface in several pieces cannot be cut";
            Err(Problem::Unsupported(text.to_owned()))
        }
    }
}
