//! Solids (type 186) of shells (514) of faces (510): what a scene declares to be a solid.
//!
//! Faces share their edges (504) and vertices (502), or else other programs see no solid. Where these
//! are not found the faces are written side by side, which all programs read.

use std::borrow::Cow;

use glam::{DAffine3, DMat3, DVec3};
use kernel::{Child, Integrals, Item, Node, NodeId, Patch, Shape, TrimLoop};

use super::{Tree, distorted};
use crate::iges::write::cards::{Entity, Record, Status};
use crate::iges::write::geometry;
use crate::iges::write::model::axis_along;
use crate::iges::write::sew::{self, Along, Face, Flaw, Shell, Stretch};
use crate::write::tell_lost;
use crate::{Place, Problem};

/// The normals of a closed shell, taken together, are no longer than this share of its area.
const CLOSED: f64 = 1e-4;

/// A face of a shell, as large as one outer loop makes it.
struct Part<'a> {
    item: Item,
    patch: Cow<'a, Patch>,
    /// The outer loop and the holes, with the face on their left.
    loops: Vec<TrimLoop>,
}

/// A shell that can be written: its faces, whether each looks along the normal of its surface, and how
/// they hang together.
struct Closed<'a> {
    name: &'a str,
    parts: Vec<Part<'a>>,
    looks_along: Vec<bool>,
    shell: Shell,
}

impl<'a> Tree<'a> {
    /// Whether a node is declared to be a solid, and it is not known yet that it cannot be written as one.
    pub(super) fn is_solid(&self, id: NodeId) -> bool {
        self.scene.node(id).voids.is_some() && !self.refused.contains(&id)
    }

    /// The solid that a node is declared to be; nothing if it is none, or cannot be written as one,
    /// which is told.
    pub(super) fn solid(
        &mut self,
        id: NodeId,
        outer: DMat3,
        status: Status,
    ) -> Result<Option<usize>, Problem> {
        let scene = self.scene;
        let node = scene.node(id);
        if !self.is_solid(id) {
            return Ok(None);
        }
        let mut lost = Vec::new();
        let shells = match self.shells(node, outer, &mut lost) {
            Ok(shells) => shells,
            Err(why) => {
                let place = Place::item(0, format!("node \"{}\"", node.name));
                let text = format!("{why}; it is written as faces side by side, not as a solid");
                self.warnings.unsupported(place, text);
                self.refused.insert(id);
                return Ok(None);
            }
        };
        lost.iter()
            .for_each(|patch| tell_lost(patch, &mut self.warnings));
        let pointers: Vec<_> = shells.iter().map(|closed| self.shell(closed)).collect();
        let mut record = Record::new(186);
        record.integers([pointers[0], 1, pointers.len() - 1]);
        record.integers(pointers[1..].iter().flat_map(|&void| [void, 1]));
        let solid = self.deck.add(Entity {
            kind: 186,
            status,
            record,
            ..Entity::default()
        });
        self.name(solid, &node.name);
        Ok(Some(solid))
    }

    /// The shells of a solid, the outer one first; or why it cannot be written. Patches of which their
    /// loops leave nothing are `lost`.
    fn shells(
        &self,
        node: &'a Node,
        outer: DMat3,
        lost: &mut Vec<&'a Patch>,
    ) -> Result<Vec<Closed<'a>>, String> {
        let scene = self.scene;
        let other = || "it is not made of shells".to_owned();
        if !node.wires.is_empty() || node.voids.is_none_or(|n| n + 1 != node.children.len()) {
            return Err(other());
        }
        let mut shells = Vec::new();
        for (k, child) in node.children.iter().enumerate() {
            let Child::Node(id) = child else {
                return Err(other());
            };
            let shell = scene.node(*id);
            let mut parts = Vec::new();
            let is_plain = shell.parent_from_node == DAffine3::IDENTITY
                && self.parts(shell, outer, &mut parts, lost).is_some();
            if !is_plain || parts.is_empty() {
                return Err(other());
            }
            // Programs that show their surfaces take no shell for closed that has them.
            if parts.iter().any(|part| part.patch.has_crossing_loops()) {
                return Err("loops of its faces cross".to_owned());
            }
            shells.push(closed(&shell.name, parts, node.is_void(k))?);
        }
        Ok(shells)
    }

    /// Collects the faces of a shell; `None` if there is anything else in it.
    fn parts(
        &self,
        node: &'a Node,
        outer: DMat3,
        parts: &mut Vec<Part<'a>>,
        lost: &mut Vec<&'a Patch>,
    ) -> Option<()> {
        if !node.wires.is_empty() || node.voids.is_some() {
            return None;
        }
        let scene = self.scene;
        for child in &node.children {
            let item = match child {
                Child::Item(item) => *item,
                // A face in several pieces.
                Child::Node(id) => {
                    let inner = scene.node(*id);
                    let names = |child: &Child| match child {
                        Child::Item(Item {
                            shape: Shape::Patch(id),
                            ..
                        }) => scene.patch(*id).name == inner.name,
                        _ => false,
                    };
                    if inner.parent_from_node != DAffine3::IDENTITY
                        || !(inner.name.is_empty() || inner.children.iter().all(names))
                    {
                        return None;
                    }
                    self.parts(inner, outer, parts, lost)?;
                    continue;
                }
            };
            let Shape::Patch(id) = item.shape else {
                return None;
            };
            let own = scene.patch(id);
            let patch = distorted(own, outer);
            let groups = outlines(&patch)?;
            if groups.is_empty() {
                lost.push(own);
            }
            parts.extend(groups.into_iter().map(|loops| Part {
                item,
                patch: patch.clone(),
                loops,
            }));
        }
        Some(())
    }

    /// Writes a shell.
    fn shell(&mut self, closed: &Closed<'_>) -> usize {
        let Closed { parts, shell, .. } = closed;
        let mut record = Record::new(502);
        record.integer(shell.vertices.len());
        shell.vertices.iter().for_each(|&point| record.point(point));
        let vertices = self.list(502, 1, record);
        let mut record = Record::new(504);
        record.integer(shell.edges.len());
        for edge in &shell.edges {
            record.integer(geometry::curve(&mut self.deck, &edge.curve));
            for end in edge.ends {
                record.integers([vertices, end + 1]);
            }
        }
        let edges = self.list(504, 1, record);
        let mut members = Record::new(514);
        members.integer(parts.len());
        for ((part, loops), &looks_along) in parts.iter().zip(&shell.faces).zip(&closed.looks_along)
        {
            let surface = geometry::surface(&part.patch.surface);
            let surface = self.list(128, 0, surface);
            let mut record = Record::new(510);
            record.integers([surface, loops.len(), 1]);
            for stretches in loops {
                record.integer(self.outline(stretches, vertices, edges));
            }
            let face = self.list(510, 1, record);
            let color = self.item_color(&part.item);
            self.finish(&[face], color, Status::Dependent, &part.patch.name);
            members.integers([face, usize::from(looks_along)]);
        }
        let pointer = self.list(514, 1, members);
        self.name(pointer, closed.name);
        pointer
    }

    /// A loop (type 508).
    fn outline(&mut self, stretches: &[Stretch], vertices: usize, edges: usize) -> usize {
        let mut record = Record::new(508);
        record.integer(stretches.len());
        for Stretch { flat, along } in stretches {
            match *along {
                Along::Edge(number, is_reversed) => {
                    record.integers([0, edges, number + 1, usize::from(!is_reversed)]);
                }
                Along::Vertex(number) => record.integers([1, vertices, number + 1, 1]),
            }
            let curve = geometry::flat_curve(&mut self.deck, flat);
            record.integers([1, usize::from(axis_along(flat).is_some()), curve]);
        }
        self.list(508, 1, record)
    }

    /// Adds an entity that is there for another one.
    fn list(&mut self, kind: usize, form: usize, record: Record) -> usize {
        self.deck.add(Entity {
            kind,
            form,
            status: Status::Dependent,
            record,
            ..Entity::default()
        })
    }
}

/// The loops of a patch in groups, each an outer loop and the holes in it, with the face on their left.
fn outlines(patch: &Patch) -> Option<Vec<Vec<TrimLoop>>> {
    if patch.loops.is_empty() {
        let [u, v] = [patch.surface.knots_u(), patch.surface.knots_v()].map(|k| k.domain());
        return Some(vec![vec![TrimLoop::border(&u, &v).ok()?]]);
    }
    let mut groups = geometry::outlines(patch).ok()?;
    for group in &mut groups {
        for (k, trim) in group.iter_mut().enumerate() {
            if (trim.signed_area() < 0.0) == (k == 0) {
                *trim = trim.reversed();
            }
        }
    }
    Some(groups)
}

/// Faces as a closed shell; or why they are none.
fn closed<'a>(name: &'a str, parts: Vec<Part<'a>>, is_void: bool) -> Result<Closed<'a>, String> {
    let faces: Vec<_> = (parts.iter())
        .map(|part| Face {
            surface: &part.patch.surface,
            loops: part.loops.clone(),
        })
        .collect();
    let shell = sew::shell(&faces).map_err(|flaw| match flaw {
        Flaw::Open(1) => "a curve around its faces has no partner".to_owned(),
        Flaw::Open(count) => format!("{count} curves around its faces have no partner"),
        Flaw::Slit => "one of its faces has a slit".to_owned(),
        Flaw::OneSided => "its faces have no common outside".to_owned(),
        Flaw::Geometry(error) => error.to_string(),
    })?;
    let bounds = parts.iter().map(|part| part.patch.surface.hull_bounds());
    let center = bounds
        .reduce(kernel::Aabb::union)
        .map_or(DVec3::ZERO, |b| b.center());
    let mut volumes = vec![0.0; parts.len()];
    let mut all = Integrals::default();
    for (part, &(first, is_turned)) in parts.iter().zip(&shell.turned) {
        let face = Patch {
            loops: part.loops.clone(),
            ..Patch::from(part.patch.surface.clone())
        };
        let integrals = Integrals::of(&face, center);
        all = all.plus(&integrals, if is_turned { -1.0 } else { 1.0 });
        let volume = integrals.volume();
        volumes[first] += if is_turned { -volume } else { volume };
    }
    if all.normal().length() > all.area() * CLOSED {
        return Err("its faces do not close".to_owned());
    }
    let outwards = shell
        .turned
        .iter()
        .map(|&(first, is_turned)| (volumes[first] > 0.0) != is_turned);
    let looks_along = outwards.map(|is_outwards| is_outwards != is_void).collect();
    Ok(Closed {
        name,
        parts,
        looks_along,
        shell,
    })
}
