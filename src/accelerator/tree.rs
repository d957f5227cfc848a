//! The hierarchy of boxes, eight wide.
//!
//! Boxes are single precision, rounded outwards and padded for the rounding of rays; the
//! eight boxes of a node lie side by side so that one instruction can test many.

use std::ops::Range;

use glam::DVec3;
use kernel::{Aabb, Ray};

/// Children of a node.
const WIDTH: usize = 8;

/// Primitives that are not divided further.
const LEAF: usize = 2;

/// Most primitives of a leaf whose boxes cannot be told apart.
const MAX_LEAF: usize = 1 << LEAF_BITS;
const LEAF_BITS: u32 = 5;

/// Bins of the surface area heuristic.
const BINS: usize = 16;

/// Marks a child as a leaf: then the lower bits count its primitives less one, and the
/// others number the first.
const IS_LEAF: u32 = 1 << 31;

/// Padding of boxes in a tree of size one: what single precision rays may stray, sixteen
/// roundings wide.
const PADDING: f64 = 16.0 / (1 << 24) as f64;

/// Relative error of a distance to a box: a few roundings in single precision.
const ROUNDING: f32 = 8.0 / (1 << 24) as f32;

#[derive(Clone, Debug)]
#[repr(align(64))]
struct Node {
    min: [[f32; WIDTH]; 3],
    max: [[f32; WIDTH]; 3],
    child: [u32; WIDTH],
}

/// A hierarchy over boxes. The primitives are numbered anew, in the order of the leaves.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    bounds: Aabb,
    /// The tree's own coordinates are `(x - center) * scale`: from -1 to 1.
    center: DVec3,
    scale: f64,
}

/// A ray as the tree sees it: near the tree, in single precision.
struct LocalRay {
    origin: [f32; 3],
    inverse: [f32; 3],
}

impl Tree {
    /// Builds the hierarchy; the second result is the old number of each primitive.
    pub(crate) fn build(boxes: &[Aabb]) -> (Self, Vec<u32>) {
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
        let center = if bounds.is_empty() {
            DVec3::ZERO
        } else {
            bounds.center()
        };
        let radius = bounds.diagonal() * 0.5;
        let scale = if radius > 0.0 { radius.recip() } else { 1.0 };
        let mut tree = Self {
            nodes: Vec::new(),
            bounds,
            center,
            scale,
        };
        let count = u32::try_from(boxes.len()).expect("a scene has fewer than 2^32 cells");
        let mut builder = Builder {
            boxes,
            centers: boxes.iter().map(Aabb::center).collect(),
            order: (0..count).collect(),
        };
        if !boxes.is_empty() {
            tree.add_node(&mut builder, 0..boxes.len());
        }
        (tree, builder.order)
    }

    /// The box around everything.
    pub(crate) fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Memory of the nodes.
    pub(crate) fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>()
    }

    fn add_node(&mut self, builder: &mut Builder<'_>, range: Range<usize>) -> u32 {
        // Divide the widest part again and again until there are eight.
        let mut parts = vec![range];
        while parts.len() < WIDTH {
            let widest = (0..parts.len())
                .filter(|&k| parts[k].len() > LEAF)
                .max_by(|&a, &b| builder.area(&parts[a]).total_cmp(&builder.area(&parts[b])));
            let Some(widest) = widest else { break };
            let part = parts[widest].clone();
            let middle = builder.divide(part.clone());
            parts[widest] = part.start..middle;
            parts.insert(widest + 1, middle..part.end);
        }
        let index = self.nodes.len();
        self.nodes.push(Node {
            min: [[f32::INFINITY; WIDTH]; 3],
            max: [[f32::NEG_INFINITY; WIDTH]; 3],
            child: [0; WIDTH],
        });
        for (k, part) in parts.into_iter().enumerate() {
            let bounds = builder.bounds(&part);
            for axis in 0..3 {
                let low = (bounds.min[axis] - self.center[axis]) * self.scale;
                let high = (bounds.max[axis] - self.center[axis]) * self.scale;
                self.nodes[index].min[axis][k] = below(low - PADDING);
                self.nodes[index].max[axis][k] = -below(-high - PADDING);
            }
            let small = part.len() <= MAX_LEAF && builder.coincide(&part);
            let child = if part.len() <= LEAF || small {
                leaf(&part)
            } else {
                self.add_node(builder, part)
            };
            self.nodes[index].child[k] = child;
        }
        u32::try_from(index).expect("fewer nodes than cells")
    }

    /// Visits the leaves that the ray passes within `range`, roughly from near to far.
    ///
    /// `visit` gets a run of primitives and the range that is still of interest, whose end
    /// it may lower; it returns whether to go on.
    pub(crate) fn traverse(
        &self,
        ray: &Ray,
        range: &mut Range<f64>,
        stack: &mut Vec<(u32, f64)>,
        mut visit: impl FnMut(Range<usize>, &mut Range<f64>) -> bool,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        // Move the origin next to the tree, so that single precision suffices.
        let length = ray.direction.length();
        let shift = (self.center - ray.origin).dot(ray.direction / length) / length;
        let unit = (length * self.scale).recip();
        let local = LocalRay {
            origin: single((ray.at(shift) - self.center) * self.scale),
            inverse: single(ray.direction / length).map(|d| {
                if d.abs() < f32::MIN_POSITIVE {
                    f32::MAX
                } else {
                    d.recip()
                }
            }),
        };
        let base = stack.len();
        stack.push((0, f64::NEG_INFINITY));
        while stack.len() > base {
            let Some((child, near)) = stack.pop() else {
                break;
            };
            if near > range.end {
                continue;
            }
            if child & IS_LEAF != 0 {
                let first = ((child & !IS_LEAF) >> LEAF_BITS) as usize;
                let count = (child as usize & (MAX_LEAF - 1)) + 1;
                if !visit(first..first + count, range) {
                    stack.truncate(base);
                    return;
                }
                continue;
            }
            let node = &self.nodes[child as usize];
            let (near, far) = node.slabs(&local);
            let first = stack.len();
            for k in 0..WIDTH {
                let near = f64::from(near[k]) * unit + shift;
                let far = f64::from(far[k]) * unit + shift;
                if near <= far && near <= range.end && far >= range.start {
                    stack.push((node.child[k], near));
                }
            }
            // The nearest child comes to the top.
            stack[first..].sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
        }
    }
}

impl Node {
    /// Entry and exit of the ray for all eight boxes.
    fn slabs(&self, ray: &LocalRay) -> ([f32; WIDTH], [f32; WIDTH]) {
        let (mut near, mut far) = ([f32::NEG_INFINITY; WIDTH], [f32::INFINITY; WIDTH]);
        for axis in 0..3 {
            let (o, inverse) = (ray.origin[axis], ray.inverse[axis]);
            // By the sign of the ray, so that the inverted box of no child is never entered.
            let (entry, exit) = if inverse < 0.0 {
                (&self.max[axis], &self.min[axis])
            } else {
                (&self.min[axis], &self.max[axis])
            };
            for k in 0..WIDTH {
                near[k] = near[k].max((entry[k] - o) * inverse);
                far[k] = far[k].min((exit[k] - o) * inverse);
            }
        }
        for k in 0..WIDTH {
            near[k] -= near[k].abs() * ROUNDING;
            far[k] += far[k].abs() * ROUNDING;
        }
        (near, far)
    }
}

struct Builder<'a> {
    boxes: &'a [Aabb],
    centers: Vec<DVec3>,
    order: Vec<u32>,
}

impl Builder<'_> {
    fn bounds(&self, part: &Range<usize>) -> Aabb {
        let boxes = self.order[part.clone()]
            .iter()
            .map(|&k| self.boxes[k as usize]);
        boxes.fold(Aabb::EMPTY, Aabb::union)
    }

    fn area(&self, part: &Range<usize>) -> f64 {
        half_area(&self.bounds(part))
    }

    fn coincide(&self, part: &Range<usize>) -> bool {
        let first = self.centers[self.order[part.start] as usize];
        self.order[part.clone()]
            .iter()
            .all(|&k| self.centers[k as usize] == first)
    }

    /// Sorts a part into two by the surface area heuristic and returns the border.
    fn divide(&mut self, part: Range<usize>) -> usize {
        let Self {
            boxes,
            centers,
            order,
        } = self;
        let order = &mut order[part.clone()];
        let all = Aabb::around(order.iter().map(|&k| centers[k as usize]));
        let axis = all.size().max_position();
        let (low, width) = (all.min[axis], all.size()[axis]);
        if width <= 0.0 || width.is_nan() {
            return part.start + part.len() / 2;
        }
        let bin_of = |k: u32| {
            let place = (centers[k as usize][axis] - low) / width * BINS as f64;
            (0..BINS - 1)
                .rev()
                .find(|&b| place >= (b + 1) as f64)
                .map_or(0, |b| b + 1)
        };
        let mut bins = [(0_usize, Aabb::EMPTY); BINS];
        for &k in order.iter() {
            let bin = &mut bins[bin_of(k)];
            *bin = (bin.0 + 1, bin.1.union(boxes[k as usize]));
        }
        // Cost of cutting before each bin: areas times counts on both sides.
        let mut costs = [0.0; BINS];
        for backwards in [false, true] {
            let (mut count, mut bounds) = (0, Aabb::EMPTY);
            for step in 0..BINS - 1 {
                let bin = if backwards { BINS - 1 - step } else { step };
                count += bins[bin].0;
                bounds = bounds.union(bins[bin].1);
                let cut = if backwards { bin } else { bin + 1 };
                costs[cut] += count as f64 * half_area(&bounds);
            }
        }
        let cut = (1..BINS)
            .min_by(|&a, &b| costs[a].total_cmp(&costs[b]))
            .unwrap_or(1);
        order.sort_by_key(|&k| bin_of(k) >= cut);
        let left = order.partition_point(|&k| bin_of(k) < cut);
        part.start
            + if left == 0 || left == part.len() {
                part.len() / 2
            } else {
                left
            }
    }
}

fn leaf(part: &Range<usize>) -> u32 {
    let first = u32::try_from(part.start).expect("fewer cells than fit");
    let count = u32::try_from(part.len()).expect("leaves are small");
    assert!(
        first < IS_LEAF >> LEAF_BITS,
        "a scene has fewer than 2^26 cells"
    );
    IS_LEAF | first << LEAF_BITS | (count - 1)
}

fn half_area(bounds: &Aabb) -> f64 {
    let size = bounds.size();
    size.x * size.y + size.y * size.z + size.z * size.x
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "rays are rounded; boxes are padded for it"
)]
fn single(v: DVec3) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

/// A single precision number that is not above `x`.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the next line looks after the rounding"
)]
fn below(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x {
        near.next_down()
    } else {
        near
    }
}
