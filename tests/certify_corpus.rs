//! Certificates against all ways of production: rays alone, and packets with each set of
//! instructions.
//!
//! The bodies are those of a corpus beside the project; without it the tests are skipped.
#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "helpers of tests are tests, too"
)]

mod reference;
mod shots;

use std::fs;
use std::path::Path;

use fastrand::Rng;
use glam::DVec3;
use kernel::{Ray, Scene};
use nurbray::{
    Accelerator, Certificate, Certifier, Hit, Instructions, METHODS, Workspace, formats,
};
use rayon::prelude::*;
use reference::{scenes, vector};
use serde_json::Value;
use shots::Targets;

/// Ten bodies: trimmed solids and shells, lofted blades, hulls, a teapot, letters.
const BODIES: [&str; 10] = [
    "x3d/x3dcpp_hero_teapot_nurbs.x3d",
    "x3d/titania_StampX3dLetters.x3d",
    "x3d/FredTheBunny.x3dv",
    "iges/made_brep186_screw.igs",
    "iges/made_brep186_NIST_PMI_1.igs",
    "iges/occt_hammer.iges",
    "iges/occt_bearing.iges",
    "iges/bladex_lower.iges",
    "iges/wavebem_kcs.iges",
    "obj/iga_pipe_section.obj",
];

/// Accuracy that the production path promises, relative to the scene's size.
const ACCURACY: f64 = 1e-9;

/// Rays this far beside one another, relative to the size, should meet the same.
const SIDEWAYS: f64 = 1e-9;

/// The sine of the angle to a surface below which rays run along it.
const GRAZING: f64 = 1e-3;

/// Rays of a packet.
const PACKET: u32 = 64;

/// A name for each way of production.
type Way = &'static str;

/// What was compared, and what was wrong.
#[derive(Default)]
struct Outcome {
    rays: u64,
    /// Rays by status: miss, hit, tangent, edge, overlap.
    counts: [u64; 5],
    contradictions: Vec<String>,
    /// Answers of sealed scenes that stand for a gap.
    filled: u64,
}

impl Outcome {
    fn plus(mut self, other: Self) -> Self {
        self.rays += other.rays;
        self.filled += other.filled;
        for (sum, count) in self.counts.iter_mut().zip(other.counts) {
            *sum += count;
        }
        self.contradictions.extend(other.contradictions);
        self
    }
}

/// All ways to trace a scene.
struct Ways<'a> {
    certifier: Certifier<'a>,
    alone: Accelerator<'a>,
    sealed: Accelerator<'a>,
    packets: Vec<(Way, Accelerator<'a>)>,
    size: f64,
}

impl<'a> Ways<'a> {
    fn of(scene: &'a Scene) -> Self {
        let build = || Accelerator::build(scene, &METHODS[0]);
        let packets = Instructions::ALL.map(|instructions| {
            let packets = build().with_instructions(instructions);
            (instructions.name(), packets)
        });
        let alone = build();
        Self {
            certifier: Certifier::build(scene),
            size: alone.bounds().diagonal(),
            alone,
            sealed: build().sealed(None),
            packets: packets.into(),
        }
    }

    /// Whether an answer that a certificate contradicts is wrong for all rays next to this one, too:
    /// where a ray runs along a surface or through a border, the least change decides.
    fn contradicts_around(
        &self,
        ray: &Ray,
        answer: Option<&Hit>,
        certificate: &Certificate,
    ) -> bool {
        let slack = SIDEWAYS * self.size / ray.direction.length();
        if let Some(hit) = answer
            && hit.normal.dot(ray.direction.normalize()).abs() < GRAZING
        {
            // What is grazed may be passed by as well, but nothing before it may be lost.
            return matches!(certificate, Certificate::Hit { t, .. } if t.high() + slack < hit.t);
        }
        if let (Some(hit), Certificate::Hit { t, .. }) = (answer, certificate)
            && t.widened(slack).contains(hit.t)
        {
            // Another of the faces that meet there.
            return false;
        }
        let is_free = |t: f64| match certificate {
            Certificate::Miss => true,
            Certificate::Hit { t: first, .. } => first.low() > t,
            Certificate::Ambiguous { free, .. } => *free > t,
        };
        if let Some(hit) = answer
            && is_free(hit.t)
        {
            // Of two faces that end side by side the one behind may be met, and not the one before;
            // along a border, places move by the root of what rays do.
            let reach = SIDEWAYS.sqrt() * self.size / ray.direction.length();
            let start = Ray {
                origin: ray.at(hit.t - reach),
                ..*ray
            };
            let is_there = |beside: &Certificate| match beside {
                Certificate::Hit { t, .. } => t.high() < 2.0 * reach,
                _ => false,
            };
            if self.beside(&start).any(|beside| is_there(&beside)) {
                return false;
            }
        }
        self.beside(ray)
            .all(|beside| beside.contradicts(answer, slack))
    }

    /// Certificates of rays next to one.
    fn beside(&self, ray: &Ray) -> impl Iterator<Item = Certificate> {
        let mut dice = Rng::with_seed(7);
        (0..32).map(move |n| {
            let mut off = || dice.f64() * 2.0 - 1.0;
            let distance = self.size * SIDEWAYS / if n < 16 { 100.0 } else { 10.0 };
            let origin = ray.origin + DVec3::new(off(), off(), off()) * distance;
            self.certifier.certify(&Ray { origin, ..*ray })
        })
    }

    /// Rays that are `fragile` run exactly along surfaces or through their borders, and so do those of which
    /// it is not proven what they meet.
    fn compare(
        &self,
        name: &str,
        (rays, fragile): (&[Ray], bool),
        workspace: &mut Workspace,
    ) -> Outcome {
        let certificates: Vec<_> = rays.iter().map(|ray| self.certifier.certify(ray)).collect();
        let mut outcome = Outcome {
            rays: rays.len() as u64,
            ..Outcome::default()
        };
        for certificate in &certificates {
            outcome.counts[usize::from(certificate.code())] += 1;
        }
        let mut check = |way: Way, k: usize, answer: Option<&Hit>| {
            let (ray, certificate) = (&rays[k], &certificates[k]);
            let accuracy = ACCURACY * self.size / ray.direction.length();
            let fragile = fragile || matches!(certificate, Certificate::Ambiguous { .. });
            if certificate.contradicts(answer, accuracy)
                && (!fragile || self.contradicts_around(ray, answer, certificate))
            {
                let answer = answer.map(|h| (h.shape, h.t, h.uv, h.tangential));
                let found = format!("{name} {way} {ray:?}\n  {certificate:?}\n  {answer:?}");
                outcome.contradictions.push(found);
            }
        };
        let whole = 0.0..f64::INFINITY;
        for (k, ray) in rays.iter().enumerate() {
            check(
                "alone",
                k,
                self.alone.nearest(ray, whole.clone(), workspace).as_ref(),
            );
            let sealed = self.sealed.nearest(ray, whole.clone(), workspace);
            if sealed.is_some_and(|hit| hit.filled) {
                outcome.filled += 1;
            } else {
                check("sealed", k, sealed.as_ref());
            }
        }
        // Side by side, and among rays back from where they would get, which makes each go its
        // own way.
        let mixed: Vec<Ray> = rays
            .iter()
            .flat_map(|ray| {
                let back = Ray {
                    origin: ray.origin + ray.direction.normalize() * self.size,
                    direction: -ray.direction,
                };
                [*ray, back]
            })
            .collect();
        let (ranges, mut hits) = (vec![whole; mixed.len()], Vec::new());
        for (way, accelerator) in &self.packets {
            accelerator.nearest_many(rays, &ranges[..rays.len()], workspace, &mut hits);
            for (k, hit) in hits.iter().enumerate() {
                check(way, k, hit.as_ref());
            }
            accelerator.nearest_many(&mixed, &ranges, workspace, &mut hits);
            for (k, hit) in hits.iter().step_by(2).enumerate() {
                check(way, k, hit.as_ref());
            }
        }
        outcome
    }
}

/// A body of the corpus, `None` if it is not at hand.
fn body(name: &str) -> Option<Scene> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/corpus");
    let path = path.join(name);
    let open = |path| formats::open(path, &formats::Limits::default());
    path.exists().then(|| open(path).unwrap().scene)
}

/// Shoots packets at bodies of the corpus, `None` if it is not at hand.
fn shoot(bodies: &[&str], packets: [u32; 2], seed: u64) -> Option<Outcome> {
    let mut all = Outcome::default();
    for (number, name) in (seed * 100..).zip(bodies) {
        all = all.plus(shoot_at(name, &body(name)?, packets, number));
    }
    Some(all)
}

/// As [`shoot`], in scenes of so many patches, most of which are not shown, that cells are divided only for
/// the rays that come to them.
fn shoot_in_crowds(bodies: &[&str], packets: [u32; 2], seed: u64) -> Option<Outcome> {
    let mut all = Outcome::default();
    for (number, name) in (seed * 100..).zip(bodies) {
        let mut scene = body(name)?;
        let whole = Accelerator::build(&scene, &METHODS[0]).cell_count();
        let first = scene.patches()[0].clone();
        for _ in 0..2048 {
            scene.add_patch(first.clone()).unwrap();
        }
        let late = Accelerator::build(&scene, &METHODS[0]).cell_count();
        assert!(late <= whole, "{name}: {late} {whole}");
        all = all.plus(shoot_at(name, &scene, packets, number));
    }
    Some(all)
}

/// Shoots packets at a scene: across, along and past its faces, and for `ahead` of them straight along
/// axes and faces.
fn shoot_at(name: &str, scene: &Scene, [packets, ahead]: [u32; 2], seed: u64) -> Outcome {
    let ways = Ways::of(scene);
    let targets = Targets::of(scene, ways.size);
    let one = |workspace: &mut Workspace, packet: u32| {
        let mut dice = Rng::with_seed(seed << 32 | u64::from(packet));
        let fragile = packet >= packets;
        let rays = if fragile {
            targets.ahead(&mut dice, PACKET)
        } else {
            targets.bundle(&mut dice, PACKET)
        };
        ways.compare(name, (&rays, fragile), workspace)
    };
    let outcome = (0..packets + ahead)
        .into_par_iter()
        .map_init(Workspace::default, one)
        .reduce(Outcome::default, Outcome::plus);
    println!(
        "{name}: {} rays, {:?} [miss, hit, tangent, edge, overlap], {} filled, {} contradictions",
        outcome.rays,
        outcome.counts,
        outcome.filled,
        outcome.contradictions.len()
    );
    outcome
}

fn none_contradicted(outcome: &Outcome) {
    let found = &outcome.contradictions;
    let first: Vec<_> = found.iter().take(20).cloned().collect();
    assert!(
        found.is_empty(),
        "{}\n{} contradictions",
        first.join("\n"),
        found.len()
    );
}

#[test]
fn no_way_of_production_contradicts_a_proof() {
    if let Some(outcome) = shoot(&["iges/made_brep186_screw.igs", BODIES[0]], [40, 20], 1) {
        assert!(
            outcome.counts[0] > 50 && outcome.counts[1] > 500,
            "{:?}",
            outcome.counts
        );
        none_contradicted(&outcome);
    }
}

#[test]
fn cells_divided_late_contradict_no_proof() {
    if let Some(outcome) = shoot_in_crowds(&[BODIES[3], BODIES[0]], [20, 10], 4) {
        assert!(outcome.counts[1] > 250, "{:?}", outcome.counts);
        none_contradicted(&outcome);
    }
}

#[test]
#[ignore = "soak: twenty-five thousand rays at each of nine bodies, five ways"]
fn soak_cells_divided_late() {
    // Faces of the last one coincide but for the last bit, which decides between them.
    if let Some(outcome) = shoot_in_crowds(&BODIES[..9], [400, 0], 5) {
        none_contradicted(&outcome);
    }
}

/// A fifth of a million rays at two of the bodies.
fn part(first: usize) {
    if let Some(outcome) = shoot(&BODIES[first..first + 2], [1563, 0], 2) {
        println!("{} rays, {:?}", outcome.rays, outcome.counts);
        none_contradicted(&outcome);
    }
}

#[test]
#[ignore = "soak: a fifth of a million rays, five ways"]
fn soak_teapot_and_letters() {
    part(0);
}

#[test]
#[ignore = "soak: a fifth of a million rays, five ways"]
fn soak_bunny_and_screw() {
    part(2);
}

#[test]
#[ignore = "soak: a fifth of a million rays, five ways"]
fn soak_trimmed_solid_and_hammer() {
    part(4);
}

#[test]
#[ignore = "soak: a fifth of a million rays, five ways"]
fn soak_bearing_and_blade() {
    part(6);
}

#[test]
#[ignore = "soak: a fifth of a million rays, five ways"]
fn soak_hull_and_pipe() {
    part(8);
}

#[test]
#[ignore = "soak: five thousand rays at every file of the corpus, five ways"]
fn soak_every_file() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/corpus");
    let folders = ["iges", "obj", "step", "vrml", "x3d"].map(|folder| corpus.join(folder));
    let files = folders
        .iter()
        .filter_map(|folder| fs::read_dir(folder).ok());
    let mut files: Vec<_> = files.flatten().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let mut all = Outcome::default();
    for (seed, path) in (300..).zip(files) {
        // Some are broken on purpose, some have no surface.
        let Ok(document) = formats::open(&path, &formats::Limits::default()) else {
            continue;
        };
        if !document.scene.patches().is_empty() {
            let name = path.file_name().unwrap().to_string_lossy();
            all = all.plus(shoot_at(&name, &document.scene, [40, 40], seed));
        }
    }
    none_contradicted(&all);
}

/// The rays of the references, each in the middle of a packet, with every set of instructions:
/// all hits are found, and no other.
#[test]
fn packets_meet_what_the_references_meet() {
    let Some(reference) = reference::load() else {
        return;
    };
    let scenes = scenes(&reference);
    let ways: Vec<_> = scenes.iter().map(Ways::of).collect();
    let (mut workspace, mut hits) = (Workspace::default(), Vec::new());
    let (mut robust, mut failures) = (0, Vec::new());
    for case in reference["cases"].as_array().unwrap() {
        if case["robust"] != Value::Bool(true) {
            continue;
        }
        robust += 1;
        let ways = &ways[usize::try_from(case["surface"].as_u64().unwrap()).unwrap()];
        let ray = Ray {
            origin: vector(&case["origin"]),
            direction: vector(&case["dir"]),
        };
        let (right, up) = ray.direction.normalize().any_orthonormal_pair();
        let beside = |k: u32| {
            let (x, y) = (f64::from(k % 8) - 4.0, f64::from(k / 8) - 4.0);
            let direction = ray.direction + (right * x + up * y) * 1e-4 * ray.direction.length();
            Ray { direction, ..ray }
        };
        let rays: Vec<_> = (0..PACKET).map(beside).collect();
        let middle = rays
            .iter()
            .position(|other| other.direction == ray.direction)
            .unwrap();
        let near = -1e-12 * ways.size / ray.direction.length();
        let ranges = vec![near..f64::INFINITY; rays.len()];
        let wanted = case["hits"][0]["t"].as_f64();
        for (way, accelerator) in &ways.packets {
            accelerator.nearest_many(&rays, &ranges, &mut workspace, &mut hits);
            let found = hits[middle].map(|hit| hit.t);
            let agrees = match (found, wanted) {
                (None, None) => true,
                (Some(a), Some(b)) => {
                    (a - b).abs() * ray.direction.length() <= ACCURACY * ways.size
                }
                _ => false,
            };
            if !agrees {
                failures.push(format!(
                    "{way} {}: {found:?}, expected {wanted:?}",
                    case["id"]
                ));
            }
        }
    }
    println!(
        "{robust} rays with each of {} sets of instructions",
        Instructions::ALL.len()
    );
    assert!(
        robust > 500 && failures.is_empty(),
        "{}",
        failures.join("\n")
    );
}
