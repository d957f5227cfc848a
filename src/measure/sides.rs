//! Which side of each face is outside, if the faces are closed.

use std::iter;

use glam::DVec2;
use kernel::{Aabb, Ray};

use super::Face;
use crate::{Accelerator, Workspace};

/// Points of each face that are asked.
const POINTS: usize = 5;

/// How many points are tried to find them, over the domain and then over each of the boxes in which loops
/// are: a face may be a small part of its surface.
const TRIES: usize = 4096;

/// Share of the rays that must agree that the faces are closed: the others may have slipped
/// through gaps between faces.
const AGREE: f64 = 0.9;

/// Hits so near to where a ray begins, as a share of the size of the body, are that place.
const HERE: f64 = 1e-7;

/// How far rays lean away from the normal along u and v: those along normals hit corners and
/// edges of symmetric bodies.
const LEAN: [f64; 2] = [0.137, 0.071];

/// For each face 1 if its normal points outwards, -1 if inwards; nothing if the faces are not
/// closed.
pub(super) fn outsides(
    accelerator: &Accelerator<'_>,
    faces: &[&Face],
    bounds: &Aabb,
    workspace: &mut Workspace,
) -> Option<Vec<f64>> {
    let mut numbers: Vec<u32> = faces.iter().map(|face| face.number).collect();
    numbers.sort_unstable();
    let (mut votes, mut hits) = (Vec::new(), Vec::new());
    let (mut asked, mut agreed) = (0, 0);
    for face in faces {
        let (mut own, mut twin) = (0_i32, None);
        for uv in points(face) {
            let surface = &face.patch.surface;
            let (point, Some(normal)) = surface.point_and_regular_normal(uv) else {
                continue;
            };
            let (_, [du, dv]) = surface.tangents(uv);
            let lean = du.normalize_or_zero() * LEAN[0] + dv.normalize_or_zero() * LEAN[1];
            let ray = Ray {
                origin: point,
                direction: normal + lean,
            };
            let range = f64::NEG_INFINITY..f64::INFINITY;
            accelerator.all(&ray, range, workspace, &mut hits);
            let here = bounds.diagonal() * HERE;
            let ours = || {
                let ours = hits.iter();
                ours.filter(|hit| numbers.binary_search(&hit.shape).is_ok())
            };
            let other = ours().find(|hit| hit.t.abs() <= here && hit.shape != face.number);
            if let Some(hit) = other {
                twin = twin.or_else(|| {
                    let there = faces.iter().position(|face| face.number == hit.shape)?;
                    Some((there, hit.normal.dot(normal) > 0.0))
                });
                continue;
            }
            let before = ours().filter(|hit| hit.t > here).count();
            let behind = ours().filter(|hit| hit.t < -here).count();
            asked += 1;
            if (before + behind) % 2 == 1 {
                agreed += 1;
                own += if before % 2 == 0 { 1 } else { -1 };
            }
        }
        votes.push((own, twin));
    }
    let sign = |votes: i32| if votes < 0 { -1.0 } else { 1.0 };
    let sides = votes
        .iter()
        .enumerate()
        .map(|(k, &(own, twin))| match twin {
            // Of two faces with nothing between them one looks to each side.
            Some((other, is_along)) if own == 0 && (votes[other].0 != 0 || other < k) => {
                let along = sign(votes[other].0);
                if is_along { -along } else { along }
            }
            _ => sign(own),
        });
    let sides = sides.collect();
    let is_closed = asked > 0 && f64::from(agreed) >= AGREE * f64::from(asked);
    is_closed.then_some(sides)
}

/// Steps that spread points evenly, and never onto the even shares where surfaces have folds:
/// powers of the root of `x^3 = x + 1` (Roberts's sequence).
const STEPS: DVec2 = DVec2::new(0.754_877_666_246_692_7, 0.569_840_290_998_053_2);

/// Points inside a face, spread over it.
fn points(face: &Face) -> Vec<DVec2> {
    let surface = &face.patch.surface;
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let region = face.patch.region();
    let whole = [DVec2::new(u.start, v.start), DVec2::new(u.end, v.end)];
    let spread = |[from, to]: [DVec2; 2]| {
        let place = move |k: usize| from + (STEPS * k as f64).fract() * (to - from);
        (1..=TRIES).map(place)
    };
    let boxes = iter::once_with(|| face.patch.loop_boxes()).flatten();
    let inside = |uv: &DVec2| region.as_ref().is_none_or(|region| region.contains(*uv));
    let tried = spread(whole).chain(boxes.flat_map(spread));
    tried.filter(inside).take(POINTS).collect()
}
