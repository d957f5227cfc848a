//! Bytes of vertices and indices, and what the file says about them.

use std::collections::BTreeMap;
use std::io;

use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::buffer::{Stride, Target, View};
use gltf::json::validation::Checked::Valid;
use gltf::json::validation::USize64;
use gltf::json::{Accessor, Index};
use serde_json::{Map, Value, json};

use super::meshopt::{self, COMPRESSION};

/// One kind of data; all of a kind lies in one view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Vec2,
    Vec3,
    Vec4,
    Color,
    /// Steps along the axes, of a grid.
    Steps,
    /// Directions in bytes.
    Direction,
    /// Texture coordinates from 0 to 1.
    Share2,
    /// Colours from 0 to 1.
    Share4,
    Index16,
    Index32,
}

impl Kind {
    /// Bytes from one vertex to the next; `None` for indices.
    fn stride(self) -> Option<usize> {
        match self {
            Self::Direction | Self::Share2 => Some(4),
            Self::Vec2 | Self::Steps | Self::Share4 => Some(8),
            Self::Vec3 => Some(12),
            Self::Vec4 | Self::Color => Some(16),
            Self::Index16 | Self::Index32 => None,
        }
    }
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

    /// Stores steps along the axes with the least and the largest.
    pub(super) fn add_steps(&mut self, points: &[[u16; 3]]) -> Index<Accessor> {
        let bytes = points.iter().flat_map(|[x, y, z]| [x, y, z, &0]);
        let bytes = bytes.flat_map(|x| x.to_le_bytes());
        let index = self.add(
            Kind::Steps,
            ComponentType::U16,
            Type::Vec3,
            points.len(),
            bytes,
        );
        let most = |a: [u16; 3], b: &[u16; 3]| [0, 1, 2].map(|k| a[k].max(b[k]));
        let least = |a: [u16; 3], b: &[u16; 3]| [0, 1, 2].map(|k| a[k].min(b[k]));
        let accessor = &mut self.accessors[index.value()].1;
        accessor.min = Some(json!(points.iter().fold([u16::MAX; 3], least)));
        accessor.max = Some(json!(points.iter().fold([0; 3], most)));
        index
    }

    /// Stores unit vectors, in bytes: within half a degree.
    #[expect(clippy::cast_possible_truncation, reason = "from -127 to 127")]
    pub(super) fn add_directions(&mut self, vectors: &[[f32; 3]]) -> Index<Accessor> {
        let byte = |x: f32| (x * 127.0).round() as i8;
        let bytes = vectors.iter().flat_map(|v| {
            let [x, y, z] = v.map(byte);
            [x, y, z, 0].map(i8::cast_unsigned)
        });
        let count = vectors.len();
        let index = self.add(Kind::Direction, ComponentType::I8, Type::Vec3, count, bytes);
        self.accessors[index.value()].1.normalized = true;
        index
    }

    /// Stores numbers from 0 to 1, in steps of a 65535th.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to 65535"
    )]
    pub(super) fn add_shares<const N: usize>(&mut self, vectors: &[[f32; N]]) -> Index<Accessor> {
        let (kind, type_) = if N == 2 {
            (Kind::Share2, Type::Vec2)
        } else {
            (Kind::Share4, Type::Vec4)
        };
        let step = |x: &f32| (x * f32::from(u16::MAX)).round() as u16;
        let bytes = vectors.iter().flatten().map(step);
        let bytes = bytes.flat_map(u16::to_le_bytes);
        let index = self.add(kind, ComponentType::U16, type_, vectors.len(), bytes);
        self.accessors[index.value()].1.normalized = true;
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

    /// Puts accessors and views into the file; what is left is the content of its first buffer.
    /// Compressed views also have a place in a second one, which is nowhere.
    ///
    /// # Errors
    /// If compression fails.
    pub(super) fn finish(
        self,
        root: &mut gltf::json::Root,
        compress: bool,
    ) -> io::Result<Contents> {
        let (mut buffer, mut unpacked) = (Vec::new(), 0);
        let mut places: BTreeMap<Kind, Index<View>> = BTreeMap::new();
        for (kind, bytes) in self.views {
            let stride = kind.stride();
            let target = if stride.is_none() {
                Target::ElementArrayBuffer
            } else {
                Target::ArrayBuffer
            };
            places.insert(kind, Index::new(number(root.buffer_views.len())));
            let mut view = View {
                buffer: Index::new(0),
                byte_length: USize64::from(bytes.len()),
                byte_offset: (!buffer.is_empty()).then(|| USize64::from(buffer.len())),
                byte_stride: stride.map(Stride),
                name: None,
                // Vectors of four are not vertices but places of instances.
                target: (kind != Kind::Vec4).then_some(Valid(target)),
                extensions: None,
                extras: None,
            };
            if compress {
                let packed = packed(kind, &bytes)?;
                let content = json!({
                    "buffer": 0,
                    "byteOffset": buffer.len(),
                    "byteLength": packed.bytes.len(),
                    "byteStride": stride.unwrap_or(if kind == Kind::Index16 { 2 } else { 4 }),
                    "count": packed.count,
                    "mode": packed.mode,
                });
                view.buffer = Index::new(1);
                view.byte_offset = (unpacked > 0).then(|| USize64::from(unpacked));
                view.extensions = Some(gltf::json::extensions::buffer::View {
                    others: Map::from_iter([(COMPRESSION.to_owned(), content)]),
                });
                unpacked = (unpacked + bytes.len()).next_multiple_of(4);
                buffer.extend(packed.bytes);
            } else {
                buffer.extend(bytes);
            }
            root.buffer_views.push(view);
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
        Ok(Contents { buffer, unpacked })
    }
}

/// What the buffers of a file hold.
pub(super) struct Contents {
    /// The bytes of the first.
    pub(super) buffer: Vec<u8>,
    /// The length of the second, into which compressed views are unpacked.
    pub(super) unpacked: usize,
}

/// A view, compressed.
fn packed(kind: Kind, bytes: &[u8]) -> io::Result<meshopt::Packed> {
    let words = |width: usize| bytes.chunks_exact(width);
    match kind.stride() {
        Some(stride) => meshopt::vertices(bytes, stride),
        None if kind == Kind::Index16 => {
            let indices = words(2).map(|b| u32::from(u16::from_le_bytes([b[0], b[1]])));
            meshopt::triangles(&indices.collect::<Vec<_>>())
        }
        None => {
            let indices = words(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
            meshopt::triangles(&indices.collect::<Vec<_>>())
        }
    }
}

/// A position in a list, as files write it.
pub(super) fn number(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(u32::MAX)
}

/// A value as the `extras` of an object.
pub(super) fn extras(value: &Value) -> gltf::json::Extras {
    serde_json::value::to_raw_value(value).ok()
}
