//! What surface to fit.

/// Degree of the B-spline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Degree {
    /// Cubic: continuous second derivatives, so a continuous curvature.
    #[default]
    Cubic,
    /// Quintic: continuous fourth derivatives.
    Quintic,
}

impl Degree {
    pub(super) fn number(self) -> usize {
        match self {
            Self::Cubic => 3,
            Self::Quintic => 5,
        }
    }
}

/// How closely the surface follows the heights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Smoothing {
    /// Through every height.
    Interpolate,
    /// Waves of this length `L` in metres keep half their amplitude, shorter ones less: waves of length
    /// `ℓ` along a row or a column keep `1/(1 + (L/ℓ)⁶)`. Polynomials of degree 2 are kept whole.
    Cutoff(f64),
    /// The same with the length in cells, whose side is `√(width · height)` in the middle of the grid.
    CutoffCells(f64),
    /// Cut-off chosen by generalised cross-validation, which takes what is not correlated between
    /// neighbouring heights for noise. Judged on at most 1024 × 1024 nodes.
    Auto,
    /// As few equally spaced knots as keep the root-mean-square residual under this many metres; no
    /// other smoothing.
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
    /// Default cut-off wavelength in cells, chosen by how well curvature routes retrace three real mountain
    /// roads on a 75 m SRTM grid: share of each road within 200 m of the route, mean over the roads, `δ` 0.1 of the
    /// root-mean-square curvature (0.26 for geodesics at any cut-off; `docs/mathematics.md` has the table).
    ///
    /// | cut-off in cells | 0 | 4 | 6 | 8 | 10 | 12 | 16 | 24 |
    /// |---|---|---|---|---|---|---|---|---|
    /// | share | 0.34 | 0.48 | 0.49 | 0.37 | 0.38 | 0.40 | 0.37 | 0.31 |
    /// | RMS residual, m | 0 | 3 | 7 | 11 | 16 | 21 | 31 | 51 |
    ///
    /// It also takes the noise out of heights rounded to a metre, whose second differences are noise alone.
    pub const DEFAULT_CUTOFF_CELLS: f64 = 6.0;
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            degree: Degree::Cubic,
            smoothing: Smoothing::CutoffCells(Self::DEFAULT_CUTOFF_CELLS),
        }
    }
}
