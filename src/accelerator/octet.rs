//! The eight parts of a coarse cell as polynomials, side by side: what [`Expansion`] is of one part,
//! made for all of them in little more time.
//!
//! [`Expansion`]: super::expansion::Expansion

use std::array::from_fn;

use glam::DVec3;

use super::cells::{Cell, Piece};
use super::expansion::{DEGENERATE, LEAST_WEIGHT, LINEAR, ORDER, TERMS, WIDE};
use super::leaving::BESIDE;
use super::powers::{powers_of, terms_of};
use super::tree::Tree;
use crate::intersect::PieceNet;
use crate::simd::{Simd, WIDE_LANES};

/// A number for each part.
type Eight = [f32; WIDE_LANES];

/// Polynomials of eight parts in their own frames, as those of an
/// [`Expansion`](super::expansion::Expansion).
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Octet {
    /// In the coordinates of the hierarchy.
    pub(super) center: [[f64; WIDE_LANES]; 3],
    /// Of each of the four coordinates.
    pub(super) terms: [[Eight; TERMS]; 4],
    pub(super) beside: [Eight; 4],
    pub(super) second: [[Eight; 3]; 4],
}

/// Frames of eight parts, in the coordinates of the hierarchy: see [`super::cells::CellFrame`].
pub(super) struct Frames<D> {
    pub(super) center: [D; 3],
    pub(super) rows: Three<D>,
    pub(super) half: [D; 3],
    pub(super) stray: [D; 4],
}

/// Coefficients of `x^i y^j` at `i * ORDER + j`: of three coordinates and the weight.
type Terms<D> = [[D; TERMS]; 4];

impl Octet {
    /// No parts yet.
    pub(super) const NONE: Self = {
        let mut none = Self {
            center: [[0.0; WIDE_LANES]; 3],
            terms: [[[0.0; WIDE_LANES]; TERMS]; 4],
            beside: [[0.0; WIDE_LANES]; 4],
            second: [[[0.0; WIDE_LANES]; 3]; 4],
        };
        none.terms[3][0] = [1.0; WIDE_LANES];
        none
    };

    /// Takes the parts of a coarse cell of a piece with all powers kept, and gives their frames, unless one of them
    /// has none.
    #[inline(always)]
    pub(super) fn fill<S: Simd>(
        &mut self,
        s: S,
        (piece, net): (&Piece, &PieceNet<'_>),
        cell: &Cell,
        tree: &Tree,
    ) -> Option<Frames<S::D>> {
        let zero = s.splat_d(0.0);
        // Loops over these are not unrolled, as the code is seldom at hand.
        let coordinates = if piece.is_rational { 4 } else { 3 };
        let mut terms = parts(s, (net, coordinates), cell);
        let middle = if piece.is_rational {
            relative(s, &mut terms)
        } else {
            [terms[0][0], terms[1][0], terms[2][0]]
        };
        let [axes, rows] = frame(s, &terms)?;
        let (mut half, mut stray, mut shift) = ([zero; 3], [zero; 4], [zero; 3]);
        for r in 0..coordinates {
            let mut own = terms[3];
            if r < 3 {
                for (t, own) in own.iter_mut().enumerate().skip(1) {
                    *own = dot(s, rows[r], [terms[0][t], terms[1][t], terms[2][t]]);
                }
            }
            let sums = Sums::of(s, &own, r);
            stray[r] = sums.stray;
            s.store_rounded(sums.beside, &mut self.beside[r]);
            for (to, from) in self.second[r].iter_mut().zip(sums.second) {
                s.store_rounded(from, to);
            }
            for (to, &from) in self.terms[r].iter_mut().zip(&own).skip(1) {
                s.store_rounded(from, to);
            }
            if r == 3 {
                let least = s.splat_d(1.0 - LEAST_WEIGHT);
                if s.lt_d(sums.all, least) != ALL {
                    return None;
                }
            } else if piece.is_rational {
                // Weights would make the change of the center one of the derivatives.
                half[r] = s.add_d(sums.half, s.abs_d(sums.bulge));
            } else {
                half[r] = sums.half;
                for (to, axis) in shift.iter_mut().zip(axes[r]) {
                    *to = s.fma_d(axis, sums.bulge, *to);
                }
            }
        }
        if !piece.is_rational {
            let none = &Self::NONE;
            (self.terms[3], self.beside[3]) = (none.terms[3], none.beside[3]);
            self.second[3] = none.second[3];
        }
        let size = piece.radius * tree.scale();
        let ball = tree.to_local(piece.center).to_array();
        let mut center = shift;
        for r in 0..3 {
            let first = s.sub_d(zero, dot(s, rows[r], shift));
            s.store_rounded(first, &mut self.terms[r][0]);
            let own = s.add_d(middle[r], shift[r]);
            center[r] = s.fma_d(own, s.splat_d(size), s.splat_d(ball[r]));
            s.store_d(center[r], &mut self.center[r]);
        }
        let inverse = s.splat_d(size.recip());
        Some(Frames {
            center,
            rows: rows.map(|row| row.map(|x| s.mul_d(x, inverse))),
            half,
            stray,
        })
    }

    /// The middle of a part.
    #[inline(always)]
    pub(super) fn center(&self, slot: usize) -> DVec3 {
        let [x, y, z] = &self.center;
        DVec3::new(x[slot], y[slot], z[slot])
    }
}

/// A bit for each part.
const ALL: u32 = (1 << WIDE_LANES) - 1;

/// The polynomials of the parts of a cell, each about its own middle; so many coordinates of them.
#[inline(always)]
fn parts<S: Simd>(s: S, (net, coordinates): (&PieceNet<'_>, usize), cell: &Cell) -> Terms<S::D> {
    let whole = terms_of::<ORDER>(net.points, net.degrees, &cell.rect());
    let cuts = cell.grid();
    let sizes = cuts.map(|cuts| f64::from(1_u32 << cuts).recip());
    let middles = [0, 1].map(|axis| {
        from_fn(|k| {
            let place = [k >> cuts[1], k & ((1 << cuts[1]) - 1)][axis];
            (2 * place + 1) as f64 * sizes[axis] - 1.0
        })
    });
    let [x, y] = middles.map(|middles| s.load_d(&middles));
    let [along_x, along_y] = sizes.map(powers_of::<ORDER>);
    let mut terms = [[s.splat_d(0.0); TERMS]; 4];
    for r in 0..coordinates {
        let terms = &mut terms[r];
        for i in 0..ORDER {
            let line = moved(s, whole[i].map(|term| s.splat_d(term[r])), y);
            for j in 0..ORDER {
                terms[i * ORDER + j] = line[j];
            }
        }
        for j in 0..ORDER {
            let line = moved(s, [0, 1, 2, 3].map(|i| terms[i * ORDER + j]), x);
            for i in 0..ORDER {
                terms[i * ORDER + j] = s.mul_d(line[i], s.splat_d(along_x[i] * along_y[j]));
            }
        }
    }
    terms
}

/// The coefficients of a cubic about another place.
#[inline(always)]
fn moved<S: Simd>(s: S, [a, b, c, d]: [S::D; ORDER], x: S::D) -> [S::D; ORDER] {
    let c1 = s.fma_d(d, x, c);
    let b1 = s.fma_d(c1, x, b);
    let c2 = s.fma_d(d, x, c1);
    [s.fma_d(b1, x, a), s.fma_d(c2, x, b1), s.fma_d(d, x, c2), d]
}

/// Divides by the weight in the middle and moves that to the origin, whose place is the result.
#[inline(always)]
fn relative<S: Simd>(s: S, [x, y, z, weights]: &mut Terms<S::D>) -> [S::D; 3] {
    let inverse = s.div_d(s.splat_d(1.0), weights[0]);
    for weight in &mut *weights {
        *weight = s.mul_d(*weight, inverse);
    }
    [x, y, z].map(|coordinate| {
        let middle = s.mul_d(coordinate[0], inverse);
        for (term, &weight) in coordinate.iter_mut().zip(&*weights) {
            *term = s.fnma_d(middle, weight, s.mul_d(*term, inverse));
        }
        middle
    })
}

/// Three vectors of each part.
type Three<D> = [[D; 3]; 3];

/// The axes of the frames and what inverts them, rounded to single precision, if all of the parts have one: see
/// [`super::expansion::Expansion::rows`].
#[inline(always)]
fn frame<S: Simd>(s: S, terms: &Terms<S::D>) -> Option<[Three<S::D>; 2]> {
    let one = s.splat_d(1.0);
    let times = |a: [S::D; 3], b: S::D| a.map(|x| s.mul_d(x, b));
    let [a, b] = [ORDER, 1].map(|t| [terms[0][t], terms[1][t], terms[2][t]]);
    let [length_a, length_b] = [a, b].map(|v| s.sqrt_d(dot(s, v, v)));
    let normal = cross(s, a, b);
    let area = s.sqrt_d(dot(s, normal, normal));
    let least = s.mul_d(s.splat_d(DEGENERATE), s.mul_d(length_a, length_b));
    if s.lt_d(least, area) != ALL {
        return None;
    }
    let inverse = s.div_d(one, area);
    let n = times(normal, inverse);
    let length = s.mul_d(s.splat_d(0.5), s.add_d(length_a, length_b));
    let rows = [
        times(cross(s, b, n), inverse),
        times(cross(s, n, a), inverse),
        times(n, s.div_d(one, length)),
    ];
    let rounded = |x: S::D| {
        let mut single = [0.0; WIDE_LANES];
        s.store_rounded(x, &mut single);
        s.load_d(&single.map(f64::from))
    };
    Some([[a, b, times(n, length)], rows.map(|row| row.map(rounded))])
}

#[inline(always)]
fn dot<S: Simd>(s: S, a: [S::D; 3], b: [S::D; 3]) -> S::D {
    s.fma_d(a[0], b[0], s.fma_d(a[1], b[1], s.mul_d(a[2], b[2])))
}

#[inline(always)]
fn cross<S: Simd>(s: S, a: [S::D; 3], b: [S::D; 3]) -> [S::D; 3] {
    let minor = |i: usize, j: usize| s.fnma_d(a[j], b[i], s.mul_d(a[i], b[j]));
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

/// Sums over the terms of one coordinate: bounds on what is not linear, and on its derivatives.
struct Sums<D> {
    /// All but the first.
    all: D,
    half: D,
    bulge: D,
    stray: D,
    beside: D,
    second: [D; 3],
}

impl<D: Copy> Sums<D> {
    /// Of coordinate `r`.
    #[inline(always)]
    fn of<S: Simd<D = D>>(s: S, own: &[D; TERMS], r: usize) -> Self {
        const W: [f64; 2 * ORDER] = powers_of(WIDE);
        const B: [f64; 2 * ORDER] = powers_of(BESIDE);
        let size = own.map(|term| s.abs_d(term));
        let of = |i: usize, j: usize| size[i * ORDER + j];
        let plus = |a: D, b: D| s.add_d(a, b);
        let weighted = |first: D, factors: &[f64], rest: &[D]| {
            let terms = rest.iter().zip(factors);
            terms.fold(first, |sum, (&term, &factor)| {
                s.fma_d(term, s.splat_d(factor), sum)
            })
        };
        // By the sum of both powers, from two on.
        let even = plus(of(2, 0), of(0, 2));
        let degrees = [
            plus(even, of(1, 1)),
            plus(plus(of(3, 0), of(2, 1)), plus(of(1, 2), of(0, 3))),
            plus(plus(of(3, 1), of(1, 3)), of(2, 2)),
            plus(of(3, 2), of(2, 3)),
            of(3, 3),
        ];
        // Of the derivatives along the axes of the frame one is expected.
        let expected = |k: usize| s.splat_d(if r == k { 1.0 } else { 0.0 });
        let [x, y] = [(ORDER, 0), (1, 1)].map(|(t, k)| s.abs_d(s.sub_d(own[t], expected(k))));
        let linear = plus(plus(x, y), s.splat_d(LINEAR));
        let derivatives = |p: &[f64; 2 * ORDER]| {
            let factors = [2.0 * p[1], 3.0 * p[2], 4.0 * p[3], 5.0 * p[4], 6.0 * p[5]];
            weighted(linear, &factors, &degrees)
        };
        let bulge = [0.5 * W[2], 0.5 * W[4]];
        let odd = [
            of(1, 1),
            degrees[1],
            plus(of(3, 1), of(1, 3)),
            degrees[3],
            degrees[4],
        ];
        let zero = s.splat_d(0.0);
        let half = weighted(linear, &bulge, &[even, of(2, 2)]);
        let twice = |of: [[D; ORDER]; 2]| {
            let factors = [2.0, 2.0 * W[1], 2.0 * W[2], 2.0 * W[3]];
            let two = weighted(zero, &factors, &of[0]);
            let factors = [6.0 * W[1], 6.0 * W[2], 6.0 * W[3], 6.0 * W[4]];
            weighted(two, &factors, &of[1])
        };
        let both = [
            plus(of(2, 1), of(1, 2)),
            plus(of(3, 1), of(1, 3)),
            of(2, 2),
            plus(of(3, 2), of(2, 3)),
            of(3, 3),
        ];
        let factors = [2.0 * W[1], 3.0 * W[2], 4.0 * W[2], 6.0 * W[3], 9.0 * W[4]];
        Self {
            all: degrees.into_iter().fold(plus(size[1], size[ORDER]), plus),
            half: weighted(half, &W[2..7], &odd),
            bulge: weighted(
                zero,
                &bulge,
                &[plus(own[2 * ORDER], own[2]), own[2 * ORDER + 2]],
            ),
            stray: derivatives(&W),
            beside: derivatives(&B),
            second: [
                twice([2, 3].map(|i| [0, 1, 2, 3].map(|j| of(i, j)))),
                weighted(of(1, 1), &factors, &both),
                twice([2, 3].map(|j| [0, 1, 2, 3].map(|i| of(i, j)))),
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accelerator::block::Block;
    use crate::accelerator::expansion::{Expansion, SOLVER};
    use crate::accelerator::tests::{ball, medley};
    use crate::accelerator::{Accelerator, Cluster};
    use crate::intersect::METHODS;
    use crate::simd::{Instructions, Portable, Task};

    struct Fill<'a> {
        cluster: &'a Cluster<'a>,
        cell: &'a Cell,
    }

    impl Task for Fill<'_> {
        type Output = Option<(Octet, Block)>;

        fn run<S: Simd>(self, s: S) -> Self::Output {
            let (mut octet, mut block) = (Octet::NONE, Block::EMPTY);
            let cluster = self.cluster;
            let piece = cluster.piece(self.cell.piece);
            let net = cluster.net(piece);
            let frames = octet.fill(s, (piece, &net), self.cell, &cluster.tree)?;
            block.take(s, self.cell, &frames);
            Some((octet, block))
        }
    }

    /// Compares the parts of a cell with what each of them is alone.
    fn compare(cluster: &Cluster<'_>, cell: &Cell, octet: &Octet, block: &Block) {
        let piece = cluster.piece(cell.piece);
        let size = piece.radius * cluster.tree.scale();
        for (slot, part) in cell.parts().enumerate() {
            assert_eq!(block.cells[slot], part);
            let net = cluster.net(piece);
            let alone = Expansion::of::<_, SOLVER>(Portable, &net, &part.rect());
            let center = (cluster.tree).to_local(piece.center + alone.center * piece.radius);
            let (near, single) = (1e-12, 1e-6);
            assert!(octet.center(slot).distance(center) < near, "{part:?}");
            for (row, own) in block.rows(slot, size).iter().zip(alone.rows) {
                assert!(row.distance(own) < single * own.length(), "{part:?}");
            }
            for r in 0..4 {
                for (t, term) in alone.terms.iter().enumerate() {
                    let off = (f64::from(octet.terms[r][t][slot]) - term[r]).abs();
                    assert!(off < single * 4.0, "{part:?} {r} {t}: {off}");
                }
            }
            // Bounds are no less, and hardly more; weights of integral pieces do not stray by rounding.
            let above = |own: f32, bound: f64| {
                let own = f64::from(own);
                let most = bound * 1.01 + 1e-5;
                assert!(own >= bound * (1.0 - single) - 2e-7, "{own} {bound}");
                assert!(own <= most, "{own} {most}");
            };
            let (bulge, stray) = block.bounds(slot);
            for r in 0..4 {
                above(stray[r], alone.stray[r]);
                above(octet.beside[r][slot], alone.beside[r]);
                for (k, second) in alone.second.iter().enumerate() {
                    above(octet.second[r][k][slot], second[r]);
                }
                if r < 3 {
                    above(bulge[r], alone.half[r]);
                }
            }
        }
    }

    #[test]
    fn eight_parts_are_what_each_of_them_is_alone() {
        let mut scene = medley();
        // Of many patches cells stay coarse.
        for _ in 0..2048 {
            scene.add_patch(ball(1.0, DVec3::ZERO)).unwrap();
        }
        let accelerator = Accelerator::build(&scene, &METHODS[0]);
        for instructions in Instructions::ALL {
            let mut counts = [0; 2];
            for cluster in &accelerator.clusters {
                let cells = cluster.blocks.iter().flat_map(|block| &block.cells);
                for cell in cells.filter(|cell| cell.is_coarse()) {
                    let piece = cluster.piece(cell.piece);
                    if piece.degrees.p.max(piece.degrees.q) >= ORDER {
                        continue;
                    }
                    if let Some((octet, block)) = instructions.run(Fill { cluster, cell }) {
                        compare(cluster, cell, &octet, &block);
                        counts[usize::from(piece.is_rational)] += 1;
                    }
                }
            }
            assert!(counts.iter().all(|&count| count > 4), "{counts:?}");
        }
    }
}
