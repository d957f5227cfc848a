//! Boxes in a hierarchy: which of many a ray meets, or a point is in.

use std::ops::ControlFlow;

use glam::DVec3;

use crate::{Aabb, Ray};

/// Boxes of a leaf.
const FILL: usize = 2;

/// Levels of a tree over less than 2^32 boxes, and some.
const LEVELS: usize = 40;

/// A hierarchy of boxes, two wide.
#[derive(Debug)]
pub(super) struct BoxTree {
    /// Numbers of boxes in the order of the leaves.
    order: Vec<u32>,
    nodes: Vec<Node>,
}

/// A leaf if `count` is not zero, else a pair of nodes: the next one, and `first`.
#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Aabb,
    first: u32,
    count: u32,
}

impl BoxTree {
    /// Puts boxes into a tree; they keep their numbers.
    pub(super) fn new(boxes: &[Aabb]) -> Self {
        let count = number(boxes.len());
        let mut order: Vec<u32> = (0..count).collect();
        let mut nodes = Vec::new();
        if count > 0 {
            build(boxes, &mut order, 0, &mut nodes);
        }
        Self { order, nodes }
    }

    /// Gives the numbers of boxes in leaves that contain a point, until one is enough; whether one was.
    pub(super) fn around(&self, point: DVec3, look: impl FnMut(usize) -> ControlFlow<()>) -> bool {
        let is_in = |bounds: &Aabb| bounds.min.cmple(point).all() && point.cmple(bounds.max).all();
        self.visit(is_in, look)
    }

    /// The same of leaves that a ray meets; `inverse` has the reciprocals of its direction, none of which is zero.
    pub(super) fn along(
        &self,
        ray: &Ray,
        inverse: DVec3,
        look: impl FnMut(usize) -> ControlFlow<()>,
    ) -> bool {
        let is_met = |bounds: &Aabb| {
            let (a, b) = (
                (bounds.min - ray.origin) * inverse,
                (bounds.max - ray.origin) * inverse,
            );
            let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
            enter.max(0.0) <= leave
        };
        self.visit(is_met, look)
    }

    #[inline(always)]
    fn visit(
        &self,
        is_met: impl Fn(&Aabb) -> bool,
        mut look: impl FnMut(usize) -> ControlFlow<()>,
    ) -> bool {
        if self.nodes.is_empty() {
            return false;
        }
        // Every level leaves one node behind, and halves what is below it.
        let mut stack = [0_u32; LEVELS];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let at = stack[height];
            let node = &self.nodes[at as usize];
            if !is_met(&node.bounds) {
                continue;
            }
            if node.count == 0 {
                stack[height] = node.first;
                stack[height + 1] = at + 1;
                height += 2;
                continue;
            }
            let (first, count) = (node.first as usize, node.count as usize);
            for &k in &self.order[first..first + count] {
                if look(k as usize).is_break() {
                    return true;
                }
            }
        }
        false
    }
}

/// A number of a box or node.
fn number(k: usize) -> u32 {
    u32::try_from(k).expect("memory ends before 2^32 boxes")
}

/// Appends the nodes over a run of boxes that begins at `first` in the order of all.
fn build(boxes: &[Aabb], order: &mut [u32], first: usize, nodes: &mut Vec<Node>) {
    let all = order.iter().map(|&k| boxes[k as usize]);
    let bounds = all.fold(Aabb::EMPTY, Aabb::union);
    let own = nodes.len();
    let is_leaf = order.len() <= FILL;
    nodes.push(Node {
        bounds,
        first: number(first),
        count: if is_leaf { number(order.len()) } else { 0 },
    });
    if is_leaf {
        return;
    }
    let size = bounds.size();
    let axis = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
    let place = |k: &u32| boxes[*k as usize].center()[axis];
    let half = order.len() / 2;
    order.select_nth_unstable_by(half, |a, b| place(a).total_cmp(&place(b)));
    let (left, right) = order.split_at_mut(half);
    build(boxes, left, first, nodes);
    nodes[own].first = number(nodes.len());
    build(boxes, right, first + half, nodes);
}
