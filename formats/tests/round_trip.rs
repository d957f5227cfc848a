//! What is written is read again as the same scene: all samples, and real files if they are
//! there, through every writer.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DVec3};
use kernel::{Curve, Material, Patch, Scene, Shape, TrimLoop, UpAxis, nesting};
use nurbray_formats::{Export, Limits, ReadOptions, Resolver, WRITERS, Writer, open, read};

/// How far numbers may be off, relative to the size of the scene.
const ACCURACY: f64 = 1e-13;

/// Resolves the files that were written beside another.
struct Beside<'a>(&'a Export);

impl Resolver for Beside<'_> {
    fn resolve(&self, name: &str) -> std::io::Result<Vec<u8>> {
        let mut files = self.0.beside.iter();
        let found = files.find(|(known, _)| known == name);
        let missing = std::io::Error::from(std::io::ErrorKind::NotFound);
        found.map(|(_, bytes)| bytes.clone()).ok_or(missing)
    }
}

/// One face as it stands in the world, Z upwards.
struct Shown {
    /// The names from the root to it, each once.
    names: Vec<String>,
    material: Option<Material>,
    patch: Patch,
}

/// All faces in order; one with several outer loops becomes several where `split` says so.
fn shown(scene: &Scene, split: bool) -> Vec<Shown> {
    let up = match scene.up {
        UpAxis::Y => DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
        UpAxis::Z => DMat3::IDENTITY,
    };
    let mut shown = Vec::new();
    for placement in scene.placements() {
        let Shape::Patch(id) = placement.shape else {
            continue;
        };
        let patch = scene.patch(id);
        let nodes = placement.path.iter().map(|&id| &scene.node(id).name);
        let mut names: Vec<_> = nodes.chain([&patch.name]).cloned().collect();
        names.retain(|name| !name.is_empty());
        names.dedup();
        let surface = patch.surface.transformed(&placement.world_from_object);
        let surface = surface.transformed(&DAffine3::from_mat3(up));
        let faces = match nesting(&patch.loops) {
            nests if split && !nests.is_empty() => {
                let all = |nest: kernel::Nest| [vec![nest.outer], nest.holes].concat();
                nests.into_iter().map(all).collect()
            }
            _ => vec![(0..patch.loops.len()).collect::<Vec<_>>()],
        };
        for loops in faces {
            let loops = loops.into_iter().map(|k| patch.loops[k].clone()).collect();
            shown.push(Shown {
                names: names.clone(),
                material: placement.material.map(|id| scene.material(id).clone()),
                patch: Patch {
                    loops,
                    surface: surface.clone(),
                    ..patch.clone()
                },
            });
        }
    }
    shown
}

fn assert_close(a: impl Iterator<Item = f64>, b: impl Iterator<Item = f64>, size: f64, what: &str) {
    let (a, b): (Vec<_>, Vec<_>) = (a.collect(), b.collect());
    assert_eq!(a.len(), b.len(), "{what}");
    for (a, b) in a.iter().zip(&b) {
        assert!((a - b).abs() <= ACCURACY * size, "{what}: {a} {b}");
    }
}

fn segments(loops: &[TrimLoop]) -> Vec<&Curve<glam::DVec2>> {
    loops.iter().flat_map(TrimLoop::segments).collect()
}

fn assert_same(a: &Shown, b: &Shown, size: f64, what: &str) {
    assert_eq!(a.names, b.names, "{what}");
    let what = format!("{what}, {:?}", a.names);
    let (p, q) = (&a.patch.surface, &b.patch.surface);
    assert_eq!(
        (p.knots_u(), p.knots_v()),
        (q.knots_u(), q.knots_v()),
        "{what}"
    );
    assert_close(p.weights(), q.weights(), 1.0, &what);
    let coordinates =
        |p: &kernel::Surface| -> Vec<f64> { p.points().flat_map(|p| p.to_array()).collect() };
    assert_close(
        coordinates(p).into_iter(),
        coordinates(q).into_iter(),
        size,
        &what,
    );
    assert_eq!(a.patch.loops.len(), b.patch.loops.len(), "{what}: loops");
    let pairs = a.patch.loops.iter().zip(&b.patch.loops);
    // Some formats say which way loops run.
    let turned = |(p, q): (&TrimLoop, &TrimLoop)| match p.signed_area() * q.signed_area() {
        product if product < 0.0 => p.reversed(),
        _ => p.clone(),
    };
    let loops: Vec<_> = pairs.map(turned).collect();
    let (p, q) = (segments(&loops), segments(&b.patch.loops));
    assert_eq!(p.len(), q.len(), "{what}: trim curves");
    for (p, q) in p.iter().zip(&q) {
        assert_eq!(p.knots(), q.knots(), "{what}");
        let scale = p
            .points()
            .fold(1.0, |s: f64, p| s.max(p.abs().max_element()));
        assert_close(p.weights(), q.weights(), 1.0, &what);
        assert_close(
            p.points().flat_map(|p| p.to_array()),
            q.points().flat_map(|p| p.to_array()),
            scale,
            &what,
        );
    }
    let look = |m: &Option<Material>| m.as_ref().map(|m| (m.name.clone(), m.diffuse));
    let (p, q) = (look(&a.material), look(&b.material));
    assert_eq!(p.is_some(), q.is_some(), "{what}: material");
    if let (Some(p), Some(q)) = (p, q) {
        assert_eq!(p.0, q.0, "{what}");
        assert!(p.1.distance(q.1) < 1e-12, "{what}: {p:?} {q:?}");
    }
}

/// Whether a writer's files can be read again.
fn is_read(writer: &Writer) -> bool {
    matches!(writer.name, "IGES" | "X3D")
}

/// Writes a scene and reads it again.
fn through(scene: &Scene, writer: &Writer, what: &str) -> Scene {
    let export = (writer.write)(scene, "again").unwrap_or_else(|e| panic!("{what}: {e}"));
    let limits = Limits::default();
    let options = ReadOptions {
        limits: &limits,
        resolver: &Beside(&export),
    };
    let import = read(&export.bytes, Some(writer.extensions[0]), &options);
    let import = import.unwrap_or_else(|e| panic!("{what}: {e}"));
    assert_eq!(import.warnings.as_slice(), [], "{what}");
    assert_eq!(
        Ok(&export),
        (writer.write)(scene, "again").as_ref(),
        "{what}"
    );
    import.scene
}

/// Checks one file; the result is the number of faces.
fn check(path: &Path, writer: &Writer) -> usize {
    let what = format!("{} as {}", path.display(), writer.name);
    let Ok(import) = open(path, &Limits::default()) else {
        return 0;
    };
    let scene = import.scene;
    let split = writer.name == "IGES";
    let before = shown(&scene, split);
    if before.is_empty() {
        return 0;
    }
    let again = through(&scene, writer, &what);
    let after = shown(&again, false);
    assert_eq!(before.len(), after.len(), "{what}: faces");
    let bounds = scene.hull_bounds();
    let size = bounds.min.abs().max(bounds.max.abs()).max_element();
    for (a, b) in before.iter().zip(&after) {
        assert_same(a, b, size, &what);
    }
    // Written once more, nothing changes at all.
    let third = through(&again, writer, &what);
    assert_eq!(again.nodes().len(), third.nodes().len(), "{what}: nodes");
    assert_eq!(
        again.patches().len(),
        third.patches().len(),
        "{what}: patches"
    );
    before.len()
}

fn files(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("..")
        .join(folder);
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut files: Vec<_> = entries
        .map(|entry| entry.expect("a folder that can be listed").path())
        .filter(|path| path.is_file())
        .collect();
    files.sort();
    files
}

#[test]
fn samples_come_back() {
    for writer in WRITERS.iter().filter(|w| is_read(w)) {
        let found = files("samples")
            .iter()
            .map(|path| check(path, writer))
            .sum::<usize>();
        assert!(found > 10);
    }
}

#[test]
fn real_files_come_back() {
    for writer in WRITERS.iter().filter(|w| is_read(w)) {
        for folder in ["iges", "obj", "x3d", "vrml"] {
            let files = files(&format!("../shared/corpus/{folder}"));
            let count: usize = files.iter().map(|path| check(path, writer)).sum();
            println!("{folder} as {}: {count} faces", writer.name);
        }
    }
}
