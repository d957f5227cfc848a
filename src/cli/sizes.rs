//! What has been measured, for people and for machines.

use std::fmt::Write as _;

use nurbray::kernel::Unit;
use nurbray::{Body, Measure};
use serde_json::{Value, json};

use super::say::named;

/// A few lines about box, area and bodies.
pub(super) fn to_text(measure: &Measure, unit: Option<&Unit>) -> String {
    let unit = unit.map_or("", |unit| unit.name.as_str());
    let space = if unit.is_empty() { "" } else { " " };
    let power = |n: u8| match unit {
        "" => String::new(),
        unit => format!(" {unit}^{n}"),
    };
    let mut text = String::from("  measured\n");
    // Writing into a string cannot fail.
    if !measure.bounds.is_empty() {
        let (bounds, error) = (measure.bounds, measure.bounds_error);
        let _ = writeln!(
            text,
            "    box      {} to {}{space}{unit} (to {error:.1e})",
            bounds.min, bounds.max
        );
    }
    let (area, error) = (measure.area, measure.area_error);
    let _ = writeln!(text, "    area     {area:.12}{} (to {error:.1e})", power(2));
    let faces = measure.open_faces;
    if faces > 0 {
        let _ = writeln!(text, "    open     {faces} faces belong to no closed body");
    }
    if measure.meshes > 0 {
        let _ = writeln!(
            text,
            "    meshes   {} are in the box, but not measured",
            measure.meshes
        );
    }
    for body in &measure.bodies {
        let voids = voids(body);
        let name = named(&body.name);
        let turned = match body.turned {
            0 => String::new(),
            turned => format!(", {turned} of them with `du x dv` inwards"),
        };
        let _ = writeln!(
            text,
            "    body     {name}: {} faces{turned}{voids}, volume {:.12}{} (to {:.1e}), area {:.12}{} (to {:.1e})",
            body.faces,
            body.volume,
            power(3),
            body.volume_error,
            body.area,
            power(2),
            body.area_error
        );
    }
    text
}

/// How many voids a body has, to stand after what is said of its faces; nothing if there are none.
pub(super) fn voids(body: &Body) -> String {
    match body.voids {
        0 => String::new(),
        1 => ", 1 void".to_owned(),
        voids => format!(", {voids} voids"),
    }
}

/// The same with all numbers.
pub(super) fn to_json(measure: &Measure) -> Value {
    let bounds = (!measure.bounds.is_empty()).then(|| {
        json!({
            "min": measure.bounds.min.to_array(), "max": measure.bounds.max.to_array(),
            "error": measure.bounds_error,
        })
    });
    json!({
        "box": bounds,
        "area": measure.area,
        "area_error": measure.area_error,
        "open_faces": measure.open_faces,
        "meshes_not_measured": measure.meshes,
        "bodies": measure.bodies.iter().map(body).collect::<Vec<_>>(),
    })
}

/// A unit of length.
pub(super) fn unit(unit: &Unit) -> Value {
    json!({ "name": unit.name, "metres": unit.metres })
}

/// A body with all numbers.
pub(super) fn body(body: &Body) -> Value {
    json!({
        "name": body.name,
        "faces": body.faces,
        "faces_inside_out": body.turned,
        "voids": body.voids,
        "area": body.area,
        "area_error": body.area_error,
        "volume": body.volume,
        "volume_error": body.volume_error,
        "centroid": body.centroid.to_array(),
        "inertia": body.inertia.to_cols_array_2d(),
    })
}
