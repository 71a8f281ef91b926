//! Speed tensors on the nodes, in the solver's own units, tile by tile.

mod cells;
mod nodes;
mod prices;
mod weights;

use std::ops::Range;

use glam::DVec2;

pub(crate) use self::prices::{CELLS, CellTile, StepPrices, TensorTile, WeightTile};
use crate::control::Control;
use crate::error::{Error, Result};
use crate::grid::GridFrame;
use crate::grid::tiling::{AREA, SIDE, Tiling};
use crate::linalg::Sym2;
use crate::metric::{MetricField, SpeedBlock, Unit};
use crate::surface::BLOCK;

const _: () = assert!(SIDE == BLOCK, "a tile is filled from one block of speeds");

/// The speed tensors of a grid in index coordinates (column, row; spacing 1), divided by a power of four
/// so that typical entries are near 1 and `f32` never overflows, whatever the unit of the terrain.
///
/// The grid of a closed surface is periodic: see [`periodic`](Self::periodic).
#[derive(Clone, Debug)]
pub struct TensorField {
    pub(crate) tiling: Tiling,
    tiles: Vec<TensorTile>,
    /// What steps are priced by: the metric in the middle of each cell. Empty if only the tensors of the nodes are known, see
    /// [`from_fn`](Self::from_fn).
    cells: Vec<CellTile>,
    /// Empty if steps are not weighted.
    weights: Vec<WeightTile>,
    /// Whether the metric is known at the nodes only.
    is_by_nodes: bool,
    /// `D = scale · stored`, so distance is stored distance divided by [`root_scale`](Self::root_scale).
    root_scale: f64,
    /// Mean over the open nodes of the length of a cell, `det(D)^(−1/4)`, in stored units.
    pub(super) mean_step: f32,
    /// Unit of the distance, and where the nodes lie on the ground, if that is known.
    unit: Unit,
    frame: Option<GridFrame>,
}

impl TensorField {
    /// Samples a metric at the nodes of its surface and, on a heightmap or where steps are weighted, in the middles of its cells; periodic where the surface is.
    /// Rows at a pole, where cells have hardly any width, are closed.
    ///
    /// # Errors
    /// [`Error::Argument`] if the metric has no quadratic form, a closed direction fewer than 3 nodes, or a tensor is too far from
    /// what is typical, as in [`set`](Self::set); cancelled.
    pub fn sample(metric: &MetricField<'_>, control: &Control) -> Result<Self> {
        metric.check_quadratic()?;
        let surface = metric.surface();
        // Index coordinates: one node per step.
        let stretch: Vec<_> =
            (0..surface.rows()).map(|row| surface.axes(row as f64).recip()).collect();
        let widest = surface.frame().map_or(f64::INFINITY, |map| NO_WIDTH / map.mid_spacing().x);
        let sample = |col, row: usize, speeds: &mut SpeedBlock| {
            metric.block_speeds(col, row, speeds);
            for (det, by) in speeds.det.iter_mut().zip(&stretch[row..]) {
                *det = if by.x < widest { *det } else { Default::default() };
            }
        };
        let mut field = Self::build(surface.cols(), surface.rows(), &stretch, sample, control)?;
        field.make_periodic(surface.periodic())?;
        field.unit = metric.unit();
        field.frame = surface.frame().cloned();
        // Surfaces in space are smooth, but may have poles, where the middle of a cell stands for neither of its edges.
        if surface.frame().is_some() || metric.is_weighted() {
            field.sample_cells(metric, widest, control)?;
            field.weigh(metric);
            field.is_by_nodes = metric.is_known_at_nodes();
        }
        Ok(field)
    }

    /// The field of a function of `(column, row)` in index coordinates, of which nothing is known between the nodes: a step is priced by the
    /// tensor of the node where it arrives. Tensors of the [`Tensor`](crate::metric::Tensor) metric are priced along the way. `None`, or a tensor that is not positive definite, for a
    /// closed node.
    ///
    /// # Errors
    /// [`Error::Argument`] if a tensor is too far from what is typical, as in [`set`](Self::set); cancelled.
    pub fn from_fn(
        cols: usize,
        rows: usize,
        tensor: impl Fn(usize, usize) -> Option<Sym2> + Sync,
        control: &Control,
    ) -> Result<Self> {
        let sample = |col: usize, row: usize, speeds: &mut SpeedBlock| {
            speeds.det = Default::default();
            for j in 0..SIDE.min(rows - row) {
                for i in 0..SIDE.min(cols - col) {
                    if let Some(d) = tensor(col + i, row + j) {
                        speeds.set(j, i, d);
                    }
                }
            }
        };
        Self::build(cols, rows, &vec![DVec2::ONE; rows], sample, control)
    }

    /// The same field on a grid that is periodic in the columns, the rows or both, as the parameters of a cylinder or a
    /// torus are: where `directions` says so, the first node follows the last, one step on.
    ///
    /// A coordinate in such a direction may be any number; those that differ by the period (the number of columns or of rows) mean the
    /// same point. A line or an area of a start that crosses the seam goes on beyond the grid.
    ///
    /// # Errors
    /// [`Error::Argument`] if there are fewer than 3 nodes in a periodic direction.
    pub fn periodic(mut self, directions: [bool; 2]) -> Result<Self> {
        self.make_periodic(directions)?;
        Ok(self)
    }

    fn make_periodic(&mut self, directions: [bool; 2]) -> Result<()> {
        for (periodic, count) in directions.into_iter().zip([self.cols(), self.rows()]) {
            if periodic && count < 3 {
                return Err(Error::argument(
                    "the number of nodes in a periodic direction",
                    count,
                    "3 or more",
                ));
            }
        }
        self.tiling.periodic = directions;
        Ok(())
    }

    /// The part of the field made of the tiles that hold the given columns and rows, and its first column and row. A periodic direction stays
    /// whole, and stored units the same.
    pub(crate) fn crop(&self, [cols, rows]: [Range<usize>; 2]) -> (Self, [usize; 2]) {
        let periodic = self.tiling.periodic;
        let tiles = |axis: usize, nodes: Range<usize>, all: usize| {
            let nodes = if periodic[axis] { 0..all } else { nodes };
            nodes.start / SIDE..nodes.end.div_ceil(SIDE)
        };
        let (across, down) = (tiles(0, cols, self.cols()), tiles(1, rows, self.rows()));
        let count =
            |tiles: &Range<usize>, all: usize| all.min(tiles.end * SIDE) - tiles.start * SIDE;
        let (cols, rows) = (count(&across, self.cols()), count(&down, self.rows()));
        let tiling = Tiling { periodic, ..Tiling::new(cols, rows) };
        let row = |y: usize| &self.tiles[y * self.tiling.across..][across.clone()];
        let tiles = down.clone().flat_map(row).cloned().collect();
        let (mut cells, mut weights) = (Vec::new(), Vec::new());
        for y in down.clone().map(|y| y * self.tiling.across) {
            if !self.cells.is_empty() {
                cells.extend_from_slice(&self.cells[y..][across.clone()]);
            }
            if !self.weights.is_empty() {
                weights.extend_from_slice(&self.weights[y..][across.clone()]);
            }
        }
        let first = [across.start * SIDE, down.start * SIDE];
        (Self { tiling, tiles, cells, weights, frame: None, ..*self }, first)
    }

    /// Closes the nodes for which `is_open`, given column and row, is false.
    pub(crate) fn restrict(&mut self, is_open: impl Fn(usize, usize) -> bool) {
        for (index, tile) in self.tiles.iter_mut().enumerate() {
            let [cols, rows] = self.tiling.size(index);
            let (x, y) = (index % self.tiling.across * SIDE, index / self.tiling.across * SIDE);
            for (row, line) in tile.det.chunks_exact_mut(SIDE).take(rows).enumerate() {
                for (col, det) in line[..cols].iter_mut().enumerate() {
                    *det = if is_open(x + col, y + row) { *det } else { 0.0 };
                }
            }
        }
    }

    /// Memory that it takes per node.
    pub(super) fn bytes_per_node(&self) -> usize {
        let cells = if self.cells.is_empty() { 0 } else { size_of::<CellTile>() };
        let weights = if self.weights.is_empty() { 0 } else { size_of::<WeightTile>() };
        (size_of::<TensorTile>() + cells + weights) / AREA
    }

    /// Unit of the distance; [`Unit::Unknown`] if it is not known.
    #[must_use]
    pub fn unit(&self) -> Unit {
        self.unit
    }

    /// Size of a cell in a row: in metres on the ground if that is known, else 1.
    pub(super) fn spacing(&self, row: f64) -> DVec2 {
        self.frame.as_ref().map_or(DVec2::ONE, |frame| frame.spacing(row))
    }

    /// Columns of the grid.
    #[must_use]
    pub fn cols(&self) -> usize {
        self.tiling.cols
    }

    /// Rows of the grid.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.tiling.rows
    }

    /// Gives a node another tensor in index coordinates, or closes it (`None`, or a tensor that is not positive definite).
    ///
    /// # Errors
    /// [`Error::Argument`] if the node is not on the grid, or a diagonal entry or the determinant of the tensor more than 10¹⁵ times
    /// larger or smaller than was typical of the field when it was made.
    ///
    /// In a field that was sampled from a metric the cells around a node that is opened get the mean of the tensors of their corners; closing a
    /// node leaves them as they are.
    pub fn set(&mut self, col: usize, row: usize, tensor: Option<Sym2>) -> Result<()> {
        if col >= self.cols() || row >= self.rows() {
            return Err(Error::argument("the node", "not on the grid", "on it").at_node(col, row));
        }
        let open = tensor.filter(|d| d.is_positive_definite());
        let d = open.unwrap_or_default() * self.root_scale.powi(-2);
        let fits = fits(d.xx) & fits(d.yy) & fits(d.det());
        if open.is_some() && !fits {
            return Err(too_far(col, row, 1));
        }
        let stored = |value: f64| if fits { value as f32 } else { 0.0 };
        let (tile, place) = self.tiling.locate(col, row);
        let tile = &mut self.tiles[tile];
        tile.xx[place] = stored(d.xx);
        tile.xy[place] = stored(d.xy);
        tile.det[place] = stored(d.det());
        if !self.cells.is_empty() && open.is_some() {
            self.update_around(col, row);
        }
        Ok(())
    }

    /// Whether the node may be entered.
    #[must_use]
    pub fn is_open(&self, col: usize, row: usize) -> bool {
        let (tile, place) = self.tiling.locate(col, row);
        self.tiles[tile].det[place] > 0.0
    }

    /// Whether steps are priced by cells.
    pub(super) fn has_cells(&self) -> bool {
        !self.cells.is_empty()
    }

    /// What weighs the steps of a tile, if anything.
    pub(crate) fn weights(&self, tile: usize) -> Option<&WeightTile> {
        self.weights.get(tile)
    }

    /// The tensors of a tile's nodes.
    pub(crate) fn tensors(&self, tile: usize) -> &TensorTile {
        &self.tiles[tile]
    }

    /// Square root of the scale by which the tensors were divided.
    pub(super) fn root_scale(&self) -> f64 {
        self.root_scale
    }

    /// Stored metric `M = D⁻¹` of a node in index coordinates; `None` where closed.
    pub(super) fn metric(&self, col: usize, row: usize) -> Option<Sym2> {
        let (tile, place) = self.tiling.locate(col, row);
        let tile = &self.tiles[tile];
        let (xx, xy, det) =
            (f64::from(tile.xx[place]), f64::from(tile.xy[place]), f64::from(tile.det[place]));
        (det > 0.0).then(|| Sym2::new((det + xy * xy) / xx, -xy, xx) * det.recip())
    }

    /// Stored metric of the node at a column and a row, as in [`Tiling::node`].
    pub(super) fn metric_of(&self, col: isize, row: isize) -> Option<Sym2> {
        let (col, row) = self.tiling.node(col, row)?;
        self.metric(col, row)
    }

    /// The cost of a node by which steps are weighted; `None` where closed.
    pub(super) fn cost(&self, col: isize, row: isize) -> Option<f64> {
        let (col, row) = self.tiling.node(col, row)?;
        let (tile, place) = self.tiling.locate(col, row);
        let cost = self.weights(tile).map_or(1.0, |w| w.cost[place / SIDE + 1][place % SIDE + 1]);
        self.is_open(col, row).then_some(cost.into())
    }

    /// Stored metric at grid coordinates, over the open corners of the cell: the cost and what is left of the metric are bilinear. `None`
    /// if all are closed.
    pub(crate) fn metric_at(&self, at: DVec2) -> Option<Sym2> {
        if self.weights.is_empty() {
            return self.tiling.bilinear(at, |col, row| self.metric_of(col, row));
        }
        let cost = self.tiling.bilinear(at, |col, row| self.cost(col, row).map(scalar))?.xx;
        let metric = self.tiling.bilinear(at, |col, row| {
            Some(self.metric_of(col, row)? * self.cost(col, row)?.powi(-2))
        })?;
        Some(metric * (cost * cost))
    }
}

/// The error for `count` tensors, the first of them at this node.
fn too_far(col: usize, row: usize, count: u64) -> Error {
    let others = match count {
        1 => String::new(),
        2 => ", as is that at another node".into(),
        _ => format!(", as are those at {} other nodes", count - 1),
    };
    Error::argument(
        "the speed tensor",
        format!(
            "one with entries or a determinant more than 1e15 times larger or smaller than is typical{others}"
        ),
        "nearer to what is typical",
    )
    .at_node(col, row)
    .advise("make such nodes barriers (NaN or nodata), or let the speeds differ less")
}

/// A row whose cells are so many times narrower than those in the middle lies at a pole.
const NO_WIDTH: f64 = 1e5;

/// A number as a tensor, for interpolation.
fn scalar(value: f64) -> Sym2 {
    Sym2::new(value, 0.0, value)
}

/// Whether a number is small and large enough that products of a few such stay in the range of `f32`.
#[inline(always)]
fn fits(value: f64) -> bool {
    (1e-15..1e15).contains(&value)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::grid::{GridFrame, Ground};
    use crate::metric::{Curvature, Difference, Isotropic, Metric, Modifiers, Tensor};
    use crate::surface::{FitOptions, HeightSurface};
    use crate::synthetic::{Synthetic, SyntheticKind};
    use crate::terrain::{Crs, Terrain};

    /// The stored tensors of a metric against those at single points; the largest relative difference.
    fn difference(metric: &MetricField<'_>) -> f64 {
        let frame = metric.surface().frame().unwrap();
        let field = TensorField::sample(metric, &Control::default()).unwrap();
        let mut largest = 0.0_f64;
        for (col, row) in (0..frame.nodes()).map(|i| (i % frame.cols(), i / frame.cols())) {
            assert_eq!(field.is_open(col, row), metric.is_open(col, row));
            if metric.is_open(col, row) {
                let by = frame.spacing(row as f64) * DVec2::new(1.0, -1.0) * field.root_scale();
                let d =
                    metric.speed(DVec2::new(col as f64, row as f64)).unwrap().rescale(by.recip());
                let (tile, i) = field.tiling.locate(col, row);
                let tile = field.tensors(tile);
                let [xx, xy, det] = [tile.xx[i], tile.xy[i], tile.det[i]].map(f64::from);
                largest = largest
                    .max((xx - d.xx).abs() / d.xx)
                    .max((xy - d.xy).abs() / (d.xx * d.yy).sqrt())
                    .max((det - d.det()).abs() / d.det());
            }
        }
        largest
    }

    #[test]
    fn tensors_too_far_from_the_typical_are_refused() {
        let odd = |d: Option<Sym2>| {
            let tensor =
                |col, row| if (col, row) == (20, 17) { d } else { Some(Sym2::new(1.0, 0.0, 1.0)) };
            TensorField::from_fn(40, 30, tensor, &Control::default())
        };
        for wild in
            [Sym2::new(1e9, 0.0, 1e9), Sym2::new(1e-9, 0.0, 1e-9), Sym2::new(1e16, 0.0, 1e-16)]
        {
            let error = odd(Some(wild)).unwrap_err().to_string();
            assert!(error.contains("column 20, row 17 is one with entries"), "{error}");
            assert!(odd(None).unwrap().set(20, 17, Some(wild)).is_err());
        }
        let [nan, infinite] = [f64::NAN, f64::INFINITY].map(|x| Sym2::new(x, 0.0, 1.0));
        for closed in [None, Some(nan), Some(infinite), Some(Sym2::new(-1.0, 0.0, -1.0))] {
            let mut field = odd(closed).unwrap();
            assert!(!field.is_open(20, 17) && field.is_open(19, 17));
            field.set(19, 17, closed).unwrap();
            assert!(!field.is_open(19, 17));
        }
    }

    #[test]
    fn rows_at_a_pole_are_closed() {
        let frame =
            GridFrame::new(36, 19, DVec2::new(0.0, 90.0), DVec2::splat(10.0), Ground::WGS84)
                .unwrap();
        let terrain = Terrain::new(frame, vec![0.0; 36 * 19], Crs::none()).unwrap();
        let control = Control::default();
        let surface = HeightSurface::fit(&terrain, &FitOptions::default(), &control).unwrap();
        let metric = Isotropic.on(&surface, &Modifiers::default(), &control).unwrap();
        let field = TensorField::sample(&metric, &control).unwrap();
        let open = [0, 1, 17, 18].map(|row| field.is_open(5, row));
        assert_eq!(open, [false, true, true, false]);
    }

    #[test]
    fn stored_tensors_are_those_of_the_metric() {
        let tensor = |i: usize| Sym2::new(2.0 + (i as f64).sin(), 0.5, 1.0);
        for kind in [SyntheticKind::Fractal, SyntheticKind::Sphere, SyntheticKind::Plane] {
            let synthetic = Synthetic::new(kind, 53, 37, 30.0).unwrap();
            let plane = synthetic.terrain(Crs::none(), DVec2::ZERO).unwrap();
            let mut heights = plane.heights().to_vec();
            heights[700] = f64::NAN;
            let place = (DVec2::new(8.0, 71.0), DVec2::splat(1.0 / 3600.0));
            let globe = GridFrame::new(53, 37, place.0, place.1, Ground::WGS84).unwrap();
            for frame in [plane.frame().clone(), globe] {
                let terrain = Terrain::new(frame, heights.clone(), Crs::none()).unwrap();
                let surface =
                    HeightSurface::fit(&terrain, &FitOptions::default(), &Control::default())
                        .unwrap();
                let tensors: Arc<[Sym2]> = (0..53 * 37).map(tensor).collect();
                let metrics: [&dyn Metric; 4] = [
                    &Isotropic,
                    &Curvature::default(),
                    &Difference::default(),
                    &Tensor { tensors },
                ];
                for metric in metrics {
                    for climb_weight in [0.0, 30.0] {
                        let cost = (0..53 * 37).map(|i| 1.5 + (i as f32).cos()).collect();
                        let cost = (climb_weight > 0.0).then_some(cost);
                        let modifiers = Modifiers { climb_weight, cost, ..Modifiers::default() };
                        let metric = metric.on(&surface, &modifiers, &Control::default()).unwrap();
                        let difference = difference(&metric);
                        assert!(difference < 1e-6, "{kind:?} {} {difference:e}", metric.name());
                    }
                }
            }
        }
    }
}
