//! A surface in Bézier pieces, and bounds of its derivatives over rectangles of parameters.

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4};
use kernel::{BezierSurface, KnotVector, Surface, regular_normal};

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
pub(super) struct Spread {
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

    /// A bound of the second directional derivative along `d`, which is a parameter step
    /// within a rectangle of the proportions `size`.
    ///
    /// Bounds along the three sides of a triangle are what [`Spread::triangle`] needs: the
    /// part that strays is a quadratic form in `d`.
    pub(super) fn bend(&self, d: DVec2, size: DVec2) -> f64 {
        let mean = self.duu.center * (d.x * d.x)
            + self.duv.center * (2.0 * d.x * d.y)
            + self.dvv.center * (d.y * d.y);
        let aspect = if size.x > 0.0 && size.y > 0.0 {
            size.y / size.x
        } else {
            1.0
        };
        let mixed = self.duv.radius * (aspect * d.x * d.x + d.y * d.y / aspect);
        mean.length() + self.duu.radius * d.x * d.x + mixed + self.dvv.radius * d.y * d.y
    }

    /// How far the surface over a triangle of the rectangle is from the flat triangle with
    /// the same corners, at the same parameters.
    ///
    /// With `l` the barycentric coordinates of a point, the distance there is at most half
    /// of the sum of `l_i l_j bend(p_i - p_j)` over the sides: Taylor's formula about the
    /// point, of which the constant part is an identity and the rest a quadratic form.
    pub(super) fn triangle(&self, [a, b, c]: [DVec2; 3], size: DVec2) -> f64 {
        let [x, y, z] = [a - b, b - c, c - a].map(|d| self.bend(d, size));
        let longest = x.max(y).max(z);
        let others = x + y + z - longest;
        if longest >= others {
            return longest / 8.0;
        }
        // The squared radius of the circle around a triangle with these squared sides.
        let area = 2.0 * (x * y + y * z + z * x) - x * x - y * y - z * z;
        0.5 * x * y * z / area
    }

    /// How far the surface over the segment along `d` is from the chord.
    pub(super) fn chord(&self, d: DVec2, size: DVec2) -> f64 {
        self.bend(d, size) / 8.0
    }
}

/// A rectangle of parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) min: DVec2,
    pub(super) max: DVec2,
}

impl Rect {
    /// The least rectangle around points.
    pub(super) fn around(points: impl IntoIterator<Item = DVec2>) -> Self {
        let empty = Self {
            min: DVec2::INFINITY,
            max: DVec2::NEG_INFINITY,
        };
        points.into_iter().fold(empty, |r, p| Self {
            min: r.min.min(p),
            max: r.max.max(p),
        })
    }

    pub(super) fn size(&self) -> DVec2 {
        self.max - self.min
    }

    pub(super) fn center(&self) -> DVec2 {
        self.min.midpoint(self.max)
    }
}

/// A surface with its Bézier pieces.
#[derive(Debug)]
pub(super) struct Pieces<'a> {
    pub(super) surface: &'a Surface,
    /// Borders of the pieces along u and v.
    breaks: [Vec<f64>; 2],
    /// Breaks inside the domain at which a first derivative jumps.
    pub(super) creases: [Vec<f64>; 2],
    list: Vec<Piece>,
}

#[derive(Debug)]
struct Piece {
    net: BezierSurface,
    spread: Spread,
}

impl<'a> Pieces<'a> {
    pub(super) fn new(surface: &'a Surface) -> Self {
        let list: Vec<Piece> = surface
            .bezier_pieces()
            .into_iter()
            .map(|net| Piece {
                spread: Net::of(&net).spread(net.u(), net.v()),
                net,
            })
            .collect();
        let breaks = [surface.knots_u().breaks(), surface.knots_v().breaks()];
        let mut pieces = Self {
            surface,
            breaks,
            creases: [Vec::new(), Vec::new()],
            list,
        };
        pieces.creases = [0, 1].map(|axis| pieces.find_creases(axis));
        pieces
    }

    pub(super) fn domain(&self) -> Rect {
        let ends = |k: usize| (self.breaks[k][0], self.breaks[k][self.breaks[k].len() - 1]);
        let ((u0, u1), (v0, v1)) = (ends(0), ends(1));
        Rect {
            min: DVec2::new(u0, v0),
            max: DVec2::new(u1, v1),
        }
    }

    fn columns(&self) -> usize {
        self.breaks[1].len() - 1
    }

    /// The numbers of the spans that meet `from..to` in more than a point, or the one that
    /// holds both.
    fn spans(&self, axis: usize, from: f64, to: f64) -> Range<usize> {
        let breaks = &self.breaks[axis];
        let last = breaks.len() - 2;
        let first = breaks[1..=last].partition_point(|&k| k <= from);
        let end = breaks[1..=last].partition_point(|&k| k < to).max(first);
        first..end + 1
    }

    /// Bounds over a rectangle inside the domain.
    pub(super) fn spread(&self, rect: &Rect) -> Spread {
        let mut all: Option<Spread> = None;
        for i in self.spans(0, rect.min.x, rect.max.x) {
            for j in self.spans(1, rect.min.y, rect.max.y) {
                let piece = &self.list[i * self.columns() + j];
                let (u, v) = (piece.net.u(), piece.net.v());
                let part_u = rect.min.x.max(u.start)..rect.max.x.min(u.end);
                let part_v = rect.min.y.max(v.start)..rect.max.y.min(v.end);
                let spread = if part_u == u && part_v == v {
                    piece.spread
                } else {
                    Net::of(&piece.net).restricted(&piece.net, part_u, part_v)
                };
                all = Some(all.map_or(spread, |all| all.union(spread)));
            }
        }
        all.unwrap_or_default()
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
        let piece = &self.list[i * self.columns() + j].net;
        let [du, dv] = Net::of(piece).corner_derivatives(piece, uv);
        regular_normal([du, dv], [0.0; 2]).or_else(|| self.surface.normal(uv.midpoint(inside)))
    }

    /// Whether the surface may have a crease at `uv`.
    pub(super) fn is_creased(&self, uv: DVec2) -> bool {
        (0..2).any(|axis| {
            let k = self.creases[axis].partition_point(|&k| k < uv[axis]);
            self.creases[axis].get(k).is_some_and(|&k| k <= uv[axis])
        })
    }

    /// The inner breaks where the first derivative across them is not the same on both sides.
    fn find_creases(&self, axis: usize) -> Vec<f64> {
        let knots: &KnotVector = [self.surface.knots_u(), self.surface.knots_v()][axis];
        let breaks = &self.breaks[axis];
        let inner = (1..breaks.len() - 1).filter(|&k| {
            knots.multiplicity(breaks[k]) >= knots.degree() && self.jumps(axis, k)
        });
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
                    let piece = &self.list[i * self.columns() + j].net;
                    Net::of(piece).corner_derivatives(piece, uv)[axis]
                };
                let (before, after) = (side(at - 1), side(at));
                before.distance(after) > SMOOTH * (before.length() + after.length())
            })
        })
    }
}

/// First derivatives that differ by this share are the same.
const SMOOTH: f64 = 1e-7;

/// The net of a piece, or of a part of it.
struct Net {
    p: usize,
    q: usize,
    points: Vec<DVec4>,
}

impl Net {
    fn of(piece: &BezierSurface) -> Self {
        Self {
            p: piece.degree_u(),
            q: piece.degree_v(),
            points: piece.homogeneous().to_vec(),
        }
    }

    /// Bounds over a part of the domain of `piece`, of which this is the net.
    fn restricted(mut self, piece: &BezierSurface, u: Range<f64>, v: Range<f64>) -> Spread {
        let [whole_u, whole_v] = [piece.u(), piece.v()];
        let share = |x: f64, r: &Range<f64>| ((x - r.start) / (r.end - r.start)).clamp(0.0, 1.0);
        let row = self.q + 1;
        let (a, b) = (share(u.start, &whole_u), share(u.end, &whole_u));
        for j in 0..row {
            cut(&mut self.points[j..], self.p, row, a, b);
        }
        let (c, d) = (share(v.start, &whole_v), share(v.end, &whole_v));
        for i in 0..=self.p {
            cut(&mut self.points[i * row..], self.q, 1, c, d);
        }
        // A part without width tells about its own direction only.
        let wide = |part: &Range<f64>, whole: &Range<f64>| {
            if part.start < part.end { part.clone() } else { whole.clone() }
        };
        let flat = [u.start >= u.end, v.start >= v.end];
        let mut spread = self.spread(wide(&u, &whole_u), wide(&v, &whole_v));
        if flat[0] {
            (spread.du, spread.duu, spread.duv) = Default::default();
        }
        if flat[1] {
            (spread.dv, spread.dvv, spread.duv) = Default::default();
        }
        spread
    }

    /// First derivatives along u and v at a point of the piece's domain, borders included.
    fn corner_derivatives(mut self, piece: &BezierSurface, uv: DVec2) -> [DVec3; 2] {
        let (u, v) = (piece.u(), piece.v());
        let row = self.q + 1;
        let share = |x: f64, r: &Range<f64>| ((x - r.start) / (r.end - r.start)).clamp(0.0, 1.0);
        // The part from the point to the farther end, whose first corner is the point.
        let (a, b) = (share(uv.x, &u), share(uv.y, &v));
        let (end_u, end_v) = (if a < 0.5 { 1.0 } else { 0.0 }, if b < 0.5 { 1.0 } else { 0.0 });
        for j in 0..row {
            cut(&mut self.points[j..], self.p, row, a.min(end_u), a.max(end_u));
        }
        for i in 0..=self.p {
            cut(&mut self.points[i * row..], self.q, 1, b.min(end_v), b.max(end_v));
        }
        let (i, step_u) = if end_u > a { (0, 1) } else { (self.p, -1) };
        let (j, step_v) = if end_v > b { (0, 1) } else { (self.q, -1) };
        let at = |i: usize, j: usize| self.points[i * row + j];
        let corner = at(i, j);
        let slope = |next: DVec4, degree: usize, step: i32, length: f64| {
            let difference = (next - corner) * (degree as f64 * f64::from(step) / length);
            (difference.truncate() - corner.truncate() / corner.w * difference.w) / corner.w
        };
        let next_u = at(i.wrapping_add_signed(step_u as isize), j);
        let next_v = at(i, j.wrapping_add_signed(step_v as isize));
        [
            slope(next_u, self.p, step_u, (end_u - a).abs() * (u.end - u.start)),
            slope(next_v, self.q, step_v, (end_v - b).abs() * (v.end - v.start)),
        ]
    }

    /// Bounds over all of the net, whose domain is given.
    ///
    /// With `S = X / w`, and `C`, `B`, `A` any constants near `S`, `Su`, `Suu`:
    /// `w (S - C) = X - C w`, `w (Su - B) = (Xu - B w - C wu) - wu (S - C)` and
    /// `w (Suu - A) = (Xuu - A w - 2 B wu - C wuu) - 2 wu (Su - B) - wuu (S - C)`; what
    /// stands in brackets is bounded by its Bernstein coefficients. Mixed ones alike.
    fn spread(&self, u: Range<f64>, v: Range<f64>) -> Spread {
        let (p, q) = (self.p, self.q);
        let (du, dv) = ((u.end - u.start).recip(), (v.end - v.start).recip());
        let along_u = |net: &[DVec4], degree| derivative(net, degree, q + 1, true, du);
        let along_v = |net: &[DVec4], degree| derivative(net, degree, q + 1, false, dv);
        let x = &self.points;
        let xu = along_u(x, p);
        let xv = along_v(x, q);
        let xuu = along_u(&xu, p);
        let xuv = along_v(&xu, q);
        let xvv = along_v(&xv, q);
        let w = |net: &[DVec4]| net.iter().fold(0.0, |m: f64, h| m.max(h.w.abs()));
        let least = x.iter().fold(f64::INFINITY, |m: f64, h| m.min(h.w));
        let mean = |net: &[DVec4]| middle(net, p, q);
        // Constants: the values in the middle.
        let m = [x, &xu, &xv, &xuu, &xuv, &xvv].map(|net| mean(net));
        let weight = m[0].w.recip();
        let s = m[0].truncate() * weight;
        let su = (m[1].truncate() - s * m[1].w) * weight;
        let sv = (m[2].truncate() - s * m[2].w) * weight;
        let suu = (m[3].truncate() - su * (2.0 * m[1].w) - s * m[3].w) * weight;
        let suv = (m[4].truncate() - sv * m[1].w - su * m[2].w - s * m[4].w) * weight;
        let svv = (m[5].truncate() - sv * (2.0 * m[2].w) - s * m[5].w) * weight;
        let bracket = |terms: &[(&[DVec4], DVec3, f64)], top: &[DVec4]| {
            (0..x.len()).fold(0.0, |most: f64, k| {
                let rest = terms
                    .iter()
                    .fold(top[k].truncate(), |sum, (net, constant, factor)| {
                        sum - *constant * (net[k].w * factor)
                    });
                most.max(rest.length())
            })
        };
        let rs = bracket(&[(x, s, 1.0)], x) / least;
        let ru = (bracket(&[(x, su, 1.0), (&xu, s, 1.0)], &xu) + w(&xu) * rs) / least;
        let rv = (bracket(&[(x, sv, 1.0), (&xv, s, 1.0)], &xv) + w(&xv) * rs) / least;
        let ruu = bracket(&[(x, suu, 1.0), (&xu, su, 2.0), (&xuu, s, 1.0)], &xuu);
        let rvv = bracket(&[(x, svv, 1.0), (&xv, sv, 2.0), (&xvv, s, 1.0)], &xvv);
        let terms: [(&[DVec4], DVec3, f64); 4] =
            [(x, suv, 1.0), (&xu, sv, 1.0), (&xv, su, 1.0), (&xuv, s, 1.0)];
        let ruv = bracket(&terms, &xuv);
        let ball = |center, radius| Ball { center, radius };
        Spread {
            du: ball(su, ru),
            dv: ball(sv, rv),
            duu: ball(suu, (ruu + 2.0 * w(&xu) * ru + w(&xuu) * rs) / least),
            duv: ball(suv, (ruv + w(&xu) * rv + w(&xv) * ru + w(&xuv) * rs) / least),
            dvv: ball(svv, (rvv + 2.0 * w(&xv) * rv + w(&xvv) * rs) / least),
        }
    }
}

/// The derivative of a net along one parameter, at the degree of the net: differences, with
/// the degree raised again.
fn derivative(net: &[DVec4], degree: usize, row: usize, along_u: bool, scale: f64) -> Vec<DVec4> {
    let n = degree as f64;
    let stride = if along_u { row } else { 1 };
    let place = |k: usize| if along_u { k / row } else { k % row };
    let value = |k: usize| {
        let i = place(k);
        let mut sum = DVec4::ZERO;
        if i > 0 {
            sum += (net[k] - net[k - stride]) * (i as f64 / n);
        }
        if i < degree {
            sum += (net[k + stride] - net[k]) * ((degree - i) as f64 / n);
        }
        sum * (n * scale)
    };
    (0..net.len()).map(value).collect()
}

/// The value of a net in the middle of its domain.
fn middle(net: &[DVec4], p: usize, q: usize) -> DVec4 {
    let halved = |degree: usize, get: &dyn Fn(usize) -> DVec4| {
        let mut share = 0.5_f64.powi(i32::try_from(degree).unwrap_or(i32::MAX));
        (0..=degree).fold(DVec4::ZERO, |sum, k| {
            let term = get(k) * share;
            share *= (degree - k) as f64 / (k + 1) as f64;
            sum + term
        })
    };
    halved(p, &|i| halved(q, &|j| net[i * (q + 1) + j]))
}

/// Every `stride`-th point becomes those of the part between `from` and `to`.
fn cut(points: &mut [DVec4], degree: usize, stride: usize, from: f64, to: f64) {
    if to < 1.0 {
        for level in 1..=degree {
            for k in (level..=degree).rev() {
                points[k * stride] = points[(k - 1) * stride].lerp(points[k * stride], to);
            }
        }
    }
    let from = if to > 0.0 { from / to } else { 0.0 };
    if from > 0.0 {
        for level in 1..=degree {
            for k in 0..=degree - level {
                points[k * stride] = points[k * stride].lerp(points[(k + 1) * stride], from);
            }
        }
    }
}
