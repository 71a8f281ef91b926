//! Distances become polylines.

use glam::{DVec2, DVec3};
use serde::Serialize;

use crate::{Control, DistanceMap, GridFrame, HeightSurface, MetricField, Result};

/// A route over a surface, from the start region to the goal.
#[derive(Clone, Debug)]
pub struct Route {
    /// Points in grid coordinates (column, row), from start to goal.
    pub grid: Vec<DVec2>,
    /// The same points as map coordinates and height in metres.
    pub points: Vec<DVec3>,
    /// The numbers of the route.
    pub summary: Summary,
}

/// The numbers of a route. Lengths and heights in metres, grades in percent (rise per plan length).
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Name of the metric.
    pub metric: String,
    /// `δ` of the curvature tensor, 1/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delta_per_m: Option<f64>,
    /// Cost under the route's own metric.
    pub cost: f64,
    /// Unit of the cost: `m` or `AG units`.
    pub cost_unit: String,
    /// Length on the surface, m.
    pub length_m: f64,
    /// Length on the map, m.
    pub plan_length_m: f64,
    /// Sum of rises, m.
    pub climb_m: f64,
    /// Sum of falls, m.
    pub descent_m: f64,
    /// Steepest grade along the route, %.
    pub max_grade_percent: f64,
    /// Mean of the absolute grade, %.
    pub mean_grade_percent: f64,
    /// Steepest slope of the ground across the route, degrees.
    pub max_side_slope_deg: f64,
    /// `∫|κ_n| ds`: total normal curvature along the route, radians.
    pub total_normal_curvature_rad: f64,
    /// Start in map coordinates.
    pub start: [f64; 2],
    /// Goal in map coordinates.
    pub goal: [f64; 2],
    /// Version of this crate.
    pub software: String,
}

/// One sample of a route's profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ProfilePoint {
    /// Length on the surface from the start, m.
    pub distance_m: f64,
    /// Map coordinates.
    pub x: f64,
    /// Map coordinates.
    pub y: f64,
    /// Height, m.
    pub height_m: f64,
    /// Grade along the route, %.
    pub grade_percent: f64,
    /// Slope of the ground across the route, degrees.
    pub side_slope_deg: f64,
    /// Normal curvature along the route, 1/m; positive where the ground is hollow.
    pub normal_curvature_per_m: f64,
}

/// Traces the route from the start region to `goal` (grid coordinates).
///
/// # Errors
/// [`Error::NoWay`](crate::Error::NoWay) if the goal was not reached.
pub fn trace(distance: &DistanceMap, metric: &MetricField<'_>, goal: DVec2) -> Result<Route> {
    todo!()
}

impl Route {
    /// Samples at equal steps of at most `step` metres along the surface, both ends included.
    #[must_use]
    pub fn profile(&self, surface: &HeightSurface, step: f64) -> Vec<ProfilePoint> {
        todo!()
    }
}

/// The routes of several metrics between the same places, and each one's cost under each metric.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// One route per metric.
    pub routes: Vec<Route>,
    /// `cost[m][r]`: cost of route `r` under metric `m`.
    pub cost: Vec<Vec<f64>>,
}
