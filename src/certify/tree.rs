//! A plain hierarchy of boxes, tested in double precision with outward rounding.

use kernel::{Interval, Ray};

/// A box in the world.
pub(super) type Bounds = [Interval; 3];

#[derive(Debug)]
pub(super) struct Node {
    bounds: Bounds,
    content: Content,
}

/// What a node of the hierarchy holds.
#[derive(Clone, Copy, Debug)]
pub(super) enum Content {
    Children([u32; 2]),
    Leaf(u32),
}

/// The hierarchy; the root comes last.
#[derive(Debug, Default)]
pub(super) struct Tree {
    nodes: Vec<Node>,
}

impl Tree {
    /// Divides at the median along the widest axis.
    pub(super) fn build(boxes: &[Bounds]) -> Self {
        let count = u32::try_from(boxes.len()).expect("a scene has fewer than 2^32 pieces");
        let mut order: Vec<u32> = (0..count).collect();
        let mut tree = Self::default();
        if !order.is_empty() {
            tree.add(boxes, &mut order);
        }
        tree
    }

    fn add(&mut self, boxes: &[Bounds], order: &mut [u32]) -> u32 {
        let bounds = |k: u32| boxes[k as usize];
        let all = order[1..].iter().fold(bounds(order[0]), |all, &k| {
            let other = bounds(k);
            std::array::from_fn(|axis| all[axis].hull(other[axis]))
        });
        let content = if order.len() == 1 {
            Content::Leaf(order[0])
        } else {
            let widest = (0..3)
                .max_by(|&a, &b| all[a].width().total_cmp(&all[b].width()))
                .unwrap_or(0);
            let middle = order.len() / 2;
            let place = |k: u32| bounds(k)[widest].middle();
            order.select_nth_unstable_by(middle, |&a, &b| place(a).total_cmp(&place(b)));
            let (left, right) = order.split_at_mut(middle);
            Content::Children([self.add(boxes, left), self.add(boxes, right)])
        };
        self.nodes.push(Node {
            bounds: all,
            content,
        });
        u32::try_from(self.nodes.len() - 1).expect("fewer nodes than twice the pieces")
    }

    /// The number of the root, unless the tree is empty.
    pub(super) fn root(&self) -> Option<u32> {
        u32::try_from(self.nodes.len()).ok()?.checked_sub(1)
    }

    pub(super) fn content(&self, node: u32) -> Content {
        self.nodes[node as usize].content
    }

    /// Where the ray enters the box of a node, from below; `None` if it misses it or leaves
    /// it behind.
    pub(super) fn entry(&self, node: u32, ray: &Ray) -> Option<f64> {
        let mut passage = Interval::new(0.0, f64::INFINITY);
        for axis in 0..3 {
            let side = self.nodes[node as usize].bounds[axis];
            let (origin, direction) = (ray.origin[axis], ray.direction[axis]);
            if direction == 0.0 {
                if !side.contains(origin) {
                    return None;
                }
            } else {
                let way = (side - Interval::point(origin)) / Interval::point(direction);
                passage = passage.intersection(way)?;
            }
        }
        Some(passage.low())
    }
}
