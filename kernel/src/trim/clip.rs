//! Loops clipped to a range of one parameter.

use std::ops::Range;
use std::slice;

use glam::DVec2;

use super::TrimLoop;
use super::close::{NEAR, hull};
use super::parts::{cut, snapped};
use crate::{Curve, Error};

/// Parts of a loop no wider than this share of a range are rounding: curves laid onto surfaces
/// are no more accurate.
const SLIVER: f64 = 1e-7;

/// A part of a loop between two places on the border of a range, of consecutive curves.
type Run = Vec<Curve<DVec2>>;

/// An end of a run: its number, and whether it is the last end instead of the first.
type End = (usize, bool);

/// The parts of a loop over a range of one parameter, each closed along the border of the range;
/// none where there are none but slivers.
pub(super) fn clipped(
    trim: TrimLoop,
    axis: usize,
    range: Range<f64>,
) -> Result<Vec<TrimLoop>, Error> {
    let near = NEAR * (range.end - range.start);
    let (min, max) = trim.hull();
    if range.start - near <= min[axis] && max[axis] <= range.end + near {
        return Ok(vec![trim]);
    }
    let runs = runs(&trim, axis, &range)?;
    let across = SLIVER * (max[1 - axis] - min[1 - axis]);
    let loops = joined(runs, axis, f64::midpoint(range.start, range.end), across);
    let is_wide = |curves: &Vec<Curve<DVec2>>| {
        let (min, max) = hull(curves);
        max[axis] - min[axis] > SLIVER * (range.end - range.start)
    };
    let loops = loops.into_iter().filter(is_wide);
    loops
        .map(|curves| TrimLoop::new(curves, f64::INFINITY))
        .collect()
}

/// The parts of a loop over a range, but for what runs along its border: that bounds nothing
/// that is not bounded without it.
fn runs(trim: &TrimLoop, axis: usize, range: &Range<f64>) -> Result<Vec<Run>, Error> {
    let near = SLIVER * (range.end - range.start);
    let is_kept = |piece: &Curve<DVec2>| {
        let middle = f64::midpoint(piece.domain().start, piece.domain().end);
        let place = piece.evaluate(middle)[axis];
        let (min, max) = hull(slice::from_ref(piece));
        (range.start..=range.end).contains(&place)
            && max[axis] > range.start + near
            && min[axis] < range.end - near
    };
    let mut runs: Vec<Run> = Vec::new();
    // Whether the last piece was kept, and the first.
    let (mut goes_on, mut begun) = (false, None);
    for curve in &trim.segments {
        for piece in cut(curve, axis, &[range.start, range.end])? {
            let piece = snapped(&piece, axis, range, SLIVER)?;
            let is_kept = is_kept(&piece);
            begun.get_or_insert(is_kept);
            match runs.last_mut() {
                Some(run) if is_kept && goes_on => run.push(piece),
                _ if is_kept => runs.push(vec![piece]),
                _ => {}
            }
            goes_on = is_kept;
        }
    }
    // The first goes on from the last where the loop begins in it.
    if goes_on
        && begun == Some(true)
        && runs.len() > 1
        && let Some(mut run) = runs.pop()
    {
        run.append(&mut runs[0]);
        runs[0] = run;
    }
    Ok(runs)
}

/// Loops of runs that begin and end on the border below or above `middle`.
///
/// Along each border what is inside lies between the first end and the second, the third and the fourth,
/// and so on. Where ends are no farther apart than `near` their order is not known: what is inside lies
/// between where a run begins and where one ends.
fn joined(runs: Vec<Run>, axis: usize, middle: f64, near: f64) -> Vec<Vec<Curve<DVec2>>> {
    let mut borders: [Vec<(f64, End)>; 2] = Default::default();
    for (number, run) in runs.iter().enumerate() {
        let (Some(first), Some(last)) = (run.first(), run.last()) else {
            continue;
        };
        for (place, is_last) in [(first.start(), false), (last.end(), true)] {
            let border = &mut borders[usize::from(place[axis] > middle)];
            border.push((place[1 - axis], (number, is_last)));
        }
    }
    let mut next = vec![[None; 2]; runs.len()];
    for border in &mut borders {
        border.sort_by(|a, b| a.0.total_cmp(&b.0));
        for k in (1..border.len()).step_by(2) {
            let (place, is_last) = (border[k].0, border[k].1.1);
            if is_last == border[k - 1].1.1 {
                let tied = border[k..].iter().take_while(|end| end.0 <= place + near);
                let other = tied.map(|end| end.1.1).position(|kind| kind != is_last);
                border.swap(k, k + other.unwrap_or(0));
            }
        }
        for pair in border.as_chunks::<2>().0 {
            let [a, b] = pair.map(|(_, end)| end);
            next[a.0][usize::from(a.1)] = Some(b);
            next[b.0][usize::from(b.1)] = Some(a);
        }
    }
    let mut left: Vec<_> = runs.into_iter().map(Some).collect();
    let mut loops = Vec::new();
    for first in 0..left.len() {
        let mut curves = Vec::new();
        let mut begin = Some((first, false));
        while let Some((number, is_last)) = begin
            && let Some(run) = left[number].take()
        {
            if is_last {
                curves.extend(run.iter().rev().map(Curve::reversed));
            } else {
                curves.extend(run);
            }
            begin = next[number][usize::from(!is_last)];
        }
        if !curves.is_empty() {
            loops.push(curves);
        }
    }
    loops
}
