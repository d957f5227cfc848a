//! Meshes of the file: the triangles of what a node shows.

use std::collections::{BTreeMap, HashMap};

use glam::{DVec2, DVec3};
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::validation::Checked::Valid;
use gltf_json::{Index, Mesh};
use kernel::{Aabb, Item, MaterialId, Scene, Shape};
use serde_json::{Value, json};

use super::buffer::{Data, extras, number};
use super::look::Materials;
use crate::tessellate::Tessellation;

/// Coordinates this many times larger than the box around a mesh are measured from its middle.
const FAR: f64 = 16.0;

/// A mesh of the file, and the point its coordinates are measured from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    pub(super) mesh: Index<Mesh>,
    pub(super) origin: DVec3,
}

/// What a primitive's triangles have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Look {
    material: Option<usize>,
    double_sided: bool,
    normals: bool,
    uvs: bool,
}

/// Triangles of one look.
#[derive(Debug, Default)]
struct Batch {
    material: Option<MaterialId>,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    indices: Vec<u32>,
    faces: Vec<Value>,
}

/// How far what has been written is from the surfaces, in metres.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reach {
    /// At most.
    pub(super) proven: f64,
    /// Found at sample points.
    pub(super) sampled: f64,
}

/// The meshes written so far, each once.
#[derive(Debug)]
pub(super) struct Shapes<'a> {
    scene: &'a Scene,
    triangles: &'a Tessellation,
    /// For every patch whether its shell is closed.
    closed: Vec<bool>,
    known: HashMap<Vec<(Shape, Option<MaterialId>)>, Option<Placed>>,
    materials: Materials,
    pub(super) data: Data,
    pub(super) reach: Reach,
}

impl<'a> Shapes<'a> {
    pub(super) fn new(scene: &'a Scene, triangles: &'a Tessellation) -> Self {
        let mut closed = vec![false; scene.patches().len()];
        for shell in triangles.shells.iter().filter(|shell| shell.is_closed()) {
            for patch in &shell.patches {
                closed[patch.index()] = true;
            }
        }
        Self {
            scene,
            triangles,
            closed,
            known: HashMap::new(),
            materials: Materials::default(),
            data: Data::default(),
            reach: Reach::default(),
        }
    }

    /// The mesh of what a node shows; `None` if there is no triangle in it.
    pub(super) fn add(&mut self, items: &[Item], root: &mut gltf_json::Root) -> Option<Placed> {
        let material = |item: &Item| self.scene.item_material(item);
        let key: Vec<_> = items
            .iter()
            .map(|item| (item.shape, material(item)))
            .collect();
        if let Some(known) = self.known.get(&key) {
            return *known;
        }
        let placed = self.build(&key, root);
        self.known.insert(key, placed);
        placed
    }

    fn mesh(&self, shape: Shape) -> Option<&'a kernel::Mesh> {
        match shape {
            Shape::Patch(id) => self.triangles.faces[id.index()].as_ref().map(|f| &f.mesh),
            Shape::Mesh(id) => Some(self.scene.mesh(id)),
        }
    }

    fn build(
        &mut self,
        items: &[(Shape, Option<MaterialId>)],
        root: &mut gltf_json::Root,
    ) -> Option<Placed> {
        let meshes = items.iter().filter_map(|item| self.mesh(item.0));
        let bounds = meshes.fold(Aabb::EMPTY, |all, mesh| all.union(mesh.bounds()));
        let center = if bounds.is_empty() {
            DVec3::ZERO
        } else {
            bounds.center()
        };
        let far = center.abs().max_element() > FAR * bounds.diagonal();
        let origin = if far { center } else { DVec3::ZERO };
        let mut batches: BTreeMap<Look, Batch> = BTreeMap::new();
        for &(shape, material) in items {
            let Some(mesh) = self.mesh(shape) else {
                continue;
            };
            let look = Look {
                material: material.map(MaterialId::index),
                double_sided: !matches!(shape, Shape::Patch(id) if self.closed[id.index()]),
                normals: !mesh.normals().is_empty(),
                uvs: !mesh.uvs().is_empty(),
            };
            let batch = batches.entry(look).or_default();
            batch.material = material;
            let rounding = batch.extend(mesh, shape, origin);
            if let Shape::Patch(id) = shape
                && let Some(face) = &self.triangles.faces[id.index()]
            {
                self.reach.proven = self.reach.proven.max((face.proven + rounding) * face.scale);
                self.reach.sampled = self
                    .reach
                    .sampled
                    .max((face.sampled + rounding) * face.scale);
            }
        }
        let mut primitives = Vec::new();
        for (look, batch) in batches {
            if !batch.indices.is_empty() {
                primitives.push(self.primitive(look, &batch, root));
            }
        }
        if primitives.is_empty() {
            return None;
        }
        let name = items
            .iter()
            .filter_map(|item| self.mesh(item.0))
            .map(|m| &m.name);
        root.meshes.push(Mesh {
            extensions: None,
            extras: None,
            name: name.into_iter().find(|name| !name.is_empty()).cloned(),
            primitives,
            weights: None,
        });
        let mesh = Index::new(number(root.meshes.len() - 1));
        Some(Placed { mesh, origin })
    }

    fn primitive(&mut self, look: Look, batch: &Batch, root: &mut gltf_json::Root) -> Primitive {
        let data = &mut self.data;
        let mut attributes = BTreeMap::new();
        attributes.insert(
            Valid(Semantic::Positions),
            data.add_points(&batch.positions),
        );
        if look.normals {
            attributes.insert(Valid(Semantic::Normals), data.add_vec3(&batch.normals));
        }
        if look.uvs {
            attributes.insert(Valid(Semantic::TexCoords(0)), data.add_vec2(&batch.uvs));
        }
        let indices = data.add_indices(&batch.indices, batch.positions.len());
        let list = &mut root.materials;
        let sides = look.double_sided;
        let material = self.materials.add(self.scene, batch.material, sides, list);
        Primitive {
            attributes,
            extensions: None,
            extras: extras(&json!({ "faces": batch.faces })),
            indices: Some(indices),
            material: Some(material),
            mode: Valid(Mode::Triangles),
            targets: None,
        }
    }
}

impl Batch {
    /// Appends a mesh; the result is how far rounding moves a point at most.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "files hold single precision"
    )]
    fn extend(&mut self, mesh: &kernel::Mesh, shape: Shape, origin: DVec3) -> f64 {
        let first = number(self.positions.len());
        let mut rounding: f64 = 0.0;
        for &p in mesh.positions() {
            let near = p - origin;
            let stored = near.as_vec3();
            rounding = rounding.max(near.distance(stored.as_dvec3()));
            self.positions.push(stored.to_array());
        }
        let unit = |n: &DVec3| n.normalize_or(DVec3::Z).as_vec3().normalize().to_array();
        self.normals.extend(mesh.normals().iter().map(unit));
        // Texture coordinates of files run upwards, ours run downwards as those here.
        let down = matches!(shape, Shape::Patch(_));
        let texture = |uv: &DVec2| [uv.x as f32, (if down { uv.y } else { 1.0 - uv.y }) as f32];
        self.uvs.extend(mesh.uvs().iter().map(texture));
        let from = self.indices.len();
        let distinct = mesh
            .triangles()
            .iter()
            .filter(|[a, b, c]| a != b && b != c && c != a);
        self.indices.extend(distinct.flatten().map(|i| first + i));
        let (kind, index) = match shape {
            Shape::Patch(id) => ("patch", id.index()),
            Shape::Mesh(id) => ("mesh", id.index()),
        };
        self.faces.push(json!({
            kind: index,
            "name": mesh.name,
            "source": mesh.source,
            "firstIndex": from,
            "indexCount": self.indices.len() - from,
        }));
        rounding
    }
}
