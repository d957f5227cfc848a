//! Compressed views (`EXT_meshopt_compression`), each decoded again before it is trusted.

use std::io;

use meshopt_rs::index::IndexEncodingVersion;
use meshopt_rs::index::buffer::{
    decode_index_buffer, encode_index_buffer, encode_index_buffer_bound,
};
use meshopt_rs::vertex::VertexEncodingVersion;
use meshopt_rs::vertex::buffer::{
    decode_vertex_buffer, encode_vertex_buffer, encode_vertex_buffer_bound,
};

/// The extension for compressed views.
pub(super) const COMPRESSION: &str = "EXT_meshopt_compression";

/// A view as it is compressed.
pub(super) struct Packed {
    pub(super) mode: &'static str,
    pub(super) count: usize,
    pub(super) bytes: Vec<u8>,
}

/// Compresses vertices of `stride` bytes: 4, 8, 12 or 16.
///
/// # Errors
/// If what was compressed does not give the same bytes again.
pub(super) fn vertices(bytes: &[u8], stride: usize) -> io::Result<Packed> {
    match stride {
        4 => of_words::<1>(bytes),
        8 => of_words::<2>(bytes),
        12 => of_words::<3>(bytes),
        _ => of_words::<4>(bytes),
    }
}

fn of_words<const N: usize>(bytes: &[u8]) -> io::Result<Packed> {
    let words: Vec<u32> = bytes
        .as_chunks::<4>()
        .0
        .iter()
        .map(|word| u32::from_ne_bytes(*word))
        .collect();
    let vertices = words.as_chunks::<N>().0;
    let mut packed = vec![0; encode_vertex_buffer_bound(vertices.len(), 4 * N)];
    let length = encode_vertex_buffer(&mut packed, vertices, VertexEncodingVersion::V0);
    packed.truncate(length.ok_or_else(wrong)?);
    let mut again = vec![[0; N]; vertices.len()];
    decode_vertex_buffer(&mut again, &packed).map_err(|_| wrong())?;
    if again != vertices {
        return Err(wrong());
    }
    Ok(Packed {
        mode: "ATTRIBUTES",
        count: vertices.len(),
        bytes: packed,
    })
}

/// Compresses the corners of triangles, which may begin with another corner afterwards.
///
/// # Errors
/// If what was compressed does not give the same triangles again.
pub(super) fn triangles(indices: &[u32]) -> io::Result<Packed> {
    let most = indices.iter().max().map_or(0, |&most| most as usize + 1);
    let mut packed = vec![0; encode_index_buffer_bound(indices.len(), most)];
    let length = encode_index_buffer(&mut packed, indices, IndexEncodingVersion::V1);
    packed.truncate(length.ok_or_else(wrong)?);
    let mut again = vec![0_u32; indices.len()];
    decode_index_buffer(&mut again, &packed).map_err(|_| wrong())?;
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

fn wrong() -> io::Error {
    io::Error::other("compressed triangles do not come back as they were; leave --meshopt out")
}
