//! The numbers of a route, measured on the smooth surface.

use glam::{DVec2, DVec3};
use serde::{Serialize, Serializer};

use super::Route;
use crate::metric::{MetricField, Parameter, Unit, length_along};
use crate::surface::{Jet, Surface};

/// The numbers of a route. Lengths and heights in metres, grades in percent: rise per plan length. The third axis is up.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the metric.
    pub metric: String,
    /// Parameters of the metric; in JSON members like the others.
    #[serde(flatten, serialize_with = "members")]
    pub parameters: Vec<Parameter>,
    /// Length of the line under the route's own metric.
    pub cost: f64,
    /// Unit of the cost.
    pub cost_unit: Unit,
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
    /// `∫|κ_n| ds`, the total normal curvature along the route, radians: how much the
    /// traveller pitches with the ground.
    pub total_normal_curvature_rad: f64,
    /// Start in map coordinates, or `x` and `y` in space.
    pub start: [f64; 2],
    /// Goal in map coordinates, or `x` and `y` in space.
    pub goal: [f64; 2],
    /// Name and version of this software.
    pub software: String,
}

/// Parameters as members of an object.
fn members<S: Serializer>(parameters: &[Parameter], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(parameters.iter().map(|parameter| (parameter.name, parameter.value)))
}

/// One sample of a route's profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ProfilePoint {
    /// Length on the surface from the start, m.
    pub distance_m: f64,
    /// Map coordinate, or `x` in space.
    pub x: f64,
    /// Map coordinate, or `y` in space.
    pub y: f64,
    /// Height, m.
    pub height_m: f64,
    /// Grade along the route, %; positive uphill.
    pub grade_percent: f64,
    /// Slope of the ground across the route, degrees.
    pub side_slope_deg: f64,
    /// Normal curvature along the route, 1/m; positive where the surface bends towards its normal: on heights in hollows.
    pub normal_curvature_per_m: f64,
}

/// A short straight segment of a line, measured at its middle.
struct Segment {
    /// Length on the surface, m.
    length: f64,
    /// Plan length, m.
    plan_length: f64,
    /// Rise, m.
    rise: f64,
    /// Slope across, as a tangent.
    side_slope: f64,
    /// Normal curvature, 1/m.
    curvature: f64,
}

impl Segment {
    fn new(surface: &dyn Surface, from: DVec2, to: DVec2) -> Self {
        let middle = from.midpoint(to);
        let by = (to - from) * surface.axes(middle.y);
        let jet = surface.jet(middle);
        let DirectionalShape { side_slope, curvature, .. } = DirectionalShape::new(&jet, by);
        let chord = surface.point(to) - surface.point(from);
        let rise = chord.z;
        let (plan_length, length) = match jet {
            Jet::Height(_) => (by.length(), by.length().hypot(rise)),
            Jet::Space(_) => (chord.truncate().length(), length_in_space(surface, &[from, to])),
        };
        Self { length, plan_length, rise, side_slope, curvature }
    }

    fn grade_percent(&self) -> f64 {
        if self.plan_length > 0.0 { 100.0 * self.rise / self.plan_length } else { 0.0 }
    }
}

/// Length of a line on a surface in space, m.
fn length_in_space(surface: &dyn Surface, line: &[DVec2]) -> f64 {
    length_along(line, |at, by| surface.jet(at).first_form().norm(by))
}

/// Slopes and curvature of the surface along a direction.
struct DirectionalShape {
    /// Rise per plan length along it.
    grade: f64,
    /// The same across it, without a sign.
    side_slope: f64,
    /// Normal curvature `vᵀBv / vᵀGv`, 1/m.
    curvature: f64,
}

impl DirectionalShape {
    /// Along a step `v` in the axes of the jet; all 0 for no step.
    fn new(jet: &Jet, v: DVec2) -> Self {
        let Some(t) = v.try_normalize() else {
            return Self { grade: 0.0, side_slope: 0.0, curvature: 0.0 };
        };
        match jet {
            Jet::Height(jet) => {
                let gradient = jet.gradient();
                let grade = gradient.dot(t);
                let bend = jet.zxx * t.x * t.x + 2.0 * jet.zxy * t.x * t.y + jet.zyy * t.y * t.y;
                let w = (1.0 + gradient.length_squared()).sqrt();
                let curvature = bend / (w * (1.0 + grade * grade));
                Self { grade, side_slope: gradient.perp_dot(t).abs(), curvature }
            }
            Jet::Space(space) => {
                let tangent = space.first[0] * t.x + space.first[1] * t.y;
                let level = tangent.truncate();
                let side_slope = jet.gradient().perp_dot(level.normalize_or_zero()).abs();
                let grade = tangent.z / level.length();
                Self { grade, side_slope, curvature: jet.normal_curvature(t) }
            }
        }
    }
}

/// Cuts a line into straight segments of at most `longest` cells.
fn segments(line: &[DVec2], longest: f64) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    line.windows(2).flat_map(move |ends| {
        let count = (ends[0].distance(ends[1]) / longest).ceil().max(1.0);
        let at = move |i: usize| ends[0].lerp(ends[1], i as f64 / count);
        (0..count as usize).map(move |i| (at(i), at(i + 1)))
    })
}

/// Segments of half a cell: the surface has no detail below a cell.
const SEGMENT_CELLS: f64 = 0.5;

impl Summary {
    pub(super) fn measure(line: &[DVec2], metric: &MetricField<'_>) -> Self {
        let surface = metric.surface();
        let mut summary = Self {
            metric: metric.name().to_owned(),
            parameters: metric.parameters().to_vec(),
            cost: metric.length(line),
            cost_unit: metric.unit(),
            length_m: 0.0,
            plan_length_m: 0.0,
            climb_m: 0.0,
            descent_m: 0.0,
            max_grade_percent: 0.0,
            mean_grade_percent: 0.0,
            max_side_slope_deg: 0.0,
            total_normal_curvature_rad: 0.0,
            start: map_coordinates(surface, line.first()),
            goal: map_coordinates(surface, line.last()),
            software: concat!("ridgeway ", env!("CARGO_PKG_VERSION")).to_owned(),
        };
        for (from, to) in segments(line, SEGMENT_CELLS) {
            let segment = Segment::new(surface, from, to);
            summary.length_m += segment.length;
            summary.plan_length_m += segment.plan_length;
            summary.climb_m += segment.rise.max(0.0);
            summary.descent_m += (-segment.rise).max(0.0);
            summary.max_grade_percent =
                summary.max_grade_percent.max(segment.grade_percent().abs());
            summary.max_side_slope_deg =
                summary.max_side_slope_deg.max(segment.side_slope.atan().to_degrees());
            summary.total_normal_curvature_rad += segment.curvature.abs() * segment.length;
        }
        if summary.plan_length_m > 0.0 {
            summary.mean_grade_percent =
                100.0 * (summary.climb_m + summary.descent_m) / summary.plan_length_m;
        }
        summary
    }
}

/// Map coordinates of the end of a line; not a number if the line has no points.
fn map_coordinates(surface: &dyn Surface, end: Option<&DVec2>) -> [f64; 2] {
    end.map_or([f64::NAN; 2], |&at| surface.point(at).truncate().into())
}

impl Route {
    /// Samples of a route of at least one point at equal steps of at most `step` metres along the surface, both ends included; never more than
    /// a million steps.
    #[must_use]
    pub fn profile(&self, surface: &dyn Surface, step: f64) -> Vec<ProfilePoint> {
        let mut knots = vec![(0.0, self.grid[0])];
        for (from, to) in segments(&self.grid, SEGMENT_CELLS) {
            let (travelled, _) = knots[knots.len() - 1];
            knots.push((travelled + Segment::new(surface, from, to).length, to));
        }
        let total = knots[knots.len() - 1].0;
        let count = (total / step).ceil().clamp(1.0, MAX_STEPS);
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

/// No profile needs more steps.
const MAX_STEPS: f64 = 1e6;

fn sample(
    surface: &dyn Surface,
    (before, from): (f64, DVec2),
    (after, to): (f64, DVec2),
    distance: f64,
) -> ProfilePoint {
    let share = if after > before { (distance - before) / (after - before) } else { 0.0 };
    let at = from.lerp(to, share);
    let jet = surface.jet(at);
    let shape = DirectionalShape::new(&jet, (to - from) * surface.axes(at.y));
    let DVec3 { x, y, z } = surface.point(at);
    ProfilePoint {
        distance_m: distance,
        x,
        y,
        height_m: z,
        grade_percent: 100.0 * shape.grade,
        side_slope_deg: shape.side_slope.atan().to_degrees(),
        normal_curvature_per_m: shape.curvature,
    }
}
