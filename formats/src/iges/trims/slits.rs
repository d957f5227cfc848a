//! Loops of curves of space that run along a seam both ways.
//!
//! In the parameter domain a loop does not run over itself. Where it does in space, along the seam,
//! it runs along both sides of the domain, and the face is on both sides of the seam there. That
//! alone tells which part of a sphere such a loop bounds, whichever way it runs.

use glam::{DAffine2, DVec2};
use kernel::Curve;

use super::{ACCURACY, Trimmer};
use crate::iges::order::Chain;

/// Curves that run along a seam both ways do so over more than this share of it.
const SHARED: f64 = 1e-3;

/// Loops with more curves along a seam stay as they are.
const MANY: usize = 100;

impl Trimmer<'_> {
    /// The curves of a loop laid onto a surface with a pole, all in the domain, and those along the
    /// seam at the side of it where they belong; `None` if none run there both ways.
    pub(super) fn slit(&self, chain: &Chain) -> Option<Chain> {
        let axis = match self.closed {
            [true, false] => 0,
            [false, true] => 1,
            _ => return None,
        };
        if self.poles.is_empty() {
            return None;
        }
        let slit = Slit::new(self, axis, chain);
        let both_ways = slit.both_ways();
        if both_ways.is_empty() {
            return None;
        }
        let sides = slit.sides(&both_ways);
        let placed: Chain = chain
            .iter()
            .zip(sides)
            .map(|(curve, side)| slit.placed(curve, side))
            .collect::<Option<_>>()?;
        let side = |k: usize| slit.turns(placed[k].start()).round();
        let are_apart = both_ways
            .iter()
            .all(|[a, b]| (side(*a) - side(*b)).abs() > 0.5);
        (are_apart && slit.is_joined(&placed)).then_some(placed)
    }
}

/// A loop and what there is to know about the seam.
struct Slit<'a, 't> {
    trimmer: &'a Trimmer<'t>,
    /// The parameter along which the surface is closed.
    axis: usize,
    chain: &'a Chain,
    /// What each curve runs through along the seam, if it lies on it.
    along: Vec<Option<[f64; 2]>>,
}

impl<'a, 't> Slit<'a, 't> {
    fn new(trimmer: &'a Trimmer<'t>, axis: usize, chain: &'a Chain) -> Self {
        let mut slit = Self {
            trimmer,
            axis,
            chain,
            along: Vec::new(),
        };
        slit.along = chain.iter().map(|curve| slit.along_seam(curve)).collect();
        slit
    }

    /// What a curve on the seam runs through along it.
    fn along_seam(&self, curve: &Curve<DVec2>) -> Option<[f64; 2]> {
        let side = self.turns(curve.start()).round();
        let is_on_seam = |uv: DVec2| (self.turns(uv) - side).abs() <= ACCURACY;
        let ends = [curve.start(), curve.end()].map(|uv| uv[1 - self.axis]);
        curve.points().all(is_on_seam).then_some(ends)
    }

    /// How many periods a place is from where the domain begins.
    fn turns(&self, uv: DVec2) -> f64 {
        let domain = &self.trimmer.domain[self.axis];
        (uv[self.axis] - domain.start) / (domain.end - domain.start)
    }

    fn is_pole(&self, uv: DVec2) -> bool {
        let Trimmer {
            poles, accuracy, ..
        } = self.trimmer;
        let point = self.trimmer.point(uv);
        poles.iter().any(|pole| pole.distance(point) <= *accuracy)
    }

    /// Whether two curves run along the same part of the seam, one against the other.
    fn runs_against(&self, curve: usize, other: usize) -> bool {
        let (Some([a, b]), Some([c, d])) = (self.along[curve], self.along[other]) else {
            return false;
        };
        let domain = &self.trimmer.domain[1 - self.axis];
        let shared = a.max(b).min(c.max(d)) - a.min(b).max(c.min(d));
        (b - a) * (d - c) < 0.0 && shared > SHARED * (domain.end - domain.start)
    }

    /// Pairs of curves that run along the same part of the seam, one against the other.
    fn both_ways(&self) -> Vec<[usize; 2]> {
        let on_seam = self.on_seam();
        if on_seam.len() > MANY {
            return Vec::new();
        }
        let pairs = on_seam.iter().enumerate();
        let pairs = pairs.flat_map(|(k, a)| on_seam[..k].iter().map(|b| [*a, *b]));
        pairs.filter(|[a, b]| self.runs_against(*a, *b)).collect()
    }

    fn on_seam(&self) -> Vec<usize> {
        let all = 0..self.chain.len();
        all.filter(|k| self.along[*k].is_some()).collect()
    }

    /// At which side of the domain the curves along the seam belong, by their neighbours, or, between
    /// poles, by those that run against them.
    fn sides(&self, both_ways: &[[usize; 2]]) -> Vec<Option<f64>> {
        let mut sides = vec![None; self.chain.len()];
        let on_seam = self.on_seam();
        for _ in &on_seam {
            let mut open = on_seam.iter().filter(|k| sides[**k].is_none());
            let found = open.find_map(|k| Some((*k, self.beside(*k, &sides)?)));
            let found = found.or_else(|| {
                let pairs = both_ways.iter().flat_map(|[a, b]| [(*a, *b), (*b, *a)]);
                let mut open = pairs.filter(|(k, _)| sides[*k].is_none());
                open.find_map(|(k, other)| Some((k, 1.0 - sides[other]?)))
            });
            match found {
                Some((k, side)) => sides[k] = Some(side),
                None => break,
            }
        }
        sides
    }

    /// The side of the domain where a curve along the seam meets the curves before or after it, but
    /// for poles.
    fn beside(&self, k: usize, sides: &[Option<f64>]) -> Option<f64> {
        let count = self.chain.len();
        let (before, after) = ((k + count - 1) % count, (k + 1) % count);
        let [own, last, next] = [k, before, after].map(|k| &self.chain[k]);
        let side = |own: DVec2, other: usize, end: DVec2| {
            if self.is_pole(own) {
                return None;
            }
            match self.along[other] {
                Some(_) => sides[other],
                None => Some((self.turns(end) - self.periods(&self.chain[other])).round()),
            }
        };
        side(own.start(), before, last.end()).or_else(|| side(own.end(), after, next.start()))
    }

    /// How many periods off the domain the middle of a curve is.
    fn periods(&self, curve: &Curve<DVec2>) -> f64 {
        let turns = || curve.points().map(|uv| self.turns(uv));
        let least = turns().fold(f64::INFINITY, f64::min);
        let largest = turns().fold(f64::NEG_INFINITY, f64::max);
        f64::midpoint(least, largest).floor()
    }

    /// A curve in the domain, at a side of it if it runs along the seam.
    fn placed(&self, curve: &Curve<DVec2>, side: Option<f64>) -> Option<Curve<DVec2>> {
        let periods = match side {
            Some(side) => self.turns(curve.start()).round() - side,
            None => self.periods(curve),
        };
        let domain = &self.trimmer.domain[self.axis];
        let mut shift = DVec2::ZERO;
        shift[self.axis] = -periods * (domain.end - domain.start);
        let placed = curve.transformed(&DAffine2::from_translation(shift));
        let is_inside = |uv| (-ACCURACY..=1.0 + ACCURACY).contains(&self.turns(uv));
        let is_inside = placed.points().all(is_inside);
        is_inside.then_some(placed)
    }

    /// Whether curves meet without a jump but at poles.
    fn is_joined(&self, placed: &Chain) -> bool {
        let next = placed.iter().cycle().skip(1);
        placed.iter().zip(next).all(|(curve, next)| {
            let (end, next) = (curve.end(), next.start());
            self.is_pole(end) || (self.turns(end) - self.turns(next)).abs() < 0.5
        })
    }
}
