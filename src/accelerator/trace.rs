//! One ray through both levels.

use std::marker::PhantomData;
use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::{MaterialId, Ray};

use super::block::{Block, Encounter};
use super::cells::Piece;
use super::seal::Near;
use super::tree::{LocalRay, Visitor, WIDTH};
use super::{Accelerator, Cluster, ClusterItem, Instance, ItemShape, Workspace};
use crate::intersect::net::evaluate_at;
use crate::intersect::newton::{Newton, UNIQUE};
use crate::intersect::triangle::Sheared;
use crate::intersect::{Hit, Intersector, Line, Root, Scratch, Target, Touch};
use crate::simd::Portable;

/// Rounding error of a distance in a piece of size one, a few operations wide.
const SLACK: f64 = 4e-15;

/// What a ray met, before it is worked out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) t: f64,
    pub(super) instance: u32,
    pub(super) kind: CandidateKind,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum CandidateKind {
    Surface {
        piece: u32,
        u: f64,
        v: f64,
        tangential: bool,
    },
    Triangle {
        index: u32,
        barycentric: DVec2,
    },
}

impl Accelerator<'_> {
    /// The first hit with `t` in `range`, or nothing.
    pub fn nearest(&self, ray: &Ray, range: Range<f64>, workspace: &mut Workspace) -> Option<Hit> {
        (self.method.nearest)(self, ray, range, workspace)
    }

    /// Whether there is a hit with `t` in `range`.
    pub fn any(&self, ray: &Ray, range: Range<f64>, workspace: &mut Workspace) -> bool {
        (self.method.any)(self, ray, range, workspace)
    }

    /// Replaces `hits` by all hits with `t` in `range`, from near to far.
    pub fn all(
        &self,
        ray: &Ray,
        range: Range<f64>,
        workspace: &mut Workspace,
        hits: &mut Vec<Hit>,
    ) {
        (self.method.all)(self, ray, range, workspace, hits);
    }

    pub(crate) fn nearest_with<I: Intersector>(
        &self,
        ray: &Ray,
        range: Range<f64>,
        workspace: &mut Workspace,
    ) -> Option<Hit> {
        let mut best = Nearest::default();
        self.search::<I>(ray, range.clone(), workspace.rooms(), &mut best);
        let hit = best
            .found
            .map(|candidate| self.work_out(ray, &candidate).settled(ray));
        self.sealed_nearest(ray, &range, (&Near::All, workspace.rooms()), hit)
    }

    pub(crate) fn any_with<I: Intersector>(
        &self,
        ray: &Ray,
        range: Range<f64>,
        workspace: &mut Workspace,
    ) -> bool {
        let mut first = Nearest::or_first(true);
        self.search::<I>(ray, range.clone(), workspace.rooms(), &mut first);
        first.found.is_some() || self.sealed_any(ray, &range, (&Near::All, workspace.rooms()))
    }

    pub(crate) fn all_with<I: Intersector>(
        &self,
        ray: &Ray,
        range: Range<f64>,
        workspace: &mut Workspace,
        hits: &mut Vec<Hit>,
    ) {
        self.gather::<I>(ray, range.clone(), (None, workspace), hits);
        self.sealed_all(ray, &range, workspace.rooms(), hits);
    }

    /// Replaces `hits` by those on shapes of other materials than that of `hit`, from near to far; gaps are none.
    pub(crate) fn others(
        &self,
        hit: &Hit,
        (ray, range): (&Ray, Range<f64>),
        workspace: &mut Workspace,
        hits: &mut Vec<Hit>,
    ) {
        let but = Some(self.item(hit).material);
        self.gather::<Newton>(ray, range, (but, workspace), hits);
    }

    /// Replaces `hits` by those on shapes, of all materials `but` one, from near to far.
    fn gather<I: Intersector>(
        &self,
        ray: &Ray,
        range: Range<f64>,
        (but, workspace): (Option<Option<MaterialId>>, &mut Workspace),
        hits: &mut Vec<Hit>,
    ) {
        let mut found = All {
            candidates: std::mem::take(&mut workspace.candidates),
            but,
        };
        found.candidates.clear();
        self.search::<I>(ray, range, workspace.rooms(), &mut found);
        let candidates = found.candidates;
        hits.clear();
        hits.extend(
            candidates
                .iter()
                .map(|candidate| self.work_out(ray, candidate)),
        );
        workspace.candidates = candidates;
        hits.sort_unstable_by(|a, b| {
            a.t.total_cmp(&b.t)
                .then(a.shape.cmp(&b.shape))
                .then(a.uv.x.total_cmp(&b.uv.x))
                .then(a.uv.y.total_cmp(&b.uv.y))
        });
        self.merge(ray, hits);
        for hit in hits.iter_mut() {
            *hit = hit.settled(ray);
        }
    }

    /// Offers every candidate in `range` to `collector`.
    pub(super) fn search<I: Intersector>(
        &self,
        ray: &Ray,
        mut range: Range<f64>,
        (top_stack, stack, scratch): Rooms<'_>,
        collector: &mut impl Collector,
    ) {
        let way = ray.direction.length_squared();
        if !(way > 0.0 && way.is_finite() && ray.origin.is_finite()) {
            return;
        }
        let mut visitor = InstanceVisitor::<I, _> {
            accelerator: self,
            ray,
            stack,
            scratch,
            collector,
            method: PhantomData,
        };
        let local = self.top.local_ray(ray);
        self.top
            .traverse(Portable, &local, &mut range, top_stack, &mut visitor);
    }
}

/// Memory for the search of one ray: both stacks, and that of the solver.
pub(super) type Rooms<'a> = (
    &'a mut Vec<(u32, f32)>,
    &'a mut Vec<(u32, f32)>,
    &'a mut Scratch,
);

/// Whether a point of a piece belongs to its face, or to its border.
pub(super) fn keeps(cluster: &Cluster<'_>, piece: &Piece, local: DVec2) -> bool {
    let uv = piece.parameters(local);
    let region = cluster.item(piece.item).region;
    region.is_none_or(|k| cluster.stock.regions[k as usize].holds(uv))
}

/// Asks again about roots with a piece that are blurred, or not proven to be simple crossings;
/// distances in the units of the piece are known to `slack`.
pub(super) fn settle(
    (ray, instance): (&Ray, &Instance),
    cluster: &Cluster<'_>,
    (piece, slack): (&Piece, f64),
    roots: &mut Vec<Root>,
) {
    let item = cluster.item(piece.item);
    let ItemShape::Patch(patch) = item.shape else {
        return;
    };
    for k in 0..roots.len() {
        if roots[k].flat || !(roots[k].tangential || roots[k].blurred) {
            continue;
        }
        let touch = Touch {
            surface: &patch.surface,
            world_from_surface: instance.world_from_cluster * *cluster.map_of(item),
            ray,
            domain: [piece.u, piece.v],
            size: piece.radius * instance.stretch,
            slack,
        };
        let mut settled = touch.settled(roots[k]).into_iter().flatten();
        match settled.next() {
            Some(root) => roots[k] = root,
            None => roots[k].u = f64::NAN,
        }
        roots.extend(settled);
    }
    roots.retain(|root| !root.u.is_nan());
}

/// What becomes of the candidates of a ray.
pub(super) trait Collector {
    /// Takes a candidate in `range`; may lower its end, and says whether to go on.
    fn take(&mut self, candidate: Candidate, range: &mut Range<f64>) -> bool;

    /// Whether candidates of a shape are looked for.
    #[inline(always)]
    fn wants(&self, _: &ClusterItem<'_>) -> bool {
        true
    }
}

/// Keeps the nearest, or stops at the first.
#[derive(Default)]
pub(super) struct Nearest {
    pub(super) found: Option<Candidate>,
    first: bool,
}

impl Nearest {
    /// What stops at the first if `first`.
    pub(super) fn or_first(first: bool) -> Self {
        let found = None;
        Self { found, first }
    }
}

impl Collector for Nearest {
    #[inline(always)]
    fn take(&mut self, candidate: Candidate, range: &mut Range<f64>) -> bool {
        range.end = candidate.t;
        self.found = Some(candidate);
        !self.first
    }
}

/// Keeps all, of all materials but one.
struct All {
    candidates: Vec<Candidate>,
    but: Option<Option<MaterialId>>,
}

impl Collector for All {
    fn take(&mut self, candidate: Candidate, _: &mut Range<f64>) -> bool {
        self.candidates.push(candidate);
        true
    }

    fn wants(&self, item: &ClusterItem<'_>) -> bool {
        self.but != Some(item.material)
    }
}

/// Follows a ray into the instances that it passes.
struct InstanceVisitor<'a, I, C> {
    accelerator: &'a Accelerator<'a>,
    ray: &'a Ray,
    stack: &'a mut Vec<(u32, f32)>,
    scratch: &'a mut Scratch,
    collector: &'a mut C,
    method: PhantomData<I>,
}

impl<I: Intersector, C: Collector> Visitor for InstanceVisitor<'_, I, C> {
    #[inline(always)]
    fn leaf(&mut self, number: usize, range: &mut Range<f64>) -> bool {
        for number in self.accelerator.top.leaf(number) {
            let instance = &self.accelerator.instances[number];
            let cluster = &self.accelerator.clusters[instance.cluster as usize];
            let ray = self.ray.transformed(&instance.cluster_from_world);
            let number = u32::try_from(number).expect("fewer instances than fit");
            let local = cluster.tree.local_ray(&ray);
            let mut visitor = CellVisitor::<I, C> {
                cluster,
                place: (self.ray, instance),
                ray: ClusterRay::new(&ray, cluster),
                local,
                instance: number,
                scratch: &mut *self.scratch,
                collector: &mut *self.collector,
                go_on: true,
                method: PhantomData,
            };
            cluster
                .tree
                .traverse(Portable, &local, range, self.stack, &mut visitor);
            if !visitor.go_on {
                return false;
            }
            if cluster.triangles.is_empty() {
                continue;
            }
            let mut visitor = TriangleVisitor {
                cluster,
                ray: Sheared::new(&ray),
                instance: number,
                collector: &mut *self.collector,
                go_on: true,
            };
            let local = cluster.triangle_tree.local_ray(&ray);
            cluster
                .triangle_tree
                .traverse(Portable, &local, range, self.stack, &mut visitor);
            if !visitor.go_on {
                return false;
            }
        }
        true
    }
}

/// Meets the cells of the leaves that a ray passes.
struct CellVisitor<'a, I, C> {
    cluster: &'a Cluster<'a>,
    /// The ray in the world, and where the cluster stands there.
    place: (&'a Ray, &'a Instance),
    ray: ClusterRay,
    local: LocalRay,
    instance: u32,
    scratch: &'a mut Scratch,
    collector: &'a mut C,
    go_on: bool,
    method: PhantomData<I>,
}

impl<I: Intersector, C: Collector> Visitor for CellVisitor<'_, I, C> {
    #[inline(always)]
    fn leaf(&mut self, number: usize, range: &mut Range<f64>) -> bool {
        let block = &self.cluster.blocks[number];
        let mut found = [Encounter::NONE; WIDTH];
        let local = self.local.range(range);
        let count = block.meet(Portable, &self.local, &local, &mut found);
        for encounter in &found[..count] {
            // What was found in the cells before bounds the rest.
            if encounter.near > self.local.range(range).end {
                continue;
            }
            if !self.meet(block, encounter, range) {
                self.go_on = false;
                return false;
            }
        }
        true
    }
}

impl<I: Intersector, C: Collector> CellVisitor<'_, I, C> {
    /// Offers the roots in a cell; the result says whether to go on.
    #[inline(always)]
    fn meet(&mut self, block: &Block, encounter: &Encounter, range: &mut Range<f64>) -> bool {
        let Self { cluster, ray, .. } = self;
        let cell = &block.cells[encounter.slot];
        let piece = cluster.piece(cell.piece);
        if !self.collector.wants(cluster.item(piece.item)) {
            return true;
        }
        let (rect, stray) = (cell.rect(), f64::from(encounter.stray));
        let target = Target {
            piece: cluster.net(piece),
            line: ray.line(piece),
            // What goes by the frame of the cell needs all of it.
            cell: if stray < UNIQUE {
                rect
            } else {
                encounter.part(&rect)
            },
            start: encounter.start.map(f64::from),
            rows: block.rows(encounter.slot, piece.radius * cluster.tree.scale()),
            stray,
        };
        I::roots(self.scratch, &target);
        settle(
            self.place,
            cluster,
            (piece, target.line.slack),
            &mut self.scratch.roots,
        );
        for root in &self.scratch.roots {
            if cell.is_trimmed && !keeps(cluster, piece, DVec2::new(root.u, root.v)) {
                continue;
            }
            let t = ray.time(&target, piece, root);
            if !range.contains(&t) {
                continue;
            }
            let kind = CandidateKind::Surface {
                piece: cell.piece,
                u: root.u,
                v: root.v,
                tangential: root.tangential,
            };
            let candidate = Candidate {
                t,
                instance: self.instance,
                kind,
            };
            if !self.collector.take(candidate, range) {
                return false;
            }
        }
        true
    }
}

/// Meets the triangles of the leaves that a ray passes.
pub(super) struct TriangleVisitor<'a, C> {
    pub(super) cluster: &'a Cluster<'a>,
    pub(super) ray: Sheared,
    pub(super) instance: u32,
    pub(super) collector: &'a mut C,
    pub(super) go_on: bool,
}

impl<C: Collector> Visitor for TriangleVisitor<'_, C> {
    #[inline(always)]
    fn leaf(&mut self, number: usize, range: &mut Range<f64>) -> bool {
        for number in self.cluster.triangle_tree.leaf(number) {
            let triangle = &self.cluster.triangles[number];
            if !self.collector.wants(self.cluster.item(triangle.item)) {
                continue;
            }
            let hit = self.ray.meet(&triangle.corners);
            let Some((t, barycentric)) = hit.filter(|(t, _)| range.contains(t)) else {
                continue;
            };
            let index = u32::try_from(number).expect("fewer triangles than fit");
            let candidate = Candidate {
                t,
                instance: self.instance,
                kind: CandidateKind::Triangle { index, barycentric },
            };
            if !self.collector.take(candidate, range) {
                self.go_on = false;
                return false;
            }
        }
        true
    }
}

/// A ray in the coordinates of a cluster, with its origin next to the cluster so that far
/// cameras lose no digits, and two planes through it.
pub(super) struct ClusterRay {
    origin: DVec3,
    direction: DVec3,
    unit: DVec3,
    /// The ray parameter of the origin.
    shift: f64,
    e1: DVec3,
    e2: DVec3,
    inverse_square: f64,
    /// How far the cluster reaches, which bounds the rounding errors of positions.
    reach: f64,
}

impl ClusterRay {
    #[inline(always)]
    pub(super) fn new(ray: &Ray, cluster: &Cluster<'_>) -> Self {
        let bounds = cluster.tree.bounds();
        let inverse_square = 1.0 / ray.direction.length_squared();
        let shift = (bounds.center() - ray.origin).dot(ray.direction) * inverse_square;
        let unit = ray.direction.normalize();
        let (e1, e2) = unit.any_orthonormal_pair();
        Self {
            origin: ray.at(shift),
            direction: ray.direction,
            unit,
            shift,
            e1,
            e2,
            inverse_square,
            reach: bounds.diagonal(),
        }
    }

    /// The ray parameter of a root.
    #[inline(always)]
    pub(super) fn time(&self, target: &Target<'_>, piece: &Piece, root: &Root) -> f64 {
        let [h, ..] = evaluate_at(&target.piece, root.u, root.v);
        let point = piece.center + h.truncate() / h.w * piece.radius;
        self.shift + (point - self.origin).dot(self.direction) * self.inverse_square
    }

    /// The ray's line in the units of a piece.
    #[inline(always)]
    pub(super) fn line(&self, piece: &Piece) -> Line {
        let origin = (self.origin - piece.center) / piece.radius;
        Line {
            origin,
            direction: self.unit,
            e1: self.e1,
            e2: self.e2,
            c1: self.e1.dot(origin),
            c2: self.e2.dot(origin),
            slack: SLACK * (1.0 + 0.1 * self.reach / piece.radius),
        }
    }
}
