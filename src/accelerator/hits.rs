//! From a candidate to a hit in the world, and from hits found twice to one.

use glam::{DVec2, DVec3, DVec4};
use kernel::{KnotVector, Material, Mesh, Ray, Shape};

use super::cells::Piece;
use super::trace::{Candidate, CandidateKind};
use super::{Accelerator, Cluster, ClusterItem, Instance, ItemShape, Triangle};
use crate::intersect::Hit;
use crate::intersect::net::evaluate_at;

/// Error of a point per size of its piece and of its coordinates: the roundings of one
/// evaluation.
const POINT_ERROR: f64 = 1e-14;

/// Parameters of one root found twice differ by less than this part of the piece.
const SAME_PARAMETER: f64 = 1e-9;

/// Points of one tangential root found twice differ by less than this part of the piece.
const SAME_POINT: f64 = 1e-7;

/// Points on a seam, found from both of its sides, differ by less than this part of the piece.
const SEAM: f64 = 1e-10;

/// A ray whose direction has so large a part along the normal does not only touch a surface.
const CROSSING: f64 = 1e-3;

impl Hit {
    /// Without the mark of a touch where the ray plainly crosses, as it may at a pole.
    pub(super) fn settled(mut self, ray: &Ray) -> Self {
        if self.tangential {
            let across = self.normal.dot(ray.direction).abs();
            self.tangential = across <= CROSSING * ray.direction.length();
        }
        self
    }
}

impl Accelerator<'_> {
    /// Merges what was found twice on common borders of cells and pieces, and on seams; `hits` are sorted.
    pub(super) fn merge(&self, ray: &Ray, hits: &mut Vec<Hit>) {
        let mut kept = 0;
        for k in 0..hits.len() {
            let hit = hits[k];
            let known = hits[..kept]
                .iter()
                .rev()
                .take(64)
                .position(|other| other.shape == hit.shape && self.coincide(ray, other, &hit));
            match known {
                Some(back) => {
                    let other = &mut hits[kept - 1 - back];
                    // The proven root stands for both.
                    if other.tangential && !hit.tangential {
                        *other = hit;
                    }
                }
                None => {
                    hits[kept] = hit;
                    kept += 1;
                }
            }
        }
        hits.truncate(kept);
    }

    fn coincide(&self, ray: &Ray, a: &Hit, b: &Hit) -> bool {
        let apart = a.point.distance(b.point);
        let size = a.error.max(b.error) / POINT_ERROR;
        if a.tangential || b.tangential {
            return apart <= SAME_POINT * size;
        }
        let ItemShape::Patch(patch) = self.item(a).shape else {
            let is_one = (a.uv - b.uv).abs().max_element() <= SAME_PARAMETER;
            return is_one && apart <= SAME_POINT * size;
        };
        let domains = [patch.surface.knots_u(), patch.surface.knots_v()].map(KnotVector::domain);
        // Shares of the domain.
        let [a_share, b_share] = [a.uv, b.uv].map(|uv| {
            [0, 1].map(|k| (uv[k] - domains[k].start) / (domains[k].end - domains[k].start))
        });
        let differs = [0, 1].map(|k| (a_share[k] - b_share[k]).abs() > SAME_PARAMETER);
        if differs == [false; 2] {
            return apart <= SAME_POINT * size;
        }
        let is_end = |share: f64| share.min(1.0 - share) <= SAME_PARAMETER;
        let both_end = |k: usize| is_end(a_share[k]) && is_end(b_share[k]);
        // On both sides of a seam, or at one pole; a ray may cross or touch a fold there.
        let is_seam = (0..2).all(|k| !differs[k] || both_end(k) || both_end(1 - k));
        let [over, under] = [a, b].map(|hit| hit.normal.dot(ray.direction));
        is_seam && apart <= SEAM * size && over * under > 0.0
    }

    /// The material of what was hit, if it has one.
    pub(crate) fn material(&self, hit: &Hit) -> Option<&Material> {
        self.item(hit).material.map(|id| self.scene.material(id))
    }

    /// Texture coordinates of what was hit; `None` for meshes without.
    pub(crate) fn texture_coordinates(&self, hit: &Hit) -> Option<DVec2> {
        match self.item(hit).origin {
            Shape::Patch(id) => Some(self.scene.patch(id).texture_coordinates(hit.uv)),
            Shape::Mesh(id) => (!self.scene.mesh(id).uvs().is_empty()).then_some(hit.uv),
        }
    }

    /// The vertex colours of a mesh, mixed where it was hit; `None` where there are none.
    pub(crate) fn vertex_color(&self, hit: &Hit) -> Option<DVec4> {
        let Shape::Mesh(id) = self.item(hit).origin else {
            return None;
        };
        let mesh = self.scene.mesh(id);
        let colors = mesh.colors();
        let corners = mesh.triangles()[hit.triangle as usize];
        let [a, b, c] = corners.map(|k| colors.get(k as usize).copied());
        let item = self.item(hit);
        let instance = &self.instances[hit.place.0 as usize];
        let cluster = &self.clusters[instance.cluster as usize];
        let world = instance.world_from_cluster * *cluster.map_of(item);
        let corners = corners.map(|k| world.transform_point3(mesh.positions()[k as usize]));
        let [a_area, b_area, c_area] = areas(&corners, hit.point);
        Some((a? * a_area + b? * b_area + c? * c_area) / (a_area + b_area + c_area))
    }

    /// Instance and item of every patch, by its number.
    pub(crate) fn places(&self) -> Vec<(u32, u32)> {
        let mut places = vec![(0, 0); self.counts.patches as usize];
        for (k, instance) in (0..).zip(&self.instances) {
            let cluster = &self.clusters[instance.cluster as usize];
            for &number in &*cluster.own() {
                let item = cluster.item(number);
                if let ItemShape::Patch(_) = item.shape {
                    let patch = instance.before.patches + item.offset;
                    places[patch as usize] = (k, number);
                }
            }
        }
        places
    }

    pub(super) fn item(&self, hit: &Hit) -> &ClusterItem<'_> {
        let (instance, item) = hit.place;
        let cluster = self.instances[instance as usize].cluster;
        self.clusters[cluster as usize].item(item)
    }

    /// Completes a candidate: point, normal, parameters and number in the world.
    pub(super) fn work_out(&self, ray: &Ray, candidate: &Candidate) -> Hit {
        let instance = &self.instances[candidate.instance as usize];
        let cluster = &self.clusters[instance.cluster as usize];
        match candidate.kind {
            CandidateKind::Surface {
                piece,
                u,
                v,
                tangential,
            } => {
                let shown = self.shown(candidate.instance, piece);
                let place = self.place(instance, shown.piece, DVec2::new(u, v));
                shown.hit(candidate.t, (DVec2::new(u, v), tangential), place)
            }
            CandidateKind::Triangle { index, barycentric } => {
                let triangle = &cluster.triangles[index as usize];
                let hit = self.triangle_hit(instance, cluster, triangle, barycentric);
                let place = (candidate.instance, triangle.item);
                Hit {
                    t: candidate.t,
                    point: ray.at(candidate.t),
                    place,
                    ..hit
                }
            }
        }
    }

    /// Point and normal in the world of a place on a piece; a normal of zero where there is none.
    fn place(&self, instance: &Instance, piece: &Piece, local: DVec2) -> [DVec3; 2] {
        let cluster = &self.clusters[instance.cluster as usize];
        let [point, du, dv] = evaluate_piece(cluster, piece, local);
        let world = &instance.world_from_cluster;
        let (du, dv) = (world.transform_vector3(du), world.transform_vector3(dv));
        let size =
            |degree: usize, extent: f64| degree as f64 * piece.radius * instance.stretch / extent;
        let sizes = [
            size(piece.degrees.p, piece.u.1),
            size(piece.degrees.q, piece.v.1),
        ];
        let normal = kernel::regular_normal([du, dv], sizes).or_else(|| {
            let item = cluster.item(piece.item);
            let ItemShape::Patch(patch) = item.shape else {
                return None;
            };
            let map = *world * *cluster.map_of(item);
            let normal = patch.surface.normal(piece.parameters(local))?;
            kernel::moved_normal(normal, &map)
        });
        [world.transform_point3(point), normal.unwrap_or(DVec3::ZERO)]
    }

    /// What all hits of a piece of an instance have in common.
    #[inline(always)]
    pub(super) fn shown(&self, number: u32, piece: u32) -> Shown<'_> {
        let instance = &self.instances[number as usize];
        let cluster = &self.clusters[instance.cluster as usize];
        let part = cluster.piece(piece);
        Shown {
            number: (number, piece),
            piece: part,
            size: part.radius * instance.stretch,
            shape: instance.before.patches + cluster.item(part.item).offset,
        }
    }

    fn triangle_hit(
        &self,
        instance: &Instance,
        cluster: &Cluster<'_>,
        triangle: &Triangle,
        barycentric: DVec2,
    ) -> Hit {
        let item = cluster.item(triangle.item);
        let world = &instance.world_from_cluster;
        let corners = triangle.corners.map(|c| world.transform_point3(c));
        let flat = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let mut normal = flat;
        let mut uv = barycentric;
        if let ItemShape::Mesh(mesh) = item.shape {
            uv = triangle_uv(mesh, triangle.index, barycentric);
            if let normals @ [_, ..] = mesh.normals() {
                let [a, b, c] =
                    mesh.triangles()[triangle.index as usize].map(|k| normals[k as usize]);
                let smooth = a * (1.0 - barycentric.x - barycentric.y)
                    + b * barycentric.x
                    + c * barycentric.y;
                let object = *world * *cluster.map_of(item);
                let turned = object.matrix3.inverse().transpose() * smooth;
                normal = if turned.dot(flat) < 0.0 {
                    -turned
                } else {
                    turned
                };
            }
        }
        let size = corners
            .iter()
            .fold(0.0, |max: f64, c| max.max(c.abs().max_element()));
        Hit {
            t: 0.0,
            uv,
            point: DVec3::ZERO,
            normal: normal.normalize_or_zero(),
            shape: self.counts.patches + instance.before.meshes + item.offset,
            tangential: false,
            filled: false,
            error: POINT_ERROR * size,
            place: (0, 0),
            triangle: triangle.index,
        }
    }
}

/// A piece of an instance.
pub(super) struct Shown<'a> {
    /// Those of instance and piece.
    number: (u32, u32),
    piece: &'a Piece,
    /// Radius in the world.
    size: f64,
    shape: u32,
}

impl Shown<'_> {
    #[inline(always)]
    pub(super) fn is(&self, instance: u32, piece: u32) -> bool {
        self.number == (instance, piece)
    }

    /// A hit at parameters of the piece, with point and normal in the world.
    #[inline(always)]
    pub(super) fn hit(
        &self,
        t: f64,
        (uv, tangential): (DVec2, bool),
        [point, normal]: [DVec3; 2],
    ) -> Hit {
        Hit {
            t,
            uv: self.piece.parameters(uv),
            point,
            normal,
            shape: self.shape,
            tangential,
            filled: false,
            error: POINT_ERROR * (self.size + point.abs().max_element()),
            place: (self.number.0, self.piece.item),
            triangle: 0,
        }
    }
}

/// Point and first derivatives by the patch's parameters, in the cluster.
fn evaluate_piece(cluster: &Cluster<'_>, piece: &Piece, local: DVec2) -> [DVec3; 3] {
    let [h, hu, hv] = evaluate_at(&cluster.net(piece), local.x, local.y);
    let own = h.truncate() / h.w;
    let along = |d: DVec4| (d.truncate() - own * d.w) / h.w * piece.radius;
    [
        piece.center + own * piece.radius,
        along(hu) / piece.u.1,
        along(hv) / piece.v.1,
    ]
}

/// Of a point in a triangle the areas across from each corner, times a common factor.
fn areas(corners: &[DVec3; 3], point: DVec3) -> [f64; 3] {
    let [a, b, c] = *corners;
    let across = (b - a).cross(c - a);
    let area = |from: DVec3, to: DVec3| (from - point).cross(to - point).dot(across).max(0.0);
    let areas = [area(b, c), area(c, a), area(a, b)];
    if areas.iter().sum::<f64>() > 0.0 {
        areas
    } else {
        [1.0; 3]
    }
}

/// Parameters of a point in a triangle from those of its corners; barycentric without.
fn triangle_uv(mesh: &Mesh, index: u32, barycentric: DVec2) -> DVec2 {
    let corners = mesh.triangles()[index as usize];
    match mesh.uvs() {
        [] => barycentric,
        uvs => {
            let [a, b, c] = corners.map(|k| uvs[k as usize]);
            a + (b - a) * barycentric.x + (c - a) * barycentric.y
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{all_hits, ball, scene_of};
    use super::*;
    use crate::intersect::METHODS;

    #[test]
    fn rays_through_poles_and_seams_cross_a_sphere_twice() {
        let center = DVec3::new(0.3, -0.2, 0.7);
        let scene = scene_of(vec![ball(1.0, center)]);
        // Along the axis, through the seam, and through a meridian of it.
        let ways = [DVec3::Z, DVec3::X, DVec3::new(0.6, 0.0, 0.8)];
        let accelerator = Accelerator::build(&scene, &METHODS[0]);
        for direction in ways.into_iter().flat_map(|way| [way, -way]) {
            let ray = Ray {
                origin: center - direction * 3.0,
                direction,
            };
            let hits = all_hits(&accelerator, &ray);
            let times: Vec<f64> = hits.iter().map(|hit| hit.t).collect();
            let [first, second] = times[..] else {
                panic!("{direction}: {times:?}");
            };
            assert!((first - 2.0).abs().max((second - 4.0).abs()) < 1e-12);
            assert!(hits.iter().all(|hit| !hit.tangential), "{direction}");
        }
        // Beside it, it is a touch.
        let origin = center + DVec3::new(1.0, -3.0, 0.0);
        let direction = DVec3::Y;
        let touch = all_hits(&accelerator, &Ray { origin, direction });
        assert_eq!(touch.iter().filter(|hit| hit.tangential).count(), 1);
    }
}
