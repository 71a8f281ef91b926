//! Area, curvature and slope of the regions of a surface.

use rayon::prelude::*;
use serde::Serialize;

use super::Level;
use crate::surface::{Surface, SurfaceJet};

/// Measures of a region. Means are over its area on the surface, so that they do not depend on the parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RegionStatistics {
    /// Nodes.
    pub nodes: usize,
    /// Area on the surface, m²: a node stands for the cell around it.
    pub area_m2: f64,
    /// Mean of the larger and of the smaller `|κ|`, 1/m.
    pub mean_abs_curvature_per_m: [f64; 2],
    /// Mean of `H = (κ1 + κ2)/2`, 1/m: positive in hollows.
    pub mean_curvature_per_m: f64,
    /// Mean of `K = κ1 κ2`, 1/m².
    pub gaussian_curvature_per_m2: f64,
    /// Mean angle between the normal and the third axis, degrees: the slope of terrain.
    pub mean_slope_deg: f64,
}

impl RegionStatistics {
    /// Those of a single node; `None` where the surface has no tangent plane.
    fn of(jet: &SurfaceJet) -> Option<Self> {
        if !jet.is_regular() {
            return None;
        }
        let [mean, gaussian] = jet.mean_and_gaussian();
        let radius = (mean * mean - gaussian).max(0.0).sqrt();
        Some(Self {
            nodes: 0,
            area_m2: jet.area(),
            mean_abs_curvature_per_m: [mean.abs() + radius, (mean.abs() - radius).abs()],
            mean_curvature_per_m: mean,
            gaussian_curvature_per_m2: gaussian,
            mean_slope_deg: jet.normal().z.clamp(-1.0, 1.0).acos().to_degrees(),
        })
    }

    /// The means, of sums over the area.
    fn mean(&self) -> Self {
        let mut mean = Self { nodes: self.nodes, ..Self::default() };
        if self.area_m2 > 0.0 {
            mean.add(self, self.area_m2.recip());
        }
        mean
    }

    /// Adds `part` with its means times `weight`.
    fn add(&mut self, part: &Self, weight: f64) {
        self.area_m2 += part.area_m2;
        for (sum, value) in
            self.mean_abs_curvature_per_m.iter_mut().zip(part.mean_abs_curvature_per_m)
        {
            *sum += weight * value;
        }
        self.mean_curvature_per_m += weight * part.mean_curvature_per_m;
        self.gaussian_curvature_per_m2 += weight * part.gaussian_curvature_per_m2;
        self.mean_slope_deg += weight * part.mean_slope_deg;
    }
}

/// Measures of the regions of a level, in the order of [`Level::regions`]; the level must be one of this surface. Cost: one evaluation of
/// the surface per node.
#[must_use]
pub fn region_statistics(surface: &dyn Surface, level: &Level) -> Vec<RegionStatistics> {
    /// Rows that are evaluated at a time; they are added up one after the other, so that the sums do not depend on the threads.
    const ROWS: usize = 64;
    let mut sums = vec![RegionStatistics::default(); level.regions.len()];
    let (cols, rows) = (surface.cols(), surface.rows());
    for first in (0..rows).step_by(ROWS) {
        let of_row = |row| surface.row_space_jets(row).iter().map(RegionStatistics::of).collect();
        let block: Vec<Vec<_>> =
            (first..rows.min(first + ROWS)).into_par_iter().map(of_row).collect();
        for (part, label) in block.iter().flatten().zip(&level.labels[first * cols..]) {
            if let Some(label) = label {
                let sum = &mut sums[*label as usize];
                sum.nodes += 1;
                // A point without a tangent plane has no area.
                if let Some(part) = part {
                    sum.add(part, part.area_m2);
                }
            }
        }
    }
    sums.iter().map(RegionStatistics::mean).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::control::Control;
    use crate::region::Region;
    use crate::surface::{FitOptions, HeightSurface, Smoothing};
    use crate::synthetic::{Synthetic, SyntheticKind};
    use crate::terrain::Crs;

    #[test]
    fn a_cylinder_has_the_curvature_and_area_of_a_cylinder() {
        let trough = Synthetic::new(SyntheticKind::Cylinder, 101, 41, 10.0).unwrap();
        let terrain = trough.terrain(Crs::none(), DVec2::ZERO).unwrap();
        let options = FitOptions { smoothing: Smoothing::Interpolate, ..FitOptions::default() };
        let surface = HeightSurface::fit(&terrain, &options, &Control::default()).unwrap();
        // The middle columns and rows are one region.
        let middle = |i: usize| (30..71).contains(&(i % 101)) && (5..36).contains(&(i / 101));
        let labels = (0..101 * 41).map(|i| middle(i).then_some(0)).collect();
        let region = Region { seed: [50, 20], parent: None, epsilon: 1.0 };
        let level = Level { labels, regions: vec![region] };
        let [got] = &region_statistics(&surface, &level)[..] else { panic!() };
        let radius = trough.radius().unwrap();
        let area = 2.0 * radius * (205.0 / radius).asin() * 310.0;
        assert_eq!(got.nodes, 41 * 31);
        assert!((got.area_m2 / area - 1.0).abs() < 1e-4, "{got:?}, {area}");
        let [larger, smaller] = got.mean_abs_curvature_per_m.map(|k| k * radius);
        assert!((larger - 1.0).abs() < 1e-3 && smaller < 1e-3, "{larger} {smaller}");
        assert!((got.mean_curvature_per_m * radius - 0.5).abs() < 1e-3);
    }
}
