//! The interface between schedule and store, tested with a second, deliberately small store: each tile is a file in a temporary folder. That a
//! solve gives the same bits as one in memory shows that nothing but the store knows where values are kept.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;

use tempfile::TempDir;

use super::*;
use crate::eikonal::factors::Factors;
use crate::eikonal::schedule::rounds::{Equation, Schedule};
use crate::eikonal::schedule::tile_store::TileStore;
use crate::eikonal::schedule::values::at_start;
use crate::eikonal::source::{self, Seeds};
use crate::eikonal::tile::kernel::Rule;
use crate::eikonal::tile::{BLOCK, Block, Limits};
use crate::error::Result;
use crate::grid::tiling::{AREA, SIDE, Tiling};

/// A file for each tile: the numbers of its nodes, then [`Limits::margin`] and [`Limits::longest_step`].
struct FileStore {
    tiling: Tiling,
    folder: TempDir,
    files: Vec<File>,
}

impl FileStore {
    fn new(field: &TensorField, seeds: &[Option<Box<Seeds>>]) -> Self {
        let folder = TempDir::new().unwrap();
        let create = |tile: usize| {
            let path = folder.path().join(tile.to_string());
            File::options().read(true).write(true).create_new(true).open(path).unwrap()
        };
        let tiling = field.tiling;
        let files = (0..tiling.tiles()).map(create).collect();
        let store = Self { tiling, folder, files };
        for (tile, seeds) in seeds.iter().enumerate() {
            store.put(tile, 0, &at_start(field.tensors(tile), seeds.as_deref())).unwrap();
            store.set_limits(tile, &Limits::default()).unwrap();
        }
        store
    }

    fn path(&self, tile: usize) -> PathBuf {
        self.folder.path().join(tile.to_string())
    }

    fn get<const N: usize>(&self, tile: usize, place: usize) -> Result<[f32; N]> {
        let mut numbers = [0.0; N];
        let bytes = bytemuck::cast_slice_mut(&mut numbers);
        let read = self.files[tile].read_exact_at(bytes, (place * size_of::<f32>()) as u64);
        read.map_err(|error| Error::io(self.path(tile), error))?;
        Ok(numbers)
    }

    fn put(&self, tile: usize, place: usize, numbers: &[f32]) -> Result<()> {
        let bytes = bytemuck::cast_slice(numbers);
        let written = self.files[tile].write_all_at(bytes, (place * size_of::<f32>()) as u64);
        written.map_err(|error| Error::io(self.path(tile), error))
    }
}

impl TileStore for FileStore {
    fn read(&self, tile: usize, block: &mut Block) -> Result<()> {
        let nodes = block.as_flattened_mut().iter_mut();
        for (node, place) in nodes.zip(self.tiling.places_around(tile)) {
            *node = match place {
                Some((tile, place)) => self.value(tile, place)?,
                None => f32::INFINITY,
            };
        }
        Ok(())
    }

    fn write(&self, tile: usize, block: &Block) -> Result<()> {
        let [cols, rows] = self.tiling.size(tile);
        for (row, line) in block[1..BLOCK - 1].iter().take(rows).enumerate() {
            self.put(tile, row * SIDE, &line[1..=cols])?;
        }
        Ok(())
    }

    fn value(&self, tile: usize, place: usize) -> Result<f32> {
        let [value] = self.get(tile, place)?;
        Ok(value)
    }

    fn limits(&self, tile: usize) -> Result<Limits> {
        let [margin, longest_step] = self.get(tile, AREA)?;
        Ok(Limits { margin, longest_step })
    }

    fn set_limits(&self, tile: usize, &Limits { margin, longest_step }: &Limits) -> Result<()> {
        self.put(tile, AREA, &[margin, longest_step])
    }
}

/// Solves in files. With `damage` the file of a tile is cut short before.
fn solve_in_files(
    field: &TensorField,
    starts: &[StartRegion],
    stop: &Stop,
    damage: Option<usize>,
) -> Result<(FileStore, Statistics)> {
    let seeds = source::seeds(field, starts)?;
    let factors = Factors::new(field, starts);
    let tolerance = Solver::default().tolerance;
    let equation = Equation { field, factors: &factors, seeds: &seeds, tolerance };
    let store = FileStore::new(field, &seeds);
    if let Some(tile) = damage {
        store.files[tile].set_len(100).unwrap();
    }
    let mut schedule = Schedule::new(store, field.tiling.tiles(), 0.0);
    schedule.activate_start(&field.tiling, &seeds);
    let end = schedule.run(&equation, Rule::Lower, stop, |_, _| (), &Control::default())?;
    Ok((schedule.store, end.statistics))
}

/// An ordinary field, periodic ones, and one with walls, none of a whole number of tiles.
fn fields() -> Vec<TensorField> {
    let wave = |c: usize, r: usize| Some(rotated(9.0, TAU * (c as f64 / 70.0 + r as f64 / 45.0)));
    let periodic = |directions| field(70, 45, wave).periodic(directions).unwrap();
    vec![
        field(70, 45, wave),
        periodic([true, false]),
        periodic([false, true]),
        periodic([true, true]),
        rough(60, 50),
    ]
}

#[test]
fn a_solve_in_files_has_the_bits_of_one_in_memory() {
    let starts = [DVec2::new(8.3, 9.6), DVec2::new(41.0, 24.0)].map(StartRegion::from);
    for field in fields() {
        let map = Solver::default()
            .solve_field(field.clone(), &starts, &Stop::Never, &Control::default())
            .unwrap();
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let solve = || solve_in_files(&field, &starts, &Stop::Never, None);
            let (store, statistics) = pool.install(solve).unwrap();
            assert_eq!(statistics, map.statistics());
            for tile in 0..field.tiling.tiles() {
                let values: [f32; AREA] = store.get(tile, 0).unwrap();
                assert_eq!(&values, map.values.tile(tile));
            }
        }
    }
}

#[test]
fn a_solve_in_files_stops_where_one_in_memory_does() {
    let start = [StartRegion::from(DVec2::new(8.3, 9.6))];
    for stop in [
        Stop::AllGoals(vec![DVec2::new(20.5, 13.0)]),
        Stop::AnyGoal(vec![DVec2::new(20.5, 13.0), DVec2::new(50.0, 40.0)]),
        Stop::Distance(9.0),
        Stop::Nodes(300),
    ] {
        for field in fields() {
            let map = Solver::default()
                .solve_field(field.clone(), &start, &stop, &Control::default())
                .unwrap();
            let (_, statistics) = solve_in_files(&field, &start, &stop, None).unwrap();
            assert_eq!(statistics, map.statistics(), "{stop:?}");
        }
    }
}

#[test]
fn a_store_that_fails_ends_the_solve_with_its_error() {
    let start = [StartRegion::from(DVec2::new(8.3, 9.6))];
    for field in fields() {
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let solve = || solve_in_files(&field, &start, &Stop::Never, Some(7));
            match pool.install(solve) {
                Err(Error::Io { path, .. }) => assert!(path.ends_with("7"), "{}", path.display()),
                other => panic!("{:?}", other.map(|(_, statistics)| statistics)),
            }
        }
    }
}
