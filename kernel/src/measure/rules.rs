//! Volumes of single pieces by other rules than the adaptive one: to check it, and to repeat
//! what A. Sisojevs measured.
//!
//! All take `1/2 (x, y, 0) . normal` over the piece, the volume between it and the z axis: faces
//! at right angles to that axis have none, so that tubes between two such planes need no caps.

use super::piece::{ALL, Piece, Rule};
use super::sums::Sums;
use crate::BezierSurface;
use crate::bernstein::binomials;
use glam::DVec3;

/// How the volume between a piece and the z axis is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VolumeRule {
    /// Gauss's rule with `ceil(3 p / 2)` nodes along each parameter: exact for polynomial
    /// pieces.
    Gauss,
    /// The closed formula in the control points of polynomial pieces (Sisojevs's equations (26)
    /// and (27), corrected). Takes `((p + 1) (q + 1))^3` steps.
    Formula,
    /// As many nodes as given along each parameter, from one end to the other, of equal weight,
    /// as (24) is printed: of the first order.
    Printed(usize),
    /// As many nodes as given along each parameter, in the middles of equal steps: of the second
    /// order.
    Midpoint(usize),
}

impl BezierSurface {
    /// The volume between the piece and the z axis, counted along `du x dv`; `None` if the piece
    /// is rational and the rule is for polynomials.
    ///
    /// Summed over the faces of a closed body with their normals outwards, or over the sides of
    /// a tube between two planes at right angles to the z axis, it is the volume inside.
    pub fn volume(&self, rule: VolumeRule) -> Option<f64> {
        let degrees = [self.degree_u(), self.degree_v()];
        let is_polynomial = !crate::curve::are_rational(self.homogeneous());
        match rule {
            VolumeRule::Formula => is_polynomial.then(|| formula(self)),
            VolumeRule::Gauss if !is_polynomial => None,
            VolumeRule::Gauss => {
                let rules = degrees.map(|degree| Rule::new((3 * degree).div_ceil(2)));
                Some(summed(self, &rules))
            }
            VolumeRule::Printed(count) => {
                let last = count.max(2) - 1;
                Some(summed(self, &even(count, |k| k as f64 / last as f64)))
            }
            VolumeRule::Midpoint(count) => {
                let middle = |k: usize| (k as f64 + 0.5) / count as f64;
                Some(summed(self, &even(count, middle)))
            }
        }
    }
}

/// A rule of nodes of equal weight, for both parameters.
fn even(count: usize, node: impl Fn(usize) -> f64) -> [Rule; 2] {
    let weight = 1.0 / count as f64;
    let nodes: Vec<_> = (0..count).map(|k| (node(k), weight)).collect();
    [nodes.clone(), nodes].map(|nodes| Rule { nodes })
}

/// The integral by a rule for each parameter.
fn summed(surface: &BezierSurface, rules: &[Rule; 2]) -> f64 {
    let piece = Piece::new(surface, DVec3::ZERO, Sums::default());
    let mut sum = 0.0;
    for &(t, weight_t) in &rules[1].nodes {
        let row = piece.row::<ALL>(t);
        for &(s, weight_s) in &rules[0].nodes {
            let (point, normal) = piece.at(&row, s);
            sum += (point.x * normal.x + point.y * normal.y) * (weight_s * weight_t);
        }
    }
    sum * 0.5
}

/// Equation (26) for a polynomial piece.
fn formula(piece: &BezierSurface) -> f64 {
    let (n, m) = (piece.degree_u(), piece.degree_v());
    let weight = piece.homogeneous()[0].w;
    let points: Vec<DVec3> = piece
        .homogeneous()
        .iter()
        .map(|h| h.truncate() / weight)
        .collect();
    let (along_u, along_v) = (Integral::new(n), Integral::new(m));
    let net = || (0..=n).flat_map(|i| (0..=m).map(move |j| (i, j)));
    let factor = |i: usize, j: usize| along_u.binomial[i] * along_v.binomial[j];
    let mut sum = 0.0;
    for (i1, j1) in net() {
        let x = points[i1 * (m + 1) + j1].x * factor(i1, j1);
        for (i2, j2) in net() {
            let xy = x * points[i2 * (m + 1) + j2].y * factor(i2, j2);
            for (i3, j3) in net() {
                let xyz = xy * points[i3 * (m + 1) + j3].z * factor(i3, j3);
                let u = |i: usize| along_u.value(i1 + i2 + i3, i);
                let v = |j: usize| along_v.value(j1 + j2 + j3, j);
                sum += xyz * (u(i2) * v(j3) - u(i3) * v(j2) + u(i3) * v(j1) - u(i1) * v(j3));
            }
        }
    }
    sum * 0.5
}

/// The integrals of products of three Bernstein polynomials without their binomials, one of them
/// differentiated: equation (27) in closed form,
/// `T(s, a) = (a - s / 3) (s - 1)! (3 n - s - 1)! / (3 n - 1)!`, and -1/3 and 1/3 at the ends.
struct Integral {
    degree: usize,
    binomial: Vec<f64>,
    /// `(s - 1)! (3 n - s - 1)! / (3 n - 1)!`, by `s`.
    factors: Vec<f64>,
}

impl Integral {
    fn new(degree: usize) -> Self {
        let last = 3 * degree;
        // For s = 1 it is 1 / (3 n - 1); each next one is s / (3 n - s - 1) times the one before.
        let mut factors = vec![0.0, 1.0 / (last as f64 - 1.0)];
        for s in 1..last - 1 {
            factors.push(factors[s] * s as f64 / (last - s - 1) as f64);
        }
        Self {
            degree,
            binomial: binomials(degree).collect(),
            factors,
        }
    }

    fn value(&self, sum: usize, index: usize) -> f64 {
        if sum == 0 {
            -1.0 / 3.0
        } else if sum == 3 * self.degree {
            1.0 / 3.0
        } else {
            (index as f64 - sum as f64 / 3.0) * self.factors[sum]
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use glam::DVec2;

    use super::*;
    use crate::{KnotVector, Surface};

    /// The control points of a quarter of a circle, about.
    fn quarter(turn: u32) -> [DVec2; 4] {
        let kappa = 4.0 / 3.0 * (2.0_f64.sqrt() - 1.0);
        let turn = DVec2::from_angle(FRAC_PI_2 * f64::from(turn));
        let points = [(1.0, 0.0), (1.0, kappa), (kappa, 1.0), (0.0, 1.0)];
        points.map(|p| turn.rotate(DVec2::from(p)))
    }

    fn bezier(degrees: [usize; 2], points: &[DVec3]) -> Vec<BezierSurface> {
        let [u, v] = degrees.map(|degree| KnotVector::bezier(degree, 0.0..1.0).unwrap());
        Surface::new(u, v, points, None).unwrap().bezier_pieces()
    }

    /// Eight bicubic octants of a unit sphere.
    fn octants() -> Vec<BezierSurface> {
        let [a, b] = [3, 0].map(quarter);
        let octant = |turn: u32, profile: [DVec2; 4]| {
            let around = quarter(turn);
            let net = around
                .iter()
                .flat_map(|p| profile.map(|q| (p * q.x).extend(q.y)));
            bezier([3, 3], &net.collect::<Vec<_>>())
        };
        (0..4)
            .flat_map(|turn| [octant(turn, a), octant(turn, b)])
            .flatten()
            .collect()
    }

    fn total(pieces: &[BezierSurface], rule: VolumeRule) -> f64 {
        pieces.iter().map(|piece| piece.volume(rule).unwrap()).sum()
    }

    #[test]
    fn a_box_is_exact() {
        let face = |p: [f64; 3], u: [f64; 3], v: [f64; 3]| {
            let [p, u, v] = [p, u, v].map(DVec3::from);
            bezier([1, 1], &[p, p + v, p + u, p + u + v])
        };
        let faces = [
            face([2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 5.0]),
            face([0.0, 0.0, 0.0], [0.0, 0.0, 5.0], [0.0, 3.0, 0.0]),
            face([0.0, 3.0, 0.0], [0.0, 0.0, 5.0], [2.0, 0.0, 0.0]),
            face([0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 5.0]),
            face([0.0, 0.0, 5.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]),
            face([0.0, 0.0, 0.0], [0.0, 3.0, 0.0], [2.0, 0.0, 0.0]),
        ];
        for rule in [VolumeRule::Gauss, VolumeRule::Formula] {
            let each = faces.each_ref().map(|face| total(face, rule));
            for (found, expected) in each.iter().zip([15.0, 0.0, 15.0, 0.0, 0.0, 0.0]) {
                assert!((found - expected).abs() < 1e-13, "{rule:?} {each:?}");
            }
            assert!((each.iter().sum::<f64>() - 30.0).abs() < 1e-13);
        }
    }

    #[test]
    fn cylinders_and_octants_are_as_known() {
        let side = |turn: u32| {
            let net = quarter(turn).into_iter();
            let net = net.flat_map(|p| (0..4).map(move |k| p.extend(2.0 / 3.0 * f64::from(k))));
            bezier([3, 3], &net.collect::<Vec<_>>())
        };
        let cylinder: Vec<_> = (0..4).flat_map(side).collect();
        for rule in [VolumeRule::Gauss, VolumeRule::Formula] {
            assert!((total(&cylinder, rule) - 6.284_944_665_313_018).abs() < 1e-13);
            assert!((total(&octants(), rule) - 4.191_725_124_465_059).abs() < 1e-13);
        }
        let ball = total(&octants(), VolumeRule::Formula) / (4.0 / 3.0 * PI) - 1.0;
        assert!((ball - 7.006_606e-4).abs() < 1e-9);
    }

    #[test]
    fn formula_and_gauss_agree() {
        let noise = |k: usize, seed: f64| (k as f64 * 12.9898 + seed).sin();
        for degrees in [[1, 1], [1, 4], [2, 2], [3, 3], [2, 5], [4, 3], [7, 2]] {
            let count = (degrees[0] + 1) * (degrees[1] + 1);
            let point = |k| DVec3::new(noise(k, 1.0), noise(k, 20.0), noise(k, 300.0));
            let pieces = bezier(degrees, &(0..count).map(point).collect::<Vec<_>>());
            let [a, b] = [VolumeRule::Gauss, VolumeRule::Formula].map(|rule| total(&pieces, rule));
            assert!((a - b).abs() < 1e-13, "{degrees:?}: {a} {b}");
        }
    }

    #[test]
    fn orders_are_as_known() {
        let exact = total(&octants(), VolumeRule::Gauss);
        let error = |rule| total(&octants(), rule) / exact - 1.0;
        for (count, printed, midpoint) in [(10, 3.144e-2, -7.347e-4), (100, 2.982e-3, -7.248e-6)] {
            let found = [VolumeRule::Printed(count), VolumeRule::Midpoint(count)].map(error);
            assert!((found[0] / printed - 1.0).abs() < 1e-3, "{found:?}");
            assert!((found[1] / midpoint - 1.0).abs() < 1e-3, "{found:?}");
        }
    }

    #[test]
    fn rational_pieces_have_no_formula() {
        use crate::modelling::{Frame, sphere};
        let turn = 0.0..2.0 * PI;
        let ball = sphere(&Frame::WORLD, 1.0, turn, -FRAC_PI_2..FRAC_PI_2).unwrap();
        let pieces = ball.bezier_pieces();
        assert_eq!(pieces[0].volume(VolumeRule::Formula), None);
        assert_eq!(pieces[0].volume(VolumeRule::Gauss), None);
        let found = total(&pieces, VolumeRule::Midpoint(200));
        assert!((found / (4.0 / 3.0 * PI) - 1.0).abs() < 1e-5);
    }
}
