use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::{DVec2, DVec3};
use kernel::{LightKind, Projection, Surface};

use super::*;
use crate::{Limits, NoFiles};

pub(super) fn read_with(limits: &Limits, text: &str) -> Result<Import, Error> {
    let resolver = &NoFiles;
    read(text.as_bytes(), &ReadOptions { limits, resolver })
}

/// A file with this inside its scene.
pub(super) fn file(scene: &str) -> String {
    format!("<X3D version='3.3'><head/><Scene>\n{scene}\n</Scene></X3D>")
}

pub(super) fn read_scene(scene: &str) -> Import {
    read_with(&Limits::default(), &file(scene)).unwrap()
}

pub(super) fn messages(import: &Import) -> Vec<String> {
    let list = import.warnings.as_slice().iter();
    list.map(ToString::to_string).collect()
}

/// A bilinear patch over the unit square, with more attributes.
pub(super) fn square(attributes: &str) -> String {
    format!(
        "<NurbsPatchSurface uDimension='2' vDimension='2' uOrder='2' vOrder='2' {attributes}>\
         <Coordinate point='0 0 0, 1 0 0, 0 1 0, 1 1 0'/></NurbsPatchSurface>"
    )
}

pub(super) fn only_surface(import: &Import) -> &Surface {
    let [patch] = import.scene.patches() else {
        panic!("{} patches", import.scene.patches().len());
    };
    &patch.surface
}

const SPHERE: &str = include_str!("../../../samples/sphere_torus.x3d");

#[test]
fn premultiplied_points_make_an_exact_sphere() {
    let import = read_with(&Limits::default(), SPHERE).unwrap();
    let sphere = import.scene.patches().iter().find(|p| p.name == "SPHERE");
    let surface = &sphere.unwrap().surface;
    let domains = [surface.knots_u().domain(), surface.knots_v().domain()];
    for i in 0..=40 {
        for j in 0..=40 {
            let at = |range: &std::ops::Range<f64>, k: i32| {
                range.start + (range.end - range.start) * f64::from(k) / 40.0
            };
            let point = surface.evaluate(DVec2::new(at(&domains[0], i), at(&domains[1], j)));
            assert!((point.length() - 1.0).abs() <= 1e-15, "{point} at {i} {j}");
        }
    }
}

#[test]
fn a_node_used_twice_is_stored_once() {
    let import = read_with(&Limits::default(), SPHERE).unwrap();
    assert_eq!(messages(&import), Vec::<String>::new());
    assert_eq!(import.scene.patches().len(), 2);
    assert_eq!(import.scene.placements().len(), 3);
    assert_eq!(import.scene.materials().len(), 3);
}

#[test]
fn u_runs_fastest() {
    let import = read_scene(&format!("<Shape>{}</Shape>", square("")));
    let surface = only_surface(&import);
    assert_eq!(surface.evaluate(DVec2::new(1.0, 0.0)), DVec3::X);
    assert_eq!(surface.evaluate(DVec2::new(0.0, 1.0)), DVec3::Y);
}

#[test]
fn transforms_are_about_their_center() {
    // T C R SR S SR^-1 C^-1 by hand: the corner (1, 0) seen from the centre (1, 1) is
    // (0, -1); turned by -90 degrees, stretched by (3, 2) and turned back it is (0, -3);
    // turned by 90 degrees (3, 0); from the centre (4, 1); moved (4, 1, 5).
    let import = read_scene(&format!(
        "<Transform DEF='T' translation='0 0 5' center='1 1 0' scale='3 2 1' \
         rotation='0 0 2 {FRAC_PI_2}' scaleOrientation='0 0 1 {FRAC_PI_2}'>\
         <Shape>{}</Shape></Transform>",
        square("")
    ));
    let [placement] = &import.scene.placements()[..] else {
        panic!("one placement");
    };
    let moved = placement.world_from_object.transform_point3(DVec3::X);
    assert!(moved.distance(DVec3::new(4.0, 1.0, 5.0)) < 1e-14, "{moved}");
    assert_eq!(import.scene.patches()[0].name, "T");
}

#[test]
fn switches_and_levels_show_one_child() {
    let shape = format!("<Shape>{}</Shape>", square(""));
    let count = |before: &str, after: &str| {
        let import = read_scene(&format!("{before}{shape}{shape}{after}"));
        import.scene.placements().len()
    };
    assert_eq!(count("<LOD><MetadataSet/>", "</LOD>"), 1);
    assert_eq!(count("<Switch>", "</Switch>"), 0);
    assert_eq!(count("<Switch whichChoice='1'>", "</Switch>"), 1);
    assert_eq!(count("<Switch whichChoice='0x1'>", "</Switch>"), 1);
    assert_eq!(count("<Group visible='false'>", "</Group>"), 0);
    assert_eq!(count("<Anchor>", "</Anchor>"), 2);
    assert_eq!(count("<NurbsSet>", "</NurbsSet>"), 0);
}

#[test]
fn materials_are_linear() {
    let import = read_scene(&format!(
        "<Shape>{}<Appearance><Material DEF='M' diffuseColor='1 0 0.5' ambientIntensity='0.5' \
         shininess='0.5' transparency='0.25'/></Appearance></Shape>",
        square("")
    ));
    let [material] = import.scene.materials() else {
        panic!("one material");
    };
    let diffuse = linear(DVec3::new(1.0, 0.0, 0.5));
    assert_eq!(material.diffuse, diffuse);
    assert_eq!(material.ambient, diffuse * 0.5);
    assert_eq!((material.shininess, material.opacity), (64.0, 0.75));
    let placement = &import.scene.placements()[0];
    assert!(placement.material.is_some());
}

fn linear(color: DVec3) -> DVec3 {
    kernel::linear_from_srgb(color)
}

#[test]
fn viewpoints_and_lights_stand_in_the_world() {
    let import = read_scene(&format!(
        "<Transform translation='1 2 3' rotation='0 1 0 {FRAC_PI_2}' scale='2 2 2'>\
         <Viewpoint description='side' position='0 0 5'/>\
         <PointLight location='0 0 1' radius='10' attenuation='1 2 4'/>\
         <SpotLight on='false'/></Transform>\
         <DirectionalLight direction='0 -2 0' intensity='0.5'/>\
         <OrthoViewpoint DEF='O' fieldOfView='-1 -2 3 2'/>\
         <Background skyColor='1 1 1'/><NavigationInfo headlight='false'/>"
    ));
    assert_eq!(messages(&import), Vec::<String>::new());
    let [side, ortho] = &import.scene.cameras[..] else {
        panic!("two cameras");
    };
    assert_eq!(side.name, "side");
    assert!(side.eye().distance(DVec3::new(11.0, 2.0, 3.0)) < 1e-14);
    assert!(side.forward().distance(DVec3::NEG_X) < 1e-14);
    assert_eq!(
        side.projection(),
        Projection::PerspectiveShorter { fov: FRAC_PI_4 }
    );
    assert_eq!(ortho.eye(), DVec3::new(1.0, 0.0, 10.0));
    assert_eq!(ortho.projection(), Projection::Orthographic { extent: 4.0 });
    let [point, sun] = &import.scene.lights[..] else {
        panic!("two lights");
    };
    let LightKind::Point { position, falloff } = point.kind else {
        panic!("a point light");
    };
    assert!(position.distance(DVec3::new(3.0, 2.0, 3.0)) < 1e-14);
    assert!((falloff.radius - 20.0).abs() < 1e-13);
    assert!(falloff.attenuation.distance(DVec3::ONE) < 1e-14);
    assert_eq!(
        sun.kind,
        LightKind::Directional {
            direction: DVec3::NEG_Y
        }
    );
    assert_eq!(sun.color, DVec3::splat(0.5));
    assert_eq!(import.scene.background, Some(DVec3::ONE));
    assert!(!import.scene.headlight);
}

#[test]
fn windows_of_viewpoints_are_open_and_have_an_extent() {
    let import = read_scene("<OrthoViewpoint fieldOfView='1 -1 -1 1'/>");
    let text = "line 2, OrthoViewpoint, fieldOfView: a window ends where it begins, or before; the default is used";
    assert_eq!(messages(&import), [text]);
    assert_eq!(import.scene.cameras.len(), 1);
    let import = read_scene("<OrthoViewpoint fieldOfView='-1e308 -1 1e308 1'/>");
    assert!(import.scene.cameras.is_empty());
    let [message] = &messages(&import)[..] else {
        panic!("one message");
    };
    assert!(message.ends_with("a viewpoint without a direction or an extent; it is left out"));
}

#[test]
fn units_reach_lengths_and_angles() {
    let text = "<X3D><head><unit category='length' name='inch' conversionFactor='0.0254'/>\
        <unit category='angle' name='degree' conversionFactor='0.017453292519943295'/></head>\
        <Scene><Viewpoint fieldOfView='90'/></Scene></X3D>";
    let import = read_with(&Limits::default(), text).unwrap();
    let unit = import.scene.unit.unwrap();
    assert_eq!((unit.name.as_str(), unit.metres), ("inch", 0.0254));
    let unit = read_scene("").scene.unit.unwrap();
    assert_eq!((unit.name.as_str(), unit.metres), ("m", 1.0));
    let Projection::PerspectiveShorter { fov } = import.scene.cameras[0].projection() else {
        panic!("perspective");
    };
    assert!((fov - FRAC_PI_2).abs() < 1e-15);
}

#[test]
fn contours_become_loops() {
    let contour = |inside: &str| {
        let import = read_scene(&format!(
            "<Shape><NurbsTrimmedSurface uDimension='2' vDimension='2' uOrder='2' vOrder='2'>\
             <Coordinate point='0 0 0, 1 0 0, 0 1 0, 1 1 0'/>\
             <Contour2D>{inside}</Contour2D></NurbsTrimmedSurface></Shape>"
        ));
        let loops = import.scene.patches()[0].loops.clone();
        (loops, messages(&import).concat())
    };
    let (loops, message) = contour(
        "<ContourPolyline2D controlPoint='0 0 1 0 1 1'/><NurbsCurve2D order='2' \
         controlPoint='1 1 0 1 0 0'/>",
    );
    assert_eq!((loops.len(), message.as_str()), (1, ""));
    assert_eq!(loops[0].segments().len(), 2);
    let (loops, _) = contour("<ContourPolyline2D point='.2 .2 .2 .8 .8 .8 .2 .2'/>");
    assert_eq!(loops.len(), 2, "a hole needs the border around it");
    let (loops, message) = contour(
        "<ContourPolyline2D controlPoint='0 0 1 0'/><ContourPolyline2D controlPoint='1 1 0 1'/>",
    );
    assert_eq!(loops.len(), 0);
    assert!(
        message.contains("the surface is shown untrimmed"),
        "{message}"
    );
}

#[test]
fn polygons_become_triangles() {
    let import = read_scene(
        "<Shape DEF='S'><IndexedFaceSet coordIndex='0 1 2 3 -1 0 1 9 -1 0, 2, 3' ccw='false'>\
         <Coordinate DEF='C' point='0 0 0 1 0 0 1 1 0 0 1 0'/>\
         <Normal vector='0 0 1 0 0 1 0 0 1 0 0 1'/></IndexedFaceSet></Shape>\
         <Shape><IndexedTriangleSet index='0 1 2 3'><Coordinate USE='C'/></IndexedTriangleSet>\
         </Shape><Shape><TriangleSet><Coordinate point='0 0 0 1 0 0 1 1 0'/></TriangleSet></Shape>",
    );
    let [faces, indexed, plain] = import.scene.meshes() else {
        panic!("three meshes");
    };
    assert_eq!(faces.triangles(), [[0, 1, 2], [0, 2, 3], [0, 1, 3]]);
    assert_eq!(
        faces.positions(),
        [DVec3::Y, DVec3::new(1.0, 1.0, 0.0), DVec3::X, DVec3::ZERO]
    );
    assert_eq!((faces.name.as_str(), faces.normals().len()), ("S", 4));
    assert_eq!(indexed.triangles(), [[0, 1, 2]]);
    assert_eq!(plain.triangles(), [[0, 1, 2]]);
    assert_eq!(
        messages(&import),
        [
            "line 2, IndexedFaceSet: polygons with points that are not among the 4 there are \
             (and 1 more)",
        ]
    );
}

#[test]
fn the_format_is_recognised() {
    for yes in [
        "<X3D>",
        "\u{feff}<?xml version='1.0'?>\n<!-- long -->\n<X3D profile='Full'>",
        "#X3D V3.3 utf8",
        "{ \"X3D\": {",
    ] {
        assert!(sniff(yes.as_bytes()), "{yes}");
    }
    for no in [
        "",
        "<X3",
        "<X3DX>",
        "<svg>",
        "# X3D",
        "v 0 0 0\n# <X3D>",
        "#VRML V2.0",
        "{}",
    ] {
        assert!(!sniff(no.as_bytes()), "{no}");
    }
}

#[test]
fn other_encodings_are_read() {
    let text = file("<Viewpoint description='\u{e9}'/>");
    let wide: Vec<u8> = std::iter::once(0xfeff)
        .chain(text.encode_utf16())
        .flat_map(u16::to_le_bytes)
        .collect();
    let narrow: Vec<u8> = text.chars().map(|c| u8::try_from(c).unwrap()).collect();
    let limits = &Limits::default();
    for bytes in [wide, narrow] {
        let resolver = &NoFiles;
        let import = read(&bytes, &ReadOptions { limits, resolver }).unwrap();
        assert_eq!(import.scene.cameras[0].name, "\u{e9}");
    }
}

#[test]
fn swung_surface_is_profile_times_trajectory() {
    let import = read_scene(
        "<Shape><NurbsSwungSurface>\
         <NurbsCurve2D containerField='profileCurve' order='2' controlPoint='2 0, 3 1' \
          knot='0 0 1 1'/>\
         <NurbsCurve2D containerField='trajectoryCurve' order='3' controlPoint='1 0, 1 1, 0 2' \
          weight='1 1 2' knot='0 0 0 1 1 1'/>\
         </NurbsSwungSurface></Shape>",
    );
    let surface = &import.scene.patches()[0].surface;
    for (u, v) in [(0.0, 0.0), (0.25, 0.5), (1.0, 1.0), (0.7, 0.3)] {
        let point = surface.evaluate(DVec2::new(u, v));
        // The trajectory is a quarter of the unit circle.
        assert!((point.x.hypot(point.z) - (2.0 + u)).abs() < 1e-14);
        assert!((point.y - u).abs() < 1e-15);
    }
    assert_eq!(messages(&import).len(), 1, "{:?}", messages(&import));
}

#[test]
fn prototypes_of_other_files_are_read_from_xml() {
    struct Part;
    impl crate::Resolver for Part {
        fn resolve(&self, name: &str) -> std::io::Result<Vec<u8>> {
            assert_eq!(name, "parts/ball.x3dv");
            Ok(b"#X3D V3.3 utf8\nPROTO Ball [ inputOutput SFFloat size 1 ] { Sphere { radius IS size } }".to_vec())
        }
    }
    let text = file(
        "<ExternProtoDeclare name='Ball' url='\"parts/ball.x3dv#Ball\" \"http://a.b/c\"'>\
         <field name='size' type='SFFloat' accessType='inputOutput'/></ExternProtoDeclare>\
         <Shape><ProtoInstance name='Ball' DEF='B'><fieldValue name='size' value='2'/>\
         </ProtoInstance></Shape><Shape><ProtoInstance USE='B'/></Shape>",
    );
    let (limits, resolver) = (&Limits::default(), &Part);
    let import = read(text.as_bytes(), &ReadOptions { limits, resolver }).unwrap();
    assert_eq!(messages(&import), Vec::<String>::new());
    assert_eq!(import.scene.placement_count(), 2);
    let patch = &import.scene.patches()[0];
    assert_eq!(
        (import.scene.patches().len(), patch.name.as_str()),
        (1, "B")
    );
    assert!((patch.surface.evaluate(DVec2::new(1.0, 0.5)).length() - 2.0).abs() < 1e-15);
}

#[test]
fn prototypes_of_files_in_other_units_are_scaled() {
    struct Part;
    impl crate::Resolver for Part {
        fn resolve(&self, _: &str) -> std::io::Result<Vec<u8>> {
            Ok(
                b"#X3D V3.3 utf8\nUNIT length mm 0.001\nPROTO Part [ ] { Shape { geometry Sphere \
                { radius 500 } } }"
                    .to_vec(),
            )
        }
    }
    let text = file(
        "<ExternProtoDeclare name='Part' url='\"part.x3dv\"'/>\
         <Transform translation='1 0 0'><ProtoInstance name='Part'/></Transform>",
    );
    let (limits, resolver) = (&Limits::default(), &Part);
    let import = read(text.as_bytes(), &ReadOptions { limits, resolver }).unwrap();
    assert_eq!(messages(&import), Vec::<String>::new());
    let bounds = import.scene.hull_bounds();
    assert!(
        (bounds.min - DVec3::new(0.5, -0.5, -0.5)).length() < 1e-15,
        "{bounds:?}"
    );
}

#[test]
fn nodes_are_imported_and_lists_have_gaps_in_xml_and_json() {
    struct Part;
    impl crate::Resolver for Part {
        fn resolve(&self, _: &str) -> std::io::Result<Vec<u8>> {
            let text = "<Shape DEF='B'><Sphere/></Shape><EXPORT localDEF='B' AS='Ball'/>";
            Ok(file(text).into_bytes())
        }
    }
    let json = "{ \"X3D\": { \"@version\": \"3.3\", \"Scene\": { \"-children\": [ null,\n\
        { \"Inline\": { \"@DEF\": \"I\", \"@url\": [ \"part.x3d\" ] } }, null,\n\
        { \"IMPORT\": { \"@inlineDEF\": \"I\", \"@importedDEF\": \"Ball\", \"@AS\": \"C\" } },\n\
        { \"Group\": { \"-metadata\": null, \"-children\": [ null,\n\
          { \"Shape\": { \"@USE\": \"C\" } } ] } } ] } } }";
    for text in [
        file(
            "<Inline DEF='I' url='part.x3d'/><IMPORT inlineDEF='I' importedDEF='Ball' AS='C'/>\
             <Group><Shape USE='C'/></Group>",
        ),
        file(
            "<Inline DEF='I' url='part.x3d'/><IMPORT inlineDEF='I' exportedDEF='Ball'/>\
             <Shape USE='Ball'/>",
        ),
        json.to_owned(),
    ] {
        let (limits, resolver) = (&Limits::default(), &Part);
        let import = read(text.as_bytes(), &ReadOptions { limits, resolver }).unwrap();
        assert_eq!(messages(&import), [""; 0], "{text}");
        assert_eq!(import.scene.placement_count(), 2, "{text}");
    }
}
