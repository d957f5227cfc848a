use std::io;

use glam::DVec3;

use super::*;
use crate::{Limits, NoFiles, Resolver};

fn read_text(text: &str, resolver: &dyn Resolver) -> Import {
    let limits = &Limits::default();
    let text = format!("#VRML V2.0 utf8\n{text}");
    read(text.as_bytes(), &ReadOptions { limits, resolver }).unwrap()
}

fn read_scene(text: &str) -> Import {
    read_text(text, &NoFiles)
}

fn messages(import: &Import) -> Vec<String> {
    let list = import.warnings.as_slice().iter();
    list.map(ToString::to_string).collect()
}

/// A folder with these files in it.
struct Files<'a>(&'a [(&'a str, &'a str)]);

impl Resolver for Files<'_> {
    fn resolve(&self, name: &str) -> io::Result<Vec<u8>> {
        let found = self.0.iter().find(|(file, _)| *file == name);
        let found = found.ok_or_else(|| io::Error::from(io::ErrorKind::NotFound));
        found.map(|(_, text)| text.as_bytes().to_vec())
    }
}

/// Where the first corner of every triangle stands in the world: one for each `TRIANGLE`.
fn corners(import: &Import) -> Vec<[f64; 3]> {
    let scene = &import.scene;
    let corner = |placement: kernel::Placement| match placement.shape {
        kernel::Shape::Mesh(id) => {
            let point = scene.mesh(id).positions()[0];
            placement.world_from_object.transform_point3(point)
        }
        kernel::Shape::Patch(_) => DVec3::NAN,
    };
    let placements = scene.placements().into_iter();
    placements.map(|p| corner(p).to_array()).collect()
}

const TRIANGLE: &str = "Shape { geometry IndexedFaceSet { coordIndex 0 1 2 \
    coord Coordinate { point [ 1 0 0, 0 1 0, 0 0 1 ] } } }";

#[test]
fn values_end_where_the_next_field_begins() {
    let import = read_scene(
        "Transform { translation 1 2,3 # four\n scale 1 1 1 children [] }\n\
         DEF A-1.x Viewpoint { fieldOfView .5 description \"a\\\"b\" position +1e1 0 -2. }\n\
         Shape { geometry IndexedFaceSet { coordIndex [ 0, 1, 2, -1, # \"\n 0 2 1 ]\n\
           coord DEF C Coordinate { point [ 0 0 0, 1 0 0, # [\n 0 1 0, ] } solid FALSE } }",
    );
    assert_eq!(messages(&import), Vec::<String>::new());
    assert_eq!(import.scene.meshes()[0].triangles(), [[0, 1, 2], [0, 2, 1]]);
    let camera = &import.scene.cameras[0];
    assert_eq!([&*camera.name, &*camera.alias], ["a\"b", "A-1.x"]);
    assert_eq!(camera.eye(), DVec3::new(10.0, 0.0, -2.0));
}

#[test]
fn what_does_not_belong_is_passed_over() {
    let import = read_scene(&format!(
        "}} ] Shape {{ geometry appearance NULL }}\nGroup {{ children [ {TRIANGLE}, 1 ] ] }}\nfoo 3"
    ));
    assert_eq!(corners(&import), [[1.0, 0.0, 0.0]]);
    let expected = [
        "line 2, Scene: } does not belong here; it is passed over",
        "line 2, Scene: ] does not belong here; it is passed over (and 1 more)",
        "line 2, Shape: geometry does not belong here; it is passed over",
        "line 3, Group: 1 does not belong here; it is passed over",
        "line 4, Scene: foo does not belong here; it is passed over",
        "line 4, Scene: 3 does not belong here; it is passed over",
    ];
    assert_eq!(messages(&import), expected);
}

#[test]
fn places_without_a_node_are_skipped_in_lists() {
    for list in [
        format!("NULL {TRIANGLE}"),
        format!("NULL, NULL # none\n {TRIANGLE} NULL"),
        format!("{TRIANGLE} NULL"),
        format!("NULL DEF T {TRIANGLE} NULL"),
    ] {
        let text = format!("Group {{ children [ {list} ] }} {TRIANGLE}");
        let import = read_scene(&text);
        assert_eq!(corners(&import), [[1.0, 0.0, 0.0]; 2], "{list}");
        assert_eq!(messages(&import), [""; 0], "{list}");
    }
    let import = read_scene(&format!("Group {{ children [ NULL ] }} {TRIANGLE}"));
    assert_eq!(import.scene.placement_count(), 1);
    assert_eq!(messages(&import), [""; 0]);
}

#[test]
fn a_file_that_ends_too_soon_keeps_what_was_complete() {
    let import = read_scene(&format!(
        "{TRIANGLE} Group {{ children [ {TRIANGLE} Shape {{"
    ));
    assert_eq!(import.scene.placement_count(), 2);
    assert_eq!(
        messages(&import),
        ["line 2: the file ends inside Shape of line 2"]
    );
    let import = read_scene(&format!("{TRIANGLE} WorldInfo {{ title \"abc"));
    let text = "line 2: a string ends inside WorldInfo of line 2";
    assert_eq!(messages(&import), [text]);
}

#[test]
fn vrml_1_is_refused_kindly() {
    for (text, word) in [
        ("#VRML V1.0 ascii\n", "VRML 97"),
        ("#Inventor V2.1 ascii\n", "VRML 97"),
    ] {
        assert!(sniff(text.as_bytes()));
        let options = ReadOptions {
            limits: &Limits::default(),
            resolver: &NoFiles,
        };
        let problem = read(text.as_bytes(), &options).unwrap_err();
        assert_eq!(problem.problem.kind(), "unsupported");
        assert!(problem.to_string().contains(word), "{problem}");
    }
}

#[test]
fn instances_fill_the_fields_of_a_prototype() {
    let import = read_scene(&format!(
        "PROTO At [ exposedField SFVec3f where 5 0 0  field MFNode what [ {TRIANGLE} ] ] {{\n\
           DEF T Transform {{ translation IS where children IS what }}\n\
           Group {{ children {TRIANGLE} }}\n\
         }}\n\
         At {{ }} At {{ where 0 0 7 }} DEF N At {{ what {TRIANGLE} where 0 2 0 }} USE N\n\
         PROTO Twice [ field SFVec3f a 0 0 1 ] {{\n\
           Group {{ children [ At {{ where IS a }} At {{ where 0 0 2 }} ] }}\n\
         }}\n\
         Twice {{ }} Twice {{ a 0 0 3 }}"
    ));
    assert_eq!(messages(&import), Vec::<String>::new());
    let expected = [
        [6.0, 0.0, 0.0],
        [1.0, 0.0, 7.0],
        [1.0, 2.0, 0.0],
        [1.0, 2.0, 0.0],
        [1.0, 0.0, 1.0],
        [1.0, 0.0, 2.0],
        [1.0, 0.0, 3.0],
        [1.0, 0.0, 2.0],
    ];
    assert_eq!(corners(&import), expected);
    // The default is one mesh, however often it is shown.
    assert_eq!(import.scene.meshes().len(), 2);
    assert!(import.scene.nodes().iter().any(|node| node.name == "N"));
}

#[test]
fn a_prototype_may_be_called_like_the_scene() {
    let import = read_scene("PROTO Scene [] { Shape { geometry Sphere {} } } Scene {} Scene {}");
    assert_eq!(messages(&import), [""; 0]);
    assert_eq!(import.scene.placement_count(), 2);
}

#[test]
fn names_in_a_prototype_are_its_own() {
    let import = read_scene(&format!(
        "DEF A {TRIANGLE}\n\
         PROTO P [ ] {{ Group {{ children [ DEF A Transform {{ translation 0 9 0 children {TRIANGLE} }} \
           USE A ] }} PROTO Inner [ ] {{ Group {{ }} }} }}\n\
         P {{ }} USE A Inner {{ }}"
    ));
    let expected = [
        [1.0, 0.0, 0.0],
        [1.0, 9.0, 0.0],
        [1.0, 9.0, 0.0],
        [1.0, 0.0, 0.0],
    ];
    assert_eq!(corners(&import), expected);
    assert_eq!(messages(&import), ["line 4, Inner: Inner is not read"]);
}

#[test]
fn a_prototype_inside_itself_is_left_out() {
    let import = read_scene(&format!(
        "PROTO P [ ] {{ Group {{ children [ {TRIANGLE} P {{ }} ] }} }}\nP {{ }}"
    ));
    assert_eq!(import.scene.placement_count(), 1);
    assert_eq!(
        messages(&import)[0],
        "line 2, P: a prototype is used inside itself"
    );
}

#[test]
fn a_field_of_a_script_may_be_the_script() {
    let import = read_scene(&format!(
        "DEF S Script {{ field SFNode own USE S url \"javascript:\" }}\n{TRIANGLE}"
    ));
    assert_eq!(import.scene.placement_count(), 1);
    assert_eq!(
        messages(&import),
        ["line 2, Script DEF S: Script is not read"]
    );
}

#[test]
fn prototypes_that_double_and_double_meet_the_limit() {
    let mut text = format!(
        "PROTO P0 [ field SFVec3f a 0 0 0 field SFVec3f b 0 0 0 ] {{ Transform {{ translation IS a children {TRIANGLE} }} }}\n"
    );
    for i in 1..40 {
        text += &format!(
            "PROTO P{i} [ field SFVec3f a 0 0 0 field SFVec3f b 0 0 0 ] {{ Group {{ children [ P{j} {{ a IS a b IS b }} P{j} {{ a IS b b IS a }} ] }} }}\n",
            j = i - 1
        );
    }
    text = format!("#VRML V2.0 utf8\n{text} P39 {{ }}");
    let options = ReadOptions {
        limits: &Limits::default(),
        resolver: &NoFiles,
    };
    let problem = read(text.as_bytes(), &options).unwrap_err();
    assert_eq!(problem.problem.kind(), "too large", "{problem}");
}

#[test]
fn routes_between_instances_meet_the_limit() {
    let limits = Limits {
        entities: 250_000,
        ..Limits::default()
    };
    let options = ReadOptions {
        limits: &limits,
        resolver: &NoFiles,
    };
    let text = |inside: usize| {
        let inside = "Transform { translation IS t } ".repeat(inside);
        format!(
            "#VRML V2.0 utf8\nPROTO P [ exposedField SFVec3f t 0 0 0 ] {{ Group {{ children [ \
             {inside} ] }} }}\nDEF A P {{ }} DEF B P {{ }} {TRIANGLE}\nROUTE A.t TO B.t\n"
        )
    };
    assert!(read(text(20).as_bytes(), &options).is_ok());
    let problem = read(text(40).as_bytes(), &options).unwrap_err();
    assert_eq!(
        problem.to_string(),
        "VRML line 4: more than 1000 nodes and routes made by prototypes"
    );
}

#[test]
fn known_nodes_need_no_file() {
    let import = read_scene(
        "EXTERNPROTO NurbsSurface [ field SFInt32 uDimension ] [ \"urn:x:NurbsSurface\" \"n.wrl\" ]\n\
         EXTERNPROTO MyPatch [ ] \"URN:web3d:vrml97:node:NURBSsurface\"\n\
         EXTERNPROTO Patch97 [ ] \"urn:web3d:vrml97:node:NurbsSurface\"\n\
         PROTO NurbsGroup [ exposedField MFNode children [ ] ] { Group { } }\n\
         NurbsGroup { children [ Shape { geometry NurbsSurface { uDimension 2 vDimension 2 uOrder 2 \
           vOrder 2 controlPoint [ 0 0 0 1 0 0 0 1 0 1 1 0 ] } }\n\
         Shape { geometry MyPatch { uDimension 2 vDimension 2 uOrder 2 vOrder 2 \
           controlPoint [ 0 0 0 2 0 0 0 2 0 2 2 0 ] } }\n\
         Shape { geometry Patch97 { uDimension 2 vDimension 2 uOrder 2 vOrder 2 \
           controlPoint [ 0 0 0 3 0 0 0 3 0 3 3 0 ] } } ] }",
    );
    assert_eq!(messages(&import), Vec::<String>::new());
    assert_eq!(import.scene.patches().len(), 3);
}

#[test]
fn prototypes_and_scenes_come_from_files_beside() {
    let part = format!(
        "#VRML V2.0 utf8\nPROTO A [ ] {{ Group {{ }} }}\n\
        PROTO B [ field SFVec3f at 0 0 0 ] {{ Transform {{ translation IS at children {TRIANGLE} }} }}"
    );
    let scene = "#X3D V3.3 utf8\nUNIT length foot 0.5\nInline { url \"../part.wrl\" }\n\
        EXTERNPROTO C [ ] \"../part.wrl#B\" C { at 0 8 0 }";
    let files = Files(&[("part.wrl", &part), ("sub/scene.x3dv", scene)]);
    let import = read_text(
        "EXTERNPROTO B [ ] [ \"gone.wrl\" \"./part.wrl#B\" ]\nB { at 0 0 4 }\n\
         Transform { translation 0 0 1 children [ Inline { url [ \"sub/scene.x3dv\" ] } ] }",
        &files,
    );
    // Half a metre is the unit of the scene in the folder, a metre that of the prototype.
    assert_eq!(corners(&import), [[1.0, 0.0, 4.0], [1.0, 4.0, 1.0]]);
    assert_eq!(messages(&import), Vec::<String>::new());
}

/// A file with a moved triangle that others may import, and one they should not.
fn wheel() -> String {
    format!(
        "#X3D V3.3 utf8\nDEF A Transform {{ translation 0 1 0 children {TRIANGLE} }}\n\
         DEF B Transform {{ translation 0 2 0 children {TRIANGLE} }}\nEXPORT A AS Wheel"
    )
}

#[test]
fn nodes_of_inlined_files_are_imported() {
    let wheel = wheel();
    let files = Files(&[("w.x3dv", &wheel)]);
    let moved = "DEF T TimeSensor { } DEF P PositionInterpolator { key [ 0 1 ] \
        keyValue [ 0 0 0, 0 8 0 ] } ROUTE T.fraction_changed TO P.set_fraction";
    let import = read_text(
        &format!(
            "DEF I Inline {{ url \"w.x3dv\" }}\nIMPORT I.Wheel AS W\n\
             Transform {{ translation 5 0 0 children USE W }}\n\
             {moved} ROUTE P.value_changed TO W.set_translation"
        ),
        &files,
    );
    assert_eq!(messages(&import), [""; 0]);
    let expected = [[1.0, 1.0, 0.0], [1.0, 2.0, 0.0], [6.0, 1.0, 0.0]];
    assert_eq!(corners(&import), expected);
    let animation = import.animation.as_ref().expect("a route");
    let scene = animation.scene_at(0.5).unwrap();
    let later = Import {
        scene,
        ..Import::default()
    };
    let expected = [[1.0, 4.0, 0.0], [1.0, 2.0, 0.0], [6.0, 4.0, 0.0]];
    assert_eq!(corners(&later), expected);
    // Without AS the name stays.
    let import = read_text(
        "DEF I Inline { url \"w.x3dv\" } IMPORT I.Wheel USE Wheel",
        &files,
    );
    assert_eq!(messages(&import), [""; 0]);
    assert_eq!(import.scene.placement_count(), 3);
}

#[test]
fn what_cannot_be_imported_is_told() {
    let wheel = wheel();
    let small = wheel.replace("utf8\n", "utf8\nUNIT length mm 0.001\n");
    let files = Files(&[("w.x3dv", &wheel), ("s.x3dv", &small)]);
    for (statement, expected) in [
        (
            "IMPORT I.B AS W",
            "w.x3dv has no EXPORT of it; it is taken anyhow",
        ),
        ("IMPORT I.C AS W", "w.x3dv has no such node; it is left out"),
        (
            "IMPORT J.B AS W",
            "no Inline before it has the DEF \"J\"; it is left out",
        ),
        (
            "IMPORT N.B AS W",
            "the Inline N shows no file; it is left out",
        ),
        (
            "IMPORT S.Wheel AS W",
            "s.x3dv has another unit of length; what is used of it or routed to it is not scaled",
        ),
    ] {
        let text = format!(
            "DEF I Inline {{ url \"w.x3dv\" }} DEF N Inline {{ load FALSE }} \
             DEF S Inline {{ url \"s.x3dv\" }}\n{statement}"
        );
        let import = read_text(&text, &files);
        let name = statement.split(['.', ' ']).nth(2).unwrap();
        let expected = format!("line 3, IMPORT of {name}: {expected}");
        assert_eq!(messages(&import), [expected]);
    }
}

#[test]
fn files_cannot_contain_themselves_or_lead_away() {
    let own = "#VRML V2.0 utf8\nInline { url \"own.wrl\" }";
    let files = Files(&[("own.wrl", own)]);
    let import = read_text("Inline { url \"own.wrl\" }", &files);
    assert!(
        messages(&import)[0].ends_with("own.wrl: it contains itself"),
        "{:?}",
        messages(&import)
    );
    let import = read_text(
        "Inline { url \"http://a.b/c.wrl\" } Inline { url \"/etc/passwd\" } Inline { url \"../a\" }",
        &crate::Folder {
            base: std::path::Path::new("."),
            root: std::path::Path::new("."),
            limits: &Limits::default(),
        },
    );
    let expected = [
        "http://a.b/c.wrl: only local files are read",
        "/etc/passwd: the name leads out of the folder",
        "../a: the name leads out of the folder",
    ];
    let place = "line 2, Inline: a file that is named could not be read: ";
    assert_eq!(
        messages(&import),
        expected.map(|text| format!("{place}{text}"))
    );
}

#[test]
fn files_meet_the_limit_together() {
    let limits = Limits {
        bytes: 2 * TRIANGLE.len() + 40,
        ..Limits::default()
    };
    let part = format!("#VRML V2.0 utf8\n{TRIANGLE}");
    let options = ReadOptions {
        limits: &limits,
        resolver: &Files(&[("a.wrl", &part), ("b.wrl", &part), ("c.wrl", &part)]),
    };
    let text = "#VRML V2.0 utf8\nInline { url \"a.wrl\" } Inline { url \"b.wrl\" } \
                Inline { url \"c.wrl\" }";
    let import = read(text.as_bytes(), &options).unwrap();
    assert_eq!(import.scene.placement_count(), 2);
    let told = messages(&import);
    assert!(told[0].ends_with("c.wrl: more than 8 bytes"), "{told:?}");
    let whole = crate::read(
        part.as_bytes(),
        None,
        &ReadOptions {
            limits: &Limits {
                bytes: 100,
                ..limits.clone()
            },
            ..options
        },
    );
    let problem = whole.unwrap_err();
    assert_eq!(problem.to_string(), "the file: more than 100 bytes");
}

#[test]
fn nesting_meets_the_limit() {
    for text in [
        "Group { children ",
        "Group { children [ ",
        "PROTO A [ field MFNode a [ Group { a ",
        "a [ ",
    ] {
        let text = format!("#VRML V2.0 utf8\n{}", text.repeat(1_000_000));
        let options = ReadOptions {
            limits: &Limits::default(),
            resolver: &NoFiles,
        };
        match read(text.as_bytes(), &options) {
            Ok(import) => assert!(!import.warnings.as_slice().is_empty()),
            Err(problem) => assert!(matches!(problem.problem.kind(), "too large" | "invalid")),
        }
    }
}
