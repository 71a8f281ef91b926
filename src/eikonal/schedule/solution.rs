//! A solve, from the values that are given to those of the solution.

use super::active_set::{ActiveSet, ITSELF};
use super::rounds::{End, Equation, Schedule, Statistics};
use super::stop::{self, Stop};
use super::tile_store::TileStore;
use super::values::Values;
use crate::control::Control;
use crate::eikonal::stencil::UNREACHED;
use crate::eikonal::tile::kernel::Rule;
use crate::error::Result;
use crate::grid::tiling::{PADDED, SIDE, Tiling, opposite};

/// Which of the values given to a solve are changes.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Changes<'a> {
    /// All of them: they are those of the start.
    All,
    /// Those at and next to the nodes that are unreached in `before`, and around the `edited` nodes (as for each tile in [`Changes::Lost`]); the
    /// others are final, or will be lowered by these.
    Since { before: &'a Values, edited: &'a [f32] },
    /// Nodes were edited and lost their values: for each tile the least of these, infinite if none. Values that came from
    /// them are to be forgotten as well, see [`Rule::Forget`].
    Lost(&'a [f32]),
}

/// The result of a solve.
#[derive(Debug)]
pub(crate) struct Solution {
    /// The values, with what is known of each tile, for going on later.
    pub(crate) values: Values,
    pub(crate) statistics: Statistics,
}

/// Relaxes the values in `store` to the solution of the discrete equation, starting from those that are `changes`, until `stop` is
/// met. What is not final then is unreached. What the store knows of the tiles is of the solution that the values are from.
///
/// # Errors
/// [`Error::NotConverged`](crate::error::Error::NotConverged); those of the store; cancelled.
pub(crate) fn solve<S: TileStore>(
    equation: &Equation<'_>,
    store: S,
    changes: Changes<'_>,
    stop: &Stop,
    control: &Control,
) -> Result<Solution> {
    let tiling = &equation.field.tiling;
    let margin = greatest_margin(&store, tiling)?;
    let mut schedule = Schedule::new(store, tiling.tiles(), margin);
    match changes {
        Changes::All => schedule.activate_start(tiling, equation.seeds),
        Changes::Since { before, edited } => {
            schedule.reached = before.reached();
            let Schedule { store, active, .. } = &mut schedule;
            activate_front(tiling, before, store, edited, active)?;
        }
        Changes::Lost(keys) => activate_around(tiling, keys, &mut schedule.active),
    }
    let rule = if matches!(changes, Changes::Lost(_)) { Rule::Forget } else { Rule::Lower };
    let End { least_change, statistics } =
        schedule.run(equation, rule, stop, |_, _| (), control)?;
    let store = schedule.store;
    if *stop != Stop::Never {
        stop::mask(&store, equation.field, least_change, stop)?;
    }
    Ok(Solution { values: Values::new(*tiling, store), statistics })
}

fn greatest_margin(store: &impl TileStore, tiling: &Tiling) -> Result<f32> {
    (0..tiling.tiles()).try_fold(0f32, |most, tile| Ok(most.max(store.limits(tile)?.margin)))
}

/// Activates every tile whose key is finite, and its neighbours.
fn activate_around(tiling: &Tiling, keys: &[f32], active: &mut ActiveSet) {
    for (tile, &key) in keys.iter().enumerate().filter(|&(_, &key)| key < f32::INFINITY) {
        active.activate(tile, key, ITSELF);
        for (direction, n) in tiling.neighbours(tile) {
            active.activate(n, key, opposite(direction));
        }
    }
}

/// Activates every tile with a node that was unreached before, and now has a value or a neighbour with one. Also the tiles around the
/// `edited` nodes: opening a node may allow a diagonal step between two others, which need not have changed themselves.
fn activate_front(
    tiling: &Tiling,
    before: &Values,
    store: &impl TileStore,
    edited: &[f32],
    active: &mut ActiveSet,
) -> Result<()> {
    let is_edited = |tile: usize| edited.get(tile).is_some_and(|&key| key < f32::INFINITY);
    let mut block = [[f32::INFINITY; PADDED]; PADDED];
    for tile in 0..tiling.tiles() {
        let before = before.tile(tile);
        let all = is_edited(tile) || tiling.neighbours(tile).any(|(_, n)| is_edited(n));
        if !all && !before.contains(&UNREACHED) {
            continue;
        }
        store.read(tile, &mut block)?;
        let mut key = UNREACHED;
        for (rows, before) in block.windows(3).zip(before.chunks_exact(SIDE)) {
            let across: [f32; PADDED] =
                std::array::from_fn(|i| rows[0][i].min(rows[1][i]).min(rows[2][i]));
            for (three, &before) in across.windows(3).zip(before) {
                let least = three[0].min(three[1]).min(three[2]);
                key = key.min(if all || before == UNREACHED { least } else { UNREACHED });
            }
        }
        if key < UNREACHED {
            active.activate(tile, key, ITSELF);
        }
    }
    before.check()
}
