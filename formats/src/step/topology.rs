//! Edges, faces, shells, solids, and whatever else representations are made of.

use std::rc::Rc;

use glam::DVec3;
use kernel::{Aabb, Curve};

use super::arcs::{Basis, End, between};
use super::tessellated::Shape;
use super::translator::Translator;
use super::values::{Record, Value};
use crate::Problem;
use crate::iges::Fields;

/// How deep edges, faces, shells and items may be made of others.
const NESTING: usize = 16;

/// A curve that ends farther from its vertex than this share of its size is too short.
const BESIDE: f64 = 1e-2;

/// Edges no farther from a plane than this share of their size are in it.
const FLAT: f64 = 1e-6;

/// An edge in the draft.
#[derive(Debug)]
pub(super) struct Edge {
    /// The pointer to its curve; zero if it has no length.
    pointer: i64,
    pub pieces: Vec<Curve<DVec3>>,
    /// The instance of its curve, or zero.
    pub curve: u64,
    /// Whether its curve runs as it does.
    pub is_along: bool,
}

impl Edge {
    /// A point in the middle of it.
    pub(super) fn middle(&self) -> Option<DVec3> {
        let piece = self.pieces.get(self.pieces.len() / 2)?;
        let domain = piece.domain();
        Some(piece.evaluate(f64::midpoint(domain.start, domain.end)))
    }
}

/// A stretch of a loop: an edge, and whether it is run through backwards.
pub(super) type Stretch = (Rc<Edge>, bool);

impl Translator<'_> {
    /// What an item of a representation becomes: the pointer to it, if it can be shown.
    pub(super) fn item(&mut self, id: u64, depth: usize) -> Option<i64> {
        if let Some(known) = self.known.items.get(&id) {
            return *known;
        }
        self.check_size(id);
        if self.fatal.is_some() {
            return None;
        }
        if !self.busy.insert(id) {
            self.fail(id, Problem::Invalid("it contains itself".to_owned()));
            return None;
        }
        let made = if depth > NESTING + self.limits.nesting {
            let text = format!("nested more than {} deep", NESTING + self.limits.nesting);
            Err(Problem::Unsupported(text))
        } else {
            self.named_item(id, depth)
        };
        self.busy.remove(&id);
        let made = made.unwrap_or_else(|problem| {
            self.fail(id, problem);
            None
        });
        self.known.items.insert(id, made);
        made
    }

    pub(super) fn items(&mut self, ids: &[u64], depth: usize) -> Vec<i64> {
        let made = ids.iter().filter_map(|&id| self.item(id, depth + 1));
        made.collect()
    }

    fn named_item(&mut self, id: u64, depth: usize) -> Result<Option<i64>, Problem> {
        let record = self.geometry().get(id)?;
        if let Some(shape) = Shape::of(&record) {
            return self.tessellated(id, &record, shape, depth);
        }
        let at = record.attributes();
        let name = at.text(0);
        let made = match record.name() {
            "MANIFOLD_SOLID_BREP" | "FACETED_BREP" | "BREP_WITH_VOIDS" => {
                let (name, shells) = shells(&record)?;
                self.solid(id, &shells, name, depth)
            }
            "CLOSED_SHELL" | "OPEN_SHELL" | "CONNECTED_FACE_SET" | "CONNECTED_FACE_SUB_SET" => {
                let faces = at.references(1)?;
                self.find_against(&faces);
                let faces = self.items(&faces, depth);
                let fields = Fields::new(514).count(faces.len());
                let fields = fields.integers(faces.into_iter().flat_map(|face| [face, 1]));
                Some(self.add_named(1, &fields, id, name))
            }
            "ORIENTED_CLOSED_SHELL" | "ORIENTED_OPEN_SHELL" | "ORIENTED_FACE" => {
                self.item(at.reference(2)?, depth + 1)
            }
            "ADVANCED_FACE" | "FACE_SURFACE" | "FACE" => Some(self.face(id, &record)?),
            "SHELL_BASED_SURFACE_MODEL"
            | "FACE_BASED_SURFACE_MODEL"
            | "GEOMETRIC_SET"
            | "GEOMETRIC_CURVE_SET"
            | "EDGE_BASED_WIREFRAME_MODEL"
            | "SHELL_BASED_WIREFRAME_MODEL"
            | "CONNECTED_EDGE_SET"
            | "WIRE_SHELL"
            | "EDGE_LOOP" => {
                let members = self.items(&at.references(1)?, depth);
                self.group(members, id, name)
            }
            "EDGE_CURVE" | "ORIENTED_EDGE" | "SEAM_EDGE" | "SUBEDGE" | "EDGE" => {
                let (edge, _) = self.edge(id)?;
                Some(edge.pointer).filter(|pointer| *pointer != 0)
            }
            _ => self.free_item(id, &record, depth)?,
        };
        Ok(made)
    }

    /// What an item becomes that is neither a body nor a part of one.
    fn free_item(
        &mut self,
        id: u64,
        record: &Record<'_>,
        depth: usize,
    ) -> Result<Option<i64>, Problem> {
        let at = record.attributes();
        let name = at.text(0);
        let made = match record.name() {
            "CARTESIAN_POINT" | "VERTEX_POINT" => {
                let point = self.geometry().point(id)?;
                let fields = Fields::new(116).reals(point.to_array());
                Some(self.add_named(0, &fields, id, name))
            }
            "RECTANGULAR_TRIMMED_SURFACE" => Some(self.rectangle(id)?.pointer),
            "CURVE_BOUNDED_SURFACE" => Some(self.curve_bounded(id, record)?),
            "MAPPED_ITEM" => self.mapped(id, record, depth)?,
            "SOLID_REPLICA" => {
                let map = self.geometry().map(at.reference(2)?)?;
                let parent = self.item(at.reference(1)?, depth + 1);
                parent.map(|parent| {
                    let definition = self.definition(vec![parent], id, String::new());
                    self.placed(definition, &map, id, name)
                })
            }
            kind if is_silent(kind) => None,
            "PLANE"
            | "CYLINDRICAL_SURFACE"
            | "CONICAL_SURFACE"
            | "LINE"
            | "PARABOLA"
            | "HYPERBOLA" => {
                let text = "nothing bounds it, and it has no end; it is not shown";
                return Err(Problem::Unsupported(text.to_owned()));
            }
            kind if is_curve(kind) || record.part("B_SPLINE_CURVE").is_some() => {
                let pieces = self.geometry().pieces(id, 0)?;
                self.wire(&pieces, id)?
            }
            kind if is_surface(kind) || record.part("B_SPLINE_SURFACE").is_some() => {
                Some(self.surface(id, &[], 0)?.pointer)
            }
            _ => self.constructed(id, record, depth)?,
        };
        Ok(made)
    }

    /// Members that are shown together.
    pub(super) fn group(&mut self, members: Vec<i64>, id: u64, name: String) -> Option<i64> {
        if members.is_empty() {
            return None;
        }
        let definition = self.definition(members, id, name);
        Some(self.placed(definition, &glam::DAffine3::IDENTITY, id, String::new()))
    }

    /// A curve in pieces; `None` without any.
    pub(super) fn wire(
        &mut self,
        pieces: &[Curve<DVec3>],
        id: u64,
    ) -> Result<Option<i64>, Problem> {
        let points = pieces.iter().map(|curve| curve.homogeneous().len()).sum();
        self.spend(points)?;
        let pointers: Vec<i64> = pieces.iter().map(|curve| self.curve(curve, id)).collect();
        Ok(match pointers.as_slice() {
            [] => None,
            [one] => Some(*one),
            all => {
                let fields = Fields::new(102).count(all.len());
                Some(self.add(0, &fields.integers(all.iter().copied()), id))
            }
        })
    }

    /// A solid of its outer shell and its voids.
    fn solid(&mut self, id: u64, shells: &[u64], name: String, depth: usize) -> Option<i64> {
        let mut made = shells.iter().map(|&shell| self.item(shell, depth + 1));
        let outer = made.next().flatten();
        let voids: Vec<i64> = made.flatten().collect();
        let outer = outer?;
        let fields = Fields::new(186).integers([outer, 1]).count(voids.len());
        let fields = fields.integers(voids.into_iter().flat_map(|shell| [shell, 1]));
        Some(self.add_named(0, &fields, id, name))
    }

    /// An edge, and whether it is run through backwards.
    fn edge(&mut self, id: u64) -> Result<Stretch, Problem> {
        let (mut id, mut is_backwards) = (id, false);
        for _ in 0..NESTING {
            let record = self.geometry().get(id)?;
            if !matches!(record.name(), "ORIENTED_EDGE" | "SEAM_EDGE") {
                break;
            }
            is_backwards ^= !record.attributes().is_true(4, true);
            id = record.attributes().reference(3)?;
        }
        if let Some(known) = self.edges.get(&id) {
            return known.clone().map(|edge| (edge, is_backwards));
        }
        let made = self.new_edge(id).map(Rc::new);
        let made = made.map_err(|problem| self.geometry().within(id, problem));
        self.edges.insert(id, made.clone());
        made.map(|edge| (edge, is_backwards))
    }

    fn new_edge(&mut self, id: u64) -> Result<Edge, Problem> {
        let geometry = self.geometry();
        let record = geometry.get(id)?;
        let at = record.attributes();
        let ends = [at.reference(1)?, at.reference(2)?];
        let points = [geometry.point(ends[0])?, geometry.point(ends[1])?];
        let (mut is_along, mut curve) = (true, 0);
        let mut record = record.clone();
        for _ in 0..NESTING {
            // A part of another one has its curve.
            if record.name() != "SUBEDGE" {
                break;
            }
            record = geometry.get(record.attributes().reference(3)?)?;
        }
        let basis = match record.name() {
            "EDGE_CURVE" => {
                is_along = record.attributes().is_true(4, true);
                curve = record.attributes().reference(3)?;
                geometry.basis(curve, 0)?
            }
            "EDGE" => Basis::Line {
                origin: points[0],
                along: points[1] - points[0],
            },
            _ => return Err(geometry.unread(record.id, "edge")),
        };
        let mut ends = points;
        if !is_along {
            ends.reverse();
        }
        let mut pieces = between(&basis, Some(ends.map(End::Point)))?;
        if reach(&mut pieces, ends) {
            let text = "its curve ends beside its vertex; a line joins them";
            self.note(id, Problem::Invalid(text.to_owned()));
        }
        let pointer = self.wire(&pieces, id)?.unwrap_or_default();
        Ok(Edge {
            pointer,
            pieces,
            curve,
            is_along,
        })
    }

    /// The straight edges between points, which close.
    fn polygon(&mut self, id: u64, record: &Record<'_>) -> Result<Vec<Stretch>, Problem> {
        let ids = record.attributes().references(1)?;
        let geometry = self.geometry();
        let points: Result<Vec<_>, _> = ids.iter().map(|&id| geometry.point(id)).collect();
        let points = points?;
        let mut stretches = Vec::new();
        for (k, &start) in points.iter().enumerate() {
            let end = points[(k + 1) % points.len()];
            let line = Basis::Line {
                origin: start,
                along: end - start,
            };
            let pieces = between(&line, Some([start, end].map(End::Point)))?;
            let pointer = self.wire(&pieces, id)?.unwrap_or_default();
            let edge = Edge {
                pointer,
                pieces,
                curve: 0,
                is_along: true,
            };
            stretches.push((Rc::new(edge), false));
        }
        Ok(stretches)
    }

    /// The edges around a face, loop by loop; loops of a vertex bound nothing.
    pub(super) fn loops(&mut self, bounds: &[u64]) -> Result<Vec<Vec<Stretch>>, Problem> {
        let mut loops = Vec::new();
        for &bound in bounds {
            let record = self.geometry().get(bound)?;
            let at = record.attributes();
            let path = at.reference(1)?;
            let record = self.geometry().get(path)?;
            let mut stretches = match record.name() {
                "EDGE_LOOP" => {
                    let edges = record.attributes().references(1)?;
                    let edges = edges.into_iter().map(|edge| self.edge(edge));
                    edges.collect::<Result<Vec<_>, _>>()?
                }
                "POLY_LOOP" => self.polygon(path, &record)?,
                "VERTEX_LOOP" => continue,
                _ => return Err(self.geometry().unread(path, "loop")),
            };
            // Each has an instance of its own, or a point of a polygon, unless the file is out to take
            // all time and memory.
            let left = self.stretches_left.checked_sub(stretches.len());
            self.stretches_left = left.ok_or_else(|| {
                let text =
                    "loops are named so often that their edges are more than the file is long";
                Problem::TooLarge(text.to_owned())
            })?;
            if !at.is_true(2, true) {
                turn(&mut stretches);
            }
            stretches.retain(|(edge, _)| edge.pointer != 0);
            if !stretches.is_empty() {
                loops.push(stretches);
            }
        }
        Ok(loops)
    }

    /// A face with its surface and its loops.
    fn face(&mut self, id: u64, record: &Record<'_>) -> Result<i64, Problem> {
        let at = record.attributes();
        let mut loops = self.loops(&at.references(1)?)?;
        let hull: Vec<DVec3> = loops
            .iter()
            .flatten()
            .flat_map(|(edge, _)| edge.pieces.iter().flat_map(Curve::points))
            .collect();
        // What polygons bound is flat, wherever the surface of the file is.
        let (pointer, is_turned) = if record.name() == "FACE" || self.is_facet(record) {
            (self.plane_through(id, &loops, f64::INFINITY)?, false)
        } else if let Some(Value::Nothing) = at.get(2) {
            let plane = self.plane_through(id, &loops, FLAT)?;
            let text = "it has no surface; its edges are in one plane, which is taken";
            self.note(id, Problem::Invalid(text.to_owned()));
            (plane, false)
        } else {
            let edges = loops.iter().flatten();
            self.edges_around = edges.map(|(edge, _)| Rc::clone(edge)).collect();
            let sheet = self.surface(at.reference(2)?, &hull, 0);
            self.edges_around.clear();
            let sheet = sheet?;
            (sheet.pointer, sheet.is_turned == at.is_true(3, true))
        };
        let is_against = self.against.contains(&id);
        if is_against {
            let text =
                "its loops run the other way round than those of its neighbours; they are turned";
            self.note(id, Problem::Invalid(text.to_owned()));
        }
        if is_turned != is_against {
            loops.iter_mut().for_each(turn);
        }
        let mut pointers = Vec::new();
        for stretches in &loops {
            pointers.push(self.path(stretches, id));
        }
        let fields = Fields::new(510)
            .integers([pointer])
            .count(pointers.len())
            .integers([0])
            .integers(pointers);
        Ok(self.add_named(1, &fields, id, at.text(0)))
    }

    /// Whether polygons of points are around a face.
    fn is_facet(&self, record: &Record<'_>) -> bool {
        let first = || -> Result<u64, Problem> {
            let bounds = record.attributes().references(1)?;
            let bound = bounds.first().copied().unwrap_or_default();
            self.exchange.get(bound)?.attributes().reference(1)
        };
        first().is_ok_and(|path| {
            self.exchange
                .keyword(path)
                .eq_ignore_ascii_case(b"POLY_LOOP")
        })
    }

    /// A loop (type 508).
    fn path(&mut self, stretches: &[Stretch], id: u64) -> i64 {
        let uses = stretches.iter().flat_map(|(edge, is_backwards)| {
            let with = i64::from(*is_backwards != edge.is_along);
            [0, edge.pointer, 0, with, 0]
        });
        let fields = Fields::new(508).count(stretches.len()).integers(uses);
        self.add(1, &fields, id)
    }

    /// The plane of the first loop of a face that has no surface, unless points of its edges are farther off than
    /// a share of its size.
    fn plane_through(
        &mut self,
        id: u64,
        loops: &[Vec<Stretch>],
        most: f64,
    ) -> Result<i64, Problem> {
        let first = loops
            .first()
            .ok_or_else(|| Problem::Invalid("it has neither a surface nor a loop".to_owned()))?;
        let run = |(edge, is_backwards): &Stretch| {
            let mut points: Vec<DVec3> = edge.pieces.iter().flat_map(Curve::points).collect();
            if *is_backwards == edge.is_along {
                points.reverse();
            }
            points
        };
        let points: Vec<DVec3> = first.iter().flat_map(run).collect();
        let origin = points.first().copied().unwrap_or_default();
        let pairs = points.windows(2);
        let normal: DVec3 = pairs
            .map(|pair| (pair[0] - origin).cross(pair[1] - origin))
            .sum();
        let normal = normal.try_normalize();
        let normal = normal.ok_or(Problem::Geometry(kernel::Error::NoDirection))?;
        let size = Aabb::around(points.iter().copied()).diagonal();
        let is_off = |p: &DVec3| (*p - origin).dot(normal).abs() > most * size;
        if points.iter().any(is_off) {
            let text = "it has no surface, and its edges are not in one plane";
            return Err(Problem::Invalid(text.to_owned()));
        }
        let location = self.vector(116, origin, id);
        let axis = self.vector(123, normal, id);
        let fields = Fields::new(190).integers([location, axis]);
        Ok(self.add(0, &fields, id))
    }

    /// A curve of space as a boundary of a surface (type 141).
    pub(super) fn boundary(&mut self, surface: i64, curve: i64, id: u64) -> i64 {
        let fields = Fields::new(141).integers([0, 1, surface, 1, curve, 1, 0]);
        self.add(0, &fields, id)
    }

    /// A surface that curves bound (types 143 and 141).
    fn curve_bounded(&mut self, id: u64, record: &Record<'_>) -> Result<i64, Problem> {
        let at = record.attributes();
        let mut boundaries = Vec::new();
        let mut hull = Vec::new();
        for boundary in at.references(2)? {
            let pieces = self.geometry().pieces(boundary, 0)?;
            hull.extend(pieces.iter().flat_map(Curve::points));
            boundaries.push((boundary, pieces));
        }
        let surface = self.surface(at.reference(1)?, &hull, 0)?.pointer;
        let mut pointers = Vec::new();
        for (boundary, pieces) in boundaries {
            let Some(curve) = self.wire(&pieces, boundary)? else {
                continue;
            };
            pointers.push(self.boundary(surface, curve, boundary));
        }
        let fields = if at.is_true(3, false) {
            // All boundaries are holes in the surface, which ends with its own border.
            let fields = Fields::new(144).integers([surface, 0]);
            fields
                .count(pointers.len())
                .integers([0])
                .integers(pointers)
        } else {
            bounded(surface, pointers)
        };
        Ok(self.add_named(0, &fields, id, at.text(0)))
    }
}

/// The parameters of a surface with its boundaries (type 143).
pub(super) fn bounded(surface: i64, boundaries: Vec<i64>) -> Fields {
    let fields = Fields::new(143).integers([0, surface]);
    fields.count(boundaries.len()).integers(boundaries)
}

/// Adds lines where a curve in pieces ends far from where it should; whether any was.
fn reach(pieces: &mut Vec<Curve<DVec3>>, [start, end]: [DVec3; 2]) -> bool {
    let (Some(first), Some(last)) = (pieces.first(), pieces.last()) else {
        return false;
    };
    let sizes = pieces.iter().map(|curve| curve.hull_bounds().diagonal());
    let near = sizes.fold(0.0, f64::max) * BESIDE;
    let line = |a: DVec3, b: DVec3| {
        let length = a.distance(b);
        let is_apart = length > near;
        is_apart
            .then(|| Curve::line(a, b, 0.0..length).ok())
            .flatten()
    };
    let [before, after] = [line(start, first.start()), line(last.end(), end)];
    let is_any = before.is_some() || after.is_some();
    pieces.splice(0..0, before);
    pieces.extend(after);
    is_any
}

/// Turns a loop round.
fn turn(stretches: &mut Vec<Stretch>) {
    stretches.reverse();
    for (_, is_backwards) in stretches {
        *is_backwards = !*is_backwards;
    }
}

/// Whether a type is that of curves; those of several types have a part that tells.
fn is_curve(kind: &str) -> bool {
    kind.ends_with("CURVE")
        || kind.ends_with("CURVE_WITH_KNOTS")
        || matches!(
            kind,
            "CIRCLE" | "ELLIPSE" | "POLYLINE" | "CURVE_REPLICA" | "COMPOSITE_CURVE_ON_SURFACE"
        )
}

/// As [`is_curve`], of surfaces.
fn is_surface(kind: &str) -> bool {
    kind.ends_with("SURFACE")
        || kind.ends_with("SURFACE_WITH_KNOTS")
        || kind.starts_with("SURFACE_OF_")
        || kind == "SURFACE_REPLICA"
}

/// Whether an item is there for the sake of others, and shows nothing.
fn is_silent(kind: &str) -> bool {
    kind.starts_with("AXIS")
        || kind.ends_with("STYLED_ITEM")
        || kind.contains("REPRESENTATION_ITEM")
        || kind.starts_with("CARTESIAN_TRANSFORMATION_OPERATOR")
        || kind.starts_with("ANNOTATION")
        || matches!(kind, "DIRECTION" | "PLANAR_EXTENT" | "PLANAR_BOX")
}

/// The name of a solid, and its shells, the outer one first.
fn shells(record: &Record<'_>) -> Result<(String, Vec<u64>), Problem> {
    let at = record.attributes();
    let voids = record.part("BREP_WITH_VOIDS");
    // Those that are of several types have each attribute where it comes from.
    let outer = record.part("MANIFOLD_SOLID_BREP");
    if let Some(outer) = outer.filter(|_| record.parts.len() > 1) {
        let name = record.part("REPRESENTATION_ITEM").map(|at| at.text(0));
        let voids = voids.map_or(Ok(Vec::new()), |at| at.references(0))?;
        let shells = [vec![outer.reference(0)?], voids].concat();
        return Ok((name.unwrap_or_default(), shells));
    }
    let voids = voids.map_or(Ok(Vec::new()), |at| at.references(2))?;
    Ok((at.text(0), [vec![at.reference(1)?], voids].concat()))
}
