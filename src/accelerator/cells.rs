//! Bézier pieces in their own units, and the cells they are divided into.

use std::ops::Range;

use glam::{DMat3, DVec3, DVec4};
use kernel::{Aabb, BezierSurface, Cover, TrimRegion};

use crate::intersect::PieceNet;
use crate::intersect::Rect;
use crate::intersect::net::{self, Degrees};

/// Halvings of a piece along one direction at most.
const MAX_LEVEL: u8 = 5;

/// A cell is divided while its derivatives stray from those in its middle by more than this,
/// along the surface; then two cells or three share the rays of a piece.
const UNEVEN: f64 = 0.3;

/// As [`UNEVEN`], across the surface: the tangent of the angle that the normals fill.
const CURVED: f64 = 0.35;

/// Further halvings of cells through which a trim loop passes: two along each direction.
const TRIM_HALVINGS: u8 = 4;

/// Below this sine two derivatives give no frame.
const DEGENERATE: f64 = 1e-6;

/// A Bézier piece: the place of its net, and where it belongs.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// First point of its net.
    first: usize,
    pub(crate) degrees: Degrees,
    /// The item of the cluster that it is part of.
    pub(crate) item: u32,
    /// Middle of its unit ball in the cluster.
    pub(crate) center: DVec3,
    /// Radius of its unit ball in the cluster.
    pub(crate) radius: f64,
    /// The part of the patch's domain: start and length along u and v.
    pub(crate) u: (f64, f64),
    pub(crate) v: (f64, f64),
}

/// A dyadic part of a piece: numerators and halvings along u and v.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cell {
    pub(crate) piece: u32,
    place: [u8; 2],
    level: [u8; 2],
    /// Whether a trim loop passes through it, so that points have to be tested.
    pub(crate) is_trimmed: bool,
}

impl Cell {
    /// The cell in local parameters of its piece.
    pub(crate) fn rect(&self) -> Rect {
        let side = |axis: usize| {
            let size = f64::from(1_u32 << self.level[axis]).recip();
            let start = f64::from(self.place[axis]) * size;
            (start, start + size)
        };
        Rect {
            u: side(0),
            v: side(1),
        }
    }
}

/// The surface of a cell seen from its middle: `S(s, t) = center + a s + b t + rest` with `s`
/// and `t` from -1 to 1, in the coordinates of the cluster.
///
/// `rows` invert the matrix of `a`, `b` and a normal; `stray` bounds the sums of the
/// derivatives of the rest along each of these three.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellFrame {
    pub(crate) center: DVec3,
    pub(crate) rows: [DVec3; 3],
    pub(crate) stray: [f64; 3],
}

impl CellFrame {
    /// A frame that says nothing: every test against it passes.
    const UNKNOWN: Self = Self {
        center: DVec3::ZERO,
        rows: [DVec3::ZERO; 3],
        stray: [f64::INFINITY; 3],
    };
}

/// All pieces and cells of a cluster.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pieces {
    pub(crate) pieces: Vec<Piece>,
    nets: Vec<[f64; 4]>,
}

/// A cell while the hierarchy is built.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NewCell {
    pub(crate) cell: Cell,
    pub(crate) frame: CellFrame,
    pub(crate) bounds: Aabb,
}

impl Pieces {
    /// Adds a piece of item number `item`, and its cells to `cells`.
    ///
    /// A piece that is no more than a point has nothing to hit and is left out, and so are
    /// cells outside of `trims`.
    pub(crate) fn add(
        &mut self,
        piece: &BezierSurface,
        item: u32,
        trims: Option<&TrimRegion>,
        cells: &mut Vec<NewCell>,
    ) {
        let hull = piece.hull_bounds();
        let (center, radius) = (hull.center(), hull.diagonal() * 0.5);
        if radius <= 0.0 || radius.is_nan() {
            return;
        }
        let degrees = Degrees {
            p: piece.degree_u(),
            q: piece.degree_v(),
        };
        let heaviest = piece
            .homogeneous()
            .iter()
            .fold(0.0, |max: f64, h| max.max(h.w));
        // Into the units of the piece.
        let own = |h: &DVec4| {
            let numerator = (h.truncate() - center * h.w) / radius;
            (numerator.extend(h.w) / heaviest).to_array()
        };
        let first = self.nets.len();
        self.nets.extend(piece.homogeneous().iter().map(own));
        let number = u32::try_from(self.pieces.len()).expect("fewer pieces than fit");
        let (u, v) = (piece.u(), piece.v());
        self.pieces.push(Piece {
            first,
            degrees,
            item,
            center,
            radius,
            u: (u.start, u.end - u.start),
            v: (v.start, v.end - v.start),
        });
        let cell = Cell {
            piece: number,
            ..Cell::default()
        };
        let mut net = self.nets[first..].to_vec();
        let divider = Divider {
            degrees,
            center,
            radius,
            u: piece.u(),
            v: piece.v(),
        };
        let trims = trims.map(|t| (t, TRIM_HALVINGS));
        divider.divide(&mut net, cell, trims, cells);
    }

    /// The net of a piece.
    pub(crate) fn net(&self, piece: &Piece) -> PieceNet<'_> {
        PieceNet {
            degrees: piece.degrees,
            points: &self.nets[piece.first..piece.first + piece.degrees.len()],
        }
    }

    /// Memory in use.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&self.pieces[..]) + size_of_val(&self.nets[..])
    }
}

/// Divides a piece into cells.
struct Divider {
    degrees: Degrees,
    /// From the units of the piece to the cluster.
    center: DVec3,
    radius: f64,
    /// The part of the patch's domain.
    u: Range<f64>,
    v: Range<f64>,
}

impl Divider {
    /// Divides a cell until it is nearly flat and evenly parametrised, and further, by the
    /// number beside `trims`, where a loop passes. `net` is the part of the piece in its own
    /// units.
    fn divide(
        &self,
        net: &mut [[f64; 4]],
        mut cell: Cell,
        trims: Option<(&TrimRegion, u8)>,
        cells: &mut Vec<NewCell>,
    ) {
        let cover = trims.map_or(Cover::Inside, |(region, _)| {
            let rect = cell.rect();
            let part = |domain: &Range<f64>, (a, b): (f64, f64)| {
                let length = domain.end - domain.start;
                domain.start + length * a..domain.start + length * b
            };
            region.classify(part(&self.u, rect.u), part(&self.v, rect.v))
        });
        if cover == Cover::Outside {
            return;
        }
        let mut trims = trims.filter(|_| cover == Cover::Mixed);
        cell.is_trimmed = trims.is_some();
        let local = examine(net, self.degrees);
        let mut axis = usize::from(local.cut_v);
        if cell.level[axis] >= MAX_LEVEL {
            axis = 1 - axis;
        }
        let [k1, k2, k3] = local.frame.stray;
        let excess = (k1.max(k2) / UNEVEN).max(k3 / CURVED);
        if excess <= 1.0 || cell.level[axis] >= MAX_LEVEL {
            match &mut trims {
                Some((_, halvings @ 1..)) => {
                    axis = usize::from(*halvings % 2 == 1);
                    *halvings -= 1;
                }
                _ => {
                    cells.push(self.finished(net, cell, &local.frame));
                    return;
                }
            }
        }
        let mut behind = net.to_vec();
        if axis == 0 {
            net::split_u(net, &mut behind, self.degrees, 0.5);
        } else {
            net::split_v(net, &mut behind, self.degrees, 0.5);
        }
        for (half, net) in [(0, net), (1, &mut behind[..])] {
            let mut child = cell;
            child.level[axis] += 1;
            child.place[axis] = 2 * cell.place[axis] + half;
            self.divide(net, child, trims, cells);
        }
    }

    /// A cell in the coordinates of the cluster.
    fn finished(&self, net: &[[f64; 4]], cell: Cell, frame: &CellFrame) -> NewCell {
        let place = |p: DVec3| p * self.radius + self.center;
        let points = net
            .iter()
            .map(|h| place(DVec3::new(h[0], h[1], h[2]) / h[3]));
        NewCell {
            cell,
            frame: CellFrame {
                center: place(frame.center),
                rows: frame.rows.map(|row| row / self.radius),
                stray: frame.stray,
            },
            bounds: Aabb::around(points),
        }
    }
}

/// What is known about a part of a piece.
struct Examined {
    frame: CellFrame,
    /// Whether a cut along v would make it more even than one along u.
    cut_v: bool,
}

/// Derives the frame of a part, and bounds how far the part strays from it.
fn examine(net: &[[f64; 4]], degrees: Degrees) -> Examined {
    let [x, xu, xv] = net::evaluate4(net, degrees, &net::HALF[degrees.p], &net::HALF[degrees.q]);
    let center = x.truncate() / x.w;
    let along = |d: DVec4| (d.truncate() - center * d.w) / x.w * 0.5;
    let (a, b) = (along(xu), along(xv));
    let (length_a, length_b) = (a.length(), b.length());
    let normal = a.cross(b);
    let steps = Steps::of(net, degrees, center);
    if normal.length() <= DEGENERATE * length_a * length_b || length_a * length_b <= 0.0 {
        let [u, v] = steps.sizes();
        return Examined {
            frame: CellFrame {
                center,
                ..CellFrame::UNKNOWN
            },
            cut_v: v > u,
        };
    }
    let normal = normal.normalize() * (0.5 * (length_a + length_b));
    let inverse = DMat3::from_cols(a, b, normal).inverse().transpose();
    // The rows are kept in single precision; the bounds hold for what is kept.
    let rows = [inverse.x_axis, inverse.y_axis, inverse.z_axis].map(|r| r.as_vec3().as_dvec3());
    let strays = [0, 1, 2].map(|k| {
        let along = |axis: usize| if axis == k { 1.0 } else { 0.0 };
        steps.stray(rows[k], [along(0), along(1)])
    });
    let stray = strays.map(|s| s.along_u + s.along_v);
    // The row that strays most says where to cut. Rows shrink with the derivative that they
    // invert: what is measured by the one along u is not lessened by cutting along u, unless
    // it is the square of that.
    let limits = [UNEVEN, UNEVEN, CURVED];
    let worst = (0..3)
        .max_by(|&a, &b| (stray[a] / limits[a]).total_cmp(&(stray[b] / limits[b])))
        .unwrap_or(0);
    let Stray { uu, uv, vv, .. } = strays[worst];
    let cut_v = match worst {
        0 => uv.max(vv) > uu,
        1 => vv > uv.max(uu),
        _ => vv > uu,
    };
    Examined {
        frame: CellFrame {
            center,
            rows,
            stray,
        },
        cut_v,
    }
}

/// Derivative nets of a part, by parameters from -1 to 1.
struct Steps {
    degrees: Degrees,
    along_u: Vec<DVec4>,
    along_v: Vec<DVec4>,
    /// Control points relative to the middle, and their weights.
    points: Vec<DVec4>,
    least_weight: f64,
    rational: bool,
}

/// How far the derivatives along one row of the frame stray.
#[derive(Clone, Copy)]
struct Stray {
    along_u: f64,
    along_v: f64,
    /// The largest changes between neighbours: of the derivative along u in its own
    /// direction, of either derivative in the other direction, of the one along v in its own.
    uu: f64,
    uv: f64,
    vv: f64,
}

impl Steps {
    fn of(net: &[[f64; 4]], degrees: Degrees, center: DVec3) -> Self {
        let row = degrees.q + 1;
        let relative = |h: &[f64; 4]| {
            let h = DVec4::from_array(*h);
            (h.truncate() - center * h.w).extend(h.w)
        };
        let points: Vec<DVec4> = net.iter().map(relative).collect();
        let (p, q) = (degrees.p as f64 * 0.5, degrees.q as f64 * 0.5);
        let along_u = points
            .iter()
            .zip(&points[row..])
            .map(|(a, b)| (*b - *a) * p)
            .collect();
        let along_v = points
            .chunks_exact(row)
            .flat_map(|line| line.windows(2))
            .map(|pair| (pair[1] - pair[0]) * q)
            .collect();
        let (least, most) = points.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), h| {
            (a.min(h.w), b.max(h.w))
        });
        Self {
            degrees,
            along_u,
            along_v,
            points,
            least_weight: least,
            rational: most > least,
        }
    }

    /// The largest steps along u and along v.
    fn sizes(&self) -> [f64; 2] {
        let most = |steps: &[DVec4]| steps.iter().fold(0.0, |m: f64, s| m.max(s.length()));
        [most(&self.along_u), most(&self.along_v)]
    }

    /// Bounds `|row . S_u - expected u| + |row . S_v - expected v|` over the part.
    fn stray(&self, row: DVec3, expected: [f64; 2]) -> Stray {
        let lines = [self.degrees.q + 1, self.degrees.q];
        let mut bounds = [0.0_f64; 2];
        let mut changes = [[0.0_f64; 2]; 2];
        for axis in 0..2 {
            let steps = if axis == 0 {
                &self.along_u
            } else {
                &self.along_v
            };
            // With weights the derivative is (X' - S w') / w; what w' contributes is bounded
            // apart, and the rest is a spread of X' - expected w, one degree lower in effect.
            let value = |s: &DVec4| row.dot(s.truncate());
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for s in steps {
                let x = value(s);
                (low, high) = (low.min(x), high.max(x));
            }
            bounds[axis] = if self.rational {
                self.rational_bound(row, steps, (low, high), expected[axis])
            } else {
                let w = self.least_weight;
                (high / w - expected[axis])
                    .abs()
                    .max((low / w - expected[axis]).abs())
            };
            for (index, s) in steps.iter().enumerate() {
                let (i, j) = (index / lines[axis], index % lines[axis]);
                if i > 0 {
                    let change = (value(s) - value(&steps[index - lines[axis]])).abs();
                    changes[axis][0] = changes[axis][0].max(change);
                }
                if j > 0 {
                    let change = (value(s) - value(&steps[index - 1])).abs();
                    changes[axis][1] = changes[axis][1].max(change);
                }
            }
        }
        Stray {
            along_u: bounds[0],
            along_v: bounds[1],
            uu: changes[0][0],
            uv: changes[0][1].max(changes[1][0]),
            vv: changes[1][1],
        }
    }

    /// Bound for a derivative `(X' - S w') / w` against `expected`.
    ///
    /// `X'` has its hull in `low..high` and `w` lies between the least and greatest weight;
    /// both are hulls of polynomials, whatever their degrees.
    fn rational_bound(
        &self,
        row: DVec3,
        steps: &[DVec4],
        (low, high): (f64, f64),
        expected: f64,
    ) -> f64 {
        let greatest = self.points.iter().fold(0.0, |m: f64, h| m.max(h.w));
        let least = self.least_weight;
        let reach = self
            .points
            .iter()
            .fold(0.0, |m: f64, h| m.max((row.dot(h.truncate()) / h.w).abs()));
        let change = steps.iter().fold(0.0, |m: f64, s| m.max(s.w.abs()));
        // X' - expected w over the part, then divided by w.
        let above = high - expected * least;
        let below = low - expected * greatest;
        (above.abs().max(below.abs()) + reach * change) / least
    }
}
