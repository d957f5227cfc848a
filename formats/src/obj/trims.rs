//! `trim` and `hole`: from pieces of numbered curves to closed loops.

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4};
use kernel::{Curve, TrimLoop};

use super::invalid;
use super::specials::TrimCurve;
use super::statements::{Statement, number, reference};
use crate::Problem;

/// Gaps between trim curves up to this share of the surface's longer side are bridged;
/// files write six digits or fewer.
const GAP: f64 = 1e-4;

/// One `trim` or `hole` statement.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LoopText {
    /// Where it stands.
    pub(super) line: usize,
    /// Whether it is a hole.
    pub(super) hole: bool,
    /// Its pieces, in order.
    pub(super) pieces: Vec<Piece>,
}

/// A part of a numbered curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    /// Parameter where it begins.
    start: f64,
    /// Parameter where it ends; less than `start` where the curve is run through backwards.
    end: f64,
    /// Position among the `curv2` elements.
    curve: usize,
}

impl LoopText {
    /// Reads the statement; `curves` is the number of `curv2` elements so far.
    pub(super) fn parse(statement: &Statement<'_>, curves: usize) -> Result<Self, Problem> {
        let words: Vec<_> = statement.arguments().collect();
        if words.is_empty() || words.len() % 3 != 0 {
            return Err(invalid(format!(
                "{} words; each part of a loop takes three: start, end and curve",
                words.len()
            )));
        }
        let pieces = words.chunks(3).map(|words| Piece::parse(words, curves));
        let pieces = pieces.collect::<Result<_, _>>();
        Ok(Self {
            line: statement.line,
            hole: statement.keyword() == "hole",
            pieces: pieces.map_err(invalid)?,
        })
    }

    /// How many control points the curves of the loop have together.
    pub(super) fn size(&self, curves: &[Option<TrimCurve>]) -> usize {
        let curve = |piece: &Piece| curves.get(piece.curve)?.as_ref();
        let curves = self.pieces.iter().filter_map(curve);
        curves.map(|found| found.curve.homogeneous().len()).sum()
    }

    /// The special points of its curves, as far as they are on its pieces.
    pub(super) fn special_points(&self, curves: &[Option<TrimCurve>]) -> Vec<DVec2> {
        let mut points = Vec::new();
        for piece in &self.pieces {
            let Some(Some(found)) = curves.get(piece.curve) else {
                continue;
            };
            let range = piece.start.min(piece.end)..=piece.start.max(piece.end);
            let on = found.points.iter().filter(|t| range.contains(t));
            points.extend(on.map(|&t| found.curve.evaluate(t)));
        }
        points
    }

    /// The closed loop; `curves` holds `None` for those that could not be read.
    pub(super) fn close(
        &self,
        curves: &[Option<TrimCurve>],
        domain: &[Range<f64>; 2],
    ) -> Result<TrimLoop, Problem> {
        let pieces = self.pieces.iter().map(|piece| piece.cut(curves));
        let pieces = pieces.collect::<Result<Vec<_>, _>>()?;
        let longer = domain.iter().map(|d| d.end - d.start).fold(0.0, f64::max);
        Ok(TrimLoop::new(pieces, GAP * longer)?)
    }
}

impl Piece {
    /// Reads start, end and curve; `curves` is the number of `curv2` elements so far.
    pub(super) fn parse(words: &[&str], curves: usize) -> Result<Self, String> {
        let [start, end, curve] = words else {
            return Err(format!("{} words where 3 are needed", words.len()));
        };
        Ok(Self {
            start: number(start)?,
            end: number(end)?,
            curve: reference(curve, curves, "trim curves")?,
        })
    }

    /// The part of the curve, in the direction asked for.
    pub(super) fn cut(&self, curves: &[Option<TrimCurve>]) -> Result<Curve<DVec2>, Problem> {
        let number = self.curve + 1;
        let Some(Some(TrimCurve { curve, .. })) = curves.get(self.curve) else {
            return Err(invalid(format!("trim curve {number} could not be read")));
        };
        let Range { start, end } = curve.domain();
        // Files round the same number to different digits in different places.
        let (near, far) = (1e-9 * (end - start), GAP * (end - start));
        let (low, high) = (self.start.min(self.end), self.start.max(self.end));
        if low < start - far || high > end + far || high - low <= near {
            return Err(invalid(format!(
                "parameters {} to {} of trim curve {number}, which goes from {start} to {end}",
                self.start, self.end
            )));
        }
        let low = if low <= start + near { start } else { low };
        let high = if high >= end - near { end } else { high };
        let range = low..high;
        let part = if range == curve.domain() {
            curve.clone()
        } else {
            curve.restricted(range)?
        };
        Ok(if self.start > self.end {
            part.reversed()
        } else {
            part
        })
    }
}

/// A control point `vp` as elements take it: place in the plane, and weight.
pub(super) fn lifted(point: DVec3) -> DVec4 {
    DVec4::new(point.x, point.y, 0.0, point.z)
}
