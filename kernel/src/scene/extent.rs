//! Boxes around what is shown.

use std::sync::OnceLock;

use glam::{DAffine3, DVec3};

use super::{Child, Node, NodeId, Scene, Shape, Wire, WireShape};
use crate::{Aabb, Mesh, Patch};

/// Places of nodes that are looked into, before boxes around their boxes have to do.
const VISITS: u32 = 1 << 22;

/// The box around what has no finite place.
const EVERYWHERE: Aabb = Aabb {
    min: DVec3::NEG_INFINITY,
    max: DVec3::INFINITY,
};

impl Scene {
    /// A box around everything shown: the [control points of patches](Patch::hull_bounds), the
    /// vertices of meshes.
    pub fn hull_bounds(&self) -> Aabb {
        *self.hull.0.get_or_init(|| self.around_surfaces())
    }

    fn around_surfaces(&self) -> Aabb {
        let patches: Vec<_> = self.patches.iter().map(Patch::hull_bounds).collect();
        let meshes: Vec<_> = self.meshes.iter().map(Mesh::bounds).collect();
        self.bounds_of(|node| {
            let parts = node.children.iter().filter_map(|child| match child {
                Child::Node(_) => None,
                Child::Item(item) => Some(match item.shape {
                    Shape::Patch(id) => (patches[id.0], Part::Patch(self.patch(id))),
                    Shape::Mesh(id) => (meshes[id.0], Part::Mesh(self.mesh(id))),
                }),
            });
            parts.collect()
        })
    }

    /// The same or, where there is neither surface nor mesh, a box around the control points of all
    /// curves and around all points.
    pub fn extent(&self) -> Aabb {
        let bounds = self.hull_bounds();
        if !bounds.is_empty() {
            return bounds;
        }
        let wires: Vec<_> = self.wires.iter().map(Wire::hull_bounds).collect();
        self.bounds_of(|node| {
            let parts = node.wires.iter();
            parts
                .map(|id| (wires[id.0], Part::Wire(self.wire(*id))))
                .collect()
        })
    }

    /// A box around the points of all `parts` of nodes, which come with their boxes, where they are shown.
    fn bounds_of<'s>(&self, parts: impl Fn(&Node) -> Vec<(Aabb, Part<'s>)>) -> Aabb {
        // Boxes of boxes of whole nodes, in the coordinates of the parent, children first: too large where
        // they are turned.
        let mut loose: Vec<Aabb> = Vec::new();
        for node in &self.nodes {
            let children = node.children.iter().map(|child| match child {
                Child::Node(id) => loose[id.0],
                Child::Item(_) => Aabb::EMPTY,
            });
            let own = parts(node).into_iter().map(|(bounds, _)| bounds);
            let bounds = children.chain(own).fold(Aabb::EMPTY, Aabb::union);
            let moved = bounds.transformed(&node.parent_from_node);
            let is_held = bounds.is_empty() || moved.min.is_finite() && moved.max.is_finite();
            loose.push(if is_held { moved } else { EVERYWHERE });
        }
        // The points of what may reach beyond those before.
        let mut bounds = Aabb::EMPTY;
        let mut visits = 0;
        let mut stack: Vec<(NodeId, DAffine3)> = Vec::new();
        stack.extend(self.root.map(|root| (root, DAffine3::IDENTITY)));
        while let Some((id, world_from_parent)) = stack.pop() {
            let reaches = |bounds: &Aabb, of: Aabb, map: &DAffine3| {
                !of.is_empty() && bounds.union(of.transformed(map)) != *bounds
            };
            if !world_from_parent.is_finite() && !loose[id.0].is_empty() {
                return EVERYWHERE;
            }
            if !reaches(&bounds, loose[id.0], &world_from_parent) {
                continue;
            }
            visits += 1;
            if visits > VISITS {
                bounds = bounds.union(loose[id.0].transformed(&world_from_parent));
                continue;
            }
            let node = self.node(id);
            let world_from_node = world_from_parent * node.parent_from_node;
            if !world_from_node.is_finite() {
                return EVERYWHERE;
            }
            for (of, part) in parts(node) {
                if !reaches(&bounds, of, &world_from_node) {
                    continue;
                }
                if world_from_node == DAffine3::IDENTITY {
                    bounds = bounds.union(of);
                } else {
                    part.add_to(&mut bounds, &world_from_node);
                }
            }
            stack.extend(node.children.iter().rev().filter_map(|child| match child {
                Child::Node(id) => Some((*id, world_from_node)),
                Child::Item(_) => None,
            }));
        }
        bounds
    }
}

/// The box around all surfaces that are shown, once it has been asked for.
#[derive(Clone, Debug, Default)]
pub(super) struct Hull(OnceLock<Aabb>);

impl PartialEq for Hull {
    /// It follows from the rest of the scene.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// What has points.
#[derive(Clone, Copy)]
enum Part<'a> {
    Patch(&'a Patch),
    Mesh(&'a Mesh),
    Wire(&'a Wire),
}

impl Part<'_> {
    /// Adds the images of its points to a box.
    fn add_to(self, bounds: &mut Aabb, map: &DAffine3) {
        let mut add = |point: DVec3| *bounds = bounds.including(map.transform_point3(point));
        match self {
            Self::Patch(patch) => patch.where_loops_are().points().for_each(add),
            Self::Mesh(mesh) => mesh.positions().iter().copied().for_each(add),
            Self::Wire(wire) => match &wire.shape {
                WireShape::Curve(curve) => curve.points().for_each(add),
                WireShape::Points(points) => points.iter().copied().for_each(&mut add),
            },
        }
    }
}
