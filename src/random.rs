//! Numbers that look random and are the same in every run.

#[cfg(test)]
use glam::DVec3;

/// A sequence that its seed determines (Steele, Lea and Flood's `SplitMix64`, 2014): neighbouring
/// seeds give sequences that have nothing to do with each other.
#[derive(Debug)]
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// From 0 to below 1.
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A vector in the cube from -1 to 1.
    #[cfg(test)]
    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::from_array([(); 3].map(|()| self.signed()))
    }

    /// From -1 to below 1.
    #[cfg(test)]
    pub(crate) fn signed(&mut self) -> f64 {
        self.unit() * 2.0 - 1.0
    }
}
