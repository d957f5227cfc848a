//! Linear systems of which each equation has only a few neighbouring unknowns.
//!
//! Elimination without exchanges of rows, which is stable for the collocation matrices of
//! B-splines: they are totally positive, and so are their principal parts \[deBoor 77\]. Time and
//! memory are linear in the number of unknowns.

use std::ops::{Add, Mul, Sub};

/// What stands on the right side of an equation: a number or a vector.
pub(super) trait Value:
    Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<f64, Output = Self>
{
}

impl<T> Value for T where
    T: Copy + Default + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>
{
}

/// A matrix with entries in `half` diagonals on each side of the main one, as its factors.
#[derive(Debug)]
struct Banded {
    half: usize,
    /// `rows[i][j + half - i]` is the entry in row `i` and column `j`.
    rows: Vec<Vec<f64>>,
}

impl Banded {
    /// Factors a matrix of rows with `2 half + 1` entries; `None` if it is singular.
    fn new(mut rows: Vec<Vec<f64>>, half: usize) -> Option<Self> {
        let count = rows.len();
        for k in 0..count {
            let (done, below) = rows.split_at_mut(k + 1);
            let upper = &done[k];
            let pivot = upper[half];
            if !pivot.is_normal() {
                return None;
            }
            for (step, row) in (1..).zip(below.iter_mut().take(half)) {
                let factor = row[half - step] / pivot;
                row[half - step] = factor;
                for j in 1..=half {
                    row[half - step + j] -= factor * upper[half + j];
                }
            }
        }
        Some(Self { half, rows })
    }

    /// Replaces a right side by the solution.
    fn solve<T: Value>(&self, x: &mut [T]) {
        let half = self.half;
        for (i, row) in self.rows.iter().enumerate() {
            for j in i.saturating_sub(half)..i {
                x[i] = x[i] - x[j] * row[j + half - i];
            }
        }
        for (i, row) in self.rows.iter().enumerate().rev() {
            for j in i + 1..(i + half + 1).min(self.rows.len()) {
                x[i] = x[i] - x[j] * row[j + half - i];
            }
            x[i] = x[i] * row[half].recip();
        }
    }
}

/// A system with entries near the diagonal and, if it is cyclic, in the two far corners.
///
/// The last `half` unknowns of a cyclic system are its border: without them it is banded, and a
/// small dense system remains for them (block elimination).
#[derive(Debug)]
pub(super) struct System {
    core: Banded,
    /// The columns of the border, solved with the core.
    columns: Vec<Vec<f64>>,
    /// The rows of the border over the core.
    feet: Vec<Vec<f64>>,
    /// The inverse of what remains for the border, row by row.
    inverse: Vec<Vec<f64>>,
}

impl System {
    /// The system of which row `i` has the entries of the columns `i - half` to `i + half`,
    /// counted around if it is cyclic; it then has more than `2 half` rows. `None` if it is
    /// singular.
    pub(super) fn new(rows: &[Vec<f64>], half: usize, is_cyclic: bool) -> Option<Self> {
        let count = rows.len();
        let inner = count.checked_sub(if is_cyclic { half } else { 0 })?;
        // Entry `k` of row `i`, if it is in the core.
        let band = |i: usize| -> Vec<f64> {
            let is_inside = |k: usize| (half..half + inner).contains(&(i + k));
            let entry = |(k, &entry): (usize, &f64)| if is_inside(k) { entry } else { 0.0 };
            rows[i].iter().enumerate().map(entry).collect()
        };
        let core = Banded::new((0..inner).map(band).collect(), half)?;
        let at = |i: usize, j: usize| {
            let place = (j + half + count - i) % count;
            rows[i].get(place).copied().unwrap_or(0.0)
        };
        let column = |j: usize| {
            let mut column: Vec<f64> = (0..inner).map(|i| at(i, j)).collect();
            core.solve(&mut column);
            column
        };
        let columns: Vec<_> = (inner..count).map(column).collect();
        let foot = |i: usize| -> Vec<f64> { (0..inner).map(|j| at(i, j)).collect() };
        let feet: Vec<_> = (inner..count).map(foot).collect();
        let rest = (inner..count).zip(&feet).map(|(i, foot)| -> Vec<f64> {
            let entries = (inner..count).zip(&columns);
            entries.map(|(j, c)| at(i, j) - product(foot, c)).collect()
        });
        let inverse = inverse(rest.collect())?;
        Some(Self {
            core,
            columns,
            feet,
            inverse,
        })
    }

    /// Replaces a right side by the solution.
    pub(super) fn solve<T: Value>(&self, x: &mut [T]) {
        let (inner, outer) = x.split_at_mut(self.core.rows.len());
        self.core.solve(inner);
        for (value, foot) in outer.iter_mut().zip(&self.feet) {
            *value = *value - product(foot, inner);
        }
        let border: Vec<T> = self.inverse.iter().map(|row| product(row, outer)).collect();
        for (value, column) in border.iter().zip(&self.columns) {
            for (x, entry) in inner.iter_mut().zip(column) {
                *x = *x - *value * *entry;
            }
        }
        outer.copy_from_slice(&border);
    }
}

/// The sum of products.
fn product<T: Value>(factors: &[f64], values: &[T]) -> T {
    let pairs = factors.iter().zip(values);
    pairs.fold(T::default(), |sum, (&factor, &value)| sum + value * factor)
}

/// The inverse of a small matrix, by Gauss and Jordan with exchanges of rows.
pub(super) fn inverse(mut rows: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    let count = rows.len();
    for (i, row) in rows.iter_mut().enumerate() {
        row.extend((0..count).map(|j| if i == j { 1.0 } else { 0.0 }));
    }
    for k in 0..count {
        let size = |i: &usize| rows[*i][k].abs();
        let best = (k..count).max_by(|a, b| size(a).total_cmp(&size(b)))?;
        rows.swap(k, best);
        let pivot = rows[k][k];
        if !pivot.is_normal() {
            return None;
        }
        rows[k].iter_mut().for_each(|x| *x /= pivot);
        let row = rows[k].clone();
        for (_, other) in rows.iter_mut().enumerate().filter(|(i, _)| *i != k) {
            let factor = other[k];
            let pairs = other.iter_mut().zip(&row);
            pairs.for_each(|(x, above)| *x -= factor * above);
        }
    }
    Some(rows.into_iter().map(|row| row[count..].to_vec()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Entries that are dominated by the diagonal, otherwise anything.
    fn rows(count: usize, half: usize) -> Vec<Vec<f64>> {
        let entry = |i: usize, k: usize| {
            let noise = ((i * 7 + k * 13) as f64).sin();
            if k == half { 4.0 + noise } else { noise }
        };
        let row = |i| (0..=2 * half).map(|k| entry(i, k)).collect();
        (0..count).map(row).collect()
    }

    #[test]
    fn systems_are_solved() {
        for (count, half) in [(1, 0), (4, 1), (7, 3), (40, 2), (41, 3)] {
            for is_cyclic in [false, true] {
                let rows = rows(count, half);
                let wanted: Vec<f64> = (0..count).map(|k| (k as f64).cos()).collect();
                let mut x: Vec<f64> = (0..count)
                    .map(|i| {
                        let place = |k: usize| (i + k + count - half) % count;
                        let is_near = |k: &usize| is_cyclic || place(*k).abs_diff(i) <= half;
                        let inside = (0..=2 * half).filter(is_near);
                        inside.map(|k| rows[i][k] * wanted[place(k)]).sum()
                    })
                    .collect();
                let system = System::new(&rows, half, is_cyclic).unwrap();
                system.solve(&mut x);
                let error = x.iter().zip(&wanted).map(|(a, b)| (a - b).abs());
                let error = error.fold(0.0, f64::max);
                assert!(error < 1e-13, "{count} {half} {is_cyclic}: {error:e}");
            }
        }
        assert!(System::new(&[vec![0.0, 0.0, 0.0], vec![1.0, 0.0, 0.0]], 1, false).is_none());
    }
}
