//! The search structure between a scene and its rays.
//!
//! Two levels. A cluster holds what hangs below one node without passing a node that is
//! shown more than once, or a part of that which is far smaller than the rest (`zones.rs`). Its
//! pieces are divided into nearly flat cells, over which stands a hierarchy of boxes. Instances
//! place clusters in the world; over them stands another hierarchy. Shapes shown many times are
//! so stored once.

mod approach;
mod beam;
mod block;
mod build;
mod cells;
mod distance;
mod expansion;
mod fans;
mod few;
mod finish;
mod fold;
mod hits;
mod hull;
mod leaf;
mod leaving;
mod meetings;
mod model;
mod octet;
mod outline;
mod packet;
mod places;
mod polygons;
mod powers;
mod room;
mod roots;
mod seal;
mod stream;
mod strip;
mod trace;
mod tree;
mod walk;
mod windows;
mod zones;

use std::borrow::Cow;
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use kernel::{Aabb, MaterialId, Mesh, Patch, Scene, Shape, TrimRegion};

use crate::intersect::{Method, PieceNet, Scratch};
use crate::simd::Instructions;
use block::Block;
use cells::{Piece, Pieces};
pub use leaving::Start;
use room::PacketRoom;
use seal::Seal;
use tree::Tree;
use zones::{BESIDE, Seams};

/// Everything that rays can meet, prepared for the search.
#[derive(Debug)]
pub struct Accelerator<'a> {
    scene: &'a Scene,
    clusters: Vec<Cluster<'a>>,
    instances: Vec<Instance>,
    /// What closes the gaps of each cluster; empty if nothing does.
    seals: Vec<Seal>,
    top: Tree,
    counts: Counts,
    method: &'static Method,
    /// Tells it from others, as long as anybody holds it.
    mark: Arc<()>,
    instructions: Instructions,
}

/// How many shapes of both kinds there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    patches: u32,
    meshes: u32,
}

/// Shapes in common coordinates: what clusters are made of.
#[derive(Debug)]
struct Stock<'a> {
    pieces: Pieces,
    items: Vec<ClusterItem<'a>>,
    /// From the objects of items to the clusters.
    maps: Vec<DAffine3>,
    /// What belongs to the faces that do not show all of their surface.
    regions: Vec<TrimRegion>,
}

/// Shapes with a hierarchy over their cells and one over triangles.
#[derive(Debug)]
struct Cluster<'a> {
    /// Others may be made of the same.
    stock: Arc<Stock<'a>>,
    /// The cells of each leaf of `tree`.
    blocks: Vec<Block>,
    cell_count: usize,
    tree: Tree,
    /// In the order of the leaves of `triangle_tree`.
    triangles: Vec<Triangle>,
    triangle_tree: Tree,
    /// The box around cells and what closes gaps.
    reach: Aabb,
    /// The items of which gaps are closed here, if not all of the stock.
    seams: Option<Seams>,
}

impl<'a> Cluster<'a> {
    fn bounds(&self) -> Aabb {
        self.reach.union(self.triangle_tree.bounds())
    }

    /// The items that no other cluster of the stock closes the gaps of.
    fn own(&self) -> Cow<'_, [u32]> {
        match &self.seams {
            Some(seams) => Cow::Borrowed(&seams.own),
            None => (0..).zip(&self.stock.items).map(|(k, _)| k).collect(),
        }
    }

    /// How wide strips may be to lie within the bounds.
    fn widest_strip(&self) -> f64 {
        let has_more = |seams: &Seams| !seams.beside.is_empty();
        if self.seams.as_ref().is_some_and(has_more) {
            BESIDE * self.tree.bounds().diagonal()
        } else {
            f64::INFINITY
        }
    }

    #[inline(always)]
    fn piece(&self, number: u32) -> &Piece {
        &self.stock.pieces.pieces[number as usize]
    }

    #[inline(always)]
    fn net(&self, piece: &Piece) -> PieceNet<'_> {
        self.stock.pieces.net(piece)
    }

    #[inline(always)]
    fn item(&self, number: u32) -> &ClusterItem<'a> {
        &self.stock.items[number as usize]
    }

    /// The map from an item's object.
    fn map_of(&self, item: &ClusterItem<'_>) -> &DAffine3 {
        &self.stock.maps[item.map as usize]
    }
}

#[derive(Clone, Copy, Debug)]
struct Triangle {
    item: u32,
    index: u32,
    corners: [DVec3; 3],
}

/// A shape of a cluster.
#[derive(Clone, Copy, Debug)]
struct ClusterItem<'a> {
    shape: ItemShape<'a>,
    /// Position among the shapes of its kind within one instance.
    offset: u32,
    material: Option<MaterialId>,
    /// Number of its map among those of the cluster.
    map: u32,
    /// Number of its trim region in the cluster, if it has one.
    region: Option<u32>,
    /// What is stored of it, for what only pictures on it need.
    origin: Shape,
}

#[derive(Clone, Copy, Debug)]
enum ItemShape<'a> {
    Patch(&'a Patch),
    Mesh(&'a Mesh),
}

/// A cluster at its place.
#[derive(Clone, Copy, Debug)]
struct Instance {
    cluster: u32,
    /// How many shapes of both kinds come before it.
    before: Counts,
    world_from_cluster: DAffine3,
    /// The greatest length that a unit axis takes in the world.
    stretch: f64,
    cluster_from_world: DAffine3,
    /// Whether it turns what is seen in a mirror.
    is_mirrored: bool,
}

/// Memory that one thread reuses from ray to ray.
#[derive(Debug, Default)]
pub struct Workspace {
    top_stack: Vec<(u32, f32)>,
    stack: Vec<(u32, f32)>,
    scratch: Scratch,
    packet: PacketRoom,
    candidates: Vec<trace::Candidate>,
    /// Whose cells the packets have at hand.
    served: Option<Arc<()>>,
}

impl Workspace {
    /// Forgets the cells of another accelerator.
    fn serve(&mut self, accelerator: &Accelerator<'_>) {
        let mark = &accelerator.mark;
        if !self
            .served
            .as_ref()
            .is_some_and(|served| Arc::ptr_eq(served, mark))
        {
            self.packet = PacketRoom::default();
            self.served = Some(Arc::clone(mark));
        }
    }

    fn rooms(&mut self) -> trace::Rooms<'_> {
        (&mut self.top_stack, &mut self.stack, &mut self.scratch)
    }

    /// How many cells were examined with this workspace so far.
    pub fn cells_examined(&self) -> u64 {
        self.scratch.cells
    }
}

impl<'a> Accelerator<'a> {
    /// The box around everything.
    pub fn bounds(&self) -> Aabb {
        self.top.bounds()
    }

    /// Number of patches after instancing; the numbers of meshes follow those of patches.
    pub fn patch_count(&self) -> u32 {
        self.counts.patches
    }

    /// Number of patches and meshes after instancing.
    pub fn shape_count(&self) -> u32 {
        self.counts.patches + self.counts.meshes
    }

    /// Number of stored cells, each once however often it is shown.
    pub fn cell_count(&self) -> usize {
        self.clusters.iter().map(|c| c.cell_count).sum()
    }

    /// Memory of all nets, cells and hierarchies.
    pub fn bytes(&self) -> usize {
        let stocks = self
            .clusters
            .chunk_by(|a, b| Arc::ptr_eq(&a.stock, &b.stock));
        let stocks = stocks.map(|clusters| clusters[0].stock.bytes());
        let clusters = self.clusters.iter().map(|c| {
            size_of_val(&c.triangles[..])
                + size_of_val(&c.blocks[..])
                + c.triangle_tree.bytes()
                + c.tree.bytes()
        });
        let clusters = stocks.chain(clusters);
        let seals = self.seals.iter().map(Seal::bytes).sum::<usize>();
        clusters.sum::<usize>() + seals + size_of_val(&self.instances[..]) + self.top.bytes()
    }

    /// Traces packets with other instructions than the widest of this processor; those that
    /// it lacks are replaced by the portable ones. Hits are the same but for rounding.
    #[must_use]
    pub fn with_instructions(mut self, instructions: Instructions) -> Self {
        self.instructions = instructions;
        self
    }

    /// The instructions that packets are traced with.
    pub fn instructions(&self) -> Instructions {
        self.instructions
    }

    /// The scene it was built for.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }
}

impl Stock<'_> {
    /// Memory in use.
    fn bytes(&self) -> usize {
        self.pieces.bytes()
            + self.regions.iter().map(TrimRegion::bytes).sum::<usize>()
            + size_of_val(&self.items[..])
            + size_of_val(&self.maps[..])
    }
}

impl ItemShape<'_> {
    fn of(scene: &Scene, shape: Shape) -> ItemShape<'_> {
        match shape {
            Shape::Patch(id) => ItemShape::Patch(scene.patch(id)),
            Shape::Mesh(id) => ItemShape::Mesh(scene.mesh(id)),
        }
    }
}

#[cfg(test)]
mod along_tests;
#[cfg(test)]
mod seam_tests;
#[cfg(test)]
mod tests;
