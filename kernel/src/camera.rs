//! Cameras: from a place on the film to a ray.

use glam::{DVec2, DVec3};

use crate::{Aabb, Ray};

/// How a camera maps the world to its film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Rays through one point; the angle between the upper and lower edge of the picture,
    /// in radians.
    Perspective {
        /// Full opening angle across the height.
        vertical_fov: f64,
    },
    /// As [`Projection::Perspective`], across the shorter side of the picture.
    PerspectiveShorter {
        /// Full opening angle across the shorter side.
        fov: f64,
    },
    /// Parallel rays; the extent across the shorter side of the picture, in scene units.
    Orthographic {
        /// Extent across the shorter side.
        extent: f64,
    },
}

/// A camera in world coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The name in the file, or empty.
    pub name: String,
    eye: DVec3,
    forward: DVec3,
    right: DVec3,
    up: DVec3,
    projection: Projection,
}

/// Opening angle of the cameras we place ourselves.
const FRAMING_FOV: f64 = 35.0 * std::f64::consts::PI / 180.0;

/// Room around the object in a framed picture, as a factor.
const FRAMING_MARGIN: f64 = 1.08;

impl Camera {
    /// A camera at `eye` that looks at `target` with `up` upwards in the picture.
    ///
    /// If `up` is parallel to the view, another direction is chosen. `None` if `eye` and
    /// `target` coincide, `up` has no length or a number is not finite.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, projection: Projection) -> Option<Self> {
        let forward = (target - eye).try_normalize()?;
        let right = forward
            .cross(up.try_normalize()?)
            .try_normalize()
            .filter(|_| forward.cross(up.normalize()).length() > 1e-9)
            .unwrap_or_else(|| forward.any_orthonormal_vector());
        let up = right.cross(forward);
        eye.is_finite().then_some(Self {
            name: String::new(),
            eye,
            forward,
            right,
            up,
            projection,
        })
    }

    /// A camera that shows all of `bounds`, three-quarter from above, whatever the shape of
    /// the picture.
    ///
    /// `up` is the upward axis of the scene. An empty box is taken for the origin, and a box
    /// without extent is seen from one unit away.
    pub fn framing(bounds: &Aabb, up: DVec3) -> Self {
        let (center, radius) = if bounds.is_empty() {
            (DVec3::ZERO, 1.0)
        } else {
            (bounds.center(), bounds.diagonal() * 0.5)
        };
        let radius = if radius > 0.0 { radius } else { 1.0 };
        let up = up.normalize_or(DVec3::Y);
        let side = if up.z.abs() > 0.5 {
            DVec3::X
        } else {
            up.cross(DVec3::Z).normalize()
        };
        let front = side.cross(up);
        let forward = -(side * 0.5 + front * 0.75 + up * 0.42).normalize();
        let projection = Projection::PerspectiveShorter { fov: FRAMING_FOV };
        let mut camera = Self {
            name: String::new(),
            eye: center,
            forward,
            right: forward.cross(up).normalize(),
            up: forward.cross(up).normalize().cross(forward),
            projection,
        };
        // The least distance outside the sphere around the box from which every corner lies
        // inside the picture.
        let slope = (FRAMING_FOV * 0.5).tan() / FRAMING_MARGIN;
        let corners = if bounds.is_empty() {
            [DVec3::ZERO; 8]
        } else {
            bounds.corners()
        };
        let distance = corners.iter().fold(radius, |distance: f64, corner| {
            let offset = *corner - center;
            let across = offset
                .dot(camera.right)
                .abs()
                .max(offset.dot(camera.up).abs());
            distance.max(across / slope - offset.dot(forward))
        });
        camera.eye = center - forward * distance;
        camera
    }

    /// The same camera with parallel rays, showing about the same extent at `distance`.
    #[must_use]
    pub fn into_orthographic(mut self, distance: f64) -> Self {
        let extent = match self.projection {
            Projection::Perspective { vertical_fov: fov }
            | Projection::PerspectiveShorter { fov } => 2.0 * distance * (fov * 0.5).tan(),
            Projection::Orthographic { extent } => extent,
        };
        self.projection = Projection::Orthographic { extent };
        self
    }

    /// Where the camera stands.
    pub fn eye(&self) -> DVec3 {
        self.eye
    }

    /// The unit vector along the view.
    pub fn forward(&self) -> DVec3 {
        self.forward
    }

    /// The unit vector upwards in the picture.
    pub fn up(&self) -> DVec3 {
        self.up
    }

    /// The unit vector to the right in the picture.
    pub fn right(&self) -> DVec3 {
        self.right
    }

    /// How the world is mapped to the film.
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// The ray through `film`, which goes from (-1, -1) at the lower left to (1, 1) at the
    /// upper right corner of a picture with the given ratio of width to height.
    ///
    /// The direction has component one along the view, so `t` is the depth.
    pub fn ray(&self, film: DVec2, aspect: f64) -> Ray {
        let shorter = DVec2::new(aspect.max(1.0), (1.0 / aspect).max(1.0));
        let (half, parallel) = match self.projection {
            Projection::Perspective { vertical_fov } => {
                (DVec2::new(aspect, 1.0) * (vertical_fov * 0.5).tan(), false)
            }
            Projection::PerspectiveShorter { fov } => (shorter * (fov * 0.5).tan(), false),
            Projection::Orthographic { extent } => (shorter * (extent * 0.5), true),
        };
        let offset = self.right * (film.x * half.x) + self.up * (film.y * half.y);
        if parallel {
            Ray {
                origin: self.eye + offset,
                direction: self.forward,
            }
        } else {
            Ray {
                origin: self.eye,
                direction: self.forward + offset,
            }
        }
    }
}
