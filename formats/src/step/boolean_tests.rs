//! Solids that are combined, and pyramids.

use glam::DVec3;
use kernel::{Aabb, Integrals, Patch};

use super::tests::{AXES, import, product, read};

/// A block, another one that comes out of its side, and what is made of them.
fn combined(keyword: &str, operation: &str) -> String {
    format!(
        "{AXES}#20=BLOCK('',#10,2.,2.,2.);#30=CARTESIAN_POINT('',(1.,0.5,0.5));
#31=AXIS2_PLACEMENT_3D('',#30,$,$);#21=BLOCK('',#31,2.,1.,1.);
#22={keyword}('',.{operation}.,#20,#21);#23=CSG_SOLID('',#22);"
    )
}

fn bounds(patches: &[Patch]) -> Aabb {
    patches
        .iter()
        .fold(Aabb::EMPTY, |all, face| all.union(face.bounds()))
}

#[test]

fn the_second_solid_is_taken_from_the_first() {
    for (operation, area, ends) in [
        ("UNION", 28.0, [0.0, 3.0]),
        ("INTERSECTION", 6.0, [1.0, 2.0]),
        ("DIFFERENCE", 28.0, [0.0, 2.0]),
    ] {
        for keyword in ["BOOLEAN_RESULT", "BOOLEAN_CLIPPING_RESULT"] {
            let (scene, warnings) = read(&product("#23", &combined(keyword, operation)));
            assert_eq!(warnings, [""; 0], "{operation}");
            let area_of = |face: &Patch| Integrals::of(face, DVec3::ZERO).area();
            let found: f64 = scene.patches().iter().map(area_of).sum();
            assert!((found - area).abs() < 1e-6, "{operation}: {found}");
            let all = bounds(scene.patches());
            assert!((all.min.x - ends[0]).abs() < 1e-6, "{operation}: {all:?}");
            assert!((all.max.x - ends[1]).abs() < 1e-6, "{operation}: {all:?}");
        }
    }
}

#[test]
fn solids_that_are_not_combined_are_told() {
    let half = |operation: &str| {
        let solids = format!(
            "{AXES}#20=BLOCK('',#10,2.,2.,2.);#18=PLANE('',#10);#21=HALF_SPACE_SOLID('',#18,.T.);
#19=SPHERE('',1.,#1);#22=BOOLEAN_CLIPPING_RESULT('',.{operation}.,#20,#21);"
        );
        read(&product("#19,#22", &solids))
    };
    // What is cut by something else is not shown whole.
    for (operation, shown, text) in [
        (
            "UNION",
            7,
            "one of its two solids is not read; the other one is shown",
        ),
        ("INTERSECTION", 1, "one of its two solids is not read"),
        ("DIFFERENCE", 1, "one of its two solids is not read"),
    ] {
        let (scene, warnings) = half(operation);
        assert_eq!(scene.placements().len(), shown, "{operation}");
        let told = |what: &str| warnings.iter().any(|text| text.ends_with(what));
        assert!(
            told("half spaces are not read: nothing bounds them"),
            "{warnings:?}"
        );
        assert!(told(text), "{warnings:?}");
    }
    let neither = combined("BOOLEAN_RESULT", "SUM");
    let error = import(&product("#23", &neither)).unwrap_err();
    let text = "an operation that is neither .UNION., .INTERSECTION. nor .DIFFERENCE.";
    assert!(error.ends_with(text), "{error}");
}

#[test]
fn shells_are_no_solids_that_are_combined() {
    let text = |operation: &str| {
        format!(
            "{AXES}#18=PLANE('',#10);#19=RECTANGULAR_TRIMMED_SURFACE('',#18,0.,1.,0.,1.,.T.,.T.);
#20=SPHERE('',1.,#1);#22=BOOLEAN_RESULT('',.{operation}.,#20,#19);"
        )
    };
    let (scene, warnings) = read(&product("#22", &text("UNION")));
    assert_eq!(scene.patches().len(), 2);
    let told = "its bodies are shown whole, also inside each other: ";
    assert!(
        warnings[0].contains(told) && warnings[0].ends_with(" is no solid"),
        "{warnings:?}"
    );
    let error = import(&product("#22", &text("INTERSECTION"))).unwrap_err();
    assert!(error.ends_with(" is no solid"), "{error}");
}

#[test]
fn pyramids_stand_on_a_corner_of_their_base() {
    let solid = |size: &str| format!("{AXES}#20=RECTANGULAR_PYRAMID('',#10,{size});");
    let (scene, warnings) = read(&product("#20", &solid("12.,8.,10.")));
    assert_eq!(warnings, [""; 0]);
    let all = bounds(scene.patches());
    assert!(all.min.distance(DVec3::ZERO) < 1e-6, "{all:?}");
    assert!(
        all.max.distance(DVec3::new(12.0, 8.0, 10.0)) < 1e-6,
        "{all:?}"
    );
    let volume = |face: &Patch| Integrals::of(face, DVec3::ZERO).volume();
    let volume: f64 = scene.patches().iter().map(volume).sum();
    assert!((volume - 320.0).abs() < 1e-6, "{volume}");
    assert!(scene.nodes().iter().any(|node| node.voids == Some(0)));
    let error = import(&product("#20", &solid("12.,-8.,10."))).unwrap_err();
    assert!(error.contains("must be positive"), "{error}");
}
