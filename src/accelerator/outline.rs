//! Points and boxes around what is shown, for cameras that are to show all of it.

use glam::{DVec2, DVec3};
use kernel::{Aabb, KnotVector, Patch, Shape};

use super::Accelerator;

/// Boxes of an outline, about.
const BOXES: usize = 4096;

/// Instances of which the outlines are gone through one by one.
const INSTANCES: usize = 256;

/// Patches and meshes of which points are taken, and points of all meshes together.
const SHAPES: u32 = 512;
const VERTICES: usize = 1 << 16;

/// Points of all patches together, about, and along one side of a patch.
const POINTS: usize = 40_000;
const ALONG: [usize; 2] = [16, 64];

/// Points on each Bézier piece of a loop, and pieces of which they are taken.
const ON_LOOP: usize = 4;
const PIECES: usize = 256;

impl Accelerator<'_> {
    /// Boxes that together hold everything but for less than the margin of
    /// [`Camera::framing`](kernel::Camera::framing): points of the surfaces where there are few, else many small boxes.
    pub fn outline(&self) -> Vec<Aabb> {
        let vertices = self
            .scene
            .meshes()
            .iter()
            .map(|mesh| mesh.positions().len());
        if self.shape_count() <= SHAPES && vertices.sum::<usize>() <= VERTICES {
            return self.points();
        }
        if self.instances.len() > INSTANCES {
            return self.top.outline(BOXES);
        }
        let most = BOXES / self.instances.len().max(1);
        let boxes = self.instances.iter().flat_map(|instance| {
            let cluster = &self.clusters[instance.cluster as usize];
            let trees = [&cluster.tree, &cluster.triangle_tree];
            let local = trees.map(|tree| tree.outline(most)).concat();
            local
                .into_iter()
                .map(|b| b.transformed(&instance.world_from_cluster))
        });
        boxes.collect()
    }

    /// Points of everything shown.
    fn points(&self) -> Vec<Aabb> {
        let most = POINTS / (self.shape_count() as usize).max(1);
        let along = most.isqrt().clamp(ALONG[0], ALONG[1]);
        let placements = self.scene.placements();
        let points = placements.iter().flat_map(|placement| {
            let own = match placement.shape {
                Shape::Patch(id) => on_patch(self.scene.patch(id), along),
                Shape::Mesh(id) => self.scene.mesh(id).positions().to_vec(),
            };
            let world = move |p| placement.world_from_object.transform_point3(p);
            own.into_iter().map(world)
        });
        points.map(|p| Aabb::around([p])).collect()
    }
}

/// Points of a face: on a grid, no more than `most` along a side, and on its loops.
fn on_patch(patch: &Patch, most: usize) -> Vec<DVec3> {
    let surface = &patch.surface;
    let region = patch.region();
    let places = [surface.knots_u(), surface.knots_v()].map(|knots| places(knots, most));
    let grid = places[0]
        .iter()
        .flat_map(|&u| places[1].iter().map(move |&v| DVec2::new(u, v)));
    let inside = grid.filter(|&uv| region.as_ref().is_none_or(|region| region.contains(uv)));
    let mut points: Vec<_> = inside.map(|uv| surface.evaluate(uv)).collect();
    let [u, v] = [surface.knots_u().domain(), surface.knots_v().domain()];
    let (min, max) = (DVec2::new(u.start, v.start), DVec2::new(u.end, v.end));
    for trim in &patch.loops {
        let spans = trim.segments().iter().flat_map(|curve| {
            let breaks = curve.knots().breaks();
            let pairs: Vec<_> = breaks.windows(2).map(|pair| [pair[0], pair[1]]).collect();
            pairs.into_iter().map(move |pair| (curve, pair))
        });
        let spans: Vec<_> = spans.collect();
        for (curve, [from, to]) in spans.iter().step_by(spans.len().div_ceil(PIECES).max(1)) {
            let step = (to - from) / ON_LOOP as f64;
            let on = (0..ON_LOOP).map(|k| curve.evaluate(from + step * k as f64));
            points.extend(on.map(|uv| surface.evaluate(uv.clamp(min, max))));
        }
    }
    points
}

/// Parameters along a side: the ends of its pieces, and some between where they are curved.
fn places(knots: &KnotVector, most: usize) -> Vec<f64> {
    let breaks = knots.breaks();
    let pieces = breaks.len() - 1;
    let steps = if knots.degree() < 2 {
        1
    } else {
        2 * knots.degree()
    };
    let count = (pieces * steps).min(most);
    let place = |k: usize| {
        let piece = (k * pieces / count).min(pieces - 1);
        let share = (k * pieces - piece * count) as f64 / count as f64;
        breaks[piece] + (breaks[piece + 1] - breaks[piece]) * share
    };
    (0..=count).map(place).collect()
}
