//! Curves, lines and points: they have no area, and are kept as wires.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec2, DVec3};
use kernel::modelling::arc;
use kernel::{Curve, Error as GeometryError, Material, MaterialId, Wire, WireId, WireShape};

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
        let mut inside = node.children.iter().map(|link| &self.tree.nodes[link.node]);
        if inside.any(|n| matches!(&*n.kind, "Color" | "ColorRGBA")) {
            let text = "colours of lines and points are not used";
            self.warnings.unsupported(node.place(), text);
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
        // The points of each, after how many there should be.
        let mut runs: Vec<(usize, Vec<DVec3>)> = Vec::new();
        if &*node.kind == "LineSet" {
            let mut rest = &points[..];
            for count in self.indices(node, "vertexCount")? {
                let count = usize::try_from(count).unwrap_or(0);
                let (run, after) = rest.split_at(count.min(rest.len()));
                runs.push((count, run.to_vec()));
                rest = after;
            }
        } else {
            let indices = self.indices(node, "coordIndex")?;
            let point = |&i: &i64| points.get(usize::try_from(i).ok()?).copied();
            let all = indices.split(|&i| i == -1).filter(|run| !run.is_empty());
            runs.extend(all.map(|run| (run.len(), run.iter().map_while(point).collect())));
        }
        if runs.iter().any(|(wanted, run)| run.len() < *wanted.max(&2)) {
            let text = format!(
                "lines of less than two points, or that end where one is not among the {} there are",
                points.len()
            );
            self.warnings.invalid(node.place(), text);
        }
        let lines = runs.iter().filter(|(_, run)| run.len() > 1);
        Ok(lines
            .map(|(_, run)| Curve::polyline(run).map(WireShape::Curve))
            .collect())
    }

    /// A circle, or a part of one.
    pub(super) fn arc(&mut self, node: &Node) -> Result<Curve<DVec3>, GeometryError> {
        let field = if &*node.kind == "Disk2D" {
            "outerRadius"
        } else {
            "radius"
        };
        let radius = node.size(field, 1.0, &mut self.warnings);
        let (mut start, mut end) = (0.0, TAU);
        if matches!(&*node.kind, "Arc2D" | "ArcClose2D") {
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
        let glow = material.map(|id| self.glow(id));
        let mut ids = Vec::new();
        for wire in self.wires[geometry].clone() {
            let material = glow;
            ids.extend(self.scene.add_wire(Wire { material, ..wire }));
        }
        self.wired.insert((geometry, material), ids.clone());
        ids
    }

    /// What lines and points show of a material: only its emission, where it has some. The diffuse
    /// colour stays that of others, which the standards leave black.
    fn glow(&mut self, id: MaterialId) -> MaterialId {
        if let Some(known) = self.glows.get(&id) {
            return *known;
        }
        let own = self.scene.material(id);
        let mut glow = id;
        if own.emissive != DVec3::ZERO && !own.is_unlit() {
            let material = Material {
                name: own.name.clone(),
                opacity: own.opacity,
                ..Material::unlit(own.emissive)
            };
            glow = self.scene.add_material(material);
        }
        self.glows.insert(id, glow);
        glow
    }
}
