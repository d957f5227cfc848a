//! Every file of the corpus becomes triangles that keep to the tolerance.

use std::path::{Path, PathBuf};

use nurbray::formats::{self, Limits};
use nurbray::{TessellateOptions, measure, tessellate};

/// The files of the corpus that are read, if it is at hand.
fn corpus() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/corpus");
    let mut files = Vec::new();
    for folder in ["iges", "obj", "vrml", "x3d"] {
        let Ok(entries) = std::fs::read_dir(root.join(folder)) else {
            continue;
        };
        files.extend(entries.filter_map(|e| e.ok().map(|e| e.path())));
    }
    files.retain(|f| f.is_file());
    files.sort();
    files
}

#[test]
#[ignore = "a few minutes: make soak"]
fn no_face_strays_from_the_tolerance() {
    for file in corpus() {
        let Ok(import) = formats::open(&file, &Limits::default()) else {
            continue;
        };
        let result = tessellate(&import.scene, &TessellateOptions::default()).expect("few points");
        for face in result.faces.iter().flatten() {
            let name = file.display();
            let source = &face.mesh.source;
            let (sampled, tolerance) = (face.sampled, face.tolerance);
            assert!(
                sampled <= tolerance,
                "{name}: {source}: {sampled:e} of {tolerance:e}"
            );
            assert!(
                face.proven <= tolerance || face.unproven > 0,
                "{name}: {source}"
            );
        }
    }
}

#[test]
fn trimmed_faces_keep_their_area() {
    for file in corpus() {
        let kind = file.extension().and_then(|kind| kind.to_str());
        if !matches!(kind, Some("obj" | "wrl" | "x3d" | "x3dv")) {
            continue;
        }
        let Ok(import) = formats::open(&file, &Limits::default()) else {
            continue;
        };
        if import.scene.patches().iter().all(|p| p.loops.is_empty()) {
            continue;
        }
        let exact = measure(&import.scene).area;
        let result = tessellate(&import.scene, &TessellateOptions::default()).expect("few points");
        let area: f64 = result.shells.iter().map(|shell| shell.area).sum();
        let off = (area - exact).abs();
        assert!(off <= 0.01 * exact, "{}: {area} of {exact}", file.display());
    }
}

#[test]
fn bodies_with_faults_are_closed() {
    // A pole that is not one point, holes too small to see, ends without a normal, boundaries that run back over
    // themselves, and edges farther from their faces than counts.
    let expected = [
        ("made_truncated.wrl", 1),
        ("gmsh_SampleCrankshaft4A.stp", 1),
        ("dune_laufmess.wrl", 31),
        ("dune_Untitled.wrl", 2),
        ("FourDucks.x3dv", 1),
        ("castle_nurbs_dune_primitives.x3dv", 4),
        ("cmp_analytic_sphere_surface.igs", 1),
    ];
    for file in corpus() {
        let name = file.file_name().and_then(|name| name.to_str());
        let Some((_, count)) = expected.iter().find(|(known, _)| Some(*known) == name) else {
            continue;
        };
        let Ok(import) = formats::open(&file, &Limits::default()) else {
            panic!("{} is not read", file.display());
        };
        let result = tessellate(&import.scene, &TessellateOptions::default()).expect("few points");
        let closed = result.shells.iter().filter(|shell| shell.is_closed());
        assert_eq!(closed.count(), *count, "{}", file.display());
    }
}

#[test]
fn shells_of_voids_look_into_them() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let import = formats::open(root.join("samples/hollow.igs"), &Limits::default()).unwrap();
    let result = tessellate(&import.scene, &TessellateOptions::default()).expect("few points");
    let mut volumes: Vec<_> = result.shells.iter().map(|shell| shell.volume).collect();
    volumes.sort_by(f64::total_cmp);
    assert!(result.shells.iter().all(|shell| shell.is_closed()));
    assert!(volumes.len() == 2 && (volumes[0] + 2.0).abs() < 1e-12);
    assert!((volumes[1] - 24.0).abs() < 1e-12);
    // What is written encloses what is left.
    let enclosed: f64 = result
        .faces
        .iter()
        .flatten()
        .flat_map(|face| {
            let at = |k: u32| face.mesh.positions()[k as usize];
            let volume = move |t: &[u32; 3]| at(t[0]).dot(at(t[1]).cross(at(t[2]))) / 6.0;
            face.mesh.triangles().iter().map(volume)
        })
        .sum();
    assert!((enclosed - 22.0).abs() < 1e-12, "{enclosed}");
}
