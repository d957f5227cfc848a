//! Gaps between neighbouring faces, and what closes them.
//!
//! Files store neighbours apart, each with its own boundary, and these differ by what the
//! program that wrote them thought good enough. A ray can slip in between. Here boundaries
//! that run together within a tolerance are joined by strips; a ray that passes through a
//! strip is taken to have met the first of the two faces there. Where the faces overlap, so that
//! the strip runs along one of them, it must meet no face close by.
//!
//! The other way, to prolong each face by the tolerance, would show more than there is at
//! every free border and silhouette.

mod joints;
#[cfg(test)]
mod tests;

use std::ops::Range;

use glam::DVec3;
use kernel::Ray;
use rayon::prelude::*;
use smallvec::SmallVec;

use super::hull::{Extent, Hull};
use super::strip::{Across, Crossing, Run, Strip};
use super::trace::Rooms;
use super::tree::{Tree, Visitor};
use super::{Accelerator, Cluster, ItemShape, Workspace};
use crate::intersect::Hit;
use crate::simd::{Portable, Simd, Task};

/// Largest gap that is closed where nothing else is said, as a share of the size of what hangs
/// together.
const TOLERANCE: f64 = 1e-4;

/// Gaps below this share of the size are left: hardly a ray in a thousand million finds one.
const NOISE: f64 = 1e-10;

/// Accuracy of the sides of strips, as a share of the size.
const EXACT: f64 = 1e-11;

/// Rays this many accuracies beside a strip pass through it.
const MARGIN: f64 = 4.0;

/// Runs in a leaf.
const FILL: usize = 2;

/// Boxes around runs are no larger, seen from any side, than a square of this share of the size.
const LENGTH: f64 = 1.0 / 64.0;

/// Halvings at most of a strip into runs, and of all strips together not into more runs than so many.
const HALVINGS: u32 = 6;
const RUNS: usize = 1 << 18;

/// Runs that are looked at one after the other for each ray of a packet, at most.
const FEW: usize = 16;

/// What closes the gaps of a cluster.
#[derive(Debug)]
pub(super) struct Seal {
    strips: Vec<Strip>,
    /// Parts of the strips, and the hierarchy over them.
    runs: Vec<Run>,
    tree: Tree,
    margin: f64,
}

/// A place where a ray slips between two faces.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fill {
    crossing: Crossing,
    instance: u32,
    item: u32,
}

/// Runs that rays may pass.
pub(super) enum Near {
    /// These, with the numbers of their instances, which follow one another.
    Few(SmallVec<[(u32, u32); FEW]>),
    /// Any.
    All,
}

impl Near {
    pub(super) fn is_empty(&self) -> bool {
        matches!(self, Self::Few(runs) if runs.is_empty())
    }

    /// Adds one, and says whether there are too many.
    fn push(&mut self, instance: u32, run: usize) -> bool {
        match self {
            Self::Few(runs) if runs.len() < FEW => {
                runs.push((instance, index(run)));
                false
            }
            _ => {
                *self = Self::All;
                true
            }
        }
    }
}

fn index(number: usize) -> u32 {
    u32::try_from(number).expect("fewer instances and runs than fit")
}

impl Accelerator<'_> {
    /// Closes the gaps between neighbouring faces that are no wider than `tolerance`, in units
    /// of the scene; without one the larger of what the file states, but no more than a thousandth
    /// of the size, and a ten thousandth of it. Hits that stand for a gap are marked.
    ///
    /// Nothing else changes: a ray that meets a face before a gap, or an overlap of faces within
    /// about two widths of it, meets it as before.
    #[must_use]
    pub fn sealed(mut self, tolerance: Option<f64>) -> Self {
        let mut stretches = vec![0.0_f64; self.clusters.len()];
        for instance in &self.instances {
            let most = &mut stretches[instance.cluster as usize];
            *most = most.max(instance.stretch);
        }
        let clusters = self.clusters.par_iter().zip(stretches);
        self.seals = clusters
            .map(|(cluster, stretch)| {
                let own = TOLERANCE * cluster.reach.diagonal();
                let stated = self.scene.resolution.unwrap_or(0.0) / stretch;
                let usual = stated.clamp(own, 10.0 * own);
                let tolerance = tolerance.map_or(usual, |given| given / stretch);
                Seal::of(cluster, tolerance.min(cluster.widest_strip()))
            })
            .collect();
        if self.seals.iter().all(|seal| seal.strips.is_empty()) {
            self.seals.clear();
        }
        self
    }

    /// How many strips close gaps.
    pub fn strip_count(&self) -> usize {
        self.seals.iter().map(|seal| seal.strips.len()).sum()
    }

    /// The nearest hit when gaps are closed, those `near` to the ray, from that without.
    pub(super) fn sealed_nearest(
        &self,
        ray: &Ray,
        range: &Range<f64>,
        (near, rooms): (&Near, Rooms<'_>),
        hit: Option<Hit>,
    ) -> Option<Hit> {
        let until = hit.map_or(range.end, |hit| hit.t);
        let mut best: Option<Fill> = None;
        self.fills(ray, range.start..until, (near, rooms), |fill, range| {
            range.end = fill.crossing.t;
            best = Some(fill);
        });
        match best {
            Some(fill) => Some(self.fill_hit(ray, &fill)),
            None => hit,
        }
    }

    /// Whether a ray that meets no face in `range` passes through a gap `near` to it.
    pub(super) fn sealed_any(
        &self,
        ray: &Ray,
        range: &Range<f64>,
        (near, rooms): (&Near, Rooms<'_>),
    ) -> bool {
        let mut found = false;
        self.fills(ray, range.clone(), (near, rooms), |_, range| {
            range.end = range.start;
            found = true;
        });
        found
    }

    /// The runs that rays may pass before they end: all if they do not run side by side, as far as this tells.
    pub(super) fn gaps_near(
        &self,
        rays: &[Ray],
        ranges: &[Range<f64>],
        ends: impl Iterator<Item = f64>,
        workspace: &mut Workspace,
    ) -> Near {
        // Where nothing is sealed the ends are not looked at.
        let until = if self.seals.is_empty() {
            f64::NEG_INFINITY
        } else {
            ends.fold(f64::NEG_INFINITY, f64::max)
        };
        if until == f64::NEG_INFINITY {
            return Near::Few(SmallVec::new());
        }
        self.instructions.run(Gaps {
            accelerator: self,
            rays,
            ranges,
            until,
            stack: &mut workspace.top_stack,
        })
    }

    /// Adds the gaps that a ray passes to its hits, which are sorted and stay so.
    pub(super) fn sealed_all(
        &self,
        ray: &Ray,
        range: &Range<f64>,
        rooms: Rooms<'_>,
        hits: &mut Vec<Hit>,
    ) {
        let mut fills: Vec<Fill> = Vec::new();
        let tell = |fill, _: &mut _| fills.push(fill);
        self.fills(ray, range.clone(), (&Near::All, rooms), tell);
        fills.sort_by(|a, b| a.crossing.t.total_cmp(&b.crossing.t));
        for fill in fills {
            let Crossing { t, window, .. } = fill.crossing;
            let place = hits.partition_point(|hit| hit.t < t);
            let is_near = |hit: &Hit| (hit.t - t).abs() <= window;
            let around = &hits[place.saturating_sub(1)..(place + 1).min(hits.len())];
            if !around.iter().any(is_near) {
                hits.insert(place, self.fill_hit(ray, &fill));
            }
        }
    }

    /// Tells the gaps that a ray passes in a range, not within the window of either end.
    fn fills(
        &self,
        ray: &Ray,
        mut range: Range<f64>,
        (near, (top_stack, stack, _)): (&Near, Rooms<'_>),
        mut tell: impl FnMut(Fill, &mut Range<f64>),
    ) {
        if self.seals.is_empty() {
            return;
        }
        let way = ray.direction.length_squared();
        if !(way > 0.0 && way.is_finite() && ray.origin.is_finite()) {
            return;
        }
        let ends = range.clone();
        if let Near::Few(runs) = near {
            for runs in runs.chunk_by(|a, b| a.0 == b.0) {
                let instance = &self.instances[runs[0].0 as usize];
                let ray = ray.transformed(&instance.cluster_from_world);
                let mut visitor = StripVisitor::new(self, runs[0].0, (&ray, &ends), &mut tell);
                for &(_, run) in runs {
                    visitor.meet(run as usize, &mut range);
                }
            }
            return;
        }
        let mut visitor = InstanceVisitor {
            accelerator: self,
            ray,
            ends,
            stack,
            tell,
        };
        let local = self.top.local_ray(ray);
        self.top
            .traverse(Portable, &local, &mut range, top_stack, &mut visitor);
    }

    fn fill_hit(&self, ray: &Ray, fill: &Fill) -> Hit {
        let Fill {
            crossing,
            instance,
            item,
        } = *fill;
        let place = &self.instances[instance as usize];
        let cluster = &self.clusters[place.cluster as usize];
        let owner = cluster.item(item);
        let world = place.world_from_cluster * *cluster.map_of(owner);
        let mut normal = DVec3::ZERO;
        if let ItemShape::Patch(patch) = owner.shape {
            let d = patch.surface.derivatives(crossing.uv);
            let (du, dv) = (world.transform_vector3(d.du), world.transform_vector3(d.dv));
            normal = du.cross(dv).normalize_or_zero();
        }
        Hit {
            t: crossing.t,
            uv: crossing.uv,
            point: ray.at(crossing.t),
            normal,
            shape: place.before.patches + owner.offset,
            tangential: false,
            filled: true,
            triangle: 0,
            error: crossing.width * place.stretch,
            place: (instance, item),
        }
    }
}

/// See [`Accelerator::gaps_near`], for each set of instructions.
struct Gaps<'a> {
    accelerator: &'a Accelerator<'a>,
    rays: &'a [Ray],
    ranges: &'a [Range<f64>],
    until: f64,
    stack: &'a mut Vec<(u32, f32)>,
}

impl Task for Gaps<'_> {
    type Output = Near;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Near {
        let Self {
            accelerator,
            rays,
            ranges,
            until,
            stack,
        } = self;
        let hull = Hull::of(s, rays, ranges);
        let mut near = Near::Few(SmallVec::new());
        let mut look = |number: usize, stack: &mut Vec<(u32, f32)>| {
            let instance = &accelerator.instances[number];
            let seal = &accelerator.seals[instance.cluster as usize];
            if seal.strips.is_empty() {
                return false;
            }
            let map = seal.tree.map() * instance.cluster_from_world;
            let Some(extent) = hull.extent(&map) else {
                near = Near::All;
                return true;
            };
            let tell = |run| near.push(index(number), run);
            seal.near(&extent, extent.reach(until), stack, tell)
        };
        if let [_] = accelerator.instances[..] {
            look(0, stack);
        } else if let Some(extent) = hull.extent(&accelerator.top.map()) {
            let far = extent.reach(until);
            extent.comes_to_leaf(&accelerator.top, far, stack, |leaf, stack| {
                accelerator.top.leaf(leaf).any(|number| look(number, stack))
            });
        } else {
            near = Near::All;
        }
        near
    }
}

/// Follows a ray into the instances whose gaps it may pass.
struct InstanceVisitor<'a, F> {
    accelerator: &'a Accelerator<'a>,
    ray: &'a Ray,
    /// Where something accounts for the ray.
    ends: Range<f64>,
    stack: &'a mut Vec<(u32, f32)>,
    tell: F,
}

impl<F: FnMut(Fill, &mut Range<f64>)> Visitor for InstanceVisitor<'_, F> {
    fn leaf(&mut self, number: usize, range: &mut Range<f64>) -> bool {
        for number in self.accelerator.top.leaf(number) {
            let instance = &self.accelerator.instances[number];
            let seal = &self.accelerator.seals[instance.cluster as usize];
            if seal.strips.is_empty() {
                continue;
            }
            let ray = self.ray.transformed(&instance.cluster_from_world);
            let place = (&ray, &self.ends);
            let mut visitor =
                StripVisitor::new(self.accelerator, index(number), place, &mut self.tell);
            let local = seal.tree.local_ray(&ray);
            seal.tree
                .traverse(Portable, &local, range, self.stack, &mut visitor);
        }
        true
    }
}

/// Meets the runs of the leaves that a ray passes.
struct StripVisitor<'a, F> {
    seal: &'a Seal,
    across: Across,
    ends: &'a Range<f64>,
    instance: u32,
    tell: &'a mut F,
}

impl<'a, F: FnMut(Fill, &mut Range<f64>)> StripVisitor<'a, F> {
    /// For a ray in the coordinates of the cluster.
    fn new(
        accelerator: &'a Accelerator<'_>,
        instance: u32,
        (ray, ends): (&Ray, &'a Range<f64>),
        tell: &'a mut F,
    ) -> Self {
        let cluster = accelerator.instances[instance as usize].cluster;
        let seal = &accelerator.seals[cluster as usize];
        Self {
            seal,
            across: Across::new(ray, seal.tree.bounds().center()),
            ends,
            instance,
            tell,
        }
    }

    fn meet(&mut self, run: usize, range: &mut Range<f64>) {
        let run = &self.seal.runs[run];
        if self.across.is_beside(run) {
            return;
        }
        let strip = &self.seal.strips[run.strip as usize];
        strip.meet(run, &self.across, self.seal.margin, &mut |crossing| {
            let Crossing { t, window, .. } = crossing;
            let is_open = self.ends.start < t - window && t + window < self.ends.end;
            if is_open && range.contains(&t) {
                let fill = Fill {
                    crossing,
                    instance: self.instance,
                    item: strip.item,
                };
                (self.tell)(fill, range);
            }
        });
    }
}

impl<F: FnMut(Fill, &mut Range<f64>)> Visitor for StripVisitor<'_, F> {
    fn leaf(&mut self, number: usize, range: &mut Range<f64>) -> bool {
        for run in self.seal.tree.leaf(number) {
            self.meet(run, range);
        }
        range.start < range.end
    }
}

impl Seal {
    /// The strips of a cluster that are no wider than `tolerance`.
    fn of(cluster: &Cluster<'_>, tolerance: f64) -> Self {
        let bounds = cluster.reach;
        let size = bounds.diagonal();
        let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
        let exact = EXACT * size + 64.0 * f64::EPSILON * reach;
        let mut strips = Vec::new();
        let closes = tolerance > 0.0 && tolerance.is_finite() && !bounds.is_empty();
        if closes {
            strips = joints::strips(cluster, tolerance, exact);
        }
        let margin = MARGIN * exact;
        let room = (RUNS / strips.len().max(1)).checked_ilog2();
        let depth = room.unwrap_or(0).min(HALVINGS);
        let mut runs = Vec::new();
        for (number, strip) in (0..).zip(&strips) {
            strip.divide(number, (margin, LENGTH * size), depth, &mut runs);
        }
        let boxes: Vec<_> = runs.iter().map(|(bounds, _)| *bounds).collect();
        let (tree, order) = Tree::build(&boxes, FILL);
        Self {
            strips,
            runs: order.iter().map(|&k| runs[k as usize].1).collect(),
            tree,
            margin,
        }
    }

    /// Tells the runs that rays of a packet, bounded in the coordinates of the hierarchy, may pass before `far`,
    /// until it is answered that these are enough; the result says whether it was.
    #[inline(always)]
    fn near(
        &self,
        extent: &Extent,
        far: f32,
        stack: &mut Vec<(u32, f32)>,
        mut tell: impl FnMut(usize) -> bool,
    ) -> bool {
        let tree = &self.tree;
        extent.comes_to_leaf(tree, far, stack, |leaf, _| {
            tree.leaf(leaf).any(|number| {
                let run = &self.runs[number];
                let ends = run.ends.map(|end| tree.to_local(end));
                extent.comes_to(ends, run.radius * tree.scale()) && tell(number)
            })
        })
    }

    /// Memory in use.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.strips[..]) + size_of_val(&self.runs[..]) + self.tree.bytes()
    }
}
