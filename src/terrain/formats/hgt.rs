//! SRTM tiles: big-endian metres, the place in the name, plain or in a gzip or zip.
//!
//! A tile covers one degree, its outermost nodes lie on the full degrees, and −32768 is a void (*SRTM
//! Topography*, USGS, section 2). Products made from SRTM mark voids by −32767 or −9999 as well.

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

/// Columns and rows: tiles of 3″, 1″, 2″ × 1″ (beyond 50° of latitude), ½″.
const SIZES: [[usize; 2]; 4] = [[1201, 1201], [3601, 3601], [1801, 3601], [7201, 7201]];
/// Bytes of the largest tile.
const LARGEST: u64 = 2 * 7201 * 7201;
const VOID: i16 = i16::MIN;
/// Other voids; no land lies there.
const OTHER_VOIDS: [i16; 2] = [-32767, -9999];

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
    let Some([cols, rows]) = SIZES.into_iter().find(|[cols, rows]| 2 * cols * rows == bytes.len())
    else {
        let sizes = SIZES.map(|[cols, rows]| format!("{cols} × {rows}")).join(", ");
        let expected = format!("2 bytes for each of {sizes} cells");
        let found = format!("{} bytes", bytes.len());
        return Err(Error::argument("the size of the tile", found, expected).in_file(path));
    };
    let Some(corner) = south_west_corner(path) else {
        let expected = "that of its place, such as N42E001.hgt for 42° N 1° E";
        let found = format!("{}", path.file_name().unwrap_or_default().display());
        return Err(Error::argument("the name of the tile", found, expected).in_file(path));
    };
    let (cells, _) = bytes.as_chunks::<2>();
    let stored = |cell: &[u8; 2]| i16::from_be_bytes(*cell);
    let height = |cell: &[u8; 2]| match stored(cell) {
        height if height == VOID || OTHER_VOIDS.contains(&height) => f64::NAN,
        height => height.into(),
    };
    let other = cells.iter().map(stored).find(|height| OTHER_VOIDS.contains(height));
    let note = other.map(|height| format!("cells of {height} were taken as voids"));
    Ok(Raster {
        cols,
        rows,
        origin: corner + DVec2::Y,
        step: DVec2::new(1.0 / (cols - 1) as f64, -1.0 / (rows - 1) as f64),
        crs: Crs::from_epsg(4326)?,
        bands: vec![cells.iter().map(height).collect()],
        source: Source {
            format: FORMAT.name.to_owned(),
            sample: "int16".to_owned(),
            nodata: Some(VOID.to_string()),
            ..Source::default()
        },
        says_height_unit: true,
        notes: note.into_iter().collect(),
    })
}

/// `N42E001.…` is 42° N, 1° E. More letters or digits behind it would say that it is another part of the world.
fn south_west_corner(path: &Path) -> Option<DVec2> {
    let name = path.file_name()?.to_str()?.to_ascii_uppercase();
    if name.get(7..)?.starts_with(|c: char| c.is_ascii_alphanumeric()) {
        return None;
    }
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
        assert_eq!(at("N42E001_1arc.hgt"), Some(DVec2::new(1.0, 42.0)));
        for name in [
            "N45W074T86.hgt",
            "dem.hgt",
            "N4E001.hgt",
            "N42X001.hgt",
            "N+2E001.hgt",
            "N42",
            "é42E001.hgt",
        ] {
            assert_eq!(at(name), None, "{name}");
        }
    }

    #[test]
    fn a_tile_is_big_endian_and_runs_from_the_north_west() {
        let mut bytes = vec![0; 2 * 1201 * 1201];
        bytes[..8].copy_from_slice(&[0x01, 0x02, 0xff, 0xff, 0x80, 0x00, 0x80, 0x01]);
        let raster = read_tile(Path::new("S01W002.hgt"), &bytes).unwrap();
        assert_eq!(raster.bands[0][..2], [258.0, -1.0]);
        assert!(raster.bands[0][2].is_nan() && raster.bands[0][3].is_nan());
        assert!(raster.notes[0].contains("-32767"));
        assert_eq!(raster.origin, DVec2::new(-2.0, 0.0));
        assert!(read_tile(Path::new("S01W002.hgt"), &bytes[1..]).is_err());
        assert!(read_tile(Path::new("tile.hgt"), &bytes).unwrap_err().to_string().contains("name"));
    }

    #[test]
    fn tiles_of_the_north_have_half_the_columns() {
        let raster = read_tile(Path::new("N61E010.hgt"), &vec![0; 2 * 1801 * 3601]).unwrap();
        assert_eq!((raster.cols, raster.rows), (1801, 3601));
        assert_eq!(raster.step, DVec2::new(1.0 / 1800.0, -1.0 / 3600.0));
    }
}
