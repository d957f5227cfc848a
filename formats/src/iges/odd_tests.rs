//! Files that do what few programs do, and what none should.

use glam::DVec3;
use kernel::{Integrals, Scene, WireShape};

use super::testing::{Made, made, part, read, square};

const NONE: [&str; 0] = [];

/// The area of all patches.
fn area(scene: &Scene) -> f64 {
    let of = |patch| Integrals::of(patch, DVec3::ZERO).area();
    scene.patches().iter().map(of).sum()
}

/// The ends of the curves of a scene.
fn ends(scene: &Scene) -> Vec<[DVec3; 2]> {
    let ends = |shape: &WireShape| match shape {
        WireShape::Curve(curve) => [curve.start(), curve.end()],
        WireShape::Points(points) => [points[0], points[points.len() - 1]],
    };
    scene.wires().iter().map(|wire| ends(&wire.shape)).collect()
}

#[test]
fn a_curve_on_a_surface_shows_itself_and_leaves_the_surface() {
    let flat = || part(110, 0, "0.25,0.5,0.,0.75,0.5,0.");
    let space = part(110, 0, "0.,0.5,0.,1.,0.5,0.");
    let (scene, warnings) = read(&[square(0.0), flat(), space, made(142, "1,1,3,5,1")]);
    assert_eq!(warnings, NONE);
    assert_eq!(scene.placement_count(), 1);
    assert!((area(&scene) - 1.0).abs() < 1e-12);
    let middle = |x: f64| DVec3::new(x, 0.5, 0.0);
    assert_eq!(ends(&scene), [[middle(0.0), middle(1.0)]]);
    // A surface that is there for the sake of the curve only is not shown.
    let space = part(110, 0, "0.,0.5,0.,1.,0.5,0.");
    let (scene, warnings) = read(&[
        part(128, 0, &square(0.0).parameters),
        flat(),
        space,
        made(142, "1,1,3,5,1"),
    ]);
    assert_eq!((scene.placement_count(), scene.wires().len()), (0, 1));
    let text = "line 3, surface D1 (type 128): surface is not shown, but a curve on it";
    assert_eq!(warnings[0], text);
    // Without a curve of space, that of the parameters is shown on the surface.
    let (scene, warnings) = read(&[square(2.0), flat(), made(142, "1,1,3,0,1")]);
    assert_eq!(warnings, NONE);
    assert_eq!(scene.placement_count(), 1);
    assert_eq!(ends(&scene), [[middle(2.25), middle(2.75)]]);
}

#[test]
fn what_is_marked_as_no_geometry_is_told_as_such() {
    let other = Made {
        status: "00000500",
        ..square(2.0)
    };
    let (scene, warnings) = read(&[square(0.0), other]);
    assert_eq!(scene.placement_count(), 1);
    let text = "line 5, surface D3 (type 128): surface is not shown, because it is marked as no \
                geometry";
    assert_eq!(warnings, [text]);
}
