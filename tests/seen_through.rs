//! What is seen, and what light passes, through surfaces that are transparent.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use glam::DVec3;
use nurbray::formats::{Limits, NoFiles, ReadOptions, read};
use nurbray::kernel::{Camera, Projection, Scene};
use nurbray::{Accelerator, METHODS, RenderOptions, render};

/// A scene of nothing but what its shapes give off.
fn scene(shapes: &str) -> Scene {
    let text = format!(
        "#X3D V4.0 utf8\nPROFILE Full\nNavigationInfo {{ headlight FALSE }}\n\
         DirectionalLight {{ intensity 0 }}\n{shapes}"
    );
    let limits = Limits::default();
    let options = ReadOptions {
        limits: &limits,
        resolver: &NoFiles,
    };
    read(text.as_bytes(), None, &options).unwrap().scene
}

/// A shape at a place that gives off a colour, `glow`, and is as transparent as given.
fn shape(geometry: &str, at: &str, glow: &str, transparency: f64) -> String {
    format!(
        "Transform {{ translation {at} children Shape {{ geometry {geometry} {{ }}\n\
         appearance Appearance {{ material Material {{ diffuseColor 0 0 0 emissiveColor {glow}\n\
         transparency {transparency} }} }} }} }}\n"
    )
}

/// Its picture from above, each pixel red, green, blue and alpha.
fn picture(shapes: &str) -> Vec<[f32; 4]> {
    let scene = scene(shapes);
    let accelerator = Accelerator::build(&scene, &METHODS[0]);
    let projection = Projection::Orthographic { extent: 1.8 };
    let eye = DVec3::new(0.0, 0.0, 50.0);
    let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, projection).unwrap();
    let options = RenderOptions {
        width: 24,
        height: 24,
        samples: 1,
        ..RenderOptions::default()
    };
    let (film, _) = render(&accelerator, &camera, &options, &|_| {});
    film.colors().to_vec()
}

#[test]
fn nothing_shines_through_what_touches_glass_from_behind() {
    for gap in ["0", "1e-16", "1e-13", "1e-11", "1e-9", "1e-3"] {
        for near in ["Sphere", "Box"] {
            let behind = shape(near, &format!("0 0 -{gap}"), "0 1 0", 0.0);
            let glass = shape(near, "0 0 0", "0 0 1", 0.5);
            let far = shape("Box", "0 0 -20", "1 0 0", 0.0);
            for pixel in picture(&format!("{glass}{behind}{far}")) {
                let [red, green, ..] = pixel;
                let is_beside = near == "Sphere" && red > 0.9;
                assert!(
                    red == 0.0 && green >= 0.5 || is_beside,
                    "{near} {gap}: {pixel:?}"
                );
            }
        }
    }
}

#[test]
fn many_layers_are_seen_through() {
    for (count, transparency) in [(15, 0.95), (16, 0.95), (60, 0.95), (200, 1.0)] {
        let pane = |k: i32| {
            let place = format!("0 0 {}", f64::from(k) * 0.1);
            shape("Rectangle2D", &place, "0 0 0", transparency)
        };
        let panes: String = (0..count).map(pane).collect();
        let wall = shape("Rectangle2D", "0 0 -1", "1 0 0", 0.0);
        let expected = transparency.powi(count);
        for [red, _, _, alpha] in picture(&format!("{panes}{wall}")) {
            assert!(
                (f64::from(red) - expected).abs() < 1e-5,
                "{count}: {red} of {expected}"
            );
            assert!((alpha - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn no_light_passes_what_is_opaque_behind_many_layers() {
    let lit = |panes: i32, is_covered: bool| {
        let pane = |k: i32| shape("Box", &format!("0 {} 0", 10 + 3 * k), "0 0 0", 0.95);
        let mut shapes: String = (0..panes).map(pane).collect();
        if is_covered {
            shapes += &shape("Box", "0 500 0", "0 0 0", 0.0);
        }
        shapes += "DirectionalLight { global TRUE direction 0 -1 -1e-9 }\n\
                   Transform { rotation 1 0 0 -1 children Shape { geometry Box { } appearance Appearance {\n\
                   material Material { } } } }\n";
        let sum = |pixels: Vec<[f32; 4]>| pixels.iter().map(|p| f64::from(p[0])).sum::<f64>();
        sum(picture(&shapes))
    };
    let dark = lit(0, true);
    assert!(lit(0, false) > 2.0 * dark);
    for panes in [7, 8, 9, 40] {
        assert!((lit(panes, true) - dark).abs() < 1e-9, "{panes}");
    }
}

#[test]
fn a_light_of_a_group_shines_on_what_is_in_it_and_nothing_else() {
    let ball = |at: &str| {
        format!(
            "Transform {{ translation {at} children Shape {{ geometry Sphere {{ radius 0.4 }}\n\
             appearance Appearance {{ material Material {{ ambientIntensity 0.5 }} }} }} }}\n"
        )
    };
    // Two above in the group with the light, which stands there twice; one of polygons below.
    let [left, right] = ["-0.45 0.45 0", "0.45 0.45 0"].map(ball);
    let box_below = "Transform { translation 0 -0.45 0 children Shape { geometry Box { size 1 0.4 0.4 }\n\
                     appearance Appearance { material Material { } } } }\n";
    let light = "DirectionalLight { direction 0 0 -1 ambientIntensity 0.5 }";
    let at = |pixels: &[[f32; 4]], x: usize, y: usize| pixels[24 * y + x][0];
    let look = |text: &str| {
        let pixels = picture(text);
        [at(&pixels, 6, 6), at(&pixels, 18, 6), at(&pixels, 12, 18)]
    };
    let bits = |values: [f32; 3]| values.map(f32::to_bits);
    let [none, _, none_below] = look(&format!("{left}{right}{box_below}"));
    let all = look(&format!("{light}{left}{right}{box_below}"));
    assert!(all[0] > none + 0.5 && all[2] > none_below + 0.5, "{all:?}");
    let one = look(&format!(
        "{right}Group {{ children [ {light} {left} ] }}{box_below}"
    ));
    assert_eq!(bits(one), bits([all[0], none, none_below]));
    let below = look(&format!(
        "{right}Group {{ children [ {light} {box_below} ] }}{left}"
    ));
    assert_eq!(bits(below), bits([none, none, all[2]]));
    // The same group at two places, each with its own light.
    let both = look(&format!(
        "DEF G Group {{ children [ Group {{ children [ {light} {left} ] }} ] }}\n\
         Transform {{ translation 0.9 0 0 children USE G }}{box_below}"
    ));
    assert_eq!(bits(both), bits([all[0], all[1], none_below]));
}
