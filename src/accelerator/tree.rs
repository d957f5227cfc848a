//! The hierarchy of boxes, eight wide.
//!
//! Boxes are single precision, rounded outwards and padded for the rounding of rays; the
//! eight boxes of a node lie side by side so that one instruction can test many.

use std::ops::Range;

use glam::{DAffine3, DMat3, DVec3, Vec3A};
use kernel::{Aabb, Ray};

use crate::simd::Simd;

/// Children of a node.
pub(crate) const WIDTH: usize = 8;

/// Bins of the surface area heuristic.
const BINS: usize = 16;

/// Marks a child as a leaf; the other bits are its number.
pub(super) const IS_LEAF: u32 = 1 << 31;

/// Padding of boxes in a tree of size one: what single precision rays may stray, sixteen
/// roundings wide.
const PADDING: f64 = 16.0 / (1 << 24) as f64;

/// Relative error of a distance to a box: a few roundings in single precision.
const ROUNDING: f32 = 8.0 / (1 << 24) as f32;

#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Node {
    pub(super) min: [[f32; WIDTH]; 3],
    pub(super) max: [[f32; WIDTH]; 3],
    pub(super) child: [u32; WIDTH],
}

/// A hierarchy over boxes. The primitives are numbered anew, in the order of the leaves.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    bounds: Aabb,
    /// The tree's own coordinates are `(x - center) * scale`: from -1 to 1.
    center: DVec3,
    scale: f64,
    /// The primitives of each leaf, in the new order.
    leaves: Vec<(u32, u32)>,
}

/// A ray as the tree sees it: with its origin near the tree and a direction of length one,
/// in the tree's coordinates and in single precision.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalRay {
    pub(crate) origin: [f32; 3],
    pub(crate) direction: [f32; 3],
    inverse: [f32; 3],
    /// The ray parameter of the origin, and how many units of the tree one of it is.
    shift: f64,
    pace: f64,
}

impl LocalRay {
    /// How far from the origin a ray parameter is, in units of the tree.
    #[inline(always)]
    pub(crate) fn length(&self, t: f64) -> f64 {
        (t - self.shift) * self.pace
    }

    /// A range of the ray parameter in units of the tree, rounded outwards.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounded outwards in the next line"
    )]
    pub(crate) fn range(&self, range: &Range<f64>) -> Range<f32> {
        let local = |t: f64| self.length(t) as f32;
        let (start, end) = (local(range.start), local(range.end));
        let grown = |t: f32| t.abs() * ROUNDING + f32::MIN_POSITIVE;
        start - grown(start)..end + grown(end)
    }
}

/// A ray in the coordinates of a tree: its origin near the middle, and a direction of length
/// one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Course {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    /// The ray parameter of the origin, and how many units of the tree one of it is.
    pub(crate) shift: f64,
    pub(crate) pace: f64,
}

impl Course {
    /// That of no ray.
    pub(crate) const NONE: Self = Self {
        origin: DVec3::ZERO,
        direction: DVec3::X,
        shift: 0.0,
        pace: 1.0,
    };

    /// The ray parameter at a length from the origin.
    #[inline(always)]
    pub(crate) fn time(&self, length: f64) -> f64 {
        self.shift + length / self.pace
    }
}

impl From<&Course> for LocalRay {
    #[inline(always)]
    fn from(course: &Course) -> Self {
        Self {
            origin: single(course.origin),
            direction: single(course.direction),
            inverse: single(course.direction).map(|d| {
                if d.abs() < f32::MIN_POSITIVE {
                    f32::MAX
                } else {
                    d.recip()
                }
            }),
            shift: course.shift,
            pace: course.pace,
        }
    }
}

/// What happens at the leaves that a ray passes.
pub(crate) trait Visitor {
    /// Examines leaf `number`. `range` is still of interest; its end may be lowered. The
    /// result says whether to go on.
    fn leaf(&mut self, number: usize, range: &mut Range<f64>) -> bool;
}

impl Tree {
    /// Builds the hierarchy with at most `fill` primitives in a leaf; the second result is
    /// the old number of each primitive.
    pub(crate) fn build(boxes: &[Aabb], fill: usize) -> (Self, Vec<u32>) {
        Self::pack(boxes, |_| 1, fill)
    }

    /// As [`Self::build`] over primitives that count as many: those of a leaf count at most
    /// `fill` together, unless one alone counts more.
    pub(crate) fn pack(
        boxes: &[Aabb],
        size: impl Fn(usize) -> usize,
        fill: usize,
    ) -> (Self, Vec<u32>) {
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
            leaves: Vec::new(),
        };
        let own = |k: usize, b: &Aabb| Primitive {
            bounds: Bounds::around(tree.to_local(b.min), tree.to_local(b.max)),
            number: u32::try_from(k).expect("a scene has fewer than 2^32 cells"),
            size: u32::try_from(size(k)).expect("as many cells as are kept together"),
        };
        let mut primitives: Vec<_> = boxes.iter().enumerate().map(|(k, b)| own(k, b)).collect();
        if !boxes.is_empty() {
            let part = Part::of(&primitives, 0..boxes.len());
            tree.add_node(
                &mut Builder {
                    primitives: &mut primitives,
                    fill,
                },
                part,
            );
        }
        (tree, primitives.iter().map(|p| p.number).collect())
    }

    /// The box around everything.
    pub(crate) fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The boxes of the uppermost levels, about `most`: tighter than the one box around all.
    pub(crate) fn outline(&self, most: usize) -> Vec<Aabb> {
        let children = |node: &Node| -> Vec<(Aabb, u32)> {
            let own = (0..WIDTH).map(|k| (self.child_box(node, k), node.child[k]));
            own.filter(|(b, _)| !b.is_empty()).collect()
        };
        let is_node = |child: u32| child & IS_LEAF == 0 && child != 0;
        let mut all: Vec<_> = self.nodes.iter().take(1).flat_map(children).collect();
        while all.len() * WIDTH <= most && all.iter().any(|(_, child)| is_node(*child)) {
            let split = |(own, child)| match is_node(child) {
                true => children(&self.nodes[child as usize]),
                false => vec![(own, child)],
            };
            all = all.into_iter().flat_map(split).collect();
        }
        all.into_iter().map(|(own, _)| own).collect()
    }

    /// A child's box in the coordinates of the primitives.
    fn child_box(&self, node: &Node, k: usize) -> Aabb {
        let corner = |side: &[[f32; WIDTH]; 3]| {
            let [x, y, z] = [0, 1, 2].map(|axis| f64::from(side[axis][k]));
            self.center + DVec3::new(x, y, z) / self.scale
        };
        Aabb {
            min: corner(&node.min),
            max: corner(&node.max),
        }
    }

    /// Memory of the nodes.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.leaves[..])
    }

    /// How many units of the tree one unit of its primitives is.
    pub(crate) fn scale(&self) -> f64 {
        self.scale
    }

    /// Whether there is nothing in it.
    pub(super) fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Node number `k`, the root first.
    pub(super) fn node(&self, k: u32) -> &Node {
        &self.nodes[k as usize]
    }

    /// The map to the tree's own coordinates.
    pub(super) fn map(&self) -> DAffine3 {
        DAffine3 {
            matrix3: DMat3::from_diagonal(DVec3::splat(self.scale)),
            translation: -self.center * self.scale,
        }
    }

    /// A point in the tree's own coordinates.
    pub(crate) fn to_local(&self, point: DVec3) -> DVec3 {
        (point - self.center) * self.scale
    }

    /// Number of leaves.
    pub(crate) fn leaf_count(&self) -> usize {
        self.leaves.len()
    }

    /// The primitives of a leaf, in the new order.
    pub(crate) fn leaf(&self, number: usize) -> Range<usize> {
        let (start, end) = self.leaves[number];
        start as usize..end as usize
    }

    /// The ray as the tree sees it.
    #[inline(always)]
    pub(crate) fn local_ray(&self, ray: &Ray) -> LocalRay {
        LocalRay::from(&self.course(ray))
    }

    /// The ray in the coordinates of the tree.
    #[inline(always)]
    pub(crate) fn course(&self, ray: &Ray) -> Course {
        let length = ray.direction.length();
        let inverse = length.recip();
        let direction = ray.direction * inverse;
        let shift = (self.center - ray.origin).dot(direction) * inverse;
        Course {
            origin: self.to_local(ray.at(shift)),
            direction,
            shift,
            pace: length * self.scale,
        }
    }

    fn add_node(&mut self, builder: &mut Builder<'_>, part: Part) -> u32 {
        // Divide the widest part again and again until there are eight.
        let mut parts = [const { None::<Part> }; WIDTH];
        parts[0] = Some(part);
        for free in 1..WIDTH {
            let wide = |part: &Option<Part>| {
                let part = part.as_ref()?;
                (!builder.fits(part)).then_some(part.area)
            };
            let widest = (0..free)
                .filter_map(|k| Some((k, wide(&parts[k])?)))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((widest, _)) = widest else { break };
            if let Some(part) = parts[widest].take() {
                let (left, right) = builder.divide(&part);
                (parts[widest], parts[free]) = (Some(left), Some(right));
            }
        }
        let index = self.nodes.len();
        self.nodes.push(Node {
            min: [[f32::INFINITY; WIDTH]; 3],
            max: [[f32::NEG_INFINITY; WIDTH]; 3],
            child: [0; WIDTH],
        });
        for (k, part) in parts.into_iter().flatten().enumerate() {
            for axis in 0..3 {
                self.nodes[index].min[axis][k] = part.bounds.min[axis];
                self.nodes[index].max[axis][k] = part.bounds.max[axis];
            }
            let child = if builder.fits(&part) {
                self.add_leaf(&part.range)
            } else {
                self.add_node(builder, part)
            };
            self.nodes[index].child[k] = child;
        }
        assert!(index < 1 << 28, "so that all boxes have numbers");
        u32::try_from(index).expect("fewer nodes than cells")
    }

    fn add_leaf(&mut self, part: &Range<usize>) -> u32 {
        let single = |k: usize| u32::try_from(k).expect("fewer primitives than fit");
        self.leaves.push((single(part.start), single(part.end)));
        let number = single(self.leaves.len() - 1);
        assert!(number < IS_LEAF, "a scene has fewer than 2^31 leaves");
        number | IS_LEAF
    }

    /// Visits the leaves that the ray passes within `range`, roughly from near to far.
    #[inline(always)]
    pub(crate) fn traverse<S: Simd>(
        &self,
        s: S,
        ray: &LocalRay,
        range: &mut Range<f64>,
        stack: &mut Vec<(u32, f32)>,
        visitor: &mut impl Visitor,
    ) {
        let base = stack.len();
        self.begin(stack);
        let mut local = ray.range(range);
        while let Some(number) = self.next_leaf(s, ray, &local, stack, base) {
            if !visitor.leaf(number, range) {
                stack.truncate(base);
                return;
            }
            local = ray.range(range);
        }
    }

    /// Puts the root on a stack.
    #[inline(always)]
    pub(crate) fn begin(&self, stack: &mut Vec<(u32, f32)>) {
        if !self.nodes.is_empty() {
            stack.push((0, f32::NEG_INFINITY));
        }
    }

    /// The next leaf that the ray passes within `range`, roughly from near to far; what is
    /// still to be searched is on the stack above `base`.
    #[inline(always)]
    pub(crate) fn next_leaf<S: Simd>(
        &self,
        s: S,
        ray: &LocalRay,
        range: &Range<f32>,
        stack: &mut Vec<(u32, f32)>,
        base: usize,
    ) -> Option<usize> {
        while stack.len() > base {
            let (child, near) = stack.pop()?;
            if near > range.end {
                continue;
            }
            if child & IS_LEAF != 0 {
                return Some((child & !IS_LEAF) as usize);
            }
            let node = &self.nodes[child as usize];
            let (near, mut mask) = node.slabs(s, ray, range);
            let first = stack.len();
            while mask != 0 {
                let k = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                // Keep the nearest on top: few children, so insertion is quickest.
                let entry = (node.child[k], near[k]);
                stack.push(entry);
                let mut place = stack.len() - 1;
                while place > first && stack[place - 1].1 < entry.1 {
                    stack[place] = stack[place - 1];
                    place -= 1;
                }
                stack[place] = entry;
            }
        }
        None
    }
}

impl Node {
    /// Where the ray enters each of the eight boxes, and a bit for each that it passes within
    /// `range`.
    #[inline(always)]
    fn slabs<S: Simd>(&self, s: S, ray: &LocalRay, range: &Range<f32>) -> ([f32; WIDTH], u32) {
        let (mut near, mut far) = (s.splat(f32::NEG_INFINITY), s.splat(f32::INFINITY));
        for axis in 0..3 {
            // By the sign of the ray, so that the inverted box of no child is never entered.
            let sides = [&self.min[axis], &self.max[axis]];
            let back = usize::from(ray.inverse[axis] < 0.0);
            let (o, inverse) = (s.splat(ray.origin[axis]), s.splat(ray.inverse[axis]));
            let [entry, exit] = [s.load_half(sides[back]), s.load_half(sides[1 - back])];
            near = s.max(s.mul(s.sub(entry, o), inverse), near);
            far = s.min(s.mul(s.sub(exit, o), inverse), far);
        }
        let rounding = s.splat(ROUNDING);
        near = s.fnma(s.abs(near), rounding, near);
        far = s.fma(s.abs(far), rounding, far);
        let passes = s.bits(s.le(near, far))
            & s.bits(s.le(near, s.splat(range.end)))
            & s.bits(s.le(s.splat(range.start), far));
        let mut start = [0.0; WIDTH];
        s.store_half(near, &mut start);
        (start, passes & ((1 << WIDTH) - 1))
    }
}

/// A box in the coordinates of a tree, padded and rounded outwards.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    min: Vec3A,
    max: Vec3A,
}

impl Bounds {
    const EMPTY: Self = Self {
        min: Vec3A::INFINITY,
        max: Vec3A::NEG_INFINITY,
    };

    fn around(min: DVec3, max: DVec3) -> Self {
        let outside = |v: DVec3| Vec3A::from_array((v - PADDING).to_array().map(below));
        Self {
            min: outside(min),
            max: -outside(-max),
        }
    }

    fn union(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// Twice its center.
    fn middle(&self) -> Vec3A {
        self.min + self.max
    }

    fn half_area(&self) -> f32 {
        let size = self.max - self.min;
        size.x * size.y + size.y * size.z + size.z * size.x
    }
}

/// What a hierarchy is built over.
#[derive(Clone, Copy, Debug)]
struct Primitive {
    bounds: Bounds,
    number: u32,
    /// How many it counts as.
    size: u32,
}

struct Builder<'a> {
    primitives: &'a mut [Primitive],
    fill: usize,
}

/// Primitives that belong together.
struct Part {
    range: Range<usize>,
    size: usize,
    bounds: Bounds,
    area: f32,
}

impl Part {
    /// The primitives of a range.
    fn of(primitives: &[Primitive], range: Range<usize>) -> Self {
        let (mut size, mut bounds) = (0, Bounds::EMPTY);
        for primitive in &primitives[range.clone()] {
            size += primitive.size as usize;
            bounds = bounds.union(primitive.bounds);
        }
        Self {
            range,
            size,
            bounds,
            area: bounds.half_area(),
        }
    }
}

impl Builder<'_> {
    /// Whether a part is a leaf.
    fn fits(&self, part: &Part) -> bool {
        part.size <= self.fill || part.range.len() == 1
    }

    /// Sorts a part into two by the surface area heuristic.
    fn divide(&mut self, part: &Part) -> (Part, Part) {
        let primitives = &mut self.primitives[part.range.clone()];
        let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        for primitive in primitives.iter() {
            let middle = primitive.bounds.middle();
            (low, high) = (low.min(middle), high.max(middle));
        }
        let axis = (high - low).max_position();
        let (low, width) = (low[axis], (high - low)[axis]);
        let mut border = primitives.len() / 2;
        if width > 0.0 {
            let scale = BINS as f32 / width;
            let place = |p: &Primitive| (p.bounds.middle()[axis] - low) * scale;
            if let Some(cut) = best_cut(primitives, place) {
                let (mut left, mut right) = (0, primitives.len());
                while left < right {
                    if place(&primitives[left]) < cut {
                        left += 1;
                    } else {
                        right -= 1;
                        primitives.swap(left, right);
                    }
                }
                border = left;
            }
        }
        let Range { start, end } = part.range;
        let half = |range| Part::of(self.primitives, range);
        (half(start..start + border), half(start + border..end))
    }
}

/// Where to cut primitives into two by their places, which are from zero to [`BINS`]; `None`
/// where they cannot be told apart.
fn best_cut(primitives: &[Primitive], place: impl Fn(&Primitive) -> f32) -> Option<f32> {
    let mut bins = [(0_u32, Bounds::EMPTY); BINS];
    for primitive in primitives {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "never negative; what is not a number becomes zero"
        )]
        let bin = &mut bins[(place(primitive) as usize).min(BINS - 1)];
        *bin = (bin.0 + 1, bin.1.union(primitive.bounds));
    }
    // The cost of what lies behind each cut, then of both sides: areas times counts.
    let mut behind = [0.0; BINS];
    let (mut count, mut bounds) = (0, Bounds::EMPTY);
    for cut in (1..BINS).rev() {
        (count, bounds) = (count + bins[cut].0, bounds.union(bins[cut].1));
        behind[cut] = count as f32 * bounds.half_area();
    }
    let mut best: Option<(f32, f32)> = None;
    let (mut before, mut bounds) = (0, Bounds::EMPTY);
    for cut in 1..BINS {
        (before, bounds) = (before + bins[cut - 1].0, bounds.union(bins[cut - 1].1));
        if before == 0 || before as usize == primitives.len() {
            continue;
        }
        let cost = before as f32 * bounds.half_area() + behind[cut];
        if best.is_none_or(|(least, _)| cost < least) {
            best = Some((cost, cut as f32));
        }
    }
    best.map(|(_, cut)| cut)
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
