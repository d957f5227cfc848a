//! What moves with time, and where routes lead.

use glam::{DVec2, DVec3};

use super::tests::{read_scene, shape};
use crate::{Import, Limits, NoFiles, ReadOptions, read};

/// Where the first thing shown stands at a time.
fn place_at(import: &Import, seconds: f64) -> DVec3 {
    let scene = import
        .animation
        .as_ref()
        .unwrap()
        .scene_at(seconds)
        .unwrap();
    let placements = scene.placements();
    placements[0].world_from_object.transform_point3(DVec3::X)
}

#[test]
fn routes_move_what_they_lead_to() {
    let import = read_scene(
        "DEF T TimeSensor { cycleInterval 4 loop TRUE startTime 1 }\n\
         DEF P PositionInterpolator { key [ 0 0.5 1 ] keyValue [ 0 0 0, 0 2 0, 0 2 6 ] }\n\
         DEF O OrientationInterpolator { key [ 0 1 ] keyValue [ 0 0 1 0, 0 0 1 3.141592653589793 ] }\n\
         DEF M Transform { children Shape { geometry Sphere { } } }\n\
         ROUTE T.fraction_changed TO P.set_fraction ROUTE P.value_changed TO M.set_translation\n\
         ROUTE T.fraction_changed TO O.set_fraction ROUTE O.value_changed TO M.rotation",
    );
    assert_eq!(import.warnings.as_slice(), []);
    let near = |seconds, x: f64, y: f64, z: f64| {
        let found = place_at(&import, seconds);
        assert!(
            found.distance(DVec3::new(x, y, z)) < 1e-12,
            "{found} at {seconds}"
        );
    };
    // Before the start nothing has moved; then come a quarter, a half and the end of a turn.
    near(0.5, 1.0, 0.0, 0.0);
    near(2.0, 0.5_f64.sqrt(), 1.0 + 0.5_f64.sqrt(), 0.0);
    near(3.0, 0.0, 3.0, 0.0);
    near(5.0, -1.0, 2.0, 6.0);
    near(6.0, 0.5_f64.sqrt(), 1.0 + 0.5_f64.sqrt(), 0.0);
    let still = shape("Sphere { }");
    assert_eq!(still.animation, None);
}

#[test]
fn what_is_wrong_with_interpolators_is_told() {
    let box_with = |text: &str| {
        let import = read_scene(&format!("Shape {{ geometry Box {{ }} }} {text}"));
        let told = import.warnings.as_slice().iter().map(ToString::to_string);
        told.collect::<Vec<_>>()
    };
    for text in [
        "PositionInterpolator { }",
        "NurbsPositionInterpolator { }",
        "CoordinateInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 1 1, 2 2 2, 3 3 3 ] }",
        "SquadOrientationInterpolator { key 0 keyValue [ 0 0 1 0 ] }",
    ] {
        assert_eq!(box_with(text), [""; 0], "{text}");
    }
    for (text, expected) in [
        (
            "PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 1 ] }",
            "5 numbers of values do not belong to 2 keys",
        ),
        (
            "ScalarInterpolator { keyValue [ 0 1 ] }",
            "2 numbers of values do not belong to 0 keys",
        ),
        (
            "SplineScalarInterpolator { key [ 0 1 ] keyValue [ 0 one ] }",
            "\"one\" is not a number",
        ),
        (
            "NurbsPositionInterpolator { order 3 controlPoint Coordinate { point [ 0 0 0 ] } }",
            "its points make no curve",
        ),
    ] {
        let told = box_with(text);
        assert!(
            told.len() == 1 && told[0].contains(expected),
            "{text}: {told:?}"
        );
    }
}

#[test]
fn control_points_and_curves_are_followed() {
    let import = read_scene(
        "DEF T TimeSensor { }\n\
         DEF C CoordinateInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 0 0, 0 1 0, 1 1 0, \
           0 0 4, 1 0 4, 0 1 4, 1 1 8 ] }\n\
         DEF N NurbsPositionInterpolator { order 3 controlPoint Coordinate { point [ 0 0 0, 1 2 0, 2 0 0 ] } }\n\
         DEF M Transform { children Shape { geometry NurbsPatchSurface { uDimension 2 vDimension 2 \
           uOrder 2 vOrder 2 controlPoint DEF K Coordinate { point [ 0 0 0, 1 0 0, 0 1 0, 1 1 0 ] } } } }\n\
         ROUTE T.fraction_changed TO C.set_fraction ROUTE C.value_changed TO K.set_point\n\
         ROUTE T.fraction_changed TO N.set_fraction ROUTE N.value_changed TO M.set_translation",
    );
    assert_eq!(import.warnings.as_slice(), []);
    let scene = import.animation.as_ref().unwrap().scene_at(0.5).unwrap();
    let corner = scene.patches()[0].surface.evaluate(DVec2::ONE);
    assert_eq!(corner, DVec3::new(1.0, 1.0, 4.0));
    // The middle of the parabola.
    assert_eq!(place_at(&import, 0.5), DVec3::new(2.0, 1.0, 0.0));
    assert_eq!(place_at(&import, 9.0), DVec3::new(3.0, 0.0, 0.0));
}

#[test]
fn routes_may_stand_inside_the_nodes_that_they_lead_to() {
    let driven = "DEF T TimeSensor { } \
        DEF P PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 0 8 0 ] } ";
    let routes =
        "ROUTE T.fraction_changed TO P.set_fraction ROUTE P.value_changed TO M.translation";
    let moved = format!(
        "DEF M Transform {{ children [ Shape {{ geometry Sphere {{ }} }} {driven} ] {routes} }}"
    );
    let instance = "PROTO A [ inputOutput SFVec3f translation 0 0 0 field MFNode inside [ ] ] { \
        Transform { translation IS translation children [ \
        Shape { geometry Sphere { } } Group { children IS inside } ] } }";
    let instance = format!("{instance} DEF M A {{ inside [ {driven} ] {routes} }}");
    for text in [
        &moved,
        // The routes stand in a node further inside, and in the first node of a prototype.
        &format!(
            "DEF M Transform {{ children Group {{ children [ Shape {{ geometry Sphere {{ }} }} \
            {driven} ] {routes} }} }}"
        ),
        &format!("PROTO A [ ] {{ {moved} }} A {{ }}"),
        &instance,
    ] {
        let import = read_scene(text);
        assert_eq!(import.warnings.as_slice(), [], "{text}");
        assert_eq!(place_at(&import, 0.5), DVec3::new(1.0, 4.0, 0.0), "{text}");
    }
    // The node around the prototype is no node of its body.
    let import = read_scene("DEF M Group { PROTO A [ ] { Group { ROUTE M.a TO M.b } } }");
    let told: Vec<_> = import
        .warnings
        .as_slice()
        .iter()
        .map(ToString::to_string)
        .collect();
    assert!(told[0].contains("not both there"), "{told:?}");
}

#[test]
fn instances_of_a_prototype_move_by_themselves() {
    let import = read_scene(
        "PROTO Mover [ field SFTime cycle 1 ] { Group { children [\n\
           DEF T TimeSensor { cycleInterval IS cycle }\n\
           DEF P PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 0 8 0 ] }\n\
           DEF M Transform { children Shape { geometry Sphere { } } } ]\n\
           ROUTE T.fraction_changed TO P.set_fraction ROUTE P.value_changed TO M.set_translation } }\n\
         Mover { cycle 2 }",
    );
    assert_eq!(import.warnings.as_slice(), []);
    assert_eq!(place_at(&import, 1.0), DVec3::new(1.0, 4.0, 0.0));
}

#[test]
fn routes_lead_into_instances_and_out_of_them() {
    let import = read_scene(
        "PROTO Clock [ outputOnly SFFloat tick ] { TimeSensor { fraction_changed IS tick } }\n\
         PROTO Mover [ inputOnly SFVec3f set_place ] { Transform { set_translation IS set_place \
           children Shape { geometry Sphere { } } } }\n\
         PROTO Outer [ inputOutput SFVec3f at 0 0 0 ] { Group { children Mover { set_place IS at } } }\n\
         DEF T Clock { } DEF M Outer { }\n\
         DEF P SplinePositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 0 8 0 ] }\n\
         ROUTE T.tick TO P.set_fraction ROUTE P.value_changed TO M.set_at",
    );
    assert_eq!(import.warnings.as_slice(), []);
    assert_eq!(place_at(&import, 0.5), DVec3::new(1.0, 4.0, 0.0));
}

#[test]
fn the_interpolator_of_vrml_97_has_names_of_its_own() {
    let (limits, resolver) = (&Limits::default(), &NoFiles);
    // A cubic, as the default order there is four.
    let text = "#VRML V2.0 utf8\nDEF T TimeSensor { }\n\
        DEF N NurbsPositionInterpolator { keyValue [ 0 0 0, 0 1 0, 0 1 1, 1 1 1 ] keyWeight [ 1 1 1 1 ] }\n\
        DEF M Transform { children Shape { geometry Box { } } }\n\
        ROUTE T.fraction_changed TO N.set_fraction ROUTE N.value_changed TO M.set_translation";
    let options = ReadOptions { limits, resolver };
    let import = read(text.as_bytes(), None, &options).unwrap();
    let scene = import.animation.unwrap().scene_at(0.5).unwrap();
    let moved = scene.placements()[0].world_from_object.translation;
    assert!(
        moved.distance(DVec3::new(0.125, 0.875, 0.5)) < 1e-15,
        "{moved}"
    );
}
