//! Rays that run side by side, as one beam.

use std::ops::Range;

use glam::{DAffine3, DVec3};
use kernel::{Aabb, Ray};

use super::leaf::Bits;
use super::tree::{Node, WIDTH};
use crate::simd::{LANES, Simd, WIDE_LANES};

/// Rays of a beam at most: a bit each in a mask.
pub(super) const RAYS: usize = 64;

/// Errors of positions in single precision, many roundings wide.
const PADDING: f32 = 64.0 / (1 << 24) as f32;

/// Rounding errors of places in double precision, many roundings wide.
const PASSING: f64 = 1e-12;

/// Along the main axis rays advance at least this share of their advance across.
const LEAST_ADVANCE: f64 = 0.3;

/// Rays of a beam may spread over this much of the hierarchy; wider ones are traced alone.
const WIDEST: f64 = 0.5;

/// The rays of a packet in the coordinates of a hierarchy, by their advance along one axis:
/// at `zeta` ray `l` is at `origin + slope * (zeta - start)` on the two other axes.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Beam {
    /// Main axis and the two others.
    pub(super) main: usize,
    pub(super) across: [usize; 2],
    /// The sign of the advance along the main axis.
    pub(super) sign: f64,
    /// Where positions are given, before all that is of interest.
    pub(super) start: f64,
    /// Positions and slopes, exact.
    pub(super) origin: [[f64; RAYS]; 2],
    pub(super) slope: [[f64; RAYS]; 2],
    /// Position and slope of the middle of the beam, and how the rays differ from it.
    pub(super) middle_origin: [f64; 2],
    pub(super) middle_slope: [f64; 2],
    pub(super) offset: [[f32; RAYS]; 2],
    pub(super) turn: [[f32; RAYS]; 2],
    /// The ray parameter at the start, its advance with zeta, and that of zeta with it.
    pub(super) time: [f64; RAYS],
    pub(super) pace: [f64; RAYS],
    advance: [f64; RAYS],
    /// What is still of interest of each ray, in zeta, a little widened.
    pub(super) near: [f32; RAYS],
    pub(super) far: [f32; RAYS],
    /// Bounds over all rays: least and greatest position and slope.
    low: [f32; 2],
    high: [f32; 2],
    low_slope: [f32; 2],
    high_slope: [f32; 2],
    pub(super) least_near: f32,
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

/// Origins and directions of a packet, coordinate by coordinate.
#[derive(Clone, Debug)]
pub(super) struct Rays {
    pub(super) origin: [[f64; RAYS]; 3],
    pub(super) direction: [[f64; RAYS]; 3],
}

impl Rays {
    pub(super) const NONE: Self = Self {
        origin: [[0.0; RAYS]; 3],
        direction: [[0.0; RAYS]; 3],
    };

    /// Takes up to [`RAYS`] rays; the last is repeated in the lanes that are left.
    #[inline(always)]
    pub(super) fn gather(&mut self, rays: &[Ray]) {
        let Some(last) = rays.len().checked_sub(1) else {
            return;
        };
        for lane in 0..RAYS {
            let ray = &rays[lane.min(last)];
            for axis in 0..3 {
                self.origin[axis][lane] = ray.origin[axis];
                self.direction[axis][lane] = ray.direction[axis];
            }
        }
    }

    /// Whether the origin is finite and the direction has a length.
    #[inline(always)]
    pub(super) fn usable(&self) -> [bool; RAYS] {
        let mut usable = [false; RAYS];
        for (lane, usable) in usable.iter_mut().enumerate() {
            let (mut way, mut place) = (0.0, 0.0);
            for axis in 0..3 {
                let (o, d) = (self.origin[axis][lane], self.direction[axis][lane]);
                way += d * d;
                // Zero, unless it is not finite.
                place += o * 0.0;
            }
            *usable = (way > 0.0) & (way < f64::INFINITY) & (place == 0.0);
        }
        usable
    }

    /// The rays in other coordinates.
    #[inline(always)]
    fn transformed(&self, map: &DAffine3, into: &mut Self) {
        for axis in 0..3 {
            let row = map.matrix3.row(axis);
            for lane in 0..RAYS {
                let [x, y, z] = &self.origin;
                let at = row.x * x[lane] + row.y * y[lane] + row.z * z[lane];
                into.origin[axis][lane] = at + map.translation[axis];
                let [x, y, z] = &self.direction;
                into.direction[axis][lane] = row.x * x[lane] + row.y * y[lane] + row.z * z[lane];
            }
        }
    }
}

/// Least and greatest of what the lanes hold.
#[inline(always)]
fn bounds<S: Simd>(s: S, values: &[f64; RAYS]) -> (f64, f64) {
    let (mut least, mut most) = (s.splat_d(f64::INFINITY), s.splat_d(f64::NEG_INFINITY));
    for part in values.as_chunks().0 {
        let part = s.load_d(part);
        (least, most) = (s.min_d(part, least), s.max_d(part, most));
    }
    let (mut low, mut high) = ([0.0; WIDE_LANES], [0.0; WIDE_LANES]);
    s.store_d(least, &mut low);
    s.store_d(most, &mut high);
    (least_of(&low), greatest_of(&high))
}

/// Middle of what sixteen lanes hold, and half of what they span.
#[inline(always)]
fn spread(values: &[f32; LANES]) -> (f32, f32) {
    let (mut low, mut high) = ([0.0; 8], [0.0; 8]);
    for k in 0..8 {
        low[k] = lesser(values[k], values[k + 8]);
        high[k] = greater(values[k], values[k + 8]);
    }
    let (low, high) = (least_of(&low), greatest_of(&high));
    (0.5 * (low + high), 0.5 * (high - low))
}

#[inline(always)]
fn lesser<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

#[inline(always)]
fn greater<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

#[inline(always)]
fn least_of<T: PartialOrd + Copy>(&[a, b, c, d, e, f, g, h]: &[T; 8]) -> T {
    let (first, second) = (
        lesser(lesser(a, b), lesser(c, d)),
        lesser(lesser(e, f), lesser(g, h)),
    );
    lesser(first, second)
}

#[inline(always)]
fn greatest_of<T: PartialOrd + Copy>(&[a, b, c, d, e, f, g, h]: &[T; 8]) -> T {
    let first = greater(greater(a, b), greater(c, d));
    let second = greater(greater(e, f), greater(g, h));
    greater(first, second)
}

/// Bounds of the coordinates of rays.
pub(super) struct Hull {
    /// Least and greatest: of origins, of where ranges begin, of directions.
    low: [f64; WIDE_LANES],
    high: [f64; WIDE_LANES],
}

impl Hull {
    /// Where directions stand, behind origins and beginnings.
    const DIRECTION: usize = 4;

    #[inline(always)]
    pub(super) fn of<S: Simd>(s: S, rays: &[Ray], ranges: &[Range<f64>]) -> Self {
        let (mut least, mut most) = (s.splat_d(f64::INFINITY), s.splat_d(f64::NEG_INFINITY));
        for (ray, range) in rays.iter().zip(ranges) {
            let (o, d) = (ray.origin, ray.direction);
            let all = s.load_d(&[o.x, o.y, o.z, range.start, d.x, d.y, d.z, d.z]);
            (least, most) = (s.min_d(all, least), s.max_d(all, most));
        }
        let mut hull = Self {
            low: [0.0; WIDE_LANES],
            high: [0.0; WIDE_LANES],
        };
        s.store_d(least, &mut hull.low);
        s.store_d(most, &mut hull.high);
        hull
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
        if slow <= 0.0 || self.low[3] < 0.0 {
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
        let (near, far) = (near.max(0.0), far.max(0.0));
        let reach = low[main].abs().max(high[main].abs()) + far;
        let (pace, slowest) = (fast.recip(), slow.recip());
        let mut apart = false;
        for axis in 0..3 {
            let fall = least[axis] * if least[axis] < 0.0 { slowest } else { pace };
            let rise = most[axis] * if most[axis] < 0.0 { pace } else { slowest };
            let lowest = low[axis] + fall * if fall < 0.0 { far } else { near };
            let highest = high[axis] + rise * if rise < 0.0 { near } else { far };
            let size = low[axis].abs().max(high[axis].abs());
            let room = PASSING * (size + reach * (1.0 + fall.abs().max(rise.abs())));
            apart |= axis != main
                && (lowest - room > target.max[axis] || highest + room < target.min[axis]);
        }
        apart
    }
}

impl Beam {
    pub(super) const NONE: Self = Self {
        main: 2,
        across: [0, 1],
        sign: 1.0,
        start: 0.0,
        origin: [[0.0; RAYS]; 2],
        slope: [[0.0; RAYS]; 2],
        middle_origin: [0.0; 2],
        middle_slope: [0.0; 2],
        offset: [[0.0; RAYS]; 2],
        turn: [[0.0; RAYS]; 2],
        time: [0.0; RAYS],
        pace: [0.0; RAYS],
        advance: [0.0; RAYS],
        near: [0.0; RAYS],
        far: [0.0; RAYS],
        low: [0.0; 2],
        high: [0.0; 2],
        low_slope: [0.0; 2],
        high_slope: [0.0; 2],
        least_near: 0.0,
    };

    /// Sees the rays from coordinates in which all that can be met lies between -1 and 1.
    /// `from` and `until` bound the ray parameters; of rays that are not `alive` nothing is of
    /// interest.
    ///
    /// The result says whether the rays run side by side; if not, the beam is of no use.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "widened by more than the rounding"
    )]
    pub(super) fn fill<S: Simd>(
        &mut self,
        s: S,
        (rays, alive): (&Rays, u64),
        map: &DAffine3,
        (from, until): (&[f64; RAYS], &[f64; RAYS]),
        local: &mut Rays,
    ) -> bool {
        rays.transformed(map, local);
        let first = DVec3::from_array(local.direction.map(|d| d[0]));
        let main = first.abs().max_position();
        let [i, j] = [[1, 2], [0, 2], [0, 1]][main];
        let sign = first[main].signum();
        (self.main, self.across, self.sign) = (main, [i, j], sign);
        let mut zeta = [0.0; RAYS];
        let mut begin = [0.0; RAYS];
        let mut coherent = true;
        for lane in 0..RAYS {
            let advance = local.direction[main][lane] * sign;
            let (di, dj) = (local.direction[i][lane], local.direction[j][lane]);
            coherent &= advance > LEAST_ADVANCE * di.abs() && advance > LEAST_ADVANCE * dj.abs();
            self.advance[lane] = advance;
            self.pace[lane] = advance.recip();
            self.slope[0][lane] = di * self.pace[lane];
            self.slope[1][lane] = dj * self.pace[lane];
            zeta[lane] = local.origin[main][lane] * sign;
            begin[lane] = zeta[lane] + from[lane] * advance;
        }
        if !coherent {
            return false;
        }
        self.start = bounds(s, &begin).0.max(-1.0);
        for lane in 0..RAYS {
            let way = self.start - zeta[lane];
            self.time[lane] = way * self.pace[lane];
            self.origin[0][lane] = local.origin[i][lane] + way * self.slope[0][lane];
            self.origin[1][lane] = local.origin[j][lane] + way * self.slope[1][lane];
            self.near[lane] = begin[lane].max(-1.0) as f32 - PADDING;
            self.far[lane] =
                (self.start + (until[lane] - self.time[lane]) * self.advance[lane]) as f32;
            self.far[lane] += self.far[lane].abs() * PADDING + PADDING;
        }
        for lane in Bits(!alive) {
            self.end(lane);
        }
        self.least_near = self.start as f32 - PADDING;
        let mut narrow = true;
        for axis in 0..2 {
            let (low, high) = bounds(s, &self.origin[axis]);
            let (low_slope, high_slope) = bounds(s, &self.slope[axis]);
            narrow &= high - low < WIDEST && high_slope - low_slope < WIDEST;
            let (origin, slope) = (
                f64::midpoint(low, high),
                f64::midpoint(low_slope, high_slope),
            );
            self.middle_origin[axis] = origin;
            self.middle_slope[axis] = slope;
            for lane in 0..RAYS {
                self.offset[axis][lane] = (self.origin[axis][lane] - origin) as f32;
                self.turn[axis][lane] = (self.slope[axis][lane] - slope) as f32;
            }
            let padding = PADDING * (1.0 + low.abs().max(high.abs()) as f32);
            self.low[axis] = low as f32 - padding;
            self.high[axis] = high as f32 + padding;
            self.low_slope[axis] = low_slope as f32 - PADDING;
            self.high_slope[axis] = high_slope as f32 + PADDING;
        }
        narrow
    }

    /// Where along the beam it may enter each box of a node, and a bit for each that it may
    /// meet before `far`.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the bounds are padded for it"
    )]
    pub(super) fn slabs(&self, node: &Node, far: f32) -> ([f32; WIDTH], u32) {
        let (min, max) = (&node.min, &node.max);
        let forward = self.sign > 0.0;
        let start = self.start as f32;
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

    /// The beam as a whole.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the bounds are padded for it"
    )]
    pub(super) fn bounds(&self) -> BeamBounds {
        let mut bounds = BeamBounds {
            main: self.main,
            across: self.across,
            sign: self.sign as f32,
            start: self.start as f32,
            origin: [0.0; 2],
            slope: [0.0; 2],
            origin_radius: [0.0; 2],
            slope_radius: [0.0; 2],
            least_near: self.least_near,
        };
        for axis in 0..2 {
            bounds.origin[axis] = self.middle_origin[axis] as f32;
            bounds.slope[axis] = self.middle_slope[axis] as f32;
            bounds.origin_radius[axis] = 0.5 * (self.high[axis] - self.low[axis]);
            bounds.slope_radius[axis] = 0.5 * (self.high_slope[axis] - self.low_slope[axis]);
        }
        bounds
    }

    /// Of the beam as a whole the rays of a group.
    #[inline(always)]
    pub(super) fn part(&self, whole: &BeamBounds, group: usize) -> BeamBounds {
        let mut part = *whole;
        for axis in 0..2 {
            let (middle, half) = spread(&self.offset[axis].as_chunks().0[group]);
            part.origin[axis] += middle;
            part.origin_radius[axis] = half + PADDING * (1.0 + part.origin[axis].abs());
            let (middle, half) = spread(&self.turn[axis].as_chunks().0[group]);
            part.slope[axis] += middle;
            part.slope_radius[axis] = half + PADDING * (1.0 + part.slope[axis].abs());
        }
        part
    }

    /// The greatest `far` of all.
    #[inline(always)]
    pub(super) fn farthest<S: Simd>(&self, s: S) -> f32 {
        let mut all = s.splat(f32::NEG_INFINITY);
        for part in self.far.as_chunks().0 {
            all = s.max(s.load(part), all);
        }
        let mut far = [0.0; LANES];
        s.store(all, &mut far);
        let (halves, _) = far.as_chunks();
        greater(greatest_of(&halves[0]), greatest_of(&halves[1]))
    }

    /// Nothing of ray `lane` is of interest any more.
    #[inline(always)]
    pub(super) fn end(&mut self, lane: usize) {
        self.far[lane] = f32::NEG_INFINITY;
    }

    /// Nothing beyond the ray parameter `until` is of interest any more of ray `lane`.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "widened by more than the rounding"
    )]
    pub(super) fn shorten(&mut self, lane: usize, until: f64) {
        let far = (self.start + (until - self.time[lane]) * self.advance[lane]) as f32;
        self.far[lane] = far + far.abs() * PADDING + PADDING;
    }

    /// The ray parameter of ray `lane` at `zeta`.
    #[inline(always)]
    pub(super) fn time_at(&self, lane: usize, zeta: f64) -> f64 {
        self.time[lane] + (zeta - self.start) * self.pace[lane]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::simd::Portable;

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
        let mut vector = |size: f64| random.vector() * size;
        let (mut passed, mut missed) = (0, 0);
        for _ in 0..4000 {
            let corner = vector(1.0);
            let target = Aabb::around([corner, corner + vector(0.7)]);
            let (origin, direction) = (vector(4.0), vector(1.0));
            let spread = vector(0.1).abs().max_element();
            let rays: Vec<Ray> = (0..RAYS)
                .map(|_| Ray {
                    origin: origin + vector(spread),
                    direction: direction + vector(spread),
                })
                .collect();
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
}
