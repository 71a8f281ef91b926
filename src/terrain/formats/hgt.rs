//! SRTM tiles: big-endian metres, the place in the name, plain or in a gzip or zip.
//!
//! A tile covers one degree, its outermost nodes lie on the full degrees, and −32768 is a void (*SRTM
//! Topography*, USGS, section 2).

use std::io::Read;
use std::path::Path;

use glam::DVec2;

use super::format::{Format, Head, ReadMode};
use crate::error::{Error, Remedy, Result};
use crate::terrain::raster::Raster;
use crate::terrain::{Crs, Source};

pub(super) const FORMAT: Format =
    Format { name: "SRTM HGT", is_own: is_named_so, extensions: &["hgt"], read };

const GZIP: &[u8] = b"\x1f\x8b";
const ZIP: &[u8] = b"PK\x03\x04";

/// Nodes along a side: 3″ and 1″ tiles.
const SIDES: [usize; 2] = [1201, 3601];
/// Bytes of the largest tile.
const LARGEST: u64 = 2 * 3601 * 3601;
const VOID: i16 = i16::MIN;

/// A tile has no magic number: `.hgt`, or an archive of such a file by its name.
fn is_named_so(head: &Head) -> bool {
    let packed = head.bytes.starts_with(GZIP) || head.bytes.starts_with(ZIP);
    head.extension == "hgt" || (packed && head.inner_extension == "hgt")
}

fn read(path: &Path, bytes: &[u8], _: ReadMode) -> Result<Raster> {
    // The heights of a tile that is not packed may begin like an archive.
    let packed = !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("hgt"));
    if packed && bytes.starts_with(GZIP) {
        read_tile(path, &gunzip(path, bytes)?)
    } else if packed && bytes.starts_with(ZIP) {
        read_tile(path, &unzip(path, bytes)?)
    } else {
        read_tile(path, bytes)
    }
}

/// Reads a tile that has been unpacked; `path` gives the place.
fn read_tile(path: &Path, bytes: &[u8]) -> Result<Raster> {
    let Some(side) = SIDES.into_iter().find(|side| 2 * side * side == bytes.len()) else {
        let expected =
            "2884802 or 25934402 bytes, for 1201 × 1201 or 3601 × 3601 cells of two bytes";
        let found = format!("{} bytes", bytes.len());
        return Err(Error::argument("the size of the tile", found, expected).in_file(path));
    };
    let Some(corner) = south_west_corner(path) else {
        let expected = "that of its place, such as N42E001.hgt for 42° N 1° E";
        let found = format!("{}", path.file_name().unwrap_or_default().display());
        return Err(Error::argument("the name of the tile", found, expected).in_file(path));
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
            format: FORMAT.name.to_owned(),
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
    let lat = degrees(name.get(..3)?, 'N', 'S')?;
    let lon = degrees(name.get(3..7)?, 'E', 'W')?;
    Some(DVec2::new(lon, lat))
}

/// `W002` is −2 where `E` is positive and `W` negative.
fn degrees(text: &str, positive: char, negative: char) -> Option<f64> {
    let (sign, digits) = match text.strip_prefix(positive) {
        Some(digits) => (1.0, digits),
        None => (-1.0, text.strip_prefix(negative)?),
    };
    let is_number = digits.bytes().all(|b| b.is_ascii_digit());
    is_number.then(|| digits.parse::<f64>().ok()).flatten().map(|number| sign * number)
}

/// Unpacks a gzip.
fn gunzip(path: &Path, bytes: &[u8]) -> Result<Vec<u8>> {
    at_most_a_tile(path, flate2::read::MultiGzDecoder::new(bytes))
}

/// Unpacks the one tile of a zip archive.
#[cfg(feature = "zip")]
fn unzip(path: &Path, bytes: &[u8]) -> Result<Vec<u8>> {
    use rawzip::{CompressionMethod, ZipArchive};

    let damaged = |cause: rawzip::Error| Error::damaged("the zip archive", cause).in_file(path);
    let archive = ZipArchive::from_slice(bytes).map_err(damaged)?;
    let mut entries = archive.entries();
    while let Some(entry) = entries.next_entry().map_err(damaged)? {
        if !entry.file_path().as_bytes().to_ascii_lowercase().ends_with(b".hgt") {
            continue;
        }
        let tile = archive.get_entry(entry.wayfinder()).map_err(damaged)?;
        return match entry.compression_method() {
            CompressionMethod::STORE => at_most_a_tile(path, tile.verifying_reader(tile.data())),
            CompressionMethod::DEFLATE => {
                let plain = flate2::bufread::DeflateDecoder::new(tile.data());
                at_most_a_tile(path, tile.verifying_reader(plain))
            }
            _ => Err(unpack_first(path, "a zip archive packed by another method than Deflate")),
        };
    }
    let expected = "1 or more";
    Err(Error::argument("the number of .hgt files in the zip archive", 0, expected).in_file(path))
}

#[cfg(not(feature = "zip"))]
fn unzip(path: &Path, _: &[u8]) -> Result<Vec<u8>> {
    Err(unpack_first(path, "a zip archive, which is read with the feature `zip` only"))
}

fn unpack_first(path: &Path, found: &str) -> Error {
    Error::unsupported(path, found, Remedy::Unpack)
}

/// Unpacks to the size of the largest tile and a byte more, whatever the archive claims.
fn at_most_a_tile(path: &Path, stream: impl Read) -> Result<Vec<u8>> {
    let mut tile = Vec::new();
    stream
        .take(LARGEST + 1)
        .read_to_end(&mut tile)
        .map_err(|e| Error::damaged("the compressed tile", e).in_file(path))?;
    Ok(tile)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_give_the_place() {
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
        let raster = read_tile(Path::new("S01W002.hgt"), &bytes).unwrap();
        assert_eq!(raster.bands[0][..2], [258.0, -1.0]);
        assert!(raster.bands[0][2].is_nan());
        assert_eq!(raster.origin, DVec2::new(-2.0, 0.0));
        assert!(read_tile(Path::new("S01W002.hgt"), &bytes[1..]).is_err());
        assert!(read_tile(Path::new("tile.hgt"), &bytes).unwrap_err().to_string().contains("name"));
    }
}
