//! Up to 64 rays at once, from the root of the hierarchy to their roots.

use std::ops::Range;

use glam::{DAffine3, DVec2};
use kernel::Ray;

use super::approach::{OneCell, View};
use super::beam::RAYS;
use super::block::Block;
use super::cells::Cell;
use super::fans::Fan;
use super::few;
use super::hits::Shown;
use super::hull::{BeamBounds, Extent, Hull};
use super::leaf::Bits;
use super::leaving::Start;
use super::polygons::Together;
use super::room::{PacketRoom, Ready};
use super::stream::Stream;
use super::tree::{IS_LEAF, WIDTH};
use super::windows::look;
use super::{Accelerator, Cluster, Workspace};
use crate::intersect::{Hit, Scratch};
use crate::simd::{Simd, Task, WIDE_LANES};

/// Blocks and cells that a beam may come to before it is asked whether its rays still run side by side, and how many
/// of them for each ray that comes to a cell tell that they do not.
const PATIENCE: u32 = 64;
const SCATTERED: u32 = 8;

impl Accelerator<'_> {
    /// As [`Self::nearest`] for many rays, which should run side by side: their hits replace
    /// `hits`, one for each ray.
    ///
    /// Rays of common origin or direction, in the order of small squares of pixels, take a
    /// small part of the time that each alone would; any others still take less.
    ///
    /// # Panics
    /// If there are not as many `ranges` as rays.
    pub fn nearest_many(
        &self,
        rays: &[Ray],
        ranges: &[Range<f64>],
        workspace: &mut Workspace,
        hits: &mut Vec<Option<Hit>>,
    ) {
        self.nearest_leaving(rays, ranges, &[], workspace, hits);
    }

    /// As [`Self::nearest_many`], of rays that leave surfaces, each from where `starts` says, or none of them if it
    /// is empty: they take less time. No range may begin before its ray does, at a parameter below zero.
    ///
    /// # Panics
    /// If there are not as many `ranges` as rays, or `starts`, unless there are none.
    pub fn nearest_leaving(
        &self,
        rays: &[Ray],
        ranges: &[Range<f64>],
        starts: &[Start],
        workspace: &mut Workspace,
        hits: &mut Vec<Option<Hit>>,
    ) {
        check_counts(rays, ranges, starts);
        workspace.serve(self);
        hits.clear();
        hits.reserve(rays.len());
        let mut starts = starts.chunks(RAYS);
        for (rays, ranges) in rays.chunks(RAYS).zip(ranges.chunks(RAYS)) {
            let first = hits.len();
            hits.resize(first + rays.len(), None);
            let hits = &mut hits[first..];
            let task = Trace {
                accelerator: self,
                rays,
                ranges,
                starts: starts.next().unwrap_or_default(),
                hits: Some(hits),
                workspace,
            };
            self.instructions.run(task);
            let ends = hits.iter().zip(ranges);
            let ends = ends.map(|(hit, range)| hit.map_or(range.end, |hit| hit.t));
            let gaps = self.gaps_near(rays, ranges, ends, workspace);
            if gaps.is_empty() {
                continue;
            }
            for ((hit, ray), range) in hits.iter_mut().zip(rays).zip(ranges) {
                *hit = self.sealed_nearest(ray, range, (&gaps, workspace.rooms()), *hit);
            }
        }
    }

    /// As [`Self::any`] for many rays, which should run side by side: `blocked` is replaced.
    ///
    /// # Panics
    /// As [`Self::nearest_many`].
    pub fn any_many(
        &self,
        rays: &[Ray],
        ranges: &[Range<f64>],
        workspace: &mut Workspace,
        blocked: &mut Vec<bool>,
    ) {
        self.any_leaving(rays, ranges, &[], workspace, blocked);
    }

    /// As [`Self::any_many`], for rays as those of [`Self::nearest_leaving`].
    ///
    /// # Panics
    /// As [`Self::nearest_leaving`].
    pub fn any_leaving(
        &self,
        rays: &[Ray],
        ranges: &[Range<f64>],
        starts: &[Start],
        workspace: &mut Workspace,
        blocked: &mut Vec<bool>,
    ) {
        check_counts(rays, ranges, starts);
        workspace.serve(self);
        blocked.clear();
        blocked.reserve(rays.len());
        let mut starts = starts.chunks(RAYS);
        for (rays, ranges) in rays.chunks(RAYS).zip(ranges.chunks(RAYS)) {
            let task = Trace {
                accelerator: self,
                rays,
                ranges,
                starts: starts.next().unwrap_or_default(),
                hits: None,
                workspace,
            };
            self.instructions.run(task);
            let met = workspace.packet.met;
            let is_met = |lane: usize| met >> lane & 1 == 1;
            let open = (0..rays.len()).filter(|&lane| !is_met(lane));
            let ends = open.map(|lane| ranges[lane].end);
            let gaps = self.gaps_near(rays, ranges, ends, workspace);
            for (lane, (ray, range)) in rays.iter().zip(ranges).enumerate() {
                let mut passes = || self.sealed_any(ray, range, (&gaps, workspace.rooms()));
                blocked.push(is_met(lane) || !gaps.is_empty() && passes());
            }
        }
    }
}

/// Panics unless there is a range for each ray, and a start or none at all.
fn check_counts(rays: &[Ray], ranges: &[Range<f64>], starts: &[Start]) {
    assert_eq!(ranges.len(), rays.len(), "one range for each ray");
    let count = if starts.is_empty() { 0 } else { rays.len() };
    assert_eq!(starts.len(), count, "one start for each ray, or none");
}

/// One packet of rays, for each set of instructions.
struct Trace<'a, 'b> {
    accelerator: &'a Accelerator<'a>,
    rays: &'b [Ray],
    ranges: &'b [Range<f64>],
    starts: &'b [Start],
    /// For the nearest hits, where these are of interest and not only whether there are any.
    hits: Option<&'b mut [Option<Hit>]>,
    workspace: &'b mut Workspace,
}

impl Task for Trace<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let Self {
            accelerator,
            rays,
            ranges,
            starts,
            hits,
            workspace,
        } = self;
        let Workspace {
            packet, scratch, ..
        } = workspace;
        packet.met = 0;
        let hull = Hull::of(s, rays, ranges);
        if hull.passes_by(&accelerator.bounds()) {
            return;
        }
        packet.places.clear();
        let mut tracer = Tracer {
            s,
            accelerator,
            rays,
            ranges,
            starts,
            any: hits.is_none(),
            packet,
            scratch,
            alive: u64::MAX >> (RAYS - rays.len()),
            is_ready: false,
            looked: 0,
            taken: 0,
            instance: 0,
        };
        if !tracer.instances(&hull) {
            tracer.make_ready();
            s.apart(Stream(&mut tracer));
        }
        let Some(hits) = hits else {
            return;
        };
        let instances = &accelerator.instances;
        packet.places.complete(s, &packet.found.instance, instances);
        let mut shown = None;
        for lane in Bits(packet.met) {
            let found = &packet.found;
            let (instance, number) = (found.instance[lane], found.number[lane]);
            let Some(place) = packet.places.of(lane) else {
                let candidate = found.candidate(lane, packet.until[lane]);
                let hit = accelerator.work_out(&rays[lane], &candidate);
                hits[lane] = Some(hit.settled(&rays[lane]));
                continue;
            };
            let shown = match &shown {
                Some(shown) if Shown::is(shown, instance, number) => shown,
                _ => shown.insert(accelerator.shown(instance, number)),
            };
            let uv = DVec2::new(found.u[lane], found.v[lane]);
            let touches = found.tangential >> lane & 1 == 1;
            let hit = shown.hit(packet.until[lane], (uv, touches), place);
            hits[lane] = Some(hit.settled(&rays[lane]));
        }
    }
}

/// A packet on its way.
pub(super) struct Tracer<'a, 'b, S> {
    pub(super) s: S,
    pub(super) accelerator: &'a Accelerator<'a>,
    pub(super) rays: &'b [Ray],
    ranges: &'b [Range<f64>],
    /// Where each starts on a surface, if that is known.
    pub(super) starts: &'b [Start],
    pub(super) any: bool,
    pub(super) packet: &'b mut PacketRoom,
    pub(super) scratch: &'b mut Scratch,
    /// A bit for each ray that is still looked for.
    pub(super) alive: u64,
    /// Whether the rays are side by side in the room.
    is_ready: bool,
    /// Blocks and cells that the beam came to, and rays that came to cells.
    pub(super) looked: u32,
    pub(super) taken: u32,
    /// The instance at hand.
    pub(super) instance: u32,
}

impl<S: Simd> Tracer<'_, '_, S> {
    /// Puts the rays side by side, and leaves out those that can meet nothing.
    #[inline(always)]
    fn make_ready(&mut self) {
        if self.is_ready {
            return;
        }
        self.is_ready = true;
        let packet = &mut *self.packet;
        for lane in 0..RAYS {
            let range = &self.ranges[lane.min(self.rays.len() - 1)];
            (packet.from[lane], packet.until[lane]) = (range.start, range.end);
        }
        packet.rays.gather(self.rays);
        let mut open = 0;
        for (lane, usable) in packet.rays.usable().into_iter().enumerate() {
            let is_open = usable & (packet.from[lane] < packet.until[lane]);
            open |= u64::from(is_open) << lane;
        }
        self.alive &= open;
    }

    /// Follows the rays as a beam as long as they run side by side, and says whether they do.
    #[inline(always)]
    fn instances(&mut self, hull: &Hull) -> bool {
        let accelerator = self.accelerator;
        let top = &accelerator.top;
        match accelerator.instances[..] {
            [] => return true,
            [_] => return self.instance(0, hull),
            _ => {}
        }
        let Some(extent) = hull.extent(&top.map()) else {
            return false;
        };
        let mut far = f32::INFINITY;
        self.packet.top_stack.clear();
        self.packet.top_stack.push((0, f32::NEG_INFINITY));
        while let Some((child, near)) = self.packet.top_stack.pop() {
            if near > far {
                continue;
            }
            if child & IS_LEAF == 0 {
                let node = top.node(child);
                let (near, mask) = extent.slabs(node, far);
                push(&mut self.packet.top_stack, &node.child, &near, mask);
                continue;
            }
            for number in top.leaf((child & !IS_LEAF) as usize) {
                if !self.instance(number, hull) {
                    return false;
                }
                if self.alive == 0 {
                    return true;
                }
            }
            // What was found bounds the rest.
            if self.alive & !self.packet.met == 0 {
                let until = Bits(self.alive).map(|lane| self.packet.until[lane]);
                far = extent.reach(until.fold(f64::NEG_INFINITY, f64::max));
            }
        }
        true
    }

    /// As [`Self::instances`], through one of them.
    #[inline(always)]
    fn instance(&mut self, number: usize, hull: &Hull) -> bool {
        let accelerator = self.accelerator;
        let instance = &accelerator.instances[number];
        let cluster = &accelerator.clusters[instance.cluster as usize];
        self.instance = u32::try_from(number).expect("fewer instances than fit");
        if !cluster.triangles.is_empty() && !self.s.apart(Together(self, cluster, hull)) {
            return false;
        }
        if cluster.tree.is_empty() || self.alive == 0 {
            return true;
        }
        let map = cluster.tree.map() * instance.cluster_from_world;
        // Until a cell may be met, bounds of the rays are enough.
        let rough = hull.extent(&map);
        let (mut is_exact, mut far) = (rough.is_none(), f32::INFINITY);
        let first = if is_exact {
            self.fill(&map, None)
        } else {
            rough
        };
        let Some(mut extent) = first else {
            return false;
        };
        if is_exact {
            far = self.packet.beam.farthest(self.s);
        }
        let mut bounds = extent.bounds();
        self.packet.stack.clear();
        let root = cluster.tree.node(0);
        let (near, mask) = extent.slabs(root, far);
        push(&mut self.packet.stack, &boxes_of(0), &near, mask);
        while let Some((place, near)) = self.packet.stack.pop() {
            if near > far {
                continue;
            }
            let (parent, slot) = (cluster.tree.node(place / SLOTS), place % SLOTS);
            let slot = slot as usize;
            let child = parent.child[slot];
            if child & IS_LEAF == 0 {
                let node = cluster.tree.node(child);
                let (near, mask) = extent.slabs(node, far);
                push(&mut self.packet.stack, &boxes_of(child), &near, mask);
                continue;
            }
            let block = &cluster.blocks[(child & !IS_LEAF) as usize];
            if !is_exact {
                if block.crossings(self.s, &bounds, far).met == 0 {
                    continue;
                }
                let Some(exact) = self.fill(&map, Some(extent.main)) else {
                    return false;
                };
                (is_exact, extent, bounds) = (true, exact, exact.bounds());
                far = self.packet.beam.farthest(self.s);
            }
            let lanes = self.packet.beam.to_box(self.s, parent, slot);
            if lanes == 0 {
                continue;
            }
            far = self.block(cluster, (block, lanes), &bounds, far);
            if self.alive == 0 {
                break;
            }
            if self.is_scattered() {
                return false;
            }
        }
        true
    }

    /// Whether rays turn out to run too far apart to be traced as one: hardly any comes to what their beam
    /// comes to.
    pub(super) fn is_scattered(&self) -> bool {
        self.looked > PATIENCE && self.taken * SCATTERED < self.looked
    }

    /// Sees the rays that are left from a cluster; nothing if they do not run side by side.
    #[inline(always)]
    pub(super) fn fill(&mut self, map: &DAffine3, main: Option<usize>) -> Option<Extent> {
        self.make_ready();
        let packet = &mut *self.packet;
        let coherent = packet.beam.fill(
            self.s,
            (&packet.rays, self.alive),
            (map, main),
            (&packet.from, &packet.until),
            &mut packet.local,
        );
        coherent.then_some(packet.beam.extent)
    }

    /// Meets the cells of a block, and the parts of those that are coarse; the result is how far
    /// rays are then still of interest.
    #[inline(always)]
    fn block(
        &mut self,
        cluster: &Cluster<'_>,
        (block, lanes): (&Block, u64),
        bounds: &BeamBounds,
        mut far: f32,
    ) -> f32 {
        let mut coarse = [(Cell::NONE, 0.0, 0); WIDTH];
        let (mut divided, mut next) = (0, 0);
        // Taken out, so that parts can be looked into where they are kept.
        let mut fans = std::mem::take(&mut self.packet.fans);
        let (mut block, mut lanes, mut fan) = (block, lanes, None);
        'parts: loop {
            let mut found = [(0, 0.0); WIDTH];
            let crossings = block.crossings(self.s, bounds, far);
            let count = crossings.sorted(&mut found);
            self.looked += 1 + crossings.met.count_ones();
            for &(slot, start) in &found[..count] {
                let cell = block.cells[slot];
                let lanes = crossings.rays(self.s, slot, (&self.packet.beam, lanes));
                self.taken += lanes.count_ones();
                if lanes != 0 && cell.is_coarse() {
                    coarse[divided] = (cell, start, lanes);
                    divided += 1;
                    cluster.stock.pieces.call(&cell);
                } else if lanes != 0 {
                    let part = fan.map(|fan| (fan, slot));
                    self.cell(cluster, (&cell, part), lanes);
                }
            }
            self.finish_ready(cluster);
            far = self.packet.beam.farthest(self.s);
            loop {
                if next == divided || self.alive == 0 {
                    break 'parts;
                }
                let (cell, start, its) = coarse[next];
                next += 1;
                if start <= far {
                    let number = self.accelerator.instances[self.instance as usize].cluster;
                    let instructions = self.accelerator.instructions;
                    let divided = fans.of(instructions, (number, cluster), &cell);
                    (block, lanes, fan) = (&divided.block, its, Some(divided));
                    break;
                }
            }
        }
        self.packet.fans = fans;
        far
    }

    /// Looks for the roots of some rays in a cell, which may be a part of a coarse one.
    #[inline(always)]
    fn cell(
        &mut self,
        cluster: &Cluster<'_>,
        (cell, part): (&Cell, Option<(&Fan, usize)>),
        lanes: u64,
    ) {
        let instance = &self.accelerator.instances[self.instance as usize];
        let number = instance.cluster;
        let PacketRoom {
            models,
            few,
            starts,
            beam,
            waiting,
            roots,
            blurred,
            ..
        } = &mut *self.packet;
        let model = models.of(self.s, number, cluster, cell, || part);
        waiting.clear();
        (roots.count, blurred.lanes) = (0, 0);
        let taken = few.take::<S>(beam, lanes);
        let lanes = taken.unwrap_or(lanes);
        let (spread, own) = if taken.is_some() {
            (&few.spread, &few.lanes)
        } else {
            (&beam.spread, &few::ALL)
        };
        let piece = cluster.piece(cell.piece);
        let place = (self.instance, instance.is_mirrored);
        starts.fill(self.starts, (lanes, own), place, (piece, model));
        let mut company = OneCell {
            model,
            view: View::of(model, beam),
            beam,
            spread,
            lanes: own,
            starts,
        };
        let mut looked = lanes.count_ones();
        if !model.bulge[0].is_finite() {
            for lane in Bits(lanes) {
                blurred.add(lane, [-1.0; 2], [1.0; 2]);
            }
        } else if piece.is_rational {
            looked = look::<S, _, true>(self.s, &mut company, lanes, (waiting, roots, blurred));
        } else {
            looked = look::<S, _, false>(self.s, &mut company, lanes, (waiting, roots, blurred));
        }
        self.scratch.cells += u64::from(looked);
        let own = *own;
        if taken.is_some() {
            let count = roots.count;
            for lane in &mut roots.lanes[..count] {
                *lane = own[usize::from(*lane) % RAYS];
            }
        }
        let part = (model.middle, model.half);
        let mut first = 0;
        while self.packet.roots.count - first >= WIDE_LANES {
            let ready = Ready::eight((&self.packet.roots, first), cell, part);
            self.finish(cluster, &ready);
            first += WIDE_LANES;
        }
        for k in first..self.packet.roots.count {
            if !self.packet.ready.takes(cell) {
                self.finish_ready(cluster);
            }
            let PacketRoom { ready, roots, .. } = &mut *self.packet;
            ready.push((roots, k), cell, part);
        }
        for k in Bits(self.packet.blurred.lanes) {
            let lane = usize::from(own[k]);
            if self.alive >> lane & 1 == 1 {
                let part = self.packet.blurred.part(k, &cell.rect());
                self.subdivide(cluster, cell, part, lane);
            }
        }
    }
}

/// Boxes are numbered by their node and their slot there.
pub(super) const SLOTS: u32 = 8;

/// The numbers of the boxes of a node.
#[inline(always)]
pub(super) fn boxes_of(node: u32) -> [u32; WIDTH] {
    [0, 1, 2, 3, 4, 5, 6, 7].map(|slot| node * SLOTS + slot)
}

/// Pushes the children that a beam may meet, the nearest on top.
#[inline(always)]
pub(super) fn push(
    stack: &mut Vec<(u32, f32)>,
    children: &[u32; WIDTH],
    near: &[f32; WIDTH],
    mask: u32,
) {
    let first = stack.len();
    for k in Bits(u64::from(mask)) {
        let entry = (children[k], near[k]);
        stack.push(entry);
        let mut place = stack.len() - 1;
        while place > first && stack[place - 1].1 < entry.1 {
            stack[place] = stack[place - 1];
            place -= 1;
        }
        stack[place] = entry;
    }
}
