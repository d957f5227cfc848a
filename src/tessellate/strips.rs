//! Curves that stand for themselves as straight lines.

use glam::DVec3;
use kernel::Curve;

use super::room::Room;
use crate::segment;

/// How often parts of a curve are divided at most, and into how many parts at once.
const DIVISIONS: u32 = 12;
const PARTS: f64 = 64.0;

/// How much longer than the others a part of a curve may be.
const UNEVEN: f64 = 1.1;

/// A curve as straight lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Strip {
    /// The points that the lines run through, in the coordinates of the curve.
    pub points: Vec<DVec3>,
    /// How far curve and lines are apart at most, in the curve's own units.
    pub proven: f64,
    /// How much its own units are lengthened at most where it is shown.
    pub scale: f64,
}

/// What lines have to keep to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach<'a> {
    /// Largest distance between curve and lines.
    pub(super) tolerance: f64,
    /// Largest angle between the ends of a line; over less than the tolerance a curve may turn by any.
    pub(super) angle: f64,
    pub(super) room: &'a Room,
}

impl Strip {
    /// The lines of a curve that is lengthened so much; `None` if there is no room for them.
    pub(super) fn of(curve: &Curve<DVec3>, scale: f64, reach: &Reach<'_>) -> Option<Self> {
        let mut strip = Self {
            points: vec![curve.start()],
            proven: 0.0,
            scale,
        };
        let mut parts: Vec<_> = curve
            .bezier_pieces()
            .into_iter()
            .map(|part| (part, 0))
            .collect();
        parts.reverse();
        while let Some((part, divisions)) = parts.pop() {
            let off = off(&part);
            let used = (off / reach.tolerance).max(turn(&part, reach));
            // Both fall with the square of the length, of which some parts have more than others; many
            // parts come in two steps.
            let count = match (UNEVEN * used.sqrt()).ceil().max(2.0) {
                count if count > PARTS => count.sqrt().ceil().min(PARTS),
                count => count,
            };
            if used > 1.0
                && divisions < DIVISIONS
                && let Some(divided) = divided(&part, count)
            {
                parts.extend(divided.into_iter().rev().map(|part| (part, divisions + 1)));
                continue;
            }
            strip.points.push(part.end());
            strip.proven = strip.proven.max(off);
            if !reach.room.take(1.0) {
                return None;
            }
        }
        Some(strip)
    }
}

/// A curve in so many parts; `None` where their parameters cannot be told apart.
fn divided(part: &Curve<DVec3>, count: f64) -> Option<Vec<Curve<DVec3>>> {
    let (mut rest, mut parts) = (part.clone(), Vec::new());
    let mut left = count;
    while left > 1.0 {
        let domain = rest.domain();
        let at = domain.start + (domain.end - domain.start) / left;
        let [first, second] = rest.split(at).ok()?;
        parts.push(first);
        rest = second;
        left -= 1.0;
    }
    parts.push(rest);
    Some(parts)
}

/// How far a Bézier curve is from its chord at most: a mixture of its control points, with the ends by
/// no less than half of their share in the middle.
fn off(part: &Curve<DVec3>) -> f64 {
    let points: Vec<DVec3> = part.points().collect();
    let weights: Vec<f64> = part.weights().collect();
    let ([from, inner @ .., to], [first, heavy @ .., last]) = (&points[..], &weights[..]) else {
        return 0.0;
    };
    let farthest = inner
        .iter()
        .map(|p| segment::distance(*p, *from, *to))
        .fold(0.0, f64::max);
    let ends = 0.5_f64.powf(inner.len() as f64);
    let heaviest = heavy.iter().copied().fold(0.0, f64::max);
    let (outer, inner) = (ends * first.min(*last), (1.0 - ends) * heaviest);
    farthest * inner / (outer + inner)
}

/// What the angle between its ends uses of the limits: 1 is all.
fn turn(part: &Curve<DVec3>, reach: &Reach<'_>) -> f64 {
    let points: Vec<DVec3> = part.points().collect();
    let mut legs = points.windows(2).map(|w| w[1] - w[0]);
    let length: f64 = legs.clone().map(DVec3::length).sum();
    let is_leg = |leg: &DVec3| *leg != DVec3::ZERO;
    let Some(first) = legs.clone().find(is_leg) else {
        return 0.0;
    };
    let last = legs.rfind(is_leg).unwrap_or(first);
    let angle = first.angle_between(last);
    if angle.is_finite() {
        // The ends of a chord differ from it by half of that.
        let turn = 0.5 * angle / reach.angle;
        turn.powi(2).min((length / reach.tolerance).powi(2))
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use kernel::{KnotVector, modelling};

    use super::*;

    fn lines(curve: &Curve<DVec3>, tolerance: f64, angle: f64) -> Strip {
        let room = Room::new(100_000);
        let reach = Reach {
            tolerance,
            angle,
            room: &room,
        };
        Strip::of(curve, 1.0, &reach).unwrap()
    }

    /// How far the curve is from the lines, looked at in many places.
    fn found(curve: &Curve<DVec3>, strip: &Strip) -> f64 {
        let domain = curve.domain();
        let place = |k: u32| domain.start + (domain.end - domain.start) * f64::from(k) / 5000.0;
        let off = |p: DVec3| {
            let lines = strip.points.windows(2);
            lines
                .map(|w| segment::distance(p, w[0], w[1]))
                .fold(f64::INFINITY, f64::min)
        };
        let offs = (0..=5000).map(|k| off(curve.evaluate(place(k))));
        offs.fold(0.0, f64::max)
    }

    #[test]
    fn a_circle_has_as_many_lines_as_its_tolerance_asks_for() {
        let circle = modelling::arc(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0..TAU).unwrap();
        for tolerance in [1e-2, 1e-4, 1e-6] {
            let strip = lines(&circle, tolerance, PI);
            let fewest = PI / f64::acos(1.0 - tolerance);
            let count = strip.points.len() as f64 - 1.0;
            assert!((fewest..1.25 * fewest + 4.0).contains(&count), "{count}");
            let off = found(&circle, &strip);
            assert!(off <= strip.proven && strip.proven <= tolerance, "{off}");
        }
        // Fifteen degrees at either end of each.
        let count = lines(&circle, 0.1, PI / 12.0).points.len() - 1;
        assert!((12..=16).contains(&count), "{count}");
    }

    #[test]
    fn curves_of_all_kinds_are_within_the_tolerance() {
        let corners = [
            [0.0, 0.0, 0.0],
            [1.0, 3.0, 0.0],
            [2.0, -3.0, 1.0],
            [3.0, 1.0, -1.0],
            [3.0, 1.0, -1.0],
            [0.0, 0.5, 0.3],
        ];
        let corners = corners.map(DVec3::from_array);
        let heavy = [1.0, 8.0, 0.1, 3.0, 1.0, 2.0];
        for degree in 1..6 {
            let knots = KnotVector::clamped_uniform(degree, 6, 0.0..2.0).unwrap();
            for weights in [None, Some(&heavy[..])] {
                let curve = Curve::new(knots.clone(), &corners, weights).unwrap();
                let strip = lines(&curve, 1e-3, PI);
                let off = found(&curve, &strip);
                assert!(off <= strip.proven + 1e-12 && strip.proven <= 1e-3, "{off}");
                if degree == 1 {
                    let pairs = strip.points.iter().zip(&corners);
                    assert!(
                        strip.points.len() == 6
                            && pairs.clone().all(|(a, b)| a.distance(*b) < 1e-12)
                    );
                }
            }
        }
    }

    #[test]
    fn there_may_be_too_many_lines() {
        let circle = modelling::arc(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0..TAU).unwrap();
        let room = Room::new(100);
        let reach = Reach {
            tolerance: 1e-9,
            angle: PI,
            room: &room,
        };
        assert_eq!(Strip::of(&circle, 1.0, &reach), None);
    }
}
