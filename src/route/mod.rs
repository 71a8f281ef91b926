//! Distances become routes: polylines from the start region to a goal, with their numbers.
//!
//! [`trace`] follows the distance down from the goal (`descent.rs`), and from node to node (`node_path.rs`), and moves both lines to where they are
//! shortest on the surface itself (`polish/`); the cheaper is the route; [`Summary`] and [`ProfilePoint`] measure the line on
//! the smooth surface (`profile.rs`); [`Comparison`] sets the routes of several metrics side by side.

mod compare;
mod descent;
mod node_path;
mod polish;
mod profile;

use glam::{DVec2, DVec3};

pub use self::compare::Comparison;
pub use self::profile::{ProfilePoint, Summary};
use crate::eikonal::{DistanceMap, TensorField, has_line_of_sight};
use crate::error::{Error, Location, Result};
use crate::linalg::Sym2;
use crate::metric::MetricField;

/// A route over a surface, from the start region to a goal.
#[derive(Clone, Debug)]
pub struct Route {
    /// Points in grid coordinates (column, row), from start to goal. Over the seam of a closed direction they go on beyond the
    /// grid.
    pub grid: Vec<DVec2>,
    /// The same points as map coordinates and height in metres, or in space, m: see
    /// [`Surface::point`](crate::Surface::point).
    pub points: Vec<DVec3>,
    /// The numbers of the route.
    pub summary: Summary,
}

/// Traces the route from the start region of `distance` to `goal` (grid coordinates). `metric` is the one the
/// distance was solved with.
///
/// The line begins exactly on the start region, ends exactly at the goal, has a point at least every half cell, and
/// enters no wall. Two lines, that of steepest descent on the distance and that from node to node, are each moved sideways to the nearest one that is
/// shortest under `metric`, which knows the surface between the nodes too; the cheaper is the route, and costs no more than either. [`Summary::cost`] is measured
/// between the nodes as well, so it differs from the distance at the goal by the errors of both. In a closed direction the line
/// begins at the image of the start that is nearest to the goal.
///
/// # Cost
/// Some 3 ms of one core for a route of 225 cells on the isotropic metric, 7 on the curvature metric (`docs/measurements.md`); where costs jump
/// from cell to cell, 8 to 20 ms for 130 cells (`docs/mathematics.md`).
///
/// # Errors
/// [`Error::NoPath`] if the front did not reach the goal; [`Error::Argument`] if the goal is not on the grid or the metric has no
/// quadratic form.
pub fn trace(distance: &DistanceMap, metric: &MetricField<'_>, goal: DVec2) -> Result<Route> {
    metric.check_quadratic()?;
    let line = shortest(distance, goal, &|at| metric.grid_metric(at))?;
    distance.check()?;
    let grid = line.ok_or_else(|| {
        let frame = metric.surface().frame();
        Error::NoPath {
            goal: frame.map_or(Location::Grid(goal), |frame| Location::Map(frame.to_map(goal))),
            between: metric.obstacles(),
            nearest: None,
        }
    })?;
    Ok(Route::from_line(grid, metric))
}

/// The line that [`trace`] describes under a metric `M` in grid coordinates; `None` if the goal was not reached.
///
/// # Errors
/// The goal is not on the grid.
fn shortest(
    distance: &DistanceMap,
    goal: DVec2,
    metric: &impl Fn(DVec2) -> Sym2,
) -> Result<Option<Vec<DVec2>>> {
    let field = &distance.field;
    if !field.tiling.contains(goal) {
        return Err(Error::argument(
            "the goal",
            "not on the grid",
            format!("on its {} columns × {} rows", field.cols(), field.rows()),
        )
        .at(Location::Grid(goal)));
    }
    let clear = |a, b| is_clear(field, a, b);
    // Where one fails the other may not, and of two local minima the lesser counts.
    let lines = [descent::line(distance, goal), node_path::line(distance, goal)];
    let polished = lines.into_iter().flatten().map(|line| polish::polish(&line, metric, &clear));
    let measured = polished.map(|line| (polish::fine_length(&line, metric), line));
    Ok(measured.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, line)| line))
}

/// Whether one may go straight from one point to another nearby.
fn is_clear(field: &TensorField, a: DVec2, b: DVec2) -> bool {
    let is_inside = field.tiling.contains(a) && field.tiling.contains(b);
    is_inside && (is_open_around(field, a, b) || has_line_of_sight(field, a, b))
}

/// Whether all cells between two points nearby have open corners: then nothing can be in the way.
fn is_open_around(field: &TensorField, a: DVec2, b: DVec2) -> bool {
    let (first, last) = (a.min(b).floor(), a.max(b).ceil());
    let open = |col, row| field.tiling.node(col, row).is_some_and(|(c, r)| field.is_open(c, r));
    (first.y as isize..=last.y as isize)
        .all(|row| (first.x as isize..=last.x as isize).all(|col| open(col, row)))
}

impl Route {
    /// A route along a given line in grid coordinates (column, row), measured under `metric`. Whether the line enters closed nodes is not looked
    /// at.
    #[must_use]
    pub fn from_line(grid: Vec<DVec2>, metric: &MetricField<'_>) -> Self {
        let surface = metric.surface();
        let points = grid.iter().map(|&at| surface.point(at)).collect();
        let summary = Summary::measure(&grid, metric);
        Self { grid, points, summary }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Control;
    use crate::eikonal::{Solver, Stop};
    use crate::metric::{Curvature, Isotropic, Metric, Modifiers};
    use crate::surface::{FitOptions, HeightSurface};
    use crate::terrain::Terrain;

    #[test]
    fn polishing_shortens_routes_on_real_ground() {
        let control = Control::default();
        let terrain = Terrain::open("data/jacksboro.tif").unwrap();
        let surface = HeightSurface::fit(&terrain, &FitOptions::default(), &control).unwrap();
        let metrics: [(&dyn Metric, f64); 2] = [(&Isotropic, 1e-4), (&Curvature::default(), 0.01)];
        for (metric, shorter) in metrics {
            let field = metric.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
            let start = DVec2::new(100.0, 160.0);
            let distance =
                Solver::default().solve(&field, &[start.into()], &Stop::Never, &control).unwrap();
            let ratios = (0..20).map(|k| {
                let goal = start + 90.0 * DVec2::from_angle(0.3 * f64::from(k));
                let traced = field.length(&descent::line(&distance, goal).unwrap());
                let cost = trace(&distance, &field, goal).unwrap().summary.cost;
                assert!(cost <= traced, "{metric:?} to {goal}: {cost}, traced {traced}");
                cost / traced
            });
            for outside in [DVec2::new(-1.0, 3.0), DVec2::new(1e9, 3.0), DVec2::NAN] {
                let error = trace(&distance, &field, outside).unwrap_err();
                assert!(matches!(error, Error::Argument(_)), "{error}");
            }
            let mean = ratios.sum::<f64>() / 20.0;
            assert!(mean < 1.0 - shorter, "{metric:?}: {mean}");
        }
    }
}
