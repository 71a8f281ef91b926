//! Speed tensors of many nodes at once.

use multiversion::multiversion;

use super::{Speed, averse_to_climb, curvature};
use crate::linalg::Sym2;
use crate::surface::{BLOCK, JetBlock, Lanes};

/// Speed tensors at the nodes of a block in ground axes, row by row: `D` and its determinant side by side. A
/// determinant of 0 marks a closed node, whose other entries mean nothing.
#[derive(Clone, Debug, Default)]
pub(crate) struct SpeedBlock {
    pub(crate) xx: [Lanes; BLOCK],
    pub(crate) xy: [Lanes; BLOCK],
    pub(crate) yy: [Lanes; BLOCK],
    pub(crate) det: [Lanes; BLOCK],
    /// Room for the derivatives.
    pub(super) jets: JetBlock,
}

impl SpeedBlock {
    /// Sets the tensor in column `i` of row `row`, and its determinant.
    #[inline(always)]
    pub(crate) fn set(&mut self, row: usize, i: usize, (d, det): (Sym2, f64)) {
        self.xx[row][i] = d.xx;
        self.xy[row][i] = d.xy;
        self.yy[row][i] = d.yy;
        self.det[row][i] = det;
    }

    /// Whether the tensor in column `i` of row `row` is positive definite.
    #[inline(always)]
    pub(crate) fn is_open(&self, row: usize, i: usize) -> bool {
        let det = self.det[row][i];
        (self.xx[row][i] > 0.0) & (det > 0.0) & (det < f64::INFINITY)
    }

    /// Multiplies the tensor in column `i` of row `row` by `factor`.
    pub(super) fn scale(&mut self, row: usize, i: usize, factor: f64) {
        let (d, det) = self.get(row, i);
        self.set(row, i, (d * factor, det * factor * factor));
    }

    #[inline(always)]
    fn get(&self, row: usize, i: usize) -> (Sym2, f64) {
        (Sym2::new(self.xx[row][i], self.xy[row][i], self.yy[row][i]), self.det[row][i])
    }
}

/// The tensors of a metric at the nodes of a block; those known at the nodes are in `speeds` already.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
pub(super) fn of_jets(speed: &Speed, climb_weight: f64, speeds: &mut SpeedBlock) {
    match *speed {
        Speed::Isotropic => {
            for row in 0..BLOCK {
                for i in 0..BLOCK {
                    speeds.set(row, i, curvature::isotropic(&speeds.jets.jet(row, i)));
                }
            }
        }
        Speed::Curvature { delta } => {
            for row in 0..BLOCK {
                for i in 0..BLOCK {
                    speeds.set(row, i, curvature::curvature(&speeds.jets.jet(row, i), delta));
                }
            }
        }
        Speed::Difference { .. } | Speed::Tensor(_) => {}
    }
    if climb_weight > 0.0 {
        for row in 0..BLOCK {
            for i in 0..BLOCK {
                let speed = speeds.get(row, i);
                speeds.set(row, i, averse_to_climb(speed, &speeds.jets.jet(row, i), climb_weight));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::control::Control;
    use crate::metric::{Metric, Modifiers};
    use crate::surface::{FitOptions, HeightSurface};
    use crate::synthetic::{Synthetic, SyntheticKind};
    use crate::terrain::Crs;

    #[test]
    fn wide_registers_change_no_bit() {
        let range = Synthetic::new(SyntheticKind::Range, 40, 33, 30.0).unwrap();
        let terrain = range.terrain(Crs::none(), DVec2::ZERO).unwrap();
        let surface =
            HeightSurface::fit(&terrain, &FitOptions::default(), &Control::default()).unwrap();
        for metric in [Metric::Isotropic, Metric::Curvature(Default::default())] {
            let modifiers = Modifiers { climb_weight: 20.0, ..Modifiers::default() };
            let field = metric.on(&surface, &modifiers, &Control::default()).unwrap();
            let mut speeds = SpeedBlock::default();
            field.block_speeds(16, 16, &mut speeds);
            for row in 0..BLOCK {
                for i in 0..BLOCK {
                    let jet = speeds.jets.jet(row, i);
                    let speed = match metric {
                        Metric::Isotropic => curvature::isotropic(&jet),
                        _ => curvature::curvature(&jet, field.delta().unwrap()),
                    };
                    assert_eq!(averse_to_climb(speed, &jet, 20.0), speeds.get(row, i));
                }
            }
        }
    }
}
