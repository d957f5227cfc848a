//! Where a curve is nearest to a point: its pieces are looked at that come near enough.

use glam::DVec3;
use kernel::{Aabb, Curve};

use crate::least::least;

/// The Bézier pieces of a curve, with boxes around them.
#[derive(Clone, Debug)]
pub(super) struct Pieces {
    pieces: Vec<(Aabb, Curve<DVec3>)>,
}

impl Pieces {
    pub(super) fn of(curve: &Curve<DVec3>) -> Self {
        let pieces = curve.bezier_pieces().into_iter();
        let pieces = pieces.map(|piece| (piece.hull_bounds(), piece)).collect();
        Self { pieces }
    }

    /// The parameter nearest to a point, and how far off the curve is there; `None` if that is more than
    /// `near`.
    pub(super) fn nearest(&self, point: DVec3, near: f64) -> Option<(f64, f64)> {
        let is_near = |bounds: &Aabb| {
            let inside = point.clamp(bounds.min, bounds.max);
            inside.distance(point) <= near
        };
        let pieces = self.pieces.iter().filter(|(bounds, _)| is_near(bounds));
        let found = pieces.map(|(_, piece)| {
            let domain = piece.domain();
            least(&[domain.start, domain.end], |t| {
                piece.evaluate(t).distance(point)
            })
        });
        let found = found.min_by(|a, b| a.1.total_cmp(&b.1));
        found.filter(|(_, off)| *off <= near)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_of_all_pieces_is_found_if_it_is_near_enough() {
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 3.0], [0.0, 3.0]];
        let corners = corners.map(|[x, y]| DVec3::new(x, y, 1.0));
        let pieces = Pieces::of(&Curve::polyline(&corners).unwrap());
        let (t, off) = pieces.nearest(DVec3::new(1.8, 1.5, 1.0), 0.5).unwrap();
        assert!(
            (t - 1.5).abs() < 1e-7 && (off - 0.2).abs() < 1e-12,
            "{t} {off}"
        );
        assert_eq!(pieces.nearest(DVec3::new(1.8, 1.5, 1.0), 0.1), None);
    }
}
