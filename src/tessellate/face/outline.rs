//! The boundary of a face in the plane of its triangles.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use smallvec::SmallVec;
use spade::handles::FixedVertexHandle;
use spade::{
    ConstrainedDelaunayTriangulation, Intersection, LineIntersectionIterator, Triangulation as _,
};

use super::super::Limits;
use super::super::pieces::Rect;
use super::super::rim::Face;
use super::plane::Plane;
use super::{Mesher, pair};

/// Vertices for which there is room from the start, for each stretch of boundary.
const ROOM: usize = 2;

/// Where a boundary crosses itself more often, no more is told of it than that.
const MEETINGS: usize = 1000;

/// More stretches of boundary than this are many.
const MANY: usize = 1000;

/// Of many boundary points every so many are put into the plane, pass by pass.
const STRIDES: [usize; 7] = [16384, 4096, 1024, 256, 64, 16, 4];

/// Corners that are one point of space, and no farther apart than this share of the domain, are one:
/// between them is the gap of a loop, which may run back over its own curves.
const SAME: f64 = 1e-5;

/// A corner of a boundary, shared with other faces.
#[derive(Clone, Copy, Debug)]
pub(in crate::tessellate) struct Corner {
    pub(in crate::tessellate) uv: DVec2,
    pub(in crate::tessellate) id: u32,
    pub(in crate::tessellate) position: DVec3,
    pub(in crate::tessellate) gap: f64,
}

/// A straight stretch of boundary in parameters.
#[derive(Clone, Copy, Debug)]
pub(in crate::tessellate) struct Stretch {
    pub(in crate::tessellate) ends: [Corner; 2],
    /// What it is a part of.
    pub(in crate::tessellate) step: Step,
    /// Whether it is a point of space, and may be divided.
    pub(in crate::tessellate) pole: bool,
    /// Whether it is a gap bridged by a point, short in parameters, too.
    pub(in crate::tessellate) dot: bool,
}

/// A step of the chain of an edge, as one of the faces sees it.
#[derive(Clone, Copy, Debug)]
pub(in crate::tessellate) struct Step {
    pub(in crate::tessellate) edge: usize,
    /// Which use of the edge.
    pub(in crate::tessellate) used: usize,
    /// The station at which it starts.
    pub(in crate::tessellate) start: usize,
}

/// Two steps of boundaries that cross, or of which one ends on the other, and where on each, as a share of
/// its length.
pub(in crate::tessellate) type Meeting = [(Step, f64); 2];

/// What was drawn of a boundary.
struct Drawn<'s> {
    stretches: &'s [Stretch],
    /// The ends of every stretch.
    handles: Vec<[Option<FixedVertexHandle>; 2]>,
    /// The stretch between two vertices.
    owners: HashMap<[u32; 2], usize>,
}

impl<'a> Mesher<'a> {
    /// Puts the boundary into the plane; beside it where it crosses itself.
    pub(in crate::tessellate) fn new(
        face: &'a Face<'a>,
        stretches: &[Stretch],
        limits: &'a Limits<'a>,
    ) -> (Self, Vec<Meeting>) {
        let corners = || stretches.iter().flat_map(|s| s.ends);
        let count = ROOM * stretches.len();
        let bounds = Rect::around(corners().map(|c| c.uv));
        let mut mesher = Self {
            face,
            limits,
            plane: ConstrainedDelaunayTriangulation::with_capacity(count, 3 * count, 2 * count),
            vertices: Vec::new(),
            fixed: HashMap::with_capacity(stretches.len()),
            bounds,
            stretched: Plane::new(face, &bounds, limits),
            known: Vec::new(),
            trusts_count: None,
            undrawn: 0,
            poles: Vec::new(),
        };
        let poles = stretches.iter().filter(|s| s.pole);
        mesher.poles = poles.map(|s| s.ends.map(|corner| corner.uv)).collect();
        let mut known: HashMap<u32, SmallVec<[(DVec2, FixedVertexHandle); 1]>> =
            HashMap::with_capacity(stretches.len());
        let near = face.pieces.domain().size() * SAME;
        // What dots connect is one vertex.
        let mut spans: HashMap<u32, DVec2> = HashMap::new();
        for stretch in stretches.iter().filter(|s| s.dot) {
            let [a, b] = stretch.ends;
            *spans.entry(a.id).or_insert(near) += (a.uv - b.uv).abs();
        }
        let mut drawn = Drawn {
            stretches,
            handles: vec![[None; 2]; stretches.len()],
            owners: HashMap::with_capacity(stretches.len()),
        };
        for number in order(stretches, bounds.size()) {
            let ends = stretches[number].ends.map(|corner| {
                let list = known.entry(corner.id).or_default();
                let span = spans.get(&corner.id).copied().unwrap_or(near);
                let same = list
                    .iter()
                    .find(|(uv, _)| (*uv - corner.uv).abs().cmple(span).all());
                if let Some((_, handle)) = same {
                    return Some(*handle);
                }
                let handle = mesher.insert(corner.uv, Some(&corner))?;
                list.push((corner.uv, handle));
                Some(handle)
            });
            drawn.handles[number] = ends;
        }
        let poles = mesher.poles(&drawn);
        let mut meetings = Vec::new();
        for (number, stretch) in stretches.iter().enumerate() {
            let [Some(a), Some(b)] = drawn.handles[number] else {
                continue;
            };
            let pair = pair(a, b);
            let pole = poles.get(&pair).filter(|_| stretch.pole);
            if a == b || pole.is_some_and(|times| times.is_multiple_of(2)) {
                continue;
            }
            let is_side = mesher.plane.get_edge_from_neighbors(a, b).is_some();
            let has_room = is_side
                || if meetings.len() < MEETINGS {
                    mesher.has_room(number, [a, b], &drawn, &mut meetings)
                } else {
                    mesher.plane.can_add_constraint(a, b)
                };
            if !has_room {
                mesher.undrawn += 1;
                continue;
            }
            mesher.plane.add_constraint(a, b);
            drawn.owners.insert(pair, number);
            if pole.is_none() {
                *mesher.fixed.entry(pair).or_default() += 1;
            }
        }
        (mesher, meetings)
    }

    /// The poles that may be divided, by their ends, and how often each is there: twice is the same as not at all. Elsewhere
    /// than on a side of the domain, as where an end is one with others beside it, a pole is not divided.
    fn poles(&self, drawn: &Drawn<'_>) -> HashMap<[u32; 2], usize> {
        let mut poles = HashMap::new();
        for (stretch, ends) in drawn.stretches.iter().zip(&drawn.handles) {
            if let ([Some(a), Some(b)], true) = (*ends, stretch.pole)
                && self.is_on_border([a.index(), b.index()])
            {
                *poles.entry(pair(a, b)).or_default() += 1;
            }
        }
        poles
    }

    /// Whether a stretch of boundary crosses nothing that was drawn. Appends where it does, and where it
    /// passes through the end of another.
    fn has_room(
        &self,
        number: usize,
        [a, b]: [FixedVertexHandle; 2],
        drawn: &Drawn<'_>,
        meetings: &mut Vec<Meeting>,
    ) -> bool {
        let mut has_room = true;
        let place = |vertex: FixedVertexHandle| {
            let uv = self.vertices[vertex.index()].uv;
            self.stretched.unleaned(uv)
        };
        let (from, way) = (place(a), place(b) - place(a));
        for found in LineIntersectionIterator::new_from_handles(&self.plane, a, b) {
            let (other, shares) = match found {
                Intersection::VertexIntersection(vertex) => {
                    let vertex = vertex.fix();
                    if vertex == a || vertex == b {
                        continue;
                    }
                    let ends_there =
                        |ends: &[Option<_>; 2]| ends[0] != ends[1] && ends.contains(&Some(vertex));
                    let Some(other) = drawn.handles.iter().position(ends_there) else {
                        continue;
                    };
                    let share = (place(vertex) - from).dot(way) / way.length_squared();
                    let end = f64::from(u8::from(drawn.handles[other][1] == Some(vertex)));
                    (other, [share, end])
                }
                Intersection::EdgeIntersection(edge) if edge.is_constraint_edge() => {
                    has_room = false;
                    let [c, d] = edge.vertices().map(|v| v.fix());
                    let Some(&other) = drawn.owners.get(&pair(c, d)) else {
                        continue;
                    };
                    let [c, d] = drawn.handles[other].map(|v| v.map_or(from, place));
                    let across = way.perp_dot(d - c);
                    let shares = [(c - from).perp_dot(d - c), (c - from).perp_dot(way)];
                    (other, shares.map(|share| share / across))
                }
                _ => continue,
            };
            if shares.iter().all(|share| share.is_finite()) {
                let step = |number: usize| drawn.stretches[number].step;
                let [own, others] = shares.map(|share| share.clamp(0.0, 1.0));
                meetings.push([(step(number), own), (step(other), others)]);
            }
        }
        has_room
    }
}

/// The order in which ends are put into the plane. Of many those come first that are far apart and not on one
/// side of a domain: until vertices span a triangle, each next one takes as long as all before together. Then come
/// more and more of the others, since one that sees all of a side divides as many triangles as that has steps.
fn order(stretches: &[Stretch], size: DVec2) -> impl Iterator<Item = usize> {
    let count = stretches.len();
    let ways = [DVec2::ONE, DVec2::NEG_ONE, DVec2::new(1.0, -1.0)];
    let is_many = count > MANY;
    let outermost = ways
        .into_iter()
        .filter(move |_| is_many)
        .filter_map(move |way| {
            let along = |k: &usize| (stretches[*k].ends[0].uv / size).dot(way);
            (0..count).max_by(|a, b| along(a).total_cmp(&along(b)))
        });
    let coarse = STRIDES.into_iter().filter(move |_| is_many);
    let strides = coarse.chain([1]);
    outermost.chain(strides.flat_map(move |stride| (0..count).step_by(stride)))
}
