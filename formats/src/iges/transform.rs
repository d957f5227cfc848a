//! Transformations (type 124), one applied after the other along their pointers.

use std::collections::HashMap;

use glam::{DAffine3, DMat3, DVec3};

use super::directory::{File, SHORT};
use crate::Problem;

/// Refuses points that a transformation moved beyond the range of numbers.
pub(super) fn check_finite(points: impl Iterator<Item = DVec3>) -> Result<(), Problem> {
    kernel::check_points(points).map_err(Problem::Geometry)
}

/// Composed transformations by the entry they begin with.
#[derive(Debug, Default)]
pub(super) struct Transforms {
    known: HashMap<usize, Result<DAffine3, Problem>>,
}

impl Transforms {
    /// The transformation a directory entry points to; zero means none.
    ///
    /// If that one points to another, the other one comes after it.
    pub(super) fn follow(&mut self, file: &File<'_>, pointer: i64) -> Result<DAffine3, Problem> {
        // Collect the chain up to its end or to a part that is known.
        let mut chain = Vec::new();
        let mut next = pointer;
        let mut result = Ok(DAffine3::IDENTITY);
        while next != 0 {
            let index = match file.follow(next, "a transformation") {
                Ok(index) if file.entries[index].kind == 124 => index,
                Ok(index) => {
                    let text = format!("{} is no transformation", file.source(index));
                    result = Err(Problem::Invalid(text));
                    break;
                }
                Err(problem) => {
                    result = Err(problem);
                    break;
                }
            };
            if let Some(known) = self.known.get(&index) {
                result = known.clone();
                break;
            }
            // Unknown until the chain is done: met again, it is a cycle.
            let text = "transformations point to each other in a cycle".to_owned();
            self.known.insert(index, Err(Problem::Invalid(text)));
            chain.push(index);
            next = file.entries[index].transform;
        }
        for index in chain.into_iter().rev() {
            result = result.and_then(|outer| Ok(outer * matrix(file, index)?));
            self.known.insert(index, result.clone());
        }
        result.and_then(|map| {
            let sound = map.is_finite() && map.matrix3.determinant().is_normal();
            let text = "the transformation is not invertible";
            Some(map)
                .filter(|_| sound)
                .ok_or_else(|| Problem::Invalid(text.to_owned()))
        })
    }
}

/// The matrix and shift of one entity.
fn matrix(file: &File<'_>, index: usize) -> Result<DAffine3, Problem> {
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, SHORT, &mut buffer)?;
    let mut rows = [[0.0; 4]; 3];
    for value in rows.as_flattened_mut() {
        *value = parameters.real_or(0.0)?;
    }
    let column = |c: usize| DVec3::new(rows[0][c], rows[1][c], rows[2][c]);
    let linear = DMat3::from_cols(column(0), column(1), column(2));
    Ok(DAffine3::from_mat3_translation(linear, column(3)))
}
