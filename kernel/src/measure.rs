//! Areas, volumes and moments of faces, by integration over their Bézier pieces.
//!
//! Rectangles of a piece are integrated by Gauss's rules, halved until two answers agree. Where
//! trim loops pass, the integral over what they enclose is one along the loops (Green): from the
//! left border of the domain to the loop, along u by quadrature, summed up along v. Loops are cut
//! where they cross knots, so that everything integrated is smooth. Loops that cross each other or
//! themselves are none of these: what is inside an odd number of them is summed up row by row.

mod extent;
mod piece;
mod rules;
mod sums;

use std::collections::BTreeMap;
use std::ops::Range;

use glam::{DAffine2, DVec2, DVec3};

pub use self::rules::VolumeRule;

use self::piece::Piece;
use self::sums::Sums;
use crate::trim::{Rows, crossings, shifts};
use crate::{Aabb, BezierSurface, Curve, Patch, TrimLoop, oriented};

/// Error that is looked for, as a share of what a cube of the size of the face has.
const ACCURACY: f64 = 1e-12;

/// Roundings of a coordinate, or of a parameter, on the way to an integral.
const ROUNDINGS: f64 = 4.0;

/// Ends of parts of loops whose heights differ by less than this share of a strip are on one line.
const LEVEL: f64 = 1.0 / (1_u64 << 40) as f64;

/// Segments of loops that cross each other in all ranges of rows in which no segment ends, before no
/// more is looked at.
const PASSES: usize = 1 << 22;

impl Patch {
    /// How far [`Patch::bounds`] may be too small, as a share of the diagonal of the box around
    /// the control points.
    pub const BOUNDS_ACCURACY: f64 = extent::ACCURACY;

    /// The least box around the face.
    pub fn bounds(&self) -> Aabb {
        extent::bounds(self)
    }
}

/// Integrals over a face, about an origin. Fluxes count along `du x dv`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Integrals {
    sums: Sums,
    errors: Sums,
}

impl Integrals {
    /// The integrals over a face in its own coordinates, moments about `origin`.
    ///
    /// The errors are differences of two answers, the better of which is given, and what rounding leaves
    /// open; they bound the true error unless the surface has details that both miss.
    pub fn of(patch: &Patch, origin: DVec3) -> Self {
        Face::new(patch, origin).integrals()
    }

    /// The area.
    pub fn area(&self) -> f64 {
        self.sums.number(0)
    }

    /// The error of the area.
    pub fn area_error(&self) -> f64 {
        self.errors.number(0)
    }

    /// The volume between the face and the origin: of a closed body if summed over its faces.
    pub fn volume(&self) -> f64 {
        self.sums.number(1)
    }

    /// The error of the volume.
    pub fn volume_error(&self) -> f64 {
        self.errors.number(1)
    }

    /// The volume of a closed body three times, by what of its normals is along each axis; gaps make them differ.
    pub fn volumes(&self) -> DVec3 {
        self.sums.vector(17)
    }

    /// The integral of the normal; it vanishes for closed bodies.
    pub fn normal(&self) -> DVec3 {
        self.sums.vector(2)
    }

    /// The integral of the place over the area.
    pub fn area_moment(&self) -> DVec3 {
        self.sums.vector(5)
    }

    /// The integral of the place over the volume, summed over a closed body.
    pub fn moment(&self) -> DVec3 {
        self.sums.vector(8)
    }

    /// The integrals of x x, y y and z z over the volume, summed over a closed body.
    pub fn squares(&self) -> DVec3 {
        self.sums.vector(11)
    }

    /// The integrals of x y, y z and z x over the volume, summed over a closed body.
    pub fn products(&self) -> DVec3 {
        self.sums.vector(14)
    }

    /// The integrals over two faces together; `sign` is -1 if the second one is turned round.
    #[must_use]
    pub fn plus(&self, other: &Self, sign: f64) -> Self {
        let turned = other.sums * sign;
        // Areas do not turn round.
        let areas = other.sums.areas() - turned.areas();
        Self {
            sums: self.sums + turned + areas,
            errors: self.errors + other.errors,
        }
    }
}

/// What is added up of a face.
#[derive(Default)]
struct Total {
    sums: Sums,
    errors: Sums,
    /// The sizes of all that was added, which may be much more than what is left.
    sizes: Sums,
}

impl Total {
    fn add(&mut self, (sums, errors): (Sums, Sums), sign: f64) {
        self.sums += sums * sign;
        self.errors += errors;
        self.sizes += sums.abs();
    }
}

/// A face that is being integrated.
struct Face<'a> {
    patch: &'a Patch,
    pieces: Vec<BezierSurface>,
    breaks: [Vec<f64>; 2],
    origin: DVec3,
    tolerance: Sums,
}

impl<'a> Face<'a> {
    fn new(patch: &'a Patch, origin: DVec3) -> Self {
        let surface = &patch.surface;
        let bounds = surface.hull_bounds();
        let reach = (bounds.center() - origin).length() + bounds.diagonal();
        Self {
            patch,
            pieces: surface.bezier_pieces(),
            breaks: [surface.knots_u().breaks(), surface.knots_v().breaks()],
            origin,
            tolerance: Sums::tolerance(reach, ACCURACY),
        }
    }

    /// The piece of column `i` and strip `j`.
    fn piece(&self, i: usize, j: usize) -> Piece {
        let strips = self.breaks[1].len() - 1;
        Piece::new(&self.pieces[i * strips + j], self.origin, self.tolerance)
    }

    /// The lower and the upper corner of the domain.
    fn domain(&self) -> [DVec2; 2] {
        let surface = &self.patch.surface;
        let [u, v] = [surface.knots_u().domain(), surface.knots_v().domain()];
        [DVec2::new(u.start, v.start), DVec2::new(u.end, v.end)]
    }

    fn integrals(&self) -> Integrals {
        let mut total = Total::default();
        self.quadrature(&mut total);
        let Total {
            sums,
            mut errors,
            sizes,
        } = total;
        errors += sizes * self.rounding();
        Integrals { sums, errors }
    }

    /// What rounding leaves open of an integral, as a share of it: the farther a face is from the origin of
    /// space or parameters, the more.
    fn rounding(&self) -> f64 {
        let surface = &self.patch.surface;
        let bounds = surface.hull_bounds();
        let far = bounds.min.abs().max(bounds.max.abs()).max_element() / bounds.diagonal();
        let places = [surface.knots_u(), surface.knots_v()].map(|knots| {
            let Range { start, end } = knots.domain();
            start.abs().max(end.abs()) / (end - start)
        });
        let share = ROUNDINGS * f64::EPSILON * places.into_iter().fold(far, f64::max);
        if share.is_finite() { share } else { 0.0 }
    }

    fn quadrature(&self, total: &mut Total) {
        let [columns, strips] = [0, 1].map(|axis| self.breaks[axis].len() - 1);
        if self.patch.region().is_none() {
            for (i, j) in (0..columns).flat_map(|i| (0..strips).map(move |j| (i, j))) {
                total.add(self.piece(i, j).over([0.0, 1.0], [0.0, 1.0]), 1.0);
            }
            return;
        }
        let loops = oriented(&self.patch.loops, self.patch.surface.periods());
        let closed = self.patch.surface.closed();
        let rows = Rows::new(&loops, self.domain(), closed, &self.breaks[1]);
        if !rows.are_apart() {
            return self.by_rows(&rows, total);
        }
        let mut chords = self.chords(&loops);
        chords.sort_by_key(|chord| (chord.column, chord.strip));
        for group in chords.chunk_by(|a, b| (a.column, a.strip) == (b.column, b.strip)) {
            let [first, ..] = group else { continue };
            if first.column >= columns {
                continue;
            }
            let piece = self.piece(first.column, first.strip);
            for chord in group {
                total.add(piece.left_of(&chord.curve, chord.range), 1.0);
            }
        }
        let mut levels: Vec<_> = chords.iter().flat_map(Chord::levels).collect();
        levels.sort_by(|a, b| a.strip.cmp(&b.strip).then(a.height.total_cmp(&b.height)));
        for strip in levels.chunk_by(|a, b| a.strip == b.strip) {
            self.add_below(strip, columns, total);
        }
    }

    /// Adds what is to the left of chords and below their ends, less what is below where they begin, from the levels
    /// of a strip, in order.
    fn add_below(&self, levels: &[Level], columns: usize, total: &mut Total) {
        // As often as what is below one level counts that above another does not: nothing is below the first.
        let bottom = levels[0].height;
        for line in levels.chunk_by(|a, b| b.height - a.height <= LEVEL) {
            let Level { strip, height, .. } = line[0];
            let mut rises: BTreeMap<usize, i32> = BTreeMap::new();
            for level in line {
                *rises.entry(level.column.min(columns)).or_default() += level.count;
            }
            let off: f64 = line.iter().map(|level| level.height - height).sum();
            total.errors += self.tolerance * (off / ACCURACY);
            let (mut count, mut right) = (0, columns);
            for (column, rise) in rises.into_iter().rev().chain([(0, 0)]) {
                if count != 0 && height > bottom {
                    for column in column..right {
                        let part = self.piece(column, strip).over([0.0, 1.0], [bottom, height]);
                        total.add(part, f64::from(count));
                    }
                }
                (count, right) = (count + rise, column);
            }
        }
    }

    /// The integrals over what is inside an odd number of loops that cross each other or themselves.
    fn by_rows(&self, rows: &Rows, total: &mut Total) {
        let [columns, strips] = &self.breaks;
        let mut left = PASSES;
        let mut pieces: (usize, Vec<Piece>) = (0, Vec::new());
        for (range, met) in rows.ranges() {
            let strip = strips.partition_point(|&knot| knot <= range[0]);
            let Some([low, high]) = strip.checked_sub(1).and_then(|k| strips[k..].first_chunk())
            else {
                continue;
            };
            left = left.saturating_sub(1 + met.len() * columns.len());
            if left == 0 {
                // What is not looked at may be all of it.
                total.errors = self.tolerance * ACCURACY.recip();
                return;
            }
            if pieces.0 != strip {
                let of = |column| self.piece(column, strip - 1);
                pieces = (strip, (0..columns.len() - 1).map(of).collect());
            }
            for (piece, ends) in pieces.1.iter().zip(columns.windows(2)) {
                let local = |u: f64| ((u - ends[0]) / (ends[1] - ends[0])).clamp(0.0, 1.0);
                let intervals = |t: f64| {
                    piece.spend(met.len());
                    let inside = rows.inside(&met, low + (high - low) * t).into_iter();
                    let inside = inside.map(|ends| ends.map(local));
                    inside.filter(|[from, to]| from < to).collect()
                };
                let range = range.map(|v| (v - low) / (high - low));
                total.add(piece.inside(intervals, range), 1.0);
            }
        }
    }

    /// The loops, outer ones to the left and holes to the right, cut at the knots.
    fn chords(&self, loops: &[TrimLoop]) -> Vec<Chord> {
        let (domain, closed) = (self.domain(), self.patch.surface.closed());
        let mut chords = Vec::new();
        for trim in loops {
            for shift in shifts(trim, domain, closed) {
                for segment in trim.segments() {
                    let moved = segment.transformed(&DAffine2::from_translation(shift));
                    for piece in moved.bezier_pieces() {
                        self.cut(&piece, &mut chords);
                    }
                }
            }
        }
        chords
    }

    /// Cuts a Bézier piece of a loop at the knots.
    fn cut(&self, curve: &Curve<DVec2>, chords: &mut Vec<Chord>) {
        for pair in cuts(&self.breaks, curve, DVec2::ZERO).windows(2) {
            let middle = curve.evaluate(pair[0].midpoint(pair[1]));
            let column = self.breaks[0].partition_point(|&knot| knot <= middle.x);
            let strip = self.breaks[1].partition_point(|&knot| knot <= middle.y);
            let (Some(strip), Some(column)) = (strip.checked_sub(1), column.checked_sub(1)) else {
                continue;
            };
            let Some(&[low, high]) = self.breaks[1].get(strip..strip + 2) else {
                continue;
            };
            let height = |t: f64| ((curve.evaluate(t).y - low) / (high - low)).clamp(0.0, 1.0);
            let (left, right) = match self.breaks[0].get(column..column + 2) {
                Some(&[left, right]) => (left, right),
                // Beyond the last knot only what lies to the left counts.
                _ => (0.0, 1.0),
            };
            let scale = DVec2::new(right - left, high - low).recip();
            let local =
                DAffine2::from_scale(scale) * DAffine2::from_translation(-DVec2::new(left, low));
            chords.push(Chord {
                column,
                strip,
                heights: [height(pair[0]), height(pair[1])],
                curve: curve.transformed(&local),
                range: [pair[0], pair[1]],
            });
        }
    }
}

/// The ends of a Bézier piece of a loop that is moved by `shift`, and where it passes knots, in order.
fn cuts(breaks: &[Vec<f64>; 2], curve: &Curve<DVec2>, shift: DVec2) -> Vec<f64> {
    let Range { start, end } = curve.domain();
    let mut cuts = vec![start, end];
    for (axis, knots) in breaks.iter().enumerate() {
        for knot in knots {
            let shares = crossings(curve.homogeneous(), axis, knot - shift[axis]);
            cuts.extend(shares.into_iter().map(|t| start + (end - start) * t));
        }
    }
    cuts.sort_by(f64::total_cmp);
    cuts.dedup();
    cuts
}

/// A part of a loop inside one piece.
struct Chord {
    column: usize,
    strip: usize,
    /// Where it begins and ends in its strip, as shares of that.
    heights: [f64; 2],
    /// The curve in the local parameters of the piece, of which it is a part.
    curve: Curve<DVec2>,
    range: [f64; 2],
}

impl Chord {
    /// Both ends: all pieces to the left count up to where it ends, less up to where it begins.
    fn levels(&self) -> [Level; 2] {
        [(self.heights[0], -1), (self.heights[1], 1)].map(|(height, count)| Level {
            strip: self.strip,
            height,
            column: self.column,
            count,
        })
    }
}

/// An end of a chord: what is to its left, in its strip and below a height, counts so many times more.
struct Level {
    strip: usize,
    height: f64,
    column: usize,
    count: i32,
}

#[cfg(test)]
mod tests;
