//! What is written is read again as the same scene: all samples, and real files if they are
//! there, through every writer.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DVec3};
use kernel::{Curve, LightKind, Material, Patch, Scene, Shape, TrimLoop, UpAxis, nesting};
use nurbray_formats::{Export, Limits, ReadOptions, Resolver, WRITERS, Writer, open, read};

/// How far numbers may be off, relative to the size of the scene.
const ACCURACY: f64 = 1e-15;

/// Resolves the files that were written beside another.
struct Beside<'a>(&'a Export);

impl Resolver for Beside<'_> {
    fn resolve(&self, name: &str) -> std::io::Result<Vec<u8>> {
        let mut files = self.0.beside.iter();
        let found = files.find(|(known, _)| known == name);
        let missing = std::io::Error::from(std::io::ErrorKind::NotFound);
        // Pictures are named, not written.
        let sample = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../samples")
            .join(name);
        match found {
            Some((_, bytes)) => Ok(bytes.clone()),
            None if name.ends_with(".png") => std::fs::read(sample),
            None => Err(missing),
        }
    }
}

/// One face as it stands in the world, Z upwards.
struct Shown {
    /// The names from the root to it, each once.
    names: Vec<String>,
    material: Option<Material>,
    patch: Patch,
    /// Whether it is of a solid.
    is_of_solid: bool,
}

/// The loops of a face, where its surface is not closed without what leaves the domain; none where they
/// cut nothing off.
fn clipped(patch: &Patch) -> Vec<TrimLoop> {
    if patch.region().is_none() {
        return Vec::new();
    }
    let surface = &patch.surface;
    let domain = [surface.knots_u().domain(), surface.knots_v().domain()];
    let mut loops = patch.loops.clone();
    for axis in (0..2).filter(|&axis| !surface.closed()[axis]) {
        let clip = |l: &TrimLoop| l.clipped(axis, domain[axis].clone()).expect("a loop");
        loops = loops.iter().flat_map(clip).collect();
    }
    loops
}

/// All faces in order, `unit` times as large; where `split` says so, loops end at the border
/// of the domain, and a face with several outer loops becomes several.
fn shown(scene: &Scene, unit: f64, split: bool) -> Vec<Shown> {
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
        let is_solid = |&id: &_| scene.node(id).voids.is_some();
        let is_of_solid = placement.path.iter().any(is_solid);
        let nodes = placement.path.iter().map(|&id| &scene.node(id).name);
        let mut names: Vec<_> = nodes.chain([&patch.name]).cloned().collect();
        names.retain(|name| !name.is_empty());
        names.dedup();
        let surface = patch.surface.transformed(&placement.world_from_object);
        let surface = surface.transformed(&DAffine3::from_mat3(up * unit));
        let all = match split {
            true => clipped(patch),
            false if patch.region().is_none() => Vec::new(),
            false => patch.loops.clone(),
        };
        let faces = match nesting(&all, patch.surface.periods()) {
            nests if split && !nests.is_empty() => {
                let members = |nest: kernel::Nest| [vec![nest.outer], nest.holes].concat();
                nests.into_iter().map(members).collect()
            }
            _ => vec![(0..all.len()).collect::<Vec<_>>()],
        };
        for loops in faces {
            let loops = loops.into_iter().map(|k| all[k].clone()).collect();
            shown.push(Shown {
                names: names.clone(),
                material: placement.material.map(|id| scene.material(id).clone()),
                patch: Patch {
                    loops,
                    surface: surface.clone(),
                    ..patch.clone()
                },
                is_of_solid,
            });
        }
    }
    shown
}

/// What OBJ leaves of faces: one name, by which they stand together, and holes after the loop
/// around them.
fn as_obj(shown: &mut [Shown]) {
    let names: Vec<_> = shown
        .iter()
        .map(|face| face.names.last().cloned())
        .collect();
    let mut order: Vec<_> = (0..shown.len()).collect();
    order.sort_by_key(|&k| match &names[k] {
        Some(_) => names.iter().position(|name| *name == names[k]),
        None => Some(k),
    });
    let mut place = vec![0; shown.len()];
    order.iter().zip(0..).for_each(|(&k, at)| place[k] = at);
    for face in shown.iter_mut() {
        face.names.drain(..face.names.len().saturating_sub(1));
        let nests = nesting(&face.patch.loops, face.patch.surface.periods()).into_iter();
        let order = nests.flat_map(|nest| [vec![nest.outer], nest.holes].concat());
        face.patch.loops = order.map(|k| face.patch.loops[k].clone()).collect();
    }
    for k in 0..shown.len() {
        while place[k] != k {
            let to = place[k];
            shown.swap(k, to);
            place.swap(k, to);
        }
    }
}

fn assert_close(a: impl Iterator<Item = f64>, b: impl Iterator<Item = f64>, size: f64, what: &str) {
    let (a, b): (Vec<_>, Vec<_>) = (a.collect(), b.collect());
    assert_eq!(a.len(), b.len(), "{what}");
    for (a, b) in a.iter().zip(&b) {
        assert!((a - b).abs() <= ACCURACY * size, "{what}: {a} {b}");
    }
}

/// A name as VRML 97 has it: it may also get a number, and what is used again gets one.
fn legal(name: &str) -> String {
    let legal = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let name: String = name.chars().map(legal).collect();
    let number = |c: char| c == '_' || c.is_ascii_digit();
    name.trim_matches(number).to_owned()
}

/// The smooth pieces of loops: edges of solids end at corners.
fn segments(loops: &[TrimLoop]) -> Vec<Curve<glam::DVec2>> {
    let curves = loops.iter().flat_map(TrimLoop::segments);
    curves.flat_map(Curve::bezier_pieces).collect()
}

/// Whether loops are of curves with other knots.
fn are_other_curves(a: &[TrimLoop], b: &[TrimLoop]) -> bool {
    let (p, q) = (segments(a), segments(b));
    p.len() != q.len() || p.iter().zip(&q).any(|(p, q)| p.knots() != q.knots())
}

fn assert_same_curves(a: &[TrimLoop], b: &[TrimLoop], what: &str) {
    let (p, q) = (segments(a), segments(b));
    assert_eq!(p.len(), q.len(), "{what}: trim curves");
    for (p, q) in p.iter().zip(&q) {
        assert_eq!(p.knots(), q.knots(), "{what}");
        let scale = p
            .points()
            .fold(1.0, |s: f64, p| s.max(p.abs().max_element()));
        assert_close(p.weights(), q.weights(), 1.0, what);
        assert_close(
            p.points().flat_map(|p| p.to_array()),
            q.points().flat_map(|p| p.to_array()),
            scale,
            what,
        );
    }
}

fn assert_same(a: &Shown, b: &Shown, size: f64, what: &str) {
    if what.ends_with("VRML 97") {
        let names = |shown: &Shown| {
            let mut names: Vec<_> = shown.names.iter().map(|n| legal(n)).collect();
            names.dedup();
            names
        };
        assert_eq!(names(a), names(b), "{what}");
    } else {
        assert_eq!(a.names, b.names, "{what}");
    }
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
    // Edges of solids end where others do, and run at the pace of the other face.
    if what.contains("IGES") && b.is_of_solid && are_other_curves(&loops, &b.patch.loops) {
        let area = |patch: &Patch| kernel::Integrals::of(patch, DVec3::ZERO).area();
        let [p, q] = [&a.patch, &b.patch].map(area);
        assert!((p - q).abs() <= 1e-5 * p, "{what}: {p} {q}");
    } else {
        assert_same_curves(&loops, &b.patch.loops, &what);
    }
    let base = |m: &Material| {
        m.metallic_roughness
            .map_or(m.diffuse, |model| model.base_color)
    };
    let look = |m: &Option<Material>| m.as_ref().map(|m| (m.name.clone(), base(m)));
    let (p, q) = (look(&a.material), look(&b.material));
    assert_eq!(p.is_some(), q.is_some(), "{what}: material");
    if let (Some(p), Some(q)) = (p, q) {
        let is_free = (what.contains("VRML 97") || what.contains("OBJ"))
            && (p.0.is_empty() || legal(&p.0) == legal(&q.0));
        assert!(p.0 == q.0 || is_free, "{what}: {p:?} {q:?}");
        assert!(p.1.distance(q.1) < 1e-12, "{what}: {p:?} {q:?}");
    }
}

/// Whether a writer's files can be read again.
fn is_read(writer: &Writer) -> bool {
    matches!(writer.name, "IGES" | "X3D" | "OBJ")
}

/// What OBJ is told about and other formats are not.
const OUTSIDE: &str = "the loop leaves the surface; what lies outside is cut off";

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
    let warnings = import.warnings.as_slice().iter();
    let unexpected: Vec<_> = warnings
        .filter(|w| w.problem.to_string() != OUTSIDE)
        .collect();
    assert!(unexpected.is_empty(), "{what}: {unexpected:?}");
    assert_eq!(
        Ok(&export),
        (writer.write)(scene, "again").as_ref(),
        "{what}"
    );
    import.scene
}

/// Compares a scene with what it became on its way through formats; the result is the number of
/// faces.
fn compare(scene: &Scene, again: &Scene, way: &[&Writer], what: &str) -> usize {
    let has = |name| way.iter().any(|writer| writer.name == name);
    let metres = |scene: &Scene| scene.unit.as_ref().map(|unit| unit.metres);
    let units = metres(scene).zip(metres(again));
    let units = units.filter(|_| !has("OBJ")).unwrap_or((1.0, 1.0));
    let mut before = shown(scene, units.0, has("IGES"));
    let after = shown(again, units.1, false);
    if has("OBJ") {
        as_obj(&mut before);
    }
    assert_eq!(before.len(), after.len(), "{what}: faces");
    let bounds = scene.hull_bounds();
    let size = bounds.min.abs().max(bounds.max.abs()).max_element() * units.0;
    for (a, b) in before.iter().zip(&after) {
        assert_same(a, b, size, what);
    }
    before.len()
}

/// Checks one file; the result is the number of faces.
fn check(path: &Path, writer: &Writer) -> usize {
    let what = format!("{} as {}", path.display(), writer.name);
    let Some(scene) = opened(path) else { return 0 };
    let again = through(&scene, writer, &what);
    let count = compare(&scene, &again, &[writer], &what);
    // Written once more, nothing changes at all.
    let third = through(&again, writer, &what);
    assert_eq!(again.nodes().len(), third.nodes().len(), "{what}: nodes");
    let patches = [&again, &third].map(|scene| scene.patches().len());
    assert_eq!(patches[0], patches[1], "{what}: patches");
    count
}

/// The scene of a file, if it shows a surface.
fn opened(path: &Path) -> Option<Scene> {
    let scene = open(path, &Limits::default()).ok()?.scene;
    (!shown(&scene, 1.0, false).is_empty()).then_some(scene)
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

#[test]
fn files_come_back_from_other_formats() {
    let writer = |name: &str| WRITERS.iter().find(|w| w.name == name).expect("a writer");
    for (folder, there, back) in [
        ("obj", "IGES", "OBJ"),
        ("obj", "X3D", "OBJ"),
        ("x3d", "IGES", "X3D"),
        ("x3d", "OBJ", "X3D"),
        ("vrml", "IGES", "X3D"),
        ("iges", "X3D", "IGES"),
    ] {
        let way = [writer(there), writer(back)];
        let samples = files("samples");
        let others = files(&format!("../shared/corpus/{folder}"));
        let mut count = 0;
        for path in [samples, others].concat() {
            let what = format!("{} by way of {there} as {back}", path.display());
            let Some(scene) = opened(&path) else { continue };
            let again = through(&through(&scene, way[0], &what), way[1], &what);
            count += compare(&scene, &again, &way, &what);
        }
        println!("{folder} by way of {there} as {back}: {count} faces");
    }
}

/// How far two lists of numbers are apart, relative to the largest of them.
fn apart(a: impl Iterator<Item = f64>, b: impl Iterator<Item = f64>) -> f64 {
    let (mut most, mut size) = (0.0_f64, 0.0_f64);
    for (a, b) in a.zip(b) {
        most = most.max((a - b).abs());
        size = size.max(a.abs());
    }
    if most > 0.0 { most / size } else { 0.0 }
}

/// The largest difference of knots, weights, control points and trims of two patches, each in
/// its own coordinates.
fn difference(a: &Patch, b: &Patch) -> f64 {
    let (p, q) = (&a.surface, &b.surface);
    let knots = [(p.knots_u(), q.knots_u()), (p.knots_v(), q.knots_v())];
    let numbers =
        |p: &kernel::Surface| -> Vec<f64> { p.points().flat_map(|p| p.to_array()).collect() };
    let mut most = apart(numbers(p).into_iter(), numbers(q).into_iter());
    most = most.max(apart(p.weights(), q.weights()));
    for (p, q) in knots {
        let (p, q) = (p.as_slice().iter(), q.as_slice().iter());
        most = most.max(apart(p.copied(), q.copied()));
    }
    // Some formats say which way loops run.
    let pairs = a.loops.iter().zip(&b.loops);
    let turned = |(p, q): (&TrimLoop, &TrimLoop)| match p.signed_area() * q.signed_area() {
        product if product < 0.0 => p.reversed(),
        _ => p.clone(),
    };
    let loops: Vec<_> = pairs.map(turned).collect();
    for (p, q) in segments(&loops).iter().zip(&segments(&b.loops)) {
        let numbers = |c: &Curve<glam::DVec2>| -> Vec<f64> {
            let points = c.points().flat_map(|p| p.to_array());
            points
                .chain(c.weights())
                .chain(c.knots().as_slice().iter().copied())
                .collect()
        };
        most = most.max(apart(numbers(p).into_iter(), numbers(q).into_iter()));
    }
    most
}

#[test]
fn numbers_of_x3d_and_vrml_come_back_to_the_last_digit() {
    let writer = WRITERS.iter().find(|w| w.name == "X3D").expect("a writer");
    let (mut most, mut count) = (0.0_f64, 0);
    let folders = ["samples", "../shared/corpus/x3d", "../shared/corpus/vrml"];
    for path in folders.iter().flat_map(|folder| files(folder)) {
        let is_ours = path.extension().is_some_and(|e| e != "igs" && e != "obj");
        let Some(scene) = opened(&path).filter(|_| is_ours) else {
            continue;
        };
        let again = through(&scene, writer, &path.display().to_string());
        let [before, after] = [&scene, &again].map(|scene| {
            let placed = scene.placements();
            let ids = placed.iter().filter_map(|p| match p.shape {
                Shape::Patch(id) => Some(id),
                Shape::Mesh(_) => None,
            });
            ids.collect::<Vec<_>>()
        });
        assert_eq!(before.len(), after.len(), "{}", path.display());
        for (a, b) in before.iter().zip(&after) {
            most = most.max(difference(scene.patch(*a), again.patch(*b)));
            count += 1;
        }
    }
    println!("{count} faces, {most:e}");
    assert!(most <= 1e-15, "{most:e}");
}

/// A scene of one curve, points, and two squares with a seam between them.
fn wires_and_a_seam() -> Scene {
    let mut scene = Scene::default();
    let line = Curve::line(DVec3::ZERO, DVec3::X, 0.0..1.0).expect("a line");
    let arc = kernel::modelling::circle(&kernel::modelling::Frame::WORLD, 2.0).expect("a circle");
    let points = vec![DVec3::Y, DVec3::Z];
    let shapes = [
        kernel::WireShape::Curve(line),
        kernel::WireShape::Curve(arc),
        kernel::WireShape::Points(points),
    ];
    let mut root = kernel::Node::default();
    for shape in shapes {
        let wire = kernel::Wire {
            name: "axis".to_owned(),
            source: "line 1".to_owned(),
            shape,
            material: None,
        };
        root.wires.push(scene.add_wire(wire).expect("a wire"));
    }
    let mut sides = Vec::new();
    for (x, u) in [(0.0, 1.0), (1.0, 0.0)] {
        let knots = || kernel::KnotVector::bezier(1, 0.0..1.0).expect("knots");
        let corners = [DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::X + DVec3::Y];
        let corners = corners.map(|p| p + DVec3::X * x);
        let square = kernel::Surface::new(knots(), knots(), &corners, None).expect("a square");
        let patch = scene.add_patch(square.into()).expect("a patch");
        root.children.push(kernel::Child::Item(kernel::Item {
            shape: Shape::Patch(patch),
            material: None,
        }));
        let curve = Curve::line([u, 0.0].into(), [u, 1.0].into(), 0.0..1.0).expect("a line");
        sides.push(kernel::SeamSide { patch, curve });
    }
    let sides = sides.try_into().expect("two sides");
    scene
        .add_seam(kernel::Seam { sides, gap: 0.0 })
        .expect("a seam");
    let root = scene.add_node(root).expect("a node");
    scene.set_root(root).expect("a root");
    scene
}

#[test]
fn curves_points_and_seams_come_back_from_obj() {
    let scene = wires_and_a_seam();
    let writer = WRITERS.iter().find(|w| w.name == "OBJ").expect("a writer");
    let again = through(&scene, writer, "wires");
    assert_eq!(again.wires().len(), 3);
    for (before, after) in scene.wires().iter().zip(again.wires()) {
        assert_eq!(before.name, after.name);
        match (&before.shape, &after.shape) {
            (kernel::WireShape::Curve(p), kernel::WireShape::Curve(q)) => {
                assert_eq!(p.knots(), q.knots());
                let pairs = p.homogeneous().iter().zip(q.homogeneous());
                assert!(pairs.into_iter().all(|(p, q)| p.distance(*q) < 1e-15));
            }
            (before, after) => assert_eq!(before, after),
        }
    }
    assert_eq!(scene.seams(), again.seams());
}

#[test]
fn curves_and_points_come_back_from_iges() {
    let scene = wires_and_a_seam();
    let writer = WRITERS.iter().find(|w| w.name == "IGES").expect("a writer");
    let again = through(&scene, writer, "wires");
    // Every point is an entity of its own.
    assert_eq!(again.wires().len(), 4);
    assert!(again.wires().iter().all(|wire| wire.name == "axis"));
    let curves = |scene: &Scene| -> Vec<(kernel::KnotVector, Vec<f64>, f64)> {
        let curve = |wire: &kernel::Wire| match &wire.shape {
            kernel::WireShape::Curve(curve) => {
                let size = curve.points().map(DVec3::length).sum();
                Some((curve.knots().clone(), curve.weights().collect(), size))
            }
            kernel::WireShape::Points(_) => None,
        };
        scene.wires().iter().filter_map(curve).collect()
    };
    assert_eq!((curves(&again).len(), curves(&again)), (2, curves(&scene)));
}

#[test]
fn lights_of_groups_come_back_to_their_groups() {
    let text = "#X3D V3.3 utf8\nPROFILE Immersive\n\
        Transform { translation 1 2 3 rotation 0 0 1 1 scale 2 2 2 children [ \
          PointLight { global FALSE location 1 0 2 radius 5 attenuation 1 2 0 } \
          DirectionalLight { direction 0 -3 4 } Shape { geometry Sphere { } } ] } \
        Group { children [ SpotLight { location 0 0 9 } Shape { geometry Box { } } ] }";
    let (limits, resolver) = (Limits::default(), Beside(&Export::default()));
    let options = ReadOptions {
        limits: &limits,
        resolver: &resolver,
    };
    let scene = read(text.as_bytes(), Some("x3dv"), &options)
        .expect("a scene")
        .scene;
    // How many shapes each shines on, in the order of their kinds, and what it is.
    let lights = |scene: &Scene| {
        let placements = scene.placements();
        let mut lights: Vec<_> = (scene.lights.iter())
            .map(|light| {
                let is_lit = |path: &[_]| path.starts_with(&light.scope);
                let lit = placements.iter().filter(|at| is_lit(&at.path)).count();
                let (place, order) = match light.kind {
                    LightKind::Directional { direction } => (vec![direction], 0),
                    LightKind::Point { position, falloff } => {
                        let reach = DVec3::splat(falloff.radius);
                        (vec![position, falloff.attenuation, reach], 1)
                    }
                    LightKind::Spot { position, .. } => (vec![position], 2),
                };
                (order, lit, place)
            })
            .collect();
        lights.sort_by_key(|light| light.0);
        lights
    };
    let expected = lights(&scene);
    let lit: Vec<_> = expected.iter().map(|light| light.1).collect();
    let all = scene.placements().len();
    assert!(lit[0] == lit[1] && lit[0] < all && lit[2] == all, "{lit:?}");
    let has_lights = |w: &&Writer| w.name.starts_with("X3D") || w.name == "VRML 97";
    let writers: Vec<_> = WRITERS.iter().filter(has_lights).collect();
    assert_eq!(writers.len(), 3);
    for writer in writers {
        let again = lights(&through(&scene, writer, writer.name));
        assert_eq!(again.len(), expected.len(), "{}", writer.name);
        for (new, old) in again.iter().zip(&expected) {
            let is_bounded = writer.name != "VRML 97" || old.0 == 0;
            let lit = if is_bounded { old.1 } else { all };
            assert_eq!(new.1, lit, "{}", writer.name);
            for (new, old) in new.2.iter().zip(&old.2) {
                assert!(new.distance(*old) < 1e-12, "{}: {new} {old}", writer.name);
            }
        }
        let export = (writer.write)(&scene, "again").expect("a file");
        let told = export.warnings.as_slice().len();
        assert_eq!(
            told,
            usize::from(writer.name == "VRML 97"),
            "{}",
            writer.name
        );
    }
}
