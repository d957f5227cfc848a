//! A polygon in space as triangles: a fan where it is convex, else by cutting off ears.

use glam::{DVec2, DVec3};

/// How many corner tests all polygons of a file may cost together.
pub const TESTS: usize = 500_000_000;

/// Triangles that fill the polygon, or `None` if it crosses itself or `tests`, of which what
/// is used is taken off, do not suffice.
pub fn triangles(points: &[DVec3], tests: &mut usize) -> Option<Vec<[usize; 3]>> {
    let fan = |n: usize| (2..n).map(|i| [0, i - 1, i]).collect();
    let flat = flattened(points);
    let n = flat.len();
    if (0..n).all(|i| turn(flat[(i + n - 1) % n], flat[i], flat[(i + 1) % n]) >= 0.0)
        && winds_once(&flat)
    {
        return Some(fan(n));
    }
    let mut rest: Vec<usize> = (0..n).collect();
    let mut cut = Vec::new();
    let (mut at, mut misses) = (0, 0);
    while rest.len() > 3 {
        let m = rest.len();
        at %= m;
        let ear = [rest[(at + m - 1) % m], rest[at], rest[(at + 1) % m]];
        *tests = tests.checked_sub(m).filter(|_| misses <= m)?;
        if is_ear(ear, &rest, &flat) {
            cut.push(ear);
            rest.remove(at);
            misses = 0;
            // Going back one corner keeps the triangles from becoming a fan of slivers.
            at = (at + rest.len() - 1) % rest.len();
        } else {
            misses += 1;
            at += 1;
        }
    }
    cut.push([rest[0], rest[1], rest[2]]);
    Some(cut)
}

/// Whether four corners turn one way all around, seen across their area; then a fan fills them.
pub(crate) fn is_convex_quad([a, b, c, d]: [DVec3; 4]) -> bool {
    let area = (c - a).cross(d - b);
    let sides = [b - a, c - b, d - c, a - d];
    (0..4).all(|i| sides[i].cross(sides[(i + 1) % 4]).dot(area) > 0.0)
}

/// The polygon in the plane across its area vector, where it runs counter-clockwise.
fn flattened(points: &[DVec3]) -> Vec<DVec2> {
    let size = points
        .iter()
        .fold(0.0, |s: f64, p| s.max(p.abs().max_element()));
    let scaled = |p: &DVec3| *p / size.max(f64::MIN_POSITIVE);
    let points: Vec<_> = points.iter().map(scaled).collect();
    let n = points.len();
    let area: DVec3 = (1..n)
        .map(|i| (points[i] - points[0]).cross(points[(i + 1) % n] - points[0]))
        .sum();
    let (x, y) = area
        .try_normalize()
        .unwrap_or(DVec3::Z)
        .any_orthonormal_pair();
    // `any_orthonormal_pair` makes a right-handed frame with the axis it is called on.
    points
        .iter()
        .map(|p| DVec2::new((p - points[0]).dot(x), (p - points[0]).dot(y)))
        .collect()
}

/// Twice the area of a triangle, positive if it runs counter-clockwise.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Whether a polygon that only turns left goes around once, not more often as a star does.
fn winds_once(flat: &[DVec2]) -> bool {
    let next = |i: usize| flat[(i + 1) % flat.len()] - flat[i];
    let edges: Vec<_> = (0..flat.len())
        .map(next)
        .filter(|e| *e != DVec2::ZERO)
        .collect();
    let bends = (0..edges.len()).map(|i| edges[i].angle_to(edges[(i + 1) % edges.len()]));
    bends.sum::<f64>() < 3.0 * std::f64::consts::PI
}

/// Whether the middle corner can be cut off: it turns left and no corner lies in the triangle.
fn is_ear(ear: [usize; 3], rest: &[usize], flat: &[DVec2]) -> bool {
    let [a, b, c] = ear.map(|i| flat[i]);
    if turn(a, b, c) < 0.0 {
        return false;
    }
    rest.iter().filter(|i| !ear.contains(i)).all(|&i| {
        let p = flat[i];
        let copy = p == a || p == b || p == c;
        copy || turn(a, b, p) < 0.0 || turn(b, c, p) < 0.0 || turn(c, a, p) < 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[DVec3]) -> (usize, f64) {
        let cut = triangles(points, &mut 1000).unwrap();
        let twice = |t: &[usize; 3]| {
            let [a, b, c] = t.map(|i| points[i]);
            (b - a).cross(c - a).z
        };
        assert!(cut.iter().all(|t| twice(t) >= -1e-12));
        (cut.len(), cut.iter().map(twice).sum::<f64>() / 2.0)
    }

    fn flat(corners: &[[f64; 2]]) -> Vec<DVec3> {
        corners
            .iter()
            .map(|c| DVec3::new(c[0], c[1], 0.0))
            .collect()
    }

    #[test]
    fn a_square_is_a_fan() {
        let square = flat(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]]);
        assert_eq!(triangles(&square, &mut 0).unwrap(), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn concave_polygons_keep_their_area() {
        // An L, beginning at a corner from which a fan would leave it.
        let l = flat(&[[2., 0.], [2., 1.], [1., 1.], [1., 2.], [0., 2.], [0., 0.]]);
        assert_eq!(area(&l), (4, 3.0));
        // An arrow head whose notch is nearly at its tip.
        let arrow = flat(&[[0., 0.], [4., 0.], [0., 4.], [0.9, 0.9]]);
        assert_eq!(area(&arrow).0, 2);
    }

    #[test]
    fn points_on_an_edge_and_doubled_points_are_harmless() {
        let edge = flat(&[[0., 0.], [1., 0.], [2., 0.], [2., 1.], [2., 1.], [0., 1.]]);
        assert_eq!(area(&edge), (4, 2.0));
        let point = triangles(&flat(&[[1., 1.]; 5]), &mut 1000);
        assert_eq!(point.map(|cut| cut.len()), Some(3));
    }

    #[test]
    fn tangled_polygons_and_spent_budgets_are_refused() {
        let corners: Vec<_> = (0..7)
            .map(|i| f64::from(3 * i) * std::f64::consts::TAU / 7.0)
            .map(|angle| [angle.cos(), angle.sin()])
            .collect();
        assert_eq!(triangles(&flat(&corners), &mut 1000), None);
        let dart = flat(&[[4., 0.], [0., 4.], [0.9, 0.9], [0., 0.]]);
        assert_eq!(triangles(&dart, &mut 3), None);
    }
}
