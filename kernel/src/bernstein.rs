//! Polynomials in Bernstein form.

/// The binomial coefficients `degree` over `k` for all `k`.
pub fn binomials(degree: usize) -> impl Iterator<Item = f64> {
    let mut next = 1.0;
    (0..=degree).map(move |k| {
        let value = next;
        next = value * (degree - k) as f64 / (k + 1) as f64;
        value
    })
}
