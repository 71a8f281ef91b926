//! What regions and signatures cost: milliseconds of each stage, the fastest of several runs, by size, metric and threads.
//!
//! `cargo run --release --example regions_cost [NODES]...` for sides of so many nodes, 100 and 1000 if none are given.

use std::time::Instant;

use glam::DVec2;
use rayon::ThreadPoolBuilder;
use ridgeway::eikonal::TensorField;
use ridgeway::region::{Neighbours, SegmentOptions, Segmentation, signatures};
use ridgeway::synthetic::{Synthetic, SyntheticKind};
use ridgeway::{
    Control, Crs, Curvature, Difference, FitOptions, HeightSurface, Metric, Modifiers, Result,
    Solver, Stop,
};

const STAGES: [&str; 5] = ["metric", "solve", "ranks", "cover, labels", "signatures"];

fn main() -> Result<()> {
    let sizes: Vec<usize> = std::env::args().skip(1).filter_map(|size| size.parse().ok()).collect();
    let sizes = if sizes.is_empty() { vec![100, 1000] } else { sizes };
    println!(
        "{:>20} {:>7} {:>7} {}",
        "",
        "threads",
        "regions",
        STAGES.map(|s| format!("{s:>14}")).concat()
    );
    for nodes in sizes {
        let range = Synthetic::new(SyntheticKind::Range, nodes, nodes, 30.0)?;
        let terrain = range.with_seed(1).terrain(Crs::none(), DVec2::ZERO)?;
        let surface = HeightSurface::fit(&terrain, &FitOptions::default(), &Control::default())?;
        let curvature = Curvature::default();
        let difference = Difference::default();
        let metrics: [&dyn Metric; 2] = [&curvature, &difference];
        for metric in metrics {
            for threads in [1, 2] {
                let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
                let runs: Vec<_> = (0..if nodes > 300 { 5 } else { 21 })
                    .map(|_| pool.install(|| stages(&surface, metric)))
                    .collect::<Result<_>>()?;
                let fastest = |stage: usize| {
                    runs.iter().map(|run| run.1[stage]).fold(f64::INFINITY, f64::min)
                };
                let times: String =
                    (0..STAGES.len()).map(|s| format!("{:>14.2}", fastest(s))).collect();
                let name = metric.name();
                println!("{name:>10} {nodes:>4}²     {threads:>7} {:>7} {times}", runs[0].0);
            }
        }
    }
    Ok(())
}

/// Regions, and milliseconds of each stage, and of what belongs to none.
fn stages(
    surface: &HeightSurface,
    metric: &dyn Metric,
) -> Result<(usize, [f64; STAGES.len() + 1])> {
    let control = Control::default();
    let mut times = [0.0; STAGES.len() + 1];
    let mut clock = Instant::now();
    let mut lap = |stage: usize| {
        times[stage] += 1e3 * clock.elapsed().as_secs_f64();
        clock = Instant::now();
    };
    let metric = metric.on(surface, &Modifiers::default(), &control)?;
    let field = TensorField::sample(&metric, &control)?;
    lap(0);
    let start = DVec2::splat(0.5 * (field.cols() - 1) as f64);
    let copy = field.clone();
    lap(STAGES.len());
    let map = Solver::default().solve_field(copy, &[start.into()], &Stop::Never, &control)?;
    lap(1);
    let farthest = map.to_row_major().into_iter().fold(0f32, f32::max);
    drop(map);
    lap(STAGES.len());
    let ranks = metric.seed_ranks();
    lap(2);
    // The default on small grids, some hundred regions on large ones.
    let epsilons = if field.cols() > 300 { vec![f64::from(farthest) / 9.0] } else { Vec::new() };
    let options = SegmentOptions { epsilons, ..SegmentOptions::default() };
    let cut = Segmentation::of(&field, &ranks, &options, &control)?;
    lap(3);
    signatures(surface, &cut.levels[0].labels, Neighbours::Surface, &control)?;
    lap(4);
    Ok((cut.levels[0].regions.len(), times))
}
