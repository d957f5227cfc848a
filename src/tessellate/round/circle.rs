//! Circles as quadratic curves.

use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::Curve;

/// Three points whose circle has a radius of more than this many times their distance are on a line.
const FLAT: f64 = 1e6;

/// Parameters may be beyond a piece by this share of it through rounding.
const SLACK: f64 = 1e-9;

/// A circle about the origin in quadratic Bézier pieces.
#[derive(Debug)]
pub(super) struct Arcs {
    breaks: Vec<f64>,
    /// `(w x, w y, w)` of each piece.
    points: Vec<[DVec3; 3]>,
}

/// A part of a circle in a plane: middle and radius, how far the curve is from it at most, and its pieces.
pub(super) struct Circle {
    pub(super) middle: DVec2,
    pub(super) radius: f64,
    pub(super) off: f64,
    pub(super) arcs: Arcs,
}

impl Circle {
    /// What a quadratic curve is a part of, if it is one of a circle.
    pub(super) fn of(curve: &Curve<DVec2>) -> Option<Self> {
        let pieces = curve.bezier_pieces();
        let Range { start, end } = pieces[0].domain();
        let [a, b, c] = [start, f64::midpoint(start, end), end].map(|t| pieces[0].evaluate(t));
        let (ab, ac) = (b - a, c - a);
        let cross = 2.0 * ab.perp_dot(ac);
        let to_middle = (ab * ac.length_squared() - ac * ab.length_squared()).perp() / cross;
        let radius = to_middle.length();
        if !radius.is_finite() || radius > FLAT * ac.length() {
            return None;
        }
        let middle = a + to_middle;
        let own = |piece: &Curve<DVec2>| -> Option<[DVec3; 3]> {
            let points = piece.homogeneous().iter();
            let points: Vec<DVec3> = points
                .map(|h| (h.truncate() - middle * h.z).extend(h.z))
                .collect();
            points.try_into().ok()
        };
        let points: Vec<[DVec3; 3]> = pieces.iter().map(own).collect::<Option<_>>()?;
        let off = |p: &[DVec3; 3]| {
            let least = p[0].z.min(p[1].z).min(p[2].z);
            let pair = |i: usize, j: usize| {
                p[i].truncate().dot(p[j].truncate()) - radius * radius * p[i].z * p[j].z
            };
            let squares = [
                pair(0, 0),
                pair(0, 1),
                (2.0 * pair(1, 1) + pair(0, 2)) / 3.0,
                pair(1, 2),
                pair(2, 2),
            ];
            let most = squares.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            most / (least * least * radius)
        };
        Some(Self {
            middle,
            radius,
            off: points.iter().map(off).fold(0.0, f64::max),
            arcs: Arcs {
                breaks: curve.knots().breaks(),
                points,
            },
        })
    }
}

impl Arcs {
    pub(super) fn mirror(&mut self, signs: DVec2) {
        for point in self.points.as_flattened_mut() {
            *point *= signs.extend(1.0);
        }
    }

    /// The parameter of the point in a direction from the middle, the nearest to another one; an end if there is
    /// none.
    pub(super) fn toward(&self, way: DVec2, near: f64) -> f64 {
        let mut best: Option<f64> = None;
        for (points, span) in self.points.iter().zip(self.breaks.windows(2)) {
            let [a, b, c] = points.map(|p| way.perp_dot(p.truncate()));
            // Of `a (1 - s)^2 + 2 b s (1 - s) + c s^2`, without cancellation.
            let (square, line) = (a - 2.0 * b + c, b - a);
            let root = (line * line - square * a).max(0.0).sqrt();
            let sum = -(line + root.copysign(line));
            for share in [sum / square, a / sum] {
                if !(-SLACK..=1.0 + SLACK).contains(&share) {
                    continue;
                }
                let rest = 1.0 - share;
                let [a, b, c] = points.map(|p| way.dot(p.truncate()));
                let is_ahead = a * rest * rest + 2.0 * b * rest * share + c * share * share > 0.0;
                let t = span[0] + (span[1] - span[0]) * share.clamp(0.0, 1.0);
                if is_ahead && best.is_none_or(|best| (t - near).abs() < (best - near).abs()) {
                    best = Some(t);
                }
            }
        }
        best.unwrap_or_else(|| {
            let ends = [(0, 0), (self.points.len() - 1, 2)];
            let cosine = ends.map(|(piece, k)| {
                let p: DVec3 = self.points[piece][k];
                way.dot(p.truncate().normalize_or_zero())
            });
            let last = self.breaks[self.breaks.len() - 1];
            if cosine[0] > cosine[1] {
                self.breaks[0]
            } else {
                last
            }
        })
    }
}
