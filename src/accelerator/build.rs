//! From a scene to clusters and instances.

use std::ops::Range;
use std::sync::Arc;

use glam::DAffine3;
use kernel::{Aabb, BezierSurface, Child, KnotVector, NodeId, Patch, Scene, TrimRegion};

use rayon::prelude::*;

use super::block::Block;
use super::cells::{GROUP, Halvings, NewCell, Parts, Source};
use super::tree::Tree;
use super::zones::{Zone, zones};
use super::{Accelerator, Cluster, ClusterItem, Counts, Instance, ItemShape, Stock, Triangle};
use crate::intersect::Method;
use crate::memory::reserve;
use crate::simd::Instructions;

/// Shapes that one thread divides in one go.
const ITEMS_OF_A_TASK: usize = 64;

/// Pieces of a shape that one thread divides in one go.
const PIECES_OF_A_TASK: usize = 256;

/// Tasks of a thread of which the results wait to be put together.
const TASKS_AT_ONCE: usize = 16;

/// Triangles that are not divided further.
const TRIANGLES_OF_A_LEAF: usize = 4;

impl<'a> Accelerator<'a> {
    /// Prepares `scene` for rays that are to be intersected with `method`.
    pub fn build(scene: &'a Scene, method: &'static Method) -> Self {
        let plan = Plan::of(scene);
        let some: Vec<_> = plan
            .roots
            .par_iter()
            .map(|&root| plan.clusters(scene, root))
            .collect();
        let (mut clusters, mut ranges) = (Vec::new(), Vec::new());
        for some in some {
            ranges.push(clusters.len()..clusters.len() + some.len());
            clusters.extend(some);
        }
        let mut instances = Vec::new();
        let mut counts = Counts::default();
        if let Some(root) = scene.root() {
            let start = (root, DAffine3::IDENTITY);
            counts = plan.place(scene, start, (&clusters, &ranges), &mut instances);
        }
        let boxes: Vec<_> = instances
            .iter()
            .map(|i| {
                clusters[i.cluster as usize]
                    .bounds()
                    .transformed(&i.world_from_cluster)
            })
            .collect();
        let (top, order) = Tree::build(&boxes, 1);
        let instances = order.iter().map(|&k| instances[k as usize]).collect();
        Self {
            scene,
            clusters,
            instances,
            seals: Vec::new(),
            top,
            counts,
            method,
            mark: Arc::default(),
            instructions: Instructions::best(),
        }
    }
}

/// Which nodes begin clusters.
struct Plan {
    roots: Vec<NodeId>,
    /// For every node its place among these, if it is one.
    root_of: Vec<Option<u32>>,
    /// For every node how many shapes it shows with all below.
    counts: Vec<Counts>,
}

impl Plan {
    fn of(scene: &Scene) -> Self {
        let nodes = scene.nodes();
        let mut counts: Vec<Counts> = Vec::new();
        let mut uses = vec![0_u32; nodes.len()];
        for node in nodes {
            let mut sum = Counts::default();
            for child in &node.children {
                sum = sum.plus(match child {
                    Child::Item(item) => Counts::one(ItemShape::of(scene, item.shape)),
                    Child::Node(id) => {
                        uses[id.index()] = uses[id.index()].saturating_add(1);
                        counts[id.index()]
                    }
                });
            }
            counts.push(sum);
        }
        // A node used by several, or below one, begins clusters; so does the root.
        let mut plan = Self {
            roots: Vec::new(),
            root_of: vec![None; nodes.len()],
            counts,
        };
        for id in scene.node_ids() {
            let shared = uses[id.index()] > 1 && plan.counts[id.index()] != Counts::default();
            if shared || scene.root() == Some(id) {
                let number = u32::try_from(plan.roots.len()).expect("fewer nodes than fit");
                plan.root_of[id.index()] = Some(number);
                plan.roots.push(id);
            }
        }
        plan
    }

    /// Visits what hangs below `start` in the order of the file: items, and the nodes that
    /// begin other clusters, each with its place and with what was shown before it.
    fn walk(&self, scene: &Scene, start: NodeId, mut visit: impl FnMut(Child, DAffine3, Counts)) {
        let mut before = Counts::default();
        let mut stack = vec![(Child::Node(start), DAffine3::IDENTITY)];
        let mut first = true;
        while let Some((child, place)) = stack.pop() {
            match child {
                Child::Item(item) => {
                    visit(child, place, before);
                    before = before.plus(Counts::one(ItemShape::of(scene, item.shape)));
                }
                Child::Node(id) if !first && self.root_of[id.index()].is_some() => {
                    visit(child, place, before);
                    before = before.plus(self.counts[id.index()]);
                }
                Child::Node(id) => {
                    let node = scene.node(id);
                    // The first node's own map belongs to the place of the cluster.
                    let place = if first {
                        place
                    } else {
                        place * node.parent_from_node
                    };
                    first = false;
                    stack.extend(node.children.iter().rev().map(|&child| (child, place)));
                }
            }
        }
    }

    /// Gathers and divides the shapes of the clusters that begin at `root`.
    fn clusters<'a>(&self, scene: &'a Scene, root: NodeId) -> Vec<Cluster<'a>> {
        let mut triangles: Vec<Triangle> = Vec::new();
        let mut items: Vec<ClusterItem<'a>> = Vec::new();
        let mut maps: Vec<DAffine3> = Vec::new();
        let mut regions: Vec<TrimRegion> = Vec::new();
        let mut count = 0;
        self.walk(scene, root, |child, _, _| {
            count += usize::from(matches!(child, Child::Item(_)));
        });
        reserve(&mut items, count);
        self.walk(scene, root, |child, cluster_from_object, before| {
            let Child::Item(item) = child else { return };
            let number = u32::try_from(items.len()).expect("fewer items than fit");
            let shape = ItemShape::of(scene, item.shape);
            let trims = match shape {
                ItemShape::Patch(patch) => patch.region(),
                ItemShape::Mesh(_) => None,
            };
            let offset = match shape {
                ItemShape::Patch(_) => before.patches,
                ItemShape::Mesh(mesh) => {
                    let at =
                        |k: u32| cluster_from_object.transform_point3(mesh.positions()[k as usize]);
                    let place = |(index, corners): (usize, &[u32; 3])| Triangle {
                        item: number,
                        index: u32::try_from(index).expect("fewer triangles than fit"),
                        corners: corners.map(at),
                    };
                    triangles.extend(mesh.triangles().iter().enumerate().map(place));
                    before.meshes
                }
            };
            let material = scene.item_material(&item);
            let region = trims.map(|trims| {
                regions.push(trims);
                u32::try_from(regions.len() - 1).expect("no more regions than items")
            });
            if maps.last() != Some(&cluster_from_object) {
                maps.push(cluster_from_object);
            }
            let map = u32::try_from(maps.len() - 1).expect("no more maps than items");
            items.push(ClusterItem {
                shape,
                offset,
                material,
                map,
                region,
                origin: item.shape,
            });
        });
        let halvings = self.halvings(scene, &items);
        let mut parts = divided(halvings, &items, &maps, &regions);
        let boxes = parts.boxes();
        let zones = zones(&parts, &boxes, items.len());
        let stock = Arc::new(Stock {
            pieces: std::mem::take(&mut parts.pieces),
            items,
            maps,
            regions,
        });
        if zones.is_empty() {
            let groups = (&parts.groups[..], &boxes[..]);
            return vec![Cluster::of(&stock, &parts.cells, groups, &triangles)];
        }
        let cluster = |(k, zone): (usize, Zone)| {
            let group = |&k: &usize| (parts.groups[k].clone(), boxes[k]);
            let (groups, boxes): (Vec<_>, Vec<_>) = zone.groups.iter().map(group).unzip();
            let groups = (&groups[..], &boxes[..]);
            let triangles = if k == 0 { &triangles[..] } else { &[] };
            Cluster {
                reach: zone.reach,
                seams: Some(zone.seams),
                ..Cluster::of(&stock, &parts.cells, groups, triangles)
            }
        };
        zones.into_iter().enumerate().map(cluster).collect()
    }

    /// How often the pieces of a cluster are halved.
    fn halvings(&self, scene: &Scene, items: &[ClusterItem<'_>]) -> Halvings {
        let spans = |knots: &KnotVector| knots.breaks().len() - 1;
        let pieces = items.iter().map(|item| match item.shape {
            ItemShape::Patch(Patch { surface, .. }) => {
                spans(surface.knots_u()) * spans(surface.knots_v())
            }
            ItemShape::Mesh(_) => 0,
        });
        let shown = (scene.root()).map_or(0, |root| self.counts[root.index()].patches);
        Halvings::of((scene.patches().len(), shown as usize), pieces)
    }

    /// Appends every place of every cluster, and counts what they show.
    fn place(
        &self,
        scene: &Scene,
        start: (NodeId, DAffine3),
        (clusters, ranges): (&[Cluster<'_>], &[Range<usize>]),
        instances: &mut Vec<Instance>,
    ) -> Counts {
        let mut stack = vec![(start, Counts::default())];
        while let Some(((node, world_from_parent), base)) = stack.pop() {
            let Some(root) = self.root_of[node.index()] else {
                continue;
            };
            let world_from_cluster = world_from_parent * scene.node(node).parent_from_node;
            for cluster in ranges[root as usize].clone() {
                if clusters[cluster].bounds().is_empty() {
                    continue;
                }
                let matrix = &world_from_cluster.matrix3;
                let axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
                instances.push(Instance {
                    stretch: axes.iter().fold(0.0, |max, axis| axis.length().max(max)),
                    cluster: u32::try_from(cluster).expect("fewer clusters than fit"),
                    before: base,
                    world_from_cluster,
                    cluster_from_world: world_from_cluster.inverse(),
                    is_mirrored: matrix.determinant() < 0.0,
                });
            }
            self.walk(scene, node, |child, place, before| {
                if let Child::Node(id) = child {
                    stack.push(((id, world_from_cluster * place), base.plus(before)));
                }
            });
        }
        self.counts[start.0.index()]
    }
}

impl<'a> Cluster<'a> {
    /// Builds the hierarchies over groups of cells, with the boxes around these, and over triangles.
    fn of(
        stock: &Arc<Stock<'a>>,
        cells: &[NewCell],
        (groups, boxes): (&[Range<usize>], &[Aabb]),
        triangles: &[Triangle],
    ) -> Self {
        let (tree, order) = Tree::pack(boxes, |group| groups[group].len(), GROUP);
        let block = |leaf: usize| {
            let groups = order[tree.leaf(leaf)].iter().map(|&k| &groups[k as usize]);
            let cells = groups.flat_map(|group| &cells[group.clone()]);
            Block::new(cells.map(|new| (new.cell, new.frame)), &tree)
        };
        let mut blocks = Vec::new();
        reserve(&mut blocks, tree.leaf_count());
        blocks.par_extend((0..tree.leaf_count()).into_par_iter().map(block));
        let boxes: Vec<_> = triangles.iter().map(|t| Aabb::around(t.corners)).collect();
        let (triangle_tree, order) = Tree::build(&boxes, TRIANGLES_OF_A_LEAF);
        Self {
            stock: Arc::clone(stock),
            blocks,
            cell_count: groups.iter().map(Range::len).sum(),
            reach: tree.bounds(),
            tree,
            triangles: order.iter().map(|&k| triangles[k as usize]).collect(),
            triangle_tree,
            seams: None,
        }
    }
}

/// The pieces and cells of all patches of a cluster.
fn divided(
    halvings: Halvings,
    items: &[ClusterItem<'_>],
    maps: &[DAffine3],
    regions: &[TrimRegion],
) -> Parts {
    // Many items at a time, so that little memory is asked for often.
    let task = |(k, items): (usize, &[ClusterItem<'_>])| {
        let mut parts = Parts::default();
        for (number, item) in (k * ITEMS_OF_A_TASK..).zip(items) {
            let ItemShape::Patch(patch) = item.shape else {
                continue;
            };
            let number = u32::try_from(number).expect("fewer items than fit");
            let trims = item.region.map(|k| &regions[k as usize]);
            let map = &maps[item.map as usize];
            let moved = (*map != DAffine3::IDENTITY).then(|| patch.surface.transformed(map));
            let surface = moved.as_ref().unwrap_or(&patch.surface);
            if let Some(piece) = Source::whole(surface) {
                parts.add(&piece, (number, halvings), trims);
                continue;
            }
            let divide = |pieces: &[BezierSurface], parts: &mut Parts| {
                for piece in pieces {
                    parts.add(&Source::from(piece), (number, halvings), trims);
                }
            };
            let pieces = surface.bezier_pieces();
            if pieces.len() <= PIECES_OF_A_TASK {
                divide(&pieces, &mut parts);
                continue;
            }
            let some = pieces.par_chunks(PIECES_OF_A_TASK).map(|pieces| {
                let mut parts = Parts::default();
                divide(pieces, &mut parts);
                parts
            });
            let done: Vec<_> = some.collect();
            done.into_iter().for_each(|some| parts.append(some));
        }
        parts
    };
    let mut all = Parts::default();
    let tasks: Vec<_> = items.chunks(ITEMS_OF_A_TASK).enumerate().collect();
    // What some used is used again by those that come later.
    let at_once = TASKS_AT_ONCE * rayon::current_num_threads();
    for (k, some) in tasks.chunks(at_once).enumerate() {
        let done: Vec<_> = some.par_iter().copied().map(task).collect();
        // The rest will be much like the first.
        if k == 0 {
            all.reserve(&done, tasks.len().div_ceil(at_once));
        }
        done.into_iter().for_each(|parts| all.append(parts));
    }
    all
}

impl Counts {
    fn one(shape: ItemShape<'_>) -> Self {
        match shape {
            ItemShape::Patch(_) => Self {
                patches: 1,
                meshes: 0,
            },
            ItemShape::Mesh(_) => Self {
                patches: 0,
                meshes: 1,
            },
        }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            patches: self.patches.saturating_add(other.patches),
            meshes: self.meshes.saturating_add(other.meshes),
        }
    }
}
