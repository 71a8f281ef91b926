//! Distances at the nodes: the result of a solve.

use glam::DVec2;
use rayon::prelude::*;

use super::factors::Factors;
use super::predecessor;
use super::schedule::memory::MemoryStore;
use super::schedule::rounds::Statistics;
use super::schedule::values::Values;
use super::second_order::Correction;
use super::start::StartRegion;
use super::stencil::UNREACHED;
use super::tensor_field::TensorField;
use crate::error::Result;
use crate::grid::tiling::{AREA, SIDE};
use crate::metric::Unit;

/// Distance from the nearest start region at every node.
///
/// Clones share the values. They are read from the store that the solve left them in, which for all solvers of this crate is memory; what a store of
/// another kind cannot read counts as not reached until [`check`](Self::check) reports it.
#[derive(Clone, Debug)]
pub struct DistanceMap {
    pub(crate) field: TensorField,
    pub(super) factors: Factors,
    /// First-order values, and what is known of each tile, for continuing the solve.
    pub(super) values: Values,
    /// What is to be added to them; `None` unless in high accuracy.
    pub(super) correction: Option<Correction>,
    pub(super) starts: Box<[StartRegion]>,
    pub(super) statistics: Statistics,
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

    /// Unit of the values; unknown for a bare tensor field.
    #[must_use]
    pub fn unit(&self) -> Unit {
        self.field.unit()
    }

    /// How much work the solve took.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }

    /// Whether all values that were asked for so far, of this map or of a clone, could be read. Routes and all else that returns a [`Result`] ask themselves;
    /// ask after readers that return plain numbers, as [`at_node`](Self::at_node), [`to_row_major`](Self::to_row_major) or
    /// [`allocation`](Self::allocation).
    ///
    /// # Errors
    /// The first failure. None as long as values are in memory.
    pub fn check(&self) -> Result<()> {
        self.values.check()
    }

    /// How many nodes of a solve in high accuracy were left at first order, because the metric or the costs turn or jump within a cell there.
    #[must_use]
    pub fn rough_nodes(&self) -> u32 {
        self.correction.as_ref().map_or(0, Correction::rough_nodes)
    }

    /// Memory that the map takes per node: tensors, values and, in high accuracy, two rounds of corrections.
    #[must_use]
    pub fn bytes_per_node(&self) -> usize {
        let numbers = if self.correction.is_some() { 3 } else { 1 };
        self.field.bytes_per_node() + numbers * size_of::<f32>()
    }

    /// Distance at a node; infinite where not reached.
    #[must_use]
    pub fn at_node(&self, col: usize, row: usize) -> f64 {
        self.distance(self.value(col, row))
    }

    /// A stored value in the unit of the map; infinite where not reached.
    fn distance(&self, value: f32) -> f64 {
        if value < UNREACHED { f64::from(value) / self.field.root_scale() } else { f64::INFINITY }
    }

    /// Estimate of the error of the distance at a node; `None` where not reached and if the accuracy was not
    /// [`Accuracy::High`](super::Accuracy::High).
    #[must_use]
    pub fn error_at_node(&self, col: usize, row: usize) -> Option<f64> {
        let (tile, place) = self.field.tiling.locate(col, row);
        let error = self.correction.as_ref()?.error_left(tile, place, self.value(col, row));
        self.is_reached(col, row).then_some(f64::from(error) / self.field.root_scale())
    }

    /// Distances at all nodes, row-major from the north-west, infinite where not reached.
    #[must_use]
    pub fn to_row_major(&self) -> Vec<f32> {
        let mut distances = vec![0.0; self.cols() * self.rows()];
        let lines = distances.chunks_exact_mut(self.cols().max(1));
        lines.enumerate().for_each(|(row, line)| self.row(row, line));
        distances
    }

    /// Fills a line with the distances of a row, from the west, infinite where not reached; in less time than
    /// [`at_node`](Self::at_node) takes for one after the other.
    pub fn row(&self, row: usize, line: &mut [f32]) {
        let cols = self.cols().min(line.len());
        for (i, line) in line[..cols].chunks_mut(SIDE).enumerate() {
            let (tile, first) = self.field.tiling.locate(i * SIDE, row);
            let values = self.values.tile(tile);
            for (place, distance) in (first..).zip(line) {
                let value = values[place] + self.correction_at(tile, place);
                *distance = self.distance(value) as f32;
            }
        }
    }

    /// Gradient of the distance at grid coordinates, in ground axes (x east, y north), per metre; `None` where
    /// [`at`](Self::at) is. By differences over half a cell, one-sided next to walls and borders.
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
        let spacing = self.field.spacing(at.y);
        Some(DVec2::new(col, -row) / spacing)
    }

    /// Unit vector of travel away from the start at grid coordinates, in ground axes (x east, y north), along
    /// `D ∇g`; `None` where [`gradient_at`](Self::gradient_at) is and on the start.
    #[must_use]
    pub fn direction_at(&self, at: DVec2) -> Option<DVec2> {
        let spacing = self.field.spacing(at.y);
        let gradient = self.gradient_at(at)? * spacing;
        let speed = self.field.metric_at(at)?.inverse();
        let step = speed.apply(DVec2::new(gradient.x, -gradient.y));
        (DVec2::new(step.x, -step.y) * spacing).try_normalize()
    }

    /// Unit vector of travel away from the start at a node, in ground axes (x east, y north); `None` where not
    /// reached and on the start.
    #[must_use]
    pub fn direction(&self, col: usize, row: usize) -> Option<DVec2> {
        let spacing = self.field.spacing(row as f64);
        let foot = self.foot(col as isize, row as isize)?;
        (DVec2::new(-foot.x, foot.y) * spacing).try_normalize()
    }

    /// Step in grid coordinates from a node, given as in [`reached`](Self::reached), to the point that its value came from: of a start
    /// region, or of its ring.
    pub(crate) fn foot(&self, col: isize, row: isize) -> Option<DVec2> {
        let value = self.reached(col, row)?;
        let (col, row) = self.field.tiling.node(col, row)?;
        let node = DVec2::new(col as f64, row as f64);
        if let Some(foot) = self.straight_foot(node, value) {
            return Some(foot - node);
        }
        self.best_foot(col, row).map(|(_, foot)| foot)
    }

    /// Least value of a node over its ring, and the step to the point of the ring at which it is attained.
    pub(super) fn best_foot(&self, col: usize, row: usize) -> Option<(f64, DVec2)> {
        predecessor::best_foot(&self.field, &self.factors, |c, r| self.value(c, r), col, row)
    }

    /// The first-order values, if they have a correction, which must be updated where they change.
    pub(super) fn values_if_corrected(&self) -> Option<Values> {
        self.correction.is_some().then(|| self.values.clone())
    }

    /// Which tiles have other values than `before`; none, if there was no correction.
    pub(super) fn differing(&self, before: Option<Values>) -> Vec<bool> {
        let tiles = self.field.tiling.tiles();
        let Some(before) = before else { return vec![false; tiles] };
        let differs = |tile| before.tile(tile) != self.values.tile(tile);
        (0..tiles).into_par_iter().map(differs).collect()
    }

    /// Value at a node in the field's stored units, corrected.
    pub(super) fn value(&self, col: usize, row: usize) -> f32 {
        let (tile, place) = self.field.tiling.locate(col, row);
        self.values.at(tile, place) + self.correction_at(tile, place)
    }

    fn correction_at(&self, tile: usize, place: usize) -> f32 {
        self.correction.as_ref().map_or(0.0, |all| all.at(tile, place))
    }

    /// Values of a tile in the field's stored units, corrected.
    fn corrected_tile(&self, tile: usize) -> [f32; AREA] {
        let mut values = self.values.copy_tile(tile);
        if let Some(correction) = &self.correction {
            for (place, value) in values.iter_mut().enumerate() {
                *value += correction.at(tile, place);
            }
        }
        values
    }

    /// A copy of the values at all nodes in the field's stored units, corrected.
    pub(super) fn corrected(&self) -> MemoryStore {
        MemoryStore::filled(self.field.tiling, |tile| self.corrected_tile(tile))
    }

    pub(crate) fn stored(&self, col: usize, row: usize) -> f64 {
        f64::from(self.value(col, row))
    }

    pub(crate) fn is_reached(&self, col: usize, row: usize) -> bool {
        let (tile, place) = self.field.tiling.locate(col, row);
        self.values.at(tile, place) < UNREACHED
    }

    /// Stored value at a node, modulo the size of the grid where it is periodic; `None` outside and where not reached.
    pub(crate) fn reached(&self, col: isize, row: isize) -> Option<f64> {
        let (col, row) = self.field.tiling.node(col, row)?;
        let (tile, place) = self.field.tiling.locate(col, row);
        let value = self.values.at(tile, place);
        (value < UNREACHED).then(|| (value + self.correction_at(tile, place)).into())
    }
}
