//! From the boundaries of faces to the edges that they share, by geometry.
//!
//! Files of surfaces mostly say nothing about neighbours. Here two stretches of boundary become one
//! edge if they have the same ends and stay together in between, first within a thousandth
//! of the tolerance, then within more and more of it: what fits well finds its partner before
//! a wider reach could confuse it with something else. Seams that a file names may be as far apart as
//! the tolerance, and so, nearly, may what is long and has found no partner otherwise.

mod dots;
mod ends;
mod pairs;

use glam::{DVec2, DVec3};
use kernel::{Aabb, Curve};
use rayon::prelude::*;

use self::ends::{End, Ends};
use super::rim::Face;
use super::trail::Trail;

/// Reaches of the passes, as shares of the tolerance.
const REACHES: [f64; 4] = [1e-3, 1e-2, 0.1, 0.5];

/// What is so many times the reach is long: such a strand may become a ring, and a face that goes such
/// a way from one strand to another may have its seam there.
const LONG: f64 = 10.0;

/// Parts of a strand are so many times as long as the reach, or vertices that become one later might be left
/// apart.
const APART: f64 = 2.0;

/// A trail of fewer points says too little of what lies between its ends.
const FEW: usize = 9;

/// Passes in which a face may be sewn to itself in any case: most seams fit well.
const SEAM_PASSES: usize = 2;

/// Fewer strands, or ends of them, are not worth another thread.
const OF_A_THREAD: usize = 256;

/// A stretch of boundary on one face.
#[derive(Clone, Debug)]
pub(crate) struct Use {
    pub(crate) face: usize,
    pub(crate) curve: Curve<DVec2>,
    pub(crate) trail: Trail,
    /// Whether the edge runs from the end of the curve to its start.
    pub(crate) reversed: bool,
}

/// An edge of one or more faces.
#[derive(Clone, Debug)]
pub(crate) struct Edge {
    /// Never empty; the first is run through forwards.
    pub(crate) uses: Vec<Use>,
    /// Vertices where it starts and ends.
    pub(crate) ends: [usize; 2],
    /// Whether all of it is one point of space: a pole, or a bridged gap.
    pub(crate) collapsed: bool,
}

impl Edge {
    /// Whether it has a face on one side only.
    pub(crate) fn is_naked(&self) -> bool {
        self.uses.len() == 1 && !self.collapsed
    }
}

/// Edges and vertices of a group of faces.
#[derive(Debug, Default)]
pub(crate) struct Sewn {
    pub(crate) edges: Vec<Edge>,
    pub(crate) vertices: Vec<DVec3>,
}

/// A stretch of boundary while it looks for partners.
struct Strand {
    face: usize,
    curve: Curve<DVec2>,
    ends: [usize; 2],
    trail: Trail,
    edge: Option<usize>,
    collapsed: bool,
    /// Whether it looks for partners now.
    awake: bool,
}

/// Strands that are one edge, and which of them run against the first.
struct Joint {
    strands: Vec<(usize, bool)>,
    ends: [usize; 2],
    collapsed: bool,
}

/// Curves on two faces that the file says are one.
#[derive(Clone, Debug)]
pub(crate) struct Named<'s> {
    /// Position of the face, and the curve on it.
    pub(super) sides: [(usize, &'s Curve<DVec2>); 2],
    /// How far apart they are at most.
    pub(super) gap: f64,
}

/// Sews the boundary curves of faces, given with the number of their face, first to those of faces with the same
/// owner, if there are owners: bodies that touch stay what they are. An edge may be `wider` times as far
/// from its faces as the tolerance.
pub(crate) fn sew(
    faces: &[Face<'_>],
    rims: Vec<(usize, Curve<DVec2>)>,
    named: &[Named<'_>],
    owners: &[usize],
    wider: f64,
) -> Sewn {
    let least = faces.iter().fold(f64::INFINITY, |m, f| m.min(f.tolerance));
    let tolerance = wider * least;
    let mut sewer = Sewer {
        faces,
        owners: &[],
        tolerance,
        strands: Vec::new(),
        nodes: Vec::new(),
        parents: Vec::new(),
        links: Vec::new(),
        boxes: Vec::new(),
        joints: Vec::new(),
        apart: APART,
    };
    let trail = |(face, curve): (usize, Curve<DVec2>)| {
        let trail = Trail::of(&faces[face], &curve);
        (face, curve, trail)
    };
    let rims = rims.into_par_iter().with_min_len(OF_A_THREAD).map(trail);
    for (face, curve, trail) in rims.collect::<Vec<_>>() {
        let ends =
            [trail.points[0].1, trail.points[trail.points.len() - 1].1].map(|p| sewer.add_node(p));
        sewer.add_strand(face, curve, ends, trail);
    }
    if owners.iter().any(|owner| *owner != owners[0]) {
        sewer.owners = owners;
        (0..REACHES.len()).for_each(|pass| sewer.pass(pass));
        sewer.owners = &[];
    }
    for pass in 0..REACHES.len() {
        sewer.pass(pass);
    }
    let widest = tolerance * REACHES[REACHES.len() - 1];
    // Wider ones would move a border by more than the tolerance.
    let is_wide = |seam: &&Named<'_>| seam.gap > widest && seam.gap <= tolerance;
    for seam in named.iter().filter(is_wide) {
        sewer.close(seam);
    }
    // What hung between dots may fit afterwards.
    sewer.shrink(widest);
    // What is farther apart now stays two vertices.
    sewer.apart = 1.0;
    sewer.split_at_nodes(widest, false);
    sewer.match_strands(widest, false);
    sewer.match_long();
    sewer.finish()
}

struct Sewer<'f, 's> {
    faces: &'f [Face<'s>],
    /// The owner of each face while those of others are not looked at.
    owners: &'f [usize],
    /// The least of the faces.
    tolerance: f64,
    strands: Vec<Strand>,
    nodes: Vec<DVec3>,
    /// Union-find over nodes.
    parents: Vec<usize>,
    /// Strands that end at each root.
    links: Vec<Vec<usize>>,
    /// Boxes around the nodes of each root.
    boxes: Vec<Aabb>,
    joints: Vec<Joint>,
    /// No strand is divided nearer to its ends than so many times the reach.
    apart: f64,
}

impl Sewer<'_, '_> {
    fn pass(&mut self, pass: usize) {
        let reach = self.tolerance * REACHES[pass];
        let seams = pass < SEAM_PASSES;
        self.merge_nodes(reach, pass == 0);
        if pass == 0 {
            self.collapse(reach);
        }
        self.split_at_nodes(reach, seams);
        self.match_strands(reach, seams);
    }

    /// Whether one face is to be looked at for another one.
    fn is_seen(&self, a: usize, b: usize) -> bool {
        self.owners.is_empty() || self.owners[a] == self.owners[b]
    }

    fn add_node(&mut self, point: DVec3) -> usize {
        self.nodes.push(point);
        self.parents.push(self.parents.len());
        self.links.push(Vec::new());
        self.boxes.push(Aabb::around([point]));
        self.nodes.len() - 1
    }

    fn add_strand(&mut self, face: usize, curve: Curve<DVec2>, ends: [usize; 2], trail: Trail) {
        for end in ends {
            let root = self.root(end);
            self.links[root].push(self.strands.len());
        }
        self.strands.push(Strand {
            face,
            curve,
            ends,
            trail,
            edge: None,
            collapsed: false,
            awake: true,
        });
    }

    /// Sews the strands that are awake.
    fn match_awake(&mut self, reach: f64) {
        self.merge_nodes(reach, false);
        self.split_at_nodes(reach, false);
        self.match_strands(reach, false);
    }

    /// Sews what lies on the sides of a seam.
    fn close(&mut self, seam: &Named<'_>) {
        let tolerance = self.tolerance;
        let sides = seam
            .sides
            .map(|(face, curve)| (face, curve, Trail::of(&self.faces[face], curve)));
        let faces = self.faces;
        for strand in &mut self.strands {
            let on = |(face, curve, trail): &(usize, &Curve<DVec2>, Trail)| {
                let place = (&faces[*face], *curve);
                *face == strand.face && strand.trail.runs_beside(trail, place, tolerance)
            };
            strand.awake = sides.iter().any(on);
        }
        // A little more, since the gap was found at points.
        let reach = seam.gap * 1.01;
        self.match_awake(reach);
    }

    fn root(&self, mut node: usize) -> usize {
        while self.parents[node] != node {
            node = self.parents[node];
        }
        node
    }

    fn roots(&self, strand: &Strand) -> [usize; 2] {
        strand.ends.map(|end| self.root(end))
    }

    fn is_open(strand: &Strand) -> bool {
        strand.awake && strand.edge.is_none() && !strand.collapsed
    }

    /// The ends of strands without partner.
    fn open_ends(&self) -> Ends {
        let open = self.strands.iter().filter(|s| Self::is_open(s));
        let end = |node: usize, face: usize| End {
            node,
            face,
            point: self.nodes[node],
        };
        Ends::new(
            open.flat_map(|s| s.ends.map(|node| end(node, s.face)))
                .collect(),
        )
    }

    /// Makes one vertex of ends within `reach`; a strand keeps its length unless `freely`.
    fn merge_nodes(&mut self, reach: f64, freely: bool) {
        self.for_close_ends(reach, |sewer, a, b| sewer.unite(a, b, reach, freely));
    }

    /// Visits the ends of strands without partner that are within `reach` of each other.
    fn for_close_ends(&mut self, reach: f64, mut visit: impl FnMut(&mut Self, usize, usize)) {
        let ends = self.open_ends();
        let close = |(k, a): (usize, &End)| {
            let near = ends.within(a.point - reach, a.point + reach).into_iter();
            let mut found = Vec::new();
            for other in near.filter(|&other| other > k) {
                let b = &ends.ends[other];
                if a.point.distance(b.point) <= reach && self.is_seen(a.face, b.face) {
                    found.push((a.node, b.node));
                }
            }
            found
        };
        let all = ends.ends.par_iter().enumerate().with_min_len(OF_A_THREAD);
        for (a, b) in all.flat_map_iter(close).collect::<Vec<_>>() {
            visit(self, a, b);
        }
    }

    fn unite(&mut self, a: usize, b: usize, reach: f64, freely: bool) {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return;
        }
        let collapses = |&s: &usize| {
            let strand = &self.strands[s];
            let ends = self.roots(strand);
            // What is long becomes a ring.
            (ends == [a, b] || ends == [b, a]) && strand.trail.length() <= LONG * reach
        };
        if !freely && self.links[a].iter().any(collapses) {
            return;
        }
        // Chains of near points do not become one far-reaching vertex.
        let both = self.boxes[a].union(self.boxes[b]);
        if both.diagonal() > (1.5 * reach).min(self.tolerance) {
            return;
        }
        let (keep, drop) = if self.links[a].len() >= self.links[b].len() {
            (a, b)
        } else {
            (b, a)
        };
        self.parents[drop] = keep;
        let moved = std::mem::take(&mut self.links[drop]);
        self.links[keep].extend(moved);
        self.boxes[keep] = both;
    }

    /// Finds the strands that are one point of space.
    fn collapse(&mut self, reach: f64) {
        for s in 0..self.strands.len() {
            let ends = self.roots(&self.strands[s]);
            let strand = &mut self.strands[s];
            let is_point = ends[0] == ends[1] && strand.trail.length() <= 4.0 * reach;
            strand.collapsed = strand.edge.is_none() && is_point;
        }
    }

    /// Divides strands where the end of another one lies on them.
    fn split_at_nodes(&mut self, reach: f64, seams: bool) {
        let others = self.open_ends();
        // What is made here joins no nodes that were there before, so that what is found now stays true.
        let first = |(s, strand): (usize, &Strand)| {
            if Self::is_open(strand) {
                self.node_on(s, &others, reach, seams)
            } else {
                None
            }
        };
        let all = self.strands.par_iter().enumerate();
        let first: Vec<Option<(usize, f64)>> = all.with_min_len(OF_A_THREAD).map(first).collect();
        let mut s = 0;
        while s < self.strands.len() {
            // Parts made here are looked at, too: they come later in the list.
            let known = first.get(s).copied();
            let mut found = known.unwrap_or_else(|| self.node_on(s, &others, reach, seams));
            while let Some((node, at)) = found {
                self.split(s, node, at, reach);
                found = self.node_on(s, &others, reach, seams);
            }
            s += 1;
        }
    }

    /// A node that lies on a strand, away from its ends.
    fn node_on(&self, s: usize, others: &Ends, reach: f64, seams: bool) -> Option<(usize, f64)> {
        let strand = &self.strands[s];
        let face = &self.faces[strand.face];
        let bounds = strand.trail.bounds;
        let ends = self.roots(strand);
        let end_points = strand.ends.map(|e| self.nodes[e]);
        let inside = others.within(bounds.min - reach, bounds.max + reach);
        inside
            .into_iter()
            .map(|number| &others.ends[number])
            .filter(|other| seams || other.face != strand.face)
            .filter(|other| self.is_seen(other.face, strand.face))
            .filter(|other| {
                let is_away = |e: &DVec3| e.distance(other.point) > self.apart * reach;
                end_points.iter().all(is_away) && !ends.contains(&self.root(other.node))
            })
            .find_map(|other| {
                let place = (face, &strand.curve);
                let (t, _) = strand.trail.project_within(place, other.point, reach)?;
                let range = strand.curve.domain();
                (range.start < t && t < range.end).then_some((other.node, t))
            })
    }

    fn split(&mut self, s: usize, node: usize, at: f64, reach: f64) {
        let Ok([before, after]) = self.strands[s].curve.split(at) else {
            return;
        };
        let face = self.strands[s].face;
        let point = self.faces[face].point(after.start());
        let [first, second] = self.strands[s].trail.split((at, point));
        let fine = |part: Trail, curve: &Curve<DVec2>| {
            if part.points.len() < FEW {
                Trail::of(&self.faces[face], curve)
            } else {
                part
            }
        };
        let (first, second) = (fine(first, &before), fine(second, &after));
        let middle = self.add_node(point);
        self.unite(middle, node, reach, true);
        let end = self.strands[s].ends[1];
        let old = self.root(end);
        self.links[old].retain(|&k| k != s);
        self.strands[s].curve = before;
        self.strands[s].trail = first;
        self.strands[s].ends[1] = middle;
        let root = self.root(middle);
        self.links[root].push(s);
        if self.root(self.strands[s].ends[0]) == old {
            self.links[old].push(s);
        }
        self.add_strand(face, after, [middle, end], second);
    }

    fn join(&mut self, a: usize, b: usize) {
        let edge = self.strands[a].edge.unwrap_or_else(|| {
            self.joints.push(Joint {
                strands: vec![(a, false)],
                ends: self.roots(&self.strands[a]),
                collapsed: false,
            });
            self.joints.len() - 1
        });
        let (first, second) = (&self.strands[a], &self.strands[b]);
        let ends = self.roots(first);
        let reversed = if ends[0] == ends[1] {
            // Closed: look where the first quarter of one lies on the other.
            let face = &self.faces[second.face];
            let place = |share: usize| {
                let points = &first.trail.points;
                let p = points[points.len() * share / 8].1;
                second.trail.project(face, &second.curve, p).0
            };
            place(2) > place(5)
        } else {
            self.roots(second)[0] != ends[0]
        };
        self.joints[edge].strands.push((b, reversed));
        self.strands[a].edge = Some(edge);
        self.strands[b].edge = Some(edge);
    }

    fn finish(mut self) -> Sewn {
        for (s, strand) in self.strands.iter().enumerate() {
            if strand.edge.is_none() {
                self.joints.push(Joint {
                    strands: vec![(s, false)],
                    ends: self.roots(strand),
                    collapsed: strand.collapsed,
                });
            }
        }
        // Roots become vertices in the middle of what was merged.
        let mut number = vec![usize::MAX; self.nodes.len()];
        let mut sums: Vec<(DVec3, f64)> = Vec::new();
        for node in 0..self.nodes.len() {
            let at = &mut number[self.root(node)];
            if *at == usize::MAX {
                *at = sums.len();
                sums.push((DVec3::ZERO, 0.0));
            }
            sums[*at].0 += self.nodes[node];
            sums[*at].1 += 1.0;
        }
        let joints = std::mem::take(&mut self.joints);
        let ends: Vec<_> = joints
            .iter()
            .map(|joint| joint.ends.map(|end| number[self.root(end)]))
            .collect();
        let mut strands: Vec<_> = self.strands.into_iter().map(Some).collect();
        let edges = joints.into_iter().zip(ends).map(|(joint, ends)| {
            let used = |(s, reversed): (usize, bool)| {
                let strand = strands[s].take()?;
                Some(Use {
                    face: strand.face,
                    curve: strand.curve,
                    trail: strand.trail,
                    reversed,
                })
            };
            Edge {
                uses: joint.strands.into_iter().filter_map(used).collect(),
                ends,
                collapsed: joint.collapsed,
            }
        });
        Sewn {
            edges: edges.collect(),
            vertices: sums.into_iter().map(|(sum, count)| sum / count).collect(),
        }
    }
}
