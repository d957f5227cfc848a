//! The leaf solver for sixteen rays and one cell: exclusion, the test for uniqueness and
//! Newton's iteration, in single precision.

use super::approach::Approach;
use super::distance::{Cells, Distance, Matrix, distance, value};
use super::fold::{Fold, Folded};
use super::windows::{Batch, Waiting};
use crate::simd::{LANES, Part, PerLane, Singles};

/// Uniqueness is proven below one; less bounds the number of steps.
const SURE: f32 = 0.9;

/// Larger errors than this part of a cell are not for single precision: what it finds is nearer
/// to a root than twice as much.
pub(super) const BLURRED: f32 = 0.1;

/// A flat cell is seen too badly from its edge beyond this.
const SHARP: f32 = 0.01;

/// After a step of Newton's shorter than this one more without new derivatives is the last.
const CLOSE: f32 = 1e-2;

/// Cells are entered this much beyond their borders, so that what single precision leaves
/// open at a border is found from both sides.
const MARGIN: f32 = 1e-4;

/// A window is halved unless less than this share of it is left.
const NARROWER: f32 = 0.4;

/// Growth of what is summed in single precision.
const GROWTH: f32 = 1.0 + 1e-5;

/// Steps in single precision.
const STEPS: usize = 5;

/// How sixteen rays come to a cell.
#[derive(Clone, Copy)]
pub(super) struct Seen<F> {
    /// Where the tangent plane is met, in the cell's coordinates, and the tilt against it.
    pub(super) place: [F; 2],
    pub(super) tilt: [F; 2],
    /// What is uncertain of the place: in any direction, and in that of the tilt, of which this
    /// is a part.
    pub(super) error: [F; 2],
}

/// What sixteen rays found in a cell or in parts of it, a bit for each.
pub(super) struct Verdict {
    /// They met it here, in its coordinates from -1 to 1.
    pub(super) met: u32,
    pub(super) x: [f32; LANES],
    pub(super) y: [f32; LANES],
    /// It is not clear for these how many roots they have.
    pub(super) open: u32,
    /// Single precision says too little for these, and would say less of its parts.
    pub(super) blurred: u32,
    /// Where those of both may be.
    pub(super) rest: Rest,
    /// A bit for each that is open and of which only parts are left, and these.
    pub(super) is_folded: u32,
    pub(super) folded: Folded,
}

/// Parts of a cell in which roots may be.
pub(super) struct Rest {
    pub(super) low: [[f32; LANES]; 2],
    pub(super) high: [[f32; LANES]; 2],
    /// A bit for each that is to be halved, and for each of them that is halved along y.
    pub(super) halve: u32,
    pub(super) along_y: u32,
}

impl Verdict {
    /// What is known before anything is looked at.
    pub(super) const NONE: Self = Self {
        met: 0,
        x: [0.0; LANES],
        y: [0.0; LANES],
        open: 0,
        blurred: 0,
        rest: Rest {
            low: [[0.0; LANES]; 2],
            high: [[0.0; LANES]; 2],
            halve: 0,
            along_y: 0,
        },
        is_folded: 0,
        folded: Folded::NONE,
    };

    /// Takes the roots of some rays.
    #[inline(always)]
    fn take<S: Singles>(&mut self, s: S, new: u32, [x, y]: [S::F; 2]) {
        if self.met == 0 {
            s.store(x, &mut self.x);
            s.store(y, &mut self.y);
            self.met = new;
            return;
        }
        let (mut xs, mut ys) = ([0.0; LANES], [0.0; LANES]);
        s.store(x, &mut xs);
        s.store(y, &mut ys);
        for lane in Bits(u64::from(new)) {
            self.x[lane] = xs[lane];
            self.y[lane] = ys[lane];
        }
        self.met |= new;
    }
}

/// The bounds on the second derivatives of coordinate `r`.
#[inline(always)]
fn second<S: Singles, C: PerLane<S, Lanes = S::F>>(s: S, cells: &Cells<C>, r: usize) -> [S::F; 3] {
    let [xx, xy, yy] = &cells.second;
    [xx[r].lanes(s), xy[r].lanes(s), yy[r].lanes(s)]
}

/// By how much the derivatives by x and by y of coordinate `r` change at most, `half` of a
/// window away from its middle.
#[inline(always)]
fn change<S: Singles, C: PerLane<S, Lanes = S::F>>(
    s: S,
    cells: &Cells<C>,
    r: usize,
    half: [S::F; 2],
) -> [S::F; 2] {
    let [xx, xy, yy] = second(s, cells, r);
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
/// be inverted where `|g c| + k / (1 - k) |g| |c| < 1`, for all of the window at once. What is
/// `blurred` of the derivatives by rounding belongs to `k`.
#[inline(always)]
fn contraction<S: Singles, C: PerLane<S, Lanes = S::F>, const RATIONAL: bool>(
    s: S,
    cells: &Cells<C>,
    place: [S::F; 2],
    tilt: [S::F; 2],
    half: [S::F; 2],
    (inverse, blurred): (&Matrix<S::F>, S::F),
) -> (u32, S::F) {
    let one = s.splat(1.0);
    let [ax, ay] = change(s, cells, 0, half);
    let [bx, by] = change(s, cells, 1, half);
    let [cx, cy] = change(s, cells, 2, half);
    let mut rows = [s.add(ax, ay), s.add(bx, by)];
    if RATIONAL {
        let [wx, wy] = change(s, cells, 3, half);
        let weight = s.add(wx, wy);
        rows = [
            s.fma(s.abs(place[0]), weight, rows[0]),
            s.fma(s.abs(place[1]), weight, rows[1]),
        ];
    }
    let [k1, k2] = inverse.abs(s).times(s, rows);
    let along = s.add(s.max(k1, k2), blurred);
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

/// The part of a cell in which the roots of a ray are, and how far it reaches from where it is looked at.
#[derive(Clone, Copy)]
pub(super) struct Window<F> {
    pub(super) low: [F; 2],
    pub(super) high: [F; 2],
    pub(super) middle: [F; 2],
    pub(super) half: [F; 2],
}

impl<F: Copy> Window<F> {
    #[inline(always)]
    pub(super) fn new<S: Singles<F = F>>(s: S, low: [F; 2], high: [F; 2]) -> Self {
        let (mut middle, mut half) = (low, high);
        for k in 0..2 {
            middle[k] = s.mul(s.splat(0.5), s.add(low[k], high[k]));
            half[k] = s.mul(s.splat(0.5), s.sub(high[k], low[k]));
        }
        Self {
            low,
            high,
            middle,
            half,
        }
    }

    /// What is within `radius` of a place in the cell.
    #[inline(always)]
    fn around<S: Singles<F = F>>(s: S, place: [F; 2], radius: [F; 2], border: F) -> Self {
        let minus = s.sub(s.splat(0.0), border);
        let (mut low, mut high) = (place, place);
        for k in 0..2 {
            low[k] = s.max(s.sub(place[k], radius[k]), minus);
            high[k] = s.min(s.add(place[k], radius[k]), border);
        }
        Self::new(s, low, high)
    }
}

/// The middle of a window: how far the surface is there from a ray, and what inverts the
/// derivatives.
struct Middle<F> {
    distance: Distance<F>,
    inverse: Matrix<F>,
}

/// What the values differ at most from those of the tangent plane in the middle of a window, by
/// how much the derivatives change: half of that on the average.
#[inline(always)]
fn over<S: Singles>(s: S, change: [S::F; 2], half: [S::F; 2]) -> S::F {
    let sum = s.fma(change[0], half[0], s.mul(change[1], half[1]));
    s.mul(sum, s.splat(0.5 * GROWTH))
}

/// As [`over`], for the distances from rays along both axes, but for what stands across the cell, and for that.
#[inline(always)]
pub(super) fn over_all<S: Singles, C: PerLane<S, Lanes = S::F>, const RATIONAL: bool>(
    s: S,
    cells: &Cells<C>,
    place: [S::F; 2],
    half: [S::F; 2],
) -> [S::F; 3] {
    let mut a = over(s, change(s, cells, 0, half), half);
    let mut b = over(s, change(s, cells, 1, half), half);
    let c = over(s, change(s, cells, 2, half), half);
    if RATIONAL {
        let w = over(s, change(s, cells, 3, half), half);
        a = s.fma(s.abs(place[0]), w, a);
        b = s.fma(s.abs(place[1]), w, b);
    }
    [a, b, c]
}

/// What is left of windows after a step of Krawczyk's: roots differ from where Newton's step
/// from the middle leads by what the derivatives can change in between. The middle stays where it
/// is. The bits are those of the windows in which roots may be.
#[inline(always)]
fn narrowed<S: Singles, C: PerLane<S, Lanes = S::F>, const RATIONAL: bool>(
    s: S,
    cells: &Cells<C>,
    seen: &Seen<S::F>,
    window: &Window<S::F>,
    middle: &Middle<S::F>,
    rest: &mut Rest,
) -> (Window<S::F>, u32) {
    let half = window.half;
    let [a, b, c] = over_all::<S, C, RATIONAL>(s, cells, seen.place, half);
    let steps = middle.inverse.times(s, middle.distance.value);
    let [g1, g2] = middle.inverse.times(s, seen.tilt);
    let tilts = [s.abs(g1), s.abs(g2)];
    let Matrix([p1, q1, p2, q2]) = middle.inverse.abs(s);
    // The step and what it inverts are rounded, too.
    let [any, along] = seen.error;
    let any = s.fma(any, s.add(half[0], half[1]), any);
    let (mut left, mut sizes, mut narrow) = (u32::MAX, [half[0]; 2], *window);
    for (k, [p, q]) in [[p1, q1], [p2, q2]].into_iter().enumerate() {
        let known = s.fma(p, s.add(a, any), s.mul(q, s.add(b, any)));
        let radius = s.fma(tilts[k], s.add(c, along), known);
        let middle = window.middle[k];
        let center = s.sub(middle, steps[k]);
        // What is not a number leaves the window as it is.
        let low = s.max(s.sub(center, radius), window.low[k]);
        let high = s.min(s.add(center, radius), window.high[k]);
        left &= !s.bits(s.lt(high, low));
        s.store(low, &mut rest.low[k]);
        s.store(high, &mut rest.high[k]);
        sizes[k] = s.sub(high, low);
        (narrow.low[k], narrow.high[k]) = (low, high);
        narrow.half[k] = s.max(s.sub(high, middle), s.sub(middle, low));
    }
    let area = s.mul(sizes[0], sizes[1]);
    let before = s.mul(half[0], half[1]);
    rest.halve = !s.bits(s.lt(area, s.mul(before, s.splat(4.0 * NARROWER))));
    // The axis along which the derivatives change more.
    let [xx, xy, yy] = second(s, cells, 2);
    let along_x = s.mul(sizes[0], s.fma(tilts[0], xx, s.mul(tilts[1], xy)));
    let along_y = s.mul(sizes[1], s.fma(tilts[0], xy, s.mul(tilts[1], yy)));
    rest.along_y = s.bits(s.lt(along_x, along_y));
    (narrow, left)
}

/// Tests rays `16 group ..` whose bits are set in `lanes`, and which do not pass by, against
/// their cells.
#[inline(always)]
pub(super) fn meet<S: Singles, C: PerLane<S, Lanes = S::F>, const RATIONAL: bool>(
    s: S,
    cells: &Cells<C>,
    approach: &Approach<S::F>,
    (group, lanes): (usize, u32),
    waiting: &mut Waiting,
    verdict: &mut Verdict,
) {
    let &Approach {
        place,
        tilt,
        radius,
        error,
        ..
    } = approach;
    let seen = Seen { place, tilt, error };
    let window = Window::around(s, place, radius, s.splat(1.0 + MARGIN));
    s.apart(Look::<S, C, RATIONAL> {
        cells,
        seen: &seen,
        window: &window,
        lanes,
        verdict,
    });
    if verdict.open != 0 {
        waiting.begin(s, group, &seen, verdict);
    }
}

/// Looks into parts of cells.
#[inline(always)]
pub(super) fn again<S: Singles, C: PerLane<S, Lanes = S::F>, const RATIONAL: bool>(
    s: S,
    cells: &Cells<C>,
    batch: &Batch,
    verdict: &mut Verdict,
) {
    let (low, high) = batch.range(s);
    let window = Window::new(s, low, high);
    let lanes = (1 << batch.count) - 1;
    s.apart(Look::<S, C, RATIONAL> {
        cells,
        seen: &batch.seen(s),
        window: &window,
        lanes,
        verdict,
    });
}

/// Looks for roots in windows, one of each ray whose bit is set.
struct Look<'a, S: Singles, C, const RATIONAL: bool> {
    cells: &'a Cells<C>,
    seen: &'a Seen<S::F>,
    window: &'a Window<S::F>,
    lanes: u32,
    /// Is replaced; places count where a bit says so.
    verdict: &'a mut Verdict,
}

impl<S: Singles, C: PerLane<S, Lanes = S::F>, const RATIONAL: bool> Part<S>
    for Look<'_, S, C, RATIONAL>
{
    type Output = ();

    #[inline(always)]
    fn run(self, s: S) {
        let Self {
            cells,
            seen,
            window,
            mut lanes,
            verdict,
        } = self;
        let &Seen { place, tilt, error } = seen;
        verdict.met = 0;
        let distance = distance::<S, C, RATIONAL>(s, cells, place, tilt, window.middle);
        let inverse = Matrix::inverse(s, &distance);
        // Errors along the tilt grow no more than it shrinks.
        let [any, along] = error;
        let [a, b, c, d] = inverse.abs(s).0;
        let [g1, g2] = inverse.times(s, tilt);
        let tilted = s.mul(along, s.max(s.abs(g1), s.abs(g2)));
        let grown = s.fma(any, s.max(s.add(a, b), s.add(c, d)), tilted);
        let middle = Middle { distance, inverse };
        let test = |window: &Window<S::F>| {
            let middle = (&middle.inverse, grown);
            contraction::<S, C, RATIONAL>(s, cells, place, tilt, window.half, middle)
        };
        let (mut unique, mut contraction) = test(window);
        let mut narrow = None;
        if lanes & !unique != 0 {
            // Only what is left of the windows counts.
            let (window, left) =
                narrowed::<S, C, RATIONAL>(s, cells, seen, window, &middle, &mut verdict.rest);
            lanes &= left;
            (unique, contraction) = test(&window);
            narrow = Some(window);
        }
        let amplified = s.mul(grown, s.add(s.splat(1.0), contraction));
        let known = s.bits(s.lt(amplified, s.splat(BLURRED)));
        // Of a flat cell seen from its edge the parts are seen no better.
        let total = s.fma(along, s.max(s.abs(tilt[0]), s.abs(tilt[1])), any);
        let sharp = s.bits(s.lt(total, s.splat(SHARP)));
        verdict.blurred = lanes & (unique & !known | cells.flat & !sharp);
        let active = lanes & unique & known;
        verdict.open = lanes & !active & !verdict.blurred;
        verdict.is_folded = 0;
        if let Some(window) = &narrow
            && verdict.open != 0
        {
            let worth = s.apart(Fold::<S, C, RATIONAL> {
                cells,
                seen,
                window,
                distance: &middle.distance,
                folded: &mut verdict.folded,
            });
            verdict.is_folded = verdict.open & worth;
        }
        if active != 0 {
            verdict.open |= iterate::<S, C, RATIONAL>(
                s,
                (cells, seen),
                (narrow.as_ref().unwrap_or(window), &middle),
                (contraction, amplified),
                active,
                verdict,
            );
        }
        if narrow.is_none() && verdict.open | verdict.blurred != 0 {
            let (_, left) =
                narrowed::<S, C, RATIONAL>(s, cells, seen, window, &middle, &mut verdict.rest);
            verdict.open &= left;
            verdict.blurred &= left;
        }
    }
}

/// Newton's iteration for the rays `active`, which have one root each at most; those that did
/// not come to an end come back.
#[inline(always)]
fn iterate<S: Singles, C: PerLane<S, Lanes = S::F>, const RATIONAL: bool>(
    s: S,
    (cells, &Seen { place, tilt, .. }): (&Cells<C>, &Seen<S::F>),
    (
        window,
        Middle {
            distance: first,
            inverse,
        },
    ): (&Window<S::F>, &Middle<S::F>),
    (contraction, amplified): (S::F, S::F),
    mut active: u32,
    verdict: &mut Verdict,
) -> u32 {
    let border = s.splat(1.0 + MARGIN);
    let Window {
        low,
        high,
        middle,
        half,
    } = window;
    let mut x = *middle;
    let mut now = *first;
    let mut open = 0;
    for step in 0..STEPS {
        // A root is as far from where the step of the middle leads as that one may miss it.
        let sure = inverse.times(s, now.value);
        let length = s.max(s.abs(sure[0]), s.abs(sure[1]));
        let miss = s.fma(contraction, length, amplified);
        for k in 0..2 {
            let way = s.abs(s.sub(s.sub(x[k], sure[k]), middle[k]));
            active &= !s.bits(s.lt(s.add(half[k], miss), way));
        }
        if active == 0 {
            break;
        }
        let (newest, leap) = if step == 0 {
            (*inverse, sure)
        } else {
            let newest = Matrix::inverse(s, &now);
            (newest, newest.times(s, now.value))
        };
        let (mut outside, mut moved) = (0, s.splat(0.0));
        for k in 0..2 {
            let next = s.sub(x[k], leap[k]);
            let kept = s.max(s.min(next, high[k]), low[k]);
            outside |= s.bits(s.lt(s.splat(CLOSE), s.abs(s.sub(next, kept))));
            moved = s.max(s.abs(s.sub(kept, x[k])), moved);
            x[k] = kept;
        }
        // At a border there is no way on.
        let stuck = active & outside & s.bits(s.lt(moved, s.splat(CLOSE)));
        active &= !stuck;
        open |= stuck;
        let close = s.le(s.max(s.abs(leap[0]), s.abs(leap[1])), s.splat(CLOSE));
        let arrived = active & s.bits(close);
        if arrived != 0 {
            let rest = newest.times(s, value::<S, C, RATIONAL>(s, cells, place, tilt, x));
            let last = [s.sub(x[0], rest[0]), s.sub(x[1], rest[1])];
            let limit = s.add(border, amplified);
            let inside = s.bits(s.le(s.max(s.abs(last[0]), s.abs(last[1])), limit));
            let near = s.le(s.max(s.abs(rest[0]), s.abs(rest[1])), s.splat(CLOSE));
            let new = arrived & inside & s.bits(near);
            verdict.take(s, new, last);
            active &= !new;
        }
        if active == 0 {
            break;
        }
        now = distance::<S, C, RATIONAL>(s, cells, place, tilt, x);
    }
    open | active
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
