//! `f` statements, which become meshes: checked, cut into triangles, and gathered.
//!
//! This is the statement that large files are full of, so it is not handed to `tobj`: that
//! would read every number twice, gives up at the first bad reference, divides points by
//! their fourth number, and cuts every polygon as a fan. Where a file is good, both agree.

use std::collections::HashMap;

use glam::{DVec2, DVec3, DVec4};
use kernel::Mesh;

use super::Lists;
use super::statements::{Statement, reference};
use crate::triangulate::{TESTS, is_convex_quad, triangles};
use crate::{Place, Problem, Warnings};

/// Group and material of a part of the file, as positions in lists of names.
pub(super) type Tag = (Option<usize>, Option<usize>);

/// What faces of one mesh have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Key {
    tag: Tag,
    texcoords: bool,
    normals: bool,
}

/// One polygon.
#[derive(Clone, Copy, Debug)]
struct Face {
    /// Position in the list of keys.
    key: usize,
    line: usize,
    /// Where its corners begin in the list of all corners.
    start: usize,
    count: u32,
    /// Its smoothing group; 0 if it is flat or has normals of its own.
    smoothing: u32,
}

/// In place of the position of something that is not there.
const NONE: u32 = u32::MAX;

/// Positions in the lists of vertices, texture vertices and normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Corner {
    vertex: u32,
    texcoord: u32,
    normal: u32,
}

/// All polygons of a file.
#[derive(Clone, Debug, Default)]
pub(super) struct Faces {
    corners: Vec<Corner>,
    faces: Vec<Face>,
    keys: Vec<Key>,
    positions: HashMap<Key, usize>,
}

/// A mesh with its place in the file.
#[derive(Clone, Debug)]
pub(super) struct MeshPart {
    /// The mesh, still without name and material.
    pub(super) mesh: Mesh,
    /// Its group and material.
    pub(super) tag: Tag,
    /// The line of its first face.
    pub(super) line: usize,
}

impl Faces {
    /// Takes an `f` statement. An error means the face is left out; bad texture vertices or
    /// normals are only dropped, with a warning.
    pub(super) fn add(
        &mut self,
        statement: &Statement<'_>,
        lists: &Lists,
        tag: Tag,
        smoothing: u32,
        warnings: &mut Warnings,
    ) -> Result<(), Problem> {
        let start = self.corners.len();
        let mut dropped = None;
        let mut seen = [0, 0];
        for word in statement.arguments() {
            match corner(word, lists) {
                Ok((corner, problem)) => {
                    dropped = dropped.or(problem);
                    seen[0] += usize::from(corner.texcoord != NONE);
                    seen[1] += usize::from(corner.normal != NONE);
                    self.corners.push(corner);
                }
                Err(text) => {
                    self.corners.truncate(start);
                    return Err(Problem::Invalid(text));
                }
            }
        }
        let found = self.corners.len() - start;
        let Some(count) = u32::try_from(found).ok().filter(|&count| count >= 3) else {
            self.corners.truncate(start);
            let text = format!("{found} corners; a face needs at least 3");
            return Err(Problem::Invalid(text));
        };
        let [texcoords, normals] = seen.map(|seen| seen == found);
        if dropped.is_none() && seen.iter().any(|&seen| seen % found != 0) {
            dropped = Some("some corners have texture vertices or normals, others not");
        }
        if let Some(text) = dropped {
            warnings.invalid(Place::item(statement.line, "f"), text);
            for corner in &mut self.corners[start..] {
                corner.texcoord = if texcoords { corner.texcoord } else { NONE };
                corner.normal = if normals { corner.normal } else { NONE };
            }
        }
        let smoothing = if normals { 0 } else { smoothing };
        let key = self.key(Key {
            tag,
            texcoords,
            normals: normals || smoothing > 0,
        });
        self.faces.push(Face {
            key,
            line: statement.line,
            start,
            count,
            smoothing,
        });
        Ok(())
    }

    /// The position of a key in the list; mostly it is that of the face before.
    fn key(&mut self, key: Key) -> usize {
        match self.faces.last() {
            Some(face) if self.keys[face.key] == key => face.key,
            _ => *self.positions.entry(key).or_insert_with(|| {
                self.keys.push(key);
                self.keys.len() - 1
            }),
        }
    }

    /// All meshes, one for all faces with the same group and material.
    pub(super) fn meshes(mut self, mut lists: Lists, warnings: &mut Warnings) -> Vec<MeshPart> {
        self.smooth(&mut lists);
        self.faces.sort_by_key(|face| face.key);
        let mut welder = Welder::new(lists.positions.len());
        let (mut tests, mut parts) = (TESTS, Vec::new());
        for faces in self.faces.chunk_by(|a, b| a.key == b.key) {
            let mut indices = Vec::new();
            for face in faces {
                let corners = &self.corners[face.start..face.start + face.count as usize];
                if !cut(corners, &lists, &mut tests, |corner| {
                    indices.push(welder.index(corner));
                }) {
                    let place = Place::item(face.line, "f");
                    warnings.invalid(place, "a polygon too tangled to cut up; cut as a fan");
                }
            }
            let line = faces[0].line;
            match welder.mesh(&lists, self.keys[faces[0].key], &indices) {
                Ok(mesh) => parts.push(MeshPart {
                    mesh,
                    tag: self.keys[faces[0].key].tag,
                    line,
                }),
                Err(error) => warnings.add(Place::item(line, "f"), error),
            }
        }
        parts
    }

    /// Gives the faces of smoothing groups the mean normals at their vertices, by area.
    fn smooth(&mut self, lists: &mut Lists) {
        let mut known: HashMap<(u32, u32), (u32, DVec3)> = HashMap::new();
        let first = lists.normals.len();
        for face in self.faces.iter().filter(|face| face.smoothing > 0) {
            let corners = &mut self.corners[face.start..face.start + face.count as usize];
            let point = |c: &Corner| lists.positions[c.vertex as usize].truncate();
            let origin = point(&corners[0]);
            let fan = corners.windows(2);
            let area: DVec3 = fan
                .map(|w| (point(&w[0]) - origin).cross(point(&w[1]) - origin))
                .sum();
            for corner in corners {
                let next = u32::try_from(first + known.len()).unwrap_or(NONE);
                let entry = known.entry((face.smoothing, corner.vertex));
                let (normal, sum) = entry.or_insert((next, DVec3::ZERO));
                // Faces back to back leave nothing; then one of them counts.
                *sum = if *sum == -area { area } else { *sum + area };
                corner.normal = *normal;
            }
        }
        let mut normals: Vec<_> = known.into_values().collect();
        normals.sort_by_key(|normal| normal.0);
        let unit = |(_, sum): (u32, DVec3)| sum.normalize_or(DVec3::Z);
        lists.normals.extend(normals.into_iter().map(unit));
    }
}

/// Hands on the corners of the triangles of a face; `false` if it is not sure that they fill it.
fn cut(corners: &[Corner], lists: &Lists, tests: &mut usize, mut add: impl FnMut(Corner)) -> bool {
    let point = |c: &Corner| lists.positions[c.vertex as usize].truncate();
    match *corners {
        [a, b, c] => [a, b, c].into_iter().for_each(add),
        [a, b, c, d] if is_convex_quad([a, b, c, d].map(|c| point(&c))) => {
            [a, b, c, a, c, d].into_iter().for_each(add);
        }
        _ => {
            let points: Vec<DVec3> = corners.iter().map(point).collect();
            let found = triangles(&points, tests);
            let is_sure = found.is_some();
            let fan = || (2..points.len()).map(|i| [0, i - 1, i]).collect();
            for triangle in found.unwrap_or_else(fan) {
                triangle.into_iter().for_each(|i| add(corners[i]));
            }
            return is_sure;
        }
    }
    true
}

/// Reads `v`, `v/vt`, `v//vn` or `v/vt/vn`. Also says what is wrong with a `vt` or `vn`, which
/// then is not there.
fn corner(word: &str, lists: &Lists) -> Result<(Corner, Option<&'static str>), String> {
    let small = |index: usize| u32::try_from(index).unwrap_or(NONE);
    let mut parts = word.split('/');
    let vertex = parts.next().unwrap_or("");
    let vertex = reference(vertex, lists.positions.len(), "vertices")?;
    if !lists.positions[vertex].is_finite() {
        return Err(format!("vertex {} could not be read", vertex + 1));
    }
    let mut corner = Corner {
        vertex: small(vertex),
        texcoord: NONE,
        normal: NONE,
    };
    let mut problem = None;
    // The same words for all, so that a file full of them gives one warning.
    match parts.next() {
        None => return Ok((corner, None)),
        Some("") => {}
        Some(part) => match reference(part, lists.texcoords.len(), "") {
            Ok(index) if lists.texcoords[index].is_finite() => corner.texcoord = small(index),
            _ => problem = Some("the texture vertex is missing or unusable; the face goes without"),
        },
    }
    match parts.next() {
        None | Some("") => {}
        Some(part) => match reference(part, lists.normals.len(), "") {
            Ok(index) if lists.normals[index].try_normalize().is_some() => {
                corner.normal = small(index);
            }
            _ => problem = Some("the normal is missing or unusable; the face goes without"),
        },
    }
    if parts.next().is_some() {
        problem = Some("a corner has more than three parts; the others are not used");
    }
    Ok((corner, problem))
}

/// How many corners at one vertex are looked through one by one.
const CHAIN: usize = 8;

/// Makes one vertex of all corners of a mesh with the same references.
struct Welder {
    /// For each position the first of its corners here.
    heads: Vec<u32>,
    /// The corners, each with the next one at the same position.
    corners: Vec<(Corner, u32)>,
    /// Those that stand too far back in their chain.
    others: HashMap<Corner, u32>,
}

impl Welder {
    fn new(positions: usize) -> Self {
        Self {
            heads: vec![NONE; positions],
            corners: Vec::new(),
            others: HashMap::new(),
        }
    }

    /// The number of the vertex.
    fn index(&mut self, corner: Corner) -> u32 {
        let next = u32::try_from(self.corners.len()).unwrap_or(NONE);
        let head = self.heads[corner.vertex as usize];
        let mut at = head;
        for _ in 0..CHAIN {
            let Some(&(known, after)) = self.corners.get(at as usize) else {
                self.heads[corner.vertex as usize] = next;
                self.corners.push((corner, head));
                return next;
            };
            if known == corner {
                return at;
            }
            at = after;
        }
        *self.others.entry(corner).or_insert_with(|| {
            self.corners.push((corner, NONE));
            next
        })
    }

    /// The mesh of all corners since the one before, and begins a new one.
    fn mesh(&mut self, lists: &Lists, key: Key, indices: &[u32]) -> Result<Mesh, kernel::Error> {
        let corners = || self.corners.iter().map(|(corner, _)| corner);
        let position = |c: &Corner| lists.positions[c.vertex as usize].truncate();
        let normal = |c: &Corner| lists.normals[c.normal as usize];
        let texcoord = |c: &Corner| lists.texcoords[c.texcoord as usize];
        let normals: Vec<DVec3> = if key.normals {
            corners().map(normal).collect()
        } else {
            Vec::new()
        };
        let texcoords: Vec<DVec2> = if key.texcoords {
            corners().map(texcoord).collect()
        } else {
            Vec::new()
        };
        let triangles = indices.chunks_exact(3).map(|c| [c[0], c[1], c[2]]);
        let mut mesh = Mesh::new(
            corners().map(position).collect(),
            normals,
            texcoords,
            triangles.collect(),
        );
        let is_colored = |c: &Corner| (c.vertex as usize) < lists.colors.len();
        if corners().any(is_colored) {
            let color = |c: &Corner| lists.colors.get(c.vertex as usize).copied();
            let colors = corners().map(|c| color(c).unwrap_or(DVec4::ONE));
            mesh = mesh.and_then(|mesh| mesh.with_colors(colors.collect()));
        }
        for (corner, _) in self.corners.drain(..) {
            self.heads[corner.vertex as usize] = NONE;
        }
        self.others.clear();
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_one_vertex_if_all_references_are_equal() {
        let corner = |vertex, texcoord| Corner {
            vertex,
            texcoord,
            normal: NONE,
        };
        let mut welder = Welder::new(2);
        // More at one vertex than a chain holds.
        for round in 0..2 {
            for k in 0..40 {
                assert_eq!(welder.index(corner(0, k)), k, "round {round}");
            }
        }
        assert_eq!(welder.index(corner(1, 0)), 40);
        assert_eq!(welder.index(corner(1, 0)), 40);
    }
}
