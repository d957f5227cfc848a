//! Areas and volumes of what STEP files show.

use std::f64::consts::{FRAC_PI_2, PI};

use nurbray::formats::{Limits, NoFiles, ReadOptions, read};
use nurbray::{Measure, measure};

/// What is measured of a closed shell of faces, and the warnings; the axes are number 10, the axis is number 11.
fn measured(faces: &str, data: &str) -> (Measure, Vec<String>) {
    let text = format!(
        "ISO-10303-21;
HEADER;
ENDSEC;
DATA;
#1=CARTESIAN_POINT('',(0.,0.,0.));
#2=DIRECTION('',(0.,0.,1.));
#3=DIRECTION('',(1.,0.,0.));
#4=DIRECTION('',(0.,-1.,0.));
#10=AXIS2_PLACEMENT_3D('',#1,#2,#3);
#11=AXIS1_PLACEMENT('',#1,#2);
{data}
#890=CLOSED_SHELL('',({faces}));
#891=MANIFOLD_SOLID_BREP('',#890);
#900=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.));
#901=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));
#902=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#900,#901))\
REPRESENTATION_CONTEXT('',''));
#903=PRODUCT('','','',());
#904=PRODUCT_DEFINITION_FORMATION('','',#903);
#905=PRODUCT_DEFINITION('','',#904,$);
#906=PRODUCT_DEFINITION_SHAPE('','',#905);
#907=SHAPE_REPRESENTATION('',(#891),#902);
#908=SHAPE_DEFINITION_REPRESENTATION(#906,#907);
ENDSEC;
END-ISO-10303-21;
"
    );
    let options = ReadOptions {
        limits: &Limits::default(),
        resolver: &NoFiles,
    };
    let import = read(text.as_bytes(), None, &options).expect("a STEP file");
    let warnings = import.warnings.as_slice().iter().map(ToString::to_string);
    (measure(&import.scene), warnings.collect())
}

/// A circle around the axis, as an edge with this number.
fn rim(number: u32, height: f64, radius: f64) -> String {
    let [point, axes, start, vertex, circle] = [1, 2, 3, 4, 5].map(|k| number + k);
    format!(
        "#{point}=CARTESIAN_POINT('',(0.,0.,{height:?}));
#{axes}=AXIS2_PLACEMENT_3D('',#{point},#2,#3);
#{start}=CARTESIAN_POINT('',({radius:?},0.,{height:?}));
#{vertex}=VERTEX_POINT('',#{start});
#{circle}=CIRCLE('',#{axes},{radius:?});
#{number}=EDGE_CURVE('',#{vertex},#{vertex},#{circle},.T.);
"
    )
}

/// A face on a surface, between edges that are run through forwards or not.
fn face(number: u32, surface: &str, sense: char, bounds: &[(u32, char, char)]) -> String {
    let mut text = String::new();
    let mut list = Vec::new();
    for (k, (edge, along, bound)) in (0..).zip(bounds) {
        let [used, path, id] = [2, 3, 4].map(|at| number + at + 3 * k);
        text += &format!("#{used}=ORIENTED_EDGE('',*,*,#{edge},.{along}.);\n");
        text += &format!("#{path}=EDGE_LOOP('',(#{used}));\n");
        text += &format!("#{id}=FACE_BOUND('',#{path},.{bound}.);\n");
        list.push(format!("#{id}"));
    }
    let [list, at] = [list.join(","), (number + 1).to_string()];
    text += &format!("#{at}={surface};\n#{number}=ADVANCED_FACE('',({list}),#{at},.{sense}.);\n");
    text
}

#[test]
fn conics_that_cross_their_axis_are_turned_once() {
    let close = |found: f64, right: f64| (found - right).abs() < 1e-9 * right;
    // A bowl that has an edge at its rim only.
    let bowl = [
        "#20=AXIS2_PLACEMENT_3D('',#1,#4,#2);\n#21=PARABOLA('',#20,1.);\n",
        &rim(30, 1.0, 2.0),
        &face(
            40,
            "SURFACE_OF_REVOLUTION('',#21,#11)",
            'T',
            &[(30, 'F', 'T')],
        ),
        &face(60, "PLANE('',#32)", 'T', &[(30, 'T', 'T')]),
    ];
    let (found, warnings) = measured("#40,#60", &bowl.concat());
    assert_eq!(warnings, [""; 0]);
    assert_eq!(found.open_faces, 0);
    let right = PI / 3.0 * (8.0_f64.powf(1.5) - 8.0) + 4.0 * PI;
    assert!(close(found.area, right), "{found:?}, not {right}");
    assert!(close(found.bodies[0].volume, 2.0 * PI), "{found:?}");
    // An ellipsoid, twice as high as wide, by its long axis and by its short one.
    for conic in [
        "#4,#2);\n#21=ELLIPSE('',#20,2.,1.);\n",
        "#4,#3);\n#21=ELLIPSE('',#20,1.,2.);\n",
    ] {
        let data = format!("#20=AXIS2_PLACEMENT_3D('',#1,{conic}");
        let data = data + &face(40, "SURFACE_OF_REVOLUTION('',#21,#11)", 'T', &[]);
        let (found, warnings) = measured("#40", &data);
        assert_eq!(warnings, [""; 0]);
        let body = found.bodies.first().expect("a body");
        assert!(close(body.volume.abs(), 8.0 / 3.0 * PI), "{found:?}");
    }
    // The outer sheet of a torus that crosses itself.
    let data = "#19=CARTESIAN_POINT('',(1.,0.,0.));
#20=AXIS2_PLACEMENT_3D('',#19,#4,#3);\n#21=CIRCLE('',#20,2.);\n";
    let data = data.to_owned() + &face(40, "SURFACE_OF_REVOLUTION('',#21,#11)", 'T', &[]);
    let (found, _) = measured("#40", &data);
    let turn = 2.0 / 3.0 * PI;
    let right = 8.0 * PI * (turn + 2.0 * turn.sin());
    assert!(close(found.area, right), "{found:?}, not {right}");
}

#[test]
fn a_loop_that_all_neighbours_contradict_is_turned() {
    // A cylinder with a rounded edge.
    for bound in ['T', 'F'] {
        let data = [
            rim(20, 0.0, 4.0),
            rim(30, 3.0, 4.0),
            rim(40, 3.3, 3.7),
            face(100, "PLANE('',#10)", 'F', &[(20, 'F', 'T')]),
            face(
                200,
                "CYLINDRICAL_SURFACE('',#10,4.)",
                'T',
                &[(20, 'T', 'T'), (30, 'F', 'T')],
            ),
            face(
                300,
                "TOROIDAL_SURFACE('',#32,3.7,0.3)",
                'T',
                &[(30, 'T', bound), (40, 'F', bound)],
            ),
            face(400, "PLANE('',#42)", 'T', &[(40, 'T', 'T')]),
        ];
        let (found, warnings) = measured("#100,#200,#300,#400", &data.concat());
        assert_eq!(warnings.len(), usize::from(bound == 'F'), "{warnings:?}");
        assert_eq!(found.open_faces, 0);
        let round = 2.0 * PI * 0.3 * (3.7 * FRAC_PI_2 + 0.3);
        let right = PI * (16.0 + 24.0 + 3.7 * 3.7) + round;
        assert!((found.area - right).abs() < 1e-9, "{found:?}, not {right}");
    }
}
