//! Normals, also where the first derivatives vanish.

use glam::{DVec2, DVec3, DVec4};

use crate::Surface;
use crate::spline;

/// Below this sine the product of the first derivatives is taken to vanish: its
/// direction has then lost about half of its digits.
const SINGULAR: f64 = 1e-8;

/// Where one first derivative is this much shorter than the other it counts as zero.
const COLLAPSED: f64 = 1e-12;

/// The unit normal of a regular point, `None` where the first derivatives are parallel or
/// one of them vanishes.
pub fn regular(du: DVec3, dv: DVec3) -> Option<DVec3> {
    let (length_u, length_v) = (du.length(), dv.length());
    if length_u.min(length_v) <= COLLAPSED * length_u.max(length_v) {
        return None;
    }
    let normal = (du / length_u).cross(dv / length_v);
    (normal.length() > SINGULAR).then(|| normal.normalize())
}

/// The limit of the normal along a straight way into the domain.
///
/// Along such a way `w^3 du x dv` is a polynomial; its first coefficient that does not
/// vanish is the direction of the limit. Both directions of v are tried, then both of u:
/// one of them leads away from every collapsed edge.
pub(crate) fn limit(surface: &Surface, uv: DVec2) -> Option<DVec3> {
    let swapped = DVec2::new(uv.y, uv.x);
    along_v(surface, uv).or_else(|| along_v(&surface.transposed(), swapped).map(|n| -n))
}

fn along_v(surface: &Surface, uv: DVec2) -> Option<DVec3> {
    let domain = surface.knots_v().domain();
    let mut sides = [1.0, -1.0];
    if uv.y >= f64::midpoint(domain.start, domain.end) {
        sides.reverse();
    }
    sides
        .into_iter()
        .find_map(|side| leading_normal(surface, uv, side))
}

/// The first coefficient of the normal along `v + s side` that does not vanish.
fn leading_normal(surface: &Surface, uv: DVec2, side: f64) -> Option<DVec3> {
    let [curve, tangent] = taylor(surface, uv, side)?;
    // Centre the curve on its first point, so that the products below lose no digits.
    let center = curve[0].truncate() / curve[0].w;
    let centered = |c: &DVec4| (c.truncate() - center * c.w, c.w);
    let x: Vec<_> = curve.iter().map(centered).collect();
    let xu: Vec<_> = tangent.iter().map(centered).collect();
    let order = |k: usize| (k + 1) as f64 * side;
    let xv: Vec<_> = x
        .iter()
        .skip(1)
        .enumerate()
        .map(|(k, c)| (c.0 * order(k), c.1 * order(k)))
        .collect();
    // Coefficients of w X_u - w_u X and w X_v - w_v X: the derivatives times w^2.
    let numerator = |d: &[(DVec3, f64)], k: usize| {
        (0..=k).fold(DVec3::ZERO, |sum, m| match (d.get(m), x.get(k - m)) {
            (Some(d), Some(x)) => sum + d.0 * x.1 - x.0 * d.1,
            _ => sum,
        })
    };
    let length = 2 * x.len();
    let du: Vec<_> = (0..length).map(|k| numerator(&xu, k)).collect();
    let dv: Vec<_> = (0..length).map(|k| numerator(&xv, k)).collect();
    let size = |d: &[DVec3]| d.iter().fold(0.0_f64, |max, c| max.max(c.length()));
    let threshold = SINGULAR * size(&du) * size(&dv);
    (0..length)
        .map(|k| (0..=k).fold(DVec3::ZERO, |sum, m| sum + du[m].cross(dv[k - m])))
        .find(|n| n.length() > threshold)
        .map(DVec3::normalize)
}

/// Taylor coefficients in `s` of the homogeneous curve `S(u, v + s side)` and of its
/// derivative along u, scaled so that `s = 1` is the end of the Bézier piece.
///
/// `None` if there is no piece on that side.
fn taylor(surface: &Surface, uv: DVec2, side: f64) -> Option<[Vec<DVec4>; 2]> {
    let knots_v = surface.knots_v();
    let domain = knots_v.domain();
    let start = uv.y.clamp(domain.start, domain.end);
    let breaks = knots_v.breaks();
    let end = if side > 0.0 {
        *breaks.iter().find(|&&k| k > start)?
    } else {
        *breaks.iter().rev().find(|&&k| k < start)?
    };
    let range = start.min(end)..start.max(end);
    let count_v = knots_v.count();
    let net = surface.homogeneous();
    let mut rows = [vec![], vec![]];
    for j in 0..count_v {
        let column: Vec<_> = net.iter().skip(j).step_by(count_v).copied().collect();
        let [value, first, _] = spline::derivatives(surface.knots_u(), &column, uv.x);
        rows[0].push(value);
        rows[1].push(first);
    }
    Some(rows.map(|row| {
        let (_, mut piece) = spline::restrict(knots_v, &row, &range);
        if side < 0.0 {
            piece.reverse();
        }
        power_coefficients(piece)
    }))
}

/// Power coefficients of a Bézier curve over 0..1: binomial times forward difference.
fn power_coefficients(mut points: Vec<DVec4>) -> Vec<DVec4> {
    let degree = points.len() - 1;
    for level in 1..=degree {
        for i in (level..=degree).rev() {
            points[i] = points[i] - points[i - 1];
        }
    }
    let mut binomial = 1.0;
    for k in 1..=degree {
        binomial *= (degree + 1 - k) as f64 / k as f64;
        points[k] *= binomial;
    }
    points
}
