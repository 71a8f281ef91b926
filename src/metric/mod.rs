//! Who travels, and how fast in each direction.
//!
//! A metric gives at every point a symmetric positive definite *speed tensor* `D`, in ground axes
//! (x east, y north, metres). Its dual `M = D⁻¹` measures: a small step `v` costs `√(vᵀ M v)`. Large `D` =
//! fast = short. Eigenvalues of `D` are squared speeds.
//!
//! | metric | `D` | unit of the distance |
//! |---|---|---|
//! | [`Metric::Isotropic`] | `G⁻¹`, the inverse first fundamental form | m |
//! | [`Metric::Curvature`] | `Σ 1/(δ+\|κ_i\|) w_i w_iᵀ` (Seong, Jeong, Cohen 2008, equation 4) | AG units, `m·√(1/m)` |
//! | [`Metric::Difference`] | `Σ 1/(δ+γ_i) q_i q_iᵀ` (equations 5 and 6) | AG units, `m` |
//! | [`Metric::Tensor`] | the user's | units of the tensor |
//!
//! On the curvature metric a step along a direction of high normal curvature is dear, so routes turn
//! away from changing slopes and follow valleys, ridges and hillsides. On the difference metric a step is dear where the
//! curvature changes along it, so distances are short within a part of even shape and long from one part to the next.

mod block;
mod curvature;
mod difference;
mod space;

use std::sync::Arc;

use glam::DVec2;
use rayon::prelude::*;

pub(crate) use self::block::SpeedBlock;
pub(crate) use self::curvature::of_surface;
pub use self::difference::{Change, Difference, DifferenceForm};
pub use self::space::SurfaceMetric;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::linalg::Sym2;
use crate::surface::BLOCK;
use crate::surface::{HeightJet, HeightSurface, ParametricSurface};

/// What bends by no more than this, as curvature times extent, is a plane. A plane of 4000² cells of 30 m with heights in `f32` is fitted,
/// by the defaults, with 5e-4 of rounding.
pub(crate) const PLANE_BEND: f64 = 1e-3;

/// The offset `δ` of the curvature tensor, 1/m: the cost of a flat direction beside a curved one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Delta {
    /// This share of the root-mean-square curvature of the surface. Scaling a terrain then scales `D` by a
    /// constant and changes no route. On a plane `1/extent` instead: any `δ` gives the same routes there. A plane
    /// is what bends by less than 1e-3 over its extent: heights of four bytes make no better one.
    Auto(f64),
    /// An absolute curvature in 1/m.
    Absolute(f64),
}

impl Delta {
    /// Default share of the root-mean-square curvature.
    pub const DEFAULT_SHARE: f64 = 0.1;

    /// The offset on a surface of this root-mean-square curvature and length.
    fn resolve(self, rms_curvature: impl FnOnce() -> f64, extent: f64) -> Result<f64> {
        let check = |value: f64, what: &str| {
            if value.is_finite() && value > 0.0 {
                Ok(value)
            } else {
                Err(Error::usage(format!("{what} is {value}; it must be positive and finite")))
            }
        };
        match self {
            Self::Absolute(delta) => check(delta, "delta"),
            Self::Auto(share) => {
                let share = check(share, "the share of the curvature that delta is to be")?;
                let rms = rms_curvature();
                Ok(if rms * extent > PLANE_BEND { share * rms } else { extent.recip() })
            }
        }
    }
}

impl Default for Delta {
    fn default() -> Self {
        Self::Auto(Self::DEFAULT_SHARE)
    }
}

/// Length of the grid's diagonal, m.
fn extent(surface: &HeightSurface) -> f64 {
    let frame = surface.frame();
    (frame.mid_spacing() * DVec2::new(frame.cols() as f64, frame.rows() as f64)).length()
}

/// A way of measuring distance on a surface.
#[derive(Clone, Debug, Default)]
pub enum Metric {
    /// Length on the surface, in metres: `D = G⁻¹`.
    #[default]
    Isotropic,
    /// The curvature tensor CT: `D = Σ 1/(δ+|κ_i|) w_i w_iᵀ`.
    Curvature(Delta),
    /// The difference curvature tensor DC: `D = Σ 1/(δ+γ_i) q_i q_iᵀ`, from how CT changes. Computed at the nodes when the
    /// metric is bound; between them `D` is bilinear.
    Difference(Difference),
    /// The user's own speed tensors `D` at the nodes, row-major from the north-west, in ground axes
    /// (x east, y north); on a [`ParametricSurface`] in grid coordinates (column, row). A node whose tensor is not finite is a barrier. Between nodes `D` is bilinear.
    Tensor(Arc<[Sym2]>),
}

/// What composes with every metric.
#[derive(Clone, Debug, Default)]
pub struct Modifiers {
    /// `β ≥ 0`: adds `β ∇z ∇zᵀ` to the metric `M`, an aversion to grade. On the isotropic metric a grade `s` then costs
    /// `√(1 + s² + β s²)` per plan metre. Default 0.
    pub climb_weight: f64,
    /// Steepest ground that may be entered, degrees. Default: any.
    pub max_slope_deg: Option<f64>,
    /// Nodes that may not be entered, row-major from the north-west. Default: none.
    pub barrier: Option<Arc<[bool]>>,
    /// Cost of the ground at the nodes, row-major from the north-west: a factor above 0 on the length of every step, so
    /// `D` is divided by its square. A node whose cost is not finite is a barrier. Between nodes it is bilinear. The largest
    /// may be 1000 times the smallest.
    /// Default: 1 everywhere.
    pub cost: Option<Arc<[f32]>>,
}

/// A metric bound to a surface: the speed tensor `D` everywhere, and where one may go.
#[derive(Clone, Debug)]
pub struct MetricField<'a> {
    surface: &'a HeightSurface,
    speed: Speed,
    climb_weight: f64,
    cost: Option<Arc<[f32]>>,
    /// Row-major; empty if all are open.
    open: Vec<bool>,
}

#[derive(Clone, Debug)]
enum Speed {
    Isotropic,
    Curvature {
        delta: f64,
    },
    Difference {
        form: DifferenceForm,
        curvature_delta: f64,
        delta: f64,
        /// `D` and `γ1 γ2` at the nodes.
        nodes: Arc<(Vec<Sym2>, Vec<f64>)>,
    },
    Tensor(Arc<[Sym2]>),
}

impl Speed {
    /// The tensors at the nodes, where it is known by them.
    fn tensors(&self) -> Option<&[Sym2]> {
        match self {
            Self::Isotropic | Self::Curvature { .. } => None,
            Self::Difference { nodes, .. } => Some(&nodes.0),
            Self::Tensor(tensors) => Some(tensors),
        }
    }

    /// `γ1 γ2` at the nodes, row-major, on the difference metric.
    fn gamma_products(&self) -> Option<&[f64]> {
        match self {
            Self::Difference { nodes, .. } => Some(&nodes.1),
            _ => None,
        }
    }

    /// `δ` of the curvature tensor, 1/m.
    fn delta(&self) -> Option<f64> {
        match *self {
            Self::Curvature { delta } => Some(delta),
            Self::Difference { curvature_delta, .. } => Some(curvature_delta),
            Self::Isotropic | Self::Tensor(_) => None,
        }
    }
}

impl Metric {
    /// Binds the metric to a surface. Voids of the surface are barriers.
    ///
    /// # Errors
    /// A `δ`, climb weight or slope out of range; a raster whose size is not the surface's; a tensor that
    /// is finite but not positive definite; a cost that is finite but not positive, or costs too far apart; cancelled.
    pub fn on<'a>(
        &self,
        surface: &'a HeightSurface,
        modifiers: &Modifiers,
        control: &Control,
    ) -> Result<MetricField<'a>> {
        let speed = match self {
            Self::Isotropic => Speed::Isotropic,
            Self::Curvature(delta) => {
                let delta = delta.resolve(|| surface.rms_curvature(), extent(surface))?;
                Speed::Curvature { delta }
            }
            Self::Difference(difference) => {
                let frame = surface.frame();
                let ground = |row: usize| frame.spacing(row as f64) * DVec2::new(1.0, -1.0);
                let scale = (surface.rms_curvature(), extent(surface));
                difference.speed(surface, scale, ground, control)?
            }
            Self::Tensor(tensors) => {
                check_tensors(surface, tensors)?;
                Speed::Tensor(Arc::clone(tensors))
            }
        };
        let climb_weight = modifiers.climb_weight;
        if !(climb_weight.is_finite() && climb_weight >= 0.0) {
            return Err(Error::usage(format!(
                "the climb weight is {climb_weight}; it must be 0 or more"
            )));
        }
        let cost = modifiers.cost.clone();
        if let Some(cost) = &cost {
            check_costs(surface, cost)?;
        }
        let open = open_nodes(surface, &speed, modifiers)?;
        Ok(MetricField { surface, speed, climb_weight, cost, open })
    }
}

fn check_costs(surface: &HeightSurface, costs: &[f32]) -> Result<()> {
    let frame = surface.frame();
    if costs.len() != frame.nodes() {
        return Err(Error::usage(format!(
            "the cost raster has {} cells, the terrain {}; they must cover the same grid",
            costs.len(),
            frame.nodes()
        )));
    }
    if let Some(i) = costs.iter().position(|cost| cost.is_finite() && *cost <= 0.0) {
        return Err(Error::usage(format!(
            "the cost {} at column {}, row {} is not above 0 (use NaN or nodata for barriers)",
            costs[i],
            i % frame.cols(),
            i / frame.cols()
        )));
    }
    let (least, most) = costs
        .iter()
        .filter(|cost| cost.is_finite())
        .fold((f32::INFINITY, 0f32), |(least, most), &cost| (least.min(cost), most.max(cost)));
    if most > MOST_COST_RATIO * least {
        return Err(Error::usage(format!(
            "the costs run from {least} to {most}; more than 1 to {MOST_COST_RATIO} cannot be computed with \
             (use NaN or nodata for barriers)"
        )));
    }
    Ok(())
}

/// The solver keeps `det D`, which goes with the fourth power of the cost, within 1e±15 of what is typical.
const MOST_COST_RATIO: f32 = 1000.0;

fn check_tensors(surface: &dyn ParametricSurface, tensors: &[Sym2]) -> Result<()> {
    let (cols, rows) = (surface.cols(), surface.rows());
    if tensors.len() != cols * rows {
        return Err(Error::usage(format!(
            "the tensor raster has {} cells, the surface {cols} columns × {rows} rows; they must cover the same grid",
            tensors.len()
        )));
    }
    let finite = |d: &Sym2| d.xx.is_finite() && d.xy.is_finite() && d.yy.is_finite();
    match tensors.iter().position(|d| finite(d) && !d.is_positive_definite()) {
        None => Ok(()),
        Some(i) => {
            let d = tensors[i];
            Err(Error::usage(format!(
                "the tensor D = [{} {}; {} {}] at column {}, row {} is not positive definite; every speed \
                 tensor needs D11 > 0 and D11·D22 > D12² (use NaN for barriers)",
                d.xx,
                d.xy,
                d.xy,
                d.yy,
                i % cols,
                i / cols
            )))
        }
    }
}

fn open_nodes(surface: &HeightSurface, speed: &Speed, modifiers: &Modifiers) -> Result<Vec<bool>> {
    let frame = surface.frame();
    let barrier = modifiers.barrier.as_deref();
    if let Some(barrier) = barrier
        && barrier.len() != frame.nodes()
    {
        return Err(Error::usage(format!(
            "the barrier has {} cells, the terrain {}",
            barrier.len(),
            frame.nodes()
        )));
    }
    let steepest = match modifiers.max_slope_deg {
        Some(degrees) if degrees > 0.0 && degrees <= 90.0 => Some(degrees.to_radians().tan()),
        Some(degrees) => {
            return Err(Error::usage(format!(
                "the steepest slope is {degrees}°; it must lie between 0 and 90"
            )));
        }
        None => None,
    };
    let all_open = !surface.has_voids()
        && barrier.is_none()
        && steepest.is_none()
        && modifiers.cost.is_none()
        && speed.tensors().is_none();
    if all_open {
        return Ok(Vec::new());
    }
    let mut open = vec![true; frame.nodes()];
    open.par_chunks_mut(frame.cols()).enumerate().for_each(|(row, open)| {
        let too_steep = |jet: &HeightJet, limit: f64| jet.zx.hypot(jet.zy) > limit;
        let jets = steepest.map(|limit| {
            let mut jets = vec![HeightJet::default(); frame.cols()];
            surface.row_jets(row, &mut jets);
            (jets, limit)
        });
        for (col, open) in open.iter_mut().enumerate() {
            let i = frame.index(col, row);
            *open = !surface.is_void(col, row)
                && !barrier.is_some_and(|b| b[i])
                && modifiers.cost.as_ref().is_none_or(|cost| cost[i].is_finite())
                && !jets.as_ref().is_some_and(|(jets, limit)| too_steep(&jets[col], *limit))
                && speed.tensors().is_none_or(|d| d[i].is_positive_definite());
        }
    });
    Ok(open)
}

impl<'a> MetricField<'a> {
    /// The surface.
    #[must_use]
    pub fn surface(&self) -> &'a HeightSurface {
        self.surface
    }

    /// `isotropic`, `curvature`, `difference`, `difference-literal` or `tensor`.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self.speed {
            Speed::Isotropic => "isotropic",
            Speed::Curvature { .. } => "curvature",
            Speed::Difference { form: DifferenceForm::Rate, .. } => "difference",
            Speed::Difference { form: DifferenceForm::Literal, .. } => "difference-literal",
            Speed::Tensor(_) => "tensor",
        }
    }

    /// Unit of the distance: `m` for isotropic without climb weight and cost, `AG units` (anisotropic geodesic)
    /// otherwise. For the curvature metric an AG unit is `m·√(1/m)`, for the difference metric `m`, for its literal form `m²`.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        match self.speed {
            Speed::Isotropic if self.climb_weight == 0.0 && self.cost.is_none() => "m",
            _ => "AG units",
        }
    }

    /// `δ` in 1/m of the curvature tensor, also of the one whose changes make the difference tensor.
    #[must_use]
    pub fn delta(&self) -> Option<f64> {
        self.speed.delta()
    }

    /// `δ` of the difference tensor, in the unit of its `γ`.
    #[must_use]
    pub fn difference_delta(&self) -> Option<f64> {
        match self.speed {
            Speed::Difference { delta, .. } => Some(delta),
            _ => None,
        }
    }

    /// `γ1 γ2` of the difference tensor at the nodes, row-major; `None` on other metrics.
    pub(crate) fn gamma_products(&self) -> Option<&[f64]> {
        self.speed.gamma_products()
    }

    /// Whether the node may be entered: no void, no barrier, not too steep.
    #[must_use]
    pub fn is_open(&self, col: usize, row: usize) -> bool {
        self.open.is_empty() || self.open[self.surface.frame().index(col, row)]
    }

    /// Speed tensor `D` in ground axes (x east, y north, metres) at grid coordinates `at`, from the spline's exact
    /// derivatives there. Where closed, that of the continued surface.
    #[must_use]
    pub fn speed(&self, at: DVec2) -> Sym2 {
        let speed = self.speed_of(&self.surface.jet(at), |tensors| self.bilinear(tensors, at));
        self.cost.as_ref().map_or(speed, |cost| speed * self.cost_at(cost, at).powi(-2))
    }

    /// Speed tensors at the nodes of the block whose first is `(col, row)`; nodes beyond the grid are closed.
    pub(crate) fn block_speeds(&self, col: usize, row: usize, speeds: &mut SpeedBlock) {
        let frame = self.surface.frame();
        self.surface.block_jets(col, row, &mut speeds.jets);
        let (cols, rows) = (BLOCK.min(frame.cols() - col), BLOCK.min(frame.rows() - row));
        if let Some(tensors) = self.speed.tensors() {
            for j in 0..rows {
                let start = frame.index(col, row + j);
                for (i, d) in tensors[start..start + cols].iter().enumerate() {
                    speeds.set(j, i, (*d, d.det()));
                }
            }
        }
        block::of_jets(&self.speed, self.climb_weight, speeds);
        if let Some(cost) = &self.cost {
            for j in 0..rows {
                let start = frame.index(col, row + j);
                for (i, cost) in cost[start..start + cols].iter().enumerate() {
                    speeds.scale(j, i, f64::from(*cost).powi(-2));
                }
            }
        }
        for (j, det) in speeds.det.iter_mut().enumerate() {
            if j >= rows {
                *det = [0.0; BLOCK];
                continue;
            }
            det[cols..].fill(0.0);
            if !self.open.is_empty() {
                let start = frame.index(col, row + j);
                for (det, open) in det.iter_mut().zip(&self.open[start..start + cols]) {
                    *det = if *open { *det } else { 0.0 };
                }
            }
        }
    }

    fn speed_of(&self, jet: &HeightJet, tensor: impl Fn(&[Sym2]) -> Sym2) -> Sym2 {
        let speed = match &self.speed {
            Speed::Isotropic => curvature::isotropic(jet),
            Speed::Curvature { delta } => curvature::curvature(jet, *delta),
            Speed::Difference { .. } | Speed::Tensor(_) => {
                let d = self.speed.tensors().map(tensor).unwrap_or_default();
                (d, d.det())
            }
        };
        if self.climb_weight == 0.0 {
            return speed.0;
        }
        averse_to_climb(speed, jet, self.climb_weight).0
    }

    fn bilinear(&self, tensors: &[Sym2], at: DVec2) -> Sym2 {
        self.corners(at)
            .into_iter()
            .map(|(i, weight)| (tensors[i], weight))
            .filter(|(d, weight)| *weight > 0.0 && d.is_positive_definite())
            .fold(Sym2::default(), |sum, (d, weight)| sum + d * weight)
    }

    /// Bilinear over the corners of the cell that have a cost; 1 if none has.
    fn cost_at(&self, costs: &[f32], at: DVec2) -> f64 {
        let known = self.corners(at).map(|(i, weight)| (f64::from(costs[i]), weight));
        let known = known.into_iter().filter(|(cost, _)| cost.is_finite());
        let (sum, total) =
            known.fold((0.0, 0.0), |(sum, total), (cost, w)| (sum + w * cost, total + w));
        if total > 0.0 { sum / total } else { 1.0 }
    }

    /// The corners of the cell around grid coordinates as places in a raster, each with its bilinear weight.
    fn corners(&self, at: DVec2) -> [(usize, f64); 4] {
        let frame = self.surface.frame();
        let at = frame.clamp(at);
        let (col, row) = (at.x as usize, at.y as usize);
        let (east, south) = ((col + 1).min(frame.cols() - 1), (row + 1).min(frame.rows() - 1));
        let (u, v) = (at.x - col as f64, at.y - row as f64);
        [
            (frame.index(col, row), (1.0 - u) * (1.0 - v)),
            (frame.index(east, row), u * (1.0 - v)),
            (frame.index(col, south), (1.0 - u) * v),
            (frame.index(east, south), u * v),
        ]
    }

    /// Cost under this metric of a step `by` (grid coordinates) around grid coordinates `at`: `√(vᵀ M v)`.
    #[must_use]
    pub fn step_cost(&self, at: DVec2, by: DVec2) -> f64 {
        let v = self.surface.frame().ground_vector(at.y, by);
        self.speed(at).inverse().norm(v)
    }

    /// Metric `M` in grid coordinates at grid coordinates `at`: a small grid step `by` costs `√(byᵀ M by)`.
    pub(crate) fn grid_metric(&self, at: DVec2) -> Sym2 {
        let spacing = self.surface.frame().spacing(at.y);
        self.speed(at).inverse().stretched(DVec2::new(spacing.x, -spacing.y))
    }

    /// Length under this metric of a polyline in grid coordinates: `∫ √(vᵀ M v)` by Gauss's two points on pieces of
    /// at most half a cell.
    #[must_use]
    pub fn length(&self, line: &[DVec2]) -> f64 {
        length_along(line, |at, by| self.step_cost(at, by))
    }
}

/// The inverse of `M + β ∇z∇zᵀ` and its determinant, from `D = M⁻¹` and its own. By Cramer's rule, without cancellation,
///
/// ```text
///   (D + β det D t tᵀ) / (1 + β ∇zᵀD∇z) ,     t = (−z_y, z_x) along the contour.
/// ```
#[inline(always)]
fn averse_to_climb((d, det): (Sym2, f64), jet: &HeightJet, climb_weight: f64) -> (Sym2, f64) {
    let (zx, zy) = (jet.zx, jet.zy);
    let form = zx * (d.xx * zx + d.xy * zy) + zy * (d.xy * zx + d.yy * zy);
    let inverse = 1.0 / (1.0 + climb_weight * form);
    let along = Sym2::new(zy * zy, -zx * zy, zx * zx);
    ((d + along * (climb_weight * det)) * inverse, det * inverse)
}

/// Length of a polyline in grid coordinates by Gauss's two points on pieces of at most half a cell, where a step `by`
/// around `at` costs `cost(at, by)`.
pub(crate) fn length_along(line: &[DVec2], cost: impl Fn(DVec2, DVec2) -> f64) -> f64 {
    // The points lie 1/√12 of the piece on either side of its middle.
    const ASIDE: f64 = 0.288_675_134_594_812_9;
    line.windows(2)
        .map(|ends| {
            let pieces = (2.0 * ends[0].distance(ends[1])).ceil().max(1.0);
            let by = (ends[1] - ends[0]) / pieces;
            (0..pieces as usize)
                .map(|i| {
                    let middle = ends[0] + by * (i as f64 + 0.5);
                    0.5 * (cost(middle - by * ASIDE, by) + cost(middle + by * ASIDE, by))
                })
                .sum::<f64>()
        })
        .sum()
}
