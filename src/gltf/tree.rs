//! The nodes of the file.

use std::collections::HashMap;
use std::io;

use glam::{DAffine3, DVec3};
use gltf::json::{Index, Node};
use kernel::{Child, NodeId, Scene};
use serde_json::{Value, json};

use super::buffer::number;
use super::place::Place;
use super::shapes::{Content, Placed, Shapes};

/// Equal parts below one node that become places of one node, from this number on.
pub(super) const MANY: usize = 64;

/// The extension for many places of one mesh.
const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// Adds everything below the scene's root as children of a node of the file.
///
/// # Errors
/// If a picture cannot be encoded.
pub(super) fn add<'s>(
    scene: &'s Scene,
    shapes: &mut Shapes<'s>,
    top: Index<Node>,
    root: &mut gltf::json::Root,
) -> io::Result<()> {
    // How many shapes and wires each node shows: those that show none are left out.
    let mut shown: Vec<u64> = Vec::new();
    for node in scene.nodes() {
        let wires = node.wires.len() as u64;
        let count = node.children.iter().fold(wires, |sum, child| match child {
            Child::Item(_) => sum.saturating_add(1),
            Child::Node(id) => sum.saturating_add(shown[id.index()]),
        });
        shown.push(count);
    }
    let mut writer = Tree {
        scene,
        shown,
        shapes,
        root,
        instanced: false,
    };
    let mut stack: Vec<(NodeId, Index<Node>)> = Vec::new();
    stack.extend(scene.root().map(|id| (id, top)));
    // An explicit stack: files may nest deeper than ours reaches.
    while let Some((id, parent)) = stack.pop() {
        writer.add_node(id, parent, &mut stack)?;
    }
    if writer.instanced {
        super::require(root, INSTANCING);
    }
    Ok(())
}

struct Tree<'t, 's> {
    scene: &'s Scene,
    shown: Vec<u64>,
    shapes: &'t mut Shapes<'s>,
    root: &'t mut gltf::json::Root,
    instanced: bool,
}

impl Tree<'_, '_> {
    fn push(&mut self, node: Node, parent: Index<Node>) -> Index<Node> {
        let index = Index::new(number(self.root.nodes.len()));
        self.root.nodes.push(node);
        self.root.nodes[parent.value()]
            .children
            .get_or_insert_default()
            .push(index);
        index
    }

    fn add_node(
        &mut self,
        id: NodeId,
        parent: Index<Node>,
        stack: &mut Vec<(NodeId, Index<Node>)>,
    ) -> io::Result<()> {
        if self.shown[id.index()] == 0 {
            return Ok(());
        }
        let scene = self.scene;
        let node = scene.node(id);
        let mut own = parent;
        for (depth, place) in Place::of(&node.parent_from_node).into_iter().enumerate() {
            let mut made = Node::default();
            if depth == 0 && !node.name.is_empty() {
                made.name = Some(node.name.clone());
            }
            place.apply_to(&mut made);
            own = self.push(made, own);
        }
        if let Some(placed) = self.shapes.add(Content::of(scene, id), self.root)? {
            self.hold(placed, own);
        }
        // Children that are the same part at other places are counted before they are written.
        let mut parts: Vec<(NodeId, Vec<Place>)> = Vec::new();
        let mut known = HashMap::new();
        let mut below = Vec::new();
        for child in &node.children {
            let Child::Node(child) = child else {
                continue;
            };
            let found = self.part(*child).map(|(part, place)| {
                let next = parts.len();
                let number = *known.entry(self.key(part)).or_insert(next);
                if number == next {
                    parts.push((part, Vec::new()));
                }
                parts[number].1.push(place);
                number
            });
            below.push((*child, found));
        }
        let is_many = |number: usize| parts[number].1.len() >= MANY;
        below.retain(|(_, part)| !part.is_some_and(is_many));
        stack.extend(below.into_iter().rev().map(|(child, _)| (child, own)));
        parts.retain(|(_, places)| places.len() >= MANY);
        for (part, places) in parts {
            self.instance(part, &places, own)?;
        }
        Ok(())
    }

    /// Puts a mesh into a node, or into one below it where it is measured from elsewhere.
    fn hold(&mut self, placed: Placed, own: Index<Node>) {
        let holder = if placed.origin == DVec3::ZERO && DVec3::splat(placed.step) == DVec3::ONE {
            own
        } else {
            let mut node = Node::default();
            let place = Place {
                translation: placed.origin,
                scale: DVec3::splat(placed.step),
                ..Place::IDENTITY
            };
            place.apply_to(&mut node);
            self.push(node, own)
        };
        self.root.nodes[holder.value()].mesh = Some(placed.mesh);
    }

    /// The node that shows shapes alone at the end of nodes that only place it, and its place;
    /// `None` if there is more to it, or its place is more than a place.
    fn part(&self, mut id: NodeId) -> Option<(NodeId, Place)> {
        let mut map = DAffine3::IDENTITY;
        loop {
            let node = self.scene.node(id);
            map *= node.parent_from_node;
            match node.children[..] {
                [Child::Node(only)] if node.wires.is_empty() => id = only,
                _ if node.children.iter().all(|c| matches!(c, Child::Item(_))) => break,
                _ => return None,
            }
        }
        match Place::of(&map)[..] {
            [place] if place.scale.cmpgt(DVec3::ZERO).all() => Some((id, place)),
            _ => None,
        }
    }

    /// What makes two parts the same: a name and what they show.
    fn key(&self, part: NodeId) -> (&str, Content) {
        (&self.scene.node(part).name, Content::of(self.scene, part))
    }

    /// One node for many places of a part.
    fn instance(&mut self, part: NodeId, places: &[Place], parent: Index<Node>) -> io::Result<()> {
        let Some(placed) = self.shapes.add(Content::of(self.scene, part), self.root)? else {
            return Ok(());
        };
        let data = &mut self.shapes.data;
        let vectors = |get: &dyn Fn(&Place) -> DVec3| -> Vec<[f32; 3]> {
            places.iter().map(|p| get(p).as_vec3().to_array()).collect()
        };
        // What is measured from elsewhere is moved before it is placed.
        let moved = |p: &Place| p.translation + p.rotation * (p.scale * placed.origin);
        let translation = data.add_vec3(&vectors(&moved));
        let rotations: Vec<[f32; 4]> = places.iter().map(|p| p.quaternion().0).collect();
        let rotation = data.add_vec4(&rotations);
        let scale = data.add_vec3(&vectors(&|p| p.scale * placed.step));
        let attributes: Value = json!({
            "TRANSLATION": translation.value(),
            "ROTATION": rotation.value(),
            "SCALE": scale.value(),
        });
        let name = &self.scene.node(part).name;
        let mut extension = gltf::json::extensions::scene::Node::default();
        let content = json!({ "attributes": attributes });
        extension.others.insert(INSTANCING.to_owned(), content);
        let node = Node {
            name: (!name.is_empty()).then(|| name.clone()),
            mesh: Some(placed.mesh),
            extensions: Some(extension),
            ..Node::default()
        };
        self.push(node, parent);
        self.instanced = true;
        Ok(())
    }
}
