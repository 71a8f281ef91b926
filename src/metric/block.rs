//! Speed tensors of many nodes at once.

use crate::linalg::Sym2;
use crate::surface::{BLOCK, JetBlock, Lanes};

/// Speed tensors at the nodes of a [`Block`](crate::surface::Block) in the axes of the surface, by row and column within it:
/// `D` and its determinant side by side. A determinant of 0 marks a closed node, whose other entries mean nothing.
#[derive(Clone, Debug, Default)]
pub struct SpeedBlock {
    pub(crate) xx: [Lanes; BLOCK],
    pub(crate) xy: [Lanes; BLOCK],
    pub(crate) yy: [Lanes; BLOCK],
    pub(crate) det: [Lanes; BLOCK],
    /// Room for the derivatives.
    pub(super) jets: JetBlock,
}

impl SpeedBlock {
    /// Gives the node in column `i` of row `j` a tensor; it is closed if that is not positive definite.
    ///
    /// # Panics
    /// If `i` or `j` is not less than [`Block::SIDE`](crate::surface::Block::SIDE).
    #[inline(always)]
    pub fn set(&mut self, j: usize, i: usize, d: Sym2) {
        self.set_with(j, i, (d, d.det()));
    }

    /// The same with a determinant that is known more accurately than from the entries.
    #[inline(always)]
    pub(crate) fn set_with(&mut self, j: usize, i: usize, (d, det): (Sym2, f64)) {
        self.xx[j][i] = d.xx;
        self.xy[j][i] = d.xy;
        self.yy[j][i] = d.yy;
        self.det[j][i] = det;
    }

    /// Whether the tensor in column `i` of row `j` is positive definite.
    #[inline(always)]
    pub(crate) fn is_open(&self, j: usize, i: usize) -> bool {
        let det = self.det[j][i];
        (self.xx[j][i] > 0.0) & (det > 0.0) & (det < f64::INFINITY)
    }

    /// Multiplies the tensor in column `i` of row `j` by `factor`.
    pub(super) fn scale(&mut self, j: usize, i: usize, factor: f64) {
        let (d, det) = self.get(j, i);
        self.set_with(j, i, (d * factor, det * factor * factor));
    }

    /// The tensor in column `i` of row `j` and its determinant.
    #[inline(always)]
    pub(super) fn get(&self, j: usize, i: usize) -> (Sym2, f64) {
        (Sym2::new(self.xx[j][i], self.xy[j][i], self.yy[j][i]), self.det[j][i])
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::control::Control;
    use crate::metric::modifiers::averse_to_climb;
    use crate::metric::{Curvature, Isotropic, Metric, Modifiers, curvature, isotropic};
    use crate::surface::{FitOptions, HeightSurface};
    use crate::synthetic::{Synthetic, SyntheticKind};
    use crate::terrain::Crs;

    #[test]
    fn wide_registers_change_no_bit() {
        let range = Synthetic::new(SyntheticKind::Range, 40, 33, 30.0).unwrap();
        let terrain = range.terrain(Crs::none(), DVec2::ZERO).unwrap();
        let surface =
            HeightSurface::fit(&terrain, &FitOptions::default(), &Control::default()).unwrap();
        let metrics: [&dyn Metric; 2] = [&Isotropic, &Curvature::default()];
        for metric in metrics {
            let modifiers = Modifiers { climb_weight: 20.0, ..Modifiers::default() };
            let field = metric.on(&surface, &modifiers, &Control::default()).unwrap();
            let mut speeds = SpeedBlock::default();
            field.block_speeds(16, 16, &mut speeds);
            for row in 0..BLOCK {
                for i in 0..BLOCK {
                    let jet = speeds.jets.heights().unwrap().jet(row, i);
                    let speed = match field.parameter("delta_per_m") {
                        None => isotropic::of_heights(&jet),
                        Some(delta) => curvature::of_heights(&jet, delta),
                    };
                    let rise = jet.gradient();
                    assert_eq!(averse_to_climb(speed, rise, 20.0), speeds.get(row, i));
                }
            }
        }
    }
}
