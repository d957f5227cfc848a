//! Where the text and the numbers of a glTF file are.

use std::borrow::Cow;

use base64::Engine as _;
use formats::{Error, Resolver};

use super::gltf::invalid;

/// The text and the numbers of a file.
type Parts<'b> = (Cow<'b, [u8]>, Option<Cow<'b, [u8]>>);

/// Takes a file apart: all of it is text, or it has chunks.
pub(super) fn parts(bytes: &[u8]) -> Result<Parts<'_>, Error> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes.into(), None));
    }
    let length = bytes.get(8..12).and_then(|b| b.try_into().ok());
    let length = length.map_or(0, u32::from_le_bytes);
    if length < 12 {
        return Err(invalid("header", format!("a length of {length} bytes")));
    }
    let glb = ::gltf::Glb::from_slice(bytes).map_err(|e| invalid("chunks", e.to_string()))?;
    Ok((glb.json, glb.bin))
}

/// The bytes of a buffer: the chunk of the file, or from an address in it or beside it.
pub(super) fn buffer_bytes(
    uri: Option<&str>,
    number: usize,
    chunk: Option<&[u8]>,
    files: &dyn Resolver,
) -> Result<Vec<u8>, Error> {
    let place = format!("buffer {number}");
    match (uri, chunk) {
        (None, Some(chunk)) if number == 0 => Ok(chunk.to_vec()),
        (None, _) => Err(invalid(place, "there is no uri and no chunk")),
        (Some(uri), _) => match uri.strip_prefix("data:") {
            Some(data) => {
                let coded = data.split_once(";base64,").map(|(_, coded)| coded);
                let coded = coded.ok_or_else(|| invalid(&place, "data that is not base64"))?;
                let engine = &base64::engine::general_purpose::STANDARD;
                engine
                    .decode(coded)
                    .map_err(|e| invalid(&place, e.to_string()))
            }
            None => {
                let name = formats::decoded(uri);
                let wrong = |e| invalid(&place, format!("{name}: {e}"));
                files.resolve(&name).map_err(wrong)
            }
        },
    }
}
