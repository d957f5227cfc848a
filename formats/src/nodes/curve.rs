//! Curves of the parameter domain and of space.

use glam::{DVec2, DVec3};
use kernel::{Curve, Error as GeometryError};

use super::Node;
use super::knots::{Direction, Knots, weights};
use super::scene::Converter;
use crate::Error;

impl Converter<'_> {
    /// A `ContourPolyline2D`, or what is taken for a `NurbsCurve2D`.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn parameter_curve(
        &mut self,
        node: &Node,
    ) -> Result<Result<Curve<DVec2>, GeometryError>, Error> {
        if is_polyline(&node.kind) {
            return self.polyline_2d(node);
        }
        let points = node.points_2d("controlPoint", &mut self.warnings);
        self.count_points(points.len(), node)?;
        let weights = weights(node, points.len(), &mut self.warnings);
        let meets = meets(&points, weights.as_deref());
        let knots = Knots::of(
            node,
            &Direction::CURVE,
            points.len(),
            meets,
            &mut self.warnings,
        );
        Ok(knots.and_then(|knots| {
            let (points, weights) = cartesian(&knots, &points, weights.as_deref(), |p, w| p / w);
            Curve::new(knots.knots, &points, weights.as_deref())
        }))
    }

    /// A `NurbsCurve`, or a polyline in the plane of x and y.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn curve_3d(
        &mut self,
        node: &Node,
    ) -> Result<Result<Curve<DVec3>, GeometryError>, Error> {
        let points = self.points_inside(node)?;
        let weights = weights(node, points.len(), &mut self.warnings);
        let meets = meets(&points, weights.as_deref());
        let knots = Knots::of(
            node,
            &Direction::CURVE,
            points.len(),
            meets,
            &mut self.warnings,
        );
        Ok(knots.and_then(|knots| {
            let (points, weights) = cartesian(&knots, &points, weights.as_deref(), |p, w| p / w);
            Curve::new(knots.knots, &points, weights.as_deref())
        }))
    }

    /// The points stand in `controlPoint`; VRML 97, X3D 3.0 and some programs have other names.
    fn polyline_2d(&mut self, node: &Node) -> Result<Result<Curve<DVec2>, GeometryError>, Error> {
        let names = ["controlPoint", "point", "lineSegments"];
        let name = names.into_iter().find(|name| node.text(name).is_some());
        let points = node.points_2d(name.unwrap_or("controlPoint"), &mut self.warnings);
        self.count_points(points.len(), node)?;
        Ok(Curve::polyline(&points))
    }
}

/// Curves of the parameter domain.
pub(super) fn is_parameter_curve(kind: &str) -> bool {
    kind == "NurbsCurve2D" || is_polyline(kind)
}

/// The polylines of X3D and of VRML 97.
pub(super) fn is_polyline(kind: &str) -> bool {
    matches!(kind, "ContourPolyline2D" | "Polyline2D")
}

/// Whether the last control point is the first one.
fn meets<P: PartialEq>(points: &[P], weights: Option<&[f64]>) -> bool {
    let weights = weights.unwrap_or_default();
    points.first() == points.last() && weights.first() == weights.last()
}

/// Control points in the order that the knots want, Cartesian, with their weights.
fn cartesian<P: Copy>(
    knots: &Knots,
    points: &[P],
    weights: Option<&[f64]>,
    divided: impl Fn(P, f64) -> P,
) -> (Vec<P>, Option<Vec<f64>>) {
    let order = || knots.points(points.len());
    match weights {
        None => (order().map(|i| points[i]).collect(), None),
        Some(w) => {
            let points = order().map(|i| divided(points[i], w[i])).collect();
            (points, Some(order().map(|i| w[i].abs()).collect()))
        }
    }
}
