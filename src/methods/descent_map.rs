//! `descent-map`: starts from the preliminary map, keeps a direction as long as it leads down.

use super::gradient_map::FromMap;
use super::{Picture, Weights, run};

/// The row's part in [`crate::METHODS`].
pub(crate) const PICTURE: Picture = Picture {
    weights: Weights::One,
    map: true,
    trace: |job| run::<FromMap<'_, false>>(job),
};
