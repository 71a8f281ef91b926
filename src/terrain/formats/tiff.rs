//! The TIFF container: directories of tags, and strips or tiles of samples.
//!
//! Everything is read from one slice of bytes with checked ranges, so a damaged file gives an error and
//! nothing else. The `tiff` crate is not used for reading: it inverts `MinIsWhite` samples, has no notion of
//! sparse (absent) chunks or packed 12-bit samples, misreads planar tiles, and allows 32768 chunks only.
//!
//! References: *TIFF Revision 6.0* (Adobe, 1992); *TIFF Technical Note 3* (floating-point predictor);
//! *The BigTIFF file format* (AWare Systems).

use std::borrow::Cow;
use std::io::Read;

use half::f16;
use rayon::prelude::*;

/// Tag numbers that are used.
pub(super) mod tag {
    pub(crate) const NEW_SUBFILE_TYPE: u16 = 254;
    pub(crate) const IMAGE_WIDTH: u16 = 256;
    pub(crate) const IMAGE_LENGTH: u16 = 257;
    pub(crate) const BITS_PER_SAMPLE: u16 = 258;
    pub(crate) const COMPRESSION: u16 = 259;
    pub(crate) const PHOTOMETRIC: u16 = 262;
    pub(crate) const FILL_ORDER: u16 = 266;
    pub(crate) const STRIP_OFFSETS: u16 = 273;
    pub(crate) const SAMPLES_PER_PIXEL: u16 = 277;
    pub(crate) const ROWS_PER_STRIP: u16 = 278;
    pub(crate) const STRIP_BYTE_COUNTS: u16 = 279;
    pub(crate) const PLANAR_CONFIGURATION: u16 = 284;
    pub(crate) const PREDICTOR: u16 = 317;
    pub(crate) const TILE_WIDTH: u16 = 322;
    pub(crate) const TILE_LENGTH: u16 = 323;
    pub(crate) const TILE_OFFSETS: u16 = 324;
    pub(crate) const TILE_BYTE_COUNTS: u16 = 325;
    pub(crate) const SAMPLE_FORMAT: u16 = 339;
    pub(crate) const MODEL_PIXEL_SCALE: u16 = 33550;
    pub(crate) const MODEL_TIE_POINT: u16 = 33922;
    pub(crate) const MODEL_TRANSFORMATION: u16 = 34264;
    pub(crate) const GEO_KEY_DIRECTORY: u16 = 34735;
    pub(crate) const GEO_DOUBLE_PARAMS: u16 = 34736;
    pub(crate) const GEO_ASCII_PARAMS: u16 = 34737;
    pub(crate) const GDAL_METADATA: u16 = 42112;
    pub(crate) const GDAL_NODATA: u16 = 42113;
}

/// Why a TIFF cannot be read; the caller adds the path.
#[derive(Debug)]
pub(super) enum Fault {
    /// The file contradicts itself.
    Damaged(String),
    /// The file is in order but of a kind that is not read.
    Unsupported(String),
}

/// What reading a part of a TIFF comes to.
pub(super) type Outcome<T> = Result<T, Fault>;

/// A [`Fault::Damaged`].
pub(super) fn damaged<T>(message: impl Into<String>) -> Outcome<T> {
    Err(Fault::Damaged(message.into()))
}

/// A [`Fault::Unsupported`].
pub(super) fn unsupported<T>(message: impl Into<String>) -> Outcome<T> {
    Err(Fault::Unsupported(message.into()))
}

/// A TIFF or BigTIFF in memory.
#[derive(Clone, Copy)]
pub(super) struct Tiff<'a> {
    bytes: &'a [u8],
    big_endian: bool,
    big: bool,
    first: u64,
}

/// One image of the file: the entries of its directory, by tag.
pub(super) struct Directory<'a> {
    tiff: Tiff<'a>,
    entries: Vec<Entry<'a>>,
    next: u64,
}

struct Entry<'a> {
    tag: u16,
    kind: u16,
    count: u64,
    /// The bytes of the values, or `None` if they lie beyond the end of the file.
    values: Option<&'a [u8]>,
}

impl<'a> Tiff<'a> {
    /// Whether `bytes` begin like a TIFF.
    pub(super) fn is_tiff(bytes: &[u8]) -> bool {
        [b"II\x2a\0", b"II\x2b\0", b"MM\0\x2a", b"MM\0\x2b"].iter().any(|m| bytes.starts_with(*m))
    }

    /// Reads the header; [`is_tiff`](Self::is_tiff) has said yes.
    pub(super) fn new(bytes: &'a [u8]) -> Outcome<Self> {
        let mut tiff = Self {
            bytes,
            big_endian: bytes.starts_with(b"MM"),
            big: bytes[2..4].contains(&43),
            first: 0,
        };
        let first = if tiff.big { tiff.uint(8, 8) } else { tiff.uint(4, 4) };
        match first {
            Some(first) => tiff.first = first,
            None => return damaged("the file ends within the TIFF header"),
        }
        Ok(tiff)
    }

    /// The images of the file, in order. A damaged or circular tail ends the list, unless nothing came before.
    pub(super) fn directories(self) -> Outcome<Vec<Directory<'a>>> {
        /// More images than this are not looked at.
        const MOST: usize = 1000;
        let mut seen = vec![self.first];
        let mut list = vec![self.directory(self.first)?];
        while let Some(next) = list.last().map(|d| d.next).filter(|n| *n != 0 && !seen.contains(n))
        {
            let Ok(directory) = self.directory(next) else { break };
            if list.len() == MOST {
                break;
            }
            seen.push(next);
            list.push(directory);
        }
        Ok(list)
    }

    fn directory(self, at: u64) -> Outcome<Directory<'a>> {
        let beyond = || {
            Fault::Damaged(format!(
                "the image directory at byte {at} reaches beyond the end of the file ({} bytes); \
                 the file is cut short or damaged",
                self.bytes.len()
            ))
        };
        let (count_size, entry_size, value_size) = if self.big { (8, 20, 8) } else { (2, 12, 4) };
        let count = self.uint(at, count_size).ok_or_else(beyond)?;
        let table = at.saturating_add(count_size);
        let after =
            count.checked_mul(entry_size).and_then(|n| n.checked_add(table)).ok_or_else(beyond)?;
        self.slice(table, after - table).ok_or_else(beyond)?;
        let entries = (0..count).filter_map(|i| self.entry(table + i * entry_size)).collect();
        // A file may end right after its last directory: no link is no further image.
        let next = self.uint(after, value_size).unwrap_or(0);
        Ok(Directory { tiff: self, entries, next })
    }

    fn entry(self, at: u64) -> Option<Entry<'a>> {
        let tag = self.uint(at, 2)? as u16;
        let kind = self.uint(at + 2, 2)? as u16;
        let size = match kind {
            1 | 2 | 6 | 7 => 1,
            3 | 8 => 2,
            4 | 9 | 11 | 13 => 4,
            5 | 10 | 12 | 16..=18 => 8,
            _ => return None,
        };
        let (count, place, inline) = if self.big {
            (self.uint(at + 4, 8)?, at + 12, 8)
        } else {
            (self.uint(at + 4, 4)?, at + 8, 4)
        };
        let values = count.checked_mul(size).and_then(|length| {
            let from = if length <= inline { place } else { self.uint(place, inline)? };
            self.slice(from, length)
        });
        Some(Entry { tag, kind, count, values })
    }

    fn slice(self, at: u64, length: u64) -> Option<&'a [u8]> {
        let start = usize::try_from(at).ok()?;
        let end = start.checked_add(usize::try_from(length).ok()?)?;
        self.bytes.get(start..end)
    }

    /// The unsigned integer of `size` bytes at byte `at`.
    fn uint(self, at: u64, size: u64) -> Option<u64> {
        Some(self.to_uint(self.slice(at, size)?))
    }

    fn to_uint(self, bytes: &[u8]) -> u64 {
        let push = |value: u64, byte: &u8| value << 8 | u64::from(*byte);
        if self.big_endian { bytes.iter().fold(0, push) } else { bytes.iter().rev().fold(0, push) }
    }
}

impl<'a> Directory<'a> {
    /// The value bytes of a tag with the type and count; `None` if the image does not have it.
    fn values(&self, tag: u16) -> Outcome<Option<(u16, &'a [u8])>> {
        let Some(entry) = self.entries.iter().find(|e| e.tag == tag) else { return Ok(None) };
        match entry.values {
            Some(values) => Ok(Some((entry.kind, values))),
            None => damaged(format!(
                "tag {tag} claims {} values, more than the file holds; the file is cut short or damaged",
                entry.count
            )),
        }
    }

    /// The unsigned integers of a tag; `None` if the image does not have it.
    pub(super) fn uints(&self, tag: u16) -> Outcome<Option<Vec<u64>>> {
        let Some((kind, bytes)) = self.values(tag)? else { return Ok(None) };
        let size = match kind {
            1 | 6 | 7 => 1,
            3 | 8 => 2,
            4 | 9 | 13 => 4,
            16..=18 => 8,
            _ => {
                return damaged(format!(
                    "tag {tag} has type {kind} where whole numbers are expected"
                ));
            }
        };
        Ok(Some(bytes.chunks_exact(size).map(|b| self.tiff.to_uint(b)).collect()))
    }

    /// The first unsigned integer of a tag, or `default` if the image does not have it.
    pub(super) fn uint(&self, tag: u16, default: u64) -> Outcome<u64> {
        Ok(self.uints(tag)?.and_then(|v| v.first().copied()).unwrap_or(default))
    }

    /// The floating-point numbers of a tag; empty if the image does not have it.
    pub(super) fn doubles(&self, tag: u16) -> Outcome<Vec<f64>> {
        match self.values(tag)? {
            None => Ok(Vec::new()),
            Some((12, bytes)) => {
                Ok(bytes.chunks_exact(8).map(|b| f64::from_bits(self.tiff.to_uint(b))).collect())
            }
            Some((11, bytes)) => Ok(bytes
                .chunks_exact(4)
                .map(|b| f64::from(f32::from_bits(self.tiff.to_uint(b) as u32)))
                .collect()),
            Some((kind, _)) => {
                damaged(format!("tag {tag} has type {kind} where decimals are expected"))
            }
        }
    }

    /// The bytes of a text without the final NUL; `None` if the image does not have it.
    pub(super) fn text_bytes(&self, tag: u16) -> Outcome<Option<&'a [u8]>> {
        Ok(self.values(tag)?.map(|(_, bytes)| {
            let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
            &bytes[..end]
        }))
    }

    /// The text of a tag; `None` if the image does not have it.
    pub(super) fn text(&self, tag: u16) -> Outcome<Option<Cow<'a, str>>> {
        Ok(self.text_bytes(tag)?.map(String::from_utf8_lossy))
    }
}

/// How one sample is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sample {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F16,
    F32,
    F64,
    /// Unsigned, this many bits, packed from the most significant bit on, rows padded to whole bytes.
    Packed(u32),
}

impl Sample {
    fn new(bits: u64, format: u64) -> Outcome<Self> {
        Ok(match (format, bits) {
            (_, 0) => return damaged("BitsPerSample is 0"),
            (1 | 4, 8) => Self::U8,
            (1 | 4, 16) => Self::U16,
            (1 | 4, 32) => Self::U32,
            (1 | 4, 64) => Self::U64,
            (1 | 4, 1..32) => Self::Packed(bits as u32),
            (2, 8) => Self::I8,
            (2, 16) => Self::I16,
            (2, 32) => Self::I32,
            (2, 64) => Self::I64,
            (3, 16) => Self::F16,
            (3, 32) => Self::F32,
            (3, 64) => Self::F64,
            (5 | 6, _) => return unsupported("the samples are complex numbers, not heights"),
            _ => {
                return unsupported(format!(
                    "samples of {bits} bits in sample format {format} are not read; \
                     convert with `gdal_translate -ot Float32 IN OUT.tif`"
                ));
            }
        })
    }

    /// Bits of one sample.
    fn bits(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 8,
            Self::U16 | Self::I16 | Self::F16 => 16,
            Self::U32 | Self::I32 | Self::F32 => 32,
            Self::U64 | Self::I64 | Self::F64 => 64,
            Self::Packed(bits) => bits as usize,
        }
    }

    /// Whether the samples are floating-point numbers.
    pub(super) fn is_float(self) -> bool {
        matches!(self, Self::F16 | Self::F32 | Self::F64)
    }

    /// GDAL's name of the type.
    pub(super) fn name(self) -> String {
        match self {
            Self::Packed(bits) => format!("{bits}-bit unsigned"),
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => format!("uint{}", self.bits()),
            Self::I8 | Self::I16 | Self::I32 | Self::I64 => format!("int{}", self.bits()),
            Self::F16 | Self::F32 | Self::F64 => format!("float{}", self.bits()),
        }
    }

    /// `value` as this type would store it: what a nodata value must be compared as.
    pub(super) fn round(self, value: f64) -> f64 {
        match self {
            Self::F16 => f16::from_f64(value).to_f64(),
            Self::F32 => f64::from(value as f32),
            _ => value,
        }
    }

    /// Calls `put(i, value)` for every `stride`-th sample of a row of little-endian samples, from the `first`.
    fn unpack(self, row: &[u8], first: usize, stride: usize, mut put: impl FnMut(usize, f64)) {
        macro_rules! each {
            ($type:ty, $to:expr) => {{
                let (samples, _) = row.as_chunks::<{ size_of::<$type>() }>();
                for (i, bytes) in samples.iter().skip(first).step_by(stride).enumerate() {
                    put(i, $to(<$type>::from_le_bytes(*bytes)));
                }
            }};
        }
        match self {
            Self::U8 => each!(u8, f64::from),
            Self::I8 => each!(i8, f64::from),
            Self::U16 => each!(u16, f64::from),
            Self::I16 => each!(i16, f64::from),
            Self::U32 => each!(u32, f64::from),
            Self::I32 => each!(i32, f64::from),
            Self::U64 => each!(u64, |v| v as f64),
            Self::I64 => each!(i64, |v| v as f64),
            Self::F16 => each!(f16, f16::to_f64),
            Self::F32 => each!(f32, f64::from),
            Self::F64 => each!(f64, |v| v),
            Self::Packed(bits) => {
                let bits = bits as usize;
                for (i, sample) in (first..row.len() * 8 / bits).step_by(stride).enumerate() {
                    let bit = |b: usize| u32::from(row[b / 8] >> (7 - b % 8) & 1);
                    let value =
                        (sample * bits..(sample + 1) * bits).fold(0, |v, b| v << 1 | bit(b));
                    put(i, f64::from(value));
                }
            }
        }
    }
}

/// What is done to the bytes of a chunk before storing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Compression {
    None,
    Lzw,
    Deflate,
    PackBits,
    Zstd,
}

impl Compression {
    fn new(code: u64) -> Outcome<Self> {
        let name = match code {
            1 => return Ok(Self::None),
            5 => return Ok(Self::Lzw),
            8 | 32946 => return Ok(Self::Deflate),
            32773 => return Ok(Self::PackBits),
            50000 => return Ok(Self::Zstd),
            2..=4 => "CCITT fax (1 bit per sample: a mask, not heights)",
            6 | 7 => "JPEG (lossy: its blocks would show as ridges)",
            34887 => "LERC",
            34925 => "LZMA",
            50001 => "WebP",
            50002 => "JPEG XL",
            _ => "unknown",
        };
        unsupported(format!(
            "compression {code}, {name}, is not read; convert with `gdal_translate -co COMPRESS=DEFLATE IN OUT.tif`"
        ))
    }

    /// More bytes than this cannot come out of one byte: what a forged size is held against.
    ///
    /// Deflate: 258 bytes from 2 bits, 1032. LZW: strings to 3839 bytes from 12 bits. PackBits: 128 from 2.
    /// Zstandard: a block of 128 KiB from 4 bytes.
    fn most_expansion(self) -> u64 {
        match self {
            Self::None => 1,
            Self::PackBits => 64,
            Self::Deflate => 1032,
            Self::Lzw => 2560,
            Self::Zstd => 32768,
        }
    }

    /// The first `length` bytes of what was compressed to `stored`; never more, whatever is in there.
    fn expand(self, stored: &[u8], length: usize) -> Result<Vec<u8>, String> {
        /// So much room is made at once; more, which a damaged file may claim, as it is needed.
        const ROOM: usize = 1 << 24;
        let mut bytes = Vec::with_capacity(length.min(ROOM));
        match self {
            Self::None => bytes.extend_from_slice(&stored[..length.min(stored.len())]),
            Self::PackBits => bytes = unpack_bits(stored, length),
            Self::Lzw => bytes = expand_lzw(stored, length)?,
            Self::Deflate => {
                let mut stream = flate2::bufread::ZlibDecoder::new(stored).take(length as u64);
                stream.read_to_end(&mut bytes).map_err(|e| e.to_string())?;
                // One step on, to the checksum at the end of the stream.
                stream.into_inner().read(&mut [0]).map_err(|e| e.to_string())?;
            }
            Self::Zstd => {
                let stream =
                    zstd::stream::read::Decoder::with_buffer(stored).map_err(|e| e.to_string())?;
                stream.take(length as u64).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
            }
        }
        if bytes.len() < length {
            return Err(format!("{} bytes where {length} are due", bytes.len()));
        }
        Ok(bytes)
    }
}

fn expand_lzw(stored: &[u8], length: usize) -> Result<Vec<u8>, String> {
    use weezl::{BitOrder, LzwStatus, decode::Decoder};

    let mut decoder = Decoder::with_tiff_size_switch(BitOrder::Msb, 8);
    let mut bytes = vec![0; length];
    let (mut read, mut written) = (0, 0);
    while written < length {
        let step = decoder.decode_bytes(&stored[read..], &mut bytes[written..]);
        read += step.consumed_in;
        written += step.consumed_out;
        match step.status.map_err(|e| e.to_string())? {
            LzwStatus::Ok => {}
            LzwStatus::NoProgress | LzwStatus::Done => break,
        }
    }
    bytes.truncate(written);
    Ok(bytes)
}

/// PackBits (TIFF 6.0, section 9): `n ≥ 0` copies `n + 1` bytes, `−127 ≤ n < 0` repeats one `1 − n` times.
fn unpack_bits(stored: &[u8], length: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut rest = stored;
    while let (true, Some((&head, tail))) = (bytes.len() < length, rest.split_first()) {
        rest = match (head as i8, tail) {
            (-128, _) => tail,
            (n @ 0.., _) => {
                let (run, tail) = tail.split_at(tail.len().min(n as usize + 1));
                bytes.extend_from_slice(run);
                tail
            }
            (n, [value, tail @ ..]) => {
                bytes.resize(bytes.len() + (1 - isize::from(n)) as usize, *value);
                tail
            }
            (_, []) => break,
        };
    }
    bytes.truncate(length);
    bytes
}

/// How the samples of one image are laid out in the file.
pub(super) struct Layout<'a> {
    tiff: Tiff<'a>,
    /// Number of columns.
    pub(super) cols: usize,
    /// Number of rows.
    pub(super) rows: usize,
    /// Number of samples at each place.
    pub(super) bands: usize,
    /// How one sample is stored.
    pub(super) sample: Sample,
    compression: Compression,
    predictor: u64,
    planar: bool,
    /// Columns and rows of one chunk; a strip is as wide as the image.
    chunk: (usize, usize),
    /// Bytes of one row of a chunk, once expanded.
    row_bytes: usize,
    tiled: bool,
    offsets: Vec<u64>,
    counts: Vec<u64>,
}

/// Cells that a tile may have though the image has fewer.
const LARGEST_SPARE_TILE: usize = 1 << 24;

impl<'a> Layout<'a> {
    pub(super) fn new(image: &Directory<'a>) -> Outcome<Self> {
        let size = |tag| -> Outcome<usize> {
            let value = image.uint(tag, 0)?;
            // A length that does not fit 32 bits is no image; this keeps the products below in range.
            match u32::try_from(value) {
                Ok(value) if value > 0 => Ok(value as usize),
                _ => damaged(format!("tag {tag}, a width or length, is {value}")),
            }
        };
        let (cols, rows) = (size(tag::IMAGE_WIDTH)?, size(tag::IMAGE_LENGTH)?);
        let bands = match image.uint(tag::SAMPLES_PER_PIXEL, 1)? {
            0 => return damaged("SamplesPerPixel is 0"),
            n @ 1..=65535 => n as usize,
            n => return damaged(format!("SamplesPerPixel is {n}")),
        };
        let uniform = |tag| -> Outcome<u64> {
            let values = image.uints(tag)?.unwrap_or_default();
            match values.iter().find(|v| **v != values[0]) {
                Some(_) => unsupported(
                    "bands of different sample types are not read; pick one with `gdal_translate -b`",
                ),
                None => Ok(values.first().copied().unwrap_or(1)),
            }
        };
        let sample = Sample::new(uniform(tag::BITS_PER_SAMPLE)?, uniform(tag::SAMPLE_FORMAT)?)?;
        let compression = Compression::new(image.uint(tag::COMPRESSION, 1)?)?;
        let predictor = image.uint(tag::PREDICTOR, 1)?;
        match (predictor, sample) {
            (1, Sample::Packed(_)) if image.uint(tag::FILL_ORDER, 1)? == 2 => {
                return unsupported("packed samples in FillOrder 2 are not read");
            }
            (1, _) | (3, Sample::F16 | Sample::F32 | Sample::F64) => {}
            (2, Sample::Packed(_)) | (3, _) => {
                return damaged(format!(
                    "predictor {predictor} does not go with {} samples",
                    sample.name()
                ));
            }
            (2, _) => {}
            _ => return unsupported(format!("predictor {predictor} is not known")),
        }
        let tiled = image.uints(tag::TILE_OFFSETS)?.is_some();
        let chunk = if tiled {
            (size(tag::TILE_WIDTH)?, size(tag::TILE_LENGTH)?)
        } else {
            let rows_per_strip = image.uint(tag::ROWS_PER_STRIP, u64::MAX)?;
            if rows_per_strip == 0 {
                return damaged("RowsPerStrip is 0");
            }
            (cols, usize::try_from(rows_per_strip).unwrap_or(rows).min(rows))
        };
        let (offsets, counts) = if tiled {
            (tag::TILE_OFFSETS, tag::TILE_BYTE_COUNTS)
        } else {
            (tag::STRIP_OFFSETS, tag::STRIP_BYTE_COUNTS)
        };
        let planar = bands > 1 && image.uint(tag::PLANAR_CONFIGURATION, 1)? == 2;
        // At most 2³² samples of 64 bits in 65535 bands: no overflow.
        let interleaved = if planar { 1 } else { bands };
        let row_bytes = (chunk.0 * interleaved * sample.bits()).div_ceil(8);
        if chunk.0.saturating_mul(chunk.1) > cols.saturating_mul(rows).max(LARGEST_SPARE_TILE) {
            return damaged(format!(
                "tiles of {} × {} cells are larger than the image",
                chunk.0, chunk.1
            ));
        }
        let layout = Self {
            tiff: image.tiff,
            cols,
            rows,
            bands,
            sample,
            compression,
            predictor,
            planar,
            chunk,
            row_bytes,
            tiled,
            offsets: image.uints(offsets)?.unwrap_or_default(),
            counts: image.uints(counts)?.unwrap_or_default(),
        };
        layout.check_size()?;
        Ok(layout)
    }

    /// Samples side by side in a chunk: all bands, or one if each has its own chunks.
    fn interleaved(&self) -> usize {
        if self.planar { 1 } else { self.bands }
    }

    fn chunks_across(&self) -> usize {
        self.cols.div_ceil(self.chunk.0)
    }

    fn chunks_down(&self) -> usize {
        self.rows.div_ceil(self.chunk.1)
    }

    /// Refuses an image that claims more cells than its bytes can hold, before anything is allocated.
    fn check_size(&self) -> Outcome<()> {
        /// So many cells may be absent (sparse) without a byte to show for them.
        const SPARSE: u64 = 1 << 24;
        let planes = if self.planar { self.bands } else { 1 };
        let chunks = (self.chunks_across() * self.chunks_down()).saturating_mul(planes);
        if self.offsets.len() < chunks || self.counts.len() < chunks {
            return damaged(format!(
                "{} × {} cells need {chunks} strips or tiles, but the file lists {}",
                self.cols,
                self.rows,
                self.offsets.len().min(self.counts.len())
            ));
        }
        let file = self.tiff.bytes.len() as u64;
        let stored = self.counts.iter().fold(0u64, |sum, n| sum.saturating_add(*n)).min(file);
        let holds = stored.saturating_mul(self.compression.most_expansion() * 8)
            / (self.sample.bits() * self.interleaved()) as u64;
        let claimed = self.cols as u64 * self.rows as u64;
        if claimed > holds.saturating_add(SPARSE) {
            return damaged(format!(
                "the header claims {} × {} cells, more than the file's {file} bytes can hold",
                self.cols, self.rows
            ));
        }
        Ok(())
    }

    /// The samples of a band, row by row as stored; `NaN` where a chunk is absent.
    pub(super) fn band(&self, band: usize) -> Outcome<Vec<f64>> {
        let cells = self.cols * self.rows;
        // Only to see if there is room: zeroed memory costs nothing before it is used, and then the threads share the cost.
        if Vec::<f64>::new().try_reserve_exact(cells).is_err() {
            return unsupported(format!(
                "{} × {} cells do not fit in memory",
                self.cols, self.rows
            ));
        }
        let mut values = vec![0.0; cells];
        // The first fault of the file, so that the message does not depend on the threads.
        let fault = values
            .par_chunks_mut(self.chunk.1 * self.cols)
            .enumerate()
            .find_map_first(|(down, rows)| self.read_chunk_row(band, down, rows).err());
        fault.map_or(Ok(values), Err)
    }

    /// Fills the rows that one row of chunks covers.
    fn read_chunk_row(&self, band: usize, down: usize, rows: &mut [f64]) -> Outcome<()> {
        let across = self.chunks_across();
        let (plane, first) = if self.planar { (band, 0) } else { (0, band) };
        // A tile is whole even where the image ends within it; the last strip is not.
        let chunk_rows = if self.tiled { self.chunk.1 } else { rows.len() / self.cols };
        for tile in 0..across {
            let index = (plane * self.chunks_down() + down) * across + tile;
            let left = tile * self.chunk.0;
            let width = self.chunk.0.min(self.cols - left);
            let Some(bytes) = self.read_chunk(index, chunk_rows)? else {
                let lines = rows.chunks_exact_mut(self.cols);
                lines.for_each(|line| line[left..left + width].fill(f64::NAN));
                continue;
            };
            let stored_rows = bytes.chunks_exact(self.row_bytes);
            for (out, row) in rows.chunks_exact_mut(self.cols).zip(stored_rows) {
                let out = &mut out[left..left + width];
                self.sample.unpack(row, first, self.interleaved(), |i, value| {
                    if let Some(cell) = out.get_mut(i) {
                        *cell = value;
                    }
                });
            }
        }
        Ok(())
    }

    /// One chunk of `rows` rows as little-endian samples; `None` if it is absent.
    fn read_chunk(&self, index: usize, rows: usize) -> Outcome<Option<Vec<u8>>> {
        let (offset, count) = (self.offsets[index], self.counts[index]);
        if count == 0 {
            return Ok(None);
        }
        let kind = if self.tiled { "tile" } else { "strip" };
        let Some(stored) = self.tiff.slice(offset, count) else {
            return damaged(format!(
                "{kind} {index} lies at bytes {offset} to {}, beyond the end of the file at {}; it is cut short",
                offset.saturating_add(count),
                self.tiff.bytes.len()
            ));
        };
        let length = self.row_bytes.saturating_mul(rows);
        if length as u64 > count.saturating_mul(self.compression.most_expansion()) {
            return damaged(format!(
                "{kind} {index} holds {count} bytes, too few for the {length} it should expand to"
            ));
        }
        let mut bytes = self
            .compression
            .expand(stored, length)
            .map_err(|e| Fault::Damaged(format!("{kind} {index} is damaged: {e}")))?;
        bytes.chunks_exact_mut(self.row_bytes).for_each(|row| self.to_little_endian(row));
        Ok(Some(bytes))
    }

    /// Undoes byte order and predictor of one row.
    fn to_little_endian(&self, row: &mut [u8]) {
        let size = self.sample.bits() / 8;
        let whole = !matches!(self.sample, Sample::Packed(_));
        if self.predictor == 3 {
            return undo_float_predictor(row, size, self.interleaved());
        }
        if self.tiff.big_endian && whole && size > 1 {
            row.chunks_exact_mut(size).for_each(<[u8]>::reverse);
        }
        if self.predictor == 2 {
            match size {
                1 => undo_differences(row, self.interleaved(), |a: [u8; 1], b| {
                    [a[0].wrapping_add(b[0])]
                }),
                2 => undo_differences(row, self.interleaved(), |a, b| {
                    u16::from_le_bytes(a).wrapping_add(u16::from_le_bytes(b)).to_le_bytes()
                }),
                4 => undo_differences(row, self.interleaved(), |a, b| {
                    u32::from_le_bytes(a).wrapping_add(u32::from_le_bytes(b)).to_le_bytes()
                }),
                _ => undo_differences(row, self.interleaved(), |a, b| {
                    u64::from_le_bytes(a).wrapping_add(u64::from_le_bytes(b)).to_le_bytes()
                }),
            }
        }
    }
}

/// Predictor 2 (TIFF 6.0, section 14): each sample is stored less its left neighbour of the same band.
fn undo_differences<const N: usize>(
    row: &mut [u8],
    interleaved: usize,
    add: impl Fn([u8; N], [u8; N]) -> [u8; N],
) {
    let (samples, _) = row.as_chunks_mut::<N>();
    for band in 0..interleaved {
        let mut sum = [0; N];
        for sample in samples.iter_mut().skip(band).step_by(interleaved) {
            sum = add(*sample, sum);
            *sample = sum;
        }
    }
}

/// Predictor 3 (TIFF Technical Note 3): the row is split into planes of bytes, most significant first, and
/// each byte is stored less the one `interleaved` before it.
fn undo_float_predictor(row: &mut [u8], size: usize, interleaved: usize) {
    undo_differences(row, interleaved, |[a], [b]: [u8; 1]| [a.wrapping_add(b)]);
    let planes = row.to_vec();
    match size {
        2 => join_planes::<2>(&planes, row),
        4 => join_planes::<4>(&planes, row),
        _ => join_planes::<8>(&planes, row),
    }
}

/// Little-endian samples of `N` bytes from planes of bytes, most significant first.
fn join_planes<const N: usize>(planes: &[u8], row: &mut [u8]) {
    let (samples, _) = row.as_chunks_mut::<N>();
    for (byte, plane) in planes.chunks_exact(samples.len().max(1)).take(N).enumerate() {
        samples.iter_mut().zip(plane).for_each(|(sample, value)| sample[N - 1 - byte] = *value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pack_bits_of_the_specification() {
        // The example of Apple's Technical Note TN1023.
        let stored = [
            0xfe, 0xaa, 0x02, 0x80, 0x00, 0x2a, 0xfd, 0xaa, 0x03, 0x80, 0x00, 0x2a, 0x22, 0xf7,
            0xaa,
        ];
        let bytes = unpack_bits(&stored, 100);
        assert_eq!(bytes.len(), 24);
        assert_eq!(bytes[..7], [0xaa, 0xaa, 0xaa, 0x80, 0x00, 0x2a, 0xaa]);
        assert_eq!(unpack_bits(&stored, 5).len(), 5);
        assert_eq!(unpack_bits(&[0x7f, 1], 100), [1]);
    }

    #[test]
    fn packed_samples_come_out_most_significant_bit_first() {
        let mut values = Vec::new();
        Sample::Packed(12).unpack(&[0x12, 0x34, 0x56], 0, 1, |_, v| values.push(v));
        assert_eq!(values, [f64::from(0x123), f64::from(0x456)]);
    }

    #[test]
    fn predictors_are_undone() {
        let mut row = [10, 20, 1, 2, 255, 255];
        undo_differences(&mut row, 2, |a: [u8; 1], b| [a[0].wrapping_add(b[0])]);
        assert_eq!(row, [10, 20, 11, 22, 10, 21]);

        let values = [1.5f32, -2.25];
        let mut row = [0; 8];
        for (i, v) in values.iter().enumerate() {
            for (byte, b) in v.to_be_bytes().into_iter().enumerate() {
                row[byte * 2 + i] = b;
            }
        }
        for i in (1..8).rev() {
            row[i] = row[i].wrapping_sub(row[i - 1]);
        }
        undo_float_predictor(&mut row, 4, 1);
        assert_eq!(row[..4], values[0].to_le_bytes());
        assert_eq!(row[4..], values[1].to_le_bytes());
    }
}
