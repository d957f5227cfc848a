//! Why a knot vector, curve, surface, loop or scene part cannot exist.

use std::fmt;

use crate::FARTHEST;

/// A geometric object that cannot be constructed, with the offending numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// The degree is zero or above [`crate::MAX_DEGREE`].
    Degree {
        /// The degree asked for.
        found: usize,
    },
    /// The degree is below the one that is to be raised.
    DegreeBelow {
        /// The degree asked for.
        found: usize,
        /// The present degree.
        present: usize,
    },
    /// The knot vector has the wrong number of knots for its points.
    KnotCount {
        /// Knots given.
        found: usize,
        /// Knots needed: points + degree + 1.
        expected: usize,
    },
    /// A knot is infinite or not a number.
    KnotNotFinite {
        /// Position in the knot vector.
        index: usize,
    },
    /// A knot is smaller than the one before it.
    KnotsDecrease {
        /// Position of the smaller knot.
        index: usize,
        /// The knot before it.
        before: f64,
        /// The knot found.
        found: f64,
    },
    /// A knot is repeated so often that the curve falls apart.
    KnotMultiplicity {
        /// The repeated knot.
        knot: f64,
        /// How often it stands there.
        found: usize,
        /// How often it may stand there.
        allowed: usize,
    },
    /// The first and the last knot of the domain are equal.
    EmptyDomain {
        /// Start of the domain.
        start: f64,
        /// End of the domain.
        end: f64,
    },
    /// The number of control points is wrong.
    PointCount {
        /// Points given.
        found: usize,
        /// Points needed.
        expected: usize,
    },
    /// There are more control points than memory holds.
    TooManyPoints {
        /// Points asked for.
        found: usize,
    },
    /// The number of weights differs from the number of control points.
    WeightCount {
        /// Weights given.
        found: usize,
        /// Weights needed.
        expected: usize,
    },
    /// A coordinate is infinite or not a number, or a point is farther than [`FARTHEST`](crate::FARTHEST) from
    /// the origin, also with its weight.
    NotFinite {
        /// Position in the list of points.
        index: usize,
    },
    /// What is shown reaches farther than [`FARTHEST`](crate::FARTHEST) from the origin, where its nodes put
    /// it.
    TooFar,
    /// A weight is zero, negative or not finite.
    Weight {
        /// Position in the list of weights.
        index: usize,
        /// The weight found.
        found: f64,
    },
    /// A parameter lies outside the domain.
    Parameter {
        /// The parameter asked for.
        found: f64,
        /// Start of the domain.
        start: f64,
        /// End of the domain.
        end: f64,
    },
    /// A parameter is not inside the domain, to which its ends do not belong.
    NotInside {
        /// The parameter asked for.
        found: f64,
        /// Start of the domain.
        start: f64,
        /// End of the domain.
        end: f64,
    },
    /// A length, radius or angle that must be positive and finite is not.
    NotPositive {
        /// The number found.
        found: f64,
    },
    /// Two neighbours that must be apart are not.
    Coincide {
        /// Position of the first of them.
        index: usize,
    },
    /// The points do not determine a curve or surface.
    Singular,
    /// A rim cannot be seen as a whole from its middle.
    NotStarShaped,
    /// A direction has no length.
    NoDirection,
    /// Solids cannot be united, cut by each other or taken from each other.
    Boolean(&'static str),
    /// A loop has no curves.
    EmptyLoop,
    /// The loops of a face have nothing inside.
    NothingInside,
    /// All loops of a face lie outside the domain of its surface.
    LoopsOutside {
        /// The lower corner of the box around the loops, and its upper one.
        found: [[f64; 2]; 2],
        /// The lower corner of the domain, and its upper one.
        domain: [[f64; 2]; 2],
    },
    /// A loop runs around a surface along both parameters, or loops run around it along different ones.
    LoopsWind,
    /// Two neighbouring curves of a loop do not meet.
    LoopGap {
        /// Position of the curve before the gap.
        index: usize,
        /// Distance between the two ends, in parameter units.
        gap: f64,
        /// Largest gap that would have been bridged.
        allowed: f64,
    },
    /// A list refers to an entry that does not exist.
    Reference {
        /// The index used.
        index: usize,
        /// How many entries there are.
        count: usize,
    },
}

impl Error {
    /// What is wrong with degrees, domains and parameters.
    fn fmt_domain(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Degree { found } => {
                write!(
                    f,
                    "degree {found}; degrees go from 1 to {}",
                    crate::MAX_DEGREE
                )
            }
            Self::DegreeBelow { found, present } => {
                write!(f, "degree {found} is below the present degree {present}")
            }
            Self::EmptyDomain { start, end } => {
                write!(
                    f,
                    "the domain from {start} to {end} is empty; it must have a length"
                )
            }
            Self::Parameter { found, start, end } => {
                write!(
                    f,
                    "parameter {found} lies outside the domain from {start} to {end}"
                )
            }
            Self::NotInside { found, start, end } => {
                write!(
                    f,
                    "parameter {found} is not inside the domain from {start} to {end}"
                )
            }
            _ => Ok(()),
        }
    }

    /// What is wrong with loops.
    fn fmt_loop(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::LoopsOutside {
                found: [[a, b], [c, d]],
                domain: [[u, v], [s, t]],
            } => write!(
                f,
                "its trim loops, from ({a}, {b}) to ({c}, {d}), lie outside its domain, which goes \
                 from ({u}, {v}) to ({s}, {t})"
            ),
            Self::LoopGap {
                index,
                gap,
                allowed,
            } => write!(
                f,
                "trim curve {index} ends {gap:e} away from the next; at most {allowed:e} is bridged"
            ),
            _ => Ok(()),
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Degree { .. }
            | Self::DegreeBelow { .. }
            | Self::EmptyDomain { .. }
            | Self::Parameter { .. }
            | Self::NotInside { .. } => self.fmt_domain(f),
            Self::KnotCount { found, expected } => {
                write!(
                    f,
                    "{found} knots; points + degree + 1 = {expected} are needed"
                )
            }
            Self::KnotNotFinite { index } => write!(f, "knot {index} is not a finite number"),
            Self::KnotsDecrease {
                index,
                before,
                found,
            } => {
                write!(
                    f,
                    "knot {index} is {found} after {before}; knots must not decrease"
                )
            }
            Self::KnotMultiplicity {
                knot,
                found,
                allowed,
            } => {
                write!(
                    f,
                    "knot {knot} stands {found} times; at most {allowed} are possible"
                )
            }
            Self::PointCount { found, expected } => {
                write!(f, "{found} control points; {expected} are needed")
            }
            Self::TooManyPoints { found } => {
                write!(f, "{found} control points are more than memory holds")
            }
            Self::WeightCount { found, expected } => {
                write!(f, "{found} weights for {expected} control points")
            }
            Self::NotFinite { index } => {
                write!(
                    f,
                    "point {index} is not finite, or beyond {FARTHEST:e} from the origin"
                )
            }
            Self::TooFar => write!(f, "transformations put it beyond {FARTHEST:e}"),
            Self::Weight { index, found } => {
                write!(f, "weight {index} is {found}; weights must be positive")
            }
            Self::NotPositive { found } => write!(f, "{found} must be positive and finite"),
            Self::Coincide { index } => {
                write!(f, "points or rows {index} and {} coincide", index + 1)
            }
            Self::Singular => write!(f, "the points do not determine a curve or surface"),
            Self::NotStarShaped => {
                write!(f, "the rim cannot be seen as a whole from its middle")
            }
            Self::NoDirection => write!(f, "a direction has no length"),
            Self::Boolean(why) => write!(f, "the solids cannot be combined: {why}"),
            Self::EmptyLoop => write!(f, "a trim loop without curves"),
            Self::NothingInside => write!(f, "nothing is inside its trim loops"),
            Self::LoopsWind => {
                let text = "its trim loops run around the surface along u and v; what those bound is not read";
                write!(f, "{text}")
            }
            Self::LoopsOutside { .. } | Self::LoopGap { .. } => self.fmt_loop(f),
            Self::Reference { index, count } => {
                write!(f, "index {index} of a list with {count} entries")
            }
        }
    }
}

impl std::error::Error for Error {}
