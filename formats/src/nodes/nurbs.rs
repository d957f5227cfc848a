//! NURBS surfaces of X3D and VRML 97.
//!
//! The standard says nothing about whether control points are multiplied by their weights
//! already. Most viewers take them as they are for the numerators of the rational form, and
//! so do we: the Cartesian point is `controlPoint / weight`.

use glam::{DVec2, DVec3};
use kernel::{Error as GeometryError, KnotVector, Patch, Surface, modelling};

use super::scene::Converter;
use super::{Link, Node};
use crate::{Error, Warnings};

impl Converter<'_> {
    /// The surfaces of a geometry.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn patches(
        &mut self,
        node: &Node,
    ) -> Result<Result<Vec<Patch>, GeometryError>, Error> {
        match &*node.kind {
            "NurbsSwungSurface" => Ok(self.swung(node)?.map(|s| vec![Patch::from(s)])),
            "TrimmedSurface" => self.trimmed(node),
            "Extrusion" => self.extrusion(node),
            "Box" | "Cone" | "Cylinder" | "Disk2D" | "Rectangle2D" | "Sphere" => {
                Ok(self.solid(node))
            }
            _ => Ok(self.net(node, node)?.map(|patch| vec![patch])),
        }
    }

    /// A surface with a net of control points, and the contours of `trims`.
    fn net(&mut self, node: &Node, trims: &Node) -> Result<Result<Patch, GeometryError>, Error> {
        let points = self.points_inside(node)?;
        let surface = match net(node, &points, &mut self.warnings) {
            Ok(surface) => surface,
            Err(problem) => return Ok(Err(problem)),
        };
        let loops = self.trim_loops(trims, &surface)?;
        // Only VRML 97 has this field; its front turns around.
        let turned = !node.flag("ccw", true, &mut self.warnings) && loops.is_empty();
        let surface = if turned {
            surface.reversed_u()
        } else {
            surface
        };
        let patch = Patch::from(surface);
        Ok(Ok(Patch { loops, ..patch }))
    }

    /// The `TrimmedSurface` of VRML 97: contours around a `NurbsSurface`.
    fn trimmed(&mut self, node: &Node) -> Result<Result<Vec<Patch>, GeometryError>, Error> {
        let mut inside = node.children.iter().map(|link| &self.tree.nodes[link.node]);
        let surface = inside.find(|n| matches!(&*n.kind, "NurbsSurface" | "NurbsPatchSurface"));
        match surface {
            Some(surface) => Ok(self.net(surface, node)?.map(|patch| vec![patch])),
            None => {
                let text = "there is no surface in it";
                self.warnings.invalid(node.place(), text);
                Ok(Ok(Vec::new()))
            }
        }
    }

    /// A `NurbsSwungSurface`, by the definition of the textbooks; its front turns around where
    /// `ccw` is false. Viewers do not agree on what the node means.
    fn swung(&mut self, node: &Node) -> Result<Result<Surface, GeometryError>, Error> {
        let text = "NurbsSwungSurface is read as profile times trajectory; some viewers differ";
        self.warnings.unsupported(node.place(), text);
        let mut curves = Vec::new();
        for field in ["profileCurve", "trajectoryCurve"] {
            let link = node
                .children
                .iter()
                .find(|link| link.field.as_deref() == Some(field));
            let Some(curve) = link.map(|link| &self.tree.nodes[link.node]) else {
                return Ok(Err(GeometryError::EmptyLoop));
            };
            match self.parameter_curve(curve)? {
                Ok(curve) => curves.push(curve),
                Err(problem) => return Ok(Err(problem)),
            }
        }
        let surface = modelling::swung(&curves[0], &curves[1]);
        let turned = !node.flag("ccw", true, &mut self.warnings);
        Ok(Ok(if turned {
            surface.reversed_u()
        } else {
            surface
        }))
    }

    /// The points of the Coordinate node inside, whatever field it claims to be.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn points_inside(&mut self, node: &Node) -> Result<Vec<DVec3>, Error> {
        let inside = |link: &Link| &self.tree.nodes[link.node];
        let mut inside = node.children.iter().map(inside);
        let coordinate = inside.find(|n| matches!(&*n.kind, "Coordinate" | "CoordinateDouble"));
        // In VRML 97 the points are a field of the surface itself.
        let (holder, field) = match coordinate {
            Some(coordinate) => (coordinate, "point"),
            None => (node, "controlPoint"),
        };
        let points = holder.points_3d(field, &mut self.warnings);
        self.count_points(points.len(), holder)?;
        Ok(points)
    }
}

/// The surface of a node with these control points.
fn net(node: &Node, points: &[DVec3], warnings: &mut Warnings) -> Result<Surface, GeometryError> {
    let order_u = node.count("uOrder", 3, warnings);
    let order_v = node.count("vOrder", 3, warnings);
    let (count_u, count_v) = dimensions(node, points.len(), warnings);
    // Before anything is allocated by these numbers.
    let (found, expected) = (points.len(), count_u.saturating_mul(count_v));
    let points = points
        .get(..expected)
        .ok_or(GeometryError::PointCount { found, expected })?;
    if found > expected {
        let text = format!("{found} control points; the first {expected} are used");
        warnings.invalid(node.place(), text);
    }
    let knots_u = knots(node, "uKnot", order_u, count_u, warnings)?;
    let knots_v = knots(node, "vKnot", order_v, count_v, warnings)?;
    match weights(node, points.len(), warnings) {
        None => Surface::from_u_fastest(knots_u, knots_v, points, None),
        Some(weights) => {
            let points: Vec<_> = points.iter().zip(&weights).map(|(&p, &w)| p / w).collect();
            Surface::from_u_fastest(knots_u, knots_v, &points, Some(&weights))
        }
    }
}

/// The numbers of control points along u and v; one that is missing follows from the other.
fn dimensions(node: &Node, points: usize, warnings: &mut Warnings) -> (usize, usize) {
    let u = node.count("uDimension", 0, warnings);
    let v = node.count("vDimension", 0, warnings);
    let found = match (u, v) {
        (0, v) if v > 0 => (points / v, v),
        (u, 0) if u > 0 => (u, points / u),
        dimensions => return dimensions,
    };
    let text = "one dimension is missing; it follows from the number of control points";
    warnings.invalid(node.place(), text);
    found
}

/// The knots of one direction of a surface or of a curve with `count` control points.
///
/// Where they are missing or unusable, clamped knots with equal steps over `0..1` take
/// their place.
///
/// # Errors
/// If no knots exist for this order and this number of points.
pub(super) fn knots(
    node: &Node,
    field: &str,
    order: usize,
    count: usize,
    warnings: &mut Warnings,
) -> Result<KnotVector, GeometryError> {
    let degree = order.saturating_sub(1);
    let uniform = KnotVector::clamped_uniform(degree, count, 0.0..1.0)?;
    let mut given = node.numbers(field, warnings);
    if given.is_empty() {
        return Ok(uniform);
    }
    let expected = count + order;
    if let (true, [first, .., last]) = (given.len() + 2 == expected, &given[..]) {
        let (first, last) = (*first, *last);
        given.insert(0, first);
        given.push(last);
        let text = "two knots are missing; the first and the last are repeated";
        warnings.invalid(node.field_place(field), text);
    }
    if given.len() != expected {
        let text = format!(
            "{} knots; dimension + order = {expected} are needed; equal steps are used",
            given.len()
        );
        warnings.invalid(node.field_place(field), text);
        return Ok(uniform);
    }
    Ok(KnotVector::new(degree, given).unwrap_or_else(|problem| {
        let text = format!("{problem}; equal steps are used");
        warnings.invalid(node.field_place(field), text);
        uniform
    }))
}

/// The weights of `count` control points; `None` if all are one.
pub(super) fn weights(node: &Node, count: usize, warnings: &mut Warnings) -> Option<Vec<f64>> {
    let weights = node.numbers("weight", warnings);
    if weights.is_empty() {
        return None;
    }
    let place = || node.field_place("weight");
    if weights.len() != count {
        let text = format!(
            "{} weights for {count} control points; all weights are taken as one",
            weights.len()
        );
        warnings.invalid(place(), text);
        return None;
    }
    if let Some((i, w)) = weights.iter().enumerate().find(|&(_, &w)| w <= 0.0) {
        let text =
            format!("weight {i} is {w}; weights must be positive; all weights are taken as one");
        warnings.invalid(place(), text);
        return None;
    }
    Some(weights)
}

/// Control points of the plane with their weights, Cartesian.
pub(super) fn cartesian_2d(points: &mut [DVec2], weights: Option<&[f64]>) {
    for (point, weight) in points.iter_mut().zip(weights.unwrap_or_default()) {
        *point /= *weight;
    }
}
