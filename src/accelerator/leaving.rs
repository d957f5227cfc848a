//! Rays that start on a surface and leave it: whether they come back to the cell in which they start.
//!
//! Let `N` be the normal at the start `P`, as a row over the frame of the cell whose third number is one, towards
//! the side to which the ray leaves. With the weights `w` and `X = w S`, `g = N . (X - w P)` is a polynomial that is
//! zero at `P`, and so are its derivatives. If its second ones have no eigenvalue above `l >= 0` in the cell, no point
//! of this that is `r` away in its parameters, along the axis along which it is farther, stands higher above the
//! tangent plane than `l r^2 / w`. Along the frame it is `(1 - k) r` away at least, where `k` is by how much the
//! derivatives stray from the frame. A ray that rises by `m` on a way of `d` along the frame is higher everywhere if
//! `m >= 2 l d R / (w (1 - k))`, with the greatest `r` there is as `R`, and as the ray starts no farther from `P` than
//! a half of its way; what is nearer is where rays leave a surface, which is one point to them.
//!
//! A face that bends away everywhere, as most of a body does, has `l = 0`: rays leave it at any angle. All of that
//! holds for a cell beside the one with `P`, too, as long as both are of one piece.

use glam::DVec2;
use kernel::Ray;

use super::beam::RAYS;
use super::cells::Piece;
use super::distance::{Cells, jet};
use super::expansion::{COUNTS, ORDER, TERMS, WIDE};
use super::leaf::Bits;
use super::model::Model;
use super::windows::group_of;
use crate::intersect::Hit;
use crate::simd::{LANES, Part, PerLane, Singles};

/// Errors of second derivatives by rounding to single precision, several wide.
const ROUNDING: f32 = 1e-5;

/// Derivatives that stray by more than this from the frame are too uneven.
const STRAY: f64 = 0.9;

/// How far from the middle of a cell a start may be, where it is in another one of its piece.
pub(super) const BESIDE: f64 = 1.5;

/// Where a ray starts that leaves a hit, as one to a light does.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// Instance and item.
    place: (u32, u32),
    uv: DVec2,
    /// Whether it leaves to the side to which `du x dv` points.
    is_above: bool,
}

impl Start {
    /// No place in particular.
    const NOWHERE: Self = Self {
        place: (u32::MAX, u32::MAX),
        uv: DVec2::ZERO,
        is_above: false,
    };

    /// The place of a hit, for a ray that starts off it on the side to which it goes, no farther than points that
    /// are one to whoever asks: surfaces that rise no higher there are not met.
    ///
    /// Nothing is known of where rays start that go through the surface first, at gaps that were filled, and where
    /// there is no normal.
    pub fn of(hit: &Hit, ray: &Ray) -> Self {
        let rise = hit.normal.dot(ray.direction);
        let is_off = hit.normal.dot(ray.origin - hit.point) * rise > 0.0;
        if hit.filled || !is_off {
            return Self::NOWHERE;
        }
        Self {
            place: hit.place,
            uv: hit.uv,
            is_above: rise > 0.0,
        }
    }
}

/// Starts of rays in or beside the cells that they come to, in the coordinates of these.
#[derive(Debug)]
pub(super) struct Starts {
    /// A bit for each that there is.
    own: u64,
    at: [[f32; RAYS]; 2],
    /// 1 for each that is left to the side of the third row, -1 to the other.
    side: [f32; RAYS],
}

impl Starts {
    pub(super) const NONE: Self = Self {
        own: 0,
        at: [[0.0; RAYS]; 2],
        side: [1.0; RAYS],
    };

    /// Forgets them all.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.own = 0;
    }

    /// Puts a start into slot `k` if it is at this cell of a piece of an instance, which may be mirrored.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounding is allowed for")]
    pub(super) fn put(
        &mut self,
        (k, start): (usize, &Start),
        (instance, is_mirrored): (u32, bool),
        piece: &Piece,
        model: &Model,
    ) {
        if start.place != (instance, piece.item) {
            return;
        }
        let mut at = [0.0; 2];
        for (axis, (first, length)) in [piece.u, piece.v].into_iter().enumerate() {
            let own = (start.uv[axis] - first) / length;
            let x = (own - model.middle[axis]) / model.half[axis];
            // On its border a piece may have another normal than the one that it meets there.
            let is_near = own > 0.0 && own < 1.0 && x.abs() <= BESIDE;
            if !is_near {
                return;
            }
            at[axis] = x as f32;
        }
        self.own |= 1 << k;
        (self.at[0][k], self.at[1][k]) = (at[0], at[1]);
        self.side[k] = if start.is_above == is_mirrored {
            -1.0
        } else {
            1.0
        };
    }

    /// Of rays that come to one cell, by their slots, those that start at it.
    #[inline(always)]
    pub(super) fn fill(
        &mut self,
        starts: &[Start],
        (lanes, lane_of): (u64, &[u8; RAYS]),
        instance: (u32, bool),
        (piece, model): (&Piece, &Model),
    ) {
        self.clear();
        if starts.is_empty() {
            return;
        }
        for k in Bits(lanes) {
            if let Some(start) = starts.get(usize::from(lane_of[k])) {
                self.put((k, start), instance, piece, model);
            }
        }
    }

    /// Which rays of a group start at their cells and do not meet them again, from how they are tilted.
    #[inline(always)]
    pub(super) fn leaving<S: Singles, C: PerLane<S, Lanes = S::F>, const RATIONAL: bool>(
        &self,
        s: S,
        cells: &Cells<C>,
        (group, lanes): (usize, u32),
        tilt: [S::F; 2],
    ) -> u32 {
        let own = lanes & group_of(self.own, group);
        if own == 0 {
            return 0;
        }
        own & s.apart(Leaving::<S, C, RATIONAL> {
            cells,
            starts: self,
            group,
            tilt,
        })
    }
}

/// How steep a ray must be to leave a cell for good if it starts in it, and if it starts beside it: factors of the
/// greatest second derivative, infinite where nothing is known, from by how much derivatives stray; and what `higher`
/// terms, which are not kept, can add to that, with second derivatives up to `greatest`.
pub(super) fn reach(
    [stray, beside]: [[f64; 4]; 2],
    (higher, greatest): (f64, f64),
) -> ([f64; 2], f64) {
    let (inside, even) = reach_within(stray, WIDE);
    // Terms that are not kept are bounded no farther out.
    let (beside, _) = if higher > 0.0 || inside.is_infinite() {
        (f64::INFINITY, 0.0)
    } else {
        reach_within(beside, BESIDE)
    };
    // They count themselves, and turn the normal.
    let added = 2.0 * higher * (1.0 + 4.0 * greatest / (even * even));
    ([inside, beside], added)
}

/// As [`reach`], for starts no farther from the middle than `extent`, up to which the derivatives stray so much; and
/// how much of them does not stray.
fn reach_within([along, across, _, weight]: [f64; 4], extent: f64) -> (f64, f64) {
    let (along, weight) = (along.max(across), extent * weight);
    let least = 1.0 - weight;
    // A point may be so far from the middle.
    let place = extent * (1.0 + along) / least;
    let even = 1.0 - (along + weight * (1.0 + place)) / least;
    let is_even = least > 0.0 && even > 1.0 - STRAY;
    if is_even {
        (2.0 * (1.0 + extent) / (least * even), even)
    } else {
        (f64::INFINITY, 1.0)
    }
}

/// Which of the rays of a group leave their cells for good.
struct Leaving<'a, S: Singles, C, const RATIONAL: bool> {
    cells: &'a Cells<C>,
    starts: &'a Starts,
    group: usize,
    tilt: [S::F; 2],
}

impl<S: Singles, C: PerLane<S, Lanes = S::F>, const RATIONAL: bool> Part<S>
    for Leaving<'_, S, C, RATIONAL>
{
    type Output = u32;

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounding is allowed for")]
    fn run(self, s: S) -> u32 {
        let Self {
            cells,
            starts,
            group,
            tilt,
        } = self;
        let load = |values: &[f32; RAYS]| s.load(&values.as_chunks::<LANES>().0[group]);
        let [x, y] = [load(&starts.at[0]), load(&starts.at[1])];
        let one = s.splat(1.0);
        let mut point = [one; 3];
        let (mut by_x, mut by_y) = (point, point);
        for r in 0..3 {
            let own = jet(s, cells, r, x, y);
            (point[r], by_x[r], by_y[r]) = (own.value, own.by_x, own.by_y);
        }
        if RATIONAL {
            let weight = jet(s, cells, 3, x, y);
            let inverse = s.div(one, weight.value);
            for r in 0..3 {
                point[r] = s.mul(point[r], inverse);
                by_x[r] = s.fnma(point[r], weight.by_x, by_x[r]);
                by_y[r] = s.fnma(point[r], weight.by_y, by_y[r]);
            }
        }
        let minor = |i: usize, j: usize| s.fnma(by_x[j], by_y[i], s.mul(by_x[i], by_y[j]));
        let inverse = s.div(one, minor(0, 1));
        let normal = [s.mul(minor(1, 2), inverse), s.mul(minor(2, 0), inverse)];
        let of = |row: [S::F; 3]| s.fma(normal[0], row[0], s.fma(normal[1], row[1], row[2]));
        let level = of(point);
        // Powers of how far out the start is, from two less than that of a term on.
        let out = s.max(one, s.max(s.abs(x), s.abs(y)));
        let mut powers = [one; 2 * ORDER];
        for k in 3..powers.len() {
            powers[k] = s.mul(powers[k - 1], out);
        }
        let (mut middle, mut rest) = ([s.splat(0.0); 3], [s.splat(0.0); 3]);
        for t in 0..TERMS {
            let power = t / ORDER + t % ORDER;
            if power < 2 {
                continue;
            }
            let term = |r: usize| cells.terms[t][r].lanes(s);
            let mut own = of([term(0), term(1), term(2)]);
            if RATIONAL {
                own = s.fnma(level, term(3), own);
            }
            let size = s.mul(s.abs(own), powers[power]);
            for k in 0..3 {
                let count = s.splat(COUNTS.second[k][t] as f32);
                if t == MIDDLE[k] {
                    middle[k] = s.mul(count, own);
                } else {
                    rest[k] = s.fma(count, size, rest[k]);
                }
            }
        }
        let side = load(&starts.side);
        let a = s.fma(side, middle[0], rest[0]);
        let b = s.fma(side, middle[2], rest[2]);
        let c = s.add(s.abs(middle[1]), rest[1]);
        let half = s.splat(0.5);
        let uneven = s.mul(half, s.sub(a, b));
        let spread = s.sqrt(s.fma(uneven, uneven, s.mul(c, c)));
        let greatest = s.fma(half, s.add(a, b), spread);
        let size = s.add(s.abs(normal[0]), s.add(s.abs(normal[1]), s.abs(level)));
        let error = s.add(s.splat(ROUNDING), cells.higher.lanes(s));
        let greatest = s.fma(s.add(one, size), error, s.max(greatest, s.splat(0.0)));
        let rise = s.abs(of([tilt[0], tilt[1], one]));
        let way = s.max(s.abs(tilt[0]), s.abs(tilt[1]));
        let [inside, beside] = &cells.reach;
        let least = |reach: &C| s.mul(s.mul(reach.lanes(s), greatest), way);
        let is_inside = s.bits(s.le(out, s.splat(WIDE as f32)));
        is_inside & s.bits(s.lt(least(inside), rise)) | s.bits(s.lt(least(beside), rise))
    }
}

/// The terms whose second derivatives by `x` twice, by both and by `y` twice are the same everywhere.
const MIDDLE: [usize; 3] = [2 * ORDER, ORDER + 1, 2];

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::tests::{ball, medley, packets, scene_of};
    use super::*;
    use crate::Instructions;
    use crate::accelerator::{Accelerator, Workspace};
    use crate::integrator::LEAVE;
    use crate::intersect::METHODS;
    use crate::random::Random;

    /// A ray that leaves a hit, and its start.
    fn leave(hit: &Hit, direction: DVec3) -> (Ray, Start) {
        let side = hit.normal * hit.normal.dot(direction).signum();
        let origin = hit.point + side * (hit.error * LEAVE);
        let ray = Ray { origin, direction };
        (ray, Start::of(hit, &ray))
    }

    /// Directions from the surface, to both of its sides: all alike, any, and nearly along it.
    fn direction(hit: &Hit, k: usize, shared: DVec3, numbers: &mut Random) -> DVec3 {
        let own = numbers.vector().normalize();
        match k % 3 {
            0 => shared,
            1 => own,
            _ => {
                let along = own.cross(hit.normal).normalize();
                along + hit.normal * numbers.signed() * [0.1, 1e-2, 1e-4][k / 3 % 3]
            }
        }
    }

    #[test]
    fn rays_that_leave_a_surface_meet_what_any_meet() {
        let scene = medley();
        let (mut hits, mut found) = (Vec::new(), Vec::new());
        let (mut plain, mut leaving) = (Vec::new(), Vec::new());
        for instructions in Instructions::ALL {
            let accelerator = Accelerator::build(&scene, &METHODS[0]);
            let accelerator = accelerator.with_instructions(instructions);
            let [mut room, mut other] = [(); 2].map(|()| Workspace::default());
            let mut numbers = Random(5);
            let (mut count, mut blocked) = (0, 0);
            for (k, rays) in packets().iter().enumerate() {
                let ranges = vec![0.0..f64::INFINITY; rays.len()];
                accelerator.nearest_many(rays, &ranges, &mut room, &mut hits);
                let shared = numbers.vector();
                let met = hits.iter().flatten();
                let (rays, starts): (Vec<_>, Vec<_>) = met
                    .map(|hit| leave(hit, direction(hit, k, shared, &mut numbers)))
                    .unzip();
                let ranges = &ranges[..rays.len()];
                accelerator.any_many(&rays, ranges, &mut room, &mut plain);
                accelerator.any_leaving(&rays, ranges, &starts, &mut other, &mut leaving);
                assert_eq!(plain, leaving, "{instructions:?} {k}");
                accelerator.nearest_many(&rays, ranges, &mut room, &mut hits);
                accelerator.nearest_leaving(&rays, ranges, &starts, &mut other, &mut found);
                let is_one = |a: &Hit, b: &Hit| a.shape == b.shape && (a.t - b.t).abs() < 1e-10;
                for pair in hits.iter().zip(&found) {
                    let is_same = match pair {
                        (Some(a), Some(b)) => is_one(a, b),
                        pair => pair == (&None, &None),
                    };
                    assert!(is_same, "{instructions:?} {k} {pair:?}");
                }
                count += plain.len();
                blocked += plain.iter().filter(|&&is_met| is_met).count();
            }
            assert!(count > 2000 && blocked > count / 8, "{count} {blocked}");
            let [all, fewer] = [&room, &other].map(|room| room.scratch.cells);
            assert!(fewer < all, "{fewer} of {all}");
        }
    }

    #[test]
    fn rays_leave_a_ball_at_any_angle_without_a_look_at_where_they_start() {
        let scene = scene_of(vec![ball(1.0, DVec3::new(0.2, 0.1, 0.4))]);
        let accelerator = Accelerator::build(&scene, &METHODS[0]);
        let mut room = Workspace::default();
        let mut numbers = Random(9);
        let mut blocked = Vec::new();
        let mut cells = [0; 2];
        for _ in 0..2000 {
            let aim = numbers.vector().normalize();
            let ray = Ray {
                origin: aim * 5.0,
                direction: numbers.vector() * 0.3 - aim,
            };
            let Some(hit) = accelerator.nearest(&ray, 0.0..f64::INFINITY, &mut room) else {
                continue;
            };
            let along = numbers.vector().cross(hit.normal).normalize();
            let (away, start) = leave(&hit, along + hit.normal * 1e-3);
            for (starts, cells) in [&[][..], &[start]].into_iter().zip(&mut cells) {
                let before = room.scratch.cells;
                let range = [0.0..f64::INFINITY];
                accelerator.any_leaving(&[away], &range, starts, &mut room, &mut blocked);
                assert_eq!(blocked, [false]);
                *cells += room.scratch.cells - before;
            }
        }
        // Others beside it are looked at.
        assert!(cells[0] > 2000 && cells[1] * 3 < cells[0], "{cells:?}");
    }
}
