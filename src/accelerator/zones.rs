//! Small things in large scenes.
//!
//! A cluster is searched in single precision, relative to its size: what is much smaller than
//! that cannot be told from what is next to it. Where many small cells lie together, they are
//! searched on their own, as a zone.

use std::collections::HashSet;

use glam::DVec3;
use kernel::Aabb;

use super::cells::Parts;
use kernel::BoxTree;

/// Cells below this share of the size of their cluster are small.
const SMALL: f64 = 1.0 / 2048.0;

/// A zone is no larger than this share of the size of what it is in.
const ZONE: f64 = 1.0 / 128.0;

/// Zones have no fewer cells: so many are gone through as fast.
const CELLS: usize = 64;

/// Gaps between a zone and what lies beside it are closed up to this share of its size.
pub(super) const BESIDE: f64 = 1.0 / 128.0;

/// What lies beside a zone is larger than the zone so many times at most: more has no details
/// that fit to it.
const LARGER: f64 = 4096.0;

/// A part of what clusters have in common that is a cluster.
pub(super) struct Zone {
    /// Groups of cells.
    pub(super) groups: Vec<usize>,
    /// The box around the cells, and around what closes gaps between its items.
    pub(super) reach: Aabb,
    pub(super) seams: Seams,
}

/// The items of which the gaps are closed in a cluster.
#[derive(Debug)]
pub(super) struct Seams {
    pub(super) own: Vec<u32>,
    /// Those of other clusters that have gaps to its own.
    pub(super) beside: Vec<u32>,
}

/// The zones of cells of so many items, with the boxes around their groups: none if all are best
/// searched together. The first is around the others.
pub(super) fn zones(parts: &Parts, boxes: &[Aabb], items: usize) -> Vec<Zone> {
    let mut lists: Vec<Vec<usize>> = vec![(0..boxes.len()).collect()];
    let mut next = 0;
    while next < lists.len() {
        let found = within(&lists[next], parts, boxes);
        let taken: HashSet<usize> = found.iter().flatten().copied().collect();
        if !taken.is_empty() {
            lists[next].retain(|k| !taken.contains(k));
        }
        lists.extend(found);
        next += 1;
    }
    if lists.len() == 1 {
        return Vec::new();
    }
    // An item belongs to the zone that has all of it.
    let mut keepers: Vec<Option<usize>> = vec![None; items];
    let mut outlines = vec![Aabb::EMPTY; items];
    for (zone, groups) in lists.iter().enumerate() {
        for &group in groups {
            let item = parts.item(group);
            let keeper = &mut keepers[item];
            *keeper = Some(keeper.map_or(zone, |known| if known == zone { zone } else { 0 }));
            outlines[item] = outlines[item].union(boxes[group]);
        }
    }
    let keeper = |item: u32| keepers[item as usize].unwrap_or(0);
    let mut own: Vec<Vec<u32>> = vec![Vec::new(); lists.len()];
    (0..)
        .zip(&keepers)
        .for_each(|(item, _)| own[keeper(item)].push(item));
    let outlined: Vec<(u32, Aabb)> = (0..).zip(outlines).filter(|o| !o.1.is_empty()).collect();
    let tree = BoxTree::new(&outlined.iter().map(|o| o.1).collect::<Vec<_>>());
    let zone = |(zone, (groups, own)): (usize, (Vec<usize>, Vec<u32>))| {
        let mut reach = around(groups.iter().map(|&k| boxes[k]));
        let mut beside = Vec::new();
        if zone == 0 {
            reach = around(boxes.iter().copied());
        } else if !own.is_empty() {
            let size = reach.diagonal();
            let margin = DVec3::splat(BESIDE * size);
            (reach.min, reach.max) = (reach.min - margin, reach.max + margin);
            tree.near(&reach, |k| {
                let (item, outline) = &outlined[k as usize];
                let is_near = outline.meets(&reach) && outline.diagonal() <= LARGER * size;
                if keeper(*item) != zone && is_near {
                    beside.push(*item);
                }
            });
            beside.sort_unstable();
        }
        Zone {
            groups,
            reach,
            seams: Seams { own, beside },
        }
    };
    let lists = lists.into_iter().zip(own);
    lists.enumerate().map(zone).collect()
}

/// Where many small cells lie together among some groups.
fn within(groups: &[usize], parts: &Parts, boxes: &[Aabb]) -> Vec<Vec<usize>> {
    let size = around(groups.iter().map(|&k| boxes[k])).diagonal();
    // Beyond all numbers nothing is small.
    let is_small = |k: &usize| size.is_finite() && boxes[*k].diagonal() < SMALL * size;
    let small: Vec<usize> = groups.iter().copied().filter(is_small).collect();
    let (mut zones, mut waiting) = (Vec::new(), vec![small]);
    while let Some(mut some) = waiting.pop() {
        if some.iter().map(|&k| parts.groups[k].len()).sum::<usize>() < CELLS {
            continue;
        }
        if around(some.iter().map(|&k| boxes[k])).diagonal() <= ZONE * size {
            zones.push(some);
            continue;
        }
        let middles = Aabb::around(some.iter().map(|&k| boxes[k].center()));
        let axis = middles.size().max_position();
        let place = |k: usize| boxes[k].center()[axis];
        some.sort_by(|&a, &b| place(a).total_cmp(&place(b)));
        let gap = |k: usize| place(some[k]) - place(some[k - 1]);
        let quarter = 0.25 * middles.size()[axis];
        let inner = middles.min[axis] + quarter..middles.max[axis] - quarter;
        let is_inner = |k: &usize| inner.contains(&place(some[*k - 1]).midpoint(place(some[*k])));
        let border = (1..some.len())
            .filter(is_inner)
            .max_by(|&a, &b| gap(a).total_cmp(&gap(b)));
        // Rounding may leave none.
        let rest = some.split_off(border.unwrap_or(some.len() / 2));
        waiting.extend([some, rest]);
    }
    zones
}

fn around(boxes: impl Iterator<Item = Aabb>) -> Aabb {
    boxes.fold(Aabb::EMPTY, Aabb::union)
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};
    use kernel::{Child, Error, FARTHEST, KnotVector, Node, Patch, Ray, Surface};

    use super::super::tests::{all_hits, ball, scene_of};
    use super::super::{Accelerator, Workspace};
    use crate::intersect::{Hit, METHODS};
    use crate::random::Random;

    /// A flat square below everything.
    fn ground(half: f64) -> Patch {
        let knots = || KnotVector::bezier(1, 0.0..1.0).unwrap();
        let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]];
        let points = corners.map(|[x, y]| DVec3::new(x * half, y * half, -2.0));
        Patch::from(Surface::new(knots(), knots(), &points, None).unwrap())
    }

    /// Balls in a row, far from the middle of what is around them.
    fn balls() -> Vec<Patch> {
        let place = |k: u32| DVec3::new(f64::from(k) * 3.0, 40.0, 0.0);
        (0..8).map(|k| ball(1.0, place(k))).collect()
    }

    #[test]
    fn no_scene_is_too_large_to_be_built() {
        let sizes = [
            (1.0, 1e99),
            (1e50, 1e49),
            (1e80, 1e19),
            (1e98, 50.0),
            (1e100, 1e99),
        ];
        for (scale, half) in sizes {
            let mut patches = balls();
            let far = DVec3::splat(1e10_f64.min(half));
            patches.extend([ground(half), ball(half * 1e-11, far)]);
            let mut scene = scene_of(patches);
            let outer = Node {
                parent_from_node: DAffine3::from_scale(DVec3::splat(scale)),
                children: scene.root().map(Child::Node).into_iter().collect(),
                ..Node::default()
            };
            let outer = scene.add_node(outer).unwrap();
            if scale * half > FARTHEST {
                assert_eq!(scene.set_root(outer), Err(Error::TooFar));
                continue;
            }
            scene.set_root(outer).unwrap();
            let accelerator = Accelerator::build(&scene, &METHODS[0]).sealed(None);
            assert!(accelerator.cell_count() > 0, "{scale}");
        }
    }

    #[test]
    fn small_shapes_in_a_large_scene_are_met_as_if_alone() {
        let alone = scene_of(balls());
        let alone = Accelerator::build(&alone, &METHODS[0]);
        for half in [1e3, 1e5, 1e7, 1e12] {
            let mut patches = balls();
            patches.push(ground(half));
            let scene = scene_of(patches);
            let accelerator = Accelerator::build(&scene, &METHODS[0]);
            assert!(half < 1e5 || accelerator.clusters.len() == 2, "{half}");
            assert_eq!(accelerator.cell_count(), alone.cell_count() + 1);
            let mut random = Random(7);
            let mut share = || random.signed();
            let rays: Vec<_> = (0..2000)
                .map(|_| {
                    let target = DVec3::new(10.0 + 12.0 * share(), 40.0 + 2.0 * share(), share());
                    let origin = target + DVec3::new(9.0 * share(), 9.0 * share(), 20.0);
                    Ray {
                        origin,
                        direction: target - origin,
                    }
                })
                .collect();
            let ranges = vec![0.0..f64::INFINITY; rays.len()];
            let (mut workspace, mut hits) = (Workspace::default(), Vec::new());
            accelerator.nearest_many(&rays, &ranges, &mut workspace, &mut hits);
            // Not all the cells for each of them.
            let most = 4 * rays.len() as u64;
            assert!(workspace.cells_examined() < most, "{half}");
            for (ray, hit) in rays.iter().zip(&hits) {
                let all = all_hits(&accelerator, ray);
                let same = |a: &Hit, b: &Hit| {
                    let size = if a.shape < 8 { 10.0 } else { half };
                    a.shape == b.shape
                        && a.point.distance(b.point) < 1e-10 * size
                        && a.tangential == b.tangential
                };
                let on_balls = all_hits(&alone, ray);
                assert_eq!(all.len(), on_balls.len() + 1, "{half} {ray:?}");
                assert!(
                    all.iter().zip(&on_balls).all(|(a, b)| same(a, b)),
                    "{half} {ray:?}"
                );
                assert!(same(&all[0], &hit.unwrap()), "{half} {ray:?}");
            }
        }
    }
}
