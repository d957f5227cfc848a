use crate::Patch;
use glam::DVec3;
pub(super) struct Body;
impl Body {
    pub(super) fn new(_f: &[Patch]) -> Self {
        todo!()
    }
    pub(super) fn contains(&self, _p: DVec3) -> Option<bool> {
        todo!()
    }
}
