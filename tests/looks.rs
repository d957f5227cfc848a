//! What materials, colours, lights and views become in files of triangles.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;

use program::Place;
use serde_json::{Value, json};

#[expect(dead_code, reason = "shared with tests that need more of it")]
mod program;

/// What the text of a glTF file says that a file becomes, and what is said to be left out.
fn converted(name: &str, files: &[(&str, &str)]) -> (Value, String) {
    let place = Place::new();
    for (name, text) in files {
        fs::write(place.path(name), text).unwrap();
    }
    let run = place.run(&format!("convert {name} -o out.gltf"));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let text = fs::read_to_string(place.path("out.gltf")).unwrap();
    (serde_json::from_str(&text).unwrap(), run.stderr)
}

/// The file that a scene of X3D becomes.
fn from_x3d(text: &str) -> (Value, String) {
    let text = format!("#X3D V4.0 utf8\nPROFILE Full\n{text}");
    converted("in.x3dv", &[("in.x3dv", &text)])
}

/// A triangle with colours of its vertices, of the node `Color` or `ColorRGBA`.
fn colored(appearance: &str, color: &str) -> String {
    format!(
        "Shape {{ {appearance} geometry IndexedFaceSet {{ coord Coordinate {{ point [0 0 0 1 0 0 \
         1 1 0] }} coordIndex [0 1 2 -1] color {color} }} }}\n"
    )
}

const OPAQUE: &str = "Color { color [1 0 0 0 1 0 0 0 1] }";
const CLEAR: &str = "ColorRGBA { color [1 0 0 0.2 0 1 0 1 0 0 1 1] }";

#[test]
fn what_reflects_nothing_is_not_lit() {
    let faces = "mtllib a.mtl\nusemtl a\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n";
    let flat = "newmtl a\nKd 1 0 1\nillum 0\n";
    for ((json, _), base) in [
        (from_x3d(&colored("", OPAQUE)), [1.0; 4]),
        (
            converted("a.obj", &[("a.obj", faces), ("a.mtl", flat)]),
            [1.0, 0.0, 1.0, 1.0],
        ),
    ] {
        assert_eq!(json["extensionsUsed"], json!(["KHR_materials_unlit"]));
        let material = &json["materials"][0];
        assert_eq!(material["extensions"], json!({ "KHR_materials_unlit": {} }));
        let found = &material["pbrMetallicRoughness"]["baseColorFactor"];
        assert_eq!(*found, json!(base));
        assert_eq!(material["emissiveFactor"], json!([0.0, 0.0, 0.0]));
    }
    // A picture of emitted light, and lines.
    let pictured = "Shape { appearance Appearance { texture PixelTexture { image 1 1 4 0xFF000080 } \
        } geometry IndexedFaceSet { coord Coordinate { point [0 0 0 1 0 0 1 1 0] } coordIndex \
        [0 1 2 -1] } }\nShape { geometry IndexedLineSet { coord Coordinate { point [0 0 0 1 0 0] } \
        coordIndex [0 1 -1] } }";
    let (json, _) = from_x3d(pictured);
    let materials = json["materials"].as_array().unwrap();
    assert_eq!(materials.len(), 2);
    for material in materials {
        assert!(material["extensions"]["KHR_materials_unlit"].is_object());
        assert!(material["emissiveTexture"].is_null());
    }
    assert!(materials[0]["pbrMetallicRoughness"]["baseColorTexture"].is_object());
    assert_eq!(materials[0]["alphaMode"], "BLEND");
    // Where there is a light there is no such thing.
    let lit = "appearance Appearance { material Material { } }";
    let (json, _) = from_x3d(&colored(lit, OPAQUE));
    assert!(json["extensionsUsed"].is_null());
    assert!(json["materials"][0]["extensions"].is_null());
}

#[test]
fn colours_that_let_something_through_are_blended() {
    let lit = "appearance DEF A Appearance { material Material { } }";
    let (json, _) = from_x3d(&(colored(lit, OPAQUE) + &colored("appearance USE A", CLEAR)));
    let primitives = json["meshes"][0]["primitives"].as_array().unwrap();
    let modes = primitives.iter().map(|primitive| {
        let material = primitive["material"].as_u64().unwrap();
        &json["materials"][usize::try_from(material).unwrap()]["alphaMode"]
    });
    assert_eq!(modes.collect::<Vec<_>>(), ["OPAQUE", "BLEND"]);
}

#[test]
fn parallel_views_keep_their_window() {
    let (json, _) =
        from_x3d("OrthoViewpoint { fieldOfView -1 -2 3 4 }\nShape { geometry Sphere { } }");
    let view = &json["cameras"][0]["orthographic"];
    assert_eq!([&view["xmag"], &view["ymag"]], [&json!(2.0), &json!(3.0)]);
}

#[test]
fn cones_of_light_are_no_wider_than_a_right_angle() {
    let (json, _) = from_x3d("SpotLight { }\nShape { geometry Sphere { } }");
    let light = &json["extensions"]["KHR_lights_punctual"]["lights"][0];
    let outer = light["spot"]["outerConeAngle"].as_f64().unwrap();
    let right = std::f64::consts::FRAC_PI_2;
    assert!(outer <= right && outer > right - 1e-6, "{outer}");
    // What is wider is told.
    for (angle, count) in [("1.570797", 0), ("1.6", 1)] {
        let (_, told) = from_x3d(&format!(
            "SpotLight {{ cutOffAngle {angle} attenuation 0 0 1 }}\nShape {{ geometry Sphere {{ }} }}"
        ));
        let lost = "cones of lights that shine backwards, too, are not written";
        assert_eq!(told.matches(lost).count(), count, "{told}");
    }
}

#[test]
fn how_lights_weaken_is_told() {
    for (attenuation, count) in [("0 0 1", 0), ("1 0.5 0", 1)] {
        let (json, told) = from_x3d(&format!(
            "PointLight {{ attenuation {attenuation} }}\nDirectionalLight {{ }}\n\
             Shape {{ geometry Sphere {{ }} }}"
        ));
        assert_eq!(
            json["extensions"]["KHR_lights_punctual"]["lights"]
                .as_array()
                .unwrap()
                .len(),
            2
        );
        assert_eq!(
            told.matches("attenuations of lights are not written")
                .count(),
            count,
            "{told}"
        );
    }
}
