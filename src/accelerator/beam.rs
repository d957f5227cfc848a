//! Rays that run side by side, as one beam.

use glam::{DAffine3, DVec3};
use kernel::Ray;

use super::approach::load;
use super::hull::{ACROSS, Extent, PADDING, WIDEST, greater, lesser};
use super::leaf::Bits;
use super::tree::Node;
use crate::simd::{LANES, Simd, WIDE_LANES};

/// Rays of a beam at most: a bit each in a mask.
pub(super) const RAYS: usize = 64;

/// Along the main axis rays advance at least this share of their advance across.
const LEAST_ADVANCE: f64 = 0.3;

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
    /// Position and slope of the middle of the beam.
    pub(super) middle_origin: [f64; 2],
    pub(super) middle_slope: [f64; 2],
    pub(super) spread: Spread,
    /// The ray parameter at the start, its advance with zeta, and that of zeta with it.
    pub(super) time: [f64; RAYS],
    pub(super) pace: [f64; RAYS],
    advance: [f64; RAYS],
    pub(super) extent: Extent,
}

/// Rays of a beam in single precision.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Spread {
    /// How position and slope differ from those of the middle.
    pub(super) offset: [[f32; RAYS]; 2],
    pub(super) turn: [[f32; RAYS]; 2],
    /// What is still of interest of each ray, in zeta, a little widened.
    pub(super) near: [f32; RAYS],
    pub(super) far: [f32; RAYS],
}

impl Spread {
    pub(super) const NONE: Self = Self {
        offset: [[0.0; RAYS]; 2],
        turn: [[0.0; RAYS]; 2],
        near: [0.0; RAYS],
        far: [0.0; RAYS],
    };
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
        spread: Spread::NONE,
        time: [0.0; RAYS],
        pace: [0.0; RAYS],
        advance: [0.0; RAYS],
        extent: Extent::NONE,
    };

    /// Sees the rays from coordinates in which all that can be met lies between -1 and 1.
    /// `from` and `until` bound the ray parameters; of rays that are not `alive` nothing is of
    /// interest. The main axis is the one that is given, or else that of the first ray.
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
        (map, main): (&DAffine3, Option<usize>),
        (from, until): (&[f64; RAYS], &[f64; RAYS]),
        local: &mut Rays,
    ) -> bool {
        rays.transformed(map, local);
        let first = DVec3::from_array(local.direction.map(|d| d[0]));
        let main = main.unwrap_or_else(|| first.abs().max_position());
        let [i, j] = ACROSS[main];
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
            self.spread.near[lane] = greater(begin[lane], -1.0) as f32 - PADDING;
            self.shorten(lane, until[lane]);
        }
        for lane in Bits(!alive) {
            self.end(lane);
        }
        self.extent = Extent::new(main, sign, self.start);
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
                self.spread.offset[axis][lane] = (self.origin[axis][lane] - origin) as f32;
                self.spread.turn[axis][lane] = (self.slope[axis][lane] - slope) as f32;
            }
            self.extent.put(axis, [low, high], [low_slope, high_slope]);
        }
        narrow
    }

    /// The rays that may come to the box in `slot` of a node, before what they have met so far.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "boxes are widened by more than the rounding"
    )]
    pub(super) fn to_box<S: Simd>(&self, s: S, node: &Node, slot: usize) -> u64 {
        let (min, max) = (&node.min, &node.max);
        let (near, end) = if self.sign > 0.0 {
            (min[self.main][slot], max[self.main][slot])
        } else {
            (-max[self.main][slot], -min[self.main][slot])
        };
        let start = self.start as f32;
        let ways = [greater(near, start) - start, end - start];
        // The box beside the middle of the beam, where this enters and leaves.
        let (mut low, mut high) = ([[s.splat(0.0); 2]; 2], [[s.splat(0.0); 2]; 2]);
        for (axis, side) in self.across.into_iter().enumerate() {
            let (origin, slope) = (self.middle_origin[axis], self.middle_slope[axis]);
            for (k, way) in ways.into_iter().enumerate() {
                let middle = (origin + slope * f64::from(way)) as f32;
                let padding = PADDING * (1.0 + middle.abs());
                low[axis][k] = s.splat(min[side][slot] - middle - padding);
                high[axis][k] = s.splat(max[side][slot] - middle + padding);
            }
        }
        let ways = ways.map(|way| s.splat(way));
        let mut rays = 0;
        for group in 0..RAYS / LANES {
            let mut apart = s.sub(s.splat(near), load(s, &self.spread.far, group));
            for axis in 0..2 {
                let offset = load(s, &self.spread.offset[axis], group);
                let turn = load(s, &self.spread.turn[axis], group);
                let place = ways.map(|way| s.fma(turn, way, offset));
                let beyond = |k: usize| s.sub(place[k], high[axis][k]);
                let below = |k: usize| s.sub(low[axis][k], place[k]);
                apart = s.max(apart, s.min(beyond(0), beyond(1)));
                apart = s.max(apart, s.min(below(0), below(1)));
            }
            let beside = s.bits(s.lt(s.splat(0.0), apart));
            rays |= u64::from(!beside & 0xffff) << (group * LANES);
        }
        rays
    }

    /// The greatest `far` of all.
    #[inline(always)]
    pub(super) fn farthest<S: Simd>(&self, s: S) -> f32 {
        let mut all = s.splat(f32::NEG_INFINITY);
        for part in self.spread.far.as_chunks().0 {
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
        self.spread.far[lane] = f32::NEG_INFINITY;
    }

    /// Nothing beyond the ray parameter `until` is of interest any more of ray `lane`.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "widened by more than the rounding"
    )]
    pub(super) fn shorten(&mut self, lane: usize, until: f64) {
        let far = (self.start + (until - self.time[lane]) * self.advance[lane]) as f32;
        self.spread.far[lane] = far + far.abs() * PADDING + PADDING;
    }

    /// As [`Self::shorten`], for eight rays side by side.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "widened by more than the rounding"
    )]
    pub(super) fn shorten_eight(&mut self, eight: usize, until: &[f64; WIDE_LANES]) {
        let time: &[f64; WIDE_LANES] = &self.time.as_chunks().0[eight];
        let advance: &[f64; WIDE_LANES] = &self.advance.as_chunks().0[eight];
        let to: &mut [f32; WIDE_LANES] = &mut self.spread.far.as_chunks_mut().0[eight];
        for k in 0..WIDE_LANES {
            let far = (self.start + (until[k] - time[k]) * advance[k]) as f32;
            to[k] = far + far.abs() * PADDING + PADDING;
        }
    }
}
