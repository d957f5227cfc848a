//! The edges of a group of faces as chains of points, divided until boundaries keep apart or meet in
//! points.

use std::collections::{HashMap, HashSet};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::Limits;
use super::edge::{Chain, Station, Walker};
use super::face::{Corner, Meeting, Mesher, Step, Stretch, Triangles};
use super::rim::{Face, SNAP};
use super::sew::{Edge, Sewn};

/// How often steps are halved that meet others because they stray from their curves.
const HALVINGS: usize = 8;

/// How often points are given to boundaries that cross: what is left then runs over itself.
const TIES: usize = 6;

/// A point of space that takes more than this share of a domain is a pole, what is shorter a
/// bridged gap.
const POLE: f64 = 1e-3;

/// Boundaries that cross this near to the end of a step, as a share of it, meet there.
const NEAR: f64 = 1e-9;

/// Faces and the chains of points along their edges.
pub(super) struct Chains<'a> {
    faces: &'a [Face<'a>],
    edges: &'a [Edge],
    /// Ends of edges, and where boundaries cross.
    vertices: Vec<DVec3>,
    chains: Vec<Chain>,
    limits: Limits<'a>,
}

/// A station that is to divide a step.
struct Cut {
    edge: usize,
    start: usize,
    share: f64,
    station: Station,
}

impl<'a> Chains<'a> {
    pub(super) fn new(faces: &'a [Face<'a>], sewn: &'a Sewn, limits: Limits<'a>) -> Self {
        let chain = |(edge, least): (&Edge, usize)| {
            Walker::new(faces, edge, &sewn.vertices, &limits).chain(least)
        };
        let leasts = least_steps(&sewn.edges);
        Self {
            faces,
            edges: &sewn.edges,
            vertices: sewn.vertices.clone(),
            chains: sewn.edges.par_iter().zip(leasts).map(chain).collect(),
            limits,
        }
    }

    /// The triangles of every face, and how many boundaries could not be kept apart; `None` if there
    /// is no room for them.
    pub(super) fn mesh(&mut self) -> Option<(Vec<Triangles>, usize)> {
        let (mut halvings, mut ties) = (0, 0);
        let mut untied = None;
        let mut is_lenient = false;
        while self.limits.room.is_left() {
            let stretches = self.stretches();
            let outlines: Vec<_> = self
                .faces
                .par_iter()
                .zip(&stretches)
                .map(|(face, own)| Mesher::new(face, own, &self.limits))
                .collect();
            let found = outlines.iter().flat_map(|(_, found)| found).copied();
            let meetings: Vec<Meeting> = found
                .filter(|meeting| !is_lenient || !self.is_slight(meeting))
                .collect();
            if meetings.is_empty() || ties == TIES && untied.is_none() {
                let meshes: Vec<_> = outlines.into_par_iter().map(|(m, _)| m.run()).collect();
                let crossings = meshes.iter().map(|mesh| mesh.undrawn).sum();
                return self.limits.room.is_left().then_some((meshes, crossings));
            }
            drop(outlines);
            let mut cuts = Vec::new();
            if halvings < HALVINGS {
                halvings += 1;
                cuts = self.halves(&meetings);
            }
            if cuts.is_empty() && ties == TIES {
                // Boundaries that run over each other: they stay as they were. Those that do so below the tolerance
                // may be all that does not come apart.
                self.chains = untied.take()?;
                if !is_lenient {
                    (is_lenient, ties) = (true, 0);
                }
                continue;
            }
            if cuts.is_empty() {
                ties += 1;
                untied.get_or_insert_with(|| self.chains.clone());
                cuts = self.ties(&meetings);
            }
            self.limits.room.take(cuts.len() as f64);
            self.divide(cuts);
        }
        None
    }

    fn walker(&self, edge: usize) -> Walker<'_> {
        Walker::new(self.faces, &self.edges[edge], &self.vertices, &self.limits)
    }

    /// Whether no more happens than that a step ends on one that is lost in the tolerance.
    fn is_slight(&self, meeting: &Meeting) -> bool {
        let is_end = |(_, share): &(Step, f64)| *share <= 0.0 || *share >= 1.0;
        meeting.iter().any(is_end)
            && meeting.iter().any(|(step, _)| {
                let ends = self.ends(step);
                let face = &self.faces[self.edges[step.edge].uses[step.used].face];
                ends[0].position.distance(ends[1].position) <= face.tolerance
            })
    }

    /// Halves of the steps that meet others because they stray from their curves.
    fn halves(&self, meetings: &[Meeting]) -> Vec<Cut> {
        let steps = meetings.iter().flatten().filter(|(step, _)| {
            let is_coarse = || self.walker(step.edge).is_coarse(self.ends(step));
            !self.edges[step.edge].collapsed && is_coarse()
        });
        let mut steps: Vec<&Step> = steps.map(|(step, _)| step).collect();
        steps.sort_unstable_by_key(|step| step.place());
        steps.dedup_by_key(|step| step.place());
        let half = |step: &Step| Cut {
            edge: step.edge,
            start: step.start,
            share: 0.5,
            station: self.walker(step.edge).middle(self.ends(step)),
        };
        steps.into_iter().map(half).collect()
    }

    /// Points for steps that meet, which both get.
    fn ties(&mut self, meetings: &[Meeting]) -> Vec<Cut> {
        let mut cuts = Vec::new();
        // What two faces see alike is one.
        let mut tied = HashSet::new();
        for meeting in meetings {
            let mut pair = meeting.map(|(step, _)| step.place());
            pair.sort_unstable();
            if tied.insert(pair) {
                self.tie(meeting, &mut cuts);
            }
        }
        cuts
    }

    /// Divides steps.
    fn divide(&mut self, mut cuts: Vec<Cut>) {
        let place = |cut: &Cut| (cut.edge, cut.start);
        cuts.sort_by(|a, b| place(a).cmp(&place(b)).then(a.share.total_cmp(&b.share)));
        // What else is there meets it in the next round.
        cuts.dedup_by(|b, a| place(a) == place(b) && b.share - a.share < NEAR);
        let mut changed: Vec<usize> = cuts.iter().map(|cut| cut.edge).collect();
        changed.dedup();
        // From the last on, so that the numbers of steps stay what they are.
        for cut in cuts.into_iter().rev() {
            let stations = &mut self.chains[cut.edge].stations;
            stations.insert(cut.start + 1, cut.station);
        }
        for edge in changed {
            let stations = std::mem::take(&mut self.chains[edge].stations);
            self.chains[edge] = self.walker(edge).linked(stations);
        }
    }

    /// Gives two steps the point at which they meet: where one ends there that end, else a new one for both.
    fn tie(&mut self, steps: &Meeting, cuts: &mut Vec<Cut>) {
        let ends = steps.map(|(step, share)| match share {
            share if share < NEAR => Some(step.start),
            share if share > 1.0 - NEAR => Some(step.start + 1),
            _ => None,
        });
        let places = steps.map(|(step, share)| {
            let ends = self.ends(&step);
            let uv = |k: usize| ends[k].places[step.used].uv;
            uv(0).lerp(uv(1), share)
        });
        let uv = match ends {
            [Some(_), None] => places[0],
            [None, Some(_)] => places[1],
            _ => places[0].midpoint(places[1]),
        };
        let known = |k: usize| {
            let edge = steps[k].0.edge;
            let collapsed = self.edges[edge]
                .collapsed
                .then_some(self.edges[edge].ends[0]);
            ends[k].and_then(|end| self.vertex(edge, end)).or(collapsed)
        };
        let vertex = known(0).or_else(|| known(1)).unwrap_or_else(|| {
            let Step { edge, used, .. } = steps[0].0;
            let face = &self.faces[self.edges[edge].uses[used].face];
            self.vertices.push(face.point(uv));
            self.vertices.len() - 1
        });
        let shared = (vertex, self.vertices[vertex]);
        for ((step, share), end) in steps.iter().zip(ends) {
            let Step { edge, used, start } = *step;
            match end {
                Some(end) if self.vertex(edge, end).is_none() => {
                    let stations = &mut self.chains[edge].stations;
                    Walker::new(self.faces, &self.edges[edge], &self.vertices, &self.limits)
                        .tie(&mut stations[end], shared);
                }
                Some(_) => {}
                None => {
                    let walker = self.walker(edge);
                    let mut station = walker.between(self.ends(step), *share, (used, uv));
                    walker.tie(&mut station, shared);
                    cuts.push(Cut {
                        edge,
                        start,
                        share: *share,
                        station,
                    });
                }
            }
        }
    }

    /// The stations at both ends of a step.
    fn ends(&self, step: &Step) -> &[Station] {
        &self.chains[step.edge].stations[step.start..step.start + 2]
    }

    /// The vertex that a station is, if it is one.
    fn vertex(&self, edge: usize, station: usize) -> Option<usize> {
        let (edge, stations) = (&self.edges[edge], &self.chains[edge].stations);
        match station {
            // One point of space stays one, however often it is divided.
            _ if edge.collapsed => Some(edge.ends[0]),
            0 => Some(edge.ends[0]),
            k if k + 1 == stations.len() => Some(edge.ends[1]),
            k => stations[k].vertex,
        }
    }

    /// The boundary of every face in straight pieces.
    fn stretches(&self) -> Vec<Vec<Stretch>> {
        let mut result: Vec<Vec<Stretch>> = vec![Vec::new(); self.faces.len()];
        let mut next = self.vertices.len();
        let number = |k: usize| u32::try_from(k).unwrap_or(u32::MAX);
        for (index, (edge, chain)) in self.edges.iter().zip(&self.chains).enumerate() {
            let stations = &chain.stations;
            let last = stations.len() - 1;
            for (used, own) in edge.uses.iter().enumerate() {
                let corner = |s: usize| Corner {
                    uv: stations[s].places[used].uv,
                    id: number(self.vertex(index, s).unwrap_or(next + s)),
                    position: stations[if edge.collapsed { 0 } else { s }].position,
                    gap: stations[s].places[used].gap,
                };
                let size = self.faces[own.face].pieces.domain().size();
                let way = |s: usize| {
                    let [a, b] = [s, 0].map(|s| stations[s].places[used].uv);
                    (a - b).abs() / size
                };
                let way = (1..=last).map(way).fold(DVec2::ZERO, DVec2::max);
                let is_long = way.max_element() > POLE;
                result[own.face].extend((0..last).map(|start| Stretch {
                    ends: [corner(start), corner(start + 1)],
                    step: Step {
                        edge: index,
                        used,
                        start,
                    },
                    pole: edge.collapsed && is_long && way.min_element() <= SNAP,
                    dot: edge.collapsed && !is_long,
                }));
            }
            next += stations.len();
        }
        result
    }

    /// For every face the largest distance of its boundary from the chains.
    pub(super) fn edge_bounds(&self) -> Vec<f64> {
        let mut bounds = vec![0.0_f64; self.faces.len()];
        for (edge, chain) in self.edges.iter().zip(&self.chains) {
            for used in &edge.uses {
                bounds[used.face] = bounds[used.face].max(chain.proven);
            }
        }
        bounds
    }
}

impl Step {
    /// Which step it is, whatever face sees it.
    fn place(&self) -> (usize, usize) {
        (self.edge, self.start)
    }
}

/// How many steps each edge must have so that no two edges become one.
fn least_steps(edges: &[Edge]) -> Vec<usize> {
    let mut twins: HashMap<[usize; 2], usize> = HashMap::new();
    let key = |edge: &Edge| {
        [
            edge.ends[0].min(edge.ends[1]),
            edge.ends[0].max(edge.ends[1]),
        ]
    };
    for edge in edges.iter().filter(|e| !e.collapsed) {
        *twins.entry(key(edge)).or_default() += 1;
    }
    let least = |edge: &Edge| match edge.ends {
        _ if edge.collapsed => 1,
        [a, b] if a == b => 3,
        _ if twins[&key(edge)] > 1 => 2,
        _ => 1,
    };
    edges.iter().map(least).collect()
}
