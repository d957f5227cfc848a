//! Solids that are united, cut by each other or taken from each other: the faces of the result are
//! parts of theirs, on the same surfaces.

#[cfg_attr(not(test), expect(dead_code, reason = "used by what follows"))]
mod inside;

use crate::{Error, Patch};

/// What is made of two solids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// What is in one of them or in both.
    Union,
    /// What is in both.
    Intersection,
    /// What is in the first, but not in the second.
    Difference,
}

/// The faces of what an operation makes of two solids, each given by the faces around it; none if
/// nothing is left. Faces stay on their surfaces, over the same parameters, with other loops.
///
/// # Errors
///
/// [`Error::Boolean`] if the faces of a solid do not close it, or if it cannot be told where they meet.
pub fn combine(
    _first: &[Patch],
    _second: &[Patch],
    _operation: Operation,
) -> Result<Vec<Patch>, Error> {
    Err(Error::Boolean("solids are not combined yet"))
}
