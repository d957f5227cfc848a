//! Random rays through bodies: the first hits against proofs by interval arithmetic, which share
//! nothing with the way they are found, and closed bodies let no ray out.
//!
//! The bodies are our own, and those of the corpus if it is there.
#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "helpers of tests are tests, too"
)]

use std::path::Path;

use fastrand::Rng;
use glam::DVec3;
use kernel::Ray;
use nurbray::formats::{Limits, open};
use nurbray::{Accelerator, Certificate, Certifier, METHODS, Workspace};

/// Closed bodies, from the folder above this one: faces of planes and quadrics, of revolutions
/// and of free surfaces, whole spheres and tori, faces with holes, and faces inside out.
const BODIES: [&str; 11] = [
    "samples/sphere_torus.x3d",
    "../shared/corpus/iges/cmp_explicit_tetrahedron_solid.igs",
    "../shared/corpus/iges/gmsh_sphere_Rhino3D_default.igs",
    "../shared/corpus/iges/mayo_cube.iges",
    "../shared/corpus/iges/pygem_test_pipe_hollow.iges",
    "../shared/corpus/iges/bladex_shaft.iges",
    "../shared/corpus/iges/made_brep186_screw.igs",
    "../shared/corpus/iges/gmsh_model1.igs",
    "../shared/corpus/iges/occt_hammer.iges",
    "../shared/corpus/iges/made_brep186_NIST_PMI_3.igs",
    "../shared/corpus/iges/made_brep186_NIST_PMI_1.igs",
];

/// How far a hit may be from the proven one, as a share of the size of the body.
const ACCURACY: f64 = 1e-9;

/// Share of the rays that may pass so near to an edge or a silhouette that nothing is proven, or
/// that slip through the gaps which the files leave between faces.
const UNCLEAR: f64 = 0.005;

/// A vector in the cube from -1 to 1.
fn vector(dice: &mut Rng) -> DVec3 {
    DVec3::from_array([(); 3].map(|()| dice.f64() * 2.0 - 1.0))
}

/// What became of the rays through one body.
#[derive(Debug, Default)]
struct Counts {
    hits: usize,
    misses: usize,
    unclear: usize,
    odd: usize,
}

/// Shoots rays through a body from outside; the first hit that is not the proven one is told.
fn shoot(path: &Path, count: usize) -> Result<Counts, String> {
    let import = open(path, &Limits::default()).unwrap();
    let accelerator = Accelerator::build(&import.scene, &METHODS[0]);
    let certifier = Certifier::build(&import.scene);
    let bounds = accelerator.bounds();
    let (size, middle) = (bounds.diagonal(), bounds.center());
    let (mut dice, mut workspace) = (Rng::with_seed(7), Workspace::default());
    let (mut counts, mut hits) = (Counts::default(), Vec::new());
    for _ in 0..count {
        // From a sphere around the body to a point of its box.
        let origin = middle + vector(&mut dice).normalize_or(DVec3::X) * size;
        let target = middle + vector(&mut dice) * bounds.size() * 0.5;
        let direction = (target - origin).normalize();
        let ray = Ray { origin, direction };
        let range = 0.0..f64::INFINITY;
        let found = accelerator.nearest(&ray, range.clone(), &mut workspace);
        let certificate = certifier.certify(&ray);
        if certificate.contradicts(found.as_ref(), ACCURACY * size) {
            return Err(format!("{ray:?}: {found:?}, proven is {certificate:?}"));
        }
        match certificate {
            Certificate::Hit { .. } => counts.hits += 1,
            Certificate::Miss => counts.misses += 1,
            Certificate::Ambiguous { .. } => counts.unclear += 1,
        }
        accelerator.all(&ray, range, &mut workspace, &mut hits);
        counts.odd += hits.len() % 2;
    }
    Ok(counts)
}

/// Shoots through all bodies that are there.
fn shoot_all(count: usize) {
    for name in BODIES {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
        if !path.exists() {
            continue;
        }
        let counts = shoot(&path, count).unwrap_or_else(|wrong| panic!("{name}: {wrong}"));
        println!("{name}: {counts:?}");
        let most = (count as f64 * UNCLEAR).max(2.0);
        assert!(counts.hits > count / 10, "{name}: {counts:?}");
        assert!(counts.unclear as f64 <= most, "{name}: {counts:?}");
        assert!(counts.odd as f64 <= most, "{name}: {counts:?}");
    }
}

#[test]
fn first_hits_are_the_proven_ones() {
    shoot_all(10_000);
}
