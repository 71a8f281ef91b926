//! The tensors at the nodes.

use glam::DVec2;
use rayon::prelude::*;

use super::prices::TensorTile;
use super::{TensorField, fits, too_far};
use crate::control::Control;
use crate::error::Result;
use crate::grid::tiling::{AREA, SIDE, Tiling};
use crate::linalg::simd::{self, Kernel};
use crate::metric::{SpeedBlock, Unit};

impl TensorField {
    /// The field of the tensors that `sample` gives for the block whose first node is `(col, row)`, once the
    /// coordinates are stretched by `stretch`, one for each row.
    pub(super) fn build(
        cols: usize,
        rows: usize,
        stretch: &[DVec2],
        sample: impl Fn(usize, usize, &mut SpeedBlock) + Sync,
        control: &Control,
    ) -> Result<Self> {
        let tiling = Tiling::new(cols, rows);
        let root_scale = typical_speed(tiling, stretch, &sample);
        let (mut tiles, mut cells) = (Vec::new(), Vec::new());
        (0..tiling.tiles())
            .into_par_iter()
            .with_min_len(tiling.across)
            .map_init(SpeedBlock::default, |speeds, i| {
                let mut tile = TensorTile::CLOSED;
                if control.cancel.is_cancelled() {
                    return (tile, Cells::default());
                }
                let (col, row) = ((i % tiling.across) * SIDE, (i / tiling.across) * SIDE);
                sample(col, row, speeds);
                let (stretch, shrink) = (&stretch[row..], root_scale.recip());
                let cells = simd::dispatch(Store { speeds, stretch, shrink, tile: &mut tile });
                (tile, cells)
            })
            .unzip_into_vecs(&mut tiles, &mut cells);
        control.check()?;
        if let Some(tile) = cells.iter().position(|cells| cells.lost > 0) {
            let (col, row) = ((tile % tiling.across) * SIDE, (tile / tiling.across) * SIDE);
            let mut speeds = SpeedBlock::default();
            sample(col, row, &mut speeds);
            let (i, j) = (0..AREA)
                .map(|place| (place % SIDE, place / SIDE))
                .find(|&(i, j)| speeds.is_open(j, i) && tiles[tile].det[j * SIDE + i] == 0.0)
                .unwrap_or_default();
            let count = cells.iter().map(|cells| u64::from(cells.lost)).sum();
            return Err(too_far(col + i, row + j, count));
        }
        let (sum, count) = cells.iter().fold((0.0, 0), |(sum, count), cells| {
            (sum + f64::from(cells.lengths), count + cells.count as usize)
        });
        let mean_step = if count > 0 { sum / count as f64 } else { 1.0 };
        let mean_step = mean_step as f32;
        let (cells, weights) = (Vec::new(), Vec::new());
        Ok(Self {
            tiling,
            tiles,
            cells,
            weights,
            is_by_nodes: false,
            root_scale,
            mean_step,
            unit: Unit::Unknown,
            frame: None,
        })
    }
}

/// The open cells of a tile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cells {
    /// Sum of their lengths `det(D)^(−1/4)`, in stored units.
    lengths: f32,
    count: u32,
    /// How many others would be open, but have tensors too far from what is typical.
    lost: u32,
}

/// A power of two near the typical speed `det(D)^(1/4)`, from tiles spread over the grid.
fn typical_speed(
    tiling: Tiling,
    stretch: &[DVec2],
    sample: impl Fn(usize, usize, &mut SpeedBlock),
) -> f64 {
    const SPREAD: usize = 8;
    let mut speeds = SpeedBlock::default();
    let (mut sum, mut count) = (0, 0);
    for down in (0..tiling.down).step_by(tiling.down.div_ceil(SPREAD).max(1)) {
        for across in (0..tiling.across).step_by(tiling.across.div_ceil(SPREAD).max(1)) {
            sample(across * SIDE, down * SIDE, &mut speeds);
            for (by, det) in stretch[down * SIDE..].iter().zip(&speeds.det) {
                let squared = (by.x * by.y).powi(2);
                for det in det.iter().map(|det| det * squared).filter(|det| det.is_normal()) {
                    // The binary exponent: the logarithm rounded down.
                    sum += i64::from((det.to_bits() >> 52) as u32 & 0x7ff) - 1023;
                    count += 1;
                }
            }
        }
    }
    let mean = if count > 0 { sum as f64 / f64::from(count) + 0.5 } else { 0.0 };
    (0.25 * mean).round().exp2()
}

/// Stores the tensors of a block in coordinates stretched by `stretch` of each row and by `shrink`. Where a tensor is out of the range
/// of `f32`, the node is closed and counted as lost.
pub(super) struct Store<'a> {
    pub(super) speeds: &'a SpeedBlock,
    pub(super) stretch: &'a [DVec2],
    pub(super) shrink: f64,
    pub(super) tile: &'a mut TensorTile,
}

impl Kernel for Store<'_> {
    type Output = Cells;

    #[inline(always)]
    fn run(self) -> Cells {
        let Self { speeds, stretch, shrink, tile } = self;
        let mut lengths = [0f32; SIDE];
        let (mut counts, mut lost) = ([0u32; SIDE], [0u32; SIDE]);
        for (row, by) in stretch.iter().take(SIDE).enumerate() {
            let (x, y) = (by.x * shrink, by.y * shrink);
            let (fxx, fxy, fyy, fdet) = (x * x, x * y, y * y, (x * y) * (x * y));
            for i in 0..SIDE {
                let (xx, xy) = (speeds.xx[row][i] * fxx, speeds.xy[row][i] * fxy);
                let (yy, det) = (speeds.yy[row][i] * fyy, speeds.det[row][i] * fdet);
                let fits = fits(xx) & fits(yy) & fits(det);
                let place = row * SIDE + i;
                tile.xx[place] = if fits { xx as f32 } else { 0.0 };
                tile.xy[place] = if fits { xy as f32 } else { 0.0 };
                tile.det[place] = if fits { det as f32 } else { 0.0 };
                let length = (1.0 / det as f32).sqrt().sqrt();
                lengths[i] += if fits { length } else { 0.0 };
                counts[i] += u32::from(fits);
                lost[i] += u32::from(speeds.is_open(row, i) & !fits);
            }
        }
        Cells { lengths: lengths.iter().sum(), count: counts.iter().sum(), lost: lost.iter().sum() }
    }
}
