//! What nodes become, in the shortest spelling.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use glam::{DVec2, DVec3};
use kernel::{Integrals, Mesh, Patch};

use crate::{Import, Limits, NoFiles, ReadOptions, read};

pub(super) fn read_scene(text: &str) -> Import {
    let (limits, resolver) = (&Limits::default(), &NoFiles);
    let text = format!("#X3D V3.3 utf8\n{text}");
    read(text.as_bytes(), None, &ReadOptions { limits, resolver }).unwrap()
}

/// A scene that shows this geometry, read without a warning.
pub(super) fn shape(geometry: &str) -> Import {
    let import = read_scene(&format!("Shape {{ geometry {geometry} }}"));
    assert_eq!(import.warnings.as_slice(), [], "{geometry}");
    import
}

/// Points of a patch with their normals, away from its poles.
fn samples(patch: &Patch) -> Vec<(DVec3, DVec3)> {
    let surface = &patch.surface;
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let steps = || (0..13).map(|i| (f64::from(i) + 0.43) / 13.0);
    let at = |s: f64, t: f64| {
        DVec2::new(
            u.start + (u.end - u.start) * s,
            v.start + (v.end - v.start) * t,
        )
    };
    let all = steps().flat_map(|s| steps().map(move |t| at(s, t)));
    all.map(|uv| (surface.evaluate(uv), surface.normal(uv).unwrap()))
        .collect()
}

fn area(mesh: &Mesh) -> f64 {
    let corner = |t: &[u32; 3], i: usize| mesh.positions()[t[i] as usize];
    let triangle = |t: &[u32; 3]| {
        let edge = |i| corner(t, i) - corner(t, 0);
        edge(1).cross(edge(2)).length() * 0.5
    };
    mesh.triangles().iter().map(triangle).sum()
}

#[test]
fn closed_curves_with_uneven_knots_meet() {
    let import = shape(
        "NurbsCurve { order 4 closed TRUE knot [0 1 1.5 3.5 4.5 5.2 6.5 7.5 8 10 11] \
         controlPoint Coordinate { point [1 0 0, .5 .8 0, -.5 .8 0, -1 0 0, -.5 -.8 0, .5 -.8 0, 1 0 0] } }",
    );
    let kernel::WireShape::Curve(curve) = &import.scene.wires()[0].shape else {
        panic!("points");
    };
    let ends = [curve.domain().start, curve.domain().end].map(|t| curve.derivatives(t));
    assert!(ends[0].point.distance(ends[1].point) < 1e-12);
    assert!(ends[0].first.distance(ends[1].first) < 1e-12);
}

#[test]
fn lengths_that_are_negative_count_without_their_sign_and_are_told() {
    for (text, told) in [
        ("Box { size 2 -4 6 }", "size: -4; it must not be negative"),
        ("Sphere { radius -1.5 }", "radius: -1.5; it must not be"),
        ("Rectangle2D { size -1 2 }", "size: -1; it must not be"),
        ("Disk2D { innerRadius 2 }", "innerRadius is larger"),
    ] {
        let import = read_scene(&format!("Shape {{ geometry {text} }}"));
        let warnings = import.warnings.as_slice();
        assert_eq!(warnings.len(), 1, "{text}: {warnings:?}");
        assert!(warnings[0].to_string().contains(told), "{}", warnings[0]);
        let mut normals = import.scene.patches().iter().flat_map(samples);
        let is_flat = text.contains("2D");
        assert!(normals.all(|(p, n)| if is_flat { n.z > 0.0 } else { p.dot(n) > 0.0 }));
    }
}

#[test]
fn solids_are_exact_and_face_outwards() {
    // What is zero on the surface.
    type Distance = fn(DVec3) -> f64;
    let solids: [(&str, usize, Distance); 4] = [
        ("Box { size 2 4 6 }", 6, |p| {
            (p.abs() / DVec3::new(1.0, 2.0, 3.0)).max_element() - 1.0
        }),
        ("Sphere { radius 1.5 }", 1, |p| p.length() / 1.5 - 1.0),
        ("Cone { bottomRadius 1.5 height 3 }", 2, |p| {
            let side = p.x.hypot(p.z) / 1.5 - (1.5 - p.y) / 3.0;
            side.max(-1.5 - p.y)
        }),
        ("Cylinder { radius 0.5 height 3 }", 3, |p| {
            (p.x.hypot(p.z) / 0.5).max(p.y.abs() / 1.5) - 1.0
        }),
    ];
    for (text, faces, distance) in solids {
        let import = shape(text);
        assert_eq!(import.scene.patches().len(), faces, "{text}");
        assert_eq!(import.scene.placement_count(), faces as u64, "{text}");
        for (point, normal) in import.scene.patches().iter().flat_map(samples) {
            assert!(distance(point).abs() < 1e-14, "{text} {point}");
            assert!(
                distance(point + normal * 0.01) > 1e-4,
                "{text} {point} {normal}"
            );
        }
    }
    // Flat figures face the z axis; a whole turn has no chord.
    let flat = [
        ("", 0.25 * PI * 4.0),
        ("closureType \"CHORD\"", 0.25 * PI * 4.0 - 2.0),
        (
            "closureType \"CHORD\" endAngle 4.712389",
            0.75 * PI * 4.0 + 2.0,
        ),
        ("closureType \"CHORD\" endAngle 0", PI * 4.0),
    ];
    for (fields, expected) in flat {
        let import = shape(&format!("ArcClose2D {{ radius 2 {fields} }}"));
        let patch = &import.scene.patches()[0];
        let area = Integrals::of(patch, DVec3::ZERO).area();
        assert!((area - expected).abs() < 1e-6, "{fields} {area}");
        assert!(
            samples(patch).iter().all(|(_, normal)| normal.z > 0.99),
            "{fields}"
        );
    }
    let open = shape("Cylinder { top FALSE bottom FALSE }");
    assert_eq!(open.scene.patches().len(), 1);
    // The seam is at the back.
    let side = &open.scene.patches()[0].surface;
    assert_eq!(side.evaluate(DVec2::ZERO), DVec3::new(0.0, 1.0, -1.0));
}

#[test]
fn an_extrusion_of_nothing_said_is_a_box() {
    let import = shape("Extrusion { }");
    let [side, begin, end] = import.scene.patches() else {
        panic!("a side and two caps");
    };
    for (point, normal) in samples(side) {
        assert!(
            (point.x.abs().max(point.z.abs()) - 1.0).abs() < 1e-15,
            "{point}"
        );
        assert!(normal.dot(point) > 0.9, "{normal}");
    }
    assert!(
        samples(begin)
            .iter()
            .all(|(p, n)| p.y == 0.0 && *n == DVec3::NEG_Y)
    );
    assert!(
        samples(end)
            .iter()
            .all(|(p, n)| (p.y - 1.0).abs() == 0.0 && *n == DVec3::Y)
    );
    assert_eq!((begin.loops.len(), end.loops.len()), (1, 1));
}

#[test]
fn sections_of_an_extrusion_stand_across_its_spine() {
    // Around a corner the section lies in the plane that halves it.
    let import = shape(
        "Extrusion { spine [ 0 -2 0, 0 0 0, 2 0 0 ] crossSection [ 1 0, 0 1, -1 0, 0 -1, 1 0 ] \
         scale [ 1 1, 1 1, 2 0.5 ] orientation [ 0 1 0 0, 0 1 0 0, 1 0 0 0 ] beginCap FALSE }",
    );
    let side = &import.scene.patches()[0].surface;
    assert_eq!(import.scene.patches().len(), 2);
    let at = |u: f64, v: f64| side.evaluate(DVec2::new(u, v));
    // The spine turns from +y to +x: z is across, and x points to the inner side of the turn
    // or away from it, as y cross z says.
    let z = at(1.0, 1.0);
    assert!(
        (z - DVec3::Z * z.z).length() < 1e-15 && (z.z.abs() - 1.0).abs() < 1e-15,
        "{z}"
    );
    let x = at(0.0, 1.0);
    let expected = DVec3::new(FRAC_1_SQRT_2, -FRAC_1_SQRT_2, 0.0) * z.z.signum();
    assert!(
        x.distance(expected) < 1e-15 || x.distance(-expected) < 1e-15,
        "{x}"
    );
    let y = DVec3::new(1.0, 1.0, 0.0) * FRAC_1_SQRT_2;
    assert!(x.cross(y).distance(z) < 1e-15, "right-handed");
    // The last section is scaled, and stands across +x.
    let last = at(0.0, 2.0) - DVec3::X * 2.0;
    assert!(
        last.x.abs() < 1e-15 && (last.length() - 2.0).abs() < 1e-15,
        "{last}"
    );
    assert!(((at(1.0, 2.0) - DVec3::X * 2.0).length() - 0.5).abs() < 1e-15);
}

#[test]
fn every_list_of_polygons_is_cut_into_its_triangles() {
    let square = "coord Coordinate { point [ 0 0 0, 2 0 0, 2 2 0, 0 2 0 ] }";
    let zigzag = "coord Coordinate { point [ 0 0 0, 2 0 0, 0 2 0, 2 2 0 ] }";
    for geometry in [
        format!("IndexedFaceSet {{ coordIndex [ 0 1 2 3 ] {square} }}"),
        format!("IndexedTriangleSet {{ index [ 0 1 2 2 3 0 ] {square} }}"),
        format!("IndexedTriangleFanSet {{ index [ 0 1 2 3 -1 ] {square} }}"),
        format!("IndexedTriangleStripSet {{ index [ 0 1 2 3 -1 ] {zigzag} }}"),
        format!("TriangleFanSet {{ fanCount 4 {square} }}"),
        format!("TriangleStripSet {{ stripCount 4 {zigzag} }}"),
        format!("QuadSet {{ {square} }}"),
        format!("IndexedQuadSet {{ index [ 0 1 2 3 ] {square} }}"),
        "TriangleSet2D { vertices [ 0 0, 2 0, 2 2, 2 2, 0 2, 0 0 ] }".to_owned(),
    ] {
        let import = shape(&geometry);
        let mesh = &import.scene.meshes()[0];
        assert_eq!((mesh.triangles().len(), area(mesh)), (2, 4.0), "{geometry}");
        for t in mesh.triangles() {
            let [a, b, c] = t.map(|i| mesh.positions()[i as usize]);
            assert_eq!((b - a).cross(c - a).normalize(), DVec3::Z, "{geometry}");
        }
        assert!(mesh.normals().iter().all(|n| n.distance(DVec3::Z) < 1e-15));
    }
    // An L, which is concave: its area, not that of a fan.
    let import = shape(
        "IndexedFaceSet { convex FALSE coordIndex [ 0 1 2 3 4 5 -1 ] \
         coord Coordinate { point [ 3 0 0, 3 1 0, 1 1 0, 1 3 0, 0 3 0, 0 0 0 ] } }",
    );
    assert!((area(&import.scene.meshes()[0]) - 5.0).abs() < 1e-15);
}

#[test]
fn an_elevation_grid_faces_upwards() {
    let import = shape(
        "ElevationGrid { xDimension 3 zDimension 2 xSpacing 2 zSpacing 0.5 height [ 0 0 0 1 1 1 ] }",
    );
    let mesh = &import.scene.meshes()[0];
    assert_eq!(mesh.triangles().len(), 4);
    assert!((area(mesh) - 4.0 * 1.25_f64.sqrt()).abs() < 1e-14);
    assert_eq!(mesh.positions()[5], DVec3::new(4.0, 1.0, 0.5));
    for t in mesh.triangles() {
        let [a, b, c] = t.map(|i| mesh.positions()[i as usize]);
        assert!((b - a).cross(c - a).y > 0.0);
    }
}

#[test]
fn normals_come_from_the_file_or_are_smooth_up_to_the_crease() {
    // Two faces that meet at 90 degrees in an edge along z.
    let roof = |fields: &str| {
        let import = shape(&format!(
            "IndexedFaceSet {{ coordIndex [ 0 1 2 3 -1 3 2 4 5 -1 ] {fields} coord Coordinate {{ \
             point [ 0 0 0, 0 0 1, 1 1 1, 1 1 0, 2 0 1, 2 0 0 ] }} }}"
        ));
        let mesh = &import.scene.meshes()[0];
        let mut normals: Vec<_> = mesh
            .normals()
            .iter()
            .map(|n| (*n * 100.0).round())
            .collect();
        normals.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).unwrap());
        normals.dedup();
        (normals, mesh.positions().len())
    };
    let (left, right) = (DVec3::new(-71.0, 71.0, 0.0), DVec3::new(71.0, 71.0, 0.0));
    assert_eq!(roof(""), (vec![], 6));
    assert_eq!(roof("creaseAngle 1.5"), (vec![left, right], 8));
    assert_eq!(
        roof("creaseAngle 1.6"),
        (vec![left, DVec3::Y * 100.0, right], 6)
    );
    let each = "normalPerVertex FALSE normal Normal { vector [ 1 0 0, 0 0 1 ] }";
    assert_eq!(roof(each), (vec![DVec3::Z * 100.0, DVec3::X * 100.0], 8));
    let indexed = "normalIndex [ 1 1 1 1 -1 0 0 0 0 ] normal Normal { vector [ 1 0 0, 0 0 1 ] }";
    assert_eq!(roof(indexed), (vec![DVec3::Z * 100.0, DVec3::X * 100.0], 8));
}

#[test]
fn closed_curves_go_on_around_the_joint() {
    // A square of four different points, smooth at the joint only if the flag is heeded.
    let surface = |fields: &str| {
        let import = shape(&format!(
            "NurbsPatchSurface {{ uDimension 5 vDimension 2 vOrder 2 {fields} controlPoint \
             Coordinate {{ point [ 1 0 0, 0 1 0, -1 0 0, 0 -1 0, 1 0 0, \
             1 0 1, 0 1 1, -1 0 1, 0 -1 1, 1 0 1 ] }} }}"
        ));
        import.scene.patches()[0].surface.clone()
    };
    let turn = |fields: &str| {
        let surface = surface(fields);
        let u = surface.knots_u().domain();
        let [a, b] = [u.start, u.end].map(|u| surface.derivatives(DVec2::new(u, 0.5)));
        assert_eq!(a.point, b.point);
        a.du.angle_between(b.du)
    };
    assert!(turn("") > 1.0);
    assert!(turn("uClosed TRUE") < 1e-12);
    assert!(turn("uClosed TRUE uKnot [ 0 1 2 3 4 5 6 7 ]") < 1e-12);
    // Clamped knots have no more to say.
    assert!(turn("uClosed TRUE uKnot [ 0 0 0 1 2 3 3 3 ]") > 1.0);
    // Midway between two corners of a quadratic: the middle of the edge.
    let middle = surface("uClosed TRUE").evaluate(DVec2::new(2.0, 0.0));
    assert!(
        (middle.abs() - DVec3::new(0.5, 0.5, 0.0)).length() < 1e-15,
        "{middle}"
    );
}

#[test]
fn a_swept_surface_is_what_extrusions_with_short_segments_become() {
    let curve = "order 4 controlPoint Coordinate { point [ 0 0 0, 1 2 0, 2 -1 1, 3 0 2, 5 1 2 ] }";
    let section = "0.1 0.2, 0.3 -0.1, -0.2 -0.2";
    let import = shape(&format!(
        "NurbsSweptSurface {{ crossSectionCurve ContourPolyline2D {{ controlPoint [ {section} ] }} \
         trajectoryCurve NurbsCurve {{ {curve} }} }}"
    ));
    let [swept] = import.scene.patches() else {
        panic!("one surface");
    };
    // The curve by itself: the edge of a ruled surface.
    let (first, second) = (
        "0 0 0, 1 2 0, 2 -1 1, 3 0 2, 5 1 2",
        "0 0 1, 1 2 1, 2 -1 2, 3 0 3, 5 1 3",
    );
    let edge = shape(&format!(
        "NurbsPatchSurface {{ uDimension 5 vDimension 2 uOrder 4 vOrder 2 \
         controlPoint Coordinate {{ point [ {first}, {second} ] }} }}"
    ));
    let edge = &edge.scene.patches()[0].surface;
    let n = 2000;
    let spine: Vec<DVec3> = (0..=n)
        .map(|i| edge.evaluate(DVec2::new(f64::from(i) / f64::from(n), 0.0)))
        .collect();
    let frames = super::extrusion::frames(&spine);
    let mut largest: f64 = 0.0;
    for i in (10..n).step_by(10) {
        let at = usize::try_from(i).unwrap();
        let axes = frames[at];
        for (u, c) in [(0.0, [0.1, 0.2]), (1.0, [0.3, -0.1]), (2.0, [-0.2, -0.2])] {
            let wanted = spine[at] + axes * DVec3::new(c[0], 0.0, c[1]);
            let found = swept
                .surface
                .evaluate(DVec2::new(u, f64::from(i) / f64::from(n)));
            largest = largest.max(found.distance(wanted));
        }
    }
    // The segments are 0.003 long; what remains is of second order.
    assert!(largest < 1e-4, "{largest}");
}

#[test]
fn skies_turn_with_their_transform() {
    let import = read_scene(
        "Transform { rotation 1 0 0 1.5707963267948966 children [ Background { skyColor [ 1 0 0, 0 0 1 ] \
         skyAngle 1.5 groundColor [ 0 1 0, 0 1 0 ] groundAngle 1.2 } ] }",
    );
    assert_eq!(import.scene.background, Some(DVec3::X));
    let sky = import.scene.sky.as_ref().unwrap();
    let near = |direction, color: DVec3| assert!(sky.color(direction).distance(color) < 1e-12);
    near(DVec3::Z, DVec3::X);
    near(DVec3::NEG_Z, DVec3::Y);
    near(DVec3::X, DVec3::Z);
}

#[test]
fn materials_may_look_otherwise_from_behind() {
    let two = "material TwoSidedMaterial { diffuseColor 1 0 0 backDiffuseColor 0 0 1 \
        backTransparency 0.5 separateBackColor TRUE }";
    let four = "material Material { diffuseColor 1 0 0 } \
        backMaterial Material { diffuseColor 0 0 1 transparency 0.5 }";
    for appearance in [two, four] {
        let import = read_scene(&format!(
            "Shape {{ appearance Appearance {{ {appearance} }} geometry Box {{ }} }}"
        ));
        assert_eq!(import.warnings.as_slice(), []);
        let id = import.scene.placements()[0].material.unwrap();
        let material = import.scene.material(id);
        assert_eq!(material.diffuse, DVec3::X);
        let back = material.back.as_ref().unwrap();
        assert_eq!(back.diffuse, DVec3::Z);
        assert!((back.opacity - 0.5).abs() < 1e-15);
    }
}

#[test]
fn spots_have_the_angles_of_their_standard() {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
    for (header, expected) in [
        ("#VRML V2.0 utf8", (FRAC_PI_4, FRAC_PI_4)),
        ("#X3D V3.2 utf8", (FRAC_PI_4, FRAC_PI_2)),
        ("#X3D V4.0 utf8", (0.589_049, FRAC_PI_2)),
    ] {
        let (limits, resolver) = (&Limits::default(), &NoFiles);
        let text = format!("{header}\nSpotLight {{ attenuation 1 0 0.5 radius 7 }}");
        let options = ReadOptions { limits, resolver };
        let import = read(text.as_bytes(), None, &options).unwrap();
        let kernel::LightKind::Spot {
            inner,
            outer,
            falloff,
            ..
        } = import.scene.lights[0].kind
        else {
            panic!("a spot");
        };
        assert_eq!((inner, outer), expected, "{header}");
        assert_eq!(
            (falloff.attenuation, falloff.radius),
            (DVec3::new(1.0, 0.0, 0.5), 7.0)
        );
    }
}

#[test]
fn lights_shine_at_every_place_where_they_stand() {
    let import = read_scene(
        "Transform { translation -5 0 3 children DEF L PointLight { radius 4 } } \
         Transform { translation 5 0 3 scale 2 2 2 children USE L } \
         DEF G Group { children [ DEF V Viewpoint { } SpotLight { } ] } \
         Transform { translation 0 4 0 children [ USE G USE L ] }",
    );
    let place = |light: &kernel::Light| match light.kind {
        kernel::LightKind::Point { position, falloff }
        | kernel::LightKind::Spot {
            position, falloff, ..
        } => (position, falloff.radius),
        kernel::LightKind::Directional { .. } => panic!("it shines everywhere"),
    };
    let places: Vec<_> = import.scene.lights.iter().map(place).collect();
    let at = |x, y, z, radius| (DVec3::new(x, y, z), radius);
    let expected = [
        at(-5.0, 0.0, 3.0, 4.0),
        at(5.0, 0.0, 3.0, 8.0),
        at(0.0, 0.0, 0.0, 100.0),
        at(0.0, 4.0, 0.0, 100.0),
        at(0.0, 4.0, 0.0, 4.0),
    ];
    assert_eq!(places, expected);
    assert_eq!(import.scene.cameras.len(), 1);
}

#[test]
fn lights_of_groups_shine_there_at_every_place() {
    let import = read_scene(
        "DEF G Group { children [ PointLight { global FALSE } DirectionalLight { } \
         DirectionalLight { global TRUE } Shape { geometry Sphere { } } ] } \
         Transform { translation 0 4 0 children USE G } Group { children DirectionalLight { } } \
         DirectionalLight { }",
    );
    let scene = &import.scene;
    let lights = scene.lights.iter();
    let scopes: Vec<_> = lights.map(|light| light.scope.as_slice()).collect();
    let placements = scene.placements();
    let [first, second] = [0, placements.len() - 1].map(|k| placements[k].path.as_slice());
    assert_ne!(first, second);
    // That of an empty group shines nowhere.
    let all: &[kernel::NodeId] = &[];
    assert_eq!(scopes, [first, first, all, second, second, all, all]);
    assert!(import.warnings.as_slice().is_empty());
}

#[test]
fn lights_in_ever_more_places_end_at_a_limit() {
    let mut text = "DEF G0 Group { children PointLight { global FALSE } }\n".to_owned();
    for k in 0..60 {
        let next = k + 1;
        text += &format!("DEF G{next} Group {{ children [ USE G{k} USE G{k} ] }}\n");
    }
    let import = read_scene(&text);
    assert!(import.scene.lights.is_empty());
    let told = import.warnings.as_slice()[0].to_string();
    assert!(told.ends_with("the others do not shine"), "{told}");
    let text = text.replace("global FALSE", "");
    let import = read_scene(&text);
    assert_eq!(import.scene.lights.len(), 3000);
    let told = import.warnings.as_slice()[0].to_string();
    assert!(
        told.ends_with("more than 3000 places of lights; the others do not shine"),
        "{told}"
    );
}

#[test]
fn a_deformer_carries_points_through_its_volume() {
    // A cube of eight points, stretched threefold along x; linear in every direction.
    let volume = "uDimension 2 vDimension 2 wDimension 2 controlPoint [ 0 0 0, 3 0 0, 0 1 0, 3 1 0, \
        0 0 1, 3 0 1, 0 1 1, 3 1 1 ]";
    let import = read_scene(&format!(
        "CoordinateDeformer {{ {volume} inputTransform Transform {{ translation 0.5 0 0 }} \
         inputCoord Coordinate {{ point [ 0 0 0, 0.5 0 0, 0 0.5 0.25 ] }} \
         outputCoord DEF OUT Coordinate {{ }} \
         children Shape {{ geometry TriangleSet {{ coord USE OUT }} }} }}"
    ));
    assert_eq!(import.warnings.as_slice(), []);
    let found = import.scene.meshes()[0].positions();
    assert_eq!(
        found,
        [
            DVec3::new(1.5, 0.0, 0.0),
            DVec3::X * 3.0,
            DVec3::new(1.5, 0.5, 0.25)
        ]
    );
    let import = read_scene("CoordinateDeformer { inputCoord Coordinate { } uDimension 2 }");
    assert_eq!(import.warnings.as_slice().len(), 1);
}

#[test]
fn a_second_geometry_of_a_shape_is_told() {
    for second in ["Box { }", "LineSet { }"] {
        let text = format!("Shape {{ geometry Sphere {{ }} geometry {second} }}");
        let import = read_scene(&text);
        assert_eq!(import.scene.placement_count(), 1, "{second}");
        let told = import.warnings.as_slice().iter();
        let told: Vec<_> = told.map(|w| w.problem.to_string()).collect();
        assert!(!told.is_empty(), "{second} is dropped in silence");
    }
}

#[test]
fn torn_surfaces_are_cut_and_joints_that_meet_are_joined() {
    // Two squares with a gap between them, and without one.
    for (end, count) in [(1.0, 1), (1.5, 2)] {
        let text = format!(
            "Shape {{ geometry NurbsPatchSurface {{ uDimension 4 vDimension 2 uOrder 2 vOrder 2 \
             uKnot [ 0 0 1 1 2 2 ] vKnot [ 0 0 1 1 ] controlPoint Coordinate {{ point [ 0 0 0, 1 0 0, \
             {end} 0 0, 3 0 0, 0 1 0, 1 1 0, {end} 1 0, 3 1 0 ] }} }} }}"
        );
        let import = read_scene(&text);
        assert_eq!(import.scene.placement_count(), count);
        assert_eq!(import.warnings.as_slice().len(), 1);
        let area: f64 = (import.scene.patches().iter())
            .map(|patch| Integrals::of(patch, DVec3::ZERO).area())
            .sum();
        assert!((area - (4.0 - end)).abs() < 1e-12, "{area}");
    }
}
