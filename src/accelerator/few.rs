//! Rays of a beam that are few at a cell, side by side.

use super::beam::{Beam, RAYS, Spread};
use super::leaf::Bits;
use super::windows::steps;
use crate::simd::{LANES, Simd};

/// Some rays of a beam, in the first lanes.
#[derive(Debug)]
pub(super) struct Few {
    pub(super) spread: Spread,
    /// Which of the beam each is.
    pub(super) lanes: [u8; RAYS],
}

impl Few {
    pub(super) const NONE: Self = Self {
        spread: Spread::NONE,
        lanes: [0; RAYS],
    };

    /// Takes the rays whose bits are set if they are looked at in fewer steps then. The result has
    /// a bit for each place that is taken.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "a lane is below 64")]
    pub(super) fn take<S: Simd>(&mut self, beam: &Beam, lanes: u64) -> Option<u64> {
        let count = lanes.count_ones() as usize;
        if count > LANES {
            return None;
        }
        let taken = (1 << count) - 1;
        if steps::<S>(taken) >= steps::<S>(lanes) {
            return None;
        }
        let (to, from) = (&mut self.spread, &beam.spread);
        for (k, lane) in Bits(lanes).enumerate() {
            self.lanes[k] = lane as u8;
            for axis in 0..2 {
                to.offset[axis][k] = from.offset[axis][lane];
                to.turn[axis][k] = from.turn[axis][lane];
            }
            (to.near[k], to.far[k]) = (from.near[lane], from.far[lane]);
        }
        Some(taken)
    }
}

/// All rays of a beam.
pub(super) const ALL: [u8; RAYS] = {
    let mut lanes = [0; RAYS];
    let mut lane: u8 = 0;
    while (lane as usize) < RAYS {
        lanes[lane as usize] = lane;
        lane += 1;
    }
    lanes
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Portable;

    #[test]
    fn rays_of_several_groups_are_put_side_by_side() {
        let mut beam = Beam::NONE;
        for lane in 0..RAYS {
            beam.spread.far[lane] = lane as f32;
        }
        let mut few = Few::NONE;
        let lanes = [3, 16, 17, 40, 63];
        let bits = lanes.iter().fold(0, |bits, &lane| bits | 1 << lane);
        assert_eq!(few.take::<Portable>(&beam, bits), Some(0b1_1111));
        assert_eq!(few.lanes[..5], lanes);
        assert_eq!(few.spread.far[..5], [3.0, 16.0, 17.0, 40.0, 63.0]);
    }

    #[test]
    fn rays_stay_where_it_would_save_nothing() {
        let mut few = Few::NONE;
        for bits in [0b1, 0xff00, 0x1_ffff, u64::MAX, 0xffff_0000_0000_0001] {
            assert_eq!(few.take::<Portable>(&Beam::NONE, bits), None, "{bits:x}");
        }
    }
}
