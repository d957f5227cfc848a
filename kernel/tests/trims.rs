//! Trim regions against a slow reference and against what is known about simple ones.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "helpers of tests are tests, too"
)]

mod slow_trims;

use std::f64::consts::TAU;
use std::ops::Range;
use std::time::Instant;

use glam::{DVec2, DVec3};
use nurbray_kernel::{Cover, Curve, KnotVector, Patch, Surface, TrimLoop, TrimRegion};
use slow_trims::Random;

const UNIT: Range<f64> = 0.0..1.0;

fn polygon(corners: &[DVec2]) -> TrimLoop {
    let closed: Vec<DVec2> = corners.iter().chain(&corners[..1]).copied().collect();
    TrimLoop::new(vec![Curve::polyline(&closed).unwrap()], 0.0).unwrap()
}

fn rectangle(min: [f64; 2], max: [f64; 2]) -> TrimLoop {
    let corners = [min, [max[0], min[1]], max, [min[0], max[1]]];
    polygon(&corners.map(DVec2::from))
}

/// A circle of four rational quadratic pieces.
fn circle(center: DVec2, radius: f64) -> TrimLoop {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let point = |k: usize| {
        let long = if k % 2 == 1 { radius / half } else { radius };
        center + DVec2::from_angle(TAU * (k % 8) as f64 / 8.0) * long
    };
    let weights: Vec<f64> = (0..9)
        .map(|k| if k % 2 == 1 { half } else { 1.0 })
        .collect();
    let knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4].map(f64::from).to_vec();
    let knots = KnotVector::new(2, knots).unwrap();
    let points: Vec<_> = (0..9).map(point).collect();
    let curve = Curve::new(knots, &points, Some(&weights)).unwrap();
    TrimLoop::new(vec![curve], 1e-12).unwrap()
}

/// A wild closed spline with weights.
fn wild(random: &mut Random, degree: usize, count: usize) -> TrimLoop {
    let mut points: Vec<DVec2> = (0..count).map(|_| random.point() * 1.4 - 0.2).collect();
    points[count - 1] = points[0];
    let weights: Vec<f64> = (0..count).map(|_| 0.2 + 3.0 * random.number()).collect();
    let knots = KnotVector::clamped_uniform(degree, count, UNIT).unwrap();
    let curve = Curve::new(knots, &points, Some(&weights)).unwrap();
    TrimLoop::new(vec![curve], 1e-12).unwrap()
}

/// Compares with the reference at random points, and at the heights and widths of ends.
fn agrees(name: &str, loops: &[TrimLoop], random: &mut Random, count: usize) {
    let region = TrimRegion::new(loops, UNIT, UNIT);
    let pieces = slow_trims::pieces(loops.iter().flat_map(TrimLoop::segments));
    let ends: Vec<DVec2> = pieces.iter().map(|p| p[0].truncate() / p[0].z).collect();
    for k in 0..count {
        let mut p = random.point();
        let end = ends[k % ends.len()];
        if k % 5 == 1 && UNIT.contains(&end.y) {
            p.y = end.y;
        }
        if k % 5 == 2 && UNIT.contains(&end.x) {
            p.x = end.x;
        }
        if region.contains(p) != slow_trims::contains(&pieces, p) {
            let distance = slow_trims::distance(&pieces, p);
            assert!(distance < 1e-9, "{name}: {p}, {distance:e} from a curve");
        }
    }
    for _ in 0..count / 50 {
        let (a, b) = (random.point(), random.point());
        let size = 0.3 * random.number();
        let (u, v) = (
            a.x..(a.x + size * b.x).min(1.0),
            a.y..(a.y + size * b.y).min(1.0),
        );
        let cover = region.classify(u.clone(), v.clone());
        for _ in 0..20 {
            let share = random.point();
            let p = DVec2::new(
                u.start + share.x * (u.end - u.start),
                v.start + share.y * (v.end - v.start),
            );
            let expected = slow_trims::contains(&pieces, p);
            match cover {
                Cover::Mixed => {}
                Cover::Inside => assert!(expected, "{name}: {p} in {u:?} {v:?}"),
                Cover::Outside => assert!(!expected, "{name}: {p} in {u:?} {v:?}"),
            }
        }
    }
}

#[test]
fn random_loops_agree_with_the_reference() {
    let mut random = Random(1);
    for round in 0..40 {
        let r = &mut random;
        let center = r.point();
        let nested: Vec<_> = (1..8)
            .map(|k| circle(center, 0.08 * f64::from(k)))
            .collect();
        agrees("nested", &nested, r, 1000);
        let touching = [
            circle(DVec2::new(0.3, 0.5), 0.2),
            circle(DVec2::new(0.7, 0.5), 0.2),
            rectangle([0.1, 0.3], [0.5, 0.7]),
        ];
        agrees("touching", &touching, r, 1000);
        let corners: Vec<DVec2> = (0..3 + round).map(|_| r.point() * 1.2 - 0.1).collect();
        agrees("polygon", &[polygon(&corners)], r, 1000);
        for degree in 2..6 {
            let loops = [wild(r, degree, 8 + round), wild(r, degree, 7)];
            agrees("spline", &loops, r, 1000);
        }
    }
}

#[test]
fn the_border_of_the_domain_belongs_to_the_face() {
    let (u, v) = (-2.0..5.0, 1e3..1e3 + 7.0);
    let full = rectangle([u.start, v.start], [u.end, v.end]);
    let region = TrimRegion::new(std::slice::from_ref(&full), u.clone(), v.clone());
    assert!(region.is_whole());
    let none = TrimRegion::new(&[], u.clone(), v.clone());
    assert!(none.is_whole());
    let hole = rectangle([0.0, 1001.0], [1.0, 1002.0]);
    let holed = TrimRegion::new(&[full, hole], u.clone(), v.clone());
    assert!(!holed.is_whole());
    for k in 0..=100 {
        let share = f64::from(k) / 100.0;
        let (s, t) = (u.start + 7.0 * share, v.start + 7.0 * share);
        let border = [(u.start, t), (u.end, t), (s, v.start), (s, v.end)];
        for region in [&region, &none, &holed] {
            for p in border {
                assert!(region.contains(p.into()), "{p:?}");
            }
        }
    }
    assert!(!holed.contains(DVec2::new(0.5, 1001.5)));
    assert_eq!(holed.classify(3.0..5.0, v.clone()), Cover::Inside);
    assert_eq!(holed.classify(0.2..0.8, 1001.2..1001.8), Cover::Outside);
    assert_eq!(holed.classify(0.2..1.8, 1001.2..1001.8), Cover::Mixed);
}

#[test]
fn loops_side_by_side_leave_no_crack() {
    let cuts = [0.0, 0.1, 0.3, 0.7, 1.0];
    let mut loops = Vec::new();
    for a in cuts.windows(2) {
        for b in cuts.windows(2) {
            loops.push(rectangle([a[0], b[0]], [a[1], b[1]]));
        }
    }
    let region = TrimRegion::new(&loops, UNIT, UNIT);
    let mut random = Random(5);
    for _ in 0..1000 {
        let p = random.point();
        for x in cuts {
            assert!(region.contains(DVec2::new(x, p.y)));
            assert!(region.contains(DVec2::new(p.x, x)));
            assert!(cuts.iter().all(|&y| region.contains(DVec2::new(x, y))));
        }
    }
}

#[test]
fn what_is_run_through_twice_cancels() {
    let own = circle(DVec2::splat(0.5), 0.3);
    let doubled = TrimRegion::new(&[own.clone(), own], UNIT, UNIT);
    let line = [DVec2::new(0.2, 0.1), DVec2::new(0.7, 0.8)];
    let flat = TrimRegion::new(&[polygon(&line)], UNIT, UNIT);
    let mut random = Random(6);
    for _ in 0..5000 {
        let p = random.point();
        assert!(!doubled.contains(p));
        assert!(!flat.contains(p));
    }
}

#[test]
fn many_segments_are_searched_fast() {
    let ring = |count: usize, wave: f64| -> Vec<DVec2> {
        let angle = |k: usize| TAU * k as f64 / count as f64;
        let radius = |k: usize| 0.3 + wave * (angle(k) * 20.0).sin();
        (0..count)
            .map(|k| DVec2::splat(0.5) + DVec2::from_angle(angle(k)) * radius(k))
            .collect()
    };
    let comb: Vec<DVec2> = (0..10_000)
        .map(|k| {
            let high = if k % 4 < 2 { 0.1 } else { 0.9 };
            DVec2::new(0.05 + 0.9 * f64::from(k / 2) / 5000.0, high)
        })
        .collect();
    let star: Vec<DVec2> = (0..10_001)
        .map(|k| DVec2::splat(0.5) + DVec2::from_angle(TAU * f64::from(k) * 0.4999) * 0.45)
        .collect();
    let mut random = Random(7);
    for (name, corners) in [
        ("ring", ring(10_000, 0.0)),
        ("flower", ring(10_000, 0.1)),
        ("comb", comb.clone()),
        (
            "comb on its side",
            comb.iter().map(|p| DVec2::new(p.y, p.x)).collect(),
        ),
        ("star", star),
    ] {
        let loops = [polygon(&corners)];
        let start = Instant::now();
        let region = TrimRegion::new(&loops, UNIT, UNIT);
        let built = start.elapsed();
        let points: Vec<DVec2> = (0..100_000).map(|_| random.point()).collect();
        let start = Instant::now();
        let inside = points.iter().filter(|p| region.contains(**p)).count();
        let each = start.elapsed().as_secs_f64() * 1e9 / points.len() as f64;
        println!(
            "{name}: built in {built:?}, {} bytes, {inside} inside, {each:.0} ns a query",
            region.bytes()
        );
        assert!(region.bytes() < 2_000_000, "{name}: {}", region.bytes());
        agrees(name, &loops, &mut random, 500);
    }
}

#[test]
fn loops_across_a_seam_come_in_on_the_other_side() {
    // A closed band over u in 0..8.
    let angles = (0..=8).map(|k| TAU * f64::from(k % 8) / 8.0);
    let points: Vec<DVec3> = angles
        .flat_map(|a| [0.0, 1.0].map(|z| DVec2::from_angle(a).extend(z)))
        .collect();
    let (u, v) = (0.0..8.0, 0.0..1.0);
    let knots_u = KnotVector::clamped_uniform(1, 9, u).unwrap();
    let knots_v = KnotVector::bezier(1, v).unwrap();
    let surface = Surface::new(knots_u, knots_v, &points, None).unwrap();
    let region = |trim: TrimLoop| {
        let loops = vec![trim];
        TrimRegion::of(&Patch {
            loops,
            ..Patch::from(surface.clone())
        })
    };
    let mut random = Random(8);
    for shift in [-8.0, 0.0, 8.0] {
        let seam = region(rectangle([6.0 + shift, 0.2], [10.0 + shift, 0.8]));
        let band = region(rectangle([3.0 + shift, 0.2], [11.0 + shift, 0.8]));
        for _ in 0..1000 {
            let p = random.point() * DVec2::new(8.0, 1.0);
            let is_high = (0.2..0.8).contains(&p.y);
            let is_near = p.x < 2.0 || p.x >= 6.0;
            assert_eq!(seam.contains(p), is_high && is_near, "{p}");
            assert_eq!(band.contains(p), is_high, "{p}");
        }
    }
}

#[test]
fn segments_thinner_than_rounding_errors_keep_their_place() {
    // A face of a real file: a spline that starts flat, and a link of 2e-7 before it.
    let points = [
        [11.1803401, -6.0],
        [10.46723706, -6.000000011],
        [9.753998759, -5.942115134],
        [9.047086707, -5.826520847],
        [5.567840736, -4.563529133],
        [2.981424101, -2.333333436],
        [3.260345459, -26.0],
        [11.43551636, -26.0],
        [11.1803399, -6.0],
    ]
    .map(DVec2::from);
    let knots = KnotVector::clamped_uniform(5, 6, UNIT).unwrap();
    let spline = Curve::new(knots, &points[..6], None).unwrap();
    let rest = Curve::polyline(&points[5..]).unwrap();
    let loops = [TrimLoop::new(vec![spline, rest], 1e-6).unwrap()];
    let (u, v) = (2.981424101..11.43551636, -26.0..-2.333333436);
    let region = TrimRegion::new(&loops, u.clone(), v.clone());
    let pieces = slow_trims::pieces(loops.iter().flat_map(TrimLoop::segments));
    let mut random = Random(9);
    for _ in 0..20_000 {
        let size = DVec2::new(u.end - u.start, v.end - v.start);
        let p = DVec2::new(u.start, v.start) + size * random.point();
        assert_eq!(region.contains(p), slow_trims::contains(&pieces, p), "{p}");
    }
}
