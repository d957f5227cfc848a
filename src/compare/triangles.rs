//! The nearest of many triangles.

use glam::DVec3;
use kernel::Aabb;

use crate::segment;
use kernel::BoxTree;

/// The square of the height of a triangle, as a share of that of its side, that is lost in rounding.
const SLIVER: f64 = 1e-8;

/// The point of a triangle nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Closest {
    pub(crate) point: DVec3,
    /// The weights of the corners in it.
    pub(crate) shares: [f64; 3],
}

impl Closest {
    fn at([a, b, c]: [DVec3; 3], shares: [f64; 3]) -> Self {
        Self {
            point: a * shares[0] + b * shares[1] + c * shares[2],
            shares,
        }
    }
}

/// The point of a triangle nearest to `p` \[Ericson 05, section 5.1.5\]; triangles without area
/// are the segments or the point that they are.
pub(crate) fn closest([a, b, c]: [DVec3; 3], p: DVec3) -> Closest {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let normal = ab.cross(ac);
    if normal.length_squared() <= SLIVER * ab.length_squared().max(ac.length_squared()).powi(2) {
        return closest_of_sliver([a, b, c], normal, p);
    }
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    let at = |shares| Closest::at([a, b, c], shares);
    let corner = |k: usize| {
        let mut shares = [0.0; 3];
        shares[k] = 1.0;
        Closest {
            point: [a, b, c][k],
            shares,
        }
    };
    if d1 <= 0.0 && d2 <= 0.0 {
        return corner(0);
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return corner(1);
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return corner(2);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return at([1.0 - t, t, 0.0]);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return at([1.0 - t, 0.0, t]);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return at([0.0, 1.0 - t, t]);
    }
    let sum = va + vb + vc;
    at([va / sum, vb / sum, vc / sum])
}

/// [`closest`], of a triangle so narrow that differences of squares are rounding errors.
fn closest_of_sliver(corners: [DVec3; 3], normal: DVec3, p: DVec3) -> Closest {
    let at = |shares| Closest::at(corners, shares);
    let on_side = |k: usize| {
        let share = segment::share(p, corners[k], corners[(k + 1) % 3]);
        let mut shares = [0.0; 3];
        (shares[k], shares[(k + 1) % 3]) = (1.0 - share, share);
        at(shares)
    };
    // Twice the areas between `p` and the sides, each opposite to a corner.
    let to = corners.map(|corner| corner - p);
    let areas = [(1, 2), (2, 0), (0, 1)].map(|(k, l)| normal.dot(to[k].cross(to[l])));
    let sum: f64 = areas.iter().sum();
    let inner = (areas.iter().all(|&area| area >= 0.0) && sum > 0.0)
        .then(|| at(areas.map(|area| area / sum)));
    [0, 1, 2]
        .map(on_side)
        .into_iter()
        .chain(inner)
        .min_by(|a, b| {
            let [a, b] = [a, b].map(|x| x.point.distance_squared(p));
            a.total_cmp(&b)
        })
        .expect("there are three sides")
}

/// The four parts of a triangle with these corners, divided at a place on each side;
/// the last lies between these.
pub(crate) fn quarters<C: Copy>([a, b, c]: [C; 3], middle: impl Fn(&C, &C) -> C) -> [[C; 3]; 4] {
    let (ab, bc, ca) = (middle(&a, &b), middle(&b, &c), middle(&c, &a));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
}

/// A triangle and its point nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    pub(crate) triangle: u32,
    pub(crate) closest: Closest,
    pub(crate) distance: f64,
}

/// Triangles in a hierarchy of boxes.
#[derive(Debug)]
pub(crate) struct TriangleTree {
    corners: Vec<[DVec3; 3]>,
    tree: BoxTree,
}

impl TriangleTree {
    /// Puts triangles into a tree; they keep their numbers.
    pub(crate) fn new(corners: Vec<[DVec3; 3]>) -> Self {
        let boxes: Vec<_> = corners.iter().map(|t| Aabb::around(*t)).collect();
        let tree = BoxTree::new(&boxes);
        Self { corners, tree }
    }

    /// The corners of the triangles by their numbers.
    pub(crate) fn corners(&self) -> &[[DVec3; 3]] {
        &self.corners
    }

    /// A box around all of them.
    pub(crate) fn bounds(&self) -> Aabb {
        self.tree.bounds()
    }

    /// The nearest triangle; `None` if there is none.
    pub(crate) fn nearest(&self, p: DVec3) -> Option<Found> {
        self.nearest_within(p, f64::INFINITY)
    }

    /// As [`Self::nearest`], and sooner if triangle `guess` is near.
    pub(crate) fn nearest_from(&self, p: DVec3, guess: u32) -> Found {
        let (mut best, mut square) = self.found(guess, p);
        self.tree.visit(p, square, |triangle| {
            let (found, own) = self.found(triangle, p);
            if own < square {
                (best, square) = (found, own);
            }
            square
        });
        best
    }

    /// The nearest triangle no farther away than `reach`; `None` if there is none.
    pub(crate) fn nearest_within(&self, p: DVec3, reach: f64) -> Option<Found> {
        let mut best: Option<Found> = None;
        let mut square = reach * reach;
        self.tree.visit(p, square, |triangle| {
            let (found, own) = self.found(triangle, p);
            if own < square || (best.is_none() && own <= square) {
                square = own;
                best = Some(found);
            }
            square
        });
        best
    }

    /// Shows every triangle no farther from `p` than `reach`, in no particular order.
    pub(crate) fn within(&self, p: DVec3, reach: f64, mut show: impl FnMut(Found)) {
        let square = reach * reach;
        self.tree.visit(p, square, |triangle| {
            let (found, own) = self.found(triangle, p);
            if own <= square {
                show(found);
            }
            square
        });
    }

    /// A triangle's point nearest to `p`, and the square of the distance.
    fn found(&self, triangle: u32, p: DVec3) -> (Found, f64) {
        let closest = closest(self.corners[triangle as usize], p);
        let square = closest.point.distance_squared(p);
        let found = Found {
            triangle,
            closest,
            distance: square.sqrt(),
        };
        (found, square)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers from -1 to 1 that look random.
    fn numbers() -> impl FnMut() -> f64 {
        let mut state = 1_u64;
        move || {
            state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }
    }

    #[test]
    fn nothing_is_nearer_than_the_closest_point() {
        let mut next = numbers();
        let mut point = || DVec3::new(next(), next(), next());
        for _ in 0..200 {
            let (corners, p) = ([point(), point(), point()], point() * 2.0);
            let found = closest(corners, p);
            let [a, b, c] = found.shares;
            assert!((a + b + c - 1.0).abs() < 1e-12 && a.min(b).min(c) >= 0.0);
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let [a, b, c] = [i, j, 20 - i - j].map(|k| f64::from(k) / 20.0);
                    let other = corners[0] * a + corners[1] * b + corners[2] * c;
                    assert!(other.distance(p) >= found.point.distance(p) - 1e-12);
                }
            }
        }
    }

    #[test]
    fn narrow_triangles_have_nearest_points() {
        let mut next = numbers();
        for height in (0..40).map(|k| 0.5_f64.powi(2 * k)) {
            for _ in 0..50 {
                let [x, y] = [next(), next()].map(|x| 0.5 + 0.5 * x);
                // Turned into space; above the point with that share of the two sides that meet.
                let map = |p: DVec3| {
                    DVec3::new(
                        0.6 * p.x - 0.8 * p.y,
                        0.64 * p.x + 0.48 * p.y - 0.6 * p.z,
                        0.48 * p.x + 0.36 * p.y + 0.8 * p.z,
                    )
                };
                let corners = [DVec3::ZERO, DVec3::X, DVec3::new(0.3, height, 0.0)].map(map);
                let [_, b, c] = corners;
                let below = b * (x * (1.0 - y)) + c * y;
                let p = below + map(DVec3::Z);
                let found = closest(corners, p).point;
                assert!(found.distance(below) < 1e-7, "{height} {found} {below}");
            }
        }
    }

    #[test]
    fn triangles_without_area_have_nearest_points() {
        let p = DVec3::new(0.5, 1.0, 0.0);
        let line = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
        assert_eq!(closest(line, p).point, DVec3::X * 0.5);
        assert_eq!(closest([DVec3::X; 3], p).point, DVec3::X);
    }

    #[test]
    fn the_tree_finds_what_a_search_through_all_finds() {
        let mut next = numbers();
        let mut point = || DVec3::new(next(), next(), next());
        let corners: Vec<[DVec3; 3]> = (0..300)
            .map(|_| {
                let a = point();
                [a, a + point() * 0.1, a + point() * 0.1]
            })
            .collect();
        let tree = TriangleTree::new(corners.clone());
        for _ in 0..100 {
            let p = point();
            let all = || corners.iter().map(|&t| closest(t, p).point.distance(p));
            let least = all().fold(f64::INFINITY, f64::min);
            let found = tree.nearest(p).unwrap();
            assert!((found.distance - least).abs() < 1e-14);
            let from = tree.nearest_from(p, 7);
            assert!((from.distance - least).abs() < 1e-14);
            let mut near = 0;
            tree.within(p, 0.3, |_| near += 1);
            assert_eq!(near, all().filter(|&d| d <= 0.3).count());
        }
        assert_eq!(TriangleTree::new(Vec::new()).nearest(DVec3::ZERO), None);
    }
}
