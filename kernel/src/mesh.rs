//! Triangle meshes: the polygonal part of a file.

use glam::{DVec2, DVec3, DVec4};

use crate::{Aabb, Error, MaterialId, check_points};

/// Triangles over shared vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// The name in the file, or empty.
    pub name: String,
    /// Where it stands in the file, in the format's own words.
    pub source: String,
    /// The material, unless the scene node that shows the mesh names another.
    pub material: Option<MaterialId>,
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    uvs: Vec<DVec2>,
    colors: Vec<DVec4>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Makes a mesh; `normals` and `uvs` are empty or have one entry per position.
    ///
    /// # Errors
    /// If a list has the wrong length, a number is not finite or an index too large.
    pub fn new(
        positions: Vec<DVec3>,
        normals: Vec<DVec3>,
        uvs: Vec<DVec2>,
        triangles: Vec<[u32; 3]>,
    ) -> Result<Self, Error> {
        let count = positions.len();
        for found in [normals.len(), uvs.len()] {
            if found != 0 && found != count {
                return Err(Error::PointCount {
                    found,
                    expected: count,
                });
            }
        }
        check_points(positions.iter().copied())?;
        let infinite = [
            normals.iter().position(|n| !n.is_finite()),
            uvs.iter().position(|uv| !uv.is_finite()),
        ];
        if let Some(index) = infinite.into_iter().flatten().next() {
            return Err(Error::NotFinite { index });
        }
        if let Some(&index) = triangles.iter().flatten().find(|&&i| i as usize >= count) {
            return Err(Error::Reference {
                index: index as usize,
                count,
            });
        }
        let (name, source) = (String::new(), String::new());
        Ok(Self {
            name,
            source,
            material: None,
            positions,
            normals,
            uvs,
            colors: Vec::new(),
            triangles,
        })
    }

    /// The same mesh with a colour for each vertex, linear with alpha, by which that of the
    /// material is multiplied: its reflection, or its emission where it reflects nothing.
    ///
    /// # Errors
    /// If there is not one for each position, or one is not finite.
    pub fn with_colors(self, colors: Vec<DVec4>) -> Result<Self, Error> {
        let (found, expected) = (colors.len(), self.positions.len());
        if found != expected {
            return Err(Error::PointCount { found, expected });
        }
        match colors.iter().position(|c| !c.is_finite()) {
            Some(index) => Err(Error::NotFinite { index }),
            None => Ok(Self { colors, ..self }),
        }
    }

    /// Vertex positions.
    pub fn positions(&self) -> &[DVec3] {
        &self.positions
    }

    /// Vertex normals, or nothing.
    pub fn normals(&self) -> &[DVec3] {
        &self.normals
    }

    /// Vertex texture coordinates, or nothing.
    pub fn uvs(&self) -> &[DVec2] {
        &self.uvs
    }

    /// Vertex colours, or nothing.
    pub fn colors(&self) -> &[DVec4] {
        &self.colors
    }

    /// Vertex indices of the triangles, counter-clockwise seen from the front.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The least box around the vertices.
    pub fn bounds(&self) -> Aabb {
        Aabb::around(self.positions.iter().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_list_is_checked() {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let mesh = |normals: &[DVec3], uvs: &[DVec2], triangle: [u32; 3]| {
            let (normals, uvs) = (normals.to_vec(), uvs.to_vec());
            Mesh::new(corners.clone(), normals, uvs, vec![triangle]).map(|mesh| mesh.bounds())
        };
        let bounds = mesh(&[DVec3::Z; 3], &[DVec2::ZERO; 3], [0, 1, 2]).unwrap();
        assert_eq!(
            (bounds.min, bounds.max),
            (DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0))
        );
        let short = Error::PointCount {
            found: 1,
            expected: 3,
        };
        assert_eq!(mesh(&[DVec3::Z], &[], [0, 1, 2]), Err(short));
        let plain = Mesh::new(corners.clone(), Vec::new(), Vec::new(), Vec::new()).unwrap();
        assert_eq!(plain.clone().with_colors(vec![DVec4::ONE]), Err(short));
        assert_eq!(
            plain
                .with_colors(vec![DVec4::ONE; 3])
                .unwrap()
                .colors()
                .len(),
            3
        );
        let missing = Error::Reference { index: 3, count: 3 };
        assert_eq!(mesh(&[], &[], [0, 1, 3]), Err(missing));
        let infinite = Err(Error::NotFinite { index: 0 });
        assert_eq!(mesh(&[DVec3::NAN; 3], &[], [0, 1, 2]), infinite);
        assert_eq!(mesh(&[], &[DVec2::INFINITY; 3], [0, 1, 2]), infinite);
    }
}
