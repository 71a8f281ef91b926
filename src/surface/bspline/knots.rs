//! The knots and the smoothing of a fit.

use glam::DVec2;

use crate::grid::GridFrame;

/// Knot intervals per cut-off wavelength: what a longer cut-off removes needs no knots. With 16 the
/// spline's own error in the second derivative of a wave of that length, `(ωh)²/12`, is 1.3 %.
const KNOTS_PER_CUTOFF: f64 = 16.0;

/// What to fit: the knots and the smoothing.
#[derive(Clone, Copy, Debug)]
pub(in crate::surface) struct FitPlan {
    /// Degree of the splines, 3 or 5.
    pub(in crate::surface) degree: usize,
    /// Knot intervals along columns (`x`) and rows (`y`).
    pub(in crate::surface) intervals: [usize; 2],
    /// Cut-off wavelength in metres; 0 for none.
    pub(in crate::surface) cutoff: f64,
}

impl FitPlan {
    /// Knots per node along columns and rows.
    pub(in crate::surface) fn density(&self, frame: &GridFrame) -> DVec2 {
        let [x, y] = [(0, frame.cols()), (1, frame.rows())].map(|(axis, nodes)| match nodes {
            1 => 1.0,
            _ => self.intervals[axis] as f64 / (nodes - 1) as f64,
        });
        DVec2::new(x, y)
    }

    /// Knots at all nodes: the spline interpolates.
    pub(in crate::surface) fn every_node(frame: &GridFrame, degree: usize) -> Self {
        Self { degree, intervals: [frame.cols() - 1, frame.rows() - 1], cutoff: 0.0 }
    }

    /// No more knots than a cut-off of `cutoff` metres needs.
    pub(in crate::surface) fn smooth(frame: &GridFrame, degree: usize, cutoff: f64) -> Self {
        let widest = (0..frame.rows()).map(|r| frame.spacing(r as f64).x).fold(0.0, f64::max);
        let axes = [(frame.cols(), widest), (frame.rows(), frame.mid_spacing().y)];
        let intervals = axes.map(|(nodes, spacing)| {
            let needed = (nodes - 1) as f64 * spacing * KNOTS_PER_CUTOFF / cutoff;
            (needed.ceil() as usize).max(degree).min(nodes - 1)
        });
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
