//! Which loops lie inside which: outer boundaries with their holes, as most formats want them.

use glam::DVec2;

use super::{TrimLoop, TrimRegion};
use crate::Curve;

/// An outer loop and the holes right inside it, by their places in a list of loops.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Nest {
    /// The loop inside an even number of others.
    pub outer: usize,
    /// The loops inside it and no other hole.
    pub holes: Vec<usize>,
}

/// Sorts loops into outer ones and holes, in their order.
///
/// What lies inside an odd number of loops lies inside one outer loop and none of its holes.
/// Where a surface is closed, with [`Surface::periods`](crate::Surface::periods) that are not zero, loops may
/// be whole periods apart.
/// Loops are taken not to cross each other; of loops that do, or that share sides, the one with less
/// area counts as inside the other if most of its curves are.
pub fn nesting(loops: &[TrimLoop], periods: DVec2) -> Vec<Nest> {
    let hulls: Vec<_> = loops.iter().map(TrimLoop::hull).collect();
    let probes: Vec<_> = loops.iter().map(probes).collect();
    let areas: Vec<_> = loops.iter().map(|l| l.signed_area().abs()).collect();
    // No two hold each other.
    let is_larger = |a: usize, b: usize| areas[a].total_cmp(&areas[b]).then(b.cmp(&a)).is_gt();
    let mut around = vec![Vec::new(); loops.len()];
    let along = |period: f64| {
        if period > 0.0 {
            vec![0.0, -period, period]
        } else {
            vec![0.0]
        }
    };
    let (along_u, along_v) = (along(periods.x), along(periods.y));
    let shifts = along_u
        .iter()
        .flat_map(|&u| along_v.iter().map(move |&v| DVec2::new(u, v)));
    let shifts: Vec<_> = shifts.collect();
    for (index, outer) in loops.iter().enumerate() {
        let (min, max) = hulls[index];
        let meets = |&k: &usize| {
            let (low, high) = hulls[k];
            let meets =
                |shift: &DVec2| (low + shift).cmple(max).all() && (high + shift).cmpge(min).all();
            is_larger(index, k) && shifts.iter().any(meets)
        };
        let near: Vec<_> = (0..loops.len()).filter(meets).collect();
        if near.is_empty() {
            continue;
        }
        let region = TrimRegion::new(std::slice::from_ref(outer), min.x..max.x, min.y..max.y);
        for k in near {
            // What lies on the border of a period lies in the next one.
            let least = DVec2::select(periods.cmpgt(DVec2::ZERO), min, min.map(f64::next_up));
            let is_in = |p: DVec2| p.cmpge(least).all() && p.cmplt(max).all() && region.contains(p);
            let is_inside = |p: &&DVec2| shifts.iter().any(|shift| is_in(**p + shift));
            if 2 * probes[k].iter().filter(is_inside).count() > probes[k].len() {
                around[k].push(index);
            }
        }
    }
    let mut nests: Vec<_> = (0..loops.len())
        .filter(|&k| around[k].len() % 2 == 0)
        .map(|outer| Nest {
            outer,
            holes: Vec::new(),
        })
        .collect();
    for hole in (0..loops.len()).filter(|&k| around[k].len() % 2 == 1) {
        // The outer loop right around a hole is the one that lies inside all others around it.
        let depth = |nest: &&mut Nest| around[nest.outer].len();
        let candidates = nests.iter_mut().filter(|n| around[hole].contains(&n.outer));
        if let Some(nest) = candidates.max_by_key(depth) {
            nest.holes.push(hole);
        }
    }
    nests
}

/// The loops with outer ones counter-clockwise and holes clockwise, in their order.
pub fn oriented(loops: &[TrimLoop], periods: DVec2) -> Vec<TrimLoop> {
    let mut is_hole = vec![false; loops.len()];
    for hole in nesting(loops, periods)
        .into_iter()
        .flat_map(|nest| nest.holes)
    {
        is_hole[hole] = true;
    }
    let turned = |(trim, &is_hole): (&TrimLoop, &bool)| {
        if (trim.signed_area() < 0.0) == is_hole {
            trim.clone()
        } else {
            trim.reversed()
        }
    };
    loops.iter().zip(&is_hole).map(turned).collect()
}

/// How far beside a loop is inside or outside, as a share of a size.
const ASIDE: f64 = 1e-6;

/// A point of a curve, and the way from there to what is beside it on its left.
pub(crate) fn aside(curve: &Curve<DVec2>, t: f64, size: DVec2) -> (DVec2, DVec2) {
    let at = curve.derivatives(t);
    let left = (at.first / size).perp().normalize_or_zero() * ASIDE;
    (at.point, left * size)
}

/// A point beside the middle of every span of a loop, inside of it: loops may share sides.
fn probes(trim: &TrimLoop) -> Vec<DVec2> {
    let (min, max) = trim.hull();
    let size = (max - min).max(DVec2::splat(f64::MIN_POSITIVE));
    let side = trim.signed_area().signum();
    let beside = |curve: &Curve<DVec2>, t: f64| {
        let (point, left) = aside(curve, t, size);
        point + left * side
    };
    let mut probes = Vec::new();
    for curve in trim.segments() {
        let breaks = curve.knots().breaks();
        let middles = breaks.windows(2).map(|span| span[0].midpoint(span[1]));
        probes.extend(middles.map(|t| beside(curve, t)));
    }
    probes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(center: [f64; 2], half: f64) -> TrimLoop {
        let center = DVec2::from(center);
        let (min, max) = (center - half, center + half);
        TrimLoop::border(&(min.x..max.x), &(min.y..max.y)).unwrap()
    }

    #[test]
    fn islands_in_holes_are_outer_loops() {
        let loops = [
            square([0.5, 0.5], 0.1),
            square([0.5, 0.5], 0.2),
            square([0.5, 0.5], 0.5),
            square([0.8, 0.8], 0.05),
            square([3.0, 0.5], 0.3),
        ];
        let nest = |outer, holes: &[usize]| Nest {
            outer,
            holes: holes.to_vec(),
        };
        let expected = [nest(0, &[]), nest(2, &[1, 3]), nest(4, &[])];
        assert_eq!(nesting(&loops, DVec2::ZERO), expected);
    }

    #[test]
    fn loops_may_be_periods_apart() {
        let whole = TrimLoop::border(&(0.0..1.0), &(0.0..1.0)).unwrap();
        let [across, beyond] = [[1.0, 0.5], [1.5, -0.5]].map(|center| square(center, 0.1));
        let nest = Nest {
            outer: 0,
            holes: vec![1, 2],
        };
        let loops = [whole, across, beyond];
        assert_eq!(nesting(&loops, DVec2::ONE), [nest]);
        assert_eq!(nesting(&loops, DVec2::ZERO).len(), 3);
    }

    #[test]
    fn loops_that_share_a_side_do_not_hold_each_other() {
        let loops = [square([0.0, 0.0], 1.0), square([2.0, 0.0], 1.0)];
        assert_eq!(nesting(&loops, DVec2::ZERO).len(), 2);
        assert_eq!(nesting(&[], DVec2::ZERO), []);
    }

    #[test]
    fn loops_that_share_sides_may_hold_each_other() {
        // A band around a cylinder, from its lower border to the upper circle less the lower one.
        let bands = [-0.05..0.0, -0.05..50.0].map(|v| TrimLoop::border(&(0.0..1.0), &v).unwrap());
        let nest = Nest {
            outer: 1,
            holes: vec![0],
        };
        assert_eq!(nesting(&bands, DVec2::ZERO), [nest]);
        let areas = oriented(&bands, DVec2::ZERO)
            .iter()
            .map(TrimLoop::signed_area)
            .sum::<f64>();
        assert!((areas - 50.0).abs() < 1e-12, "{areas}");
    }

    #[test]
    fn most_of_a_loop_may_be_a_hole() {
        // The middles of three of four sides of each are inside the other.
        let [hole, face] = [0.6, 1.0].map(|v| TrimLoop::border(&(0.0..1.0), &(0.0..v)).unwrap());
        let nest = Nest {
            outer: 0,
            holes: vec![1],
        };
        assert_eq!(nesting(&[face, hole], DVec2::ZERO), [nest]);
    }
}
