//! Rays and triangles: for the polygonal parts of a file only.

use glam::{DVec2, DVec3};
use kernel::Ray;

/// Where the ray's line meets a triangle: `t` and the barycentric coordinates of the second
/// and third corner. Edges and corners belong to the triangle.
///
/// Signed volumes, computed so that both triangles of an edge see the same numbers and no
/// ray slips between them \[Woop 13\].
pub(crate) fn intersect(ray: &Ray, corners: &[DVec3; 3]) -> Option<(f64, DVec2)> {
    // Permute the axes so that the ray runs mainly along z, and shear it onto that axis.
    let d = ray.direction;
    let (kx, ky, kz) = match d.abs().max_position() {
        0 => (1, 2, 0),
        1 => (2, 0, 1),
        _ => (0, 1, 2),
    };
    let (sx, sy, sz) = (d[kx] / d[kz], d[ky] / d[kz], 1.0 / d[kz]);
    let [a, b, c] = corners.map(|corner| {
        let p = corner - ray.origin;
        DVec3::new(p[kx] - sx * p[kz], p[ky] - sy * p[kz], sz * p[kz])
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
        let (t, uv) = intersect(&down(0.25, 0.5), &corners).unwrap();
        assert_eq!((t, uv), (1.0, DVec2::new(0.25, 0.5)));
        assert!(intersect(&down(0.5, 0.0), &corners).is_some());
        assert!(intersect(&down(0.5, -1e-12), &corners).is_none());
    }
}
