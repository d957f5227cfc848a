use crate::{Curve, TrimLoop};
use glam::DVec2;
pub(super) fn loops(_p: Vec<Curve<DVec2>>, _near: f64) -> Option<Vec<TrimLoop>> {
    todo!()
}
