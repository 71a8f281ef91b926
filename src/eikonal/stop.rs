//! When a solve may end before all is reached.

use glam::DVec2;

use super::board::{Board, LimitsBoard};
use super::field::{AREA, TensorField};
use super::stencil::UNREACHED;
use super::tile::Limits;
use super::tiles::Values;
use crate::error::{Error, Result};

/// When to stop. Whatever the rule, what a map reports is final: the same as without it, but for the tolerance. All else is
/// unreached.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Stop {
    /// Once all that can be reached is.
    #[default]
    Never,
    /// Once the distances around all of these points (grid coordinates) are final. One that cannot be reached makes it `Never`.
    AllGoals(Vec<DVec2>),
    /// Once the distance around any of these points is.
    AnyGoal(Vec<DVec2>),
    /// Once all nodes up to this distance, in the unit of the metric, are final. Nodes farther away are unreached.
    Distance(f64),
    /// Once at least so many nodes are final.
    Nodes(usize),
}

impl Stop {
    /// # Errors
    /// A distance that is no number or negative.
    pub(super) fn check(&self) -> Result<()> {
        match *self {
            Self::Distance(d) if d.is_nan() || d < 0.0 => {
                Err(Error::usage(format!("the distance to stop at is {d}; it must be 0 or more")))
            }
            _ => Ok(()),
        }
    }

    /// The largest value to be reported, in stored units.
    pub(super) fn largest(&self, field: &TensorField) -> f32 {
        match self {
            Self::Distance(d) => (d * field.root_scale()).min(UNREACHED.into()) as f32,
            _ => UNREACHED,
        }
    }
}

/// How far a solve has come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Standing<'a> {
    pub(super) field: &'a TensorField,
    pub(super) board: &'a Board,
    pub(super) limits: &'a LimitsBoard,
    /// At most so many nodes have a value.
    pub(super) reached: usize,
    /// The greatest slack of any tile.
    pub(super) slack: f32,
    /// Nothing below this value is news to any node; infinite when all is done.
    pub(super) news: f32,
}

impl Standing<'_> {
    /// Whether the solve may end.
    pub(super) fn allows(&self, stop: &Stop) -> bool {
        match stop {
            Stop::Never => false,
            Stop::AllGoals(goals) => {
                !goals.is_empty() && goals.iter().all(|&goal| self.is_settled(goal) != Some(false))
            }
            Stop::AnyGoal(goals) => goals.iter().any(|&goal| self.is_settled(goal) == Some(true)),
            Stop::Distance(_) => self.news > self.last_news(stop),
            Stop::Nodes(count) => self.reached >= *count && self.final_nodes() >= *count,
        }
    }

    /// The greatest news that can bear on a value to be reported: a node not reached by then is farther, one reached
    /// may still come down by its slack.
    pub(super) fn last_news(&self, stop: &Stop) -> f32 {
        if !matches!(stop, Stop::Distance(_)) {
            return UNREACHED;
        }
        stop.largest(self.field) + self.slack
    }

    fn final_nodes(&self) -> usize {
        let count = |(tile, limits): (usize, Limits)| {
            let values = (0..AREA).map(|place| self.board.at(tile, place));
            values.filter(|&value| is_final(value, &limits, self.news)).count()
        };
        self.limits.iter().enumerate().map(count).sum()
    }

    /// Whether the open corners of the goal's cell, and what their values come from, are final; `None` if there are none.
    fn is_settled(&self, goal: DVec2) -> Option<bool> {
        let field = self.field;
        let (west, east) = (goal.x.floor() as isize, goal.x.ceil() as isize);
        let (north, south) = (goal.y.floor() as isize, goal.y.ceil() as isize);
        let corners = [(west, north), (east, north), (west, south), (east, south)];
        let node = |(c, r)| field.tiling.node(c, r).filter(|&(c, r)| field.is_open(c, r));
        let settled = |(c, r): (usize, usize)| {
            let (tile, place) = field.tiling.place(c, r);
            self.board.at(tile, place) + self.limits.at(tile).longest_step < self.news
        };
        let settled = corners.into_iter().filter_map(node).map(settled);
        settled.fold(None, |all, corner| Some(all.unwrap_or(true) && corner))
    }
}

/// Whether no news of this value and above will change a node: a neighbour improves it only if its value is below the
/// node's and the slack.
pub(super) fn is_final(value: f32, limits: &Limits, news: f32) -> bool {
    value < UNREACHED && value + limits.slack < news
}

/// Forgets all values that are not final while there is news, or are not to be reported.
pub(super) fn mask(
    values: &mut Values,
    field: &TensorField,
    limits: &[Limits],
    news: f32,
    stop: &Stop,
) {
    let largest = stop.largest(field);
    for (tile, limits) in values.tiles.iter_mut().zip(limits) {
        for value in tile.iter_mut().filter(|value| **value < UNREACHED) {
            if *value > largest || !is_final(*value, limits, news) {
                *value = UNREACHED;
            }
        }
    }
}
