//! Distances in numbers.

use rayon::prelude::*;
use serde::Serialize;

use crate::eikonal::{DistanceMap, Statistics};
use crate::metric::{MetricField, Unit};
use crate::plan::provenance::Provenance;
use crate::plan::scenario::Scenario;

/// A distance map in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DistanceReport {
    /// The metric.
    pub metric: String,
    /// Unit of the distances.
    pub unit: Unit,
    /// `δ` of the metric in 1/m, if it has one.
    pub delta_per_m: Option<f64>,
    /// `δ` of the difference metrics, if it has one: no unit, or m² if literal.
    pub difference_delta: Option<f64>,
    /// Number of cells.
    pub cells: usize,
    /// Number of those that are reached.
    pub reached: usize,
    /// How the distances are spread.
    pub distance: DistanceStatistics,
    /// The distances of the goals.
    pub goals: Vec<GoalDistance>,
    /// How much work the solver had.
    pub solver: SolverWork,
    /// How to ask again.
    pub provenance: Provenance,
}

/// How the distances of the cells that are reached are spread; `None` where not asked for, or none is reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DistanceStatistics {
    /// A tenth of the cells are no farther than this.
    #[serde(rename = "10_percent", skip_serializing_if = "Option::is_none")]
    pub percent_10: Option<f64>,
    /// A quarter.
    #[serde(rename = "25_percent", skip_serializing_if = "Option::is_none")]
    pub percent_25: Option<f64>,
    /// Half.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub median: Option<f64>,
    /// Three quarters.
    #[serde(rename = "75_percent", skip_serializing_if = "Option::is_none")]
    pub percent_75: Option<f64>,
    /// Nine tenths.
    #[serde(rename = "90_percent", skip_serializing_if = "Option::is_none")]
    pub percent_90: Option<f64>,
    /// The largest distance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub largest: Option<f64>,
    /// Mean of the estimated errors, at high accuracy.
    #[serde(rename = "mean estimated error", skip_serializing_if = "Option::is_none")]
    pub mean_error: Option<f64>,
}

/// The distance of a goal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GoalDistance {
    /// The goal as it was given.
    pub goal: String,
    /// Its distance from the nearest start.
    pub distance: f64,
}

/// How much work the solver had.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SolverWork {
    /// The counts of the solve.
    #[serde(flatten)]
    pub counts: Statistics,
    /// Memory of the distance map in bytes per node, tensors included.
    pub bytes_per_node: usize,
}

impl DistanceReport {
    /// The numbers of a map solved in a scenario; with `quantiles` those of all its cells, which takes a sort.
    #[must_use]
    pub fn new(
        scenario: &Scenario,
        field: &MetricField<'_>,
        map: &DistanceMap,
        quantiles: bool,
        provenance: Provenance,
    ) -> Self {
        let (reached, largest) = reached(map);
        let mut distance =
            if quantiles { quantiles_and_error(map) } else { DistanceStatistics::default() };
        distance.largest = (reached > 0).then_some(largest);
        let goals = scenario.goals.iter().filter_map(|goal| {
            Some(GoalDistance { goal: goal.name.clone(), distance: map.at(goal.at)? })
        });
        Self {
            metric: field.name().to_owned(),
            unit: map.unit(),
            delta_per_m: field.parameter("delta_per_m"),
            difference_delta: field.parameter("difference_delta"),
            cells: map.cols() * map.rows(),
            reached,
            distance,
            goals: goals.collect(),
            solver: SolverWork { counts: map.statistics(), bytes_per_node: map.bytes_per_node() },
            provenance,
        }
    }
}

/// Number of the cells that are reached and the largest distance of one.
fn reached(map: &DistanceMap) -> (usize, f64) {
    (0..map.rows())
        .into_par_iter()
        .map(|row| reached_in_row(map, row))
        .reduce(|| (0, 0.0), |a, b| (a.0 + b.0, a.1.max(b.1)))
}

fn reached_in_row(map: &DistanceMap, row: usize) -> (usize, f64) {
    let mut line = vec![0.0; map.cols()];
    map.row(row, &mut line);
    let values = line.into_iter().map(f64::from);
    values
        .filter(|value| value.is_finite())
        .fold((0, 0.0), |(count, largest), value| (count + 1, value.max(largest)))
}

/// Quantiles of the distances and mean of the estimated errors.
fn quantiles_and_error(map: &DistanceMap) -> DistanceStatistics {
    let mut values = map.to_row_major();
    values.retain(|value| value.is_finite());
    values.par_sort_unstable_by(f32::total_cmp);
    let [percent_10, percent_25, median, percent_75, percent_90] =
        [0.1, 0.25, 0.5, 0.75, 0.9].map(|share| quantile(&values, share));
    DistanceStatistics {
        percent_10,
        percent_25,
        median,
        percent_75,
        percent_90,
        largest: None,
        mean_error: mean_error(map),
    }
}

/// The value that a share of ascending values lies below.
fn quantile(values: &[f32], share: f64) -> Option<f64> {
    let rank = (values.len().checked_sub(1)? as f64 * share) as usize;
    Some(values[rank].into())
}

/// Mean of the estimated errors of the reached cells; `None` where there are none.
fn mean_error(map: &DistanceMap) -> Option<f64> {
    let nodes = (0..map.rows()).flat_map(|row| (0..map.cols()).map(move |col| (col, row)));
    let errors = nodes.filter_map(|(col, row)| map.error_at_node(col, row));
    let (sum, count) = errors.fold((0.0, 0usize), |(sum, count), error| (sum + error, count + 1));
    (count > 0).then(|| sum / count as f64)
}
