//! Time of each stage, and of the solver by size, problem, accuracy and number of threads: `cargo bench`.
//!
//! `RIDGEWAY_BENCH_SIZES=2001,4001 cargo bench` for other sizes than 501 and 1001 nodes along a side.

mod problems;

use criterion::measurement::WallTime;
use criterion::{
    BatchSize, BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main,
};
use glam::DVec2;
use rayon::{ThreadPool, ThreadPoolBuilder};
use ridgeway::eikonal::TensorField;
use ridgeway::synthetic::{Synthetic, SyntheticKind};
use ridgeway::{
    Control, Crs, Curvature, FitOptions, HeightSurface, Isotropic, Metric, Modifiers, Stop,
};

use problems::{ACCURACIES, Problem, solver};

/// The easy, the strongly anisotropic, and those in which the front goes back and forth.
const PROBLEMS: [Problem; 8] = [
    Problem::Constant { ratio: 1.0 },
    Problem::Constant { ratio: 25.0 },
    Problem::Constant { ratio: 400.0 },
    Problem::Diffeomorphism,
    Problem::Hills,
    Problem::RandomSpeed,
    Problem::Maze,
    Problem::Spiral,
];
const THREADS: [usize; 2] = [1, 2];

fn sizes() -> Vec<usize> {
    let sizes = std::env::var("RIDGEWAY_BENCH_SIZES").unwrap_or_else(|_| "501,1001".to_owned());
    sizes.split(',').map(|n| n.parse().expect("sizes are numbers, separated by commas")).collect()
}

fn pool(threads: usize) -> ThreadPool {
    ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool")
}

fn group<'a>(criterion: &'a mut Criterion, stage: &str, n: usize) -> BenchmarkGroup<'a, WallTime> {
    let mut group = criterion.benchmark_group(format!("{stage} {n}x{n}"));
    group.throughput(Throughput::Elements((n * n) as u64));
    group
}

/// Fit, tensors and solve of a mountain range, as a user has them.
fn stages(criterion: &mut Criterion) {
    let control = Control::default();
    for n in sizes() {
        let range = Synthetic::new(SyntheticKind::Range, n, n, 30.0).expect("a valid size");
        let terrain = range.with_seed(1).terrain(Crs::none(), DVec2::ZERO).expect("a plane CRS");
        let fit = || HeightSurface::fit(&terrain, &FitOptions::default(), &control);
        let surface = fit().expect("a terrain without voids");
        let mut group = group(criterion, "range", n);
        for threads in THREADS {
            let pool = pool(threads);
            let id = |stage: &str| BenchmarkId::new(stage.to_owned(), threads);
            group.bench_function(id("fit"), |b| b.iter(|| pool.install(fit)));
            let metrics: [&dyn Metric; 2] = [&Isotropic, &Curvature::default()];
            for metric in metrics {
                let metric = metric
                    .on(&surface, &Modifiers::default(), &Control::default())
                    .expect("default options");
                let sample = || TensorField::sample(&metric, &control).expect("not cancelled");
                group.bench_function(id(&format!("tensors {}", metric.name())), |b| {
                    b.iter(|| pool.install(sample));
                });
                time_solves(&mut group, metric.name(), &sample(), threads);
            }
        }
        group.finish();
    }
}

/// Solve only, on the problems that the solver is judged on.
fn solves(criterion: &mut Criterion) {
    for n in sizes() {
        let mut group = group(criterion, "problem", n);
        for problem in PROBLEMS {
            let field = problem.field(n, &Control::default()).expect("not cancelled");
            for threads in THREADS {
                time_solves(&mut group, &problem.to_string(), &field, threads);
            }
        }
        group.finish();
    }
}

/// Every accuracy on one field, from the middle.
fn time_solves(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    field: &TensorField,
    threads: usize,
) {
    let control = Control::default();
    let pool = pool(threads);
    let start = Problem::start(field.cols());
    for accuracy in ACCURACIES {
        let solver = solver(accuracy).expect("a known accuracy");
        let id = BenchmarkId::new(format!("solve {name} {accuracy}"), threads);
        group.bench_function(id, |b| {
            let solve =
                |field| pool.install(|| solver.solve_field(field, &start, &Stop::Never, &control));
            b.iter_batched(|| field.clone(), solve, BatchSize::LargeInput);
        });
    }
}

/// A solve takes long enough that ten are plenty.
fn few() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(std::time::Duration::from_millis(300))
        .measurement_time(std::time::Duration::from_secs(2))
}

criterion_group! { name = benches; config = few(); targets = stages, solves }
criterion_main!(benches);
