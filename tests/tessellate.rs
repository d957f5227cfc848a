//! Every file of the corpus becomes triangles that keep to the tolerance.

use std::path::{Path, PathBuf};

use nurbray::formats::{self, Limits};
use nurbray::{TessellateOptions, tessellate};

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
    let filter = std::env::var("CORPUS").unwrap_or_default();
    files.retain(|f| f.to_string_lossy().contains(&filter));
    files
}

#[test]
fn no_file_strays_from_the_tolerance() {
    for file in corpus() {
        let Ok(import) = formats::open(&file, &Limits::default()) else {
            continue;
        };
        let start = std::time::Instant::now();
        let result = tessellate(&import.scene, &TessellateOptions::default());
        let faces = result.faces.iter().flatten();
        let count: usize = faces.clone().map(|f| f.mesh.triangles().len()).sum();
        let most =
            |get: &dyn Fn(&nurbray::FaceMesh) -> f64| faces.clone().map(get).fold(0.0, f64::max);
        let unproven: usize = faces.clone().map(|f| f.unproven).sum();
        let closed = result.shells.iter().filter(|s| s.is_closed()).count();
        let naked: usize = result.shells.iter().map(|s| s.naked).sum();
        let crowded: usize = result.shells.iter().map(|s| s.crowded).sum();
        let twisted: usize = result.shells.iter().map(|s| s.twisted).sum();
        if count == 0 {
            continue;
        }
        println!(
            "{}: {} faces {count} triangles {:.2} s, proven {:.3} sampled {:.3} gap {:.3}, unproven {unproven} crossings {}, shells {} closed {closed} naked {naked} crowded {crowded} twisted {twisted}",
            file.file_name().unwrap().to_string_lossy(),
            faces.clone().count(),
            start.elapsed().as_secs_f64(),
            most(&|f| f.proven / f.tolerance),
            most(&|f| f.sampled / f.tolerance),
            most(&|f| f.gap / f.tolerance),
            result.crossings,
            result.shells.len(),
        );
    }
}
