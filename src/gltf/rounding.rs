//! How far points move when they are written.

use glam::DMat3;
use kernel::{Aabb, Child, Node, Scene, Shape};

use super::Packing;
use super::shapes::Grid;
use super::tree::MANY;
use crate::accuracy::SINGLE;
use crate::tessellate::stretch;

/// Roundings of the scales and turns of a node, of the at most two that stand for it.
const ROUNDINGS: f64 = 8.0;

/// How far a point moves at most when it is written, in units of the scene: positions are in
/// single precision or on a grid, and so are the places of nodes.
///
/// The node above all others does not count: the digits of its numbers are those of the unit.
pub fn rounding(scene: &Scene, packing: Packing) -> f64 {
    let patches: Vec<_> = scene.patches().iter().map(|p| p.hull_bounds()).collect();
    let meshes: Vec<_> = scene.meshes().iter().map(kernel::Mesh::bounds).collect();
    let wires: Vec<_> = scene.wires().iter().map(|w| w.hull_bounds()).collect();
    let is_node = |child: &&Child| matches!(child, Child::Node(_));
    let count = |node: &Node| node.children.iter().filter(is_node).count();
    // Many places of a part are put together before they are rounded.
    let is_joined = scene.nodes().iter().any(|node| count(node) >= MANY);
    // What is in each node and how far it moves, children first, in coordinates of the parent.
    let mut nodes: Vec<(Aabb, f64)> = Vec::new();
    for node in scene.nodes() {
        let (mut own, mut below, mut moved) = (Aabb::EMPTY, Aabb::EMPTY, 0.0_f64);
        for wire in &node.wires {
            own = own.union(wires[wire.index()]);
        }
        for child in &node.children {
            match child {
                Child::Item(item) => {
                    own = own.union(match item.shape {
                        Shape::Patch(id) => patches[id.index()],
                        Shape::Mesh(id) => meshes[id.index()],
                    });
                }
                Child::Node(id) => {
                    below = below.union(nodes[id.index()].0);
                    moved = moved.max(nodes[id.index()].1);
                }
            }
        }
        let all = own.union(below);
        if all.is_empty() {
            nodes.push((all, 0.0));
            continue;
        }
        if !own.is_empty() {
            moved = moved.max(Grid::of(&own, packing.quantize).rounding(&own));
        }
        let map = &node.parent_from_node;
        let longer = stretch(map);
        moved *= longer;
        let reach = longer * all.min.abs().max(all.max.abs()).length();
        let place = map.translation;
        moved += if is_joined {
            SINGLE * (place.length() + reach)
        } else {
            place.distance(place.as_vec3().as_dvec3())
        };
        if map.matrix3 != DMat3::IDENTITY {
            moved += ROUNDINGS * SINGLE * reach;
        }
        nodes.push((all.transformed(map), moved));
    }
    scene.root().map_or(0.0, |root| nodes[root.index()].1)
}
