//! The reader as a whole, on small texts.

use glam::{DVec2, DVec3};
use kernel::{Child, Shape};

use super::{read, sniff};
use crate::{Error, Import, Limits, NoFiles, ReadOptions, Resolver};

pub(super) fn parse(text: &str) -> Result<Import, Error> {
    let options = ReadOptions {
        limits: &Limits::default(),
        resolver: &NoFiles,
    };
    read(text.as_bytes(), &options)
}

pub(super) fn messages(import: &Import) -> Vec<String> {
    let warnings = import.warnings.as_slice();
    warnings.iter().map(ToString::to_string).collect()
}

/// The message of a text without anything useful.
fn error(text: &str) -> String {
    parse(text).unwrap_err().to_string()
}

pub(super) const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\n";
pub(super) const SADDLE: &str =
    "cstype bezier\ndeg 1 1\nsurf 0 1 0 1 1 2 3 4\nparm u 0 1\nparm v 0 1\n";

#[test]
fn u_runs_fastest_and_the_front_is_su_cross_sv() {
    let import = parse(&format!("{SQUARE}{SADDLE}end\n")).unwrap();
    assert_eq!(messages(&import), [""; 0]);
    let patch = &import.scene.patches()[0];
    let at = |u, v| patch.surface.evaluate(DVec2::new(u, v));
    assert_eq!(at(1.0, 0.0), DVec3::X);
    assert_eq!(at(0.25, 0.5), DVec3::new(0.25, 0.5, 0.125));
    let normal = patch.surface.normal(DVec2::ZERO).unwrap();
    assert_eq!(normal, DVec3::Z);
    assert_eq!(patch.source, "line 7, surf 1");
}

#[test]
fn weights_stand_beside_cartesian_points() {
    let w = std::f64::consts::FRAC_1_SQRT_2;
    let text = format!(
        "v 1 0 0\nv 1 1 0 {w:?}\nv 0 1 0\nv 1 0 2\nv 1 1 2 {w:?}\nv 0 1 2\n\
         cstype rat bspline\ndeg 2 1\nsurf 0 1 0 1 -6 -5 -4 -3 -2 -1\n\
         parm u 0 0 0 1 1 1\nparm v 0 0 1 1\nend\n"
    );
    let import = parse(&text).unwrap();
    let cylinder = &import.scene.patches()[0].surface;
    for i in 0..=20 {
        let p = cylinder.evaluate(DVec2::new(f64::from(i) / 20.0, 0.5));
        assert!((p.truncate().length() - 1.0).abs() < 1e-15, "{p}");
        assert!((p.z - 1.0).abs() < 1e-15);
    }
    // Some write the words in the other order; what is no word of it is told.
    for (words, told) in [
        ("bspline rat", vec![]),
        (
            "rat bspline nurbs",
            vec![
                "line 7, cstype: \"nurbs\" after bspline is passed over; only rat may stand beside a basis",
            ],
        ),
    ] {
        let other = parse(&text.replace("rat bspline", words)).unwrap();
        assert_eq!(&other.scene.patches()[0].surface, cylinder, "{words}");
        assert_eq!(messages(&other), told);
    }
    // The same text without `rat` ignores the weights: a parabola.
    let import = parse(&text.replace("rat ", "")).unwrap();
    let p = import.scene.patches()[0]
        .surface
        .evaluate(DVec2::splat(0.5));
    assert_eq!(p, DVec3::new(0.75, 0.75, 1.0));
}

#[test]
fn several_bezier_pieces_and_continued_lines_are_one_surface() {
    let text = "v 0 0 0\nv 1 2 0\nv 2 0 0\nv 0 0 1\nv 1 2 1\nv 2 0 1\ncstype bezier\ndeg 1 1\n\
                surf 0 3 0 1 1 2 \\\n 3 4 5 \\  \n6\nparm u 0 1 3\nparm v 0 1\nend";
    let import = parse(text).unwrap();
    assert_eq!(messages(&import), [""; 0]);
    let surface = &import.scene.patches()[0].surface;
    assert_eq!(surface.knots_u().as_slice(), [0., 0., 1., 3., 3.]);
    assert_eq!(
        surface.evaluate(DVec2::new(2.0, 0.0)),
        DVec3::new(1.5, 1.0, 0.0)
    );
}

#[test]
fn the_range_of_surf_cuts_the_surface() {
    let text = SADDLE.replace("surf 0 1 0 1", "surf 0.5 1 0.25 0.5");
    let import = parse(&format!("{SQUARE}{text}end\n")).unwrap();
    let surface = &import.scene.patches()[0].surface;
    assert_eq!(surface.knots_u().domain(), 0.5..1.0);
    assert_eq!(surface.knots_v().domain(), 0.25..0.5);
    let p = surface.evaluate(DVec2::new(0.75, 0.375));
    assert!(p.distance(DVec3::new(0.75, 0.375, 0.28125)) < 1e-15);
    // An empty range, as some exporters write, means all.
    let text = SADDLE.replace("surf 0 1 0 1", "surf 0 0 0 0");
    let import = parse(&format!("{SQUARE}{text}end\n")).unwrap();
    let surface = &import.scene.patches()[0].surface;
    assert_eq!(surface.knots_u().domain(), 0.0..1.0);
    assert_eq!(
        messages(&import)[0],
        "line 7, surf 1: the range 0 to 0 along u is not in the domain 0 to 1; 0 to 1 is shown"
    );
}

#[test]
fn knots_that_span_nothing_become_uniform() {
    let text = "cstype bspline\ndeg 1 1\nsurf -1 1 0 1 1 2 3 4\n\
                parm u -1 -1 -1 -1\nparm v 0 0 1 1\nend\n";
    let import = parse(&format!("{SQUARE}{text}")).unwrap();
    let surface = &import.scene.patches()[0].surface;
    assert_eq!(surface.knots_u().as_slice(), [-1., -1., 1., 1.]);
    assert_eq!(
        messages(&import),
        [
            "line 7, surf 1: the knots along u span nothing, from -1 to -1; equal steps from -1 to \
          1 are taken"
        ]
    );
}

#[test]
fn taylor_and_matrix_surfaces_are_exact() {
    // S = (u, v, u v) from coefficients 1, u, v, uv; the same by a matrix of the identity.
    let coefficients = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
    let taylor = "cstype taylor\ndeg 1 1\nsurf 0 2 0 1 1 2 3 4\nparm u 0 2\nparm v 0 1\nend\n";
    let matrix = "cstype bmatrix\nstep 1 1\nbmat u 1 0 0 1\nbmat v 1 0 0 1\ndeg 1 1\n\
                  surf 0 2 0 1 1 2 3 4\nparm u 0 2\nparm v 0 1\nend\n";
    for text in [taylor, matrix] {
        let import = parse(&format!("{coefficients}{text}")).unwrap();
        let surface = &import.scene.patches()[0].surface;
        let p = surface.evaluate(DVec2::new(1.0, 0.25));
        assert_eq!(p, DVec3::new(0.5, 0.25, 0.125));
    }
}

#[test]
fn superseded_patches_are_cubics_from_the_last_row_up() {
    let points: String = (0..16)
        .map(|i| format!("v {} {} {}\n", i % 4, 3 - i / 4, (i % 4) * (i % 4)))
        .collect();
    let references = (1..=16)
        .map(|i| i.to_string())
        .collect::<Vec<_>>()
        .join(" ");
    let point = |keyword: &str| {
        let import = parse(&format!("{points}{keyword} {references}\n")).unwrap();
        import.scene.patches()[0]
            .surface
            .evaluate(DVec2::new(0.5, 0.0))
    };
    // Uniform B-spline at the middle of its span: weights 1/48, 23/48, 23/48, 1/48.
    assert!(point("bsp").distance(DVec3::new(1.5, 1.0, 2.583_333_333_333_333_5)) < 1e-14);
    assert_eq!(point("bzp"), DVec3::new(1.5, 0.0, 3.0));
    // Cardinal at the middle: weights -1/16, 9/16, 9/16, -1/16.
    assert!(point("cdp").distance(DVec3::new(1.5, 1.0, 2.25)) < 1e-14);
}

#[test]
fn groups_become_nodes_in_the_order_of_the_file() {
    let patch = &SADDLE[22..];
    let text = format!(
        "{SQUARE}cstype bezier\ndeg 1 1\n{patch}end\ng lid knob\n{patch}end\no body\nf 1 2 3\n\
         {patch}end\ng lid knob\nf 1 2 3\n"
    );
    let import = parse(&text).unwrap();
    let scene = &import.scene;
    let root = scene.node(scene.root().unwrap());
    assert!(matches!(root.children[0], Child::Item(_)));
    let groups = root.children[1..].iter().map(|child| match child {
        Child::Node(id) => (
            scene.node(*id).name.as_str(),
            scene.node(*id).children.len(),
        ),
        Child::Item(_) => ("item", 0),
    });
    assert_eq!(groups.collect::<Vec<_>>(), [("lid knob", 2), ("body", 2)]);
    assert_eq!(scene.patches()[1].name, "lid knob");
    let first = scene.placements()[1].shape;
    assert!(matches!(first, Shape::Patch(_)));
}

#[test]
fn polygons_keep_normals_and_lose_only_what_is_wrong() {
    let text = "v 0 0 0 0.1\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv x\nvn 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\n\
                f 1/1/1 2/2/1 3/3/1\nf 1//1 2//1 3//9\nf 1 2 0\nf 1 2 5\nf 1 2\nf -5 -4 -3 -2\n";
    let import = parse(text).unwrap();
    let meshes = import.scene.meshes();
    assert_eq!(meshes.len(), 2);
    let count: usize = meshes.iter().map(|m| m.triangles().len()).sum();
    assert_eq!(count, 1 + 1 + 2);
    let full = meshes.iter().find(|m| !m.normals().is_empty()).unwrap();
    assert_eq!(full.normals(), [DVec3::Z; 3]);
    assert_eq!(full.uvs()[2], DVec2::ONE);
    assert_eq!(full.positions()[1], DVec3::new(2.0, 0.0, 0.0));
    assert_eq!(
        messages(&import),
        [
            "line 5, v: \"x\" is not a finite number",
            "line 11, f: the normal is missing or unusable; the face goes without",
            "line 12, f: reference 0 to vertices; the first one is 1",
            "line 13, f: vertex 5 could not be read",
            "line 14, f: 2 corners; a face needs at least 3",
        ]
    );
}

struct OneFile;

impl Resolver for OneFile {
    fn resolve(&self, name: &str) -> std::io::Result<Vec<u8>> {
        match name {
            "my file.mtl" => Ok(b"newmtl red\nKd 1 0 0\nnewmtl unused\nKd 0 0 1\n".to_vec()),
            _ => Err(std::io::ErrorKind::NotFound.into()),
        }
    }
}

#[test]
fn names_of_materials_may_have_comments_behind_them() {
    let options = ReadOptions {
        limits: &Limits::default(),
        resolver: &OneFile,
    };
    let text = format!(
        "mtllib my file.mtl # its colours\n{SQUARE}usemtl red # see through\nf 1 2 3\nusemtl red\nf 1 2 4\n"
    );
    let import = read(text.as_bytes(), &options).unwrap();
    assert_eq!(messages(&import), [""; 0]);
    for mesh in import.scene.meshes() {
        assert_eq!(
            import.scene.material(mesh.material.unwrap()).diffuse,
            DVec3::X
        );
    }
}

#[test]
fn materials_go_with_surfaces_and_polygons() {
    let options = ReadOptions {
        limits: &Limits::default(),
        resolver: &OneFile,
    };
    let text = format!(
        "mtllib C:\\work\\my file.mtl\nmtllib none.mtl\n{SQUARE}usemtl red\n{SADDLE}end\nf 1 2 3\n\
         usemtl blue\nf 1 2 4\n"
    );
    let import = read(text.as_bytes(), &options).unwrap();
    let scene = &import.scene;
    assert_eq!(scene.materials().len(), 1);
    let red = scene.patches()[0].material.unwrap();
    assert_eq!(scene.material(red).diffuse, DVec3::X);
    assert_eq!(scene.meshes()[0].material, Some(red));
    assert_eq!(scene.meshes()[1].material, None);
    let found = messages(&import);
    assert!(found[0].starts_with("line 2, mtllib: material file \"none.mtl\" is not there"));
    assert_eq!(
        found[1],
        "line 16, usemtl: material \"blue\" is not defined"
    );
}

#[test]
fn trims_become_loops() {
    let curves = "vp 0.25 0.25\nvp 0.75 0.25\nvp 0.5 0.75\ncstype bezier\ndeg 1\n\
                  curv2 1 2 3 1\nparm u 0 1 2 3\nend\n";
    let patch = |loops: &str| {
        let import = parse(&format!("{SQUARE}{curves}{SADDLE}{loops}end\n")).unwrap();
        let loops = import.scene.patches()[0].loops.clone();
        (loops, messages(&import))
    };
    let (loops, found) = patch("trim 0 3 1\n");
    assert_eq!(loops.len(), 1);
    assert_eq!(loops[0].segments()[0].start(), DVec2::splat(0.25));
    assert!(found.is_empty(), "{found:?}");
    // The border surrounds a hole that no trim does.
    let (loops, _) = patch("hole 1 3 1 0 1 1\n");
    assert_eq!((loops.len(), loops[1].segments().len()), (2, 2));
    assert_eq!(loops[1].segments()[0].start(), DVec2::new(0.75, 0.25));
    let (loops, _) = patch("trim 3 0 1\n");
    assert_eq!(loops[0].segments()[0].evaluate(0.5), DVec2::new(0.375, 0.5));
    for (bad, message) in [
        (
            "trim 0 3 2\n",
            "reference 2 to trim curves, of which there are 1 at this line",
        ),
        (
            "trim 0 4 1\n",
            "parameters 0 to 4 of trim curve 1, which goes from 0 to 3",
        ),
        ("trim 0 2 1\n", "trim curve 0 ends 5.59"),
        (
            "trim 0 3\n",
            "2 words; each part of a loop takes three: start, end and curve",
        ),
    ] {
        let (loops, found) = patch(bad);
        assert!(loops.is_empty());
        assert!(
            found[0].starts_with(&format!("line 18, trim: {message}")),
            "{found:?}"
        );
        assert_eq!(found[1], "line 15, surf 1: the surface is shown untrimmed");
    }
}

#[test]
fn equal_loops_count_once() {
    let curves = "vp 0.25 0.25\nvp 0.75 0.25\nvp 0.5 0.75\ncstype bezier\ndeg 1\n\
                  curv2 1 2 3 1\nparm u 0 1 2 3\nend\ncurv2 2 3 1 2\nparm u 0 1 2 3\nend\n";
    let text = format!("{SQUARE}{curves}{SADDLE}trim 0 3 1\nhole 3 0 2\nend\n");
    let import = parse(&text).unwrap();
    assert_eq!(import.scene.patches()[0].loops.len(), 1);
    assert_eq!(
        messages(&import),
        ["line 18, surf 1: two trim loops are the same; they count once"]
    );
}

#[test]
fn a_loop_that_leaves_the_surface_is_cut_off() {
    let text = format!(
        "{SQUARE}vp 0 0\nvp 2 0\nvp 2 2\ncstype bezier\ndeg 1\ncurv2 1 2 3 1\n\
         parm u 0 1 2 3\nend\n{SADDLE}trim 0 3 1\nend\n"
    );
    let import = parse(&text).unwrap();
    let region = import.scene.patches()[0].region().unwrap();
    assert!(region.contains(DVec2::new(0.6, 0.4)) && !region.contains(DVec2::new(0.4, 0.6)));
    assert_eq!(
        messages(&import),
        ["line 18, trim: the loop leaves the surface; what lies outside is cut off"]
    );
}

#[test]
fn loops_that_lie_outside_cut_nothing_off() {
    let text = format!(
        "{SQUARE}vp 2 2\nvp 3 2\nvp 2 4\ncstype bezier\ndeg 1\ncurv2 1 2 3 1\n\
         parm u 0 1 2 3\nend\n{SADDLE}trim 0 3 1\nend\n"
    );
    let import = parse(&text).unwrap();
    assert!(import.scene.patches()[0].loops.is_empty());
    let place = "line 15, surf 1:";
    let outside = "its trim loops, from (2, 2) to (3, 4), lie outside its domain, which goes from \
                   (0, 0) to (1, 1)";
    assert_eq!(
        messages(&import),
        [
            format!("{place} {outside}"),
            format!("{place} the surface is shown untrimmed")
        ]
    );
}

#[test]
fn a_missing_end_is_tolerated() {
    let import = parse(&format!("{SQUARE}{SADDLE}{SADDLE}")).unwrap();
    assert_eq!(import.scene.patches().len(), 2);
    let found = messages(&import);
    let text = "no \"end\" follows; taken as ended before the next statement";
    assert_eq!(found, [format!("line 7, surf 1: {text} (and 1 more)")]);
}

#[test]
fn state_and_lists_go_past_an_open_element() {
    let (first, body) = SADDLE.split_at(SADDLE.find("parm").unwrap());
    let text = format!("{SQUARE}g in\n{first}g out\nv 9 9 9\n{body}end\n{SADDLE}end\n");
    let import = parse(&text).unwrap();
    let text = "a statement before the \"end\" of an element; taken for what follows it";
    assert_eq!(messages(&import), [format!("line 9, g: {text}")]);
    let names = import.scene.patches().iter().map(|p| p.name.as_str());
    assert_eq!(names.collect::<Vec<_>>(), ["in", "out"]);
}

#[test]
fn without_parm_pieces_have_equal_steps() {
    let bare = SADDLE.replace("parm u 0 1", "").replace("parm v 0 1", "");
    for (text, told) in [
        (
            bare.clone(),
            "parm u is missing; equal steps from 0 to 1 are taken",
        ),
        (
            SADDLE.replace("parm v 0 1", ""),
            "parm v is missing; equal steps from 0 to 1 are taken",
        ),
    ] {
        let import = parse(&format!("{SQUARE}{text}end\n")).unwrap();
        let found = messages(&import);
        assert_eq!(found[0], format!("line 7, surf 1: {told}"));
        let whole = parse(&format!("{SQUARE}{SADDLE}end\n")).unwrap();
        assert_eq!(
            import.scene.patches()[0].surface,
            whole.scene.patches()[0].surface
        );
    }
    // Two pieces of a curve, and a surface without points for one.
    let curve = "cstype bezier\ndeg 2\ncurv 1 5 1 2 3 4 1\nend\n";
    let import = parse(&format!("{SQUARE}{curve}")).unwrap();
    let found = messages(&import);
    assert_eq!(
        found[0],
        "line 7, curv 1: parm u is missing; equal steps from 1 to 5 are taken"
    );
    let few = bare.replace("1 2 3 4", "1 2 3");
    let told = error(&format!("{SQUARE}{few}end\n"));
    assert!(
        told.contains("parm u asks for 2 and parm v for 2"),
        "{told}"
    );
}

#[test]
fn b_splines_without_knots_or_a_degree_are_clamped() {
    let whole = "cstype bspline\ndeg 1 1\nsurf 2 4 0 1 1 2 3 4\nparm u 2 2 4 4\n\
                 parm v 0 0 1 1\nend\n";
    let expected = parse(&format!("{SQUARE}{whole}")).unwrap();
    let [steps, outer] = [
        "is missing; equal steps from",
        "two knots along u are missing; the first and the last are repeated",
    ];
    for (from, to, told) in [
        ("parm u 2 2 4 4\n", "", steps),
        ("parm v 0 0 1 1\n", "", steps),
        ("parm u 2 2 4 4\nparm v 0 0 1 1\n", "", steps),
        (
            "parm u 2 2 4 4\nparm v 0 0 1 1\n",
            "parm u 2 4\nparm v 0 1\n",
            outer,
        ),
        (
            "deg 1 1",
            "deg 1",
            "deg has one number; it is taken for both directions",
        ),
    ] {
        let import = parse(&format!("{SQUARE}{}", whole.replace(from, to))).unwrap();
        assert_eq!(import.scene.patches(), expected.scene.patches(), "{to}");
        let found = messages(&import);
        assert!(found[0].starts_with("line 7, surf 1: "), "{found:?}");
        assert!(found[0].contains(told), "{found:?}");
    }
    let curve = "cstype bspline\ndeg 2\ncurv 0 1 1 2 3 4\nparm u 0 0 .5 1 1\nend\n";
    let import = parse(&format!("{SQUARE}{curve}")).unwrap();
    assert_eq!(import.scene.wires().len(), 1, "{:?}", messages(&import));
}

#[test]
fn nothing_left_is_an_error_with_its_line() {
    let with = |from: &str, to: &str| error(&format!("{SQUARE}{}end\n", SADDLE.replace(from, to)));
    let cases = [
        (
            with("parm u 0 1", "parm u 0 1 2"),
            "line 7, surf 1: 4 control points; parm u asks for 3 and parm v for 2, which makes 6",
        ),
        (
            with("1 2 3 4", "1 2 3 5"),
            "line 7, surf 1: reference 5 to vertices, of which there are 4 at this line",
        ),
        (
            with("1 2 3 4", "1 2 0 4"),
            "line 7, surf 1: reference 0 to vertices; the first one is 1",
        ),
        (
            with("parm u 0 1", "parm u 1 0"),
            "line 7, surf 1: parm u: value 2 is 0 after 1; the values must increase",
        ),
        (
            with("deg 1 1", "deg 31 1"),
            "line 6, deg: degree 31; degrees go from 1 to 30",
        ),
        (
            with("deg 1 1", "deg 4294967295 -1"),
            "line 6, deg: \"-1\" is not a whole number",
        ),
        (
            with("bezier", "nurbs"),
            "line 5, cstype: \"nurbs\" is none of bmatrix, bezier, bspline, cardinal, taylor",
        ),
        (
            with("surf 0 1 0 1", "surf 0 1 0"),
            "line 7, surf 1: 3 control points; parm u asks",
        ),
        (
            error(""),
            "the file: no surfaces, no polygons, no curves and no points",
        ),
        (
            error("call other.obj\n"),
            "line 1, call: other files are never read in place of a line",
        ),
        (error("csh -rm x\n"), "line 1, csh: programs are never run"),
        (
            error("hello\n"),
            "line 1, hello: \"hello\" is not a statement of OBJ",
        ),
        (
            error("v 0 0 0\nf 1 1 2"),
            "line 2, f: reference 2 to vertices",
        ),
    ];
    for (found, expected) in cases {
        assert!(found.starts_with(&format!("OBJ {expected}")), "{found}");
    }
}

#[test]
fn limits_hold() {
    let limits = Limits {
        points: 3,
        ..Limits::default()
    };
    let options = ReadOptions {
        limits: &limits,
        resolver: &NoFiles,
    };
    let error = read(SQUARE.as_bytes(), &options).unwrap_err();
    assert_eq!(error.to_string(), "OBJ line 4: more than 3 points");
}

#[test]
fn only_obj_is_taken_for_obj() {
    for obj in [
        "v 0 0 0\n",
        "# by hand\ng a\nv 1 2 3 4 \\\n",
        "mtllib a.mtl\n",
        "cstype rat bezier",
    ] {
        assert!(sniff(obj.as_bytes()), "{obj}");
    }
    let iges = format!("{:72}S      1\n{:72}G      1\n", "v 0 0 0", "1H,,1H;");
    for other in [
        "",
        "#VRML V2.0 utf8\nv 0 0 0\n",
        "#X3D V3.0 utf8\n",
        "<?xml version=\"1.0\"?>\n<X3D/>",
        "ISO-10303-21;\nHEADER;",
        "{ \"v\": 0 }",
        "ply\nv 0 0 0",
        "g a\no b\n",
        "v 0 0 zero\n",
        &iges,
    ] {
        assert!(!sniff(other.as_bytes()), "{other}");
    }
}
