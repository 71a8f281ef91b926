//! Area, curvature and extent of a whole surface: what automatic parameters are scaled by.

use rayon::prelude::*;

use super::Surface;

/// Area, curvature and extent of a whole surface, see [`Surface::measures`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// Area of the surface, m².
    pub area: f64,
    /// Root mean square of the principal curvatures, `√(mean (κ1² + κ2²)/2)`, 1/m.
    pub rms_curvature: f64,
    /// Diagonal of the grid, m: of a rectangle whose sides are the mean lengths of the rows and of the columns of cells.
    pub extent: f64,
}

/// The share of a cell that belongs to node `at` of `count`, by the trapezoidal rule.
pub(super) fn share(at: usize, count: usize, periodic: bool) -> f64 {
    let is_end = at == 0 || at + 1 == count;
    if is_end && !periodic { 0.5 } else { 1.0 }
}

/// Sums over the nodes of a row.
#[derive(Clone, Copy, Default)]
struct Sums {
    area: f64,
    /// `κ1² + κ2²` over the area.
    square: f64,
    /// Lengths of a step along columns and along rows.
    steps: [f64; 2],
    nodes: f64,
}

impl Sums {
    fn add(self, other: Self) -> Self {
        Self {
            area: self.area + other.area,
            square: self.square + other.square,
            steps: [0, 1].map(|axis| self.steps[axis] + other.steps[axis]),
            nodes: self.nodes + other.nodes,
        }
    }
}

/// The measures from the nodes, `(column, row)`, that count.
pub(super) fn measured(
    surface: &(impl Surface + ?Sized),
    counts: impl Fn(usize, usize) -> bool + Sync,
) -> Measures {
    let [cols, rows] = [surface.cols(), surface.rows()];
    let of_rows: Vec<Sums> =
        (0..rows).into_par_iter().map(|row| sums_of_row(surface, row, &counts)).collect();
    // Added row by row, so that the sum does not depend on the number of threads.
    let Sums { area, square, steps, nodes } = of_rows.into_iter().fold(Sums::default(), Sums::add);
    let mean = if area > 0.0 { 0.5 * square / area } else { 0.0 };
    let [width, height] = [cols as f64 * steps[0], rows as f64 * steps[1]];
    let extent = if nodes > 0.0 { width.hypot(height) / nodes } else { 0.0 };
    Measures { area, rms_curvature: mean.sqrt(), extent }
}

/// The sums over the nodes of a row that count.
fn sums_of_row(
    surface: &(impl Surface + ?Sized),
    row: usize,
    counts: impl Fn(usize, usize) -> bool,
) -> Sums {
    let [cols, rows] = [surface.cols(), surface.rows()];
    let [across, down] = surface.periodic();
    let jets = surface.row_space_jets(row).into_iter().enumerate();
    let known = jets
        .filter(|(col, jet)| jet.is_regular() && !surface.is_void(*col, row) && counts(*col, row));
    known.fold(Sums::default(), |sums, (col, jet)| {
        let area = share(col, cols, across) * share(row, rows, down) * jet.area();
        let square = area * jet.squared_curvature();
        let steps = jet.first.map(|step| step.length());
        sums.add(Sums { area, square, steps, nodes: 1.0 })
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::control::Control;
    use crate::surface::in_space::InSpace;
    use crate::surface::{FitOptions, HeightSurface};
    use crate::synthetic::{Synthetic, SyntheticKind};
    use crate::terrain::Crs;

    #[test]
    fn on_the_map_and_in_space_gentle_ground_measures_the_same() {
        let cylinder = Synthetic::new(SyntheticKind::Cylinder, 61, 41, 10.0).unwrap();
        let gentle = cylinder.terrain(Crs::none(), DVec2::ZERO).unwrap();
        let heights = gentle.heights().iter().map(|z| 1e-3 * z).collect();
        let terrain =
            crate::terrain::Terrain::new(gentle.frame().clone(), heights, Crs::none()).unwrap();
        let surface =
            HeightSurface::fit(&terrain, &FitOptions::default(), &Control::default()).unwrap();
        let (map, space) = (surface.measures(), InSpace::new(&surface).measures());
        assert!((map.area / space.area - 1.0).abs() < 1e-12, "{map:?} {space:?}");
        assert!((map.area / (600.0 * 400.0) - 1.0).abs() < 1e-6, "{map:?}");
        assert!((map.extent / space.extent - 1.0).abs() < 1e-5, "{map:?} {space:?}");
        assert!((map.rms_curvature / space.rms_curvature - 1.0).abs() < 0.05, "{map:?} {space:?}");
    }
}
