//! How the rays of a beam pass eight cells, for all of them at once and for sixteen at a time.
//!
//! Each cell lies in a box along its frame. A line meets a box only if it does in each of the three
//! views along the axes of the box. What the line is beside the middle there, times its advance, is
//! `n w + d (w x m)` where `w` is the ray's place beside that of the cell, both across the beam, and
//! `m` how its slope differs from that of the beam's middle: nothing is divided, so that cells seen
//! from their edge are no worse than others.

use super::{Block, GROWTH};
use crate::accelerator::approach::{STEEPEST, load};
use crate::accelerator::beam::{Beam, RAYS};
use crate::accelerator::hull::{BeamBounds, PADDING};
use crate::accelerator::leaf::Bits;
use crate::accelerator::tree::WIDTH;
use crate::accelerator::windows::group_of;
use crate::simd::{LANES, Part, Simd};

/// Rounding errors of products and sums in single precision, many roundings wide.
const ROUNDING: f32 = 32.0 / (1 << 24) as f32;

/// Two coordinates of a cell, and the third, along which they are seen. The signs of determinants
/// follow from the order.
const ASPECTS: [[usize; 3]; 3] = [[0, 1, 2], [1, 2, 0], [2, 0, 1]];

/// How a beam comes to eight cells.
#[repr(align(32))]
pub(in crate::accelerator) struct Crossings {
    /// A bit for each cell that some of the rays may meet.
    pub(in crate::accelerator) met: u32,
    /// One where all rays certainly miss the cell.
    beside: [u32; WIDTH],
    /// Nothing of the cell is met before this.
    near: [f32; WIDTH],
    /// From the start of the beam to the middle of the cell.
    way: [f32; WIDTH],
    /// How far the middle of the beam is then beside that of the cell.
    aside: [[f32; WIDTH]; 2],
    /// The three views: `n`, `d`, and what a ray that meets the cell does not exceed.
    aspects: [Aspect; 3],
    /// Rays meet nothing of the cell before `first` less the product of `steep` with `w`.
    first: [f32; WIDTH],
    steep: [[f32; WIDTH]; 2],
}

/// Eight cells seen along one of their axes.
#[derive(Clone, Copy)]
struct Aspect {
    across: [[f32; WIDTH]; 2],
    turn: [f32; WIDTH],
    limit: [f32; WIDTH],
}

impl Aspect {
    const NONE: Self = Self {
        across: [[0.0; WIDTH]; 2],
        turn: [0.0; WIDTH],
        limit: [0.0; WIDTH],
    };
}

impl Crossings {
    const NONE: Self = Self {
        met: 0,
        beside: [0; WIDTH],
        near: [0.0; WIDTH],
        way: [0.0; WIDTH],
        aside: [[0.0; WIDTH]; 2],
        aspects: [Aspect::NONE; 3],
        first: [0.0; WIDTH],
        steep: [[0.0; WIDTH]; 2],
    };

    /// The cells that may be met, nearest first, each with where it may begin, replace `found`;
    /// the result is their number.
    #[inline(always)]
    pub(in crate::accelerator) fn sorted(&self, found: &mut [(usize, f32); WIDTH]) -> usize {
        let mut count = 0;
        for slot in Bits(u64::from(self.met)) {
            let near = self.near[slot];
            let mut place = count;
            while place > 0 && found[place - 1].1 > near {
                found[place] = found[place - 1];
                place -= 1;
            }
            found[place] = (slot, near);
            count += 1;
        }
        count
    }

    /// Those of the given rays of the beam that may meet the cell in `slot`, before what they have met so far.
    #[inline(always)]
    pub(in crate::accelerator) fn rays<S: Simd>(
        &self,
        s: S,
        slot: usize,
        (beam, lanes): (&Beam, u64),
    ) -> u64 {
        let way = s.splat(self.way[slot]);
        let [x, y] = &self.aside;
        let (x, y) = (s.splat(x[slot]), s.splat(y[slot]));
        let mut rays = 0;
        for group in 0..RAYS / LANES {
            if group_of(lanes, group) == 0 {
                continue;
            }
            let turn1 = load(s, &beam.spread.turn[0], group);
            let turn2 = load(s, &beam.spread.turn[1], group);
            let w1 = s.fma(turn1, way, s.add(x, load(s, &beam.spread.offset[0], group)));
            let w2 = s.fma(turn2, way, s.add(y, load(s, &beam.spread.offset[1], group)));
            let turned = s.fnma(w2, turn1, s.mul(w1, turn2));
            // What is not a number passes.
            let [steep1, steep2] = &self.steep;
            let later = s.fnma(s.splat(steep2[slot]), w2, s.splat(self.first[slot]));
            let near = s.fnma(s.splat(steep1[slot]), w1, later);
            let near = s.max(near, s.splat(self.near[slot]));
            let mut beside = s.bits(s.lt(load(s, &beam.spread.far, group), near));
            if beside == 0xffff {
                continue;
            }
            for aspect in &self.aspects {
                let [n1, n2] = &aspect.across;
                let rest = s.fma(
                    s.splat(n2[slot]),
                    w2,
                    s.mul(s.splat(aspect.turn[slot]), turned),
                );
                let place = s.abs(s.fma(s.splat(n1[slot]), w1, rest));
                beside |= s.bits(s.lt(s.splat(aspect.limit[slot]), place));
            }
            rays |= u64::from(!beside & 0xffff) << (group * LANES);
        }
        rays & lanes
    }
}

impl Block {
    /// How a beam comes to the cells, of which nothing beyond `far` is of interest.
    #[inline(always)]
    pub(in crate::accelerator) fn crossings<S: Simd>(
        &self,
        s: S,
        beam: &BeamBounds,
        far: f32,
    ) -> Crossings {
        s.apart(OfBeam(self, beam, far))
    }

    /// The cell in slot `k`, as a beam comes to it.
    #[inline(always)]
    fn coming(&self, k: usize, beam: &BeamBounds) -> Coming {
        let axes = beam.across;
        let zeta = self.center[beam.main][k] * beam.sign;
        let way = zeta - beam.start;
        let aside = [
            beam.origin[0] + beam.slope[0] * way - self.center[axes[0]][k],
            beam.origin[1] + beam.slope[1] * way - self.center[axes[1]][k],
        ];
        let spread = [
            beam.origin_radius[0] + beam.slope_radius[0] * way.abs(),
            beam.origin_radius[1] + beam.slope_radius[1] * way.abs(),
        ];
        let wide = [aside[0].abs() + spread[0], aside[1].abs() + spread[1]];
        let error = [
            PADDING * (1.0 + beam.origin[0].abs() + wide[0] + way.abs()),
            PADDING * (1.0 + beam.origin[1].abs() + wide[1] + way.abs()),
        ];
        let weight_stray = self.stray[3][k];
        let room = GROWTH * (1.0 - weight_stray).recip();
        let is_bounded = weight_stray < 1.0;
        let room = if is_bounded { room } else { f32::INFINITY };
        let [h1, h2, h3] = &self.bulge;
        let half = [(1.0 + h1[k]) * room, (1.0 + h2[k]) * room, h3[k] * room];
        let mut coming = Coming {
            zeta,
            way,
            aside,
            spread,
            half,
            ..Coming::default()
        };
        coming.twist = wide[0] * beam.slope_radius[1] + wide[1] * beam.slope_radius[0];
        for r in 0..3 {
            let a = [self.rows[r][axes[0]][k], self.rows[r][axes[1]][k]];
            let along = self.rows[r][beam.main][k] * beam.sign;
            let advance = a[0] * beam.slope[0] + a[1] * beam.slope[1] + along;
            let size = STEEPEST * sum(a, [1.0; 2]) + along.abs();
            (coming.across[r], coming.along[r]) = (a, along);
            (coming.advance[r], coming.size[r]) = (advance, size);
            coming.change[r] = sum(a, beam.slope_radius);
            coming.fastest[r] = advance.abs() + coming.change[r] + size * ROUNDING;
            coming.farthest[r] = sum(a, wide);
            coming.reach[r] = coming.half[r] + sum(a, error);
        }
        coming
    }
}

/// A cell as a beam comes to it, in coordinates across the beam and along it.
#[derive(Default)]
struct Coming {
    /// Its middle along the beam, and the way there from the start of the beam.
    zeta: f32,
    way: f32,
    /// How far the middle of the beam is there beside that of the cell, and rays beside that.
    aside: [f32; 2],
    spread: [f32; 2],
    /// No product of place and change of slope across is greater.
    twist: f32,
    /// The rows of its frame.
    across: [[f32; 2]; 3],
    along: [f32; 3],
    /// Half of its size along the rows, and with what is uncertain of places.
    half: [f32; 3],
    reach: [f32; 3],
    /// Advance of the middle of the beam along the rows, by how much that of rays differs, what
    /// none exceeds, and the terms of which it is made.
    advance: [f32; 3],
    change: [f32; 3],
    fastest: [f32; 3],
    size: [f32; 3],
    /// How far any ray is from the middle of the cell.
    farthest: [f32; 3],
}

impl Coming {
    /// Whether no ray meets the cell in one of the three views, which slot `k` takes, and half of
    /// the length of the cell along the beam.
    #[inline(always)]
    fn aspects(&self, k: usize, aspects: &mut [Aspect; 3]) -> (bool, f32) {
        let (a, d) = (&self.across, &self.advance);
        let mut beside = false;
        // The length follows from the inverse of the rows.
        let (mut length, mut determinant, mut uncertain) = (0.0, 0.0, 0.0_f32);
        for (aspect, [q, r, other]) in aspects.iter_mut().zip(ASPECTS) {
            let turn = a[q][0] * a[r][1] - a[q][1] * a[r][0];
            let n = [
                a[q][0] * d[r] - a[r][0] * d[q],
                a[q][1] * d[r] - a[r][1] * d[q],
            ];
            let terms = self.farthest[q] * self.size[r] + self.farthest[r] * self.size[q];
            let limit = self.reach[q] * self.fastest[r]
                + self.reach[r] * self.fastest[q]
                + terms * ROUNDING;
            let middle = (n[0] * self.aside[0] + n[1] * self.aside[1]).abs();
            let room = sum(n, self.spread) + turn.abs() * self.twist;
            beside |= middle - room * GROWTH > limit;
            let blur = sum(a[q], [1.0; 2]) * sum(a[r], [1.0; 2]) * ROUNDING;
            length += (turn.abs() + blur) * self.half[other];
            determinant += turn * self.along[other];
            uncertain += blur * self.along[other].abs();
            (aspect.across[0][k], aspect.across[1][k]) = (n[0], n[1]);
            (aspect.turn[k], aspect.limit[k]) = (turn, limit);
        }
        let least = (determinant.abs() - uncertain).recip();
        let length = length * least * GROWTH;
        (beside, if least > 0.0 { length } else { f32::INFINITY })
    }

    /// From where to where along the beam rays may meet the cell of the given length; slot `k`
    /// takes what that is for each.
    #[inline(always)]
    fn depth(&self, k: usize, length: f32, lanes: &mut Crossings) -> [f32; 2] {
        let [_, _, [x, y]] = self.across;
        let [_, _, advance] = self.advance;
        let [_, _, change] = self.change;
        let [_, _, farthest] = self.farthest;
        // Where the tangent plane is crossed tells more than the length, unless some ray may run
        // along it.
        let inverse = advance.recip();
        let least = (advance.abs() - change).recip();
        let least = if least > 0.0 { least } else { f32::INFINITY };
        let blurred = farthest * (self.size[2] * least + 1.0) * ROUNDING;
        let late = (self.reach[2] + blurred) * least;
        let time = -(x * self.aside[0] + y * self.aside[1]) * inverse;
        let apart = (sum([x, y], self.spread) + time.abs() * change) * least;
        let (before, after) = (
            time - (apart + late) * GROWTH,
            time + (apart + late) * GROWTH,
        );
        let before = if before > -length { before } else { -length };
        let after = if after < length { after } else { length };
        // The steepness is that of the middle.
        let other = farthest * change * least * inverse.abs();
        let padding = PADDING * (1.0 + self.zeta.abs());
        lanes.first[k] = self.zeta - (other + late) * GROWTH - padding;
        (lanes.steep[0][k], lanes.steep[1][k]) = (x * inverse, y * inverse);
        [
            self.zeta + before - PADDING * before.abs() - padding,
            self.zeta + after + PADDING * after.abs() + padding,
        ]
    }
}

/// The sum of the sizes of two coordinates, each times another.
#[inline(always)]
fn sum([a, b]: [f32; 2], [x, y]: [f32; 2]) -> f32 {
    a.abs() * x + b.abs() * y
}

/// Asks the cells of a block about a beam. In many places it would not be compiled for eight cells
/// at once.
struct OfBeam<'a>(&'a Block, &'a BeamBounds, f32);

impl<S: Simd> Part<S> for OfBeam<'_> {
    type Output = Crossings;

    #[inline(always)]
    fn run(self, _: S) -> Self::Output {
        let Self(block, beam, far) = self;
        let mut lanes = Crossings::NONE;
        // Without branches, for eight cells at once.
        for k in 0..WIDTH {
            let coming = block.coming(k, beam);
            let (beside, length) = coming.aspects(k, &mut lanes.aspects);
            let [near, last] = coming.depth(k, length, &mut lanes);
            let beside = beside | (near > far) | (last < beam.least_near);
            lanes.beside[k] = u32::from(beside);
            let is_known = near > f32::NEG_INFINITY;
            lanes.near[k] = if is_known { near } else { f32::NEG_INFINITY };
            lanes.way[k] = coming.way;
            (lanes.aside[0][k], lanes.aside[1][k]) = (coming.aside[0], coming.aside[1]);
        }
        lanes.met = block.those_not(&lanes.beside);
        lanes
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use kernel::{Child, Item, KnotVector, Node, Patch, Ray, Scene, Shape, Surface};

    use super::*;
    use crate::accelerator::beam::Rays;
    use crate::accelerator::{Accelerator, Cluster};
    use crate::intersect::METHODS;
    use crate::intersect::net::evaluate_at;
    use crate::random::Random;
    use crate::simd::Portable;

    /// A bent bicubic patch, with weights or without.
    fn scene(random: &mut Random, is_rational: bool) -> Scene {
        let points = (0..16).map(|k| {
            let place = DVec3::new(f64::from(k / 4), f64::from(k % 4), 0.0);
            place + random.vector() * DVec3::new(0.2, 0.2, 1.0)
        });
        let points: Vec<_> = points.collect();
        let weights: Vec<_> = (0..16).map(|_| 1.0 + random.unit()).collect();
        let knots = KnotVector::bezier(3, 0.0..1.0).unwrap();
        let weights = is_rational.then_some(&weights[..]);
        let surface = Surface::new(knots.clone(), knots, &points, weights).unwrap();
        let mut scene = Scene::default();
        let patch = scene.add_patch(Patch::from(surface)).unwrap();
        let node = Node {
            children: vec![Child::Item(Item {
                shape: Shape::Patch(patch),
                material: None,
            })],
            ..Node::default()
        };
        let root = scene.add_node(node).unwrap();
        scene.set_root(root).unwrap();
        scene
    }

    /// A point of a cell.
    fn point(cluster: &Cluster<'_>, block: &Block, slot: usize, random: &mut Random) -> DVec3 {
        let cell = block.cells[slot];
        let piece = cluster.piece(cell.piece);
        let rect = cell.rect();
        let mut within = |(a, b): (f64, f64)| a + (b - a) * random.unit();
        let (u, v) = (within(rect.u), within(rect.v));
        let [[x, y, z, w], ..] = evaluate_at(&cluster.net(piece), u, v).map(|h| h.to_array());
        piece.center + DVec3::new(x, y, z) / w * piece.radius
    }

    /// Rays to the targets, and a little beyond, unless they do not run side by side.
    fn beam(
        cluster: &Cluster<'_>,
        targets: &[DVec3],
        away: DVec3,
        random: &mut Random,
    ) -> Option<Beam> {
        let rays: Vec<Ray> = targets
            .iter()
            .map(|&target| {
                let origin = target + away * 3.0 + random.vector() * 0.02;
                Ray {
                    origin,
                    direction: target - origin,
                }
            })
            .collect();
        let mut side_by_side = Rays::NONE;
        side_by_side.gather(&rays);
        let (mut beam, mut local) = (Beam::NONE, Rays::NONE);
        let ranges = (&[0.0; RAYS], &[1.0 + 1e-9; RAYS]);
        let place = (&cluster.tree.map(), None);
        let rays = (&side_by_side, u64::MAX);
        let coherent = beam.fill(Portable, rays, place, ranges, &mut local);
        coherent.then_some(beam)
    }

    #[test]
    fn rays_to_a_cell_are_not_told_to_miss_it() {
        let mut random = Random(5);
        // Rays to the cell, and those to all cells that may meet it.
        let (mut met, mut others) = (0, 0);
        for k in 0..400 {
            let scene = scene(&mut random, k % 2 == 1);
            let accelerator = Accelerator::build(&scene, &METHODS[0]);
            let cluster = &accelerator.clusters[0];
            for block in &cluster.blocks {
                for slot in 0..block.count as usize {
                    let point = |random: &mut _| point(cluster, block, slot, random);
                    let targets: Vec<_> = (0..RAYS).map(|_| point(&mut random)).collect();
                    let mut away = random.vector().normalize();
                    if k % 4 > 1 {
                        // From the edge, as good as exactly.
                        let side = (targets[1] - targets[0]).normalize();
                        away = (side + away * 10.0_f64.powf(-6.0 * random.unit())).normalize();
                    }
                    let Some(beam) = beam(cluster, &targets, away, &mut random) else {
                        continue;
                    };
                    let bounds = beam.extent.bounds();
                    let far = beam.farthest(Portable);
                    let crossings = block.crossings(Portable, &bounds, far);
                    assert_eq!(crossings.met >> slot & 1, 1);
                    let rays = crossings.rays(Portable, slot, (&beam, u64::MAX));
                    assert_eq!(rays, u64::MAX, "{k} {slot}");
                    for other in 0..block.count as usize {
                        others += crossings
                            .rays(Portable, other, (&beam, u64::MAX))
                            .count_ones();
                    }
                    met += 64;
                }
            }
        }
        assert!(met > 500_000, "{met}");
        // Cells are as good as flat boxes, of which neighbours hide few.
        assert!(others < 2 * met, "{others} of {met}");
    }
}
