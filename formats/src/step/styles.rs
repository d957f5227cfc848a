//! Colours, and what is hidden.

use std::collections::{BTreeMap, HashMap, HashSet};

use super::overrides::Overrides;
use super::part21::Exchange;
use super::structure::Structure;
use super::values::{Attributes, Record, Value};
use crate::Problem;

/// How deep styles refer to others.
const NESTING: usize = 12;

/// How many instances one style may lead through.
const MOST: usize = 200;

/// The colours with names.
const NAMED: [(&str, [f64; 3]); 8] = [
    ("black", [0.0, 0.0, 0.0]),
    ("red", [1.0, 0.0, 0.0]),
    ("green", [0.0, 1.0, 0.0]),
    ("yellow", [1.0, 1.0, 0.0]),
    ("blue", [0.0, 0.0, 1.0]),
    ("magenta", [1.0, 0.0, 1.0]),
    ("cyan", [0.0, 1.0, 1.0]),
    ("white", [1.0, 1.0, 1.0]),
];

/// A colour in sRGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Style {
    /// The instance that it comes from.
    pub color: u64,
    pub srgb: [f64; 3],
    pub opacity: f64,
}

/// A colour as a key: the bits of its numbers.
pub(super) type Key = [u64; 4];

impl Style {
    /// What tells it from others.
    pub(super) fn key(&self) -> Key {
        let [red, green, blue] = self.srgb;
        [red, green, blue, self.opacity].map(f64::to_bits)
    }
}

/// How instances look.
#[derive(Debug, Default)]
pub(super) struct Styles {
    /// Of surfaces, and what is made of them.
    surfaces: HashMap<u64, Style>,
    /// Of curves.
    curves: HashMap<u64, Style>,
    /// Those that are hidden.
    hidden: HashSet<u64>,
    /// What looks differently in some places.
    pub overrides: Overrides,
    /// Pointers to colours.
    pub known: HashMap<Key, i64>,
}

impl Styles {
    /// Collects those of a file. What is not readable says nothing of how things look, and is told by
    /// `problem`.
    pub(super) fn read(
        exchange: &Exchange<'_>,
        structure: &Structure,
        mut problem: impl FnMut(u64, Problem),
    ) -> Self {
        let mut styles = Self::default();
        let mut over = Vec::new();
        for id in exchange.ids() {
            let keyword = exchange.keyword(id);
            let is_over = keyword.eq_ignore_ascii_case(b"OVER_RIDING_STYLED_ITEM")
                || keyword.eq_ignore_ascii_case(b"CONTEXT_DEPENDENT_OVER_RIDING_STYLED_ITEM");
            if is_over || keyword.eq_ignore_ascii_case(b"STYLED_ITEM") {
                match styled(exchange, structure, id) {
                    Ok(found) if is_over => over.extend(found),
                    Ok(found) => found.iter().for_each(|found| styles.insert(found)),
                    Err(found) => problem(id, found),
                }
            } else if keyword.eq_ignore_ascii_case(b"INVISIBILITY") {
                match styles.hide(exchange, structure, id) {
                    Ok(()) => {}
                    Err(found) => problem(id, found),
                }
            }
        }
        over.iter().for_each(|found| styles.insert(found));
        styles
    }

    fn insert(&mut self, found: &Styled) {
        let Some(item) = found.item else {
            return;
        };
        if !found.places.is_empty() {
            self.overrides.add(found, false);
            return;
        }
        self.surfaces
            .extend(found.surface.map(|style| (item, style)));
        self.curves.extend(found.curve.map(|style| (item, style)));
    }

    /// The colour of the surfaces of an instance, if it has one of its own.
    pub(super) fn of_surfaces(&self, id: u64) -> Option<Style> {
        let here = self.overrides.of_surfaces(id);
        here.or_else(|| self.surfaces.get(&id).copied())
    }

    /// Whether an instance is hidden.
    pub(super) fn is_hidden(&self, id: u64) -> bool {
        self.hidden.contains(&id) || self.overrides.is_hidden(id)
    }

    /// Whether an instance has a colour of its own, or is hidden.
    pub(super) fn has_look(&self, id: u64) -> bool {
        self.of_surfaces(id).is_some() || self.is_hidden(id)
    }

    /// The colour of a curve, if it has one of its own.
    pub(super) fn of_curve(&self, id: u64) -> Option<Style> {
        let here = self.overrides.of_curve(id);
        here.or_else(|| self.curves.get(&id).copied())
    }

    /// Hides what an instance says.
    fn hide(
        &mut self,
        exchange: &Exchange<'_>,
        structure: &Structure,
        id: u64,
    ) -> Result<(), Problem> {
        let record = exchange.get(id)?;
        for item in record.attributes().references(0)? {
            let record = exchange.get(item)?;
            let at = record.attributes();
            match record.name() {
                name if name.ends_with("STYLED_ITEM") => {
                    for found in styled(exchange, structure, item)? {
                        if found.places.is_empty() {
                            self.hidden.extend(found.item);
                        } else {
                            self.overrides.add(&found, true);
                        }
                    }
                }
                "PRESENTATION_LAYER_ASSIGNMENT" => {
                    for item in at.references(2)? {
                        let record = exchange.get(item)?;
                        let is_styled = record.name().ends_with("STYLED_ITEM");
                        let item = match is_styled.then(|| record.attributes().reference(2)) {
                            Some(of) => of?,
                            None => item,
                        };
                        self.hidden.insert(item);
                    }
                }
                _ => {
                    self.hidden.insert(item);
                }
            }
        }
        Ok(())
    }
}

/// An item with its colours.
#[derive(Clone, Debug)]
pub(super) struct Styled {
    pub item: Option<u64>,
    pub surface: Option<Style>,
    pub curve: Option<Style>,
    /// It has them only where it is inside of all of these; none for everywhere.
    pub places: Vec<u64>,
}

/// The item of a styled item, and its colours, for each of the places that its styles are for.
fn styled(exchange: &Exchange<'_>, structure: &Structure, id: u64) -> Result<Vec<Styled>, Problem> {
    let record = exchange.get(id)?;
    let at = record.attributes();
    let mut item = at.reference(2).ok();
    let mut common = Vec::new();
    if record.name() == "CONTEXT_DEPENDENT_OVER_RIDING_STYLED_ITEM" {
        for context in at.references(4)? {
            common.extend(structure.places_of(context));
        }
    }
    // The look of something else where an item shows it.
    if record.name().contains("OVER_RIDING")
        && let Some(shown) = item
        && exchange.keyword(shown).ends_with(b"MAPPED_ITEM")
    {
        let of = exchange
            .get(at.reference(3)?)?
            .attributes()
            .reference(2)
            .ok();
        if of.is_some() && of != item {
            item = of;
            common.push(shown);
        }
    }
    let mut searches = BTreeMap::new();
    for style in at.references(1)? {
        let mut places = common.clone();
        let record = exchange.get(style)?;
        if record.name() == "PRESENTATION_STYLE_BY_CONTEXT" {
            let context = record.attributes().reference(1);
            places.extend(context.map_or(Vec::new(), |context| structure.places_of(context)));
        }
        places.sort_unstable();
        places.dedup();
        let search = searches
            .entry(places)
            .or_insert_with(|| Search::new(exchange));
        search.follow(style, 0)?;
    }
    let all = searches.into_iter().map(|(places, search)| {
        let opacity = search.opacity;
        let [surface, curve] = search.colors.map(|found| {
            let style = |(color, srgb)| Style {
                color,
                srgb,
                opacity,
            };
            found.map(style)
        });
        Styled {
            item,
            surface,
            curve,
            places,
        }
    });
    Ok(all.collect())
}

/// A search for the colour of a style.
struct Search<'e, 'a> {
    exchange: &'e Exchange<'a>,
    left: usize,
    /// Whether we are in a style of curves.
    is_curve: bool,
    /// Of surfaces and of curves.
    colors: [Option<(u64, [f64; 3])>; 2],
    opacity: f64,
}

impl<'e, 'a> Search<'e, 'a> {
    fn new(exchange: &'e Exchange<'a>) -> Self {
        Self {
            exchange,
            left: MOST,
            is_curve: false,
            colors: [None; 2],
            opacity: 1.0,
        }
    }

    /// Goes through what an instance refers to; the first colour counts, those of points do not.
    fn follow(&mut self, id: u64, depth: usize) -> Result<(), Problem> {
        if depth > NESTING || self.left == 0 {
            return Ok(());
        }
        self.left -= 1;
        let record = self.exchange.get(id)?;
        let at = record.attributes();
        match record.name() {
            "COLOUR_RGB" => {
                let srgb = [at.number(1)?, at.number(2)?, at.number(3)?];
                self.colors[usize::from(self.is_curve)].get_or_insert((id, srgb));
            }
            "DRAUGHTING_PRE_DEFINED_COLOUR" | "PRE_DEFINED_COLOUR" => {
                let name = at.text(0).to_lowercase();
                let known = NAMED.iter().find(|(known, _)| *known == name);
                if let Some((_, srgb)) = known {
                    self.colors[usize::from(self.is_curve)].get_or_insert((id, *srgb));
                }
            }
            "SURFACE_STYLE_TRANSPARENT" => self.opacity = 1.0 - at.number(0)?.clamp(0.0, 1.0),
            "POINT_STYLE" | "SURFACE_STYLE_BOUNDARY" | "SURFACE_STYLE_PARAMETER_LINE" => {}
            name => {
                let before = self.is_curve;
                self.is_curve |= name.starts_with("CURVE_STYLE");
                if STYLES.iter().any(|style| name.starts_with(style)) {
                    for id in referred(&record, at) {
                        self.follow(id, depth + 1)?;
                    }
                }
                self.is_curve = before;
            }
        }
        Ok(())
    }
}

/// How the types begin that lead to colours.
const STYLES: [&str; 8] = [
    "PRESENTATION_STYLE",
    "SURFACE_STYLE",
    "SURFACE_SIDE_STYLE",
    "FILL_AREA_STYLE",
    "CURVE_STYLE",
    "COLOUR",
    "PRE_DEFINED",
    "DRAUGHTING",
];

/// What a record refers to, in order.
fn referred(record: &Record<'_>, at: Attributes<'_, '_>) -> Vec<u64> {
    let mut found = Vec::new();
    // By context, another one follows that says nothing.
    let values = if record.name() == "PRESENTATION_STYLE_BY_CONTEXT" {
        &at.0[..at.0.len().min(1)]
    } else {
        at.0
    };
    for value in values {
        match value {
            Value::Reference(id) => found.push(*id),
            Value::List(list) => found.extend(list.iter().filter_map(Value::reference)),
            _ => {}
        }
    }
    found
}
