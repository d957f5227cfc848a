//! Polynomials in Bernstein form.

use std::ops::{AddAssign, Div, Mul};

/// The binomial coefficients `degree` over `k` for all `k`.
pub fn binomials(degree: usize) -> impl Iterator<Item = f64> {
    let mut next = 1.0;
    (0..=degree).map(move |k| {
        let value = next;
        next = value * (degree - k) as f64 / (k + 1) as f64;
        value
    })
}

/// The product of two polynomials, the first of numbers or of points.
pub(crate) fn product<T>(a: &[T], b: &[f64]) -> Vec<T>
where
    T: Copy + Default + AddAssign + Mul<f64, Output = T> + Div<f64, Output = T>,
{
    let (p, q) = (a.len() - 1, b.len() - 1);
    let [row, column, all] = [p, q, p + q].map(|n| binomials(n).collect::<Vec<_>>());
    let mut product = vec![T::default(); p + q + 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] += *x * row[i] * *y * column[j] / all[i + j];
        }
    }
    product
}

/// The Bernstein polynomials of a degree less than `N` at a place, and their derivatives there.
#[inline(always)]
pub(crate) fn basis<const N: usize>(degree: usize, t: f64) -> ([f64; N], [f64; N]) {
    let (mut values, mut slopes) = ([0.0; N], [0.0; N]);
    values[0] = 1.0;
    for level in 1..=degree {
        if level == degree {
            let mut before = 0.0;
            for k in 0..=degree {
                slopes[k] = degree as f64 * (before - values[k]);
                before = values[k];
            }
        }
        let mut saved = 0.0;
        for value in &mut values[..=level] {
            let own = *value;
            *value = saved + own * (1.0 - t);
            saved = own * t;
        }
    }
    (values, slopes)
}
