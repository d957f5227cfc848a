//! The control points of a part of a piece, and of its derivatives, in Bernstein form.

use std::cell::Cell;
use std::ops::Range;
use std::sync::OnceLock;

use glam::{DVec2, DVec3, DVec4};
use kernel::{BezierSurface, MAX_DEGREE, binomials};

use crate::simd::{Instructions, Simd, Task};

/// What all nets of a surface have in common: of its own degrees, and of those of its lines.
#[derive(Debug)]
pub(super) struct Family {
    degrees: [usize; 2],
    pub(super) instructions: Instructions,
}

/// How often the nets of a [`Net`] are differentiated along u and v.
pub(super) const ORDERS: [[usize; 2]; 6] = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]];

/// What nets of the degrees `p` and `q` have in common.
#[derive(Debug)]
pub(super) struct Degrees {
    pub(super) p: usize,
    pub(super) q: usize,
    /// Where in a list the points of each net begin, and where the last one ends.
    offsets: [usize; 7],
    /// Shares of the coefficients along u and along v in the value in the middle, by how often they
    /// were differentiated.
    middle: [[Vec<f64>; 3]; 2],
    /// The binomial coefficient of each point of the nets, `binomial(p, i) binomial(q, j)`. Products
    /// of nets are sums over pairs once coefficients have theirs as factors.
    pub(super) binomials: Vec<f64>,
    /// The reciprocals of those of products of two, and of three.
    pub(super) inverse: [Vec<f64>; 2],
}

impl Family {
    pub(super) fn new(degree_u: usize, degree_v: usize) -> Self {
        Self {
            degrees: [degree_u, degree_v],
            instructions: Instructions::best(),
        }
    }

    /// What nets have in common that have no extent along u, or along v.
    fn member(&self, flat: [bool; 2]) -> &'static Degrees {
        let [p, q] = self.degrees;
        Degrees::of(if flat[0] { 0 } else { p }, if flat[1] { 0 } else { q })
    }
}

/// What nets of the same degrees have in common, for all faces; made when it is first asked for.
static DEGREES: [[OnceLock<Box<Degrees>>; MAX_DEGREE + 1]; MAX_DEGREE + 1] =
    [const { [const { OnceLock::new() }; MAX_DEGREE + 1] }; MAX_DEGREE + 1];

impl Degrees {
    fn of(p: usize, q: usize) -> &'static Self {
        DEGREES[p][q].get_or_init(|| Box::new(Self::new(p, q)))
    }

    fn new(p: usize, q: usize) -> Self {
        let factors = |p: usize, q: usize| {
            let row = |a: f64| binomials(q).map(move |b| a * b);
            binomials(p).flat_map(row).collect::<Vec<_>>()
        };
        let inverse = |power: usize| {
            let factors = factors(power * p, power * q);
            factors.iter().map(|f| f.recip()).collect()
        };
        let degree = |degree: usize, order: usize| degree.saturating_sub(order);
        let mut offsets = [0; 7];
        let mut binomials = Vec::new();
        for (end, [a, b]) in offsets[1..].iter_mut().zip(ORDERS) {
            binomials.extend(factors(degree(p, a), degree(q, b)));
            *end = binomials.len();
        }
        Self {
            p,
            q,
            offsets,
            middle: [p, q].map(|d| [0, 1, 2].map(|order| middle_shares(degree(d, order)))),
            binomials,
            inverse: [inverse(2), inverse(3)],
        }
    }

    /// The nets that stand one after the other in a list.
    #[inline(always)]
    pub(super) fn nets<'p>(&self, points: &'p [DVec4]) -> [&'p [DVec4]; 6] {
        [0, 1, 2, 3, 4, 5].map(|k| &points[self.offsets[k]..self.offsets[k + 1]])
    }
}

thread_local! {
    /// Room for coefficients, kept from one net to the next.
    static COEFFICIENTS: Cell<Vec<DVec4>> = const { Cell::new(Vec::new()) };
}

/// The part of a piece over a rectangle, with its derivatives.
pub(super) struct Net {
    pub(super) degrees: &'static Degrees,
    pub(super) instructions: Instructions,
    /// Coefficients one after the other: of `X`, `Xu`, `Xv`, `Xuu`, `Xuv` and `Xvv`, each of the degrees
    /// that are left, or zero of degree zero where nothing is.
    coefficients: Vec<DVec4>,
    pub(super) has_weights: bool,
}

impl Drop for Net {
    fn drop(&mut self) {
        COEFFICIENTS.set(std::mem::take(&mut self.coefficients));
    }
}

impl Net {
    /// The net over a part of the domain of `piece`.
    pub(super) fn of(family: &Family, piece: &BezierSurface, part: [Range<f64>; 2]) -> Self {
        family.instructions.run(Restriction {
            family,
            piece,
            part,
        })
    }

    #[inline(always)]
    pub(super) fn nets(&self) -> [&[DVec4]; 6] {
        self.degrees.nets(&self.coefficients)
    }

    /// The coefficients of all of them.
    pub(super) fn all(&self) -> &[DVec4] {
        &self.coefficients
    }
}

/// Calls a method for the number of points in a row, zero where it is not a usual one: loops of known
/// length are several times faster.
macro_rules! by_row {
    ($degree:expr, $object:ident.$method:ident()) => {
        match $degree {
            0 => $object.$method::<1>(),
            1 => $object.$method::<2>(),
            2 => $object.$method::<3>(),
            3 => $object.$method::<4>(),
            _ => $object.$method::<0>(),
        }
    };
}

pub(super) use by_row;

/// The task to make a [`Net`].
struct Restriction<'a> {
    family: &'a Family,
    piece: &'a BezierSurface,
    part: [Range<f64>; 2],
}

impl Task for Restriction<'_> {
    type Output = Net;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Net {
        by_row!(self.piece.degree_v(), self.net())
    }
}

impl Restriction<'_> {
    #[inline(always)]
    fn net<const ROW: usize>(self) -> Net {
        let [u, v] = &self.part;
        let whole = [self.piece.u(), self.piece.v()];
        let flat = [u.start >= u.end, v.start >= v.end];
        let degrees = self.family.member(flat);
        let (p, points) = (self.piece.degree_u(), self.piece.homogeneous());
        let row = if ROW == 0 {
            self.piece.degree_v() + 1
        } else {
            ROW
        };
        let count = degrees.offsets[6];
        let mut coefficients = COEFFICIENTS.take();
        coefficients.clear();
        coefficients.extend_from_slice(points);
        coefficients.resize(count.max(points.len()), DVec4::ZERO);
        let (a, b) = (share(u.start, &whole[0]), share(u.end, &whole[0]));
        for j in 0..row {
            cut(&mut coefficients[j..points.len()], p, row, a, b);
        }
        // A part without width is one row of points, and tells about its own direction only.
        let (c, d) = (share(v.start, &whole[1]), share(v.end, &whole[1]));
        for i in 0..=degrees.p {
            cut(&mut coefficients[i * row..][..row], row - 1, 1, c, d);
        }
        if flat[1] {
            for i in 0..=degrees.p {
                coefficients[i] = coefficients[i * row];
            }
        }
        coefficients.truncate(count);
        let [du, dv] = [u, v].map(|part| (part.end - part.start).recip());
        let (x, rest) = coefficients.split_at_mut(degrees.offsets[1]);
        let first = x[0].w;
        let has_weights = x.iter().any(|h| (h.w - first).abs() > 0.0);
        if flat[1] {
            Rows::<1>(degrees).differentiate(x, rest, [du, dv]);
        } else {
            Rows::<ROW>(degrees).differentiate(x, rest, [du, dv]);
        }
        Net {
            degrees,
            instructions: self.family.instructions,
            coefficients,
            has_weights,
        }
    }
}

/// Nets of `ROW` points a row, or any number where that is zero.
pub(super) struct Rows<'a, const ROW: usize>(pub(super) &'a Degrees);

impl<const ROW: usize> Rows<'_, ROW> {
    /// Points in a row of a product of `power` nets that has been differentiated `order` times along v.
    #[inline(always)]
    pub(super) fn row(&self, power: usize, order: usize) -> usize {
        let degree = if ROW == 0 { self.0.q } else { ROW - 1 };
        (power * degree).saturating_sub(order) + 1
    }

    /// The derivatives of a net, in the order of a [`Net`].
    #[inline(always)]
    fn differentiate(&self, x: &[DVec4], out: &mut [DVec4], [du, dv]: [f64; 2]) {
        let at = |k: usize| self.0.offsets[k] - self.0.offsets[1];
        let (xu, rest) = out.split_at_mut(at(2));
        let (xv, rest) = rest.split_at_mut(at(3) - at(2));
        let (xuu, rest) = rest.split_at_mut(at(4) - at(3));
        let (xuv, xvv) = rest.split_at_mut(at(5) - at(4));
        let (p, row, shorter) = (self.0.p, self.row(1, 0), self.row(1, 1));
        along_u(x, p, row, du, xu);
        along_v(x, row, dv, xv);
        along_u(xu, p.saturating_sub(1), row, du, xuu);
        along_v(xu, row, dv, xuv);
        along_v(xv, shorter, dv, xvv);
    }

    /// The value in the middle of a net that was differentiated so often along u and v.
    #[inline(always)]
    pub(super) fn middle(&self, net: &[DVec4], [a, b]: [usize; 2]) -> DVec4 {
        let [u, v] = &self.0.middle;
        let row = self.row(1, b);
        let mut sum = DVec4::ZERO;
        for (points, along_u) in net.chunks_exact(row).zip(&u[a]) {
            let mut part = DVec4::ZERO;
            for (point, along_v) in points.iter().zip(&v[b][..row]) {
                part += *point * *along_v;
            }
            sum += part * *along_u;
        }
        sum
    }
}

/// The derivative along u of a net of degree `p` there, zero where there is none.
#[inline(always)]
fn along_u(net: &[DVec4], p: usize, row: usize, scale: f64, out: &mut [DVec4]) {
    if p == 0 {
        out.fill(DVec4::ZERO);
        return;
    }
    let scale = p as f64 * scale;
    for (i, to) in out.chunks_exact_mut(row).enumerate() {
        let points = &net[i * row..][..2 * row];
        for j in 0..row {
            to[j] = (points[row + j] - points[j]) * scale;
        }
    }
}

/// The derivative along v of a net with rows of a length, zero where there is none.
#[inline(always)]
fn along_v(net: &[DVec4], row: usize, scale: f64, out: &mut [DVec4]) {
    if row == 1 {
        out.fill(DVec4::ZERO);
        return;
    }
    let scale = (row - 1) as f64 * scale;
    for (points, to) in net.chunks_exact(row).zip(out.chunks_exact_mut(row - 1)) {
        for j in 0..row - 1 {
            to[j] = (points[j + 1] - points[j]) * scale;
        }
    }
}

/// Where in a range a parameter is, as a share.
#[inline(always)]
pub(super) fn share(x: f64, range: &Range<f64>) -> f64 {
    ((x - range.start) / (range.end - range.start)).clamp(0.0, 1.0)
}

/// The Bernstein polynomials of a degree in the middle.
fn middle_shares(degree: usize) -> Vec<f64> {
    let first = 0.5_f64.powi(i32::try_from(degree).unwrap_or(i32::MAX));
    let next = |share: &mut f64, k: usize| {
        let value = *share;
        *share *= (degree - k) as f64 / (k + 1) as f64;
        Some(value)
    };
    (0..=degree).scan(first, next).collect()
}

/// First derivatives along u and v at a point of the piece's domain, borders included.
pub(super) fn corner_derivatives(piece: &BezierSurface, uv: DVec2) -> [DVec3; 2] {
    let (p, q) = (piece.degree_u(), piece.degree_v());
    let mut points = piece.homogeneous().to_vec();
    let (u, v) = (piece.u(), piece.v());
    let row = q + 1;
    // The part from the point to the farther end, whose first corner is the point.
    let (a, b) = (share(uv.x, &u), share(uv.y, &v));
    let (end_u, end_v) = (
        if a < 0.5 { 1.0 } else { 0.0 },
        if b < 0.5 { 1.0 } else { 0.0 },
    );
    for j in 0..row {
        cut(&mut points[j..], p, row, a.min(end_u), a.max(end_u));
    }
    for i in 0..=p {
        cut(&mut points[i * row..], q, 1, b.min(end_v), b.max(end_v));
    }
    let (i, step_u) = if end_u > a { (0, 1) } else { (p, -1) };
    let (j, step_v) = if end_v > b { (0, 1) } else { (q, -1) };
    let at = |i: usize, j: usize| points[i * row + j];
    let corner = at(i, j);
    let slope = |next: DVec4, degree: usize, step: i32, length: f64| {
        let difference = (next - corner) * (degree as f64 * f64::from(step) / length);
        (difference.truncate() - corner.truncate() / corner.w * difference.w) / corner.w
    };
    let next_u = at(i.wrapping_add_signed(step_u as isize), j);
    let next_v = at(i, j.wrapping_add_signed(step_v as isize));
    [
        slope(next_u, p, step_u, (end_u - a).abs() * (u.end - u.start)),
        slope(next_v, q, step_v, (end_v - b).abs() * (v.end - v.start)),
    ]
}

/// Every `stride`-th point becomes those of the part between `from` and `to`.
#[inline(always)]
pub(super) fn cut(points: &mut [DVec4], degree: usize, stride: usize, from: f64, to: f64) {
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
