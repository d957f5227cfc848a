//! Bytes of vertices and indices, and what the file says about them.

use std::collections::BTreeMap;

use gltf_json::accessor::{ComponentType, GenericComponentType, Type};
use gltf_json::buffer::{Stride, Target, View};
use gltf_json::validation::Checked::Valid;
use gltf_json::validation::USize64;
use gltf_json::{Accessor, Index};
use serde_json::{Value, json};

/// One kind of data; all of a kind lies in one view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Vec2,
    Vec3,
    Vec4,
    Color,
    Index16,
    Index32,
}

/// Data in the making.
#[derive(Debug, Default)]
pub(super) struct Data {
    views: BTreeMap<Kind, Vec<u8>>,
    accessors: Vec<(Kind, Accessor)>,
    /// Encoded, in the order of the images of the file.
    pictures: Vec<Vec<u8>>,
}

impl Data {
    /// Stores vectors with their least and largest coordinates.
    pub(super) fn add_points(&mut self, points: &[[f32; 3]]) -> Index<Accessor> {
        let index = self.add_floats(Kind::Vec3, Type::Vec3, points);
        let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        for p in points {
            for k in 0..3 {
                bounds[0][k] = bounds[0][k].min(p[k]);
                bounds[1][k] = bounds[1][k].max(p[k]);
            }
        }
        let value = |corner: [f32; 3]| Some(json!(corner.map(f64::from)));
        let accessor = &mut self.accessors[index.value()].1;
        (accessor.min, accessor.max) = (value(bounds[0]), value(bounds[1]));
        index
    }

    /// Stores vectors of three.
    pub(super) fn add_vec3(&mut self, vectors: &[[f32; 3]]) -> Index<Accessor> {
        self.add_floats(Kind::Vec3, Type::Vec3, vectors)
    }

    /// Stores vectors of two.
    pub(super) fn add_vec2(&mut self, vectors: &[[f32; 2]]) -> Index<Accessor> {
        self.add_floats(Kind::Vec2, Type::Vec2, vectors)
    }

    /// Stores vectors of four.
    pub(super) fn add_vec4(&mut self, vectors: &[[f32; 4]]) -> Index<Accessor> {
        self.add_floats(Kind::Vec4, Type::Vec4, vectors)
    }

    /// Stores colours with alpha.
    pub(super) fn add_colors(&mut self, colors: &[[f32; 4]]) -> Index<Accessor> {
        self.add_floats(Kind::Color, Type::Vec4, colors)
    }

    /// Stores the next image of the file.
    pub(super) fn add_picture(&mut self, encoded: Vec<u8>) {
        self.pictures.push(encoded);
    }

    fn add_floats<const N: usize>(
        &mut self,
        kind: Kind,
        type_: Type,
        vectors: &[[f32; N]],
    ) -> Index<Accessor> {
        let bytes = vectors.iter().flatten().flat_map(|x| x.to_le_bytes());
        self.add(kind, ComponentType::F32, type_, vectors.len(), bytes)
    }

    /// Stores indices in as few bytes as the number of vertices allows.
    pub(super) fn add_indices(&mut self, indices: &[u32], vertices: usize) -> Index<Accessor> {
        let count = indices.len();
        if vertices <= usize::from(u16::MAX) {
            let narrow = indices.iter().filter_map(|&i| u16::try_from(i).ok());
            let bytes = narrow.flat_map(u16::to_le_bytes);
            self.add(
                Kind::Index16,
                ComponentType::U16,
                Type::Scalar,
                count,
                bytes,
            )
        } else {
            let bytes = indices.iter().flat_map(|i| i.to_le_bytes());
            self.add(
                Kind::Index32,
                ComponentType::U32,
                Type::Scalar,
                count,
                bytes,
            )
        }
    }

    fn add(
        &mut self,
        kind: Kind,
        component: ComponentType,
        type_: Type,
        count: usize,
        bytes: impl Iterator<Item = u8>,
    ) -> Index<Accessor> {
        let view = self.views.entry(kind).or_default();
        let offset = view.len();
        view.extend(bytes);
        let accessor = Accessor {
            buffer_view: None,
            byte_offset: (offset > 0).then(|| USize64::from(offset)),
            count: USize64::from(count),
            component_type: Valid(GenericComponentType(component)),
            extensions: None,
            extras: None,
            type_: Valid(type_),
            min: None,
            max: None,
            name: None,
            normalized: false,
            sparse: None,
        };
        self.accessors.push((kind, accessor));
        Index::new(number(self.accessors.len() - 1))
    }

    /// Puts accessors and views into the file; what is left is the content of the buffer.
    pub(super) fn finish(self, root: &mut gltf_json::Root) -> Vec<u8> {
        let mut buffer = Vec::new();
        let mut places: BTreeMap<Kind, Index<View>> = BTreeMap::new();
        for (kind, bytes) in self.views {
            let offset = buffer.len();
            let is_index = matches!(kind, Kind::Index16 | Kind::Index32);
            let stride = match kind {
                Kind::Vec2 => Some(8),
                Kind::Vec3 => Some(12),
                Kind::Vec4 | Kind::Color => Some(16),
                Kind::Index16 | Kind::Index32 => None,
            };
            let target = if is_index {
                Target::ElementArrayBuffer
            } else {
                Target::ArrayBuffer
            };
            places.insert(kind, Index::new(number(root.buffer_views.len())));
            root.buffer_views.push(View {
                buffer: Index::new(0),
                byte_length: USize64::from(bytes.len()),
                byte_offset: (offset > 0).then(|| USize64::from(offset)),
                byte_stride: stride.map(Stride),
                name: None,
                // Vectors of four are not vertices but places of instances.
                target: (kind != Kind::Vec4).then_some(Valid(target)),
                extensions: None,
                extras: None,
            });
            buffer.extend(bytes);
            buffer.resize(buffer.len().next_multiple_of(4), 0);
        }
        for (kind, mut accessor) in self.accessors {
            accessor.buffer_view = places.get(&kind).copied();
            root.accessors.push(accessor);
        }
        for (image, bytes) in root.images.iter_mut().zip(self.pictures) {
            image.buffer_view = Some(Index::new(number(root.buffer_views.len())));
            root.buffer_views.push(View {
                buffer: Index::new(0),
                byte_length: USize64::from(bytes.len()),
                byte_offset: (!buffer.is_empty()).then(|| USize64::from(buffer.len())),
                byte_stride: None,
                name: None,
                target: None,
                extensions: None,
                extras: None,
            });
            buffer.extend(bytes);
            buffer.resize(buffer.len().next_multiple_of(4), 0);
        }
        buffer
    }
}

/// A position in a list, as files write it.
pub(super) fn number(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(u32::MAX)
}

/// A value as the `extras` of an object.
pub(super) fn extras(value: &Value) -> gltf_json::Extras {
    serde_json::value::to_raw_value(value).ok()
}
