//! Distances: `√(∇gᵀ D ∇g) = 1`, `g = 0` on the start region.
//!
//! [`Solver::solve`] discretises the equation by the semi-Lagrangian update on the eight triangles around a node
//! (`stencil/`) and iterates it to a standstill tile by tile in order of distance (`tiles.rs`). First order
//! in the spacing, also near the start, where the cone of a point is taken out (`stencil/factoring.rs`); second order by deferred
//! correction if asked for ([`Accuracy`], `second_order/`). Walls one node thick do not leak, also diagonally. Cost: 30 to 60
//! ns of one core and 16 bytes per node, at high accuracy 80 to 150 ns and 24 bytes. [`mod@reference`] is the slow
//! judge; `docs/solver.md` has the measurements.

mod ball;
mod board;
mod cell;
mod crew;
mod edit;
mod factors;
mod field;
mod labels;
mod predecessor;
mod queue;
pub mod reference;
mod second_order;
mod sides;
mod source;
mod stencil;
mod stop;
mod tile;
mod tiles;

use glam::DVec2;
use rayon::prelude::*;

pub(crate) use self::ball::Balls;
use self::factors::Factors;
pub use self::field::TensorField;
use self::field::{AREA, TensorTile};
use self::predecessor::best_foot;
use self::second_order::{Correction, FirstOrder};
use self::source::Seeds;
pub use self::source::StartRegion;
pub(crate) use self::source::sees;
use self::stencil::UNREACHED;
use self::stencil::factoring::Factor;
pub use self::stop::Stop;
use self::tile::Limits;
pub use self::tiles::Statistics;
use self::tiles::{Equation, News, Solution, Values};
use crate::control::Control;
use crate::error::{Error, Result};
use crate::grid::GridFrame;
use crate::linalg::bilinear::{CORNERS, corner_weights};
use crate::metric::MetricField;

/// Solves the eikonal equation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solver {
    /// Iteration stops where a node would change by less than this share of its shortest step. Default 1e-3,
    /// which moves no value by more than 1e-4 of the largest, at 1001² by 4e-5, less than the scheme's own error; with a tenth of
    /// it a solve takes up to 12 % longer.
    pub tolerance: f32,
    /// How accurate.
    pub accuracy: Accuracy,
}

/// How accurate a solve is to be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Accuracy {
    /// First order in the spacing.
    #[default]
    Fast,
    /// Second order, by deferred correction, with an estimate of the error at each node; takes 2.1 to 3.1 times as long, with
    /// AVX2 but not AVX-512 up to 3.7.
    High,
}

impl Default for Solver {
    fn default() -> Self {
        Self { tolerance: 1e-3, accuracy: Accuracy::default() }
    }
}

impl Solver {
    /// Distance under `metric` from the nearest of `starts` (grid coordinates), the distance already travelled there
    /// included, at every node that can be reached before `stop`.
    ///
    /// # Errors
    /// [`Error::Usage`] if no open node is at any start, or a number is out of range; [`Error::Cancelled`].
    pub fn solve(
        &self,
        metric: &MetricField<'_>,
        starts: &[StartRegion],
        stop: &Stop,
        control: &Control,
    ) -> Result<DistanceMap> {
        let field = TensorField::sample(metric, control)?;
        let mut map = self.solve_field(field, starts, stop, control)?;
        map.unit = metric.unit();
        map.frame = Some(metric.surface().frame().clone());
        Ok(map)
    }

    /// [`solve`](Self::solve) on tensors of any origin, in index coordinates.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_field(
        &self,
        field: TensorField,
        starts: &[StartRegion],
        stop: &Stop,
        control: &Control,
    ) -> Result<DistanceMap> {
        stop.check()?;
        let seeds = source::seeds(&field, starts)?;
        let mut factors = Factors::new(&field, starts);
        let solve = |factors: &Factors| {
            let equation =
                Equation { field: &field, factors, seeds: &seeds, tolerance: self.tolerance };
            let values = Values::seeded(&field, &seeds);
            let limits = vec![Limits::default(); field.tiling.tiles()];
            tiles::solve(&equation, values, limits, News::All, stop, control)
        };
        let mut solution = solve(&factors)?;
        if solution.is_none() && !factors.is_empty() {
            factors = Factors::default();
            solution = solve(&factors)?;
        }
        let Solution { values, limits, statistics } = solution.ok_or_else(unsettled)?;
        control.report("solving distance", 1.0);
        let map = DistanceMap {
            field,
            factors,
            values,
            correction: None,
            limits,
            starts: starts.into(),
            statistics,
            unit: "",
            frame: None,
        };
        self.correct(map, &seeds, &[], control)
    }

    /// Brings first-order values to second order, if that is asked for; if they have a correction, only where tiles `changed`.
    fn correct(
        &self,
        mut map: DistanceMap,
        seeds: &[Option<Box<Seeds>>],
        changed: &[bool],
        control: &Control,
    ) -> Result<DistanceMap> {
        let before = map.correction.take();
        let DistanceMap { field, factors, values, .. } = &map;
        let solution = FirstOrder { field, factors, values, seeds };
        map.correction = match (self.accuracy, before) {
            (Accuracy::Fast, _) => None,
            (Accuracy::High, None) => Some(Correction::new(&solution, control)?),
            (Accuracy::High, Some(before)) => Some(before.update(&solution, changed, control)?),
        };
        Ok(map)
    }

    /// Goes on with a map that a [`Stop`] ended, without solving again what is final. The outcome is that of a solve
    /// with the new `stop` from the beginning, within the tolerance; [`DistanceMap::statistics`] count what was added.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn resume(&self, map: DistanceMap, stop: &Stop, control: &Control) -> Result<DistanceMap> {
        stop.check()?;
        let seeds = source::seeds(&map.field, &map.starts)?;
        let before = map.to_correct();
        let map = self.go_on(map, &[], &seeds, stop, control)?;
        let changed = map.differing(before);
        self.correct(map, &seeds, &changed, control)
    }

    /// Solves, to first order, from the nodes that are unreached in `map` and around the `edited` ones, see [`News::Since`].
    fn go_on(
        &self,
        map: DistanceMap,
        edited: &[f32],
        seeds: &[Option<Box<Seeds>>],
        stop: &Stop,
        control: &Control,
    ) -> Result<DistanceMap> {
        let DistanceMap { field, factors, values: before, limits, .. } = &map;
        let mut values = before.clone();
        values.seed(seeds);
        let equation = Equation { field, factors, seeds, tolerance: self.tolerance };
        let news = News::Since { before, edited };
        match tiles::solve(&equation, values, limits.clone(), news, stop, control)? {
            Some(Solution { values, limits, statistics }) => {
                Ok(DistanceMap { values, limits, statistics, ..map })
            }
            None => self.solve_again(map, stop, control),
        }
    }

    /// Solves for the field and the starts of a map from the beginning.
    fn solve_again(&self, map: DistanceMap, stop: &Stop, control: &Control) -> Result<DistanceMap> {
        let again = self.solve_field(map.field, &map.starts, stop, control)?;
        Ok(DistanceMap { unit: map.unit, frame: map.frame, ..again })
    }
}

fn unsettled() -> Error {
    Error::usage("the distance does not settle on this metric; its tensors are too extreme")
}

/// Distance from the nearest start region at every node.
#[derive(Clone, Debug)]
pub struct DistanceMap {
    pub(crate) field: TensorField,
    factors: Factors,
    /// First order.
    values: Values,
    /// What is to be added to them, in high accuracy.
    correction: Option<Correction>,
    /// What is known of each tile, for going on.
    limits: Vec<Limits>,
    starts: Box<[StartRegion]>,
    statistics: Statistics,
    unit: &'static str,
    frame: Option<GridFrame>,
}

impl DistanceMap {
    /// Columns of the grid.
    #[must_use]
    pub fn cols(&self) -> usize {
        self.field.cols()
    }

    /// Rows of the grid.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.field.rows()
    }

    /// Unit of the values: `m` or `AG units`; empty for a bare tensor field.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        self.unit
    }

    /// How much work the solve took.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }

    /// Memory that the map takes per node: tensors, values and, in high accuracy, two rounds of corrections.
    #[must_use]
    pub fn bytes_per_node(&self) -> usize {
        let numbers = if self.correction.is_some() { 3 } else { 1 };
        size_of::<TensorTile>() / AREA + numbers * size_of::<f32>()
    }

    /// Distance at a node; infinite where not reached.
    #[must_use]
    pub fn at_node(&self, col: usize, row: usize) -> f64 {
        let value = self.value(col, row);
        if value < UNREACHED { f64::from(value) / self.field.root_scale() } else { f64::INFINITY }
    }

    /// Estimate of the error of the distance at a node; `None` where not reached and if the accuracy was not
    /// [`Accuracy::High`].
    #[must_use]
    pub fn error_at_node(&self, col: usize, row: usize) -> Option<f64> {
        let (tile, place) = self.field.tiling.place(col, row);
        let error = self.correction.as_ref()?.error_left(tile, place, self.value(col, row));
        self.is_reached(col, row).then_some(f64::from(error) / self.field.root_scale())
    }

    /// Distances at all nodes, row-major from the north-west, infinite where not reached.
    #[must_use]
    pub fn to_row_major(&self) -> Vec<f32> {
        let nodes = (0..self.rows()).flat_map(|row| (0..self.cols()).map(move |col| (col, row)));
        nodes.map(|(col, row)| self.at_node(col, row) as f32).collect()
    }

    /// Distance at grid coordinates; `None` outside the grid and where not reached.
    ///
    /// Near the start the length of the straight way; elsewhere cubic between the nodes where all around are
    /// reached, bilinear in a cell with four reached corners, and the solver's own update beside walls.
    #[must_use]
    pub fn at(&self, at: DVec2) -> Option<f64> {
        if !self.field.tiling.contains(at) {
            return None;
        }
        let value = match (self.straight(at), self.cubic(at)) {
            (Some((_, length)), Some(value)) => length.min(value),
            (None, Some(value)) => value,
            _ => self.stored_at(at)?,
        };
        Some(value / self.field.root_scale())
    }

    /// Gradient of the distance at grid coordinates, in ground axes (x east, y north), per metre; `None` where
    /// [`at`](Self::at) is. By differences over half a cell, one-sided beside walls and borders.
    #[must_use]
    pub fn gradient_at(&self, at: DVec2) -> Option<DVec2> {
        const REACH: f64 = 0.25;
        let here = self.at(at)?;
        let slope = |by: DVec2| {
            let (before, after) = (self.at(at - by), self.at(at + by));
            let pieces = u8::from(before.is_some()) + u8::from(after.is_some());
            let rise = after.unwrap_or(here) - before.unwrap_or(here);
            (pieces > 0).then(|| rise / (REACH * f64::from(pieces)))
        };
        let (col, row) = (slope(REACH * DVec2::X)?, slope(REACH * DVec2::Y)?);
        let spacing = self.frame.as_ref().map_or(DVec2::ONE, |frame| frame.spacing(at.y));
        Some(DVec2::new(col, -row) / spacing)
    }

    /// Unit vector of travel away from the start at grid coordinates, in ground axes (x east, y north), along
    /// `D ∇g`; `None` where [`gradient_at`](Self::gradient_at) is and on the start.
    #[must_use]
    pub fn direction_at(&self, at: DVec2) -> Option<DVec2> {
        let spacing = self.frame.as_ref().map_or(DVec2::ONE, |frame| frame.spacing(at.y));
        let gradient = self.gradient_at(at)? * spacing;
        let speed = self.field.metric_at(at)?.inverse();
        let step = speed.apply(DVec2::new(gradient.x, -gradient.y));
        (DVec2::new(step.x, -step.y) * spacing).try_normalize()
    }

    /// Unit vector of travel away from the start at a node, in ground axes (x east, y north); `None` where not
    /// reached and on the start.
    #[must_use]
    pub fn direction(&self, col: usize, row: usize) -> Option<DVec2> {
        let spacing = self.frame.as_ref().map_or(DVec2::ONE, |frame| frame.spacing(row as f64));
        let foot = self.foot(col as isize, row as isize)?;
        (DVec2::new(-foot.x, foot.y) * spacing).try_normalize()
    }

    /// The values, if they have a correction that must follow when they change.
    fn to_correct(&self) -> Option<Values> {
        self.correction.is_some().then(|| self.values.clone())
    }

    /// Which tiles have other values than before; none, if there is nothing to correct.
    fn differing(&self, before: Option<Values>) -> Vec<bool> {
        let Some(before) = before else { return vec![false; self.values.tiles.len()] };
        let pairs = before.tiles.par_iter().zip(&self.values.tiles);
        pairs.map(|(before, after)| before != after).collect()
    }

    /// Value at a node in the field's stored units, corrected.
    fn value(&self, col: usize, row: usize) -> f32 {
        let (tile, place) = self.field.tiling.place(col, row);
        let correction = self.correction.as_ref().map_or(0.0, |all| all.at(tile, place));
        self.values.tiles[tile][place] + correction
    }

    /// Values at all nodes in the field's stored units, corrected.
    fn corrected(&self) -> Values {
        let mut values = self.values.clone();
        let Some(correction) = &self.correction else { return values };
        for (tile, nodes) in values.tiles.iter_mut().enumerate() {
            for (place, value) in nodes.iter_mut().enumerate() {
                *value += correction.at(tile, place);
            }
        }
        values
    }

    pub(crate) fn stored(&self, col: usize, row: usize) -> f64 {
        f64::from(self.value(col, row))
    }

    pub(crate) fn is_reached(&self, col: usize, row: usize) -> bool {
        self.values.get(col, row) < UNREACHED
    }

    /// Stored value at a node, counted on around the grid where it is periodic; `None` outside and where not reached.
    pub(crate) fn reached(&self, col: isize, row: isize) -> Option<f64> {
        let (col, row) = self.field.tiling.node(col, row)?;
        self.is_reached(col, row).then(|| self.stored(col, row))
    }

    /// Step in grid coordinates from a node, as in [`reached`](Self::reached), to the point of its ring that its value came
    /// from.
    pub(crate) fn foot(&self, col: isize, row: isize) -> Option<DVec2> {
        let value = self.reached(col, row)?;
        let (col, row) = self.field.tiling.node(col, row)?;
        let node = DVec2::new(col as f64, row as f64);
        if let Some(foot) = self.straight_home(node, value) {
            return Some(foot - node);
        }
        self.best_foot(col, row).map(|(_, foot)| foot)
    }

    fn best_foot(&self, col: usize, row: usize) -> Option<(f64, DVec2)> {
        best_foot(&self.field, &self.factors, |c, r| self.value(c, r), col, row)
    }

    /// The point of the start region to go to straight from `at`, if that is the shortest way.
    pub(crate) fn straight_home(&self, at: DVec2, value: f64) -> Option<DVec2> {
        let (foot, length) = self.straight(at)?;
        (length <= SLACK * value).then_some(foot)
    }

    /// The nearest point of the start in sight and the length of the way to it.
    fn straight(&self, at: DVec2) -> Option<(DVec2, f64)> {
        source::foot_on_any(&self.starts, &self.field, at, SEED_SIGHT)
    }

    /// Cubic convolution (Keys 1981) of what is left without the cone, where all sixteen nodes are reached; not
    /// where it leaves what the corners of the cell span, at a kink.
    fn cubic(&self, at: DVec2) -> Option<f64> {
        let (col, row) = (at.x.floor(), at.y.floor());
        let nodes = || (0..16).map(|k| (k % 4, k / 4));
        let place =
            |i: usize, j: usize| (col as isize + i as isize - 1, row as isize + j as isize - 1);
        let mut w = [[0.0; 4]; 4];
        for (i, j) in nodes() {
            let (c, r) = place(i, j);
            w[j][i] = self.reached(c, r)?;
        }
        let cone = self.factors.around(&self.field, nodes().map(|(i, j)| place(i, j)));
        let g0 = |at: DVec2| cone.map_or(0.0, |cone| cone.value(at - cone.at));
        for (i, j) in nodes() {
            let (c, r) = place(i, j);
            w[j][i] -= g0(DVec2::new(c as f64, r as f64));
        }
        let (u, v) = (keys(at.x - col), keys(at.y - row));
        let value: f64 = nodes().map(|(i, j)| u[i] * v[j] * w[j][i]).sum();
        let corners = [w[1][1], w[1][2], w[2][1], w[2][2]];
        let (least, most) = corners
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &w| (a.min(w), b.max(w)));
        let margin = 0.25 * (most - least);
        ((least - margin..=most + margin).contains(&value)).then(|| (value + g0(at)).max(0.0))
    }

    /// The point of the start that the cone around `at` comes from, if nothing is in the way.
    pub(crate) fn centre_in_sight(&self, at: DVec2) -> Option<DVec2> {
        let cone = self.cone_around(at)?;
        sees(&self.field, at, cone.at).then_some(cone.at)
    }

    /// How much the cone around `at` lowers the value read at `to`, see [`stencil::factoring`].
    fn shift(&self, at: DVec2, to: DVec2) -> f64 {
        self.cone_around(at).map_or(0.0, |cone| cone.term(at - cone.at, to - at))
    }

    /// The cone at the node nearest to `at`.
    fn cone_around(&self, at: DVec2) -> Option<Factor> {
        self.factors.around(&self.field, [(at.x.round() as isize, at.y.round() as isize)])
    }

    pub(crate) fn stored_at(&self, at: DVec2) -> Option<f64> {
        if !self.field.tiling.contains(at) {
            return None;
        }
        let straight = self.straight(at).map(|(_, length)| length).into_iter();
        straight.chain(self.interpolated(at)).min_by(f64::total_cmp).map(|g| g.max(0.0))
    }

    /// Bilinear where all corners of the cell are reached, else by way of the best corner in sight.
    fn interpolated(&self, at: DVec2) -> Option<f64> {
        let (col, row) = (at.x.floor() as isize, at.y.floor() as isize);
        let weights = corner_weights(at - DVec2::new(col as f64, row as f64));
        let used = || {
            let corners = CORNERS.into_iter().zip(weights);
            corners.filter(|corner| corner.1 > 0.0).map(|((i, j), w)| (col + i, row + j, w))
        };
        let linear: Option<f64> = used().map(|(c, r, w)| self.reached(c, r).map(|g| w * g)).sum();
        if let Some(linear) = linear {
            // Only what is smooth is interpolated.
            let bent =
                self.factors.around(&self.field, used().map(|(c, r, _)| (c, r))).map(|cone| {
                    let g0 = |at: DVec2| cone.value(at - cone.at);
                    let nodes = used().map(|(c, r, w)| w * g0(DVec2::new(c as f64, r as f64)));
                    g0(at) - nodes.sum::<f64>()
                });
            return Some((linear + bent.unwrap_or(0.0)).max(0.0));
        }
        let metric = self.field.metric_at(at)?;
        used()
            .filter_map(|(c, r, _)| Some((DVec2::new(c as f64, r as f64), self.reached(c, r)?)))
            .filter(|&(node, _)| source::sees(&self.field, at, node))
            .map(|(node, value)| value + metric.norm(node - at))
            .min_by(f64::total_cmp)
    }
}

/// The values of nodes are rounded to `f32`.
const SLACK: f64 = 1.0 + 1e-6;

/// Weights of the four nodes around a point `t` beyond the second, exact for quadratics.
fn keys(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ]
}

/// Within this many cells of the start the straight way to it is considered.
const SEED_SIGHT: f64 = 4.0;

#[cfg(test)]
mod tests;
