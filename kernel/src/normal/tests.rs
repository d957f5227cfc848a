use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use glam::{DAffine3, DMat3, DVec2, DVec3};

use crate::modelling::{Frame, cone, sphere};
use crate::{KnotVector, Surface, moved_normal};

/// A Bézier patch over the unit square from rows of points along v.
fn patch<const N: usize>(rows: &[[DVec3; N]]) -> Surface {
    let knots = |degree| KnotVector::bezier(degree, 0.0..1.0).unwrap();
    let (knots_u, knots_v) = (knots(rows.len() - 1), knots(N - 1));
    Surface::new(knots_u, knots_v, rows.as_flattened(), None).unwrap()
}

fn p(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// The normal at `uv`, after a check that it is the limit of those on the way from `inside`.
fn checked(surface: &Surface, uv: DVec2, inside: DVec2) -> DVec3 {
    let normal = surface.normal(uv).unwrap();
    let mut before = f64::INFINITY;
    for step in [1e-2, 1e-3, 1e-4] {
        let d = surface.derivatives(uv.lerp(inside, step));
        let distance = normal.distance(d.du.cross(d.dv).normalize());
        assert!(
            distance < 20.0 * step && distance <= before + 1e-9,
            "{uv} {distance}"
        );
        before = distance;
    }
    normal
}

fn orientations(surface: &Surface) -> [(Surface, f64); 4] {
    [
        (surface.clone(), 1.0),
        (surface.transposed(), -1.0),
        (surface.reversed_v(), -1.0),
        (surface.reversed_v().transposed(), 1.0),
    ]
}

#[test]
fn poles_of_a_rational_sphere_look_along_the_axis() {
    for scale in [1e-6, 1.0, 1e6] {
        for origin in [DVec3::ZERO, p(3.0, -20.0, 100.0) * scale] {
            let frame = Frame::new(origin, DVec3::Z, DVec3::X).unwrap();
            let ball = sphere(&frame, scale, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2).unwrap();
            for (ball, sign) in orientations(&ball) {
                let (us, vs) = (ball.knots_u().domain(), ball.knots_v().domain());
                for s in [0.0, 0.1, 0.25, 0.7, 1.0] {
                    for t in [0.0, 1.0] {
                        let at = |x: f64, y: f64| {
                            DVec2::new(
                                us.start + (us.end - us.start) * x,
                                vs.start + (vs.end - vs.start) * y,
                            )
                        };
                        let turned = (us.end - us.start) < 4.0;
                        let uv = if turned { at(t, s) } else { at(s, t) };
                        let normal = ball.normal(uv).unwrap();
                        let outwards = (ball.evaluate(uv) - origin) / scale;
                        let accuracy = if origin == DVec3::ZERO { 1e-12 } else { 1e-11 };
                        assert!(
                            normal.distance(outwards * sign) < accuracy,
                            "{scale} {origin} {uv} {}",
                            normal.distance(outwards * sign)
                        );
                    }
                }
            }
        }
    }
}

/// Mirrored, scaled unevenly, far too large, and flattened.
#[test]
fn a_moved_normal_is_that_of_the_moved_surface() {
    let ball = sphere(
        &Frame::about(p(1.0, 2.0, 3.0), DVec3::Z).unwrap(),
        1.0,
        0.0..TAU,
        -FRAC_PI_2..FRAC_PI_2,
    )
    .unwrap();
    let skew = DMat3::from_cols(p(2.0, 0.3, 0.0), p(0.0, -0.5, 0.1), p(0.7, 0.0, 1.0));
    let flat = DMat3::from_diagonal(p(1.0, 2.0, 0.0));
    for matrix in [DMat3::IDENTITY, skew, -skew, skew * 1e30, flat] {
        let map = DAffine3::from_mat3_translation(matrix, p(-1.0, 0.0, 5.0));
        let moved = ball.transformed(&map);
        for u in [0.1, 0.3, 0.55] {
            for v in [0.0, 0.2, 0.7, 1.0] {
                let domains = [ball.knots_u(), ball.knots_v()].map(KnotVector::domain);
                let share =
                    |k: usize, x: f64| domains[k].start + (domains[k].end - domains[k].start) * x;
                let uv = DVec2::new(share(0, u), share(1, v));
                let normal = moved_normal(ball.normal(uv).unwrap(), &map).unwrap();
                assert!(
                    normal.distance(moved.normal(uv).unwrap()) < 1e-11,
                    "{matrix} {uv}"
                );
            }
        }
    }
    let line = DAffine3::from_scale(p(1.0, 0.0, 0.0));
    assert_eq!(moved_normal(DVec3::Z, &line), None);
    assert_eq!(
        moved_normal(DVec3::Z, &DAffine3::from_scale(DVec3::ZERO)),
        None
    );
}

#[test]
fn normals_stay_exact_on_the_way_to_a_pole() {
    let ball = sphere(&Frame::WORLD, 1.0, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2).unwrap();
    for power in 1..20 {
        let uv = DVec2::new(0.3, FRAC_PI_2 - 10.0_f64.powi(-power));
        let distance = ball.normal(uv).unwrap().distance(ball.evaluate(uv));
        assert!(distance < 2e-7, "{power} {distance:e}");
    }
}

#[test]
fn an_apex_has_the_normal_of_its_meridian() {
    let cup = cone(&Frame::WORLD, 1.0, FRAC_PI_4, 0.0..TAU, -1.0..1.0).unwrap();
    for (cup, sign) in orientations(&cup) {
        let vertical = cup.knots_v().domain();
        for i in 0..=16 {
            let angle = TAU * f64::from(i) / 16.0;
            let apex = [cup.knots_u().domain(), vertical.clone()].map(|range| range.end < 4.0);
            let uv = |h: f64| {
                if apex[0] {
                    DVec2::new(h, angle)
                } else {
                    DVec2::new(angle, h)
                }
            };
            for h in [-1.0, 1.0] {
                let (at, above) = (uv(h), uv(h * 0.5));
                let expected = cup.normal(above).unwrap();
                let normal = cup.normal(at).unwrap();
                assert!(
                    normal.distance(expected) < 1e-12,
                    "{at} {normal} {expected}"
                );
                let outwards = cup.evaluate(above).with_z(-1.0).dot(normal) * sign;
                assert!(outwards > 0.0 || h < 0.0);
            }
        }
    }
}

#[test]
fn collapsed_edges_have_the_normal_of_their_surroundings() {
    // The inner edge of a lid is a single point, with a horizontal tangent.
    let top = p(0.0, 0.0, 3.0);
    let rows = [
        [top, p(0.8, 0.0, 3.0), p(0.0, 0.0, 2.7), p(1.3, 0.0, 2.4)],
        [top, p(0.8, 0.45, 3.0), p(0.0, 0.0, 2.7), p(1.3, 0.728, 2.4)],
        [top, p(0.45, 0.8, 3.0), p(0.0, 0.0, 2.7), p(0.728, 1.3, 2.4)],
        [top, p(0.0, 0.8, 3.0), p(0.0, 0.0, 2.7), p(0.0, 1.3, 2.4)],
    ];
    for (lid, sign) in orientations(&patch(&rows)) {
        for s in [0.0, 0.3, 1.0] {
            let places = [
                DVec2::new(s, 0.0),
                DVec2::new(s, 1.0),
                DVec2::new(0.0, s),
                DVec2::new(1.0, s),
            ];
            let at_top = |uv: &&DVec2| lid.evaluate(**uv) == top;
            let uv = *places.iter().find(at_top).unwrap();
            let normal = checked(&lid, uv, uv.lerp(DVec2::splat(0.5), 1.0));
            assert!(normal.distance(-DVec3::Z * sign) < 1e-12, "{normal}");
        }
    }
}

#[test]
fn an_edge_that_starts_slowly_has_a_normal() {
    // Two equal control rows: du x dv vanishes to higher order.
    let row = |z: f64| [p(0.0, 0.0, z), p(1.0, 0.0, z + 1.0), p(2.0, 0.0, z)];
    let moved = |row: [DVec3; 3], y: f64| row.map(|q| q.with_y(y));
    let slow = patch(&[
        row(0.0),
        row(0.0),
        moved(row(1.0), 1.0),
        moved(row(1.0), 3.0),
    ]);
    for (slow, _) in orientations(&slow) {
        for s in [0.0, 0.5, 1.0] {
            for uv in [DVec2::new(0.0, s), DVec2::new(s, 0.0), DVec2::new(s, 1.0)] {
                checked(&slow, uv, DVec2::splat(0.5));
            }
        }
    }
}

#[test]
fn corners_with_parallel_edges_have_a_normal() {
    let smooth = patch(&[
        [p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(2.0, 1.0, 1.0)],
        [p(-1.0, 0.0, 0.0), p(0.0, 1.0, 0.0), p(2.0, 2.0, 0.0)],
        [p(-2.0, 1.0, 1.0), p(-1.0, 2.0, 0.0), p(0.0, 3.0, 0.0)],
    ]);
    let normal = smooth.normal(DVec2::ZERO).unwrap();
    assert!(normal.is_normalized());
    let d = smooth.derivatives(DVec2::new(0.0, 1e-5));
    assert!(normal.distance(d.du.cross(d.dv).normalize()) < 1e-4);
}

#[test]
fn two_collapsed_edges_that_meet_have_a_normal() {
    // S = (u^2 v, u v^2, u v + u^2 v^2): both edges through the origin are one point.
    let corner = DVec3::ZERO;
    let cusp = patch(&[
        [corner, corner, corner],
        [corner, p(0.0, 0.0, 0.25), p(0.0, 0.5, 0.5)],
        [corner, p(0.5, 0.0, 0.5), p(1.0, 1.0, 2.0)],
    ]);
    for (cusp, _) in orientations(&cusp) {
        for uv in [DVec2::ZERO, DVec2::X, DVec2::Y] {
            if cusp.evaluate(uv) == corner
                && cusp.evaluate(uv.lerp(DVec2::splat(0.5), 0.1)) != corner
            {
                let normal = cusp.normal(uv).unwrap();
                let d = cusp.derivatives(uv.lerp(DVec2::splat(0.5), 1e-4));
                assert!(normal.distance(d.du.cross(d.dv).normalize()) < 1e-3, "{uv}");
            }
        }
    }
}

#[test]
fn a_cusp_far_from_the_origin_has_a_normal() {
    // S = off + (u^2 + v^2, u v, 0) / 3: flat, and both derivatives vanish at the corner.
    let off = p(1.0, 100.0, 1000.0) / 3.0;
    let point = |x: f64, y: f64| off + p(x, y, 0.0) / 3.0;
    let fan = patch(&[
        [point(0.0, 0.0), point(0.0, 0.0), point(1.0, 0.0)],
        [point(0.0, 0.0), point(0.0, 0.25), point(1.0, 0.5)],
        [point(1.0, 0.0), point(1.0, 0.5), point(2.0, 1.0)],
    ]);
    for (fan, _) in orientations(&fan) {
        let corners = [DVec2::ZERO, DVec2::X, DVec2::Y];
        let at_cusp = |uv: &&DVec2| fan.evaluate(**uv).distance(off) < 1e-9;
        let uv = *corners.iter().find(at_cusp).unwrap();
        // du x dv = (0, 0, 2 (u^2 - v^2)) / 9: the side depends on the way, the line does not.
        let normal = fan.normal(uv).unwrap();
        let near = fan.normal(uv.lerp(DVec2::splat(0.5), 0.1)).unwrap();
        assert!(
            normal.z.abs() > 1.0 - 1e-9 && near.z.abs() > 1.0 - 1e-9,
            "{normal}"
        );
    }
}

#[test]
fn a_crease_has_the_normal_of_the_span_to_its_right() {
    // du vanishes on the middle line, where the surface turns back.
    let knots_u = KnotVector::new(2, vec![0., 0., 0., 1., 1., 2., 2., 2.]).unwrap();
    let knots_v = KnotVector::bezier(1, 0.0..1.0).unwrap();
    let line = [
        p(0., 0., 0.),
        p(1., 0., 0.),
        p(2., 0., 1.),
        p(2., 0., 1.),
        p(3., 0., 3.),
    ];
    let points: Vec<_> = line.iter().flat_map(|&q| [q, q + DVec3::Y]).collect();
    let crease = Surface::new(knots_u, knots_v, &points, None).unwrap();
    let normal = checked(&crease, DVec2::new(1.0, 0.5), DVec2::new(2.0, 0.5));
    assert!(normal.distance(p(-2.0, 0.0, 1.0).normalize()) < 1e-12);
}

#[test]
fn surfaces_without_area_have_no_normal() {
    let point = patch(&[[DVec3::ONE; 3]; 3]);
    let line = patch(&[
        [DVec3::ZERO, DVec3::ONE],
        [DVec3::ONE * 0.3, DVec3::ONE * 0.7],
    ]);
    let off = DVec3::splat(1e6 / 3.0);
    let wire = patch(&[[off, off + DVec3::X / 3.0, off + DVec3::X / 7.0]; 4]);
    let speck = patch(&[[off; 4]; 3]);
    for surface in [point, line, wire, speck] {
        for uv in [DVec2::ZERO, DVec2::new(0.3, 0.7), DVec2::X, DVec2::ONE] {
            assert_eq!(surface.normal(uv), None);
        }
    }
}

#[test]
fn every_degree_has_poles() {
    for degree in 1..=28 {
        let frame = Frame::new(p(1.0, 2.0, 3.0), p(1.0, 1.0, 1.0), DVec3::X).unwrap();
        let ball = sphere(&frame, 1.0, 0.0..1.5, 0.0..FRAC_PI_2).unwrap();
        let ball = ball.elevated_u(degree + 2).unwrap();
        let ball = ball.elevated_v(degree + 2).unwrap();
        let normal = ball.normal(DVec2::new(0.4, FRAC_PI_2)).unwrap();
        assert!(
            normal.distance(frame.z()) < 1e-11,
            "{degree} {:e}",
            normal.distance(frame.z())
        );
    }
}
