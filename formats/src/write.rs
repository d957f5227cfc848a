//! From scene to bytes: one row of [`WRITERS`] per format that stores surfaces as they are.

use std::collections::{HashMap, HashSet};
use std::fmt::Write as _;

use glam::{DAffine3, DMat3, DVec2, DVec3};
use kernel::{Child, Item, MaterialId, Mesh, Node, NodeId, Patch, Scene, Shape, TrimLoop, UpAxis};

use crate::{Error, Import, Level, Place, Warnings, iges, nodes, obj};

/// A format that scenes are written in with their surfaces as they are: one row each.
#[derive(Clone, Copy, Debug)]
pub struct Writer {
    /// Name in messages.
    pub name: &'static str,
    /// File name endings, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// Scene to bytes.
    pub write: Write,
}

/// Scene to bytes; `stem` is the name of the file without its ending, for titles and for
/// files beside it.
///
/// The bytes depend on the scene and the stem alone.
pub type Write = fn(scene: &Scene, stem: &str) -> Result<Export, Error>;

/// What a writer gives: the content of files, and everything that they cannot hold.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Export {
    /// The content of the file.
    pub bytes: Vec<u8>,
    /// Files that it names, to be put beside it: name and content.
    pub beside: Vec<(String, Vec<u8>)>,
    /// What the format cannot hold.
    pub warnings: Warnings,
}

/// All formats that surfaces are written in as they are.
pub const WRITERS: &[Writer] = &[
    iges::WRITER,
    nodes::X3D,
    nodes::CLASSIC,
    nodes::VRML97,
    obj::WRITER,
];

/// How deep nodes may nest in what is written.
pub(crate) const NESTING: usize = 1000;

/// How often the parts of a scene stand in its tree: what stands there once needs no name to be
/// found by.
#[derive(Clone, Debug, Default)]
pub(crate) struct Uses {
    pub(crate) nodes: HashMap<NodeId, usize>,
    pub(crate) shapes: HashMap<Shape, usize>,
    pub(crate) materials: HashMap<MaterialId, usize>,
}

impl Uses {
    /// Counts them.
    pub(crate) fn of(scene: &Scene) -> Self {
        let mut uses = Self::default();
        for child in scene.nodes().iter().flat_map(|node| &node.children) {
            match child {
                Child::Node(id) => *uses.nodes.entry(*id).or_default() += 1,
                Child::Item(item) => {
                    *uses.shapes.entry(item.shape).or_default() += 1;
                    if let Some(id) = scene.item_material(item) {
                        *uses.materials.entry(id).or_default() += 1;
                    }
                }
            }
        }
        for wire in scene.nodes().iter().flat_map(|node| &node.wires) {
            if let Some(id) = scene.wire(*wire).material {
                *uses.materials.entry(id).or_default() += 1;
            }
        }
        uses
    }
}

impl Import {
    /// Notes what was read beside the scene, and is in no file that the scene is written to.
    pub fn tell_unwritten(&self, warnings: &mut Warnings) {
        if self.animation.is_some() {
            let text = "what moves is written as it stands at first";
            warnings.unsupported(Place::default(), text);
        }
        for Level { number, name, .. } in &self.levels {
            let place = Place::item(0, format!("level {number} \"{name}\""));
            warnings.unsupported(place, "levels are not written");
        }
    }
}

/// Notes the solids of which some shells bound voids.
pub(crate) fn tell_voids(scene: &Scene, warnings: &mut Warnings) {
    let has_voids = |node: &&Node| node.voids.is_some_and(|count| count > 0);
    for node in scene.nodes().iter().filter(has_voids) {
        let place = Place::item(0, format!("node \"{}\"", node.name));
        let text = "that shells bound voids of a solid is not written; they are shells like others";
        warnings.unsupported(place, text);
    }
}

/// Notes where the file says that patches meet.
pub(crate) fn tell_seams(scene: &Scene, warnings: &mut Warnings) {
    if !scene.seams().is_empty() {
        let place = Place::item(0, format!("{} connections", scene.seams().len()));
        warnings.unsupported(place, "that surfaces meet along curves is not written");
    }
}

/// The loops of a patch in the domain where the surface is not closed, without those that bound nothing.
///
/// # Errors
/// If a number is not finite.
pub(crate) fn bounding_loops(patch: &Patch) -> Result<Vec<TrimLoop>, kernel::Error> {
    let closed = patch.surface.closed();
    let knots = [patch.surface.knots_u(), patch.surface.knots_v()];
    let mut loops = patch.loops.clone();
    for axis in (0..2).filter(|&axis| !closed[axis]) {
        let clipped = loops.iter().map(|l| l.clipped(axis, knots[axis].domain()));
        let clipped: Vec<_> = clipped.collect::<Result<_, _>>()?;
        loops = clipped.into_iter().flatten().collect();
    }
    loops.retain(TrimLoop::has_inside);
    // Of the whole domain and a hole that is all of it nothing is left.
    let boxes: Vec<_> = loops.iter().map(rectangle).collect();
    let is_same = |a: [DVec2; 2], b: [DVec2; 2]| {
        let near = SAME * (a[1] - a[0]);
        (0..2).all(|k| (a[k] - b[k]).abs().cmple(near).all())
    };
    let is_gone = |own: [DVec2; 2]| {
        let twins = boxes.iter().flatten().filter(|other| is_same(own, **other));
        twins.count() % 2 == 0
    };
    let pairs = loops.into_iter().zip(&boxes);
    let kept = pairs.filter(|(_, own)| !own.is_some_and(is_gone));
    Ok(kept.map(|(one, _)| one).collect())
}

/// Rectangles that differ by no more than this share of their size are one.
const SAME: f64 = 1e-9;

/// The corners of a loop that is a rectangle along both axes.
fn rectangle(trim: &TrimLoop) -> Option<[DVec2; 2]> {
    let (min, max) = trim.hull();
    let area = (max - min).element_product();
    let is_all = (trim.signed_area().abs() - area).abs() <= SAME * area;
    is_all.then_some([min, max])
}

/// Notes a patch of which its loops leave nothing.
pub(crate) fn tell_lost(patch: &Patch, warnings: &mut Warnings) {
    let place = Place::item(0, format!("\"{}\", {}", patch.name, patch.source));
    let text = "its loops leave nothing of the surface; it is left out";
    warnings.unsupported(place, text);
}

/// The patches of which their loops leave nothing; they are told.
pub(crate) fn lost_patches(scene: &Scene, warnings: &mut Warnings) -> HashSet<Shape> {
    let children = scene.nodes().iter().flat_map(|node| &node.children);
    let (mut seen, mut lost) = (HashSet::new(), HashSet::new());
    for child in children {
        let Child::Item(Item { shape, .. }) = child else {
            continue;
        };
        let Shape::Patch(id) = shape else { continue };
        let patch = scene.patch(*id);
        let is_lost = || bounding_loops(patch).is_ok_and(|loops| loops.is_empty());
        if !patch.loops.is_empty() && seen.insert(*shape) && is_lost() {
            tell_lost(patch, warnings);
            lost.insert(*shape);
        }
    }
    lost
}

/// Notes the meshes with colours of vertices that let something through.
pub(crate) fn tell_clear_vertices(scene: &Scene, warnings: &mut Warnings) {
    let is_clear = |mesh: &&Mesh| mesh.colors().iter().any(|color| color.w < 1.0);
    for mesh in scene.meshes().iter().filter(is_clear) {
        let place = Place::item(0, format!("\"{}\", {}", mesh.name, mesh.source));
        let text = "the opacity of colours of vertices is not written";
        warnings.unsupported(place, text);
    }
}

/// The turn that brings the upward axis `from` to the upward axis `to`; all its numbers are
/// 0, 1 or -1.
pub(crate) fn turn(from: UpAxis, to: UpAxis) -> DMat3 {
    match (from, to) {
        (UpAxis::Y, UpAxis::Z) => DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
        (UpAxis::Z, UpAxis::Y) => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        _ => DMat3::IDENTITY,
    }
}

/// Names of which no two are the same.
#[derive(Clone, Debug, Default)]
pub(crate) struct Distinct {
    /// Those that are taken, each with the last number that was put to it.
    taken: HashMap<String, usize>,
}

impl Distinct {
    /// This name, or where it is taken the first free one with a number to it.
    pub(crate) fn name(&mut self, wanted: &str) -> String {
        let mut name = wanted.to_owned();
        if let Some(&last) = self.taken.get(wanted) {
            let numbers = last + 1..;
            let mut free = numbers.map(|number| (number, format!("{wanted}_{number}")));
            let free = free.find(|(_, name)| !self.taken.contains_key(name));
            if let Some((number, found)) = free {
                self.taken.insert(wanted.to_owned(), number);
                name = found;
            }
        }
        self.taken.insert(name.clone(), 1);
        name
    }
}

/// The outermost node that does more than hold one other node, or that counts as one that does, and its
/// place if `world` takes the scene to the coordinates of the file.
///
/// A scene that has been turned for one format and is turned back for another has no trace of
/// that.
pub(crate) fn outermost(
    scene: &Scene,
    world: DMat3,
    counts: impl Fn(NodeId) -> bool,
) -> Option<(&Node, NodeId, DAffine3)> {
    let mut id = scene.root()?;
    let mut place = DAffine3::from_mat3(world) * scene.node(id).parent_from_node;
    loop {
        let node = scene.node(id);
        let is_wrapper = node.name.is_empty() && node.wires.is_empty() && !counts(id);
        match node.children[..] {
            [Child::Node(only)] if is_wrapper => id = only,
            _ => return Some((node, id, place)),
        }
        place *= scene.node(id).parent_from_node;
    }
}

/// Whether weights say anything: they do if one of them is not one.
pub(crate) fn has_weights(mut weights: impl Iterator<Item = f64>) -> bool {
    weights.any(|weight| (weight - 1.0).abs() > 0.0)
}

/// Appends a number, with as many digits as it takes to read the same one again.
pub(crate) fn push_number(text: &mut String, value: f64) {
    let start = text.len();
    // Writing into a string cannot fail.
    let _ = write!(text, "{value:?}");
    if text[start..].ends_with(".0") {
        text.truncate(text.len() - 2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_distinct_also_from_those_with_numbers() {
        let mut distinct = Distinct::default();
        let wanted = ["a", "a_2", "a", "a", "b", "a_2", "a_3"];
        let names = wanted.map(|name| distinct.name(name));
        assert_eq!(names, ["a", "a_2", "a_3", "a_4", "b", "a_2_2", "a_3_2"]);
    }
}
