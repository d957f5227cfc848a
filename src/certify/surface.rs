//! Bézier pieces whose control points are intervals.

use std::ops::Range;

use kernel::{Interval, KnotVector, Surface};

/// A homogeneous control point `(w P, w)`.
pub(super) type Point = [Interval; 4];

/// Degrees of a net along u and v.
#[derive(Clone, Copy, Debug)]
pub(super) struct Degrees {
    pub(super) p: usize,
    pub(super) q: usize,
}

impl Degrees {
    /// Number of coefficients.
    pub(super) fn len(self) -> usize {
        (self.p + 1) * (self.q + 1)
    }
}

/// One piece; the net is stored row by row, `[i * (q + 1) + j]`.
#[derive(Debug)]
pub(super) struct Piece {
    pub(super) degrees: Degrees,
    pub(super) net: Vec<Point>,
    /// Whether all the weights are one and the same number.
    pub(super) polynomial: bool,
    /// The part of the patch's domain.
    pub(super) u: Range<f64>,
    pub(super) v: Range<f64>,
}

/// The pieces of a surface, enclosing its exact pieces.
pub(super) fn pieces(surface: &Surface) -> Vec<Piece> {
    let (knots_u, knots_v) = (surface.knots_u(), surface.knots_v());
    let (p, q) = (knots_u.degree(), knots_v.degree());
    let points: Vec<Point> = surface.homogeneous().iter().map(enclosed).collect();
    let row = knots_v.count();
    let columns: Vec<_> = (0..row)
        .map(|j| {
            let column: Vec<_> = points.iter().skip(j).step_by(row).copied().collect();
            spans(knots_u, &column)
        })
        .collect();
    let mut pieces = Vec::new();
    for s in 0..columns[0].len() {
        // A strip that is Bézier along u, row by row.
        let lines: Vec<_> = (0..=p)
            .map(|i| {
                let line: Vec<_> = columns.iter().map(|c| c[s].1[i]).collect();
                spans(knots_v, &line)
            })
            .collect();
        for r in 0..lines[0].len() {
            let net: Vec<_> = lines.iter().flat_map(|l| l[r].1.iter().copied()).collect();
            let weight = net[0][3];
            pieces.push(Piece {
                degrees: Degrees { p, q },
                polynomial: net.iter().all(|h| is_point(h[3]) && h[3] == weight),
                net,
                u: columns[0][s].0.clone(),
                v: lines[0][r].0.clone(),
            });
        }
    }
    pieces
}

fn is_point(x: Interval) -> bool {
    x == Interval::point(x.low())
}

/// What a stored control point may have been before its coordinates were multiplied by the
/// weight and rounded.
fn enclosed(h: &glam::DVec4) -> Point {
    // A product with a power of two is not rounded.
    let exact = h.w.to_bits() << 12 == 0;
    let enclose = |x: f64| {
        if exact || x == 0.0 {
            Interval::point(x)
        } else {
            Interval::rounded(x)
        }
    };
    [
        enclose(h.x),
        enclose(h.y),
        enclose(h.z),
        Interval::point(h.w),
    ]
}

/// The Bézier points of every span of a spline, by its polar form \[Ramshaw 89\].
fn spans(knots: &KnotVector, points: &[Point]) -> Vec<(Range<f64>, Vec<Point>)> {
    let (p, t) = (knots.degree(), knots.as_slice());
    let mut result = Vec::new();
    for r in p..points.len() {
        let (start, end) = (t[r], t[r + 1]);
        if start < end {
            let polar = |ends: usize| {
                let mut d = points[r - p..=r].to_vec();
                for level in 1..=p {
                    let x = if level <= ends { end } else { start };
                    for k in (level..=p).rev() {
                        let j = r - p + k;
                        d[k] = mix(d[k - 1], d[k], share(x, t[j], t[j + p + 1 - level]));
                    }
                }
                d[p]
            };
            result.push((start..end, (0..=p).map(polar).collect()));
        }
    }
    result
}

/// Where `x` lies between `left` and `right`.
fn share(x: f64, left: f64, right: f64) -> Interval {
    if x <= left {
        Interval::ZERO
    } else if x >= right {
        Interval::point(1.0)
    } else {
        let [x, left, right] = [x, left, right].map(Interval::point);
        (x - left) / (right - left)
    }
}

fn mix(a: Point, b: Point, share: Interval) -> Point {
    if share == Interval::ZERO {
        return a;
    }
    if share == Interval::point(1.0) {
        return b;
    }
    let rest = Interval::point(1.0) - share;
    std::array::from_fn(|k| {
        if a[k] == b[k] && is_point(a[k]) {
            a[k]
        } else {
            a[k] * rest + b[k] * share
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn pieces_enclose_those_of_the_kernel() {
        let knots_u = KnotVector::new(2, vec![0.0, 0.1, 0.3, 0.7, 0.7, 1.1, 1.3]).unwrap();
        let knots_v = KnotVector::clamped_uniform(3, 6, 0.0..2.0).unwrap();
        let count = knots_u.count() * knots_v.count();
        let number = |k: usize| ((k * 7919 % 101) as f64).sin();
        let points: Vec<_> = (0..count)
            .map(|k| DVec3::new(number(k), number(k + 31), number(k + 77)))
            .collect();
        let weights: Vec<_> = (0..count).map(|k| 1.5 + number(k + 5)).collect();
        let surface = Surface::new(knots_u, knots_v, &points, Some(&weights)).unwrap();
        let (ours, theirs) = (pieces(&surface), surface.bezier_pieces());
        assert_eq!(ours.len(), theirs.len());
        for (ours, theirs) in ours.iter().zip(&theirs) {
            assert_eq!((&ours.u, &ours.v), (&theirs.u(), &theirs.v()));
            for (ours, theirs) in ours.net.iter().zip(theirs.homogeneous()) {
                for k in 0..4 {
                    assert!(ours[k].widened(1e-15).contains(theirs[k]));
                    assert!(ours[k].width() < 1e-14);
                }
            }
        }
    }
}
