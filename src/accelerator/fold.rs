//! Where a cell folds over as seen along a ray: both roots at once.
//!
//! With the tilt `g` and its direction `e`, the distance from a ray across `e` does not depend on what stands
//! across the cell, so that its roots lie in a narrow strip: `p = m + (t0 + t) n + s d`, with the middle `m` of the
//! window, `n` along the gradient and `d` across it. The distance along `e`, less so much of that across it that
//! nothing of first order is left along `n`, is a quadratic of `s` there, but for what third derivatives and the width
//! of the strip can change. Roots are where that quadratic is no larger than all this together: in two intervals on
//! both sides of the fold at most.

use super::distance::{Cells, Distance, hessian};
use super::expansion::{ORDER, TERMS, WIDE};
use super::leaf::{Seen, Window, over_all};
use super::powers::powers_of;
use crate::simd::{LANES, Part, PerLane, Singles};

/// Share of a sum that rounding may change, many roundings wide.
const ROUNDING: f32 = 1e-5;

/// The square of the gradient across the tilt is between the reciprocals of these.
const SQUARES: [f32; 2] = [1e-8, 1e6];

/// Beside this factor of what is negative nothing counts.
const ENDLESS: f32 = 1e30;

/// How far places in a cell are rounded, several roundings wide.
const PLACE: f32 = 1e-6;

/// Parts are worth while if they are less than this share of a window.
const LEFT: f32 = 0.7;

/// The terms that count in third derivatives, by how often these are by `y`, and how much.
#[expect(
    clippy::cast_possible_truncation,
    reason = "bounds grow by more than the rounding"
)]
const THIRD: [[(usize, f32); 6]; 4] = {
    let wide = powers_of::<{ 2 * ORDER }>(WIDE);
    let mut thirds = [[(0, 0.0); 6]; 4];
    let mut by_y = 0;
    while by_y < 4 {
        let (mut t, mut place) = (0, 0);
        while t < TERMS {
            let (k, l) = (t / ORDER, t % ORDER);
            if k + by_y >= 3 && l >= by_y {
                let count = falling(k, 3 - by_y) * falling(l, by_y);
                let most = count as f64 * wide[k + l - 3] * (1.0 + ROUNDED);
                thirds[by_y][place] = (t, most as f32);
                place += 1;
            }
            t += 1;
        }
        by_y += 1;
    }
    thirds
};

/// Growth of bounds that covers their rounding to single precision, and that of sums of them.
const ROUNDED: f64 = 1e-5;

/// What a power is multiplied by when it is differentiated so often.
const fn falling(power: usize, times: usize) -> usize {
    let (mut product, mut k) = (1, 0);
    while k < times {
        product *= power - k;
        k += 1;
    }
    product
}

/// What is left of windows, in up to two parts of each.
pub(super) struct Folded {
    /// A bit for each window that has the first part, and the second.
    pub(super) lanes: [u32; 2],
    /// Of the first and the second.
    pub(super) low: [[[f32; LANES]; 2]; 2],
    pub(super) high: [[[f32; LANES]; 2]; 2],
}

impl Folded {
    pub(super) const NONE: Self = Self {
        lanes: [0; 2],
        low: [[[0.0; LANES]; 2]; 2],
        high: [[[0.0; LANES]; 2]; 2],
    };

    /// The first part of window `k`, number 0, or the second, if it has one: least and greatest coordinates.
    #[inline(always)]
    pub(super) fn part(&self, part: usize, k: usize) -> Option<([f32; 2], [f32; 2])> {
        let has_one = self.lanes[part] >> k & 1 == 1;
        let (low, high) = (&self.low[part], &self.high[part]);
        has_one.then(|| ([low[0][k], low[1][k]], [high[0][k], high[1][k]]))
    }
}

/// Looks for the parts of windows; the result has a bit for each beside which they are small.
pub(super) struct Fold<'a, S: Singles, C, const RATIONAL: bool> {
    pub(super) cells: &'a Cells<C>,
    pub(super) seen: &'a Seen<S::F>,
    pub(super) window: &'a Window<S::F>,
    /// That in the middle of the window.
    pub(super) distance: &'a Distance<S::F>,
    /// Is replaced.
    pub(super) folded: &'a mut Folded,
}

impl<S: Singles, C: PerLane<S, Lanes = S::F>, const RATIONAL: bool> Part<S>
    for Fold<'_, S, C, RATIONAL>
{
    type Output = u32;

    #[inline(always)]
    fn run(self, s: S) -> u32 {
        let Self {
            cells,
            seen,
            window,
            distance,
            folded,
        } = self;
        let strip = Strip::of::<_, _, RATIONAL>(s, cells, seen, window, distance);
        let quadratic = strip.quadratic::<_, _, RATIONAL>(s, cells, seen, window, distance);
        let (none, intervals, two) = quadratic.intervals(s);
        let zero = s.splat(0.0);
        let mut left = zero;
        for (part, interval) in intervals.into_iter().enumerate() {
            let mut sizes = [zero; 2];
            for (k, size) in sizes.iter_mut().enumerate() {
                let [near, far] = strip.side(s, k, interval, window.middle[k]);
                // What is not a number leaves the window as it is.
                let (near, far) = (s.max(near, window.low[k]), s.min(far, window.high[k]));
                s.store(near, &mut folded.low[part][k]);
                s.store(far, &mut folded.high[part][k]);
                *size = s.sub(far, near);
            }
            let is_empty = s.lt(s.min(sizes[0], sizes[1]), zero);
            let has_it = if part == 0 { u32::MAX } else { two };
            folded.lanes[part] = has_it & !(none | s.bits(is_empty));
            let area = s.mul(s.max(sizes[0], zero), s.max(sizes[1], zero));
            // Where both are one, it counts twice: that is left to halving sooner.
            left = s.add(left, area);
        }
        let mut area = s.splat(LEFT);
        for k in 0..2 {
            area = s.mul(area, s.sub(window.high[k], window.low[k]));
        }
        strip.is_known(s) & (none | s.bits(s.lt(left, area)))
    }
}

/// Where the roots of a window are, across the tilt.
struct Strip<F> {
    /// The gradient of the distance across the tilt, times the size of the tilt; across it the strip runs.
    n: [F; 2],
    /// One over the square of its length.
    inverse: F,
    /// The middle of the strip beside that of the window, and half of its width, in lengths of `n`.
    middle: F,
    half: F,
    /// What is uncertain of distances.
    uncertain: F,
}

impl<F: Copy> Strip<F> {
    #[inline(always)]
    fn of<S: Singles<F = F>, C: PerLane<S, Lanes = F>, const RATIONAL: bool>(
        s: S,
        cells: &Cells<C>,
        &Seen { place, tilt, error }: &Seen<F>,
        window: &Window<F>,
        &Distance { value, by_x, by_y }: &Distance<F>,
    ) -> Self {
        let one = s.splat(1.0);
        let [g1, g2] = tilt;
        let nx = s.fnma(g2, by_x[0], s.mul(g1, by_x[1]));
        let ny = s.fnma(g2, by_y[0], s.mul(g1, by_y[1]));
        let off = s.fnma(g1, value[1], s.mul(g2, value[0]));
        let inverse = s.div(one, s.fma(nx, nx, s.mul(ny, ny)));
        let (size1, size2) = (s.abs(g1), s.abs(g2));
        let size = s.add(size1, size2);
        let [hx, hy] = window.half;
        let [a, b, _] = over_all::<S, C, RATIONAL>(s, cells, place, window.half);
        let [any, along] = error;
        let extent = s.add(one, s.add(hx, hy));
        let uncertain = s.mul(s.fma(size, along, any), extent);
        let stray = s.fma(size2, a, s.fma(size1, b, s.mul(size, uncertain)));
        Self {
            n: [nx, ny],
            inverse,
            middle: s.mul(off, inverse),
            half: s.mul(stray, inverse),
            uncertain,
        }
    }

    /// A bit for each ray with a tilt of which products are neither lost nor endless.
    #[inline(always)]
    fn is_known<S: Singles<F = F>>(&self, s: S) -> u32 {
        let [least, most] = SQUARES;
        let (least, most) = (s.splat(least), s.splat(most));
        s.bits(s.lt(least, self.inverse)) & s.bits(s.lt(self.inverse, most))
    }

    /// The distance along the tilt, times its size, less so much of that across it that it does not change across
    /// the strip.
    #[inline(always)]
    fn quadratic<S: Singles<F = F>, C: PerLane<S, Lanes = F>, const RATIONAL: bool>(
        &self,
        s: S,
        cells: &Cells<C>,
        seen: &Seen<F>,
        window: &Window<F>,
        &Distance { value, by_x, by_y }: &Distance<F>,
    ) -> Quadratic<F> {
        let &Self {
            n: [nx, ny],
            inverse,
            middle,
            half,
            uncertain,
        } = self;
        let &Seen {
            place,
            tilt: [g1, g2],
            ..
        } = seen;
        let zero = s.splat(0.0);
        let dx = s.sub(zero, ny);
        let [hx, hy] = window.half;
        let reach = s.mul(s.fma(s.abs(ny), hx, s.mul(s.abs(nx), hy)), inverse);
        let tx = s.fma(g1, by_x[0], s.mul(g2, by_x[1]));
        let ty = s.fma(g1, by_y[0], s.mul(g2, by_y[1]));
        let share = s.mul(s.fma(tx, nx, s.mul(ty, ny)), inverse);
        let (c1, c2) = (s.fma(share, g2, g1), s.fnma(share, g1, g2));
        let value = s.fma(c1, value[0], s.mul(c2, value[1]));
        let slope = s.fma(tx, dx, s.mul(ty, nx));
        let square = s.fma(g1, g1, s.mul(g2, g2));
        let mut weights = [c1, c2, s.sub(zero, square), zero];
        if RATIONAL {
            let own = s.fma(c1, place[0], s.mul(c2, place[1]));
            weights[3] = s.sub(zero, own);
        }
        let mut second = [zero; 3];
        let mut third = zero;
        // Sums are of numbers up to these.
        let mut sizes = s.fma(s.abs(slope), reach, s.abs(value));
        for (r, &weight) in weights[..3 + usize::from(RATIONAL)].iter().enumerate() {
            let [xx, xy, yy] = hessian(s, cells, r, window.middle);
            second = [
                s.fma(weight, xx, second[0]),
                s.fma(weight, xy, second[1]),
                s.fma(weight, yy, second[2]),
            ];
            let size = s.abs(weight);
            third = s.fma(size, change_third(s, cells, r, window.half), third);
            sizes = s.add(sizes, size);
        }
        let [xx, xy, yy] = second;
        let (qnx, qny) = (s.fma(xx, nx, s.mul(xy, ny)), s.fma(xy, nx, s.mul(yy, ny)));
        let (qdx, qdy) = (s.fma(xx, dx, s.mul(xy, nx)), s.fma(xy, dx, s.mul(yy, nx)));
        let both = s.fma(qnx, dx, s.mul(qny, nx));
        let across = s.mul(s.splat(0.5), s.fma(qnx, nx, s.mul(qny, ny)));
        let along = s.mul(s.splat(0.5), s.fma(qdx, dx, s.mul(qdy, nx)));
        // What the width of the strip changes.
        let wide = s.fma(s.splat(2.0), s.abs(middle), half);
        let wide = s.fma(s.abs(across), wide, s.mul(s.abs(both), reach));
        let rest = s.fma(uncertain, s.add(s.abs(c1), s.abs(c2)), third);
        let rest = s.fma(sizes, s.splat(PLACE), rest);
        Quadratic {
            a: along,
            b: s.fma(both, middle, slope),
            c: s.fma(s.mul(across, middle), middle, value),
            rest: s.fma(half, wide, rest),
        }
    }

    /// From where to where an interval of the strip lies along an axis, beside the middle of the window.
    #[inline(always)]
    fn side<S: Singles<F = F>>(&self, s: S, k: usize, [low, high]: [F; 2], middle: F) -> [F; 2] {
        let half = s.splat(0.5);
        let (mean, radius) = (s.mul(half, s.add(low, high)), s.mul(half, s.sub(high, low)));
        let [nx, ny] = self.n;
        let d = [s.sub(s.splat(0.0), ny), nx][k];
        let place = s.fma(mean, d, s.fma(self.middle, self.n[k], middle));
        let wide = s.fma(self.half, s.abs(self.n[k]), s.splat(PLACE));
        let radius = s.fma(radius, s.abs(d), wide);
        [s.sub(place, radius), s.add(place, radius)]
    }
}

/// By how much coordinate `r` may differ from what second derivatives tell, `half` of a window away from its middle.
#[inline(always)]
fn change_third<S: Singles, C: PerLane<S, Lanes = S::F>>(
    s: S,
    cells: &Cells<C>,
    r: usize,
    [hx, hy]: [S::F; 2],
) -> S::F {
    let mut bounds = [s.splat(0.0); 4];
    for (bound, counts) in bounds.iter_mut().zip(&THIRD) {
        for &(t, count) in counts {
            let term = s.abs(cells.terms[t][r].lanes(s));
            *bound = s.fma(term, s.splat(count), *bound);
        }
    }
    let [xxx, xxy, xyy, yyy] = bounds;
    let three = s.splat(3.0);
    let by_hx = s.fma(xxx, hx, s.mul(three, s.mul(xxy, hy)));
    let by_hy = s.fma(yyy, hy, s.mul(three, s.mul(xyy, hx)));
    let sum = s.fma(s.mul(hx, hx), by_hx, s.mul(s.mul(hy, hy), by_hy));
    s.mul(sum, s.splat(1.0 / 6.0))
}

/// `a s^2 + b s + c`, from which a function differs by `rest` at most.
struct Quadratic<F> {
    a: F,
    b: F,
    c: F,
    rest: F,
}

impl<F: Copy> Quadratic<F> {
    /// A bit for each function without roots, the intervals in which they are, and a bit for each that has the
    /// second one, too.
    #[inline(always)]
    fn intervals<S: Singles<F = F>>(&self, s: S) -> (u32, [[F; 2]; 2], u32) {
        let &Self { a, b, c, rest } = self;
        let (zero, four) = (s.splat(0.0), s.splat(4.0));
        let product = s.mul(four, s.mul(a, c));
        let square = s.mul(b, b);
        let room = s.mul(four, s.mul(s.abs(a), rest));
        let room = s.fma(s.add(square, s.abs(product)), s.splat(ROUNDING), room);
        let discriminant = s.sub(square, product);
        let (most, least) = (s.add(discriminant, room), s.sub(discriminant, room));
        let none = s.bits(s.lt(most, zero));
        let inverse = s.div(s.splat(0.5), a);
        let middle = s.sub(zero, s.mul(b, inverse));
        let inverse = s.abs(inverse);
        let outer = s.mul(s.sqrt(s.max(most, zero)), inverse);
        let inner = s.mul(s.sqrt(s.max(least, zero)), inverse);
        let padding = s.mul(s.add(s.abs(middle), outer), s.splat(ROUNDING));
        let (outer, inner) = (s.add(outer, padding), s.sub(inner, padding));
        // About the fold itself there is one, which both would be.
        let apart = s.mul(s.min(least, zero), s.splat(ENDLESS));
        let minus = s.sub(zero, outer);
        let inner = s.max(s.add(inner, apart), minus);
        let two = s.bits(s.lt(minus, inner));
        let intervals = [
            [s.sub(middle, outer), s.sub(middle, inner)],
            [s.add(middle, inner), s.add(middle, outer)],
        ];
        (none, intervals, two)
    }
}

#[cfg(test)]
#[expect(
    clippy::cast_possible_truncation,
    reason = "what is rounded is held against bounds that allow for it"
)]
mod tests {
    use super::*;
    use crate::accelerator::distance::distance;
    use crate::random::Random;
    use crate::simd::Portable;

    /// Errors of single precision, as [`Seen`] has them.
    const ERROR: f32 = 1e-6;

    /// A cell that bends so much.
    fn bent(random: &mut Random, (bend, order): (f64, usize), is_rational: bool) -> Cells<f32> {
        let mut cells = Cells {
            terms: [[0.0; 4]; TERMS],
            second: [[0.0; 4]; 3],
            reach: [0.0; 2],
            higher: 0.0,
            flat: 0,
        };
        for (t, term) in cells.terms.iter_mut().enumerate().skip(1) {
            let degree = t / ORDER + t % ORDER;
            for (r, term) in term.iter_mut().enumerate() {
                let stray = bend / f64::from(1 << (2 * degree)) * (random.unit() - 0.5);
                let is_there = degree == 2 || order == ORDER && degree > 2;
                if (r < 3 || is_rational) && is_there && t / ORDER < order && t % ORDER < order {
                    *term = stray as f32;
                }
            }
        }
        cells.terms[2 * ORDER][2] += bend as f32 * 0.2;
        (cells.terms[ORDER][0], cells.terms[1][1]) = (1.0, 1.0);
        cells.terms[0][3] = 1.0;
        for (t, term) in cells.terms.iter().enumerate() {
            let (k, l) = ((t / ORDER) as f32, (t % ORDER) as f32);
            let counts = [k * (k - 1.0), k * l, l * (l - 1.0)];
            for (sums, count) in cells.second.iter_mut().zip(counts) {
                for (sum, term) in sums.iter_mut().zip(term) {
                    *sum += 1.01 * count * term.abs();
                }
            }
        }
        cells
    }

    /// The value of each coordinate.
    fn at(cells: &Cells<f32>, [x, y]: [f64; 2]) -> [f64; 4] {
        let mut sums = [0.0; 4];
        for (t, term) in cells.terms.iter().enumerate() {
            let power = f64::powf(x, (t / ORDER) as f64) * f64::powf(y, (t % ORDER) as f64);
            for (sum, term) in sums.iter_mut().zip(term) {
                *sum += f64::from(*term) * power;
            }
        }
        sums
    }

    /// Windows with a root each, in which cells are looked at from rays of all tilts: how many are left to their
    /// parts, and that these have all roots.
    fn parts<const RATIONAL: bool>(random: &mut Random, bend: (f64, usize)) -> u32 {
        let cells = bent(random, bend, RATIONAL);
        let (mut place, mut tilt) = ([[0.0; LANES]; 2], [[0.0; LANES]; 2]);
        let (mut low, mut high) = ([[0.0; LANES]; 2], [[0.0; LANES]; 2]);
        let mut roots = [[0.0; 2]; LANES];
        for k in 0..LANES {
            let root = [0, 1].map(|_| 2.0 * random.unit() - 1.0);
            let [a, b, c, w] = at(&cells, root);
            let size = 10.0_f64.powf(8.0 * random.unit() - 5.0);
            for (axis, value) in [a, b].into_iter().enumerate() {
                let own = ((2.0 * random.unit() - 1.0) * size) as f32;
                tilt[axis][k] = own;
                place[axis][k] = ((value - f64::from(own) * c) / w) as f32;
                let reach = random.unit();
                low[axis][k] = (root[axis] - reach * random.unit()).max(-1.0) as f32;
                high[axis][k] = (root[axis] + reach * random.unit()).min(1.0) as f32;
            }
            roots[k] = root;
        }
        let s = Portable;
        let seen = Seen {
            place: place.map(|x| s.load(&x)),
            tilt: tilt.map(|x| s.load(&x)),
            error: [s.splat(ERROR); 2],
        };
        let window = Window::new(s, low.map(|x| s.load(&x)), high.map(|x| s.load(&x)));
        let mut folded = Folded::NONE;
        let worth = s.apart(Fold::<_, _, RATIONAL> {
            cells: &cells,
            seen: &seen,
            window: &window,
            distance: &distance::<_, _, RATIONAL>(s, &cells, seen.place, seen.tilt, window.middle),
            folded: &mut folded,
        });
        for (k, root) in roots.iter().enumerate() {
            let has_it = |part: usize| {
                folded.part(part, k).is_some_and(|(low, high)| {
                    let within = |axis: usize| {
                        let x = root[axis] as f32;
                        low[axis] <= x && x <= high[axis]
                    };
                    within(0) && within(1)
                })
            };
            let is_left = worth >> k & 1 == 1;
            assert!(
                !is_left || has_it(0) || has_it(1),
                "{k}: {root:?} {cells:?}"
            );
        }
        worth.count_ones()
    }

    #[test]
    fn no_root_is_lost_where_cells_fold_over() {
        let mut random = Random(17);
        let (mut worth, mut all) = (0, 0);
        for k in 0..4000 {
            let bend = (
                3.0 * random.unit().powi(2),
                if k % 4 < 2 { ORDER } else { 3 },
            );
            worth += if k % 2 == 0 {
                parts::<false>(&mut random, bend)
            } else {
                parts::<true>(&mut random, bend)
            };
            all += LANES as u32;
        }
        assert!(worth > all / 4, "{worth} of {all}");
    }
}
