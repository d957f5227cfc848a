//! The last steps of Newton's iteration, in double precision: eight rays and one piece.

use kernel::MAX_DEGREE;

use super::beam::{Beam, RAYS};
use super::cells::Piece;
use super::expansion::ORDER;
use super::leaf::BLURRED;
use super::tree::Tree;
use crate::intersect::net::Degrees;
use crate::simd::{Part, PerLane, Simd, WIDE_LANES};

/// Roots of up to eight rays with one piece, in double precision.
pub(super) struct Roots {
    /// A bit for each ray that converged to a root near its start.
    pub(super) found: u32,
    pub(super) u: [f64; WIDE_LANES],
    pub(super) v: [f64; WIDE_LANES],
    /// In the units of the piece: the point, and the derivatives by its parameters.
    pub(super) point: [[f64; WIDE_LANES]; 3],
    pub(super) by_u: [[f64; WIDE_LANES]; 3],
    pub(super) by_v: [[f64; WIDE_LANES]; 3],
}

impl Roots {
    /// Takes the parameters after the last step, and from the values before it the point there and
    /// the derivatives.
    #[inline(always)]
    fn put<S: Simd, const RATIONAL: bool>(
        &mut self,
        s: S,
        [u, v]: [S::D; 2],
        [h, hu, hv]: [[S::D; 4]; 3],
        [du, dv]: [S::D; 2],
    ) {
        s.store_d(u, &mut self.u);
        s.store_d(v, &mut self.v);
        let weight = if RATIONAL {
            s.div_d(s.splat_d(1.0), h[3])
        } else {
            s.splat_d(1.0)
        };
        for axis in 0..3 {
            let (mut x, mut xu, mut xv) = (h[axis], hu[axis], hv[axis]);
            if RATIONAL {
                x = s.mul_d(x, weight);
                xu = s.mul_d(s.fnma_d(x, hu[3], xu), weight);
                xv = s.mul_d(s.fnma_d(x, hv[3], xv), weight);
            }
            // The last step moves the point along the tangent plane.
            x = s.fnma_d(xu, du, s.fnma_d(xv, dv, x));
            s.store_d(x, &mut self.point[axis]);
            s.store_d(xu, &mut self.by_u[axis]);
            s.store_d(xv, &mut self.by_v[axis]);
        }
    }
}

/// The rays of a beam as one piece sees them: `x1 = slope1 x3 + c1` and the same for the
/// second, over the axes of the beam.
pub(super) struct Lines {
    pub(super) slope: [[f64; WIDE_LANES]; 2],
    pub(super) constant: [[f64; WIDE_LANES]; 2],
}

impl Lines {
    /// Some rays in the units of a piece whose ball has `center` and `radius` in the coordinates
    /// of the beam.
    #[inline(always)]
    pub(super) fn of(beam: &Beam, lanes: &Eight, center: [f64; 3], radius: f64) -> Self {
        let mut lines = Self {
            slope: [[0.0; WIDE_LANES]; 2],
            constant: [[0.0; WIDE_LANES]; 2],
        };
        let depth = center[beam.main] * beam.sign - beam.start;
        let inverse = radius.recip();
        for axis in 0..2 {
            let slope = lanes.of(&beam.slope[axis]);
            let origin = lanes.of(&beam.origin[axis]);
            for k in 0..WIDE_LANES {
                let at = origin[k] + slope[k] * depth;
                lines.slope[axis][k] = slope[k] * beam.sign;
                lines.constant[axis][k] = (at - center[beam.across[axis]]) * inverse;
            }
        }
        lines
    }
}

/// Eight rays of a packet.
pub(super) enum Eight {
    /// Side by side: which eight.
    Whole(usize),
    /// Any, perhaps one several times.
    Any([u8; WIDE_LANES]),
}

impl Eight {
    #[inline(always)]
    pub(super) fn new(lanes: [u8; WIDE_LANES]) -> Self {
        let first = usize::from(lanes[0]);
        let side_by_side = lanes.iter().zip(lanes[0]..).all(|(&a, b)| a == b);
        if first % WIDE_LANES == 0 && side_by_side {
            Self::Whole(first / WIDE_LANES)
        } else {
            Self::Any(lanes)
        }
    }

    /// What a packet has for each of them.
    #[inline(always)]
    pub(super) fn of(&self, values: &[f64; RAYS]) -> [f64; WIDE_LANES] {
        match self {
            &Self::Whole(eight) => values.as_chunks().0[eight % (RAYS / WIDE_LANES)],
            Self::Any(lanes) => lanes.map(|lane| values[usize::from(lane) % RAYS]),
        }
    }
}

/// Steps in double precision; the second is nearly always the last.
const LAST_STEPS: usize = 4;

/// Newton's step squares the error: from a step below this the next is beyond rounding.
const LAST: f64 = 1e-10;

/// [`nearly_last`] up to degree three.
const LAST_INSIDE: f64 = 1e-6;

/// Where the surface runs along the ray, the step squares an error that grows with the reciprocal of
/// the determinant of the derivatives: up to this it does not count.
const STEEP: f64 = 10.0;

/// The last step moves the point along the tangent plane. By the square of the step times twice
/// `p (p - 1)` the surface may turn away from there, in sizes of the piece; times half of that this
/// may be reached: by [`LAST_INSIDE`] with degree three.
const TURNS_AWAY: f64 = 6e-12;

/// Near a border of the piece: parameters decide there to which of two it belongs.
const BORDER: f64 = 1e-8;

/// Roots to be finished with Newton's iteration on the net of a piece, or on one for each ray.
pub(super) struct Finish<'a, C> {
    pub(super) net: (Degrees, &'a [[C; 4]]),
    /// Both axes across and the main one.
    pub(super) axes: [usize; 3],
    pub(super) lines: &'a Lines,
    /// Where the iteration starts, along u and v, and half of the cell: the root is near the start
    /// beside it ([`BLURRED`]), or another.
    pub(super) start: [[f64; WIDE_LANES]; 2],
    pub(super) half: [[f64; WIDE_LANES]; 2],
    /// A bit for each root that is wanted.
    pub(super) wanted: u32,
}

impl<C> Finish<'_, C> {
    /// Finishes them; with weights, if there are any.
    #[inline(always)]
    pub(super) fn roots<S: Simd>(self, s: S, is_rational: bool) -> Roots
    where
        C: PerLane<S, Lanes = S::D>,
    {
        if is_rational {
            s.apart(Weighted::<_, true>(self))
        } else {
            s.apart(Weighted::<_, false>(self))
        }
    }
}

/// [`Finish`] with weights, or without.
struct Weighted<'a, C, const RATIONAL: bool>(Finish<'a, C>);

impl<S: Simd, C: PerLane<S, Lanes = S::D>, const RATIONAL: bool> Part<S>
    for Weighted<'_, C, RATIONAL>
{
    type Output = Roots;

    #[inline(always)]
    fn run(self, s: S) -> Roots {
        let Finish {
            net,
            axes,
            lines,
            start,
            half,
            wanted,
        } = self.0;
        let reach = s.splat_d(2.0 * f64::from(BLURRED));
        let reach_u = s.mul_d(s.load_d(&half[0]), reach);
        let reach_v = s.mul_d(s.load_d(&half[1]), reach);
        let first = [s.load_d(&start[0]), s.load_d(&start[1])];
        let [i, j, main] = axes;
        let slope = [s.load_d(&lines.slope[0]), s.load_d(&lines.slope[1])];
        let constant = [s.load_d(&lines.constant[0]), s.load_d(&lines.constant[1])];
        let [mut u, mut v] = first;
        let nearly_last = nearly_last(net.0.p.max(net.0.q));
        let mut roots = Roots {
            found: 0,
            u: [0.0; WIDE_LANES],
            v: [0.0; WIDE_LANES],
            point: [[0.0; WIDE_LANES]; 3],
            by_u: [[0.0; WIDE_LANES]; 3],
            by_v: [[0.0; WIDE_LANES]; 3],
        };
        for step in 0..LAST_STEPS {
            let cubic = Degrees { p: 3, q: 3 };
            let [h, hu, hv] = if net.0 == cubic {
                // As below, with a number of turns that is known.
                homogeneous::<S, C, RATIONAL, ORDER>(s, (cubic, net.1), u, v)
            } else if net.0.p.max(net.0.q) < ORDER {
                homogeneous::<S, C, RATIONAL, ORDER>(s, net, u, v)
            } else {
                homogeneous::<S, C, RATIONAL, { MAX_DEGREE + 1 }>(s, net, u, v)
            };
            let (mut f1, mut f2) = (
                distance::<S, RATIONAL>(s, &h, [i, main], slope[0], constant[0]),
                distance::<S, RATIONAL>(s, &h, [j, main], slope[1], constant[1]),
            );
            if !RATIONAL {
                f1 = s.sub_d(f1, constant[0]);
                f2 = s.sub_d(f2, constant[1]);
            }
            let f1u = distance::<S, RATIONAL>(s, &hu, [i, main], slope[0], constant[0]);
            let f1v = distance::<S, RATIONAL>(s, &hv, [i, main], slope[0], constant[0]);
            let f2u = distance::<S, RATIONAL>(s, &hu, [j, main], slope[1], constant[1]);
            let f2v = distance::<S, RATIONAL>(s, &hv, [j, main], slope[1], constant[1]);
            let determinant = s.fnma_d(f1v, f2u, s.mul_d(f1u, f2v));
            let scale = s.div_d(s.splat_d(1.0), determinant);
            let du = s.mul_d(s.fnma_d(f1v, f2, s.mul_d(f2v, f1)), scale);
            let dv = s.mul_d(s.fnma_d(f2u, f1, s.mul_d(f1u, f2)), scale);
            u = s.sub_d(u, du);
            v = s.sub_d(v, dv);
            let (half, inside) = (s.splat_d(0.5), s.splat_d(0.5 - BORDER));
            let (last, last_inside) = (s.splat_d(LAST), s.splat_d(nearly_last));
            let (size_u, size_v) = (s.abs_d(du), s.abs_d(dv));
            let done = s.lt_d(size_u, last) & s.lt_d(size_v, last);
            let size = s.max_d(size_u, size_v);
            let nearly = s.lt_d(size, last_inside)
                & s.lt_d(
                    s.mul_d(size, s.abs_d(scale)),
                    s.splat_d(nearly_last * STEEP),
                );
            let within = s.lt_d(s.abs_d(s.sub_d(u, half)), inside)
                & s.lt_d(s.abs_d(s.sub_d(v, half)), inside);
            let small = done | nearly & within;
            if small & wanted == wanted || step == LAST_STEPS - 1 {
                let near = s.lt_d(s.abs_d(s.sub_d(u, first[0])), reach_u)
                    & s.lt_d(s.abs_d(s.sub_d(v, first[1])), reach_v);
                roots.found = small & near & wanted;
                roots.put::<S, RATIONAL>(s, [u, v], [h, hu, hv], [du, dv]);
                break;
            }
        }
        roots
    }
}

/// From a step below this the next is beyond what counts on a piece of a degree, unless a border is
/// near.
#[inline(always)]
fn nearly_last(degree: usize) -> f64 {
    if degree < ORDER {
        LAST_INSIDE
    } else {
        (TURNS_AWAY / (degree * (degree - 1)) as f64).sqrt()
    }
}

/// How far a homogeneous point, or a derivative, is from the ray along one axis across; for
/// weights of one without the constant.
#[inline(always)]
fn distance<S: Simd, const RATIONAL: bool>(
    s: S,
    h: &[S::D; 4],
    [axis, main]: [usize; 2],
    slope: S::D,
    constant: S::D,
) -> S::D {
    let x = s.fnma_d(slope, h[main], h[axis]);
    if RATIONAL {
        s.fnma_d(constant, h[3], x)
    } else {
        x
    }
}

/// Homogeneous point and derivatives at each lane's parameters, for degrees below `ORDERS`.
#[inline(always)]
fn homogeneous<S, C, const RATIONAL: bool, const ORDERS: usize>(
    s: S,
    (Degrees { p, q }, points): (Degrees, &[[C; 4]]),
    u: S::D,
    v: S::D,
) -> [[S::D; 4]; 3]
where
    S: Simd,
    C: PerLane<S, Lanes = S::D>,
{
    let points = &points[..(p + 1) * (q + 1)];
    let zero = s.splat_d(0.0);
    let (mut bu, mut du) = ([zero; ORDERS], [zero; ORDERS]);
    let (mut bv, mut dv) = ([zero; ORDERS], [zero; ORDERS]);
    basis(s, p, u, &mut bu, &mut du);
    basis(s, q, v, &mut bv, &mut dv);
    let mut sums = [[zero; 4]; 3];
    for (line, (&bu, &du)) in points.chunks_exact(q + 1).zip(bu.iter().zip(&du)) {
        let (mut value, mut by_v) = ([zero; 4], [zero; 4]);
        for (point, (&bv, &dv)) in line.iter().zip(bv.iter().zip(&dv)) {
            for r in 0..4 {
                if r < 3 || RATIONAL {
                    let c = point[r].lanes(s);
                    value[r] = s.fma_d(c, bv, value[r]);
                    by_v[r] = s.fma_d(c, dv, by_v[r]);
                }
            }
        }
        for r in 0..4 {
            if r < 3 || RATIONAL {
                sums[0][r] = s.fma_d(value[r], bu, sums[0][r]);
                sums[1][r] = s.fma_d(value[r], du, sums[1][r]);
                sums[2][r] = s.fma_d(by_v[r], bu, sums[2][r]);
            }
        }
    }
    sums
}

/// Bernstein polynomials of a degree and their derivatives.
#[inline(always)]
fn basis<S: Simd>(s: S, degree: usize, t: S::D, value: &mut [S::D], derivative: &mut [S::D]) {
    let one = s.splat_d(1.0);
    let rest = s.sub_d(one, t);
    value[0] = one;
    for d in 1..=degree {
        if d == degree {
            let scale = s.splat_d(d as f64);
            derivative[0] = s.sub_d(s.splat_d(0.0), s.mul_d(scale, value[0]));
            for k in 1..d {
                derivative[k] = s.mul_d(scale, s.sub_d(value[k - 1], value[k]));
            }
            derivative[d] = s.mul_d(scale, value[d - 1]);
        }
        value[d] = s.mul_d(t, value[d - 1]);
        for k in (1..d).rev() {
            value[k] = s.fma_d(rest, value[k], s.mul_d(t, value[k - 1]));
        }
        value[0] = s.mul_d(value[0], rest);
    }
}

/// A piece's ball in the coordinates of its hierarchy.
#[inline(always)]
pub(super) fn ball(piece: &Piece, tree: &Tree) -> ([f64; 3], f64) {
    (
        tree.to_local(piece.center).to_array(),
        piece.radius * tree.scale(),
    )
}
