//! Numbers that are joined to sets.

use std::collections::BTreeMap;

/// Sets of the numbers below a count, each known by its least one.
///
/// ```
/// let mut sets = nurbray_kernel::Sets::new(4);
/// sets.join(3, 1);
/// assert_eq!(sets.root(3), 1);
/// assert_eq!(sets.members(), [vec![0], vec![1, 3], vec![2]]);
/// ```
#[derive(Clone, Debug)]
pub struct Sets(Vec<usize>);

impl Sets {
    /// Each number by itself.
    pub fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    /// The least number of the set that a number belongs to.
    pub fn root(&mut self, mut k: usize) -> usize {
        while self.0[k] != k {
            self.0[k] = self.0[self.0[k]];
            k = self.0[k];
        }
        k
    }

    /// Makes one set of those of two numbers.
    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b);
    }

    /// The numbers of each set, in their order.
    pub fn members(mut self) -> Vec<Vec<usize>> {
        let mut sets: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for k in 0..self.0.len() {
            sets.entry(self.root(k)).or_default().push(k);
        }
        sets.into_values().collect()
    }
}
