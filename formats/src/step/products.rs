//! Products, assemblies and representations, with their units.

use std::cell::RefCell;
use std::collections::{HashMap, HashSet};
use std::rc::Rc;

use glam::{DAffine3, DVec3};

use super::structure::{Occurrence, Relation, Structure};
use super::styles::Styles;
use super::translator::Translator;
use super::units::Units;
use super::values::{Attributes, Record};
use crate::Problem;

/// The attributes of a representation: its name, items and context.
pub(super) fn of_representation<'r, 'a>(record: &'r Record<'a>) -> Attributes<'r, 'a> {
    let at = record.part("REPRESENTATION");
    at.unwrap_or_else(|| record.attributes())
}

/// This program writes an operator that places a part, enlarged, with the reciprocal of its scale, before which it moves
/// the part: `(R x + origin) / scale`.
const INVERSE_SCALE: &[u8] = b"Open CASCADE STEP processor";

/// The header is looked at up to here.
const HEADER: usize = 4096;

/// Whether the header of a file names [`INVERSE_SCALE`].
pub(super) fn has_inverse_scales(bytes: &[u8]) -> bool {
    // Lines may end within a string.
    let header = bytes.iter().take(HEADER).copied();
    let header: Vec<u8> = header.filter(|byte| !byte.is_ascii_control()).collect();
    let mut parts = header.windows(INVERSE_SCALE.len());
    parts.any(|part| part == INVERSE_SCALE)
}

impl Translator<'_> {
    /// Writes a whole file down: pointers to what it shows, also for its own sake, in its units.
    pub(super) fn whole(&mut self, depth: usize) -> (Vec<i64>, Option<Units>) {
        self.greet();
        let structure = Structure::read(self.exchange, |id, problem| self.note(id, problem));
        self.styles = Styles::read(self.exchange, &structure, |id, problem| {
            self.note(id, problem);
        });
        self.assembly = Assembly::new(structure);
        let (mut shown, units) = self.products(depth);
        shown.extend(self.leftovers(shown.is_empty()));
        self.settle_links();
        (shown, units)
    }

    /// Writes down all that a file shows: pointers to it, in the units of the file, if it has them.
    fn products(&mut self, depth: usize) -> (Vec<i64>, Option<Units>) {
        let structure = Rc::clone(&self.assembly.structure);
        let children: HashSet<u64> = structure.occurrences.iter().map(|o| o.child).collect();
        // What items of shapes show is not shown for its own sake.
        let mut mapped = self.mapped_in(&structure.shapes);
        // Nor what is placed in others, unless it is assembled of parts.
        let is_part = |relation: &&Relation| !structure.of_occurrences.contains(&relation.id);
        let placed = structure.inside.values().flatten().filter(is_part);
        let assembled = structure.occurrences.iter();
        let assembled = assembled.flat_map(|part| structure.of(part.parent));
        let assembled: HashSet<u64> = assembled.collect();
        let placed = placed.flat_map(|relation| structure.with_beside(&relation.reps[..1]));
        mapped.extend(placed.filter(|rep| !assembled.contains(rep)));
        let is_mapped =
            |reps: &[u64]| !reps.is_empty() && reps.iter().all(|rep| mapped.contains(rep));
        let (mut shown, mut file) = (Vec::new(), None);
        let mut known = HashSet::new();
        for &product in &structure.products {
            let mut reps = structure.of(product);
            if children.contains(&product) || is_mapped(&reps) {
                continue;
            }
            // Other definitions may have the same shape.
            reps.sort_unstable();
            let is_whole = !self.assembly.by_parent.contains_key(&product);
            if is_whole && !reps.is_empty() && !known.insert(reps) {
                continue;
            }
            if let Some((definition, units)) = self.product(product, depth) {
                shown.push(self.root(definition, units, product, &mut file));
            }
        }
        // What belongs to no product, or to products that are part of each other.
        self.assembly.skips_known = true;
        let inside = structure.inside.values().flatten();
        let inside: HashSet<u64> = inside.map(|relation| relation.reps[0]).collect();
        let mut rest = structure.shapes.clone();
        rest.sort_by_key(|rep| mapped.contains(rep) || inside.contains(rep));
        for rep in rest {
            if self.assembly.seen.contains(&rep) {
                continue;
            }
            let units = self.units_of(rep);
            if let Some(definition) = self.inside(rep, depth) {
                shown.push(self.root(definition, units, rep, &mut file));
            }
        }
        (shown, file)
    }

    /// Shows a definition for its own sake, in the unit of the file, which is that of the first.
    fn root(&mut self, definition: i64, units: Units, id: u64, file: &mut Option<Units>) -> i64 {
        let file = file.get_or_insert(units);
        let scale = units.metres / file.metres;
        let map = scaled(scale);
        self.placed(definition, &map, id, String::new())
    }

    /// The definition of a product with all that it is assembled of, and its units.
    fn product(&mut self, id: u64, depth: usize) -> Option<(i64, Units)> {
        if let Some(known) = self.known.products.get(&id) {
            return *known;
        }
        if depth > self.limits.nesting {
            let text = format!(
                "assemblies are nested more than {} deep",
                self.limits.nesting
            );
            self.fail(id, Problem::Unsupported(text));
            return None;
        }
        if !self.busy.insert(id) {
            self.fail(id, Problem::Invalid("it is a part of itself".to_owned()));
            return None;
        }
        let structure = Rc::clone(&self.assembly.structure);
        let reps = structure.of(id);
        let units = reps.first().map(|&rep| self.units_of(rep));
        let parts = self.assembly.parts_of(id);
        let placed = parts
            .iter()
            .filter(|part| structure.places.contains_key(&part.id));
        let placed = placed.flat_map(|part| structure.of(part.child)).collect();
        let before = std::mem::replace(&mut self.assembly.placed, placed);
        let mut members = self.representations(&reps, depth);
        self.assembly.placed = before;
        let mut units = units;
        let is_placed = |part: &Occurrence| structure.places.contains_key(&part.id);
        let mapped = if parts.iter().all(is_placed) {
            HashSet::new()
        } else {
            self.mapped_in(&reps)
        };
        for part in parts {
            let children = structure.of(part.child);
            if !is_placed(&part) && children.iter().any(|rep| mapped.contains(rep)) {
                continue;
            }
            let product = self.within(part.id, |t| t.product(part.child, depth + 1));
            let Some((child, own)) = product else {
                continue;
            };
            let units = *units.get_or_insert(own);
            let map = self.occurrence(&structure, part, &reps, [own, units]);
            let record = self.exchange.get(part.id);
            let name = record.map_or_else(|_| String::new(), |r| occurrence_name(&r));
            members.push(self.placed(child, &map, part.id, name));
        }
        // Without a shape of its own it may have one in another file.
        if let Some((document, name)) = structure.documents.get(&id)
            && members.is_empty()
            && let Some((definition, own)) = self.external(*document, name, depth + 1)
        {
            let units = *units.get_or_insert(own);
            let map = scaled(own.metres / units.metres);
            members.push(self.placed(definition, &map, id, String::new()));
        }
        self.busy.remove(&id);
        let units = units.filter(|_| !members.is_empty());
        let made = units.map(|units| {
            let name = self.product_name(id);
            (self.definition(members, id, name), units)
        });
        self.known.products.insert(id, made);
        made
    }

    /// What representations with the same axes show, in the units of the first.
    fn representations(&mut self, reps: &[u64], depth: usize) -> Vec<i64> {
        let units = reps.first().map(|&rep| self.units_of(rep));
        let mut members = Vec::new();
        for &rep in reps {
            let own = self.units_of(rep);
            let scale = units.map_or(1.0, |units| own.metres / units.metres);
            let shown = self.representation(rep, depth);
            members.extend(self.scaled_members(shown, scale, rep));
        }
        members
    }

    /// Members in another unit, as one.
    fn scaled_members(&mut self, members: Vec<i64>, scale: f64, id: u64) -> Vec<i64> {
        let map = scaled(scale);
        if members.is_empty() || map == DAffine3::IDENTITY {
            return members;
        }
        let definition = self.definition(members, id, String::new());
        vec![self.placed(definition, &map, id, String::new())]
    }

    /// What a representation shows.
    fn representation(&mut self, rep: u64, depth: usize) -> Vec<i64> {
        if !self.busy.insert(rep) {
            let text = "it is shown inside itself";
            self.fail(rep, Problem::Invalid(text.to_owned()));
            return Vec::new();
        }
        self.assembly.seen.insert(rep);
        let units = self.units_of(rep);
        let before = std::mem::replace(&mut self.units, units);
        // In its place, all of what is shown in another one is shown.
        let skips_known = std::mem::take(&mut self.assembly.skips_known);
        let mut members = Vec::new();
        match self.rep_items(rep) {
            Ok(items) => {
                for item in items {
                    let is_known = || self.is_shown(item);
                    if !(skips_known && is_known() || self.is_placed(item)) {
                        members.extend(self.item(item, depth));
                    }
                }
            }
            Err(problem) => self.fail(rep, problem),
        }
        // Those that are placed in it, and are no occurrences of products.
        let structure = Rc::clone(&self.assembly.structure);
        for relation in structure.inside.get(&rep).into_iter().flatten() {
            let [child, parent] = relation.reps;
            let is_there = skips_known && self.assembly.seen.contains(&child);
            if is_there || structure.of_occurrences.contains(&relation.id) {
                continue;
            }
            let units = [self.units_of(child), units];
            let map = self.relation(*relation, [child, parent], units);
            members.extend(self.shown(child, map, relation.id, String::new(), depth));
        }
        self.busy.remove(&rep);
        self.assembly.skips_known = skips_known;
        self.units = before;
        if self.styles.has_look(rep) {
            let name = self.name_of(rep);
            return self.group(members, rep, name).into_iter().collect();
        }
        members
    }

    /// Shows a representation in another one, where `map` says.
    fn shown(
        &mut self,
        rep: u64,
        map: Result<DAffine3, Problem>,
        id: u64,
        name: String,
        depth: usize,
    ) -> Option<i64> {
        let nesting = self.limits.nesting;
        let problem = match map {
            Ok(_) if depth > nesting => {
                let text = format!("representations are nested more than {nesting} deep");
                Problem::Unsupported(text)
            }
            Ok(map) => {
                let definition = self.within(id, |t| t.inside(rep, depth + 1))?;
                return Some(self.placed(definition, &map, id, name));
            }
            Err(problem) => problem,
        };
        self.fail(id, problem);
        None
    }

    /// The definition of a representation that is shown in others.
    fn inside(&mut self, rep: u64, depth: usize) -> Option<i64> {
        if let Some(known) = self.known.representations.get(&rep) {
            return *known;
        }
        let reps = self.assembly.structure.with_beside(&[rep]);
        let shown = self.representations(&reps, depth);
        let name = self.name_of(rep);
        let made = (!shown.is_empty()).then(|| self.definition(shown, rep, name));
        self.known.representations.insert(rep, made);
        made
    }

    /// The representations that items of some others show.
    fn mapped_in(&self, reps: &[u64]) -> HashSet<u64> {
        let items = reps
            .iter()
            .map(|&rep| self.rep_items(rep).unwrap_or_default());
        items
            .flatten()
            .filter_map(|item| self.shown_by(item))
            .collect()
    }

    /// Whether an item shows a representation that an occurrence shows, too.
    fn is_placed(&self, item: u64) -> bool {
        let (placed, shown) = (&self.assembly.placed, || self.shown_by(item));
        !placed.is_empty() && shown().is_some_and(|rep| placed.contains(&rep))
    }

    /// The representation that an item shows, if it shows one.
    fn shown_by(&self, item: u64) -> Option<u64> {
        let is_mapped = self.exchange.keyword(item).ends_with(b"MAPPED_ITEM");
        let record = self.exchange.get(item).ok().filter(|_| is_mapped)?;
        let source = record.attributes().reference(1).ok()?;
        let source = self.exchange.get(source).ok()?;
        source.attributes().reference(1).ok()
    }

    fn rep_items(&self, rep: u64) -> Result<Vec<u64>, Problem> {
        let record = self.exchange.get(rep)?;
        of_representation(&record).references(1)
    }

    /// The items of a representation, which all instances in an assembly ask for.
    fn listed(&self, rep: u64) -> Rc<HashSet<u64>> {
        let known = self.assembly.lists.borrow().get(&rep).cloned();
        known.unwrap_or_else(|| {
            let items = self.rep_items(rep).unwrap_or_default();
            let list = Rc::new(items.into_iter().collect());
            self.assembly
                .lists
                .borrow_mut()
                .insert(rep, Rc::clone(&list));
            list
        })
    }

    /// The name of a representation.
    fn name_of(&self, rep: u64) -> String {
        let record = self.exchange.get(rep);
        record.map_or_else(
            |_| String::new(),
            |record| of_representation(&record).text(0),
        )
    }

    /// The name of a product, or else its number.
    fn product_name(&self, definition: u64) -> String {
        let product = || -> Result<String, Problem> {
            let formation = self.exchange.get(definition)?.attributes().reference(2)?;
            let product = self.exchange.get(formation)?.attributes().reference(2)?;
            let record = self.exchange.get(product)?;
            let at = record.attributes();
            let [number, name] = [at.text(0), at.text(1)];
            Ok(if name.is_empty() { number } else { name })
        };
        product().unwrap_or_default()
    }

    /// Where an occurrence of a product is in its parent, which has these representations.
    fn occurrence(
        &mut self,
        structure: &Structure,
        part: Occurrence,
        parents: &[u64],
        units: [Units; 2],
    ) -> DAffine3 {
        let places = structure.places.get(&part.id);
        let relation = places.and_then(|list| structure.relations.get(list.first()?));
        let Some(relation) = relation else {
            let text = "its place is not told; it is shown where it is for itself";
            self.tell(part.id, text);
            return scaled(units[0].metres / units[1].metres);
        };
        let children = structure.of(part.child);
        let [first, second] = relation.reps;
        // Some write the parent first.
        let is_turned = !children.contains(&first) && children.contains(&second)
            || parents.contains(&first) && !parents.contains(&second);
        let reps = if is_turned {
            [second, first]
        } else {
            [first, second]
        };
        match self.relation(*relation, reps, units) {
            Ok(map) => map,
            Err(problem) => {
                self.fail(relation.id, problem);
                scaled(units[0].metres / units[1].metres)
            }
        }
    }

    /// The map from a child to its parent, each with its representation and units.
    fn relation(
        &self,
        relation: Relation,
        [child, parent]: [u64; 2],
        [own, other]: [Units; 2],
    ) -> Result<DAffine3, Problem> {
        let scale = scaled(own.metres / other.metres);
        let Some(place) = relation.place else {
            return Ok(scale);
        };
        let record = self.exchange.get(place)?;
        if record.name() != "ITEM_DEFINED_TRANSFORMATION" {
            let mut map = self.geometry().map(place)?;
            if self.has_inverse_scales {
                let scale = map.matrix3.determinant().cbrt();
                map.matrix3 *= (scale * scale).recip();
                map.translation /= scale;
            }
            let is_turned = relation.reps != [child, parent];
            let map = if is_turned { map.inverse() } else { map };
            return checked(map * scale);
        }
        let at = record.attributes();
        let mut items = [at.reference(2)?, at.reference(3)?];
        // The first item is in the first representation, the second in the second.
        if relation.reps != [child, parent] {
            items.swap(0, 1);
        }
        let lists = [child, parent].map(|rep| self.listed(rep));
        let is_in = |rep: usize, item: usize| lists[rep].contains(&items[item]);
        if is_in(0, 1) && is_in(1, 0) && !(is_in(0, 0) && is_in(1, 1)) {
            items.swap(0, 1);
        }
        let [from, to] = [
            self.geometry().map(items[0])?,
            self.geometry().map(items[1])?,
        ];
        checked(to * scale * from.inverse())
    }

    /// A representation that is shown as an item of another one.
    pub(super) fn mapped(
        &mut self,
        id: u64,
        record: &Record<'_>,
        depth: usize,
    ) -> Result<Option<i64>, Problem> {
        let at = record.attributes();
        let source = self.exchange.get(at.reference(1)?)?;
        let of = source.attributes();
        let [origin, rep] = [of.reference(0)?, of.reference(1)?];
        let geometry = self.geometry();
        let [from, to] = [geometry.map(origin)?, geometry.map(at.reference(2)?)?];
        let scale = scaled(self.units_of(rep).metres / self.units.metres);
        let map = checked(to * scale * from.inverse());
        Ok(self.shown(rep, map, id, at.text(0), depth))
    }
}

/// What is made of products while they are gone through.
#[derive(Debug, Default)]
pub(super) struct Assembly {
    structure: Rc<Structure>,
    by_parent: HashMap<u64, Vec<Occurrence>>,
    /// The items of representations.
    lists: RefCell<HashMap<u64, Rc<HashSet<u64>>>>,
    /// Representations that are shown.
    seen: HashSet<u64>,
    /// Those of products that occur in the one that is made: where items show them, they are there
    /// twice.
    placed: HashSet<u64>,
    /// Whether items that are shown already are left out.
    skips_known: bool,
}

impl Assembly {
    fn new(structure: Structure) -> Self {
        let mut by_parent: HashMap<u64, Vec<Occurrence>> = HashMap::new();
        for occurrence in &structure.occurrences {
            let parts = by_parent.entry(occurrence.parent).or_default();
            parts.push(*occurrence);
        }
        Self {
            structure: Rc::new(structure),
            by_parent,
            ..Self::default()
        }
    }

    /// The occurrences in a product.
    fn parts_of(&self, product: u64) -> Vec<Occurrence> {
        self.by_parent.get(&product).cloned().unwrap_or_default()
    }
}

/// The name of an occurrence: its designator, name or number.
fn occurrence_name(record: &Record<'_>) -> String {
    let at = record.attributes();
    let names = [5, 1, 0].map(|place| at.text(place));
    let name = names.into_iter().find(|name| !name.is_empty());
    name.unwrap_or_default()
}

/// The map that makes all larger.
fn scaled(scale: f64) -> DAffine3 {
    if (scale - 1.0).abs() < 1e-12 {
        DAffine3::IDENTITY
    } else {
        DAffine3::from_scale(DVec3::splat(scale))
    }
}

/// A map that can be undone.
fn checked(map: DAffine3) -> Result<DAffine3, Problem> {
    let is_sound = map.is_finite() && map.matrix3.determinant().is_normal();
    let text = "its placement cannot be undone";
    is_sound
        .then_some(map)
        .ok_or_else(|| Problem::Invalid(text.to_owned()))
}
