//! One ray on its way through both levels, from cell to cell.

use std::ops::Range;

use kernel::Ray;

use super::Accelerator;
use super::block::{Block, Encounter};
use super::cells::Cell;
use super::tree::{Course, LocalRay, WIDTH};
use crate::simd::Simd;

/// What a ray comes to.
#[derive(Clone, Copy, Debug)]
pub(super) enum Stop {
    /// An instance, of which the triangles are not searched.
    Instance,
    /// A cell of the instance at hand, which it may meet, and its slot if it is a part of the coarse one.
    Cell(Cell, Option<usize>),
    /// Nothing any more.
    End,
}

/// A ray that goes on from where it stopped.
#[derive(Debug)]
pub(super) struct Walker {
    /// The instance at hand, and the ray in the coordinates of its hierarchy.
    pub(super) instance: u32,
    pub(super) course: Course,
    /// The block at hand.
    block: usize,
    /// Instances that come next.
    instances: Range<usize>,
    top_ray: LocalRay,
    top_stack: Vec<(u32, f32)>,
    pub(super) ray: LocalRay,
    stack: Vec<(u32, f32)>,
    found: Encounters,
    /// A coarse cell of the block, its parts, and what may be met of them.
    pub(super) coarse: Cell,
    parts: [Cell; WIDTH],
    found_parts: Encounters,
}

/// What a ray may meet in a block, nearest first.
#[derive(Debug)]
struct Encounters {
    found: [Encounter; WIDTH],
    next: usize,
    count: usize,
}

impl Encounters {
    const NONE: Self = Self {
        found: [Encounter::NONE; WIDTH],
        next: 0,
        count: 0,
    };

    #[inline(always)]
    fn clear(&mut self) {
        (self.next, self.count) = (0, 0);
    }

    /// Begins with a block.
    #[inline(always)]
    fn begin<S: Simd>(&mut self, s: S, block: &Block, ray: &LocalRay, range: &Range<f32>) {
        self.next = 0;
        self.count = block.meet(s, ray, range, &mut self.found);
    }

    /// The slot of the next cell.
    #[inline(always)]
    fn next(&mut self, range: &Range<f32>) -> Option<usize> {
        while self.next < self.count {
            let encounter = &self.found[self.next];
            self.next += 1;
            // What was found in the cells before bounds the rest.
            if encounter.near <= range.end {
                return Some(encounter.slot);
            }
        }
        None
    }
}

impl Default for Walker {
    fn default() -> Self {
        Self {
            instance: 0,
            course: Course::NONE,
            block: 0,
            instances: 0..0,
            top_ray: LocalRay::from(&Course::NONE),
            top_stack: Vec::new(),
            ray: LocalRay::from(&Course::NONE),
            stack: Vec::new(),
            found: Encounters::NONE,
            coarse: Cell::NONE,
            parts: [Cell::NONE; WIDTH],
            found_parts: Encounters::NONE,
        }
    }
}

impl Walker {
    /// Begins with another ray.
    #[inline(always)]
    pub(super) fn begin(&mut self, accelerator: &Accelerator<'_>, ray: &Ray) {
        self.top_stack.clear();
        self.instance = 0;
        // One alone needs no hierarchy.
        if let [_] = accelerator.instances[..] {
            self.instances = 0..1;
        } else {
            self.instances = 0..0;
            self.top_ray = accelerator.top.local_ray(ray);
            accelerator.top.begin(&mut self.top_stack);
        }
        self.stack.clear();
        self.found.clear();
        self.found_parts.clear();
    }

    /// Goes on with the parts of the coarse cell that it came to.
    #[inline(always)]
    pub(super) fn divide<S: Simd>(
        &mut self,
        s: S,
        (coarse, parts): (&Cell, &Block),
        range: &Range<f64>,
    ) {
        (self.coarse, self.parts) = (*coarse, parts.cells);
        self.found_parts
            .begin(s, parts, &self.ray, &self.ray.range(range));
    }

    /// Goes on to what the ray may meet next within `range`.
    #[inline(always)]
    pub(super) fn go_on<S: Simd>(
        &mut self,
        s: S,
        accelerator: &Accelerator<'_>,
        ray: &Ray,
        range: &Range<f64>,
    ) -> Stop {
        let local = self.ray.range(range);
        loop {
            if let Some(slot) = self.found_parts.next(&local) {
                return Stop::Cell(self.parts[slot], Some(slot));
            }
            if let Some(slot) = self.found.next(&local) {
                let instance = &accelerator.instances[self.instance as usize];
                let cluster = &accelerator.clusters[instance.cluster as usize];
                return Stop::Cell(cluster.blocks[self.block].cells[slot], None);
            }
            if !self.stack.is_empty() {
                let instance = &accelerator.instances[self.instance as usize];
                let cluster = &accelerator.clusters[instance.cluster as usize];
                let leaf = cluster
                    .tree
                    .next_leaf(s, &self.ray, &local, &mut self.stack, 0);
                if let Some(number) = leaf {
                    self.block = number;
                    let block = &cluster.blocks[number];
                    self.found.begin(s, block, &self.ray, &local);
                    continue;
                }
            }
            let Some(number) = self.instances.next() else {
                let top = &accelerator.top;
                let local = self.top_ray.range(range);
                match top.next_leaf(s, &self.top_ray, &local, &mut self.top_stack, 0) {
                    Some(leaf) => self.instances = top.leaf(leaf),
                    None => return Stop::End,
                }
                continue;
            };
            self.enter(accelerator, ray, number);
            return Stop::Instance;
        }
    }

    /// Begins with an instance.
    #[inline(always)]
    fn enter(&mut self, accelerator: &Accelerator<'_>, ray: &Ray, number: usize) {
        let instance = &accelerator.instances[number];
        let cluster = &accelerator.clusters[instance.cluster as usize];
        self.instance = u32::try_from(number).expect("fewer instances than fit");
        self.course = cluster
            .tree
            .course(&ray.transformed(&instance.cluster_from_world));
        self.ray = LocalRay::from(&self.course);
        cluster.tree.begin(&mut self.stack);
    }
}
