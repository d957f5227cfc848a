//! What is thinner than the tolerance would vanish: it becomes a line or a point of space in sewing.

use std::collections::HashSet;

use glam::DVec2;
use kernel::Sets;

use super::pieces::Rect;
use super::rim::Face;
use super::sew::Edge;
use super::shell::Part;

/// What has as many triangles is not made finer for that.
const SMALL: usize = 2000;

/// What is no wider than this share of its length is a line.
const FLAT: f64 = 1e-6;

/// The faces, in their order, of what hangs together and has vanished or, where it has few triangles, lost
/// a part.
pub(super) fn gone(parts: &[Part<'_>], faces: &[Face<'_>], edges: &[Edge]) -> Vec<usize> {
    let count = |k: usize| parts[k].mesh.triangles.len();
    let lost = vanished(parts, faces);
    if lost.is_empty() && (0..parts.len()).all(|k| count(k) > 0) {
        return Vec::new();
    }
    let is_extended = |k: &usize| {
        let Rect { min, max } = faces[*k].pieces.domain();
        has_area(&faces[*k], [min, DVec2::new(max.x, min.y), max])
    };
    let mut together = Sets::new(faces.len());
    for edge in edges {
        for used in &edge.uses[1..] {
            together.join(edge.uses[0].face, used.face);
        }
    }
    let mut gone = together.members();
    gone.retain(|own| match own.iter().map(|&k| count(k)).sum() {
        0 => own.iter().any(is_extended),
        triangles => triangles < SMALL && own.iter().any(|k| lost.contains(k)),
    });
    let mut gone = gone.concat();
    gone.sort_unstable();
    gone
}

/// The faces of which a part is next to no triangle: it became a line or a point of space, which is no
/// side and no corner of any. Those that are no more than that themselves are not among them.
fn vanished(parts: &[Part<'_>], faces: &[Face<'_>]) -> HashSet<usize> {
    let mut lost = HashSet::new();
    if parts.iter().all(|part| part.mesh.folded.is_empty()) {
        return lost;
    }
    // Points of what is folded; whether they are corners, and what are sides between them.
    let count = parts.iter().flat_map(|part| &part.points).max();
    let mut wanted = vec![false; count.map_or(0, |&most| most as usize + 1)];
    let mut corners = wanted.clone();
    for part in parts {
        for &k in part.mesh.folded.as_flattened() {
            wanted[part.points[k as usize] as usize] = true;
        }
    }
    let mut sides = HashSet::new();
    let side = |a: u32, b: u32| [a.min(b), a.max(b)];
    for [a, b, c] in parts.iter().flat_map(Part::triangles) {
        for (a, b) in [(a, b), (b, c), (c, a)] {
            corners[a as usize] = true;
            if wanted[a as usize] && wanted[b as usize] {
                sides.insert(side(a, b));
            }
        }
    }
    for (k, (part, face)) in parts.iter().zip(faces).enumerate() {
        let is_lost = |folded: &[u32; 3]| {
            let [a, b, c] = folded.map(|k| part.points[k as usize]);
            let (from, to) = if a == b { (a, c) } else { (a, b) };
            let is_known = if from == to {
                corners[from as usize]
            } else {
                sides.contains(&side(from, to))
            };
            !is_known && has_area(face, folded.map(|k| part.mesh.vertices[k as usize].uv))
        };
        if part.mesh.folded.iter().any(is_lost) {
            lost.insert(k);
        }
    }
    lost
}

/// Whether the part of a face over a triangle of parameters is more than a line, as its derivatives in the
/// middle tell.
fn has_area(face: &Face<'_>, [a, b, c]: [DVec2; 3]) -> bool {
    let d = face.pieces.surface.derivatives((a + b + c) / 3.0);
    let [along, across] = [b - a, c - a].map(|way| d.du * way.x + d.dv * way.y);
    let longest = along.length_squared().max(across.length_squared());
    along.cross(across).length() > FLAT * longest
}
