//! Where the samples of an image lie in the file, and how to get them.

use rayon::prelude::*;

use super::codec::Codec;
use super::container::Tiff;
use super::directory::Directory;
use super::error::{TiffError, TiffResult, damaged, unsupported};
use super::predictor::Predictor;
use super::sample::Sample;
use super::tag;
use crate::error::{Error, Remedy};
use crate::memory;

/// How the samples of one image are laid out in the file.
pub(crate) struct Layout<'a> {
    tiff: Tiff<'a>,
    /// Number of columns.
    pub(crate) cols: usize,
    /// Number of rows.
    pub(crate) rows: usize,
    /// Number of samples at each place.
    pub(crate) bands: usize,
    /// How one sample is stored.
    pub(crate) sample: Sample,
    codec: Codec,
    predictor: Predictor,
    chunks: Chunks,
    /// `FillOrder` 2: the bits of every stored byte are in reverse order, also where it is compressed (TIFF 6.0, section 8).
    is_bit_reversed: bool,
}

/// The parts of an image that are stored by themselves.
struct Chunks {
    /// Tiles, which are whole even where the image ends within them, or strips, whose last is not.
    tiled: bool,
    /// Whether each band has its own chunks.
    planar: bool,
    /// Columns and rows of one; a strip is as wide as the image.
    cols: usize,
    rows: usize,
    /// Where each begins, and how many bytes it has; none where it is absent.
    offsets: Vec<u64>,
    counts: Vec<u64>,
}

impl<'a> Layout<'a> {
    pub(crate) fn new(image: &Directory<'a>) -> TiffResult<Self> {
        let cols = positive(image, tag::IMAGE_WIDTH, "ImageWidth")?;
        let rows = positive(image, tag::IMAGE_LENGTH, "ImageLength")?;
        let bands = match image.uint(tag::SAMPLES_PER_PIXEL, 1)? {
            n @ 1..=65535 => n as usize,
            n => return damaged("SamplesPerPixel", n, "1 to 65535"),
        };
        let bits = common_value(image, tag::BITS_PER_SAMPLE)?;
        let sample = Sample::new(bits, common_value(image, tag::SAMPLE_FORMAT)?)?;
        let layout = Self {
            tiff: image.tiff,
            cols,
            rows,
            bands,
            sample,
            codec: Codec::new(image.uint(tag::COMPRESSION, 1)?)?,
            predictor: Predictor::new(image.uint(tag::PREDICTOR, 1)?, sample)?,
            chunks: Chunks::new(image, cols, rows, bands)?,
            is_bit_reversed: image.uint(tag::FILL_ORDER, 1)? == 2,
        };
        layout.check_size()?;
        Ok(layout)
    }

    /// Samples side by side in a chunk: all bands, or one if each has its own chunks.
    fn interleaved(&self) -> usize {
        if self.chunks.planar { 1 } else { self.bands }
    }

    /// Bytes of one row of a chunk, once expanded. At most 2³² samples of 64 bits in 65535 bands: no overflow.
    fn row_bytes(&self) -> usize {
        (self.chunks.cols * self.interleaved() * self.sample.bits()).div_ceil(8)
    }

    fn chunks_across(&self) -> usize {
        self.cols.div_ceil(self.chunks.cols)
    }

    fn chunks_down(&self) -> usize {
        self.rows.div_ceil(self.chunks.rows)
    }

    /// Refuses an image that claims more samples than its bytes can hold, before anything is allocated.
    fn check_size(&self) -> TiffResult<()> {
        /// Most cells, and bands of them, that may be absent (sparse), for which the file has no bytes.
        const SPARSE_CELLS: u64 = 1 << 24;
        const SPARSE_BANDS: u64 = 4;
        let planes = if self.chunks.planar { self.bands } else { 1 };
        let chunks = (self.chunks_across() * self.chunks_down()).saturating_mul(planes);
        let listed = self.chunks.offsets.len().min(self.chunks.counts.len());
        if listed < chunks {
            let expected = format!("{chunks} for {} × {} cells", self.cols, self.rows);
            return damaged("the number of strips or tiles listed", listed, expected);
        }
        let file = self.tiff.bytes.len() as u64;
        let sum = self.chunks.counts.iter().fold(0u64, |sum, n| sum.saturating_add(*n));
        let bits = sum.min(file).saturating_mul(self.codec.most_expansion() * 8);
        let bands = self.bands as u64;
        let stored = bits / self.sample.bits() as u64;
        let sparse = SPARSE_CELLS * bands.min(SPARSE_BANDS);
        let claimed = (self.cols as u64 * self.rows as u64).saturating_mul(bands);
        if claimed > stored.saturating_add(sparse) {
            return damaged(
                "the number of samples",
                format!("{} × {} in {bands} bands", self.cols, self.rows),
                format!("no more than the file's {file} bytes can hold"),
            );
        }
        Ok(())
    }

    /// The samples of a band, row by row as stored; `absent` where a chunk is.
    pub(crate) fn band(&self, band: usize, absent: f64) -> TiffResult<Vec<f64>> {
        let cells = self.cols * self.rows;
        memory::check_cells("a band of", [self.cols, self.rows], size_of::<f64>())?;
        // Only to see if there is room: zeroed memory costs nothing before it is used, and then the threads share the cost.
        if Vec::<f64>::new().try_reserve_exact(cells).is_err() {
            return Err(TiffError::TooLarge { bytes: (cells as u64).saturating_mul(8) });
        }
        let mut values = vec![0.0; cells];
        // The first error of the file, so that the message does not depend on the threads.
        let error = values
            .par_chunks_mut(self.chunks.rows * self.cols)
            .enumerate()
            .find_map_first(|(down, rows)| self.read_chunk_row(band, down, absent, rows).err());
        error.map_or(Ok(values), Err)
    }

    /// Fills the rows that one row of chunks covers.
    fn read_chunk_row(
        &self,
        band: usize,
        down: usize,
        absent: f64,
        rows: &mut [f64],
    ) -> TiffResult<()> {
        let across = self.chunks_across();
        let (plane, first) = if self.chunks.planar { (band, 0) } else { (0, band) };
        let chunk_rows = if self.chunks.tiled { self.chunks.rows } else { rows.len() / self.cols };
        for tile in 0..across {
            let index = (plane * self.chunks_down() + down) * across + tile;
            let left = tile * self.chunks.cols;
            let width = self.chunks.cols.min(self.cols - left);
            let Some(bytes) = self.read_chunk(index, chunk_rows)? else {
                let lines = rows.chunks_exact_mut(self.cols);
                lines.for_each(|line| line[left..left + width].fill(absent));
                continue;
            };
            let stored_rows = bytes.chunks_exact(self.row_bytes());
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
    fn read_chunk(&self, index: usize, rows: usize) -> TiffResult<Option<Vec<u8>>> {
        let (offset, count) = (self.chunks.offsets[index], self.chunks.counts[index]);
        if count == 0 {
            return Ok(None);
        }
        let chunk = format!("{} {index}", if self.chunks.tiled { "tile" } else { "strip" });
        let Some(stored) = self.tiff.slice(offset, count) else {
            return Err(Error::argument(
                format!("the end of {chunk}"),
                format!("byte {}", offset.saturating_add(count)),
                format!("within the {} bytes of the file", self.tiff.bytes.len()),
            )
            .advise("the file is cut short")
            .into());
        };
        let length = self.row_bytes().saturating_mul(rows);
        if length as u64 > count.saturating_mul(self.codec.most_expansion()) {
            return damaged(
                format!("the size of {chunk}"),
                format!("{count} bytes"),
                format!("enough to expand to {length}"),
            );
        }
        let reversed: Vec<u8>;
        let stored = if self.is_bit_reversed {
            reversed = stored.iter().map(|byte| byte.reverse_bits()).collect();
            &reversed
        } else {
            stored
        };
        let mut bytes = self.codec.expand(stored, length).map_err(|e| Error::damaged(chunk, e))?;
        for row in bytes.chunks_exact_mut(self.row_bytes()) {
            self.predictor.undo(row, self.sample, self.interleaved(), self.tiff.big_endian);
        }
        Ok(Some(bytes))
    }
}

impl Chunks {
    fn new(image: &Directory, cols: usize, rows: usize, bands: usize) -> TiffResult<Self> {
        /// Cells that a tile may have though the image has fewer.
        const LARGEST_SPARE_TILE: usize = 1 << 24;
        let tiled = image.uints(tag::TILE_OFFSETS)?.is_some();
        let (chunk_cols, chunk_rows) = if tiled {
            let cols = positive(image, tag::TILE_WIDTH, "TileWidth")?;
            (cols, positive(image, tag::TILE_LENGTH, "TileLength")?)
        } else {
            match image.uint(tag::ROWS_PER_STRIP, u64::MAX)? {
                0 => return damaged("RowsPerStrip", 0, "1 or more"),
                n => (cols, usize::try_from(n).unwrap_or(rows).min(rows)),
            }
        };
        let most = cols.saturating_mul(rows).max(LARGEST_SPARE_TILE);
        if chunk_cols.saturating_mul(chunk_rows) > most {
            let found = format!("{chunk_cols} × {chunk_rows} cells");
            return damaged("the size of a tile", found, "no larger than the image");
        }
        let (offsets, counts) = if tiled {
            (tag::TILE_OFFSETS, tag::TILE_BYTE_COUNTS)
        } else {
            (tag::STRIP_OFFSETS, tag::STRIP_BYTE_COUNTS)
        };
        Ok(Self {
            tiled,
            planar: bands > 1 && image.uint(tag::PLANAR_CONFIGURATION, 1)? == 2,
            cols: chunk_cols,
            rows: chunk_rows,
            offsets: image.uints(offsets)?.unwrap_or_default(),
            counts: image.uints(counts)?.unwrap_or_default(),
        })
    }
}

/// A width or length.
fn positive(image: &Directory, tag: u16, name: &str) -> TiffResult<usize> {
    let value = image.uint(tag, 0)?;
    // A length that does not fit 32 bits is no image; this keeps products of two in range.
    match u32::try_from(value) {
        Ok(value) if value > 0 => Ok(value as usize),
        _ => damaged(name, value, "1 or more, in 32 bits"),
    }
}

/// The value that a tag has for all bands; 1 if the image does not have it.
fn common_value(image: &Directory, tag: u16) -> TiffResult<u64> {
    let values = image.uints(tag)?.unwrap_or_default();
    if values.iter().any(|v| *v != values[0]) {
        return unsupported(
            "bands of different sample types, which are not read",
            Remedy::TakeBand,
        );
    }
    Ok(values.first().copied().unwrap_or(1))
}
