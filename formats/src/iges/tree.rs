//! The scene: faces, groups and subfigures as a tree, with names, colours and places.
//!
//! Each entity is built once and shared by all that refer to it. What an entity may refer to
//! is collected first, because only entities to which nothing refers stand for themselves.

mod booleans;
mod meshes;
mod pruned;
mod wires;

use std::cell::Cell;
use std::collections::{BTreeSet, HashMap, HashSet};

use glam::{DAffine3, DVec3};
use kernel::{Child, Item, MaterialId, Node, Patch, PatchId, Scene, Shape, UpAxis};

use self::booleans::Booleans;
use self::meshes::Meshes;
use super::blanks;
use super::boundary::{Boundary, Edges};
use super::copies::Copies;
use super::curves::Reader;
use super::directory::File;
use super::entities::{self, Content, Entity};
use super::leftovers;
use super::levels;
use super::links::{Links, cycles, links};
use super::transform::Transforms;
use super::types;
use super::{astray, primitives, trims};
use crate::{Error, Import, Limits, Place, Problem, Warnings};

/// What a patch counts at least, in control points.
const LEAST_COST: usize = 32;

/// Laying curves onto surfaces may take as much work as if a file had so many more cards.
const SPARE_CARDS: usize = 5_000;

/// Places of all arrays of a file together.
const MOST_PLACES: u64 = 1_000_000;

/// Makes the scene of a file.
pub(super) fn read(file: &File<'_>, limits: &Limits, warnings: Warnings) -> Result<Import, Error> {
    let Links { owners, is_part } = links(file);
    file.take_asked();
    let mut tree = Tree::new(file, limits, warnings, is_part);
    tree.repairs(astray::settle(file));
    let (mut children, mut marked) = (Vec::new(), Vec::new());
    for index in blanks::standing(file, &owners) {
        let child = tree.child(index, 0, 0);
        let is_marked = child.is_some() && file.entries[index].dependent;
        marked.extend(is_marked.then_some(index));
        children.extend(child);
    }
    // Of all that is shown it means nothing.
    if marked.len() < children.len() {
        tree.tell_marked(&marked);
    }
    for index in cycles(&owners) {
        let entry = &file.entries[index];
        if entry.blanked || tree.tried[index] {
            continue;
        }
        if types::is_group(entry.kind, entry.form) {
            children.extend(tree.child(index, 0, 0));
        } else {
            tree.fail(index, Problem::Invalid("it contains itself".to_owned()));
            tree.tried[index] = true;
        }
    }
    if let Some(error) = tree.fatal {
        return Err(error);
    }
    tree.prune(&mut children);
    let ledger = leftovers::ledger(file, &tree.refused, &tree.repaired);
    let levels = levels::read(file, tree.shown());
    leftovers::tell(file, &owners, &tree.tried, &mut tree.warnings);
    let has_sheet = !(tree.scene.patches().is_empty() && tree.scene.meshes().is_empty());
    if !has_sheet
        && tree.scene.wires().is_empty()
        && let Some(failure) = tree.failure
    {
        return Err(failure);
    }
    let Tree {
        mut scene,
        mut warnings,
        ..
    } = tree;
    if !has_sheet {
        let text = match scene.wires().len() {
            0 => "there is no surface to show",
            _ => "there is no surface to show, only curves and points",
        };
        warnings.unsupported(Place::default(), text);
    }
    scene.unit.clone_from(&file.global.unit);
    scene.up = UpAxis::Z;
    let scale = file.global.scale;
    scene.resolution = Some(file.global.resolution / scale).filter(|&r| r > 0.0);
    let mut root = Node {
        children,
        ..Node::default()
    };
    if scale.to_bits() != 1.0_f64.to_bits() {
        let text = format!("the model is drawn at the scale {scale} and shown at its real size");
        warnings.invalid(Place::item(0, "the global section"), text);
        root.parent_from_node = DAffine3::from_scale(DVec3::splat(scale.recip()));
    }
    let added = Some(root)
        .filter(|root| !root.children.is_empty())
        .map(|root| scene.add_node(root).and_then(|root| scene.set_root(root)));
    if let Some(Err(problem)) = added {
        return Err(super::error(Place::default(), Problem::Geometry(problem)));
    }
    Ok(Import {
        scene,
        warnings,
        ledger,
        levels,
        ..Import::default()
    })
}

/// A scene that is being made.
struct Tree<'a, 'b> {
    file: &'a File<'b>,
    limits: &'a Limits,
    scene: Scene,
    warnings: Warnings,
    transforms: Transforms,
    edges: Edges,
    materials: HashMap<i64, Option<MaterialId>>,
    /// Patches by surface or face.
    patches: HashMap<usize, Vec<PatchId>>,
    meshes: Meshes,
    booleans: Booleans,
    /// What entities became, by the colour they inherit and, for groups, their scope.
    known: HashMap<(usize, i64, usize), Option<Child>>,
    /// One more than the index of the innermost definition or array that is being built, or 0.
    scope: usize,
    /// Entities that are being built.
    busy: Vec<bool>,
    /// Entities of which all that is wrong has been told.
    tried: Vec<bool>,
    /// Entities that are parts of something.
    is_part: Vec<bool>,
    /// Entities that are members of a group that is built, with its scope.
    grouped: HashSet<(usize, usize)>,
    /// Entities that were repaired, or could not be used.
    repaired: BTreeSet<usize>,
    refused: BTreeSet<usize>,
    points_left: usize,
    /// How much more work laying curves onto surfaces may take.
    laying_left: Cell<usize>,
    /// How many more children may be stored twice for the sake of an inherited colour.
    copies_left: usize,
    /// How many more places arrays may have.
    places_left: u64,
    /// The first surface that could not be read.
    failure: Option<Error>,
    /// A limit that was passed.
    fatal: Option<Error>,
}

impl<'a, 'b> Tree<'a, 'b> {
    fn new(file: &'a File<'b>, limits: &'a Limits, warnings: Warnings, is_part: Vec<bool>) -> Self {
        let count = file.entries.len();
        Self {
            file,
            limits,
            scene: Scene::default(),
            warnings,
            transforms: Transforms::default(),
            edges: Edges::default(),
            materials: HashMap::new(),
            patches: HashMap::new(),
            meshes: Meshes::new(file),
            booleans: Booleans::default(),
            known: HashMap::new(),
            scope: 0,
            busy: vec![false; count],
            tried: vec![false; count],
            is_part,
            grouped: HashSet::new(),
            repaired: BTreeSet::new(),
            refused: BTreeSet::new(),
            points_left: limits.points,
            laying_left: Cell::new(
                limits
                    .laying
                    .saturating_mul(file.card_count() + SPARE_CARDS),
            ),
            copies_left: count.saturating_mul(8),
            places_left: MOST_PLACES,
            failure: None,
            fatal: None,
        }
    }

    /// Tells what is shown though it is marked as part of something.
    fn tell_marked(&mut self, marked: &[usize]) {
        for &index in marked {
            let text = "marked as part of another entity, but none names it; it is shown";
            self.problem(index, Problem::Invalid(text.to_owned()));
        }
    }

    /// What an entity becomes below a node; `inherited` is the colour of its parents.
    fn child(&mut self, index: usize, inherited: i64, depth: usize) -> Option<Child> {
        let entry = &self.file.entries[index];
        // Groups have no colour for their members.
        let is_group = entry.kind == 402;
        let inherited = if entry.color == 0 && !is_group {
            inherited
        } else {
            0
        };
        let scope = if is_group && self.copies_left > 0 {
            self.scope
        } else {
            0
        };
        if let Some(known) = self.known.get(&(index, inherited, scope)) {
            return *known;
        }
        if self.fatal.is_some() {
            return None;
        }
        self.tried[index] = true;
        if self.busy[index] {
            self.problem(index, Problem::Invalid("it contains itself".to_owned()));
            return None;
        }
        if depth > self.limits.nesting {
            let text = format!("nested more than {} deep", self.limits.nesting);
            self.problem(index, Problem::TooLarge(text));
            return None;
        }
        self.busy[index] = true;
        let outer = self.scope;
        self.scope = match entry.kind {
            402 => scope,
            308 | 320 | 408 | 412 | 414 | 420 => index + 1,
            _ => outer,
        };
        let child = if self.has_exact(index, depth) {
            Ok(None)
        } else {
            self.build(index, inherited, depth)
        };
        let child = child.unwrap_or_else(|problem| {
            self.fail(index, problem);
            None
        });
        self.scope = outer;
        self.busy[index] = false;
        self.note_solid(index, child);
        self.known.insert((index, inherited, scope), child);
        child
    }

    fn build(
        &mut self,
        index: usize,
        inherited: i64,
        depth: usize,
    ) -> Result<Option<Child>, Problem> {
        let file = self.file;
        let entry = &file.entries[index];
        let Some(entity) = entities::read(file, index)? else {
            self.tried[index] = false;
            return Ok(None);
        };
        let mut place = match &entity.content {
            // Those of surfaces and curves are in their numbers.
            Content::Surface | Content::Curve => DAffine3::IDENTITY,
            _ => self.transforms.follow(file, entry.transform)?,
        };
        let color = if entry.color == 0 {
            inherited
        } else {
            entry.color
        };
        let own = Some(&entity.name).filter(|name| !name.is_empty());
        let mut node = Node {
            name: own.unwrap_or(&entry.label).clone(),
            ..Node::default()
        };
        match &entity.content {
            Content::Surface => {
                node.children = self.items([index; 2], &entity, &Boundary::Natural, inherited)?;
            }
            Content::Face { surface, boundary } => {
                let base = self.file.follow(*surface, "the surface")?;
                self.tried[base] = true;
                if let Boundary::Loops(loops) = boundary {
                    for hole in loops.iter().filter_map(|&pointer| file.find(pointer)) {
                        self.tried[hole] = true;
                    }
                }
                node.children = self.items([index, base], &entity, boundary, inherited)?;
            }
            Content::Mesh => node.children.push(self.mesh(index, inherited)?),
            Content::Curve | Content::Points(_) => self.wire(index, &entity, color, &mut node)?,
            Content::Members(members) => {
                node.children = self.members(index, members, color, depth);
            }
            Content::Terms(terms) => self.combined(index, terms, color, depth, &mut node)?,
            Content::Solid(shell, voids) => {
                let shell = self.members(index, &[*shell], color, depth);
                let voids = self.members(index, voids, color, depth);
                node.voids = Some(voids.len());
                node.children = [shell, voids].concat();
            }
            Content::Placed(members) => {
                for &(member, matrix) in members {
                    let child = self.member(index, member, color, depth);
                    let parent_from_node = self.transforms.follow(file, matrix)?;
                    node.children.extend(self.placed(parent_from_node, child)?);
                }
            }
            Content::Copies(copies) => {
                if copies.count() > 1 {
                    self.take_places(copies.count())?;
                }
                let member = self.member(index, copies.base, color, depth);
                let mut places = copies.places();
                if copies.count() > 1 {
                    node.children = self.copies(copies, member)?;
                } else if let Some(only) = places.next() {
                    place *= only;
                    node.children.extend(member);
                }
            }
        }
        match node.children.as_slice() {
            [] if node.wires.is_empty() => return Ok(None),
            [one] if entity.content.is_leaf() && place == DAffine3::IDENTITY => {
                return Ok(Some(*one));
            }
            _ => {}
        }
        node.parent_from_node = place;
        let node = self.scene.add_node(node).map_err(Problem::Geometry)?;
        Ok(Some(Child::Node(node)))
    }

    /// Counts the places of an array.
    fn take_places(&mut self, count: u64) -> Result<(), Problem> {
        self.places_left = self.places_left.checked_sub(count).ok_or_else(|| {
            let text = format!("the arrays have more than {MOST_PLACES} places");
            Problem::Unsupported(text)
        })?;
        Ok(())
    }

    /// A node for every place of an array.
    fn copies(&mut self, copies: &Copies, member: Option<Child>) -> Result<Vec<Child>, Problem> {
        let mut nodes = Vec::new();
        for place in copies.places() {
            nodes.extend(self.placed(place, member)?);
        }
        Ok(nodes)
    }

    /// A node that shows a child in a place.
    fn placed(&mut self, place: DAffine3, child: Option<Child>) -> Result<Option<Child>, Problem> {
        let Some(child) = child.filter(|_| place != DAffine3::IDENTITY) else {
            return Ok(child);
        };
        let node = Node {
            parent_from_node: place,
            children: vec![child],
            ..Node::default()
        };
        let node = self.scene.add_node(node).map_err(Problem::Geometry)?;
        Ok(Some(Child::Node(node)))
    }

    fn members(&mut self, parent: usize, all: &[i64], color: i64, depth: usize) -> Vec<Child> {
        let child = |&pointer| self.member(parent, pointer, color, depth);
        all.iter().filter_map(child).collect()
    }

    /// A member of a group, definition or shell.
    fn member(&mut self, parent: usize, pointer: i64, color: i64, depth: usize) -> Option<Child> {
        let index = match self.file.follow(pointer, "a member") {
            Ok(index) => index,
            Err(problem) => {
                self.problem(parent, problem);
                return None;
            }
        };
        let (entry, parent) = (&self.file.entries[index], &self.file.entries[parent]);
        if !blanks::shows_member(parent, entry) {
            return None;
        }
        // A member of several groups is shown once where they are placed together, and what is part of
        // a body is shown with that.
        let is_grouped = parent.kind == 402;
        if is_grouped && (self.is_part[index] || !self.grouped.insert((index, self.scope))) {
            return None;
        }
        if is_grouped && self.scope > 0 {
            self.copies_left = self.copies_left.saturating_sub(1);
        }
        self.inheriting(index, if is_grouped { 0 } else { color }, depth + 1)
    }

    /// What an entity becomes below a node with a colour, which it inherits unless that costs too much.
    fn inheriting(&mut self, index: usize, mut color: i64, depth: usize) -> Option<Child> {
        if color != 0 {
            match self.copies_left.checked_sub(1) {
                Some(left) => self.copies_left = left,
                None => color = 0,
            }
        }
        self.child(index, color, depth)
    }

    /// Reads curves or surfaces, and gives what was repaired with it.
    fn reading<T>(
        &mut self,
        read: impl FnOnce(&mut Reader<'_, '_>, &mut Edges) -> T,
    ) -> (T, Vec<(usize, Problem)>) {
        let mut reader = Reader {
            file: self.file,
            transforms: &mut self.transforms,
            repairs: Vec::new(),
            bases: Vec::new(),
            limit: self.points_left,
            laying: &self.laying_left,
        };
        let result = read(&mut reader, &mut self.edges);
        for base in reader.bases {
            self.tried[base] = true;
        }
        (result, reader.repairs)
    }

    /// Notes what was repaired.
    fn repairs(&mut self, repairs: Vec<(usize, Problem)>) {
        for (index, problem) in repairs {
            self.repaired.insert(index);
            self.problem(index, problem);
        }
    }

    /// The entities that became a shape.
    fn shown(&self) -> impl Iterator<Item = usize> {
        let built = self.known.iter().filter(|(_, child)| child.is_some());
        let indices: BTreeSet<usize> = built.map(|((index, ..), _)| *index).collect();
        let is_shape = |index: &usize| !types::is_composed(self.file.entries[*index].kind);
        indices.into_iter().filter(is_shape)
    }

    /// The patches of a surface or face; `base` is the entity with the surface.
    fn patches(
        &mut self,
        index: usize,
        base: usize,
        entity: &Entity,
        boundary: &Boundary,
    ) -> Result<Vec<PatchId>, Problem> {
        if let Some(patches) = self.patches.get(&index) {
            return Ok(patches.clone());
        }
        let file = self.file;
        let (read, repairs) = self.reading(|reader, edges| {
            if primitives::is_primitive(file.entries[base].kind) {
                return primitives::read(reader, base);
            }
            let sheet = trims::side::sheet(reader, edges, [index, base], boundary)?;
            let name = sheet.name.clone();
            Ok::<_, Problem>((name, trims::faces(reader, edges, index, sheet, boundary)?))
        });
        self.repairs(repairs);
        let (base_name, parts) = read?;
        let labels = [index, base].map(|index| &file.entries[index].label);
        let name = [&entity.name, &base_name]
            .into_iter()
            .chain(labels)
            .find(|name| !name.is_empty())
            .cloned()
            .unwrap_or_default();
        let color = match file.entries[index].color {
            0 => file.entries[base].color,
            color => color,
        };
        let material = self.material(index, color);
        let mut patches = Vec::new();
        for (surface, loops) in parts {
            // A patch is more than its points.
            self.spend(surface.homogeneous().len().max(LEAST_COST))?;
            let patch = Patch {
                name: name.clone(),
                source: file.source(index),
                loops,
                material,
                ..Patch::from(surface)
            };
            patches.push(self.scene.add_patch(patch).map_err(Problem::Geometry)?);
        }
        self.patches.insert(index, patches.clone());
        Ok(patches)
    }

    /// Counts control points.
    fn spend(&mut self, count: usize) -> Result<(), Problem> {
        self.points_left = self.points_left.checked_sub(count).ok_or_else(|| {
            let text = format!("more than {} control points", self.limits.points);
            Problem::TooLarge(text)
        })?;
        Ok(())
    }

    /// Items that show the patches of a surface or face, as [`Tree::patches`] makes them; the inherited colour
    /// counts where a patch has none.
    fn items(
        &mut self,
        [index, base]: [usize; 2],
        entity: &Entity,
        boundary: &Boundary,
        inherited: i64,
    ) -> Result<Vec<Child>, Problem> {
        let patches = self.patches(index, base, entity, boundary)?;
        let inherited = self.material(index, inherited);
        let item = |&id: &PatchId| {
            let own = self.scene.patch(id).material;
            Child::Item(Item {
                shape: Shape::Patch(id),
                material: inherited.filter(|_| own.is_none()),
            })
        };
        Ok(patches.iter().map(item).collect())
    }

    /// The material of a colour number or a pointer to a colour; zero is no colour. `index`
    /// is the entity that has it.
    fn material(&mut self, index: usize, color: i64) -> Option<MaterialId> {
        if let Some(known) = self.materials.get(&color) {
            return *known;
        }
        let material = match entities::material(self.file, color) {
            Ok(material) => material.map(|material| self.scene.add_material(material)),
            Err(problem) => {
                self.problem(index, problem);
                None
            }
        };
        self.materials.insert(color, material);
        material
    }

    fn problem(&mut self, index: usize, problem: Problem) {
        self.warnings.add(self.file.place(index), problem);
    }

    /// Notes that an entity cannot be shown.
    fn fail(&mut self, index: usize, problem: Problem) {
        let error = super::error(self.file.place(index), problem.clone());
        self.refused.insert(index);
        if let Problem::TooLarge(_) = problem {
            self.fatal.get_or_insert(error);
            return;
        }
        self.failure.get_or_insert(error);
        self.problem(index, problem);
    }
}
