//! What hangs together: faces turned to the same side, open and closed shells.

use std::collections::BTreeMap;

use glam::DVec3;
use kernel::PatchId;

use super::face::Triangles;

/// Faces that hang together along edges.
#[derive(Clone, Debug, PartialEq)]
pub struct Shell {
    /// Its faces.
    pub patches: Vec<PatchId>,
    /// Sides of triangles that no other triangle has; none in a closed shell.
    pub naked: usize,
    /// Sides of more than two triangles.
    pub crowded: usize,
    /// Sides whose two triangles cannot be turned to the same side.
    pub twisted: usize,
    /// Vertices minus sides plus triangles.
    pub euler: i64,
    /// Number of triangles.
    pub triangles: usize,
    /// Area of the triangles, in the coordinates in which they were sewn.
    pub area: f64,
    /// What a closed shell encloses; without meaning for an open one.
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
}

impl Part<'_> {
    fn triangles(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
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

/// Which faces have to be turned around, and the shells.
pub(super) fn shells(parts: &[Part<'_>]) -> (Vec<bool>, Vec<Shell>) {
    // How often each side is used, and by whom: (face, whether from the lower point).
    let mut sides: BTreeMap<[u32; 2], Vec<(usize, bool)>> = BTreeMap::new();
    for (k, part) in parts.iter().enumerate() {
        let mut own: Vec<([u32; 2], bool)> = part.triangles().flat_map(ways).collect();
        own.sort_unstable();
        for users in own.chunk_by(|a, b| a.0 == b.0) {
            // What is inside a face needs no further look.
            if users.len() != 2 || users[0].1 == users[1].1 {
                let list = sides.entry(users[0].0).or_default();
                list.extend(users.iter().map(|&(_, way)| (k, way)));
            }
        }
    }
    let meetings: Vec<Meeting> = sides
        .values()
        .filter(|users| users.len() == 2 && users[0].0 != users[1].0)
        .map(|users| Meeting {
            faces: [users[0].0, users[1].0],
            same: users[0].1 == users[1].1,
        })
        .collect();
    let (component, turned) = turn(parts, &meetings);
    let count = component.iter().max().map_or(0, |k| k + 1);
    let mut shells: Vec<Shell> = (0..count).map(|_| Shell::empty()).collect();
    let mut turned = turned;
    for (k, part) in parts.iter().enumerate() {
        let shell = &mut shells[component[k]];
        shell.patches.push(part.patch);
        shell.triangles += part.mesh.triangles.len();
        shell.area += part.area();
        shell.volume += if turned[k] {
            -part.volume()
        } else {
            part.volume()
        };
    }
    for users in sides.values() {
        let shell = &mut shells[component[users[0].0]];
        match users[..] {
            [_] => shell.naked += 1,
            [(f, a), (g, b)] => {
                shell.twisted += usize::from((a ^ turned[f]) == (b ^ turned[g]));
            }
            _ => shell.crowded += 1,
        }
    }
    // Closed shells have their volume inside, open ones look where most of them did.
    for (number, shell) in shells.iter_mut().enumerate() {
        let members = || (0..parts.len()).filter(|&k| component[k] == number);
        let balance: f64 = members()
            .map(|k| {
                if turned[k] {
                    -parts[k].area()
                } else {
                    parts[k].area()
                }
            })
            .sum();
        let wrong = if shell.is_closed() {
            shell.volume < 0.0
        } else {
            balance < 0.0
        };
        if wrong {
            shell.volume = -shell.volume;
            members().for_each(|k| turned[k] = !turned[k]);
        }
        shell.euler = euler(members().map(|k| &parts[k]));
    }
    (turned, shells)
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

/// For every face the number of its component, and whether it has to be turned around to
/// look to the side of the first one there.
fn turn(parts: &[Part<'_>], meetings: &[Meeting]) -> (Vec<usize>, Vec<bool>) {
    let mut neighbours: Vec<Vec<(usize, bool)>> = vec![Vec::new(); parts.len()];
    for meeting in meetings {
        let [a, b] = meeting.faces;
        neighbours[a].push((b, meeting.same));
        neighbours[b].push((a, meeting.same));
    }
    let mut component = vec![usize::MAX; parts.len()];
    let mut turned = vec![false; parts.len()];
    let mut count = 0;
    for start in 0..parts.len() {
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

/// Vertices minus sides plus triangles.
fn euler<'a>(parts: impl Iterator<Item = &'a Part<'a>>) -> i64 {
    let triangles: Vec<[u32; 3]> = parts.flat_map(Part::triangles).collect();
    let distinct = |mut all: Vec<[u32; 2]>| {
        all.sort_unstable();
        all.dedup();
        i64::try_from(all.len()).unwrap_or(i64::MAX)
    };
    let points = triangles.iter().flatten().map(|&p| [p; 2]).collect();
    let sides = triangles
        .iter()
        .flat_map(|&t| ways(t))
        .map(|w| w.0)
        .collect();
    let count = i64::try_from(triangles.len()).unwrap_or(i64::MAX);
    distinct(points) - distinct(sides) + count
}

/// The sides of a triangle from the lower point to the higher one, and whether it runs that way.
fn ways([a, b, c]: [u32; 3]) -> [([u32; 2], bool); 3] {
    [[a, b], [b, c], [c, a]].map(|[p, q]| ([p.min(q), p.max(q)], p < q))
}
