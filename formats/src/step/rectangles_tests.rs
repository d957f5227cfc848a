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
    assert_eq!(warnings, [""; 0], "{surface}");
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
fn parameters_along_joined_curves_are_told() {
    let data = format!(
        "{AXES}#11=CIRCLE('',#10,3.);#12=COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,.T.,#11);\
#13=COMPOSITE_CURVE('',(#12),.F.);#5=VECTOR('',#2,2.);#14=SURFACE_OF_LINEAR_EXTRUSION('',#13,#5);\
#20=RECTANGULAR_TRIMMED_SURFACE('',#14,0.,1.,0.,1.,.T.,.T.);"
    );
    let error = import(&product("#20", &data)).unwrap_err();
    assert!(error.contains("count along a COMPOSITE_CURVE"), "{error}");
}
