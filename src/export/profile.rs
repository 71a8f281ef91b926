//! Profiles as a table: one row per sample, one route after the other.

use std::io::{self, Write};

use glam::DVec2;

use crate::route::ProfilePoint;
use crate::terrain::Terrain;

/// Writes CSV with a header whose names carry the units. `x` and `y` are map coordinates, `height_m` and all that comes of it is that of
/// the smooth surface, `dem_height_m` that of the DEM ([`Terrain::height`]), empty beside voids.
///
/// # Errors
/// Those of `out`.
pub fn write_profiles(
    out: impl Write,
    profiles: &[(impl AsRef<str>, impl AsRef<[ProfilePoint]>)],
    terrain: &Terrain,
) -> io::Result<()> {
    let mut table = csv::Writer::from_writer(out);
    table.write_record([
        "route",
        "distance_m",
        "x",
        "y",
        "height_m",
        "grade_percent",
        "side_slope_deg",
        "normal_curvature_per_m",
        "dem_height_m",
    ])?;
    for (name, points) in profiles {
        for p in points.as_ref() {
            let dem_height = terrain.height(terrain.frame().to_grid(DVec2::new(p.x, p.y)));
            table.write_record([
                name.as_ref().to_owned(),
                format!("{:.3}", p.distance_m),
                // Nine decimals hold a degree to 0.1 mm; trailing zeros go.
                trimmed(p.x, 9),
                trimmed(p.y, 9),
                format!("{:.3}", p.height_m),
                format!("{:.3}", p.grade_percent),
                format!("{:.3}", p.side_slope_deg),
                format!("{:.6e}", p.normal_curvature_per_m),
                if dem_height.is_nan() { String::new() } else { format!("{dem_height:.3}") },
            ])?;
        }
    }
    table.flush()
}

/// `value` with at most `decimals` decimals.
fn trimmed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{GridFrame, Ground};
    use crate::terrain::Crs;

    #[test]
    fn the_header_carries_units_and_names_are_quoted() {
        let point = ProfilePoint {
            distance_m: 12.5,
            x: -118.25,
            y: 34_000_100.0,
            height_m: 1_234.567_89,
            grade_percent: -3.0,
            side_slope_deg: 4.25,
            normal_curvature_per_m: -1.5e-4,
        };
        let frame =
            GridFrame::new(2, 2, DVec2::new(-118.75, 34_000_100.5), DVec2::ONE, Ground::METRES);
        let heights = vec![1000.0, 1100.0, 1200.0, 1300.0];
        let terrain = Terrain::new(frame.unwrap(), heights, Crs::none()).unwrap();
        let mut out = Vec::new();
        write_profiles(&mut out, &[("a, b", vec![point])], &terrain).unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "route,distance_m,x,y,height_m,grade_percent,side_slope_deg,normal_curvature_per_m,dem_height_m\n\
             \"a, b\",12.500,-118.25,34000100,1234.568,-3.000,4.250,-1.500000e-4,1150.000\n"
        );
    }
}
