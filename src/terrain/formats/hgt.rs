//! SRTM tiles: big-endian metres, the place in the name, plain or in a gzip or zip.
//!
//! A tile covers one degree, its outermost nodes lie on the full degrees, and −32768 is a void (*SRTM
//! Topography*, USGS, section 2).

use std::io::{Cursor, Read};
use std::path::Path;

use glam::DVec2;

use crate::error::{Error, Result};
use crate::terrain::{Crs, Raster, Source};

/// Nodes along a side: 3″ and 1″ tiles.
const SIDES: [usize; 2] = [1201, 3601];
/// Bytes of the largest tile.
const LARGEST: u64 = 2 * 3601 * 3601;
const VOID: i16 = i16::MIN;

/// Reads a tile that has been unpacked; `path` gives the place.
pub(in crate::terrain) fn read(path: &Path, bytes: &[u8]) -> Result<Raster> {
    let Some(side) = SIDES.into_iter().find(|side| 2 * side * side == bytes.len()) else {
        return Err(Error::format(
            path,
            format!(
                "a tile has 1201 × 1201 or 3601 × 3601 cells of two bytes, 2884802 or 25934402 bytes; \
                 this one has {}",
                bytes.len()
            ),
        ));
    };
    let Some(corner) = south_west_corner(path) else {
        return Err(Error::format(
            path,
            "the name of a tile tells its place, such as N42E001.hgt for 42° N 1° E; this name does not",
        ));
    };
    let (cells, _) = bytes.as_chunks::<2>();
    let height = |cell: &[u8; 2]| match i16::from_be_bytes(*cell) {
        VOID => f64::NAN,
        height => height.into(),
    };
    let step = 1.0 / (side - 1) as f64;
    Ok(Raster {
        cols: side,
        rows: side,
        origin: corner + DVec2::Y,
        step: DVec2::new(step, -step),
        crs: Crs::from_epsg(4326)?,
        bands: vec![cells.iter().map(height).collect()],
        source: Source {
            format: "SRTM HGT".to_owned(),
            sample: "int16".to_owned(),
            nodata: Some(VOID.to_string()),
            ..Source::default()
        },
        notes: Vec::new(),
    })
}

/// `N42E001…` is 42° N, 1° E.
fn south_west_corner(path: &Path) -> Option<DVec2> {
    let name = path.file_name()?.to_str()?.to_ascii_uppercase();
    let number = |from: usize, to: usize| -> Option<f64> {
        let digits = name.get(from..to).filter(|d| d.bytes().all(|b| b.is_ascii_digit()))?;
        digits.parse().ok()
    };
    let sign = |at: usize, positive: u8, negative: u8| match name.as_bytes().get(at)? {
        b if *b == positive => Some(1.0),
        b if *b == negative => Some(-1.0),
        _ => None,
    };
    let lat = sign(0, b'N', b'S')? * number(1, 3)?;
    let lon = sign(3, b'E', b'W')? * number(4, 7)?;
    Some(DVec2::new(lon, lat))
}

/// Unpacks a gzip, to the size of the largest tile and no further.
pub(in crate::terrain) fn gunzip(path: &Path, bytes: &[u8]) -> Result<Vec<u8>> {
    at_most_a_tile(path, flate2::read::MultiGzDecoder::new(bytes))
}

/// Unpacks the one tile of a zip archive.
pub(in crate::terrain) fn unzip(path: &Path, bytes: &[u8]) -> Result<Vec<u8>> {
    let fault =
        |e: zip::result::ZipError| Error::format(path, format!("the zip archive is damaged: {e}"));
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).map_err(fault)?;
    for i in 0..archive.len() {
        let file = archive.by_index(i).map_err(fault)?;
        if file.name().map_err(fault)?.to_ascii_lowercase().ends_with(".hgt") {
            return at_most_a_tile(path, file);
        }
    }
    Err(Error::format(path, "there is no .hgt file in the zip archive"))
}

fn at_most_a_tile(path: &Path, stream: impl Read) -> Result<Vec<u8>> {
    let mut tile = Vec::new();
    stream
        .take(LARGEST + 1)
        .read_to_end(&mut tile)
        .map_err(|e| Error::format(path, format!("the compressed tile is damaged: {e}")))?;
    Ok(tile)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_the_place() {
        let at = |name: &str| south_west_corner(Path::new(name));
        assert_eq!(at("dir/N42E001.hgt"), Some(DVec2::new(1.0, 42.0)));
        assert_eq!(at("s01w002.SRTMGL1.hgt.zip"), Some(DVec2::new(-2.0, -1.0)));
        for name in ["dem.hgt", "N4E001.hgt", "N42X001.hgt", "N+2E001.hgt", "N42", "é42E001.hgt"] {
            assert_eq!(at(name), None, "{name}");
        }
    }

    #[test]
    fn a_tile_is_big_endian_and_runs_from_the_north_west() {
        let mut bytes = vec![0; 2 * 1201 * 1201];
        bytes[..6].copy_from_slice(&[0x01, 0x02, 0xff, 0xff, 0x80, 0x00]);
        let raster = read(Path::new("S01W002.hgt"), &bytes).unwrap();
        assert_eq!(raster.bands[0][..2], [258.0, -1.0]);
        assert!(raster.bands[0][2].is_nan());
        assert_eq!(raster.origin, DVec2::new(-2.0, 0.0));
        assert!(read(Path::new("S01W002.hgt"), &bytes[1..]).is_err());
        assert!(read(Path::new("tile.hgt"), &bytes).unwrap_err().to_string().contains("name"));
    }
}
