//! NURBS surfaces of X3D and VRML 97.
//!
//! The standard says nothing about whether control points are multiplied by their weights
//! already. Most viewers take them as they are for the numerators of the rational form, and
//! so do we: the Cartesian point is `controlPoint / weight`.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use kernel::{Curve, Error as GeometryError, KnotVector, Patch, Surface, modelling};

use super::covering::over_domain;
use super::curve::is_parameter_curve;
use super::extrusion::frames;
use super::knots::{Direction, Knots, weights};
use super::scene::Converter;
use super::{Link, Node};
use crate::iges::Net as Torn;
use crate::{Error, Problem, Warnings};

/// How far a swept surface may be from its definition, as a share of its size.
const FIT: f64 = 1e-9;

impl<'a> Converter<'a> {
    /// The surfaces of a geometry.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn patches(
        &mut self,
        node: &Node,
    ) -> Result<Result<Vec<Patch>, GeometryError>, Error> {
        match &*node.kind {
            "NurbsSwungSurface" => self.swung(node),
            "NurbsSweptSurface" => self.swept(node),
            "TrimmedSurface" => self.trimmed(node),
            "Extrusion" => self.extrusion(node),
            "ArcClose2D" | "Box" | "Cone" | "Cylinder" | "Disk2D" | "Rectangle2D" | "Sphere" => {
                Ok(self.solid(node))
            }
            _ => self.net(node, node),
        }
    }

    /// A surface with a net of control points, and the contours of `trims`: in parts where it is torn.
    fn net(
        &mut self,
        node: &Node,
        trims: &Node,
    ) -> Result<Result<Vec<Patch>, GeometryError>, Error> {
        let points = self.points_inside(node)?;
        let directions = [&Direction::U, &Direction::V];
        let surfaces = match net(node, &points, directions, &mut self.warnings) {
            Ok(surfaces) => surfaces,
            Err(problem) => return Ok(Err(problem)),
        };
        let is_whole = surfaces.len() == 1;
        let mut patches = Vec::new();
        for surface in surfaces {
            match self.patch(node, trims, surface, is_whole)? {
                Ok(patch) => patches.push(patch),
                Err(problem) => return Ok(Err(problem)),
            }
        }
        Ok(Ok(patches))
    }

    /// A surface with the contours of `trims`, and its texture coordinates if it `is_whole`.
    fn patch(
        &mut self,
        node: &Node,
        trims: &Node,
        surface: Surface,
        is_whole: bool,
    ) -> Result<Result<Patch, GeometryError>, Error> {
        let loops = self.trim_loops(trims, &surface)?;
        let mut texture = None;
        if is_whole {
            texture = self.net_coordinates(node, &surface)?.map(Arc::new);
        } else if self.coordinates_node(node).is_some() {
            let text = "texture coordinates of a surface that is torn are not used";
            self.warnings.unsupported(node.place(), text);
        }
        let patch = Patch {
            loops,
            texture,
            ..Patch::from(surface)
        };
        // Only VRML 97 has this field; its front turns around.
        let turned = !node.flag("ccw", true, &mut self.warnings);
        if turned && !patch.loops.is_empty() {
            let text = "ccw FALSE has no effect on a surface with contours";
            self.warnings.unsupported(node.place(), text);
        }
        Ok(if turned && patch.loops.is_empty() {
            self.reversed(patch)
        } else {
            Ok(patch)
        })
    }

    /// The `TrimmedSurface` of VRML 97: contours around a `NurbsSurface`.
    fn trimmed(&mut self, node: &Node) -> Result<Result<Vec<Patch>, GeometryError>, Error> {
        let mut inside = node.children.iter().map(|link| &self.tree.nodes[link.node]);
        let surface = inside.find(|n| matches!(&*n.kind, "NurbsSurface" | "NurbsPatchSurface"));
        match surface {
            Some(surface) => self.net(surface, node),
            None => {
                let text = "there is no surface in it; it is left out";
                self.warnings.invalid(node.place(), text);
                Ok(Ok(Vec::new()))
            }
        }
    }

    /// A `NurbsSwungSurface`, by the definition of the textbooks.
    fn swung(&mut self, node: &Node) -> Result<Result<Vec<Patch>, GeometryError>, Error> {
        let text = "NurbsSwungSurface is read as profile times trajectory; some viewers differ";
        self.warnings.unsupported(node.place(), text);
        let fields = ["profileCurve", "trajectoryCurve"];
        let Some([profile, trajectory]) = self.parts(node, fields, |_, _| true) else {
            return Ok(Ok(Vec::new()));
        };
        let profile = self.parameter_curve(profile)?;
        let trajectory = self.parameter_curve(trajectory)?;
        let (profile, trajectory) = match profile.and_then(|profile| Ok((profile, trajectory?))) {
            Ok(curves) => curves,
            Err(problem) => return Ok(Err(problem)),
        };
        self.count_net(profile.knots(), trajectory.knots(), node)?;
        let surface = modelling::swung(&profile, &trajectory);
        Ok(surface.and_then(|surface| self.faced(node, vec![surface])))
    }

    /// Counts the control points of a surface that these curves make.
    fn count_net(&mut self, u: &KnotVector, v: &KnotVector, node: &Node) -> Result<(), Error> {
        self.count_product([u.count(), v.count()], node)
    }

    /// A `NurbsSweptSurface`: the section is carried as an `Extrusion` carries it along ever
    /// shorter segments of the trajectory.
    fn swept(&mut self, node: &Node) -> Result<Result<Vec<Patch>, GeometryError>, Error> {
        let fields = ["crossSectionCurve", "trajectoryCurve"];
        let fits = |i, curve: &Node| (i == 0) == is_parameter_curve(&curve.kind);
        let Some([section, trajectory]) = self.parts(node, fields, fits) else {
            return Ok(Ok(Vec::new()));
        };
        let section = self.parameter_curve(section)?;
        let trajectory = self.curve_3d(trajectory)?;
        let (section, trajectory) = match section.and_then(|section| Ok((section, trajectory?))) {
            Ok(curves) => curves,
            Err(problem) => return Ok(Err(problem)),
        };
        if trajectory.degree() == 1 {
            self.count_net(section.knots(), trajectory.knots(), node)?;
            let surface = along_polyline(&section, &trajectory);
            return Ok(surface.and_then(|surface| self.faced(node, vec![surface])));
        }
        let reach = section.points().map(DVec2::length).fold(0.0, f64::max);
        let size = trajectory.hull_bounds().diagonal().max(reach);
        let swept = |section: &Curve<DVec2>| modelling::swept(section, &trajectory, FIT * size);
        // How many points there will be along the trajectory follows from the reach alone, so a
        // short section tells it.
        let short = Curve::line(DVec2::ZERO, DVec2::X * reach, 0.0..1.0);
        let short = match short.and_then(|section| swept(&section)) {
            Ok(swept) => swept,
            Err(problem) => return Ok(Err(problem)),
        };
        for surface in &short.surfaces {
            self.count_net(section.knots(), surface.knots_v(), node)?;
        }
        let swept = match swept(&section) {
            Ok(swept) => swept,
            Err(problem) => return Ok(Err(problem)),
        };
        let accuracy = swept.accuracy;
        if accuracy > FIT * size {
            let text = format!("the surface is only within {accuracy:.1e} of what is meant");
            self.warnings.unsupported(node.place(), text);
        }
        Ok(self.faced(node, swept.surfaces))
    }

    /// Faces of which the front turns around where `ccw` is false.
    fn faced(&mut self, node: &Node, surfaces: Vec<Surface>) -> Result<Vec<Patch>, GeometryError> {
        let turned = !node.flag("ccw", true, &mut self.warnings);
        let patches = surfaces.into_iter().map(Patch::from);
        let face = |p| if turned { self.reversed(p) } else { Ok(p) };
        patches.map(face).collect()
    }

    /// An untrimmed patch with its front at the back. What is on it stays where it is.
    pub(super) fn reversed(&self, patch: Patch) -> Result<Patch, GeometryError> {
        let texture = match &patch.texture {
            Some(texture) => Some(texture.reversed_u()),
            None if self.is_pictured => Some(over_domain(&patch.surface)?.reversed_u()),
            None => None,
        };
        let texture = texture.map(Arc::new);
        Ok(Patch {
            surface: patch.surface.reversed_u(),
            texture,
            ..patch
        })
    }

    /// The curves in two fields. For those that the file puts in no field, or in one that the
    /// node does not have, the first curve that `fits` is taken.
    fn parts(
        &mut self,
        node: &Node,
        fields: [&str; 2],
        fits: impl Fn(usize, &Node) -> bool,
    ) -> Option<[&'a Node; 2]> {
        let tree = self.tree;
        let is_free = |link: &&Link| {
            let curve = &tree.nodes[link.node];
            let is_curve = &*curve.kind == "NurbsCurve" || is_parameter_curve(&curve.kind);
            is_curve && link.field.as_deref().is_none_or(|f| !fields.contains(&f))
        };
        let free = node.children.iter().filter(is_free);
        let mut free: Vec<&Node> = free.map(|link| &tree.nodes[link.node]).collect();
        let mut guessed = false;
        let mut part = |i: usize| {
            let said = self.part(node, fields[i]);
            said.or_else(|| {
                let found = free.iter().position(|curve| fits(i, curve))?;
                guessed = true;
                Some(free.remove(found))
            })
        };
        let parts = [part(0), part(1)];
        let [first, second] = fields;
        let [Some(one), Some(two)] = parts else {
            let text = format!("it needs a {first} and a {second}; it is left out");
            self.warnings.invalid(node.place(), text);
            return None;
        };
        if guessed {
            let text = format!("its curves do not say which is {first} and which {second}");
            self.warnings.invalid(node.place(), text);
        }
        Some([one, two])
    }

    /// The node in a field.
    pub(super) fn part(&self, node: &Node, field: &str) -> Option<&'a Node> {
        let mut links = node.children.iter();
        let link = links.find(|link| link.field.as_deref() == Some(field))?;
        Some(&self.tree.nodes[link.node])
    }

    /// The points of the Coordinate node inside, whatever field it claims to be.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn points_inside(&mut self, node: &Node) -> Result<Vec<DVec3>, Error> {
        let inside = |link: &Link| &self.tree.nodes[link.node];
        let mut inside = node.children.iter().map(inside);
        let coordinate = inside.find(|n| matches!(&*n.kind, "Coordinate" | "CoordinateDouble"));
        // In VRML 97 the points are a field of the surface or interpolator itself.
        let (holder, field) = match coordinate {
            Some(coordinate) => (coordinate, "point"),
            None if node.text("keyValue").is_some() => (node, "keyValue"),
            None => (node, "controlPoint"),
        };
        let points = holder.points_3d(field, &mut self.warnings);
        self.count_points(points.len(), holder)?;
        Ok(points)
    }
}

/// The surface of a node with these control points: in parts where its knots tear it, if directions
/// may be torn.
///
/// # Errors
/// If there is no such surface.
pub(super) fn net(
    node: &Node,
    points: &[DVec3],
    [along_u, along_v]: [&Direction; 2],
    warnings: &mut Warnings,
) -> Result<Vec<Surface>, GeometryError> {
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
    let weights = weights(node, expected, warnings);
    let net = Net {
        points,
        weights: weights.as_deref(),
    };
    let some = expected > 0;
    let u_meets = some && (0..count_v).all(|j| net.same(j * count_u, j * count_u + count_u - 1));
    let v_meets = some && (0..count_u).all(|i| net.same(i, (count_v - 1) * count_u + i));
    let u = Knots::of(node, along_u, count_u, u_meets, warnings)?;
    let v = Knots::of(node, along_v, count_v, v_meets, warnings)?;
    let places = v
        .points(count_v)
        .flat_map(|j| u.points(count_u).map(move |i| j * count_u + i));
    let (points, weights): (Vec<_>, Vec<_>) = places.map(|i| net.cartesian(i)).unzip();
    if u.is_torn() || v.is_torn() {
        let degrees = [u.knots.degree(), v.knots.degree()];
        let mut repairs = Vec::new();
        let knots = [u.list(), v.list()];
        let made = Torn::surfaces_of(degrees, knots, points, weights, &mut repairs);
        for problem in repairs {
            warnings.add(node.place(), problem);
        }
        return made.or_else(|problem| match problem {
            Problem::Geometry(problem) => Err(problem),
            other => {
                warnings.add(node.place(), other);
                Ok(Vec::new())
            }
        });
    }
    let weights = net.weights.map(|_| &weights[..]);
    Surface::from_u_fastest(u.knots, v.knots, &points, weights).map(|surface| vec![surface])
}

/// The control points of a surface as the file has them.
struct Net<'a> {
    points: &'a [DVec3],
    weights: Option<&'a [f64]>,
}

impl Net<'_> {
    fn weight(&self, i: usize) -> f64 {
        self.weights.map_or(1.0, |weights| weights[i])
    }

    /// Whether two control points are one.
    fn same(&self, i: usize, j: usize) -> bool {
        self.points[i] == self.points[j] && self.weight(i).total_cmp(&self.weight(j)).is_eq()
    }

    fn cartesian(&self, i: usize) -> (DVec3, f64) {
        (self.points[i] / self.weight(i), self.weight(i).abs())
    }
}

/// The surface of a section along a polyline, as an `Extrusion` has it.
fn along_polyline(
    section: &Curve<DVec2>,
    trajectory: &Curve<DVec3>,
) -> Result<Surface, GeometryError> {
    let spine: Vec<DVec3> = trajectory.points().collect();
    let frames = frames(&spine);
    let rows = spine.iter().zip(&frames);
    let points: Vec<DVec3> = rows
        .flat_map(|(&place, axes)| {
            let point = move |c: DVec2| place + *axes * DVec3::new(c.x, 0.0, c.y);
            section.points().map(point)
        })
        .collect();
    let weights: Vec<f64> = spine.iter().flat_map(|_| section.weights()).collect();
    let (u, v) = (section.knots().clone(), trajectory.knots().clone());
    Surface::from_u_fastest(u, v, &points, Some(&weights))
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
