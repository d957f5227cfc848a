use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_4, PI, TAU};
use std::ops::Range;

use glam::{DVec2, DVec3};

use super::*;
use crate::{Curve, KnotVector, Surface};

fn frame() -> Frame {
    let (origin, axis) = (DVec3::new(3.0, -2.0, 0.5), DVec3::new(1.0, 2.0, -2.0));
    Frame::new(origin, axis, DVec3::new(1.0, 1.0, 4.0)).unwrap()
}

/// Coordinates in a frame.
fn local(frame: &Frame, point: DVec3) -> DVec3 {
    let d = point - frame.origin();
    DVec3::new(d.dot(frame.x()), d.dot(frame.y()), d.dot(frame.z()))
}

fn samples(range: Range<f64>) -> impl Iterator<Item = f64> {
    (0..=24).map(move |i| {
        let t = f64::from(i) / 24.0;
        range.start * (1.0 - t) + range.end * t
    })
}

/// Calls `check` with point and normal at many parameters.
fn walk(surface: &Surface, mut check: impl FnMut(DVec2, DVec3, DVec3)) {
    for u in samples(surface.knots_u().domain()) {
        for v in samples(surface.knots_v().domain()) {
            let uv = DVec2::new(u, v);
            check(uv, surface.evaluate(uv), surface.normal(uv).unwrap());
        }
    }
}

#[test]
fn arcs_lie_on_the_circle_and_reach_their_angles() {
    let f = frame();
    for (start, end) in [
        (0.0, TAU),
        (0.3, 0.3 + TAU),
        (-1.0, 0.2),
        (-PI, FRAC_PI_2),
        (0.0, 6.283_185_5),
        (5.0, 5.0 + FRAC_PI_2),
        (0.0, 1e-6),
    ] {
        let curve = arc(f.origin(), f.x() * 2.5, f.y() * 2.5, start..end).unwrap();
        assert_eq!(curve.domain(), start..end);
        for t in samples(start..end) {
            let p = local(&f, curve.evaluate(arc_parameter(curve.knots(), t)));
            assert!((p.truncate().length() - 2.5).abs() < 4e-15 && p.z.abs() < 4e-15);
            let expected = DVec2::from_angle(t) * 2.5;
            let rounding = if end - start > TAU { 1e-6 } else { 1e-14 };
            assert!(p.truncate().distance(expected) < rounding, "{t}");
        }
    }
}

#[test]
fn a_full_circle_is_closed_and_its_quarters_are_exact() {
    let curve = circle(&Frame::WORLD, 2.0).unwrap();
    assert_eq!(curve.points().nth(2), Some(DVec3::Y * 2.0));
    assert_eq!(curve.points().nth(3), Some(DVec3::new(-2.0, 2.0, 0.0)));
    assert_eq!(curve.start(), curve.end());
    let anywhere = arc(DVec3::ZERO, DVec3::X, DVec3::Y, 0.7..0.7 + TAU).unwrap();
    assert_eq!(anywhere.start(), anywhere.end());
}

#[test]
fn an_arc_of_two_radii_is_an_ellipse() {
    let curve = arc(DVec3::ZERO, DVec3::X * 3.0, DVec3::Y, 0.4..4.0).unwrap();
    for t in samples(0.4..4.0) {
        let p = curve.evaluate(t);
        assert!(((p.x / 3.0).powi(2) + p.y.powi(2) - 1.0).abs() < 1e-14);
    }
}

#[test]
fn planes_are_flat_and_face_the_product_of_their_edges() {
    let (a, b) = (DVec3::new(1.0, 2.0, 0.0), DVec3::new(0.0, 1.0, 3.0));
    let surface = plane(DVec3::ONE, a, b, 0.0..2.0, -1.0..1.0).unwrap();
    assert_eq!(surface.evaluate(DVec2::new(2.0, -1.0)), DVec3::ONE + a);
    walk(&surface, |_, p, n| {
        assert!((p - DVec3::ONE).dot(n).abs() < 1e-15);
        assert!(n.distance(a.cross(b).normalize()) < 1e-15);
    });
}

#[test]
fn cylinders_agree_with_their_formula() {
    let f = frame();
    for angles in [0.0..TAU, 0.1..1.9, -FRAC_PI_2..PI] {
        let surface = cylinder(&f, 2.0, angles.clone(), -1.0..3.0).unwrap();
        assert_eq!(surface.knots_u().domain(), angles);
        walk(&surface, |uv, p, n| {
            let q = local(&f, p);
            assert!((q.truncate().length() - 2.0).abs() < 2e-14);
            assert!((q.z - uv.y).abs() < 2e-14);
            let outwards = f.x() * q.x + f.y() * q.y;
            assert!(n.distance(outwards * 0.5) < 1e-13);
        });
    }
}

#[test]
fn cones_agree_with_their_formula_up_to_the_apex() {
    let f = frame();
    for (half_angle, heights) in [
        (FRAC_PI_4, -2.0..1.0),
        (FRAC_PI_3, 0.0..5.0),
        (-0.5, 0.0..1.0),
        (FRAC_PI_4, -2.0..-1.0),
    ] {
        let (slope, turn) = (half_angle.tan(), 0.0..TAU);
        let surface = cone(&f, 2.0, half_angle, turn, heights).unwrap();
        walk(&surface, |uv, p, n| {
            let q = local(&f, p);
            assert!((q.truncate().length() - (2.0 + uv.y * slope)).abs() < 2e-14);
            assert!((q.z - uv.y).abs() < 2e-14);
            // Along the apex the angle is that of the meridian.
            let knots = surface.knots_u();
            let middle = knots.span(uv.x);
            let at_knot = (knots.as_slice()[middle] - uv.x).abs() < 1e-15 || uv.x > TAU - 1e-9;
            let around = if q.truncate().length() > 1e-9 {
                q.truncate().normalize()
            } else if at_knot {
                DVec2::from_angle(uv.x)
            } else {
                return;
            };
            let outwards = f.x() * around.x + f.y() * around.y - f.z() * slope;
            assert!(n.distance(outwards.normalize()) < 1e-12, "{uv} {n}");
        });
    }
    let beyond = cone(&f, 2.0, FRAC_PI_4, 0.0..TAU, -2.1..1.0);
    assert!(matches!(beyond, Err(Error::NotPositive { .. })));
}

#[test]
fn spheres_agree_with_their_formula_and_have_poles_on_the_axis() {
    let f = frame();
    for (longitudes, latitudes) in [
        (0.0..TAU, -FRAC_PI_2..FRAC_PI_2),
        (-1.0..2.0, -0.3..1.2),
        (0.2..0.9, 0.0..FRAC_PI_2),
    ] {
        let surface = sphere(&f, 2.5, longitudes, latitudes.clone()).unwrap();
        walk(&surface, |uv, p, n| {
            let d = p - f.origin();
            assert!((d.length() - 2.5).abs() < 1e-14);
            assert!(n.distance(d / 2.5) < 1e-12, "{uv} {n}");
            let v = arc_parameter(surface.knots_v(), uv.y);
            let q = surface.evaluate(DVec2::new(uv.x, v));
            assert!((local(&f, q).z - 2.5 * uv.y.sin()).abs() < 1e-14);
        });
        if latitudes.end > 1.5 {
            let top = f.origin() + f.z() * 2.5;
            let last = surface.knots_v().count() - 1;
            let row = surface.points().skip(last).step_by(last + 1);
            assert!(row.into_iter().all(|p| p.distance(top) < 1e-15));
        }
    }
}

#[test]
fn tori_agree_with_their_formula() {
    let f = frame();
    for (angles, tube) in [(0.0..TAU, 0.0..TAU), (0.5..2.0, -1.0..FRAC_PI_2)] {
        let surface = torus(&f, 3.0, 1.0, angles, tube).unwrap();
        walk(&surface, |_, p, n| {
            let q = local(&f, p);
            let ring = q.truncate().normalize() * 3.0;
            let middle = f.origin() + f.x() * ring.x + f.y() * ring.y;
            assert!(((p - middle).length() - 1.0).abs() < 1e-14);
            assert!(n.distance(p - middle) < 1e-13);
        });
    }
}

#[test]
fn revolved_lines_are_cylinder_cone_and_hyperboloid() {
    let (point, axis) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.0, 3.0, 4.0));
    let f = Frame::new(point, axis, DVec3::X).unwrap();
    let place = |q: DVec3| point + f.x() * q.x + f.y() * q.y + f.z() * q.z;
    for (a, b) in [
        (DVec3::new(2.0, 0.0, -1.0), DVec3::new(2.0, 0.0, 4.0)),
        (DVec3::new(2.0, 0.0, -1.0), DVec3::new(0.0, 0.0, 4.0)),
        (DVec3::new(2.0, 0.0, -1.0), DVec3::new(-1.0, 2.0, 4.0)),
    ] {
        let line = Curve::line(place(a), place(b), 5.0..7.0).unwrap();
        for angles in [0.0..TAU, 0.5..2.0] {
            let surface = revolve(&line, point, axis, angles.clone()).unwrap();
            assert_eq!(surface.knots_u().domain(), 5.0..7.0);
            assert_eq!(surface.knots_v().domain(), angles);
            walk(&surface, |uv, p, _| {
                let (q, from) = (local(&f, p), a.lerp(b, (uv.x - 5.0) / 2.0));
                assert!((q.z - from.z).abs() < 1e-14);
                assert!((q.truncate().length() - from.truncate().length()).abs() < 1e-14);
            });
            for u in [5.0, 5.5, 7.0] {
                let uv = DVec2::new(u, angles.end);
                let (q, from) = (local(&f, surface.evaluate(uv)), a.lerp(b, (u - 5.0) / 2.0));
                let turned = DVec2::from_angle(angles.end).rotate(from.truncate());
                assert!(q.truncate().distance(turned) < 1e-14);
            }
        }
    }
}

#[test]
fn points_on_the_axis_stay_there() {
    let half = arc(DVec3::ZERO, -DVec3::Y, DVec3::X, 0.0..PI).unwrap();
    let ball = revolve(&half, DVec3::Y * 7.0, DVec3::Y, 0.0..TAU).unwrap();
    let rows: Vec<_> = ball.points().collect();
    let count = ball.knots_v().count();
    assert!(rows[..count].iter().all(|&p| p == -DVec3::Y));
    assert!(rows[rows.len() - count..].iter().all(|&p| p == DVec3::Y));
    walk(&ball, |_, p, n| {
        assert!(n.distance(-p) < 1e-12 || n.distance(p) < 1e-12);
    });
}

#[test]
fn extrusions_move_the_curve() {
    let f = frame();
    let curve = arc(f.origin(), f.x(), f.y() * 2.0, 0.0..4.0).unwrap();
    let surface = extrude(&curve, DVec3::new(1.0, 0.0, 5.0)).unwrap();
    walk(&surface, |uv, p, _| {
        let expected = curve.evaluate(uv.x) + DVec3::new(1.0, 0.0, 5.0) * uv.y;
        assert!(p.distance(expected) < 1e-14);
    });
    assert_eq!(extrude(&curve, DVec3::ZERO), Err(Error::NoDirection));
}

#[test]
fn ruled_surfaces_join_different_curves() {
    let a = arc(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0..4.0).unwrap();
    let knots = KnotVector::new(3, vec![0.0, 1.0, 2.0, 3.0, 4.0, 4.0, 6.0, 7.0, 8.0]).unwrap();
    let points: Vec<_> = (0..5)
        .map(|i| DVec3::new(f64::from(i), f64::from(i * i % 3), 2.0))
        .collect();
    let b = Curve::new(knots, &points, None).unwrap();
    let surface = ruled(&a, &b).unwrap();
    assert_eq!(surface.knots_u().domain(), a.domain());
    let moved = b.remapped(a.domain()).unwrap();
    for u in samples(a.domain()) {
        let (start, end) = (a.evaluate(u), moved.evaluate(u));
        assert!(surface.evaluate(DVec2::new(u, 0.0)).distance(start) < 1e-14);
        assert!(surface.evaluate(DVec2::new(u, 1.0)).distance(end) < 1e-14);
        let between = surface.evaluate(DVec2::new(u, 0.3)) - start;
        assert!(between.cross((end - start).normalize()).length() < 1e-14);
    }
}

#[test]
fn rails_of_equal_weights_are_joined_by_their_points() {
    let quarter = arc(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0..FRAC_PI_2).unwrap();
    let half = arc(DVec3::Z, DVec3::X * 2.0, DVec3::Y, 0.0..2.5).unwrap();
    let line = Curve::line(DVec3::Z, DVec3::new(1.0, 2.0, 3.0), 0.0..1.0).unwrap();
    let heavy = quarter.homogeneous().iter().map(|&h| h * 3.0).collect();
    let heavy = Curve::trusted((quarter.knots().clone(), heavy));
    for (a, b, degree) in [
        (&quarter, &half, 4),
        (&half, &quarter, 4),
        (&line, &half, 3),
        (&quarter, &line, 3),
        (&quarter, &heavy, 2),
    ] {
        let [one, other] = with_equal_weights(a, b).unwrap();
        let surface = ruled(&one, &other).unwrap();
        assert_eq!(surface.knots_u().degree(), degree);
        let moved = b.remapped(a.domain()).unwrap();
        for (u, v) in samples(a.domain()).flat_map(|u| samples(0.0..1.0).map(move |v| (u, v))) {
            let expected = a.evaluate(u).lerp(moved.evaluate(u), v);
            let found = surface.evaluate(DVec2::new(u, v));
            assert!(found.distance(expected) < 1e-13, "{u} {v}: {found}");
        }
    }
}

#[test]
fn rails_with_rounded_knots_get_no_slivers() {
    let at = |s: f64| vec![0.0, 0.0, 0.1 * s, 0.2 * s, 0.3 * s, 0.7 * s, s, s];
    let rail = |s: f64, z: f64| {
        let knots = KnotVector::new(1, at(s)).unwrap();
        let points: Vec<_> = (0..6).map(|i| DVec3::new(f64::from(i), 0.0, z)).collect();
        Curve::new(knots, &points, None).unwrap()
    };
    let surface = ruled(&rail(1.0, 0.0), &rail(3.7, 1.0)).unwrap();
    assert_eq!(surface.knots_u().as_slice(), at(1.0));
    walk(&surface, |uv, p, _| assert!((p.z - uv.y).abs() < 1e-15));
}

/// The definition of a swept surface, from the derivatives of its trajectory.
fn carried(section: &Curve<DVec2>, trajectory: &Curve<DVec3>, u: f64, v: f64) -> DVec3 {
    let along = trajectory.derivatives(v);
    let y = along.first.normalize();
    let z = along.first.cross(along.second).normalize();
    let c = section.evaluate(u);
    along.point + y.cross(z) * c.x + z * c.y
}

#[test]
fn swept_surfaces_are_what_their_definition_says() {
    let section = [(0.3, -0.1), (0.5, 0.4), (-0.2, 0.3), (-0.4, -0.2)].map(DVec2::from);
    let knots = KnotVector::clamped_uniform(2, 4, 0.0..1.0).unwrap();
    let section = Curve::new(knots, &section, Some(&[1.0, 0.5, 2.0, 1.0])).unwrap();
    // Turns of a screw, polynomial and rational, without a place where it is straight.
    let turn = |i: i32| {
        let angle = f64::from(i) * 0.9;
        DVec3::new(2.0 * angle.cos(), 0.5 * angle, 2.0 * angle.sin())
    };
    let points: Vec<_> = (0..9).map(turn).collect();
    let weights: Vec<_> = (0..9).map(|i| 1.0 + f64::from(i % 3) * 0.25).collect();
    for (degree, weights) in [(3, None), (3, Some(&weights[..])), (5, None)] {
        let knots = KnotVector::clamped_uniform(degree, points.len(), 0.0..4.0).unwrap();
        let trajectory = Curve::new(knots, &points, weights).unwrap();
        let swept = swept(&section, &trajectory, 1e-9).unwrap();
        assert!(swept.accuracy <= 1e-9, "{}", swept.accuracy);
        let mut most = 0.0_f64;
        for surface in &swept.surfaces {
            let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
            for i in 0..=20 {
                for j in 0..=200 {
                    let at = |r: &Range<f64>, i: i32, n: i32| {
                        r.start + (r.end - r.start) * f64::from(i) / f64::from(n)
                    };
                    let uv = DVec2::new(at(&u, i, 20), at(&v, j, 200));
                    let expected = carried(&section, &trajectory, uv.x, uv.y);
                    most = most.max(surface.evaluate(uv).distance(expected));
                }
            }
        }
        println!(
            "degree {degree}: {} surfaces, {most:e}",
            swept.surfaces.len()
        );
        assert!(most < 1e-9, "degree {degree}: {most:e}");
    }
}

#[test]
fn swung_surfaces_are_products_that_can_be_computed_with() {
    let line = |scale: f64| Curve::polyline(&[DVec2::ONE * scale, DVec2::new(2.0, 1.0) * scale]);
    let of = |a: f64, b: f64| swung(&line(a).unwrap(), &line(b).unwrap());
    let middle = of(1.0, 3.0).unwrap().evaluate(DVec2::splat(0.5));
    assert!(middle.distance(DVec3::new(6.75, 1.0, 4.5)) < 1e-14);
    assert_eq!(of(1e90, 1e90), Err(Error::NotFinite { index: 0 }));
    assert!(of(1e90, 1e-90).is_ok());
    let weights = [1e-200, 1e-200];
    let points = [DVec2::ONE, DVec2::X];
    let light = Curve::new(
        KnotVector::bezier(1, 0.0..1.0).unwrap(),
        &points,
        Some(&weights),
    );
    let light = light.unwrap();
    let product = Error::Weight {
        index: 0,
        found: 0.0,
    };
    assert_eq!(swung(&light, &light), Err(product));
}

#[test]
fn bad_input_is_named() {
    let f = Frame::WORLD;
    assert_eq!(
        cylinder(&f, -1.0, 0.0..1.0, 0.0..1.0),
        Err(Error::NotPositive { found: -1.0 })
    );
    assert_eq!(
        cylinder(&f, 1.0, 0.0..1.0, 1.0..1.0),
        Err(Error::EmptyDomain {
            start: 1.0,
            end: 1.0
        })
    );
    assert!(matches!(
        sphere(&f, 1.0, 0.0..7.0, -1.0..1.0),
        Err(Error::Parameter { found: 7.0, .. })
    ));
    assert!(matches!(
        sphere(&f, 1.0, 0.0..6.0, -1.0..2.0),
        Err(Error::Parameter { found: 2.0, .. })
    ));
    assert!(cone(&f, 1.0, f64::NAN, 0.0..1.0, 0.0..1.0).is_err());
    assert!(torus(&f, 1.0, f64::INFINITY, 0.0..1.0, 0.0..1.0).is_err());
    assert!(circle(&f, f64::NAN).is_err());
    assert!(arc(DVec3::ZERO, DVec3::X, DVec3::Y, 1.0..f64::NAN).is_err());
    assert!(arc(DVec3::NAN, DVec3::X, DVec3::Y, 0.0..1.0).is_err());
    let parallel = plane(DVec3::ZERO, DVec3::X, DVec3::X, 0.0..1.0, 0.0..1.0);
    assert_eq!(parallel, Err(Error::NoDirection));
    assert_eq!(
        Frame::about(DVec3::ZERO, DVec3::ZERO),
        Err(Error::NoDirection)
    );
    assert_eq!(
        Frame::new(DVec3::ZERO, DVec3::X, DVec3::X),
        Err(Error::NoDirection)
    );
    assert!(Frame::about(DVec3::ZERO, DVec3::X * 1e-200).is_ok());
    assert!(revolve(&circle(&f, 1.0).unwrap(), DVec3::X, DVec3::ZERO, 0.0..1.0).is_err());
}
