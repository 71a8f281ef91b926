//! Which knots and how much smoothing: given, or chosen by the data.

use glam::DVec2;

use super::fit::Fit;
use super::residuals::residuals;
use super::voids::fill;
use crate::control::Control;
use crate::error::Result;
use crate::grid::GridFrame;

/// Knot intervals per cut-off wavelength: what a longer cut-off removes needs no knots. With 16 the
/// spline's own error in the second derivative of a wave of that length, `(ωh)²/12`, is 1.3 %.
const KNOTS_PER_CUTOFF: f64 = 16.0;

/// What to fit: the knots and the smoothing.
#[derive(Clone, Copy, Debug)]
pub(in crate::surface) struct Plan {
    /// Degree of the splines, 3 or 5.
    pub(in crate::surface) degree: usize,
    /// Knot intervals along columns (`x`) and rows (`y`).
    pub(in crate::surface) intervals: [usize; 2],
    /// Cut-off wavelength in metres; 0 for none.
    pub(in crate::surface) cutoff: f64,
}

impl Plan {
    /// Knots at all nodes: the spline interpolates.
    pub(in crate::surface) fn every_node(frame: &GridFrame, degree: usize) -> Self {
        Self { degree, intervals: [frame.cols() - 1, frame.rows() - 1], cutoff: 0.0 }
    }

    /// No more knots than a cut-off of `cutoff` metres needs.
    pub(in crate::surface) fn smooth(frame: &GridFrame, degree: usize, cutoff: f64) -> Self {
        let needed = |nodes: usize, spacing: f64| {
            let intervals = (nodes - 1) as f64 * spacing * KNOTS_PER_CUTOFF / cutoff;
            (intervals.ceil() as usize).max(degree).min(nodes - 1)
        };
        let widest = (0..frame.rows()).map(|r| frame.spacing(r as f64).x).fold(0.0, f64::max);
        let intervals = [needed(frame.cols(), widest), needed(frame.rows(), frame.mid_spacing().y)];
        Self { degree, intervals, cutoff }
    }

    /// About square knot intervals, `longer` of them along the side that is longer in metres; no smoothing.
    pub(in crate::surface) fn coarse(frame: &GridFrame, degree: usize, longer: usize) -> Self {
        let most = DVec2::new((frame.cols() - 1) as f64, (frame.rows() - 1) as f64);
        let extent = most * frame.mid_spacing();
        let share = (extent / extent.max_element().max(f64::MIN_POSITIVE)) * longer as f64;
        let intervals = share.ceil().min(most);
        Self { degree, intervals: [intervals.x as usize, intervals.y as usize], cutoff: 0.0 }
    }
}

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
) -> Result<Plan> {
    let quiet = Control { cancel: control.cancel.clone(), progress: None };
    let filled = fill(frame, heights, &Plan::every_node(frame, degree), &quiet)?;
    // As many intervals as the finer cells fit along the longer side: knots at every node, which
    // interpolate, so the upper end always meets the tolerance.
    let cells = DVec2::new((frame.cols() - 1) as f64, (frame.rows() - 1) as f64);
    let spacing = frame.mid_spacing();
    let finest = (cells * spacing).max_element() / spacing.min_element();
    let (mut few, mut enough) = (0, finest.ceil() as usize);
    while few < enough {
        let middle = few.midpoint(enough);
        let plan = Plan::coarse(frame, degree, middle);
        let fit = Fit::new(frame, &filled, &plan, &quiet)?;
        if residuals(frame, &fit, heights).rms <= rms {
            enough = middle;
        } else {
            few = middle + 1;
        }
    }
    Ok(Plan::coarse(frame, degree, enough))
}

/// The cut-off in metres with the least generalised cross-validation score (Craven and Wahba, Numer.
/// Math. 31, 1979)
///
/// ```text
///   GCV = N Σ(s − z)² / (N − tr A)² ,     tr A = tr A_x · tr A_y
/// ```
///
/// where `A = A_y ⊗ A_x` takes heights to fitted heights, a separable fit's trace being the product.
/// Lengths by powers of two from 2 cells to half the extent, then a golden section around the best.
pub(in crate::surface) fn cross_validate(
    frame: &GridFrame,
    heights: &[f64],
    degree: usize,
    control: &Control,
) -> Result<f64> {
    let quiet = Control { cancel: control.cancel.clone(), progress: None };
    let (frame, heights) = window(frame, heights)?;
    let cell = mean_cell(&frame);
    let filled = fill(&frame, &heights, &Plan::every_node(&frame, degree), &quiet)?;
    let valid = heights.iter().filter(|z| z.is_finite()).count() as f64;
    let score = |log_cells: f64| -> Result<f64> {
        let plan = Plan::smooth(&frame, degree, log_cells.exp2() * cell);
        let fit = Fit::new(&frame, &filled, &plan, &quiet)?;
        let [x, y] = (plan.cutoff / frame.mid_spacing()).to_array();
        let freedom = valid * (1.0 - fit.x.trace(x) * fit.y.trace(y) / frame.nodes() as f64);
        let gcv = (residuals(&frame, &fit, &heights).rms * valid / freedom).powi(2);
        Ok(if freedom > 0.0 { gcv } else { f64::INFINITY })
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
    let lines = |(col, row): (usize, usize)| {
        let lines = heights.chunks(frame.cols()).skip(row).take(rows);
        lines.flat_map(move |line| &line[col..col + cols])
    };
    // First nodes of windows that overlap or touch, an odd number, so that one is in the middle.
    let spread = |nodes: usize, side: usize| {
        let gaps = 2 * (nodes.div_ceil(side) / 2).max(1);
        (0..=gaps).map(move |i| i * (nodes - side) / gaps)
    };
    let off_middle = |(col, row): (usize, usize)| {
        (2 * col).abs_diff(frame.cols() - cols) + (2 * row).abs_diff(frame.rows() - rows)
    };
    let place = spread(frame.rows(), rows)
        .flat_map(|row| spread(frame.cols(), cols).map(move |col| (col, row)))
        .min_by_key(|&place| (lines(place).filter(|z| !z.is_finite()).count(), off_middle(place)))
        .unwrap_or_default();
    let corner = frame.to_map(DVec2::new(place.0 as f64, place.1 as f64));
    let part = GridFrame::new(cols, rows, corner, frame.step(), frame.ground())?;
    Ok((part, lines(place).copied().collect()))
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
