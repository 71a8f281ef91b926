//! Routes over surfaces in space.

use glam::{DVec2, DVec3};

use super::shortest;
use crate::eikonal::DistanceMap;
use crate::error::{Error, Result};
use crate::metric::SurfaceMetric;
use crate::metric::length_along;

/// A route over a [`ParametricSurface`](crate::ParametricSurface), from the start region to a goal.
#[derive(Clone, Debug)]
pub struct SurfaceRoute {
    /// Points in grid coordinates (column, row), from start to goal. Over the seam of a closed direction they go on beyond the
    /// grid.
    pub grid: Vec<DVec2>,
    /// The same points in space, m.
    pub points: Vec<DVec3>,
    /// Length under the metric, in [its unit](SurfaceMetric::unit).
    pub cost: f64,
    /// Length on the surface, m.
    pub length_m: f64,
}

/// [`trace`](super::trace) on a surface in space.
///
/// In a closed direction the line ends at the image of the start that is nearest to the goal.
///
/// # Errors
/// As [`trace`](super::trace).
pub fn trace_on(
    distance: &DistanceMap,
    metric: &SurfaceMetric<'_>,
    goal: DVec2,
) -> Result<SurfaceRoute> {
    let grid = shortest(distance, goal, &|at| metric.grid_metric(at))?;
    let grid = grid.ok_or_else(|| {
        Error::NoWay(format!("there is no way from the start to the goal at {goal}"))
    })?;
    let surface = metric.surface();
    Ok(SurfaceRoute {
        points: grid.iter().map(|&at| surface.space_jet(at).point).collect(),
        cost: metric.length(&grid),
        length_m: length_along(&grid, |at, by| surface.space_jet(at).first_form().norm(by)),
        grid,
    })
}
