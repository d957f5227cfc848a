//! Polynomials in Bernstein form.

/// The binomial coefficients `degree` over `k` for all `k`.
pub(crate) fn binomials(degree: usize) -> Vec<f64> {
    let step = |value: &mut f64, k: usize| {
        let now = *value;
        *value = now * (degree - k) as f64 / (k + 1) as f64;
        Some(now)
    };
    (0..=degree).scan(1.0, step).collect()
}
