//! Where along a curve something is least.

/// Places looked at on each span of a curve, before the nearest is refined.
const PLACES: usize = 16;

/// Halvings of the distance between places.
const HALVINGS: usize = 50;

/// Where a function of the parameter of a curve is least, from break to break, and how much it is.
pub(crate) fn least(breaks: &[f64], off: impl Fn(f64) -> f64) -> (f64, f64) {
    let places = breaks.windows(2).flat_map(|span| {
        let step = (span[1] - span[0]) / PLACES as f64;
        (0..PLACES).map(move |k| (span[0] + step * (k as f64 + 0.5), step))
    });
    let nearest = places.min_by(|a, b| off(a.0).total_cmp(&off(b.0)));
    let (mut t, mut step) = nearest.unwrap_or_default();
    let [first, .., last] = breaks else {
        return (t, off(t));
    };
    for _ in 0..HALVINGS {
        let around = [t - step, t, t + step].map(|t| t.clamp(*first, *last));
        let best = around
            .into_iter()
            .min_by(|a, b| off(*a).total_cmp(&off(*b)));
        if best == Some(t) {
            step *= 0.5;
        }
        t = best.unwrap_or(t);
    }
    (t, off(t))
}
