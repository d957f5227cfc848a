//! The report as JSON and as Markdown.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::super::deviation::{Reach, Worst};
use super::super::sampling::Statistics;
use super::{Compared, Report};

fn worst(place: &Worst) -> Value {
    json!({
        "from": place.from.to_array(),
        "to": place.to.to_array(),
        "distance": place.distance,
        "patch": place.patch,
        "u": place.uv.x,
        "v": place.uv.y,
        "triangle": place.triangle,
    })
}

fn reach(reach: &Reach) -> Value {
    json!({
        "found": reach.found,
        "proven": reach.bound,
        "worst": reach.worst.iter().map(worst).collect::<Vec<_>>(),
    })
}

fn statistics(found: Option<Statistics>) -> Value {
    let value = |get: fn(Statistics) -> f64| found.map(get);
    json!({
        "mean": value(|s| s.mean),
        "rms": value(|s| s.rms),
        "p95": value(|s| s.p95),
        "max": value(|s| s.max),
    })
}

impl Compared {
    pub(super) fn json(&self) -> Value {
        let image = &self.image;
        let mut value = json!({
            "name": self.name,
            "triangles": self.triangles,
            "triangles_not_measured": self.unmeasured,
            "bytes": self.bytes,
            "hausdorff_found": self.deviation.found(),
            "hausdorff_proven": self.bound(),
            "surface_to_mesh": reach(&self.deviation.surface_to_mesh),
            "mesh_to_surface": reach(&self.deviation.mesh_to_surface),
            "distance": statistics(self.deviation.distance),
            "flat_normals_deg": statistics(self.deviation.flat_normals),
            "smooth_normals_deg": statistics(self.deviation.smooth_normals),
            "silhouette_pixels": image.silhouette_pixels,
            "silhouette_pixels_16_samples": image.silhouette_pixels_16,
            "silhouette_distance_px": image.silhouette_distance,
            "depth_max": image.depth.map(|depth| depth[0]),
            "depth_p99": image.depth.map(|depth| depth[1]),
            "position_max": image.position.map(|position| position[0]),
            "position_p99": image.position.map(|position| position[1]),
            "psnr_srgb_db": image.psnr,
            "psnr_linear_db": image.psnr_linear,
            "ssim": image.ssim,
            "flip": image.flip,
            "build_s": self.build.as_secs_f64(),
            "render_s": self.render.as_secs_f64(),
            "measuring_s": self.measuring.as_secs_f64(),
            "faults": self.faults.iter().map(|fault| json!({
                "kind": fault.kind.name(),
                "text": fault.text,
                "place": fault.place.map(|p| p.to_array()),
            })).collect::<Vec<_>>(),
            "warnings": self.warnings.as_slice().iter().map(|warning| json!({
                "text": warning.problem.to_string(),
                "count": warning.count,
            })).collect::<Vec<_>>(),
        });
        if let Some(made) = self.made {
            value["tolerance"] = made.tolerance.into();
            value["chord_proven"] = made.proven.into();
            value["chord_sampled"] = made.sampled.into();
            value["chord_rms"] = made.rms.into();
            value["made_s"] = made.took.as_secs_f64().into();
        }
        if let Some(fit) = self.fit {
            value["fit"] = json!({
                "scene_from_mesh": fit.scene_from_mesh.to_cols_array(),
                "rms_before": fit.before,
                "rms_residual": fit.residual,
            });
        }
        value
    }

    /// Time until the first picture of the mesh: made, prepared and rendered.
    pub(super) fn time(&self) -> f64 {
        let made = self.made.map_or(0.0, |made| made.took.as_secs_f64());
        made + self.build.as_secs_f64() + self.render.as_secs_f64()
    }
}

/// What stands for means of an empty mesh.
const UNMEASURED: &str = "nothing to measure";

/// A number with four digits.
pub(super) fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a logarithm of a finite number"
    )]
    let power = value.abs().log10().floor() as i32;
    match power {
        -4..=5 => {
            let digits = usize::try_from(3 - power).unwrap_or(0);
            format!("{value:.digits$}")
        }
        _ => format!("{value:.3e}"),
    }
}

impl Report {
    /// The heads and the cells of the table, a row for each measure.
    pub(super) fn table(&self) -> Vec<Vec<String>> {
        type Cell = fn(&Compared) -> String;
        let unit = match self.unit.as_str() {
            "" => String::new(),
            unit => format!(" [{unit}]"),
        };
        let rows: &[(&str, bool, Cell)] = &[
            ("triangles", false, |m| m.triangles.to_string()),
            ("bytes", false, |m| m.bytes.to_string()),
            ("chord, proven", true, |m| of_made(m, |made| made.proven)),
            ("chord, sampled", true, |m| of_made(m, |made| made.sampled)),
            ("chord, RMS", true, |m| of_made(m, |made| made.rms)),
            ("Hausdorff, proven", true, |m| short(m.bound())),
            ("surface to mesh, found", true, |m| {
                short(m.deviation.surface_to_mesh.found)
            }),
            ("mesh to surface, found", true, |m| {
                short(m.deviation.mesh_to_surface.found)
            }),
            ("distance, RMS", true, |m| {
                let found = m.deviation.distance;
                found.map_or_else(|| UNMEASURED.to_owned(), |found| short(found.rms))
            }),
            ("normals, flat, max / 95 % / mean [deg]", false, |m| {
                angles(m.deviation.flat_normals)
            }),
            ("normals, smooth, max / 95 % / mean [deg]", false, |m| {
                angles(m.deviation.smooth_normals)
            }),
            ("silhouette pixels, 1 / 16 rays", false, |m| {
                format!(
                    "{} / {}",
                    m.image.silhouette_pixels, m.image.silhouette_pixels_16
                )
            }),
            ("silhouette, largest distance [px]", false, |m| {
                short(m.image.silhouette_distance)
            }),
            ("depth, max / 99 %", true, |m| pair(m.image.depth)),
            ("position, max / 99 %", true, |m| pair(m.image.position)),
            ("PSNR, sRGB / linear [dB]", false, |m| {
                format!("{:.2} / {:.2}", m.image.psnr, m.image.psnr_linear)
            }),
            ("SSIM", false, |m| format!("{:.5}", m.image.ssim)),
            ("FLIP", false, |m| format!("{:.5}", m.image.flip)),
            ("made, built, rendered [s]", false, |m| {
                let made = m.made.map_or(0.0, |made| made.took.as_secs_f64());
                format!(
                    "{made:.2}, {:.2}, {:.2}",
                    m.build.as_secs_f64(),
                    m.render.as_secs_f64()
                )
            }),
        ];
        let mut table = vec![vec![String::new()]];
        table[0].extend(self.meshes.iter().map(|m| m.name.clone()));
        for (name, length, cell) in rows {
            let unit = if *length { unit.as_str() } else { "" };
            let mut row = vec![format!("{name}{unit}")];
            row.extend(self.meshes.iter().map(cell));
            table.push(row);
        }
        table
    }

    /// What the exact picture costs, and what a mesh with the same outline does.
    pub(super) fn equal_silhouette(&self) -> String {
        let exact = self.build.as_secs_f64() + self.render.as_secs_f64();
        let equal = self
            .meshes
            .iter()
            .filter(|m| m.image.silhouette_pixels == 0);
        let quickest = equal.min_by(|a, b| a.time().total_cmp(&b.time()));
        let start = format!("The exact picture took {exact:.2} s (build and render)");
        match quickest {
            Some(mesh) => format!(
                "{start}; with an equal silhouette, {} took {:.2} s and {} triangles.",
                mesh.name,
                mesh.time(),
                mesh.triangles
            ),
            None => {
                let nearest = self.meshes.iter().min_by_key(|m| m.image.silhouette_pixels);
                nearest.map_or_else(String::new, |mesh| {
                    format!(
                        "{start}; no mesh has an equal silhouette: {} took {:.2} s, and {} pixels \
                         differ.",
                        mesh.name,
                        mesh.time(),
                        mesh.image.silhouette_pixels
                    )
                })
            }
        }
    }

    /// A summary for a pull request.
    pub fn markdown(&self) -> String {
        let mut text = format!(
            "## {}: exact against tessellated\n\n{} patches, size {} {}\n\n",
            self.source,
            self.patches,
            short(self.size),
            self.unit
        );
        // Writing into a string cannot fail.
        for (k, row) in self.table().iter().enumerate() {
            let cells: Vec<String> = row.iter().map(|cell| cell.replace('|', "\\|")).collect();
            let _ = writeln!(text, "| {} |", cells.join(" | "));
            if k == 0 {
                let _ = writeln!(text, "|---|{}", "---:|".repeat(row.len() - 1));
            }
        }
        let _ = writeln!(text, "\n{}", self.equal_silhouette());
        for mesh in &self.meshes {
            let _ = writeln!(text, "\n**{}**\n", mesh.name);
            for line in mesh.sentences() {
                let _ = writeln!(text, "- {line}");
            }
        }
        text
    }
}

fn of_made(mesh: &Compared, get: fn(&super::Made) -> f64) -> String {
    mesh.made
        .as_ref()
        .map_or_else(|| "-".to_owned(), |made| short(get(made)))
}

fn angles(found: Option<Statistics>) -> String {
    found.map_or_else(
        || UNMEASURED.to_owned(),
        |s| format!("{:.2} / {:.2} / {:.2}", s.max, s.p95, s.mean),
    )
}

fn pair(found: Option<[f64; 2]>) -> String {
    found.map_or_else(
        || "no pixel shows both".to_owned(),
        |[a, b]| format!("{} / {}", short(a), short(b)),
    )
}

/// A place in words.
pub(super) fn sentence(place: &Worst) -> String {
    let [x, y, z] = place.from.to_array().map(short);
    format!(
        "{} at ({x}, {y}, {z}), patch {} at u = {}, v = {}, triangle {}",
        short(place.distance),
        place.patch,
        short(place.uv.x),
        short(place.uv.y),
        place.triangle
    )
}

impl Compared {
    /// Faults, fit, worst places and warnings, a sentence each.
    pub(super) fn sentences(&self) -> Vec<String> {
        let mut lines = Vec::new();
        if self.unmeasured > 0 {
            lines.push(format!(
                "{} of its triangles are meshes of the exact file, which are not measured",
                self.unmeasured
            ));
        }
        for fault in &self.faults {
            let at = fault.place.map_or_else(String::new, |p| {
                let [x, y, z] = p.to_array().map(short);
                format!(" (at {x}, {y}, {z})")
            });
            lines.push(format!("**{}**: {}{at}", fault.kind.name(), fault.text));
        }
        if let Some(fit) = self.fit {
            let (axis, angle) =
                glam::DQuat::from_mat3(&fit.scene_from_mesh.matrix3).to_axis_angle();
            let way = fit.scene_from_mesh.translation;
            lines.push(format!(
                "fitted: turned by {:.4} degrees about ({:.3}, {:.3}, {:.3}), moved by ({}, {}, \
                 {}); RMS distance {} before, {} after",
                angle.to_degrees(),
                axis.x,
                axis.y,
                axis.z,
                short(way.x),
                short(way.y),
                short(way.z),
                short(fit.before),
                short(fit.residual)
            ));
        }
        let ways = [
            (
                "surface farthest from the mesh",
                &self.deviation.surface_to_mesh,
            ),
            (
                "mesh farthest from the surface",
                &self.deviation.mesh_to_surface,
            ),
        ];
        for (what, way) in ways {
            if let Some(place) = way.worst.first() {
                lines.push(format!("{what}: {}", sentence(place)));
            }
        }
        for warning in self.warnings.as_slice() {
            lines.push(format!(
                "warning: {} ({} times)",
                warning.problem, warning.count
            ));
        }
        lines
    }
}
