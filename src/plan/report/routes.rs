//! Routes in numbers, alone and side by side.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::metric::{MetricField, Unit};
use crate::plan::provenance::Provenance;
use crate::route::{Comparison, Route, Summary};

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
    /// Its numbers.
    pub summary: Summary,
}

impl RouteReport {
    /// The numbers of routes with names.
    #[must_use]
    pub fn new(routes: &[(&str, &Route)], provenance: Provenance) -> Self {
        let routes = routes.iter().map(|(name, route)| NamedRoute::new(name, route)).collect();
        Self { routes, provenance }
    }
}

impl NamedRoute {
    fn new(name: &str, route: &Route) -> Self {
        Self { name: name.to_owned(), summary: route.summary.clone() }
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
    /// The routes of a comparison under `fields`.
    #[must_use]
    pub fn new(
        fields: &[MetricField<'_>],
        comparison: &Comparison,
        provenance: Provenance,
    ) -> Self {
        let routes = fields.iter().zip(&comparison.routes).enumerate();
        let routes = routes.map(|(r, (field, route))| ComparedRoute {
            route: NamedRoute::new(field.name(), route),
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
