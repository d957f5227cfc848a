//! DICOM RT Structure Sets (PS3.3, A.19): contours of regions of interest.
//!
//! Coordinates are those of the patient in millimetres: x to the left, y to the back, z upwards.

use std::collections::BTreeMap;

use glam::DVec3;
use kernel::{Unit, linear_from_srgb};

use super::{Budget, Layer, PointBody, PointFormat, PointSet};
use crate::obj::statements::number;
use crate::{Error, Limits, Place, Problem};

mod elements;
mod write;

use elements::{Element, Elements, Tag};

pub(super) const FORMAT: PointFormat = PointFormat {
    name: "DICOM",
    extensions: &["dcm"],
    sniff: elements::sniff,
    read,
    write: Some(write::write),
};

/// RT Structure Set Storage.
const CLASS: &str = "1.2.840.10008.5.1.4.1.1.481.3";

const CHARACTER_SET: Tag = 0x0008_0005;
const SOP_CLASS: Tag = 0x0008_0016;
const SOP_INSTANCE: Tag = 0x0008_0018;
const MODALITY: Tag = 0x0008_0060;
const FRAME_OF_REFERENCE: Tag = 0x0020_0052;
const ROI_SEQUENCE: Tag = 0x3006_0020;
const ROI_NUMBER: Tag = 0x3006_0022;
const ROI_NAME: Tag = 0x3006_0026;
const ROI_COLOR: Tag = 0x3006_002a;
const ROI_CONTOURS: Tag = 0x3006_0039;
const CONTOURS: Tag = 0x3006_0040;
const CONTOUR_TYPE: Tag = 0x3006_0042;
const CONTOUR_COUNT: Tag = 0x3006_0046;
const CONTOUR_DATA: Tag = 0x3006_0050;
const REFERENCED_ROI: Tag = 0x3006_0084;

fn read(bytes: &[u8], limits: &Limits) -> Result<PointSet, Error> {
    let invalid = |text: String| FORMAT.invalid(Place::default(), text);
    let (bytes, is_explicit) = elements::data_set(bytes, limits.bytes).map_err(invalid)?;
    let wanted = [ROI_SEQUENCE, ROI_CONTOURS, CONTOURS];
    let all = elements::read(&bytes, is_explicit, &wanted, limits.entities).map_err(invalid)?;
    let class = text(&all, SOP_CLASS, true);
    if class != CLASS {
        let modality = text(&all, MODALITY, true);
        let found = if modality.is_empty() { class } else { modality };
        let text = format!("the file holds '{found}'; contours are in RT Structure Sets");
        return Err(FORMAT.error(Place::default(), Problem::Unsupported(text)));
    }
    let mut set = PointSet {
        unit: Unit::named("mm"),
        ..PointSet::default()
    };
    let is_utf8 = text(&all, CHARACTER_SET, true).contains("192");
    let mut budget = Budget::new(limits);
    let mut contours: BTreeMap<String, Vec<&[Element<'_>]>> = BTreeMap::new();
    for item in all.items(ROI_CONTOURS) {
        let number = text(item, REFERENCED_ROI, true);
        contours.entry(number).or_default().push(item);
    }
    for roi in all.items(ROI_SEQUENCE) {
        let number = text(roi, ROI_NUMBER, true);
        let name = text(roi, ROI_NAME, is_utf8);
        let what = format!("ROI {number} \"{name}\"");
        let own = contours.remove(&number).unwrap_or_default();
        let mut body = PointBody {
            name,
            ..PointBody::default()
        };
        let mut markers = 0;
        for item in own {
            body.color = color(item);
            for (k, contour) in (1..).zip(item.items(CONTOURS)) {
                let place = Place::item(0, format!("{what}, contour {k}"));
                match layer(contour, &place, &mut budget, &mut set)? {
                    Some(layer) => body.layers.push(layer),
                    None => markers += 1,
                }
            }
        }
        if markers > 0 {
            let place = Place::item(0, what.clone());
            set.warnings
                .unsupported(place, "points that are no contours are not used");
        } else if body.layers.is_empty() {
            set.warnings
                .invalid(Place::item(0, what), "the ROI has no contours");
        }
        if !body.layers.is_empty() {
            sort(&mut body.layers);
            set.bodies.push(body);
        }
    }
    for number in contours.keys() {
        let place = Place::item(0, format!("contours of ROI {number}"));
        let text = "there is no ROI of this number; they are not used";
        set.warnings.invalid(place, text);
    }
    Ok(set)
}

/// A contour; `None` for a point.
fn layer(
    contour: &[Element<'_>],
    place: &Place,
    budget: &mut Budget<'_>,
    set: &mut PointSet,
) -> Result<Option<Layer>, Error> {
    let kind = text(contour, CONTOUR_TYPE, true);
    let is_closed = match kind.as_str() {
        "CLOSED_PLANAR" | "CLOSEDPLANAR_XOR" => true,
        "OPEN_PLANAR" | "OPEN_NONPLANAR" => false,
        "POINT" => return Ok(None),
        other => {
            let text = format!("'{other}' is no kind of contour");
            return Err(FORMAT.invalid(place.clone(), text));
        }
    };
    let data = text(contour, CONTOUR_DATA, true);
    let count = data.split('\\').count();
    let refused = |problem| FORMAT.error(place.clone(), problem);
    budget.take(count / 3).map_err(refused)?;
    let numbers: Result<Vec<f64>, String> = data.split('\\').map(|x| number(x.trim())).collect();
    let numbers = numbers.map_err(|text| FORMAT.invalid(place.clone(), text))?;
    if !count.is_multiple_of(3) {
        let text = format!("{count} coordinates; they come in threes");
        return Err(FORMAT.invalid(place.clone(), text));
    }
    let points: Vec<DVec3> = numbers.chunks_exact(3).map(DVec3::from_slice).collect();
    let announced = text(contour, CONTOUR_COUNT, true);
    if !announced.is_empty() && announced != points.len().to_string() {
        let text = format!(
            "{announced} points are announced and {} are there",
            points.len()
        );
        set.warnings.invalid(place.clone(), text);
    }
    Ok(Some(Layer {
        place: place.clone(),
        points,
        lines: Vec::new(),
        is_closed: Some(is_closed),
    }))
}

/// Puts contours in the order of their planes: files have them in any.
fn sort(layers: &mut [Layer]) {
    let middle = |layer: &Layer| layer.points.iter().sum::<DVec3>() / layer.points.len() as f64;
    let area = |layer: &Layer| {
        let first = layer.points[0];
        let turns = layer
            .points
            .windows(2)
            .map(|w| (w[0] - first).cross(w[1] - first));
        let area: DVec3 = turns.sum();
        let axis = area.abs().max_position();
        if area[axis] < 0.0 { -area } else { area }
    };
    let normal = layers.iter().map(area).sum::<DVec3>();
    layers.sort_by(|a, b| middle(a).dot(normal).total_cmp(&middle(b).dot(normal)));
}

/// The text of an element, or nothing.
fn text(elements: &[Element<'_>], tag: Tag, is_utf8: bool) -> String {
    let bytes = elements.bytes(tag).unwrap_or_default();
    let text = match std::str::from_utf8(bytes) {
        Ok(text) if is_utf8 || text.is_ascii() => text.to_owned(),
        // Latin 1, the most usual of the others.
        _ => bytes.iter().map(|&b| char::from(b)).collect(),
    };
    text.trim().to_owned()
}

/// The colour in which a region is shown, as sRGB.
fn color(item: &[Element<'_>]) -> Option<DVec3> {
    let text = text(item, ROI_COLOR, true);
    let parts: Option<Vec<f64>> = text
        .split('\\')
        .map(|part| part.trim().parse::<u8>().ok().map(|c| f64::from(c) / 255.0))
        .collect();
    let parts = <[f64; 3]>::try_from(parts?).ok()?;
    Some(linear_from_srgb(parts.into()))
}
