//! Solves a named problem at a size and prints times and errors as lines of JSON: what `benches/peers.py` and the
//! tables of the documentation are made from.
//!
//! `cargo run --release --example solve_problem -- --problem constant-25,maze --size 501,1001 --threads 1,2`
//!
//! A line per problem, size and accuracy. Repetitions alternate between the numbers of threads, so that
//! a busy machine treats all alike.

mod exact;
#[path = "../../benches/problems/mod.rs"]
mod problems;

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use clap::Parser;
use glam::DVec2;
use rayon::{ThreadPool, ThreadPoolBuilder};
use ridgeway::{Control, DistanceMap, Stop};
use serde::Serialize;

use problems::{ACCURACIES, Problem, solver};

/// Solve a problem several times; print times and errors as JSON.
#[derive(Parser)]
struct Args {
    /// Problems: constant-RATIO, diffeomorphism, hills, linear-speed, cylinder, sphere-cap, random-speed,
    /// rotating, maze, spiral
    #[arg(long, value_delimiter = ',', default_value = "constant-1")]
    problem: Vec<Problem>,
    /// Nodes along a side
    #[arg(long, value_delimiter = ',', default_value = "1001",
        value_parser = clap::value_parser!(u32).range(9..=20_001))]
    size: Vec<u32>,
    /// Accuracies of the solver
    #[arg(long, value_delimiter = ',', default_value = ACCURACIES[0], value_parser = ACCURACIES)]
    accuracy: Vec<String>,
    /// Numbers of threads
    #[arg(long, value_delimiter = ',', default_value = "1",
        value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Vec<u16>,
    /// Solves per number of threads that are timed, after one that is not
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..))]
    repeat: u16,
    /// Without a closed form and walls, compare with our most accurate solution at so many times the resolution
    #[arg(long, value_parser = clap::value_parser!(u32).range(2..=16))]
    finer: Option<u32>,
    /// Write the distances of the last solve: f32, little-endian, row by row
    #[arg(long)]
    write: Option<PathBuf>,
}

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let args = Args::parse();
    for &problem in &args.problem {
        for &n in &args.size {
            for accuracy in &args.accuracy {
                let report = measure(problem, n as usize, accuracy, &args)?;
                println!("{}", serde_json::to_string(&report)?);
            }
        }
    }
    Ok(())
}

/// A line of the output. Times in seconds.
#[derive(Serialize)]
struct Report<'a> {
    problem: String,
    size: usize,
    accuracy: &'a str,
    runs: Vec<Run>,
    /// Times a tile was solved, per tile.
    activations_per_tile: f64,
    /// Times a node was updated, per node.
    passes_per_node: f64,
    error: Option<Error>,
}

/// The solves on one number of threads.
#[derive(Serialize)]
struct Run {
    threads: usize,
    /// Making the field of tensors, once.
    tensors_s: f64,
    /// Tensors to distances in the solver's own order.
    solve_s: Vec<f64>,
    /// Distances to a row-major array.
    values_s: Vec<f64>,
    /// What the threads could give at that moment, see [`spin`].
    spin_speedup: Vec<f64>,
}

/// Relative errors over the nodes more than three cells from the source.
#[derive(Serialize)]
struct Error {
    /// `closed form`, or `finer grid`: then the error of that is in the figures too.
    against: &'static str,
    mean_relative: f64,
    max_relative: f64,
    nodes: usize,
    /// Nodes with an answer that the solver did not reach.
    unreached: usize,
}

fn measure<'a>(
    problem: Problem,
    n: usize,
    accuracy: &'a str,
    args: &Args,
) -> Result<Report<'a>, Failure> {
    let control = Control::default();
    let solver = solver(accuracy).ok_or("no such accuracy")?;
    let start = Problem::start(n);
    let mut fields = Vec::new();
    let mut runs = Vec::new();
    for &threads in &args.threads {
        let pool = ThreadPoolBuilder::new().num_threads(threads.into()).build()?;
        let begin = Instant::now();
        let field = pool.install(|| problem.field(n, &control))?;
        let tensors_s = begin.elapsed().as_secs_f64();
        fields.push((pool, field));
        let [solve_s, values_s, spin_speedup] = [const { Vec::new() }; 3];
        runs.push(Run { threads: threads.into(), tensors_s, solve_s, values_s, spin_speedup });
    }
    let mut last = None;
    for repetition in 0..=args.repeat {
        for ((pool, field), run) in fields.iter().zip(&mut runs) {
            let field = field.clone();
            let speedup = spin_speedup(pool);
            let begin = Instant::now();
            let map = pool.install(|| solver.solve_field(field, &start, &Stop::Never, &control))?;
            let solve_s = begin.elapsed().as_secs_f64();
            let begin = Instant::now();
            let values = pool.install(|| map.to_row_major());
            if repetition > 0 {
                run.values_s.push(begin.elapsed().as_secs_f64());
                run.solve_s.push(solve_s);
                run.spin_speedup.push(speedup);
            }
            last = Some((map, values));
        }
    }
    let (map, values) = last.ok_or("no threads")?;
    if let Some(path) = &args.write {
        std::fs::write(path, values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())?;
    }
    let statistics = map.statistics();
    let tiles = statistics.tiles.max(1) as f64;
    Ok(Report {
        problem: problem.to_string(),
        size: n,
        accuracy,
        runs,
        activations_per_tile: statistics.activations as f64 / tiles,
        passes_per_node: statistics.sweeps as f64 / tiles,
        error: judge(problem, &map, args.finer)?,
    })
}

/// The error of a map, where there is something to judge it by.
fn judge(
    problem: Problem,
    map: &DistanceMap,
    finer: Option<u32>,
) -> Result<Option<Error>, Failure> {
    let n = map.cols();
    if let Some(exact) = exact::exact(problem) {
        let at = |col: usize, row: usize| DVec2::new(col as f64, row as f64) / (n - 1) as f64;
        let exact = |col, row| exact(at(col, row) - DVec2::splat(0.5));
        return Ok(Some(compare(map, "closed form", exact)));
    }
    // Walls are a few nodes thick, so that another size is another problem.
    let has_walls = matches!(problem, Problem::Maze | Problem::Spiral);
    let Some(times) = finer.filter(|_| !has_walls) else { return Ok(None) };
    let (times, control) = (times as usize, Control::default());
    let fine = times * (n - 1) + 1;
    let best = solver(ACCURACIES[ACCURACIES.len() - 1]).ok_or("no such accuracy")?;
    let field = problem.field(fine, &control)?;
    let fine = best.solve_field(field, &Problem::start(fine), &Stop::Never, &control)?;
    let value = |col: usize, row: usize| fine.at_node(times * col, times * row);
    let reached = |col, row| Some(value(col, row)).filter(|value| value.is_finite());
    Ok(Some(compare(map, "finer grid", reached)))
}

fn compare(
    map: &DistanceMap,
    against: &'static str,
    exact: impl Fn(usize, usize) -> Option<f64>,
) -> Error {
    let middle = 0.5 * (map.cols() - 1) as f64;
    let far = |i: usize| (i as f64 - middle).abs() > 3.0;
    let mut error =
        Error { against, mean_relative: 0.0, max_relative: 0.0, nodes: 0, unreached: 0 };
    for row in 0..map.rows() {
        for col in 0..map.cols() {
            if (far(col) || far(row))
                && let Some(exact) = exact(col, row)
            {
                let relative = (map.at_node(col, row) / exact - 1.0).abs();
                if relative.is_finite() {
                    error.mean_relative += relative;
                    error.max_relative = error.max_relative.max(relative);
                    error.nodes += 1;
                } else {
                    error.unreached += 1;
                }
            }
        }
    }
    error.mean_relative /= error.nodes.max(1) as f64;
    error
}

/// How many times faster the threads of a pool do some work that needs nothing but a core than one thread does: the
/// most that a solver could gain on this machine at this moment.
fn spin_speedup(pool: &ThreadPool) -> f64 {
    let threads = pool.current_num_threads();
    if threads == 1 {
        return 1.0;
    }
    let begin = Instant::now();
    spin();
    let alone = begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    pool.broadcast(|_| spin());
    threads as f64 * alone / begin.elapsed().as_secs_f64()
}

/// Some milliseconds of dependent multiplications.
fn spin() {
    let mut x = 1_u64;
    for _ in 0..4_000_000 {
        x = black_box(x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
    }
    black_box(x);
}
