//! What packets find: roots are finished in double precision, and those that count are kept.

use glam::{DVec2, DVec3};

use super::Cluster;
use super::cells::{Cell, Piece};
use super::finish::{self, Eight, Finish, Lines, Roots};
use super::leaf::Bits;
use super::packet::Tracer;
use super::room::Ready;
use super::trace::{Candidate, CandidateKind, ClusterRay, keeps, settle};
use crate::intersect::net::evaluate_at;
use crate::intersect::subdivide::Subdivide;
use crate::intersect::{Rect, Root, Target};
use crate::simd::{Simd, WIDE_LANES};

/// Parameters of a piece may be this much beyond its borders.
const EDGE: f64 = 1e-12;

/// Points of a piece that are no farther from each other than so many slacks are one.
const SAME: f64 = 64.0;

/// Keeps one of the roots that are the same point: at a pole there are very many.
fn one_of_each(target: &Target<'_>, roots: &mut Vec<Root>) {
    if roots.len() < 2 {
        return;
    }
    let near = SAME * target.line.slack;
    let point = |root: &Root| {
        let [h, ..] = evaluate_at(&target.piece, root.u, root.v);
        h.truncate() / h.w
    };
    let mut kept = 0;
    for k in 0..roots.len() {
        let root = roots[k];
        let own = point(&root);
        let is_known = |other: &Root| other.tangential && point(other).distance(own) <= near;
        if !(root.tangential && roots[..kept].iter().any(is_known)) {
            roots[kept] = root;
            kept += 1;
        }
    }
    roots.truncate(kept);
}

#[inline(always)]
fn inside(x: f64) -> bool {
    (-EDGE..=1.0 + EDGE).contains(&x)
}

impl<S: Simd> Tracer<'_, '_, S> {
    /// Finishes the roots that are ready.
    #[inline(always)]
    pub(super) fn finish_ready(&mut self, cluster: &Cluster<'_>) {
        if self.packet.ready.count > 0 {
            let ready = self.packet.ready;
            self.packet.ready.count = 0;
            self.finish(cluster, &ready);
        }
    }

    /// Finishes up to eight roots in double precision and takes those that count.
    #[inline(always)]
    pub(super) fn finish(&mut self, cluster: &Cluster<'_>, ready: &Ready) {
        let &Ready {
            count,
            ref lanes,
            ref cells,
            ..
        } = ready;
        let number = cells[0].piece;
        let piece = cluster.piece(number);
        let eight = Eight::new(*lanes);
        let beam = &self.packet.beam;
        let (center, radius) = finish::ball(piece, &cluster.tree);
        let lines = Lines::of(beam, &eight, center, radius);
        let axes = [beam.across[0], beam.across[1], beam.main];
        let wanted = (1_u32 << count) - 1;
        let net = cluster.net(piece);
        let finish = Finish {
            net: (net.degrees, net.points),
            axes,
            lines: &lines,
            start: ready.start,
            half: ready.half,
            wanted,
        };
        let roots = finish.roots(self.s, piece.is_rational);
        let offset = center[beam.main] * beam.sign - beam.start;
        let pace = radius * beam.sign;
        let (time, paces) = (eight.of(&beam.time), eight.of(&beam.pace));
        let mut t = [0.0; WIDE_LANES];
        for k in 0..WIDE_LANES {
            t[k] = time[k] + (offset + pace * roots.point[axes[2]][k]) * paces[k];
        }
        if let Eight::Whole(eight) = eight
            && !cells.iter().any(|cell| cell.is_trimmed)
            && self.all_count(eight, &t, &roots)
        {
            self.take_eight(eight, (piece, number), &t, &roots);
            return;
        }
        for (k, (&lane, cell)) in lanes.iter().zip(cells).enumerate().take(count) {
            let lane = usize::from(lane);
            if roots.found >> k & 1 == 0 {
                self.subdivide(cluster, cell, cell.rect(), lane);
                continue;
            }
            self.offer(lane, (cluster, cell), (t[k], &roots, k), |v| v);
        }
    }

    /// Whether the roots of eight rays side by side count, one and all.
    #[inline(always)]
    fn all_count(&self, eight: usize, t: &[f64; WIDE_LANES], roots: &Roots) -> bool {
        let (from, until) = (&self.packet.from, &self.packet.until);
        let from: &[f64; WIDE_LANES] = &from.as_chunks().0[eight];
        let until: &[f64; WIDE_LANES] = &until.as_chunks().0[eight];
        let mut all = [true; WIDE_LANES];
        for k in 0..WIDE_LANES {
            all[k] =
                inside(roots.u[k]) & inside(roots.v[k]) & (t[k] >= from[k]) & (t[k] < until[k]);
        }
        roots.found == 0xff && all == [true; WIDE_LANES]
    }

    /// Keeps the roots of eight rays side by side in a piece.
    #[inline(always)]
    fn take_eight(
        &mut self,
        eight: usize,
        (piece, number): (&Piece, u32),
        t: &[f64; WIDE_LANES],
        roots: &Roots,
    ) {
        let packet = &mut *self.packet;
        let found = &mut packet.found;
        let bits = 0xff << (eight * WIDE_LANES);
        found.on_surface |= bits;
        found.tangential &= !bits;
        found.instance.as_chunks_mut().0[eight] = [self.instance; WIDE_LANES];
        found.number.as_chunks_mut().0[eight] = [number; WIDE_LANES];
        for (to, from) in [(&mut found.u, &roots.u), (&mut found.v, &roots.v)] {
            let to: &mut [f64; WIDE_LANES] = &mut to.as_chunks_mut().0[eight];
            for (to, from) in to.iter_mut().zip(from) {
                *to = from.clamp(0.0, 1.0);
            }
        }
        packet
            .places
            .set_eight(eight, (piece.center, piece.radius), roots);
        packet.until.as_chunks_mut().0[eight] = *t;
        packet.met |= bits;
        if self.any {
            self.alive &= !bits;
            for lane in Bits(bits) {
                packet.beam.end(lane);
            }
        } else {
            packet.beam.shorten_eight(eight, t);
        }
    }

    /// Takes root `k` at the ray parameter `t` if it counts; `turn` brings the order of its
    /// axes back.
    #[inline(always)]
    pub(super) fn offer(
        &mut self,
        lane: usize,
        (cluster, cell): (&Cluster<'_>, &Cell),
        (t, roots, k): (f64, &Roots, usize),
        turn: impl Fn(DVec3) -> DVec3,
    ) {
        if !(inside(roots.u[k]) && inside(roots.v[k])) {
            return;
        }
        if !(t >= self.packet.from[lane] && t < self.packet.until[lane]) {
            return;
        }
        let piece = cluster.piece(cell.piece);
        let uv = DVec2::new(roots.u[k], roots.v[k]).clamp(DVec2::ZERO, DVec2::ONE);
        if cell.is_trimmed && !keeps(cluster, piece, uv) {
            return;
        }
        let part = |x: &[[f64; WIDE_LANES]; 3]| turn(DVec3::new(x[0][k], x[1][k], x[2][k]));
        let place = [
            piece.center + part(&roots.point) * piece.radius,
            part(&roots.by_u),
            part(&roots.by_v),
        ];
        let candidate = Candidate {
            t,
            instance: self.instance,
            kind: CandidateKind::Surface {
                piece: cell.piece,
                u: uv.x,
                v: uv.y,
                tangential: false,
            },
        };
        self.take(lane, candidate, Some(place));
    }

    /// Keeps a root that is nearer than what was known.
    #[inline(always)]
    pub(super) fn take(&mut self, lane: usize, candidate: Candidate, place: Option<[DVec3; 3]>) {
        self.keep(lane, candidate, place);
        if self.any {
            self.packet.beam.end(lane);
        } else {
            self.packet.beam.shorten(lane, candidate.t);
        }
    }

    /// As [`Self::take`], before the beam of the cluster is there.
    #[inline(always)]
    pub(super) fn keep(&mut self, lane: usize, candidate: Candidate, place: Option<[DVec3; 3]>) {
        let packet = &mut *self.packet;
        packet.found.set(lane, &candidate);
        packet.places.set(lane, place);
        packet.met |= 1 << lane;
        packet.until[lane] = candidate.t;
        if self.any {
            self.alive &= !(1 << lane);
        }
    }

    /// Leaves a ray and a part of a cell to subdivision in double precision.
    #[inline(never)]
    pub(super) fn subdivide(
        &mut self,
        cluster: &Cluster<'_>,
        cell: &Cell,
        part: Rect,
        lane: usize,
    ) {
        let instance = &self.accelerator.instances[self.instance as usize];
        let ray = self.rays[lane].transformed(&instance.cluster_from_world);
        let ray = ClusterRay::new(&ray, cluster);
        let piece = cluster.piece(cell.piece);
        let line = ray.line(piece);
        // The piece lies in the unit ball.
        if line.c1 * line.c1 + line.c2 * line.c2 > 1.0 + 1e-9 {
            return;
        }
        let target = Target {
            piece: cluster.net(piece),
            line,
            cell: part,
            start: [0.0; 2],
            rows: [DVec3::ZERO; 3],
            stray: f64::INFINITY,
        };
        self.scratch.roots.clear();
        self.s.apart(Subdivide(self.scratch, &target));
        if !cell.is_trimmed {
            one_of_each(&target, &mut self.scratch.roots);
        }
        let place = (&self.rays[lane], instance);
        settle(place, cluster, (piece, line.slack), &mut self.scratch.roots);
        for k in 0..self.scratch.roots.len() {
            let root = self.scratch.roots[k];
            if cell.is_trimmed && !keeps(cluster, piece, DVec2::new(root.u, root.v)) {
                continue;
            }
            let t = ray.time(&target, piece, &root);
            if t >= self.packet.from[lane] && t < self.packet.until[lane] {
                let candidate = Candidate {
                    t,
                    instance: self.instance,
                    kind: CandidateKind::Surface {
                        piece: cell.piece,
                        u: root.u,
                        v: root.v,
                        tangential: root.tangential,
                    },
                };
                self.take(lane, candidate, None);
            }
        }
    }
}
