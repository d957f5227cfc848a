//! Curves of the parameter domain of a face.

use std::ops::Range;

use glam::{DAffine2, DVec2, DVec3};
use kernel::Curve;

use super::laid::POINT;
use super::{ACCURACY, ASTRAY, COARSE, MEETS, Source, Trimmer};
use crate::Problem;
use crate::iges::boundary::Use;
use crate::iges::curves::{OFF, Rail, Reader};
use crate::iges::order::Chain;
use crate::iges::sheets::{SheetShape, Warp};

/// Curves of the parameter domain that miss their curves of space by more than this share of
/// the surface's size are not believed.
const MISSES: f64 = 2e-3;

/// So are those that miss them by more than this share of their own size, and [`COARSE`].
const SHARE: f64 = 0.1;

/// A curve of space is held against the surface at the ends of so many parts.
const PLACES: u8 = 8;

/// Why curves of the parameter domain are not believed.
pub(super) fn elsewhere() -> Problem {
    let text = "a curve of the parameter domain is not where its curve of space is";
    Problem::Invalid(text.to_owned())
}

impl Trimmer<'_> {
    /// The curves of a stretch in the parameter domain, if they are where its curve of space is, or
    /// if that is off the surface.
    pub(super) fn flat(
        &self,
        reader: &mut Reader<'_, '_>,
        face: usize,
        stretch: &Use,
        source: Source,
    ) -> Result<Chain, Problem> {
        let mut curves = Vec::new();
        for &pointer in &stretch.flat {
            curves.extend(reader.flat(pointer)?);
        }
        let SheetShape::Splines(_, warps) = &self.sheet.shape else {
            return Ok(curves);
        };
        if warps.iter().any(|warp| !warp.is_identity()) {
            self.wind(&mut curves, warps);
            let warped = curves.iter().map(|curve| self.warped(curve, warps));
            curves = warped.collect::<Result<_, _>>()?;
        }
        if stretch.space == 0 || source == Source::FlatAnywhere {
            return Ok(curves);
        }
        let rails = match reader.glimpse_along(stretch) {
            Err(problem) if source == Source::FlatAlong => return Err(problem),
            // Nothing to compare with.
            Err(_) => return Ok(curves),
            Ok(rails) => rails,
        };
        if source == Source::FlatAlong {
            self.check_along(&curves, &rails)?;
        } else if rails.len() == curves.len() {
            let apart = |curve: &Curve<DVec2>, rail: &Rail| {
                let own = [self.point(curve.start()), self.point(curve.end())];
                let other = [rail.curve.start(), rail.curve.end()];
                let with = own[0].distance(other[0]).max(own[1].distance(other[1]));
                let against = own[0].distance(other[1]).max(own[1].distance(other[0]));
                with.min(against)
            };
            let mut is_off = false;
            for (curve, rail) in curves.iter().zip(&rails) {
                let apart = apart(curve, rail);
                let length = rail.curve.hull_bounds().diagonal();
                let most = (self.size * MISSES).min(self.size * COARSE + length * SHARE);
                if apart <= most && !self.is_beside(curve, rail, most) {
                    continue;
                }
                if !self.is_off(&rail.curve, apart.max(most) / 2.0) {
                    return Err(elsewhere());
                }
                is_off = true;
            }
            if is_off {
                reader.repaired(face, OFF);
            }
        }
        if let ([curve], [rail]) = (curves.as_slice(), rails.as_slice()) {
            let mut space = rail.curve.clone();
            if stretch.reversed {
                space = space.reversed();
            }
            if self.runs_against(curve, &space) {
                curves = vec![curve.reversed()];
            }
        }
        Ok(curves)
    }

    /// Whether a curve of space is farther off the surface than that, and than what is told anyway.
    fn is_off(&self, curve: &Curve<DVec3>, least: f64) -> bool {
        let least = least.max(self.size * ASTRAY);
        let Range { start, end } = curve.domain();
        let is_off = |k: u8| {
            let share = f64::from(k) / f64::from(PLACES);
            let point = curve.evaluate(start + (end - start) * share);
            self.point(self.locate(point, None)).distance(point) > least
        };
        !self.is_torn() && self.left.get() > 0 && (0..=PLACES).any(is_off)
    }

    /// Moves curves by whole turns into the domain, along parameters that are angles.
    fn wind(&self, curves: &mut Chain, warps: &[Warp; 2]) {
        for (axis, warp) in warps.iter().enumerate() {
            let domain = &self.whole[axis];
            let Some(turn) = warp.turn(domain) else {
                continue;
            };
            let points = || curves.iter().flat_map(Curve::points).map(|p| p[axis]);
            let least = points().fold(f64::INFINITY, f64::min);
            let largest = points().fold(f64::NEG_INFINITY, f64::max);
            let off = f64::midpoint(domain.start, domain.end) - f64::midpoint(least, largest);
            let turns = (off / turn).round();
            if turns != 0.0 && turns.is_finite() {
                let mut shift = DVec2::ZERO;
                shift[axis] = turns * turn;
                let map = DAffine2::from_translation(shift);
                for curve in curves.iter_mut() {
                    *curve = curve.transformed(&map);
                }
            }
        }
    }

    /// Whether a curve of the parameter domain runs against a curve of space.
    fn runs_against(&self, flat: &Curve<DVec2>, space: &Curve<DVec3>) -> bool {
        let share = |domain: Range<f64>, s: f64| domain.start + (domain.end - domain.start) * s;
        let own = |s: f64| self.point(flat.evaluate(share(flat.domain(), s)));
        let other = |s: f64| space.evaluate(share(space.domain(), s));
        let is_closed = other(0.0).distance(other(1.0)) <= self.size * MEETS;
        let [a, b] = if is_closed { [0.25, 0.75] } else { [0.0, 1.0] };
        let with = own(a).distance(other(a)) + own(b).distance(other(b));
        let against = own(a).distance(other(b)) + own(b).distance(other(a));
        against < with
    }

    /// A curve in the parameters of the surface, for one in those of the file.
    fn warped(&self, curve: &Curve<DVec2>, warps: &[Warp; 2]) -> Result<Curve<DVec2>, Problem> {
        let image = |uv: DVec2| {
            DVec2::new(
                warps[0].apply(uv.x, &self.whole[0]),
                warps[1].apply(uv.y, &self.whole[1]),
            )
        };
        let at = |t: f64| image(curve.evaluate(t));
        let [size_u, size_v] = self.domain.clone().map(|d| d.end - d.start);
        let size = DVec2::new(size_u, size_v);
        let off = |a: DVec2, b: DVec2| ((a - b) / size).length();
        let Range { start, end } = curve.domain();
        let place = |k: u8| {
            self.spend(POINT);
            at(start + (end - start) * f64::from(k) / 12.0)
        };
        let known: Vec<DVec2> = (0..=12).map(place).collect();
        self.check_left()?;
        self.straight_or_fitted((curve, &known), at, ACCURACY, off)
    }
}
