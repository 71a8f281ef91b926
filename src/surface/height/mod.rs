//! The heightmap as a tensor-product B-spline `z(column, row)`.

mod options;
mod unrolled;

use std::f64::consts::FRAC_1_SQRT_2;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

pub use self::options::{Degree, FitOptions, Smoothing};
use self::unrolled::Unrolled;
use super::bspline::block::{BLOCK, HeightBlock};
use super::bspline::fit::Fit;
use super::bspline::knots::FitPlan;
use super::bspline::residuals::{Residuals, residuals};
use super::bspline::selection::{cross_validate, fewest_knots, mean_cell};
use super::bspline::voids::fit_finite;
use super::curvature::BlockSums;
use super::measures::{Measures, share};
use super::{Block, HeightJet, Jet, JetBlock, Surface};
use crate::control::Control;
use crate::error::{Error, Result};
use crate::grid::GridFrame;
use crate::linalg::simd;
use crate::memory;
use crate::terrain::Terrain;

/// A smooth surface `z` over the grid of a terrain.
///
/// A tensor-product B-spline in grid coordinates; its derivatives are exact. They are taken along the
/// ground axes at the spacing of the row, as on the plane: where meridians converge, second derivatives
/// leave out a term of size `|∇z| tan(latitude)/R`, `R` the Earth's radius. Where the grid goes around the Earth, so does the
/// surface.
#[derive(Clone, Debug)]
pub struct HeightSurface {
    frame: GridFrame,
    /// Nodes per metre of each row, along and across it.
    per_metre: Vec<DVec2>,
    /// The same half-way to the next row.
    per_metre_between: Vec<DVec2>,
    fit: Fit,
    /// Columns of the fit before the first of the grid.
    margin: usize,
    /// Row-major; empty if there are none.
    voids: Vec<bool>,
    residuals: Residuals,
    cutoff: Option<f64>,
}

impl HeightSurface {
    /// Fits a terrain. Into voids the surface goes on for a few cells, and ends there as it does at the border of the grid; time
    /// goes by the heights that are not void.
    ///
    /// # Errors
    /// [`Error::Argument`] if all heights are void, or a cut-off or tolerance is not positive and finite; [`Error::Cancelled`].
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
            return Err(Error::argument(
                "the cut-off length or tolerance",
                x,
                "positive and finite",
            ));
        }
        if !heights.iter().any(|z| z.is_finite()) {
            return Err(Error::argument("the number of heights that are not void", 0, "1 or more"));
        }
        if frame.is_periodic() {
            let Unrolled { frame: wide, heights: mut repeated, margin } =
                Unrolled::new(&frame, heights)?;
            let (fit, cutoff) = fit_as_told(&wide, &repeated, options, control)?;
            Unrolled::void_margins(&mut repeated, wide.cols(), margin);
            let mut residuals = residuals(&wide, &fit, &repeated);
            residuals.at.x -= margin as f64;
            return Ok(Self::new(frame, heights, fit, margin, residuals, cutoff));
        }
        let (fit, cutoff) = fit_as_told(&frame, heights, options, control)?;
        let residuals = residuals(&frame, &fit, heights);
        Ok(Self::new(frame, heights, fit, 0, residuals, cutoff))
    }

    fn new(
        frame: GridFrame,
        heights: &[f64],
        fit: Fit,
        margin: usize,
        residuals: Residuals,
        cutoff: Option<f64>,
    ) -> Self {
        let mut voids = Vec::new();
        if !heights.par_iter().all(|z| z.is_finite()) {
            voids.extend(heights.iter().map(|z| !z.is_finite()));
        }
        let per_metre = |by: f64| {
            let row = move |row: usize| row as f64 + by;
            (0..frame.rows()).map(|i| frame.spacing(row(i)).recip()).collect::<Vec<_>>()
        };
        let (per_metre, per_metre_between) = (per_metre(0.0), per_metre(0.5));
        Self { frame, per_metre, per_metre_between, fit, margin, voids, residuals, cutoff }
    }

    /// The grid of the terrain.
    #[must_use]
    pub fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// Height in metres at grid coordinates, clamped to the hull of the nodes; not a number far from all heights.
    #[must_use]
    pub fn height(&self, at: DVec2) -> f64 {
        let [z] = self.derivatives(self.frame.clamp(at), [[0, 0]]);
        z
    }

    /// See [`Fit::derivatives`].
    fn derivatives<const K: usize>(&self, at: DVec2, orders: [[usize; 2]; K]) -> [f64; K] {
        self.fit.derivatives(at + DVec2::new(self.margin as f64, 0.0), orders)
    }

    /// Height and derivatives at grid coordinates, clamped to the hull of the nodes; not numbers far from all heights.
    #[must_use]
    pub fn jet(&self, at: DVec2) -> HeightJet {
        let at = self.frame.clamp(at);
        let orders = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]];
        ground_jet(self.frame.spacing(at.y).recip(), self.derivatives(at, orders))
    }

    /// Third derivatives `[zxxx, zxxy, zxyy, zyyy]` in 1/m² along the ground axes at grid coordinates,
    /// clamped to the hull of the nodes. Those of a cubic surface jump at the knots.
    #[must_use]
    pub fn third_derivatives(&self, at: DVec2) -> [f64; 4] {
        let at = self.frame.clamp(at);
        let d = self.derivatives(at, [[3, 0], [2, 1], [1, 2], [0, 3]]);
        let DVec2 { x, y } = self.frame.spacing(at.y).recip();
        [d[0] * x * x * x, -d[1] * x * x * y, d[2] * x * y * y, -d[3] * y * y * y]
    }

    /// Jets at all nodes of a row, into the first [`cols`](GridFrame::cols) of `jets`: much faster than
    /// one by one. Those of voids mean nothing, and are 0 far from all heights.
    ///
    /// # Panics
    /// If `jets` is shorter than a row, or there is no such row.
    pub fn row_jets(&self, row: usize, jets: &mut [HeightJet]) {
        let mut block = HeightBlock::default();
        let known = self.fit.domain.nodes_at(row, self.fit.x.nodes.len());
        for (i, jets) in jets[..self.frame.cols()].chunks_mut(BLOCK).enumerate() {
            let first = self.margin + i * BLOCK;
            let end = first + jets.len();
            if !known.iter().any(|run| run.start < end && run.end > first) {
                jets.fill(HeightJet::default());
                continue;
            }
            self.fit.jets(&self.per_metre, first, row..row + 1, false, &mut block);
            for (i, jet) in jets.iter_mut().enumerate() {
                *jet = block.jet(0, i);
            }
        }
    }

    /// Whether the node was a void of the terrain: the surface there is only a continuation, of a few cells.
    #[must_use]
    pub fn is_void(&self, col: usize, row: usize) -> bool {
        self.has_voids() && self.voids[self.frame.index(col, row)]
    }

    /// Whether any node was a void of the terrain.
    #[must_use]
    pub fn has_voids(&self) -> bool {
        !self.voids.is_empty()
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
        self.measures().rms_curvature
    }

    /// Sums over the nodes of a band of [`BLOCK`] rows that are not void: of `κ1² + κ2²`, of the area, and their number.
    fn band_sums(&self, band: usize) -> ([f64; 2], usize) {
        let (cols, rows) = (self.frame.cols(), self.frame.rows());
        let (first, mut jets) = (band * BLOCK, HeightBlock::default());
        let (mut sums, mut count) = ([0.0; 2], 0);
        for col in (0..cols).step_by(BLOCK) {
            let before = count;
            let mut map_areas = [[0.0; BLOCK]; BLOCK];
            for (row, map_areas) in (first..rows).zip(&mut map_areas) {
                let cell = share(row, rows, false) / self.per_metre[row].element_product();
                for (col, map_area) in (col..cols).zip(map_areas) {
                    if !self.is_void(col, row) {
                        *map_area = share(col, cols, self.frame.is_periodic()) * cell;
                        count += 1;
                    }
                }
            }
            if count == before {
                continue;
            }
            let band = first..rows.min(first + BLOCK);
            self.fit.jets(&self.per_metre, self.margin + col, band, false, &mut jets);
            let [square, area] = simd::dispatch(BlockSums { jets: &jets, map_areas: &map_areas });
            sums = [sums[0] + square, sums[1] + area];
        }
        (sums, count)
    }
}

/// Ground axes in space: x east, y north, z up, metres.
impl Surface for HeightSurface {
    fn cols(&self) -> usize {
        self.frame.cols()
    }

    fn rows(&self) -> usize {
        self.frame.rows()
    }

    fn jet(&self, at: DVec2) -> Jet {
        Jet::Height(self.jet(at))
    }

    fn periodic(&self) -> [bool; 2] {
        [self.frame.is_periodic(), false]
    }

    fn is_void(&self, col: usize, row: usize) -> bool {
        self.is_void(col, row)
    }

    fn has_voids(&self) -> bool {
        self.has_voids()
    }

    fn axes(&self, row: f64) -> DVec2 {
        self.frame.spacing(row) * DVec2::new(1.0, -1.0)
    }

    fn frame(&self) -> Option<&GridFrame> {
        Some(&self.frame)
    }

    fn point(&self, at: DVec2) -> DVec3 {
        self.frame.to_map(at).extend(self.height(at))
    }

    fn block_jets(&self, block: &Block, jets: &mut JetBlock) {
        let (col, rows) = (self.margin + block.cols.start, block.rows.clone());
        let per_metre = if block.centres { &self.per_metre_between } else { &self.per_metre };
        self.fit.jets(per_metre, col, rows, block.centres, jets.heights_mut());
    }

    /// Means go by the nodes of the map; the extent is the diagonal of the grid.
    fn measures(&self) -> Measures {
        let bands = 0..self.frame.rows().div_ceil(BLOCK);
        let bands: Vec<_> = bands.into_par_iter().map(|band| self.band_sums(band)).collect();
        // Added band by band, so that the sums do not depend on the number of threads.
        let ([square, area], count) = bands.iter().fold(([0.0; 2], 0), |(sums, n), (band, m)| {
            ([sums[0] + band[0], sums[1] + band[1]], n + m)
        });
        let cells = DVec2::new(self.frame.cols() as f64, self.frame.rows() as f64);
        Measures {
            area,
            rms_curvature: (square / count as f64).sqrt() * FRAC_1_SQRT_2,
            extent: (self.frame.mid_spacing() * cells).length(),
        }
    }
}

/// The fit that the options ask for, and its cut-off wavelength in metres if it has one.
fn fit_as_told(
    frame: &GridFrame,
    heights: &[f64],
    options: &FitOptions,
    control: &Control,
) -> Result<(Fit, Option<f64>)> {
    let cell = mean_cell(frame);
    let degree = options.degree.number();
    let plan = match options.smoothing {
        Smoothing::Interpolate => FitPlan::every_node(frame, degree),
        Smoothing::Cutoff(length) => FitPlan::smooth(frame, degree, length),
        Smoothing::CutoffCells(cells) => FitPlan::smooth(frame, degree, cells * cell),
        Smoothing::Auto => {
            FitPlan::smooth(frame, degree, cross_validate(frame, heights, degree, control)?)
        }
        Smoothing::Tolerance(rms) => fewest_knots(frame, heights, degree, rms, control)?,
    };
    let what = format!("a surface over {} × {} cells", frame.cols(), frame.rows());
    memory::check(what, fit_bytes(frame, heights, &plan))?;
    let fit = fit_finite(frame, heights, &plan, control)?;
    Ok((fit, (plan.cutoff > 0.0).then_some(plan.cutoff)))
}

/// About what a fit takes beyond the heights: coefficients, with pointers to pieces of their rows; around voids also filled heights, and before
/// that continuations of rows and columns with their weights.
fn fit_bytes(frame: &GridFrame, heights: &[f64], plan: &FitPlan) -> u64 {
    const COEFFICIENT: usize = 10;
    const AROUND_VOIDS: usize = 26;
    let coefficients = frame.rows() * (plan.intervals[0] + plan.degree);
    let has_voids = heights.par_iter().any(|z| !z.is_finite());
    let [filled, continued] = if has_voids { [8, AROUND_VOIDS] } else { [0, 0] };
    (frame.nodes() * continued).max(frame.nodes() * filled + coefficients * COEFFICIENT) as u64
}

/// Derivatives per node `z_c, z_r, …` become those along east and north: `∂x = ∂c/Δx`, `∂y = −∂r/Δy`.
fn ground_jet(per_metre: DVec2, [z, c, r, cc, cr, rr]: [f64; 6]) -> HeightJet {
    let DVec2 { x, y } = per_metre;
    HeightJet { z, zx: c * x, zy: -r * y, zxx: cc * x * x, zxy: -cr * x * y, zyy: rr * y * y }
}

#[cfg(test)]
mod tests;
