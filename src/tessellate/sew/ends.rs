//! The ends of strands that look for partners, and which of them are in a box.

use glam::DVec3;
use smallvec::SmallVec;

/// Cells along each axis at most.
const MOST_CELLS: f64 = 128.0;

/// The end of a strand as others look for it.
pub(super) struct End {
    pub(super) node: usize,
    pub(super) face: usize,
    pub(super) point: DVec3,
}

/// Ends in the cells of a grid.
pub(super) struct Ends {
    /// From left to right, each node once.
    pub(super) ends: Vec<End>,
    /// The corner of the grid, the cells for a unit of length, and their number along each axis.
    corner: DVec3,
    density: DVec3,
    cells: f64,
    /// Where the ends of each cell begin among the `members`, which are numbers of ends.
    starts: Vec<usize>,
    members: Vec<usize>,
}

impl Ends {
    pub(super) fn new(mut ends: Vec<End>) -> Self {
        ends.sort_unstable_by(|a, b| a.point.x.total_cmp(&b.point.x).then(a.node.cmp(&b.node)));
        ends.dedup_by_key(|end| end.node);
        let point = |end: &End| end.point;
        let corner = ends.iter().map(point).fold(DVec3::INFINITY, DVec3::min);
        let size = ends.iter().map(point).fold(DVec3::NEG_INFINITY, DVec3::max) - corner;
        let cells = (ends.len() as f64).cbrt().ceil().clamp(1.0, MOST_CELLS);
        let mut grid = Self {
            corner,
            density: size.map(|length| if length > 0.0 { cells / length } else { 0.0 }),
            cells,
            starts: Vec::new(),
            members: vec![0; ends.len()],
            ends,
        };
        let home = |end: &End| grid.number(grid.cell(end.point));
        let homes: Vec<usize> = grid.ends.iter().map(home).collect();
        let count = grid.number([cells - 1.0; 3]) + 1;
        grid.starts.resize(count + 1, 0);
        for home in &homes {
            grid.starts[home + 1] += 1;
        }
        for cell in 0..count {
            grid.starts[cell + 1] += grid.starts[cell];
        }
        let mut next = grid.starts.clone();
        for (number, home) in homes.into_iter().enumerate() {
            grid.members[next[home]] = number;
            next[home] += 1;
        }
        grid
    }

    /// The numbers of the ends in a box, from left to right.
    pub(super) fn within(&self, low: DVec3, high: DVec3) -> SmallVec<[usize; 16]> {
        let mut found = SmallVec::new();
        let is_inside = |&&number: &&usize| {
            let point = self.ends[number].point;
            point.cmpge(low).all() && point.cmple(high).all()
        };
        let ([x0, y0, z0], [x1, y1, z1]) = (self.cell(low), self.cell(high));
        let mut x = x0;
        while x <= x1 {
            let mut y = y0;
            while y <= y1 {
                // Cells along the last axis lie side by side.
                let (first, last) = (self.number([x, y, z0]), self.number([x, y, z1]));
                let members = &self.members[self.starts[first]..self.starts[last + 1]];
                found.extend(members.iter().filter(is_inside).copied());
                y += 1.0;
            }
            x += 1.0;
        }
        found.sort_unstable();
        found
    }

    /// The cell that a point is in, or the nearest one.
    fn cell(&self, point: DVec3) -> [f64; 3] {
        let place = (point - self.corner) * self.density;
        place
            .to_array()
            .map(|x| x.floor().max(0.0).min(self.cells - 1.0))
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whole, not negative and small"
    )]
    fn number(&self, [x, y, z]: [f64; 3]) -> usize {
        ((x * self.cells + y) * self.cells + z) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn those_in_a_box_are_found_from_left_to_right() {
        let mut random = Random(3);
        // In space, in a plane, on a line and in one place.
        for size in [DVec3::ONE, DVec3::new(1.0, 0.0, 5.0), DVec3::Y, DVec3::ZERO] {
            for count in [0, 1, 700] {
                let end = |node: usize| End {
                    node,
                    face: 0,
                    point: random.vector() * size,
                };
                let ends = Ends::new((0..count).map(end).collect());
                let lefts = ends.ends.windows(2);
                assert!(lefts.into_iter().all(|w| w[0].point.x <= w[1].point.x));
                for _ in 0..100 {
                    let (a, b) = (random.vector() * size * 1.5, random.vector() * size);
                    let (low, high) = (a.min(b), a.max(b));
                    let is_inside = |&k: &usize| {
                        let point = ends.ends[k].point;
                        point.cmpge(low).all() && point.cmple(high).all()
                    };
                    let found = ends.within(low, high);
                    let all: Vec<usize> = (0..count).filter(is_inside).collect();
                    assert_eq!(found[..], all[..]);
                }
            }
        }
    }
}
