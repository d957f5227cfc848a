//! Compressed views (`EXT_meshopt_compression`), each decoded again before it is trusted, and
//! those of files that are read.

use std::io;

use meshopt_rs::index::IndexEncodingVersion;
use meshopt_rs::index::buffer::{
    decode_index_buffer, encode_index_buffer, encode_index_buffer_bound,
};
use meshopt_rs::vertex::VertexEncodingVersion;
use meshopt_rs::vertex::buffer::{
    decode_vertex_buffer, encode_vertex_buffer, encode_vertex_buffer_bound,
};
use meshopt_rs::vertex::filter::{decode_filter_exp, decode_filter_oct_8, decode_filter_oct_16};

/// The extension for compressed views.
pub(crate) const COMPRESSION: &str = "EXT_meshopt_compression";

/// A view as it is compressed.
pub(crate) struct Packed {
    pub(crate) mode: &'static str,
    pub(crate) count: usize,
    pub(crate) bytes: Vec<u8>,
}

/// Compresses vertices of `stride` bytes: 4, 8, 12 or 16.
///
/// # Errors
/// If what was compressed does not give the same bytes again.
pub(crate) fn vertices(bytes: &[u8], stride: usize) -> io::Result<Packed> {
    let packed = match stride {
        4 => of_words::<1>(bytes),
        8 => of_words::<2>(bytes),
        12 => of_words::<3>(bytes),
        _ => of_words::<4>(bytes),
    };
    let packed = packed.ok_or_else(wrong)?;
    if unpacked_vertices(&packed.bytes, packed.count, stride).as_deref() != Some(bytes) {
        return Err(wrong());
    }
    Ok(packed)
}

fn of_words<const N: usize>(bytes: &[u8]) -> Option<Packed> {
    let words: Vec<u32> = bytes
        .as_chunks::<4>()
        .0
        .iter()
        .map(|word| u32::from_ne_bytes(*word))
        .collect();
    let vertices = words.as_chunks::<N>().0;
    let mut packed = vec![0; encode_vertex_buffer_bound(vertices.len(), 4 * N)];
    let length = encode_vertex_buffer(&mut packed, vertices, VertexEncodingVersion::V0);
    packed.truncate(length?);
    Some(Packed {
        mode: "ATTRIBUTES",
        count: vertices.len(),
        bytes: packed,
    })
}

/// The bytes of `count` vertices of `stride` bytes, or `None` if they are not that, or if the
/// stride is none of 4, 8, 12 and 16.
pub(crate) fn unpacked_vertices(packed: &[u8], count: usize, stride: usize) -> Option<Vec<u8>> {
    fn words<const N: usize>(packed: &[u8], count: usize) -> Option<Vec<u8>> {
        let mut vertices = vec![[0_u32; N]; count];
        decode_vertex_buffer(&mut vertices, packed).ok()?;
        let words = vertices.as_flattened().iter();
        Some(words.flat_map(|word| word.to_ne_bytes()).collect())
    }
    match stride {
        4 => words::<1>(packed, count),
        8 => words::<2>(packed, count),
        12 => words::<3>(packed, count),
        16 => words::<4>(packed, count),
        _ => None,
    }
}

/// Takes back what a filter did to vertices of `stride` bytes before they were compressed, or
/// tells that it is not known for this stride.
#[must_use]
pub(crate) fn unfilter(filter: &str, stride: usize, bytes: &mut [u8]) -> bool {
    match (filter, stride) {
        ("NONE", _) => {}
        ("OCTAHEDRAL", 4) => decode_filter_oct_8(bytes.as_chunks_mut().0),
        ("OCTAHEDRAL", 8) => {
            for vertex in bytes.as_chunks_mut::<8>().0 {
                let words = vertex.as_chunks_mut::<2>().0;
                let mut numbers = [[0, 1, 2, 3].map(|k| u16::from_ne_bytes(words[k]))];
                decode_filter_oct_16(&mut numbers);
                for (word, number) in words.iter_mut().zip(numbers[0]) {
                    *word = number.to_ne_bytes();
                }
            }
        }
        ("EXPONENTIAL", _) => {
            for word in bytes.as_chunks_mut::<4>().0 {
                let mut number = [u32::from_ne_bytes(*word)];
                decode_filter_exp(&mut number);
                *word = number[0].to_ne_bytes();
            }
        }
        _ => return false,
    }
    true
}

/// Compresses the corners of triangles, which may begin with another corner afterwards.
///
/// # Errors
/// If what was compressed does not give the same triangles again.
pub(crate) fn triangles(indices: &[u32]) -> io::Result<Packed> {
    let most = indices.iter().max().map_or(0, |&most| most as usize + 1);
    let mut packed = vec![0; encode_index_buffer_bound(indices.len(), most)];
    let length = encode_index_buffer(&mut packed, indices, IndexEncodingVersion::V1);
    packed.truncate(length.ok_or_else(wrong)?);
    let again = unpacked_triangles(&packed, indices.len()).ok_or_else(wrong)?;
    let turned = |[a, b, c]: [u32; 3], found: [u32; 3]| {
        found == [a, b, c] || found == [b, c, a] || found == [c, a, b]
    };
    let both = indices.as_chunks().0.iter().zip(again.as_chunks().0);
    if !both.into_iter().all(|(&own, &found)| turned(own, found)) {
        return Err(wrong());
    }
    Ok(Packed {
        mode: "TRIANGLES",
        count: indices.len(),
        bytes: packed,
    })
}

/// The corners of `count / 3` triangles, or `None` if they are not that.
pub(crate) fn unpacked_triangles(packed: &[u8], count: usize) -> Option<Vec<u32>> {
    let mut indices = count.is_multiple_of(3).then(|| vec![0_u32; count])?;
    decode_index_buffer(&mut indices, packed).ok()?;
    Some(indices)
}

fn wrong() -> io::Error {
    io::Error::other("compressed triangles do not come back as they were; leave --meshopt out")
}
