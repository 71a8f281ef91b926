//! The surface of figure 6, its segmentation, and two older ones, for the example and for the test on it.

use glam::DVec2;
use ridgeway::eikonal::TensorField;
use ridgeway::region::{SegmentOptions, Segmentation, gaussian_ranks};
use ridgeway::synthetic::{Synthetic, SyntheticKind};
use ridgeway::{
    Control, Crs, Curvature, Error, FitOptions, HeightSurface, Metric, Modifiers, Smoothing,
    Terrain,
};

/// Nodes along each side, as in the paper. Even, so that no node lies on the lines where the bumps meet.
pub(crate) const SIDE: usize = 100;

pub(crate) fn terrain() -> Result<Terrain, Error> {
    Synthetic::new(SyntheticKind::FourBumps, SIDE, SIDE, 10.0)?.terrain(Crs::none(), DVec2::ZERO)
}

/// Four overlapping Gaussian bumps in the same places, their standard deviation as a share of the distance between neighbours.
pub(crate) fn gaussians(deviation: f64) -> Result<Terrain, Error> {
    let frame = terrain()?.frame().clone();
    let quarter = 0.25 * SIDE as f64;
    let bump = |i: usize, (x, y): (f64, f64)| {
        let node = DVec2::new((i % SIDE) as f64, (i / SIDE) as f64);
        let off = node - (DVec2::new(x, y) * quarter - 0.5);
        (-0.5 * off.length_squared() / (2.0 * quarter * deviation).powi(2)).exp()
    };
    let tops = [(1.0, 1.0), (3.0, 1.0), (1.0, 3.0), (3.0, 3.0)];
    let height = |i| 200.0 * tops.iter().map(|&top| bump(i, top)).sum::<f64>();
    Terrain::new(frame, (0..SIDE * SIDE).map(height).collect(), Crs::none())
}

pub(crate) fn surface(terrain: &Terrain) -> Result<HeightSurface, Error> {
    let options = FitOptions { smoothing: Smoothing::Interpolate, ..FitOptions::default() };
    HeightSurface::fit(terrain, &options, &Control::default())
}

/// The segmentation of section 5.1 with the curvature tensor and all defaults. The order in which seeds are taken is perturbed: each
/// node is put back by up to this share of all places, at random by `seed`.
pub(crate) fn segmentation(
    surface: &HeightSurface,
    perturbation: f64,
    seed: u64,
) -> Result<Segmentation, Error> {
    let control = Control::default();
    let metric = Curvature::default().on(surface, &Modifiers::default(), &Control::default())?;
    let field = TensorField::sample(&metric, &control)?;
    let ranks = perturbed(&gaussian_ranks(surface), perturbation, seed);
    Segmentation::of(&field, &ranks, &SegmentOptions::default(), &control)
}

fn perturbed(ranks: &[f64], perturbation: f64, seed: u64) -> Vec<f64> {
    let mut order: Vec<usize> = (0..ranks.len()).collect();
    order.sort_by(|&a, &b| ranks[a].total_cmp(&ranks[b]));
    let mut state = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut places = vec![0.0; ranks.len()];
    for (place, &node) in order.iter().enumerate() {
        places[node] = place as f64 + perturbation * ranks.len() as f64 * random();
    }
    places
}

/// Share of the nodes that are in the region of the seed in their own quarter.
pub(crate) fn agreement(segmentation: &Segmentation) -> f64 {
    let level = &segmentation.levels[0];
    let quarter = |col: usize, row: usize| (2 * col < SIDE, 2 * row < SIDE);
    let agrees = |&i: &usize| {
        level.labels[i].is_some_and(|label| {
            let [col, row] = level.regions[label as usize].seed;
            quarter(col, row) == quarter(i % SIDE, i / SIDE)
        })
    };
    let nodes = SIDE * SIDE;
    (0..nodes).filter(agrees).count() as f64 / nodes as f64
}

/// Total curvature `K` and the larger principal curvature (positive where the surface is hollow) at the nodes.
pub(crate) fn curvatures(surface: &HeightSurface) -> (Vec<f64>, Vec<f64>) {
    let nodes = (0..SIDE * SIDE).map(|i| DVec2::new((i % SIDE) as f64, (i / SIDE) as f64));
    nodes
        .map(|at| surface.jet(at).curvature())
        .map(|curvature| (curvature.gaussian, curvature.principal[0]))
        .unzip()
}

/// Number of regions that a watershed of the total curvature leaves, after Mangan and Whitaker (1999): basins around the extremes of
/// `K`, as its zero set, the thick lines of the paper's figure, is where they end. Basins are merged if the pass between them is
/// less than a tenth of the largest `|K|` from the lower extreme: a watershed depth.
pub(crate) fn total_curvature_watershed(gaussian: &[f64]) -> usize {
    let height = |i: usize| gaussian[i].abs();
    let depth = 0.1 * (0..gaussian.len()).map(height).fold(0.0, f64::max);
    let mut order: Vec<usize> = (0..gaussian.len()).collect();
    order.sort_by(|&a, &b| height(b).total_cmp(&height(a)));
    // The extreme that each node belongs to, by way of extremes that were merged into others.
    let mut home = vec![usize::MAX; gaussian.len()];
    let mut extremes = 0;
    for node in order {
        let mut basins: Vec<usize> = neighbours(node)
            .filter(|&other| home[other] != usize::MAX)
            .map(|mut at| {
                while home[at] != at {
                    at = home[at];
                }
                at
            })
            .collect();
        basins.sort_by(|&a, &b| height(b).total_cmp(&height(a)).then(a.cmp(&b)));
        basins.dedup();
        extremes += usize::from(basins.is_empty());
        home[node] = basins.first().copied().unwrap_or(node);
        for &lower in basins.iter().skip(1) {
            if height(lower) - height(node) < depth {
                home[lower] = basins[0];
                extremes -= 1;
            }
        }
    }
    extremes
}

/// Number of regions that fast marching leaves, after Page, Koschan and Abidi (2003): fronts march over the convex parts; where the directional
/// curvature says hollow there are walls, which no front enters, and what remains behind them is a region too.
pub(crate) fn marching_between_walls(larger_curvature: &[f64]) -> usize {
    // The tops are flat but for rounding.
    let least = 1e-3 * larger_curvature.iter().copied().fold(0.0, f64::max);
    let is_wall = |i: usize| larger_curvature[i] > least;
    let mut reached = vec![false; larger_curvature.len()];
    let mut regions = 0;
    for first in 0..larger_curvature.len() {
        let mut front = if reached[first] { vec![] } else { vec![first] };
        regions += front.len();
        while let Some(node) = front.pop() {
            reached[node] = true;
            let same = |&other: &usize| !reached[other] && is_wall(other) == is_wall(node);
            front.extend(neighbours(node).filter(same));
        }
    }
    regions
}

/// The eight nodes around one.
fn neighbours(node: usize) -> impl Iterator<Item = usize> {
    let (col, row) = (node % SIDE, node / SIDE);
    let within = move |at: usize, by: usize| (at + by).checked_sub(1).filter(|&at| at < SIDE);
    (0..9).filter_map(move |i| {
        let (col, row) = (within(col, i % 3)?, within(row, i / 3)?);
        (i != 4).then_some(row * SIDE + col)
    })
}
