//! The solver: which distances are asked for, how accurate, and where to stop.

use super::distance_map::DistanceMap;
use super::factors::Factors;
use super::schedule::memory::MemoryStore;
use super::schedule::rounds::Equation;
use super::schedule::solution::{self, Changes, Solution};
use super::schedule::stop::Stop;
use super::schedule::tile_store::TileStore;
use super::second_order::{Correction, FirstOrder};
use super::source::{self, Seeds};
use super::start::StartRegion;
use super::tensor_field::TensorField;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::memory;
use crate::metric::MetricField;

/// Solves the eikonal equation.
///
/// Work is shared with the threads of the current rayon pool, and several solves at once share a pool fairly: a small one does not
/// wait for the end of large ones. To that end a solve of more than some 15 ms that runs on a thread of the pool runs other
/// work of the pool now and then, as the operations of rayon do, and continues when that is done.
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

impl Accuracy {
    /// About the most that a solve takes for a node, tensors included: peaks at 3000², less what there was before.
    fn bytes_per_node(self, is_weighted: bool) -> usize {
        let weights = if is_weighted { 10 } else { 0 };
        match self {
            Self::Fast => 32 + weights,
            Self::High => 48 + weights,
        }
    }
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
    /// [`Error::Argument`] if no open node is at any start, or a number is out of range; [`Error::TooLarge`] if there is not memory enough;
    /// [`Error::NotConverged`] if the tensors are too extreme; [`Error::Cancelled`].
    pub fn solve(
        &self,
        metric: &MetricField<'_>,
        starts: &[StartRegion],
        stop: &Stop,
        control: &Control,
    ) -> Result<DistanceMap> {
        let size = [metric.surface().cols(), metric.surface().rows()];
        memory::check_cells(
            "a distance over",
            size,
            self.accuracy.bytes_per_node(metric.is_weighted()),
        )?;
        self.solve_field(TensorField::sample(metric, control)?, starts, stop, control)
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
        let store = |field: &_, seeds: &_| Ok(MemoryStore::seeded(field, seeds));
        self.solve_in(store, field, starts, stop, control)
    }

    /// [`solve_field`](Self::solve_field) with values in a store, which `store` makes of the field and its start values, and for a second time if the first
    /// solve does not converge.
    ///
    /// # Errors
    /// Those of [`solve`](Self::solve) and of the store.
    pub(super) fn solve_in<S: TileStore>(
        &self,
        store: impl Fn(&TensorField, &[Option<Box<Seeds>>]) -> Result<S>,
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
            solution::solve(&equation, store(&field, &seeds)?, Changes::All, stop, control)
        };
        let solution = match solve(&factors) {
            Err(Error::NotConverged { .. }) if !factors.is_empty() => {
                factors = Factors::default();
                solve(&factors)?
            }
            solution => solution?,
        };
        control.report("solving distance", 1.0);
        let Solution { values, statistics } = solution;
        let map = DistanceMap {
            field,
            factors,
            values,
            correction: None,
            starts: starts.into(),
            statistics,
        };
        self.correct(map, &seeds, &[], control)
    }

    /// Corrects first-order values to second order, if that is asked for; if they have a correction, only downstream of the tiles that `changed`.
    pub(super) fn correct(
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
        map.check()?;
        Ok(map)
    }

    /// Continues a map that a [`Stop`] ended, without solving again what is final. The result is that of a solve
    /// with the new `stop` from the beginning, within the tolerance; [`DistanceMap::statistics`] count what was added.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn resume(&self, map: DistanceMap, stop: &Stop, control: &Control) -> Result<DistanceMap> {
        stop.check()?;
        let seeds = source::seeds(&map.field, &map.starts)?;
        let before = map.values_if_corrected();
        let map = self.continue_from(map, &[], &seeds, stop, control)?;
        let changed = map.differing(before);
        self.correct(map, &seeds, &changed, control)
    }

    /// Continues, to first order, from the nodes that are unreached in `map` and around the `edited` ones, see [`Changes::Since`].
    pub(super) fn continue_from(
        &self,
        map: DistanceMap,
        edited: &[f32],
        seeds: &[Option<Box<Seeds>>],
        stop: &Stop,
        control: &Control,
    ) -> Result<DistanceMap> {
        let DistanceMap { field, factors, values: before, .. } = &map;
        let store = MemoryStore::continuing(before.clone())?;
        store.seed(seeds);
        let equation = Equation { field, factors, seeds, tolerance: self.tolerance };
        let changes = Changes::Since { before, edited };
        match solution::solve(&equation, store, changes, stop, control) {
            Ok(Solution { values, statistics }) => Ok(DistanceMap { values, statistics, ..map }),
            Err(Error::NotConverged { .. }) => self.solve_again(map, stop, control),
            Err(error) => Err(error),
        }
    }

    /// Solves for the field and the starts of a map from the beginning.
    pub(super) fn solve_again(
        &self,
        map: DistanceMap,
        stop: &Stop,
        control: &Control,
    ) -> Result<DistanceMap> {
        self.solve_field(map.field, &map.starts, stop, control)
    }
}
