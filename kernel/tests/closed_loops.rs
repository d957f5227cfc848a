//! Loops on closed surfaces: which part of a sphere, cylinder or torus they bound.
#![allow(clippy::unwrap_used, reason = "helpers of tests are tests, too")]

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3};
use nurbray_kernel::modelling::{self, Frame};
use nurbray_kernel::{
    ClosedLoops, Curve, Error, KnotVector, Orientation, Patch, Surface, TrimLoop, TrimRegion,
    close_loops, nearest,
};

fn sphere() -> Surface {
    modelling::sphere(&Frame::WORLD, 1.0, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2).unwrap()
}

fn torus() -> Surface {
    modelling::torus(&Frame::WORLD, 3.0, 1.0, 0.0..TAU, 0.0..TAU).unwrap()
}

fn cylinder() -> Surface {
    modelling::cylinder(&Frame::WORLD, 1.0, 0.0..TAU, 0.0..4.0).unwrap()
}

fn path(points: &[[f64; 2]]) -> Vec<Curve<DVec2>> {
    let line = |w: &[[f64; 2]]| Curve::line(w[0].into(), w[1].into(), 0.0..1.0).unwrap();
    points.windows(2).map(line).collect()
}

fn close(
    surface: &Surface,
    chains: &[Vec<Curve<DVec2>>],
    orientation: Orientation,
) -> Result<ClosedLoops, Error> {
    let closed = nearest::closed(surface);
    close_loops(surface, closed, chains.to_vec(), 1e-6, orientation)
}

/// The region that chains bound, as a renderer asks for it.
fn region(surface: &Surface, chains: &[Vec<Curve<DVec2>>]) -> TrimRegion {
    let loops = close(surface, chains, Orientation::Left).unwrap().loops;
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    for point in loops
        .iter()
        .flat_map(|l| l.segments())
        .flat_map(Curve::points)
    {
        assert!(
            u.start - 1e-8 <= point.x && point.x <= u.end + 1e-8,
            "{point}"
        );
        assert!(
            v.start - 1e-8 <= point.y && point.y <= v.end + 1e-8,
            "{point}"
        );
    }
    TrimRegion::of(&Patch {
        loops,
        ..Patch::from(surface.clone())
    })
}

fn contains(region: &TrimRegion, u: f64, v: f64) -> bool {
    region.contains(DVec2::new(u, v))
}

#[test]
fn a_circle_of_latitude_bounds_the_cap_to_its_left() {
    let sphere = sphere();
    for start in [0.0, 1.0, TAU, -5.0] {
        let north = region(
            &sphere,
            &[path(&[
                [start, 0.5],
                [start + 3.0, 0.5],
                [start + TAU, 0.5],
            ])],
        );
        let south = region(&sphere, &[path(&[[start + TAU, 0.5], [start, 0.5]])]);
        for k in 0..60 {
            let u = f64::from(k) * 0.1 + 0.05;
            for (v, is_north) in [(0.6, true), (1.5, true), (0.4, false), (-1.5, false)] {
                assert_eq!(contains(&north, u, v), is_north, "{start} {u} {v}");
                assert_eq!(contains(&south, u, v), !is_north, "{start} {u} {v}");
            }
        }
    }
}

#[test]
fn bands_between_rings_and_beyond_them_are_single_loops() {
    let ring = |start: f64, turn: f64, v: f64| path(&[[start, v], [start + turn, v]]);
    let areas = |surface: &Surface, chains: &[Vec<Curve<DVec2>>]| {
        let loops = close(surface, chains, Orientation::Left).unwrap().loops;
        let areas = loops.iter().map(|l| l.signed_area().abs());
        areas.collect::<Vec<_>>()
    };
    let assert_areas = |found: Vec<f64>, expected: &[f64]| {
        assert_eq!(found.len(), expected.len(), "{found:?}");
        let pairs = found.iter().zip(expected);
        assert!(
            pairs.clone().all(|(a, b)| (a - b).abs() < 1e-9),
            "{found:?}"
        );
    };
    // Begun at the seam or elsewhere, and in either direction.
    for [a, b] in [[0.0, 0.0], [1.0, 5.0], [-TAU, 7.0], [TAU, 3.0]] {
        for turn in [TAU, -TAU] {
            let rings = [ring(a, TAU, 1.0), ring(b, turn, 3.0)];
            assert_areas(areas(&cylinder(), &rings), &[2.0 * TAU]);
        }
        let rings = [ring(a, TAU, 1.0), ring(b, -TAU, 2.0), ring(a, TAU, 2.5)];
        assert_areas(areas(&cylinder(), &rings), &[TAU, 1.5 * TAU]);
        let south = [ring(a, -TAU, 0.5)];
        assert_areas(areas(&sphere(), &south), &[TAU * (FRAC_PI_2 + 0.5)]);
        let north = [ring(b, TAU, 0.5)];
        assert_areas(areas(&sphere(), &north), &[TAU * (FRAC_PI_2 - 0.5)]);
        let parts = [ring(a, TAU, 1.0), ring(b, -TAU, 3.0)];
        assert_areas(areas(&torus(), &parts), &[2.0 * TAU]);
        let parts = [ring(a, -TAU, 1.0), ring(b, TAU, 3.0)];
        assert_areas(areas(&torus(), &parts), &[TAU, TAU * (TAU - 3.0)]);
    }
}

#[test]
fn a_small_loop_on_a_sphere_bounds_its_inside_or_all_else() {
    let sphere = sphere();
    let square = [[1.0, 0.0], [2.0, 0.0], [2.0, 0.5], [1.0, 0.5], [1.0, 0.0]];
    let mut turned = square;
    turned.reverse();
    let (inside, outside) = (
        region(&sphere, &[path(&square)]),
        region(&sphere, &[path(&turned)]),
    );
    for (u, v, is_in) in [(1.5, 0.2, true), (0.5, 0.2, false), (4.0, -1.5, false)] {
        assert_eq!(contains(&inside, u, v), is_in);
        assert_eq!(contains(&outside, u, v), !is_in);
    }
    // Without a promise about the direction, it is the inside.
    let loops = close(&sphere, &[path(&turned)], Orientation::Unknown)
        .unwrap()
        .loops;
    assert_eq!(loops.len(), 1);
}

#[test]
fn a_lune_without_its_edge_at_the_pole_is_what_its_parameters_say() {
    let sphere = sphere();
    // Half a turn that is rounded up, and more than that.
    for turn in [PI + 4e-10, 4.0] {
        let points = [[0.0, 0.0], [0.0, FRAC_PI_2]];
        let back = [[turn, FRAC_PI_2], [turn, 0.0], [0.0, 0.0]];
        let chain = [path(&points), path(&back)].concat();
        let loops = close(&sphere, &[chain], Orientation::Literal).unwrap();
        assert_eq!(loops.loops.len(), 1);
        let region = TrimRegion::of(&Patch {
            loops: loops.loops,
            ..Patch::from(sphere.clone())
        });
        for (u, v, is_in) in [
            (0.1, 1.5, true),
            (3.0, 0.1, true),
            (3.0, -0.1, false),
            (turn + 0.1, 1.5, false),
        ] {
            assert_eq!(contains(&region, u, v), is_in, "{u} {v}");
        }
    }
}

#[test]
fn a_lune_across_the_seam_is_what_its_parameters_say_either_way_round() {
    let sphere = sphere();
    for (start, turn) in [(4.0, 4.0), (-3.0, 4.0), (2.0, 5.0), (8.0, 2.0), (4.0, 3.0)] {
        let end = start + turn;
        let corners = [
            [[start, 0.0], [start, FRAC_PI_2]],
            [[end, FRAC_PI_2], [end, 0.0]],
            [[end, 0.0], [start, 0.0]],
        ];
        for first in 0..3 {
            for is_turned in [false, true] {
                let mut sides = corners;
                if is_turned {
                    sides.reverse();
                    sides.iter_mut().for_each(|side| side.reverse());
                }
                sides.rotate_left(first);
                let chain = sides.map(|side| path(&side)).concat();
                let loops = close(&sphere, &[chain], Orientation::Literal).unwrap();
                let region = TrimRegion::of(&Patch {
                    loops: loops.loops,
                    ..Patch::from(sphere.clone())
                });
                for (along, v, is_in) in [
                    (0.01, 1.5, true),
                    (0.3, 0.1, true),
                    (0.7, 1.5, true),
                    (0.99, 0.1, true),
                    (0.5, -0.1, false),
                ] {
                    let u = (start + along * turn).rem_euclid(TAU);
                    assert_eq!(
                        contains(&region, u, v),
                        is_in,
                        "{start} {turn} {first} {u} {v}"
                    );
                }
                let beside = (end + 0.5 * (TAU - turn)).rem_euclid(TAU);
                assert!(!contains(&region, beside, 1.5), "{start} {turn} {first}");
            }
        }
    }
}

#[test]
fn loops_across_the_seam_come_in_on_the_other_side() {
    let cylinder = cylinder();
    let square = [[6.0, 1.0], [6.6, 1.0], [6.6, 3.0], [6.0, 3.0], [6.0, 1.0]];
    let shifted = square.map(|[u, v]| [u - 3.0 * TAU, v]);
    for points in [square, shifted] {
        let region = region(&cylinder, &[path(&points)]);
        for (u, is_in) in [
            (6.1, true),
            (6.25, true),
            (0.1, true),
            (0.4, false),
            (5.9, false),
        ] {
            assert_eq!(contains(&region, u, 2.0), is_in, "{u}");
            assert!(!contains(&region, u, 3.5));
        }
    }
}

#[test]
fn two_circles_bound_a_band_with_a_hole() {
    let cylinder = cylinder();
    // Waves, so that the loops go back beyond the seam.
    let wave = |from: f64, to: f64, v: f64| -> Vec<[f64; 2]> {
        let at = |k: i32| {
            let t = from + (to - from) * f64::from(k) / 64.0;
            let height = v + 0.3 * (5.0 * t).cos();
            [t - 0.2 * (5.0 * t).sin(), height]
        };
        (0..=64).map(at).collect()
    };
    let lower = path(&wave(2.0, 2.0 + TAU, 1.0));
    let upper = path(&wave(5.0, 5.0 - TAU, 3.0));
    let hole = path(&[[3.0, 1.8], [3.0, 2.2], [3.5, 2.2], [3.5, 1.8], [3.0, 1.8]]);
    let region = region(&cylinder, &[lower, upper, hole]);
    for k in 0..60 {
        let u = f64::from(k) * 0.1 + 0.05;
        assert!(contains(&region, u, 1.7), "{u}");
        assert!(
            !contains(&region, u, 0.3) && !contains(&region, u, 3.7),
            "{u}"
        );
        assert_eq!(contains(&region, u, 2.0), !(3.0..3.5).contains(&u), "{u}");
    }
}

#[test]
fn rings_of_a_torus_are_told_apart_by_their_direction() {
    let torus = torus();
    let around = |from: f64, to: f64, v: f64| path(&[[from, v], [to, v]]);
    let outer = region(
        &torus,
        &[around(0.5, 0.5 + TAU, 5.5), around(0.5 + TAU, 0.5, 7.0)],
    );
    let inner = region(
        &torus,
        &[around(0.5 + TAU, 0.5, 5.5), around(0.5, 0.5 + TAU, 7.0)],
    );
    for (v, is_outer) in [(6.0, true), (0.2, true), (1.0, false), (5.0, false)] {
        for u in [0.1, 0.6, 3.0, 6.0] {
            assert_eq!(contains(&outer, u, v), is_outer, "{u} {v}");
            assert_eq!(contains(&inner, u, v), !is_outer, "{u} {v}");
        }
    }
    // The same around the tube: a bend of the torus.
    let section = |u: f64, from: f64, to: f64| path(&[[u, from], [u, to]]);
    let bend = region(&torus, &[section(1.0, TAU, 0.0), section(2.0, 0.0, TAU)]);
    for (u, is_in) in [(1.5, true), (0.5, false), (3.0, false)] {
        assert_eq!(contains(&bend, u, 1.0), is_in, "{u}");
    }
}

#[test]
fn all_but_a_groove_once_around_a_sphere_belongs_to_a_face() {
    let sphere = sphere();
    let end = TAU + 0.3;
    // Nearly a ring, which does not close, and back beside it.
    let groove = [[0.0, 0.0], [end, 0.3], [end, 0.5], [0.0, 0.2], [0.0, 0.0]];
    let mut turned = groove;
    turned.reverse();
    let (inside, outside) = (
        region(&sphere, &[path(&groove)]),
        region(&sphere, &[path(&turned)]),
    );
    for (u, v, is_in) in [
        (3.0, 0.25, true),
        (0.2, 0.1, true),
        (3.0, -0.5, false),
        (3.0, 1.0, false),
    ] {
        assert_eq!(contains(&inside, u, v), is_in, "{u} {v}");
        assert_eq!(contains(&outside, u, v), !is_in, "{u} {v}");
    }
    // Nothing is beside a loop around all of the domain.
    let all = [
        [0.0, -FRAC_PI_2],
        [0.0, FRAC_PI_2],
        [TAU, FRAC_PI_2],
        [TAU, -FRAC_PI_2],
    ];
    let all = path(&[&all[..], &all[..1]].concat());
    assert!(contains(&region(&sphere, &[all]), 1.0, 1.0));
}

#[test]
fn rings_keep_their_order_however_they_are_cut() {
    let torus = torus();
    // The second is above the first, but most of its pieces begin below most of those of the first.
    let lower = path(&[[0.0, 1.0], [2.0, 3.0], [4.0, 3.0], [TAU, 1.0]]);
    let dense = (0..30).map(|k| [TAU - f64::from(k) * 0.01, 1.5]);
    let upper: Vec<_> = dense.chain([[4.0, 3.5], [2.0, 3.5], [0.0, 1.5]]).collect();
    let between = region(&torus, &[lower.clone(), path(&upper)]);
    let backwards =
        |chain: &[Curve<DVec2>]| -> Vec<_> { chain.iter().rev().map(Curve::reversed).collect() };
    let beyond = region(&torus, &[backwards(&lower), backwards(&path(&upper))]);
    for (u, v, is_in) in [
        (3.0, 3.2, true),
        (6.2, 1.3, true),
        (3.0, 2.0, false),
        (3.0, 5.0, false),
    ] {
        assert_eq!(contains(&between, u, v), is_in, "{u} {v}");
        assert_eq!(contains(&beyond, u, v), !is_in, "{u} {v}");
    }
}

#[test]
fn what_runs_along_a_seam_is_left_out_on_its_other_side() {
    // Cut at the seam of v, the part above it is a square, not a square and a line.
    let chain = path(&[
        [1.0, 5.0],
        [5.0, 5.0],
        [5.0, TAU],
        [4.0, TAU],
        [4.0, TAU + 1.0],
        [3.0, TAU + 1.0],
        [3.0, TAU],
        [1.0, TAU],
        [1.0, 5.0],
    ]);
    let loops = close(&torus(), &[chain], Orientation::Left).unwrap().loops;
    let mut boxes: Vec<_> = loops.iter().map(TrimLoop::hull).collect();
    boxes.sort_by(|a, b| a.0.y.total_cmp(&b.0.y));
    let corners = [([3.0, 0.0], [4.0, 1.0]), ([1.0, 5.0], [5.0, TAU])];
    assert_eq!(boxes.len(), 2);
    for ((min, max), (low, high)) in boxes.into_iter().zip(corners) {
        assert!(min.distance(low.into()) < 1e-12, "{min}");
        assert!(max.distance(high.into()) < 1e-12, "{max}");
    }
}

#[test]
fn what_is_beyond_a_seam_by_rounding_is_no_loop() {
    let height = TAU + 2e-6;
    let nearly = path(&[
        [1.0, 5.0],
        [5.0, 5.0],
        [5.0, 6.0],
        [3.0001, 6.0],
        [3.0, height],
        [2.9999, 6.0],
        [1.0, 6.0],
        [1.0, 5.0],
    ]);
    let loops = close(&torus(), &[nearly], Orientation::Left).unwrap().loops;
    assert_eq!(loops.len(), 1);
    // But a small hole is one on both sides.
    let hole = path(&[
        [1.0, height],
        [1.0001, TAU - 2e-6],
        [1.0002, height],
        [1.0, height],
    ]);
    let loops = close(&torus(), &[hole], Orientation::Unknown)
        .unwrap()
        .loops;
    assert_eq!(loops.len(), 2);
}

#[test]
fn paths_jump_at_poles_only() {
    let sphere = sphere();
    let eighth = path(&[[0.0, 0.0], [1.0, 0.0], [1.0, FRAC_PI_2]]);
    let down = path(&[[0.0, FRAC_PI_2], [0.0, 0.0]]);
    let region = region(&sphere, &[[eighth.clone(), down].concat()]);
    for (u, v, is_in) in [
        (0.5, 0.1, true),
        (0.5, 1.5, true),
        (1.5, 0.5, false),
        (0.5, -0.5, false),
    ] {
        assert_eq!(contains(&region, u, v), is_in);
    }
    let torn = [eighth, path(&[[0.0, 1.2], [0.0, 0.0]])].concat();
    let result = close(&sphere, &[torn], Orientation::Left);
    assert!(matches!(result, Err(Error::LoopGap { .. })));
}

#[test]
fn half_a_sphere_between_two_meridians() {
    let sphere = sphere();
    let (south, north) = (-FRAC_PI_2, FRAC_PI_2);
    // Up at one side and down at the other: which half, only the direction tells.
    let up_first = path(&[[0.0, south], [0.0, north]]);
    let down = path(&[[PI, north], [PI, south]]);
    let region = region(&sphere, &[[down, up_first].concat()]);
    assert!(contains(&region, 4.5, 0.0) && !contains(&region, 1.5, 0.0));
}

#[test]
fn gaps_are_bridged_counted_or_refused() {
    let cylinder = cylinder();
    let square = |end: f64| path(&[[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0], [1.0, end]]);
    let gaps = |end| close(&cylinder, &[square(end)], Orientation::Left).map(|c| c.wide_gaps);
    assert_eq!(gaps(1.0), Ok(0));
    assert_eq!(gaps(1.001), Ok(0));
    assert_eq!(gaps(1.05), Ok(1));
    assert!(matches!(gaps(1.5), Err(Error::LoopGap { .. })));
    assert_eq!(
        close(&cylinder, &[Vec::new()], Orientation::Left),
        Err(Error::EmptyLoop)
    );
}

#[test]
fn ends_that_differ_by_rounding_are_moved_together() {
    let corners = [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]];
    let off = |[u, v]: [f64; 2]| [u + 1e-9, v - 1e-30];
    let side = |k: usize| path(&[corners[k], off(corners[(k + 1) % 4])]);
    let chain = [0, 1, 2, 3].map(side).concat();
    let loops = close(&cylinder(), &[chain], Orientation::Left)
        .unwrap()
        .loops;
    let [one] = loops.as_slice() else {
        panic!("{} loops", loops.len());
    };
    let starts = one.segments().iter().map(|c| c.start().to_array());
    assert!(starts.eq(corners));
    let ends = one.segments().iter().map(|c| c.end().to_array());
    assert!(ends.eq([1, 2, 3, 0].map(|k| corners[k])));
}

#[test]
fn curves_that_begin_before_the_end_of_others_do_not_run_back() {
    let square = modelling::plane(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0..1.0, 0.0..1.0).unwrap();
    let corners = [
        [0.2, 0.2],
        [0.5, 0.2],
        [0.8, 0.2],
        [0.8, 0.8],
        [0.2, 0.8],
        [0.2, 0.2],
    ];
    // So far back in the middle of a side, and where the loop ends, at a corner and on a side.
    for (back, start) in [(1e-5, 0.2), (3e-4, 0.2), (0.0, 0.3), (1e-4, 0.3)] {
        let mut sides = path(&corners);
        let line =
            |from: [f64; 2], to: [f64; 2]| Curve::line(from.into(), to.into(), 0.0..1.0).unwrap();
        sides[0] = line([start - back, 0.2], [0.5, 0.2]);
        sides[1] = line([0.5 - back, 0.2], [0.8, 0.2]);
        if start > 0.2 {
            sides.push(line([0.2, 0.2], [start + back, 0.2]));
        }
        let closed = close(&square, &[sides], Orientation::Left).unwrap();
        let segments = closed.loops[0].segments();
        let length = |curve: &Curve<DVec2>| curve.start().distance(curve.end());
        let around: f64 = segments.iter().map(length).sum();
        assert!((around - 2.4).abs() < 1e-12, "{back} {start}: {around}");
    }
}

#[test]
fn loops_farther_away_than_digits_tell_are_refused() {
    let square = |u: f64, size: f64| {
        path(&[
            [u, 1.0],
            [u + size, 1.0],
            [u + size, 2.0],
            [u, 2.0],
            [u, 1.0],
        ])
    };
    let loops = |u: f64, size: f64| close(&cylinder(), &[square(u, size)], Orientation::Unknown);
    let near = loops(1.0 - 1000.0 * TAU, 1.0).unwrap().loops;
    assert!((near[0].signed_area() - 1.0).abs() < 1e-9);
    for (u, size) in [
        (1.2e19, 1e18),
        (-1.2e19, 1e18),
        (1e8, 1.0),
        (1.0, 9.0 * TAU),
    ] {
        let problem = loops(u, size).unwrap_err();
        assert!(matches!(problem, Error::Parameter { .. }), "{problem}");
    }
}

#[test]
fn a_loop_goes_around_the_corner_of_two_sides_that_are_one_point() {
    // A lens: the sides at u = 0 and v = 0 are one of its corners.
    let net = [
        [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]],
        [[0.0, 0.0], [0.25, 0.0], [0.5, -0.5]],
        [[0.0, 0.0], [0.5, 0.5], [1.0, 0.0]],
    ];
    let points = net
        .as_flattened()
        .iter()
        .map(|&[x, y]| DVec3::new(x, y, 0.0));
    let knots = || KnotVector::bezier(2, 0.0..1.0).unwrap();
    let lens = Surface::new(knots(), knots(), &points.collect::<Vec<_>>(), None).unwrap();
    let sides = [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let back = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]];
    for side in [sides, back] {
        let closed = close(&lens, &[path(&side)], Orientation::Unknown).unwrap();
        let area = closed.loops[0].signed_area().abs();
        assert!((area - 1.0).abs() < 1e-12, "{area}");
    }
}

#[test]
fn a_loop_that_touches_itself_on_the_seam_is_cut_there() {
    // A band of a cylinder between -pi and pi without three triangles, which it passes by with a corner
    // on the seam: two on its one side, and one on its other.
    let around = [
        [-PI, 0.0],
        [PI, 0.0],
        [PI, 1.0],
        [0.0, 1.0],
        [-1.0, 0.8],
        [-1.0, 1.2],
        [0.0, 1.0],
        [PI, 1.2],
        [PI, 2.8],
        [0.0, 3.0],
        [-1.0, 2.8],
        [-1.0, 3.2],
        [0.0, 3.0],
        [PI, 3.2],
        [PI, 4.0],
        [-PI, 4.0],
        [-PI, 0.0],
    ];
    let area = |loops: &[TrimLoop]| loops.iter().map(TrimLoop::signed_area).sum::<f64>();
    let expected = TAU * 4.0 - 2.0 * 0.2 - 0.5 * PI * (0.2 + 0.4);
    for turned in [false, true] {
        let mut points = around;
        if turned {
            points.reverse();
        }
        let closed = close(&cylinder(), &[path(&points)], Orientation::Unknown).unwrap();
        let found = area(&closed.loops);
        assert!(
            (found.abs() - expected).abs() < 1e-9,
            "{found}, not {expected}"
        );
    }
}
