//! Cones have no more triangles than they bend.

use super::*;

/// Points of a surface over a rectangle of parameters, so many times so many.
fn grid(surface: &Surface, count: u32) -> impl Iterator<Item = DVec2> + '_ {
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let at = move |i: u32, j: u32| {
        let share = DVec2::new(f64::from(i), f64::from(j)) / f64::from(count);
        DVec2::new(u.start, v.start) + DVec2::new(u.end - u.start, v.end - v.start) * share
    };
    (0..=count).flat_map(move |i| (0..=count).map(move |j| at(i, j)))
}

/// How far a point is from the nearest triangle.
fn distance(face: &FaceMesh, p: DVec3) -> f64 {
    let points = face.mesh.positions();
    let to = |t: &[u32; 3]| {
        let corners = t.map(|k| points[k as usize]);
        crate::compare::triangles::closest(corners, p)
            .point
            .distance(p)
    };
    let distances = face.mesh.triangles().iter().map(to);
    distances.fold(f64::INFINITY, f64::min)
}

/// Asserts that no point of a face, and of its triangles, is farther from the other than is proven.
pub(super) fn assert_near(face: &FaceMesh, patch: &Patch, tolerance: f64) {
    assert!(face.proven <= tolerance && face.unproven == 0);
    assert!(face.sampled <= face.proven);
    let region = patch.region();
    let inside = |uv: &DVec2| region.as_ref().is_none_or(|r| r.contains(*uv));
    for uv in grid(&patch.surface, 60).filter(inside) {
        let found = distance(face, patch.surface.evaluate(uv));
        assert!(found <= face.proven * (1.0 + 1e-9) + 1e-14, "{uv}: {found}");
    }
}

/// The surface of a line that turns about the z axis.
fn turned(from: DVec3, to: DVec3) -> Surface {
    let line = kernel::Curve::line(from, to, 0.0..1.0).unwrap();
    modelling::revolve(&line, DVec3::ZERO, DVec3::Z, 0.0..TAU).unwrap()
}

/// A face of one surface, and its number of triangles.
pub(super) fn made(patch: &Patch, tolerance: f64) -> (FaceMesh, usize) {
    let mut result = with_tolerance_of(vec![patch.clone()], tolerance);
    let face = result.faces.remove(0).unwrap();
    let count = face.mesh.triangles().len();
    (face, count)
}

#[test]
fn a_frustum_has_no_more_triangles_than_steps_along_its_circles() {
    let tolerance = 1e-3;
    let sides = |radius: f64| (TAU / (2.0 * (1.0 - tolerance / radius).acos())).ceil();
    for radius in [0.9, 0.5, 0.1] {
        for height in [0.0, 0.01, 1.0, 100.0] {
            let patch = turned(DVec3::X, DVec3::new(radius, 0.0, height)).into();
            let (face, count) = made(&patch, tolerance);
            assert_near(&face, &patch, tolerance);
            let least = sides(1.0) + sides(radius);
            let share = count as f64 / least;
            assert!(
                (1.0..1.35).contains(&share),
                "{radius} {height}: {count} for {least}"
            );
        }
    }
}

#[test]
fn a_cone_has_a_triangle_for_each_step_along_its_circle() {
    let tolerance = 1e-3;
    let patch = turned(DVec3::X, DVec3::Z).into();
    let (face, count) = made(&patch, tolerance);
    assert_near(&face, &patch, tolerance);
    assert!((70..80).contains(&count), "{count}");
    // Each has the normal in its middle at the apex.
    let points = face.mesh.positions().iter().zip(face.mesh.normals());
    let apex = points.filter(|(p, _)| p.distance(DVec3::Z) < 1e-9);
    assert_eq!(apex.count(), count);
    let normals = face.mesh.normals();
    for t in face.mesh.triangles() {
        let [a, b, c] = t.map(|k| normals[k as usize]);
        let least = a.dot(b).min(b.dot(c)).min(c.dot(a));
        assert!(least > 0.99, "{least}");
    }
}

/// A hole around the middle of the parameters of a surface, in an outline that is all of them.
fn holed(surface: Surface, half: DVec2) -> Patch {
    let mut patch: Patch = surface.into();
    let (u, v) = (
        patch.surface.knots_u().domain(),
        patch.surface.knots_v().domain(),
    );
    let (low, high) = (DVec2::new(u.start, v.start), DVec2::new(u.end, v.end));
    let hole = (0..=8).map(|k| {
        let turn = 0.25 * PI * f64::from(k % 8);
        low.midpoint(high) + half * DVec2::new(turn.cos(), turn.sin())
    });
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]];
    let outline = corners.map(|share| low + (high - low) * DVec2::from_array(share));
    let closed = |points: Vec<DVec2>| {
        let curve = kernel::Curve::polyline(&points).unwrap();
        kernel::TrimLoop::new(vec![curve], 1e-12).unwrap()
    };
    patch.loops = vec![closed(outline.to_vec()), closed(hole.collect())];
    patch
}

#[test]
fn a_hole_in_a_cone_costs_triangles_along_its_border_only() {
    let tolerance = 1e-3;
    for narrow in [0.5, 0.0] {
        let cone = turned(DVec3::X, DVec3::new(narrow, 0.0, 2.0));
        let patch = holed(cone, DVec2::new(0.9, 0.3));
        let (face, count) = made(&patch, tolerance);
        assert_near(&face, &patch, tolerance);
        assert!(count < 400, "{count}");
    }
}

#[test]
fn what_is_thinner_than_the_tolerance_does_not_vanish() {
    let tolerance = 0.1;
    let ring = |axis: DVec3, radius: f64, to: f64| {
        let circle = modelling::arc(axis, DVec3::X * radius, DVec3::Z * radius, 0.0..TAU);
        modelling::revolve(&circle.unwrap(), DVec3::ZERO, DVec3::Z, 0.0..to).unwrap()
    };
    let plane = modelling::plane(DVec3::Z, DVec3::X, DVec3::Y, 0.0..9.0, 0.0..9.0);
    let frame = modelling::Frame::new(DVec3::X * 20.0, DVec3::Z, DVec3::X).unwrap();
    let ball = modelling::sphere(&frame, 0.01, 0.0..TAU, -0.5 * PI..0.5 * PI);
    let surfaces = [
        plane.unwrap(),
        ball.unwrap(),
        ring(DVec3::X * 3.0, 0.02, TAU),
        ring(DVec3::X * -5.0, 0.02, 4.0),
    ];
    let patches: Vec<Patch> = surfaces.into_iter().map(Patch::from).collect();
    let result = with_tolerance_of(patches.clone(), tolerance);
    for (face, patch) in result.faces.iter().zip(&patches) {
        let face = face.as_ref().unwrap();
        assert_near(face, patch, tolerance);
        assert!(face.mesh.triangles().len() < 200);
    }
    let closed = result.shells.iter().filter(|shell| shell.is_closed());
    assert_eq!(closed.count(), 2);
}

#[test]
fn what_is_thin_along_the_border_of_the_domain_does_not_vanish() {
    let corners = [[0.5, 1.0], [0.6, 1.0 - 1e-7], [0.7, 1.0 - 1e-7], [0.8, 1.0]];
    let corners = corners.map(DVec2::from_array);
    let [start, .., end] = corners;
    let knots = kernel::KnotVector::bezier(3, 0.0..1.0).unwrap();
    let bend = kernel::Curve::new(knots, &corners, None).unwrap();
    let back = kernel::Curve::line(end, start, 0.0..1.0).unwrap();
    let square = modelling::plane(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0..1.0, 0.0..1.0);
    let mut patch: Patch = square.unwrap().into();
    patch.loops = vec![kernel::TrimLoop::new(vec![bend, back], 1e-12).unwrap()];
    for tolerance in [1e-3, 1e-6, 1e-8] {
        let result = with_tolerance_of(vec![patch.clone()], tolerance);
        let area = result.shells[0].area;
        assert!((1e-8..1.5001e-8).contains(&area), "{area}");
    }
}
