//! `f` statements: checked and cut into triangles here, gathered into meshes by `tobj`.
//!
//! `tobj` gives up on the first bad reference, divides points by their fourth number and cuts
//! every polygon as a fan. So it gets a text of our own, with valid faces only, sorted so that
//! each of its models is one mesh of ours.

use std::fmt::Write as _;

use glam::{DVec2, DVec3, DVec4};
use kernel::Mesh;

use super::Lists;
use super::statements::{Statement, reference};
use crate::triangulate::{TESTS, triangles};
use crate::{Place, Problem, Warnings};

/// Group and material of a part of the file, as positions in lists of names.
pub(super) type Tag = (Option<usize>, Option<usize>);

/// What faces of one mesh have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    tag: Tag,
    texcoords: bool,
    normals: bool,
}

/// One polygon.
#[derive(Clone, Copy, Debug)]
struct Face {
    key: Key,
    line: usize,
    /// Where its corners begin in the list of all corners.
    start: usize,
    count: usize,
}

/// Positions in the lists of vertices, texture vertices and normals.
#[derive(Clone, Copy, Debug)]
struct Corner {
    vertex: usize,
    texcoord: usize,
    normal: usize,
}

/// All polygons of a file.
#[derive(Clone, Debug, Default)]
pub(super) struct Faces {
    corners: Vec<Corner>,
    faces: Vec<Face>,
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
    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// Takes an `f` statement. An error means the face is left out; bad texture vertices or
    /// normals are only dropped, with a warning.
    pub(super) fn add(
        &mut self,
        statement: &Statement<'_>,
        lists: &Lists,
        tag: Tag,
        warnings: &mut Warnings,
    ) -> Result<(), Problem> {
        let start = self.corners.len();
        let mut dropped = None;
        let (mut texcoords, mut normals) = (0, 0);
        for word in statement.arguments() {
            match corner(word, lists) {
                Ok((corner, seen, problem)) => {
                    texcoords += usize::from(seen[0]);
                    normals += usize::from(seen[1]);
                    dropped = dropped.or(problem);
                    self.corners.push(corner);
                }
                Err(text) => {
                    self.corners.truncate(start);
                    return Err(Problem::Invalid(text));
                }
            }
        }
        let count = self.corners.len() - start;
        if count < 3 {
            self.corners.truncate(start);
            let text = format!("{count} corners; a face needs at least 3");
            return Err(Problem::Invalid(text));
        }
        if dropped.is_none() && (texcoords % count, normals % count) != (0, 0) {
            dropped = Some("some corners have texture vertices or normals, others not");
        }
        if let Some(text) = dropped {
            warnings.invalid(Place::item(statement.line, "f"), text);
        }
        let key = Key {
            tag,
            texcoords: texcoords == count,
            normals: normals == count,
        };
        self.faces.push(Face {
            key,
            line: statement.line,
            start,
            count,
        });
        Ok(())
    }

    /// All meshes, ordered by group and material.
    pub(super) fn meshes(mut self, lists: &Lists, warnings: &mut Warnings) -> Vec<MeshPart> {
        self.faces.sort_by_key(|face| face.key);
        let mut text = lists_as_text(lists);
        let (mut firsts, mut tests): (Vec<Face>, _) = (Vec::new(), TESTS);
        for face in &self.faces {
            if firsts.last().is_none_or(|first| first.key != face.key) {
                // Writing to a string cannot fail.
                let _ = writeln!(text, "g {}", firsts.len());
                firsts.push(*face);
            }
            if !self.write_face(face, lists, &mut tests, &mut text) {
                let place = Place::item(face.line, "f");
                warnings.invalid(place, "a polygon too tangled to cut up; cut as a fan");
            }
        }
        let options = tobj::LoadOptions {
            single_index: true,
            triangulate: true,
            ignore_points: true,
            ignore_lines: true,
        };
        let no_materials = |_: &std::path::Path| Err(tobj::LoadError::GenericFailure);
        let models = match tobj::load_obj_buf(&mut text.as_bytes(), &options, no_materials) {
            Ok((models, _)) => models,
            Err(error) => {
                warnings.invalid(Place::item(0, "polygons"), error.to_string());
                return Vec::new();
            }
        };
        let mut parts = Vec::new();
        for model in models {
            let Some(first) = model.name.parse().ok().and_then(|i: usize| firsts.get(i)) else {
                continue;
            };
            match mesh(&model.mesh) {
                Ok(mesh) => parts.push(MeshPart {
                    mesh,
                    tag: first.key.tag,
                    line: first.line,
                }),
                Err(error) => warnings.add(Place::item(first.line, "f"), error),
            }
        }
        parts
    }

    /// Writes a face as triangles, or whole where a fan is right; `false` if it is not sure.
    fn write_face(&self, face: &Face, lists: &Lists, tests: &mut usize, text: &mut String) -> bool {
        let corners = &self.corners[face.start..face.start + face.count];
        let point = |c: &Corner| lists.positions[c.vertex].truncate();
        let (cut, sure) = match corners.len() {
            3 => (vec![[0, 1, 2]], true),
            _ => {
                let points: Vec<DVec3> = corners.iter().map(point).collect();
                match triangles(&points, tests) {
                    Some(cut) => (cut, true),
                    None => ((2..points.len()).map(|i| [0, i - 1, i]).collect(), false),
                }
            }
        };
        for triangle in cut {
            text.push('f');
            for c in triangle.map(|i| corners[i]) {
                let (v, vt, vn) = (c.vertex + 1, c.texcoord + 1, c.normal + 1);
                let _ = match (face.key.texcoords, face.key.normals) {
                    (false, false) => write!(text, " {v}"),
                    (true, false) => write!(text, " {v}/{vt}"),
                    (false, true) => write!(text, " {v}//{vn}"),
                    (true, true) => write!(text, " {v}/{vt}/{vn}"),
                };
            }
            text.push('\n');
        }
        sure
    }
}

/// Reads `v`, `v/vt`, `v//vn` or `v/vt/vn`. Also says which of `vt` and `vn` are there and
/// valid, and what is wrong with one that is not.
fn corner(word: &str, lists: &Lists) -> Result<(Corner, [bool; 2], Option<&'static str>), String> {
    let mut parts = word.split('/');
    let vertex = parts.next().unwrap_or("");
    let vertex = reference(vertex, lists.positions.len(), "vertices")?;
    if !lists.positions[vertex].is_finite() {
        return Err(format!("vertex {} could not be read", vertex + 1));
    }
    let counts = [lists.texcoords.len(), lists.normals.len()];
    let usable = |i: usize, index: usize| match i {
        0 => lists.texcoords[index].is_finite(),
        _ => lists.normals[index].try_normalize().is_some(),
    };
    // The same words for all, so that a file full of them gives one warning.
    let missing = [
        "the texture vertex is missing or unusable; the face goes without",
        "the normal is missing or unusable; the face goes without",
    ];
    let (mut found, mut seen, mut problem) = ([0; 2], [false; 2], None);
    for i in 0..2 {
        match parts.next() {
            None | Some("") => {}
            Some(part) => match reference(part, counts[i], "") {
                Ok(index) if usable(i, index) => (found[i], seen[i]) = (index, true),
                _ => problem = Some(missing[i]),
            },
        }
    }
    if parts.next().is_some() {
        problem = Some("a corner has more than three parts; the others are not used");
    }
    let [texcoord, normal] = found;
    let corner = Corner {
        vertex,
        texcoord,
        normal,
    };
    Ok((corner, seen, problem))
}

/// The `v`, `vt` and `vn` statements for `tobj`; unreadable points, which no face uses, keep
/// their numbers.
fn lists_as_text(lists: &Lists) -> String {
    let mut text = String::new();
    for p in &lists.positions {
        let p = if p.is_finite() { *p } else { DVec4::ZERO };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "v {:e} {:e} {:e}", p.x, p.y, p.z);
    }
    for t in &lists.texcoords {
        let t = if t.is_finite() { *t } else { DVec2::ZERO };
        let _ = writeln!(text, "vt {:e} {:e}", t.x, t.y);
    }
    for n in &lists.normals {
        let n = if n.is_finite() { *n } else { DVec3::ZERO };
        let _ = writeln!(text, "vn {:e} {:e} {:e}", n.x, n.y, n.z);
    }
    text
}

fn mesh(mesh: &tobj::Mesh) -> Result<Mesh, kernel::Error> {
    let triples = |list: &[f64]| -> Vec<DVec3> {
        let chunks = list.chunks_exact(3);
        chunks.map(|c| DVec3::new(c[0], c[1], c[2])).collect()
    };
    let uvs = mesh.texcoords.chunks_exact(2);
    let triangles = mesh.indices.chunks_exact(3);
    Mesh::new(
        triples(&mesh.positions),
        triples(&mesh.normals),
        uvs.map(|c| DVec2::new(c[0], c[1])).collect(),
        triangles.map(|c| [c[0], c[1], c[2]]).collect(),
    )
}
