//! `efremov`: Bézier clipping with repairs (A. Efremov, V. Havran, H.-P. Seidel, *Robust and
//! numerically stable Bézier clipping method for ray tracing NURBS surfaces*, SCCG 2005):
//! tolerances on true distances, a direction for clips where edges vanish, roots found twice
//! merged, intervals that do not shrink below rounding.

use super::nishita::Clipping;
use super::{Picture, Weights, run};

/// The row's part in [`crate::METHODS`].
pub(crate) const PICTURE: Picture = Picture {
    weights: Weights::All,
    map: false,
    trace: |job| run::<Clipping<'_, true>>(job),
};
