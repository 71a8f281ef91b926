//! Sites: the starts and goals of a scenario on its grid.

use std::path::Path;

use glam::DVec2;

use super::geometry::read_geojson;
use super::place::{Notation, Place};
use crate::error::{Error, PlaceError, PlaceErrorKind, Result, Role};
use crate::grid::{GridFrame, Shapes};
use crate::terrain::{Georeference, Terrain};

/// A point on the grid that remembers how it was given.
#[derive(Clone, Debug)]
pub struct Site {
    /// What it is for.
    pub role: Role,
    /// As it was given, such as `pixel:3,4`.
    pub name: String,
    /// Grid coordinates, in the hull of the nodes.
    pub at: DVec2,
    /// How to write places near it.
    pub notation: Notation,
}

impl Site {
    /// Puts a point on the grid.
    ///
    /// # Errors
    /// [`Error::Place`] if it lies outside the DEM; longitude and latitude without a CRS.
    fn new(
        role: Role,
        name: String,
        (notation, at): (Notation, DVec2),
        terrain: &Terrain,
    ) -> Result<Self> {
        let frame = terrain.frame();
        let grid = notation.to_grid(at, terrain.georeference())?;
        if frame.is_on_cell(grid) {
            // The surface ends at the outermost nodes, half a cell before the raster does.
            return Ok(Self { role, name, at: frame.clamp(grid), notation });
        }
        let (kind, nearest) = outside(notation, at, terrain)?;
        Err(Error::Place(Box::new(PlaceError { role, name, kind, nearest })))
    }

    /// The cell it lies in: column and row.
    #[must_use]
    pub fn cell(&self) -> (usize, usize) {
        (self.at.x.round() as usize, self.at.y.round() as usize)
    }

    /// The error that refuses this site for its `kind` and names the nearest cell that is good.
    pub(super) fn refusal(
        &self,
        georeference: &Georeference,
        kind: PlaceErrorKind,
        good: impl Fn(usize, usize) -> bool,
    ) -> Error {
        let near = nearest(georeference.frame(), self.at, good);
        let written = near.map(|near| self.notation.write(near, georeference)).transpose();
        match written {
            Ok(nearest) => {
                let Self { role, ref name, .. } = *self;
                Error::Place(Box::new(PlaceError { role, name: name.clone(), kind, nearest }))
            }
            Err(error) => error,
        }
    }
}

/// What is wrong with a place outside the DEM, and the nearest place on it.
fn outside(
    notation: Notation,
    at: DVec2,
    terrain: &Terrain,
) -> Result<(PlaceErrorKind, Option<String>)> {
    let (frame, georeference) = (terrain.frame(), terrain.georeference());
    let last = DVec2::new((frame.cols() - 1) as f64, (frame.rows() - 1) as f64);
    let (low, high) = match notation {
        Notation::Pixel => (DVec2::ZERO, last),
        _ => (DVec2::new(0.0, last.y), DVec2::new(last.x, 0.0)),
    };
    let swapped = DVec2::new(at.y, at.x);
    let is_swapped =
        notation.to_grid(swapped, georeference).is_ok_and(|grid| frame.is_on_cell(grid));
    let kind = PlaceErrorKind::Outside {
        from: notation.write(low, georeference)?,
        to: notation.write(high, georeference)?,
        swapped: is_swapped.then(|| (notation.axes(), Place::At(notation, swapped).to_string())),
    };
    let grid = frame.clamp(notation.to_grid(at, georeference)?);
    let near = nearest(frame, grid, |col, row| !terrain.is_void(col, row));
    Ok((kind, near.map(|near| notation.write(near, georeference)).transpose()?))
}

/// The shapes of places, those of each apart, and all their points as sites.
///
/// # Errors
/// A point outside the DEM; a file that cannot be read or holds nothing.
pub(super) fn locate(
    role: Role,
    places: &[Place],
    terrain: &Terrain,
) -> Result<(Vec<Shapes>, Vec<Site>)> {
    let (mut all, mut sites) = (Vec::new(), Vec::new());
    for place in places {
        let first = sites.len();
        let mut shapes = Shapes::default();
        match place {
            Place::At(notation, at) => {
                sites.push(Site::new(role, place.to_string(), (*notation, *at), terrain)?);
            }
            Place::File(path) => {
                shapes = read_geojson(path, terrain.georeference())?;
                for &point in &shapes.points {
                    sites.push(site_of_file(role, path, point, terrain)?);
                }
            }
        }
        shapes.points = sites[first..].iter().map(|site| site.at).collect();
        all.push(shapes);
    }
    Ok((all, sites))
}

fn site_of_file(role: Role, path: &Path, grid: DVec2, terrain: &Terrain) -> Result<Site> {
    let lonlat = terrain.to_lonlat(grid)?;
    let name = format!("{} (point at {:.6},{:.6})", path.display(), lonlat.x, lonlat.y);
    Site::new(role, name, (Notation::LonLat, lonlat), terrain)
}

/// The good node nearest to `at` on the ground.
pub(super) fn nearest(
    frame: &GridFrame,
    at: DVec2,
    good: impl Fn(usize, usize) -> bool,
) -> Option<DVec2> {
    let spacing = frame.spacing(at.y);
    let nodes = (0..frame.rows()).flat_map(|row| (0..frame.cols()).map(move |col| (col, row)));
    nodes
        .filter(|&(col, row)| good(col, row))
        .map(|(col, row)| DVec2::new(col as f64, row as f64))
        .min_by(|a, b| {
            let square = |node: DVec2| ((node - at) * spacing).length_squared();
            square(*a).total_cmp(&square(*b))
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Ground;

    #[test]
    fn nearest_counts_ground_distance() {
        let frame =
            GridFrame::new(9, 9, DVec2::ZERO, DVec2::new(10.0, 50.0), Ground::METRES).unwrap();
        let good = |col, row| (col, row) == (4, 6) || (col, row) == (8, 4);
        assert_eq!(nearest(&frame, DVec2::splat(4.0), good), Some(DVec2::new(8.0, 4.0)));
        assert_eq!(nearest(&frame, DVec2::ZERO, |_, _| false), None);
    }
}
