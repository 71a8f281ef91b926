//! Rasters on the grid of the DEM: costs and speed tensors.

use std::path::Path;
use std::sync::Arc;

use glam::DVec2;

use crate::error::{Error, Remedy, Result};
use crate::grid::GridFrame;
use crate::linalg::Sym2;
use crate::terrain::{Crs, Georeference, RasterBands, read_bands};

/// The speed tensors of a three-band raster on this grid.
///
/// # Errors
/// A file that cannot be read, has not three bands, lies on another grid, or is in another CRS.
pub(super) fn read_tensors(path: &Path, dem: &Georeference) -> Result<Arc<[Sym2]>> {
    let raster = read_bands(path)?;
    let [xx, xy, yy] = &raster.bands[..] else {
        let found = raster.bands.len();
        let expected = "3 for tensors: D11, D12, D22";
        return Err(Error::argument("the number of bands", found, expected).in_file(path));
    };
    check_grid(path, &raster, dem)?;
    Ok(xx.iter().zip(xy).zip(yy).map(|((&xx, &xy), &yy)| Sym2 { xx, xy, yy }).collect())
}

/// The costs of a one-band raster on this grid.
///
/// # Errors
/// A file that cannot be read, has more than one band, lies on another grid, or is in another CRS.
pub(super) fn read_costs(path: &Path, dem: &Georeference) -> Result<Arc<[f32]>> {
    let raster = read_bands(path)?;
    let [cost] = &raster.bands[..] else {
        let found = raster.bands.len();
        return Err(Error::argument("the number of bands", found, "1 for costs").in_file(path));
    };
    check_grid(path, &raster, dem)?;
    Ok(cost.iter().map(|&cost| cost as f32).collect())
}

/// # Errors
/// The raster is in another CRS or on another grid than the DEM.
fn check_grid(path: &Path, raster: &RasterBands, dem: &Georeference) -> Result<()> {
    /// Share of a cell.
    const TOLERANCE: f64 = 0.01;
    check_crs(path, &raster.crs, dem)?;
    let (theirs, ours) = (&raster.frame, dem.frame());
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

/// Size and extent: what programs that resample ask for.
fn described(frame: &GridFrame) -> String {
    let ([west, south, east, north], (cols, rows)) = (frame.extent(), (frame.cols(), frame.rows()));
    format!("{cols} x {rows} cells over {west} {south} {east} {north} (west, south, east, north)")
}

/// # Errors
/// Both CRSs are known and the same map coordinates lie at different places.
fn check_crs(path: &Path, theirs: &Crs, dem: &Georeference) -> Result<()> {
    let ours = dem.crs();
    if theirs.is_none() || ours.is_none() || agree(theirs, dem) {
        return Ok(());
    }
    let expected = format!("that of the DEM, {}", ours.name());
    Err(Error::argument("the CRS", theirs.name(), expected)
        .advise(Remedy::ReprojectToDem)
        .in_file(path))
}

/// Whether another CRS puts the corners of the grid where its own does, whatever the two are called; by their names and units where neither
/// leads to longitude and latitude.
fn agree(crs: &Crs, dem: &Georeference) -> bool {
    /// Degrees; a centimetre.
    const TOLERANCE: f64 = 1e-7;
    if !crs.has_lonlat() && !dem.crs().has_lonlat() {
        return (crs.name(), crs.unit()) == (dem.crs().name(), dem.crs().unit());
    }
    let frame = dem.frame();
    let last = DVec2::new((frame.cols() - 1) as f64, (frame.rows() - 1) as f64);
    [DVec2::ZERO, DVec2::new(last.x, 0.0), DVec2::new(0.0, last.y), last].into_iter().all(
        |corner| match (crs.to_lonlat(frame.to_map(corner)), dem.to_lonlat(corner)) {
            (Ok(a), Ok(b)) => (a - b).abs().max_element() <= TOLERANCE,
            _ => false,
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raster_in_another_crs_is_refused() {
        let crs = |code| Crs::from_epsg(code).unwrap();
        let utm = crs(32632);
        let frame =
            GridFrame::new(9, 5, DVec2::new(5e5, 5e6), DVec2::splat(10.0), utm.ground()).unwrap();
        let dem = Georeference::new(frame, utm);
        let check = |crs: Crs| {
            let raster = RasterBands { frame: dem.frame().clone(), crs, bands: Vec::new() };
            check_grid(Path::new("cost.tif"), &raster, &dem)
        };
        // ETRS89 and WGS 84 are taken as one.
        for same in [crs(32632), crs(25832), Crs::none()] {
            check(same).unwrap();
        }
        let message = check(crs(32633)).unwrap_err().to_string();
        assert!(message.contains("EPSG:32633") && message.contains("EPSG:32632"), "{message}");
        assert!(message.contains("reproject"), "{message}");
    }
}
