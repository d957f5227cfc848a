//! The numbers of glTF files: accessors, views and buffers, checked against the bytes that are
//! there before the crate `gltf` takes them for numbers.

use std::collections::BTreeMap;

use ::gltf::accessor::Item;
use ::gltf::accessor::util::ItemIter;
use ::gltf::json::accessor::sparse::Sparse;
use ::gltf::json::accessor::{ComponentType, Type};
use ::gltf::json::buffer::View;
use ::gltf::json::validation::{Checked, USize64};
use ::gltf::json::{Index, Root};
use formats::{Error, Limits, Problem};
use serde_json::Value;

use super::error;
use super::gltf::{NAME, invalid};
use crate::gltf::meshopt::{self, COMPRESSION};

/// What accessors refer to.
pub(super) struct Numbers<'a> {
    pub(super) root: &'a Root,
    pub(super) buffers: Vec<Vec<u8>>,
    /// What compressed views hold, by their numbers.
    pub(super) unpacked: BTreeMap<usize, Vec<u8>>,
    pub(super) limits: &'a Limits,
}

/// Elements in a view of a buffer.
struct Elements {
    view: Index<View>,
    /// Bytes between the start of the view and the first element.
    offset: Option<USize64>,
    count: usize,
    /// Numbers in each element.
    width: usize,
    kind: ComponentType,
}

impl Numbers<'_> {
    /// Unpacks all compressed views.
    pub(super) fn unpack(&mut self) -> Result<(), Error> {
        let mut total = 0;
        for (index, view) in self.root.buffer_views.iter().enumerate() {
            let extensions = view.extensions.as_ref();
            if let Some(content) = extensions.and_then(|e| e.others.get(COMPRESSION)) {
                let place = format!("bufferView {index}");
                let bytes = self.unpacked_view(content, &place)?;
                // Many views may unpack the same few bytes.
                total += bytes.len();
                if total > self.limits.bytes {
                    let text = format!("unpacked, more than {} bytes", self.limits.bytes);
                    return Err(error(NAME, place, Problem::TooLarge(text)));
                }
                self.unpacked.insert(index, bytes);
            }
        }
        Ok(())
    }

    /// The bytes of a compressed view.
    fn unpacked_view(&self, content: &Value, place: &str) -> Result<Vec<u8>, Error> {
        let number = |key: &str| {
            let number = content[key].as_u64();
            number.map_or(0, |n| usize::try_from(n).unwrap_or(usize::MAX))
        };
        let [count, stride] = ["count", "byteStride"].map(number);
        if count / 6 > self.limits.points {
            let text = format!("{count} elements; the limit is {}", self.limits.points);
            return Err(error(NAME, place, Problem::TooLarge(text)));
        }
        let buffer = self.buffers.get(number("buffer"));
        let packed =
            buffer.and_then(|b| b.get(number("byteOffset")..)?.get(..number("byteLength")));
        let packed =
            packed.ok_or_else(|| invalid(place, "its compressed bytes lead out of the buffer"))?;
        let word = |key: &str| content[key].as_str().unwrap_or("NONE");
        let (mode, filter) = (word("mode"), word("filter"));
        let unpacked = match (mode, stride) {
            ("ATTRIBUTES", 4 | 8 | 12 | 16) => meshopt::unpacked_vertices(packed, count, stride),
            ("TRIANGLES", 2) => meshopt::unpacked_triangles(packed, count).map(|corners| {
                #[expect(clippy::cast_possible_truncation, reason = "the file tells the width")]
                let bytes = corners.iter().flat_map(|&k| (k as u16).to_le_bytes());
                bytes.collect()
            }),
            ("TRIANGLES", 4) => meshopt::unpacked_triangles(packed, count)
                .map(|corners| corners.iter().flat_map(|k| k.to_le_bytes()).collect()),
            _ => {
                let text = format!("{mode} of {stride} bytes, compressed, are not read");
                return Err(error(NAME, place, Problem::Unsupported(text)));
            }
        };
        let mut unpacked =
            unpacked.ok_or_else(|| invalid(place, format!("its bytes are no {mode}")))?;
        if !meshopt::unfilter(filter, stride, &mut unpacked) {
            let text = format!("the filter {filter} for {stride} bytes is not read");
            return Err(error(NAME, place, Problem::Unsupported(text)));
        }
        Ok(unpacked)
    }

    /// The numbers of an accessor that has `width` of them in each element.
    pub(super) fn of(&self, index: usize, width: usize, place: &str) -> Result<Vec<f64>, Error> {
        let Some(accessor) = self.root.accessors.get(index) else {
            return Err(invalid(place, format!("accessor {index} is not there")));
        };
        let place = format!("{place}, accessor {index}");
        let kinds = [Type::Scalar, Type::Vec2, Type::Vec3, Type::Vec4];
        if accessor.type_ != Checked::Valid(kinds[width - 1]) {
            let found = match accessor.type_ {
                Checked::Valid(kind) => format!("{kind:?}"),
                Checked::Invalid => "unknown".to_owned(),
            };
            let text = format!("its type is {found}, not {:?}", kinds[width - 1]);
            return Err(invalid(place, text));
        }
        let kind = match accessor.component_type {
            Checked::Valid(kind) => kind.0,
            Checked::Invalid => return Err(invalid(place, "its componentType is unknown")),
        };
        let count = size(accessor.count);
        let elements = |view, offset, count| Elements {
            view,
            offset,
            count,
            width,
            kind,
        };
        let mut values = match (accessor.buffer_view, &accessor.sparse) {
            (Some(view), _) => self.read(&elements(view, accessor.byte_offset, count), &place)?,
            (None, Some(_)) if count > self.limits.points => {
                let text = format!("{count} elements; the limit is {}", self.limits.points);
                return Err(error(NAME, place, Problem::TooLarge(text)));
            }
            (None, Some(_)) => vec![0.0; count * width],
            (None, None) => return Err(invalid(place, "it has no bufferView")),
        };
        if let Some(sparse) = &accessor.sparse {
            let new = &sparse.values;
            let new = elements(new.buffer_view, Some(new.byte_offset), size(sparse.count));
            self.replace(sparse, &new, &mut values, &place)?;
        }
        // Normalised ones are shares of the largest.
        let most = match kind {
            ComponentType::I8 => f64::from(i8::MAX),
            ComponentType::U8 => f64::from(u8::MAX),
            ComponentType::I16 => f64::from(i16::MAX),
            ComponentType::U16 => f64::from(u16::MAX),
            ComponentType::U32 | ComponentType::F32 => 1.0,
        };
        if accessor.normalized {
            values.iter_mut().for_each(|x| *x = (*x / most).max(-1.0));
        }
        Ok(values)
    }

    /// Puts the new elements of a sparse accessor to their places.
    fn replace(
        &self,
        sparse: &Sparse,
        new: &Elements,
        values: &mut [f64],
        place: &str,
    ) -> Result<(), Error> {
        let at = &sparse.indices;
        let Checked::Valid(kind) = at.component_type else {
            return Err(invalid(
                place,
                "the componentType of its indices is unknown",
            ));
        };
        let at = Elements {
            view: at.buffer_view,
            offset: Some(at.byte_offset),
            count: new.count,
            width: 1,
            kind: kind.0,
        };
        let at = self.read(&at, place)?;
        let numbers = self.read(new, place)?;
        for (at, new) in at.into_iter().zip(numbers.chunks_exact(new.width)) {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "what is no element is not found"
            )]
            let first = (at as usize).saturating_mul(new.len());
            let old = values.get_mut(first..);
            let old = old.and_then(|rest| rest.get_mut(..new.len()));
            let old = old.ok_or_else(|| invalid(place, format!("sparse element {at}")))?;
            old.copy_from_slice(new);
        }
        Ok(())
    }

    /// All numbers of these elements.
    fn read(&self, elements: &Elements, place: &str) -> Result<Vec<f64>, Error> {
        let Elements { count, width, .. } = *elements;
        let view = self.root.buffer_views.get(elements.view.value());
        let view = view.ok_or_else(|| invalid(place, "its bufferView is not there"))?;
        let buffer = self.buffers.get(view.buffer.value());
        let slice = || {
            let (start, length) = (view.byte_offset.map_or(0, size), size(view.byte_length));
            let view = match self.unpacked.get(&elements.view.value()) {
                Some(unpacked) => unpacked,
                None => buffer?.get(start..)?.get(..length)?,
            };
            view.get(elements.offset.map_or(0, size)..)
        };
        let bytes =
            slice().ok_or_else(|| invalid(place, "its bufferView leads out of the buffer"))?;
        let each = elements.kind.size() * width;
        let stride = view.byte_stride.map_or(each, |stride| stride.0).max(1);
        let needed = match count.checked_sub(1) {
            None => Some(0),
            Some(steps) => steps.checked_mul(stride).and_then(|n| n.checked_add(each)),
        };
        let bytes = needed
            .and_then(|needed| bytes.get(..needed))
            .ok_or_else(|| {
                let text = format!("{count} elements do not fit into {} bytes", bytes.len());
                invalid(place, text)
            })?;
        Ok(match elements.kind {
            ComponentType::I8 => numbers::<i8>(bytes, stride, elements),
            ComponentType::U8 => numbers::<u8>(bytes, stride, elements),
            ComponentType::I16 => numbers::<i16>(bytes, stride, elements),
            ComponentType::U16 => numbers::<u16>(bytes, stride, elements),
            ComponentType::U32 => numbers::<u32>(bytes, stride, elements),
            ComponentType::F32 => numbers::<f32>(bytes, stride, elements),
        })
    }
}

/// The numbers of elements that begin every `stride` bytes.
fn numbers<T: Item + Copy + Into<f64>>(bytes: &[u8], stride: usize, of: &Elements) -> Vec<f64> {
    let each = of.kind.size() * of.width;
    let starts = (0..of.count).map(|k| k * stride);
    let numbers = |at: usize| ItemIter::<T>::new(&bytes[at..at + each], of.kind.size());
    starts.flat_map(numbers).map(Into::into).collect()
}

fn size(number: USize64) -> usize {
    usize::try_from(number.0).unwrap_or(usize::MAX)
}
