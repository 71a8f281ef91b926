//! The tiles of a raster, filtered by a predictor and compressed.

use std::io::{self, Seek, Write};

use flate2::Compression;
use flate2::write::ZlibEncoder;
use rayon::prelude::*;
use tiff::TiffResult;
use tiff::encoder::{DirectoryEncoder, TiffKind};
use tiff::tags::Tag;

use super::band::{Band, Rows};
use crate::grid::GridFrame;

/// Side of a tile in pixels, GDAL's default.
pub(super) const TILE: usize = 256;
/// Deflate level. On distances over 4000² cells, levels 1, 4 and 6 take 25, 53 and 70 ns per cell of one core and leave
/// 56, 49 and 48 % of the size.
const LEVEL: u32 = 1;

/// The tiles of each band from the north-west, row by row, and where they lie in the file.
pub(super) fn write_tiles<W: Write + Seek, K: TiffKind>(
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
fn filtered(lines: Rows<'_>, cols: usize, col: usize) -> Vec<u8> {
    let mut tile = Vec::with_capacity(TILE * TILE * size_of::<f32>());
    for row in 0..TILE {
        match lines {
            Rows::F32(values) => float_differences(part(values, cols, row, col), &mut tile),
            Rows::U32(values) => {
                let mut left = 0u32;
                for here in padded(part(values, cols, row, col)) {
                    tile.extend(here.wrapping_sub(left).to_ne_bytes());
                    left = here;
                }
            }
            Rows::U8(values) => {
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
