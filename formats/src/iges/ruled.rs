//! Ruled surfaces (type 118): lines between two rails.
//!
//! The lines join points of equal shares of the parameter or, in form 0, of the length, which is
//! the same along lines and arcs. The parameter of an arc is its angle, which that of no rational
//! curve is; so the rail beside an arc is fitted unless it is such an arc itself.

use std::ops::Range;

use glam::DVec3;
use kernel::{Curve, modelling};

use super::curves::{Rail, Reader, fitted};
use super::parameters::Parameters;
use super::sheets::{SheetShape, Warp};
use crate::Problem;

/// The domain of the surface.
const UNIT: Range<f64> = 0.0..1.0;

/// How far a fitted rail may stray, as a share of its size.
const ACCURACY: f64 = 1e-9;

/// Parameters this close are the same.
const SAME: f64 = 1e-12;

/// Reads a ruled surface.
pub(super) fn surface(
    reader: &mut Reader<'_, '_>,
    index: usize,
    parameters: &mut Parameters<'_>,
    form: i64,
) -> Result<SheetShape, Problem> {
    let [first, second] = [parameters.integer()?, parameters.integer()?];
    let reversed = parameters.integer_or(0)? == 1;
    // Whether it is developable.
    parameters.skip(1);
    let (first, mut second) = (reader.rail(first)?, reader.rail(second)?);
    if form == 0 && !(first.is_even() && second.is_even()) {
        let text = "points of equal arc length are joined in the file, of equal parameters here";
        reader.unsupported(index, text);
    }
    if reversed {
        second = second.reversed();
    }
    let warps = [Warp::new(&first), Warp::new(&second)];
    let geometry = Problem::Geometry;
    let unit = |rail: &Rail| rail.curve.remapped(UNIT).map_err(geometry);
    let mut rails = [unit(&first)?, unit(&second)?];
    let kept = usize::from(warps[0].is_identity());
    let [of_kept, of_other] = [&warps[kept], &warps[1 - kept]];
    let is_same = |k: u32| {
        let share = f64::from(k) / 64.0;
        (of_kept.apply(share, &UNIT) - of_other.apply(share, &UNIT)).abs() <= SAME
    };
    let has_length = rails[1 - kept].hull_bounds().diagonal() > 0.0;
    if has_length && !(0..=64).all(is_same) {
        let (curve, deviation) = beside(&rails[kept], of_kept, &rails[1 - kept], of_other)?;
        rails[1 - kept] = curve;
        reader.unsupported(index, fitted("the rail beside an arc", deviation, ACCURACY));
    }
    // The file has the lines themselves over equal steps, which weights that differ do not.
    match modelling::with_equal_weights(&rails[0], &rails[1]) {
        Ok(equal) => rails = equal,
        Err(problem) => {
            let text = format!("its lines run over their parameter unevenly: {problem}");
            reader.unsupported(index, text);
        }
    }
    reader.check_room(rails.iter(), 2)?;
    let [first, second] = &rails;
    let surface = modelling::ruled(first, second).map_err(geometry)?;
    let warps = [of_kept.clone(), Warp::default()];
    Ok(SheetShape::Splines(vec![surface], warps))
}

/// A rail with the points of `other` where those of `kept` have the same parameter in the file, and
/// how far it strays, as a share of its size.
fn beside(
    kept: &Curve<DVec3>,
    of_kept: &Warp,
    other: &Curve<DVec3>,
    of_other: &Warp,
) -> Result<(Curve<DVec3>, f64), Problem> {
    let at = |parameter: f64| {
        let share = of_kept.undone(parameter, &UNIT);
        other.evaluate(of_other.apply(share, &UNIT).clamp(0.0, 1.0))
    };
    let mut breaks = kept.knots().breaks();
    let inner = other.knots().breaks().into_iter().map(|own| {
        let share = of_other.undone(own, &UNIT);
        of_kept.apply(share, &UNIT)
    });
    breaks.extend(inner.filter(|own| (SAME..1.0 - SAME).contains(own)));
    breaks.sort_by(f64::total_cmp);
    breaks.dedup_by(|a, b| (*a - *b).abs() <= SAME);
    let size = other.hull_bounds().diagonal();
    let fit = modelling::fit(at, &breaks, size * ACCURACY, DVec3::distance);
    let fit = fit.map_err(Problem::Geometry)?;
    Ok((fit.curve, fit.deviation / size))
}
