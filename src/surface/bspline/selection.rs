//! Knots and smoothing chosen by the data: the fewest knots for a tolerance, the cut-off by cross-validation.

use glam::DVec2;

use super::knots::FitPlan;
use super::residuals::residuals;
use super::voids::fit_finite;
use crate::control::Control;
use crate::error::Result;
use crate::grid::GridFrame;

/// Side in metres of a square as large as a cell in the middle of the grid.
pub(in crate::surface) fn mean_cell(frame: &GridFrame) -> f64 {
    let DVec2 { x, y } = frame.mid_spacing();
    (x * y).sqrt()
}

/// The plan with the fewest knots whose residuals have a root mean square of at most `rms`, by bisection.
pub(in crate::surface) fn fewest_knots(
    frame: &GridFrame,
    heights: &[f64],
    degree: usize,
    rms: f64,
    control: &Control,
) -> Result<FitPlan> {
    let quiet = control.quiet();
    // As many intervals as the finer cells fit along the longer side: knots at every node, which
    // interpolate, so the upper end always meets the tolerance.
    let cells = DVec2::new((frame.cols() - 1) as f64, (frame.rows() - 1) as f64);
    let spacing = frame.mid_spacing();
    let finest = (cells * spacing).max_element() / spacing.min_element();
    let (mut few, mut enough) = (0, finest.ceil() as usize);
    while few < enough {
        let middle = few.midpoint(enough);
        let plan = FitPlan::coarse(frame, degree, middle);
        let fit = fit_finite(frame, heights, &plan, &quiet)?;
        if residuals(frame, &fit, heights).rms <= rms {
            enough = middle;
        } else {
            few = middle + 1;
        }
    }
    Ok(FitPlan::coarse(frame, degree, enough))
}

/// The cut-off in metres with the least [score](generalised_cross_validation): lengths by powers of two from 2 cells to half
/// the extent, then a golden section around the best.
pub(in crate::surface) fn cross_validate(
    frame: &GridFrame,
    heights: &[f64],
    degree: usize,
    control: &Control,
) -> Result<f64> {
    let quiet = control.quiet();
    let (frame, heights) = window(frame, heights)?;
    let cell = mean_cell(&frame);
    let score = |log_cells: f64| {
        let plan = FitPlan::smooth(&frame, degree, log_cells.exp2() * cell);
        generalised_cross_validation(&frame, &heights, &plan, &quiet)
    };
    let longest = (frame.cols().max(frame.rows()) as f64 / 2.0).log2().max(2.0) as usize;
    let mut best = (f64::INFINITY, 1.0);
    for log_cells in 1..=longest {
        let gcv = score(log_cells as f64)?;
        if gcv < best.0 {
            best = (gcv, log_cells as f64);
        }
    }
    let log_cells = golden_section(best.1 - 1.0, best.1 + 1.0, score)?;
    Ok(log_cells.exp2() * cell)
}

/// Generalised cross-validation score of a fit (Craven and Wahba, Numer. Math. 31, 1979)
///
/// ```text
///   GCV = N Σ(s − z)² / (N − tr A)² ,     tr A = tr A_x · tr A_y
/// ```
///
/// where `A = A_y ⊗ A_x` takes heights to fitted heights, a separable fit's trace being the product. Infinite where the fit has as much freedom as there are heights.
fn generalised_cross_validation(
    frame: &GridFrame,
    heights: &[f64],
    plan: &FitPlan,
    control: &Control,
) -> Result<f64> {
    let fit = fit_finite(frame, heights, plan, control)?;
    let valid = heights.iter().filter(|z| z.is_finite()).count() as f64;
    let [x, y] = (plan.cutoff / frame.mid_spacing()).to_array();
    let freedom = valid * (1.0 - fit.x.trace(x) * fit.y.trace(y) / frame.nodes() as f64);
    let gcv = (residuals(frame, &fit, heights).rms * valid / freedom).powi(2);
    Ok(if freedom > 0.0 { gcv } else { f64::INFINITY })
}

/// Where `f` is least between `low` and `high`, to 5 % of their distance.
fn golden_section(low: f64, high: f64, f: impl Fn(f64) -> Result<f64>) -> Result<f64> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (mut low, mut high) = (low, high);
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut values = [f(inner[0])?, f(inner[1])?];
    for _ in 0..6 {
        if values[0] <= values[1] {
            high = inner[1];
            inner = [high - GOLDEN * (high - low), inner[0]];
            values = [f(inner[0])?, values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + GOLDEN * (high - low)];
            values = [values[1], f(inner[1])?];
        }
    }
    Ok((low + high) / 2.0)
}

/// The part of at most 1024 × 1024 nodes with the fewest voids, and of those the nearest to the middle. The
/// places it is chosen from leave no node out, so it holds a height if there is one.
fn window(frame: &GridFrame, heights: &[f64]) -> Result<(GridFrame, Vec<f64>)> {
    const SIDE: usize = 1024;
    let (cols, rows) = (frame.cols().min(SIDE), frame.rows().min(SIDE));
    let [col, row] = window_starts(frame.rows(), rows)
        .flat_map(|row| window_starts(frame.cols(), cols).map(move |col| [col, row]))
        .min_by_key(|&[col, row]| {
            let part = part(heights, frame.cols(), [col, row], [cols, rows]);
            let voids = part.filter(|z| !z.is_finite()).count();
            let off_middle =
                (2 * col).abs_diff(frame.cols() - cols) + (2 * row).abs_diff(frame.rows() - rows);
            (voids, off_middle)
        })
        .unwrap_or_default();
    let corner = frame.to_map(DVec2::new(col as f64, row as f64));
    let window = GridFrame::new(cols, rows, corner, frame.step(), frame.ground())?;
    Ok((window, part(heights, frame.cols(), [col, row], [cols, rows]).copied().collect()))
}

/// The heights of `cols` columns and `rows` rows from a node on, of lines `width` long.
fn part(
    heights: &[f64],
    width: usize,
    [col, row]: [usize; 2],
    [cols, rows]: [usize; 2],
) -> impl Iterator<Item = &f64> {
    let lines = heights.chunks(width).skip(row).take(rows);
    lines.flat_map(move |line| &line[col..col + cols])
}

/// First nodes of windows `side` long that overlap or touch, an odd number, so that one is in the middle.
fn window_starts(nodes: usize, side: usize) -> impl Iterator<Item = usize> {
    let gaps = 2 * (nodes.div_ceil(side) / 2).max(1);
    (0..=gaps).map(move |i| i * (nodes - side) / gaps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Ground;

    #[test]
    fn the_window_finds_the_only_heights_of_a_large_grid() {
        let (cols, rows) = (3600, 1100);
        let frame = GridFrame::new(cols, rows, DVec2::ZERO, DVec2::ONE, Ground::METRES).unwrap();
        for (col, row) in [(1200, 70), (2700, 1099), (0, 0), (3599, 500)] {
            let mut heights = vec![f64::NAN; cols * rows];
            heights[frame.index(col, row)] = 7.0;
            let (part, values) = window(&frame, &heights).unwrap();
            assert_eq!(values.len(), part.nodes());
            let found: Vec<_> = values.iter().filter(|z| z.is_finite()).collect();
            assert_eq!(found, [&7.0], "{col}, {row}");
        }
        let (part, _) = window(&frame, &vec![0.0; cols * rows]).unwrap();
        assert_eq!(part.origin(), DVec2::new(1288.0, -38.0), "the middle");
    }
}
