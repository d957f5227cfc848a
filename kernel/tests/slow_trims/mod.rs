//! Whether a point lies inside trim loops, slowly and in another way than the library.

use super::Curve;
use glam::{DVec2, DVec3};

/// How often a piece is halved before its middle decides.
const DEPTH: u32 = 60;

/// The homogeneous Bézier pieces of curves that together are closed.
pub(crate) fn pieces<'a>(curves: impl IntoIterator<Item = &'a Curve<DVec2>>) -> Vec<Vec<DVec3>> {
    let pieces = curves.into_iter().flat_map(Curve::bezier_pieces);
    pieces.map(|piece| piece.homogeneous().to_vec()).collect()
}

/// Whether a ray from `p` towards larger u crosses the pieces an odd number of times.
pub(crate) fn contains(pieces: &[Vec<DVec3>], p: DVec2) -> bool {
    pieces.iter().fold(false, |odd, piece| {
        // Common ends of two pieces differ in their weights, but not in their points.
        let own = |h: &DVec3| (h.truncate() / h.z - p) * h.z;
        odd ^ crosses(&piece.iter().map(own).collect::<Vec<_>>(), 0)
    })
}

/// The same for a numerator around the origin. Where it is all on one side, the sides of its
/// ends decide; elsewhere it is halved.
fn crosses(net: &[DVec2], depth: u32) -> bool {
    let is_above = |h: &DVec2| h.y >= 0.0;
    let is_flat = net.iter().all(is_above) || !net.iter().any(is_above);
    if is_flat || net.iter().all(|h| h.x <= 0.0) {
        return false;
    }
    if net.iter().all(|h| h.x > 0.0) || depth == DEPTH {
        return is_above(&net[0]) != is_above(&net[net.len() - 1]);
    }
    let (left, right) = halves(net);
    crosses(&left, depth + 1) ^ crosses(&right, depth + 1)
}

fn halves(net: &[DVec2]) -> (Vec<DVec2>, Vec<DVec2>) {
    let (mut left, mut right) = (net.to_vec(), net.to_vec());
    for (level, end) in left.iter_mut().enumerate().skip(1) {
        for k in 0..net.len() - level {
            right[k] = (right[k] + right[k + 1]) * 0.5;
        }
        *end = right[0];
    }
    (left, right)
}

/// The point of a piece at a parameter from 0 to 1.
pub(crate) fn point(piece: &[DVec3], t: f64) -> DVec2 {
    let mut net = piece.to_vec();
    for level in 1..net.len() {
        for k in 0..net.len() - level {
            net[k] = net[k] * (1.0 - t) + net[k + 1] * t;
        }
    }
    net[0].truncate() / net[0].z
}

/// The distance of a point from the nearest piece, about.
pub(crate) fn distance(pieces: &[Vec<DVec3>], p: DVec2) -> f64 {
    let mut best = f64::INFINITY;
    for piece in pieces {
        let at = |t: f64| point(piece, t).distance(p);
        let steps = 64;
        let nearest = (0..=steps)
            .map(|k| f64::from(k) / f64::from(steps))
            .min_by(|a, b| at(*a).total_cmp(&at(*b)));
        let mut t = nearest.expect("there are steps");
        let mut step = 1.0 / f64::from(steps);
        while step > 1e-17 {
            for next in [t - step, t + step] {
                if at(next) < at(t) {
                    t = next;
                }
            }
            step *= 0.6;
        }
        best = best.min(at(t));
    }
    best
}

/// Random numbers between 0 and 1, the same in every run.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// The next number.
    pub(crate) fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// The next point of the unit square.
    pub(crate) fn point(&mut self) -> DVec2 {
        let u = self.number();
        DVec2::new(u, self.number())
    }
}
