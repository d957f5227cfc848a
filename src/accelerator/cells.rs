//! Bézier pieces in their own units, and the cells they are divided into.

use glam::{DVec3, DVec4};
use kernel::{Aabb, BezierSurface, Cover, TrimRegion};

use crate::intersect::net::Degrees;
use crate::intersect::{PieceNet, Rect};

/// Halvings of a piece along one direction at most: cells are eighths of eighths.
const MAX_LEVEL: u8 = 3;

/// How far the derivatives of a cell may stray from those in its middle, relative to these.
const FLAT: f64 = 0.6;

/// Further halvings of cells through which a trim loop passes: two along each direction.
const TRIM_HALVINGS: u8 = 4;

/// A Bézier piece: the place of its nets, and where it belongs.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// First coefficient of its four nets.
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
#[derive(Clone, Copy, Debug)]
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

/// All pieces and cells of a cluster.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pieces {
    pub(crate) pieces: Vec<Piece>,
    pub(crate) cells: Vec<Cell>,
    nets: Vec<f64>,
}

impl Pieces {
    /// Adds a piece of item number `item`, and the boxes of its cells to `boxes`.
    ///
    /// A piece that is no more than a point has nothing to hit and is left out.
    /// Cells outside of `trims` are left out.
    pub(crate) fn add(
        &mut self,
        piece: &BezierSurface,
        item: u32,
        trims: Option<&TrimRegion>,
        boxes: &mut Vec<Aabb>,
    ) {
        let hull = piece.hull_bounds();
        let (center, radius) = (hull.center(), hull.diagonal() * 0.5);
        if !(radius > 0.0) {
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
            numerator.extend(h.w) / heaviest
        };
        let net: Vec<DVec4> = piece.homogeneous().iter().map(own).collect();
        let first = self.nets.len();
        for axis in 0..4 {
            self.nets.extend(net.iter().map(|h| h[axis]));
        }
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
            place: [0, 0],
            level: [0, 0],
            is_trimmed: false,
        };
        self.divide(piece, cell, trims.map(|t| (t, TRIM_HALVINGS)), boxes);
    }

    /// Divides a cell until it is nearly flat and evenly parametrised, and further, by the
    /// number beside `trims`, where a loop passes.
    fn divide(
        &mut self,
        part: &BezierSurface,
        mut cell: Cell,
        trims: Option<(&TrimRegion, u8)>,
        boxes: &mut Vec<Aabb>,
    ) {
        let classify = |(region, _): (&TrimRegion, _)| region.classify(part.u(), part.v());
        let cover = trims.map_or(Cover::Inside, classify);
        let mut trims = trims.filter(|_| cover == Cover::Mixed);
        cell.is_trimmed = trims.is_some();
        if cover == Cover::Outside {
            return;
        }
        let stray = stray(part);
        let axis = usize::from(stray[1] > stray[0]);
        let mut axis = if cell.level[axis] < MAX_LEVEL {
            axis
        } else {
            1 - axis
        };
        if stray[axis] <= FLAT || cell.level[axis] >= MAX_LEVEL {
            match &mut trims {
                Some((_, halvings @ 1..)) => {
                    axis = usize::from(*halvings % 2 == 1);
                    *halvings -= 1;
                }
                _ => {
                    boxes.push(part.hull_bounds());
                    self.cells.push(cell);
                    return;
                }
            }
        }
        let halves = if axis == 0 {
            part.split_u(0.5)
        } else {
            part.split_v(0.5)
        };
        for (k, half) in halves.iter().enumerate() {
            let mut child = cell;
            child.level[axis] += 1;
            child.place[axis] = 2 * cell.place[axis] + u8::from(k == 1);
            self.divide(half, child, trims, boxes);
        }
    }

    /// The nets of a piece.
    pub(crate) fn net(&self, piece: &Piece) -> PieceNet<'_> {
        let size = piece.degrees.len();
        let net = |k: usize| &self.nets[piece.first + k * size..piece.first + (k + 1) * size];
        PieceNet {
            degrees: piece.degrees,
            x: net(0),
            y: net(1),
            z: net(2),
            w: net(3),
        }
    }

    /// Memory in use.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&self.pieces[..]) + size_of_val(&self.cells[..]) + size_of_val(&self.nets[..])
    }
}

/// How far the derivatives of a part stray from even ones, relative to its size: what a cut
/// along u would lessen, and what a cut along v would.
fn stray(part: &BezierSurface) -> [f64; 2] {
    let row = part.degree_v() + 1;
    let points: Vec<DVec3> = part.points().collect();
    let along_u: Vec<_> = points
        .iter()
        .zip(&points[row..])
        .map(|(a, b)| *b - *a)
        .collect();
    let along_v: Vec<_> = points
        .chunks_exact(row)
        .flat_map(|line| line.windows(2))
        .map(|w| w[1] - w[0])
        .collect();
    let (columns, steps) = (part.degree_u(), part.degree_v());
    let [uu, uv] = spread(&along_u, columns, row);
    let [vu, vv] = spread(&along_v, columns + 1, steps);
    [uu.max(vu), uv.max(vv)]
}

/// The largest distance of a step from the mean of its line, relative to the mean length of
/// all: for lines along the first index, and along the second.
fn spread(steps: &[DVec3], count_i: usize, count_j: usize) -> [f64; 2] {
    let size = steps.iter().map(|s| s.length()).sum::<f64>() / steps.len() as f64;
    let worst = |line: &mut dyn Iterator<Item = DVec3>| {
        let line: Vec<DVec3> = line.collect();
        let mean = line.iter().sum::<DVec3>() / line.len() as f64;
        line.iter()
            .fold(0.0, |max: f64, s| max.max(s.distance(mean)))
    };
    let over = |lines: usize, line: &dyn Fn(usize) -> f64| {
        let most = (0..lines).map(line).fold(0.0, f64::max);
        if most > f64::EPSILON * size {
            most / size
        } else {
            0.0
        }
    };
    let along_i = over(count_j, &|j| {
        worst(&mut steps.iter().skip(j).step_by(count_j).copied())
    });
    let along_j = over(count_i, &|i| {
        worst(&mut steps[i * count_j..(i + 1) * count_j].iter().copied())
    });
    [along_i, along_j]
}
