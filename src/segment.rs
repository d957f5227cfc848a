//! Straight segments.

use glam::DVec3;

/// Where the point of a segment nearest to `point` is, as a share of the way from `from` to `to`.
pub(crate) fn share(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    let way = to - from;
    let share = (point - from).dot(way) / way.length_squared();
    if share.is_finite() {
        share.clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// How far a point is from a segment.
pub(crate) fn distance(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    point.distance(from.lerp(to, share(point, from, to)))
}
