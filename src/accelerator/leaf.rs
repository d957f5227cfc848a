//! The leaf solver for sixteen rays and one cell: exclusion, the test for uniqueness and
//! Newton's iteration, in single precision.

use super::beam::{Beam, RAYS};
use super::expansion::ORDER;
use super::model::Model;
use crate::simd::{LANES, Simd};

/// Uniqueness is proven below one; less bounds the number of steps.
const SURE: f32 = 0.9;

/// Rounding errors of positions and values in single precision, several wide.
const ROUNDING: f32 = 8.0 / (1 << 24) as f32;

/// Larger errors than this part of a cell are not for single precision.
const BLURRED: f32 = 0.01;

/// After a step of Newton's shorter than this one more without new derivatives is the last.
const CLOSE: f32 = 1e-2;

/// Cells are entered this much beyond their borders, so that what single precision leaves
/// open at a border is found from both sides.
const MARGIN: f32 = 1e-4;

/// Steps in single precision.
const STEPS: usize = 5;

/// A cell as the rays of a beam see it: axes in the order of the beam, signs along its way.
pub(super) struct View {
    bulge: [f32; 3],
    weight_stray: f32,
    dropped: f32,
    /// Middle of the cell along the beam, and the beam's middle there relative to it.
    zeta: f32,
    way: f32,
    place: [f32; 2],
    slope: [f32; 2],
    /// Rows over the two axes across and the main one.
    rows: [[f32; 3]; 3],
    /// Rounding errors of the three directions, and the size of the rows across.
    direction_size: f32,
    sizes: [f32; 3],
}

impl View {
    #[inline(always)]
    pub(super) fn of_model(model: &Model, beam: &Beam) -> Self {
        Self::new(
            model.center.to_array(),
            model.rows,
            (model.bulge, model.weight_stray),
            model.dropped,
            beam,
        )
    }

    /// As seen by a beam: the frame of a cell.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "differences are formed before; errors are allowed for"
    )]
    pub(super) fn new(
        center: [f64; 3],
        rows: [[f32; 3]; 3],
        (bulge, weight_stray): ([f32; 3], f32),
        dropped: f32,
        beam: &Beam,
    ) -> Self {
        let [i, j] = beam.across;
        let zeta = center[beam.main] * beam.sign;
        let way = zeta - beam.start;
        let (mut place, mut slope) = ([0.0; 2], [0.0; 2]);
        for (axis, side) in [(0, i), (1, j)] {
            let at = beam.middle_origin[axis] + beam.middle_slope[axis] * way;
            place[axis] = (at - center[side]) as f32;
            slope[axis] = beam.middle_slope[axis] as f32;
        }
        let sign = beam.sign as f32;
        let (mut own, mut sizes, mut direction_size) = ([[0.0; 3]; 3], [0.0; 3], 0.0_f32);
        for r in 0..3 {
            own[r] = [rows[r][i], rows[r][j], rows[r][beam.main] * sign];
            sizes[r] = own[r][0].abs() + own[r][1].abs();
            direction_size = direction_size.max(4.0 * sizes[r] + own[r][2].abs());
        }
        Self {
            bulge,
            weight_stray,
            dropped,
            zeta: zeta as f32,
            way: way as f32,
            place,
            slope,
            rows: own,
            direction_size,
            sizes,
        }
    }
}

/// What sixteen rays found in a cell, a bit for each.
pub(super) struct Verdict {
    /// They met it here, in its coordinates from -1 to 1.
    pub(super) met: u32,
    pub(super) x: [f32; LANES],
    pub(super) y: [f32; LANES],
    /// It is to be cut for these.
    pub(super) open: u32,
    /// Single precision says too little for these, and would say less of its parts.
    pub(super) blurred: u32,
}

/// What a polynomial of a cell is at a point, and its derivatives.
struct Jet<F> {
    value: F,
    by_x: F,
    by_y: F,
}

/// Coordinate `r` of the cell at `x`, `y`: Horner's rule for value and derivatives.
#[inline(always)]
fn jet<S: Simd, const M: usize, const N: usize>(
    s: S,
    model: &Model,
    r: usize,
    x: S::F,
    y: S::F,
) -> Jet<S::F> {
    let (mut value, mut by_y) = line::<S, N>(s, model, r, M - 1, y);
    let mut by_x = s.splat(0.0);
    for i in (0..M - 1).rev() {
        let (next, next_by_y) = line::<S, N>(s, model, r, i, y);
        by_x = if i == M - 2 {
            value
        } else {
            s.fma(by_x, x, value)
        };
        value = s.fma(value, x, next);
        by_y = s.fma(by_y, x, next_by_y);
    }
    Jet { value, by_x, by_y }
}

/// What stands beside `x^i` at `y`, and its derivative.
#[inline(always)]
fn line<S: Simd, const N: usize>(s: S, model: &Model, r: usize, i: usize, y: S::F) -> (S::F, S::F) {
    let terms = &model.terms[i * ORDER..(i + 1) * ORDER];
    let (mut value, mut by_y) = (s.splat(terms[N - 1][r]), s.splat(0.0));
    for j in (0..N - 1).rev() {
        by_y = if j == N - 2 {
            value
        } else {
            s.fma(by_y, y, value)
        };
        value = s.fma(value, y, s.splat(terms[j][r]));
    }
    (value, by_y)
}

/// As [`jet`], the value alone.
#[inline(always)]
fn at<S: Simd, const M: usize, const N: usize>(
    s: S,
    model: &Model,
    r: usize,
    x: S::F,
    y: S::F,
) -> S::F {
    let mut value = s.splat(0.0);
    for i in (0..M).rev() {
        let terms = &model.terms[i * ORDER..(i + 1) * ORDER];
        let mut line = s.splat(terms[N - 1][r]);
        for j in (0..N - 1).rev() {
            line = s.fma(line, y, s.splat(terms[j][r]));
        }
        value = if i == M - 1 {
            line
        } else {
            s.fma(value, x, line)
        };
    }
    value
}

/// The product of a row over the axes across with positions.
#[inline(always)]
fn across<S: Simd>(s: S, row: [f32; 3], y: [S::F; 2]) -> S::F {
    s.fma(s.splat(row[0]), y[0], s.mul(s.splat(row[1]), y[1]))
}

/// The product of a row with directions, which advance by one along the main axis.
#[inline(always)]
fn along<S: Simd>(s: S, row: [f32; 3], m: [S::F; 2]) -> S::F {
    let rest = s.fma(s.splat(row[1]), m[1], s.splat(row[2]));
    s.fma(s.splat(row[0]), m[0], rest)
}

/// The lanes of a group of what a beam has for each ray.
#[inline(always)]
fn load<S: Simd>(s: S, values: &[f32; RAYS], group: usize) -> S::F {
    s.load(&values.as_chunks::<LANES>().0[group])
}

/// How sixteen rays come to a cell.
struct Approach<F> {
    /// A bit for each that certainly misses it.
    beside: u32,
    /// Where the tangent plane is met, in the cell's coordinates, and the tilt against it.
    place: [F; 2],
    tilt: [F; 2],
    /// Roots are no further from there.
    radius: [F; 2],
    /// What is uncertain of the place.
    error: F,
}

/// Whether one of the rays `16 group ..` of the beam may meet a cell: a bit for each.
#[inline(always)]
pub(super) fn pass<S: Simd>(s: S, view: &View, beam: &Beam, group: usize, rational: bool) -> u32 {
    if rational {
        !approach::<S, true>(s, view, beam, group).beside
    } else {
        !approach::<S, false>(s, view, beam, group).beside
    }
}

/// Sixteen rays in the frame of a cell.
struct Sight<F> {
    /// Where they pass the middle along the main axis, across it.
    offset: [F; 2],
    /// The third coordinate there, and the way of one unit of it along the ray.
    depth: F,
    inverse: F,
    /// Advance of the first two coordinates with the third.
    tilt: [F; 2],
    /// The first two where the third is zero.
    place: [F; 2],
}

#[inline(always)]
fn sight<S: Simd>(s: S, view: &View, beam: &Beam, group: usize) -> Sight<S::F> {
    let [row1, row2, row3] = view.rows;
    let way = s.splat(view.way);
    let turn = [load(s, &beam.turn[0], group), load(s, &beam.turn[1], group)];
    let offset1 = s.fma(turn[0], way, load(s, &beam.offset[0], group));
    let offset2 = s.fma(turn[1], way, load(s, &beam.offset[1], group));
    let y = [
        s.add(offset1, s.splat(view.place[0])),
        s.add(offset2, s.splat(view.place[1])),
    ];
    let m = [
        s.add(turn[0], s.splat(view.slope[0])),
        s.add(turn[1], s.splat(view.slope[1])),
    ];
    let (p1, p2, p3) = (across(s, row1, y), across(s, row2, y), across(s, row3, y));
    let inverse = s.div(s.splat(1.0), along(s, row3, m));
    let g1 = s.mul(along(s, row1, m), inverse);
    let g2 = s.mul(along(s, row2, m), inverse);
    Sight {
        offset: y,
        depth: p3,
        inverse,
        tilt: [g1, g2],
        place: [s.fnma(g1, p3, p1), s.fnma(g2, p3, p2)],
    }
}

#[inline(always)]
fn approach<S: Simd, const RATIONAL: bool>(
    s: S,
    view: &View,
    beam: &Beam,
    group: usize,
) -> Approach<S::F> {
    let Sight {
        offset: y,
        depth: p3,
        inverse,
        tilt: [g1, g2],
        place: [x0, y0],
    } = sight(s, view, beam, group);
    // How well it is known where the tangent plane is met.
    let one = s.splat(1.0);
    let (size1, size2) = (s.abs(g1), s.abs(g2));
    let distance = s.max(s.abs(y[0]), s.abs(y[1]));
    let blur = s.fma(s.splat(view.direction_size), s.abs(inverse), one);
    let depth = s.fma(distance, s.splat(view.sizes[2]), one);
    let width = s.fma(distance, s.splat(view.sizes[0] + view.sizes[1]), one);
    let tilt = s.add(one, s.max(size1, size2));
    let rounding = s.fma(s.mul(tilt, depth), blur, width);
    let dropped = s.mul(s.splat(view.dropped), tilt);
    let mut error = s.fma(s.splat(ROUNDING), rounding, dropped);
    if RATIONAL {
        error = s.fma(dropped, s.max(s.abs(x0), s.abs(y0)), error);
    }
    // What is not linear moves roots along the cell, and along the tilt by what stands across.
    let [b1, b2, b3] = view.bulge;
    let (b1, b2, b3) = (s.splat(b1), s.splat(b2), s.splat(b3));
    let (mut flat1, mut flat2) = (s.add(b1, error), s.add(b2, error));
    if RATIONAL {
        let weight = s.splat(view.weight_stray);
        flat1 = s.fma(s.abs(x0), weight, flat1);
        flat2 = s.fma(s.abs(y0), weight, flat2);
    }
    let (radius1, radius2) = (s.fma(size1, b3, flat1), s.fma(size2, b3, flat2));
    // In the plane of the ray and the normal nothing stands across.
    let plane = s.abs(s.fnma(y0, g1, s.mul(x0, g2)));
    let reach = s.fma(size2, s.add(one, flat1), s.mul(size1, s.add(one, flat2)));
    // Where the cell is met along the beam, at the least and at the most.
    let room = if RATIONAL && view.weight_stray < 1.0 {
        (1.0 - view.weight_stray).recip()
    } else if RATIONAL {
        f32::INFINITY
    } else {
        1.0
    };
    let height = view.bulge[2] * room;
    let time = s.fnma(p3, inverse, s.splat(view.zeta));
    let spread = s.fma(
        s.fma(depth, s.splat(2.0 * ROUNDING), s.splat(height * 1.001)),
        s.mul(s.abs(inverse), blur_of(s, blur)),
        s.splat(4.0 * ROUNDING),
    );
    // What is not a number passes.
    let beside = s.bits(s.lt(s.add(one, radius1), s.abs(x0)))
        | s.bits(s.lt(s.add(one, radius2), s.abs(y0)))
        | s.bits(s.lt(reach, plane))
        | s.bits(s.lt(load(s, &beam.far, group), s.sub(time, spread)))
        | s.bits(s.lt(s.add(time, spread), load(s, &beam.near, group)));
    Approach {
        beside,
        place: [x0, y0],
        tilt: [g1, g2],
        radius: [radius1, radius2],
        error,
    }
}

/// The distances of a cell's point from a ray along both its axes, and their derivatives.
struct Distance<F> {
    value: [F; 2],
    by_x: [F; 2],
    by_y: [F; 2],
}

#[inline(always)]
fn distance<S: Simd, const M: usize, const N: usize, const RATIONAL: bool>(
    s: S,
    model: &Model,
    [x0, y0]: [S::F; 2],
    [g1, g2]: [S::F; 2],
    [x, y]: [S::F; 2],
) -> Distance<S::F> {
    let a = jet::<S, M, N>(s, model, 0, x, y);
    let b = jet::<S, M, N>(s, model, 1, x, y);
    let c = jet::<S, M, N>(s, model, 2, x, y);
    let mut value = [s.fnma(g1, c.value, a.value), s.fnma(g2, c.value, b.value)];
    let mut by_x = [s.fnma(g1, c.by_x, a.by_x), s.fnma(g2, c.by_x, b.by_x)];
    let mut by_y = [s.fnma(g1, c.by_y, a.by_y), s.fnma(g2, c.by_y, b.by_y)];
    if RATIONAL {
        let w = jet::<S, M, N>(s, model, 3, x, y);
        value = [s.fnma(x0, w.value, value[0]), s.fnma(y0, w.value, value[1])];
        by_x = [s.fnma(x0, w.by_x, by_x[0]), s.fnma(y0, w.by_x, by_x[1])];
        by_y = [s.fnma(x0, w.by_y, by_y[0]), s.fnma(y0, w.by_y, by_y[1])];
    } else {
        value = [s.sub(value[0], x0), s.sub(value[1], y0)];
    }
    Distance { value, by_x, by_y }
}

/// As [`distance`], without derivatives.
#[inline(always)]
fn value<S: Simd, const M: usize, const N: usize, const RATIONAL: bool>(
    s: S,
    model: &Model,
    [x0, y0]: [S::F; 2],
    [g1, g2]: [S::F; 2],
    [x, y]: [S::F; 2],
) -> [S::F; 2] {
    let c = at::<S, M, N>(s, model, 2, x, y);
    let f1 = s.fnma(g1, c, at::<S, M, N>(s, model, 0, x, y));
    let f2 = s.fnma(g2, c, at::<S, M, N>(s, model, 1, x, y));
    if RATIONAL {
        let w = at::<S, M, N>(s, model, 3, x, y);
        [s.fnma(x0, w, f1), s.fnma(y0, w, f2)]
    } else {
        [s.sub(f1, x0), s.sub(f2, y0)]
    }
}

/// A 2 x 2 matrix for each ray, row by row.
struct Matrix<F>([F; 4]);

impl<F: Copy> Matrix<F> {
    /// The inverse of the derivatives.
    #[inline(always)]
    fn inverse<S: Simd<F = F>>(s: S, Distance { by_x, by_y, .. }: &Distance<F>) -> Self {
        let determinant = s.fnma(by_y[0], by_x[1], s.mul(by_x[0], by_y[1]));
        let scale = s.div(s.splat(1.0), determinant);
        let minus = s.sub(s.splat(0.0), scale);
        Self([
            s.mul(by_y[1], scale),
            s.mul(by_y[0], minus),
            s.mul(by_x[1], minus),
            s.mul(by_x[0], scale),
        ])
    }

    #[inline(always)]
    fn times<S: Simd<F = F>>(&self, s: S, [x, y]: [F; 2]) -> [F; 2] {
        let [a, b, c, d] = self.0;
        [s.fma(a, x, s.mul(b, y)), s.fma(c, x, s.mul(d, y))]
    }

    /// The sizes of the entries.
    #[inline(always)]
    fn abs<S: Simd<F = F>>(&self, s: S) -> Self {
        let [a, b, c, d] = self.0;
        Self([s.abs(a), s.abs(b), s.abs(c), s.abs(d)])
    }
}

/// By how much the derivatives by x and by y of coordinate `r` change at most, `half` of a
/// window away from its middle.
#[inline(always)]
fn change<S: Simd>(s: S, model: &Model, r: usize, half: [S::F; 2]) -> [S::F; 2] {
    let [xx, xy, yy] = &model.second;
    let (xx, xy, yy) = (s.splat(xx[r]), s.splat(xy[r]), s.splat(yy[r]));
    [
        s.fma(xx, half[0], s.mul(xy, half[1])),
        s.fma(xy, half[0], s.mul(yy, half[1])),
    ]
}

/// Whether there is one root at most in a window, a bit for each ray, and by how much a step
/// with the inverse derivatives in its middle may miss it, in lengths of the step.
///
/// From the middle the derivatives change by `E - g c`, with `c` the change of those of what
/// stands across the cell and `g` the tilt: only a product of two vectors grows with the tilt.
/// Multiplied by the inverse in the middle, with rows of `E` below `k`, one plus the change can
/// be inverted where `|g c| + k / (1 - k) |g| |c| < 1`, for all of the window at once.
#[inline(always)]
fn contraction<S: Simd, const RATIONAL: bool>(
    s: S,
    model: &Model,
    place: [S::F; 2],
    tilt: [S::F; 2],
    half: [S::F; 2],
    inverse: &Matrix<S::F>,
) -> (u32, S::F) {
    let one = s.splat(1.0);
    let [ax, ay] = change(s, model, 0, half);
    let [bx, by] = change(s, model, 1, half);
    let [cx, cy] = change(s, model, 2, half);
    let mut rows = [s.add(ax, ay), s.add(bx, by)];
    if RATIONAL {
        let [wx, wy] = change(s, model, 3, half);
        let weight = s.add(wx, wy);
        rows = [
            s.fma(s.abs(place[0]), weight, rows[0]),
            s.fma(s.abs(place[1]), weight, rows[1]),
        ];
    }
    let [k1, k2] = inverse.abs(s).times(s, rows);
    let along = s.max(k1, k2);
    let [g1, g2] = inverse.times(s, tilt);
    let (g1, g2) = (s.abs(g1), s.abs(g2));
    let across = s.mul(s.max(g1, g2), s.add(cx, cy));
    let growth = s.div(one, s.sub(one, along));
    let share = s.mul(along, growth);
    let product = s.fma(g1, cx, s.fma(g2, cy, s.mul(across, share)));
    let sure = s.splat(SURE);
    let unique = s.bits(s.lt(along, sure)) & s.bits(s.lt(product, sure));
    let rest = s.div(s.mul(growth, growth), s.sub(one, product));
    (unique, s.fma(across, rest, share))
}

/// Tests rays `16 group ..` of the beam whose bits are set in `lanes` against a cell.
#[inline(always)]
pub(super) fn meet<S: Simd, const M: usize, const N: usize, const RATIONAL: bool>(
    s: S,
    model: &Model,
    view: &View,
    beam: &Beam,
    group: usize,
    lanes: u32,
) -> Verdict {
    let Approach {
        beside,
        place,
        tilt,
        radius,
        error,
    } = approach::<S, RATIONAL>(s, view, beam, group);
    let lanes = lanes & !beside;
    let mut verdict = Verdict {
        met: 0,
        x: [0.0; LANES],
        y: [0.0; LANES],
        open: 0,
        blurred: 0,
    };
    if lanes == 0 {
        return verdict;
    }
    // The window in which roots are.
    let border = s.splat(1.0 + MARGIN);
    let minus = s.sub(s.splat(0.0), border);
    let ([mut low, mut high], [mut middle, mut half]) = ([place; 2], [place; 2]);
    for k in 0..2 {
        low[k] = s.max(s.sub(place[k], radius[k]), minus);
        high[k] = s.min(s.add(place[k], radius[k]), border);
        middle[k] = s.mul(s.splat(0.5), s.add(low[k], high[k]));
        half[k] = s.mul(s.splat(0.5), s.sub(high[k], low[k]));
    }
    let first = distance::<S, M, N, RATIONAL>(s, model, place, tilt, middle);
    let inverse = Matrix::inverse(s, &first);
    let (unique, contraction) = contraction::<S, RATIONAL>(s, model, place, tilt, half, &inverse);
    let [a, b, c, d] = inverse.abs(s).0;
    let growth = s.mul(
        s.max(s.add(a, b), s.add(c, d)),
        s.add(s.splat(1.0), contraction),
    );
    let error = s.mul(error, growth);
    let known = s.bits(s.lt(error, s.splat(BLURRED)));
    let mut active = lanes & unique & known;
    verdict.open = lanes & !active;
    let mut x = middle;
    let mut now = first;
    for step in 0..STEPS {
        if active == 0 {
            break;
        }
        // A root is as far from where the step of the middle leads as that one may miss it.
        let sure = inverse.times(s, now.value);
        let length = s.max(s.abs(sure[0]), s.abs(sure[1]));
        let miss = s.fma(contraction, length, error);
        for k in 0..2 {
            let way = s.abs(s.sub(s.sub(x[k], sure[k]), middle[k]));
            active &= !s.bits(s.lt(s.add(half[k], miss), way));
        }
        if active == 0 {
            break;
        }
        let newest = Matrix::inverse(s, &now);
        let leap = if step == 0 {
            sure
        } else {
            newest.times(s, now.value)
        };
        for k in 0..2 {
            x[k] = s.max(s.min(s.sub(x[k], leap[k]), high[k]), low[k]);
        }
        let close = s.le(s.max(s.abs(leap[0]), s.abs(leap[1])), s.splat(CLOSE));
        let arrived = active & s.bits(close);
        if arrived != 0 {
            let rest = newest.times(s, value::<S, M, N, RATIONAL>(s, model, place, tilt, x));
            let last = [s.sub(x[0], rest[0]), s.sub(x[1], rest[1])];
            let limit = s.add(border, error);
            let inside = s.bits(s.le(s.max(s.abs(last[0]), s.abs(last[1])), limit));
            let near = s.le(s.max(s.abs(rest[0]), s.abs(rest[1])), s.splat(CLOSE));
            let new = arrived & inside & s.bits(near);
            let (mut xs, mut ys) = ([0.0; LANES], [0.0; LANES]);
            s.store(last[0], &mut xs);
            s.store(last[1], &mut ys);
            for lane in Bits(u64::from(new)) {
                verdict.x[lane] = xs[lane];
                verdict.y[lane] = ys[lane];
            }
            verdict.met |= new;
            active &= !new;
        }
        now = distance::<S, M, N, RATIONAL>(s, model, place, tilt, x);
    }
    verdict.open |= active;
    verdict
}

/// A growth for times from the blur of directions, at most a half more.
#[inline(always)]
fn blur_of<S: Simd>(s: S, blur: S::F) -> S::F {
    s.fma(blur, s.splat(ROUNDING), s.splat(1.0))
}

/// The numbers of the bits that are set.
pub(super) struct Bits(pub(super) u64);

impl Iterator for Bits {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let lane = self.0.trailing_zeros() as usize;
        self.0 &= self.0 - 1;
        Some(lane)
    }
}
