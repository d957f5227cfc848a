//! The encoding of DICOM data sets (PS3.5): implicit and explicit lengths, little endian.
//!
//! No crate reads them here: with dicom-object 0.10, a file of 268 bytes that announces a long value
//! takes 3.5 GB, and nested sequences end the program by a full stack.

use std::borrow::Cow;
use std::io::Read as _;

/// A tag, group and element.
pub(super) type Tag = u32;

const ITEM: Tag = 0xfffe_e000;
const ITEM_END: Tag = 0xfffe_e00d;
const SEQUENCE_END: Tag = 0xfffe_e0dd;
const TRANSFER_SYNTAX: Tag = 0x0002_0010;

const UNDEFINED: u32 = 0xffff_ffff;

/// How deep sequences may nest.
const NESTING: usize = 32;

/// Bytes before the mark of a file.
const PREAMBLE: usize = 128;

/// An element of a data set.
#[derive(Debug)]
pub(super) struct Element<'a> {
    pub(super) tag: Tag,
    pub(super) value: Value<'a>,
}

#[derive(Debug)]
pub(super) enum Value<'a> {
    Bytes(&'a [u8]),
    Items(Vec<Vec<Element<'a>>>),
}

/// Elements of one level.
pub(super) trait Elements<'a> {
    /// The bytes of an element, without padding at its end.
    fn bytes(&self, tag: Tag) -> Option<&'a [u8]>;
    /// The items of a sequence, or none.
    fn items(&self, tag: Tag) -> &[Vec<Element<'a>>];
}

impl<'a> Elements<'a> for [Element<'a>] {
    fn bytes(&self, tag: Tag) -> Option<&'a [u8]> {
        let element = self.iter().find(|element| element.tag == tag)?;
        match element.value {
            Value::Bytes(bytes) => Some(bytes.trim_ascii_end().trim_suffix_zeros()),
            Value::Items(_) => None,
        }
    }

    fn items(&self, tag: Tag) -> &[Vec<Element<'a>>] {
        match self.iter().find(|element| element.tag == tag) {
            Some(Element {
                value: Value::Items(items),
                ..
            }) => items,
            _ => &[],
        }
    }
}

trait TrimZeros {
    fn trim_suffix_zeros(&self) -> &Self;
}

impl TrimZeros for [u8] {
    fn trim_suffix_zeros(&self) -> &Self {
        let length = self
            .iter()
            .rposition(|b| *b != 0)
            .map_or(0, |last| last + 1);
        &self[..length]
    }
}

/// Whether bytes are a DICOM file.
pub(super) fn sniff(bytes: &[u8]) -> bool {
    bytes.get(PREAMBLE..PREAMBLE + 4) == Some(b"DICM")
}

/// The bytes of the data set of a file, decompressed where they are compressed, and whether
/// lengths are explicit.
///
/// # Errors
/// If the file is cut off, or encoded in a way that is not read.
pub(super) fn data_set(bytes: &[u8], limit: usize) -> Result<(Cow<'_, [u8]>, bool), String> {
    if !sniff(bytes) {
        // Without a head: the second pair of bytes after the first tag tells.
        let is_explicit = bytes
            .get(4..6)
            .is_some_and(|vr| vr.iter().all(u8::is_ascii_uppercase));
        return Ok((Cow::Borrowed(bytes), is_explicit));
    }
    let mut reader = Reader {
        bytes: &bytes[PREAMBLE + 4..],
        is_explicit: true,
        left: usize::MAX,
        wanted: &[],
    };
    let mut syntax = String::new();
    while reader.bytes.starts_with(&[0x02, 0x00]) {
        let element = reader.element(0)?;
        if let (TRANSFER_SYNTAX, Value::Bytes(value)) = (element.tag, element.value) {
            syntax = String::from_utf8_lossy(value.trim_suffix_zeros())
                .trim()
                .to_owned();
        }
    }
    let rest = reader.bytes;
    match syntax.as_str() {
        "1.2.840.10008.1.2" => Ok((Cow::Borrowed(rest), false)),
        "1.2.840.10008.1.2.1.99" => {
            let mut plain = Vec::new();
            let decoder = flate2::read::DeflateDecoder::new(rest);
            let result = decoder.take(limit as u64 + 1).read_to_end(&mut plain);
            result.map_err(|error| format!("damaged compressed data: {error}"))?;
            if plain.len() > limit {
                return Err(format!("compressed data that grows beyond {limit} bytes"));
            }
            Ok((Cow::Owned(plain), true))
        }
        "1.2.840.10008.1.2.2" => Err("the retired big endian encoding is not read".to_owned()),
        // Images are compressed in ways of their own; all else in them is explicit.
        _ => Ok((Cow::Borrowed(rest), true)),
    }
}

/// Reads the elements of a data set; sequences of known length are entered only if `wanted`.
pub(super) fn read<'a>(
    bytes: &'a [u8],
    is_explicit: bool,
    wanted: &[Tag],
    most: usize,
) -> Result<Vec<Element<'a>>, String> {
    let mut reader = Reader {
        bytes,
        is_explicit,
        left: most,
        wanted,
    };
    let mut elements = Vec::new();
    while !reader.bytes.is_empty() {
        elements.push(reader.element(0)?);
    }
    Ok(elements)
}

struct Reader<'a, 'b> {
    bytes: &'a [u8],
    is_explicit: bool,
    /// How many elements may still come.
    left: usize,
    wanted: &'b [Tag],
}

impl<'a> Reader<'a, '_> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let Some((taken, rest)) = self.bytes.split_at_checked(count) else {
            let there = self.bytes.len();
            return Err(format!("{count} bytes are announced and {there} are there"));
        };
        self.bytes = rest;
        Ok(taken)
    }

    fn u16(&mut self) -> Result<u16, String> {
        let bytes = self.take(2)?;
        Ok(u16::from_le_bytes([bytes[0], bytes[1]]))
    }

    fn u32(&mut self) -> Result<u32, String> {
        let bytes = self.take(4)?;
        Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }

    fn tag(&mut self) -> Result<Tag, String> {
        let group = self.u16()?;
        Ok(Tag::from(group) << 16 | Tag::from(self.u16()?))
    }

    /// The next element; `level` is how many sequences it is in.
    fn element(&mut self, level: usize) -> Result<Element<'a>, String> {
        let tag = self.tag()?;
        let place = |text: String| format!("({:04x},{:04x}): {text}", tag >> 16, tag & 0xffff);
        self.left = self
            .left
            .checked_sub(1)
            .ok_or("there are too many elements")?;
        let mut kind = *b"  ";
        let length = if self.is_explicit && tag >> 16 != 0xfffe {
            let bytes = self.take(2).map_err(place)?;
            kind = [bytes[0], bytes[1]];
            match &kind {
                b"OB" | b"OD" | b"OF" | b"OL" | b"OV" | b"OW" | b"SQ" | b"UC" | b"UN" | b"UR"
                | b"UT" | b"SV" | b"UV" => {
                    self.take(2).map_err(place)?;
                    self.u32()
                }
                _ => self.u16().map(u32::from),
            }
        } else {
            self.u32()
        };
        let length = length.map_err(place)?;
        let is_wanted = self.wanted.contains(&tag);
        let value = if length == UNDEFINED {
            // What is unknown is implicit inside (PS3.5, 6.2.2).
            let is_explicit = self.is_explicit;
            self.is_explicit &= kind != *b"UN";
            let is_raw = matches!(&kind, b"OB" | b"OW");
            let items = self.items(None, level + 1, is_raw).map_err(place)?;
            self.is_explicit = is_explicit;
            Value::Items(items)
        } else {
            let bytes = self.take(length as usize).map_err(place)?;
            if is_wanted {
                let outer = std::mem::replace(&mut self.bytes, bytes);
                let is_explicit = self.is_explicit;
                self.is_explicit &= kind != *b"UN";
                let items = self.items(Some(()), level + 1, false).map_err(place)?;
                self.bytes = outer;
                self.is_explicit = is_explicit;
                Value::Items(items)
            } else {
                Value::Bytes(bytes)
            }
        };
        Ok(Element { tag, value })
    }

    /// The items of a sequence: all bytes, if its length is known, or those up to its end.
    fn items(
        &mut self,
        known: Option<()>,
        level: usize,
        is_raw: bool,
    ) -> Result<Vec<Vec<Element<'a>>>, String> {
        if level > NESTING {
            return Err(format!("sequences nest deeper than {NESTING}"));
        }
        let mut items = Vec::new();
        while known.is_none() || !self.bytes.is_empty() {
            let (tag, length) = (self.tag()?, self.u32()?);
            match tag {
                SEQUENCE_END => break,
                ITEM if is_raw && length != UNDEFINED => {
                    self.take(length as usize)?;
                }
                ITEM => {
                    self.left = self
                        .left
                        .checked_sub(1)
                        .ok_or("there are too many elements")?;
                    items.push(self.item(length, level)?);
                }
                _ => {
                    return Err(format!(
                        "an item is wanted, not ({:04x},{:04x})",
                        tag >> 16,
                        tag & 0xffff
                    ));
                }
            }
        }
        Ok(items)
    }

    /// The elements of an item.
    fn item(&mut self, length: u32, level: usize) -> Result<Vec<Element<'a>>, String> {
        let mut elements = Vec::new();
        if length == UNDEFINED {
            loop {
                let before = self.bytes;
                if self.tag()? == ITEM_END {
                    self.u32()?;
                    return Ok(elements);
                }
                self.bytes = before;
                elements.push(self.element(level)?);
            }
        }
        let bytes = self.take(length as usize)?;
        let outer = std::mem::replace(&mut self.bytes, bytes);
        while !self.bytes.is_empty() {
            elements.push(self.element(level)?);
        }
        self.bytes = outer;
        Ok(elements)
    }
}
