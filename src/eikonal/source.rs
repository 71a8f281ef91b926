//! Start values at the nodes on and near the start regions, and the last straight piece of a path back to these.

use std::array::from_fn;

use glam::DVec2;

use super::start::StartRegion;
use super::stencil::UNREACHED;
use super::stencil::factoring::Factor;
use super::stencil::segment::segment;
use super::tensor_field::TensorField;
use crate::error::{Error, Result};
use crate::grid::tiling::{AREA, Tiling};
use crate::grid::{in_sight, nodes_inside};
use crate::linalg::Sym2;

/// Start values of the nodes of a tile, infinite where there is none.
pub(super) type Seeds = [f32; AREA];

/// Around a point or a corner, nodes within so many cells get the length of the geodesic to it, see [`geodesic_length`]. A disc of a
/// fixed size in cells is safe on any metric.
pub(super) const POINT_RADIUS: f64 = 4.0;
/// Around a line or the border of an area: enough that every triangle next to it has values.
const LINE_RADIUS: f64 = 1.5;

/// How far from the nearest point of a line, in cells, the foot of a node may lie on it.
const REACH: f64 = 100.0;

/// Start values of all regions in stored units: calls `set(col, row, value, region)` for nodes on and near them.
///
/// # Errors
/// A value or a coordinate that is no number; no open node at any region.
pub(super) fn seed_all(
    field: &TensorField,
    starts: &[StartRegion],
    mut set: impl FnMut(usize, usize, f32, u32),
) -> Result<()> {
    let mut seeds = 0;
    for (start, region) in starts.iter().zip(0..) {
        start.check(&field.tiling)?;
        if field.tiling.tiles() == 0 {
            break;
        }
        start.seed(field, |col, row, value| {
            let value = value as f32;
            if value < UNREACHED {
                set(col, row, value, region);
                seeds += 1;
            }
        });
    }
    if seeds == 0 {
        return Err(Error::argument(
            "the start",
            "outside the grid, on a void or a barrier, or where the metric is too extreme to compute with, as around \
             heights that no terrain has",
            "on open ground",
        ));
    }
    Ok(())
}

/// Start values of the tiles that have some.
///
/// # Errors
/// As [`seed_all`].
pub(super) fn seeds(
    field: &TensorField,
    starts: &[StartRegion],
) -> Result<Vec<Option<Box<Seeds>>>> {
    let mut seeds = vec![None; field.tiling.tiles()];
    add_seeds(field, starts, &mut seeds)?;
    Ok(seeds)
}

/// Adds the start values to those of the tiles; gives the tiles that had none before, in ascending order.
///
/// # Errors
/// As [`seed_all`].
pub(super) fn add_seeds(
    field: &TensorField,
    starts: &[StartRegion],
    seeds: &mut [Option<Box<Seeds>>],
) -> Result<Vec<usize>> {
    let mut tiles = Vec::new();
    seed_all(field, starts, |col, row, value, _| {
        let (tile, place) = field.tiling.locate(col, row);
        let seeds = seeds[tile].get_or_insert_with(|| {
            tiles.push(tile);
            Box::new([f32::INFINITY; AREA])
        });
        seeds[place] = seeds[place].min(value);
    })?;
    tiles.sort_unstable();
    Ok(tiles)
}

/// The best of [`StartRegion::foot`] over all regions.
pub(super) fn foot_on_any(
    starts: &[StartRegion],
    field: &TensorField,
    at: DVec2,
    radius: f64,
) -> Option<(DVec2, f64)> {
    let feet = starts.iter().filter_map(|start| start.foot(field, at, radius));
    feet.min_by(|a, b| a.1.total_cmp(&b.1))
}

impl StartRegion {
    /// Start values in stored units: calls `set(col, row, value)` for nodes on and near the region.
    fn seed(&self, field: &TensorField, mut set: impl FnMut(usize, usize, f64)) {
        let travelled = self.value * field.root_scale();
        let mut set = |col, row, length| set(col, row, travelled + length);
        for (at, edges) in self.shapes.corners() {
            let Some(metric) = field.metric_at(at) else { continue };
            let factor = Factor::new(at, metric, edges, travelled);
            let is_clear = is_clear(field, at, POINT_RADIUS);
            let vicinity = Vicinity::around(field, at);
            visit_near(field, at, at, POINT_RADIUS, |col, row, node, _| {
                if factor.is_in_fan(node - at)
                    && (is_clear || has_line_of_sight(field, node, at))
                    && let Some(length) = geodesic_length(&vicinity, node, at)
                {
                    set(col, row, length);
                }
            });
        }
        for [a, b] in self.shapes.segments() {
            visit_near(field, a, b, LINE_RADIUS, |col, row, node, nearest| {
                if let Some(metric) = field.metric(col, row) {
                    let (_, theta) = segment(0.0, a - node, 0.0, b - node, metric);
                    let away = (a.lerp(b, theta) - nearest).clamp_length_max(REACH);
                    if let Some(length) = chord_length(field, node, nearest + away) {
                        set(col, row, length);
                    }
                }
            });
        }
        for polygon in &self.shapes.polygons {
            nodes_inside(polygon, &field.tiling, |col, row| {
                if field.is_open(col, row) {
                    set(col, row, 0.0);
                }
            });
        }
    }

    /// The foot of `at`: the point of the region, at most `radius` cells away and in sight, to which a straight path is the shortest;
    /// and its length with the region's value added (stored units). In periodic directions the least over the images of the region.
    fn foot(&self, field: &TensorField, at: DVec2, radius: f64) -> Option<(DVec2, f64)> {
        let far = DVec2::INFINITY;
        let (least, most) =
            self.shapes.vertices().fold((far, -far), |(a, b), p| (a.min(p), b.max(p)));
        let images = field.tiling.images(at, least - radius, most + radius);
        let feet = images.filter_map(|shift| {
            let (foot, length) = self.own_foot(field, at + shift, radius)?;
            Some((foot - shift, length))
        });
        feet.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// [`foot`](Self::foot) without the images.
    fn own_foot(&self, field: &TensorField, at: DVec2, radius: f64) -> Option<(DVec2, f64)> {
        let travelled = self.value * field.root_scale();
        if self.shapes.contains(at) {
            return Some((at, travelled));
        }
        let metric = field.metric_at(at)?;
        let feet = self.shapes.segments().map(|[a, b]| {
            let (_, theta) = segment(0.0, a - at, 0.0, b - at, metric);
            a.lerp(b, theta)
        });
        let points = self.shapes.points.iter();
        points
            .copied()
            .chain(feet)
            .filter(|foot| foot.distance(at) <= radius)
            .filter_map(|foot| Some((foot, travelled + chord_length(field, at, foot)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Visits the open nodes within `radius` cells of the segment: column and row, the coordinates (of the image next to the segment, in
/// periodic directions), and the nearest point of the segment.
fn visit_near(
    field: &TensorField,
    a: DVec2,
    b: DVec2,
    radius: f64,
    mut visit: impl FnMut(usize, usize, DVec2, DVec2),
) {
    let (least, most) = (a.min(b) - radius, a.max(b) + radius);
    for row in field.tiling.span(1, least.y, most.y) {
        for col in field.tiling.span(0, least.x, most.x) {
            let Some((c, r)) = field.tiling.node(col, row) else { continue };
            let node = DVec2::new(col as f64, row as f64);
            let (_, theta) = segment(0.0, a - node, 0.0, b - node, Sym2::new(1.0, 0.0, 1.0));
            let nearest = a.lerp(b, theta);
            if nearest.distance(node) <= radius && field.is_open(c, r) {
                visit(c, r, node, nearest);
            }
        }
    }
}

/// Length of the straight path from `a` to `b` in stored units, by Simpson's rule with five points; `None` where a
/// wall is in the way.
fn chord_length(field: &TensorField, a: DVec2, b: DVec2) -> Option<f64> {
    if !has_line_of_sight(field, a, b) {
        return None;
    }
    let by = b - a;
    let weights = [1.0, 4.0, 2.0, 4.0, 1.0];
    let mut sum = 0.0;
    for (i, weight) in weights.into_iter().enumerate() {
        sum += weight / 12.0 * field.metric_at(a + by * (i as f64 / 4.0))?.norm(by);
    }
    Some(sum)
}

/// Side of a vicinity in nodes: it holds the cells half a cell beyond [`POINT_RADIUS`].
const VICINITY_SIDE: usize = 2 * (POINT_RADIUS as usize + 2);

/// The metrics of the nodes around a point, unpacked once: the start values around it read each some twenty times.
struct Vicinity<'a> {
    tiling: &'a Tiling,
    /// Column and row of the first node.
    first: [isize; 2],
    metrics: [[Option<Sym2>; VICINITY_SIDE]; VICINITY_SIDE],
    costs: [[f64; VICINITY_SIDE]; VICINITY_SIDE],
}

impl<'a> Vicinity<'a> {
    fn around(field: &'a TensorField, at: DVec2) -> Self {
        // Also far outside the grid.
        let first = [at.x, at.y].map(|x| (x.floor() - POINT_RADIUS - 1.0) as isize);
        let place = |axis: usize, i: usize| first[axis].saturating_add_unsigned(i);
        let metric = |col: usize, row: usize| field.metric_of(place(0, col), place(1, row));
        let metrics = from_fn(|row| from_fn(|col| metric(col, row)));
        let cost = |col: usize, row: usize| field.cost(place(0, col), place(1, row)).unwrap_or(1.0);
        let costs = from_fn(|row| from_fn(|col| cost(col, row)));
        Self { tiling: &field.tiling, first, metrics, costs }
    }

    fn metric(&self, col: isize, row: isize) -> Option<Sym2> {
        Some(self.metric_and_cost(col, row)?.0)
    }

    fn metric_and_cost(&self, col: isize, row: isize) -> Option<(Sym2, f64)> {
        let (col, row) = (col.wrapping_sub(self.first[0]), row.wrapping_sub(self.first[1]));
        let metric = *self.metrics.get(row as usize)?.get(col as usize)?;
        Some((metric?, self.costs[row as usize][col as usize]))
    }

    /// As [`TensorField::metric_at`].
    fn metric_at(&self, at: DVec2) -> Option<Sym2> {
        let cost = |col, row| Some(Sym2::new(self.metric_and_cost(col, row)?.1, 0.0, 0.0));
        let rest = |col, row| {
            let (metric, cost) = self.metric_and_cost(col, row)?;
            Some(metric * cost.powi(-2))
        };
        let cost = self.tiling.bilinear(at, cost)?.xx;
        Some(self.tiling.bilinear(at, rest)? * (cost * cost))
    }

    /// No path from `a` to `b` among the nodes around them is shorter: the least length of `b − a` under the metric of any of these.
    fn least_length(&self, a: DVec2, b: DVec2) -> f64 {
        let (from, to) = ((a.min(b) - 1.0).floor(), (a.max(b) + 1.0).ceil());
        let columns = from.x as isize..=to.x as isize;
        let nodes = (from.y as isize..=to.y as isize)
            .flat_map(|row| columns.clone().map(move |col| (col, row)));
        let lengths = nodes.filter_map(|(col, row)| Some(self.metric(col, row)?.norm(b - a)));
        lengths.fold(f64::INFINITY, f64::min)
    }

    /// The derivative of the metric at a point along a unit vector, by a central difference; zero next to walls.
    fn slope(&self, at: DVec2, along: DVec2) -> Option<Sym2> {
        let (least, most) = self.tiling.bounds();
        let (before, after) = ((at - along).clamp(least, most), (at + along).clamp(least, most));
        let length = (after - before).length();
        if length > 0.0 && self.is_open_around(before) && self.is_open_around(after) {
            Some((self.metric_at(after)? + self.metric_at(before)? * -1.0) * length.recip())
        } else {
            Some(Sym2::default())
        }
    }

    /// Whether all nodes on which the bilinear value at a point depends are open.
    fn is_open_around(&self, at: DVec2) -> bool {
        let ends = |x: f64| [x.floor() as isize, x.ceil() as isize];
        ends(at.y).iter().all(|&row| ends(at.x).iter().all(|&col| self.metric(col, row).is_some()))
    }
}

/// Length of the geodesic between two points nearby, in sight of each other, in stored units: `d² = E − B` up to fourth order in the
/// distance, with the energy `E = ∫ vᵀMv` of the chord `v`, less what bending saves, `B = ‖Γ(v, v)‖²_D/12` with the Christoffel
/// symbols `Γ` (of the first kind) at its middle. Where the metric varies too much along the chord for that, the cost of the chord as a step of
/// the update has it, if it is no longer than one; `None` farther away, where the update gives a better value.
fn geodesic_length(vicinity: &Vicinity<'_>, a: DVec2, b: DVec2) -> Option<f64> {
    /// Largest share `B/E`, and largest ratio of the lengths of the chord under the metrics along it: the expansion does not hold beyond.
    const MAX_SHARE: f64 = 0.2;
    const MAX_RATIO: f64 = 1.5;
    let v = b - a;
    let weights = [1.0, 4.0, 2.0, 4.0, 1.0];
    let mut energy = 0.0;
    let (mut least, mut most) = (f64::INFINITY, 0f64);
    for (i, weight) in weights.into_iter().enumerate() {
        let square = vicinity.metric_at(a + v * (i as f64 / 4.0))?.form(v);
        energy += weight / 12.0 * square;
        (least, most) = (least.min(square), most.max(square));
    }
    let middle = a.midpoint(b);
    let (mx, my) = (vicinity.slope(middle, DVec2::X)?, vicinity.slope(middle, DVec2::Y)?);
    // Γ(v, v) = (∂ᵥM) v − ½ ∇(vᵀMv).
    let christoffel = (mx * v.x + my * v.y).apply(v) - 0.5 * DVec2::new(mx.form(v), my.form(v));
    let saved = vicinity.metric_at(middle)?.inverse().form(christoffel) / 12.0;
    if saved > MAX_SHARE * energy || most > MAX_RATIO * MAX_RATIO * least {
        let ends = [vicinity.metric_at(a)?.norm(v), vicinity.metric_at(b)?.norm(v)];
        return (v.abs().max_element() <= 1.0).then_some(0.5 * (ends[0] + ends[1]));
    }
    Some((energy - saved).sqrt().max(vicinity.least_length(a, b)))
}

/// Whether no node of the cells within `radius` of a point is closed: then all points there are in sight of each other.
fn is_clear(field: &TensorField, at: DVec2, radius: f64) -> bool {
    let (least, most) = ((at - radius).floor(), (at + radius).floor() + 1.0);
    (least.y as isize..=most.y as isize).all(|row| {
        (least.x as isize..=most.x as isize)
            .all(|col| field.tiling.node(col, row).is_none_or(|(c, r)| field.is_open(c, r)))
    })
}

/// Whether no wall lies between two points nearby, see [`in_sight`].
pub(crate) fn has_line_of_sight(field: &TensorField, a: DVec2, b: DVec2) -> bool {
    in_sight(a, b, |col, row| field.tiling.node(col, row).is_none_or(|(c, r)| field.is_open(c, r)))
}
