//! Curves, lines and points: they have no area, and are kept as wires.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec2, DVec3};
use kernel::modelling::arc;
use kernel::{Curve, Error as GeometryError, MaterialId, Wire, WireId, WireShape};

use super::Node;
use super::scene::{Converter, Made};
use crate::Error;

/// The lines and points that are read.
pub(super) fn is_wire(kind: &str) -> bool {
    WIRES.contains(&kind)
}

const WIRES: &[&str] = &[
    "Arc2D",
    "Circle2D",
    "IndexedLineSet",
    "LineSet",
    "NurbsCurve",
    "PointSet",
    "Polyline2D",
    "Polypoint2D",
];

/// Points, if there are any.
fn some_points(points: Vec<DVec3>) -> Vec<WireShape> {
    let is_empty = points.is_empty();
    let shape = (!is_empty).then_some(WireShape::Points(points));
    shape.into_iter().collect()
}

impl Converter<'_> {
    /// Whether a node is a circle: a disk without width.
    pub(super) fn is_circle(&mut self, node: &Node) -> bool {
        let mut radius = |field, default| node.number(field, default, &mut self.warnings);
        &*node.kind == "Disk2D"
            && (radius("innerRadius", 0.0) - radius("outerRadius", 1.0)).abs() <= 0.0
    }

    /// The wires of a geometry.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn wires(&mut self, node: &Node) -> Result<Made, Error> {
        if !node.complete {
            let text = format!("the file ends inside this {}; it is left out", node.kind);
            self.warnings.invalid(node.place(), text);
            return Ok(Made::Nothing);
        }
        let mut shapes = Vec::new();
        match self.wire_shapes(node)? {
            Ok(found) => shapes = found,
            Err(problem) => self.warnings.add(node.place(), problem),
        }
        let (name, source) = (self.name(node), node.place().to_string());
        let wire = |shape| Wire {
            name: name.clone(),
            source: source.clone(),
            shape,
            material: None,
        };
        self.wires.push(shapes.into_iter().map(wire).collect());
        Ok(Made::Wires(self.wires.len() - 1, None))
    }

    fn wire_shapes(&mut self, node: &Node) -> Result<Result<Vec<WireShape>, GeometryError>, Error> {
        let flat = |points: Vec<DVec2>| -> Vec<DVec3> {
            points.into_iter().map(|p| p.extend(0.0)).collect()
        };
        let one = |curve: Result<Curve<DVec3>, GeometryError>| {
            curve.map(|curve| vec![WireShape::Curve(curve)])
        };
        Ok(match &*node.kind {
            "NurbsCurve" => one(self.curve_3d(node)?),
            "Circle2D" | "Arc2D" | "Disk2D" => one(self.arc(node)),
            "Polyline2D" => {
                let points = flat(node.points_2d("lineSegments", &mut self.warnings));
                self.count_points(points.len(), node)?;
                one(Curve::polyline(&points))
            }
            "Polypoint2D" => {
                let points = flat(node.points_2d("point", &mut self.warnings));
                self.count_points(points.len(), node)?;
                Ok(some_points(points))
            }
            "PointSet" => Ok(some_points(self.points_inside(node)?)),
            _ => self.lines(node)?,
        })
    }

    /// The lines of a set, each as a curve of degree one.
    fn lines(&mut self, node: &Node) -> Result<Result<Vec<WireShape>, GeometryError>, Error> {
        let points = self.points_inside(node)?;
        let mut runs: Vec<Vec<usize>> = Vec::new();
        if &*node.kind == "LineSet" {
            let mut start = 0_usize;
            for count in self.indices(node, "vertexCount")? {
                let end = start.saturating_add(usize::try_from(count).unwrap_or(0));
                runs.push((start..end.min(points.len())).collect());
                start = end;
            }
        } else {
            let indices = self.indices(node, "coordIndex")?;
            let run = |run: &[i64]| {
                run.iter()
                    .filter_map(|&i| usize::try_from(i).ok())
                    .collect()
            };
            runs.extend(indices.split(|&i| i == -1).map(run));
        }
        let curve = |run: &Vec<usize>| {
            let all: Option<Vec<DVec3>> = run.iter().map(|&i| points.get(i).copied()).collect();
            let (index, count) = (run.iter().max().copied().unwrap_or(0), points.len());
            let points = all.ok_or(GeometryError::Reference { index, count })?;
            Curve::polyline(&points).map(WireShape::Curve)
        };
        Ok(runs.iter().filter(|run| run.len() > 1).map(curve).collect())
    }

    /// A circle, or a part of one.
    fn arc(&mut self, node: &Node) -> Result<Curve<DVec3>, GeometryError> {
        let field = if &*node.kind == "Disk2D" {
            "outerRadius"
        } else {
            "radius"
        };
        let radius = node.size(field, 1.0, &mut self.warnings);
        let (mut start, mut end) = (0.0, TAU);
        if &*node.kind == "Arc2D" {
            start = self.angle(node, "startAngle", 0.0);
            end = self.angle(node, "endAngle", FRAC_PI_2);
            // Equal angles are a whole turn.
            end = start + (end - start).rem_euclid(TAU);
            if end <= start {
                end = start + TAU;
            }
        }
        arc(
            DVec3::ZERO,
            DVec3::X * radius,
            DVec3::Y * radius,
            start..end,
        )
    }

    /// The wires of a geometry shown in a material; stored once for each.
    pub(super) fn wired(&mut self, geometry: usize, material: Option<MaterialId>) -> Vec<WireId> {
        if let Some(known) = self.wired.get(&(geometry, material)) {
            return known.clone();
        }
        let mut ids = Vec::new();
        for wire in self.wires[geometry].clone() {
            ids.extend(self.scene.add_wire(Wire { material, ..wire }));
        }
        self.wired.insert((geometry, material), ids.clone());
        ids
    }
}
