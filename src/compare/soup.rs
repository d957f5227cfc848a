//! The triangles of a mesh where they stand.

use std::collections::HashMap;

use glam::{DAffine3, DVec3};
use kernel::{Aabb, Mesh, Scene, Sets, Shape};
use rayon::prelude::*;

use super::triangles::TriangleTree;

/// Triangles in the coordinates of the exact scene.
#[derive(Debug)]
pub(crate) struct Soup {
    /// Every place where there is a corner, once.
    pub(crate) points: Vec<DVec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Their numbers in the mesh, in the order of the file.
    pub(crate) numbers: Vec<u32>,
    /// Unit normals at the corners of each triangle, where the file has them.
    pub(crate) normals: Vec<Option<[DVec3; 3]>>,
    pub(crate) tree: TriangleTree,
}

impl Soup {
    /// All triangles that a scene shows, moved by `target_from_world`.
    pub(crate) fn new(scene: &Scene, target_from_world: &DAffine3) -> Self {
        let mut points = Vec::new();
        let mut known: HashMap<[u64; 3], u32> = HashMap::new();
        let (mut triangles, mut normals) = (Vec::new(), Vec::new());
        for at in scene.placements() {
            let Shape::Mesh(id) = at.shape else {
                continue;
            };
            let mesh = scene.mesh(id);
            let map = *target_from_world * at.world_from_object;
            let mut number = |p: &DVec3| {
                // Zero has two spellings.
                let p = map.transform_point3(*p) + 0.0;
                *known
                    .entry(p.to_array().map(f64::to_bits))
                    .or_insert_with(|| {
                        points.push(p);
                        u32::try_from(points.len() - 1).expect("memory ends before 2^32 points")
                    })
            };
            let numbers: Vec<u32> = mesh.positions().iter().map(&mut number).collect();
            let turned = map.matrix3.inverse().transpose();
            let mirrored = map.matrix3.determinant() < 0.0;
            let smooth = !mesh.normals().is_empty();
            for &triangle in mesh.triangles() {
                let mut corners = triangle.map(|k| k as usize);
                if mirrored {
                    corners.swap(1, 2);
                }
                triangles.push(corners.map(|k| numbers[k]));
                let normal = |k: usize| (turned * mesh.normals()[k]).normalize_or_zero();
                normals.push(smooth.then(|| corners.map(normal)));
            }
        }
        let corners = triangles
            .iter()
            .map(|t: &[u32; 3]| t.map(|k| points[k as usize]));
        let tree = TriangleTree::new(corners.collect());
        let count = u32::try_from(triangles.len()).expect("triangles are numbered by 32 bits");
        Self {
            points,
            triangles,
            numbers: (0..count).collect(),
            normals,
            tree,
        }
    }

    /// What is left without these triangles; `None` if that is all.
    pub(crate) fn without(&self, is_out: impl Fn([DVec3; 3]) -> bool + Sync) -> Option<Self> {
        let corners = self.tree.corners();
        let out: Vec<bool> = corners.par_iter().map(|corners| is_out(*corners)).collect();
        if !out.contains(&true) {
            return None;
        }
        let kept: Vec<usize> = (0..out.len()).filter(|&k| !out[k]).collect();
        let mut points = Vec::new();
        let mut known: HashMap<u32, u32> = HashMap::new();
        let mut number = |k: u32| {
            *known.entry(k).or_insert_with(|| {
                points.push(self.points[k as usize]);
                u32::try_from(points.len() - 1).expect("fewer points than before")
            })
        };
        let triangles = kept.iter().map(|&k| self.triangles[k].map(&mut number));
        let triangles = triangles.collect();
        Some(Self {
            points,
            triangles,
            numbers: kept.iter().map(|&k| self.numbers[k]).collect(),
            normals: kept.iter().map(|&k| self.normals[k]).collect(),
            tree: TriangleTree::new(kept.iter().map(|&k| corners[k]).collect()),
        })
    }

    /// Where the corners of a triangle are.
    pub(crate) fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.tree.corners()[triangle]
    }

    /// The normal of a triangle, zero where it has no area.
    pub(crate) fn flat_normal(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// The normal that a renderer would use, from those of the corners; the flat one if the
    /// file has none there.
    pub(crate) fn smooth_normal(&self, triangle: usize, shares: [f64; 3]) -> DVec3 {
        match self.normals[triangle] {
            Some([a, b, c]) => (a * shares[0] + b * shares[1] + c * shares[2]).normalize_or_zero(),
            None => self.flat_normal(triangle),
        }
    }

    /// Half the length of the cross product of two sides.
    pub(crate) fn area(&self, triangle: usize) -> f64 {
        let [a, b, c] = self.corners(triangle);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Corners of triangles, as many in every part of the mesh as it has of the area.
    pub(crate) fn corners_by_area(&self, count: usize) -> Vec<DVec3> {
        let mut sum = 0.0;
        let areas = (0..self.triangles.len()).map(|k| {
            sum += self.area(k);
            sum
        });
        let areas: Vec<f64> = areas.collect();
        let corner = |k: usize| {
            let place = (k as f64 + 0.5) / count as f64 * sum;
            let triangle = areas.partition_point(|up_to| *up_to < place);
            self.corners(triangle.min(areas.len() - 1))[k % 3]
        };
        (0..count).map(corner).collect()
    }

    /// The least box around the triangles.
    pub(crate) fn bounds(&self) -> Aabb {
        self.tree.bounds()
    }

    /// For every triangle the number of the part that hangs together with it, and how many
    /// parts there are.
    pub(crate) fn parts(&self) -> (Vec<usize>, usize) {
        let mut points = Sets::new(self.points.len());
        for corners in &self.triangles {
            let [a, b, c] = corners.map(|k| k as usize);
            points.join(a, b);
            points.join(b, c);
        }
        let mut numbers: HashMap<usize, usize> = HashMap::new();
        let mut part = |triangle: &[u32; 3]| {
            let next = numbers.len();
            *numbers
                .entry(points.root(triangle[0] as usize))
                .or_insert(next)
        };
        let parts: Vec<usize> = self.triangles.iter().map(&mut part).collect();
        (parts, numbers.len())
    }

    /// The same triangles as meshes for rendering: without normals, or with those of the
    /// file, and those of the corners that meet within half a right angle where it has none;
    /// one mesh for each of `groups` that a triangle can be in.
    pub(crate) fn meshes(&self, groups: &[usize], smooth: Smooth) -> Vec<(usize, Mesh)> {
        let normals = match smooth {
            Smooth::No => Vec::new(),
            Smooth::Yes => self.blended(),
        };
        let mut by_group: std::collections::BTreeMap<usize, Vec<usize>> = Default::default();
        for (triangle, &group) in groups.iter().enumerate() {
            by_group.entry(group).or_default().push(triangle);
        }
        let mesh = |(group, members): (usize, Vec<usize>)| {
            let positions = members.iter().flat_map(|&k| self.corners(k)).collect();
            let own = if normals.is_empty() {
                &[][..]
            } else {
                &members
            };
            let own = own.iter().flat_map(|&k| normals[k]).collect();
            let corners: Vec<u32> = (0..).take(3 * members.len()).collect();
            let triangles = corners
                .chunks_exact(3)
                .map(|t| [t[0], t[1], t[2]])
                .collect();
            let mesh = Mesh::new(positions, own, Vec::new(), triangles);
            (
                group,
                mesh.expect("every list has an entry for each corner"),
            )
        };
        by_group.into_iter().map(mesh).collect()
    }

    /// Normals at the corners, where the file has none sums of those of the triangles around a
    /// point, by area, that are turned against each other by less than half a right angle.
    fn blended(&self) -> Vec<[DVec3; 3]> {
        if let Some(all) = self.normals.iter().copied().collect() {
            return all;
        }
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); self.points.len()];
        for (triangle, number) in self.triangles.iter().zip(0..) {
            triangle
                .iter()
                .for_each(|&k| around[k as usize].push(number));
        }
        let normal = |k: usize| {
            let [a, b, c] = self.corners(k);
            (b - a).cross(c - a)
        };
        let corner = |own: DVec3, point: u32| {
            let near = around[point as usize].iter().map(|&k| normal(k as usize));
            let near = near.filter(|other| own.angle_between(*other) < CREASE);
            near.sum::<DVec3>().normalize_or(own.normalize_or(DVec3::Z))
        };
        let blend = |k: usize| self.triangles[k].map(|point| corner(normal(k), point));
        let each = self.normals.iter().enumerate();
        each.map(|(k, known)| known.unwrap_or_else(|| blend(k)))
            .collect()
    }
}

/// Whether a mesh is shaded across its edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Smooth {
    Yes,
    No,
}

/// Triangles that meet at a larger angle keep their edge.
const CREASE: f64 = std::f64::consts::FRAC_PI_4;

#[cfg(test)]
mod tests {
    use kernel::{Child, Item, Node};

    use super::*;

    #[test]
    fn triangles_keep_their_normals_beside_others_without() {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let tilted = DVec3::new(0.6, 0.0, 0.8);
        let (mut scene, mut root) = (Scene::default(), Node::default());
        for normals in [Vec::new(), vec![tilted; 3]] {
            let mesh = Mesh::new(corners.clone(), normals, Vec::new(), vec![[0, 1, 2]]).unwrap();
            let (shape, material) = (Shape::Mesh(scene.add_mesh(mesh).unwrap()), None);
            root.children.push(Child::Item(Item { shape, material }));
        }
        let root = scene.add_node(root).unwrap();
        scene.set_root(root).unwrap();
        let soup = Soup::new(&scene, &DAffine3::IDENTITY);
        let found = [0, 1].map(|k| soup.smooth_normal(k, [1.0 / 3.0; 3]));
        assert!(found[0].distance(DVec3::Z) < 1e-12 && found[1].distance(tilted) < 1e-12);
        let shown = soup.meshes(&[0, 0], Smooth::Yes).remove(0).1;
        assert!(shown.normals()[2].distance(DVec3::Z) < 1e-12);
        assert!(shown.normals()[5].distance(tilted) < 1e-12);
    }
}
