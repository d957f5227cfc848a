//! Bounds over the rays of a packet, from which boxes and cells are told that none of them meets.

use std::ops::Range;

use glam::{DAffine3, DVec3};
use kernel::{Aabb, Ray};

use super::leaf::Bits;
use super::tree::{IS_LEAF, Node, Tree, WIDTH};
use crate::simd::{Simd, WIDE_LANES};

/// Errors of positions in single precision, many roundings wide.
pub(super) const PADDING: f32 = 64.0 / (1 << 24) as f32;

/// Rounding errors of places in double precision, many roundings wide.
const PASSING: f64 = 1e-12;

/// Chains of comparisons side by side.
const CHAINS: usize = 4;

/// The two axes beside each.
pub(super) const ACROSS: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

/// Growth of bounds that covers a rounding.
const GROWTH: f32 = 1.0 + 1e-6;

/// Rays of a beam may spread over this much of the hierarchy; wider ones are traced alone.
pub(super) const WIDEST: f64 = 0.5;

#[inline(always)]
pub(super) fn lesser<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

#[inline(always)]
pub(super) fn greater<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

/// Bounds of the coordinates of rays.
pub(super) struct Hull {
    /// Least and greatest: of origins, of directions, of where ranges begin and end.
    low: [f64; WIDE_LANES],
    high: [f64; WIDE_LANES],
}

impl Hull {
    /// Where directions stand, and the bounds of ranges.
    const DIRECTION: usize = 3;
    const FROM: usize = 6;

    #[inline(always)]
    pub(super) fn of<S: Simd>(s: S, rays: &[Ray], ranges: &[Range<f64>]) -> Self {
        // Several at a time, so that none waits for the one before.
        let mut least = [s.splat_d(f64::INFINITY); CHAINS];
        let mut most = [s.splat_d(f64::NEG_INFINITY); CHAINS];
        let (many, rest) = rays.as_chunks::<CHAINS>();
        let (their, rest_of) = ranges.as_chunks::<CHAINS>();
        let all = |ray: &Ray, range: &Range<f64>| {
            let (o, d, from) = (ray.origin, ray.direction, range.start);
            s.load_d(&[o.x, o.y, o.z, d.x, d.y, d.z, from, range.end])
        };
        for (rays, ranges) in many.iter().zip(their) {
            for k in 0..CHAINS {
                let all = all(&rays[k], &ranges[k]);
                (least[k], most[k]) = (s.min_d(all, least[k]), s.max_d(all, most[k]));
            }
        }
        for (ray, range) in rest.iter().zip(rest_of) {
            let all = all(ray, range);
            (least[0], most[0]) = (s.min_d(all, least[0]), s.max_d(all, most[0]));
        }
        for k in 1..CHAINS {
            least[0] = s.min_d(least[k], least[0]);
            most[0] = s.max_d(most[k], most[0]);
        }
        let (least, most) = (least[0], most[0]);
        let mut hull = Self {
            low: [0.0; WIDE_LANES],
            high: [0.0; WIDE_LANES],
        };
        s.store_d(least, &mut hull.low);
        s.store_d(most, &mut hull.high);
        hull
    }

    /// The rays as a beam in the coordinates of a hierarchy, see [`super::beam::Beam::fill`].
    /// Nothing if they do not run side by side, as far as this tells.
    #[inline(always)]
    pub(super) fn extent(&self, map: &DAffine3) -> Option<Extent> {
        let turned = |first: usize| {
            let part = |values: &[f64; WIDE_LANES]| DVec3::from_slice(&values[first..]);
            let (low, high) = (part(&self.low), part(&self.high));
            let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
            let size = |v: DVec3| {
                let m = &map.matrix3;
                m.x_axis.abs() * v.x + m.y_axis.abs() * v.y + m.z_axis.abs() * v.z
            };
            (map.matrix3 * middle, size(half))
        };
        let ((origin, room), (direction, turn)) = (turned(0), turned(Self::DIRECTION));
        let origin = origin + map.translation;
        let main = direction.abs().max_position();
        let sign = direction[main].signum();
        let (slow, fast) = (
            direction[main].abs() - turn[main],
            direction[main].abs() + turn[main],
        );
        // What is not a number is not side by side, either.
        let is_forward = slow > 0.5 * fast && (origin + room).is_finite();
        if !is_forward {
            return None;
        }
        let (first, last) = (
            origin[main] * sign - room[main],
            origin[main] * sign + room[main],
        );
        let from = self.low[Self::FROM];
        let start = (first + from * if from < 0.0 { fast } else { slow }).max(-1.0);
        let mut extent = Extent {
            last,
            fastest: fast,
            ..Extent::new(main, sign, start)
        };
        // The way from where rays begin to the start, along the main axis.
        let (near, far) = (start - last, start - first);
        for (axis, side) in ACROSS[main].into_iter().enumerate() {
            let (fall, rise) = (direction[side] - turn[side], direction[side] + turn[side]);
            let low = fall / if fall < 0.0 { slow } else { fast };
            let high = rise / if rise < 0.0 { fast } else { slow };
            let (a, b, c, d) = (low * near, low * far, high * near, high * far);
            let least = lesser(lesser(a, b), lesser(c, d));
            let most = greater(greater(a, b), greater(c, d));
            let (lowest, highest) = (
                origin[side] - room[side] + least,
                origin[side] + room[side] + most,
            );
            if highest - lowest > WIDEST || high - low > WIDEST {
                return None;
            }
            extent.put(axis, [lowest, highest], [low, high]);
        }
        Some(extent)
    }

    /// Whether no ray comes to a box, as far as this tells along the axis along which they advance
    /// most.
    #[inline(always)]
    pub(super) fn passes_by(&self, target: &Aabb) -> bool {
        let (least, most) = (&self.low[Self::DIRECTION..], &self.high[Self::DIRECTION..]);
        let (mut main, mut slow) = (0, 0.0);
        for axis in 0..3 {
            let advance = greater(least[axis], -most[axis]);
            if advance > slow {
                (main, slow) = (axis, advance);
            }
        }
        // They may run to both sides, or back.
        if slow <= 0.0 || self.low[Self::FROM] < 0.0 {
            return false;
        }
        let (low, high) = (&self.low, &self.high);
        let fast = greater(most[main], -least[main]);
        // The way along the main axis to either side of the box, none back.
        let (near, far) = if least[main] > 0.0 {
            (target.min[main] - high[main], target.max[main] - low[main])
        } else {
            (low[main] - target.max[main], high[main] - target.min[main])
        };
        let (near, far) = (greater(near, 0.0), greater(far, 0.0));
        let reach = greater(low[main].abs(), high[main].abs()) + far;
        let (pace, slowest) = (fast.recip(), slow.recip());
        let mut apart = false;
        for axis in 0..3 {
            let fall = least[axis] * if least[axis] < 0.0 { slowest } else { pace };
            let rise = most[axis] * if most[axis] < 0.0 { pace } else { slowest };
            let lowest = low[axis] + fall * if fall < 0.0 { far } else { near };
            let highest = high[axis] + rise * if rise < 0.0 { near } else { far };
            let size = greater(low[axis].abs(), high[axis].abs());
            let room = PASSING * (size + reach * (1.0 + greater(fall.abs(), rise.abs())));
            apart |= axis != main
                && (lowest - room > target.max[axis] || highest + room < target.min[axis]);
        }
        apart
    }
}

/// Bounds over all rays of a beam, at and from its start.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) main: usize,
    across: [usize; 2],
    sign: f32,
    start: f32,
    /// Least and greatest position and slope.
    low: [f32; 2],
    high: [f32; 2],
    low_slope: [f32; 2],
    high_slope: [f32; 2],
    least_near: f32,
    /// The farthest origin along the main axis, and the fastest advance with the ray parameter.
    last: f64,
    fastest: f64,
}

impl Extent {
    pub(super) const NONE: Self = Self {
        main: 2,
        across: [0, 1],
        sign: 1.0,
        start: 0.0,
        low: [0.0; 2],
        high: [0.0; 2],
        low_slope: [0.0; 2],
        high_slope: [0.0; 2],
        least_near: 0.0,
        last: f64::INFINITY,
        fastest: f64::INFINITY,
    };

    /// Of rays that advance along an axis, from `start` on.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "what follows from it is widened"
    )]
    pub(super) fn new(main: usize, sign: f64, start: f64) -> Self {
        let start = start as f32;
        Self {
            main,
            across: ACROSS[main],
            sign: sign as f32,
            start,
            least_near: start - PADDING,
            ..Self::NONE
        }
    }

    /// Takes least and greatest position and slope along an axis across, a little widened.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "widened by more than the rounding"
    )]
    pub(super) fn put(
        &mut self,
        axis: usize,
        [low, high]: [f64; 2],
        [low_slope, high_slope]: [f64; 2],
    ) {
        let padding = PADDING * (1.0 + greater(low.abs(), high.abs()) as f32);
        self.low[axis] = low as f32 - padding;
        self.high[axis] = high as f32 + padding;
        self.low_slope[axis] = low_slope as f32 - PADDING;
        self.high_slope[axis] = high_slope as f32 + PADDING;
    }

    /// Where along the beam it may enter each box of a node, and a bit for each that it may
    /// meet before `far`.
    #[inline(always)]
    pub(super) fn slabs(&self, node: &Node, far: f32) -> ([f32; WIDTH], u32) {
        let (min, max) = (&node.min, &node.max);
        let forward = self.sign > 0.0;
        let start = self.start;
        let mut near = [0.0; WIDTH];
        let mut pass = [true; WIDTH];
        let mut end = [0.0; WIDTH];
        for k in 0..WIDTH {
            let (a, b) = if forward {
                (min[self.main][k], max[self.main][k])
            } else {
                (-max[self.main][k], -min[self.main][k])
            };
            near[k] = if a > start { a } else { start };
            end[k] = b;
            pass[k] = b >= self.least_near && a <= far;
        }
        for axis in 0..2 {
            let side = self.across[axis];
            let (low, high) = (self.low[axis], self.high[axis]);
            let (low_slope, high_slope) = (self.low_slope[axis], self.high_slope[axis]);
            for k in 0..WIDTH {
                let (a, b) = (near[k] - start, end[k] - start);
                let least = low + low_slope * if low_slope < 0.0 { b } else { a };
                let most = high + high_slope * if high_slope > 0.0 { b } else { a };
                pass[k] = pass[k] & (least <= max[side][k]) & (most >= min[side][k]);
            }
        }
        let mask = (0..WIDTH).fold(0, |bits, k| bits | u32::from(pass[k]) << k);
        (near, mask)
    }

    /// Whether `tell` says so of one of the leaves of a hierarchy that a ray may come to before `far`. What is on the
    /// stack stays there.
    #[inline(always)]
    pub(super) fn comes_to_leaf(
        &self,
        tree: &Tree,
        far: f32,
        stack: &mut Vec<(u32, f32)>,
        mut tell: impl FnMut(usize, &mut Vec<(u32, f32)>) -> bool,
    ) -> bool {
        let base = stack.len();
        tree.begin(stack);
        while stack.len() > base {
            let Some((child, _)) = stack.pop() else { break };
            if child & IS_LEAF == 0 {
                let node = tree.node(child);
                let (near, mask) = self.slabs(node, far);
                stack.extend(Bits(u64::from(mask)).map(|k| (node.child[k], near[k])));
            } else if tell((child & !IS_LEAF) as usize, stack) {
                stack.truncate(base);
                return true;
            }
        }
        false
    }

    /// Whether a ray may come as near as `radius` to the line between two ends.
    #[inline(always)]
    pub(super) fn comes_to(&self, ends: [DVec3; 2], radius: f64) -> bool {
        let (mut from, mut to, mut room) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        for axis in 0..2 {
            let [low, high] = [self.low, self.high].map(|of| f64::from(of[axis]));
            let [fall, rise] = [self.low_slope, self.high_slope].map(|of| f64::from(of[axis]));
            // What is so near may be as much farther along the beam.
            let steep = greater(fall.abs(), rise.abs());
            let way = ends.map(|end| end[self.main] * f64::from(self.sign) - f64::from(self.start));
            let long = greater(way[0].abs(), way[1].abs());
            room[axis] = 0.5 * (high - low + (rise - fall) * long) + radius * (1.0 + steep);
            let off = |k: usize| {
                let middle = 0.5 * (low + high + (fall + rise) * way[k]);
                ends[k][self.across[axis]] - middle
            };
            (from[axis], to[axis]) = (off(0), off(1));
        }
        let beside = |axis: usize| {
            lesser(from[axis], to[axis]) > room[axis] || greater(from[axis], to[axis]) < -room[axis]
        };
        let way = [to[0] - from[0], to[1] - from[1]];
        let apart = (from[0] * way[1] - from[1] * way[0]).abs();
        !beside(0) && !beside(1) && apart <= room[0] * way[1].abs() + room[1] * way[0].abs()
    }

    /// No ray is farther at the ray parameter `until`.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "widened by more than the rounding"
    )]
    pub(super) fn reach(&self, until: f64) -> f32 {
        let far = (self.last + until.max(0.0) * self.fastest) as f32;
        far + far.abs() * PADDING + PADDING
    }

    /// The middle, and how far rays are from it.
    #[inline(always)]
    pub(super) fn bounds(&self) -> BeamBounds {
        let mut bounds = BeamBounds {
            main: self.main,
            across: self.across,
            sign: self.sign,
            start: self.start,
            origin: [0.0; 2],
            slope: [0.0; 2],
            origin_radius: [0.0; 2],
            slope_radius: [0.0; 2],
            least_near: self.least_near,
        };
        for axis in 0..2 {
            bounds.origin[axis] = 0.5 * (self.low[axis] + self.high[axis]);
            bounds.slope[axis] = 0.5 * (self.low_slope[axis] + self.high_slope[axis]);
            // What is halved is rounded.
            bounds.origin_radius[axis] = 0.5 * (self.high[axis] - self.low[axis]) * GROWTH;
            bounds.slope_radius[axis] =
                0.5 * (self.high_slope[axis] - self.low_slope[axis]) * GROWTH;
        }
        bounds
    }
}

/// The middle of a beam and how far its rays are from it, for tests of the whole beam.
#[derive(Clone, Copy, Debug)]
pub(super) struct BeamBounds {
    pub(super) main: usize,
    pub(super) across: [usize; 2],
    pub(super) sign: f32,
    pub(super) start: f32,
    pub(super) origin: [f32; 2],
    pub(super) slope: [f32; 2],
    pub(super) origin_radius: [f32; 2],
    pub(super) slope_radius: [f32; 2],
    pub(super) least_near: f32,
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;
    use crate::accelerator::beam::RAYS;
    use crate::random::Random;
    use crate::simd::Portable;

    /// So many rays whose origins and directions spread about some.
    fn bundle(
        random: &mut Random,
        [origin, direction]: [DVec3; 2],
        spread: f64,
        count: usize,
    ) -> Vec<Ray> {
        let ray = |_| Ray {
            origin: origin + random.vector() * spread,
            direction: direction + random.vector() * spread,
        };
        (0..count).map(ray).collect()
    }

    /// Whether a ray meets a box from its origin on.
    fn meets(ray: &Ray, target: &Aabb) -> bool {
        let (mut near, mut far) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let inverse = ray.direction[axis].recip();
            let a = (target.min[axis] - ray.origin[axis]) * inverse;
            let b = (target.max[axis] - ray.origin[axis]) * inverse;
            (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
        }
        near <= far
    }

    #[test]
    fn rays_that_pass_by_a_box_do_not_meet_it() {
        let mut random = Random(7);
        let (mut passed, mut missed) = (0, 0);
        for _ in 0..4000 {
            let corner = random.vector();
            let target = Aabb::around([corner, corner + random.vector() * 0.7]);
            let (origin, direction) = (random.vector() * 4.0, random.vector());
            let spread = (random.vector() * 0.1).abs().max_element();
            let rays = bundle(&mut random, [origin, direction], spread, RAYS);
            let ranges = vec![0.0..f64::INFINITY; rays.len()];
            let met = rays.iter().any(|ray| meets(ray, &target));
            if Hull::of(Portable, &rays, &ranges).passes_by(&target) {
                assert!(!met, "{target:?} {rays:?}");
                passed += 1;
            }
            missed += u32::from(!met);
        }
        assert!(
            passed > 2 * missed / 3 && passed > 1000,
            "{passed} of {missed}"
        );
    }

    #[test]
    fn a_beam_comes_to_all_that_its_rays_come_to() {
        let mut random = Random(13);
        let (mut known, mut beside) = (0, 0);
        for _ in 0..4000 {
            let spread = random.vector().abs().max_element() * 0.1;
            let (origin, direction) = (random.vector(), random.vector());
            let rays = bundle(&mut random, [origin, direction], spread, 7);
            let ranges = vec![f64::NEG_INFINITY..f64::INFINITY; rays.len()];
            let hull = Hull::of(Portable, &rays, &ranges);
            let Some(extent) = hull.extent(&DAffine3::IDENTITY) else {
                continue;
            };
            let ends = [random.vector(), random.vector()];
            let radius = random.unit() * 0.05;
            // The distance between two lines, where these are nearest between the ends.
            let way = ends[1] - ends[0];
            let meets = rays.iter().any(|ray| {
                let across = ray.direction.cross(way);
                let gap = ends[0] - ray.origin;
                let share = gap.cross(ray.direction).dot(across) / across.length_squared();
                let point = ends[0] + way * share.clamp(0.0, 1.0);
                let off = (point - ray.origin).reject_from(ray.direction);
                off.length() <= radius
            });
            let comes = extent.comes_to(ends, radius);
            assert!(comes || !meets, "{rays:?} {ends:?}");
            known += 1;
            beside += u32::from(!comes);
        }
        assert!(known > 1000 && beside > known / 2, "{beside} of {known}");
    }

    #[test]
    fn an_extent_holds_all_its_rays() {
        let mut random = Random(11);
        let (mut known, mut tried) = (0, 0);
        for _ in 0..4000 {
            let spread = random.vector().abs().max_element() * 0.1;
            let (origin, direction) = (random.vector() * 3.0, random.vector());
            let rays = bundle(&mut random, [origin, direction], spread, 7);
            let map = DAffine3 {
                matrix3: DMat3::from_cols(random.vector(), random.vector(), random.vector()),
                translation: random.vector(),
            };
            let from = random.vector().x;
            let ranges = vec![from..f64::INFINITY; rays.len()];
            tried += 1;
            let Some(extent) = Hull::of(Portable, &rays, &ranges).extent(&map) else {
                continue;
            };
            known += 1;
            let (main, start) = (extent.main, f64::from(extent.start));
            for ray in &rays {
                let local = ray.transformed(&map);
                let advance = local.direction[main] * f64::from(extent.sign);
                let zeta = local.origin[main] * f64::from(extent.sign);
                assert!((zeta + from * advance).max(-1.0) >= f64::from(extent.least_near));
                let until = from.abs() + 1.0;
                assert!(zeta + until * advance <= f64::from(extent.reach(until)));
                for (axis, side) in extent.across.into_iter().enumerate() {
                    let slope = local.direction[side] / advance;
                    let at = local.origin[side] + slope * (start - zeta);
                    let within =
                        |x: f64, [low, high]: [f32; 2]| f64::from(low) <= x && x <= f64::from(high);
                    assert!(within(at, [extent.low[axis], extent.high[axis]]));
                    let slopes = [extent.low_slope[axis], extent.high_slope[axis]];
                    assert!(within(slope, slopes));
                }
            }
        }
        assert!(known > tried / 4, "{known} of {tried}");
    }
}
