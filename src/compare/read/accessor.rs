//! The numbers of glTF files: accessors, views and buffers, checked against the bytes that are
//! there.

use formats::{Error, Limits, Problem};
use serde_json::Value;

use super::error;
use super::gltf::{NAME, invalid, list, size};

/// What accessors refer to.
pub(super) struct Numbers<'a> {
    pub(super) root: &'a Value,
    pub(super) buffers: Vec<Vec<u8>>,
    pub(super) limits: &'a Limits,
}

impl Numbers<'_> {
    /// The numbers of an accessor that has `width` of them in each element.
    pub(super) fn of(&self, index: &Value, width: usize, place: &str) -> Result<Vec<f64>, Error> {
        let number = index.as_u64().and_then(|k| usize::try_from(k).ok());
        let accessor = number.and_then(|k| list(self.root, "accessors").get(k));
        let Some(accessor) = accessor else {
            return Err(invalid(place, format!("accessor {index} is not there")));
        };
        let place = format!("{place}, accessor {index}");
        let kinds = ["SCALAR", "VEC2", "VEC3", "VEC4"];
        let found = kinds
            .iter()
            .position(|k| accessor["type"].as_str() == Some(k));
        if found != Some(width - 1) {
            let text = format!("its type is {}, not {}", accessor["type"], kinds[width - 1]);
            return Err(invalid(place, text));
        }
        let count = size(&accessor["count"]).ok_or_else(|| invalid(&place, "no count"))?;
        let kind = Component::of(&accessor["componentType"]).ok_or_else(|| {
            invalid(
                &place,
                format!("componentType {}", accessor["componentType"]),
            )
        })?;
        let normalized = accessor["normalized"].as_bool() == Some(true);
        let sparse = &accessor["sparse"];
        let mut values = if accessor["bufferView"].is_null() && sparse.is_object() {
            if count > self.limits.points {
                let text = format!("{count} elements; the limit is {}", self.limits.points);
                return Err(error(NAME, place, Problem::TooLarge(text)));
            }
            vec![0.0; count * width]
        } else {
            self.elements(accessor, count, width, kind, normalized, &place)?
        };
        if sparse.is_object() {
            let few = size(&sparse["count"]).ok_or_else(|| invalid(&place, "no sparse count"))?;
            let index =
                Component::of(&sparse["indices"]["componentType"]).unwrap_or(Component::U32);
            let at = self.elements(&sparse["indices"], few, 1, index, false, &place)?;
            let new = self.elements(&sparse["values"], few, width, kind, normalized, &place)?;
            for (at, new) in at.into_iter().zip(new.chunks_exact(width)) {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "what is no element is not found"
                )]
                let first = (at as usize).saturating_mul(width);
                let old = values
                    .get_mut(first..)
                    .and_then(|rest| rest.get_mut(..width));
                let old = old.ok_or_else(|| invalid(&place, format!("sparse element {at}")))?;
                old.copy_from_slice(new);
            }
        }
        Ok(values)
    }

    /// Numbers from a view of a buffer; `place_in` names the view and the first byte.
    fn elements(
        &self,
        place_in: &Value,
        count: usize,
        width: usize,
        kind: Component,
        normalized: bool,
        place: &str,
    ) -> Result<Vec<f64>, Error> {
        let view =
            size(&place_in["bufferView"]).and_then(|k| list(self.root, "bufferViews").get(k));
        let view = view.ok_or_else(|| invalid(place, "its bufferView is not there"))?;
        let buffer = size(&view["buffer"]).and_then(|k| self.buffers.get(k));
        let or_zero = |value: &Value| {
            if value.is_null() {
                Some(0)
            } else {
                size(value)
            }
        };
        let slice = || {
            let (start, length) = (or_zero(&view["byteOffset"])?, size(&view["byteLength"])?);
            let view = buffer?.get(start..)?.get(..length)?;
            view.get(or_zero(&place_in["byteOffset"])?..)
        };
        let bytes =
            slice().ok_or_else(|| invalid(place, "its bufferView leads out of the buffer"))?;
        let each = kind.bytes() * width;
        let stride = size(&view["byteStride"]).unwrap_or(each).max(1);
        let needed = match count.checked_sub(1) {
            None => Some(0),
            Some(steps) => steps.checked_mul(stride).and_then(|n| n.checked_add(each)),
        };
        if needed.is_none_or(|needed| needed > bytes.len()) {
            let text = format!("{count} elements do not fit into {} bytes", bytes.len());
            return Err(invalid(place, text));
        }
        let element = |k: usize| {
            let from = &bytes[k * stride..k * stride + each];
            from.chunks_exact(kind.bytes())
                .map(move |b| kind.value(b, normalized))
        };
        Ok((0..count).flat_map(element).collect())
    }
}

/// A type of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(value: &Value) -> Option<Self> {
        Some(match value.as_u64()? {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The number in its bytes; normalised ones are shares of the largest.
    fn value(self, b: &[u8], normalized: bool) -> f64 {
        let (value, most) = match self {
            Self::I8 => (f64::from(i8::from_le_bytes([b[0]])), f64::from(i8::MAX)),
            Self::U8 => (f64::from(b[0]), f64::from(u8::MAX)),
            Self::I16 => (
                f64::from(i16::from_le_bytes([b[0], b[1]])),
                f64::from(i16::MAX),
            ),
            Self::U16 => (
                f64::from(u16::from_le_bytes([b[0], b[1]])),
                f64::from(u16::MAX),
            ),
            Self::U32 => (f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])), 1.0),
            Self::F32 => (f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])), 1.0),
        };
        if normalized {
            (value / most).max(-1.0)
        } else {
            value
        }
    }
}
