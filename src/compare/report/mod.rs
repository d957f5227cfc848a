//! What a comparison leaves in its folder: pictures, raw channels, `report.json`, a summary in
//! Markdown, and one page that shows it all.

mod page;
mod plot;
mod text;

use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use formats::Warnings;
use glam::DAffine3;
use kernel::{Scene, UpAxis};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::align::Fit;
use super::exact::Exact;
use super::faults::Fault;
use super::read::MeshFile;
use super::soup::Soup;
use super::views::{self, ImageDifference, Stage, View};
use super::{Deviation, Subject, Worst, measure, of_surfaces};
use crate::film::Picture;
use crate::output::{self, OutputOptions};
use crate::tessellate::{Face, Tessellation, deviation};

/// The files with all numbers, with those for people, and with those beside the pictures.
const PAGES: [&str; 3] = ["report.json", "summary.md", "index.html"];

/// What tells that it is ours.
const MADE_BY: &str = "nurbray compare";

/// The picture of the surfaces, and its raw channels.
const EXACT: [&str; 2] = ["exact.png", "exact.exr"];

/// A mesh that is to be compared.
#[derive(Clone, Debug, Default)]
pub struct Candidate {
    /// What it is called in the report; if empty, by its tolerance.
    pub name: String,
    /// The triangles.
    pub scene: Scene,
    /// Where they stand among the surfaces.
    pub scene_from_mesh: DAffine3,
    /// The rigid fit in it, if there was one.
    pub fit: Option<Fit>,
    /// How it was made, if it is ours.
    pub made: Option<Made>,
    /// A distance, in units of the scene: more is done to know whether it is exceeded.
    pub limit: Option<f64>,
    /// Size of its files.
    pub bytes: u64,
    /// The name of its file in the folder of the report, if it was written for that; else empty.
    pub file: String,
    /// What its reader did not use.
    pub warnings: Warnings,
}

/// How a mesh of ours was made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Made {
    /// What was asked for, in units of the scene.
    pub tolerance: f64,
    /// What is proven of the distance at parameters that belong together, rounding of the file included.
    pub proven: f64,
    /// The largest such distance at sample points.
    pub sampled: f64,
    /// Root mean square of such distances over the triangles.
    pub rms: f64,
    /// Time to make the triangles and to write the file.
    pub took: Duration,
}

impl Made {
    /// What is known of our triangles, and of the file that they were read back from.
    pub fn new(scene: &Scene, triangles: &Tessellation, file: &MeshFile, took: Duration) -> Self {
        let metres = scene.unit.as_ref().map_or(1.0, |unit| unit.metres);
        let [proven, sampled] = file.claim.unwrap_or([f64::INFINITY; 2]);
        Self {
            tolerance: triangles.tolerance,
            proven: proven / metres,
            sampled: sampled / metres,
            rms: chord_rms(scene, triangles),
            took,
        }
    }
}

/// Root mean square distance between surfaces and triangles at the parameters that belong to their points.
fn chord_rms(scene: &Scene, triangles: &Tessellation) -> f64 {
    let faces: Vec<_> = scene.patches().iter().zip(&triangles.faces).collect();
    let sums = faces.par_iter().map(|(patch, face)| {
        let Some(face) = face else { return [0.0; 2] };
        let exact = Face::new(patch, face.tolerance);
        let positions = face.mesh.positions();
        let mut sums = [0.0; 2];
        for triangle in face.mesh.triangles() {
            let corners = triangle.map(|k| positions[k as usize]);
            let uvs = triangle.map(|k| face.parameters[k as usize]);
            let area = (corners[1] - corners[0])
                .cross(corners[2] - corners[0])
                .length();
            for heavy in 0..3 {
                // Three points inside are exact for squares of what is linear.
                let shares = [0, 1, 2].map(|k| if k == heavy { 2.0 / 3.0 } else { 1.0 / 6.0 });
                let off = face.scale * deviation::at(&exact, uvs, corners, shares);
                sums[0] += area * off * off;
                sums[1] += area;
            }
        }
        sums
    });
    let sums: Vec<[f64; 2]> = sums.collect();
    let total = |k: usize| sums.iter().map(|s| s[k]).sum::<f64>();
    (total(0) / total(1).max(f64::MIN_POSITIVE)).sqrt()
}

/// What a comparison found about one mesh.
#[derive(Clone, Debug)]
pub struct Compared {
    /// Its name.
    pub name: String,
    /// Number of triangles.
    pub triangles: usize,
    /// Those of them that are meshes of the exact file, and are not measured.
    pub unmeasured: usize,
    /// Size of its files.
    pub bytes: u64,
    /// How it was made, if it is ours.
    pub made: Option<Made>,
    /// The rigid fit, if there was one.
    pub fit: Option<Fit>,
    /// Distances.
    pub deviation: Deviation,
    /// What is wrong with it as a whole.
    pub faults: Vec<Fault>,
    /// Differences of pictures.
    pub image: ImageDifference,
    /// Time to prepare it for rendering.
    pub build: Duration,
    /// Time to render it.
    pub render: Duration,
    /// Time to measure it.
    pub measuring: Duration,
    /// What its reader did not use.
    pub warnings: Warnings,
    /// The names of its files in the folder.
    files: Vec<String>,
    /// The widths of the crops at its worst places.
    crops: Vec<f64>,
    /// The triangles for the page, if they are not too many.
    solid: Option<Solid>,
}

/// The worst places of both ways, the largest first.
fn worst(deviation: &Deviation) -> Vec<Worst> {
    let ways = [&deviation.surface_to_mesh, &deviation.mesh_to_surface];
    let mut worst: Vec<Worst> = ways.iter().flat_map(|way| &way.worst).copied().collect();
    worst.sort_by(|a, b| b.distance.total_cmp(&a.distance));
    worst
}

impl Compared {
    /// The worst places of both ways, the largest first.
    pub fn worst(&self) -> Vec<Worst> {
        worst(&self.deviation)
    }

    /// The distance from the surfaces that is proven both ways.
    ///
    /// Of a mesh of our own, that every triangle is that near to its surface is proven twice.
    pub fn bound(&self) -> f64 {
        let bound = self.deviation.bound();
        self.made
            .map_or(bound, |made| bound.min(made.proven))
            .max(self.deviation.found())
    }
}

/// Triangles for a look around: places as shares of the box, and deviations as shares of the
/// largest.
#[derive(Clone, Debug)]
struct Solid {
    points: Vec<[u16; 3]>,
    shades: Vec<u8>,
    triangles: Vec<[u32; 3]>,
    /// The longest side is one.
    size: [f32; 3],
}

/// Triangles of a page.
const SOLID: usize = 200_000;

/// A whole comparison.
#[derive(Clone, Debug)]
pub struct Report {
    /// Name of the exact file.
    pub source: String,
    /// Name of the unit, or empty.
    pub unit: String,
    /// Size of the scene: the diagonal of the box around it.
    pub size: f64,
    /// Number of patches.
    pub patches: usize,
    /// Meshes of the exact file that are shown, but not measured.
    pub unmeasured: usize,
    /// Time to prepare the surfaces for rendering.
    pub build: Duration,
    /// Time to render them.
    pub render: Duration,
    /// The width and height of the pictures.
    pub picture: [u32; 2],
    /// Every mesh.
    pub meshes: Vec<Compared>,
    z_up: bool,
    folder: PathBuf,
}

/// Compares meshes with surfaces and leaves a report in `folder`, which must exist; files of an
/// earlier one stay if it had more, unless [`remove_earlier`] took them away.
///
/// # Errors
/// If a file cannot be written.
pub fn compare(
    subject: &Subject<'_>,
    source: &str,
    candidates: Vec<Candidate>,
    view: &View,
    folder: &Path,
) -> io::Result<Report> {
    let exact = subject.exact();
    let stage = Stage::new(subject.scene, view);
    let [picture, film] = EXACT.map(|name| folder.join(name));
    write_png(&picture, &stage.picture)?;
    output::write(&stage.film, &film, &OutputOptions::default())?;
    let mut meshes = Vec::new();
    for (candidate, number) in candidates.into_iter().zip(1..) {
        meshes.push(compare_one(&exact, &stage, candidate, number, folder)?);
    }
    let unit = subject.scene.unit.as_ref();
    let report = Report {
        source: source.to_owned(),
        unit: unit.map_or_else(String::new, |unit| unit.name.clone()),
        size: exact.bounds().diagonal(),
        patches: exact.faces.len(),
        unmeasured: subject.scene.placements().len() - exact.faces.len(),
        build: stage.build,
        render: stage.render,
        picture: [view.width, view.height],
        meshes,
        z_up: subject.scene.up == UpAxis::Z,
        folder: folder.to_owned(),
    };
    report.write()?;
    Ok(report)
}

/// Removes what an earlier report in `folder` lists as its files, but none of `inputs`.
///
/// # Errors
/// If a file cannot be removed.
pub fn remove_earlier(folder: &Path, inputs: &[PathBuf]) -> io::Result<()> {
    let real = |path: &Path| path.canonicalize().ok();
    let inputs: Vec<_> = inputs.iter().filter_map(|path| real(path)).collect();
    let report = fs::read(folder.join(PAGES[0])).unwrap_or_default();
    let report: Value = serde_json::from_slice(&report).unwrap_or_default();
    if report["made_by"] != MADE_BY {
        return Ok(());
    }
    let names = report["files"].as_array().into_iter().flatten();
    for name in names.filter_map(Value::as_str).chain(PAGES) {
        let path = folder.join(name);
        // Whatever the list says: nothing that is elsewhere.
        let is_here = Path::new(name).file_name().is_some_and(|own| own == name);
        let is_input = real(&path).is_some_and(|path| inputs.contains(&path));
        if is_here && path.is_file() && !is_input {
            fs::remove_file(&path)?;
        }
    }
    Ok(())
}

/// Measures one mesh, takes its pictures and writes them.
fn compare_one(
    exact: &Exact<'_>,
    stage: &Stage<'_>,
    candidate: Candidate,
    number: usize,
    folder: &Path,
) -> io::Result<Compared> {
    let started = Instant::now();
    let soup = Soup::new(&candidate.scene, &candidate.scene_from_mesh);
    let proven = candidate.made.map_or(f64::INFINITY, |made| made.proven);
    let part = of_surfaces(exact, &soup);
    let measured = part.as_ref().unwrap_or(&soup);
    let (deviation, faults) = measure(exact, measured, proven, candidate.limit);
    let measuring = started.elapsed();
    let worst = worst(&deviation);
    let views = views::take(stage, exact, &soup, &worst, deviation.surface_to_mesh.found);
    let name = |kind: &str| format!("mesh{number}-{kind}");
    let kinds = [
        ("smooth.png", &views.smooth),
        ("flat.png", &views.flat),
        ("wire.png", &views.wire),
        ("difference.png", &views.difference),
        ("flip.png", &views.flip),
        ("heat.png", &views.heat),
        ("silhouette.png", &views.silhouette),
    ];
    let crops = views.crops.iter().zip(1..).flat_map(|(crop, k)| {
        [
            (name(&format!("crop{k}-exact.png")), &crop.exact),
            (name(&format!("crop{k}-mesh.png")), &crop.mesh),
        ]
    });
    let pictures = kinds.map(|(kind, picture)| (name(kind), picture));
    let pictures: Vec<_> = pictures.into_iter().chain(crops).collect();
    pictures
        .par_iter()
        .try_for_each(|(name, picture)| write_png(&folder.join(name), picture))?;
    let channels = ["smooth.exr", "deviation.exr"].map(name);
    let [smooth, distances] = channels.each_ref().map(|name| folder.join(name));
    output::write(&views.film, &smooth, &OutputOptions::default())?;
    let size = [stage.film.width(), stage.film.height()];
    output::write_channel(&distances, size, "deviation", &views.distances)?;
    let mut files: Vec<String> = pictures.into_iter().map(|(name, _)| name).collect();
    files.extend(channels);
    files.extend(Some(candidate.file).filter(|name| !name.is_empty()));
    Ok(Compared {
        name: match candidate.made.filter(|_| candidate.name.is_empty()) {
            Some(made) => {
                let unit = stage
                    .scene
                    .unit
                    .as_ref()
                    .map_or("", |unit| unit.name.as_str());
                format!("{} {unit}", text::short(made.tolerance))
                    .trim_end()
                    .to_owned()
            }
            None => candidate.name,
        },
        triangles: soup.triangles.len(),
        unmeasured: soup.triangles.len() - measured.triangles.len(),
        bytes: candidate.bytes,
        made: candidate.made,
        fit: candidate.fit,
        solid: (measured.triangles.len() <= SOLID).then(|| solid(exact, measured, &deviation)),
        deviation,
        faults,
        image: views.result,
        build: views.build,
        render: views.render,
        measuring,
        warnings: candidate.warnings,
        files,
        crops: views.crops.iter().map(|crop| crop.extent).collect(),
    })
}

fn write_png(path: &Path, picture: &Picture) -> io::Result<()> {
    let bytes = output::encode_png(picture)?;
    output::replace_file(path, |file| file.write_all(&bytes))
}

/// The triangles with the deviation in their middles.
fn solid(exact: &Exact<'_>, soup: &Soup, deviation: &Deviation) -> Solid {
    let bounds = soup.bounds();
    let longest = bounds.size().max_element().max(f64::MIN_POSITIVE);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "shares of the largest number"
    )]
    let share = |value: f64, most: f64| (value.clamp(0.0, 1.0) * most).round() as u16;
    let point = |p: &glam::DVec3| {
        ((*p - bounds.min) / bounds.size().max(glam::DVec3::splat(f64::MIN_POSITIVE)))
            .to_array()
            .map(|v| share(v, 65535.0))
    };
    let most = deviation.found().max(f64::MIN_POSITIVE);
    let middle = |[a, b, c]: &[glam::DVec3; 3]| {
        let foot = exact.nearest((*a + *b + *c) / 3.0);
        foot.map_or(0, |foot| {
            share(foot.distance / most, 255.0).to_le_bytes()[0]
        })
    };
    let middles: Vec<u8> = soup.tree.corners().par_iter().map(middle).collect();
    let mut shades = vec![0; soup.points.len()];
    for (triangle, shade) in soup.triangles.iter().zip(middles) {
        for &k in triangle {
            let own: &mut u8 = &mut shades[k as usize];
            *own = (*own).max(shade);
        }
    }
    Solid {
        points: soup.points.iter().map(point).collect(),
        shades,
        triangles: soup.triangles.clone(),
        size: (bounds.size() / longest).as_vec3().to_array(),
    }
}

impl Report {
    /// The meshes that may be farther from the surfaces than `limit`, or are not there.
    pub fn failures(&self, limit: f64) -> impl Iterator<Item = &Compared> {
        let fails = move |m: &&Compared| m.triangles == 0 || m.bound() > limit;
        self.meshes.iter().filter(fails)
    }

    fn write(&self) -> io::Result<()> {
        let write = |name: &str, bytes: &[u8]| {
            output::replace_file(&self.folder.join(name), |file| file.write_all(bytes))
        };
        let json = serde_json::to_vec_pretty(&self.json())?;
        let [report, summary, page] = PAGES;
        write(report, &json)?;
        write(summary, self.markdown().as_bytes())?;
        write(page, self.page()?.as_bytes())
    }

    /// All numbers.
    pub fn json(&self) -> Value {
        let own = EXACT.iter().map(|name| (*name).to_owned());
        let files = own.chain(self.meshes.iter().flat_map(|mesh| mesh.files.clone()));
        json!({
            "made_by": MADE_BY,
            "files": files.collect::<Vec<_>>(),
            "source": self.source,
            "unit": self.unit,
            "size": self.size,
            "patches": self.patches,
            "meshes_not_measured": self.unmeasured,
            "picture": self.picture,
            "exact_build_s": self.build.as_secs_f64(),
            "exact_render_s": self.render.as_secs_f64(),
            "meshes": self.meshes.iter().map(Compared::json).collect::<Vec<_>>(),
        })
    }
}

/// The names of the pictures of a mesh, and what they show.
const PICTURES: &[(&str, &str)] = &[
    ("smooth", "smooth mesh"),
    ("flat", "flat mesh"),
    ("wire", "wireframe"),
    ("difference", "difference x 4"),
    ("flip", "FLIP"),
    ("heat", "deviation"),
    ("silhouette", "silhouettes"),
];
