//! Coarse cells divided for the rays that come to them, and the few that a thread keeps at hand.

use super::Cluster;
use super::block::Block;
use super::cells::{Cell, CellFrame, GROUP};
use super::model::place_of;
use crate::simd::Instructions;

/// Divided cells that a thread keeps; a power of two.
const KEPT: usize = 1024;

/// The parts of coarse cells, each cell at a place that follows from its number.
#[derive(Clone, Debug, Default)]
pub(super) struct Fans {
    blocks: Vec<Block>,
    /// Cluster and cell of each.
    tags: Vec<(u32, u64)>,
    /// Those that were asked for last, whether they are kept or not.
    asked: Vec<(u32, u64)>,
    /// Parts on their way to a block.
    parts: Vec<(Cell, CellFrame)>,
}

impl Fans {
    /// The parts of a coarse cell of cluster number `number`.
    pub(super) fn of(
        &mut self,
        instructions: Instructions,
        (number, cluster): (u32, &Cluster<'_>),
        cell: &Cell,
    ) -> &Block {
        let (place, tag) = self.place(number, cell);
        if self.tags[place] != tag {
            let parts = &mut self.parts;
            cluster.pieces.divide(instructions, cell, parts);
            let parts = parts.iter().map(|(part, frame)| (part, frame));
            self.blocks[place] = Block::new(parts, &cluster.tree);
            self.tags[place] = tag;
        }
        &self.blocks[place]
    }

    /// As [`Self::of`], unless the cell is asked for the first time: to divide it for a single
    /// ray does not pay.
    pub(super) fn of_often(
        &mut self,
        instructions: Instructions,
        (number, cluster): (u32, &Cluster<'_>),
        cell: &Cell,
    ) -> Option<&Block> {
        let (place, tag) = self.place(number, cell);
        let again = self.tags[place] == tag || self.asked[place] == tag;
        self.asked[place] = tag;
        again.then(|| self.of(instructions, (number, cluster), cell))
    }

    /// Where the parts of a cell are kept, and under what name.
    fn place(&mut self, number: u32, cell: &Cell) -> (usize, (u32, u64)) {
        if self.blocks.is_empty() {
            self.blocks.resize(KEPT, Block::EMPTY);
            self.tags.resize(KEPT, (u32::MAX, u64::MAX));
            self.asked.resize(KEPT, (u32::MAX, u64::MAX));
            self.parts.reserve(GROUP);
        }
        let tag = (number, cell.key());
        (place_of(tag) % KEPT, tag)
    }
}
