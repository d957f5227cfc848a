//! Boxes, areas and bodies of what files show.

use std::f64::consts::{PI, TAU};
use std::fs;
use std::path::Path;

use glam::{DAffine3, DVec2, DVec3};
use nurbray::formats::{Import, Limits, NoFiles, ReadOptions, open, read};
use nurbray::kernel::modelling::{self, Frame};
use nurbray::kernel::{Child, Curve, Item, Node, Patch, Scene, Shape, TrimLoop};
use nurbray::{Measure, measure};
use serde_json::Value;

fn measured(name: &str) -> Measure {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("samples")
        .join(name);
    measure(&open(path, &Limits::default()).expect("a sample").scene)
}

#[test]
fn a_sphere_and_tori_have_their_closed_forms() {
    let found = measured("sphere_torus.x3d");
    assert_eq!((found.bodies.len(), found.open_faces), (3, 0));
    let sphere = &found.bodies[0];
    assert_eq!(sphere.name, "SPHERE");
    assert!((sphere.volume - 4.0 / 3.0 * PI).abs() < 1e-12);
    assert!((sphere.area - 4.0 * PI).abs() < 1e-12);
    assert!(sphere.volume_error < 1e-11);
    assert!(sphere.centroid.distance((-2.3, 0.0, 0.0).into()) < 1e-12);
    // 2/5 m r^2 about every axis.
    let moment = 2.0 / 5.0 * sphere.volume;
    assert!((sphere.inertia.x_axis.x - moment).abs() < 1e-12);
    assert!(sphere.inertia.x_axis.y.abs() < 1e-12);
    // 2 pi^2 R r^2 with R = 1 and r = 0.35, the second one scaled by 0.8.
    let torus = 2.0 * PI * PI * 0.35 * 0.35;
    assert!((found.bodies[1].volume - torus).abs() < 1e-10, "{found:?}");
    assert!(
        (found.bodies[2].volume - torus * 0.8_f64.powi(3)).abs() < 1e-10,
        "{found:?}"
    );
    let bounds = found.bounds;
    assert!((bounds.min.x + 3.3).abs() < 1e-7 && (bounds.max.z - 1.35).abs() < 1e-7);
}

#[test]
fn solids_by_construction_are_bodies() {
    let found = measured("solids.igs");
    assert_eq!((found.bodies.len(), found.open_faces), (9, 0));
    // The outline that turns: two rectangles and what joins them, by Pappus and Guldin.
    let outline = [
        (0.4, 0.0),
        (1.4, 0.0),
        (1.4, 0.4),
        (0.8, 0.6),
        (0.8, 1.6),
        (0.4, 1.6),
    ];
    let pairs = outline.iter().zip(outline.iter().cycle().skip(1));
    let moment: f64 = pairs
        .map(|((a, b), (c, d))| (a * d - b * c) * (a + c) / 6.0)
        .sum();
    let known = [
        ("BLOCK", 6.0),
        ("WEDGE", 8.0),
        ("CYLINDER", 2.5 * PI),
        ("FRUSTUM", 2.5 / 3.0 * PI * (1.44 + 0.48 + 0.16)),
        ("SPHERE", 4.0 / 3.0 * PI * 1.728),
        ("TORUS", 2.0 * PI * PI * 1.2 * 0.16),
        ("OVAL", 4.0 / 3.0 * PI * 1.5 * 0.9 * 0.6),
        ("REVOLVED", 1.5 * PI * moment),
        ("EXTRUDED", 0.5 * PI * 1.8 / 1.09_f64.sqrt()),
    ];
    for (body, (name, volume)) in found.bodies.iter().zip(known) {
        assert_eq!(body.name, name);
        assert!((body.volume - volume).abs() < 1e-9, "{name}: {body:?}");
    }
}

#[test]
fn bodies_with_folds_at_even_shares_are_bodies() {
    let file = "#VRML V2.0 utf8
        Shape { geometry Extrusion {
            crossSection [ 1 1, 1 -1, -1 -1, -1 1, 1 1 ] spine [ 0 0 0, 0 1 0, 0 3 0 ] } }";
    let options = ReadOptions {
        limits: &Limits::default(),
        resolver: &NoFiles,
    };
    let read = read(file.as_bytes(), None, &options);
    let found = measure(&read.expect("a file").scene);
    let [body] = found.bodies.as_slice() else {
        panic!("{found:?}");
    };
    assert!((body.volume - 12.0).abs() < 1e-12, "{body:?}");
}

#[test]
fn voids_of_a_solid_are_not_of_its_body() {
    let found = measured("hollow.igs");
    let [body] = found.bodies.as_slice() else {
        panic!("{found:?}");
    };
    assert_eq!((body.faces, body.voids, body.turned), (12, 1, 0));
    assert_eq!(found.open_faces, 0);
    // A box of 4 x 3 x 2 around one of 2 x 1 x 1.
    assert!((body.volume - 22.0).abs() < 1e-12, "{body:?}");
    assert!((body.area - 62.0).abs() < 1e-12);
    assert!(body.centroid.distance(DVec3::new(2.0, 1.5, 1.0)) < 1e-12);
    let about_x = (24.0 * (9.0 + 4.0) - 2.0 * (1.0 + 1.0)) / 12.0;
    assert!((body.inertia.x_axis.x - about_x).abs() < 1e-12, "{body:?}");
    assert_eq!(found.total().map(|all| all.volume), Some(body.volume));
}

#[test]
fn shells_that_the_file_calls_closed_are_bodies_in_spite_of_gaps() {
    // A cube of which the lid is too high by this.
    let gap = 0.01;
    let lid = DVec3::Z * (1.0 + gap);
    let [x, y, z] = DVec3::AXES;
    let sides = [
        (DVec3::ZERO, y, x),
        (lid, x, y),
        (DVec3::ZERO, x, z),
        (y, z, x),
        (DVec3::ZERO, z, y),
        (x, y, z),
    ];
    for is_solid in [false, true] {
        let mut scene = Scene::default();
        let patches = sides.map(|(corner, u, v)| {
            let plane = modelling::plane(corner, u, v, 0.0..1.0, 0.0..1.0);
            scene.add_patch(plane.expect("a plane").into())
        });
        let item = |id: Result<_, _>| {
            Child::Item(Item {
                shape: Shape::Patch(id.expect("few patches")),
                material: None,
            })
        };
        let shell = Node {
            children: patches.map(item).to_vec(),
            ..Node::default()
        };
        let shell = scene.add_node(shell).expect("its patches are there");
        let solid = Node {
            children: vec![Child::Node(shell)],
            voids: is_solid.then_some(0),
            ..Node::default()
        };
        let solid = scene.add_node(solid).expect("its shell is there");
        scene.set_root(solid).expect("it is there");
        let found = measure(&scene);
        assert_eq!(found.open_faces, if is_solid { 0 } else { 6 });
        for body in &found.bodies {
            assert_eq!((body.faces, body.turned), (6, 0));
            let off = (body.volume - (1.0 + 0.5 * gap)).abs();
            assert!(
                off <= body.volume_error && body.volume_error < 0.1,
                "{body:?}"
            );
        }
    }
}

/// A square face, the outline of which is a curve of many short pieces.
fn tile(corner: DVec3, u: DVec3, v: DVec3) -> Patch {
    let corners = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
    let share = |k: usize| (k % PIECES) as f64 / PIECES as f64;
    let place = |k: usize| {
        let side = k / PIECES;
        corners[side % 4].lerp(corners[(side + 1) % 4], share(k))
    };
    let outline: Vec<DVec2> = (0..=4 * PIECES).map(place).collect();
    let outline = Curve::polyline(&outline).expect("points");
    Patch {
        loops: vec![TrimLoop::new(vec![outline], 1e-12).expect("it is closed")],
        ..modelling::plane(corner, u, v, 0.0..1.0, 0.0..1.0)
            .expect("a plane")
            .into()
    }
}

/// The measures of these patches in one group.
fn of_group(patches: impl IntoIterator<Item = Patch>) -> Measure {
    let mut scene = Scene::default();
    let item = |patch| {
        let shape = Shape::Patch(scene.add_patch(patch).expect("it is small"));
        Child::Item(Item {
            shape,
            material: None,
        })
    };
    let children = patches.into_iter().map(item).collect();
    let root = Node {
        children,
        ..Node::default()
    };
    let root = scene.add_node(root).expect("its children are there");
    scene.set_root(root).expect("it is there");
    measure(&scene)
}

/// The sides of a cube: floor and lid, and two across y and x each.
fn cube() -> [Patch; 6] {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    [
        tile(DVec3::ZERO, x, y),
        tile(z, x, y),
        tile(DVec3::ZERO, x, z),
        tile(y, x, z),
        tile(DVec3::ZERO, y, z),
        tile(x, y, z),
    ]
}

/// Pieces of each side of a [`tile`].
const PIECES: usize = 64;

#[test]
fn bodies_that_only_their_triangles_close_are_bodies() {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    // The lid is a little above the walls.
    let lid = z * 1.0003;
    let mut tiles = cube();
    tiles[1] = tile(lid, x, y);
    let found = of_group(tiles);
    assert_eq!((found.bodies.len(), found.open_faces), (1, 0));
    let body = &found.bodies[0];
    assert!(
        (body.volume - 1.0).abs() < body.volume_error + 3e-4,
        "{body:?}"
    );
}

#[test]
fn a_face_that_is_a_small_part_of_its_surface_has_its_side() {
    // A cube of which a face is a millionth of its plane, with the normal inwards.
    let (x, y) = (DVec3::X, DVec3::Y);
    let mut floor = tile(DVec3::ZERO, x, y);
    let whole = -1000.0..1001.0;
    let (from, way) = (DVec3::new(-1000.0, -1000.0, 0.0), 2001.0);
    floor.surface =
        modelling::plane(from, x * way, y * way, whole.clone(), whole).expect("a plane");
    let mut tiles = cube();
    tiles[0] = floor;
    let found = of_group(tiles);
    assert_eq!((found.bodies.len(), found.open_faces), (1, 0));
    assert!((found.bodies[0].volume - 1.0).abs() < 1e-9);
}

#[test]
fn fins_without_thickness_belong_to_their_body() {
    // On an edge of a cube stand two faces with nothing between them, turned in any way, or twice as high as the
    // side that they go on from.
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let fin = [tile(x + z, y, z), tile(x + z, z, y)];
    let [rest @ .., side] = cube();
    let high = tile(x, y, z * 2.0);
    for sides in [
        vec![side.clone(), fin[0].clone(), fin[1].clone()],
        vec![side, fin[0].clone(), fin[0].clone()],
        vec![high.clone(), fin[0].clone()],
        vec![fin[1].clone(), high],
    ] {
        let found = of_group(sides.into_iter().chain(rest.clone()));
        assert_eq!((found.bodies.len(), found.open_faces), (1, 0), "{found:?}");
        let body = &found.bodies[0];
        assert!((body.volume - 1.0).abs() < 1e-9, "{body:?}");
        assert!((body.area - 8.0).abs() < 1e-9, "{body:?}");
    }
}

#[test]
fn closed_surfaces_that_touch_are_bodies_of_their_own() {
    // They have both poles in common.
    let frame = Frame::about(DVec3::ZERO, DVec3::Z).unwrap();
    let sphere = modelling::sphere(&frame, 2.0, 0.0..TAU, -PI / 2.0..PI / 2.0).unwrap();
    let wide = DAffine3::from_scale(DVec3::new(2.0, 1.5, 1.0));
    let ellipsoid = sphere.transformed(&wide);
    let found = of_group([sphere, ellipsoid].map(Patch::from));
    let volumes: Vec<_> = found.bodies.iter().map(|body| body.volume).collect();
    let ball = 4.0 / 3.0 * PI * 8.0;
    assert_eq!((volumes.len(), found.open_faces), (2, 0));
    assert!((volumes[0] - ball).abs() < 1e-9, "{volumes:?}");
    assert!((volumes[1] - 3.0 * ball).abs() < 1e-9, "{volumes:?}");
}

#[test]
fn walls_between_bodies_leave_no_volume_that_is_false() {
    let face = |corner: DVec3, u: DVec3, v: DVec3| {
        Patch::from(modelling::plane(corner, u, v, 0.0..1.0, 0.0..1.0).unwrap())
    };
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let walls =
        |low: DVec3| [(low, x), (low + y, x), (low, y), (low + x, y)].map(|(p, u)| face(p, u, z));
    let cube = |low: DVec3| {
        let ends = [low, low + z].map(|p| face(p, x, y));
        ends.into_iter().chain(walls(low))
    };
    let cubes = || cube(DVec3::ZERO).chain(cube(z * 2.0));
    let found = of_group(cubes());
    assert_eq!((found.bodies.len(), found.open_faces), (2, 0));
    // Three faces meet at an edge then, and every border meets another one.
    let found = of_group(cubes().chain(walls(z)));
    assert_eq!((found.bodies.len(), found.open_faces), (0, 16));
}

#[test]
fn surfaces_with_a_border_are_no_bodies() {
    for name in ["teapot.obj", "two_surfaces.igs"] {
        let found = measured(name);
        assert!(found.bodies.is_empty(), "{name}: {found:?}");
        assert!(found.open_faces > 0 && found.area > 0.0);
    }
}

/// How far areas and volumes may be off, and boxes as a share of their diagonal.
const ACCURACY: f64 = 1e-6;

/// The same where offset surfaces are fitted.
const FITTED: f64 = 1e-4;

/// What is known of a file better than from the reference; docs/iges.md has the evidence.
struct Explained {
    /// Part of the names of the files.
    name: &'static str,
    /// The area, by an evaluation that shares nothing with this program, or by the kernel of the
    /// reference with an error bound of 1e-8.
    area: Option<f64>,
    /// The volume, by that kernel with an error bound of 1e-9.
    volume: Option<f64>,
    /// Whether the box of the reference is wrong, or of other points.
    other_box: bool,
    /// How far the values may be off where the file itself says two different things.
    accuracy: f64,
}

const NOTHING: Explained = Explained {
    name: "",
    area: None,
    volume: None,
    other_box: false,
    accuracy: ACCURACY,
};

/// A file of which the reference has another area.
const fn area(name: &'static str, area: f64) -> Explained {
    Explained {
        name,
        area: Some(area),
        ..NOTHING
    }
}

/// A file of which the reference has another area and another box.
const fn area_and_box(name: &'static str, value: f64) -> Explained {
    Explained {
        other_box: true,
        ..area(name, value)
    }
}

/// A file of which the reference has another volume.
const fn volume(name: &'static str, volume: f64, accuracy: f64) -> Explained {
    Explained {
        name,
        volume: Some(volume),
        accuracy,
        ..NOTHING
    }
}

/// Files of which the reference has values that are explained.
const EXPLAINED: [Explained; 13] = [
    area("bench_128-004", 4_057.314_5),
    area("bench_nentity", 18_675.353),
    area("bench_surf114", 23_771.402),
    area("pythonoccd_surf114", 23_771.402),
    area("bench_surf128", 23_771.400),
    area("made_trimmed144_part11752", 2_449_497.068),
    area_and_box("bench_144-000.igs", 223.351_303),
    area_and_box("made_crlf", 223.351_303),
    area_and_box("made_trailing_blanks_stripped", 223.351_303),
    area_and_box("pyiges_impeller", 28_617.103),
    volume("made_brep186_NIST_PMI_1", 14_643_084.867, ACCURACY),
    volume("made_brep186_NIST_PMI_3", 313_108.180, ACCURACY),
    volume("made_brep186_Block", 15_460.144_66, 1e-5),
];

/// The six numbers of a box.
fn numbers(list: &Value) -> Option<(DVec3, DVec3)> {
    let list: Vec<f64> = list.as_array()?.iter().filter_map(Value::as_f64).collect();
    let &[a, b, c, d, e, f] = &list[..] else {
        return None;
    };
    Some((DVec3::new(a, b, c), DVec3::new(d, e, f)))
}

/// The box of the reference, if that holds the points of its own triangles.
fn sound_box(known: &Value) -> Option<(DVec3, DVec3)> {
    let (min, max) = numbers(&known["bbox"])?;
    let near = min.distance(max) * ACCURACY;
    let mesh = numbers(&known["mesh"]["bbox"]);
    let is_sound = mesh.is_none_or(|(low, high)| {
        (min - low).max_element() <= near && (high - max).max_element() <= near
    });
    is_sound.then_some((min, max))
}

/// What is wrong with the measures of a file; nothing if it is not to be compared.
fn compare(name: &str, known: &Value, import: &Import) -> Option<Vec<String>> {
    let (faces, area) = (known["n_faces"].as_u64()?, known["area"].as_f64()?);
    let mut warnings = import.warnings.as_slice().iter();
    let is_untrimmed = warnings.any(|w| w.problem.to_string().contains("untrimmed"));
    let scene = &import.scene;
    if is_untrimmed || faces == 0 || scene.placement_count() != faces {
        return None;
    }
    let explained = EXPLAINED.iter().find(|e| name.contains(e.name));
    let explained = explained.unwrap_or(&NOTHING);
    let is_fitted = known["surface_types"]["OffsetSurface"].is_number();
    let accuracy = if is_fitted {
        FITTED
    } else {
        explained.accuracy
    };
    let unit = scene.unit.as_ref().map_or(1.0, |unit| unit.metres * 1e3);
    let found = measure(scene);
    let mut bad = Vec::new();
    // The reference gives two answers; what they differ by it does not know.
    let better = known["area_adaptive"].as_f64().unwrap_or(area);
    let (better, slack) = explained
        .area
        .map_or((better, (better - area).abs()), |area| (area, 0.0));
    let ours = found.area * unit * unit;
    if (ours - better).abs() > better * accuracy + slack {
        bad.push(format!("{name}: area {ours}, {better} is known"));
    }
    if let Some((min, max)) = sound_box(known).filter(|_| !explained.other_box) {
        let resolution = known["resolution"].as_f64().unwrap_or(0.0) * unit;
        let near = (min.distance(max) * ACCURACY).max(resolution);
        let bounds = found.bounds;
        let (low, high) = (min - bounds.min * unit, bounds.max * unit - max);
        // Theirs holds the free curves, too.
        let is_whole = scene.wires().is_empty();
        let stray = if is_whole {
            low.abs().max(high.abs())
        } else {
            low.max(high)
        };
        let stray = stray.max_element();
        if stray > near {
            bad.push(format!("{name}: box {bounds:?}, {min} to {max} is known"));
        }
    }
    if let Some(volume) = explained.volume.or(known["volume"].as_f64()) {
        let sum: f64 = found.bodies.iter().map(|body| body.volume).sum();
        let ours = sum * unit.powi(3);
        if (ours - volume).abs() > volume * accuracy {
            bad.push(format!("{name}: volume {ours}, {volume} is known"));
        }
    }
    Some(bad)
}

/// Compares with another system, where it sees as many faces as we do and all are trimmed.
#[test]
fn real_files_measure_as_elsewhere() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/corpus");
    let Ok(text) = fs::read_to_string(folder.join("oracle.json")) else {
        return;
    };
    let oracle: Value = serde_json::from_str(&text).expect("JSON");
    let (mut compared, mut bad) = (0, Vec::new());
    let files = oracle.as_object().expect("an object").iter();
    // Those of STEP have tests of their own.
    for (name, known) in files.filter(|(name, _)| !name.starts_with("step/")) {
        let Ok(import) = open(folder.join(name), &Limits::default()) else {
            continue;
        };
        if let Some(found) = compare(name, known, &import) {
            compared += 1;
            bad.extend(found);
        }
    }
    println!("{compared} files compared");
    assert_eq!(bad, [""; 0]);
    assert!(compared > 10);
}

#[test]
fn closed_bodies_in_each_other_keep_apart_however_thin_the_wall() {
    // Cylinders that lie 0.05 apart; chords of their circles are 0.5 away from these.
    let can = |radius: f64, height: f64| {
        let side = modelling::cylinder(&Frame::WORLD, radius, 0.0..TAU, -height..height).unwrap();
        let disc = |z: f64| {
            let rim = Curve::line(DVec3::Z * z, DVec3::new(radius, 0.0, z), 0.0..1.0).unwrap();
            modelling::revolve(&rim, DVec3::ZERO, DVec3::Z, 0.0..TAU).unwrap()
        };
        [side, disc(-height), disc(height)].map(Patch::from)
    };
    let found = of_group([can(100.0, 20.0), can(99.95, 19.95)].concat());
    assert_eq!((found.bodies.len(), found.open_faces), (2, 0));
    for (body, [radius, height]) in found.bodies.iter().zip([[100.0, 20.0], [99.95, 19.95]]) {
        let volume = PI * radius * radius * 2.0 * height;
        assert!((body.volume / volume - 1.0).abs() < 1e-9, "{}", body.volume);
    }
}
