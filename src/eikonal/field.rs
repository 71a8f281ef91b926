//! Speed tensors on the nodes, in the solver's own units, tile by tile.

use glam::DVec2;
use rayon::prelude::*;

use crate::{Control, GridFrame, HeightJet, MetricField, Result, Sym2};

/// Side of a tile in nodes: as many as an AVX-512 register has `f32` lanes. 8 and 32 are slower (the shorter
/// needs more activations, the longer more sweeps; design measurements at ratio 1 to 400).
pub(crate) const SIDE: usize = 16;
/// Nodes of a tile.
pub(crate) const AREA: usize = SIDE * SIDE;

/// `D` of a tile's nodes, row by row: `xx`, `xy` and the determinant, which is 0 where the node is closed.
#[derive(Clone, Debug)]
pub(crate) struct TensorTile {
    pub(crate) xx: [f32; AREA],
    pub(crate) xy: [f32; AREA],
    pub(crate) det: [f32; AREA],
}

impl TensorTile {
    const CLOSED: Self = Self { xx: [0.0; AREA], xy: [0.0; AREA], det: [0.0; AREA] };
}

/// How the nodes of a grid are cut into tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tiling {
    pub(crate) cols: usize,
    pub(crate) rows: usize,
    pub(crate) across: usize,
    pub(crate) down: usize,
}

impl Tiling {
    pub(crate) fn new(cols: usize, rows: usize) -> Self {
        Self { cols, rows, across: cols.div_ceil(SIDE), down: rows.div_ceil(SIDE) }
    }

    pub(crate) fn tiles(&self) -> usize {
        self.across * self.down
    }

    /// The first node of a tile.
    pub(crate) fn first(&self, tile: usize) -> DVec2 {
        DVec2::new((tile % self.across) as f64, (tile / self.across) as f64) * SIDE as f64
    }

    /// Tile and place in it of a node.
    pub(crate) fn place(&self, col: usize, row: usize) -> (usize, usize) {
        ((row / SIDE) * self.across + col / SIDE, (row % SIDE) * SIDE + col % SIDE)
    }
}

/// The speed tensors of a grid in index coordinates (column, row; spacing 1), divided by a power of four
/// so that typical entries are near 1 and `f32` never overflows, whatever the unit of the terrain.
#[derive(Clone, Debug)]
pub struct TensorField {
    pub(super) tiling: Tiling,
    pub(super) tiles: Vec<TensorTile>,
    /// `D = scale · stored`, so distance is stored distance divided by [`root_scale`](Self::root_scale).
    root_scale: f64,
    /// Mean over the open nodes of the length of a cell, `det(D)^(−1/4)`, in stored units.
    pub(super) mean_step: f32,
}

impl TensorField {
    /// Samples a metric at the nodes of its surface.
    ///
    /// # Errors
    /// Cancelled.
    pub fn sample(metric: &MetricField<'_>, control: &Control) -> Result<Self> {
        let frame = metric.surface().frame();
        let sample_rows = |rows: std::ops::Range<usize>,
                           visit: &mut dyn FnMut(usize, usize, Sym2)| {
            let mut jets = vec![HeightJet::default(); frame.cols()];
            let mut speeds = vec![Sym2::default(); frame.cols()];
            for row in rows {
                metric.row_speeds(row, &mut jets, &mut speeds);
                for (col, speed) in speeds.iter().enumerate() {
                    if metric.is_open(col, row) {
                        visit(col, row, to_index(frame, row, *speed));
                    }
                }
            }
        };
        Self::build(frame.cols(), frame.rows(), sample_rows, control)
    }

    /// The field of a function of `(column, row)` in index coordinates; `None` for a closed node.
    ///
    /// # Errors
    /// Cancelled.
    pub fn from_fn(
        cols: usize,
        rows: usize,
        tensor: impl Fn(usize, usize) -> Option<Sym2> + Sync,
        control: &Control,
    ) -> Result<Self> {
        let sample_rows = |range: std::ops::Range<usize>,
                           visit: &mut dyn FnMut(usize, usize, Sym2)| {
            for row in range {
                for col in 0..cols {
                    if let Some(d) = tensor(col, row) {
                        visit(col, row, d);
                    }
                }
            }
        };
        Self::build(cols, rows, sample_rows, control)
    }

    fn build(
        cols: usize,
        rows: usize,
        sample_rows: impl Fn(std::ops::Range<usize>, &mut dyn FnMut(usize, usize, Sym2)) + Sync,
        control: &Control,
    ) -> Result<Self> {
        let tiling = Tiling::new(cols, rows);
        let root_scale = typical_speed(rows, &sample_rows);
        let shrink = (root_scale * root_scale).recip();
        let mut tiles = vec![TensorTile::CLOSED; tiling.tiles()];
        let sums: Vec<(f64, usize)> = tiles
            .par_chunks_mut(tiling.across)
            .enumerate()
            .map(|(band, tiles)| {
                control.check()?;
                let first = band * SIDE;
                let mut sum = (0.0, 0);
                sample_rows(first..(first + SIDE).min(rows), &mut |col, row, d| {
                    let d = d * shrink;
                    if store(&mut tiles[col / SIDE], (row % SIDE) * SIDE + col % SIDE, d) {
                        sum = (sum.0 + d.det().powf(-0.25), sum.1 + 1);
                    }
                });
                Ok(sum)
            })
            .collect::<Result<_>>()?;
        let (sum, count) = sums.iter().fold((0.0, 0), |(s, n), (ds, dn)| (s + ds, n + dn));
        let mean_step = if count > 0 { sum / count as f64 } else { 1.0 };
        Ok(Self { tiling, tiles, root_scale, mean_step: mean_step as f32 })
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

    /// Whether the node may be entered.
    #[must_use]
    pub fn is_open(&self, col: usize, row: usize) -> bool {
        let (tile, place) = self.tiling.place(col, row);
        self.tiles[tile].det[place] > 0.0
    }

    /// Square root of the scale that was divided out of the tensors.
    pub(super) fn root_scale(&self) -> f64 {
        self.root_scale
    }

    /// Stored metric `M = D⁻¹` of a node in index coordinates; `None` where closed.
    pub(super) fn metric(&self, col: usize, row: usize) -> Option<Sym2> {
        let (tile, place) = self.tiling.place(col, row);
        let tile = &self.tiles[tile];
        let (xx, xy, det) =
            (f64::from(tile.xx[place]), f64::from(tile.xy[place]), f64::from(tile.det[place]));
        (det > 0.0).then(|| Sym2::new((det + xy * xy) / xx, -xy, xx) * det.recip())
    }

    /// Whether all corners of the cell around a point are open that its bilinear value depends on.
    pub(super) fn is_open_around(&self, at: DVec2) -> bool {
        let ends = |x: f64| [x.floor().max(0.0) as usize, x.ceil().max(0.0) as usize];
        ends(at.y).iter().all(|&row| {
            ends(at.x)
                .iter()
                .all(|&col| col < self.cols() && row < self.rows() && self.is_open(col, row))
        })
    }

    /// Stored metric at grid coordinates: bilinear over the open corners of the cell; `None` if all are closed.
    pub(crate) fn metric_at(&self, at: DVec2) -> Option<Sym2> {
        let corner =
            |value: f64, count: usize| (value.floor() as usize).min(count.saturating_sub(2));
        let (col, row) = (corner(at.x, self.cols()), corner(at.y, self.rows()));
        let (u, v) = (at.x - col as f64, at.y - row as f64);
        let mut sum = Sym2::default();
        let mut weight = 0.0;
        for (i, j, w) in [
            (0, 0, (1.0 - u) * (1.0 - v)),
            (1, 0, u * (1.0 - v)),
            (0, 1, (1.0 - u) * v),
            (1, 1, u * v),
        ] {
            if col + i < self.cols()
                && row + j < self.rows()
                && let Some(metric) = self.metric(col + i, row + j)
            {
                // A trace of weight for every open corner, so that a point on a closed one has a metric too.
                let w = w + 1e-9;
                sum = sum + metric * w;
                weight += w;
            }
        }
        (weight > 0.0).then(|| sum * (1.0 / weight))
    }
}

/// `D` in index coordinates: columns run east, rows run south, one node per step.
fn to_index(frame: &GridFrame, row: usize, speed: Sym2) -> Sym2 {
    let h = frame.spacing(row as f64);
    speed.stretched(DVec2::new(h.x.recip(), -h.y.recip()))
}

/// A power of two near the typical speed `det(D)^(1/4)`, from a few dozen rows.
fn typical_speed(
    rows: usize,
    sample_rows: &(impl Fn(std::ops::Range<usize>, &mut dyn FnMut(usize, usize, Sym2)) + Sync),
) -> f64 {
    const SAMPLED_ROWS: usize = 32;
    let mut sum = 0.0;
    let mut count = 0.0;
    for row in (0..rows).step_by(rows.div_ceil(SAMPLED_ROWS).max(1)) {
        sample_rows(row..row + 1, &mut |_, _, d| {
            if d.is_positive_definite() {
                sum += d.det().log2();
                count += 1.0;
            }
        });
    }
    if count > 0.0 { (0.25 * sum / count).round().exp2() } else { 1.0 }
}

/// Stores a tensor unless it is out of the range of `f32`; then the node stays closed.
fn store(tile: &mut TensorTile, place: usize, d: Sym2) -> bool {
    const RANGE: std::ops::Range<f64> = 1e-15..1e15;
    let fits = RANGE.contains(&d.xx) && RANGE.contains(&d.yy) && RANGE.contains(&d.det());
    if fits {
        tile.xx[place] = d.xx as f32;
        tile.xy[place] = d.xy as f32;
        tile.det[place] = d.det() as f32;
    }
    fits
}
