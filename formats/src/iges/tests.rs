//! Whole files, from bytes to scene.

use glam::DVec3;
use kernel::Aabb;

use super::testing::{Made, corners, file, file_with, made, read, square};
use crate::{Error, Import, Limits, NoFiles, ReadOptions};

fn try_read(bytes: &[u8]) -> Result<Import, Error> {
    let limits = Limits::default();
    let resolver = &NoFiles;
    super::read(
        bytes,
        &ReadOptions {
            limits: &limits,
            resolver,
        },
    )
}

const NONE: [&str; 0] = [];

#[test]
fn a_named_coloured_surface() {
    let mut surface = square(2.0);
    surface.color = -5;
    surface.label = "LABEL";
    surface.parameters += ",0,1,3";
    let mut name = made(406, "1,10HThe Square");
    name.form = 15;
    let color = made(314, "100.,0.,50.,4Hrose");
    let (scene, warnings) = read(&[surface, name, color]);
    assert_eq!(warnings, NONE);
    let [patch] = scene.patches() else {
        panic!("{:?}", scene.patches())
    };
    assert_eq!(patch.name, "The Square");
    assert_eq!(patch.source, "surface D1 (type 128)");
    let material = scene.material(patch.material.unwrap());
    assert_eq!(material.name, "rose");
    assert!((material.diffuse - DVec3::new(1.0, 0.0, 0.214_041)).length() < 1e-6);
    assert_eq!(scene.unit.unwrap().name, "mm");
    assert_eq!(scene.up, kernel::UpAxis::Z);
}

#[test]
fn colours_are_shared_and_labels_are_names() {
    let mut surfaces = [square(0.0), square(1.0), square(2.0)];
    for (surface, color) in surfaces.iter_mut().zip([3, 3, 99]) {
        surface.color = color;
        surface.label = "A";
    }
    let (scene, warnings) = read(&surfaces);
    assert_eq!(scene.materials().len(), 1);
    assert_eq!(scene.materials()[0].diffuse, DVec3::Y);
    assert_eq!(scene.patches()[2].material, None);
    assert_eq!(scene.patches()[1].name, "A");
    assert_eq!(
        warnings,
        ["line 7, surface D5 (type 128): colour 99; there are colours 0 to 8"]
    );
}

#[test]
fn transformations_follow_each_other() {
    let mut surface = square(0.0);
    surface.transform = 3;
    let mut shift = made(124, "1.,0.,0.,10.,0.,1.,0.,0.,0.,0.,1.,0.");
    // An even pointer means the entry it is the second line of.
    shift.transform = 6;
    let mirror = made(124, "-1.,0.,0.,1.,0.,1.,0.,0.,0.,0.,1.,0.");
    let (scene, warnings) = read(&[surface, shift, mirror]);
    assert_eq!(corners(&scene), [DVec3::new(-9.0, 0.0, 0.0)]);
    assert_eq!(warnings, NONE);
}

#[test]
fn transformations_in_a_cycle_or_without_inverse_are_told() {
    let mut surface = square(0.0);
    surface.transform = 3;
    let mut first = made(124, "1.,0.,0.,10.,0.,1.,0.,0.,0.,0.,1.,0.");
    first.transform = 3;
    let flat = made(124, "0.;");
    let mut other = square(0.0);
    other.transform = 5;
    let (scene, warnings) = read(&[surface, first, flat, other, square(7.0)]);
    assert_eq!(corners(&scene), [DVec3::X * 7.0]);
    assert_eq!(
        warnings,
        [
            "line 3, surface D1 (type 128): transformations point to each other in a cycle",
            "line 9, surface D7 (type 128): the transformation is not invertible",
        ]
    );
}

#[test]
fn groups_show_their_members_once() {
    let mut member = square(1.0);
    member.status = "00020000";
    let group = || {
        let mut group = made(402, "2,1,3");
        group.form = 7;
        group.label = "G";
        group
    };
    let mut hidden = square(5.0);
    hidden.status = "01000000";
    let (scene, warnings) = read(&[member, hidden, group(), group()]);
    assert_eq!(corners(&scene), [DVec3::X]);
    assert_eq!(scene.nodes()[0].name, "G");
    assert_eq!(
        warnings,
        ["line 5, surface D3 (type 128): blanked entities are not shown"]
    );
}

#[test]
fn groups_do_not_repeat_what_bodies_show() {
    let made_of = |kind: i64, parameters: &str, status: &'static str| Made {
        form: if kind == 402 { 7 } else { 1 },
        status,
        ..made(kind, parameters)
    };
    let shell = made_of(514, "1,1,1", "00000000");
    let solid = made_of(186, "3,1,0", "00000000");
    let group = || made_of(402, "3,1,3,5", "00000000");
    let (scene, warnings) = read(&[square(1.0), shell, solid, group()]);
    assert_eq!(corners(&scene), [DVec3::X]);
    assert!(warnings.is_empty(), "{warnings:?}");
    // Bodies that are blanked show nothing.
    let shell = made_of(514, "1,1,1", "01000000");
    let solid = made_of(186, "3,1,0", "01000000");
    let (scene, _) = read(&[square(1.0), shell, solid, group()]);
    assert_eq!(corners(&scene), [DVec3::X]);
}

#[test]
fn what_is_blanked_is_shown_where_there_is_nothing_else() {
    let mut hidden = square(5.0);
    hidden.status = "01000000";
    let (scene, warnings) = read(&[hidden]);
    assert_eq!(corners(&scene), [DVec3::X * 5.0]);
    let text = "line 3, surface D1 (type 128): all that could be shown is blanked; it is shown";
    assert_eq!(warnings, [text]);
    // Neither curves nor groups are worth a picture without surfaces.
    let mut hidden = square(5.0);
    hidden.status = "01000000";
    let mut group = made(402, "1,1");
    group.form = 7;
    let (scene, warnings) = read(&[hidden, made(110, "0.,0.,0.,1.,0.,0."), group]);
    assert_eq!(corners(&scene), [DVec3::X * 5.0]);
    assert_eq!(scene.wires().len(), 1);
    assert_eq!(warnings, [text]);
}

#[test]
fn groups_that_contain_each_other_are_shown_and_told() {
    let mut groups = [made(402, "2,1,5"), made(402, "1,3")];
    for group in &mut groups {
        group.form = 7;
    }
    let [first, second] = groups;
    let (scene, warnings) = read(&[square(1.0), first, second]);
    assert_eq!(corners(&scene), [DVec3::X]);
    assert_eq!(
        warnings,
        ["line 5, group D3 (type 402): it contains itself"]
    );
}

#[test]
fn instances_share_their_definition() {
    let mut member = square(1.0);
    member.status = "00010000";
    let mut definition = made(308, "0,4Hpart,1,1");
    definition.status = "00000200";
    let mut third = made(408, "3,0.,0.,0.");
    third.color = 2;
    let (scene, warnings) = read(&[
        member,
        definition,
        made(408, "3,10.,0.,0.,2."),
        made(408, "3,0.,5.,0.,1."),
        third,
    ]);
    let expected = [[12.0, 0.0, 0.0], [1.0, 5.0, 0.0], [1.0, 0.0, 0.0]];
    assert_eq!(corners(&scene), expected.map(DVec3::from));
    assert_eq!(scene.patches().len(), 1);
    assert_eq!(scene.nodes()[0].name, "part");
    let materials: Vec<_> = scene.placements().iter().map(|p| p.material).collect();
    assert_eq!(materials[0], None);
    assert_eq!(scene.material(materials[2].unwrap()).name, "red");
    assert_eq!(warnings, NONE);
}

#[test]
fn arrays_repeat_their_base() {
    let mut definition = made(308, "0,4Hpart,1,1");
    definition.status = "00000200";
    let mut member = square(0.0);
    member.status = "00010000";
    // Two columns of three rows, twice as large, turned by a right angle, without the second place.
    let quarter = std::f64::consts::FRAC_PI_2;
    let (scene, warnings) = read(&[
        member,
        definition,
        made(412, &format!("3,2.,1.,2.,3.,2,3,10.,5.,{quarter},1,1,2")),
        made(414, &format!("3,4,10.,20.,30.,8.,0.,{quarter},2,0,1,3")),
    ]);
    assert_eq!(warnings, NONE);
    assert_eq!(scene.patches().len(), 1);
    let found = corners(&scene);
    let grid = [
        [0.0, 0.0],
        [-10.0, 0.0],
        [0.0, 10.0],
        [-5.0, 10.0],
        [-10.0, 10.0],
    ];
    let grid = grid.map(|[x, y]| DVec3::new(1.0 + x, 2.0 + y, 3.0));
    let circle = [[18.0, 20.0, 30.0], [2.0, 20.0, 30.0]].map(DVec3::from);
    let expected = [grid.as_slice(), &circle].concat();
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (found, expected) in found.iter().zip(expected) {
        assert!(found.distance(expected) < 1e-12, "{found} {expected}");
    }
    let far = scene.placements()[0]
        .world_from_object
        .transform_vector3(DVec3::X);
    assert!(far.distance(DVec3::X * 2.0) < 1e-12, "{far}");
}

#[test]
fn arrays_are_held_against_a_limit() {
    let error = |entities: &[Made]| try_read(file(entities).as_bytes()).unwrap_err().to_string();
    let none = error(&[square(0.0), made(414, "1,0,0.,0.,0.,1.,0.,1.,0,0")]);
    assert!(none.contains("an array of no copies"), "{none}");
    let many = "1,1.,0.,0.,0.,99999999,99999999,1.,1.,0.,0,0";
    let many = error(&[square(0.0), made(412, many)]);
    assert!(many.contains("more than 1000000 places"), "{many}");
}

#[test]
fn a_subfigure_that_contains_itself_is_cut() {
    let (scene, warnings) = read(&[
        square(1.0),
        made(308, "0,4Hself,2,1,5"),
        made(408, "3,1.,0.,0.,1."),
        made(408, "3,0.,0.,0.,1."),
    ]);
    assert_eq!(corners(&scene).len(), 1);
    assert_eq!(
        warnings,
        ["line 5, subfigure definition D3 (type 308): it contains itself"]
    );
}

#[test]
fn deep_nesting_ends() {
    let mut entities = vec![square(0.0)];
    for depth in 0..300 {
        let mut group = made(402, &format!("1,{}", 2 * depth + 1));
        group.form = 7;
        entities.push(group);
    }
    let error = try_read(file(&entities).as_bytes()).unwrap();
    assert!(error.scene.patches().is_empty());
    let text = error.warnings.as_slice()[0].to_string();
    assert!(text.ends_with("nested more than 200 deep"), "{text}");
}

#[test]
fn what_is_not_shown_is_counted() {
    let mut flat = made(106, "1,2,0.,0.,0.,1.,1.");
    flat.form = 11;
    let (scene, warnings) = read(&[
        made(110, "0.,0.,0.,1.,1.,1."),
        made(110, "0.,0.,0.,1.,1.,1."),
        made(120, "1,3,0.,1."),
        flat,
        made(212, "1"),
        made(404, "0"),
    ]);
    // The first line is the axis of the revolution.
    let sources: Vec<_> = scene.wires().iter().map(|w| w.source.as_str()).collect();
    assert_eq!(sources, ["copious data D7 (type 106)"]);
    assert_eq!(
        warnings,
        [
            "line 11, note D9 (type 212): annotation, properties and views are not shown: \
             1 of type 212, 1 of type 404",
        ]
    );
}

#[test]
fn the_model_scale_is_undone() {
    let text = file_with("1H,,1H;,,,,,,,,,,,0.5,6;", &[square(3.0)]);
    let import = try_read(text.as_bytes()).unwrap();
    assert_eq!(corners(&import.scene), [DVec3::X * 6.0]);
    assert_eq!(import.scene.unit.unwrap().name, "m");
    assert_eq!(import.warnings.as_slice().len(), 1);
}

#[test]
fn other_delimiters_are_obeyed() {
    let mut surface = square(3.0);
    surface.parameters = surface.parameters.replace(',', "|");
    let text = file_with("1H||1H/|||||||||||1.|2|2HMM/", &[surface]);
    let text = text.replace("128,1|", "128|1|").replace(';', "/");
    let import = try_read(text.as_bytes()).unwrap();
    assert_eq!(corners(&import.scene), [DVec3::X * 3.0]);
    assert_eq!(import.warnings.as_slice(), []);
}

#[test]
fn wrong_parameter_pointers_are_mended_by_owner() {
    let text = file(&[square(1.0), square(2.0)]);
    let lines: Vec<_> = text.lines().collect();
    let wrong = format!("     128{:>8}", 4000) + &lines[4][16..];
    let text = text.replace(lines[4], &wrong);
    let import = try_read(text.as_bytes()).unwrap();
    assert_eq!(corners(&import.scene), [DVec3::X, DVec3::X * 2.0]);
}

#[test]
fn records_without_end_do_not_run_on() {
    let text = file(&[square(1.0), square(2.0)]).replacen(';', " ", 3);
    let import = try_read(text.replacen("1H, 1H ", "1H,,1H;", 1).as_bytes()).unwrap();
    let size = |bounds: Aabb| bounds.size();
    let sizes = import
        .scene
        .patches()
        .iter()
        .map(|p| size(p.surface.hull_bounds()));
    assert_eq!(sizes.collect::<Vec<_>>(), [DVec3::new(1.0, 1.0, 0.0); 2]);
}

#[test]
fn files_without_surfaces_that_work_are_errors() {
    let error = |text: &str| try_read(text.as_bytes()).unwrap_err().to_string();
    assert_eq!(
        error(&file(&[made(
            128,
            "1000000000,1000000000,3,3,0,0,1,0,0,0."
        )])),
        "IGES line 3, surface D1 (type 128): 4000000010000000014 knots, weights and \
         coordinates are announced; the record is too short for them"
    );
    assert_eq!(
        error("version 1\noid 7\n"),
        "IGES the file: no entities: IGES files have a directory of them, with a D in column 73"
    );
    assert_eq!(
        error("B\0\0\0\x4b\x20\x40"),
        "IGES line 1: the binary form of IGES is not read; save the file in fixed form"
    );
    assert!(try_read(b"").is_err());
}

#[test]
fn levels_are_counted_and_named() {
    let mut shapes = [square(0.0), square(1.0), square(2.0), made(116, "1.,2.,3.")];
    for (shape, level) in shapes.iter_mut().zip([7, 0, -9, 7]) {
        shape.level = level;
    }
    let mut list = made(406, "2,4,7");
    list.form = 1;
    let mut name = made(406, "2,0,4HHull");
    (name.form, name.level) = (3, 7);
    let entities: Vec<_> = shapes.into_iter().chain([list, name]).collect();
    let import = try_read(file(&entities).as_bytes()).unwrap();
    assert!(
        import.warnings.as_slice().is_empty(),
        "{:?}",
        import.warnings
    );
    let levels = import
        .levels
        .iter()
        .map(|l| (l.number, l.name.as_str(), l.count));
    assert_eq!(
        levels.collect::<Vec<_>>(),
        [(0, "", 1), (4, "", 1), (7, "Hull", 3)]
    );
    assert!(
        try_read(file(&[square(0.0)]).as_bytes())
            .unwrap()
            .levels
            .is_empty()
    );
}

#[test]
fn shared_records_and_limits_are_bounded() {
    // Many entities with one record: each is read, until it is too much.
    let one = file(&[square(1.0)]);
    let lines: Vec<_> = one.lines().collect();
    let mut text = format!("{}\n{}\n", lines[0], lines[1]);
    for k in 0..100_000 {
        for line in 0..2 {
            text += &format!("{}D{:>7}\n", &lines[2 + line][..72], 2 * k + line + 1);
        }
    }
    let comment = format!("{:<64}{:>8}P", "comment", 1);
    for line in &lines[4..lines.len() - 1] {
        text += &format!("{line}\n");
    }
    for k in 0..1000 {
        text += &format!("{comment}{:>7}\n", k + 10);
    }
    let import = try_read(text.as_bytes()).unwrap();
    let told = import.warnings.as_slice().iter().map(ToString::to_string);
    let told: Vec<_> = told.collect();
    let text = "too many entities share the same parameters";
    assert!(told.iter().any(|told| told.contains(text)), "{told:?}");
    assert!(import.scene.patches().len() < 2000);

    let limits = Limits {
        points: 3,
        ..Limits::default()
    };
    let options = ReadOptions {
        limits: &limits,
        resolver: &NoFiles,
    };
    let error = super::read(file(&[square(1.0)]).as_bytes(), &options).unwrap_err();
    assert_eq!(
        error.to_string(),
        "IGES line 3, surface D1 (type 128): 4 control points; the limit leaves 3"
    );
}

/// The warnings about a broken sample, of which `count` surfaces are shown; or its error.
fn broken(name: &str, count: usize) -> Vec<String> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../samples/broken/");
    let bytes = std::fs::read(format!("{folder}iges_{name}.igs")).unwrap();
    match try_read(&bytes) {
        Ok(import) => {
            assert_eq!(import.scene.placements().len(), count, "{name}");
            let warnings = import.warnings.as_slice().iter();
            warnings.map(ToString::to_string).collect()
        }
        Err(error) => vec![error.to_string()],
    }
}

#[test]
fn broken_samples_are_told() {
    assert_eq!(
        broken("knots_decreasing", 1),
        [
            "line 7, surface D1 (type 128): u knots decrease by 1.0000000050247593e-8; they are \
             levelled",
            "line 9, surface D3 (type 128): knot 4 is 0.2 after 1; knots must not decrease",
        ]
    );
    assert_eq!(
        broken("weight_negative", 1),
        [
            "line 7, surface D1 (type 128): weight 1 is -0.3; weights must be positive, all are \
         set to 1"
        ]
    );
    assert_eq!(
        broken("cyclic_subfigure", 1),
        ["line 9, subfigure definition D3 (type 308): it contains itself"]
    );
    assert_eq!(
        broken("truncated", 1),
        [
            "line 14: a line without a section letter is skipped",
            "the file: the terminating line is missing; the file may be cut short",
            "line 8, surface D3 (type 128): the record ends before parameter 43; a number is \
             needed",
        ]
    );
    assert_eq!(
        broken("pointer_out_of_range", 1),
        [
            "line 7, trimmed surface D1 (type 144): the pointer to the surface is 9999999; the \
             directory has 2 entries",
            "line 9, surface D3 (type 128): the pointer to a colour is 777; the directory has \
             2 entries",
        ]
    );
    assert_eq!(
        broken("billion_counts", 0),
        [
            "IGES line 7, surface D1 (type 128): 4000000002000000008 knots, weights and \
         coordinates are announced; the record is too short for them"
        ]
    );
}
