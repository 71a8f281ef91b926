//! The stop criterion: when a solve may end before all is reached.

use glam::DVec2;

use super::tile_store::TileStore;
use crate::eikonal::stencil::UNREACHED;
use crate::eikonal::tensor_field::TensorField;
use crate::eikonal::tile::Limits;
use crate::error::{Error, Result};
use crate::grid::tiling::{AREA, PADDED, SIDE};

/// When to stop. With any of them, the distances that a map reports are final: the same, within the tolerance, as without stopping. All other
/// nodes are unreached.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Stop {
    /// Once all nodes that can be reached are final.
    #[default]
    Never,
    /// Once the distances around all of these points (grid coordinates) are final. If one cannot be reached, as `Never`.
    AllGoals(Vec<DVec2>),
    /// Once the distance around any of these points is final.
    AnyGoal(Vec<DVec2>),
    /// Once all nodes up to this distance, in the unit of the metric, are final. Nodes farther away are unreached.
    Distance(f64),
    /// Once at least so many nodes are final.
    Nodes(usize),
}

impl Stop {
    /// # Errors
    /// A distance that is no number or negative.
    pub(crate) fn check(&self) -> Result<()> {
        match *self {
            Self::Distance(d) if d.is_nan() || d < 0.0 => {
                Err(Error::argument("the distance to stop at", d, "0 or more"))
            }
            _ => Ok(()),
        }
    }

    /// The largest value to be reported, in stored units.
    pub(crate) fn largest(&self, field: &TensorField) -> f32 {
        match self {
            Self::Distance(d) => (d * field.root_scale()).min(UNREACHED.into()) as f32,
            _ => UNREACHED,
        }
    }
}

/// How far a solve has come.
#[derive(Debug)]
pub(crate) struct Progress<'a, S> {
    pub(crate) field: &'a TensorField,
    pub(crate) store: &'a S,
    /// At most so many nodes have a value.
    pub(crate) reached: usize,
    /// The greatest margin of any tile.
    pub(crate) margin: f32,
    /// As in [`End::least_change`](super::rounds::End::least_change).
    pub(crate) least_change: f32,
}

impl<S: TileStore> Progress<'_, S> {
    /// Whether the solve may end.
    pub(crate) fn meets(&self, stop: &Stop) -> Result<bool> {
        match stop {
            Stop::Never => Ok(false),
            Stop::AllGoals(goals) => self.meets_all(goals),
            Stop::AnyGoal(goals) => self.meets_any(goals),
            Stop::Distance(_) => Ok(self.least_change > self.last_change(stop)),
            Stop::Nodes(count) => Ok(self.reached >= *count && self.final_nodes()? >= *count),
        }
    }

    /// The greatest change that can affect a value to be reported: a node that is not reached by then is farther away, and the value of one that is
    /// reached can only be improved by a value below it plus the margin.
    pub(crate) fn last_change(&self, stop: &Stop) -> f32 {
        if !matches!(stop, Stop::Distance(_)) {
            return UNREACHED;
        }
        stop.largest(self.field) + self.margin
    }

    fn meets_all(&self, goals: &[DVec2]) -> Result<bool> {
        for &goal in goals {
            if self.is_converged(goal)? == Some(false) {
                return Ok(false);
            }
        }
        Ok(!goals.is_empty())
    }

    fn meets_any(&self, goals: &[DVec2]) -> Result<bool> {
        for &goal in goals {
            if self.is_converged(goal)? == Some(true) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn final_nodes(&self) -> Result<usize> {
        let mut count = 0;
        for tile in 0..self.field.tiling.tiles() {
            let limits = self.store.limits(tile)?;
            for place in 0..AREA {
                let value = self.store.value(tile, place)?;
                count += usize::from(is_final(value, &limits, self.least_change));
            }
        }
        Ok(count)
    }

    /// Whether the open corners of the goal's cell, and what their values come from, are final; `None` if there are none.
    ///
    /// Final must mean here what it means in [`mask`], or a goal that counts as met loses its value, or the nodes that lead to it. With
    /// `m` the greatest margin of any tile and `L` the least change left, [`mask`] keeps every value below `L − m`. The ring of a corner
    /// of value `g` improves it only through values below `g + m`, and a descent reads nodes up to a step farther than it is. So
    /// `g + max(step, m) + m < L` keeps the corner and all that it needs.
    fn is_converged(&self, goal: DVec2) -> Result<Option<bool>> {
        let field = self.field;
        let (west, east) = (goal.x.floor() as isize, goal.x.ceil() as isize);
        let (north, south) = (goal.y.floor() as isize, goal.y.ceil() as isize);
        let corners = [(west, north), (east, north), (west, south), (east, south)];
        let node = |(c, r)| field.tiling.node(c, r).filter(|&(c, r)| field.is_open(c, r));
        let mut all = None;
        for (col, row) in corners.into_iter().filter_map(node) {
            let (tile, place) = field.tiling.locate(col, row);
            let step = self.store.limits(tile)?.longest_step;
            let last = self.store.value(tile, place)? + step.max(self.margin) + self.margin;
            all = Some(all.unwrap_or(true) && last < self.least_change);
        }
        Ok(all)
    }
}

/// Whether no change of `least_change` or above can change a node: a neighbour improves it only if its value is below that of
/// the node plus the margin.
pub(crate) fn is_final(value: f32, limits: &Limits, least_change: f32) -> bool {
    value < UNREACHED && value + limits.margin < least_change
}

/// Makes unreached all nodes whose values are not final given the changes left, or not to be reported.
pub(crate) fn mask(
    store: &impl TileStore,
    field: &TensorField,
    least_change: f32,
    stop: &Stop,
) -> Result<()> {
    let largest = stop.largest(field);
    let mut block = [[UNREACHED; PADDED]; PADDED];
    for tile in 0..field.tiling.tiles() {
        let limits = store.limits(tile)?;
        let is_kept = |value| value <= largest && is_final(value, &limits, least_change);
        store.read(tile, &mut block)?;
        let nodes = block[1..=SIDE].iter_mut().flat_map(|line| &mut line[1..=SIDE]);
        let mut is_changed = false;
        for value in nodes.filter(|value| **value < UNREACHED && !is_kept(**value)) {
            (*value, is_changed) = (UNREACHED, true);
        }
        if is_changed {
            store.write(tile, &block)?;
        }
    }
    Ok(())
}
