//! What packets find: roots are finished in double precision, and those that count are kept.

use glam::{DVec2, DVec3};

use super::Cluster;
use super::cells::Cell;
use super::finish::{self, Finish, Lines, Roots};
use super::packet::Tracer;
use super::trace::{Candidate, CandidateKind, ClusterRay, keeps, settle};
use crate::intersect::newton::Newton;
use crate::intersect::{Intersector, Rect, Target};
use crate::simd::{Simd, WIDE_LANES};

impl<S: Simd> Tracer<'_, '_, S> {
    /// Finishes eight roots in double precision and takes those that count.
    #[inline(always)]
    pub(super) fn finish(
        &mut self,
        cluster: &Cluster<'_>,
        cell: &Cell,
        first: usize,
        (middle, half): ([f64; 2], [f64; 2]),
    ) {
        let met = &self.packet.roots;
        let used = (met.count - first).min(WIDE_LANES);
        let piece = &cluster.pieces.pieces[cell.piece as usize];
        let mut lanes = [met.lanes[first]; WIDE_LANES];
        let mut start = [[0.0; WIDE_LANES]; 2];
        for k in 0..WIDE_LANES {
            let from = first + k.min(used - 1);
            lanes[k] = met.lanes[from];
            start[0][k] = middle[0] + half[0] * f64::from(met.x[from]);
            start[1][k] = middle[1] + half[1] * f64::from(met.y[from]);
        }
        let beam = &self.packet.beam;
        let (center, radius) = finish::ball(piece, &cluster.tree);
        let lines = Lines::of(beam, &lanes, center, radius);
        let axes = [beam.across[0], beam.across[1], beam.main];
        let wanted = (1_u32 << used) - 1;
        let net = cluster.pieces.net(piece);
        let net = (net.degrees, net.points);
        let finish = Finish {
            net,
            axes,
            lines: &lines,
            start,
            wanted,
        };
        let roots = finish.roots(self.s, piece.is_rational);
        let offset = center[beam.main] * beam.sign;
        let pace = radius * beam.sign;
        for (k, &lane) in lanes[..used].iter().enumerate() {
            let lane = usize::from(lane);
            if roots.found >> k & 1 == 0 {
                self.subdivide(cluster, cell, cell.rect(), lane);
                continue;
            }
            let zeta = offset + pace * roots.point[axes[2]][k];
            let t = self.packet.beam.time_at(lane, zeta);
            self.offer(lane, (cluster, cell), (t, &roots, k), |v| v);
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
        const EDGE: f64 = 1e-12;
        let inside = |x: f64| (-EDGE..=1.0 + EDGE).contains(&x);
        if !(inside(roots.u[k]) && inside(roots.v[k])) {
            return;
        }
        if !(t >= self.packet.from[lane] && t < self.packet.until[lane]) {
            return;
        }
        let piece = &cluster.pieces.pieces[cell.piece as usize];
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
    fn take(&mut self, lane: usize, candidate: Candidate, place: Option<[DVec3; 3]>) {
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
        packet.found[lane] = candidate;
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
        let piece = &cluster.pieces.pieces[cell.piece as usize];
        let line = ray.line(piece);
        // The piece lies in the unit ball.
        if line.c1 * line.c1 + line.c2 * line.c2 > 1.0 + 1e-9 {
            return;
        }
        let target = Target {
            piece: cluster.pieces.net(piece),
            line,
            cell: part,
            start: [0.0; 2],
            rows: [DVec3::ZERO; 3],
            stray: f64::INFINITY,
        };
        Newton::roots(self.scratch, &target);
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
