//! The OBJ reader on files from elsewhere, where they are at hand, and on our own samples.

use std::path::{Path, PathBuf};
use std::{fs, io};

use nurbray_formats::{Limits, NoFiles, OpenError, ReadOptions, open, read};

/// What a file must give: surfaces, triangles, and how many warnings of different kinds;
/// `None` where nothing useful is left.
type Expected = Option<[usize; 3]>;

const EXPECTED: &[(&str, Expected)] = &[
    ("iga_pipe_section.obj", Some([216, 0, 2])),
    ("iga_surface.obj", Some([1, 0, 0])),
    ("iga_temp.obj", Some([2, 0, 3])),
    ("iga_temp2.obj", Some([1, 0, 7])),
    ("k3d_nurbs.obj", Some([1, 0, 0])),
    ("made_gzipped_pipe_section.obj", Some([216, 0, 2])),
    ("made_trim_index_out_of_range.obj", Some([1, 0, 2])),
    ("made_truncated_no_end.obj", Some([1, 0, 3])),
    ("malformed_assimp_empty.obj", None),
    ("malformed_assimp_malformed.obj", Some([0, 8, 3])),
    ("malformed_oxideav_bmatrix_huge_deg.obj", None),
    ("malformed_oxideav_wrong_control_count.obj", None),
    ("oxideav_bmatrix_bump.obj", Some([1, 0, 1])),
    ("oxideav_bmatrix_two_patches.obj", Some([1, 0, 1])),
    ("oxideav_rat_bezier_two_patches.obj", Some([1, 0, 0])),
    ("poly_assimp_box_UTF16BE.obj", Some([0, 12, 1])),
    ("poly_assimp_concave_polygon.obj", Some([0, 64, 2])),
    ("poly_assimp_point_cloud.obj", Some([0, 0, 1])),
    ("poly_assimp_regr_3429812.obj", Some([0, 4, 2])),
    ("poly_assimp_testmixed.obj", Some([0, 12, 1])),
    ("poly_tinyobj_catmark_torus_creases0.obj", Some([0, 64, 2])),
    ("poly_tinyobj_cube-vertex-w-component.obj", Some([0, 12, 4])),
    ("poly_tinyobj_cube-vertexcol.obj", Some([0, 12, 4])),
    ("poly_tinyobj_issue-140-zero-face-idx.obj", Some([0, 1, 4])),
    ("poly_tinyobj_points-prim.obj", Some([0, 0, 3])),
    ("spec_b1_bezier_patch.obj", Some([1, 0, 0])),
    ("spec_b1_cardinal_curve.obj", Some([0, 0, 1])),
    ("spec_b1_connectivity.obj", Some([2, 0, 1])),
    ("spec_b1_ex1_taylor_curve.obj", Some([0, 0, 1])),
    ("spec_b1_ex2_bezier_curve.obj", Some([0, 0, 1])),
    ("spec_b1_ex3_bspline_surface_as_printed.obj", None),
    ("spec_b1_ex4_cardinal_surface.obj", Some([1, 0, 0])),
    ("spec_b1_ex5_rational_bspline_surface.obj", Some([1, 0, 0])),
    ("spec_b1_ex6_trimmed_nurb_as_printed.obj", Some([1, 0, 1])),
    ("spec_b1_ex7_two_regions_with_holes.obj", Some([1, 0, 0])),
    ("spec_b1_ex8_special_curve.obj", Some([1, 0, 0])),
    ("spec_b1_ex9_special_points.obj", Some([1, 0, 0])),
    ("spec_b1_merging_group.obj", Some([2, 0, 0])),
    ("spec_b1_poly_cube_negative_refs.obj", Some([0, 12, 0])),
    ("spec_b1_stech_surface_as_printed.obj", Some([1, 0, 1])),
    ("spec_b1_superseded_bzp.obj", Some([1, 0, 0])),
    ("spec_b1_superseded_cdc.obj", Some([0, 0, 1])),
];

fn folder(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn obj_files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let paths = fs::read_dir(folder)?.map(|entry| Ok(entry?.path()));
    let mut paths = paths.collect::<io::Result<Vec<_>>>()?;
    paths.retain(|path| path.extension().is_some_and(|e| e == "obj"));
    paths.sort();
    Ok(paths)
}

fn counts(path: &Path) -> (Expected, Vec<String>) {
    match open(path, &Limits::default()) {
        Ok(import) => {
            let warnings = import.warnings.as_slice();
            let meshes = import.scene.meshes().iter();
            let triangles = meshes.map(|mesh| mesh.triangles().len()).sum();
            let found = [import.scene.patches().len(), triangles, warnings.len()];
            (
                Some(found),
                warnings.iter().map(ToString::to_string).collect(),
            )
        }
        Err(OpenError::Format(error)) => {
            assert!(!error.to_string().contains('\n'));
            (None, vec![error.to_string()])
        }
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn files_from_elsewhere_give_what_they_hold() {
    let Ok(paths) = obj_files(&folder("../../shared/corpus/obj")) else {
        println!("the files are not here");
        return;
    };
    println!("{:45} surfaces triangles warnings", "file");
    let mut wrong = Vec::new();
    for path in paths {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let (found, messages) = counts(&path);
        match found {
            Some([surfaces, triangles, warnings]) => {
                println!("{name:45} {surfaces:8} {triangles:9} {warnings:8}");
            }
            None => println!("{name:45} error"),
        }
        for message in messages.iter().take(4) {
            println!("    {message}");
        }
        let expected = EXPECTED.iter().find(|row| row.0 == name);
        if expected.is_none_or(|row| row.1 != found) {
            wrong.push((name, found));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// What is said about the malformed files: all of it, one line each.
const DIAGNOSES: &[(&str, &[&str])] = &[
    (
        "made_trim_index_out_of_range.obj",
        &[
            "line 48, hole: reference 44 to trim curves, of which there are 4 at this line",
            "line 42, surf 1: the surface is shown untrimmed",
        ],
    ),
    (
        "made_truncated_no_end.obj",
        &[
            "line 42, surf 1: no \"end\" follows; taken as ended before the next statement",
            "line 46, hole: 1 words; each part of a loop takes three: start, end and curve",
            "line 42, surf 1: the surface is shown untrimmed",
        ],
    ),
    ("malformed_assimp_empty.obj", &["the file: it is empty"]),
    (
        "malformed_assimp_malformed.obj",
        &[
            "line 23, f: reference 12 to vertices, of which there are 8 at this line",
            "line 28, f: reference 0 to vertices; the first one is 1",
            "line 24, usemtl: material \"Default\" is not defined",
        ],
    ),
    (
        "malformed_oxideav_bmatrix_huge_deg.obj",
        &["OBJ line 4, deg: degree 4294967295; degrees go from 1 to 30"],
    ),
    (
        "malformed_oxideav_wrong_control_count.obj",
        &[
            "OBJ line 7, surf 1: 4 control points; parm u asks for 3 and parm v for 2, which \
             makes 6",
        ],
    ),
];

#[test]
fn malformed_files_are_diagnosed_by_line() {
    let place = folder("../../shared/corpus/obj");
    for (name, expected) in DIAGNOSES {
        let path = place.join(name);
        if !path.is_file() {
            println!("{name} is not here");
            continue;
        }
        let (_, messages) = counts(&path);
        assert!(messages.iter().all(|text| !text.contains('\n')), "{name}");
        assert_eq!(messages, *expected, "{name}");
    }
}

#[test]
fn the_teapot_is_whole() {
    let import = open(folder("../samples/teapot.obj"), &Limits::default()).unwrap();
    let scene = &import.scene;
    assert!(import.warnings.as_slice().is_empty());
    assert_eq!(scene.patches().len(), 32);
    let nodes = scene.nodes().iter();
    let groups: Vec<_> = nodes.map(|n| (n.name.as_str(), n.children.len())).collect();
    let parts = [
        ("rim", 4),
        ("body", 8),
        ("handle", 4),
        ("spout", 4),
        ("lid", 8),
        ("bottom", 4),
    ];
    assert_eq!(groups[..6], parts);
    let bounds = scene.hull_bounds();
    assert_eq!((bounds.min.y, bounds.max.y), (0.0, 3.15));
    let material = scene.material(scene.patches()[31].material.unwrap());
    assert_eq!(material.name, "porcelain");
}

#[test]
fn cut_short_nothing_panics() {
    let options = ReadOptions {
        limits: &Limits::default(),
        resolver: &NoFiles,
    };
    for place in ["../samples", "../samples/broken"] {
        for path in obj_files(&folder(place)).unwrap() {
            let bytes = fs::read(path).unwrap();
            for length in (0..bytes.len()).step_by((bytes.len() / 100).max(1)) {
                let _ = read(&bytes[..length], Some("obj"), &options);
            }
        }
    }
}
