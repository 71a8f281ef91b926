//! Rasters on the grid of the DEM: costs and speed tensors.

use std::path::Path;
use std::sync::Arc;

use crate::error::{Error, Remedy, Result};
use crate::grid::GridFrame;
use crate::linalg::Sym2;
use crate::terrain::read_bands;

/// The speed tensors of a three-band raster on this grid.
///
/// # Errors
/// A file that cannot be read, has not three bands, or lies on another grid.
pub(super) fn read_tensors(path: &Path, frame: &GridFrame) -> Result<Arc<[Sym2]>> {
    let raster = read_bands(path)?;
    let [xx, xy, yy] = &raster.bands[..] else {
        let found = raster.bands.len();
        let expected = "3 for tensors: D11, D12, D22";
        return Err(Error::argument("the number of bands", found, expected).in_file(path));
    };
    check_grid(path, &raster.frame, frame)?;
    Ok(xx.iter().zip(xy).zip(yy).map(|((&xx, &xy), &yy)| Sym2 { xx, xy, yy }).collect())
}

/// The costs of a one-band raster on this grid.
///
/// # Errors
/// A file that cannot be read, has more than one band, or lies on another grid.
pub(super) fn read_costs(path: &Path, frame: &GridFrame) -> Result<Arc<[f32]>> {
    let raster = read_bands(path)?;
    let [cost] = &raster.bands[..] else {
        let found = raster.bands.len();
        return Err(Error::argument("the number of bands", found, "1 for costs").in_file(path));
    };
    check_grid(path, &raster.frame, frame)?;
    Ok(cost.iter().map(|&cost| cost as f32).collect())
}

fn check_grid(path: &Path, theirs: &GridFrame, ours: &GridFrame) -> Result<()> {
    /// Share of a cell.
    const TOLERANCE: f64 = 0.01;
    let apart = (theirs.origin() - ours.origin()).abs().max((theirs.step() - ours.step()).abs());
    if (theirs.cols(), theirs.rows()) == (ours.cols(), ours.rows())
        && apart.max_element() <= TOLERANCE * ours.step().min_element()
    {
        return Ok(());
    }
    let expected = format!("that of the DEM, {}", described(ours));
    Err(Error::argument("the grid", described(theirs), expected)
        .advise(Remedy::ResampleToDem)
        .in_file(path))
}

fn described(frame: &GridFrame) -> String {
    let (cols, rows, origin) = (frame.cols(), frame.rows(), frame.origin());
    format!("{cols} x {rows} cells from {},{}", origin.x, origin.y)
}
