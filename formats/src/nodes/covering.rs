//! Texture coordinates: those of the file, and those that geometries have without.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec2, DVec3, DVec4};
use kernel::modelling::{arc_angle, fit, plane};
use kernel::{Aabb, Error as GeometryError, KnotVector, Patch, Surface, linear_from_srgb};

use super::Node;
use super::knots::Direction;
use super::mesh::Polygons;
use super::scene::Converter;
use crate::Error;

/// How far texture coordinates that are angles may be from those.
const ANGLE: f64 = 1e-9;

impl<'a> Converter<'a> {
    /// The texture coordinates of a net of control points, if the file gives any.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn net_coordinates(
        &mut self,
        node: &Node,
        surface: &Surface,
    ) -> Result<Option<Surface>, Error> {
        let Some(holder) = self.coordinates_node(node) else {
            return Ok(None);
        };
        let made = match &*holder.kind {
            "TextureCoordinate" => {
                let points = holder.points_2d("point", &mut self.warnings);
                self.count_points(points.len(), holder)?;
                over_net(surface, &points)
            }
            _ => self.own_net(holder, surface)?,
        };
        Ok(made
            .map_err(|problem| self.warnings.add(holder.place(), problem))
            .ok())
    }

    /// The node with texture coordinates in a geometry: the first, if there are several.
    pub(super) fn coordinates_node(&mut self, node: &Node) -> Option<&'a Node> {
        let tree = self.tree;
        let inside = |node: &Node| {
            let mut nodes = tree.inside(node);
            nodes.find(|n| COORDINATES.contains(&&*n.kind))
        };
        let mut found = inside(node)?;
        if &*found.kind == "MultiTextureCoordinate" {
            found = inside(found)?;
        }
        if matches!(
            &*found.kind,
            "TextureCoordinateGenerator" | "MultiTextureCoordinate"
        ) {
            let text = format!("{} is not read", found.kind);
            self.warnings.unsupported(found.place(), text);
            return None;
        }
        Some(found)
    }

    /// Texture coordinates for each corner of polygons: those of the file, or what the node has
    /// without where it is shown with a picture.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn coordinates(
        &mut self,
        node: &Node,
        points: &[DVec3],
        polygons: &Polygons,
    ) -> Result<Option<Vec<DVec2>>, Error> {
        if let Some(holder) = self.coordinates_node(node) {
            let given = holder.points_2d("point", &mut self.warnings);
            self.count_points(given.len(), holder)?;
            let mut indices = self.indices(node, "texCoordIndex")?;
            if &*node.kind != "IndexedFaceSet" {
                indices.clear();
            }
            return Ok(self.spread(holder, &given, &indices, true, polygons));
        }
        if !self.is_pictured {
            return Ok(None);
        }
        let given = match &*node.kind {
            "ElevationGrid" => {
                let x = node.count("xDimension", 1, &mut self.warnings).max(1);
                over_grid(points.len(), x)
            }
            _ => over_box(points),
        };
        Ok(self.spread(node, &given, &[], true, polygons))
    }

    /// A linear colour with alpha for each corner of polygons, if the file gives any.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn colors(
        &mut self,
        node: &Node,
        polygons: &Polygons,
    ) -> Result<Option<Vec<DVec4>>, Error> {
        let mut inside = self.tree.inside(node);
        let Some(holder) = inside.find(|n| matches!(&*n.kind, "Color" | "ColorRGBA")) else {
            return Ok(None);
        };
        let numbers = holder.numbers("color", &mut self.warnings);
        let size = if &*holder.kind == "Color" { 3 } else { 4 };
        self.count_points(numbers.len() / size, holder)?;
        let color = |c: &[f64]| {
            let color = DVec3::new(c[0], c[1], c[2]).clamp(DVec3::ZERO, DVec3::ONE);
            let alpha = c.get(3).map_or(1.0, |alpha| alpha.clamp(0.0, 1.0));
            linear_from_srgb(color).extend(alpha)
        };
        let given: Vec<_> = numbers.chunks_exact(size).map(color).collect();
        let per_vertex = node.flag("colorPerVertex", true, &mut self.warnings);
        let indices = self.indices(node, "colorIndex")?;
        Ok(self.spread(holder, &given, &indices, per_vertex, polygons))
    }

    /// Gives a face of a solid of revolution its texture coordinates, if they are not those of its
    /// domain. Those around it are the same for all sizes, and are made once.
    pub(super) fn cover(&mut self, kind: &str, patch: &mut Patch) -> Result<(), GeometryError> {
        let bounds = patch.surface.hull_bounds();
        let is_flat = bounds.max.y <= bounds.min.y;
        let flat = |x: DVec3, y: DVec3, radius: f64| {
            let rows = DMat3::from_cols(x, y, DVec3::ZERO).transpose() * (0.5 / radius);
            let map = DAffine3::from_mat3_translation(rows, DVec3::new(0.5, 0.5, 0.0));
            Arc::new(patch.surface.transformed(&map))
        };
        patch.texture = Some(match kind {
            // Upright where the top is turned to the front, and the bottom to the back.
            "Cone" | "Cylinder" if is_flat => {
                let y = DVec3::NEG_Z * bounds.max.y.signum();
                flat(DVec3::X, y, bounds.max.x)
            }
            "Disk2D" => flat(DVec3::X, DVec3::Y, bounds.max.x),
            // As if the whole disk were there; its first corner is on the arc.
            "ArcClose2D" => {
                let start = patch.surface.corners()[0][0];
                flat(DVec3::X, DVec3::Y, start.length())
            }
            "Cone" | "Cylinder" | "Sphere" => match self.covers.get(kind) {
                Some(known) => Arc::clone(known),
                None => {
                    let made = Arc::new(around(kind, &patch.surface)?);
                    self.covers.insert(kind.into(), Arc::clone(&made));
                    made
                }
            },
            _ => return Ok(()),
        });
        Ok(())
    }

    /// A texture surface with knots of its own, brought to the parameters of `surface`.
    fn own_net(
        &mut self,
        node: &Node,
        surface: &Surface,
    ) -> Result<Result<Surface, GeometryError>, Error> {
        let numbers = node.numbers("controlPoint", &mut self.warnings);
        self.count_points(numbers.len() / 2, node)?;
        let [u, v] = ["uDimension", "vDimension"].map(|f| node.count(f, 0, &mut self.warnings));
        // VRML 97 has programs that write a third number.
        let size = if u.saturating_mul(v).saturating_mul(3) == numbers.len() {
            3
        } else {
            2
        };
        let points = numbers.chunks_exact(size);
        let points: Vec<_> = points.map(|p| DVec3::new(p[0], p[1], 0.0)).collect();
        let [along_u, along_v, _] = &Direction::VOLUME;
        let made = super::nurbs::net(node, &points, [along_u, along_v], &mut self.warnings);
        let whole = made.and_then(|mut made| made.pop().ok_or(GeometryError::Singular));
        Ok(whole.and_then(|made| {
            let [u, v] = [surface.knots_u(), surface.knots_v()].map(KnotVector::domain);
            made.remapped(u, v)
        }))
    }
}

/// Nodes with texture coordinates.
pub(super) const COORDINATES: &[&str] = &[
    "MultiTextureCoordinate",
    "NurbsTextureCoordinate",
    "NurbsTextureSurface",
    "TextureCoordinate",
    "TextureCoordinateGenerator",
];

/// A texture coordinate for each control point of a surface, u fastest: carried along by its
/// knots, without its weights. Around the joint of a closed surface they begin anew.
fn over_net(surface: &Surface, points: &[DVec2]) -> Result<Surface, GeometryError> {
    let (u, v) = (surface.knots_u(), surface.knots_v());
    let (found, expected) = (points.len(), u.count() * v.count());
    if found != expected {
        return Err(GeometryError::PointCount { found, expected });
    }
    let points: Vec<_> = points.iter().map(|p| p.extend(0.0)).collect();
    Surface::from_u_fastest(u.clone(), v.clone(), &points, None)
}

/// Those of an `ElevationGrid` with so many points, `x` in a row.
fn over_grid(count: usize, x: usize) -> Vec<DVec2> {
    let last = DVec2::new((x - 1) as f64, (count / x).saturating_sub(1) as f64);
    let at = |i: usize| DVec2::new((i % x) as f64, (i / x) as f64) / last.max(DVec2::ONE);
    (0..count).map(at).collect()
}

/// Those of polygons without any: the two longest sides of their box, the longest from 0 to 1
/// (ISO/IEC 19775-1, 13.3.6).
fn over_box(points: &[DVec3]) -> Vec<DVec2> {
    let bounds = Aabb::around(points.iter().copied());
    let size = bounds.max - bounds.min;
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| size[b].total_cmp(&size[a]));
    let longest = if size[axes[0]] > 0.0 {
        size[axes[0]]
    } else {
        1.0
    };
    let at = |p: &DVec3| (*p - bounds.min) / longest;
    points
        .iter()
        .map(|p| DVec2::new(at(p)[axes[0]], at(p)[axes[1]]))
        .collect()
}

/// Texture coordinates from 0 to 1 over the domain of a surface, as patches have them.
pub(super) fn over_domain(surface: &Surface) -> Result<Surface, GeometryError> {
    let [u, v] = [surface.knots_u(), surface.knots_v()].map(KnotVector::domain);
    plane(DVec3::ZERO, DVec3::X, DVec3::Y, u, v)
}

/// Texture coordinates on a sphere, or on the side of a cone or cylinder, of any size: the sum of
/// what comes along u and what comes along v.
fn around(kind: &str, surface: &Surface) -> Result<Surface, GeometryError> {
    let [u, v] = [surface.knots_u(), surface.knots_v()];
    let along = |knots: &KnotVector, at: &dyn Fn(f64) -> DVec2| {
        fit(at, &knots.breaks(), ANGLE, DVec2::distance).map(|fit| fit.curve)
    };
    let turn = |knots: &KnotVector, t: f64| DVec2::X * (arc_angle(knots, t) / TAU);
    let (along_u, along_v) = if kind == "Sphere" {
        let height = |t: f64| DVec2::Y * (arc_angle(v, t) / PI + 0.5);
        (along(u, &|t| turn(u, t))?, along(v, &height)?)
    } else {
        (
            along(u, &|t| DVec2::Y * (1.0 - t))?,
            along(v, &|t| turn(v, t))?,
        )
    };
    let row = |a: DVec2| along_v.points().map(move |b| (a + b).extend(0.0));
    let points: Vec<DVec3> = along_u.points().flat_map(row).collect();
    let [u, v] = [along_u, along_v].map(|curve| curve.knots().clone());
    Surface::new(u, v, &points, None)
}
