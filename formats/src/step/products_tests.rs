use glam::{DAffine3, DVec3};

use super::tests::{AXES, DISK, product, read, shown};

/// Where a point an inch along the first axis is, moved by placement #72.
const MOVED: DVec3 = DVec3::new(10.0, 25.4, 0.0);

/// As [`product`], of whose representation #907 the disk is not an item. It is that of #87, in inches, of
/// a product #85. Placement #72 turns by a quarter and moves by 10.
fn inches(items: &str, data: &str) -> String {
    let data = format!(
            "{AXES}{DISK}#70=CARTESIAN_POINT('',(10.,0.,0.));
#71=DIRECTION('',(0.,1.,0.));
#72=AXIS2_PLACEMENT_3D('',#70,#2,#71);
#80=(CONVERSION_BASED_UNIT('INCH',#81)LENGTH_UNIT()NAMED_UNIT(#83));
#81=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#900);
#82=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#80,#901))REPRESENTATION_CONTEXT('',''));
#85=PRODUCT_DEFINITION('','',#904,$);
#86=PRODUCT_DEFINITION_SHAPE('','',#85);
#87=MANIFOLD_SURFACE_SHAPE_REPRESENTATION('',(#10,#22),#82);
#88=SHAPE_DEFINITION_REPRESENTATION(#86,#87);
{data}"
    );
    product(items, &data)
}

/// Where the only patch of a file is.
fn only_place(text: &str) -> DAffine3 {
    let (scene, warnings) = read(text);
    assert_eq!(warnings, [""; 0]);
    let [place] = shown(&scene)[..] else {
        panic!("one place")
    };
    place
}

#[test]
fn occurrences_are_placed_whichever_way_they_are_written() {
    let place = |rep_1: u64, rep_2: u64, item_1: u64, item_2: u64| {
        let data = format!(
            "#89=NEXT_ASSEMBLY_USAGE_OCCURRENCE('1','','',#905,#85,'here');
#90=PRODUCT_DEFINITION_SHAPE('','',#89);
#91=ITEM_DEFINED_TRANSFORMATION('','',#{item_1},#{item_2});
#92=(REPRESENTATION_RELATIONSHIP('','',#{rep_1},#{rep_2})\
REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#91)SHAPE_REPRESENTATION_RELATIONSHIP());
#93=CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#92,#90);"
        );
        only_place(&inches("#72", &data))
    };
    for place in [
        place(87, 907, 10, 72),
        place(907, 87, 72, 10),
        // Items that are crossed are told by the representations that have them.
        place(87, 907, 72, 10),
    ] {
        let moved = place.transform_point3(DVec3::X);
        assert!(moved.distance(MOVED) < 1e-12, "{moved}");
    }
}

#[test]
fn representations_are_shown_in_others_in_their_own_units() {
    let related = "#91=ITEM_DEFINED_TRANSFORMATION('','',#10,#72);
#92=(REPRESENTATION_RELATIONSHIP('','',#87,#907)\
REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#91)SHAPE_REPRESENTATION_RELATIONSHIP());";
    let mapped = "#91=REPRESENTATION_MAP(#10,#87);#92=MAPPED_ITEM('',#91,#72);";
    for (items, data) in [("#72", related), ("#92", mapped)] {
        // A representation of no product is not shown for its own sake, too.
        let text = inches(items, data).replace("#88=SHAPE_DEF", "#88=NO_SHAPE_DEF");
        let moved = only_place(&text).transform_point3(DVec3::X);
        assert!(moved.distance(MOVED) < 1e-12, "{moved} {data}");
    }
    // Of a product, it is not shown where it would be alone.
    let moved = only_place(&inches("#92", mapped)).transform_point3(DVec3::X);
    assert!(moved.distance(MOVED) < 1e-12, "{moved}");
    // One that is shown in two ways is there twice, without being made twice.
    let twice = format!("{mapped}#93=MAPPED_ITEM('',#91,#10);");
    let (scene, warnings) = read(&inches("#92,#93", &twice));
    assert_eq!(warnings, [""; 0]);
    assert_eq!((shown(&scene).len(), scene.patches().len()), (2, 1));
}

#[test]
fn what_is_not_shown_is_told() {
    let told = |items: &str, data: &str| {
        let (_, warnings) = read(&product(items, &format!("{AXES}{DISK}{data}")));
        warnings
    };
    let stray = "#30=ADVANCED_FACE('',(#16),#18,.T.);";
    let text = "it is not shown: no representation of a shape that is shown has it";
    assert_eq!(
        told("#22", stray),
        [format!("line 29, #30 ADVANCED_FACE: {text}")]
    );
    let odd = "#30=SWEPT_DISK_SOLID('',#13,1.,$,0.,1.);";
    let text = "it is of a type that is not read";
    assert_eq!(
        told("#22,#30", odd),
        [format!("line 29, #30 SWEPT_DISK_SOLID: {text}")]
    );
    assert_eq!(
        told("#22,#18", ""),
        ["line 25, #18 PLANE: nothing bounds it, and it has no end; it is not shown"]
    );
    let ring = "#30=CYLINDRICAL_SURFACE('',#10,2.);#31=ADVANCED_FACE('',(#16),#30,.T.);\
                #32=OPEN_SHELL('',(#31));";
    let text = "nothing is inside its trim loops, and it has no border of its own; it is not shown";
    assert_eq!(
        told("#22,#32", ring),
        [format!("line 29, #31 ADVANCED_FACE: {text}")]
    );
    // Two lines along one another; one line there and back is a seam instead.
    let hairline = "#40=CYLINDRICAL_SURFACE('',#10,2.);#39=CARTESIAN_POINT('',(0.,2.,0.));\
                    #41=CARTESIAN_POINT('',(0.,2.,5.));#38=VERTEX_POINT('',#39);\
                    #42=VERTEX_POINT('',#41);#43=VECTOR('',#2,5.);#44=LINE('',#39,#43);\
                    #45=LINE('',#39,#43);#46=EDGE_CURVE('',#38,#42,#44,.T.);\
                    #47=EDGE_CURVE('',#38,#42,#45,.T.);#48=ORIENTED_EDGE('',*,*,#46,.T.);\
                    #49=ORIENTED_EDGE('',*,*,#47,.F.);#50=EDGE_LOOP('',(#48,#49));\
                    #51=FACE_BOUND('',#50,.T.);#52=ADVANCED_FACE('',(#51),#40,.T.);\
                    #53=OPEN_SHELL('',(#52));";
    let text = "nothing is inside its trim loops, which are no wider than a line; it is not shown";
    assert_eq!(
        told("#22,#53", hairline),
        [format!("line 29, #52 ADVANCED_FACE: {text}")]
    );
    let text = "face is shown untrimmed: nothing is inside its trim loops";
    assert_eq!(
        told("#22,#53", &hairline.replace("*,*,#47", "*,*,#46")),
        [format!("line 29, #52 ADVANCED_FACE: {text}")]
    );
    // Hidden things are counted, too.
    let hidden = "#30=ADVANCED_FACE('',(#16),#18,.T.);#31=OPEN_SHELL('',(#30));\
                  #32=INVISIBILITY((#31));";
    let told = told("#22,#31", hidden);
    let text = "line 29, #31 OPEN_SHELL: blanked entities are not shown";
    assert!(told.iter().any(|told| told == text), "{told:?}");
}

#[test]
fn shapes_without_products_are_shown() {
    let (scene, warnings) = read(&format!("{AXES}{DISK}"));
    let text = "no representation of a shape has it; it is shown for its own sake";
    assert_eq!(warnings, [format!("line 18, #21 OPEN_SHELL: {text}")]);
    assert_eq!(shown(&scene).len(), 1);
}

#[test]
fn shapes_that_are_told_twice_are_shown_once() {
    let again = "#95=SHAPE_DEFINITION_REPRESENTATION(#906,#907);";
    let other = "#96=PRODUCT_DEFINITION('','',#904,$);#97=PRODUCT_DEFINITION_SHAPE('','',#96);\
                 #98=SHAPE_DEFINITION_REPRESENTATION(#97,#907);";
    for data in [again, other] {
        let place = only_place(&product("#10,#22", &format!("{AXES}{DISK}{data}")));
        assert_eq!(place, DAffine3::IDENTITY, "{data}");
    }
}

#[test]
fn what_stands_beside_a_placed_representation_is_placed_with_it() {
    let data = "#70=CARTESIAN_POINT('',(10.,0.,0.));#72=AXIS2_PLACEMENT_3D('',#70,#2,#3);\
#77=SHAPE_REPRESENTATION('',(#10),#902);#78=MANIFOLD_SURFACE_SHAPE_REPRESENTATION('',(#10,#22),#902);\
#79=SHAPE_REPRESENTATION_RELATIONSHIP('','',#77,#78);\
#91=ITEM_DEFINED_TRANSFORMATION('','',#10,#72);\
#92=(REPRESENTATION_RELATIONSHIP('','',#77,#907)\
REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#91)SHAPE_REPRESENTATION_RELATIONSHIP());";
    // It may be that of a product, too.
    let of_product = "#85=PRODUCT_DEFINITION('','',#904,$);#86=PRODUCT_DEFINITION_SHAPE('','',#85);\
                      #88=SHAPE_DEFINITION_REPRESENTATION(#86,#77);";
    for more in ["", of_product] {
        let place = only_place(&product("#10,#72", &format!("{AXES}{DISK}{data}{more}")));
        assert_eq!(place.translation, DVec3::X * 10.0, "{more}");
    }
}

#[test]
fn units_that_are_not_readable_are_told() {
    let metres = |unit: &str| {
        let text = product("#10,#22", &format!("{AXES}{DISK}"));
        let text = text.replace(".MILLI.,.METRE.", unit);
        let import = super::tests::import(&text).unwrap();
        let warnings: Vec<_> = import
            .warnings
            .as_slice()
            .iter()
            .map(ToString::to_string)
            .collect();
        (import.scene.unit.unwrap().metres, warnings)
    };
    assert_eq!(metres(".centi.,.metre."), (1e-2, vec![]));
    let (found, warnings) = metres(".MANY.,.METRE.");
    assert!((found - 1e-3).abs() < 1e-15, "{found}");
    assert!(
        warnings[0].contains("MANY is no prefix of units"),
        "{warnings:?}"
    );
}

#[test]
fn one_program_writes_the_reciprocals_of_scales() {
    for (writer, scale, wanted) in [
        ("", "2.", 60.8),
        ("", "-1.", -15.4),
        ("/*Open CASCADE \nSTEP processor 8.0*/", "2.", 17.7),
        ("/*Open CASCADE STEP processor 7.9*/", "-1.", -35.4),
        ("/*Open CASCADE STEP processor 7.9*/", "1.", 35.4),
    ] {
        let data = format!(
            "#89=NEXT_ASSEMBLY_USAGE_OCCURRENCE('1','','',#905,#85,'here');
#90=PRODUCT_DEFINITION_SHAPE('','',#89);
#91=CARTESIAN_TRANSFORMATION_OPERATOR_3D('','','',#3,#71,#70,{scale},#2);
#92=(REPRESENTATION_RELATIONSHIP('','',#87,#907)\
REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#91)SHAPE_REPRESENTATION_RELATIONSHIP());
#93=CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#92,#90);"
        );
        let place = only_place(&format!("{writer}{}", inches("#72", &data)));
        let moved = place.transform_point3(DVec3::X);
        let wanted = DVec3::new(wanted, 0.0, 0.0);
        assert!(moved.distance(wanted) < 1e-9, "{moved} {writer} {scale}");
    }
}
