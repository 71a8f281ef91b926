//! The numbers of a route, measured on the smooth surface.

use glam::DVec2;
use serde::Serialize;

use super::Route;
use crate::metric::MetricField;
use crate::surface::{HeightJet, HeightSurface};

/// The numbers of a route. Lengths and heights in metres, grades in percent: rise per plan length.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the metric.
    pub metric: String,
    /// `δ` of the curvature tensor, 1/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delta_per_m: Option<f64>,
    /// `δ` of the difference tensor, in the unit of its `γ`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub difference_delta: Option<f64>,
    /// Length of the line under the route's own metric.
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
    /// Mean of the absolute grade over the plan length, %.
    pub mean_grade_percent: f64,
    /// Steepest slope of the ground across the route, degrees.
    pub max_side_slope_deg: f64,
    /// `∫|κ_n| ds`, the total normal curvature along the route, radians: how much the ground makes the
    /// traveller pitch.
    pub total_normal_curvature_rad: f64,
    /// Start in map coordinates.
    pub start: [f64; 2],
    /// Goal in map coordinates.
    pub goal: [f64; 2],
    /// Name and version of this software.
    pub software: String,
}

/// One sample of a route's profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ProfilePoint {
    /// Length on the surface from the start, m.
    pub distance_m: f64,
    /// Map coordinate.
    pub x: f64,
    /// Map coordinate.
    pub y: f64,
    /// Height, m.
    pub height_m: f64,
    /// Grade along the route, %; positive uphill.
    pub grade_percent: f64,
    /// Slope of the ground across the route, degrees.
    pub side_slope_deg: f64,
    /// Normal curvature along the route, 1/m; positive where the ground is hollow.
    pub normal_curvature_per_m: f64,
}

/// A short straight piece of a line, seen at its middle.
struct Piece {
    /// Plan length, m.
    plan: f64,
    /// Rise, m.
    rise: f64,
    /// Slope across, as a tangent.
    side: f64,
    /// Normal curvature, 1/m.
    curvature: f64,
}

impl Piece {
    fn new(surface: &HeightSurface, from: DVec2, to: DVec2) -> Self {
        let middle = from.midpoint(to);
        let v = surface.frame().ground_vector(middle.y, to - from);
        let jet = surface.jet(middle);
        let rise = surface.height(to) - surface.height(from);
        let plan = v.length();
        let (side, curvature) = across(&jet, v);
        Self { plan, rise, side, curvature }
    }

    /// Length on the surface, m.
    fn length(&self) -> f64 {
        self.plan.hypot(self.rise)
    }

    fn grade_percent(&self) -> f64 {
        if self.plan > 0.0 { 100.0 * self.rise / self.plan } else { 0.0 }
    }
}

/// Slope across a direction `v` (ground axes), and the normal curvature `vᵀBv / vᵀGv` along it.
fn across(jet: &HeightJet, v: DVec2) -> (f64, f64) {
    let Some(t) = v.try_normalize() else { return (0.0, 0.0) };
    let gradient = DVec2::new(jet.zx, jet.zy);
    let along = gradient.dot(t);
    let bend = jet.zxx * t.x * t.x + 2.0 * jet.zxy * t.x * t.y + jet.zyy * t.y * t.y;
    let w = (1.0 + gradient.length_squared()).sqrt();
    (gradient.perp_dot(t).abs(), bend / (w * (1.0 + along * along)))
}

/// Cuts a line into straight pieces of at most `longest` cells.
fn pieces(line: &[DVec2], longest: f64) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    line.windows(2).flat_map(move |ends| {
        let count = (ends[0].distance(ends[1]) / longest).ceil().max(1.0);
        let at = move |i: usize| ends[0].lerp(ends[1], i as f64 / count);
        (0..count as usize).map(move |i| (at(i), at(i + 1)))
    })
}

/// Pieces of half a cell: the surface has no detail below a cell.
const PIECE_CELLS: f64 = 0.5;

impl Summary {
    pub(super) fn measure(line: &[DVec2], metric: &MetricField<'_>) -> Self {
        let surface = metric.surface();
        let map =
            |at: Option<&DVec2>| at.map_or([f64::NAN; 2], |&at| surface.frame().to_map(at).into());
        let mut summary = Self {
            metric: metric.name().to_owned(),
            delta_per_m: metric.delta(),
            difference_delta: metric.difference_delta(),
            cost: metric.length(line),
            cost_unit: metric.unit().to_owned(),
            length_m: 0.0,
            plan_length_m: 0.0,
            climb_m: 0.0,
            descent_m: 0.0,
            max_grade_percent: 0.0,
            mean_grade_percent: 0.0,
            max_side_slope_deg: 0.0,
            total_normal_curvature_rad: 0.0,
            start: map(line.first()),
            goal: map(line.last()),
            software: concat!("ridgeway ", env!("CARGO_PKG_VERSION")).to_owned(),
        };
        for (from, to) in pieces(line, PIECE_CELLS) {
            let piece = Piece::new(surface, from, to);
            summary.length_m += piece.length();
            summary.plan_length_m += piece.plan;
            summary.climb_m += piece.rise.max(0.0);
            summary.descent_m += (-piece.rise).max(0.0);
            summary.max_grade_percent = summary.max_grade_percent.max(piece.grade_percent().abs());
            summary.max_side_slope_deg =
                summary.max_side_slope_deg.max(piece.side.atan().to_degrees());
            summary.total_normal_curvature_rad += piece.curvature.abs() * piece.length();
        }
        if summary.plan_length_m > 0.0 {
            summary.mean_grade_percent =
                100.0 * (summary.climb_m + summary.descent_m) / summary.plan_length_m;
        }
        summary
    }
}

impl Route {
    /// Samples at equal steps of at most `step` metres along the surface, both ends included.
    #[must_use]
    pub fn profile(&self, surface: &HeightSurface, step: f64) -> Vec<ProfilePoint> {
        let mut knots = vec![(0.0, self.grid[0])];
        for (from, to) in pieces(&self.grid, PIECE_CELLS) {
            let (travelled, _) = knots[knots.len() - 1];
            knots.push((travelled + Piece::new(surface, from, to).length(), to));
        }
        let total = knots[knots.len() - 1].0;
        let count = (total / step).ceil().clamp(1.0, MAX_SAMPLES);
        let mut next = 1;
        (0..=count as usize)
            .map(|i| {
                let distance = total * (i as f64 / count);
                while next + 1 < knots.len() && knots[next].0 < distance {
                    next += 1;
                }
                sample(surface, knots[next - 1], knots[next.min(knots.len() - 1)], distance)
            })
            .collect()
    }
}

/// No profile needs more samples.
const MAX_SAMPLES: f64 = 1e6;

fn sample(
    surface: &HeightSurface,
    (before, from): (f64, DVec2),
    (after, to): (f64, DVec2),
    distance: f64,
) -> ProfilePoint {
    let share = if after > before { (distance - before) / (after - before) } else { 0.0 };
    let at = from.lerp(to, share);
    let v = surface.frame().ground_vector(at.y, to - from);
    let jet = surface.jet(at);
    let (side, curvature) = across(&jet, v);
    let along = v.try_normalize().map_or(0.0, |t| DVec2::new(jet.zx, jet.zy).dot(t));
    let map = surface.frame().to_map(at);
    ProfilePoint {
        distance_m: distance,
        x: map.x,
        y: map.y,
        height_m: jet.z,
        grade_percent: 100.0 * along,
        side_slope_deg: side.atan().to_degrees(),
        normal_curvature_per_m: curvature,
    }
}
