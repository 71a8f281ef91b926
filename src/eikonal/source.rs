//! Start values: at the nodes on and near points, lines and areas, and the path back to these.

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

/// Values that a tile's nodes have from the start, infinite where none.
pub(super) type Seeds = [f32; AREA];

/// Around a point or a corner, nodes this near get the length of the geodesic to it, of second order, see [`geodesic`]. A ball of a
/// fixed size in cells is safe on any metric.
pub(super) const POINT_RADIUS: f64 = 4.0;
/// Around a line or the border of an area: enough that every triangle next to it has values.
const LINE_RADIUS: f64 = 1.5;

/// How far from the nearest point of a line the foot of a node on it is looked for, in cells.
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
        let (tile, place) = field.tiling.place(col, row);
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
        for (at, sides) in self.shapes.corners() {
            let Some(metric) = field.metric_at(at) else { continue };
            let factor = Factor::new(at, metric, sides, travelled);
            let is_clear = is_clear(field, at, POINT_RADIUS);
            let vicinity = Vicinity::around(field, at);
            near(field, at, at, POINT_RADIUS, |col, row, node, _| {
                if factor.holds(node - at)
                    && (is_clear || sees(field, node, at))
                    && let Some(length) = geodesic(&vicinity, node, at)
                {
                    set(col, row, length);
                }
            });
        }
        for [a, b] in self.shapes.segments() {
            near(field, a, b, LINE_RADIUS, |col, row, node, nearest| {
                if let Some(metric) = field.metric(col, row) {
                    let (_, theta) = segment(0.0, a - node, 0.0, b - node, metric);
                    let away = (a.lerp(b, theta) - nearest).clamp_length_max(REACH);
                    if let Some(length) = straight(field, node, nearest + away) {
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

    /// The point of the region that a traveller at `at`, nearer than `radius` cells, can go to in a straight
    /// line, and the region's value with the length of that (stored units); the shortest of them. In periodic directions
    /// that of the nearest image of the region.
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
            .filter_map(|foot| Some((foot, travelled + straight(field, at, foot)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Open nodes within `radius` cells of the segment, each with its place beside it and its nearest point on it.
fn near(
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
fn straight(field: &TensorField, a: DVec2, b: DVec2) -> Option<f64> {
    if !sees(field, a, b) {
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
const VICINITY: usize = 2 * (POINT_RADIUS as usize + 2);

/// The metrics of the nodes around a point: its seeds look at each some twenty times.
struct Vicinity<'a> {
    tiling: &'a Tiling,
    /// Column and row of the first node.
    first: [isize; 2],
    metrics: [[Option<Sym2>; VICINITY]; VICINITY],
}

impl<'a> Vicinity<'a> {
    fn around(field: &'a TensorField, at: DVec2) -> Self {
        // Also far outside the grid.
        let first = [at.x, at.y].map(|x| (x.floor() - POINT_RADIUS - 1.0) as isize);
        let place = |axis: usize, i: usize| first[axis].saturating_add_unsigned(i);
        let metric = |col: usize, row: usize| field.metric_of(place(0, col), place(1, row));
        let metrics = from_fn(|row| from_fn(|col| metric(col, row)));
        Self { tiling: &field.tiling, first, metrics }
    }

    fn metric(&self, col: isize, row: isize) -> Option<Sym2> {
        let (col, row) = (col.wrapping_sub(self.first[0]), row.wrapping_sub(self.first[1]));
        *self.metrics.get(row as usize)?.get(col as usize)?
    }

    /// As [`TensorField::metric_at`].
    fn metric_at(&self, at: DVec2) -> Option<Sym2> {
        self.tiling.bilinear(at, |col, row| self.metric(col, row))
    }

    /// Whether all corners of the cell around a point are open that its bilinear value depends on.
    fn is_open_around(&self, at: DVec2) -> bool {
        let ends = |x: f64| [x.floor() as isize, x.ceil() as isize];
        ends(at.y).iter().all(|&row| ends(at.x).iter().all(|&col| self.metric(col, row).is_some()))
    }
}

/// Length of the geodesic between two points nearby in stored units: `d² = E − B` up to fourth order in the distance,
/// with the energy `E = ∫ vᵀMv` of the chord `v` and what bending saves, `B = ‖Γ(v, v)‖²_D/12` by the Christoffel
/// symbols at its middle. Both points see each other.
fn geodesic(vicinity: &Vicinity<'_>, a: DVec2, b: DVec2) -> Option<f64> {
    /// The expansion is no good where bending would save more than this share.
    const MOST: f64 = 0.2;
    let v = b - a;
    let weights = [1.0, 4.0, 2.0, 4.0, 1.0];
    let mut energy = 0.0;
    for (i, weight) in weights.into_iter().enumerate() {
        energy += weight / 12.0 * vicinity.metric_at(a + v * (i as f64 / 4.0))?.form(v);
    }
    let middle = a.midpoint(b);
    let (least, most) = vicinity.tiling.bounds();
    let slope = |by: DVec2| {
        let (before, after) = ((middle - by).clamp(least, most), (middle + by).clamp(least, most));
        let length = (after - before).length();
        // Beside walls there is no telling; there the chord has to do.
        if length > 0.0 && vicinity.is_open_around(before) && vicinity.is_open_around(after) {
            Some((vicinity.metric_at(after)? + vicinity.metric_at(before)? * -1.0) * length.recip())
        } else {
            Some(Sym2::default())
        }
    };
    let (mx, my) = (slope(DVec2::X)?, slope(DVec2::Y)?);
    let bend = (mx * v.x + my * v.y).apply(v) - 0.5 * DVec2::new(mx.form(v), my.form(v));
    let saved = vicinity.metric_at(middle)?.inverse().form(bend) / 12.0;
    Some((energy - saved.min(MOST * energy)).sqrt())
}

/// Whether no node of the cells within `radius` of a point is closed: then all points there see each other.
fn is_clear(field: &TensorField, at: DVec2, radius: f64) -> bool {
    let (least, most) = ((at - radius).floor(), (at + radius).floor() + 1.0);
    (least.y as isize..=most.y as isize).all(|row| {
        (least.x as isize..=most.x as isize)
            .all(|col| field.tiling.node(col, row).is_none_or(|(c, r)| field.is_open(c, r)))
    })
}

/// Whether no wall is between two points nearby, see [`in_sight`].
pub(crate) fn sees(field: &TensorField, a: DVec2, b: DVec2) -> bool {
    in_sight(a, b, |col, row| field.tiling.node(col, row).is_none_or(|(c, r)| field.is_open(c, r)))
}
