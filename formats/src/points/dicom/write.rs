//! RT Structure Sets, in implicit little endian.

use std::fmt::Write as _;

use glam::DVec3;
use kernel::srgb_from_linear;

use super::{
    CHARACTER_SET, CLASS, CONTOUR_COUNT, CONTOUR_DATA, CONTOUR_TYPE, CONTOURS, FRAME_OF_REFERENCE,
    MODALITY, REFERENCED_ROI, ROI_COLOR, ROI_CONTOURS, ROI_NAME, ROI_NUMBER, ROI_SEQUENCE,
    SOP_CLASS, SOP_INSTANCE, Tag,
};
use crate::points::{Layer, PointSet};
use crate::{Export, Place};

/// Most characters of a number.
const DIGITS: usize = 16;

/// Points as a structure set: lengths in millimetres if the set has a unit, else as they are.
///
/// Numbers have at most 16 characters, as the standard wants. The same points give the same
/// bytes: identifiers are made from them, and there are no dates.
pub(super) fn write(set: &PointSet) -> Export {
    let millimetres = set.unit.as_ref().map_or(1.0, |unit| unit.metres * 1e3);
    let (mut rois, mut contours, mut observations) = (Vec::new(), Vec::new(), Vec::new());
    let mut names = String::new();
    for (number, body) in (1..).zip(&set.bodies) {
        let number = format!("{number}");
        let _ = writeln!(names, "{}", body.name);
        let layers = body.layers.iter().map(|layer| contour(layer, millimetres));
        let layers = sequence(CONTOURS, &layers.collect::<Vec<_>>());
        let color = body.color.map_or(Vec::new(), |color| {
            let parts = (srgb_from_linear(color) * 255.0).round();
            let text = format!("{}\\{}\\{}", parts.x, parts.y, parts.z);
            element(ROI_COLOR, &text)
        });
        contours.push([color, layers, element(REFERENCED_ROI, &number)].concat());
        observations.push(
            [
                element(0x3006_0082, &number),
                element(REFERENCED_ROI, &number),
                element(0x3006_00a4, ""),
                element(0x3006_00a6, ""),
            ]
            .concat(),
        );
        rois.push((number, body.name.clone()));
    }
    let contours = sequence(ROI_CONTOURS, &contours);
    let identifier = |kind: u8| {
        let seed = names.bytes().chain([kind]).chain(contours.iter().copied());
        format!("2.25.{}", hash(seed))
    };
    let [instance, study, series, frame] = [1, 2, 3, 4].map(identifier);
    let roi = |(number, name): &(String, String)| {
        [
            element(ROI_NUMBER, number),
            element(0x3006_0024, &frame),
            element(ROI_NAME, &name.replace('\\', " ")),
            element(0x3006_0036, ""),
        ]
        .concat()
    };
    let data = [
        element(CHARACTER_SET, "ISO_IR 192"),
        element(SOP_CLASS, CLASS),
        element(SOP_INSTANCE, &instance),
        element(0x0008_0020, ""),
        element(0x0008_0030, ""),
        element(0x0008_0050, ""),
        element(MODALITY, "RTSTRUCT"),
        element(0x0008_0070, "nurbray"),
        element(0x0008_0090, ""),
        element(0x0010_0010, "synthetic"),
        element(0x0010_0020, ""),
        element(0x0010_0030, ""),
        element(0x0010_0040, ""),
        element(0x0020_000d, &study),
        element(0x0020_000e, &series),
        element(0x0020_0010, ""),
        element(0x0020_0011, ""),
        element(FRAME_OF_REFERENCE, &frame),
        element(0x0020_1040, ""),
        element(0x3006_0002, "nurbray"),
        element(0x3006_0008, ""),
        element(0x3006_0009, ""),
        sequence(ROI_SEQUENCE, &rois.iter().map(roi).collect::<Vec<_>>()),
        contours,
        sequence(0x3006_0080, &observations),
        element(0x300e_0002, "UNAPPROVED"),
    ];
    let mut export = set.export([head(&instance), data.concat()].concat());
    if set.unit.is_none() {
        let text = "structure sets are in millimetres and the points have no unit of length; \
            their numbers are written as millimetres";
        export.warnings.unsupported(Place::default(), text);
    }
    export
}

/// A closed contour.
fn contour(layer: &Layer, millimetres: f64) -> Vec<u8> {
    let mut data = String::new();
    let numbers = layer.points.iter().flat_map(|p: &DVec3| p.to_array());
    for (k, x) in numbers.enumerate() {
        if k > 0 {
            data.push('\\');
        }
        data.push_str(&decimal(x * millimetres));
    }
    let is_open = layer.is_closed == Some(false);
    let kind = if is_open {
        "OPEN_PLANAR"
    } else {
        "CLOSED_PLANAR"
    };
    [
        element(CONTOUR_TYPE, kind),
        element(CONTOUR_COUNT, &layer.points.len().to_string()),
        element(CONTOUR_DATA, &data),
    ]
    .concat()
}

/// A number with as many digits as there is room for.
fn decimal(x: f64) -> String {
    let plain = format!("{x}");
    if plain.len() <= DIGITS {
        return plain;
    }
    let shorter = (0..DIGITS)
        .rev()
        .flat_map(|digits| [format!("{x:.digits$}"), format!("{x:.digits$e}")]);
    shorter
        .filter(|text| text.len() <= DIGITS)
        .min_by(|a, b| {
            let off = |text: &str| text.parse().map_or(f64::INFINITY, |y: f64| (x - y).abs());
            off(a).total_cmp(&off(b))
        })
        .unwrap_or(plain)
}

/// Preamble, mark and meta elements, which are always explicit.
fn head(instance: &str) -> Vec<u8> {
    let short = |element: u16, kind: &[u8; 2], mut value: Vec<u8>, pad: u8| {
        if value.len() % 2 == 1 {
            value.push(pad);
        }
        let length = u16::try_from(value.len()).unwrap_or(u16::MAX);
        let [e0, e1] = element.to_le_bytes();
        let [l0, l1] = length.to_le_bytes();
        let start = [0x02, 0x00, e0, e1, kind[0], kind[1], l0, l1];
        [start.to_vec(), value].concat()
    };
    let uid = |element: u16, text: &str| short(element, b"UI", text.as_bytes().to_vec(), 0);
    let rest = [
        // The version, of a kind with long lengths.
        vec![0x02, 0x00, 0x01, 0x00, b'O', b'B', 0, 0, 2, 0, 0, 0, 0, 1],
        uid(0x0002, CLASS),
        uid(0x0003, instance),
        uid(0x0010, "1.2.840.10008.1.2"),
        uid(
            0x0012,
            &format!("2.25.{}", hash(b"nurbray".iter().copied())),
        ),
    ]
    .concat();
    let length = u32::try_from(rest.len()).unwrap_or(u32::MAX);
    let length = short(0x0000, b"UL", length.to_le_bytes().to_vec(), 0);
    [vec![0; 128], b"DICM".to_vec(), length, rest].concat()
}

fn bytes(tag: Tag, value: &[u8]) -> Vec<u8> {
    let [g0, g1, e0, e1] = [tag >> 16 & 0xff, tag >> 24, tag & 0xff, tag >> 8 & 0xff]
        .map(|byte| u8::try_from(byte).unwrap_or(0));
    let length = u32::try_from(value.len()).unwrap_or(u32::MAX - 1);
    [&[g0, g1, e0, e1], &length.to_le_bytes()[..], value].concat()
}

/// An element of text; identifiers are filled up with a zero, others with a blank.
fn element(tag: Tag, text: &str) -> Vec<u8> {
    let mut value = text.as_bytes().to_vec();
    if value.len() % 2 == 1 {
        let is_identifier =
            text.bytes().all(|b| b == b'.' || b.is_ascii_digit()) && text.contains('.');
        let is_number = tag >> 16 == 0x3006 && tag != 0x3006_0024;
        value.push(if is_identifier && !is_number { 0 } else { b' ' });
    }
    bytes(tag, &value)
}

fn sequence(tag: Tag, items: &[Vec<u8>]) -> Vec<u8> {
    let items: Vec<u8> = items
        .iter()
        .flat_map(|item| bytes(0xfffe_e000, item))
        .collect();
    bytes(tag, &items)
}

/// FNV-1a.
fn hash(bytes: impl IntoIterator<Item = u8>) -> u128 {
    let start: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    let prime: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;
    bytes.into_iter().fold(start, |hash, byte| {
        (hash ^ u128::from(byte)).wrapping_mul(prime)
    })
}
