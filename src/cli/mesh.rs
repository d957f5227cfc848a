//! Options of `nurbray convert` for formats of triangles.

use std::collections::HashSet;
use std::path::Path;

use anyhow::{Context as _, bail};
use nurbray::convert::{Amount, MeshWriter};
use nurbray::formats::{Place, Warnings};
use nurbray::gltf::{Packing, Source};
use nurbray::kernel::{Camera, Child, Patch, PatchId, Scene, Shape, Unit};
use nurbray::{Accuracy, Screen, TessellateOptions, Tessellation, Tolerance};
use serde_json::{Value, json};

use super::input;
use super::say::say;

/// How surfaces become triangles.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Triangles")]
pub(super) struct MeshArgs {
    /// Largest distance between surface and triangles: a length, with a unit (m, cm, mm, um, in,
    /// ft) or in units of the file, or a share of the diagonal of the scene in percent
    /// [default: 0.05%]
    #[arg(long, value_name = "LENGTH|%", value_parser = distance)]
    tolerance: Option<Distance>,
    /// Largest angle between the normals at the ends of a side, in degrees; a side that goes less
    /// than the tolerance the way they turn may turn by any angle [default: 15]
    #[arg(long, value_name = "DEGREES", value_parser = angle)]
    angle: Option<f64>,
    /// Longest side: a length as for --tolerance
    #[arg(long, value_name = "LENGTH|%", value_parser = distance)]
    max_edge: Option<Distance>,
    /// As coarse as this many pixels allow in a picture of 1080 rows from the first camera of
    /// the file, or of all of it if there is none, but not finer than --tolerance
    #[arg(long, value_name = "PX", value_parser = pixels)]
    screen: Option<f64>,
    /// Most points of all triangles together; they take about 500 bytes each while they are made.
    /// For formats without places (STL, PLY, OBJ) also the most that further places add
    #[arg(long, value_name = "N", default_value_t = TessellateOptions::default().most_points)]
    most_points: usize,
    /// Smaller glTF: positions on a grid of 16 bits, normals within half a degree
    /// (`KHR_mesh_quantization`); the tolerance holds all the same
    #[arg(long)]
    quantize: bool,
    /// Smaller glTF: compressed, for programs that know `EXT_meshopt_compression`
    #[arg(long)]
    meshopt: bool,
}

/// A length on the command line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Distance {
    Metres(f64),
    Units(f64),
    Share(f64),
}

/// Rows of the picture that --screen speaks of.
const ROWS: u32 = 1080;

fn positive(text: &str) -> Option<f64> {
    text.parse()
        .ok()
        .filter(|x: &f64| *x > 0.0 && x.is_finite())
}

pub(super) fn distance(text: &str) -> Result<Distance, String> {
    let with_unit = Unit::KNOWN.iter().find_map(|(unit, metres)| {
        let number = positive(text.strip_suffix(unit)?.trim_end())?;
        Some(Distance::Metres(number * metres))
    });
    let share = || Some(Distance::Share(positive(text.strip_suffix('%')?)? / 100.0));
    let found = with_unit
        .or_else(share)
        .or_else(|| positive(text).map(Distance::Units));
    found.ok_or_else(|| format!("'{text}' is not a positive length like 0.1mm, 0.1 or 0.05%"))
}

fn angle(text: &str) -> Result<f64, String> {
    let angle = positive(text).filter(|angle| *angle <= 180.0);
    angle.ok_or_else(|| format!("'{text}' is not an angle between 0 and 180 degrees"))
}

fn pixels(text: &str) -> Result<f64, String> {
    positive(text).ok_or_else(|| format!("'{text}' is not a positive number of pixels"))
}

impl Distance {
    /// As a tolerance in a scene.
    pub(super) fn tolerance(self, scene: &Scene) -> anyhow::Result<Tolerance> {
        Ok(match self {
            Self::Units(length) => Tolerance::Length(length),
            Self::Share(share) => Tolerance::Relative(share),
            Self::Metres(metres) => {
                let unit = scene.unit.as_ref();
                let unit = unit.context("the file names no unit; give a length without one")?;
                Tolerance::Length(metres / unit.metres)
            }
        })
    }

    /// The length in units of the scene.
    pub(super) fn length(self, scene: &Scene) -> anyhow::Result<f64> {
        Ok(self.tolerance(scene)?.length(scene.extent().diagonal()))
    }
}

impl MeshArgs {
    /// Says which of them were given for an output without triangles.
    pub(super) fn warn_unused(&self, output: &str) {
        let most_points = TessellateOptions::default().most_points;
        for (name, given) in [
            ("--tolerance", self.tolerance.is_some()),
            ("--angle", self.angle.is_some()),
            ("--max-edge", self.max_edge.is_some()),
            ("--screen", self.screen.is_some()),
            ("--most-points", self.most_points != most_points),
            ("--quantize", self.quantize),
            ("--meshopt", self.meshopt),
        ] {
            if given {
                say!("nurbray: warning: {name} is for triangles; {output} holds none");
            }
        }
    }

    /// What is to make files smaller.
    pub(super) fn packing(&self) -> Packing {
        Packing {
            quantize: self.quantize,
            meshopt: self.meshopt,
        }
    }

    /// What they ask for in a scene whose points are moved by up to `rounding` afterwards.
    pub(super) fn options(
        &self,
        scene: &Scene,
        format: &str,
        rounding: f64,
    ) -> anyhow::Result<TessellateOptions> {
        let bounds = scene.extent();
        let diagonal = bounds.diagonal();
        let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
        if reach > f64::from(f32::MAX) {
            bail!(
                "coordinates up to {reach:.1e} do not fit the 32-bit numbers of triangles; write a \
                 format of surfaces, or scale them"
            );
        }
        let max_edge = self.max_edge.map(|most| most.length(scene)).transpose()?;
        let screen = self.screen.map(|pixels| {
            let camera = scene.cameras.first().cloned();
            let up = scene.up.direction();
            Screen {
                camera: camera.unwrap_or_else(|| Camera::framing(&[bounds], up, 16.0 / 9.0)),
                pixels,
                height: ROWS,
            }
        });
        let defaults = TessellateOptions::default();
        let wanted = self.tolerance.map(|wanted| wanted.tolerance(scene));
        let tolerance = wanted.unwrap_or(Ok(defaults.tolerance))?;
        let most = tolerance.length(diagonal);
        if diagonal > 0.0 && rounding > 0.5 * most {
            let (what, advice) = if self.quantize {
                ("--quantize".to_owned(), "leave it out or allow more")
            } else {
                let what = format!("the 32-bit precision of {format}");
                let advice = if scene.patches().is_empty() {
                    "allow more, or write .obj"
                } else {
                    "allow more, or write .obj with --triangles"
                };
                (what, advice)
            };
            bail!(
                "{what} moves points by up to {rounding:.3e}, too much for a tolerance of \
                 {most:.3e}; {advice}"
            );
        }
        Ok(TessellateOptions {
            // What is left when points have been moved; nothing matters without an extent.
            tolerance: Tolerance::Length((most - rounding).max(f64::MIN_POSITIVE)),
            angle: self.angle.map_or(defaults.angle, f64::to_radians),
            max_edge: max_edge.map(|most| most.max(f64::MIN_POSITIVE)),
            screen,
            most_points: self.most_points,
        })
    }
}

/// Name and hash of a file; standard input has neither.
pub(super) fn source(path: &Path, sha256: String) -> Source {
    if input::is_stdin(path) {
        return Source::default();
    }
    let name = path.file_name().unwrap_or_default();
    Source {
        name: name.to_string_lossy().into_owned(),
        sha256,
    }
}

/// How many triangles are in a file.
///
/// # Errors
/// If the places of its parts make more points than are allowed.
pub(super) fn count(
    scene: &Scene,
    triangles: &Tessellation,
    writer: &MeshWriter,
    most: usize,
) -> anyhow::Result<u64> {
    let [stored, shown] = Amount::of(scene, triangles, writer.has_lines);
    if writer.has_places {
        return Ok(stored.triangles);
    }
    if shown.points - stored.points > most as u64 {
        bail!(
            "{} has every part again at each place: {} points instead of {}, and --most-points is \
             {most}; allow more, or write glTF, which has each part once",
            writer.name,
            shown.points,
            stored.points
        );
    }
    Ok(shown.triangles)
}

/// What there is to say about triangles whose points are moved by up to `rounding` afterwards.
pub(super) fn report(triangles: &Tessellation, count: u64, rounding: f64) -> Value {
    let faces = triangles.faces.iter().flatten();
    let strips = triangles.strips.iter().flatten();
    let accuracy = Accuracy::of(triangles, rounding);
    let shells = &triangles.shells;
    json!({
        "triangles": count,
        "lines": strips.map(|strip| strip.points.len() - 1).sum::<usize>(),
        "tolerance": triangles.tolerance + rounding,
        "proven_deviation": accuracy.proven,
        "sampled_deviation": accuracy.sampled,
        "largest_gap": accuracy.gap,
        "unproven_triangles": faces.map(|face| face.unproven).sum::<usize>(),
        "shells": shells.len(),
        "closed_shells": shells.iter().filter(|shell| shell.is_closed()).count(),
        "naked_sides": shells.iter().map(|shell| shell.naked).sum::<usize>(),
        "crossings": triangles.crossings,
    })
}

/// Names the faces of which no triangle is left, those that may be farther away than asked for, and solids that are
/// open.
pub(super) fn note_flaws(scene: &Scene, triangles: &Tessellation, warnings: &mut Warnings) {
    for (patch, face) in scene.patches().iter().zip(&triangles.faces) {
        let Some(face) = face else { continue };
        let place = || Place::item(0, format!("{} {}", patch.name, patch.source).trim());
        if face.mesh.triangles().is_empty() {
            let text =
                "the face has no triangle: all of it is one line or point within the tolerance";
            warnings.unsupported(place(), text);
        }
        if face.undrawn > 0 {
            let text = format!(
                "boundaries of the face cross each other: its {} triangles may reach beyond them or \
                 fall short of them, and no distance is proven",
                face.unproven
            );
            warnings.unsupported(place(), text);
        } else if face.unproven > 0 {
            let text = format!(
                "{} triangles of the face may pass a limit: it is proven to be within {:.3e} of them, \
                 and found within {:.3e}, for a tolerance of {:.3e}",
                face.unproven, face.proven, face.sampled, face.tolerance
            );
            warnings.unsupported(place(), text);
        } else if face.proven > face.tolerance {
            let text = format!(
                "triangles along the boundary of the face are proven to be within {:.3e} of it, and found \
                 within {:.3e}, for a tolerance of {:.3e}",
                face.proven, face.sampled, face.tolerance
            );
            warnings.unsupported(place(), text);
        }
    }
    for patch in open_solids(scene, triangles) {
        let Patch { name, source, .. } = scene.patch(patch);
        let face = format!("{name} {source}");
        let place = Place::item(0, format!("the solid of {}", face.trim()));
        let text = "the file calls it closed, but sides of its triangles have no neighbour: faces are missing, or \
                    farther apart than several times the tolerance; another --tolerance, mostly a larger one, may \
                    close it";
        warnings.unsupported(place, text);
    }
}

/// The solids of the file of which triangles have sides without a neighbour, each by one of its faces.
fn open_solids(scene: &Scene, triangles: &Tessellation) -> Vec<PatchId> {
    let open = triangles.shells.iter().filter(|shell| shell.naked > 0);
    let open: HashSet<_> = open.flat_map(|shell| &shell.patches).collect();
    // An open face below each node; children stand before what they are in.
    let mut below: Vec<Option<PatchId>> = Vec::new();
    for node in scene.nodes() {
        let found = node.children.iter().find_map(|child| match child {
            Child::Node(id) => below[id.index()],
            Child::Item(item) => match item.shape {
                Shape::Patch(id) => open.contains(&id).then_some(id),
                Shape::Mesh(_) => None,
            },
        });
        below.push(found);
    }
    let solids = scene.nodes().iter().zip(below);
    solids
        .filter_map(|(node, face)| node.voids.and(face))
        .collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use nurbray::FaceMesh;
    use nurbray::kernel::{Item, Node, modelling};

    use super::*;

    /// A square, as a face of a solid if there is a count of its voids.
    fn square(voids: Option<usize>) -> Scene {
        let mut scene = Scene::default();
        let (x, y) = (DVec3::X, DVec3::Y);
        let square = modelling::plane(DVec3::ZERO, x, y, 0.0..1.0, 0.0..1.0).unwrap();
        let shape = Shape::Patch(scene.add_patch(square.into()).unwrap());
        let item = Item {
            shape,
            material: None,
        };
        let root = Node {
            children: vec![Child::Item(item)],
            voids,
            ..Node::default()
        };
        let root = scene.add_node(root).unwrap();
        scene.set_root(root).unwrap();
        scene
    }

    #[test]
    fn solids_with_open_triangles_are_named() {
        for voids in [None, Some(0)] {
            let scene = square(voids);
            let made = nurbray::tessellate(&scene, &TessellateOptions::default()).unwrap();
            let mut warnings = Warnings::default();
            note_flaws(&scene, &made, &mut warnings);
            let said = warnings.as_slice().first().map(ToString::to_string);
            let is_named = said.is_some_and(|said| said.contains("the file calls it closed"));
            assert_eq!(is_named, voids.is_some());
        }
    }

    #[test]
    fn faces_that_are_not_proven_are_named() {
        let scene = square(None);
        let made = nurbray::tessellate(&scene, &TessellateOptions::default()).unwrap();
        let said = |change: fn(&mut FaceMesh)| {
            let mut made = made.clone();
            change(made.faces[0].as_mut().unwrap());
            let mut warnings = Warnings::default();
            note_flaws(&scene, &made, &mut warnings);
            let list = warnings.as_slice();
            list.iter().map(ToString::to_string).collect::<String>()
        };
        assert_eq!(said(|_| ()), "");
        let crossed = said(|face| (face.undrawn, face.unproven) = (1, 2));
        assert!(
            crossed.contains("cross each other: its 2 triangles"),
            "{crossed}"
        );
        let passed = said(|face| face.unproven = 1);
        assert!(
            passed.contains("1 triangles of the face may pass"),
            "{passed}"
        );
        let beside = said(|face| face.proven = 2.0 * face.tolerance);
        assert!(beside.contains("along the boundary"), "{beside}");
    }

    #[test]
    fn lengths() {
        assert_eq!(distance("0.5mm"), Ok(Distance::Metres(0.5e-3)));
        assert_eq!(distance("2 m"), Ok(Distance::Metres(2.0)));
        assert_eq!(distance("0.05%"), Ok(Distance::Share(0.05 / 100.0)));
        assert_eq!(distance("3"), Ok(Distance::Units(3.0)));
        for wrong in ["", "mm", "-1", "0", "1px", "inf", "nan%"] {
            assert!(distance(wrong).is_err(), "{wrong}");
        }
    }
}
