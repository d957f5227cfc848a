//! The report as one page that needs nothing else: pictures, numbers and mesh are in it.

use std::fmt::Write as _;
use std::{fs, io};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::plot::{Series, plot};
use super::text::{sentence, short};
use super::{Compared, PICTURES, Report, Solid};
use crate::html::escaped;

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

impl Report {
    /// The page.
    pub(super) fn page(&self) -> io::Result<String> {
        let lead = format!(
            "Exact against tessellated: {} patches, size {} {}; pictures of {} x {} pixels.",
            self.patches,
            short(self.size),
            self.unit,
            self.picture[0],
            self.picture[1]
        );
        // Nothing in a text of the page may end the script that holds it.
        let data = self.data()?.to_string().replace('<', "\\u003c");
        let parts = [
            ("{{css}}", STYLE.to_owned()),
            ("{{js}}", SCRIPT.to_owned()),
            ("{{title}}", escaped(&self.source)),
            ("{{lead}}", escaped(&lead)),
            ("{{findings}}", self.findings()),
            ("{{table}}", self.html_table()),
            ("{{silhouette}}", escaped(&self.equal_silhouette())),
            ("{{plots}}", self.plots()),
            ("{{data}}", data),
        ];
        // In one pass, so that nothing that was put in is taken for a place.
        let mut page = String::new();
        let mut rest = PAGE;
        while let Some(at) = rest.find("{{") {
            page += &rest[..at];
            rest = &rest[at..];
            let part = parts.iter().find(|(name, _)| rest.starts_with(name));
            let (name, text) = part.map_or(("{{", "{{"), |(name, text)| (name, text));
            page += text;
            rest = &rest[name.len()..];
        }
        Ok(page + rest)
    }

    /// What the script shows.
    fn data(&self) -> io::Result<Value> {
        let mut meshes = Vec::new();
        for (mesh, number) in self.meshes.iter().zip(1..) {
            let picture = |name: &str| self.picture(&format!("mesh{number}-{name}.png"));
            let mut pictures = serde_json::Map::new();
            for (name, _) in PICTURES {
                pictures.insert((*name).to_owned(), picture(name)?.into());
            }
            let mut crops = Vec::new();
            for ((place, extent), k) in mesh.worst().iter().zip(&mesh.crops).zip(1..) {
                crops.push(json!({
                    "text": format!("{}; {} {} across", sentence(place), short(*extent), self.unit),
                    "exact": picture(&format!("crop{k}-exact"))?,
                    "mesh": picture(&format!("crop{k}-mesh"))?,
                }));
            }
            meshes.push(json!({
                "name": mesh.name,
                "pictures": pictures,
                "crops": crops,
                "solid": mesh.solid.as_ref().filter(|s| !s.triangles.is_empty()).map(Solid::json),
            }));
        }
        Ok(json!({
            "exact": self.picture("exact.png")?,
            "up": if self.z_up { "Z" } else { "Y" },
            "views": PICTURES,
            "meshes": meshes,
        }))
    }

    fn picture(&self, name: &str) -> io::Result<String> {
        Ok(STANDARD.encode(fs::read(self.folder.join(name))?))
    }

    fn findings(&self) -> String {
        let mut html = String::new();
        // Writing into a string cannot fail.
        for mesh in &self.meshes {
            let _ = write!(html, "<h3>{}</h3><ul>", escaped(&mesh.name));
            for (k, line) in mesh.sentences().iter().enumerate() {
                let class = if k < mesh.faults.len() {
                    " class=\"fault\""
                } else {
                    ""
                };
                let _ = write!(html, "<li{class}>{}</li>", escaped(&line.replace("**", "")));
            }
            html += "</ul>";
        }
        html
    }

    fn html_table(&self) -> String {
        let mut html = String::from("<table>");
        for (k, row) in self.table().iter().enumerate() {
            html += "<tr>";
            for (j, cell) in row.iter().enumerate() {
                let tag = if k == 0 || j == 0 { "th" } else { "td" };
                let _ = write!(html, "<{tag}>{}</{tag}>", escaped(cell));
            }
            html += "</tr>";
        }
        html + "</table>"
    }

    /// Error against triangles, against bytes, and what is seen of it.
    fn plots(&self) -> String {
        let series = |name, color, x: fn(&Compared) -> f64, y: fn(&Compared) -> f64| {
            let mut points: Vec<[f64; 2]> = self.meshes.iter().map(|m| [x(m), y(m)]).collect();
            points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            Series {
                name,
                color,
                points,
            }
        };
        let triangles: fn(&Compared) -> f64 = |m| m.triangles as f64;
        let bytes: fn(&Compared) -> f64 = |m| m.bytes as f64;
        let lengths = |x: fn(&Compared) -> f64| {
            [
                series("proven", "#0b62c4", x, Compared::bound),
                series("found", "#b3261e", x, |m| m.deviation.found()),
                series("RMS", "#2e7d32", x, |m| {
                    m.deviation.distance.map_or(f64::INFINITY, |d| d.rms)
                }),
            ]
        };
        let pixels = [
            series("1 ray", "#b3261e", triangles, |m| {
                m.image.silhouette_pixels as f64
            }),
            series("16 rays", "#0b62c4", triangles, |m| {
                m.image.silhouette_pixels_16 as f64
            }),
        ];
        plot("Hausdorff distance", "triangles", &lengths(triangles))
            + &plot("Hausdorff distance", "bytes", &lengths(bytes))
            + &plot("Silhouette pixels", "triangles", &pixels)
            + &plot(
                "FLIP",
                "triangles",
                &[series("mean", "#6a1b9a", triangles, |m| m.image.flip)],
            )
    }
}

impl Solid {
    fn json(&self) -> Value {
        // Four numbers for each point, as graphics hardware likes them.
        let points: Vec<u8> = self
            .points
            .iter()
            .flat_map(|&[x, y, z]| [x, y, z, 0])
            .flat_map(u16::to_le_bytes)
            .collect();
        let indices: Vec<u8> = self
            .triangles
            .iter()
            .flatten()
            .flat_map(|k| k.to_le_bytes())
            .collect();
        json!({
            "size": self.size,
            "count": 3 * self.triangles.len(),
            "points": STANDARD.encode(points),
            "shades": STANDARD.encode(&self.shades),
            "triangles": STANDARD.encode(indices),
        })
    }
}
