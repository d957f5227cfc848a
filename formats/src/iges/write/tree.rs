//! The tree of nodes as groups, subfigures and their instances.

mod solid;

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

use glam::{DAffine3, DMat3, DVec3};
use kernel::{
    Child, Item, Material, MaterialId, Node, NodeId, Patch, Scene, Shape, srgb_from_linear,
};

use super::cards::{Deck, Entity, Record, Status};
use super::geometry;
use crate::write::{NESTING, Uses, outermost, tell_lost};
use crate::{Place, Problem, Warnings};

/// Matrices that differ from a turned and scaled frame by no more are taken for one.
const RIGID: f64 = 1e-12;

/// Faces that no more bodies share are written for each of them.
const FEW: usize = 8;

/// Bits of a matrix, to look it up by.
type Bits = [u64; 9];

/// A scene that is being written.
#[derive(Debug)]
pub(super) struct Tree<'a> {
    scene: &'a Scene,
    pub(super) deck: Deck,
    pub(super) warnings: Warnings,
    /// How often nodes are children, and patches are shown.
    uses: Uses,
    /// For every node whether it or one below shows a shape or a wire.
    shows: Vec<bool>,
    colors: HashMap<(MaterialId, bool), usize>,
    /// Definitions by what they show, how it is distorted, and its material.
    definitions: HashMap<(Defined, Bits), Option<usize>>,
    transforms: HashMap<[u64; 12], usize>,
    /// How deep definitions nest below an entity.
    depths: HashMap<usize, usize>,
    /// Solids that cannot be written as such.
    refused: HashSet<NodeId>,
}

/// What a definition shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Defined {
    Node(NodeId),
    Item(Shape, Option<MaterialId>),
}

/// For every node whether it or one below shows a shape or a wire; children stand before their
/// parents.
fn shows(scene: &Scene) -> Vec<bool> {
    let mut shows = Vec::new();
    for node in scene.nodes() {
        let any = !node.wires.is_empty()
            || node.children.iter().any(|child| match child {
                Child::Item(_) => true,
                Child::Node(id) => shows[id.index()],
            });
        shows.push(any);
    }
    shows
}

impl<'a> Tree<'a> {
    pub(super) fn new(scene: &'a Scene) -> Self {
        Self {
            scene,
            deck: Deck::default(),
            warnings: Warnings::default(),
            uses: Uses::of(scene),
            shows: shows(scene),
            colors: HashMap::new(),
            definitions: HashMap::new(),
            transforms: HashMap::new(),
            depths: HashMap::new(),
            refused: HashSet::new(),
        }
    }

    /// Adds all that is shown; `world` takes the scene to the coordinates of the file.
    pub(super) fn add_all(&mut self, world: DMat3) -> Result<(), Problem> {
        let (scene, status) = (self.scene, Status::Independent);
        let (node, id, place) = loop {
            let found = outermost(scene, world, |id| self.is_solid(id));
            let Some((node, id, place)) = found else {
                return Ok(());
            };
            if !self.is_solid(id) || place != DAffine3::IDENTITY {
                break (node, id, place);
            }
            // What cannot be written as a solid counts as none from then on.
            if self.solid(id, DMat3::IDENTITY, status)?.is_some() {
                return Ok(());
            }
        };
        if node.name.is_empty() && !self.is_solid(id) && place == DAffine3::IDENTITY {
            self.members(node, &node.children, place.matrix3, status, 0)?;
        } else {
            self.node(id, place, status, 0)?;
        }
        Ok(())
    }

    /// Pointers to what shows these children of a node, and its wires. `outer` is what the nodes above
    /// leave to be done: instances turn, scale and move, and all else is done to the control points.
    fn members(
        &mut self,
        node: &Node,
        children: &[Child],
        outer: DMat3,
        status: Status,
        depth: usize,
    ) -> Result<Vec<usize>, Problem> {
        let is_body = is_body(node);
        let mut members = Vec::new();
        for child in children {
            members.extend(match child {
                // The faces of a body stand side by side, also those that others have, too.
                Child::Item(item) if is_body && self.uses(item) <= FEW => {
                    self.faces(item, outer, status)?
                }
                Child::Item(item) => self.item(item, outer, status)?,
                Child::Node(id) => {
                    let inner = self.scene.node(*id).parent_from_node;
                    self.node(*id, DAffine3::from_mat3(outer) * inner, status, depth)?
                }
            });
        }
        members.extend(self.wires(node, outer, status));
        Ok(members)
    }

    /// Pointers to what shows a node at its place.
    fn node(
        &mut self,
        id: NodeId,
        whole: DAffine3,
        status: Status,
        depth: usize,
    ) -> Result<Vec<usize>, Problem> {
        if depth > NESTING {
            let text = format!("nodes nest more than {NESTING} deep");
            return Err(Problem::TooLarge(text));
        }
        let node = self.scene.node(id);
        let (place, inner) = match scale_of(&whole.matrix3) {
            Some(_) => (whole, DMat3::IDENTITY),
            None => (DAffine3::from_translation(whole.translation), whole.matrix3),
        };
        let once = self.uses.nodes.get(&id).copied().unwrap_or_default() <= 1;
        // Programs do not look at the transformation of a solid.
        if once
            && place == DAffine3::IDENTITY
            && let Some(solid) = self.solid(id, inner, status)?
        {
            return Ok(vec![solid]);
        }
        let mut children = node.children.clone();
        if self.shows[id.index()] {
            children.retain(|child| self.is_of_use(child));
        }
        match (children.as_slice(), node.wires.as_slice()) {
            ([Child::Item(item)], []) if once && self.is_leaf(node, item, &place) => {
                let faces = self.faces(item, inner, status)?;
                Ok(self.placed(faces, &place))
            }
            ([], [only]) if once && is_alone(&node.name, &self.scene.wire(*only).name, &place) => {
                let wires = self.wires(node, inner, status);
                Ok(self.placed(wires, &place))
            }
            ([Child::Node(only)], [])
                if self.scene.node(*only).parent_from_node == DAffine3::IDENTITY =>
            {
                let definition = self.definition(Defined::Node(*only), inner, depth)?;
                Ok(self.instance(definition, &place, &node.name, status))
            }
            (children, _) if once && place == DAffine3::IDENTITY => {
                let members = self.members(node, children, inner, Status::Member, depth + 1)?;
                Ok(self.group(&node.name, &members, status))
            }
            _ => {
                let definition = self.definition(Defined::Node(id), inner, depth)?;
                Ok(self.instance(definition, &place, "", status))
            }
        }
    }

    /// Whether a child shows anything; those that do not are told about.
    fn is_of_use(&mut self, child: &Child) -> bool {
        let Child::Node(id) = child else { return true };
        if !self.shows[id.index()] {
            self.empty(&self.scene.node(*id).name);
        }
        self.shows[id.index()]
    }

    /// Whether a node can be said by the transformation of the one surface in it.
    fn is_leaf(&self, node: &Node, item: &Item, place: &DAffine3) -> bool {
        let Shape::Patch(id) = item.shape else {
            return false;
        };
        is_alone(&node.name, &self.scene.patch(id).name, place) && self.is_shown_once(item)
    }

    /// Gives some entities their place.
    fn placed(&mut self, entities: Vec<usize>, place: &DAffine3) -> Vec<usize> {
        let transform = self.transform(place);
        for &entity in &entities {
            self.deck.entity(entity).transform = transform;
        }
        entities
    }

    fn is_shown_once(&self, item: &Item) -> bool {
        self.uses(item) == 1
    }

    /// In how many places the shape of an item stands.
    fn uses(&self, item: &Item) -> usize {
        let uses = self.uses.shapes.get(&item.shape);
        uses.copied().unwrap_or_default()
    }

    /// Pointers to what shows an item: a surface that is stored once is placed by instances.
    fn item(&mut self, item: &Item, outer: DMat3, status: Status) -> Result<Vec<usize>, Problem> {
        if self.is_shown_once(item) {
            return self.faces(item, outer, status);
        }
        let material = self.scene.item_material(item);
        let definition = self.definition(Defined::Item(item.shape, material), outer, 0)?;
        Ok(self.instance(definition, &DAffine3::IDENTITY, "", status))
    }

    /// The entities of a face.
    fn faces(&mut self, item: &Item, outer: DMat3, status: Status) -> Result<Vec<usize>, Problem> {
        let Shape::Patch(id) = item.shape else {
            let text = "IGES files hold no meshes; their triangles are left out";
            self.warnings.unsupported(Place::item(0, "meshes"), text);
            return Ok(Vec::new());
        };
        let scene = self.scene;
        let patch = distorted(scene.patch(id), outer);
        let color = self.item_color(item);
        let faces = geometry::face(&mut self.deck, &patch)?;
        if faces.is_empty() {
            tell_lost(&patch, &mut self.warnings);
        }
        if !patch.loops.is_empty() && patch.has_crossing_loops() {
            let place = Place::item(0, format!("\"{}\", {}", patch.name, patch.source));
            let text = "its loops cross: IGES knows outer loops and holes that do not, so that other parts \
                        of the surface may be shown";
            self.warnings.unsupported(place, text);
        }
        self.finish(&faces, color, status, &patch.name);
        Ok(faces)
    }

    /// The colour of an item, or zero.
    fn item_color(&mut self, item: &Item) -> usize {
        let material = self.scene.item_material(item);
        material.map_or(0, |material| self.color(material, false))
    }

    /// The entities of the curves and points of a node.
    fn wires(&mut self, node: &Node, outer: DMat3, status: Status) -> Vec<usize> {
        let scene = self.scene;
        let mut all = Vec::new();
        for wire in node.wires.iter().map(|&id| scene.wire(id)) {
            let color = wire
                .material
                .map_or(0, |material| self.color(material, true));
            let entities = geometry::wire(&mut self.deck, &wire.shape, outer);
            self.finish(&entities, color, status, &wire.name);
            all.extend(entities);
        }
        all
    }

    /// Says what the entities of one thing have in common.
    fn finish(&mut self, entities: &[usize], color: usize, status: Status, name: &str) {
        for &pointer in entities {
            let entity = self.deck.entity(pointer);
            entity.color = color;
            entity.status = status;
            self.name(pointer, name);
        }
    }

    /// A group (type 402) of some entities; nothing if there are none.
    fn group(&mut self, name: &str, members: &[usize], status: Status) -> Vec<usize> {
        if members.is_empty() {
            self.empty(name);
            return Vec::new();
        }
        let mut record = Record::new(402);
        record.pointers(members);
        let group = self.deck.add(Entity {
            kind: 402,
            form: 15,
            status,
            record,
            ..Entity::default()
        });
        self.depths.insert(group, self.depth(members));
        self.name(group, name);
        vec![group]
    }

    fn empty(&mut self, name: &str) {
        let place = Place::item(0, format!("node \"{name}\""));
        let text = "IGES files hold no empty groups; it is left out";
        self.warnings.unsupported(place, text);
    }

    /// How deep definitions nest below some entities.
    fn depth(&self, members: &[usize]) -> usize {
        let depths = members.iter().filter_map(|member| self.depths.get(member));
        depths.copied().max().unwrap_or_default()
    }

    /// The definition (type 308) of a node or item, without its place.
    fn definition(
        &mut self,
        defined: Defined,
        outer: DMat3,
        depth: usize,
    ) -> Result<Option<usize>, Problem> {
        let key = (defined, outer.to_cols_array().map(f64::to_bits));
        if let Some(known) = self.definitions.get(&key) {
            return Ok(*known);
        }
        let scene = self.scene;
        let (name, members) = match defined {
            Defined::Item(shape, material) => {
                let item = Item { shape, material };
                let name = match shape {
                    Shape::Patch(id) => scene.patch(id).name.as_str(),
                    Shape::Mesh(_) => "",
                };
                (name, self.faces(&item, outer, Status::Dependent)?)
            }
            Defined::Node(id) => {
                let (node, status) = (scene.node(id), Status::Dependent);
                let members = match self.solid(id, outer, status)? {
                    Some(solid) => vec![solid],
                    None => self.members(node, &node.children, outer, status, depth + 1)?,
                };
                (node.name.as_str(), members)
            }
        };
        let mut definition = None;
        if members.is_empty() {
            self.empty(name);
        } else {
            let depth = self.depth(&members);
            let mut record = Record::new(308);
            record.integer(depth);
            record.text(name);
            record.pointers(&members);
            let pointer = self.deck.add(Entity {
                kind: 308,
                status: Status::Definition,
                record,
                ..Entity::default()
            });
            self.depths.insert(pointer, depth);
            definition = Some(pointer);
        }
        self.definitions.insert(key, definition);
        Ok(definition)
    }

    /// An instance (type 408) of a definition.
    fn instance(
        &mut self,
        definition: Option<usize>,
        place: &DAffine3,
        name: &str,
        status: Status,
    ) -> Vec<usize> {
        let Some(definition) = definition else {
            return Vec::new();
        };
        let scale = scale_of(&place.matrix3).unwrap_or(1.0);
        let mut shift = place.translation;
        let mut transform = 0;
        let turned = place.matrix3 * scale.recip();
        if turned != DMat3::IDENTITY {
            let place = DAffine3::from_mat3_translation(turned, shift);
            transform = self.transform(&place);
            shift = DVec3::ZERO;
        }
        let mut record = Record::new(408);
        record.integer(definition);
        record.point(shift);
        record.real(scale);
        let instance = self.deck.add(Entity {
            kind: 408,
            transform,
            status,
            record,
            ..Entity::default()
        });
        self.depths.insert(instance, self.depth(&[definition]) + 1);
        self.name(instance, name);
        vec![instance]
    }

    /// A transformation (type 124), or zero if it does nothing.
    fn transform(&mut self, place: &DAffine3) -> usize {
        if *place == DAffine3::IDENTITY {
            return 0;
        }
        let key = place.to_cols_array().map(f64::to_bits);
        if let Some(&known) = self.transforms.get(&key) {
            return known;
        }
        let mut record = Record::new(124);
        let rows = place.matrix3.transpose();
        for (row, shift) in [rows.x_axis, rows.y_axis, rows.z_axis]
            .into_iter()
            .zip(place.translation.to_array())
        {
            record.point(row);
            record.real(shift);
        }
        let transform = self.deck.add(Entity {
            kind: 124,
            form: usize::from(place.matrix3.determinant() < 0.0),
            status: Status::Dependent,
            record,
            ..Entity::default()
        });
        self.transforms.insert(key, transform);
        transform
    }

    /// Gives an entity a name property (type 406, form 15). Nothing may be added to its record
    /// after that.
    fn name(&mut self, pointer: usize, name: &str) {
        if name.is_empty() {
            return;
        }
        let mut record = Record::new(406);
        record.integer(1);
        record.text(name);
        let property = self.deck.add(Entity {
            kind: 406,
            form: 15,
            status: Status::Dependent,
            record,
            ..Entity::default()
        });
        self.deck.entity(pointer).record.integers([0, 1, property]);
    }

    /// The colour (type 314) of a material, as surfaces have it or lines and points.
    fn color(&mut self, id: MaterialId, is_thin: bool) -> usize {
        if let Some(&known) = self.colors.get(&(id, is_thin)) {
            return known;
        }
        let material = self.scene.material(id);
        let mut record = Record::new(314);
        let model = material.metallic_roughness;
        let plain = if material.is_unlit() {
            material.emissive
        } else {
            material.diffuse
        };
        let base = if is_thin {
            material.flat()
        } else {
            model.map_or(plain, |model| model.base_color)
        };
        record.point(srgb_from_linear(base) * 100.0);
        record.text(&material.name);
        let color = self.deck.add(Entity {
            kind: 314,
            status: Status::Definition,
            record,
            ..Entity::default()
        });
        let plain = Material {
            name: material.name.clone(),
            ambient: base,
            diffuse: base,
            ..Material::default()
        };
        // Lines and points have no more than a colour.
        let is_told = if is_thin {
            material.opacity < 1.0
        } else {
            *material != plain
        };
        if is_told {
            let place = Place::item(0, format!("material \"{}\"", material.name));
            let text = "IGES files hold one colour of a material; \
                highlights, transparency and other light are left out";
            self.warnings.unsupported(place, text);
        }
        self.colors.insert((id, is_thin), color);
        color
    }
}

/// A patch to whose control points something is done.
fn distorted(patch: &Patch, outer: DMat3) -> Cow<'_, Patch> {
    if outer == DMat3::IDENTITY {
        return Cow::Borrowed(patch);
    }
    Cow::Owned(patch.transformed(&DAffine3::from_mat3(outer)))
}

/// Whether a node shows several faces, which are those of a body.
fn is_body(node: &Node) -> bool {
    let items = node
        .children
        .iter()
        .filter(|child| matches!(child, Child::Item(_)));
    items.count() > 1
}

/// Whether the name and place of a node can be those of the one thing in it.
fn is_alone(name: &str, own: &str, place: &DAffine3) -> bool {
    (name.is_empty() || name == own) && scale_of(&place.matrix3) == Some(1.0)
}

/// How much larger a matrix makes things, if it does no more than turning, mirroring and
/// scaling.
fn scale_of(matrix: &DMat3) -> Option<f64> {
    let gram = matrix.transpose() * *matrix;
    let square = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    let stray = gram - DMat3::from_diagonal(DVec3::splat(square));
    let is_rigid = stray
        .to_cols_array()
        .iter()
        .all(|x| x.abs() <= RIGID * square);
    let scale = square.sqrt();
    let snapped = if (scale - 1.0).abs() <= RIGID {
        1.0
    } else {
        scale
    };
    is_rigid.then_some(snapped)
}
