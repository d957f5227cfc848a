use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3};

use super::tests::{AXES, import, product, read};

/// The corners of the only patch: at both starts, at the end of u, of v, of both; and its normal in the
/// middle.
fn corners(surface: &str) -> ([DVec3; 4], DVec3) {
    let data = format!(
        "{AXES}#4=DIRECTION('',(0.,1.,0.));#5=VECTOR('',#2,2.);#6=VECTOR('',#3,1.);\
#7=CARTESIAN_POINT('',(3.,0.,0.));#8=LINE('',#7,#5);#9=AXIS1_PLACEMENT('',#1,#2);\
#11=CIRCLE('',#10,3.);{surface}"
    );
    let (scene, warnings) = read(&product("#20", &data));
    // What is offset is another surface, which is told.
    let is_told = |text: &String| surface.contains("OFFSET") && text.contains("fitted to 1e-6");
    assert!(warnings.iter().all(is_told), "{warnings:?} {surface}");
    let [patch] = scene.patches() else {
        panic!("one patch: {surface}")
    };
    let surface = &patch.surface;
    let [u, v] = [surface.knots_u().domain(), surface.knots_v().domain()];
    let at = |u: f64, v: f64| surface.evaluate(DVec2::new(u, v));
    let middle = DVec2::new(u.start.midpoint(u.end), v.start.midpoint(v.end));
    let normal = surface.normal(middle).unwrap();
    let ends = [
        at(u.start, v.start),
        at(u.end, v.start),
        at(u.start, v.end),
        at(u.end, v.end),
    ];
    (ends, normal)
}

#[test]
fn swept_surfaces_are_trimmed_by_parameters() {
    let near = |found: [DVec3; 4], wanted: [[f64; 3]; 4], surface: &str| {
        for (found, wanted) in found.into_iter().zip(wanted) {
            assert!(found.distance(wanted.into()) < 1e-12, "{found} {surface}");
        }
    };
    // A quarter of a circle, moved along a vector of length 2 from minus a half to one and a half of it;
    // of a curve that is trimmed to another part the parameters count all the same.
    let trimmed =
        "#12=TRIMMED_CURVE('',#11,(PARAMETER_VALUE(0.)),(PARAMETER_VALUE(3.)),.T.,.PARAMETER.);";
    for rail in [11, 12] {
        let surface = format!(
            "{trimmed}#13=SURFACE_OF_LINEAR_EXTRUSION('',#{rail},#5);\
#20=RECTANGULAR_TRIMMED_SURFACE('',#13,0.,{FRAC_PI_2:?},-0.5,1.5,.T.,.T.);"
        );
        let (found, normal) = corners(&surface);
        let wanted = [
            [3.0, 0.0, -1.0],
            [0.0, 3.0, -1.0],
            [3.0, 0.0, 3.0],
            [0.0, 3.0, 3.0],
        ];
        near(found, wanted, &surface);
        assert!(
            normal.distance(DVec3::new(1.0, 1.0, 0.0).normalize()) < 1e-9,
            "{normal}"
        );
    }
    // A line turned around an axis: the angle comes first.
    let surface = format!(
        "#13=SURFACE_OF_REVOLUTION('',#8,#9);\
#20=RECTANGULAR_TRIMMED_SURFACE('',#13,0.,{FRAC_PI_2:?},1.,2.5,.T.,.T.);"
    );
    let (found, normal) = corners(&surface);
    let wanted = [
        [3.0, 0.0, 2.0],
        [0.0, 3.0, 2.0],
        [3.0, 0.0, 5.0],
        [0.0, 3.0, 5.0],
    ];
    near(found, wanted, &surface);
    assert!(
        normal.distance(DVec3::new(1.0, 1.0, 0.0).normalize()) < 1e-9,
        "{normal}"
    );
}

#[test]
fn what_is_offset_or_moved_is_trimmed_by_the_parameters_below() {
    let part = |number: u32, of: u32| {
        format!("#{number}=RECTANGULAR_TRIMMED_SURFACE('',#{of},0.,{FRAC_PI_2:?},-1.,4.,.T.,.T.);")
    };
    let base = "#30=CYLINDRICAL_SURFACE('',#10,3.);#31=OFFSET_SURFACE('',#30,0.5,.F.);\
#32=CARTESIAN_TRANSFORMATION_OPERATOR_3D('','','',$,$,#1,2.,$);#33=SURFACE_REPLICA('',#30,#32);\
#34=SURFACE_REPLICA('',#31,#32);";
    let wider = "#35=RECTANGULAR_TRIMMED_SURFACE('',#30,-1.,3.,-2.,9.,.T.,.T.);";
    let against = "#37=RECTANGULAR_TRIMMED_SURFACE('',#30,3.,-1.,-2.,9.,.F.,.T.);";
    let cases = [
        (part(20, 31), 3.5, [-1.0, 4.0]),
        (part(20, 33), 6.0, [-2.0, 8.0]),
        (part(20, 34), 7.0, [-2.0, 8.0]),
        (format!("{wider}{}", part(20, 35)), 3.0, [-1.0, 4.0]),
        (
            format!("{}#20=OFFSET_SURFACE('',#36,-0.5,.F.);", part(36, 30)),
            2.5,
            [-1.0, 4.0],
        ),
        (
            format!("{}#20=SURFACE_REPLICA('',#36,#32);", part(36, 31)),
            7.0,
            [-2.0, 8.0],
        ),
        // Turned round, it is offset to the other side, whatever it is a part of.
        (
            format!(
                "{against}#36=OFFSET_SURFACE('',#37,0.5,.F.);{}",
                part(20, 36)
            ),
            2.5,
            [-1.0, 4.0],
        ),
        (
            format!(
                "{against}{}#20=OFFSET_SURFACE('',#36,0.5,.F.);",
                part(36, 37)
            ),
            2.5,
            [-1.0, 4.0],
        ),
        (
            format!("#36=OFFSET_SURFACE('',#31,-0.25,.F.);{}", part(20, 36)),
            3.25,
            [-1.0, 4.0],
        ),
    ];
    for (surface, radius, [low, high]) in cases {
        let (found, normal) = corners(&format!("{base}{surface}"));
        let wanted = [
            [radius, 0.0, low],
            [0.0, radius, low],
            [radius, 0.0, high],
            [0.0, radius, high],
        ];
        for (found, wanted) in found.into_iter().zip(wanted) {
            assert!(found.distance(wanted.into()) < 1e-6, "{found} {surface}");
        }
        let out = DVec3::new(1.0, 1.0, 0.0).normalize();
        assert!(normal.distance(out) < 1e-3, "{normal} {surface}");
    }
}

#[test]
fn a_surface_of_revolution_is_bounded_by_its_curve() {
    let curve = "#30=BEZIER_CURVE('',2,(#7,#31,#32),.UNSPECIFIED.,.F.,.F.);\
#31=CARTESIAN_POINT('',(3.,0.,1.));#32=CARTESIAN_POINT('',(2.,0.,2.));";
    let (found, _) = corners(&format!("{curve}#20=SURFACE_OF_REVOLUTION('',#30,#9);"));
    for (found, wanted) in [(found[0], [3.0, 0.0, 0.0]), (found[3], [2.0, 0.0, 2.0])] {
        assert!(found.distance(wanted.into()) < 1e-12, "{found}");
    }
}

#[test]
fn parameters_along_joined_curves_are_told() {
    let data = format!(
        "{AXES}#11=CIRCLE('',#10,3.);#12=COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,.T.,#11);\
#13=COMPOSITE_CURVE('',(#12),.F.);#5=VECTOR('',#2,2.);#14=SURFACE_OF_LINEAR_EXTRUSION('',#13,#5);\
#20=RECTANGULAR_TRIMMED_SURFACE('',#14,0.,1.,0.,1.,.T.,.T.);"
    );
    let error = import(&product("#20", &data)).unwrap_err();
    assert!(error.contains("count along a COMPOSITE_CURVE"), "{error}");
}
