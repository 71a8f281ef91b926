//! Routes in numbers, alone and side by side.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::metric::{MetricField, Unit};
use crate::plan::provenance::Provenance;
use crate::route::{Comparison, Route, Summary};
use crate::terrain::Terrain;

/// Routes to the goals of a scenario.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RouteReport {
    /// A route for each goal.
    pub routes: Vec<NamedRoute>,
    /// How to ask again.
    pub provenance: Provenance,
}

/// The numbers of a route.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NamedRoute {
    /// Its name, such as `to pixel:3,4`.
    pub name: String,
    /// Its numbers, on the smooth surface.
    pub summary: Summary,
    /// What it climbs on the heights of the DEM, which are rougher.
    pub on_dem: DemClimb,
}

/// Rises and falls from point to point of a route, half a cell apart or less, with heights that are bilinear between those of the DEM. Voids are
/// passed over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DemClimb {
    /// Sum of rises, m.
    pub climb_m: f64,
    /// Sum of falls, m.
    pub descent_m: f64,
}

impl DemClimb {
    /// What a route climbs on the heights of a terrain.
    #[must_use]
    pub fn of(route: &Route, terrain: &Terrain) -> Self {
        let heights = route.grid.iter().map(|&at| terrain.height(at)).filter(|z| z.is_finite());
        let heights: Vec<f64> = heights.collect();
        let rises = heights.windows(2).map(|ends| ends[1] - ends[0]);
        rises.fold(Self::default(), |Self { climb_m, descent_m }, rise| Self {
            climb_m: climb_m + rise.max(0.0),
            descent_m: descent_m + (-rise).max(0.0),
        })
    }
}

impl RouteReport {
    /// The numbers of routes with names over a terrain.
    #[must_use]
    pub fn new(routes: &[(&str, &Route)], terrain: &Terrain, provenance: Provenance) -> Self {
        let routes =
            routes.iter().map(|(name, route)| NamedRoute::new(name, route, terrain)).collect();
        Self { routes, provenance }
    }
}

impl NamedRoute {
    fn new(name: &str, route: &Route, terrain: &Terrain) -> Self {
        let on_dem = DemClimb::of(route, terrain);
        Self { name: name.to_owned(), summary: route.summary.clone(), on_dem }
    }
}

/// The routes of several metrics, each measured under all of them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparisonReport {
    /// The route of each metric.
    pub routes: Vec<ComparedRoute>,
    /// How to ask again.
    pub provenance: Provenance,
}

/// A route and what it costs under each metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparedRoute {
    /// Its name and numbers.
    #[serde(flatten)]
    pub route: NamedRoute,
    /// What it costs, by metric.
    pub costs: BTreeMap<String, Cost>,
}

/// What a route costs under a metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// Its length under the metric.
    pub cost: f64,
    /// The unit of that.
    pub unit: Unit,
    /// The cost divided by that of the best route.
    pub ratio_to_best: f64,
}

impl ComparisonReport {
    /// The routes of a comparison under `fields` over a terrain.
    #[must_use]
    pub fn new(
        fields: &[MetricField<'_>],
        comparison: &Comparison,
        terrain: &Terrain,
        provenance: Provenance,
    ) -> Self {
        let routes = fields.iter().zip(&comparison.routes).enumerate();
        let routes = routes.map(|(r, (field, route))| ComparedRoute {
            route: NamedRoute::new(field.name(), route, terrain),
            costs: costs_of(r, fields, comparison),
        });
        Self { routes: routes.collect(), provenance }
    }
}

/// What a route of a comparison costs under each metric.
fn costs_of(
    route: usize,
    fields: &[MetricField<'_>],
    comparison: &Comparison,
) -> BTreeMap<String, Cost> {
    let costs = fields.iter().enumerate().map(|(metric, field)| {
        let cost = Cost {
            cost: comparison.costs[metric][route],
            unit: field.unit(),
            ratio_to_best: comparison.ratio(metric, route),
        };
        (field.name().to_owned(), cost)
    });
    costs.collect()
}
