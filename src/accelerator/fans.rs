//! Coarse cells divided for the rays that come to them, and the few that a thread keeps at hand.

use super::Cluster;
use super::block::Block;
use super::cells::{Cell, CellFrame};
use super::expansion::{Expansion, FRAME, ORDER};
use super::model::place_of;
use super::octet::Octet;
use crate::simd::{Instructions, Simd, Task};

/// Divided cells that a thread keeps, in less than 4 MB; a power of two. Rays in all directions
/// come to many.
const KEPT: usize = 1024;

/// A coarse cell, divided.
#[derive(Clone, Debug)]
pub(super) struct Fan {
    pub(super) block: Block,
    octet: Octet,
    /// Whether the parts are polynomials that are at hand.
    is_ready: bool,
}

impl Fan {
    /// Of no cell.
    const NONE: Self = Self {
        block: Block::EMPTY,
        octet: Octet::NONE,
        is_ready: false,
    };

    /// The polynomials of the parts, where they are at hand.
    pub(super) fn octet(&self) -> Option<&Octet> {
        self.is_ready.then_some(&self.octet)
    }
}

/// The parts of coarse cells, each cell at a place that follows from its number.
#[derive(Clone, Debug, Default)]
pub(super) struct Fans {
    fans: Vec<Fan>,
    /// Cluster and cell of each.
    tags: Vec<(u32, u64)>,
}

impl Fans {
    /// The parts of a coarse cell of cluster number `number`.
    pub(super) fn of(
        &mut self,
        instructions: Instructions,
        (number, cluster): (u32, &Cluster<'_>),
        cell: &Cell,
    ) -> &Fan {
        if self.fans.is_empty() {
            self.fans.resize(KEPT, Fan::NONE);
            self.tags.resize(KEPT, (u32::MAX, u64::MAX));
        }
        let tag = (number, cell.key());
        let place = place_of(tag) % KEPT;
        let fan = &mut self.fans[place];
        if self.tags[place] != tag {
            self.tags[place] = tag;
            instructions.run(Divide { fan, cluster, cell });
        }
        fan
    }
}

/// Divides a coarse cell, into polynomials if that is possible.
struct Divide<'a> {
    fan: &'a mut Fan,
    cluster: &'a Cluster<'a>,
    cell: &'a Cell,
}

impl Task for Divide<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let Self { fan, cluster, cell } = self;
        let piece = cluster.piece(cell.piece);
        let (net, tree) = (cluster.net(piece), &cluster.tree);
        let frames = if piece.degrees.p.max(piece.degrees.q) < ORDER {
            fan.octet.fill(s, (piece, &net), cell, tree)
        } else {
            None
        };
        fan.is_ready = frames.is_some();
        if let Some(frames) = frames {
            return fan.block.take(s, cell, &frames);
        }
        let parts = cell.parts().map(|part| {
            let local = Expansion::of::<S, FRAME>(s, &net, &part.rect());
            (part, CellFrame::of(&local, piece.center, piece.radius))
        });
        fan.block = Block::new(parts, tree);
    }
}
