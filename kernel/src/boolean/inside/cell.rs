//! Nearly flat parts of faces, and where lines meet them.

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4};

use crate::bernstein::basis;
use crate::{Aabb, BezierSurface, MAX_DEGREE, Ray};

/// Cells whose derivatives stray no more from those in the middle are flat enough.
const FLAT: f64 = 0.3;

/// As seen along a line derivatives stray less, or it cannot be told how often it meets a cell.
const UNIQUE: f64 = 0.75;

/// A line that is uncertain by more than this share of a cell is not told where it meets it.
const WIDE: f64 = 0.1;

/// Derivatives that stray no more are the same: the cell is a parallelogram.
const STRAIGHT: f64 = 1e-13;

/// Parameters of a cell are as exact as this.
const EXACT: f64 = 1e-12;

/// Rounding errors of a distance, as a share of how far away the cell is.
const ROUNDING: f64 = 1e-15;

/// Steps of the iteration.
const STEPS: usize = 24;

/// A line may be moved by this share of how far it may be moved elsewhere, if a cell has no border.
const INNER: f64 = 1e-3;

/// Control points of a row of usual degrees, and of any.
const FEW: usize = 4;
const ALL: usize = MAX_DEGREE + 1;

/// A part of a Bézier piece, with parameters from 0 to 1 of its own.
#[derive(Debug)]
pub(super) struct Cell {
    /// The number of the face.
    pub(super) face: usize,
    /// The parameters of the surface where its own are 0, and their lengths.
    pub(super) start: DVec2,
    pub(super) size: DVec2,
    /// For both parameters whether their start and end is a border of the surface.
    pub(super) borders: [[bool; 2]; 2],
    /// Whether all of it belongs to the face.
    pub(super) is_whole: bool,
    degrees: [usize; 2],
    /// Homogeneous control points about the middle, whose weight is one.
    net: Vec<DVec4>,
    middle: DVec3,
    /// What gives coordinates along both derivatives in the middle and along the normal there.
    rows: [DVec3; 3],
    /// The range of these coordinates of control points.
    low: DVec3,
    high: DVec3,
    /// How far derivatives stray from those in the middle: in the plane of these, and out of it.
    stray: f64,
    lift: f64,
}

/// A line and a cell.
#[derive(Clone, Copy, Debug)]
pub(super) enum Meeting {
    /// They are apart.
    Apart,
    /// They meet once.
    Once(Place),
    /// They may meet more than once, or cannot be told apart.
    Vague,
}

/// Where a line meets a cell, or what it is prolonged to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Parameters of the cell.
    pub(super) at: DVec2,
    /// How uncertain they are if the line is moved as far as it may be.
    pub(super) margin: DVec2,
    /// The parameter of the line.
    pub(super) t: f64,
}

impl Cell {
    /// A cell of that face.
    pub(super) fn new(face: usize, piece: &BezierSurface) -> Self {
        let (u, v) = (piece.u(), piece.v());
        let length = |range: &Range<f64>| range.end - range.start;
        let degrees = [piece.degree_u(), piece.degree_v()];
        let [h, hu, hv] = mixed(degrees, piece.homogeneous(), DVec2::splat(0.5));
        let middle = h.truncate() / h.w;
        let slopes = [hu, hv].map(|d| (d.truncate() - middle * d.w) / h.w);
        let moved = |p: &DVec4| (p.truncate() - middle * p.w).extend(p.w) / h.w;
        let frame = dual(slopes);
        let mut cell = Self {
            face,
            start: DVec2::new(u.start, v.start),
            size: DVec2::new(length(&u), length(&v)),
            borders: [[false; 2]; 2],
            is_whole: false,
            degrees,
            net: piece.homogeneous().iter().map(moved).collect(),
            middle,
            rows: frame.unwrap_or([DVec3::X, DVec3::Y, DVec3::Z]),
            low: DVec3::INFINITY,
            high: DVec3::NEG_INFINITY,
            stray: f64::INFINITY,
            lift: f64::INFINITY,
        };
        for p in &cell.net {
            let x = cell.coordinates(p.truncate() / p.w);
            (cell.low, cell.high) = (cell.low.min(x), cell.high.max(x));
        }
        if frame.is_some() {
            let strays = cell.strays();
            cell.stray = strays[0].max(strays[1]);
            cell.lift = strays[2];
        }
        cell
    }

    /// Whether it need not be divided.
    pub(super) fn is_flat(&self) -> bool {
        self.stray.max(self.lift) <= FLAT
    }

    /// How far derivatives stray from those in the middle.
    pub(super) fn unevenness(&self) -> f64 {
        self.stray.max(self.lift)
    }

    /// A box around it.
    pub(super) fn bounds(&self) -> Aabb {
        let points = self.net.iter().map(|p| p.truncate() / p.w);
        Aabb::around(points.map(|p| p + self.middle))
    }

    /// The parameters of the surface there.
    pub(super) fn parameters(&self, at: DVec2) -> DVec2 {
        self.start + self.size * at
    }

    /// Whether a point is in the box along the derivatives, or no farther than `near` from it.
    pub(super) fn is_around(&self, point: DVec3, near: f64) -> bool {
        let x = self.coordinates(point - self.middle);
        let pad = self.pad(near);
        (self.low - pad).cmple(x).all() && x.cmple(self.high + pad).all()
    }

    /// The unit normal in the middle, if lines along it meet the cell once.
    pub(super) fn normal(&self) -> Option<DVec3> {
        (self.stray < UNIQUE).then(|| self.rows[2].normalize())
    }

    fn coordinates(&self, x: DVec3) -> DVec3 {
        DVec3::from(self.rows.map(|row| row.dot(x)))
    }

    /// How much coordinates of points that are `near` to each other differ.
    fn pad(&self, near: f64) -> DVec3 {
        DVec3::from(self.rows.map(DVec3::length)) * near
    }

    /// For each coordinate how far its derivatives stray from those in the middle: the sum along both
    /// parameters, where it is greatest. What is derived is the distance from a line through the box.
    fn strays(&self) -> [f64; 3] {
        let [p, q] = self.degrees;
        let row = q + 1;
        let mut most = [[0.0_f64; 3]; 2];
        let reach = self.low.abs().max(self.high.abs());
        for (k, most) in most.iter_mut().enumerate() {
            let (step, degree) = [(row, p), (1, q)][k];
            for i in 0..=p - (1 - k) {
                for j in 0..=q - k {
                    let here = i * row + j;
                    let slope = (self.net[here + step] - self.net[here]) * degree as f64;
                    for axis in 0..3 {
                        let own = f64::from(u8::from(axis == k));
                        let off = (self.rows[axis].dot(slope.truncate()) - own).abs()
                            + reach[axis] * slope.w.abs();
                        most[axis] = most[axis].max(off);
                    }
                }
            }
        }
        std::array::from_fn(|axis| most[0][axis] + most[1][axis])
    }

    /// Where a line meets the cell, which is prolonged as far as it may be met if the line is moved by `near`. Where
    /// that is vague, only what is ahead counts.
    pub(super) fn meet(&self, line: &Ray, near: f64) -> Meeting {
        let origin = line.origin - self.middle;
        let (a, g) = (self.coordinates(origin), self.coordinates(line.direction));
        let tilt = [g.x / g.z, g.y / g.z];
        let stray = self.stray + tilt[0].abs().max(tilt[1].abs()) * self.lift;
        let rows = [0, 1].map(|k| self.rows[k] - self.rows[2] * tilt[k]);
        let margin = DVec2::new(rows[0].length(), rows[1].length()) * near / (1.0 - stray);
        // Also if it is not a number.
        let is_clear = stray < UNIQUE && margin.max_element() < WIDE;
        if !is_clear {
            return self.passed(a, g, near);
        }
        let offset = DVec2::new(a.x - tilt[0] * a.z, a.y - tilt[1] * a.z);
        if self.stray + self.lift < STRAIGHT {
            let is_far = offset.abs().cmpgt(margin + 0.5).any();
            return if is_far {
                Meeting::Apart
            } else {
                Meeting::Once(Place {
                    at: offset + 0.5,
                    margin,
                    t: -a.z / g.z,
                })
            };
        }
        let exact = EXACT + ROUNDING * origin.length() * (margin / near).max_element();
        let seen = Seen {
            cell: self,
            rows,
            offset,
            stray,
            margin,
            exact,
        };
        match seen.solve() {
            Solution::None => Meeting::Apart,
            Solution::Open => self.passed(a, g, near),
            Solution::At(at) => {
                let [h, ..] = mixed(self.degrees, &self.net, at);
                let t = (h.truncate() / h.w - origin).dot(line.direction);
                Meeting::Once(Place { at, margin, t })
            }
        }
    }

    /// Whether a line passes the box along the derivatives, by its start and direction in coordinates.
    fn passed(&self, a: DVec3, g: DVec3, near: f64) -> Meeting {
        // Beyond joints the face goes on in other cells.
        let has_border = !self.is_whole || self.borders.as_flattened().contains(&true);
        let near = if has_border { near } else { near * INNER };
        let pad = self.pad(near);
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for k in 0..3 {
            let (low, high) = (self.low[k] - pad[k] - a[k], self.high[k] + pad[k] - a[k]);
            if g[k].abs() < f64::MIN_POSITIVE {
                if low > 0.0 || high < 0.0 {
                    return Meeting::Apart;
                }
                continue;
            }
            let (s, t) = (low / g[k], high / g[k]);
            (enter, leave) = (enter.max(s.min(t)), leave.min(s.max(t)));
        }
        if enter > leave {
            Meeting::Apart
        } else {
            Meeting::Vague
        }
    }
}

/// A cell as seen along a line that meets it once at most.
struct Seen<'a> {
    cell: &'a Cell,
    /// What gives coordinates along the derivatives, seen along the line.
    rows: [DVec3; 2],
    /// Those of the line.
    offset: DVec2,
    stray: f64,
    margin: DVec2,
    exact: f64,
}

/// Where distances from a line are zero.
enum Solution {
    None,
    At(DVec2),
    /// The iteration was too slow to tell.
    Open,
}

impl Seen<'_> {
    /// The only root. With distances `x + rest(x)` and a rest that contracts by `q`, it lies within
    /// `q / (1 - q)` times the distances from `x` less these.
    fn solve(&self) -> Solution {
        let reach = self.stray / (1.0 - self.stray);
        let most = self.margin + 0.5 + self.exact;
        let clamp = |x: DVec2| x.clamp(DVec2::ZERO - self.margin, DVec2::ONE + self.margin);
        // In the middle there is nothing to be mixed.
        let (mut x, mut distance) = (DVec2::splat(0.5), -self.offset);
        let mut step = distance;
        for _ in 0..STEPS {
            let residual = distance.abs().max_element();
            let sure = x - distance;
            if (sure - 0.5).abs().cmpgt(most + reach * residual).any() {
                return Solution::None;
            }
            if residual <= self.exact {
                let is_in = (sure - 0.5).abs().cmple(most).all();
                return if is_in {
                    Solution::At(sure)
                } else {
                    Solution::None
                };
            }
            // Had there been a root, the sure step would go on towards it.
            let moved = (clamp(sure) - x).abs().max_element();
            if moved * (1.0 + self.stray) < residual * (1.0 - self.stray) {
                return Solution::None;
            }
            let next = clamp(x - step);
            let is_held = (next - (x - step)).abs().max_element() > 0.0;
            x = if is_held { clamp(sure) } else { next };
            let [h, hu, hv] = mixed(self.cell.degrees, &self.cell.net, x);
            distance = self.distances(h);
            let (du, dv) = (self.distances(hu), self.distances(hv));
            // Not zero where derivatives stray by less than one.
            let area = du.perp_dot(dv);
            step = DVec2::new(distance.perp_dot(dv), du.perp_dot(distance)) / area;
        }
        Solution::Open
    }

    /// Distances from the line, times the weight.
    fn distances(&self, h: DVec4) -> DVec2 {
        let x = h.truncate();
        DVec2::new(self.rows[0].dot(x), self.rows[1].dot(x)) - self.offset * h.w
    }
}

/// Vectors whose products with the given two are one and zero, and a normal to both; `None` if they are parallel.
fn dual([du, dv]: [DVec3; 2]) -> Option<[DVec3; 3]> {
    let normal = du.normalize_or_zero().cross(dv.normalize_or_zero());
    if normal.length() < 1e-6 {
        return None;
    }
    let normal = normal.normalize();
    let (across_u, across_v) = (dv.cross(normal), normal.cross(du));
    let size = du.length().max(dv.length());
    Some([
        across_u / du.dot(across_u),
        across_v / dv.dot(across_v),
        normal / size,
    ])
}

/// A point of a net and its derivatives along u and v, all homogeneous.
#[inline]
fn mixed(degrees: [usize; 2], net: &[DVec4], at: DVec2) -> [DVec4; 3] {
    match degrees {
        [1, 1] => mixed_in::<2>([1, 1], net, at),
        [2, 1] => mixed_in::<3>([2, 1], net, at),
        [2, 2] => mixed_in::<3>([2, 2], net, at),
        [3, 3] => mixed_in::<4>([3, 3], net, at),
        [p, q] if p.max(q) < FEW => mixed_in::<FEW>([p, q], net, at),
        _ => mixed_in::<ALL>(degrees, net, at),
    }
}

#[inline(always)]
fn mixed_in<const N: usize>([p, q]: [usize; 2], net: &[DVec4], at: DVec2) -> [DVec4; 3] {
    let (along_u, slopes_u) = basis::<N>(p, at.x);
    let (along_v, slopes_v) = basis::<N>(q, at.y);
    let mut sums = [DVec4::ZERO; 3];
    for (i, row) in net.chunks_exact(q + 1).enumerate().take(p + 1) {
        let (mut point, mut slope) = (DVec4::ZERO, DVec4::ZERO);
        for (j, &h) in row.iter().enumerate() {
            point += h * along_v[j];
            slope += h * slopes_v[j];
        }
        sums[0] += point * along_u[i];
        sums[1] += point * slopes_u[i];
        sums[2] += slope * along_u[i];
    }
    sums
}
