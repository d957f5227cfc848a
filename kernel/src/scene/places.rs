//! The tree of nodes as a flat list of what stands where.

use glam::DAffine3;

use super::{Child, Node, NodeId, Placement, Scene, Shape, WirePlacement};

impl Scene {
    /// How many shapes the flattened tree shows, without flattening it.
    pub fn placement_count(&self) -> u64 {
        let is_item = |child: &&Child| matches!(child, Child::Item(_));
        let counts = self.counts(|node| node.children.iter().filter(is_item).count());
        self.root.map_or(0, |root| counts[root.0])
    }

    /// How many curves and sets of points the flattened tree has, without flattening it.
    pub fn wire_placement_count(&self) -> u64 {
        let counts = self.counts(|node| node.wires.len());
        self.root.map_or(0, |root| counts[root.0])
    }

    /// For every node what `own` counts in it and below, once for each place.
    fn counts(&self, own: impl Fn(&Node) -> usize) -> Vec<u64> {
        let mut counts: Vec<u64> = Vec::new();
        for node in &self.nodes {
            let count = node.children.iter().fold(own(node) as u64, |sum, child| {
                sum.saturating_add(match child {
                    Child::Item(_) => 0,
                    Child::Node(id) => counts[id.0],
                })
            });
            counts.push(count);
        }
        counts
    }

    /// All curves and points that stand for themselves, once for each place, parents first.
    pub fn wire_placements(&self) -> Vec<WirePlacement> {
        let counts = self.counts(|node| node.wires.len());
        let mut placements = Vec::new();
        let mut stack: Vec<(NodeId, DAffine3, Vec<NodeId>)> = Vec::new();
        stack.extend(self.root.map(|root| (root, DAffine3::IDENTITY, Vec::new())));
        while let Some((id, world_from_parent, mut path)) = stack.pop() {
            let node = self.node(id);
            let world_from_object = world_from_parent * node.parent_from_node;
            path.push(id);
            placements.extend(node.wires.iter().map(|&wire| WirePlacement {
                wire,
                world_from_object,
                path: path.clone(),
            }));
            stack.extend(node.children.iter().rev().filter_map(|child| match child {
                Child::Node(id) if counts[id.0] > 0 => Some((*id, world_from_object, path.clone())),
                _ => None,
            }));
        }
        placements
    }

    /// Everything shown, in the order of the file; a shape stands there once for each place.
    ///
    /// Patches are numbered in this order from 0 on, meshes after them:
    /// [`Self::numbered_placements`].
    pub fn placements(&self) -> Vec<Placement> {
        let mut placements = Vec::new();
        // An explicit stack: files may nest deeper than ours reaches.
        let mut stack: Vec<(Child, DAffine3, Vec<NodeId>)> = Vec::new();
        stack.extend(
            self.root
                .map(|root| (Child::Node(root), DAffine3::IDENTITY, Vec::new())),
        );
        while let Some((child, world_from_object, mut path)) = stack.pop() {
            match child {
                Child::Item(item) => {
                    let (shape, material) = (item.shape, self.item_material(&item));
                    placements.push(Placement {
                        shape,
                        material,
                        world_from_object,
                        path,
                    });
                }
                Child::Node(id) => {
                    let node = self.node(id);
                    let world_from_node = world_from_object * node.parent_from_node;
                    path.push(id);
                    let children = node.children.iter().rev();
                    stack.extend(children.map(|&child| (child, world_from_node, path.clone())));
                }
            }
        }
        placements
    }

    /// As [`Self::placements`], but patches before meshes: here a shape stands at its number, by which
    /// hits and certificates of rays tell it.
    pub fn numbered_placements(&self) -> Vec<Placement> {
        let mut placements = self.placements();
        // Those of one kind stay in order.
        placements.sort_by_key(|at| matches!(at.shape, Shape::Mesh(_)));
        placements
    }

    /// The name of what stands there, or of the nearest node above it that has one; empty if none has.
    ///
    /// # Panics
    /// If the scene has no such shape or node.
    pub fn name_at(&self, at: &Placement) -> &str {
        let own = match at.shape {
            Shape::Patch(id) => &self.patch(id).name,
            Shape::Mesh(id) => &self.mesh(id).name,
        };
        let above = at.path.iter().rev().map(|&id| &self.node(id).name);
        let mut names = std::iter::once(own).chain(above);
        names.find(|name| !name.is_empty()).map_or("", |name| name)
    }
}
