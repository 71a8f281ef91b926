//! The interface between store, schedule and readers, tested with a second, deliberately small store: each tile is a file in a temporary folder. That a
//! solve, and all that is read from its map, has the same bits as in memory shows that nothing but the store knows where values are kept.

use std::borrow::Cow;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tempfile::TempDir;

use super::*;
use crate::eikonal::schedule::tile_store::{TileReader, TileStore, at_start};
use crate::eikonal::source::Seeds;
use crate::eikonal::tile::Limits;
use crate::error::Result;
use crate::grid::tiling::{AREA, PADDED, PaddedTile, SIDE, Tiling};
use crate::grid::{GridFrame, Ground, isolines, levels_by_step};
use crate::metric::{Isotropic, Metric, Modifiers};
use crate::route::trace;
use crate::surface::{FitOptions, HeightSurface};
use crate::terrain::{Crs, Terrain};

/// A file for each tile: the numbers of its nodes, then [`Limits::margin`] and [`Limits::longest_step`].
#[derive(Debug)]
struct FileStore {
    tiling: Tiling,
    folder: PathBuf,
    files: Vec<File>,
}

impl FileStore {
    fn new(folder: &Path, field: &TensorField, seeds: &[Option<Box<Seeds>>]) -> Result<Self> {
        let create = |tile: usize| {
            let path = folder.join(tile.to_string());
            let file =
                File::options().read(true).write(true).create(true).truncate(true).open(&path);
            file.map_err(|error| Error::io(path, error))
        };
        let tiling = field.tiling;
        let files = (0..tiling.tiles()).map(create).collect::<Result<_>>()?;
        let store = Self { tiling, folder: folder.to_owned(), files };
        for (tile, seeds) in seeds.iter().enumerate() {
            store.put(tile, 0, &at_start(field.tensors(tile), seeds.as_deref()))?;
            store.set_limits(tile, &Limits::default())?;
        }
        Ok(store)
    }

    fn path(&self, tile: usize) -> PathBuf {
        self.folder.join(tile.to_string())
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
    fn read(&self, tile: usize, block: &mut PaddedTile) -> Result<()> {
        let nodes = block.as_flattened_mut().iter_mut();
        for (node, place) in nodes.zip(self.tiling.places_around(tile)) {
            *node = match place {
                Some((tile, place)) => self.value(tile, place)?,
                None => f32::INFINITY,
            };
        }
        Ok(())
    }

    fn write(&self, tile: usize, block: &PaddedTile) -> Result<()> {
        let [cols, rows] = self.tiling.size(tile);
        for (row, line) in block[1..PADDED - 1].iter().take(rows).enumerate() {
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

    fn into_reader(self) -> Arc<dyn TileReader> {
        Arc::new(self)
    }
}

impl TileReader for FileStore {
    fn tile(&self, tile: usize) -> Result<Cow<'_, [f32]>> {
        Ok(Cow::Owned(self.get::<AREA>(tile, 0)?.to_vec()))
    }

    fn limits(&self, tile: usize) -> Result<Limits> {
        TileStore::limits(self, tile)
    }
}

/// Solves with values in files in the folder.
fn solve_in_files(
    solver: &Solver,
    folder: &TempDir,
    field: &TensorField,
    starts: &[StartRegion],
    stop: &Stop,
) -> Result<DistanceMap> {
    let store = |field: &_, seeds: &_| FileStore::new(folder.path(), field, seeds);
    solver.solve_in(store, field.clone(), starts, stop, &Control::default())
}

fn solve_in_memory(
    solver: &Solver,
    field: &TensorField,
    starts: &[StartRegion],
    stop: &Stop,
) -> DistanceMap {
    solver.solve_field(field.clone(), starts, stop, &Control::default()).unwrap()
}

fn starts() -> [StartRegion; 2] {
    [DVec2::new(8.3, 9.6), DVec2::new(41.0, 24.0)].map(StartRegion::from)
}

fn solver(accuracy: Accuracy) -> Solver {
    Solver { accuracy, ..Solver::default() }
}

/// Cuts the file of a tile short.
fn damage(folder: &TempDir, tile: usize) {
    let file = File::options().write(true).open(folder.path().join(tile.to_string())).unwrap();
    file.set_len(100).unwrap();
}

fn assert_names_tile_7<T: std::fmt::Debug>(result: Result<T>) {
    match result {
        Err(Error::Io { path, .. }) => assert!(path.ends_with("7"), "{}", path.display()),
        other => panic!("{other:?}"),
    }
}

/// The bits of what a map says at its nodes and between them.
fn readings(map: &DistanceMap) -> Vec<[Option<u64>; 6]> {
    let read = |node: usize, distance: f32, label: Option<u32>| {
        let (col, row) = (node % map.cols(), node / map.cols());
        let at = DVec2::new(col as f64 + 0.3, row as f64 + 0.6);
        let (gradient, direction) = (map.gradient_at(at), map.direction(col, row));
        let numbers = [
            Some(distance.into()),
            map.error_at_node(col, row),
            label.map(f64::from),
            map.at(at),
            gradient.map(|gradient| gradient.x),
            direction.map(|direction| direction.y),
        ];
        numbers.map(|number| number.map(f64::to_bits))
    };
    let nodes = map.to_row_major().into_iter().zip(map.allocation()).enumerate();
    nodes.map(|(node, (distance, label))| read(node, distance, label)).collect()
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
    for accuracy in [Accuracy::Fast, Accuracy::High] {
        let (starts, solver, folder) = (starts(), solver(accuracy), TempDir::new().unwrap());
        for field in fields() {
            let memory = solve_in_memory(&solver, &field, &starts, &Stop::Never);
            for threads in [1, 2] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let solve = || solve_in_files(&solver, &folder, &field, &starts, &Stop::Never);
                let files = pool.install(solve).unwrap();
                assert_eq!(files.statistics(), memory.statistics());
                assert_eq!(files.values, memory.values);
            }
        }
    }
}

#[test]
fn a_solve_in_files_stops_where_one_in_memory_does() {
    let start = [StartRegion::from(DVec2::new(8.3, 9.6))];
    let (solver, folder) = (Solver::default(), TempDir::new().unwrap());
    for stop in [
        Stop::AllGoals(vec![DVec2::new(20.5, 13.0)]),
        Stop::AnyGoal(vec![DVec2::new(20.5, 13.0), DVec2::new(50.0, 40.0)]),
        Stop::Distance(9.0),
        Stop::Nodes(300),
    ] {
        for field in fields() {
            let memory = solve_in_memory(&solver, &field, &start, &stop);
            let files = solve_in_files(&solver, &folder, &field, &start, &stop).unwrap();
            assert_eq!(files.statistics(), memory.statistics(), "{stop:?}");
            assert_eq!(files.values, memory.values, "{stop:?}");
        }
    }
}

#[test]
fn what_is_read_of_a_map_in_files_has_the_bits_of_one_in_memory() {
    for accuracy in [Accuracy::Fast, Accuracy::High] {
        let (starts, solver, folder) = (starts(), solver(accuracy), TempDir::new().unwrap());
        for field in fields() {
            let memory = solve_in_memory(&solver, &field, &starts, &Stop::Never);
            let files = solve_in_files(&solver, &folder, &field, &starts, &Stop::Never).unwrap();
            assert_eq!(readings(&files), readings(&memory));
            files.check().unwrap();
        }
    }
}

#[test]
fn routes_and_isolines_of_a_map_in_files_have_the_bits_of_those_in_memory() {
    let frame = GridFrame::new(70, 45, DVec2::ZERO, DVec2::splat(10.0), Ground::METRES).unwrap();
    let height = |node: usize| 30.0 * ((node % 70) as f64 / 9.0 + (node / 70) as f64 / 6.0).sin();
    let heights = (0..frame.nodes()).map(height).collect();
    let control = Control::default();
    let terrain = Terrain::new(frame.clone(), heights, Crs::none()).unwrap();
    let surface = HeightSurface::fit(&terrain, &FitOptions::default(), &control).unwrap();
    let metric = Isotropic.on(&surface, &Modifiers::default(), &control).unwrap();
    let field = TensorField::sample(&metric, &control).unwrap();
    let starts = starts();
    for accuracy in [Accuracy::Fast, Accuracy::High] {
        let (solver, folder) = (solver(accuracy), TempDir::new().unwrap());
        let memory = solve_in_memory(&solver, &field, &starts, &Stop::Never);
        let files = solve_in_files(&solver, &folder, &field, &starts, &Stop::Never).unwrap();
        for goal in [DVec2::new(66.2, 40.1), DVec2::new(3.0, 44.0), DVec2::new(23.7, 15.5)] {
            let [a, b] = [&memory, &files].map(|map| trace(map, &metric, goal).unwrap());
            assert_eq!((a.grid, a.points), (b.grid, b.points));
        }
        let [a, b] = [&memory, &files].map(|map| {
            let values = map.to_row_major();
            isolines(&frame, &values, &levels_by_step(&values, 50.0).unwrap()).unwrap()
        });
        assert!(a.len() > 5);
        assert_eq!(a, b);
        damage(&folder, 7);
        assert_names_tile_7(trace(&files, &metric, DVec2::new(66.2, 40.1)));
    }
}

#[test]
fn a_map_in_files_is_updated_and_resumed_as_one_in_memory() {
    let (starts, control, folder) = (starts(), Control::default(), TempDir::new().unwrap());
    for accuracy in [Accuracy::Fast, Accuracy::High] {
        let solver = solver(accuracy);
        for field in fields() {
            let update = |map: DistanceMap| {
                let nodes = [(20, 17, None), (21, 17, None), (33, 9, Some(IDENTITY))];
                solver.update_nodes(map, &nodes, &Stop::Never, &control).unwrap()
            };
            let resume = |map: DistanceMap| solver.resume(map, &Stop::Never, &control).unwrap();
            for (stop, go_on) in [
                (Stop::Never, &update as &dyn Fn(DistanceMap) -> DistanceMap),
                (Stop::Distance(9.0), &resume),
            ] {
                let memory = go_on(solve_in_memory(&solver, &field, &starts, &stop));
                let files =
                    go_on(solve_in_files(&solver, &folder, &field, &starts, &stop).unwrap());
                assert_eq!(files.statistics(), memory.statistics(), "{stop:?}");
                assert_eq!(readings(&files), readings(&memory), "{stop:?}");
            }
        }
    }
}

#[test]
fn a_store_that_fails_ends_the_solve_with_its_error() {
    let start = [StartRegion::from(DVec2::new(8.3, 9.6))];
    for field in fields() {
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let folder = TempDir::new().unwrap();
            let store = |field: &_, seeds: &_| {
                let store = FileStore::new(folder.path(), field, seeds)?;
                damage(&folder, 7);
                Ok(store)
            };
            let (solver, control) = (Solver::default(), Control::default());
            assert_names_tile_7(
                pool.install(|| {
                    solver.solve_in(store, field.clone(), &start, &Stop::Never, &control)
                }),
            );
        }
    }
}

#[test]
fn what_a_store_cannot_read_is_unreached_until_the_map_is_checked() {
    let (starts, folder, control) = (starts(), TempDir::new().unwrap(), Control::default());
    let field = field(70, 45, |_, _| Some(IDENTITY));
    let solver = solver(Accuracy::High);
    let memory = solve_in_memory(&solver, &field, &starts, &Stop::Never);
    // All of the same files.
    let solve = || solve_in_files(&solver, &folder, &field, &starts, &Stop::Never).unwrap();
    let ([map, other, third], lost) = ([solve(), solve(), solve()], (35, 20));
    damage(&folder, 7);
    assert_eq!(map.at_node(3, 3), memory.at_node(3, 3));
    map.check().unwrap();
    let copy = map.clone();
    assert_eq!(map.at_node(lost.0, lost.1), f64::INFINITY);
    assert!(!map.is_reached(lost.0, lost.1) && map.at(DVec2::new(35.5, 20.5)).is_none());
    assert_names_tile_7(map.check());
    assert_names_tile_7(copy.check());
    let distances = other.to_row_major();
    assert_eq!(distances.iter().filter(|g| g.is_infinite()).count(), SIDE * SIDE);
    assert_names_tile_7(other.check());
    assert_names_tile_7(solver.update_nodes(third, &[(3, 3, None)], &Stop::Never, &control));
}
