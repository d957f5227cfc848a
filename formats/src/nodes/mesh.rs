//! Polygons of X3D to triangles.

use glam::DVec3;
use kernel::{Error as GeometryError, Mesh};

use super::scene::Converter;
use super::{Link, Node};
use crate::Error;

impl Converter<'_> {
    /// An `IndexedFaceSet`, `IndexedTriangleSet` or `TriangleSet`.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn mesh(&mut self, node: &Node) -> Result<Result<Mesh, GeometryError>, Error> {
        let points = self.points_inside(node)?;
        let mut triangles = match &*node.kind {
            "IndexedFaceSet" => self.faces(node, points.len())?,
            "IndexedTriangleSet" => {
                let indices = self.indices(node, "index")?;
                self.triples(node, indices.into_iter(), points.len())
            }
            _ => self.triples(node, (0..).take(points.len()), points.len()),
        };
        if !node.flag("ccw", true, &mut self.warnings) {
            for triangle in &mut triangles {
                triangle.swap(1, 2);
            }
        }
        let normals = self.normals(node, points.len())?;
        Ok(Mesh::new(points, normals, Vec::new(), triangles))
    }

    /// The whole numbers of a field; empty if one of them is malformed.
    fn indices(&mut self, node: &Node, field: &str) -> Result<Vec<i64>, Error> {
        let words = super::text::words(node.text(field).unwrap_or_default());
        let indices: Result<Vec<i64>, _> = words.map(str::parse).collect();
        let indices = indices.unwrap_or_else(|_| {
            let text = "something is no whole number; the field is not used";
            self.warnings.invalid(node.field_place(field), text);
            Vec::new()
        });
        self.count_points(indices.len(), node)?;
        Ok(indices)
    }

    /// The faces of an `IndexedFaceSet`, cut into fans.
    fn faces(&mut self, node: &Node, points: usize) -> Result<Vec<[u32; 3]>, Error> {
        let indices = self.indices(node, "coordIndex")?;
        let mut triangles = Vec::new();
        let (mut is_concave, mut is_outside) = (false, false);
        for face in indices.split(|&index| index == -1) {
            let corner = |&index: &i64| vertex(index, points);
            let Some(corners) = face.iter().map(corner).collect::<Option<Vec<_>>>() else {
                is_outside = true;
                continue;
            };
            is_concave |= corners.len() > 3;
            if let [first, rest @ ..] = &corners[..] {
                triangles.extend(rest.windows(2).map(|w| [*first, w[0], w[1]]));
            }
        }
        if is_outside {
            let text = format!("faces with points that are not among the {points} there are");
            self.warnings.invalid(node.place(), text);
        }
        if is_concave && !node.flag("convex", true, &mut self.warnings) {
            let text = "concave faces are cut into triangles as if they were convex";
            self.warnings.unsupported(node.place(), text);
        }
        Ok(triangles)
    }

    /// Three indices in a row are a triangle.
    fn triples(
        &mut self,
        node: &Node,
        indices: impl Iterator<Item = i64>,
        points: usize,
    ) -> Vec<[u32; 3]> {
        let (mut triangles, mut corners, mut is_outside) = (Vec::new(), Vec::new(), false);
        for index in indices {
            corners.push(vertex(index, points));
            if let [a, b, c] = corners[..] {
                match (a, b, c) {
                    (Some(a), Some(b), Some(c)) => triangles.push([a, b, c]),
                    _ => is_outside = true,
                }
                corners.clear();
            }
        }
        if is_outside || !corners.is_empty() {
            let text = "triangles with points that are not there";
            self.warnings.invalid(node.place(), text);
        }
        triangles
    }

    /// The normals inside, if there is one for each of the points.
    fn normals(&mut self, node: &Node, points: usize) -> Result<Vec<DVec3>, Error> {
        let inside = |link: &Link| &self.tree.nodes[link.node];
        let Some(normal) = node
            .children
            .iter()
            .map(inside)
            .find(|n| &*n.kind == "Normal")
        else {
            return Ok(Vec::new());
        };
        let normals = normal.points_3d("vector", &mut self.warnings);
        self.count_points(normals.len(), normal)?;
        let by_vertex = node.flag("normalPerVertex", true, &mut self.warnings);
        let indices = node.text("normalIndex").unwrap_or_default().trim();
        let shares_indices = indices.is_empty() || node.text("coordIndex") == Some(indices);
        if normals.len() != points || !by_vertex || !shares_indices {
            let text = "normals that are not one for each point are not read";
            self.warnings.unsupported(normal.place(), text);
            return Ok(Vec::new());
        }
        Ok(normals)
    }
}

/// The vertex with this index, if there is one.
fn vertex(index: i64, points: usize) -> Option<u32> {
    let index = u32::try_from(index).ok()?;
    usize::try_from(index)
        .is_ok_and(|i| i < points)
        .then_some(index)
}
