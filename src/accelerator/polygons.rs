//! The triangles of a cluster, for all rays of a packet at once or for one of a stream.

use glam::DVec2;

use super::Cluster;
use super::beam::RAYS;
use super::hull::{Extent, Hull};
use super::leaf::Bits;
use super::packet::{SLOTS, Tracer, boxes_of, push};
use super::trace::{Candidate, CandidateKind, Nearest, TriangleVisitor};
use super::tree::IS_LEAF;
use crate::intersect::triangle::Sheared;
use crate::simd::{Part, Simd, WIDE_LANES};

/// The triangles of the cluster at hand, for rays that may run side by side.
pub(super) struct Together<'t, 'a, 'b, S>(
    pub(super) &'t mut Tracer<'a, 'b, S>,
    pub(super) &'t Cluster<'a>,
    pub(super) &'t Hull,
);

impl<S: Simd> Part<S> for Together<'_, '_, '_, S> {
    /// Whether they do.
    type Output = bool;

    #[inline(always)]
    fn run(self, _: S) -> bool {
        let Self(tracer, cluster, hull) = self;
        tracer.triangles(cluster, hull)
    }
}

/// The triangles of the cluster at hand, for one ray.
pub(super) struct Alone<'t, 'a, 'b, S> {
    pub(super) tracer: &'t mut Tracer<'a, 'b, S>,
    pub(super) cluster: &'t Cluster<'a>,
    pub(super) lane: usize,
}

impl<S: Simd> Part<S> for Alone<'_, '_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self, s: S) {
        let Self {
            tracer,
            cluster,
            lane,
        } = self;
        let instance = &tracer.accelerator.instances[tracer.instance as usize];
        let ray = tracer.rays[lane].transformed(&instance.cluster_from_world);
        let mut best = Nearest::or_first(tracer.any);
        let mut visitor = TriangleVisitor {
            cluster,
            ray: Sheared::new(&ray),
            instance: tracer.instance,
            collector: &mut best,
            go_on: true,
        };
        let mut range = tracer.packet.from[lane]..tracer.packet.until[lane];
        let local = cluster.triangle_tree.local_ray(&ray);
        let stack = &mut tracer.packet.triangle_stack;
        cluster
            .triangle_tree
            .traverse(s, &local, &mut range, stack, &mut visitor);
        if let Some(candidate) = best.found {
            tracer.keep(lane, candidate, None);
        }
    }
}

impl<S: Simd> Tracer<'_, '_, S> {
    /// Meets the triangles of a cluster, and says whether the rays run side by side.
    #[inline(always)]
    fn triangles(&mut self, cluster: &Cluster<'_>, hull: &Hull) -> bool {
        let tree = &cluster.triangle_tree;
        let instance = &self.accelerator.instances[self.instance as usize];
        let map = tree.map() * instance.cluster_from_world;
        let rough = hull.extent(&map);
        let passes_by = |extent: Extent| extent.slabs(tree.node(0), f32::INFINITY).1 == 0;
        if rough.is_some_and(passes_by) {
            return true;
        }
        let Some(extent) = self.fill(&map, None) else {
            return false;
        };
        let mut far = self.packet.beam.farthest(self.s);
        self.packet.stack.clear();
        let (near, mask) = extent.slabs(tree.node(0), far);
        push(&mut self.packet.stack, &boxes_of(0), &near, mask);
        while let Some((place, near)) = self.packet.stack.pop() {
            if near > far {
                continue;
            }
            let (parent, slot) = (tree.node(place / SLOTS), (place % SLOTS) as usize);
            let child = parent.child[slot];
            if child & IS_LEAF == 0 {
                let (near, mask) = extent.slabs(tree.node(child), far);
                push(&mut self.packet.stack, &boxes_of(child), &near, mask);
                continue;
            }
            let lanes = self.packet.beam.to_box(self.s, parent, slot);
            self.looked += 1;
            self.taken += lanes.count_ones();
            if lanes == 0 {
                continue;
            }
            for number in tree.leaf((child & !IS_LEAF) as usize) {
                self.triangle(cluster, number, lanes);
            }
            far = self.packet.beam.farthest(self.s);
            if self.alive == 0 {
                break;
            }
            if self.is_scattered() {
                return false;
            }
        }
        true
    }

    /// Meets one triangle.
    ///
    /// As [`Sheared::meet`]: each corner is seen from a ray alike in all triangles that have it, so that no ray slips
    /// between them.
    #[inline(always)]
    fn triangle(&mut self, cluster: &Cluster<'_>, number: usize, lanes: u64) {
        let s = self.s;
        let corners = cluster.triangles[number].corners;
        let corners = corners.map(|corner| cluster.triangle_tree.to_local(corner));
        for eight in 0..RAYS / WIDE_LANES {
            let own = lanes >> (eight * WIDE_LANES) & 0xff;
            if own == 0 {
                continue;
            }
            let beam = &self.packet.beam;
            let rays = |values: &[f64; RAYS]| s.load_d(&values.as_chunks().0[eight]);
            let ways = corners.map(|p| s.splat_d(p[beam.main] * beam.sign - beam.start));
            let [x, y] = [0, 1].map(|axis| {
                let (origin, slope) = (rays(&beam.origin[axis]), rays(&beam.slope[axis]));
                let side = beam.across[axis];
                [0, 1, 2].map(|k| {
                    let ray = s.fma_d(slope, ways[k], origin);
                    s.sub_d(s.splat_d(corners[k][side]), ray)
                })
            });
            // Signed volumes; not fused, so that those of an edge's other side are the same.
            let volume = |a: usize, b: usize| s.sub_d(s.mul_d(x[a], y[b]), s.mul_d(y[a], x[b]));
            let [u, v, w] = [volume(2, 1), volume(0, 2), volume(1, 0)];
            let zero = s.splat_d(0.0);
            let least = s.min_d(s.min_d(u, v), w);
            let most = s.max_d(s.max_d(u, v), w);
            let beside = s.lt_d(least, zero) & s.lt_d(zero, most);
            let mut met = own & u64::from(!beside);
            if met == 0 {
                continue;
            }
            let sum = s.add_d(s.add_d(u, v), w);
            let way = s.fma_d(w, ways[2], s.fma_d(v, ways[1], s.mul_d(u, ways[0])));
            let time = s.fma_d(s.div_d(way, sum), rays(&beam.pace), rays(&beam.time));
            let (from, until) = (rays(&self.packet.from), rays(&self.packet.until));
            met &= u64::from(s.lt_d(time, until) & !s.lt_d(time, from));
            if met == 0 {
                continue;
            }
            let mut found = [[0.0; WIDE_LANES]; 3];
            for (value, to) in [time, s.div_d(v, sum), s.div_d(w, sum)]
                .into_iter()
                .zip(&mut found)
            {
                s.store_d(value, to);
            }
            for k in Bits(met) {
                let candidate = Candidate {
                    t: found[0][k],
                    instance: self.instance,
                    kind: CandidateKind::Triangle {
                        index: u32::try_from(number).expect("fewer triangles than fit"),
                        barycentric: DVec2::new(found[1][k], found[2][k]),
                    },
                };
                self.take(eight * WIDE_LANES + k, candidate, None);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use kernel::{Child, Item, Mesh, Node, Ray, Scene, Shape};

    use crate::random::Random;
    use crate::simd::Instructions;
    use crate::{Accelerator, METHODS, Workspace};

    const ROWS: usize = 90;
    const COLUMNS: usize = 140;

    /// A ball of triangles with its corners.
    fn faceted() -> (Scene, Vec<DVec3>) {
        let [rows, columns] = [ROWS, COLUMNS].map(|count| u32::try_from(count).unwrap());
        let corners: Vec<DVec3> = (0..=rows)
            .flat_map(|row| {
                (0..columns).map(move |column| {
                    let [down, around] = [
                        std::f64::consts::PI * f64::from(row) / f64::from(rows),
                        std::f64::consts::TAU * f64::from(column) / f64::from(columns),
                    ];
                    let (sin, cos) = down.sin_cos();
                    DVec3::new(sin * around.cos(), sin * around.sin(), cos)
                })
            })
            .collect();
        let quads = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let triangles = quads.flat_map(|(row, column)| {
            let at = |row, column| row * columns + column % columns;
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            [[a, c, b], [b, c, d]]
        });
        let (none, other) = (Vec::new(), Vec::new());
        let mesh = Mesh::new(corners.clone(), none, other, triangles.collect()).unwrap();
        let mut scene = Scene::default();
        let shape = Shape::Mesh(scene.add_mesh(mesh).unwrap());
        let mut root = Node::default();
        let material = None;
        root.children.push(Child::Item(Item { shape, material }));
        let root = scene.add_node(root).unwrap();
        scene.set_root(root).unwrap();
        (scene, corners)
    }

    #[test]
    fn no_ray_slips_between_triangles_and_packets_see_what_rays_see() {
        let (scene, corners) = faceted();
        let mut numbers = Random(5);
        for instructions in Instructions::ALL {
            let accelerator =
                Accelerator::build(&scene, &METHODS[0]).with_instructions(instructions);
            let mut other = Workspace::default();
            let (mut hits, mut blocked, mut passed, mut together) = (Vec::new(), Vec::new(), 0, 0);
            for round in 0..200 {
                let mut room = Workspace::default();
                let eye = numbers.vector().normalize() * 3.0;
                // At corners side by side, at the middles of sides, and anywhere around a place, also beside the ball.
                let first = round % (ROWS - 8) * COLUMNS + round * 7 % (COLUMNS - 9);
                let around = numbers.vector() * 1.1;
                let aim = |k: usize, numbers: &mut Random| {
                    let corner = first + k / 8 * COLUMNS + k % 8;
                    match round % 3 {
                        0 => corners[corner],
                        1 => corners[corner].midpoint(corners[corner + 1]),
                        _ => around + numbers.vector() * 0.1,
                    }
                };
                let rays: Vec<Ray> = (0..64 - round % 3)
                    .map(|k| Ray {
                        origin: eye,
                        direction: aim(k, &mut numbers) - eye,
                    })
                    .collect();
                let ranges = vec![0.0..f64::INFINITY; rays.len()];
                accelerator.nearest_many(&rays, &ranges, &mut room, &mut hits);
                accelerator.any_many(&rays, &ranges, &mut room, &mut blocked);
                for (k, ray) in rays.iter().enumerate() {
                    // At what bounds the ball as the eye sees it rounding decides.
                    let at = ray.at(1.0).normalize();
                    if round % 3 < 2 && at.dot(ray.direction.normalize()).abs() < 0.4 {
                        continue;
                    }
                    let alone = accelerator.nearest(ray, ranges[k].clone(), &mut other);
                    assert_eq!(hits[k].is_some(), alone.is_some(), "{ray:?}");
                    assert_eq!(blocked[k], alone.is_some(), "{ray:?}");
                    assert!(round % 3 == 2 || alone.is_some(), "{ray:?}");
                    let (Some(hit), Some(alone)) = (hits[k], alone) else {
                        passed += 1;
                        continue;
                    };
                    assert!((hit.t - alone.t).abs() < 1e-13, "{ray:?}");
                    assert!((hit.point - alone.point).length() < 1e-13);
                }
                together += u32::from(room.packet.walkers.is_empty());
            }
            assert!(together > 150, "only {together} packets stay together");
            assert!(passed > 50, "only {passed} rays pass by");
        }
    }
}
