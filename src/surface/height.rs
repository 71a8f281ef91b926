//! The heightmap as a tensor-product B-spline `z(column, row)`.

use glam::DVec2;

use crate::{Control, GridFrame, Result, Terrain};

/// Degree of the B-spline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Degree {
    /// Cubic: continuous second derivatives, so a continuous curvature.
    #[default]
    Cubic,
    /// Quintic: continuous fourth derivatives.
    Quintic,
}

/// How closely the surface follows the heights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Smoothing {
    /// Through every height.
    Interpolate,
    /// Waves of this length in metres keep half their amplitude, shorter ones less.
    Cutoff(f64),
    /// The same with the length in cells.
    CutoffCells(f64),
    /// Cut-off chosen by generalised cross-validation.
    Auto,
    /// As few knots as keep the root-mean-square residual under this many metres.
    Tolerance(f64),
}

/// What surface to fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions {
    /// Default: cubic.
    pub degree: Degree,
    /// Default: [`FitOptions::DEFAULT_CUTOFF_CELLS`].
    pub smoothing: Smoothing,
}

impl FitOptions {
    /// Default cut-off wavelength in cells.
    pub const DEFAULT_CUTOFF_CELLS: f64 = 16.0;
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            degree: Degree::Cubic,
            smoothing: Smoothing::CutoffCells(Self::DEFAULT_CUTOFF_CELLS),
        }
    }
}

/// Height and its derivatives at one point, in metres, along the ground axes: `x` east, `y` **north**.
///
/// The third derivatives are those of a quintic surface, and piecewise constants of a cubic one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeightJet {
    /// Height, m.
    pub z: f64,
    /// `∂z/∂x`.
    pub zx: f64,
    /// `∂z/∂y`.
    pub zy: f64,
    /// `∂²z/∂x²`, 1/m.
    pub zxx: f64,
    /// `∂²z/∂x∂y`, 1/m.
    pub zxy: f64,
    /// `∂²z/∂y²`, 1/m.
    pub zyy: f64,
}

/// How far the surface lies from the heights it was fitted to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residuals {
    /// Root mean square, m.
    pub rms: f64,
    /// Largest, m.
    pub max: f64,
    /// Where the largest is, in grid coordinates.
    pub at: DVec2,
}

/// A smooth surface `z` over the grid of a terrain.
#[derive(Clone, Debug)]
pub struct HeightSurface {
    frame: GridFrame,
}

impl HeightSurface {
    /// Fits a terrain.
    ///
    /// # Errors
    /// All void; a cut-off or tolerance that is not positive and finite; cancelled.
    pub fn fit(terrain: &Terrain, options: &FitOptions, control: &Control) -> Result<Self> {
        todo!()
    }

    /// The grid of the terrain.
    #[must_use]
    pub fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// Height in metres at grid coordinates, clamped to the hull of the nodes.
    #[must_use]
    pub fn height(&self, at: DVec2) -> f64 {
        todo!()
    }

    /// Height and derivatives at grid coordinates, clamped to the hull of the nodes.
    #[must_use]
    pub fn jet(&self, at: DVec2) -> HeightJet {
        todo!()
    }

    /// Jets at all nodes of a row: much faster than one by one.
    pub fn row_jets(&self, row: usize, jets: &mut [HeightJet]) {
        todo!()
    }

    /// Whether the node was a void of the terrain: the surface there is only a continuation.
    #[must_use]
    pub fn is_void(&self, col: usize, row: usize) -> bool {
        todo!()
    }

    /// How far the surface lies from the heights.
    #[must_use]
    pub fn rms_curvature(&self) -> f64 {
        todo!()
    }

    /// How far the surface lies from the heights.
    #[must_use]
    pub fn residuals(&self) -> Residuals {
        todo!()
    }

    /// Cut-off wavelength in metres in the middle of the grid; `None` for an interpolating or a tolerance fit.
    #[must_use]
    pub fn cutoff(&self) -> Option<f64> {
        todo!()
    }
}
