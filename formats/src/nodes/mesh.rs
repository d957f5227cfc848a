//! Polygons of X3D and VRML 97 to triangles.

use std::collections::HashMap;

use glam::{DVec2, DVec3, DVec4};
use kernel::{Error as GeometryError, Mesh};

use super::scene::Converter;
use super::{Link, Node};
use crate::Error;
use crate::triangulate::triangles;

/// Polygons over a list of points.
#[derive(Debug, Default)]
pub(super) struct Polygons {
    /// All corners, polygon by polygon.
    pub(super) corners: Vec<Corner>,
    /// Where each polygon ends in that list.
    pub(super) ends: Vec<usize>,
}

/// A corner of a polygon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Corner {
    /// Its point.
    pub(super) vertex: u32,
    /// Where it stands in the list of the node, for lists that run along.
    pub(super) entry: usize,
    /// The position of the polygon among those of the node.
    pub(super) face: usize,
}

impl Polygons {
    /// The polygons, each as its corners.
    pub(super) fn iter(&self) -> impl Iterator<Item = &[Corner]> {
        let starts = std::iter::once(&0).chain(&self.ends);
        starts.zip(&self.ends).map(|(&a, &b)| &self.corners[a..b])
    }
}

impl Converter<'_> {
    /// The triangles of a node, with its normals or those that it asks for.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn mesh(&mut self, node: &Node) -> Result<Result<Mesh, GeometryError>, Error> {
        let points = match &*node.kind {
            "ElevationGrid" => self.grid_points(node)?,
            "TriangleSet2D" => {
                let points = node.points_2d("vertices", &mut self.warnings);
                self.count_points(points.len(), node)?;
                points.into_iter().map(|p| p.extend(0.0)).collect()
            }
            _ => self.points_inside(node)?,
        };
        let mut polygons = self.polygons(node, points.len())?;
        if !node.flag("ccw", true, &mut self.warnings) {
            let mut start = 0;
            for &end in &polygons.ends {
                polygons.corners[start..end].reverse();
                start = end;
            }
        }
        let mut cut: Vec<[usize; 3]> = Vec::new();
        let (mut start, mut tangled) = (0, false);
        for face in polygons.iter() {
            let corners: Vec<DVec3> = face.iter().map(|c| points[c.vertex as usize]).collect();
            let fan = || (2..face.len()).map(|i| [0, i - 1, i]).collect();
            let inside = match face.len() {
                0..=3 => fan(),
                _ => triangles(&corners, &mut self.tests).unwrap_or_else(|| {
                    tangled = true;
                    fan()
                }),
            };
            cut.extend(inside.into_iter().map(|t: [usize; 3]| t.map(|i| start + i)));
            start += face.len();
        }
        if tangled {
            let text = "polygons too tangled to cut up; cut as fans";
            self.warnings.invalid(node.place(), text);
        }
        let corners = Corners {
            normals: self.normals(node, &points, &polygons)?,
            coordinates: self.coordinates(node, &points, &polygons)?,
            colors: self.colors(node, &polygons)?,
        };
        Ok(corners.mesh(&points, &polygons.corners, &cut))
    }

    /// The whole numbers of a field; empty if one of them is malformed.
    pub(super) fn indices(&mut self, node: &Node, field: &str) -> Result<Vec<i64>, Error> {
        let words = super::text::words(node.text(field).unwrap_or_default());
        let indices: Option<Vec<i64>> = words.map(super::text::whole).collect();
        let indices = indices.unwrap_or_else(|| {
            let text = "something is no whole number; the field is not used";
            self.warnings.invalid(node.field_place(field), text);
            Vec::new()
        });
        self.count_points(indices.len(), node)?;
        Ok(indices)
    }

    /// The polygons of a node over so many points; those with other points are left out.
    fn polygons(&mut self, node: &Node, points: usize) -> Result<Polygons, Error> {
        let kind = &*node.kind;
        let indices = match kind {
            "IndexedFaceSet" => self.indices(node, "coordIndex")?,
            _ if kind.starts_with("Indexed") => self.indices(node, "index")?,
            _ => (0..).take(points).collect(),
        };
        let mut found = Found {
            indices,
            points,
            polygons: Polygons::default(),
            faces: 0,
            missing: false,
        };
        match kind {
            "IndexedFaceSet" => found.runs(|found, start, end| found.add(start..end)),
            "ElevationGrid" => {
                let across = node.count("xDimension", 0, &mut self.warnings);
                found.grid(across);
            }
            "IndexedQuadSet" | "QuadSet" => found.chunks(4),
            "IndexedTriangleFanSet" => found.runs(Found::fan),
            "IndexedTriangleStripSet" => found.runs(Found::strip),
            "TriangleFanSet" | "TriangleStripSet" => {
                let (field, add): (_, fn(&mut Found, usize, usize)) = match kind {
                    "TriangleFanSet" => ("fanCount", Found::fan),
                    _ => ("stripCount", Found::strip),
                };
                let mut start = 0;
                for count in self.indices(node, field)? {
                    let count = usize::try_from(count).unwrap_or(0);
                    let end = count.saturating_add(start).min(points);
                    found.missing |= count < 3 || end - start < count;
                    add(&mut found, start, end);
                    start = end;
                }
            }
            _ => found.chunks(3),
        }
        if found.missing {
            let text = format!("polygons with points that are not among the {points} there are");
            self.warnings.invalid(node.place(), text);
        }
        Ok(found.polygons)
    }

    /// The points of an `ElevationGrid`.
    fn grid_points(&mut self, node: &Node) -> Result<Vec<DVec3>, Error> {
        let heights = node.numbers("height", &mut self.warnings);
        self.count_points(heights.len(), node)?;
        let [x, z] = ["xDimension", "zDimension"].map(|f| node.count(f, 0, &mut self.warnings));
        let [dx, dz] = ["xSpacing", "zSpacing"].map(|f| node.number(f, 1.0, &mut self.warnings));
        if x.saturating_mul(z) != heights.len() || x == 0 {
            let text = format!("{} heights for {x} times {z} points", heights.len());
            self.warnings.invalid(node.place(), text);
            return Ok(Vec::new());
        }
        let point =
            |(i, &h): (usize, &f64)| DVec3::new((i % x) as f64 * dx, h, (i / x) as f64 * dz);
        Ok(heights.iter().enumerate().map(point).collect())
    }

    /// The entry of a list for each corner, by the indices of the file or in order, one for each
    /// vertex or for each face; `None` with a warning if the list of `node` is too short.
    pub(super) fn spread<T: Copy>(
        &mut self,
        node: &Node,
        given: &[T],
        indices: &[i64],
        per_vertex: bool,
        polygons: &Polygons,
    ) -> Option<Vec<T>> {
        let found = |corner: &Corner| {
            let entry = if per_vertex {
                corner.entry
            } else {
                corner.face
            };
            let index = match (indices.is_empty(), per_vertex) {
                (true, true) => Some(corner.vertex as usize),
                (true, false) => Some(corner.face),
                (false, _) => indices.get(entry).and_then(|&i| usize::try_from(i).ok()),
            };
            index.and_then(|index| given.get(index)).copied()
        };
        let all: Option<Vec<_>> = polygons.corners.iter().map(found).collect();
        if all.is_none() {
            let text = "there are fewer entries than are needed; none is used";
            self.warnings.invalid(node.place(), text);
        }
        all
    }

    /// A normal for each corner: those of the file, or means over smooth edges; `None` where
    /// the faces are flat.
    fn normals(
        &mut self,
        node: &Node,
        points: &[DVec3],
        polygons: &Polygons,
    ) -> Result<Option<Vec<DVec3>>, Error> {
        let inside = |link: &Link| &self.tree.nodes[link.node];
        let mut inside = node.children.iter().map(inside);
        let per_vertex = node.flag("normalPerVertex", true, &mut self.warnings);
        if let Some(normal) = inside.find(|n| &*n.kind == "Normal") {
            let given = normal.points_3d("vector", &mut self.warnings);
            self.count_points(given.len(), normal)?;
            let indices = self.indices(node, "normalIndex")?;
            return Ok(self.spread(normal, &given, &indices, per_vertex, polygons));
        }
        // Sets of triangles that share points are smooth unless they say otherwise.
        let shared = matches!(
            &*node.kind,
            "IndexedTriangleSet"
                | "IndexedTriangleStripSet"
                | "IndexedTriangleFanSet"
                | "IndexedQuadSet"
        );
        let crease = match (shared, per_vertex) {
            (true, true) => std::f64::consts::PI,
            (true, false) => 0.0,
            _ => self.angle(node, "creaseAngle", 0.0),
        };
        Ok((crease > 0.0).then(|| smooth(points, polygons, crease)))
    }
}

/// The polygons of a node while they are found.
struct Found {
    indices: Vec<i64>,
    points: usize,
    polygons: Polygons,
    faces: usize,
    missing: bool,
}

impl Found {
    /// A polygon of these entries of the list.
    fn add(&mut self, entries: impl IntoIterator<Item = usize>) {
        let start = self.polygons.corners.len();
        for entry in entries {
            let index = self.indices[entry];
            let vertex = u32::try_from(index)
                .ok()
                .filter(|&v| (v as usize) < self.points);
            let Some(vertex) = vertex else {
                self.polygons.corners.truncate(start);
                self.missing = true;
                break;
            };
            self.polygons.corners.push(Corner {
                vertex,
                entry,
                face: self.faces,
            });
        }
        self.faces += 1;
        self.polygons.ends.push(self.polygons.corners.len());
    }

    /// Calls `add` for each run of entries between those that are -1.
    fn runs(&mut self, add: fn(&mut Self, usize, usize)) {
        let mut start = 0;
        for end in 0..=self.indices.len() {
            if self.indices.get(end).is_none_or(|&index| index == -1) {
                if start < end {
                    add(self, start, end);
                }
                start = end + 1;
            }
        }
    }

    fn fan(&mut self, start: usize, end: usize) {
        for i in start + 2..end {
            self.add([start, i - 1, i]);
        }
    }

    /// Every other triangle of a strip turns the other way.
    fn strip(&mut self, start: usize, end: usize) {
        for i in start + 2..end {
            match (i - start) % 2 {
                0 => self.add([i - 2, i - 1, i]),
                _ => self.add([i - 1, i - 2, i]),
            }
        }
    }

    /// So many entries in a row are a polygon.
    fn chunks(&mut self, size: usize) {
        let count = self.indices.len();
        self.missing |= !count.is_multiple_of(size);
        for start in (0..count - count % size).step_by(size) {
            self.add(start..start + size);
        }
    }

    /// The fields of a grid with so many points in a row, seen from above.
    fn grid(&mut self, across: usize) {
        let rows = self.points.checked_div(across).unwrap_or(0);
        for row in 1..rows {
            for i in 1..across {
                let here = row * across + i;
                self.add([here - across - 1, here - 1, here, here - across]);
            }
        }
    }
}

/// Faces at one point up to which the angle between them counts; where more meet, all are
/// taken as smooth.
const FACES_AT_POINT: usize = 64;

/// For each corner the mean normal of the faces there that differ by at most `crease`.
fn smooth(points: &[DVec3], polygons: &Polygons, crease: f64) -> Vec<DVec3> {
    let across: Vec<DVec3> = polygons
        .iter()
        .map(|face| {
            let corner = |i: usize| points[face[i % face.len()].vertex as usize];
            let fan =
                (2..face.len()).map(|i| (corner(i - 1) - corner(0)).cross(corner(i) - corner(0)));
            fan.sum::<DVec3>().normalize_or_zero()
        })
        .collect();
    // For each point, the faces that meet there.
    let mut faces: Vec<Vec<u32>> = vec![Vec::new(); points.len()];
    for (face, index) in polygons.iter().zip(0_u32..) {
        for corner in face {
            faces[corner.vertex as usize].push(index);
        }
    }
    let sums: Vec<DVec3> = faces
        .iter()
        .map(|faces| faces.iter().map(|&f| across[f as usize]).sum())
        .collect();
    let cosine = crease.min(std::f64::consts::PI).cos() - 1e-9;
    let mut normals = Vec::new();
    for (face, &own) in polygons.iter().zip(&across) {
        for corner in face {
            let at = corner.vertex as usize;
            let all = cosine <= -1.0 || faces[at].len() > FACES_AT_POINT;
            let near = faces[at].iter().map(|&f| across[f as usize]);
            let sum = if all {
                sums[at]
            } else {
                near.filter(|n| n.dot(own) >= cosine).sum()
            };
            normals.push(sum.normalize_or(own));
        }
    }
    normals
}

/// What belongs to the corners of polygons rather than to their points, if anything does.
struct Corners {
    normals: Option<Vec<DVec3>>,
    coordinates: Option<Vec<DVec2>>,
    colors: Option<Vec<DVec4>>,
}

impl Corners {
    /// A mesh in which corners that have all in common are one vertex.
    fn mesh(
        &self,
        points: &[DVec3],
        corners: &[Corner],
        cut: &[[usize; 3]],
    ) -> Result<Mesh, GeometryError> {
        if self.normals.is_none() && self.coordinates.is_none() && self.colors.is_none() {
            let vertices = |t: &[usize; 3]| t.map(|i| corners[i].vertex);
            let cut = cut.iter().map(vertices).collect();
            return Mesh::new(points.to_vec(), Vec::new(), Vec::new(), cut);
        }
        let mut known = HashMap::new();
        let (mut firsts, mut triangles) = (Vec::new(), Vec::new());
        for triangle in cut {
            triangles.push(triangle.map(|corner| {
                *known.entry(self.key(corners, corner)).or_insert_with(|| {
                    firsts.push(corner);
                    u32::try_from(firsts.len() - 1).unwrap_or(u32::MAX)
                })
            }));
        }
        let positions = firsts.iter().map(|&i| points[corners[i].vertex as usize]);
        let mesh = Mesh::new(
            positions.collect(),
            at(self.normals.as_ref(), &firsts),
            at(self.coordinates.as_ref(), &firsts),
            triangles,
        )?;
        match &self.colors {
            Some(colors) => mesh.with_colors(at(Some(colors), &firsts)),
            None => Ok(mesh),
        }
    }

    /// What tells vertices apart.
    fn key(&self, corners: &[Corner], corner: usize) -> (u32, [u64; 9]) {
        let normal = self.normals.as_ref().map_or(DVec3::ZERO, |all| all[corner]);
        let place = self.coordinates.as_ref();
        let place = place.map_or(DVec2::ZERO, |all| all[corner]);
        let color = self.colors.as_ref().map_or(DVec4::ZERO, |all| all[corner]);
        let ([a, b, c], [d, e], [f, g, h, i]) =
            (normal.to_array(), place.to_array(), color.to_array());
        let bits = [a, b, c, d, e, f, g, h, i].map(f64::to_bits);
        (corners[corner].vertex, bits)
    }
}

/// The entries of a list at these places; none without a list.
fn at<T: Copy>(list: Option<&Vec<T>>, places: &[usize]) -> Vec<T> {
    list.map_or_else(Vec::new, |list| places.iter().map(|&i| list[i]).collect())
}
