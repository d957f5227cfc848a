//! Rays and triangles: for the polygonal parts of a file only.

use glam::{DVec2, DVec3};
use kernel::Ray;

/// A ray that is to meet triangles.
pub(crate) struct Sheared {
    origin: DVec3,
    /// The axes, so that the ray runs mainly along the last one.
    axes: [usize; 3],
    /// Shears the ray onto that axis.
    shear: DVec3,
}

impl Sheared {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        let d = ray.direction;
        let axes = match d.abs().max_position() {
            0 => [1, 2, 0],
            1 => [2, 0, 1],
            _ => [0, 1, 2],
        };
        let [x, y, z] = axes.map(|axis| d[axis]);
        Self {
            origin: ray.origin,
            axes,
            shear: DVec3::new(x / z, y / z, 1.0 / z),
        }
    }

    /// Where the ray's line meets a triangle: `t` and the barycentric coordinates of the second
    /// and third corner. Edges and corners belong to the triangle.
    ///
    /// Signed volumes, computed so that both triangles of an edge see the same numbers and no
    /// ray slips between them \[Woop 13\].
    #[inline(always)]
    pub(crate) fn meet(&self, corners: &[DVec3; 3]) -> Option<(f64, DVec2)> {
        let shear = self.shear;
        let [a, b, c] = corners.map(|corner| {
            let p = corner - self.origin;
            let [x, y, z] = self.axes.map(|axis| p[axis]);
            DVec3::new(x - shear.x * z, y - shear.y * z, shear.z * z)
        });
        let u = c.x * b.y - c.y * b.x;
        let v = a.x * c.y - a.y * c.x;
        let w = b.x * a.y - b.y * a.x;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let sum = u + v + w;
        if sum == 0.0 {
            return None;
        }
        let t = (u * a.z + v * b.z + w * c.z) / sum;
        t.is_finite().then_some((t, DVec2::new(v / sum, w / sum)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hit_inside_and_on_the_edge_but_not_beside() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let down = |x, y| Ray {
            origin: DVec3::new(x, y, 2.0),
            direction: -DVec3::Z * 2.0,
        };
        let (t, uv) = Sheared::new(&down(0.25, 0.5)).meet(&corners).unwrap();
        assert_eq!((t, uv), (1.0, DVec2::new(0.25, 0.5)));
        assert!(Sheared::new(&down(0.5, 0.0)).meet(&corners).is_some());
        assert!(Sheared::new(&down(0.5, -1e-12)).meet(&corners).is_none());
    }
}
