//! Bounds of derivatives from control points.
//!
//! Every derivative is a quotient `N / w^k` of polynomials; about its value `A` in the middle it
//! strays by no more than the largest coefficient of `N - A w^k` over the least weight to the k.
//! With `X = w S`: for `Su`, `N = Xu w - X wu =: M` and k = 2; for `Suu`, `N = Mu w - 2 wu M` and
//! k = 3; for `Suv`, `N = Mv w - 2 wv M`.

use glam::{DVec3, DVec4};

use super::net::{Degrees, Net, Rows, by_row};
use super::pieces::{Ball, Spread};
use crate::simd::{Simd, Task};

impl Net<'_> {
    /// Bounds over all of the net.
    pub(super) fn spread(&self) -> Spread {
        if self.has_weights {
            self.instructions.run(Quotients(self))
        } else {
            self.instructions.run(Plain(self))
        }
    }

    /// The same, but coarser, and for less work where there are weights.
    pub(super) fn rough(&self) -> Spread {
        if self.has_weights {
            self.instructions.run(Rough(self))
        } else {
            self.instructions.run(Plain(self))
        }
    }
}

/// The task to bound derivatives without weights: the coefficients are those of the derivatives
/// themselves.
struct Plain<'a>(&'a Net<'a>);

impl Task for Plain<'_> {
    type Output = Spread;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Spread {
        let Net { degrees, .. } = self.0;
        let [x, u, v, uu, uv, vv] = self.0.nets();
        let scale = x[0].w.recip();
        Spread {
            du: Reach::of(degrees, u, DVec3::ZERO).vector.scaled(scale),
            dv: Reach::of(degrees, v, DVec3::ZERO).vector.scaled(scale),
            duu: Reach::of(degrees, uu, DVec3::ZERO).vector.scaled(scale),
            duv: Reach::of(degrees, uv, DVec3::ZERO).vector.scaled(scale),
            dvv: Reach::of(degrees, vv, DVec3::ZERO).vector.scaled(scale),
        }
    }
}

/// The task to bound derivatives from balls around the coefficients of `X` and of its derivatives, by
/// the rule of the quotient:
/// `Su = (Xu - S wu) / w`, `Suu = (Xuu - 2 Su wu - S wuu) / w` and
/// `Suv = (Xuv - Su wv - Sv wu - S wuv) / w`.
/// With the origin in the middle of the part, `S` is short.
struct Rough<'a>(&'a Net<'a>);

impl Task for Rough<'_> {
    type Output = Spread;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Spread {
        let degrees = self.0.degrees;
        let [x, u, v, uu, uv, vv] = self.0.nets();
        let here = degrees.middle(x);
        let origin = here.truncate() / here.w;
        let least = x.iter().map(|h| h.w).fold(here.w, f64::min);
        let x = Reach::of(degrees, x, origin);
        let u = Reach::of(degrees, u, origin);
        let v = Reach::of(degrees, v, origin);
        let uu = Reach::of(degrees, uu, origin);
        let uv = Reach::of(degrees, uv, origin);
        let vv = Reach::of(degrees, vv, origin);
        let s = x.vector.over(x.weight, least);
        let du = u.vector.less(1.0, s, u.weight).over(x.weight, least);
        let dv = v.vector.less(1.0, s, v.weight).over(x.weight, least);
        let duu = uu.vector.less(2.0, du, u.weight).less(1.0, s, uu.weight);
        let dvv = vv.vector.less(2.0, dv, v.weight).less(1.0, s, vv.weight);
        let duv = uv.vector.less(1.0, du, v.weight).less(1.0, dv, u.weight);
        let duv = duv.less(1.0, s, uv.weight);
        Spread {
            du,
            dv,
            duu: duu.over(x.weight, least),
            duv: duv.over(x.weight, least),
            dvv: dvv.over(x.weight, least),
        }
    }
}

/// Where the homogeneous vectors of a net are: vectors about an origin, and weights.
#[derive(Clone, Copy)]
struct Reach {
    vector: Ball,
    /// A weight, and how far others are from it at most.
    weight: [f64; 2],
}

impl Reach {
    #[inline(always)]
    fn of(degrees: &Degrees, net: &[DVec4], origin: DVec3) -> Self {
        let middle = degrees.middle(net);
        let center = middle.truncate() - origin * middle.w;
        let (mut most, mut off): (f64, f64) = (0.0, 0.0);
        for h in net {
            most = most.max((h.truncate() - origin * h.w).distance_squared(center));
            off = off.max((h.w - middle.w).abs());
        }
        Self {
            vector: Ball {
                center,
                radius: most.sqrt(),
            },
            weight: [middle.w, off],
        }
    }
}

impl Ball {
    /// Less some multiple of the products of vectors and weights.
    #[inline(always)]
    fn less(self, times: f64, other: Self, [weight, off]: [f64; 2]) -> Self {
        let radius = other.radius * (weight.abs() + off) + other.center.length() * off;
        Self {
            center: self.center - other.center * (times * weight),
            radius: self.radius + times * radius,
        }
    }

    #[inline(always)]
    fn scaled(self, by: f64) -> Self {
        Self {
            center: self.center * by,
            radius: self.radius * by,
        }
    }

    /// Divided by weights, which are no less than `least`.
    #[inline(always)]
    fn over(self, [weight, off]: [f64; 2], least: f64) -> Self {
        Self {
            center: self.center / weight,
            radius: (self.radius + self.center.length() * off / weight) / least,
        }
    }
}

/// The task to bound derivatives as quotients.
struct Quotients<'a>(&'a Net<'a>);

impl Task for Quotients<'_> {
    type Output = Spread;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Spread {
        by_row!(self.0.degrees.q, self.spread())
    }
}

impl Quotients<'_> {
    /// The bounds with nets of `ROW` points a row, or any number where that is zero.
    #[inline(always)]
    fn spread<const ROW: usize>(self) -> Spread {
        let degrees = Rows::<ROW>(self.0.degrees);
        let [one, two, three] = [1, 2, 3].map(|power| degrees.product_len(power));
        let mut room = vec![DVec4::ZERO; 6 * one + 3 * two + three];
        let (nets, rest) = room.split_at_mut(6 * one);
        for (net, scaled) in self.0.nets().into_iter().zip(nets.chunks_exact_mut(one)) {
            for ((to, from), factor) in scaled.iter_mut().zip(net).zip(&degrees.0.binomials) {
                *to = *from * *factor;
            }
        }
        let nets = &*nets;
        let net = |k: usize| &nets[k * one..][..one];
        let (x, xu, xv, xuu, xuv, xvv) = (net(0), net(1), net(2), net(3), net(4), net(5));
        let mut weights = vec![0.0; one + two + three];
        let (single, powers) = weights.split_at_mut(one);
        let (square, cube) = powers.split_at_mut(two);
        for (weight, h) in single.iter_mut().zip(x) {
            *weight = h.w;
        }
        degrees.weights(1, single, single, square);
        degrees.weights(2, square, single, cube);
        let (m_u, rest) = rest.split_at_mut(two);
        let (m_v, rest) = rest.split_at_mut(two);
        let (second, third) = rest.split_at_mut(two);
        degrees.sum(1, &[(xu, x, 1.0), (x, xu, -1.0)], m_u);
        degrees.sum(1, &[(xv, x, 1.0), (x, xv, -1.0)], m_v);
        let du = quotient(m_u, square, &degrees.0.inverse[0]);
        let dv = quotient(m_v, square, &degrees.0.inverse[0]);
        degrees.sum(1, &[(xuu, x, 1.0), (x, xuu, -1.0)], second);
        degrees.sum(2, &[(second, x, 1.0), (m_u, xu, -2.0)], third);
        let duu = quotient(third, cube, &degrees.0.inverse[1]);
        let mixed = [(xuv, x, 1.0), (xu, xv, 1.0), (xv, xu, -1.0), (x, xuv, -1.0)];
        degrees.sum(1, &mixed, second);
        degrees.sum(2, &[(second, x, 1.0), (m_u, xv, -2.0)], third);
        let duv = quotient(third, cube, &degrees.0.inverse[1]);
        degrees.sum(1, &[(xvv, x, 1.0), (x, xvv, -1.0)], second);
        degrees.sum(2, &[(second, x, 1.0), (m_v, xv, -2.0)], third);
        let dvv = quotient(third, cube, &degrees.0.inverse[1]);
        Spread {
            du,
            dv,
            duu,
            duv,
            dvv,
        }
    }
}

impl<const ROW: usize> Rows<'_, ROW> {
    /// Points of a product of `power` nets.
    #[inline(always)]
    fn product_len(&self, power: usize) -> usize {
        (power * self.0.p + 1) * self.row(power)
    }

    /// The sum of products of nets with a factor each, as [`Rows::add`] adds them.
    #[inline(always)]
    fn sum(&self, power: usize, terms: &[(&[DVec4], &[DVec4], f64)], sum: &mut [DVec4]) {
        sum.fill(DVec4::ZERO);
        for (a, b, factor) in terms {
            self.add(power, a, b, *factor, sum);
        }
    }

    /// Adds the product of a net, itself one of `power` nets, with the weight of a single one, times
    /// a factor; its own weight becomes meaningless.
    #[inline(always)]
    fn add(&self, power: usize, a: &[DVec4], b: &[DVec4], factor: f64, sum: &mut [DVec4]) {
        let [row_a, row_b, row] = [power, 1, power + 1].map(|power| self.row(power));
        for (i, own) in a.chunks_exact(row_a).enumerate() {
            for (j, other) in b.chunks_exact(row_b).enumerate() {
                let to = &mut sum[(i + j) * row..][..row];
                for k in 0..row_a {
                    for l in 0..row_b {
                        to[k + l] += own[k] * (other[l].w * factor);
                    }
                }
            }
        }
    }

    /// The same of weights alone.
    #[inline(always)]
    fn weights(&self, power: usize, a: &[f64], b: &[f64], sum: &mut [f64]) {
        let [row_a, row_b, row] = [power, 1, power + 1].map(|power| self.row(power));
        for (i, own) in a.chunks_exact(row_a).enumerate() {
            for (j, other) in b.chunks_exact(row_b).enumerate() {
                let to = &mut sum[(i + j) * row..][..row];
                for k in 0..row_a {
                    for l in 0..row_b {
                        to[k + l] += own[k] * other[l];
                    }
                }
            }
        }
    }
}

/// Where the quotient of two nets is, with the reciprocals of their binomial coefficients; the
/// divisor's coefficients are positive.
#[inline(always)]
fn quotient(numerator: &[DVec4], divisor: &[f64], inverse: &[f64]) -> Ball {
    // Scaled coefficients sum up to the value in the middle but for a common factor.
    let (mut top, mut bottom) = (DVec4::ZERO, 0.0);
    for (above, below) in numerator.iter().zip(divisor) {
        top += *above;
        bottom += *below;
    }
    let center = top.truncate() / bottom;
    let (mut most, mut least) = (0.0_f64, f64::INFINITY);
    for ((above, below), factor) in numerator.iter().zip(divisor).zip(inverse) {
        let off = above.truncate() - center * *below;
        most = most.max(off.length_squared() * (factor * factor));
        least = least.min(below * factor);
    }
    Ball {
        center,
        radius: most.sqrt() / least,
    }
}
