//! Bernstein arithmetic: bounds of derivatives from control points.

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4};
use kernel::BezierSurface;

use super::pieces::{Ball, Spread};

/// The net of a piece, or of a part of it.
pub(super) struct Net {
    p: usize,
    q: usize,
    points: Vec<DVec4>,
}

impl Net {
    pub(super) fn of(piece: &BezierSurface) -> Self {
        Self {
            p: piece.degree_u(),
            q: piece.degree_v(),
            points: piece.homogeneous().to_vec(),
        }
    }

    /// Bounds over a part of the domain of `piece`, of which this is the net.
    pub(super) fn restricted(
        mut self,
        piece: &BezierSurface,
        u: Range<f64>,
        v: Range<f64>,
        rough: bool,
    ) -> Spread {
        let [whole_u, whole_v] = [piece.u(), piece.v()];
        let share = |x: f64, r: &Range<f64>| ((x - r.start) / (r.end - r.start)).clamp(0.0, 1.0);
        let flat = [u.start >= u.end, v.start >= v.end];
        let row = self.q + 1;
        let (a, b) = (share(u.start, &whole_u), share(u.end, &whole_u));
        for j in 0..row {
            cut(&mut self.points[j..], self.p, row, a, b);
        }
        let (c, d) = (share(v.start, &whole_v), share(v.end, &whole_v));
        // A part without width is one row of points, and tells about its own direction only.
        if flat[0] {
            self.points.truncate(row);
            self.p = 0;
        }
        for i in 0..=self.p {
            cut(&mut self.points[i * row..], self.q, 1, c, d);
        }
        if flat[1] {
            self.points = self.points.iter().copied().step_by(row).collect();
            self.q = 0;
        }
        let wide = |part: Range<f64>, whole: Range<f64>, flat| if flat { whole } else { part };
        let (u, v) = (wide(u, whole_u, flat[0]), wide(v, whole_v, flat[1]));
        self.spread(u, v, rough)
    }

    /// First derivatives along u and v at a point of the piece's domain, borders included.
    pub(super) fn corner_derivatives(mut self, piece: &BezierSurface, uv: DVec2) -> [DVec3; 2] {
        let (u, v) = (piece.u(), piece.v());
        let row = self.q + 1;
        let share = |x: f64, r: &Range<f64>| ((x - r.start) / (r.end - r.start)).clamp(0.0, 1.0);
        // The part from the point to the farther end, whose first corner is the point.
        let (a, b) = (share(uv.x, &u), share(uv.y, &v));
        let (end_u, end_v) = (
            if a < 0.5 { 1.0 } else { 0.0 },
            if b < 0.5 { 1.0 } else { 0.0 },
        );
        for j in 0..row {
            cut(
                &mut self.points[j..],
                self.p,
                row,
                a.min(end_u),
                a.max(end_u),
            );
        }
        for i in 0..=self.p {
            cut(
                &mut self.points[i * row..],
                self.q,
                1,
                b.min(end_v),
                b.max(end_v),
            );
        }
        let (i, step_u) = if end_u > a { (0, 1) } else { (self.p, -1) };
        let (j, step_v) = if end_v > b { (0, 1) } else { (self.q, -1) };
        let at = |i: usize, j: usize| self.points[i * row + j];
        let corner = at(i, j);
        let slope = |next: DVec4, degree: usize, step: i32, length: f64| {
            let difference = (next - corner) * (degree as f64 * f64::from(step) / length);
            (difference.truncate() - corner.truncate() / corner.w * difference.w) / corner.w
        };
        let next_u = at(i.wrapping_add_signed(step_u as isize), j);
        let next_v = at(i, j.wrapping_add_signed(step_v as isize));
        [
            slope(
                next_u,
                self.p,
                step_u,
                (end_u - a).abs() * (u.end - u.start),
            ),
            slope(
                next_v,
                self.q,
                step_v,
                (end_v - b).abs() * (v.end - v.start),
            ),
        ]
    }

    /// Bounds over all of the net, whose domain is given; rough ones cost less.
    ///
    /// Every derivative is a quotient `N / w^k` of polynomials; about its value `A` in the
    /// middle it strays by no more than the largest coefficient of `N - A w^k` over the
    /// least weight to the k. With `X = w S`: for `Su`, `N = Xu w - X wu =: M` and k = 2; for
    /// `Suu`, `N = Mu w - 2 wu M` and k = 3; for `Suv`, `N = Mv w - 2 wv M`.
    pub(super) fn spread(&self, u: Range<f64>, v: Range<f64>, rough: bool) -> Spread {
        let (p, q) = (self.p, self.q);
        let (du, dv) = ((u.end - u.start).recip(), (v.end - v.start).recip());
        let along_u = |net: &[DVec4]| derivative(net, p, q + 1, true, du);
        let along_v = |net: &[DVec4]| derivative(net, q, q + 1, false, dv);
        let x = &self.points;
        let (xu, xv) = (along_u(x), along_v(x));
        let (xuu, xuv, xvv) = (along_u(&xu), along_v(&xu), along_v(&xv));
        let first = x[0].w;
        if x.iter().all(|h| (h.w - first).abs() <= 0.0) {
            // Without weights the coefficients are those of the derivatives themselves.
            let ball = |net: &[DVec4]| {
                let center = middle(net, p, q).truncate() / first;
                let off = |h: &DVec4| (h.truncate() / first).distance(center);
                Ball {
                    center,
                    radius: net.iter().map(off).fold(0.0, f64::max),
                }
            };
            return Spread {
                du: ball(&xu),
                dv: ball(&xv),
                duu: ball(&xuu),
                duv: ball(&xuv),
                dvv: ball(&xvv),
            };
        }
        if rough {
            return self.rough([&xu, &xv, &xuu, &xuv, &xvv]);
        }
        let one = Power::new(p, q, 1);
        let [x, xu, xv, xuu, xuv, xvv] = [x, &xu, &xv, &xuu, &xuv, &xvv].map(|n| one.scaled(n));
        let two = Power::new(p, q, 2);
        let three = Power::new(p, q, 3);
        let m_u = two.sum(&[(&xu, &x, 1.0), (&x, &xu, -1.0)]);
        let m_v = two.sum(&[(&xv, &x, 1.0), (&x, &xv, -1.0)]);
        let m_uu = two.sum(&[(&xuu, &x, 1.0), (&x, &xuu, -1.0)]);
        let m_vv = two.sum(&[(&xvv, &x, 1.0), (&x, &xvv, -1.0)]);
        let m_uv = two.sum(&[
            (&xuv, &x, 1.0),
            (&xu, &xv, 1.0),
            (&xv, &xu, -1.0),
            (&x, &xuv, -1.0),
        ]);
        let square = two.weights(&x, &x);
        let cube = three.weights(&square, &x);
        let n_uu = three.sum(&[(&m_uu, &x, 1.0), (&m_u, &xu, -2.0)]);
        let n_uv = three.sum(&[(&m_uv, &x, 1.0), (&m_u, &xv, -2.0)]);
        let n_vv = three.sum(&[(&m_vv, &x, 1.0), (&m_v, &xv, -2.0)]);
        Spread {
            du: two.quotient(&m_u, &square),
            dv: two.quotient(&m_v, &square),
            duu: three.quotient(&n_uu, &cube),
            duv: three.quotient(&n_uv, &cube),
            dvv: three.quotient(&n_vv, &cube),
        }
    }

    /// The same from balls around the coefficients of `X` and of its derivatives, by the rule of
    /// the quotient: `Su = (Xu - S wu) / w`, `Suu = (Xuu - 2 Su wu - S wuu) / w`, `Suv = (Xuv -
    /// Su wv - Sv wu - S wuv) / w`. With the origin in the middle of the part, `S` is short.
    fn rough(&self, derivatives: [&[DVec4]; 5]) -> Spread {
        let (p, q) = (self.p, self.q);
        let here = middle(&self.points, p, q);
        let origin = here.truncate() / here.w;
        let reach = |net: &[DVec4]| {
            let vector = |h: &DVec4| h.truncate() - origin * h.w;
            let middle = middle(net, p, q);
            let center = vector(&middle);
            let off = |h: &DVec4| vector(h).distance_squared(center);
            let radius = net.iter().map(off).fold(0.0, f64::max).sqrt();
            let off = |h: &DVec4| (h.w - middle.w).abs();
            Reach {
                vector: Ball { center, radius },
                weight: [middle.w, net.iter().map(off).fold(0.0, f64::max)],
            }
        };
        let x = reach(&self.points);
        let least = self.points.iter().map(|h| h.w).fold(x.weight[0], f64::min);
        let [u, v, uu, uv, vv] = derivatives.map(reach);
        let by_weight = |ball: Ball| ball.over(x.weight, least);
        let s = by_weight(x.vector);
        let du = by_weight(u.vector.less(1.0, s, u.weight));
        let dv = by_weight(v.vector.less(1.0, s, v.weight));
        let duu = uu.vector.less(2.0, du, u.weight).less(1.0, s, uu.weight);
        let dvv = vv.vector.less(2.0, dv, v.weight).less(1.0, s, vv.weight);
        let duv = uv.vector.less(1.0, du, v.weight).less(1.0, dv, u.weight);
        let duv = duv.less(1.0, s, uv.weight);
        Spread {
            du,
            dv,
            duu: by_weight(duu),
            duv: by_weight(duv),
            dvv: by_weight(dvv),
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

impl Ball {
    /// Less some multiple of the products of vectors and weights.
    fn less(self, times: f64, other: Self, [weight, off]: [f64; 2]) -> Self {
        let radius = other.radius * (weight.abs() + off) + other.center.length() * off;
        Self {
            center: self.center - other.center * (times * weight),
            radius: self.radius + times * radius,
        }
    }

    /// Divided by weights, which are no less than `least`.
    fn over(self, [weight, off]: [f64; 2], least: f64) -> Self {
        Self {
            center: self.center / weight,
            radius: (self.radius + self.center.length() * off / weight) / least,
        }
    }
}

/// Nets of products of `power` nets of degrees `p` and `q`, as coefficients times their
/// binomial coefficients: products are sums over pairs then.
struct Power {
    /// Points of a row of one factor, and of the product.
    rows: [usize; 2],
    binomials: [Vec<f64>; 2],
}

impl Power {
    fn new(p: usize, q: usize, power: usize) -> Self {
        Self {
            rows: [q + 1, power * q + 1],
            binomials: [p, q].map(|degree| binomials(power * degree)),
        }
    }

    fn scaled(&self, net: &[DVec4]) -> Vec<DVec4> {
        let row = self.rows[1];
        let factor = |k: usize| self.binomials[0][k / row] * self.binomials[1][k % row];
        net.iter()
            .enumerate()
            .map(|(k, h)| *h * factor(k))
            .collect()
    }

    fn len(&self) -> usize {
        self.binomials[0].len() * self.binomials[1].len()
    }

    /// The sum of products of a net, which may be a product itself, with the weight of a
    /// single one; its own weight is left out.
    fn sum(&self, terms: &[(&[DVec4], &[DVec4], f64)]) -> Vec<DVec4> {
        let mut sum = vec![DVec4::ZERO; self.len()];
        for (a, b, factor) in terms {
            self.add(a, b, &mut sum, |sum, a, b| *sum += a * (b.w * factor));
        }
        sum
    }

    /// The product of the weights of two nets, as weights.
    fn weights(&self, a: &[DVec4], b: &[DVec4]) -> Vec<DVec4> {
        let mut product = vec![DVec4::ZERO; self.len()];
        self.add(a, b, &mut product, |product, a, b| product.w += a.w * b.w);
        product
    }

    /// Adds the pairs of two nets, each to its place in the product; the second net is single.
    fn add(
        &self,
        a: &[DVec4],
        b: &[DVec4],
        product: &mut [DVec4],
        add: impl Fn(&mut DVec4, DVec4, DVec4),
    ) {
        let [row_b, row] = self.rows;
        for (i, own) in a.chunks_exact(row + 1 - row_b).enumerate() {
            for (j, other) in b.chunks_exact(row_b).enumerate() {
                let to = &mut product[(i + j) * row..][..row];
                for (k, own) in own.iter().enumerate() {
                    for (sum, other) in to[k..].iter_mut().zip(other) {
                        add(sum, *own, *other);
                    }
                }
            }
        }
    }

    /// Where the quotient of two nets is; the divisor's coefficients are positive.
    fn quotient(&self, numerator: &[DVec4], divisor: &[DVec4]) -> Ball {
        let degree_v = self.binomials[1].len() - 1;
        // Scaled coefficients sum up to the value in the middle but for a common factor.
        let top = numerator
            .iter()
            .fold(DVec4::ZERO, |sum, h| sum + *h)
            .truncate();
        let bottom: f64 = divisor.iter().map(|h| h.w).sum();
        let center = top / bottom;
        let (mut most, mut least) = (0.0_f64, f64::INFINITY);
        let rows = numerator.chunks_exact(degree_v + 1);
        for (i, (above, below)) in rows.zip(divisor.chunks_exact(degree_v + 1)).enumerate() {
            for (j, (above, below)) in above.iter().zip(below).enumerate() {
                let factor = (self.binomials[0][i] * self.binomials[1][j]).recip();
                let off = above.truncate() - center * below.w;
                most = most.max(off.length_squared() * (factor * factor));
                least = least.min(below.w * factor);
            }
        }
        Ball {
            center,
            radius: most.sqrt() / least,
        }
    }
}

/// The binomial coefficients `n` over `k` for all `k`.
fn binomials(n: usize) -> Vec<f64> {
    let next = |c: &mut f64, k: usize| {
        let value = *c;
        *c = value * (n - k) as f64 / (k + 1) as f64;
        Some(value)
    };
    (0..=n).scan(1.0, next).collect()
}

/// The derivative of a net along one parameter, at the degree of the net: differences, with
/// the degree raised again.
fn derivative(net: &[DVec4], degree: usize, row: usize, along_u: bool, scale: f64) -> Vec<DVec4> {
    if degree == 0 {
        return vec![DVec4::ZERO; net.len()];
    }
    let n = degree as f64;
    let stride = if along_u { row } else { 1 };
    let place = |k: usize| if along_u { k / row } else { k % row };
    let value = |k: usize| {
        let i = place(k);
        let mut sum = DVec4::ZERO;
        if i > 0 {
            sum += (net[k] - net[k - stride]) * (i as f64 / n);
        }
        if i < degree {
            sum += (net[k + stride] - net[k]) * ((degree - i) as f64 / n);
        }
        sum * (n * scale)
    };
    (0..net.len()).map(value).collect()
}

/// The value of a net in the middle of its domain.
fn middle(net: &[DVec4], p: usize, q: usize) -> DVec4 {
    let halved = |degree: usize, get: &dyn Fn(usize) -> DVec4| {
        let mut share = 0.5_f64.powi(i32::try_from(degree).unwrap_or(i32::MAX));
        (0..=degree).fold(DVec4::ZERO, |sum, k| {
            let term = get(k) * share;
            share *= (degree - k) as f64 / (k + 1) as f64;
            sum + term
        })
    };
    halved(p, &|i| halved(q, &|j| net[i * (q + 1) + j]))
}

/// Every `stride`-th point becomes those of the part between `from` and `to`.
fn cut(points: &mut [DVec4], degree: usize, stride: usize, from: f64, to: f64) {
    if to < 1.0 {
        for level in 1..=degree {
            for k in (level..=degree).rev() {
                points[k * stride] = points[(k - 1) * stride].lerp(points[k * stride], to);
            }
        }
    }
    let from = if to > 0.0 { from / to } else { 0.0 };
    if from > 0.0 {
        for level in 1..=degree {
            for k in 0..=degree - level {
                points[k * stride] = points[k * stride].lerp(points[(k + 1) * stride], from);
            }
        }
    }
}
