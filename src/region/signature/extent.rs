//! How large a region is and how strongly it bends.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use super::labelled_surface::{Run, Sum};
use crate::linalg::simd::Kernel;
use crate::metric::PLANE_BEND;
use crate::surface::{BLOCK, Forms};

/// `δ` as a share of the root-mean-square curvature of the region. That of the metric, 0.1, makes peaks of `C` along the lines
/// where a curvature changes its sign, which few grids resolve. Of 54 parts of seven shapes, each sampled two to six
/// ways, the number whose nearest signature is one of the same part: 39 with 0.1, 48 with 0.5, 51 with 1, 54 with 2, 51 with 4.
const DELTA_SHARE: f64 = 2.0;

/// Area of a region and the integral of `(κ1² + κ2²)/2` over it.
#[derive(Clone, Copy, Default)]
pub(super) struct Extent {
    area: f64,
    squared_curvature: f64,
}

/// The scales that a region's signature is measured in.
#[derive(Clone, Copy)]
pub(super) struct Size {
    /// `√area`, m.
    pub(super) side: f64,
    /// Offset of its curvature tensor, 1/m.
    pub(super) delta: f64,
    /// Whether it bends no more than rounded heights of a plane do: then nothing varies in it.
    pub(super) is_flat: bool,
}

impl Extent {
    pub(super) fn size(&self) -> Size {
        let side = self.area.sqrt();
        let rms = (self.squared_curvature / self.area).sqrt();
        // As for a whole surface, see `Delta`.
        let is_flat = rms.is_nan() || rms * side <= PLANE_BEND;
        let delta = if is_flat { side.recip() } else { DELTA_SHARE * rms };
        Size { side, delta, is_flat }
    }
}

impl Sum for Extent {
    fn add(&mut self, other: &Self) {
        self.area += other.area;
        self.squared_curvature += other.squared_curvature;
    }
}

/// What each node adds.
pub(super) struct Extents<'a> {
    pub(super) run: &'a Run<'a>,
    pub(super) extents: &'a mut [Extent; BLOCK],
}

impl Kernel for Extents<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { run, extents } = self;
        for i in 0..BLOCK {
            let jet = run.jets.get(i);
            let Forms { mean, gaussian, .. } = jet.forms();
            let area = if jet.is_regular() { jet.area() } else { 0.0 };
            let square = area * (2.0 * mean * mean - gaussian);
            let squared_curvature = if area > 0.0 { square } else { 0.0 };
            extents[i] = Extent { area, squared_curvature };
        }
    }
}
