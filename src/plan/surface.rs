//! Surfaces in words, for reports and the record.

use crate::export::metres;
use crate::grid::GridFrame;
use crate::surface::{Degree, FitOptions, HeightSurface, Smoothing};

/// The surface that was fitted, such as `cubic B-spline, cut-off 438 m`.
#[must_use]
pub fn describe_fit(options: &FitOptions, surface: &HeightSurface) -> String {
    let how = match (options.smoothing, surface.cutoff()) {
        (Smoothing::Interpolate, _) => "through every height".into(),
        (Smoothing::Tolerance(tolerance), _) => format!("within {tolerance} m (root mean square)"),
        (Smoothing::Auto, Some(cutoff)) => {
            format!("cut-off {} by cross-validation", metres(cutoff))
        }
        (_, Some(cutoff)) => format!("cut-off {}", metres(cutoff)),
        (_, None) => "smoothed".into(),
    };
    format!("{} B-spline, {how}", degree(options))
}

/// The surface that would be fitted to heights on this grid.
#[must_use]
pub fn describe_planned_fit(options: &FitOptions, frame: &GridFrame) -> String {
    let how = match options.smoothing {
        Smoothing::Interpolate => "through every height".into(),
        Smoothing::Cutoff(length) => format!("cut-off {}", metres(length)),
        Smoothing::CutoffCells(cells) => {
            let cell = frame.mid_spacing();
            let length = cells * (cell.x * cell.y).sqrt();
            format!("cut-off {cells} cells = {}", metres(length))
        }
        Smoothing::Auto => "cut-off by cross-validation".into(),
        Smoothing::Tolerance(rms) => format!("within {rms} m (root mean square)"),
    };
    format!("{} B-spline, {how}", degree(options))
}

fn degree(options: &FitOptions) -> &'static str {
    match options.degree {
        Degree::Cubic => "cubic",
        Degree::Quintic => "quintic",
    }
}
