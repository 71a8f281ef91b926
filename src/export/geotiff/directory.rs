//! The tags that say what the samples are and where they lie.

use std::io::{Seek, Write};

use glam::DVec2;
use tiff::TiffResult;
use tiff::encoder::{DirectoryEncoder, TiffKind};
use tiff::tags::{CompressionMethod, PhotometricInterpretation, PlanarConfiguration, Tag};

use super::band::Band;
use super::tile::TILE;
use crate::grid::GridFrame;
use crate::terrain::GeoKeys;

/// `GDAL_METADATA`, TIFF tag 42112: an XML text that GDAL-based programs read band names from.
pub(super) const GDAL_METADATA: Tag = Tag::Unknown(42112);

/// Size, sample type, compression.
pub(super) fn write_sample_layout<W: Write + Seek, K: TiffKind>(
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
pub(super) fn write_georeference<W: Write + Seek, K: TiffKind>(
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
pub(super) fn write_names<W: Write + Seek, K: TiffKind>(
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
