//! A scene: what a file holds, whatever its format.

use std::sync::Arc;

use glam::{DAffine3, DVec2, DVec3};

mod extent;
mod places;

use self::extent::Hull;
use crate::{Aabb, Camera, Curve, Error, FARTHEST, Image, Light, Material, Mesh, Patch, Sky, Unit};

/// Index of a patch in its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PatchId(usize);

/// Index of a mesh in its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MeshId(usize);

/// Index of a material in its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MaterialId(usize);

/// Index of a node in its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct NodeId(usize);

/// Index of a wire in its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct WireId(usize);

/// A curve or points that stand for themselves: they have no area, and rays pass them.
#[derive(Clone, Debug, PartialEq)]
pub struct Wire {
    /// The name in the file, or empty.
    pub name: String,
    /// Where it stands in the file, in the format's own words.
    pub source: String,
    /// What it is.
    pub shape: WireShape,
    /// The material, if the file names one.
    pub material: Option<MaterialId>,
}

/// What a [`Wire`] is.
#[derive(Clone, Debug, PartialEq)]
pub enum WireShape {
    /// A curve.
    Curve(Curve<DVec3>),
    /// Points.
    Points(Vec<DVec3>),
}

impl Wire {
    /// A box around the control points of a curve, or around points.
    pub fn hull_bounds(&self) -> Aabb {
        match &self.shape {
            WireShape::Curve(curve) => curve.hull_bounds(),
            WireShape::Points(points) => Aabb::around(points.iter().copied()),
        }
    }
}

/// Two curves on patches that the file says are one in space.
///
/// The patches stand in the same coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Seam {
    /// The curve on either patch; they may run in opposite directions.
    pub sides: [SeamSide; 2],
    /// How far one strays from the other at most, in the coordinates of the patches.
    pub gap: f64,
}

/// One side of a [`Seam`].
#[derive(Clone, Debug, PartialEq)]
pub struct SeamSide {
    /// The patch.
    pub patch: PatchId,
    /// The curve in its parameter domain.
    pub curve: Curve<DVec2>,
}

/// Geometry by reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shape {
    /// An exact surface.
    Patch(PatchId),
    /// Triangles.
    Mesh(MeshId),
}

/// A shape shown by a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Item {
    /// What is shown.
    pub shape: Shape,
    /// The material here; `None` means the shape's own.
    pub material: Option<MaterialId>,
}

/// A child of a node: something shown, or another node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Child {
    /// Something shown.
    Item(Item),
    /// Another node; the same one may be the child of many.
    Node(NodeId),
}

/// A named group with its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// The name in the file, or empty.
    pub name: String,
    /// Maps the node's coordinates to those of its parent; any invertible affine map.
    pub parent_from_node: DAffine3,
    /// What is inside, in the order of the file.
    pub children: Vec<Child>,
    /// Curves and points inside.
    pub wires: Vec<WireId>,
    /// How many of the last children are closed shells of voids in a solid that the others bound; `None` if the file
    /// does not call the node a solid.
    pub voids: Option<usize>,
}

impl Default for Node {
    fn default() -> Self {
        Self {
            name: String::new(),
            parent_from_node: DAffine3::IDENTITY,
            children: Vec::new(),
            wires: Vec::new(),
            voids: None,
        }
    }
}

impl Node {
    /// Whether child number `k` is the shell of a void.
    pub fn is_void(&self, k: usize) -> bool {
        self.voids
            .is_some_and(|count| k + count >= self.children.len())
    }
}

/// The upward axis of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// Y points upwards.
    #[default]
    Y,
    /// Z points upwards.
    Z,
}

impl UpAxis {
    /// The unit vector upwards.
    pub fn direction(self) -> DVec3 {
        match self {
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
        }
    }
}

/// Patches, meshes and wires, stored once and placed by a tree of nodes, with all that is needed
/// to look at them.
///
/// Nodes are added children first, so that no node can contain itself. Indices are those of the scene
/// that gave them, and of its clones.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    patches: Vec<Patch>,
    meshes: Vec<Mesh>,
    materials: Vec<Material>,
    wires: Vec<Wire>,
    seams: Vec<Seam>,
    nodes: Vec<Node>,
    root: Option<NodeId>,
    hull: Hull,
    /// Cameras in world coordinates, the first one being the preferred one.
    pub cameras: Vec<Camera>,
    /// Lights in world coordinates.
    pub lights: Vec<Light>,
    /// Whether a light goes with the camera.
    pub headlight: bool,
    /// Linear colour behind everything, if the file names one.
    pub background: Option<DVec3>,
    /// How the background changes with the direction, if it does; it then is the first colour.
    pub sky: Option<Sky>,
    /// The unit of length, if the file names one.
    pub unit: Option<Unit>,
    /// The least distance that counts, in units of the scene, if the file names one.
    pub resolution: Option<f64>,
    /// The upward axis.
    pub up: UpAxis,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            patches: Vec::new(),
            meshes: Vec::new(),
            materials: Vec::new(),
            wires: Vec::new(),
            seams: Vec::new(),
            nodes: Vec::new(),
            root: None,
            hull: Hull::default(),
            cameras: Vec::new(),
            lights: Vec::new(),
            headlight: true,
            background: None,
            sky: None,
            unit: None,
            resolution: None,
            up: UpAxis::default(),
        }
    }
}

/// One shape at one place of the flattened tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// What stands there.
    pub shape: Shape,
    /// Its material, if any.
    pub material: Option<MaterialId>,
    /// Where it stands.
    pub world_from_object: DAffine3,
    /// The nodes from the root down to it.
    pub path: Vec<NodeId>,
}

/// One curve, or points, at one place of the flattened tree.
#[derive(Clone, Debug, PartialEq)]
pub struct WirePlacement {
    /// What stands there.
    pub wire: WireId,
    /// Where it stands.
    pub world_from_object: DAffine3,
    /// The nodes from the root down to it.
    pub path: Vec<NodeId>,
}

impl Scene {
    /// Adds a material.
    pub fn add_material(&mut self, material: Material) -> MaterialId {
        self.materials.push(material);
        MaterialId(self.materials.len() - 1)
    }

    /// Adds a patch.
    ///
    /// # Errors
    /// If its material is not one of this scene.
    pub fn add_patch(&mut self, patch: Patch) -> Result<PatchId, Error> {
        self.check_material(patch.material)?;
        self.patches.push(patch);
        Ok(PatchId(self.patches.len() - 1))
    }

    /// Adds a mesh.
    ///
    /// # Errors
    /// If its material is not one of this scene.
    pub fn add_mesh(&mut self, mesh: Mesh) -> Result<MeshId, Error> {
        self.check_material(mesh.material)?;
        self.meshes.push(mesh);
        Ok(MeshId(self.meshes.len() - 1))
    }

    /// Adds a wire.
    ///
    /// # Errors
    /// If its material is not one of this scene.
    pub fn add_wire(&mut self, wire: Wire) -> Result<WireId, Error> {
        self.check_material(wire.material)?;
        self.wires.push(wire);
        Ok(WireId(self.wires.len() - 1))
    }

    /// Adds a seam between patches that have been added before.
    ///
    /// # Errors
    /// If a patch is not one of this scene.
    pub fn add_seam(&mut self, seam: Seam) -> Result<(), Error> {
        let count = self.patches.len();
        for index in seam.sides.each_ref().map(|side| side.patch.0) {
            if index >= count {
                return Err(Error::Reference { index, count });
            }
        }
        self.seams.push(seam);
        Ok(())
    }

    /// Adds a node whose children have been added before.
    ///
    /// # Errors
    /// If a child, wire or material is not one of this scene, or the map is not finite and
    /// invertible.
    pub fn add_node(&mut self, node: Node) -> Result<NodeId, Error> {
        let determinant = node.parent_from_node.matrix3.determinant();
        if !node.parent_from_node.is_finite() || !determinant.is_normal() {
            return Err(Error::NotPositive {
                found: determinant.abs(),
            });
        }
        for child in &node.children {
            let (index, count) = match child {
                Child::Node(id) => (id.0, self.nodes.len()),
                Child::Item(Item {
                    shape: Shape::Patch(id),
                    ..
                }) => (id.0, self.patches.len()),
                Child::Item(Item {
                    shape: Shape::Mesh(id),
                    ..
                }) => (id.0, self.meshes.len()),
            };
            if index >= count {
                return Err(Error::Reference { index, count });
            }
            if let Child::Item(item) = child {
                self.check_material(item.material)?;
            }
        }
        if let Some(&WireId(index)) = node.wires.iter().find(|id| id.0 >= self.wires.len()) {
            let count = self.wires.len();
            return Err(Error::Reference { index, count });
        }
        self.nodes.push(node);
        Ok(NodeId(self.nodes.len() - 1))
    }

    /// Makes `node` the one node that contains all that is shown.
    ///
    /// # Errors
    /// If it is not a node of this scene, or what it shows is too far away to be computed with.
    pub fn set_root(&mut self, node: NodeId) -> Result<(), Error> {
        if node.0 >= self.nodes.len() {
            return Err(Error::Reference {
                index: node.0,
                count: self.nodes.len(),
            });
        }
        self.root = Some(node);
        self.hull = Hull::default();
        let extent = self.extent();
        let farthest = extent.min.abs().max(extent.max.abs()).max_element();
        if !extent.is_empty() && farthest > FARTHEST {
            self.root = None;
            self.hull = Hull::default();
            return Err(Error::TooFar);
        }
        Ok(())
    }

    fn check_material(&self, material: Option<MaterialId>) -> Result<(), Error> {
        let count = self.materials.len();
        match material {
            Some(MaterialId(index)) if index >= count => Err(Error::Reference { index, count }),
            _ => Ok(()),
        }
    }

    /// All patches, each once.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// All meshes, each once.
    pub fn meshes(&self) -> &[Mesh] {
        &self.meshes
    }

    /// All materials.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// The pictures of all materials, each once, in the order of the materials.
    pub fn images(&self) -> Vec<&Arc<Image>> {
        let mut images: Vec<&Arc<Image>> = Vec::new();
        for material in &self.materials {
            let sides = std::iter::once(material).chain(material.back.as_deref());
            for texture in sides.flat_map(|side| side.maps.textures()) {
                if !images
                    .iter()
                    .any(|known| Arc::ptr_eq(known, &texture.image))
                {
                    images.push(&texture.image);
                }
            }
        }
        images
    }

    /// All curves and points that stand for themselves, each once.
    pub fn wires(&self) -> &[Wire] {
        &self.wires
    }

    /// Where the file says that patches meet.
    pub fn seams(&self) -> &[Seam] {
        &self.seams
    }

    /// All nodes, children before parents.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The node that contains all that is shown; `None` for an empty scene.
    pub fn root(&self) -> Option<NodeId> {
        self.root
    }

    /// The patch with this index.
    ///
    /// # Panics
    /// If the scene has none.
    pub fn patch(&self, id: PatchId) -> &Patch {
        &self.patches[id.0]
    }

    /// The mesh with this index.
    ///
    /// # Panics
    /// If the scene has none.
    pub fn mesh(&self, id: MeshId) -> &Mesh {
        &self.meshes[id.0]
    }

    /// The material with this index.
    ///
    /// # Panics
    /// If the scene has none.
    pub fn material(&self, id: MaterialId) -> &Material {
        &self.materials[id.0]
    }

    /// The wire with this index.
    ///
    /// # Panics
    /// If the scene has none.
    pub fn wire(&self, id: WireId) -> &Wire {
        &self.wires[id.0]
    }

    /// The node with this index.
    ///
    /// # Panics
    /// If the scene has none.
    pub fn node(&self, id: NodeId) -> &Node {
        &self.nodes[id.0]
    }

    /// The nodes' indices, children before parents.
    pub fn node_ids(&self) -> impl Iterator<Item = NodeId> + use<> {
        (0..self.nodes.len()).map(NodeId)
    }

    /// The material an item is shown with.
    ///
    /// # Panics
    /// If the scene has no such shape.
    pub fn item_material(&self, item: &Item) -> Option<MaterialId> {
        item.material.or(match item.shape {
            Shape::Patch(id) => self.patch(id).material,
            Shape::Mesh(id) => self.mesh(id).material,
        })
    }
}

/// Gives an index type the position that it stands for.
macro_rules! positions {
    ($($id:ident in $list:ident),*) => {$(
        impl $id {
            #[doc = concat!("Position in [`Scene::", stringify!($list), "`].")]
            pub fn index(self) -> usize {
                self.0
            }
        }
    )*};
}

positions!(
    PatchId in patches,
    MeshId in meshes,
    MaterialId in materials,
    WireId in wires,
    NodeId in nodes
);

#[cfg(test)]
mod tests;
