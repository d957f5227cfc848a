//! The integrals of a face, added up together.

use std::ops::{Add, AddAssign, Mul, Sub};

use glam::DVec3;

/// How many integrals there are.
const COUNT: usize = 20;

/// Integrals over a part of a surface.
///
/// 0: area. 1: volume of the cone to the origin. 2 to 4: the normal. 5 to 7: the place.
/// 8 to 10: first, 11 to 16: second moments of the volume (xx, yy, zz, xy, yz, zx), each as the
/// flux of a field with that divergence, so that they hold for whole bodies. 17 to 19: the volume, as the flux along
/// each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sums([f64; COUNT]);

impl Sums {
    /// What is integrated, at a point with the normal `n`, as long as its area.
    pub(super) fn density(p: DVec3, n: DVec3) -> Self {
        let area = n.length();
        let [x, y, z] = p.to_array();
        let half = p * p * n * 0.5;
        let third = p * p * p * n / 3.0;
        let place = p * area;
        Self([
            area,
            p.dot(n) / 3.0,
            n.x,
            n.y,
            n.z,
            place.x,
            place.y,
            place.z,
            half.x,
            half.y,
            half.z,
            third.x,
            third.y,
            third.z,
            x * x * y * n.x * 0.5,
            y * y * z * n.y * 0.5,
            z * z * x * n.z * 0.5,
            x * n.x,
            y * n.y,
            z * n.z,
        ])
    }

    /// Errors that are `share` of what a thing of this size has.
    pub(super) fn tolerance(size: f64, share: f64) -> Self {
        let power = |k: usize| match k {
            0 | 2..=4 => size.powi(2),
            1 | 5..=7 | 17.. => size.powi(3),
            8..=10 => size.powi(4),
            _ => size.powi(5),
        };
        Self(std::array::from_fn(|k| power(k) * share))
    }

    /// Whether no error is larger than allowed.
    pub(super) fn is_within(&self, tolerance: &Self) -> bool {
        self.0.iter().zip(&tolerance.0).all(|(a, b)| a <= b)
    }

    /// The largest error, as a share of what is allowed.
    pub(super) fn share_of(&self, tolerance: &Self) -> f64 {
        let shares = self.0.iter().zip(&tolerance.0).map(|(a, b)| a / b);
        shares.fold(0.0, f64::max)
    }

    /// Whether all are numbers.
    pub(super) fn is_finite(&self) -> bool {
        self.0.iter().all(|x| x.is_finite())
    }

    /// The integrals that do not turn round with the normal, and no other.
    pub(super) fn areas(self) -> Self {
        let keep = |k: usize| matches!(k, 0 | 5..=7);
        Self(std::array::from_fn(
            |k| if keep(k) { self.0[k] } else { 0.0 },
        ))
    }

    pub(super) fn abs(self) -> Self {
        Self(self.0.map(f64::abs))
    }

    pub(super) fn number(&self, index: usize) -> f64 {
        self.0[index]
    }

    pub(super) fn vector(&self, index: usize) -> DVec3 {
        DVec3::from_slice(&self.0[index..])
    }
}

impl Add for Sums {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] + other.0[k]))
    }
}

impl AddAssign for Sums {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Sums {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] - other.0[k]))
    }
}

impl Mul<f64> for Sums {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self(self.0.map(|x| x * factor))
    }
}
