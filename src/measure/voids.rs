//! Solids of which the file says that shells bound them, and their voids.

use std::collections::HashMap;

use kernel::{Aabb, Child, NodeId, Placement, Scene};

use super::contact::Connected;
use super::{Body, Face, Part};

/// How far the box of a void may be outside of that of its body, as a share of the size.
const OUTSIDE: f64 = 1e-6;

/// Where in a solid of the file a face is.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Place {
    /// The nodes from the root down to the solid.
    solid: Vec<NodeId>,
    /// Which of its shells the face belongs to.
    shell: usize,
    /// Whether that bounds a void.
    is_void: bool,
}

impl Place {
    /// Whether another one is in the same solid, or in a void of it as this one is.
    pub(super) fn is_beside(&self, other: Option<&Self>) -> bool {
        other.is_some_and(|other| (&self.solid, self.is_void) == (&other.solid, other.is_void))
    }

    /// In the innermost solid around a shape; `None` if there is none.
    pub(super) fn of(scene: &Scene, placement: &Placement) -> Option<Self> {
        let path = &placement.path;
        let at = path
            .iter()
            .rposition(|&id| scene.node(id).voids.is_some())?;
        let node = scene.node(path[at]);
        let is_way = |child: &Child| match (child, path.get(at + 1)) {
            (Child::Node(id), Some(next)) => id == next,
            (Child::Item(item), None) => item.shape == placement.shape,
            _ => false,
        };
        let way = node.children.iter().position(is_way)?;
        Some(Self {
            solid: path[..=at].to_vec(),
            shell: way,
            is_void: node.is_void(way),
        })
    }
}

/// The shells of solids of which all faces are `loose` ones: their faces meet at gaps, and the file says that they
/// are closed.
pub(super) fn declared<'a>(all: &[Vec<&'a Face>], loose: &[&'a Face]) -> Vec<Connected<'a>> {
    let mut counts: HashMap<&Place, usize> = HashMap::new();
    for place in all.iter().flatten().filter_map(|face| face.place.as_ref()) {
        *counts.entry(place).or_default() += 1;
    }
    let mut shells: Vec<(&Place, Vec<&Face>)> = Vec::new();
    let mut numbers: HashMap<&Place, usize> = HashMap::new();
    for &face in loose {
        let Some(place) = &face.place else { continue };
        let number = *numbers.entry(place).or_insert(shells.len());
        if number == shells.len() {
            shells.push((place, Vec::new()));
        }
        shells[number].1.push(face);
    }
    let whole = shells
        .into_iter()
        .filter(|(place, faces)| counts[place] == faces.len());
    let shell = |(_, faces)| Connected {
        faces,
        is_closed: true,
        is_declared: true,
    };
    whole.map(shell).collect()
}

/// The bodies, each without its voids: a void belongs to the smallest body of its solid that is
/// around it, and is a body of its own if there is none.
pub(super) fn subtracted(parts: &[Part<'_>]) -> Vec<Body> {
    let is_void = |part: &Part<'_>| part.place.is_some_and(|place| place.is_void);
    let mut bodies: Vec<Option<Body>> = parts.iter().map(|part| part.body.clone()).collect();
    for (k, part) in parts.iter().enumerate().filter(|(_, part)| is_void(part)) {
        let (Some(place), Some(void)) = (part.place, bodies[k].take()) else {
            continue;
        };
        let around = |other: &usize| {
            let outer = &parts[*other];
            let is_same = outer.place.is_some_and(|it| it.solid == place.solid);
            let volume = bodies[*other].as_ref().map_or(0.0, |body| body.volume);
            is_same && !is_void(outer) && volume > void.volume && holds(&outer.bounds, &part.bounds)
        };
        let size = |k: &usize| parts[*k].bounds.diagonal();
        let found = (0..parts.len()).filter(around);
        match found.min_by(|a, b| size(a).total_cmp(&size(b))) {
            Some(at) => bodies[at] = bodies[at].as_ref().map(|body| body.with(&void, -1.0)),
            None => bodies[k] = Some(void),
        }
    }
    bodies.into_iter().flatten().collect()
}

fn holds(outer: &Aabb, inner: &Aabb) -> bool {
    let all = outer.union(*inner);
    all.diagonal() <= outer.diagonal() * (1.0 + OUTSIDE)
}
