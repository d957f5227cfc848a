use crate::{Curve, TrimLoop};
use glam::DVec2;
pub(super) fn loops(mut p: Vec<Curve<DVec2>>, near: f64) -> Option<Vec<TrimLoop>> {
    let mut out = Vec::new();
    while let Some(first) = p.pop() {
        let mut run = vec![first];
        loop {
            let end = run[run.len() - 1].end();
            if end.distance(run[0].start()) <= 100.0 * near { break; }
            let way = { let l = &run[run.len() - 1]; l.derivatives(l.domain().end).first.normalize_or_zero() };
            let best = (0..p.len()).filter(|&i| p[i].start().distance(end) <= 100.0 * near).min_by(|&i, &j| {
                let turn = |k: usize| { let w = p[k].derivatives(p[k].domain().start).first; -way.perp_dot(w).atan2(way.dot(w)) };
                turn(i).total_cmp(&turn(j))
            });
            let Some(best) = best else { if std::env::var("DBG").is_ok() { for c in run.iter().chain(&p) { eprintln!("DBGJ {:?} {:?}", c.start(), c.end()); } } return None };
            run.push(p.swap_remove(best));
        }
        out.push(TrimLoop::new(run, 1e-6).ok()?);
    }
    Some(out)
}
