//! The largest value of a function over many cells, between what has been found and what is
//! proven: cells that may hold more than has been found are divided.

use rayon::prelude::*;

/// Cells that cannot exceed what has been found by this share are left alone.
const RELATIVE: f64 = 5e-4;

/// Cells divided at the same time.
const BATCH: usize = 8192;

/// How often the cells with the largest values are divided at the end, wherever the proof
/// stands.
const LAST_ROUNDS: usize = 6;

/// How many of them.
const LAST_CELLS: usize = 64;

/// What is known of a cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Known {
    /// The largest value that has been found in it.
    pub(crate) found: f64,
    /// No value in it is larger.
    pub(crate) bound: f64,
    /// What the bound leaves out and dividing does not lessen.
    pub(crate) slack: f64,
}

/// A function over cells that can be divided.
pub(crate) trait Function: Sync {
    /// A part of where it is defined.
    type Cell: Clone + Send + Sync;

    /// Values in a cell.
    fn examine(&self, cell: &Self::Cell) -> Known;

    /// The parts of a cell.
    fn divide(&self, cell: &Self::Cell) -> Vec<Self::Cell>;
}

/// The largest value.
#[derive(Clone, Debug)]
pub(crate) struct Supremum<C> {
    /// The largest value that has been found.
    pub(crate) found: f64,
    /// No value is larger.
    pub(crate) bound: f64,
    /// Cells with large values, the largest first.
    pub(crate) cells: Vec<(f64, C)>,
}

/// How many cells with large values are kept.
const KEPT: usize = 512;

/// How much is done to prove the largest value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    /// Cells that are divided.
    pub(crate) budget: usize,
    /// A value of which is to be known whether the largest one exceeds it; while it is not,
    /// [`PATIENCE`] times as many cells are divided.
    pub(crate) limit: Option<f64>,
}

/// See [`Effort`].
const PATIENCE: usize = 16;

/// Looks for the largest value over `cells`. Values below `floor` do not matter. The result does
/// not depend on the number of threads.
pub(crate) fn largest<F: Function>(
    function: &F,
    cells: Vec<F::Cell>,
    floor: f64,
    effort: Effort,
) -> Supremum<F::Cell> {
    let examine = |cell: F::Cell| (function.examine(&cell), cell);
    let mut open: Vec<_> = cells.into_par_iter().map(examine).collect();
    let mut result = Supremum {
        found: 0.0,
        bound: 0.0,
        cells: Vec::new(),
    };
    result.note(&open);
    let mut divided = 0;
    loop {
        let near = result.found * (1.0 + RELATIVE) + floor;
        let (wanted, budget) = match effort.limit {
            Some(limit) if divided >= effort.budget && near < limit => {
                (limit, effort.budget.saturating_mul(PATIENCE))
            }
            _ => (near, effort.budget),
        };
        open.retain(|(known, _)| {
            if known.bound <= wanted {
                result.bound = result.bound.max(known.bound + known.slack);
            }
            known.bound > wanted
        });
        if open.is_empty() || divided >= budget {
            break;
        }
        // The largest bounds first; in a fixed order where they are equal.
        let batch = BATCH.min(open.len());
        if batch < open.len() {
            open.select_nth_unstable_by(batch, |a, b| b.0.bound.total_cmp(&a.0.bound));
        }
        let rest = open.split_off(batch);
        divided += batch;
        let parts: Vec<_> = open
            .into_par_iter()
            .flat_map_iter(|(_, cell)| function.divide(&cell).into_iter().map(examine))
            .collect();
        result.note(&parts);
        open = rest;
        open.extend(parts);
    }
    let left = open.iter().map(|(known, _)| known.bound + known.slack);
    result.bound = left.fold(result.bound, f64::max);
    let mut top: Vec<_> = result.cells.iter().take(LAST_CELLS).cloned().collect();
    for _ in 0..LAST_ROUNDS {
        let parts: Vec<_> = top
            .into_par_iter()
            .flat_map_iter(|(_, cell)| function.divide(&cell).into_iter().map(examine))
            .collect();
        result.note(&parts);
        top = parts.into_iter().map(|(k, cell)| (k.found, cell)).collect();
        top.sort_by(|a, b| b.0.total_cmp(&a.0));
        top.truncate(LAST_CELLS);
    }
    result.bound = result.bound.max(result.found);
    result
}

impl<C: Clone> Supremum<C> {
    /// Takes note of values that have been found.
    fn note(&mut self, cells: &[(Known, C)]) {
        let least = match self.cells.get(KEPT - 1) {
            Some((least, _)) => *least,
            None => f64::NEG_INFINITY,
        };
        let large = cells.iter().filter(|(known, _)| known.found > least);
        let mut large: Vec<_> = large.map(|(known, cell)| (known.found, cell)).collect();
        large.sort_by(|a, b| b.0.total_cmp(&a.0));
        large.truncate(KEPT);
        let owned = large.into_iter().map(|(value, cell)| (value, cell.clone()));
        self.cells.extend(owned);
        self.cells.sort_by(|a, b| b.0.total_cmp(&a.0));
        self.cells.truncate(KEPT);
        if let Some((largest, _)) = self.cells.first() {
            self.found = self.found.max(*largest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The height of a hill over an interval, bounded by its slope.
    struct Hill;

    impl Function for Hill {
        type Cell = [f64; 2];

        fn examine(&self, [a, b]: &[f64; 2]) -> Known {
            let height = |x: f64| 1.0 - (x - 0.3).abs();
            let found = height(*a).max(height(*b));
            let bound = height(0.5 * (a + b)) + 0.5 * (b - a);
            let slack = 0.0;
            Known {
                found,
                bound,
                slack,
            }
        }

        fn divide(&self, [a, b]: &[f64; 2]) -> Vec<[f64; 2]> {
            let middle = 0.5 * (a + b);
            vec![[*a, middle], [middle, *b]]
        }
    }

    #[test]
    fn the_top_lies_between_what_is_found_and_what_is_proven() {
        let cells: Vec<[f64; 2]> = (0..100)
            .map(|k| [f64::from(k) * 0.1 - 0.07, f64::from(k) * 0.1 + 0.03])
            .collect();
        let effort = |budget, limit| Effort { budget, limit };
        let top = largest(&Hill, cells.clone(), 0.0, effort(10_000, None));
        assert!(top.found <= 1.0 && top.found > 0.999 && (1.0..1.001).contains(&top.bound));
        let stopped = largest(&Hill, cells.clone(), 0.0, effort(0, None));
        assert!(stopped.bound > 1.01 && stopped.found <= 1.0);
        // A limit is decided although the budget is spent; one that is exceeded costs nothing.
        let decided = largest(&Hill, cells.clone(), 0.0, effort(1, Some(1.01)));
        assert!((1.0..=1.01).contains(&decided.bound));
        let exceeded = largest(&Hill, cells, 0.0, effort(1, Some(0.9)));
        assert!(exceeded.found > 0.9 && exceeded.bound > 1.01);
    }
}
