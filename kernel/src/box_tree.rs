//! Boxes in a hierarchy: which of many are near a place, or on the way of a ray.

use std::ops::ControlFlow;

use glam::DVec3;

use crate::{Aabb, Ray};

/// Boxes of a leaf: triangles of meshes are often narrow, and boxes of several of them wide.
const FILL: usize = 2;

/// Levels of a tree over less than 2^32 boxes, and some.
const LEVELS: usize = 40;

/// A hierarchy of boxes, two wide.
#[derive(Debug)]
pub struct BoxTree {
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

impl Node {
    fn distance_squared(&self, p: DVec3) -> f64 {
        p.clamp(self.bounds.min, self.bounds.max)
            .distance_squared(p)
    }
}

impl BoxTree {
    /// Puts boxes into a tree; they keep their numbers.
    ///
    /// # Panics
    /// If there are 2^32 boxes or more.
    pub fn new(boxes: &[Aabb]) -> Self {
        let count = u32::try_from(boxes.len()).expect("memory ends before 2^32 boxes");
        let mut order: Vec<u32> = (0..count).collect();
        let mut nodes = Vec::new();
        if count > 0 {
            build(boxes, &mut order, 0, &mut nodes);
        }
        Self { order, nodes }
    }

    /// A box around all of them.
    pub fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |node| node.bounds)
    }

    /// Goes through the boxes from near to far, those at most `square` from `p`, which is the
    /// square of a distance. `look` is given numbers of boxes, and answers with the square beyond
    /// which nothing is of interest.
    pub fn visit(&self, p: DVec3, mut square: f64, mut look: impl FnMut(u32) -> f64) {
        if self.nodes.is_empty() {
            return;
        }
        // Every level leaves one node behind, and halves what is below it.
        let mut stack = [(0_u32, 0.0_f64); LEVELS];
        let mut filled = 1;
        while filled > 0 {
            filled -= 1;
            let (index, near) = stack[filled];
            if near > square {
                continue;
            }
            let node = self.nodes[index as usize];
            if node.count > 0 {
                let leaf = node.first as usize..(node.first + node.count) as usize;
                for &number in &self.order[leaf] {
                    square = look(number);
                }
                continue;
            }
            let pair = [index + 1, node.first];
            let [a, b] = pair.map(|k| (k, self.nodes[k as usize].distance_squared(p)));
            let (near, far) = if a.1 <= b.1 { (a, b) } else { (b, a) };
            stack[filled] = far;
            stack[filled + 1] = near;
            filled += 2;
        }
    }

    /// Tells the numbers of the boxes that meet another one, and of some beside it.
    pub fn near(&self, other: &Aabb, mut tell: impl FnMut(u32)) {
        self.walk(
            |bounds| bounds.meets(other),
            |number| {
                tell(number);
                ControlFlow::Continue(())
            },
        );
    }

    /// Looks at the boxes that contain a point, and at some beside it, until one is enough; whether one was.
    pub fn around(&self, point: DVec3, look: impl FnMut(u32) -> ControlFlow<()>) -> bool {
        let is_in = |bounds: &Aabb| bounds.min.cmple(point).all() && point.cmple(bounds.max).all();
        self.walk(is_in, look)
    }

    /// The same of boxes that a ray meets; `inverse` has the reciprocals of its direction, none of which is zero.
    pub fn along(
        &self,
        ray: &Ray,
        inverse: DVec3,
        look: impl FnMut(u32) -> ControlFlow<()>,
    ) -> bool {
        let is_met = |bounds: &Aabb| {
            let (a, b) = (
                (bounds.min - ray.origin) * inverse,
                (bounds.max - ray.origin) * inverse,
            );
            let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
            enter.max(0.0) <= leave
        };
        self.walk(is_met, look)
    }

    /// Looks at the boxes of leaves that are met, until one is enough; whether one was.
    #[inline(always)]
    fn walk(
        &self,
        is_met: impl Fn(&Aabb) -> bool,
        mut look: impl FnMut(u32) -> ControlFlow<()>,
    ) -> bool {
        let mut stack = [0_u32; LEVELS];
        let mut filled = usize::from(!self.nodes.is_empty());
        while filled > 0 {
            filled -= 1;
            let index = stack[filled];
            let node = self.nodes[index as usize];
            if !is_met(&node.bounds) {
                continue;
            }
            if node.count > 0 {
                let leaf = node.first as usize..(node.first + node.count) as usize;
                if self.order[leaf]
                    .iter()
                    .any(|&number| look(number).is_break())
                {
                    return true;
                }
                continue;
            }
            (stack[filled], stack[filled + 1]) = (node.first, index + 1);
            filled += 2;
        }
        false
    }
}

/// Adds the node of these boxes, of which the first is number `first` in the order.
fn build(boxes: &[Aabb], order: &mut [u32], first: usize, nodes: &mut Vec<Node>) {
    let own = |k: &u32| boxes[*k as usize];
    let bounds = order.iter().fold(Aabb::EMPTY, |all, k| all.union(own(k)));
    let small = |k: usize| u32::try_from(k).expect("fewer nodes than boxes");
    let index = nodes.len();
    let leaf = order.len() <= FILL;
    nodes.push(Node {
        bounds,
        first: small(first),
        count: if leaf { small(order.len()) } else { 0 },
    });
    if leaf {
        return;
    }
    let middles = Aabb::around(order.iter().map(|k| own(k).center())).size();
    let axis = (0..3)
        .max_by(|&i, &j| middles[i].total_cmp(&middles[j]))
        .unwrap_or(0);
    let half = order.len() / 2;
    order.select_nth_unstable_by(half, |a, b| {
        let key = |k: &u32| own(k).center()[axis];
        key(a).total_cmp(&key(b)).then(a.cmp(b))
    });
    let (left, right) = order.split_at_mut(half);
    build(boxes, left, first, nodes);
    nodes[index].first = small(nodes.len());
    build(boxes, right, first + half, nodes);
}
