//! What few programs write: looks of bare items, holes without a border, and loops named over and over.

use std::f64::consts::PI;

use glam::DVec3;

use super::tests::{AXES, DISK, import, product, read};
use crate::{Limits, NoFiles, ReadOptions};

#[test]
fn solids_by_construction_and_bare_surfaces_have_a_look() {
    let style = "#60=COLOUR_RGB('',1.,0.,0.);#61=FILL_AREA_STYLE_COLOUR('',#60);#62=FILL_AREA_STYLE('',(#61));\
                 #63=SURFACE_STYLE_FILL_AREA(#62);#64=SURFACE_SIDE_STYLE('',(#63));\
                 #65=SURFACE_STYLE_USAGE(.BOTH.,#64);#66=PRESENTATION_STYLE_ASSIGNMENT((#65));\
                 #67=STYLED_ITEM('',(#66),#20);";
    let plane = "#18=PLANE('',#10);";
    for shape in [
        "#19=SPHERE('',1.,#1);#20=CSG_SOLID('',#19);",
        "#20=RECTANGULAR_TRIMMED_SURFACE('',#18,0.,1.,0.,1.,.T.,.T.);",
        "#20=B_SPLINE_SURFACE_WITH_KNOTS('',1,1,((#1,#31),(#32,#33)),$,.F.,.F.,.F.,\
         (2,2),(2,2),(0.,1.),(0.,1.),$);\
         #31=CARTESIAN_POINT('',(0.,1.,0.));#32=CARTESIAN_POINT('',(1.,0.,0.));\
         #33=CARTESIAN_POINT('',(1.,1.,0.));",
    ] {
        let look = |more: &str, items: &str| {
            read(&product(
                items,
                &format!("{AXES}{plane}{shape}{style}{more}"),
            ))
        };
        let (scene, _) = look("", "#20");
        let materials = scene.placements().into_iter().map(|p| p.material);
        for material in materials {
            let diffuse = material.map(|id| scene.material(id).diffuse);
            assert_eq!(diffuse, Some(DVec3::X), "{shape}");
        }
        let hidden = "#70=INVISIBILITY((#67));#71=SPHERE('',1.,#1);";
        let (scene, _) = look(hidden, "#20,#71");
        assert_eq!(scene.placement_count(), 1, "{shape}");
    }
    // What stands on its tip.
    let cone = "#20=RIGHT_CIRCULAR_CONE('',#9,2.,0.,0.5);#9=AXIS1_PLACEMENT('',#1,#2);";
    let (scene, warnings) = read(&product("#20", &format!("{AXES}{cone}")));
    assert_eq!(warnings, [""; 0]);
    let found = scene.extent();
    assert!(
        (found.min.z).abs() < 1e-12 && (found.max.z - 2.0).abs() < 1e-12,
        "{found:?}"
    );
    let radius = 2.0 * 0.5_f64.tan();
    assert!((found.max.x - radius).abs() < 1e-9, "{found:?}");
}

#[test]
fn replicas_and_curves_on_surfaces_may_stand_for_themselves() {
    let square = "#20=B_SPLINE_SURFACE_WITH_KNOTS('',1,1,((#1,#31),(#32,#33)),$,.F.,.F.,.F.,\
        (2,2),(2,2),(0.,1.),(0.,1.),$);\
        #31=CARTESIAN_POINT('',(0.,1.,0.));#32=CARTESIAN_POINT('',(1.,0.,0.));\
        #33=CARTESIAN_POINT('',(1.,1.,0.));#34=CARTESIAN_POINT('',(5.,0.,0.));\
        #40=CARTESIAN_TRANSFORMATION_OPERATOR_3D('',$,$,$,#34,2.,$);\
        #41=POLYLINE('',(#1,#32,#33));#42=COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,.T.,#41);";
    let at = |item: &str| read(&product("#50", &format!("{AXES}{square}#50={item};")));
    let (scene, warnings) = at("SURFACE_REPLICA('',#20,#40)");
    assert_eq!(warnings, [""; 0]);
    let found = scene.extent();
    assert!((found.min - DVec3::new(5.0, 0.0, 0.0)).length() < 1e-12);
    assert!((found.max - DVec3::new(7.0, 2.0, 0.0)).length() < 1e-12);
    for item in [
        "CURVE_REPLICA('',#41,#40)",
        "COMPOSITE_CURVE_ON_SURFACE('',(#42),.F.)",
    ] {
        let (scene, warnings) = at(item);
        assert_eq!((scene.wires().len(), scene.patches().len()), (1, 0));
        let told = |text: &String| text.contains("no surface to show");
        assert!(warnings.iter().all(told), "{item}: {warnings:?}");
    }
}

#[test]
fn what_is_no_step_is_refused() {
    for (text, told) in [
        ("hello\n", "this is no STEP file"),
        ("<?xml version=\"1.0\"?>\n<iso_10303_28/>", "it is XML"),
    ] {
        let options = ReadOptions {
            limits: &Limits::default(),
            resolver: &NoFiles,
        };
        let error = crate::read(text.as_bytes(), Some("step"), &options).unwrap_err();
        assert!(error.to_string().contains(told), "{error}");
    }
}

#[test]
fn boundaries_may_be_holes_in_a_whole_surface() {
    let square = "#20=CURVE_BOUNDED_SURFACE('',#21,(#40),.T.);\
        #21=B_SPLINE_SURFACE_WITH_KNOTS('',1,1,((#30,#31),(#32,#33)),$,.F.,.F.,.F.,\
        (2,2),(2,2),(0.,1.),(0.,1.),$);\
        #30=CARTESIAN_POINT('',(-2.,-2.,0.));#31=CARTESIAN_POINT('',(-2.,2.,0.));\
        #32=CARTESIAN_POINT('',(2.,-2.,0.));#33=CARTESIAN_POINT('',(2.,2.,0.));\
        #40=BOUNDARY_CURVE('',(#41),.F.);#41=COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,.T.,#42);\
        #42=CIRCLE('',#10,1.);";
    for (word, expected) in [(".T.", 16.0 - PI), (".F.", PI)] {
        let data = format!(
            "{AXES}{}",
            square.replace(".T.);#21", &format!("{word});#21"))
        );
        let (scene, warnings) = read(&product("#20", &data));
        let area = kernel::Integrals::of(&scene.patches()[0], DVec3::ZERO).area();
        assert!(
            (area - expected).abs() < 1e-6,
            "{word}: {area} {warnings:?}"
        );
    }
}

#[test]
fn loops_that_are_named_over_and_over_are_refused() {
    // A thousand times a loop of a thousand edges, in less than twenty thousand bytes.
    let edges = ["#14"; 1000].join(",");
    let bounds = ["#16"; 1000].join(",");
    let data = DISK
        .replace("EDGE_LOOP('',(#14))", &format!("EDGE_LOOP('',({edges}))"))
        .replace("'disk',(#16)", &format!("'disk',({bounds})"));
    let found = import(&product("#20", &format!("{AXES}{data}")));
    let error = found.expect_err("a thousand loops");
    assert!(error.contains("named so often"), "{error}");
}

#[test]
fn solids_of_several_types_and_looks_of_representations() {
    // A solid that is said to be faceted, with a void: both shells are the disk.
    let solid = "#40=(BREP_WITH_VOIDS((#21))FACETED_BREP()GEOMETRIC_REPRESENTATION_ITEM()\
                 MANIFOLD_SOLID_BREP(#21)REPRESENTATION_ITEM('both')SOLID_MODEL());";
    let (scene, _) = read(&product("#10,#40", &format!("{AXES}{DISK}{solid}")));
    assert_eq!(scene.placement_count(), 2);
    assert!(scene.nodes().iter().any(|node| node.name == "both"));
    let style = "#60=COLOUR_RGB('',1.,0.,0.);#61=FILL_AREA_STYLE_COLOUR('',#60);#62=FILL_AREA_STYLE('',(#61));\
                 #63=SURFACE_STYLE_FILL_AREA(#62);#64=SURFACE_SIDE_STYLE('',(#63));\
                 #65=SURFACE_STYLE_USAGE(.BOTH.,#64);#66=PRESENTATION_STYLE_ASSIGNMENT((#65));\
                 #67=STYLED_ITEM('',(#66),#907);";
    let (scene, warnings) = read(&product("#10,#22", &format!("{AXES}{DISK}{style}")));
    assert_eq!(warnings, [""; 0]);
    let material = scene.placements()[0].material.unwrap();
    assert_eq!(scene.material(material).diffuse, DVec3::X);
    // A face on a part of a surface uses that.
    let part = "#18=RECTANGULAR_TRIMMED_SURFACE('',#19,-9.,9.,-9.,9.,.T.,.T.);#19=PLANE('',#10);";
    let disk = DISK.replace("#18=PLANE('',#10);", part);
    let (_, warnings) = read(&product("#10,#22", &format!("{AXES}{disk}")));
    assert_eq!(warnings, [""; 0]);
}

#[test]
fn curves_may_be_hidden() {
    let curves = "#40=CIRCLE('',#10,1.);#41=CIRCLE('',#10,2.);#42=GEOMETRIC_CURVE_SET('',(#40,#41));\
                  #50=COLOUR_RGB('',1.,0.,0.);#51=CURVE_STYLE('',$,$,#50);\
                  #52=PRESENTATION_STYLE_ASSIGNMENT((#51));#53=STYLED_ITEM('',(#52),#40);";
    let shown = |more: &str| {
        let (scene, _) = read(&product("#10,#42", &format!("{AXES}{curves}{more}")));
        scene.wire_placements().len()
    };
    assert_eq!((shown(""), shown("#54=INVISIBILITY((#53));")), (2, 1));
}

#[test]
fn parameters_tell_on_which_half_of_a_profile_a_face_is() {
    // A quarter of a ball, or of one that is twice as high, from where the profile is beyond the axis.
    for shape in ["CIRCLE('',#at,1.)", "ELLIPSE('',#at,1.,2.)"] {
        let height = if shape.starts_with('C') { 1.0 } else { 2.0 };
        let curve = |place: &str| shape.replace("#at", place);
        let (first, second) = (curve("#30"), curve("#31"));
        let (low, high) = (0.5 * PI, 1.5 * PI);
        let flat = format!(
            "#70=PCURVE('',#45,#71);#71=DEFINITIONAL_REPRESENTATION('',(#72),#99);\
             #72=LINE('',#73,#36);#73=CARTESIAN_POINT('',(0.,0.));\
             #80=PCURVE('',#45,#81);#81=DEFINITIONAL_REPRESENTATION('',(#82),#99);\
             #82=B_SPLINE_CURVE_WITH_KNOTS('',1,(#83,#84),.UNSPECIFIED.,.F.,.F.,(2,2),(0.,1.),.UNSPECIFIED.);\
             #83=CARTESIAN_POINT('',({low:?},{low:?}));#84=CARTESIAN_POINT('',({low:?},{high:?}));"
        );
        let data = format!(
            "{AXES}#30=AXIS2_PLACEMENT_3D('',#1,#32,#3);#31=AXIS2_PLACEMENT_3D('',#1,#3,#33);\
             #32=DIRECTION('',(0.,-1.,0.));#33=DIRECTION('',(0.,1.,0.));\
             #34={first};#35={second};#36=VECTOR('',#37,1.);#37=DIRECTION('',(0.,1.));\
             #44=AXIS1_PLACEMENT('',#1,#2);#45=SURFACE_OF_REVOLUTION('',#34,#44);\
             {flat}#50=SURFACE_CURVE('',#34,(#70),.CURVE_3D.);#51=SURFACE_CURVE('',#35,(#80),.CURVE_3D.);\
             #52=CARTESIAN_POINT('',(0.,0.,{height:?}));#53=CARTESIAN_POINT('',(0.,0.,-{height:?}));\
             #54=VERTEX_POINT('',#52);#55=VERTEX_POINT('',#53);\
             #56=EDGE_CURVE('',#54,#55,#50,.T.);#57=EDGE_CURVE('',#54,#55,#51,.T.);\
             #58=ORIENTED_EDGE('',*,*,#57,.T.);#59=ORIENTED_EDGE('',*,*,#56,.F.);\
             #60=EDGE_LOOP('',(#58,#59));#61=FACE_BOUND('',#60,.T.);\
             #62=ADVANCED_FACE('',(#61),#45,.T.);#63=OPEN_SHELL('',(#62));\
             #64=SHELL_BASED_SURFACE_MODEL('',(#63));"
        );
        let (scene, warnings) = read(&product("#64", &data));
        assert_eq!(warnings, [""; 0], "{shape}");
        let patch = &scene.patches()[0];
        let region = patch.region().unwrap();
        let nearby = kernel::nearest::Nearby::new(&patch.surface, patch.surface.closed());
        for (turn, is_there) in [
            (1.25, true),
            (1.05, true),
            (1.45, true),
            (0.95, false),
            (0.25, false),
            (1.55, false),
        ] {
            let point = DVec3::new((turn * PI).cos(), (turn * PI).sin(), 0.0);
            let found = nearby.nearest(point, None);
            assert!(found.distance < 1e-9, "{shape}");
            assert_eq!(region.contains(found.uv), is_there, "{shape} {turn}");
        }
    }
}
