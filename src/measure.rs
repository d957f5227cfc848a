//! Sizes of what is shown: box, area, and the volume of closed bodies.
//!
//! Files say little about bodies, so they are found: faces of one group whose borders meet belong
//! together, and they are a body if every border meets another one and rays cross them an even
//! number of times; of what is left, those that are a closed shell of triangles and pass the same
//! test; and of what then is left, those of which the file says that they bound a solid. The same rays tell for each face which side is outside, whatever way its parameters run. What lies in a body is another one, unless the file says that it is a void.

use std::collections::{BTreeMap, HashSet};
use std::sync::OnceLock;

use glam::{DMat3, DVec3};
use kernel::{Aabb, Child, Integrals, NodeId, Patch, Placement, Scene, Shape};
use rayon::prelude::*;

use crate::{Accelerator, METHODS, Workspace};

mod contact;
mod shells;
mod sides;
mod voids;

use contact::{Connected, connected};
use voids::Place;

/// What gaps between the faces of a body may let out, as a share of its area; and where the file says that they
/// are closed.
const LEAK: [f64; 2] = [1e-4, 1e-2];

/// What has been measured, in the unit of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    /// The least box around all faces and meshes.
    pub bounds: Aabb,
    /// How far the box may be too small.
    pub bounds_error: f64,
    /// The area of all faces, without meshes.
    pub area: f64,
    /// The error of the area.
    pub area_error: f64,
    /// The closed bodies, in the order of their first faces.
    pub bodies: Vec<Body>,
    /// How many faces belong to no closed body.
    pub open_faces: usize,
    /// How many meshes are shown: they are in the box, and not in what else is measured.
    pub meshes: usize,
}

impl Measure {
    /// All bodies as one; `None` if there is none. Where they lie in each other the space counts
    /// for each of them.
    pub fn total(&self) -> Option<Body> {
        let [first, rest @ ..] = self.bodies.as_slice() else {
            return None;
        };
        let mut total = rest
            .iter()
            .fold(first.clone(), |all, body| all.with(body, 1.0));
        total.name = String::new();
        Some(total)
    }
}

/// The tensor of inertia of a unit of mass at a place, about the origin.
fn about(place: DVec3) -> DMat3 {
    let [x, y, z] = place.to_array();
    DMat3::from_cols(
        DVec3::new(y * y + z * z, -x * y, -z * x),
        DVec3::new(-x * y, z * z + x * x, -y * z),
        DVec3::new(-z * x, -y * z, x * x + y * y),
    )
}

/// A closed body.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// The name of the innermost node around its first face that has one, or of that face.
    pub name: String,
    /// How many faces it has, those of its voids among them.
    pub faces: usize,
    /// How many voids are in it, of those that the file says are voids.
    pub voids: usize,
    /// How many faces have a normal that points inwards.
    pub turned: usize,
    /// Its faces.
    pub sides: Vec<Side>,
    /// Its area.
    pub area: f64,
    /// The error of the area.
    pub area_error: f64,
    /// Its volume.
    pub volume: f64,
    /// The error of the volume: of quadrature, and of what gaps between its faces let out.
    pub volume_error: f64,
    /// Its centre of mass.
    pub centroid: DVec3,
    /// Its tensor of inertia about the centre of mass, for density one.
    pub inertia: DMat3,
}

impl Body {
    /// Both as one, or with a weight of -1 what is left of the first around the second.
    fn with(&self, other: &Self, weight: f64) -> Self {
        let volume = self.volume + weight * other.volume;
        let moments = self.centroid * self.volume + other.centroid * (weight * other.volume);
        let centroid = moments / volume;
        let moved = |body: &Self| body.inertia + about(body.centroid - centroid) * body.volume;
        let is_void = weight < 0.0;
        let sides = other.sides.iter().map(|side| Side {
            sign: weight * side.sign,
            ..*side
        });
        Self {
            name: self.name.clone(),
            faces: self.faces + other.faces,
            voids: self.voids + if is_void { 1 } else { other.voids },
            turned: self.turned
                + if is_void {
                    other.faces - other.turned
                } else {
                    other.turned
                },
            sides: self.sides.iter().copied().chain(sides).collect(),
            area: self.area + other.area,
            area_error: self.area_error + other.area_error,
            volume,
            volume_error: self.volume_error + other.volume_error,
            centroid,
            inertia: moved(self) + moved(other) * weight,
        }
    }
}

/// A face of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// Which of the scene's placements it is.
    pub placement: usize,
    /// 1 if its normal points outwards, -1 if inwards.
    pub sign: f64,
}

/// A face where it stands.
struct Face {
    patch: Patch,
    bounds: Aabb,
    /// Its number in the order of placements, as hits have it.
    number: u32,
    /// Which of the scene's placements it is.
    placement: usize,
    /// The innermost group around it.
    group: Option<NodeId>,
    /// Where in a solid of the file it is.
    place: Option<Place>,
    /// The name of a body that it belongs to.
    name: String,
}

impl Face {
    fn new(
        scene: &Scene,
        (index, placement): (usize, &Placement),
        patch: &Patch,
        number: u32,
    ) -> Self {
        let patch = patch.transformed(&placement.world_from_object);
        // A node with one face in it is its place, not a group.
        let is_place = |id: &&NodeId| matches!(scene.node(**id).children[..], [Child::Item(_)]);
        let group = placement
            .path
            .iter()
            .rev()
            .find(|id| !is_place(id))
            .copied();
        let names = placement.path.iter().rev().map(|&id| &scene.node(id).name);
        let mut names = names.skip_while(|name| **name == patch.name);
        let name = names.find(|name| !name.is_empty());
        Self {
            bounds: patch.bounds(),
            number,
            placement: index,
            group,
            place: Place::of(scene, placement),
            name: name.unwrap_or(&patch.name).clone(),
            patch,
        }
    }
}

/// Measures everything that is shown.
pub fn measure(scene: &Scene) -> Measure {
    let placements = scene.placements();
    let patches = placements
        .iter()
        .enumerate()
        .filter_map(|placement| match placement.1.shape {
            Shape::Patch(id) => Some((placement, scene.patch(id))),
            Shape::Mesh(_) => None,
        });
    let patches: Vec<_> = patches.zip(0_u32..).collect();
    let face = |((placement, patch), number): &(((usize, &Placement), &Patch), u32)| {
        Face::new(scene, *placement, patch, *number)
    };
    let faces: Vec<Face> = patches.par_iter().map(face).collect();
    let mut groups: BTreeMap<(Option<usize>, Vec<usize>), Vec<&Face>> = BTreeMap::new();
    for (face, (((_, placement), _), _)) in faces.iter().zip(&patches) {
        // The same group at another place is another one.
        let group = face.group.map(NodeId::index);
        let path = placement.path.iter().map(|id| id.index());
        let path = path.take_while(|id| group != Some(*id)).collect();
        groups.entry((group, path)).or_default().push(face);
    }
    let groups: Vec<_> = groups.into_values().collect();
    let measured = parts(scene, &placements, &groups);

    let mut bounds = faces
        .iter()
        .fold(Aabb::EMPTY, |all, face| all.union(face.bounds));
    for placement in &placements {
        if let Shape::Mesh(id) = placement.shape {
            let points = scene.mesh(id).positions().iter();
            let world = points.map(|&p| placement.world_from_object.transform_point3(p));
            bounds = bounds.union(Aabb::around(world));
        }
    }
    let sizes = faces
        .iter()
        .map(|face| face.patch.surface.hull_bounds().diagonal());
    let mut result = Measure {
        bounds,
        bounds_error: sizes.fold(0.0, f64::max) * Patch::BOUNDS_ACCURACY,
        area: 0.0,
        area_error: 0.0,
        bodies: Vec::new(),
        open_faces: 0,
        meshes: placements.len() - faces.len(),
    };
    for part in &measured {
        result.area += part.sum.area();
        result.area_error += part.sum.area_error();
        result.open_faces += part.body.as_ref().map_or(part.faces, |_| 0);
    }
    result.bodies = voids::subtracted(&measured);
    result
}

/// The faces in parts that hang together, in the order of their first ones.
fn parts<'a>(scene: &Scene, placements: &[Placement], groups: &[Vec<&'a Face>]) -> Vec<Part<'a>> {
    let parts = groups.iter().flat_map(|group| connected(group));
    let (mut parts, open): (Vec<_>, Vec<_>) = parts.partition(|part| part.is_closed);
    if groups.len() == 1 && parts.is_empty() {
        // All of it has just been looked at.
        parts = open;
    } else {
        // What is open on its own may be closed by faces of other groups.
        let open: Vec<&Face> = open.into_iter().flat_map(|part| part.faces).collect();
        parts.extend(connected(&open));
    }
    let accelerator = OnceLock::new();
    let measure = |parts: &[Connected<'a>]| -> Vec<Part<'a>> {
        let is_needed = parts.iter().any(|part| part.is_closed);
        let build = || Accelerator::build(scene, &METHODS[0]);
        let accelerator = is_needed.then(|| accelerator.get_or_init(build));
        let each = parts.par_iter().map_init(Workspace::default, |own, part| {
            Part::measure(accelerator, part, own)
        });
        each.collect()
    };
    let mut measured = measure(&parts);
    let loose = parts.iter().zip(&measured);
    let loose = loose.filter(|(_, part)| part.body.is_none());
    let mut loose: Vec<&Face> = loose.flat_map(|(part, _)| part.faces.clone()).collect();
    // The bodies among shells of loose faces, which then are none.
    let bodies = |shells: &[Connected<'a>], loose: &mut Vec<&Face>| {
        let found = measure(shells).into_iter().zip(shells);
        let (bodies, used): (Vec<_>, Vec<_>) =
            found.filter(|(part, _)| part.body.is_some()).unzip();
        let used = used.iter().flat_map(|shell| &shell.faces);
        let used: HashSet<u32> = used.map(|face| face.number).collect();
        loose.retain(|face| !used.contains(&face.number));
        bodies
    };
    let before = loose.len();
    let mut found = Vec::new();
    if !loose.is_empty() {
        found.extend(bodies(
            &shells::closed(scene, placements, &loose),
            &mut loose,
        ));
        found.extend(bodies(&voids::declared(groups, &loose), &mut loose));
    }
    if loose.len() < before {
        measured.retain(|part| part.body.is_some());
        measured.extend(found);
        measured.extend(measure(&connected(&loose)));
    }
    measured.sort_by_key(|part| part.first);
    measured
}

/// Faces that hang together.
struct Part<'a> {
    /// Number of the first one.
    first: u32,
    faces: usize,
    /// Where in a solid of the file all of them are.
    place: Option<&'a Place>,
    bounds: Aabb,
    sum: Integrals,
    body: Option<Body>,
}

impl<'a> Part<'a> {
    fn measure(
        accelerator: Option<&Accelerator<'_>>,
        part: &Connected<'a>,
        workspace: &mut Workspace,
    ) -> Self {
        let faces = &part.faces;
        let bounds = faces
            .iter()
            .fold(Aabb::EMPTY, |all, face| all.union(face.bounds));
        // What has nothing inside its loops has a middle, too.
        let hulls = faces.iter().map(|face| face.patch.hull_bounds());
        let origin = if bounds.is_empty() {
            hulls.fold(Aabb::EMPTY, Aabb::union).center()
        } else {
            bounds.center()
        };
        let each: Vec<_> = faces
            .par_iter()
            .map(|face| Integrals::of(&face.patch, origin))
            .collect();
        let accelerator = accelerator.filter(|_| part.is_closed);
        let sides = accelerator.and_then(|a| sides::outsides(a, faces, &bounds, workspace));
        let signs = sides.clone().unwrap_or_else(|| vec![1.0; faces.len()]);
        let pairs = each.iter().zip(&signs);
        let sum = pairs.fold(Integrals::default(), |sum, (face, sign)| {
            sum.plus(face, *sign)
        });
        let leak = sum.normal().length();
        let most_leak = LEAK[usize::from(part.is_declared)] * sum.area();
        let is_body = sides.is_some() && leak <= most_leak && sum.volume() > 0.0;
        let uneven = (sum.volumes() - sum.volume()).abs().max_element();
        let turned = signs.iter().filter(|sign| **sign < 0.0).count();
        let body = is_body.then(|| Body {
            name: faces[0].name.clone(),
            faces: faces.len(),
            voids: 0,
            turned,
            sides: faces
                .iter()
                .zip(&signs)
                .map(|(face, &sign)| Side {
                    placement: face.placement,
                    sign,
                })
                .collect(),
            area: sum.area(),
            area_error: sum.area_error(),
            volume: sum.volume(),
            volume_error: sum.volume_error() + leak * bounds.diagonal() * 0.5 + uneven,
            centroid: origin + sum.moment() / sum.volume(),
            inertia: inertia(&sum),
        });
        let place = faces[0].place.as_ref();
        Self {
            first: faces[0].number,
            faces: faces.len(),
            place: place.filter(|place| {
                faces
                    .iter()
                    .all(|face| place.is_beside(face.place.as_ref()))
            }),
            bounds,
            sum,
            body,
        }
    }
}

/// The tensor of inertia about the centre of mass.
fn inertia(sum: &Integrals) -> DMat3 {
    let center = sum.moment() / sum.volume();
    let squares = sum.squares() - center * center * sum.volume();
    let [x, y, z] = center.to_array();
    let products = sum.products() - DVec3::new(x * y, y * z, z * x) * sum.volume();
    let [xx, yy, zz] = squares.to_array();
    let [xy, yz, zx] = products.to_array();
    DMat3::from_cols(
        DVec3::new(yy + zz, -xy, -zx),
        DVec3::new(-xy, zz + xx, -yz),
        DVec3::new(-zx, -yz, xx + yy),
    )
}
