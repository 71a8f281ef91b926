//! Length on the surface.

use glam::DVec2;

use super::norm::one_by_one;
use super::{Metric, MetricOptions, NamedMetric, Norm, SpeedBlock, SpeedTensor, Unit};
use crate::control::Control;
use crate::error::Result;
use crate::linalg::Sym2;
use crate::linalg::simd::{self, Kernel};
use crate::surface::{BLOCK, Block, HeightBlock, HeightJet, Jet, JetBlock, Surface};

pub(super) const NAMED: NamedMetric = NamedMetric {
    name: "isotropic",
    about: "Length on the surface, in metres",
    make: |_: &MetricOptions| Ok(Box::new(Isotropic)),
};

/// Geodesic distance: the length on the surface, in metres. `D = G⁻¹`, the inverse first fundamental form.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Isotropic;

impl Metric for Isotropic {
    fn name(&self) -> &str {
        NAMED.name
    }

    fn unit(&self) -> Unit {
        Unit::Metres
    }

    fn norm(&self, _: &dyn Surface, _: &Control) -> Result<Norm> {
        Ok(Norm::quadratic(*self).with_level(1.0))
    }
}

impl SpeedTensor for Isotropic {
    fn speed(&self, at: DVec2, jet: &Jet) -> Sym2 {
        self.speed_and_det(at, jet).0
    }

    fn speed_and_det(&self, _: DVec2, jet: &Jet) -> (Sym2, f64) {
        match jet {
            Jet::Height(jet) => of_heights(jet),
            Jet::Space(jet) => {
                let d = if jet.is_regular() { jet.first_form().inverse() } else { Sym2::NAN };
                (d, d.det())
            }
        }
    }

    fn block(&self, block: &Block, jets: &JetBlock, speeds: &mut SpeedBlock) {
        match jets.heights() {
            Some(jets) => simd::dispatch(BlockOfHeights { jets, speeds }),
            None => one_by_one(self, block, jets, speeds),
        }
    }
}

/// The tensors of a block of heights.
struct BlockOfHeights<'a> {
    jets: &'a HeightBlock,
    speeds: &'a mut SpeedBlock,
}

impl Kernel for BlockOfHeights<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for j in 0..BLOCK {
            for i in 0..BLOCK {
                self.speeds.set_with(j, i, of_heights(&self.jets.jet(j, i)));
            }
        }
    }
}

/// `G⁻¹` and its determinant.
#[inline(always)]
pub(super) fn of_heights(jet: &HeightJet) -> (Sym2, f64) {
    let (zx, zy) = (jet.zx, jet.zy);
    let inverse = 1.0 / (1.0 + zx * zx + zy * zy);
    let d = Sym2::new((1.0 + zy * zy) * inverse, -zx * zy * inverse, (1.0 + zx * zx) * inverse);
    (d, inverse)
}
