//! Files that break the rules of X3D, and those that ask for too much.

use glam::{DVec2, DVec3};

use super::tests::{file, messages, only_surface, read_scene, read_with, square};
use crate::Limits;

#[test]
fn knots_that_do_not_fit_are_replaced() {
    let knots = |attributes: &str| {
        let import = read_scene(&format!("<Shape>{}</Shape>", square(attributes)));
        let knots = only_surface(&import).knots_u().as_slice().to_vec();
        (knots, messages(&import))
    };
    let clamped = vec![0.0, 0.0, 1.0, 1.0];
    assert_eq!(knots(""), (clamped.clone(), vec![]));
    assert_eq!(knots("uKnot='2 2 5 5'"), (vec![2.0, 2.0, 5.0, 5.0], vec![]));
    let place = "line 2, NurbsPatchSurface, uKnot: ";
    let text = "3 knots; dimension + order = 4 are needed; equal steps are used";
    let expected = (clamped.clone(), vec![format!("{place}{text}")]);
    assert_eq!(knots("uKnot='0 0 1'"), expected);
    let text = "two knots are missing; the first and the last are repeated";
    let expected = (vec![2.0, 2.0, 5.0, 5.0], vec![format!("{place}{text}")]);
    assert_eq!(knots("uKnot='2 5'"), expected);
    let text = "knot 2 is 0 after 1; knots must not decrease; equal steps are used";
    let expected = (clamped, vec![format!("{place}{text}")]);
    assert_eq!(knots("uKnot='0 1 0 1'"), expected);
    let settled = (vec![2.0, 2.0, 5.0, 5.0], vec![]);
    assert_eq!(knots("uKnot='2 1.9999999999 5 5'"), settled);
}

#[test]
fn weights_that_do_not_fit_are_one() {
    for (weights, text) in [
        (
            "1 2 1",
            "3 weights for 4 control points; all weights are taken as one",
        ),
        (
            "1 1 -1 1",
            "weight 2 is -1; weights must be positive; all weights are taken as one",
        ),
    ] {
        let shape = format!("<Shape>{}</Shape>", square(&format!("weight='{weights}'")));
        let import = read_scene(&shape);
        assert!(!only_surface(&import).is_rational());
        let expected = format!("line 2, NurbsPatchSurface, weight: {text}");
        assert_eq!(messages(&import), [expected]);
    }
    let import = read_scene(&format!("<Shape>{}</Shape>", square("weight='1 1 1 2'")));
    let corner = only_surface(&import).evaluate(DVec2::ONE);
    assert_eq!(corner, DVec3::new(0.5, 0.5, 0.0));
    // Points are multiplied by their weights: by negative ones, too.
    let shape = format!("<Shape>{}</Shape>", square("weight='-1 -1 -1 -2'"));
    let import = read_scene(&shape);
    let corner = only_surface(&import).evaluate(DVec2::ONE);
    assert_eq!(corner, DVec3::new(-0.5, -0.5, 0.0));
    let expected = "line 2, NurbsPatchSurface, weight: all weights are negative";
    assert_eq!(messages(&import), [expected]);
}

#[test]
fn a_missing_dimension_follows_from_the_other() {
    let import = read_scene(
        "<Shape><NurbsPatchSurface vDimension='3' uOrder='2' vOrder='2'>\
         <CoordinateDouble containerField='coord' point='0 0 0 1 0 0 0 1 0 1 1 0 0 2 0 1 2 0'/>\
         </NurbsPatchSurface></Shape>",
    );
    assert_eq!(only_surface(&import).knots_u().count(), 2);
    assert_eq!(only_surface(&import).knots_v().count(), 3);
    assert_eq!(messages(&import).len(), 1);
}

#[test]
fn a_surface_that_cannot_be_is_left_out() {
    for (attributes, text) in [
        (
            "vDimension='3' uOrder='2'",
            "4 control points; 6 are needed",
        ),
        (
            "vDimension='99999999999999' uOrder='2'",
            "4 control points; 199999999999998 are needed",
        ),
        (
            "vDimension='2' uOrder='1'",
            "degree 0; degrees go from 1 to 30",
        ),
        (
            "vDimension='2' uOrder='3'",
            "2 control points; 3 are needed",
        ),
    ] {
        let import = read_scene(&format!(
            "<Shape><NurbsPatchSurface uDimension='2' vOrder='2' {attributes}>\
             <Coordinate point='0 0 0, 1 0 0, 0 1 0, 1 1 0'/></NurbsPatchSurface></Shape>"
        ));
        assert!(import.scene.patches().is_empty(), "{attributes}");
        let expected = format!("line 2, NurbsPatchSurface: {text}");
        assert_eq!(messages(&import), [expected]);
    }
}

#[test]
fn what_is_used_must_be_complete() {
    let import = read_scene(&format!(
        "<Group DEF='A'><Group USE='A'/><Shape USE='B'/><Shape DEF='B'>{}</Shape></Group>\
         <Shape USE='B'/>",
        square("")
    ));
    assert_eq!(import.scene.placements().len(), 2);
    assert_eq!(
        messages(&import),
        [
            "line 2, Group USE A: a node is used inside itself; it is left out there",
            "line 2, Shape USE B: USE of a name that no node before has as its DEF",
        ]
    );
}

#[test]
fn a_chain_of_uses_is_as_deep_as_nested_nodes() {
    let mut scene = format!("<Group DEF='G0'><Shape>{}</Shape></Group>", square(""));
    for i in 1..300 {
        scene += &format!("<Group DEF='G{i}'><Group USE='G{}'/></Group>", i - 1);
    }
    let problem = read_with(&Limits::default(), &file(&scene)).unwrap_err();
    assert_eq!(problem.problem.kind(), "too large");
    let limits = Limits {
        nesting: 400,
        ..Limits::default()
    };
    assert!(read_with(&limits, &file(&scene)).is_ok());
}

#[test]
fn nothing_is_left_out_in_silence() {
    let import = read_scene(
        "<Shape DEF='S'><Text/><Appearance><ImageTexture url='a'/></Appearance></Shape>\n\
         <Inline url='a'/><ROUTE/><ProtoDeclare><ProtoBody><Text DEF='S'/></ProtoBody>\
         </ProtoDeclare>\n<Shape><Text/></Shape><WorldInfo/><MetadataString/>",
    );
    assert!(import.scene.root().is_none());
    assert_eq!(
        messages(&import),
        [
            "line 3, Inline: a file that is named could not be read: \
             a: files named inside are not opened",
            "line 3, ROUTE: a ROUTE between nodes that are not both there",
            "line 2, Text: Text is not read (and 1 more)",
            "line 2, ImageTexture: a picture could not be read: a: files named inside are not opened",
        ]
    );
}

#[test]
fn broken_xml_keeps_what_was_complete() {
    let shape = format!("<Shape>{}</Shape>\n", square(""));
    let whole = file(&format!("{shape}{shape}"));
    let second = whole.rfind("</NurbsPatch").unwrap();
    let import = read_with(&Limits::default(), &whole[..second]).unwrap();
    assert_eq!(import.scene.placements().len(), 1);
    assert_eq!(
        messages(&import),
        [
            "line 3: the file ends inside NurbsPatchSurface of line 3",
            "line 3, NurbsPatchSurface: the file ends inside this NurbsPatchSurface; it is left out",
        ]
    );
    let first = whole.find("</NurbsPatch").unwrap();
    let error = read_with(&Limits::default(), &whole[..first]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "X3D line 2: the file ends inside NurbsPatchSurface of line 2"
    );
    let import = read_with(&Limits::default(), &file(&format!("{shape}<Group>"))).unwrap();
    assert_eq!(import.scene.placements().len(), 1);
    let [message] = &messages(&import)[..] else {
        panic!("one message");
    };
    assert!(message.starts_with("line 4: broken XML: "), "{message}");
}

#[test]
fn entities_of_a_document_are_not_expanded() {
    let text = "<!DOCTYPE X3D [<!ENTITY a '0 0 0'>]>\n<X3D><Scene><Viewpoint \
        description='&lt;&#65;' position='&a;'/></Scene></X3D>";
    let import = read_with(&Limits::default(), text).unwrap();
    assert_eq!(import.scene.cameras[0].name, "<A");
    let [message] = &messages(&import)[..] else {
        panic!("one message");
    };
    assert!(message.starts_with("line 2, Viewpoint: the value of position is not used"));
}

#[test]
fn a_file_without_a_scene_is_refused() {
    let problem = read_with(&Limits::default(), "<html/>").unwrap_err();
    let text = "X3D the file: there is no scene in it; this is no X3D file";
    assert_eq!(problem.to_string(), text);
}

#[test]
fn limits_hold() {
    let text = file(&format!("<Shape>{}</Shape>", square("")));
    for limits in [
        Limits {
            entities: 4,
            ..Limits::default()
        },
        Limits {
            nesting: 3,
            ..Limits::default()
        },
        Limits {
            points: 3,
            ..Limits::default()
        },
    ] {
        let problem = read_with(&limits, &text).unwrap_err();
        assert_eq!(problem.problem.kind(), "too large", "{problem}");
    }
}

#[test]
fn points_of_swung_and_swept_surfaces_count() {
    let points = "1 0 2 1 ".repeat(100);
    let curve = |field: &str| {
        format!("<NurbsCurve2D containerField='{field}' order='2' controlPoint='{points}'/>")
    };
    let [profile, section] = ["profileCurve", "crossSectionCurve"].map(curve);
    let swung = format!(
        "<NurbsSwungSurface>{profile}{}</NurbsSwungSurface>",
        curve("trajectoryCurve")
    );
    let swept = |order: usize| {
        format!(
            "<NurbsSweptSurface>{section}<NurbsCurve containerField='trajectoryCurve' \
             order='{order}'><Coordinate point='0 0 0 0 1 0 1 2 0 0 3 0 0 4 1'/></NurbsCurve>\
             </NurbsSweptSurface>"
        )
    };
    // A curve takes more points than it has itself.
    for (geometry, most) in [(swung, 1000), (swept(2), 1000), (swept(3), 2000)] {
        let limits = Limits {
            points: most,
            ..Limits::default()
        };
        let text = file(&format!("<Shape>{geometry}</Shape>"));
        let problem = read_with(&limits, &text).unwrap_err().to_string();
        let expected = format!(
            "Surface: more than {most} control points; products of two lists count 16 times"
        );
        assert!(problem.ends_with(&expected), "{problem}");
        assert!(read_with(&Limits::default(), &text).is_ok());
    }
}

#[test]
fn broken_json_says_where() {
    let json = |text: &str| read_with(&Limits::default(), text);
    let import = json(
        "{\"X3D\": {\"Scene\": {\"-children\": [\n{\"Shape\": {\"-geometry\":\
        {\"Box\": {\"@size\": [1, 2, 3]}}}},\n{\"Group\": {\"-children\" []}}]}}}",
    );
    let import = import.unwrap();
    assert_eq!(import.scene.patches().len(), 6);
    let text = "line 3: broken JSON: ':' is wanted here; nothing is read from here on";
    assert_eq!(messages(&import)[0], text);
    let error = json("{\"X3D\": [").unwrap_err().to_string();
    assert!(error.starts_with("X3D line 1: broken JSON: "), "{error}");
}

#[test]
fn deep_json_meets_the_limit() {
    for (start, part) in [
        (
            "{\"X3D\":{\"Scene\":{\"-children\":[",
            "{\"Group\":{\"-children\":[",
        ),
        ("{\"X3D\":{\"#a\":", "{\"b\":"),
        ("{\"X3D\":{\"a\":", "["),
    ] {
        let text = format!("{start}{}", part.repeat(100_000));
        let problem = read_with(&Limits::default(), &text).unwrap_err();
        assert_eq!(problem.problem.kind(), "too large", "{problem}");
    }
}

/// The area inside the contours of a square, with what is told about them.
fn area_inside(contours: &str) -> (f64, Vec<String>) {
    let import = read_scene(&format!(
        "<Shape><NurbsTrimmedSurface uDimension='2' vDimension='2' uOrder='2' vOrder='2'>\
         <Coordinate point='0 0 0, 1 0 0, 0 1 0, 1 1 0'/>{contours}</NurbsTrimmedSurface></Shape>"
    ));
    let loops = &import.scene.patches()[0].loops;
    let area = loops.iter().map(kernel::TrimLoop::signed_area).sum();
    (area, messages(&import))
}

#[test]
fn contours_are_mended_where_viewers_agree_on_them() {
    let line = |points: &str| format!("<ContourPolyline2D controlPoint='{points}'/>");
    let contour = |inside: &[String]| format!("<Contour2D>{}</Contour2D>", inside.concat());
    let open = line(".2 .2 .8 .2 .8 .8 .2 .8");
    let border = line("0 0 1 0 1 1 0 1 0 0");
    let hole = line(".2 .2 .2 .8 .8 .8 .8 .2 .2 .2");
    let (one, two) = (line(".2 .2 .8 .2 .8 .8"), line(".8 .8 .2 .8 .2 .2"));
    let (one_back, two_back) = (line(".8 .8 .8 .2 .2 .2"), line(".2 .2 .2 .8 .8 .8"));
    let turned = "Contour2D: curves run against each other; they are turned";
    for (contours, expected, told) in [
        (
            contour(std::slice::from_ref(&open)),
            0.36,
            "Contour2D: the contour is open; a line closes it",
        ),
        (contour(&[one.clone(), two_back]), 0.36, turned),
        (contour(&[one_back, two]), -0.36, turned),
        (
            contour(&[border, hole.clone()]),
            0.64,
            "Contour2D: several loops stand in one contour; each counts by itself",
        ),
    ] {
        let (area, messages) = area_inside(&contours);
        let area = if expected < 0.0 { area - 1.0 } else { area };
        assert!((area - expected).abs() < 1e-12, "{contours} {area}");
        assert_eq!(messages, [format!("line 2, {told}")]);
    }
    let (area, messages) = area_inside(&open);
    assert!((area - 0.36).abs() < 1e-12, "{area}");
    let told = "line 2, ContourPolyline2D: it stands in no Contour2D; it is taken for one";
    assert_eq!(messages[0], told);
    let (_, messages) = area_inside(&contour(&[line("2 2 3 2 3 3 2 2")]));
    let told = "line 2, NurbsTrimmedSurface: its trim loops, from (2, 2) to (3, 3), lie outside its \
                domain, which goes from (0, 0) to (1, 1); the surface is shown untrimmed";
    assert_eq!(messages, [told]);
    // A border that runs as a hole does leaves the surface, with its holes; what is larger, nothing.
    let clockwise = contour(&[line("0 0 0 1 1 1 1 0 0 0")]);
    let (area, messages) = area_inside(&clockwise);
    assert!((area - 1.0).abs() < 1e-12, "{area}");
    let told = "line 2, NurbsTrimmedSurface: the border runs clockwise, as a hole does; it counts as \
                the border";
    assert_eq!(messages, [told]);
    let (area, messages) = area_inside(&format!("{clockwise}{}", contour(&[hole])));
    assert!((area - 0.64).abs() < 1e-12, "{area}");
    assert_eq!(messages, [told]);
    let (area, messages) = area_inside(&contour(&[line("-1 -1 -1 2 2 2 2 -1 -1 -1")]));
    assert!(area.abs() < 1e-12, "{area}");
    assert!(messages[0].contains("nothing is inside"), "{messages:?}");
    let (_, messages) = area_inside(&contour(&[line("-.1 .2 .5 .2 .5 .8 -.1 .2")]));
    let told =
        "line 2, NurbsTrimmedSurface: the loop leaves the surface; what lies outside is cut off";
    assert_eq!(messages, [told]);
    // Which part comes next is not guessed.
    let apart = contour(&[one, line(".1 .1 .1 .9")]);
    let (_, messages) = area_inside(&apart);
    assert!(messages[0].ends_with("untrimmed"), "{messages:?}");
}

#[test]
fn what_stands_in_no_scene_or_shape_is_told() {
    let found = read_with(
        &Limits::default(),
        &format!("<Group><Shape>{0}</Shape></Group>", square("")),
    );
    let found = found.unwrap();
    assert_eq!(found.scene.placement_count(), 1);
    let told = "line 1, Group: there is no X3D element around it; it is taken for the scene";
    assert_eq!(messages(&found), [told]);

    let bare = read_scene(&format!("<Group>{}</Group>", square("DEF='A'")));
    assert_eq!(bare.scene.placement_count(), 0);
    let told = "line 2, NurbsPatchSurface DEF A: it stands in no Shape; it is not shown";
    assert_eq!(messages(&bare), [told]);

    let lost = read_scene(&format!(
        "<EspduTransform><Shape>{0}</Shape></EspduTransform>\
         <GeoLocation><Group><Shape>{0}</Shape><Shape DEF='B'>{0}</Shape></Group></GeoLocation>\
         <Shape USE='B'/>",
        square("")
    ));
    assert_eq!(lost.scene.placement_count(), 2);
    let told = "line 2, GeoLocation: GeoLocation is not read, nor the geometry in it";
    assert_eq!(messages(&lost), [told]);

    let empty = read_scene("<Shape><PointSet><Coordinate/></PointSet></Shape>");
    assert_eq!(empty.scene.wires().len(), 0);

    let set = read_scene(&format!("<NurbsSet>{}</NurbsSet>", square("")));
    assert_eq!(set.scene.placement_count(), 0);
    let told = "line 2, NurbsPatchSurface: a surface of a NurbsSet that no Shape uses; it is not \
                shown";
    assert_eq!(messages(&set), [told]);
    let set = read_scene(&format!(
        "<NurbsSet>{}</NurbsSet><Shape><NurbsPatchSurface USE='A'/></Shape>",
        square("DEF='A'")
    ));
    assert_eq!(set.scene.placement_count(), 1);
    assert_eq!(messages(&set), Vec::<String>::new());
}

#[test]
fn curves_without_a_field_are_told_apart() {
    let section = "<NurbsCurve2D order='2' controlPoint='1 0 0 1'/>";
    let trajectory = "<NurbsCurve order='2'><Coordinate point='0 0 0 0 3 0'/></NurbsCurve>";
    for inside in [
        format!("{section}{trajectory}"),
        format!("{trajectory}{section}"),
    ] {
        let import = read_scene(&format!(
            "<Shape><NurbsSweptSurface>{inside}</NurbsSweptSurface></Shape>"
        ));
        let end = only_surface(&import).evaluate(DVec2::ONE);
        assert!((end.y - 3.0).abs() < 1e-15, "{end}");
        let told = "line 2, NurbsSweptSurface: its curves do not say which is crossSectionCurve \
                    and which trajectoryCurve";
        assert_eq!(messages(&import), [told]);
    }
    let alone = read_scene(&format!(
        "<Shape><NurbsSweptSurface>{section}{section}</NurbsSweptSurface></Shape>"
    ));
    assert_eq!(alone.scene.placement_count(), 0);
}

#[test]
fn layers_hide_their_children_one_by_one() {
    let shown = |version: &str, visible: &str| {
        let part = |x: i32| {
            format!(
                "<CADFace><Transform translation='{x} 0 0'><Shape><Box/></Shape></Transform></CADFace>"
            )
        };
        let text = format!(
            "<X3D version='{version}'><Scene><CADLayer visible='{visible}'>{}{}</CADLayer></Scene></X3D>",
            part(0),
            part(9)
        );
        let import = read_with(&Limits::default(), &text).unwrap();
        assert_eq!(messages(&import), Vec::<String>::new());
        import.scene.placement_count() / 6
    };
    assert_eq!(shown("3.3", ""), 2);
    assert_eq!(shown("3.3", "true false"), 1);
    assert_eq!(shown("3.3", "false"), 1);
    assert_eq!(shown("4.0", "false"), 0);
}

#[test]
fn meshes_without_triangles_are_left_out() {
    let import = read_scene(
        "<Shape><IndexedFaceSet coordIndex='0 1 2 -1'><Coordinate/></IndexedFaceSet></Shape>",
    );
    assert_eq!(import.scene.placement_count(), 0);
    let told = messages(&import);
    let text = "line 2, IndexedFaceSet: this IndexedFaceSet has no triangle; it is left out";
    assert!(told.contains(&text.to_owned()), "{told:?}");
}

#[test]
fn a_second_scene_is_told() {
    let one = "<X3D><Scene><Shape><Box/></Shape></Scene></X3D>";
    let import = read_with(&Limits::default(), &format!("{one}{one}")).unwrap();
    let text = "line 1, Scene: the file has a scene before it; it is not shown";
    assert_eq!(messages(&import), [text]);
}
