//! Bodies of which borders do not tell: they touch others, or their faces meet at wide gaps. Their
//! triangles tell, since these are sewn in pairs and as far as a tolerance.

use std::collections::HashMap;

use kernel::{PatchId, Placement, Scene, Shape};

use super::Face;
use super::contact::Connected;
use crate::{TessellateOptions, tessellate};

/// Points of all faces together at most, and more for each face: one that takes many more is no part of a body
/// that its triangles close.
const POINTS: [usize; 2] = [100_000, 2_000];

/// The faces of each closed shell of triangles, at each of its places, of those that are not in a body.
pub(super) fn closed<'a>(
    scene: &Scene,
    placements: &[Placement],
    open: &[&'a Face],
) -> Vec<Connected<'a>> {
    let mut places: HashMap<PatchId, Vec<&'a Face>> = HashMap::new();
    for &face in open {
        if let Shape::Patch(id) = placements[face.placement].shape {
            places.entry(id).or_default().push(face);
        }
    }
    let mut result = Vec::new();
    // Too many points tell nothing.
    let defaults = TessellateOptions::default();
    let most_points = POINTS[0] + POINTS[1] * scene.patches().len();
    let options = TessellateOptions {
        most_points: most_points.min(defaults.most_points),
        ..defaults
    };
    let shells = tessellate(scene, &options).map(|t| t.shells);
    let shells = shells.unwrap_or_default();
    for shell in shells.iter().filter(|shell| shell.is_closed()) {
        // Those of a shell stand at the same places, in the same order.
        let lists = shell.patches.iter().map(|id| places.get(id));
        let Some(lists) = lists.collect::<Option<Vec<_>>>() else {
            continue;
        };
        let count = lists[0].len();
        if lists.iter().any(|list| list.len() != count) {
            continue;
        }
        result.extend((0..count).map(|place| Connected {
            faces: lists.iter().map(|list| list[place]).collect(),
            is_closed: true,
            is_declared: false,
        }));
    }
    result
}
