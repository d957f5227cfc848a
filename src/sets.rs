//! Numbers that are joined to sets.

use std::collections::BTreeMap;

/// Sets of the numbers below a count, each known by its least one.
pub(crate) struct Sets(Vec<usize>);

impl Sets {
    /// Each number by itself.
    pub(crate) fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    /// The least number of the set that a number belongs to.
    pub(crate) fn root(&mut self, mut k: usize) -> usize {
        while self.0[k] != k {
            self.0[k] = self.0[self.0[k]];
            k = self.0[k];
        }
        k
    }

    /// Makes one set of those of two numbers.
    pub(crate) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b);
    }

    /// The numbers of each set, in their order.
    pub(crate) fn members(mut self) -> Vec<Vec<usize>> {
        let mut sets: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for k in 0..self.0.len() {
            sets.entry(self.root(k)).or_default().push(k);
        }
        sets.into_values().collect()
    }
}
