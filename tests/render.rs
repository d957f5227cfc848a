//! Pictures: every sample against `tests/golden`, the same bytes from any number of
//! threads, data channels against known hits, and brightness against theory.
//!
//! `make bless` writes the golden pictures anew.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use exr::prelude::{ReadChannels as _, ReadLayers as _};
use glam::{DVec2, DVec3};
use image::RgbImage;
use nurbray::formats::{self, FORMATS, Limits};
use nurbray::kernel::modelling::{self, Frame};
use nurbray::kernel::{
    Camera, Child, Item, Light, LightKind, Material, Node, Patch, Projection, Scene, Shape,
};
use nurbray::{Accelerator, METHODS, PixelData, RenderOptions, render};
use tempfile::TempDir;

/// Bounds on the difference from a golden picture, of 255: the mean over all values, and
/// the largest, which one sample of four on the other side of an edge may cause.
const MEAN_DIFFERENCE: f64 = 0.1;
const MOST_DIFFERENCE: u8 = 72;

fn root(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Runs `nurbray render` on a sample.
fn program(sample: &Path, picture: &Path, options: &str) {
    let output = Command::new(env!("CARGO_BIN_EXE_nurbray"))
        .arg("render")
        .arg(sample)
        .arg("-o")
        .arg(picture)
        .args(options.split_whitespace())
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {stderr}", sample.display());
}

#[test]
fn samples_look_as_they_should() {
    let folder = TempDir::new().unwrap();
    let mut failures = Vec::new();
    for entry in fs::read_dir(root("samples")).unwrap() {
        let sample = entry.unwrap().path();
        let extension = sample.extension().and_then(|e| e.to_str()).unwrap_or("");
        if !FORMATS.iter().any(|f| f.extensions.contains(&extension)) {
            continue;
        }
        let name = Path::new(sample.file_name().unwrap()).with_extension("png");
        let found = folder.path().join(&name);
        program(&sample, &found, "--size 128x96");
        let golden = root("tests/golden").join(&name);
        if std::env::var_os("BLESS").is_some() {
            fs::copy(&found, &golden).unwrap();
        }
        if let Err(failure) = compare(&golden, &found, &name) {
            failures.push(failure);
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Compares two pictures; what differs is put into the build folder to be looked at.
fn compare(golden: &Path, found: &Path, name: &Path) -> Result<(), String> {
    if !golden.is_file() {
        let golden = golden.display();
        return Err(format!(
            "{golden} is missing; `make bless` makes it, then look at it"
        ));
    }
    let open = |path: &Path| image::open(path).unwrap().into_rgb8();
    let (expected, picture) = (open(golden), open(found));
    let (mean, most) = if expected.dimensions() == picture.dimensions() {
        let pairs = expected.as_raw().iter().zip(picture.as_raw());
        let differences: Vec<_> = pairs.map(|(a, b)| a.abs_diff(*b)).collect();
        let sum: f64 = differences.iter().copied().map(f64::from).sum();
        let most = differences.iter().copied().max().unwrap_or(0);
        (sum / differences.len() as f64, most)
    } else {
        (f64::INFINITY, u8::MAX)
    };
    if mean <= MEAN_DIFFERENCE && most <= MOST_DIFFERENCE {
        return Ok(());
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name.with_extension(""));
    fs::create_dir_all(&folder).unwrap();
    let difference = RgbImage::from_fn(picture.width(), picture.height(), |x, y| {
        let a = expected.get_pixel_checked(x, y).map_or([0; 3], |p| p.0);
        let b = picture.get_pixel(x, y).0;
        image::Rgb(std::array::from_fn(|k| {
            a[k].abs_diff(b[k]).saturating_mul(4)
        }))
    });
    expected.save(folder.join("expected.png")).unwrap();
    picture.save(folder.join("found.png")).unwrap();
    difference.save(folder.join("difference.png")).unwrap();
    Err(format!(
        "{}: mean difference {mean:.3}, most {most}; see {} and run `make bless` if it is right",
        name.display(),
        folder.display()
    ))
}

#[test]
fn threads_do_not_change_the_picture() {
    let folder = TempDir::new().unwrap();
    for kind in ["png", "exr"] {
        let pictures = [1, 2, 8].map(|threads| {
            let picture = folder.path().join(format!("{threads}.{kind}"));
            let options = format!("--size 200x150 --threads {threads}");
            program(&root("samples/teapot.obj"), &picture, &options);
            fs::read(&picture).unwrap()
        });
        assert!(pictures[0] == pictures[1], "{kind}: 1 and 2 threads");
        assert!(pictures[0] == pictures[2], "{kind}: 1 and 8 threads");
    }
}

/// The channels of an EXR file by name, in single precision.
fn channels(path: &Path) -> Vec<(String, Vec<f32>)> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .unwrap();
    let channels = image.layer_data.channel_data.list;
    channels
        .iter()
        .map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect()))
        .collect()
}

#[test]
fn data_channels_hold_the_hit() {
    const SIDE: usize = 33;
    let folder = TempDir::new().unwrap();
    let picture = folder.path().join("sphere.exr");
    let sample = root("samples/sphere_torus.x3d");
    // The ray through the middle meets the sphere of radius 1 beside its axis.
    let offset = DVec2::new(0.3, 0.2);
    let camera = "--eye -2,0.2,6 --target -2,0.2,0 --up 0,1,0";
    program(&sample, &picture, &format!("{camera} --size {SIDE}x{SIDE}"));
    let channels = channels(&picture);
    let value = |name: &str, index: usize| -> f64 {
        let channel = channels.iter().find(|(n, _)| n == name);
        let (_, values) = channel.unwrap_or_else(|| panic!("no channel {name}"));
        assert_eq!(values.len(), SIDE * SIDE);
        f64::from(values[index])
    };
    let vector = |names: [&str; 3], index: usize| DVec3::from(names.map(|n| value(n, index)));
    let middle = SIDE * SIDE / 2;
    let radius = offset.extend((1.0 - offset.length_squared()).sqrt());
    let point = DVec3::new(-2.3, 0.0, 0.0) + radius;
    for depth in ["Z", "ViewLayer.Depth.Z"] {
        assert!((value(depth, middle) - (6.0 - point.z)).abs() < 1e-6);
        assert!(value(depth, 0) >= f64::from(PixelData::FAR));
    }
    let position = ["X", "Y", "Z"].map(|axis| format!("ViewLayer.Position.{axis}"));
    let found = vector(position.each_ref().map(String::as_str), middle);
    assert!(found.distance(point) < 1e-6, "{found}");
    let normal = ["X", "Y", "Z"].map(|axis| format!("ViewLayer.Normal.{axis}"));
    let found = vector(normal.each_ref().map(String::as_str), middle);
    let (same, opposite) = (found.distance(radius), found.distance(-radius));
    assert!(same.min(opposite) < 1e-6, "{found}");
    assert!(value("exact.patch", middle).abs() < 1e-9);
    assert!((value("exact.patch", 0) + 1.0).abs() < 1e-9);
    assert!((value("ViewLayer.UV.A", middle) - 1.0).abs() < 1e-9);
    assert!(value("ViewLayer.UV.A", 0).abs() < 1e-9);
    let scene = formats::open(&sample, &Limits::default()).unwrap().scene;
    for [u, v] in [["exact.u", "exact.v"], ["ViewLayer.UV.U", "ViewLayer.UV.V"]] {
        let uv = DVec2::new(value(u, middle), value(v, middle));
        let local = scene.patches()[0].surface.evaluate(uv);
        assert!(local.distance(radius) < 1e-6, "{local}");
    }
    // Colours are there twice, and cover everything in front of the background.
    for part in ["R", "G", "B", "A"] {
        let twin = format!("ViewLayer.Combined.{part}");
        assert!((value(part, middle) - value(&twin, middle)).abs() < 1e-9);
        assert!(value(part, middle) > 0.0);
    }
}

#[test]
fn layers_are_chosen_by_name() {
    let folder = TempDir::new().unwrap();
    let picture = folder.path().join("depth.exr");
    let sample = root("samples/teapot.obj");
    program(
        &sample,
        &picture,
        "--size 8x6 --shading none --aov depth,patch",
    );
    let names: Vec<_> = channels(&picture)
        .into_iter()
        .map(|(name, _)| name)
        .collect();
    assert_eq!(names, ["ViewLayer.Depth.Z", "Z", "exact.patch"]);
}

#[test]
fn ambient_light_alone_gives_one_colour() {
    // The ambient light that is always there, and that of the scene's only light.
    const ALWAYS: f64 = 0.12;
    let (share, added) = (DVec3::new(0.8, 0.5, 0.25), DVec3::new(0.2, 0.3, 0.4));
    let (radius, extent) = (1.5, 4.0);
    let mut scene = Scene::default();
    scene.headlight = false;
    let material = scene.add_material(Material {
        ambient: share,
        ..Material::default()
    });
    let turn = 0.0..std::f64::consts::TAU;
    let quarter = std::f64::consts::FRAC_PI_2;
    let sphere = modelling::sphere(&Frame::WORLD, radius, turn, -quarter..quarter).unwrap();
    let patch = scene.add_patch(Patch::from(sphere)).unwrap();
    let item = Item {
        shape: Shape::Patch(patch),
        material: Some(material),
    };
    let root = scene
        .add_node(Node {
            children: vec![Child::Item(item)],
            ..Node::default()
        })
        .unwrap();
    scene.set_root(root).unwrap();
    scene.lights.push(Light {
        kind: LightKind::Directional {
            direction: DVec3::NEG_Z,
        },
        color: DVec3::ZERO,
        ambient: added,
        scope: Vec::new(),
    });
    let accelerator = Accelerator::build(&scene, &METHODS[0]);
    let eye = DVec3::new(3.0, -2.0, 5.0);
    let projection = Projection::Orthographic { extent };
    let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, projection).unwrap();
    let options = RenderOptions {
        width: 64,
        height: 64,
        samples: 4,
        ..RenderOptions::default()
    };
    let (film, _) = render(&accelerator, &camera, &options, &|_| {});
    let color = share * (added + ALWAYS);
    let mut coverage = 0.0;
    for pixel in film.colors() {
        let alpha = f64::from(pixel[3]);
        for (found, expected) in pixel.iter().zip(color.to_array()) {
            assert!(
                (f64::from(*found) - expected * alpha).abs() < 1e-6,
                "{pixel:?}"
            );
        }
        coverage += alpha;
    }
    // The sphere's disc as a share of the picture; a thousand samples lie near its edge.
    let disc = std::f64::consts::PI * radius * radius / (extent * extent);
    let mean = coverage / film.colors().len() as f64;
    assert!((mean - disc).abs() < 2e-3, "{mean} instead of {disc}");
}

#[test]
fn frames_show_what_has_moved() {
    let folder = TempDir::new().unwrap();
    let scene = folder.path().join("ball.wrl");
    let text = "#VRML V2.0 utf8\n\
        Viewpoint { position 0 0 10 }\n\
        DEF T TimeSensor { cycleInterval 2 }\n\
        DEF P PositionInterpolator { key [ 0 1 ] keyValue [ -2 0 0, 2 0 0 ] }\n\
        DEF M Transform { children Shape { geometry Sphere { } } }\n\
        ROUTE T.fraction_changed TO P.set_fraction\n\
        ROUTE P.value_changed TO M.set_translation\n";
    fs::write(&scene, text).unwrap();
    let stats = folder.path().join("stats.jsonl");
    let options = format!(
        "--size 32x24 --frames 0..2 --fps 1 --stats {}",
        stats.display()
    );
    program(&scene, &folder.path().join("{frame}.png"), &options);
    // The middle of what is not background, in pixels.
    let middle = |name: &str| {
        let picture = image::open(folder.path().join(name)).unwrap().into_rgb8();
        let behind = *picture.get_pixel(0, 0);
        let columns = picture.enumerate_pixels().filter(|(_, _, p)| **p != behind);
        let columns: Vec<_> = columns.map(|(x, ..)| f64::from(x)).collect();
        columns.iter().sum::<f64>() / columns.len() as f64 - 15.5
    };
    let found = ["0000.png", "0001.png", "0002.png"].map(middle);
    assert!(
        found[0] < -4.0 && found[1].abs() < 0.5 && found[2] > 4.0,
        "{found:?}"
    );
    let stats = fs::read_to_string(stats).unwrap();
    let times = stats.lines().map(|line| line.contains("\"time\":"));
    assert_eq!(times.filter(|&found| found).count(), 3);
    program(
        &scene,
        &folder.path().join("still.png"),
        "--size 32x24 --time 1",
    );
    assert!(middle("still.png").abs() < 0.5);
}

#[test]
fn four_spellings_give_one_picture() {
    let folder = TempDir::new().unwrap();
    let pictures = ["x3d", "x3dv", "x3dj", "wrl"].map(|spelling| {
        let picture = folder.path().join(spelling).with_extension("png");
        let sample = root("samples/door").with_extension(spelling);
        program(&sample, &picture, "--size 128x96");
        fs::read(picture).unwrap()
    });
    assert!(pictures.iter().all(|picture| *picture == pictures[0]));
}

#[test]
fn curves_and_points_are_drawn_when_they_are_asked_for() {
    let folder = TempDir::new().unwrap();
    let wires = folder.path().join("wires.obj");
    // A quarter of a circle, a line and a point, without any surface.
    let text = "v 1 0 0\nv 1 1 0 0.7071067811865476\nv 0 1 0\nv 0 0 0\ncstype rat bezier\ndeg 2\n\
                curv 0 1 1 2 3\nparm u 0 1\nend\nl 3 4\np 4\n";
    fs::write(&wires, text).unwrap();
    let picture = |sample: &Path, options: &str| {
        let picture = folder.path().join("picture.png");
        program(sample, &picture, &format!("--size 64x48 {options}"));
        image::open(picture).unwrap().to_rgb8()
    };
    let dark = |options: &str| {
        let picture = picture(&wires, &format!("--curves {options}"));
        let dark = picture.pixels().filter(|p| p.0.iter().all(|c| *c < 100));
        dark.count()
    };
    // Without a target, the camera looks at the middle of the curves.
    for eye in ["--target 0.5,0.5,0 --eye 0.5,0.5,3", "--eye 0.5,0.5,3"] {
        let found = dark(&format!("{eye} --fov 30"));
        assert!((100..250).contains(&found), "{found} dark pixels");
    }
    assert!(dark("--ortho") > 30);
    let mixed = root("samples/mixed.obj");
    let [without, with] = ["", "--curves"]
        .map(|options| picture(&mixed, &format!("{options} --eye 5,4,6 --target 0,1,0")));
    let pairs = without.pixels().zip(with.pixels());
    let changed = pairs.filter(|(a, b)| a != b).count();
    assert!((60..600).contains(&changed), "{changed} pixels");
}
