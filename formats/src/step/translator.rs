//! What instances become in the draft, one by one.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;

use glam::{DAffine3, DVec3};
use kernel::{Curve, Mesh};

use super::curves::Geometry;
use super::external::Files;
use super::nets::matrix;
use super::overrides::Scopes;
use super::part21::Exchange;
use super::products::{Assembly, has_inverse_scales};
use super::styles::{Style, Styles};
use super::surfaces::Sheet;
use super::tessellated::{self, Tessellations};
use super::topology::Edge;
use super::units::Units;
use crate::iges::{Draft, Fields, Look};
use crate::{Error, Limits, Place, Problem, Warnings};

/// How many times as much as the file what is written down of it may have, in bytes, and how much it
/// may have anyway.
const GROWTH: usize = 50;
const GROWTH_FREE: usize = 1 << 26;

/// Solids, shells and faces, also of triangles, have ranks below this among shapes: they may stand for themselves.
const LOOSE: usize = 5;

/// What became of items, products and representations.
#[derive(Debug, Default)]
pub(super) struct Known {
    pub items: HashMap<u64, Option<i64>>,
    /// Definitions, with their units.
    pub products: HashMap<u64, Option<(i64, Units)>>,
    /// Definitions of those that are shown in others, or for their own sake.
    pub representations: HashMap<u64, Option<i64>>,
}

/// Writes the instances of a file down as entities.
#[derive(Debug)]
pub(super) struct Translator<'a> {
    pub exchange: &'a Exchange<'a>,
    pub limits: &'a Limits,
    pub files: &'a Files<'a>,
    /// The name of the file, if another one names it; else nothing.
    pub file: String,
    pub draft: Draft,
    /// Instances of which entities were made.
    made: HashSet<u64>,
    pub warnings: Warnings,
    pub styles: Styles,
    pub assembly: Assembly,
    /// Whether operators that place parts have the reciprocals of their scales.
    pub has_inverse_scales: bool,
    /// The units that hold where we are.
    pub units: Units,
    /// Those of representations.
    pub units_known: HashMap<u64, Units>,
    /// The pointer to the transformation of the surfaces that are made, or zero.
    pub transform: i64,
    pub surfaces: HashMap<u64, Result<Sheet, Problem>>,
    pub edges: HashMap<u64, Result<Rc<Edge>, Problem>>,
    /// Those around the face that is made.
    pub edges_around: Vec<Rc<Edge>>,
    /// What became of items, products and representations where we are.
    pub known: Known,
    /// The same in other places, where some look differently.
    pub scopes: Scopes<Known>,
    /// What shapes of triangles are made of.
    pub tessellations: Tessellations,
    /// Faces whose loops are to be turned.
    pub against: HashSet<u64>,
    /// How many uses of edges may yet be looked at for that.
    pub uses_left: usize,
    /// How many edges around faces may still be gone along.
    pub stretches_left: usize,
    /// Items, representations and products that are being made.
    pub busy: HashSet<u64>,
    /// Instances that could not be used.
    pub refused: BTreeSet<u64>,
    /// The first of them.
    pub failure: Option<Error>,
    /// A limit that was passed.
    pub fatal: Option<Error>,
    pub points_left: usize,
    /// How many bytes may be written down.
    most: usize,
}

impl<'a> Translator<'a> {
    pub(super) fn new(
        exchange: &'a Exchange<'a>,
        limits: &'a Limits,
        files: &'a Files<'a>,
    ) -> Self {
        Self {
            exchange,
            limits,
            files,
            file: String::new(),
            draft: Draft::default(),
            made: HashSet::new(),
            warnings: Warnings::default(),
            styles: Styles::default(),
            assembly: Assembly::default(),
            has_inverse_scales: has_inverse_scales(exchange.bytes),
            units: Units::default(),
            units_known: HashMap::new(),
            transform: 0,
            surfaces: HashMap::new(),
            edges: HashMap::new(),
            edges_around: Vec::new(),
            known: Known::default(),
            scopes: Scopes::default(),
            tessellations: Tessellations::default(),
            against: HashSet::new(),
            uses_left: exchange.size(),
            stretches_left: exchange.size(),
            busy: HashSet::new(),
            refused: BTreeSet::new(),
            failure: None,
            fatal: None,
            points_left: limits.points,
            most: exchange
                .size()
                .saturating_mul(GROWTH)
                .saturating_add(GROWTH_FREE),
        }
    }

    /// Takes over from another file what is common to all.
    pub(super) fn continue_with(&mut self, other: &mut Translator<'_>) {
        self.draft = std::mem::take(&mut other.draft);
        self.warnings = std::mem::take(&mut other.warnings);
        self.failure = self.failure.take().or(other.failure.take());
        self.fatal = self.fatal.take().or(other.fatal.take());
        self.points_left = other.points_left;
        self.most = self.most.saturating_add(other.most);
    }

    /// Where an instance stands.
    fn place(&self, id: u64) -> Place {
        let place = self.exchange.place(id);
        if self.file.is_empty() {
            return place;
        }
        Place {
            what: format!("{} of {}", place.what, self.file),
            ..place
        }
    }

    /// Notes what is wrong with an instance that is needed for nothing.
    pub(super) fn note(&mut self, id: u64, problem: Problem) {
        let place = self.place(id);
        self.warnings.add(place, problem);
    }

    /// Notes what is wrong with the file as a whole.
    pub(super) fn greet(&mut self) {
        let at = |line: usize| Place::item(line, self.file.clone());
        let counted = [
            (
                self.exchange.stray,
                "a statement is no instance; it is skipped",
                "statements are no instances; they are skipped",
            ),
            (
                self.exchange.doubled,
                "an instance has the number of one before it, which counts",
                "instances have numbers of others before them, which count",
            ),
            (
                self.exchange.unended,
                "an instance has no semicolon at its end",
                "instances have no semicolon at their end",
            ),
        ];
        for (found, one, many) in counted {
            let Some((line, count)) = found else { continue };
            let text = match count {
                1 => one.to_owned(),
                _ => format!("{count} {many}"),
            };
            self.warnings.invalid(at(line), text);
        }
        if !self.exchange.is_ended {
            let text = "END-ISO-10303-21 is missing; the file may be cut short";
            self.warnings.invalid(at(0), text);
        }
    }

    /// What reads geometry.
    pub(super) fn geometry(&self) -> Geometry<'a> {
        Geometry {
            exchange: self.exchange,
            angle: self.units.radians,
            limit: self.points_left,
        }
    }

    /// Counts an instance as one of which entities were made.
    pub(super) fn count(&mut self, id: u64) {
        self.made.insert(id);
    }

    /// What an entity made of an instance is called.
    fn look(&mut self, id: u64) -> Look {
        self.count(id);
        Look {
            place: self.place(id),
            // Numbers of other files mean nothing in the first.
            origin: if self.file.is_empty() { id } else { 0 },
            ..Look::default()
        }
    }

    /// Adds an entity.
    pub(super) fn add(&mut self, form: i64, fields: &Fields, id: u64) -> i64 {
        let look = self.look(id);
        self.draft.add(form, fields, &look)
    }

    /// Adds an entity that has a name, a colour of its own, or is hidden; moved as surfaces are.
    pub(super) fn add_named(&mut self, form: i64, fields: &Fields, id: u64, name: String) -> i64 {
        let look = self.named_look(id, name);
        self.draft.add(form, fields, &look)
    }

    /// As [`Translator::add_named`], of a mesh.
    pub(super) fn add_mesh(&mut self, mesh: Mesh, id: u64, name: String) -> i64 {
        let look = self.named_look(id, name);
        self.draft.add_mesh(mesh, &look)
    }

    fn named_look(&mut self, id: u64, name: String) -> Look {
        Look {
            name,
            color: self.color(self.styles.of_surfaces(id)),
            blanked: self.styles.is_hidden(id),
            transform: self.transform,
            ..self.look(id)
        }
    }

    /// Adds a point (type 116) or a direction (type 123).
    pub(super) fn vector(&mut self, kind: i64, vector: DVec3, id: u64) -> i64 {
        self.add(0, &Fields::new(kind).reals(vector.to_array()), id)
    }

    /// Adds a curve.
    pub(super) fn curve(&mut self, curve: &Curve<DVec3>, id: u64) -> i64 {
        let look = Look {
            color: self.color(self.styles.of_curve(id)),
            blanked: self.styles.is_hidden(id),
            ..self.look(id)
        };
        self.draft.add_curve(curve, &look)
    }

    /// The pointer to a colour; zero for none.
    fn color(&mut self, style: Option<Style>) -> i64 {
        let Some(style) = style else {
            return 0;
        };
        if let Some(known) = self.styles.known.get(&style.key()) {
            return *known;
        }
        let look = self.look(style.color);
        let pointer = self.draft.add_color(style.srgb, style.opacity, &look);
        self.styles.known.insert(style.key(), pointer);
        pointer
    }

    /// Adds a surface.
    pub(super) fn add_surface(&mut self, form: i64, fields: &Fields, id: u64) -> i64 {
        self.add_named(form, fields, id, String::new())
    }

    /// What `make` makes of surfaces, moved by a map.
    pub(super) fn moved<T>(
        &mut self,
        map: &DAffine3,
        id: u64,
        make: impl FnOnce(&mut Self) -> T,
    ) -> T {
        let pointer = if *map == DAffine3::IDENTITY {
            self.transform
        } else {
            self.add_surface(0, &matrix(map), id)
        };
        let before = std::mem::replace(&mut self.transform, pointer);
        let made = make(self);
        self.transform = before;
        made
    }

    /// Shows a definition in a place.
    pub(super) fn placed(&mut self, definition: i64, map: &DAffine3, id: u64, name: String) -> i64 {
        let transform = if *map == DAffine3::IDENTITY {
            0
        } else {
            self.add(0, &matrix(map), id)
        };
        let look = Look {
            name,
            color: self.color(self.styles.of_surfaces(id)),
            blanked: self.styles.is_hidden(id),
            transform,
            ..self.look(id)
        };
        let fields = Fields::new(408).integers([definition]);
        let fields = fields.reals([0.0, 0.0, 0.0, 1.0]);
        self.draft.add(0, &fields, &look)
    }

    /// A definition (type 308) of members.
    pub(super) fn definition(&mut self, members: Vec<i64>, id: u64, name: String) -> i64 {
        let fields = Fields::new(308).integers([0]).blank().count(members.len());
        self.add_named(0, &fields.integers(members), id, name)
    }

    /// Counts control points.
    pub(super) fn spend(&mut self, count: usize) -> Result<(), Problem> {
        self.points_left = self.points_left.checked_sub(count).ok_or_else(|| {
            let text = format!("more than {} control points", self.limits.points);
            Problem::TooLarge(text)
        })?;
        Ok(())
    }

    /// Stops where far more would be written down than is in the file.
    pub(super) fn check_size(&mut self, id: u64) {
        if self.draft.size() > self.most && self.fatal.is_none() {
            let text = "too many instances are made of the same large ones";
            let problem = Problem::Unsupported(text.to_owned());
            self.fatal = Some(super::error(self.place(id), problem));
        }
    }

    /// Whether what is written down is about to become too much.
    pub(super) fn is_crowded(&self) -> bool {
        self.draft.size() > self.most / 2
    }

    /// Whether something is shown already, in whatever place.
    pub(super) fn is_shown(&self, item: u64) -> bool {
        let known = self.known.items.get(&item);
        known.is_some_and(Option::is_some) || self.made.contains(&item)
    }

    /// Notes that an instance cannot be shown.
    pub(super) fn fail(&mut self, id: u64, problem: Problem) {
        let place = self.place(id);
        self.refused.insert(id);
        // The place says already who it is.
        let own = format!("{}: ", self.exchange.source(id));
        let problem = match problem {
            Problem::Invalid(text) => Problem::Invalid(without(text, &own)),
            Problem::Unsupported(text) => Problem::Unsupported(without(text, &own)),
            other => other,
        };
        if let Problem::TooLarge(_) = problem {
            let error = super::error(place, problem);
            self.fatal.get_or_insert(error);
            return;
        }
        self.failure
            .get_or_insert_with(|| super::error(place.clone(), problem.clone()));
        self.warnings.add(place, problem);
    }

    /// Notes what is not as the file means it.
    pub(super) fn tell(&mut self, id: u64, text: impl Into<String>) {
        let place = self.place(id);
        self.warnings.unsupported(place, text);
    }

    /// Solids, shells, faces and the like that nothing shows, in this order, each with its rank.
    fn unseen(&self) -> Vec<(usize, u64)> {
        let rank = |id: u64| {
            let keyword = self.exchange.keyword(id).to_ascii_uppercase();
            match keyword.as_slice() {
                b"MANIFOLD_SOLID_BREP" | b"BREP_WITH_VOIDS" | b"FACETED_BREP" => Some(0),
                b"CLOSED_SHELL" | b"OPEN_SHELL" => Some(1),
                b"ADVANCED_FACE" | b"FACE_SURFACE" => Some(2),
                b"RECTANGULAR_TRIMMED_SURFACE" | b"CURVE_BOUNDED_SURFACE" => Some(LOOSE),
                name => tessellated::rank(name).map(|rank| 3 + rank),
            }
        };
        let is_new = |id: &u64| !self.made.contains(id) && !self.refused.contains(id);
        let ids = self.exchange.ids().filter(is_new);
        let mut ranked: Vec<_> = ids.filter_map(|id| Some((rank(id)?, id))).collect();
        ranked.sort_unstable();
        ranked
    }

    /// Where no representation shows anything (`is_empty`), shows all shapes that there are: pointers
    /// to them; else tells those that none shows.
    pub(super) fn leftovers(&mut self, is_empty: bool) -> Vec<i64> {
        let mut all = Vec::new();
        let places = self.scopes.values().chain([&self.known]);
        let tried: HashSet<u64> = places
            .flat_map(|known| known.items.keys().copied())
            .collect();
        let held = if is_empty {
            self.held()
        } else {
            HashSet::new()
        };
        for (rank, id) in self.unseen() {
            if tried.contains(&id) || self.known.items.contains_key(&id) {
                continue;
            }
            let shown = (is_empty && rank < LOOSE && !held.contains(&id))
                .then(|| self.item(id, 0))
                .flatten();
            let text = match shown {
                Some(_) => "no representation of a shape has it; it is shown for its own sake",
                None => "it is not shown: no representation of a shape that is shown has it",
            };
            if !self.refused.contains(&id) {
                self.tell(id, text);
            }
            all.extend(shown);
        }
        all
    }
}

/// A text without its beginning, if it begins so.
fn without(text: String, start: &str) -> String {
    text.strip_prefix(start).map(str::to_owned).unwrap_or(text)
}
