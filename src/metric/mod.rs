//! Who travels, and how fast in each direction.

mod sym2;

use glam::DVec2;

pub use self::sym2::Sym2;
use crate::{Control, GridFrame, HeightSurface, Result};

/// The offset `δ` of the curvature tensor, 1/m: how much a flat direction costs beside a curved one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Delta {
    /// This share of the root-mean-square curvature of the surface, so that scaling a terrain changes no route.
    Auto(f64),
    /// An absolute curvature in 1/m.
    Absolute(f64),
}

impl Default for Delta {
    fn default() -> Self {
        Self::Auto(0.1)
    }
}

/// A way of measuring distance on a surface.
#[derive(Clone, Debug, Default)]
pub enum Metric {
    /// Length on the surface, in metres: `D = G⁻¹`.
    #[default]
    Isotropic,
    /// The curvature tensor CT: `D = Σ 1/(δ+|κ_i|) w_i w_iᵀ`.
    Curvature(Delta),
    /// The user's own speed tensors `D` on the nodes of the terrain.
    Tensor(std::sync::Arc<Vec<Sym2>>),
}

/// Things that compose with every metric.
#[derive(Clone, Debug, Default)]
pub struct Modifiers {
    /// `β`: adds `β ∇z ∇zᵀ` to the metric `M`, an aversion to grade in units of the metric. Default 0.
    pub climb_weight: f64,
    /// Steepest slope that may be entered, in degrees. Default: any.
    pub max_slope_deg: Option<f64>,
    /// Nodes that may not be entered, row-major; empty for none.
    pub barrier: std::sync::Arc<Vec<bool>>,
}

/// A metric on a surface: the speed tensor `D` and its dual `M = D⁻¹` at every point.
#[derive(Clone, Debug)]
pub struct MetricField<'a> {
    surface: &'a HeightSurface,
}

impl Metric {
    /// Binds the metric to a surface.
    ///
    /// # Errors
    /// A `δ` that is not positive and finite, a raster of another size.
    pub fn on<'a>(
        &self,
        surface: &'a HeightSurface,
        modifiers: &Modifiers,
    ) -> Result<MetricField<'a>> {
        todo!()
    }
}

impl<'a> MetricField<'a> {
    /// The surface.
    #[must_use]
    pub fn surface(&self) -> &'a HeightSurface {
        self.surface
    }

    /// `isotropic`, `curvature` or `tensor`.
    #[must_use]
    pub fn name(&self) -> &str {
        todo!()
    }

    /// Unit of the distance: `m` for isotropic, `AG units` otherwise.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        todo!()
    }

    /// `δ` in 1/m, for the curvature tensor.
    #[must_use]
    pub fn delta(&self) -> Option<f64> {
        todo!()
    }

    /// Speed tensor `D` in ground axes at grid coordinates `at`.
    #[must_use]
    pub fn speed(&self, at: DVec2) -> Sym2 {
        todo!()
    }

    /// Whether the node may be entered.
    #[must_use]
    pub fn is_open(&self, col: usize, row: usize) -> bool {
        todo!()
    }

    /// Length under this metric of a polyline in grid coordinates.
    #[must_use]
    pub fn length(&self, line: &[DVec2]) -> f64 {
        todo!()
    }
}
