//! Triangles in interval arithmetic.

use kernel::Interval;

use super::line::Line;

/// Where the ray's line meets the triangle, and whether that is certain; `None` if it
/// certainly does not.
///
/// The signs of the three areas that the line spans with the sides decide. Where one of
/// them is not certain, the line passes a side or lies in the plane of the triangle.
pub(super) fn intersect(line: &Line, corners: [[Interval; 3]; 3]) -> Option<(Interval, bool)> {
    let one = Interval::point(1.0);
    let [a, b, c] = corners.map(|[x, y, z]| line.distances([x, y, z, one]));
    let area = |a: &[Interval; 4], b: &[Interval; 4]| a[0] * b[1] - a[1] * b[0];
    let areas = [area(&c, &b), area(&a, &c), area(&b, &a)];
    let positive = areas.iter().any(|area| area.low() > 0.0);
    let negative = areas.iter().any(|area| area.high() < 0.0);
    if positive && negative {
        return None;
    }
    let places = [a, b, c].map(|d| d[2] / d[3]);
    let reach = places[0].hull(places[1]).hull(places[2]);
    let certain =
        areas.iter().all(|area| area.low() > 0.0) || areas.iter().all(|area| area.high() < 0.0);
    if !certain {
        // Beside the triangle if the line passes all corners on one side.
        let beside = (0..2).any(|k| {
            [a, b, c].iter().all(|d| d[k].low() > 0.0)
                || [a, b, c].iter().all(|d| d[k].high() < 0.0)
        });
        return (!beside).then_some((reach, false));
    }
    let sum = areas[0] + areas[1] + areas[2];
    let shares = areas[0] * places[0] + areas[1] * places[1] + areas[2] * places[2];
    let place = shares / sum;
    Some((place.intersection(reach).unwrap_or(place), true))
}
