//! A grid around the Earth as one with two ends, for the fit.
//!
//! The columns are repeated beyond both ends. What a fit makes of its ends fades within a few cut-offs, so between the
//! margins the fit is periodic.

use glam::DVec2;
use rayon::prelude::*;

use crate::error::Result;
use crate::grid::GridFrame;

/// Widest margin in columns. That of an interpolating fit fades to 10⁻¹⁸ in 32 columns, that of a cut-off of 64 columns
/// (`exp(−πt/L)`, the slowest root of `1 + λω⁶`) to 10⁻¹¹ in 512.
const WIDEST: usize = 512;

/// A periodic grid with margins of repeated columns.
pub(super) struct Unrolled {
    pub(super) frame: GridFrame,
    /// Row-major.
    pub(super) heights: Vec<f64>,
    /// Columns before the first and after the last of the grid.
    pub(super) margin: usize,
}

impl Unrolled {
    pub(super) fn new(frame: &GridFrame, heights: &[f64]) -> Result<Self> {
        let cols = frame.cols();
        let margin = WIDEST.min(cols / 2).max(32);
        let width = cols + 2 * margin;
        let origin = frame.to_map(DVec2::new(-(margin as f64), 0.0));
        let wide = GridFrame::new(width, frame.rows(), origin, frame.step(), frame.ground())?;
        let mut repeated = vec![0.0; width * frame.rows()];
        let rows = repeated.par_chunks_exact_mut(width).zip(heights.par_chunks_exact(cols));
        // A column before the margin is a whole number of turns before a column of the grid.
        let first = cols - margin % cols;
        rows.for_each(|(wide, row)| {
            let columns = row.iter().cycle().skip(first);
            wide.iter_mut().zip(columns).for_each(|(wide, z)| *wide = *z);
        });
        Ok(Self { frame: wide, heights: repeated, margin })
    }

    /// Makes the repeated columns voids, so that each height counts once.
    pub(super) fn void_margins(heights: &mut [f64], width: usize, margin: usize) {
        heights.par_chunks_exact_mut(width).for_each(|row| {
            row[..margin].fill(f64::NAN);
            row[width - margin..].fill(f64::NAN);
        });
    }
}
