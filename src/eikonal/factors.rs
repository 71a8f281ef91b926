//! Source factors: which ones there are, and where each applies.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use glam::DVec2;
use rayon::prelude::*;

use super::source::POINT_RADIUS;
use super::start::StartRegion;
use super::stencil::factoring::{Factor, UNIFORM_RATIO, are_roots_within};
use super::tensor_field::{TensorField, TensorTile};
use crate::grid::tiling::{SIDE, Tiling};
use crate::linalg::Sym2;
use crate::linalg::lanes::{choose, greatest, lanes, least};
use crate::linalg::simd::{self, Kernel};

/// Radius of the region around a point where its factor applies, as a share of the grid's longer side: fixed in
/// metres, not in cells, or first order would keep its logarithm. In a prototype at n = 1001 .05, .1, .2, .4 gave a ratio of 400
/// a mean error of 5.2, 2.3, .7, .3 e-4 (after one correction) and the same on curvature tensors, which vary.
const RADIUS: f64 = 0.2;

/// With more corners there are no factors: for each tile all of them would be compared, and the fans of the many corners of a fine
/// outline are narrow.
const MOST_FACTORS: usize = 1000;

/// The factors of the start regions, and which of them each tile has.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Factors {
    tiling: Tiling,
    factors: Vec<Factor>,
    /// Index of each tile's factor plus one, 0 if it has none. Empty if all factors are images of one point: that of a tile is then
    /// quickly found.
    of_tile: Vec<u32>,
}

impl Factors {
    pub(crate) fn new(field: &TensorField, starts: &[StartRegion]) -> Self {
        Self::within(field, starts, f64::INFINITY)
    }

    /// Factors that agree with those of [`new`](Self::new) up to a `distance` (stored units); only nodes that can be reached within it are looked at.
    pub(crate) fn within(field: &TensorField, starts: &[StartRegion], distance: f64) -> Self {
        let of_start = |start: &StartRegion| {
            let travelled = start.value * field.root_scale();
            let corners = start.shapes.corners();
            corners
                .filter_map(|(at, edges)| {
                    Some(Factor::new(at, field.metric_at(at)?, edges, travelled))
                })
                .collect::<Vec<_>>()
        };
        let tiling = field.tiling;
        // Nothing fans out from a corner outside the grid: no path leads there.
        let inside = |factor: &Factor| tiling.contains(factor.at);
        let mut factors: Vec<Factor> = starts.iter().flat_map(of_start).filter(inside).collect();
        let radius = RADIUS * (tiling.cols.max(tiling.rows) - 1) as f64;
        if factors.is_empty() || factors.len() > MOST_FACTORS || radius < POINT_RADIUS {
            return Self::default();
        }
        // The discs that are searched together hold no more nodes than the grid, however many factors there are.
        let share = (tiling.cols * tiling.rows) as f64 / factors.len() as f64;
        for (number, factor) in factors.iter_mut().enumerate() {
            factor.number = number;
            factor.radius = radius;
            let most = radius.min(0.5 * share.sqrt()).min(factor.extent(distance));
            let uniform_radius =
                factor.images(&tiling).map(|image| image.find_uniform_radius(field, most));
            factor.uniform_radius = uniform_radius.fold(most, f64::min);
        }
        let tiles = if factors.len() > 1 { tiling.tiles() } else { 0 };
        let factors: Vec<Factor> =
            factors.into_iter().flat_map(|factor| factor.images(&tiling)).collect();
        let of_tile =
            (0..tiles).into_par_iter().map(|tile| nearest(&factors, &tiling, tile)).collect();
        Self { tiling, factors, of_tile }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.factors.is_empty()
    }

    /// The factor of a tile.
    pub(crate) fn of_tile(&self, tile: usize) -> Option<&Factor> {
        if self.is_empty() {
            return None;
        }
        let found = self.of_tile.get(tile).copied();
        let index = found.unwrap_or_else(|| nearest(&self.factors, &self.tiling, tile));
        self.factors.get(index.checked_sub(1)? as usize)
    }

    /// The factor that applies at all the given nodes: its image nearest to them where the grid is periodic.
    pub(crate) fn around(
        &self,
        field: &TensorField,
        nodes: impl IntoIterator<Item = (isize, isize)>,
    ) -> Option<Factor> {
        let mut found: Option<Factor> = None;
        for (col, row) in nodes {
            let (c, r) = field.tiling.node(col, row)?;
            let (&factor, ..) = self.at_node(field, c, r)?;
            let shift = DVec2::new((col - c as isize) as f64, (row - r as isize) as f64);
            let factor = Factor { at: factor.at + shift, ..factor };
            if found.is_some_and(|found| !found.is(&factor)) {
                return None;
            }
            found = Some(factor);
        }
        found
    }

    /// What to add to the values on the ring of a node.
    pub(crate) fn terms(&self, field: &TensorField, col: usize, row: usize) -> [f64; 8] {
        self.at_node(field, col, row).map_or([0.0; 8], |(_, _, terms)| terms)
    }

    /// The factor that applies at a node, the vector to the node from its point, and the terms.
    pub(crate) fn at_node(
        &self,
        field: &TensorField,
        col: usize,
        row: usize,
    ) -> Option<(&Factor, DVec2, [f64; 8])> {
        let factor = self.of_tile(field.tiling.locate(col, row).0)?;
        let v = DVec2::new(col as f64, row as f64) - factor.at;
        let terms = factor.terms(v, field.metric(col, row)?.inverse())?;
        Some((factor, v, terms))
    }
}

/// The factor whose distance, under its own metric, is the least on all of a tile, if its disc touches the tile; its index plus one, as in
/// [`Factors::of_tile`]. 0 where another that is not its image is less somewhere: the front of that one would meet the terms of a foreign
/// factor, each of which lowers it a little.
fn nearest(factors: &[Factor], tiling: &Tiling, tile: usize) -> u32 {
    let [cols, rows] = tiling.size(tile);
    let half = 0.5 * (DVec2::new(cols as f64, rows as f64) - 1.0);
    let middle = tiling.first(tile) + half;
    let index = nearest_to(factors, middle);
    let Factor { radius, number, .. } = factors[index];
    if factors[index].gap(tiling, tile).length() > radius {
        return 0;
    }
    // The region of one factor is convex where all have the same metric: comparing at the corners is enough.
    let is_same = |x: f64, y: f64| {
        let corner = middle + DVec2::new(x, y) * (half + 1.0);
        factors[nearest_to(factors, corner)].number == number
    };
    let is_alone = factors.iter().all(|factor| factor.number == 0)
        || is_same(-1.0, -1.0) && is_same(1.0, -1.0) && is_same(-1.0, 1.0) && is_same(1.0, 1.0);
    if is_alone { index as u32 + 1 } else { 0 }
}

/// The factor whose distance to a point, under its own metric, is the least.
fn nearest_to(factors: &[Factor], at: DVec2) -> usize {
    let length = |factor: &Factor| factor.travelled + factor.value(at - factor.at);
    let lengths = factors.iter().map(length).enumerate();
    lengths.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index)
}

/// Where a factor applies.
impl Factor {
    /// How many rows and columns around the point, up to `most`, have a metric nearly that of the point, see [`UNIFORM_RATIO`].
    fn find_uniform_radius(&self, field: &TensorField, most: f64) -> f64 {
        let tiling = field.tiling;
        let gap = |tile: usize| self.gap(&tiling, tile).max_element();
        let mut tiles: Vec<usize> =
            tiling.tiles_around(self.at, most).filter(|&tile| gap(tile) <= most).collect();
        tiles.sort_by(|&a, &b| gap(a).total_cmp(&gap(b)));
        let mut nearest = most as f32 + 1.0;
        for tile in tiles {
            if gap(tile) >= f64::from(nearest) {
                break;
            }
            let from = tiling.first(tile) - self.at.round();
            let dissimilar = simd::dispatch(NearestDissimilar {
                tile: field.tensors(tile),
                metric: self.metric,
                from,
            });
            nearest = least(nearest, dissimilar);
        }
        f64::from(nearest - 1.0).max(0.0)
    }

    /// Columns and rows between the point and the nearest node of a tile; 0 inside.
    fn gap(&self, tiling: &Tiling, tile: usize) -> DVec2 {
        let half = 0.5 * (SIDE - 1) as f64;
        ((self.at - tiling.first(tile) - half).abs() - half).max(DVec2::ZERO)
    }

    /// How far in cells from the point a path of `length` (stored units) can lead within the uniform radius, and a node more at
    /// either end.
    fn extent(&self, length: f64) -> f64 {
        let d = self.metric.inverse();
        let fastest = 0.5 * (d.xx + d.yy) + (0.5 * (d.xx - d.yy)).hypot(d.xy);
        length * (f64::from(UNIFORM_RATIO) * fastest).sqrt() + 2.0
    }

    /// Its periodic images whose discs touch the grid; of more than three in a direction, the middle ones.
    fn images(self, tiling: &Tiling) -> impl Iterator<Item = Self> {
        let period = DVec2::new(tiling.cols as f64, tiling.rows as f64);
        let reach = period.min(DVec2::splat(self.radius));
        let shifts = tiling.images(self.at, -reach, period - 1.0 + reach);
        shifts.map(move |shift| Self { at: self.at + shift, ..self })
    }
}

/// Distance from the point, in rows or columns, of the nearest open node of a tile whose metric is not nearly `metric`; the first
/// node of the tile lies at `from`.
struct NearestDissimilar<'a> {
    tile: &'a TensorTile,
    metric: Sym2,
    from: DVec2,
}

impl Kernel for NearestDissimilar<'_> {
    type Output = f32;

    #[inline(always)]
    fn run(self) -> f32 {
        let Self { tile, metric, from } = self;
        let (mxx, mxy, myy) = (metric.xx as f32, metric.xy as f32, metric.yy as f32);
        let mdet = metric.det() as f32;
        let mut nearest = [f32::INFINITY; SIDE];
        for row in 0..SIDE {
            let y = (from.y as f32 + row as f32).abs();
            let (xx, xy) = (lanes(&tile.xx, row * SIDE), lanes(&tile.xy, row * SIDE));
            let det = lanes(&tile.det, row * SIDE);
            for i in 0..SIDE {
                let yy = (det[i] + xy[i] * xy[i]) / xx[i];
                let trace = mxx * xx[i] + 2.0 * mxy * xy[i] + myy * yy;
                let similar =
                    (det[i] == 0.0) | are_roots_within(trace, det[i] * mdet, UNIFORM_RATIO);
                let distance = greatest((from.x as f32 + i as f32).abs(), y);
                nearest[i] = least(nearest[i], choose(similar, f32::INFINITY, distance));
            }
        }
        let mut least_of_all = f32::INFINITY;
        for distance in nearest {
            least_of_all = least(least_of_all, distance);
        }
        least_of_all
    }
}
