//! Parts of curves joined to loops.

use glam::DVec2;

use crate::{Curve, TrimLoop};

/// Parts of curves, each with the inside on its left, joined end to start to loops; none if some cannot be.
/// Ends within `near` meet. Where several parts go on, that most to the right does: loops touch, but do not
/// cross.
pub(super) fn loops(mut parts: Vec<Curve<DVec2>>, near: f64) -> Option<Vec<TrimLoop>> {
    let mut loops = Vec::new();
    while let Some(first) = parts.pop() {
        let start = first.start();
        let mut run = vec![first];
        while run.last()?.end().distance(start) > near {
            let last = run.last()?;
            let (end, way) = (last.end(), last.derivatives(last.domain().end).first);
            let turn = |part: &Curve<DVec2>| {
                let next = part.derivatives(part.domain().start).first;
                way.perp_dot(next).atan2(way.dot(next))
            };
            let is_next = |&index: &usize| parts[index].start().distance(end) <= near;
            let next = (0..parts.len()).filter(is_next);
            let next = next.min_by(|&a, &b| turn(&parts[a]).total_cmp(&turn(&parts[b])))?;
            run.push(parts.swap_remove(next));
        }
        loops.push(TrimLoop::new(run, near).ok()?);
    }
    Some(loops)
}
