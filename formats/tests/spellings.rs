//! One scene in the four spellings of X3D and VRML 97 is one scene.

use std::path::Path;

use nurbray_formats::{Limits, open};

/// All of a scene but the places in the file, which differ.
fn without_places(scene: &kernel::Scene) -> String {
    let text = format!("{scene:?}");
    let mut parts = text.split("source: \"");
    let mut kept = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        kept += part.split_once('"').map_or(part, |(_, rest)| rest);
    }
    kept
}

#[test]
fn four_spellings_are_one_scene() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../samples");
    let scenes = ["x3d", "x3dv", "x3dj", "wrl"].map(|extension| {
        let import = open(
            folder.join("door").with_extension(extension),
            &Limits::default(),
        );
        let import = import.expect("a sample that can be read");
        assert_eq!(import.warnings.as_slice(), [], "{extension}");
        without_places(&import.scene)
    });
    assert!(scenes[0].len() > 10_000);
    for scene in &scenes[1..] {
        let differs = || {
            scene
                .bytes()
                .zip(scenes[0].bytes())
                .position(|(a, b)| a != b)
        };
        assert!(
            *scene == scenes[0],
            "{:?}",
            differs().map(|at| &scene[at.saturating_sub(200)..])
        );
    }
}
