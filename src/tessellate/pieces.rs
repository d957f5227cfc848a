//! A surface in Bézier pieces, and bounds of its derivatives over rectangles of parameters.

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4};
use kernel::{BezierSurface, KnotVector, Surface, regular_normal};

/// All vectors no farther than `radius` from `center`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Ball {
    pub(super) center: DVec3,
    pub(super) radius: f64,
}

impl Ball {
    /// The largest length.
    pub(super) fn reach(self) -> f64 {
        self.center.length() + self.radius
    }

    /// The least ball around two.
    fn union(self, other: Self) -> Self {
        let (way, distance) = (
            other.center - self.center,
            other.center.distance(self.center),
        );
        if distance + other.radius <= self.radius {
            return self;
        }
        if distance + self.radius <= other.radius {
            return other;
        }
        let radius = 0.5 * (distance + self.radius + other.radius);
        let share = (radius - self.radius) / distance;
        Self {
            center: self.center + way * share,
            radius,
        }
    }
}

/// Where the derivatives of a surface are over a rectangle of parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Spread {
    pub(super) du: Ball,
    pub(super) dv: Ball,
    pub(super) duu: Ball,
    pub(super) duv: Ball,
    pub(super) dvv: Ball,
}

impl Spread {
    fn union(self, other: Self) -> Self {
        Self {
            du: self.du.union(other.du),
            dv: self.dv.union(other.dv),
            duu: self.duu.union(other.duu),
            duv: self.duv.union(other.duv),
            dvv: self.dvv.union(other.dvv),
        }
    }

    /// A bound of the second directional derivative along `d`, which is a parameter step
    /// within a rectangle of the proportions `size`.
    ///
    /// Bounds along the three sides of a triangle are what [`Spread::triangle`] needs: the
    /// part that strays is a quadratic form in `d`.
    pub(super) fn bend(&self, d: DVec2, size: DVec2) -> f64 {
        let mean = self.duu.center * (d.x * d.x)
            + self.duv.center * (2.0 * d.x * d.y)
            + self.dvv.center * (d.y * d.y);
        let aspect = if size.x > 0.0 && size.y > 0.0 {
            size.y / size.x
        } else {
            1.0
        };
        let mixed = self.duv.radius * (aspect * d.x * d.x + d.y * d.y / aspect);
        mean.length() + self.duu.radius * d.x * d.x + mixed + self.dvv.radius * d.y * d.y
    }

    /// How far the surface over a triangle of the rectangle is from the flat triangle with
    /// the same corners, at the same parameters.
    ///
    /// With `l` the barycentric coordinates of a point, the distance there is at most half
    /// of the sum of `l_i l_j bend(p_i - p_j)` over the sides: Taylor's formula about the
    /// point, of which the constant part is an identity and the rest a quadratic form.
    pub(super) fn triangle(&self, [a, b, c]: [DVec2; 3], size: DVec2) -> f64 {
        let [x, y, z] = [a - b, b - c, c - a].map(|d| self.bend(d, size));
        let longest = x.max(y).max(z);
        let others = x + y + z - longest;
        if longest >= others {
            return longest / 8.0;
        }
        // Half the squared radius of the circle around a triangle with these squared sides.
        let product = if longest <= x {
            y * z
        } else if longest <= y {
            x * z
        } else {
            x * y
        };
        let excess = others - longest;
        0.5 * longest / (4.0 - excess * excess / product)
    }

    /// How far the surface over the segment along `d` is from the chord.
    pub(super) fn chord(&self, d: DVec2, size: DVec2) -> f64 {
        self.bend(d, size) / 8.0
    }
}

/// A rectangle of parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) min: DVec2,
    pub(super) max: DVec2,
}

impl Rect {
    /// The least rectangle around points.
    pub(super) fn around(points: impl IntoIterator<Item = DVec2>) -> Self {
        let empty = Self {
            min: DVec2::INFINITY,
            max: DVec2::NEG_INFINITY,
        };
        points.into_iter().fold(empty, |r, p| Self {
            min: r.min.min(p),
            max: r.max.max(p),
        })
    }

    pub(super) fn size(&self) -> DVec2 {
        self.max - self.min
    }
}

/// A surface with its Bézier pieces.
#[derive(Debug)]
pub(super) struct Pieces<'a> {
    pub(super) surface: &'a Surface,
    /// Borders of the pieces along u and v.
    breaks: [Vec<f64>; 2],
    /// Breaks inside the domain at which a first derivative jumps.
    pub(super) creases: [Vec<f64>; 2],
    list: Vec<Piece>,
}

#[derive(Debug)]
struct Piece {
    net: BezierSurface,
    spread: Spread,
}

impl<'a> Pieces<'a> {
    pub(super) fn new(surface: &'a Surface) -> Self {
        let list: Vec<Piece> = surface
            .bezier_pieces()
            .into_iter()
            .map(|net| Piece {
                spread: Net::of(&net).spread(net.u(), net.v()),
                net,
            })
            .collect();
        let breaks = [surface.knots_u().breaks(), surface.knots_v().breaks()];
        let mut pieces = Self {
            surface,
            breaks,
            creases: [Vec::new(), Vec::new()],
            list,
        };
        pieces.creases = [0, 1].map(|axis| pieces.find_creases(axis));
        pieces
    }

    pub(super) fn domain(&self) -> Rect {
        let ends = |k: usize| (self.breaks[k][0], self.breaks[k][self.breaks[k].len() - 1]);
        let ((u0, u1), (v0, v1)) = (ends(0), ends(1));
        Rect {
            min: DVec2::new(u0, v0),
            max: DVec2::new(u1, v1),
        }
    }

    fn columns(&self) -> usize {
        self.breaks[1].len() - 1
    }

    /// How many pieces there are along an axis between two parameters.
    pub(super) fn count(&self, axis: usize, from: f64, to: f64) -> usize {
        self.spans(axis, from, to).len()
    }

    /// The numbers of the spans that meet `from..to` in more than a point, or the one that
    /// holds both.
    fn spans(&self, axis: usize, from: f64, to: f64) -> Range<usize> {
        let breaks = &self.breaks[axis];
        let last = breaks.len() - 2;
        // What rounding puts beyond a break does not count.
        let slack = (ROUNDING * (breaks[last + 1] - breaks[0])).min(0.25 * (to - from));
        let (from, to) = (from + slack, to - slack);
        let first = breaks[1..=last].partition_point(|&k| k <= from);
        let end = breaks[1..=last].partition_point(|&k| k < to).max(first);
        first..end + 1
    }

    /// Bounds over a rectangle inside the domain.
    pub(super) fn spread(&self, rect: &Rect) -> Spread {
        let mut all: Option<Spread> = None;
        for i in self.spans(0, rect.min.x, rect.max.x) {
            for j in self.spans(1, rect.min.y, rect.max.y) {
                let piece = &self.list[i * self.columns() + j];
                let (u, v) = (piece.net.u(), piece.net.v());
                let part_u = part(rect.min.x..rect.max.x, &u);
                let part_v = part(rect.min.y..rect.max.y, &v);
                let spread = if part_u == u && part_v == v {
                    piece.spread
                } else {
                    Net::of(&piece.net).restricted(&piece.net, part_u, part_v)
                };
                all = Some(all.map_or(spread, |all| all.union(spread)));
            }
        }
        all.unwrap_or_default()
    }

    /// The unit normal at `uv`, as the piece that holds `inside` continues there.
    pub(super) fn normal(&self, uv: DVec2, inside: DVec2) -> Option<DVec3> {
        if !self.is_creased(uv) {
            return self.surface.normal(uv);
        }
        let (i, j) = (
            self.spans(0, inside.x, inside.x).start,
            self.spans(1, inside.y, inside.y).start,
        );
        let piece = &self.list[i * self.columns() + j].net;
        let [du, dv] = Net::of(piece).corner_derivatives(piece, uv);
        regular_normal([du, dv], [0.0; 2]).or_else(|| self.surface.normal(uv.midpoint(inside)))
    }

    /// Whether the surface may have a crease at `uv`.
    pub(super) fn is_creased(&self, uv: DVec2) -> bool {
        (0..2).any(|axis| {
            let k = self.creases[axis].partition_point(|&k| k < uv[axis]);
            self.creases[axis].get(k).is_some_and(|&k| k <= uv[axis])
        })
    }

    /// The inner breaks where the first derivative across them is not the same on both sides.
    fn find_creases(&self, axis: usize) -> Vec<f64> {
        let knots: &KnotVector = [self.surface.knots_u(), self.surface.knots_v()][axis];
        let breaks = &self.breaks[axis];
        let inner = (1..breaks.len() - 1)
            .filter(|&k| knots.multiplicity(breaks[k]) >= knots.degree() && self.jumps(axis, k));
        inner.map(|k| breaks[k]).collect()
    }

    /// Whether the first derivative along `axis` jumps at a break, looked at in more places
    /// than a polynomial of its degree has roots.
    fn jumps(&self, axis: usize, at: usize) -> bool {
        let other = 1 - axis;
        let degree = [self.surface.knots_u(), self.surface.knots_v()][other].degree();
        let samples = 2 * degree + 1;
        (0..self.breaks[other].len() - 1).any(|k| {
            let (start, end) = (self.breaks[other][k], self.breaks[other][k + 1]);
            (0..samples).any(|s| {
                let share = (s as f64 + 0.5) / samples as f64;
                let mut uv = DVec2::ZERO;
                uv[axis] = self.breaks[axis][at];
                uv[other] = start + (end - start) * share;
                let side = |along: usize| {
                    let (i, j) = if axis == 0 { (along, k) } else { (k, along) };
                    let piece = &self.list[i * self.columns() + j].net;
                    Net::of(piece).corner_derivatives(piece, uv)[axis]
                };
                let (before, after) = (side(at - 1), side(at));
                before.distance(after) > SMOOTH * (before.length() + after.length())
            })
        })
    }
}

/// The part of a range in a piece; not so narrow that differences are mostly rounding, unless
/// it has no width at all.
fn part(range: Range<f64>, piece: &Range<f64>) -> Range<f64> {
    let (start, end) = (range.start.max(piece.start), range.end.min(piece.end));
    let least = NARROW * (piece.end - piece.start);
    if range.start >= range.end || end - start >= least {
        return start..end.max(start);
    }
    let middle = 0.5 * (start + end);
    let start = (middle - 0.5 * least).clamp(piece.start, piece.end - least);
    start..start + least
}

/// Parameters this near, as a share of the domain, may be one.
const ROUNDING: f64 = 1e-12;

/// Narrower parts of a piece are made this wide, as a share of it.
const NARROW: f64 = 1e-4;

/// First derivatives that differ by this share are the same.
const SMOOTH: f64 = 1e-7;

/// The net of a piece, or of a part of it.
struct Net {
    p: usize,
    q: usize,
    points: Vec<DVec4>,
}

impl Net {
    fn of(piece: &BezierSurface) -> Self {
        Self {
            p: piece.degree_u(),
            q: piece.degree_v(),
            points: piece.homogeneous().to_vec(),
        }
    }

    /// Bounds over a part of the domain of `piece`, of which this is the net.
    fn restricted(mut self, piece: &BezierSurface, u: Range<f64>, v: Range<f64>) -> Spread {
        let [whole_u, whole_v] = [piece.u(), piece.v()];
        let share = |x: f64, r: &Range<f64>| ((x - r.start) / (r.end - r.start)).clamp(0.0, 1.0);
        let row = self.q + 1;
        let (a, b) = (share(u.start, &whole_u), share(u.end, &whole_u));
        for j in 0..row {
            cut(&mut self.points[j..], self.p, row, a, b);
        }
        let (c, d) = (share(v.start, &whole_v), share(v.end, &whole_v));
        for i in 0..=self.p {
            cut(&mut self.points[i * row..], self.q, 1, c, d);
        }
        // A part without width tells about its own direction only.
        let wide = |part: &Range<f64>, whole: &Range<f64>| {
            if part.start < part.end {
                part.clone()
            } else {
                whole.clone()
            }
        };
        let flat = [u.start >= u.end, v.start >= v.end];
        let mut spread = self.spread(wide(&u, &whole_u), wide(&v, &whole_v));
        if flat[0] {
            (spread.du, spread.duu, spread.duv) = Default::default();
        }
        if flat[1] {
            (spread.dv, spread.dvv, spread.duv) = Default::default();
        }
        spread
    }

    /// First derivatives along u and v at a point of the piece's domain, borders included.
    fn corner_derivatives(mut self, piece: &BezierSurface, uv: DVec2) -> [DVec3; 2] {
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

    /// Bounds over all of the net, whose domain is given.
    ///
    /// Every derivative is a quotient `N / w^k` of polynomials; about its value `A` in the
    /// middle it strays by no more than the largest coefficient of `N - A w^k` over the
    /// least weight to the k. With `X = w S`: for `Su`, `N = Xu w - X wu =: M` and k = 2; for
    /// `Suu`, `N = Mu w - 2 wu M` and k = 3; for `Suv`, `N = Mv w - 2 wv M`.
    fn spread(&self, u: Range<f64>, v: Range<f64>) -> Spread {
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
            self.each(a.len(), b.len(), |i, j, k| {
                sum[k] += a[i] * (b[j].w * factor)
            });
        }
        sum
    }

    /// The product of the weights of two nets, as weights.
    fn weights(&self, a: &[DVec4], b: &[DVec4]) -> Vec<DVec4> {
        let mut product = vec![DVec4::ZERO; self.len()];
        self.each(a.len(), b.len(), |i, j, k| product[k].w += a[i].w * b[j].w);
        product
    }

    /// Visits the pairs of two nets with the place of their product; the second is single.
    fn each(&self, a: usize, b: usize, mut visit: impl FnMut(usize, usize, usize)) {
        let [row_b, row] = self.rows;
        let row_a = row + 1 - row_b;
        for i in 0..a {
            let from = (i / row_a) * row + i % row_a;
            for j in 0..b {
                visit(i, j, from + (j / row_b) * row + j % row_b);
            }
        }
    }

    /// Where the quotient of two nets is; the divisor's coefficients are positive.
    fn quotient(&self, numerator: &[DVec4], divisor: &[DVec4]) -> Ball {
        let (degree_u, degree_v) = (self.binomials[0].len() - 1, self.binomials[1].len() - 1);
        // Scaled coefficients sum up to the value in the middle but for a common factor.
        let top = numerator
            .iter()
            .fold(DVec4::ZERO, |sum, h| sum + *h)
            .truncate();
        let bottom: f64 = divisor.iter().map(|h| h.w).sum();
        let center = top / bottom;
        let row = degree_v + 1;
        let (mut most, mut least) = (0.0_f64, f64::INFINITY);
        for k in 0..(degree_u + 1) * row {
            let factor = self.binomials[0][k / row] * self.binomials[1][k % row];
            let off = numerator[k].truncate() - center * divisor[k].w;
            most = most.max(off.length() / factor);
            least = least.min(divisor[k].w / factor);
        }
        Ball {
            center,
            radius: most / least,
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
