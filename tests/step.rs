//! STEP: a sample by its closed forms, and real files, if they are there, against what another
//! program finds in them.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "helpers of tests are tests, too"
)]

use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use glam::DVec3;
use nurbray::formats::{Import, Limits, open};
use nurbray::measure;
use serde_json::Value;

/// Files of which the other program makes something else of the one face that counts: it measures
/// one inside out, keeps a whole torus, keeps one of two rings that a loop is made of, or takes a
/// line beside its cylinder for one on it.
const OTHERS: [&str; 4] = [
    "brepnet_118539_1dff9cf9_6.stp",
    "brlcad_ap214_negative_spindle_torus.stp",
    "brlcad_ap214_repeated_vertex_periodic_lobe.stp",
    "brlcad_ap214_source_first_near_cylinder_line.stp",
];

/// A face of one file is no face to us: its edges have no length.
const EMPTY: &str = "brlcad_ap203_invalid_brep.stp";

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn read(path: &Path) -> Option<Import> {
    let start = Instant::now();
    let import = open(path, &Limits::default());
    let time = start.elapsed();
    assert!(
        time < Duration::from_secs(20),
        "{}: {time:?}",
        path.display()
    );
    import.ok()
}

#[test]
fn a_hinge_has_its_closed_form() {
    let found = measure(&read(&path("samples/hinge.step")).unwrap().scene);
    assert_eq!((found.bodies.len(), found.open_faces), (3, 0));
    // Plate, hole, and half of a cylinder along its edge.
    let leaf = 40.0 * 20.0 * 4.0 - PI * 16.0 * 4.0 + PI * 4.0 / 2.0 * 40.0;
    let pin = PI * 1.5 * 1.5 * 44.0;
    for (body, volume) in found.bodies.iter().zip([leaf, leaf, pin]) {
        assert!((body.volume - volume).abs() < 1e-9 * volume, "{body:?}");
    }
    let [left, right] = [0, 1].map(|k| found.bodies[k].centroid);
    // Half a turn apart, about the upright axis through the middle of the pin.
    assert!((left.x + right.x - 40.0).abs() < 1e-9 && (left.y + right.y).abs() < 1e-9);
}

/// Names and sizes of the real files.
fn corpus() -> Vec<(String, PathBuf, u64)> {
    let Ok(entries) = std::fs::read_dir(path("../shared/corpus/step")) else {
        return Vec::new();
    };
    let entries = entries.map(|entry| entry.expect("a folder that can be listed"));
    let files = entries.filter(|entry| entry.path().is_file());
    let mut files: Vec<_> = files
        .map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            (name, entry.path(), entry.metadata().unwrap().len())
        })
        .collect();
    files.sort();
    files
}

/// Compares the real files of up to so many bytes with what the other program finds.
fn compare(most: u64) {
    let Ok(oracle) = std::fs::read(path("../shared/corpus/oracle.json")) else {
        return;
    };
    let oracle: Value = serde_json::from_slice(&oracle).unwrap();
    let (mut faces, mut areas, mut boxes) = (0, 0, 0);
    for (name, path, _) in corpus().into_iter().filter(|file| file.2 <= most) {
        let wanted = &oracle[format!("step/{name}")];
        let count = wanted["n_faces"].as_u64().unwrap_or(0);
        let import = read(&path);
        if count == 0 || name == EMPTY {
            continue;
        }
        let import = import.unwrap_or_else(|| panic!("{name} is refused"));
        let found = import.scene.placements().len() as u64;
        // One of them has no area.
        let lost = u64::from(name.contains("zero_area_face"));
        assert_eq!(found, count - lost, "{name}: faces");
        faces += count;
        // Without error bounds the other program's areas are good to a few in ten thousand.
        let (area, error) = match wanted["area_adaptive"].as_f64() {
            Some(area) => (area, 3e-4),
            None => (wanted["area"].as_f64().unwrap_or(0.0), 1e-3),
        };
        let unit = import
            .scene
            .unit
            .as_ref()
            .map_or(1.0, |unit| unit.metres * 1e3);
        let found = measure(&import.scene);
        let own = found.area * unit * unit;
        if !OTHERS.contains(&name.as_str()) {
            let is_near = (own - area).abs() <= error * area;
            assert!(is_near, "{name}: area {own}, not {area}");
            areas += 1;
        }
        // The other program moves a part to a placement that its representation has besides it,
        // as those files do that were made for one feature each.
        let numbers = wanted["bbox"].as_array().into_iter().flatten();
        let numbers: Vec<f64> = numbers.filter_map(Value::as_f64).collect();
        if numbers.len() == 6 && !name.starts_with("brlcad_ap") && import.scene.wires().is_empty() {
            let [low, high] = [&numbers[..3], &numbers[3..]].map(DVec3::from_slice);
            let [own_low, own_high] = [found.bounds.min, found.bounds.max].map(|p| p * unit);
            let near = 1e-4 * low.distance(high);
            let is_near = own_low.distance(low) <= near && own_high.distance(high) <= near;
            assert!(
                is_near,
                "{name}: box {own_low} to {own_high}, not {low} to {high}"
            );
            boxes += 1;
        }
    }
    println!("{faces} faces, {areas} areas, {boxes} boxes");
}

#[test]
fn an_assembly_of_files_is_as_large_as_its_parts() {
    let folder = path("../shared/corpus/step/s1-c5-214");
    if !folder.is_dir() {
        return;
    }
    let area = |name: &str| measure(&read(&folder.join(name)).unwrap().scene).area;
    let parts = area("HEAD_FRONT.stp") + area("HEAD_BACK.stp");
    assert!((area("HEAD.stp") - parts).abs() < 1e-9 * parts);
    let whole = read(&folder.join("s1-c5-214.stp")).unwrap();
    assert_eq!(whole.scene.placements().len(), 182);
}

#[test]
fn a_torus_that_is_slit_beside_its_seam_closes_its_body() {
    let file = path("../shared/corpus/step/brlcad_ap203_singly_periodic_isocurve_order.stp");
    if !file.is_file() {
        return;
    }
    let found = measure(&read(&file).unwrap().scene);
    let [body] = found.bodies.as_slice() else {
        panic!("{} bodies", found.bodies.len())
    };

    assert_eq!((body.faces, found.open_faces), (23, 0));
    assert!((body.volume - 0.007164).abs() < 1e-6, "{}", body.volume);
}

#[test]
fn small_real_files_are_what_another_program_finds() {
    compare(200_000);
}

#[test]
#[ignore = "takes a minute"]
fn all_real_files_are_what_another_program_finds() {
    compare(u64::MAX);
}
