//! Up to 64 rays at once, from the root of the hierarchy to their roots.

use std::ops::Range;

use kernel::Ray;

use super::approach::{self, OneCell, View};
use super::beam::{BeamBounds, Hull, RAYS};
use super::block::Block;
use super::cells::Cell;
use super::leaf::Bits;
use super::room::PacketRoom;
use super::stream::Stream;
use super::trace::{Nearest, TriangleVisitor};
use super::tree::{IS_LEAF, WIDTH};
use super::windows::{group_of, look};
use super::{Accelerator, Cluster, Workspace};
use crate::intersect::triangle::Sheared;
use crate::intersect::{Hit, Scratch};
use crate::simd::{LANES, Simd, Task, WIDE_LANES};

impl Accelerator<'_> {
    /// As [`Self::nearest`] for many rays, which should run side by side: their hits replace
    /// `hits`, one for each ray.
    ///
    /// Rays of common origin or direction, in the order of small squares of pixels, take a
    /// small part of the time that each alone would; any others still take less.
    pub fn nearest_many(
        &self,
        rays: &[Ray],
        ranges: &[Range<f64>],
        workspace: &mut Workspace,
        hits: &mut Vec<Option<Hit>>,
    ) {
        workspace.serve(self);
        hits.clear();
        for (rays, ranges) in rays.chunks(RAYS).zip(ranges.chunks(RAYS)) {
            let task = Trace {
                accelerator: self,
                rays,
                ranges,
                any: false,
                workspace,
            };
            self.instructions.run(task);
            let first = hits.len();
            hits.resize(first + rays.len(), None);
            let hits = &mut hits[first..];
            for lane in Bits(workspace.packet.met) {
                let candidate = &workspace.packet.found[lane];
                // Each in its own place: a hit is long to copy.
                if let Some(place) = workspace.packet.places.of(lane) {
                    hits[lane] = Some(self.placed_hit(candidate, place));
                } else {
                    hits[lane] = Some(self.work_out(&rays[lane], candidate));
                }
            }
            if !self.seals.is_empty() {
                for ((hit, ray), range) in hits.iter_mut().zip(rays).zip(ranges) {
                    *hit = self.sealed_nearest(ray, range, workspace.rooms(), *hit);
                }
            }
        }
    }

    /// As [`Self::any`] for many rays, which should run side by side: `blocked` is replaced.
    pub fn any_many(
        &self,
        rays: &[Ray],
        ranges: &[Range<f64>],
        workspace: &mut Workspace,
        blocked: &mut Vec<bool>,
    ) {
        workspace.serve(self);
        blocked.clear();
        for (rays, ranges) in rays.chunks(RAYS).zip(ranges.chunks(RAYS)) {
            let task = Trace {
                accelerator: self,
                rays,
                ranges,
                any: true,
                workspace,
            };
            self.instructions.run(task);
            let met = workspace.packet.met;
            blocked.extend(rays.iter().enumerate().map(|(lane, ray)| {
                let is_met = met >> lane & 1 == 1;
                is_met || self.sealed_any(ray, &ranges[lane], workspace.rooms())
            }));
        }
    }
}

/// One packet of rays, for each set of instructions.
struct Trace<'a, 'b> {
    accelerator: &'a Accelerator<'a>,
    rays: &'b [Ray],
    ranges: &'b [Range<f64>],
    /// Whether any hit ends a ray, not only the nearest is of interest.
    any: bool,
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
            any,
            workspace,
        } = self;
        let Workspace {
            packet, scratch, ..
        } = workspace;
        packet.met = 0;
        if Hull::of(s, rays, ranges).passes_by(&accelerator.bounds()) {
            return;
        }
        packet.places.clear();
        let mut alive = 0_u64;
        for lane in 0..RAYS {
            let range = &ranges[lane.min(rays.len() - 1)];
            (packet.from[lane], packet.until[lane]) = (range.start, range.end);
        }
        packet.rays.gather(rays);
        let usable = packet.rays.usable();
        for (lane, usable) in usable.into_iter().enumerate() {
            let is_open = usable & (packet.from[lane] < packet.until[lane]);
            alive |= u64::from(is_open) << lane;
        }
        alive &= u64::MAX >> (RAYS - rays.len());
        let mut tracer = Tracer {
            s,
            accelerator,
            rays,
            any,
            packet,
            scratch,
            alive,
            instance: 0,
        };
        if !tracer.instances() {
            s.apart(Stream(&mut tracer));
        }
        if !any {
            packet
                .places
                .complete(s, &packet.found, &accelerator.instances);
        }
    }
}

/// A packet on its way.
pub(super) struct Tracer<'a, 'b, S> {
    pub(super) s: S,
    pub(super) accelerator: &'a Accelerator<'a>,
    pub(super) rays: &'b [Ray],
    pub(super) any: bool,
    pub(super) packet: &'b mut PacketRoom,
    pub(super) scratch: &'b mut Scratch,
    /// A bit for each ray that is still looked for.
    pub(super) alive: u64,
    /// The instance at hand.
    pub(super) instance: u32,
}

impl<S: Simd> Tracer<'_, '_, S> {
    /// Follows the rays as a beam as long as they run side by side, and says whether they do.
    #[inline(always)]
    fn instances(&mut self) -> bool {
        let accelerator = self.accelerator;
        let top = &accelerator.top;
        match accelerator.instances[..] {
            [] => return true,
            [_] => return self.instance(0),
            _ => {}
        }
        let map = top.map();
        let packet = &mut *self.packet;
        let coherent = packet.top_beam.fill(
            self.s,
            (&packet.rays, self.alive),
            &map,
            (&packet.from, &packet.until),
            &mut packet.local,
        );
        if !coherent {
            return false;
        }
        packet.top_stack.clear();
        packet.top_stack.push((0, f32::NEG_INFINITY));
        while let Some((child, near)) = self.packet.top_stack.pop() {
            let far = self.packet.top_beam.farthest(self.s);
            if near > far {
                continue;
            }
            if child & IS_LEAF == 0 {
                let beam = &self.packet.top_beam;
                let (near, mask) = beam.slabs(top.node(child), far);
                push(
                    &mut self.packet.top_stack,
                    &top.node(child).child,
                    &near,
                    mask,
                );
                continue;
            }
            for number in top.leaf((child & !IS_LEAF) as usize) {
                if !self.instance(number) {
                    return false;
                }
                if self.alive == 0 {
                    return true;
                }
            }
            // What was found bounds the rest.
            let packet = &mut *self.packet;
            for lane in Bits(packet.met) {
                packet.top_beam.shorten(lane, packet.until[lane]);
            }
            for lane in Bits(!self.alive) {
                packet.top_beam.end(lane);
            }
        }
        true
    }

    /// As [`Self::instances`], through one of them.
    #[inline(always)]
    fn instance(&mut self, number: usize) -> bool {
        let accelerator = self.accelerator;
        let instance = &accelerator.instances[number];
        let cluster = &accelerator.clusters[instance.cluster as usize];
        self.instance = u32::try_from(number).expect("fewer instances than fit");
        if !cluster.triangles.is_empty() {
            for lane in Bits(self.alive) {
                self.triangles(cluster, lane);
            }
        }
        if cluster.tree.is_empty() {
            return true;
        }
        let packet = &mut *self.packet;
        let map = cluster.tree.map() * instance.cluster_from_world;
        let coherent = packet.beam.fill(
            self.s,
            (&packet.rays, self.alive),
            &map,
            (&packet.from, &packet.until),
            &mut packet.local,
        );
        if !coherent {
            return false;
        }
        let whole = packet.beam.bounds();
        let mut parts = [whole; RAYS / LANES];
        for (group, part) in parts.iter_mut().enumerate() {
            *part = packet.beam.part(&whole, group);
        }
        packet.stack.clear();
        packet.stack.push((0, f32::NEG_INFINITY));
        let mut far = packet.beam.farthest(self.s);
        while let Some((child, near)) = self.packet.stack.pop() {
            if near > far {
                continue;
            }
            if child & IS_LEAF == 0 {
                let node = cluster.tree.node(child);
                let (near, mask) = self.packet.beam.slabs(node, far);
                push(&mut self.packet.stack, &node.child, &near, mask);
                continue;
            }
            let block = &cluster.blocks[(child & !IS_LEAF) as usize];
            far = self.block(cluster, block, (&whole, &parts), far);
            if self.alive == 0 {
                break;
            }
        }
        true
    }

    /// Meets the triangles of a cluster, ray by ray.
    #[inline(never)]
    pub(super) fn triangles(&mut self, cluster: &Cluster<'_>, lane: usize) {
        let instance = &self.accelerator.instances[self.instance as usize];
        let ray = self.rays[lane].transformed(&instance.cluster_from_world);
        let mut best = Nearest::or_first(self.any);
        let mut visitor = TriangleVisitor {
            cluster,
            ray: Sheared::new(&ray),
            instance: self.instance,
            collector: &mut best,
            go_on: true,
        };
        let mut range = self.packet.from[lane]..self.packet.until[lane];
        let local = cluster.triangle_tree.local_ray(&ray);
        let stack = &mut self.packet.triangle_stack;
        cluster
            .triangle_tree
            .traverse(&local, &mut range, stack, &mut visitor);
        if let Some(candidate) = best.found {
            self.keep(lane, candidate, None);
        }
    }

    /// Meets the cells of a block, and the parts of those that are coarse; the result is how far
    /// rays are then still of interest.
    #[inline(always)]
    fn block(
        &mut self,
        cluster: &Cluster<'_>,
        block: &Block,
        (whole, parts): (&BeamBounds, &[BeamBounds; RAYS / LANES]),
        mut far: f32,
    ) -> f32 {
        let mut coarse = [(Cell::NONE, 0.0); WIDTH];
        let (mut divided, mut next) = (0, 0);
        let mut fan = None;
        loop {
            let block = fan.as_ref().unwrap_or(block);
            let mut found = [(0, 0.0); WIDTH];
            let count = block.meet_beam(whole, far, &mut found);
            let mut near = [u32::MAX; RAYS / LANES];
            // Groups of rays tell what few of several cells they come to.
            if count > 1 {
                for (near, part) in near.iter_mut().zip(parts) {
                    *near = block.meets_beam(part, far);
                }
            }
            for &(slot, start) in &found[..count] {
                let lanes = self.passing(cluster, block, slot as usize, &near);
                let cell = block.cells[slot as usize];
                if lanes != 0 && cell.is_coarse() {
                    coarse[divided] = (cell, start);
                    divided += 1;
                } else if lanes != 0 {
                    self.cell(cluster, &cell, lanes);
                }
            }
            far = self.packet.beam.farthest(self.s);
            loop {
                if next == divided || self.alive == 0 {
                    return far;
                }
                let (cell, start) = coarse[next];
                next += 1;
                if start <= far {
                    let number = self.accelerator.instances[self.instance as usize].cluster;
                    let instructions = self.accelerator.instructions;
                    let fans = &mut self.packet.fans;
                    fan = Some(fans.of(instructions, (number, cluster), &cell).clone());
                    break;
                }
            }
        }
    }

    /// The rays that may meet a cell, of the groups that are `near` to it.
    #[inline(always)]
    fn passing(
        &self,
        cluster: &Cluster<'_>,
        block: &Block,
        slot: usize,
        near: &[u32; RAYS / LANES],
    ) -> u64 {
        if near.iter().all(|near| near >> slot & 1 == 0) {
            return 0;
        }
        let piece = block.cells[slot].piece as usize;
        let rational = cluster.pieces.pieces[piece].is_rational;
        let view = block.view(slot, &self.packet.beam);
        let mut lanes = 0;
        for (group, near) in near.iter().enumerate() {
            if near >> slot & 1 == 1 && group_of(self.alive, group) != 0 {
                let pass = approach::pass(self.s, &view, &self.packet.beam, group, rational);
                lanes |= u64::from(pass & 0xffff) << (group * LANES);
            }
        }
        lanes & self.alive
    }

    /// Looks for the roots of some rays in a cell.
    #[inline(always)]
    fn cell(&mut self, cluster: &Cluster<'_>, cell: &Cell, lanes: u64) {
        self.scratch.cells += u64::from(lanes.count_ones());
        let number = self.accelerator.instances[self.instance as usize].cluster;
        let PacketRoom {
            models,
            beam,
            waiting,
            roots,
            blurred,
            ..
        } = &mut *self.packet;
        let model = models.of(self.s, number, cluster, cell);
        waiting.clear();
        (roots.count, blurred.lanes) = (0, 0);
        let mut company = OneCell {
            model,
            view: View::of_model(model, beam),
            beam,
        };
        let piece = &cluster.pieces.pieces[cell.piece as usize];
        if !model.bulge[0].is_finite() {
            for lane in Bits(lanes) {
                blurred.add(lane, [-1.0; 2], [1.0; 2]);
            }
        } else if piece.is_rational {
            look::<S, _, true>(self.s, &mut company, lanes, (waiting, roots, blurred));
        } else {
            look::<S, _, false>(self.s, &mut company, lanes, (waiting, roots, blurred));
        }
        let part = (model.middle, model.half);
        let mut start = 0;
        while start < self.packet.roots.count {
            self.finish(cluster, cell, start, part);
            start += WIDE_LANES;
        }
        for lane in Bits(self.packet.blurred.lanes & self.alive) {
            let part = self.packet.blurred.part(lane, &cell.rect());
            self.subdivide(cluster, cell, part, lane);
        }
    }
}

/// Pushes the children that a beam may meet, the nearest on top.
#[inline(always)]
fn push(stack: &mut Vec<(u32, f32)>, children: &[u32; WIDTH], near: &[f32; WIDTH], mask: u32) {
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
