use glam::DVec3;
use kernel::{Mesh, Scene};

use super::tests::{AXES, DISK, import, product, read};

/// Four points around a square as number 30, of which the last ones are crossed as strips have them.
const SQUARE: &str = "#30=COORDINATES_LIST('',4,((0.,0.,0.),(1.,0.,0.),(0.,1.,0.),(1.,1.,0.)));\n";

/// Warnings without the lines of their places.
fn placeless(warnings: Vec<String>) -> Vec<String> {
    let after = |text: String| {
        let after = text.split_once(", ").map(|(_, after)| after.to_owned());
        after.unwrap_or(text)
    };
    warnings.into_iter().map(after).collect()
}

/// The only mesh of a product with item #31, and the warnings.
fn mesh(data: &str) -> (Mesh, Vec<String>) {
    let (scene, warnings) = read(&product("#31", &format!("{SQUARE}{data}")));
    let [mesh] = scene.meshes() else {
        panic!("one mesh, {warnings:?}")
    };
    (mesh.clone(), placeless(warnings))
}

/// As [`mesh`], of a file without faults.
fn sound(data: &str) -> Mesh {
    let (mesh, warnings) = mesh(data);
    assert_eq!(warnings, [""; 0]);
    mesh
}

/// The colours of the meshes of a scene where they are shown.
fn colors(scene: &Scene) -> Vec<DVec3> {
    let places = scene.placements();
    let places = places.iter();
    places
        .map(|place| scene.material(place.material.unwrap()).diffuse)
        .collect()
}

/// Style #86 of red surfaces, #96 of blue ones.
const STYLES: &str = "#80=DRAUGHTING_PRE_DEFINED_COLOUR('red');#81=FILL_AREA_STYLE_COLOUR('',#80);\
#82=FILL_AREA_STYLE('',(#81));#83=SURFACE_STYLE_FILL_AREA(#82);#84=SURFACE_SIDE_STYLE('',(#83));\
#85=SURFACE_STYLE_USAGE(.BOTH.,#84);#86=PRESENTATION_STYLE_ASSIGNMENT((#85));\
#90=DRAUGHTING_PRE_DEFINED_COLOUR('blue');#91=FILL_AREA_STYLE_COLOUR('',#90);\
#92=FILL_AREA_STYLE('',(#91));#93=SURFACE_STYLE_FILL_AREA(#92);#94=SURFACE_SIDE_STYLE('',(#93));\
#95=SURFACE_STYLE_USAGE(.BOTH.,#94);#96=PRESENTATION_STYLE_ASSIGNMENT((#95));\n";

#[test]
fn triangles_strips_and_fans_are_meshes() {
    let square = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)];
    let found = sound("#31=TRIANGULATED_FACE('two',#30,4,(),$,(),((1,2,3),(2,4,3)));");
    assert_eq!(
        (found.name.as_str(), found.positions()),
        ("two", &square[..])
    );
    assert_eq!(found.triangles(), [[0, 1, 2], [1, 3, 2]]);
    assert_eq!(
        (found.normals(), found.source.as_str()),
        (&[][..], "#31 TRIANGULATED_FACE")
    );

    let strip =
        sound("#31=COMPLEX_TRIANGULATED_SURFACE_SET('',#30,4,((0.,0.,2.)),$,((1,2,3,4)),());");
    assert_eq!(strip.triangles(), [[0, 1, 2], [2, 1, 3]]);
    assert_eq!(strip.normals(), [DVec3::Z; 4]);
    let fan = sound("#31=COMPLEX_TRIANGULATED_FACE('',#30,4,(),$,(),(),((1,2,4,3)));");
    assert_eq!(
        fan.positions(),
        [square[0], square[1], square[3], square[2]]
    );
    assert_eq!(fan.triangles(), [[0, 1, 2], [0, 2, 3]]);
    // Strips turn round corners by triangles without an area.
    let bent = "#31=COMPLEX_TRIANGULATED_SURFACE_SET('',#30,4,(),(),((1,2,3,3,4)),());";
    assert_eq!(sound(bent).triangles(), [[0, 1, 2]]);
    // Each attribute of a complex instance is with its type.
    let parts = "#31=(COMPLEX_TRIANGULATED_FACE((),((1,2,3)),())GEOMETRIC_REPRESENTATION_ITEM()\
REPRESENTATION_ITEM('parts')TESSELLATED_FACE(#30,4,(),$)TESSELLATED_ITEM()TESSELLATED_STRUCTURED_ITEM());";
    let parts = sound(parts);
    assert_eq!((parts.name.as_str(), parts.triangles().len()), ("parts", 1));
}

#[test]
fn corners_have_the_points_and_normals_of_their_numbers() {
    // The normals go with the numbers of corners, and those stand for points.
    let picked = sound(
        "#31=TRIANGULATED_FACE('',#30,3,((0.,0.,1.),(0.,2.,0.),(0.,-1.,0.)),$,(1,4,3),((1,2,3),(2,3,1)));",
    );
    let corners = [DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
    assert_eq!(picked.positions(), corners);
    assert_eq!(picked.normals(), [DVec3::Z, DVec3::Y, DVec3::NEG_Y]);
    assert_eq!(picked.triangles(), [[0, 1, 2], [1, 2, 0]]);
    // Of a list for many faces each has what it needs.
    let part = sound("#31=TRIANGULATED_SURFACE_SET('',#30,4,(),(),((4,3,2)));");
    assert_eq!(part.positions(), [corners[1], DVec3::Y, DVec3::X]);
    // Triangles that run against their normals are turned, all together.
    let turned = "#31=COMPLEX_TRIANGULATED_FACE('',#30,4,((0.,0.,-1.)),$,(),((1,2,3,4)),());";
    assert_eq!(sound(turned).triangles(), [[0, 2, 1], [2, 3, 1]]);
}

#[test]
fn bodies_have_names_and_looks() {
    let data = format!(
        "{SQUARE}{STYLES}#31=TRIANGULATED_FACE('own',#30,4,(),$,(),((1,2,3)));\
#32=TRIANGULATED_FACE('other',#30,4,(),$,(),((2,4,3)));#33=TESSELLATED_SOLID('body',(#31,#32),$);\
#34=STYLED_ITEM('',(#86),#33);#35=STYLED_ITEM('',(#96),#31);#36=TESSELLATED_SHELL('hidden',(#37),$);\
#37=TRIANGULATED_FACE('',#30,4,(),$,(),((1,2,3)));#38=INVISIBILITY((#36));"
    );
    let (scene, _) = read(&product("#33,#36", &data));
    let names: Vec<_> = scene
        .meshes()
        .iter()
        .map(|mesh| mesh.name.as_str())
        .collect();
    assert_eq!(names, ["own", "other"]);
    assert_eq!(colors(&scene), [DVec3::Z, DVec3::X]);
    assert!(scene.nodes().iter().any(|node| node.name == "body"));
}

#[test]
fn sets_may_be_moved_and_units_hold() {
    let data = format!(
        "{AXES}{SQUARE}#31=TRIANGULATED_SURFACE_SET('',#30,4,(),(),((1,2,3)));\
#40=CARTESIAN_POINT('',(5.,0.,0.));#41=AXIS2_PLACEMENT_3D('',#40,#2,#42);#42=DIRECTION('',(0.,1.,0.));\
#43=(GEOMETRIC_REPRESENTATION_ITEM()REPOSITIONED_TESSELLATED_ITEM(#41)REPRESENTATION_ITEM('moved')\
TESSELLATED_GEOMETRIC_SET((#31))TESSELLATED_ITEM());\
#44=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.CENTI.,.METRE.));\
#45=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#44,#901))REPRESENTATION_CONTEXT('',''));\
#46=TESSELLATED_SHAPE_REPRESENTATION_WITH_ACCURACY_PARAMETERS('',(#10,#43),#45,());\
#47=REPRESENTATION_MAP(#10,#46);#48=MAPPED_ITEM('',#47,#10);"
    );
    let (scene, warnings) = read(&product("#48", &data));
    assert_eq!(warnings, [""; 0]);
    let places = scene.placements();
    assert_eq!(places.len(), 1);
    let moved = places[0].world_from_object.transform_point3(DVec3::X);
    assert!(
        moved.distance(DVec3::new(50.0, 10.0, 0.0)) < 1e-12,
        "{moved}"
    );
    assert!(scene.nodes().iter().any(|node| node.name == "moved"));
}

/// How many patches and meshes there are where triangles #31 stand for face #20 of shell #21, and those in
/// shell #33 for the shell, with the warnings.
fn linked(face: &str, shell: &str, data: &str) -> (usize, usize, Vec<String>) {
    let data = format!(
        "{AXES}{SQUARE}#31=TRIANGULATED_FACE('',#30,4,(),{face},(),((1,2,3)));\
#32=TRIANGULATED_FACE('',#30,4,(),#18,(),((2,4,3)));#33=TESSELLATED_SHELL('',(#31,#32),{shell});\
#34=TESSELLATED_SHAPE_REPRESENTATION('',(#33),#902);\
#35=SHAPE_REPRESENTATION_RELATIONSHIP('','',#907,#34);{data}"
    );
    let (scene, warnings) = read(&product("#22", &data));
    (
        scene.patches().len(),
        scene.meshes().len(),
        placeless(warnings),
    )
}

#[test]
fn exact_shapes_are_shown_instead_of_their_triangles() {
    let hidden = "it is not shown, but the exact shape that it stands for";
    let instead = "the exact shape that it stands for is not shown; its triangles are";
    let found = linked("#20", "#21", DISK);
    let told = format!("#31 TRIANGULATED_FACE: {hidden} (and 1 more)");
    assert_eq!(found, (1, 0, vec![told]));
    // The order in the file means nothing, and a surface on which triangles lie is no exact shape.
    let found = linked("#20", "$", DISK);
    let told = format!("#31 TRIANGULATED_FACE: {hidden}");
    assert_eq!(found, (1, 1, vec![told]));
    let (patches, meshes, warnings) = linked("$", "$", DISK);
    assert_eq!((patches, meshes, warnings.len()), (1, 2, 0));
    // Triangles do not stand for triangles.
    let (patches, meshes, warnings) = linked("$", "#33", DISK);
    assert_eq!((patches, meshes, warnings.len()), (1, 2, 0));
    // Nor for what is hidden.
    let concealed = format!("{DISK}#36=INVISIBILITY((#22));");
    let (patches, meshes, warnings) = linked("#20", "#21", &concealed);
    let told = format!("#31 TRIANGULATED_FACE: {instead} (and 1 more)");
    assert_eq!((patches, meshes, &warnings[0]), (0, 2, &told));
    // A face without a surface cannot be shown, nor a plane without an end.
    let broken = [
        DISK.replace("#18=PLANE('',#10)", "#18=CARTESIAN_POINT('',(0.,0.,0.))"),
        DISK.replace("(#16),#18", "(),#18"),
    ];
    for data in broken {
        let (patches, meshes, warnings) = linked("#20", "#21", &data);
        let told = format!("#31 TRIANGULATED_FACE: {instead} (and 1 more)");
        assert_eq!((patches, meshes), (0, 2), "{warnings:?}");
        assert!(warnings.contains(&told), "{warnings:?}");
        assert!(
            warnings
                .iter()
                .any(|text| text.contains("#20 ADVANCED_FACE")),
            "{warnings:?}"
        );
    }
    // What is not there is not shown either.
    let (_, meshes, warnings) = linked("#99", "$", DISK);
    let told = format!("#31 TRIANGULATED_FACE: {instead}");
    assert_eq!((meshes, warnings), (2, vec![told]));
}

#[test]
fn shapes_of_triangles_may_stand_for_themselves() {
    let face = "#31=TRIANGULATED_FACE('',#30,4,(),$,(),((1,2,3)));";
    let annotation = "#33=COMPLEX_TRIANGULATED_SURFACE_SET('',#30,4,(),(),((1,2,3)),());\
#34=TESSELLATED_GEOMETRIC_SET('',(#33));#35=TESSELLATED_ANNOTATION_OCCURRENCE('',(),#34);";
    let solid = "#32=TESSELLATED_SOLID('',(#31),$);";
    let (scene, warnings) = read(&format!("{SQUARE}{face}{annotation}{solid}"));
    assert_eq!(scene.meshes().len(), 1);
    let expected = [
        "#32 TESSELLATED_SOLID: no representation of a shape has it; it is shown for its own sake",
        "#34 TESSELLATED_GEOMETRIC_SET: it is not shown: no representation of a shape that is \
shown has it (and 1 more)",
    ];
    assert_eq!(placeless(warnings), expected);
    // Where something else is shown, they are not.
    let (scene, warnings) = read(&product("#22", &format!("{AXES}{DISK}{SQUARE}{face}")));
    assert_eq!((scene.patches().len(), scene.meshes().len()), (1, 0));
    assert!(
        warnings[0].contains("#31 TRIANGULATED_FACE: it is not shown"),
        "{warnings:?}"
    );
}

#[test]
fn what_is_wrong_is_told_and_the_rest_goes_on() {
    let place = "#31 COMPLEX_TRIANGULATED_SURFACE_SET: ";
    for (lists, told) in [
        (
            "$,$,((1,2),(1,2,3)),()",
            "one of its triangles, strips and fans is skipped: a strip has 2 corners",
        ),
        (
            "$,(),((1,2,3),(1,2,5),(0,1,2)),((1.5,2,3))",
            "3 of its triangles, strips and fans are skipped: \
the index 5 is not from 1 to 4",
        ),
        ("$,(1,9,3),((1,3,1),(1,2,3)),((1,3,3),(1,1,1,1))", ""),
        (
            "((0.,0.,1.),(0.,0.,1.)),(),((1,2,3)),()",
            "its normals are not used: there are 2 for 4 corners",
        ),
        (
            "((0.,0.,0.)),(),((1,2,3)),()",
            "its normals are not used: one of them has no direction",
        ),
        (
            "((0.,0.)),(),((1,2,3)),()",
            "its normals are not used: a point or a direction has 2 numbers; \
three are needed",
        ),
    ] {
        let data = format!("#31=COMPLEX_TRIANGULATED_SURFACE_SET('',#30,4,{lists});");
        if told.is_empty() {
            let error = import(&product("#31", &format!("{SQUARE}{data}"))).unwrap_err();
            assert!(error.ends_with("the index 9 is not from 1 to 4"), "{error}");
            continue;
        }
        let (found, warnings) = mesh(&data);
        assert_eq!(found.triangles(), [[0, 1, 2]], "{lists}");
        assert_eq!(
            (found.normals().len(), warnings),
            (0, vec![format!("{place}{told}")])
        );
    }
    for (data, told) in [
        (
            "#31=TRIANGULATED_FACE('',#30,4,(),$,(),());",
            "it has no triangles",
        ),
        (
            "#31=TRIANGULATED_FACE('',#30,4,(),$,(),((1,2,3,4)));",
            "a triangle has 4 corners",
        ),
        (
            "#31=TRIANGULATED_FACE('',#31,4,(),$,(),((1,2,3)));",
            "is no list of coordinates that is read",
        ),
        (
            "#31=TRIANGULATED_FACE('',#32,1,(),$,(),((1,2,3)));#32=COORDINATES_LIST('',1,((0.,0.)));",
            "#32 COORDINATES_LIST: a point or a direction has 2 numbers; three are needed",
        ),
        ("#31=TESSELLATED_SHELL('',(),$);", "it has no parts"),
        (
            "#31=TESSELLATED_GEOMETRIC_SET('',(#31));",
            "it contains itself",
        ),
    ] {
        let error = import(&product("#31", &format!("{SQUARE}{data}"))).unwrap_err();
        assert!(error.contains("#31") && error.ends_with(told), "{error}");
    }
    // Counts are not believed, and what is not read is told.
    let data = "#31=TESSELLATED_SHELL('',(#32,#33),$);#32=TESSELLATED_EDGE('',#30,$,(1,2));\
#33=TRIANGULATED_FACE('',#34,999999999,(),$,(),((1,2,3)));\
#34=COORDINATES_LIST('',999999999,((0.,0.,0.),(1.,0.,0.),(0.,1.,0.)));";
    let (found, warnings) = mesh(data);
    assert_eq!(found.triangles().len(), 1);
    let expected = [
        "#32 TESSELLATED_EDGE: it is of a type that is not read",
        "#34 COORDINATES_LIST: it announces another number of points than it has; those that \
it has count",
    ];
    assert_eq!(warnings, expected);
}
