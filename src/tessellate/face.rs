//! One face: constrained Delaunay triangles between its edges, refined until every one is
//! proven to be within the tolerance.

mod inside;
mod outline;
mod plane;
mod seed;

use std::collections::HashMap;
use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use smallvec::SmallVec;
use spade::handles::{FixedFaceHandle, FixedVertexHandle, InnerTag};
use spade::{
    ConstrainedDelaunayTriangulation, HasPosition, Point2, PositionInTriangulation,
    Triangulation as _,
};

use self::plane::Plane;
use self::seed::{Seed, seeds};
use super::pieces::{LINE, Rect};
use super::rim::Face;
use super::{Limits, deviation};

pub(super) use self::outline::{Corner, Meeting, Step, Stretch};

/// Rounds of refinement.
const ROUNDS: usize = 60;

/// Rounds in which triangles are divided all at once.
const ALIKE: usize = 5;

/// Triangles that are narrower than this share of the tolerance may be folded.
const NARROW: f64 = 1e-3;

/// Where coarse bounds are so many times too large better ones are seldom enough.
const HOPELESS: f64 = 2.0;

/// The part of the tolerance that is aimed at: the rest is for rounding on the way to files.
const AIM: f64 = 0.99;

/// The triangles of a face.
#[derive(Debug, Default)]
pub(super) struct Triangles {
    pub(super) vertices: Vec<Vertex>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// What is no triangle, as two of the corners are one point of space.
    pub(super) folded: Vec<[u32; 3]>,
    /// How far the surface is from all of them at most, proven.
    pub(super) proven: f64,
    /// Triangles for which that is more than the tolerance, or that pass another limit.
    pub(super) unproven: usize,
    /// Stretches of boundary that are not there, because they cross others.
    pub(super) undrawn: usize,
}

/// A vertex of a face.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    pub(super) uv: DVec2,
    pub(super) position: DVec3,
    /// The shared point, on boundaries.
    pub(super) id: Option<u32>,
    pub(super) gap: f64,
    /// The surface's normal, zero where that is no more than a limit; on a crease that of one side.
    pub(super) normal: DVec3,
}

/// A vertex in the plane of the triangulation.
#[derive(Clone, Copy, Debug)]
struct Spot(Point2<f64>);

impl HasPosition for Spot {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.0
    }
}

/// A triangle that belongs to the face.
struct Inner {
    /// Its number among all of the plane.
    place: usize,
    corners: [u32; 3],
}

/// A face in the making.
pub(super) struct Mesher<'a> {
    face: &'a Face<'a>,
    limits: &'a Limits<'a>,
    plane: ConstrainedDelaunayTriangulation<Spot>,
    stretched: Plane,
    vertices: Vec<Vertex>,
    /// Pairs of vertices whose connection is shared with other faces, and how often it
    /// bounds this one.
    fixed: HashMap<[u32; 2], usize>,
    bounds: Rect,
    /// What was known of the triangle in each place of the plane: its corners, how much it uses of
    /// the limits, and its proof.
    known: Vec<([u32; 3], (f64, f64))>,
    /// Whether boundaries can be counted to know what is inside, once that has been tried.
    trusts_count: Option<bool>,
    /// Stretches of boundary that cross others.
    undrawn: usize,
    /// The ends of stretches that are a point of space.
    poles: Vec<[DVec2; 2]>,
}

impl<'a> Mesher<'a> {
    /// Fills the face and refines it; nothing if there is no room for its points.
    pub(super) fn run(mut self) -> Triangles {
        if self.plane.num_inner_faces() == 0 {
            return Triangles::default();
        }
        self.add_creases();
        self.divide_apexes();
        let seeds = seeds(self.face, &self.stretched, &self.bounds, self.limits);
        let room = self.limits.room;
        if !room.is_left() {
            return Triangles::default();
        }
        for seed in seeds {
            self.sow(&seed);
        }
        for round in 0..ROUNDS {
            let inner = self.inner();
            let places: Vec<(DVec2, u32)> = inner
                .iter()
                .filter_map(|inner| {
                    // The last vertex has the fewest neighbours: some of the boundary have very many.
                    let [a, b, c] = inner.corners;
                    Some((self.division(inner)?, a.max(b).max(c)))
                })
                .collect();
            if places.is_empty() {
                return self.finish(&inner);
            }
            if !room.take(places.len() as f64) {
                return Triangles::default();
            }
            let before = self.vertices.len();
            for (place, near) in places {
                self.insert_beside(place, FixedVertexHandle::from_index(near as usize));
            }
            if round >= ALIKE {
                self.follow(before);
            }
        }
        let inner = self.inner();
        self.finish(&inner)
    }

    /// Divides what is around vertices from a number on, and around those that this makes: where each division
    /// asks for the next one a round for each would not end. No more than there were vertices before.
    fn follow(&mut self, from: usize) {
        let most = 2 * self.vertices.len();
        self.make_known();
        let mut next = from;
        while next < self.vertices.len() && self.vertices.len() < most {
            let vertex = self.plane.vertex(FixedVertexHandle::from_index(next));
            next += 1;
            // Around others not all belongs to the face.
            if vertex.out_edges().any(|edge| edge.is_constraint_edge()) {
                continue;
            }
            let around = vertex.out_edges().filter_map(|edge| edge.face().as_inner());
            let around: SmallVec<[FixedFaceHandle<InnerTag>; 8]> =
                around.map(|face| face.fix()).collect();
            for face in around {
                let inner = Inner {
                    place: face.index(),
                    corners: self.corners(face),
                };
                if let Some(place) = self.division(&inner) {
                    self.insert_beside(place, FixedVertexHandle::from_index(next - 1));
                    self.make_known();
                }
            }
        }
        self.limits.room.take((self.vertices.len() - from) as f64);
    }

    /// Makes room for what is known of the triangle in each place of the plane.
    fn make_known(&mut self) {
        let unknown = ([u32::MAX; 3], (f64::INFINITY, f64::INFINITY));
        self.known.resize(self.plane.num_all_faces(), unknown);
    }

    /// Where parameters are in the plane.
    fn spot(&self, uv: DVec2) -> Spot {
        let p = self.stretched.place(uv);
        // Far below what matters, and below what the triangulation accepts.
        let tidy = |x: f64| if x.abs() < 1e-40 { 0.0 } else { x };
        Spot(Point2::new(tidy(p.x), tidy(p.y)))
    }

    /// Puts a point inside the face into the plane, beside a vertex: the way from there is short.
    fn insert_beside(&mut self, uv: DVec2, near: FixedVertexHandle) {
        let spot = self.spot(uv);
        if let PositionInTriangulation::OnEdge(side) =
            self.plane.locate_with_hint(spot.position(), near)
        {
            // Neighbours know nothing of a point on a shared side.
            let [a, b] = self.plane.directed_edge(side).vertices();
            if self.fixed.contains_key(&pair(a.fix(), b.fix())) {
                return;
            }
        }
        if let Ok(handle) = self.plane.insert_with_hint(spot, near)
            && handle.index() == self.vertices.len()
        {
            let vertex = self.inner_vertex(uv);
            self.vertices.push(vertex);
        }
    }

    /// Puts a point into the plane; `None` if its place is not a number.
    fn insert(&mut self, uv: DVec2, corner: Option<&Corner>) -> Option<FixedVertexHandle> {
        let handle = self.plane.insert(self.spot(uv)).ok()?;
        if handle.index() == self.vertices.len() {
            let vertex = match corner {
                Some(corner) => Vertex {
                    uv,
                    position: corner.position,
                    id: Some(corner.id),
                    gap: corner.gap,
                    normal: self.face.point_and_normal(uv).1,
                },
                None => self.inner_vertex(uv),
            };
            self.vertices.push(vertex);
        }
        Some(handle)
    }

    /// A vertex that is not on a boundary, or divides a pole.
    fn inner_vertex(&self, uv: DVec2) -> Vertex {
        let (position, normal) = self.face.point_and_normal(uv);
        let plain = Vertex {
            uv,
            position,
            id: None,
            gap: 0.0,
            normal,
        };
        let domain = self.face.pieces.domain();
        let on_border = |axis: usize| uv[axis] <= domain.min[axis] || uv[axis] >= domain.max[axis];
        if !on_border(0) && !on_border(1) {
            return plain;
        }
        // Only poles are divided on the border: the point is that of their ends.
        let shared = self.vertices.iter().find(|v| {
            let same = |axis: usize| on_border(axis) && (v.uv[axis] - uv[axis]).abs() <= 0.0;
            v.id.is_some()
                && (same(0) || same(1))
                && v.position.distance(position) <= self.face.tolerance
        });
        shared.map_or(plain, |shared| Vertex {
            uv,
            gap: shared.position.distance(position),
            normal,
            ..*shared
        })
    }

    /// Draws the creases of the surface between the boundary's points on them.
    fn add_creases(&mut self) {
        self.cross_creases();
        for axis in 0..2 {
            let along = 1 - axis;
            for &crease in &self.face.pieces.creases[axis] {
                let on_line = |v: &Vertex| (v.uv[axis] - crease).abs() <= 0.0;
                let mut stops: Vec<f64> = self
                    .vertices
                    .iter()
                    .filter(|v| on_line(v))
                    .map(|v| v.uv[along])
                    .collect();
                stops.sort_by(f64::total_cmp);
                stops.dedup();
                for pair in stops.windows(2) {
                    let place = |t: f64| {
                        let mut uv = DVec2::splat(t);
                        uv[axis] = crease;
                        uv
                    };
                    let middle = place(0.5 * (pair[0] + pair[1]));
                    let region = self.face.region.as_ref();
                    if region.is_none_or(|r| r.contains(middle)) {
                        self.add_crease(place(pair[0]), place(pair[1]));
                    }
                }
            }
        }
    }

    /// Puts a point on an apex for the line through each vertex: else lines would come to it from others.
    fn divide_apexes(&mut self) {
        let Some(cone) = self.face.pieces.cone else {
            return;
        };
        let corners: Vec<DVec2> = self.vertices.iter().map(|v| v.uv).collect();
        for [a, b] in std::mem::take(&mut self.poles) {
            for &uv in &corners {
                let mut apex = a;
                apex[cone.across()] = uv[cone.across()];
                if cone.is_apex(a) && (a - apex).dot(b - apex) < 0.0 {
                    self.insert(apex, None);
                }
            }
        }
    }

    /// Puts points where creases cross each other, so that each is drawn from one to the next.
    fn cross_creases(&mut self) {
        let [across_u, across_v] = &self.face.pieces.creases;
        for &u in across_u {
            for &v in across_v {
                let uv = DVec2::new(u, v);
                if self.face.region.as_ref().is_none_or(|r| r.contains(uv)) {
                    self.insert(uv, None);
                }
            }
        }
    }

    /// A crease in steps that keep its own chords within the tolerance.
    fn add_crease(&mut self, from: DVec2, to: DVec2) {
        let mut stops = vec![from];
        let mut t: f64 = 0.0;
        let way = to - from;
        let mut step = 1.0;
        while t < 1.0 && self.limits.room.is_left() {
            let end = (t + step).min(1.0);
            let rect = Rect::around([from + way * t, from + way * end]);
            let part = way * (end - t);
            let spread = self.face.pieces.spread(&rect);
            let error = spread.chord(part, rect.size());
            let ratio = error / (0.9 * self.face.tolerance);
            if ratio > 1.0 && step > 1e-6 {
                step = (end - t) * (0.9 / ratio).sqrt().clamp(0.1, 0.9);
                continue;
            }
            step = (end - t) * (0.95 / ratio.max(1e-9)).sqrt().clamp(0.5, 4.0);
            t = end;
            stops.push(if t < 1.0 { from + way * t } else { to });
            self.limits.room.take(1.0);
        }
        let handles: Vec<_> = stops.iter().map(|&uv| self.insert(uv, None)).collect();
        for pair in handles.windows(2) {
            let [Some(a), Some(b)] = pair else { continue };
            if a != b && self.plane.can_add_constraint(*a, *b) {
                self.plane.add_constraint(*a, *b);
            }
        }
    }

    /// Inserts a seed unless it is outside or something is near already.
    fn sow(&mut self, seed: &Seed) {
        let outside = |r: &kernel::TrimRegion| !r.contains(seed.uv);
        if self.face.region.as_ref().is_some_and(outside) {
            return;
        }
        let p = self.stretched.place(seed.uv);
        let unit = (seed.step * self.stretched.factors(seed.uv)).recip();
        let here = self.plane.locate(Point2::new(p.x, p.y));
        let PositionInTriangulation::OnFace(face) = here else {
            return;
        };
        let face = self.plane.face(face);
        let place = |v: Point2<f64>| (DVec2::new(v.x, v.y) - p) * unit;
        for edge in face.adjacent_edges() {
            let (a, b) = (place(edge.from().position()), place(edge.to().position()));
            let way = b - a;
            let share = (-a.dot(way) / way.length_squared()).clamp(0.0, 1.0);
            let distance = (a + way * share).length();
            if a.length() < 0.55 || edge.is_constraint_edge() && distance < 0.4 {
                return;
            }
        }
        self.insert(seed.uv, None);
    }

    fn corners(&self, face: FixedFaceHandle<InnerTag>) -> [u32; 3] {
        let number = |k: usize| u32::try_from(k).unwrap_or(u32::MAX);
        let [a, b, c] = self.plane.face(face).vertices().map(|v| number(v.index()));
        // The same triangle has the same name in every round.
        if a < b && a < c {
            [a, b, c]
        } else if b < c {
            [b, c, a]
        } else {
            [c, a, b]
        }
    }

    /// Where to divide a triangle that passes a limit.
    fn division(&mut self, inner: &Inner) -> Option<DVec2> {
        let (ratio, _) = self.judge(inner, false);
        if ratio <= 1.0 {
            return None;
        }
        let corners = inner.corners.map(|k| self.vertices[k as usize]);
        let uvs = corners.map(|v| v.uv);
        let uses = self.sides(inner, &corners);
        // The side that passes its limit most, else the longest.
        let places = uvs.map(|uv| self.stretched.place(uv));
        let measure = |side: usize| {
            let length = places[side].distance(places[(side + 1) % 3]);
            (uses[side].max(1.0), length)
        };
        let is_free = |side: &usize| !self.is_fixed(inner, *side);
        let side = (0..3).filter(is_free).max_by(|&x, &y| {
            let (x, y) = (measure(x), measure(y));
            x.0.total_cmp(&y.0).then(x.1.total_cmp(&y.1))
        });
        let place = match side {
            Some(side) => self.stretched.middle(uvs[side], uvs[(side + 1) % 3]),
            None => (uvs[0] + uvs[1] + uvs[2]) / 3.0,
        };
        // Parameters too near to tell apart are not divided further.
        let domain = self.face.pieces.domain();
        let fine = (uvs[0] - place).abs().max((uvs[1] - place).abs()) / domain.size();
        (fine.max_element() > 1e-9).then_some(place)
    }

    /// How much a triangle uses of the limits (1 is all), and how far the surface over it is
    /// from it at most; infinitely far if it passes another limit, unless it is to be `proven`.
    fn judge(&mut self, inner: &Inner, proven: bool) -> (f64, f64) {
        let (corners, known) = self.known[inner.place];
        if corners == inner.corners && (known.1.is_finite() || !proven) {
            return known;
        }
        let corners = inner.corners.map(|k| self.vertices[k as usize]);
        let mut shape = self.sides(inner, &corners).into_iter().fold(0.0, f64::max);
        if shape > 1.0 && self.is_line(corners.map(|v| v.uv)) {
            shape = 0.0;
        }
        let found = if shape > 1.0 && !proven {
            (shape, f64::INFINITY)
        } else {
            let (ratio, distance) = self.distance(inner, &corners);
            (ratio.max(shape), distance)
        };
        self.known[inner.place] = (inner.corners, found);
        found
    }

    /// How much a triangle uses of the tolerance, and how far the surface is from it at most.
    fn distance(&self, inner: &Inner, corners: &[Vertex; 3]) -> (f64, f64) {
        let (uvs, points) = (corners.map(|v| v.uv), corners.map(|v| v.position));
        if self.is_folded(uvs, points) {
            return (f64::INFINITY, f64::INFINITY);
        }
        let gap = corners.iter().map(|v| v.gap).fold(0.0, f64::max);
        let tolerance = AIM * self.face.tolerance;
        let limit = (tolerance - gap).max(0.1 * tolerance);
        if let Some(round) = &self.face.pieces.round
            && !self.is_line(uvs)
        {
            // What the corners are off is a part of it, and no point is farther away than corners.
            let bound = round.off_flat(points).min(longest(points) + gap);
            return ((bound - gap).max(0.0) / limit, bound);
        }
        // What is seen to be too far needs no better bound.
        let is_far = || deviation::triangle(&self.face.pieces, uvs, points) - gap > limit;
        // What is shared is not divided, so that beside it only better bounds can help.
        let is_beside = corners.iter().any(|v| v.id.is_some()) || self.is_line(uvs);
        let hopeless = if is_beside { f64::INFINITY } else { HOPELESS };
        let off = |uvs| {
            let enough = (limit, hopeless * limit);
            self.face.pieces.off_flat(uvs, enough, is_far)
        };
        let bound = if self.is_line(uvs) {
            // What lies between its sides is no farther away than they are. Those that are shared are proven
            // where they are made.
            let own = (0..3).filter(|&side| !self.is_fixed(inner, side));
            let sides = own.map(|side| (uvs[side], uvs[(side + 1) % 3]));
            sides.map(|(a, b)| off([a, b, b])).fold(0.0, f64::max)
        } else {
            off(uvs)
        };
        (bound / limit, bound + gap)
    }

    /// Whether what belongs to a triangle runs around it the other way than in the parameters, so that it may
    /// lie beyond a boundary; not where it is too narrow to tell.
    fn is_folded(&self, uvs: [DVec2; 3], points: [DVec3; 3]) -> bool {
        let pieces = &self.face.pieces;
        let turns_back = match (&pieces.cone, &pieces.round) {
            (Some(cone), _) => {
                let turn = (uvs[1] - uvs[0]).perp_dot(uvs[2] - uvs[0]);
                turn * cone.turn(uvs) < 0.0
            }
            (_, Some(round)) => round.is_folded(points),
            _ => false,
        };
        let [a, b, c] = points;
        let height = || (b - a).cross(c - a).length() / longest(points);
        turns_back && height() > NARROW * self.face.tolerance && !self.is_line(uvs)
    }

    /// Whether a triangle is no wider in the parameters than a line, as beside a boundary that runs straight: what
    /// belongs to its points are those of that.
    fn is_line(&self, uvs: [DVec2; 3]) -> bool {
        let size = self.face.pieces.domain().size();
        let [a, b, c] = uvs.map(|uv| uv / size);
        let length = a.distance(b).max(b.distance(c)).max(c.distance(a));
        (b - a).perp_dot(c - a).abs() <= LINE * length
    }

    /// Whether a side of a triangle is shared with other faces.
    fn is_fixed(&self, inner: &Inner, side: usize) -> bool {
        let (a, b) = (inner.corners[side], inner.corners[(side + 1) % 3]);
        self.fixed.contains_key(&[a.min(b), a.max(b)])
    }

    /// How much the sides of a triangle use of their limits, at least where they pass them: the first
    /// from the first corner to the second, and so on. Those that are shared keep to them already, as far as they
    /// can.
    fn sides(&self, inner: &Inner, corners: &[Vertex; 3]) -> [f64; 3] {
        let center = (corners[0].uv + corners[1].uv + corners[2].uv) / 3.0;
        // Slightly more than asked of seeds, which are spaced for it exactly.
        let most = 1.02 * self.limits.angle;
        let least = most.min(PI).cos();
        let normal = |v: &Vertex| {
            if self.face.pieces.is_creased(v.uv) {
                return self.face.pieces.normal(v.uv, center).unwrap_or_default();
            }
            v.normal
        };
        [0, 1, 2].map(|side| {
            let (a, b) = (&corners[side], &corners[(side + 1) % 3]);
            let way = b.position - a.position;
            let ratio = way.length() / self.limits.max_edge;
            let (from, to) = (normal(a), normal(b));
            if from.dot(to) >= least {
                return ratio;
            }
            let angle = from.angle_between(to);
            // How far it goes the way that the normal turns: less than the tolerance means nothing.
            let turned = way.dot((to - from).normalize_or_zero()).abs();
            if angle > most && turned > self.face.tolerance && !self.is_fixed(inner, side) {
                ratio.max(angle / self.limits.angle)
            } else {
                ratio
            }
        })
    }

    fn finish(mut self, inner: &[Inner]) -> Triangles {
        let mut result = Triangles::default();
        result.triangles.reserve_exact(inner.len());
        for inner in inner {
            let (ratio, proven) = self.judge(inner, true);
            let corners = inner.corners;
            result.proven = result.proven.max(proven);
            result.unproven += usize::from(ratio > 1.0 || proven > self.face.tolerance);
            let ids = corners.map(|k| self.vertices[k as usize].id);
            let same = |a: Option<u32>, b: Option<u32>| a.is_some() && a == b;
            if same(ids[0], ids[1]) || same(ids[1], ids[2]) || same(ids[2], ids[0]) {
                result.folded.push(corners);
            } else {
                result.triangles.push(corners);
            }
        }
        if self.undrawn > 0 {
            // Triangles may reach over a boundary that is not there, or leave out what it bounds.
            result.proven = f64::INFINITY;
            result.unproven = result.triangles.len();
            result.undrawn = self.undrawn;
        }
        // No two triangles have the same side in the same direction.
        let side = |[a, b, _]: &[u32; 3]| u64::from(*a) << 32 | u64::from(*b);
        result.triangles.sort_unstable_by_key(side);
        result.vertices = self.vertices;
        result
    }
}

/// The longest side of a triangle.
fn longest([a, b, c]: [DVec3; 3]) -> f64 {
    a.distance(b).max(b.distance(c)).max(c.distance(a))
}

fn pair(a: FixedVertexHandle, b: FixedVertexHandle) -> [u32; 2] {
    let number = |k: usize| u32::try_from(k).unwrap_or(u32::MAX);
    let (a, b) = (number(a.index()), number(b.index()));
    [a.min(b), a.max(b)]
}
