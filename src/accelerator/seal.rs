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

use super::hull::{Extent, Hull};
use super::strip::{Across, Crossing, Run, Strip};
use super::trace::Rooms;
use super::tree::{Tree, Visitor};
use super::{Accelerator, Cluster, Instance, ItemShape};
use crate::intersect::Hit;

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
                let own = TOLERANCE * cluster.tree.bounds().diagonal();
                let stated = self.scene.resolution.unwrap_or(0.0) / stretch;
                let usual = stated.clamp(own, 10.0 * own);
                Seal::of(cluster, tolerance.map_or(usual, |given| given / stretch))
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

    /// The nearest hit when gaps are closed, from that without.
    pub(super) fn sealed_nearest(
        &self,
        ray: &Ray,
        range: &Range<f64>,
        rooms: Rooms<'_>,
        hit: Option<Hit>,
    ) -> Option<Hit> {
        if self.seals.is_empty() {
            return hit;
        }
        let until = hit.map_or(range.end, |hit| hit.t);
        let mut best: Option<Fill> = None;
        self.fills(ray, range.start..until, rooms, |fill, range| {
            range.end = fill.crossing.t;
            best = Some(fill);
        });
        match best {
            Some(fill) => Some(self.fill_hit(ray, &fill)),
            None => hit,
        }
    }

    /// Whether a ray that meets no face in `range` passes through a gap.
    pub(super) fn sealed_any(&self, ray: &Ray, range: &Range<f64>, rooms: Rooms<'_>) -> bool {
        let mut found = false;
        if !self.seals.is_empty() {
            self.fills(ray, range.clone(), rooms, |_, range| {
                range.end = range.start;
                found = true;
            });
        }
        found
    }

    /// Whether one of the rays of a packet may pass through a gap before `until`, as far as this tells of rays that
    /// do not run side by side.
    #[inline(always)]
    pub(super) fn comes_to_gaps(
        &self,
        hull: &Hull,
        until: f64,
        stack: &mut Vec<(u32, f32)>,
    ) -> bool {
        let passes = |instance: &Instance, stack: &mut Vec<(u32, f32)>| {
            let seal = &self.seals[instance.cluster as usize];
            let map = seal.tree.map() * instance.cluster_from_world;
            !seal.strips.is_empty()
                && hull
                    .extent(&map)
                    .is_none_or(|extent| seal.is_near(&extent, extent.reach(until), stack))
        };
        if let [instance] = &self.instances[..] {
            return passes(instance, stack);
        }
        let Some(extent) = hull.extent(&self.top.map()) else {
            return true;
        };
        let far = extent.reach(until);
        extent.comes_to_leaf(&self.top, far, stack, |leaf, stack| {
            let mut instances = self.top.leaf(leaf);
            instances.any(|number| passes(&self.instances[number], stack))
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
        if self.seals.is_empty() {
            return;
        }
        let mut fills: Vec<Fill> = Vec::new();
        self.fills(ray, range.clone(), rooms, |fill, _| fills.push(fill));
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
        (top_stack, stack, _): Rooms<'_>,
        tell: impl FnMut(Fill, &mut Range<f64>),
    ) {
        let way = ray.direction.length_squared();
        if !(way > 0.0 && way.is_finite() && ray.origin.is_finite()) {
            return;
        }
        let mut visitor = InstanceVisitor {
            accelerator: self,
            ray,
            ends: range.clone(),
            stack,
            tell,
        };
        let local = self.top.local_ray(ray);
        self.top
            .traverse(&local, &mut range, top_stack, &mut visitor);
    }

    fn fill_hit(&self, ray: &Ray, fill: &Fill) -> Hit {
        let Fill {
            crossing,
            instance,
            item,
        } = *fill;
        let place = &self.instances[instance as usize];
        let cluster = &self.clusters[place.cluster as usize];
        let owner = &cluster.items[item as usize];
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
            let mut visitor = StripVisitor {
                seal,
                across: Across::new(&ray, seal.tree.bounds().center()),
                ends: &self.ends,
                instance: u32::try_from(number).expect("fewer instances than fit"),
                tell: &mut self.tell,
            };
            let local = seal.tree.local_ray(&ray);
            seal.tree.traverse(&local, range, self.stack, &mut visitor);
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

impl<F: FnMut(Fill, &mut Range<f64>)> Visitor for StripVisitor<'_, F> {
    fn leaf(&mut self, number: usize, range: &mut Range<f64>) -> bool {
        for run in &self.seal.runs[self.seal.tree.leaf(number)] {
            if self.across.is_beside(run) {
                continue;
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
        range.start < range.end
    }
}

impl Seal {
    /// The strips of a cluster that are no wider than `tolerance`.
    fn of(cluster: &Cluster<'_>, tolerance: f64) -> Self {
        let bounds = cluster.tree.bounds();
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

    /// Whether one of the rays of a packet, bounded in the coordinates of the hierarchy, may pass through a strip
    /// before `far`.
    #[inline(always)]
    fn is_near(&self, extent: &Extent, far: f32, stack: &mut Vec<(u32, f32)>) -> bool {
        let tree = &self.tree;
        extent.comes_to_leaf(tree, far, stack, |leaf, _| {
            self.runs[tree.leaf(leaf)].iter().any(|run| {
                let ends = run.ends.map(|end| tree.to_local(end));
                extent.comes_to(ends, run.radius * tree.scale())
            })
        })
    }

    /// Memory in use.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.strips[..]) + size_of_val(&self.runs[..]) + self.tree.bytes()
    }
}
