//! Solving again after an edit of the field, only where the edit changes something.
//!
//! A node's value is still true if it is *supported*: if the update from its ring gives no more. So the values of the nodes that
//! were edited are forgotten, then all that are no longer supported, in the order in which changes travel, until none is left
//! ([`Rule::Forget`](super::tile::kernel::Rule)). Nodes cannot support each other in a circle: the least value that is not true is lower, by the
//! length of a step, than the update from its ring. What is left is true or too high, so that the ordinary solve, continued from
//! the nodes that were forgotten, ends where one from the beginning would.

use rayon::prelude::*;

use super::distance_map::DistanceMap;
use super::factors::Factors;
use super::schedule::memory::MemoryStore;
use super::schedule::rounds::{Equation, Statistics};
use super::schedule::solution::{self, Changes, Solution};
use super::schedule::stop::Stop;
use super::schedule::values::{Values, count_reached};
use super::solver::Solver;
use super::source::{self, Seeds};
use super::stencil::UNREACHED;
use super::tensor_field::TensorField;
use crate::control::Control;
use crate::error::Result;
use crate::grid::tiling::{AREA, SIDE};
use crate::linalg::Sym2;
use crate::metric::MetricField;

impl Solver {
    /// The distances from the starts of `map` under another metric, of which only what the difference can have moved is solved again.
    /// The outcome is that of a solve from the beginning, within the tolerance; [`DistanceMap::statistics`] count what was done.
    ///
    /// Costs the sampling of the metric and a comparison of all tensors; [`update_nodes`](Self::update_nodes) costs
    /// neither. Everything is solved again if the metric around a start changed so that its factor is different, or if the change
    /// reaches a start on which a shorter path from another start arrives.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn update(
        &self,
        map: DistanceMap,
        metric: &MetricField<'_>,
        stop: &Stop,
        control: &Control,
    ) -> Result<DistanceMap> {
        self.update_field(map, TensorField::sample(metric, control)?, stop, control)
    }

    /// [`update`](Self::update) for tensors of any origin, in index coordinates.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn update_field(
        &self,
        map: DistanceMap,
        field: TensorField,
        stop: &Stop,
        control: &Control,
    ) -> Result<DistanceMap> {
        if field.tiling != map.field.tiling || field.root_scale() != map.field.root_scale() {
            return self.solve_again(DistanceMap { field, ..map }, stop, control);
        }
        let exchange = |old: &mut TensorField| {
            let changed = differences(old, &field);
            *old = field;
            Ok(changed)
        };
        self.solve_after(exchange, map, stop, control)
    }

    /// [`update`](Self::update) for single nodes: (column, row, tensor in index coordinates), `None` to close the node. Costs
    /// what is solved again, and some ns per node of the grid.
    ///
    /// # Errors
    /// As [`solve`](Self::solve); [`Error::Argument`](crate::Error::Argument) if a node is not on the grid.
    pub fn update_nodes(
        &self,
        map: DistanceMap,
        nodes: &[(usize, usize, Option<Sym2>)],
        stop: &Stop,
        control: &Control,
    ) -> Result<DistanceMap> {
        let set = |field: &mut TensorField| {
            for &(col, row, tensor) in nodes {
                field.set(col, row, tensor)?;
            }
            // Where steps are priced by cells, those from the nodes around have changed, too.
            let reach = isize::from(field.has_cells());
            let around = |&(col, row, _): &(usize, usize, _)| {
                let offsets =
                    (-reach..=reach).flat_map(move |j| (-reach..=reach).map(move |i| (i, j)));
                offsets.map(move |(i, j)| (col as isize + i, row as isize + j))
            };
            let nodes = nodes.iter().flat_map(around);
            let nodes = nodes.filter_map(|(col, row)| field.tiling.node(col, row));
            let mut places: Vec<_> = nodes.map(|(c, r)| field.tiling.locate(c, r)).collect();
            places.sort_unstable();
            places.dedup();
            Ok(places)
        };
        self.solve_after(set, map, stop, control)
    }

    /// The distances after an edit of the field, which returns the tile and the place in it of the nodes it changed.
    fn solve_after(
        &self,
        edit: impl FnOnce(&mut TensorField) -> Result<Vec<(usize, usize)>>,
        mut map: DistanceMap,
        stop: &Stop,
        control: &Control,
    ) -> Result<DistanceMap> {
        stop.check()?;
        let before = source::seeds(&map.field, &map.starts)?;
        let mut changed = edit(&mut map.field)?;
        let seeds = source::seeds(&map.field, &map.starts)?;
        changed.extend(moved_seeds(&before, &seeds));
        if Factors::new(&map.field, &map.starts) != map.factors {
            return self.solve_again(map, stop, control);
        }
        let contested = contested(&map.values, &before);
        let uncorrected = map.values_if_corrected();
        let mut lost = masked(&map.values);
        map.check()?;
        let store = MemoryStore::continuing(map.values)?;
        forget(&map.field, &store, &changed, &mut lost);
        let equation = Equation {
            field: &map.field,
            factors: &map.factors,
            seeds: &seeds,
            tolerance: self.tolerance,
        };
        // This converges: a tile is activated only after a node in it or next to it was forgotten, and no node is forgotten twice.
        let changes = Changes::Lost(&lost);
        let left = solution::solve(&equation, store, changes, &Stop::Never, control)?;
        let Solution { values, statistics: forgetting } = left;
        let map = DistanceMap { values, ..map };
        let is_touched = |&(tile, reached): &(usize, usize)| {
            lost[tile] < f32::INFINITY || count_reached(&map.values.tile(tile)) != reached
        };
        if contested.iter().any(is_touched) {
            return self.solve_again(map, stop, control);
        }
        let map = self.continue_from(map, &lost, &seeds, stop, control)?;
        let mut differing = map.differing(uncorrected);
        changed.iter().for_each(|&(tile, _)| differing[tile] = true);
        let map = self.correct(map, &seeds, &differing, control)?;
        let statistics = Statistics {
            activations: forgetting.activations + map.statistics.activations,
            sweeps: forgetting.sweeps + map.statistics.sweeps,
            rounds: forgetting.rounds + map.statistics.rounds,
            ..map.statistics
        };
        Ok(DistanceMap { statistics, ..map })
    }
}

/// Tile and place in it of the nodes that are closed, or from which a step costs, otherwise than before.
fn differences(old: &TensorField, new: &TensorField) -> Vec<(usize, usize)> {
    let differ = |tile: usize| {
        let same = old.prices(tile).are_like(&new.prices(tile));
        let places = if same { 0..0 } else { 0..AREA };
        let differs = move |&place: &usize| {
            let (col, row) = old.tiling.node_at(tile, place);
            let [cols, rows] = old.tiling.size(tile);
            let is_inside = place % SIDE < cols && place / SIDE < rows;
            is_inside
                && (old.is_open(col, row) != new.is_open(col, row)
                    || old.steps(col, row) != new.steps(col, row))
        };
        places.filter(differs).map(move |place| (tile, place))
    };
    (0..old.tiling.tiles()).into_par_iter().with_min_len(64).flat_map_iter(differ).collect()
}

/// Tile and place in it of the nodes whose start value changed, came or went.
fn moved_seeds<'a>(
    old: &'a [Option<Box<Seeds>>],
    new: &'a [Option<Box<Seeds>>],
) -> impl Iterator<Item = (usize, usize)> + 'a {
    let at = |seeds: &Option<Box<Seeds>>, place: usize| {
        seeds.as_ref().map_or(f32::INFINITY, |seeds| seeds[place])
    };
    let differing = old.iter().zip(new).enumerate().filter(|(_, (old, new))| old != new);
    differing.flat_map(move |(tile, (old, new))| {
        (0..AREA).filter(move |&i| at(old, i) != at(new, i)).map(move |place| (tile, place))
    })
}

/// The tiles in and next to which a node of a start has a shorter path from another start, with how many nodes of each have a value.
///
/// The value of such a node jumps down from its start value, see [`ceiling`](super::tile::coefficients::ceiling). Where the metric is obtuse it may then support the very
/// nodes that lowered it, so that forgetting what it came from would not be noticed.
fn contested(values: &Values, seeds: &[Option<Box<Seeds>>]) -> Vec<(usize, usize)> {
    let is_contested = |&tile: &usize| {
        let Some(seeds) = &seeds[tile] else { return false };
        let values = values.tile(tile);
        seeds.iter().zip(&*values).any(|(&seed, &value)| seed < UNREACHED && value < seed)
    };
    let tiles = (0..seeds.len()).filter(is_contested).flat_map(|tile| around(values, tile));
    tiles.map(|tile| (tile, count_reached(&values.tile(tile)))).collect()
}

/// A tile and its neighbours.
fn around(values: &Values, tile: usize) -> impl Iterator<Item = usize> + '_ {
    std::iter::once(tile).chain(values.tiling().neighbours(tile).map(|(_, n)| n))
}

/// Forgets the values of these nodes, and lowers what is `lost` in each tile to the least of them.
fn forget(field: &TensorField, store: &MemoryStore, nodes: &[(usize, usize)], lost: &mut [f32]) {
    for &(tile, place) in nodes {
        lost[tile] = lost[tile].min(store.values.at(tile, place).min(UNREACHED));
        let open = field.tensors(tile).det[place] > 0.0;
        store.values.set(tile, place, if open { UNREACHED } else { f32::INFINITY });
    }
}

/// [`UNREACHED`] for each tile where a stopped solve masked a value from which another may have come (where the metric is obtuse, one end of
/// the segment may be farther away than the node itself); infinite for the others.
fn masked(values: &Values) -> Vec<f32> {
    let is_front = |tile: usize| {
        values.tile(tile).contains(&UNREACHED)
            && around(values, tile).any(|tile| count_reached(&values.tile(tile)) > 0)
    };
    let key = |tile| if is_front(tile) { UNREACHED } else { f32::INFINITY };
    (0..values.tiling().tiles()).into_par_iter().map(key).collect()
}
