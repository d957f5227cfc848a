//! Rays that run side by side, as one beam.

use glam::{DAffine3, DVec3};
use kernel::Ray;

use super::tree::{Node, WIDTH};

/// Rays of a beam at most: a bit each in a mask.
pub(super) const RAYS: usize = 64;

/// Errors of positions in single precision, many roundings wide.
const PADDING: f32 = 64.0 / (1 << 24) as f32;

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
    /// The ray parameter at the start, and its advance with zeta.
    pub(super) time: [f64; RAYS],
    pub(super) pace: [f64; RAYS],
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
                let dot = |v: &[[f64; RAYS]; 3]| {
                    row.x * v[0][lane] + row.y * v[1][lane] + row.z * v[2][lane]
                };
                into.origin[axis][lane] = dot(&self.origin) + map.translation[axis];
                into.direction[axis][lane] = dot(&self.direction);
            }
        }
    }
}

/// Least and greatest of what the lanes hold.
#[inline(always)]
fn bounds(values: &[f64; RAYS]) -> (f64, f64) {
    let (mut low, mut high) = ([f64::INFINITY; 8], [f64::NEG_INFINITY; 8]);
    for part in values.as_chunks::<8>().0 {
        for k in 0..8 {
            low[k] = if part[k] < low[k] { part[k] } else { low[k] };
            high[k] = if part[k] > high[k] { part[k] } else { high[k] };
        }
    }
    (
        low.into_iter().fold(f64::INFINITY, f64::min),
        high.into_iter().fold(f64::NEG_INFINITY, f64::max),
    )
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
        near: [0.0; RAYS],
        far: [0.0; RAYS],
        low: [0.0; 2],
        high: [0.0; 2],
        low_slope: [0.0; 2],
        high_slope: [0.0; 2],
        least_near: 0.0,
    };

    /// Sees the rays from coordinates in which all that can be met lies between -1 and 1.
    /// `from` and `until` bound the ray parameters.
    ///
    /// The result says whether the rays run side by side; if not, the beam is of no use.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "widened by more than the rounding"
    )]
    pub(super) fn fill(
        &mut self,
        rays: &Rays,
        map: &DAffine3,
        from: &[f64; RAYS],
        until: &[f64; RAYS],
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
            self.pace[lane] = advance.recip();
            self.slope[0][lane] = di * self.pace[lane];
            self.slope[1][lane] = dj * self.pace[lane];
            zeta[lane] = local.origin[main][lane] * sign;
            begin[lane] = zeta[lane] + from[lane] * advance;
        }
        if !coherent {
            return false;
        }
        self.start = bounds(&begin).0.max(-1.0);
        for lane in 0..RAYS {
            let way = self.start - zeta[lane];
            self.time[lane] = way * self.pace[lane];
            self.origin[0][lane] = local.origin[i][lane] + way * self.slope[0][lane];
            self.origin[1][lane] = local.origin[j][lane] + way * self.slope[1][lane];
            self.near[lane] = begin[lane].max(-1.0) as f32 - PADDING;
            self.far[lane] =
                (self.start + (until[lane] - self.time[lane]) / self.pace[lane]) as f32;
            self.far[lane] += self.far[lane].abs() * PADDING + PADDING;
        }
        self.least_near = self.start as f32 - PADDING;
        let mut narrow = true;
        for axis in 0..2 {
            let (low, high) = bounds(&self.origin[axis]);
            let (low_slope, high_slope) = bounds(&self.slope[axis]);
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
        let radius = |low: &[f32; 2], high: &[f32; 2]| [0, 1].map(|k| 0.5 * (high[k] - low[k]));
        BeamBounds {
            main: self.main,
            across: self.across,
            sign: self.sign as f32,
            start: self.start as f32,
            origin: self.middle_origin.map(|x| x as f32),
            slope: self.middle_slope.map(|x| x as f32),
            origin_radius: radius(&self.low, &self.high),
            slope_radius: radius(&self.low_slope, &self.high_slope),
            least_near: self.least_near,
        }
    }

    /// The greatest `far` of the lanes whose bits are set.
    #[inline(always)]
    pub(super) fn farthest(&self, lanes: u64) -> f32 {
        let mut far = [f32::NEG_INFINITY; 8];
        for (part, bits) in self.far.as_chunks::<8>().0.iter().zip(lanes.to_le_bytes()) {
            for k in 0..8 {
                let value = if bits >> k & 1 == 1 {
                    part[k]
                } else {
                    f32::NEG_INFINITY
                };
                far[k] = if value > far[k] { value } else { far[k] };
            }
        }
        far.into_iter().fold(f32::NEG_INFINITY, f32::max)
    }

    /// Nothing beyond the ray parameter `until` is of interest any more of ray `lane`.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "widened by more than the rounding"
    )]
    pub(super) fn shorten(&mut self, lane: usize, until: f64) {
        let far = (self.start + (until - self.time[lane]) / self.pace[lane]) as f32;
        self.far[lane] = far + far.abs() * PADDING + PADDING;
    }

    /// The ray parameter of ray `lane` at `zeta`.
    #[inline(always)]
    pub(super) fn time_at(&self, lane: usize, zeta: f64) -> f64 {
        self.time[lane] + (zeta - self.start) * self.pace[lane]
    }
}
