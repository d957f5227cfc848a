//! `f` and `l` statements: checked here, read by `tobj`, and cut into triangles.
//!
//! `tobj` gives up at the first mistake and says no line, so it is given what has been checked:
//! all vertices, and then the faces of one mesh after those of another. Both stand there as in
//! the file, except where `tobj` would take them for something else: it divides points by
//! their weights, mixes up colours that not every vertex has, and knows no comments behind
//! numbers. It does not know smoothing groups either, so their normals are added, and concave
//! polygons, so it does not cut any.

use std::collections::HashMap;
use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::{Curve, Mesh, WireShape};

use super::feed::{Feed, Vertices};
use super::specials::WirePart;
use super::statements::{Statement, reference};
use super::{Lists, invalid};
use crate::triangulate::{TESTS, is_convex_quad, triangles};
use crate::{Place, Problem, Warnings};

/// Group and material of a part of the file, as positions in lists of names.
pub(super) type Tag = (Option<usize>, Option<usize>);

/// What faces of one mesh have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Key {
    Mesh {
        tag: Tag,
        texcoords: bool,
        normals: bool,
    },
    Lines(Tag),
}

/// One polygon, or one line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    /// Position in the list of keys.
    key: usize,
    line: usize,
    /// Where it begins in the text, or where its corners begin in the list of all corners.
    start: usize,
    /// How long it is in the text; 0 if its corners are listed.
    length: u32,
    count: u32,
    /// Its smoothing group; 0 if it is flat or has normals of its own.
    smoothing: u32,
}

/// In place of the position of something that is not there.
pub(super) const NONE: u32 = u32::MAX;

/// Positions in the lists of vertices, texture vertices and normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    pub(super) vertex: u32,
    pub(super) texcoord: u32,
    pub(super) normal: u32,
}

/// All polygons and lines of a file.
#[derive(Clone, Debug, Default)]
pub(super) struct Faces {
    pub(super) vertices: Vertices,
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
        let mut is_plain = self.add_plain(statement, lists, &mut seen);
        let words = (!is_plain).then(|| statement.arguments());
        for word in words.into_iter().flatten() {
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
        is_plain &= dropped.is_none() && smoothing == 0;
        let text = statement.plain().filter(|_| is_plain);
        let length = text.as_ref().map_or(0, ExactSizeIterator::len);
        let length = u32::try_from(length).unwrap_or(0);
        if length > 0 {
            self.corners.truncate(start);
        }
        let key = self.key(Key::Mesh {
            tag,
            texcoords,
            normals: normals || smoothing > 0,
        });
        self.faces.push(Face {
            key,
            line: statement.line,
            start: text.filter(|_| length > 0).map_or(start, |text| text.start),
            length,
            count,
            smoothing,
        });
        Ok(())
    }

    /// Adds the corners of a statement that `tobj` can read as it stands: of digits and `/` alone,
    /// all references usable. Otherwise it adds nothing.
    fn add_plain(
        &mut self,
        statement: &Statement<'_>,
        lists: &Lists,
        seen: &mut [usize; 2],
    ) -> bool {
        let start = self.corners.len();
        let is_possible = statement.keyword() == "f" && !lists.damaged;
        let mut rest = is_possible.then(|| statement.rest().as_bytes());
        while let Some(text) = rest.map(<[u8]>::trim_ascii_start) {
            if text.is_empty() {
                return true;
            }
            let found = plain_corner(text, lists);
            if let Some((corner, _)) = found {
                seen[0] += usize::from(corner.texcoord != NONE);
                seen[1] += usize::from(corner.normal != NONE);
                self.corners.push(corner);
            }
            rest = found.map(|(_, length)| &text[length..]);
        }
        self.corners.truncate(start);
        *seen = [0; 2];
        false
    }

    /// Takes an `l` statement; its texture vertices say nothing without an area.
    pub(super) fn add_line(
        &mut self,
        statement: &Statement<'_>,
        lists: &Lists,
        tag: Tag,
    ) -> Result<(), Problem> {
        let start = self.corners.len();
        for word in statement.arguments() {
            match vertex(word.split('/').next().unwrap_or(""), lists) {
                Ok(vertex) => self.corners.push(Corner {
                    vertex,
                    texcoord: NONE,
                    normal: NONE,
                }),
                Err(text) => {
                    self.corners.truncate(start);
                    return Err(invalid(text));
                }
            }
        }
        let found = self.corners.len() - start;
        let Some(count) = u32::try_from(found).ok().filter(|&count| count >= 2) else {
            self.corners.truncate(start);
            return Err(invalid(format!("{found} vertices; at least 2 are needed")));
        };
        let key = self.key(Key::Lines(tag));
        self.faces.push(Face {
            key,
            line: statement.line,
            start,
            length: 0,
            count,
            smoothing: 0,
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

    /// All meshes, one for all faces with the same group and material, and all lines.
    pub(super) fn read(
        mut self,
        source: &str,
        mut lists: Lists,
        warnings: &mut Warnings,
    ) -> (Vec<MeshPart>, Vec<WirePart>) {
        let (mut parts, mut wires) = (Vec::new(), Vec::new());
        if self.faces.is_empty() {
            return (parts, wires);
        }
        let normals = lists.normals.len();
        self.smooth(&mut lists);
        self.faces.sort_by_key(|face| face.key);
        let vertices = std::mem::take(&mut self.vertices);
        let (faces, corners) = (&self.faces, &self.corners);
        let mut feed = Feed::new(source, vertices, &lists, normals, faces, corners);
        let options = tobj::LoadOptions {
            single_index: true,
            ..tobj::LoadOptions::default()
        };
        let no_files = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
        let models = match tobj::load_obj_buf(&mut feed, &options, no_files) {
            Ok((models, _)) => models,
            Err(error) => {
                let place = Place::item(self.faces[0].line, "f");
                warnings.invalid(place, format!("the polygons: {error}"));
                return (parts, wires);
            }
        };
        drop(lists);
        let mut tests = TESTS;
        let chunks = self.faces.chunk_by(|a, b| a.key == b.key);
        for (faces, model) in chunks.zip(models) {
            let line = faces[0].line;
            match self.keys[faces[0].key] {
                Key::Lines(tag) => lines(faces, &model.mesh, tag, &mut wires, warnings),
                Key::Mesh { tag, .. } => match mesh(faces, &model.mesh, &mut tests, warnings) {
                    Ok(mesh) => parts.push(MeshPart { mesh, tag, line }),
                    Err(error) => warnings.add(Place::item(line, "f"), error),
                },
            }
        }
        (parts, wires)
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

impl Face {
    /// Where it stands in the text, if it goes to `tobj` like that.
    pub(super) fn text(&self) -> Option<Range<usize>> {
        (self.length > 0).then(|| self.start..self.start + self.length as usize)
    }

    /// Its corners, where they are listed.
    pub(super) fn corners<'c>(&self, all: &'c [Corner]) -> &'c [Corner] {
        &all[self.start..self.start + self.count as usize]
    }

    /// Whether it is in the same mesh as another one.
    pub(super) fn is_beside(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

fn points(flat: &[f64]) -> Vec<DVec3> {
    flat.chunks_exact(3).map(DVec3::from_slice).collect()
}

/// What `tobj` read of these faces, in triangles.
fn mesh(
    faces: &[Face],
    read: &tobj::Mesh,
    tests: &mut usize,
    warnings: &mut Warnings,
) -> Result<Mesh, kernel::Error> {
    let positions = points(&read.positions);
    let mut triangles = Vec::new();
    let mut rest = &read.indices[..];
    for face in faces {
        let (corners, after) = rest.split_at(face.count as usize);
        rest = after;
        if !cut(corners, &positions, tests, &mut triangles) {
            let place = Place::item(face.line, "f");
            warnings.invalid(place, "a polygon too tangled to cut up; cut as a fan");
        }
    }
    let texcoords = read.texcoords.chunks_exact(2).map(DVec2::from_slice);
    let mesh = Mesh::new(
        positions,
        points(&read.normals),
        texcoords.collect(),
        triangles,
    )?;
    let colors = read.vertex_color.chunks_exact(3).map(DVec3::from_slice);
    // Negative ones stand for vertices without a colour.
    let has_color = |color: &DVec3| color.x >= 0.0;
    if !colors.clone().any(|color| has_color(&color)) {
        return Ok(mesh);
    }
    let or_white = |color: DVec3| if has_color(&color) { color } else { DVec3::ONE };
    mesh.with_colors(colors.map(|color| or_white(color).extend(1.0)).collect())
}

/// Adds what `tobj` read of these lines.
fn lines(
    faces: &[Face],
    read: &tobj::Mesh,
    tag: Tag,
    wires: &mut Vec<WirePart>,
    warnings: &mut Warnings,
) {
    let positions = points(&read.positions);
    let mut rest = &read.indices[..];
    for face in faces {
        let (corners, after) = rest.split_at(face.count as usize);
        rest = after;
        let points: Vec<_> = corners.iter().map(|&k| positions[k as usize]).collect();
        match Curve::polyline(&points) {
            Ok(curve) => wires.push(WirePart {
                shape: WireShape::Curve(curve),
                tag,
                line: face.line,
                what: "l".to_owned(),
            }),
            Err(error) => warnings.add(Place::item(face.line, "l"), error),
        }
    }
}

/// Adds the triangles of a face; `false` if it is not sure that they fill it.
fn cut(corners: &[u32], points: &[DVec3], tests: &mut usize, into: &mut Vec<[u32; 3]>) -> bool {
    let point = |&k: &u32| points[k as usize];
    match *corners {
        [a, b, c] => into.push([a, b, c]),
        [a, b, c, d] if is_convex_quad([a, b, c, d].map(|k| point(&k))) => {
            into.extend([[a, b, c], [a, c, d]]);
        }
        _ => {
            let points: Vec<DVec3> = corners.iter().map(point).collect();
            let found = triangles(&points, tests);
            let is_sure = found.is_some();
            let fan = || (2..points.len()).map(|i| [0, i - 1, i]).collect();
            let found = found.unwrap_or_else(fan);
            into.extend(found.iter().map(|triangle| triangle.map(|i| corners[i])));
            return is_sure;
        }
    }
    true
}

/// Reads a reference to a vertex that is there.
pub(super) fn vertex(word: &str, lists: &Lists) -> Result<u32, String> {
    let vertex = reference(word, lists.positions.len(), "vertices")?;
    if !lists.positions[vertex].is_finite() {
        return Err(format!("vertex {} could not be read", vertex + 1));
    }
    Ok(u32::try_from(vertex).unwrap_or(NONE))
}

/// Reads a corner of digits and `/` alone, of which all parts are there, at the start of a text;
/// also the length of its word.
fn plain_corner(text: &[u8], lists: &Lists) -> Option<(Corner, usize)> {
    let (mut parts, mut at, mut length) = ([0_u32; 3], 0, 0);
    let (mut number, mut digits) = (0_u32, 0);
    for byte in text {
        match byte {
            b'0' if digits == 0 => return None,
            // Nine of them are no overflow.
            b'0'..=b'9' if digits < 9 => {
                number = number * 10 + u32::from(byte - b'0');
                digits += 1;
            }
            b'/' if at < 2 => {
                parts[at] = number;
                at += 1;
                (number, digits) = (0, 0);
            }
            _ if byte.is_ascii_whitespace() => break,
            _ => return None,
        }
        length += 1;
    }
    parts[at] = number;
    // What is not there becomes the largest number.
    let [vertex, texcoord, normal] = parts.map(|number| number.wrapping_sub(1));
    let is_there = (vertex as usize) < lists.positions.len()
        && (texcoord == NONE || (texcoord as usize) < lists.texcoords.len())
        && (normal == NONE || (normal as usize) < lists.normals.len());
    let corner = Corner {
        vertex,
        texcoord,
        normal,
    };
    is_there.then_some((corner, length))
}

/// Whether a vector has a length.
pub(super) fn is_direction(vector: DVec3) -> bool {
    let squared = vector.length_squared();
    squared > 0.0 && squared.is_finite()
}

/// Reads `v`, `v/vt`, `v//vn` or `v/vt/vn`. Also says what is wrong with a `vt` or `vn`, which
/// then is not there.
fn corner(word: &str, lists: &Lists) -> Result<(Corner, Option<&'static str>), String> {
    let small = |index: usize| u32::try_from(index).unwrap_or(NONE);
    let mut parts = word.split('/');
    let mut corner = Corner {
        vertex: vertex(parts.next().unwrap_or(""), lists)?,
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
            Ok(index) if is_direction(lists.normals[index]) => corner.normal = small(index),
            _ => problem = Some("the normal is missing or unusable; the face goes without"),
        },
    }
    if parts.next().is_some() {
        problem = Some("a corner has more than three parts; the others are not used");
    }
    Ok((corner, problem))
}
