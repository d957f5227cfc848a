//! Cells made ready for many rays, and the few that a thread keeps at hand.

use glam::DVec3;

use super::Cluster;
use super::block::Block;
use super::cells::Cell;
use super::distance::Cells;
use super::expansion::{Expansion, SOLVER, TERMS};
use super::fans::Fan;
use super::leaving;
use super::octet::Octet;
use crate::intersect::Rect;
use crate::simd::{Part, Simd};

/// Cells that a thread keeps; a power of two.
const KEPT: usize = 2048;

/// Growth of bounds that covers roundings to single precision.
const GROWTH: f64 = 1.0 + 1e-5;

/// A cell that bulges less than this beside its length is flat.
const FLAT: f32 = 1e-3;

/// A cell as a polynomial in its own frame, in single precision and in the coordinates of the
/// hierarchy of its cluster.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Model {
    pub(super) cell: Cells<f32>,
    pub(super) rows: [[f32; 3]; 3],
    /// See [`Expansion::half`]; infinite where there is no frame.
    pub(super) bulge: [f32; 3],
    /// See [`Expansion::stray`]: of the weight.
    pub(super) weight_stray: f32,
    /// The largest of what higher powers contribute.
    pub(super) dropped: f32,
    pub(super) center: DVec3,
    /// Middle and half of the length along u and v, in the parameters of the piece.
    pub(super) middle: [f64; 2],
    pub(super) half: [f64; 2],
}

impl Model {
    /// An entry that no cell has.
    const NONE: Self = Self {
        cell: Cells {
            terms: [[0.0; 4]; TERMS],
            second: [[0.0; 4]; 3],
            reach: [f32::INFINITY; 2],
            higher: 0.0,
            flat: 0,
        },
        rows: [[0.0; 3]; 3],
        bulge: [f32::INFINITY; 3],
        weight_stray: 0.0,
        dropped: 0.0,
        center: DVec3::ZERO,
        middle: [0.0; 2],
        half: [0.0; 2],
    };

    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "bounds grow by more than the rounding"
    )]
    fn fill<S: Simd>(&mut self, s: S, cluster: &Cluster<'_>, cell: &Cell) {
        let piece = cluster.piece(cell.piece);
        let rect = cell.rect();
        let local = Expansion::of::<S, SOLVER>(s, &cluster.net(piece), &rect);
        let size = piece.radius * cluster.tree.scale();
        self.center = cluster
            .tree
            .to_local(piece.center + local.center * piece.radius);
        self.weight_stray = (local.stray[3] * GROWTH) as f32;
        self.dropped = 0.0;
        let greatest = local.second.iter().flatten();
        let greatest = greatest.fold(0.0, |a: f64, &b| a.max(b));
        let higher = (local.higher, greatest);
        let (reach, higher) = leaving::reach([local.stray, local.beside], higher);
        self.cell.reach = reach.map(|reach| (reach * GROWTH) as f32);
        self.cell.higher = (higher * GROWTH) as f32;
        for r in 0..4 {
            for (to, from) in self.cell.second.iter_mut().zip(&local.second) {
                to[r] = (from[r] * GROWTH) as f32;
            }
            self.dropped = self.dropped.max((local.dropped[r] * GROWTH) as f32);
            if r < 3 {
                self.bulge[r] = (local.half[r] * GROWTH) as f32;
                self.rows[r] = (local.rows[r] / size).as_vec3().to_array();
            }
        }
        for t in 0..TERMS {
            for r in 0..4 {
                self.cell.terms[t][r] = local.terms[t][r] as f32;
            }
        }
        self.place(&rect);
    }

    /// As [`Self::fill`], of a part of a coarse cell.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "bounds grow by more than the rounding"
    )]
    fn take(&mut self, block: &Block, octet: &Octet, slot: usize) {
        self.center = octet.center(slot);
        let stray;
        (self.bulge, stray) = block.bounds(slot);
        self.weight_stray = stray[3];
        self.dropped = 0.0;
        let beside = octet.beside.map(|beside| f64::from(beside[slot]) * GROWTH);
        let (reach, _) = leaving::reach([stray.map(f64::from), beside], (0.0, 0.0));
        self.cell.reach = reach.map(|reach| (reach * GROWTH) as f32);
        self.cell.higher = 0.0;
        for r in 0..4 {
            for (to, from) in self.cell.second.iter_mut().zip(&octet.second[r]) {
                to[r] = from[slot] * GROWTH as f32;
            }
            for (to, from) in self.cell.terms.iter_mut().zip(&octet.terms[r]) {
                to[r] = from[slot];
            }
        }
        self.rows = block.rows(slot, 1.0).map(|row| row.as_vec3().to_array());
        self.place(&block.cells[slot].rect());
    }

    /// Where the cell is in its piece.
    #[inline(always)]
    fn place(&mut self, rect: &Rect) {
        let is_flat = self.bulge[2] < FLAT;
        self.cell.flat = if is_flat { u32::MAX } else { 0 };
        for (k, (start, end)) in [rect.u, rect.v].into_iter().enumerate() {
            self.middle[k] = f64::midpoint(start, end);
            self.half[k] = (end - start) * 0.5;
        }
    }
}

/// Makes a cell ready.
struct Fill<'a> {
    model: &'a mut Model,
    cluster: &'a Cluster<'a>,
    cell: &'a Cell,
}

impl<S: Simd> Part<S> for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, s: S) {
        self.model.fill(s, self.cluster, self.cell);
    }
}

/// A place for a cell of a cluster, by its number.
#[inline(always)]
pub(super) fn place_of((cluster, cell): (u32, u64)) -> usize {
    // The golden ratio spreads neighbouring numbers.
    let mixed = (cell ^ u64::from(cluster) << 40).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (mixed >> 40) as usize
}

/// The cells at hand, each at a place that follows from its number.
#[derive(Clone, Debug, Default)]
pub(super) struct Models {
    models: Vec<Model>,
    /// Cluster and cell at each place, and which of the models is theirs.
    places: Vec<((u32, u64), Option<u32>)>,
}

impl Models {
    /// The model of a cell of cluster number `number`, which may be a part of a coarse one: its slot there.
    #[inline(always)]
    pub(super) fn of<'a, S: Simd>(
        &mut self,
        s: S,
        number: u32,
        cluster: &Cluster<'_>,
        cell: &Cell,
        part: impl FnOnce() -> Option<(&'a Fan, usize)>,
    ) -> &Model {
        if self.places.is_empty() {
            self.places.resize(KEPT, ((u32::MAX, u64::MAX), None));
        }
        let tag = (number, cell.key());
        let (kept, index) = &mut self.places[place_of(tag) % KEPT];
        let index = match *index {
            Some(index) => index as usize,
            None => {
                *index = u32::try_from(self.models.len()).ok();
                self.models.push(Model::NONE);
                self.models.len() - 1
            }
        };
        let model = &mut self.models[index];
        if *kept != tag {
            let part = part().and_then(|(fan, slot)| Some((&fan.block, fan.octet()?, slot)));
            match part {
                Some((block, octet, slot)) => model.take(block, octet, slot),
                None => s.apart(Fill {
                    model,
                    cluster,
                    cell,
                }),
            }
            *kept = tag;
        }
        model
    }
}
