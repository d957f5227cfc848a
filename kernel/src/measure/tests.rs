use std::f64::consts::{PI, TAU};

use super::*;
use crate::modelling::{self, Frame, sphere};
use crate::{FARTHEST, KnotVector, Surface, TrimLoop};

fn integrals(surface: &Surface) -> Integrals {
    Integrals::of(&Patch::from(surface.clone()), DVec3::ZERO)
}

/// A bilinear patch over 0..1 x 0..1 with knots at the given places.
fn plane(corners: [[f64; 3]; 4], knots: &[f64]) -> Surface {
    let line = KnotVector::bezier(1, 0.0..1.0).unwrap();
    let corners = corners.map(DVec3::from);
    let surface = Surface::new(line.clone(), line, &corners, None).unwrap();
    surface.refined_u(knots).unwrap().refined_v(knots).unwrap()
}

fn square() -> Surface {
    let corners = [
        [0.0, 0.0, 1.0],
        [0.0, 2.0, 1.0],
        [3.0, 0.0, 1.0],
        [3.0, 2.0, 1.0],
    ];
    plane(corners, &[0.3, 0.5, 0.9])
}

/// A circle in the parameter domain, as four arcs, counter-clockwise or not.
fn circle(center: DVec2, radius: f64, turns: f64) -> TrimLoop {
    let arcs = (0..4).map(|k| {
        let angle = |k: f64| turns * TAU * k / 4.0;
        let k = f64::from(k);
        let points = [angle(k), angle(k + 0.5), angle(k + 1.0)].map(DVec2::from_angle);
        let points = [points[0], points[1] * 2.0_f64.sqrt(), points[2]];
        let knots = KnotVector::bezier(2, 0.0..1.0).unwrap();
        let weights = [1.0, 0.5_f64.sqrt(), 1.0];
        Curve::new(knots, &points.map(|p| center + p * radius), Some(&weights)).unwrap()
    });
    TrimLoop::new(arcs.collect(), 1e-12).unwrap()
}

#[test]
fn sides_that_loops_share_are_not_in_the_box() {
    // The face, less the lower left part of it.
    let [whole, part] = [1.0, 0.4].map(|u| TrimLoop::border(&(0.0..u), &(0.0..1.0)).unwrap());
    let mut patch = Patch::from(square());
    patch.loops = vec![whole, part];
    let bounds = patch.bounds();
    assert!((bounds.min.x - 1.2).abs() < 1e-9, "{bounds:?}");
    assert!((bounds.max.x - 3.0).abs() < 1e-9, "{bounds:?}");
    assert_eq!((bounds.min.y, bounds.max.y), (0.0, 2.0));
    let area = Integrals::of(&patch, DVec3::ZERO).area();
    assert!((area - 3.6).abs() < 1e-12, "{area}");
}

#[test]
fn what_is_inside_an_odd_number_of_loops_that_cross_counts() {
    // A bow tie: both of its halves; two squares, less twice what they share.
    let tie = [[0.1, 0.1], [0.9, 0.9], [0.9, 0.1], [0.1, 0.9], [0.1, 0.1]];
    let tie = Curve::polyline(&tie.map(DVec2::from)).unwrap();
    let tie = vec![TrimLoop::new(vec![tie], 0.0).unwrap()];
    let squares = vec![
        window(DVec2::splat(0.1), DVec2::splat(0.6)),
        window(DVec2::splat(0.4), DVec2::splat(0.9)),
    ];
    // Two circles of radius r whose centres are r apart share (2 pi / 3 - sqrt(3) / 2) r^2.
    let circles = vec![
        circle(DVec2::new(0.35, 0.5), 0.3, 1.0),
        circle(DVec2::new(0.65, 0.5), 0.3, 1.0),
    ];
    let shared = (2.0 * PI / 3.0 - 0.75_f64.sqrt()) * 0.09;
    let apart = 2.0 * (PI * 0.09 - shared);
    for (loops, expected) in [(tie, 0.32), (squares, 0.42), (circles, apart)] {
        let mut patch = Patch::from(square());
        patch.loops = loops;
        // The square has sides of three and two.
        let found = Integrals::of(&patch, DVec3::ZERO);
        let (area, error) = (found.area() / 6.0, found.area_error() / 6.0);
        assert!(
            (area - expected).abs() <= error,
            "{area} +- {error}, {expected}"
        );
        assert!(error < 1e-6, "{error}");
    }
}

#[test]
fn boxes_end_where_a_side_is_no_longer_shared() {
    // z = u (1 - v), without a corner where it is highest; the notch, or one loop with a line to and fro.
    let corners = [
        [0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.0, 1.0],
        [1.0, 1.0, 0.0],
    ];
    let mut patch = Patch::from(plane(corners, &[0.3]));
    let whole = TrimLoop::border(&(0.0..1.0), &(0.0..1.0)).unwrap();
    let notch = TrimLoop::border(&(0.76..1.0), &(0.0..0.3)).unwrap();
    let path = [
        [0.0, 0.0],
        [0.9, 0.0],
        [0.76, 0.0],
        [0.76, 0.3],
        [1.0, 0.3],
        [1.0, 1.0],
        [0.0, 1.0],
        [0.0, 0.0],
    ];
    let to_and_fro = Curve::polyline(&path.map(DVec2::from)).unwrap();
    let to_and_fro = TrimLoop::new(vec![to_and_fro], 0.0).unwrap();
    for loops in [vec![whole, notch], vec![to_and_fro]] {
        patch.loops = loops;
        let bounds = patch.bounds();
        assert!((bounds.max.z - 0.76).abs() < 1e-9, "{bounds:?}");
    }
}

#[test]
fn thin_faces_and_tips_are_in_the_box() {
    let corners = [
        [0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
    ];
    for width in [1e-6, 1e-8, 1e-13] {
        let path = [[0.2, 0.5], [0.8, 0.5], [0.8, 0.5 + width], [0.2, 0.5]];
        let side = Curve::polyline(&path.map(DVec2::from)).unwrap();
        let mut patch = Patch::from(plane(corners, &[0.3]));
        patch.loops = vec![TrimLoop::new(vec![side], 0.0).unwrap()];
        let bounds = patch.bounds();
        assert!((bounds.min.x - 0.2).abs() < 1e-9, "{bounds:?}");
        assert!((bounds.max.x - 0.8).abs() < 1e-9, "{bounds:?}");
    }
}

#[test]
fn parameters_may_be_far_from_their_origin() {
    let at = 7e7;
    let (low, high) = (at - 8.0, at + 8.0);
    let square = modelling::plane(
        DVec3::ZERO,
        DVec3::X * 16.0,
        DVec3::Y * 16.0,
        low..high,
        low..high,
    );
    let mut patch = Patch::from(square.unwrap());
    patch.loops = vec![window(DVec2::splat(at - 7.0), DVec2::splat(at + 7.0))];
    let bounds = patch.bounds();
    assert!(
        (bounds.size() - DVec3::new(14.0, 14.0, 0.0)).length() < 1e-6,
        "{bounds:?}"
    );
    let area = Integrals::of(&patch, bounds.center()).area();
    assert!((area - 196.0).abs() < 1e-6, "{area}");
}

#[test]
fn trimmed_planes_have_the_area_inside() {
    let outer = circle(DVec2::new(0.52, 0.45), 0.41, 1.0);
    let hole = circle(DVec2::new(0.5, 0.5), 0.2, 1.0);
    for turns in [1.0, -1.0] {
        let mut patch = Patch::from(square());
        patch.loops = vec![
            outer.clone(),
            hole.clone(),
            circle(DVec2::splat(0.5), 0.1, turns),
        ];
        let found = Integrals::of(&patch, DVec3::ZERO);
        let expected = 6.0 * PI * (0.41_f64.powi(2) - 0.2_f64.powi(2) + 0.1_f64.powi(2));
        assert!((found.area() - expected).abs() < 1e-12, "{}", found.area());
        assert!(found.area_error() < 1e-9);
        assert!(found.normal().distance(DVec3::Z * expected) < 1e-12);
        assert!((found.volume() - expected / 3.0).abs() < 1e-12);
    }
}

#[test]
fn loops_beyond_the_surface_are_cut_off() {
    let mut patch = Patch::from(square());
    patch.loops = vec![circle(DVec2::new(1.0, 1.0), 0.5, 1.0)];
    let found = Integrals::of(&patch, DVec3::ZERO).area();
    assert!((found - 6.0 * PI / 16.0).abs() < 1e-12, "{found}");
    // Along the border itself.
    patch.loops = vec![TrimLoop::border(&(0.0..1.0), &(0.25..1.0)).unwrap()];
    assert!((Integrals::of(&patch, DVec3::ZERO).area() - 4.5).abs() < 1e-12);
}

/// Every corner lies in a piece of its own, and every side crosses a knot halfway.
#[test]
fn loops_are_cut_at_knots_in_the_middle_of_their_sides() {
    let corners = [
        [0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
    ];
    let mut patch = Patch::from(plane(corners, &[0.5]));
    let ends = [[0.25, 0.125], [0.75, 0.25], [0.75, 0.75], [0.25, 0.875]];
    let sides = (0..4).map(|k| {
        let [from, to] = [ends[k], ends[(k + 1) % 4]].map(DVec2::from);
        Curve::line(from, to, 0.0..1.0).unwrap()
    });
    patch.loops = vec![TrimLoop::new(sides.collect(), 0.0).unwrap()];
    let found = Integrals::of(&patch, DVec3::ZERO).area();
    assert!((found - 0.3125).abs() < 1e-14, "{found}");
}

#[test]
fn bodies_have_their_closed_forms() {
    let frame = Frame::about(DVec3::new(1.0, -2.0, 0.5), DVec3::new(0.3, 0.1, 1.0)).unwrap();
    let sphere = sphere(&frame, 2.0, 0.0..TAU, -PI / 2.0..PI / 2.0).unwrap();
    let found = integrals(&sphere);
    let volume = 4.0 / 3.0 * PI * 8.0;
    assert!((found.area() - 16.0 * PI).abs() < 1e-10, "{}", found.area());
    assert!((found.volume().abs() - volume).abs() < 1e-10);
    assert!(found.normal().length() < 1e-10);
    let sign = found.volume().signum();
    let center = found.moment() * sign / volume;
    assert!(
        center.distance(DVec3::new(1.0, -2.0, 0.5)) < 1e-11,
        "{center}"
    );
    // About the middle, the second moment of a ball is V r^2 / 5.
    let about = Integrals::of(&Patch::from(sphere), DVec3::new(1.0, -2.0, 0.5));
    let squares = about.squares() * sign;
    assert!(
        squares.distance(DVec3::splat(volume * 4.0 / 5.0)) < 1e-9,
        "{squares}"
    );
    assert!(about.products().length() < 1e-9);
}

#[test]
fn boxes_touch_the_extreme_points() {
    let center = DVec3::new(1.0, -2.0, 0.5);
    let frame = Frame::about(center, DVec3::new(0.3, 0.1, 1.0)).unwrap();
    let sphere = sphere(&frame, 2.0, 0.0..TAU, -PI / 2.0..PI / 2.0).unwrap();
    let bounds = Patch::from(sphere).bounds();
    assert!(bounds.min.distance(center - 2.0) < 1e-7, "{bounds:?}");
    assert!(bounds.max.distance(center + 2.0) < 1e-7, "{bounds:?}");
    // A disc in a plane that is not parallel to an axis.
    let corners = [
        [0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.0, 2.0],
        [1.0, 1.0, 2.0],
    ];
    let mut disc = Patch::from(plane(corners, &[0.25]));
    disc.loops = vec![circle(DVec2::new(0.5, 0.4), 0.3, -1.0)];
    let bounds = disc.bounds();
    let (min, max) = (DVec3::new(0.2, 0.1, 0.4), DVec3::new(0.8, 0.7, 1.6));
    assert!(
        bounds.min.distance(min) < 1e-12 && bounds.max.distance(max) < 1e-12,
        "{bounds:?}"
    );
    // A saddle whose highest points lie on its border, between the corners.
    let knots = KnotVector::bezier(2, 0.0..1.0).unwrap();
    let height = [0.0, 3.0, 0.0, -2.0, 1.0, -2.0, 0.0, 3.0, 0.0];
    let at = |k: usize| DVec3::new((k / 3) as f64, (k % 3) as f64, height[k]);
    let net: Vec<_> = (0..9).map(at).collect();
    let saddle = Surface::new(knots.clone(), knots, &net, None).unwrap();
    let bounds = Patch::from(saddle).bounds();
    assert!((bounds.max.z - 1.5).abs() < 1e-7, "{bounds:?}");
}

#[test]
fn what_cannot_be_integrated_ends() {
    let bezier = |height: f64| {
        let knots = KnotVector::bezier(2, 0.0..1.0).unwrap();
        let place = |k: usize| DVec3::new((k / 3) as f64, (k % 3) as f64, 0.0);
        let mut points: Vec<DVec3> = (0..9).map(place).collect();
        points[4].z = height;
        Surface::new(knots.clone(), knots, &points, None).unwrap()
    };
    assert!(integrals(&bezier(1.0)).area_error() < 1e-9);
    // A needle as high as points may be.
    let needle = integrals(&bezier(0.9 * FARTHEST));
    assert!(needle.area_error() < 0.01 * needle.area());
}

/// A square in the parameter domain.
fn window(from: DVec2, to: DVec2) -> TrimLoop {
    TrimLoop::border(&(from.x..to.x), &(from.y..to.y)).unwrap()
}

#[test]
fn boxes_hold_what_is_extreme_between_pieces_and_on_seams() {
    // A part of a ring with a hole: its largest circle is farthest out on the seam and on borders of pieces.
    let (u, v) = (0.0..TAU, -1.3..0.9);
    let ring = modelling::torus(&Frame::WORLD, 3.0, 1.0, u.clone(), v.clone()).unwrap();
    let mut ring = Patch::from(ring);
    ring.loops = vec![
        TrimLoop::border(&u, &v).unwrap(),
        window(DVec2::new(0.3, 0.2), DVec2::new(0.5, 0.4)),
    ];
    let bounds = ring.bounds();
    let [low, high] = [-1.3_f64, 0.9].map(f64::sin);
    assert!(
        bounds.max.distance(DVec3::new(4.0, 4.0, high)) < 1e-6,
        "{bounds:?}"
    );
    assert!(
        bounds.min.distance(DVec3::new(-4.0, -4.0, low)) < 1e-6,
        "{bounds:?}"
    );
}

#[test]
fn boxes_hold_what_is_extreme_where_one_line_of_a_loop_crosses_many_pieces() {
    for count in [41, 60, 83] {
        let knots = KnotVector::clamped_uniform(3, count, 0.0..1.0).unwrap();
        let line = KnotVector::bezier(1, 0.0..1.0).unwrap();
        // Waves that are not alike, over a strip that becomes higher to one side.
        let height = |i: usize| (1.9 * i as f64).sin() * (1.0 + 0.3 * (0.7 * i as f64).cos());
        let point = |k: usize| {
            let (i, j) = (k / 2, (k % 2) as f64);
            DVec3::new(i as f64, j, height(i) + j)
        };
        let points: Vec<DVec3> = (0..2 * count).map(point).collect();
        let strip = Surface::new(knots, line, &points, None).unwrap();
        let highest = (0..=200_000)
            .map(|k| 0.03 + 0.94 * f64::from(k) / 200_000.0)
            .map(|u| strip.evaluate(DVec2::new(u, 0.9)).z)
            .fold(f64::NEG_INFINITY, f64::max);
        let mut strip = Patch::from(strip);
        strip.loops = vec![window(DVec2::new(0.03, 0.1), DVec2::new(0.97, 0.9))];
        let found = strip.bounds().max.z;
        assert!((found - highest).abs() < 1e-6, "{count}: {found} {highest}");
    }
}

#[test]
fn heavy_weights_cost_no_digits() {
    // A ridge along v, in the plane: its weights do not change its place.
    let heavy = |weight: f64| {
        let [u, v] = [2, 1].map(|degree| KnotVector::bezier(degree, 0.0..1.0).unwrap());
        let place = |k: usize| DVec3::new((k / 2) as f64, (k % 2) as f64 * 3.0, 0.0);
        let points: Vec<DVec3> = (0..6).map(place).collect();
        let weights = [1.0, 1.0, weight, weight, 1.0, 1.0];
        integrals(&Surface::new(u, v, &points, Some(&weights)).unwrap())
    };
    let found = heavy(1e6);
    assert!((found.area() - 6.0).abs() < 1e-9, "{}", found.area());
    assert!(found.area_error() < 1e-9, "{}", found.area_error());
}

#[test]
fn weights_far_apart_leave_a_rectangle_as_large_as_it_is() {
    let (light, heavy) = (4e-4, 2500.0);
    for weights in [
        [light, heavy, heavy, light, heavy, light],
        [light, light, heavy, heavy, heavy, light],
        [light, heavy, light, light, light, heavy],
    ] {
        let [u, v] = [2, 1].map(|degree| KnotVector::bezier(degree, 0.0..1.0).unwrap());
        let points = [0.0, 1.0, 2.0]
            .map(|x| [0.0, 1.0].map(|y| DVec3::new(x, y, 0.0)))
            .concat();
        let found = integrals(&Surface::new(u, v, &points, Some(&weights)).unwrap());
        let off = (found.normal().z - 2.0).abs();
        assert!(
            off < 1e-9 && found.area_error() < 1e-6,
            "{weights:?}: {off:e}"
        );
        assert!(found.area() > 2.0 - 1e-9, "{weights:?}: {}", found.area());
    }
}

#[test]
fn thin_bands_are_as_large_as_they_are() {
    let cylinder = modelling::cylinder(&Frame::WORLD, 1.0, 0.0..TAU, 0.0..1000.0).unwrap();
    for width in [1.0, 1e-3, 1e-6] {
        let (low, high) = (333.3, 333.3 + width);
        let mut band = Patch::from(cylinder.clone());
        band.loops = vec![TrimLoop::border(&(0.0..TAU), &(low..high)).unwrap()];
        let found = Integrals::of(&band, DVec3::ZERO);
        let off = (found.area() - TAU * (high - low)).abs();
        assert!(
            off <= found.area_error(),
            "{width} {off} {}",
            found.area_error()
        );
        assert!(found.area_error() < 1e-9, "{width} {}", found.area_error());
    }
}

#[test]
fn errors_of_what_is_cut_off_along_parameters_hold() {
    let torus = modelling::torus(&Frame::WORLD, 3.0, 1.0, 0.0..TAU, 0.0..TAU).unwrap();
    for degrees in 1..90 {
        let v = modelling::arc_parameter(torus.knots_v(), f64::from(degrees).to_radians());
        let end = torus.evaluate(DVec2::new(0.0, v));
        let angle = end.z.atan2(end.x - 3.0);
        let mut part = Patch::from(torus.clone());
        part.loops = vec![TrimLoop::border(&(0.0..TAU), &(0.0..v)).unwrap()];
        let found = Integrals::of(&part, DVec3::ZERO);
        let area = TAU * (3.0 * angle + angle.sin());
        let off = (found.area() - area).abs();
        let rounding = 4.0 * f64::EPSILON * area;
        assert!(
            off <= found.area_error() + rounding,
            "{degrees} {off} {}",
            found.area_error()
        );
        assert!(off < 1e-14 * 60.0, "{degrees} {off}");
    }
}
