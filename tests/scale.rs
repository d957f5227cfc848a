//! A scene a million times smaller or larger gives the same picture for the same work.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::path::PathBuf;

use glam::{DAffine3, DVec3};
use kernel::{Aabb, Camera, Child, Item, Node, Patch, Scene, Shape};
use nurbray::{
    Accelerator, Film, METHODS, PixelData, RenderOptions, RenderStats, Shading, formats, render,
};

/// The scene with every patch for itself, and all coordinates times a factor.
fn scaled(scene: &Scene, factor: f64) -> Scene {
    let mut result = Scene::default();
    let map = DAffine3::from_scale(DVec3::splat(factor));
    let mut children = Vec::new();
    for place in scene.placements() {
        let Shape::Patch(id) = place.shape else {
            continue;
        };
        let patch = scene.patch(id);
        let surface = patch.surface.transformed(&(map * place.world_from_object));
        let loops = patch.loops.clone();
        let moved = Patch {
            loops,
            ..Patch::from(surface)
        };
        let shape = Shape::Patch(result.add_patch(moved).unwrap());
        let material = None;
        children.push(Child::Item(Item { shape, material }));
    }
    let root = Node {
        children,
        ..Node::default()
    };
    result.up = scene.up;
    let root = result.add_node(root).unwrap();
    result.set_root(root).unwrap();
    result
}

/// The picture of a scene from where all of the first one, times `factor`, is framed.
fn picture(scene: &Scene, outline: &[Aabb], factor: f64) -> (Film, RenderStats, [usize; 2]) {
    let accelerator = Accelerator::build(scene, &METHODS[0]).sealed(None);
    let up = scene.up.direction();
    let larger = |b: &Aabb| Aabb {
        min: b.min * factor,
        max: b.max * factor,
    };
    let outline: Vec<_> = outline.iter().map(larger).collect();
    let camera = Camera::framing(&outline, up, 16.0 / 9.0);
    let options = RenderOptions {
        width: 192,
        height: 108,
        samples: 1,
        shading: Shading::None,
        ..RenderOptions::default()
    };
    let (film, stats) = render(&accelerator, &camera, &options, &|_| {});
    let counts = [accelerator.cell_count(), accelerator.strip_count()];
    (film, stats, counts)
}

#[test]
fn size_changes_nothing() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let files = [
        "samples/teapot.obj",
        "samples/goblet.x3d",
        "../shared/corpus/iges/made_brep186_screw.igs",
    ];
    for file in files {
        let path = root.join(file);
        if !path.exists() {
            continue;
        }
        let scene = formats::open(path, &formats::Limits::default())
            .unwrap()
            .scene;
        let first = scaled(&scene, 1.0);
        let outline = Accelerator::build(&first, &METHODS[0]).outline();
        let (film, stats, counts) = picture(&first, &outline, 1.0);
        assert!(stats.hits > 100, "{file}");
        for factor in [1e-6, 1e6] {
            let (other, other_stats, other_counts) =
                picture(&scaled(&scene, factor), &outline, factor);
            // A ray next to a border may fall on the other side of it by rounding.
            let pairs = film.data().iter().zip(other.data());
            let differs = |(a, b): &(&PixelData, &PixelData)| {
                let apart = |a: [f32; 2], b: [f32; 2]| (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
                a.shape.to_bits() != b.shape.to_bits() || apart(a.uv, b.uv) > 1e-3
            };
            let different = pairs.filter(differs).count();
            assert!(
                different <= 4,
                "{file} {factor:e}: {different} pixels differ"
            );
            assert!(
                counts[0].abs_diff(other_counts[0]) * 100 <= counts[0],
                "{file} {factor:e}: cells"
            );
            assert!(
                counts[1].abs_diff(other_counts[1]) * 100 <= counts[1],
                "{file}: strips"
            );
            let same = |name: &str, a: u64, b: u64, share: u64| {
                assert!(
                    a.abs_diff(b) * share <= a,
                    "{file} {factor:e}: {a} {b} {name}"
                );
            };
            assert_eq!(stats.primary_rays, other_stats.primary_rays);
            same("hits", stats.hits, other_stats.hits, 10_000);
            same(
                "cells",
                stats.cells_examined,
                other_stats.cells_examined,
                50,
            );
        }
    }
}
