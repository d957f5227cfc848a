//! A surface in Bézier pieces, and bounds of its derivatives over rectangles of parameters.

use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::{BezierSurface, KnotVector, Surface, regular_normal};

use super::cone::Cone;
use super::net::{Family, Net, corner_derivatives};
use super::round::Round;
use super::separable::{Separable, is_separable};
use crate::simd::Instructions;

/// All vectors no farther than `radius` from `center`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Ball {
    pub(super) center: DVec3,
    pub(super) radius: f64,
}

impl Ball {
    /// The largest length.
    pub(super) fn reach(self) -> f64 {
        self.center.length() + self.radius
    }

    /// The least ball around two.
    fn union(self, other: Self) -> Self {
        let (way, distance) = (
            other.center - self.center,
            other.center.distance(self.center),
        );
        if distance + other.radius <= self.radius {
            return self;
        }
        if distance + self.radius <= other.radius {
            return other;
        }
        let radius = 0.5 * (distance + self.radius + other.radius);
        let share = (radius - self.radius) / distance;
        Self {
            center: self.center + way * share,
            radius,
        }
    }
}

/// Where the derivatives of a surface are over a rectangle of parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Spread {
    pub(super) du: Ball,
    pub(super) dv: Ball,
    pub(super) duu: Ball,
    pub(super) duv: Ball,
    pub(super) dvv: Ball,
}

impl Spread {
    fn union(self, other: Self) -> Self {
        Self {
            du: self.du.union(other.du),
            dv: self.dv.union(other.dv),
            duu: self.duu.union(other.duu),
            duv: self.duv.union(other.duv),
            dvv: self.dvv.union(other.dvv),
        }
    }

    /// The second directional derivative along `d`, which is a parameter step within a rectangle
    /// of the proportions `size`: a mean, and by how much it strays from that, a quadratic form in
    /// `d`.
    fn along(&self, d: DVec2, size: DVec2) -> (DVec3, f64) {
        let mean = self.duu.center * (d.x * d.x)
            + self.duv.center * (2.0 * d.x * d.y)
            + self.dvv.center * (d.y * d.y);
        let aspect = if size.x > 0.0 && size.y > 0.0 {
            size.y / size.x
        } else {
            1.0
        };
        let mixed = self.duv.radius * (aspect * d.x * d.x + d.y * d.y / aspect);
        let stray = self.duu.radius * d.x * d.x + mixed + self.dvv.radius * d.y * d.y;
        (mean, stray)
    }

    /// How far a step in parameters leads, at most.
    pub(super) fn step(&self, d: DVec2) -> f64 {
        let center = self.du.center * d.x + self.dv.center * d.y;
        center.length() + self.du.radius * d.x.abs() + self.dv.radius * d.y.abs()
    }

    /// The largest second derivative along an axis.
    pub(super) fn second(&self, axis: usize) -> f64 {
        [self.duu, self.dvv][axis].reach()
    }

    /// How far the surface over a triangle of the rectangle is from the flat triangle with
    /// the same corners, at the same parameters.
    fn triangle(&self, [a, b, c]: [DVec2; 3], size: DVec2) -> f64 {
        let sides = [a - b, b - c, c - a].map(|d| self.along(d, size));
        over_triangle(sides.map(|side| side.0), sides.map(|side| side.1))
    }

    /// As [`Spread::triangle`] for any triangle in a rectangle of this size over which first
    /// derivatives jump: by what they differ from their middle, at most, over all of it.
    pub(super) fn bent(&self, size: DVec2) -> f64 {
        self.du.radius * size.x + self.dv.radius * size.y
    }

    /// How far the surface over the segment along `d` is from the chord.
    pub(super) fn chord(&self, d: DVec2, size: DVec2) -> f64 {
        let (mean, stray) = self.along(d, size);
        (mean.length() + stray) / 8.0
    }
}

/// How far a surface is from a flat triangle with the same corners at most, at the same parameters,
/// with second derivatives along the three sides that are no farther from `means` than `strays`.
///
/// With `l` the barycentric coordinates of a point, the difference there is half of the sum of
/// `l_i l_j` times the derivatives along the sides: Taylor's formula about the point, of which the
/// constant part is an identity and the rest a quadratic form. On a saddle what the sides add has
/// opposite signs: along the longest of them it is taken with its sign.
fn over_triangle(means: [DVec3; 3], strays: [f64; 3]) -> f64 {
    let lengths = means.map(DVec3::length);
    let sum = |values: [f64; 3]| [0, 1, 2].map(|k| values[k] + strays[k]);
    let plain = highest(sum(lengths));
    let [x, y, z] = means;
    if x.dot(y).min(y.dot(z)).min(z.dot(x)) >= 0.0 {
        return plain;
    }
    let longest = (0..3).max_by(|&i, &j| lengths[i].total_cmp(&lengths[j]));
    let axis = means[longest.unwrap_or(0)].normalize_or_zero();
    let heights = means.map(|mean| mean.dot(axis));
    let aside = sum([0, 1, 2].map(|k| (means[k] - axis * heights[k]).length()));
    let side = |sign: f64| highest([0, 1, 2].map(|k| aside[k] + sign * heights[k]));
    plain.min(side(1.0).max(side(-1.0)))
}

/// The greatest value over a triangle of half the sum of `l_i l_j` times what is given for its sides.
pub(super) fn highest([x, y, z]: [f64; 3]) -> f64 {
    let longest = x.max(y).max(z);
    let others = x + y + z - longest;
    if longest >= others {
        return longest.max(0.0) / 8.0;
    }
    // Half the squared radius of the circle around a triangle with these squared sides.
    let product = if longest <= x {
        y * z
    } else if longest <= y {
        x * z
    } else {
        x * y
    };
    let excess = others - longest;
    0.5 * longest / (4.0 - excess * excess / product)
}

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
    breaks: [Vec<f64>; 2],
    /// Breaks inside the domain at which a first derivative jumps.
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
    /// where it is `enough` or a better one would be `futile`.
    pub(super) fn bound_until(
        &self,
        rect: &Rect,
        bound: impl Fn(&Spread) -> f64,
        enough: f64,
        futile: impl Fn() -> bool,
    ) -> f64 {
        let around = self.around(rect);
        let [rows, columns] = &around;
        if let ([i, j], 1, 1) = ([rows.start, columns.start], rows.len(), columns.len()) {
            let whole = bound(&self.piece(i, j).spread);
            if whole <= enough {
                return whole;
            }
            let part = match self.part(i, j, rect) {
                Part::Done(spread) => return bound(&spread),
                Part::Cut(net) => net,
            };
            // What has no extent one way takes as long either way.
            let is_area = self.is_costly && rect.size().min_element() > 0.0;
            let rough = is_area.then(|| bound(&part.rough()));
            let rough = rough.filter(|rough| *rough <= enough || futile());
            return rough.unwrap_or_else(|| bound(&part.spread()));
        }
        let whole = bound(&self.joint(around.clone(), |i, j| self.piece(i, j).spread));
        if whole <= enough {
            return whole;
        }
        if self.is_costly {
            let rough = bound(&self.joint(around, |i, j| self.part(i, j, rect).rough()));
            if rough <= enough || futile() {
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
        let all = rows.flat_map(|i| columns.clone().map(move |j| (i, j)));
        let spreads = all.map(|(i, j)| each(i, j));
        spreads.reduce(Spread::union).unwrap_or_default()
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

    /// How far a flat triangle is from the surface at the [parameters](Self::place) that belong to its
    /// points; a coarser bound where it is `enough` or a better one would be `futile`.
    pub(crate) fn off_flat(&self, uvs: [DVec2; 3], enough: f64, futile: impl Fn() -> bool) -> f64 {
        let rect = Rect::around(uvs);
        let is_creased = self.is_creased_inside(&rect);
        let Some(cone) = &self.cone else {
            let size = rect.size();
            let bound = |spread: &Spread| {
                if is_creased {
                    spread.bent(size)
                } else {
                    spread.triangle(uvs, size)
                }
            };
            return self.bound_until(&rect, bound, enough, futile);
        };
        if is_creased {
            let rect = cone.wide_end(&rect);
            return self.spread(&rect).bent(rect.size()) + cone.off;
        }
        let sides = [[uvs[0], uvs[1]], [uvs[1], uvs[2]], [uvs[2], uvs[0]]];
        let off = |side: [DVec2; 2]| self.off_chord(cone, side, enough - cone.off);
        sides.map(off).into_iter().fold(0.0, f64::max) + cone.off
    }

    /// How far a chord of a cone is from it at the parameters that belong to its points, without what the cone
    /// is off.
    fn off_chord(&self, cone: &Cone, ends: [DVec2; 2], enough: f64) -> f64 {
        let bend = cone.bend(ends);
        if bend <= 0.0 {
            return 0.0;
        }
        let rect = cone.wide_end(&Rect::around(ends));
        let bound = |spread: &Spread| bend * spread.second(cone.across());
        self.bound_until(&rect, bound, enough, || false)
    }

    /// How far a chord is from the surface where the parameters that belong to it are not those of the straight
    /// way, at least, and by how much more what lies between both may be.
    pub(super) fn beside_chord(&self, ends: [DVec2; 2]) -> [f64; 2] {
        let aside = self.cone.map_or(0.0, |cone| cone.aside(ends));
        let Some(cone) = self.cone.filter(|_| aside > 0.0) else {
            return [0.0; 2];
        };
        let wide = self.spread(&cone.wide_end(&Rect::around(ends)));
        let second = wide.second(cone.across());
        let bound = |bend: f64| bend * second + cone.off;
        [bound(cone.bend(ends)), bound(aside * aside / 8.0)]
    }

    /// The parameters that belong to a point of a flat triangle, or of a segment, with shares of its corners.
    #[inline]
    pub(crate) fn place<const N: usize>(&self, uvs: [DVec2; N], shares: [f64; N]) -> DVec2 {
        if let Some(cone) = &self.cone {
            return cone.place(uvs, shares);
        }
        let mut sum = DVec2::ZERO;
        for k in 0..N {
            sum += uvs[k] * shares[k];
        }
        if let Some(round) = &self.round {
            let mut flat = DVec3::ZERO;
            for k in 0..N {
                flat += self.surface.evaluate(uvs[k]) * shares[k];
            }
            return round.place(flat, sum);
        }
        sum
    }

    /// The axis of the parameters across the lines that meet at a vertex with a [regular
    /// normal](Surface::point_and_regular_normal) or none, if they do.
    pub(super) fn across_apex(&self, uv: DVec2, normal: DVec3) -> Option<usize> {
        let cone = self.cone.filter(|cone| cone.is_apex(uv));
        let round = self.round.as_ref().filter(|_| normal == DVec3::ZERO);
        cone.map(|cone| cone.across()).or(round.map(Round::around))
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
        let inner = (1..breaks.len() - 1)
            .filter(|&k| knots.multiplicity(breaks[k]) >= knots.degree() && self.jumps(axis, k));
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
    let least = NARROW * (piece.end - piece.start);
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
const NARROW: f64 = 1e-4;

/// What is no wider than this share of a piece is a line.
pub(super) const LINE: f64 = 1e-11;

/// First derivatives that differ by this share are the same.
const SMOOTH: f64 = 1e-7;

#[cfg(test)]
mod tests {
    use super::*;

    /// How far a surface with constant second derivatives is from the flat triangle, by samples.
    fn sampled(spread: &Spread, corners: [DVec2; 3]) -> f64 {
        let height = |p: DVec2| {
            0.5 * spread.duu.center * (p.x * p.x)
                + spread.duv.center * (p.x * p.y)
                + 0.5 * spread.dvv.center * (p.y * p.y)
        };
        let mut most = 0.0_f64;
        for i in 0..=60 {
            for j in 0..=60 - i {
                let shares = [i, j, 60 - i - j].map(|k| f64::from(k) / 60.0);
                let (mut uv, mut flat) = (DVec2::ZERO, DVec3::ZERO);
                for (share, corner) in shares.into_iter().zip(corners) {
                    uv += corner * share;
                    flat += height(corner) * share;
                }
                most = most.max(height(uv).distance(flat));
            }
        }
        most
    }

    #[test]
    fn a_triangle_on_a_saddle_counts_with_the_signs_of_its_sides() {
        let ball = |center| Ball {
            center,
            radius: 0.0,
        };
        let of = |duu, duv, dvv| Spread {
            duu: ball(duu),
            duv: ball(duv),
            dvv: ball(dvv),
            ..Spread::default()
        };
        // The largest triangle within one of a saddle: rows are as far apart as the root of ten.
        let widest = [
            DVec2::ZERO,
            DVec2::new(8.0_f64.sqrt(), 0.0),
            DVec2::new(2.0_f64.sqrt(), 10.0_f64.sqrt()),
        ];
        let saddle = of(DVec3::Z, DVec3::ZERO, DVec3::NEG_Z);
        let bound = saddle.triangle(widest, DVec2::ONE);
        assert!((bound - 1.0).abs() < 1e-12, "{bound}");
        let mut rng = fastrand::Rng::with_seed(3);
        let (mut exact, count) = (0, 1000);
        for _ in 0..count {
            let mut vector = || DVec3::new(rng.f64(), rng.f64(), rng.f64()) - 0.5;
            let spread = of(vector(), vector(), vector());
            let corners = [vector(), vector(), vector()].map(DVec3::truncate);
            let (bound, found) = (
                spread.triangle(corners, DVec2::ONE),
                sampled(&spread, corners),
            );
            assert!(found <= bound * (1.0 + 1e-12), "{found} {bound}");
            exact += usize::from(found > 0.8 * bound);
        }
        assert!(exact > count * 3 / 4, "{exact} of {count}");
    }

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
            pieces.off_flat([DVec2::ZERO, DVec2::Y, middle], 0.0, || false)
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
