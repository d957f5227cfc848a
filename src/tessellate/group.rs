//! Faces that can share edges, and their triangles.

mod again;

use std::cell::LazyCell;
use std::collections::{BTreeMap, HashMap, HashSet};

use glam::{DAffine3, DVec2, DVec3};
use kernel::{Child, Mesh, Patch, PatchId, Scene, Seam, Shape};
use rayon::prelude::*;

use super::calm::calmed;
use super::chains::Chains;
use super::face::Triangles;
use super::rim::Face;
use super::room::Room;
use super::sew::{Edge, Named, sew};
use super::shell::{Part, Shell, Turned, shells};
use super::vanish::gone;
use super::{FaceMesh, Limits, TessellateOptions, deviation, lengthened};

/// How often what would vanish is made finer at most.
const FINER: u32 = 8;

/// How many times smaller the tolerance is of what is made again.
const SMALLER: f64 = 4.0;

/// Normals that differ by less than this at a crease are one, in radians: one degree.
const CREASE: f64 = std::f64::consts::PI / 180.0;

/// Patches that stand in the same coordinates, and how much these are lengthened at most
/// where they are shown.
#[derive(Debug, Default)]
pub(super) struct Group {
    members: Vec<PatchId>,
    scale: f64,
    /// Those of the members that bound voids, where the file says so.
    voids: HashSet<PatchId>,
    /// The number of the node that shows each member.
    owners: HashMap<PatchId, usize>,
    /// The number of the node that is the solid of each member that the file says is of one.
    solids: HashMap<PatchId, usize>,
    /// How many times farther from its faces than the tolerance an edge may be.
    wider: f64,
}

/// What a group becomes.
pub(super) struct Done {
    pub(super) faces: Vec<FaceMesh>,
    pub(super) shells: Vec<Shell>,
    pub(super) crossings: usize,
}

/// The groups of a scene: patches shown below the same shared nodes, as often, and with the same maps
/// to them.
pub(super) fn groups(scene: &Scene) -> Vec<Group> {
    let nodes = scene.nodes();
    let mut node_uses = vec![0_u32; nodes.len()];
    for child in nodes.iter().flat_map(|node| &node.children) {
        if let Child::Node(id) = child {
            node_uses[id.index()] = node_uses[id.index()].saturating_add(1);
        }
    }
    // From the root down: where a node stands below the nearest shared one.
    let mut frames: Vec<Option<(usize, DAffine3)>> = vec![None; nodes.len()];
    let scales = lengthened(scene);
    // Whether all below a node bounds a void, and the patches of which this is so.
    let mut in_void = vec![false; nodes.len()];
    let mut voids = HashSet::new();
    let mut owners: HashMap<PatchId, usize> = HashMap::new();
    // The solid that each node is, or is in.
    let mut solid: Vec<Option<usize>> = vec![None; nodes.len()];
    let mut solids: HashMap<PatchId, usize> = HashMap::new();
    if let Some(root) = scene.root() {
        frames[root.index()] = Some((root.index(), DAffine3::IDENTITY));
    }
    // Every place has a number, and every patch the numbers of its places.
    let mut numbers: HashMap<(usize, [u64; 12]), usize> = HashMap::new();
    let mut places: HashMap<PatchId, (Vec<usize>, f64)> = HashMap::new();
    for (index, node) in nodes.iter().enumerate().rev() {
        let Some((shared, map)) = frames[index] else {
            continue;
        };
        let next = numbers.len();
        let bits = map.to_cols_array().map(f64::to_bits);
        let number = *numbers.entry((shared, bits)).or_insert(next);
        if solid[index].is_none() && node.voids.is_some() {
            solid[index] = Some(index);
        }
        for (k, child) in node.children.iter().enumerate() {
            let is_void = in_void[index] || node.is_void(k);
            match child {
                Child::Node(id) => {
                    in_void[id.index()] |= is_void;
                    solid[id.index()] = solid[id.index()].or(solid[index]);
                    let below = &scene.node(*id).parent_from_node;
                    frames[id.index()] = Some(if node_uses[id.index()] > 1 {
                        (id.index(), DAffine3::IDENTITY)
                    } else {
                        (shared, map * *below)
                    });
                }
                Child::Item(item) => {
                    if let Shape::Patch(id) = item.shape {
                        if is_void {
                            voids.insert(id);
                        }
                        owners.insert(id, index);
                        solids.extend(solid[index].map(|solid| (id, solid)));
                        let (own, scale) = places.entry(id).or_default();
                        own.push(number);
                        *scale = scale.max(scales[index]);
                    }
                }
            }
        }
    }
    let mut groups: BTreeMap<Vec<usize>, Group> = BTreeMap::new();
    for (id, (mut own, scale)) in places {
        own.sort_unstable();
        let group = groups.entry(own).or_default();
        group.members.push(id);
        group.voids.extend(voids.get(&id));
        group.owners.extend(owners.get_key_value(&id));
        group.solids.extend(solids.get_key_value(&id));
        group.scale = group.scale.max(scale);
    }
    let mut groups: Vec<Group> = groups.into_values().collect();
    for group in &mut groups {
        group.wider = 1.0;
        group.members.sort_by_key(|id| id.index());
    }
    groups.sort_by_key(|group| group.members[0].index());
    groups
}

impl Group {
    pub(super) fn members(&self) -> impl Iterator<Item = PatchId> + '_ {
        self.members.iter().copied()
    }

    /// Makes triangles of all members; `None` if there is no room for them.
    ///
    /// What hangs together is made again, finer, where something of it that stands alone would vanish, and where
    /// a solid came out open.
    pub(super) fn tessellate(
        &self,
        scene: &Scene,
        tolerances: &[f64],
        options: &TessellateOptions,
        room: &Room,
    ) -> Option<Done> {
        let done = self.refine(scene, tolerances, (options, room), FINER)?;
        Some(self.closed(scene, tolerances, options, done))
    }

    /// [`Self::tessellate`], finer as often as that at most.
    fn refine(
        &self,
        scene: &Scene,
        tolerances: &[f64],
        (options, room): (&TessellateOptions, &Room),
        times: u32,
    ) -> Option<Done> {
        let limits = Limits {
            angle: options.angle,
            max_edge: options
                .max_edge
                .map_or(f64::INFINITY, |most| most / self.scale),
            room,
        };
        let members = self.members.par_iter();
        let calm: Vec<_> = members
            .map(|&id| calmed(scene.patch(id), tolerances[id.index()] / self.scale))
            .collect();
        let pairs = self.members.iter().zip(&calm);
        let patches: Vec<&Patch> = pairs
            .map(|(&id, calm)| calm.as_ref().map_or(scene.patch(id), |calm| &calm.0))
            .collect();
        let moved: Vec<f64> = calm
            .iter()
            .map(|calm| calm.as_ref().map_or(0.0, |calm| calm.1))
            .collect();
        let faces: Vec<Face<'_>> = self
            .members
            .par_iter()
            .zip(&patches)
            .zip(&moved)
            .map(|((id, patch), moved)| {
                Face::new(patch, tolerances[id.index()] / self.scale - moved)
            })
            .collect();
        let rims: Vec<_> = faces
            .par_iter()
            .zip(&patches)
            .enumerate()
            .flat_map_iter(|(k, (face, patch))| {
                face.rims(patch).into_iter().map(move |curve| (k, curve))
            })
            .collect();
        let owners: Vec<usize> = self.members.iter().map(|id| self.owner(*id)).collect();
        let sewn = sew(&faces, rims, &self.named(scene), &owners, self.wider);
        // What stays open so is not worth it.
        if self.wider > 1.0 && sewn.edges.iter().any(Edge::is_naked) {
            return None;
        }
        let mut chains = Chains::new(&faces, &sewn, limits);
        let (meshes, crossings) = chains.mesh()?;
        let parts = self.parts(&meshes);
        let gone = if times > 0 {
            gone(&parts, &faces, &sewn.edges)
        } else {
            Vec::new()
        };
        if gone.is_empty() {
            let proven = chains.edge_bounds();
            let mut done = self.finish(&patches, &faces, &parts, &proven, crossings);
            for (face, moved) in done.faces.iter_mut().zip(moved) {
                face.tolerance += moved;
                face.proven += moved;
                face.sampled += moved;
            }
            return Some(done);
        }
        let is_gone = |k: &usize| gone.binary_search(k).is_ok();
        let rest: Vec<usize> = (0..faces.len()).filter(|k| !is_gone(k)).collect();
        let small = self.of(&gone);
        let finer = small.finer(tolerances);
        let made = small.refine(scene, &finer, (options, room), times - 1)?;
        let mut parts = vec![(gone, made)];
        if !rest.is_empty() {
            let large = self.of(&rest);
            // Made without the others it may vanish where it did not.
            let made = large.refine(scene, tolerances, (options, room), times - 1)?;
            parts.push((rest, made));
        }
        Some(Done::of(faces.len(), parts))
    }

    /// Tolerances of all patches, with those of the members smaller.
    fn finer(&self, tolerances: &[f64]) -> Vec<f64> {
        let mut finer = tolerances.to_vec();
        for id in self.members() {
            finer[id.index()] /= SMALLER;
        }
        finer
    }

    /// Which of the members a patch is.
    fn number(&self, id: PatchId) -> Option<usize> {
        let found = self
            .members
            .binary_search_by_key(&id.index(), |member| member.index());
        found.ok()
    }

    /// The number of the node that shows a member.
    fn owner(&self, member: PatchId) -> usize {
        self.owners.get(&member).copied().unwrap_or_default()
    }

    /// Some of the members, in their order.
    fn of(&self, numbers: &[usize]) -> Self {
        Self {
            members: numbers.iter().map(|&k| self.members[k]).collect(),
            scale: self.scale,
            voids: self.voids.clone(),
            owners: self.owners.clone(),
            solids: self.solids.clone(),
            wider: self.wider,
        }
    }

    /// The seams that the file names between members.
    fn named<'s>(&self, scene: &'s Scene) -> Vec<Named<'s>> {
        let named = |seam: &'s Seam| {
            let [a, b] = seam.sides.each_ref().map(|side| self.number(side.patch));
            let curves = seam.sides.each_ref().map(|side| &side.curve);
            Some(Named {
                sides: [(a?, curves[0]), (b?, curves[1])],
                gap: seam.gap,
            })
        };
        scene.seams().iter().filter_map(named).collect()
    }

    /// The triangles of the members, with numbers for all vertices.
    fn parts<'m>(&self, meshes: &'m [Triangles]) -> Vec<Part<'m>> {
        let mut next = meshes
            .iter()
            .flat_map(|m| &m.vertices)
            .filter_map(|v| v.id)
            .max()
            .map_or(0, |most| most + 1);
        let mut parts = Vec::new();
        for (&patch, mesh) in self.members.iter().zip(meshes) {
            let mut number = |id: Option<u32>| {
                id.unwrap_or_else(|| {
                    next += 1;
                    next - 1
                })
            };
            let points = mesh.vertices.iter().map(|v| number(v.id)).collect();
            parts.push(Part {
                patch,
                mesh,
                points,
                is_void: self.voids.contains(&patch),
                owner: self.owner(patch),
            });
        }
        parts
    }

    fn finish(
        &self,
        patches: &[&Patch],
        faces: &[Face<'_>],
        parts: &[Part<'_>],
        proven: &[f64],
        crossings: usize,
    ) -> Done {
        let (turned, shells) = shells(parts);
        let faces = faces
            .par_iter()
            .zip(patches)
            .zip(parts)
            .enumerate()
            .map(|(k, ((face, patch), part))| {
                let mut done = face_mesh(face, patch, part.mesh, &turned[k]);
                done.proven = done.proven.max(proven[k]);
                done.scale = self.scale;
                done
            })
            .collect();
        Done {
            faces,
            shells,
            crossings,
        }
    }
}

impl Done {
    /// What parts of so many members became, each with their numbers.
    fn of(count: usize, parts: Vec<(Vec<usize>, Self)>) -> Self {
        let mut faces: Vec<Option<FaceMesh>> = vec![None; count];
        let (mut shells, mut crossings) = (Vec::new(), 0);
        for (numbers, part) in parts {
            for (number, face) in numbers.into_iter().zip(part.faces) {
                faces[number] = Some(face);
            }
            shells.extend(part.shells);
            crossings += part.crossings;
        }
        Self {
            faces: faces.into_iter().flatten().collect(),
            shells,
            crossings,
        }
    }
}

/// Triangles with normals and texture coordinates, measured.
fn face_mesh(face: &Face<'_>, patch: &Patch, mesh: &Triangles, turned: &Turned) -> FaceMesh {
    let flipped = turned.face;
    let mut positions: Vec<DVec3> = Vec::new();
    let mut normals: Vec<DVec3> = Vec::new();
    let mut parameters: Vec<DVec2> = Vec::new();
    let mut triangles = Vec::new();
    // For every vertex its first copy, and all others, one for each side of a crease.
    let mut first: Vec<Option<u32>> = vec![None; mesh.vertices.len()];
    let mut others: HashMap<u32, Vec<u32>> = HashMap::new();
    let mut sampled = off_corners(face, mesh);
    let mut gap: f64 = 0.0;
    for (number, &corners) in (0..).zip(&mesh.triangles) {
        let vertices = corners.map(|k| mesh.vertices[k as usize]);
        let uvs = vertices.map(|v| v.uv);
        let points = vertices.map(|v| v.position);
        let center = LazyCell::new(|| face.pieces.place(uvs, [1.0 / 3.0; 3]));
        let flat = (points[1] - points[0])
            .cross(points[2] - points[0])
            .normalize_or(DVec3::Z);
        sampled = vertices.iter().fold(sampled, |most, v| most.max(v.gap));
        let mut triangle = corners.map(|k| {
            let vertex = &mesh.vertices[k as usize];
            // Lines that meet at an apex have parameters and normals of their own.
            let across = face.pieces.across_apex(vertex.uv, vertex.normal);
            let mut uv = vertex.uv;
            if let Some(axis) = across {
                uv[axis] = center[axis];
            }
            let creased = across.is_some() || face.pieces.is_creased(vertex.uv);
            if !creased && let Some(copy) = first[k as usize] {
                return copy;
            }
            let normal = if creased || vertex.normal == DVec3::ZERO {
                face.pieces.normal(uv, *center).unwrap_or(flat)
            } else {
                vertex.normal
            };
            let normal = if flipped { -normal } else { normal };
            let same = |copy: &u32| {
                let is_there = across.is_none() || parameters[*copy as usize] == uv;
                is_there && normals[*copy as usize].angle_between(normal) < CREASE
            };
            let more = others.get(&k).into_iter().flatten().copied();
            if let Some(copy) = first[k as usize].into_iter().chain(more).find(same) {
                return copy;
            }
            let copy = u32::try_from(positions.len()).unwrap_or(u32::MAX);
            positions.push(vertex.position);
            normals.push(normal);
            parameters.push(uv);
            match &mut first[k as usize] {
                Some(_) => others.entry(k).or_default().push(copy),
                none => *none = Some(copy),
            }
            gap = gap.max(vertex.gap);
            copy
        });
        if flipped ^ turned.against.binary_search(&number).is_ok() {
            triangle.swap(1, 2);
        }
        triangles.push(triangle);
    }
    let uvs = parameters
        .iter()
        .map(|uv| patch.texture_coordinates(*uv))
        .collect();
    let made = Mesh::new(positions, normals, uvs, triangles);
    let mut made = made.unwrap_or_else(|_| empty_mesh());
    made.name.clone_from(&patch.name);
    made.source.clone_from(&patch.source);
    made.material = patch.material;
    FaceMesh {
        mesh: made,
        parameters,
        flipped,
        tolerance: face.tolerance,
        scale: 1.0,
        proven: mesh.proven,
        sampled,
        gap,
        unproven: mesh.unproven,
        undrawn: mesh.undrawn,
    }
}

/// The largest distance found between triangles and the surface; of a plane they are as far away as their
/// corners.
fn off_corners(face: &Face<'_>, mesh: &Triangles) -> f64 {
    if face.pieces.are_straight() {
        return 0.0;
    }
    let off = |corners: &[u32; 3]| {
        let vertices = corners.map(|k| &mesh.vertices[k as usize]);
        deviation::triangle(
            &face.pieces,
            vertices.map(|v| v.uv),
            vertices.map(|v| v.position),
        )
    };
    mesh.triangles.iter().map(off).fold(0.0, f64::max)
}

fn empty_mesh() -> Mesh {
    Mesh::new(Vec::new(), Vec::new(), Vec::new(), Vec::new()).expect("no numbers, none wrong")
}
