//! Coarse cells divided for the rays that come to them, and the few that a thread keeps at hand.

use super::Cluster;
use super::block::Block;
use super::cells::{Cell, CellFrame, GROUP};
use super::model::place_of;
use crate::simd::Instructions;

/// Divided cells that a thread keeps, in less than 4 MB; a power of two. Rays in all directions
/// come to many.
const KEPT: usize = 4096;

/// The parts of coarse cells, each cell at a place that follows from its number.
#[derive(Clone, Debug, Default)]
pub(super) struct Fans {
    blocks: Vec<Block>,
    /// Cluster and cell of each.
    tags: Vec<(u32, u64)>,
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
        if self.blocks.is_empty() {
            self.blocks.resize(KEPT, Block::EMPTY);
            self.tags.resize(KEPT, (u32::MAX, u64::MAX));
            self.parts.reserve(GROUP);
        }
        let tag = (number, cell.key());
        let place = place_of(tag) % KEPT;
        if self.tags[place] != tag {
            let parts = &mut self.parts;
            cluster.pieces.divide(instructions, cell, parts);
            let parts = parts.iter().map(|(part, frame)| (part, frame));
            self.blocks[place] = Block::new(parts, &cluster.tree);
            self.tags[place] = tag;
        }
        &self.blocks[place]
    }
}
