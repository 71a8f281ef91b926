//! Rasters as GeoTIFF: tiled, Deflate with a predictor, georeferenced.
//!
//! The `tiff` crate writes header and directory; it has no tiles and no floating-point predictor, so
//! the tiles are made here. BigTIFF is used where the classic format's 4 GB could be exceeded.

use std::fmt;
use std::io::{self, Seek, Write};
use std::ops::Range;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::DVec2;
use rayon::prelude::*;
use tiff::encoder::{DirectoryEncoder, TiffEncoder, TiffKind, TiffKindBig, TiffKindStandard};
use tiff::tags::{
    CompressionMethod, PhotometricInterpretation, PlanarConfiguration, SampleFormat, Tag,
};
use tiff::{TiffError, TiffResult};

use crate::grid::GridFrame;
use crate::terrain::Crs;
use crate::terrain::GeoKeys;

/// Side of a tile in pixels, GDAL's default.
const TILE: usize = 256;
/// Deflate level. On distances over 4000² cells, levels 1, 4 and 6 take 25, 53 and 70 ns per cell of one core and leave
/// 56, 49 and 48 % of the size.
const LEVEL: u32 = 1;
/// Most bytes of samples in a classic TIFF. Its limit is 4 GB; the rest is room for the padding of
/// edge tiles and for data that Deflate cannot shorten.
const CLASSIC_BYTES: usize = 3 << 30;
/// `GDAL_METADATA`, TIFF tag 42112: an XML text that GDAL-based programs read band names from.
const GDAL_METADATA: Tag = Tag::Unknown(42112);

/// One band of a raster.
#[derive(Clone, Debug)]
pub struct Band<'a> {
    /// What the values are, with their unit: `distance (m)`.
    pub description: &'a str,
    /// The values, row-major from the north-west. All bands of a file have the same type.
    pub samples: Samples<'a>,
}

/// The values of a band.
#[derive(Clone, Copy)]
pub enum Samples<'a> {
    /// Measures; `NaN` is nodata. Infinite values are written as `NaN`.
    F32(&'a [f32]),
    /// The same, made when they are written, so that they never lie in memory all at once: given the number of a row,
    /// fills its values.
    F32Rows(&'a (dyn Fn(usize, &mut [f32]) + Sync)),
    /// Labels; 0 is nodata.
    U32(&'a [u32]),
    /// Classes; 0 is nodata.
    U8(&'a [u8]),
}

impl fmt::Debug for Samples<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Samples").field("format", &self.format()).field("len", &self.len()).finish()
    }
}

impl<'a> Samples<'a> {
    /// Number of the values; `None` if they are made on demand.
    fn len(&self) -> Option<usize> {
        match self {
            Self::F32(v) => Some(v.len()),
            Self::F32Rows(_) => None,
            Self::U32(v) => Some(v.len()),
            Self::U8(v) => Some(v.len()),
        }
    }

    fn bytes_per_sample(&self) -> usize {
        match self {
            Self::F32(_) | Self::F32Rows(_) | Self::U32(_) => 4,
            Self::U8(_) => 1,
        }
    }

    fn format(&self) -> SampleFormat {
        match self {
            Self::F32(_) | Self::F32Rows(_) => SampleFormat::IEEEFP,
            Self::U32(_) | Self::U8(_) => SampleFormat::Uint,
        }
    }

    /// TIFF's predictor: 2 horizontal differences, 3 the floating-point one.
    fn predictor(&self) -> u16 {
        if self.format() == SampleFormat::IEEEFP { 3 } else { 2 }
    }

    fn nodata(&self) -> &'static str {
        if self.format() == SampleFormat::IEEEFP { "nan" } else { "0" }
    }

    /// Rows of `cols` values each; `made` is room for those that are made.
    fn rows<'s>(&self, rows: Range<usize>, cols: usize, made: &'s mut Vec<f32>) -> Lines<'s>
    where
        'a: 's,
    {
        let range = rows.start * cols..rows.end * cols;
        match self {
            Self::F32(v) => Lines::F32(&v[range]),
            Self::F32Rows(make) => {
                made.resize(range.len(), 0.0);
                let lines = made.par_chunks_mut(cols).zip(rows);
                lines.for_each(|(line, row)| make(row, line));
                Lines::F32(made)
            }
            Self::U32(v) => Lines::U32(&v[range]),
            Self::U8(v) => Lines::U8(&v[range]),
        }
    }
}

/// Some rows of a band.
#[derive(Clone, Copy)]
enum Lines<'a> {
    F32(&'a [f32]),
    U32(&'a [u32]),
    U8(&'a [u8]),
}

/// Writes `bands` on `frame`, which lies in `crs`, as one GeoTIFF, bands in separate planes.
///
/// # Errors
/// Those of `out`; `InvalidInput` if there is no band, bands differ in type, a band has not one value
/// per node, or the grid exceeds TIFF's 32-bit sizes.
pub fn write_geotiff(
    out: impl Write + Seek,
    frame: &GridFrame,
    crs: &Crs,
    bands: &[Band<'_>],
) -> io::Result<()> {
    let keys = &crs.geo_keys();
    check(frame, bands).map_err(|e| io::Error::new(io::ErrorKind::InvalidInput, e))?;
    let bytes: usize = bands.iter().map(|b| frame.nodes() * b.samples.bytes_per_sample()).sum();
    let written = if bytes > CLASSIC_BYTES {
        write::<_, TiffKindBig>(out, frame, keys, bands)
    } else {
        write::<_, TiffKindStandard>(out, frame, keys, bands)
    };
    written.map_err(|e| match e {
        TiffError::IoError(e) => e,
        other => io::Error::other(other),
    })
}

fn check(frame: &GridFrame, bands: &[Band<'_>]) -> Result<(), String> {
    let Some(first) = bands.first() else { return Err("a raster needs at least one band".into()) };
    if u32::try_from(frame.cols().max(frame.rows())).is_err() || u16::try_from(bands.len()).is_err()
    {
        return Err("the raster has too many columns, rows or bands for TIFF".into());
    }
    for band in bands {
        if let Some(len) = band.samples.len()
            && len != frame.nodes()
        {
            return Err(format!(
                "band \"{}\" has {len} values for a grid of {} × {}",
                band.description,
                frame.cols(),
                frame.rows()
            ));
        }
        let kind = |samples: &Samples<'_>| (samples.format().to_u16(), samples.bytes_per_sample());
        if kind(&band.samples) != kind(&first.samples) {
            return Err("the bands of a raster must have the same sample type".into());
        }
    }
    Ok(())
}

fn write<W: Write + Seek, K: TiffKind>(
    out: W,
    frame: &GridFrame,
    keys: &GeoKeys,
    bands: &[Band<'_>],
) -> TiffResult<()> {
    let mut tiff = TiffEncoder::<_, K>::new_generic(out)?;
    let mut directory = tiff.image_directory()?;
    write_layout(&mut directory, frame, bands)?;
    write_place(&mut directory, frame, keys)?;
    write_names(&mut directory, bands)?;
    write_tiles(&mut directory, frame, bands)?;
    directory.finish()
}

/// Size, sample type, compression.
fn write_layout<W: Write + Seek, K: TiffKind>(
    directory: &mut DirectoryEncoder<'_, W, K>,
    frame: &GridFrame,
    bands: &[Band<'_>],
) -> TiffResult<()> {
    let samples = bands[0].samples;
    let per_band = |value: u16| vec![value; bands.len()];
    directory.write_tag(Tag::ImageWidth, u32::try_from(frame.cols())?)?;
    directory.write_tag(Tag::ImageLength, u32::try_from(frame.rows())?)?;
    directory
        .write_tag(Tag::BitsPerSample, &per_band(8 * samples.bytes_per_sample() as u16)[..])?;
    directory.write_tag(Tag::SampleFormat, &per_band(samples.format().to_u16())[..])?;
    directory.write_tag(Tag::SamplesPerPixel, u16::try_from(bands.len())?)?;
    directory.write_tag(Tag::PhotometricInterpretation, PhotometricInterpretation::BlackIsZero)?;
    if bands.len() > 1 {
        directory.write_tag(Tag::ExtraSamples, &per_band(0)[1..])?;
    }
    directory.write_tag(Tag::PlanarConfiguration, PlanarConfiguration::Planar)?;
    directory.write_tag(Tag::Compression, CompressionMethod::Deflate)?;
    directory.write_tag(Tag::Predictor, samples.predictor())?;
    directory.write_tag(Tag::TileWidth, TILE as u32)?;
    directory.write_tag(Tag::TileLength, TILE as u32)
}

/// Position on the map and CRS.
fn write_place<W: Write + Seek, K: TiffKind>(
    directory: &mut DirectoryEncoder<'_, W, K>,
    frame: &GridFrame,
    keys: &GeoKeys,
) -> TiffResult<()> {
    let step = frame.step();
    // The tie point is the north-west corner of the first pixel; the frame's origin is its centre.
    let corner = frame.to_map(DVec2::splat(-0.5));
    directory.write_tag(Tag::ModelPixelScaleTag, [step.x, step.y, 0.0])?;
    directory.write_tag(Tag::ModelTiepointTag, [0.0, 0.0, 0.0, corner.x, corner.y, 0.0])?;
    if !keys.directory.is_empty() {
        directory.write_tag(Tag::GeoKeyDirectoryTag, &keys.directory[..])?;
        if !keys.doubles.is_empty() {
            directory.write_tag(Tag::GeoDoubleParamsTag, &keys.doubles[..])?;
        }
        if !keys.ascii.is_empty() {
            // A byte for a byte, so that the keys still find their texts.
            let ascii = keys.ascii.iter().map(|b| if b.is_ascii() { char::from(*b) } else { '?' });
            directory.write_tag(Tag::GeoAsciiParamsTag, &ascii.collect::<String>()[..])?;
        }
    }
    Ok(())
}

/// Nodata, the names of the bands, the software.
fn write_names<W: Write + Seek, K: TiffKind>(
    directory: &mut DirectoryEncoder<'_, W, K>,
    bands: &[Band<'_>],
) -> TiffResult<()> {
    let mut xml = String::from("<GDALMetadata>\n");
    for (i, band) in bands.iter().enumerate() {
        let name = ascii_xml(band.description);
        xml += &format!(
            "  <Item name=\"DESCRIPTION\" sample=\"{i}\" role=\"description\">{name}</Item>\n"
        );
    }
    xml += "</GDALMetadata>\n";
    directory.write_tag(GDAL_METADATA, &xml[..])?;
    directory.write_tag(Tag::GdalNodata, bands[0].samples.nodata())?;
    directory.write_tag(Tag::Software, concat!("ridgeway ", env!("CARGO_PKG_VERSION")))
}

/// XML text in ASCII, the only encoding TIFF's texts have.
fn ascii_xml(text: &str) -> String {
    text.chars()
        .map(|c| match c {
            '<' | '>' | '&' | '"' => format!("&#{};", c as u32),
            c if c.is_ascii() && !c.is_ascii_control() => c.to_string(),
            c => format!("&#{};", c as u32),
        })
        .collect()
}

/// The tiles of each band from the north-west, row by row, and where they lie in the file.
fn write_tiles<W: Write + Seek, K: TiffKind>(
    directory: &mut DirectoryEncoder<'_, W, K>,
    frame: &GridFrame,
    bands: &[Band<'_>],
) -> TiffResult<()> {
    let (mut offsets, mut sizes) = (Vec::new(), Vec::new());
    for band in bands {
        let mut made = Vec::new();
        for row in (0..frame.rows()).step_by(TILE) {
            // Compressed in parallel a row of tiles at a time, which bounds the memory.
            let rows = row..(row + TILE).min(frame.rows());
            let lines = band.samples.rows(rows, frame.cols(), &mut made);
            let tiles = (0..frame.cols().div_ceil(TILE))
                .into_par_iter()
                .map(|tile| compress(&filtered(lines, frame.cols(), tile * TILE)))
                .collect::<io::Result<Vec<_>>>()?;
            for tile in &tiles {
                let offset = directory.write_data(&tile[..])?;
                offsets.push(K::convert_offset(offset)?);
                sizes.push(K::convert_offset(tile.len() as u64)?);
            }
        }
    }
    directory.write_tag(Tag::TileOffsets, K::convert_slice(&offsets))?;
    directory.write_tag(Tag::TileByteCounts, K::convert_slice(&sizes))
}

/// The bytes of the tile from column `col` on of a row of tiles, after the predictor; zero beyond the edge.
fn filtered(lines: Lines<'_>, cols: usize, col: usize) -> Vec<u8> {
    let mut tile = Vec::with_capacity(TILE * TILE * size_of::<f32>());
    for row in 0..TILE {
        match lines {
            Lines::F32(values) => float_differences(part(values, cols, row, col), &mut tile),
            Lines::U32(values) => {
                let mut left = 0u32;
                for here in padded(part(values, cols, row, col)) {
                    tile.extend(here.wrapping_sub(left).to_ne_bytes());
                    left = here;
                }
            }
            Lines::U8(values) => {
                let mut left = 0u8;
                for here in padded(part(values, cols, row, col)) {
                    tile.push(here.wrapping_sub(left));
                    left = here;
                }
            }
        }
    }
    tile
}

/// The part of a row of `cols` values that a tile from column `col` on has; nothing of a row beyond the last.
fn part<T>(values: &[T], cols: usize, row: usize, col: usize) -> &[T] {
    let start = row * cols + col;
    if start < values.len() { &values[start..start + TILE.min(cols - col)] } else { &[] }
}

/// One line of a tile: the values, then zeros.
fn padded<T: Copy + Default>(values: &[T]) -> impl Iterator<Item = T> {
    values.iter().copied().chain(std::iter::repeat(T::default())).take(TILE)
}

/// TIFF's predictor 3 (Adobe Photoshop TIFF Technical Note 3): the most significant bytes of the
/// line, then the second ones, and so on; then differences of successive bytes.
fn float_differences(values: &[f32], out: &mut Vec<u8>) {
    let start = out.len();
    out.resize(start + 4 * TILE, 0);
    let line = &mut out[start..];
    for (i, value) in padded(values).enumerate() {
        let value = if value.is_finite() { value } else { f32::NAN };
        for (plane, byte) in value.to_be_bytes().into_iter().enumerate() {
            line[plane * TILE + i] = byte;
        }
    }
    for i in (1..line.len()).rev() {
        line[i] = line[i].wrapping_sub(line[i - 1]);
    }
}

fn compress(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(LEVEL));
    encoder.write_all(bytes)?;
    encoder.finish()
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use tiff::decoder::{Decoder, DecodingResult};

    use super::*;
    use crate::grid::Ground;

    fn frame(cols: usize, rows: usize) -> GridFrame {
        let origin = DVec2::new(400_015.0, 4_599_985.0);
        GridFrame::new(cols, rows, origin, DVec2::splat(30.0), Ground::METRES).unwrap()
    }

    fn written(frame: &GridFrame, bands: &[Band<'_>]) -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        write_geotiff(&mut out, frame, &Crs::from_epsg(32631).unwrap(), bands).unwrap();
        out.into_inner()
    }

    #[test]
    fn floats_read_back_with_their_place() {
        let frame = frame(300, 270);
        let mut values: Vec<f32> = (0..frame.nodes()).map(|i| (i as f32).sin() * 1e3).collect();
        values[5] = f32::INFINITY;
        let band = Band { description: "distance (m) of <κ>", samples: Samples::F32(&values) };
        let bytes = written(&frame, &[band]);
        let mut tiff = Decoder::new(Cursor::new(&bytes)).unwrap();
        assert_eq!(tiff.dimensions().unwrap(), (300, 270));
        let tiepoint = tiff.get_tag_f64_vec(Tag::ModelTiepointTag).unwrap();
        assert_eq!(tiepoint, [0.0, 0.0, 0.0, 400_000.0, 4_600_000.0, 0.0]);
        assert_eq!(tiff.get_tag_f64_vec(Tag::ModelPixelScaleTag).unwrap(), [30.0, 30.0, 0.0]);
        assert_eq!(tiff.get_tag_ascii_string(Tag::GdalNodata).unwrap(), "nan");
        let xml = tiff.get_tag_ascii_string(GDAL_METADATA).unwrap();
        assert!(xml.contains("distance (m) of &#60;&#954;&#62;"), "{xml}");
        let DecodingResult::F32(read) = tiff.read_image().unwrap() else { panic!("floats") };
        for (i, (a, b)) in read.iter().zip(&values).enumerate() {
            assert!(a == b || (i == 5 && a.is_nan()), "{a} for {b} at {i}");
        }
    }

    #[test]
    fn rows_made_on_demand_are_those_of_a_slice() {
        let frame = frame(300, 270);
        let value = |row: usize, col: usize| (row * 300 + col) as f32;
        let values: Vec<f32> = (0..frame.nodes()).map(|i| value(i / 300, i % 300)).collect();
        let make = |row: usize, line: &mut [f32]| {
            line.iter_mut().enumerate().for_each(|(col, v)| *v = value(row, col));
        };
        let band = |samples| Band { description: "distance", samples };
        assert_eq!(
            written(&frame, &[band(Samples::F32Rows(&make)), band(Samples::F32(&values))]),
            written(&frame, &[band(Samples::F32(&values)), band(Samples::F32Rows(&make))]),
        );
    }

    #[test]
    fn labels_read_back() {
        let frame = frame(257, 3);
        let labels: Vec<u32> =
            (0..frame.nodes() as u32).map(|i| i.wrapping_mul(2_654_435_769)).collect();
        let band = Band { description: "region", samples: Samples::U32(&labels) };
        let bytes = written(&frame, &[band]);
        let read = Decoder::new(Cursor::new(&bytes)).unwrap().read_image().unwrap();
        assert!(matches!(read, DecodingResult::U32(read) if read == labels));
    }

    #[test]
    fn big_tiff_and_threads_change_no_value() {
        let frame = frame(600, 2);
        let classes: Vec<u8> = (0..frame.nodes()).map(|i| (i * i) as u8).collect();
        let bands = [Band { description: "class", samples: Samples::U8(&classes) }];
        let mut out = Cursor::new(Vec::new());
        write::<_, TiffKindBig>(&mut out, &frame, &GeoKeys::default(), &bands).unwrap();
        let read = Decoder::new(Cursor::new(out.into_inner())).unwrap().read_image().unwrap();
        assert!(matches!(read, DecodingResult::U8(read) if read == classes));
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(one.install(|| written(&frame, &bands)), written(&frame, &bands));
    }

    #[test]
    fn foreign_letters_in_the_keys_keep_their_place() {
        let keys = GeoKeys {
            directory: vec![1, 1, 0, 1, 1026, 34737, 7, 0],
            ascii: b"R\xe9seau|".to_vec(),
            ..GeoKeys::default()
        };
        let floats = [0f32; 4];
        let bands = [Band { description: "", samples: Samples::F32(&floats) }];
        let mut out = Cursor::new(Vec::new());
        write::<_, TiffKindStandard>(&mut out, &frame(2, 2), &keys, &bands).unwrap();
        let mut tiff = Decoder::new(Cursor::new(out.into_inner())).unwrap();
        assert_eq!(tiff.get_tag_ascii_string(Tag::GeoAsciiParamsTag).unwrap(), "R?seau|");
    }

    #[test]
    fn wrong_bands_are_refused() {
        let write = |bands: &[Band<'_>]| {
            write_geotiff(Cursor::new(Vec::new()), &frame(2, 2), &Crs::none(), bands)
        };
        let (floats, bytes) = ([0f32; 4], [0u8; 4]);
        let band = |samples| Band { description: "", samples };
        assert!(write(&[]).is_err());
        assert!(write(&[band(Samples::F32(&floats[1..]))]).is_err());
        assert!(write(&[band(Samples::F32(&floats)), band(Samples::U8(&bytes))]).is_err());
        assert!(write(&[band(Samples::U8(&bytes))]).is_ok());
    }
}
