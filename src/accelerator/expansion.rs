//! A part of a piece as a polynomial about its middle, seen from its own frame.
//!
//! With `x` and `y` from -1 to 1 over the part, `S = center + a x + b y + rest`. In the
//! coordinates that invert the matrix of `a`, `b` and a normal, what is not linear is small
//! once the part is, and sums of its coefficients bound values and derivatives.

use glam::{DMat3, DVec3, DVec4};
use kernel::MAX_DEGREE;

use crate::intersect::net::Degrees;
use crate::intersect::{PieceNet, Rect};

/// Powers that are kept along one direction.
pub(super) const ORDER: usize = 4;

/// Bounds hold for `x` and `y` up to this size, so that a root next to a cell can be told
/// from one in it.
pub(super) const WIDE: f64 = 1.25;

/// Below this sine two derivatives give no frame.
const DEGENERATE: f64 = 1e-6;

/// A part whose weight may sink below this share of that in its middle has no frame.
const LEAST_WEIGHT: f64 = 0.25;

/// A part of a piece, in the units of the piece.
#[derive(Clone, Debug)]
pub(super) struct Expansion {
    pub(super) center: DVec3,
    /// The inverse of the frame; rounded to single precision.
    pub(super) rows: [DVec3; 3],
    /// Coefficients of `x^i y^j` at `i * ORDER + j`: the three coordinates of the frame times
    /// the weight, and the weight, which is one in the middle.
    pub(super) terms: [[f64; 4]; ORDER * ORDER],
    /// For each of the four: bounds the sum of both derivatives of what is not linear, for `x`
    /// and `y` up to [`WIDE`].
    pub(super) stray: [f64; 4],
    /// For each of the four: bounds what higher powers than those kept contribute.
    pub(super) dropped: [f64; 4],
    /// The part lies within this of its center along each axis; infinite if unknown.
    pub(super) half_size: DVec3,
    /// Whether a cut along v would make it more even than one along u.
    pub(super) cut_v: bool,
}

impl Expansion {
    /// Expands the part `rect` of a piece.
    #[inline(always)]
    pub(super) fn of(piece: &PieceNet<'_>, rect: &Rect) -> Self {
        let Degrees { p, q } = piece.degrees;
        if p == 3 && q == 3 {
            // Known degrees unroll the loops.
            Self::with_room::<ORDER>(piece.points, Degrees { p: 3, q: 3 }, rect)
        } else if p.max(q) < ORDER {
            Self::small(piece, rect)
        } else {
            Self::large(piece, rect)
        }
    }

    #[inline(never)]
    fn small(piece: &PieceNet<'_>, rect: &Rect) -> Self {
        Self::with_room::<ORDER>(piece.points, piece.degrees, rect)
    }

    #[inline(never)]
    fn large(piece: &PieceNet<'_>, rect: &Rect) -> Self {
        Self::with_room::<{ MAX_DEGREE + 1 }>(piece.points, piece.degrees, rect)
    }

    /// As [`Self::of`], for degrees below `N`.
    #[inline(always)]
    fn with_room<const N: usize>(net: &[[f64; 4]], degrees: Degrees, rect: &Rect) -> Self {
        let Degrees { p, q } = degrees;
        let (along_u, along_v) = (powers::<N>(rect.u, p), powers::<N>(rect.v, q));
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
        Self::from_terms(degrees, &terms)
    }

    /// Frame and bounds from the coefficients of the homogeneous piece.
    #[inline(always)]
    fn from_terms<const N: usize>(degrees: Degrees, terms: &[[[f64; 4]; N]; N]) -> Self {
        let middle = DVec4::from_array(terms[0][0]);
        let inverse_weight = middle.w.recip();
        let center = middle.truncate() * inverse_weight;
        let (a, b) = (
            relative(terms[1][0], center, inverse_weight).truncate(),
            relative(terms[0][1], center, inverse_weight).truncate(),
        );
        let (length_a, length_b) = (a.length(), b.length());
        let normal = a.cross(b);
        let area = normal.length();
        let mut expansion = Self {
            center,
            rows: [DVec3::ZERO; 3],
            terms: [[0.0; 4]; ORDER * ORDER],
            stray: [f64::INFINITY; 4],
            dropped: [0.0; 4],
            half_size: DVec3::ZERO,
            cut_v: length_b > length_a,
        };
        // Not a number, too, is degenerate.
        let regular = area > DEGENERATE * length_a * length_b;
        if regular {
            let normal = normal * (0.5 * (length_a + length_b) / area);
            let inverse = DMat3::from_cols(a, b, normal).inverse().transpose();
            // The rows are kept in single precision; the bounds hold for what is kept.
            expansion.rows = [
                inverse.x_axis.as_vec3().as_dvec3(),
                inverse.y_axis.as_vec3().as_dvec3(),
                inverse.z_axis.as_vec3().as_dvec3(),
            ];
        }
        let rows = expansion.rows;
        let mut sums = Sums::default();
        let mut half_size = DVec3::ZERO;
        for k in 0..=degrees.p {
            for l in 0..=degrees.q {
                let h = relative(terms[k][l], center, inverse_weight);
                let x = h.truncate();
                let own = [rows[0].dot(x), rows[1].dot(x), rows[2].dot(x), h.w];
                if k < ORDER && l < ORDER {
                    expansion.terms[k * ORDER + l] = own;
                } else {
                    for (sum, value) in expansion.dropped.iter_mut().zip(own) {
                        *sum += value.abs();
                    }
                }
                if k + l > 0 {
                    sums.add(k, l, own);
                    half_size += x.abs();
                }
            }
        }
        let least = 1.0 - sums.weight;
        let bounded = least >= LEAST_WEIGHT;
        expansion.half_size = if bounded {
            half_size / least
        } else {
            DVec3::INFINITY
        };
        if regular && bounded {
            expansion.stray = sums.stray;
            expansion.cut_v = sums.excess_after(1) < sums.excess_after(0);
        }
        expansion
    }

    /// How much too uneven the part is, one for what is just right.
    #[inline(always)]
    pub(super) fn excess(&self) -> f64 {
        excess(&self.stray)
    }
}

/// A homogeneous term as seen from the center, in units of the weight there.
#[inline(always)]
fn relative(term: [f64; 4], center: DVec3, inverse_weight: f64) -> DVec4 {
    let h = DVec4::from_array(term) * inverse_weight;
    (h.truncate() - center * h.w).extend(h.w)
}

/// A cell is divided while its derivatives stray from those in its middle by more than this,
/// along the surface; then two cells or three share the rays of a piece.
const UNEVEN: f64 = 0.45;

/// As [`UNEVEN`], across the surface: the tangent of the angle that the normals fill.
const CURVED: f64 = 0.5;

#[inline(always)]
fn excess(stray: &[f64; 4]) -> f64 {
    let [k1, k2, k3, k4] = *stray;
    ((k1.max(k2) + k4) / UNEVEN).max(k3 / CURVED)
}

/// Sums over the terms that are not linear, as the part is and as it would be if it were cut.
#[derive(Default)]
struct Sums {
    stray: [f64; 4],
    /// After a cut along u and along v.
    cut: [[f64; 4]; 2],
    weight: f64,
}

impl Sums {
    #[inline(always)]
    fn add(&mut self, k: usize, l: usize, own: [f64; 4]) {
        const HALF: [f64; MAX_DEGREE + 1] = powers_of(0.5);
        const WIDE: [f64; 2 * MAX_DEGREE + 1] = powers_of(super::expansion::WIDE);
        let mut own = [own[0].abs(), own[1].abs(), own[2].abs(), own[3].abs()];
        self.weight += own[3];
        if k + l == 1 {
            // The expected derivative, but for rounding, is one or nothing.
            own = [0.0, 0.0, 0.0, own[3]];
            self.stray[0] += f64::from(f32::EPSILON);
            self.stray[1] += f64::from(f32::EPSILON);
            self.stray[2] += f64::from(f32::EPSILON);
        }
        let order = (k + l) as f64 * WIDE[k + l - 1];
        for r in 0..4 {
            let value = own[r] * order;
            self.stray[r] += value;
            // A row grows to the double when the derivative that it inverts is halved; the
            // normal is as long as both on average.
            const SCALE: [[f64; 4]; 2] = [[2.0, 1.0, 4.0 / 3.0, 1.0], [1.0, 2.0, 4.0 / 3.0, 1.0]];
            self.cut[0][r] += value * HALF[k] * SCALE[0][r];
            self.cut[1][r] += value * HALF[l] * SCALE[1][r];
        }
    }

    #[inline(always)]
    fn excess_after(&self, axis: usize) -> f64 {
        excess(&self.cut[axis])
    }
}

const fn powers_of<const N: usize>(base: f64) -> [f64; N] {
    let mut powers = [1.0; N];
    let mut k = 1;
    while k < N {
        powers[k] = powers[k - 1] * base;
        k += 1;
    }
    powers
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::intersect::net::evaluate_at;

    fn net(degrees: Degrees) -> Vec<[f64; 4]> {
        (0..degrees.len())
            .map(|k| {
                let (i, j) = (k / (degrees.q + 1), k % (degrees.q + 1));
                let (x, y) = (i as f64 / degrees.p as f64, j as f64 / degrees.q as f64);
                let w = 1.0 - 0.1 * ((i * 3 + j * 5) % 4) as f64;
                let z = 0.3 * ((i * 7 + j * 11) % 5) as f64;
                [x * w, (y + 0.2 * x * x) * w, z * w, w]
            })
            .collect()
    }

    #[test]
    fn terms_are_the_piece_in_its_frame_and_bounds_hold() {
        for (p, q) in [(1, 1), (2, 3), (3, 3), (5, 4)] {
            let degrees = Degrees { p, q };
            let points = net(degrees);
            let piece = PieceNet {
                degrees,
                points: &points,
            };
            let rect = Rect {
                u: (0.25, 0.5),
                v: (0.5, 0.75),
            };
            let e = Expansion::of(&piece, &rect);
            assert!(e.stray[2] < 2.0, "{p} {q} {:?}", e.stray);
            for (x, y) in [(-1.0, 1.0), (0.3, -0.6), (1.0, 1.0), (0.0, 0.0_f64)] {
                let [h, ..] = evaluate_at(&piece, 0.375 + 0.125 * x, 0.625 + 0.125 * y);
                let mut sum = [0.0; 4];
                for k in 0..ORDER {
                    for l in 0..ORDER {
                        for r in 0..4 {
                            let power = x.powi(k as i32) * y.powi(l as i32);
                            sum[r] += e.terms[k * ORDER + l][r] * power;
                        }
                    }
                }
                let weight = sum[3];
                let offset = h.truncate() / h.w - e.center;
                assert!(
                    (offset.abs() - e.half_size).max_element() <= 1e-14,
                    "{p} {q}"
                );
                for r in 0..3 {
                    let off = (e.rows[r].dot(offset) * weight - sum[r]).abs();
                    let allowed = e.dropped[r] + e.dropped[3] * 4.0 + 1e-12;
                    assert!(off <= allowed, "{p} {q} {x} {y}: {off} > {allowed}");
                    let linear = [x, y, 0.0][r];
                    assert!((sum[r] - linear).abs() <= 0.5 * e.stray[r] + 1e-6);
                }
            }
        }
    }
}
