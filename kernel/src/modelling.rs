//! Exact rational curves and surfaces: arcs, quadrics, tori, and what sweeps make of curves; and
//! surfaces from measured points.
//!
//! Everything here is exact up to the rounding of the control points, but what [`fit()`],
//! [`fit_surface`] and [`swept`] make. [`coons`] and [`interpolate`] join grids of points,
//! [`blend`] and [`loft`] contours in layers, and [`cap`] closes their ends.
//! A parameter that is an angle equals it, in radians, at the knots, which stand every 90
//! degrees or closer; between them see [`arc_parameter`].

mod arc;
mod banded;
mod blend;
mod cap;
mod coons;
mod fit;
mod interpolate;
mod layers;
mod loft;
mod quadric;
mod sweep;
mod swept;

use glam::DVec3;

use crate::{Error, check_points};

pub use arc::{arc, arc_angle, arc_parameter, circle, to_center};
pub use blend::blend;
pub use cap::{Cap, TubeEnd, cap};
pub use coons::{Twist, coons};
pub use fit::{Fit, FitSurface, fit, fit_surface};
pub use interpolate::{Along, Interpolation, Spacing, interpolate, interpolate_curve};
pub use loft::loft;
pub use quadric::{cone, cylinder, plane, sphere, torus};
pub use sweep::{extrude, revolve, ruled, swung, with_equal_weights};
pub use swept::{Swept, swept};

/// A right-handed system of three perpendicular unit vectors at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    origin: DVec3,
    x: DVec3,
    y: DVec3,
    z: DVec3,
}

impl Frame {
    /// The axes of the coordinates themselves.
    pub const WORLD: Self = Self {
        origin: DVec3::ZERO,
        x: DVec3::X,
        y: DVec3::Y,
        z: DVec3::Z,
    };

    /// The frame at `origin` with its z axis along `axis` and its x axis, where angles start,
    /// along the part of `reference` that is perpendicular to it.
    ///
    /// # Errors
    /// If a coordinate is not finite, a vector has no length or the two are parallel.
    pub fn new(origin: DVec3, axis: DVec3, reference: DVec3) -> Result<Self, Error> {
        check_point(origin)?;
        let (z, reference) = (direction(axis)?, direction(reference)?);
        let across = reference - z * reference.dot(z);
        if across.length() < 1e-12 {
            return Err(Error::NoDirection);
        }
        let x = across.normalize();
        let y = z.cross(x);
        Ok(Self { origin, x, y, z })
    }

    /// The frame at `origin` with its z axis along `axis`; the x axis is any perpendicular one.
    ///
    /// # Errors
    /// If a coordinate is not finite or the axis has no length.
    pub fn about(origin: DVec3, axis: DVec3) -> Result<Self, Error> {
        Self::new(origin, axis, direction(axis)?.any_orthonormal_vector())
    }

    /// The point where the axes meet.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The unit vector along x, where angles start.
    pub fn x(&self) -> DVec3 {
        self.x
    }

    /// The unit vector along y, at 90 degrees.
    pub fn y(&self) -> DVec3 {
        self.y
    }

    /// The unit vector along the axis.
    pub fn z(&self) -> DVec3 {
        self.z
    }
}

/// The unit vector along `vector`, whatever its length.
fn direction(vector: DVec3) -> Result<DVec3, Error> {
    check_point(vector)?;
    // Scaled first: squares of very short and very long vectors leave the range of numbers.
    let largest = vector.abs().max_element();
    (vector / largest).try_normalize().ok_or(Error::NoDirection)
}

/// As [`check_points`], of one.
fn check_point(point: DVec3) -> Result<(), Error> {
    check_points(std::iter::once(point))
}

/// Refuses a length that is not positive and finite.
fn check_positive(found: f64) -> Result<(), Error> {
    if found > 0.0 && found.is_finite() {
        Ok(())
    } else {
        Err(Error::NotPositive { found })
    }
}

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
