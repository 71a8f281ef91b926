//! How well a surface fits.

use glam::DVec2;
use rayon::prelude::*;

use super::fit::Fit;
use crate::grid::GridFrame;

/// How far the surface lies from the heights it was fitted to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residuals {
    /// Root mean square, m.
    pub rms: f64,
    /// Largest, m.
    pub max: f64,
    /// Where the largest is, in grid coordinates.
    pub at: DVec2,
}

/// Residuals of a fit over the finite heights.
pub(in crate::surface) fn residuals(frame: &GridFrame, fit: &Fit, heights: &[f64]) -> Residuals {
    let rows: Vec<RowResiduals> = heights
        .par_chunks(frame.cols())
        .enumerate()
        .map_init(
            || vec![0.0; frame.cols()],
            |values, (row, heights)| {
                let first = heights.iter().position(|z| z.is_finite());
                let last = heights.iter().rposition(|z| z.is_finite());
                let (Some(first), Some(last)) = (first, last) else { return Default::default() };
                fit.row_values(row, first..last + 1, values);
                RowResiduals::new(values, heights)
            },
        )
        .collect();
    // Added row by row, so that the sum does not depend on the number of threads.
    let (mut squares, mut count) = (0.0, 0);
    let mut residuals = Residuals::default();
    for (row, of_row) in rows.iter().enumerate() {
        squares += of_row.squares;
        count += of_row.count;
        if of_row.max > residuals.max {
            residuals.max = of_row.max;
            residuals.at = DVec2::new(of_row.col as f64, row as f64);
        }
    }
    residuals.rms = (squares / count as f64).sqrt();
    residuals
}

/// Residuals over the finite heights of a row.
#[derive(Default)]
struct RowResiduals {
    /// Sum of their squares, m².
    squares: f64,
    count: usize,
    /// Largest, m, and its column.
    max: f64,
    col: usize,
}

impl RowResiduals {
    fn new(values: &[f64], heights: &[f64]) -> Self {
        let mut row = Self::default();
        for (col, (value, z)) in values.iter().zip(heights).enumerate() {
            if z.is_finite() {
                let residual = (value - z).abs();
                row.squares += residual * residual;
                row.count += 1;
                if residual > row.max {
                    (row.max, row.col) = (residual, col);
                }
            }
        }
        row
    }
}
