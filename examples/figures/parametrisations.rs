//! Figure 5: one surface with two parametrisations.

use glam::DVec2;
use ridgeway::{Control, DistanceMap, Metric, Modifiers, NurbsGrid, Result, Solver, Stop};

use super::shapes::knight;

/// Ratio of the Möbius map along the profile: nodes at the foot lie `RATIO²` times as dense against those at the head as before.
const RATIO: f64 = 0.5;

/// The knight and its reweighted twin, with the distances on both from one point of the surface.
pub(crate) struct Comparison {
    pub(crate) surfaces: [NurbsGrid; 2],
    pub(crate) maps: [DistanceMap; 2],
    /// Mean and greatest difference at the first one's nodes, as shares of the greatest distance.
    pub(crate) mean_difference: f64,
    pub(crate) greatest_difference: f64,
}

/// Distances with `2 n` nodes around and `n + 1` along the profile.
pub(crate) fn compare(metric: &dyn Metric, n: usize) -> Result<Comparison> {
    let (cols, rows) = (2 * n, n + 1);
    let knight = knight()?;
    let surfaces =
        [knight.clone().on_grid(cols, rows)?, knight.reweighted(1, RATIO)?.on_grid(cols, rows)?];
    // On the collar, off the nodes of both.
    let start = DVec2::new(0.3 * cols as f64, 0.35 * n as f64);
    let solve = |surface: &NurbsGrid, start: DVec2| {
        let control = Control::default();
        let metric = metric.on(surface, &Modifiers::default(), &control)?;
        Solver::default().solve(&metric, &[start.into()], &Stop::Never, &control)
    };
    let maps = [solve(&surfaces[0], start)?, solve(&surfaces[1], twin(start, n))?];

    let (mut sum, mut greatest, mut most) = (0.0, 0.0_f64, 0.0_f64);
    for row in 0..rows {
        for col in 0..cols {
            let at = DVec2::new(col as f64, row as f64);
            let (a, b) = (maps[0].at_node(col, row), maps[1].at(twin(at, n)).unwrap_or(f64::NAN));
            sum += (a - b).abs();
            greatest = greatest.max((a - b).abs());
            most = most.max(a);
        }
    }
    let mean_difference = sum / (cols * rows) as f64 / most;
    Ok(Comparison { surfaces, maps, mean_difference, greatest_difference: greatest / most })
}

/// Where a point of the first surface is on the second.
fn twin(at: DVec2, n: usize) -> DVec2 {
    let s = at.y / n as f64;
    DVec2::new(at.x, RATIO * s / (1.0 + (RATIO - 1.0) * s) * n as f64)
}
