//! What hangs together: faces turned to the same side, open and closed shells.

use glam::DVec3;
use kernel::{PatchId, Sets};
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
        self.mesh.triangles.iter().map(|t| self.corners(t))
    }

    fn corners(&self, triangle: &[u32; 3]) -> [u32; 3] {
        triangle.map(|k| self.points[k as usize])
    }
}

/// What hangs together of a face without its boundary.
struct Region<'a> {
    part: &'a Part<'a>,
    /// Which of the faces it is of.
    face: usize,
    /// Numbers of triangles.
    triangles: Vec<u32>,
    /// How many sides have two triangles, once each way.
    inner: usize,
    /// All other sides, and whether they run from the lower point.
    others: Vec<(Side, bool)>,
}

impl<'a> Region<'a> {
    /// The regions of a face.
    fn all(part: &'a Part<'a>, face: usize) -> Vec<Self> {
        let ways = |(number, [a, b, c]): (u32, [u32; 3])| {
            [[a, b], [b, c], [c, a]].map(|[p, q]| {
                let side = Side::from(p.min(q)) << 32 | Side::from(p.max(q));
                (side, number << 1 | u32::from(p < q))
            })
        };
        let triangle = |way: u32| (way >> 1) as usize;
        let is_upward = |way: u32| way & 1 == 1;
        let count = part.mesh.triangles.len();
        let mut uses: Vec<(Side, u32)> = (0..).zip(part.triangles()).flat_map(ways).collect();
        uses.sort_unstable();
        let is_inner =
            |uses: &[(Side, u32)]| matches!(uses, [a, b] if is_upward(a.1) != is_upward(b.1));
        let shared = || uses.chunk_by(|a, b| a.0 == b.0);
        let mut sets = Sets::new(count);
        for uses in shared().filter(|uses| is_inner(uses)) {
            sets.join(triangle(uses[0].1), triangle(uses[1].1));
        }
        let mut members = sets.members();
        if members.is_empty() {
            // A face without triangles is there, too.
            members.push(Vec::new());
        }
        let mut regions: Vec<Self> = Vec::new();
        let mut region_of = vec![0; count];
        for members in members {
            members.iter().for_each(|&k| region_of[k] = regions.len());
            let number = |k: usize| u32::try_from(k).unwrap_or(u32::MAX);
            regions.push(Self {
                part,
                face,
                triangles: members.into_iter().map(number).collect(),
                inner: 0,
                others: Vec::new(),
            });
        }
        for uses in shared() {
            if is_inner(uses) {
                regions[region_of[triangle(uses[0].1)]].inner += 1;
                continue;
            }
            for &(side, way) in uses {
                let region = &mut regions[region_of[triangle(way)]];
                region.others.push((side, is_upward(way)));
            }
        }
        regions
    }

    /// By the numbers of their corners.
    fn triangles(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        let Part { mesh, .. } = self.part;
        let corners = |&k: &u32| self.part.corners(&mesh.triangles[k as usize]);
        self.triangles.iter().map(corners)
    }

    fn corners(&self) -> impl Iterator<Item = [DVec3; 3]> + '_ {
        let Triangles {
            vertices,
            triangles,
            ..
        } = self.part.mesh;
        let position = |k: u32| vertices[k as usize].position;
        let corners = move |&k: &u32| triangles[k as usize].map(position);
        self.triangles.iter().map(corners)
    }

    fn area(&self) -> f64 {
        self.corners()
            .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length())
            .sum()
    }

    /// The volume between the triangles and a point.
    fn volume(&self, apex: DVec3) -> f64 {
        self.corners()
            .map(|[a, b, c]| (a - apex).dot((b - apex).cross(c - apex)) / 6.0)
            .sum()
    }
}

/// How a face is turned around.
#[derive(Clone, Debug, Default)]
pub(super) struct Turned {
    /// Whether it is.
    pub(super) face: bool,
    /// Triangles that are turned the other way: of strips in which boundaries overlap.
    pub(super) against: Vec<u32>,
}

/// A meeting of two regions: whether both run along it the same way.
struct Meeting {
    regions: [usize; 2],
    same: bool,
}

/// A side of a triangle: its lower point above its higher one, so that it is one number.
type Side = u64;

/// A side as a triangle of a region has it, and whether it runs from the lower point there.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct HalfEdge {
    side: Side,
    region: usize,
    upward: bool,
}

/// The regions of all faces, and their sides that are on boundaries, in order.
fn regions<'a>(parts: &'a [Part<'a>]) -> (Vec<Region<'a>>, Vec<HalfEdge>) {
    let regions: Vec<Vec<Region<'_>>> = (0..parts.len())
        .into_par_iter()
        .map(|face| Region::all(&parts[face], face))
        .collect();
    let mut regions: Vec<Region<'_>> = regions.into_iter().flatten().collect();
    let mut uses = Vec::new();
    for (number, region) in regions.iter_mut().enumerate() {
        let others = std::mem::take(&mut region.others);
        uses.extend(others.into_iter().map(|(side, upward)| HalfEdge {
            side,
            region: number,
            upward,
        }));
    }
    uses.sort_unstable();
    (regions, uses)
}

/// For every region which others it hangs together with, and whether it has to be turned around.
fn oriented(regions: &[Region<'_>], uses: &[HalfEdge]) -> (Vec<usize>, Vec<bool>) {
    let shared = uses.chunk_by(|a, b| a.side == b.side);
    let meetings: Vec<Meeting> = shared
        .filter(|uses| uses.len() == 2 && uses[0].region != uses[1].region)
        .map(|uses| Meeting {
            regions: [uses[0].region, uses[1].region],
            same: uses[0].upward == uses[1].upward,
        })
        .collect();
    let (mut component, mut turned) = turn(regions.len(), &meetings);
    // What no side joins of a face looks to the same side.
    let pairs = (1..regions.len()).filter(|&k| regions[k].face == regions[k - 1].face);
    let links: Vec<_> = pairs
        .map(|k| Meeting {
            regions: [component[k - 1], component[k]],
            same: turned[k - 1] != turned[k],
        })
        .collect();
    join(&links, &mut component, &mut turned);
    link(regions, uses, &mut component, &mut turned);
    (component, turned)
}

/// How faces have to be turned around, and the shells.
pub(super) fn shells(parts: &[Part<'_>]) -> (Vec<Turned>, Vec<Shell>) {
    let (regions, uses) = regions(parts);
    let shared = || uses.chunk_by(|a, b| a.side == b.side);
    let (component, mut turned) = oriented(&regions, &uses);
    let count = component.iter().max().map_or(0, |k| k + 1);
    let mut shells: Vec<Shell> = (0..count).map(|_| Shell::empty()).collect();
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); count];
    // A point of each: far from the origin volumes about it are rounding errors.
    let mut apexes: Vec<Option<DVec3>> = vec![None; count];
    for (k, region) in regions.iter().enumerate() {
        members[component[k]].push(k);
        let shell = &mut shells[component[k]];
        if shell.patches.last() != Some(&region.part.patch) {
            shell.patches.push(region.part.patch);
        }
        shell.triangles += region.triangles.len();
        shell.area += region.area();
        let apex = &mut apexes[component[k]];
        *apex = apex.or_else(|| Some(region.corners().next()?[0]));
        let volume = apex.map_or(0.0, |apex| region.volume(apex));
        shell.volume += if turned[k] { -volume } else { volume };
        shell.euler -= number(region.inner);
    }
    for uses in shared() {
        let mut own: SmallVec<[usize; 4]> =
            uses.iter().map(|used| component[used.region]).collect();
        own.sort_unstable();
        own.dedup();
        for shell in own {
            // What of others is there too opens nothing, and closes nothing.
            let uses: SmallVec<[&HalfEdge; 4]> = uses
                .iter()
                .filter(|used| component[used.region] == shell)
                .collect();
            let upward = uses
                .iter()
                .filter(|used| used.upward ^ turned[used.region])
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
        for point in members
            .iter()
            .flat_map(|&k| regions[k].triangles())
            .flatten()
        {
            let last = &mut met[point as usize];
            shell.euler += i64::from(*last != index);
            *last = index;
        }
        shell.euler += number(shell.triangles);
        // Closed shells have their volume inside, but for those of voids, and open ones look where
        // most of them did.
        let signed = |&k: &usize| if turned[k] { -1.0 } else { 1.0 } * regions[k].area();
        let balance: f64 = members.iter().map(signed).sum();
        let wrong = if shell.is_closed() {
            (shell.volume < 0.0) != members.iter().all(|&k| regions[k].part.is_void)
        } else {
            balance < 0.0
        };
        if wrong {
            shell.volume = -shell.volume;
            members.iter().for_each(|&k| turned[k] = !turned[k]);
        }
    }
    (by_face(parts.len(), &regions, &turned), shells)
}

/// A face is turned as its largest region is.
fn by_face(count: usize, regions: &[Region<'_>], turned: &[bool]) -> Vec<Turned> {
    let mut faces = vec![Turned::default(); count];
    let together = regions.chunk_by(|a, b| a.face == b.face);
    let mut first = 0;
    for own in together {
        let turned = &turned[first..first + own.len()];
        first += own.len();
        let largest = (0..own.len()).max_by_key(|&k| own[k].triangles.len());
        let face = &mut faces[own[0].face];
        face.face = largest.is_some_and(|k| turned[k]);
        let others = own
            .iter()
            .zip(turned)
            .filter(|(_, turned)| **turned != face.face);
        face.against = others
            .flat_map(|(region, _)| region.triangles.clone())
            .collect();
        face.against.sort_unstable();
    }
    faces
}

/// Whether as many triangles of each component run one way along a side as the other way.
fn is_balanced(uses: &[HalfEdge], component: &[usize], turned: &[bool]) -> bool {
    uses.iter().all(|used| {
        let own = |other: &&HalfEdge| component[other.region] == component[used.region];
        let upward = |other: &&HalfEdge| other.upward ^ turned[other.region];
        2 * uses.iter().filter(own).filter(upward).count() == uses.iter().filter(own).count()
    })
}

/// Joins components along sides of more than two triangles, where bodies and sheets touch: in pairs of one owner,
/// else of faces that follow each other in the file, as those of one body do.
fn link(regions: &[Region<'_>], uses: &[HalfEdge], component: &mut [usize], turned: &mut [bool]) {
    let shared = || uses.chunk_by(|a, b| a.side == b.side);
    let mut is_open = vec![false; regions.len()];
    for uses in shared().filter(|uses| uses.len() == 1) {
        is_open[component[uses[0].region]] = true;
    }
    let owner = |used: &HalfEdge| regions[used.region].part.owner;
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
            left.retain(|used| !is_open[component[used.region]]);
        }
        if left.len().is_multiple_of(2) {
            left.sort_unstable_by_key(|used| used.region);
            paired.extend(left);
        }
        for pair in paired.chunks_exact(2) {
            let upward = [0, 1].map(|k| pair[k].upward ^ turned[pair[k].region]);
            links.push(Meeting {
                regions: [0, 1].map(|k| component[pair[k].region]),
                same: upward[0] == upward[1],
            });
        }
    }
    join(&links, component, turned);
}

/// Joins components that meet.
fn join(links: &[Meeting], component: &mut [usize], turned: &mut [bool]) {
    let count = component.iter().max().map_or(0, |most| most + 1);
    let (joined, flipped) = turn(count, links);
    for (component, turned) in component.iter_mut().zip(turned) {
        *turned ^= flipped[*component];
        *component = joined[*component];
    }
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

/// For every one of so many regions the number of its component, and whether it has to be turned around
/// to look to the side of the first one there.
fn turn(regions: usize, meetings: &[Meeting]) -> (Vec<usize>, Vec<bool>) {
    let mut neighbours: Vec<Vec<(usize, bool)>> = vec![Vec::new(); regions];
    for meeting in meetings {
        let [a, b] = meeting.regions;
        neighbours[a].push((b, meeting.same));
        neighbours[b].push((a, meeting.same));
    }
    let mut component = vec![usize::MAX; regions];
    let mut turned = vec![false; regions];
    let mut count = 0;
    for start in 0..regions {
        if component[start] != usize::MAX {
            continue;
        }
        component[start] = count;
        let mut stack = vec![start];
        while let Some(region) = stack.pop() {
            for &(other, same) in &neighbours[region] {
                if component[other] == usize::MAX {
                    component[other] = count;
                    turned[other] = turned[region] ^ same;
                    stack.push(other);
                }
            }
        }
        count += 1;
    }
    (component, turned)
}

#[cfg(test)]
mod tests {
    use glam::DVec2;
    use kernel::Scene;
    use kernel::modelling::{self, Frame};

    use super::*;
    use crate::tessellate::face::Vertex;

    /// Triangles between points.
    fn mesh(points: &[DVec3], triangles: &[[u32; 3]]) -> Triangles {
        let vertex = |(id, &position): (u32, &DVec3)| Vertex {
            uv: DVec2::ZERO,
            position,
            id: Some(id),
            gap: 0.0,
            normal: DVec3::ZERO,
        };
        Triangles {
            vertices: (0..).zip(points).map(vertex).collect(),
            triangles: triangles.to_vec(),
            ..Triangles::default()
        }
    }

    #[test]
    fn a_part_of_a_face_that_looks_the_wrong_way_is_turned_alone() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let points = [x, y, z, -x, -y, -z];
        // Of an octahedron two triangles that only have no side in common, one of them turned over.
        let odd = mesh(&points, &[[0, 1, 2], [4, 5, 3]]);
        let rest = [
            [1, 3, 2],
            [3, 4, 2],
            [4, 0, 2],
            [1, 0, 5],
            [3, 1, 5],
            [0, 4, 5],
        ];
        let rest = mesh(&points, &rest);
        let frame = Frame::about(DVec3::ZERO, DVec3::Z).unwrap();
        let ball = modelling::sphere(&frame, 1.0, 0.0..1.0, 0.0..1.0).unwrap();
        let mut scene = Scene::default();
        let mut patch = || scene.add_patch(ball.clone().into()).unwrap();
        let patches = [patch(), patch()];
        let part = |(patch, mesh)| Part {
            patch,
            mesh,
            points: (0..6).collect(),
            is_void: false,
            owner: 0,
        };
        let parts: Vec<_> = patches.into_iter().zip([&odd, &rest]).map(part).collect();
        let (turned, shells) = shells(&parts);
        assert_eq!(
            (shells.len(), shells[0].is_closed()),
            (1, true),
            "{shells:?}"
        );
        assert!((shells[0].volume - 4.0 / 3.0).abs() < 1e-12);
        assert_eq!((shells[0].euler, shells[0].patches.len()), (2, 2));
        let against: Vec<_> = turned.iter().map(|face| face.against.len()).collect();
        assert_eq!((against, turned[1].face), (vec![1, 0], false));
    }
}
