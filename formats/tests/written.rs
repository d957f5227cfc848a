//! What writers keep, and what they say about what they leave out.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::{DVec2, DVec3};
use kernel::{Child, Integrals, Item, Node, Projection, Scene, Shape, TrimLoop};
use nurbray_formats::{
    Export, Import, Limits, NoFiles, ReadOptions, Resolver, WRITERS, open, read,
};

fn import(text: &str) -> Import {
    import_with(text, &NoFiles)
}

fn import_with(text: &str, resolver: &dyn Resolver) -> Import {
    let limits = &Limits::default();
    read(text.as_bytes(), None, &ReadOptions { limits, resolver }).expect("a scene")
}

/// One text, whatever the name.
struct Named<'a>(&'a str);

impl Resolver for Named<'_> {
    fn resolve(&self, _: &str) -> std::io::Result<Vec<u8>> {
        Ok(self.0.into())
    }
}

fn written(import: &Import, name: &str) -> Export {
    let writer = WRITERS.iter().find(|w| w.name == name).expect("a writer");
    (writer.write)(&import.scene, "written").expect("a file")
}

/// A scene, written in a format and read again.
fn again(import: &Import, name: &str) -> Import {
    let export = written(import, name);
    self::import(&String::from_utf8(export.bytes).expect("text"))
}

/// What a writer says.
fn told(export: &Export) -> Vec<String> {
    let warnings = export.warnings.as_slice().iter();
    warnings.map(ToString::to_string).collect()
}

#[test]
fn curves_beside_the_only_group_are_written() {
    let import = import(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\ncstype bezier\ndeg 1 1\ncurv 0 1 1 2\nparm u 0 1\nend\n\
         p 3\ng a\nsurf 0 1 0 1 1 2 3 4\nparm u 0 1\nparm v 0 1\nend\n",
    );
    assert_eq!(import.scene.wires().len(), 2);
    for name in ["X3D", "X3D ClassicVRML", "VRML 97", "OBJ"] {
        assert_eq!(again(&import, name).scene.wires().len(), 2, "{name}");
    }
}

#[test]
fn skies_are_written_with_all_their_colours() {
    let import = import(
        "#X3D V3.3 utf8\nTransform { rotation 1 0 0 1 children Background { skyColor [ 0 0 1, \
         0.5 0.5 1, 1 1 1 ] skyAngle [ 0.8 1.57 ] groundColor [ 0.2 0.1 0, 0.4 0.3 0.2 ] \
         groundAngle 1.57 } } Shape { geometry Sphere { } }",
    );
    let sky = import.scene.sky.as_ref().expect("a sky");
    for name in ["X3D", "X3D ClassicVRML", "VRML 97"] {
        let again = again(&import, name);
        let other = again.scene.sky.as_ref().expect(name);
        for direction in [
            DVec3::X,
            DVec3::Y,
            DVec3::NEG_Y,
            DVec3::Z,
            DVec3::NEG_Z,
            DVec3::ONE,
        ] {
            let [a, b] = [sky, other].map(|sky| sky.color(direction));
            assert!(a.distance(b) < 1e-12, "{name} {direction}: {a} {b}");
        }
    }
}

#[test]
fn lights_stand_beside_what_they_light() {
    let import = import(
        "#X3D V3.3 utf8\nUNIT length millimetre 0.001\nDirectionalLight { direction 0 0 -1 }\n\
         Shape { geometry Sphere { } }",
    );
    let text = String::from_utf8(written(&import, "VRML 97").bytes).expect("text");
    assert_eq!(text.matches("\nTransform {").count(), 1, "{text}");
    let [light, shape] = ["DirectionalLight", "Shape"].map(|node| {
        let line = text.lines().find(|line| line.contains(node)).expect(node);
        line.len() - line.trim_start().len()
    });
    assert_eq!(light, shape, "{text}");
    let size = again(&import, "VRML 97").scene.hull_bounds().max.x;
    assert!((size - 0.001).abs() < 1e-15, "{size}");
}

#[test]
fn opacity_of_vertices_is_written_or_told() {
    let import = import(
        "#X3D V3.3 utf8\nShape { geometry IndexedFaceSet { coordIndex [ 0 1 2 ] coord Coordinate { \
         point [ 0 0 0, 1 0 0, 0 1 0 ] } color ColorRGBA { color [ 1 0 0 0.5, 0 1 0 1, 0 0 1 1 ] } } }",
    );
    for (name, is_told) in [
        ("X3D", false),
        ("X3D ClassicVRML", false),
        ("VRML 97", true),
        ("OBJ", true),
    ] {
        let told = told(&written(&import, name));
        let about = told
            .iter()
            .filter(|t| t.contains("the opacity of colours of vertices"));
        assert_eq!(about.count(), usize::from(is_told), "{name}: {told:?}");
    }
}

/// The colour of the first vertex of the only mesh: what is emitted, and what is reflected.
fn vertex(scene: &Scene) -> [DVec3; 2] {
    let placements = scene.placements();
    let placement = placements.first().expect("a mesh");
    let Shape::Mesh(id) = placement.shape else {
        panic!("a surface");
    };
    let material = scene.material(placement.material.expect("a material"));
    let color = scene.mesh(id).colors()[0].truncate();
    match material.is_unlit() {
        true => [material.emissive * color, DVec3::ZERO],
        false => [material.emissive, material.diffuse * color],
    }
}

#[test]
fn colours_of_vertices_come_back_with_what_they_multiply() {
    let faces = "mtllib a.mtl\nusemtl a\nv 0 0 0 1 0.5 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n";
    for material in [
        "newmtl a\nKd 1 1 1\nillum 0\n",
        "newmtl a\nKd 0.5 0.6 0.7\nillum 0\n",
        "newmtl a\nKd 0.5 0.6 0.7\n",
    ] {
        let import = import_with(faces, &Named(material));
        let before = vertex(&import.scene);
        assert!(before.iter().any(|color| *color != DVec3::ZERO));
        for name in ["X3D", "X3D ClassicVRML", "VRML 97"] {
            let after = vertex(&again(&import, name).scene);
            let stray = before[0].distance(after[0]) + before[1].distance(after[1]);
            assert!(stray < 1e-12, "{name}, {material}: {before:?} {after:?}");
        }
    }
}

#[test]
fn what_reflects_nothing_is_no_material_of_vrml_97() {
    let import = import(
        "#X3D V4.0 utf8\nShape { appearance Appearance { material UnlitMaterial { emissiveColor \
         1 0 0 transparency 0.5 } texture PixelTexture { image 1 1 3 0xFFFFFF } } \
         geometry Sphere { } }",
    );
    let expected = [
        "material \"\": the opacity of what reflects nothing: there is no such thing in the format; \
         left out",
        "material \"\": a colour that a picture is multiplied by: there is no such thing in the \
         format; left out",
    ];
    assert_eq!(told(&written(&import, "VRML 97")), expected);
    assert_eq!(told(&written(&import, "X3D")), [""; 0]);
}

#[test]
fn viewpoints_come_back_with_description_and_name() {
    let import = import(
        "#X3D V3.3 utf8\nDEF VP_1 Viewpoint { description \"Front view\" } DEF VP_2 Viewpoint { } \
         DEF VP_3 Viewpoint { description \"Front view\" } Shape { geometry Sphere { } }",
    );
    for name in ["X3D", "X3D ClassicVRML", "VRML 97"] {
        let again = again(&import, name);
        let cameras = again.scene.cameras.iter();
        let names: Vec<_> = cameras.map(|c| (&*c.name, &*c.alias)).collect();
        let expected = [("Front view", "VP_1"), ("VP_2", ""), ("Front view", "VP_3")];
        assert_eq!(names, expected, "{name}");
    }
}

#[test]
fn physical_materials_and_pictures_that_do_nothing_come_back_from_obj() {
    let import = import(
        "#X3D V4.0 utf8\nShape { appearance Appearance { material PhysicalMaterial { baseColor 0.5 \
         0.9 0.1 metallic 0.3 roughness 0.5 emissiveTexture PixelTexture { image 1 1 3 0xFF00FF } } } \
         geometry Rectangle2D { } }",
    );
    let export = written(&import, "OBJ");
    let told = told(&export);
    assert!(
        !told.iter().any(|told| told.contains("picture")),
        "{told:?}"
    );
    let [(_, materials)] = &export.beside[..] else {
        panic!("one file of materials");
    };
    let materials = String::from_utf8(materials.clone()).expect("text");
    assert!(!materials.contains("map_Ke"), "{materials}");
    let text = String::from_utf8(export.bytes).expect("text");
    let again = import_with(&text, &Named(&materials));
    let [a, b] = [&import, &again].map(|import| {
        let id = import.scene.placements()[0].material.expect("a material");
        import.scene.material(id).clone()
    });
    assert!(a.diffuse.distance(b.diffuse) < 1e-12, "{a:?} {b:?}");
    assert!(a.specular.distance(b.specular) < 1e-12, "{a:?} {b:?}");
    assert_eq!(b.emissive, DVec3::ZERO);
}

#[test]
fn looks_from_behind_are_written_at_every_use() {
    let import = import(
        "#X3D V4.0 utf8\nShape { appearance DEF A Appearance { material Material { } backMaterial \
         Material { diffuseColor 1 0 0 } } geometry Sphere { } } Shape { appearance USE A geometry \
         Box { } }",
    );
    let again = again(&import, "X3D");
    let placements = again.scene.placements();
    assert!(placements.len() > 1);
    for placement in placements {
        let material = again
            .scene
            .material(placement.material.expect("a material"));
        assert!(material.back.is_some());
    }
}

#[test]
fn windows_of_parallel_views_come_back() {
    let import = import(
        "#X3D V3.3 utf8\nOrthoViewpoint { fieldOfView -1 -2 3 4 } Shape { geometry Sphere { } }",
    );
    for name in ["X3D", "X3D ClassicVRML"] {
        let camera = &again(&import, name).scene.cameras[0];
        let size = DVec2::new(4.0, 6.0);
        let expected = Projection::OrthographicWindow { size };
        assert_eq!(camera.projection(), expected, "{name}");
        assert_eq!(camera.eye(), DVec3::new(1.0, 1.0, 10.0), "{name}");
    }
}

#[test]
fn what_stands_beside_a_scene_is_told() {
    let moving = import(
        "#VRML V2.0 utf8\nDEF T TimeSensor { } DEF P PositionInterpolator { key [ 0 1 ] keyValue \
         [ 0 0 0, 1 0 0 ] } DEF M Transform { children Shape { geometry Sphere { } } }\n\
         ROUTE T.fraction_changed TO P.set_fraction ROUTE P.value_changed TO M.set_translation",
    );
    let levels = vec![nurbray_formats::Level {
        number: 3,
        name: "screws".to_owned(),
        count: 1,
    }];
    let layered = Import {
        levels,
        ..Import::default()
    };
    for (import, expected) in [
        (
            moving,
            "the file: what moves is written as it stands at first",
        ),
        (layered, "level 3 \"screws\": levels are not written"),
    ] {
        let mut export = Export::default();
        import.tell_unwritten(&mut export.warnings);
        assert_eq!(told(&export), [expected]);
    }
}

/// Two unit squares side by side that are one surface of OBJ in two pieces, with a curve of the parameter
/// domain as trim or hole.
fn two_pieces(corners: &[[f64; 2]], kind: &str) -> String {
    let mut text = String::new();
    for [u, v] in corners {
        text += &format!("vp {u} {v}\n");
    }
    let count = corners.len();
    let list: Vec<_> = (1..=count).map(|k| format!("{k}")).collect();
    let knots: Vec<_> = (0..count).map(|k| format!("{k}")).collect();
    text += &format!(
        "cstype bspline\ndeg 1\ncurv2 {}\nparm u 0 {} {}\nend\n\
         v 0 0 0\nv 1 0 0\nv 1 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nv 0 1 0\nv 0 0 0\n\
         cstype taylor\ndeg 1 1\nsurf 0 2 0 1 1 2 3 4 5 6 7 8\nparm u 0 1 2\nparm v 0 1\n{kind} 0 {} 1\nend\n",
        list.join(" "),
        knots.join(" "),
        count - 1,
        count - 1
    );
    text
}

/// The area of all faces.
fn area(scene: &Scene) -> f64 {
    let faces = scene
        .placements()
        .into_iter()
        .filter_map(|p| match p.shape {
            Shape::Patch(id) => Some(Integrals::of(scene.patch(id), DVec3::ZERO).area()),
            Shape::Mesh(_) => None,
        });
    faces.sum()
}

#[test]
fn pieces_that_loops_cut_away_do_not_come_back() {
    let square = |[a, b]: [f64; 2]| [[a, a], [b, a], [b, b], [a, b], [a, a]];
    for (corners, kind, wanted) in [
        (square([0.25, 0.75]), "trim", 0.25),
        (square([0.25, 0.75]), "hole", 1.75),
        (square([0.0, 1.0]), "hole", 1.0),
    ] {
        let text = two_pieces(&corners, kind);
        let import = import(&text);
        assert!((area(&import.scene) - wanted).abs() < 1e-9, "{kind}");
        for writer in WRITERS {
            let found = area(&again(&import, writer.name).scene);
            assert!(
                (found - wanted).abs() < 1e-9,
                "{} {kind}: {found}",
                writer.name
            );
        }
    }
}

#[test]
fn surfaces_of_which_nothing_is_left_are_told() {
    // A square, beside one of which a hole takes all.
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\ncstype bezier\ndeg 1 1\n\
                surf 0 1 0 1 1 2 3 4\nparm u 0 1\nparm v 0 1\nend\n";
    let mut import = import(text);
    let square = |min: f64, max: f64| TrimLoop::border(&(min..max), &(min..max)).unwrap();
    let mut nothing = import.scene.patches()[0].clone();
    nothing.loops = vec![square(0.0, 1.0), square(-1.0, 2.0).reversed()];
    let id = import.scene.add_patch(nothing).unwrap();
    let item = |shape| {
        Child::Item(Item {
            shape,
            material: None,
        })
    };
    let first = import.scene.placements()[0].shape;
    let children = vec![item(first), item(Shape::Patch(id))];
    let node = Node {
        children,
        ..Node::default()
    };
    let root = import.scene.add_node(node).unwrap();
    import.scene.set_root(root).unwrap();
    for writer in WRITERS {
        let found = area(&again(&import, writer.name).scene);
        assert!((found - 1.0).abs() < 1e-9, "{}: {found}", writer.name);
        let told = told(&written(&import, writer.name));
        let is_told = told
            .iter()
            .any(|text| text.contains("leave nothing of the surface"));
        assert!(is_told, "{}: {told:?}", writer.name);
    }
}

/// The sample with this name.
fn sample(name: &str) -> Import {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../samples");
    open(path.join(name), &Limits::default()).expect("a sample")
}

/// A solid: its name, and for every shell whether it is that of a void, its name, and the names and
/// materials of its faces.
type Solid = (String, Vec<(bool, String, Vec<String>)>);

/// What the scene declares to be solids.
fn solids(scene: &Scene) -> Vec<Solid> {
    let solids = scene.nodes().iter().filter(|node| node.voids.is_some());
    let face = |child: &Child| {
        let Child::Item(Item { shape, material }) = child else {
            panic!("a group in a shell");
        };
        let Shape::Patch(id) = shape else {
            panic!("a mesh in a shell");
        };
        let patch = scene.patch(*id);
        let material = material.or(patch.material).map(|id| scene.material(id));
        format!("{} {:.12?}", patch.name, material.map(|m| m.diffuse))
    };
    let shell = |node: &Node, k: usize| {
        let Child::Node(id) = node.children[k] else {
            panic!("a face that is a shell");
        };
        let shell = scene.node(id);
        let faces = shell.children.iter().map(face).collect();
        (node.is_void(k), shell.name.clone(), faces)
    };
    let shells = |node: &Node| (0..node.children.len()).map(|k| shell(node, k)).collect();
    solids
        .map(|node| (node.name.clone(), shells(node)))
        .collect()
}

#[test]
fn solids_come_back_from_iges() {
    for (name, count) in [("hollow.igs", 1), ("hinge.step", 2)] {
        let import = sample(name);
        let export = written(&import, "IGES");
        assert_eq!(told(&export), [""; 0], "{name}");
        let before = solids(&import.scene);
        assert_eq!(before.len(), count, "{name}");
        assert_eq!(solids(&again(&import, "IGES").scene), before, "{name}");
    }
}

/// The parameters of all entities of a type.
fn records(export: &Export, kind: &str) -> Vec<Vec<usize>> {
    let text = String::from_utf8(export.bytes.clone()).expect("text");
    let cards = text.lines().filter(|line| line[72..].starts_with('P'));
    let all: String = cards.map(|line| line[..64].trim_end()).collect();
    let found = all
        .split(';')
        .filter_map(|record| record.strip_prefix(kind));
    let number = |text: &str| text.parse().expect("a whole number");
    found
        .map(|record| record.split(',').skip(1).map(number).collect())
        .collect()
}

#[test]
fn faces_of_written_solids_share_their_edges_and_look_outwards() {
    let import = sample("hollow.igs");
    let export = written(&import, "IGES");
    let lists = records(&export, "514");
    assert_eq!(lists.len(), 2);
    // Every box has twelve edges between eight vertices.
    for list in records(&export, "504") {
        assert_eq!(list[0], 12);
        let ends: HashSet<_> = (0..12)
            .flat_map(|k| [list[3 + 5 * k], list[5 + 5 * k]])
            .collect();
        assert_eq!(ends.len(), 8);
    }
    let mut uses = HashMap::new();
    for one in records(&export, "508") {
        for stretch in one[1..].chunks(7) {
            // An edge of the list, its number, and whether it is run through as it is.
            assert_eq!(stretch[0], 0);
            uses.entry([stretch[1], stretch[2]])
                .or_insert_with(Vec::new)
                .push(stretch[3]);
        }
    }
    assert_eq!(uses.len(), 24);
    assert!(uses.values_mut().all(|ways| {
        ways.sort_unstable();
        *ways == [0, 1]
    }));
    let solid = &import
        .scene
        .nodes()
        .iter()
        .find(|node| node.voids.is_some());
    let mut all = 0.0;
    for (k, child) in solid.expect("a solid").children.iter().enumerate() {
        let Child::Node(id) = child else {
            panic!("a shell")
        };
        let shell = import.scene.node(*id);
        let flags = lists[k][1..].chunks(2).map(|face| face[1] == 1);
        for (face, looks_along) in shell.children.iter().zip(flags) {
            let Child::Item(Item {
                shape: Shape::Patch(id),
                ..
            }) = face
            else {
                panic!("a face")
            };
            let center = DVec3::new(2.0, 1.5, 1.0);
            let volume = Integrals::of(import.scene.patch(*id), center).volume();
            assert_eq!(looks_along, (volume > 0.0) != (k == 1));
            all += if looks_along { volume } else { -volume };
        }
    }
    // A box of 4 x 3 x 2 around one of 2 x 1 x 1.
    assert!((all - 22.0_f64).abs() < 1e-12, "{all}");
}

#[test]
fn solids_that_are_open_are_written_as_faces_and_told() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../samples/hollow.igs");
    let text = std::fs::read_to_string(path).expect("a sample");
    let shell = "514,6,37,1,47,1,57,1,67,1,77,1,87,1;";
    assert!(text.contains(shell));
    let import = import(&text.replace(shell, "514,5,37,1,47,1,57,1,67,1,77,1;     "));
    let export = written(&import, "IGES");
    let told = told(&export);
    let text = "4 curves around its faces have no partner; it is written as faces side by side, \
                not as a solid";
    assert!(told.iter().any(|told| told.ends_with(text)), "{told:?}");
    assert_eq!(records(&export, "186"), [[0; 0]; 0]);
    // The face that is in no shell stands beside the others.
    assert_eq!(again(&import, "IGES").scene.placements().len(), 12);
}

#[test]
fn voids_that_become_shells_are_told() {
    let import = sample("hollow.igs");
    for writer in WRITERS {
        let is_told = told(&written(&import, writer.name))
            .iter()
            .any(|text| text.contains("voids"));
        assert_eq!(is_told, writer.name != "IGES", "{}", writer.name);
    }
}
