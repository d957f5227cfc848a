//! Cameras: from a place on the film to a ray.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use crate::{Aabb, Ray};

/// How a camera maps the world to its film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Rays through one point; the angle between the upper and lower edge of the picture,
    /// in radians.
    Perspective {
        /// Full opening angle across the height, above 0 and below pi.
        vertical_fov: f64,
    },
    /// As [`Projection::Perspective`], across the shorter side of the picture.
    PerspectiveShorter {
        /// Full opening angle across the shorter side, above 0 and below pi.
        fov: f64,
    },
    /// Parallel rays; the extent across the shorter side of the picture, in scene units.
    Orthographic {
        /// Extent across the shorter side, above 0 and finite.
        extent: f64,
    },
    /// Parallel rays; pictures of every shape show all of a window.
    OrthographicWindow {
        /// Width and height of the window, in scene units, above 0 and finite.
        size: DVec2,
    },
}

impl Projection {
    /// Whether its numbers are in their ranges.
    fn is_valid(&self) -> bool {
        let is_positive = |x: f64| x > 0.0 && x.is_finite();
        match *self {
            Self::Perspective { vertical_fov: fov } | Self::PerspectiveShorter { fov } => {
                fov > 0.0 && fov < PI
            }
            Self::Orthographic { extent } => is_positive(extent),
            Self::OrthographicWindow { size } => is_positive(size.x) && is_positive(size.y),
        }
    }
}

/// A camera in world coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The name in the file, or empty.
    pub name: String,
    /// A second name in the file, or empty.
    pub alias: String,
    eye: DVec3,
    forward: DVec3,
    right: DVec3,
    up: DVec3,
    projection: Projection,
}

/// Opening angle of the cameras we place ourselves.
const FRAMING_FOV: f64 = 35.0 * PI / 180.0;

/// How often two points are looked for that are to lie as far on both sides of a picture.
const CENTRING_STEPS: usize = 32;

/// Room around the object in a framed picture, as a factor.
const FRAMING_MARGIN: f64 = 1.08;

/// The sideways step from which points, told by their place along it and their depth, reach equally
/// far to both sides of a picture.
fn middle_step(points: &[(f64, f64)]) -> f64 {
    let mut step = 0.0;
    for _ in 0..CENTRING_STEPS {
        let slope = |&(x, depth): &(f64, f64)| (x - step) / depth;
        let by_slope = |a: &&(f64, f64), b: &&(f64, f64)| slope(a).total_cmp(&slope(b));
        let outermost = [
            points.iter().min_by(by_slope),
            points.iter().max_by(by_slope),
        ];
        let [Some(&(left, left_depth)), Some(&(right, right_depth))] = outermost else {
            break;
        };
        let next = (left * right_depth + right * left_depth) / (left_depth + right_depth);
        if !next.is_finite() || (next - step).abs() <= f64::EPSILON * (right - left) {
            break;
        }
        step = next;
    }
    step
}

impl Camera {
    /// A camera at `eye` that looks at `target` with `up` upwards in the picture.
    ///
    /// If `up` is parallel to the view, another direction is chosen. `None` if `eye` and
    /// `target` coincide, `up` has no length, a number is not finite or one of `projection` is
    /// out of its range.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, projection: Projection) -> Option<Self> {
        let forward = (target - eye).try_normalize()?;
        let right = forward
            .cross(up.try_normalize()?)
            .try_normalize()
            .filter(|_| forward.cross(up.normalize()).length() > 1e-9)
            .unwrap_or_else(|| forward.any_orthonormal_vector());
        let up = right.cross(forward);
        (eye.is_finite() && projection.is_valid()).then_some(Self {
            name: String::new(),
            alias: String::new(),
            eye,
            forward,
            right,
            up,
            projection,
        })
    }

    /// A camera that shows all of `boxes`, three-quarter from above, as large as a picture
    /// with the given ratio of width to height allows.
    ///
    /// Many small boxes around a body frame it tighter than one large one. `up` is the upward
    /// axis of the scene. Nothing is taken for the origin, and boxes without extent are seen
    /// from one unit away.
    pub fn framing(boxes: &[Aabb], up: DVec3, aspect: f64) -> Self {
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
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
            alias: String::new(),
            eye: center,
            forward,
            right: forward.cross(up).normalize(),
            up: forward.cross(up).normalize().cross(forward),
            projection,
        };
        // Along each side of the picture a corner at (x, depth z towards the camera) is seen
        // from the distance d and the sideways step c if |x - c| <= slope (d - z); there is such a
        // step if the sum of what both ways need is no more than 2 slope d.
        let slope = (FRAMING_FOV * 0.5).tan() / FRAMING_MARGIN;
        let corners = |b: &Aabb| {
            b.corners()
                .into_iter()
                .take(if b.min == b.max { 1 } else { 8 })
        };
        let mut corners: Vec<_> = boxes.iter().flat_map(corners).collect();
        if bounds.is_empty() {
            corners = vec![center];
        }
        let fit = |axis: DVec3, slope: f64| {
            let reach = |axis: DVec3| {
                let ways = corners
                    .iter()
                    .map(|&p| (p - center).dot(axis - forward * slope));
                ways.fold(f64::NEG_INFINITY, f64::max)
            };
            (reach(axis) + reach(-axis)) / (2.0 * slope)
        };
        let shorter = shorter_side(aspect) * slope;
        let far = fit(camera.right, shorter.x).max(fit(camera.up, shorter.y));
        // Outside the sphere around the boxes in any case.
        let distance = radius.max(far);
        let centred = |axis: DVec3| {
            let seen = |p: &DVec3| {
                let way = *p - center;
                (way.dot(axis), distance + way.dot(forward))
            };
            let seen: Vec<_> = corners.iter().map(seen).collect();
            middle_step(&seen)
        };
        let steps = camera.right * centred(camera.right) + camera.up * centred(camera.up);
        camera.eye = center + steps - forward * distance;
        camera
    }

    /// The same camera with parallel rays, showing about the same extent at `distance`, which is
    /// above 0 and finite.
    #[must_use]
    pub fn into_orthographic(mut self, distance: f64) -> Self {
        if let Projection::Perspective { vertical_fov: fov }
        | Projection::PerspectiveShorter { fov } = self.projection
        {
            let extent = 2.0 * distance * (fov * 0.5).tan();
            self.projection = Projection::Orthographic { extent };
        }
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
        self.lens(aspect).ray(film)
    }

    /// The camera as it takes pictures with the given ratio of width to height.
    pub fn lens(&self, aspect: f64) -> Lens {
        let shorter = shorter_side(aspect);
        let (half, is_parallel) = match self.projection {
            Projection::Perspective { vertical_fov } => {
                (DVec2::new(aspect, 1.0) * (vertical_fov * 0.5).tan(), false)
            }
            Projection::PerspectiveShorter { fov } => (shorter * (fov * 0.5).tan(), false),
            Projection::Orthographic { extent } => (shorter * (extent * 0.5), true),
            Projection::OrthographicWindow { size } => {
                let shown = size.max(DVec2::new(size.y * aspect, size.x / aspect));
                (shown * 0.5, true)
            }
        };
        Lens {
            eye: self.eye,
            forward: self.forward,
            right: self.right,
            up: self.up,
            half,
            is_parallel,
        }
    }
}

/// A camera for pictures of one shape; see [`Camera::ray`].
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    eye: DVec3,
    forward: DVec3,
    right: DVec3,
    up: DVec3,
    /// Half the extents of the film, at distance one for perspective.
    pub half: DVec2,
    /// Whether all rays have one direction.
    pub is_parallel: bool,
}

impl Lens {
    /// The ray through `film`, from (-1, -1) at the lower left to (1, 1) at the upper right.
    #[inline]
    pub fn ray(&self, film: DVec2) -> Ray {
        let offset = self.right * (film.x * self.half.x) + self.up * (film.y * self.half.y);
        if self.is_parallel {
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

/// Half the extents of a picture whose shorter side extends from -1 to 1.
fn shorter_side(aspect: f64) -> DVec2 {
    DVec2::new(aspect.max(1.0), (1.0 / aspect).max(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const VIEW: Projection = Projection::Perspective { vertical_fov: 0.9 };

    /// Film coordinates and depth of a point.
    fn project(camera: &Camera, point: DVec3, aspect: f64) -> (DVec2, f64) {
        let [corner, center] = [DVec2::ONE, DVec2::ZERO].map(|film| camera.ray(film, aspect));
        let (offset, depth) = (
            point - camera.eye(),
            (point - camera.eye()).dot(camera.forward()),
        );
        let half = corner.direction - center.direction;
        let place = |axis: DVec3| offset.dot(axis) / (depth * half.dot(axis));
        (DVec2::new(place(camera.right()), place(camera.up())), depth)
    }

    #[test]
    fn framing_shows_all_of_a_box_at_every_scale() {
        let shapes = [
            DVec3::ONE,
            DVec3::new(1.0, 0.0, 1.0),
            DVec3::new(0.0, 0.0, 1.0),
            DVec3::new(1.0, 0.0, 0.0),
            DVec3::new(1.0, 100.0, 0.1),
            DVec3::new(50.0, 42.0, 75.0),
        ];
        let ups = [
            DVec3::Y,
            DVec3::Z,
            DVec3::X,
            DVec3::NEG_Z,
            DVec3::new(0.0, 3.0, 3.0),
        ];
        for (shape, up) in shapes.iter().flat_map(|s| ups.map(|up| (*s, up))) {
            for scale in [1e-6, 1.0, 1e6] {
                let min = DVec3::new(-0.3, 0.2, 5.0) * scale;
                let bounds = Aabb {
                    min,
                    max: min + shape * scale,
                };
                for aspect in [0.2, 1.0, 16.0 / 9.0] {
                    let camera = Camera::framing(&[bounds], up, aspect);
                    assert!(camera.up().dot(up) > 0.0 && camera.forward().dot(up) < 0.0);
                    let (mut least, mut most) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
                    for corner in bounds.corners() {
                        let (film, depth) = project(&camera, corner, aspect);
                        assert!(depth > 0.0 && film.abs().max_element() <= 1.0, "{film}");
                        (least, most) = (least.min(film), most.max(film));
                    }
                    assert!(most.max_element() > 0.05, "{shape} {most}");
                    assert!((least + most).abs().max_element() < 1e-9, "{least} {most}");
                }
            }
        }
    }

    #[test]
    fn framing_of_nothing_and_of_a_point_is_a_camera() {
        let place = DVec3::new(1.0, 2.0, 3.0);
        for (bounds, center) in [(Aabb::EMPTY, DVec3::ZERO), (Aabb::around([place]), place)] {
            let camera = Camera::framing(&[bounds], DVec3::Y, 1.0);
            assert!(camera.eye().is_finite());
            let (film, depth) = project(&camera, center, 1.0);
            assert!(film.length() < 1e-12 && (depth - 1.0).abs() < 1e-12);
        }
        assert!(
            Camera::framing(&[Aabb::EMPTY], DVec3::ZERO, 1.0)
                .eye()
                .is_finite()
        );
    }

    #[test]
    fn axes_are_right_handed_unit_vectors() {
        let eye = DVec3::new(1.0, 2.0, 3.0);
        for up in [DVec3::Y, DVec3::Z * 5.0, DVec3::new(-1.0, -2.0, -3.0), eye] {
            let camera = Camera::look_at(eye, DVec3::ZERO, up, VIEW).unwrap();
            let (f, r, u) = (camera.forward(), camera.right(), camera.up());
            assert!(f.distance(-eye.normalize()) < 1e-15);
            assert!(r.cross(f).distance(u) < 1e-15 && f.dot(r).abs() < 1e-15);
            assert!([f, r, u].iter().all(|axis| axis.is_normalized()));
        }
    }

    #[test]
    fn a_view_without_direction_is_no_camera() {
        let (eye, far) = (DVec3::ONE, DVec3::X * f64::INFINITY);
        assert_eq!(Camera::look_at(eye, eye, DVec3::Y, VIEW), None);
        assert_eq!(Camera::look_at(eye, DVec3::ZERO, DVec3::ZERO, VIEW), None);
        assert_eq!(Camera::look_at(far, eye, DVec3::Y, VIEW), None);
        assert_eq!(Camera::look_at(eye, DVec3::NAN, DVec3::Y, VIEW), None);
    }

    #[test]
    fn a_projection_out_of_range_is_no_camera() {
        let camera = |view| Camera::look_at(DVec3::ONE, DVec3::ZERO, DVec3::Y, view);
        let window = |x, y| Projection::OrthographicWindow {
            size: DVec2::new(x, y),
        };
        for fov in [f64::NAN, f64::INFINITY, -1.0, 0.0, PI, 4.0] {
            assert_eq!(camera(Projection::PerspectiveShorter { fov }), None);
            let vertical_fov = fov;
            assert_eq!(camera(Projection::Perspective { vertical_fov }), None);
        }
        for extent in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
            assert_eq!(camera(Projection::Orthographic { extent }), None);
            assert_eq!(camera(window(extent, 1.0)), None);
            assert_eq!(camera(window(1.0, extent)), None);
        }
        assert!(camera(window(1e-300, 1e300)).is_some());
    }

    #[test]
    fn rays_start_at_the_eye_and_meet_the_edges_of_the_field_of_view() {
        let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, VIEW).unwrap();
        let center = camera.ray(DVec2::ZERO, 2.0);
        assert_eq!(
            (center.origin, center.direction),
            (DVec3::ZERO, DVec3::NEG_Z)
        );
        let upper = camera.ray(DVec2::Y, 2.0).direction;
        assert!((upper.angle_between(DVec3::NEG_Z) - 0.45).abs() < 1e-15);
        assert!((upper.z + 1.0).abs() < 1e-15);
        let right = camera.ray(DVec2::X, 2.0).direction;
        assert!((right.x - 2.0 * 0.45_f64.tan()).abs() < 1e-15);
        // Across the shorter side, whichever it is.
        let shorter = Projection::PerspectiveShorter { fov: 0.9 };
        let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, shorter).unwrap();
        for (film, aspect) in [(DVec2::Y, 2.0), (DVec2::X, 0.5)] {
            let edge = camera.ray(film, aspect).direction;
            assert!((edge.angle_between(DVec3::NEG_Z) - 0.45).abs() < 1e-15);
        }
        let parallel = camera.into_orthographic(10.0).ray(DVec2::Y, 2.0);
        assert_eq!(parallel.direction, DVec3::NEG_Z);
        assert!((parallel.origin.y - 10.0 * 0.45_f64.tan()).abs() < 1e-14);
    }

    #[test]
    fn windows_are_seen_as_a_whole_in_pictures_of_every_shape() {
        let size = DVec2::new(4.0, 6.0);
        let view = Projection::OrthographicWindow { size };
        let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, view).unwrap();
        let square = Projection::Orthographic { extent: 6.0 };
        let other = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, square).unwrap();
        for (aspect, half) in [
            (2.0, [6.0, 3.0]),
            (0.5, [2.0, 4.0]),
            (2.0 / 3.0, [2.0, 3.0]),
        ] {
            let found = camera.lens(aspect).half;
            assert!(found.abs_diff_eq(DVec2::from(half), 1e-15), "{found}");
            // Squares are the extents of the shorter side.
            let size = DVec2::splat(6.0);
            let view = Projection::OrthographicWindow { size };
            let same = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, view).unwrap();
            assert_eq!(same.lens(aspect).half, other.lens(aspect).half);
        }
    }
}
