//! Start regions: points between nodes, lines, areas.

use std::array::from_fn;

use glam::DVec2;

use super::stencil::UNREACHED;
use super::stencil::factoring::Factor;
use super::stencil::segment::segment;
use super::tensor_field::TensorField;
use crate::error::{Error, Result};
use crate::grid::tiling::{AREA, Tiling};
use crate::linalg::Sym2;

/// Values that a tile's nodes have from the start, infinite where none.
pub(super) type Seeds = [f32; AREA];

/// Where ways begin, in grid coordinates (column, row).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StartRegion {
    /// Single points, on nodes or between them.
    pub points: Vec<DVec2>,
    /// Polylines.
    pub lines: Vec<Vec<DVec2>>,
    /// Areas: closed rings, inside by the even-odd rule.
    pub areas: Vec<Vec<Vec<DVec2>>>,
    /// Distance already travelled there, in the unit of the metric: 0 or more. Default 0.
    pub value: f64,
}

impl From<DVec2> for StartRegion {
    fn from(point: DVec2) -> Self {
        Self { points: vec![point], ..Self::default() }
    }
}

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
    /// The same region with `value` travelled already.
    #[must_use]
    pub fn with_value(self, value: f64) -> Self {
        Self { value, ..self }
    }

    fn check(&self, tiling: &Tiling) -> Result<()> {
        /// So many times around the grid a region may reach in a periodic direction.
        const MOST_TURNS: f64 = 64.0;
        if !(self.value.is_finite() && self.value >= 0.0) {
            return Err(Error::argument("the value of a start region", self.value, "0 or more"));
        }
        let far = MOST_TURNS * DVec2::new(tiling.cols as f64, tiling.rows as f64);
        let bad = |at: &DVec2| {
            let [across, down] = tiling.periodic;
            !at.is_finite() || (across && at.x.abs() > far.x) || (down && at.y.abs() > far.y)
        };
        match self.vertices().find(bad) {
            Some(at) => Err(Error::argument(
                "a point of the start",
                at,
                format!("finite, and at most {MOST_TURNS} turns around a grid that is periodic"),
            )),
            None => Ok(()),
        }
    }

    fn vertices(&self) -> impl Iterator<Item = DVec2> + '_ {
        let points = self.points.iter().chain(self.lines.iter().flatten());
        points.chain(self.areas.iter().flatten().flatten()).copied()
    }

    /// Whether there is nothing in it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty() && self.lines.is_empty() && self.areas.is_empty()
    }

    /// Whether grid coordinates lie in one of the areas.
    #[must_use]
    pub fn covers(&self, at: DVec2) -> bool {
        self.areas.iter().any(|rings| {
            let crossings =
                rings.iter().flat_map(|ring| closed_segments(ring)).filter(|&(a, b)| {
                    (a.y > at.y) != (b.y > at.y)
                        && at.x < a.x + (at.y - a.y) / (b.y - a.y) * (b.x - a.x)
                });
            crossings.count() % 2 == 1
        })
    }

    /// Calls `visit(column, row)` for the nodes of a grid of `cols × rows` that lie in an area, by the even-odd rule; once for each
    /// area. The cost is that of the rows that the segments cross, and of the nodes.
    pub fn nodes_inside(&self, cols: usize, rows: usize, mut visit: impl FnMut(usize, usize)) {
        let tiling = Tiling::new(cols, rows);
        self.areas.iter().for_each(|rings| inside(&tiling, rings, &mut visit));
    }

    /// Start values in stored units: calls `set(col, row, value)` for nodes on and near the region.
    fn seed(&self, field: &TensorField, mut set: impl FnMut(usize, usize, f64)) {
        let travelled = self.value * field.root_scale();
        let mut set = |col, row, length| set(col, row, travelled + length);
        for (at, sides) in self.corners() {
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
        for (a, b) in self.segments() {
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
        for rings in &self.areas {
            inside(&field.tiling, rings, |col, row| {
                if field.is_open(col, row) {
                    set(col, row, 0.0);
                }
            });
        }
    }

    /// The points that geodesics fan out from, each with the directions of the sides that end there.
    pub(super) fn corners(&self) -> impl Iterator<Item = (DVec2, [DVec2; 2])> + '_ {
        let points = self.points.iter().map(|&point| (point, [DVec2::ZERO; 2]));
        let lines = self.lines.iter().flat_map(|line| corners(line, line.first() == line.last()));
        let rings = self.areas.iter().flatten().flat_map(|ring| corners(ring, true));
        points.chain(lines).chain(rings)
    }

    /// Segments of the lines and of the borders of the areas.
    fn segments(&self) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
        let lines =
            self.lines.iter().flat_map(|line| line.windows(2).map(|ends| (ends[0], ends[1])));
        lines.chain(self.areas.iter().flatten().flat_map(|ring| closed_segments(ring)))
    }

    /// The point of the region that a traveller at `at`, nearer than `radius` cells, can go to in a straight
    /// line, and the region's value with the length of that (stored units); the shortest of them. In periodic directions
    /// that of the nearest image of the region.
    fn foot(&self, field: &TensorField, at: DVec2, radius: f64) -> Option<(DVec2, f64)> {
        let far = DVec2::INFINITY;
        let (least, most) = self.vertices().fold((far, -far), |(a, b), p| (a.min(p), b.max(p)));
        let turns = field.tiling.images(at, least - radius, most + radius);
        let feet = turns.filter_map(|turn| {
            let (foot, length) = self.own_foot(field, at + turn, radius)?;
            Some((foot - turn, length))
        });
        feet.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn own_foot(&self, field: &TensorField, at: DVec2, radius: f64) -> Option<(DVec2, f64)> {
        let travelled = self.value * field.root_scale();
        if self.covers(at) {
            return Some((at, travelled));
        }
        let metric = field.metric_at(at)?;
        let feet = self.segments().map(|(a, b)| {
            let (_, theta) = segment(0.0, a - at, 0.0, b - at, metric);
            a.lerp(b, theta)
        });
        self.points
            .iter()
            .copied()
            .chain(feet)
            .filter(|foot| foot.distance(at) <= radius)
            .filter_map(|foot| Some((foot, travelled + straight(field, at, foot)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// The corners of a line and its ends, or of a ring, each with the directions of its two sides, zero for none. A point
/// that is given twice in a row, as to close a ring, is one.
fn corners(line: &[DVec2], closed: bool) -> Vec<(DVec2, [DVec2; 2])> {
    let mut line = line.to_vec();
    line.dedup();
    if closed && line.len() > 1 && line.first() == line.last() {
        line.pop();
    }
    let count = line.len();
    let side = |from: usize, to: Option<usize>| {
        to.filter(|&to| to < count).map_or(DVec2::ZERO, |to| line[to] - line[from])
    };
    let corner = |i: usize| match closed {
        true => [side(i, Some((i + count - 1) % count)), side(i, Some((i + 1) % count))],
        false => [side(i, i.checked_sub(1)), side(i, Some(i + 1))],
    };
    (0..count).map(|i| (line[i], corner(i))).collect()
}

fn closed_segments(ring: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    (0..ring.len()).map(|i| (ring[i], ring[(i + 1) % ring.len()]))
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

/// Nodes inside the rings by the even-odd rule, row by row between the crossings of their segments.
fn inside(tiling: &Tiling, rings: &[Vec<DVec2>], mut visit: impl FnMut(usize, usize)) {
    let heights = rings.iter().flatten().map(|at| at.y);
    let (north, south) =
        heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), y| (a.min(y), b.max(y)));
    let rows = tiling.span(1, north, south);
    let mut crossings = vec![Vec::new(); rows.len()];
    for (a, b) in rings.iter().flat_map(|ring| closed_segments(ring)) {
        for row in tiling.span(1, a.y.min(b.y), a.y.max(b.y)) {
            let y = row as f64;
            let x = a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x);
            if (a.y > y) != (b.y > y) && x.is_finite() {
                crossings[(row - rows.start) as usize].push(x);
            }
        }
    }
    for (row, mut crossings) in rows.zip(crossings) {
        crossings.sort_unstable_by(f64::total_cmp);
        for ends in crossings.chunks_exact(2) {
            for col in tiling.span(0, ends[0], ends[1]) {
                if let Some((c, r)) = tiling.node(col, row) {
                    visit(c, r);
                }
            }
        }
    }
}

/// Length of the straight way from `a` to `b` in stored units, by Simpson's rule with five points; `None` where a
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

/// Whether no wall is between two points nearby. A wall is a closed node or the line between two neighbouring ones.
pub(crate) fn sees(field: &TensorField, a: DVec2, b: DVec2) -> bool {
    /// Samples per cell of length: a wall in a cell is crossed by more than one of them or hardly touched.
    const DENSITY: f64 = 8.0;
    let steps = (a.distance(b) * DENSITY).ceil().max(1.0);
    (0..=steps as usize).all(|i| {
        let p = a.lerp(b, i as f64 / steps);
        let (col, row) = (p.x.floor() as isize, p.y.floor() as isize);
        let open = |i: isize, j: isize| {
            field.tiling.node(col + i, row + j).is_none_or(|(c, r)| field.is_open(c, r))
        };
        let corners = [open(0, 0), open(1, 0), open(0, 1), open(1, 1)];
        corners == [true; 4] || on_free_side(corners, p - p.floor(), a, b, p.floor())
    })
}

/// In a cell with closed corners: whether the way stays on the side of its own end's corner.
fn on_free_side(corners: [bool; 4], at: DVec2, a: DVec2, b: DVec2, cell: DVec2) -> bool {
    // The nearest corner, or one of the nearest, must be open, ...
    let distance = |i: usize| at.distance_squared(DVec2::new((i % 2) as f64, (i / 2) as f64));
    let nearest = (0..4).map(distance).fold(f64::INFINITY, f64::min);
    if !(0..4).any(|i| corners[i] && distance(i) <= nearest + 1e-9) {
        return false;
    }
    // ... and where a wall runs along a diagonal, the whole way must lie on one side of it.
    let side = |p: DVec2, rising: bool| {
        let q = p - cell;
        if rising { q.x - q.y } else { q.x + q.y - 1.0 }
    };
    let crosses = |rising: bool| side(a, rising) * side(b, rising) < 0.0;
    let falling_wall = !corners[1] && !corners[2];
    let rising_wall = !corners[0] && !corners[3];
    !(falling_wall && crosses(false) || rising_wall && crosses(true))
}
