//! A surface in Bézier pieces, and bounds of its derivatives over rectangles of parameters.

mod belonging;
mod spread;
mod unevenness;

use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::{BezierSurface, KnotVector, Surface, regular_normal};

use super::cone::Cone;
use super::net::{Family, Net, corner_derivatives};
use super::round::Round;
use super::separable::{Separable, is_separable};
use crate::simd::Instructions;

pub(crate) use self::spread::Spread;
pub(super) use self::spread::{Ball, highest};
pub(super) use self::unevenness::UNEVEN;

/// A rectangle of parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rect {
    pub(crate) min: DVec2,
    pub(crate) max: DVec2,
}

impl Rect {
    /// The least rectangle around points.
    pub(crate) fn around(points: impl IntoIterator<Item = DVec2>) -> Self {
        let empty = Self {
            min: DVec2::INFINITY,
            max: DVec2::NEG_INFINITY,
        };
        points.into_iter().fold(empty, |r, p| Self {
            min: r.min.min(p),
            max: r.max.max(p),
        })
    }

    pub(crate) fn size(&self) -> DVec2 {
        self.max - self.min
    }

    /// What of it lies in another one; all of that if nothing does.
    pub(super) fn within(self, other: &Self) -> Self {
        let (min, max) = (self.min.max(other.min), self.max.min(other.max));
        if min.cmplt(max).all() {
            Self { min, max }
        } else {
            *other
        }
    }
}

/// A surface with its Bézier pieces.
#[derive(Debug)]
pub(crate) struct Pieces<'a> {
    pub(super) surface: &'a Surface,
    domain: Rect,
    /// Borders of the pieces along u and v.
    pub(super) breaks: [Vec<f64>; 2],
    /// Breaks inside the domain at which a first derivative jumps, or steps become much longer or shorter.
    pub(super) creases: [Vec<f64>; 2],
    list: Vec<Piece>,
    family: Family,
    /// Whether the bounds of some pieces cost much more than rough ones.
    is_costly: bool,
    /// Where it is made of straight lines towards a point.
    pub(super) cone: Option<Cone>,
    /// Where its points belong to the nearest ones of a sphere or a torus.
    pub(super) round: Option<Round>,
}

#[derive(Debug)]
struct Piece {
    net: BezierSurface,
    weights: Weights,
    /// Bounds over all of it.
    spread: Spread,
    /// Whether second derivatives are rounding errors: those bounds are good for every part.
    is_straight: bool,
}

/// The weights that the points of a piece have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Weights {
    /// All the same.
    Even,
    /// Products of one along u and one along v.
    Separable,
    Any,
}

impl Weights {
    fn of(net: &BezierSurface) -> Self {
        let points = net.homogeneous();
        if points.iter().all(|h| (h.w - points[0].w).abs() <= 0.0) {
            Self::Even
        } else if is_separable(net) {
            Self::Separable
        } else {
            Self::Any
        }
    }
}

impl Piece {
    fn new(family: &Family, net: BezierSurface) -> Self {
        let (u, v) = (net.u(), net.v());
        let size = DVec2::new(u.end - u.start, v.end - v.start);
        let mut piece = Self {
            weights: Weights::of(&net),
            net,
            spread: Spread::default(),
            is_straight: false,
        };
        let spread = piece.cut(family, [u, v]).spread();
        let length = (spread.du.reach() * size.x).max(spread.dv.reach() * size.y);
        let bends = [
            spread.duu.reach() * size.x * size.x,
            spread.duv.reach() * size.x * size.y,
            spread.dvv.reach() * size.y * size.y,
        ];
        piece.is_straight = bends.iter().all(|bend| *bend <= STRAIGHT * length);
        piece.spread = spread;
        piece
    }

    /// What of it lies in a part of its domain.
    fn cut(&self, family: &Family, part: [Range<f64>; 2]) -> Part {
        let piece = &self.net;
        if self.weights == Weights::Separable {
            Part::Done(family.instructions.run(Separable { piece, part }))
        } else {
            Part::Cut(Net::of(family, piece, part))
        }
    }
}

/// What of a piece lies in a rectangle.
enum Part {
    Done(Spread),
    Cut(Net),
}

impl Part {
    fn spread(&self) -> Spread {
        match self {
            Self::Done(spread) => *spread,
            Self::Cut(net) => net.spread(),
        }
    }

    fn rough(&self) -> Spread {
        match self {
            Self::Done(spread) => *spread,
            Self::Cut(net) => net.rough(),
        }
    }
}

impl<'a> Pieces<'a> {
    pub(crate) fn new(surface: &'a Surface) -> Self {
        let family = Family::new(surface.knots_u().degree(), surface.knots_v().degree());
        let list: Vec<Piece> = surface
            .bezier_pieces()
            .into_iter()
            .map(|net| Piece::new(&family, net))
            .collect();
        let is_costly = list.iter().any(|piece| piece.weights == Weights::Any);
        let breaks = [surface.knots_u().breaks(), surface.knots_v().breaks()];
        let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
        let mut pieces = Self {
            surface,
            domain: Rect {
                min: DVec2::new(u.start, v.start),
                max: DVec2::new(u.end, v.end),
            },
            breaks,
            creases: [Vec::new(), Vec::new()],
            list,
            family,
            is_costly,
            cone: Cone::of(surface),
            round: None,
        };
        pieces.creases = [0, 1].map(|axis| pieces.find_creases(axis));
        pieces
    }

    pub(crate) fn domain(&self) -> Rect {
        self.domain
    }

    /// Borders between pieces along u and v.
    pub(super) fn inner_breaks(&self) -> [&[f64]; 2] {
        let [u, v] = &self.breaks;
        [&u[1..u.len() - 1], &v[1..v.len() - 1]]
    }

    fn columns(&self) -> usize {
        self.breaks[1].len() - 1
    }

    /// Whether all pieces are parts of planes, evenly divided by their parameters.
    pub(super) fn are_straight(&self) -> bool {
        self.list.iter().all(|piece| piece.is_straight)
    }

    /// The piece that a rectangle lies in, if it is one.
    pub(super) fn piece_around(&self, rect: &Rect) -> Option<&BezierSurface> {
        let [rows, columns] = self.around(rect);
        let is_one = rows.len() == 1 && columns.len() == 1;
        is_one.then(|| &self.piece(rows.start, columns.start).net)
    }

    /// What bounds are computed with.
    pub(super) fn instructions(&self) -> Instructions {
        self.family.instructions
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
    pub(crate) fn spread(&self, rect: &Rect) -> Spread {
        self.joint(self.around(rect), |i, j| self.part(i, j, rect).spread())
    }

    /// A `bound` that follows from those over a rectangle, or from coarser ones, which cost less,
    /// where it is `enough`, or so much that it is hopeless, or a better one would be `futile`.
    pub(super) fn bound_until(
        &self,
        rect: &Rect,
        bound: impl Fn(&Spread) -> f64,
        (enough, hopeless): (f64, f64),
        futile: impl Fn() -> bool,
    ) -> f64 {
        let will_do = |rough: f64| rough <= enough || rough > hopeless || futile();
        let around = self.around(rect);
        let [rows, columns] = &around;
        if let ([i, j], 1, 1) = ([rows.start, columns.start], rows.len(), columns.len()) {
            let whole = bound(&self.piece(i, j).spread);
            if whole <= enough {
                return whole;
            }
            let bound = |spread: &Spread| bound(spread).min(whole);
            let part = match self.part(i, j, rect) {
                Part::Done(spread) => return bound(&spread),
                Part::Cut(net) => net,
            };
            // What has no extent one way takes as long either way.
            let is_area = self.is_costly && rect.size().min_element() > 0.0;
            let rough = is_area.then(|| bound(&part.rough()));
            let rough = rough.filter(|rough| will_do(*rough));
            return rough.unwrap_or_else(|| bound(&part.spread()));
        }
        let whole = bound(&self.joint(around.clone(), |i, j| self.piece(i, j).spread));
        if whole <= enough {
            return whole;
        }
        let bound = |spread: &Spread| bound(spread).min(whole);
        if self.is_costly {
            let rough = bound(&self.joint(around, |i, j| self.part(i, j, rect).rough()));
            if will_do(rough) {
                return rough;
            }
        }
        bound(&self.spread(rect))
    }

    /// The rows and columns of the pieces that a rectangle lies in.
    fn around(&self, rect: &Rect) -> [Range<usize>; 2] {
        [0, 1].map(|axis| self.spans(axis, rect.min[axis], rect.max[axis]))
    }

    /// Bounds over what of several pieces they are given for.
    fn joint(
        &self,
        [rows, columns]: [Range<usize>; 2],
        each: impl Fn(usize, usize) -> Spread,
    ) -> Spread {
        let mut joint: Option<Spread> = None;
        for i in rows {
            for j in columns.clone() {
                let spread = each(i, j);
                match &mut joint {
                    Some(joint) => joint.include(&spread),
                    none => *none = Some(spread),
                }
            }
        }
        joint.unwrap_or_default()
    }

    fn piece(&self, i: usize, j: usize) -> &Piece {
        &self.list[i * self.columns() + j]
    }

    /// What of a piece lies in a rectangle.
    fn part(&self, i: usize, j: usize, rect: &Rect) -> Part {
        let piece = self.piece(i, j);
        let (u, v) = (piece.net.u(), piece.net.v());
        let part_u = part(rect.min.x..rect.max.x, &u);
        let part_v = part(rect.min.y..rect.max.y, &v);
        if piece.is_straight || part_u == u && part_v == v {
            return Part::Done(piece.spread);
        }
        piece.cut(&self.family, [part_u, part_v])
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
        let [du, dv] = corner_derivatives(&self.piece(i, j).net, uv);
        regular_normal([du, dv], [0.0; 2]).or_else(|| self.surface.normal(uv.midpoint(inside)))
    }

    /// Whether the surface may have a crease at `uv`.
    pub(super) fn is_creased(&self, uv: DVec2) -> bool {
        self.is_creased_between(uv, uv)
    }

    /// Whether there may be a crease on the way between two places, ends included.
    pub(super) fn is_creased_between(&self, a: DVec2, b: DVec2) -> bool {
        (0..2).any(|axis| {
            let (low, high) = (a[axis].min(b[axis]), a[axis].max(b[axis]));
            let k = self.creases[axis].partition_point(|&k| k < low);
            self.creases[axis].get(k).is_some_and(|&k| k <= high)
        })
    }

    /// Whether a crease passes through the inside of a rectangle.
    pub(super) fn is_creased_inside(&self, rect: &Rect) -> bool {
        (0..2).any(|axis| {
            let slack = 1e-9 * (rect.max[axis] - rect.min[axis]);
            let k = self.creases[axis].partition_point(|&k| k <= rect.min[axis] + slack);
            self.creases[axis]
                .get(k)
                .is_some_and(|&k| k < rect.max[axis] - slack)
        })
    }

    /// The inner breaks where the first derivative across them is not the same on both sides.
    fn find_creases(&self, axis: usize) -> Vec<f64> {
        let knots: &KnotVector = [self.surface.knots_u(), self.surface.knots_v()][axis];
        let breaks = &self.breaks[axis];
        let parts = self.parted(axis);
        let jumps =
            |k: usize| knots.multiplicity(breaks[k]) >= knots.degree() && self.jumps(axis, k);
        let inner = (1..breaks.len() - 1).filter(|&k| jumps(k) || parts(k));
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
                    corner_derivatives(&self.piece(i, j).net, uv)[axis]
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
    // What is only the end of a range counts for all of it, with its rounding errors.
    let is_whole = start <= range.start && range.end <= end;
    let least = if is_whole { NARROW } else { NARROW_END } * (piece.end - piece.start);
    if end - start >= least {
        return start..end;
    }
    if range.end - range.start <= LINE * (piece.end - piece.start) {
        return start..start;
    }
    let middle = 0.5 * (start + end);
    let start = (middle - 0.5 * least).clamp(piece.start, piece.end - least);
    start..start + least
}

/// Parameters this near, as a share of the domain, may be one.
const ROUNDING: f64 = 1e-12;

/// Second derivatives that bend a piece by no more than this share of its length are rounding errors.
const STRAIGHT: f64 = 1e-13;

/// Narrower parts of a piece are made this wide, as a share of it.
const NARROW: f64 = 1e-9;

/// The same for ends of ranges that go on in other pieces.
const NARROW_END: f64 = 1e-4;

/// What is no wider than this share of a piece is a line.
pub(super) const LINE: f64 = 1e-11;

/// First derivatives that differ by this share are the same.
const SMOOTH: f64 = 1e-7;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_no_wider_than_a_line_is_as_far_off_as_its_longest_side() {
        // Along its border the surface bends little, beside it much.
        let heights = [[0.0, 0.1, 0.1, 0.0], [0.0, 1e5, 1e5, 0.0]];
        let point = |i: usize, j: usize| DVec3::new(j as f64, i as f64, heights[i][j]);
        let points: Vec<DVec3> = (0..8).map(|k| point(k / 4, k % 4)).collect();
        let [u, v] = [1, 3].map(|degree| KnotVector::bezier(degree, 0.0..1.0).unwrap());
        let surface = Surface::new(u, v, &points, None).unwrap();
        let pieces = Pieces::new(&surface);
        let off = |width: f64| {
            let middle = DVec2::new(width, 0.5);
            pieces.off_flat([DVec2::ZERO, DVec2::Y, middle], (0.0, 0.0), || false)
        };
        assert!(
            off(1e-16) <= off(0.0) * (1.0 + 1e-9),
            "{} {}",
            off(1e-16),
            off(0.0)
        );
        assert!(off(1e-6) > 1.1 * off(0.0));
    }
}
