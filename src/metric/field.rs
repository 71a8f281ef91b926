//! A metric on a surface.

use std::fmt;
use std::mem;

use glam::DVec2;

use super::modifiers::{BoundModifiers, Modifiers};
use super::{Metric, Norm, Parameter, SpeedBlock, SpeedTensor, Unit};
use crate::control::Control;
use crate::error::{Error, Obstacle, Result};
use crate::linalg::Sym2;
use crate::surface::{BLOCK, Block, Jet, Surface};

/// A metric bound to a surface, with modifiers: what a step costs everywhere, and where one may go.
#[derive(Clone)]
pub struct MetricField<'a> {
    surface: &'a dyn Surface,
    name: String,
    unit: Unit,
    norm: Norm,
    modifiers: BoundModifiers,
}

impl<'a> MetricField<'a> {
    pub(super) fn new(
        metric: &(impl Metric + ?Sized),
        surface: &'a dyn Surface,
        modifiers: &Modifiers,
        control: &Control,
    ) -> Result<Self> {
        let norm = metric.norm(surface, control)?;
        let modifiers = modifiers.on(surface)?;
        let unit = modifiers.unit(metric.unit());
        Ok(Self { surface, name: metric.name().to_owned(), unit, norm, modifiers })
    }

    /// The surface.
    #[must_use]
    pub fn surface(&self) -> &'a dyn Surface {
        self.surface
    }

    /// Name of the metric.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Unit of the distance: the metric's, but [`Unit::Ag`] for metres with a climb weight or costs.
    #[must_use]
    pub fn unit(&self) -> Unit {
        self.unit
    }

    /// The numbers that the metric depends on, for the record.
    #[must_use]
    pub fn parameters(&self) -> &[Parameter] {
        self.norm.parameters()
    }

    /// The parameter of this name, if the metric has it.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<f64> {
        let parameter = self.parameters().iter().find(|parameter| parameter.name == name);
        parameter.map(|parameter| parameter.value)
    }

    /// Square of the cost per metre of level ground of constant shape, if it is known, see [`Norm::with_level`].
    #[must_use]
    pub fn level(&self) -> Option<f64> {
        self.norm.level()
    }

    /// See [`Norm::with_seed_ranks`].
    pub(crate) fn own_seed_ranks(&self) -> Option<&[f64]> {
        self.norm.seed_ranks()
    }

    /// Whether the node may be entered: no void, no barrier, not too steep, and with a tensor if the metric is given by them.
    #[must_use]
    pub fn is_open(&self, col: usize, row: usize) -> bool {
        let has_tensor = self.norm.tensor().is_none_or(|tensor| tensor.is_open(col, row));
        has_tensor && self.modifiers.is_open(col, row)
    }

    /// What closes nodes of this surface, as far as it is known; not the metric's own tensors, where some are missing.
    #[must_use]
    pub fn obstacles(&self) -> Vec<Obstacle> {
        let voids = self.surface.has_voids().then_some(Obstacle::Void);
        voids.into_iter().chain(self.modifiers.obstacles().iter().copied()).collect()
    }

    /// Speed tensor `D` in the [axes](Surface::axes) of the surface at grid coordinates, from its exact derivatives there.
    /// Where closed, that of the continued surface. `None` where there is none, and on a metric without a quadratic form.
    #[must_use]
    pub fn speed(&self, at: DVec2) -> Option<Sym2> {
        let tensor = self.norm.tensor()?;
        let speed = self.speed_of(tensor, at, &self.surface.jet(at));
        speed.is_positive_definite().then_some(speed)
    }

    fn speed_of(&self, tensor: &dyn SpeedTensor, at: DVec2, jet: &Jet) -> Sym2 {
        self.modifiers.speed(tensor.speed_and_det(at, jet), at, jet)
    }

    /// Cost under this metric of a step `by` (grid coordinates) around grid coordinates `at`: `√(vᵀ M v)` with
    /// `v` in the axes of the surface, or `F(at, v)` if the metric has no quadratic form.
    #[must_use]
    pub fn step_cost(&self, at: DVec2, by: DVec2) -> f64 {
        let (jet, v) = (self.surface.jet(at), by * self.surface.axes(at.y));
        match self.norm.tensor() {
            Some(tensor) => self.speed_of(tensor, at, &jet).inverse().norm(v),
            None => self.modifiers.cost(self.norm.cost(at, &jet, v), at, &jet, v),
        }
    }

    /// Length under this metric of a polyline in grid coordinates: `∫ F` by Gauss's two points on pieces of at most half a
    /// cell.
    #[must_use]
    pub fn length(&self, line: &[DVec2]) -> f64 {
        length_along(line, |at, by| self.step_cost(at, by))
    }

    /// Metric `M` in grid coordinates at grid coordinates `at`: a small grid step `by` costs `√(byᵀ M by)`. Not finite where
    /// there is none.
    pub(crate) fn grid_metric(&self, at: DVec2) -> Sym2 {
        let Some(tensor) = self.norm.tensor() else { return Sym2::NAN };
        let speed = self.speed_of(tensor, at, &self.surface.jet(at));
        speed.inverse().rescale(self.surface.axes(at.y))
    }

    /// Refuses a metric without a quadratic form.
    ///
    /// # Errors
    /// It has none.
    pub(crate) fn check_quadratic(&self) -> Result<()> {
        match self.norm.tensor() {
            Some(_) => Ok(()),
            None => Err(Error::argument(
                format!("the metric {}", self.name),
                "one without a quadratic form, under which a step and the step back may cost differently",
                "one that is given by a speed tensor, for distances and routes to be computed on it",
            )),
        }
    }

    /// Speed tensors without modifiers in the middles of the cells of the block whose first has its north-western corner at `(col, row)`.
    pub(crate) fn block_cells(&self, col: usize, row: usize, speeds: &mut SpeedBlock) {
        let Some(tensor) = self.norm.tensor() else {
            *speeds = SpeedBlock::default();
            return;
        };
        let block = Block { centres: true, ..Block::from(self.surface, col, row) };
        if self.modifiers.close_cells(&block) {
            speeds.det = Default::default();
            return;
        }
        let mut jets = mem::take(&mut speeds.jets);
        self.surface.block_jets(&block, &mut jets);
        tensor.block(&block, &jets, speeds);
        speeds.jets = jets;
    }

    /// Whether steps cost something else than their length under the metric of their cell.
    pub(crate) fn is_weighted(&self) -> bool {
        self.modifiers.is_weighted()
    }

    /// Whether the tensors of the metric are known at the nodes only.
    pub(crate) fn is_known_at_nodes(&self) -> bool {
        self.norm.tensor().is_some_and(|tensor| tensor.is_known_at_nodes())
    }

    /// The climb weight.
    pub(crate) fn climb_weight(&self) -> f64 {
        self.modifiers.climb_weight()
    }

    /// What weighs steps at a node: the cost of the ground there, and of the tensors of a metric that is known at the nodes only.
    /// Infinite where there is none.
    pub(crate) fn node_cost(&self, col: usize, row: usize) -> f64 {
        let own = self.norm.tensor().map_or(1.0, |tensor| tensor.node_cost(col, row));
        own * self.modifiers.node_cost(col, row)
    }

    /// Speed tensors at the nodes of the block whose first is `(col, row)`; nodes beyond the grid are closed.
    pub(crate) fn block_speeds(&self, col: usize, row: usize, speeds: &mut SpeedBlock) {
        let Some(tensor) = self.norm.tensor() else {
            *speeds = SpeedBlock::default();
            return;
        };
        let block = Block::from(self.surface, col, row);
        if self.modifiers.close_all(&block) {
            speeds.det = Default::default();
            return;
        }
        let mut jets = mem::take(&mut speeds.jets);
        self.surface.block_jets(&block, &mut jets);
        tensor.block(&block, &jets, speeds);
        self.modifiers.apply(&block, &jets, speeds);
        speeds.jets = jets;
        for (j, det) in speeds.det.iter_mut().enumerate() {
            let cols = if j < block.rows.len() { block.cols.len() } else { 0 };
            det[cols..BLOCK].fill(0.0);
        }
    }
}

impl fmt::Debug for MetricField<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MetricField")
            .field("name", &self.name)
            .field("unit", &self.unit)
            .field("norm", &self.norm)
            .finish_non_exhaustive()
    }
}

/// Length of a polyline in grid coordinates by Gauss's two points on pieces of at most half a cell, none of which crosses the border of a cell,
/// where a step `by` around `at` costs `cost(at, by)`. What is bilinear between the nodes is of second degree along a piece, so that its
/// integral is exact.
pub(crate) fn length_along(line: &[DVec2], cost: impl Fn(DVec2, DVec2) -> f64) -> f64 {
    let segments = line.windows(2).map(|ends| {
        let cuts = cell_borders(ends[0], ends[1]);
        cuts.windows(2)
            .map(|cut| {
                length_in_cell(ends[0].lerp(ends[1], cut[0]), ends[0].lerp(ends[1], cut[1]), &cost)
            })
            .sum::<f64>()
    });
    segments.sum()
}

/// Where the way from `a` to `b` crosses columns and rows of nodes, as shares of it in ascending order, with both ends.
fn cell_borders(a: DVec2, b: DVec2) -> Vec<f64> {
    let mut cuts = vec![0.0, 1.0];
    for (from, to) in [(a.x, b.x), (a.y, b.y)] {
        let (low, high) = (from.min(to).floor() + 1.0, from.max(to).ceil());
        let crossings = (0..).map(|k| low + f64::from(k)).take_while(|&at| at < high);
        cuts.extend(crossings.map(|at| (at - from) / (to - from)));
    }
    cuts.sort_unstable_by(f64::total_cmp);
    cuts
}

/// The part of [`length_along`] from one point to another of the same cell.
fn length_in_cell(from: DVec2, to: DVec2, cost: &impl Fn(DVec2, DVec2) -> f64) -> f64 {
    // The points lie 1/√12 of the piece on either side of its middle.
    const ASIDE: f64 = 0.288_675_134_594_812_9;
    let pieces = (2.0 * from.distance(to)).ceil().max(1.0);
    let by = (to - from) / pieces;
    let piece = |i: usize| {
        let middle = from + by * (i as f64 + 0.5);
        0.5 * (cost(middle - by * ASIDE, by) + cost(middle + by * ASIDE, by))
    };
    (0..pieces as usize).map(piece).sum()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::metric::{Curvature, Delta, Difference, Isotropic, Tensor};
    use crate::surface::in_space::InSpace;
    use crate::surface::{FitOptions, HeightSurface};
    use crate::synthetic::{Synthetic, SyntheticKind};
    use crate::terrain::{Crs, Terrain};

    fn surfaces() -> impl Iterator<Item = HeightSurface> {
        [SyntheticKind::Fractal, SyntheticKind::Sphere].into_iter().map(|kind| {
            let synthetic = Synthetic::new(kind, 40, 30, 25.0).unwrap();
            let terrain = synthetic.terrain(Crs::none(), DVec2::ZERO).unwrap();
            let mut heights = terrain.heights().to_vec();
            heights[410] = f64::NAN;
            let terrain = Terrain::new(terrain.frame().clone(), heights, Crs::none()).unwrap();
            HeightSurface::fit(&terrain, &FitOptions::default(), &Control::default()).unwrap()
        })
    }

    fn apart(a: Sym2, b: Sym2) -> f64 {
        let e = a + b * -1.0;
        (e.xx.abs() + e.xy.abs() + e.yy.abs()) / (a.xx + a.yy)
    }

    #[test]
    fn heights_have_one_metric_on_the_map_and_in_space() {
        let control = Control::default();
        let plain = Modifiers::default();
        let weighed = Modifiers {
            climb_weight: 20.0,
            max_slope_deg: Some(35.0),
            barrier: Some((0..1200).map(|i| i % 97 == 0).collect()),
            cost: Some((0..1200).map(|i| 1.0 + (i % 7) as f32).collect()),
        };
        let metrics: [&dyn Metric; 3] = [&Isotropic, &Curvature::default(), &Difference::default()];
        for surface in surfaces() {
            let space = InSpace::measured_on_the_map(&surface);
            for (metric, modifiers) in
                metrics.into_iter().flat_map(|metric| [(metric, &plain), (metric, &weighed)])
            {
                let on_map = metric.on(&surface, modifiers, &control).unwrap();
                let in_space = metric.on(&space, modifiers, &control).unwrap();
                assert_eq!(on_map.unit(), in_space.unit());
                assert_eq!(on_map.parameters().first(), in_space.parameters().first());
                for at in [DVec2::new(3.0, 4.0), DVec2::new(20.3, 11.7), DVec2::new(39.0, 29.0)] {
                    let e = apart(on_map.grid_metric(at), in_space.grid_metric(at));
                    assert!(e < 1e-8, "{metric:?} {at} {e:e}");
                    let by = DVec2::new(0.3, -0.2);
                    let [a, b] = [&on_map, &in_space].map(|field| field.step_cost(at, by));
                    assert!((a / b - 1.0).abs() < 1e-8, "{metric:?} {a} {b}");
                }
                let nodes = (0..1200).map(|i| (i % 40, i / 40));
                for (col, row) in nodes {
                    assert_eq!(on_map.is_open(col, row), in_space.is_open(col, row));
                    let blocks = [&on_map, &in_space].map(|field| {
                        let mut speeds = SpeedBlock::default();
                        field.block_speeds(col / BLOCK * BLOCK, row / BLOCK * BLOCK, &mut speeds);
                        let (i, j) = (col % BLOCK, row % BLOCK);
                        speeds.is_open(j, i).then(|| speeds.get(j, i).0)
                    });
                    let [Some(a), Some(b)] = blocks else {
                        assert_eq!(blocks, [None, None]);
                        continue;
                    };
                    let b = b.rescale(surface.axes(row as f64));
                    assert!(apart(a, b) < 1e-8, "{metric:?} {col} {row} {a:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn tensors_in_space_are_bilinear_and_checked() {
        let tensors: Arc<[Sym2]> =
            (0..1200).map(|i| Sym2::new(2.0 + f64::from(i).sin(), 0.5, 1.0)).collect();
        let (none, control) = (Modifiers::default(), Control::default());
        for surface in surfaces() {
            let space = InSpace::measured_on_the_map(&surface);
            let metric = Tensor { tensors: tensors.clone() };
            let d = metric.on(&space, &none, &control).unwrap().speed(DVec2::new(3.5, 4.0));
            let mean = 0.5 * (tensors[163].xx + tensors[164].xx);
            assert!((d.unwrap().xx - mean).abs() < 1e-12);
            let short = Tensor { tensors: tensors[1..].into() };
            assert!(short.on(&space, &none, &control).is_err());
            let negative = Curvature { delta: Delta::Auto(-1.0) };
            assert!(negative.on(&space, &none, &control).is_err());
        }
    }
}
