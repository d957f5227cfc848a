//! Which products and representations there are, and how they hang together.

use std::collections::{BTreeMap, HashMap, HashSet};

use super::part21::Exchange;
use super::values::Record;
use crate::Problem;

/// A representation that is placed in another one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Relation {
    pub id: u64,
    /// What is placed, and in what.
    pub reps: [u64; 2],
    /// The instance that says where; `None` where both have the same axes.
    pub place: Option<u64>,
}

/// An occurrence of a product in another one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Occurrence {
    pub id: u64,
    pub parent: u64,
    pub child: u64,
}

/// Which products and representations there are, and how they hang together.
#[derive(Debug, Default)]
pub(super) struct Structure {
    /// The representations of products.
    reps: HashMap<u64, Vec<u64>>,
    /// All representations of shapes, in order.
    pub shapes: Vec<u64>,
    /// All products, in order.
    pub products: Vec<u64>,
    pub relations: HashMap<u64, Relation>,
    pub occurrences: Vec<Occurrence>,
    /// The relations that place occurrences.
    pub places: HashMap<u64, Vec<u64>>,
    /// Representations with the axes of another one.
    beside: HashMap<u64, Vec<u64>>,
    /// The relations that place others in a representation.
    pub inside: HashMap<u64, Vec<Relation>>,
    /// The relations that place occurrences.
    pub of_occurrences: HashSet<u64>,
    /// The documents of products, each with the name of a file.
    pub documents: HashMap<u64, (u64, String)>,
    /// What stands for an occurrence: its shape, representations and relations.
    of_occurrence: HashMap<u64, u64>,
    /// Occurrences in occurrences of what they occur in: that, and the occurrence in it.
    paths: BTreeMap<u64, [u64; 2]>,
    /// Items that show representations.
    mapped: HashSet<u64>,
}

/// How deep occurrences in occurrences may be.
const DEEPEST: usize = 64;

/// What instances refer to, while they are collected.
#[derive(Debug, Default)]
struct Links {
    /// What shapes define.
    defined: HashMap<u64, u64>,
    /// The representations of shapes.
    shown: Vec<(u64, u64)>,
    /// The relations of shapes, each with the instance that says so.
    placed: Vec<(u64, u64, u64)>,
    /// The names of documents.
    names: HashMap<u64, String>,
    /// The documents of products.
    documents: Vec<(u64, Vec<u64>)>,
}

impl Structure {
    /// Collects what a file says; what is not readable is told by `problem`.
    pub(super) fn read(exchange: &Exchange<'_>, mut problem: impl FnMut(u64, Problem)) -> Self {
        let (mut structure, mut links) = (Self::default(), Links::default());
        for id in exchange.ids() {
            let keyword = exchange.keyword(id).to_ascii_uppercase();
            if keyword.ends_with(b"MAPPED_ITEM") {
                structure.mapped.insert(id);
            }
            let wanted = keyword.starts_with(b"PRODUCT_DEFINITION")
                || keyword.ends_with(b"REPRESENTATION")
                || keyword.ends_with(b"REPRESENTATION_WITH_ACCURACY_PARAMETERS")
                || keyword.ends_with(b"REPRESENTATION_RELATIONSHIP")
                || keyword.ends_with(b"_USAGE_OCCURRENCE")
                || keyword == b"DOCUMENT_FILE"
                || keyword == b"APPLIED_DOCUMENT_REFERENCE"
                || keyword == b"APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT";
            if !wanted {
                continue;
            }
            let taken = exchange
                .get(id)
                .and_then(|r| structure.take(&r, &mut links));
            if let Err(found) = taken {
                problem(id, found);
            }
        }
        structure.settle(links);
        for &id in structure.paths.keys() {
            if structure.places.contains_key(&id) {
                let text = "the place that parts have in one instance of an assembly only is not read; \
                            they have that of all";
                problem(id, Problem::Unsupported(text.to_owned()));
            }
        }
        structure
    }

    /// Takes in an instance.
    fn take(&mut self, record: &Record<'_>, links: &mut Links) -> Result<(), Problem> {
        let (id, at) = (record.id, record.attributes());
        match record.name() {
            "PRODUCT_DEFINITION" => self.products.push(id),
            "PRODUCT_DEFINITION_WITH_ASSOCIATED_DOCUMENTS" => {
                self.products.push(id);
                links.documents.push((id, at.references(4)?));
            }
            "PRODUCT_DEFINITION_SHAPE" => {
                links.defined.insert(id, at.reference(2)?);
            }
            "SHAPE_DEFINITION_REPRESENTATION" => {
                links.shown.push((at.reference(0)?, at.reference(1)?));
            }
            "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION" => {
                links.placed.push((at.reference(1)?, at.reference(0)?, id));
            }
            "DOCUMENT_FILE" => {
                links.names.entry(id).or_insert_with(|| at.text(0));
            }
            "APPLIED_DOCUMENT_REFERENCE" => {
                let document = vec![at.reference(0)?];
                let products = at.references(2)?.into_iter();
                links
                    .documents
                    .extend(products.map(|id| (id, document.clone())));
            }
            "APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT" => {
                for document in at.references(3)? {
                    links.names.insert(document, at.text(0));
                }
            }
            "SPECIFIED_HIGHER_USAGE_OCCURRENCE" => {
                self.paths.insert(id, [at.reference(6)?, at.reference(7)?]);
            }
            name if name.ends_with("_USAGE_OCCURRENCE") => {
                self.occurrences.push(Occurrence {
                    id,
                    parent: at.reference(3)?,
                    child: at.reference(4)?,
                });
            }
            _ => self.relate(record)?,
        }
        Ok(())
    }

    /// Follows what instances refer to, once all are known.
    fn settle(&mut self, links: Links) {
        let occurrences = self.occurrences.iter().map(|occurrence| occurrence.id);
        let occurrences: HashSet<u64> = occurrences.chain(self.paths.keys().copied()).collect();
        self.of_occurrence = occurrences.iter().map(|&id| (id, id)).collect();
        let mut stands = |id: u64, of: u64| {
            if occurrences.contains(&of) {
                self.of_occurrence.insert(id, of);
            }
        };
        for (&id, &of) in &links.defined {
            stands(id, of);
        }
        for (definition, rep) in links.shown {
            if let Some(of) = links.defined.get(&definition) {
                stands(rep, *of);
                self.reps.entry(*of).or_default().push(rep);
            }
        }
        for (definition, relation, id) in links.placed {
            if let Some(of) = links.defined.get(&definition) {
                stands(relation, *of);
                stands(id, *of);
                self.places.entry(*of).or_default().push(relation);
            }
            self.of_occurrences.insert(relation);
        }
        for (product, documents) in links.documents {
            let named = |id: u64| Some((id, links.names.get(&id)?.clone()));
            let first = documents.into_iter().find_map(named);
            self.documents.extend(first.map(|first| (product, first)));
        }
        self.connect();
    }

    /// Takes in a relation of two representations, or a representation of a shape.
    fn relate(&mut self, record: &Record<'_>) -> Result<(), Problem> {
        let parts: Vec<&str> = record.parts.iter().map(|part| part.0.as_str()).collect();
        let is_relation = |name: &&str| name.ends_with("REPRESENTATION_RELATIONSHIP");
        if parts.iter().any(is_relation) {
            let at = record.part("REPRESENTATION_RELATIONSHIP");
            let at = at.unwrap_or_else(|| record.attributes());
            let place = record.part("REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION");
            let place = place.map(|at| at.reference(at.0.len().saturating_sub(1)));
            let relation = Relation {
                id: record.id,
                reps: [at.reference(2)?, at.reference(3)?],
                place: place.transpose()?,
            };
            self.relations.insert(record.id, relation);
        } else if parts.iter().any(|name| {
            let name = name.trim_end_matches("_WITH_ACCURACY_PARAMETERS");
            name.ends_with("SHAPE_REPRESENTATION")
        }) {
            self.shapes.push(record.id);
        }
        Ok(())
    }

    /// Notes which representations have the same axes as others.
    fn connect(&mut self) {
        let mut relations: Vec<_> = self.relations.values().copied().collect();
        relations.sort_by_key(|relation| relation.id);
        let of_products: HashSet<u64> = self.reps.values().flatten().copied().collect();
        for relation in relations {
            let [a, b] = relation.reps;
            if relation.place.is_some() {
                self.inside.entry(b).or_default().push(relation);
                continue;
            }
            for (own, other) in [(a, b), (b, a)] {
                if !of_products.contains(&other) {
                    self.beside.entry(own).or_default().push(other);
                }
            }
        }
    }

    /// The occurrences and items that the context of a style stands for, all of which something is in
    /// that has the style there; none if it stands for no place.
    pub(super) fn places_of(&self, context: u64) -> Vec<u64> {
        let mut places = Vec::new();
        let mut rest = vec![context];
        // Those that are part of themselves have no end.
        while let Some(id) = rest.pop().filter(|_| places.len() < DEEPEST) {
            let of = self.of_occurrence.get(&id).copied().unwrap_or(id);
            if let Some(path) = self.paths.get(&of) {
                rest.extend(path);
                if rest.len() > DEEPEST {
                    return places;
                }
            } else if self.of_occurrence.contains_key(&id) || self.is_shown_by(id) {
                places.push(of);
            }
        }
        places
    }

    /// Whether an instance shows a representation: an item, or a relation that is of no occurrence.
    fn is_shown_by(&self, id: u64) -> bool {
        let relation = self.relations.get(&id);
        self.mapped.contains(&id) || relation.is_some_and(|relation| relation.place.is_some())
    }

    /// Representations with the same axes as those of a product, these among them.
    pub(super) fn of(&self, product: u64) -> Vec<u64> {
        let own = self.reps.get(&product);
        self.with_beside(own.map_or(&[], Vec::as_slice))
    }

    /// Representations, each once, with all that have the same axes as they.
    pub(super) fn with_beside(&self, reps: &[u64]) -> Vec<u64> {
        let mut all = reps.to_vec();
        let mut seen = HashSet::new();
        all.retain(|&rep| seen.insert(rep));
        let mut at = 0;
        while let Some(rep) = all.get(at) {
            at += 1;
            let beside = self.beside.get(rep).map_or(&[][..], Vec::as_slice);
            all.extend(beside.iter().copied().filter(|&other| seen.insert(other)));
        }
        all
    }
}
