//! Curves of space laid onto the surface of a face.

use std::iter;
use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::nearest::Nearby;
use kernel::{Curve, modelling};

use super::{ACCURACY, Trimmer};
use crate::iges::boundary::Use;
use crate::iges::curves::{Rail, Reader};
use crate::iges::order::Chain;
use crate::iges::quadric::wound;
use crate::iges::sheets;
use crate::{Problem, least};

/// A curve of space may lie this share of the surface's size beside it; farther off it is
/// not taken for a curve on it.
const BESIDE: f64 = 0.2;

/// A parameter of a point makes no difference if without it the point is no farther away than this
/// share of the surface's size.
const STEADY: f64 = 1e-10;

/// What is found of a curve is looked for from elsewhere, too, if it is farther beside it than this share of the
/// surface's size, or goes on by more than this share of its domain at once.
const FAITHFUL: f64 = 1e-3;
const JUMP: f64 = 0.25;

/// A curve whose middle is no nearer to a border of the domain than this share of it does not run
/// along that border.
const BORDER: f64 = 1e-3;

/// What a point of a curve costs beside the search for it, in control points that are mixed.
pub(super) const POINT: usize = 16;

/// Why a curve of space is not laid onto its surface after many others.
pub(super) fn spent() -> Problem {
    let text = "laying curves of space onto surfaces takes more work than a file of this size may \
                ask for";
    Problem::Unsupported(text.to_owned())
}

/// What a curve of space becomes on a surface.
#[derive(Clone, Debug)]
pub(super) struct Laid {
    chain: Chain,
    /// How far it strays, as a share of the size.
    strays: f64,
    /// How far the curve of space is beside the surface, as a share of the size.
    beside: f64,
}

/// Places of a curve, and their parameters on the surface.
type Table = Vec<(f64, DVec2)>;

impl Trimmer<'_> {
    /// The curve of space of a stretch, laid onto the surface.
    pub(super) fn laid(
        &self,
        reader: &mut Reader<'_, '_>,
        stretch: &Use,
    ) -> Result<Chain, Problem> {
        let mut rails = reader.rails_along(stretch)?;
        if stretch.reversed {
            rails.reverse();
        }
        let key = Use {
            flat: Vec::new(),
            ..stretch.clone()
        };
        let known = self.laid.borrow().get(&key).cloned();
        let laid = match known {
            Some(laid) => laid,
            None => {
                let others = (self.strays.take(), self.beside.take());
                let chain = self.lay(rails, stretch.reversed)?;
                let laid = Laid {
                    chain,
                    strays: self.strays.replace(others.0),
                    beside: self.beside.replace(others.1),
                };
                self.laid.borrow_mut().insert(key, laid.clone());
                laid
            }
        };
        self.strays.set(self.strays.get().max(laid.strays));
        self.beside.set(self.beside.get().max(laid.beside));
        Ok(laid.chain)
    }

    fn lay(&self, rails: Vec<Rail>, reversed: bool) -> Result<Chain, Problem> {
        let mut chain = Vec::new();
        for rail in rails {
            let curve = if reversed {
                rail.curve.reversed()
            } else {
                rail.curve
            };
            // Curves without length are points.
            if curve.hull_bounds().diagonal() > self.size * 1e-9 {
                for part in self.parted(curve)? {
                    chain.push(self.on_surface(&part)?);
                }
            }
        }
        Ok(chain)
    }

    /// Takes from the work that is left.
    pub(super) fn spend(&self, work: usize) {
        self.left.set(self.left.get().saturating_sub(work));
    }

    /// Makes sure that work is left. Where it ends in the middle of a curve, that becomes something
    /// else soon, which is given up here.
    pub(super) fn check_left(&self) -> Result<(), Problem> {
        if self.left.get() > 0 {
            Ok(())
        } else {
            Err(spent())
        }
    }

    /// A curve that passes poles of the surface, in parts that end there: parameters jump there.
    fn parted(&self, curve: Curve<DVec3>) -> Result<Vec<Curve<DVec3>>, Problem> {
        let mut parts = vec![curve];
        for &pole in &self.poles {
            let mut parted = Vec::new();
            for part in parts {
                match self.passes(&part, pole) {
                    Some(t) => parted.extend(part.split(t).map_err(Problem::Geometry)?),
                    None => parted.push(part),
                }
            }
            parts = parted;
        }
        Ok(parts)
    }

    /// Where a curve passes a pole; `None` also where it begins or ends there.
    fn passes(&self, curve: &Curve<DVec3>, pole: DVec3) -> Option<f64> {
        let near = self.size * ACCURACY;
        let bounds = curve.hull_bounds();
        let ends = [curve.start(), curve.end()];
        if pole.distance(pole.clamp(bounds.min, bounds.max)) > near
            || ends.iter().any(|end| end.distance(pole) <= self.accuracy)
        {
            return None;
        }
        let off = |t: f64| curve.evaluate(t).distance(pole);
        let (t, distance) = least::least(&curve.knots().breaks(), off);
        (distance <= near).then_some(t)
    }

    /// A curve of space in the parameters of the surface: exactly in planes and along lines
    /// of constant parameters, else to [`ACCURACY`].
    fn on_surface(&self, curve: &Curve<DVec3>) -> Result<Curve<DVec2>, Problem> {
        if let Some(corner) = sheets::parallelogram(self.surface)
            && let Some(flat) = sheets::in_parallelogram(self.surface, corner, curve)
        {
            let normal = corner[1].cross(corner[2]).normalize_or_zero();
            self.note(curve.points().map(|p| normal.dot(p - corner[0]).abs()));
            return Ok(flat);
        }
        self.check_left()?;
        let laid = self.searched(curve);
        self.check_left()?;
        laid
    }

    /// Notes how far points of a curve are beside the surface.
    fn note(&self, off: impl Iterator<Item = f64>) {
        let beside = off.fold(0.0, f64::max) / self.size;
        self.beside.set(self.beside.get().max(beside));
    }

    /// A curve of space in the parameters of the surface, by those of its points.
    fn searched(&self, curve: &Curve<DVec3>) -> Result<Curve<DVec2>, Problem> {
        let (table, off) = self.table(curve)?;
        self.note(iter::once(off));
        if let Some(line) = self.along_border(&table) {
            return Ok(line);
        }
        let at = |t: f64| {
            let next = table
                .partition_point(|(before, _)| *before <= t)
                .clamp(1, table.len() - 1);
            let ((a, from), (b, to)) = (table[next - 1], table[next]);
            let guess = from + (to - from) * ((t - a) / (b - a));
            self.locate(curve.evaluate(t), Some(guess))
        };
        let off = |a: DVec2, b: DVec2| self.point(a).distance(self.point(b));
        let known: Vec<DVec2> = table.iter().map(|(_, uv)| *uv).collect();
        self.straight_or_fitted((curve, &known), at, self.size * ACCURACY, off)
    }

    /// The image of a curve in a parameter domain, of which some places are known from its start to its end: a
    /// straight segment where none of these strays more than `tolerance` from it, else a fitted curve.
    pub(super) fn straight_or_fitted<P: kernel::Point>(
        &self,
        (curve, known): (&Curve<P>, &[DVec2]),
        at: impl Fn(f64) -> DVec2,
        tolerance: f64,
        off: impl Fn(DVec2, DVec2) -> f64,
    ) -> Result<Curve<DVec2>, Problem> {
        let (first, along) = (known[0], known[known.len() - 1] - known[0]);
        let square = along.length_squared();
        let on_line = |p: DVec2| first + along * ((p - first).dot(along) / square).clamp(0.0, 1.0);
        if square > 0.0 && known.iter().all(|&p| off(on_line(p), p) <= tolerance) {
            return Curve::line(first, first + along, 0.0..1.0).map_err(Problem::Geometry);
        }
        let at = |t: f64| {
            self.spend(POINT);
            at(t)
        };
        // What cannot be finished is not made better.
        let off = |a: DVec2, b: DVec2| if self.left.get() > 0 { off(a, b) } else { 0.0 };
        let breaks = curve.knots().breaks();
        let fit = modelling::fit(at, &breaks, tolerance, off).map_err(Problem::Geometry)?;
        self.check_left()?;
        let strays = fit.deviation / tolerance * ACCURACY;
        self.strays.set(self.strays.get().max(strays));
        Ok(fit.curve)
    }

    /// A straight segment on a border of the domain, or on its seam, where that is nowhere farther
    /// from the places of a curve than [`ACCURACY`] on the surface: near poles those may stray in
    /// the parameters.
    fn along_border(&self, table: &[(f64, DVec2)]) -> Option<Curve<DVec2>> {
        let middle = table[table.len() / 2].1;
        (0..2).find_map(|axis| {
            let Range { start, end } = self.domain[axis];
            let share = (middle[axis] - start) / (end - start);
            let moved = |mut uv: DVec2| {
                uv[axis] = start + share.round() * (end - start);
                uv
            };
            let fits = |(_, uv): &(f64, DVec2)| {
                let off = self.point(moved(*uv)).distance(self.point(*uv));
                off <= self.size * ACCURACY
            };
            if (share - share.round()).abs() > BORDER || !table.iter().all(fits) {
                return None;
            }
            let ends = [table[0].1, table[table.len() - 1].1].map(moved);
            Curve::line(ends[0], ends[1], 0.0..1.0).ok()
        })
    }

    /// Points along a curve, by its parameter and those of the surface: those found from the middle on, or from
    /// elsewhere if these go along better, since a surface may touch itself in the middle.
    /// And how far they are from the curve at most.
    fn table(&self, curve: &Curve<DVec3>) -> Result<(Table, f64), Problem> {
        let steps = (8 * curve.knots().breaks().len()).min(2000);
        let mut best = self.table_from(steps / 2, steps, curve)?;
        let (mut least, mut off) = self.astray(&best, curve);
        for from in [steps / 4, 3 * steps / 4] {
            if least <= 1.0 {
                break;
            }
            if let Ok(table) = self.table_from(from, steps, curve) {
                let (astray, own) = self.astray(&table, curve);
                if astray < least {
                    (best, least, off) = (table, astray, own);
                }
            }
        }
        Ok((best, off))
    }

    /// How far points of a table are from their curve, or from each other in the domain, as a share of what is not
    /// out of the ordinary; and the first of these distances.
    fn astray(&self, table: &Table, curve: &Curve<DVec3>) -> (f64, f64) {
        let off = |(t, uv): &(f64, DVec2)| self.point(*uv).distance(curve.evaluate(*t));
        let size = self.domain.each_ref().map(|range| range.end - range.start);
        let step = |pair: &[(f64, DVec2)]| {
            ((pair[1].1 - pair[0].1) / DVec2::from_array(size))
                .abs()
                .max_element()
        };
        let off = table.iter().map(off).fold(0.0, f64::max);
        let step = table.windows(2).map(step).fold(0.0, f64::max);
        ((off / self.size / FAITHFUL).max(step / JUMP), off)
    }

    /// Points after so many steps each, found from one of them outwards, so that none begins at a pole.
    fn table_from(
        &self,
        from: usize,
        steps: usize,
        curve: &Curve<DVec3>,
    ) -> Result<Table, Problem> {
        let Range { start, end } = curve.domain();
        let parameter = |k: usize| start + (end - start) * k as f64 / steps as f64;
        let point = curve.evaluate(parameter(from));
        let first = self.locate(point, None);
        if self.point(first).distance(point) > self.size * BESIDE {
            let text = "a trim curve is not on its surface";
            return Err(Problem::Invalid(text.to_owned()));
        }
        let mut table: Table = (0..=steps).map(|k| (parameter(k), first)).collect();
        // Each is looked for where the two before it lead.
        let guess = |last: DVec2, before: DVec2| Some(last + (last - before));
        for k in from + 1..=steps {
            let point = curve.evaluate(table[k].0);
            table[k].1 = self.locate(point, guess(table[k - 1].1, table[(k - 2).max(from)].1));
        }
        for k in (0..from).rev() {
            let point = curve.evaluate(table[k].0);
            table[k].1 = self.locate(point, guess(table[k + 1].1, table[k + 2].1));
        }
        Ok(table)
    }

    /// The parameters of the point of the surface nearest to a point; beyond the domain where
    /// the surface is closed and the guess is near there.
    pub(super) fn locate(&self, point: DVec3, guess: Option<DVec2>) -> DVec2 {
        let Some(quadric) = self.quadric() else {
            let nearby = self
                .nearby
                .get_or_init(|| Nearby::new(self.surface, self.closed));
            if let Some(guess) = guess.filter(|_| self.left.get() == 0) {
                return guess;
            }
            let found = nearby.nearest(point, guess);
            self.spend(found.work);
            let found = found.uv;
            return guess.map_or(found, |guess| self.steady(self.beside(found, guess), guess));
        };
        let local = self.sheet.place.inverse().transform_point3(point);
        let mut uv = quadric.locate(local, guess);
        let knots = [self.surface.knots_u(), self.surface.knots_v()];
        for (axis, is_angle) in quadric.angles().into_iter().enumerate() {
            if is_angle {
                uv[axis] = wound(knots[axis], uv[axis]);
            }
        }
        guess.map_or(uv, |guess| self.steady(uv, guess))
    }

    /// Parameters of which at a pole those stay as they were that make no difference there.
    fn steady(&self, mut uv: DVec2, guess: DVec2) -> DVec2 {
        if self.poles.is_empty() {
            return uv;
        }
        let point = self.point(uv);
        let at_pole = |pole: &DVec3| pole.distance(point) <= self.size * ACCURACY;
        if !self.poles.iter().any(at_pole) {
            return uv;
        }
        for axis in 0..2 {
            let Range { start, end } = self.domain[axis];
            let mut kept = uv;
            kept[axis] = if self.closed[axis] {
                guess[axis]
            } else {
                guess[axis].max(start).min(end)
            };
            if self.point(kept).distance(self.point(uv)) <= self.size * STEADY {
                uv = kept;
            }
        }
        uv
    }

    /// Parameters moved by whole periods next to others.
    fn beside(&self, uv: DVec2, guess: DVec2) -> DVec2 {
        let mut moved = uv;
        for axis in 0..2 {
            let period = self.domain[axis].end - self.domain[axis].start;
            if self.closed[axis] {
                moved[axis] += ((guess[axis] - uv[axis]) / period).round() * period;
            }
        }
        moved
    }
}
