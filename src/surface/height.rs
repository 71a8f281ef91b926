//! The heightmap as a tensor-product B-spline `z(column, row)`.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::DVec2;
use rayon::prelude::*;

use super::fit::{Fit, Plan};
use super::voids::{fill, fit_finite};
use crate::{Control, Error, GridFrame, Result, Terrain};

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
    fn number(self) -> usize {
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
///
/// A tensor-product B-spline in grid coordinates; its derivatives are exact. They are taken along the
/// ground axes at the spacing of the row, as on the plane: where meridians converge, second derivatives
/// leave out a term of size `|∇z| tan(latitude)/R`, `R` the Earth's radius.
#[derive(Clone, Debug)]
pub struct HeightSurface {
    frame: GridFrame,
    fit: Fit,
    /// Row-major; empty if there are none.
    voids: Vec<bool>,
    residuals: Residuals,
    cutoff: Option<f64>,
}

impl HeightSurface {
    /// Fits a terrain. Voids have no weight.
    ///
    /// # Errors
    /// All void; a cut-off or tolerance that is not positive and finite; cancelled.
    pub fn fit(terrain: &Terrain, options: &FitOptions, control: &Control) -> Result<Self> {
        Self::fit_heights(terrain.frame().clone(), terrain.heights(), options, control)
    }

    /// Fits heights in metres, row-major from the north-west; those not finite are voids.
    pub(crate) fn fit_heights(
        frame: GridFrame,
        heights: &[f64],
        options: &FitOptions,
        control: &Control,
    ) -> Result<Self> {
        if let Smoothing::Cutoff(x) | Smoothing::CutoffCells(x) | Smoothing::Tolerance(x) =
            options.smoothing
            && !(x.is_finite() && x > 0.0)
        {
            return Err(Error::usage(format!(
                "{x} is no cut-off length or tolerance; it must be positive and finite"
            )));
        }
        if !heights.iter().any(|z| z.is_finite()) {
            return Err(Error::usage("all heights are void; there is no surface to fit"));
        }
        let cell = mean_cell(&frame);
        let degree = options.degree.number();
        let plan = match options.smoothing {
            Smoothing::Interpolate => Plan::every_node(&frame, degree),
            Smoothing::Cutoff(length) => Plan::smooth(&frame, degree, length),
            Smoothing::CutoffCells(cells) => Plan::smooth(&frame, degree, cells * cell),
            Smoothing::Auto => {
                Plan::smooth(&frame, degree, cross_validate(&frame, heights, degree, control)?)
            }
            Smoothing::Tolerance(rms) => fewest_knots(&frame, heights, degree, rms, control)?,
        };
        let fit = fit_finite(&frame, heights, &plan, control)?;
        let residuals = residuals(&frame, &fit, heights);
        let mut voids = Vec::new();
        if heights.iter().any(|z| !z.is_finite()) {
            voids.extend(heights.iter().map(|z| !z.is_finite()));
        }
        let cutoff = (plan.cutoff > 0.0).then_some(plan.cutoff);
        Ok(Self { frame, fit, voids, residuals, cutoff })
    }

    /// The grid of the terrain.
    #[must_use]
    pub fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// Height in metres at grid coordinates, clamped to the hull of the nodes.
    #[must_use]
    pub fn height(&self, at: DVec2) -> f64 {
        let [z] = self.fit.derivatives(self.frame.clamp(at), [[0, 0]]);
        z
    }

    /// Height and derivatives at grid coordinates, clamped to the hull of the nodes.
    #[must_use]
    pub fn jet(&self, at: DVec2) -> HeightJet {
        let at = self.frame.clamp(at);
        let orders = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]];
        ground_jet(self.frame.spacing(at.y).recip(), self.fit.derivatives(at, orders))
    }

    /// Third derivatives `[zxxx, zxxy, zxyy, zyyy]` in 1/m² along the ground axes at grid coordinates,
    /// clamped to the hull of the nodes. Those of a cubic surface jump at the knots.
    #[must_use]
    pub fn third_derivatives(&self, at: DVec2) -> [f64; 4] {
        let at = self.frame.clamp(at);
        let d = self.fit.derivatives(at, [[3, 0], [2, 1], [1, 2], [0, 3]]);
        let DVec2 { x, y } = self.frame.spacing(at.y).recip();
        [d[0] * x * x * x, -d[1] * x * x * y, d[2] * x * y * y, -d[3] * y * y * y]
    }

    /// Jets at all nodes of a row, into the first [`cols`](GridFrame::cols) of `jets`: much faster than
    /// one by one.
    pub fn row_jets(&self, row: usize, jets: &mut [HeightJet]) {
        let per_metre = self.frame.spacing(row as f64).recip();
        let jets = &mut jets[..self.frame.cols()];
        self.fit.row_derivatives(row, |col, d| jets[col] = ground_jet(per_metre, d));
    }

    /// Whether the node was a void of the terrain: the surface there is only a continuation.
    #[must_use]
    pub fn is_void(&self, col: usize, row: usize) -> bool {
        !self.voids.is_empty() && self.voids[self.frame.index(col, row)]
    }

    /// How far the surface lies from the heights that are not void.
    #[must_use]
    pub fn residuals(&self) -> Residuals {
        self.residuals
    }

    /// Cut-off wavelength in metres, the same in all of the grid; `None` for an interpolating or a
    /// tolerance fit.
    #[must_use]
    pub fn cutoff(&self) -> Option<f64> {
        self.cutoff
    }

    /// Number of coefficients, as many as knots: along columns times along rows.
    #[must_use]
    pub fn coefficients(&self) -> usize {
        self.fit.coefficients.len()
    }

    /// Root mean square of the principal curvatures, `√(mean (κ1² + κ2²)/2)` over the nodes that are not
    /// void, in 1/m.
    #[must_use]
    pub fn rms_curvature(&self) -> f64 {
        let cols = self.frame.cols();
        let row_sum = |jets: &mut Vec<HeightJet>, row: usize| {
            self.row_jets(row, jets);
            let valid = (0..cols).filter(|&col| !self.is_void(col, row));
            valid.fold((0.0, 0_usize), |(sum, count), col| {
                let [k1, k2] = jets[col].curvature().principal;
                (sum + k1 * k1 + k2 * k2, count + 1)
            })
        };
        let sums: Vec<_> = (0..self.frame.rows())
            .into_par_iter()
            .map_init(|| vec![HeightJet::default(); cols], row_sum)
            .collect();
        // Added row by row, so that the sum does not depend on the number of threads.
        let (sum, count) = sums.iter().fold((0.0, 0), |(s, n), (row, m)| (s + row, n + m));
        (sum / count as f64).sqrt() * FRAC_1_SQRT_2
    }
}

/// Derivatives per node `z_c, z_r, …` become those along east and north: `∂x = ∂c/Δx`, `∂y = −∂r/Δy`.
fn ground_jet(per_metre: DVec2, [z, c, r, cc, cr, rr]: [f64; 6]) -> HeightJet {
    let DVec2 { x, y } = per_metre;
    HeightJet { z, zx: c * x, zy: -r * y, zxx: cc * x * x, zxy: -cr * x * y, zyy: rr * y * y }
}

/// Side in metres of a square as large as a cell in the middle of the grid.
fn mean_cell(frame: &GridFrame) -> f64 {
    let DVec2 { x, y } = frame.mid_spacing();
    (x * y).sqrt()
}

/// Residuals of a fit over the finite heights.
fn residuals(frame: &GridFrame, fit: &Fit, heights: &[f64]) -> Residuals {
    let rows: Vec<(f64, usize, f64, usize)> = heights
        .par_chunks(frame.cols())
        .enumerate()
        .map_init(
            || vec![0.0; frame.cols()],
            |values, (row, heights)| {
                fit.row_values(row, values);
                let (mut sum, mut count, mut max, mut at) = (0.0, 0, 0.0, 0);
                for (col, (value, z)) in values.iter().zip(heights).enumerate() {
                    if z.is_finite() {
                        let residual = (value - z).abs();
                        sum += residual * residual;
                        count += 1;
                        if residual > max {
                            (max, at) = (residual, col);
                        }
                    }
                }
                (sum, count, max, at)
            },
        )
        .collect();
    // Added row by row, so that the sum does not depend on the number of threads.
    let (mut sum, mut count) = (0.0, 0);
    let mut residuals = Residuals::default();
    for (row, &(squares, valid, max, col)) in rows.iter().enumerate() {
        sum += squares;
        count += valid;
        if max > residuals.max {
            residuals.max = max;
            residuals.at = DVec2::new(col as f64, row as f64);
        }
    }
    residuals.rms = (sum / count as f64).sqrt();
    residuals
}

/// The plan with the fewest knots whose residuals have a root mean square of at most `rms`, by bisection.
fn fewest_knots(
    frame: &GridFrame,
    heights: &[f64],
    degree: usize,
    rms: f64,
    control: &Control,
) -> Result<Plan> {
    let quiet = Control { cancel: control.cancel.clone(), progress: None };
    let filled = fill(frame, heights, &Plan::every_node(frame, degree), &quiet)?;
    // Knots at every node interpolate, so the upper end always meets the tolerance.
    let (mut few, mut enough) = (0, frame.cols().max(frame.rows()) - 1);
    while few < enough {
        let middle = few.midpoint(enough);
        let plan = Plan::coarse(frame, degree, middle);
        let fit = Fit::new(frame, filled.clone(), &plan, &quiet)?;
        if residuals(frame, &fit, heights).rms <= rms {
            enough = middle;
        } else {
            few = middle + 1;
        }
    }
    Ok(Plan::coarse(frame, degree, enough))
}

/// The cut-off in metres with the least generalised cross-validation score (Craven and Wahba, Numer.
/// Math. 31, 1979)
///
/// ```text
///   GCV = N Σ(s − z)² / (N − tr A)² ,     tr A = tr A_x · tr A_y
/// ```
///
/// where `A = A_y ⊗ A_x` takes heights to fitted heights, a separable fit's trace being the product.
/// Lengths by powers of two from 2 cells to half the extent, then a golden section around the best.
fn cross_validate(
    frame: &GridFrame,
    heights: &[f64],
    degree: usize,
    control: &Control,
) -> Result<f64> {
    let quiet = Control { cancel: control.cancel.clone(), progress: None };
    let (frame, heights) = window(frame, heights)?;
    let cell = mean_cell(&frame);
    let filled = fill(&frame, &heights, &Plan::every_node(&frame, degree), &quiet)?;
    let valid = heights.iter().filter(|z| z.is_finite()).count() as f64;
    let score = |log_cells: f64| -> Result<f64> {
        let plan = Plan::smooth(&frame, degree, log_cells.exp2() * cell);
        let fit = Fit::new(&frame, filled.clone(), &plan, &quiet)?;
        let [x, y] = (plan.cutoff / frame.mid_spacing()).to_array();
        let freedom = valid * (1.0 - fit.x.trace(x) * fit.y.trace(y) / frame.nodes() as f64);
        let gcv = (residuals(&frame, &fit, &heights).rms * valid / freedom).powi(2);
        Ok(if freedom > 0.0 { gcv } else { f64::INFINITY })
    };
    let longest = (frame.cols().max(frame.rows()) as f64 / 2.0).log2().max(2.0) as usize;
    let mut best = (f64::INFINITY, 1.0);
    for log_cells in 1..=longest {
        let gcv = score(log_cells as f64)?;
        if gcv < best.0 {
            best = (gcv, log_cells as f64);
        }
    }
    let log_cells = golden_section(best.1 - 1.0, best.1 + 1.0, score)?;
    Ok(log_cells.exp2() * cell)
}

/// Where `f` is least between `low` and `high`, to 5 % of their distance.
fn golden_section(low: f64, high: f64, f: impl Fn(f64) -> Result<f64>) -> Result<f64> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (mut low, mut high) = (low, high);
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut values = [f(inner[0])?, f(inner[1])?];
    for _ in 0..6 {
        if values[0] <= values[1] {
            high = inner[1];
            inner = [high - GOLDEN * (high - low), inner[0]];
            values = [f(inner[0])?, values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + GOLDEN * (high - low)];
            values = [values[1], f(inner[1])?];
        }
    }
    Ok((low + high) / 2.0)
}

/// The part of at most 1024 × 1024 nodes, of nine spread over the grid, with the fewest voids.
fn window(frame: &GridFrame, heights: &[f64]) -> Result<(GridFrame, Vec<f64>)> {
    const SIDE: usize = 1024;
    let (cols, rows) = (frame.cols().min(SIDE), frame.rows().min(SIDE));
    let voids = |&(col, row): &(usize, usize)| {
        let lines = heights.chunks(frame.cols()).skip(row).take(rows);
        lines.flat_map(|line| &line[col..col + cols]).filter(|z| !z.is_finite()).count()
    };
    // The middle first: it wins ties.
    let thirds = |nodes: usize, side: usize| [1, 0, 2].map(|i| i * (nodes - side) / 2);
    let (col, row) = thirds(frame.rows(), rows)
        .into_iter()
        .flat_map(|row| thirds(frame.cols(), cols).map(|col| (col, row)))
        .min_by_key(voids)
        .expect("nine places");
    let corner = frame.to_map(DVec2::new(col as f64, row as f64));
    let part = GridFrame::new(cols, rows, corner, frame.step(), frame.ground())?;
    let lines = heights.chunks(frame.cols()).skip(row).take(rows);
    Ok((part, lines.flat_map(|line| &line[col..col + cols]).copied().collect()))
}
