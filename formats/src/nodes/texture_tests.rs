//! Pictures, where they lie, and what they do to materials.

use std::f64::consts::{PI, TAU};

use glam::{DAffine2, DVec2, DVec3, DVec4};
use image::ImageFormat;
use kernel::{Material, Patch, Shape, linear_from_srgb};

use crate::pictures::tests::{Files, encoded, red_green};
use crate::{Export, Import, Limits, ReadOptions, WRITERS, read};

/// A file with these nodes, in a folder with a picture of two texels: red, and half transparent
/// green to its right; and one of a single grey texel.
fn read_with(version: &str, nodes: &str) -> Import {
    let grey = image::GrayImage::from_raw(1, 1, vec![188]).unwrap();
    let resolver = &Files(vec![
        ("alpha.png", encoded(&red_green(), ImageFormat::Png)),
        (
            "colors.png",
            encoded(&red_green().into_rgb8().into(), ImageFormat::Png),
        ),
        ("grey.png", encoded(&grey.into(), ImageFormat::Png)),
    ]);
    let limits = &Limits::default();
    let text = format!("#X3D V{version} utf8\n{nodes}");
    read(text.as_bytes(), None, &ReadOptions { limits, resolver }).unwrap()
}

/// The material that a box is shown in, read without a warning.
fn material(version: &str, appearance: &str) -> Material {
    let import = read_with(
        version,
        &format!("Shape {{ geometry Box {{}} appearance Appearance {{ {appearance} }} }}"),
    );
    assert_eq!(import.warnings.as_slice(), [], "{appearance}");
    let id = import.scene.placements()[0].material.unwrap();
    import.scene.material(id).clone()
}

fn patches(geometry: &str) -> Vec<Patch> {
    let import = read_with(
        "3.3",
        &format!(
            "Shape {{ geometry {geometry} appearance Appearance {{ material Material {{}} \
             texture ImageTexture {{ url \"colors.png\" }} }} }}"
        ),
    );
    assert_eq!(import.warnings.as_slice(), [], "{geometry}");
    import.scene.patches().to_vec()
}

const ORANGE: &str = "material Material { diffuseColor 1 0.5 0 transparency 0.25 }";

#[test]
fn appearances_of_x3d_4_are_opaque_where_they_say_so() {
    let of = |mode: &str| {
        let texture = "texture ImageTexture { url \"alpha.png\" }";
        format!("{ORANGE} {texture} {mode} backMaterial Material {{ transparency 0.5 }}")
    };
    let opaque = material("4.0", &of("alphaMode \"OPAQUE\""));
    let back = opaque.back.as_ref().unwrap();
    for side in [&opaque, back] {
        assert!(
            side.opacity >= 1.0 && side.maps.opacity.is_none(),
            "{side:?}"
        );
    }
    for mode in ["", "alphaMode \"BLEND\"", "alphaMode \"AUTO\""] {
        let blended = material("4.0", &of(mode));
        assert!(
            blended.opacity < 1.0 && blended.maps.opacity.is_some(),
            "{mode}"
        );
    }
    let mask = of("alphaMode \"MASK\" alphaCutoff 0.3");
    let mask = format!("Shape {{ geometry Box {{}} appearance Appearance {{ {mask} }} }}");
    let told = read_with("4.0", &mask).warnings.as_slice()[0].to_string();
    assert!(told.contains("alphaMode MASK is read as BLEND"), "{told}");
}

#[test]
fn colours_of_a_texture_replace_those_of_a_material_and_grey_ones_multiply_them() {
    let of = |version, name| {
        let texture = format!("{ORANGE} texture ImageTexture {{ url [ \"no.png\" \"{name}\" ] }}");
        material(version, &texture)
    };
    let orange = linear_from_srgb(DVec3::new(1.0, 0.5, 0.0));
    let opacity = |m: &Material| (m.opacity, m.maps.opacity.is_some());
    let colors = of("3.3", "colors.png");
    assert_eq!(
        (colors.diffuse, opacity(&colors)),
        (DVec3::ONE, (0.75, false))
    );
    assert_eq!(colors.ambient, DVec3::splat(0.2));
    let alpha = of("3.3", "alpha.png");
    assert_eq!((alpha.diffuse, opacity(&alpha)), (DVec3::ONE, (1.0, true)));
    let share = alpha.maps.opacity.unwrap().share(DVec2::new(0.75, 0.5));
    assert!((share - 128.0 / 255.0).abs() < 1e-15);
    let grey = of("3.3", "grey.png");
    assert_eq!((grey.diffuse, opacity(&grey)), (orange, (0.75, false)));
    // Since X3D 4 all multiply.
    let four = of("4.0", "alpha.png");
    assert_eq!((four.diffuse, opacity(&four)), (orange, (0.75, true)));
    let color = four.maps.color.unwrap().color(DVec2::new(0.25, 0.5));
    assert_eq!(color, DVec4::new(1.0, 0.0, 0.0, 1.0));
}

#[test]
fn a_texture_without_a_material_is_its_own_light() {
    let found = material("3.3", "texture ImageTexture { url \"colors.png\" }");
    assert_eq!((found.emissive, found.diffuse), (DVec3::ONE, DVec3::ZERO));
    assert!(found.maps.emissive.is_some() && found.maps.color.is_none());
}

#[test]
fn a_picture_that_cannot_be_read_leaves_the_material_as_it_is() {
    let nodes = format!(
        "Shape {{ geometry Box {{}} appearance Appearance {{ {ORANGE} \
         texture ImageTexture {{ url [ \"no.png\" \"http://a/b.png\" ] }} }} }}"
    );
    let import = read_with("3.3", &nodes);
    let material = &import.scene.materials()[0];
    assert!(material.maps.is_empty() && material.diffuse.z == 0.0);
    assert_eq!(
        import.warnings.as_slice()[0].to_string(),
        "line 2, ImageTexture: a picture could not be read: no.png: entity not found; \
         http://a/b.png: only local files are read"
    );
}

#[test]
fn pixels_in_the_file_begin_with_the_lowest_row() {
    let rows = "texture PixelTexture { image 1 2 4 0xFF0000FF 255 repeatS FALSE }";
    let found = material("3.3", rows).maps.emissive.unwrap();
    let color = |t: f64| found.color(DVec2::new(0.5, t));
    assert_eq!(color(0.25), DVec4::new(1.0, 0.0, 0.0, 1.0));
    assert_eq!(color(0.75), DVec4::new(0.0, 0.0, 0.0, 1.0));
    let grey = material("3.3", "texture PixelTexture { image 1 1 2 0x8040 }");
    let texel = linear_from_srgb(DVec3::splat(128.0 / 255.0));
    let found = grey.maps.emissive.unwrap().color(DVec2::ZERO);
    assert!(found.abs_diff_eq(texel.extend(64.0 / 255.0), 1e-15));
    let wrong = read_with(
        "3.3",
        "Shape { geometry Box {} appearance Appearance { texture PixelTexture { image 2 2 3 0 } } }",
    );
    let text = wrong.warnings.as_slice()[0].to_string();
    assert_eq!(
        text,
        "line 2, PixelTexture, image: 1 texels of 3 numbers for 2 x 2"
    );
}

#[test]
fn transforms_act_on_coordinates_about_their_centre() {
    let found = material(
        "3.3",
        "texture ImageTexture { url \"colors.png\" } textureTransform TextureTransform { \
         center 0.5 0.25 rotation 0.7 scale 2 3 translation 0.1 0.2 }",
    );
    let map = found.maps.emissive.unwrap().picture_from_shape;
    let (center, st) = (DVec2::new(0.5, 0.25), DVec2::new(0.3, 0.9));
    let turned = DVec2::from_angle(0.7).rotate(st + DVec2::new(0.1, 0.2) + center);
    let expected = turned * DVec2::new(2.0, 3.0) - center;
    assert!(map.transform_point2(st).abs_diff_eq(expected, 1e-15));
}

#[test]
fn physical_materials_have_pictures_of_their_own() {
    let found = material(
        "4.0",
        "material PhysicalMaterial { baseColor 0.5 1 1 baseTexture ImageTexture { url \
         \"colors.png\" } metallicRoughnessTexture ImageTexture { url \"grey.png\" } \
         emissiveTexture ImageTexture { url \"grey.png\" } }",
    );
    let maps = &found.maps;
    assert!(maps.color.is_some() && maps.emissive.is_some());
    let shares = [&maps.roughness, &maps.metallic].map(|m| m.as_ref().unwrap().share(DVec2::ZERO));
    assert!(
        shares
            .iter()
            .all(|share| (share - 188.0 / 255.0).abs() < 1e-15)
    );
}

#[test]
fn pictures_lie_on_solids_as_the_standard_has_it() {
    // Where a point has which coordinates, away from seams and edges.
    type Coordinates = fn(DVec3) -> DVec2;
    let cases: [(&str, Coordinates); 4] = [
        ("Sphere { radius 2 }", |p| {
            let s = ((-p.x).atan2(-p.z)).rem_euclid(TAU) / TAU;
            DVec2::new(s, 0.5 + (p.y / 2.0).asin() / PI)
        }),
        (
            "Cylinder { radius 2 height 3 top FALSE bottom FALSE }",
            |p| {
                let s = ((-p.x).atan2(-p.z)).rem_euclid(TAU) / TAU;
                DVec2::new(s, 0.5 + p.y / 3.0)
            },
        ),
        ("Cylinder { radius 2 side FALSE bottom FALSE }", |p| {
            DVec2::new(p.x, -p.z) / 4.0 + 0.5
        }),
        ("Cone { bottomRadius 2 side FALSE }", |p| {
            DVec2::new(p.x, p.z) / 4.0 + 0.5
        }),
    ];
    for (geometry, coordinates) in cases {
        let patches = patches(geometry);
        assert_eq!(patches.len(), 1, "{geometry}");
        let surface = &patches[0].surface;
        let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
        for i in 0..40 {
            let at = |x: std::ops::Range<f64>, share: f64| x.start + (x.end - x.start) * share;
            let share = (f64::from(i) + 0.5) / 40.0;
            let uv = DVec2::new(at(u.clone(), share), at(v.clone(), (share * 7.3).fract()));
            let found = patches[0].texture_coordinates(uv);
            let expected = coordinates(surface.evaluate(uv));
            assert!(
                found.abs_diff_eq(expected, 1e-8),
                "{geometry} {uv} {found} {expected}"
            );
        }
    }
    // The faces of a box are upright seen from outside: front, back, left, right, top, bottom.
    let lower_left = [
        DVec3::new(-1.0, -1.0, 1.0),
        DVec3::new(1.0, -1.0, -1.0),
        DVec3::new(-1.0, -1.0, -1.0),
        DVec3::new(1.0, -1.0, 1.0),
        DVec3::new(-1.0, 1.0, 1.0),
        DVec3::new(-1.0, -1.0, -1.0),
    ];
    for (patch, corner) in patches("Box {}").iter().zip(lower_left) {
        assert_eq!(patch.surface.evaluate(DVec2::ZERO), corner);
        assert_eq!(
            patch.texture_coordinates(DVec2::new(0.5, 1.0)),
            DVec2::new(0.5, 1.0)
        );
    }
}

const NET: &str = "uDimension 2 vDimension 2 uOrder 2 vOrder 2 uKnot [ 0 0 3 3 ] \
    vKnot [ 0 0 1 1 ] controlPoint Coordinate { point [ 0 0 0, 3 0 0, 0 1 0, 3 1 0 ] }";

#[test]
fn surfaces_have_the_coordinates_of_their_domain_or_those_of_another_surface() {
    let at = |geometry: &str, u, v| patches(geometry)[0].texture_coordinates(DVec2::new(u, v));
    let plain = format!("NurbsPatchSurface {{ {NET} }}");
    assert_eq!(at(&plain, 1.5, 0.25), DVec2::new(0.5, 0.25));
    let points = "TextureCoordinate { point [ 0 0, 0 1, 2 0, 2 1 ] }";
    let given = format!("NurbsPatchSurface {{ {NET} texCoord {points} }}");
    assert_eq!(at(&given, 1.5, 0.25), DVec2::new(0.5, 0.5));
    // A rational one over its own domain, which is brought to that of the surface.
    let own = "NurbsTextureCoordinate { uDimension 3 vDimension 2 uOrder 3 vOrder 2 \
        weight [ 1 2 1 1 2 1 ] controlPoint [ 0 0, 0 0, 1 0, 0 1, 0 2, 1 1 ] }";
    let given = format!("NurbsPatchSurface {{ {NET} texCoord {own} }}");
    let found = at(&given, 1.5, 0.5);
    // At the middle the basis is 1/4, 1/2, 1/4: s = (1/4) / (1/4 + 1 + 1/4).
    assert!(
        found.abs_diff_eq(DVec2::new(1.0 / 6.0, 0.5), 1e-15),
        "{found}"
    );
    let few = format!("NurbsPatchSurface {{ {NET} texCoord TextureCoordinate {{ point 0 0 }} }}");
    let nodes = format!("Shape {{ geometry {few} }}");
    let import = read_with("3.3", &nodes);
    let text = import.warnings.as_slice()[0].to_string();
    assert_eq!(
        text,
        "line 2, TextureCoordinate: 1 control points; 4 are needed"
    );
}

/// The mesh of a geometry, and the material it is shown in.
fn mesh(geometry: &str, appearance: &str) -> (kernel::Mesh, Option<Material>) {
    let import = read_with(
        "3.3",
        &format!("Shape {{ geometry {geometry} {appearance} }}"),
    );
    assert_eq!(import.warnings.as_slice(), [], "{geometry}");
    let placed = &import.scene.placements()[0];
    let Shape::Mesh(id) = placed.shape else {
        panic!("polygons");
    };
    let material = placed.material.map(|id| import.scene.material(id).clone());
    (import.scene.mesh(id).clone(), material)
}

const SQUARE: &str = "coord Coordinate { point [ 0 0 0, 4 0 0, 4 2 0, 0 2 0 ] } \
    coordIndex [ 0 1 2 3 -1 ]";
const PICTURE: &str = "appearance Appearance { texture ImageTexture { url \"colors.png\" } }";

#[test]
fn polygons_have_coordinates_by_their_corners_or_by_their_box() {
    let given =
        "texCoord TextureCoordinate { point [ 0 0, 1 0, 1 1, 0 1 ] } texCoordIndex [ 3 2 1 0 ]";
    let (found, _) = mesh(&format!("IndexedFaceSet {{ {SQUARE} {given} }}"), "");
    let at = |mesh: &kernel::Mesh, point: DVec3| {
        let place = mesh.positions().iter().position(|p| *p == point).unwrap();
        mesh.uvs()[place]
    };
    assert_eq!(at(&found, DVec3::ZERO), DVec2::Y);
    assert_eq!(at(&found, DVec3::new(4.0, 2.0, 0.0)), DVec2::X);
    let (found, _) = mesh(&format!("IndexedFaceSet {{ {SQUARE} }}"), PICTURE);
    assert_eq!(at(&found, DVec3::new(4.0, 2.0, 0.0)), DVec2::new(1.0, 0.5));
    let (found, _) = mesh(&format!("IndexedFaceSet {{ {SQUARE} }}"), "");
    assert!(found.uvs().is_empty());
    let grid = "ElevationGrid { xDimension 3 zDimension 2 height [ 0 0 0 0 0 0 ] }";
    let (found, _) = mesh(grid, PICTURE);
    assert_eq!(at(&found, DVec3::new(1.0, 0.0, 1.0)), DVec2::new(0.5, 1.0));
}

#[test]
fn colours_of_vertices_replace_that_of_the_material() {
    let colors = "color Color { color [ 1 0 0, 0 1 0, 0 0 1, 1 1 1 ] }";
    let geometry = format!("IndexedFaceSet {{ {SQUARE} {colors} }}");
    let orange = format!("appearance Appearance {{ {ORANGE} }}");
    let (found, material) = mesh(&geometry, &orange);
    assert_eq!(found.positions().len(), 4);
    assert_eq!(found.colors()[1], DVec4::new(0.0, 1.0, 0.0, 1.0));
    let material = material.unwrap();
    assert_eq!((material.diffuse, material.opacity), (DVec3::ONE, 0.75));
    assert!((material.ambient - 0.2).abs().max_element() < 1e-15);
    // Without a material they are the only light.
    let (_, material) = mesh(&geometry, "");
    assert!(material.unwrap().is_unlit());
    // One for each face; the last one is transparent.
    let faces = "IndexedFaceSet { coord Coordinate { point [ 0 0 0, 1 0 0, 0 1 0, 1 1 0 ] } \
        coordIndex [ 0 1 2 -1 1 3 2 ] colorPerVertex FALSE colorIndex [ 1 0 ] \
        color ColorRGBA { color [ 1 0 0 0.5, 0 1 0 1 ] } }";
    let (found, _) = mesh(faces, "");
    assert_eq!((found.positions().len(), found.triangles().len()), (6, 2));
    let second = found.triangles()[1][0] as usize;
    assert_eq!(found.colors()[second], DVec4::new(1.0, 0.0, 0.0, 0.5));
}

#[test]
fn the_first_of_several_textures_is_shown() {
    let import = read_with(
        "3.3",
        "Shape { geometry Box {} appearance Appearance { texture MultiTexture { texture [ \
         ImageTexture { url \"grey.png\" } ImageTexture { url \"colors.png\" } ] } } }",
    );
    let warnings = import.warnings.as_slice();
    assert_eq!(
        warnings[0].to_string(),
        "line 2, MultiTexture: only the first of several textures is shown"
    );
    let texture = import.scene.materials()[0].maps.emissive.as_ref().unwrap();
    assert_eq!(texture.image.name(), "grey.png");
}

/// An OBJ surface with this material, written and read again.
fn through(mtl: &str, name: &str) -> (Export, Material) {
    let obj = "mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\ncstype bezier\ndeg 1 1\n\
        surf 0 1 0 1 1 2 3 4\nparm u 0 1\nparm v 0 1\nend\n";
    let resolver = &Files(vec![
        ("a.mtl", format!("newmtl a\n{mtl}").into_bytes()),
        ("alpha.png", encoded(&red_green(), ImageFormat::Png)),
    ]);
    let limits = &Limits::default();
    let options = &ReadOptions { limits, resolver };
    let scene = read(obj.as_bytes(), None, options).unwrap().scene;
    let writer = WRITERS.iter().find(|w| w.name == name).unwrap();
    let export = (writer.write)(&scene, "a").unwrap();
    let again = read(&export.bytes, None, options).unwrap().scene;
    let id = again.placements()[0].material.unwrap();
    (export, again.material(id).clone())
}

#[test]
fn alpha_that_does_not_count_is_written_so_or_told() {
    let opaque = "Kd 1 1 1\nmap_Kd alpha.png\n";
    for name in ["X3D", "X3D ClassicVRML"] {
        let (export, material) = through(opaque, name);
        assert!(material.maps.color.is_some() && material.maps.opacity.is_none());
        // That pictures are not copied, and that the scene has no unit.
        assert_eq!(export.warnings.as_slice().len(), 2, "{name}");
    }
    for (name, mtl) in [
        ("VRML 97", opaque.to_owned()),
        ("X3D", format!("{opaque}d 0.5\n")),
    ] {
        let (export, _) = through(&mtl, name);
        let told = export.warnings.as_slice().iter().map(ToString::to_string);
        let text = "a picture whose alpha does not count: there is no such thing in the format";
        assert!(told.into_iter().any(|told| told.contains(text)), "{name}");
    }
    // Where it counts, so does the opacity.
    let clear = format!("{opaque}map_d alpha.png\nd 0.5\n");
    let (_, material) = through(&clear, "X3D");
    assert!(material.maps.opacity.is_some());
    assert!((material.opacity - 0.5).abs() < 1e-15);
}

#[test]
fn pictures_of_emitted_light_are_moved_without_others() {
    let (_, material) = through("Kd 0.5 0 0\nKe 1 1 1\nmap_Ke -s 3 2 1 alpha.png\n", "X3D");
    let moved = material.maps.emissive.unwrap().picture_from_shape;
    assert!(
        moved.abs_diff_eq(DAffine2::from_scale(DVec2::new(3.0, 2.0)), 1e-12),
        "{moved}"
    );
    let two = "Kd 1 1 1\nmap_Kd alpha.png\nmap_d alpha.png\nKe 1 1 1\nmap_Ke -s 3 2 1 alpha.png\n";
    let (export, _) = through(two, "X3D");
    let mut told = export.warnings.as_slice().iter().map(ToString::to_string);
    assert!(told.any(|told| told.contains("pictures that are moved otherwise than the first")));
}
