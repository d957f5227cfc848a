//! The ray in the plane of a flat cell: where it crosses the four edges.

use kernel::MAX_DEGREE;

use super::net::{Degrees, Row};
use super::tangent::STRAIGHT;
use super::{Rect, Root};

/// Curvatures over a cell of unit length are no larger than this multiple of what its values differ.
const CURVED: f64 = 200.0;

/// Parameters that are resolved no further.
const RESOLUTION: f64 = 1e-14;

/// Appends where the net of distances vanishes on the border of a cell.
pub(crate) fn edge_roots(
    net: &[f64],
    Degrees { p, q }: Degrees,
    slack: f64,
    rect: Rect,
    roots: &mut Vec<Root>,
) {
    let row = q + 1;
    let place = |(a, b): (f64, f64), t: f64| a + (b - a) * t;
    let length = (rect.u.1 - rect.u.0).min(rect.v.1 - rect.v.0);
    let flat = CURVED * slack < STRAIGHT * length * length;
    for (first, stride, degree, fixed) in [
        (0, 1, q, Side::U(0.0)),
        (p * row, 1, q, Side::U(1.0)),
        (0, row, p, Side::V(0.0)),
        (q, row, p, Side::V(1.0)),
    ] {
        let mut edge = [0.0; MAX_DEGREE + 1];
        for (k, c) in edge[..=degree].iter_mut().enumerate() {
            *c = net[first + k * stride];
        }
        line_roots(&edge, degree, slack, (0.0, 1.0), &mut |t| {
            let (u, v) = match fixed {
                Side::U(u) => (u, t),
                Side::V(v) => (t, v),
            };
            roots.push(Root {
                u: place(rect.u, u),
                v: place(rect.v, v),
                tangential: true,
                blurred: false,
                flat,
            });
        });
    }
}

enum Side {
    U(f64),
    V(f64),
}

/// Reports the roots of a Bernstein polynomial; where it vanishes as a whole, both ends.
fn line_roots(
    edge: &Row,
    degree: usize,
    slack: f64,
    (start, end): (f64, f64),
    found: &mut impl FnMut(f64),
) {
    let used = &edge[..=degree];
    if used.iter().all(|&c| c > slack) || used.iter().all(|&c| c < -slack) {
        return;
    }
    if used.iter().all(|c| c.abs() <= slack) {
        found(start);
        found(end);
        return;
    }
    let middle = f64::midpoint(start, end);
    if end - start < RESOLUTION {
        found(middle);
        return;
    }
    let (mut left, mut right) = (*edge, *edge);
    for (level, coefficient) in left.iter_mut().enumerate().take(degree + 1).skip(1) {
        for k in 0..=degree - level {
            right[k] = f64::midpoint(right[k], right[k + 1]);
        }
        *coefficient = right[0];
    }
    line_roots(&left, degree, slack, (start, middle), found);
    line_roots(&right, degree, slack, (middle, end), found);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_of_a_parabola() {
        // (t - 1/4)(t - 3/4) as Bernstein coefficients.
        let mut edge = [0.0; MAX_DEGREE + 1];
        edge[..3].copy_from_slice(&[3.0 / 16.0, -5.0 / 16.0, 3.0 / 16.0]);
        let mut roots = Vec::new();
        line_roots(&edge, 2, 1e-16, (0.0, 1.0), &mut |t| roots.push(t));
        roots.dedup_by(|a, b| (*a - *b).abs() < 1e-12);
        assert_eq!(roots.len(), 2);
        assert!((roots[0] - 0.25).abs() < 1e-13 && (roots[1] - 0.75).abs() < 1e-13);
    }
}
