//! Which triangles of the plane belong to a face.

use glam::DVec2;
use kernel::Sets;
use spade::handles::{DirectedEdgeHandle, FixedFaceHandle, InnerTag};
use spade::{CdtEdge, Triangulation as _};

use super::{Inner, Mesher, Spot, pair};

/// Counting boundaries and looking at the middles of triangles may differ in this share of the
/// face's parameters: where its boundaries are chords.
const DIFFERENCE: f64 = 0.5;

/// This share of an area is not what decides about all of it.
const MINOR: f64 = 0.1;

/// How far beside its corners, as shares of the way to its middle, a triangle is looked at as well.
const BESIDE: [f64; 4] = [0.1, 1e-2, 1e-3, 1e-4];

/// A side of a triangle of the plane.
type Side<'a> = DirectedEdgeHandle<'a, Spot, (), CdtEdge<()>, ()>;

impl Mesher<'_> {
    /// The triangles that belong to the face.
    pub(super) fn inner(&mut self) -> Vec<Inner> {
        // Without loops there is nothing to count.
        let is_cut = self.face.region.is_some();
        let counted = is_cut.then(|| self.counted()).flatten().filter(|inside| {
            let trusted = self.trusts_count;
            trusted.unwrap_or_else(|| self.agrees(inside))
        });
        self.trusts_count = Some(counted.is_some());
        // There is none, it is not closed, or it runs twice: look at every triangle.
        let inside = counted.unwrap_or_else(|| self.looked_up());
        let faces = self.plane.inner_faces().map(|face| face.fix());
        let belongs = |face: &FixedFaceHandle<InnerTag>| inside[face.index()];
        let named = |face: FixedFaceHandle<InnerTag>| Inner {
            place: face.index(),
            corners: self.corners(face),
        };
        let inner = faces.filter(belongs).map(named).collect();
        self.make_known();
        inner
    }

    /// By number which triangles are an odd number of boundaries away from the outside; `None`
    /// if that depends on the way.
    fn counted(&self) -> Option<Vec<bool>> {
        let mut inside: Vec<Option<bool>> = vec![None; self.plane.num_all_faces()];
        let mut stack: Vec<FixedFaceHandle<InnerTag>> = Vec::new();
        let mut sound = true;
        for edge in self.plane.convex_hull() {
            if let Some(face) = edge.rev().face().as_inner() {
                let own = self.is_border(edge);
                match inside[face.index()] {
                    None => stack.push(face.fix()),
                    Some(known) => sound &= known == own,
                }
                inside[face.index()] = Some(own);
            }
        }
        while let Some(face) = stack.pop() {
            let here = inside[face.index()] == Some(true);
            for edge in self.plane.face(face).adjacent_edges() {
                let Some(other) = edge.rev().face().as_inner() else {
                    continue;
                };
                let own = here ^ self.is_border(edge);
                match inside[other.index()] {
                    None => {
                        inside[other.index()] = Some(own);
                        stack.push(other.fix());
                    }
                    Some(known) => sound &= known == own,
                }
            }
        }
        let inside = inside.into_iter().map(|known| known == Some(true));
        sound.then(|| inside.collect())
    }

    /// By number which triangles belong to the face, by their middles: alike what no boundary keeps apart if
    /// that is plain. So what lies between a boundary and its chord does not.
    fn looked_up(&self) -> Vec<bool> {
        let count = self.plane.num_all_faces();
        let mut sets = Sets::new(count);
        for edge in self.plane.undirected_edges() {
            let edge = edge.as_directed();
            if self.borders(edge) == 0 {
                sets.join(edge.face().index(), edge.rev().face().index());
            }
        }
        let outside = sets.root(self.plane.outer_face().index());
        let mut inside = vec![false; count];
        // The area of each set, and of what of it has its middle inside.
        let mut areas = vec![[0.0; 2]; count];
        for face in self.plane.inner_faces() {
            let is_inside = self.is_inside(face.fix());
            inside[face.index()] = is_inside;
            let own = &mut areas[sets.root(face.index())];
            own[0] += face.area();
            own[1] += if is_inside { face.area() } else { 0.0 };
        }
        let all: f64 = areas.iter().map(|own| own[1]).sum();
        for face in self.plane.inner_faces() {
            let set = sets.root(face.index());
            let [own, within] = areas[set];
            let inside = &mut inside[face.index()];
            if set == outside {
                *inside &= within > MINOR * all;
            } else if within <= MINOR * own {
                *inside = false;
            } else if within >= (1.0 - MINOR) * own {
                *inside = true;
            }
        }
        inside
    }

    /// Whether most of what was counted belongs to the face by its loops, and the other way
    /// round.
    fn agrees(&self, inside: &[bool]) -> bool {
        let (mut all, mut different) = (0.0, 0.0);
        for face in self.plane.inner_faces() {
            let counted = inside[face.index()];
            let differs = self.differs(face.fix(), counted);
            let area = face.area();
            all += if counted || differs { area } else { 0.0 };
            different += if differs { area } else { 0.0 };
        }
        different <= DIFFERENCE * all
    }

    /// Whether an edge bounds the face, rather than lie inside it or outside.
    fn is_border(&self, edge: Side<'_>) -> bool {
        self.borders(edge) % 2 == 1
    }

    /// How often an edge is a part of the boundary.
    fn borders(&self, edge: Side<'_>) -> usize {
        if !edge.is_constraint_edge() {
            return 0;
        }
        let [a, b] = edge.vertices().map(|v| v.fix());
        if let Some(count) = self.fixed.get(&pair(a, b)) {
            return *count;
        }
        // What is left of a pole, as opposed to a crease, runs along the domain's border.
        usize::from(self.is_on_border([a, b].map(|v| v.index())))
    }

    /// Whether two vertices are on one side of the domain.
    pub(super) fn is_on_border(&self, ends: [usize; 2]) -> bool {
        let domain = self.face.pieces.domain();
        let [a, b] = ends.map(|vertex| self.vertices[vertex].uv);
        let along = |axis: usize, border: f64| {
            (a[axis] - border).abs() <= 0.0 && (b[axis] - border).abs() <= 0.0
        };
        (0..2).any(|axis| along(axis, domain.min[axis]) || along(axis, domain.max[axis]))
    }

    /// Whether the middle of a triangle belongs to the face.
    fn is_inside(&self, face: FixedFaceHandle<InnerTag>) -> bool {
        let uvs = self.corners(face).map(|k| self.vertices[k as usize].uv);
        self.contains((uvs[0] + uvs[1] + uvs[2]) / 3.0)
    }

    /// Whether neither the middle of a triangle nor what is beside its corners is as was counted: in
    /// a narrow ring the middle may lie between a boundary and its chord.
    fn differs(&self, face: FixedFaceHandle<InnerTag>, counted: bool) -> bool {
        let uvs = self.corners(face).map(|k| self.vertices[k as usize].uv);
        let center = (uvs[0] + uvs[1] + uvs[2]) / 3.0;
        let mut places = uvs
            .iter()
            .flat_map(|uv| BESIDE.map(|share| uv.lerp(center, share)));
        self.contains(center) != counted && places.all(|uv| self.contains(uv) != counted)
    }

    /// Whether a place of the parameters belongs to the face.
    fn contains(&self, uv: DVec2) -> bool {
        let domain = self.face.pieces.domain();
        let inside = uv.cmpgt(domain.min).all() && uv.cmplt(domain.max).all();
        inside && self.face.region.as_ref().is_none_or(|r| r.contains(uv))
    }
}
