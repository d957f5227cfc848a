use crate::Curve;
use glam::DVec2;
pub(super) fn cuts(_c: &[Curve<DVec2>], _near: f64) -> Vec<Vec<f64>> {
    todo!()
}
pub(super) fn is_same(_a: &Curve<DVec2>, _b: &Curve<DVec2>, _near: f64) -> bool {
    todo!()
}
pub(super) fn meetings(_a: &Curve<DVec2>, _b: &Curve<DVec2>, _near: f64) -> Vec<(f64, f64)> {
    todo!()
}
