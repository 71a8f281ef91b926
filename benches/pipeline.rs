//! Time of each stage, by size and metric: `cargo bench`.

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec2;
use ridgeway::eikonal::TensorField;
use ridgeway::terrain::synthetic::{Synthetic, SyntheticKind};
use ridgeway::{Control, Crs, FitOptions, HeightSurface, Metric, Modifiers, Solver, Terrain};

const SIZES: [usize; 2] = [501, 1001];

fn terrain(n: usize) -> Terrain {
    let range =
        Synthetic::new(SyntheticKind::Range, n, n, 30.0).expect("a valid size").with_seed(1);
    range.terrain(Crs::none(), DVec2::ZERO).expect("a plane CRS")
}

fn stages(criterion: &mut Criterion) {
    let control = Control::default();
    for n in SIZES {
        let terrain = terrain(n);
        let fit = || HeightSurface::fit(&terrain, &FitOptions::default(), &control);
        let surface = fit().expect("a terrain without voids");
        let mut group = criterion.benchmark_group(format!("{n}x{n}"));
        group.sample_size(10).throughput(Throughput::Elements((n * n) as u64));
        group.bench_function("fit", |b| b.iter(fit));
        for metric in [Metric::Isotropic, Metric::Curvature(Default::default())] {
            let field = metric.on(&surface, &Modifiers::default()).expect("default options");
            let sample = || TensorField::sample(&field, &control).expect("not cancelled");
            group.bench_function(BenchmarkId::new("tensors", field.name()), |b| b.iter(sample));
            let start = DVec2::splat((n / 2) as f64).into();
            let solve = |tensors| Solver::default().solve_field(tensors, &start, &[], &control);
            group.bench_function(BenchmarkId::new("solve", field.name()), |b| {
                b.iter_batched(sample, solve, BatchSize::LargeInput);
            });
        }
        group.finish();
    }
}

criterion_group!(benches, stages);
criterion_main!(benches);
