//! What hangs together: faces turned to the same side, open and closed shells.

use glam::DVec3;
use kernel::PatchId;
use rayon::prelude::*;
use smallvec::SmallVec;

use super::face::Triangles;

/// Faces that hang together along edges.
#[derive(Clone, Debug, PartialEq)]
pub struct Shell {
    /// Its faces.
    pub patches: Vec<PatchId>,
    /// Sides of triangles that no other triangle of the shell has; none in a closed one.
    pub naked: usize,
    /// Sides of more than two of its triangles, unless these are as many one way as the other.
    pub crowded: usize,
    /// Sides whose two triangles cannot be turned to the same side.
    pub twisted: usize,
    /// Vertices minus sides plus triangles.
    pub euler: i64,
    /// Number of triangles.
    pub triangles: usize,
    /// Area of the triangles, in the coordinates in which they were sewn.
    pub area: f64,
    /// What a closed shell encloses, below zero for the void of a solid; without meaning for an open
    /// one.
    pub volume: f64,
}

impl Shell {
    /// Whether there are triangles, and every side has exactly two, turned to the same side.
    pub fn is_closed(&self) -> bool {
        self.triangles > 0 && self.naked + self.crowded + self.twisted == 0
    }
}

/// A face as this module sees it: triangles over points of the whole group.
pub(super) struct Part<'a> {
    pub(super) patch: PatchId,
    pub(super) mesh: &'a Triangles,
    /// The group's number of every vertex.
    pub(super) points: Vec<u32>,
    /// Whether it bounds a void of a solid.
    pub(super) is_void: bool,
    /// The node of the scene that shows it: what a file calls a body or a shell is one.
    pub(super) owner: usize,
}

impl Part<'_> {
    /// By the numbers of their corners.
    pub(super) fn triangles(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        let point = |k: u32| self.points[k as usize];
        self.mesh.triangles.iter().map(move |t| t.map(point))
    }

    fn corners(&self) -> impl Iterator<Item = [DVec3; 3]> + '_ {
        let position = |k: u32| self.mesh.vertices[k as usize].position;
        self.mesh.triangles.iter().map(move |t| t.map(position))
    }

    fn area(&self) -> f64 {
        self.corners()
            .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length())
            .sum()
    }

    fn volume(&self) -> f64 {
        self.corners()
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum()
    }
}

/// A meeting of two faces: whether both run along it the same way.
struct Meeting {
    faces: [usize; 2],
    same: bool,
}

/// A side of a triangle: its lower point above its higher one, so that it is one number.
type Side = u64;

/// A side as a triangle of a face has it, and whether it runs from the lower point there.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct HalfEdge {
    side: Side,
    face: usize,
    upward: bool,
}

/// Which faces have to be turned around, and the shells.
pub(super) fn shells(parts: &[Part<'_>]) -> (Vec<bool>, Vec<Shell>) {
    let (inner, lists): (Vec<usize>, Vec<Vec<HalfEdge>>) = (0..parts.len())
        .into_par_iter()
        .map(|face| sides(&parts[face], face))
        .unzip();
    let mut uses = lists.concat();
    uses.sort_unstable();
    let shared = || uses.chunk_by(|a, b| a.side == b.side);
    let meetings: Vec<Meeting> = shared()
        .filter(|uses| uses.len() == 2 && uses[0].face != uses[1].face)
        .map(|uses| Meeting {
            faces: [uses[0].face, uses[1].face],
            same: uses[0].upward == uses[1].upward,
        })
        .collect();
    let (mut component, mut turned) = turn(parts.len(), &meetings);
    link(parts, &uses, &mut component, &mut turned);
    let count = component.iter().max().map_or(0, |k| k + 1);
    let mut shells: Vec<Shell> = (0..count).map(|_| Shell::empty()).collect();
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); count];
    for (k, part) in parts.iter().enumerate() {
        members[component[k]].push(k);
        let shell = &mut shells[component[k]];
        shell.patches.push(part.patch);
        shell.triangles += part.mesh.triangles.len();
        shell.area += part.area();
        shell.volume += if turned[k] {
            -part.volume()
        } else {
            part.volume()
        };
        shell.euler -= number(inner[k]);
    }
    for uses in shared() {
        let mut own: SmallVec<[usize; 4]> = uses.iter().map(|used| component[used.face]).collect();
        own.sort_unstable();
        own.dedup();
        for shell in own {
            // What of others is there too opens nothing, and closes nothing.
            let uses: SmallVec<[&HalfEdge; 4]> = uses
                .iter()
                .filter(|used| component[used.face] == shell)
                .collect();
            let upward = uses
                .iter()
                .filter(|used| used.upward ^ turned[used.face])
                .count();
            let is_balanced = 2 * upward == uses.len();
            let shell = &mut shells[shell];
            shell.euler -= 1;
            match uses.len() {
                1 => shell.naked += 1,
                2 => shell.twisted += usize::from(!is_balanced),
                _ => shell.crowded += usize::from(!is_balanced),
            }
        }
    }
    // For every point the last shell in which it was met.
    let highest = parts.iter().flat_map(|part| &part.points).max();
    let mut met = vec![usize::MAX; highest.map_or(0, |&most| most as usize + 1)];
    for (index, (shell, members)) in shells.iter_mut().zip(members).enumerate() {
        for point in members.iter().flat_map(|&k| parts[k].triangles()).flatten() {
            let last = &mut met[point as usize];
            shell.euler += i64::from(*last != index);
            *last = index;
        }
        shell.euler += number(shell.triangles);
        // Closed shells have their volume inside, but for those of voids, and open ones look where
        // most of them did.
        let signed = |&k: &usize| if turned[k] { -1.0 } else { 1.0 } * parts[k].area();
        let balance: f64 = members.iter().map(signed).sum();
        let wrong = if shell.is_closed() {
            (shell.volume < 0.0) != members.iter().all(|&k| parts[k].is_void)
        } else {
            balance < 0.0
        };
        if wrong {
            shell.volume = -shell.volume;
            members.iter().for_each(|&k| turned[k] = !turned[k]);
        }
    }
    (turned, shells)
}

/// Whether as many triangles of each component run one way along a side as the other way.
fn is_balanced(uses: &[HalfEdge], component: &[usize], turned: &[bool]) -> bool {
    uses.iter().all(|used| {
        let own = |other: &&HalfEdge| component[other.face] == component[used.face];
        let upward = |other: &&HalfEdge| other.upward ^ turned[other.face];
        2 * uses.iter().filter(own).filter(upward).count() == uses.iter().filter(own).count()
    })
}

/// Joins components along sides of more than two triangles, where bodies and sheets touch: in pairs of one owner,
/// else of faces that follow each other in the file, as those of one body do.
fn link(parts: &[Part<'_>], uses: &[HalfEdge], component: &mut [usize], turned: &mut [bool]) {
    let shared = || uses.chunk_by(|a, b| a.side == b.side);
    let mut is_open = vec![false; parts.len()];
    for uses in shared().filter(|uses| uses.len() == 1) {
        is_open[component[uses[0].face]] = true;
    }
    let owner = |used: &HalfEdge| parts[used.face].owner;
    let mut links = Vec::new();
    for uses in shared().filter(|uses| uses.len() > 2) {
        if is_balanced(uses, component, turned) {
            continue;
        }
        let mut uses: SmallVec<[HalfEdge; 4]> = uses.into();
        uses.sort_by_key(owner);
        let (mut paired, mut left) = (Vec::new(), Vec::new());
        for own in uses.chunk_by(|a, b| owner(a) == owner(b)) {
            let list = if own.len().is_multiple_of(2) {
                &mut paired
            } else {
                &mut left
            };
            list.extend_from_slice(own);
        }
        if !left.len().is_multiple_of(2) {
            // What is open elsewhere too is a sheet.
            left.retain(|used| !is_open[component[used.face]]);
        }
        if left.len().is_multiple_of(2) {
            left.sort_unstable_by_key(|used| used.face);
            paired.extend(left);
        }
        for pair in paired.chunks_exact(2) {
            let upward = [0, 1].map(|k| pair[k].upward ^ turned[pair[k].face]);
            links.push(Meeting {
                faces: [0, 1].map(|k| component[pair[k].face]),
                same: upward[0] == upward[1],
            });
        }
    }
    let count = component.iter().max().map_or(0, |most| most + 1);
    let (joined, flipped) = turn(count, &links);
    for (component, turned) in component.iter_mut().zip(turned) {
        *turned ^= flipped[*component];
        *component = joined[*component];
    }
}

/// How many sides two triangles of a face have, once each way, and all its others.
fn sides(part: &Part<'_>, face: usize) -> (usize, Vec<HalfEdge>) {
    let ways = |[a, b, c]: [u32; 3]| {
        [[a, b], [b, c], [c, a]].map(|[p, q]| HalfEdge {
            side: Side::from(p.min(q)) << 32 | Side::from(p.max(q)),
            face,
            upward: p < q,
        })
    };
    let mut all: Vec<HalfEdge> = part.triangles().flat_map(ways).collect();
    all.sort_unstable_by_key(|used| (used.side, used.upward));
    let mut inner = 0;
    let mut others = Vec::new();
    for uses in all.chunk_by(|a, b| a.side == b.side) {
        match uses {
            [a, b] if a.upward != b.upward => inner += 1,
            _ => others.extend_from_slice(uses),
        }
    }
    (inner, others)
}

fn number(count: usize) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

impl Shell {
    fn empty() -> Self {
        Self {
            patches: Vec::new(),
            naked: 0,
            crowded: 0,
            twisted: 0,
            euler: 0,
            triangles: 0,
            area: 0.0,
            volume: 0.0,
        }
    }
}

/// For every one of so many faces the number of its component, and whether it has to be turned around
/// to look to the side of the first one there.
fn turn(faces: usize, meetings: &[Meeting]) -> (Vec<usize>, Vec<bool>) {
    let mut neighbours: Vec<Vec<(usize, bool)>> = vec![Vec::new(); faces];
    for meeting in meetings {
        let [a, b] = meeting.faces;
        neighbours[a].push((b, meeting.same));
        neighbours[b].push((a, meeting.same));
    }
    let mut component = vec![usize::MAX; faces];
    let mut turned = vec![false; faces];
    let mut count = 0;
    for start in 0..faces {
        if component[start] != usize::MAX {
            continue;
        }
        component[start] = count;
        let mut stack = vec![start];
        while let Some(face) = stack.pop() {
            for &(other, same) in &neighbours[face] {
                if component[other] == usize::MAX {
                    component[other] = count;
                    turned[other] = turned[face] ^ same;
                    stack.push(other);
                }
            }
        }
        count += 1;
    }
    (component, turned)
}
