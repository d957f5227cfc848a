//! From film to file, and how files are written.

use std::collections::BTreeSet;
use std::fs::File;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::{fmt, fs, process};

use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::image::write::layers::{LayersWriter, WritableLayers};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer,
    LayerAttributes, LineOrder, SmallVec, Text, f16,
};
use glam::Vec3;
use png::{BitDepth, ColorType};
use rayon::prelude::*;

use crate::film::{Film, Picture, PixelData, encoded};

/// Blocks of an EXR file that are packed at once, for each thread.
const PACKED_AT_ONCE: usize = 8;

/// Bits per channel of a PNG file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PngDepth {
    /// One byte per channel.
    #[default]
    Eight,
    /// Two bytes per channel.
    Sixteen,
}

/// A group of data channels of an EXR file.
#[derive(Clone, Copy, Debug)]
pub struct Aov {
    /// Name on the command line.
    pub name: &'static str,
    channels: &'static [DataChannel],
}

/// Channel name, and how to take its value from the data.
type DataChannel = (&'static str, fn(&PixelData) -> f32);

/// Every group of data channels; all are single precision.
pub const AOVS: &[Aov] = &[
    Aov {
        name: "depth",
        channels: &[("Z", |d| d.depth), ("ViewLayer.Depth.Z", |d| d.depth)],
    },
    Aov {
        name: "normal",
        channels: &[
            ("ViewLayer.Normal.X", |d| d.normal[0]),
            ("ViewLayer.Normal.Y", |d| d.normal[1]),
            ("ViewLayer.Normal.Z", |d| d.normal[2]),
        ],
    },
    Aov {
        name: "position",
        channels: &[
            ("ViewLayer.Position.X", |d| d.position[0]),
            ("ViewLayer.Position.Y", |d| d.position[1]),
            ("ViewLayer.Position.Z", |d| d.position[2]),
        ],
    },
    Aov {
        name: "uv",
        channels: &[
            ("ViewLayer.UV.U", |d| d.uv[0]),
            ("ViewLayer.UV.V", |d| d.uv[1]),
            ("ViewLayer.UV.A", |d| if d.shape < 0.0 { 0.0 } else { 1.0 }),
            ("exact.u", |d| d.uv[0]),
            ("exact.v", |d| d.uv[1]),
        ],
    },
    Aov {
        name: "patch",
        channels: &[("exact.patch", |d| d.shape)],
    },
];

/// The status of certified pixels; not one of [`AOVS`], as it holds something only after
/// [`crate::certify_film`].
pub const STATUS: Aov = Aov {
    name: "status",
    channels: &[("exact.status", |d| d.status)],
};

/// What goes into a file.
#[derive(Clone, Debug)]
pub struct OutputOptions {
    /// Bits per channel of a PNG file.
    pub png_depth: PngDepth,
    /// Whether an EXR file gets the colours.
    pub beauty: bool,
    /// The data channels of an EXR file, where the film has data.
    pub aovs: Vec<Aov>,
}

impl Default for OutputOptions {
    fn default() -> Self {
        Self {
            png_depth: PngDepth::Eight,
            beauty: true,
            aovs: AOVS.to_vec(),
        }
    }
}

/// A kind of picture file: one row each.
#[derive(Clone, Copy)]
pub struct PictureFormat {
    /// File name ending.
    pub extension: &'static str,
    /// Whether data channels can be stored.
    pub holds_data: bool,
    write: fn(&Film, &OutputOptions, &mut BufWriter<File>) -> io::Result<()>,
}

impl fmt::Debug for PictureFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PictureFormat({})", self.extension)
    }
}

/// All kinds of picture files.
pub const PICTURE_FORMATS: &[PictureFormat] = &[
    PictureFormat {
        extension: "png",
        holds_data: false,
        write: write_png,
    },
    PictureFormat {
        extension: "exr",
        holds_data: true,
        write: write_exr,
    },
];

/// The kind of picture that a file name asks for.
pub fn picture_format(path: &Path) -> Option<&'static PictureFormat> {
    let extension = path.extension()?.to_str()?.to_lowercase();
    PICTURE_FORMATS
        .iter()
        .find(|format| format.extension == extension)
}

/// Writes a picture; the file appears under its name only when it is complete.
///
/// # Errors
/// If the ending of the name is not known, the film has no pixels or the file cannot be written;
/// nothing is left behind then.
pub fn write(film: &Film, path: &Path, options: &OutputOptions) -> io::Result<()> {
    let format = picture_format(path).ok_or_else(|| {
        let known: Vec<_> = PICTURE_FORMATS.iter().map(|f| f.extension).collect();
        invalid(format!("pictures end in .{}", known.join(" or .")))
    })?;
    check_size([film.width(), film.height()])?;
    replace_file(path, |file| (format.write)(film, options, file))
}

fn invalid(text: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, text)
}

/// Refuses pictures without pixels.
fn check_size([width, height]: [u32; 2]) -> io::Result<()> {
    if width == 0 || height == 0 {
        return Err(invalid(format!("{width} x {height} are no pixels")));
    }
    Ok(())
}

/// The folder of a file.
pub fn folder(path: &Path) -> &Path {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty());
    folder.unwrap_or(Path::new("."))
}

/// Makes a folder and those that it is in.
///
/// # Errors
/// If that fails, such as where a file has the name of one of them.
pub fn make_folder(folder: &Path) -> io::Result<()> {
    let file = folder.ancestors().find(|path| path.is_file());
    if let Some(file) = file {
        let text = format!("{} is a file, not a folder", file.display());
        return Err(io::Error::new(io::ErrorKind::NotADirectory, text));
    }
    fs::create_dir_all(folder)
}

/// The longest file name, in bytes, that file systems take.
const LONGEST_NAME: usize = 255;

/// The name, beside a file, under which it is written: `NAME.PROCESS.part`.
fn temporary(path: &Path) -> PathBuf {
    let end = format!(".{}.part", process::id());
    let mut name = path.file_name().unwrap_or_default().to_owned();
    if name.len() + end.len() > LONGEST_NAME {
        // Something short that belongs to this name alone.
        let mut hash = DefaultHasher::new();
        name.hash(&mut hash);
        name = format!("{:016x}", hash.finish()).into();
    }
    name.push(end);
    path.with_file_name(name)
}

/// Writes a file under a temporary name beside its place and renames it when it is complete.
/// Pipes and devices are written into.
///
/// # Errors
/// If the file cannot be written; nothing is left behind then.
pub fn replace_file(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    let write = |file: File| {
        let mut file = BufWriter::new(file);
        fill(&mut file)?;
        file.flush()
    };
    let is_special = |found: fs::Metadata| !found.is_file() && !found.is_dir();
    if fs::metadata(path).is_ok_and(is_special) {
        return write(File::create(path)?);
    }
    let temporary = temporary(path);
    let written = begin(&temporary).and_then(write);
    let mut unfinished = unfinished();
    let replaced = written.and_then(|()| fs::rename(&temporary, path));
    if replaced.is_err() {
        // The error that stopped the writing is the one to tell.
        let _ = fs::remove_file(&temporary);
    }
    unfinished.remove(&temporary);
    replaced
}

/// The temporary names of the files that are being written.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes a file that is known to be unfinished.
fn begin(temporary: &Path) -> io::Result<File> {
    let mut unfinished = unfinished();
    let file = File::create(temporary)?;
    unfinished.insert(temporary.to_owned());
    Ok(file)
}

/// Ends the program at once, without the files that are being written.
pub fn end(code: i32) -> ! {
    // Whoever would begin another file, or finish one, waits.
    let unfinished = unfinished();
    for temporary in &*unfinished {
        // The program ends in any case.
        let _ = fs::remove_file(temporary);
    }
    process::exit(code)
}

/// A picture as the bytes of a PNG file, one byte per channel.
///
/// # Errors
/// If the encoder refuses its size.
pub fn encode_png(picture: &Picture) -> io::Result<Vec<u8>> {
    let channels = picture.pixels().iter().flatten();
    let bytes: Vec<u8> = channels
        .map(|v| quantize(v.clamp(0.0, 1.0), 255.0).to_be_bytes()[1])
        .collect();
    let size = |n: usize| u32::try_from(n).map_err(io::Error::other);
    let (width, height) = (size(picture.width())?, size(picture.height())?);
    let mut file = Vec::new();
    let kind = (ColorType::Rgb, BitDepth::Eight);
    pack_png(&mut file, [width, height], &bytes, kind)?;
    Ok(file)
}

/// Writes sRGB pixels of this kind as a PNG file.
pub(crate) fn pack_png(
    file: impl Write,
    [width, height]: [u32; 2],
    bytes: &[u8],
    (color, depth): (ColorType, BitDepth),
) -> io::Result<()> {
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Balanced);
    encoder.set_filter(png::Filter::Adaptive);
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    let write = || {
        let mut writer = encoder.write_header()?;
        writer.write_image_data(bytes)?;
        writer.finish()
    };
    write().map_err(|error| match error {
        png::EncodingError::IoError(error) => error,
        error => error.into(),
    })
}

/// Writes one number per pixel as the only channel of an EXR file; `size` is width and height.
///
/// # Errors
/// If there are no pixels, or not as many values, the name has letters beyond Latin-1, or the file
/// cannot be written; nothing is left behind then.
pub fn write_channel(path: &Path, size: [u32; 2], name: &str, values: &[f32]) -> io::Result<()> {
    check_size(size)?;
    let ([width, height], count) = (size, values.len());
    if u64::from(width) * u64::from(height) != count as u64 {
        let text = format!("{count} values for {width} x {height} pixels");
        return Err(invalid(text));
    }
    let name = Text::new_or_none(name)
        .ok_or_else(|| invalid(format!("the channel '{name}' has letters beyond Latin-1")))?;
    let mut channels = SmallVec::new();
    channels.push(AnyChannel::new(name, FlatSamples::F32(values.to_vec())));
    replace_file(path, |file| write_channels(channels, size, file))
}

fn write_png(film: &Film, options: &OutputOptions, file: &mut BufWriter<File>) -> io::Result<()> {
    let opaque = film.colors().iter().all(|c| c[3] >= 1.0);
    let channels = if opaque { 3 } else { 4 };
    // PNG wants colours that are not multiplied by the coverage.
    let values = film.colors().par_iter().flat_map_iter(|&[r, g, b, a]| {
        let scale = if a > 0.0 { a.recip() } else { 0.0 };
        let srgb = encoded(Vec3::new(r, g, b) * scale);
        [srgb.x, srgb.y, srgb.z, a.clamp(0.0, 1.0)]
            .into_iter()
            .take(channels)
    });
    let (bytes, depth): (Vec<u8>, _) = match options.png_depth {
        PngDepth::Eight => {
            let byte = |value| quantize(value, 255.0).to_be_bytes()[1];
            (values.map(byte).collect(), BitDepth::Eight)
        }
        PngDepth::Sixteen => {
            let bytes = |value| quantize(value, 65535.0).to_be_bytes();
            (values.flat_map_iter(bytes).collect(), BitDepth::Sixteen)
        }
    };
    let color = if opaque {
        ColorType::Rgb
    } else {
        ColorType::Rgba
    };
    pack_png(file, [film.width(), film.height()], &bytes, (color, depth))
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the value is 0 to 1"
)]
fn quantize(value: f32, most: f32) -> u16 {
    (value * most).round() as u16
}

fn write_exr(film: &Film, options: &OutputOptions, file: &mut BufWriter<File>) -> io::Result<()> {
    let mut channels = SmallVec::new();
    if options.beauty {
        for (k, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
            let samples: Vec<f16> = film.colors().iter().map(|c| f16::from_f32(c[k])).collect();
            let layered = format!("ViewLayer.Combined.{name}");
            for name in [name, layered.as_str()] {
                channels.push(AnyChannel::new(name, FlatSamples::F16(samples.clone())));
            }
        }
    }
    let aovs = match film.data() {
        [] => &[],
        _ => &options.aovs[..],
    };
    for (name, value) in aovs.iter().flat_map(|aov| aov.channels) {
        let samples = film.data().iter().map(value).collect();
        channels.push(AnyChannel::new(*name, FlatSamples::F32(samples)));
    }
    write_channels(channels, [film.width(), film.height()], file)
}

/// The channels of an EXR file, in the order of their names.
fn write_channels(
    channels: SmallVec<[AnyChannel<FlatSamples>; 4]>,
    [width, height]: [u32; 2],
    file: &mut BufWriter<File>,
) -> io::Result<()> {
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let size = (width as usize, height as usize);
    let layer = Layer::new(
        size,
        LayerAttributes::default(),
        encoding,
        AnyChannels::sort(channels),
    );
    write_blocks(&Image::from_layer(layer), file).map_err(|error| match error {
        exr::error::Error::Io(error) => error,
        error => io::Error::other(error),
    })
}

/// Writes the blocks of an image, packed on all threads of the current pool.
fn write_blocks(
    image: &Image<Layer<AnyChannels<FlatSamples>>>,
    file: &mut BufWriter<File>,
) -> exr::error::UnitResult {
    let headers = image.layer_data.infer_headers(&image.attributes);
    let layers = image.layer_data.create_writer(&headers);
    exr::block::write(file, headers, true, |meta, writer| {
        let headers = &meta.headers;
        let blocks: Vec<_> = meta.enumerate_ordered_header_block_indices().collect();
        for group in blocks.chunks(PACKED_AT_ONCE * rayon::current_num_threads()) {
            let pack = |&(place, index): &(usize, BlockIndex)| {
                let data = layers.extract_uncompressed_block(headers, index);
                let block = UncompressedBlock { index, data };
                Ok((place, block.compress_to_chunk(headers)?))
            };
            let packed: exr::error::Result<Vec<_>> = group.par_iter().map(pack).collect();
            for (place, chunk) in packed? {
                writer.write_chunk(place, chunk)?;
            }
        }
        Ok(())
    })
}
