//! Nodes to [`Scene`]: what is shown, groups, transforms and shapes.
//!
//! Two passes over the list of nodes instead of a recursion: from the last node down, to
//! find what is shown and where; then from the first node up, so that everything inside a
//! node exists before the node itself.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3};
use kernel::{Child, Item, MaterialId, NodeId, Patch, Scene, Shape, Surface, Wire, WireId};

use super::animate::is_driver;
use super::curve::is_parameter_curve;
use super::kinds::{MESHES, SILENT, TRANSFORMS, is_geometry, is_group, is_material, is_misplaced};
use super::lights::Lamp;
use super::texture::{self, is_texture};
use super::wires::is_wire;
use super::write::NAME;
use super::{Node, Tree};
use crate::pictures::Pictures;
use crate::{Error, Import, Place, Problem, ReadOptions, Warnings};

/// Turns a tree into a scene. The warnings already known go first.
///
/// # Errors
/// If a limit is passed.
pub(super) fn convert(
    tree: &Tree,
    warnings: Warnings,
    pictures: &mut Pictures,
    options: &ReadOptions<'_>,
) -> Result<Import, Error> {
    let mut converter = Converter::new(tree, warnings, options);
    converter.pictures = std::mem::take(pictures);
    if let Some(root) = tree.root {
        converter.scene.unit = Some(tree.nodes[root].file.length.clone());
        converter.reach(root);
        for index in 0..=root {
            let made = match converter.reached[index] {
                Some(_) => converter.make(index)?,
                None => Made::Nothing,
            };
            converter.made.push(made);
        }
        converter.place_lights(root);
        if let Made::Node(id) = converter.made[root] {
            converter.scene.set_root(id).map_err(|e| Error {
                format: tree.format,
                place: Place::default(),
                problem: e.into(),
            })?;
        }
    }
    *pictures = converter.pictures;
    Ok(Import {
        scene: converter.scene,
        warnings: converter.warnings,
        ..Import::default()
    })
}

/// The state of a conversion.
pub(super) struct Converter<'a> {
    pub(super) tree: &'a Tree,
    pub(super) options: &'a ReadOptions<'a>,
    pub(super) scene: Scene,
    pub(super) warnings: Warnings,
    /// Control points read so far.
    pub(super) points: usize,
    /// Tests of corners that polygons may still cost.
    pub(super) tests: usize,
    /// For each node, its place if it is shown.
    reached: Vec<Option<Reached>>,
    /// For each node, what has become of it.
    pub(super) made: Vec<Made>,
    /// What geometries consist of, one list for each.
    shapes: Vec<Vec<Shape>>,
    /// Lines and points, one list for each geometry, and those of them that are shown.
    pub(super) wires: Vec<Vec<Wire>>,
    pub(super) wired: HashMap<(usize, Option<MaterialId>), Vec<WireId>>,
    /// Textures, by their position.
    pub(super) textures: Vec<texture::Read>,
    pub(super) pictures: Pictures,
    /// Geometries that are shown with a picture.
    pictured: HashSet<usize>,
    /// Whether the geometry that is being made is one of them.
    pub(super) is_pictured: bool,
    /// Texture coordinates of solids, by their kind: they do not depend on sizes.
    pub(super) covers: HashMap<Box<str>, Arc<Surface>>,
    /// Materials that reflect nothing whatever pictures and vertices say.
    pub(super) unlit: HashSet<MaterialId>,
    /// For materials of meshes with colours: those that leave the colour to them.
    pub(super) whitened: HashMap<Option<MaterialId>, MaterialId>,
    /// Materials as lines and points show them.
    pub(super) glows: HashMap<MaterialId, MaterialId>,
    /// Lights in the coordinates of the node around them.
    pub(super) lights: Vec<Lamp>,
    pub(super) bound: Bound,
}

/// The place of a node that is shown; that of its definition if that is shown, too.
#[derive(Clone, Copy, Debug)]
struct Reached {
    world_from_parent: DAffine3,
    parent_from_node: DAffine3,
}

/// What has become of a node.
#[derive(Clone, Copy, Debug)]
pub(super) enum Made {
    /// Nothing that the scene keeps under an index.
    Nothing,
    /// A group.
    Node(NodeId),
    /// A geometry with its material.
    Shape(usize, Option<MaterialId>),
    /// Geometry, by its position in the list of shapes.
    Geometry(usize),
    /// Lines or points, by their position, with their material.
    Wires(usize, Option<MaterialId>),
    /// A material or an appearance.
    Material(MaterialId),
    /// A texture, by its position in the list of textures.
    Texture(usize),
    /// A light, by its position in the list of lights.
    Light(usize),
}

/// Nodes of which a scene has only one in force: the first.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bound {
    pub(super) navigation: bool,
    pub(super) background: bool,
}

impl<'a> Converter<'a> {
    /// A conversion that has not begun.
    pub(super) fn new(tree: &'a Tree, warnings: Warnings, options: &'a ReadOptions<'a>) -> Self {
        Self {
            tree,
            options,
            scene: Scene::default(),
            warnings,
            points: 0,
            tests: crate::triangulate::TESTS,
            reached: Vec::new(),
            made: Vec::new(),
            shapes: Vec::new(),
            wires: Vec::new(),
            wired: HashMap::new(),
            textures: Vec::new(),
            pictures: Pictures::default(),
            pictured: HashSet::new(),
            is_pictured: false,
            covers: HashMap::new(),
            unlit: HashSet::new(),
            whitened: HashMap::new(),
            glows: HashMap::new(),
            lights: Vec::new(),
            bound: Bound::default(),
        }
    }

    /// Marks the nodes that are shown, from `root` down, with their places.
    fn reach(&mut self, root: usize) {
        self.reached.resize(root + 1, None);
        self.mark(root, DAffine3::IDENTITY);
        for index in (0..=root).rev() {
            let Some(here) = self.reached[index] else {
                continue;
            };
            let node = &self.tree.nodes[index];
            let world_from_node = here.world_from_parent * here.parent_from_node;
            for child in shown(self.tree, node, &mut self.warnings) {
                let link = &node.children[child];
                if link.defined_here || self.reached[link.node].is_none() {
                    self.mark(link.node, world_from_node);
                }
            }
            if &*node.kind == "Shape" && has_picture(self.tree, node) {
                let inside = node.children.iter().map(|link| link.node);
                self.pictured.extend(inside);
            }
        }
    }

    fn mark(&mut self, index: usize, world_from_parent: DAffine3) {
        let known = self.reached[index].map(|r| r.parent_from_node);
        let node = &self.tree.nodes[index];
        let parent_from_node = known.unwrap_or_else(|| match &*node.kind {
            kind if TRANSFORMS.contains(&kind) => transform(node, &mut self.warnings),
            _ => DAffine3::IDENTITY,
        });
        self.reached[index] = Some(Reached {
            world_from_parent,
            parent_from_node,
        });
    }

    /// Where the node's own coordinates lie.
    pub(super) fn world_from_parent(&self, index: usize) -> DAffine3 {
        let reached = self.reached.get(index).copied().flatten();
        reached.map_or(DAffine3::IDENTITY, |r| r.world_from_parent)
    }

    /// What the transform of a node does.
    pub(super) fn parent_from_node(&self, index: usize) -> DAffine3 {
        let reached = self.reached.get(index).copied().flatten();
        reached.map_or(DAffine3::IDENTITY, |r| r.parent_from_node)
    }

    /// Turns one node into what it is in the scene; all inside it is done already.
    fn make(&mut self, index: usize) -> Result<Made, Error> {
        let tree = self.tree;
        let node = &tree.nodes[index];
        let made = match &*node.kind {
            kind if is_group(kind) => self.group(index, node),
            "Shape" => self.shape(node),
            "Appearance" => self.appearance(node),
            "Material" | "TwoSidedMaterial" => self.material(node),
            "PhysicalMaterial" => self.physical_material(node),
            "UnlitMaterial" => self.unlit_material(node),
            "ImageTexture" => self.image_texture(node),
            "PixelTexture" => return self.pixel_texture(node),
            "MultiTexture" => self.multi_texture(node),
            kind if is_wire(kind) || self.is_circle(node) => return self.wires(node),
            kind if is_geometry(kind) => {
                self.is_pictured = self.pictured.contains(&index);
                return self.geometry(node);
            }
            "Viewpoint" | "OrthoViewpoint" => self.viewpoint(index, node),
            "DirectionalLight" | "PointLight" | "SpotLight" => self.light(node),
            "Background" | "TextureBackground" => self.background(index, node),
            "NavigationInfo" => self.navigation(node),
            "NurbsSet" => self.nurbs_set(node),
            kind if SILENT.contains(&kind) || is_driver(kind) || node.is_metadata() => {
                Made::Nothing
            }
            kind => {
                let text = match self.geometries_inside(node) {
                    0 => format!("{kind} is not read"),
                    1 => format!("{kind} is not read, nor the geometry in it"),
                    count => format!("{kind} is not read, nor the {count} geometries in it"),
                };
                self.warnings.unsupported(node.place(), text);
                Made::Nothing
            }
        };
        Ok(made)
    }

    /// How many geometries are defined in a node and not shown elsewhere.
    fn geometries_inside(&self, node: &'a Node) -> usize {
        let defined = |node: &'a Node| {
            let links = node.children.iter().filter(|link| link.defined_here);
            links.map(|link| link.node)
        };
        let mut count = 0;
        let mut open: Vec<usize> = defined(node).collect();
        while let Some(index) = open.pop() {
            count += usize::from(self.is_lost_geometry(index));
            open.extend(defined(&self.tree.nodes[index]));
        }
        count
    }

    /// Whether a node is a geometry that nothing shows.
    fn is_lost_geometry(&self, index: usize) -> bool {
        let is_shown = self.reached.get(index).is_some_and(Option::is_some);
        is_geometry(&self.tree.nodes[index].kind) && !is_shown
    }

    fn group(&mut self, index: usize, node: &Node) -> Made {
        if &*node.kind == "Billboard" {
            let text = "Billboard does not turn to the camera";
            self.warnings.unsupported(node.place(), text);
        }
        let (mut children, mut wires) = (Vec::new(), Vec::new());
        for child in self.shown_inside(node) {
            match self.made[child] {
                Made::Node(id) => children.push(Child::Node(id)),
                Made::Wires(geometry, material) => wires.extend(self.wired(geometry, material)),
                Made::Shape(geometry, material) => {
                    let shapes = self.shapes[geometry].iter();
                    children.extend(shapes.map(|&shape| Child::Item(Item { shape, material })));
                }
                Made::Geometry(_) => {
                    let text = "it stands in no Shape; it is not shown";
                    self.warnings.invalid(self.tree.nodes[child].place(), text);
                }
                _ => {}
            }
        }
        if children.is_empty() && wires.is_empty() {
            return Made::Nothing;
        }
        let made = self.scene.add_node(kernel::Node {
            name: self.label(node),
            parent_from_node: self.parent_from_node(index),
            children,
            wires,
            voids: None,
        });
        match made {
            Ok(id) => Made::Node(id),
            Err(_) => {
                let text = "a map that is not finite or flattens all to nothing; what is inside is left out";
                self.warnings.invalid(node.place(), text);
                Made::Nothing
            }
        }
    }

    /// Surfaces in a `NurbsSet` are shown by the shapes that use them.
    fn nurbs_set(&mut self, node: &Node) -> Made {
        for link in &node.children {
            if self.is_lost_geometry(link.node) {
                let text = "a surface of a NurbsSet that no Shape uses; it is not shown";
                let place = self.tree.nodes[link.node].place();
                self.warnings.invalid(place, text);
            }
        }
        Made::Nothing
    }

    /// What the shown children of a node have become.
    pub(super) fn made_inside(&self, node: &Node) -> Vec<Made> {
        let shown = self.shown_inside(node).into_iter();
        shown.map(|index| self.made[index]).collect()
    }

    /// The shown children of a node.
    pub(super) fn shown_inside(&self, node: &Node) -> Vec<usize> {
        // What is wrong with the fields has been told on the way down.
        let shown = shown(self.tree, node, &mut Warnings::default()).into_iter();
        shown.map(|i| node.children[i].node).collect()
    }

    fn shape(&mut self, node: &Node) -> Made {
        let (mut geometry, mut wires, mut material) = (None, None, None);
        for index in self.shown_inside(node) {
            let made = self.made[index];
            let is_geometry = matches!(made, Made::Wires(..) | Made::Geometry(_));
            if is_geometry && (geometry.is_some() || wires.is_some()) {
                let text = "its Shape has another geometry before it; it is not shown";
                self.warnings.invalid(self.tree.nodes[index].place(), text);
                continue;
            }
            match made {
                Made::Wires(found, _) => wires = Some(found),
                Made::Geometry(found) => geometry = Some(found),
                Made::Material(found) => material = material.or(Some(found)),
                _ => {}
            }
        }
        let Some(geometry) = geometry else {
            return wires.map_or(Made::Nothing, |wires| Made::Wires(wires, material));
        };
        let has_colors = |shape: &Shape| match shape {
            Shape::Mesh(id) => !self.scene.mesh(*id).colors().is_empty(),
            Shape::Patch(_) => false,
        };
        if self.shapes[geometry].iter().any(has_colors) {
            material = Some(self.whitened(material));
        }
        Made::Shape(geometry, material)
    }

    /// An appearance is its material with its textures; without either the default of the
    /// scene holds.
    fn appearance(&mut self, node: &Node) -> Made {
        let (mut front, mut back) = (None, None);
        for link in &node.children {
            if let Some(&Made::Material(id)) = self.made.get(link.node) {
                let side = match link.field.as_deref() {
                    Some("backMaterial") => &mut back,
                    _ => &mut front,
                };
                *side = side.or(Some(id));
            }
        }
        let mut dressed = self.dressed(node, front);
        if let (Some(own), Some(back)) = (dressed, back) {
            let back = self.dressed(node, Some(back)).unwrap_or(back);
            let mut both = self.scene.material(own).clone();
            both.back = Some(Box::new(self.scene.material(back).clone()));
            dressed = Some(self.scene.add_material(both));
        }
        dressed.map_or(Made::Nothing, |id| Made::Material(self.blended(node, id)))
    }

    /// A surface or a mesh, stored once however often it is used.
    fn geometry(&mut self, node: &Node) -> Result<Made, Error> {
        if !node.complete {
            let text = format!("the file ends inside this {}; it is left out", node.kind);
            self.warnings.invalid(node.place(), text);
            return Ok(Made::Nothing);
        }
        let (name, source) = (self.name(node), node.place().to_string());
        let (mut shapes, mut problem) = (Vec::new(), None);
        if MESHES.contains(&&*node.kind) {
            match self.mesh(node)? {
                Ok(mesh) if mesh.triangles().is_empty() => {
                    let text = format!("this {} has no triangle; it is left out", node.kind);
                    self.warnings.invalid(node.place(), text);
                }
                Ok(mut mesh) => {
                    (mesh.name, mesh.source) = (name, source);
                    shapes.push(self.scene.add_mesh(mesh).map(Shape::Mesh));
                }
                Err(found) => problem = Some(found),
            }
        } else {
            let patches = self.patches(node)?.unwrap_or_else(|found| {
                problem = Some(found);
                Vec::new()
            });
            for patch in patches {
                let (name, source) = (name.clone(), source.clone());
                let patch = Patch {
                    name,
                    source,
                    ..patch
                };
                shapes.push(self.scene.add_patch(patch).map(Shape::Patch));
            }
        }
        let (shapes, failed): (Vec<_>, Vec<_>) = shapes.into_iter().partition(Result::is_ok);
        for problem in problem
            .into_iter()
            .chain(failed.into_iter().filter_map(Result::err))
        {
            self.warnings.add(node.place(), problem);
        }
        if shapes.is_empty() {
            return Ok(Made::Nothing);
        }
        self.shapes.push(shapes.into_iter().flatten().collect());
        Ok(Made::Geometry(self.shapes.len() - 1))
    }

    /// The DEF name of a geometry, or of the shape or group around it.
    pub(super) fn name(&self, node: &Node) -> String {
        let around = |node: &Node| node.parent.map(|parent| &self.tree.nodes[parent]);
        let shape = around(node).filter(|parent| &*parent.kind == "Shape");
        let group = shape.and_then(around);
        let all = [Some(node), shape, group].into_iter().flatten();
        let mut names = all
            .map(|node| self.label(node))
            .filter(|name| !name.is_empty());
        names.next().unwrap_or_default()
    }

    /// The name of a node: its DEF name, or the one in its metadata that no DEF may have.
    pub(super) fn label(&self, node: &Node) -> String {
        let mut inside = node.children.iter().map(|link| &self.tree.nodes[link.node]);
        let is_name = |n: &&Node| &*n.kind == "MetadataString" && n.strings("name") == [NAME];
        let name = inside
            .find(is_name)
            .and_then(|name| name.strings("value").pop());
        name.unwrap_or_else(|| node.def.to_string())
    }

    /// Adds to the number of control points read. A node that is used often is read as
    /// often, so its text counts even where it gives no points.
    ///
    /// # Errors
    /// If it passes the limit.
    pub(super) fn count_points(&mut self, count: usize, node: &Node) -> Result<(), Error> {
        let text: usize = node.fields.iter().map(|field| field.value.len()).sum();
        self.points += count.max(text / TEXT_OF_POINT);
        let limit = self.options.limits.points;
        if self.points <= limit {
            return Ok(());
        }
        Err(Error {
            format: self.tree.format,
            place: node.place(),
            problem: Problem::TooLarge(format!(
                "more than {limit} control points; products of two lists count {PRODUCT} times"
            )),
        })
    }

    /// Counts the control points that two lists give together, which are far more than their text.
    ///
    /// # Errors
    /// If they pass the limit.
    pub(super) fn count_product(&mut self, counts: [usize; 2], node: &Node) -> Result<(), Error> {
        let count = counts[0].saturating_mul(counts[1]);
        self.count_points(count.saturating_mul(PRODUCT), node)
    }
}

/// For how many control points one counts that two lists give together.
const PRODUCT: usize = 16;

/// The map of a Transform: `T C R SR S SR^-1 C^-1`.
pub(super) fn transform(node: &Node, warnings: &mut Warnings) -> DAffine3 {
    let translation = node.vector("translation", DVec3::ZERO, warnings);
    let center = node.vector("center", DVec3::ZERO, warnings);
    let scale = node.vector("scale", DVec3::ONE, warnings);
    let rotation = rotation(node, "rotation", warnings);
    let orientation = self::rotation(node, "scaleOrientation", warnings);
    DAffine3::from_translation(translation + center)
        * DAffine3::from_quat(rotation * orientation)
        * DAffine3::from_scale(scale)
        * DAffine3::from_quat(orientation.inverse())
        * DAffine3::from_translation(-center)
}

/// A field that holds an axis and an angle; no rotation if it is not there.
pub(super) fn rotation(node: &Node, field: &str, warnings: &mut Warnings) -> DQuat {
    let tuple = node.tuple(field, warnings);
    turn(tuple.unwrap_or([0.0, 0.0, 1.0, 0.0]), node)
}

/// The rotation about an axis by an angle in the unit of the node's file.
pub(super) fn turn([x, y, z, angle]: [f64; 4], node: &Node) -> DQuat {
    let axis = DVec3::new(x, y, z).try_normalize();
    axis.map_or(DQuat::IDENTITY, |axis| {
        DQuat::from_axis_angle(axis, angle * node.file.angle)
    })
}

/// Positions of the children of a node that matter if the node is shown.
fn shown(tree: &Tree, node: &Node, warnings: &mut Warnings) -> Vec<usize> {
    let is_child = |&i: &usize| {
        let link = &node.children[i];
        let apart = link.field.as_deref() == Some("proxy");
        let inside = &tree.nodes[link.node];
        !inside.is_metadata() && !apart && !is_misplaced(&inside.kind, &node.kind)
    };
    let mut all = (0..node.children.len()).filter(is_child);
    let kind = &*node.kind;
    let has_shown = is_group(kind)
        || is_geometry(kind)
        || is_material(kind)
        || matches!(kind, "Shape" | "Appearance" | "MultiTexture");
    if !has_shown || kind != "CADLayer" && !node.flag("visible", true, warnings) {
        return Vec::new();
    }
    match kind {
        "CADLayer" => {
            let visible = node.flags("visible", warnings);
            // Since X3D 4 there is one for all.
            let of = |i: usize| match (&visible[..], &*node.file.version) {
                (&[only], "4.0" | "4.1") => only,
                _ => visible.get(i).copied().unwrap_or(true),
            };
            let all = all.enumerate();
            all.filter_map(|(i, child)| of(i).then_some(child))
                .collect()
        }
        "LOD" => all.next().into_iter().collect(),
        // The other fields say how points are deformed.
        "CoordinateDeformer" => all
            .filter(|&i| matches!(node.children[i].field.as_deref(), None | Some("children")))
            .collect(),
        // What stands inside is part of it.
        "NurbsSweptSurface" | "NurbsSwungSurface" | "TrimmedSurface" => Vec::new(),
        "NurbsTrimmedSurface" => all
            .filter(|&i| !is_parameter_curve(&tree.nodes[node.children[i].node].kind))
            .collect(),
        // The other fields repeat what stands in its skeleton.
        "HAnimHumanoid" => all
            .filter(|&i| matches!(node.children[i].field.as_deref(), Some("skeleton" | "skin")))
            .collect(),
        "Switch" => {
            let choice: i64 = node.whole("whichChoice", ("a whole number", -1), warnings);
            let chosen = usize::try_from(choice).ok();
            chosen.and_then(|i| all.nth(i)).into_iter().collect()
        }
        _ => all.collect(),
    }
}

/// Bytes of text that a control point usually takes, for the limit on points.
const TEXT_OF_POINT: usize = 24;

/// Whether the appearance of a shape, or its material, has a texture.
fn has_picture(tree: &Tree, shape: &Node) -> bool {
    let has_texture = |node: &Node| tree.inside(node).any(|n| is_texture(&n.kind));
    let is_pictured = |m: &Node| is_material(&m.kind) && has_texture(m);
    let mut appearances = tree.inside(shape).filter(|n| &*n.kind == "Appearance");
    appearances.any(|a| has_texture(a) || tree.inside(a).any(is_pictured))
}
