//! Geodesic balls: the nodes within a distance of a node.
//!
//! A segmentation needs thousands of small ones. So the memory of a solve is made once, for the whole grid, and only what a ball
//! reaches is touched: a tile is *opened*, that is, given the values it has before the solve, when it or a neighbour is first
//! solved, and reset before the next ball. The equation is that of a solve of the whole field with the same stop, the factor around the
//! node included.

use std::iter::once;

use glam::DVec2;

use super::factors::Factors;
use super::schedule::active_set::Job;
use super::schedule::memory::MemoryStore;
use super::schedule::rounds::{End, Equation, Schedule};
use super::schedule::stop::{Stop, is_final};
use super::schedule::tile_store::at_start;
use super::solver::Solver;
use super::source::{self, Seeds};
use super::start::StartRegion;
use super::tensor_field::TensorField;
use super::tile::kernel::Rule;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::grid::tiling::SIDE;

/// Finds one ball after the other.
#[derive(Debug)]
pub(crate) struct Balls<'a> {
    field: &'a TensorField,
    /// As [`Solver::tolerance`].
    tolerance: f32,
    schedule: Schedule<MemoryStore>,
    /// Start values of the ball, and the tiles that have some.
    seeds: Vec<Option<Box<Seeds>>>,
    seeded: Vec<usize>,
    /// The tiles that were solved, and their neighbours.
    opened: Vec<usize>,
    is_open: Vec<bool>,
}

impl<'a> Balls<'a> {
    /// Takes at most 0.2 ms per million nodes, for 4 bytes of zeroed memory per node, which the system may have ready.
    pub(crate) fn new(field: &'a TensorField) -> Self {
        let tiles = field.tiling.tiles();
        Self {
            field,
            tolerance: Solver::default().tolerance,
            schedule: Schedule::new(MemoryStore::unset(field.tiling), tiles, 0.0),
            seeds: vec![None; tiles],
            seeded: Vec::new(),
            opened: Vec::new(),
            is_open: vec![false; tiles],
        }
    }

    /// The open nodes within `radius` (unit of the metric) of a node of the field, as places in the row-major grid, in ascending
    /// order, each with its distance: what [`Stop::Distance`] reports. None if the node is closed.
    ///
    /// # Errors
    /// As [`Solver::solve_field`].
    pub(crate) fn around(
        &mut self,
        [col, row]: [usize; 2],
        radius: f64,
        control: &Control,
    ) -> Result<impl Iterator<Item = (usize, f32)>> {
        let stop = Stop::Distance(radius);
        stop.check()?;
        self.clear();
        let largest = stop.largest(self.field);
        let mut least_change = 0.0;
        if self.field.is_open(col, row) {
            let start = [DVec2::new(col as f64, row as f64).into()];
            let factors = Factors::within(self.field, &start, largest.into());
            let end = match self.solve(&start, &factors, &stop, control) {
                Err(Error::NotConverged { .. }) if !factors.is_empty() => {
                    self.clear();
                    self.solve(&start, &Factors::default(), &stop, control)?
                }
                end => end?,
            };
            least_change = end.least_change;
        }
        Ok(self.nodes(largest, least_change))
    }

    fn solve(
        &mut self,
        start: &[StartRegion],
        factors: &Factors,
        stop: &Stop,
        control: &Control,
    ) -> Result<End> {
        let Self { field, tolerance, schedule, seeds, seeded, opened, is_open } = self;
        *seeded = source::add_seeds(field, start, seeds)?;
        let equation = Equation { field, factors, seeds, tolerance: *tolerance };
        for &tile in &*seeded {
            seeds[tile]
                .iter()
                .for_each(|seeds| schedule.activate_seeds(&field.tiling, tile, seeds));
        }
        let open = |jobs: &[u64], store: &MemoryStore| {
            let solved = jobs.iter().map(|&job| Job::from_bits(job).tile as usize);
            let neighbours = |tile| field.tiling.neighbours(tile).map(|(_, n)| n);
            for tile in solved.flat_map(|tile| once(tile).chain(neighbours(tile))) {
                if !is_open[tile] {
                    is_open[tile] = true;
                    opened.push(tile);
                    let values = at_start(field.tensors(tile), seeds[tile].as_deref());
                    store.values.fill(tile, &values);
                }
            }
        };
        schedule.run(&equation, Rule::Lower, stop, open, control)
    }

    /// Resets what the last ball touched.
    fn clear(&mut self) {
        self.schedule.clear(&self.opened);
        self.opened.iter().for_each(|&tile| self.schedule.store.forget_limits(tile));
        self.seeded.drain(..).for_each(|tile| self.seeds[tile] = None);
        self.opened.drain(..).for_each(|tile| self.is_open[tile] = false);
    }

    /// The nodes with final values up to `largest`, while no value below `least_change` changes any more.
    fn nodes(&mut self, largest: f32, least_change: f32) -> impl Iterator<Item = (usize, f32)> {
        self.opened.sort_unstable();
        let Self { field, schedule, opened, .. } = &*self;
        let (tiling, scale) = (&field.tiling, field.root_scale());
        let store = &schedule.store;
        let of_line = move |tile: usize, line: usize| {
            let (row, col) = (tile / tiling.across * SIDE + line, tile % tiling.across * SIDE);
            let limits = store.known_limits(tile);
            let values = (0..SIDE).map(move |i| store.values.at(tile, line * SIDE + i));
            (row * tiling.cols + col..).zip(values).filter(move |&(_, value)| {
                value <= largest && is_final(value, &limits, least_change)
            })
        };
        let is_solved = |&&tile: &&usize| schedule.is_solved(tile);
        let bands = opened.chunk_by(|a, b| a / tiling.across == b / tiling.across);
        let stored = bands.flat_map(move |band| {
            (0..SIDE).flat_map(move |line| {
                band.iter().filter(is_solved).flat_map(move |&tile| of_line(tile, line))
            })
        });
        stored.map(move |(place, value)| (place, (f64::from(value) / scale) as f32))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;
    use crate::grid::tiling::AREA;
    use crate::linalg::Sym2;

    fn field(
        cols: usize,
        rows: usize,
        periodic: [bool; 2],
        tensor: impl Fn(usize, usize) -> Option<Sym2> + Sync,
    ) -> TensorField {
        let field = TensorField::from_fn(cols, rows, tensor, &Control::default()).unwrap();
        field.periodic(periodic).unwrap()
    }

    /// Speeds that vary smoothly.
    fn wave(cols: usize, rows: usize) -> TensorField {
        field(cols, rows, [false; 2], |col, row| {
            let speed = 1.0 + 0.5 * (0.05 * (col + 2 * row) as f64).sin();
            Some(Sym2::new(speed, 0.0, 2.0 - speed))
        })
    }

    /// Ratios up to 30 in all directions, and walls.
    fn rough(cols: usize, rows: usize, periodic: [bool; 2]) -> TensorField {
        field(cols, rows, periodic, |col, row| {
            let along = DVec2::from_angle(0.1 * (col + row) as f64);
            let ratio = 1.0 + (col % 30) as f64;
            let tensor = Sym2::outer(along) * ratio + Sym2::outer(along.perp());
            ((col / 9 + row / 7) % 5 > 0 || col % 9 > 6).then_some(tensor)
        })
    }

    /// Seeds all over the grid, open or not.
    fn seeds(field: &TensorField) -> impl Iterator<Item = [usize; 2]> {
        let (cols, rows) = (field.cols(), field.rows());
        (0..25).map(move |i| [(i * 97) % cols, (i * 151) % rows])
    }

    fn ball(balls: &mut Balls<'_>, seed: [usize; 2], radius: f64) -> Vec<(usize, f32)> {
        balls.around(seed, radius, &Control::default()).unwrap().collect()
    }

    /// A ball holds the nodes within its radius, with the distances of a solve of the whole field. Both without a tolerance, so that
    /// the order of the sweeps does not matter.
    fn assert_whole(field: &TensorField, seed: [usize; 2], radius: f64) {
        let found = ball(&mut Balls { tolerance: 0.0, ..Balls::new(field) }, seed, radius);
        assert!(found.is_sorted_by(|a, b| a.0 < b.0));
        if !field.is_open(seed[0], seed[1]) {
            return assert!(found.is_empty());
        }
        let start = DVec2::new(seed[0] as f64, seed[1] as f64).into();
        let (solver, control) =
            (Solver { tolerance: 0.0, ..Solver::default() }, Control::default());
        let map = solver.solve_field(field.clone(), &[start], &Stop::Never, &control).unwrap();
        let mut values = vec![f64::INFINITY; field.cols() * field.rows()];
        found.into_iter().for_each(|(place, value)| values[place] = value.into());
        for (place, (value, whole)) in values.into_iter().zip(map.to_row_major()).enumerate() {
            let whole = f64::from(whole);
            let same = value <= radius && (value - whole).abs() <= 1e-5 * whole;
            let beyond = value == f64::INFINITY && whole > (1.0 - 1e-5) * radius;
            assert!(
                same || beyond || value == whole,
                "{seed:?}, {radius}, {place}: {value} {whole}"
            );
        }
    }

    #[test]
    fn a_ball_is_what_a_solve_of_the_whole_field_finds() {
        for periodic in [[false, false], [true, false], [true, true]] {
            for (cols, rows) in [(150, 130), (70, 45), (33, 20)] {
                let field = rough(cols, rows, periodic);
                for seed in seeds(&field) {
                    for radius in [0.0, 0.5, 3.0, 12.0, 60.0, f64::INFINITY] {
                        assert_whole(&field, seed, radius);
                    }
                }
            }
        }
        let field = wave(200, 180);
        for seed in seeds(&field) {
            [5.0, 20.0, 80.0].into_iter().for_each(|radius| assert_whole(&field, seed, radius));
        }
    }

    #[test]
    fn no_ball_leaves_anything_to_the_next() {
        for field in [rough(150, 130, [true, false]), wave(150, 130)] {
            let mut balls = Balls::new(&field);
            for (seed, radius) in
                seeds(&field).zip([3.0, 40.0, 12.0, 0.0, f64::INFINITY, 8.0].into_iter().cycle())
            {
                assert_eq!(
                    ball(&mut balls, seed, radius),
                    ball(&mut Balls::new(&field), seed, radius)
                );
            }
        }
    }

    #[test]
    fn only_tiles_that_a_ball_reaches_and_their_neighbours_are_touched() {
        let field = wave(400, 400);
        // Nodes that are solved and that are read, for each one held.
        for (radius, most) in [(5.0, [13.0, 55.0]), (20.0, [2.8, 7.0]), (80.0, [1.4, 2.0])] {
            let mut balls = Balls::new(&field);
            let (mut held, mut solved, mut opened) = (0, 0, 0);
            for seed in seeds(&field) {
                let nodes = ball(&mut balls, seed, radius);
                let tile = |(place, _)| field.tiling.locate(place % 400, place / 400).0;
                held += nodes.len();
                let reached: BTreeSet<usize> = nodes.into_iter().map(tile).collect();
                let is_beside = |tile, tiles: &BTreeSet<usize>| {
                    tiles.contains(&tile)
                        || field.tiling.neighbours(tile).any(|(_, n)| tiles.contains(&n))
                };
                let tiles: BTreeSet<usize> = balls.opened.iter().copied().collect();
                let found = tiles.iter().copied().filter(|&tile| balls.schedule.is_solved(tile));
                let found: BTreeSet<usize> = found.collect();
                assert!(found.iter().all(|&tile| is_beside(tile, &reached)));
                assert!(tiles.iter().all(|&tile| is_beside(tile, &found)));
                (solved, opened) = (solved + found.len(), opened + tiles.len());
            }
            let share = [solved, opened].map(|tiles| (tiles * AREA) as f64 / held as f64);
            assert!(share[0] < most[0] && share[1] < most[1], "{radius}: {share:?}");
        }
    }

    #[test]
    fn closed_nodes_have_no_ball_and_bad_radii_are_refused() {
        let field = rough(40, 30, [false; 2]);
        let mut balls = Balls::new(&field);
        assert!(!field.is_open(0, 0) && field.is_open(7, 0));
        assert!(ball(&mut balls, [0, 0], 1e9).is_empty());
        for radius in [f64::NAN, -1.0, f64::NEG_INFINITY] {
            for seed in [[0, 0], [7, 0]] {
                assert!(balls.around(seed, radius, &Control::default()).is_err());
            }
        }
        assert_eq!(ball(&mut balls, [7, 0], 0.0), [(7, 0.0)]);
    }

    #[test]
    fn after_cancelling_the_next_ball_is_as_any() {
        let field = wave(100, 90);
        let mut balls = Balls::new(&field);
        let control = Control::default();
        control.cancel.cancel();
        assert!(matches!(
            balls.around([50, 40], 20.0, &control),
            Err(crate::error::Error::Cancelled)
        ));
        assert_eq!(ball(&mut balls, [50, 47], 9.0), ball(&mut Balls::new(&field), [50, 47], 9.0));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn on_any_field_a_ball_is_what_a_solve_of_the_whole_field_finds(
            tensors in proptest::collection::vec(
                proptest::option::weighted(0.8, (0.0..100f64.ln(), 0.0..3.0, -2.0..2f64)), 60 * 50,
            ),
            (col, row) in (0..60usize, 0..50usize),
            radius in 0.0..30f64,
            periodic in any::<[bool; 2]>(),
        ) {
            let field = field(60, 50, periodic, |col, row| {
                tensors[row * 60 + col].map(|(ratio, angle, speed)| {
                    let along = DVec2::from_angle(angle);
                    (Sym2::outer(along) * ratio.exp() + Sym2::outer(along.perp())) * speed.exp()
                })
            });
            assert_whole(&field, [col, row], radius);
        }
    }
}
