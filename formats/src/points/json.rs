//! Points in JSON: `{"unit": "mm", "bodies": [{"name": ..., "color": [r, g, b], "layers":
//! [[[x, y, z], ...], ...]}]}`, one such body, or the layers alone.

use glam::DVec3;
use kernel::{Unit, linear_from_srgb};
use serde_json::Value;

use super::{Budget, Layer, PointBody, PointFormat, PointSet};
use crate::{Error, Export, Limits, Place, Problem, Warnings};

pub(super) const FORMAT: PointFormat = PointFormat {
    name: "JSON",
    extensions: &["json"],
    sniff: |bytes| matches!(bytes.trim_ascii_start().first(), Some(b'{' | b'[')),
    read,
    write: Some(write),
};

fn read(bytes: &[u8], limits: &Limits) -> Result<PointSet, Error> {
    let value: Value = serde_json::from_slice(bytes).map_err(|error| {
        let text = error.to_string();
        let text = text.split(" at line ").next().unwrap_or_default();
        FORMAT.invalid(Place::line(error.line()), text)
    })?;
    let mut budget = Budget::new(limits);
    let mut set = PointSet::default();
    let list = match &value {
        Value::Object(fields) => fields.get("bodies"),
        _ => None,
    };
    match list {
        Some(Value::Array(list)) => {
            for (number, value) in (1..).zip(list) {
                let name = format!("body {number}");
                let body = body(value, &name, &mut budget, &mut set.warnings)?;
                set.bodies.push(body);
            }
        }
        Some(_) => return Err(FORMAT.invalid(Place::default(), "'bodies' is not a list")),
        None => {
            let body = body(&value, "", &mut budget, &mut set.warnings)?;
            set.bodies.push(body);
        }
    }
    if let Some(name) = value.get("unit").and_then(Value::as_str) {
        set.unit = Unit::named(name);
        if set.unit.is_none() {
            let known = Unit::KNOWN.map(|(known, _)| known).join(", ");
            let text = format!("the unit '{name}' is not known; use one of {known}");
            set.warnings.unsupported(Place::default(), text);
        }
    }
    Ok(set)
}

/// A body: an object with layers, or the layers themselves.
fn body(
    value: &Value,
    what: &str,
    budget: &mut Budget<'_>,
    warnings: &mut Warnings,
) -> Result<PointBody, Error> {
    let name = value.get("name").and_then(Value::as_str).unwrap_or("");
    let what = if name.is_empty() {
        what.to_owned()
    } else {
        format!("\"{name}\"")
    };
    let layers = match value {
        Value::Object(_) => value.get("layers").or_else(|| value.get("grid")),
        list => Some(list),
    };
    let Some(Value::Array(layers)) = layers else {
        return Err(FORMAT.invalid(Place::item(0, what), "there is no list of layers"));
    };
    let told = value.get("color");
    let found = told.and_then(color);
    if let (Some(told), None) = (told, found) {
        let text = format!("the color is {told}; it is three numbers from 0 to 1");
        warnings.invalid(Place::item(0, what.clone()), text);
    }
    let mut body = PointBody {
        name: name.to_owned(),
        color: found,
        ..PointBody::default()
    };
    for (number, points) in (1..).zip(layers) {
        let comma = if what.is_empty() { "" } else { ", " };
        let place = Place::item(0, format!("{what}{comma}layer {number}"));
        let Value::Array(points) = points else {
            return Err(FORMAT.invalid(place, "a layer is a list of points"));
        };
        budget
            .take(points.len())
            .map_err(|problem: Problem| FORMAT.error(place.clone(), problem))?;
        let mut layer = Layer {
            place: place.clone(),
            ..Layer::default()
        };
        for (index, value) in (1..).zip(points) {
            let found = point(value).ok_or_else(|| {
                let text = format!("point {index} is {value}; a point is [x, y, z]");
                FORMAT.invalid(place.clone(), text)
            });
            layer.points.push(found?);
        }
        body.layers.push(layer);
    }
    Ok(body)
}

fn point(value: &Value) -> Option<DVec3> {
    let numbers: Option<Vec<f64>> = value.as_array()?.iter().map(Value::as_f64).collect();
    let [x, y, z] = <[f64; 3]>::try_from(numbers?).ok()?;
    let point = DVec3::new(x, y, z);
    point.is_finite().then_some(point)
}

/// A colour of three numbers from 0 to 1, as sRGB.
fn color(value: &Value) -> Option<DVec3> {
    let color = point(value)?;
    let is_inside = color.min_element() >= 0.0 && color.max_element() <= 1.0;
    is_inside.then(|| linear_from_srgb(color))
}

fn write(set: &PointSet) -> Export {
    let body = |body: &PointBody| {
        let layer = |layer: &Layer| -> Value {
            let points = layer.points.iter();
            points.map(|p| p.to_array().to_vec()).collect()
        };
        let layers: Vec<Value> = body.layers.iter().map(layer).collect();
        let mut value = serde_json::json!({ "name": body.name, "layers": layers });
        if let Some(color) = body.color {
            value["color"] = kernel::srgb_from_linear(color).to_array().to_vec().into();
        }
        value
    };
    let bodies: Vec<Value> = set.bodies.iter().map(body).collect();
    let mut value = serde_json::json!({ "bodies": bodies });
    if let Some(unit) = &set.unit {
        value["unit"] = unit.name.clone().into();
    }
    set.export(format!("{value}\n").into_bytes())
}
