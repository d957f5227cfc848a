//! Bounds of derivatives from control points.
//!
//! Every derivative is a quotient `N / w^k` of polynomials; about its value `A` in the middle it
//! strays by no more than the largest coefficient of `N - A w^k` over the least weight to the k.
//! With `X = w S`: for `Su`, `N = Xu w - X wu =: M` and k = 2; for `Suu`, `N = Mu w - 2 wu M` and
//! k = 3; for `Suv`, `N = Mv w - 2 wv M`.

use std::cell::Cell;

use glam::{DVec3, DVec4};

use super::net::{Net, ORDERS, Rows, by_row};
use super::pieces::{Ball, Spread};
use crate::simd::{Simd, Task};

impl Net {
    /// Bounds over all of the net.
    pub(super) fn spread(&self) -> Spread {
        if self.has_weights {
            let mut room = ROOM.take();
            room.points.clear();
            room.weights.clear();
            let spread = self.instructions.run(Quotients(self, &mut room));
            ROOM.set(room);
            spread
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
struct Plain<'a>(&'a Net);

impl Task for Plain<'_> {
    type Output = Spread;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Spread {
        by_row!(self.0.degrees.q, self.spread())
    }
}

impl Plain<'_> {
    #[inline(always)]
    fn spread<const ROW: usize>(self) -> Spread {
        let rows = Rows::<ROW>(self.0.degrees);
        let nets = self.0.nets();
        let scale = nets[0][0].w.recip();
        // No closure: it would not be compiled for these instructions.
        let [_, u, v, uu, uv, vv] = nets;
        Spread {
            du: rows.reach(1, u, DVec3::ZERO).vector.scaled(scale),
            dv: rows.reach(2, v, DVec3::ZERO).vector.scaled(scale),
            duu: rows.reach(3, uu, DVec3::ZERO).vector.scaled(scale),
            duv: rows.reach(4, uv, DVec3::ZERO).vector.scaled(scale),
            dvv: rows.reach(5, vv, DVec3::ZERO).vector.scaled(scale),
        }
    }
}

/// The task to bound derivatives from balls around the coefficients of `X` and of its derivatives, by
/// the rule of the quotient:
/// `Su = (Xu - S wu) / w`, `Suu = (Xuu - 2 Su wu - S wuu) / w` and
/// `Suv = (Xuv - Su wv - Sv wu - S wuv) / w`.
/// With the origin in the middle of the part, `S` is short.
struct Rough<'a>(&'a Net);

impl Task for Rough<'_> {
    type Output = Spread;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Spread {
        by_row!(self.0.degrees.q, self.spread())
    }
}

impl Rough<'_> {
    #[inline(always)]
    fn spread<const ROW: usize>(self) -> Spread {
        let rows = Rows::<ROW>(self.0.degrees);
        let nets = self.0.nets();
        let here = rows.middle(nets[0], ORDERS[0]);
        let origin = here.truncate() / here.w;
        let least = nets[0].iter().map(|h| h.w).fold(here.w, f64::min);
        let [x, u, v, uu, uv, vv] = nets;
        let x = rows.reach(0, x, origin);
        let u = rows.reach(1, u, origin);
        let v = rows.reach(2, v, origin);
        let uu = rows.reach(3, uu, origin);
        let uv = rows.reach(4, uv, origin);
        let vv = rows.reach(5, vv, origin);
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

impl<const ROW: usize> Rows<'_, ROW> {
    /// Where the points of the net with a number are.
    #[inline(always)]
    fn reach(&self, number: usize, net: &[DVec4], origin: DVec3) -> Reach {
        let middle = self.middle(net, ORDERS[number]);
        let center = middle.truncate() - origin * middle.w;
        let (mut most, mut off): (f64, f64) = (0.0, 0.0);
        for h in net {
            most = most.max((h.truncate() - origin * h.w).distance_squared(center));
            off = off.max((h.w - middle.w).abs());
        }
        Reach {
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
    pub(super) fn scaled(self, by: f64) -> Self {
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

/// Room for products of nets, and of their weights.
#[derive(Default)]
struct Room {
    points: Vec<DVec4>,
    weights: Vec<f64>,
}

thread_local! {
    /// Kept from one task to the next.
    static ROOM: Cell<Room> = Cell::default();
}

/// The task to bound derivatives as quotients.
struct Quotients<'a, 'r>(&'a Net, &'r mut Room);

impl Task for Quotients<'_, '_> {
    type Output = Spread;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Spread {
        by_row!(self.0.degrees.q, self.spread())
    }
}

impl Quotients<'_, '_> {
    /// The bounds with nets of `ROW` points a row, or any number where that is zero.
    #[inline(always)]
    fn spread<const ROW: usize>(self) -> Spread {
        let degrees = self.0.degrees;
        let rows = Rows::<ROW>(degrees);
        let p = degrees.p;
        let [q, square_row, cube_row] = [1, 2, 3].map(|power| rows.row(power, 0));
        let q = q - 1;
        let [one, two, three] = [
            degrees.binomials.len(),
            (2 * p + 1) * square_row,
            (3 * p + 1) * cube_row,
        ];
        let Room { points, weights } = self.1;
        points.resize(one + 3 * two + three, DVec4::ZERO);
        let (scaled, rest) = points.split_at_mut(one);
        for ((to, from), factor) in scaled.iter_mut().zip(self.0.all()).zip(&degrees.binomials) {
            *to = *from * *factor;
        }
        let nets = degrees.nets(scaled);
        let [x, xu, xv, xuu, xuv, xvv] = nets;
        let [row, shorter, shortest] = [0, 1, 2].map(|order| rows.row(1, order));
        let (x, xu, xuu) = (Grid::new(x, row), Grid::new(xu, row), Grid::new(xuu, row));
        let (xv, xuv, xvv) = (
            Grid::new(xv, shorter),
            Grid::new(xuv, shorter),
            Grid::new(xvv, shortest),
        );
        weights.extend(x.points.iter().map(|h| h.w));
        weights.resize(x.points.len() + two + three, 0.0);
        let (own, products) = weights.split_at_mut(x.points.len());
        let (square, cube) = products.split_at_mut(two);
        Grid::new(&*own, row).weigh(x, square, square_row);
        Grid::new(&*square, square_row).weigh(x, cube, cube_row);
        let (m_u, rest) = rest.split_at_mut(two);
        let (m_v, rest) = rest.split_at_mut(two);
        let (second, third) = rest.split_at_mut(two);
        let mut third = Third {
            x,
            cube,
            inverse: &degrees.inverse[1],
            row: cube_row,
            room: third,
        };
        let mut spread = Spread::default();
        // What is constant along a direction has no derivatives there.
        if p > 0 {
            xu.cross(x, m_u, square_row);
            let m = Grid::new(&m_u[..2 * p * square_row], square_row);
            if p > 1 {
                xuu.cross(x, second, square_row);
            }
            let first = Grid::new(&second[..(2 * p - 1) * square_row], square_row);
            spread.duu = third.quotient(first, (m, xu), [2, 0]);
        }
        if q > 0 {
            xv.cross(x, m_v, square_row);
            let m = Grid::new(m_v, square_row).narrowed(rows.row(2, 1));
            second.fill(DVec4::ZERO);
            if q > 1 {
                xvv.cross(x, second, square_row);
            }
            let first = Grid::new(second, square_row).narrowed(rows.row(2, 2));
            spread.dvv = third.quotient(first, (m, xv), [0, 2]);
        }
        if p > 0 && q > 0 {
            second.fill(DVec4::ZERO);
            xuv.cross(x, second, square_row);
            xu.cross(xv, second, square_row);
            let first = Grid::new(&second[..2 * p * square_row], square_row);
            let m = Grid::new(&m_u[..2 * p * square_row], square_row);
            let first = first.narrowed(rows.row(2, 1));
            spread.duv = third.quotient(first, (m, xv), [1, 1]);
        }
        if p > 0 {
            raise(m_u, square_row, [1, 0]);
            spread.du = quotient(m_u, square, &degrees.inverse[0]);
        }
        if q > 0 {
            raise(m_v, square_row, [0, 1]);
            spread.dv = quotient(m_v, square, &degrees.inverse[0]);
        }
        spread
    }
}

/// What second derivatives are quotients of.
struct Third<'a> {
    x: Grid<'a, DVec4>,
    /// The divisor, with the reciprocals of its binomial coefficients.
    cube: &'a [f64],
    inverse: &'a [f64],
    row: usize,
    room: &'a mut [DVec4],
}

impl Third<'_> {
    /// Where a second derivative is: `first w - 2 m wu` over the cube of the weight, after raising it to
    /// the cube's degrees.
    #[inline(always)]
    fn quotient(
        &mut self,
        first: Grid<'_, DVec4>,
        (m, weights): (Grid<'_, DVec4>, Grid<'_, DVec4>),
        raised: [usize; 2],
    ) -> Ball {
        self.room.fill(DVec4::ZERO);
        first.add(self.x, 1.0, self.room, self.row);
        m.add(weights, -2.0, self.room, self.row);
        raise(self.room, self.row, raised);
        quotient(self.room, self.cube, self.inverse)
    }
}

/// A net of points, or of their weights, with binomial coefficients as factors, in rows a stride apart.
#[derive(Clone, Copy)]
struct Grid<'a, T> {
    points: &'a [T],
    row: usize,
    stride: usize,
}

impl<'a, T> Grid<'a, T> {
    #[inline(always)]
    fn new(points: &'a [T], row: usize) -> Self {
        Self {
            points,
            row,
            stride: row,
        }
    }

    /// The first points of each row.
    #[inline(always)]
    fn narrowed(self, row: usize) -> Self {
        Self { row, ..self }
    }
}

impl Grid<'_, DVec4> {
    /// Adds the product with the weight of another net, times a factor, to a net with rows of a
    /// length; the product's own weight becomes meaningless.
    #[inline(always)]
    fn add(self, other: Self, factor: f64, sum: &mut [DVec4], length: usize) {
        for (i, own) in self.points.chunks_exact(self.stride).enumerate() {
            for (j, other) in other.points.chunks_exact(other.stride).enumerate() {
                let to = &mut sum[(i + j) * length..][..length];
                for k in 0..self.row {
                    for l in 0..other.len() {
                        to[k + l] += own[k] * (other[l].w * factor);
                    }
                }
            }
        }
    }

    /// Adds the products of both with the weight of the other, the second negative.
    #[inline(always)]
    fn cross(self, other: Self, sum: &mut [DVec4], length: usize) {
        self.add(other, 1.0, sum, length);
        other.add(self, -1.0, sum, length);
    }
}

impl Grid<'_, f64> {
    /// The product of weights with those of another net.
    #[inline(always)]
    fn weigh(self, other: Grid<'_, DVec4>, product: &mut [f64], length: usize) {
        for (i, own) in self.points.chunks_exact(self.stride).enumerate() {
            for (j, other) in other.points.chunks_exact(other.stride).enumerate() {
                let to = &mut product[(i + j) * length..][..length];
                for l in 0..other.len() {
                    for k in 0..self.row {
                        to[k + l] += own[k] * other[l].w;
                    }
                }
            }
        }
    }
}

/// Raises the degrees of a net in rows of a length, which has room for it; its coefficients have
/// binomial coefficients as factors, so that `1 + x` is what multiplies it.
#[inline(always)]
fn raise(net: &mut [DVec4], length: usize, [along_u, along_v]: [usize; 2]) {
    for _ in 0..along_u {
        for k in (length..net.len()).rev() {
            net[k] += net[k - length];
        }
    }
    for _ in 0..along_v {
        for row in net.chunks_exact_mut(length) {
            for k in (1..length).rev() {
                row[k] += row[k - 1];
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

#[cfg(test)]
mod tests {
    use glam::DVec2;
    use kernel::{KnotVector, Surface};

    use super::super::pieces::{Pieces, Rect};
    use super::*;

    /// What weights are random.
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Random {
        None,
        /// One for each row and one for each column.
        Factors,
        All,
    }

    /// One random piece of some degrees.
    fn piece(rng: &mut fastrand::Rng, [p, q]: [usize; 2], random: Random) -> Surface {
        let count = (p + 1) * (q + 1);
        let points: Vec<DVec3> = (0..count)
            .map(|_| DVec3::new(rng.f64(), rng.f64(), rng.f64()))
            .collect();
        let weights: Vec<f64> = (0..count).map(|_| 0.3 + rng.f64()).collect();
        let factors = |k: usize| (weights[k / (q + 1)] * weights[k % (q + 1)]).sqrt();
        let weights = match random {
            Random::None => None,
            Random::Factors => Some((0..count).map(factors).collect::<Vec<_>>()),
            Random::All => Some(weights),
        };
        let knots = |degree| KnotVector::bezier(degree, 0.0..2.0).unwrap();
        Surface::new(knots(p), knots(q), &points, weights.as_deref()).unwrap()
    }

    #[test]
    fn derivatives_stay_within_their_bounds_which_close_in_on_them() {
        let mut rng = fastrand::Rng::with_seed(7);
        for degrees in (1..=4).flat_map(|p| (1..=4).map(move |q| [p, q])) {
            for random in [Random::None, Random::Factors, Random::All] {
                let surface = piece(&mut rng, degrees, random);
                let pieces = Pieces::new(&surface);
                let min = DVec2::new(rng.f64(), rng.f64());
                // A whole piece, parts of it, and lines along u and along v.
                let mut last = f64::INFINITY;
                for width in [1.0, 0.1, 0.01] {
                    for shape in [DVec2::X, DVec2::Y, DVec2::new(1.0, 0.5)] {
                        let max = min + shape * width;
                        let rect = Rect { min, max };
                        let full = pieces.spread(&rect);
                        let seen = Cell::new(Spread::default());
                        let bound = |spread: &Spread| {
                            seen.set(*spread);
                            1.0
                        };
                        pieces.bound_until(&rect, bound, (0.0, 0.0), || true);
                        let rough = seen.get();
                        pieces.bound_until(&rect, bound, (1.0, 2.0), || false);
                        let whole = seen.get();
                        for _ in 0..50 {
                            let place = DVec2::new(rng.f64(), rng.f64());
                            let d = surface.derivatives(rect.min + rect.size() * place);
                            for spread in [&full, &rough, &whole] {
                                check(spread, &d, rect.size(), degrees);
                            }
                        }
                        if shape.min_element() > 0.0 {
                            let radius = |s: &Spread| s.duu.radius + s.duv.radius + s.dvv.radius;
                            assert!(radius(&full) <= 0.2 * last + 1e-9, "of degrees {degrees:?}");
                            // Over large parts, weights far apart, the rough ones may be a little better.
                            let room = if random == Random::Factors {
                                0.05 * width
                            } else {
                                0.0
                            };
                            assert!(radius(&full) <= radius(&rough) * (1.0 + room) + 1e-9);
                            last = radius(&full);
                        }
                    }
                }
            }
        }
    }

    /// A rectangle without extent along a direction tells nothing of derivatives there.
    fn check(spread: &Spread, d: &kernel::SurfaceDerivatives, size: DVec2, degrees: [usize; 2]) {
        let (along_u, along_v) = (size.x > 0.0, size.y > 0.0);
        let pairs = [
            (along_u, spread.du, d.du),
            (along_v, spread.dv, d.dv),
            (along_u, spread.duu, d.duu),
            (along_u && along_v, spread.duv, d.duv),
            (along_v, spread.dvv, d.dvv),
        ];
        for (k, (told, ball, found)) in pairs.into_iter().enumerate() {
            let slack = 1e-9 * (1.0 + found.length());
            assert!(
                !told || found.distance(ball.center) <= ball.radius + slack,
                "derivative {k} of degrees {degrees:?}"
            );
        }
    }
}
