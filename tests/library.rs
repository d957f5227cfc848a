//! What a program that uses the library may rely on where it asks for what cannot be.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::f64::consts::TAU;
use std::io::ErrorKind;
use std::panic::{AssertUnwindSafe, catch_unwind};

use nurbray::convert::{Amount, MESH_WRITERS};
use nurbray::glam::{DVec3, dvec3};
use nurbray::gltf::{Packing, Source};
use nurbray::kernel::modelling::{Frame, torus};
use nurbray::kernel::{Camera, Child, Item, Mesh, Node, Ray, Scene, Shape};
use nurbray::{
    Accelerator, Film, METHODS, OutputOptions, Screen, Start, TessellateError, TessellateOptions,
    Tolerance, Workspace, compare, output, tessellate,
};

/// A scene of which a node shows these.
fn show(scene: &mut Scene, name: &str, shapes: &[Shape]) {
    let material = None;
    let shown = |&shape: &Shape| Child::Item(Item { shape, material });
    let mut children: Vec<_> = scene.root().map(Child::Node).into_iter().collect();
    children.extend(shapes.iter().map(shown));
    let name = name.to_owned();
    let node = Node {
        name,
        children,
        ..Node::default()
    };
    let root = scene.add_node(node).unwrap();
    scene.set_root(root).unwrap();
}

/// A torus around the z axis, moved.
fn ring(scene: &mut Scene, by: DVec3) -> Shape {
    let frame = Frame::new(by, DVec3::Z, DVec3::X).unwrap();
    let surface = torus(&frame, 3.0, 1.0, 0.0..TAU, 0.0..TAU).unwrap();
    Shape::Patch(scene.add_patch(surface.into()).unwrap())
}

fn one_ring() -> Scene {
    let mut scene = Scene::default();
    let ring = ring(&mut scene, DVec3::ZERO);
    show(&mut scene, "ring", &[ring]);
    scene
}

/// What is said where something panics.
fn panic_of<T>(run: impl FnOnce() -> T) -> String {
    let payload = catch_unwind(AssertUnwindSafe(run)).err().unwrap();
    payload.downcast_ref::<String>().unwrap().clone()
}

#[test]
fn there_is_a_range_for_each_ray() {
    let scene = one_ring();
    let accelerator = Accelerator::build(&scene, &METHODS[0]);
    let ray = Ray {
        origin: dvec3(-10.0, 0.0, 0.0),
        direction: DVec3::X,
    };
    let range = 0.0..f64::INFINITY;
    let mut room = Workspace::default();
    let hit = accelerator.nearest(&ray, range.clone(), &mut room).unwrap();
    let start = Start::of(&hit, &ray);
    for (rays, ranges, starts) in [
        (100, 64, 0),
        (64, 100, 0),
        (5, 0, 0),
        (5, 5, 4),
        (5, 5, 6),
        (0, 0, 1),
    ] {
        let (rays, ranges) = (vec![ray; rays], vec![range.clone(); ranges]);
        let starts = vec![start; starts];
        let (mut hits, mut blocked) = (Vec::new(), Vec::new());
        let told = panic_of(|| {
            accelerator.nearest_leaving(&rays, &ranges, &starts, &mut room, &mut hits);
        });
        assert!(told.contains("for each ray"), "{told}");
        let told = panic_of(|| {
            accelerator.any_leaving(&rays, &ranges, &starts, &mut room, &mut blocked);
        });
        assert!(told.contains("for each ray"), "{told}");
    }
    let mut hits = Vec::new();
    let rays = [ray; 65];
    let (ranges, starts) = (vec![range; 65], [start; 65]);
    accelerator.nearest_leaving(&rays, &ranges, &starts, &mut room, &mut hits);
    assert_eq!(hits.len(), 65);
}

#[test]
fn pictures_without_pixels_are_not_written() {
    let folder = tempfile::tempdir().unwrap();
    for format in output::PICTURE_FORMATS {
        for (width, height) in [(0, 5), (5, 0), (0, 0)] {
            let path = folder.path().join("none").with_extension(format.extension);
            let film = Film::new(width, height);
            let error = output::write(&film, &path, &OutputOptions::default()).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidInput);
            let text = format!("{width} x {height} are no pixels");
            assert_eq!(error.to_string(), text);
            assert!(!path.exists());
        }
    }
    let path = folder.path().join("channel.exr");
    for (size, name, values, text) in [
        ([0, 3], "x", 0, "0 x 3 are no pixels"),
        ([2, 2], "x", 1, "1 values for 2 x 2 pixels"),
        ([2, 2], "x", 5, "5 values for 2 x 2 pixels"),
        (
            [u32::MAX; 2],
            "x",
            1,
            "1 values for 4294967295 x 4294967295 pixels",
        ),
        ([1, 1], "λ", 1, "the channel 'λ' has letters beyond Latin-1"),
    ] {
        let error = output::write_channel(&path, size, name, &vec![0.0; values]).unwrap_err();
        assert_eq!(
            (error.kind(), error.to_string()),
            (ErrorKind::InvalidInput, text.to_owned())
        );
        assert!(!path.exists());
    }
    output::write_channel(&path, [2, 1], "x", &[0.0, 1.0]).unwrap();
}

#[test]
fn triangles_of_an_earlier_scene_are_refused() {
    let mut scene = one_ring();
    let triangles = tessellate(&scene, &TessellateOptions::default()).unwrap();
    let other = ring(&mut scene, DVec3::Z * 5.0);
    show(&mut scene, "more", &[other]);
    let source = Source::default();
    for writer in MESH_WRITERS {
        let written = writer.write(&scene, &triangles, &source, Packing::default(), "x");
        let error = written.unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidInput, "{}", writer.name);
        assert_eq!(
            error.to_string(),
            "the triangles are not those of the scene"
        );
    }
    for told in [
        panic_of(|| compare::Subject::new(&scene, triangles.clone())),
        panic_of(|| Amount::of(&scene, &triangles, true)),
    ] {
        assert_eq!(told, "the triangles are not those of the scene");
    }
}

#[test]
fn the_number_of_a_hit_leads_to_its_patch() {
    let mut scene = Scene::default();
    let corners = [[-9.0, -9.0], [9.0, -9.0], [0.0, 9.0]].map(|[x, y]| dvec3(x, y, -8.0));
    let floor = Mesh::new(corners.to_vec(), Vec::new(), Vec::new(), vec![[0, 1, 2]]).unwrap();
    let floor = Shape::Mesh(scene.add_mesh(floor).unwrap());
    let rings = [0.0, 5.0].map(|z| ring(&mut scene, DVec3::Z * z));
    // In the file the mesh stands first.
    show(&mut scene, "below", &[floor, rings[0]]);
    show(&mut scene, "above", &[rings[1]]);
    let accelerator = Accelerator::build(&scene, &METHODS[0]);
    let shapes = scene.numbered_placements();
    let mut room = Workspace::default();
    for (x, y, z, shape, name) in [
        (3.0, 0.1, 9.0, rings[1], "above"),
        (3.0, 0.1, 3.0, rings[0], "below"),
        (0.1, 0.1, 9.0, floor, "below"),
    ] {
        let (origin, direction) = (dvec3(x, y, z), -DVec3::Z);
        let ray = Ray { origin, direction };
        let hit = accelerator
            .nearest(&ray, 0.0..f64::INFINITY, &mut room)
            .unwrap();
        let at = &shapes[hit.shape as usize];
        assert_eq!((at.shape, scene.name_at(at)), (shape, name));
        if let Shape::Patch(id) = at.shape {
            let point = scene.patch(id).surface.evaluate(hit.uv);
            assert!(
                at.world_from_object
                    .transform_point3(point)
                    .distance(hit.point)
                    < 1e-12
            );
        }
    }
}

#[test]
fn limits_of_triangles_are_positive_and_finite() {
    let scene = one_ring();
    let defaults = TessellateOptions::default();
    let screen = |pixels: f64, height: u32| {
        let camera = Camera::framing(&[scene.extent()], DVec3::Z, 1.0);
        let screen = Some(Screen {
            camera,
            pixels,
            height,
        });
        TessellateOptions {
            screen,
            ..defaults.clone()
        }
    };
    let refused =
        |options: TessellateOptions, limit: &str| match tessellate(&scene, &options).unwrap_err() {
            TessellateError::OutOfRange { name, .. } => assert_eq!(name, limit),
            error => panic!("{limit}: {error}"),
        };
    for x in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        for tolerance in [Tolerance::Length(x), Tolerance::Relative(x)] {
            let options = TessellateOptions {
                tolerance,
                ..defaults.clone()
            };
            refused(options, "tolerance");
        }
        let options = TessellateOptions {
            angle: x,
            ..defaults.clone()
        };
        refused(options, "angle");
        let options = TessellateOptions {
            max_edge: Some(x),
            ..defaults.clone()
        };
        refused(options, "longest side");
        refused(screen(x, 100), "tolerance in pixels");
    }
    refused(screen(1.0, 0), "number of rows");
    let loose = TessellateOptions {
        tolerance: Tolerance::Length(f64::MAX),
        angle: f64::MAX,
        max_edge: Some(f64::MAX),
        ..defaults.clone()
    };
    assert!(tessellate(&scene, &loose).is_ok());
    assert!(tessellate(&scene, &screen(1.0, 100)).is_ok());
}
