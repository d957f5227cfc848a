//! Quick.
use crate::Curve;
use glam::DVec2;

type Sub = (Curve<DVec2>, f64, f64);

fn nearest(c: &Curve<DVec2>, p: DVec2) -> (f64, f64) {
    let d = c.domain();
    let mut best = (d.start, f64::INFINITY);
    for i in 0..=16 {
        let t = d.start + (d.end - d.start) * f64::from(i) / 16.0;
        let x = c.evaluate(t).distance(p);
        if x < best.1 { best = (t, x); }
    }
    let mut t = best.0;
    for _ in 0..20 {
        let k = c.derivatives(t);
        let e = k.point - p;
        let mut den = k.first.length_squared() + e.dot(k.second);
        if den <= 0.0 { den = k.first.length_squared(); }
        let n = (t - e.dot(k.first) / den).clamp(d.start, d.end);
        if (n - t).abs() < 1e-15 { break; }
        t = n;
    }
    let x = c.evaluate(t).distance(p);
    if x < best.1 { best = (t, x); }
    best
}

fn bounds(c: &Curve<DVec2>) -> (DVec2, DVec2) {
    c.points().fold((DVec2::MAX, DVec2::MIN), |(a, b), p| (a.min(p), b.max(p)))
}

fn apart(a: &Curve<DVec2>, b: &Curve<DVec2>, near: f64) -> bool {
    let ((al, ah), (bl, bh)) = (bounds(a), bounds(b));
    if (al - near).cmpgt(bh).any() || (bl - near).cmpgt(ah).any() { return true; }
    for (x, y) in [(a, b), (b, a)] {
        let Some(n) = (x.end() - x.start()).perp().try_normalize() else { continue };
        let r = |c: &Curve<DVec2>| c.points().map(|p| (p - x.start()).dot(n)).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let (l, h) = r(x); let (m, o) = r(y);
        if l > o + near || m > h + near { return true; }
    }
    false
}

fn arcs_meet(a: &Curve<DVec2>, b: &Curve<DVec2>, near: f64, out: &mut Vec<(f64, f64)>) {
    if apart(a, b, near) { return; }
    let (da, db) = (a.domain(), b.domain());
    let mut touches = Vec::new();
    for t in [da.start, da.end] { let (s, x) = nearest(b, a.evaluate(t)); if x <= near { touches.push((t, s)); } }
    for s in [db.start, db.end] { let (t, x) = nearest(a, b.evaluate(s)); if x <= near { touches.push((t, s)); } }
    if touches.len() >= 2 {
        let lo = touches.iter().map(|t| t.0).fold(f64::INFINITY, f64::min);
        let hi = touches.iter().map(|t| t.0).fold(f64::NEG_INFINITY, f64::max);
        if hi - lo > 1e-7 * (da.end - da.start) && [0.25, 0.5, 0.7].iter().all(|x| nearest(b, a.evaluate(lo + (hi - lo) * x)).1 <= near) {
            out.extend(touches);
            return;
        }
    }
    out.extend(&touches);
    let mut todo: Vec<(Sub, Sub)> = vec![((a.clone(), da.start, da.end), (b.clone(), db.start, db.end))];
    let mut work = 0;
    while let Some(((p, p0, p1), (q, q0, q1))) = todo.pop() {
        work += 1;
        if work > 3000 { break; }
        if apart(&p, &q, 0.0) { continue; }
        let (mut t, mut s) = (p0.midpoint(p1), q0.midpoint(q1));
        let mut ok = false;
        for _ in 0..12 {
            let (x, y) = (a.derivatives(t), b.derivatives(s));
            let r = x.point - y.point;
            if r.length() < 1e-14 { ok = true; break; }
            let det = x.first.perp_dot(-y.first);
            if det.abs() < 1e-9 * x.first.length() * y.first.length() { break; }
            let dt = (-r).perp_dot(-y.first) / det;
            let ds = x.first.perp_dot(-r) / det;
            t += dt; s += ds;
            if t < p0 - (p1 - p0) || t > p1 + (p1 - p0) || s < q0 - (q1 - q0) || s > q1 + (q1 - q0) { break; }
            if dt.abs() < 1e-15 && ds.abs() < 1e-15 { ok = true; break; }
        }
        let inside = ok && (p0..=p1).contains(&t) && (q0..=q1).contains(&s);
        if inside && out.iter().all(|&(o, _)| a.evaluate(o).distance(a.evaluate(t)) > near) { out.push((t, s)); }
        let flat = |c: &Curve<DVec2>| { let l = c.end() - c.start(); let n = l.perp().normalize_or_zero(); c.points().all(|x| (x - c.start()).dot(n).abs() < 0.02 * l.length()) };
        let transversal = (p.end() - p.start()).normalize_or_zero().perp_dot((q.end() - q.start()).normalize_or_zero()).abs() > 0.2;
        if inside && flat(&p) && flat(&q) && transversal { continue; }
        if p1 - p0 < 1e-9 * (da.end - da.start) && q1 - q0 < 1e-9 * (db.end - db.start) { continue; }
        let m = p0.midpoint(p1); let n = q0.midpoint(q1);
        let (Ok([pa, pb]), Ok([qa, qb])) = (p.split(m), q.split(n)) else { continue };
        for x in [(pa, p0, m), (pb, m, p1)] { for y in [(qa.clone(), q0, n), (qb.clone(), n, q1)] { todo.push((x.clone(), y)); } }
    }
}

pub(super) fn meetings(a: &Curve<DVec2>, b: &Curve<DVec2>, near: f64) -> Vec<(f64, f64)> {
    let mut out = Vec::new();
    if apart(a, b, near) { return out; }
    for p in a.bezier_pieces() { for q in b.bezier_pieces() { arcs_meet(&p, &q, near, &mut out); } }
    out
}

pub(super) fn cuts(c: &[Curve<DVec2>], near: f64) -> Vec<Vec<f64>> {
    let mut all = vec![Vec::new(); c.len()];
    for i in 0..c.len() { for j in 0..i {
        for (t, s) in meetings(&c[i], &c[j], near) { all[i].push(t); all[j].push(s); }
    } }
    for (c, t) in c.iter().zip(&mut all) {
        t.sort_by(f64::total_cmp);
        let d = c.domain();
        let mut last = d.start;
        t.retain(|&x| { let keep = x > d.start && x < d.end && c.evaluate(x).distance(c.evaluate(last)) > near && c.evaluate(x).distance(c.end()) > near; if keep { last = x; } keep });
    }
    all
}

pub(super) fn is_same(a: &Curve<DVec2>, b: &Curve<DVec2>, near: f64) -> bool {
    let d = a.domain();
    [0.13, 0.29, 0.5, 0.77, 0.93].iter().all(|x| nearest(b, a.evaluate(d.start + (d.end - d.start) * x)).1 <= near)
}
