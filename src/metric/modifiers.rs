//! Modifiers of a metric: climb weight, slope limit, barriers and costs. They compose with every metric on every surface.

use std::sync::Arc;

use glam::DVec2;
use rayon::prelude::*;

use super::nodes::Nodes;
use super::{SpeedBlock, Unit};
use crate::error::{Error, Obstacle, Result};
use crate::linalg::Sym2;
use crate::linalg::simd::{self, Kernel};
use crate::surface::{BLOCK, Block, HeightBlock, Jet, JetBlock, Surface};

/// What modifies a metric, any of them on any surface.
#[derive(Clone, Debug, Default)]
pub struct Modifiers {
    /// `β ≥ 0`: adds `β (dz)²` to the square of what a step costs, an aversion to grade: the metric `M` becomes
    /// `M + β ∇z ∇zᵀ`, `z` the third axis. On the isotropic metric a grade `s` then costs
    /// `√(1 + s² + β s²)` per plan metre. Default 0.
    pub climb_weight: f64,
    /// Steepest ground that may be entered, degrees from level, the third axis being up. Default: any.
    pub max_slope_deg: Option<f64>,
    /// Nodes that may not be entered, row-major from the north-west. Default: none.
    pub barrier: Option<Arc<[bool]>>,
    /// Cost of the ground at the nodes, row-major from the north-west: a factor above 0 on the length of every step, so
    /// `D` is divided by its square. A node whose cost is not finite is a barrier. Between nodes it is bilinear. The largest
    /// may be 1000 times the smallest.
    /// Default: 1 everywhere.
    pub cost: Option<Arc<[f32]>>,
}

/// The modifiers on a surface.
#[derive(Clone, Debug)]
pub(super) struct BoundModifiers {
    nodes: Nodes,
    climb_weight: f64,
    cost: Option<Arc<[f32]>>,
    obstacles: Vec<Obstacle>,
    /// Row-major; empty if all are open.
    open: Vec<bool>,
}

impl Modifiers {
    /// The modifiers bound to a surface.
    ///
    /// # Errors
    /// A climb weight or slope out of range; a raster whose size is not the surface's; a cost that is finite but not positive,
    /// or costs too far apart.
    pub(super) fn on(&self, surface: &dyn Surface) -> Result<BoundModifiers> {
        let climb_weight = self.climb_weight;
        if !(climb_weight.is_finite() && climb_weight >= 0.0) {
            return Err(Error::argument("the climb weight", climb_weight, "0 or more"));
        }
        if let Some(cost) = &self.cost {
            check_costs(surface, cost)?;
        }
        Ok(BoundModifiers {
            nodes: Nodes::of(surface),
            climb_weight,
            cost: self.cost.clone(),
            obstacles: self.obstacles(),
            open: self.open_nodes(surface)?,
        })
    }

    /// What may close nodes.
    fn obstacles(&self) -> Vec<Obstacle> {
        let barrier = self.barrier.as_ref().map(|_| Obstacle::Barrier);
        let slope = self.max_slope_deg.map(|_| Obstacle::Slope);
        let no_value = self.cost.as_ref().map(|_| Obstacle::NoValue);
        [barrier, slope, no_value].into_iter().flatten().collect()
    }

    /// Which nodes are neither void nor barrier, have a cost and are not too steep; empty if all are so.
    fn open_nodes(&self, surface: &dyn Surface) -> Result<Vec<bool>> {
        let (cols, nodes) = (surface.cols(), surface.cols() * surface.rows());
        if let Some(barrier) = &self.barrier
            && barrier.len() != nodes
        {
            return Err(Error::argument(
                "the number of cells of the barrier",
                barrier.len(),
                format!("{nodes}, that of the nodes"),
            ));
        }
        let steepest = self.steepest_gradient()?;
        let any_closed = surface.has_voids()
            || self.barrier.is_some()
            || steepest.is_some()
            || self.cost.is_some();
        if !any_closed {
            return Ok(Vec::new());
        }
        let mut open = vec![true; nodes];
        open.par_chunks_mut(cols).enumerate().for_each(|(row, open)| {
            for (col, open) in open.iter_mut().enumerate() {
                let node = row * cols + col;
                *open = !surface.is_void(col, row)
                    && !self.barrier.as_ref().is_some_and(|barrier| barrier[node])
                    && self.cost.as_ref().is_none_or(|cost| cost[node].is_finite());
            }
            if let Some(steepest) = steepest {
                close_steep(surface, row, steepest, open);
            }
        });
        Ok(open)
    }

    /// The steepest gradient that may be entered: the tangent of the slope.
    fn steepest_gradient(&self) -> Result<Option<f64>> {
        match self.max_slope_deg {
            Some(degrees) if degrees > 0.0 && degrees <= 90.0 => {
                Ok(Some(degrees.to_radians().tan()))
            }
            Some(degrees) => Err(Error::argument(
                "the steepest slope",
                format!("{degrees}°"),
                "above 0 and up to 90°",
            )),
            None => Ok(None),
        }
    }
}

/// Closes the nodes of a row with a steeper gradient.
fn close_steep(surface: &dyn Surface, row: usize, steepest: f64, open: &mut [bool]) {
    let mut jets = JetBlock::default();
    for (k, open) in open.chunks_mut(BLOCK).enumerate() {
        if !open.contains(&true) {
            continue;
        }
        let first = k * BLOCK;
        let block = Block { cols: first..first + open.len(), rows: row..row + 1, centres: false };
        surface.block_jets(&block, &mut jets);
        for (i, open) in open.iter_mut().enumerate() {
            let DVec2 { x, y } = jets.get(0, i).gradient();
            *open &= x.hypot(y) <= steepest;
        }
    }
}

impl BoundModifiers {
    /// The unit of distances in `unit` once the modifiers weigh them.
    pub(super) fn unit(&self, unit: Unit) -> Unit {
        if self.climb_weight == 0.0 && self.cost.is_none() { unit } else { unit.weighted() }
    }

    /// What may close nodes, other than voids.
    pub(super) fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    pub(super) fn is_weighted(&self) -> bool {
        self.climb_weight > 0.0 || self.cost.is_some()
    }

    pub(super) fn climb_weight(&self) -> f64 {
        self.climb_weight
    }

    /// The cost of the ground at a node; 1 if there are no costs, infinite where there is none.
    pub(super) fn node_cost(&self, col: usize, row: usize) -> f64 {
        self.cost.as_ref().map_or(1.0, |cost| {
            let cost = f64::from(cost[self.nodes.index(col, row)]);
            if cost.is_finite() { cost } else { f64::INFINITY }
        })
    }

    pub(super) fn is_open(&self, col: usize, row: usize) -> bool {
        self.open.is_empty() || self.open[self.nodes.index(col, row)]
    }

    /// Whether all nodes of a block are closed.
    pub(super) fn close_all(&self, block: &Block) -> bool {
        !self.open.is_empty() && self.nodes.of_block(&self.open, block).all(|(_, _, open)| !open)
    }

    /// Whether all corners of the cells of a block are closed; false if it is not known.
    pub(super) fn close_cells(&self, block: &Block) -> bool {
        let Some([cols, rows]) = self.nodes.with_far_corners(block) else { return false };
        self.close_all(&Block { cols, rows, centres: false })
    }

    /// A speed tensor, with its determinant, under the modifiers.
    pub(super) fn speed(&self, speed: (Sym2, f64), at: DVec2, jet: &Jet) -> Sym2 {
        let (d, _) = match self.climb_weight {
            0.0 => speed,
            weight => averse_to_climb(speed, jet.rise(), weight),
        };
        self.cost.as_ref().map_or(d, |cost| d * self.cost_at(cost, at).powi(-2))
    }

    /// The cost of a step `v` under the modifiers, from that without: `c √(F² + β (dz)²)`.
    pub(super) fn cost(&self, cost: f64, at: DVec2, jet: &Jet, v: DVec2) -> f64 {
        let climb = self.climb_weight.sqrt() * jet.rise().dot(v);
        let factor = self.cost.as_ref().map_or(1.0, |costs| self.cost_at(costs, at));
        factor * cost.hypot(climb)
    }

    /// Bilinear over the corners of the cell that have a cost; 1 if none has.
    fn cost_at(&self, costs: &[f32], at: DVec2) -> f64 {
        let known = self.nodes.corners(at).map(|(i, weight)| (f64::from(costs[i]), weight));
        let known = known.into_iter().filter(|(cost, _)| cost.is_finite());
        let (sum, total) =
            known.fold((0.0, 0.0), |(sum, total), (cost, w)| (sum + w * cost, total + w));
        if total > 0.0 { sum / total } else { 1.0 }
    }

    /// The tensors of a block under the modifiers; closed nodes get none.
    pub(super) fn apply(&self, block: &Block, jets: &JetBlock, speeds: &mut SpeedBlock) {
        if self.climb_weight > 0.0 {
            match jets.heights() {
                Some(jets) => {
                    let climb_weight = self.climb_weight;
                    simd::dispatch(BlockAverseToClimb { jets, climb_weight, speeds });
                }
                None => {
                    for (j, i, _) in block.places() {
                        let rise = jets.get(j, i).rise();
                        let speed = averse_to_climb(speeds.get(j, i), rise, self.climb_weight);
                        speeds.set_with(j, i, speed);
                    }
                }
            }
        }
        if let Some(cost) = &self.cost {
            for (j, i, cost) in self.nodes.of_block(cost, block) {
                speeds.scale(j, i, f64::from(*cost).powi(-2));
            }
        }
        if !self.open.is_empty() {
            for (j, i, open) in self.nodes.of_block(&self.open, block) {
                let det = &mut speeds.det[j][i];
                *det = if *open { *det } else { 0.0 };
            }
        }
    }
}

/// A block of heights with an aversion to climb.
struct BlockAverseToClimb<'a> {
    jets: &'a HeightBlock,
    climb_weight: f64,
    speeds: &'a mut SpeedBlock,
}

impl Kernel for BlockAverseToClimb<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { jets, climb_weight, speeds } = self;
        for j in 0..BLOCK {
            for i in 0..BLOCK {
                let (speed, rise) = (speeds.get(j, i), jets.jet(j, i).gradient());
                speeds.set_with(j, i, averse_to_climb(speed, rise, climb_weight));
            }
        }
    }
}

/// The inverse of `M + β ∇z∇zᵀ` and its determinant, from `D = M⁻¹` and its own. By Cramer's rule, without cancellation,
///
/// ```text
///   (D + β det D t tᵀ) / (1 + β ∇zᵀD∇z) ,     t = (−z_y, z_x) along the contour.
/// ```
#[inline(always)]
pub(super) fn averse_to_climb(
    (d, det): (Sym2, f64),
    rise: DVec2,
    climb_weight: f64,
) -> (Sym2, f64) {
    let (zx, zy) = (rise.x, rise.y);
    let form = zx * (d.xx * zx + d.xy * zy) + zy * (d.xy * zx + d.yy * zy);
    let inverse = 1.0 / (1.0 + climb_weight * form);
    let along = Sym2::new(zy * zy, -zx * zy, zx * zx);
    ((d + along * (climb_weight * det)) * inverse, det * inverse)
}

/// Refuses costs of another number than nodes, costs that are not above 0, and costs too far apart.
fn check_costs(surface: &dyn Surface, costs: &[f32]) -> Result<()> {
    let (cols, nodes) = (surface.cols(), surface.cols() * surface.rows());
    if costs.len() != nodes {
        return Err(Error::argument(
            "the number of costs",
            costs.len(),
            format!("{nodes}, that of the nodes"),
        ));
    }
    if let Some(i) = costs.iter().position(|cost| cost.is_finite() && *cost <= 0.0) {
        return Err(Error::argument("the cost", costs[i], "above 0")
            .at_node(i % cols, i / cols)
            .advise(MARK_BARRIERS));
    }
    let (least, most) = costs
        .iter()
        .filter(|cost| cost.is_finite())
        .fold((f32::INFINITY, 0f32), |(least, most), &cost| (least.min(cost), most.max(cost)));
    if most > MOST_COST_RATIO * least {
        return Err(Error::argument(
            "the range of the costs",
            format!("{least} to {most}"),
            format!("as wide as 1 to {MOST_COST_RATIO} at most"),
        )
        .advise(MARK_BARRIERS));
    }
    Ok(())
}

const MARK_BARRIERS: &str = "mark barriers by NaN or nodata";

/// The solver keeps `det D`, which goes with the fourth power of the cost, within 1e±15 of what is typical.
const MOST_COST_RATIO: f32 = 1000.0;
