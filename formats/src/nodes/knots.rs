//! Knots and weights of NURBS nodes, with what takes their place where they are wrong.

use kernel::{Error as GeometryError, KnotVector};

use super::Node;
use crate::Warnings;

/// The fields that describe one parameter.
pub(super) struct Direction {
    order: &'static str,
    knots: &'static str,
    closed: &'static str,
    /// Whether what knots tear is cut.
    tears: bool,
}

impl Direction {
    /// Of a curve.
    pub(super) const CURVE: Self = Self {
        order: "order",
        knots: "knot",
        closed: "closed",
        tears: false,
    };

    /// The first of a surface.
    pub(super) const U: Self = Self {
        order: "uOrder",
        knots: "uKnot",
        closed: "uClosed",
        tears: true,
    };

    /// Those of a volume.
    pub(super) const VOLUME: [Self; 3] = [
        Self {
            tears: false,
            ..Self::U
        },
        Self {
            tears: false,
            ..Self::V
        },
        Self {
            order: "wOrder",
            knots: "wKnot",
            closed: "wClosed",
            tears: false,
        },
    ];

    /// The second of a surface.
    pub(super) const V: Self = Self {
        order: "vOrder",
        knots: "vKnot",
        closed: "vClosed",
        tears: true,
    };
}

/// Knots, and how many control points from the second on follow again after the last one.
#[derive(Debug)]
pub(super) struct Knots {
    pub(super) knots: KnotVector,
    wrapped: usize,
    /// Those of the file, if they tear a surface; then `knots` are others.
    torn: Option<Vec<f64>>,
}

impl Knots {
    /// The knots of a node for `count` control points, of which the last is the first again
    /// if `meets`.
    ///
    /// Where knots are missing or unusable, clamped ones with equal steps over `0..1` take
    /// their place. Where the file asks for a smooth joint, the ends meet and the knots are
    /// not clamped, the curve goes on around the joint.
    ///
    /// # Errors
    /// If no knots exist for this order and this number of points.
    pub(super) fn of(
        node: &Node,
        direction: &Direction,
        count: usize,
        meets: bool,
        warnings: &mut Warnings,
    ) -> Result<Self, GeometryError> {
        let default = match (&*node.kind, &*node.file.version) {
            ("CoordinateDeformer", _) => 2,
            ("NurbsPositionInterpolator", "2.0") => 4,
            _ => 3,
        };
        let order = node.count(direction.order, default, warnings);
        let degree = order.saturating_sub(1);
        let clamped = KnotVector::clamped_uniform(degree, count, 0.0..1.0)?;
        let given = given(node, direction.knots, order, count, warnings);
        let closed = node.flag(direction.closed, false, warnings) && meets && degree > 1;
        let own = match given {
            Some(knots) if closed && knots[0] >= knots[degree] => {
                return Self::fixed(KnotVector::new(degree, knots));
            }
            Some(mut knots) if closed => {
                // The steps of the period begin again.
                for _ in 1..degree {
                    let (last, next) = (knots.len() - 1, knots.len() - (count - 1));
                    knots.push(knots[last] + knots[next] - knots[next - 1]);
                }
                knots
            }
            None if closed => (0..count + 2 * degree).map(|i| i as f64).collect(),
            Some(given) => {
                let place = node.field_place(direction.knots);
                let mut torn = None;
                let knots = KnotVector::new(degree, given.clone()).unwrap_or_else(|problem| {
                    let is_torn = matches!(problem, GeometryError::KnotMultiplicity { .. });
                    torn = Some(given).filter(|_| is_torn && direction.tears);
                    if torn.is_none() {
                        warnings.invalid(place, format!("{problem}; equal steps are used"));
                    }
                    clamped
                });
                return Ok(Self {
                    knots,
                    wrapped: 0,
                    torn,
                });
            }
            None => return Self::fixed(Ok(clamped)),
        };
        let knots = KnotVector::new(degree, own)?;
        let wrapped = degree - 1;
        Ok(Self {
            knots,
            wrapped,
            torn: None,
        })
    }

    fn fixed(knots: Result<KnotVector, GeometryError>) -> Result<Self, GeometryError> {
        let (wrapped, torn) = (0, None);
        knots.map(|knots| Self {
            knots,
            wrapped,
            torn,
        })
    }

    pub(super) fn is_torn(&self) -> bool {
        self.torn.is_some()
    }

    /// The knots, also if they tear a surface.
    pub(super) fn list(&self) -> Vec<f64> {
        let torn = self.torn.clone();
        torn.unwrap_or_else(|| self.knots.as_slice().to_vec())
    }

    /// The control points in order, of `count` that the file has.
    pub(super) fn points(&self, count: usize) -> impl Iterator<Item = usize> + use<> {
        (0..count).chain((0..self.wrapped).map(move |i| 1 + i % (count - 1)))
    }
}

/// The knots of a field, if there are as many as are needed.
fn given(
    node: &Node,
    field: &str,
    order: usize,
    count: usize,
    warnings: &mut Warnings,
) -> Option<Vec<f64>> {
    let mut given = node.numbers(field, warnings);
    let expected = count + order;
    if let (true, [first, .., last]) = (given.len() + 2 == expected, &given[..]) {
        let (first, last) = (*first, *last);
        given.insert(0, first);
        given.push(last);
        let text = "two knots are missing; the first and the last are repeated";
        warnings.invalid(node.field_place(field), text);
    }
    if given.len() == expected {
        settle(&mut given);
        return Some(given);
    }
    if !given.is_empty() {
        let found = given.len();
        let text = format!(
            "{found} knots; dimension + order = {expected} are needed; equal steps are used"
        );
        warnings.invalid(node.field_place(field), text);
    }
    None
}

/// Steps back that are no larger than this, as a share of all knots, are noise.
const NOISE: f64 = 1e-9;

/// Repeats knots where the next one is smaller by no more than the noise of a writer.
fn settle(knots: &mut [f64]) {
    let [first, .., last] = knots else {
        return;
    };
    let noise = NOISE * (*last - *first);
    for i in 1..knots.len() {
        let (before, here) = (knots[i - 1], knots[i]);
        if here < before && before - here <= noise {
            knots[i] = before;
        }
    }
}

/// The weights of `count` control points, all positive or all negative; `None` if all are one.
pub(super) fn weights(node: &Node, count: usize, warnings: &mut Warnings) -> Option<Vec<f64>> {
    // The interpolator of VRML 97 has another name for them.
    let field = ["weight", "keyWeight"]
        .into_iter()
        .find(|f| node.text(f).is_some())?;
    let weights = node.numbers(field, warnings);
    if weights.is_empty() {
        return None;
    }
    let place = || node.field_place(field);
    if weights.len() != count {
        let text = format!(
            "{} weights for {count} control points; all weights are taken as one",
            weights.len()
        );
        warnings.invalid(place(), text);
        return None;
    }
    if weights.iter().all(|w| *w < 0.0) {
        // Only their ratios count, and those to the points, which are multiplied by them.
        warnings.invalid(place(), "all weights are negative");
        return Some(weights);
    }
    if let Some((i, w)) = weights.iter().enumerate().find(|&(_, &w)| w <= 0.0) {
        let text =
            format!("weight {i} is {w}; weights must be positive; all weights are taken as one");
        warnings.invalid(place(), text);
        return None;
    }
    Some(weights)
}
