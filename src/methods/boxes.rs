//! A hierarchy of boxes, two children to a node: one way to build it is Martin's, the other
//! is by surface area.

use std::ops::Range;

use glam::DVec3;
use kernel::{Aabb, Ray};

use super::world::index;

/// Boxes are this much larger than what they hold, relative to their coordinates.
const PADDING: f64 = 1e-12;

/// Bins of the surface area heuristic.
const BINS: usize = 16;

/// How a list of boxes is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rule {
    /// Sorted along the axis of greatest extent and halved \[Martin 2000\].
    Median,
    /// At the cut with the least sum of areas times counts.
    Area,
}

#[derive(Debug)]
struct Node {
    bounds: Aabb,
    /// The child that follows another node, or nothing for a leaf.
    second: Option<u32>,
    /// Number of the box of a leaf.
    item: u32,
}

/// The hierarchy; each leaf holds one box.
#[derive(Debug)]
pub(super) struct Boxes {
    nodes: Vec<Node>,
}

/// Nodes that wait for a ray.
#[derive(Debug, Default)]
pub(super) struct Stack(Vec<(u32, f64)>);

impl Boxes {
    pub(super) fn build(boxes: &[Aabb], rule: Rule) -> Self {
        let mut order: Vec<u32> = (0..index(boxes.len())).collect();
        let mut tree = Self { nodes: Vec::new() };
        if !boxes.is_empty() {
            tree.add(boxes, &mut order, rule);
        }
        tree
    }

    fn add(&mut self, boxes: &[Aabb], order: &mut [u32], rule: Rule) {
        let all = |order: &[u32]| {
            let parts = order.iter().map(|&k| boxes[k as usize]);
            parts.fold(Aabb::EMPTY, Aabb::union)
        };
        let bounds = all(order);
        let pad = DVec3::splat(PADDING * bounds.min.abs().max(bounds.max.abs()).max_element());
        let place = self.nodes.len();
        self.nodes.push(Node {
            bounds: Aabb {
                min: bounds.min - pad,
                max: bounds.max + pad,
            },
            second: None,
            item: order[0],
        });
        if order.len() == 1 {
            return;
        }
        let middle = |k: u32| boxes[k as usize].center();
        let axis = match rule {
            Rule::Median => bounds.size().max_position(),
            Rule::Area => {
                let centers = Aabb::around(order.iter().map(|&k| middle(k)));
                centers.size().max_position()
            }
        };
        order.sort_unstable_by(|&a, &b| middle(a)[axis].total_cmp(&middle(b)[axis]));
        let cut = match rule {
            Rule::Median => order.len() / 2,
            Rule::Area => best_cut(boxes, order),
        };
        let (left, right) = order.split_at_mut(cut);
        self.add(boxes, left, rule);
        self.nodes[place].second = Some(index(self.nodes.len()));
        self.add(boxes, right, rule);
    }

    /// Visits the boxes that a ray passes within `range`, from near to far; `leaf` may lower
    /// its end.
    pub(super) fn visit(
        &self,
        ray: &Ray,
        range: &mut Range<f64>,
        stack: &mut Stack,
        mut leaf: impl FnMut(u32, &mut Range<f64>),
    ) {
        // Never infinite times zero.
        let step = |d: f64| if d == 0.0 { f64::MIN_POSITIVE } else { d };
        let [x, y, z] = ray.direction.to_array().map(step);
        let inverse = DVec3::new(x, y, z).recip().min(DVec3::MAX);
        let enter = |node: u32| {
            let bounds = &self.nodes[node as usize].bounds;
            let (a, b) = (
                (bounds.min - ray.origin) * inverse,
                (bounds.max - ray.origin) * inverse,
            );
            (a.min(b).max_element(), a.max(b).min_element())
        };
        let stack = &mut stack.0;
        stack.clear();
        if !self.nodes.is_empty() {
            stack.push((0, f64::NEG_INFINITY));
        }
        while let Some((number, near)) = stack.pop() {
            if near > range.end {
                continue;
            }
            let node = &self.nodes[number as usize];
            let Some(second) = node.second else {
                leaf(node.item, range);
                continue;
            };
            let mut children = [number + 1, second].map(|child| (child, enter(child)));
            if children[0].1.0 < children[1].1.0 {
                children.swap(0, 1);
            }
            for (child, (near, far)) in children {
                if near <= far && far >= range.start && near <= range.end {
                    stack.push((child, near));
                }
            }
        }
    }
}

/// How many of the sorted boxes come before the cheapest of a few cuts.
fn best_cut(boxes: &[Aabb], order: &[u32]) -> usize {
    let area = |b: &Aabb| {
        let size = b.size();
        size.x * size.y + size.y * size.z + size.z * size.x
    };
    let grow = |all: Aabb, part: &[u32]| part.iter().fold(all, |b, &k| b.union(boxes[k as usize]));
    let bins = BINS.min(order.len());
    let cut = |bin: usize| bin * order.len() / bins;
    let mut behind = vec![Aabb::EMPTY; bins + 1];
    for bin in (1..bins).rev() {
        behind[bin] = grow(behind[bin + 1], &order[cut(bin)..cut(bin + 1)]);
    }
    let (mut best, mut before) = ((f64::INFINITY, order.len() / 2), Aabb::EMPTY);
    for bin in 1..bins {
        before = grow(before, &order[cut(bin - 1)..cut(bin)]);
        let counts = [cut(bin), order.len() - cut(bin)].map(|n| n as f64);
        let cost = counts[0] * area(&before) + counts[1] * area(&behind[bin]);
        if cost < best.0 {
            best = (cost, cut(bin));
        }
    }
    best.1
}
