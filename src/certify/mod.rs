//! A proof per ray: certified hits and misses, and an honest answer where there is neither.
//!
//! What is proven holds for the surfaces of the scene in exact real arithmetic: the knots as
//! they are stored, the homogeneous control points as they are stored up to the one rounding
//! of their product with the weight, the maps of the nodes multiplied exactly, and the ray
//! as it is given. All numbers in between are intervals with outward rounding. Only the
//! correct rounding of the four operations is assumed of the machine.
//!
//! The distances of a piece from two planes through the ray form a planar net of intervals.
//! A cell whose hull, or preconditioned hull, does not contain zero is empty; where
//! Krawczyk's test succeeds there is exactly one root \[Krawczyk 69\]; otherwise the cell is
//! split. Cells are taken in the order of the least ray parameter that they can have, so
//! that what is behind a certain hit is never looked at. Nothing is shared with the
//! production path, neither hierarchy nor nets: each is a check of the other.

mod cell;
mod certificate;
mod line;
mod picture;
mod search;
mod surface;
mod tree;
mod triangle;

use std::collections::HashMap;

use kernel::{Cover, Interval, Patch, PatchId, Ray, Scene, Shape, TrimRegion};

use line::Map;
use search::Search;
use surface::Piece;
use tree::{Bounds, Tree};

pub use certificate::{Ambiguity, Certificate};
pub use picture::{CertifyStats, certify_film};

/// All shapes of a scene, placed in the world one by one and prepared for proofs.
#[derive(Debug)]
pub struct Certifier<'a> {
    scene: &'a Scene,
    places: Vec<Place>,
    /// What belongs to each patch of the scene; `None` means all of its surface.
    regions: Vec<Option<TrimRegion>>,
    /// The pieces of the patches, each patch once.
    pieces: Vec<Piece>,
    leaves: Vec<Leaf>,
    tree: Tree,
}

/// A shape at its place.
#[derive(Debug)]
struct Place {
    shape: Shape,
    number: u32,
    world_from_object: Map,
}

/// A piece or triangle of a place.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    place: u32,
    part: u32,
}

/// On which side of its trim loops a part of a patch lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// In the face as a whole.
    Inside,
    /// Out of the face as a whole.
    Outside,
    /// On both sides, or too near to a loop to know.
    Undecided,
}

impl<'a> Certifier<'a> {
    /// Prepares `scene`. Shapes shown many times are placed each on its own.
    pub fn build(scene: &'a Scene) -> Self {
        let mut certifier = Self {
            scene,
            places: Vec::new(),
            regions: scene.patches().iter().map(Patch::region).collect(),
            pieces: Vec::new(),
            leaves: Vec::new(),
            tree: Tree::default(),
        };
        let mut known = HashMap::new();
        let mut boxes = Vec::new();
        let (meshes, patches): (Vec<_>, Vec<_>) = scene
            .placements()
            .into_iter()
            .partition(|p| matches!(p.shape, Shape::Mesh(_)));
        for (number, placement) in patches.iter().chain(&meshes).enumerate() {
            let number = index(number);
            let map = placement.path.iter().fold(Map::IDENTITY, |map, &id| {
                map.after(&scene.node(id).parent_from_node)
            });
            let parts = match placement.shape {
                Shape::Patch(id) => known
                    .entry(id)
                    .or_insert_with(|| {
                        let first = certifier.pieces.len();
                        let pieces = surface::pieces(&scene.patch(id).surface);
                        certifier.pieces.extend(pieces);
                        first..certifier.pieces.len()
                    })
                    .clone(),
                Shape::Mesh(id) => 0..scene.mesh(id).triangles().len(),
            };
            let place = Place {
                shape: placement.shape,
                number,
                world_from_object: map,
            };
            for part in parts {
                let part = index(part);
                boxes.push(certifier.bounds(&place, part));
                certifier.leaves.push(Leaf {
                    place: number,
                    part,
                });
            }
            certifier.places.push(place);
        }
        certifier.tree = Tree::build(&boxes);
        certifier
    }

    /// Where a box in the parameters of a patch lies with regard to the loops that trim it.
    fn side(&self, patch: PatchId, u: Interval, v: Interval) -> Side {
        let Some(region) = &self.regions[patch.index()] else {
            return Side::Inside;
        };
        match region.classify(u.low()..u.high(), v.low()..v.high()) {
            Cover::Inside => Side::Inside,
            Cover::Outside => Side::Outside,
            Cover::Mixed => Side::Undecided,
        }
    }

    /// A box around a piece or triangle in the world.
    fn bounds(&self, place: &Place, part: u32) -> Bounds {
        let around = |points: &mut dyn Iterator<Item = [Interval; 3]>| {
            let first = points.next().unwrap_or([Interval::ENTIRE; 3]);
            points.fold(first, |all, p| std::array::from_fn(|k| all[k].hull(p[k])))
        };
        match place.shape {
            Shape::Patch(_) => {
                let net = &self.pieces[part as usize].net;
                around(&mut net.iter().map(|h| {
                    let [x, y, z, w] = place.world_from_object.apply(h);
                    [x / w, y / w, z / w]
                }))
            }
            Shape::Mesh(_) => around(&mut self.corners(place, part).into_iter()),
        }
    }

    fn corners(&self, place: &Place, part: u32) -> [[Interval; 3]; 3] {
        let Shape::Mesh(id) = place.shape else {
            return [[Interval::ENTIRE; 3]; 3];
        };
        let mesh = self.scene.mesh(id);
        mesh.triangles()[part as usize].map(|k| {
            let [x, y, z] = mesh.positions()[k as usize].to_array().map(Interval::point);
            let [x, y, z, _] = place
                .world_from_object
                .apply(&[x, y, z, Interval::point(1.0)]);
            [x, y, z]
        })
    }

    /// What can be proven about the first hit of the ray with `t >= 0`.
    ///
    /// A ray without direction, or with a number that is not finite, meets nothing.
    pub fn certify(&self, ray: &Ray) -> Certificate {
        let finite = ray.origin.is_finite() && ray.direction.is_finite();
        let Some(root) = self.tree.root().filter(|_| finite) else {
            return Certificate::Miss;
        };
        if ray.direction == glam::DVec3::ZERO {
            return Certificate::Miss;
        }
        Search::new(self, ray).run(root)
    }
}

fn index(number: usize) -> u32 {
    u32::try_from(number).expect("a scene has fewer than 2^32 shapes and pieces")
}
