//! Powers, and Bernstein polynomials as sums of them.

use super::expansion::ORDER;
use crate::intersect::Rect;
use crate::intersect::net::Degrees;

/// The powers of a number, from one on.
pub(super) const fn powers_of<const N: usize>(base: f64) -> [f64; N] {
    let mut powers = [1.0; N];
    let mut k = 1;
    while k < N {
        powers[k] = powers[k - 1] * base;
        k += 1;
    }
    powers
}

/// The part `rect` of a net of degrees below `N` as a polynomial of two variables from -1 to 1:
/// `[i][j]` belongs to `x^i y^j`.
#[inline(always)]
pub(super) fn terms_of<const N: usize>(
    net: &[[f64; 4]],
    degrees: Degrees,
    rect: &Rect,
) -> [[[f64; 4]; N]; N] {
    let Degrees { p, q } = degrees;
    let (along_u, along_v) = (along::<N>(rect.u, p), along::<N>(rect.v, q));
    let mut terms = [[[0.0; 4]; N]; N];
    for i in 0..=p {
        let mut line = [[0.0; 4]; N];
        for j in 0..=q {
            let point = &net[i * (q + 1) + j];
            for l in 0..=q {
                for r in 0..4 {
                    line[l][r] += point[r] * along_v[j][l];
                }
            }
        }
        for k in 0..=p {
            for l in 0..=q {
                for r in 0..4 {
                    terms[k][l][r] += line[l][r] * along_u[i][k];
                }
            }
        }
    }
    terms
}

/// [`powers`], quickly for cubics.
#[inline(always)]
fn along<const N: usize>(interval: (f64, f64), degree: usize) -> [[f64; N]; N] {
    if N != ORDER || degree != 3 {
        return powers(interval, degree);
    }
    let (m, h) = (
        f64::midpoint(interval.0, interval.1),
        (interval.1 - interval.0) * 0.5,
    );
    let a = 1.0 - m;
    let (a2, m2, h2) = (a * a, m * m, h * h);
    let cubic = [
        [a2 * a, -3.0 * a2 * h, 3.0 * a * h2, -h2 * h],
        [
            3.0 * m * a2,
            3.0 * h * (a2 - 2.0 * m * a),
            3.0 * h2 * (m - 2.0 * a),
            3.0 * h2 * h,
        ],
        [
            3.0 * m2 * a,
            3.0 * h * (2.0 * m * a - m2),
            3.0 * h2 * (a - 2.0 * m),
            -3.0 * h2 * h,
        ],
        [m2 * m, 3.0 * m2 * h, 3.0 * m * h2, h2 * h],
    ];
    let mut rows = [[0.0; N]; N];
    for i in 0..ORDER.min(N) {
        for k in 0..ORDER.min(N) {
            rows[i][k] = cubic[i][k];
        }
    }
    rows
}

/// The Bernstein polynomials of a degree below `N` on an interval, as polynomials of a
/// variable from -1 to 1: `[i][k]` is the coefficient of the power `k` of polynomial `i`.
#[inline(always)]
fn powers<const N: usize>((start, end): (f64, f64), degree: usize) -> [[f64; N]; N] {
    let (middle, half) = (f64::midpoint(start, end), (end - start) * 0.5);
    let rest = 1.0 - middle;
    let mut rows = [[0.0; N]; N];
    rows[0][0] = 1.0;
    for d in 1..=degree {
        // B(d, i) = t B(d - 1, i - 1) + (1 - t) B(d - 1, i) with t = middle + half x.
        for i in (0..=d).rev() {
            let before = if i > 0 { rows[i - 1] } else { [0.0; N] };
            let own = if i < d { rows[i] } else { [0.0; N] };
            for k in (0..=d).rev() {
                let (b, o) = if k > 0 {
                    (before[k - 1], own[k - 1])
                } else {
                    (0.0, 0.0)
                };
                rows[i][k] = middle * before[k] + rest * own[k] + half * (b - o);
            }
        }
    }
    rows
}
