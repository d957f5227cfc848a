//! How rays come to a cell: where they meet its tangent plane, which of them pass it by, and in
//! what part of it their roots are.

use super::beam::{Beam, RAYS, Spread};
use super::distance::Cells;
use super::leaving::Starts;
use super::model::Model;
use super::windows::{Batch, Company};
use crate::simd::{LANES, Part, Singles};

/// Rounding errors of positions and values in single precision, several wide.
const ROUNDING: f32 = 8.0 / (1 << 24) as f32;

/// Rounding errors in double precision, as a share of those in single precision, several wide.
const DOUBLE: f32 = 1.0 / (1 << 24) as f32;

/// Rays along which rounding errors grow by more than this on their way to the tangent plane are seen
/// from a cell in double precision.
const SLANTED: f32 = 128.0;

/// Rays of a beam advance across no more than this, along either axis, for each one along it.
pub(super) const STEEPEST: f32 = 4.0;

/// A cell as the rays of a beam see it: axes in the order of the beam, signs along its way.
pub(super) struct View {
    pub(super) bulge: [f32; 3],
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
    /// As seen by a beam.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "differences are formed before; errors are allowed for"
    )]
    pub(super) fn of(model: &Model, beam: &Beam) -> Self {
        let &Model {
            rows,
            bulge,
            weight_stray,
            dropped,
            ..
        } = model;
        let center = model.center.to_array();
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
            direction_size = direction_size.max(STEEPEST * sizes[r] + own[r][2].abs());
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

/// The product of a row over the axes across with positions.
#[inline(always)]
fn across<S: Singles>(s: S, row: [f32; 3], y: [S::F; 2]) -> S::F {
    s.fma(s.splat(row[0]), y[0], s.mul(s.splat(row[1]), y[1]))
}

/// The product of a row with directions, which advance by one along the main axis.
#[inline(always)]
fn along<S: Singles>(s: S, row: [f32; 3], m: [S::F; 2]) -> S::F {
    let rest = s.fma(s.splat(row[1]), m[1], s.splat(row[2]));
    s.fma(s.splat(row[0]), m[0], rest)
}

/// The lanes of a group of what a beam has for each ray.
#[inline(always)]
pub(super) fn load<S: Singles>(s: S, values: &[f32; RAYS], group: usize) -> S::F {
    s.load(&values.as_chunks::<LANES>().0[group])
}

/// How sixteen rays come to a cell.
pub(super) struct Approach<F> {
    /// A bit for each that certainly misses it.
    pub(super) beside: u32,
    /// Where the tangent plane is met, in the cell's coordinates, and the tilt against it.
    pub(super) place: [F; 2],
    pub(super) tilt: [F; 2],
    /// Roots are no further from there.
    pub(super) radius: [F; 2],
    /// What is uncertain of the place: in any direction, and in that of the tilt, of which this
    /// is a part.
    pub(super) error: [F; 2],
}

/// Sixteen rays in the frame of a cell, or each in that of its own.
pub(super) struct Sight<F> {
    /// Whether all is rounded from double precision.
    pub(super) is_exact: bool,
    /// How far from the middle they are at most where they are looked at, along an axis.
    pub(super) distance: F,
    /// The way along the ray of one unit of the third coordinate.
    pub(super) inverse: F,
    /// Advance of the first two coordinates with the third.
    pub(super) tilt: [F; 2],
    /// The first two where the third is zero.
    pub(super) place: [F; 2],
    /// Where the third is zero along the ray, and what is still of interest of it.
    pub(super) time: F,
    pub(super) near: F,
    pub(super) far: F,
}

/// What the cells are like that sixteen rays come to.
pub(super) struct Shape<F> {
    pub(super) bulge: [F; 3],
    pub(super) weight_stray: F,
    pub(super) dropped: F,
    /// See [`height`].
    pub(super) height: F,
    pub(super) direction_size: F,
    pub(super) sizes: [F; 3],
}

/// How far a cell stands from its tangent plane, whatever its weights are.
#[inline(always)]
pub(super) fn height(bulge: f32, weight_stray: f32) -> f32 {
    let room = if weight_stray < 1.0 {
        (1.0 - weight_stray).recip()
    } else {
        f32::INFINITY
    };
    bulge * room * 1.001
}

#[inline(always)]
fn sight<S: Singles>(s: S, view: &View, spread: &Spread, group: usize) -> Sight<S::F> {
    let [row1, row2, row3] = view.rows;
    let way = s.splat(view.way);
    let [turn1, turn2] = &spread.turn;
    let turn = [load(s, turn1, group), load(s, turn2, group)];
    let offset1 = s.fma(turn[0], way, load(s, &spread.offset[0], group));
    let offset2 = s.fma(turn[1], way, load(s, &spread.offset[1], group));
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
        is_exact: false,
        distance: s.max(s.abs(y[0]), s.abs(y[1])),
        inverse,
        tilt: [g1, g2],
        place: [s.fnma(g1, p3, p1), s.fnma(g2, p3, p2)],
        time: s.fnma(p3, inverse, s.splat(view.zeta)),
        near: load(s, &spread.near, group),
        far: load(s, &spread.far, group),
    }
}

/// As [`sight`], rounded from double precision: where a ray meets the tangent plane is the less certain
/// the more it runs along the cell.
struct ExactSight<'a> {
    cell: &'a OneCell<'a>,
    group: usize,
}

impl<S: Singles> Part<S> for ExactSight<'_> {
    type Output = Sight<S::F>;

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounding is allowed for")]
    fn run(self, s: S) -> Sight<S::F> {
        let Self { cell, group } = self;
        let &OneCell {
            model,
            beam,
            spread,
            lanes,
            ..
        } = cell;
        let (center, [i, j]) = (model.center.to_array(), beam.across);
        let zeta = center[beam.main] * beam.sign;
        let way = zeta - beam.start;
        let mut rows = [[0.0; 3]; 3];
        for (own, row) in rows.iter_mut().zip(&model.rows) {
            let row = row.map(f64::from);
            *own = [row[i], row[j], row[beam.main] * beam.sign];
        }
        let [r1, r2, r3] = rows;
        let mut seen = [[0.0; LANES]; 7];
        let lanes: &[u8; LANES] = &lanes.as_chunks().0[group];
        for (k, &lane) in lanes.iter().enumerate() {
            let lane = usize::from(lane);
            let (m1, m2) = (beam.slope[0][lane], beam.slope[1][lane]);
            let y1 = beam.origin[0][lane] + m1 * way - center[i];
            let y2 = beam.origin[1][lane] + m2 * way - center[j];
            let inverse = (r3[0] * m1 + r3[1] * m2 + r3[2]).recip();
            let g1 = (r1[0] * m1 + r1[1] * m2 + r1[2]) * inverse;
            let g2 = (r2[0] * m1 + r2[1] * m2 + r2[2]) * inverse;
            let p3 = r3[0] * y1 + r3[1] * y2;
            seen[0][k] = y1.abs().max(y2.abs()) as f32;
            seen[1][k] = inverse as f32;
            seen[2][k] = g1 as f32;
            seen[3][k] = g2 as f32;
            seen[4][k] = (r1[0] * y1 + r1[1] * y2 - g1 * p3) as f32;
            seen[5][k] = (r2[0] * y1 + r2[1] * y2 - g2 * p3) as f32;
            seen[6][k] = (zeta - p3 * inverse) as f32;
        }
        Sight {
            is_exact: true,
            distance: s.load(&seen[0]),
            inverse: s.load(&seen[1]),
            tilt: [s.load(&seen[2]), s.load(&seen[3])],
            place: [s.load(&seen[4]), s.load(&seen[5])],
            time: s.load(&seen[6]),
            near: load(s, &spread.near, group),
            far: load(s, &spread.far, group),
        }
    }
}

/// The rays of a beam and one cell, from what they see of it.
#[inline(always)]
fn approach<S: Singles, const RATIONAL: bool>(
    s: S,
    view: &View,
    sight: &Sight<S::F>,
) -> Approach<S::F> {
    let splat = |[x, y, z]: [f32; 3]| [s.splat(x), s.splat(y), s.splat(z)];
    let shape = Shape {
        bulge: splat(view.bulge),
        weight_stray: s.splat(view.weight_stray),
        dropped: s.splat(view.dropped),
        height: s.splat(height(view.bulge[2], view.weight_stray)),
        direction_size: s.splat(view.direction_size),
        sizes: splat(view.sizes),
    };
    reach::<S, RATIONAL>(s, sight, &shape)
}

/// What sixteen rays may meet, from what they see of their cells.
#[inline(always)]
pub(super) fn reach<S: Singles, const RATIONAL: bool>(
    s: S,
    sight: &Sight<S::F>,
    shape: &Shape<S::F>,
) -> Approach<S::F> {
    let &Sight {
        is_exact,
        distance,
        inverse,
        tilt: [g1, g2],
        place: [x0, y0],
        time,
        ..
    } = sight;
    // How well it is known where the tangent plane is met.
    let one = s.splat(1.0);
    let (size1, size2) = (s.abs(g1), s.abs(g2));
    let [along1, along2, along3] = shape.sizes;
    let blur = s.fma(shape.direction_size, s.abs(inverse), one);
    let depth = s.fma(distance, along3, one);
    let width = s.fma(distance, s.add(along1, along2), one);
    let dropped = shape.dropped;
    let far = s.max(s.abs(x0), s.abs(y0));
    let (blurred, width) = if is_exact {
        let double = s.splat(DOUBLE);
        let blurred = s.fma(double, s.mul(depth, blur), one);
        (blurred, s.fma(double, width, s.add(one, far)))
    } else {
        (s.mul(depth, blur), width)
    };
    let along = s.fma(s.splat(ROUNDING), blurred, dropped);
    let mut any = s.fma(s.splat(ROUNDING), s.add(blurred, width), dropped);
    if RATIONAL {
        any = s.fma(s.mul(dropped, s.add(one, s.max(size1, size2))), far, any);
    }
    let error = s.fma(along, s.max(size1, size2), any);
    // What is not linear moves roots along the cell, and along the tilt by what stands across.
    let [b1, b2, b3] = shape.bulge;
    let (mut flat1, mut flat2) = (s.add(b1, error), s.add(b2, error));
    if RATIONAL {
        flat1 = s.fma(s.abs(x0), shape.weight_stray, flat1);
        flat2 = s.fma(s.abs(y0), shape.weight_stray, flat2);
    }
    let (radius1, radius2) = (s.fma(size1, b3, flat1), s.fma(size2, b3, flat2));
    // In the plane of the ray and the normal nothing stands across.
    let plane = s.abs(s.fnma(y0, g1, s.mul(x0, g2)));
    let reach = s.fma(size2, s.add(one, flat1), s.mul(size1, s.add(one, flat2)));
    // Where the cell is met along the ray, at the least and at the most.
    let spread = s.fma(
        s.fma(depth, s.splat(2.0 * ROUNDING), shape.height),
        s.mul(s.abs(inverse), blur_of(s, blur)),
        s.splat(4.0 * ROUNDING),
    );
    // What is not a number passes.
    let beside = s.bits(s.lt(s.add(one, radius1), s.abs(x0)))
        | s.bits(s.lt(s.add(one, radius2), s.abs(y0)))
        | s.bits(s.lt(reach, plane))
        | s.bits(s.lt(sight.far, s.sub(time, spread)))
        | s.bits(s.lt(s.add(time, spread), sight.near));
    Approach {
        beside,
        place: [x0, y0],
        tilt: [g1, g2],
        radius: [radius1, radius2],
        error: [any, along],
    }
}

/// A growth for times from the blur of directions, at most a half more.
#[inline(always)]
fn blur_of<S: Singles>(s: S, blur: S::F) -> S::F {
    s.fma(blur, s.splat(ROUNDING), s.splat(1.0))
}

/// Rays of a beam at one cell.
pub(super) struct OneCell<'a> {
    pub(super) model: &'a Model,
    pub(super) view: View,
    pub(super) beam: &'a Beam,
    /// The rays, and which of those of the beam they are.
    pub(super) spread: &'a Spread,
    pub(super) lanes: &'a [u8; RAYS],
    pub(super) starts: &'a Starts,
}

impl Company for OneCell<'_> {
    type Number = f32;

    #[inline(always)]
    fn approach<S: Singles, const RATIONAL: bool>(
        &self,
        s: S,
        (group, lanes): (usize, u32),
    ) -> Approach<S::F> {
        let sight = sight(s, &self.view, self.spread, group);
        let found = approach::<S, RATIONAL>(s, &self.view, &sight);
        let limit = s.splat(SLANTED / self.view.direction_size);
        let slanted = s.bits(s.lt(limit, s.abs(sight.inverse)));
        if slanted & lanes & !found.beside == 0 {
            return found;
        }
        let sight = s.apart(ExactSight { cell: self, group });
        approach::<S, RATIONAL>(s, &self.view, &sight)
    }

    #[inline(always)]
    fn starts(&self) -> &Starts {
        self.starts
    }

    #[inline(always)]
    fn cells(&self, _: usize) -> &Cells<f32> {
        &self.model.cell
    }

    #[inline(always)]
    fn cells_of(&mut self, _: &Batch) -> &Cells<f32> {
        &self.model.cell
    }
}
