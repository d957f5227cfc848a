//! Scenes without what is shown nowhere.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use kernel::{Child, Error, Item, MeshId, Node, NodeId, PatchId, Scene, Shape, WireId};

use super::Tree;

impl Tree<'_, '_> {
    /// Leaves out what only operands of boolean trees are made of; `children` are those of the root.
    pub(super) fn prune(&mut self, children: &mut [Child]) {
        if !self.booleans.has_operands {
            return;
        }
        // All that is in the scene can be added to another one.
        if let Ok(scene) = pruned(&self.scene, children) {
            self.scene = scene;
        }
    }
}

/// What is shown of a scene, by its place there.
#[derive(Default)]
struct Shown {
    nodes: BTreeSet<usize>,
    patches: BTreeMap<usize, PatchId>,
    meshes: BTreeMap<usize, MeshId>,
    wires: BTreeMap<usize, WireId>,
}

impl Shown {
    fn add(&mut self, child: Child) {
        let shape = match child {
            Child::Node(id) => {
                self.nodes.insert(id.index());
                return;
            }
            Child::Item(item) => item.shape,
        };
        match shape {
            Shape::Patch(id) => {
                self.patches.insert(id.index(), id);
            }
            Shape::Mesh(id) => {
                self.meshes.insert(id.index(), id);
            }
        }
    }
}

/// A scene of what children show of another one, and they in it.
fn pruned(scene: &Scene, children: &mut [Child]) -> Result<Scene, Error> {
    let mut shown = Shown::default();
    for &child in children.iter() {
        shown.add(child);
    }
    let ids: Vec<NodeId> = scene.node_ids().collect();
    // Parents come after their children.
    for &id in ids.iter().rev() {
        if shown.nodes.contains(&id.index()) {
            let node = scene.node(id);
            for &child in &node.children {
                shown.add(child);
            }
            shown
                .wires
                .extend(node.wires.iter().map(|id| (id.index(), *id)));
        }
    }
    let mut result = Scene::default();
    for material in scene.materials() {
        result.add_material(material.clone());
    }
    let mut shapes = HashMap::new();
    for id in shown.patches.into_values() {
        let made = result.add_patch(scene.patch(id).clone())?;
        shapes.insert(Shape::Patch(id), Shape::Patch(made));
    }
    for id in shown.meshes.into_values() {
        let made = result.add_mesh(scene.mesh(id).clone())?;
        shapes.insert(Shape::Mesh(id), Shape::Mesh(made));
    }
    let mut wires = HashMap::new();
    for id in shown.wires.into_values() {
        wires.insert(id, result.add_wire(scene.wire(id).clone())?);
    }
    let mut nodes: HashMap<NodeId, NodeId> = HashMap::new();
    let moved = |child: &Child, nodes: &HashMap<NodeId, NodeId>| match child {
        Child::Node(id) => Child::Node(nodes[id]),
        Child::Item(item) => Child::Item(Item {
            shape: shapes[&item.shape],
            material: item.material,
        }),
    };
    for id in ids {
        if shown.nodes.contains(&id.index()) {
            let node = scene.node(id);
            let made = result.add_node(Node {
                name: node.name.clone(),
                parent_from_node: node.parent_from_node,
                children: node.children.iter().map(|c| moved(c, &nodes)).collect(),
                wires: node.wires.iter().map(|id| wires[id]).collect(),
                voids: node.voids,
            })?;
            nodes.insert(id, made);
        }
    }
    for child in children {
        *child = moved(child, &nodes);
    }
    Ok(result)
}
