//! Cubic pieces that have the points and tangents of what they follow at their ends.

use kernel::Point;

/// Place and direction at one end of a piece.
#[derive(Clone, Copy, Debug)]
pub(super) struct End<P> {
    pub(super) t: f64,
    pub(super) point: P,
    pub(super) tangent: P,
}

/// The ends of pieces from `first` through all `stops`, which are halved until each fits, but no more
/// than so often.
pub(super) fn ends<P: Point>(
    first: End<P>,
    stops: impl DoubleEndedIterator<Item = End<P>>,
    halvings: u32,
    at: impl Fn(f64) -> End<P>,
    fits: impl Fn(End<P>, End<P>) -> bool,
) -> Vec<End<P>> {
    let mut ends = vec![first];
    let mut waiting: Vec<_> = stops.rev().map(|stop| (stop, 0)).collect();
    while let (Some(&first), Some((last, level))) = (ends.last(), waiting.last_mut()) {
        if *level >= halvings || fits(first, *last) {
            ends.push(*last);
            waiting.pop();
        } else {
            *level += 1;
            let middle = (at(first.t.midpoint(last.t)), *level);
            waiting.push(middle);
        }
    }
    ends
}

/// The point at a share of the piece between two ends.
pub(super) fn between<P: Point>(first: End<P>, last: End<P>, share: f64) -> P {
    let span = last.t - first.t;
    let (r, q) = (1.0 - share, share * share);
    first.point * (r * r * (1.0 + 2.0 * share))
        + first.tangent * (span * share * r * r)
        + last.tangent * (-span * q * r)
        + last.point * (q * (1.0 + 2.0 * r))
}

/// The control points of the piece between two ends that are not at these.
pub(super) fn inner<P: Point>(first: End<P>, last: End<P>) -> [P; 2] {
    let third = (last.t - first.t) / 3.0;
    [
        first.point + first.tangent * third,
        last.point - last.tangent * third,
    ]
}
