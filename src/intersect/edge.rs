//! The ray in the plane of a flat cell: where it crosses the four edges.

use kernel::MAX_DEGREE;

use super::net::{Degrees, Row};
use super::tangent::STRAIGHT;
use super::{Rect, Root};

/// Curvatures over a cell of unit length are no larger than this multiple of what its values differ.
const CURVED: f64 = 200.0;

/// Parameters that are resolved no further.
const RESOLUTION: f64 = 1e-14;

/// What vanishes on both sides of no more than this share of an edge vanishes on one stretch: where
/// values come and go with the rounding there would be thousands.
const APART: f64 = 1e-6;

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
        let root = |t: f64| {
            let (u, v) = match fixed {
                Side::U(u) => (u, t),
                Side::V(v) => (t, v),
            };
            Root {
                u: place(rect.u, u),
                v: place(rect.v, v),
                tangential: true,
                blurred: false,
                flat,
            }
        };
        for (start, end) in stretches(&edge, degree, slack) {
            roots.push(root(start));
            if end - start > 4.0 * RESOLUTION {
                roots.push(root(end));
            }
        }
    }
}

enum Side {
    U(f64),
    V(f64),
}

/// The parts of an edge on which a Bernstein polynomial vanishes, at most one for each root.
fn stretches(edge: &Row, degree: usize, slack: f64) -> impl Iterator<Item = (f64, f64)> {
    let mut found = [(0.0, 0.0); MAX_DEGREE + 1];
    let mut count = 0;
    vanishing(edge, degree, slack, (0.0, 1.0), &mut |start, end| {
        // What there is no room for is next to the last: rounding is all that tells more
        // stretches than roots.
        if count > 0 && (start - found[count - 1].1 <= APART || count == found.len()) {
            found[count - 1].1 = end;
        } else {
            found[count] = (start, end);
            count += 1;
        }
    });
    found.into_iter().take(count)
}

/// Reports, in their order, the parts of an edge on which a Bernstein polynomial vanishes.
fn vanishing(
    edge: &Row,
    degree: usize,
    slack: f64,
    (start, end): (f64, f64),
    found: &mut impl FnMut(f64, f64),
) {
    let used = &edge[..=degree];
    if used.iter().all(|&c| c > slack) || used.iter().all(|&c| c < -slack) {
        return;
    }
    if end - start < RESOLUTION || used.iter().all(|c| c.abs() <= slack) {
        found(start, end);
        return;
    }
    let middle = f64::midpoint(start, end);
    let (mut left, mut right) = (*edge, *edge);
    for (level, coefficient) in left.iter_mut().enumerate().take(degree + 1).skip(1) {
        for k in 0..=degree - level {
            right[k] = f64::midpoint(right[k], right[k + 1]);
        }
        *coefficient = right[0];
    }
    vanishing(&left, degree, slack, (start, middle), found);
    vanishing(&right, degree, slack, (middle, end), found);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_of_a_parabola() {
        // (t - 1/4)(t - 3/4) as Bernstein coefficients.
        let mut edge = [0.0; MAX_DEGREE + 1];
        edge[..3].copy_from_slice(&[3.0 / 16.0, -5.0 / 16.0, 3.0 / 16.0]);
        let roots: Vec<_> = stretches(&edge, 2, 1e-16).collect();
        assert_eq!(roots.len(), 2);
        for ((start, end), root) in roots.into_iter().zip([0.25, 0.75]) {
            assert!((start - root).abs() < 1e-13 && (end - root).abs() < 1e-13);
        }
    }

    #[test]
    fn a_contact_is_one_stretch() {
        // (t - 1/3)^2, with values that come and go with the rounding.
        let mut edge = [0.0; MAX_DEGREE + 1];
        edge[..3].copy_from_slice(&[1.0 / 9.0, -2.0 / 9.0, 4.0 / 9.0]);
        for slack in [1e-17, 1e-16, 6e-15, 1e-12] {
            let found: Vec<_> = stretches(&edge, 2, slack).collect();
            assert!(found.len() <= 1, "{found:?}");
            for (start, end) in found {
                assert!(start - 1e-5 < 1.0 / 3.0 && 1.0 / 3.0 < end + 1e-5 && end - start < 1e-5);
            }
        }
        assert_eq!(stretches(&edge, 2, 6e-15).count(), 1);
    }
}
