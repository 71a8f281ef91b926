//! Rasters as GeoTIFF: tiled, Deflate with a predictor, georeferenced.
//!
//! The `tiff` crate writes header and directory; it has no tiles and no floating-point predictor, so
//! the tiles are made here. BigTIFF is used where the classic format's 4 GB could be exceeded.

mod band;
mod directory;
mod tile;

use std::io::{self, Seek, Write};

use tiff::encoder::{TiffEncoder, TiffKind, TiffKindBig, TiffKindStandard};
use tiff::{TiffError, TiffResult};

use self::band::check_bands;
pub use self::band::{Band, Samples};
use self::directory::{write_georeference, write_names, write_sample_layout};
use self::tile::write_tiles;
use crate::grid::GridFrame;
use crate::terrain::{Crs, GeoKeys};

/// Most bytes of samples in a classic TIFF. Its limit is 4 GB; the rest is room for the padding of
/// edge tiles and for data that Deflate cannot shorten.
const CLASSIC_BYTES: usize = 3 << 30;

/// Writes `bands` on `frame`, which lies in `crs`, as one GeoTIFF, bands in separate planes.
///
/// # Cost
/// Some 25 ns of one core per value, on the current rayon pool; besides, one row of tiles in memory.
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
    check_bands(frame, bands).map_err(|e| io::Error::new(io::ErrorKind::InvalidInput, e))?;
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

fn write<W: Write + Seek, K: TiffKind>(
    out: W,
    frame: &GridFrame,
    keys: &GeoKeys,
    bands: &[Band<'_>],
) -> TiffResult<()> {
    let mut tiff = TiffEncoder::<_, K>::new_generic(out)?;
    let mut directory = tiff.image_directory()?;
    write_sample_layout(&mut directory, frame, bands)?;
    write_georeference(&mut directory, frame, keys)?;
    write_names(&mut directory, bands)?;
    write_tiles(&mut directory, frame, bands)?;
    directory.finish()
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use glam::DVec2;
    use tiff::decoder::{Decoder, DecodingResult};
    use tiff::tags::Tag;

    use super::directory::GDAL_METADATA;
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
