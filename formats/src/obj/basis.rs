//! The five ways OBJ writes a piecewise polynomial, all turned into B-splines.
//!
//! A surface is treated one direction after the other, so everything here works on several
//! lines of control points at once that share one parameter vector. Bézier and B-spline
//! points are taken over to the last bit; cardinal, Taylor and matrix segments become Bézier
//! segments, which are joined where they meet.

use std::ops::Range;

use glam::DVec4;
use kernel::{KnotVector, MAX_DEGREE};

use super::invalid;
use crate::Problem;

/// What `cstype` names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Basis {
    /// `bmatrix`: powers of the local parameter, by a matrix.
    Matrix,
    /// `bezier`.
    Bezier,
    /// `bspline`.
    Bspline,
    /// `cardinal`: cubic, through all but the outer points.
    Cardinal,
    /// `taylor`: the points are the coefficients of the powers.
    Taylor,
}

impl Basis {
    /// The basis of this name.
    pub(super) fn named(word: &str) -> Option<Self> {
        Some(match word {
            "bmatrix" => Self::Matrix,
            "bezier" => Self::Bezier,
            "bspline" => Self::Bspline,
            "cardinal" => Self::Cardinal,
            "taylor" => Self::Taylor,
            _ => return None,
        })
    }

    /// Whether control points are taken over as they are.
    pub(super) fn keeps_points(self) -> bool {
        matches!(self, Self::Bezier | Self::Bspline)
    }
}

/// One direction of an element: all that is known besides the points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Direction<'a> {
    /// Name of the parameter in messages.
    pub(super) name: &'static str,
    /// The kind of pieces.
    pub(super) basis: Basis,
    /// Polynomial degree, 1 to [`MAX_DEGREE`].
    pub(super) degree: usize,
    /// The values of `parm`.
    pub(super) parm: &'a [f64],
    /// The values of `bmat`, for matrix pieces.
    pub(super) matrix: &'a [f64],
    /// Points from one matrix segment to the next, if that is said.
    pub(super) step: Option<usize>,
}

/// Lines of control points over one knot vector.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Run {
    /// Their knots.
    pub(super) knots: KnotVector,
    /// The lines, in the order given.
    pub(super) lines: Vec<Vec<DVec4>>,
}

impl Direction<'_> {
    /// Of a B-spline whose first and last knot are left out: how many points it needs.
    pub(super) fn outer_count(&self) -> Option<usize> {
        let is_bspline = self.basis == Basis::Bspline && self.parm.len() >= 2;
        let points = (self.parm.len() + 1).checked_sub(self.degree);
        points.filter(|&m| is_bspline && m > self.degree)
    }

    /// Checks the direction by itself and tells how many control points it asks for.
    ///
    /// With `m` points of degree `n`: `parm` has `(m - 1) / n + 1` values for Bézier pieces,
    /// `m + n + 1` for B-splines, `m - 2` for cardinal, `m / (n + 1) + 1` for Taylor and
    /// `(m - 1 - n) / step + 2` for matrix pieces.
    pub(super) fn count(&self) -> Result<usize, Problem> {
        let (name, n, values) = (self.name, self.degree, self.parm.len());
        if n == 0 || n > MAX_DEGREE {
            return Err(Problem::Geometry(kernel::Error::Degree { found: n }));
        }
        if values < 2 {
            return Err(invalid(match values {
                0 => format!("parm {name} is missing"),
                _ => format!("parm {name} has one value; at least 2 are needed"),
            }));
        }
        if self.basis == Basis::Bspline {
            return values.checked_sub(n + 1).filter(|&m| m > n).ok_or_else(|| {
                let least = 2 * (n + 1);
                invalid(format!(
                    "parm {name} has {values} knots; degree {n} needs at least {least}"
                ))
            });
        }
        if let Some(i) = self.parm.windows(2).position(|w| w[1] <= w[0]) {
            let (before, found) = (self.parm[i], self.parm[i + 1]);
            return Err(invalid(format!(
                "parm {name}: value {} is {found} after {before}; the values must increase",
                i + 2
            )));
        }
        let segments = values - 1;
        let count = match self.basis {
            Basis::Cardinal if n != 3 => {
                return Err(invalid(format!(
                    "degree {n}; cardinal pieces have degree 3"
                )));
            }
            Basis::Matrix => {
                let expected = (n + 1) * (n + 1);
                if self.matrix.len() != expected {
                    let found = self.matrix.len();
                    return Err(invalid(format!(
                        "bmat {name} has {found} values; degree {n} needs {expected}"
                    )));
                }
                let step = match self.step {
                    None => {
                        return Err(invalid(format!("no step along {name}; bmatrix needs one")));
                    }
                    Some(0) => {
                        return Err(invalid(format!("step 0 along {name}; steps begin at 1")));
                    }
                    Some(step) => step,
                };
                let steps = (segments - 1).checked_mul(step);
                steps.and_then(|m| m.checked_add(n + 1))
            }
            Basis::Taylor => segments.checked_mul(n + 1),
            Basis::Cardinal => Some(segments + 3),
            Basis::Bezier | Basis::Bspline => segments.checked_mul(n).map(|m| m + 1),
        };
        count.ok_or_else(|| invalid(format!("the step along {name} is too large")))
    }

    /// The parameters for which the pieces are defined; [`Direction::count`] has passed.
    pub(super) fn domain(&self) -> Range<f64> {
        let last = self.parm.len() - 1;
        match self.basis {
            Basis::Bspline => self.parm[self.degree]..self.parm[last - self.degree],
            _ => self.parm[0]..self.parm[last],
        }
    }

    /// How many control points one line becomes at most.
    pub(super) fn converted_count(&self) -> usize {
        match self.basis {
            Basis::Bspline => self.parm.len(),
            _ => self.parm.len().saturating_mul(self.degree + 1),
        }
    }

    /// The lines over knot vectors. There are several runs only where segments do not meet.
    ///
    /// The lines are homogeneous, except that Bézier and B-spline points may be anything;
    /// each has the length of [`Direction::count`].
    pub(super) fn runs(&self, lines: Vec<Vec<DVec4>>) -> Result<Vec<Run>, Problem> {
        if self.basis == Basis::Bspline {
            let knots = self.knots(self.parm.to_vec())?;
            return Ok(vec![Run { knots, lines }]);
        }
        if self.basis == Basis::Bezier {
            let knots = self.knots(self.piecewise(0..self.parm.len() - 1))?;
            return Ok(vec![Run { knots, lines }]);
        }
        let lines: Vec<_> = lines.iter().map(|line| self.segments(line)).collect();
        let last = self.parm.len() - 1;
        let (mut runs, mut start) = (Vec::new(), 0);
        for end in 1..=last {
            if end < last && lines.iter().all(|line| meet(&line[end - 1], &line[end])) {
                continue;
            }
            let knots = self.knots(self.piecewise(start..end))?;
            let lines = lines.iter().map(|line| joined(&line[start..end])).collect();
            runs.push(Run { knots, lines });
            start = end;
        }
        Ok(runs)
    }

    fn knots(&self, knots: Vec<f64>) -> Result<KnotVector, Problem> {
        KnotVector::new(self.degree, knots)
            .map_err(|error| invalid(format!("parm {}: {error}", self.name)))
    }

    /// Knots of joined Bézier pieces over some of the segments.
    fn piecewise(&self, segments: Range<usize>) -> Vec<f64> {
        let (n, parm) = (self.degree, &self.parm[segments.start..=segments.end]);
        let mut knots: Vec<f64> = parm.iter().flat_map(|&t| vec![t; n]).collect();
        knots.insert(0, parm[0]);
        knots.push(parm[parm.len() - 1]);
        knots
    }

    /// The Bézier points of every segment of a line.
    fn segments(&self, line: &[DVec4]) -> Vec<Vec<DVec4>> {
        let n = self.degree;
        match self.basis {
            Basis::Cardinal => line
                .windows(4)
                .map(|c| {
                    let inner = [c[1] + (c[2] - c[0]) / 6.0, c[2] - (c[3] - c[1]) / 6.0];
                    vec![c[1], inner[0], inner[1], c[2]]
                })
                .collect(),
            Basis::Matrix => {
                let segment = |i: usize| {
                    let first = i * self.step.unwrap_or(1);
                    let points = &line[first..=first + n];
                    let power = |j: usize| {
                        let terms = points.iter().enumerate();
                        terms.map(|(i, &p)| p * self.matrix[i * (n + 1) + j]).sum()
                    };
                    bezier_from_powers(&(0..=n).map(power).collect::<Vec<_>>())
                };
                (0..self.parm.len() - 1).map(segment).collect()
            }
            _ => line.chunks_exact(n + 1).map(bezier_from_powers).collect(),
        }
    }
}

/// Bézier points of the polynomial with these coefficients, on 0 to 1: the point `k` is the
/// sum over `j <= k` of `C(k, j) / C(n, j)` times coefficient `j`.
fn bezier_from_powers(powers: &[DVec4]) -> Vec<DVec4> {
    let n = powers.len() - 1;
    let point = |k: usize| {
        let (mut sum, mut factor) = (DVec4::ZERO, 1.0);
        for (j, &power) in powers[..=k].iter().enumerate() {
            sum += power * factor;
            factor *= (k - j) as f64 / (n - j).max(1) as f64;
        }
        sum
    };
    (0..=n).map(point).collect()
}

/// Whether one segment ends where the next begins, up to rounding.
fn meet(before: &[DVec4], after: &[DVec4]) -> bool {
    let (end, start) = (before[before.len() - 1], after[0]);
    let size = before
        .iter()
        .chain(after)
        .fold(0.0, |s: f64, p| s.max(p.abs().max_element()));
    (end - start).abs().max_element() <= 1e-12 * size
}

/// The points of segments that meet.
fn joined(segments: &[Vec<DVec4>]) -> Vec<DVec4> {
    let rest = segments[1..].iter().flat_map(|s| &s[1..]);
    segments[0].iter().chain(rest).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn direction<'a>(basis: Basis, degree: usize, parm: &'a [f64]) -> Direction<'a> {
        Direction {
            name: "u",
            basis,
            degree,
            parm,
            matrix: &[],
            step: None,
        }
    }

    fn points(xs: &[f64]) -> Vec<DVec4> {
        xs.iter().map(|&x| DVec4::new(x, 0.0, 0.0, 0.0)).collect()
    }

    fn xs(run: &Run) -> Vec<f64> {
        run.lines[0].iter().map(|p| p.x).collect()
    }

    #[test]
    fn counts_follow_the_table() {
        let parm: Vec<f64> = (0..5).map(f64::from).collect();
        assert_eq!(direction(Basis::Bezier, 3, &parm).count(), Ok(13));
        assert_eq!(direction(Basis::Cardinal, 3, &parm[..4]).count(), Ok(6));
        assert_eq!(direction(Basis::Taylor, 4, &parm[..2]).count(), Ok(5));
        assert_eq!(direction(Basis::Bspline, 1, &parm[..4]).count(), Ok(2));
        let hermite = Direction {
            matrix: &[0.0; 16],
            step: Some(2),
            ..direction(Basis::Matrix, 3, &parm[..3])
        };
        assert_eq!(hermite.count(), Ok(6));
        assert!(direction(Basis::Bspline, 3, &parm).count().is_err());
        assert!(direction(Basis::Bezier, 0, &parm).count().is_err());
        assert!(direction(Basis::Bezier, 31, &parm).count().is_err());
        let huge = Direction {
            step: Some(usize::MAX),
            ..hermite
        };
        assert!(huge.count().is_err());
    }

    #[test]
    fn a_taylor_segment_is_its_polynomial() {
        // x = 1 + 2t + 3t^2 on 0..1 has Bézier points 1, 2, 6.
        let runs = direction(Basis::Taylor, 2, &[0.0, 1.0])
            .runs(vec![points(&[1.0, 2.0, 3.0])])
            .unwrap();
        assert_eq!(xs(&runs[0]), [1.0, 2.0, 6.0]);
    }

    #[test]
    fn segments_that_do_not_meet_stay_apart() {
        let parm = [0.0, 1.0, 2.0];
        let taylor = direction(Basis::Taylor, 1, &parm);
        let joined = taylor.runs(vec![points(&[0.0, 1.0, 1.0, 5.0])]).unwrap();
        assert_eq!(joined.len(), 1);
        assert_eq!(xs(&joined[0]), [0.0, 1.0, 6.0]);
        assert_eq!(joined[0].knots.as_slice(), [0.0, 0.0, 1.0, 2.0, 2.0]);
        let apart = taylor.runs(vec![points(&[0.0, 1.0, 3.0, 5.0])]).unwrap();
        assert_eq!(apart.len(), 2);
        assert_eq!(xs(&apart[1]), [3.0, 8.0]);
        assert_eq!(apart[1].knots.as_slice(), [1.0, 1.0, 2.0, 2.0]);
    }

    #[test]
    fn cardinal_pieces_pass_through_the_inner_points() {
        let runs = direction(Basis::Cardinal, 3, &[0.0, 1.0, 2.0])
            .runs(vec![points(&[0.0, 6.0, 12.0, 6.0, 0.0])])
            .unwrap();
        assert_eq!(xs(&runs[0]), [6.0, 8.0, 12.0, 12.0, 12.0, 8.0, 6.0]);
    }

    #[test]
    fn the_bezier_matrix_gives_back_its_points() {
        let matrix = [
            1., -3., 3., -1., 0., 3., -6., 3., 0., 0., 3., -3., 0., 0., 0., 1.,
        ];
        let cubic = Direction {
            matrix: &matrix,
            step: Some(3),
            ..direction(Basis::Matrix, 3, &[0.0, 1.0, 2.0])
        };
        let given = [0.0, 1.0, -2.0, 4.0, 3.0, 2.0, 8.0];
        let runs = cubic.runs(vec![points(&given)]).unwrap();
        assert_eq!(runs.len(), 1);
        for (found, expected) in xs(&runs[0]).iter().zip(given) {
            assert!((found - expected).abs() < 1e-14);
        }
    }
}
