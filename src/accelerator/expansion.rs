//! A part of a piece as a polynomial about its middle, seen from its own frame.
//!
//! With `x` and `y` from -1 to 1 over the part, `S = origin + a x + b y + rest`. In the
//! coordinates that invert the matrix of `a`, `b` and a normal, what is not linear is small
//! once the part is, and sums of its coefficients bound values and derivatives. What bulges to
//! one side is centred: `center` lies in the middle of what the rest can be.

use glam::{DVec3, DVec4};
use kernel::MAX_DEGREE;

use super::leaving::BESIDE;
use super::powers::{powers_of, terms_of};
use crate::intersect::net::Degrees;
use crate::intersect::{PieceNet, Rect};
use crate::simd::{Part, Simd};

/// Powers that are kept along one direction.
pub(super) const ORDER: usize = 4;

/// Terms that are kept.
pub(super) const TERMS: usize = ORDER * ORDER;

/// Bounds hold for `x` and `y` up to this size, so that a root next to a cell can be told
/// from one in it.
pub(super) const WIDE: f64 = 1.0 + 1e-3;

/// Below this sine two derivatives give no frame.
pub(super) const DEGENERATE: f64 = 1e-6;

/// A part whose weight may sink below this share of that in its middle has no frame.
pub(super) const LEAST_WEIGHT: f64 = 0.25;

/// To expand a part only for its frame and what bounds the rest, [`HIERARCHY`] for where it lies,
/// too, [`DIVISION`] for where it is best cut instead if it is too uneven, and [`SOLVER`] for its
/// second derivatives.
pub(super) const FRAME: u8 = 0;
/// See [`FRAME`].
pub(super) const HIERARCHY: u8 = 1;
/// See [`FRAME`].
pub(super) const DIVISION: u8 = 2;
/// See [`FRAME`].
pub(super) const SOLVER: u8 = 3;

/// A part of a piece, in the units of the piece.
#[derive(Clone, Debug)]
pub(super) struct Expansion {
    /// The point of the surface in the middle.
    pub(super) middle: DVec3,
    pub(super) center: DVec3,
    /// The inverse of the frame; rounded to single precision.
    pub(super) rows: [DVec3; 3],
    /// Coefficients of `x^i y^j` at `i * ORDER + j`: the three coordinates of the frame, from
    /// the center, times the weight, and the weight, which is one in the middle.
    pub(super) terms: [[f64; 4]; TERMS],
    /// Along the three rows what is not linear is no greater than this.
    pub(super) half: [f64; 3],
    /// For each of the four: bounds the sum of both derivatives of what is not linear, for `x`
    /// and `y` up to [`WIDE`].
    pub(super) stray: [f64; 4],
    /// For the [`SOLVER`]: the same of the terms that are kept, up to [`BESIDE`].
    pub(super) beside: [f64; 4],
    /// For the [`SOLVER`]: bounds on the second derivatives of the four, by `x` twice, by both, by
    /// `y` twice.
    pub(super) second: [[f64; 4]; 3],
    /// For each of the four: bounds what higher powers than those kept contribute.
    pub(super) dropped: [f64; 4],
    /// What these contribute at most to second derivatives, and to first ones, for the greatest of the four.
    pub(super) higher: f64,
    /// For the [`HIERARCHY`], and a [`DIVISION`] without a cut: the part lies within this of its
    /// middle along each axis; infinite if unknown.
    pub(super) half_size: DVec3,
    /// For a [`DIVISION`] of what is too uneven: whether a cut along v would make it more even
    /// than one along u.
    pub(super) cut_v: bool,
}

/// [`Expansion::of`] for degrees below `N`.
struct WithRoom<'a, const FOR: u8, const N: usize>(&'a PieceNet<'a>, &'a Rect);

impl<S: Simd, const FOR: u8, const N: usize> Part<S> for WithRoom<'_, FOR, N> {
    type Output = Expansion;

    #[inline(always)]
    fn run(self, _: S) -> Expansion {
        Expansion::with_room::<FOR, N>(self.0.points, self.0.degrees, self.1)
    }
}

impl Expansion {
    /// Expands the part `rect` of a piece, as far as is needed `FOR` something.
    #[inline(always)]
    pub(super) fn of<S: Simd, const FOR: u8>(s: S, piece: &PieceNet<'_>, rect: &Rect) -> Self {
        let Degrees { p, q } = piece.degrees;
        if p == 3 && q == 3 {
            // Known degrees unroll the loops.
            Self::with_room::<FOR, ORDER>(piece.points, Degrees { p: 3, q: 3 }, rect)
        } else if p.max(q) < ORDER {
            s.apart(WithRoom::<FOR, ORDER>(piece, rect))
        } else {
            s.apart(WithRoom::<FOR, { MAX_DEGREE + 1 }>(piece, rect))
        }
    }

    /// As [`Self::of`], for degrees below `N`.
    #[inline(always)]
    fn with_room<const FOR: u8, const N: usize>(
        net: &[[f64; 4]],
        degrees: Degrees,
        rect: &Rect,
    ) -> Self {
        let Degrees { p, q } = degrees;
        let terms = terms_of::<N>(net, degrees, rect);
        let mut low = [[0.0; 4]; TERMS];
        for (line, terms) in low.as_chunks_mut::<ORDER>().0.iter_mut().zip(&terms) {
            for (to, from) in line.iter_mut().zip(terms) {
                *to = *from;
            }
        }
        let frame = Frame::of(&low);
        let mut sums = Sums::default();
        let mut own = [[0.0; 4]; TERMS];
        sums.add_low::<FOR, N>(&frame, &low, &mut own);
        let mut dropped = [0.0; 4];
        if N > ORDER {
            for (k, line) in terms[..=p].iter().enumerate() {
                let first = if k < ORDER { ORDER } else { 0 };
                for (l, term) in line[..=q].iter().enumerate().skip(first) {
                    sums.add_high(&frame, term, [k, l], &mut dropped);
                }
            }
        }
        Self::from_sums(&frame, &sums, own, dropped)
    }

    /// Frame and bounds from the sums over all terms.
    #[inline(always)]
    fn from_sums(
        frame: &Frame,
        sums: &Sums,
        mut terms: [[f64; 4]; TERMS],
        dropped: [f64; 4],
    ) -> Self {
        let least = 1.0 - sums.weight;
        let bounded = least >= LEAST_WEIGHT;
        let sure = frame.is_regular && bounded;
        let [a, b] = frame.lengths;
        // Weights would make the change of the center one of the derivatives.
        let is_polynomial = sums.weight == 0.0;
        let mut center = frame.center;
        let [h1, h2, h3, _] = sums.half;
        let mut half = [h1, h2, h3];
        for (r, half) in half.iter_mut().enumerate() {
            *half += sums.linear[r];
            if is_polynomial {
                center += frame.axes[r] * sums.bulge[r];
            } else {
                *half += sums.bulge[r].abs();
            }
        }
        if is_polynomial {
            let shift = center - frame.center;
            for (value, row) in terms[0].iter_mut().zip(&frame.rows) {
                *value = -row.dot(shift);
            }
        }
        Self {
            middle: frame.center,
            center,
            rows: frame.rows,
            terms,
            half: if sure { half } else { [f64::INFINITY; 3] },
            second: sums.second,
            beside: sums.beside,
            stray: if sure { sums.stray } else { [f64::INFINITY; 4] },
            dropped,
            higher: sums.higher,
            half_size: if bounded {
                DVec3::from_array(sums.half_size) / least
            } else {
                DVec3::INFINITY
            },
            cut_v: if sure {
                excess(&sums.cut[1]) < excess(&sums.cut[0])
            } else {
                b > a
            },
        }
    }

    /// How much too uneven the part is, one for what is just right.
    #[inline(always)]
    pub(super) fn excess(&self) -> f64 {
        let dropped = self.dropped.into_iter().fold(0.0, f64::max);
        excess(&self.stray).max(dropped / DROPPED)
    }

    /// Whether there is a frame, as there is none at a pole.
    #[inline(always)]
    pub(super) fn has_frame(&self) -> bool {
        self.stray[0].is_finite()
    }

    /// How often along u and along v the part is best halved, so many times in all and three at
    /// most: then its own terms are least uneven, as seen from here.
    #[inline(always)]
    pub(super) fn grid(&self, halvings: u8) -> [u8; 2] {
        if !self.has_frame() {
            let more = halvings.div_ceil(2);
            let less = halvings - more;
            return if self.cut_v {
                [less, more]
            } else {
                [more, less]
            };
        }
        let (mut best, mut least) = ([0; 2], f64::INFINITY);
        for along_u in 0..=halvings {
            let cuts = [along_u, halvings - along_u];
            let [us, vs] = [&HALVES[usize::from(cuts[0])], &HALVES[usize::from(cuts[1])]];
            let mut stray = [0.0; 4];
            for (t, term) in self.terms.iter().enumerate() {
                let share = us[t / ORDER] * vs[t % ORDER];
                add(&mut stray, term, COUNTS.derivative[t] * share);
            }
            // As [`GROWTH`].
            let [u, v] = [us[1], vs[1]];
            let growth = [u.recip(), v.recip(), 2.0 / (u + v), 1.0];
            for r in 0..4 {
                stray[r] *= growth[r];
            }
            let after = excess(&stray);
            if after < least {
                (best, least) = (cuts, after);
            }
        }
        best
    }
}

/// Middle and axes of a part.
struct Frame {
    center: DVec3,
    inverse_weight: f64,
    /// What `rows` invert: `a`, `b` and the normal.
    axes: [DVec3; 3],
    rows: [DVec3; 3],
    lengths: [f64; 2],
    is_regular: bool,
}

impl Frame {
    #[inline(always)]
    fn of(terms: &[[f64; 4]; TERMS]) -> Self {
        let middle = DVec4::from_array(terms[0]);
        let inverse_weight = middle.w.recip();
        let center = middle.truncate() * inverse_weight;
        let along = |term: &[f64; 4]| {
            let h = DVec4::from_array(*term) * inverse_weight;
            h.truncate() - center * h.w
        };
        let (a, b) = (along(&terms[ORDER]), along(&terms[1]));
        let lengths = [a.length(), b.length()];
        let normal = a.cross(b);
        let area = normal.length();
        // Not a number, too, is degenerate.
        let is_regular = area > DEGENERATE * lengths[0] * lengths[1];
        let (mut rows, mut axes) = ([DVec3::ZERO; 3], [DVec3::ZERO; 3]);
        if is_regular {
            // The inverse of the matrix of `a`, `b` and a normal half as long as both.
            let n = normal / area;
            let length = 0.5 * (lengths[0] + lengths[1]);
            let inverse = area.recip();
            // They are kept in single precision; the bounds hold for what is kept.
            rows[0] = (b.cross(n) * inverse).as_vec3().as_dvec3();
            rows[1] = (n.cross(a) * inverse).as_vec3().as_dvec3();
            rows[2] = (n / length).as_vec3().as_dvec3();
            axes = [a, b, n * length];
        }
        Self {
            center,
            inverse_weight,
            axes,
            rows,
            lengths,
            is_regular,
        }
    }
}

/// A cell is divided while its derivatives stray from those in its middle by more than this,
/// along the surface; then two cells or three share the rays of a piece.
const UNEVEN: f64 = 0.45;

/// As [`UNEVEN`], across the surface: the tangent of the angle that the normals fill.
const CURVED: f64 = 0.5;

/// Nor may the terms that are not kept be more than this: single precision sees no closer.
const DROPPED: f64 = 3e-4;

#[inline(always)]
fn excess(stray: &[f64; 4]) -> f64 {
    let [k1, k2, k3, k4] = *stray;
    ((k1.max(k2) + k4) / UNEVEN).max(k3 / CURVED)
}

/// Sums over the terms that are not linear, as the part is and as it would be if it were cut.
#[derive(Default)]
struct Sums {
    stray: [f64; 4],
    beside: [f64; 4],
    second: [[f64; 4]; 3],
    /// Middle of what even powers can be, and half of what all can span.
    bulge: [f64; 4],
    half: [f64; 4],
    /// How far the linear terms are from those expected, by rounding.
    linear: [f64; 4],
    /// After a cut along u and along v.
    cut: [[f64; 4]; 2],
    weight: f64,
    half_size: [f64; 3],
    higher: f64,
}

/// How much a term counts in derivatives, and in these after a cut along u or v.
pub(super) struct Counts {
    derivative: [f64; TERMS],
    beside: [f64; TERMS],
    /// In second derivatives by `x` twice, by both, by `y` twice.
    pub(super) second: [[f64; TERMS]; 3],
    bulge: [f64; TERMS],
    half: [f64; TERMS],
    cut: [[f64; TERMS]; 2],
}

/// Growth of the rows by a cut along u and along v: a row grows to the double when the
/// derivative that it inverts is halved; the normal is as long as both on average.
const GROWTH: [[f64; 4]; 2] = [[2.0, 1.0, 4.0 / 3.0, 1.0], [1.0, 2.0, 4.0 / 3.0, 1.0]];

/// What is lost of the linear terms, of which the derivatives are expected, by rounding.
pub(super) const LINEAR: f64 = f32::EPSILON as f64;

/// [`Counts`] of the terms that are kept. The linear ones are left out.
pub(super) const COUNTS: Counts = {
    let mut counts = Counts {
        derivative: [0.0; TERMS],
        beside: [0.0; TERMS],
        second: [[0.0; TERMS]; 3],
        bulge: [0.0; TERMS],
        half: [0.0; TERMS],
        cut: [[0.0; TERMS]; 2],
    };
    let (half, wide) = (powers_of::<ORDER>(0.5), powers_of::<{ 2 * ORDER }>(WIDE));
    let beside = powers_of::<{ 2 * ORDER }>(BESIDE);
    let mut t = 1;
    while t < TERMS {
        let (k, l) = (t / ORDER, t % ORDER);
        if k + l > 1 {
            let count = (k + l) as f64 * wide[k + l - 1];
            counts.derivative[t] = count;
            counts.beside[t] = (k + l) as f64 * beside[k + l - 1];
            counts.cut[0][t] = count * half[k];
            counts.cut[1][t] = count * half[l];
            let (power, second) = (wide[k + l], wide[k + l - 2]);
            let is_even = k % 2 == 0 && l % 2 == 0;
            counts.half[t] = if is_even { 0.5 * power } else { power };
            counts.bulge[t] = if is_even { 0.5 * power } else { 0.0 };
            counts.second[0][t] = (k * k.saturating_sub(1)) as f64 * second;
            counts.second[1][t] = (k * l) as f64 * second;
            counts.second[2][t] = (l * l.saturating_sub(1)) as f64 * second;
        }
        t += 1;
    }
    counts
};

/// Adds the sizes of a term, so many times.
#[inline(always)]
fn add(sum: &mut [f64; 4], term: &[f64; 4], count: f64) {
    for r in 0..4 {
        sum[r] += term[r].abs() * count;
    }
}

impl Sums {
    /// Adds the terms that are kept; `own` takes them in the frame. No more than what is needed to
    /// cut an uneven part if that is what it is for.
    #[inline(always)]
    fn add_low<const FOR: u8, const N: usize>(
        &mut self,
        frame: &Frame,
        terms: &[[f64; 4]; TERMS],
        own: &mut [[f64; 4]; TERMS],
    ) {
        let inverse = frame.inverse_weight;
        let mut columns = [[0.0; 4]; 4];
        columns[3][3] = inverse;
        for (r, row) in frame.rows.iter().enumerate() {
            let own = *row * inverse;
            (columns[0][r], columns[1][r], columns[2][r]) = (own.x, own.y, own.z);
            columns[3][r] = -own.dot(frame.center);
        }
        let mut weights = [0.0; 4];
        for t in 0..TERMS {
            for r in 0..4 {
                own[t][r] = columns[0][r] * terms[t][0]
                    + columns[1][r] * terms[t][1]
                    + columns[2][r] * terms[t][2]
                    + columns[3][r] * terms[t][3];
            }
            if t > 0 {
                add(&mut weights, &own[t], 1.0);
            }
        }
        self.weight = weights[3];
        // Few sums at a time stay in registers.
        let mut derivatives = [0.0; 4];
        for (t, own) in own.iter().enumerate() {
            add(&mut derivatives, own, COUNTS.derivative[t]);
        }
        // The derivatives of the weight are not expected.
        let expected = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]];
        for r in 0..4 {
            let (x, y) = (own[ORDER][r], own[1][r]);
            self.linear[r] = (x - expected[0][r]).abs() + (y - expected[1][r]).abs() + LINEAR;
            self.stray[r] = derivatives[r] + self.linear[r];
        }
        // Terms that are not kept make it no less.
        let is_uneven = excess(&self.stray) > 1.0;
        if FOR == DIVISION && (is_uneven || N > ORDER) {
            let mut cuts = [[0.0; 4]; 2];
            for (t, own) in own.iter().enumerate() {
                add(&mut cuts[0], own, COUNTS.cut[0][t]);
                add(&mut cuts[1], own, COUNTS.cut[1][t]);
            }
            for r in 0..4 {
                self.cut[0][r] = cuts[0][r] * GROWTH[0][r];
                self.cut[1][r] = cuts[1][r] * GROWTH[1][r];
            }
        }
        if FOR == DIVISION && is_uneven {
            return;
        }
        let (mut half, mut bulge) = ([0.0; 4], [0.0; 4]);
        for (t, own) in own.iter().enumerate() {
            add(&mut half, own, COUNTS.half[t]);
            for r in 0..4 {
                bulge[r] += own[r] * COUNTS.bulge[t];
            }
        }
        (self.half, self.bulge) = (half, bulge);
        if FOR == HIERARCHY || FOR == DIVISION {
            let center = frame.center.extend(0.0).to_array();
            let mut sizes = [0.0; 4];
            for term in &terms[1..] {
                let (weight, mut relative) = (term[3] * inverse, [0.0; 4]);
                for r in 0..4 {
                    relative[r] = term[r] * inverse - center[r] * weight;
                }
                add(&mut sizes, &relative, 1.0);
            }
            self.half_size = [sizes[0], sizes[1], sizes[2]];
        }
        if FOR == SOLVER {
            let (mut second, mut beside) = ([[0.0; 4]; 3], self.linear);
            for (t, own) in own.iter().enumerate() {
                add(&mut beside, own, COUNTS.beside[t]);
                add(&mut second[0], own, COUNTS.second[0][t]);
                add(&mut second[1], own, COUNTS.second[1][t]);
                add(&mut second[2], own, COUNTS.second[2][t]);
            }
            (self.second, self.beside) = (second, beside);
        }
    }

    /// Adds a term of powers `k` and `l` that is not kept.
    fn add_high(
        &mut self,
        frame: &Frame,
        term: &[f64; 4],
        [k, l]: [usize; 2],
        dropped: &mut [f64; 4],
    ) {
        const HALF: [f64; MAX_DEGREE + 1] = powers_of(0.5);
        const POWERS: [f64; 2 * MAX_DEGREE + 1] = powers_of(WIDE);
        let h = DVec4::from_array(*term) * frame.inverse_weight;
        let x = h.truncate() - frame.center * h.w;
        let rows = &frame.rows;
        let own = [rows[0].dot(x), rows[1].dot(x), rows[2].dot(x), h.w].map(f64::abs);
        for axis in 0..3 {
            self.half_size[axis] += x[axis].abs();
        }
        self.weight += own[3];
        let greatest = own.into_iter().fold(0.0, f64::max);
        let most = (k * k).max(l * l) as f64;
        self.higher += greatest * most * POWERS[(k + l).saturating_sub(2)];
        for r in 0..4 {
            let count = own[r] * (k + l) as f64 * POWERS[k + l - 1];
            dropped[r] += own[r] * POWERS[k + l];
            self.half[r] += own[r] * POWERS[k + l];
            let second = own[r] * POWERS[(k + l).saturating_sub(2)];
            self.second[0][r] += second * (k * k.saturating_sub(1)) as f64;
            self.second[1][r] += second * (k * l) as f64;
            self.second[2][r] += second * (l * l.saturating_sub(1)) as f64;
            self.stray[r] += count;
            self.cut[0][r] += count * HALF[k] * GROWTH[0][r];
            self.cut[1][r] += count * HALF[l] * GROWTH[1][r];
        }
    }
}

/// Powers of what is left of a length that is halved so often.
const HALVES: [[f64; ORDER]; 4] = [
    powers_of(1.0),
    powers_of(0.5),
    powers_of(0.25),
    powers_of(0.125),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::intersect::net::evaluate_at;
    use crate::simd::Portable;

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
            let e = Expansion::of::<_, HIERARCHY>(Portable, &piece, &rect);
            assert!(e.stray[2] < 2.0, "{p} {q} {:?}", e.stray);
            for (x, y) in [(-1.0, 1.0), (0.3, -0.6), (1.0, 1.0), (0.0, 0.0_f64)] {
                let [h, ..] = evaluate_at(&piece, 0.375 + 0.125 * x, 0.625 + 0.125 * y);
                let mut sum = DVec4::ZERO;
                for (k, line) in e.terms.as_chunks::<ORDER>().0.iter().enumerate() {
                    for (l, term) in line.iter().enumerate() {
                        let power = f64::powf(x, k as f64) * f64::powf(y, l as f64);
                        sum += DVec4::from_array(*term) * power;
                    }
                }
                let weight = sum.w;
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
