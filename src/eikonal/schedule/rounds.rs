//! Rounds: sets of tiles solved at the same time, until nothing changes.

use std::sync::OnceLock;

use serde::Serialize;

use super::active_set::{ActiveSet, ITSELF, Job};
use super::stop::{Progress, Stop};
use super::tile_store::TileStore;
use super::worker_pool;
use crate::control::Control;
use crate::eikonal::factors::Factors;
use crate::eikonal::source::Seeds;
use crate::eikonal::tensor_field::TensorField;
use crate::eikonal::tile::kernel::{self, Problem, Rule, Workspace};
use crate::eikonal::tile::{Limits, Tile};
use crate::error::{Error, Location, Result};
use crate::grid::tiling::{AREA, NEIGHBOURS, SIDE, Tiling, opposite};

/// Activations of a tile after which a solve is given up, without and with factors. Tiles of fields that converge took at
/// most 34 at ratio 400, 86 at 2500, 19 on rough isotropic ones.
const MOST_ACTIVATIONS: [u32; 2] = [5000, 500];

/// Width of the window of keys that one round may take, in mean cells. Wider gives more tiles to a round but solves
/// some too early. At 1001² 8, 10, 16, 24 take 30, 28, 28, 31 ms on a plane, 36, 39, 46, 54 at random speeds (one thread) and
/// 37, 36, 34, 33 at ratio 400 on two, before rounds took at least a share of the tiles that wait ([`ActiveSet::horizon`]).
pub(crate) const WINDOW_CELLS: f32 = 10.0;

/// How much work a solve took: the same on every machine and for every number of threads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Statistics {
    /// Tiles of the grid that were ever solved.
    pub tiles: usize,
    /// Times a tile was solved.
    pub activations: usize,
    /// Sweeps over a tile, whole or in part, all together.
    pub sweeps: usize,
    /// Sets of tiles solved at the same time.
    pub rounds: usize,
}

/// The equation on the whole grid, with its start values, and the tolerance as a share of a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Equation<'a> {
    pub(crate) field: &'a TensorField,
    pub(crate) factors: &'a Factors,
    pub(crate) seeds: &'a [Option<Box<Seeds>>],
    pub(crate) tolerance: f32,
}

impl Equation<'_> {
    /// The equation on one tile.
    fn on(&self, tile: usize) -> Tile<'_> {
        let &Self { field, factors, seeds, tolerance } = self;
        let factor = factors.of_tile(tile).map(|factor| (factor, field.tiling.first(tile)));
        Tile { prices: field.prices(tile), factor, tolerance, seeds: seeds[tile].as_deref() }
    }
}

/// A solve under way: values in a store, the tiles that wait, and how often each was solved.
#[derive(Debug)]
pub(crate) struct Schedule<S> {
    pub(crate) store: S,
    pub(super) active: ActiveSet,
    activations: Vec<u32>,
    /// How many nodes had a value before.
    pub(super) reached: usize,
    /// The greatest margin of any tile.
    margin: f32,
}

/// How a solve ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct End {
    /// The least change that a tile has not taken into account: no value below that changes any more. Infinite when all is solved.
    pub(crate) least_change: f32,
    pub(crate) statistics: Statistics,
}

impl<S: TileStore> Schedule<S> {
    /// A solve in a store of so many tiles, none of which waits yet. `margin` is the greatest that is known of any.
    pub(crate) fn new(store: S, tiles: usize, margin: f32) -> Self {
        let active = ActiveSet::new(tiles);
        Self { store, active, activations: vec![0; tiles], reached: 0, margin }
    }

    /// Activates a tile that holds start values, and the neighbours that some of them are next to.
    pub(crate) fn activate_seeds(&mut self, tiling: &Tiling, tile: usize, seeds: &Seeds) {
        let least = seeds.iter().copied().fold(f32::INFINITY, f32::min);
        self.active.activate(tile, least, ITSELF);
        for (direction, n) in tiling.neighbours(tile) {
            let least = least_next_to(seeds, tiling.size(tile), NEIGHBOURS[direction]);
            if least < f32::INFINITY {
                self.active.activate(n, least, opposite(direction));
            }
        }
    }

    /// Activates all tiles that hold start values or are next to some.
    pub(crate) fn activate_start(&mut self, tiling: &Tiling, seeds: &[Option<Box<Seeds>>]) {
        for (tile, seeds) in seeds.iter().enumerate() {
            seeds.iter().for_each(|seeds| self.activate_seeds(tiling, tile, seeds));
        }
    }

    /// Whether the tile was solved.
    pub(crate) fn is_solved(&self, tile: usize) -> bool {
        self.activations[tile] > 0
    }

    /// Forgets a solve of which all tiles that were solved, and their neighbours, are given. What is stored stays.
    pub(crate) fn clear(&mut self, tiles: &[usize]) {
        self.active.clear(tiles);
        tiles.iter().for_each(|&tile| self.activations[tile] = 0);
        (self.reached, self.margin) = (0, 0.0);
    }

    /// Solves the tiles that wait and those that their changes activate, in rounds, until `stop` is met. Before
    /// a round `open` is called with its jobs.
    ///
    /// # Errors
    /// [`Error::NotConverged`]; those of the store; cancelled.
    pub(crate) fn run(
        &mut self,
        equation: &Equation<'_>,
        rule: Rule,
        stop: &Stop,
        mut open: impl FnMut(&[u64], &S),
        control: &Control,
    ) -> Result<End> {
        let Self { store, active, activations, reached, margin } = self;
        let store = &*store;
        let mut leader = Leader {
            equation,
            store,
            active,
            activations,
            reached: *reached,
            margin,
            end: End { least_change: f32::INFINITY, statistics: Statistics::default() },
        };
        let failure = OnceLock::new();
        let work = |workspace: &mut Workspace, job: u64| {
            let outcome = solve_tile(workspace, equation, rule, store, Job::from_bits(job));
            let outcome = outcome.unwrap_or_else(|error| {
                failure.get_or_init(|| error);
                Outcome::NOTHING
            });
            outcome.to_bits()
        };
        let lead = |jobs: &mut Vec<u64>, outcomes: &[[u32; 11]]| -> Result<()> {
            for (job, &outcome) in jobs.drain(..).zip(outcomes) {
                leader
                    .account_for(Job::from_bits(job).tile as usize, &Outcome::from_bits(outcome))?;
            }
            control.check()?;
            if failure.get().is_none() && leader.next_round(stop, control, jobs)? {
                open(jobs, store);
            }
            Ok(())
        };
        worker_pool::run(equation.field.tiling.tiles(), lead, work)?;
        let end = leader.end;
        failure.into_inner().map_or(Ok(end), Err)
    }
}

/// The least of the start values in a tile of the given size that are next to the neighbour at `(dx, dy)`.
fn least_next_to(seeds: &Seeds, [cols, rows]: [usize; 2], (dx, dy): (isize, isize)) -> f32 {
    let line = |along: isize, count: usize| match along {
        0 => 0..count,
        1 => count - 1..count,
        _ => 0..1,
    };
    let (cols, rows) = (line(dx, cols), line(dy, rows));
    let places = rows.flat_map(|row| cols.clone().map(move |col| row * SIDE + col));
    places.map(|place| seeds[place]).fold(f32::INFINITY, f32::min)
}

/// What happens between the rounds, on one thread.
struct Leader<'a, S> {
    equation: &'a Equation<'a>,
    store: &'a S,
    active: &'a mut ActiveSet,
    activations: &'a mut [u32],
    reached: usize,
    margin: &'a mut f32,
    end: End,
}

impl<S: TileStore> Leader<'_, S> {
    /// Takes the outcome of a tile into account: activates the neighbours that it can improve.
    fn account_for(&mut self, tile: usize, outcome: &Outcome) -> Result<()> {
        let &Equation { field, factors, .. } = self.equation;
        let activations = &mut self.activations[tile];
        *activations += 1;
        if *activations >= MOST_ACTIVATIONS[usize::from(!factors.is_empty())] {
            return Err(not_converged(&field.tiling, tile, *activations));
        }
        let statistics = &mut self.end.statistics;
        statistics.activations += 1;
        statistics.tiles += usize::from(*activations == 1);
        statistics.sweeps += outcome.sweeps as usize;
        *self.margin = self.margin.max(outcome.margin);
        if outcome.unconverged < f32::INFINITY {
            self.active.activate(tile, outcome.unconverged, ITSELF);
        }
        for (direction, n) in field.tiling.neighbours(tile) {
            if outcome.changes[direction] < f32::INFINITY {
                self.active.activate(n, outcome.changes[direction], opposite(direction));
            }
        }
        Ok(())
    }

    /// Chooses the jobs of the next round, if there is to be one.
    fn next_round(&mut self, stop: &Stop, control: &Control, jobs: &mut Vec<u64>) -> Result<bool> {
        let field = self.equation.field;
        let End { least_change, statistics } = &mut self.end;
        if statistics.rounds.is_multiple_of(64) {
            let share = statistics.tiles as f64 / field.tiling.tiles() as f64;
            control.report("solving distance", share);
        }
        *least_change = self.active.least_key();
        let progress = Progress {
            field,
            store: self.store,
            reached: self.reached + statistics.tiles * AREA,
            margin: *self.margin,
            least_change: *least_change,
        };
        if self.active.is_empty() || progress.meets(stop)? {
            return Ok(false);
        }
        statistics.rounds += 1;
        let window = WINDOW_CELLS * field.mean_step;
        let limit = self.active.horizon(window).min(progress.last_change(stop));
        self.active.take(&field.tiling, limit, statistics.rounds as u32, jobs);
        Ok(true)
    }
}

fn not_converged(tiling: &Tiling, tile: usize, activations: u32) -> Error {
    let at = tiling.first(tile);
    let at = Location::Node { col: at.x as usize, row: at.y as usize };
    Error::NotConverged { activations: activations as usize, at: Some(at) }
}

/// What solving a tile brought.
#[derive(Clone, Copy, Debug)]
struct Outcome {
    /// For each neighbour the least changed value that could improve it; infinite if none.
    changes: [f32; 8],
    /// The least value of the tile if it has not converged yet; infinite if it has.
    unconverged: f32,
    /// See [`Limits::margin`].
    margin: f32,
    sweeps: u32,
}

impl Outcome {
    const NOTHING: Self =
        Self { changes: [f32::INFINITY; 8], unconverged: f32::INFINITY, margin: 0.0, sweeps: 0 };

    fn to_bits(self) -> [u32; 11] {
        let [e, se, s, sw, w, nw, n, ne] = self.changes.map(f32::to_bits);
        [e, se, s, sw, w, nw, n, ne, self.unconverged.to_bits(), self.margin.to_bits(), self.sweeps]
    }

    fn from_bits([changes @ .., unconverged, margin, sweeps]: [u32; 11]) -> Self {
        Self {
            changes: changes.map(f32::from_bits),
            unconverged: f32::from_bits(unconverged),
            margin: f32::from_bits(margin),
            sweeps,
        }
    }
}

/// Solves the tile of a job: from the store to the store.
fn solve_tile<S: TileStore>(
    workspace: &mut Workspace,
    equation: &Equation<'_>,
    rule: Rule,
    store: &S,
    Job { tile, changed, first }: Job,
) -> Result<Outcome> {
    let tile = tile as usize;
    let tiling = &equation.field.tiling;
    store.read(tile, workspace.values())?;
    let mut margins = [0.0; 8];
    for (direction, n) in tiling.neighbours(tile) {
        margins[direction] = store.limits(n)?.margin;
    }
    let problem = Problem {
        tile: equation.on(tile),
        rule,
        size: tiling.size(tile),
        changed,
        first,
        margins,
        is_own_neighbour: tiling.is_own_neighbour(),
    };
    let solved = kernel::solve(workspace, &problem);
    let Limits { margin, .. } = solved.limits;
    store.raise_limits(tile, &solved.limits)?;
    if solved.is_changed {
        store.write(tile, workspace.values())?;
    }
    let kernel::Solved { changes, unconverged, sweeps, .. } = solved;
    Ok(Outcome { changes, unconverged, margin, sweeps })
}
