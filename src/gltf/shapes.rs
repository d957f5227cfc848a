//! Meshes of the file: the triangles of what a node shows, and its lines and points.

use std::collections::{BTreeMap, HashMap};
use std::io;

use glam::{DAffine2, DVec2, DVec3, DVec4};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked::Valid;
use gltf::json::{Accessor, Index, Mesh};
use kernel::{Aabb, Child, MaterialId, NodeId, Scene, Shape, WireId};
use serde_json::{Value, json};

use super::buffer::{Data, extras, number};
use super::look::{Materials, Sides};
use super::pictures;
use crate::accuracy::SINGLE;
use crate::tessellate::Tessellation;

/// Coordinates this many times larger than the box around a mesh are measured from its middle.
const FAR: f64 = 16.0;

/// A mesh of the file, and the point that its coordinates are measured from, in which steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    pub(super) mesh: Index<Mesh>,
    pub(super) origin: DVec3,
    pub(super) step: f64,
}

/// What a mesh shows: shapes with their materials, and wires.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Content {
    shapes: Vec<(Shape, Option<MaterialId>)>,
    wires: Vec<WireId>,
}

impl Content {
    /// What a node shows itself.
    pub(super) fn of(scene: &Scene, id: NodeId) -> Self {
        let node = scene.node(id);
        let shape = |child: &Child| match child {
            Child::Item(item) => Some((item.shape, scene.item_material(item))),
            Child::Node(_) => None,
        };
        Self {
            shapes: node.children.iter().filter_map(shape).collect(),
            wires: node.wires.clone(),
        }
    }
}

/// Where positions are measured from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    origin: DVec3,
    /// The distance from one position to the next; `None` if they are in single precision.
    step: Option<f64>,
}

impl Grid {
    /// For what is in a box.
    pub(super) fn of(bounds: &Aabb, quantize: bool) -> Self {
        if quantize {
            Self::coarse(bounds)
        } else {
            Self::fine(bounds)
        }
    }

    /// For positions in single precision: from about the middle of what is far away, a point that
    /// single precision holds, too.
    fn fine(bounds: &Aabb) -> Self {
        let far = bounds.center().abs().max_element() > FAR * bounds.diagonal();
        let center = bounds.center().as_vec3().as_dvec3();
        let origin = if far { center } else { DVec3::ZERO };
        Self { origin, step: None }
    }

    /// With steps that reach all of a box. Files hold its numbers in single precision.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounded so that the box is inside"
    )]
    fn coarse(bounds: &Aabb) -> Self {
        let below = |x: f64| f64::from((x as f32).next_down());
        let origin = bounds.min.map(below);
        let longest = (bounds.max - origin).max_element() / f64::from(u16::MAX);
        let step = (longest as f32).next_up().max(f32::MIN_POSITIVE);
        let step = Some(f64::from(step));
        Self { origin, step }
    }

    /// A position as the file has it.
    fn place(&self, p: DVec3) -> [f32; 3] {
        let near = p - self.origin;
        let stored = match self.step {
            None => near,
            Some(step) => (near / step)
                .round()
                .clamp(DVec3::ZERO, DVec3::splat(65535.0)),
        };
        stored.as_vec3().to_array()
    }

    /// How far a position in a box, or in one within it, is from where it was.
    pub(super) fn rounding(&self, bounds: &Aabb) -> f64 {
        match self.step {
            None => {
                let reach = bounds.min.abs().max(bounds.max.abs()).length();
                SINGLE * reach.min(2.0 * FAR * bounds.diagonal())
            }
            Some(step) => 0.5 * 3.0_f64.sqrt() * step,
        }
    }
}

/// Lines or points of one material.
#[derive(Debug, Default)]
struct Thin {
    material: Option<MaterialId>,
    positions: Vec<[f32; 3]>,
    wires: Vec<Value>,
}

/// What a primitive's triangles have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Look {
    material: Option<usize>,
    double_sided: bool,
    normals: bool,
    uvs: bool,
    colors: bool,
    /// Whether colours let something through.
    clear: bool,
}

/// Triangles of one look.
#[derive(Debug, Default)]
struct Batch {
    material: Option<MaterialId>,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    colors: Vec<[f32; 4]>,
    indices: Vec<u32>,
    faces: Vec<Value>,
}

/// The meshes written so far, each once.
#[derive(Debug)]
pub(super) struct Shapes<'a> {
    scene: &'a Scene,
    triangles: &'a Tessellation,
    quantize: bool,
    /// For every patch whether its shell is closed.
    closed: Vec<bool>,
    known: HashMap<Content, Option<Placed>>,
    materials: Materials,
    pub(super) data: Data,
}

impl<'a> Shapes<'a> {
    pub(super) fn new(scene: &'a Scene, triangles: &'a Tessellation, quantize: bool) -> Self {
        let mut closed = vec![false; scene.patches().len()];
        for shell in triangles.shells.iter().filter(|shell| shell.is_closed()) {
            for patch in &shell.patches {
                closed[patch.index()] = true;
            }
        }
        Self {
            scene,
            triangles,
            quantize,
            closed,
            known: HashMap::new(),
            materials: Materials::default(),
            data: Data::default(),
        }
    }

    /// The mesh of what a node shows; `None` if there is no triangle, line or point in it.
    ///
    /// # Errors
    /// If a picture cannot be encoded.
    pub(super) fn add(
        &mut self,
        content: Content,
        root: &mut gltf::json::Root,
    ) -> io::Result<Option<Placed>> {
        if let Some(known) = self.known.get(&content) {
            return Ok(*known);
        }
        let placed = self.build(&content, root)?;
        self.known.insert(content, placed);
        Ok(placed)
    }

    fn mesh(&self, shape: Shape) -> Option<&'a kernel::Mesh> {
        match shape {
            Shape::Patch(id) => self.triangles.faces[id.index()].as_ref().map(|f| &f.mesh),
            Shape::Mesh(id) => Some(self.scene.mesh(id)),
        }
    }

    fn build(
        &mut self,
        Content { shapes, wires }: &Content,
        root: &mut gltf::json::Root,
    ) -> io::Result<Option<Placed>> {
        let meshes: Vec<_> = shapes.iter().filter_map(|item| self.mesh(item.0)).collect();
        let boxes = meshes.iter().map(|mesh| mesh.bounds());
        let wired = wires.iter().map(|id| self.scene.wire(*id).hull_bounds());
        let bounds = boxes.chain(wired).fold(Aabb::EMPTY, Aabb::union);
        if bounds.is_empty() {
            return Ok(None);
        }
        let grid = Grid::of(&bounds, self.quantize);
        let mut batches: BTreeMap<Look, Batch> = BTreeMap::new();
        for &(shape, material) in shapes {
            let Some(mesh) = self.mesh(shape) else {
                continue;
            };
            let look = Look {
                material: material.map(MaterialId::index),
                double_sided: !matches!(shape, Shape::Patch(id) if self.closed[id.index()]),
                normals: !mesh.normals().is_empty(),
                uvs: !mesh.uvs().is_empty(),
                colors: !mesh.colors().is_empty(),
                clear: mesh.colors().iter().any(|color| color.w < 1.0),
            };
            let batch = batches.entry(look).or_default();
            batch.material = material;
            let maps = material.map(|id| &self.scene.material(id).maps);
            let picture_from_shape = maps.map_or(DAffine2::IDENTITY, pictures::placement);
            batch.extend(mesh, shape, &grid, &picture_from_shape);
        }
        let mut primitives = Vec::new();
        for (look, batch) in batches {
            if !batch.indices.is_empty() {
                primitives.push(self.primitive(look, &batch, root)?);
            }
        }
        for ((mode, _), thin) in self.thin(wires, &grid) {
            primitives.push(self.thin_primitive(mode, &thin, root));
        }
        if primitives.is_empty() {
            return Ok(None);
        }
        let wires = wires.iter().map(|id| &self.scene.wire(*id).name);
        let name = meshes.iter().map(|mesh| &mesh.name).chain(wires);
        root.meshes.push(Mesh {
            extensions: None,
            extras: None,
            name: name.into_iter().find(|name| !name.is_empty()).cloned(),
            primitives,
            weights: None,
        });
        let mesh = Index::new(number(root.meshes.len() - 1));
        Ok(Some(Placed {
            mesh,
            origin: grid.origin,
            step: grid.step.unwrap_or(1.0),
        }))
    }

    /// The lines and points of wires, by their materials.
    fn thin(&self, wires: &[WireId], grid: &Grid) -> BTreeMap<(bool, Option<usize>), Thin> {
        let mut parts: BTreeMap<_, Thin> = BTreeMap::new();
        for &id in wires {
            let wire = self.scene.wire(id);
            let Some((points, has_lines)) = self.triangles.thread(self.scene, id) else {
                continue;
            };
            let points: Vec<DVec3> = if has_lines {
                points.windows(2).flatten().copied().collect()
            } else {
                points.to_vec()
            };
            let key = (has_lines, wire.material.map(MaterialId::index));
            let part = parts.entry(key).or_default();
            part.material = wire.material;
            part.wires.push(json!({
                "wire": id.index(),
                "name": wire.name,
                "source": wire.source,
                "firstVertex": part.positions.len(),
                "vertexCount": points.len(),
            }));
            part.positions
                .extend(points.into_iter().map(|p| grid.place(p)));
        }
        parts
    }

    fn thin_primitive(
        &mut self,
        lines: bool,
        thin: &Thin,
        root: &mut gltf::json::Root,
    ) -> Primitive {
        let positions = self.positions(&thin.positions);
        let mode = if lines { Mode::Lines } else { Mode::Points };
        let material = self.materials.add_thin(self.scene, thin.material, root);
        Primitive {
            attributes: BTreeMap::from([(Valid(Semantic::Positions), positions)]),
            extensions: None,
            extras: extras(&json!({ "wires": thin.wires })),
            indices: None,
            material: Some(material),
            mode: Valid(mode),
            targets: None,
        }
    }

    /// Stores positions as the file has them.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "on a grid they are from 0 to 65535"
    )]
    fn positions(&mut self, positions: &[[f32; 3]]) -> Index<Accessor> {
        if self.quantize {
            let steps: Vec<_> = positions.iter().map(|p| p.map(|x| x as u16)).collect();
            self.data.add_steps(&steps)
        } else {
            self.data.add_points(positions)
        }
    }

    fn primitive(
        &mut self,
        look: Look,
        batch: &Batch,
        root: &mut gltf::json::Root,
    ) -> io::Result<Primitive> {
        let mut attributes = BTreeMap::new();
        let positions = self.positions(&batch.positions);
        let (data, quantize) = (&mut self.data, self.quantize);
        attributes.insert(Valid(Semantic::Positions), positions);
        if look.normals {
            let normals = if quantize {
                data.add_directions(&batch.normals)
            } else {
                data.add_vec3(&batch.normals)
            };
            attributes.insert(Valid(Semantic::Normals), normals);
        }
        if look.uvs {
            // Those of repeated pictures are not shares of them.
            let mut numbers = batch.uvs.iter().flatten();
            let uvs = if quantize && numbers.all(|x| (0.0..=1.0).contains(x)) {
                data.add_shares(&batch.uvs)
            } else {
                data.add_vec2(&batch.uvs)
            };
            attributes.insert(Valid(Semantic::TexCoords(0)), uvs);
        }
        if look.colors {
            let colors = if quantize {
                data.add_shares(&batch.colors)
            } else {
                data.add_colors(&batch.colors)
            };
            attributes.insert(Valid(Semantic::Colors(0)), colors);
        }
        let indices = data.add_indices(&batch.indices, batch.positions.len());
        let sides = Sides {
            double: look.double_sided,
            textured: look.uvs,
            clear: look.clear,
        };
        let materials = &mut self.materials;
        let material = materials.add(self.scene, batch.material, sides, data, root)?;
        Ok(Primitive {
            attributes,
            extensions: None,
            extras: extras(&json!({ "faces": batch.faces })),
            indices: Some(indices),
            material: Some(material),
            mode: Valid(Mode::Triangles),
            targets: None,
        })
    }
}

impl Batch {
    /// Appends a mesh.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "files hold single precision"
    )]
    fn extend(
        &mut self,
        mesh: &kernel::Mesh,
        shape: Shape,
        grid: &Grid,
        picture_from_shape: &DAffine2,
    ) {
        let first = number(self.positions.len());
        let positions = mesh.positions().iter();
        self.positions.extend(positions.map(|&p| grid.place(p)));
        let unit = |n: &DVec3| n.normalize_or(DVec3::Z).as_vec3().normalize().to_array();
        self.normals.extend(mesh.normals().iter().map(unit));
        // Ours run upwards, those of the format downwards.
        let texture = |st: &DVec2| {
            let st = picture_from_shape.transform_point2(*st);
            [st.x as f32, (1.0 - st.y) as f32]
        };
        self.uvs.extend(mesh.uvs().iter().map(texture));
        let color = |color: &DVec4| color.clamp(DVec4::ZERO, DVec4::ONE).as_vec4().to_array();
        self.colors.extend(mesh.colors().iter().map(color));
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
    }
}
