//! Distances become routes: polylines from the start region to a goal, with their numbers.
//!
//! [`trace`] follows the distance down from the goal (`descent.rs`); [`Summary`] and [`ProfilePoint`] measure the line on
//! the smooth surface (`profile.rs`); [`Comparison`] sets the routes of several metrics side by side.

mod compare;
mod descent;
mod profile;

use glam::{DVec2, DVec3};

pub use self::compare::Comparison;
pub use self::profile::{ProfilePoint, Summary};
use crate::{DistanceMap, Error, MetricField, Result};

/// A route over a surface, from the start region to a goal.
#[derive(Clone, Debug)]
pub struct Route {
    /// Points in grid coordinates (column, row), from start to goal.
    pub grid: Vec<DVec2>,
    /// The same points as map coordinates and height of the surface in metres.
    pub points: Vec<DVec3>,
    /// The numbers of the route.
    pub summary: Summary,
}

/// Traces the route from the start region of `distance` to `goal` (grid coordinates). `metric` is the one the
/// distance was solved with.
///
/// The line begins exactly on the start region, ends exactly at the goal, has a point at least every cell or so,
/// and the distance rises along it from point to point.
///
/// # Errors
/// [`Error::NoWay`] if the front did not reach the goal.
pub fn trace(distance: &DistanceMap, metric: &MetricField<'_>, goal: DVec2) -> Result<Route> {
    let grid = descent::line(distance, goal).ok_or_else(|| {
        let at = metric.surface().frame().to_map(goal);
        Error::NoWay(format!(
            "there is no way from the start to the goal at {}, {}: voids, barriers or too steep ground lie between",
            at.x, at.y
        ))
    })?;
    Ok(Route::from_line(grid, metric))
}

impl Route {
    /// A route along a given line in grid coordinates, measured under `metric`.
    #[must_use]
    pub fn from_line(grid: Vec<DVec2>, metric: &MetricField<'_>) -> Self {
        let surface = metric.surface();
        let points =
            grid.iter().map(|&at| surface.frame().to_map(at).extend(surface.height(at))).collect();
        let summary = Summary::measure(&grid, metric);
        Self { grid, points, summary }
    }
}
