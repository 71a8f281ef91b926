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
    let rows: Vec<(f64, usize, f64, usize)> = heights
        .par_chunks(frame.cols())
        .enumerate()
        .map_init(
            || vec![0.0; frame.cols()],
            |values, (row, heights)| {
                fit.row_values(row, values);
                let (mut sum, mut count, mut max, mut at) = (0.0, 0, 0.0, 0);
                for (col, (value, z)) in values.iter().zip(heights).enumerate() {
                    if z.is_finite() {
                        let residual = (value - z).abs();
                        sum += residual * residual;
                        count += 1;
                        if residual > max {
                            (max, at) = (residual, col);
                        }
                    }
                }
                (sum, count, max, at)
            },
        )
        .collect();
    // Added row by row, so that the sum does not depend on the number of threads.
    let (mut sum, mut count) = (0.0, 0);
    let mut residuals = Residuals::default();
    for (row, &(squares, valid, max, col)) in rows.iter().enumerate() {
        sum += squares;
        count += valid;
        if max > residuals.max {
            residuals.max = max;
            residuals.at = DVec2::new(col as f64, row as f64);
        }
    }
    residuals.rms = (sum / count as f64).sqrt();
    residuals
}
