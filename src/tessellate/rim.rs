//! The boundary of a face: curves in its parameter domain.

use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::{Curve, Patch, TrimRegion};

use super::pieces::{Pieces, Rect};
use super::round::Round;

/// Parameters so near to a border of the domain, as a share of it, are on the border.
pub(super) const SNAP: f64 = 1e-7;

/// What is on the border moves there by no more than about this share of the tolerance.
const SNAPPED: f64 = 0.1;

/// The same as a share of the domain where rounding errors move it.
const LEAST: f64 = 1e-13;

/// Where a part of the border is looked at, as shares of it.
const PLACES: [f64; 3] = [0.271, 0.5, 0.788];

/// Ways in the parameters that turn by no more than rounding go on.
const ONWARD: f64 = 1e-12;

/// A boundary that turns at once by more than this, in radians, has a corner.
const CORNER: f64 = 0.5;

/// What lies beside a boundary is looked for this far from it, as a share of the domain.
const BESIDE: f64 = 1e-4;

/// So many rims become one at most: searches along a curve take as long as it has pieces.
const GATHERED: usize = 500;

/// A face that is to become triangles.
#[derive(Debug)]
pub(crate) struct Face<'a> {
    pub(super) pieces: Pieces<'a>,
    pub(super) region: Option<TrimRegion>,
    /// Largest distance from the surface, in its own units.
    pub(super) tolerance: f64,
    /// How near to a border of the domain parameters are on it.
    near: DVec2,
}

impl<'a> Face<'a> {
    pub(crate) fn new(patch: &'a Patch, tolerance: f64) -> Self {
        let mut face = Self::of_edges(patch, tolerance);
        face.pieces.round = Round::of(patch).filter(|round| round.is_large(tolerance));
        face
    }

    /// One of which edges alone are wanted: what is known of triangles over it is not looked for.
    pub(crate) fn of_edges(patch: &'a Patch, tolerance: f64) -> Self {
        let pieces = Pieces::new(&patch.surface);
        let size = patch.surface.hull_bounds().diagonal();
        let share = (SNAPPED * tolerance / size).clamp(LEAST, SNAP);
        Self {
            near: pieces.domain().size() * share,
            pieces,
            region: patch.region(),
            tolerance,
        }
    }

    /// Whether no loop cuts it.
    pub(crate) fn is_whole(&self) -> bool {
        self.region.is_none()
    }

    /// The point of the surface; parameters beyond the domain are moved to its border.
    pub(crate) fn point(&self, uv: DVec2) -> DVec3 {
        self.pieces.surface.evaluate(self.clamped(uv))
    }

    /// The same with the normal, which is zero where the surface has none, as at poles.
    pub(super) fn point_and_normal(&self, uv: DVec2) -> (DVec3, DVec3) {
        let (point, normal) = self
            .pieces
            .surface
            .point_and_regular_normal(self.clamped(uv));
        (point, normal.unwrap_or_default())
    }

    /// The point of the surface at a place of a boundary, which goes on by `way` in the parameters; which
    /// way it goes on in space, and the normal there, of any length.
    pub(super) fn look(&self, uv: DVec2, way: DVec2) -> (DVec3, DVec3, DVec3) {
        let (point, [du, dv]) = self.pieces.surface.tangents(self.clamped(uv));
        (point, du * way.x + dv * way.y, du.cross(dv))
    }

    pub(crate) fn clamped(&self, uv: DVec2) -> DVec2 {
        let domain = self.pieces.domain();
        uv.max(domain.min).min(domain.max)
    }

    /// Parameters moved to the border of the domain if they are beyond it or nearly on it, and onto a
    /// crease if they are nearly on that.
    pub(super) fn snapped(&self, uv: DVec2) -> DVec2 {
        let domain = self.pieces.domain();
        let near = self.near;
        let mut uv = self.clamped(uv);
        for axis in 0..2 {
            for border in [domain.min[axis], domain.max[axis]] {
                if (uv[axis] - border).abs() <= near[axis] {
                    uv[axis] = border;
                }
            }
            let creases = &self.pieces.creases[axis];
            let next = creases.partition_point(|&crease| crease < uv[axis] - near[axis]);
            if let Some(&crease) = creases.get(next)
                && crease <= uv[axis] + near[axis]
            {
                uv[axis] = crease;
            }
        }
        uv
    }

    /// The parameters at which a boundary passes creases of the surface, in order.
    pub(super) fn kinks(&self, boundary: &Curve<DVec2>) -> Vec<f64> {
        let [u, v] = &self.pieces.creases;
        self.passed(boundary, [u, v])
    }

    /// The ends of a boundary, and the parameters between them where it need not be smooth in space:
    /// where pieces of it or of the surface meet, in order.
    pub(crate) fn breaks(&self, boundary: &Curve<DVec2>) -> Vec<f64> {
        let mut breaks = boundary.knots().breaks();
        breaks.extend(self.passed(boundary, self.pieces.inner_breaks()));
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        breaks
    }

    /// The parameters at which a boundary passes lines across u and across v, in order.
    fn passed(&self, boundary: &Curve<DVec2>, lines: [&[f64]; 2]) -> Vec<f64> {
        let mut passed = Vec::new();
        if lines.iter().all(|lines| lines.is_empty()) {
            return passed;
        }
        let near = self.near;
        for piece in boundary.bezier_pieces() {
            let hull = Rect::around(piece.points());
            for (axis, lines) in lines.iter().enumerate() {
                let first = lines.partition_point(|&line| line < hull.min[axis]);
                let within = lines[first..].iter();
                for &line in within.take_while(|&&line| line <= hull.max[axis]) {
                    passed.extend(piece.crossings(axis, line, near[axis]));
                    let end = piece.domain().end;
                    if (piece.end()[axis] - line).abs() <= near[axis] && end < boundary.domain().end
                    {
                        passed.push(end);
                    }
                }
            }
        }
        passed.sort_by(f64::total_cmp);
        passed.dedup();
        passed
    }

    /// The way from its boundary, and across it, into the face; `None` where that is not plain.
    pub(crate) fn inwards(&self, boundary: &Curve<DVec2>, t: f64) -> Option<DVec3> {
        let (uv, way) = boundary.tangent(t);
        let domain = self.pieces.domain();
        let size = domain.size();
        let step = (way / size).perp().try_normalize()? * size * BESIDE;
        let belongs = |uv: DVec2| {
            let inside = uv.cmpge(domain.min).all() && uv.cmple(domain.max).all();
            inside && self.region.as_ref().is_none_or(|r| r.contains(uv))
        };
        let step = match [uv + step, uv - step].map(belongs) {
            [true, false] => step,
            [false, true] => -step,
            _ => return None,
        };
        let (_, [du, dv]) = self.pieces.surface.tangents(self.clamped(uv));
        let along = (du * way.x + dv * way.y).try_normalize()?;
        Some((du * step.x + dv * step.y).reject_from_normalized(along))
    }

    /// Whether a boundary turns in space between two pieces that are not lost in the tolerance.
    fn is_corner(&self, before: &Curve<DVec2>, after: &Curve<DVec2>) -> bool {
        let (uv, from) = before.tangent(before.domain().end);
        let (_, to) = after.tangent(after.domain().start);
        if from.dot(to) > 0.0 && from.perp_dot(to).abs() <= ONWARD * from.length() * to.length() {
            return false;
        }
        let is_long = |piece: &Curve<DVec2>| {
            let ends = [piece.start(), piece.end()].map(|uv| self.point(uv));
            ends[0].distance(ends[1]) > self.tolerance
        };
        let [from, to] = [from, to].map(|way| self.look(uv, way).1);
        let turn = from.angle_between(to);
        turn > CORNER && is_long(before) && is_long(after)
    }

    /// The parts of the domain's border and of the loops that bound the face.
    pub(crate) fn rims(&self, patch: &Patch) -> Vec<Curve<DVec2>> {
        let domain = self.pieces.domain();
        let near = self.near;
        let mut rims = Vec::new();
        if self.region.is_some() {
            let sides = Side::all(&domain);
            let runs_along = |curve: &Curve<DVec2>| {
                sides
                    .each_ref()
                    .map(|side| curve.points().all(|p| side.is_on(p, near)))
            };
            for curve in patch.trim_curves() {
                // An outline may come as one curve, with corners, around the whole domain.
                let is_end = |a: &Curve<DVec2>, b: &Curve<DVec2>| {
                    runs_along(a) != runs_along(b) || self.is_corner(a, b)
                };
                for part in curve.parts(is_end) {
                    inside(part, &domain, near, &mut rims);
                }
            }
            rims = self.gathered(rims, |a, b| runs_along(a) == runs_along(b));
        }
        let mut border = Vec::new();
        for side in Side::all(&domain) {
            self.border(&side, &rims, near, &mut border);
        }
        rims.extend(border);
        rims
    }

    /// Rims in which short ones that go on from each other, and `may` be one, are one: others may have no
    /// corners where they meet, or have them elsewhere.
    fn gathered(
        &self,
        rims: Vec<Curve<DVec2>>,
        may: impl Fn(&Curve<DVec2>, &Curve<DVec2>) -> bool,
    ) -> Vec<Curve<DVec2>> {
        let is_short = |rim: &Curve<DVec2>| {
            let Range { start, end } = rim.domain();
            let first = self.point(rim.start());
            let mut shares = [1.0].into_iter().chain(PLACES);
            shares.all(|share| {
                let uv = rim.evaluate(start + (end - start) * share);
                self.point(uv).distance(first) <= self.tolerance
            })
        };
        let short: Vec<bool> = rims.iter().map(is_short).collect();
        if !short.windows(2).any(|pair| pair[0] && pair[1]) {
            return rims;
        }
        let goes_on = |from: DVec2, to: DVec2| (from - to).abs().cmple(self.near).all();
        let mut gathered: Vec<Curve<DVec2>> = Vec::new();
        let mut run: Vec<Curve<DVec2>> = Vec::new();
        for (rim, is_short) in rims.into_iter().zip(short) {
            let is_next = |last: &Curve<DVec2>| {
                let begins = goes_on(last.end(), rim.start());
                // What comes back to where it began is no longer one.
                begins && !goes_on(run[0].start(), rim.end()) && may(last, &rim)
            };
            if !is_short || run.len() >= GATHERED || !run.last().is_some_and(is_next) {
                end_run(&mut run, &mut gathered);
            }
            run.push(rim);
            if !is_short {
                end_run(&mut run, &mut gathered);
            }
        }
        end_run(&mut run, &mut gathered);
        gathered
    }

    /// Appends the parts of a side of the domain that bound the face and along which no
    /// loop runs.
    fn border(&self, side: &Side, rims: &[Curve<DVec2>], near: DVec2, out: &mut Vec<Curve<DVec2>>) {
        let along = 1 - side.axis;
        let mut stops = vec![side.range.start, side.range.end];
        let mut covered: Vec<[f64; 2]> = Vec::new();
        for rim in rims {
            let ends = [rim.start(), rim.end()];
            let is_on = |p: DVec2| side.is_on(p, near);
            stops.extend(ends.iter().filter(|&&p| is_on(p)).map(|p| p[along]));
            // What was kept since its middle is on the border may stray a little more elsewhere.
            let Range { start, end } = rim.domain();
            let beside = |share: f64| {
                let uv = rim.evaluate(start + (end - start) * share);
                side.is_on(uv, 2.0 * near)
            };
            if ends.into_iter().all(is_on) && PLACES.into_iter().all(beside) {
                covered.push([
                    ends[0][along].min(ends[1][along]),
                    ends[0][along].max(ends[1][along]),
                ]);
            }
        }
        stops.sort_by(f64::total_cmp);
        let mut from = side.range.start;
        for &stop in &stops[1..] {
            let to = stop.min(side.range.end);
            if to - from <= near[along] {
                continue;
            }
            let middle = 0.5 * (from + to);
            let is_covered = covered.iter().any(|[a, b]| (*a..*b).contains(&middle));
            // All of it belongs to the face, or nothing; but a loop may touch it at any place.
            let belongs = self.region.as_ref().is_none_or(|region| {
                let place = |share: f64| side.at(from + (to - from) * share);
                let inside = PLACES
                    .iter()
                    .filter(|&&share| region.contains(place(share)));
                inside.count() > PLACES.len() / 2
            });
            if belongs && !is_covered {
                out.extend(Curve::line(side.at(from), side.at(to), 0.0..1.0));
            }
            from = to;
        }
    }
}

/// A side of a domain.
struct Side {
    /// The axis across it.
    axis: usize,
    at: f64,
    range: Range<f64>,
}

impl Side {
    fn all(domain: &Rect) -> [Self; 4] {
        let side = |axis: usize, at: f64| Self {
            axis,
            at,
            range: domain.min[1 - axis]..domain.max[1 - axis],
        };
        [
            side(1, domain.min.y),
            side(0, domain.max.x),
            side(1, domain.max.y),
            side(0, domain.min.x),
        ]
    }

    /// Whether a place is on the line of the side, as near as `near` across it.
    fn is_on(&self, p: DVec2, near: DVec2) -> bool {
        (p[self.axis] - self.at).abs() <= near[self.axis]
    }

    fn at(&self, t: f64) -> DVec2 {
        let mut p = DVec2::splat(t);
        p[self.axis] = self.at;
        p
    }
}

/// Appends curves that go on from each other as one, if they can be one.
fn end_run(run: &mut Vec<Curve<DVec2>>, out: &mut Vec<Curve<DVec2>>) {
    let units = (0..).zip(&*run).map(|(k, curve)| {
        let start = f64::from(k);
        curve.remapped(start..start + 1.0)
    });
    let joined = match &units.collect::<Result<Vec<_>, _>>() {
        Ok(units) if units.len() > 1 => units[0].joined(&units[1..]).ok(),
        _ => None,
    };
    match joined {
        Some(joined) => {
            out.push(joined);
            run.clear();
        }
        None => out.append(run),
    }
}

/// Appends the parts of a curve that lie in the domain.
fn inside(curve: Curve<DVec2>, domain: &Rect, near: DVec2, out: &mut Vec<Curve<DVec2>>) {
    let hull = Rect::around(curve.points());
    let fits = |p: DVec2| p.cmpge(domain.min - near).all() && p.cmple(domain.max + near).all();
    if fits(hull.min) && fits(hull.max) {
        out.push(curve);
        return;
    }
    let mut cuts = Vec::new();
    for axis in 0..2 {
        for border in [domain.min[axis], domain.max[axis]] {
            cuts.extend(curve.crossings(axis, border, near[axis]));
        }
    }
    let whole = curve.domain();
    cuts.sort_by(f64::total_cmp);
    cuts.push(whole.end);
    let least = (whole.end - whole.start) * SNAP;
    let mut from = whole.start;
    for to in cuts {
        if to - from <= least {
            continue;
        }
        if fits(curve.evaluate(0.5 * (from + to))) {
            out.extend(curve.restricted(from..to));
        }
        from = to;
    }
}
