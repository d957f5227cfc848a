//! A ray's line as two planes, and maps between coordinates, in interval arithmetic.

use glam::DAffine3;
use kernel::{Interval, Ray};

use super::surface::Point;

/// An affine map whose entries are intervals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Map {
    rows: [[Interval; 4]; 3],
    identity: bool,
}

impl Map {
    pub(super) const IDENTITY: Self = {
        let (o, i) = (Interval::ZERO, Interval::point(1.0));
        Self {
            rows: [[i, o, o, o], [o, i, o, o], [o, o, i, o]],
            identity: true,
        }
    };

    /// First `inner`, then this map.
    pub(super) fn after(&self, inner: &DAffine3) -> Self {
        if *inner == DAffine3::IDENTITY {
            return *self;
        }
        let column = |k: usize| match k {
            3 => inner.translation,
            k => inner.matrix3.col(k),
        };
        let entry = |i: usize, k: usize| {
            let column = column(k).to_array().map(Interval::point);
            let moved = if k == 3 {
                self.rows[i][3]
            } else {
                Interval::ZERO
            };
            (0..3).fold(moved, |sum, m| sum + self.rows[i][m] * column[m])
        };
        let mut rows: [[Interval; 4]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|k| entry(i, k)));
        if self.identity {
            rows = std::array::from_fn(|i| std::array::from_fn(|k| Interval::point(column(k)[i])));
        }
        Self {
            rows,
            identity: false,
        }
    }

    /// The image of a control point.
    pub(super) fn apply(&self, h: &Point) -> Point {
        if self.identity {
            return *h;
        }
        let [x, y, z] = self
            .rows
            .map(|r| (0..3).fold(r[3] * h[3], |sum, k| sum + r[k] * h[k]));
        [x, y, z, h[3]]
    }
}

/// The line of a ray: the planes through it whose normals are `d_k e_a - d_a e_k` and
/// `d_k e_b - d_b e_k`, where `d_k` is the largest coordinate of the direction.
///
/// The normals hold no rounding error and are exactly perpendicular to the direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    origin: [f64; 3],
    direction: [f64; 3],
    axes: [usize; 3],
}

impl Line {
    pub(super) fn new(ray: &Ray) -> Self {
        let main = ray.direction.abs().max_position();
        Self {
            origin: ray.origin.to_array(),
            direction: ray.direction.to_array(),
            axes: [(main + 1) % 3, (main + 2) % 3, main],
        }
    }

    /// The distances of `(w P, w)` from both planes times `w`, and numerator and denominator
    /// of the ray parameter that it has if it lies on the line.
    pub(super) fn distances(&self, h: Point) -> [Interval; 4] {
        let [a, b, k] = self
            .axes
            .map(|axis| h[axis] - h[3].scaled(self.origin[axis]));
        let [da, db, dk] = self.axes.map(|axis| self.direction[axis]);
        [
            a.scaled(dk) - k.scaled(da),
            b.scaled(dk) - k.scaled(db),
            k,
            h[3].scaled(dk),
        ]
    }
}
