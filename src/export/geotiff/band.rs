//! The bands of a raster: what they hold, and rows of it.

use std::fmt;
use std::ops::Range;

use rayon::prelude::*;
use tiff::tags::SampleFormat;

use crate::grid::GridFrame;

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

    pub(super) fn bytes_per_sample(&self) -> usize {
        match self {
            Self::F32(_) | Self::F32Rows(_) | Self::U32(_) => 4,
            Self::U8(_) => 1,
        }
    }

    pub(super) fn format(&self) -> SampleFormat {
        match self {
            Self::F32(_) | Self::F32Rows(_) => SampleFormat::IEEEFP,
            Self::U32(_) | Self::U8(_) => SampleFormat::Uint,
        }
    }

    /// TIFF's predictor: 2 horizontal differences, 3 the floating-point one.
    pub(super) fn predictor(&self) -> u16 {
        if self.format() == SampleFormat::IEEEFP { 3 } else { 2 }
    }

    pub(super) fn nodata(&self) -> &'static str {
        if self.format() == SampleFormat::IEEEFP { "nan" } else { "0" }
    }

    /// Rows of `cols` values each; `made` is room for those that are made.
    pub(super) fn rows<'s>(
        &self,
        rows: Range<usize>,
        cols: usize,
        made: &'s mut Vec<f32>,
    ) -> Rows<'s>
    where
        'a: 's,
    {
        let range = rows.start * cols..rows.end * cols;
        match self {
            Self::F32(v) => Rows::F32(&v[range]),
            Self::F32Rows(make) => {
                made.resize(range.len(), 0.0);
                let lines = made.par_chunks_mut(cols).zip(rows);
                lines.for_each(|(line, row)| make(row, line));
                Rows::F32(made)
            }
            Self::U32(v) => Rows::U32(&v[range]),
            Self::U8(v) => Rows::U8(&v[range]),
        }
    }
}

/// Some rows of a band.
#[derive(Clone, Copy)]
pub(super) enum Rows<'a> {
    F32(&'a [f32]),
    U32(&'a [u32]),
    U8(&'a [u8]),
}

/// What keeps `bands` from being one raster on `frame`.
pub(super) fn check_bands(frame: &GridFrame, bands: &[Band<'_>]) -> Result<(), String> {
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
