//! Routes of several metrics between the same places, side by side.

use glam::DVec2;

use super::{Route, trace};
use crate::control::Control;
use crate::eikonal::{DistanceMap, Solver, StartRegion, Stop};
use crate::error::Result;
use crate::metric::MetricField;

/// The routes of several metrics between the same places, and what each costs under each.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// One route per metric, in their order.
    pub routes: Vec<Route>,
    /// The distance that each route was traced on.
    pub distances: Vec<DistanceMap>,
    /// `costs[m][r]`: length of route `r` under metric `m`, in the unit of `m`.
    pub costs: Vec<Vec<f64>>,
}

impl Comparison {
    /// Solves every metric with `solver` from the nearest of `starts` over the whole grid and traces its route to `goal` (grid coordinates).
    /// Cost: a solve and a route for each metric; all distances are kept.
    ///
    /// # Errors
    /// [`Error::NoPath`](crate::Error::NoPath), and those of [`Solver::solve`].
    pub fn between(
        solver: Solver,
        metrics: &[MetricField<'_>],
        starts: &[StartRegion],
        goal: DVec2,
        control: &Control,
    ) -> Result<Self> {
        let distances: Vec<DistanceMap> = metrics
            .iter()
            .map(|metric| solver.solve(metric, starts, &Stop::Never, control))
            .collect::<Result<_>>()?;
        let routes: Vec<Route> = metrics
            .iter()
            .zip(&distances)
            .map(|(metric, distance)| trace(distance, metric, goal))
            .collect::<Result<_>>()?;
        let costs = metrics
            .iter()
            .map(|metric| routes.iter().map(|route| metric.length(&route.grid)).collect())
            .collect();
        Ok(Self { routes, distances, costs })
    }

    /// Cost of route `route` under metric `metric`, divided by the least cost of any of the routes under it; 1 for
    /// the best, also where the goal is on the start and all costs are 0. Both are indices, as in [`costs`](Self::costs).
    #[must_use]
    pub fn ratio(&self, metric: usize, route: usize) -> f64 {
        let costs = &self.costs[metric];
        let best = costs.iter().copied().fold(f64::INFINITY, f64::min);
        if costs[route] == best { 1.0 } else { costs[route] / best }
    }
}
