//! One cell of a piece: excluded, proven to hold one root, or to be split.

use kernel::{Interval, MAX_DEGREE};

use super::surface::Degrees;

/// Cells are widened by this part of their size on every side, so that a root on a common
/// border lies inside the domain of a proof.
const WIDENED: f64 = 1.0 / (1 << 30) as f64;

/// The values of a net over the widened cell stray from the middle of its hull at most by
/// its radius times `(1 + 2 WIDENED)^(p + q)`, the sum of the absolute Bernstein values there;
/// this bounds that factor less one, halved, for all degrees.
const BEYOND: f64 = 1.0 / (1 << 21) as f64;

/// Deviation from the identity below which a cell is tried for a proof.
const UNIQUE: f64 = 0.5;

/// Cells are not split below this size, as a part of their piece.
const LEAST: f64 = 1.0 / (1_u64 << 40) as f64;

/// Cells no larger than this may be given up because of rounding errors.
const SMALL: f64 = 1.0 / 64.0;

/// Steps of the iteration that looks for the place of a proof.
const STEPS: usize = 60;

/// Bernstein values of one degree.
type Row<T> = [T; MAX_DEGREE + 1];

/// A part of a piece with its nets over the unit square.
#[derive(Debug)]
pub(super) struct Cell {
    pub(super) piece: u32,
    pub(super) place: u32,
    /// Lower corner and size in the piece; both are exact.
    pub(super) start: [f64; 2],
    pub(super) size: [f64; 2],
    /// Distances from both planes, then numerator and, unless it is the same everywhere,
    /// denominator of the ray parameter.
    pub(super) nets: Vec<Interval>,
    /// Where points of the cell on the ray may lie along it.
    pub(super) t: Interval,
}

/// What has been proven about a cell.
pub(super) enum Verdict {
    /// It holds no root.
    Empty,
    /// It holds no root, or one of the widened cell: there is exactly one in there.
    One {
        /// Where, in the parameters of the piece, and along the ray.
        u: Interval,
        v: Interval,
        t: Interval,
    },
    /// It must be split across u (0) or v (1).
    Split(usize),
    /// Neither it nor its parts can be decided.
    Undecided,
}

impl Cell {
    /// Bounds of the ray parameter of what the line meets in the cell.
    pub(super) fn reach(nets: &[Interval], degrees: Degrees) -> Interval {
        let n = degrees.len();
        match &nets[2 * n..] {
            t if t.len() == n => hull(t),
            rational => {
                let (above, below) = rational.split_at(n);
                let mut ratios = above.iter().zip(below).map(|(&a, &b)| a / b);
                let first = ratios.next().unwrap_or(Interval::ENTIRE);
                ratios.fold(first, Interval::hull)
            }
        }
    }

    /// Decides about the cell; `spare` is room to work in.
    pub(super) fn examine(&self, degrees: Degrees, spare: &mut Vec<Interval>) -> Verdict {
        let n = degrees.len();
        let (d1, d2) = (&self.nets[..n], &self.nets[n..2 * n]);
        if excludes(d1) || excludes(d2) {
            return Verdict::Empty;
        }
        let center = [0.5, 0.5];
        let [[_, a, b], [_, c, d]] = [d1, d2].map(|net| float_value(net, degrees, center));
        let noise = d1
            .iter()
            .chain(d2)
            .fold(0.0, |max: f64, x| max.max(x.width()));
        if let Some(inverse) = inverse([a, b, c, d]) {
            // Preconditioned with the inverse of the Jacobian the cell is nearly a square.
            spare.clear();
            for row in [&inverse[..2], &inverse[2..]] {
                spare.extend(
                    d1.iter()
                        .zip(d2)
                        .map(|(x, y)| x.scaled(row[0]) + y.scaled(row[1])),
                );
            }
            let (g1, g2) = spare.split_at(n);
            if excludes(g1) || excludes(g2) {
                return Verdict::Empty;
            }
            let stray = [deviation(g1, degrees, 0), deviation(g2, degrees, 1)];
            if stray[0].max(stray[1]) < UNIQUE
                && let Some(verdict) = self.prove(degrees, [g1, g2], stray)
            {
                return verdict;
            }
            let blur = inverse.iter().fold(0.0, |max: f64, x| max.max(x.abs())) * noise;
            if blur < WIDENED {
                return self.split(degrees);
            }
        }
        self.examine_flat(degrees, [a, b, c, d], noise)
    }

    /// Krawczyk's operator around a point where the preconditioned map is nearly zero.
    ///
    /// For roots x of the widened cell X and a point c of it, `x = c - G(c) + R (x - c)`
    /// with the row sums of |R| at most `stray`, below one half. So all roots lie within
    /// `r = |G(c)| / (1 - max stray)` of c, and in `E = c - G(c) + R [-r, r]`. If the ball of
    /// radius r lies in X, the operator maps it into itself and contracts: exactly one.
    fn prove(&self, degrees: Degrees, g: [&[Interval]; 2], stray: [f64; 2]) -> Option<Verdict> {
        let c = settle(g, degrees);
        let rows = [
            rows(degrees.p, Interval::point(c[0])),
            rows(degrees.q, Interval::point(c[1])),
        ];
        let value = g.map(|net| value(net, degrees, &rows));
        let residual = value[0].magnitude().max(value[1].magnitude());
        let room = (1.0 - stray[0].max(stray[1])).next_down();
        let radius = (residual / room).next_up();
        let root: [Interval; 2] = std::array::from_fn(|k| {
            let strays = (stray[k] * radius).next_up();
            (Interval::point(c[k]) - value[k]).widened(strays)
        });
        let cell = Interval::new(0.0, 1.0);
        if !(root[0].overlaps(cell) && root[1].overlaps(cell)) {
            return Some(Verdict::Empty);
        }
        let domain = Interval::new(-WIDENED, 1.0 + WIDENED);
        let inside = (0..2).all(|k| domain.encloses(Interval::point(c[k]).widened(radius)));
        if !inside {
            return None;
        }
        let root: [Interval; 2] =
            std::array::from_fn(|k| root[k].intersection(domain).unwrap_or(root[k]));
        let [u, v] = [0, 1].map(|k| Interval::point(self.start[k]) + root[k].scaled(self.size[k]));
        let t = self.ray_parameter(degrees, root);
        Some(Verdict::One { u, v, t })
    }

    /// The ray parameter of points around `at`, relative to that of the first control point
    /// so that no digits are lost to the distance of the origin.
    fn ray_parameter(&self, degrees: Degrees, at: [Interval; 2]) -> Interval {
        let n = degrees.len();
        let rows = [rows(degrees.p, at[0]), rows(degrees.q, at[1])];
        let nets = &self.nets[2 * n..];
        if nets.len() == n {
            let start = Interval::point(nets[0].middle());
            let relative: Vec<_> = nets.iter().map(|&t| t - start).collect();
            return start + value(&relative, degrees, &rows);
        }
        let (above, below) = nets.split_at(n);
        let start = Interval::point(above[0].middle() / below[0].middle());
        let relative: Vec<_> = above
            .iter()
            .zip(below)
            .map(|(&a, &b)| a - b * start)
            .collect();
        start + value(&relative, degrees, &rows) / value(below, degrees, &rows)
    }

    /// A cell whose Jacobian has no useful inverse: the ray nearly touches.
    fn examine_flat(&self, degrees: Degrees, [a, b, c, d]: [f64; 4], noise: f64) -> Verdict {
        let n = degrees.len();
        let (d1, d2) = (&self.nets[..n], &self.nets[n..2 * n]);
        let (du, dv) = ((a, c), (b, d));
        let square = |(x, y): (f64, f64)| x * x + y * y;
        let (x, y) = if square(du) >= square(dv) { du } else { dv };
        let length = square((x, y)).sqrt();
        if length > 0.0 && length.is_finite() {
            // Turn the planes: across the common direction of both derivatives, and along.
            let (x, y) = (x / length, y / length);
            let turned = |x: f64, y: f64| {
                let mut net = d1
                    .iter()
                    .zip(d2)
                    .map(|(d1, d2)| d1.scaled(x) + d2.scaled(y));
                let first = net.next().unwrap_or(Interval::ENTIRE);
                net.fold(first, Interval::hull)
            };
            let across = turned(-y, x);
            if !across.contains(0.0) || !turned(x, y).contains(0.0) {
                return Verdict::Empty;
            }
            let small = self.size[0].max(self.size[1]) <= SMALL;
            if small && across.width() <= 4.0 * noise {
                return Verdict::Undecided;
            }
        }
        self.split(degrees)
    }

    /// Splits across the direction of the larger steps between neighbouring coefficients.
    fn split(&self, degrees: Degrees) -> Verdict {
        let (n, row) = (degrees.len(), degrees.q + 1);
        let (mut along_u, mut along_v) = (0.0_f64, 0.0_f64);
        let step = |a: &Interval, b: &Interval| (b.middle() - a.middle()).abs();
        for net in self.nets[..2 * n].chunks_exact(n) {
            let steps_u = net.iter().zip(&net[row..]).map(|(a, b)| step(a, b));
            let pairs = net.chunks_exact(row).flat_map(|line| line.windows(2));
            along_u = steps_u.fold(along_u, f64::max);
            along_v = pairs.map(|p| step(&p[0], &p[1])).fold(along_v, f64::max);
        }
        let axis = usize::from(along_v > along_u);
        if self.size[axis] > LEAST {
            Verdict::Split(axis)
        } else if self.size[1 - axis] > LEAST {
            Verdict::Split(1 - axis)
        } else {
            Verdict::Undecided
        }
    }

    /// Both halves; the second one is this cell, changed.
    pub(super) fn halve(mut self: Box<Self>, degrees: Degrees, axis: usize) -> [Box<Self>; 2] {
        let mut left = Box::new(Self {
            nets: self.nets.clone(),
            ..*self
        });
        let (n, row) = (degrees.len(), degrees.q + 1);
        let (degree, stride) = [(degrees.p, row), (degrees.q, 1)][axis];
        let lines = n / (degree + 1);
        let nets = left
            .nets
            .chunks_exact_mut(n)
            .zip(self.nets.chunks_exact_mut(n));
        for (left, right) in nets {
            for line in 0..lines {
                let first = if axis == 0 { line } else { line * row };
                for level in 1..=degree {
                    for k in 0..=degree - level {
                        let at = first + k * stride;
                        right[at] = right[at].midpoint(right[at + stride]);
                    }
                    left[first + level * stride] = right[first];
                }
            }
        }
        self.size[axis] *= 0.5;
        left.size[axis] *= 0.5;
        self.start[axis] += self.size[axis];
        for cell in [&mut left, &mut self] {
            let reach = Self::reach(&cell.nets, degrees);
            cell.t = cell.t.intersection(reach).unwrap_or(reach);
        }
        [left, self]
    }
}

fn hull(net: &[Interval]) -> Interval {
    net[1..].iter().fold(net[0], |all, &x| all.hull(x))
}

fn excludes(net: &[Interval]) -> bool {
    net.iter().all(|x| x.low() > 0.0) || net.iter().all(|x| x.high() < 0.0)
}

fn inverse([a, b, c, d]: [f64; 4]) -> Option<[f64; 4]> {
    let determinant = a * d - b * c;
    let inverse = [d, -b, -c, a].map(|x| x / determinant);
    inverse.iter().all(|x| x.is_finite()).then_some(inverse)
}

/// A bound of how far the derivatives of a net over the widened cell stray from those of
/// coordinate number `own`, summed over u and v.
fn deviation(net: &[Interval], degrees: Degrees, own: usize) -> f64 {
    let row = degrees.q + 1;
    let wanted = |axis: usize| Interval::point(if axis == own { 1.0 } else { 0.0 });
    let stray = |all: Option<Interval>, axis: usize, degree: usize| {
        let all = all.unwrap_or(Interval::ENTIRE).scaled(degree as f64);
        let beyond = (all.width() * BEYOND).next_up();
        (all.widened(beyond) - wanted(axis)).magnitude()
    };
    let steps = net.iter().zip(&net[row..]).map(|(&a, &b)| b - a);
    let along_u = stray(steps.reduce(Interval::hull), 0, degrees.p);
    let steps = net
        .chunks_exact(row)
        .flat_map(|line| line.windows(2))
        .map(|pair| pair[1] - pair[0]);
    let along_v = stray(steps.reduce(Interval::hull), 1, degrees.q);
    (along_u + along_v).next_up()
}

/// Enclosures of the Bernstein polynomials.
fn rows(degree: usize, t: Interval) -> Row<Interval> {
    let mut row = [Interval::ZERO; MAX_DEGREE + 1];
    row[0] = Interval::point(1.0);
    let rest = Interval::point(1.0) - t;
    for d in 1..=degree {
        let mut carried = Interval::ZERO;
        for slot in &mut row[..d] {
            let old = *slot;
            *slot = carried + rest * old;
            carried = t * old;
        }
        row[d] = carried;
    }
    row
}

/// The value of a net.
fn value(net: &[Interval], degrees: Degrees, rows: &[Row<Interval>; 2]) -> Interval {
    let lines = net.chunks_exact(degrees.q + 1).zip(&rows[0]);
    lines.fold(Interval::ZERO, |sum, (line, &u)| {
        let along = line
            .iter()
            .zip(&rows[1])
            .fold(Interval::ZERO, |sum, (&c, &v)| sum + c * v);
        sum + along * u
    })
}

/// Value and both derivatives of the middle of a net, with rounding errors.
fn float_value(net: &[Interval], degrees: Degrees, at: [f64; 2]) -> [f64; 3] {
    let [u, v] = [float_rows(degrees.p, at[0]), float_rows(degrees.q, at[1])];
    let mut sums = [0.0; 3];
    for (i, line) in net.chunks_exact(degrees.q + 1).enumerate() {
        let (mut value, mut along_v) = (0.0, 0.0);
        for (j, c) in line.iter().enumerate() {
            value += c.middle() * v[0][j];
            along_v += c.middle() * v[1][j];
        }
        sums[0] += value * u[0][i];
        sums[1] += value * u[1][i];
        sums[2] += along_v * u[0][i];
    }
    sums
}

/// Bernstein polynomials and their derivatives.
fn float_rows(degree: usize, t: f64) -> [Row<f64>; 2] {
    let (mut row, mut slope) = ([0.0; MAX_DEGREE + 1], [0.0; MAX_DEGREE + 1]);
    row[0] = 1.0;
    for d in 1..=degree {
        if d == degree {
            let scale = degree as f64;
            for k in 0..=degree {
                let before = if k == 0 { 0.0 } else { row[k - 1] };
                slope[k] = scale * (before - row[k]);
            }
        }
        let mut carried = 0.0;
        for slot in &mut row[..d] {
            let old = *slot;
            *slot = carried + (1.0 - t) * old;
            carried = t * old;
        }
        row[d] = carried;
    }
    [row, slope]
}

/// Where the iteration on a preconditioned map settles within the slightly widened cell.
///
/// Newton's steps while they halve the residual, else the chord's. Nothing is proven here.
fn settle(g: [&[Interval]; 2], degrees: Degrees) -> [f64; 2] {
    let clamp = |x: f64| x.clamp(-0.5 * WIDENED, 1.0 + 0.5 * WIDENED);
    let at = |c| g.map(|net| float_value(net, degrees, c));
    let size = |f: &[[f64; 3]; 2]| f[0][0].abs().max(f[1][0].abs());
    let mut c = [0.5, 0.5];
    let mut f = at(c);
    for _ in 0..STEPS {
        let [[f1, a, b], [f2, p, q]] = f;
        let newton = inverse([a, b, p, q]).map(|[a, b, p, q]| {
            let next = [
                clamp(c[0] - (a * f1 + b * f2)),
                clamp(c[1] - (p * f1 + q * f2)),
            ];
            (next, at(next))
        });
        let (next, value) = match newton {
            Some((next, value)) if size(&value) < 0.5 * size(&f) => (next, value),
            _ => {
                let next = [clamp(c[0] - f1), clamp(c[1] - f2)];
                (next, at(next))
            }
        };
        let moved = (next[0] - c[0]).abs().max((next[1] - c[1]).abs());
        (c, f) = (next, value);
        if moved < 1e-15 {
            break;
        }
    }
    c
}
